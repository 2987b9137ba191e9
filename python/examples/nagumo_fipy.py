"""Nagumo's front by a study of driftmesh on moving cells, and by FiPy on equal ones until they are as good.

    u_t = D u_xx + u (1 - u) (u - a)/D,   u = 1/(1 + exp((x - s - c t)/(√2 D))),   c = (1 - 2 a)/√2

Nothing flows through the ends of the line. The study has nothing set but the number of cells. FiPy gets the scheme of
Crank and Nicolson, with the reaction extrapolated from two old values (Adams and Bashforth), and as many time steps as
cells; the number of cells is doubled until the error is not larger than that of the study. Prints the largest error at
the end, and the seconds with start and output of each.
"""

import sys
import time
from pathlib import Path

import driftmesh
import numpy as np
from fipy import CellVariable, DiffusionTerm, ExplicitDiffusionTerm, Grid1D, LinearLUSolver, TransientTerm

D, A, START, END = 0.01, 0.25, 0.3, 1.0
C = (1 - 2 * A) / np.sqrt(2)


def exact(x, t):
    return 0.5 * (1 - np.tanh((x - START - C * t) / (2 * np.sqrt(2) * D)))


def reaction(u):
    return u * (1 - u) * (u - A) / D


def moving(cells, out):
    """Largest error of a study at the end."""
    wave = f"0.5*(1 - tanh((x - {START} - {C}*t)/({2 * np.sqrt(2) * D})))"
    study = {
        "study": {"name": "nagumo", "kind": "moving-mesh"},
        "grid": {"cells": [cells]},
        "time": {"start": 0.0, "end": END},
        "pde": {
            "kind": "formula",
            "unknowns": ["u"],
            "diffusivity": {"u": f"{D}"},
            "source": {"u": f"u*(1 - u)*(u - {A})/{D}"},
            "boundary": {"u": "no-flux"},
            "initial": {"u": wave},
            "exact": {"u": wave},
        },
        "output": {"report": False},
    }
    return driftmesh.run(study, out=out, threads=1).summary["reports"][-1]["error"]["linf"]


def equal(cells):
    """Largest error of FiPy at the end."""
    mesh = Grid1D(nx=cells, dx=1 / cells)
    x = mesh.cellCenters.value[0]
    u = CellVariable(mesh=mesh, value=exact(x, 0))
    source = CellVariable(mesh=mesh)
    equation = TransientTerm() == DiffusionTerm(D / 2) + ExplicitDiffusionTerm(D / 2) + source
    before = reaction(exact(x, -END / cells))
    for _ in range(cells):
        now = reaction(u.value)
        source.setValue(1.5 * now - 0.5 * before)
        equation.solve(var=u, dt=END / cells, solver=LinearLUSolver())
        before = now
    return np.abs(u.value - exact(x, END)).max()


if __name__ == "__main__":
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out/nagumo")
    for mine in (40, 80):
        began = time.perf_counter()
        wanted = moving(mine, out)
        print(f"driftmesh {mine:5} cells  largest error {wanted:.1e}  {time.perf_counter() - began:7.2f} s")
        cells, error = mine, np.inf
        while error > wanted:
            cells, began = 2 * cells, time.perf_counter()
            error = equal(cells)
            print(f"FiPy      {cells:5} cells  largest error {error:.1e}  {time.perf_counter() - began:7.2f} s")
