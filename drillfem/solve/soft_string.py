"""The soft string: waves of twist along a hole, exact between nodes, and friction at the wall solved at every node.

    rho J phi_tt = G J phi_ss + (c_d G J phi_st)_s - b phi_t - T(phi_t)

T is the friction torque per length (`drillfem.models.soft_string`), b a viscous drag.  As in `characteristics` the spin
is a sum of two waves, w = a + b, with the torque Z (b - a) in the shaft.  Cells are as long as a wave travels in a
step, so that a step carries every wave from one end of its cell to the other, without dispersion or damping.  What acts
on half a cell above and below a node acts at the node: with the mean speed w of the node over the step,

    (Z1 + Z2 + b) w + T(w) + [damping of the two cells] = 2 (Z1 a + Z2 b)           inner nodes

and the waves that leave are w - b downwards, w - a upwards.  At the top and the bottom the inertia joins in by the
midpoint rule, and at the top the drive (`drillfem.models.drive`).  The rule is of second order in the step, and what
the node takes out of the waves is exactly T w + b w^2 times the step: the balance of energy closes to round-off.

The equation of a node has one solution whatever the step, if T does not fall faster than Z1 + Z2 grows: the grid is
made fine enough for that.  With damping inside the string the nodes are coupled to their neighbours, and solved by
Newton's method on the solutions of the single nodes (a tridiagonal system per iteration).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..bitrock.jit import announce, kernel
from ..errors import SceneError, SimulationError
from ..models.drive import DriveLaw, law_of, slip, wanted
from ..models.soft_string import COULOMB, WallFriction, line_of, wall_friction
from ..models.steady import outer_diameter
from ..results import Result, ResultWriter
from ..scene import Scene
from .audit import COMMON, TURNING, WALL, WORKS, imbalance
from .characteristics import Shaft, wave_step
from .condensed import TopMotion
from .straight import march

F8 = NDArray[np.float64]
I8 = NDArray[np.int64]

TRAVEL_TIME = 2e-4
"""Relative error of a section's travel time that is good enough."""
STEEPEST = 0.5
"""Greatest fall of the friction torque at a node, over the impedance that stands against it."""
FINER = 64
"""How much finer than asked for the grid may be made for that."""

OUTPUTS = (
    "time",
    "top_torque",
    "top_angular_speed",
    "bit_angular_speed",
    "bit_angle",
    "top_power",
    "kinetic_energy",
    "strain_energy",
    "work_top_drive",
    "work_wall",
    "dissipated",
    "top_angle",
    "wall_torque",
)

# rows of the table of nodes: what resists the spin linearly, friction torques, 2 alpha of (4-7), friction speed per
# spin, drag alone
(RESIST, STATIC, DYNAMIC, PEAK, SCALE, DRAG) = range(6)
# scalars of the state
(TOP_SPEED, BIT_SPEED, ERROR, TOP_ANGLE, BIT_ANGLE, W_TOP, W_WALL, W_LOST, KINETIC, STRAIN, ITERATIONS) = range(11)
_MOST = 60  # iterations per step


class Rules(NamedTuple):
    """Numbers that hold for the whole string."""

    coulomb: bool
    threshold: float  # spin above which Coulomb friction is dynamic, rad/s
    rounding: float  # epsilon of (4-7)
    damped: bool  # is there damping inside the string
    imposed: bool  # is the motion of the top imposed
    top_inertia: float  # kg m2
    bottom_inertia: float  # kg m2
    held: bool  # does the bottom not turn


@kernel(lean=True)
def _stribeck(rules: Rules, node: F8, spin: float):  # type: ignore[no-untyped-def]
    """Friction torque (4-7) of a node with numbers ``node`` at a spin, and its slope."""
    u = node[SCALE] * spin
    root, under = math.sqrt(u * u + rules.rounding), u * u + 1.0
    top = node[DYNAMIC] * root + node[PEAK]
    torque = top * u / under
    slope = node[SCALE] * ((node[DYNAMIC] * u * u / root + top) - 2.0 * u * torque) / under
    return torque, slope


@kernel(lean=True)
def _rub(rules: Rules, node: F8, spin: float) -> float:
    """Friction torque of a node that turns as it is told; 0 where it stands and friction need not hold it."""
    if not rules.coulomb:
        return _stribeck(rules, node, spin)[0]
    level = node[STATIC] if abs(spin) < rules.threshold else node[DYNAMIC]
    return math.copysign(level, spin) if spin != 0.0 else 0.0


