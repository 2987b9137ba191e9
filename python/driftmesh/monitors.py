"""Monitors: where a mesh should be fine, from the solution on it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import Floats
from ._toml import Kind

if TYPE_CHECKING:
    from .mesh import Mesh

#: A monitor of u, or a function of mesh and u that gives the density.
Part: TypeAlias = "MonitorKind | Largest | Callable[[Mesh, Any], ArrayLike]"


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
            if isinstance(monitor, type) or not (isinstance(monitor, MonitorKind) or callable(monitor)):
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


@dataclass(frozen=True)
class Arclength(MonitorKind):
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
    relative: float | None = None
    absolute: float | None = None
    smoothing: int = 2
    gradient: Literal["central", "log", "safe"] = "central"

    def __post_init__(self) -> None:
        if self.relative is not None and self.absolute is not None:
            raise ValueError(f"give `relative` or `absolute`, not both: {self.relative} and {self.absolute}")

    def _table(self) -> dict[str, Any]:
        strength = {"relative": self.relative, "absolute": self.absolute}
        if self.relative is None and self.absolute is None:
            strength["relative"] = 30.0
        return {"kind": self.kind, "strength": strength, "smoothing": self.smoothing, "gradient": self.gradient}


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
