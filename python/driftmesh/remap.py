"""Nodal values carried from one mesh to another."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from . import _driftmesh
from ._arrays import Floats, finite
from .mesh import ROUNDING, Mesh


def transfer(
    u: ArrayLike,
    old: Mesh,
    new: Mesh,
    method: Literal["conservative", "interpolate"] = "conservative",
) -> Floats:
    """Carries nodal values from one mesh to another over the same lattice and box.

    Args:
        u: Shape (nx + 1, ny + 1), or (nx + 1, ny + 1, k) for k unknowns.
        old: The mesh that u is on.
        new: The mesh that it is wanted on.
        method: ``"conservative"`` advects u through the moving faces of the dual cells. It keeps
            ``(u * mesh.areas).sum()`` to round-off and every value within the range of its neighbours. Where u is
            smooth it is of second order in the mean, and of first order at sides and extrema, hence in the maximum
            norm; it is not exact for linear u. Its cost grows with the distance between the meshes, which it covers in
            steps of at most half a cell. ``"interpolate"`` takes u to be linear on two triangles for each cell: of
            second order everywhere, exact for linear u, and fast over any distance, but it conserves nothing.

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
    if values.shape[:2] != old.shape or values.ndim not in (2, 3):
        raise ValueError(f"`u` has shape {values.shape}, but the mesh has shape {old.shape}")
    out = np.empty_like(values)
    for c in np.ndindex(values.shape[2:]):
        unknown = periodic_values("u", np.ascontiguousarray(values[(..., *c)]), old)
        out[(..., *c)] = _driftmesh.transfer(unknown, old._given(), new._given(), method == "conservative")
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


def periodic_values(name: str, values: Floats, mesh: Mesh) -> Floats:
    """Refuses values whose closing nodes on periodic axes are not those of the first."""
    for axis in range(2):
        if mesh.periodic[axis]:
            start, end = np.take(values, 0, axis), np.take(values, -1, axis)
            off = np.abs(end - start)
            if off.max() > 1e-6 * np.abs(values).max():
                k = int(off.argmax())
                raise ValueError(
                    f"axis {axis} is periodic, but `{name}` is {start[k]} at its first node and {end[k]} at its last, "
                    f"which is the same one (index {k} along the other axis)"
                )
    return values


def _refuse_moved_sides(old: Mesh, new: Mesh) -> None:
    """Refuses meshes whose sides enclose something else: there is no value for what a side sweeps."""
    size = (old.upper[0] - old.lower[0]) * (old.upper[1] - old.lower[1])
    for axis in range(2):
        for end in (0, -1):
            before, after = np.take(old._nodes, end, axis), np.take(new._nodes, end, axis)
            # of the quadrilateral between a segment before and after, twice the area by its diagonals
            one, other = after[1:] - before[:-1], after[:-1] - before[1:]
            swept = np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])
            if not old.periodic[axis] and swept.max() > ROUNDING * size:
                raise ValueError(
                    f"the {'last' if end else 'first'} side of axis {axis} differs between `old` and `new`, "
                    'so that no integral can be kept; use method="interpolate"'
                )
