"""The condensed axial-torsional string: frequencies, order, energy, and the thesis' chapter 6 vertical cases."""

from __future__ import annotations

import numpy as np
import pytest

from drillfem.bitrock import BitLaw, RockSurface
from drillfem.solve.condensed import Channel, CondensedString, energy_imbalance

G0, RHO, SPEED, WEIGHT_ON_BIT = 9.80665, 7800.0, 14.42, 45.7e3
PARTS = ((1000.0, 63.5e-3, 54.0e-3), (200.0, 76.2e-3, 28.0e-3))


def lagrange_matrices(modulus, density, cells, degree=3):
    """Mass, stiffness and load of one field on a string: (length, stiffness, mass per length) per cell."""
    x, w = np.polynomial.legendre.leggauss(degree + 1)
    nodes = np.linspace(-1, 1, degree + 1)
    inverse = np.linalg.inv(np.vander(nodes, increasing=True))
    value = np.vander(x, degree + 1, increasing=True) @ inverse
    power = np.arange(1, degree + 1)
    slope = (np.vander(x, degree, increasing=True) * power) @ inverse[1:]
    n = degree * len(cells) + 1
    mass, stiff, load, s = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n), np.zeros(n)
    for i, h in enumerate(cells):
        dofs = slice(degree * i, degree * (i + 1) + 1)
        mass[dofs, dofs] += 0.5 * h * density[i] * value.T @ (w[:, None] * value)
        stiff[dofs, dofs] += 2 / h * modulus[i] * slope.T @ (w[:, None] * slope)
        load[dofs] += 0.5 * h * density[i] * value.T @ w
        s[dofs] = sum(cells[:i]) + 0.5 * h * (1 + nodes)
    return mass, stiff, load, s


def c1_string(
    retardation, step=1e-3, scheme="dg", elements=(53, 11), degree=2, rock_elements=16, spin=0.1, top=SPEED, collar_retardation=None, **law
):
    """The string of spec T6.1 with E = 210 GPa, g = 9.80665, in nominal drilling with a spin perturbation."""
    cells = np.concatenate([np.full(n, length / n) for (length, _, _), n in zip(PARTS, elements, strict=True)])
    area = np.repeat([np.pi * (o**2 - i**2) for _, o, i in PARTS], elements)
    polar = np.repeat([np.pi / 2 * (o**4 - i**4) for _, o, i in PARTS], elements)
    times = np.repeat([retardation, retardation if collar_retardation is None else collar_retardation], elements)
    mass, stiff, load, s = lagrange_matrices(210e9 * area, RHO * area, cells)
    _, damp, _, _ = lagrange_matrices(210e9 * area * times, RHO * area, cells)
    axial = Channel(mass, damp, stiff, len(s) - 1, 0, G0 * load)
    mass, stiff, _, _ = lagrange_matrices(77e9 * polar, RHO * polar, cells)
    _, damp, _, _ = lagrange_matrices(77e9 * polar * times, RHO * polar, cells)
    torsion = Channel(mass, damp, stiff, len(s) - 1, 0)
    bit = BitLaw(
        **{
            "specific_energy": 0.252e9,
            "contact_strength": 0.252e9,
            "contact_strength_stalled": 0.504e9,
            "radius": 0.108,
            "wear_flat_length": 1.2e-3,
            "inclination": 0.38,
            "friction": 0.8,
            "blades": 6,
        }
        | law
    )
    cut = bit.depth_of_cut(WEIGHT_ON_BIT)
    rock = RockSurface(scheme, 6, degree=degree, elements=rock_elements, incline=-cut / (2 * np.pi))
    hook = float(axial.load.sum() - WEIGHT_ON_BIT)
    string = CondensedString(axial, torsion, bit, rock, step, hook_load=hook, top=top)
    u, twist = string.nominal()
    string.reset(u, np.full(len(s), cut * SPEED / (2 * np.pi)), twist, SPEED * (1 + spin * s / s[-1]))
    return string
