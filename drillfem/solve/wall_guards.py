"""What is known to fail where a string lies in a hole, computed before a run: `drillfem.solve.guards`, by the wall.

All of it is read off the soft string: where it lies, what presses it on the wall, how it is pushed. Milliseconds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from ..boreholes.borehole import BEYOND
from ..meshes.points import distribute
from ..models.soft_string import Line, line_of
from ..scene import Scene, Section
from .integrators import Method, method_of

Array = npt.NDArray[np.float64]

#: Penetration over clearance above which a wall is soft.
SUNK = 0.1
#: Energy after a bounce over that before it, in its worst phase, above which a wall chatters.
CHATTER = 1.6
#: Length of elements over that of the contact's boundary layer above which a mesh does not see it.
NARROW = 3.0
#: Distance of nodes over the length of a buckling wave above which a mesh does not see it; share of the buckling load.
WAVE, NEARLY = 1 / 8, 0.9
#: Sliding speed at half of the static friction, over that of the turning string, above which it never sticks.
CREEP = 0.05
#: Turn per step (rad) of a string that rolls along the wall: for methods that damp, and for the trapezoidal rule.
ROLL, ROLL_UNDAMPED = 0.75, 0.25
#: What a friction that takes the bounce for sliding may lose.
WEAKENED = 0.05
#: Distance between a hole and the polynomials that follow it, over the clearance, that is too much.
OFF = 0.5
#: Turns per step of the contact (rad) at which bounces are tried.
_TURNS = np.geomspace(0.4, 60, 64)
#: Distance of the places that are looked at, m.
_SPACING = 5.0


@dataclass(frozen=True)
class Places:
    """Places of a string in its hole, at the start of a run and at its end: arrays (n,), SI units.

    ``depth``: measured depth; ``section``: number of the section; ``side``: force per length on the wall;
    ``clearance``; ``bending`` EI; ``mass`` per length.
    """

    depth: Array
    section: npt.NDArray[np.int64]
    side: Array
    clearance: Array
    bending: Array
    mass: Array


def in_hole(scene: Scene) -> bool:
    """Whether a rod of the scene may touch a wall."""
    return scene.contact is not None and scene.resolved_model().name in ("planar", "spatial")


def advance(scene: Scene) -> float:
    """How far the string goes down its hole in the run (m; negative: up)."""
    time = scene.time
    if time.analysis != "dynamic":
        return 0.0
    block = scene.top_drive.block_speed
    return (time.end - time.start) * (scene.nominal().rate_of_penetration if block is None else block)


def lines(scene: Scene) -> list[Line]:
    """The string along its hole at the start of a run and, where it goes down, at the end."""
    line, way = line_of(scene), advance(scene)
    if way < 0.01:
        return [line]
    return [line, line.to_depth(min(line.length + way, max(line.length, line.hole.length)))]


def pushed(scene: Scene, line: Line) -> float:
    """Force (N) up the hole on the lower end of the string: weight on bit, and a tip force that pushes."""
    weight = scene.nominal().weight_on_bit if scene.bites else 0.0
    tangent = line.hole.frame(line.length).tangent[0]
    return weight - float(tangent @ np.array(scene.ends.tip_force))


def places(scene: Scene) -> Places:
    """The string in its hole. Tension is that of a string which turns: friction takes nothing off it."""
    mass = np.array([s.mass_per_length for s in scene.string])
    found = []
    for line in lines(scene):
        grid = np.linspace(0.0, line.length, max(2, math.ceil(line.length / _SPACING) + 1))
        s = np.concatenate([grid, line.breaks - 1e-6, line.breaks + 1e-6])
        s = np.unique(np.clip(s, 0.0, line.length))
        here, tension, section = line.at(s), line.hanging(s) - pushed(scene, line), line.piece(s)
        side = np.linalg.norm(here.across + tension[:, None] * here.curvature, axis=1)
        found.append((s, section, side, here.clearance, here.bending, mass[section]))
    return Places(*(np.concatenate(columns) for columns in zip(*found, strict=True)))


def element_lengths(scene: Scene) -> Array:
    """Mean length of the elements of every section (sections,), m."""
    lengths = [s.length for s in scene.string]
    return np.array(lengths) / distribute(lengths, scene.mesh.elements)


def elements_of(scene: Scene, longest: float) -> int:
    """How many elements of at most this length (m) the string takes, to two figures."""
    count = scene.length / longest
    digits = 10 ** max(0, math.floor(math.log10(count)) - 1)
    return math.ceil(count / digits) * digits


def _depth(p: float) -> str:
    """A measured depth (m) for a sentence."""
    return f"{round(p, 1):g}"


# -- the wall ---------------------------------------------------------------------------------------------------------


def soft_wall(scene: Scene) -> Iterator[str]:
    """A penalty so soft that the string sinks into the wall by a good part of its clearance."""
    contact = scene.contact
    if contact is None or not in_hole(scene) or contact.method == "augmented":
        return
    at = places(scene)
    share = at.side / (contact.stiffness * at.clearance)
    i = int(share.argmax())
    if share[i] > SUNK:
        wanted = contact.stiffness * share[i] / SUNK
        yield (
            f"contact.stiffness = {contact.stiffness:g} N/m2 is soft: {at.side[i]:.4g} N/m of side load at a measured "
            f"depth of {_depth(at.depth[i])} m sink the string {1e3 * at.side[i] / contact.stiffness:.3g} mm into the "
            f"wall behind a clearance of {1e3 * at.clearance[i]:.3g} mm; take at least {wanted:.2g} N/m2, or "
            "contact.method = 'augmented'"
        )


@cache
def _worst(method: Method, turn: float) -> float:
    return float(method.bounce(turn).max())


def worst_bounce(method: Method, turn: float) -> float:
    """Worst energy after a bounce over that before, of walls up to this stiff: sqrt(k/m) h = ``turn``, rad per step."""
    softer = _TURNS[_TURNS < turn]
    return max(_worst(method, float(x)) for x in (*softer, turn))


def chattering_wall(scene: Scene) -> Iterator[str]:
    """A penalty so stiff that the steps do not resolve a bounce: the wall then feeds energy."""
    contact, method, h = scene.contact, method_of(scene), scene.time.step
    if contact is None or not in_hole(scene) or contact.method == "augmented":
        return
    if method is None or method.kind not in ("theta", "generalized-alpha"):
        return
    mass = min(s.mass_per_length for s in scene.string)
    turn = math.sqrt(contact.stiffness / mass) * h
    if turn < _TURNS[0] or (gain := worst_bounce(method, turn)) <= CHATTER:
        return
    low, high = float(_TURNS[0]), turn
    while high - low > 1e-2 * low:
        middle = (low + high) / 2
        low, high = (middle, high) if worst_bounce(method, middle) <= CHATTER else (low, middle)
    period = 2 * math.pi * h / turn
    yield (
        f"contact.stiffness = {contact.stiffness:g} N/m2 chatters: with {period / h:.3g} steps of {h:g} s in the "
        f"{1e3 * period:.3g} ms of two bounces, {method} can give a string that meets the wall {gain:.2g} times its "
        f"energy back; take time.step = {_rounded_down(h * low / turn):g} s, a softer wall, 'generalized-alpha' "
        "with rho_infinity = 0, or contact.method = 'augmented'"
    )


def _rounded_down(x: float) -> float:
    """The first two figures."""
    unit = 10 ** (math.floor(math.log10(x)) - 1)
    return float(f"{math.floor(x / unit * (1 + 1e-9)) * unit:.2g}")


def _rounded_up(x: float) -> float:
    """The first figure."""
    unit = 10 ** math.floor(math.log10(x))
    return float(f"{math.ceil(x / unit * (1 - 1e-9)) * unit:.1g}")


def boundary_layer(bending: Array | float, stiffness: float) -> Array:
    """Length (m) over which a string's bending dies away along a wall, (4 EI/k_s)^(1/4)."""
    return np.asarray((4 * np.asarray(bending) / stiffness) ** 0.25)


