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
from typing import Any, Protocol

import numpy as np

from ..bitrock.jit import kernel
from ..compat import Array
from ..forms.ansatz import Spatial
from ..models.rod import Rod

#: Update below which an iteration has converged, in the unit of each component (m, 1, rad, m/s, rad/s).
_TOLERANCE = {"r": 1e-9, "q": 1e-10, "t": 1e-10, "p": 1e-10, "v": 1e-8, "w": 1e-8}
_MAX_ITERATIONS = 25
#: contraction above which the kept Jacobian is renewed for the next solve, and at once
_SLOW, _STALLED = 0.1, 0.5
#: iterations that a kept Jacobian may still need
_PATIENCE = 5


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
def _turn(y: Array, cosine: Array, sine: Array, way: float) -> None:
    """Turn nodal blocks (r, q, v, w) of y (n, 13) about their own axis, in place; ``way`` = -1 is the inverse."""
    for i in range(len(y)):
        c, s = cosine[i], way * sine[i]
        q0, q1, q2, q3 = y[i, 3], y[i, 4], y[i, 5], y[i, 6]
        y[i, 3], y[i, 4] = q0 * c - q3 * s, q1 * c + q2 * s
        y[i, 5], y[i, 6] = q2 * c - q1 * s, q3 * c + q0 * s
        c2, s2 = c * c - s * s, 2 * c * s
        w0, w1 = y[i, 10], y[i, 11]
        y[i, 10], y[i, 11] = w0 * c2 + w1 * s2, w1 * c2 - w0 * s2


@kernel()
def _extrapolate(x1: Array, x2: Array, x3: Array, out: Array) -> None:
    """Parabola through three values at equal distances, carried on by one distance."""
    for i in range(len(out)):
        out[i] = 3 * (x1[i] - x2[i]) + x3[i]


