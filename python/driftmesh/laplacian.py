"""The discrete Laplacian of a mesh as a sparse matrix."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, get_args, overload

from numpy.typing import ArrayLike

from . import _driftmesh
from ._arrays import finite, word
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
        source: Returns B besides, with A u = B Δu; ``"compact25"`` needs it, B is the identity inside for the others.
        periodic: Which axes wrap around, their last nodes being the first ones further on; not for ``"compact25"``.
        polynomials: Of ``"published"``: as ``"printed"``, or ``"harmonic"``.
        scaling: Of ``"published"``: unit of length of the polynomials.

    Returns:
        A in CSR form, shape (n·m, n·m): ``(A @ u.ravel()).reshape(n, m)`` is Δu inside, in u per square of the unit of
        length. Rows of nodes on bounded sides are empty; closing nodes of periodic axes have the rows of the first nodes.

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
    import numpy as np
    from scipy.sparse import csr_matrix

    kind = word("kind", kind, [name for name in get_args(Kind) if name != "optimized"])  # type: ignore[assignment]
    first = finite("x", x)
    if first.ndim != 2 or min(first.shape) < 3:
        raise ValueError(f"`x` has shape {first.shape}, but must have two axes of 3 nodes or more")
    second = finite("y", y, first.shape, "`x`")
    for name, values in (("x", first), ("y", second)):
        if not 1e-100 < np.ptp(values) < 1e100:
            raise ValueError(f"`{name}` extends over {np.ptp(values)}, which cannot be squared or told from 0; scale the mesh")
    if kind == "compact25" and not source:
        raise ValueError("compact25 has weights on Δu too: with source=True there are two matrices, A u = B Δu")
    mesh = Mesh(first, second, periodic=periodic)
    rows, columns, on_u, on_source, near = _driftmesh.stencils(mesh._given(), kind, polynomials, scaling)
    if near:
        node, condition = near[0]
        warnings.warn(
            f"the nodes around {len(near)} nodes hardly determine a Laplacian, the first of them {tuple(node)} "
            f"with condition number {condition:.1e}; make the cells there less flat",
            RuntimeWarning,
            stacklevel=2,
        )
    # the node of each place: closing nodes of periodic axes are the first ones
    i, j = (np.arange(n + 1) % (n if wraps else n + 1) for n, wraps in zip(mesh.cells, mesh.periodic, strict=True))
    nodes = i.max() + 1, j.max() + 1
    own = (i[:, None] * nodes[1] + j).ravel()
    # and the first place of each node
    place = np.arange(first.size).reshape(first.shape)[: nodes[0], : nodes[1]].ravel()

    def matrix(kept: Any, values: Any) -> csr_matrix:
        open_rows = csr_matrix((values, (rows[kept], place[columns[kept]])), shape=(len(place), first.size))
        return open_rows[own] if any(mesh.periodic) else open_rows

    a = matrix(slice(None), on_u)
    if not source:
        return a
    kept = np.flatnonzero(on_source)
    return a, matrix(kept, on_source[kept])