def kinks(line: Line) -> tuple[Array, Array]:
    """Measured depths (n,) in m within the string where the hole's curvature jumps, and by how much (n,), 1/m."""
    at = line.hole.table.knots[1:-1]
    at = at[at <= line.length]
    jump = np.linalg.norm(line.hole.frame(at + 1e-7).curvature - line.hole.frame(at - 1e-7).curvature, axis=1)
    return at[jump > 1e-6], jump[jump > 1e-6]


def unseen_kinks(scene: Scene) -> Iterator[str]:
    """Elements longer than the boundary layer in which contact takes up a jump of the hole's curvature."""
    contact = scene.contact
    if contact is None or not in_hole(scene):
        return
    long = element_lengths(scene)
    worst, found = (0.0, 0.0, 0.0, 0.0), set[float]()
    for line in lines(scene):
        at, jump = kinks(line)
        if not len(at):
            continue
        here, size = line.at(at), long[line.piece(at)]
        layer = boundary_layer(here.bending, contact.stiffness)
        # of a string that the wall holds on both sides: k u = k jump layer^2/4 exp(-x) sin(x)
        peak = 0.3224 * here.bending * jump / layer**2
        for i in np.flatnonzero((size > NARROW * layer) & (peak > 0.1 * line.side_load(at))):
            found.add(round(float(at[i]), 1))
            worst = max(worst, (float(size[i] / layer[i]), float(size[i]), float(layer[i]), float(peak[i])))
    if found:
        _, length, width, force = worst
        where = " and ".join(f"{p:.5g} m" for p in sorted(found)[:3]) + (" ..." if len(found) > 3 else "")
        yield (
            f"mesh.elements = {scene.mesh.elements} are {length:.3g} m long, and contact takes up a kink of the hole "
            f"(measured depth {where}) over (4 EI/k_s)^(1/4) = {width:.2g} m with up to {force:.3g} N/m: side force "
            "and penetration there are those of the mesh, sums over tens of metres are right; take elements of "
            f"{NARROW * width:.2g} m, or a hole.transition"
        )


