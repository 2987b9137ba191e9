"""Studies: run one, and open the directory that a run left."""

from __future__ import annotations

import csv
import json
import re
import sys
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
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
from ._arrays import threads as _threads
from .errors import MeshError, RunWarning
from .frames import Frame, frames_of
from .mesh import Mesh

if TYPE_CHECKING:
    from matplotlib.animation import FuncAnimation
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class Fronts:
    """The front between two phases at every step of a run; see :attr:`Run.fronts` for an example.

    Attributes:
        t: Times of the steps, shape (steps + 1,).
        x: x of the columns, shape (nx + 1,).
        y: Height of the front, shape (steps + 1, nx + 1).
    """

    t: Floats
    x: Floats
    y: Floats


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """What a run left behind.

    Attributes:
        directory: The run directory, with ``report.html``, pictures and everything below as files.
        summary: ``summary.json``.
        history: Columns of ``history.csv`` by name, one entry a step (NaN where there is no number); empty for kinds
            without time.
        final: Arrays of ``final.npz`` by name: the last mesh and the unknowns on it.
        frames: States over time. Each is read from the directory when it is first looked at, so that it is lost where
            another run has replaced it.

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
    ...     result.status, result.frames[-1].names[:3], result.frames[-1]["u"].shape
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
        """The last mesh, in the plane or of a line."""
        return Mesh(self.final["x"], self.final.get("y"), **self._domain)

    @cached_property
    def fronts(self) -> Fronts:
        """The front of a study of kind ``stefan`` as a curve over x at every step, from ``front.csv``.

        ``plt.plot(run.fronts.x, run.fronts.y[-1])`` draws where it ends.

        Raises:
            ValueError: The run has none. Of species on a line the places are columns of ``history``.
        """
        columns = _table(self.directory / "front.csv")
        if "t" not in columns:
            raise ValueError(
                f"{self.directory} has no front.csv: only studies of kind `stefan` in the plane leave one; the fronts "
                "of species on a line are columns of `history`"
            )
        x = np.array([float(name.removeprefix("x=")) for name in columns if name != "t"])
        y = np.stack([column for name, column in columns.items() if name != "t"], axis=1)
        return Fronts(columns["t"], x, y)

    def __repr__(self) -> str:
        steps = self.summary.get("work", {}).get("steps")
        done = "" if steps is None else f" after {steps} steps"
        return f"<Run {self.summary['study']!r}, {self.status}{done}, in {self.directory}>"

    def plot(self, path: str | PathLike[str] | None = None, ax: Axes | None = None) -> Axes:
        """Draws the last state: the mesh over its first unknown, or the convergence of a Schwarz iteration. Needs
        matplotlib.

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
    return Run(path, told, _table(path / "history.csv"), final, frames_of(path, final, domain), domain)


def studies(directory: str | PathLike[str] = "studies") -> list[Path]:
    """Write the example studies, with the files they read, into a directory, and return the paths of all.

    Args:
        directory: The directory, which is made if it does not exist; files that are there already under the same names
            are kept.

    Raises:
        OSError: The directory cannot be written.

    >>> import tempfile
    >>> from driftmesh import studies
    >>> with tempfile.TemporaryDirectory() as directory:
    ...     "burgers.toml" in [path.name for path in studies(directory)]
    True
    """
    return _driftmesh.write_examples(Path(directory))


