"""Buckling of a string in a straight hole, in closed form or nearly so: what the rod is held against.

A string that lies on the low side of its hole, pressed on the wall with w = (weight per length) sin(inclination), can
only leave its straight line by climbing the wall, which takes w/r per length and way aside (clearance r): it is a beam
on a foundation. A string that winds but stays on the wall has one unknown, its angle about the hole's axis. With

    kappa = (w/(EI r))^(1/4),    beta = F/(2 sqrt(EI w/r)),

and lengths in 1/kappa, its energy per length, in units of w r, is

    e = theta''^2/2 + theta'^4/2 - beta theta'^2 + 1 - cos(theta).

At beta = 1 it snakes (Dawson and Paslay 1984), at beta = sqrt 2 a helix theta = q s has as much energy as the straight
string (2.83 sqrt(EI w/r); Chen, Lin and Cheatham 1990). `snake` and `helix` find the least energy of both for any beta.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.optimize import brentq, minimize

F8 = NDArray[np.float64]


class Pipe(NamedTuple):
    """A uniform string in its hole, SI units. Shear and stretch may be rigid (inf)."""

    bending: float  # EI, N m2
    clearance: float  # m
    across: float  # weight per length across the hole, N/m
    along: float = 0.0  # weight per length along the hole, N/m
    shear: float = math.inf  # N
    axial: float = math.inf  # N

    @property
    def snaking(self) -> float:
        """Load (N) at which an endless string snakes: 2 sqrt(EI w/r)."""
        return 2 * math.sqrt(self.bending * self.across / self.clearance)

    @property
    def wave(self) -> float:
        """Length (m) of its waves then, 2 pi (EI r/w)^(1/4)."""
        return 2 * math.pi * (self.bending * self.clearance / self.across) ** 0.25

    @property
    def scale(self) -> float:
        """m = (EI/w)^(1/3) in metres, of Lubinski's vertical string; w m is its unit of load."""
        return float(np.cbrt(self.bending / math.hypot(self.across, self.along)))


def pinned_onset(pipe: Pipe, length: float, most: int = 200) -> tuple[float, int]:
    """Load (N) at which a pinned string of this length (m) snakes, and its number of half waves.

    Of a rod that bends, shears and stretches (Haringx): with a = n pi/length, k = w/r and l = 1 - F/EA,
    F a - l k/a = EI a^2 (S a + k/a)/(S l + F). Rigid in shear and stretch it is F = EI a^2 + k/a^2.
    """
    k = pipe.across / pipe.clearance

    def load(n: int) -> float:
        a = n * math.pi / length
        stiff = pipe.bending * a**2 + k / a**2
        if math.isinf(pipe.shear):
            return stiff

        def balance(f: float) -> float:
            left = 1 - f / pipe.axial
            turned = (pipe.shear * a + k / a) / (pipe.shear * left + f)
            return f * a - left * k / a - pipe.bending * a**2 * turned

        return float(brentq(balance, 0.0, 1.5 * stiff, xtol=1e-9 * stiff))

    return min((load(n), n) for n in range(1, most))


def onset(pipe: Pipe, length: float, waves: int = 120) -> float:
    """Load (N) on the lower end at which a pinned string of this length (m) buckles, its weight along the hole counted.

    EI v'''' + (F(s) v')' + (w/r) v = 0 with F rising down the hole, in sines. Vertical: Lubinski's problem (1950).
    """
    n = np.arange(1, waves + 1)
    a = n * math.pi / length

    def moment(m: F8) -> F8:  # integral of (length - s) cos(m pi s/length)
        odd = np.where(m % 2 == 1, 2 * (length / (np.maximum(m, 1) * math.pi)) ** 2, 0.0)
        return np.where(m == 0, length**2 / 2, odd)

    i, j = np.meshgrid(n, n, indexing="ij")
    hanging = pipe.along * np.outer(a, a) * (moment(np.abs(i - j)) + moment(i + j)) / 2
    stiffness = np.diag((pipe.bending * a**4 + pipe.across / pipe.clearance) * length / 2) + hanging
    loads = eigh(stiffness, np.diag(a**2 * length / 2), eigvals_only=True)
    return float(loads[loads > 0][0])


class Wave(NamedTuple):
    """A periodic shape on the wall, of least energy at its load."""

    beta: float
    energy: float  # per length, in w r
    wave_number: float  # in kappa
    amplitude: float  # greatest angle of a snake; greatest departure from the even helix (rad)


_POINTS = 2 * np.pi * np.arange(96) / 96


def _least(beta: float, orders: F8, turn: float, start: F8, held: bool = False) -> tuple[F8, F8, float]:
    """Wave number and coefficients, angle (96,) and energy of theta = turn x + sum c_k sin(k x), x = q s.

    held: the wave number is that of the start.
    """
    sin, cos = np.sin(np.outer(_POINTS, orders)), np.cos(np.outer(_POINTS, orders))

    def parts(c: F8) -> tuple[F8, F8, F8]:
        q = c[0]
        return turn * _POINTS + sin @ c[1:], q * (turn + cos @ (orders * c[1:])), -(q**2) * (sin @ (orders**2 * c[1:]))

    def energy(c: F8) -> float:
        angle, slope, bend = parts(c)
        return float(np.mean(bend**2 / 2 + slope**4 / 2 - beta * slope**2 + 1 - np.cos(angle)))

    if held:
        c = minimize(lambda c: energy(np.concatenate([start[:1], c])), start[1:], tol=1e-13).x
        at = np.concatenate([start[:1], c])
    else:
        at = minimize(energy, start, tol=1e-13).x
    return at, parts(at)[0], energy(at)


def snake(betas: F8, wave_number: float | None = None) -> list[Wave]:
    """Snaking strings at ascending loads beta > 1, each found from the last one.

    wave_number (in kappa): of a string whose ends let it have no other; else that of the least energy.
    """
    # just beyond the onset the amplitude is that of -(beta - 1) A^2/2 + 11 A^4/64
    start = math.sqrt(16 / 11 * (betas[0] - 1))
    orders, at, out = np.array([1.0, 3.0, 5.0, 7.0]), np.array([wave_number or 1.0, start, 0.0, 0.0, 0.0]), []
    for beta in betas:
        at, angle, energy = _least(float(beta), orders, 0.0, at, wave_number is not None)
        out.append(Wave(float(beta), energy, float(at[0]), float(np.abs(angle).max())))
    return out


def helix(betas: F8) -> list[Wave]:
    """Helices at descending loads beta, each found from the last one; they bulge where gravity pulls."""
    orders, out = np.array([1.0, 2.0, 3.0, 4.0]), []
    at = np.array([math.sqrt(betas[0]), 0.0, 0.0, 0.0, 0.0])
    for beta in betas:
        at, angle, energy = _least(float(beta), orders, 1.0, at)
        out.append(Wave(float(beta), energy, float(at[0]), float(np.abs(angle - _POINTS).max())))
    return out


def equal_energy() -> float:
    """Load beta at which a snaking string and a helix have the same energy: 2 beta = 2.90 stands where 2.83 does
    against the straight string."""
    at: F8 = np.linspace(1.4, 1.5, 6, dtype=np.float64)
    gain = np.array([a.energy - b.energy for a, b in zip(snake(at), helix(at[::-1])[::-1], strict=True)])
    return float(brentq(lambda beta: float(np.interp(beta, at, gain)), at[0], at[-1]))
