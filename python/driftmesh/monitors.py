"""Monitors: where a mesh should be fine, from the solution on it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import Floats, scalar
from ._toml import Kind

if TYPE_CHECKING:
    from .mesh import Mesh

#: A monitor of u, or a function of mesh and u that gives the density.
Part: TypeAlias = "MonitorKind | Largest | Limited | Callable[[Mesh, Any], ArrayLike]"


class MonitorKind(Kind):
    """A monitor of the library. ``a | b`` is the larger of two: :class:`Largest`."""

    def __or__(self, other: Part) -> Largest:
        return Largest(self, other)

    def __ror__(self, other: Part) -> Largest:
        return Largest(other, self)


class Largest:
    """The largest of several densities at each node, each divided by its mean over the domain.

    Args:
        monitors: Monitors, or functions of mesh and u that give a density.

    ``u`` of :meth:`MeshGenerator.step` is then one field for all of them, or one for each: a tuple, or an array with
    one field along its first axis. ``u0`` of :meth:`MeshGenerator.adapt` is a function that returns that.

    Raises:
        ValueError: There is no monitor, or one is no monitor; when it is used, the number of fields is another one.

    >>> import numpy as np
    >>> from driftmesh import Arclength, Mesh, MeshGenerator, RootGradient
    >>> mesh, generator = Mesh.uniform(cells=(20, 20)), MeshGenerator(monitor=RootGradient() | RootGradient())
    >>> for _ in range(20):
    ...     mesh = generator.step(mesh, (np.tanh(50 * (mesh.x - 0.3)), np.tanh(50 * (mesh.x - 0.8))), dt=0.01)
    >>> layers = np.interp([0.3, 0.8], mesh.x[1:, 0], np.diff(mesh.x[:, 0]))
    >>> bool((layers < 0.5 / 20).all())  # finer in the layers of both
    True
    """

    def __init__(self, *monitors: Part) -> None:
        for monitor in monitors:
            known = isinstance(monitor, (MonitorKind, Limited)) or callable(monitor)
            if isinstance(monitor, type) or not known:
                raise ValueError(f"a monitor is {monitor!r}, but must be Arclength(…), RootGradient(), … or a function")
        if not monitors:
            raise ValueError("there is no monitor to take the largest of")
        self.monitors = monitors

    def __or__(self, other: Part) -> Largest:
        return Largest(*self.monitors, other)

    def __ror__(self, other: Part) -> Largest:
        return Largest(other, *self.monitors)

    def __call__(self, mesh: Mesh, u: Any) -> Floats:
        """The density at the nodes."""
        from .generators import MeshGenerator

        several = isinstance(u, Sequence) or (isinstance(u, np.ndarray) and u.ndim == len(mesh.shape) + 1)
        fields = list(u) if several else [u] * len(self.monitors)
        if len(fields) != len(self.monitors):
            raise ValueError(f"there are {len(fields)} fields for {len(self.monitors)} monitors, but must be as many")
        areas = mesh.areas
        largest = np.zeros(mesh.shape)
        for monitor, field in zip(self.monitors, fields, strict=True):
            rho = MeshGenerator(monitor=monitor).density(mesh, field)
            largest = np.maximum(largest, rho / ((rho * areas).sum() / areas.sum()))
        return largest

    def __repr__(self) -> str:
        return " | ".join(repr(monitor) for monitor in self.monitors)


class Limited:
    """Any monitor, with limits on how small and how large cells may be

    ::

        m/largest ≤ ρ ≤ m/smallest   along every mesh line, m = the mean of ρ there

    At rest an edge has the length m/ρ, in units of the mean edge of its mesh line: on a line the limits are met
    exactly, in the plane, where mesh lines are tied to their neighbours, nearly.

    Args:
        monitor: A monitor, a function of mesh and u that gives a density, or a density.
        smallest: The smallest edge as a share of the mean one, above 0 and below 1: ``0.2`` on a line of N cells and
            the length L is 0.2 L/N. None for no limit.
        largest: The largest edge as a multiple of the mean one, above 1. None for no limit.

    Raises:
        ValueError: A limit out of range, none at all, or a monitor that has limits already.

    >>> import numpy as np
    >>> from driftmesh import Limited, Mesh, MeshGenerator, RootGradient
    >>> generator = MeshGenerator(monitor=Limited(RootGradient(), smallest=0.25))
    >>> line = generator.adapt(Mesh.uniform(cells=40), lambda x: np.tanh(500 * (x - 0.4)))
    >>> round(40 * float(np.diff(line.x).min()), 2)
    0.25
    """

    def __init__(
        self,
        monitor: Part | ArrayLike,
        *,
        smallest: float | None = None,
        largest: float | None = None,
    ) -> None:
        if isinstance(monitor, (Limited, type, str)) or monitor is None:
            raise ValueError(f"`monitor` is {monitor!r}, but must be Arclength(…), … without limits, or a density")
        if smallest is None and largest is None:
            raise ValueError("there is no limit; give `smallest`, `largest` or both")
        if smallest is not None and not 0 < scalar("smallest", smallest) < 1:
            raise ValueError(f"`smallest` is {smallest}, but must be above 0 and below 1: a share of an equal cell")
        if largest is not None and not scalar("largest", largest) > 1:
            raise ValueError(f"`largest` is {largest}, but must be above 1: a multiple of an equal cell")
        self.monitor, self.smallest, self.largest = monitor, smallest, largest

    def __or__(self, other: Part) -> Largest:
        return Largest(self, other)

    def __ror__(self, other: Part) -> Largest:
        return Largest(other, self)

    def __repr__(self) -> str:
        return f"Limited({self.monitor!r}, smallest={self.smallest}, largest={self.largest})"


@dataclass(frozen=True)
class WithCells(Kind):
    """A monitor with its limits, as a table of a study."""

    monitor: Kind
    smallest: float | None
    largest: float | None

    def _table(self) -> dict[str, Any]:
        return {**self.monitor._table(), "cells": {"smallest": self.smallest, "largest": self.largest}}


@dataclass(frozen=True)
class _WithStrength(MonitorKind):
    """What monitors with a strength α have in common."""

    _strength: ClassVar[float]
    relative: float | None = None
    absolute: float | None = None
    smoothing: int = 2
    gradient: Literal["central", "log", "safe"] = "central"

    def __post_init__(self) -> None:
        if self.relative is not None and self.absolute is not None:
            raise ValueError(f"give `relative` or `absolute`, not both: {self.relative} and {self.absolute}")

    def _table(self) -> dict[str, Any]:
        relative = self._strength if self.relative is None and self.absolute is None else self.relative
        strength = {"relative": relative, "absolute": self.absolute}
        return {"kind": self.kind, "strength": strength, "smoothing": self.smoothing, "gradient": self.gradient}


@dataclass(frozen=True)
class Arclength(_WithStrength):
    """ρ = √(1 + α|∇u|²), smoothed.

    Args:
        relative: α as a multiple of 1/max|∇u|²; 30 where neither this nor ``absolute`` is given.
        absolute: α itself, in the unit (x/u)².
        smoothing: Passes of the filter (1 2 1)⊗(1 2 1)/16 over ρ.
        gradient: Difference scheme for ∇ρ/ρ in a generator with ``form="gradient"``: central differences of ρ
            (``"central"``) or of ln ρ (``"log"``), or bounded ones that suit random walks (``"safe"``).

    Raises:
        ValueError: Both are given. Numbers out of range are refused by the generator.

    >>> from driftmesh import Arclength
    >>> Arclength(relative=30, smoothing=2).smoothing
    2
    """

    kind = "arclength"
    _strength = 30.0


@dataclass(frozen=True)
class Curvature(_WithStrength):
    """ρ = (1 + α |H|²)^(1/(d + 4)), smoothed, H being the second derivatives of u in d dimensions.

    It spreads the L² error of linear interpolation evenly: cells of width 1/ρ have the same h^(d + 4) |H|². Monitors of
    ∇u put most nodes where u is steepest, where an error of interpolation need not be.

    Args:
        relative: α as a multiple of 1/⟨|H|^(2/(d + 4))⟩^(d + 4), ⟨⟩ being the mean over the domain: 1, the default
            where neither this nor ``absolute`` is given, gives about half of the nodes to where u is curved.
        absolute: α itself, in the unit (x²/u)².
        smoothing: Passes of the filter (1 2 1)⊗(1 2 1)/16 over ρ.
        gradient: As of :class:`Arclength`.

    Raises:
        ValueError: Both are given. Numbers out of range are refused by the generator.

    Source: Huang and Russell, *Adaptive Moving Mesh Methods*, Springer (2011), where ρ^d, the density of volume, has
    the exponent d/(d + 4).

    >>> from driftmesh import Curvature, Mesh, MeshGenerator
    >>> line = Mesh.uniform(cells=8)
    >>> rho = MeshGenerator(monitor=Curvature(absolute=0.5)).density(line, 4 * line.x**2)  # u'' = 8
    >>> bool(abs(rho - 33**0.2).max() < 1e-12)
    True
    """

    kind = "curvature"
    _strength = 1.0


@dataclass(frozen=True)
class RootGradient(MonitorKind):
    """ρ = 1 + 4 √|u_x| / mean of √|u_x|, smoothed, with nothing to set: ``monitor.kind = "auto"`` of a study.

    In the plane there is one such density for each axis, the second with u_y: layers that lie across different axes
    draw their own nodes each.

    >>> from driftmesh import MeshGenerator, RootGradient
    >>> MeshGenerator().monitor == RootGradient()
    True
    """

    kind = "auto"


@dataclass(frozen=True)
class Given(MonitorKind):
    """Takes u as the density itself: positive at every node. ``smoothing`` counts passes of the filter over it.

    >>> from driftmesh import Given, Mesh, MeshGenerator
    >>> mesh = Mesh.uniform(cells=(8, 8))
    >>> new = MeshGenerator(monitor=Given()).step(mesh, 1 + 3 * mesh.x, dt=0.1)
    >>> bool(new.x[4, 4] > 0.5)  # more nodes where the density is larger
    True
    """

    kind = "given"
    smoothing: int = 0
    gradient: Literal["central", "log", "safe"] = "central"
