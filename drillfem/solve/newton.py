"""Newton's method for a rod with a bit in rock, whoever assembles and factorises (:class:`System`).

Two ideas make it robust and fast.

**Condensation to the bit.** The wear-flat force climbs over 1e-5 m/s: its slope dwarfs the string's impedance, and
plain Newton flips between its branches. Here the string is linearised, the rock is not: with the string's compliance
at the bit (two extra columns of the factorised Jacobian) every iteration ends with the exact
solution of the 2x2 bit problem.

**A Jacobian that turns with the string.** A kept factorisation goes stale as the string spins. For sections with equal
bending stiffness the system is equivariant under a turn of every section about its own axis, so the kept Jacobian is
used in the frame that has turned since: P = T J0^-1 T^-1 with T the nodal turn. It is renewed when contraction slows.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..bitrock.jit import kernel
from ..compat import Array
from ..forms.ansatz import Spatial
from ..models.rod import Rod

#: Update below which an iteration has converged, in the unit of each component (m, 1, rad, m/s, rad/s).
TOLERANCE = {"r": 1e-9, "q": 1e-10, "t": 1e-10, "p": 1e-10, "v": 1e-8, "w": 1e-8, "h": 1e-9}
MAX_ITERATIONS = 25
#: contraction above which the kept Jacobian is renewed for the next solve, and at once
DRAGGING, STALLED = 0.1, 0.5
#: iterations that a kept Jacobian may still need
PATIENCE = 5
#: how often the multipliers of an augmented Lagrangian are moved in one solve
_MOST_UPDATES = 50


class BitLoad(Protocol):
    """The rock's answer to a string that is linear at the bit."""

    def respond(
        self,
        speed: float,
        speed_compliance: float,
        depth: float,
        depth_compliance: float,
        spin: float,
        spin_compliance: float,
        turn: float,
        turn_compliance: float,
    ) -> tuple[float, float]:
        """Weight (N) and torque (N m) where each motion is its free value minus compliance times load."""
        ...


class System(Protocol):
    """The equations of one step F(x) = 0, and their Jacobian at a state of some time ago."""

    #: d(stage)/dx: generalised-alpha solves for the end of the step, evaluates inside it
    stage_fraction: float

    def residual(self) -> Array:
        """F at the present x, shape (dofs,): a view, which may be overwritten. The rod takes the state of the stage."""
        ...

    def iterate(self, newton: BitCoupledNewton) -> Outcome | None:
        """All iterations of a rod without rock at once; None where the system cannot, with an x to go on from."""
        ...

    def settle(self) -> None:
        """Let the rod take the state of the stage at the present x, with its reactions."""
        ...

    def shift(self) -> float:
        """d(u-dot)/du of the stage at which the residual was evaluated last (1/s)."""
        ...

    def factorise(self) -> None:
        """Renew the Jacobian, at the stage at which the residual was evaluated last."""
        ...

    def solve(self, b: Array) -> Array:
        """J^-1 b, shape (dofs,): a view, which may be overwritten, valid until the next."""
        ...


class Outcome(Enum):
    """How a solve ended."""

    CONVERGED = 1
    SLOW = 2
    NAN = 3


@kernel()
def _turns(reference: Array, now: Array, cosine: Array, sine: Array) -> None:
    """Half angle of the turn about d3 between two sets of nodal quaternions (n, 4): cosine and sine (n,)."""
    for i in range(len(now)):
        a, b, c, d = reference[i]
        real = a * now[i, 0] + b * now[i, 1] + c * now[i, 2] + d * now[i, 3]
        along = -d * now[i, 0] + c * now[i, 1] - b * now[i, 2] + a * now[i, 3]
        size = np.sqrt(real * real + along * along)
        cosine[i] = real / size if size > 0 else 1.0
        sine[i] = along / size if size > 0 else 0.0


