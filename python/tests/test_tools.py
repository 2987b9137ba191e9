"""Laplacians as matrices, equidistribution and Schwarz on a line."""

import math
import os
import signal
import subprocess
import sys
import textwrap
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import spsolve

from driftmesh import Mesh, StudyError, equidistribute, laplacian_stencils, schwarz
from driftmesh.errors import LineDensity, LineFolded, NotConverged


def annulus(n=16, m=12):
    r, s = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, m + 1), indexing="ij")
    return (0.5 + s) * np.sin(np.pi * r / 2), (0.5 + s) * np.cos(np.pi * r / 2)


@pytest.mark.parametrize("kind", ["optimised", "harmonic"])
def test_laplacians_of_quadratics_are_exact(kind):
    x, y = annulus()
    y = y[:, ::-1] if (np.diff(x[:, 0]) < 0).all() else y
    a = laplacian_stencils(x, y, kind)
    assert isinstance(a, csr_matrix) and a.shape == (x.size, x.size)
    delta = (a @ (x**2 + 3 * x * y - 4 * y**2).ravel()).reshape(x.shape)
    np.testing.assert_allclose(delta[1:-1, 1:-1], -6, atol=1e-8)
    assert not delta[[0, -1]].any() and not delta[:, [0, -1]].any()


def test_compact25_solves_with_fourth_order():
    def error(n):
        mesh = Mesh.uniform(cells=(n, n))
        x, y = (mesh.x + 0.05 * np.sin(np.pi * mesh.x) * np.sin(np.pi * mesh.y)), mesh.y
        a, b = laplacian_stencils(x, y, "compact25", source=True)
        u = np.exp(x) * np.sin(2 * y)
        inside = np.zeros(x.shape, bool)
        inside[1:-1, 1:-1] = True
        inside, known = np.flatnonzero(inside), np.flatnonzero(~inside)
        rows = a[inside]
        right = b[inside] @ (-3 * u).ravel() - rows[:, known] @ u.ravel()[known]
        return np.abs(spsolve(rows[:, inside].tocsc(), right) - u.ravel()[inside]).max()

    order = np.log2(error(12) / error(24))
    assert order > 3.5, f"observed order {order:.2f}, expected 4"
    with pytest.raises(ValueError, match="source=True"):
        laplacian_stencils(*annulus(), "compact25")


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda x, y: laplacian_stencils(x, y[1:]), ValueError, r"\(16, 13\).*\(17, 13\)"),
        (lambda x, y: laplacian_stencils(x[:2], y[:2]), ValueError, r"\(2, 13\)"),
        (lambda x, y: laplacian_stencils(x.ravel(), y.ravel()), ValueError, "two axes"),
        (lambda x, y: laplacian_stencils(x * np.nan, y), ValueError, "nan at index"),
        (lambda x, y: laplacian_stencils(x, y, "best"), ValueError, "optimised, harmonic"),
        (lambda x, y: laplacian_stencils(x, y, scaling="local"), ValueError, "published"),
        (lambda x, y: laplacian_stencils(x, y, "published", scaling="huge"), ValueError, "none, global or local"),
        (lambda x, y: laplacian_stencils(x, y * 0), ValueError, "scale the mesh"),
        (lambda x, y: laplacian_stencils(1e300 * x, y), ValueError, "scale the mesh"),
        (lambda x, y: laplacian_stencils(x[::-1], y[::-1]), ValueError, "mirrored.*indexing"),
        (
            lambda x, y: laplacian_stencils(*np.meshgrid(np.arange(5.0), np.arange(4.0))),
            ValueError,
            "mirrored.*indexing",
        ),
        (
            lambda x, y: laplacian_stencils(*np.mgrid[:9, :9], "compact25", source=True, periodic=(True, False)),
            ValueError,
            "bounded axes",
        ),
        (lambda x, y: laplacian_stencils(x, y, kind=3), ValueError, "`kind` is 3"),
        (lambda x, y: laplacian_stencils(x, y, periodic=(True, False)), ValueError, "axis 0 is periodic"),
        (lambda x, y: laplacian_stencils(1e-155 * x, 1e-155 * y), ValueError, "scale the mesh"),
    ],
)
def test_laplacians_refuse_what_is_no_mesh(make, error, words):
    with pytest.raises(error, match=words):
        make(*annulus())