def unseen_bend(scene: Scene) -> Iterator[str]:
    """Elements that cannot follow the hole: their polynomials leave a bend by a good part of the clearance."""
    contact, degree = scene.contact, scene.mesh.degree
    if contact is None or not in_hole(scene) or not scene.hole.bends:
        return
    nodes = {1: (0, 1), 2: (0, 0.5, 1), 3: (0, (5 - 5**0.5) / 10, (5 + 5**0.5) / 10, 1)}.get(
        degree, (0, 0.5 - 21**0.5 / 14, 0.5, 0.5 + 21**0.5 / 14, 1)
    )
    x = np.linspace(0, 1, 201)
    reach = np.abs(np.prod(x[:, None] - np.array(nodes), axis=1)).max() / math.factorial(degree + 1)
    worst, text = OFF, ""
    for line in lines(scene):
        s = np.clip(np.concatenate([line.breaks - 1e-6, line.breaks + 1e-6]), 0, line.length)
        here, size = line.at(s), element_lengths(scene)[line.piece(s)]
        bend = np.linalg.norm(here.curvature, axis=1)
        away = reach * size * (size * bend) ** degree
        i = int((away / here.clearance).argmax())
        if away[i] / here.clearance[i] > worst:
            worst = away[i] / here.clearance[i]
            text = (
                f"mesh.elements = {scene.mesh.elements} of degree {degree} cannot follow the hole: it turns by "
                f"{math.degrees(size[i] * bend[i]):.3g} deg in the {size[i]:.3g} m of one at a measured depth of "
                f"{_depth(s[i])} m, which is then {1e3 * away[i]:.3g} mm off, of a clearance of "
                f"{1e3 * here.clearance[i]:.3g} mm; take degree 3, or more elements"
            )
    if text:
        yield text


