"""Exact transfer functions of the straight string at its bit, and of the rock surface between two blades.

A motion of the string (axial or torsional) answers a force on the bit with ``G(s)``, the receptance: movement of the
bit along the force, per unit force, s in rad/s.  It is kept as a pair (N, D), G = N / D, both analytic for
Re s > -1/c_d and scaled by the growth of the waves, so that they stay finite for any s.  The zeros of D are the
natural motions of the string without rock.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray
from scipy.interpolate import pade

from drillfem.scene.frequencies import End, Uniform, standing_waves

F8 = NDArray[np.float64]
C16 = NDArray[np.complex128]

Delay = Callable[[C16, float], C16]
"""(p, width) -> outflow over inflow of a sector of rock: p = s/Omega in 1/rad, width in rad; exactly exp(-p width)."""


class Receptance(Protocol):
    """One motion of the string, seen from the bit."""

    def parts(self, s: C16) -> tuple[C16, C16]:
        """Numerator and denominator of the receptance (m/N or rad/(N m)) at s (rad/s, not 0), of the shape of s."""
        ...

    def poles(self, limit: float) -> C16:
        """Natural motions, Im >= 0, in rad/s up to the frequency ``limit`` (rad/s), without rigid ones."""
        ...


@dataclass(frozen=True)
class Oscillator:
    """A lump on a spring with Kelvin-Voigt damping: G = 1/(inertia s^2 + stiffness (1 + retardation s)).

    inertia in kg or kg m2; stiffness in N/m or N m/rad (0: free); retardation in s.
    """

    inertia: float
    stiffness: float = 0.0
    retardation: float = 0.0

    def parts(self, s: C16) -> tuple[C16, C16]:
        """See `Receptance`."""
        return np.ones_like(s), self.inertia * s**2 + self.stiffness * (1 + self.retardation * s)

    def poles(self, limit: float) -> C16:
        """See `Receptance`."""
        omega = np.sqrt(self.stiffness / self.inertia)
        return _damped(np.array([omega] if 0 < omega <= limit else []), self.retardation)


@dataclass(frozen=True)
class Waves:
    """A stepped rod that carries waves, from the top down; exact.

    length : (m,) m.  stiffness : (m,) EA in N or GJ in N m2.  inertia : (m,) per length, kg/m or kg m.
    retardation : (m,) Kelvin-Voigt times, s.  held : the top does not move (torsion), or carries a constant force
    (axial).  top, bottom : lumps at the ends, kg or kg m2.
    """

    length: tuple[float, ...]
    stiffness: tuple[float, ...]
    inertia: tuple[float, ...]
    retardation: tuple[float, ...]
    held: bool
    top: float = 0.0
    bottom: float = 0.0

    def parts(self, s: C16) -> tuple[C16, C16]:
        """See `Receptance`.  Position u and internal force F go down by u + F sinh/Z, F cosh + Z u sinh."""
        zero, one = np.zeros_like(s), np.ones_like(s)
        u, force = (zero, one) if self.held else (one, self.top * s**2)
        for length, stiffness, inertia, late in zip(
            self.length, self.stiffness, self.inertia, self.retardation, strict=True
        ):
            soft = np.sqrt(1 + late * s)
            z = np.sqrt(stiffness * inertia) * s * soft
            decay = np.exp(-2 * length * np.sqrt(inertia / stiffness) * s / soft)
            cosh, sinh = 0.5 * (1 + decay), 0.5 * (1 - decay)
            u, force = u * cosh + force * (sinh / z), force * cosh + u * (z * sinh)
        return u, force + self.bottom * s**2 * u

    def poles(self, limit: float) -> C16:
        """See `Receptance`; with unequal retardation times the damping is that of the mean one."""
        late = np.average(self.retardation, weights=self.length)
        return _damped(self.frequencies(limit), float(late))

    def frequencies(self, limit: float) -> F8:
        """Undamped natural frequencies in rad/s, ascending, > 0 and <= limit."""
        pieces = [Uniform(*piece) for piece in zip(self.length, self.stiffness, self.inertia, strict=True)]
        ends = End(self.held, self.top), End(False, self.bottom)
        return 2 * np.pi * np.array(standing_waves(pieces, *ends, limit / (2 * np.pi)))


def _damped(omega: F8, late: float) -> C16:
    """Roots of s^2 + omega^2 (1 + late s) = 0 that oscillate, Im > 0; overdamped ones are left out."""
    half = 0.5 * late * omega
    omega, half = omega[half < 1], half[half < 1]
    return np.asarray(omega * (1j * np.sqrt(1 - half**2) - half))


def exact(p: C16, width: float) -> C16:
    """The rock as it is: a pure delay."""
    return np.exp(-p * width)


def surface_delay(scheme: str, degree: int = 2, elements: int = 16) -> Delay:
    """Transfer function of a discretised sector, from the bit to the blade behind it, exact in time.

    scheme : "dg" (degree, elements), "upwind" or "supg" (elements), or "profile", which is exact.  An element of upwind
    DG of degree k passes waves on with the Pade approximation [k/k+1] of the delay; "upwind" is k = 0.
    Raises ValueError.
    """
    if scheme == "profile":
        return exact
    if scheme == "supg":
        return _supg_delay(elements)
    if scheme not in ("dg", "upwind"):
        raise ValueError(f"no transfer function of a surface {scheme!r}: must be dg, supg, upwind or profile")
    k = degree if scheme == "dg" else 0
    series = [1.0]
    for i in range(1, 2 * k + 2):
        series.append(-series[-1] / i)
    top, bottom = pade(series, k + 1, k)
    numerator, denominator = np.asarray(top.coef)[::-1], np.asarray(bottom.coef)[::-1]

    def delay(p: C16, width: float) -> C16:
        z = p * (width / elements)
        ratio: Any = polynomial.polyval(z, numerator) / polynomial.polyval(z, denominator)
        return np.asarray(ratio**elements)

    return delay


def _supg_delay(elements: int) -> Delay:
    """Linear elements with streamline test functions: (p mass - forward) L = left, a tridiagonal system."""
    from drillfem.bitrock.dg import supg_operators  # numba: not for those who only ask for roots

    unit = supg_operators(elements, 1.0)

    def delay(p: C16, width: float) -> C16:
        def entry(i: int, j: int) -> C16:
            return np.asarray(p * width * unit.mass[i, j] - unit.forward[i, j])

        pivot = entry(0, 0)
        height = 1 / pivot
        for i in range(1, elements + 1):
            below = entry(i, i - 1)
            pivot = entry(i, i) - below * entry(i - 1, i) / pivot
            height = -height * below / pivot
        return height

    return delay
