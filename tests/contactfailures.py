"""Where contact methods fail: small experiments that tests/stability checks and benchmarks/failure_atlas.py draws."""

from __future__ import annotations

import math
from typing import Any
from unittest.mock import patch

import numpy as np
from holelab import EA, EI, GJ, HORIZONTAL, MASS, STEEL, VERTICAL, WEIGHT, in_hole, period, stepping
from rodlab import Array, put

import drillfem.models.rod
from drillfem.errors import SimulationError
from drillfem.models.modes import linearise
from drillfem.models.rod import Rod
from drillfem.scene import Scene
from drillfem.solve.direct import DirectRun
from drillfem.solve.dynamics import march
from drillfem.solve.laid import along_hole, lay


def centred(rod: Rod) -> Array:
    """Unknowns (dofs,) of a string at rest on the centreline of its hole."""
    names = ("r1", "r2", "r3", "q_a", "q_b", "q_c", "q_d")
    found = along_hole(rod).reshape(len(rod.nodes), -1)[rod.nodes, : len(names)]
    return put(rod, np.zeros(rod.size), **dict(zip(names, found.T, strict=True)))


def node(rod: Rod, u: Array, *names: str, at: int = -1) -> list[float]:
    """Named components at a node (0: top, -1: bottom)."""
    return [float(u[rod.dof(at, name)]) for name in names]


# -- too soft ---------------------------------------------------------------------------------------------------------
def lying(stiffness: float, length: float = 40.0) -> tuple[Array, Array, Scene]:
    """Arc length (n,) and penetration (n,; m) of a pipe that lies in a horizontal hole, its top held on the axis."""
    scene = in_hole(HORIZONTAL, length, 8, contact={"stiffness": stiffness})
    rod = Rod(scene)
    u = lay(rod)
    rod.set_state(u, 0 * u)
    assert rod.wall is not None
    order = np.argsort(rod.wall.arc_length)
    return rod.wall.arc_length[order], -rod.wall.gaps(u)[order], scene


# -- too stiff --------------------------------------------------------------------------------------------------------
def dropped(steps: float, integrator: str, rho: float = 0.9, end: float = 0.3, **contact: Any) -> tuple[Array, Array]:
    """A pipe falls through its clearance and bounces: time (n,) and its energy over that at the start (n,).

    steps: in a period of the contact. The energy is counted from where the pipe touches the wall.
    """
    law = {"stiffness": 1e6} | contact
    time = stepping(end, period(law["stiffness"]) / steps, integrator, rho)
    rod = Rod(in_hole(HORIZONTAL, 2.0, 1, 0.01, contact=law, time=time, ends={"top": "free"}))
    rows: list[tuple[float, float]] = []

    def observe(t: float, u: Array) -> None:
        # every section does the same: energy per length
        v, depth = node(rod, u, "v3", "r3")
        sunk = max(0.0, depth - 0.01)
        rows.append((t, MASS * v * v / 2 + WEIGHT * (0.01 - depth) + law["stiffness"] * sunk**2 / 2))

    march(rod, centred(rod), end, observe=observe)
    t, energy = np.array(rows).T
    return t, energy / energy[0]


def bounced(turn: float, phase: float, integrator: str, rho: float = 0.9) -> float:
    """Energy of a weightless pipe after it has met the wall over that before (1).

    turn: sqrt(k/rho A) h, rad per step; phase: where in a step the wall is met.
    """
    stiffness, clearance, speed = 1e6, 0.05, 0.1
    step = turn / math.sqrt(stiffness / MASS)
    steps = math.ceil(2 * math.pi / turn) + 40
    scene = in_hole(
        HORIZONTAL,
        2.0,
        1,
        clearance,
        contact={"stiffness": stiffness},
        time=stepping(steps * step, step, integrator, rho),
        ends={"top": "free"},
        gravity={"magnitude": 0},
    )
    rod = Rod(scene)
    # three steps away: what starts an integrator is over when the wall is met
    u = march(rod, put(rod, centred(rod), r3=clearance - (3 + phase) * speed * step, v3=speed), scene.time.end)
    return (node(rod, u, "v3")[0] / speed) ** 2


