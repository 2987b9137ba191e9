"""Allen and Cahn's equation in scikit-fem on a mesh that driftmesh moves, beside uniform meshes.

    u_t = ε Δu + u (1 - u) (u - a)/ε,   u = 1/(1 + exp((n·x - c t - s)/(√2 ε))),   c = (1 - 2a)/√2

The front is √2 ε thick and goes obliquely through the unit square. Elements are bilinear, steps are of second order
(BDF2, linearised once). Nodal values move along with their nodes, which adds the convection -w·∇u by the velocity w of
the mesh, differenced in time as u is. Prints the error at the end (l2) and the seconds of one core.
"""

import time

import numpy as np
from driftmesh import Mesh, MeshGenerator
from skfem import Basis, BilinearForm, ElementQuad1, LinearForm, MeshQuad, condense, solve
from skfem.helpers import dot, grad

EPS, A, ANGLE, START, END = 0.01, 0.25, 0.4, 0.35, 0.8
C = (1 - 2 * A) / np.sqrt(2)


def exact(x, y, t):
    z = x * np.cos(ANGLE) + y * np.sin(ANGLE) - C * t - START
    return 0.5 * (1 - np.tanh(z / (2 * np.sqrt(2) * EPS)))


def slope(u):
    """Derivative of the reaction u (1 - u) (u - a)/ε."""
    return (-3 * u**2 + 2 * (1 + A) * u - A) / EPS


@BilinearForm
def implicit(u, v, p):
    carried = p.wx * grad(u)[0] + p.wy * grad(u)[1]
    return 1.5 * u * v + p.dt * (EPS * dot(grad(u), grad(v)) - carried * v - slope(p.guess) * u * v)


@LinearForm
def explicit(v, p):
    reaction = p.guess * (1 - p.guess) * (p.guess - A) / EPS
    return p.old * v + p.dt * (reaction - slope(p.guess) * p.guess) * v


def run(cells, moving, steps):
    """Error (l2) at the end, and seconds of one core."""
    began = time.process_time()
    mesh, dt = Mesh.uniform(cells=(cells, cells)), END / steps
    generator = MeshGenerator(threads=1)
    if moving:
        mesh = generator.adapt(mesh, lambda x, y: exact(x, y, 0))
    node = np.arange(mesh.x.size).reshape(mesh.shape)
    corners = np.stack([node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]]).reshape(4, -1)
    sides = np.unique(np.concatenate([node[0], node[-1], node[:, 0], node[:, -1]]))
    last, u, before = mesh, exact(mesh.x, mesh.y, 0), exact(mesh.x, mesh.y, -dt)
    for step in range(1, steps + 1):
        new = generator.step(mesh, u, dt) if moving else mesh
        basis = Basis(MeshQuad(np.stack([new.x.ravel(), new.y.ravel()]), corners), ElementQuad1())
        wx, wy = [(1.5 * n - 2 * m + 0.5 * b) / dt for n, m, b in [(new.x, mesh.x, last.x), (new.y, mesh.y, last.y)]]
        fields = {"old": 2 * u - 0.5 * before, "guess": 2 * u - before, "wx": wx, "wy": wy}
        parts = {name: basis.interpolate(values.ravel()) for name, values in fields.items()}
        x = exact(new.x, new.y, step * dt).ravel()  # on the sides
        matrix, right = (form.assemble(basis, dt=dt, **parts) for form in (implicit, explicit))
        before, u = u, solve(*condense(matrix, right, x=x, D=sides)).reshape(mesh.shape)
        last, mesh = mesh, new
    error = u - exact(mesh.x, mesh.y, END)
    return np.sqrt((mesh.areas * error**2).sum()), time.process_time() - began


if __name__ == "__main__":
    for cells, moving in [(40, True), (40, False), (80, False), (160, False)]:
        error, seconds = run(cells, moving, steps=100)
        print(f"{cells:4}² {'moving ' if moving else 'uniform'}  l2 {error:.2e}  {seconds:6.1f} s")
