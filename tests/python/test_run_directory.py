"""What users open our results with: numpy, meshio, PyVista, csv, json and any image viewer."""

import csv
import json
import subprocess
from pathlib import Path

import meshio
import numpy as np
import pytest
import pyvista

ROOT = Path(__file__).resolve().parent.parent.parent
CELLS = (24, 16)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A short run of case B on 24 × 16 cells, with frames at steps 0, 10, 20 and 25."""
    out = tmp_path_factory.mktemp("run") / "out"
    settings = [f"grid.cells={list(CELLS)}", "time.end=0.275", "time.report=[0.275]", "output.frames.every=10"]
    command = [
        ROOT / "target/release/driftmesh",
        "run",
        ROOT / "studies/burgers-b-stochastic.toml",
        "--quiet",
        "--out",
        out,
    ]
    subprocess.run(command + [part for setting in settings for part in ("--set", setting)], check=True)
    return out


@pytest.fixture(scope="module")
def final(run):
    return np.load(run / "final.npz")


def test_numpy_opens_the_last_state(final):
    shape = (CELLS[0] + 1, CELLS[1] + 1)
    assert sorted(final.files) == ["t", "u", "x", "y"]
    assert final["x"].shape == final["y"].shape == final["u"].shape == shape
    assert final["x"].dtype == np.float64
    assert float(final["t"]) == 0.275
    # first index along ξ: x grows with it and spans the box, y with the second
    assert np.all(final["x"][0] == 0) and np.all(final["x"][-1] == 1)
    assert np.all(final["y"][:, 0] == 0) and np.all(final["y"][:, -1] == 1)
    assert np.all(np.diff(final["x"], axis=0) > 0) and np.all(np.diff(final["y"], axis=1) > 0)


def test_the_error_is_what_the_summary_says(run, final):
    summary = json.loads((run / "summary.json").read_text())
    x, y, u, t = (final[key] for key in ("x", "y", "u", "t"))
    exact = 1 / (1 + np.exp((x + y - t) / (2 * 0.005)))
    report = summary["reports"][-1]
    assert report["t"] == t
    assert report["error"]["linf"] == pytest.approx(np.abs(u - exact).max(), rel=1e-12)
    # area of a node: a quarter of its cells', by the shoelace formula
    ax, ay = x[1:, 1:] - x[:-1, :-1], y[1:, 1:] - y[:-1, :-1]
    bx, by = x[:-1, 1:] - x[1:, :-1], y[:-1, 1:] - y[1:, :-1]
    cell = 0.5 * (ax * by - ay * bx)
    node = np.zeros_like(x)
    for i, j in ((0, 0), (1, 0), (0, 1), (1, 1)):
        node[i : i + CELLS[0], j : j + CELLS[1]] += cell / 4
    assert report["error"]["l2"] == pytest.approx(np.sqrt(np.sum((u - exact) ** 2 * node) / node.sum()), rel=1e-10)
    assert report["conserved"]["mass"] == pytest.approx(np.sum(u * node), rel=1e-12)
    # Q = ½ tr(JᵀJ)/√det of the averaged edges
    ex = 0.5 * (np.diff(x, axis=0)[:, 1:] + np.diff(x, axis=0)[:, :-1])
    ey = 0.5 * (np.diff(y, axis=0)[:, 1:] + np.diff(y, axis=0)[:, :-1])
    fx = 0.5 * (np.diff(x, axis=1)[1:] + np.diff(x, axis=1)[:-1])
    fy = 0.5 * (np.diff(y, axis=1)[1:] + np.diff(y, axis=1)[:-1])
    q = 0.5 * (ex**2 + ey**2 + fx**2 + fy**2) / np.abs(ex * fy - ey * fx)
    assert report["quality"]["q_max"] == pytest.approx(q.max(), rel=1e-12)
    assert report["quality"]["q_mean"] == pytest.approx(q.mean(), rel=1e-12)


def test_meshio_and_pyvista_open_every_frame(run):
    frames = sorted((run / "frames").iterdir())
    assert [frame.name for frame in frames] == [f"step-{n:06}.vtu" for n in (0, 10, 20, 25)]
    for frame in frames:
        mesh, grid = meshio.read(frame), pyvista.read(frame)
        assert mesh.cells[0].type == "quad" and len(mesh.cells[0].data) == grid.n_cells == CELLS[0] * CELLS[1]
        assert np.array_equal(mesh.points, grid.points)
        for name in ("u", "rho"):
            assert np.array_equal(mesh.point_data[name], grid.point_data[name])
        # cells are oriented counter-clockwise and fill the box
        areas = grid.compute_cell_sizes(length=False, volume=False)["Area"]
        assert areas.min() > 0 and areas.sum() == pytest.approx(1, abs=1e-12)


def test_the_series_has_its_times(run, final):
    reader = pyvista.get_reader(run / "run.pvd")
    assert reader.time_values == pytest.approx([0.25, 0.26, 0.27, 0.275])
    reader.set_active_time_value(reader.time_values[-1])
    last = reader.read()[0]
    assert np.array_equal(last.point_data["u"], final["u"].ravel())
    assert np.array_equal(last.points[:, 0], final["x"].ravel())


def test_the_history_has_a_row_a_step(run):
    rows = list(csv.DictReader((run / "history.csv").open()))
    assert len(rows) == 26
    assert float(rows[-1]["t"]) == 0.275
    assert all(float(row["min_scaled_jacobian"]) > 0 and float(row["q_max"]) >= 1 for row in rows)
    seconds = [float(row["seconds"]) for row in rows]
    assert seconds == sorted(seconds)


def test_the_picture_is_a_picture(run):
    image = pyvista.read(run / "mesh.png")
    assert min(image.dimensions[:2]) > 600
    assert (run / "mesh.svg").read_text().startswith("<svg ")
