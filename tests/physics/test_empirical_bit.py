"""The empirical bit law of appendix B.4: published numbers, the bit problem of a step, and strings that drill by it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

pytest.importorskip("dolfinx", reason="the strings are assembled with DOLFINx")

import drillfem
from drillfem.bitrock.empirical import EmpiricalLaw
from drillfem.models.initial import initial_state
from drillfem.models.rod import Rod
from drillfem.scene import Scene, load_scene
from drillfem.solve.contact import EmpiricalContact
from drillfem.solve.dynamics import Stepper

RPM = np.pi / 30
LAW = EmpiricalLaw()


# -- the law -------------------------------------------------------------------------------------------------------
def test_the_published_numbers() -> None:
    """Spec section 12, B.4: 100 kN and 100 rpm, regularised and not; the peak of the torque."""
    plain = EmpiricalLaw(regularisation=1e-9)
    rate, spin = plain.rate_of_penetration(1e5, 100 * RPM), 100 * RPM
    assert (rate, rate / spin) == pytest.approx((3.682e-3, 3.516e-4), rel=2e-4)
    assert plain.torque(1e5, spin) == pytest.approx(4828, abs=0.5)
    assert [LAW.torque(1e5, w * RPM) for w in (100, 70)] == pytest.approx([4592, 5127], abs=0.6)
    spins = np.linspace(0.5, 20, 4000)
    torques = [LAW.torque(1e5, w) for w in spins]
    assert max(torques) == pytest.approx(5681, abs=0.6)
    assert spins[np.argmax(torques)] == pytest.approx(4.1, abs=0.05)


def test_the_printed_torque() -> None:
    """(B-5) term by term, where the rate of penetration is not cut off."""
    e = LAW.regularisation
    for weight, w in ((1e5, 10.0), (8e4, 3.0), (2e5, 0.3), (1e5, -7.0)):
        square = w * w + e * e
        printed = (LAW.a2 * weight - LAW.a1) * LAW.a4 * w**3 / square**2
        printed += LAW.a3 * LAW.a4 * w**3 / square**1.5 + LAW.a5 * w / square**0.5
        assert LAW.torque(weight, w) == pytest.approx(printed, rel=1e-12)


def test_nothing_is_drilled_without_spin_or_weight() -> None:
    assert LAW.rate_of_penetration(1e6, 0.0) == LAW.torque(1e6, 0.0) == 0.0
    least = LAW.weight(0.0, 10.0)
    phi = 10 / np.hypot(10, LAW.regularisation)
    assert least == pytest.approx((LAW.a1 - LAW.a3 * 10 / phi) / LAW.a2)
    assert LAW.rate_of_penetration(least - 1, 10.0) == 0.0 < LAW.rate_of_penetration(least + 1, 10.0)
    assert LAW.weight(LAW.rate_of_penetration(9e4, 8.0), 8.0) == pytest.approx(9e4)


# -- a step --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("constant", (0.0, 1e5))
def test_the_answer_satisfies_law_and_string(constant: float) -> None:
    """Strings of all compliances, bits that lift off, stall, turn backwards: law and string agree to round-off."""
    rng = np.random.default_rng(1)
    law = EmpiricalLaw(constant_weight=constant)
    lifted = stood = drilled = 0
    for _ in range(2000):
        gv, gw = 10 ** rng.uniform(-9, -5), 10 ** rng.uniform(-7, -2)
        v_free, w_free, before = 0.02 * rng.standard_normal(), 20 * rng.standard_normal(), 20 * rng.standard_normal()
        weight, torque, w, v = law.respond(v_free, gv, w_free, gw, before)
        assert weight >= 0 and w * torque >= 0
        assert v == pytest.approx(v_free - gv * weight, abs=1e-15 + 1e-12 * gv * weight)
        assert w == pytest.approx(w_free - gw * torque, abs=1e-11 * (abs(w_free) + gw * abs(torque)))
        rate = law.rate_of_penetration(weight, w)
        if weight == 0.0:
            lifted += 1
            assert v <= rate + 1e-12
        else:
            stood += rate == 0.0
            drilled += rate > 0.0
            assert v == pytest.approx(rate, abs=1e-12 + 1e-9 * abs(v_free))
    assert min(lifted, drilled) > 200 and (constant or stood > 20)


def test_of_several_spins_the_one_that_continues_the_last_is_taken() -> None:
    """A compliant string meets the falling torque three times. Loaded slowly it stays on its branch until that ends."""
    gw = 1.2e-2  # w + gw T has a hump and a trough
    law = EmpiricalLaw(constant_weight=1e5)

    def free(w: float) -> float:
        return w + gw * law.torque(1e5, w)

    spins = np.linspace(0.0, 60.0, 6001)
    slope = np.diff([free(w) for w in spins])
    hump = spins[np.argmax(slope < 0)]
    trough = spins[len(slope) - np.argmax(slope[::-1] < 0)]
    low, high = free(trough), free(hump)
    assert low < high, "no string with three answers"
    between = (low + high) / 2
    below, above = (law.respond(1.0, 1e-6, between, gw, w).spin for w in (0.5, 50.0))
    assert below < hump < trough < above
    # up and down again: each branch is left where it ends, not before
    spin, up, down = 0.0, [], []
    path = np.linspace(0.9 * low, 1.1 * high, 400)
    for w_free in path:
        spin = law.respond(1.0, 1e-6, float(w_free), gw, spin).spin
        up.append(spin)
    for w_free in path[::-1]:
        spin = law.respond(1.0, 1e-6, float(w_free), gw, spin).spin
        down.append(spin)
    step = path[1] - path[0]
    assert abs(path[np.argmax(np.array(up) > trough)] - high) < 2 * step
    assert abs(path[::-1][np.argmax(np.array(down) < hump)] - low) < 2 * step


def test_a_bit_off_bottom_is_free_until_it_is_as_deep_as_it_has_been() -> None:
    rock = EmpiricalContact(LAW, 1e5, 10.0)
    rock.commit(0.1, 0.5, 0.01, 0.0, 0.0, 10.0)
    assert rock.respond(1.0, 1e-6, 0.499, 1e-9, 10.0, 1e-4, 0.0, 0.0) == (0.0, 0.0)
    rock.commit(0.1, 0.499, 0.01, 0.0, 0.0, 9.0)
    assert rock.bottom == 0.5
    weight, torque = rock.respond(1.0, 1e-6, 0.5, 1e-9, 10.0, 1e-4, 0.0, 0.0)
    assert weight > 0 and torque > 0
    again = EmpiricalContact(LAW, 1e5, 0.0)
    again.load(rock.save())
    assert again.save() == rock.save()


# -- strings -------------------------------------------------------------------------------------------------------
def short(**overrides: Any) -> Scene:
    """Ten metres of collars: a rigid body but for waves too fast to matter, with the lumps of vertical-pi."""
    base = {
        "model": "axial-torsional",
        "string.0.length": 10.0,
        "top_drive.weight_on_bit": 1e5,
        "mesh.elements": 1,
        "time.step": 0.02,
        "time.end": 20.0,
        "output.interval": 0.1,
    }
    return load_scene("vertical-pi", base | overrides)


def test_a_rigid_string_follows_the_equation_of_one_inertia() -> None:
    """PI drive on one side, the law on the other: 20 s of a string that is nearly rigid, against an ODE solver.

    The twist lags by less than T L/GJ = 0.06 rad, and two inertias on it swing at 55 rad/s by as little.
    """
    scene = short(**{"bit.empirical.force": "nominal"})
    pipe, ends, drive = scene.string[0], scene.ends, scene.top_drive
    inertia = ends.top_inertia + ends.bottom_inertia + 2 * pipe.rotary_inertia * pipe.length
    wanted, law = drive.speed or 0.0, EmpiricalLaw.from_scene(scene)

    def rates(t: float, y: Any) -> list[float]:
        torque = 200 * (wanted - y[1]) + 100 * (wanted * t - y[0])
        return [y[1], (torque - law.torque(1e5, y[1])) / inertia]

    history = drillfem.simulate(scene, warn=False).history
    time = history["time"].values
    exact = solve_ivp(rates, (0, 20), [0.0, 70 * RPM], t_eval=time, rtol=1e-9, atol=1e-9).y
    spin = history["top_angular_speed"].values
    assert np.ptp(exact[1]) > 8  # from a near stall to far above the wanted speed
    assert np.abs(spin - exact[1]).max() < 0.35
    smooth = np.convolve(spin - exact[1], np.ones(11) / 11, "valid")
    assert np.abs(smooth).max() < 0.1


def test_steady_drilling_stays_steady_and_closes_its_balance() -> None:
    scene = short(**{"initial.state": "nominal", "initial.spin": None, "time.end": 3.0})
    result = drillfem.simulate(scene)
    steady, history = scene.nominal(), result.history
    assert history["bit_angular_speed"].values == pytest.approx(100 * RPM, abs=1e-6)
    assert history["bit_weight"].values == pytest.approx(1e5, rel=1e-6)
    assert history["bit_torque"].values == pytest.approx(LAW.torque(1e5, 100 * RPM), rel=1e-6)
    assert history["depth_of_cut"].values[-1] == pytest.approx(steady.depth_of_cut, rel=1e-6)
    assert result.summary["drilled_depth"] == pytest.approx(3 * steady.rate_of_penetration, rel=1e-6)
    assert "rock_volume" not in history
    assert result.summary["energy_balance_error"] < 1e-9


@pytest.mark.parametrize("force", ("reaction", "nominal"))
def test_the_demo_swings_without_sticking(force: str) -> None:
    """The first 8 s of appendix B.4 on the straight rung: an untwisted string, so the bit nearly stalls at 1 s."""
    overrides = {"model": "axial-torsional", "mesh.elements": 24, "time.step": 0.02, "output.interval": 0.1}
    result = drillfem.simulate(load_scene("vertical-pi", overrides | {"bit.empirical.force": force}), until=8.0)
    history = result.history
    spin = history["bit_angular_speed"].values
    assert spin[0] == pytest.approx(70 * RPM)
    assert history["bit_torque"].values[0] == pytest.approx(5127, abs=0.6)
    low = int(np.argmin(spin[:30]))
    assert 0.8 < spin[low] < 1.3 and 0.7 < history["time"].values[low] < 1.5
    assert (history["bit_weight"].values > 9.9e4).all()
    assert result.summary["energy_balance_error"] < 2e-5


def test_the_bit_of_a_heavy_string_follows_the_law_through_petsc() -> None:
    """The axial speed is the law's rate of penetration at the end of every step."""
    scene = short(**{"time.end": 1.0})
    rod = Rod(scene)
    u0 = initial_state(rod)
    rock = EmpiricalContact.from_scene(scene)
    stepper = Stepper(rod, u0, rock)
    rock.at_rest(float(u0[rod.bit.speed]), float(u0[rod.bit.spin]), 0.0)
    stepper.newton.start_depth = float(u0[rod.bit.depth])
    for _ in range(20):
        report = stepper.step(1.0)
        depth, speed, spin = rod.end_motion(stepper.u)
        law = rock.law.rate_of_penetration(float(rod.bit_load[0]), spin)
        assert speed == pytest.approx(law, rel=1e-6)
        rock.commit(0.0, depth - stepper.newton.start_depth, report.step, 0.0, 0.0, spin)
        stepper.newton.start_rotation = float(stepper.u[rod.bit.rotation])
    stepper.destroy()


@pytest.mark.verify
def test_appendix_b4_to_the_end() -> None:
    """100 s: no stick-slip. The string swings as one body on the integral of the drive, and that dies out slowly."""
    result = drillfem.simulate(load_scene("vertical-pi", {"model": "axial-torsional"}))
    history = result.history
    spin, time = history["bit_angular_speed"].values, history["time"].values
    assert result.summary["converged"] and result.summary["energy_balance_error"] < 1e-6
    assert spin.min() > 1.0
    late = time > 30
    peaks = [spin[late & (time < 50)].max(), spin[time > 50].max()]
    assert 15.0 < peaks[1] < peaks[0] < 17.0
    assert spin[time > 50].min() > 4.0
    assert result.summary["drilled_depth"] == pytest.approx(0.333, abs=0.003)