@kernel()
def _weighted(delta: Array, weight: Array) -> float:
    """Largest |delta| in units of its tolerance."""
    worst = 0.0
    n = len(weight)
    for i in range(len(delta)):
        size = abs(delta[i]) * weight[i % n]
        if not size <= worst:  # also catches nan
            worst = size
    return worst


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
        #: start from the last three solutions; no guide where a step has several stages
        self.extrapolate = True
        #: where the bit was at the last accepted step
        self.start_rotation: Any = 0.0
        self.start_depth = 0.0
        self._factored_shift = 0.0
        self._renew = True
        self._contraction = 1.0
        self._turning = keep and isinstance(rod.ansatz, Spatial)
        self._stage, self._load = rod.u.x.array, rod.bit_load
        names = rod.ansatz.x_names + rod.ansatz.v_names
        self._weight = np.array([1.0 / _TOLERANCE[name[0]] for name in names])
        n = rod.size // rod.ansatz.size
        self._cosine, self._sine = np.ones(n), np.zeros(n)
        self._reference = np.zeros((n, 4))
        self._columns = np.zeros((2, rod.size))
        self._compliance = (0.0, 0.0, 0.0, 0.0)
        if bit is not None:
            size, at = rod.ansatz.size, rod.bit
            self._bit_number = int(rod.nodes[-1])
            first = self._bit_number * size
            self._bit_node = slice(first, first + size)
            turn = (
                slice(at.rotation.start - first, at.rotation.stop - first)
                if isinstance(at.rotation, slice)
                else at.rotation - first
            )
            self._bit_at = (turn, at.depth - first, at.speed - first, at.spin - first)
        self._history: list[Array] = []

    def forget(self) -> None:
        """Start afresh, as after a restart: no kept Jacobian, no extrapolation."""
        self._renew = True
        self._history.clear()

    def _quaternions(self) -> Array:
        return self._stage.reshape(-1, 13)[:, 3:7]

    def _solve_kept(self, system: System, b: Array) -> Array:
        """J0^-1 T^-1 b: the kept Jacobian, in the frame in which it was factorised; overwrites b."""
        if self._turning:
            _turn(b.reshape(-1, 13), self._cosine, self._sine, -1.0)
        return system.solve(b)

    def _factorise(self, system: System) -> None:
        system.factorise()
        self._factored_shift = system.shift()
        self._renew = False
        self.factorisations += 1
        if self._turning:
            self._reference[:] = self._quaternions()
            self._cosine[:], self._sine[:] = 1.0, 0.0
        if self.bit is not None:
            for column, load in zip(self._columns, self.rod.bit_load_vectors(), strict=True):
                column[:] = self._solve_kept(system, load)
            # a turn of the sections about their axis leaves these four numbers as they are
            depth, speed, _, _ = self._motion(self._columns[0][self._bit_node])
            _, _, turn, spin = self._motion(self._columns[1][self._bit_node])
            self._compliance = (speed, depth, spin, turn)

    def _motion(self, change: Array) -> tuple[float, float, float, float]:
        """Change of depth, speed, turn and spin of the bit that belongs to a change of its node."""
        turn, depth, speed, spin = self._bit_at
        if isinstance(turn, slice):
            a, b, c, d = self._stage[self._bit_node][turn]
            p, q, r, s = change[turn]
            angle = 2 * (-d * p + c * q - b * r + a * s) / (a * a + b * b + c * c + d * d)
        else:
            angle = change[turn]
        if self.rod.bends:  # along the hole
            along, names = self.rod.bit_tangent, self.rod.ansatz
            v = names.index("v1")
            return float(change[:3] @ along), float(change[v : v + 3] @ along), float(angle), float(change[spin])
        return float(change[depth]), float(change[speed]), float(angle), float(change[spin])

    def _condense(self, y: Array, part: float) -> tuple[float, float]:
        """Solve the bit problem on the linearised string; returns the change of weight and torque."""
        assert self.bit is not None
        turn = self._bit_at[0]
        stage = self._stage[self._bit_node]
        change = -part * y[self._bit_node]
        if self._turning:
            node = self._bit_number
            _turn(change[None, :], self._cosine[node : node + 1], self._sine[node : node + 1], 1.0)
        d_depth, d_speed, d_turn, d_spin = self._motion(change)
        g_speed, g_depth, g_spin, g_turn = self._compliance
        weight, torque = float(self._load[0]), float(self._load[1])
        angle = turn_between(self.start_rotation, stage[turn])
        now_depth, now_speed, now_spin = self.rod.end_motion(self._stage)
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
        """Newton iterations from the extrapolated start; ``x`` (dofs,) are the unknowns of ``system``, in place."""
        rod, bit = self.rod, self.bit
        if self.extrapolate and len(self._history) == 3:
            x1, x2, x3 = self._history
            _extrapolate(x1, x2, x3, x)
        outcome = Outcome.SLOW
        previous, renew_after, keep = np.inf, False, self.keep
        # where to go back to when a kept Jacobian leads astray: behind the last update that can be trusted
        trusted, trusted_load, first = x.copy(), self._load.copy(), True
        load = trusted_load.copy()
        for iteration in range(_MAX_ITERATIONS):
            f = system.residual()
            if iteration == 0 and abs(system.shift() - self._factored_shift) > 1e-10 * system.shift():
                self._renew = True
            fresh = self._renew or not keep
            if fresh:
                self._factorise(system)
                self._contraction = 1.0
            elif self._turning and iteration == 0:
                _turns(self._reference, self._quaternions(), self._cosine, self._sine)
            y = self._solve_kept(system, f)
            part = system.stage_fraction
            if bit is not None:
                d_weight, d_torque = self._condense(y, part)
                y += self._columns[0] * (d_weight / part)
                y += self._columns[1] * (d_torque / part)
                rod.set_bit_load(self._load[0] + d_weight, self._load[1] + d_torque)
            if self._turning:
                _turn(y.reshape(-1, 13), self._cosine, self._sine, 1.0)
            x -= y
            self.iterations += 1
            size = _weighted(y, self._weight)
            if not np.isfinite(size):
                outcome = Outcome.NAN
                break
            if not first:
                # below the tolerance it is round-off that is seen
                if size > 1.0:
                    self._contraction = size / previous
                    if not fresh and self._contraction > _STALLED:
                        x[:] = trusted
                        rod.set_bit_load(*trusted_load)
                        keep, first = False, True
                        continue
                    # or when it would take too many more iterations
                    self._renew = self._contraction > _STALLED or size * self._contraction**_PATIENCE > 1.0
                    renew_after = renew_after or self._contraction > _SLOW
                else:
                    self._contraction = min(self._contraction, size / previous)
            # what is left after this update is contraction/(1 - contraction) of it. The Jacobian of a drilling string
            # turns with it and contracts as it did in the last solve, with a margin; that of another rod goes stale
            # with every step, and its contraction tells of the fast components only
            if bit is None:
                rate = 1.0
            else:
                rate = min(1.0, 4 * self._contraction) if first else self._contraction
            if size < 1.0 or (rate < 0.5 and size * rate / (1 - rate) < 1.0):
                outcome = Outcome.CONVERGED
                # reactions and powers are read from the state that the residual has seen last
                if size > 1.0:
                    system.residual()
                break
            if fresh or not first:
                trusted[:], trusted_load[:] = x, self._load
            previous, first = size, False
        self._renew = self._renew or renew_after
        if outcome is Outcome.CONVERGED:
            self._history = [x.copy(), *self._history[:2]]
        else:
            self.forget()
            rod.set_bit_load(*load)
        return outcome
