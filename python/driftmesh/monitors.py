"""Monitors: where a mesh should be fine, from the solution on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from ._toml import Kind


@dataclass(frozen=True)
class Arclength(Kind):
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
class RootGradient(Kind):
    """ρ = 1 + 4 √|u_x| / mean of √|u_x|, smoothed, with nothing to set: ``monitor.kind = "auto"`` of a study.

    In the plane there is one such density for each axis, the second with u_y: layers that lie across different axes
    draw their own nodes each.

    >>> from driftmesh import MeshGenerator, RootGradient
    >>> MeshGenerator().monitor == RootGradient()
    True
    """

    kind = "auto"


@dataclass(frozen=True)
class Given(Kind):
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
