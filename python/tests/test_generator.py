"""Moving a mesh to somebody's data."""

import copy
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import textwrap
import threading
import time
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from driftmesh import (
    Arclength,
    Fixed,
    Given,
    GridWalk,
    Interpolation,
    Largest,
    Mesh,
    MeshGenerator,
    MonteCarlo,
    ResidualWalk,
    RootGradient,
    Schwarz,
    Stochastic,
    Strip,
    Whole,
    transfer,
)
from driftmesh.errors import MeshFolded


def layer(mesh):
    return np.tanh(20 * (mesh.x + mesh.y - 1))


def follow(generator, steps=10, cells=(24, 24), dt=0.01):
    mesh = Mesh.uniform(cells=cells)
    for _ in range(steps):
        mesh = generator.step(mesh, layer(mesh), dt)
    return mesh


def test_the_mesh_goes_where_the_layer_is():
    mesh = follow(MeshGenerator(monitor=Arclength(relative=30, smoothing=2), relaxation=0.1), steps=40)
    shortest = np.hypot(np.diff(np.diagonal(mesh.x)), np.diff(np.diagonal(mesh.y)))
    assert shortest.argmin() in (11, 12) and shortest.min() < 0.5 * shortest.max()
    assert mesh.quality().min_scaled_jacobian > 0


def test_monitors_by_name_by_array_and_by_function_are_the_same():
    mesh = Mesh.uniform(cells=(12, 12))
    rho = 1 + 9 * np.exp(-30 * (mesh.x - 0.5) ** 2)
    ways = [
        MeshGenerator(monitor=Given()).step(mesh, rho, 0.05),
        MeshGenerator(monitor=rho).step(mesh, None, 0.05),
        MeshGenerator(monitor=lambda mesh, u: 1 + 9 * np.exp(-30 * (mesh.x - u) ** 2)).step(mesh, 0.5, 0.05),
        MeshGenerator(monitor=7 * rho).step(mesh, None, 0.05),
    ]
    assert ways[0] == ways[1] == ways[2] != mesh
    np.testing.assert_allclose(ways[3].x, ways[0].x, atol=1e-13)
    assert MeshGenerator(monitor=np.full(mesh.shape, 3)).step(mesh, None, 1.0).x == pytest.approx(mesh.x)
    generator = MeshGenerator(monitor=rho)
    generator.step(mesh, None, 0.05)
    generator.monitor = RootGradient()
    assert generator.step(mesh, layer(mesh), 0.05) == MeshGenerator().step(mesh, layer(mesh), 0.05)


