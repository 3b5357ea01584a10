"""The soft string: it has no bending stiffness, lies along its hole, and rubs on the wall with the force that weight
and tension press it on with. NumPy only.

With the unit tangent t of the hole, its curvature vector t' = dt/dp and the effective tension F, the wall must carry
per length

    F t' + w - (w.t) t,        w: weight per length, buoyed

whose size is the side load q_N. In inclination a and azimuth b it is sqrt((F a' - w sin a)^2 + (F b' sin a)^2): tension
lifts a string off the low side where the hole builds, and presses it down where it drops. (Johancsik, Friesen and
Dawson, SPE 11380, count the angles from the bit upwards, where a' has the other sign.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError
from ..scene.mud import turning_drag

if TYPE_CHECKING:
    from ..boreholes import Borehole
    from ..scene import Scene

F8 = NDArray[np.float64]

STRIBECK, COULOMB = "stribeck", "coulomb"


class Pieces(NamedTuple):
    """Sections of a string from the top down, (m,) each; SI units."""

    length: F8
    weight: F8  # per length, buoyed, N/m
    radius: F8  # of what touches the wall, m
    bending: F8  # EI, N m2


class Stretch(NamedTuple):
    """A string along its hole at arc lengths (n,)."""

    tangent: F8  # (n, 3)
    curvature: F8  # (n, 3) dt/dp, 1/m
    along: F8  # (n,) weight along the hole, positive down it, N/m
    across: F8  # (n, 3) weight across it, N/m
    radius: F8  # (n,) of what touches the wall, m
    clearance: F8  # (n,) between that and the wall, m
    bending: F8  # (n,) EI, N m2
    static: F8  # (n,) coefficients of friction
    dynamic: F8  # (n,)


@dataclass(frozen=True)
class Line:
    """A string that lies along its hole, its top at measured depth 0.

    ``friction``: static and dynamic coefficient where the hole itself has none; ``down``: direction of gravity;
    ``below``: weight (N) that hangs on the lower end.
    """

    hole: Borehole
    pieces: Pieces
    friction: tuple[float, float] = (0.0, 0.0)
    down: tuple[float, float, float] = (0.0, 0.0, 1.0)
    below: float = 0.0

    @property
    def length(self) -> float:
        """Length of the string: the measured depth of its lower end, m."""
        return float(self.pieces.length.sum())

    @property
    def joints(self) -> F8:
        """Arc lengths (m + 1,) of the top, where sections meet, and of the lower end."""
        return np.concatenate([[0.0], np.cumsum(self.pieces.length)])

    @property
    def breaks(self) -> F8:
        """Ascending arc lengths from the top to the lower end, between which nothing jumps."""
        table = self.hole.table
        inside = np.concatenate([self.joints, table.knots, table.radius_at, table.friction_at])
        return np.unique(np.clip(inside, 0.0, self.length))

    def to_depth(self, depth: float) -> Line:
        """The same string with its lower end at ``depth`` (m): shortened from the top, or its first section longer."""
        gone = self.length - depth
        if gone < 0:
            length = self.pieces.length.copy()
            length[0] -= gone
            return replace(self, pieces=self.pieces._replace(length=length))
        first = int(np.searchsorted(np.cumsum(self.pieces.length), gone, side="right"))
        kept = Pieces(*(x[first:] for x in self.pieces))
        length = kept.length.copy()
        length[0] = float(self.pieces.length[: first + 1].sum()) - gone
        return replace(self, pieces=kept._replace(length=length))

    def piece(self, s: F8) -> NDArray[np.int64]:
        """Section (n,) of arc lengths s (n,); the one above where two meet."""
        return np.clip(np.searchsorted(self.joints, s * (1 - 1e-13)) - 1, 0, len(self.pieces.length) - 1)

    def at(self, s: F8) -> Stretch:
        """What the string finds at arc lengths s (n,); of the section above where two meet."""
        frame, table, pieces = self.hole.frame(s), self.hole.table, self.pieces
        i = self.piece(s)
        t = frame.tangent / np.linalg.norm(frame.tangent, axis=1)[:, None]
        weight = pieces.weight[i][:, None] * np.array(self.down)
        along = np.einsum("ij,ij->i", weight, t)
        across = weight - along[:, None] * t
        friction = np.tile(self.friction, (len(s), 1))
        if len(table.friction_at):
            friction = np.stack([np.interp(s, table.friction_at, table.friction[:, j]) for j in (0, 1)], axis=1)
        radius = pieces.radius[i]
        room = frame.radius - radius
        return Stretch(t, frame.curvature, along, across, radius, room, pieces.bending[i], *friction.T)

    def hanging(self, s: F8) -> F8:
        """Effective tension (n,) in N at arc lengths s (n,) of the string that hangs freely and turns.

        The weight along a hole is the weight per length times the depth between: exact for any hole.
        """
        joints = self.joints
        deep = self.hole.frame(joints).position @ np.array(self.down)
        carried = np.concatenate([np.cumsum((self.pieces.weight * np.diff(deep))[::-1])[::-1], [0.0]]) + self.below
        i = self.piece(s)
        here = self.hole.frame(s).position @ np.array(self.down)
        return carried[i + 1] + self.pieces.weight[i] * (deep[i + 1] - here)

    def side_load(self, s: F8, reading: str = "weight-and-curvature") -> F8:
        """Force per length (n,) in N/m on the wall of the string that turns off bottom.

        reading: "weight-and-curvature", or "inclination": of the weight across the hole alone (errata 22).
        """
        here = self.at(s)
        force = here.across
        if reading != "inclination":
            force = force + self.hanging(s)[:, None] * here.curvature
        return np.linalg.norm(force, axis=1)


def line_of(scene: Scene) -> Line:
    """The string of a scene along its hole. Raises SceneError where there is none to lie in."""
    hole, contact = scene.borehole, scene.contact
    if hole is None or contact is None:
        raise SceneError("hole.kind = 'none': must be a hole, with [contact], for a string that lies in it")
    if why := hole.outside(0.0, scene.length):
        raise SceneError(f"string: must fit the hole: {why}")
    pieces = Pieces(
        np.array([s.length for s in scene.string]),
        np.array([scene.weight_per_length(s) for s in scene.string]),
        np.array([s.contact_radius for s in scene.string]),
        np.array([s.section_stiffness().bending1 for s in scene.string]),
    )
    north, east, down = scene.gravity.direction
    return Line(
        hole,
        pieces,
        (contact.friction_static, contact.friction_dynamic),
        (north, east, down),
        scene.gravity.magnitude * scene.ends.bottom_mass,
    )


@dataclass(frozen=True)
class WallFriction:
    """Friction that resists the spin of a soft string.

    ``torque``: arc lengths (n,) to static and dynamic friction torque per length (n,) in N m/m; ``arm``: to the radius
    (n,) in m at which the speed is taken, or ones; ``drag``: to a viscous torque per length and spin (n,) in N s.
    ``law``: "stribeck" (4-7) with ``velocity_scale`` n and ``regularisation`` eps, or "coulomb", set-valued: static
    below ``threshold`` (spin, rad/s), dynamic above (Aarsnes and Shor 2018). ``breaks``: where any of it jumps.
    """

    torque: Callable[[F8], tuple[F8, F8]]
    arm: Callable[[F8], F8]
    breaks: F8
    drag: Callable[[F8], F8] = np.zeros_like
    law: str = STRIBECK
    velocity_scale: float = 20.0
    regularisation: float = 1e-4
    threshold: float = 1.0

    def level(self, s: F8) -> F8:
        """Torque per length (n,) of a string that turns fast, N m/m."""
        return self.torque(s)[1]


def wall_friction(scene: Scene) -> WallFriction:
    """Friction of a scene's soft string, by the readings that the scene chooses."""
    line, contact, reading = line_of(scene), scene.contact, scene.soft_string
    assert contact is not None

    def torque(s: F8) -> tuple[F8, F8]:
        here = line.at(s)
        force = here.radius * line.side_load(s, reading.side_load)
        return here.static * force, here.dynamic * force

    def arm(s: F8) -> F8:
        return line.at(s).radius if reading.friction_argument == "contact-speed" else np.ones_like(s)

    viscosity = scene.mud.viscosity if scene.mud is not None else 0.0

    def drag(s: F8) -> F8:
        radius = [scene.string[i].outer_radius for i in line.piece(s)]
        hole = line.hole.frame(s).radius
        return np.array([turning_drag(viscosity, r, h) for r, h in zip(radius, hole, strict=True)])

    return WallFriction(
        torque,
        arm,
        line.breaks,
        drag if viscosity else np.zeros_like,
        law=reading.law,
        velocity_scale=contact.friction_velocity_scale,
        regularisation=contact.friction_regularisation,
        threshold=reading.threshold_spin,
    )
