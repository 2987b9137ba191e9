"""Studies: run one, open what it left."""

from __future__ import annotations

import base64
import csv
import json
import re
import sys
import warnings
import xml.etree.ElementTree as ElementTree
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

from . import _driftmesh, _toml
from ._arrays import Floats
from .errors import MeshError, RunWarning
from .mesh import Mesh

if TYPE_CHECKING:
    from matplotlib.animation import FuncAnimation
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class Frame:
    """A state of a run, read from its file when it is first looked at.

    Attributes:
        t: Time; the number of an iteration, for a line without time.
        path: The ``.vtu`` file, which ParaView, PyVista and meshio open too.
        shape: (nx + 1, ny + 1), or (n + 1,) for a line.

    Raises:
        RuntimeError: The file is gone or another one since the run was opened.

    See :class:`Run` for an example.
    """

    t: float
    path: Path
    shape: tuple[int, ...]
    _domain: dict[str, Any] = field(repr=False)
    _stamp: tuple[int, int] | None = field(repr=False)

    @cached_property
    def _arrays(self) -> dict[str, Floats]:
        if self._stamp is None or _stamp(self.path) != self._stamp:
            what = "has been replaced" if self.path.exists() else "is gone"
            raise RuntimeError(
                f"{self.path} {what} since this run was opened, by another run into the same directory perhaps; give each run "
                "a directory of its own with `out`"
            )
        root = ElementTree.parse(self.path).getroot()
        arrays = {}
        for element in root.iterfind(".//Points/DataArray"):
            arrays["points"] = _decoded(element).reshape(*self.shape, 3)
        for element in root.iterfind(".//PointData/DataArray"):
            values = _decoded(element)
            arrays[element.attrib["Name"]] = values.reshape(*self.shape, -1).squeeze(-1) if values.size == np.prod(
                self.shape
            ) else values.reshape(*self.shape, 3)[..., :2]
        return arrays

    @property
    def x(self) -> Floats:
        """x of the nodes, shape (nx + 1, ny + 1)."""
        return np.ascontiguousarray(self._arrays["points"][..., 0])

    @property
    def y(self) -> Floats:
        """y of the nodes, 0 on a line."""
        return np.ascontiguousarray(self._arrays["points"][..., 1])

    @property
    def mesh(self) -> Mesh:
        """The mesh, of kinds in two dimensions, closing nodes of periodic axes included."""
        return Mesh(self.x, self.y, **self._domain)

    @property
    def names(self) -> list[str]:
        """Names of the nodal fields: the unknowns first."""
        return [name for name in self._arrays if name != "points"]

    def __getitem__(self, name: str) -> Floats:
        """A nodal field by name: of the shape of the frame, with two components behind that for a vector."""
        if name not in self.names:
            raise KeyError(f"{name!r}; this frame has {', '.join(self.names)}")
        return self._arrays[name]


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """What a run left behind.

    Attributes:
        directory: The run directory, with ``report.html``, pictures and everything below as files.
        summary: ``summary.json``.
        history: Columns of ``history.csv`` by name, one entry a step (NaN where there is no number); empty for kinds
            without time.
        final: Arrays of ``final.npz`` by name: the last mesh and the unknowns on it.
        frames: States over time, read from the directory when they are looked at: another run into it, and they are gone.

    >>> import tempfile
    >>> from driftmesh import run
    >>> study = {
    ...     "study": {"name": "bump", "kind": "moving-mesh"},
    ...     "grid": {"cells": [12, 12]},
    ...     "time": {"start": 0, "end": 0.01, "step": 0.005},
    ...     "pde": {
    ...         "kind": "formula",
    ...         "unknowns": ["u"],
    ...         "diffusivity": {"u": 0.01},
    ...         "initial": {"u": "exp(-20*((x - 0.5)^2 + (y - 0.5)^2))"},
    ...         "boundary": {"u": "no-flux"},
    ...     },
    ...     "output": {"report": False},
    ... }
    >>> with tempfile.TemporaryDirectory() as out:
    ...     result = run(study, out=out)
    ...     result.status, result.frames[-1].names, result.frames[-1]["u"].shape
    ('completed', ['u', 'rho', 'mesh velocity'], (13, 13))
    """

    directory: Path
    summary: dict[str, Any]
    history: dict[str, Floats]
    final: dict[str, Floats]
    frames: list[Frame]
    _domain: dict[str, Any]

    @property
    def status(self) -> str:
        """``completed``, ``failed``, ``interrupted``, ``not-converged`` or ``running``."""
        return str(self.summary["status"])

    @property
    def mesh(self) -> Mesh:
        """The last mesh, of kinds in two dimensions."""
        return Mesh(self.final["x"], self.final["y"], **self._domain)

    def __repr__(self) -> str:
        steps = self.summary.get("work", {}).get("steps")
        done = "" if steps is None else f" after {steps} steps"
        return f"<Run {self.summary['study']!r}, {self.status}{done}, in {self.directory}>"

    def plot(self, path: str | PathLike[str] | None = None, ax: Axes | None = None) -> Axes:
        """Draws the last state: the mesh over its first unknown, or the convergence of a Schwarz iteration. Needs matplotlib.

        Args:
            path: Where to save the picture, if anywhere.
            ax: Where to draw; a new figure where nothing is said.
        """
        from . import plot

        return plot.run(self, path, ax)

    def animate(self, path: str | PathLike[str] | None = None, field: str | None = None) -> FuncAnimation:
        """The frames as a matplotlib animation of a nodal field, the first unknown by default. Needs matplotlib.

        Args:
            path: Where to save it, if anywhere: ``.gif``, or what else matplotlib can write here.
            field: Name of the field.
        """
        from . import plot

        return plot.animation(self, path, field)