@pytest.mark.parametrize("kind", ["optimised", "harmonic", "published", "mapped"])
@pytest.mark.parametrize("periodic", [(True, True), (True, False), (False, True)])
def test_periodic_laplacians_go_over_the_seam(kind, periodic):
    """Second order at every node of the seam, the closing nodes included."""

    def error(n):
        mesh = Mesh.uniform(cells=(n, n + 2), lower=(-1, 2), upper=(1, 5), periodic=periodic)
        phase = 2 * np.pi * (mesh.x + 1) / 2, 2 * np.pi * (mesh.y - 2) / 3
        x, y = mesh.x + 0.03 * np.sin(phase[0]) * np.sin(phase[1]), mesh.y + 0.04 * np.sin(phase[1])
        k, m = 2 * np.pi / 2, 2 * np.pi / 3
        u = np.sin(k * x) * np.cos(m * y)
        delta = (laplacian_stencils(x, y, kind, periodic=periodic) @ u.ravel()).reshape(u.shape)
        inside = tuple(slice(None) if wraps else slice(1, -1) for wraps in periodic)
        bounded = np.ones(u.shape, bool)
        bounded[inside] = False
        assert not delta[bounded].any()
        return np.abs(delta + (k * k + m * m) * u)[inside].max()

    order = np.log2(error(16) / error(32))
    assert order > 1.5 if kind != "optimised" else order > 0.7, f"observed order {order:.2f}"


def test_american_spelling_is_understood():
    difference = laplacian_stencils(*annulus(), "optimized") - laplacian_stencils(*annulus(), "optimised")
    assert abs(difference).max() == 0
    both = [schwarz("x^2 + 1", 20, cut=0.5, method=method, iterations=2) for method in ("optimised", "optimized")]
    np.testing.assert_array_equal(both[0].error, both[1].error)


@settings(max_examples=15, deadline=None)
@given(st.sampled_from(["f4", "i8", ">f8"]), st.sampled_from("CF"), st.booleans())
def test_layouts_do_not_matter(dtype, order, backwards):
    x, y = np.meshgrid(np.arange(6), np.arange(5), indexing="ij")
    x, y = (np.array(a, dtype=dtype, order=order) for a in (x, y))
    given = (x[::-1].copy()[::-1], y[::-1].copy()[::-1]) if backwards else (x, y)
    difference = laplacian_stencils(*given) - laplacian_stencils(x.astype(float), y.astype(float))
    assert abs(difference).max() == 0


EXACT = {0.1: 0.13255693, 0.25: 0.32218535, 0.5: 0.59607164, 0.75: 0.81773167, 0.9: 0.93100813}


def test_every_way_to_say_a_density_gives_the_mesh():
    """x(ξ) of M = x² + 1; the discrete mesh is within 2.6e-5·(40/N)² of it."""
    s = np.linspace(0, 1, 2001)
    ways = [
        "x^2 + 1",
        {"kind": "formula", "value": "x^2 + 1"},
        lambda x: x**2 + 1,
        (s, s**2 + 1),
        (s**2 + 1).astype("f4"),
    ]
    for density in ways:
        x = equidistribute(density, 100)
        assert x.shape == (101,) and x[0] == 0 and x[-1] == 1
        for xi, place in EXACT.items():
            assert abs(x[round(100 * xi)] - place) < 5e-6
    # rough data: every cell has the same share of the integral of its linear interpolant
    rough = np.random.default_rng(1).random(60) + 0.01
    x = equidistribute(rough, 100)
    places = np.unique(np.concatenate([x, np.linspace(0, 1, 60)]))
    values = np.interp(places, np.linspace(0, 1, 60), rough)
    integral = np.concatenate([[0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(places))])
    np.testing.assert_allclose(np.diff(np.interp(x, places, integral)), integral[-1] / 100, rtol=1e-9)
    x = equidistribute(lambda x: np.float32(3), 10, domain=(-1, 1))
    np.testing.assert_allclose(x, np.linspace(-1, 1, 11), atol=1e-14)
    front = {"kind": "arclength", "of": "(1 - exp(20*x)) / (1 - exp(20))"}
    assert equidistribute(front, 100, face_density="exact")[50] == pytest.approx(0.88222053, abs=1e-8)


