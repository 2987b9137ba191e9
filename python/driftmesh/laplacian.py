"""The discrete Laplacian of a mesh as a sparse matrix."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, get_args, overload

import numpy as np
from numpy.typing import ArrayLike

from . import _driftmesh
from ._arrays import Floats, finite, word
from .mesh import Mesh

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

Kind = Literal["optimised", "optimized", "harmonic", "published", "compact25", "mapped"]


@overload
def laplacian_stencils(
    x: ArrayLike,
    y: ArrayLike,
    kind: Kind = ...,
    *,
    source: Literal[False] = ...,
    periodic: Sequence[bool] = ...,
    polynomials: Literal["printed", "harmonic"] | None = ...,
    scaling: Literal["none", "global", "local"] | None = ...,
) -> csr_matrix: ...
@overload
def laplacian_stencils(
    x: ArrayLike,
    y: ArrayLike,
    kind: Kind = ...,
    *,
    source: Literal[True],
    periodic: Sequence[bool] = ...,
    polynomials: Literal["printed", "harmonic"] | None = ...,
    scaling: Literal["none", "global", "local"] | None = ...,
) -> tuple[csr_matrix, csr_matrix]: ...
@overload
def laplacian_stencils(
    x: ArrayLike,
    y: ArrayLike,
    kind: Kind = ...,
    *,
    source: bool,
    periodic: Sequence[bool] = ...,
    polynomials: Literal["printed", "harmonic"] | None = ...,
    scaling: Literal["none", "global", "local"] | None = ...,
) -> csr_matrix | tuple[csr_matrix, csr_matrix]: ...
def laplacian_stencils(
    x: ArrayLike,
    y: ArrayLike,
    kind: Kind = "optimised",
    *,
    source: bool = False,
    periodic: Sequence[bool] = (False, False),
    polynomials: Literal["printed", "harmonic"] | None = None,
    scaling: Literal["none", "global", "local"] | None = None,
) -> csr_matrix | tuple[csr_matrix, csr_matrix]:
    """Weights of Δ on any structured mesh, node by node from the positions of the neighbours.

    Args:
        x: Positions of the nodes, shape (n, m), at least 3 each.
        y: The same.
        kind: ``"optimised"`` (exact for quadratics, the smallest such weights), ``"harmonic"``, ``"published"``,
            ``"compact25"`` (fourth order, weights on Δu too) or ``"mapped"``; see ``driftmesh list laplacians``.
        source: Returns B besides A, with A u = B Δu. ``"compact25"`` needs it; for the others B is the identity at
            inner nodes.
        periodic: Which axes wrap around, their last nodes being the first ones shifted by the box; not for
            ``"compact25"``.
        polynomials: For ``"published"``: the test polynomials, ``"printed"`` as in the source or ``"harmonic"``.
        scaling: For ``"published"``: the unit of length of these polynomials, ``"none"`` (that of the coordinates),
            ``"global"`` or ``"local"``.

    Returns:
        A in CSR form, shape (n·m, n·m): ``(A @ u.ravel()).reshape(n, m)`` is Δu inside, in u per square of the unit of
        length. Rows of nodes on bounded sides are empty; closing nodes of periodic axes have the rows of the first
        nodes.

    Raises:
        ValueError: Wrong shapes or values, no such kind.
        driftmesh.errors.MeshFolded: A cell is folded.
        driftmesh.errors.DegenerateStencil: The neighbours of a node determine no Laplacian. Where they hardly do, a
            :class:`RuntimeWarning` names the first such node.

    >>> from driftmesh import Mesh, laplacian_stencils
    >>> mesh = Mesh.uniform(cells=(4, 4))
    >>> laplacian = laplacian_stencils(mesh.x, mesh.y)
    >>> round(float((laplacian @ (mesh.x**2 + mesh.y**2).ravel())[12]), 9)
    4.0
    """
    kind = word("kind", kind, [name for name in get_args(Kind) if name != "optimized"])  # type: ignore[assignment]
    if kind == "compact25" and not source:
        raise ValueError("compact25 has weights on Δu too: with source=True there are two matrices, A u = B Δu")
    mesh = Mesh(*_positions(x, y), periodic=periodic)
    rows, columns, on_u, on_source, near = _driftmesh.stencils(mesh._given(), kind, polynomials, scaling)
    if near:
        _warn(near)
    a = _matrix(mesh, rows, columns, on_u)
    if not source:
        return a
    kept = np.flatnonzero(on_source)
    return a, _matrix(mesh, rows[kept], columns[kept], on_source[kept])


def _positions(x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
    """Positions of the nodes, whose extent can be squared."""
    first = finite("x", x)
    if first.ndim != 2 or min(first.shape) < 3:
        raise ValueError(f"`x` has shape {first.shape}, but must have two axes of 3 nodes or more")
    second = finite("y", y, first.shape, "`x`")
    for name, values in (("x", first), ("y", second)):
        if not 1e-100 < np.ptp(values) < 1e100:
            raise ValueError(
                f"`{name}` extends over {np.ptp(values)}, which cannot be squared or told from 0; scale the mesh"
            )
    return first, second


def _warn(near: list[tuple[tuple[int, int], float]]) -> None:
    """Warns the caller of :func:`laplacian_stencils` of nodes whose neighbours hardly determine a Laplacian."""
    node, condition = near[0]
    warnings.warn(
        f"the nodes around {len(near)} nodes hardly determine a Laplacian, the first of them {tuple(node)} "
        f"with condition number {condition:.1e}; make the cells there less flat",
        RuntimeWarning,
        stacklevel=3,
    )


def _matrix(mesh: Mesh, rows: Any, columns: Any, values: Any) -> csr_matrix:
    """A matrix over all places of an array from entries between nodes, of which a periodic axis has one less."""
    from scipy.sparse import csr_matrix

    # the node of each place: closing nodes of periodic axes are the first ones
    i, j = (np.arange(n + 1) % (n if wraps else n + 1) for n, wraps in zip(mesh.cells, mesh._periodic, strict=True))
    nodes = i.max() + 1, j.max() + 1
    own = (i[:, None] * nodes[1] + j).ravel()
    # and the first place of each node
    size = mesh.shape[0] * mesh.shape[1]
    place = np.arange(size).reshape(mesh.shape)[: nodes[0], : nodes[1]].ravel()
    open_rows = csr_matrix((values, (rows, place[columns])), shape=(len(place), size))
    return open_rows[own] if any(mesh._periodic) else open_rows
