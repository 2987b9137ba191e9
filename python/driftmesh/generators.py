"""What moves a mesh: a monitor and a method, put together to a generator."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from . import _driftmesh, _toml
from ._arrays import finite, positive
from ._toml import Kind
from .mesh import Mesh
from .methods import Fixed, Schwarz, Stochastic, Whole
from .monitors import Arclength, Given, RootGradient
from .remap import periodic_values

#: Where a mesh should be fine: a monitor of u, the density itself, or a function of mesh and u that gives it.
Monitor: TypeAlias = "Arclength | RootGradient | Given | ArrayLike | Callable[[Mesh, Any], ArrayLike]"


class MeshGenerator:
    """Moves a mesh step by step to where its monitor wants it: x_t = (1/τ)(∇ρ/ρ·∇x + ∇²x) in ξ, implicit in time.

    Args:
        monitor: :class:`RootGradient` (the default, with nothing to set), :class:`Arclength` or :class:`Given`; or the
            density itself, an array of shape (nx + 1, ny + 1); or a function of mesh and u that returns it. A density
            is positive, and only its ratios matter.
        method: :class:`Whole` (the default), :class:`Stochastic`, :class:`Schwarz` or :class:`Fixed`.
        relaxation: τ, the time that the mesh takes to follow the density. ``"auto"`` chooses it from how the mesh
            moves. ``{"steps": 25}`` gives it in time steps; ``{"steps": 40, "prediction": 0.2}`` also starts each step
            from where the nodes would be if they went on, with a velocity that learns a fifth of each correction.
        form: ``"conservative"``, stable for any density, or ``"gradient"``, as published.

    Raises:
        ValueError: Settings out of range.

    A step that would fold the mesh is done again in 2, 4 and 8 parts, then with a smoother density; ``last`` counts
    these retries.

    Use one generator for each run: it remembers the velocity of the mesh for as long as each step starts from the mesh
    that the last one led to, and counts the steps for the random numbers of :class:`Stochastic`. A copy or an unpickled
    generator begins anew. ``monitor`` may be set between steps; ``method``, ``relaxation`` and ``form`` are read-only.

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
        monitor = self.monitor if isinstance(self.monitor, Kind) else Given()
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
            KeyboardInterrupt: Ctrl-C. The step is given up: it ends in the background, and what it finds is thrown
                away.

        >>> from driftmesh import Mesh, MeshGenerator
        >>> mesh = Mesh.uniform(cells=(8, 8))
        >>> MeshGenerator(monitor=1 + mesh.x).step(mesh, None, dt=0.1).quality().min_scaled_jacobian < 1
        True
        """
        if not isinstance(mesh, Mesh):
            raise ValueError(f"`mesh` is of type {type(mesh).__name__}, but must be a driftmesh.Mesh")
        dt = positive("dt", dt)
        mesh._check_box()
        if isinstance(self.monitor, Kind):
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
        monitor = self.monitor if isinstance(self.monitor, Kind) else "a density"
        return (
            f"MeshGenerator(monitor={monitor}, method={self._method}, relaxation={self._relaxation}, "
            f"form={self._form!r})"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.monitor, self._method, self._relaxation, self._form)