@pytest.mark.parametrize(
    "method",
    [
        Schwarz(subdomains=(2, 2)),
        Stochastic(subdomains=(2, 3), seed=3),
        Stochastic(subdomains=(2, 2), estimator=ResidualWalk(sweeps=20, walks=4, smoother="jacobi")),
        Stochastic(subdomains=(2, 2), estimator=Strip(width=4)),
        Schwarz(subdomains=(2, 2), method="optimized", tolerance=1e-10),
        Stochastic(subdomains=(2, 2), estimator=GridWalk(walks=200, increment=True), interface=Interpolation(sample=9)),
        Stochastic(subdomains=(2, 2), estimator=MonteCarlo(paths=2000, substeps=10, control_variate=True)),
    ],
)
def test_subdomains_give_the_mesh_of_the_whole_domain(method):
    """Within six standard errors; paths are continuous in time and have a bias, strips leave up to a hundredth of an
    edge."""
    whole, divided, again = (MeshGenerator(Arclength(), m, 1.0, "gradient") for m in (Whole(), method, method))
    mesh = follow(divided, steps=1, dt=1e-3)
    interface = divided.last["interface"]
    estimator = getattr(method, "estimator", None)
    edge = min(np.diff(mesh.x, axis=0).min(), np.diff(mesh.y, axis=1).min())
    local = isinstance(method, Stochastic) and (estimator is None or isinstance(estimator, (ResidualWalk, Strip)))
    bias = 1e-3 if isinstance(estimator, MonteCarlo) else 0.01 * edge if local else 1e-9
    assert interface["points"] > 0
    assert np.abs(mesh.x - follow(whole, steps=1, dt=1e-3).x).max() < 6 * (interface["standard_error"] or 0) + bias
    assert mesh == follow(again, steps=1, dt=1e-3)


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize(
    "method",
    [
        Schwarz(subdomains=4),
        Schwarz(subdomains=(3,), method="optimized", tolerance=1e-10),
        Stochastic(subdomains=4, seed=3),
        Stochastic(subdomains=2, estimator=Strip(width=4)),
        Stochastic(subdomains=4, estimator=GridWalk(walks=400, increment=True)),
        Stochastic(subdomains=4, estimator=MonteCarlo(paths=4000, substeps=20, control_variate=True)),
    ],
)
def test_subdomains_of_a_line_give_the_mesh_of_the_whole(method, periodic):
    """Within six standard errors, and what strips leave, in a step so short that paths, which follow the mesh equation
    exactly in time, and an implicit Euler step agree."""
    start = Mesh.uniform(cells=48, periodic=periodic)
    u = np.exp(np.cos(2 * np.pi * (start.x - 0.4)) * 4)
    step = lambda method: MeshGenerator(Arclength(), method, 1.0).step(start, u, 1e-4)
    divided = MeshGenerator(Arclength(), method, 1.0)
    mesh = divided.step(start, u, 1e-4)
    allowed = 6 * (divided.last["interface"]["standard_error"] or 0) + 0.01 / 48
    assert divided.last["interface"]["points"] > 0
    assert 0 < np.abs(mesh.x - start.x).max() and np.abs(mesh.x - step(Whole()).x).max() < allowed
    copied = pickle.loads(pickle.dumps(MeshGenerator(Arclength(), method, 1.0)))
    assert mesh == step(method) == copied.step(start, u, 1e-4)


def test_a_mesh_may_stay():
    assert follow(MeshGenerator(method=Fixed())) == Mesh.uniform(cells=(24, 24))


def test_periodic_meshes_stay_closed():
    mesh = Mesh.uniform(cells=(16, 12), lower=(-1, 0), periodic=(True, True))
    generator = MeshGenerator(Arclength(), relaxation=0.1)
    for step in range(5):
        mesh = generator.step(mesh, np.sin(np.pi * (mesh.x - 0.1 * step)) + np.sin(2 * np.pi * mesh.y), 0.02)
    np.testing.assert_array_equal(mesh.x[-1], mesh.x[0] + 2)
    np.testing.assert_array_equal(mesh.y[:, -1], mesh.y[:, 0] + 1)
    assert mesh != Mesh.uniform(cells=(16, 12), lower=(-1, 0), periodic=(True, True))


@settings(max_examples=20, deadline=None)
@given(st.sampled_from(["f4", "f8", ">f8", "i4", "?"]), st.sampled_from(["C", "F"]), st.booleans())
def test_dtype_order_and_strides_do_not_matter(dtype, order, backwards):
    mesh = Mesh.uniform(cells=(10, 8))
    u = np.array(10 * layer(mesh), dtype=dtype, order=order)
    given = u[::-1].copy(order=order)[::-1] if backwards else u
    expected = MeshGenerator(relaxation=0.1).step(mesh, u.astype(float).tolist(), 0.01)
    assert MeshGenerator(relaxation=0.1).step(mesh, given, 0.01) == expected


def square():
    return Mesh.uniform(cells=(8, 8))


def sheared():
    mesh = square()
    return mesh.moved(mesh.x + 0.3 * mesh.y, mesh.y)


def test_a_mesh_whose_sides_are_not_those_of_its_box_moves_along_them():
    mesh = MeshGenerator().step(sheared(), np.tanh(20 * (square().x - 0.4)), 0.1)
    assert np.abs(mesh.x[0] - 0.3 * mesh.y[0]).max() < 1e-12
    assert mesh.quality().min_scaled_jacobian > 0


