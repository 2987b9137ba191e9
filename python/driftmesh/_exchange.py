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
    nodal, in_cells = _sorted(mesh, fields)
    data = {name: values.ravel() for name, values in nodal.items()}
    cell_data = {name: [values.ravel()] for name, values in in_cells.items()}
    k = np.arange(np.prod(mesh.shape)).reshape(mesh.shape)
    if mesh.dimensions == 1:
        cells = [("line", np.stack([k[:-1], k[1:]], axis=-1))]
    else:
        corners = [k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]]
        cells = [("quad", np.stack(corners, axis=-1).reshape(-1, 4))]
    return meshio.Mesh(_points(mesh).reshape(-1, 3), cells, point_data=data, cell_data=cell_data)


def to_pyvista(mesh: Mesh, fields: Mapping[str, ArrayLike]) -> Any:
    """A ``pyvista.StructuredGrid``."""
    pyvista = _extra("pyvista")
    shape = (*mesh.shape, 1, 1)[:3]
    grid = pyvista.StructuredGrid(*np.moveaxis(_points(mesh).reshape(*shape, 3), -1, 0))
    # its points and cells go along the first axis first
    for data, values_of in zip((grid.point_data, grid.cell_data), _sorted(mesh, fields), strict=True):
        for name, values in values_of.items():
            data[name] = values.ravel(order="F")
    return grid


def to_xarray(mesh: Mesh, fields: Mapping[str, ArrayLike]) -> Any:
    """An ``xarray.Dataset`` over the lattice, with the positions of the nodes as coordinates."""
    xarray = _extra("xarray")
    nodal, in_cells = _sorted(mesh, fields)
    nodes, cells = ("i", "j")[: mesh.dimensions], ("cell_i", "cell_j")[: mesh.dimensions]
    variables = {name: (nodes, values) for name, values in nodal.items()}
    variables |= {name: (cells, values) for name, values in in_cells.items()}
    coordinates = {name: (nodes, values) for name, values in zip("xy", np.moveaxis(mesh._nodes, -1, 0), strict=False)}
    return xarray.Dataset(variables, coordinates)


def _sorted(mesh: Mesh, fields: Mapping[str, ArrayLike]) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Fields with one value a node, and those with one a cell."""
    cells = tuple(n - 1 for n in mesh.shape)
    in_cells = {name: finite(name, values, cells) for name, values in fields.items() if np.shape(values) == cells}
    return {
        name: finite(name, values, mesh.shape) for name, values in fields.items() if name not in in_cells
    }, in_cells


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