def run(
    study: str | PathLike[str] | Mapping[str, Any],
    out: str | PathLike[str] | None = None,
    set: Mapping[str, Any] | None = None,
    progress: bool = False,
    resume: bool = False,
    threads: int | None = None,
) -> Run:
    """Runs a study.

    Args:
        study: A study file, or its tables as a dict.
        out: Directory for the results; by default ``out/<study name>``. The directory of an earlier run is
            replaced, with the frames of its result; any other that is not empty is refused.
        set: Settings that replace those of the study, by dotted key, such as ``{"time.step": 5e-4}``.
        progress: Shows a progress bar (of tqdm), in terminals and notebooks.
        resume: Goes on from the newest checkpoint in the directory; the results have the same bits as those of a run
            without interruption. Without a checkpoint the run begins at its start. A complete one is opened, or goes on
            to a later end where ``time.end`` is later now.
        threads: Number of threads; all cores where nothing is said. The results have the same bits for any number.

    Raises:
        driftmesh.StudyError: A mistake in the study. The message shows its line with a caret and, for a key that does
            not exist, the nearest one that does. Nothing has been written.
        driftmesh.MeshError: The computation failed; its ``result`` and ``directory`` hold everything up to the last
            good state.
        OSError: A file that cannot be read or written; :class:`FileExistsError` for a directory of something else.
        KeyboardInterrupt: Ctrl-C. The run ends with its step and leaves the last good state in its directory, with a
            checkpoint for ``resume``. A computation that cannot be stopped half-way goes on in the background until it
            is done or the program ends.

    Warns:
        driftmesh.errors.RunWarning: A setting that is allowed but probably not meant, or a result in doubt; the
            ``result`` of the warning is the run.

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
    given, assignments, number = _text_of(study), _assignments(set), _threads(threads)
    name = _driftmesh.check(*given, assignments)
    directory = Path("out") / name if out is None else Path(out)
    if not resume:
        _warn_of_unfinished(directory)
    # an exception leaves the bar where it is
    with _bar(name, progress) as told:
        try:
            error, ended = _driftmesh.run(*given, assignments, directory, resume, number, told)
        except MeshError as failure:
            error, ended = failure, True
        _raise(error, ended, directory)
    result = load(directory)
    _warn(result)
    return result


def _warn_of_unfinished(directory: Path) -> None:
    """Warns the caller of :func:`run` of a run that this one replaces and that could have gone on."""
    if any(directory.glob("checkpoint.[01]")):
        left = f"{directory} holds an unfinished run, which this one replaces; with resume=True it would go on"
        warnings.warn(left, RuntimeWarning, stacklevel=3)


def _warn(result: Run) -> None:
    """Warns the caller of :func:`run` of what the run itself thought doubtful."""
    for text in result.summary.get("warnings", ()):
        warning = RunWarning(text)
        warning.result = result
        warnings.warn(warning, stacklevel=3)


def _text_of(study: str | PathLike[str] | Mapping[str, Any]) -> tuple[Path | None, str, str]:
    """A study as the library reads it: its file, or the name and text of one that is a dict."""
    if isinstance(study, Mapping):
        return None, "the study", _toml.document(study)
    if not Path(study).exists():
        raise FileNotFoundError(f"cannot read {study}: there is no such file")
    return Path(study), "", ""


def _assignments(set: Mapping[str, Any] | None) -> list[str]:
    """Settings on top of a study, as ``--set`` takes them."""
    if not isinstance(set, Mapping | None):
        raise TypeError(f"`set` is {set!r}, but must be a dict of dotted keys and values")
    for key in set or {}:
        if not isinstance(key, str) or not re.fullmatch(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*", key):
            raise ValueError(f"`set` has the key {key!r}, but must have dotted ones such as 'time.step'")
    return [f"{name}={_toml.value(value)}" for name, value in (set or {}).items()]


def _raise(error: BaseException | None, ended: bool, directory: Path) -> None:
    """Raises what ended a run, if anything did; a failure of the mathematics carries what the run left."""
    if isinstance(error, MeshError):
        error.directory = directory
        if (directory / "summary.json").is_file():
            error.result = load(directory)
    if isinstance(error, KeyboardInterrupt):
        raise KeyboardInterrupt(_interrupted(directory, ended)) from None
    if error is not None:
        raise error


def _interrupted(directory: Path, ended: bool) -> str:
    """What a run that was told to stop leaves."""
    if not ended:
        return (
            f"what is being computed cannot be stopped: it goes on in the background until it is left in {directory}, "
            "or this program ends"
        )
    summary = json.loads((directory / "summary.json").read_text("utf-8"))
    if summary["status"] == "interrupted":
        message = summary.get("failure", summary.get("error"))["message"]
        if not (directory / "final.npz").is_file():
            return f"{message}, before the first step"
        left = [*directory.glob("checkpoint.[01]"), *directory.glob("final.state")]
        on = "; run(…, resume=True) goes on" if left else ""
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


def _domain(directory: Path) -> dict[str, Any]:
    """The box of a run and the axes that wrap around or are closed, where its study says them."""
    study = directory / "study.toml"
    domain = tomllib.loads(study.read_text("utf-8")).get("domain", {}) if study.is_file() else {}
    if {"map", "top", "mesh"} & domain.keys():
        return {"closed": domain["closed"]} if any(domain.get("closed", [])) else {}
    return {key: domain[key] for key in ("lower", "upper", "periodic")} if "periodic" in domain else {}
