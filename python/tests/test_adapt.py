"""Starts as studies have them, densities, settings, copies and threads of generators."""

import copy
import pickle
import warnings

import numpy as np
import pytest

import driftmesh
from driftmesh import Arclength, Fixed, Given, Mesh, MeshGenerator, Schwarz, Stochastic, transfer
from driftmesh.errors import MeshFolded


def ring(x, y):
    return np.tanh(40 * (np.hypot(x - 0.4, y - 0.5) - 0.25))


def front(x):
    return np.tanh(80 * (x - 0.37))


def study(cells, initial):
    """The start of a study, reported by its first frame."""
    return {
        "study": {"name": "start", "kind": "moving-mesh"},
        "grid": {"cells": cells},
        "time": {"start": 0, "end": 1e-6, "step": 1e-6},
        "pde": {
            "kind": "formula",
            "unknowns": ["u"],
            "diffusivity": {"u": 1e-3},
            "initial": {"u": initial},
            "boundary": {"u": "no-flux"},
        },
        "output": {"report": False},
    }


RING, FRONT = "tanh(40*(sqrt((x-0.4)^2+(y-0.5)^2)-0.25))", "tanh(80*(x-0.37))"


def wave(x, y):
    return np.tanh(20 * np.sin(2 * np.pi * x)) * np.cos(2 * np.pi * y)


@pytest.mark.parametrize(
    ("cells", "initial", "function", "periodic"),
    [
        ([30, 24], RING, ring, False),
        ([110, 6], RING, ring, False),
        ([24, 20], "tanh(20*sin(2*pi*x))*cos(2*pi*y)", wave, True),
        ([80], FRONT, front, False),
    ],
)
def test_a_mesh_is_adapted_as_a_study_starts(cells, initial, function, periodic, tmp_path):
    tables = study(cells, initial)
    if periodic:
        tables["domain"] = {"periodic": [True, True]}
        del tables["pde"]["boundary"]
    start = driftmesh.run(tables, out=tmp_path / "run").frames[0]
    generator = MeshGenerator()
    mesh = generator.adapt(Mesh.uniform(cells, periodic=periodic), function)
    for axis in range(mesh.dimensions):
        np.testing.assert_allclose(mesh._nodes[..., axis], (start.x, start.y)[axis], atol=1e-12)
    if "rho" not in start.names:
        return  # frames of lines have no density
    rho = generator.density(start.mesh, start["u"])
    np.testing.assert_allclose(rho / rho.mean(), start["rho"] / start["rho"].mean(), rtol=1e-10)


def test_an_adapted_mesh_is_at_rest():
    """Two steps with the same data hardly move it, by any way to give the data."""
    mesh, generator = Mesh.uniform(cells=(30, 30)), MeshGenerator()
    adapted = generator.adapt(mesh, ring)
    new = generator.step(adapted, ring(adapted.x, adapted.y), dt=1.0)
    edge = min(np.diff(adapted.x, axis=0).min(), np.diff(adapted.y, axis=1).min())
    assert np.abs(new.velocity(adapted, 1.0)).max() < 0.02 * edge < 0.02 / 60
    fine = Mesh.uniform(cells=(200, 200))
    again = MeshGenerator().adapt(fine, ring(fine.x, fine.y))
    assert again.shape == (201, 201) and again.quality().min_scaled_jacobian > 0
    by_array = generator.adapt(adapted, ring(adapted.x, adapted.y))
    assert np.abs(by_array.velocity(adapted, 1.0)).max() < 0.3 * edge


def test_on_a_line_the_start_equidistributes_the_density():
    """∫ρ is the same over every cell, up to the share of an edge to which a mesh is at rest."""
    generator = MeshGenerator(monitor=lambda mesh, u: 1 + 9 * np.exp(-40 * (mesh.x - 0.3) ** 2))
    mesh = generator.adapt(Mesh.uniform(cells=60), None)
    assert mesh.quality(generator.density(mesh, None)).equidistribution < 1.03
    exact = driftmesh.equidistribute("1 + 9*exp(-40*(x - 0.3)^2)", 60)
    np.testing.assert_allclose(mesh.x, exact, atol=0.1 / 60)
    given = MeshGenerator(monitor=1 + 9 * np.exp(-40 * (mesh.x - 0.3) ** 2)).adapt(mesh, None)
    np.testing.assert_allclose(given.x, exact, atol=0.1 / 60)


