"""Boxes of meshes in one and two dimensions: corners, periodic axes, and what nodes must satisfy in them.

Nodes have shape (nx + 1, ny + 1, 2), of a line (nx + 1, 1).
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from . import _driftmesh
from ._arrays import Floats, finite, scalar

#: A distance below this share of the size of the box is taken for round-off of positions.
ROUNDING = 1e-9

Corner = tuple[float, ...]
Flags = tuple[bool, ...]


def each_axis(name: str, values: Any, dimensions: int) -> tuple[Any, ...]:
    """One entry an axis; a single one stands for all axes."""
    if isinstance(values, (str, bytes)) or np.ndim(values) == 0:
        return (values,) * dimensions
    entries = tuple(values)
    if len(entries) != dimensions:
        number = "two entries" if dimensions == 2 else "one entry"
        raise ValueError(f"`{name}` is {values!r}, but must have {number}, one an axis")
    return entries


def corner(name: str, values: float | Sequence[float], dimensions: int) -> Corner:
    """A corner of a box."""
    return tuple(scalar(name, value) for value in each_axis(name, values, dimensions))


def flags(values: bool | Sequence[bool], dimensions: int, name: str = "periodic") -> Flags:
    """Which axes wrap around."""
    entries = each_axis(name, values, dimensions)
    for value in entries:
        if isinstance(value, str) or value not in (False, True):
            raise ValueError(f"`{name}` is {values!r}, but must be truth values, one an axis")
    return tuple(bool(value) for value in entries)


def closed(nodes: Floats, periodic: Flags, given: Flags) -> Flags:
    """Which axes are closed: those that are said to be, and periodic ones whose last nodes are the first ones."""
    if nodes.ndim == 2 and any(given):
        raise ValueError("`closed` is given, but a line has no axis whose ends are one curve; use `periodic`")

    def meets(axis: int) -> bool:
        gap = np.abs(np.take(nodes, -1, axis) - np.take(nodes, 0, axis)).max()
        return bool(gap <= ROUNDING * np.ptp(nodes.reshape(-1, nodes.shape[-1]), axis=0).max())

    plane = nodes.ndim == 3
    return tuple(given[axis] or (plane and periodic[axis] and meets(axis)) for axis in range(len(periodic)))


def structured(x: Any, y: Any) -> Floats:
    """The nodes of a structured mesh, from arrays or from a file."""
    if y is None and isinstance(x, (str, os.PathLike)):
        return _driftmesh.read_nodes(x)
    if y is None or isinstance(x, str) or isinstance(y, str):
        raise ValueError("`x` and `y` must be two arrays of one shape, or two formulas of s and r; or `x` a file alone")
    first = finite("x", x)
    if first.ndim != 2 or min(first.shape) < 3:
        raise ValueError(f"`x` has shape {first.shape}, but must have two axes of 3 nodes or more: (nx + 1, ny + 1)")
    return np.stack([first, finite("y", y, first.shape, "`x`")], axis=-1)


def box(
    nodes: Floats,
    lower: float | Sequence[float] | None,
    upper: float | Sequence[float] | None,
    periodic: Flags,
) -> tuple[Corner, Corner]:
    """The corners that are given, or else those of the smallest box; along periodic axes as the nodes wrap around."""
    dimensions = len(periodic)
    every = tuple(range(dimensions))
    low, high = list(nodes.min(axis=every).tolist()), list(nodes.max(axis=every).tolist())
    if lower is not None:
        low = list(corner("lower", lower, dimensions))
    for axis in np.flatnonzero(periodic):
        start, end = (np.take(nodes, k, axis)[..., axis] for k in (0, -1))
        low[axis] = float(start.min()) if lower is None else low[axis]
        high[axis] = low[axis] + float((end - start).mean())
    if upper is not None:
        high = list(corner("upper", upper, dimensions))
    return tuple(low), tuple(high)


def close(nodes: Floats, lower: Corner, upper: Corner, periodic: Flags) -> None:
    """Checks the closing nodes of periodic axes, and puts them a box further than the first ones to the last bit."""
    for axis in np.flatnonzero(periodic):
        size = upper[axis] - lower[axis]
        layers = np.moveaxis(nodes, axis, 0)
        image = layers[0].copy()
        image[..., axis] += size
        if np.abs(layers[-1] - image).max() > ROUNDING * size:
            raise ValueError(
                f"axis {axis} is periodic, but its last nodes are not the first ones a box of {size} further"
            )
        layers[-1] = image


def refuse_mirrored(nodes: Floats) -> None:
    """Refuses a mesh all of whose cells are the wrong way round, as its indices are then."""
    if nodes.ndim == 2:
        if (np.diff(nodes[:, 0]) < 0).all():
            raise ValueError("the line is mirrored: `x` falls from node to node; give it in rising order, as x[::-1]")
        return
    along, across = nodes[1:, 1:] - nodes[:-1, :-1], nodes[:-1, 1:] - nodes[1:, :-1]
    if (along[..., 0] * across[..., 1] < along[..., 1] * across[..., 0]).all():
        raise ValueError(
            "the mesh is mirrored: its first index must go along x, its second one along y, shape (nx + 1, ny + 1), "
            'as of np.meshgrid(x, y, indexing="ij")'
        )


def check_box(nodes: Floats, lower: Corner, upper: Corner, periodic: Flags) -> None:
    """Refuses a mesh whose bounded sides do not lie on its box: a generator moves nodes along straight sides."""
    for axis in np.flatnonzero(np.logical_not(periodic)):
        name, slack = "xy"[axis], ROUNDING * (upper[axis] - lower[axis])
        for end, wall in ((0, lower[axis]), (-1, upper[axis])):
            side = np.atleast_1d(np.take(nodes, end, axis)[..., axis])
            off = np.abs(side - wall)
            if off.max() > slack:
                k = int(off.argmax())
                raise ValueError(
                    f"the mesh does not fill its box: a node of the side {name} = {wall} is at {name} = {side[k]}; "
                    "generators move meshes of rectangles"
                )


def fills_box(nodes: Floats, lower: Corner, upper: Corner, periodic: Flags) -> bool:
    """Whether the bounded sides of a mesh lie on its box."""
    try:
        check_box(nodes, lower, upper, periodic)
    except ValueError:
        return False
    return True


def images(nodes: Floats, lower: Corner, upper: Corner, periodic: Flags) -> Floats:
    """Nodes with those that left the box along a periodic axis brought back into it, one array a coordinate."""
    inside = np.moveaxis(nodes, -1, 0).copy()
    for axis in np.flatnonzero(periodic):
        x, low, size = inside[axis], lower[axis], upper[axis] - lower[axis]
        off = (x < low) | (x >= upper[axis])
        back = x - size * np.floor((x - low) / size)
        x[off] = np.where(back < upper[axis], np.maximum(back, low), low)[off]
    return inside


def periodic_values(name: str, values: Floats, periodic: Flags) -> Floats:
    """Refuses values whose closing nodes on periodic axes are not those of the first; further axes may come first."""
    for axis in np.flatnonzero(periodic):
        at = values.ndim - len(periodic) + axis
        start, end = np.take(values, 0, at), np.take(values, -1, at)
        off = np.abs(end - start)
        if off.max() > 1e-6 * np.abs(values).max():
            k = int(off.argmax())
            raise ValueError(
                f"axis {axis} is periodic, but `{name}` is {start.flat[k]} at its first node and {end.flat[k]} at its "
                f"last, which is the same one (index {k} along the other axis)"
            )
    return values
