"""Studies from Python: the same as by the program, with arrays, exceptions and Ctrl-C."""

import copy
import json
import os
import pickle
import signal
import subprocess
import sys
import textwrap
import time
import warnings
from pathlib import Path

import meshio
import numpy as np
import pytest

import driftmesh
from driftmesh import MeshError, StudyError
from driftmesh.errors import NotConverged, RunWarning

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "target/release/driftmesh"
STUDY = {
    "study": {"name": "front", "kind": "moving-mesh"},
    "grid": {"cells": [16, 12]},
    "time": {"start": 0.25, "end": 0.3, "step": 0.005},
    "pde": {"kind": "burgers", "viscosity": 0.005},
    "output": {"frames": {"every": 5}, "report": False},
}


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return driftmesh.run(STUDY, out=tmp_path_factory.mktemp("run") / "front")


def test_results_are_those_of_the_program(tmp_path):
    settings = {
        "time.end": 0.3,
        "time.report": [0.3],
        "grid.cells": np.array([16, 16]),
        "mesh.generator.kind": "whole",
        "output.report": False,
    }
    ours = driftmesh.run(ROOT / "studies/burgers.toml", out=tmp_path / "ours", set=settings)
    command = [PROGRAM, "run", ROOT / "studies/burgers.toml", "--out", tmp_path / "theirs", "--quiet"]
    assignments = [
        "time.end=0.3",
        "time.report=[0.3]",
        "grid.cells=[16, 16]",
        "mesh.generator.kind=whole",
        "output.report=false",
    ]
    subprocess.run(command + [part for a in assignments for part in ("--set", a)], check=True)
    theirs = driftmesh.load(tmp_path / "theirs")
    assert ours.summary["reports"] == theirs.summary["reports"] and ours.summary["work"] == theirs.summary["work"]
    for name in ("x", "y", "u", "t"):
        np.testing.assert_array_equal(ours.final[name], theirs.final[name])


def test_a_result_holds_what_the_directory_holds(result):
    assert result.status == "completed" and result.summary["work"]["steps"] == 10
    assert result.history["t"] == pytest.approx(np.linspace(0.25, 0.3, 11))
    assert np.isnan(result.history["interface_noise"]).all() and np.isfinite(result.history["error_linf"]).all()
    assert [frame.t for frame in result.frames] == pytest.approx([0.25, 0.275, 0.3])
    last = result.frames[-1]
    theirs = meshio.read(last.path)
    np.testing.assert_array_equal(last.x.ravel(), theirs.points[:, 0])
    np.testing.assert_array_equal(last["mesh velocity"].reshape(-1, 2), theirs.point_data["mesh velocity"][:, :2])
    for name in ("x", "y"):
        np.testing.assert_array_equal(getattr(last, name), result.final[name])
    np.testing.assert_array_equal(last["u"], result.final["u"])
    assert last.mesh == result.mesh and last.mesh.cells == (16, 12)
    with pytest.raises(KeyError, match="this frame has u, rho"):
        last["v"]


def test_results_pickle_and_copy(result):
    for other in (pickle.loads(pickle.dumps(result)), copy.deepcopy(result)):
        assert other.summary == result.summary and other.frames[1].mesh == result.frames[1].mesh
        np.testing.assert_array_equal(other.final["u"], result.final["u"])


def test_frames_of_a_run_that_was_replaced_are_refused(tmp_path):
    """The directory holds the frames of one run: those of another would be read in their place."""
    first, second = (driftmesh.run(STUDY, out=tmp_path / "out", set={"pde.viscosity": nu}) for nu in (0.005, 0.02))
    with pytest.raises(RuntimeError, match="has been replaced(.|\n)*`out`"):
        first.frames[-1]["u"]
    with pytest.raises(RuntimeError, match="has been replaced"):
        first.animate()
    np.testing.assert_array_equal(second.frames[-1]["u"], second.final["u"])
    second.frames[0].path.unlink()
    with pytest.raises(RuntimeError, match="is gone"):
        second.frames[0]["u"]


def test_meshes_of_periodic_runs_wrap_around(tmp_path):
    settings = {
        "grid.cells": [16, 16],
        "time.end": 0.05,
        "time.report": [0.05],
        "output.report": False,
        "compare.generator.kind": "fixed",
    }
    result = driftmesh.run(ROOT / "studies/burgers-periodic.toml", out=tmp_path / "out", set=settings)
    for mesh in (result.mesh, result.frames[-1].mesh):
        assert mesh.periodic == (True, True) and mesh.lower == (0, 0) and mesh.upper == (2 * np.pi, 2 * np.pi)
    u = driftmesh.transfer(result.final["u"], result.mesh, result.frames[0].mesh)
    assert u.shape == result.final["u"].shape


