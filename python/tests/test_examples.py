"""The scripts in python/examples, on fewer steps and cells: what a reader may expect of them, by exact solutions."""

import os
import sys
from ctypes.util import find_library
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
sys.path.insert(0, str(EXAMPLES))


def test_finite_elements_on_a_moving_mesh_beat_a_uniform_one_of_sixteen_times_the_nodes():
    import allen_cahn_scikit_fem as example

    (moving, _), (uniform, _) = example.run(40, True, steps=25), example.run(160, False, steps=25)
    assert moving < 0.5 * uniform and moving < 4e-3, (moving, uniform)
    text = (EXAMPLES / "allen_cahn_scikit_fem.py").read_text().split('"""', 2)[2]
    assert sum(bool(line.strip()) for line in text.splitlines()) <= 60


def test_a_sweep_runs_in_processes(tmp_path):
    import sweep

    errors = sweep.sweep([0.01], [16], tmp_path, processes=2)
    assert errors[0.01, 16, "whole"] < 0.5 * errors[0.01, 16, "fixed"]
    assert {path.name for path in tmp_path.iterdir()} == {"whole-16-0.01", "fixed-16-0.01"}


def test_solve_ivp_on_forty_moving_cells_beats_640_equal_ones():
    import burgers_solve_ivp as example

    (moving, _), (equal, _), (coarse, _) = example.run(40, steps=25), example.run(640, steps=0), example.run(40, 0)
    assert moving < 0.3 * equal and moving < 0.01 * coarse, (moving, equal, coarse)


def test_what_solve_ivp_integrates_keeps_a_constant_on_moving_nodes():
    import burgers_solve_ivp as example

    x = np.linspace(0, 1, 21) ** 2
    assert np.abs(example.rate(np.full(21, 0.7), x, np.sin(9 * x))).max() < 1e-12


def test_a_study_on_forty_cells_beats_fipy_on_four_times_as_many_and_both_have_order_two(tmp_path):
    import nagumo_fipy as example

    ours = [example.moving(cells, tmp_path / str(cells)) for cells in (40, 80)]
    fipy = [example.equal(cells) for cells in (80, 160)]
    assert ours[0] < 0.15 * fipy[1], (ours, fipy)
    assert all(3.5 < errors[0] / errors[1] < 4.8 for errors in (ours, fipy)), (ours, fipy)


@pytest.mark.skipif("CI" not in os.environ and find_library("EGL") is None, reason="PyVista has nothing to draw with")
def test_pyvista_draws_every_frame_of_a_run_without_a_window(tmp_path):
    import pyvista_animation as example
    from PIL import Image, ImageSequence

    import driftmesh

    small = {"grid.cells": [16, 16], "pde.viscosity": 0.02, "output.frames": {"times": [0.25, 0.75, 1.25]}}
    run = driftmesh.run(example.STUDY, out=tmp_path / "run", set=small)
    assert example.animate(run, tmp_path / "relief.gif", window=(320, 240)) == len(run.frames) == 3
    alone = SimpleNamespace(frames=run.frames[-1:])
    assert example.animate(alone, tmp_path / "last.gif", window=(320, 240)) == 1
    pictures, (last,) = (
        [np.asarray(picture.convert("RGB")).astype(int) for picture in ImageSequence.Iterator(Image.open(path))]
        for path in (tmp_path / "relief.gif", tmp_path / "last.gif")
    )
    # the front goes from u = 1, which is yellow, to u = 0, which is dark blue
    yellow, blue = (
        [np.count_nonzero(of(*np.moveaxis(picture, -1, 0))) for picture in pictures]
        for of in (lambda r, g, b: (r > 150) & (g > 150) & (b < 90), lambda r, g, b: (g < 50) & (r < b) & (b > 50))
    )
    assert len(pictures) == 3 and pictures[0].shape == (240, 320, 3)
    assert np.abs(pictures[2] - last).mean() < 2.5, "a frame before is still there"
    assert yellow[0] < yellow[1] < yellow[2] and blue[0] > blue[1] > blue[2] > 0, (yellow, blue)


def test_coupled_solvers_keep_their_heat_to_rounding_only_with_transfer_and_beat_equal_cells():
    import heat_exchanger as example

    hot, cold, off = example.run(40, "conservative", steps=60)
    equal = example.run(160, "uniform", steps=60)
    assert abs(off) < 1e-13 and abs(example.run(40, "interpolate", steps=60)[2]) > 1e-5
    assert hot < 0.2 * equal[0] and cold < 0.5 * equal[1], (hot, cold, equal)


@pytest.mark.parametrize("name", ["burgers_solve_ivp", "nagumo_fipy", "pyvista_animation", "heat_exchanger"])
def test_recipes_fit_on_a_page(name):
    assert len((EXAMPLES / f"{name}.py").read_text("utf-8").splitlines()) <= 80
