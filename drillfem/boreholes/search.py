"""`drillfem.boreholes.closest.project` for loops in C; compiled when this is imported."""

from __future__ import annotations

from numba import carray

from ..bitrock.jit import callback
from .closest import project
from .table import Table


@callback(
    "void(CPointer(f8), i8, CPointer(i4), i8, i8, CPointer(f8), i8, CPointer(f8), CPointer(f8), i8, CPointer(f8), "
    "CPointer(f8), CPointer(f8), i8, CPointer(f8), CPointer(f8), i8, CPointer(f8), CPointer(f8), i8, CPointer(f8))"
)
def search(  # type: ignore[no-untyped-def]
    u, n, cells, n_cells, per_cell, basis, n_points, radius, knots, n_knots, coefficients,
    radius_at, hole_radius, n_radius, friction_at, friction, n_friction, p, out, width, found,
) -> None:  # fmt: skip
    """`project` for C, of nodes u (n, 3). found (4,): smallest gap, points that are lost, least and greatest depth."""
    table = Table(
        carray(knots, (n_knots,)),
        carray(coefficients, (n_knots - 1, 6, 3)),
        carray(radius_at, (n_radius,)),
        carray(hole_radius, (n_radius,)),
        carray(friction_at, (n_friction,)),
        carray(friction, (n_friction, 2)),
    )
    points = n_cells * n_points
    result = project(
        carray(u, (3 * n,)),
        3,
        carray(cells, (n_cells, per_cell)),
        carray(basis, (n_points, per_cell)),
        carray(radius, (n_cells,)),
        table,
        carray(p, (points,)),
        carray(out, (points, width)),
    )
    found[0], found[1], found[2], found[3] = result.gap, result.lost, result.low, result.high
