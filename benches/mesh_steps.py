"""100 mesh steps of 113² nodes: a NumPy loop with gen.step beside the same loop in Rust, in turns; and the import."""

import subprocess
import sys
import time
from pathlib import Path

import numpy as np

import driftmesh

root = Path(__file__).resolve().parent.parent


def in_rust():
    command = ["cargo", "bench", "--quiet", "-p", "driftmesh", "--bench", "mesh_steps"]
    out = subprocess.run(command, cwd=root, check=True, capture_output=True, text=True).stdout.split()
    return float(out[0]), float(out[1])


def in_python():
    best = np.inf
    for _ in range(3):
        start = time.perf_counter()
        mesh = driftmesh.Mesh.uniform(cells=(112, 112))
        generator = driftmesh.MeshGenerator(monitor=driftmesh.Arclength(relative=30, smoothing=2), relaxation=0.1)
        for step in range(100):
            u = np.tanh(40 * (mesh.x + mesh.y - 0.8 - 1e-3 * step))
            mesh = generator.step(mesh, u, 1e-3)
        best = min(best, time.perf_counter() - start)
    return best, mesh.x[40, 56]


runs = [(in_rust(), in_python()) for _ in range(4)]
rust, python = (min(run[k][0] for run in runs) for k in (0, 1))
off = abs(runs[0][0][1] - runs[0][1][1])
print(
    f"100 steps of 113²: Rust {rust:.3f} s, Python {python:.3f} s, ratio {python / rust:.2f}; "
    f"the meshes differ by {off:.1e}"
)

code = (
    "import time; t = time.perf_counter(); import driftmesh, sys; "
    "print(time.perf_counter() - t, 'matplotlib' in sys.modules)"
)
imports = [
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.split()
    for _ in range(7)
]
seconds = sorted(float(seconds) for seconds, _ in imports)
print(f"import driftmesh: {seconds[0]:.3f} s (middle of seven {seconds[3]:.3f}), matplotlib with it: {imports[0][1]}")