def test_results_are_told_apart_and_shown_shortly(result):
    assert result == result and result != copy.deepcopy(result)
    assert repr(result).startswith("<Run 'front', completed after 10 steps, in ") and len(repr(result)) < 300


@pytest.mark.parametrize(
    ("study", "settings", "arrays"),
    [
        ("laplacian-model-problem", {}, {"x": (22, 18), "u": (22, 18)}),
        (
            "stefan-slides",
            {"time.end": 0.05, "time.report": [0.05], "grid.cells": [10, 6, 6]},
            {"x": (11, 13), "u": (11, 13)},
        ),
        ("table-8-1-nonlinear", {}, {"x": (101,)}),
        ("shrinking-core", {"time.end": 0.05, "time.report": [0.05]}, {"x": (64,), "gas": (64,), "solid": (64,)}),
        ("moving-front-1d", {"time.end": 0.02}, {"x": (101,), "path": (None, 101)}),
    ],
)
def test_every_kind_runs_and_draws(study, settings, arrays, tmp_path):
    result = driftmesh.run(
        ROOT / f"studies/{study}.toml", out=tmp_path / "out", set=settings | {"output.report": False}
    )
    assert result.status == "completed"
    for name, shape in arrays.items():
        assert result.final[name].shape[-len(shape) :][-1] == shape[-1] and np.isfinite(result.final[name]).all()
    result.plot(tmp_path / "plot.png")
    assert (tmp_path / "plot.png").stat().st_size > 5000


def test_a_front_is_a_curve_at_every_step(result, tmp_path):
    settings = {"time.end": 0.05, "time.report": [0.05], "grid.cells": [10, 6, 8], "output.report": False}
    run = driftmesh.run(ROOT / "studies/stefan-slides.toml", out=tmp_path / "out", set=settings)
    fronts, steps = run.fronts, run.summary["work"]["steps"]
    assert fronts.t.shape == (steps + 1,) and fronts.x.shape == (11,) and fronts.y.shape == (steps + 1, 11)
    # the front at the start as the study gives it, and the seventh row of the mesh at the end
    assert np.allclose(fronts.y[0], 1 + np.cos(fronts.x) / 4, atol=1e-14)
    assert np.array_equal(fronts.y[-1], run.final["y"][:, 6]) and np.array_equal(fronts.x, run.final["x"][:, 0])
    assert np.array_equal(fronts.t, run.history["t"])
    for frame in run.frames:
        assert set(frame.names) >= {"u", "phase"} and "rho" not in frame.names
        [step] = np.flatnonzero(fronts.t == frame.t)
        assert np.array_equal(frame.y[:, 6], fronts.y[step])
    with pytest.raises(ValueError, match="has no front.csv"):
        result.fronts


def test_pictures_and_animations(result, tmp_path):
    import matplotlib.pyplot as plt
    from PIL import Image

    before = plt.get_fignums()
    result.plot(tmp_path / "plot.png")
    assert plt.get_fignums() == before
    result.animate(tmp_path / "moving.gif")
    with Image.open(tmp_path / "moving.gif") as moving:
        assert moving.n_frames == 3
    with pytest.raises(ValueError, match="a vector"):
        result.animate(field="mesh velocity")


def test_the_iterates_of_a_line_are_frames(tmp_path):
    from PIL import Image

    result = driftmesh.run(
        ROOT / "studies/table-8-1-nonlinear.toml", out=tmp_path / "out", set={"output.report": False}
    )
    iterations = result.summary["iterations"]
    assert [frame.t for frame in result.frames] == [iterate["n"] for iterate in iterations]
    assert np.array_equal(result.frames[-1].x, result.final["x"])
    assert np.allclose(result.frames[0].x, np.linspace(0, 1, 101), rtol=0, atol=1e-15)
    result.animate(tmp_path / "moving.gif")
    with Image.open(tmp_path / "moving.gif") as moving:
        assert moving.n_frames == len(iterations)


MISTAKES = [
    ("[grid]\ncels = [3, 3]", {}),
    ('[pde]\nkind = "burger"', {}),
    ('[pde]\nkind = "burgers"\nviscosity = -1', {}),
    ("", {"pde.viscosty": 0.1}),
    ("[grid\ncells = [3, 3]", {}),
    ('[monitor]\nkind = "arclength"\nof = "u +* 2"', {}),
]