def turning(
    stiffness: float, step: float, integrator: str, rho: float = 0.9, end: float = 2.0, **keys: Any
) -> tuple[Array, str, Scene]:
    """Rows (t, kinetic energy J, top torque N m, side force N, energy error) of a pipe driven round in a bend.

    The second answer is why the run broke down, if it did. keys: of :func:`in_hole`.
    """
    hole = keys.pop("hole", {"kind": "arc", "radius": 100.0})
    contact = {"stiffness": stiffness, "friction_velocity_scale": 20} | keys.pop("contact", {})
    length = keys.pop("length", 40.0)
    scene = in_hole(
        hole,
        length,
        keys.pop("elements", 4),
        friction=(0.3, 0.15),
        contact=contact,
        time=stepping(end, step, integrator, rho),
        ends={"top": "driven"},
        top_drive={"kind": "imposed-speed", "speed": 100 * math.pi / 30, "rise_time": 0.5},
        **keys,
    )
    run = DirectRun(Rod(scene))
    rows, why, t = [], "", 0.0
    try:
        while t < end * (1 - 1e-9):
            t = run.step(end)
            row = run.row(t)
            error = run.summary()["energy_balance_error"]
            rows.append((t, row["kinetic_energy"], row["top_torque"], row["side_force"], error))
    except SimulationError as reason:
        why = str(reason)
    run.destroy()
    return np.array(rows), why, scene


# -- too coarse -------------------------------------------------------------------------------------------------------
def kink(elements: int, stiffness: float = 1e6) -> tuple[Array, Array, float, Scene]:
    """Arc length (n,), side force (n,; N/m) and their sum (N) on 80 m of pipe, half of it in a bend of 150 m radius."""
    hole = {"kind": "build", "kick_off": 40.0, "radius": 150.0, "final_inclination": math.radians(60)}
    scene = in_hole(hole, 80.0, elements, contact={"stiffness": stiffness})
    rod = Rod(scene)
    u = lay(rod)
    rod.set_state(u, 0 * u)
    assert rod.wall is not None and scene.contact is not None
    order = np.argsort(rod.wall.arc_length)
    force = rod.wall.side_force(u, scene.contact)[order]
    return rod.wall.arc_length[order], force, float(force @ rod.wall.weights[order]), scene


def peak(s: Array, force: Array, centre: float = 40.0, around: float = 8.0) -> float:
    """Largest side force (N/m) near the kink, by a parabola through the three largest values in a row."""
    near = np.flatnonzero(np.abs(s - centre) < around)
    i = int(near[force[near].argmax()])
    a, b, c = np.polyfit(s[i - 1 : i + 2] - s[i], force[i - 1 : i + 2], 2)
    return float(c - b * b / (4 * a)) if a < 0 else float(force[i])


def laid_in_arc(elements: int, degree: int) -> tuple[float, Scene]:
    """Sum of the side force (N) on 100 m of pipe laid in an arc of 573 m radius."""
    bend, mesh = {"kind": "arc", "radius": 573.0}, {"elements": elements, "degree": degree}
    scene = in_hole(bend, 100.0, elements, contact={"stiffness": 1e5}, mesh=mesh)
    rod = Rod(scene)
    u = lay(rod)
    rod.set_state(u, 0 * u)
    assert rod.wall is not None and scene.contact is not None
    return float(rod.wall.side_force(u, scene.contact) @ rod.wall.weights), scene


def buckling_growth(per_wave: float, degree: int = 3, over: float = 1.3, waves: int = 3) -> tuple[float, float, Scene]:
    """Growth (1/s) of the buckling wave of a pipe that lies in its hole and is pushed, and what it is in truth.

    per_wave: elements per wave; over: push over the load F_c = 2 sqrt(EI w/r). In truth rho A sigma^2 = F k^2 - EI k^4
    - w/r: a wave of small amplitude on a wall of radius r.
    """
    stiffness, end, amplitude = 1e7, 0.25, 1e-6
    r = 0.01 + WEIGHT / stiffness  # the pipe's axis lies that far off the hole's
    push = over * 2 * math.sqrt(EI * WEIGHT / r)
    k = (WEIGHT / (EI * r)) ** 0.25
    scene = in_hole(
        VERTICAL,  # with gravity across it: the string's own axis stays along e3
        waves * 2 * math.pi / k,
        round(per_wave * waves),
        contact={"stiffness": stiffness},
        time={"end": end, "step": 1e-3},
        ends={"top": "pinned", "bottom": "guided", "tip_force": [0, 0, -push]},
        gravity={"direction": [1, 0, 0]},
        initial={"state": "rest"},
        mesh={"elements": round(per_wave * waves), "degree": degree},
    )
    rod = Rod(scene)
    u0 = put(
        rod,
        r1=lambda s: 0 * s + r,
        r2=lambda s: amplitude * np.sin(k * s),
        r3=lambda s: s * (1 - push / EA),
        q_b=lambda s: -amplitude * k * np.cos(k * s) / 2,
    )
    rows: list[tuple[float, float]] = []

    def observe(t: float, u: Array) -> None:
        rows.append((t, float(np.linalg.norm(u.reshape(-1, rod.ansatz.size)[:, rod.ansatz.index("r2")]))))

    march(rod, u0, end, observe=observe)
    t, size = np.array(rows).T
    late = t > 2 / 3 * end
    theory = math.sqrt((push * k**2 - EI * k**4 - WEIGHT / r) / MASS)
    return float(np.polyfit(t[late], np.log(size[late]), 1)[0]), theory, scene