@pytest.mark.parametrize(
    ("step", "words"),
    [
        (lambda: MeshGenerator().step(square(), np.zeros((8, 8)), 0.1), r"\(8, 8\).*\(9, 9\)"),
        (lambda: MeshGenerator().step(square(), np.full((9, 9), np.nan), 0.1), r"nan at index \(0, 0\)"),
        (lambda: MeshGenerator().step(square(), None, 0.1), "`u` is None"),
        (lambda: MeshGenerator().step(square().x, square().x, 0.1), "ndarray"),
        (lambda: MeshGenerator().step(square(), square().x, 0), "`dt` is 0"),
        (lambda: MeshGenerator().step(square(), square().x, -1e-3), "`dt` is -0.001"),
        (lambda: MeshGenerator().step(square(), square().x, np.nan), "`dt` is nan"),
        (lambda: MeshGenerator().step(square(), square().x, "soon"), "`dt` is 'soon'"),
        (lambda: MeshGenerator().step(square(), square().x, "0.01"), "`dt` is '0.01'"),
        (lambda: MeshGenerator().step(square(), square().x, True), "`dt` is True"),
        (lambda: Stochastic(interface=3), "`interface` is 3"),
        (lambda: Stochastic(estimator="residual-walk"), "`estimator` is 'residual-walk'"),
        (lambda: MeshGenerator(Given()).step(square(), square().x, 0.1), r"density is 0.0 at index \(0, 0\)"),
        (lambda: MeshGenerator(np.ones((3, 3))).step(square(), None, 0.1), r"\(3, 3\).*\(9, 9\)"),
        (lambda: MeshGenerator(relaxation=0), "relaxation"),
        (lambda: MeshGenerator(relaxation={"steps": 1}), "relaxation.steps"),
        (lambda: MeshGenerator(relaxation={"steps": 40, "prediction": 0.9}), "relaxation.prediction"),
        (lambda: MeshGenerator(form="implicit"), "known here: gradient, conservative|unknown"),
        (lambda: MeshGenerator(method="whole"), "must be Whole"),
        (lambda: MeshGenerator(Arclength), "must be Arclength"),
        (lambda: MeshGenerator("auto"), "must be Arclength"),
        (lambda: Arclength(relative=1, absolute=1), "not both"),
        (lambda: MeshGenerator(Arclength(relative=-1)), "monitor.strength.relative"),
        (lambda: MeshGenerator(Arclength(smoothing=-1)), "smoothing"),
        (lambda: MeshGenerator(method=Schwarz(subdomains=(9, 9))).step(square(), square().x, 0.1), "subdomains"),
    ],
)
def test_wrong_shapes_and_values_are_named(step, words):
    with pytest.raises(ValueError, match=words):
        step()


def test_a_folded_mesh_is_an_error_with_a_remedy():
    mesh = square()
    x = mesh.x.copy()
    x[4, 4] = 0.9
    with pytest.raises(MeshFolded, match=r"the mesh folded: cell \(.*\n +help: .*`dt`"):
        MeshGenerator().step(mesh.moved(x, mesh.y), mesh.x, 0.1)


def test_a_generator_copies_its_settings():
    make = lambda: MeshGenerator(Arclength(absolute=3), Stochastic(subdomains=(2, 2), seed=5), relaxation={"steps": 30})
    fresh = follow(make())
    assert follow(pickle.loads(pickle.dumps(make()))) == follow(copy.deepcopy(make())) == fresh


def test_other_threads_go_on_meanwhile():
    """The interpreter is free during a step, and two generators work side by side."""
    found = {}
    threads = [
        threading.Thread(target=lambda k=k: found.update({k: follow(MeshGenerator(relaxation=0.1))})) for k in range(3)
    ]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert found[0] == found[1] == found[2] == follow(MeshGenerator(relaxation=0.1))


