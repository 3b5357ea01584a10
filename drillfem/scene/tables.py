"""The tables of a scene file below the string: hole, drive, bit, rock, and how to compute.

Everything is in SI units; names of attributes are the names of the TOML keys.
"""

# ruff: noqa: RUF009 (key() is dataclasses.field with a fixed set of metadata)
from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

from drillfem.scene.keys import NOT_NEGATIVE, POSITIVE, Bound, at_least, between, key, slots

Vector = tuple[float, ...]
E1, E2, E3 = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
UNIT_VECTOR = "must be a unit vector"

#: What `output.wanted` may name, by the lowest rung that gives it.
GIVES: dict[str, tuple[str, ...]] = {
    "lumped": (
        "bit_angular_speed", "bit_axial_speed", "bit_angle", "bit_depth", "bit_torque", "bit_weight", "depth_of_cut",
        "rate_of_penetration", "top_torque", "top_angular_speed", "top_power", "hook_load",
    ),
    "torsional": ("angle", "spin", "torque", "torsional_frequencies"),
    "axial-torsional": (
        "axial_speed", "axial_force", "kinetic_energy", "strain_energy", "axial_frequencies", "natural_frequencies",
    ),
    "planar": (
        "bending_moment", "bending_stress", "shear_force", "lateral_displacement", "curvature", "bending_frequencies",
    ),
    "spatial": ("side_force", "wall_friction", "whirl"),
}  # fmt: skip


def is_unit(v: Vector) -> bool:
    return abs(math.hypot(*v) - 1) < 1e-6


@dataclass(frozen=True)
class HoleSection:
    """A stretch of the hole's wall, such as casing; sections follow each other from the top down.

    Below the last one the hole is as [hole] and [contact] say.
    """

    to: float = key("measured depth of its lower end", "m", POSITIVE)
    diameter: float | None = key("diameter", "m", POSITIVE, default=None, default_text="hole.diameter")
    friction_static: float | None = key(
        "mu_s on this stretch", "1", NOT_NEGATIVE, default=None, default_text="contact.friction_static"
    )
    friction_dynamic: float | None = key(
        "mu_d on this stretch", "1", NOT_NEGATIVE, default=None, default_text="contact.friction_dynamic"
    )


#: What each kind of hole needs, besides a diameter.
HOLES: dict[str, tuple[str, ...]] = {
    "none": (),
    "straight": (),
    "arc": ("radius",),
    "build": ("kick_off", "radius", "final_inclination"),
    "helix": ("radius", "pitch"),
    "spline": ("points",),
    "survey": ("survey",),
}
#: Where those keys, and what else shapes a hole, make sense.
_SHAPES = {
    "inclination": ("straight", "arc", "build"),
    "azimuth": ("straight", "arc", "build", "helix"),
    "radius": ("arc", "build", "helix"),
    "kick_off": ("build",),
    "final_inclination": ("build",),
    "transition": ("build", "survey"),
    "pitch": ("helix",),
    "points": ("spline",),
    "survey": ("survey",),
}


