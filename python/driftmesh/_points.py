"""Values of nodal fields between the nodes of a mesh, and how fast nodes move."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

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
