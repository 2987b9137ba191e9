"""Monitors by curvature, and limits on the sizes of cells."""

import copy
import pickle

import numpy as np
import pytest

from driftmesh import Arclength, Curvature, Given, Limited, Mesh, MeshGenerator, RootGradient, run


def interpolation_error(mesh, u, points=40):
    """The L² error of linear interpolation on the cells of a line, by Gauss's rule."""
    s, weights = np.polynomial.legendre.leggauss(points)
    h = np.diff(mesh.x)
    x = mesh.x[:-1, None] + h[:, None] * (s + 1) / 2
    linear = np.interp(x, mesh.x, u(mesh.x))
    return np.sqrt((h[:, None] / 2 * weights * (u(x) - linear) ** 2).sum())


def error_in_the_plane(mesh, u, points=601):
    x, y = np.meshgrid(*[(np.arange(points) + 0.5) / points] * 2, indexing="ij")
    return np.sqrt(np.mean((mesh.interpolate(u(mesh.x, mesh.y), x.ravel(), y.ravel()) - u(x, y).ravel()) ** 2))


def test_the_density_is_that_of_the_formula_with_second_order():
    """u = sin 3x cos 2y on a curved mesh, whose Hessian is known; α by a sum over a fine grid."""

    def curved2(x, y):
        u, xy = np.sin(3 * x) * np.cos(2 * y), -6 * np.cos(3 * x) * np.sin(2 * y)
        return (81 + 16) * u**2 + 2 * xy**2

    fine = (np.arange(2000) + 0.5) / 2000
    alpha = 2 / np.mean(curved2(*np.meshgrid(fine, fine)) ** (1 / 6)) ** 6

    def error(n):
        mesh = Mesh.uniform(cells=(n, n))
        bend = 0.05 * np.sin(np.pi * mesh.x) * np.sin(np.pi * mesh.y)
        mesh = mesh.moved(mesh.x + bend, mesh.y - bend)
        monitor = Curvature(relative=2, smoothing=0)
        rho = MeshGenerator(monitor=monitor).density(mesh, np.sin(3 * mesh.x) * np.cos(2 * mesh.y))
        exact = (1 + alpha * curved2(mesh.x, mesh.y)) ** (1 / 6)
        return np.abs(rho - exact)[2:-2, 2:-2].max()

    order = np.log2(error(40) / error(80))
    assert order > 1.8, f"observed order {order:.2f}"


@pytest.mark.parametrize("width", [0.02, 0.005])
def test_curvature_interpolates_a_layer_better_than_the_arc_length(width):
    def u(x):
        return np.tanh((x - 0.4) / width)

    errors = {}
    for monitor in (Curvature(), Arclength(), RootGradient()):
        mesh = MeshGenerator(monitor=monitor).adapt(Mesh.uniform(cells=80), u)
        errors[type(monitor).__name__] = interpolation_error(mesh, u)
    print(errors)
    # RootGradient puts more nodes into a single thin layer, and has less still
    assert errors["RootGradient"] < errors["Curvature"] < 0.85 * errors["Arclength"]


def test_curvature_regains_the_order_that_a_root_costs():
    """x^0.6: on equal cells the L² error has the order 0.6 + ½, on cells by the curvature 2."""

    def error(n, adapted):
        mesh = Mesh.uniform(cells=n)
        mesh = MeshGenerator(monitor=Curvature()).adapt(mesh, lambda x: x**0.6) if adapted else mesh
        return interpolation_error(mesh, lambda x: x**0.6)

    assert abs(np.log2(error(40, False) / error(80, False)) - 1.1) < 0.1
    assert np.log2(error(40, True) / error(80, True)) > 1.7


def test_curvature_interpolates_a_round_layer_better_than_the_arc_length():
    def u(x, y):
        return np.tanh((np.hypot(x - 0.1, y + 0.1) - 0.7) / 0.03)

    errors = {}
    for monitor in (Curvature(), Arclength()):
        mesh = MeshGenerator(monitor=monitor).adapt(Mesh.uniform(cells=(40, 40)), u)
        errors[type(monitor).__name__] = error_in_the_plane(mesh, u)
    uniform = error_in_the_plane(Mesh.uniform(cells=(40, 40)), u)
    print(errors, uniform)
    assert errors["Curvature"] < 0.8 * errors["Arclength"]
    assert errors["Curvature"] < 0.4 * uniform


@pytest.mark.parametrize("u", [lambda x: 0 * x + 3, lambda x: 1e6 + 2 * x])
def test_what_is_not_curved_but_for_rounding_leaves_equal_cells(u):
    line = Mesh.uniform(cells=60)
    line = line.moved(line.x**1.2)
    assert (MeshGenerator(monitor=Curvature()).density(line, u(line.x)) == 1).all()


def edges(mesh, axis=0):
    """Lengths of the edges along an axis, in units of the mean of each mesh line."""
    lengths = np.linalg.norm(np.diff(mesh._nodes, axis=axis), axis=-1)
    return lengths / lengths.mean(axis=axis, keepdims=True)


def bump(mesh, _):
    return 1 + 99 * np.exp(-((30 * (mesh.x - 0.4)) ** 2))


