"""Nodal values carried from one mesh to another."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from . import _driftmesh
from ._arrays import Floats, finite
from ._arrays import threads as _threads
from ._boxes import ROUNDING, periodic_values
from .mesh import Mesh


def transfer(
    u: ArrayLike,
    old: Mesh,
    new: Mesh,
    method: Literal["conservative", "interpolate"] = "conservative",
    *,
    threads: int | None = None,
) -> Floats:
    """Carries nodal values from one mesh to another over the same lattice and box.

    Args:
        u: Shape (nx + 1, ny + 1), or (nx + 1, ny + 1, k) for k unknowns; on a line (nx + 1,), or (nx + 1, k).
        old: The mesh that u is on.
        new: The mesh that it is wanted on.
        method: ``"conservative"`` advects u through the moving faces of the dual cells. It keeps
            ``(u * mesh.areas).sum()`` to round-off and every value within the range of its neighbours. Where u is
            smooth it is of second order in the mean, and of first order at sides and extrema, hence in the maximum
            norm; it is not exact for linear u. Its cost grows with the distance between the meshes, which it covers in
            steps of at most half a cell. ``"interpolate"`` takes u to be linear on two triangles for each cell, on the
            cells of a line: of second order everywhere, exact for linear u, and fast over any distance, but it
            conserves nothing.
        threads: Number of threads; all cores where nothing is said. The values have the same bits for any number.

    Returns:
        The values on the new mesh, shape as u.

    Raises:
        ValueError: Shapes or boxes that differ, or values that are not finite; for ``"conservative"`` also sides that
            enclose another domain (nodes may slide along straight sides).
        driftmesh.errors.MeshFolded: A cell is folded in one of the meshes, or in one on the straight way between them.

    >>> from driftmesh import Mesh, transfer
    >>> old = Mesh.uniform(cells=(8, 8))
    >>> new = old.moved(old.x**2, old.y)
    >>> u = transfer(old.x, old, new)
    >>> abs((u * new.areas).sum() - (old.x * old.areas).sum()) < 1e-14
    np.True_
    """
    _check(old, new, method)
    values = finite("u", u)
    number = _threads(threads)
    if values.shape[: old.dimensions] != old.shape or values.ndim > old.dimensions + 1:
        raise ValueError(f"`u` has shape {values.shape}, but the mesh has shape {old.shape}")
    out = np.empty_like(values)
    for c in np.ndindex(values.shape[old.dimensions :]):
        unknown = periodic_values("u", np.ascontiguousarray(values[(..., *c)]), old._periodic)
        out[(..., *c)] = _driftmesh.transfer(unknown, old._given(), new._given(), method == "conservative", number)
    return out


def _check(old: Mesh, new: Mesh, method: str) -> None:
    """Refuses meshes between which values cannot be carried by a method."""
    for name, mesh in (("old", old), ("new", new)):
        if not isinstance(mesh, Mesh):
            raise TypeError(f"`{name}` is of type {type(mesh).__name__}, but must be a driftmesh.Mesh")
    if old.shape != new.shape:
        raise ValueError(f"`old` has shape {old.shape}, but `new` has shape {new.shape}; both need the same lattice")
    if old._given()[1:] != new._given()[1:]:
        raise ValueError(f"`old` and `new` lie in different boxes: {old!r} and {new!r}")
    if method not in ("conservative", "interpolate"):
        raise ValueError(f'`method` is {method!r}, but must be "conservative" or "interpolate"')
    if method == "conservative":
        _refuse_moved_sides(old, new)


def _refuse_moved_sides(old: Mesh, new: Mesh) -> None:
    """Refuses meshes whose sides enclose something else: there is no value for what a side sweeps."""
    if old._chart is not None:
        return  # of the same domain, as is checked before
    size = np.prod(np.subtract(old.upper, old.lower))
    for axis in np.flatnonzero(np.logical_not(old.periodic)):
        for end in (0, -1):
            before, after = np.take(old._nodes, end, axis), np.take(new._nodes, end, axis)
            if _swept(before, after) > ROUNDING * size:
                raise ValueError(
                    f"the {'last' if end else 'first'} side of axis {axis} differs between `old` and `new`, "
                    'so that no integral can be kept; use method="interpolate"'
                )


def _swept(before: Floats, after: Floats) -> float:
    """The largest area, in one dimension the length, that a segment of a side sweeps."""
    if before.ndim == 1:
        return float(np.abs(after - before).max())
    # of the quadrilateral between a segment before and after, twice the area by its diagonals
    one, other = after[1:] - before[:-1], after[:-1] - before[1:]
    return float(np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]).max())
