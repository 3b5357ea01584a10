"""Nyquist's margin of any loop 1 + G(s) = 0: the gain where the loop comes back in opposite phase."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from drillfem.stability.transfer import C16, F8


class Crossing(NamedTuple):
    """Where a loop gain is real and negative on the imaginary axis."""

    omega: float  # unit of 1/time of the loop
    gain: float  # |G|: above 1 the loop is unstable there if it is stable open


def phase_crossings(gain: Callable[[C16], C16], omega: F8) -> list[Crossing]:
    """Crossings of the negative real axis by ``gain`` (s -> G(s), arrays) between the frequencies ``omega`` (n,).

    Each change of sign of Im G between neighbours where Re G < 0 is bisected to rounding; the list falls in gain.
    G/max|G| lies on the stability boundary of a loop that is stable open: gain margins are read off directly.
    """

    def at_frequency(w: F8) -> C16:
        return gain(np.asarray(1j * w, np.complex128))

    value = at_frequency(omega)
    sign = np.signbit(value.imag)
    k = np.flatnonzero(sign[1:] != sign[:-1])
    a, b, below = omega[k], omega[k + 1], sign[k]
    for _ in range(80):
        middle = 0.5 * (a + b)
        like_a = np.signbit(at_frequency(middle).imag) == below
        a, b = np.where(like_a, middle, a), np.where(like_a, b, middle)
    at = at_frequency(a)
    # a pole changes the sign of Im G too: there |G| has no end
    true = (at.real < 0) & (np.abs(at.imag) < 1e-6 * np.abs(at))
    found = [Crossing(float(w), float(-g.real)) for w, g in zip(a[true], at[true], strict=True)]
    return sorted(found, key=lambda c: -c.gain)
