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
    order: Literal[2, 3] = 2,
    bounds: tuple[float, float] | None = None,
    told: bool = False,
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
        order: Of ``"conservative"``. 3 takes u to be a parabola along each axis, which is of third order along each
            axis, also at extrema: peaks hardly lose height. Values stay within the range of u, or within `bounds`.
        bounds: Lowest and highest value that u may have, with ``order=3``, such as ``(0, 1)`` for a concentration.
        told: Prints, for each unknown, what the peak lost and how far the integral is off.
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
    how = _how(method, order, bounds)
    values = finite("u", u)
    number = _threads(threads)
    if values.shape[: old.dimensions] != old.shape or values.ndim > old.dimensions + 1:
        raise ValueError(f"`u` has shape {values.shape}, but the mesh has shape {old.shape}")
    out = np.empty_like(values)
    for c in np.ndindex(values.shape[old.dimensions :]):
        unknown = periodic_values("u", np.ascontiguousarray(values[(..., *c)]), old._periodic)
        out[(..., *c)] = _driftmesh.transfer(unknown, old._given(), new._given(), how, number)
        if told:
            print(_told(c, values[(..., *c)], out[(..., *c)], old, new))
    return out


def _how(method: str, order: int, bounds: tuple[float, float] | None) -> tuple[int, tuple[float, float] | None]:
    """The order, 1 for interpolation, and the bounds."""
    if order not in (2, 3):
        raise ValueError(f"`order` is {order!r}, but must be 2 or 3")
    if method == "interpolate":
        if order != 2 or bounds is not None:
            raise ValueError('`order` and `bounds` go with method="conservative"; leave them out')
        return 1, None
    if bounds is None:
        return order, None
    if order != 3:
        raise ValueError("`bounds` goes with order=3; add it, or leave the bounds out")
    low, high = (float(bound) for bound in bounds)
    if not low < high < np.inf or low == -np.inf:
        raise ValueError(f"`bounds` is {bounds!r}, but must be a lower and a higher finite number")
    return order, (low, high)


def _told(c: tuple[int, ...], before: Floats, after: Floats, old: Mesh, new: Mesh) -> str:
    """What the peak of an unknown lost, and how far its integral is off."""
    peaks = [float(np.abs(u).max()) for u in (before, after)]
    integrals = [float((u * mesh.areas).sum()) for u, mesh in ((before, old), (after, new))]
    size = float((np.abs(before) * old.areas).sum())
    lost = 1 - peaks[1] / peaks[0] if peaks[0] else 0.0
    gap = abs(integrals[1] - integrals[0]) / size if size else 0.0
    name = "".join(f"[{k}]" for k in c)
    return f"u{name}: the peak lost {lost:.2e} of its height, the integral is off by {gap:.1e}"


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
