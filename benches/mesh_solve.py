"""The two mesh solves of one step at 113²: driftmesh beside scipy's splu and two solves, on the same system."""

import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import scipy.sparse
from scipy.sparse.linalg import splu

root = Path(__file__).resolve().parent.parent
with tempfile.TemporaryDirectory() as directory:
    file = Path(directory) / "system.npz"
    subprocess.run(
        ["cargo", "bench", "--quiet", "-p", "driftmesh", "--bench", "mesh_solve", "--", file], cwd=root, check=True
    )
    system = dict(np.load(file))

rows, b, known, ours = (system[key] for key in ("rows", "b", "known", "x"))
n = int(round(np.sqrt(len(rows))))  # unknowns an axis; padded vectors have n + 2
index = np.arange((n + 2) ** 2).reshape(n + 2, n + 2)
centre = index[1:-1, 1:-1].ravel()
points = [0, -(n + 2), n + 2, -1, 1]  # the node, its neighbours along ξ, along η
columns = centre[:, None] + np.array(points)
full = scipy.sparse.coo_matrix(
    (rows.ravel(), (np.repeat(np.arange(n * n), 5), columns.ravel())), shape=(n * n, (n + 2) ** 2)
).tocsc()
ring = np.setdiff1d(index.ravel(), centre)
matrix = full[:, centre].tocsc()
right = b - full[:, ring] @ known[ring]

best = np.inf
for _ in range(20):
    start = time.perf_counter()
    lu = splu(matrix)
    x = np.column_stack([lu.solve(right[:, 0]), lu.solve(right[:, 1])])
    best = min(best, time.perf_counter() - start)
ms = float(system["ms"][0])
print(f"113²: driftmesh {ms:.2f} ms, scipy splu + 2 solves {1e3 * best:.2f} ms, ratio {1e3 * best / ms:.1f}")
print(f"largest difference of the solutions {np.abs(x - ours[centre]).max():.1e}")