@kernel()
def _turn(y: Array, w: int, cosine: Array, sine: Array, way: float) -> None:
    """Turn nodal blocks of y (n, entries) about their own axis; w: where the angular velocity is; way -1: back."""
    for i in range(len(y)):
        c, s = cosine[i], way * sine[i]
        q0, q1, q2, q3 = y[i, 3], y[i, 4], y[i, 5], y[i, 6]
        y[i, 3], y[i, 4] = q0 * c - q3 * s, q1 * c + q2 * s
        y[i, 5], y[i, 6] = q2 * c - q1 * s, q3 * c + q0 * s
        c2, s2 = c * c - s * s, 2 * c * s
        w0, w1 = y[i, w], y[i, w + 1]
        y[i, w], y[i, w + 1] = w0 * c2 + w1 * s2, w1 * c2 - w0 * s2


@kernel()
def _extrapolate(x1: Array, x2: Array, x3: Array, out: Array) -> None:
    """Parabola through three values at equal distances, carried on by one distance."""
    for i in range(len(out)):
        out[i] = 3 * (x1[i] - x2[i]) + x3[i]


@kernel()
def _update(
    x: Array, y: Array, columns: Array, loads: tuple[float, float], w: int, cosine: Array, sine: Array, unit: Array
) -> float:
    """x -= T (y + columns . loads), T the turn; y (n,) becomes what is subtracted. Returns its largest entry in units.

    columns (2, n), not used where both loads are 0; w: see :func:`_turn`, 0 for no turn; unit (entries per node,): one
    over the tolerance of each.
    """
    for k in range(2):
        if loads[k] != 0.0:
            for i in range(len(y)):
                y[i] += columns[k, i] * loads[k]
    n = len(unit)
    if w:
        _turn(y.reshape((-1, n)), w, cosine, sine, 1.0)
    worst = 0.0
    for i in range(len(y)):
        x[i] -= y[i]
        size = abs(y[i]) * unit[i % n]
        if not size <= worst:  # also catches nan
            worst = size
    return worst


class _BitNode(NamedTuple):
    """Where the motion of the bit stands in the vector of unknowns; ``turn``: the place of the quaternion or angle."""

    depth: int
    speed: int
    spin: int
    turn: int
    quaternion: bool
    bends: bool  # speed and depth are those along the hole: the third components are the ones named


@kernel(lean=True)
def _motion(
    at: _BitNode, stage: Array, change: Array, factor: float, along: Array, c: float, s: float
) -> tuple[float, float, float, float]:
    """Change of depth, speed, turn and spin of the bit that belongs to ``factor`` times a change (n,) of a stage (n,).

    along (3,): direction of a hole that bends. c, s: cosine and sine of the half angle by which the change is turned.
    """
    k = at.turn
    if at.quaternion:
        q0, q1, q2, q3 = change[k], change[k + 1], change[k + 2], change[k + 3]
        q0, q1, q2, q3 = q0 * c - q3 * s, q1 * c + q2 * s, q2 * c - q1 * s, q3 * c + q0 * s
        a, b, d, e = stage[k], stage[k + 1], stage[k + 2], stage[k + 3]
        turn = 2 * (-e * q0 + d * q1 - b * q2 + a * q3) / (a * a + b * b + d * d + e * e)
    else:
        turn = change[k]
    depth, speed = change[at.depth], change[at.speed]
    if at.bends:
        i, j = at.depth - 2, at.speed - 2
        depth = change[i] * along[0] + change[i + 1] * along[1] + change[i + 2] * along[2]
        speed = change[j] * along[0] + change[j + 1] * along[1] + change[j + 2] * along[2]
    return factor * depth, factor * speed, factor * turn, factor * change[at.spin]


def turn_between(rotation_from: Any, rotation_to: Any) -> float:
    """Turn about the string's axis (rad, less than 2 pi) between two bit rotations: quaternions (4,) or angles."""
    if isinstance(rotation_from, float):
        return float(rotation_to - rotation_from)
    a, b, c, d = rotation_from.tolist()
    p, q, r, s = rotation_to.tolist()
    half = math.atan2(-d * p + c * q - b * r + a * s, a * p + b * q + c * r + d * s)
    # q and -q are the same rotation
    return 2 * (half - math.pi * round(half / math.pi))