@pytest.mark.filterwarnings("ignore:overflow")
@pytest.mark.parametrize("steep", ["exp(20*x)", lambda x: np.exp(20 * x)])
def test_every_cell_has_the_same_share_of_a_steep_density(steep):
    """x(ξ) = ln(1 + ξ(e²⁰ − 1))/20; the trapezoid is off by 0.09 in the first cells."""
    xi = np.linspace(0, 1, 401)
    exact = np.log1p(xi * np.expm1(20)) / 20
    np.testing.assert_allclose(equidistribute(steep, 400), exact, atol=1e-8)
    assert np.abs(equidistribute(steep, 400, face_density="trapezoid") - exact).max() > 0.01


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda: equidistribute("x^2 + 1", 1), ValueError, "2 or more"),
        (lambda: equidistribute("x^2 + 1", 10.0), ValueError, "whole number"),
        (lambda: equidistribute("x^^2", 10), StudyError, r"\^"),
        (lambda: equidistribute("x", 10), ValueError, "M is 0"),
        (lambda: equidistribute("x", 10), LineDensity, "above 0"),
        (lambda: equidistribute(lambda x: x * np.nan, 10), LineDensity, "NaN"),
        (lambda: equidistribute(lambda x: x[:2], 10), ValueError, r"shape \(2,\).*shape"),
        (lambda: equidistribute(lambda x: 1 / 0, 10), ZeroDivisionError, "division"),
        (lambda: equidistribute(lambda x: math.exp(x), 10), TypeError, "array"),
        (lambda: equidistribute(lambda x: x * 1j, 10), ValueError, "complex"),
        (lambda: equidistribute(np.ones((3, 3)), 10), ValueError, r"\(3, 3\)"),
        (lambda: equidistribute([1, np.nan], 10), ValueError, "nan at index"),
        (lambda: equidistribute([1, -1], 10), ValueError, "-1.0 at index 1"),
        (lambda: equidistribute(([0, 1], [1, 2, 3]), 10), ValueError, r"\(3,\).*\(2,\)"),
        (lambda: equidistribute(([0, 0.5], [1, 2]), 10), ValueError, "known from 0.0 to 0.5"),
        (lambda: equidistribute({"kind": "arclength", "value": "x"}, 10), ValueError, "arclength"),
        (lambda: equidistribute("1", 10**9), ValueError, "GiB"),
        (lambda: equidistribute(lambda x: 1e6 + x, 10, points=[2.0]), ValueError, "points.*must lie on the line"),
        (
            lambda: equidistribute(([0, 0.5, 0.5, 0.5, 1], [1, 2, 3, 4, 5]), 10),
            ValueError,
            "twice the same where M jumps",
        ),
        (lambda: equidistribute("1/sqrt(1 - x)", 10), LineDensity, "M is inf at x = 1"),
        (lambda: equidistribute({"kind": ["a"]}, 4), ValueError, "must be a table"),
        (lambda: equidistribute({"value": 3}, 4), ValueError, "must be a table"),
        (lambda: equidistribute("1", 10, domain=(1, 0)), ValueError, "left to right"),
        (lambda: equidistribute("1", 10, face_density="rough"), ValueError, "trapezoid"),
        (lambda: schwarz("1", 100, method="best", cut=0.5), ValueError, "`method` is 'best'.*classical"),
        (lambda: schwarz("1", 100), ValueError, "exactly one of"),
        (lambda: schwarz("1", 100, overlap=(0.483, 0.52)), ValueError, "nearest are 0.48 and 0.49"),
        (lambda: schwarz("1", 100, overlap=(0.4, 0.6), cut=0.5), ValueError, "exactly one"),
        (lambda: schwarz("1", 100, cut=0.5), ValueError, "do not overlap"),
        (lambda: schwarz("1", 100, cut=0.5, method="optimized", sweep="parallel"), ValueError, "no option"),
        (lambda: schwarz("1", 100, overlap=(0.4, 0.6), iterations=0), ValueError, "1 or more"),
        (lambda: schwarz("1", 100, overlap=(0.4, 0.6), tolerance=-1), ValueError, "above 0"),
        (lambda: schwarz("1", 100, overlap=(0.4, 0.6), start=np.zeros(5)), ValueError, r"\(5,\).*\(101,\)"),
        (lambda: schwarz("1", 100, overlap=(0.4, 0.6), start=lambda xi: 1 - xi), ValueError, "left to right"),
    ],
)
def test_the_line_refuses_what_it_cannot_use(make, error, words):
    with pytest.raises(error, match=words):
        make()


def test_a_density_is_asked_for_inside_the_line_and_seldom():
    asked = []

    def layer(x):
        asked.append((x.min(), x.max(), x.size))
        return np.sqrt(1 + (np.exp((x - 1) / 1e-4) / 1e-4) ** 2)

    x = equidistribute(layer, 160)
    assert min(a[0] for a in asked) >= 0 and max(a[1] for a in asked) <= 1
    assert sum(a[2] for a in asked) <= 50_000 and len(asked) < 200
    assert (np.diff(x) > 0).all() and np.count_nonzero(x > 0.999) > 60