def test_periodic_starts_see_images_inside_the_box():
    seen = []
    mesh = Mesh.uniform(cells=(20, 16), lower=(-1, 0), upper=(1, 1), periodic=(True, False))

    def bump(x, y):
        seen.append((x.min(), x.max()))
        return np.exp(-30 * (np.abs(x) - 1) ** 2)

    adapted = MeshGenerator().adapt(mesh, bump)
    assert min(low for low, _ in seen) >= -1 and max(high for _, high in seen) < 1
    np.testing.assert_array_equal(adapted.x[-1], adapted.x[0] + 2)


@pytest.mark.parametrize(
    ("data", "words"),
    [(lambda x, y: np.sign(x - 0.513), "the data jump"), (lambda x: np.sign(x - 0.513), "the data jump")],
)
def test_a_start_that_does_not_rest_is_warned_of(data, words):
    mesh = Mesh.uniform(cells=20 if data.__code__.co_argcount == 1 else (20, 20))
    with pytest.warns(RuntimeWarning, match=words):
        MeshGenerator().adapt(mesh, data)


def test_what_a_function_raises_is_raised():
    def broken(x, y):
        raise KeyError("broken")

    with pytest.raises(KeyError, match="broken"):
        MeshGenerator().adapt(Mesh.uniform(cells=(8, 8)), broken)


def folded():
    mesh = Mesh.uniform(cells=(8, 8))
    return mesh.moved(np.where(mesh.x == 0.5, 0.9, mesh.x), mesh.y)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda g, m: g.adapt(m, None), "`u` is None"),
        (lambda g, m: g.adapt(m, m.x[1:]), r"`u0` has shape \(8, 9\).*\(9, 9\)"),
        (lambda g, m: g.adapt(m, lambda x, y: x[1:]), r"`u0` has shape \(8, 9\).*\(9, 9\)"),
        (lambda g, m: g.adapt(m, lambda x, y: x * np.nan), r"`u0` is nan at index \(0, 0\)"),
        (lambda g, m: g.adapt(m.x, m.x), "ndarray"),
        (lambda g, m: g.density(m, None), "`u` is None"),
        (lambda g, m: g.density(m, m.x[1:]), r"\(8, 9\).*\(9, 9\)"),
        (lambda g, m: MeshGenerator(Given()).density(m, m.x), r"density is 0.0 at index \(0, 0\)"),
        (lambda g, m: MeshGenerator(prediction=0.2), "`prediction` is 0.2, but needs relaxation"),
        (lambda g, m: MeshGenerator(relaxation={"steps": 30}, prediction=0.9), "relaxation.prediction"),
        (lambda g, m: MeshGenerator(relaxation={"step": 20}), "`relaxation` is {'step': 20}, but must be"),
        (lambda g, m: MeshGenerator(relaxation={}), "`relaxation` is {}, but must be"),
        (lambda g, m: MeshGenerator(relaxation={"steps": 3, "prediction": 0.1}, prediction=0.2), "has one, too"),
        (lambda g, m: MeshGenerator(safety={"halvings": 3}), "`safety` has the key 'halvings'"),
        (lambda g, m: MeshGenerator(safety={"substeps": 0}), "safety.substeps"),
        (lambda g, m: MeshGenerator(safety={"substeps": 1.5}), "safety.substeps` is 1.5"),
        (lambda g, m: MeshGenerator(safety=8), "`safety` is 8"),
        (lambda g, m: MeshGenerator(threads=0), "`threads` is 0"),
        (lambda g, m: transfer(m.x, m, m, threads=2.5), "`threads` is 2.5"),
        (lambda g, m: driftmesh.run({}, threads=-1), "`threads` is -1"),
        (
            lambda g, m: MeshGenerator(method=Schwarz()).step(Mesh.uniform(cells=8), np.zeros(9), 0.1),
            "a mesh of a line needs one number of subdomains",
        ),
        (
            lambda g, m: MeshGenerator(method=Schwarz(subdomains=2)).step(m, m.x, 0.1),
            "a mesh in the plane needs a number of subdomains for each axis",
        ),
    ],
)
def test_wrong_values_are_named(call, words):
    with pytest.raises(ValueError, match=words):
        call(MeshGenerator(), Mesh.uniform(cells=(8, 8)))


def test_folded_meshes_are_refused():
    for call in (lambda g: g.adapt(folded(), ring), lambda g: g.density(folded(), folded().x)):
        with pytest.raises(MeshFolded):
            call(MeshGenerator())