@pytest.mark.parametrize("monitor", [RootGradient(), Curvature(), Arclength(relative=1000), bump])
@pytest.mark.parametrize(("smallest", "largest"), [(0.3, None), (None, 1.2), (0.3, 1.3), (0.8, None)])
def test_limits_hold_on_a_line(monitor, smallest, largest):
    """At rest the limits hold to a hundredth, where without them cells are beyond, and the smallest is reached."""

    def u(x):
        return np.tanh(300 * (x - 0.4))

    free = MeshGenerator(monitor=monitor).adapt(Mesh.uniform(cells=60), u)
    generator = MeshGenerator(monitor=Limited(monitor, smallest=smallest, largest=largest))
    found = edges(generator.adapt(Mesh.uniform(cells=60), u))
    if smallest is not None:
        assert edges(free).min() < smallest
        assert found.min() > 0.99 * smallest
        assert largest is not None or found.min() < 1.05 * smallest
    assert largest is None or found.max() < 1.01 * largest


def test_limits_hold_around_a_periodic_line_and_with_a_given_density():
    line = Mesh.uniform(cells=50, periodic=True)
    rho = 1 + 200 * np.exp(-((line.x - 0.02) ** 2) * 4000) + 200 * np.exp(-((line.x - 1.02) ** 2) * 4000)
    found = edges(MeshGenerator(monitor=Limited(rho, smallest=0.2, largest=1.5)).adapt(line, None))
    assert found.min() > 0.99 * 0.2 and found.max() < 1.01 * 1.5
    found = edges(MeshGenerator(monitor=Limited(Given(), smallest=0.2)).adapt(line, rho))
    assert found.min() > 0.99 * 0.2


@pytest.mark.parametrize("monitor", [RootGradient(), Arclength(relative=1000), Curvature()])
def test_limits_hold_in_the_plane_to_a_fifth(monitor):
    def u(x, y):
        return np.tanh(200 * (np.hypot(x, y) - 0.7))

    mesh = Mesh.uniform(cells=(40, 40))
    free = MeshGenerator(monitor=monitor).adapt(mesh, u)
    limited = MeshGenerator(monitor=Limited(monitor, smallest=0.5, largest=1.6)).adapt(mesh, u)
    for axis in (0, 1):
        print(monitor, axis, *(end(edges(of, axis)) for of in (free, limited) for end in (np.min, np.max)))
        assert edges(limited, axis).min() > 0.8 * 0.5
        assert edges(limited, axis).max() < 1.2 * 1.6


def test_a_density_within_its_limits_keeps_its_bits():
    def u(x, y):
        return np.tanh(20 * (x + y - 0.7))

    mesh = Mesh.uniform(cells=(20, 20))
    for monitor in (RootGradient(), Arclength()):
        free = MeshGenerator(monitor=monitor)
        limited = MeshGenerator(monitor=Limited(monitor, smallest=1e-6, largest=1e6))
        assert free.adapt(mesh, u) == limited.adapt(mesh, u)


def test_a_study_takes_limits_and_curvature(tmp_path):
    study = {
        "study": {"name": "limited", "kind": "moving-mesh"},
        "domain": {"lower": [0.0], "upper": [2.0]},
        "grid": {"cells": [50]},
        "time": {"start": 0.0, "end": 0.2, "step": 0.01},
        "pde": {"kind": "prescribed", "u": "tanh(400*(x - 0.7))"},
        "monitor": {"kind": "curvature", "cells": {"smallest": 0.25, "largest": 2.0}},
        "mesh": {"start": "adapted"},
        "output": {"report": False},
    }
    found = edges(run(study, out=tmp_path / "out").mesh)
    assert 0.99 * 0.25 < found.min() < 1.05 * 0.25 and found.max() < 1.01 * 2
    for key, value, words in [("smallest", 1.5, "below 1"), ("largest", 0.5, "above 1")]:
        with pytest.raises(ValueError, match=rf"(?s)monitor.cells.{key}.*{words}|{words}"):
            run(study, out=tmp_path / "out", set={f"monitor.cells.{key}": value})


def test_limited_generators_are_pickled_and_combined():
    mesh = Mesh.uniform(cells=(12, 12))
    u = np.tanh(30 * (mesh.x - 0.5))
    generator = MeshGenerator(monitor=Limited(Curvature(), smallest=0.5))
    mesh = generator.step(mesh, u, 0.1)
    for other in (pickle.loads(pickle.dumps(generator)), copy.deepcopy(generator)):
        assert other.step(mesh, u, 0.1) == copy.deepcopy(generator).step(mesh, u, 0.1)
    both = MeshGenerator(monitor=Limited(Curvature() | RootGradient(), smallest=0.5)).step(mesh, u, 0.1)
    assert edges(both).min() > 0.3
    assert len((Limited(Curvature(), largest=2) | RootGradient()).monitors) == 2


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Limited(RootGradient()), "no limit"),
        (lambda: Limited(RootGradient(), smallest=1), "`smallest` is 1, but must be above 0 and below 1"),
        (lambda: Limited(RootGradient(), largest=0.5), "`largest` is 0.5, but must be above 1"),
        (lambda: Limited(RootGradient(), largest=np.inf), "finite"),
        (lambda: Limited(Limited(RootGradient(), largest=2), largest=2), "without limits"),
        (lambda: Limited(RootGradient, largest=2), "without limits"),
        (lambda: Curvature(relative=1, absolute=2), "not both"),
        (lambda: MeshGenerator(monitor=Curvature(relative=-1)), "0 or more"),
        (lambda: MeshGenerator(monitor=Curvature(smoothing=10**6)), "1000 passes"),
    ],
)
def test_limits_out_of_range_are_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()
