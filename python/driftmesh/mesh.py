"""Meshes and their quality."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _driftmesh
from ._arrays import Floats, count, finite, pair, scalar

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: A distance below this share of the size of the box is taken for round-off of positions.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Quality:
    """How good a mesh is.

    Attributes:
        q_max: Largest Q over the cells; Q = ½ tr(JᵀJ)/√det(JᵀJ) is 1 for a square and grows with stretching and shear.
        q_mean: Mean Q over the cells.
        min_scaled_jacobian: Smallest corner Jacobian over that of the uniform mesh; positive as long as no cell is
            folded.
        equidistribution: max/mean of density × area over the cells; 1 is perfect.

    >>> from driftmesh import Mesh
    >>> Mesh.uniform(cells=(4, 4)).quality()
    Quality(q_max=1.0, q_mean=1.0, min_scaled_jacobian=1.0, equidistribution=1.0)
    """

    q_max: float
    q_mean: float
    min_scaled_jacobian: float
    equidistribution: float


class Mesh:
    """A mesh of quadrilaterals over a box or another shape: the position of every node of a lattice.

    Args:
        x: Positions of the nodes, shape (nx + 1, ny + 1), nx and ny at least 2, first index along ξ.
        y: The same.
        lower: Lower corner of the box; by default that of the smallest box around the nodes. Give it where the first
            nodes of a periodic axis have moved away from the corner.
        upper: Upper corner of the box; by default that of the smallest box around the nodes, and along a periodic axis
            as far from ``lower`` as the last nodes are from the first.
        periodic: Which axes wrap around. The last node of such an axis is its first one, shifted by the box.

    Raises:
        ValueError: Shapes that differ, values that are not finite, a box without extent, last nodes of a periodic axis
            that are not its first ones shifted by the box, or a mesh whose second index goes along x.

    A mesh does not change; :meth:`moved` gives another one. It may have folded cells: :meth:`quality` tells, and
    functions that need a mesh without them raise :class:`driftmesh.errors.MeshFolded`.

    >>> from driftmesh import Mesh
    >>> mesh = Mesh.uniform(cells=(4, 2), upper=(1, 3))
    >>> mesh.x.shape, mesh.y[1, 1]
    ((5, 3), np.float64(1.5))
    """

    __slots__ = ("_lower", "_nodes", "_periodic", "_upper")

    _nodes: Floats
    _lower: tuple[float, float]
    _upper: tuple[float, float]
    _periodic: tuple[bool, bool]

    def __init__(
        self,
        x: ArrayLike,
        y: ArrayLike,
        *,
        lower: Sequence[float] | None = None,
        upper: Sequence[float] | None = None,
        periodic: Sequence[bool] = (False, False),
    ) -> None:
        first = finite("x", x)
        if first.ndim != 2 or min(first.shape) < 3:
            raise ValueError(
                f"`x` has shape {first.shape}, but must have two axes of 3 nodes or more: (nx + 1, ny + 1)"
            )
        second = finite("y", y, first.shape, "`x`")
        wraps = _flags(periodic)
        nodes = np.stack([first, second], axis=-1)
        low = tuple(nodes.min(axis=(0, 1)).tolist()) if lower is None else _corner("lower", lower)
        high = tuple(nodes.max(axis=(0, 1)).tolist()) if upper is None else _corner("upper", upper)
        for axis in range(2):
            if wraps[axis]:
                start, end = np.take(nodes, 0, axis)[:, axis], np.take(nodes, -1, axis)[:, axis]
                low = _with(low, axis, float(start.min())) if lower is None else low
                high = _with(high, axis, low[axis] + float((end - start).mean())) if upper is None else high
        _refuse_mirrored(nodes)
        _close(nodes, low, high, wraps)
        # the checks of the library: a box with an extent
        _driftmesh.uniform((nodes.shape[0] - 1, nodes.shape[1] - 1), low, high, wraps)
        self._set(nodes, low, high, wraps)

    def _set(
        self,
        nodes: Floats,
        lower: tuple[float, float],
        upper: tuple[float, float],
        periodic: tuple[bool, bool],
    ) -> None:
        nodes.flags.writeable = False
        self._nodes, self._lower, self._upper, self._periodic = nodes, lower, upper, periodic

    @classmethod
    def _of(cls, nodes: Floats, like: Mesh) -> Mesh:
        """Nodes that the library computed, in the box of another mesh."""
        mesh = cls.__new__(cls)
        mesh._set(nodes, like._lower, like._upper, like._periodic)
        return mesh

    @classmethod
    def uniform(
        cls,
        cells: Sequence[int] | NDArray[np.integer[Any]],
        lower: Sequence[float] = (0.0, 0.0),
        upper: Sequence[float] = (1.0, 1.0),
        periodic: Sequence[bool] = (False, False),
    ) -> Mesh:
        """The mesh of equal cells.

        Args:
            cells: (nx, ny), cells along ξ and η, at least 2 each.
            lower: Lower corner of the box, in the unit of length.
            upper: Upper corner.
            periodic: Which axes wrap around.

        Raises:
            ValueError: Fewer than 2 cells, or a box without extent.

        >>> from driftmesh import Mesh
        >>> Mesh.uniform(cells=(40, 20)).x.shape
        (41, 21)
        """
        nx, ny = (count("cells", n) for n in pair("cells", cells))
        low, high, wraps = _corner("lower", lower), _corner("upper", upper), _flags(periodic)
        mesh = cls.__new__(cls)
        mesh._set(_driftmesh.uniform((nx, ny), low, high, wraps), low, high, wraps)
        return mesh

    @property
    def x(self) -> Floats:
        """x of the nodes, shape (nx + 1, ny + 1): a view that cannot be written."""
        view: Floats = self._nodes[..., 0]
        return view

    @property
    def y(self) -> Floats:
        """y of the nodes, shape (nx + 1, ny + 1): a view that cannot be written."""
        view: Floats = self._nodes[..., 1]
        return view

    @property
    def shape(self) -> tuple[int, int]:
        """(nx + 1, ny + 1): the shape of every array over the mesh."""
        n, m, _ = self._nodes.shape
        return n, m

    @property
    def cells(self) -> tuple[int, int]:
        """(nx, ny)."""
        n, m = self.shape
        return n - 1, m - 1

    @property
    def lower(self) -> tuple[float, float]:
        """Lower corner of the box."""
        return self._lower

    @property
    def upper(self) -> tuple[float, float]:
        """Upper corner of the box."""
        return self._upper

    @property
    def periodic(self) -> tuple[bool, bool]:
        """Which axes wrap around."""
        return self._periodic

    @property
    def areas(self) -> Floats:
        """Area of the dual cell of each node, in the square of the unit of length, shape (nx + 1, ny + 1).

        ``(u * mesh.areas).sum()`` is the integral of u that a conservative :func:`transfer` keeps. The last nodes of a
        periodic axis are its first ones: their area is 0.

        >>> from driftmesh import Mesh
        >>> float(Mesh.uniform(cells=(8, 8), upper=(2, 3)).areas.sum())
        6.0
        """
        return _driftmesh.areas(self._given())

    def moved(self, x: ArrayLike, y: ArrayLike) -> Mesh:
        """The same lattice and box with other positions.

        Args:
            x: Positions of the nodes, shape (nx + 1, ny + 1).
            y: The same.

        Raises:
            ValueError: Another shape, values that are not finite, or last nodes of a periodic axis that are not its
                first ones shifted by the box.

        >>> from driftmesh import Mesh
        >>> mesh = Mesh.uniform(cells=(4, 4))
        >>> mesh.moved(mesh.x**2, mesh.y).x[2, 0]
        np.float64(0.25)
        """
        nodes = np.stack([finite("x", x, self.shape), finite("y", y, self.shape)], axis=-1)
        _close(nodes, self._lower, self._upper, self._periodic)
        return self._of(nodes, self)

    def quality(self, density: ArrayLike | None = None) -> Quality:
        """How good the mesh is.

        Args:
            density: ρ at the nodes, shape (nx + 1, ny + 1), for ``equidistribution``; by default ρ = 1.

        Raises:
            ValueError: Another shape, or a density that is not positive everywhere.

        >>> from driftmesh import Mesh
        >>> Mesh.uniform(cells=(3, 3), upper=(3, 6)).quality().q_max  # cells of 1 × 2: Q = ½ (1 + 4)/2
        1.25
        """
        rho = np.ones(self.shape) if density is None else finite("density", density, self.shape)
        if not (rho > 0).all():
            place = tuple(int(k) for k in np.argwhere(~(rho > 0))[0])
            raise ValueError(f"`density` is {rho[place]} at index {place}, but must be above 0")
        return Quality(*_driftmesh.quality(self._given(), rho))

    def to_meshio(self, **fields: ArrayLike) -> Any:
        """The mesh as a ``meshio.Mesh`` of quadrilaterals, with nodal fields by name, each of shape (nx + 1, ny + 1).

        Raises:
            ImportError: meshio is not there.

        >>> from driftmesh import Mesh
        >>> mesh = Mesh.uniform(cells=(4, 4))
        >>> mesh.to_meshio(u=mesh.x).cells_dict["quad"].shape
        (16, 4)
        """
        meshio = _extra("meshio")
        data = {name: finite(name, values, self.shape).ravel() for name, values in fields.items()}
        return meshio.Mesh(self._points(), [("quad", self._quads())], point_data=data)

    def to_pyvista(self, **fields: ArrayLike) -> Any:
        """The mesh as a ``pyvista.StructuredGrid``, with nodal fields by name, each of shape (nx + 1, ny + 1).

        Raises:
            ImportError: pyvista is not there.

        >>> from driftmesh import Mesh
        >>> mesh = Mesh.uniform(cells=(4, 4))
        >>> mesh.to_pyvista(u=mesh.x).n_cells
        16
        """
        pyvista = _extra("pyvista")
        grid = pyvista.StructuredGrid(self.x[..., None], self.y[..., None], np.zeros((*self.shape, 1)))
        for name, values in fields.items():
            # its points go along the first axis first
            grid.point_data[name] = finite(name, values, self.shape).ravel(order="F")
        return grid

    def plot(self, u: ArrayLike | None = None, ax: Axes | None = None) -> Axes:
        """Draws the mesh, over colours for u of shape (nx + 1, ny + 1) if it is given. Needs matplotlib.

        Raises:
            ImportError: matplotlib is not there.

        >>> from driftmesh import Mesh
        >>> mesh = Mesh.uniform(cells=(4, 4))
        >>> mesh.plot(mesh.x).get_aspect()
        1.0
        """
        from . import plot

        return plot.mesh(self, None if u is None else finite("u", u, self.shape), ax)

    def _given(self) -> tuple[Floats, tuple[float, float], tuple[float, float], tuple[bool, bool]]:
        return self._nodes, self._lower, self._upper, self._periodic

    def _points(self) -> Floats:
        points = np.zeros((self._nodes.shape[0] * self._nodes.shape[1], 3))
        points[:, :2] = self._nodes.reshape(-1, 2)
        return points

    def _quads(self) -> Any:
        k = np.arange(self.shape[0] * self.shape[1]).reshape(self.shape)
        return np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], axis=-1).reshape(-1, 4)

    def _check_box(self) -> None:
        """Refuses a mesh whose bounded sides do not lie on its box: a generator moves nodes along straight sides."""
        for axis, name in enumerate("xy"):
            slack = ROUNDING * (self._upper[axis] - self._lower[axis])
            for end, wall in ((0, self._lower[axis]), (-1, self._upper[axis])):
                side = np.take(self._nodes, end, axis)[:, axis]
                off = np.abs(side - wall)
                if not self._periodic[axis] and off.max() > slack:
                    k = int(off.argmax())
                    raise ValueError(
                        f"the mesh does not fill its box: a node of the side {name} = {wall} is at {name} = {side[k]}; "
                        "generators move meshes of rectangles"
                    )

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Mesh):
            return NotImplemented
        same = self._given()[1:] == other._given()[1:]
        return same and np.array_equal(self._nodes, other._nodes)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        wraps = f", periodic={self._periodic}" if any(self._periodic) else ""
        return f"<Mesh of {self.cells[0]} × {self.cells[1]} cells, lower={self._lower}, upper={self._upper}{wraps}>"

    def __getstate__(self) -> tuple[Any, ...]:
        return self._given()

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        self._set(*state)


def _close(nodes: Floats, lower: tuple[float, ...], upper: tuple[float, ...], periodic: tuple[bool, ...]) -> None:
    """Checks the closing nodes of periodic axes, and puts them a box further than the first ones to the last bit."""
    for axis in range(2):
        if periodic[axis]:
            size = upper[axis] - lower[axis]
            image = np.take(nodes, 0, axis)
            image[:, axis] += size
            last: tuple[Any, ...] = (-1,) if axis == 0 else (slice(None), -1)
            off = np.abs(nodes[last] - image).max()
            if off > ROUNDING * size:
                raise ValueError(
                    f"axis {axis} is periodic, but its last nodes are not the first ones a box of {size} further"
                )
            nodes[last] = image


def _refuse_mirrored(nodes: Floats) -> None:
    """Refuses a mesh all of whose cells are clockwise: its indices are the wrong way round."""
    along, across = nodes[1:, 1:] - nodes[:-1, :-1], nodes[:-1, 1:] - nodes[1:, :-1]
    if (along[..., 0] * across[..., 1] < along[..., 1] * across[..., 0]).all():
        raise ValueError(
            "the mesh is mirrored: its first index must go along x, its second one along y, shape (nx + 1, ny + 1), "
            'as of np.meshgrid(x, y, indexing="ij")'
        )


def _with(corner: tuple[Any, ...], axis: int, value: float) -> tuple[Any, ...]:
    return (value, corner[1]) if axis == 0 else (corner[0], value)


def _corner(name: str, values: Sequence[float]) -> tuple[float, float]:
    first, second = pair(name, values)
    return scalar(name, first), scalar(name, second)


def _flags(values: Sequence[bool]) -> tuple[bool, bool]:
    first, second = pair("periodic", values)
    for value in (first, second):
        if isinstance(value, str) or value not in (False, True):
            raise ValueError(f"`periodic` is {values!r}, but must be two truth values, one an axis")
    return bool(first), bool(second)


def _extra(name: str) -> Any:
    """An optional package."""
    import importlib

    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(f"this needs {name}: pip install 'driftmesh[{name}]'") from error