@dataclass(frozen=True)
class Hole:
    """The borehole around the string: from the origin down, e1 is north, e2 east, e3 down."""

    kind: str = key(
        "shape of the hole's centreline: straight; 'arc'; 'build': straight, arc, straight; 'helix' about the "
        "vertical; 'spline' through points; 'survey' by minimum curvature",
        choices=tuple(HOLES),
        default="none",
    )
    diameter: float | None = key(
        "diameter of the hole", "m", POSITIVE, default=None, default_text="required with a hole"
    )
    inclination: float = key(
        "angle from the vertical at the top; 0 is along e3", "rad", between(0, math.pi), default=0.0
    )
    azimuth: float = key("angle of the bend, or of the inclined hole, from north to east", "rad", default=0.0)
    kick_off: float | None = key(
        "measured depth where a 'build' starts to bend", "m", NOT_NEGATIVE, default=None, default_text="see kind"
    )
    radius: float | None = key(
        "radius of curvature of arc and build; of a helix, that of its cylinder",
        "m",
        POSITIVE,
        default=None,
        default_text="see kind",
    )
    final_inclination: float | None = key(
        "inclination at which a 'build' becomes straight again",
        "rad",
        between(0, math.pi),
        default=None,
        default_text="see kind",
    )
    transition: float = key(
        "length of hole over which the curvature rises and falls; 0: in a 'build' it jumps, in a 'survey' it is 5 m",
        "m",
        NOT_NEGATIVE,
        default=0.0,
    )
    pitch: float | None = key("depth that a helix gains per turn", "m", POSITIVE, default=None, default_text="see kind")
    points: tuple[Vector, ...] | None = key(
        "points [north, east, down] of a 'spline', the first one the origin",
        "m",
        default=None,
        default_text="see kind",
    )
    survey: tuple[Vector, ...] | None = key(
        "stations [measured depth m, inclination rad, azimuth rad], or the name of a CSV file or built-in survey",
        default=None,
        default_text="see kind",
    )
    caliper: tuple[Vector, ...] | None = key(
        "diameters along the hole, rows [measured depth m, diameter m], or the name of a CSV file",
        default=None,
        default_text="none",
    )
    section: tuple[HoleSection, ...] | None = key(
        "stretches with their own diameter or friction", default=None, default_text="none"
    )

    def check(self) -> Iterator[tuple[str, str]]:
        if self.kind == "none" and self.diameter is not None:
            yield "diameter", "must be left out where kind = 'none'"
        if self.kind != "none" and self.diameter is None:
            yield "diameter", "must be a number > 0 in m, or text with such a unit"
        for name in HOLES[self.kind]:
            if getattr(self, name) is None:
                yield name, f"must be given for kind = {self.kind!r}"
        for name, kinds in _SHAPES.items():
            if self.kind not in kinds and getattr(self, name) not in (None, 0.0):
                yield name, f"must be left out where kind = {self.kind!r}; it belongs to {' and '.join(kinds)}"
        for name in ("caliper", "section"):
            if self.kind == "none" and getattr(self, name) is not None:
                yield name, "must be left out where kind = 'none'"
        for name, columns in (("points", 3), ("survey", 3), ("caliper", 2)):
            rows = getattr(self, name) or ()
            if any(len(row) != columns for row in rows):
                yield name, f"must have rows of {columns} numbers"
                return
            if rows and len(rows) < 2:
                yield name, "must have two rows or more"
        for name in ("survey", "caliper"):
            rows = getattr(self, name) or ()
            if any(b[0] <= a[0] for a, b in pairwise(rows)):
                yield name, "must have measured depths that increase from row to row"
        if self.section is not None and any(b.to <= a.to for a, b in pairwise(self.section)):
            yield "section", "must follow each other from the top down: 'to' must increase"
        if self.kind == "build" and self.final_inclination is not None and self.final_inclination <= self.inclination:
            yield "final_inclination", f"must exceed inclination = {self.inclination:g} rad at the top"

    @property
    def bends(self) -> bool:
        """Whether the hole leaves the axis e3 of the unstressed string."""
        return self.kind not in ("none", "straight") or self.inclination != 0


