"""Poisson's equation with conditions on the sides: laplacian_stencils(mesh, conditions=…, diffusivity=…)."""

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from driftmesh import Mesh, laplacian_stencils, run
from driftmesh.errors import LinearStalled

PI = np.pi


def moved(n):
    """A smooth image of the unit square in itself, with cells of many sizes."""
    mesh = Mesh.uniform(cells=(n, n + 2))
    bend = 0.06 * np.sin(PI * mesh.x) * np.sin(PI * mesh.y)
    return mesh.moved(mesh.x + bend + 0.1 * mesh.x * (1 - mesh.x), mesh.y + 2 * bend)


def annulus(n):
    """An O-grid between the circles of radius 1 and 2."""
    return Mesh.mapped("(1 + r)*cos(2*pi*s)", "(1 + r)*sin(2*pi*s)", cells=(n, 6 * n), closed=(False, True))


def order(error, n=16):
    return np.log2(error(n) / error(2 * n))


def d(x, y):
    return 1 + 0.5 * x + 0.25 * y**2


def u(x, y):
    return np.sin(2 * x) * np.exp(y)


def u_x(x, y):
    return 2 * np.cos(2 * x) * np.exp(y)


def f(x, y):
    """∇·(D ∇u) = D Δu + D_x u_x + D_y u_y by hand: Δu = −3 u, D_x = ½, D_y = y/2, u_y = u."""
    return -3 * d(x, y) * u(x, y) + 0.5 * u_x(x, y) + 0.5 * y * u(x, y)


#: Every kind of condition for the solution u; on the unit square n = (∓1, 0) and (0, ∓1), and u_y = u.
CONDITIONS = {
    "left": u,
    "right": {"flux": lambda x, y, v: d(x, y) * u_x(x, y) + 3 * (u(x, y) - v)},  # Robin
    "bottom": {"flux": lambda x, y, v: -d(x, y) * u(x, y)},
    "top": u,
}


@pytest.mark.parametrize("kind", ["mapped", "optimised", "harmonic"])
def test_every_condition_is_of_second_order_on_a_moved_mesh(kind):
    def error(n):
        mesh = moved(n)
        poisson = laplacian_stencils(mesh, conditions=CONDITIONS, diffusivity=d, kind=kind)
        found = spsolve(poisson.matrix.tocsc(), poisson.right_hand_side(f)).reshape(mesh.shape)
        assert np.abs(poisson.solve(f) - found).max() < 1e-10
        return np.abs(found - u(mesh.x, mesh.y)).max()

    assert order(error) > 1.8


def test_a_ring_with_a_value_and_a_flux_is_of_second_order():
    """u = r² cos 2θ + ln r with Δu = 0: u_r = 2 r cos 2θ + 1/r, inward −u_r at r = 1."""

    def exact(x, y):
        return x**2 - y**2 + np.log(np.hypot(x, y))

    def slope(x, y, _=None):
        return 2 * (x**2 - y**2) / np.hypot(x, y) + 1 / np.hypot(x, y)

    def error(n):
        mesh = annulus(n)
        sides = {"left": {"flux": lambda x, y, v: -slope(x, y)}, "right": exact}
        return np.abs(laplacian_stencils(mesh, conditions=sides).solve(0) - exact(mesh.x, mesh.y)).max()

    assert order(error, 8) > 1.8


def test_a_ring_of_two_materials_has_the_known_temperatures():
    """Two layers in series, D = 1 within r < 3/2 and 5 beyond: D r u_r = q, u = q ln r and so on."""
    q = 1 / (np.log(1.5) + np.log(2 / 1.5) / 5)
    for given in (
        lambda x, y: np.where(np.hypot(x, y) < 1.5, 1.0, 5.0),
        None,  # at the nodes: the jump lies half way between two of them
    ):
        mesh = annulus(9)
        r = np.hypot(mesh.x, mesh.y)
        diffusivity = np.where(r < 1.5, 1.0, 5.0) if given is None else given
        exact = np.where(r < 1.5, q * np.log(r), 1 - q * np.log(2 / r) / 5)
        found = laplacian_stencils(mesh, conditions={"left": 0, "right": 1}, diffusivity=diffusivity).solve(0)
        assert np.abs(found - exact).max() < 1.5e-3


def study(conditions, **more):
    return {
        "study": {"name": "sides", "kind": "poisson"},
        "domain": {"x": [0.0, 2.0], "bottom": "0", "top": "1 + cos(pi*x)/4", "distort": {"perturb": 0.2, "seed": 1}},
        "grid": {"cells": [20, 16]},
        "equation": {"source": "sin(3*x) + y", "boundary": conditions, **more},
        "output": {"report": False},
    }


