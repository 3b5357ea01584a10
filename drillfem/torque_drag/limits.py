"""How much a string in its hole can be pushed: the loads at which it winds into a sine wave and a helix.

In an inclined hole a string of bending stiffness EI with clearance r, pressed on the wall by N per length, buckles at

    F = 2 sqrt(EI N / r)        sinusoidal (Dawson and Paslay 1984, for N = w sin i)
    F = 2.83 sqrt(EI N / r)     helical, where it begins (Chen, Lin and Cheatham 1990)
    F = 3.66 sqrt(EI N / r)     helical, where all of it has wound up (Wu and Juvkam-Wold 1993)

with N of the straight string under the same load, which in a bend depends on F (He and Kyllingstad 1995): a hole that
builds holds a pushed string down. A vertical string of weight w per length buckles at 1.94 (EI w^2)^(1/3) (Lubinski
1950) and winds up at 5.55 (EI w^2)^(1/3) (Wu and others 1993): the limits are taken as no less than these.

In a helix the string presses on the wall with r F^2 / (4 EI) per length more (Mitchell 1986).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..models.soft_string import Line

F8 = NDArray[np.float64]

SINUSOIDAL, HELICAL, WOUND_UP = 2.0, 2.83, 3.66
VERTICAL_SINUSOIDAL, VERTICAL_HELICAL = 1.94, 5.55


class Limits(NamedTuple):
    """Compressions (n,) in N, positive, at measured depths (n,) in m."""

    measured_depth: F8
    sinusoidal: F8
    helical: F8
    wound_up: F8


def limits(line: Line, s: F8) -> Limits:
    """Buckling loads of a string along its hole at arc lengths s (n,).

    The least F with F = factor sqrt(EI N(F)/r) and N(F) = |w across the hole - F t'|: a root of a quartic in F.
    """
    here = line.at(s)
    weight = np.hypot(np.linalg.norm(here.across, axis=1), here.along)
    across = np.einsum("ij,ij->i", here.across, here.across)
    bend = np.einsum("ij,ij->i", here.curvature, here.curvature)
    mixed = np.einsum("ij,ij->i", here.across, here.curvature)
    vertical = np.cbrt(here.bending * weight**2)

    def load(factor: float) -> F8:
        c2 = (factor**2 * here.bending / here.clearance) ** 2
        # N^2 = across - 2 F mixed + F^2 bend
        f = np.zeros_like(s)
        for i in range(len(s)):
            roots = np.roots([1.0, 0.0, -c2[i] * bend[i], 2 * c2[i] * mixed[i], -c2[i] * across[i]])
            real = roots.real[(np.abs(roots.imag) < 1e-6 * np.abs(roots)) & (roots.real > 0)]
            f[i] = real.min() if len(real) else 0.0
        return f

    low, mid, high = (load(x) for x in (SINUSOIDAL, HELICAL, WOUND_UP))
    helix = VERTICAL_HELICAL * vertical
    return Limits(s, np.maximum(low, VERTICAL_SINUSOIDAL * vertical), np.maximum(mid, helix), np.maximum(high, helix))
