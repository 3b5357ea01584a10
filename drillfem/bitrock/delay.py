"""The lumped model as a delay equation whose delays depend on the state (5-20): an oracle without a rock surface.

A blade at the angle phi meets the rock that the blade k places ahead of it left there when it passed, at the time t_k
with phi(t) - phi(t_k) = 2 pi k / n: k = 1 in steady drilling, larger k behind a bit that was off bottom, and k <= 0
where a bit that turned backwards covers its own track again, or that of the blades behind.  The rock ahead is the
deepest of all these passages, and only passages in the direction of drilling cut.  So

    M u'' = W_0 - W(u', phi', d)    I phi'' = C (theta - phi) + D (theta' - phi') - T(u', phi', d)
    d(t) = n (u(t) - max_k u(t_k))

is integrated with an implicit Runge-Kutta method that divides its steps where the bit lands, leaves or turns back.
Nothing is shared with the surfaces of `drillfem.bitrock.surface` or the solver of `drillfem.bitrock.solve`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import Radau
from scipy.optimize import brentq

from drillfem.bitrock.jit import kernel
from drillfem.bitrock.law import BitLaw, law_forces
from drillfem.errors import SimulationError

if TYPE_CHECKING:
    from drillfem.scene import Scene

F8 = NDArray[np.float64]
I8 = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class LumpedBit:
    """The lumped model and its start; SI units, or those of any consistent system.

    ``law`` with regularised jumps (all three widths > 0).  ``top``: constant speed of the top (rad/s), or a function of
    time that returns (angle, speed).  ``advance``: slope of the rock in front of the blades at the start, m/rad.
    ``angle``, ``spin``, ``axial_speed``: of the bit at time 0, where its depth is 0.
    """

    mass: float
    inertia: float
    stiffness: float
    weight_on_bit: float
    law: BitLaw
    top: float | Callable[[float], tuple[float, float]]
    advance: float
    angle: float
    spin: float
    axial_speed: float
    damping: float = 0.0

    @classmethod
    def steady(
        cls,
        *,
        mass: float,
        inertia: float,
        stiffness: float,
        weight_on_bit: float,
        law: BitLaw,
        speed: float,
        perturbation: float = 0.0,
        damping: float = 0.0,
    ) -> LumpedBit:
        """Steady drilling at the top's ``speed`` (rad/s), the bit turning faster by the fraction ``perturbation``."""
        cut = law.depth_of_cut(weight_on_bit)
        return cls(
            mass=mass,
            inertia=inertia,
            stiffness=stiffness,
            weight_on_bit=weight_on_bit,
            law=law,
            top=speed,
            advance=cut / (2 * np.pi),
            angle=-law.torque(cut) / stiffness,
            spin=speed * (1.0 + perturbation),
            axial_speed=cut * speed / (2 * np.pi),
            damping=damping,
        )

    @classmethod
    def from_scene(cls, scene: Scene) -> LumpedBit:
        """The lumped model of a scene with a cutting bit and a top of constant speed, in its initial state."""
        from drillfem.scene.nominal import lumps

        if scene.top_drive.speed is None:
            raise ValueError("delay equation: the top must turn at a constant speed")
        stiffness, inertia, mass, late = lumps(scene)
        return cls.steady(
            mass=mass,
            inertia=inertia,
            stiffness=stiffness,
            weight_on_bit=scene.nominal().weight_on_bit,
            law=BitLaw.from_scene(scene),
            speed=scene.top_drive.speed,
            perturbation=scene.initial.spin_perturbation,
            damping=late * stiffness,
        )


# columns of a track: time, depth, axial speed, angle, spin
TIME, DEPTH, SPEED, ANGLE, SPIN = range(5)


@kernel(lean=True)
def _hermite(h: float, a: float, da: float, b: float, db: float, x: float) -> float:
    y = 1.0 - x
    return a * y * y * (1.0 + 2.0 * x) + b * x * x * (3.0 - 2.0 * x) + h * x * y * (da * y - db * x)


