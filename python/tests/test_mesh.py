"""Meshes: arrays in and out, their quality, copies, and fields carried between them."""

import copy
import pickle
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from driftmesh import Mesh, transfer
from driftmesh.errors import MeshFolded

CELLS = (6, 4)
SHAPE = (7, 5)
DTYPES = ["f4", "f8", ">f8", "f2", "i1", "i8", "u2", "?"]


def bent(cells=CELLS, amount=0.1, **box):
    mesh = Mesh.uniform(cells=cells, **box)
    wave = amount * np.sin(np.pi * mesh.x) * np.sin(np.pi * mesh.y)
    return mesh.moved(mesh.x + wave, mesh.y - wave)


def layouts(array):
    """The same numbers in other strides and orders."""
    wide = np.zeros((2 * array.shape[0], 3 * array.shape[1]), array.dtype)
    wide[::2, ::3] = array
    return [array, np.asfortranarray(array), array[::-1, ::-1].copy()[::-1, ::-1], wide[::2, ::3]]


def test_positions_are_views_that_cannot_be_written():
    mesh = Mesh.uniform(cells=(4, 2), lower=(0, 1), upper=(2, 4))
    assert mesh.x.shape == mesh.y.shape == mesh.shape == (5, 3) and mesh.cells == (4, 2)
    assert mesh.x.base is mesh.y.base and not mesh.x.flags.owndata
    np.testing.assert_array_equal(mesh.x[:, 0], [0, 0.5, 1, 1.5, 2])
    np.testing.assert_array_equal(mesh.y[0], [1, 2.5, 4])
    with pytest.raises(ValueError, match="read-only"):
        mesh.x[0, 0] = 1


def test_meshes_pickle_and_copy():
    for mesh in (bent(), bent(periodic=(True, False))):
        for other in (pickle.loads(pickle.dumps(mesh)), copy.copy(mesh), copy.deepcopy(mesh)):
            assert other == mesh and other.quality() == mesh.quality()
        assert mesh != Mesh.uniform(cells=CELLS) and mesh != 1


def test_quality_of_known_meshes():
    # cells of 1 × 2: Q = ½ (1 + 4)/2
    quality = Mesh.uniform(cells=(3, 3), upper=(3, 6)).quality()
    assert quality.q_max == quality.q_mean == 1.25 and quality.equidistribution == pytest.approx(1)
    # ρ = 1 + x on cells of width ½: the shares are 1¼ and 1¾
    mesh = Mesh.uniform(cells=(2, 2))
    assert mesh.quality(1 + mesh.x).equidistribution == pytest.approx(1.75 / 1.5)


