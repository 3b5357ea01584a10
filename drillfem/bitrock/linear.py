"""Small oscillations of the lumped model about steady drilling, over the exact rock surface or a discrete one.

Units of appendix C.2: u'' = psi (W0 - W), phi'' + phi = -T, and while the bit cuts with its n blades at depths d_i,
W = sum(d_i) + lambda, T = sum(d_i) + beta lambda: the wear flats drop out of the linear problem.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drillfem.bitrock.dg import DGOperators

F8 = NDArray[np.float64]
Blades = int | Sequence[float]
"""A number of equal blades, or the sector in front of each blade (rad)."""


def _sectors(blades: Blades) -> tuple[F8, F8]:
    """Different sectors (rad), and how many blades each of them stands for."""
    if isinstance(blades, int):
        return np.array([2 * np.pi / blades]), np.array([float(blades)])
    return np.array(blades, float), np.ones(len(blades))


def growth_matrix(operators: DGOperators, blades: Blades, psi: float, rho: float, omega_0: float) -> F8:
    """Matrix of the linearised model over (u, u', phi, phi', heights of the rock): its eigenvalues are growth rates.

    Parameters
    ----------
    operators : of one sector, any width; every sector gets them.
    blades : number of equal blades, or the sectors in front of the blades (rad).
    psi : stiffness of cutting over that of the spring, as in appendix C.2.
    rho : advance per rad, v_0 / omega_0 = d_0 / (2 pi).
    omega_0 : spin of steady drilling.
    """
    rate, inflow = operators.rate()
    width, share = _sectors(blades)
    n = len(inflow)
    matrix = np.zeros((4 + n * len(width), 4 + n * len(width)))
    matrix[0, 1] = matrix[2, 3] = 1.0
    cut = np.zeros(len(matrix))
    for i, (w, count) in enumerate(zip(width, share, strict=True)):
        part, clock = slice(4 + i * n, 4 + (i + 1) * n), omega_0 * operators.width / w
        cut[0] += count
        cut[part] = -count * operators.right
        # turning faster by 1 carries the steady profile along faster, and that sinks by rho per rad
        matrix[part, 0], matrix[part, 3], matrix[part, part] = clock * inflow, rho, clock * rate
    matrix[1] = -psi * cut
    matrix[3] = -cut
    matrix[3, 2] -= 1.0
    return matrix


def growth_rate(operators: DGOperators, blades: Blades, psi: float, rho: float, omega_0: float = 5.0) -> complex:
    """Growth rate of the self-excitation over a discrete rock surface, 1/t*: the eigenvalue of largest real part.

    Parameters as for `growth_matrix`.  Over the exact rock surface it is a `characteristic_root`.
    """
    roots = np.linalg.eigvals(growth_matrix(operators, blades, psi, rho, omega_0))
    root = roots[np.argmax(roots.real)]
    return complex(root.real, abs(root.imag))


def characteristic(s: complex, blades: Blades, psi: float, rho: float, omega_0: float) -> complex:
    """(s^2 + psi E)(s^2 + 1) - rho E s^2 with E = sum(1 - exp(-s tau_i)) over the blades: zero at a growth rate.

    tau_i = sector_i / omega_0 is the time to the blade ahead.  Parameters as for `growth_matrix`.
    """
    width, share = _sectors(blades)
    e = np.sum(share * (1.0 - np.exp(-s * width / omega_0)))
    return complex((s**2 + psi * e) * (s**2 + 1.0) - rho * e * s**2)


def characteristic_root(guess: complex, blades: Blades, psi: float, rho: float, omega_0: float = 5.0) -> complex:
    """Growth rate over the exact rock surface near ``guess``, by the secant method; else ArithmeticError."""
    args = (blades, psi, rho, omega_0)
    a, b = complex(guess), complex(guess) * (1 + 1e-6) + 1e-9
    fa, fb = characteristic(a, *args), characteristic(b, *args)
    for _ in range(100):
        if abs(b - a) <= 1e-14 * (1 + abs(b)) or fb == fa:
            return b
        a, b, fa = b, b - fb * (b - a) / (fb - fa), fb
        fb = characteristic(b, *args)
    raise ArithmeticError(f"self-excitation: no characteristic root near {guess}")
