"""What moves a mesh: a monitor and a method, put together to a generator."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Mapping
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from . import _driftmesh, _toml
from ._arrays import Floats, count, finite, positive, real, scalar
from ._arrays import threads as _threads
from ._boxes import check_box, fills_box, images, periodic_values
from ._toml import Kind
from .mesh import Mesh
from .methods import Fixed, Schwarz, Stochastic, Whole
from .monitors import Given, Largest, Limited, MonitorKind, RootGradient, WithCells

#: Where a mesh should be fine: a monitor of u, the density itself, or a function of mesh and u that gives it.
Monitor: TypeAlias = "MonitorKind | Largest | Limited | ArrayLike | Callable[[Mesh, Any], ArrayLike]"

#: τ in units of time or in time steps, or chosen.
Relaxation: TypeAlias = "float | Mapping[str, float] | Literal['auto']"

#: Why a mesh is not at rest on its data.
_UNREST = {
    "jump": "the data jump, and no mesh resolves a jump; the mesh has its thinnest cells there",
    "restless": "the mesh does not come to rest on the data, which may be too thin for its cells or noisy; it is the "
    "last one of many steps",
}
_READ_ONLY = ("method", "relaxation", "prediction", "form", "safety", "threads", "last")


class MeshGenerator:
    """Moves a mesh step by step to where its monitor wants it: x_t = (1/τ)(∇ρ/ρ·∇x + ∇²x) in ξ, implicit in time.

    Args:
        monitor: :class:`RootGradient` (the default, with nothing to set), :class:`Arclength`, :class:`Curvature` or
            :class:`Given`; or the density itself, an array of the shape of the mesh; or a function of mesh and u that
            returns it. ``a | b`` is the larger of two monitors (:class:`Largest`); :class:`Limited` bounds the sizes of
            cells. A density is positive, and only its ratios matter.
        method: :class:`Whole` (the default), :class:`Stochastic`, :class:`Schwarz` or :class:`Fixed`. Subdomains of a
            line are one number.
        relaxation: τ, the time that the mesh takes to follow the density. ``"auto"`` chooses it from how the mesh
            moves. ``{"steps": 25}`` gives it in time steps; ``{"steps": 40, "prediction": 0.2}`` also starts each step
            from where the nodes would be if they went on, with a velocity that learns a fifth of each correction.
        form: ``"conservative"``, stable for any density, or ``"gradient"``, as published.
        prediction: The share γ of each correction that the velocity of a node learns, from 0 to ½, beside
            ``relaxation={"steps": …}``. With ``"auto"`` it is chosen, too; a τ in units of time has none.
        safety: How far a step that would fold the mesh is tried again, as in ``[safety]`` of a study:
            ``{"substeps": 8, "smoothing": 8}`` does it in 2, 4 and 8 parts, then with 2, 4 and 8 further passes of the
            filter over the density. 1 substep and 0 passes try nothing.
        threads: Number of threads; all cores where nothing is said. Meshes have the same bits for any number.

    Raises:
        ValueError: Settings out of range.

    Use one generator for each run: it remembers the velocity of the mesh for as long as each step starts from the mesh
    that the last one led to, and counts the steps for the random numbers of :class:`Stochastic`. A copy or an unpickled
    generator goes on from there, and its steps have the same bits. ``monitor`` may be set between steps, which begins
    anew; all else is read-only. ``last["retries"]`` counts steps that were tried again.

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
        relaxation: Relaxation = "auto",
        form: Literal["conservative", "gradient"] = "conservative",
        *,
        prediction: float | None = None,
        safety: Mapping[str, int] | None = None,
        threads: int | None = None,
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
        self._method, self._form = method, form
        self._relaxation = _relaxation(relaxation, prediction)
        self._safety = _safety(safety)
        self._threads = _threads(threads)
        self._begin()

    def __setattr__(self, name: str, value: Any) -> None:
        if name != "monitor" and not name.startswith("_"):
            kept = "can only be read" if name in _READ_ONLY else "is no attribute"
            raise AttributeError(f"`{name}` {kept}; make a new MeshGenerator with other settings, or set `monitor`")
        super().__setattr__(name, value)

    @property
    def method(self) -> Whole | Stochastic | Schwarz | Fixed:
        """How the mesh equation is solved."""
        return self._method

    @property
    def relaxation(self) -> Relaxation:
        """How long the mesh takes to follow; in steps, with the prediction."""
        return self._relaxation

    @property
    def prediction(self) -> float | None:
        """γ, the share of each correction that the velocity of a node learns; None where it is chosen with τ."""
        if isinstance(self._relaxation, Mapping):
            return float(self._relaxation.get("prediction", 0.0))
        return None if isinstance(self._relaxation, str) else 0.0

    @property
    def form(self) -> Literal["conservative", "gradient"]:
        """Form of the mesh equation."""
        return self._form

    @property
    def safety(self) -> dict[str, int]:
        """In which ways, and how often, a step that fails is tried again."""
        return dict(self._safety)

    @property
    def threads(self) -> int | None:
        """Number of threads; None for all cores."""
        return self._threads

    def step(self, mesh: Mesh, u: ArrayLike | None, dt: float) -> Mesh:
        """The mesh at the end of a time step.

        Args:
            mesh: The mesh now, of a box, a line or a domain of another shape (:meth:`Mesh.mapped`). Where the sides of
                a mesh by arrays are not straight they are taken for curves through its nodes.
            u: The solution on it, of its shape; None where the monitor is a density.
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
        mesh = _movable(mesh)
        dt = positive("dt", dt)
        nodes, self._told = self._ready().step(mesh._given(), self._followed(mesh, u), dt)
        return Mesh._of(nodes, mesh)

    def density(self, mesh: Mesh, u: ArrayLike | None) -> Floats:
        """ρ at the nodes: where the monitor wants the mesh to be fine.

        It is what a study computes from the unknown that it follows, smoothed as the monitor says; a study whose fronts
        run into states that grow by themselves bounds the cells ahead of them, too. A step from rest follows this
        density, later ones a mean with the density that moved the mesh last.

        Args:
            mesh: The mesh, of any shape.
            u: The solution on it, of its shape; None where the monitor is a density.

        Returns:
            ρ above 0, of the shape of the mesh. Only its ratios matter. Of :class:`RootGradient`, which makes a density
            for each axis, it is the larger one.

        Raises:
            ValueError: Wrong shapes or values.
            driftmesh.errors.MeshFolded: A cell is folded.

        >>> from driftmesh import Arclength, Mesh, MeshGenerator
        >>> mesh = Mesh.uniform(cells=(8, 8))
        >>> monitor = Arclength(absolute=2, smoothing=0)
        >>> rho = MeshGenerator(monitor=monitor).density(mesh, 2 * mesh.x)  # √(1 + 2·2²) = 3
        >>> round(float(rho[4, 4]), 12)
        3.0
        """
        _check(mesh)
        return self._ready().density(mesh._given(), self._followed(mesh, u))

    def adapt(self, mesh: Mesh, u0: ArrayLike | Callable[..., ArrayLike] | None) -> Mesh:
        """A mesh that rests on given data, as a study has it at its start.

        It does steps from the mesh, each with the data at the nodes that the last one led to, until no node moves by
        more than a small share of the shortest edge. ``method`` and ``relaxation`` do not matter. Meshes with more than
        100 cells along an axis are adapted on half as many first. A study whose side values differ from its initial
        solution starts with these on its sides: a ``u0`` that has them there gives the same mesh.

        Args:
            mesh: Where to begin, of a box or a line; a study begins with equal cells.
            u0: A function of x and y, arrays of the same shape, on a line of x alone, that returns its values there; it
                is called with the nodes of each mesh, those that left a periodic box by their images. Or values at the
                nodes of ``mesh``, which are interpolated linearly. None where the monitor is a density.

        Returns:
            The mesh, on the same lattice and box. The next step from it begins at rest.

        Raises:
            ValueError: Wrong shapes or values.
            driftmesh.errors.MeshFolded: The mesh is folded.
            RuntimeError: The generator is still at work.

        Warns:
            RuntimeWarning: The mesh does not come to rest, and why.

        >>> import numpy as np
        >>> from driftmesh import Mesh, MeshGenerator
        >>> mesh = MeshGenerator().adapt(Mesh.uniform(cells=40), lambda x: np.tanh(50 * (x - 0.5)))
        >>> bool(np.diff(mesh.x).min() < 0.3 / 40)
        True
        """
        mesh = _movable(mesh)
        if not callable(u0):
            # looked at here, so that mistakes are named before anything is computed
            self._followed(mesh, u0, mesh)

        def follow(nodes: Floats) -> Floats:
            on = Mesh._of(nodes, mesh)
            return self._followed(on, _values(u0, mesh, on), mesh)

        nodes, end = self._ready().adapt(mesh._given(), follow)
        if end in _UNREST:
            warnings.warn(_UNREST[end], RuntimeWarning, stacklevel=2)
        return Mesh._of(nodes, mesh)

    @property
    def last(self) -> dict[str, Any]:
        """What the last step cost (``work``), how well its subdomains fit together (``interface``), as in a study's
        ``summary.json``, how often it was tried again (``retries``) and τ in time steps where the generator chooses it
        (``relaxation_steps``); empty before the first."""
        told: dict[str, Any] = json.loads(self._told)
        return told

    def _wanted(self) -> Kind:
        """The monitor of the library: a density that is given or computed here is its own."""
        core = self._core()
        kind = core if isinstance(core, Kind) else Given()
        limits = self.monitor
        return WithCells(kind, limits.smallest, limits.largest) if isinstance(limits, Limited) else kind

    def _core(self) -> Any:
        """The monitor without limits."""
        return self.monitor.monitor if isinstance(self.monitor, Limited) else self.monitor

    def _begin(self) -> None:
        mesh = {"generator": self._method._table(), "relaxation": self._relaxation, "form": self._form}
        tables = {"monitor": self._wanted()._table(), "mesh": mesh, "safety": self._safety}
        lines = isinstance(self._method, (Schwarz, Stochastic)) and len(self._method._along()) == 1
        self._native = _driftmesh.Generator(_toml.document(tables), self._threads, lines)
        self._made_for = self._wanted()
        self._told = "{}"

    def _ready(self) -> _driftmesh.Generator:
        """The native generator, made anew where the monitor is another one now."""
        if self._wanted() != self._made_for:
            self._begin()
        return self._native

    def _followed(self, mesh: Mesh, u: Any, start: Mesh | None = None) -> Floats:
        """What the monitor looks at on a mesh: u, or the density; an array of densities is that of the start."""
        core = self._core()
        if isinstance(core, Kind):
            if u is None:
                raise ValueError(f"`u` is None, but the monitor {self.monitor!r} looks at it")
            name = "u" if start is None else "u0"
            values = finite(name, u, mesh.shape)
        elif callable(core):
            name, values = "density", finite("density", core(mesh, u), mesh.shape)
        else:
            name, values = "density", finite("density", _values(core, start or mesh, mesh), mesh.shape)
        if (isinstance(core, Given) or not isinstance(core, Kind)) and not (values > 0).all():
            place = tuple(int(k) for k in np.argwhere(~(values > 0))[0])
            raise ValueError(f"the density is {values[place]} at index {place}, but must be above 0")
        return periodic_values(name, values, mesh._periodic)

    def __repr__(self) -> str:
        monitor = self.monitor if isinstance(self._core(), Kind) else "a density"
        return (
            f"MeshGenerator(monitor={monitor}, method={self._method}, relaxation={self._relaxation}, "
            f"form={self._form!r})"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        settings = {"safety": self._safety, "threads": self._threads}
        given = (self.monitor, self._method, self._relaxation, self._form)
        return _made, (type(self), given, settings), (self._ready().memory(), self._told)

    def __setstate__(self, state: tuple[bytes, str]) -> None:
        memory, self._told = state
        self._native.remember(memory)


def _made(kind: type[MeshGenerator], given: tuple[Any, ...], settings: dict[str, Any]) -> MeshGenerator:
    """A generator from its pickled settings."""
    return kind(*given, **settings)


def _check(mesh: Mesh) -> None:
    if not isinstance(mesh, Mesh):
        raise ValueError(f"`mesh` is of type {type(mesh).__name__}, but must be a driftmesh.Mesh")


def _movable(mesh: Mesh) -> Mesh:
    """A mesh as a generator moves it: where its sides are not those of its box, they are curves through its nodes."""
    _check(mesh)
    if mesh._chart is not None or fills_box(mesh._nodes, mesh.lower, mesh.upper, mesh.periodic):
        return mesh
    if mesh.dimensions == 1 or any(mesh.periodic):
        check_box(mesh._nodes, mesh.lower, mesh.upper, mesh.periodic)
    return Mesh.mapped(mesh.x, mesh.y)


def _values(u: Any, start: Mesh, on: Mesh) -> Any:
    """A function of the place, or values at the nodes of the mesh at the start, at the nodes of another one."""
    if u is None or on is start:
        return u
    if callable(u):
        values = real("u0", u(*(np.moveaxis(on._nodes, -1, 0) if on._chart else images(*on._given()[:4]))))
        return np.full(on.shape, values) if values.shape == () else values
    return start.interpolate(finite("u0", u, start.shape), *np.moveaxis(on._nodes, -1, 0))


def _relaxation(relaxation: Relaxation, prediction: float | None) -> Relaxation:
    """τ and γ as a study writes them."""
    if isinstance(relaxation, Mapping):
        unknown = [key for key in relaxation if key not in ("steps", "prediction")]
        if unknown or "steps" not in relaxation:
            raise ValueError(
                f'`relaxation` is {dict(relaxation)}, but must be "auto", a time, {{"steps": …}} or '
                '{"steps": …, "prediction": …}'
            )
    if prediction is None:
        return relaxation
    if not isinstance(relaxation, Mapping):
        raise ValueError(f'`prediction` is {prediction}, but needs relaxation={{"steps": …}}, not {relaxation!r}')
    if "prediction" in relaxation:
        raise ValueError(f"`prediction` is {prediction}, but `relaxation` has one, too: {dict(relaxation)}")
    return {**relaxation, "prediction": scalar("prediction", prediction)}


def _safety(given: Mapping[str, int] | None) -> dict[str, int]:
    """How far steps are tried again, with defaults in place of what is not said."""
    limits = {"substeps": 8, "smoothing": 8}
    if not isinstance(given, Mapping | None):
        raise ValueError(f"`safety` is {given!r}, but must be a dict such as {limits}")
    for name, value in (given or {}).items():
        if name not in limits:
            raise ValueError(f"`safety` has the key {name!r}, but must have substeps and smoothing alone")
        limits[name] = count(f"safety.{name}", value)
    return limits
