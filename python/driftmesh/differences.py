"""Derivatives on a mesh as sparse matrices, by differences along the lattice."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ._arrays import Floats
from .errors import MeshFolded
from .mesh import Mesh

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix


def gradient(mesh: Mesh) -> tuple[csr_matrix, ...]:
    """The derivatives by x and y as matrices over the nodes.

    ::

        (∂u/∂x, ∂u/∂y) = A⁻¹ (∂u/∂ξ, ∂u/∂η),   A = (x_ξ  y_ξ)
                                                    (x_η  y_η)

    All derivatives by ξ and η are central differences, on bounded sides one-sided ones through three nodes, across the
    ends of periodic axes with the image of the node there.

    Args:
        mesh: A mesh of any shape, in one or two dimensions.

    Returns:
        (Dx, Dy) in CSR form, on a line (Dx,), each of shape (N, N), N = (nx + 1)·(ny + 1):
        ``(Dx @ u.ravel()).reshape(mesh.shape)`` is ∂u/∂x in u per unit of length. Linear functions are exact on any
        mesh, up to rounding. Others have an error of second order in the size of the cells where the map ξ → x is
        smooth. Closing nodes of periodic axes have the rows of the first nodes, as of :func:`laplacian_stencils`.

    Raises:
        ValueError: ``mesh`` is no mesh.
        driftmesh.errors.MeshFolded: The Jacobian is not positive at a node.

    >>> from driftmesh import Mesh, gradient
    >>> mesh = Mesh.uniform(cells=(4, 4))
    >>> mesh = mesh.moved(mesh.x + 0.1 * mesh.y * (1 - mesh.x) * mesh.x, mesh.y)
    >>> dx, dy = gradient(mesh)
    >>> round(float((dy @ (3 * mesh.x - 2 * mesh.y).ravel())[12]), 12)
    -2.0
    """
    if not isinstance(mesh, Mesh):
        raise ValueError(f"`mesh` is of type {type(mesh).__name__}, but must be a driftmesh.Mesh")
    from scipy.sparse import csr_matrix, diags

    along, metric = _along(mesh), tangents(mesh)
    jacobian = np.linalg.det(metric)
    if not (jacobian > 0).all():
        place = tuple(int(k) for k in np.argwhere(~(jacobian > 0))[0])
        raise MeshFolded(f"the mesh is folded: its Jacobian is {jacobian[place]} at node {place}")
    if mesh.dimensions == 1 and not (np.diff(mesh.x) > 0).all():
        below = int(np.argmin(np.diff(mesh.x) > 0))
        raise MeshFolded(f"the mesh is folded: node {below + 1} is not above node {below}")
    inverse = np.linalg.inv(metric)
    axes = range(mesh.dimensions)
    return tuple(
        csr_matrix(sum(diags(inverse[..., c, a].ravel()) @ along[a] for a in axes)) for c in axes
    )


def divergence(mesh: Mesh) -> csr_matrix:
    """The divergence ∂f/∂x + ∂g/∂y of a vector field (f, g) as one matrix over the nodes, made of :func:`gradient`.

    Args:
        mesh: A mesh of any shape, in one or two dimensions.

    Returns:
        A matrix in CSR form, shape (N, 2 N), on a line (N, N), N = (nx + 1)·(ny + 1):
        ``(divergence(mesh) @ np.ravel([f, g])).reshape(mesh.shape)`` is the divergence, in f per unit of length.
        Linear fields are exact on any mesh; others have an error of second order. The sum over all cells is not the
        flux through the sides, as it would be for finite volumes.

    Raises:
        ValueError: ``mesh`` is no mesh.
        driftmesh.errors.MeshFolded: The Jacobian is not positive at a node.

    >>> import numpy as np
    >>> from driftmesh import Mesh, divergence
    >>> mesh = Mesh.uniform(cells=(4, 4))
    >>> flat = divergence(mesh) @ np.ravel([2 * mesh.x, 3 * mesh.y])
    >>> round(float(flat.min()), 12), round(float(flat.max()), 12)
    (5.0, 5.0)
    """
    from scipy.sparse import csr_matrix, hstack

    return csr_matrix(hstack(gradient(mesh)))


def tangents(mesh: Mesh) -> Floats:
    """∂x_c/∂ξ_a at the nodes, ξ in the unit square, shape (nx + 1, ny + 1, 2, 2) with a before c."""
    along, axes = _along(mesh), range(mesh.dimensions)
    metric = np.empty((*mesh.shape, mesh.dimensions, mesh.dimensions))
    for c in axes:
        # along a periodic axis x goes on by the size of the box at each turn; the rest of x comes back
        turn = mesh.upper[c] - mesh.lower[c] if mesh.periodic[c] else 0.0
        xi = np.linspace(0.0, 1.0, mesh.shape[c]).reshape([-1 if a == c else 1 for a in axes])
        rest = (mesh._nodes[..., c] - turn * xi).ravel()
        for a in axes:
            metric[..., a, c] = (along[a] @ rest).reshape(mesh.shape) + (turn if a == c else 0.0)
    return metric


def _along(mesh: Mesh) -> list[csr_matrix]:
    """∂/∂ξ and ∂/∂η as matrices over the nodes."""
    from scipy.sparse import csr_matrix, kron

    axes = range(mesh.dimensions)
    lines = [_on_axis(n, wraps) for n, wraps in zip(mesh.cells, mesh._periodic, strict=True)]
    if mesh.dimensions == 1:
        return [lines[0][0]]
    # along one axis the difference, along the other the node itself
    return [csr_matrix(kron(lines[0][0 if a == 0 else 1], lines[1][0 if a == 1 else 1])) for a in axes]


def _on_axis(cells: int, wraps: bool) -> tuple[csr_matrix, csr_matrix]:
    """Of an axis: ∂/∂ξ, and the node that each place stands for, where a periodic axis repeats its first node."""
    from scipy.sparse import csr_matrix

    size, nodes = (cells + 1, cells + 1), np.arange(cells + 1)
    own = nodes % cells if wraps else nodes
    first = nodes - 1 if wraps else np.clip(nodes - 1, 0, cells - 2)
    columns: Any = (first[:, None] + [0, 1, 2]) % (cells if wraps else cells + 1)
    weights = np.full(columns.shape, 0.5) * [-1, 0, 1]
    if not wraps:
        weights[0], weights[-1] = [-1.5, 2, -0.5], [0.5, -2, 1.5]
    rows = np.repeat(nodes, 3)
    difference: csr_matrix = csr_matrix((cells * weights.ravel(), (rows, columns.ravel())), shape=size)
    difference.eliminate_zeros()
    return difference, csr_matrix((np.ones(cells + 1), (nodes, own)), shape=size)
