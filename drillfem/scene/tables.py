"""The tables of a scene file below the string: hole, drive, bit, rock, and how to compute.

Everything is in SI units; names of attributes are the names of the TOML keys.
"""

# ruff: noqa: RUF009 (key() is dataclasses.field with a fixed set of metadata)
from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from drillfem.scene.keys import NOT_NEGATIVE, POSITIVE, Bound, at_least, between, key

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
class Hole:
    """The borehole around the string."""

    kind: str = key("shape of the hole's centreline", choices=("none", "straight"), default="none")
    diameter: float | None = key(
        "diameter of the hole", "m", POSITIVE, default=None, default_text="required with a hole"
    )

    def check(self) -> Iterator[tuple[str, str]]:
        if self.kind == "none" and self.diameter is not None:
            yield "diameter", "must be left out where kind = 'none'"
        if self.kind != "none" and self.diameter is None:
            yield "diameter", "must be a number > 0 in m, or text with such a unit"


@dataclass(frozen=True)
class Contact:
    """Contact with the wall: penalty per length of string, and a regularised friction law (4-4)-(4-11)."""

    stiffness: float = key("penalty k_s: force per length and penetration", "N/m^2", POSITIVE)
    friction_static: float = key("coefficient mu_s: the peak of the friction law", "1", NOT_NEGATIVE)
    friction_dynamic: float = key("coefficient mu_d at high speed", "1", NOT_NEGATIVE)
    friction_velocity_scale: float = key("n: the peak lies near the speed 1/n", "s/m", POSITIVE, default=20.0)
    friction_regularisation: float = key("epsilon: rounds the law off at zero speed", "1", POSITIVE, default=1e-4)
    projected: bool = key(
        "friction from the sliding speed along the wall only (false: the whole speed, as printed)",
        default=True,
    )

    def check(self) -> Iterator[tuple[str, str]]:
        if self.friction_dynamic > self.friction_static:
            yield "friction_dynamic", f"must not exceed friction_static = {self.friction_static:g}"


@dataclass(frozen=True)
class TopDrive:
    """What turns the string at its top, and what it hangs on."""

    kind: str = key("how the top is turned", choices=("imposed-speed", "imposed-angle", "none"), default="none")
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
    rise_time: float = key("time in which 'spin-up' reaches speed", "s", POSITIVE, default=15.0)
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

    def motion(self, t: float) -> tuple[float, float, float]:
        """Imposed angle in rad, speed in rad/s and acceleration in rad/s2 of the top at time t >= 0 in s.

        Constant speed, spin-up (appendix B.1.2) or case C3 (5-49); zero for kind "none".
        """
        if self.kind == "none" or self.speed is None:
            return 0.0, 0.0, 0.0
        omega = self.speed
        if self.profile == "spin-up":
            rise = self.rise_time
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
        return omega * t, omega, 0.0


@dataclass(frozen=True)
class Bit:
    """The bit: drag bit of Detournay's law (5-5)-(5-19), or a bit that touches nothing."""

    kind: str = key("law of the bit; 'free' touches no rock", choices=("cutting", "free"))
    radius: float = key("radius a", "m", POSITIVE)
    blades: int = key("number of blades n_b", bound=at_least(1))
    wear_flat_length: float = key("wear flat l, the sum over all blades", "m", NOT_NEGATIVE)
    friction: float = key("coefficient mu between wear flat and rock", "1", NOT_NEGATIVE)
    inclination: float = key("zeta: vertical over horizontal cutting force", "1", POSITIVE)
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
        "unstressed string in rigid motion",
        choices=("nominal", "rest", "literal", "given"),
        default="nominal",
    )
    spin_perturbation: float = key(
        "excess of spin at the bit as a fraction of the top's, falling linearly to the top", default=0.1
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


@dataclass(frozen=True)
class Ends:
    """How the string is held and loaded at its ends."""

    top: str = key(
        "'driven': turned by the top drive, on the hook if there is a bit; 'clamped'; 'pinned': rotates "
        "freely; 'hung': clamped but free to spin; 'free'",
        choices=("driven", "clamped", "pinned", "hung", "free"),
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
        "'petsc' steps the whole system, 'condensed' a straight string reduced to its bit, 'characteristics' an "
        "undamped torsional one along its waves",
        choices=("default", "petsc", "condensed", "characteristics"),
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
