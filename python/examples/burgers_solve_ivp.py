"""Burgers' equation by SciPy's solve_ivp on a line mesh that driftmesh moves, beside equal cells.

    u_t + (u²/2)_x = ν u_xx,   u = c - a tanh(a (x - s - c t)/(2 ν))

The front is 4 ν/a thick and moves with the velocity c. Each node has the cell between the midpoints beside it. Faces of
cells move with velocities w, so that  (h u)' = F_left - F_right,  F = u²/2 - w u - ν u_x,  for the value u in a cell of
length h. solve_ivp chooses the time steps of this system by itself. The mesh has steps of its own, between which nodes
go straight on, and solve_ivp starts anew at each; equal cells are one call of solve_ivp. Prints the largest error at
the end and how often the rate was computed.
"""

import numpy as np
from driftmesh import Mesh, MeshGenerator
from scipy.integrate import solve_ivp

NU, A, C, START, END = 1e-3, 0.5, 0.5, 0.2, 1.0


def exact(x, t):
    return C - A * np.tanh(A * (x - START - C * t) / (2 * NU))


def rate(u, x, w):
    """How fast the value at each node changes, if the nodes are at x and move with the velocity w."""
    at_faces, moved = 0.5 * (u[1:] + u[:-1]), 0.5 * (w[1:] + w[:-1])
    flux = 0.5 * at_faces**2 - moved * at_faces - NU * np.diff(u) / np.diff(x)
    lengths = 0.5 * (x[2:] - x[:-2])
    change = -(np.diff(flux) + u[1:-1] * np.diff(moved)) / lengths  # (h u)' = h u' + h' u
    return np.pad(change, 1)  # the front stays away from the ends, whose values are kept


def run(cells, steps):
    """Largest error at the end, and the number of rates computed; equal cells where the mesh does no steps."""
    mesh, generator, dt, rates = Mesh.uniform(cells=cells), MeshGenerator(threads=1), END / max(steps, 1), 0
    if steps:
        mesh = generator.adapt(mesh, lambda x: exact(x, 0))
    u = exact(mesh.x, 0)
    for _ in range(max(steps, 1)):
        new = generator.step(mesh, u, dt) if steps else mesh
        x, w = mesh.x, new.velocity(mesh, dt)[0]
        done = solve_ivp(
            lambda t, u, x=x, w=w: rate(u, x + t * w, w),
            (0, dt),
            u,
            method="LSODA",
            **{"lband": 1, "uband": 1, "rtol": 1e-6, "atol": 1e-8},  # the Jacobian has three diagonals
        )
        u, rates, mesh = done.y[:, -1], rates + done.nfev, new
    return np.abs(u - exact(mesh.x, END)).max(), rates


if __name__ == "__main__":
    for cells, steps in [(40, 200), (80, 200), (40, 0), (320, 0), (640, 0), (1280, 0), (2560, 0)]:
        error, rates = run(cells, steps)
        print(f"{cells:5} cells {'moving ' if steps else 'uniform'}  largest error {error:.1e}  {rates:6} rates")