@dataclass(frozen=True)
class Contact:
    """Contact with the wall, and a regularised friction law (4-4)-(4-11)."""

    stiffness: float = key("penalty k_s: force per length and penetration", "N/m^2", POSITIVE)
    friction_static: float = key("coefficient mu_s: the peak of the friction law", "1", NOT_NEGATIVE)
    friction_dynamic: float = key("coefficient mu_d at high speed", "1", NOT_NEGATIVE)
    method: str = key(
        "'penalty': (4-5); 'smooth': the same, rounded off where it begins; 'augmented': penalty with multipliers that "
        "push the penetration below its tolerance",
        choices=("penalty", "smooth", "augmented"),
        default="penalty",
    )
    smoothing: float = key("smooth: half the range of gap over which the force builds up", "m", POSITIVE, default=1e-3)
    penetration_tolerance: float = key("augmented: penetration that is small enough", "m", POSITIVE, default=1e-5)
    retardation_time: float = key(
        "time by which the rate of penetration counts beside the penetration: damps bouncing; 'augmented' takes "
        "time.step at least",
        "s",
        NOT_NEGATIVE,
        default=0.0,
    )
    friction_velocity_scale: float = key("n: the peak lies near the speed 1/n", "s/m", POSITIVE, default=20.0)
    friction_regularisation: float = key("epsilon: rounds the law off at zero speed", "1", POSITIVE, default=1e-4)
    friction_profile: tuple[Vector, ...] | None = key(
        "friction along the hole, rows [measured depth m, mu_s, mu_d], or the name of a CSV file",
        default=None,
        default_text="none",
    )
    projected: bool = key(
        "friction from the sliding speed along the wall only (false: the whole speed, as printed)",
        default=True,
    )
    normal_force: str = key(
        "that friction takes: 'wall': of the contact; 'weight': the string's weight across the hole, everywhere and "
        "always, while stiffness holds the string on the centreline (chapter 7, case B)",
        choices=("wall", "weight"),
        default="wall",
    )
    closest_point: str = key(
        "how the hole's closest point is found: 'newton' per point, or as a 'field' solved with the rod (D-6)",
        choices=("newton", "field"),
        default="newton",
    )

    def check(self) -> Iterator[tuple[str, str]]:
        if self.friction_dynamic > self.friction_static:
            yield "friction_dynamic", f"must not exceed friction_static = {self.friction_static:g}"
        for name in ("method", "closest_point", "retardation_time"):
            if self.normal_force == "weight" and getattr(self, name) != slots(Contact)[name].default:
                yield name, "must be left out where normal_force = 'weight', which knows no penetration"
        rows = self.friction_profile or ()
        if any(len(row) != 3 for row in rows):
            yield "friction_profile", "must have rows of 3 numbers"
        elif any(b[0] <= a[0] for a, b in pairwise(rows)):
            yield "friction_profile", "must have measured depths that increase from row to row"
        elif any(not 0 <= mu_d <= mu_s for _, mu_s, mu_d in rows):
            yield "friction_profile", "must have 0 <= mu_d <= mu_s in every row"


@dataclass(frozen=True)
class Mud:
    """Drilling fluid around and inside the string: what it takes off the weight, and how it slows the motion."""

    density: float = key("density", "kg/m^3", POSITIVE)
    viscosity: float = key("dynamic viscosity", "Pa s", NOT_NEGATIVE, default=0.0)
    added_mass: bool = key("fluid that must move aside adds to the lateral inertia", default=False)


