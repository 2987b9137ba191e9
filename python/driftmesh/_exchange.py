"""Meshes as those of other packages."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import Floats, finite

if TYPE_CHECKING:
    from .mesh import Mesh


def to_meshio(mesh: Mesh, fields: Mapping[str, ArrayLike]) -> Any:
    """A ``meshio.Mesh`` of lines or quadrilaterals."""
    meshio = _extra("meshio")
    data = {name: finite(name, values, mesh.shape).ravel() for name, values in fields.items()}
    k = np.arange(np.prod(mesh.shape)).reshape(mesh.shape)
    if mesh.dimensions == 1:
        cells = [("line", np.stack([k[:-1], k[1:]], axis=-1))]
    else:
        corners = [k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]]
        cells = [("quad", np.stack(corners, axis=-1).reshape(-1, 4))]
    return meshio.Mesh(_points(mesh).reshape(-1, 3), cells, point_data=data)


def to_pyvista(mesh: Mesh, fields: Mapping[str, ArrayLike]) -> Any:
    """A ``pyvista.StructuredGrid``."""
    pyvista = _extra("pyvista")
    shape = (*mesh.shape, 1, 1)[:3]
    grid = pyvista.StructuredGrid(*np.moveaxis(_points(mesh).reshape(*shape, 3), -1, 0))
    for name, values in fields.items():
        # its points go along the first axis first
        grid.point_data[name] = finite(name, values, mesh.shape).ravel(order="F")
    return grid


def _points(mesh: Mesh) -> Floats:
    """Positions with three coordinates."""
    nodes = mesh._nodes
    points = np.zeros((*mesh.shape, 3))
    points[..., : mesh.dimensions] = nodes
    return points


def _extra(name: str) -> Any:
    """An optional package."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(f"this needs {name}: pip install 'driftmesh[{name}]'") from error
