"""The rock as seen by a string that PETSc steps: bit-rock law and rock surface behind one interface."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..bitrock.law import BitLaw
from ..bitrock.solve import solve_bit
from ..bitrock.surface import RockSurface, ahead
from ..compat import Array
from ..models.rock import advection_operators
from ..scene import Scene


class RockContact:
    """Answers the Newton iteration with the exact solution of the bit problem, and is cut after every step."""

    def __init__(self, law: BitLaw, surface: RockSurface, spin: float) -> None:
        self.law, self.surface = law, surface
        self._par = law.array
        m = len(surface.data.width)
        self._ref, self._height, self._slope = np.zeros(2), np.zeros((2, m)), np.zeros((2, m))
        self._work = np.empty(m)
        self.spin, self.depth = spin, 0.0

    @classmethod
    def from_scene(cls, scene: Scene) -> RockContact:
        """Rock of a scene, in nominal drilling; DG operators come from the UFL form."""
        bit, rock = scene.bit, scene.rock
        assert bit is not None and rock is not None
        operators = None
        if rock.surface.scheme == "dg":
            width = 2 * np.pi / bit.blades
            operators = advection_operators(rock.surface.degree, rock.surface.elements, width)
        return cls(BitLaw.from_scene(scene), RockSurface.from_scene(scene, operators), scene.top_drive.speed or 0.0)

    def at_rest(self, speed: float, spin: float, depth: float) -> tuple[float, float]:
        """Weight and torque (N, N m) of a bit that moves like this on the present surface."""
        forces = self.law.forces(speed, spin, self.surface.depth_of_cut(depth))
        self.spin, self.depth = spin, depth
        return forces.weight, forces.torque

    def respond(
        self,
        speed: float,
        speed_compliance: float,
        depth: float,
        depth_compliance: float,
        spin: float,
        spin_compliance: float,
        turn: float,
        turn_compliance: float,
    ) -> tuple[float, float]:
        """See :class:`drillfem.solve.newton.BitLoad`; the rock ahead is linearised at the turn that is expected."""
        data, ref = self.surface.data, self._ref
        ref[0], ref[1] = max(turn - turn_compliance * self._torque, 0.0), min(turn - turn_compliance * self._torque, 0.0)
        ahead(data, ref[0], True, self._height[0], self._slope[0])
        ahead(data, ref[1], False, self._height[1], self._slope[1])
        rho = turn_compliance / spin_compliance
        found = solve_bit(
            self._par,
            data.share,
            speed,
            speed_compliance,
            depth,
            depth_compliance,
            spin,
            spin_compliance,
            turn,
            rho,
            ref,
            self._height,
            self._slope,
            self.spin,
            self._work,
        )
        self._torque = found[1]
        return found[0], found[1]

    _torque = 0.0

    def commit(self, turn: float, depth: float, step: float, speed0: float, speed1: float, spin: float) -> None:
        """The bit has turned by ``turn`` (rad) and gone to ``depth`` (m) in a step (s) with these axial speeds (m/s)."""
        if abs(turn) > 1e-12:
            # the path within the step: cubic in the angle, from the speeds at its ends
            rate = step / turn
            self.surface.commit(turn, self.depth, depth, speed0 * rate, speed1 * rate)
        self.depth, self.spin = depth, spin

    def depth_of_cut(self) -> float:
        """Depth of cut (m, sum over the blades), negative off bottom."""
        return self.surface.depth_of_cut(self.depth)

    @property
    def removed(self) -> float:
        """Rock cut so far: integral of the depth of cut over the turn (m rad)."""
        return self.surface.removed

    def picture(self) -> dict[str, Array]:
        """Surface around the bit for pictures: angle (rad) and height (m) below the start, all sectors in turn."""
        return {}

    def save(self) -> dict[str, Any]:
        """State for a checkpoint."""
        return {**self.surface.state_dict(), "spin": self.spin, "depth": self.depth, "last_torque": self._torque}

    def load(self, state: dict[str, Any]) -> None:
        """Restore a state of :meth:`save`."""
        state = dict(state)
        self.spin, self.depth = float(state.pop("spin")), float(state.pop("depth"))
        self._torque = float(state.pop("last_torque"))
        self.surface.load(state)