@kernel(lean=True)
def _turn(rules: Rules, node: F8, resist: float, push: float, before: float, guess: float):  # type: ignore[no-untyped-def]
    """Spin w of a node with ``resist`` w + T(w) = ``push``, and dw/dpush.

    ``before``: its spin in the last step; ``guess``: what it may be.
    """
    if node[STATIC] == 0.0:
        return push / resist, 1.0 / resist
    size, sign = abs(push), math.copysign(1.0, push)
    if rules.coulomb:
        slack = size - (node[STATIC] if abs(before) < rules.threshold else node[DYNAMIC])
        return (sign * slack / resist, 1.0 / resist) if slack >= 0.0 else (0.0, 0.0)
    low, high = 0.0, size / resist
    w = min(max(sign * guess, low), high)
    slope = resist
    for _ in range(_MOST):
        torque, slope = _stribeck(rules, node, w)
        slope += resist
        left = resist * w + torque - size
        if left > 0.0:
            high = w
        else:
            low = w
        new = w - left / slope if slope > 0.0 else 0.5 * (low + high)
        if not low <= new <= high:
            new = 0.5 * (low + high)
        if abs(new - w) <= 1e-14 * (abs(w) + high):
            w = new
            break
        w = new
    return sign * w, 1.0 / slope


@kernel(lean=True)
def _top(  # type: ignore[no-untyped-def]
    rules: Rules, law: DriveLaw, node: F8, resist: float, push: float, before: float, error: float, turned: float,
    speed: float, guess: float, step: float,
):  # fmt: skip
    """Spin of a driven top over the step, its slope by ``push``, and the torque of the motor.

    ``before``: spin of the top before; ``error``: angle that is missing, ``turned``: angle wanted in this step.
    """
    asked = wanted(law, error + 0.5 * turned, turned / step, 0.0)
    soft = law.proportional + 0.5 * step * law.integral
    heavy = law.inertia / step if law.masks > 0.0 else 2.0 * law.inertia / step
    own = 0.0 if law.masks > 0.0 else heavy
    w, slope = _turn(rules, node, resist + soft + own, push + asked + own * before, speed, guess)
    torque = asked - soft * w + law.masks * heavy * (w - before)
    if abs(torque) > law.limit:
        torque = math.copysign(law.limit, torque)
        w, slope = _turn(rules, node, resist + heavy, push + torque + heavy * before, speed, guess)
    return w, slope, torque


@kernel(lean=True)
def _bottom(  # type: ignore[no-untyped-def]
    rules: Rules, node: F8, resist: float, push: float, before: float, speed: float, guess: float, step: float
):
    """Spin of the bottom over the step, and its slope by ``push``."""
    if rules.held:
        return 0.0, 0.0
    heavy = 2.0 * rules.bottom_inertia / step
    return _turn(rules, node, resist + heavy, push + heavy * before, speed, guess)


@kernel(lean=True)
def _solve(  # type: ignore[no-untyped-def]
    rules: Rules, law: DriveLaw, nodes: F8, firm: F8, push: F8, w: F8, s: F8, turned: float, step: float, work: F8
):
    """Spins w (nodes,) of all nodes in the step, in place of the last ones; returns the motor's torque, iterations.

    nodes (n, 6); firm (n - 1,): damping of the cells, N m s; push (n,): what the waves bring. work (6, n).
    -1 iterations: not converged.
    """
    n, torque = w.size, 0.0
    most = _MOST if rules.damped else 1
    below, centre, above, right, old, guess = work[0], work[1], work[2], work[3], work[4], work[5]
    for i in range(n):
        old[i] = w[i]
    for k in range(most):
        for i in range(n):
            lower = firm[i - 1] if i > 0 else 0.0
            upper = firm[i] if i < n - 1 else 0.0
            beside = (lower * w[i - 1] if i > 0 else 0.0) + (upper * w[i + 1] if i < n - 1 else 0.0)
            resist = nodes[i, RESIST] + lower + upper
            if i == 0:
                if rules.imposed:
                    found, slope = turned / step, 0.0
                else:
                    found, slope, torque = _top(
                        rules,
                        law,
                        nodes[0],
                        resist,
                        push[0] + beside,
                        s[TOP_SPEED],
                        s[ERROR],
                        turned,
                        old[0],
                        w[0],
                        step,
                    )
            elif i == n - 1:
                found, slope = _bottom(rules, nodes[i], resist, push[i] + beside, s[BIT_SPEED], old[i], w[i], step)
            else:
                found, slope = _turn(rules, nodes[i], resist, push[i] + beside, old[i], w[i])
            if not rules.damped:
                w[i] = found
                continue
            # w_i = found + slope * firm * (new - present neighbours)
            guess[i] = found
            below[i], above[i], centre[i] = -slope * lower, -slope * upper, 1.0
            right[i] = found - slope * beside
        if not rules.damped:
            return torque, 1
        for i in range(1, n):
            factor = below[i] / centre[i - 1]
            centre[i] -= factor * above[i - 1]
            right[i] -= factor * right[i - 1]
        change = new = largest = 0.0
        for j in range(n):
            i = n - 1 - j
            new = (right[i] - (above[i] * new if j else 0.0)) / centre[i]
            if rules.coulomb and new * guess[i] < 0.0 and nodes[i, DYNAMIC] > 0.0:
                new = 0.0  # a node comes to rest before it turns back: without this, iterations go round in circles
            change, largest = max(change, abs(new - w[i])), max(largest, abs(new))
            w[i] = new
        if change <= 1e-13 * largest:
            return torque, k + 1
    return torque, -1


