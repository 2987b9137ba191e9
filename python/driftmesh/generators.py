"""What moves a mesh: monitors, methods, and the generator that puts them together."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from types import NoneType
from typing import Any, ClassVar, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from . import _driftmesh, _toml
from ._arrays import finite, positive
from .mesh import Mesh, periodic_values


@dataclass(frozen=True)
class _Kind:
    """A table of a study that says its kind."""

    kind: ClassVar[str]

    def _table(self) -> dict[str, Any]:
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {"kind": self.kind} | {
            name: value._table() if isinstance(value, _Kind) else value for name, value in values.items()
        }


@dataclass(frozen=True)
class Arclength(_Kind):
    """ρ = √(1 + α|∇u|²), smoothed.

    Args:
        relative: α = relative / max|∇u|²; 30 where neither is given.
        absolute: α itself, in the unit (x/u)².
        smoothing: Passes of the (1 2 1)⊗(1 2 1)/16 filter.
        gradient: How ∇ρ/ρ is differenced where ``form="gradient"``: ``"central"``, ``"log"`` or ``"safe"``.

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
class RootGradient(_Kind):
    """ρ = 1 + 4 √|∇u| / mean of √|∇u|, smoothed: no number to set. What ``monitor.kind = "auto"`` is in a study.

    >>> from driftmesh import MeshGenerator, RootGradient
    >>> MeshGenerator().monitor == RootGradient()
    True
    """

    kind = "auto"


@dataclass(frozen=True)
class Given(_Kind):
    """u is the density itself: positive at every node. ``smoothing`` passes of the filter follow.

    >>> from driftmesh import Given, Mesh, MeshGenerator
    >>> mesh = Mesh.uniform(cells=(8, 8))
    >>> new = MeshGenerator(monitor=Given()).step(mesh, 1 + 3 * mesh.x, dt=0.1)
    >>> bool(new.x[4, 4] > 0.5)  # more nodes where the density is larger
    True
    """

    kind = "given"
    smoothing: int = 0
    gradient: Literal["central", "log", "safe"] = "central"


@dataclass(frozen=True)
class Whole(_Kind):
    """One implicit solve of the mesh equation on the whole domain.

    >>> from driftmesh import Mesh, MeshGenerator, Whole
    >>> mesh = Mesh.uniform(cells=(8, 8))
    >>> generator = MeshGenerator(method=Whole())
    >>> generator.step(mesh, mesh.x**2, dt=0.1).cells
    (8, 8)
    """

    kind = "whole"


@dataclass(frozen=True)
class Fixed(_Kind):
    """The mesh does not move.

    >>> from driftmesh import Fixed, Mesh, MeshGenerator
    >>> mesh = Mesh.uniform(cells=(8, 8))
    >>> MeshGenerator(method=Fixed()).step(mesh, mesh.x**2, dt=0.1) == mesh
    True
    """

    kind = "fixed"


@dataclass(frozen=True)
class Schwarz(_Kind):
    """Overlapping subdomains, solved in parallel and iterated to a tolerance or so many times.

    Args:
        subdomains: Along each axis.
        overlap: Cells that neighbours share.
        method: ``"classical"``, neighbours exchange values, or ``"optimized"``, Robin's conditions, which take fewer iterations.
        robin: p of these, or ``"auto"``.
        tolerance: Change in the last iteration, as a share of the largest coordinate; 1e-10 where neither it nor
            ``iterations`` is given.
        iterations: Exactly so many in a step; with ``tolerance`` at most so many, 1000 where nothing is given.

    >>> from driftmesh import Mesh, MeshGenerator, Schwarz
    >>> mesh = Mesh.uniform(cells=(16, 16))
    >>> generator = MeshGenerator(method=Schwarz(subdomains=(2, 2), iterations=3))
    >>> _ = generator.step(mesh, mesh.x**2, dt=0.01)
    >>> generator.last["interface"]["contraction"]["iterations"]
    3
    """

    kind = "schwarz"
    subdomains: tuple[int, int] = (2, 2)
    overlap: int = 2
    method: Literal["classical", "optimized"] = "classical"
    robin: float | Literal["auto"] = "auto"
    tolerance: float | None = None
    iterations: int | None = None