@pytest.mark.parametrize(("text", "settings"), MISTAKES)
def test_mistakes_read_as_those_of_the_program(text, settings, tmp_path):
    head = '[study]\nname = "wrong"\nkind = "moving-mesh"\n'
    rest = "" if "[pde]" in text else '[pde]\nkind = "burgers"\nviscosity = 0.005\n'
    grid = "" if "[grid" in text else "[grid]\ncells = [8, 8]\n"
    path = tmp_path / "wrong.toml"
    path.write_text(head + "[time]\nstart = 0.25\nend = 0.3\n" + rest + grid + text)
    with pytest.raises(StudyError) as error:
        driftmesh.run(path, set=settings)
    command = [PROGRAM, "check", path] + [part for k, v in settings.items() for part in ("--set", f"{k}={v}")]
    said = subprocess.run(command, capture_output=True, text=True).stderr
    assert f"error: {error.value}\n" == said.replace("--> --set:", "--> set:") and "^" in said
    assert isinstance(error.value, ValueError) and not Path("out/wrong").exists()


def test_studies_as_dicts_show_their_mistakes():
    with pytest.raises(StudyError, match=r"unknown key `cels`\n +--> the study:\d+:1(.|\n)*did you mean `cells`"):
        driftmesh.run(STUDY | {"grid": {"cels": [16, 12]}})
    with pytest.raises(StudyError, match="unknown name `movie`|movie"):
        driftmesh.run({"study": {"name": "a", "kind": "movie"}})
    for key in ("", "a b", "a=b", "monitor.", 3):
        with pytest.raises(ValueError, match="`set` has the key"):
            driftmesh.run(STUDY, set={key: 1})
    with pytest.raises(TypeError, match="no object"):
        driftmesh.run(STUDY | {"grid": {"cells": object()}})


def test_directories_and_files_that_will_not_do(tmp_path):
    with pytest.raises(FileNotFoundError, match="no such file"):
        driftmesh.run(tmp_path / "none.toml")
    with pytest.raises(FileNotFoundError, match="no run directory"):
        driftmesh.load(tmp_path)
    with pytest.raises(OSError, match="it is a directory"):
        driftmesh.run(tmp_path)
    (tmp_path / "mine.txt").touch()
    with pytest.raises(FileExistsError, match=r"mine\.txt(.|\n)*`out`"):
        driftmesh.run(STUDY, out=tmp_path)


def test_failures_come_with_what_there_is(tmp_path):
    settings = {"monitor": {"kind": "arclength", "strength": {"absolute": 1e6}, "smoothing": 0}}
    mesh = {"mesh": {"form": "gradient", "relaxation": 1e-4, "start": "uniform"}}
    with pytest.raises(MeshError, match=r"at t = 0\.\d+ \(step \d+\): (.|\n)*help: .*\(now ") as error:
        driftmesh.run(STUDY | settings | mesh, out=tmp_path / "out")
    failure = error.value
    summary = json.loads((tmp_path / "out/summary.json").read_text())
    assert type(failure).__name__ == "".join(word.capitalize() for word in summary["error"]["kind"].split("-"))
    assert (failure.t, failure.step) == (summary["error"]["t"], summary["error"]["step"])
    assert failure.directory == tmp_path / "out" and failure.result.status == "failed"
    assert failure.result.final["u"].shape == (17, 13)
    with pytest.raises(NotConverged) as error:
        driftmesh.run(ROOT / "studies/schwarz-not-converged.toml", out=tmp_path / "line")
    assert error.value.result.status == "not-converged"


def test_warnings_are_warnings(tmp_path):
    study = STUDY | {
        "grid": {"cells": [40, 40]},
        "time": {"start": 0.0, "end": 0.5, "step": 0.01},
        "pde": {"kind": "prescribed", "u": "tanh(200*(x + 0.09*sin(2*pi*y) - 0.5))"},
        "mesh": {"relaxation": {"steps": 2, "prediction": 0.2}},
    }
    with pytest.warns(RuntimeWarning, match="mesh.relaxation"):
        result = driftmesh.run(study, out=tmp_path / "out")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(RunWarning, match="mesh.relaxation") as warning:
            driftmesh.run(study, out=tmp_path / "again")
    np.testing.assert_array_equal(warning.value.result.final["u"], result.final["u"])


def test_the_bar_tells_time_and_step(tmp_path, capsys):
    driftmesh.run(STUDY | {"grid": {"cells": [80, 80]}}, out=tmp_path / "out", progress=True)
    said = capsys.readouterr().err
    assert "front: t = 0." in said and "100 %" in said


