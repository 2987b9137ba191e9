"""The discrete Laplacian of a mesh, and Poisson's equation on it, as sparse matrices."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, get_args, overload

import numpy as np
from numpy.typing import ArrayLike

from . import _driftmesh
from ._arrays import Floats, finite, real, word
from .mesh import Mesh
from .poisson import Poisson, Side, at_nodes, on_nodes, points, sides_of

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

Kind = Literal["optimised", "optimized", "harmonic", "published", "compact25", "mapped"]
Polynomials = Literal["printed", "harmonic"]
Scaling = Literal["none", "global", "local"]
#: A kind, with the polynomials and the scaling of "published".
Named: TypeAlias = "tuple[str, str | None, str | None]"


@overload
def laplacian_stencils(
    x: Mesh,
    *,
    conditions: Any,
    diffusivity: Any = ...,
    kind: Kind | None = ...,
    polynomials: Polynomials | None = ...,
    scaling: Scaling | None = ...,
) -> Poisson: ...
@overload
def laplacian_stencils(
    x: ArrayLike | Mesh,
    y: ArrayLike | None = ...,
    kind: Kind | None = ...,
    *,
    diffusivity: Any = ...,
    source: Literal[False] = ...,
    periodic: Sequence[bool] | None = ...,
    polynomials: Polynomials | None = ...,
    scaling: Scaling | None = ...,
) -> csr_matrix: ...
@overload
def laplacian_stencils(
    x: ArrayLike | Mesh,
    y: ArrayLike | None = ...,
    kind: Kind | None = ...,
    *,
    diffusivity: Any = ...,
    source: Literal[True],
    periodic: Sequence[bool] | None = ...,
    polynomials: Polynomials | None = ...,
    scaling: Scaling | None = ...,
) -> tuple[csr_matrix, csr_matrix]: ...
@overload
def laplacian_stencils(
    x: ArrayLike | Mesh,
    y: ArrayLike | None = ...,
    kind: Kind | None = ...,
    *,
    diffusivity: Any = ...,
    source: bool,
    periodic: Sequence[bool] | None = ...,
    polynomials: Polynomials | None = ...,
    scaling: Scaling | None = ...,
) -> csr_matrix | tuple[csr_matrix, csr_matrix]: ...
def laplacian_stencils(
    x: ArrayLike | Mesh,
    y: ArrayLike | None = None,
    kind: Kind | None = None,
    *,
    conditions: Any = None,
    diffusivity: Any = None,
    source: bool = False,
    periodic: Sequence[bool] | None = None,
    polynomials: Polynomials | None = None,
    scaling: Scaling | None = None,
) -> csr_matrix | tuple[csr_matrix, csr_matrix] | Poisson:
    """Weights of Δ or ∇·(D ∇) on any structured mesh, node by node from the positions of the neighbours.

    Args:
        x: A :class:`driftmesh.Mesh`, which knows its periodic and closed axes; or positions of the nodes, shape (n, m),
            at least 3 each.
        y: The same, with positions.
        kind: ``"optimised"`` (exact for quadratics, the smallest such weights), ``"harmonic"``, ``"published"``,
            ``"compact25"`` (fourth order, weights on Δu too) or ``"mapped"`` (conservative); see
            ``driftmesh list laplacians``. ``"optimised"`` where nothing is said, ``"mapped"`` with a diffusivity. On a
            line all are the same three points.
        conditions: What holds on the sides of a mesh, for all of them or a dict by ``"left"``, ``"right"`` (the ends of
            the first axis), ``"bottom"`` and ``"top"``: a value of u; ``"no-flux"``; or ``{"flux": q}``, what flows
            into the domain, D n·∇u with n outward. A value is a number, an array along the side or of the shape of the
            mesh, or a function of x and y; q may be the same, but as a function it is one of x, y and u, linear in u.
        diffusivity: D > 0: a number, an array at the nodes, or a function of x and y; 1 where nothing is said. A
            neighbour counts with the inverse of the mean of 1/D along the edge to it, where each value of an array
            holds for half of the edge: jumps half way between nodes are met.
        source: Returns B besides A, with A u = B Δu. ``"compact25"`` needs it; for the others B is the identity at
            inner nodes.
        periodic: With positions, which axes wrap around, their last nodes being the first ones shifted by the box; not
            for ``"compact25"``.
        polynomials: For ``"published"``: the test polynomials, ``"printed"`` as in the source or ``"harmonic"``.
        scaling: For ``"published"``: the unit of length of these polynomials, ``"none"`` (that of the coordinates),
            ``"global"`` or ``"local"``.

    Returns:
        A in CSR form, shape (n·m, n·m): ``(A @ u.ravel()).reshape(n, m)`` is Δu inside, in u per square of the unit of
        length. Rows of nodes on bounded sides are empty; closing nodes of periodic axes have the rows of the first
        nodes. With ``conditions`` the whole system, :class:`driftmesh.Poisson`, which a study of kind ``poisson``
        solves, too.

    Raises:
        ValueError: Wrong shapes or values, no such kind, no such side, one that is left out.
        driftmesh.errors.MeshFolded: A cell is folded.
        driftmesh.errors.DegenerateStencil: The neighbours of a node determine no Laplacian. Where they hardly do, a
            :class:`RuntimeWarning` names the first such node.

    >>> from driftmesh import Mesh, laplacian_stencils
    >>> mesh = Mesh.uniform(cells=(4, 4))
    >>> laplacian = laplacian_stencils(mesh.x, mesh.y)
    >>> round(float((laplacian @ (mesh.x**2 + mesh.y**2).ravel())[12]), 9)
    4.0
    >>> u = laplacian_stencils(mesh, conditions=lambda x, y: x * y).solve(0)
    >>> round(float(u[2, 3]), 9)  # ½ · ¾
    0.375
    """
    if kind is None:
        kind = "optimised" if diffusivity is None else "mapped"
    kind = word("kind", kind, [name for name in get_args(Kind) if name != "optimized"])  # type: ignore[assignment]
    if kind == "compact25" and not source and conditions is None:
        raise ValueError("compact25 has weights on Δu too: with source=True there are two matrices, A u = B Δu")
    if kind == "compact25" and diffusivity is not None:
        raise ValueError('`kind` is "compact25", which takes no diffusivity; take "mapped" or another kind')
    if conditions is not None and (source or not isinstance(x, Mesh)):
        raise ValueError(
            "`conditions` give a system with its source, on a mesh: laplacian_stencils(Mesh(x, y), conditions=…)"
        )
    mesh = _mesh(x, y, periodic)
    sides = None if conditions is None else sides_of(mesh, conditions)
    *entries, near = _entries(mesh, (kind, polynomials, scaling), diffusivity, sides)
    if near:
        _warn(near)
    a, b = _matrices(mesh, *entries)
    if sides is not None:
        return _system(mesh, a, b, sides)
    return (a, b) if source else a


def _mesh(x: ArrayLike | Mesh, y: ArrayLike | None, periodic: Sequence[bool] | None) -> Mesh:
    """The mesh that is given, or that of positions."""
    if not isinstance(x, Mesh):
        if y is None:
            raise ValueError(f"`x` is of type {type(x).__name__}; give a driftmesh.Mesh, or positions x and y")
        return Mesh(*_positions(x, y), periodic=(False, False) if periodic is None else periodic)
    if y is not None or periodic is not None:
        name = "periodic" if y is None else "y"
        raise ValueError(f"`{name}` is given beside a mesh, which knows it; leave it out")
    return x


def _entries(mesh: Mesh, named: Named, diffusivity: Any, sides: list[Side] | None) -> Any:
    """Rows, columns and weights on u and on f, between nodes without the closing ones of periodic axes, of the rows
    inside or of all; then the nodes that are nearly degenerate."""
    if mesh.dimensions == 1:
        return _of_line(mesh, diffusivity, sides)
    told = None
    if sides is not None:
        _, c, fluxes = on_nodes(mesh, sides)
        told = c, fluxes
    return _driftmesh.poisson(mesh._given(), named, _weights(mesh, named, diffusivity), told)


def _weights(mesh: Mesh, named: Named, diffusivity: Any) -> tuple[Floats, Floats | None] | None:
    """D at the nodes, and along all edges where it is a function."""
    if diffusivity is None:
        return None
    nodes = at_nodes("diffusivity", diffusivity, mesh)
    if not (nodes > 0).all():
        place = tuple(int(k) for k in np.argwhere(~(nodes > 0))[0])
        raise ValueError(f"`diffusivity` is {nodes[place]} at index {place}, but must be above 0")
    if not callable(diffusivity):
        return nodes, None
    x, y = points(mesh, _driftmesh.edges(mesh._given(), named))
    along = real("diffusivity", diffusivity(x, y))
    along = np.full(x.shape, along) if along.ndim == 0 else along
    if along.shape != x.shape:
        raise ValueError(f"`diffusivity` returns shape {along.shape} for arrays of shape {x.shape}")
    good = (along > 0) & np.isfinite(along)
    if not good.all():
        k = tuple(np.argwhere(~good)[0])
        raise ValueError(f"`diffusivity` is {along[k]} at ({x[k]}, {y[k]}), but must be above 0 and finite")
    return nodes, along


def _of_line(line: Mesh, diffusivity: Any, sides: list[Side] | None) -> Any:
    """The entries of a line: those of a strip around it, of functions that do not change across the strip."""
    width = np.linspace(0, 3 * np.diff(line.x).mean(), 4)
    strip = Mesh(*np.meshgrid(line.x, width, indexing="ij"), periodic=(line._periodic[0], True))

    def across(values: Any) -> Floats:
        return np.repeat(values[..., None], width.size, axis=-1)

    if callable(diffusivity):
        along = diffusivity
        diffusivity = lambda x, y: along(x)  # noqa: E731
    elif diffusivity is not None:
        diffusivity = across(at_nodes("diffusivity", diffusivity, line))
    if sides is not None:
        sides = [Side(s.axis, s.end, across(s.g), None if s.c is None else across(s.c)) for s in sides]
    rows, columns, on_u, on_source, near = _entries(strip, ("mapped", None, None), diffusivity, sides)
    kept = rows % 3 == 0
    return rows[kept] // 3, columns[kept] // 3, on_u[kept], on_source[kept], near


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


def _matrices(mesh: Mesh, rows: Any, columns: Any, on_u: Any, on_source: Any) -> tuple[csr_matrix, csr_matrix]:
    """A and B over all places of an array from entries between nodes, of which a periodic axis has one less."""
    from scipy.sparse import csr_matrix

    place, first = _places(mesh)
    kept = np.flatnonzero(on_source)
    size = (first.size, first.size)
    a = csr_matrix((on_u, (place[rows], place[columns])), shape=size)
    b = csr_matrix((on_source[kept], (place[rows[kept]], place[columns[kept]])), shape=size)
    return (a[first], b[first]) if any(mesh._periodic) else (a, b)


def _places(mesh: Mesh) -> tuple[Any, Any]:
    """The first place of each node, and that of the node at each place, in an array over the mesh."""
    lines = [np.arange(n + 1) % (n if wraps else n + 1) for n, wraps in zip(mesh.cells, mesh._periodic, strict=True)]
    places = np.arange(np.prod(mesh.shape)).reshape(mesh.shape)
    first = places[np.ix_(*lines)].ravel()
    return np.unique(first), first


def _system(mesh: Mesh, a: csr_matrix, b: csr_matrix, sides: list[Side]) -> Poisson:
    """The equations of all nodes, from the rows of the first ones."""
    from scipy.sparse import csr_matrix, diags

    g, c, _ = on_nodes(mesh, sides)
    places, first = np.arange(g.size), _places(mesh)[1]
    own = (first == places).astype(float)
    closing = np.flatnonzero(first != places)
    same = csr_matrix((np.ones(closing.size), (closing, first[closing])), shape=a.shape)
    matrix = csr_matrix(diags(own) @ a + diags(1 - own) - same)
    source = csr_matrix(diags(own) @ b)
    source.eliminate_zeros()
    plane = mesh.dimensions == 2
    areas = own * (_driftmesh.quarters(mesh._given()) if plane else mesh.areas).ravel()
    is_free = all(side.c is not None for side in sides) and not c.any()
    return Poisson(mesh, matrix, source, own * g.ravel(), is_free, sides, areas)