def unseen_buckling(scene: Scene) -> Iterator[str]:
    """A string pushed to its buckling load, on nodes too far apart for the waves in which it buckles."""
    if scene.contact is None or not in_hole(scene):
        return
    from ..torque_drag.limits import limits

    spacing, worst, text = element_lengths(scene) / scene.mesh.degree, 1.0, ""
    for line in lines(scene):
        s: Array = np.linspace(0.0, line.length, 101, dtype=np.float64)
        push = pushed(scene, line) - line.hanging(s)
        s, push = s[push > 0], push[push > 0]
        if not len(s):
            continue
        limit = limits(line, s).sinusoidal
        near = push > NEARLY * limit
        if not near.any():
            continue
        s, push, limit = s[near], push[near], limit[near]
        wave = 2 * math.pi * np.sqrt(2 * line.at(s).bending / np.maximum(push, limit))
        coarse = spacing[line.piece(s)] / (WAVE * wave)
        i = int(coarse.argmax())
        if coarse[i] > worst:
            worst = float(coarse[i])
            longest = WAVE * wave[i] * scene.mesh.degree
            text = (
                f"mesh.elements = {scene.mesh.elements} cannot see the string buckle: at a measured depth of "
                f"{_depth(s[i])} m it is pushed with {push[i] / 1e3:.4g} kN, {push[i] / limit[i]:.3g} times the load "
                f"at which it goes into waves of {wave[i]:.3g} m; take elements of at most {longest:.2g} m there "
                f"({elements_of(scene, longest)} if all are equal)"
            )
    if text:
        yield text


def fed_turns(section: Section, length: float, degree: int, torque: float) -> tuple[float, float]:
    """Rate (1/s) at which a torque (N m) feeds turns of sections that reduced integration leaves to themselves, and
    their angular frequency (rad/s).

    Where an element (of this length, m) of degree p is integrated with p points, rotations by its Legendre polynomial
    P_p are invisible to shear: they vibrate with omega^2 = 2 p (p + 1)(2 p + 1) E/(rho h^2), and where torque varies
    along the string the interpolated virtual rotations feed them. The rate is that of a free end with a dead torque,
    fitted within a factor of two to eigenvalues of drill pipe on elements of 6 to 50 m
    """
    bending, inertia = section.section_stiffness().bending1, section.rotary_inertia
    omega = math.sqrt(2 * degree * (degree + 1) * (2 * degree + 1) * bending / inertia) / length
    slender = length / math.sqrt(inertia / section.mass_per_length)
    coupling = min((slender / 380) ** 2.9, slender / 190) * (4 - min(degree, 3)) ** 1.5
    return torque * length / bending * omega * coupling, omega


def varying_torque(scene: Scene) -> float:
    """Torque (N m) that a string hands on to what holds it along its way: half of its friction, and a bit that can
    tilt."""
    line = lines(scene)[-1]
    s: Array = np.linspace(0.0, line.length, 401, dtype=np.float64)
    here = line.at(s)
    friction = here.static * here.radius * line.side_load(s)
    tilts = scene.bites and scene.hole.bends
    return 0.5 * float((friction[1:] + friction[:-1]) / 2 @ np.diff(s)) + (
        scene.nominal().torque_on_bit if tilts else 0.0
    )


def torque_on_reduced_elements(scene: Scene) -> Iterator[str]:
    """Reduced integration of an undamped string that carries torque: vibrations of its sections grow."""
    method, h = method_of(scene), scene.time.step
    if method is None or not in_hole(scene) or scene.resolved_model().name != "spatial":
        return
    if scene.mesh.quadrature != "reduced" or not (scene.top_drive.speed or scene.bites):
        return
    torque, worst, text = varying_torque(scene), 1.0, ""
    for section, length in zip(scene.string, element_lengths(scene), strict=True):
        rate, omega = fed_turns(section, float(length), scene.mesh.degree, torque)
        fed = rate - section.retardation_time * omega**2 / 2
        growth = math.log(float(method.amplification(complex(fed, omega) * h))) / h
        if fed > 0 and growth > worst:
            worst = growth
            cure = "quadrature = 'full'" + (" and degree = 2 or more" if scene.mesh.degree == 1 else "")
            text = (
                f"mesh.quadrature = 'reduced' lets the sections of {section.name!r} turn by themselves: with "
                f"{omega / (2 * math.pi):.3g} Hz on elements of {length:.3g} m, fed by {torque / 1e3:.2g} kN m of "
                f"torque with about {rate:.2g} 1/s, which grows by {growth:.2g} 1/s at time.step = {h:g} s; take "
                f"mesh.{cure}, or a retardation_time of {_rounded_up(4 * rate / omega**2):g} s"
            )
    if text:
        yield text


# -- friction ---------------------------------------------------------------------------------------------------------