@dataclass(frozen=True)
class ResidualWalk(_Kind):
    """Strips around the interfaces, then random walks that estimate what the strips leave.

    Args:
        sweeps: So many sweeps of relaxation in the strips, or ``"auto"``: they are solved.
        walks: From each node.
        smoother: ``"chebyshev"`` or ``"jacobi"``.

    >>> from driftmesh import ResidualWalk, Stochastic
    >>> Stochastic(subdomains=(4, 4)).estimator == ResidualWalk()
    True
    """

    kind = "residual-walk"
    sweeps: int | Literal["auto"] = "auto"
    walks: int = 10
    smoother: Literal["chebyshev", "jacobi"] = "chebyshev"


@dataclass(frozen=True)
class Strip(_Kind):
    """Every subdomain is solved once with a strip of its neighbours, after a coarse lattice; no walks.

    Args:
        width: Nodes of the neighbours that a subdomain sees, or ``"auto"``.
        coarse: Cells along each axis to one of the coarse lattice, 1 for none, or ``"auto"``.
        exchanges: In a step, or ``"auto"``: one, more where one is not enough.

    >>> from driftmesh import Mesh, MeshGenerator, Stochastic, Strip
    >>> mesh = Mesh.uniform(cells=(16, 16))
    >>> generator = MeshGenerator(method=Stochastic(subdomains=(2, 2), estimator=Strip(width=4)))
    >>> _ = generator.step(mesh, mesh.x**2, dt=0.001)
    >>> generator.last["interface"]["exchanges"]
    1
    """

    kind = "strip"
    width: int | Literal["auto"] = "auto"
    coarse: int | Literal["auto"] = "auto"
    exchanges: int | Literal["auto"] = "auto"


@dataclass(frozen=True)
class GridWalk(_Kind):
    """Random walks on the lattice; ``increment`` estimates the motion over the step instead of the position.

    >>> from driftmesh import GridWalk, Stochastic
    >>> Stochastic(subdomains=(4, 4), estimator=GridWalk(walks=100, increment=True)).estimator.walks
    100
    """

    kind = "grid-walk"
    walks: int
    increment: bool = False


@dataclass(frozen=True)
class MonteCarlo(_Kind):
    """Paths of the stochastic differential equation, as published, with ``substeps`` in a time step.

    >>> from driftmesh import MonteCarlo, Stochastic
    >>> Stochastic(subdomains=(4, 4), estimator=MonteCarlo(paths=10000, substeps=10)).estimator.sobol
    False
    """

    kind = "monte-carlo"
    paths: int
    substeps: int
    antithetic: bool = False
    sobol: bool = False
    control_variate: bool = False
    common: bool = False


@dataclass(frozen=True)
class Interpolation:
    """Estimates ``sample`` nodes of each interface only, placed ``"uniform"`` or by ``"density"``, and interpolates.

    >>> from driftmesh import Interpolation, Stochastic
    >>> Stochastic(subdomains=(4, 4), interface=Interpolation(sample=9)).interface.placement
    'density'
    """

    sample: int
    placement: Literal["density", "uniform"] = "density"