def test_the_bar_stays_where_a_run_failed(tmp_path, capsys):
    settings = {"monitor": {"kind": "arclength", "strength": {"absolute": 1e6}, "smoothing": 0}}
    mesh = {"mesh": {"form": "gradient", "relaxation": 1e-4, "start": "uniform"}}
    with pytest.raises(MeshError):
        driftmesh.run(STUDY | settings | mesh, out=tmp_path / "out", progress=True)
    said = capsys.readouterr().err
    assert "front" in said and "100 %" not in said


def interrupted(study, settings, directory):
    """What a script prints that is interrupted when the run has begun to write, and how long it took then."""
    script = f"""
        import driftmesh
        try:
            driftmesh.run({study!r}, out={str(directory)!r}, set={settings!r})
        except KeyboardInterrupt as interrupt:
            print(interrupt)
    """
    process = subprocess.Popen([sys.executable, "-c", textwrap.dedent(script)], stdout=subprocess.PIPE, text=True)
    wanted = directory / ("frames/step-000001.vtu" if "output.frames.every" in settings else "summary.json")
    deadline = time.monotonic() + 60
    while not wanted.exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    began = time.monotonic()
    os.kill(process.pid, signal.SIGINT)
    return process.communicate(timeout=60)[0], time.monotonic() - began


def test_ctrl_c_leaves_the_last_good_state(tmp_path):
    settings = {"grid.cells": [60, 60], "time.step": 1e-5, "mesh.start": "uniform", "output.frames.every": 1}
    said, _ = interrupted(str(ROOT / "studies/burgers.toml"), settings, tmp_path / "out")
    assert said.startswith("interrupted at t = 0.25") and f"the last good state is in {tmp_path}/out" in said
    result = driftmesh.load(tmp_path / "out")
    assert result.status == "interrupted" and result.final["t"] == pytest.approx(result.history["t"][-1])
    assert result.frames[-1]["u"] == pytest.approx(result.final["u"])


def test_ctrl_c_leaves_what_to_go_on_from(tmp_path):
    settings = {
        "grid.cells": [40, 40],
        "time.end": 0.26,
        "time.report": [0.26],
        "output.frames.every": 1,
        "output.report": False,
    }
    study = str(ROOT / "studies/burgers.toml")
    said, _ = interrupted(study, settings | {"time.step": 5e-5}, tmp_path / "cut")
    assert "run(…, resume=True) goes on" in said and driftmesh.load(tmp_path / "cut").status == "interrupted"
    with pytest.raises(OSError, match=r"`grid.cells` is \[40, 40\]; here it is \[41, 40\](.|\n)*leave `resume` out"):
        driftmesh.run(
            study, out=tmp_path / "cut", set=settings | {"time.step": 5e-5, "grid.cells": [41, 40]}, resume=True
        )
    cut, whole = (
        driftmesh.run(study, out=tmp_path / name, set=settings | {"time.step": 5e-5}, resume=True)
        for name in ("cut", "whole")
    )
    assert not list((tmp_path / "cut").glob("checkpoint*")) and cut.status == "completed"
    assert cut.summary["reports"] == whole.summary["reports"] and cut.summary["work"] == whole.summary["work"]
    for name, column in whole.history.items():
        assert name == "seconds" or np.array_equal(cut.history[name], column, equal_nan=True)
    assert np.all(np.diff(cut.history["seconds"]) > 0)
    for name in ("final.npz", "run.pvd", "mesh.png"):
        assert (tmp_path / "cut" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    # one that is complete is opened as it is
    before = (tmp_path / "cut/summary.json").stat().st_mtime_ns
    assert (
        driftmesh.run(study, out=tmp_path / "cut", set=settings | {"time.step": 5e-5}, resume=True).status
        == "completed"
    )
    assert (tmp_path / "cut/summary.json").stat().st_mtime_ns == before


def test_ctrl_c_is_heard_where_nothing_can_be_stopped(tmp_path):
    settings = {"grid.cells": [2000, 2000]}
    said, seconds = interrupted(str(ROOT / "studies/laplacian-model-problem.toml"), settings, tmp_path / "out")
    assert "goes on in the background" in said and seconds < 5


def test_ctrl_c_leaves_a_line_where_it_was(tmp_path):
    settings = {"time.step": 1e-7}
    said, _ = interrupted(str(ROOT / "studies/moving-front-1d.toml"), settings, tmp_path / "out")
    assert said.startswith("interrupted at t = "), said
    assert driftmesh.load(tmp_path / "out").status == "interrupted"
