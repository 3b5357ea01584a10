"""Natural frequencies against exact ones: the thesis' string (spec 8.5, 9.7), beams, tension and buckling."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from rodlab import Array, bar, dynamic, equilibrium
from scipy.optimize import brentq

from drillfem.errors import SimulationError
from drillfem.models.frequencies import natural_frequencies_of
from drillfem.models.modes import Whirl, natural_frequencies, whirling
from drillfem.models.rod import Rod
from drillfem.scene import load_scene

TORSION = [0.4534, 1.7108, 3.1781, 4.6768, 6.1440, 7.4014, 8.3083, 9.5657, 11.0329, 12.5316]
AXIAL = [1.69, 4.02, 6.49, 8.96, 11.28, 12.97, 14.66, 16.99]


@pytest.mark.parametrize("model", ["axial-torsional", "spatial"])
def test_natural_frequencies_of_the_thesis_string(model: str) -> None:
    rod = Rod(load_scene("vertical-c1-cd2", {"model": model}))
    nominal = rod.scene.nominal()
    rod.set_bit_load(nominal.weight_on_bit, nominal.torque_on_bit)
    modes = natural_frequencies(rod, 10)
    np.testing.assert_allclose(modes["torsional"].frequency, TORSION, atol=6e-5)
    np.testing.assert_allclose(modes["axial"].frequency[:8], AXIAL, atol=6e-3)
    np.testing.assert_allclose(modes["torsional"].frequency, stepped_shaft(10), rtol=1e-6)
    for family in ("torsional", "axial"):  # Kelvin-Voigt: c_d omega / 2
        mode = modes[family]
        np.testing.assert_allclose(mode.damping, 1e-2 * math.pi * mode.frequency, rtol=1e-6)
    assert modes["torsional"].damping[0] == pytest.approx(0.0142, abs=5e-5)  # 1.4 % at 0.45 Hz
    if model == "spatial":
        bending = modes["bending"].frequency
        np.testing.assert_allclose(bending[::2], bending[1::2], rtol=1e-3)  # a round string bends both ways alike


def stepped_shaft(count: int) -> Array:
    """Exact torsional frequencies (Hz), top held, bit free: J_1 cot(k L_1) = J_2 tan(k L_2)."""
    pipe, collars = load_scene("vertical-c1-cd2").string
    assert pipe.material is not None and pipe.material.shear_modulus is not None
    c = math.sqrt(pipe.material.shear_modulus / pipe.material.density)

    def f(x: float) -> float:
        a, b = (2 * math.pi * x / c * s.length for s in (pipe, collars))
        return pipe.polar_moment * math.cos(a) * math.cos(b) - collars.polar_moment * math.sin(a) * math.sin(b)

    x = np.linspace(0.01, 20, 4000)
    sign = np.sign([f(v) for v in x])
    return np.array([brentq(f, x[i], x[i + 1], xtol=1e-13) for i in np.flatnonzero(np.diff(sign))][:count])


def test_slender_cantilever_is_euler_bernoullis() -> None:
    rod = Rod(
        bar(1.0, axial=1e6, shear=1e6, bending=1.0, torsion=1.0, inertia=1e-7, model="spatial", time=dynamic(1.0, 0.1))
    )
    modes = natural_frequencies(rod, 6)
    roots = np.array([1.875104, 4.694091, 7.854757])
    np.testing.assert_allclose(modes["bending"].frequency[::2], roots**2 / (2 * math.pi), rtol=1e-4)
    np.testing.assert_allclose(modes["axial"].frequency[0], math.sqrt(1e6) / 4, rtol=1e-9)


def test_free_rod_and_lumped_ends() -> None:
    tables = {"model": "axial-torsional", "time": dynamic(1.0, 0.1)}
    free = Rod(bar(2.0, axial=8.0, torsion=2.0, inertia=0.25, ends={"top": "free", "bottom": "free"}, **tables))
    modes = natural_frequencies(free, 3)
    n = np.arange(1, 4)
    np.testing.assert_allclose(modes["axial"].frequency, n * math.sqrt(8.0) / 4, rtol=1e-7)  # rigid motion left out
    np.testing.assert_allclose(modes["torsional"].frequency, n * math.sqrt(2.0 / 0.5) / 4, rtol=1e-7)
    heavy = Rod(
        bar(1.0, axial=3.0, mass=1e-6, ends={"top": "clamped", "bottom": "free", "bottom_mass": 0.75}, **tables)
    )
    assert natural_frequencies(heavy, 1)["axial"].frequency[0] == pytest.approx(2 / (2 * math.pi), rel=1e-6)


def test_tension_stiffens_and_compression_buckles() -> None:
    def slowest(force: float) -> float:
        ends = {"top": "clamped", "bottom": "free", "tip_force": [0, 0, force]}
        rod = Rod(
            bar(axial=1e7, shear=1e7, bending=1.0, inertia=1e-6, ends=ends, model="spatial", time=dynamic(1.0, 0.1))
        )
        equilibrium(rod)
        return float(natural_frequencies(rod, 1, rod.u.x.array.copy())["bending"].frequency[0])

    euler = math.pi**2 / 4
    assert slowest(0) < slowest(2.0) < slowest(10.0)
    squares = [slowest(-f * euler) ** 2 for f in (0.9, 0.99)]
    # the square of the frequency vanishes at Euler's load
    at_zero = 0.99 + 0.09 * squares[1] / (squares[0] - squares[1])
    assert at_zero == pytest.approx(1.0, abs=1e-4)


def test_dead_moment_is_refused_where_it_drives_a_flutter() -> None:
    ends = {"top": "clamped", "bottom": "free", "tip_moment": [0, 0, 5.0]}
    rod = Rod(
        bar(
            1.0,
            axial=1e6,
            shear=1e6,
            bending=1.0,
            torsion=1.0,
            inertia=1e-6,
            ends=ends,
            model="spatial",
            time=dynamic(1.0, 0.1),
        )
    )
    with pytest.raises(SimulationError, match="dead moment"):
        natural_frequencies(rod, 2)


# -- a turning shaft -------------------------------------------------------------------------------------------------
SHAFT = {"length": 2.0, "axial": 4e5, "shear": 1.5e5, "bending": 100.0, "torsion": 80.0, "mass": 2.0, "inertia": 0.02}


def shaft(retardation: float = 0.0, **tables: Any) -> Rod:
    """A thick shaft on two bearings: free to tilt and to turn."""
    ends = {"top": "pinned", "bottom": "guided"}
    return Rod(bar(**SHAFT, retardation=retardation, ends=ends, model="spatial", time=dynamic(1.0, 0.1), **tables))


def turning_beam(n: int, spin: float, retardation: float = 0.0) -> Array:
    """Exact roots lambda (1/s) of Timoshenko's beam on two bearings, w = W sin kx, tilt = T cos kx, turning.

    With w, tilt complex (x1 + i x2) and moduli E (1 + c_d (lambda - i spin)) of a damping that turns with the shaft:
    [GA k^2 + rho A lambda^2, -GA k; -GA k, EI k^2 + GA + rho I lambda^2 - 2 i rho I spin lambda] is singular.
    """
    k = n * math.pi / SHAFT["length"]
    rate = np.array([retardation, 1 - 1j * retardation * spin])  # polynomial in lambda, highest power first
    square = np.array([1.0, 0.0, 0.0])
    across = np.polyadd(SHAFT["shear"] * k**2 * rate, SHAFT["mass"] * square)
    turning = np.array([SHAFT["inertia"], -2j * SHAFT["inertia"] * spin, 0.0])
    tilting = np.polyadd((SHAFT["bending"] * k**2 + SHAFT["shear"]) * rate, turning)
    coupling = SHAFT["shear"] * k * rate
    return np.roots(np.polysub(np.polymul(across, tilting), np.polymul(coupling, coupling)))


def exact_whirl(spin: float, retardation: float, count: int) -> tuple[Array, Array, Array]:
    """Frequency (Hz), whether forward, growth (1/s) of the slowest modes: lambda and its mirror image turn apart."""
    roots = np.concatenate([turning_beam(n, spin, retardation) for n in range(1, count + 1)])
    roots = roots[np.argsort(abs(roots.imag))][:count]
    return abs(roots.imag) / (2 * math.pi), roots.imag * spin > 0, roots.real


@pytest.mark.parametrize(("spin", "retardation"), [(0.0, 0.0), (60.0, 0.0), (25.0, 2e-4), (-25.0, 2e-4)])
def test_whirl_of_a_shaft_on_bearings_is_timoshenkos(spin: float, retardation: float) -> None:
    found = whirling(shaft(retardation), spin, 8)
    frequency, forward, growth = exact_whirl(spin, retardation, 8)
    np.testing.assert_allclose(found.frequency, frequency, rtol=1e-6)
    np.testing.assert_allclose(found.growth, growth, atol=1e-5 * 2 * math.pi * frequency[0])
    if spin:
        assert (found.forward == forward).all()


def test_spin_splits_bending_and_drives_what_it_overtakes() -> None:
    still = whirling(shaft(), 0.0, 4).frequency
    np.testing.assert_allclose(still[::2], still[1::2], rtol=1e-9)  # no splitting at rest
    np.testing.assert_allclose(still, natural_frequencies(shaft(), 4)["bending"].frequency, rtol=1e-8)
    turning = whirling(shaft(), 60.0, 4)
    assert turning.forward.tolist() == [False, True, False, True]
    assert turning.frequency[0] < still[0] < turning.frequency[1]
    assert abs(turning.growth).max() < 1e-6 * still[0]  # gyroscopic moments do no work

    def fastest(share: float) -> tuple[float, bool]:
        """Greatest growth at a share of the first forward critical speed."""
        found: Whirl = whirling(shaft(2e-4), share * 2 * math.pi * still[0], 4)
        worst = int(np.argmax(found.growth))
        return float(found.growth[worst]), bool(found.forward[worst])

    assert fastest(0.9)[0] < 0 < fastest(1.2)[0]
    assert fastest(1.2)[1]


def test_whirling_needs_a_rod_that_bends() -> None:
    with pytest.raises(SimulationError, match="can bend"):
        whirling(Rod(bar(model="axial-torsional", time=dynamic(1.0, 0.1))), 1.0)


# -- what a run notes of its string ----------------------------------------------------------------------------------
def test_waves_and_finite_elements_agree_on_the_strings_frequencies() -> None:
    scene = load_scene("vertical-c1-cd2", {"model": "axial-torsional", "ends.bottom_mass": 3000.0})
    modes, exact = natural_frequencies(Rod(scene), 12), natural_frequencies_of(scene, 40.0)
    for kind in ("axial", "torsional"):
        np.testing.assert_allclose(modes[kind].frequency, exact[kind][:12], rtol=1e-6)
    heavier = natural_frequencies_of(load_scene("vertical-c1-cd2"))["axial"][0]
    assert exact["axial"][0] < heavier  # the lump counts


def test_a_rod_that_bends_notes_all_its_kinds() -> None:
    ends = {"top": "pinned", "bottom": "guided"}
    scene = bar(**SHAFT, ends=ends, model="spatial", time=dynamic(1.0, 0.1))
    found = natural_frequencies_of(scene, 200.0)
    frequency, _, _ = exact_whirl(0.0, 0.0, 8)
    assert set(found) == {"axial", "torsional", "bending"}
    np.testing.assert_allclose(found["bending"][:4], frequency[::2], rtol=1e-6)  # both ways alike: noted once
    assert max(found["bending"]) <= 200.0
    np.testing.assert_allclose(found["axial"][0], math.sqrt(4e5 / 2.0) / (4 * 2.0), rtol=1e-6)
    assert natural_frequencies_of(load_scene("roll-up")) == {}  # statics