@dataclass(frozen=True)
class Stochastic(_Kind):
    """Random walks or strips give the nodes between the subdomains, then each is solved by itself.

    Args:
        subdomains: Along each axis.
        estimator: :class:`ResidualWalk`, :class:`Strip`, :class:`GridWalk` or :class:`MonteCarlo`.
        seed: Of all random numbers.
        interface: :class:`Interpolation`, or every node where nothing is said.

    >>> from driftmesh import Mesh, MeshGenerator, Stochastic
    >>> mesh = Mesh.uniform(cells=(16, 16))
    >>> generator = MeshGenerator(method=Stochastic(subdomains=(2, 2), seed=1))
    >>> _ = generator.step(mesh, mesh.x**2, dt=0.01)
    >>> generator.last["interface"]["points"]
    29
    """

    kind = "stochastic"
    subdomains: tuple[int, int] = (2, 2)
    estimator: ResidualWalk | Strip | GridWalk | MonteCarlo = ResidualWalk()
    seed: int = 0
    interface: Interpolation | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.estimator, (ResidualWalk, Strip, GridWalk, MonteCarlo)):
            text = "must be ResidualWalk(…), Strip(…), GridWalk(…) or MonteCarlo(…)"
            raise ValueError(f"`estimator` is {self.estimator!r}, but {text}")
        if not isinstance(self.interface, (Interpolation, NoneType)):
            raise ValueError(f"`interface` is {self.interface!r}, but must be Interpolation(…) or None")

    def _table(self) -> dict[str, Any]:
        sample = None if self.interface is None else vars(self.interface)
        return super()._table() | {"interface": sample}


#: Where a mesh should be fine: a monitor of u, the density itself, or a function of mesh and u that gives it.
Monitor: TypeAlias = "Arclength | RootGradient | Given | ArrayLike | Callable[[Mesh, Any], ArrayLike]"


