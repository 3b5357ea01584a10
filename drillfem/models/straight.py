"""A straight string is linear except at its two ends: its matrices, from the axial-torsional weak form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import ufl

from ..compat import Array, MatrixForm
from ..forms import virtual_work as vw
from .rod import Rod


@dataclass(frozen=True)
class Matrices:
    """Mass, damping and stiffness (nodes, nodes) of one kind of motion, nodes from the top down."""

    mass: Array
    damping: Array
    stiffness: Array


def matrices(rod: Rod) -> tuple[Matrices, Matrices]:
    """Axial (kg, N s/m, N/m) and torsional (kg m2, N m s, N m) matrices of an axial-torsional rod.

    They are the derivatives of the named terms of the weak form; the end conditions are not applied.
    """
    a = rod.ansatz
    trial = ufl.TrialFunction(rod.V)

    def block(term: ufl.Form, by: object, row: str, column: str) -> Array:
        dense = MatrixForm(ufl.derivative(term, by, trial)).dense()
        i = rod.nodes * a.size
        return dense[np.ix_(i + a.index(row), i + a.index(column))]

    rod.set_state(np.zeros(rod.size), np.zeros(rod.size))
    inner = vw.total({k: rod.terms[k] for k in ("internal force", "internal moment")})
    inertia = vw.total({k: rod.terms[k] for k in ("inertia", "top drive", "tip load")})

    def channel(speed: str, position: str) -> Matrices:
        return Matrices(
            block(inertia, rod.u_dot, speed, speed),
            block(rod.terms["damping"], rod.u, speed, speed),
            block(inner, rod.u, speed, position),
        )

    return channel("v3", "r3"), channel("w3", "phi")