def large(_):
    """On so many nodes all threads of the library take part."""
    return float(follow(MeshGenerator(relaxation=0.1), steps=1, cells=(150, 150)).x.sum())


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_forked_processes_have_threads_of_their_own():
    here = large(0)
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.map_async(large, range(2)).get(timeout=60) == [here, here]


BESIDE = """
    import threading
    import time
    from pathlib import Path
    from driftmesh import Mesh, MeshGenerator, run

    study = {
        "study": {"name": "front", "kind": "moving-mesh"},
        "grid": {"cells": [60, 60]},
        "time": {"start": 0.25, "end": 0.35, "step": 1e-3},
        "pde": {"kind": "burgers", "viscosity": 0.005},
        "output": {"report": False},
    }
    computing = threading.Thread(target=lambda: run(study))
    computing.start()
    while not Path("out/front").exists():
        time.sleep(1e-3)
    mesh = Mesh.uniform(cells=(8, 8))
    for _ in range(10):
        mesh = MeshGenerator().step(mesh, mesh.x**2, 0.1)
    print(computing.is_alive())
    computing.join()
"""


def test_a_step_does_not_wait_for_a_run(tmp_path):
    """Even where the library has one thread."""
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(BESIDE)],
        env=os.environ | {"RAYON_NUM_THREADS": "1"},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.stdout == "True\n", done.stderr


def test_ctrl_c_gives_up_a_long_step():
    """The rest of the step goes on in the background, and the generator says so."""
    mesh = Mesh.uniform(cells=(24, 24))
    generator = MeshGenerator(method=Stochastic(estimator=MonteCarlo(paths=100_000, substeps=50)))
    threading.Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        generator.step(mesh, layer(mesh), 1e-3)
    assert time.monotonic() - began < 3
    with pytest.raises(RuntimeError, match="still at work"):
        generator.step(mesh, layer(mesh), 1e-3)
    # others go on meanwhile
    assert follow(MeshGenerator(relaxation=0.1), steps=1) != mesh


def test_with_nothing_set_a_mesh_rests_and_follows():
    """As in a study: the mesh around a standing front comes to rest, and one that moves is followed without a lag."""
    front = lambda mesh, t: np.tanh(100 * (mesh.x + 0.09 * np.sin(2 * np.pi * mesh.y) - 0.2 - t))
    mesh, generator, dt = Mesh.uniform(cells=(40, 40)), MeshGenerator(), 0.004
    for _ in range(200):
        new = generator.step(mesh, front(mesh, 0), dt)
        way, mesh = 40 * np.hypot(new.x - mesh.x, new.y - mesh.y).max(), new
    assert way < 1e-3 and generator.last["relaxation_steps"] >= 15
    errors = []
    for step in range(100):
        mesh = generator.step(mesh, front(mesh, step * dt), dt)
        middle = lambda a: (a[1:, 1:] + a[:-1, 1:] + a[1:, :-1] + a[:-1, :-1]) / 4
        at = (step + 1) * dt
        exact = np.tanh(100 * (middle(mesh.x) + 0.09 * np.sin(2 * np.pi * middle(mesh.y)) - 0.2 - at))
        errors.append(abs(middle(front(mesh, at)) - exact).max())
    assert np.median(errors) <= 0.06


def test_a_node_of_one_in_a_field_of_zeros_folds_nothing():
    mesh, generator = Mesh.uniform(cells=(32, 32)), MeshGenerator(relaxation=0.1)
    u = np.zeros(mesh.shape)
    u[7, 9] = 1
    for _ in range(30):
        mesh = generator.step(mesh, u, 0.01)
        assert mesh.quality().min_scaled_jacobian > 1e-12


def test_settings_can_be_read_and_no_other_attribute_is_taken():
    default = MeshGenerator()  # the mesh equation of studies and of the library
    assert (default.relaxation, default.form, default.method) == ("auto", "conservative", Whole())
    generator = MeshGenerator(relaxation=0.5, form="gradient")
    assert (generator.relaxation, generator.form, generator.method) == (0.5, "gradient", Whole())
    for name, value in [("relaxation", 0.001), ("method", Fixed()), ("tau", 1.0)]:
        with pytest.raises(AttributeError, match=name):
            setattr(generator, name, value)


