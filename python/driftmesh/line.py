"""One dimension: meshes that equidistribute a density, on the whole line or by Schwarz's method."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _driftmesh, _toml
from ._arrays import Floats, count, finite, pair, real, scalar, word

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: M(x) > 0: a function of an array of places, a formula of x, a table ``[density]`` of a study, values of M at equal
#: distances over the domain, or a pair of arrays, places and values.
Density: TypeAlias = "Callable[[Floats], ArrayLike] | str | Mapping[str, str] | ArrayLike | tuple[ArrayLike, ArrayLike]"
Faces = Literal["trapezoid", "midpoint", "exact"]


def equidistribute(
    density: Density,
    cells: int,
    *,
    domain: Sequence[float] = (0.0, 1.0),
    face_density: Faces = "exact",
    points: Sequence[float] | NDArray[Any] | None = None,
) -> Floats:
    """The mesh on which every cell has the same share of ∫M.

    Args:
        density: M(x) > 0, as a function of an array of places, a formula such as ``"x^2 + 1"``, or a table such as
            ``{"kind": "arclength", "of": "tanh(20*x)"}``. Samples of M are taken as piecewise linear: an array of
            values at equal distances over the domain, or a pair of arrays (places, values). A place that comes twice
            is a jump.
        cells: Number of cells, at least 2.
        domain: Ends of the line, in the unit of length.
        face_density: How M is averaged over a cell: ``"exact"``, by its integral, or ``"trapezoid"`` and
            ``"midpoint"``, from values at two nodes or one. These differ little where M varies little within a cell.
        points: Places of spikes of M that are thinner than a few thousandths of the line and could be overlooked.

    Returns:
        The nodes, shape (cells + 1,), in order from end to end.

    Raises:
        ValueError: Wrong shapes or values; a density that is not finite and positive somewhere
            (:class:`driftmesh.errors.LineDensity`).
        driftmesh.errors.LineUnresolved: A layer is so thin that neighbouring nodes would be the same number.

    >>> from driftmesh import equidistribute
    >>> x = equidistribute(lambda x: x**2 + 1, 100)
    >>> round(float(x[50]), 4)  # 0.59607… in the continuum
    0.5961
    """
    ends = _ends(domain)
    given = _density(density, ends)
    faces = word("face_density", face_density, get_args(Faces))
    settings = _toml.document({"equidistribution": {"face_density": faces, "points": _points(points)}})
    return _driftmesh.equidistribute(given, _cells(cells), ends, settings)


@dataclass(frozen=True, eq=False, repr=False)
class SchwarzResult:
    """How a Schwarz iteration went.

    Entry n of every array over the iterations belongs to iterate n, and entry 0 to the start.

    Attributes:
        mesh: The glued mesh of the last iterate, shape (cells + 1,).
        reference: The discrete mesh of the whole line.
        error: Largest distance of a node of any subdomain from ``reference``, by iteration.
        increment: Largest distance of a node from its place in the previous iterate, by iteration.
        largest_jump: 2 max|u_i − u_{i−1}| over the nodes, where M is the arc length of u; else NaN.
        interpolation_error: Largest error of the piecewise linear interpolant of u, where M is its arc length; else
            NaN.
        linear_solves: Number of tridiagonal systems solved up to each iteration.
        observed: Factor by which two iterations reduced the error; None where too few were done to tell.
        predicted: The same factor by theory; None where there is none for the case.
        bound: An upper bound of that factor by theory; None where there is none for the case.

    >>> from driftmesh import schwarz
    >>> result = schwarz("x^2 + 1", 20, overlap=(0.4, 0.6), iterations=3)
    >>> result.mesh.shape, result.error.shape
    ((21,), (4,))
    """

    mesh: Floats
    reference: Floats
    error: Floats
    increment: Floats
    largest_jump: Floats
    interpolation_error: Floats
    linear_solves: Floats
    observed: float | None
    predicted: float | None
    bound: float | None

    @property
    def iterations(self) -> int:
        """Iterations done."""
        return len(self.error) - 1

    def __repr__(self) -> str:
        rate = "" if self.observed is None else f", observed={self.observed:.4g}"
        cells, error = len(self.mesh) - 1, self.error[-1]
        return f"<SchwarzResult of {cells} cells, iterations={self.iterations}, error={error:.1e}{rate}>"

    def plot(self, ax: Axes | None = None, **line: Any) -> Axes:
        """Draws the error over the iterations; needs matplotlib. ``line`` goes to ``Axes.semilogy``."""
        from . import plot

        return plot.convergence(self.error, ax, **line)


def schwarz(
    density: Density,
    cells: int,
    *,
    method: Literal["classical", "optimal", "optimized", "optimised"] = "classical",
    overlap: Sequence[float] | NDArray[Any] | None = None,
    intervals: Sequence[Sequence[float]] | NDArray[Any] | None = None,
    cut: float | None = None,
    cuts: Sequence[float] | NDArray[Any] | None = None,
    subdomains: int | None = None,
    overlap_cells: int | None = None,
    sweep: Literal["parallel", "alternating"] | None = None,
    linearized: bool | None = None,
    coarse: Literal["none", "galerkin", "integral"] | None = None,
    robin: float | Literal["auto", "lagged"] | None = None,
    integral: Literal["exact"] | Mapping[str, int] | None = None,
    iterations: int | None = None,
    tolerance: float | None = None,
    measure: Literal["error", "increment"] = "error",
    start: ArrayLike | Callable[[Floats], ArrayLike] | None = None,
    domain: Sequence[float] = (0.0, 1.0),
    face_density: Faces | None = None,
    points: Sequence[float] | NDArray[Any] | None = None,
) -> SchwarzResult:
    """Equidistributes a line subdomain by subdomain, and iterates until neighbours agree (Schwarz's method).

    The subdomains are given by ``overlap``, ``intervals``, ``cut``, ``cuts`` or ``subdomains``: exactly one of these,
    in ξ from 0 to 1, with every end at a node. Arguments are named as in a study of kind ``equidistribution``.

    Args:
        density: As for :func:`equidistribute`.
        cells: Number of cells of the whole line.
        method: ``"classical"`` exchanges node positions between overlapping subdomains; ``"optimal"`` and
            ``"optimized"`` exchange fluxes between subdomains that meet in one node.
        overlap: (α, β): two subdomains, [0, β] and [α, 1].
        intervals: Any number of overlapping subdomains, as [first, last] each.
        cut: The node at which two subdomains meet.
        cuts: The nodes at which any number of subdomains meet.
        subdomains: Number of subdomains of equal width.
        overlap_cells: Cells that neighbours share; with ``subdomains`` only.
        sweep: Classical: all subdomains at once (``"parallel"``) or one after the other (``"alternating"``).
        linearized: Classical: takes M from the previous iterate, so that a subdomain costs one linear solve.
        coarse: Classical: a coarse correction. ``"integral"`` makes the number of iterations independent of the number
            of subdomains; ``"galerkin"`` does so where the density varies little within a cell.
        robin: Optimized: p in the condition F ± p x at a cut; ``"auto"`` and ``"lagged"`` choose it from M.
        integral: Optimal: how ∫M over the rest of the line is computed, ``"exact"`` or ``{"trapezoid": panels}``.
        iterations: Number of iterations; with a tolerance the largest number, 500 by default.
        tolerance: Ends the iteration once ``measure`` is below it; 1e-10 where ``iterations`` is not given either.
        measure: ``"error"``, the distance from the discrete mesh of the whole line, or ``"increment"``, the change in
            an iteration; both as shares of the length of the line.
        start: The first mesh, shape (cells + 1,), or a function of ξ from 0 to 1 that gives it; by default equal cells.
        domain: Ends of the line.
        face_density: As for :func:`equidistribute`. The default is ``"exact"`` for arrays, which may vary much from
            cell to cell, and ``"trapezoid"``, as published, for formulas and functions.
        points: As for :func:`equidistribute`.

    Raises:
        ValueError: Wrong shapes or values, or subdomains that do not fit the line.
        driftmesh.errors.NotConverged: The tolerance was missed; ``result`` of the exception holds the iterates so far.

    >>> from driftmesh import schwarz
    >>> result = schwarz("x^2 + 1", 100, overlap=(0.4, 0.6))
    >>> result.iterations, round(result.predicted, 4)
    (53, 0.4444)
    """
    table = {
        "method": word("method", method, ("classical", "optimal", "optimised")).replace("optimised", "optimized"),
        "overlap": overlap,
        "intervals": intervals,
        "cut": cut,
        "cuts": cuts,
        "subdomains": subdomains,
        "overlap_cells": overlap_cells,
        "sweep": sweep,
        "linearized": linearized,
        "coarse": coarse,
        "robin": robin,
        "integral": integral,
    }
    stop = {"iterations": iterations, "tolerance": tolerance, "measure": measure}
    ends, n = _ends(domain), _cells(cells)
    given = _density(density, ends)
    averages = {"face_density": _faces(face_density, density), "points": _points(points)}
    settings = _toml.document({"equidistribution": averages, "schwarz": table, "stop": stop})
    columns, meshes, rates, missed = _driftmesh.schwarz(given, n, ends, settings, _start(start, n, ends))
    result = SchwarzResult(*meshes, *columns, *rates)
    if missed is not None:
        missed.result = result
        raise missed
    return result


def _faces(wanted: Faces | None, density: Density) -> str:
    """How M is averaged over a cell: samples may be rough within it, so that few values of them say little."""
    sampled = not callable(density) and not isinstance(density, (str, Mapping))
    return word("face_density", wanted or ("exact" if sampled else "trapezoid"), get_args(Faces))


def _points(points: Any) -> list[float] | None:
    if points is None:
        return None
    given: list[float] = finite("points", np.atleast_1d(points)).tolist()
    return given


def _cells(cells: int) -> int:
    if count("cells", cells) < 2:
        raise ValueError(f"`cells` is {cells}, but must be 2 or more")
    return int(cells)


def _ends(domain: Sequence[float]) -> tuple[float, float]:
    try:
        first, second = domain
    except (TypeError, ValueError):
        raise ValueError(f"`domain` is {domain!r}, but must be the two ends of the line") from None
    low, high = scalar("domain", first), scalar("domain", second)
    if not low < high:
        raise ValueError(f"`domain` is ({low}, {high}), but must go from left to right")
    return low, high


def _start(start: Any, cells: int, ends: tuple[float, float]) -> list[float] | None:
    if start is None:
        return None
    if callable(start):
        xi = np.linspace(0.0, 1.0, cells + 1)
        start = ends[0] + (ends[1] - ends[0]) * finite("start", start(xi), xi.shape, "ξ")
    mesh: list[float] = finite("start", start, (cells + 1,), "the line").tolist()
    return mesh


def _density(density: Any, ends: tuple[float, float]) -> Any:
    """A density as the library takes it: a kind and a formula, places and values, or a function."""
    if isinstance(density, str):
        return "formula", density
    if isinstance(density, Mapping):
        keys = {"formula": "value", "arclength": "of"}
        kind = density.get("kind", "formula")
        known = keys.get(kind) if isinstance(kind, str) else None
        if set(density) - {"kind"} != {known} or not isinstance(density[known], str):
            raise ValueError(
                f"`density` is {dict(density)}, but must be a table such as {{'kind': 'arclength', 'of': 'x^2'}}"
            )
        return kind, density[known]
    if not callable(density):
        return _sampled(density, ends)

    def function(places: Floats) -> Floats:
        values = real("density", density(places))
        if values.shape not in ((), places.shape):
            raise ValueError(f"the density has shape {values.shape}, but was asked for places of shape {places.shape}")
        return np.ascontiguousarray(np.broadcast_to(values, places.shape))

    return function


def _sampled(density: Any, ends: tuple[float, float]) -> tuple[list[float], list[float]]:
    if isinstance(density, tuple):
        given, samples = pair("density", density)
        places = finite("places of the density", given)
        values = finite("density", samples, places.shape, "its array of places")
        if places.ndim != 1 or len(places) < 2:
            raise ValueError(
                f"the places of the density have shape {places.shape}, but must be one array of two or more"
            )
        if places[0] > ends[0] or places[-1] < ends[1]:
            raise ValueError(
                f"the density is known from {places[0]} to {places[-1]}, but the line goes from {ends[0]} to {ends[1]}"
            )
    else:
        values = finite("density", density)
        if values.ndim != 1 or len(values) < 2:
            raise ValueError(f"`density` has shape {values.shape}, but must be one array of two values or more")
        places = np.linspace(*ends, len(values))
    if not (values > 0).all():
        raise ValueError(f"`density` is {values.min()} at index {values.argmin()}, but must be above 0")
    return places.tolist(), values.tolist()