def friction_law(scene: Scene, x: Array | float) -> Array:
    """k_fr (4-7) of a scene's contact at n times a speed (any shape); the hole's own coefficients are left out."""
    assert scene.contact is not None
    k, x = scene.contact, np.asarray(x, np.float64)
    alpha = math.sqrt(k.friction_static * (k.friction_static - k.friction_dynamic))
    rounded = k.friction_dynamic * np.sqrt(x**2 + k.friction_regularisation) + 2 * alpha
    return np.asarray(rounded * x / (x**2 + 1))


def creep(scene: Scene, share: float = 0.5) -> float:
    """Speed (m/s) at which a string slides that is pulled with this share of the static friction."""
    assert scene.contact is not None
    x: Array = np.geomspace(1e-4, 10.0, 4000, dtype=np.float64)
    above = friction_law(scene, x) >= share * scene.contact.friction_static
    return float(x[int(above.argmax())]) / scene.contact.friction_velocity_scale


def sliding_speed(scene: Scene) -> float:
    """Speed (m/s) of the surface of a string that turns with its drive, and moves with its block."""
    drive = scene.top_drive
    radius = max(s.contact_radius for s in scene.string)
    return math.hypot(radius * (drive.speed or 0.0), drive.block_speed or 0.0)


def creeping_friction(scene: Scene) -> Iterator[str]:
    """Friction rounded off over so wide a range of speeds that nothing ever sticks."""
    contact, law = scene.contact, scene.soft_string
    if contact is None or not contact.friction_static or scene.time.analysis != "dynamic":
        return
    model = scene.resolved_model().name
    by_spin = law.friction_argument == "spin"
    if model != "soft-string" and not in_hole(scene):
        return
    if model == "soft-string" and (law.law != "stribeck" or by_spin):
        return
    slow, fast = creep(scene), sliding_speed(scene)
    if fast > 0 and slow > CREEP * fast:
        wanted = contact.friction_velocity_scale * slow / (CREEP * fast)
        yield (
            f"contact.friction_velocity_scale = {contact.friction_velocity_scale:g} s/m never sticks: held with half "
            f"of its static friction a string slides on at {slow:.3g} m/s, {100 * slow / fast:.2g} % of the "
            f"{fast:.3g} m/s at which it turns; take at least {wanted:.2g} s/m to see it stick and slip"
        )


def friction_by_spin(scene: Scene) -> Iterator[str]:
    """Soft string: the spin in the place of the speed of the touching point (errata 20)."""
    law, contact = scene.soft_string, scene.contact
    spin = abs(scene.top_drive.speed or 0.0)
    if contact is None or scene.resolved_model().name != "soft-string" or law.law != "stribeck" or not spin:
        return
    if law.friction_argument == "spin" and contact.friction_static > contact.friction_dynamic:
        n, radius = contact.friction_velocity_scale, max(s.contact_radius for s in scene.string)
        wrong, right = (float(friction_law(scene, n * v)) for v in (spin, radius * spin))
        yield (
            f"soft_string.friction_argument = 'spin' puts {spin:.4g} rad/s where the law wants the {radius * spin:.3g} "
            f"m/s of the touching point: friction {wrong:.3f} instead of {right:.3f} at the speed of the top; take "
            "'contact-speed'"
        )


def friction_of_bounces(scene: Scene) -> Iterator[str]:
    """Friction that takes the speed towards the wall for sliding (errata 21)."""
    contact = scene.contact
    if contact is None or not in_hole(scene) or not contact.friction_static:
        return
    if contact.projected and scene.reading != "literal":
        return
    fast, room = sliding_speed(scene), float(places(scene).clearance.max())
    bounce = math.sqrt(2 * scene.gravity.magnitude * room)
    if fast > 0 and (left := fast / math.hypot(fast, bounce)) < 1 - WEAKENED:
        key = "reading = 'literal'" if scene.reading == "literal" else "contact.projected = false"
        yield (
            f"{key} rubs against bounces too: a string that meets the wall with {bounce:.3g} m/s (a fall through its "
            f"clearance of {1e3 * room:.3g} mm) while it slides with {fast:.3g} m/s keeps {left:.2f} of its friction, "
            "and loses the bounce; take the friction along the wall only"
        )


