"""The rock surface of a scene on its own periodic mesh: advection operators from the UFL forms."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import ufl
from mpi4py import MPI

from ..bitrock.dg import STREAMLINE, DGOperators
from ..compat import Array, MatrixForm, VectorForm, discontinuous, lagrange
from ..forms import surface as forms
from ..meshes.periodic import ordered_dofs, sector_mesh


@lru_cache(maxsize=16)  # all members of an ensemble have the same
def advection_operators(degree: int, elements: int, width: float, scheme: str = "dg") -> DGOperators:
    """Operators of a sector of ``width`` (rad), assembled by DOLFINx, degrees of freedom sorted by angle.

    ``scheme``: "dg"; "upwind", which is degree 0; or "supg", continuous linear elements (both whatever the degree).
    """
    mesh = sector_mesh(MPI.COMM_SELF, width, elements).mesh
    dx, interior, ends = (ufl.Measure(kind, mesh) for kind in ("dx", "dS", "ds"))
    mass, transport = {}, {}
    if scheme == "supg":
        V = lagrange(mesh, 1, 1)
        nodes = V.tabulate_dof_coordinates()[:, 0]
        order = np.argsort(nodes)
        nodes = nodes[order]
        L, test = ufl.TrialFunction(V)[0], ufl.TestFunction(V)[0]
        tau = STREAMLINE * ufl.CellVolume(mesh)
        for way in (True, False):
            mass[way] = forms.streamline_mass(L, test, way, tau, dx)
            transport[way] = forms.streamline_transport(L, test, way, tau, dx, ends)
    else:
        V = discontinuous(mesh, 0 if scheme == "upwind" else degree)
        order, nodes = ordered_dofs(V)
        L, test = ufl.TrialFunction(V), ufl.TestFunction(V)
        mass[True] = forms.mass(L, test, dx)
        for way in (True, False):
            transport[way] = forms.transport(L, test, way, dx, interior, ends)

    def matrix(form: ufl.Form) -> Array:
        return MatrixForm(form).dense()[np.ix_(order, order)]

    def vector(form: ufl.Form) -> Array:
        return VectorForm(form)(np.zeros(len(order)))[order]

    return DGOperators(
        mass=matrix(mass[True]),
        forward=matrix(transport[True]),
        backward=matrix(transport[False]),
        left=vector(forms.inflow(test, True, ends)),
        right=vector(forms.inflow(test, False, ends)),
        nodes=nodes,
        width=width,
        mass_backward=matrix(mass[False]) if False in mass else None,
    )