@pytest.mark.parametrize("kind", ["optimised", "mapped", "harmonic", "compact25"])
@pytest.mark.parametrize("diffusivity", [None, "1 + x^2*y", "if(x < 1, 1, 7)"])
def test_the_study_has_the_same_solution(kind, diffusivity, tmp_path):
    if kind == "compact25" and diffusivity:
        pytest.skip("25 points take no diffusivity")
    sides = {"left": "sin(y)", "right": "no-flux", "bottom": {"flux": "2*(1 - u) + x"}, "top": {"flux": "x*y"}}
    table = study(sides, **({"diffusivity": diffusivity} if diffusivity else {}))
    result = run({**table, "laplacian": {"kind": kind}}, out=tmp_path / "out")
    same = {
        "left": lambda x, y: np.sin(y),
        "right": "no-flux",
        "bottom": {"flux": lambda x, y, v: 2 * (1 - v) + x},
        "top": {"flux": lambda x, y, v: x * y},
    }
    functions = {"1 + x^2*y": lambda x, y: 1 + x**2 * y, "if(x < 1, 1, 7)": lambda x, y: np.where(x < 1, 1.0, 7.0)}
    poisson = laplacian_stencils(
        result.mesh, conditions=same, diffusivity=functions.get(diffusivity), kind=kind
    )
    found = poisson.solve(lambda x, y: np.sin(3 * x) + y)
    assert np.abs(found - result.final["u"]).max() < 1e-10


def test_fluxes_on_all_sides_are_those_of_the_study(tmp_path):
    """∫ 2 = what flows through the right side, whose height is 5/4; the mean is given."""
    sides = {"left": "no-flux", "right": {"flux": "1.6*2"}, "bottom": "no-flux", "top": "no-flux"}
    table = study(sides, mean=0.7)
    table["equation"]["source"] = "2"
    result = run(table, out=tmp_path / "out")
    sides = {"left": "no-flux", "right": {"flux": 3.2}, "bottom": "no-flux", "top": "no-flux"}
    poisson = laplacian_stencils(result.mesh, conditions=sides)
    assert poisson.is_free
    assert np.abs(poisson.solve(2, mean=0.7) - result.final["u"]).max() < 1e-10
    with pytest.raises(ValueError, match="4.00.* flows in and the integral of `f` is 2.00.*a defect of 2.0e"):
        poisson.solve(1, mean=0.7)


def test_a_periodic_box_is_free_and_closes():
    def error(n):
        mesh = Mesh.uniform(cells=(n, n), upper=(1, 2), periodic=True)
        mesh = mesh.moved(mesh.x + 0.05 * np.sin(PI * mesh.y), mesh.y)
        exact = np.sin(2 * PI * mesh.x) * np.cos(PI * mesh.y)
        found = laplacian_stencils(mesh, conditions={}).solve(-5 * PI**2 * exact)
        assert np.array_equal(found[-1], found[0]) and np.array_equal(found[:, -1], found[:, 0])
        return np.abs(found - exact).max()

    assert order(error) > 1.8


def test_a_diffusivity_on_a_periodic_box_is_looked_at_within_it():
    def within(x, y):
        assert x.min() >= 0 and x.max() <= 1
        return 1 + x * (1 - x)

    mesh = Mesh.uniform(cells=(8, 8), periodic=(True, False))
    mesh = mesh.moved(mesh.x + 0.3, mesh.y)
    laplacian_stencils(mesh, conditions=0, diffusivity=within)


@pytest.mark.parametrize("left", [1.0, {"flux": lambda x, v: -1 + 2 * (1 - v)}])
def test_a_line_is_solved_with_second_order(left):
    """((1 + x) u')' = f with u = e^x: f = (2 + x) e^x; at 0 u = 1 and −D u' = −1, at 1 D u' = 2 e."""

    def error(n):
        line = Mesh.uniform(cells=n)
        line = line.moved(line.x**1.5)
        poisson = laplacian_stencils(
            line, conditions={"left": left, "right": {"flux": 2 * np.e}}, diffusivity=lambda x: 1 + x
        )
        return np.abs(poisson.solve(lambda x: (2 + x) * np.exp(x)) - np.exp(line.x)).max()

    assert order(error) > 1.8