@kernel(lean=True)
def _passed(track: F8, a: int, angle: float) -> float:
    """Depth at which the bit passed ``angle``, between the knots number a and a + 1 of its track."""
    b = a + 1
    h, lo, hi = track[b, TIME] - track[a, TIME], 0.0, 1.0
    span = track[b, ANGLE] - track[a, ANGLE]
    x = (angle - track[a, ANGLE]) / span if span > 0.0 else 0.0
    for _ in range(60):  # Newton's method, kept in brackets: where within the step the angle was reached
        miss = _hermite(h, track[a, ANGLE], track[a, SPIN], track[b, ANGLE], track[b, SPIN], x) - angle
        if miss > 0.0:
            hi = x
        else:
            lo = x
        rate = (track[a, SPIN] * (1.0 - x) + track[b, SPIN] * x) * h
        new = x - miss / rate if rate > 0.0 else 0.5 * (lo + hi)
        if not lo < new < hi:
            new = 0.5 * (lo + hi)
        if abs(new - x) <= 1e-15 or miss == 0.0:
            break
        x = new
    return _hermite(h, track[a, DEPTH], track[a, SPEED], track[b, DEPTH], track[b, SPEED], x)


@kernel(lean=True)
def _rock(
    track: F8, highest: F8, runs: I8, count: int, own: bool, angle: float, sector: float, advance: float, most: int
) -> tuple[float, int]:
    """Height of the rock at ``angle``, and the number k of the passage that left it (below 0: by a blade behind).

    ``runs`` (count, 2): first and last knot of each stretch of the track in the direction of drilling; ``own``: the
    last of them is under way, so that it does not count for k = 0.  ``highest``: greatest depth of the stretch so far,
    at each knot.  ``most``: number of passages looked at (1 is the wrong model of a bit that never bounces).
    """
    best, passage, start, top = -np.inf, 0, track[0, ANGLE], angle
    for r in range(count):
        top = max(top, track[runs[r, 1], ANGLE])
    for k in range(-int((top - angle) / sector), most + 1):
        x = angle - k * sector
        if x < start and advance * (x - start) > best:  # rock that was there before
            best, passage = advance * (x - start), k
        bound, deepest = -np.inf, -np.inf
        for r in range(count):
            lo, hi = runs[r, 0], runs[r, 1]
            if k == 0 and own and r == count - 1:
                bound = np.inf
                continue
            if hi <= lo or track[lo, ANGLE] > x:
                continue
            reached = track[hi, ANGLE] >= x
            while hi - lo > 1:
                middle = (lo + hi) // 2
                if track[middle, ANGLE] <= x:
                    lo = middle
                else:
                    hi = middle
            # no passage at this angle or a smaller one was deeper
            bound = max(bound, highest[hi])
            if reached and highest[hi] > best:
                deepest = max(deepest, _passed(track, lo, x))
        if deepest > best:
            best, passage = deepest, k
        if bound <= best:
            break
    return best, passage


class _Track:
    """The history of the bit: knots of its path, in growing arrays."""

    def __init__(self, knot: F8, forward: bool) -> None:
        self.knots: F8 = np.empty((1024, 5))
        self.highest: F8 = np.empty(1024)
        self.runs: I8 = np.zeros((64, 2), np.int64)
        self.size = self.count = 0
        self.forward = False
        self.append(knot)
        self.turn(forward)

    def turn(self, forward: bool) -> None:
        """From the last knot on the bit turns ``forward`` or not."""
        if forward and not self.forward:
            if self.count == len(self.runs):
                self.runs = np.concatenate([self.runs, np.zeros_like(self.runs)])
            self.runs[self.count] = self.size - 1
            self.highest[self.size - 1] = self.knots[self.size - 1, DEPTH]
            self.count += 1
        self.forward = forward

    def append(self, knot: F8) -> None:
        """A knot more, at the end of a step."""
        if self.size == len(self.knots):
            self.knots = np.concatenate([self.knots, np.empty_like(self.knots)])
            self.highest = np.concatenate([self.highest, np.empty_like(self.highest)])
        self.knots[self.size] = knot
        before = self.highest[self.size - 1] if self.size and self.forward else -np.inf
        self.highest[self.size] = max(before, knot[DEPTH])
        if self.forward:
            self.runs[self.count - 1, 1] = self.size
        self.size += 1

    def rock(self, angle: float, sector: float, advance: float, most: int) -> tuple[float, int]:
        """Height of the rock at an angle, and which passage left it."""
        return _rock(self.knots, self.highest, self.runs, self.count, self.forward, angle, sector, advance, most)


