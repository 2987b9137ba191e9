"""Meshes of domains that are no boxes."""

import pickle
import struct

import numpy as np
import pytest
from driftmesh import Arclength, Mesh, MeshGenerator, laplacian_stencils, transfer


def ring(n=10, m=40, turn=1.0):
    """An O-grid, whose closed axis runs against the clock, or with it where `turn` is -1."""
    r, angle = np.meshgrid(np.linspace(1, 2, n + 1), turn * np.linspace(0, 2 * np.pi, m + 1), indexing="ij")
    return r * np.cos(angle), r * np.sin(angle)


def test_nodes_slide_along_the_circles_of_a_ring():
    mesh = Mesh.mapped("(1 + r)*cos(2*pi*s)", "(1 + r)*sin(2*pi*s)", cells=(12, 48), closed=(False, True))
    generator = MeshGenerator(monitor=Arclength(relative=30), relaxation={"steps": 15})
    start = mesh
    for _ in range(20):
        mesh = generator.step(mesh, np.tanh(20 * (mesh.x - 0.3)), 0.1)
    for end, radius in ((0, 1.0), (-1, 2.0)):
        assert np.abs(np.hypot(mesh.x[end], mesh.y[end]) - radius).max() < 1e-12
        assert np.abs(mesh.x[end] - start.x[end]).max() > 0.02
    assert mesh.quality().min_scaled_jacobian > 0
    assert np.abs(mesh.x[:, 0] - mesh.x[:, -1]).max() < 1e-14
    assert abs(mesh.areas.sum() - 3 * np.pi) < 1e-12


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_a_mesh_by_arrays_keeps_its_nodes_and_its_curves(turn):
    x, y = ring(turn=turn)
    mesh = Mesh.mapped(x, y, closed=(False, True))
    # one that runs with the clock is taken the other way round
    own = slice(None, None, -1 if turn < 0 else None)
    assert np.abs(mesh.x - x[:, own]).max() < 1e-14
    assert mesh.closed == (False, True) and mesh.periodic == (False, False)
    u = np.tanh(20 * (np.hypot(mesh.x - 1.5, mesh.y) - 0.4))
    moved = MeshGenerator().step(mesh, u, 0.1)
    assert np.abs(np.hypot(moved.x[0], moved.y[0]) - 1).max() < 2e-6
    carried = transfer(u, mesh, moved)
    assert abs((carried * moved.areas).sum() - (u * mesh.areas).sum()) < 1e-12


def test_closed_axes_are_known_everywhere():
    x, y = ring(20, 80)
    for mesh in (Mesh(x, y, periodic=(False, True)), Mesh(x, y, closed=(False, True))):
        assert mesh.closed == (False, True)
        points = 1.5 * np.cos([0.01, 2, 6.28]), 1.5 * np.sin([0.01, 2, 6.28])
        assert np.abs(mesh.interpolate(mesh.x, *points, order=3) - points[0]).max() < 1e-4
    laplacian = laplacian_stencils(x, y, periodic=(False, True))
    found = (laplacian @ (x**2 + y**2).ravel()).reshape(x.shape)
    assert np.abs(found[1:-1] - 4).max() < 1e-9  # at the seam as well
    # a generator takes the sides of a mesh by arrays for curves
    assert np.abs(MeshGenerator().step(Mesh(x, y), np.hypot(x, y), 0.1).x - x).max() < 1e-12


def test_meshes_of_domains_are_pickled():
    mesh = Mesh.mapped(*ring(), closed=(False, True))
    again = pickle.loads(pickle.dumps(mesh))
    assert again == mesh
    u = np.tanh(20 * (mesh.x - 0.3))
    assert MeshGenerator().step(again, u, 0.1) == MeshGenerator().step(mesh, u, 0.1)


def files(folder, around=40):
    """The same mesh in every format that is read, by its name."""
    x, y = ring(m=around)
    n, m = x.shape
    np.savez(folder / "grid.npz", x=x, y=y)
    columns = [values.ravel(order="F") for values in (x, y)]
    text = "\n".join(" ".join(map(repr, map(float, column))) for column in columns)
    (folder / "grid.xyz").write_text(f"1\n{n} {m} 1\n{text}\n{'0 ' * (n * m)}\n")
    (folder / "plane.x").write_text(f"{n} {m}\n{text}\n")
    numbers = np.concatenate(columns)
    (folder / "binary.x").write_bytes(struct.pack("<2i", n, m) + numbers.astype("<f8").tobytes())
    records = [struct.pack(">i", 1), struct.pack(">2i", n, m), numbers.astype(">f8").tobytes()]
    (folder / "fortran.xyz").write_bytes(
        b"".join(struct.pack(">i", len(r)) + r + struct.pack(">i", len(r)) for r in records)
    )
    points = " ".join(f"{a!r} {b!r} 0" for a, b in zip(*(column.tolist() for column in columns), strict=True))
    extent = f'"0 {n - 1} 0 {m - 1} 0 0"'
    (folder / "grid.vts").write_text(
        f'<VTKFile type="StructuredGrid"><StructuredGrid WholeExtent={extent}><Piece Extent={extent}><Points>'
        f'<DataArray type="Float64" NumberOfComponents="3" format="ascii">{points}</DataArray></Points></Piece>'
        "</StructuredGrid></VTKFile>"
    )
    return ["grid.npz", "grid.xyz", "plane.x", "binary.x", "fortran.xyz", "grid.vts"]


def test_files_of_every_format_are_the_same_mesh(tmp_path):
    expected = Mesh.mapped(*ring(), closed=(False, True))
    for name in files(tmp_path):
        mesh = Mesh.mapped(tmp_path / name, closed=(False, True))
        assert np.array_equal(mesh.x, expected.x) and np.array_equal(mesh.y, expected.y), name


def test_a_run_on_a_file_of_ones_own(tmp_path):
    from driftmesh import run

    files(tmp_path, around=80)
    study = {
        "study": {"name": "own", "kind": "moving-mesh"},
        "domain": {"mesh": str(tmp_path / "grid.xyz"), "closed": [False, True]},
        "grid": {"cells": [10, 80]},
        "time": {"start": 0.0, "end": 0.1, "step": 0.02},
        "pde": {"kind": "prescribed", "u": "tanh(10*(x - 0.3 - t))"},
        "output": {"report": False},
    }
    result = run(study, out=tmp_path / "out")
    assert np.abs(np.hypot(result.mesh.x[0], result.mesh.y[0]) - 1).max() < 1e-6
    again = Mesh.mapped(tmp_path / "out" / "final.vts", closed=(False, True))
    assert np.abs(again.x - result.mesh.x).max() < 1e-14


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("s*(1 - s)", "r"), "area"),
        (("log(s)", "r"), "-inf"),
        (("s + 0.6*sin(2*pi*s)*r", "r"), "folds"),
        ((np.full((5, 5), np.nan), np.zeros((5, 5))), "nan"),
        ((np.zeros((5, 5)), np.zeros((5, 4))), "shape"),
        (("missing.xyz",), "cannot be read"),
    ],
)
def test_what_is_no_domain_is_refused(arguments, said):
    with pytest.raises(ValueError, match=said):
        Mesh.mapped(*arguments, cells=(8, 8))
    x, y = ring()
    with pytest.raises(ValueError, match="apart by"):
        Mesh.mapped(x[:, :-1], y[:, :-1], closed=(False, True))
    with pytest.raises(ValueError, match="against the clock"):
        Mesh.mapped(*ring(turn=-1.0))
