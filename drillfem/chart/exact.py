"""The exact travelling wave in a string of two sections: a pulse, and all that the joint and the two ends make of it.

In a uniform section the speed w (spin, or axial speed) is a wave downwards plus a wave upwards, w = d(t - s/c) +
u(t + s/c), and the resultant (torque, or force) is -Z d + Z u with the impedance Z = stiffness/c.  At the joint of
sections 1 and 2 speed and resultant are continuous: a wave from above is reflected as r and transmitted as 1 + r,
one from below as -r and 1 - r, with r = (Z1 - Z2)/(Z1 + Z2) (field of waves: r = (1 - Z)/(1 + Z) with Z = Z2/Z1).
The top is held (reflection -1), the bottom is free (+1).

Echoes arrive at the joint delayed by 2 i T1 + 2 j T2 (T: travel time of a section), so that the solution is a finite
sum of shifted copies of the pulse whose coefficients obey a recurrence on the lattice (i, j): closed form, no grid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

F8 = NDArray[np.float64]


@dataclass(frozen=True)
class Pulse:
    """Gaussian pulse of speed (height 1) travelling downwards: ``centre`` and ``width`` in m, exp(-((s - c)/w)^2)."""

    centre: float
    width: float

    def speed(self, s: F8) -> F8:
        """Speed at arc length s (m)."""
        value: F8 = np.exp(-(((s - self.centre) / self.width) ** 2))
        return value

    def integral(self, s: F8) -> F8:
        """Integral of the speed from the top to s, m."""
        from scipy.special import erf

        value: F8 = erf((s - self.centre) / self.width) + math.erf(self.centre / self.width)
        return value * self.width * math.sqrt(math.pi) / 2


@dataclass(frozen=True)
class ExactWave:
    """A pulse in the upper of two sections, top held, bottom free.

    lengths (m), wave speeds (m/s) and impedances (stiffness over wave speed) of the two sections, from the top down.
    The pulse must vanish at both ends of the upper section.
    """

    lengths: tuple[float, float]
    wave_speeds: tuple[float, float]
    impedances: tuple[float, float]
    pulse: Pulse

    @property
    def reflection(self) -> float:
        """Speed reflected at the joint over speed that comes down; that of the resultant is its negative."""
        z1, z2 = self.impedances
        return (z1 - z2) / (z1 + z2)

    @property
    def transmission(self) -> float:
        """Speed that passes the joint over speed that comes down."""
        return 1 + self.reflection

    @property
    def resultant_transmission(self) -> float:
        """Torque (or force) that passes the joint over that which comes down."""
        return self.transmission * self.impedances[1] / self.impedances[0]

    @cached_property
    def _travel(self) -> tuple[float, float]:
        return self.lengths[0] / self.wave_speeds[0], self.lengths[1] / self.wave_speeds[1]

    def _echoes(self, until: float) -> tuple[F8, F8, F8]:
        """Delays (n,) and coefficients (n,) of the waves that meet the joint from above and from below."""
        t1, t2 = self._travel
        r = self.reflection
        # one delay more than seen: what meets the joint later is already in the collars
        last = until + 2 * (t1 + t2)
        n1, n2 = int(last / (2 * t1)) + 1, int(last / (2 * t2)) + 1
        above, below = np.zeros((2, n1 + 1, n2 + 1))
        above[0, 0] = 1.0
        for i in range(n1 + 1):
            for j in range(n2 + 1):
                if i:  # went up from the joint, came back from the held top
                    above[i, j] -= r * above[i - 1, j] + (1 - r) * below[i - 1, j]
                if j:  # went down from the joint, came back from the free bottom
                    below[i, j] += (1 + r) * above[i, j - 1] - r * below[i, j - 1]
        delay = 2 * t1 * np.arange(n1 + 1)[:, None] + 2 * t2 * np.arange(n2 + 1)
        seen = delay <= last
        return delay[seen], above[seen], below[seen]

    def waves(self, s: F8, t: float) -> tuple[F8, F8]:
        """Waves downwards and upwards (speed) at arc lengths s (m) and time t >= 0 (s)."""
        s = np.asarray(s, float)
        (l1, _), (c1, c2), r = self.lengths, self.wave_speeds, self.reflection
        delay, above, below = self._echoes(t)

        def at_joint(coefficients: F8, times: F8) -> F8:
            some = coefficients != 0.0
            copies = self.pulse.speed(l1 - c1 * (times[:, None] - delay[some]))
            value: F8 = copies @ coefficients[some]
            return value

        upper = s <= l1
        s1, s2 = s[upper] - l1, s[~upper] - l1
        down, up = np.empty_like(s), np.empty_like(s)
        down[upper] = at_joint(above, t - s1 / c1)
        up[upper] = at_joint(r * above + (1 - r) * below, t + s1 / c1)
        down[~upper] = at_joint((1 + r) * above - r * below, t - s2 / c2)
        up[~upper] = at_joint(below, t + s2 / c2)
        return down, up

    def speed(self, s: F8, t: float) -> F8:
        """Spin (or axial speed) at s and t."""
        down, up = self.waves(s, t)
        return down + up

    def resultant(self, s: F8, t: float) -> F8:
        """Torque (or axial force) at s and t; at the joint that of the upper section (they agree)."""
        down, up = self.waves(s, t)
        z1, z2 = self.impedances
        return np.where(np.asarray(s) <= self.lengths[0], z1, z2) * (up - down)

    def start(self, s: F8) -> tuple[F8, F8]:
        """Angle (or displacement) and speed at time 0; the angle is zero at the top."""
        s = np.asarray(s, np.float64)
        return -self.pulse.integral(s) * (1 / self.wave_speeds[0]), self.pulse.speed(s)
