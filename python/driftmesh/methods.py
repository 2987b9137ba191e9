"""How the mesh equation is solved: on the whole domain, or by subdomains."""

from __future__ import annotations

from dataclasses import dataclass
from types import NoneType
from typing import Any, Literal

from ._toml import Kind


@dataclass(frozen=True)
class Whole(Kind):
    """One implicit solve of the mesh equation on the whole domain.

    >>> from driftmesh import Mesh, MeshGenerator, Whole
    >>> mesh = Mesh.uniform(cells=(8, 8))
    >>> generator = MeshGenerator(method=Whole())
    >>> generator.step(mesh, mesh.x**2, dt=0.1).cells
    (8, 8)
    """

    kind = "whole"


@dataclass(frozen=True)
class Fixed(Kind):
    """The mesh does not move.

    >>> from driftmesh import Fixed, Mesh, MeshGenerator
    >>> mesh = Mesh.uniform(cells=(8, 8))
    >>> MeshGenerator(method=Fixed()).step(mesh, mesh.x**2, dt=0.1) == mesh
    True
    """

    kind = "fixed"


def _each(subdomains: Any) -> tuple[Any, ...]:
    """Numbers of subdomains, one for each axis."""
    return tuple(subdomains) if isinstance(subdomains, (tuple, list)) else (subdomains,)


@dataclass(frozen=True)
class Schwarz(Kind):
    """Overlapping subdomains, solved in parallel and iterated until they agree, or a given number of times.

    Args:
        subdomains: Number of subdomains along each axis; one number for meshes of lines.
        overlap: Cells that neighbours share.
        method: What neighbours exchange: positions of nodes (``"classical"``) or Robin's conditions (``"optimized"``),
            which take fewer iterations.
        robin: p in Robin's condition ∂x/∂n + p x, or ``"auto"``.
        tolerance: Ends the iteration of a step once it changes no node by more than this share of the largest
            coordinate; 1e-10 where neither it nor ``iterations`` is given.
        iterations: Number of iterations in a step; with ``tolerance`` the largest number, 1000 by default.

    >>> from driftmesh import Mesh, MeshGenerator, Schwarz
    >>> mesh = Mesh.uniform(cells=(16, 16))
    >>> generator = MeshGenerator(method=Schwarz(subdomains=(2, 2), iterations=3))
    >>> _ = generator.step(mesh, mesh.x**2, dt=0.01)
    >>> generator.last["interface"]["contraction"]["iterations"]
    3
    """

    kind = "schwarz"
    subdomains: int | tuple[int] | tuple[int, int] = (2, 2)
    overlap: int = 2
    method: Literal["classical", "optimized"] = "classical"
    robin: float | Literal["auto"] = "auto"
    tolerance: float | None = None
    iterations: int | None = None

    def _along(self) -> tuple[Any, ...]:
        return _each(self.subdomains)

    def _table(self) -> dict[str, Any]:
        return super()._table() | {"subdomains": list(self._along())}


@dataclass(frozen=True)
class ResidualWalk(Kind):
    """Strips around the interfaces, then random walks that estimate the error which the strips leave.

    Args:
        sweeps: Sweeps of relaxation in each strip; ``"auto"`` solves the strips instead.
        walks: Random walks from each node of the interfaces.
        smoother: Relaxation of the strips where ``sweeps`` is a number, ``"chebyshev"`` or ``"jacobi"``.

    >>> from driftmesh import ResidualWalk, Stochastic
    >>> Stochastic(subdomains=(4, 4)).estimator == ResidualWalk()
    True
    """

    kind = "residual-walk"
    sweeps: int | Literal["auto"] = "auto"
    walks: int = 10
    smoother: Literal["chebyshev", "jacobi"] = "chebyshev"


@dataclass(frozen=True)
class Strip(Kind):
    """Every subdomain is solved together with a strip of its neighbours, after a coarse lattice; no random walks.

    Args:
        width: Nodes beyond each cut that a subdomain solves for together with its own, or ``"auto"``.
        coarse: Cells along each axis that make one cell of the coarse lattice, 1 for no coarse lattice, or ``"auto"``.
        exchanges: Exchanges between neighbours in a step; ``"auto"`` goes on with them until the error that is left is
            estimated at no more than a hundredth of the shortest edge.

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
class GridWalk(Kind):
    """Random walks on the lattice from every node of the interfaces.

    Args:
        walks: Random walks from each node.
        increment: Estimates the motion of a node over the step instead of its position.

    >>> from driftmesh import GridWalk, Stochastic
    >>> Stochastic(subdomains=(4, 4), estimator=GridWalk(walks=100, increment=True)).estimator.walks
    100
    """

    kind = "grid-walk"
    walks: int
    increment: bool = False


@dataclass(frozen=True)
class MonteCarlo(Kind):
    """Paths of the stochastic differential equation of the mesh, as published.

    Args:
        paths: Paths from each node of the interfaces.
        substeps: Steps of the Euler–Maruyama scheme in a time step.
        antithetic: Pairs of paths with opposite increments.
        sobol: Increments from a Sobol sequence.
        control_variate: Subtracts from each path a sum of its increments whose mean is 0, which lowers the variance.
        common: The same random numbers at all nodes.

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
    """Estimates some nodes of each interface and interpolates the others.

    Args:
        sample: Number of nodes of each interface that are estimated.
        placement: How they are placed: by ``"density"`` or ``"uniform"``.

    >>> from driftmesh import Interpolation, Stochastic
    >>> Stochastic(subdomains=(4, 4), interface=Interpolation(sample=9)).interface.placement
    'density'
    """

    sample: int
    placement: Literal["density", "uniform"] = "density"


@dataclass(frozen=True)
class Stochastic(Kind):
    """Random walks or strips give the nodes between the subdomains; then each subdomain is solved by itself.

    Args:
        subdomains: Number of subdomains along each axis; one number for meshes of lines.
        estimator: How the nodes of the interfaces are found: :class:`ResidualWalk`, :class:`Strip`,
            :class:`GridWalk` or :class:`MonteCarlo`.
        seed: Seed of all random numbers.
        interface: :class:`Interpolation` to estimate only some nodes; by default every node is estimated.

    >>> from driftmesh import Mesh, MeshGenerator, Stochastic
    >>> mesh = Mesh.uniform(cells=(16, 16))
    >>> generator = MeshGenerator(method=Stochastic(subdomains=(2, 2), seed=1))
    >>> _ = generator.step(mesh, mesh.x**2, dt=0.01)
    >>> generator.last["interface"]["points"]
    29
    """

    kind = "stochastic"
    subdomains: int | tuple[int] | tuple[int, int] = (2, 2)
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
        return super()._table() | {"subdomains": list(self._along()), "interface": sample}

    def _along(self) -> tuple[Any, ...]:
        return _each(self.subdomains)
