"""The viewer of the report in a notebook, live while a run goes on. It needs anywidget: ``driftmesh[widget]``."""

from __future__ import annotations

import json
import time
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from . import _driftmesh
from ._arrays import Floats, finite, scalar
from .mesh import Mesh

try:
    import anywidget
    import traitlets
except ImportError as missing:
    raise ImportError('driftmesh.widget needs anywidget; install it by pip install "driftmesh[widget]"') from missing

if TYPE_CHECKING:
    from .study import Run

#: Seconds between two updates at least.
PAUSE = 0.5
#: An update waits for at least so many times as long as the last one took.
PATIENCE = 4.0
#: With more frames than this in memory every second one is left out.
MOST_FRAMES = 400


class View(anywidget.AnyWidget):  # type: ignore[misc]
    """A view of a moving mesh for Jupyter, VS Code, Colab and marimo: play it, point at it, zoom into it

    It is the viewer of ``report.html``, in a frame of its own. It shows the frames of a run, also while that goes on,
    or those that a loop of yours gives it by :meth:`show`. One that shows the last frame goes on to each new one.

    Args:
        run: A :class:`driftmesh.Run`, or the directory of one, finished or going on; None for frames of your own.

    Attributes:
        data: What is shown, as JSON; ``""`` for nothing.
        page: The page in the frame.

    Raises:
        ValueError: The directory is not that of a run.

    Updates come every half second at most, and the last one when the cell of the notebook has ended, or with
    :meth:`flush`. ``driftmesh.run(…, view=view)`` shows a run while it goes on.

    >>> import json
    >>> from driftmesh import Mesh, MeshGenerator
    >>> from driftmesh.widget import View
    >>> view, mesh = View(), Mesh.uniform(cells=(20, 20))  # as the last line of a cell it is displayed
    >>> for step in range(5):
    ...     mesh = MeshGenerator(monitor=1 + 9 * mesh.x).step(mesh, None, dt=0.1)
    ...     view.show(mesh, t=0.1 * (step + 1), u=mesh.x * mesh.y)
    >>> view.flush()
    >>> json.loads(view.data)["meshes"][0]["times"]
    [0.1, 0.2, 0.30000000000000004, 0.4, 0.5]
    """

    _esm = _driftmesh.viewer_files(False, "t")[1]
    data = traitlets.Unicode("").tag(sync=True)
    page = traitlets.Unicode("").tag(sync=True)

    def __init__(self, run: Run | str | PathLike[str] | None = None) -> None:
        super().__init__()
        self._directory: Path | None = None
        self._frames: list[tuple[float, Floats, Floats, list[tuple[str, Floats]]]] = []
        self._mesh: Mesh | None = None
        self._due, self._late = 0.0, False
        if run is not None:
            directory = getattr(run, "directory", run)
            self.watch(directory)
            self.flush()
        _after_each_cell(self)

    def watch(self, directory: str | PathLike[str]) -> None:
        """Shows the run in a directory from now on, as it is at each :meth:`update`."""
        self._directory, self._frames, self._late = Path(directory), [], True

    def update(self) -> None:
        """Shows what there is now, unless the last update is too recent."""
        self._late = True
        if time.monotonic() >= self._due:
            self.flush()

    def show(self, mesh: Mesh, t: float, **fields: ArrayLike) -> None:
        """Adds a frame: a mesh at a time, with fields on it by name.

        Args:
            mesh: The mesh, of the same number of cells as those before.
            t: The time, later than those before.
            fields: Values at the nodes, of the shape of the mesh: the same names as before.

        Raises:
            ValueError: Another shape, other names, a time that is not later, or values that are not finite.

        >>> from driftmesh import Mesh
        >>> from driftmesh.widget import View
        >>> view, line = View(), Mesh.uniform(cells=8)
        >>> view.show(line, t=0.0, u=line.x)
        >>> view.show(line, t=1.0, v=line.x)
        Traceback (most recent call last):
        ValueError: the fields are v, but those before are u; give the same with each frame
        """
        if not isinstance(mesh, Mesh):
            raise ValueError(f"`mesh` is of type {type(mesh).__name__}, but must be a driftmesh.Mesh")
        t = scalar("t", t)
        values = [(name, finite(name, field, mesh.shape)) for name, field in fields.items()]
        names = ", ".join(fields) or "none"
        if self._directory is not None:
            raise ValueError("this view shows the run in a directory; make another one with View() for your own frames")
        if self._frames:
            before, first, _, known = self._frames[-1]
            if first.shape != mesh.shape:
                raise ValueError(f"`mesh` has shape {mesh.shape}, but those before have shape {first.shape}")
            if t <= before:
                raise ValueError(f"`t` is {t}, but must be later than {before}, the time of the frame before")
            if list(fields) != [name for name, _ in known]:
                others = ", ".join(name for name, _ in known) or "none"
                both = f"the fields are {names}, but those before are {others}"
                raise ValueError(f"{both}; give the same with each frame")
        x = np.ascontiguousarray(mesh.x)
        y = np.zeros_like(x) if mesh.dimensions == 1 else np.ascontiguousarray(mesh.y)
        # a later write to the array of the caller must not change what is shown
        self._frames.append((t, x, y, [(name, field.copy()) for name, field in values]))
        if len(self._frames) > MOST_FRAMES:
            self._frames = self._frames[:-1:2] + self._frames[-1:]
        self._mesh = mesh
        self.update()

    def flush(self) -> None:
        """Shows what there is now."""
        if not self._late:
            return
        began = time.monotonic()
        data = self._read()
        self._late = False
        if data is not None and data != self.data:
            told = json.loads(data)
            page = _driftmesh.viewer_files(told["line"], told["clock"])[0]
            # together, so that no data meet the page of another viewer
            with self.hold_sync():
                self.page, self.data = page, data
        ended = time.monotonic()
        self._due = ended + max(PAUSE, PATIENCE * (ended - began))

    def _read(self) -> str | None:
        if self._directory is not None:
            return _driftmesh.viewer_data(self._directory)
        if self._mesh is None:
            return None
        mesh, corners = self._mesh, None
        if any(mesh.periodic) or mesh.dimensions == 1:
            # a periodic mesh leaves its box, and a line has no height
            corners = [[*mesh.lower, 0.0][:2], [*mesh.upper, 0.0][:2]]
        periodic = (*mesh.periodic, False)[:2]
        return _driftmesh.viewer_data_of(self._frames, corners, periodic)


def _after_each_cell(view: View) -> None:
    """Shows the last frames of a loop when the cell of the notebook that it is in has ended."""
    try:
        from IPython import get_ipython
    except ImportError:
        return
    shell: Any = get_ipython()
    if shell is not None:
        shell.events.register("post_run_cell", lambda _result: view.flush())
