"""What the quadrature points of a string know of the wall around them."""

from __future__ import annotations

import basix
import dolfinx
import numpy as np

from ..boreholes import Borehole
from ..boreholes.closest import WALL, Projection, project, wall
from ..compat import Array, lagrange, quadrature_field, reference_nodes
from ..forms.ansatz import DEPTH, Ansatz
from ..forms.wall import DEPTH as OF_CENTRE
from ..scene.tables import Contact

#: Numbers per point where the measured depth is an unknown.
WALL_AND_DEPTH = OF_CENTRE + 1


class WallPoints:
    """Closest points of a hole to the quadrature points of a string, and the numbers that the forms read there.

    ``field``: coefficient of the forms, :data:`drillfem.forms.wall.WALL` at every point. ``p``: measured depth of the
    closest points (points,), m. ``gap``: smallest gap after the last :meth:`update` (m; negative: penetration).

    Where the measured depth is an unknown (D-6), p at the points is that of the state, carried on from the nodes, and
    ``at_nodes`` holds the same numbers at the nodes, for the equation of p.
    """

    def __init__(
        self,
        V: dolfinx.fem.FunctionSpace,
        hole: Borehole,
        radius: Array,
        friction: Array,
        degree: int,
        ansatz: Ansatz,
    ) -> None:
        """radius (cells,): what touches the wall, m; friction (2,): coefficients where the hole has none of its own;
        ansatz: of the unknowns (V), the position first."""
        names = ansatz.x_names
        #: axes e1, e2, e3 that position and velocity of a node are given along; where the velocity and the measured
        #: depth of the closest point stand among its unknowns
        self.axes = [i for i, name in enumerate(("r1", "r2", "r3")) if name in names]
        self._speed = len(names)
        self._depth = names.index(DEPTH) if DEPTH in names else None
        self.quadrature_degree = degree
        at, weights = basix.make_quadrature(basix.CellType.interval, degree)
        nodes = reference_nodes(V)[:, 0]
        order = len(nodes) - 1
        width = WALL if self._depth is None else WALL_AND_DEPTH
        self.field, rows = quadrature_field(V.mesh, degree, width)
        # the rows of the coefficient are those of the points, cell by cell
        assert np.array_equal(rows.reshape(-1), np.arange(rows.size))
        self.data: Array = self.field.x.array.reshape(-1, width)
        self.at_nodes = None if self._depth is None else dolfinx.fem.Function(lagrange(V.mesh, order, width))
        assert self.at_nodes is None or np.array_equal(self.at_nodes.function_space.dofmap.list, V.dofmap.list)
        vander = np.polynomial.legendre.legvander
        self.basis = np.ascontiguousarray(vander(2 * at[:, 0] - 1, order) @ np.linalg.inv(vander(2 * nodes - 1, order)))
        self.cells = np.ascontiguousarray(V.dofmap.list, dtype=np.int32)
        self.size = V.dofmap.index_map_bs
        s = V.tabulate_dof_coordinates()[:, 0][self.cells]
        #: arc length of the points (points,), m; and of the string that each stands for
        self.arc_length: Array = (s @ self.basis.T).reshape(-1)
        self.weights: Array = np.outer(s.max(axis=1) - s.min(axis=1), weights).reshape(-1)
        self.p: Array = self.arc_length.copy()
        #: time (s) whose approach counts as penetration; 0: the normal force knows no speed
        self.retardation = 0.0
        self.begin(hole, radius, friction)

    def begin(self, hole: Borehole, radius: Array, friction: Array) -> None:
        """Forget all states, and go on in this hole; arguments as of the constructor."""
        self.hole, self.radius = hole, np.ascontiguousarray(radius, dtype=np.float64)
        self.data[:] = 0.0
        self.data[:, 11:13] = friction
        self.p[:] = self.arc_length
        self.gap = np.inf
        #: why the last :meth:`update` failed; empty if it did not
        self.trouble = ""

    def position(self, u: Array, size: int = 0) -> Array:
        """Where the points are (points, 3), m."""
        return self._points(self._nodal(u, size or self.size), 3)

    def _points(self, r: Array, size: int) -> Array:
        nodal = r.reshape(-1, size)[:, :3][self.cells]
        return np.einsum("qn,cnk->cqk", self.basis, nodal).reshape(-1, 3)

    def _nodal(self, u: Array, size: int, first: int = 0) -> Array:
        """Positions of the nodes (nodes, 3), m, in the order of the unknowns, or the vectors at ``first``."""
        block = u.reshape(-1, size)
        r = np.zeros((len(block), 3))
        r[:, self.axes] = block[:, first : first + len(self.axes)]
        return r

    def seek(self, u: Array) -> None:
        """Find the closest points from scratch, wherever the string is."""
        self.go_to(self.hole.nearest(self.position(u)))
        self.update(u)

    def go_to(self, p: Array) -> None:
        """Take closest points (points,), m, from elsewhere; the next :meth:`update` starts from them."""
        self.p[:] = p
        self.data[:, 3:9] = 0.0  # a tangent of no length: a row to be renewed

    def update(self, u: Array, size: int = 0) -> float:
        """Closest points of a state u (dofs,), from the last ones; returns the smallest gap (m).

        size: entries of u per node, if it is no vector of unknowns of the rod. nan where a point has lost the hole:
        :attr:`trouble` then says where.
        """
        size, r = size or self.size, u
        follow = self._depth is not None and size == self.size
        if len(self.axes) < 3:
            size, r = 3, self._nodal(u, size).reshape(-1)
        if follow:
            found = self._follow(u, self._points(r, size))
        else:
            found = project(r, size, self.cells, self.basis, self.radius, self.hole.table, self.p, self.data)
        # on a hole that is known, the text is not needed: it costs more than the search
        fine = not found.lost and found.low > 0.0 and found.high < self.hole.length
        self.trouble = "" if fine else self.hole.complaint(found, self._points(r, size), self.p)
        self.gap = np.nan if self.trouble else found.gap
        return self.gap

    def _follow(self, u: Array, r: Array) -> Projection:
        """The hole where the measured depths among the unknowns u say; r (points, 3): where the points are."""
        assert self._depth is not None and self.at_nodes is not None
        nodal = np.ascontiguousarray(u.reshape(-1, self.size)[:, self._depth])
        self.p[:] = (nodal[self.cells] @ self.basis.T).reshape(-1)
        there = self.at_nodes.x.array.reshape(-1, WALL_AND_DEPTH)
        for p, data in ((self.p, self.data), (nodal, there)):
            wall(self.hole.table, p, data)
            data[:, OF_CENTRE] = p
        offset = r - self.data[:, :3]
        room = self._room(offset)
        # as the search of the closest point: none beyond the centre of curvature
        lost = ~(np.einsum("ij,ij->i", self.data[:, 6:9], offset) < 1.0)
        first = int(lost.argmax())
        narrow = int(room.argmin())
        return Projection(room[narrow], narrow, int(lost.sum()), first, float(self.p.min()), float(self.p.max()))

    def _room(self, offset: Array) -> Array:
        """Gap (points,), m, of points that are offset (points, 3) from the centreline."""
        return self.data[:, 9] - np.repeat(self.radius, len(self.basis)) - np.sqrt((offset**2).sum(axis=1))

    def offset(self, u: Array, size: int = 0) -> tuple[Array, Array]:
        """Where the points are from their closest ones (points, 3), m, and how far these are from the stored ones
        (points,), m: the way that the forms go."""
        away, t, k = self.position(u, size) - self.data[:, :3], self.data[:, 3:6], self.data[:, 6:9]
        if self._depth is not None and size in (0, self.size):  # the closest point is where the unknown says
            return away, np.zeros(len(away))
        d = (away * t).sum(axis=1) / ((t * t).sum(axis=1) - (k * away).sum(axis=1))
        return away - t * d[:, None] - k * d[:, None] ** 2 / 2, d

    def gaps(self, u: Array, size: int = 0) -> Array:
        """Gap at every point (points,), m, for the state of the last :meth:`update`."""
        offset, d = self.offset(u, size)
        return self._room(offset) + self.data[:, 10] * d

    def pressing(self, u: Array, size: int = 0) -> Array:
        """What the normal force answers to (points,), m: penetration, and its rate times the retardation."""
        g = -self.gaps(u, size)
        if self.retardation and size in (0, self.size):
            v = self._points(self._nodal(u, self.size, self._speed), 3)
            offset, _ = self.offset(u)
            t, second, slope = self.data[:, 3:6], self.data[:, 6:9], self.data[:, 10]
            along = (t * v).sum(axis=1) / ((t * t).sum(axis=1) - (second * offset).sum(axis=1))
            out = (offset * v).sum(axis=1) / np.sqrt((offset**2).sum(axis=1) + 1e-24)
            g += self.retardation * (out - slope * along)
        return g

    def augment(
        self, u: Array, stiffness: float, tolerance: float, inertia: Array | float = 0.0, size: int = 0
    ) -> float:
        """Violation of contact (m) by the state of the last :meth:`update`: the largest penetration, or gap across
        which the multipliers push. Above ``tolerance`` (m) the multipliers are moved by (stiffness + inertia) times
        penetration; ``inertia`` (points,; N/m2): what resists the correction besides.
        """
        g = self.pressing(u, size)
        pushed = self.multipliers + stiffness * g > 0.0
        violation = float(np.where(pushed, np.abs(g), 0.0).max())
        if violation > tolerance:
            self.multipliers[:] = np.maximum(0.0, self.multipliers + (stiffness + inertia) * g)
        return violation

    def side_force(self, u: Array, contact: Contact) -> Array:
        """Normal force per length (points,), N/m, for the state of the last :meth:`update`: the law of the forms."""
        g, k, width = self.pressing(u), contact.stiffness, contact.smoothing
        if contact.method == "smooth":
            return np.where(g > width, k * g, k * np.maximum(0.0, g + width) ** 2 / (4 * width))
        return np.maximum(0.0, k * g + (self.multipliers if contact.method == "augmented" else 0.0))

    @property
    def multipliers(self) -> Array:
        """Pressures of the augmented Lagrangian (points,), N/m (a view)."""
        return self.data[:, 13]