@kernel(lean=True)
def _energies(impedance: F8, down: F8, up: F8, s: F8, rules: Rules, step: float) -> None:
    """Kinetic and strain energy (J) of the present state."""
    kinetic = strain = 0.0
    for j in range(down.size):
        kinetic += impedance[j] * (down[j] + up[j]) ** 2
        strain += impedance[j] * (up[j] - down[j]) ** 2
    s[KINETIC] = 0.5 * (
        step * kinetic + rules.top_inertia * s[TOP_SPEED] ** 2 + rules.bottom_inertia * s[BIT_SPEED] ** 2
    )
    s[STRAIN] = 0.5 * step * strain


@kernel(lean=True)
def _march(
    rules: Rules,
    law: DriveLaw,
    nodes: F8,
    firm: F8,
    impedance: F8,
    down: F8,
    up: F8,
    w: F8,
    s: F8,
    first: int,
    last: int,
    step: float,
    top: F8,
    wanted_at: I8,
    fractions: F8,
    hold: F8,
    seen: F8,
    moment: F8,
    work: F8,
    rub: F8,
    rows: F8,
) -> int:
    """Steps number ``first`` to ``last`` - 1; rows where they are wanted. Returns -1, or the step that failed.

    wanted_at (r,): steps whose middle is at or behind the time of a row; fractions (r,): where that time lies between
    the middle of the step before and this one. top (steps + 1, 2): angle and speed wanted of the top, or imposed.
    hold (2, columns): the rows of the last two steps; seen (2, n), moment (2, n): spins of nodes and torques of cells.
    """
    n, written = w.size, 0
    push = work[6]
    for m in range(first, last):
        turned = top[m - first + 1, 0] - top[m - first, 0]
        keep = m >= last - 2
        if keep:
            for i in range(n):
                seen[0, i], moment[0, i] = seen[1, i], moment[1, i]
            for j in range(n - 1):
                moment[1, j] = 0.5 * impedance[j] * (up[j] - down[j])
        push[0] = 2.0 * impedance[0] * up[0]
        for i in range(1, n - 1):
            push[i] = 2.0 * (impedance[i - 1] * down[i - 1] + impedance[i] * up[i])
        push[n - 1] = 2.0 * impedance[n - 2] * down[n - 2]
        torque, count = _solve(rules, law, nodes, firm, push, w, s, turned, step, work)
        if count < 0:
            return m
        s[ITERATIONS] += count
        wall = lost = 0.0
        for i in range(n):
            inner = 0.0
            if i > 0:
                inner += firm[i - 1] * (w[i] - w[i - 1])
            if i < n - 1:
                inner += firm[i] * (w[i] - w[i + 1])
                lost += firm[i] * (w[i + 1] - w[i]) ** 2
            rub[i] = push[i] - nodes[i, RESIST] * w[i] - inner
            lost += nodes[i, DRAG] * w[i] * w[i]
        for j in range(n - 1):
            a, b = down[j], up[j]
            down[j], up[j] = w[j] - b, w[j + 1] - a
            if w[j] == 0.0 and w[j + 1] == 0.0 and nodes[j, STATIC] > 0.0 and nodes[j + 1, STATIC] > 0.0:
                # stuck at both ends: friction along the cell stops what would bounce in it for ever
                wall += 0.5 * impedance[j] * (a + b) ** 2
                up[j] = 0.5 * (b - a)
                down[j] = -up[j]
        # the ends: what the wall takes there is the rest of their balance
        stored = 0.5 * rules.top_inertia * s[TOP_SPEED] ** 2
        if rules.imposed:
            taken = _rub(rules, nodes[0], w[0]) - rub[0]  # from the top by the string
            torque = taken + rules.top_inertia * (top[m - first + 1, 1] - top[m - first, 1]) / step
            rub[0] += taken
            s[TOP_SPEED] = top[m - first + 1, 1]
        else:
            before = s[TOP_SPEED]
            s[TOP_SPEED] = w[0] if law.masks > 0.0 else 2.0 * w[0] - before
            taken = torque - law.inertia * (s[TOP_SPEED] - before) / step
            rub[0] += taken
            acceleration = law.masks * (w[0] - before) / step
            missing = s[ERROR] + 0.5 * (turned - step * w[0])
            error = turned - step * w[0]
            s[ERROR] += error - slip(law, missing, error / step, acceleration, step)
        if rules.held:
            rub[n - 1] = 0.0
        else:
            heavy = 2.0 * rules.bottom_inertia * (w[n - 1] - s[BIT_SPEED]) / step
            rub[n - 1] -= heavy
            s[BIT_SPEED] = 2.0 * w[n - 1] - s[BIT_SPEED] if rules.bottom_inertia > 0.0 else w[n - 1]
        rubbed = 0.0
        for i in range(n):
            wall += rub[i] * w[i]
            rubbed += rub[i]
        kinetic, strain, w_top, w_wall, w_lost = s[KINETIC], s[STRAIN], s[W_TOP], s[W_WALL], s[W_LOST]
        _energies(impedance, down, up, s, rules, step)
        stored = 0.5 * rules.top_inertia * s[TOP_SPEED] ** 2 - stored
        s[W_TOP] += step * taken * w[0] + stored
        s[W_WALL] += step * wall
        s[W_LOST] += step * lost
        for i in range(hold.shape[1]):
            hold[0, i] = hold[1, i]
        row = hold[1]
        row[0] = (m + 0.5) * step
        row[1], row[2], row[3] = torque, w[0], w[n - 1]
        row[4], row[5] = s[BIT_ANGLE] + 0.5 * step * w[n - 1], torque * w[0]
        row[6], row[7] = 0.5 * (kinetic + s[KINETIC]), 0.5 * (strain + s[STRAIN])
        row[8], row[9], row[10] = 0.5 * (w_top + s[W_TOP]), 0.5 * (w_wall + s[W_WALL]), 0.5 * (w_lost + s[W_LOST])
        row[11], row[12] = s[TOP_ANGLE] + 0.5 * step * w[0], rubbed
        s[TOP_ANGLE] += step * w[0]
        s[BIT_ANGLE] += step * w[n - 1]
        if keep:
            for i in range(n):
                seen[1, i] = w[i]
            for j in range(n - 1):
                moment[1, j] += 0.5 * impedance[j] * (up[j] - down[j])
        while written < wanted_at.size and wanted_at[written] == m:
            x = fractions[written]
            for i in range(rows.shape[1]):
                rows[written, i] = hold[0, i] + x * (hold[1, i] - hold[0, i])
            written += 1
    return -1


