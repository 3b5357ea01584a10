"""A string pushed further and further: shapes that it takes, from snaking to winding, and back."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from ..compat import Array
from ..solve.laid import transported
from .column import Column


@dataclass(frozen=True)
class Step:
    """A stable equilibrium under a load (N); arrays over the nodes from the top down, ``side`` over contact points."""

    load: float
    x: Array  # the state, flat
    arc_length: Array  # m
    position: Array  # (nodes, 3) in the hole: towards its low side, aside, and measured depth, m
    bending_moment: Array  # N m
    side: Array  # (points, 2) arc length, m, and side force, N/m
    energy: float  # J; differences of it count, of a hole along e3
    softest: float  # stiffness per length of the softest motion, N/m2

    @property
    def radius(self) -> Array:
        """Distance from the hole's axis (nodes,), m."""
        return np.hypot(self.position[:, 0], self.position[:, 1])

    @property
    def angle(self) -> Array:
        """Angle about the hole's axis (nodes,), rad, from its low side, without jumps; ends on the axis have none."""
        off = self.radius > max(1e-3 * self.radius.max(), 1e-9)
        if not off.any():
            return np.zeros_like(self.arc_length)
        turned = np.unwrap(np.arctan2(self.position[off, 1], self.position[off, 0]))
        return np.interp(self.arc_length, self.arc_length[off], turned)

    @property
    def turns(self) -> float:
        """How far the string winds about the axis: range of the angle, in turns. More than one: it is wound."""
        return float(np.ptp(self.angle) / (2 * np.pi))

    def swing(self, margin: float) -> float:
        """Greatest angle (rad) off the low side farther than ``margin`` (m) from the ends."""
        inside = (self.arc_length > margin) & (self.arc_length < self.arc_length[-1] - margin)
        angle = self.angle[inside]
        return float(np.ptp(angle) / 2)


def place(column: Column, x: Array) -> Array:
    """Where the nodes of a state are in the hole (nodes, 3), m: towards its low side, aside, measured depth.

    Where the hole is vertical, the low side is that of the stretch above; at the top, north.
    """
    rod = column.rod
    assert rod.wall is not None
    r = x.reshape(-1, column.fields)[rod.nodes, :3]
    hole, down = rod.wall.hole, np.asarray(rod.scene.gravity.direction)
    p = hole.nearest(r)
    frame = hole.frame(p)
    t = frame.tangent / np.linalg.norm(frame.tangent, axis=1)[:, None]
    low = down - (t @ down)[:, None] * t
    size = np.linalg.norm(low, axis=1)
    known = np.flatnonzero(size > 1e-6)
    last = np.array([1.0, 0.0, 0.0])
    for i in range(len(t)):
        # carried on, as near to the last one as it can be across the hole
        last = low[i] / size[i] if size[i] > 1e-6 else last - (last @ t[i]) * t[i]
        low[i] = last = last / np.linalg.norm(last)
    if known.size and known[0] > 0:
        low[: known[0]] = low[known[0]] - (t[: known[0]] @ low[known[0]])[:, None] * t[: known[0]]
    offset = r - frame.position
    aside = np.cross(t, low)
    return np.stack([np.einsum("ij,ij->i", offset, low), np.einsum("ij,ij->i", offset, aside), p], axis=1)


def record(column: Column, x: Array) -> Step:
    """What is worth keeping of an equilibrium at the present load."""
    rod, u = column.rod, column.state(x)
    assert rod.wall is not None and rod.scene.contact is not None
    softest, _ = column.softest(x)
    rod.set_state(u, np.zeros_like(u))
    _, moment = rod.resultants()
    order = np.argsort(rod.wall.arc_length)
    side = np.stack([rod.wall.arc_length, rod.wall.side_force(u, rod.scene.contact)], axis=1)[order]
    return Step(
        column.load,
        x,
        rod.arc_length,
        place(column, x),
        np.hypot(moment[:, 0], moment[:, 1]),
        side,
        column.energy(x),
        softest,
    )


def follow(column: Column, x: Array, loads: Iterable[float], nudge: float = 0.01) -> Iterator[Step]:
    """Stable equilibria under loads (N) one after the other, each crept to from the last (`Column.settle`)."""
    for load in loads:
        x = column.settle(x, load, nudge)
        yield record(column, x)


def wound(column: Column, turns: float, load: float, run_in: float) -> Array:
    """The stable equilibrium nearest to a helix of so many turns, of a hole along e3 whose axis the ends are on.

    The helix lies on the wall but for ``run_in`` (m) at each end, where it leaves the axis.
    """
    rod = column.rod
    s, low = rod.arc_length, column.lying().reshape(-1, column.fields)[rod.nodes, :2]
    away = np.clip(np.minimum(s, s[-1] - s) / run_in, 0.0, 1.0)
    away = away**2 * (3 - 2 * away)
    turn = 2 * np.pi * turns * s / s[-1]
    cos, sin = np.cos(turn), np.sin(turn)
    across = away[:, None] * np.stack([low[:, 0] * cos - low[:, 1] * sin, low[:, 0] * sin + low[:, 1] * cos], axis=1)
    r = np.column_stack([across, s])
    tangent = np.gradient(r, s, axis=0)
    x = np.empty((len(s), column.fields))
    x[rod.nodes] = np.hstack([r, transported(tangent / np.linalg.norm(tangent, axis=1)[:, None])])
    return column.settle(column.at(x.reshape(-1)), load)