@dataclass(frozen=True)
class TopDrive:
    """What turns the string at its top, and what it hangs on."""

    kind: str = key(
        "how the top is turned: by a speed or an angle, or by a torque that follows the speed: 'pi' (4-1), "
        "'soft-torque' (PI tuned to the string's impedance) or 'z-torque' (matched at all frequencies)",
        choices=("imposed-speed", "imposed-angle", "pi", "soft-torque", "z-torque", "none"),
        default="none",
    )
    speed: float | None = key(
        "speed Omega_0 (of a profile: the speed that it is built around)",
        "rad/s",
        default=None,
        default_text="required unless kind is none",
    )
    profile: str | None = key(
        "angle over time; 'spin-up' rises smoothly to speed (appendix B.1.2), 'c3' is (5-49)",
        choices=("spin-up", "c3"),
        default=None,
        default_text="required for imposed-angle",
    )
    rise_time: float | None = key(
        "time in which the wanted speed rises from 0; 'spin-up' needs it",
        "s",
        POSITIVE,
        default=None,
        default_text="spin-up: 15; else the speed is there at once",
    )
    proportional_gain: float | None = key(
        "k_p of kind 'pi'", "N m s/rad", NOT_NEGATIVE, default=None, default_text="required for pi"
    )
    integral_gain: float | None = key(
        "k_i of kind 'pi'", "N m/rad", NOT_NEGATIVE, default=None, default_text="required for pi"
    )
    tuning_frequency: float | None = key(
        "frequency at which 'soft-torque' matches the string's impedance",
        "Hz",
        POSITIVE,
        default=None,
        default_text="the string's lowest",
    )
    torque_limit: float | None = key("largest torque of the drive", "N m", POSITIVE, default=None, default_text="none")
    axis: Vector = key(
        "unit vector about which the top turns; e3 points down along the straight string",
        "1",
        count=3,
        default=E3,
    )
    weight_on_bit: float | None = key(
        "W0: the hook load is the string's weight minus this",
        "N",
        NOT_NEGATIVE,
        default=None,
        default_text="required by a cutting bit",
    )
    hook_load: float | None = key(
        "H0, in the place of weight_on_bit", "N", NOT_NEGATIVE, default=None, default_text="see weight_on_bit"
    )
    block_speed: float | None = key(
        "axial speed of the top, down is positive, in the place of a load on the hook",
        "m/s",
        default=None,
        default_text="0 where nothing is drilled",
    )

    def check(self) -> Iterator[tuple[str, str]]:
        if not is_unit(self.axis):
            yield "axis", UNIT_VECTOR
        if self.kind != "none" and self.speed is None:
            yield "speed", f"must be a number in rad/s, or text with such a unit, for kind = {self.kind!r}"
        if self.kind == "imposed-angle" and self.profile is None:
            yield "profile", "must be one of spin-up, c3 for kind = 'imposed-angle'"
        if self.kind != "imposed-angle" and self.profile is not None:
            yield "profile", f"must be left out where kind = {self.kind!r}"
        if self.weight_on_bit is not None and self.hook_load is not None:
            yield (
                "hook_load",
                f"must be left out where weight_on_bit = {self.weight_on_bit:g} N is given: one follows from the other",
            )
        if self.block_speed is not None and (self.weight_on_bit is not None or self.hook_load is not None):
            yield "block_speed", "must be left out where the load on the hook is given"
        for name in ("proportional_gain", "integral_gain"):
            if self.kind == "pi" and getattr(self, name) is None:
                yield name, f"must be a number >= 0 in {slots(TopDrive)[name].key.unit} for kind = 'pi'"
            if self.kind != "pi" and getattr(self, name) is not None:
                yield name, f"must be left out where kind = {self.kind!r}"
        if self.kind != "soft-torque" and self.tuning_frequency is not None:
            yield "tuning_frequency", f"must be left out where kind = {self.kind!r}"
        if not self.follows and self.torque_limit is not None:
            yield "torque_limit", f"must be left out where kind = {self.kind!r}: an imposed motion takes what it needs"
        if self.follows and self.axis != E3:
            yield "axis", f"must be [0, 0, 1] for kind = {self.kind!r}"
        if self.kind == "none" and self.rise_time is not None:
            yield "rise_time", "must be left out where kind = 'none'"

    @property
    def follows(self) -> bool:
        """Whether the drive is a torque that follows the speed, not an imposed motion."""
        return self.kind in ("pi", "soft-torque", "z-torque")

    def motion(self, t: float) -> tuple[float, float, float]:
        """Imposed angle in rad, speed in rad/s and acceleration in rad/s2 of the top at time t >= 0 in s.

        Constant speed, spin-up (appendix B.1.2) or case C3 (5-49); zero for kind "none".
        """
        if self.kind == "none" or self.speed is None:
            return 0.0, 0.0, 0.0
        omega = self.speed
        if self.profile == "spin-up":
            rise = self.rise_time or 15.0
            if t > rise:
                return omega * (t - rise / 2), omega, 0.0
            w = 2 * math.pi / rise
            return (
                omega / rise * (t**2 / 2 + (math.cos(w * t) - 1) / w**2),
                omega / rise * (t - math.sin(w * t) / w),
                omega / rise * (1 - math.cos(w * t)),
            )
        if self.profile == "c3" and t > 2:
            x = t - 2
            return (
                omega * t + math.cos(2 * x) + math.cos(10 * x) / 5 - 6 / 5,
                omega - 2 * math.sin(2 * x) - 2 * math.sin(10 * x),
                -4 * math.cos(2 * x) - 20 * math.cos(10 * x),
            )
        if self.rise_time is not None and self.profile is None:
            rise = self.rise_time
            if t < rise:
                return omega * t**2 / (2 * rise), omega * t / rise, omega / rise
            return omega * (t - rise / 2), omega, 0.0
        return omega * t, omega, 0.0