def fed_by_torque(
    elements: int, quadrature: str, torque: float = 3000.0, degree: int = 3
) -> tuple[float, float, Scene]:
    """Growth (1/s) and frequency (Hz) of the worst vibration below 2 kHz of 750 m of weightless pipe, off the wall.

    It hangs straight, twisted by a dead torque (N m) at its free end; nothing damps it.
    """
    from scipy.linalg import eigvals

    length = 750.0
    scene = in_hole(
        VERTICAL,
        length,
        elements,
        0.2,
        ends={"tip_moment": [0, 0, torque]},
        gravity={"magnitude": 0},
        initial={"state": "rest"},
        mesh={"elements": elements, "degree": degree, "quadrature": quadrature},
    )
    rod = Rod(scene)
    half = torque / GJ / 2
    u = put(rod, q_a=lambda s: np.cos(half * s), q_d=lambda s: np.sin(half * s))
    stiffness, _, mass = linearise(rod, u)
    free = np.setdiff1d(np.arange(stiffness.shape[0]), int(rod.nodes[0]) * len(rod.ansatz.v_names) + np.arange(6))
    squares = eigvals(stiffness.toarray()[np.ix_(free, free)], mass.toarray()[np.ix_(free, free)])
    omega = np.sqrt(squares.astype(complex))
    omega = omega[omega.real < 2 * math.pi * 2000]
    worst = omega[np.abs(omega.imag).argmax()]
    return float(abs(worst.imag)), float(worst.real / (2 * math.pi)), scene


def torque_wave(quadrature: str, elements: int = 15, step: float = 1e-3, end: float = 0.5) -> tuple[Array, Scene]:
    """Rows (t, largest turn rate across the axis rad/s) of 750 m of pipe whose top is turned faster and faster.

    It hangs straight and off the wall, pushed aside by random micrometres.
    """
    length = 750.0
    scene = in_hole(
        VERTICAL,
        length,
        elements,
        0.2,
        time=stepping(end, step, "generalized-alpha"),
        ends={"top": "driven"},
        top_drive={"kind": "imposed-speed", "speed": 20.0, "rise_time": 1.0},
        initial={"state": "rest"},
        mesh={"elements": elements, "quadrature": quadrature},
    )
    rod = Rod(scene)
    aside = 1e-6 * np.random.default_rng(0).standard_normal((2, len(rod.nodes)))
    aside[:, 0] = 0
    u0 = put(rod, r1=aside[0], r2=aside[1], r3=lambda s: s + WEIGHT / EA * (length * s - s**2 / 2))
    rows: list[tuple[float, float]] = []
    names = [rod.ansatz.index("w1"), rod.ansatz.index("w2")]
    march(rod, u0, end, observe=lambda t, u: rows.append((t, np.abs(u.reshape(-1, rod.ansatz.size)[:, names]).max())))
    return np.array(rows), scene


# -- friction ---------------------------------------------------------------------------------------------------------
def sliding_down(scale: float, slope: float = 0.2, end: float = 2.0) -> tuple[float, Scene]:
    """Speed (m/s) at which a pipe creeps down a hole so steep that friction of ``slope`` would hold it at rest."""
    lean, stiffness = math.atan(1 / slope), 1e6
    scene = in_hole(
        {"kind": "straight", "inclination": lean},
        2.0,
        1,
        friction=(0.3, 0.15),
        contact={"stiffness": stiffness, "friction_velocity_scale": scale},
        ends={"top": "free"},
        time={"end": end, "step": 5e-3},
    )
    rod = Rod(scene)
    low = 0.01 + WEIGHT * math.sin(lean) / stiffness
    u0 = centred(rod)
    u0 = put(
        rod,
        u0,
        r1=lambda s: math.sin(lean) * s - math.cos(lean) * low,
        r3=lambda s: math.cos(lean) * s + math.sin(lean) * low,
    )
    u = march(rod, u0, end)
    v = node(rod, u, "v1", "v3")
    return v[0] * math.sin(lean) + v[1] * math.cos(lean), scene


