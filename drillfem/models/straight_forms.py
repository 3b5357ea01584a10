"""Matrices of a straight string from the one weak form, which is linear but for the ends of the string."""

from __future__ import annotations

import numpy as np
import ufl

from ..compat import Array, MatrixForm
from ..forms import virtual_work as vw
from ..scene import Scene
from .rod import Rod
from .straight import Matrices


def matrices_of(scene: Scene) -> tuple[Matrices | None, Matrices]:
    """Axial (None for the torsional model) and torsional matrices of a scene, compiled from the weak form."""
    rod = Rod(scene)
    return (channel(rod, "v3", "r3") if "r3" in rod.ansatz.x_names else None), channel(rod, "w3", "phi")


def channel(rod: Rod, speed: str, position: str) -> Matrices:
    """Mass, damping, stiffness and nodal weights of one motion: axial (kg, N s/m, N/m, N), torsional (kg m2 ...).

    They are the derivatives of the named terms of the weak form; the end conditions are not applied.
    """
    a = rod.ansatz
    trial = ufl.TrialFunction(rod.V)

    def block(term: ufl.Form, by: object, column: str) -> Array:
        dense = MatrixForm(ufl.derivative(term, by, trial)).dense()
        i = rod.nodes * a.size
        return dense[np.ix_(i + a.index(speed), i + a.index(column))]

    def sum_of(*names: str) -> ufl.Form:
        return vw.total({k: rod.terms[k] for k in names if k in rod.terms})

    rod.set_state(np.zeros(rod.size), np.zeros(rod.size))
    # gravity turns nothing: its torsional form is empty
    weight = (
        -rod.gravity_vector().reshape(-1, a.size)[rod.nodes, a.index(speed)] if speed == "v3" else 0 * rod.arc_length
    )
    return Matrices(
        block(sum_of("inertia", "top drive", "tip load", "lumped inertia"), rod.u_dot, speed),
        block(rod.terms["damping"], rod.u, speed),
        block(sum_of("internal force", "internal moment"), rod.u, position),
        weight,
    )
