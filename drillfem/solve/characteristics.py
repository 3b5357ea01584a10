"""The torsional string marched along its characteristics: exact waves, and the bit law solved per step.

Without damping the spin of every uniform section is a sum of two waves of fixed shape,

    w = a(t - x/c) + b(t + x/c)        torque in the shaft  G J phi' = Z (b - a),   Z = G J / c,

so a step is a shift: what leaves one end of a section arrives at the other after the section's travel time.  Where
sections meet, at the top (imposed angle) and at the bit the arriving waves turn into leaving ones by algebra (field:
reflection (1 - q)/(1 + q) and transmission 2/(1 + q) of the spin, q the ratio of the impedances).  There is no mesh, no
numerical dispersion and no condition on the step but one: travel times are whole numbers of internal steps.

A wave is kept as a parabola per step, which may jump from step to step: its mean, which is exact, so that angles are,
half of its rise, and its sag (values at the ends: mean - tilt + sag, mean + tilt + sag).  At the bit

    I w' = Z (2 a - w) - T             or, without inertia at the bit,   w = 2 a - T / Z,

which is solved exactly for parabolas in time: the answers to the bit force have the form that
`drillfem.solve.condensed` takes from modes, and the bit is solved by the same code, on a rigid mass along the axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from drillfem.bitrock.jit import kernel
from drillfem.bitrock.law import C3, EPS1, FLAT, GAMMA, MU, RADIUS, SIGMA2, BitLaw
from drillfem.bitrock.surface import RockSurface, SurfaceData
from drillfem.models.straight import Channel
from drillfem.scene.frequencies import End, Uniform, standing_waves
from drillfem.solve.condensed import (
    ACC,
    AT_ONCE,
    BA,
    BIT,
    CONTACT,
    DAMPED,
    DEPTH,
    DIVIDED,
    E_CUT,
    E_LOSS,
    E_TOP,
    E_WEAR,
    FOURTH,
    GM,
    GU,
    GV,
    HM,
    HU,
    HV,
    IMPULSE,
    KIND,
    KM,
    KU,
    KV,
    LEAST_PARTS,
    MEAN,
    N_FOUND,
    N_SCALARS,
    OUTPUTS,
    PA,
    PHI,
    PT,
    RA,
    REST,
    RIGID,
    SCRATCH,
    SLOT,
    SOLVED,
    TC,
    TF,
    TOP,
    TOP_SPEED,
    TWELFTH,
    WC,
    WEAR,
    WF,
    Modes,
    TopMotion,
    U,
    V,
    W,
    condense,
    end_of_step,
    observe,
    propagate,
    start_bit,
)

if TYPE_CHECKING:
    from drillfem.scene import Scene

F8 = NDArray[np.float64]
I8 = NDArray[np.int64]

COMMENSURATE = 1e-9
"""Relative error of a travel time that counts as round-off."""
# rows of a wave, coefficients of the Legendre polynomials on a step as it is sent
(AVERAGE, TILT, SAG) = range(3)
THIRD = 1.0 / 3.0
SLOPE = IMPULSE
"""Place in the state of half the rise of the wave that arrived at the bit in the last step."""


@dataclass(frozen=True)
class Shaft:
    """A uniform section: length (m), torsional stiffness G J (N m^2), rotary inertia per length rho J (kg m)."""

    length: float
    stiffness: float
    inertia: float

    def __post_init__(self) -> None:
        for name in ("length", "stiffness", "inertia"):
            if not getattr(self, name) > 0:
                raise ValueError(f"characteristics: {name} = {getattr(self, name)}: must be > 0")

    @property
    def travel_time(self) -> float:
        """Time (s) in which a wave passes."""
        return self.length * float(np.sqrt(self.inertia / self.stiffness))

    @property
    def impedance(self) -> float:
        """Torque per spin of a wave, N m s."""
        return float(np.sqrt(self.inertia * self.stiffness))


def shafts_of(scene: Scene) -> tuple[tuple[Shaft, ...], float]:
    """The shafts of a scene's string, and the inertia at its bit (kg m^2): (1 - alpha) I of (5-39) and the end's own.

    Raises ValueError for a string with damping: its waves change their shape.
    """
    from drillfem.scene.nominal import lumped_at_bit

    for s in scene.string:
        if s.retardation_time != 0.0:
            raise ValueError(f"characteristics: {s.name}: retardation_time = {s.retardation_time:g} s: must be 0")
    alpha = scene.inertia.distributed
    shafts = [Shaft(s.length, s.section_stiffness().torsion, alpha * 2 * s.rotary_inertia) for s in scene.string]
    return tuple(shafts), lumped_at_bit(scene)[1] + scene.ends.bottom_inertia


def wave_step(times: Sequence[float], longest: float, tolerance: float = COMMENSURATE) -> tuple[float, I8, float]:
    """Internal step (s, at most ``longest``), steps in each travel time, and the largest relative error of one.

    The longest step that divides all travel times to ``tolerance`` (round-off); if there is none above a 64th of
    ``longest``, the one that does so best: travel times are then off by the stated error, impedances are kept.
    """
    times_ = np.asarray(times, float)
    shortest, best = times_.min(), (np.inf, 0)
    least = int(np.ceil(shortest / longest * (1 - COMMENSURATE)))
    for n in range(least, 64 * least + 1):
        counts = np.maximum(1.0, np.round(times_ * n / shortest))
        error = float(np.abs(counts * shortest / n / times_ - 1.0).max())
        if error < best[0]:
            best = (error, n)
        if error <= tolerance:
            break
    error, n = best
    counts = np.maximum(1.0, np.round(times_ * n / shortest))
    return float(shortest / n), counts.astype(np.int64), error


def _bit_numbers(impedance: float, inertia: float, step: float) -> tuple[F8, F8]:
    """Answers of the bit's spin and turn to its torque over a step, as `Modes.number`, and to its spin before (3,).

    The latter are of the turn to the middle, the turn, and the spin at the end.
    """
    number, h, z = np.zeros(RIGID + 1), step, impedance
    number[[FOURTH, TWELFTH]] = 1.0, 1.0 / 12.0
    if inertia == 0.0:
        number[[GU, GV, GM]] = h / z, 1.0 / z, 0.5 * h / z
        number[[HU, HV, HM]] = 0.5 * h / z, 1.0 / z, 0.125 * h / z
        number[[KU, KV, KM]] = h / 1.5 / z, 0.0, h / 3.0 / z
        number[AT_ONCE] = 1.0 / z
        return number, np.zeros(3)
    # I w' = -Z w - T, turn' = w, T = p + r x + 4 b x (1 - x) by its derivatives
    a = np.zeros((5, 5))
    a[0, 0], a[0, 2] = -z / inertia * h, -h / inertia
    a[1, 0] = h
    a[2, 3], a[3, 4] = 1.0, -8.0
    mix = np.eye(5)
    mix[3, 4] = 4.0
    end, half = expm(a) @ mix, expm(0.5 * a) @ mix
    for column, names in ((2, (GU, GV, GM)), (3, (HU, HV, HM)), (4, (KU, KV, KM))):
        number[list(names)] = -end[1, column], -end[0, column], -half[1, column]
    return number, np.array([half[1, 0], end[1, 0], end[0, 0]])


@kernel(lean=True)
def _bit_part(
    par: F8,
    surface: SurfaceData,
    axial: Modes,
    number: F8,
    memory: F8,
    impedance: float,
    kind: int,
    modes: F8,
    s: F8,
    step: float,
    average: float,
    tilt: float,
    sag: float,
    turned: float,
    work: F8,
    small: F8,
    z: F8,
) -> bool:
    """The bit over a step or a part of it, met by the parabola of an arriving wave.  As `condensed._substep`."""
    if kind == 0 and s[CONTACT] == 0.0:
        return False
    slot, last, free, out = int(s[SLOT]), int(s[KIND]), small[0], small[1]
    old, new = modes[slot], modes[1 - slot]
    free[0], free[1], free[2], _a, _b, _c, _d = propagate(
        axial.table[kind], axial.big[kind], axial.number[kind, DAMPED], axial.table[last],
        old[0], old[1], s[PA], s[RA], s[BA], new[0], new[1], z,
    )  # fmt: skip
    # the arriving wave acts like a torque -2 Z a
    p, r, b = 2.0 * impedance * (average - tilt + sag), 4.0 * impedance * tilt, -3.0 * impedance * sag
    free[3] = memory[0] * s[W] + number[GM] * p + number[HM] * r + number[KM] * b
    free[4] = memory[1] * s[W] + number[GU] * p + number[HU] * r + number[KU] * b
    free[5] = memory[2] * s[W] + number[GV] * p + number[HV] * r + number[KV] * b
    free[6] = p / impedance
    if not end_of_step(par, surface, axial.number[kind], number, kind == 0, s, step, free, turned, work, out):
        return False
    s[SLOT], s[KIND] = 1 - slot, kind
    return True


@kernel(lean=True)
def _held(par: F8, axial: F8, s: F8, step: float, impedance: float, start: float, end: float, change: float) -> bool:
    """Will the rock hold a stalled bit against a wave from ``start`` to ``end`` (spins), and its weight not stop it?"""
    if s[W] > par[C3] or s[DEPTH] < 0.0:
        return False
    grip = 0.5 * par[RADIUS] * par[MU] * par[GAMMA] * s[WEAR] * par[SIGMA2] * par[RADIUS] * par[FLAT]
    cut = 0.5 * par[RADIUS] ** 2 * par[EPS1] * s[DEPTH]
    if 2.0 * impedance * (max(start, end) + 0.1 * change) > 0.9 * (grip + cut):
        return False
    if 2.0 * impedance * (min(start, end) - 0.1 * change) < -0.9 * grip:
        return False
    sliding = s[WEAR] == 1.0
    return not sliding or s[V] > 1.1 * axial[GV] * (s[WC] + s[WF] - axial[MEAN])


@kernel(lean=True)
def _wave_step(
    par: F8,
    surface: SurfaceData,
    axial: Modes,
    numbers: F8,
    memory: F8,
    impedance: F8,
    counts: I8,
    first: I8,
    down: F8,
    up: F8,
    modes: F8,
    s: F8,
    node: int,
    step: float,
    divisions: I8,
    angle1: float,
    speed1: float,
    top_inertia: float,
    work: F8,
    small: F8,
    z: F8,
) -> None:
    """From node number ``node`` to the next, ``step`` (s) later."""
    last = counts.size - 1
    # top: the wave that leaves makes up the imposed spin
    size = counts[0] + 1
    new, due = first[0] + node % size, first[0] + (node + 1) % size
    turned, z0 = angle1 - s[TOP], impedance[0]
    top = (turned / step, 0.5 * (speed1 - s[TOP_SPEED]), 0.5 * (speed1 + s[TOP_SPEED]) - turned / step)
    norm = (1.0, 1.0 / 3.0, 0.2)
    for i in range(3):
        b = up[i, due]
        down[i, new] = top[i] - b
        s[E_TOP] += step * z0 * norm[i] * (top[i] - 2.0 * b) * top[i]
    s[E_TOP] += 0.5 * top_inertia * (speed1 * speed1 - s[TOP_SPEED] * s[TOP_SPEED])
    s[ACC] = (speed1 - s[TOP_SPEED]) / step
    for j in range(last):  # joints: equal spin and torque on both sides
        n1, n2 = counts[j] + 1, counts[j + 1] + 1
        here, there = first[j] + (node + 1) % n1, first[j + 1] + (node + 1) % n2
        to_up, to_down = first[j] + node % n1, first[j + 1] + node % n2
        z1, z2 = impedance[j], impedance[j + 1]
        for i in range(3):
            a, b = down[i, here], up[i, there]
            back = ((z1 - z2) * a + 2.0 * z2 * b) / (z1 + z2)
            up[i, to_up] = back
            down[i, to_down] = a + back - b
    # bit
    size, zb = counts[last] + 1, impedance[last]
    new, due = first[last] + node % size, first[last] + (node + 1) % size
    a0, a1, a2 = down[AVERAGE, due], down[TILT, due], down[SAG, due]
    first_, last_ = a0 - a1 + a2, a0 + a1 + a2
    before, phi = s[W], s[TOP] + s[PHI]
    massless = numbers[0, AT_ONCE] > 0.0
    if _bit_part(par, surface, axial, numbers[0], memory[0], zb, 0, modes, s, step, a0, a1, a2, turned, work, small, z):
        if massless:
            before = 2.0 * first_ - s[PT] / zb
    else:
        s[DIVIDED] += 1.0
        kind = 1
        if s[CONTACT] == 0.0:
            kind = 3 if _held(par, axial.number[0], s, step, zb, first_, last_, 2.0 * abs(a1)) else 2
        parts = divisions[kind]
        share = 1.0 / parts
        # what rises more than the wave did before rises at once, at the place that the mean tells
        rise = 0.0
        if a1 * s[SLOPE] > 0.0:
            rise = 2.0 * (s[SLOPE] if abs(s[SLOPE]) < abs(a1) else a1)
        jump = 2.0 * a1 - rise
        place = 1.0 - (a0 - first_ - 0.5 * rise) / jump if jump != 0.0 else 0.0
        if place < 0.0 or place > 1.0:  # no such place: a straight rise to the end, and the mean put right
            jump, rise = 0.0, 2.0 * a1
        lift = a0 - (first_ + 0.5 * rise + jump * (1.0 - place))
        for part in range(parts):
            x0, x1 = part * share, (part + 1) * share
            f0, f1 = lift + first_ + rise * x0, lift + first_ + rise * x1
            mean = 0.5 * (f0 + f1)
            if x0 >= place:
                f0, f1, mean = f0 + jump, f1 + jump, mean + jump
            elif x1 > place:
                f1, mean = f1 + jump, mean + jump * (x1 - place) * parts
            _bit_part(
                par, surface, axial, numbers[kind], memory[kind], zb, kind, modes, s, step * share,
                mean, 0.5 * (f1 - f0), 0.5 * (f0 + f1) - mean, turned * share, work, small, z,
            )  # fmt: skip
            if massless and part == 0:
                before = 2.0 * f0 - s[PT] / zb
    s[SLOPE] = a1
    b0, b1 = before - first_, s[W] - last_
    s[TOP], s[TOP_SPEED] = angle1, speed1
    mean = (s[TOP] + s[PHI] - phi) / step - a0
    up[AVERAGE, new], up[TILT, new], up[SAG, new] = mean, 0.5 * (b1 - b0), 0.5 * (b1 + b0) - mean


@kernel("reassoc", "contract", "nsz", lean=True)
def _stored(down: F8, up: F8, at: int, to: int, count: int) -> tuple[float, float]:
    """Sums over cells of the integrals of (a + b)^2 and (b - a)^2: a from ``at`` backwards, b from ``to`` onwards."""
    kinetic = strain = 0.0
    for i in range(count):
        j, k = np.uintp(at - i), np.uintp(to + i)  # unsigned: no check for negative ones, which would cost SIMD
        # down the cell, a runs back in time and b runs on
        m1, t1, s1 = down[AVERAGE, j], -down[TILT, j], down[SAG, j]
        m2, t2, s2 = up[AVERAGE, k], up[TILT, k], up[SAG, k]
        kinetic += (m1 + m2) * (m1 + m2) + (t1 + t2) * (t1 + t2) * THIRD + 0.2 * (s1 + s2) * (s1 + s2)
        strain += (m2 - m1) * (m2 - m1) + (t2 - t1) * (t2 - t1) * THIRD + 0.2 * (s2 - s1) * (s2 - s1)
    return kinetic, strain


@kernel(lean=True)
def _wave_row(
    par: F8,
    surface: SurfaceData,
    axial: Modes,
    impedance: F8,
    counts: I8,
    first: I8,
    down: F8,
    up: F8,
    modes: F8,
    s: F8,
    node: int,
    step: float,
    top_inertia: float,
    bit_inertia: float,
    hook_load: float,
    row: F8,
) -> None:
    """Fill one row of OUTPUTS at a node; the works of the loads have offsets that the caller takes off."""
    now, kind = modes[int(s[SLOT])], int(s[KIND])
    a = observe(axial.table[kind], now[0], now[1], s[PA], s[RA], s[BA], 0.0)
    kinetic = strain = 0.0
    for j in range(counts.size):
        size, n, begin = counts[j] + 1, counts[j], first[j]
        # cell i from the section's top: a sent i + 1 steps ago, b sent n - i steps ago
        at, to = (node - 1) % size, (node - n) % size
        i = 0
        while i < n:
            some = min(n - i, at + 1, size - to)
            k, e = _stored(down, up, begin + at, begin + to, some)
            kinetic += impedance[j] * step * k
            strain += impedance[j] * step * e
            i += some
            at, to = (at - some) % size, (to + some) % size
    torque, speed = s[TC] + s[TF], s[TOP_SPEED]
    j = first[0] + (node - 1) % (counts[0] + 1)
    newest = down[AVERAGE, j] + down[TILT, j] + down[SAG, j]
    top_torque = impedance[0] * (2.0 * newest - speed) + top_inertia * s[ACC]
    row[0], row[1], row[2], row[3], row[4] = node * step, s[W], s[V], s[TOP] + s[PHI], s[U]
    row[5], row[6], row[7] = torque, s[WC] + s[WF], s[DEPTH]
    row[8], row[9], row[10], row[11] = top_torque, speed, hook_load, top_torque * speed
    row[12] = 0.5 * (a[0] + kinetic + bit_inertia * s[W] * s[W] + top_inertia * speed * speed)
    row[13] = 0.5 * (a[1] + strain)
    row[14] = s[E_TOP]
    row[15] = -hook_load * a[6]
    row[16] = a[5] + hook_load * a[6]
    row[17], row[18], row[19] = s[E_CUT], s[E_WEAR], s[E_LOSS]
    row[20] = 0.5 * par[RADIUS] * par[RADIUS] * surface.removed[0]


@kernel(lean=True)
def _between(hold: F8, fraction: float, step: float, row: F8) -> None:
    """A row between two nodes: angle and depth of the bit by cubics with their speeds, all else on a straight line."""
    x, y = fraction, 1.0 - fraction
    for i in range(row.size):
        row[i] = hold[1, i] if x >= 1.0 else hold[0, i] + x * (hold[1, i] - hold[0, i])
    if x < 1.0:
        for i, j in ((3, 1), (4, 2)):
            chord = hold[1, i] - hold[0, i]
            row[i] += x * y * ((step * hold[0, j] - chord) * y - (step * hold[1, j] - chord) * x)


@kernel(lean=True)
def _march(
    par: F8,
    surface: SurfaceData,
    axial: Modes,
    numbers: F8,
    memory: F8,
    impedance: F8,
    counts: I8,
    first: I8,
    down: F8,
    up: F8,
    modes: F8,
    s: F8,
    nodes: I8,
    fractions: F8,
    node: int,
    step: float,
    divisions: I8,
    top: F8,
    top_inertia: float,
    bit_inertia: float,
    hook_load: float,
    every: int,
    begun: int,
    hold: F8,
    rows: F8,
    work: F8,
    small: F8,
    z: F8,
) -> None:
    """Pass the times that lie a ``fractions`` of a step behind the nodes before ``nodes``; a row each ``every`` times.

    top (nodes, 2): angle and speed of the top from ``node`` on.  hold (2, outputs): the nodes around the last time.
    """
    written, start = 0, node
    for k in range(nodes.size):
        wanted = (begun + k + 1) % every == 0
        while node < nodes[k]:
            note = node + 1 == nodes[k] and (wanted or k + 1 == nodes.size)
            if note and fractions[k] < 1.0:
                if hold[1, 0] == node * step:
                    for i in range(hold.shape[1]):
                        hold[0, i] = hold[1, i]
                else:
                    _wave_row(
                        par, surface, axial, impedance, counts, first, down, up, modes, s, node, step,
                        top_inertia, bit_inertia, hook_load, hold[0],
                    )  # fmt: skip
            _wave_step(
                par, surface, axial, numbers, memory, impedance, counts, first, down, up, modes, s, node, step,
                divisions, top[node + 1 - start, 0], top[node + 1 - start, 1], top_inertia, work, small, z,
            )  # fmt: skip
            node += 1
            if note:
                _wave_row(
                    par, surface, axial, impedance, counts, first, down, up, modes, s, node, step,
                    top_inertia, bit_inertia, hook_load, hold[1],
                )  # fmt: skip
        if wanted:
            _between(hold, fractions[k], step, rows[written])
            written += 1


class CharacteristicString:
    """Torsional string on a cutting bit, marched along its characteristics; a stand-in for `CondensedString`.

    Parameters
    ----------
    axial : Channel of one degree of freedom: the rigid mass along the axis, which carries ``hook_load`` (N, up).
    shafts : sections from the top down.
    arc_length : (n,) m, the nodes of nodal values, from 0 to the length of the string.
    law, surface : the bit and its rock; the surface is owned from here on.
    step : s, of the outputs.  Inside, steps are at most as long, and divide the travel times (`internal_step`,
        `travel_time_error`); where they do not divide ``step``, outputs lie between two of them: angle and depth of the
        bit on cubics (error of fourth order in the internal step), all else on straight lines (second).
    hook_load : N.
    top : rad/s, or a function of an array of times that returns the arrays (angle, speed).
    bit_inertia, top_inertia : kg m^2, at the ends.
    parts : divisions of a step that is not smooth, as in `CondensedString`.

    Raises ValueError for a step that is not positive, an axial channel that is not a rigid mass, a bad section.
    """

    def __init__(
        self,
        axial: Channel,
        shafts: Sequence[Shaft],
        arc_length: F8,
        law: BitLaw,
        surface: RockSurface,
        step: float,
        *,
        hook_load: float,
        top: float | TopMotion,
        bit_inertia: float = 0.0,
        top_inertia: float = 0.0,
        parts: int | tuple[int, int] = (LEAST_PARTS[True], LEAST_PARTS[True]),
    ) -> None:
        if not step > 0:
            raise ValueError(f"characteristics: step = {step}: must be > 0")
        if axial.mass.shape != (1, 1) or axial.stiffness.any() or axial.damping.any():
            raise ValueError("characteristics: the axial channel must be one rigid mass")
        length = sum(shaft.length for shaft in shafts)
        if not (len(shafts) and abs(arc_length[0]) <= 1e-9 * length >= abs(arc_length[-1] - length)):
            raise ValueError("characteristics: arc_length must run from the top to the bit")
        self.axial, self.shafts, self.law, self.surface = axial, tuple(shafts), law, surface
        self.arc_length, self.step, self.hook_load = np.array(arc_length), float(step), hook_load
        self.parts = parts if isinstance(parts, tuple) else (parts, parts)
        self._divisions = np.array([1, *self.parts, min(2, self.parts[1])])
        self.bit_inertia, self.top_inertia = float(bit_inertia), float(top_inertia)
        self._top: TopMotion = top if callable(top) else lambda t: (top * t, np.full_like(t, top))
        dt, self._counts, self.travel_time_error = wave_step([x.travel_time for x in shafts], step)
        self.internal_step = dt
        self._impedance = np.array([x.impedance for x in shafts])
        self._first = np.concatenate([[0], np.cumsum(self._counts + 1)[:-1]])
        load = np.zeros(1) if axial.load is None else np.array(axial.load, float)
        steps = tuple(dt / self._divisions)
        self._axial, self._axial_shapes = condense(axial, np.arange(1), load - hook_load, steps, False)
        both = [_bit_numbers(shafts[-1].impedance, self.bit_inertia, h) for h in steps]
        self._numbers, self._memory = (np.stack(x) for x in zip(*both, strict=True))
        self._par = law.array
        n = len(self.arc_length)
        self.reset(np.zeros(1), np.zeros(1), np.zeros(n), np.zeros(n))

    @property
    def time(self) -> float:
        """Time reached, s."""
        return self.count * self.step

    @property
    def frequencies(self) -> tuple[F8, ...]:
        """Natural frequencies, Hz: of the axial motion (free), and the exact ones of torsion up to 0.05 per step."""
        # pieces of unit wave speed: as long as the travel times of the march, with the impedances
        pieces = [Uniform(t, z, z) for t, z in zip(self._counts * self.internal_step, self._impedance, strict=True)]
        torsion = standing_waves(pieces, End(True), End(False, self.bit_inertia), 0.05 / self.internal_step)
        return np.zeros(1), np.array(torsion)

    def nominal(self) -> tuple[F8, F8]:
        """Nodal displacement (m) and twist (rad) of steady drilling, both zero at the top (spec 8.3)."""
        torque = self.law.torque(self.law.depth_of_cut(self._axial.number[0, MEAN]))
        ends = np.concatenate([[0.0], np.cumsum([x.length for x in self.shafts])])
        twist = np.concatenate([[0.0], np.cumsum([x.length / x.stiffness for x in self.shafts])])
        return np.zeros(1), -torque * np.interp(self.arc_length, ends, twist)

    def reset(self, u: F8, u_dot: F8, phi: F8, phi_dot: F8) -> None:
        """Start at time 0 from displacement (1,) m and its speed, and nodal twist (n,) rad and spin (n,) rad/s.

        Between nodes spin and angle are linear, and slopes of the angle at the nodes are of second order.  The bit's
        depth counts from here.
        """
        self._down, self._up = np.zeros((2, 3, int((self._counts + 1).sum())))
        x, top = self.arc_length, 0.0
        slope = np.diff(phi_dot) / np.diff(x)
        integral = np.concatenate([[0.0], np.cumsum(0.5 * (phi_dot[1:] + phi_dot[:-1]) * np.diff(x))])
        for shaft, n, first in zip(self.shafts, self._counts, self._first, strict=True):
            at = top + shaft.length * np.arange(n + 1) / n
            angle, spin = np.interp(at, x, phi), np.interp(at, x, phi_dot)
            k = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
            passed = integral[k] + (at - x[k]) * (phi_dot[k] + 0.5 * slope[k] * (at - x[k]))
            size, c = shaft.length / n, shaft.length / shaft.travel_time
            # c phi' at the cells' ends from the nodes of this section alone: torque is continuous, twist is not
            near = 1e-9 * shaft.length
            mine = x[(x > top + near) & (x < top + shaft.length - near)]
            mine = np.concatenate([[top], mine, [top + shaft.length]])
            twist = np.gradient(np.interp(mine, x, phi), mine, edge_order=2 if len(mine) > 2 else 1)
            bent = c * np.interp(at, mine, twist)
            w, strain = np.diff(passed) / size, c * np.diff(angle) / size
            cells = np.arange(n)
            late, early, mean = 0.5 * (spin[:-1] - bent[:-1]), 0.5 * (spin[1:] - bent[1:]), 0.5 * (w - strain)
            sent = first + (-1 - cells) % (n + 1)  # down: cell i was sent i + 1 steps ago
            self._down[:, sent] = mean, 0.5 * (late - early), 0.5 * (late + early) - mean
            early, late, mean = 0.5 * (spin[:-1] + bent[:-1]), 0.5 * (spin[1:] + bent[1:]), 0.5 * (w + strain)
            sent = first + (cells - n) % (n + 1)
            self._up[:, sent] = mean, 0.5 * (late - early), 0.5 * (late + early) - mean
            top += shaft.length
        a = self._axial.table[0]
        angle_top, speed = (float(y[0]) for y in self._top(np.zeros(1)))
        xa = self._axial_shapes.T @ (self.axial.mass @ u) - a[REST]
        va = self._axial_shapes.T @ (self.axial.mass @ u_dot)
        self._origin = float(a[BIT] @ xa)
        xa[0] -= self._origin / a[BIT][0]
        self._modes = np.zeros((2, 2, 1))
        self._modes[0] = xa, va
        s = self._s = np.zeros(N_SCALARS)
        s[TOP], s[TOP_SPEED], s[V], s[W] = angle_top, speed, a[BIT] @ va, phi_dot[-1]
        s[PHI] = phi[-1] - angle_top
        start_bit(s, self._par, self.surface)
        self.count = self._node = 0
        self._hold = np.zeros((2, len(OUTPUTS)))
        self._offset = np.zeros(len(OUTPUTS))
        par, rock, mass, impedance, counts, first, down, up, modes, s = self._state
        _wave_row(
            par, rock, mass, impedance, counts, first, down, up, modes, s, 0, *self._ends, self._hold[1]
        )  # fmt: skip
        self._offset[[15, 16]] = self._hold[1, [15, 16]]

    @property
    def _state(self) -> tuple[Any, ...]:
        numbers = (self._impedance, self._counts, self._first, self._down, self._up, self._modes, self._s)
        return (self._par, self.surface.data, self._axial, *numbers)

    @property
    def _ends(self) -> tuple[float, float, float, float]:
        return self.internal_step, self.top_inertia, self.bit_inertia, float(self.hook_load)

    def _when(self, counts: I8) -> tuple[I8, F8]:
        """Nodes at or behind the times of output numbers ``counts``, and the part of a step from the node before."""
        at = counts * (self.step / self.internal_step)
        nodes = np.ceil(at * (1 - 1e-14) - 1e-9).astype(np.int64)
        fractions = np.where(nodes - at < 1e-9, 1.0, 1.0 - (nodes - at))
        return nodes, fractions

    def sample(self) -> dict[str, float]:
        """The outputs now (names of OUTPUTS)."""
        row = np.empty(len(OUTPUTS))
        fraction = self._when(np.array([self.count]))[1][0] if self.count else 1.0
        _between(self._hold, fraction, self.internal_step, row)
        row -= self._offset
        row[0] = self.time
        return dict(zip(OUTPUTS, (float(x) for x in row), strict=True))

    def advance(self, steps: int, every: int = 1) -> dict[str, F8]:
        """March; returns the outputs at step numbers that ``every`` divides.  Chunks of any size agree to the bit."""
        numbers = np.arange(self.count + 1, self.count + steps + 1)
        nodes, fractions = self._when(numbers)
        end = int(nodes[-1]) if steps else self._node
        top = np.stack(self._top(self.internal_step * np.arange(self._node, end + 1, dtype=np.float64)), axis=1)
        due = numbers[numbers % every == 0]
        rows = np.empty((len(due), len(OUTPUTS)))
        par, surface, axial, impedance, counts, first, down, up, modes, s = self._state
        _march(
            par,
            surface,
            axial,
            self._numbers,
            self._memory,
            impedance,
            counts,
            first,
            down,
            up,
            modes,
            s,
            nodes,
            fractions,
            self._node,
            self.internal_step,
            self._divisions,
            top,
            self.top_inertia,
            self.bit_inertia,
            float(self.hook_load),
            every,
            self.count,
            self._hold,
            rows,
            np.empty((SCRATCH, len(self.surface.data.share))),
            np.empty((2, N_FOUND)),
            np.empty(4),
        )
        self.count += steps
        self._node = end
        rows -= self._offset
        rows[:, 0] = self.step * due
        return dict(zip(OUTPUTS, np.ascontiguousarray(rows.T), strict=True))

    def _along(self, node: int, angle_top: float) -> tuple[F8, F8]:
        """Nodal angle (rad) and spin (rad/s) at a node of time: the present one, or the one before."""
        angle, spin = np.empty_like(self.arc_length), np.empty_like(self.arc_length)
        top, phi, dt = 0.0, angle_top, self.internal_step
        for shaft, n, first in zip(self.shafts, self._counts, self._first, strict=True):
            cells = np.arange(n)
            back = np.array([[1.0], [-1.0], [1.0]])  # down the cell, a runs back in time
            a = self._down[:, first + (node - 1 - cells) % (n + 1)] * back
            b = self._up[:, first + (node - n + cells) % (n + 1)]
            inside = (self.arc_length >= top - 1e-9 * shaft.length) & (
                self.arc_length <= top + shaft.length * (1 + 1e-9)
            )
            at = np.clip((self.arc_length[inside] - top) / shaft.length * n, 0.0, n)
            k = np.minimum(at.astype(np.int64), n - 1)
            x = at - k
            passed = np.concatenate([[0.0], np.cumsum(dt * (b - a)[AVERAGE])])

            def shape(v: F8, x: F8 = x, k: I8 = k) -> tuple[F8, F8]:
                mean, tilt, sag = v[:, k]
                y = 2 * x - 1
                return mean + tilt * y + sag * (1.5 * y * y - 0.5), x * (mean - (1 - x) * (tilt + sag * y))

            spin[inside] = shape(a + b)[0]
            angle[inside] = phi + passed[k] + dt * shape(b - a)[1]
            top, phi = top + shaft.length, phi + float(passed[-1])
        return angle, spin

    def fields(self) -> dict[str, F8]:
        """Displacement (1,) m, angle (n,) rad and their speeds now, at the nodes ``arc_length``."""
        row, dt, spin_top = self.sample(), self.internal_step, float(self._s[TOP_SPEED])
        angle, spin = self._along(self._node, float(self._s[TOP]))
        fraction = self._when(np.array([self.count]))[1][0] if self.count else 1.0
        if fraction < 1.0:
            before = self._top(np.array([(self._node - 1) * dt]))
            angle0, spin0 = self._along(self._node - 1, float(before[0][0]))
            x, y, chord = fraction, 1.0 - fraction, angle - angle0
            angle = angle0 + x * chord + x * y * ((dt * spin0 - chord) * y - (dt * spin - chord) * x)
            spin = spin0 + x * (spin - spin0)
            spin_top = float(before[1][0]) + x * (spin_top - float(before[1][0]))
        # the ends as they were imposed and solved: a wave that jumps has two values there
        spin[0], spin[-1] = spin_top, row["bit_angular_speed"]
        return {
            "displacement": np.array([row["bit_depth"] + self._origin]),
            "axial_speed": np.array([row["bit_axial_speed"]]),
            "angle": angle,
            "angular_speed": spin,
        }

    @property
    def counters(self) -> dict[str, int]:
        """Steps inside, those that were divided, and parts solved with the bit stalled, off bottom or in between."""
        return {"steps": self._node, "divided": int(self._s[DIVIDED]), "solved": int(self._s[SOLVED])}

    def state_dict(self) -> dict[str, Any]:
        """Everything that changes in time, as arrays; `load` goes on as if never stopped, to the bit."""
        arrays = {"down": self._down, "up": self._up, "modes": self._modes, "scalars": self._s}
        arrays |= {"hold": self._hold, "offset": self._offset}
        numbers = {"count": self.count, "node": self._node, "origin": self._origin}
        state = {name: array.copy() for name, array in arrays.items()} | {k: np.array(v) for k, v in numbers.items()}
        return state | {f"surface_{name}": array for name, array in self.surface.state_dict().items()}

    def load(self, state: dict[str, Any]) -> None:
        """Take over a state of `state_dict` of a string made in the same way."""
        self._down[:], self._up[:], self._modes[:] = state["down"], state["up"], state["modes"]
        self._s[:], self._hold[:], self._offset[:] = state["scalars"], state["hold"], state["offset"]
        self.count, self._node, self._origin = int(state["count"]), int(state["node"]), float(state["origin"])
        self.surface.load({name[8:]: array for name, array in state.items() if name.startswith("surface_")})
