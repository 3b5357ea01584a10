"""The rock as seen by a string that PETSc steps: bit-rock laws, and a rock surface, behind one interface."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from ..bitrock.empirical import EmpiricalLaw, solve_empirical
from ..bitrock.jit import announce
from ..bitrock.law import BitLaw
from ..bitrock.solve import bit_step
from ..bitrock.surface import RockSurface
from ..models.straight import have_forms
from ..scene import Scene

Array = npt.NDArray[np.float64]


def rock_picture(surface: RockSurface, points: int = 97) -> dict[str, Array]:
    """Surface of all sectors in turn (one sector for equal blades), resampled so that every picture has one size."""
    angles, heights, start = [], [], 0.0
    for (eta, height), width in zip(surface.profile(), surface.data.width, strict=True):
        at = np.linspace(0.0, width, points)
        angles.append(start + at)
        heights.append(np.interp(at, eta, height))
        start += width
    return {"rock_angle": np.concatenate(angles), "rock_height": np.concatenate(heights)}


def surface_of(scene: Scene) -> RockSurface:
    """Rock surface of a scene, in nominal drilling.

    The operators of finite elements come from the UFL forms where DOLFINx is installed; those by NumPy are the same.
    """
    bit, rock = scene.bit, scene.rock
    assert bit is not None and rock is not None
    operators = None
    surface = rock.surface
    if surface.scheme != "profile" and have_forms():
        from ..models.rock import advection_operators

        operators = advection_operators(surface.degree, surface.elements, 2 * np.pi / bit.blades, surface.scheme)
    return RockSurface.from_scene(scene, operators)


class Rock(Protocol):
    """What a bit drills: answers the Newton iteration, and is drilled after every step."""

    def at_rest(self, speed: float, spin: float, depth: float) -> tuple[float, float]:
        """Weight and torque (N, N m) of a bit that moves like this."""
        ...

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
        """See :class:`drillfem.solve.newton.BitLoad`."""
        ...

    def commit(self, turn: float, depth: float, step: float, speed0: float, speed1: float, spin: float) -> None:
        """The bit has turned by ``turn`` (rad) and gone to ``depth`` (m) in a step (s); axial speeds in m/s."""
        ...

    def row(self) -> dict[str, float]:
        """History variables besides motion and loads of the bit."""
        ...

    def picture(self) -> dict[str, Array]:
        """Fields for pictures."""
        ...

    def save(self) -> dict[str, Any]:
        """State for a checkpoint."""
        ...

    def load(self, state: dict[str, Any]) -> None:
        """Restore a state of :meth:`save`."""
        ...


def rock_of(scene: Scene) -> Rock:
    """The rock under the bit of a scene."""
    assert scene.bit is not None
    return RockContact.from_scene(scene) if scene.bit.kind == "cutting" else EmpiricalContact.from_scene(scene)


class RockContact:
    """Answers the Newton iteration with the exact solution of the bit problem, and is cut after every step."""

    def __init__(self, law: BitLaw, surface: RockSurface, spin: float) -> None:
        self.law, self.surface = law, surface
        self._par = law.array
        self.spin, self.depth, self._cut = spin, 0.0, 0.0

    @classmethod
    def from_scene(cls, scene: Scene) -> RockContact:
        """Rock of a scene, in nominal drilling."""
        announce()
        return cls(BitLaw.from_scene(scene), surface_of(scene), scene.top_drive.speed or 0.0)

    def at_rest(self, speed: float, spin: float, depth: float) -> tuple[float, float]:
        """Weight and torque (N, N m) of a bit that moves like this on the present surface."""
        self.spin, self.depth, self._cut = spin, depth, self.surface.depth_of_cut(depth)
        forces = self.law.forces(speed, spin, self._cut)
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
        """See :class:`drillfem.solve.newton.BitLoad`."""
        found = bit_step(
            self._par,
            self.surface.data,
            speed,
            speed_compliance,
            depth,
            depth_compliance,
            spin,
            spin_compliance,
            turn,
            turn_compliance / spin_compliance,
            self.spin,
        )
        self._cut = found[10]
        return found[0], found[1]

    def commit(self, turn: float, depth: float, step: float, speed0: float, speed1: float, spin: float) -> None:
        """The bit has turned by ``turn`` (rad) and gone to ``depth`` (m) in a step (s); axial speeds in m/s."""
        if abs(turn) > 1e-12:
            # the path within the step: cubic in the angle, from the speeds at its ends
            rate = step / turn
            self.surface.commit(turn, self.depth, depth, speed0 * rate, speed1 * rate)
        self.depth, self.spin = depth, spin

    def depth_of_cut(self) -> float:
        """Depth of cut (m, sum over the blades) that belongs to the last answer, negative off bottom."""
        return self._cut

    @property
    def volume(self) -> float:
        """Volume of rock cut so far (m3)."""
        return self.surface.removed * self.law.radius**2 / 2

    def row(self) -> dict[str, float]:
        """See :class:`Rock`."""
        return {"depth_of_cut": self.depth_of_cut(), "rock_volume": self.volume}

    def picture(self) -> dict[str, Array]:
        """Surface for pictures: ``rock_angle`` (rad, from a blade backwards) and ``rock_height`` (m)."""
        return rock_picture(self.surface)

    def save(self) -> dict[str, Any]:
        """State for a checkpoint."""
        return {**self.surface.state_dict(), "spin": self.spin, "depth": self.depth}

    def load(self, state: dict[str, Any]) -> None:
        """Restore a state of :meth:`save`."""
        state = dict(state)
        self.spin, self.depth = float(state.pop("spin")), float(state.pop("depth"))
        self.surface.load(state)


class EmpiricalContact:
    """Answers the Newton iteration by the empirical law (B-5); a bit is on bottom where it is as deep as ever."""

    def __init__(self, law: EmpiricalLaw, weight: float, spin: float) -> None:
        """weight: of a bit that stands on the bottom at the start (N); spin: of the bit at the start (rad/s)."""
        self.law, self.weight = law, weight
        self._par = law.array
        self.spin, self.bottom, self._rate = spin, 0.0, 0.0

    @classmethod
    def from_scene(cls, scene: Scene) -> EmpiricalContact:
        """Rock of a scene, in nominal drilling."""
        announce()
        return cls(EmpiricalLaw.from_scene(scene), scene.nominal().weight_on_bit, 0.0)

    def at_rest(self, speed: float, spin: float, depth: float) -> tuple[float, float]:
        """Weight and torque (N, N m) of a bit that moves like this; the nominal weight of one that stands."""
        self.spin, self.bottom, self._rate = spin, depth, max(0.0, speed)
        weight = self.law.weight(speed, spin) if speed > 0 and not self.law.constant_weight else self.weight
        return weight, self.law.torque(weight, spin)

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
        """See :class:`drillfem.solve.newton.BitLoad`."""
        if depth < self.bottom:  # where it would be if nothing held it
            self._rate = 0.0
            return 0.0, 0.0
        weight, torque, _, rate = solve_empirical(self._par, speed, speed_compliance, spin, spin_compliance, self.spin)
        self._rate = max(0.0, rate)
        return weight, torque

    def commit(self, turn: float, depth: float, step: float, speed0: float, speed1: float, spin: float) -> None:
        """See :class:`Rock`."""
        self.bottom, self.spin = max(self.bottom, depth), spin

    def row(self) -> dict[str, float]:
        """Depth of cut per turn (m); 0 while the bit does not turn."""
        return {"depth_of_cut": 2 * np.pi * self._rate / abs(self.spin) if self.spin else 0.0}

    def picture(self) -> dict[str, Array]:
        """The law knows no surface."""
        return {}

    def save(self) -> dict[str, Any]:
        """State for a checkpoint."""
        return {"spin": self.spin, "bottom": self.bottom, "rate": self._rate}

    def load(self, state: dict[str, Any]) -> None:
        """Restore a state of :meth:`save`."""
        self.spin, self.bottom, self._rate = (float(state[name]) for name in ("spin", "bottom", "rate"))