@dataclass(frozen=True)
class Empirical:
    """Torque and rate of penetration as functions of weight and spin, regularised (B-5); table B.2."""

    a1: float = key("a_1: rate of penetration that weight must overcome", "m/s", default=3.429e-3)
    a2: float = key("a_2: rate of penetration per weight", "m/(N s)", POSITIVE, default=5.672e-8)
    a3: float = key("a_3: depth of cut that the spin gives", "m/rad", default=1.374e-4)
    a4: float = key("a_4: torque per depth of cut", "N rad", NOT_NEGATIVE, default=9.537e6)
    a5: float = key("a_5: torque at no depth of cut", "N m", NOT_NEGATIVE, default=1475.0)
    regularisation: float = key("epsilon: spin over which all of it builds up", "rad/s", POSITIVE, default=2.0)
    force: str = key(
        "weight in the law: 'reaction' is the force between bit and rock, 'nominal' the constant weight on bit",
        choices=("reaction", "nominal"),
        default="reaction",
    )


@dataclass(frozen=True)
class Saturating:
    """Resistance c1 (1 - exp(-c2 v)) of rock to a bit that advances with v > 0, none to one that comes back (7-6)."""

    strength: float = key("c_1: resistance to a fast bit", "N", NOT_NEGATIVE, default=1400.0)
    rate: float = key("c_2: 1/c_2 is the speed over which it builds up", "s/m", POSITIVE, default=400.0)


_BY_CUTTING = "required by a cutting bit"
_CUTS = ("radius", "blades", "wear_flat_length", "friction", "inclination")


@dataclass(frozen=True)
class Bit:
    """The bit: Detournay's drag bit (5-5)-(5-19), the empirical law of Appendix B.4, the axial one of chapter 7, or a
    bit that touches nothing."""

    kind: str = key(
        "law of the bit; 'saturating' resists being pushed along e3, and does not turn; 'free' touches no rock",
        choices=("cutting", "free", "empirical", "saturating"),
    )
    radius: float = key("radius a", "m", POSITIVE, default=math.nan, default_text=_BY_CUTTING)
    blades: int = key("number of blades n_b", bound=at_least(1), default=1, default_text=_BY_CUTTING)
    wear_flat_length: float = key(
        "wear flat l, the sum over all blades", "m", NOT_NEGATIVE, default=math.nan, default_text=_BY_CUTTING
    )
    friction: float = key(
        "coefficient mu between wear flat and rock", "1", NOT_NEGATIVE, default=math.nan, default_text=_BY_CUTTING
    )
    inclination: float = key(
        "zeta: vertical over horizontal cutting force", "1", POSITIVE, default=math.nan, default_text=_BY_CUTTING
    )
    geometry: float = key("gamma: where the wear flats lie on the radius", "1", POSITIVE, default=1.0)
    blade_angles: Vector | None = key(
        "angles of the blades if not equally spaced, increasing within one turn",
        "rad",
        default=None,
        default_text="equally spaced",
    )
    axial_regularisation: float = key(
        "c1: axial speed over which the wear-flat force builds up", "m/s", POSITIVE, default=1e-5
    )
    torsional_regularisation: float = key(
        "c2: spin over which the contact strength passes from stalled to moving",
        "rad/s",
        POSITIVE,
        default=0.1,
    )
    cutting_regularisation: float = key(
        "c3: spin over which the cutting force builds up", "rad/s", POSITIVE, default=1e-3
    )

    empirical: Empirical = key("numbers of the empirical law", default=Empirical())
    saturating: Saturating = key("numbers of the saturating law", default=Saturating())
    guide_stiffness: float = key(
        "force per length that holds the bit on the centreline of a curved hole", "N/m", POSITIVE, default=1e7
    )

    def lacking(self, raw: Mapping[str, object]) -> Iterator[str]:
        if self.kind == "cutting":
            yield from (name for name in _CUTS if name not in raw)

    def check(self) -> Iterator[tuple[str, str]]:
        angles = self.blade_angles
        if angles is None:
            return
        if len(angles) != self.blades:
            yield (
                "blade_angles",
                f"must have one angle for each of the {self.blades} blades, has {len(angles)}",
            )
        if any(b <= a for a, b in pairwise(angles)):
            yield "blade_angles", "must be strictly increasing"
        if angles[0] < 0 or angles[-1] >= 2 * math.pi:
            yield "blade_angles", "must lie within one turn, from 0 to less than 360 deg"


