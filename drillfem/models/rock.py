"""The rock surface of a scene on its own periodic mesh: advection operators from the UFL forms."""

from __future__ import annotations

import numpy as np
import ufl
from mpi4py import MPI

from ..bitrock.dg import DGOperators
from ..compat import Array, MatrixForm, VectorForm, discontinuous
from ..forms import surface as forms
from ..meshes.periodic import ordered_dofs, sector_mesh


def advection_operators(degree: int, elements: int, width: float) -> DGOperators:
    """Discontinuous Galerkin operators of a sector of ``width`` (rad), assembled by DOLFINx, dofs sorted by angle."""
    mesh = sector_mesh(MPI.COMM_SELF, width, elements).mesh
    V = discontinuous(mesh, degree)
    order, nodes = ordered_dofs(V)
    L, test = ufl.TrialFunction(V), ufl.TestFunction(V)
    dx, interior, ends = (ufl.Measure(kind, mesh) for kind in ("dx", "dS", "ds"))

    def matrix(form: ufl.Form) -> Array:
        return MatrixForm(form).dense()[np.ix_(order, order)]

    def vector(form: ufl.Form) -> Array:
        return VectorForm(form)(np.zeros(len(order)))[order]

    return DGOperators(
        mass=matrix(forms.mass(L, test, dx)),
        forward=matrix(forms.transport(L, test, True, dx, interior, ends)),
        backward=matrix(forms.transport(L, test, False, dx, interior, ends)),
        left=vector(forms.inflow(test, True, ends)),
        right=vector(forms.inflow(test, False, ends)),
        nodes=nodes,
        width=width,
    )
