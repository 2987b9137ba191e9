"""Nine-point stencils a second, on one core: the slides' numpy method as written and with vectorised polynomials,
`treverhines-rbf` where it is installed (pip install treverhines-rbf), and ours (cargo bench --bench stencils).

    python benches/stencils.py
"""

import os

for name in ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS"]:
    os.environ[name] = "1"

import subprocess
import time
from pathlib import Path

import numpy as np


def mesh(n):
    s, r = np.meshgrid(np.linspace(0, 1, n + 2), np.linspace(0, 1, n + 2), indexing="ij")
    return s + 0.05 * np.sin(6 * r) * s * (1 - s), r + 0.05 * np.sin(5 * s) * r * (1 - r)


def neighbours(x, y):
    """Coordinates of the eight neighbours relative to each node, shape (nodes, 16)."""
    n = x.shape[0] - 1
    steps = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
    part = lambda a, i, j: (a[1 + i : n + i, 1 + j : n + j] - a[1:n, 1:n]).ravel()
    return np.stack([part(a, i, j) for a in (x, y) for i, j in steps], axis=1)


POLYNOMIALS = [
    lambda x, y: 100 * x,
    lambda x, y: 100 * y,
    lambda x, y: 10 * x * y,
    lambda x, y: 10 * x**2,
    lambda x, y: 10 * (x**2 - y**2),
    lambda x, y: x**3 - 3 * x * y**2,
    lambda x, y: y**3 - 3 * x**2 * y,
    lambda x, y: x**3 * y - x * y**3,
    lambda x, y: x**4 - 6 * x**2 * y**2 + y**4,
    lambda x, y: 5 * x**4 * y - 10 * x**2 * y**3 + y**5,
    lambda x, y: x**5 - 10 * x**3 * y**2 + 5 * x * y**4,
]
LAPLACIANS = np.array([0, 0, 0, 20, 0, 0, 0, 0, 0, 0, 0], dtype=float)


def as_written(row):
    p = np.array([[f(x, y) for x, y in zip(row[:8], row[8:])] for f in POLYNOMIALS])
    return np.linalg.lstsq(p, LAPLACIANS, rcond=None)[0]


def vectorised(row):
    x, y = row[:8], row[8:]
    return np.linalg.lstsq(np.array([f(x, y) for f in POLYNOMIALS]), LAPLACIANS, rcond=None)[0]


def rate(count, work):
    best = float("inf")
    for _ in range(3):
        start = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - start)
    return count / best


def main():
    rows = neighbours(*mesh(60)) * 60
    print("stencils a second, one core")
    for name, method in [("numpy, as written", as_written), ("numpy, vectorised polynomials", vectorised)]:
        print(f"  {name:<32}{rate(len(rows), lambda: np.apply_along_axis(method, 1, rows)):.3e}")
    try:
        from rbf.pde.fd import weights

        x = np.concatenate([np.zeros((len(rows), 1, 2)), np.stack([rows[:, :8], rows[:, 8:]], axis=2)], axis=1)
        work = lambda: weights(np.zeros((len(rows), 2)), x, [[2, 0], [0, 2]], phi="phs3", order=2)
        print(f"  {'treverhines-rbf, phs3, order 2':<32}{rate(len(rows), work):.3e}")
    except ImportError:
        print("  treverhines-rbf is not installed")
    root = Path(__file__).resolve().parent.parent
    command = ["cargo", "bench", "-p", "driftmesh", "--bench", "stencils"]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True)
    for line in done.stdout.split("\n"):
        if line.strip():
            kind, ours = line.split()
            print(f"  {'ours, ' + kind:<32}{ours}")


if __name__ == "__main__":
    main()
