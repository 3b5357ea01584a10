"""The 1D periodic mesh of the rock surface: the sector [0, width] between two blades.

The two ends are the two sides of one blade. Discontinuous elements need no identification of nodes: what leaves one
end enters at the other (or is replaced by the bit), so the mesh is an interval whose ends are tagged.
"""

from __future__ import annotations

import dolfinx
import numpy as np
from mpi4py import MPI

from .string import StringMesh, string_mesh


def sector_mesh(comm: MPI.Comm, width: float, elements: int) -> StringMesh:
    """Uniform mesh of a sector of the rock surface; ``width`` in rad."""
    return string_mesh(comm, [width], elements)


def ordered_dofs(V: dolfinx.fem.FunctionSpace) -> tuple[np.ndarray, np.ndarray]:
    """Permutation that sorts the dofs of a scalar discontinuous space by element, then by angle; and the angles."""
    x = V.tabulate_dof_coordinates()[:, 0]
    dofs = V.dofmap.list
    first = np.argsort(x[dofs].mean(axis=1))
    order = np.concatenate([cell[np.argsort(x[cell])] for cell in dofs[first]])
    return order, x[order]