def test_settings_can_be_read():
    default = MeshGenerator()
    assert (default.prediction, default.safety, default.threads) == (None, {"substeps": 8, "smoothing": 8}, None)
    generator = MeshGenerator(relaxation={"steps": 30}, prediction=0.3, safety={"substeps": 2}, threads=2)
    assert generator.relaxation == {"steps": 30, "prediction": 0.3} and generator.prediction == 0.3
    assert (generator.safety, generator.threads) == ({"substeps": 2, "smoothing": 8}, 2)
    assert MeshGenerator(relaxation=0.5).prediction == 0.0
    for name in ("prediction", "safety", "threads", "predictions"):
        with pytest.raises(AttributeError, match=name):
            setattr(generator, name, 1)


def follow(generator, mesh, first, steps, dt=0.01):
    for k in range(first, first + steps):
        u = np.tanh(30 * (mesh.x + (mesh.y if mesh.dimensions == 2 else 0) - 0.7 - 0.1 * k * dt))
        mesh = generator.step(mesh, u, dt)
    return mesh


def test_safety_says_how_far_a_step_that_folds_is_tried_again():
    mesh = Mesh.uniform(cells=(24, 24))
    peak = lambda a, b: np.exp(-2000 * ((mesh.x - a) ** 2 + (mesh.y - b) ** 2))
    rho = 1 + 100 * (peak(0.5, 0.47) + peak(0.2, 0.8))

    def retries(**settings):
        generator = MeshGenerator(monitor=rho, relaxation=0.1, form="gradient", **settings)
        generator.step(mesh, None, 1.0)
        return generator.last["retries"]

    # 2, 4 and 8 parts, then more and more passes
    careful = retries()
    assert careful["substeps"] == 3 and careful["smoothed"] > 0
    assert retries(safety={"substeps": 2})["substeps"] == 1
    for none in ({"smoothing": 0}, {"substeps": 1, "smoothing": 0}):
        with pytest.raises(MeshFolded):
            retries(safety=none)


@pytest.mark.parametrize(
    "make",
    [
        MeshGenerator,
        lambda: MeshGenerator(Arclength(), Stochastic(subdomains=(2, 2), seed=3), {"steps": 30}, prediction=0.2),
        lambda: MeshGenerator(Arclength(), Schwarz(subdomains=(2, 2)), safety={"substeps": 4}, threads=1),
        lambda: MeshGenerator(method=Fixed()),
    ],
)
@pytest.mark.parametrize("again", [lambda g: pickle.loads(pickle.dumps(g)), copy.copy, copy.deepcopy])
def test_copies_go_on_to_the_bit(make, again):
    for cells in (24, (24, 24)):
        if cells == 24 and isinstance(make().method, (Stochastic, Schwarz)):
            continue
        generator = make()
        mesh = follow(generator, Mesh.uniform(cells=cells), 0, 6)
        other = again(generator)
        assert other.last == generator.last
        for name in ("relaxation", "prediction", "form", "safety", "threads"):
            assert getattr(other, name) == getattr(generator, name)
        on = follow(generator, mesh, 6, 4)
        assert follow(other, mesh, 6, 4) == on
        # one that begins anew goes another way
        assert follow(make(), mesh, 6, 4) != on or isinstance(generator.method, Fixed)


def test_a_pickle_of_another_version_is_refused():
    generator = MeshGenerator()
    follow(generator, Mesh.uniform(cells=(8, 8)), 0, 2)
    memory = generator._native.memory()
    version = driftmesh.__version__.encode()
    with pytest.raises(ValueError, match=r"`state` is of version [9.]+, but must be of version .*make a new one"):
        MeshGenerator()._native.remember(memory.replace(version, b"9" * len(version), 1))
    with pytest.raises(ValueError, match="what a generator of this version remembered"):
        MeshGenerator()._native.remember(b"nonsense")


def test_results_have_the_same_bits_for_any_number_of_threads(tmp_path):
    def steps(threads):
        mesh, generator = Mesh.uniform(cells=(150, 150)), MeshGenerator(threads=threads)
        u = ring(mesh.x, mesh.y)
        for _ in range(2):
            new = generator.step(mesh, u, 0.1)
            u, mesh = transfer(u, mesh, new, threads=threads), new
        return mesh, u

    (one, u), (three, v) = steps(1), steps(3)
    assert one == three and np.array_equal(u, v)
    runs = [driftmesh.run(study([140, 130], RING), out=tmp_path / str(n), threads=n) for n in (1, 3)]
    assert [run.summary["parallel"]["threads"] for run in runs] == [1, 3]
    for name in ("x", "y", "u"):
        np.testing.assert_array_equal(runs[0].final[name], runs[1].final[name])


