"""A sweep over viscosities and cells on all cores: one process and one thread a run, each into a directory of its own.

Prints the largest error of Burgers' front at the end, on moving cells and on equal ones.
"""

import itertools
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import driftmesh


def error(case, out):
    """The largest error at the end of a run."""
    viscosity, cells, generator = case
    study = {
        "study": {"name": "sweep", "kind": "moving-mesh"},
        "grid": {"cells": [cells, cells]},
        "time": {"start": 0.25, "end": 0.75},
        "pde": {"kind": "burgers", "viscosity": viscosity},
        "mesh": {"generator": {"kind": generator}},
        "output": {"report": False},
    }
    name = f"{generator}-{cells}-{viscosity}"
    return driftmesh.run(study, out=Path(out) / name, threads=1).summary["reports"][-1]["error"]["linf"]


def sweep(viscosities, cells, out, processes=None):
    """Errors by case: (viscosity, cells, generator)."""
    cases = list(itertools.product(viscosities, cells, ["whole", "fixed"]))
    # a process that starts afresh has no threads of this one, which a fork would have lost
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        return dict(zip(cases, pool.map(error, cases, itertools.repeat(out)), strict=True))


if __name__ == "__main__":
    errors = sweep([0.02, 0.01, 0.005], [20, 40], sys.argv[1] if len(sys.argv) > 1 else "out/sweep", processes=8)
    for (viscosity, cells, generator), found in errors.items():
        print(f"ν = {viscosity:<6} {cells}² {generator:6} {found:.2e}")
