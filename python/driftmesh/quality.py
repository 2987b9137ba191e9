"""How good a mesh is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Quality:
    """How good a mesh is.

    Attributes:
        q_max: Largest Q over the cells; Q = ½ tr(JᵀJ)/√det(JᵀJ) is 1 for a square and grows with stretching and shear.
            It is 1 on a line, whose cells have no shape.
        q_mean: Mean Q over the cells.
        min_scaled_jacobian: Smallest corner Jacobian over that of the uniform mesh; positive as long as no cell is
            folded.
        equidistribution: max/mean of density × area over the cells; 1 is perfect.

    >>> from driftmesh import Mesh
    >>> Mesh.uniform(cells=(4, 4)).quality()
    Quality(q_max=1.0, q_mean=1.0, min_scaled_jacobian=1.0, equidistribution=1.0)
    """

    q_max: float
    q_mean: float
    min_scaled_jacobian: float
    equidistribution: float
