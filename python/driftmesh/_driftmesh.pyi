"""The native half of the package; private."""

from collections.abc import Callable
from pathlib import Path
from typing import final

import numpy as np
from numpy.typing import NDArray

from .errors import MeshError

__all__ = [
    "VERSION",
    "Generator",
    "areas",
    "check",
    "equidistribute",
    "quality",
    "run",
    "schwarz",
    "stencils",
    "transfer",
    "uniform",
]

VERSION: str

_Floats = NDArray[np.float64]
_Mesh = tuple[_Floats, tuple[float, float], tuple[float, float], tuple[bool, bool]]
_Density = tuple[str, str] | tuple[list[float], list[float]] | Callable[[_Floats], _Floats]

@final
class Generator:
    def __new__(cls, settings: str) -> Generator: ...
    def step(self, mesh: _Mesh, u: _Floats, dt: float) -> tuple[_Floats, str]: ...

def uniform(
    cells: tuple[int, int],
    lower: tuple[float, float],
    upper: tuple[float, float],
    periodic: tuple[bool, bool],
) -> _Floats: ...
def quality(mesh: _Mesh, density: _Floats) -> tuple[float, float, float, float]: ...
def areas(mesh: _Mesh) -> _Floats: ...
def transfer(values: _Floats, old: _Mesh, new: _Mesh, conservative: bool) -> _Floats: ...
def stencils(
    mesh: _Mesh,
    kind: str,
    polynomials: str | None,
    scaling: str | None,
) -> tuple[
    NDArray[np.int64],
    NDArray[np.int64],
    _Floats,
    _Floats,
    list[tuple[tuple[int, int], float]],
]: ...
def check(path: Path | None, origin: str, text: str, set: list[str]) -> str: ...
def run(
    path: Path | None,
    origin: str,
    text: str,
    set: list[str],
    out: Path,
    resume: bool,
    told: Callable[[float, float, int], None] | None,
) -> tuple[BaseException | None, bool]: ...
def equidistribute(density: _Density, cells: int, ends: tuple[float, float], settings: str) -> _Floats: ...
def schwarz(
    density: _Density,
    cells: int,
    ends: tuple[float, float],
    settings: str,
    start: list[float] | None,
) -> tuple[
    tuple[_Floats, _Floats, _Floats, _Floats, _Floats],
    tuple[_Floats, _Floats],
    tuple[float | None, float | None, float | None],
    MeshError | None,
]: ...
