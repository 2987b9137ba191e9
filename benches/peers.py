"""driftmesh beside tools that others wrote, on two problems with exact solutions: `python benches/peers.py`.

1. The boundary layer of FiPy's manual (examples.convection.exponential1D.mesh1D): -u'' + 10 u' = 0 on [0, 10] with
   u(0) = 0, u(10) = 1. FiPy and SciPy's `solve_bvp` solve it at rest; driftmesh steps to rest.
2. A travelling front, u_t = D u_xx + u (1 - u)(u - 1/4)/D with D = 0.002 to t = 1, no flux through the ends, by py-pde
   and SciPy's `solve_ivp` on equal cells; driftmesh on cells that move. This problem is one of driftmesh's manual.

Prints the largest error at a node and the seconds with compiled code, initial state included, start of Python excluded.
In an environment with driftmesh: pip install py-pde==0.59.0 fipy==4.0.3 scipy==1.17.1
"""

import tempfile
import time
from importlib.metadata import version

import driftmesh
import numpy as np

D, START, SPEED = 0.002, 0.3, 0.5 / np.sqrt(2)


def layer(x):
    return np.expm1(10 * x) / np.expm1(100)


def front(x, t):
    return 1 / (1 + np.exp(np.clip((x - START - SPEED * t) / (np.sqrt(2) * D), -700, 700)))


def ours(cells, study):
    """The largest error of a study in [pde], [domain], [time]."""
    head = {"study": {"name": "peer", "kind": "moving-mesh"}, "grid": {"cells": [cells]}}
    with tempfile.TemporaryDirectory() as directory:
        run = driftmesh.run(head | study | {"output": {"report": False}}, out=f"{directory}/run", threads=1)
        return run.summary["reports"][-1]["error"]["linf"]


def layer_ours(cells):
    pde = {
        "kind": "formula",
        "unknowns": ["u"],
        "flux": {"u": ["10*u"]},
        "diffusivity": {"u": "1"},
        "initial": {"u": "x/10"},
        "boundary": {"u": {"left": "0", "right": "1"}},
        "exact": {"u": "exp(10*(x - 10)) - exp(-100)"},
    }
    domain = {"lower": [0.0], "upper": [10.0]}
    return ours(cells, {"domain": domain, "time": {"start": 0.0, "end": 10.0}, "pde": pde})


def layer_fipy(cells):
    from fipy import CellVariable, DiffusionTerm, ExponentialConvectionTerm, Grid1D

    mesh = Grid1D(nx=cells, dx=10 / cells)
    u = CellVariable(mesh=mesh, value=0.0)
    u.constrain(0.0, mesh.facesLeft)
    u.constrain(1.0, mesh.facesRight)
    (DiffusionTerm(coeff=1.0) - ExponentialConvectionTerm(coeff=(10.0,))).solve(var=u)
    return np.abs(u.value - layer(mesh.cellCenters.value[0])).max()


def layer_scipy(cells):
    from scipy.integrate import solve_bvp

    x = np.linspace(0, 10, cells + 1)
    found = solve_bvp(lambda x, u: [u[1], 10 * u[1]], lambda a, b: [a[0], b[0] - 1], x, [x / 10, 0 * x + 0.1], tol=1e-6)
    return np.abs(found.y[0] - layer(found.x)).max()


def front_ours(cells):
    z = f"(x - {START} - {SPEED}*t)/(sqrt(2)*{D})"
    pde = {
        "kind": "formula",
        "unknowns": ["u"],
        "diffusivity": {"u": str(D)},
        "source": {"u": f"u*(1 - u)*(u - 0.25)/{D}"},
        "initial": {"u": f"1/(1 + exp({z}))"},
        "boundary": {"u": "no-flux"},
        "exact": {"u": f"1/(1 + exp({z}))"},
    }
    domain = {"lower": [0.0], "upper": [1.0]}
    return ours(cells, {"domain": domain, "time": {"start": 0.0, "end": 1.0}, "pde": pde})


def front_pypde(cells):
    from pde import PDE, CartesianGrid, ScalarField

    grid = CartesianGrid([[0, 1]], cells)
    x = grid.axes_coords[0]
    equation = PDE({"u": f"{D} * laplace(u) + u * (1 - u) * (u - 0.25) / {D}"}, bc={"derivative": 0})
    state = ScalarField(grid, front(x, 0))
    found = equation.solve(state, t_range=1, dt=1e-5, adaptive=True, tracker=None)
    return np.abs(found.data - front(x, 1)).max()


def front_scipy(cells):
    from scipy.integrate import solve_ivp

    h = 1 / cells
    x = (np.arange(cells) + 0.5) * h

    def rate(_, u):
        flux = D * np.diff(u, prepend=u[0], append=u[-1]) / h
        return np.diff(flux) / h + u * (1 - u) * (u - 0.25) / D

    found = solve_ivp(rate, (0, 1), front(x, 0), method="LSODA", lband=1, uband=1, rtol=1e-6, atol=1e-9)
    return np.abs(found.y[:, -1] - front(x, 1)).max()


def known(tool):
    return driftmesh.__version__ if tool == "driftmesh" else version(tool)


ROWS = [
    ("layer", "driftmesh", layer_ours, (20, 40, 80)),
    ("layer", "fipy", layer_fipy, (20, 40, 80)),
    ("layer", "scipy", layer_scipy, (20,)),
    ("front", "driftmesh", front_ours, (40, 80, 160)),
    ("front", "py-pde", front_pypde, (640, 1280)),
    ("front", "scipy", front_scipy, (640, 1280, 2560)),
]

if __name__ == "__main__":
    print(f"{'problem':8} {'tool':16} {'cells':>5} {'l_inf':>8} {'seconds':>8}")
    for problem, tool, solve, sizes in ROWS:
        solve(sizes[0])  # so that nothing is compiled or imported below
        for cells in sizes:
            began = time.perf_counter()
            error = solve(cells)
            seconds = time.perf_counter() - began
            print(f"{problem:8} {tool + ' ' + known(tool):16} {cells:5} {error:8.1e} {seconds:8.3f}", flush=True)
