"""The native half of the package; private."""

from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import final

import numpy as np
from numpy.typing import NDArray

from .errors import MeshError

__all__ = [
    "VERSION",
    "Chart",
    "Generator",
    "areas",
    "check",
    "edges",
    "equidistribute",
    "interpolate",
    "poisson",
    "quality",
    "quarters",
    "read_nodes",
    "run",
    "schwarz",
    "transfer",
    "uniform",
]

VERSION: str

_Floats = NDArray[np.float64]
_Mesh = tuple[_Floats, tuple[float, ...], tuple[float, ...], tuple[bool, ...], "Chart | None"]
_Named = tuple[str, str | None, str | None]
_Density = tuple[str, str] | tuple[list[float], list[float]] | Callable[[_Floats], _Floats]

@final
class Generator:
    def __new__(cls, settings: str, threads: int | None, lines: bool) -> Generator: ...
    def step(self, mesh: _Mesh, u: _Floats, dt: float) -> tuple[_Floats, str]: ...
    def density(self, mesh: _Mesh, u: _Floats) -> _Floats: ...
    def adapt(self, mesh: _Mesh, follow: Callable[[_Floats], _Floats]) -> tuple[_Floats, str]: ...
    def memory(self) -> bytes: ...
    def remember(self, memory: bytes) -> None: ...

class Chart:
    @staticmethod
    def formulas(x: str, y: str, closed: Sequence[bool]) -> Chart: ...
    @staticmethod
    def nodes(nodes: _Floats, closed: Sequence[bool]) -> Chart: ...
    def positions(self, places: _Floats) -> _Floats: ...
    def ends(self) -> tuple[list[float], list[float]]: ...

def read_nodes(path: str | PathLike[str]) -> _Floats: ...
def uniform(
    cells: Sequence[int],
    lower: Sequence[float],
    upper: Sequence[float],
    periodic: Sequence[bool],
) -> _Floats: ...
def quality(mesh: _Mesh, density: _Floats) -> tuple[float, float, float, float]: ...
def areas(mesh: _Mesh) -> _Floats: ...
def transfer(
    values: _Floats,
    old: _Mesh,
    new: _Mesh,
    how: tuple[int, tuple[float, float] | None],
    threads: int | None,
) -> _Floats: ...
def interpolate(mesh: _Mesh, fields: _Floats, points: _Floats, cubic: bool) -> tuple[_Floats | None, int]: ...
def edges(mesh: _Mesh, kind: _Named) -> _Floats: ...
def poisson(
    mesh: _Mesh,
    kind: _Named,
    diffusivity: tuple[_Floats, _Floats | None] | None,
    sides: tuple[_Floats, list[list[bool]]] | None,
) -> tuple[
    NDArray[np.int64],
    NDArray[np.int64],
    _Floats,
    _Floats,
    list[tuple[tuple[int, int], float]],
]: ...
def quarters(mesh: _Mesh) -> _Floats: ...
def check(path: Path | None, origin: str, text: str, set: list[str]) -> str: ...
def run(
    path: Path | None,
    origin: str,
    text: str,
    set: list[str],
    out: Path,
    resume: bool,
    threads: int | None,
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
def program(words: list[str]) -> int: ...
def write_examples(directory: Path) -> list[Path]: ...