@dataclass(frozen=True)
class Motor:
    """A mud motor that shakes the lower end: a force F sin(omega t) along e3 (7-7)."""

    force: float = key("amplitude f_0", "N", NOT_NEGATIVE)
    frequency: float = key("angular frequency omega_f", "rad/s", NOT_NEGATIVE)


@dataclass(frozen=True)
class Numbers:
    """The numbers of Appendix C.2, (C-1)-(C-7), in the place of string, drive, bit and rock: a lumped model."""

    psi: float = key("system number", "1", POSITIVE)
    beta: float = key("bit-rock interaction number", "1", NOT_NEGATIVE)
    lambda_: float = key("bluntness number", "1", NOT_NEGATIVE, name="lambda")
    omega_0: float = key("speed of the top", "1", POSITIVE)
    W_0: float = key("weight on bit", "1", POSITIVE)
    blades: int = key("number of blades", bound=at_least(1), default=6)
    # the scales of the thesis' string, spec 7.7
    time: float = key("time scale t*", "s", POSITIVE, default=0.34674)
    length: float = key("length scale L*", "m", POSITIVE, default=6.3831e-4)


@dataclass(frozen=True)
class Surface:
    """Numerics of the rock surface that the blades cut."""

    scheme: str = key(
        "'dg': advection by discontinuous Galerkin; 'supg': by stabilised linear elements; 'upwind': by first-order "
        "upwind cells; 'profile': the profile itself moves, exactly",
        choices=("dg", "supg", "upwind", "profile"),
        default="dg",
    )
    degree: int = key("polynomial degree of dg", bound=between(0, 4), default=2)
    elements: int = key("elements (or knots) between two blades", bound=between(1, 100_000), default=16)


@dataclass(frozen=True)
class Rock:
    """The rock under a cutting bit."""

    intrinsic_specific_energy: float = key("epsilon_1: energy to cut a volume", "Pa", POSITIVE)
    contact_strength: float = key("sigma_1: pressure under the wear flats of a turning bit", "Pa", POSITIVE)
    contact_strength_stalled: float = key("sigma_2: pressure under the wear flats of a stalled bit", "Pa", POSITIVE)
    surface: Surface = key("numerics of the rock surface", default=Surface())


@dataclass(frozen=True)
class Initial:
    """The state at the start."""

    state: str = key(
        "'nominal': steady drilling; 'literal': as the thesis prints it, untwisted; 'rest'; 'given': the "
        "unstressed string in rigid motion; 'laid': at rest in the hole, in equilibrium without friction",
        choices=("nominal", "rest", "literal", "given", "laid"),
        default="nominal",
    )
    spin_perturbation: float = key(
        "excess of spin at the bit as a fraction of the top's, falling linearly to the top", default=0.1
    )
    spin: float | None = key(
        "spin of the whole string at the start, of nominal and literal; spin_perturbation comes on top",
        "rad/s",
        default=None,
        default_text="top_drive.speed",
    )
    velocity: Vector = key(
        "velocity of the top end; only with state = 'given'", "m/s", count=3, default=(0.0, 0.0, 0.0)
    )
    angular_velocity: Vector = key(
        "angular velocity in the fixed frame; only with state = 'given'",
        "rad/s",
        count=3,
        default=(0.0, 0.0, 0.0),
    )
    seed_perturbation: float = key(
        "relative size of a random change of the state, for nearby starts", "1", NOT_NEGATIVE, default=0.0
    )
    seed: int = key("seed of that change", bound=at_least(0), default=0)

    def check(self) -> Iterator[tuple[str, str]]:
        for name in ("velocity", "angular_velocity"):
            if self.state != "given" and any(getattr(self, name)):
                yield name, f"must be left out where state = {self.state!r}"
        if self.spin is not None and self.state not in ("nominal", "literal"):
            yield "spin", f"must be left out where state = {self.state!r}"