def rolling(scene: Scene) -> Iterator[str]:
    """Steps too long for a string that rolls backwards along the wall, as friction makes it do."""
    contact, method, h = scene.contact, method_of(scene), scene.time.step
    spin = abs(scene.top_drive.speed or 0.0)
    if contact is None or not in_hole(scene) or not contact.friction_dynamic or method is None or not spin:
        return
    at = places(scene)
    radius = np.array([s.contact_radius for s in scene.string])[at.section]
    # where the wall carries the centrifugal force: k (R - c) = m (spin r)^2/R
    sunk = 0.0 if contact.method == "augmented" else at.mass * (spin * radius) ** 2 / contact.stiffness
    circle = at.clearance / 2 + np.sqrt((at.clearance / 2) ** 2 + sunk)
    rate = spin * radius / circle
    i = int(rate.argmax())
    undamped = method.kind == "theta" and method.theta == 0.5
    turn, most = float(rate[i]) * h, ROLL_UNDAMPED if undamped else ROLL
    if turn > most:
        what = "its speed rings" if undamped else f"its circle comes out {100 * turn**2 / 8:.2g} % too wide"
        yield (
            f"time.step = {h:g} s is long for a string that rolls along the wall: at {spin:.3g} rad/s in a clearance "
            f"of {1e3 * at.clearance[i]:.3g} mm (measured depth {_depth(at.depth[i])} m) it goes round with "
            f"{rate[i]:.3g} rad/s, {turn:.2g} rad per step, and {what}; take at most "
            f"{_rounded_down(h * most / turn):g} s"
        )


# -- the hole, and the thesis as printed ------------------------------------------------------------------------------


def leaving_hole(scene: Scene) -> Iterator[str]:
    """A run that takes the string out of the hole that is known."""
    if scene.contact is None or not in_hole(scene) or scene.borehole is None:
        return
    way, hole, end = advance(scene), scene.borehole, scene.time.end - scene.time.start
    if way < -BEYOND:
        yield (
            f"top_drive.block_speed = {scene.top_drive.block_speed:g} m/s pulls the string {-way:.4g} m out of the top "
            f"of the hole, where it is guided for {BEYOND:g} m: the run ends at t = "
            f"{scene.time.start + end * BEYOND / -way:.4g} s"
        )
    beyond = scene.length + way - hole.length
    if way > 0 and beyond > BEYOND and not hole.open_ended:
        yield (
            f"time.end = {scene.time.end:g} s takes the string {beyond:.4g} m beyond the end of the hole at a measured "
            f"depth of {hole.length:.6g} m, which is known to go on for {BEYOND:g} m: the run ends at about t = "
            f"{scene.time.start + end * (way - beyond + BEYOND) / way:.4g} s"
        )


def literal_rod(scene: Scene) -> Iterator[str]:
    """The printed constitutive law and spin (errata 14, 2) where the string leaves the vertical."""
    if scene.reading != "literal" or not in_hole(scene) or scene.resolved_model().name != "spatial":
        return
    if not scene.hole.bends:
        return
    line = lines(scene)[-1]
    s: Array = np.linspace(0, line.length, 201, dtype=np.float64)
    lean = line.hole.frame(s).inclination
    worst = float(lean[np.abs(np.sin(lean)).argmax()])
    k = scene.string[0].section_stiffness()
    c, d = math.cos(worst) ** 2, math.sin(worst) ** 2
    if d < 1e-4:
        return
    yield (
        "reading = 'literal' leaves the stiffness unrotated and takes the material spin for the spatial one: where "
        f"the hole leans by {math.degrees(worst):.3g} deg the string stretches {c + d * k.axial / k.shear1:.3g} times "
        f"as much as it should and twists {c + d * k.torsion / k.bending1:.3g} times as much, the wall feels "
        f"{math.sqrt(c):.3g} of its speed, and turning feeds it energy; take reading = 'recommended'"
    )


GUARDS: tuple[Callable[[Scene], Iterator[str]], ...] = (
    soft_wall,
    chattering_wall,
    unseen_kinks,
    unseen_bend,
    unseen_buckling,
    torque_on_reduced_elements,
    creeping_friction,
    friction_by_spin,
    friction_of_bounces,
    rolling,
    leaving_hole,
    literal_rod,
)