def test_arrays_may_jump_and_spikes_may_be_named():
    x = equidistribute(([0, 0.4, 0.4, 1], [1.0, 1.0, 1000.0, 1000.0]), 3002)
    assert x[2] == pytest.approx(0.4, abs=1e-14) and x[1502] == pytest.approx(0.7, abs=1e-12)
    spike = "1 + 1e9*exp(-((x - 0.3)/1e-9)^2)"
    assert np.count_nonzero(abs(equidistribute(spike, 40, points=[0.3]) - 0.3) < 1e-8) > 20
    with pytest.warns(RuntimeWarning, match='`face_density`.*nodes are those of "exact"'):
        x = equidistribute(lambda x: np.where(x < 0.3, 1.0, 100.0), 100, face_density="trapezoid")
    assert (np.diff(x) > 0).all()


def test_subdomains_that_do_not_agree_are_an_error_with_its_history():
    front = {"kind": "arclength", "of": "tanh(10*(x - 0.3))"}
    with pytest.raises(LineFolded, match="do not agree on an order") as error:
        schwarz(front, 100, overlap=(0.49, 0.51), linearized=True, iterations=50)
    assert error.value.result.iterations == 50


def test_schwarz_contracts_as_theory_says():
    result = schwarz(lambda x: x**2 + 1, 100, overlap=(0.4, 0.6))
    assert result.iterations == 53 and result.observed == pytest.approx(4 / 9, abs=1e-4)
    assert result.predicted == pytest.approx(4 / 9) and result.error[-1] <= 1e-10 < result.error[-2]
    np.testing.assert_allclose(result.mesh, result.reference, atol=1e-10)
    assert len(result.error) == len(result.linear_solves) == 54 and np.isnan(result.largest_jump).all()
    optimal = schwarz("x^2 + 1", 100, method="optimal", cut=0.5, face_density="exact", tolerance=1e-12)
    assert optimal.iterations == 2
    half = schwarz("x^2 + 1", 100, overlap=(0.45, 0.55), start=lambda xi: xi**2, iterations=4)
    assert half.iterations == 4 and half.error[0] > 0.05


def test_what_does_not_converge_is_an_error_with_its_history():
    with pytest.raises(NotConverged, match="not converged") as error:
        schwarz("300*(x - 0.5)^2 + 1", 100, overlap=(0.48, 0.52), linearized=True, iterations=300, tolerance=1e-8)
    assert "set `linearized` to False" in str(error.value)
    assert error.value.result.iterations == 300 and error.value.result.error[-100:].min() > 0.03


def test_results_are_told_apart_and_shown_shortly():
    result = schwarz("x^2 + 1", 100, overlap=np.array([0.4, 0.6]))
    assert result == result and result != schwarz("x^2 + 1", 100, overlap=(0.4, 0.6))
    assert repr(result).startswith("<SchwarzResult of 100 cells, iterations=53, error=") and "observed=0.4444" in repr(
        result
    )


NESTED = """
    from concurrent.futures import ThreadPoolExecutor
    from driftmesh import equidistribute, schwarz

    def density(x):
        inner = schwarz("x + 1", 20, overlap=(0.4, 0.6), iterations=2)
        return 1 + x * equidistribute(lambda y: 1 + y, 10)[5] + inner.mesh[10]

    with ThreadPoolExecutor(4) as threads:
        meshes = list(threads.map(lambda _: schwarz(density, 20, overlap=(0.4, 0.6), iterations=3).mesh, range(4)))
    assert all((mesh == meshes[0]).all() for mesh in meshes)
    print(len(meshes))
"""


def test_a_density_may_call_the_package_itself():
    """On one thread of the library, and from several of Python at a time."""
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(NESTED)],
        env=os.environ | {"RAYON_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.stdout == "4\n", done.stderr


def test_a_density_is_called_in_the_thread_that_asked():
    import threading

    seen = set()

    def density(x):
        seen.add(threading.get_ident())
        return 1 + x

    schwarz(density, 38, subdomains=4, overlap_cells=2, iterations=2)
    with ThreadPoolExecutor(1) as threads:
        other = threads.submit(lambda: (equidistribute(density, 10), threading.get_ident())[1]).result()
    assert seen == {threading.get_ident(), other}


SLOW = """
    import time
    from driftmesh import equidistribute

    def density(x):
        print("called", flush=True)
        time.sleep(20)
        return 1 + x

    try:
        equidistribute(density, 10)
    except KeyboardInterrupt:
        print("interrupted")
"""


def test_ctrl_c_in_a_density_ends_it_and_the_interpreter_in_good_order():
    script = [sys.executable, "-c", textwrap.dedent(SLOW)]
    process = subprocess.Popen(script, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "called\n"
    began = time.monotonic()
    os.kill(process.pid, signal.SIGINT)
    said, complaint = process.communicate(timeout=60)
    assert (process.returncode, said, complaint) == (0, "interrupted\n", "") and time.monotonic() - began < 10