def test_a_folded_mesh_says_so():
    mesh = Mesh.uniform(cells=(4, 4))
    x = mesh.x.copy()
    x[1, 1] = 0.9
    folded = mesh.moved(x, mesh.y)
    assert folded.quality().min_scaled_jacobian < 0
    for old, new in [(mesh, folded), (folded, mesh)]:
        for method in ("conservative", "interpolate"):
            with pytest.raises(MeshFolded, match=r"(?s)cell \(.*help: "):
                transfer(mesh.x, old, new, method)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Mesh.uniform(cells=(1, 1)), "at least 2"),
        (lambda: Mesh.uniform(cells=(2.5, 3)), "whole number"),
        (lambda: Mesh.uniform(cells=(-2, 3)), "whole number"),
        (lambda: Mesh.uniform(cells=(4, 4, 4)), "one an axis"),
        (lambda: Mesh.uniform(cells=(4, 4), upper=(0, 1)), "upper"),
        (lambda: Mesh.uniform(cells=(4, 4), upper=(np.nan, 1)), "upper.*finite"),
        (lambda: Mesh.uniform(cells=(10**12, 10**12)), "cannot be counted"),
        (lambda: Mesh.uniform(cells=(2**70, 4)), "whole number"),
        (lambda: Mesh.uniform(cells=(10**5, 10**5)), "GiB"),
        (lambda: Mesh(np.zeros((3, 3)), np.zeros((3, 4))), r"\(3, 4\).*\(3, 3\)"),
        (lambda: Mesh(np.zeros(3), np.zeros(3)), r"\(3,\)"),
        (lambda: Mesh(np.zeros((3, 3)), np.zeros((3, 3))), "upper"),
        (lambda: bent().moved(bent().x[1:], bent().y), r"\(6, 5\).*\(7, 5\)"),
        (lambda: bent().moved(bent().x * np.nan, bent().y), r"`x` is nan at index \(0, 0\)"),
        (lambda: bent().quality(np.ones((2, 2))), r"\(2, 2\).*\(7, 5\)"),
        (lambda: bent().quality(np.zeros(SHAPE)), "above 0"),
        (lambda: bent().quality(np.ones(SHAPE) * 1j), "complex128"),
        (lambda: bent().quality("abc"), "<U3"),
        (lambda: bent().quality(np.ma.masked_array(np.ones(SHAPE), np.eye(7, 5))), "masked"),
        (lambda: transfer(np.ones((2, 2)), bent(), bent()), r"\(2, 2\).*\(7, 5\)"),
        (lambda: transfer(np.ones(SHAPE), bent(), bent((5, 5))), r"\(7, 5\).*\(6, 6\)"),
        (lambda: transfer(np.ones(SHAPE), bent(), bent(upper=(1, 2))), "different boxes"),
        (lambda: transfer(np.ones(SHAPE), bent(), bent(), "linear"), "interpolate"),
        (lambda: transfer(bent(periodic=(True, True)).x, *2 * [bent(periodic=(True, True))]), "axis 0 is periodic"),
        (lambda: Mesh(*np.meshgrid(np.arange(5), np.arange(4))), 'mirrored.*indexing="ij"'),
        (lambda: Mesh.uniform(cells=(4, 4), periodic="no"), "`periodic` is 'no'"),
        (lambda: Mesh.uniform(cells=(4, 4), periodic=(0, 2)), "`periodic` is"),
        (
            lambda: transfer(np.ones(SHAPE), bent(), bent().moved(1.1 * bent().x, bent().y)),
            "last side of axis 0 differs.*interpolate",
        ),
        (
            lambda: transfer(np.ones(SHAPE), bent(), bent().moved(bent().x, bent().y + 0.1)),
            "first side of axis 1 differs",
        ),
        (lambda: Mesh(bent().x, bent().y + 0.1 * bent().x, periodic=(True, False)), "axis 0 is periodic"),
    ],
)
def test_wrong_shapes_and_values_are_named(make, words):
    with pytest.raises(ValueError, match=words):
        make()


@pytest.mark.parametrize("periodic", [(False, False), (True, True), (True, False)])
def test_transfer_keeps_the_integral_and_the_range(periodic):
    rng = np.random.default_rng(1)
    old, new = (bent((12, 9), amount, lower=(-1, 0), periodic=periodic) for amount in (-0.08, 0.05))
    u = rng.random((13, 10, 2))
    u[-1], u[:, -1] = (u[0] if periodic[0] else u[-1]), (u[:, 0] if periodic[1] else u[:, -1])
    if periodic == (True, True):
        u[-1, -1] = u[0, 0]
    v = transfer(u, old, new)
    areas = old.areas[..., None], new.areas[..., None]
    np.testing.assert_allclose((v * areas[1]).sum(axis=(0, 1)), (u * areas[0]).sum(axis=(0, 1)), rtol=1e-13)
    assert v.min() >= u.min() - 1e-13 and v.max() <= u.max() + 1e-13
    assert old.areas.sum() == pytest.approx(2)


def test_transfer_has_the_orders_that_it_claims():
    def errors(n, method):
        old, new = bent((n, n), amount=-0.05), bent((n, n), amount=0.05)
        u, exact = (np.sin(3 * mesh.x) * np.cos(2 * mesh.y) for mesh in (old, new))
        off = np.abs(transfer(u, old, new, method) - exact)
        return np.array([off.max(), off.mean()])

    largest, mean = np.log2(errors(20, "conservative") / errors(40, "conservative"))
    assert 0.7 < largest < 1.5 < mean < 2.3
    assert (np.log2(errors(20, "interpolate") / errors(40, "interpolate")) > 1.7).all()