@dataclass(frozen=True)
class Ends:
    """How the string is held and loaded at its ends."""

    top: str = key(
        "'driven': turned by the top drive, on the hook if there is a bit; 'clamped'; 'pinned': rotates "
        "freely; 'hung': clamped but free to spin; 'sliding': clamped but free to move along e3; 'free'",
        choices=("driven", "clamped", "pinned", "hung", "sliding", "free"),
        default="driven",
    )
    bottom: str = key(
        "'bit': on the hole's axis, loaded by the bit; 'guided': on the axis, free to slide and spin; "
        "'clamped'; 'free'",
        choices=("bit", "free", "guided", "clamped"),
        default="bit",
    )
    top_mass: float = key("mass lumped at the top", "kg", NOT_NEGATIVE, default=0.0)
    top_inertia: float = key("rotary inertia about the axis lumped at the top", "kg m^2", NOT_NEGATIVE, default=0.0)
    bottom_mass: float = key("mass lumped at the bottom", "kg", NOT_NEGATIVE, default=0.0)
    bottom_inertia: float = key(
        "rotary inertia about the axis lumped at the bottom", "kg m^2", NOT_NEGATIVE, default=0.0
    )
    top_force: Vector = key("dead force at the top end, fixed frame", "N", count=3, default=(0.0, 0.0, 0.0))
    tip_force: Vector = key("dead force at the bottom end, fixed frame", "N", count=3, default=(0.0, 0.0, 0.0))
    tip_moment: Vector = key("dead moment at the bottom end, fixed frame", "N m", count=3, default=(0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Inertia:
    """Where the string's inertia sits: spread along it, or lumped at the bit as the lumped model has it."""

    distributed: float = key(
        "alpha: share of the string's own inertia that stays spread along it; the rest of the lumped model's "
        "inertia (5-39) sits at the bit (5.5.4). The weight is that of the whole string",
        "1",
        Bound("> 0 and <= 1", lambda x: 0 < x <= 1),
        default=1.0,
    )


@dataclass(frozen=True)
class SoftString:
    """How the soft-string model finds the friction along the hole."""

    side_load: str = key(
        "wall force per length: of the weight across the hole, or also of the tension in its bends (errata 22)",
        choices=("inclination", "weight-and-curvature"),
        default="weight-and-curvature",
    )
    friction_argument: str = key(
        "what the friction law takes for speed: that of the touching point, or (as printed) the spin",
        choices=("contact-speed", "spin"),
        default="contact-speed",
    )
    law: str = key(
        "'stribeck' (4-7), or 'coulomb': set-valued, dynamic above threshold_spin",
        choices=("stribeck", "coulomb"),
        default="stribeck",
    )
    threshold_spin: float = key("coulomb: spin above which friction is dynamic", "rad/s", POSITIVE, default=1.0)


@dataclass(frozen=True)
class Reference:
    """Shape of the string when it carries nothing; it starts at the origin along e3."""

    shape: str = key("shape of the unstressed string", choices=("straight", "arc"), default="straight")
    radius: float | None = key("radius of the arc", "m", POSITIVE, default=None, default_text="required for an arc")
    bend_towards: Vector = key("unit vector across e3 towards which the arc bends", "1", count=3, default=E1)

    def check(self) -> Iterator[tuple[str, str]]:
        if self.shape == "arc" and self.radius is None:
            yield "radius", "must be a number > 0 in m, or text with such a unit, for shape = 'arc'"
        if self.shape == "straight" and self.radius is not None:
            yield "radius", "must be left out where shape = 'straight'"
        if not is_unit(self.bend_towards) or abs(self.bend_towards[2]) > 1e-6:
            yield "bend_towards", UNIT_VECTOR + " across e3, such as [1, 0, 0]"


@dataclass(frozen=True)
class Gravity:
    """Gravity, along e3 (down the straight string) unless told otherwise."""

    magnitude: float = key("acceleration g", "m/s^2", NOT_NEGATIVE, default=9.80665)
    direction: Vector = key("unit vector of gravity in the fixed frame", "1", count=3, default=E3)

    def check(self) -> Iterator[tuple[str, str]]:
        if not is_unit(self.direction):
            yield "direction", UNIT_VECTOR


@dataclass(frozen=True)
class Mesh:
    """Finite elements along the string."""

    elements: int = key("elements of the whole string", bound=between(1, 100_000), default=64)
    degree: int = key("polynomial degree of the fields", bound=between(1, 4), default=3)
    grading: float = key("length of the last over the first element of the last section", "1", POSITIVE, default=1.0)
    quadrature: str = key(
        "'reduced' keeps slender elements from locking", choices=("reduced", "full"), default="reduced"
    )


@dataclass(frozen=True)
class Time:
    """How time, or in statics the load, advances."""

    analysis: str = key(
        "'static' raises the load from 0 to 1 in load_steps, and calls that time",
        choices=("dynamic", "static"),
        default="dynamic",
    )
    start: float = key("time of the start", "s", default=0.0)
    end: float = key("time of the end", "s", default=0.0, default_text="required for dynamics; statics: 1")
    step: float = key(
        "time step (the first one, if adaptive)",
        "s",
        POSITIVE,
        default=0.0,
        default_text="required for dynamics; statics: 1/load_steps",
    )
    integrator: str = key(
        "time integrator",
        default="default",
        choices=(
            "default",
            "generalized-alpha",
            "theta",
            "bdf",
            "arkimex",
            "exact",
            "trapezoidal",
            "explicit",
        ),
    )
    order: int = key("order of bdf and arkimex", bound=between(1, 6), default=2)
    rho_infinity: float = key(
        "generalized-alpha: what is left per step of infinitely fast waves", "1", between(0, 1), default=0.9
    )
    theta: float = key("theta: 0.5 is the trapezoidal rule, 1 is backward Euler", "1", between(0.5, 1), default=0.5)
    adaptive: bool = key("let the error estimate choose the step", default=False)
    tolerance: float = key(
        "relative error per adaptive step", "1", Bound("> 0 and < 1", lambda x: 0 < x < 1), default=1e-6
    )
    load_steps: int = key("load steps of a static analysis", bound=at_least(1), default=10)
    jacobian: str = key(
        "'kept': the tangent is reused while it contracts well",
        choices=("kept", "every-iteration"),
        default="kept",
    )
    engine: str = key(
        "'petsc' steps the whole system, 'compiled' does so by a compiled loop, 'condensed' a straight string reduced "
        "to its bit, 'characteristics' an undamped torsional one along its waves",
        choices=("default", "petsc", "compiled", "condensed", "characteristics"),
        default="default",
    )

    def check(self) -> Iterator[tuple[str, str]]:
        if self.analysis == "dynamic":
            if self.end <= self.start:
                yield "end", f"must be a time later than start = {self.start:g} s"
            elif not 0 < self.step <= self.end - self.start:
                yield "step", f"must be > 0 and at most end - start = {self.end - self.start:g} s"
        elif self.end not in (0.0, 1.0):  # 1 is what a completed scene carries
            yield "end", "must be left out of a static analysis, which runs from load 0 to 1"


@dataclass(frozen=True)
class Output:
    """What is written, and how often."""

    interval: float = key("time between two rows of the history", "s", POSITIVE, default=0.0, default_text="time.step")
    fields_interval: float = key(
        "time between two pictures of the whole string",
        "s",
        POSITIVE,
        default=0.0,
        default_text="a twentieth of the run",
    )
    checkpoint_interval: float = key("time between two checkpoints", "s", POSITIVE, default=5.0)
    wanted: tuple[str, ...] | None = key(
        "what is wanted of the run: the model must give it",
        choices=[name for names in GIVES.values() for name in names],
        default=None,
        default_text="motion and loads of the bit",
    )
    tolerance: float = key(
        "relative error of them that a poorer model may make",
        "1",
        Bound("> 0 and < 1", lambda x: 0 < x < 1),
        default=0.05,
    )
