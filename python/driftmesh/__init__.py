"""Moving meshes for time-dependent PDEs.

Three ways in:

* move a mesh to the data of your own solver: :class:`Mesh`, :class:`MeshGenerator`, :func:`transfer`,
  :func:`gradient`;
* run a study: :func:`run`, :func:`load`, :func:`studies`;
* the tools by themselves: :func:`laplacian_stencils`, :func:`equidistribute`, :func:`schwarz`.

Arrays over a mesh have shape ``(nx + 1, ny + 1)``, first index along ξ, over a line ``(nx + 1,)``; periodic axes
repeat their first node at the end. Any real dtype, strides and order will do. Wrong shapes and values raise
:class:`ValueError`, numerical failures :class:`MeshError` or the subclass of it that is named after the failure.
"""

from ._driftmesh import VERSION as __version__
from .differences import divergence, gradient
from .errors import MeshError, StudyError
from .frames import Frame
from .generators import MeshGenerator
from .laplacian import laplacian_stencils
from .line import SchwarzResult, equidistribute, schwarz
from .mesh import Mesh
from .methods import Fixed, GridWalk, Interpolation, MonteCarlo, ResidualWalk, Schwarz, Stochastic, Strip, Whole
from .monitors import Arclength, Curvature, Given, Largest, Limited, RootGradient
from .poisson import Poisson
from .quality import Quality
from .remap import transfer
from .study import Fronts, Run, load, run, studies

__all__ = [
    "Arclength",
    "Curvature",
    "Fixed",
    "Frame",
    "Fronts",
    "Given",
    "GridWalk",
    "Interpolation",
    "Largest",
    "Limited",
    "Mesh",
    "MeshError",
    "MeshGenerator",
    "MonteCarlo",
    "Poisson",
    "Quality",
    "ResidualWalk",
    "RootGradient",
    "Run",
    "Schwarz",
    "SchwarzResult",
    "Stochastic",
    "Strip",
    "StudyError",
    "Whole",
    "__version__",
    "divergence",
    "equidistribute",
    "gradient",
    "laplacian_stencils",
    "load",
    "run",
    "schwarz",
    "studies",
    "transfer",
]