class BitCoupledNewton:
    """Solves F(x; weight, torque) = 0 together with the bit-rock law.

    ``keep``: keep the factorised Jacobian (and turn it with the string); else renew it in every iteration.
    """

    def __init__(self, rod: Rod, bit: BitLoad | None, keep: bool = True) -> None:
        self.rod, self.bit, self.keep = rod, bit, keep
        self.iterations = 0
        self.factorisations = 0
        #: what kept the last solve from ending well, besides Newton's method
        self.complaint = ""
        #: start from the last three solutions; no guide where a step has several stages
        self.extrapolate = True
        #: where the bit was at the last accepted step
        self.start_rotation: Any = 0.0
        self.start_depth = 0.0
        self.factored_shift = 0.0
        self.renew = True
        self.contraction = 1.0
        #: where the angular velocity stands in a node's block, of an ansatz that turns (else 0)
        self._turning = rod.ansatz.index("w1") if keep and isinstance(rod.ansatz, Spatial) else 0
        self._stage, self._load = rod.u.x.array, rod.bit_load
        names = rod.ansatz.x_names + rod.ansatz.v_names
        self.unit = np.array([1.0 / TOLERANCE[name[0]] for name in names])
        n = rod.size // rod.ansatz.size
        self._cosine, self._sine = np.ones(n), np.zeros(n)
        self._reference = np.zeros((n, 4))
        self._columns = np.zeros((2, rod.size))
        self._compliance = (0.0, 0.0, 0.0, 0.0)
        if bit is not None:
            at, self._bit_number = rod.bit, int(rod.nodes[-1])
            quaternion = isinstance(at.rotation, slice)
            turn = at.rotation.start if isinstance(at.rotation, slice) else at.rotation
            self._rotation = at.rotation
            self._bit_at = _BitNode(at.depth, at.speed, at.spin, turn, quaternion, rod.bends)
        self._history: list[Array] = []

    def forget(self) -> None:
        """Start afresh, as after a restart: no kept Jacobian, no extrapolation."""
        self.renew = True
        self._history.clear()

    def _quaternions(self) -> Array:
        return self._stage.reshape(len(self._cosine), -1)[:, 3:7]

    def _solve_kept(self, system: System, b: Array) -> Array:
        """J0^-1 T^-1 b: the kept Jacobian, in the frame in which it was factorised; overwrites b."""
        if self._turning:
            _turn(b.reshape(len(self._cosine), -1), self._turning, self._cosine, self._sine, -1.0)
        return system.solve(b)

    def _factorise(self, system: System) -> None:
        system.factorise()
        self.factored_shift = system.shift()
        self.renew = False
        self.factorisations += 1
        if self._turning:
            self._reference[:] = self._quaternions()
            self._cosine[:], self._sine[:] = 1.0, 0.0
        if self.bit is not None:
            for column, load in zip(self._columns, self.rod.bit_load_vectors(), strict=True):
                column[:] = self._solve_kept(system, load)
            # a turn of the sections about their axis leaves these four numbers as they are
            by_weight, by_torque = (
                _motion(self._bit_at, self._stage, column, 1.0, self.rod.bit_tangent, 1.0, 0.0)
                for column in self._columns
            )
            depth, speed, _, _ = by_weight
            _, _, turn, spin = by_torque
            self._compliance = (speed, depth, spin, turn)

    def _condense(self, y: Array, part: float) -> tuple[float, float]:
        """Solve the bit problem on the linearised string; returns the change of weight and torque."""
        assert self.bit is not None
        node, stage = self._bit_number, self._stage
        d_depth, d_speed, d_turn, d_spin = _motion(
            self._bit_at, stage, y, -part, self.rod.bit_tangent, self._cosine[node], self._sine[node]
        )
        g_speed, g_depth, g_spin, g_turn = self._compliance
        weight, torque = float(self._load[0]), float(self._load[1])
        angle = turn_between(self.start_rotation, stage[self._rotation])
        now_depth, now_speed, now_spin = self.rod.end_motion(stage)
        new_weight, new_torque = self.bit.respond(
            now_speed + d_speed + g_speed * weight,
            g_speed,
            now_depth - self.start_depth + d_depth + g_depth * weight,
            g_depth,
            now_spin + d_spin + g_spin * torque,
            g_spin,
            angle + d_turn + g_turn * torque,
            g_turn,
        )
        return new_weight - weight, new_torque - torque

    def solve(self, system: System, x: Array) -> Outcome:
        """Newton iterations from the extrapolated start; ``x`` (dofs,) are the unknowns of ``system``, in place.

        With an augmented Lagrangian the wall's multipliers are moved and the iteration goes on, until they hold.
        """
        rod = self.rod
        if self.extrapolate and len(self._history) == 3:
            x1, x2, x3 = self._history
            _extrapolate(x1, x2, x3, x)
        load, there = self._load.copy(), rod.there()
        self.complaint = ""
        outcome = self._iterate(system, x)
        for _ in range(_MOST_UPDATES):
            if outcome is not Outcome.CONVERGED or not rod.augment(system.shift()):
                break
            outcome = self._iterate(system, x)
        else:
            outcome = Outcome.SLOW
            self.complaint = (
                f"contact.method = 'augmented' is not content after {_MOST_UPDATES} updates of its multipliers: a "
                "larger contact.stiffness or penetration_tolerance helps"
            )
        if outcome is Outcome.CONVERGED:
            self._history = [x.copy(), *self._history[:2]]
        else:
            self.forget()
            rod.set_bit_load(*load)
            rod.go_back(there)
        return outcome

    def _iterate(self, system: System, x: Array) -> Outcome:
        if self.bit is None and not self._turning and (done := system.iterate(self)) is not None:
            return done
        rod, bit = self.rod, self.bit
        outcome = Outcome.SLOW
        previous, renew_after, keep = np.inf, False, self.keep
        # where to go back to when a kept Jacobian leads astray: behind the last update that can be trusted
        trusted, trusted_load, first = x.copy(), self._load.copy(), True
        for iteration in range(MAX_ITERATIONS):
            f = system.residual()
            if iteration == 0 and abs(system.shift() - self.factored_shift) > 1e-10 * system.shift():
                self.renew = True
            fresh = self.renew or not keep
            if fresh:
                self._factorise(system)
                self.contraction = 1.0
            elif self._turning and iteration == 0:
                _turns(self._reference, self._quaternions(), self._cosine, self._sine)
            y = self._solve_kept(system, f)
            loads = (0.0, 0.0)
            if bit is not None:
                part = system.stage_fraction
                d_weight, d_torque = self._condense(y, part)
                loads = (d_weight / part, d_torque / part)
                rod.set_bit_load(self._load[0] + d_weight, self._load[1] + d_torque)
            size = _update(x, y, self._columns, loads, self._turning, self._cosine, self._sine, self.unit)
            self.iterations += 1
            if not math.isfinite(size):
                outcome = Outcome.NAN
                break
            if not first:
                # below the tolerance it is round-off that is seen
                if size > 1.0:
                    self.contraction = size / previous
                    if not fresh and self.contraction > STALLED:
                        x[:] = trusted
                        rod.set_bit_load(*trusted_load)
                        keep, first = False, True
                        continue
                    # or when it would take too many more iterations
                    self.renew = self.contraction > STALLED or size * self.contraction**PATIENCE > 1.0
                    renew_after = renew_after or self.contraction > DRAGGING
                else:
                    self.contraction = min(self.contraction, size / previous)
            # what is left after this update is contraction/(1 - contraction) of it. The Jacobian of a drilling string
            # turns with it and contracts as it did in the last solve, with a margin; that of another rod goes stale
            # with every step, and its contraction tells of the fast components only
            if bit is None:
                rate = 1.0
            else:
                rate = min(1.0, 4 * self.contraction) if first else self.contraction
            if size < 1.0 or (rate < 0.5 and size * rate / (1 - rate) < 1.0):
                outcome = Outcome.CONVERGED
                # reactions and powers are read from the state that the rod has seen last
                if size > 1.0:
                    system.settle()
                break
            if fresh or not first:
                trusted[:], trusted_load[:] = x, self._load
            previous, first = size, False
        self.renew = self.renew or renew_after
        return outcome
