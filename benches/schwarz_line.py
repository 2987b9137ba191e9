"""The boundary layer u = (1 - e^20x)/(1 - e^20): seconds to a mesh x(ξ) of equal arc length with a given largest error,
by SciPy's solve_bvp and by ours (cargo bench --bench schwarz_line -- layer CELLS). Ours is also run on a million cells.

    python benches/schwarz_line.py
"""

import subprocess
import time
from pathlib import Path

import numpy as np
from scipy.integrate import quad, solve_bvp
from scipy.optimize import brentq

ROOT = Path(__file__).parents[1]


def density(x):
    return np.sqrt(1 + (20 * np.exp(20 * x) / (1 - np.exp(20.0))) ** 2)


def exact(xi):
    """x(ξ) from the integral form, by quadrature."""
    length = lambda x: quad(density, 0, x, epsabs=1e-13, epsrel=1e-13, limit=200)[0]
    whole = length(1.0)
    return np.array([brentq(lambda x: length(x) - s * whole, 0, 1, xtol=1e-13) for s in xi])


XI = np.linspace(0, 1, 101)
EXACT = exact(XI)


def scipy(tolerance):
    """M(x) x' = c with c unknown: seconds and the largest error at 101 places."""
    guess = np.linspace(0, 1, 11)
    system = lambda s, y: np.vstack([y[1] / density(y[0]), np.zeros_like(s)])
    ends = lambda a, b: np.array([a[0], b[0] - 1])
    best = np.inf
    for _ in range(5):
        clock = time.perf_counter()
        found = solve_bvp(system, ends, guess, np.vstack([guess, np.full(11, 1.8)]), tol=tolerance, max_nodes=100000)
        best = min(best, time.perf_counter() - clock)
    return best, np.abs(found.sol(XI)[0] - EXACT).max() if found.success else np.inf, found.x.size


def ours(cells):
    command = ["cargo", "bench", "--quiet", "-p", "driftmesh", "--bench", "schwarz_line", "--", "layer", str(cells)]
    seconds, error = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split()[-2:]
    return float(seconds), float(error)


for cells in [40, 160, 640]:
    seconds, error = ours(cells)
    for tolerance in 10.0 ** -np.arange(1, 13):
        theirs, their_error, nodes = scipy(tolerance)
        if their_error <= error:
            break
    print(
        f"{cells} cells: error {error:.1e} in {1e3 * seconds:.3f} ms; "
        f"solve_bvp, tol {tolerance:.0e}, {nodes} nodes: {their_error:.1e} in {1e3 * theirs:.2f} ms, "
        f"{theirs / seconds:.0f} times"
    )

subprocess.run(["cargo", "bench", "--quiet", "-p", "driftmesh", "--bench", "schwarz_line"], cwd=ROOT, check=True)