def test_interpolation_carries_linear_fields_exactly():
    old, new = bent(amount=-0.1), bent(amount=0.1)
    v = transfer(2 + 3 * old.x - old.y, old, new, method="interpolate")
    np.testing.assert_allclose(v, 2 + 3 * new.x - new.y, atol=1e-14)


def test_transfer_wants_meshes():
    with pytest.raises(TypeError, match="`old` is of type tuple"):
        transfer(np.ones(SHAPE), (bent().x, bent().y), bent())


def test_nodes_may_slide_along_straight_sides_of_any_shape():
    old = bent((12, 12))
    old = Mesh(old.x + 0.3 * old.y, old.y)
    s = np.linspace(0, 1, 13)[:, None] ** 1.2 * np.ones((1, 13))
    new = old.moved(s + 0.3 * old.y, old.y)
    u = transfer(np.exp(old.x), old, new)
    assert (u * new.areas).sum() == pytest.approx((np.exp(old.x) * old.areas).sum(), rel=1e-13)


def test_a_periodic_mesh_whose_seam_has_moved_is_made_again_from_its_nodes():
    for periodic in [(True, True), (True, False), (False, True)]:
        mesh = Mesh.uniform(cells=(12, 9), lower=(-1, 2), upper=(1, 5), periodic=periodic)
        wave = 0.05 * np.cos(np.pi * mesh.x) * np.sin(2 * np.pi * (mesh.y - 2) / 3)
        x, y = mesh.x + wave * periodic[0], mesh.y + wave * periodic[1]
        mesh = mesh.moved(x, y)
        assert Mesh(x, y, lower=mesh.lower, upper=mesh.upper, periodic=periodic) == mesh
        # the extent follows from the nodes alone, and a given corner is kept
        again = Mesh(x, y, lower=(-1, 2), periodic=periodic)
        assert again.lower == (-1, 2) and again.upper == pytest.approx((1, 5), rel=1e-14)
        assert again.areas == pytest.approx(mesh.areas)


@pytest.mark.parametrize("offset", [1, 3])
def test_misaligned_arrays_will_do(offset):
    u = np.arange(35.0).reshape(SHAPE)
    bytes_of = np.frombuffer(bytes(offset) + u.tobytes(), "u1")[offset:].view("f8").reshape(SHAPE)
    assert not bytes_of.flags.aligned
    np.testing.assert_array_equal(transfer(bytes_of, bent(), bent()), transfer(u, bent(), bent()))


def test_the_largest_values_are_carried():
    steps = 1 - 2.0 * (bent().x > 0.5)
    most = transfer(1e308 * steps, bent(amount=-0.1), bent())
    assert np.isfinite(most).all()
    np.testing.assert_allclose(most / 1e308, transfer(steps, bent(amount=-0.1), bent()), atol=1e-13)


@settings(max_examples=30, deadline=None)
@given(st.sampled_from(DTYPES), st.integers(0, 3), st.sampled_from(["conservative", "interpolate"]), st.data())
def test_dtype_order_and_strides_do_not_matter(dtype, layout, method, data):
    u = data.draw(
        arrays.arrays(
            np.dtype(dtype), SHAPE, elements={"allow_nan": False, "allow_infinity": False} if "f" in dtype else None
        )
    )
    old, new = bent(amount=-0.05), bent(amount=0.05)
    np.testing.assert_array_equal(
        transfer(layouts(u)[layout], old, new, method), transfer(u.astype(float).tolist(), old, new, method)
    )


@settings(max_examples=30, deadline=None)
@given(arrays.array_shapes(min_dims=0, max_dims=4, max_side=8))
def test_any_other_shape_is_refused(shape):
    if shape[:2] == SHAPE and len(shape) < 4:
        return
    with pytest.raises(ValueError, match="has shape") as error:
        transfer(np.zeros(shape), bent(), bent())
    assert str(shape) in str(error.value) and str(SHAPE) in str(error.value)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 6), st.integers(0, 4), st.sampled_from([np.nan, np.inf, -np.inf]))
def test_what_is_not_finite_is_named_with_its_place(i, j, value):
    u = np.zeros(SHAPE)
    u[i, j] = value
    with pytest.raises(ValueError, match=rf"`u` is {value} at index \({i}, {j}\)"):
        transfer(u, bent(), bent())