def load(directory: str | PathLike[str]) -> Run:
    """Opens the directory of a run: finished, failed or interrupted.

    Args:
        directory: As given to :func:`run`, or to the program.

    Raises:
        FileNotFoundError: It has no ``summary.json``.

    >>> from driftmesh import load
    >>> load("no/such/run")
    Traceback (most recent call last):
    FileNotFoundError: no/such/run is no run directory: it has no summary.json
    """
    path = Path(directory)
    summary = path / "summary.json"
    if not summary.is_file():
        raise FileNotFoundError(f"{path} is no run directory: it has no summary.json")
    final: dict[str, Floats] = {}
    if (path / "final.npz").is_file():
        with np.load(path / "final.npz") as arrays:
            final = {name: arrays[name] for name in arrays.files}
    told, domain = json.loads(summary.read_text("utf-8")), _domain(path)
    return Run(path, told, _table(path / "history.csv"), final, _frames(path, final, domain), domain)


def run(
    study: str | PathLike[str] | Mapping[str, Any],
    out: str | PathLike[str] | None = None,
    set: Mapping[str, Any] | None = None,
    progress: bool = False,
    resume: bool = False,
) -> Run:
    """Runs a study.

    Args:
        study: A study file, or the same as a dict of tables.
        out: Directory for the results; ``out/<study name>`` where nothing is said. One that a run of ours wrote is
            replaced, with the frames of its result; any other that is not empty is refused. Give each run of a series its own.
        set: Settings on top: dotted keys and values, such as ``{"time.step": 5e-4}``.
        progress: Shows a bar, in terminals and notebooks.
        resume: Goes on from the newest checkpoint in the directory, to the very bits of a run that nothing disturbed. Where
            there is none the run begins at its start; one that is complete is opened as it is.

    Raises:
        driftmesh.StudyError: A mistake in the study: its line, a caret, the nearest key. Nothing is written then.
        driftmesh.MeshError: The computation failed; ``result`` and ``directory`` have everything up to the last good state.
        OSError: What cannot be read or written; :class:`FileExistsError` for a directory with something else in it.
        KeyboardInterrupt: Ctrl-C, which ends the run with its step and leaves the last good state in the run directory,
            with a checkpoint for ``resume``. What cannot be stopped half-way goes on until it is done or the program ends.

    Warns:
        driftmesh.errors.RunWarning: What is allowed but probably not meant; its ``result`` is the run.

    >>> import tempfile
    >>> from driftmesh import run
    >>> study = {
    ...     "study": {"name": "front", "kind": "moving-mesh"},
    ...     "grid": {"cells": [16, 16]},
    ...     "time": {"start": 0.25, "end": 0.3, "step": 0.01},
    ...     "pde": {"kind": "burgers", "viscosity": 0.005},
    ... }
    >>> with tempfile.TemporaryDirectory() as out:
    ...     result = run(study, out=out, set={"time.step": 5e-3})
    >>> result.summary["work"]["steps"], result.history["t"].shape
    (10, (11,))
    """
    if isinstance(study, Mapping):
        given: tuple[Path | None, str, str] = None, "the study", _toml.document(study)
    else:
        if not Path(study).exists():
            raise FileNotFoundError(f"cannot read {study}: there is no such file")
        given = Path(study), "", ""
    if not isinstance(set, Mapping | None):
        raise TypeError(f"`set` is {set!r}, but must be a dict of dotted keys and values")
    for key in set or {}:
        if not isinstance(key, str) or not re.fullmatch(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*", key):
            raise ValueError(f"`set` has the key {key!r}, but must have dotted ones such as 'time.step'")
    assignments = [f"{name}={_toml.value(value)}" for name, value in (set or {}).items()]
    name = _driftmesh.check(*given, assignments)
    directory = Path("out") / name if out is None else Path(out)
    if not resume and any(directory.glob("checkpoint.[01]")):
        left = f"{directory} holds an unfinished run, which this one replaces; with resume=True it would go on"
        warnings.warn(left, RuntimeWarning, stacklevel=2)
    # an exception leaves the bar where it is
    with _bar(name, progress) as told:
        try:
            error, ended = _driftmesh.run(*given, assignments, directory, resume, told)
        except MeshError as failure:
            error, ended = failure, True
        if isinstance(error, MeshError):
            error.directory = directory
            if (directory / "summary.json").is_file():
                error.result = load(directory)
        if isinstance(error, KeyboardInterrupt):
            raise KeyboardInterrupt(_interrupted(directory, ended)) from None
        if error is not None:
            raise error
    result = load(directory)
    for text in result.summary.get("warnings", ()):
        warning = RunWarning(text)
        warning.result = result
        warnings.warn(warning, stacklevel=2)
    return result


def _interrupted(directory: Path, ended: bool) -> str:
    """What a run that was told to stop leaves."""
    if not ended:
        return (
            f"what is being computed cannot be stopped: it goes on in the background until it is left in {directory}, or this "
            "program ends"
        )
    summary = json.loads((directory / "summary.json").read_text("utf-8"))
    if summary["status"] == "interrupted":
        message = summary.get("failure", summary.get("error"))["message"]
        if not (directory / "final.npz").is_file():
            return f"{message}, before the first step"
        on = "; run(…, resume=True) goes on" if any(directory.glob("checkpoint.[01]")) else ""
        return f"{message}; the last good state is in {directory}{on}"
    return f"the run had just ended ({summary['status']}); it is in {directory}"


class _Told(Protocol):
    def __call__(self, share: float, t: float, step: int) -> None: ...


@contextmanager
def _bar(name: str, wanted: bool) -> Iterator[_Told | None]:
    """A progress bar of tqdm, fed with the share of the run that is done."""
    if not wanted:
        yield None
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of widgets that a notebook lacks: there is a bar of text then
        from tqdm.auto import tqdm
    form = "{desc} {percentage:3.0f} %|{bar}| {elapsed}<{remaining}"
    with tqdm(total=1.0, desc=name, bar_format=form, file=sys.stderr, mininterval=0.1) as bar:
        seen = -1

        def told(share: float, t: float, step: int) -> None:
            nonlocal seen
            if step != seen:
                seen = step
                bar.set_description_str(f"{name}: t = {t:.4f}, step {step}", refresh=False)
                bar.update(max(share - bar.n, 0.0))

        yield told
        bar.update(max(1.0 - bar.n, 0.0))


def _table(path: Path) -> dict[str, Floats]:
    """A table of numbers by column; an empty field is NaN."""
    if not path.is_file():
        return {}
    with path.open(newline="", encoding="utf-8") as file:
        rows = csv.reader(file)
        names = next(rows, None)
        if names is None:
            return {}
        # a run that was killed may leave half a row
        values = [[float(entry) if entry else np.nan for entry in row] for row in rows if len(row) == len(names)]
    columns = np.array(values, dtype=np.float64).reshape(-1, len(names)).T
    return {name: np.ascontiguousarray(column) for name, column in zip(names, columns, strict=True)}


def _stamp(path: Path) -> tuple[int, int] | None:
    """What tells a file from one that replaced it; nothing where there is none."""
    try:
        status = path.stat()
    except FileNotFoundError:
        return None
    return status.st_mtime_ns, status.st_size


def _domain(directory: Path) -> dict[str, Any]:
    """The box of a run and the axes that wrap around, where its study says them."""
    study = directory / "study.toml"
    domain = tomllib.loads(study.read_text("utf-8")).get("domain", {}) if study.is_file() else {}
    return {key: domain[key] for key in ("lower", "upper", "periodic")} if "periodic" in domain else {}


def _frames(directory: Path, final: Mapping[str, Floats], domain: dict[str, Any]) -> list[Frame]:
    index = directory / "run.pvd"
    x = final.get("x")
    if not index.is_file() or x is None:
        return []
    entries: Sequence[ElementTree.Element] = ElementTree.parse(index).getroot().findall(".//DataSet")
    shape: tuple[int, ...] = x.shape
    files = [(float(entry.attrib["timestep"]), directory / entry.attrib["file"]) for entry in entries]
    return [Frame(t, path, shape, domain, _stamp(path)) for t, path in files]


def _decoded(element: ElementTree.Element) -> Floats:
    """An array of a ``.vtu`` file as we write it: a header of four sizes and one compressed block, both in base64."""
    text = "".join((element.text or "").split())
    header = 4 * ((4 * 8 + 2) // 3)
    block = zlib.decompress(base64.b64decode(text[header:]))
    types = {"Float64": "<f8", "Int64": "<i8", "Int32": "<i4", "UInt8": "u1"}
    return np.frombuffer(block, dtype=types[element.attrib["type"]]).astype(np.float64)