def test_noise_is_warned_of_once():
    mesh = Mesh.uniform(cells=(30, 30), lower=(0, 0), upper=(1, 1))
    generator = MeshGenerator()
    noise = np.random.default_rng(1).random((31, 31))
    with pytest.warns(RuntimeWarning, match="noisy-density: .* goes up and down from node to node"):
        mesh = generator.step(mesh, noise, dt=1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        generator.step(mesh, noise, dt=1.0)
        MeshGenerator().step(mesh, np.tanh(1e3 * (mesh.x - 0.5)), dt=1.0)


def test_one_cell_on_a_periodic_axis():
    mesh = Mesh.uniform(cells=(60, 1), lower=(0, 0), upper=(1, 0.1), periodic=(False, True))
    generator = MeshGenerator()
    for _ in range(60):
        old, mesh = mesh, generator.step(mesh, np.tanh(60 * (mesh.x - 0.37)), dt=1.0)
    assert np.diff(mesh.x[:, 0]).min() < 0.2 / 60
    carried = transfer(np.tanh(60 * (old.x - 0.37)), old, mesh)
    assert np.abs(carried - np.tanh(60 * (mesh.x - 0.37))).max() < 1e-2


def test_a_relaxation_that_is_too_short_is_warned_of():
    def follow_ring(relaxation):
        mesh, generator = Mesh.uniform(cells=(40, 40)), MeshGenerator(relaxation=relaxation)
        for _ in range(100):
            ring = np.tanh((np.hypot(mesh.x - 0.5, mesh.y - 0.5) - 0.3) / 0.01)
            mesh = generator.step(mesh, ring, 1e-3)

    with pytest.warns(RuntimeWarning, match="`relaxation` is short: the mesh turns back from step to step"):
        follow_ring({"steps": 4})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        follow_ring("auto")


def test_monitors_combine():
    """The larger of two densities, each over its mean, whatever the size of either."""
    mesh = Mesh.uniform(cells=(24, 16), upper=(2, 1))
    one, other = lambda m, u: 1 + 9 * (m.x < 0.5), lambda m, u: 500 * (1 + 3 * (m.y > 0.5) * u)
    both = one | RootGradient() | other
    assert [both.monitors[k] for k in (0, 2)] == [one, other] and both.monitors[1] == RootGradient()
    mean = lambda rho: rho / ((rho * mesh.areas).sum() / mesh.areas.sum())
    u = 1 + mesh.x
    expected = np.maximum(mean(one(mesh, u)), mean(other(mesh, u)))
    assert np.allclose(MeshGenerator(monitor=Largest(one, other)).density(mesh, u), expected, rtol=1e-12)
    fields = np.stack([mesh.x, np.zeros(mesh.shape)])  # one field each: the second density is even
    assert np.allclose(Largest(one, other)(mesh, fields), np.maximum(mean(one(mesh, u)), 1), rtol=1e-12)
    # layers of two fields, thin enough that both draw half of all nodes
    generator = MeshGenerator(monitor=RootGradient() | RootGradient())
    layers = lambda x, y: (np.tanh(100 * (x - 0.4)), np.tanh(100 * (x - 1.7)))
    adapted = generator.adapt(Mesh.uniform(cells=(40, 4), upper=(2, 1)), layers)
    widths = np.interp([0.4, 1.7], adapted.x[1:, 0], np.diff(adapted.x[:, 0]))
    assert (widths < 0.3 * 2 / 40).all(), widths
    for wrong, message in [((mesh.x,), "1 fields for 2"), ((mesh.x, mesh.x, mesh.x), "3 fields for 2")]:
        with pytest.raises(ValueError, match=message):
            generator.step(mesh, wrong, 0.1)
    for nonsense in (lambda: Largest(), lambda: RootGradient() | 3, lambda: Largest(RootGradient)):
        with pytest.raises(ValueError, match="monitor"):
            nonsense()