def merged(shafts: Sequence[Shaft], damping: Sequence[float], shortest: float) -> tuple[list[Shaft], F8]:
    """Sections with those joined to their neighbours that a wave passes in less than ``shortest`` (s), and equal ones.

    The joined section is as long, as soft and as heavy as its parts, and damps as much under the same torque: waves
    longer than it do not see the difference. Returns shafts and their Kelvin-Voigt times (s).
    """
    found: list[Shaft] = []
    late: list[float] = []
    for shaft, c in zip(shafts, damping, strict=True):
        if found:
            one = found[-1]
            same = (one.stiffness, one.inertia, late[-1]) == (shaft.stiffness, shaft.inertia, c)
            if same or min(one.travel_time, shaft.travel_time) < shortest:
                length = one.length + shaft.length
                soft = one.length / one.stiffness, shaft.length / shaft.stiffness
                heavy = one.length * one.inertia + shaft.length * shaft.inertia
                late[-1] = c if same else (late[-1] * soft[0] + c * soft[1]) / sum(soft)
                found[-1] = replace(shaft, length=length) if same else Shaft(length, length / sum(soft), heavy / length)
                continue
        found.append(shaft)
        late.append(c)
    return found, np.array(late)


class SoftString:
    """A soft string, marched along its waves.

    Parameters
    ----------
    shafts : sections from the top down; shorter ones than a wave passes in ``step`` are joined (`merged`).
    friction : at the wall.
    step : s, of the outputs.  Inside, steps are at most as long (`internal_step`), divide the travel times of the
        sections to `TRAVEL_TIME` (`travel_time_error`), and make ``cells`` or more of them; outputs lie on straight
        lines between the middles of two steps.
    law : the drive; None: the top moves as ``top`` says.
    top : function of an array of times (s) that returns arrays (angle, speed): wanted by the drive, or imposed.
    top_inertia, bottom_inertia : kg m2 at the ends; with a drive the top's is the drive's own.
    held : the lower end does not turn.
    damping : Kelvin-Voigt times c_d (s) of the sections.

    Raises ValueError for a step that is not positive, SceneError for friction that falls too fast with speed.
    """

    def __init__(
        self,
        shafts: Sequence[Shaft],
        friction: WallFriction,
        step: float,
        *,
        law: DriveLaw | None,
        top: TopMotion,
        top_inertia: float = 0.0,
        bottom_inertia: float = 0.0,
        held: bool = False,
        damping: Sequence[float] = (),
        cells: int = 1,
    ) -> None:
        if not step > 0:
            raise ValueError(f"soft string: step = {step}: must be > 0")
        self.friction, self.step, self._reference = friction, float(step), top
        self.shafts, self._damping = merged(shafts, damping or [0.0] * len(shafts), step)
        inertia = law.inertia if law is not None else top_inertia
        self.driven = law is not None
        self._law = law or DriveLaw(0.0, 0.0, math.inf, inertia, 0.0)
        times = [x.travel_time for x in self.shafts]
        longest = min(step, math.fsum(times) / cells)
        finest = longest / FINER
        while (steep := self._lay(longest)) > STEEPEST:
            longest /= 2
            if longest < finest:
                most = friction.velocity_scale * STEEPEST / steep
                raise SceneError(
                    f"contact.friction_velocity_scale = {friction.velocity_scale:g}: must be at most {most:.3g} for "
                    f"time.step = {step:g} s, or friction falls faster with speed than the string can follow; "
                    "soft_string.law = 'coulomb' is the limit of a large one"
                )
        self._rules = Rules(
            friction.law == COULOMB,
            friction.threshold,
            friction.regularisation,
            bool(self._firm.any()),
            law is None,
            inertia,
            bottom_inertia,
            held,
        )
        self.reset()

    def _lay(self, longest: float) -> float:
        """Lay the grid with steps of at most ``longest`` (s); returns how fast friction falls, over the impedance."""
        dt, counts, self.travel_time_error = wave_step([x.travel_time for x in self.shafts], longest, TRAVEL_TIME)
        self.internal_step = dt
        impedance, size, late = (
            np.repeat(x, counts)
            for x in (
                np.array([x.impedance for x in self.shafts]),
                np.array([x.length for x in self.shafts]) / counts,
                self._damping,
            )
        )
        self._impedance = impedance
        stiffness = np.repeat([x.stiffness for x in self.shafts], counts)
        self._firm = late * stiffness / size
        #: arc lengths of the nodes, m
        self.arc_length: F8 = np.concatenate([[0.0], np.cumsum(size)])
        s, friction, n = self.arc_length, self.friction, len(size)
        # a node has the half cells on either side
        edges = np.unique(np.clip(np.concatenate([s, s[:-1] + size / 2, friction.breaks]), s[0], s[-1]))
        x, share = np.polynomial.legendre.leggauss(4)
        middle, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
        at = (middle[:, None] + half[:, None] * x).ravel()
        weight = (half[:, None] * share).ravel()
        node = np.clip(np.searchsorted(s[:-1] + size / 2, at), 0, n)

        def gather(values: F8) -> F8:
            return np.asarray(np.bincount(node, weight * values, n + 1), np.float64)

        static, dynamic = friction.torque(at)
        nodes = np.zeros((n + 1, 6))
        nodes[:, STATIC], nodes[:, DYNAMIC] = gather(static), gather(dynamic)
        nodes[:, PEAK] = 2 * np.sqrt(nodes[:, STATIC] * (nodes[:, STATIC] - nodes[:, DYNAMIC]).clip(0.0))
        nodes[:, SCALE] = friction.velocity_scale * gather(friction.arm(at)) / gather(np.ones_like(at))
        nodes[:, DRAG] = gather(friction.drag(at))
        nodes[:-1, RESIST] += impedance
        nodes[1:, RESIST] += impedance
        steep = 0.0 if friction.law == COULOMB else (nodes[:, PEAK] * nodes[:, SCALE] / 8 / nodes[:, RESIST]).max()
        nodes[:, RESIST] += nodes[:, DRAG]
        self._nodes = nodes
        return float(steep)

    # -- state ------------------------------------------------------------------------------------------------
    def reset(self, spin: float | F8 = 0.0) -> None:
        """Start at time 0.

        spin: of the whole string (rad/s), which friction at that spin has twisted, with the drive in balance; 0: at
        rest, without twist. Or spins (n,) at the nodes, of a string without twist.
        """
        n = len(self._impedance)
        s = self._s = np.zeros(11)
        self._w = np.array(np.broadcast_to(spin, n + 1), np.float64)
        start = float(self._w[0])
        moment: F8 = np.zeros(n + 1)
        turning = np.ndim(spin) == 0 and start != 0.0
        if turning:
            taken = [self._rubbing(i, start) + self._nodes[i, DRAG] * start for i in range(n + 1)]
            moment = -np.cumsum(taken[::-1])[::-1]
        mean, b_less_a = (self._w[1:] + self._w[:-1]) / 2, moment[1:] / self._impedance
        self._down, self._up = (mean - b_less_a) / 2, (mean + b_less_a) / 2
        s[TOP_SPEED], s[BIT_SPEED] = start, 0.0 if self._rules.held else self._w[-1]
        law, rules = self._law, self._rules
        asked = float(self._reference(np.zeros(1))[1][0])
        torque = -float(moment[0])
        if self.driven and turning and law.integral > 0:
            s[ERROR] = (torque - law.proportional * (asked - start)) / law.integral
        elif self.driven:
            torque = float(np.clip(wanted(law, 0.0, asked - start, 0.0), -law.limit, law.limit))
        self.count = self._node = 0
        _energies(self._impedance, self._down, self._up, s, rules, self.internal_step)
        row = np.zeros(len(OUTPUTS))
        row[1:4] = torque, asked if rules.imposed else start, s[BIT_SPEED]
        row[5], row[6], row[7] = row[1] * row[2], s[KINETIC], s[STRAIN]
        self._rub = np.array([self._rubbing(i, w) for i, w in enumerate(self._w)])
        row[12] = self._rub.sum()
        self._hold = np.stack([row, row])
        self._seen, self._moment = np.stack([self._w] * 2), np.stack([moment[1:]] * 2)

    def _rubbing(self, i: int, spin: float) -> float:
        return float(_rub(self._rules, self._nodes[i], spin))

    @property
    def time(self) -> float:
        """Time reached, s."""
        return self.count * self.step

    @property
    def break_off_torque(self) -> float:
        """Torque (N m) at the top at which the whole string turns, by static friction."""
        return float(self._nodes[:, STATIC].sum())

    @property
    def counters(self) -> dict[str, int]:
        """Steps inside, and iterations."""
        return {"steps": self._node, "newton_iterations": int(self._s[ITERATIONS])}

    def _when(self, counts: I8) -> tuple[I8, F8]:
        """Steps whose middle is at or behind the times of output numbers ``counts``, and the place before it."""
        at = counts * (self.step / self.internal_step)
        steps = np.maximum(np.ceil(at - 0.5 - 1e-9), 0).astype(np.int64)
        before = np.where(steps > 0, steps - 0.5, 0.0)
        return steps, (at - before) / (steps + 0.5 - before)

    def sample(self) -> dict[str, float]:
        """The outputs now (names of OUTPUTS)."""
        row = self._hold[1]
        if self.count:
            x = self._when(np.array([self.count]))[1][0]
            row = self._hold[0] + x * (self._hold[1] - self._hold[0])
        return dict(zip(OUTPUTS, (float(x) for x in row), strict=True)) | {"time": self.time}

    def advance(self, steps: int, every: int = 1) -> dict[str, F8]:
        """March; returns the outputs at step numbers that ``every`` divides.  Chunks of any size agree to the bit.

        Raises SimulationError where the nodes of a damped string cannot be solved.
        """
        numbers = np.arange(self.count + 1, self.count + steps + 1)
        at, fractions = self._when(numbers)
        last = int(at[-1]) + 1 if steps else self._node
        asked = self.internal_step * np.arange(self._node, max(last, self._node) + 1, dtype=np.float64)
        due = numbers % every == 0
        rows = np.empty((int(due.sum()), len(OUTPUTS)))
        # an output between the same middles as the last one needs no step
        early = at[due] < self._node
        x = fractions[due][early, None]
        rows[: len(x)] = self._hold[0] + x * (self._hold[1] - self._hold[0])
        failed = _march(
            self._rules,
            self._law,
            self._nodes,
            self._firm,
            self._impedance,
            self._down,
            self._up,
            self._w,
            self._s,
            self._node,
            last,
            self.internal_step,
            np.stack(self._reference(asked), axis=1),
            at[due][~early],
            fractions[due][~early],
            self._hold,
            self._seen,
            self._moment,
            np.empty((7, len(self._w))),
            self._rub,
            rows[len(x) :],
        )
        if failed >= 0:
            raise SimulationError(
                f"the string's damping and friction could not be solved at t = {failed * self.internal_step:.6g} s: "
                "try a smaller time.step, or a smaller material.retardation_time"
            )
        self.count += steps
        self._node = max(last, self._node)
        rows[:, 0] = self.step * numbers[due]
        return dict(zip(OUTPUTS, np.ascontiguousarray(rows.T), strict=True))

    def fields(self) -> dict[str, F8]:
        """Spin (n,) rad/s, angle (n,) rad, torque G J phi' (n,) N m now at the nodes `arc_length`."""
        x = self._when(np.array([self.count]))[1][0] if self.count else 1.0
        spin = self._seen[0] + x * (self._seen[1] - self._seen[0])
        moment = self._moment[0] + x * (self._moment[1] - self._moment[0])
        turned = self.internal_step * np.cumsum(moment / self._impedance)
        inner = (moment[:-1] + moment[1:]) / 2
        ends = [1.5 * moment[0] - 0.5 * moment[1], 1.5 * moment[-1] - 0.5 * moment[-2]] if len(moment) > 1 else moment
        return {
            "spin": spin,
            "angle": self.sample()["top_angle"] + np.concatenate([[0.0], turned]),
            "torque": np.concatenate([ends[:1], inner, ends[-1:]]),
        }

    def state_dict(self) -> dict[str, Any]:
        """Everything that changes in time, as arrays; `load` goes on as if never stopped, to the bit."""
        arrays = {"down": self._down, "up": self._up, "spin": self._w, "scalars": self._s, "hold": self._hold}
        arrays |= {"seen": self._seen, "moment": self._moment}
        state: dict[str, Any] = {name: array.copy() for name, array in arrays.items()}
        return state | {"count": self.count, "node": self._node}

    def load(self, state: dict[str, Any]) -> None:
        """Take over a state of `state_dict` of a string made in the same way."""
        self._down[:], self._up[:], self._w[:] = state["down"], state["up"], state["spin"]
        self._s[:], self._hold[:] = state["scalars"], state["hold"]
        self._seen[:], self._moment[:] = state["seen"], state["moment"]
        self.count, self._node = int(state["count"]), int(state["node"])


