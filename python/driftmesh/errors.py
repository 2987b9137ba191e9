"""What is raised.

:class:`StudyError` for a mistake in a study; :class:`MeshError` for a numerical failure, as the subclass that bears its
name in ``summary.json``: ``mesh-folded`` is :class:`MeshFolded`. Those that a wrong value in the input causes are
:class:`ValueError` too.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any


class StudyError(ValueError):
    """A mistake in a study: its line, a caret under the place, and the remedy, as the program prints them.

    >>> import driftmesh
    >>> try:
    ...     driftmesh.equidistribute("x^^2", 10)
    ... except driftmesh.StudyError as mistake:
    ...     print(mistake)
    `value`: something is missing after `^`
      x^^2
       ^
    """


class MeshError(ArithmeticError):
    """A numerical failure: what, where and the remedy.

    Attributes:
        t: Time of the step that failed, where a study was run.
        step: That step.
        directory: Where everything up to the last good state is, where a study was run.
        result: What there is up to the failure: a :class:`driftmesh.Run` or a :class:`driftmesh.SchwarzResult`.

    >>> import driftmesh
    >>> try:
    ...     driftmesh.schwarz("x^2 + 1", 100, overlap=(0.4, 0.6), tolerance=1e-10, iterations=5)
    ... except driftmesh.MeshError as failure:
    ...     print(type(failure).__name__, failure.result.iterations)
    NotConverged 5
    """

    t: float | None = None
    step: int | None = None
    directory: Path | None = None
    result: Any = None


class RunWarning(RuntimeWarning):
    """What a study warns of, when its run has ended.

    Attributes:
        result: The :class:`driftmesh.Run`, for those who turn warnings into errors.
    """

    result: Any = None


class MeshFolded(MeshError):
    """A mesh cell has a corner whose Jacobian is not positive."""


class NonFinite(MeshError, ValueError):
    """A quantity stopped being finite."""


class Formula(MeshError, ValueError):
    """A formula of the study has no finite value, or what it makes of an unknown has none."""


class NotPositive(MeshError, ValueError):
    """A quantity that must be positive is not."""


class NotPeriodic(MeshError):
    """An equation that is made for periodic axes met a bounded one."""


class NotUniform(MeshError):
    """An equation that is made for the uniform mesh met another, or one that moves."""


class ManySubsteps(MeshError):
    """An explicit step would take too many substeps: over 1e8 on a uniform mesh, over 2e4 by limited fluxes."""


class NewtonStalled(MeshError):
    """Newton's method did not reach its tolerance."""


class VanishingStep(MeshError):
    """Automatic time steps became so short that the run would not end."""


class LinearStalled(MeshError):
    """A linear system was not solved to its tolerance by any solver at hand."""


class SteepDensity(MeshError):
    """The density is so steep that the weights of the mesh equation are no probabilities."""


class LongWalks(MeshError):
    """The random walks of a step would take more than 1e11 jumps."""


class NoisyInterface(MeshError):
    """Interface values are so noisy that cells can fold."""


class SchwarzStalled(MeshError):
    """The Schwarz iteration did not reach its tolerance."""


class Subdomains(MeshError, ValueError):
    """A lattice cannot be divided into so many subdomains."""


class LineDensity(MeshError, ValueError):
    """The density of a line is not finite and positive, or its derivative not finite."""


class LineStalled(MeshError):
    """Newton's method found no nodes of a line, or of a subdomain of it."""


class LineUnresolved(MeshError):
    """A layer is so thin, and so many cells lie in it, that neighbouring nodes are the same number."""


class LineFolded(MeshError):
    """The mesh glued from the subdomains of a line is out of order."""


class NotConverged(MeshError):
    """An iteration between subdomains of a line did not converge."""


class SelfTouching(MeshError):
    """The sides of a mesh touch or cross each other, although no cell is folded."""


class DegenerateStencil(MeshError):
    """The nodes around a node determine no Laplacian."""


class FrontOutside(MeshError):
    """The front reached a wall."""


class VanishingPhase(MeshError):
    """A phase became so thin that rows of it cannot be told apart."""


class NotAGraph(MeshError):
    """The front turns over, or is too steep for the distance of the columns."""


class FrontUnstable(MeshError):
    """A time step past the stability limit of the explicit front."""


class WrongSide(MeshError):
    """The warm phase lies on the wrong side of the front: the problem is ill-posed."""


class WallPassesMelting(MeshError):
    """The wall of a phase passes the melting temperature, where the other phase would appear with a second front."""


class NotABox(MeshError, ValueError):
    """A mesh generator met a mesh whose sides are not those of the box around it: it would pull them straight."""


class OutOfRange(MeshError, ValueError):
    """A setting or an argument of a step is out of range."""


class WrongLength(MeshError, ValueError):
    """An array does not fit the lattice it is given with."""