class MeshGenerator:
    """Moves a mesh step by step to where its monitor wants it: x_t = (1/τ)(∇ρ/ρ·∇x + ∇²x) in ξ, implicit in time.

    Args:
        monitor: :class:`Arclength`, :class:`RootGradient` (the default, nothing to set), :class:`Given`; or the density
            itself, an array of shape (nx + 1, ny + 1) that may be set anew between steps; or a function of mesh and u that
            returns it. A density is positive, only its ratios matter.
        method: :class:`Whole` (the default), :class:`Stochastic`, :class:`Schwarz` or :class:`Fixed`.
        relaxation: ``"auto"``: the mesh rests where the density rests and follows where it moves, with nothing to set. Or τ,
            in units of time: how long the mesh takes to follow. Or ``{"steps": 25}``, so many time steps, and
            ``{"steps": 40, "prediction": 0.2}``, with nodes that learn where they are going.
        form: ``"conservative"``, stable for any density, or ``"gradient"``, as published.

    Raises:
        ValueError: Settings out of range.

    A step that would fold the mesh is done again in 2, 4, 8 parts, then with a smoother density; ``last`` counts them.

    A generator remembers its last step (how the mesh was going, as long as the next step starts from the mesh that it led to)
    and counts steps (for the random numbers of :class:`Stochastic`); use one for each run. A copy and an unpickled one begin
    anew. ``monitor`` may be set anew between steps; ``method``, ``relaxation`` and ``form`` can be read.

    >>> import numpy as np
    >>> from driftmesh import Arclength, Mesh, MeshGenerator
    >>> mesh = Mesh.uniform(cells=(20, 20))
    >>> generator = MeshGenerator(monitor=Arclength(relative=30, smoothing=2), relaxation=0.1)
    >>> for _ in range(20):
    ...     mesh = generator.step(mesh, np.tanh(20 * (mesh.x - 0.5)), dt=0.01)
    >>> bool(np.diff(mesh.x[:, 10]).min() < 0.6 / 20)  # finer in the layer
    True
    """

    def __init__(
        self,
        monitor: Monitor | None = None,
        method: Whole | Stochastic | Schwarz | Fixed | None = None,
        relaxation: float | Mapping[str, float] | Literal["auto"] = "auto",
        form: Literal["conservative", "gradient"] = "conservative",
    ) -> None:
        method = Whole() if method is None else method
        if not isinstance(method, (Whole, Stochastic, Schwarz, Fixed)):
            raise ValueError(f"`method` is {method!r}, but must be Whole(), Stochastic(…), Schwarz(…) or Fixed()")
        if isinstance(monitor, (str, type)):
            raise ValueError(
                f"`monitor` is {monitor!r}, but must be Arclength(…), RootGradient(), Given(), an array or a function"
            )
        if relaxation is None:
            raise ValueError('`relaxation` is None, but must be "auto", a time, or {"steps": …}')
        self.monitor: Monitor = RootGradient() if monitor is None else monitor
        self._method, self._relaxation, self._form = method, relaxation, form
        self._begin()

    def __setattr__(self, name: str, value: Any) -> None:
        if name != "monitor" and not name.startswith("_"):
            kept = "can only be read" if name in ("method", "relaxation", "form", "last") else "is no attribute"
            raise AttributeError(f"`{name}` {kept}; make a new MeshGenerator with other settings, or set `monitor`")
        super().__setattr__(name, value)

    @property
    def method(self) -> Whole | Stochastic | Schwarz | Fixed:
        """How the mesh equation is solved."""
        return self._method

    @property
    def relaxation(self) -> float | Mapping[str, float] | Literal["auto"]:
        """How long the mesh takes to follow, as it was given."""
        return self._relaxation

    @property
    def form(self) -> Literal["conservative", "gradient"]:
        """Form of the mesh equation."""
        return self._form

    def _begin(self) -> None:
        monitor = self.monitor if isinstance(self.monitor, _Kind) else Given()
        mesh = {"generator": self._method._table(), "relaxation": self._relaxation, "form": self._form}
        self._native = _driftmesh.Generator(_toml.document({"monitor": monitor._table(), "mesh": mesh}))
        self._made_for = monitor
        self._told = "{}"

    def step(self, mesh: Mesh, u: ArrayLike | None, dt: float) -> Mesh:
        """The mesh at the end of a time step.

        Args:
            mesh: The mesh now, of a box.
            u: The solution on it, shape (nx + 1, ny + 1); None where the monitor is a density.
            dt: Length of the step, in the unit of ``relaxation``, above 0.

        Raises:
            ValueError: Wrong shapes or values.
            driftmesh.MeshError: The mesh is or would be folded, a system was not solved.
            RuntimeError: The generator is still at work: in another thread, or on a step that Ctrl-C gave up.
            KeyboardInterrupt: Ctrl-C. The step is given up: it ends in the background, and what it finds is thrown away.

        >>> from driftmesh import Mesh, MeshGenerator
        >>> mesh = Mesh.uniform(cells=(8, 8))
        >>> MeshGenerator(monitor=1 + mesh.x).step(mesh, None, dt=0.1).quality().min_scaled_jacobian < 1
        True
        """
        if not isinstance(mesh, Mesh):
            raise ValueError(f"`mesh` is of type {type(mesh).__name__}, but must be a driftmesh.Mesh")
        dt = positive("dt", dt)
        mesh._check_box()
        if isinstance(self.monitor, _Kind):
            if self.monitor != self._made_for:
                self._begin()
            if u is None:
                raise ValueError(f"`u` is None, but the monitor {self.monitor} looks at it")
            name, values = "u", finite("u", u, mesh.shape)
        else:
            if not isinstance(self._made_for, Given):
                self._begin()
            given = self.monitor(mesh, u) if callable(self.monitor) else self.monitor
            name, values = "density", finite("density", given, mesh.shape)
        if isinstance(self._made_for, Given) and not (values > 0).all():
            place = tuple(int(k) for k in np.argwhere(~(values > 0))[0])
            raise ValueError(f"the density is {values[place]} at index {place}, but must be above 0")
        nodes, self._told = self._native.step(mesh._given(), periodic_values(name, values, mesh), dt)
        return Mesh._of(nodes, mesh)

    @property
    def last(self) -> dict[str, Any]:
        """What the last step cost (``work``), how well its subdomains fit together (``interface``), as in a study's
        ``summary.json``, how often it was tried again (``retries``) and τ in time steps where the generator chooses it
        (``relaxation_steps``); empty before the first."""
        told: dict[str, Any] = json.loads(self._told)
        return told

    def __repr__(self) -> str:
        monitor = self.monitor if isinstance(self.monitor, _Kind) else "a density"
        return f"MeshGenerator(monitor={monitor}, method={self._method}, relaxation={self._relaxation}, form={self._form!r})"

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.monitor, self._method, self._relaxation, self._form)
