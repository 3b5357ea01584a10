"""The 1D mesh of a drill-string: an interval [0, L] with a node at every change of section."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import basix.ufl
import dolfinx
import numpy as np
import numpy.typing as npt
import ufl
from mpi4py import MPI

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


def distribute(lengths: Sequence[float], elements: int) -> list[int]:
    """Elements of each section: at least one, in proportion to length (largest remainder).

    Raises ValueError if there are fewer elements than sections.
    """
    if elements < len(lengths):
        raise ValueError(f"{elements} elements for {len(lengths)} sections: at least one each")
    ideal = np.asarray(lengths) / np.sum(lengths) * elements
    count = np.maximum(1, np.floor(ideal).astype(int))
    while count.sum() < elements:
        count[np.argmax(ideal - count)] += 1
    while count.sum() > elements:
        count[np.argmax(np.where(count > 1, count - ideal, -np.inf))] -= 1
    return [int(n) for n in count]


def nodes(lengths: Sequence[float], elements: int, grading: float = 1.0) -> npt.NDArray[np.float64]:
    """Vertices (elements + 1, m). ``grading``: last over first element length inside the last section (geometric)."""
    counts = distribute(lengths, elements)
    points = [0.0]
    for i, (length, n) in enumerate(zip(lengths, counts, strict=True)):
        ratio = grading if i == len(lengths) - 1 else 1.0
        size = ratio ** (np.arange(n) / max(1, n - 1))
        points.extend(points[-1] + length * np.cumsum(size) / size.sum())
    points[-1] = float(np.sum(lengths))
    return np.array(points)


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
