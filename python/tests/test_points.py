"""Values at any points, and derivatives on any mesh."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from driftmesh import Mesh, divergence, gradient
from driftmesh.errors import MeshFolded


def bent(cells=(16, 12), amount=0.06, **box):
    """Cells that are no parallelograms, straight sides."""
    mesh = Mesh.uniform(cells=cells, **box)
    (left, bottom), (width, height) = mesh.lower, np.subtract(mesh.upper, mesh.lower)
    a, b = 2 * np.pi * (mesh.x - left) / width, 2 * np.pi * (mesh.y - bottom) / height
    return mesh.moved(mesh.x + amount * width * np.sin(a) * np.cos(b), mesh.y - amount * height * np.cos(a) * np.sin(b))


def graded(n, **box):
    mesh = Mesh.uniform(cells=n, **box)
    return mesh.moved(mesh.x + 0.1 * np.sin(2 * np.pi * mesh.x))


def random(count, seed=0):
    return np.random.default_rng(seed).random((2, count))


@pytest.mark.parametrize("order", [1, 3])
def test_linear_functions_are_interpolated_exactly_on_any_mesh(order):
    x, y = random(5000)
    mesh = bent()
    np.testing.assert_allclose(mesh.interpolate(1 - 2 * mesh.x + 3 * mesh.y, x, y, order=order), 1 - 2 * x + 3 * y)
    line = graded(20)
    np.testing.assert_allclose(line.interpolate(1 - 2 * line.x, x, order=order), 1 - 2 * x, atol=1e-14)


@settings(max_examples=60, deadline=None)
@given(st.integers(2, 9), st.integers(2, 9), st.booleans(), st.booleans(), st.integers(0, 2**32 - 1))
def test_random_meshes_give_back_linear_functions_and_nodal_values(n, m, wraps_x, wraps_y, seed):
    """Every node up to 0.3 cells away from its uniform place, nodes of sides at theirs."""
    rng, periodic = np.random.default_rng(seed), (wraps_x, wraps_y)
    mesh = Mesh.uniform(cells=(n, m), periodic=periodic)
    shift, u = 0.6 * (rng.random((2, n + 1, m + 1)) - 0.5) / [[[n]], [[m]]], rng.random((n + 1, m + 1))
    for axis, wraps in enumerate(periodic):
        first, last = ((slice(None),) * axis + (k,) for k in (0, -1))
        if wraps:
            shift[:, *last], u[last] = shift[:, *first], u[first]
        else:
            shift[axis][first] = shift[axis][last] = 0
    mesh = mesh.moved(mesh.x + shift[0], mesh.y + shift[1])
    if mesh.quality().min_scaled_jacobian < 1e-3:
        return
    x, y = random(100, seed)
    linear = lambda x, y: 1 + (0 if wraps_x else 3) * x - (0 if wraps_y else 2) * y
    for order in (1, 3):
        found = mesh.interpolate(linear(mesh.x, mesh.y), x, y, order=order)
        np.testing.assert_allclose(found, linear(x, y), atol=1e-10)
        np.testing.assert_allclose(mesh.interpolate(u, mesh.x, mesh.y, order=order), u, atol=1e-8)


def test_products_are_interpolated_exactly_on_uniform_meshes():
    x, y = random(1000)
    mesh = Mesh.uniform(cells=(5, 7))
    bilinear = lambda x, y: 1 + 2 * x - y + 3 * x * y
    cubic = lambda x, y: (x**3 - x) * (2 + y**3)
    np.testing.assert_allclose(mesh.interpolate(bilinear(mesh.x, mesh.y), x, y), bilinear(x, y), atol=1e-13)
    np.testing.assert_allclose(mesh.interpolate(cubic(mesh.x, mesh.y), x, y, order=3), cubic(x, y), atol=1e-12)


@pytest.mark.parametrize(("order", "expected"), [(1, 2), (3, 4)])
@pytest.mark.parametrize("periodic", [False, True])
def test_interpolation_has_the_order_that_it_claims(order, expected, periodic):
    wave = lambda x, y: np.sin(2 * np.pi * x) * np.cos(2 * np.pi * y)
    x, y = random(4000)

    def error(n):
        mesh, line = bent((n, n), periodic=periodic), graded(n, periodic=periodic)
        plane = mesh.interpolate(wave(mesh.x, mesh.y), x, y, order=order) - wave(x, y)
        return np.abs([plane, line.interpolate(wave(line.x, 0), x, order=order) - wave(x, 0)]).max(axis=1)

    observed = np.log2(error(24) / error(48))
    assert (np.abs(observed - expected) < 0.5).all(), f"observed orders {observed}, expected {expected}"


@settings(max_examples=20, deadline=None)
@given(st.integers(-3, 3), st.integers(-3, 3), st.sampled_from([1, 3]))
def test_any_image_of_a_point_has_its_value(right, up, order):
    mesh = bent(lower=(-1, 0), upper=(1, 3), periodic=(True, True))
    u = np.cos(np.pi * mesh.x) + np.sin(2 * np.pi * mesh.y / 3)
    x, y = random(50)
    found = mesh.interpolate(u, x + 2 * right, y + 3 * up, order=order)
    np.testing.assert_allclose(found, mesh.interpolate(u, x, y, order=order), atol=1e-12)


def test_points_of_any_shape_and_several_fields_at_once():
    mesh = bent()
    u = np.stack([mesh.x, mesh.y, 1 + mesh.x])[:, None]
    x, y = random(12).reshape(2, 3, 4)
    found = mesh.interpolate(u, x, y)
    assert found.shape == (3, 1, 3, 4)
    np.testing.assert_allclose(found[:, 0], [x, y, 1 + x], atol=1e-14)
    assert mesh.interpolate(mesh.x, [0.25, 0.5], 0.5) == pytest.approx([0.25, 0.5])
    assert mesh.interpolate(mesh.x, 0.25, 0.5) == pytest.approx(0.25)
    assert mesh.interpolate(mesh.x, [], []).shape == (0,)
    np.testing.assert_array_equal(mesh.interpolate(mesh.x, mesh.x, mesh.y, order=1).shape, mesh.shape)


def test_samples_are_those_of_a_regular_grid():
    mesh = bent(lower=(1, 0), upper=(3, 1))
    x, y = np.meshgrid(np.linspace(1, 3, 7), np.linspace(0, 1, 4), indexing="ij")
    np.testing.assert_allclose(mesh.sample([mesh.x, mesh.y], (7, 4)), [x, y], atol=1e-14)
    np.testing.assert_allclose(graded(9).sample(graded(9).x, 5), np.linspace(0, 1, 5), atol=1e-15)


def test_points_are_found_in_meshes_that_are_no_boxes():
    """In an annulus walks from cell to cell end at the inner side."""
    r, s = np.meshgrid(np.linspace(1, 2, 9), np.linspace(0, 1.9 * np.pi, 97), indexing="ij")
    mesh = Mesh(r * np.cos(s), r * np.sin(s))
    radius, angle = random(3000) * [[0.8], [1.8 * np.pi]] + [[1.1], [0.1]]
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    np.testing.assert_allclose(mesh.interpolate(mesh.x - 2 * mesh.y, x, y), x - 2 * y, atol=1e-12)
    with pytest.raises(ValueError, match=r"the point \(0.0, 0.1\) at index \(1,\) lies outside"):
        mesh.interpolate(mesh.x, [1.5, 0.0, 0.0], [0.0, 0.1, 0.0])


def folded():
    mesh = Mesh.uniform(cells=(8, 8))
    x = mesh.x.copy()
    x[4, 4] = 0.9
    return mesh.moved(x, mesh.y)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda m: m.interpolate(m.x, [0.5, 1.5], [0.5, 0.5]), r"\(1.5, 0.5\) at index \(1,\) lies outside"),
        (lambda m: graded(8).interpolate(graded(8).x, -1e-3), r"\(-0.001\) lies outside"),
        (lambda m: m.interpolate(m.x[1:], 0.5, 0.5), r"\(16, 13\).*\(17, 13\)"),
        (lambda m: m.interpolate(1.0, 0.5, 0.5), r"\(\).*\(17, 13\)"),
        (lambda m: m.interpolate(m.x, [0.5, np.nan], 0.5), r"`x` is nan at index \(1,\)"),
        (lambda m: m.interpolate(m.x, np.ones(2), np.ones(3)), r"\(2,\) and \(3,\)"),
        (lambda m: m.interpolate(m.x, 0.5, 0.5, order=2), "`order` is 2"),
        (lambda m: m.interpolate(m.x, 0.5), "`y` is missing"),
        (lambda m: graded(8).interpolate(graded(8).x, 0.5, 0.5), "`y` is given"),
        (lambda m: m.sample(m.x, (3, 1)), "2 points or more"),
        (lambda m: m.velocity(bent((5, 5)), 0.1), "lattice and the box"),
        (lambda m: m.velocity(m, 0), "`dt` is 0"),
        (lambda m: gradient(m.x), "ndarray"),
    ],
)
def test_wrong_shapes_and_values_are_named(call, words):
    with pytest.raises(ValueError, match=words):
        call(bent())


def test_folded_meshes_are_refused():
    with pytest.raises(MeshFolded):
        folded().interpolate(folded().x, 0.5, 0.5)
    with pytest.raises(MeshFolded, match="Jacobian is -"):
        gradient(folded())


def test_a_velocity_is_a_way_over_time():
    old = bent(periodic=(True, False))
    x_t, y_t = old.moved(old.x + 0.03, old.y).velocity(old, dt=0.1)
    np.testing.assert_allclose(x_t, 0.3)
    assert not y_t.any()
    # put back at the other end of the box
    x_t, _ = old.moved(old.x + 0.03 - 1, old.y).velocity(old, dt=0.1)
    np.testing.assert_allclose(x_t, 0.3)
    line = graded(8)
    np.testing.assert_allclose(line.moved(line.x**2).velocity(line, 0.5), [2 * (line.x**2 - line.x)])


@pytest.mark.parametrize("periodic", [(False, False), (True, False), (True, True)])
def test_derivatives_have_second_order(periodic):
    def errors(n):
        mesh = bent((n, n), upper=(2, 1), periodic=periodic)
        a, b = np.pi * mesh.x, 2 * np.pi * mesh.y
        u, u_x, u_y = np.sin(a) * np.cos(b), np.pi * np.cos(a) * np.cos(b), -2 * np.pi * np.sin(a) * np.sin(b)
        dx, dy = (np.abs((d @ u.ravel()).reshape(mesh.shape) - e).max() for d, e in zip(gradient(mesh), (u_x, u_y)))
        div = divergence(mesh) @ np.ravel([u, u])
        return np.array([dx, dy, np.abs(div - (u_x + u_y).ravel()).max()])

    orders = np.log2(errors(40) / errors(80))
    assert (np.abs(orders - 2) < 0.3).all(), f"observed orders {orders}, expected 2"


def test_derivatives_of_linear_functions_are_exact_on_any_mesh():
    r, s = np.meshgrid(np.linspace(1, 2, 9), np.linspace(0, 1.5, 13), indexing="ij")
    for mesh in (bent(), Mesh(r * np.cos(s), r * np.sin(s))):
        dx, dy = gradient(mesh)
        u = (1 + 3 * mesh.x - 2 * mesh.y).ravel()
        np.testing.assert_allclose([dx @ u, dy @ u], np.outer([3, -2], np.ones(u.size)), atol=1e-11)
        np.testing.assert_allclose(divergence(mesh) @ np.ravel([2 * mesh.x, mesh.y]), 3, atol=1e-11)
    (d,) = gradient(graded(10))
    np.testing.assert_allclose(d @ (2 * graded(10).x), 2)
    assert not (gradient(bent(periodic=(True, True)))[0] @ np.ones(17 * 13)).any()


def test_the_jacobian_is_that_of_the_map():
    """Second order, against the exact determinant."""

    def error(n):
        mesh = Mesh.uniform(cells=(n, n), upper=(2, 1))
        xi, eta = mesh.x / 2, mesh.y
        bump = np.sin(np.pi * xi) * np.sin(np.pi * eta)
        exact = 2 * (1 + 0.1 * np.pi * np.sin(np.pi * xi) * np.cos(np.pi * eta))
        return np.abs(mesh.moved(mesh.x, mesh.y + 0.1 * bump).jacobian - exact).max()

    assert np.log2(error(20) / error(40)) == pytest.approx(2, abs=0.2)
    slope = 1 + 0.2 * np.pi * np.cos(2 * np.pi * np.linspace(0, 1, 201))
    np.testing.assert_allclose(graded(200).jacobian, slope, atol=1e-3)
    np.testing.assert_allclose(Mesh.uniform((6, 1), upper=(3, 2), periodic=(False, True)).jacobian, 6)


def test_no_fields_have_no_values():
    mesh = Mesh.uniform(cells=(4, 3))
    assert mesh.interpolate(np.zeros((0, *mesh.shape)), [0.1, 0.2], [0.3, 0.4]).shape == (0, 2)


def test_a_folded_line_has_no_gradient():
    with pytest.raises(MeshFolded, match="node 2 is not above node 1"):
        gradient(Mesh([0.0, 0.5, 0.4, 0.8, 1.0]))


def test_cubics_do_not_mind_where_the_box_lies():
    line = Mesh.uniform(cells=20, lower=2000.0, upper=2001.0)
    line = line.moved(line.x + 0.05 * np.sin(2 * np.pi * (line.x - 2000)))
    x = 2000 + np.linspace(0.01, 0.99, 200)
    found = line.interpolate(np.sin(5 * (line.x - 2000)), x, order=3)
    np.testing.assert_allclose(found, np.sin(5 * (x - 2000)), atol=1e-3)