def delay_equation(
    bit: LumpedBit, end: float, rtol: float = 1e-8, *, step: float = 1e-3, passages: int | None = None
) -> dict[str, F8]:
    """Integrate the delay equation to time ``end``; the outputs at multiples of ``step``.

    Parameters
    ----------
    rtol : tolerance of a step, relative to the sizes of steady drilling.
    passages : look at so many earlier passages only; 1 is the equation with one delay, wrong after a bounce.

    Returns
    -------
    Arrays named as in a history: time, bit_depth, bit_axial_speed, bit_angle, bit_angular_speed, depth_of_cut,
    bit_weight, bit_torque; and ``passage`` (k of the passage that left the rock ahead), ``steps`` (times of the
    integrator's own steps).  SimulationError if the integrator gives up.
    """
    law, blades, par = bit.law, bit.law.blades, bit.law.array
    widths = (law.axial_regularisation, law.torsional_regularisation, law.cutting_regularisation)
    if not (end > 0 and step > 0 and rtol > 0) or min(widths) <= 0:
        raise ValueError(f"delay equation: end {end}, step {step}, rtol {rtol}, widths {widths}: all must be > 0")
    sector, most, top = 2 * np.pi / blades, 10**9 if passages is None else passages, bit.top
    # state: depth, axial speed, angle, spin
    t, y = 0.0, np.array([0.0, bit.axial_speed, bit.angle, bit.spin])
    sizes = np.array([bit.advance, abs(bit.axial_speed) + widths[0], 1.0, abs(bit.spin) + widths[1]])
    track, contact = _Track(np.append(t, y), bit.spin > 0), True

    def gap(y: F8) -> tuple[float, int]:
        rock, passage = track.rock(float(y[2]), sector, bit.advance, most)
        return float(y[0]) - rock, passage

    def forces(y: F8) -> tuple[float, float]:
        cut = blades * gap(y)[0] if contact else -1.0
        return law_forces(par, float(y[1]), float(y[3]), cut, 1.0 if contact else 0.0)[:2]

    def rates(t: float, y: F8) -> F8:
        weight, torque = forces(y)
        angle, speed = top(t) if callable(top) else (top * t, top)
        moment = bit.stiffness * (angle - y[2]) + bit.damping * (speed - y[3]) - torque
        return np.array([y[1], (bit.weight_on_bit - weight) / bit.mass, y[3], moment / bit.inertia])

    def distance(time: float, path: Callable[[float], F8], turning: bool) -> float:
        """Positive while the bit goes on touching the rock or not, or turning the way it does."""
        state = path(time)
        value, now = (float(state[3]), track.forward) if turning else (gap(state)[0], contact)
        return value if now else -value

    def switch(path: Callable[[float], F8], begin: float, stop: float) -> tuple[float, bool] | None:
        """First time of a step at which that changes, and whether it is the turning that does; None if nothing does."""
        for late in np.linspace(begin, stop, 5)[1:]:
            found = []
            for turning in (False, True):
                if distance(float(late), path, turning) < 0:
                    at = begin
                    if distance(begin, path, turning) > 0:
                        at = float(brentq(distance, begin, float(late), (path, turning), xtol=1e-15))
                    found.append((at, turning))
            if found:
                return min(found)
            begin = float(late)
        return None

    rows: list[tuple[float, ...]] = []
    taken, idle = [t], 0

    def record(time: float, y: F8) -> None:
        depth, passage = gap(y)
        rows.append((time, *y, depth * blades, *forces(y), passage))

    record(t, y)
    while t < end:
        # the law has one form until the bit lands, leaves or turns back: then the integrator starts anew
        solver, change = Radau(rates, t, y, end, rtol=rtol, atol=rtol * sizes), None
        while solver.status == "running" and change is None:
            # shorter than the least delay, so that what lies ahead is known
            solver.max_step = 0.4 * sector / max(abs(solver.y[3]), 1e-2 * sizes[3])
            message = solver.step()
            if solver.status == "failed":
                raise SimulationError(f"delay equation: no step from {solver.t:.6g} s on: {message}")
            path = solver.dense_output()
            change = switch(path, float(solver.t_old), float(solver.t))
            t = float(solver.t) if change is None else change[0]
            while len(rows) * step <= min(t, end) * (1 + 1e-12):
                record(len(rows) * step, path(len(rows) * step))
            y = solver.y if change is None else path(t)
            if t > taken[-1]:
                track.append(np.append(t, y))
                taken.append(t)
                idle = 0
        if change is not None and change[1]:
            track.turn(not track.forward)
        elif change is not None:
            contact = not contact
        idle += 1
        if idle > 1000:
            raise SimulationError(f"delay equation: at {t:.6g} s the bit neither rests on the rock nor leaves it")
    names = ("time", "bit_depth", "bit_axial_speed", "bit_angle", "bit_angular_speed", "depth_of_cut", "bit_weight")
    columns = dict(zip((*names, "bit_torque", "passage"), np.array(rows).T, strict=True))
    return columns | {"steps": np.array(taken)}