def thrown(projected: bool, lift: float, speed: float = 3.0, end: float = 0.9) -> tuple[Array, Scene]:
    """Rows (t, speed along the hole, speed down m/s, height of the axis over where it rests m) of a pipe thrown along
    its hole.

    Coulomb friction of 0.2, practically: the law has come to it at 0.1 m/s. lift: height (m) it is let go at.
    """
    stiffness, clearance = 1e5, 0.2
    scene = in_hole(
        HORIZONTAL,
        2.0,
        1,
        clearance,
        (0.2, 0.2),
        {"stiffness": stiffness, "friction_velocity_scale": 100, "projected": projected},
        {"end": end, "step": 2e-3},
        {"top": "free"},
    )
    rod = Rod(scene)
    rest = clearance + WEIGHT / stiffness
    u0 = put(rod, centred(rod), r3=rest - lift, v1=speed)
    rows: list[tuple[float, float, float, float]] = []

    def observe(t: float, u: Array) -> None:
        v, w, r = node(rod, u, "v1", "v3", "r3")
        rows.append((t, v, w, rest - r))

    march(rod, u0, end, observe=observe)
    return np.array(rows), scene


def rolling(step: float, integrator: str, clearance: float = 0.01, end: float = 0.8) -> tuple[Array, Scene]:
    """Rows (t, rate rad/s, radius m) at which the end of a pipe goes round that is driven with 100 rpm, and whirls."""
    length = 20.0
    scene = in_hole(
        VERTICAL,
        length,
        2,
        clearance,
        (0.3, 0.3),
        {"friction_velocity_scale": 20},
        stepping(end, step, integrator),
        {"top": "driven"},
        top_drive={"kind": "imposed-speed", "speed": 100 * math.pi / 30, "rise_time": 0.1},
        initial={"state": "rest"},
        material=STEEL | {"retardation_time": 1e-3},
    )
    rod = Rod(scene)
    u0 = put(rod, r1=lambda s: 1.01 * clearance * (s / length) ** 1.5, v2=lambda s: -0.6 * (s / length) ** 1.5)
    rows: list[tuple[float, float, float]] = []

    def observe(t: float, u: Array) -> None:
        x, y, v, w = node(rod, u, "r1", "r2", "v1", "v2")
        rows.append((t, (x * w - y * v) / (x * x + y * y), math.hypot(x, y)))

    march(rod, u0, end, observe=observe)
    return np.array(rows), scene


# -- the thesis as printed --------------------------------------------------------------------------------------------
def stretch(reading: str, lean: float, force: float = 1e5) -> float:
    """Stretch (1) of a weightless pipe in a straight hole at an inclination (rad), pulled along it."""
    along = np.array([math.sin(lean), 0.0, math.cos(lean)])
    scene = in_hole(
        {"kind": "straight", "inclination": lean},
        20.0,
        2,
        ends={"tip_force": (force * along).tolist()},
        gravity={"magnitude": 0},
        reading=reading,
    )
    rod = Rod(scene)
    return float(np.array(node(rod, lay(rod), "r1", "r2", "r3")) @ along) / 20.0 - 1


def twist(reading: str, lean: float, moment: float = 10.0) -> float:
    """Twist (rad/m) of the same pipe, turned by a moment about it."""
    along = np.array([math.sin(lean), 0.0, math.cos(lean)])
    scene = in_hole(
        {"kind": "straight", "inclination": lean},
        20.0,
        2,
        ends={"tip_moment": (moment * along).tolist()},
        gravity={"magnitude": 0},
        reading=reading,
    )
    rod = Rod(scene)
    q = lay(rod).reshape(-1, rod.ansatz.size)[rod.nodes[[0, -1]], 3:7]
    (a, b, c, d), (e, f, g, h) = q
    # about d3 of the top: the fourth component of the top's conjugate times the end's
    return 2 * math.atan2(a * h - b * g + c * f - d * e, a * e + b * f + c * g + d * h) / 20.0


class _SpatialSpin:
    """Within it rods take the angular velocity as printed (errata 2), and nothing else."""

    def __enter__(self) -> None:
        made = drillfem.models.rod.ansatz
        self._patch = patch("drillfem.models.rod.ansatz", lambda name, **keys: made(name, **keys | {"literal": True}))
        self._patch.start()

    def __exit__(self, *_: object) -> None:
        self._patch.stop()


def spatial_spin() -> _SpatialSpin:
    """See :class:`_SpatialSpin`."""
    return _SpatialSpin()


def fastest_growth(elements: int = 12) -> float:
    """Growth (1/s) of the fastest vibration of a pipe laid in a bend, without friction or damping: 0 in truth."""
    from scipy.linalg import eigvals

    hole = {"kind": "build", "kick_off": 10.0, "radius": 100.0, "final_inclination": math.radians(60)}
    rod = Rod(in_hole(hole, 120.0, elements))
    stiffness, _, mass = linearise(rod, lay(rod))
    free = np.setdiff1d(np.arange(stiffness.shape[0]), int(rod.nodes[0]) * len(rod.ansatz.v_names) + np.arange(6))
    squares = eigvals(stiffness.toarray()[np.ix_(free, free)], mass.toarray()[np.ix_(free, free)])
    return float(np.abs(np.sqrt(squares.astype(complex)).imag).max())
