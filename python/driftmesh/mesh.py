"""Meshes of lines and of the plane, and their quality."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _boxes, _driftmesh, _exchange, _points
from ._arrays import Floats, count, finite
from .quality import Quality

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Mesh(_points.Points):
    """A mesh of intervals or quadrilaterals over a box or another shape: the position of every node of a lattice.

    Args:
        x: Positions of the nodes, shape (nx + 1, ny + 1), nx and ny at least 2, first index along ξ; for a line shape
            (nx + 1,), with x rising.
        y: The same; left out for a line.
        lower: Lower corner of the box, one number an axis; by default that of the smallest box around the nodes. Give
            it where the first nodes of a periodic axis have moved away from the corner.
        upper: Upper corner of the box; by default that of the smallest box around the nodes, and along a periodic axis
            as far from ``lower`` as the last nodes are from the first.
        periodic: Which axes wrap around. The last node of such an axis is its first one, shifted by the box. Where
            it is the first one itself, the axis is closed.
        closed: Which axes are closed, as in a ring: their last nodes are their first ones again. The mesh is then
            :meth:`mapped`.

    Raises:
        ValueError: Shapes that differ, values that are not finite, a box without extent, last nodes of a periodic axis
            that are not its first ones shifted by the box, or a mesh whose second index goes along x.

    One number for ``lower``, ``upper`` or ``periodic`` stands for every axis. A mesh does not change; :meth:`moved`
    gives another one. It may have folded cells: :meth:`quality` tells, and functions that need a mesh without them
    raise :class:`driftmesh.errors.MeshFolded`.

    >>> from driftmesh import Mesh
    >>> mesh = Mesh.uniform(cells=(4, 2), upper=(1, 3))
    >>> mesh.x.shape, mesh.y[1, 1]
    ((5, 3), np.float64(1.5))
    >>> Mesh([0, 0.5, 0.75, 1])
    <Mesh of 3 cells, lower=(0.0,), upper=(1.0,)>
    """

    __slots__ = ("_chart", "_lower", "_nodes", "_periodic", "_places", "_upper")

    _nodes: Floats
    _chart: _driftmesh.Chart | None
    _places: Floats | None
    _lower: tuple[float, ...]
    _upper: tuple[float, ...]
    _periodic: tuple[bool, ...]

    def __init__(
        self,
        x: ArrayLike,
        y: ArrayLike | None = None,
        *,
        lower: float | Sequence[float] | None = None,
        upper: float | Sequence[float] | None = None,
        periodic: bool | Sequence[bool] = False,
        closed: bool | Sequence[bool] = False,
    ) -> None:
        first = finite("x", x)
        dimensions = 1 if y is None else 2
        if first.ndim != dimensions or min(first.shape) < 3:
            axes = "one axis of 3 nodes or more: (nx + 1,), or `y` beside it"
            axes = axes if y is None else "two axes of 3 nodes or more: (nx + 1, ny + 1); leave `y` out for a line"
            raise ValueError(f"`x` has shape {first.shape}, but must have {axes}")
        coordinates = [first] if y is None else [first, finite("y", y, first.shape, "`x`")]
        wraps = _boxes.flags(periodic, dimensions)
        nodes = np.stack(coordinates, axis=-1)
        meets = _boxes.closed(nodes, wraps, _boxes.flags(closed, dimensions, "closed"))
        if any(meets):
            self.__setstate__(self.mapped(*coordinates, closed=meets).__getstate__())
            return
        low, high = _boxes.box(nodes, lower, upper, wraps)
        _boxes.refuse_mirrored(nodes)
        _boxes.close(nodes, low, high, wraps)
        # the checks of the library: a box with an extent
        _driftmesh.uniform([n - 1 for n in first.shape], low, high, wraps)
        self._set(nodes, low, high, wraps)

    def _set(
        self,
        nodes: Floats,
        lower: tuple[float, ...],
        upper: tuple[float, ...],
        periodic: tuple[bool, ...],
        chart: _driftmesh.Chart | None = None,
        places: Floats | None = None,
    ) -> None:
        nodes.flags.writeable = False
        self._nodes, self._lower, self._upper, self._periodic = nodes, lower, upper, periodic
        self._chart, self._places = chart, places

    @classmethod
    def _of(cls, nodes: Floats, like: Mesh) -> Mesh:
        """Nodes that the library computed, in the box or in the domain of another mesh."""
        mesh = cls.__new__(cls)
        if like._chart is None:
            mesh._set(nodes, like._lower, like._upper, like._periodic)
        else:
            mesh._place(nodes, like._periodic, like._chart)
        return mesh

    def _place(self, places: Floats, closed: tuple[bool, ...], chart: _driftmesh.Chart) -> None:
        """The image of places in the unit square."""
        places.flags.writeable = False
        lower, upper = chart.ends()
        self._set(chart.positions(places), tuple(lower), tuple(upper), closed, chart, places)

    @classmethod
    def mapped(
        cls,
        x: ArrayLike | str | PathLike[str],
        y: ArrayLike | str | None = None,
        *,
        cells: int | Sequence[int] | NDArray[np.integer[Any]] | None = None,
        closed: bool | Sequence[bool] = False,
    ) -> Mesh:
        """A mesh of a domain that is no box: the image of equal cells of the unit square.

        Args:
            x: x of the nodes of a structured mesh, shape (nx + 1, ny + 1); or x as a formula of s and r in the unit
                square, such as ``"(1 + s)*cos(pi*r)"``; or the path of a file with a structured mesh: ``.npz`` with
                arrays x and y, ``.vts``, or a block of PLOT3D, ``.xyz`` or ``.x``.
            y: The same for y; left out for a file.
            cells: (nx, ny); by default those of the structured mesh. Formulas need it.
            closed: Which axes are closed, so that their ends are the same curve, as in a mesh around an aerofoil. The
                last nodes of such an axis are its first ones again. A closed axis that would turn the cells over is
                taken from its other end.

        Between the nodes of a structured mesh the domain goes on smoothly, with order 4: the nodes of moved meshes
        slide along its sides. Where both axes are open, formulas of s and r make the one of them the first axis that
        turns into the other against the clock.

        Raises:
            ValueError: A map or a mesh that folds, an axis whose ends do not meet, values that are not finite, or a
                file that holds no structured mesh.

        >>> import numpy as np
        >>> from driftmesh import Mesh, MeshGenerator
        >>> ring = Mesh.mapped("(1 + s)*cos(2*pi*r)", "(1 + s)*sin(2*pi*r)", cells=(20, 60), closed=(False, True))
        >>> moved = MeshGenerator().step(ring, np.tanh(20 * (ring.x - 0.5)), dt=0.1)
        >>> bool(np.allclose(np.hypot(moved.x[0], moved.y[0]), 1, atol=1e-14))
        True
        """
        wraps = _boxes.flags(closed, 2, "closed")
        numbers = None if cells is None else [count("cells", n) for n in _boxes.each_axis("cells", cells, 2)]
        if isinstance(x, str) and isinstance(y, str):
            if numbers is None:
                raise ValueError("`cells` is not given, but a map by formulas needs it: (nx, ny)")
            chart = _driftmesh.Chart.formulas(x, y, wraps)
        else:
            nodes = _boxes.structured(x, y)
            chart = _driftmesh.Chart.nodes(nodes, wraps)
            numbers = [nodes.shape[0] - 1, nodes.shape[1] - 1] if numbers is None else numbers
        mesh = cls.__new__(cls)
        mesh._place(_driftmesh.uniform(numbers, (0.0, 0.0), (1.0, 1.0), wraps), wraps, chart)
        least = mesh.quality().min_scaled_jacobian
        if not least > 0:
            raise ValueError(
                f"the map folds: the smallest corner Jacobian is {least} of that of equal cells; no point may be met "
                "twice, and cells must follow the curves"
            )
        return mesh

    @classmethod
    def uniform(
        cls,
        cells: int | Sequence[int] | NDArray[np.integer[Any]],
        lower: float | Sequence[float] = 0.0,
        upper: float | Sequence[float] = 1.0,
        periodic: bool | Sequence[bool] = False,
    ) -> Mesh:
        """The mesh of equal cells.

        Args:
            cells: (nx, ny), cells along ξ and η, or one number for a line; at least 2 along bounded axes.
            lower: Lower corner of the box, in the unit of length.
            upper: Upper corner.
            periodic: Which axes wrap around.

        Raises:
            ValueError: Fewer than 2 cells, or a box without extent.

        >>> from driftmesh import Mesh
        >>> Mesh.uniform(cells=(40, 20)).x.shape
        (41, 21)
        >>> Mesh.uniform(cells=80, upper=2.0).x[:3]
        array([0.   , 0.025, 0.05 ])
        """
        dimensions = 1 if np.size(cells) == 1 else 2
        numbers = [count("cells", n) for n in _boxes.each_axis("cells", cells, dimensions)]
        low, high = _boxes.corner("lower", lower, dimensions), _boxes.corner("upper", upper, dimensions)
        wraps = _boxes.flags(periodic, dimensions)
        mesh = cls.__new__(cls)
        mesh._set(_driftmesh.uniform(numbers, low, high, wraps), low, high, wraps)
        return mesh

    @property
    def x(self) -> Floats:
        """x of the nodes, shape (nx + 1, ny + 1), of a line (nx + 1,): a view that cannot be written."""
        view: Floats = self._nodes[..., 0]
        return view

    @property
    def y(self) -> Floats:
        """y of the nodes, shape (nx + 1, ny + 1): a view that cannot be written.

        Raises:
            AttributeError: The mesh is a line, which has x alone.
        """
        if self.dimensions == 1:
            raise AttributeError("`y` is no attribute of a mesh of a line, whose nodes have x alone")
        view: Floats = self._nodes[..., 1]
        return view

    @property
    def dimensions(self) -> int:
        """1 for a line, 2 in the plane."""
        return len(self._periodic)

    @property
    def shape(self) -> tuple[int, ...]:
        """(nx + 1, ny + 1), of a line (nx + 1,): the shape of every array over the mesh."""
        return self._nodes.shape[:-1]

    @property
    def cells(self) -> tuple[int, ...]:
        """(nx, ny), of a line (nx,)."""
        return tuple(n - 1 for n in self.shape)

    @property
    def lower(self) -> tuple[float, ...]:
        """Lower corner of the box, one entry an axis."""
        return self._lower

    @property
    def upper(self) -> tuple[float, ...]:
        """Upper corner of the box, one entry an axis."""
        return self._upper

    @property
    def periodic(self) -> tuple[bool, ...]:
        """Which axes wrap around, by a shift by the box."""
        return tuple(wraps and self._chart is None for wraps in self._periodic)

    @property
    def closed(self) -> tuple[bool, ...]:
        """Which axes are closed, so that their ends are the same curve."""
        return tuple(wraps and self._chart is not None for wraps in self._periodic)

    @property
    def areas(self) -> Floats:
        """Area of the dual cell of each node, in the square of the unit of length, shape (nx + 1, ny + 1); on a line
        its length, shape (nx + 1,).

        ``(u * mesh.areas).sum()`` is the integral of u that a conservative :func:`transfer` keeps. The last nodes of a
        periodic axis are its first ones: their area is 0.

        >>> from driftmesh import Mesh
        >>> float(Mesh.uniform(cells=(8, 8), upper=(2, 3)).areas.sum())
        6.0
        """
        return _driftmesh.areas(self._given())

    def moved(self, x: ArrayLike, y: ArrayLike | None = None) -> Mesh:
        """The same lattice and box with other positions; in a domain that is no box, the mesh that is mapped by them.

        Args:
            x: Positions of the nodes, shape (nx + 1, ny + 1), of a line (nx + 1,).
            y: The same; left out for a line.

        Raises:
            ValueError: Another shape, values that are not finite, or last nodes of a periodic axis that are not its
                first ones shifted by the box.

        >>> from driftmesh import Mesh
        >>> mesh = Mesh.uniform(cells=(4, 4))
        >>> mesh.moved(mesh.x**2, mesh.y).x[2, 0]
        np.float64(0.25)
        """
        if self._chart is not None:
            return self.mapped(x, y, closed=self.closed)
        given = zip("xy", _points.coordinates(self.dimensions, x, y))
        nodes = np.stack([finite(name, values, self.shape) for name, values in given], axis=-1)
        _boxes.close(nodes, self._lower, self._upper, self._periodic)
        return self._of(nodes, self)

    def quality(self, density: ArrayLike | None = None) -> Quality:
        """How good the mesh is.

        Args:
            density: ρ at the nodes, of the shape of the mesh, for ``equidistribution``; by default ρ = 1.

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
        """The mesh as a ``meshio.Mesh`` of quadrilaterals or lines, with fields by name: nodal ones of the shape of the
        mesh, and those with one value a cell, one less along each axis.

        Raises:
            ImportError: meshio is not there.

        >>> from driftmesh import Mesh
        >>> Mesh.uniform(cells=(4, 4)).to_meshio().cells_dict["quad"].shape
        (16, 4)
        """
        return _exchange.to_meshio(self, fields)

    def to_pyvista(self, **fields: ArrayLike) -> Any:
        """The mesh as a ``pyvista.StructuredGrid``, with fields by name: nodal ones of the shape of the mesh, and those
        with one value a cell, one less along each axis.

        Raises:
            ImportError: pyvista is not there.

        >>> from driftmesh import Mesh
        >>> Mesh.uniform(cells=(4, 4)).to_pyvista().n_cells
        16
        """
        return _exchange.to_pyvista(self, fields)

    def to_xarray(self, **fields: ArrayLike) -> Any:
        """The fields as an ``xarray.Dataset`` over the lattice, with the coordinates x and y of the nodes: nodal fields
        of the shape of the mesh along i and j, and those with one value a cell along cell_i and cell_j.

        Raises:
            ImportError: xarray is not there.

        >>> from driftmesh import Mesh
        >>> mesh = Mesh.uniform(cells=(4, 4))
        >>> dict(mesh.to_xarray(u=mesh.x).sizes)
        {'i': 5, 'j': 5}
        """
        return _exchange.to_xarray(self, fields)

    def plot(self, u: ArrayLike | None = None, ax: Axes | None = None) -> Axes:
        """Draws the mesh over colours for u of its shape, if that is given; a line as u over its nodes. Needs
        matplotlib.

        Raises:
            ImportError: matplotlib is not there.

        >>> from driftmesh import Mesh
        >>> mesh = Mesh.uniform(cells=(4, 4))
        >>> mesh.plot(mesh.x).get_aspect()
        1.0
        """
        from . import plot

        return plot.mesh(self, None if u is None else finite("u", u, self.shape), ax)

    def _given(self) -> tuple[Floats, _boxes.Corner, _boxes.Corner, _boxes.Flags, _driftmesh.Chart | None]:
        """The mesh in its box, or the places of its nodes in the unit square with the domain that is its image."""
        if self._places is not None:
            return self._places, (0.0, 0.0), (1.0, 1.0), self._periodic, self._chart
        return self._nodes, self._lower, self._upper, self._periodic, None

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Mesh):
            return NotImplemented
        same = self._given()[1:] == other._given()[1:]
        return same and np.array_equal(self._nodes, other._nodes)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        wraps = f", periodic={self.periodic}" if any(self.periodic) else ""
        wraps += f", closed={self.closed}" if any(self.closed) else ""
        cells = " × ".join(str(n) for n in self.cells)
        return f"<Mesh of {cells} cells, lower={self._lower}, upper={self._upper}{wraps}>"

    def __getstate__(self) -> tuple[Any, ...]:
        return self._nodes, self._lower, self._upper, self._periodic, self._chart, self._places

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        self._set(*state)