# -- runs of scenes -------------------------------------------------------------------------------------------
class SoftStringRun:
    """A scene's soft string, with the history and the fields of a rod in contact."""

    energy_error = 0.0

    def __init__(self, scene: Scene) -> None:
        announce()
        self.scene, self.line = scene, line_of(scene)
        drive, ends, start = scene.top_drive, scene.ends, scene.time.start

        def top(times: F8) -> tuple[F8, F8]:
            if drive.profile is None and drive.rise_time is None:  # the usual case, at once
                speed = (drive.speed or 0.0) * np.ones_like(times)
                return speed * (times + start), speed
            motions = [drive.motion(float(t)) for t in times + start]
            return np.array([m[0] for m in motions]), np.array([m[1] for m in motions])

        law = law_of(scene)
        if ends.top in ("hung", "pinned", "free"):  # free to spin
            law = DriveLaw(0.0, 0.0, math.inf, ends.top_inertia, 0.0)
        self.friction = wall_friction(scene)
        self.string = SoftString(
            [Shaft(s.length, s.section_stiffness().torsion, 2 * s.rotary_inertia) for s in scene.string],
            self.friction,
            scene.time.step,
            law=law,
            top=top,
            top_inertia=ends.top_inertia,
            bottom_inertia=ends.bottom_inertia,
            held=ends.bottom == "clamped",
            damping=[s.retardation_time for s in scene.string],
            cells=scene.mesh.elements,
        )
        moving = {"given": scene.initial.angular_velocity[2], "nominal": drive.speed or 0.0}
        self.string.reset(moving.get(scene.initial.state, 0.0))
        self.model, self.dofs = "soft-string", 2 * len(self.string.arc_length)
        wall = {name: WALL[name] for name in ("side_force", "wall_torque")}
        self.variables = COMMON | dict.fromkeys(WORKS, "J") | TURNING | wall
        first, s = self.string.sample(), self.string.arc_length
        self.stored_at_start = first["kinetic_energy"] + first["strain_energy"]
        self.scale = 0.0
        #: force on the wall per length (n,) at the nodes, N/m, and all of it, N
        self.side_load = self.line.side_load(s, scene.soft_string.side_load)
        self.side_force = float(np.trapezoid(self.side_load, s))
        self._frame = self.line.hole.frame(s)
        self._sideways = _across(self._frame.tangent)

    def history(self, rows: dict[str, Any]) -> tuple[F8, dict[str, F8]]:
        """Times (n,) and history arrays (n,) from the engine's rows; updates the error of the energy balance."""
        rows = {name: np.atleast_1d(values) for name, values in rows.items()}
        still = np.zeros_like(rows["time"])
        rows |= dict.fromkeys(("work_gravity", "work_hook_load", "work_bit", "bit_axial_speed"), still)
        rows["hook_load"] = still + float(self.line.hanging(np.zeros(1))[0])
        rows["side_force"] = still + self.side_force
        stored = rows["kinetic_energy"] + rows["strain_energy"]
        error, self.scale = imbalance({name: rows[name] for name in WORKS}, stored, self.stored_at_start, self.scale)
        self.energy_error = float(error[-1])
        return rows["time"] + self.scene.time.start, {name: rows[name] for name in self.variables}

    def fields(self) -> dict[str, F8]:
        """Fields along the string now: it lies on the axis of its hole."""
        s, found, frame = self.string.arc_length, self.string.fields(), self._frame
        first, second = self._sideways
        angle, none = found["angle"][:, None], np.zeros(len(s))
        return {
            "arc_length": s,
            "outer_diameter": outer_diameter(self.scene, s),
            "position": frame.position,
            "director1": np.cos(angle) * first + np.sin(angle) * second,
            "director3": frame.tangent,
            "axial_force": self.line.hanging(s),
            "torque": found["torque"],
            "bending_moment": self.line.at(s).bending * frame.dogleg_severity,
            "spin": found["spin"],
            "axial_speed": none,
            "angle": found["angle"],
            "wall_arc_length": s,
            "wall_depth": s,
            "wall_gap": none,
            "wall_side_force": self.side_load,
        }

    def save(self) -> dict[str, Any]:
        """State for a checkpoint."""
        return {"string": self.string.state_dict(), "scale": self.scale}

    def load(self, state: dict[str, Any]) -> None:
        """Continue from a saved state."""
        self.string.load(state["string"])
        self.scale = float(state["scale"])


def _across(tangent: F8) -> tuple[F8, F8]:
    """Two unit vectors (n, 3) across tangents (n, 3), carried along without turning about them."""
    first = np.empty_like(tangent)
    seed = np.array([1.0, 0.0, 0.0]) if abs(tangent[0, 0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    here = seed - (seed @ tangent[0]) * tangent[0]
    for i, t in enumerate(tangent):
        if i:
            # the smallest rotation from one tangent to the next
            old = tangent[i - 1]
            here = here - (here @ t) / (1.0 + old @ t) * (old + t)
        first[i] = here = here / np.linalg.norm(here)
    return first, np.asarray(np.cross(tangent, first), np.float64)


def run_soft_string(
    scene: Scene, writer_of: Callable[..., ResultWriter], until: float, progress: Callable[[float], None]
) -> Result:
    """March a soft string to ``until``, writing as it goes."""
    return march(scene, SoftStringRun(scene), writer_of, until, progress)