def test_two_steps_with_a_mean_density_follow_the_density_first():
    """The first step from rest is the mesh equation with `density` itself."""
    mesh = Mesh.uniform(cells=(20, 20))
    u = ring(mesh.x, mesh.y)
    generator = MeshGenerator(monitor=Arclength(relative=30), relaxation=0.5)
    given = MeshGenerator(monitor=generator.density(mesh, u), relaxation=0.5)
    assert given.step(mesh, None, 0.1) == generator.step(mesh, u, 0.1)


def test_a_line_follows_a_front():
    mesh, generator = Mesh.uniform(cells=60), MeshGenerator()
    mesh = generator.adapt(mesh, front)
    assert np.diff(mesh.x).min() < 0.3 / 60 and mesh.x[0] == 0 and mesh.x[-1] == 1
    u = front(mesh.x)
    for step in range(1, 40):
        new = generator.step(mesh, front(mesh.x - 0.002 * step), dt=0.01)
        u, mesh = transfer(u, mesh, new), new
    layer = mesh.x[np.diff(mesh.x).argmin()]
    assert abs(layer - 0.37 - 0.08) < 0.02


@pytest.mark.parametrize("periodic", [False, True])
def test_transfer_on_lines_keeps_the_integral_and_the_range(periodic):
    line = Mesh.uniform(cells=40, periodic=periodic)
    old, new = (line.moved(line.x + a * np.sin(2 * np.pi * line.x)) for a in (-0.1, 0.1))
    u = np.stack([np.cos(2 * np.pi * old.x), old.x > 0.5], axis=-1).astype(float)
    u[-1] = u[0] if periodic else u[-1]
    v = transfer(u, old, new)
    np.testing.assert_allclose(new.areas @ v, old.areas @ u, rtol=1e-12, atol=1e-14)
    assert (v.min(axis=0) >= u.min(axis=0) - 1e-13).all() and (v.max(axis=0) <= u.max(axis=0) + 1e-13).all()
    assert old.areas.sum() == pytest.approx(1)
    if not periodic:
        linear = transfer(1 + 2 * old.x, old, new, "interpolate")
        np.testing.assert_allclose(linear, 1 + 2 * new.x)


def test_meshes_of_lines():
    line = Mesh.uniform(cells=80, lower=0.0, upper=2.0)
    assert (line.dimensions, line.shape, line.cells, line.lower, line.upper) == (1, (81,), (80,), (0.0,), (2.0,))
    assert Mesh.uniform(line.cells, line.lower, line.upper, line.periodic) == line
    assert Mesh(line.x) == line == pickle.loads(pickle.dumps(line)) and line.quality().q_max == 1
    wraps = Mesh.uniform(cells=8, periodic=True)
    shifted = wraps.moved(wraps.x + 0.3)
    assert Mesh(shifted.x, lower=0.0, periodic=True) == shifted
    with pytest.raises(AttributeError, match="a mesh of a line"):
        _ = line.y
    assert not hasattr(line, "y")
    assert line.to_meshio(u=line.x).cells_dict["line"].shape == (80, 2)
    assert line.to_pyvista(u=line.x).n_cells == 80


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Mesh([0, 1]), r"\(2,\).*3 nodes"),
        (lambda: Mesh(np.zeros((3, 3))), r"\(3, 3\).*`y` beside it"),
        (lambda: Mesh([2.0, 1.0, 0.0]), "mirrored"),
        (lambda: Mesh.uniform(cells=1), "at least 2"),
        (lambda: Mesh.uniform(cells=8, lower=(0, 0)), "one an axis"),
        (lambda: Mesh.uniform(cells=8, lower=1), "upper"),
        (lambda: Mesh.uniform(cells=8).moved([0, 1, 2]), r"\(3,\).*\(9,\)"),
        (lambda: Mesh.uniform(cells=8).moved(np.zeros(9), np.zeros(9)), "`y` is given"),
        (lambda: Mesh.uniform(cells=(8, 8)).moved(np.zeros((9, 9))), "`y` is missing"),
        (lambda: MeshGenerator().step(Mesh.uniform(cells=8), np.zeros(8), 0.1), r"\(8,\).*\(9,\)"),
        (
            lambda: MeshGenerator().step(Mesh([0, 0.5, 1], lower=-1), np.zeros(3), 0.1),
            "does not fill its box",
        ),
        (
            lambda: transfer(np.zeros(3), Mesh([0, 0.5, 1], upper=2), Mesh([0, 0.5, 1.5], upper=2)),
            "last side of axis 0 differs",
        ),
    ],
)
def test_mistakes_with_lines_are_named(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def test_runs_on_lines_have_meshes(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = driftmesh.run(study([40], FRONT), out=tmp_path / "run")
    assert result.mesh.shape == (41,) and result.mesh == result.frames[-1].mesh
