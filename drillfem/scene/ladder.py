"""The ladder of models: which rung represents a scene and what is wanted of it, from rules that compute numbers.

A rule is a small function of a scene. It gives a `Finding`: the lowest rung that it allows, the numbers it computed,
and a line that says so. `choose` takes the lowest rung that every rule allows; `drillfem plan` prints them all.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drillfem.scene.nominal import lumps, quantity
from drillfem.scene.numbers import SPRING
from drillfem.scene.tables import GIVES, Initial, Mesh, Output, Time

if TYPE_CHECKING:
    from drillfem.boreholes import Frame
    from drillfem.scene.scene import Scene
    from drillfem.stability.transfer import Waves

F8 = NDArray[np.float64]
C16 = NDArray[np.complex128]

MODELS = ("lumped", "torsional", "axial-torsional", "planar", "spatial")  # from the poorest to the richest
STRAIGHT = MODELS[:3]
#: A model beside the ladder: torsional with friction along the hole. It is run where it is asked for by name.
BESIDE = ("soft-string",)

#: What a string that drills nothing has without moving along its axis.
_TWIST = (*GIVES["torsional"], "top_torque", "top_angular_speed", "top_power")

#: Frequencies are looked at up to this multiple of the blade-passing frequency.
BAND = 1.5


class ModelChoice(NamedTuple):
    """The model that a scene runs with, and why."""

    name: str
    reason: str


@dataclass(frozen=True)
class Finding:
    """What a rule found: the lowest rung that it allows, a line, the numbers in it (SI), and the source of the rule.

    ``error``: its estimate of what the rung below ``needs`` would be wrong by, relative; None where it has none.
    """

    rule: str
    needs: str
    text: str
    numbers: Mapping[str, float]
    source: str
    error: float | None = None


def rank(model: str) -> int:
    """Place on the ladder, 0 for the poorest."""
    return MODELS.index("torsional" if model in BESIDE else model)


def across(v: Sequence[float]) -> bool:
    """Whether a vector has a part across e3, the axis of the straight string."""
    return abs(v[0]) > 1e-12 or abs(v[1]) > 1e-12


# -- what a rung has no room for --------------------------------------------------------------------------
def obstacle(scene: Scene, model: str) -> str:
    """Why `model` cannot represent the scene at all, or cannot give what is wanted; empty if it can."""
    ends, gravity = scene.ends, scene.gravity.direction if scene.gravity.magnitude else (0.0, 0.0, 0.0)
    turns = scene.top_drive.kind != "none"
    motion = (scene.initial.velocity, scene.initial.angular_velocity)
    if missing := [name for name in scene.output.wanted or () if rank(giver(name)) > rank(model)]:
        return f"it does not give {' and '.join(missing)}"
    if model == "soft-string":
        if scene.bites:
            return "its bit touches no rock"
        if scene.resists or scene.motor is not None or any(ends.top_force):
            return "it does not move along its axis"
        if scene.contact is None or scene.hole.kind == "none":
            return "it needs a hole and [contact], for its friction"
        return "" if scene.reference.shape == "straight" else "the unstressed string is bent"
    if model == "lumped" and not scene.drills:
        return "it stands for a string on a cutting bit, and there is none"
    if model in ("lumped", "torsional") and scene.bites and (why := _beyond_condensation(scene)):
        return why
    if model not in ("lumped", "torsional") and any(s.name == SPRING for s in scene.string):
        return "it was given by numbers and has no string"
    if model in STRAIGHT:
        if scene.reference.shape != "straight":
            return f"the unstressed string is bent (reference.shape = {scene.reference.shape!r})"
        if why := _bend_text(scene):
            return why
        if across(gravity):
            return "gravity acts across the string"
        if across(ends.tip_force) or across(ends.tip_moment):
            return "the load at the tip bends the string"
        if across(ends.top_force):
            return "the load at the top acts across the string"
        if (turns and across(scene.top_drive.axis)) or any(map(across, motion)):
            return "the motion is not along and about the string's axis"
        along_axis = ends.tip_force[2] or ends.top_force[2] or motion[0][2] or scene.motor or scene.resists
        if model == "torsional" and not scene.drills and along_axis:
            return "the string is loaded or moves along its axis"
    if model == "planar":
        if scene.bit is not None and not scene.resists:
            return "a bit turns about the string's axis, which the plane x-z has no room for"
        if turns and abs(abs(scene.top_drive.axis[1]) - 1) > 1e-9:
            return "the top drive turns about another axis than e2"
        if scene.reference.shape != "straight" and abs(scene.reference.bend_towards[1]) > 1e-12:
            return "the unstressed string is bent out of the plane x-z"
        if why := _bend_text(scene):
            return why
        out = (
            ends.tip_force[1],
            ends.top_force[1],
            gravity[1],
            motion[0][1],
            ends.tip_moment[0],
            ends.tip_moment[2],
            motion[1][0],
            motion[1][2],
        )
        if any(abs(x) > 1e-12 for x in out):
            return "loads or motions lead out of the plane x-z"
    return ""


def _beyond_condensation(scene: Scene) -> str:
    """Why a bit on rock needs more than the lumped and the torsional model, which know its string by responses."""
    if not scene.drills:
        return "its bit cuts, by another law than this scene's"
    if scene.top_drive.follows:
        return f"its top turns at a given speed, not by a torque (top_drive.kind = {scene.top_drive.kind!r})"
    if scene.top_drive.block_speed is not None:
        return "its top hangs on a given load, and moves as it likes"
    return "it knows no mud" if scene.mud is not None else ""


def giver(name: str) -> str:
    """The lowest rung that gives an output of `GIVES`."""
    return next(model for model, names in GIVES.items() if name in names)


# -- the hole ---------------------------------------------------------------------------------------------
class Bend(NamedTuple):
    """Where a hole bends most: curvature in 1/m, measured depth in m (nan: everywhere), whole turn in rad."""

    curvature: float
    at: float
    turn: float


def along(scene: Scene) -> tuple[F8, Frame] | None:
    """Measured depths (m,) along the hole that the string goes through, and its frame there; None along e3."""
    if not scene.hole.bends or scene.borehole is None:
        return None
    last = min(scene.length + scene.gain(), scene.borehole.length)
    at: F8 = np.linspace(0.0, last, 4001)  # type: ignore[assignment]
    return at, scene.borehole.frame(at)


def bend_of(scene: Scene) -> Bend | None:
    """The sharpest bend of the hole along the string; None for a straight one. What it calls itself does not count."""
    found = along(scene)
    if found is None:
        return None
    at, kappa = found[0], found[1].dogleg_severity
    if kappa.max() < 1e-12:
        return None
    return Bend(float(kappa.max()), float(at[kappa.argmax()]), float((kappa[1:] + kappa[:-1]).sum() * at[1] / 2))


def inclination_of(scene: Scene) -> float:
    """Greatest inclination (rad) of the hole along the string."""
    found = along(scene)
    return 0.0 if found is None else float(found[1].inclination.max())


def _bend_text(scene: Scene) -> str:
    """How the hole leaves the axis e3; empty for a straight one along it."""
    bend, inclination = bend_of(scene), inclination_of(scene)
    kind = f"hole.kind = {scene.hole.kind!r}"
    if bend is None:
        return f"the hole is inclined by {math.degrees(inclination):.3g} deg ({kind})" if inclination > 1e-12 else ""
    return f"the hole bends by {math.degrees(bend.curvature) * 30:.3g} deg per 30 m ({kind})"


def hole_rule(scene: Scene) -> Finding:
    """Shape of the hole and of the unstressed string: a bend needs a rung that bends.

    What it costs the string: moment EI kappa, stress E kappa r, and in a hole the wall's side force N kappa, whose
    friction takes the torque mu r |N| times the turn (capstan).
    """
    source = "capstan and beam theory; minimum curvature between survey stations"
    bend, where = bend_of(scene), "the hole"
    if scene.reference.shape == "arc" and scene.reference.radius:
        bend, where = Bend(1 / scene.reference.radius, math.nan, scene.length / scene.reference.radius), "the string"
    if bend is None:
        what = f"hole.kind = {scene.hole.kind!r}, and nothing in the scene bends its axis"
        return Finding("hole", "lumped", f"straight: {what}", {"curvature": 0.0}, source)
    # a straight rung would leave all of it out
    numbers = {"curvature": bend.curvature}
    stiff = [s.section_stiffness() for s in scene.string]
    moment = max(k.bending1 for k in stiff) * bend.curvature
    numbers |= {"dogleg_severity": math.degrees(bend.curvature) * 30, "bending_moment": moment}
    text = f"{where} bends by {numbers['dogleg_severity']:.3g} deg per 30 m"
    if not math.isnan(bend.at):
        text += f" near {bend.at:.4g} m"
    text += f": bending moment up to {quantity(moment, 'N m')}"
    strains = [s.outer_radius * bend.curvature for s in scene.string if s.outer_radius]
    if strains and all(s.material for s in scene.string):
        stress = max(s.material.moduli().axial * s.outer_radius * bend.curvature for s in scene.string if s.material)
        numbers["bending_stress"] = stress
        text += f", stress {quantity(stress, 'Pa')}"
    pull = tension(scene)
    if where == "the hole" and pull is not None:
        side = float(np.interp(bend.at, *pull)) if not math.isnan(bend.at) else float(np.abs(pull[1]).max())
        side = abs(side) * bend.curvature
        numbers["side_force"] = side
        text += f", side force {quantity(side, 'N')}/m"
        contact, torque = scene.contact, scene.nominal().torque_on_bit
        if contact is not None and not math.isnan(bend.turn):
            radius = max(s.outer_radius for s in scene.string)
            rub = contact.friction_dynamic * radius * float(np.abs(pull[1]).max()) * bend.turn
            numbers["friction_torque"] = rub
            text += f", friction torque up to {quantity(rub, 'N m')}"
            text += f" ({100 * rub / torque:.2g} % of the bit's)" if torque else ""
    return Finding("hole", "spatial", text, numbers, source, 1.0)


# -- loads across the string ------------------------------------------------------------------------------
def side_load_rule(scene: Scene) -> Finding:
    """Gravity, tip loads and motions across the string bend it; a straight rung has no room for them."""
    source = "balance of forces across the string (2-51), (2-61)"
    g, hole = scene.gravity, inclination_of(scene)
    numbers: dict[str, float] = {}
    why = []
    sine = max(math.hypot(*g.direction[:2]), math.sin(hole))
    if g.magnitude and (across(g.direction) or sine > 1e-12):
        angle = math.degrees(max(hole, math.atan2(math.hypot(*g.direction[:2]), abs(g.direction[2]))))
        load = max(scene.weight_per_length(s) for s in scene.string) * sine
        numbers |= {"inclination": angle, "side_load": load}
        why.append(
            f"gravity is inclined by {angle:.3g} deg to the string, which lies on its wall or sags with up to "
            f"{quantity(load, 'N')}/m"
        )
        contact, torque = scene.contact, scene.nominal().torque_on_bit
        if contact is not None:
            arm = math.fsum(scene.weight_per_length(s) * s.length * s.outer_radius for s in scene.string)
            rub = numbers["friction_torque"] = contact.friction_dynamic * sine * arm
            share = f" ({100 * rub / torque:.2g} % of the bit's)" if torque else ""
            why[-1] += f", friction torque {quantity(rub, 'N m')}{share}"
    force, moment = (math.hypot(*v[:2]) for v in (scene.ends.tip_force, scene.ends.tip_moment))
    numbers |= {name: x for name, x in (("tip_force", force), ("tip_moment", moment)) if x}
    if force or moment:
        why.append(f"the load at the tip bends the string ({quantity(force, 'N')}, {quantity(moment, 'N m')})")
    initial = scene.initial
    turned = scene.top_drive.kind != "none" and across(scene.top_drive.axis)
    if turned or across(initial.velocity) or across(initial.angular_velocity):
        why.append("the motion is not along and about the string's axis")
    if not why:
        return Finding("side loads", "lumped", "none: gravity, ends and motion are along the axis", numbers, source)
    needs = "planar" if not obstacle(scene, "planar") else "spatial"
    return Finding("side loads", needs, "; ".join(why), numbers, source, 1.0)


# -- buckling ---------------------------------------------------------------------------------------------
def tension(scene: Scene) -> tuple[F8, F8] | None:
    """Static tension (N, negative: compression) at the interfaces (m) of the straight string, linear between them.

    A drilling string carries its weight on bit; one held at both ends shares its weight by their stiffness; None for
    a string that is held nowhere.
    """
    ends, down = scene.ends, scene.gravity.magnitude * scene.gravity.direction[2]
    at = np.array(scene.interfaces)
    # in a hole that bends, what hangs is the depth gained
    gained = np.diff(at) if along(scene) is None else np.diff(scene.borehole.frame(at).position[:, 2])  # type: ignore[union-attr]
    weight = scene.gravity.direction[2] * np.array([scene.weight_per_length(s) for s in scene.string]) * gained
    below = np.append(weight[::-1].cumsum()[::-1], 0.0)  # weight of the string below each interface
    held = ends.top in ("clamped", "pinned", "hung", "driven")
    if scene.bites:
        lowest = down * ends.bottom_mass - scene.nominal().weight_on_bit
    elif ends.bottom == "clamped" and held:
        softness = np.array([s.length / s.section_stiffness().axial for s in scene.string])
        # the ends do not move apart: the stretch by tension sums up to nothing
        lowest = -float(softness @ (below[1:] + below[:-1]) / 2 / softness.sum())
    elif ends.bottom == "clamped":
        lowest = -float(below[0]) - down * ends.top_mass
    elif held:
        lowest = ends.tip_force[2] + down * ends.bottom_mass
    else:
        return None
    return at, lowest + below


def critical_weight(scene: Scene, bit_tilts: bool = False) -> float:
    """Compression (N) at the bottom at which the straight string buckles under it and its own weight.

    Lateral equilibrium (EI y'')'' = (N y')' with N = -W + weight below, on cubic Hermite elements a quarter of
    (EI/w)^(1/3) long, with the ends as the rungs hold them (a bit stays on the axis, upright; ``bit_tilts`` lets it
    tilt): W is the greatest for which the stiffness stays positive definite, found by bisection. A pinned string of
    eight lengths (EI/w)^(1/3) gives Lubinski's 1.94 w (EI/w)^(1/3). Infinite for a string that nothing bends.
    """
    from scipy.linalg import LinAlgError, cholesky_banded

    lengths, bending, load = [], [], []
    for section in scene.string:
        k = section.section_stiffness().bending1
        per_metre = scene.weight_per_length(section) * scene.gravity.direction[2]
        scale = (k / abs(per_metre)) ** (1 / 3) if per_metre else section.length
        n = max(16, min(4000, math.ceil(4 * section.length / scale)))
        lengths += [section.length / n] * n
        bending += [k] * n
        load += [per_metre] * n
    h, stiff, w = np.array(lengths), np.array(bending), np.array(load)
    below = (w * h)[::-1].cumsum()[::-1] - w * h  # weight below the lower end of each element
    n = len(h)
    elastic, by_weight, by_load = (np.zeros((n, 4, 4)) for _ in range(3))
    points, weights = np.polynomial.legendre.leggauss(3)
    for x, share in zip((points + 1) / 2, weights / 2, strict=True):
        # curvature and slope of the four cubic Hermite functions
        b = np.stack([(12 * x - 6) / h**2, (6 * x - 4) / h, (6 - 12 * x) / h**2, (6 * x - 2) / h], axis=1)
        s = 6 * (x * x - x)
        d = np.stack([s / h, np.full(n, 1 - 4 * x + 3 * x * x), -s / h, np.full(n, 3 * x * x - 2 * x)], axis=1)
        slopes = d[:, :, None] * d[:, None, :]
        elastic += share * (h * stiff)[:, None, None] * b[:, :, None] * b[:, None, :]
        by_weight += share * (h * (below + w * h * (1 - x)))[:, None, None] * slopes
        by_load += share * h[:, None, None] * slopes
    ends = scene.ends
    upright = {
        "clamped": (0, 1),
        "driven": (0, 1),
        "hung": (0, 1),
        "sliding": (0, 1),
        "bit": (0, 1),
        "pinned": (0,),
        "guided": (0,),
    }
    bottom = (0,) if ends.bottom == "bit" and bit_tilts else upright.get(ends.bottom, ())
    held = [*upright.get(ends.top, ()), *(2 * n + i for i in bottom)]
    free = np.setdiff1d(np.arange(2 * n + 2), held)

    def banded(elements: F8) -> F8:
        full = np.zeros((4, 2 * n + 2))  # lower form: row i is the i-th diagonal below the main one
        for i in range(4):
            for j in range(i + 1):
                np.add.at(full[i - j], 2 * np.arange(n) + j, elements[:, i, j])
        for dof in held:  # a held dof is kept with a stiffness of its own
            for i in range(1, 4):
                full[i, dof] = 0.0
                if dof >= i:
                    full[i, dof - i] = 0.0
            full[0, dof] = 0.0
        return full

    # balanced by the elastic diagonal, or the band would mix N/m with N m
    matrices = [banded(e) for e in (elastic, by_weight, by_load)]
    balance = np.ones(2 * n + 2)
    balance[free] = matrices[0][0, free] ** -0.5
    for m in matrices:
        for i in range(4):
            m[i, : 2 * n + 2 - i] *= balance[i:] * balance[: 2 * n + 2 - i]
    matrices[0][0, held] = 1.0

    def stable(weight: float) -> bool:
        try:
            cholesky_banded(matrices[0] + matrices[1] - weight * matrices[2], lower=True)
        except LinAlgError:
            return False
        return True

    euler = stiff.max() * (math.pi / h.sum()) ** 2
    top = max(float(euler), float(np.abs(below).max()), 1e-300)
    low, high = -top, top
    while stable(high):
        low, high = high, 4 * high
        if high > 1e6 * top:
            return math.inf
    while not stable(low):
        low *= 4
        if low < -1e6 * top:
            return -math.inf
    while high - low > 1e-6 * max(abs(high), abs(low)):
        middle = (low + high) / 2
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


def buckling_rule(scene: Scene) -> Finding:
    """Static compression at the bottom against the weight at which the string buckles (`critical_weight`)."""
    source = "heavy column, Lubinski 1.94 and helical 5.55 (EI w^2)^(1/3); solved for this string's sections and ends"
    pull = tension(scene)
    if pull is None or any(s.name == SPRING for s in scene.string):
        return Finding("buckling", "lumped", "does not apply: the string is not held, or is none", {}, source)
    if pull[1].min() >= 0:
        lowest = float(pull[1].min())
        return Finding("buckling", "lumped", "none: the string hangs in tension", {"tension": lowest}, source)
    weight, critical = -float(pull[1][-1]), critical_weight(scene)
    numbers = {"compression": weight, "critical": critical}
    neutral = scene.length - float(np.interp(0.0, pull[1][::-1], pull[0][::-1])) if pull[1][0] > 0 else scene.length
    numbers["compressed_length"] = neutral
    what = "weight on bit" if scene.bites else "compression at the bottom"
    text = f"{what} {quantity(weight, 'N')}, the string buckles at {quantity(critical, 'N')}"
    if scene.ends.bottom == "bit":
        numbers["critical_tilting"] = critical_weight(scene, bit_tilts=True)
        text += f" with the bit held upright as here ({quantity(numbers['critical_tilting'], 'N')} if it could tilt)"
    last, down = scene.string[-1], scene.gravity.magnitude * scene.gravity.direction[2]
    if down > 0:
        per_metre = scene.weight_per_length(last) * scene.gravity.direction[2]
        helical = numbers["helical"] = 5.55 * (last.section_stiffness().bending1 * per_metre**2) ** (1 / 3)
        if weight > helical:
            text += f"; above {quantity(helical, 'N')} it winds into a helix"
    if weight < critical:
        return Finding("buckling", "lumped", f"{text}: straight to {100 * weight / critical:.0f} %", numbers, source)
    # without a hole or a bit, a column leaves its line in a plane
    needs = "planar" if scene.hole.kind == "none" and not obstacle(scene, "planar") else "spatial"
    return Finding("buckling", needs, f"{text}: it does not stay straight", numbers, source, 1.0)


# -- wanted outputs ---------------------------------------------------------------------------------------
def output_rule(scene: Scene) -> Finding:
    """The lowest rung whose results hold what is wanted (`GIVES`)."""
    wanted, source = scene.output.wanted, "what the unknowns of each rung determine"
    if not wanted:
        if scene.drills:
            return Finding("wanted outputs", "lumped", "not given: motion and loads of the bit", {}, source)
        return Finding("wanted outputs", "axial-torsional", "not given: all motion", {}, source)
    givers = {name: giver(name) for name in wanted}
    if not scene.drills:  # nothing couples twist and stretch
        givers = {
            name: "torsional" if name in _TWIST else max(m, "axial-torsional", key=rank) for name, m in givers.items()
        }
    needs = max(givers.values(), key=rank)
    if needs == "planar" and obstacle(scene, "planar"):
        needs = "spatial"
    asking = [name for name, m in givers.items() if m == max(givers.values(), key=rank)]
    text = f"{', '.join(asking)}: given from {needs} on"
    if rank(needs) >= rank("planar") and not _bends(scene):
        text += "; nothing in the scene bends the string, so it is zero unless the string is disturbed"
    return Finding("wanted outputs", needs, text, {}, source, 1.0 if needs != "lumped" else None)


def _bends(scene: Scene) -> bool:
    bent = [rule(scene) for rule in (hole_rule, side_load_rule, buckling_rule)]
    return any(rank(f.needs) >= rank("planar") for f in bent)


# -- waves ------------------------------------------------------------------------------------------------
class Growing(NamedTuple):
    """A motion of the bit that grows out of steady drilling: frequency in Hz, growth in 1/s."""

    frequency: float
    growth: float

    def __str__(self) -> str:
        return f"{self.frequency:.3g} Hz ({self.growth:+.2g} 1/s)"


def growing_motions(scene: Scene, axial_waves: bool) -> list[Growing]:
    """Linear self-excitation of the bit up to `BAND` times the blade-passing frequency, fastest first.

    The collars move along the axis as a rigid mass, or (``axial_waves``) the whole string does in its waves; torsion
    is the lumped one in both. Motions that grow less than e-fold in the run, or by less than ``output.tolerance`` of
    the fastest, are left out: they do not decide what is seen. Roots of the loop of `drillfem.stability`.
    """
    # the loop belongs to a room on the right of this one: imported only where a drilling scene asks for it
    from drillfem.stability.loop import DrillingLoop, motions, pitch

    rigid = DrillingLoop.from_scene(replace(scene, model="lumped"))
    loop = rigid
    if axial_waves:
        loop = replace(rigid, axial=motions(replace(scene, model="axial-torsional"))[0])
    limit = 2 * math.pi * BAND / scene.blade_passage
    speed, weight = np.array([scene.top_drive.speed or 0.0]), np.array([scene.nominal().weight_on_bit])
    found = loop.roots(speed, pitch(scene, weight))
    roots = sorted((z for z in found.values[0] if z.real > 0 and 1e-3 < z.imag <= limit), key=lambda z: -z.real)
    least = 1 / (scene.time.end - scene.time.start)
    if roots:
        least = max(least, scene.output.tolerance * roots[0].real)
    return [Growing(float(z.imag) / (2 * math.pi), float(z.real)) for z in roots if z.real > least]


def distance(one: Iterable[Growing], other: Iterable[Growing]) -> float:
    """Greatest relative distance from a motion of one list to the nearest of the other, both ways; 1 if there is none.

    Relative to |s|: an error of 1 % is 1 % of the frequency, or as much per radian in growth.
    """
    lists = [[complex(g.growth, 2 * math.pi * g.frequency) for g in x] for x in (one, other)]
    worst = 0.0
    for mine, others in (lists, lists[::-1]):
        for z in mine:
            worst = max(worst, min((abs(z - y) / abs(z) for y in others), default=1.0))
    return min(worst, 1.0)


class Mode(NamedTuple):
    """A natural motion of the bit: frequency in Hz, damping ratio, compliance (1/kg or 1/(kg m2)) of the bit in it."""

    frequency: float
    damping: float
    compliance: float


def modes_of(waves: Waves, limit: float) -> list[Mode]:
    """Natural motions up to ``limit`` (Hz): the residues of the receptance at the bit, exact; damping c_d omega/2.

    Near a pole the receptance is ``compliance / (s^2 + omega^2)``.
    """
    still = replace(waves, retardation=tuple(0.0 for _ in waves.retardation))
    omega = still.frequencies(2 * math.pi * limit)
    h = 1e-6 * omega
    s = np.asarray(1j * omega, complex)
    slope = (still.parts(s + 1j * h)[1] - still.parts(s - 1j * h)[1]) / (2j * h)
    residue = (2 * s * still.parts(s)[0] / slope).real
    late = float(np.average(waves.retardation, weights=waves.length))
    return [Mode(float(w) / (2 * math.pi), late * float(w) / 2, float(c)) for w, c in zip(omega, residue, strict=True)]


def _drilling_waves(scene: Scene) -> bool:
    """Whether the scene has steady drilling to be perturbed: the rules about waves start from it."""
    speed = scene.top_drive.speed
    return scene.drills and bool(speed and speed > 0) and scene.nominal().depth_of_cut > 0


def axial_rule(scene: Scene) -> Finding:
    """Whether a rigid mass can stand for the axial waves of the string up to the passage of the blades.

    By what grows out of steady drilling in each (`growing_motions`): frequency and growth of the self-excitation.
    """
    source = "characteristic roots of the loop of string and rock; modal damping c_d omega/2 (spec 3.3, 9.7)"
    return _axial(_bare(scene), source)


@lru_cache(maxsize=256)
def _axial(scene: Scene, source: str) -> Finding:
    if any(s.name == SPRING for s in scene.string):
        return Finding("axial waves", "lumped", "none: the scene is given by numbers", {}, source, 0.0)
    if not _drilling_waves(scene):
        text = "there is no steady drilling to judge a rigid mass by"
        return Finding("axial waves", "axial-torsional", text, {}, source)
    from drillfem.stability.loop import motions

    rigid, whole = (growing_motions(scene, waves) for waves in (False, True))
    passing = 1 / scene.blade_passage
    axial: Any = motions(replace(scene, model="axial-torsional"))[0]
    own = modes_of(axial, BAND * passing)
    error = distance(rigid, whole)
    damping = max(s.retardation_time for s in scene.string) * math.pi * passing
    numbers = {"blade_passing": passing, "damping_at_blade_passing": damping, "axial_modes": float(len(own))}
    numbers |= {f"rigid_{i}_{k}": x for i, g in enumerate(rigid, 1) for k, x in g._asdict().items()}
    numbers |= {f"waves_{i}_{k}": x for i, g in enumerate(whole, 1) for k, x in g._asdict().items()}
    below = sum(m.frequency <= passing for m in own)
    lowest_mode = f", from {own[0].frequency:.3g} Hz up, damped by {100 * damping:.2g} % there" if below else ""
    text = (
        f"{below or 'no'} axial mode{'' if below == 1 else 's'} below the blades' {passing:.3g} Hz{lowest_mode}; "
        f"drilling excites itself at {_listed(whole)}, on a rigid mass at {_listed(rigid)}"
    )
    needs = "axial-torsional" if error > scene.output.tolerance else "lumped"
    return Finding("axial waves", needs, text, numbers, source, error)


def _listed(motions: list[Growing]) -> str:
    if not motions:
        return "no frequency"
    more = f" and {len(motions) - 3} more" if len(motions) > 3 else ""
    return ", ".join(map(str, motions[:3])) + more


def torsional_rule(scene: Scene) -> Finding:
    """Whether one inertia on one spring can stand for the torsional waves of the string.

    Where drilling excites itself, its torque falls with speed and feeds every torsional mode in proportion to the
    compliance that the bit has in it, less c_d omega^2/2 of damping. So the modes that the lumped model lacks are
    weighed by their compliance over that of the first; modes that are damped by more than the tolerance are dead.
    """
    source = "residues of the torsional receptance at the bit; spec 8.5, 3.3"
    return _torsional(_bare(scene), source)


@lru_cache(maxsize=256)
def _torsional(scene: Scene, source: str) -> Finding:
    if any(s.name == SPRING for s in scene.string):
        return Finding("torsional waves", "lumped", "none: the scene is given by numbers", {}, source, 0.0)
    if not scene.drills:
        return Finding("torsional waves", "torsional", "nothing is drilled: no lumped model", {}, source)
    if not _drilling_waves(scene):
        return Finding("torsional waves", "torsional", "there is no steady drilling to judge a spring by", {}, source)
    from drillfem.stability.loop import motions

    tolerance, passing = scene.output.tolerance, 1 / scene.blade_passage
    torsion: Any = motions(replace(scene, model="torsional"))[1]
    lump = lumps(scene)
    alone = math.sqrt(lump.stiffness / lump.inertia) / (2 * math.pi)
    found = modes_of(torsion, max(BAND * passing, 2 * alone))
    numbers = {"blade_passing": passing, "lumped_frequency": alone}
    if not found:
        text = f"no torsional mode below {BAND * passing:.3g} Hz, the lumped one at {alone:.3g} Hz"
        return Finding("torsional waves", "torsional", text, numbers, source, 1.0)
    first, *others = found
    shift = abs(alone / first.frequency - 1)
    numbers |= {"first_frequency": first.frequency, "modes": float(len(found))}
    text = f"{len(found)} torsional mode{'' if len(found) == 1 else 's'} up to {BAND * passing:.3g} Hz, "
    text += f"the first at {first.frequency:.3g} Hz (lumped: {alone:.3g} Hz)"
    error = shift
    excited = growing_motions(scene, True) or growing_motions(scene, False)
    alive = [(m, m.compliance / first.compliance) for m in others if m.damping < tolerance]
    if others and not excited:
        text += "; drilling does not excite itself, so nothing feeds the others"
    elif others and not alive:
        text += f"; all others are damped by more than {100 * tolerance:.3g} %"
    elif others:
        mode, share = max(alive, key=lambda item: item[1])
        numbers |= {"loudest_frequency": mode.frequency, "loudest_share": share, "loudest_damping": mode.damping}
        text += (
            f"; in mode {found.index(mode) + 1} at {mode.frequency:.3g} Hz the bit is {_percent(share)} as compliant "
            "as in the first"
        )
        error = max(error, min(share, 1.0))
    needs = "torsional" if error > tolerance else "lumped"
    return Finding("torsional waves", needs, text, numbers, source, error)


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share >= 0.1 else f"{100 * share:.2g} %"


def _bare(scene: Scene) -> Scene:
    """The scene without what the rules about waves do not look at, so that their answers are kept and shared."""
    end = scene.time.end - scene.time.start
    return replace(
        scene,
        title="",
        name="",
        model="auto",
        contact=None,
        material=None,
        initial=Initial(),
        mesh=Mesh(),
        time=Time(end=end, step=end),
        output=Output(interval=end, fields_interval=end, tolerance=scene.output.tolerance),
    )


# -- the choice -------------------------------------------------------------------------------------------
def findings(scene: Scene) -> tuple[Finding, ...]:
    """What all rules say about a scene. Those about waves are left out where the string does not stay straight."""
    found = [rule(scene) for rule in (hole_rule, side_load_rule, buckling_rule, output_rule)]
    if all(rank(f.needs) < rank("planar") for f in found[:3]) and not obstacle(scene, "torsional"):
        found += [axial_rule(scene), torsional_rule(scene)] if scene.drills else []
    return tuple(found)


def choose(scene: Scene) -> ModelChoice:
    """The model to run, and why: the one asked for, or for "auto" the lowest rung that every rule allows."""
    if scene.model != "auto":
        return ModelChoice(scene.model, "asked for by the scene")
    return lowest(scene)


@lru_cache(maxsize=256)
def lowest(scene: Scene) -> ModelChoice:
    """The lowest rung that represents the scene and gives what is wanted, whatever `model` says."""
    why = {m: obstacle(scene, m) for m in MODELS}
    free = [m for m in MODELS if not why[m]]
    if any(s.name == SPRING for s in scene.string):
        return ModelChoice(free[0] if free else "lumped", why["axial-torsional"])
    bent = _straight_obstacle(scene)
    if bent and "planar" in free:
        return ModelChoice("planar", f"{bent}, and all stays in the plane x-z")
    if bent:
        return ModelChoice("spatial", f"{bent}, and {why['planar']}" if why["planar"] else bent)
    found = findings(scene)
    needs = max((f.needs for f in found), key=rank)
    name = next((m for m in free if rank(m) >= rank(needs)), "spatial")
    decisive = [f for f in found if rank(f.needs) == rank(needs)] if needs != "lumped" else list(found[-2:])
    if rank(needs) >= rank("planar"):
        return ModelChoice(name, "; ".join(f"{f.rule}: {f.text}" for f in decisive))
    said = [f"{f.rule}: {f.text}" for f in decisive if f.rule in ("axial waves", "torsional waves", "wanted outputs")]
    if not scene.drills:
        said = [f"{f.rule}: {f.text}" for f in decisive if scene.output.wanted]
    return ModelChoice(name, "; ".join(["the string is straight and nothing bends it", *said]))


def _straight_obstacle(scene: Scene) -> str:
    """Why no straight rung can have the scene, whatever is wanted of it."""
    return obstacle(replace(scene, output=replace(scene.output, wanted=None)), "axial-torsional")
