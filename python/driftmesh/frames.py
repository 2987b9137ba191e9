"""Frames: the states over time that a run left in its directory."""

from __future__ import annotations

import base64
import xml.etree.ElementTree as ElementTree
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ._arrays import Floats
from .mesh import Mesh


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
                f"{self.path} {what} since this run was opened, by another run into the same directory perhaps; "
                "give each run a directory of its own with `out`"
            )
        root = ElementTree.parse(self.path).getroot()
        arrays = {}
        for element in root.iterfind(".//Points/DataArray"):
            arrays["points"] = _decoded(element).reshape(*self.shape, 3)
        cells = tuple(n - 1 for n in self.shape)
        for place, shape in (("PointData", self.shape), ("CellData", cells)):
            for element in root.iterfind(f".//{place}/DataArray"):
                values = _decoded(element)
                scalar = values.size == np.prod(shape)
                arrays[element.attrib["Name"]] = values.reshape(shape) if scalar else values.reshape(*shape, 3)[..., :2]
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
        """The mesh, in the plane or of a line, closing nodes of periodic axes included."""
        return Mesh(self.x, self.y if len(self.shape) == 2 else None, **self._domain)

    @property
    def names(self) -> list[str]:
        """Names of the fields, those of the nodes first and of these the unknowns."""
        return [name for name in self._arrays if name != "points"]

    def __getitem__(self, name: str) -> Floats:
        """A field by name: of the shape of the frame, one less along each axis where it has one value a cell, with two
        components behind that for a vector."""
        if name not in self.names:
            raise KeyError(f"{name!r}; this frame has {', '.join(self.names)}")
        return self._arrays[name]


def frames_of(directory: Path, final: Mapping[str, Floats], domain: dict[str, Any]) -> list[Frame]:
    """The frames that the index of a run directory names; none where it has no index or no final mesh."""
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


def _stamp(path: Path) -> tuple[int, int] | None:
    """What tells a file from one that replaced it; nothing where there is none."""
    try:
        status = path.stat()
    except FileNotFoundError:
        return None
    return status.st_mtime_ns, status.st_size
