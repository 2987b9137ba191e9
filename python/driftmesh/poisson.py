"""∇·(D ∇u) = f with conditions on the sides of a mesh, as sparse matrices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ._arrays import Floats, finite, real
from ._boxes import images
from .errors import LinearStalled
from .mesh import Mesh

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

#: Names of the sides at the two ends of each axis.
SIDES = (("left", "right"), ("bottom", "top"))
#: The largest share of what flows that may be missing from a balance.
UNBALANCED = 1e-6
#: A flux is linear in u where its second difference is below this share of its size.
LINEAR = 1e-9
#: Condition number in the 1-norm, rows having been scaled, from which on nothing is left of a solution.
ILL_CONDITIONED = 1e15
_SINGULAR = "the equations are singular: make fluxes fall where u grows, or give u on a side"
CONDITIONS = 'a value, "no-flux" or {"flux": …}'


@dataclass(frozen=True, eq=False)
class Poisson:
    """The equations of ∇·(D ∇u) = f with conditions on the sides, from :func:`laplacian_stencils`

    ::

        A u = B f + g:   ∇·(D ∇u) = f inside,   u = g or D n·∇u − c u = g on the sides,   n outward

    Arrays are in the order of ``mesh.x.ravel()``, N = (nx + 1)·(ny + 1). Closing nodes of periodic axes have the
    equation that they have the value of the first nodes.

    Attributes:
        mesh: The mesh.
        matrix: A in CSR form, shape (N, N). Inside it is ∇·(D ∇u), per square of the unit of length.
        source: B, the same shape. Diagonal, 1 inside and 0 on the sides, but for ``"compact25"``.
        sides: g, shape (N,): the values and fluxes that are given, 0 inside.
        is_free: Whether u is known up to a constant only, since it is given nowhere and no flux depends on it. A is
            singular then; :meth:`solve` knows what to do.

    As B is 0 on the sides, ``(B / dt - A) u = B u_old / dt - g`` is an implicit step of u_t = ∇·(D ∇u).

    >>> from scipy.sparse.linalg import spsolve
    >>> from driftmesh import Mesh, laplacian_stencils
    >>> mesh = Mesh.uniform(cells=(8, 8))
    >>> sides = {"left": 0, "right": {"flux": 3}, "bottom": "no-flux", "top": "no-flux"}
    >>> poisson = laplacian_stencils(mesh, conditions=sides)
    >>> u = spsolve(poisson.matrix.tocsc(), poisson.right_hand_side(2)).reshape(mesh.shape)  # u'' = 2, u'(1) = 3
    >>> float(abs(u - (mesh.x**2 + mesh.x)).max().round(12))
    0.0
    """

    mesh: Mesh
    matrix: csr_matrix
    source: csr_matrix
    sides: Floats
    is_free: bool
    _given: list[Side] = field(repr=False)
    _areas: Floats = field(repr=False)

    def right_hand_side(self, f: Any) -> Floats:
        """B f + g, shape (N,).

        Args:
            f: A number, an array of the shape of the mesh, or a function of x and y, on a line of x.

        Raises:
            ValueError: Another shape, or values that are not finite.

        >>> from driftmesh import Mesh, laplacian_stencils
        >>> poisson = laplacian_stencils(Mesh.uniform(cells=(2, 2)), conditions=7)
        >>> [float(b) for b in poisson.right_hand_side(5)]
        [7.0, 7.0, 7.0, 7.0, 5.0, 7.0, 7.0, 7.0, 7.0]
        """
        values = at_nodes("f", f, self.mesh)
        right: Floats = self.source @ values.ravel() + self.sides
        return right

    def solve(self, f: Any, mean: float = 0.0) -> Floats:
        """u by sparse elimination.

        Where u is known up to a constant only, what flows in must be the integral of f. What the discrete equations
        lack to that, an error of second order, is spread evenly over f, and the constant follows from ``mean``.

        Args:
            f: As of :meth:`right_hand_side`.
            mean: The mean of u over the domain, where nothing else determines it.

        Returns:
            u, of the shape of the mesh.

        Raises:
            ValueError: Another shape, values that are not finite, or fluxes on all sides that do not bring in what f
                takes.
            driftmesh.errors.LinearStalled: The matrix is singular.

        >>> from driftmesh import Mesh, laplacian_stencils
        >>> mesh = Mesh.uniform(cells=(8, 8))
        >>> u = laplacian_stencils(mesh, conditions={"flux": 0.5}).solve(2)  # ½ through 4 sides of length 1
        >>> float(abs(u - ((mesh.x - 0.5)**2 + (mesh.y - 0.5)**2) / 2 + 1 / 12).max()) < 0.01
        True
        """
        from scipy.sparse import csc_matrix, diags, hstack
        from scipy.sparse.linalg import LinearOperator, norm, onenormest, splu

        values = at_nodes("f", f, self.mesh)
        right, matrix = self.source @ values.ravel() + self.sides, csc_matrix(self.matrix)
        if self.is_free:
            self._check_balance(values)
            # the first node is 0 until the mean is known, and what f lacks is unknown in its place
            inside = np.diff(self.source.indptr) > 0
            matrix = csc_matrix(hstack([csc_matrix(inside[:, None].astype(float)), matrix[:, 1:]]))
        # rows of one size: those inside have that of 1/h²
        scale = 1 / abs(matrix).max(axis=1).toarray().ravel()
        matrix = csc_matrix(diags(scale) @ matrix)
        try:
            factors = splu(matrix)
        except RuntimeError:
            raise LinearStalled(_SINGULAR) from None
        transposed: Any = factors.solve
        inverse = LinearOperator(
            matrix.shape, factors.solve, rmatvec=lambda v: transposed(v, "T"), dtype=np.float64
        )
        if norm(matrix, 1) * onenormest(inverse) > ILL_CONDITIONED:
            raise LinearStalled(_SINGULAR)
        u: Floats = factors.solve(scale * right)
        if self.is_free:
            u[0] = 0.0
            u += mean - float(self._areas @ u) / float(self._areas.sum())
        return u.reshape(self.mesh.shape)

    def _check_balance(self, f: Floats) -> None:
        """Refuses fluxes on all sides that do not bring in what f takes, by integrals over all nodes and over every
        second one, which tell their own error."""
        fine, coarse = (_integrals(self.mesh, f, self._given, every) for every in (1, 2))
        inflow, source = fine[:2] + (fine[:2] - coarse[:2]) / 3
        doubt = np.abs(fine[:2] - coarse[:2]).sum()
        if abs(inflow - source) > max(doubt, UNBALANCED * fine[2]):
            raise ValueError(
                f"a flux on all sides: {inflow:.6e} flows in and the integral of `f` is {source:.6e}, a defect of "
                f"{inflow - source:.1e}: nothing is steady then; change `f` or a flux, or give u on a side"
            )


@dataclass(frozen=True)
class Side:
    """What holds at the nodes of a side: the value g, or the flux g + c u."""

    axis: int
    end: int
    g: Floats
    c: Floats | None

    def index(self) -> tuple[Any, ...]:
        """The nodes of the side in an array over the mesh."""
        return (slice(None),) * self.axis + (-self.end,)


def sides_of(mesh: Mesh, conditions: Any) -> list[Side]:
    """What holds on the sides of a mesh, in the order of :data:`SIDES`.

    Raises:
        ValueError: A side that is not there, one that is left out, or no condition.
    """
    axes = [axis for axis, wraps in enumerate(mesh._periodic) if not wraps]
    there = {name: (axis, end) for axis in axes for end, name in enumerate(SIDES[axis])}
    by_side = isinstance(conditions, Mapping) and "flux" not in conditions
    each = dict(conditions) if by_side else dict.fromkeys(there, conditions)
    all_names = ", ".join(there) or "none, since all axes are periodic or closed"
    for name in each:
        if name not in there:
            raise ValueError(f"`conditions` has {name!r}, but there is no such side; the sides here are {all_names}")
    for name in there:
        if name not in each:
            raise ValueError(
                f"`conditions` does not say what holds on {name!r}; the sides here are {all_names}: "
                f'add {{"{name}": "no-flux"}} or another condition'
            )
    return [_side(mesh, f"conditions[{name!r}]", there[name], each[name]) for name in there]


def _side(mesh: Mesh, name: str, at: tuple[int, int], condition: Any) -> Side:
    """What holds on one side."""
    side = Side(*at, np.zeros(0), None)
    at_side = [np.array(x[side.index()]) for x in points(mesh, mesh._nodes)]
    zero = np.zeros_like(at_side[0])

    def values(of: str, given: Any, *more: Floats) -> Floats:
        if isinstance(given, (str, Mapping)) or given is None:
            raise ValueError(f"`{of}` is {given!r}, but must be {CONDITIONS}")
        found = real(of, given(*at_side, *more) if callable(given) else given)
        found = found[side.index()] if found.shape == mesh.shape else found
        return finite(of, np.full(zero.shape, found) if found.ndim == 0 else found, zero.shape, "the side")

    # without convection nothing is carried out: a side with outflow is one without flux
    if isinstance(condition, str) and condition in ("no-flux", "outflow"):
        return Side(*at, zero, zero)
    if not isinstance(condition, Mapping):
        return Side(*at, values(name, condition), None)
    if list(condition) != ["flux"]:
        raise ValueError(f"`{name}` is {dict(condition)!r}, but must be {CONDITIONS}")
    name, flux = f"{name}['flux']", condition["flux"]
    if not callable(flux):
        return Side(*at, values(name, flux), zero)
    none, one, two = (values(name, flux, zero + u) for u in (0.0, 1.0, 2.0))
    if (np.abs(two - 2 * one + none) > LINEAR * np.max(np.abs([none, one, two]))).any():
        raise ValueError(f"`{name}` is not linear in u; it must be g + c*u with g and c functions of the place")
    return Side(*at, none, one - none)


def on_nodes(mesh: Mesh, sides: list[Side]) -> tuple[Floats, Floats, list[list[bool]]]:
    """g and c at the nodes, and which sides have fluxes. In a corner a value counts before a flux, and a side before
    those that come later."""
    g, c = np.zeros(mesh.shape), np.zeros(mesh.shape)
    fluxes = [[False, False], [False, False]]
    for side in sorted(reversed(sides), key=lambda side: side.c is None):
        g[side.index()] = side.g
        c[side.index()] = 0.0 if side.c is None else side.c
        fluxes[side.axis][side.end] = side.c is not None
    return g, c, fluxes


def points(mesh: Mesh, places: Floats) -> Floats:
    """The coordinates of places, of shape (…, 2) or (…, 1), one array each; images of what left a periodic box."""
    return np.moveaxis(places, -1, 0) if mesh._chart else images(places, mesh.lower, mesh.upper, mesh._periodic)


def at_nodes(name: str, given: Any, mesh: Mesh) -> Floats:
    """A number, an array or a function of the place at the nodes."""
    if isinstance(given, str) or given is None:
        raise ValueError(f"`{name}` is {given!r}, but must be a number, an array or a function of the place")
    values = real(name, given(*points(mesh, mesh._nodes)) if callable(given) else given)
    return finite(name, np.full(mesh.shape, values) if values.ndim == 0 else values, mesh.shape)


def _integrals(mesh: Mesh, f: Floats, sides: list[Side], every: int) -> Floats:
    """What flows in, the integral of f and that of the magnitudes of both, by the trapezoidal rule."""
    kept = [np.unique(np.append(np.arange(0, n + 1, every), n)) for n in mesh.cells]
    nodes, f = mesh._nodes[np.ix_(*kept)], f[np.ix_(*kept)]
    if mesh.dimensions == 1:
        cells, values = np.diff(nodes[:, 0]), [f[:-1], f[1:]]
    else:
        one, other = nodes[1:, 1:] - nodes[:-1, :-1], nodes[:-1, 1:] - nodes[1:, :-1]
        cells = (one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]) / 2
        values = [f[:-1, :-1], f[:-1, 1:], f[1:, :-1], f[1:, 1:]]
    total = np.zeros(3)
    for corner in values:
        total += np.array([0.0, (cells * corner).sum(), np.abs(cells * corner).sum()]) / len(values)
    for side in sides:
        if mesh.dimensions == 1:
            total += [side.g.sum(), 0.0, np.abs(side.g).sum()]
            continue
        g, line = side.g[kept[1 - side.axis]], nodes[side.index()]
        length = np.hypot(*np.diff(line, axis=0).T)
        total += [(length * (g[1:] + g[:-1])).sum() / 2, 0.0, (length * np.abs(g[1:] + g[:-1])).sum() / 2]
    return total
