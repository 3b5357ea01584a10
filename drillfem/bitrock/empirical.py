"""The empirical bit law of appendix B.4: rate of penetration and torque from weight and spin.

The measured law (B-2)-(B-4), made to vanish with the spin: with phi = w/sqrt(w^2 + eps^2) and the weight F,

    ROP = max(0, (a2 F - a1) phi^2 + a3 w phi)                 axial speed of a bit on bottom, m/s
    T   = a4 phi^2 ROP/w + a5 phi                              torque, N m; (B-5) where ROP is not cut off

The thesis announces a regularised rate of penetration and does not print it: this is the one whose depth of cut ROP/w
gives (B-5) with the powers of phi printed there. The law is even in the spin: a bit that turns backwards drills too. It
knows no surface of the rock: a bit is on bottom where it is as deep as it has been.

F is the force between bit and rock, or, by choice, the nominal weight on bit.

Above about 2 eps the torque falls with the spin, so that the bit feeds torsional vibrations, and a compliant string may
find several spins that fit: taken is the one met first on the way from the last spin, the one that continues it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drillfem.bitrock.jit import kernel

if TYPE_CHECKING:
    from drillfem.scene import Scene

F8 = NDArray[np.float64]

A1, A2, A3, A4, A5, EPS, CONSTANT = range(7)

#: Range of the search for a spin, over eps: its first step, and the growth of the next ones.
_FIRST, _GROWTH = 0.02, 1.3


class Answer(NamedTuple):
    """A bit on bottom: weight (N, up), torque (N m, braking), spin (rad/s), axial speed (m/s)."""

    weight: float
    torque: float
    spin: float
    speed: float


@kernel(lean=True)
def _penetration(par: F8, force: float, w: float) -> float:
    """Rate of penetration, m/s."""
    square = w * w + par[EPS] ** 2
    return max(0.0, (par[A2] * force - par[A1]) * w * w / square + par[A3] * w * w / np.sqrt(square))


@kernel(lean=True)
def _torque(par: F8, rate: float, w: float) -> float:
    """Torque of a bit that advances with ``rate`` (m/s), N m."""
    square = w * w + par[EPS] ** 2
    return par[A4] * rate * w / square + par[A5] * w / np.sqrt(square)


@kernel(lean=True)
def _at_spin(par: F8, v_free: float, gv: float, w: float) -> tuple[float, float, float]:
    """(W, T, v) at a spin, where the string moves down with v_free - gv W: on the law, or lifted by the string."""
    if par[CONSTANT] > 0.0:
        rate = _penetration(par, par[CONSTANT], w)
        weight = max(0.0, (v_free - rate) / gv)
    else:
        square = w * w + par[EPS] ** 2
        ease = w * w / square
        weight = (v_free + par[A1] * ease - par[A3] * w * w / np.sqrt(square)) / (gv + par[A2] * ease)
        # below the least weight that drills the bit stands
        weight = max(0.0, min(weight, v_free / gv))
    speed = v_free - gv * weight
    return weight, _torque(par, max(0.0, speed), w), speed


@kernel(lean=True)
def solve_empirical(par: F8, v_free: float, gv: float, w_free: float, gw: float, before: float):  # type: ignore[no-untyped-def]
    """(W, T, w, v) of a bit on bottom whose string gives v = v_free - gv W and w = w_free - gw T. Always succeeds.

    par: EmpiricalLaw.array. gv (m/s per N) > 0, gw (rad/s per N m) >= 0. before: spin from which roots are followed.
    """
    # the torque opposes the spin, so that a root lies between no spin and that of the free bit
    low, high = min(0.0, w_free), max(0.0, w_free)
    a = min(max(before, low), high)
    ra = a - w_free + gw * _at_spin(par, v_free, gv, a)[1]
    if ra != 0.0:
        way = -1.0 if ra > 0.0 else 1.0
        b, rb, stride = a, ra, _FIRST * par[EPS]
        while (rb > 0.0) == (ra > 0.0) and low <= b <= high:
            a, ra = b, rb
            b, stride = b + way * stride, stride * _GROWTH
            rb = b - w_free + gw * _at_spin(par, v_free, gv, b)[1]
        # false position with halved weights (Illinois), and bisection where that is slow
        for sweep in range(200):
            if rb == 0.0 or abs(b - a) <= 4e-16 * (abs(a) + abs(b)):
                break
            c = b - rb * (b - a) / (rb - ra)
            if sweep % 4 == 3 or not min(a, b) < c < max(a, b):
                c = 0.5 * (a + b)
            rc = c - w_free + gw * _at_spin(par, v_free, gv, c)[1]
            if (rc > 0.0) == (rb > 0.0):
                ra *= 0.5
            else:
                a, ra = b, rb
            b, rb = c, rc
        a = b
    weight, torque, speed = _at_spin(par, v_free, gv, a)
    return weight, torque, a, speed


@dataclass(frozen=True, kw_only=True)
class EmpiricalLaw:
    """Parameters of the law, SI units. ``constant_weight``: F of the law (N); 0: the force between bit and rock."""

    a1: float = 3.429e-3
    a2: float = 5.672e-8
    a3: float = 1.374e-4
    a4: float = 9.537e6
    a5: float = 1475.0
    regularisation: float = 2.0
    constant_weight: float = 0.0

    @classmethod
    def from_scene(cls, scene: Scene) -> EmpiricalLaw:
        """Law of a scene with an empirical bit."""
        bit = scene.bit
        assert bit is not None
        e = bit.empirical
        constant = scene.nominal().weight_on_bit if e.force == "nominal" else 0.0
        numbers = {name: value for name, value in vars(e).items() if name != "force"}
        return cls(**numbers, constant_weight=constant)

    @property
    def array(self) -> F8:
        """The flat array that the compiled functions take (A1 ... CONSTANT)."""
        return np.array([float(getattr(self, field.name)) for field in fields(self)])

    def rate_of_penetration(self, weight: float, spin: float) -> float:
        """Axial speed (m/s) on bottom at a weight (N) and a spin (rad/s)."""
        return float(_penetration(self.array, self.constant_weight or weight, spin))

    def torque(self, weight: float, spin: float) -> float:
        """Torque (N m) at a weight (N) and a spin (rad/s)."""
        return float(_torque(self.array, self.rate_of_penetration(weight, spin), spin))

    def weight(self, rate: float, spin: float) -> float:
        """Weight (N) that drills with ``rate`` (m/s) at a spin (rad/s); 0 where it takes none, or the bit stands."""
        square = spin**2 + self.regularisation**2
        ease = self.a2 * spin**2 / square
        return max(0.0, rate + self.a1 * spin**2 / square - self.a3 * spin**2 / square**0.5) / ease if spin else 0.0

    def respond(self, v_free: float, gv: float, w_free: float, gw: float, before: float) -> Answer:
        """The bit on bottom of a string with v = v_free - gv W and w = w_free - gw T, near the spin ``before``."""
        return Answer(*solve_empirical(self.array, v_free, gv, w_free, gw, before))
