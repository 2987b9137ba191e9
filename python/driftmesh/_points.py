"""Values of nodal fields between the nodes of a mesh, and how fast nodes move."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from . import _driftmesh
from ._arrays import Floats, count, finite, positive
from ._boxes import each_axis, periodic_values

if TYPE_CHECKING:
    from .mesh import Mesh


def interpolate(mesh: Mesh, u: ArrayLike, coordinates: Sequence[ArrayLike], order: int) -> Floats:
    """See :meth:`driftmesh.Mesh.interpolate`."""
    if isinstance(order, bool) or order not in (1, 3):
        raise ValueError(f"`order` is {order!r}, but must be 1 or 3")
    fields = finite("u", u)
    leading = fields.shape[: fields.ndim - mesh.dimensions]
    if fields.shape[len(leading) :] != mesh.shape or fields.ndim < mesh.dimensions:
        raise ValueError(f"`u` has shape {fields.shape}, but the mesh has shape {mesh.shape}, which must come last")
    periodic_values("u", fields, mesh._periodic)
    given = [finite(name, values) for name, values in zip("xy", coordinates)]
    try:
        points = np.stack(np.broadcast_arrays(*given), axis=-1)
    except ValueError:
        shapes = " and ".join(str(values.shape) for values in given)
        raise ValueError(f"`x` and `y` have shapes {shapes}, which do not fit together") from None
    shape = points.shape[:-1]
    rows = np.ascontiguousarray(points.reshape(-1, mesh.dimensions))
    flat = fields.reshape(int(np.prod(leading)), int(np.prod(mesh.shape)))
    values, outside = _driftmesh.interpolate(mesh._given(), flat, rows, order == 3)
    if values is None:
        index = tuple(int(k) for k in np.unravel_index(outside, shape))
        place = ", ".join(f"{value}" for value in rows[outside])
        where = f" at index {index}" if index else ""
        raise ValueError(
            f"the point ({place}){where} lies outside of the mesh, which extends from {mesh.lower} to {mesh.upper}"
        )
    found: Floats = values.reshape(leading + shape)[()]
    return found


def sample(mesh: Mesh, u: ArrayLike, shape: int | Sequence[int], order: int) -> Floats:
    """See :meth:`driftmesh.Mesh.sample`."""
    numbers = [count("shape", n) for n in each_axis("shape", shape, mesh.dimensions)]
    if min(numbers) < 2:
        raise ValueError(f"`shape` is {shape!r}, but must be 2 points or more along each axis")
    axes: list[Any] = [np.linspace(*ends) for ends in zip(mesh.lower, mesh.upper, numbers, strict=True)]
    return interpolate(mesh, u, np.meshgrid(*axes, indexing="ij"), order)


def velocity(mesh: Mesh, old: Mesh, dt: float) -> Floats:
    """See :meth:`driftmesh.Mesh.velocity`."""
    if not isinstance(old, type(mesh)):
        raise ValueError(f"`old` is of type {type(old).__name__}, but must be a driftmesh.Mesh")
    if old.shape != mesh.shape or old._given()[1:] != mesh._given()[1:]:
        raise ValueError(f"`old` is {old!r}, but must have the lattice and the box of {mesh!r}")
    time = positive("dt", dt)
    ways: Floats = np.moveaxis(mesh._nodes - old._nodes, -1, 0)
    for axis in np.flatnonzero(mesh.periodic):
        size = mesh.upper[axis] - mesh.lower[axis]
        ways[axis] -= size * np.round(ways[axis] / size)
    return ways / time


class Points:
    """What a mesh tells of its nodes in time, and of fields between them."""

    __slots__ = ()

    @property
    def jacobian(self) -> Floats:
        """J = x_ξ y_η − x_η y_ξ at the nodes, ξ and η in the unit square, shape (nx + 1, ny + 1); x_ξ on a line.

        By the differences of :func:`gradient`, of second order, in the square of the unit of length: large where cells
        are wide, and on a uniform mesh the area of the box.

        >>> from driftmesh import Mesh
        >>> float(Mesh.uniform(cells=(8, 8), upper=(2, 3)).jacobian[4, 4])
        6.0
        """
        from .differences import tangents

        determinants: Floats = np.linalg.det(tangents(cast("Mesh", self)))
        return determinants

    def velocity(self, old: Mesh, dt: float) -> Floats:
        """(x_t, y_t): how fast each node moved from an earlier mesh to this one, shape (2, nx + 1, ny + 1).

        ::

            x_t = (x − x_old)/dt

        On a line the shape is (1, nx + 1). Along a periodic axis a node goes the shorter way around, so that nodes
        which left the box at one end and were put back at the other have not jumped.

        Args:
            old: The mesh before, over the same lattice and box.
            dt: The time between both, above 0.

        Raises:
            ValueError: Another lattice or box, or ``dt`` not above 0.

        >>> from driftmesh import Mesh
        >>> old = Mesh.uniform(cells=(4, 4))
        >>> x_t, y_t = old.moved(old.x**2, old.y).velocity(old, dt=0.5)
        >>> float(x_t[2, 0])  # from 0.5 to 0.25
        -0.5
        """
        return velocity(cast("Mesh", self), old, dt)

    def interpolate(
        self,
        u: ArrayLike,
        x: ArrayLike,
        y: ArrayLike | None = None,
        *,
        order: int = 1,
    ) -> Floats:
        """Values of nodal fields at any points.

        ::

            u(x) = Σ_k N_k(ξ) u_k  where  x = Σ_k N_k(ξ) x_k

        with the products N_k of Lagrange's polynomials along ξ and η. Functions that are linear in x and y are exact on
        any mesh.

        Args:
            u: One field of shape (nx + 1, ny + 1), on a line (nx + 1,), or several with further axes before these.
            x: Where values are wanted, of any shape. Along a periodic axis any image of a point will do.
            y: The same, of a shape that can be broadcast with that of ``x``; left out on a line.
            order: 1 takes N_k to be linear along each axis of a cell: of second order, and within the range of the
                values at the corners. 3 takes cubics through four nodes: of fourth order where the mesh is smooth, and
                it may leave the range of the values.

        Returns:
            The values, with the further axes of ``u`` before those of the points.

        Raises:
            ValueError: Shapes that do not fit, values that are not finite, or a point outside of the mesh, of which the
                first one is named.
            driftmesh.errors.MeshFolded: A cell is folded.

        >>> from driftmesh import Mesh
        >>> mesh = Mesh.uniform(cells=(4, 4))
        >>> mesh.interpolate(mesh.x * mesh.y, [0.3, 1.0], 0.5)
        array([0.15, 0.5 ])
        """
        mesh = cast("Mesh", self)
        return interpolate(mesh, u, coordinates(mesh.dimensions, x, y), order)

    def sample(self, u: ArrayLike, shape: int | Sequence[int], *, order: int = 1) -> Floats:
        """Values of nodal fields on the regular grid of a number of points along each axis of the box.

        Args:
            u: As of :meth:`interpolate`.
            shape: Numbers of points along x and y, 2 or more; one number for both. They are those of
                ``np.linspace(lower, upper, n)``. The mesh must fill its box.
            order: As of :meth:`interpolate`.

        Returns:
            The values, with the axes of the grid last, first index along x; raises as :meth:`interpolate` does.

        >>> from driftmesh import Mesh
        >>> mesh = Mesh.uniform(cells=(4, 4))
        >>> mesh.moved(mesh.x**2, mesh.y).sample(mesh.x**2, (3, 2))
        array([[0. , 0. ],
               [0.5, 0.5],
               [1. , 1. ]])
        """
        return sample(cast("Mesh", self), u, shape, order)


def coordinates(dimensions: int, x: ArrayLike, y: ArrayLike | None) -> list[ArrayLike]:
    """As many coordinates of points as there are dimensions."""
    if (y is None) != (dimensions == 1):
        rule = "is missing: this mesh lies in the plane" if y is None else "is given, but this mesh is a line"
        raise ValueError(f"`y` {rule}")
    return [x] if y is None else [x, y]
