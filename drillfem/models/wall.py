"""What the quadrature points of a string know of the wall around them."""

from __future__ import annotations

import basix
import dolfinx
import numpy as np

from ..boreholes import Borehole
from ..boreholes.closest import WALL, project
from ..compat import Array, quadrature_field, reference_nodes
from ..scene.tables import Contact


class WallPoints:
    """Closest points of a hole to the quadrature points of a string, and the numbers that the forms read there.

    ``field``: coefficient of the forms, :data:`drillfem.forms.wall.WALL` at every point. ``p``: measured depth of the
    closest points (points,), m. ``gap``: smallest gap after the last :meth:`update` (m; negative: penetration).
    """

    def __init__(
        self,
        V: dolfinx.fem.FunctionSpace,
        hole: Borehole,
        radius: Array,
        friction: Array,
        degree: int,
        axes: tuple[int, ...] = (0, 1, 2),
    ) -> None:
        """radius (cells,): what touches the wall, m; friction (2,): coefficients where the hole has none of its own;
        axes: which of e1, e2, e3 the first unknowns of a node lie along (the position is zero along the others)."""
        self.hole, self._axes = hole, list(axes)
        self.quadrature_degree = degree
        at, weights = basix.make_quadrature(basix.CellType.interval, degree)
        self.field, rows = quadrature_field(V.mesh, degree, WALL)
        # the rows of the coefficient are those of the points, cell by cell
        assert np.array_equal(rows.reshape(-1), np.arange(rows.size))
        self.data: Array = self.field.x.array.reshape(-1, WALL)
        self.data[:, 11:13] = friction
        nodes = reference_nodes(V)[:, 0]
        order = len(nodes) - 1
        vander = np.polynomial.legendre.legvander
        self.basis = np.ascontiguousarray(vander(2 * at[:, 0] - 1, order) @ np.linalg.inv(vander(2 * nodes - 1, order)))
        self.cells = np.ascontiguousarray(V.dofmap.list, dtype=np.int32)
        self.size = V.dofmap.index_map_bs
        self.radius = np.ascontiguousarray(radius, dtype=np.float64)
        s = V.tabulate_dof_coordinates()[:, 0][self.cells]
        #: arc length of the points (points,), m; and of the string that each stands for
        self.arc_length: Array = (s @ self.basis.T).reshape(-1)
        self.weights: Array = np.outer(s.max(axis=1) - s.min(axis=1), weights).reshape(-1)
        self.p: Array = self.arc_length.copy()
        self.gap = np.inf
        #: why the last :meth:`update` failed; empty if it did not
        self.trouble = ""

    def position(self, u: Array, size: int = 0) -> Array:
        """Where the points are (points, 3), m."""
        return self._points(self._nodal(u, size or self.size), 3)

    def _points(self, r: Array, size: int) -> Array:
        nodal = r.reshape(-1, size)[:, :3][self.cells]
        return np.einsum("qn,cnk->cqk", self.basis, nodal).reshape(-1, 3)

    def _nodal(self, u: Array, size: int) -> Array:
        """Positions of the nodes (nodes, 3), m, in the order of the unknowns."""
        block = u.reshape(-1, size)
        r = np.zeros((len(block), 3))
        r[:, self._axes] = block[:, : len(self._axes)]
        return r

    def seek(self, u: Array) -> None:
        """Find the closest points from scratch, wherever the string is."""
        self.p[:] = self.hole.nearest(self.position(u))
        self.update(u)

    def update(self, u: Array, size: int = 0) -> float:
        """Closest points of a state u (dofs,), from the last ones; returns the smallest gap (m).

        size: entries of u per node, if it is no vector of unknowns of the rod. nan where a point has lost the hole:
        :attr:`trouble` then says where.
        """
        size, r = size or self.size, u
        if len(self._axes) < 3:
            size, r = 3, self._nodal(u, size).reshape(-1)
        found = project(r, size, self.cells, self.basis, self.radius, self.hole.table, self.p, self.data)
        # on a hole that is known, the text is not needed: it costs more than the search
        fine = not found.lost and found.low > 0.0 and found.high < self.hole.length
        self.trouble = "" if fine else self.hole.complaint(found, self._points(r, size), self.p)
        self.gap = np.nan if self.trouble else found.gap
        return self.gap

    def gaps(self, u: Array) -> Array:
        """Gap at every point (points,), m, for the state of the last :meth:`update`."""
        offset = self.position(u) - self.data[:, :3]
        return self.data[:, 9] - np.repeat(self.radius, len(self.basis)) - np.linalg.norm(offset, axis=1)

    def side_force(self, u: Array, contact: Contact) -> Array:
        """Normal force per length (points,), N/m, for the state of the last :meth:`update`: the law of the forms."""
        g, k, width = -self.gaps(u), contact.stiffness, contact.smoothing
        if contact.method == "smooth":
            return np.where(g > width, k * g, k * np.maximum(0.0, g + width) ** 2 / (4 * width))
        return np.maximum(0.0, k * g + (self.multipliers if contact.method == "augmented" else 0.0))

    @property
    def multipliers(self) -> Array:
        """Pressures of the augmented Lagrangian (points,), N/m (a view)."""
        return self.data[:, 13]
