"""Soft-string torque and drag: tension and torque of a string that slides or turns steadily in its hole.

With the effective tension F, the torque M handed down, and the force N on the wall per length
(`drillfem.models.soft_string`)

    dF/ds = -w cos(inclination) + mu N (share of the motion that goes down the hole)
    dM/ds = -mu N r (share that goes about it)

from the bit upwards: F = -(weight on bit), M = torque on bit at its lower end (Johancsik, Friesen and Dawson, SPE
11380, 1984, as a differential equation; Sheppard, Wick and Burgess, SPE 15463, 1987). Runge-Kutta steps of fourth order
between the places where anything jumps. `stations` is Johancsik's own sum over the stations of a survey, of first
order.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..bitrock.jit import kernel
from ..boreholes import Borehole
from ..models.soft_string import Line
from .limits import HELICAL, VERTICAL_HELICAL
from .operation import Operation, Profile, shares

F8 = NDArray[np.float64]

SPACING = 5.0
"""Longest step, m."""
_EDGE = 1e-9  # of a piece: how far from its ends its end values are taken


@kernel(lean=True)
def _slopes(row: F8, tension: float, helix: float):  # type: ignore[no-untyped-def]
    """dF/ds, dM/ds and N at a point: ``row`` as `_points` gives it; ``helix``: 0 leaves the wound string out."""
    x = row[0] * tension + row[3]
    y = row[1] * tension + row[4]
    z = row[2] * tension + row[5]
    force = math.sqrt(x * x + y * y + z * z)
    if helix > 0.0 and tension < 0.0:
        bending, room = row[10], row[11]
        limit = max(HELICAL * math.sqrt(bending * force / room), row[12])
        if -tension > limit:
            force += room * tension * tension / (4.0 * bending)
    return -row[6] + row[7] * force, -row[8] * force * row[9], force


@kernel(lean=True)
def _integrate(steps: F8, rows: F8, tension: float, torque: float, helix: float, out: F8) -> None:
    """From the lower end up. steps (n,), rows (n, 3, 13): at the upper end, middle and lower end of each step.

    out (n + 1, 3): tension, torque and side force; the latter the mean of both sides where it jumps.
    """
    n = steps.size
    out[n, 0], out[n, 1] = tension, torque
    out[n, 2] = _slopes(rows[n - 1, 2], tension, helix)[2]
    for j in range(n):
        i = n - 1 - j
        h = -steps[i]
        f = out[i + 1, 0]
        f1, m1, _n1 = _slopes(rows[i, 2], f, helix)
        f2, m2, _n2 = _slopes(rows[i, 1], f + 0.5 * h * f1, helix)
        f3, m3, _n3 = _slopes(rows[i, 1], f + 0.5 * h * f2, helix)
        f4, m4, _n4 = _slopes(rows[i, 0], f + h * f3, helix)
        out[i, 0] = f + h * (f1 + 2.0 * f2 + 2.0 * f3 + f4) / 6.0
        out[i, 1] = out[i + 1, 1] + h * (m1 + 2.0 * m2 + 2.0 * m3 + m4) / 6.0
        above = _slopes(rows[i, 0], out[i, 0], helix)[2]
        if i > 0:
            above = 0.5 * (above + _slopes(rows[i - 1, 2], out[i, 0], helix)[2])
        out[i, 2] = above


def _points(line: Line, operation: Operation, spacing: float, friction: str) -> tuple[F8, F8, F8]:
    """Nodes (n + 1,), steps (n,), and what `_slopes` needs at the three points of each step (n, 3, 13)."""
    breaks = line.breaks
    breaks = breaks[np.append(np.diff(breaks) > 1e-9, True)]
    breaks[-1] = line.length
    count = np.maximum(1, np.ceil(np.diff(breaks) / spacing)).astype(int)
    pieces = zip(breaks[:-1], breaks[1:], count, strict=True)
    nodes: F8 = np.concatenate([[0.0], *(np.linspace(a, b, k + 1)[1:] for a, b, k in pieces)])
    steps = np.diff(nodes)
    inset = _EDGE * np.repeat(np.diff(breaks), count)
    at = np.stack([nodes[:-1] + inset, nodes[:-1] + steps / 2, nodes[1:] - inset], axis=1)
    here = line.at(at.ravel())
    along, about = shares(operation, here.radius)
    mu = here.static if friction == "static" else here.dynamic
    weight = np.hypot(np.linalg.norm(here.across, axis=1), here.along)
    vertical = VERTICAL_HELICAL * np.cbrt(here.bending * weight**2)
    columns = [*here.curvature.T, *here.across.T, here.along, mu * along, mu * about, here.radius]
    rows = np.stack([*columns, here.bending, here.clearance, vertical], axis=1)
    return nodes, steps, np.ascontiguousarray(rows.reshape(len(steps), 3, -1))


def soft_string(
    line: Line, operation: Operation, *, friction: str = "dynamic", buckled: bool = True, spacing: float = SPACING
) -> Profile:
    """Torque and drag of a string for an operation.

    friction: which coefficient of the wall, "dynamic" or "static" (to break it loose). buckled: a string that is wound
    into a helix presses on the wall with r F^2/(4 EI) more. spacing: longest step, m.
    """
    nodes, steps, rows = _points(line, operation, spacing, friction)
    out = np.empty((len(nodes), 3))
    lowest = line.below - operation.weight_on_bit
    _integrate(steps, rows, lowest, operation.torque_on_bit, float(buckled), out)
    return Profile("soft", operation, nodes, out[:, 0].copy(), out[:, 1].copy(), out[:, 2].copy())


def johancsik(
    length: F8,
    inclination: F8,
    build: F8,
    turn: F8,
    weight: F8,
    friction: tuple[F8, F8],
    radius: F8,
    lowest: tuple[float, float],
) -> tuple[F8, F8, F8]:
    """Johancsik's sum over elements (n,) from the top down: tension (n + 1,), torque (n + 1,), normal force (n,).

    length (m) of elements; their mean inclination, build and turn: gain of inclination and azimuth down the hole (rad);
    weight in N/m; friction along (positive: down) and about the hole; radius in m; tension (N) and torque (N m) at the
    lower end. The normal force (N) takes the tension at the lower end of its element, as the paper does.
    """
    n = len(length)
    tension, torque, normal = np.empty(n + 1), np.empty(n + 1), np.empty(n)
    tension[n], torque[n] = lowest
    for i in range(n - 1, -1, -1):
        heavy = weight[i] * length[i]
        level, f = math.sin(inclination[i]), tension[i + 1]
        normal[i] = math.hypot(f * build[i] - heavy * level, f * turn[i] * level)
        tension[i] = f + heavy * math.cos(inclination[i]) - friction[0][i] * normal[i]
        torque[i] = torque[i + 1] + friction[1][i] * normal[i] * radius[i]
    return tension, torque, normal


def stations(line: Line, operation: Operation, *, friction: str = "dynamic", spacing: float | None = None) -> Profile:
    """The same by Johancsik's sum, over the survey's stations (or every ``spacing`` m) and the joints of the string."""
    hole: Borehole = line.hole
    count = max(2, math.ceil(line.length / (spacing or 30.0)) + 1)
    at: F8 = np.linspace(0.0, line.length, count, dtype=np.float64)
    if spacing is None and hole.stations is not None:
        at = hole.stations[:, 0]
    s = np.unique(np.concatenate([at[(at >= 0) & (at <= line.length)], line.joints]))
    frame, here = hole.frame(s), line.at((s[1:] + s[:-1]) / 2)
    mean = (frame.inclination[1:] + frame.inclination[:-1]) / 2
    azimuth = np.diff(frame.azimuth)
    # a vertical hole has no azimuth, and north may be crossed
    turn = np.where(np.minimum(frame.inclination[1:], frame.inclination[:-1]) > 1e-9, azimuth, 0.0)
    turn = (turn + np.pi) % (2 * np.pi) - np.pi
    along, about = shares(operation, here.radius)
    mu = here.static if friction == "static" else here.dynamic
    weight = np.hypot(np.linalg.norm(here.across, axis=1), here.along)
    lowest = line.below - operation.weight_on_bit, operation.torque_on_bit
    tension, torque, normal = johancsik(
        np.diff(s), mean, np.diff(frame.inclination), turn, weight, (mu * along, mu * about), here.radius, lowest
    )
    # per length, at the ends of elements
    force = normal / np.diff(s)
    side = np.concatenate([force[:1], (force[1:] + force[:-1]) / 2, force[-1:]])
    return Profile("stations", operation, s, tension, torque, side)


def hook_loads(line: Line, operation: Operation, depths: F8, **how: object) -> F8:
    """Hook load (n,) in N with the lower end at measured depths (n,): `Line.to_depth`."""
    return np.array([soft_string(line.to_depth(float(d)), operation, **how).hook_load for d in depths])  # type: ignore[arg-type]


def lock_up_depth(line: Line, operation: Operation, **how: object) -> float | None:
    """Least measured depth (m) of the lower end at which the hook load is used up: no further without a push.

    None: the string gets to its depth. Looked for every 20 m, then by bisection.
    """
    count = max(2, math.ceil(line.length / 20.0))
    depths: F8 = np.linspace(min(20.0, line.length), line.length, count, dtype=np.float64)
    short = np.flatnonzero(hook_loads(line, operation, depths, **how) <= 0)
    if not len(short):
        return None
    low, high = (float(depths[short[0] - 1]) if short[0] else 0.0), float(depths[short[0]])
    while high - low > 0.01:
        middle = (low + high) / 2
        if hook_loads(line, operation, np.array([middle]), **how)[0] <= 0:
            high = middle
        else:
            low = middle
    return high


def greatest_weight(line: Line, operation: Operation, **how: object) -> float:
    """Greatest weight on bit (N) that the string's own weight can push: that which leaves no hook load. 0: none."""

    def hook(weight: float) -> float:
        return soft_string(line, replace(operation, weight_on_bit=weight), **how).hook_load  # type: ignore[arg-type]

    low, high = 0.0, float((line.pieces.weight * line.pieces.length).sum()) + line.below
    if hook(low) <= 0:
        return 0.0
    while high - low > 1e-6 * high:
        middle = (low + high) / 2
        low, high = (middle, high) if hook(middle) > 0 else (low, middle)
    return low