def test_rows_of_a_line_are_the_three_point_formula():
    line = Mesh(np.array([0.0, 0.1, 0.3, 1.0, 1.2]))
    row = laplacian_stencils(line)[2].toarray()[0]
    left, right = 0.2, 0.7
    expected = np.array([1 / left, -1 / left - 1 / right, 1 / right]) * 2 / (left + right)
    np.testing.assert_allclose(row, [0, *expected, 0], atol=1e-12)


def test_an_implicit_step_of_heat_decays_as_it_must():
    """u_t = Δu from an eigenfunction, Δu = −λ u with λ = (½² + 1²) π²: an Euler step divides by 1 + λ dt."""
    mesh = Mesh.uniform(cells=(40, 40))
    poisson = laplacian_stencils(mesh, conditions={"left": 0, "right": "no-flux", "bottom": 0, "top": 0})
    mode = np.sin(PI * mesh.x / 2) * np.sin(PI * mesh.y)
    dt = 0.01
    new = spsolve((poisson.source / dt - poisson.matrix).tocsc(), poisson.source @ mode.ravel() / dt - poisson.sides)
    np.testing.assert_allclose(new.reshape(mesh.shape), mode / (1 + 1.25 * PI**2 * dt), atol=1e-3)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda m: laplacian_stencils(m, conditions={"left": 0, "north": 1}), "no such side.*left, right, bottom, top"),
        (lambda m: laplacian_stencils(m, conditions={"left": 0}), "does not say what holds on 'right'"),
        (lambda m: laplacian_stencils(m, conditions="noflux"), "conditions.'left'.*'noflux'.*no-flux"),
        (lambda m: laplacian_stencils(m, conditions={"flux": None}), "flux.*None"),
        (lambda m: laplacian_stencils(m, conditions={"flux": lambda x, y, u: u**4}), "not linear in u"),
        (lambda m: laplacian_stencils(m, conditions={"flux": 1, "u": 2}), "must be a value"),
        (lambda m: laplacian_stencils(m, conditions=np.zeros(5)), r"shape \(5,\), but the side has shape \(11,\)"),
        (lambda m: laplacian_stencils(m, conditions=lambda x, y: x / 0), "must be finite"),
        (lambda m: laplacian_stencils(m, conditions=0, diffusivity=0), r"`diffusivity` is 0.0 at index \(0, 0\)"),
        (lambda m: laplacian_stencils(m, conditions=0, diffusivity=-np.ones((9, 11))), "-1.0 at index"),
        (lambda m: laplacian_stencils(m, conditions=0, diffusivity=np.ones(3)), r"\(3,\).*\(9, 11\)"),
        (
            lambda m: laplacian_stencils(m, conditions=0, diffusivity=lambda x, y: 1 - 2 * (abs(x - 0.31) < 0.02)),
            r"`diffusivity` is -1.0 at \(0\.(29|3).*above 0",
        ),
        (lambda m: laplacian_stencils(m, conditions=0, diffusivity=2, kind="compact25"), "takes no diffusivity"),
        (lambda m: laplacian_stencils(m, conditions=0, source=True), "with its source"),
        (lambda m: laplacian_stencils(m.x, m.y, conditions=0), "on a mesh"),
        (lambda m: laplacian_stencils(m, m.y), "`y` is given beside a mesh"),
        (lambda m: laplacian_stencils(m.x), "positions x and y"),
        (lambda m: laplacian_stencils(m, conditions=0).solve(np.zeros(4)), r"`f` has shape \(4,\)"),
        (lambda m: laplacian_stencils(m, conditions=0).solve("1"), "`f` is '1'"),
        (lambda m: laplacian_stencils(m, conditions={"flux": 1}).solve(0), "4.0.* flows in"),
    ],
)
def test_what_is_no_problem_is_refused(make, words):
    with np.errstate(divide="ignore", invalid="ignore"), pytest.raises(ValueError, match=words):
        make(Mesh.uniform(cells=(8, 10)))


def test_sides_of_a_closed_axis_are_not_there():
    with pytest.raises(ValueError, match="no such side; the sides here are left, right"):
        laplacian_stencils(annulus(4), conditions={"left": 0, "right": 0, "top": 0})


def test_a_singular_matrix_is_told():
    """u'' = 0 with u(0) = 0 and u'(1) = u(1): every multiple of x is a solution."""
    line = Mesh.uniform(cells=8)
    poisson = laplacian_stencils(line, conditions={"left": 0, "right": {"flux": lambda x, u: u}})
    with pytest.raises(LinearStalled, match="singular"):
        poisson.solve(0)