def test_meshio_and_pyvista_see_the_same_cells():
    mesh = bent()
    u = mesh.x + 10 * mesh.y
    theirs = mesh.to_meshio(u=u)
    grid = mesh.to_pyvista(u=u)
    corners = theirs.points[theirs.cells_dict["quad"]]
    area = 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])[:, 2]
    assert len(corners) == grid.n_cells == 24 and area.min() > 0 and area.sum() == pytest.approx(1)
    np.testing.assert_allclose(theirs.point_data["u"], theirs.points[:, 0] + 10 * theirs.points[:, 1])
    np.testing.assert_allclose(grid.point_data["u"], grid.points[:, 0] + 10 * grid.points[:, 1])
    assert grid.compute_cell_sizes()["Area"].sum() == pytest.approx(1)


def test_a_missing_extra_says_what_to_install(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "meshio", None)
    with pytest.raises(ImportError, match=r"pip install 'driftmesh\[meshio\]'"):
        bent().to_meshio()


def test_a_bump_survives_a_hundred_meshes(capsys):
    """By parabolas its peak loses at most a hundredth; the integral and 0 <= u <= 1 are kept, of many fields."""
    start = Mesh.uniform(cells=(40, 40))
    bump = np.exp(-((start.x - 0.5) ** 2 + (start.y - 0.5) ** 2) / 0.02)
    u, mesh = np.stack([bump, 0.5 * bump, 1 - bump], axis=-1), start
    for k in range(101):
        amount = 0.03 * np.sin(k) if k < 100 else 0.0
        wave = amount * np.sin(2 * np.pi * start.x) * np.sin(np.pi * start.y)
        new = start.moved(start.x + wave, start.y)
        u, mesh = transfer(u, mesh, new, order=3, bounds=(0, 1), told=k == 100), new
    told = capsys.readouterr().out.splitlines()
    assert len(told) == 3 and all("the peak lost" in line and "the integral is off by" in line for line in told)
    assert u.min() >= 0 and u.max() <= 1
    assert 0.99 <= u[..., 0].max()
    off = ((u - np.stack([bump, 0.5 * bump, 1 - bump], axis=-1)) * start.areas[..., None]).sum(axis=(0, 1))
    assert np.abs(off).max() < 1e-13


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"order": 4}, "`order` is 4"),
        ({"method": "interpolate", "order": 3}, "leave them out"),
        ({"bounds": (0, 1)}, "order=3"),
        ({"order": 3, "bounds": (1, 0)}, "`bounds` is"),
    ],
)
def test_how_a_field_is_carried_is_checked(arguments, said):
    mesh = bent()
    with pytest.raises(ValueError, match=re.escape(said)):
        transfer(np.ones(SHAPE), mesh, mesh, **arguments)


def test_fields_of_nodes_and_of_cells_go_out():
    mesh = Mesh.uniform(cells=(3, 2), upper=(3, 2))
    moved = Mesh(mesh.x + 0.1 * np.sin(np.pi * mesh.x / 3) * np.sin(np.pi * mesh.y / 2), mesh.y)
    u, k = moved.x * moved.y, np.arange(6.0).reshape(3, 2)
    data = moved.to_xarray(u=u, k=k)
    assert dict(data.sizes) == {"i": 4, "j": 3, "cell_i": 3, "cell_j": 2}
    assert np.array_equal(data.u, data.x * data.y) and np.array_equal(data.k, k)
    out = moved.to_meshio(u=u, k=k)
    centres = out.points[out.cells_dict["quad"]].mean(axis=1)
    assert np.array_equal(out.cell_data["k"][0], k.ravel())
    assert np.allclose(centres[:, 0] // 1 * 2 + centres[:, 1] // 1, k.ravel())
    grid = moved.to_pyvista(u=u, k=k)
    assert np.allclose(grid.points[:, 0] * grid.points[:, 1], grid.point_data["u"])
    centres = grid.cell_centers().points
    assert np.allclose(centres[:, 0] // 1 * 2 + centres[:, 1] // 1, grid.cell_data["k"])
    with pytest.raises(ValueError, match="shape"):
        moved.to_xarray(u=np.zeros((4, 2)))
