"""Stiff-string torque and drag: the rod itself, with its bending stiffness and clearance, while it slides steadily.

The rod is laid in its hole without friction; then the load on the bit and the friction grow together to their values.
Friction has the size mu N and points against the motion of the touching point, which is known: the string moves along
the hole and turns about it as a whole (`drillfem.forms.wall.steady_friction`). Inertia of that motion is left out.

What a soft string cannot know and this does: bending stiffness carries the string across kinks and doglegs, it has a
clearance to lie in, and turning it climbs the wall until friction and weight balance. In a straight hole that is
inclined, N = w sin(inclination)/sqrt(1 + mu^2), and the torque mu N r is less than that of the books by as much.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import ufl

from ..compat import Array
from ..errors import SceneError, SimulationError
from ..forms import virtual_work as vw
from ..forms.constitutive import SECTION
from ..forms.wall import WALL, Hole, steady_friction
from ..models.rod import Rod, section_table
from ..scene import Scene
from ..scene.tables import Bit
from ..solve.laid import lay
from ..solve.statics import Statics
from .operation import F8, Operation, Profile

#: Stiffness (N/m) with which the rock holds a bit on the axis of its hole, where the scene has no bit.
GUIDE = Bit("free").guide_stiffness
#: First and least step in the share of loads and friction; a step is halved where Newton's iteration fails.
_STEPS = (0.5, 2e-3)


@dataclass(frozen=True)
class StiffProfile(Profile):
    """A profile with what only a rod has, (n,) each: at the two ends and in the middle of every element."""

    bending_moment: F8  # largest in the element, N m
    gap: F8  # smallest in the element, m; negative: penetration
    touching: F8  # share of the element that touches the wall


class Sliding(Statics):
    """Equilibrium of a string that slides steadily in its hole; the top is held on the hole's axis."""

    def __init__(self, rod: Rod, friction: str = "dynamic") -> None:
        """friction: which coefficient of the wall, "dynamic" or "static"."""
        c, bit, wall = rod.constant, rod.scene.bit, rod.loads.wall
        if rod.wall is None or wall is None or rod.model != "spatial":
            raise SceneError(
                "hole.kind: stiff-string torque and drag needs a hole with [contact] and model = 'spatial'"
            )
        self.mu = f"friction_{friction}"
        self.wall, self.share, self.speed, self.spin = wall, c(0.0), c(0.0), c(1.0)
        load, self.guide = vw.BitLoad(rod.weight, rod.torque), c(0.0)
        if rod.bends:
            load = replace(load, hole=Hole(rod.bit_hole), guide=self.guide)
        self._guide = bit.guide_stiffness if bit is not None else GUIDE
        # what the top drive does is the reaction that is asked for
        top = replace(rod.loads.top, force=c((0.0, 0.0, 0.0)), mass=c(0.0))
        rod.loads = replace(rod.loads, bit=load, top=top)
        super().__init__(rod)
        cell = rod.wall.arc_length.reshape(len(rod.wall.radius), -1)
        self._down = np.argsort(cell.mean(axis=1))  # elements from the top down
        ends = rod.mesh.geometry.x[:, 0]
        self._ends = np.sort(ends)
        section = rod.string.cells
        table = np.empty((len(section.indices), len(SECTION)))
        table[section.indices] = section_table(rod.scene)[section.values]
        self._torsion = table[self._down, SECTION.index("torsion")]

    def terms(self) -> vw.Terms:
        """Equilibrium with the friction of the steady motion."""
        rod, a = self.rod, self.rod.ansatz.bare
        at, virtual = a.configuration(self.x, rod.s), a.virtual(ufl.TestFunction(self.V))
        mu = self.share * self.wall[self.mu]
        friction = steady_friction(at, virtual, rod.section["contact_radius"], self.wall, mu, self.speed, self.spin)
        return super().terms() | {"friction": friction * rod.on.wall}

    def operate(self, laid: Array, operation: Operation) -> StiffProfile:
        """Torque and drag of an operation, from the unknowns (dofs,) of the laid string.

        Raises SimulationError where the string finds no equilibrium.
        """
        rod = self.rod
        self.speed.value, self.spin.value = operation.speed, operation.spin

        def load(share: float) -> None:
            self.share.value = share
            rod.set_bit_load(share * operation.weight_on_bit, share * operation.torque_on_bit)
            # rock holds the bit that it carries on the axis
            self.guide.value = share * self._guide if operation.weight_on_bit else 0.0

        rod.seek_hole(laid)
        x, done, step = self.start(laid), 0.0, _STEPS[0]
        while done < 1.0:
            share = min(1.0, done + step)
            try:
                x = self.solve(self._twisted(x, operation, share - done), np.array([share]), load, least=1.0).x.reshape(
                    -1
                )
            except SimulationError:
                step /= 2
                if step < _STEPS[1]:
                    raise SimulationError(
                        f"{operation.title}: no equilibrium found beyond {100 * done:.3g} % of loads and friction: "
                        "where the string buckles, drillfem buckling follows it (without friction); else try more "
                        "mesh.elements"
                    ) from None
                continue
            done, step = share, 1.5 * step
        return self._profile(x, operation)

    def _by_cell(self, values: Array) -> Array:
        """Values at the points of the wall as (elements from the top down, points)."""
        return values.reshape(len(self._down), -1)[self._down]

    def _twisted(self, x: Array, operation: Operation, share: float) -> Array:
        """A state turned about its axis as this much more of torque and friction will turn it: Newton's iteration
        does not find its way round many turns by itself."""
        rod, wall = self.rod, self.rod.wall
        assert wall is not None and rod.scene.contact is not None
        radius = np.repeat(wall.radius, len(wall.basis))
        about = operation.spin * radius
        mu = wall.data[:, WALL.index(self.mu)] * about / np.hypot(operation.speed, about)
        self._set(x)
        normal = wall.side_force(self.state(x), rod.scene.contact)
        rubs = self._by_cell(mu * normal * radius * wall.weights).sum(axis=1)
        torque = share * (np.cumsum(rubs[::-1])[::-1] - rubs / 2 + operation.torque_on_bit)
        angle = np.concatenate([[0.0], -np.cumsum(torque * np.diff(self._ends) / self._torsion)])
        half = np.empty(len(rod.nodes))
        half[rod.nodes] = np.interp(rod.arc_length, self._ends, angle) / 2
        out = x.reshape(len(half), -1).copy()
        a, b, c, d = x.reshape(len(half), -1)[:, 3:7].T
        cos, sin = np.cos(half), np.sin(half)
        out[:, 3:7] = np.stack([a * cos - d * sin, b * cos + c * sin, c * cos - b * sin, d * cos + a * sin], axis=1)
        return out.reshape(-1)

    def reactions(self, x: Array) -> tuple[float, float]:
        """Hook load (N, up along the hole) and torque (N m) on the top of a string in equilibrium."""
        rod, out = self.rod, np.zeros(len(x))
        self._set(x)
        self.residual(out)
        assert rod.wall is not None
        top = out.reshape(len(rod.nodes), -1)[rod.nodes[0]]
        return float(-top[:3] @ rod.wall.hole.frame(0.0).tangent[0]), float(top[6])

    def _profile(self, x: Array, operation: Operation) -> StiffProfile:
        rod, wall = self.rod, self.rod.wall
        assert wall is not None and rod.scene.contact is not None
        hook_load, torque_above = self.reactions(x)
        u = self.state(x)
        rod.set_state(u, np.zeros_like(u))
        n, m = rod.resultants()
        s, middle = rod.arc_length, (self._ends[1:] + self._ends[:-1]) / 2
        degree = rod.scene.mesh.degree
        bending = np.hypot(m[:, 0], m[:, 1])
        worst = np.max([bending[i : i + len(s) - degree : degree] for i in range(degree + 1)], axis=0)
        force, share = wall.side_force(u, rod.scene.contact), self._by_cell(wall.weights)
        share = share / share.sum(axis=1)[:, None]
        side, gap = self._by_cell(force), self._by_cell(wall.gaps(u)).min(axis=1)
        mean, touching = (share * side).sum(axis=1), (share * (side > 0)).sum(axis=1)

        def with_ends(values: Array, first: float, last: float) -> Array:
            return np.concatenate([[first], values, [last]])

        def extended(values: Array) -> Array:
            return with_ends(values, values[0], values[-1])

        return StiffProfile(
            "stiff",
            operation,
            np.concatenate([[0.0], middle, [rod.length]]),
            with_ends(np.interp(middle, s, n[:, 2]), hook_load, -operation.weight_on_bit),
            with_ends(-np.interp(middle, s, m[:, 2]), torque_above, operation.torque_on_bit),
            extended(mean),
            with_ends(worst, bending[0], bending[-1]),
            extended(gap),
            extended(touching),
        )


def sliding_string(scene: Scene, friction: str = "dynamic") -> tuple[Sliding, Array]:
    """The rod of a scene, ready to slide, and the unknowns (dofs,) of it laid in its hole.

    friction: which coefficient of the wall, "dynamic" or "static". Raises SceneError without a hole, SimulationError
    where the string finds no equilibrium.
    """
    sliding = Sliding(Rod(replace(scene, model="spatial")), friction)
    return sliding, lay(sliding.rod)


def stiff_string(scene: Scene, operations: Sequence[Operation], friction: str = "dynamic") -> list[StiffProfile]:
    """Torque and drag of a scene's string for operations, by the rod: laid once, then slid in each. See above."""
    sliding, laid = sliding_string(scene, friction)
    return [sliding.operate(laid, operation) for operation in operations]
