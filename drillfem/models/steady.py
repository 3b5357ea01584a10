"""The nominal drilling state of a straight string, with a perturbed spin (spec 9.2, 9.3). NumPy only."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..scene import Scene
from ..scene.nominal import Nominal

Array = npt.NDArray[np.float64]


def stretch_and_twist(scene: Scene, s: Array, nominal: Nominal | None = None) -> tuple[Array, Array]:
    """Displacement f(s) (m) and twist psi(s) (rad) of the nominal steady state, from the top down.

    f' = N/EA with N(s) = H_0 - weight above s (6-2), psi' = -T_0/GJ: exact for any number of uniform sections.
    nominal: other loads at the ends than the scene's.
    """
    nominal = nominal or scene.nominal()
    f, psi = np.zeros_like(s), np.zeros_like(s)
    start, f0, psi0 = 0.0, 0.0, 0.0
    tension = nominal.hook_load - scene.ends.top_mass * scene.gravity.magnitude
    for section in scene.string:
        stiffness, end = section.section_stiffness(), start + section.length
        inside = np.clip(s - start, 0.0, section.length)
        here = (s >= start) if start > 0 else np.ones(len(s), dtype=bool)
        weight = scene.weight_per_length(section)
        f[here] = f0 + (tension * inside[here] - weight * inside[here] ** 2 / 2) / stiffness.axial
        psi[here] = psi0 - nominal.torque_on_bit * inside[here] / stiffness.torsion
        f0 += (tension * section.length - weight * section.length**2 / 2) / stiffness.axial
        psi0 -= nominal.torque_on_bit * section.length / stiffness.torsion
        tension -= weight * section.length
        start = end
    return f, psi


def outer_diameter(scene: Scene, s: Array) -> Array:
    """Outer diameter (m) at arc lengths ``s``; of the upper section where two meet, 0 where not given."""
    ends = np.cumsum([section.length for section in scene.string])
    of = np.searchsorted(ends, s * (1 - 1e-12)).clip(max=len(ends) - 1)
    return np.array([section.outer_diameter or 0.0 for section in scene.string])[of]


def spin_perturbation(scene: Scene) -> float:
    """Extra spin of the bit at the start (rad/s); ``initial.seed_perturbation`` draws a nearby start."""
    initial = scene.initial
    nearby = 1.0 + initial.seed_perturbation * np.random.default_rng(initial.seed).standard_normal()
    return float(initial.spin_perturbation * (scene.top_drive.speed or 0.0) * nearby)


def start_of_drilling(scene: Scene, s: Array) -> tuple[float, Array]:
    """Axial speed (m/s) and spin (rad/s, at arc lengths s) at the start: nominal, with the spin perturbed."""
    spin = scene.top_drive.speed if scene.initial.spin is None else scene.initial.spin
    spins = (spin or 0.0) + spin_perturbation(scene) * s / scene.length
    return scene.nominal(scene.initial.spin).rate_of_penetration, spins
