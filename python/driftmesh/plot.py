"""Pictures, by matplotlib, which is imported here and nowhere else."""

from __future__ import annotations

from os import PathLike, fspath
from typing import TYPE_CHECKING, Any

import numpy as np

from ._arrays import Floats

try:
    import matplotlib.pyplot as plt
    from matplotlib.animation import FuncAnimation
    from matplotlib.collections import LineCollection
except ImportError as missing:
    raise ImportError("this needs matplotlib: pip install 'driftmesh[plot]'") from missing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.figure import Figure

    from .mesh import Mesh
    from .frames import Frame
    from .study import Run


def mesh(of: Mesh, u: Floats | None, ax: Axes | None) -> Axes:
    """The lines of a mesh, over colours; of a line its nodes, below u."""
    if of.dimensions == 1:
        ax = _axes(ax)
        ax.plot(of.x, np.zeros(of.shape) if u is None else u, marker="|")
        ax.set_xlabel("x")
        return ax
    return _state(of.x, of.y, u, _axes(ax))


def convergence(error: Floats, ax: Axes | None, **line: Any) -> Axes:
    """Errors over iterations."""
    ax = _axes(ax)
    ax.semilogy(np.where(error > 0, error, np.nan), **line)
    ax.set_xlabel("iteration")
    ax.set_ylabel("largest error of the mesh")
    return ax


def run(of: Run, path: str | PathLike[str] | None, ax: Axes | None) -> Axes:
    """The last state of a run: the mesh over its first unknown, errors over iterations, or values over a line."""
    own = ax is None
    ax = _axes(ax)
    iterates = of.summary.get("iterations")
    x, y = of.final.get("x"), of.final.get("y")
    if x is not None and y is not None and x.ndim == 2:
        name = _first(of.final)
        _state(x, y, of.final[name], ax)
        ax.set_title(_title(of.summary["study"], name, float(of.final["t"]) if "t" in of.final else None))
    elif iterates:
        convergence(np.array([iterate["error_linf"] for iterate in iterates]), ax)
        ax.set_title(of.summary["study"])
    elif of.summary.get("mesh"):
        nodes = np.array(of.summary["mesh"])
        ax.plot(np.linspace(0.0, 1.0, len(nodes)), nodes)
        ax.set_xlabel("ξ")
        ax.set_ylabel("x")
        ax.set_title(of.summary["study"])
    elif x is not None and x.ndim == 1 and "t" in of.final:
        for name, values in of.final.items():
            if name not in ("x", "phase") and values.shape == x.shape:
                ax.plot(x, values, label=name)
        ax.set_xlabel("x")
        ax.legend()
        ax.set_title(f"{of.summary['study']}, t = {float(of.final['t']):.4g}")
    else:
        raise ValueError(f"{of.directory} has no state to draw: the run is {of.status}")
    if path is not None:
        _figure(ax).savefig(fspath(path), dpi=150)
        if own:
            plt.close(_figure(ax))
    return ax


def animation(of: Run, path: str | PathLike[str] | None, field: str | None) -> FuncAnimation:
    """The frames of a run, one after the other."""
    if not of.frames:
        raise ValueError(f"{of.directory} has no frames to animate")
    name = of.frames[0].names[0] if field is None else field
    values = [frame[name] for frame in of.frames]
    if values[0].ndim != len(of.frames[0].shape):
        raise ValueError(f"`field` is {name!r}, a vector of shape {values[0].shape}; give one with a value a node")
    limits = min(v.min() for v in values), max(v.max() for v in values)
    ax = _axes(None)
    if values[0].ndim == 1:
        return _moving_line(of, values, name, ax, limits, path)
    _state(of.frames[0].x, of.frames[0].y, values[0], ax, limits)
    ax.set_title(_title(of.summary["study"], name, of.frames[0].t))
    # laid out once: the frames differ in what is inside
    _figure(ax).canvas.draw()
    _figure(ax).set_layout_engine("none")

    def draw(number: int) -> list[Any]:
        frame: Frame = of.frames[number]
        for old in list(ax.collections):
            old.remove()
        _fill(frame.x, frame.y, values[number], ax, limits)
        ax.set_title(_title(of.summary["study"], name, frame.t))
        return []

    return _moving(ax, draw, len(of.frames), path)


def _moving_line(
    of: Run, values: list[Floats], name: str, ax: Axes, limits: tuple[float, float], path: str | PathLike[str] | None
) -> FuncAnimation:
    """A field over x, through the nodes of a line."""
    [curve] = ax.plot(of.frames[0].x, values[0], marker=".")
    room = 0.05 * (limits[1] - limits[0]) or 0.5
    ax.set_ylim(limits[0] - room, limits[1] + room)
    ax.set_xlabel("x")
    ax.set_ylabel(name)

    def draw(number: int) -> list[Any]:
        curve.set_data(of.frames[number].x, values[number])
        ax.set_title(f"{of.summary['study']}, {'t =' if 't' in of.history else 'iteration'} {of.frames[number].t:.4g}")
        return []

    return _moving(ax, draw, len(of.frames), path)


def _moving(ax: Axes, draw: Any, frames: int, path: str | PathLike[str] | None) -> FuncAnimation:
    moving = FuncAnimation(_figure(ax), draw, frames=frames, init_func=lambda: [], interval=100)
    if path is not None:
        moving.save(fspath(path), writer="pillow" if fspath(path).endswith(".gif") else None)
        plt.close(_figure(ax))
    return moving


def _axes(ax: Axes | None) -> Axes:
    return plt.subplots(layout="constrained")[1] if ax is None else ax


def _figure(ax: Axes) -> Figure:
    figure = ax.get_figure(root=True)
    assert figure is not None
    return figure


def _first(final: dict[str, Floats]) -> str:
    return next(name for name in final if name not in ("x", "y", "t"))


def _title(study: str, name: str, t: float | None) -> str:
    return f"{study}: {name}" if t is None else f"{study}: {name}, t = {t:.4g}"


def _state(x: Floats, y: Floats, u: Floats | None, ax: Axes, limits: tuple[float, float] | None = None) -> Axes:
    colours = _fill(x, y, u, ax, limits)
    if colours is not None:
        _figure(ax).colorbar(colours, ax=ax)
    ax.autoscale_view()
    ax.set_aspect("equal")
    ax.set_xlabel("x")
    ax.set_ylabel("y")
    return ax


def _fill(x: Floats, y: Floats, u: Floats | None, ax: Axes, limits: tuple[float, float] | None) -> QuadMesh | None:
    """The lines of a mesh, and colours: of a cell, the mean of its corners."""
    colours = None
    if u is not None:
        means = 0.25 * (u[:-1, :-1] + u[1:, :-1] + u[:-1, 1:] + u[1:, 1:])
        low, high = (u.min(), u.max()) if limits is None else limits
        colours = ax.pcolormesh(x, y, means, vmin=low, vmax=high)
    along = [np.stack([x, y], axis=-1), np.stack([x.T, y.T], axis=-1)]
    lines = [line for lines in along for line in lines]
    ax.add_collection(
        LineCollection(
            lines, colors="black" if u is None else "white", linewidths=0.3, alpha=0.7 if u is None else 0.35
        )
    )
    return colours
