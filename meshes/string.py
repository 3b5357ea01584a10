"""The 1D mesh of a drill-string: an interval [0, L] with a node at every change of section."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import basix.ufl
import dolfinx
import numpy as np
import ufl
from mpi4py import MPI

from .points import nodes

#: Facet tags of the two ends.
TOP, BOTTOM = 1, 2


@dataclass(frozen=True)
class StringMesh:
    """Interval mesh with section tags.

    ``cells``: section number of every cell (0 at the top). ``ends``: facets tagged :data:`TOP` (s = 0) and
    :data:`BOTTOM` (s = L).
    """

    mesh: dolfinx.mesh.Mesh
    cells: dolfinx.mesh.MeshTags
    ends: dolfinx.mesh.MeshTags


def string_mesh(comm: MPI.Comm, lengths: Sequence[float], elements: int, grading: float = 1.0) -> StringMesh:
    """Mesh of a string of sections with these ``lengths`` (m), from the top down."""
    x = nodes(lengths, elements, grading)
    index = np.arange(elements, dtype=np.int64)
    rank0 = comm.rank == 0
    mesh = dolfinx.mesh.create_mesh(
        comm,
        cells=np.column_stack([index, index + 1]) if rank0 else np.empty((0, 2), dtype=np.int64),
        x=x[:, None] if rank0 else np.empty((0, 1)),
        e=ufl.Mesh(basix.ufl.element("Lagrange", "interval", 1, shape=(1,), dtype=np.float64)),
    )
    cell_map = mesh.topology.index_map(1)
    local = np.arange(cell_map.size_local + cell_map.num_ghosts, dtype=np.int32)
    middle = dolfinx.mesh.compute_midpoints(mesh, 1, local)[:, 0]
    section = np.searchsorted(np.cumsum(lengths), middle).astype(np.int32)
    length = x[-1]
    facets, tags = [], []
    for tag, end in ((TOP, 0.0), (BOTTOM, length)):
        found = dolfinx.mesh.locate_entities_boundary(mesh, 0, lambda p, e=end: np.isclose(p[0], e, atol=1e-9 * length))
        facets.append(found)
        tags.append(np.full(len(found), tag, dtype=np.int32))
    facet, tag_of = np.concatenate(facets), np.concatenate(tags)
    order = np.argsort(facet)
    return StringMesh(
        mesh,
        dolfinx.mesh.meshtags(mesh, 1, local, section),
        dolfinx.mesh.meshtags(mesh, 0, facet[order], tag_of[order]),
    )
