"""The torsional string along its characteristics: exact waves, and agreement with the condensed finite elements."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from bitlab import C1
from scipy.interpolate import CubicSpline

from drillfem.bitrock import BitLaw, RockSurface
from drillfem.models.straight import Channel
from drillfem.scene import load_scene
from drillfem.solve.characteristics import CharacteristicString, Shaft, shafts_of, wave_step
from drillfem.solve.condensed import CondensedString, energy_imbalance
from drillfem.solve.straight import StraightRun

G, RHO, SPEED, MASS = 77e9, 7800.0, 14.42, 24614.4
PIPE = Shaft(1000.0, G * 1.218307e-5, RHO * 1.218307e-5)
COLLAR = Shaft(200.0, G * 5.199350e-5, RHO * 5.199350e-5)
INERTIA = 112.786  # (5-39)
PUBLISHED = [0.4534, 1.7108, 3.1781, 4.6768, 6.1440, 7.4014, 8.3083, 9.5657, 11.0329, 12.5316]


def string(step=1e-3, scheme="profile", spin=0.1, friction=0.8, alpha=1.0, arc_length=None, **options):
    """Case C1 of chapter 5 (spec 8.3): nominal drilling, the spin perturbed in proportion to the depth."""
    law = BitLaw(**{**C1, "friction": friction})
    cut = law.depth_of_cut(45.7e3)
    rock = RockSurface(scheme, 6, incline=-cut / (2 * np.pi))
    mass = Channel(np.array([[MASS]]), np.zeros((1, 1)), np.zeros((1, 1)), 0, 0, np.array([45.7e3]))
    shafts = [replace(s, inertia=alpha * s.inertia) for s in (PIPE, COLLAR)]
    x = np.linspace(0.0, 1200.0, 1201) if arc_length is None else arc_length
    options = {"top": SPEED, "hook_load": 0.0, "bit_inertia": (1 - alpha) * INERTIA} | options
    out = CharacteristicString(mass, shafts, x, law, rock, step, **options)
    out.reset(np.zeros(1), np.array([cut * SPEED / (2 * np.pi)]), out.nominal()[1], SPEED * (1 + spin * x / x[-1]))
    return out


def off_bottom(**options):
    """The same, with the bit high above the rock and rising."""
    out = string(spin=0.0, **options)
    out.surface.set_profile([lambda eta: 1e3 + eta])
    return out


def restart(out, twist, spin):
    out.reset(np.zeros(1), np.array([-50.0]), twist, spin)


def test_natural_frequencies():
    torsion = string().frequencies[1]
    np.testing.assert_allclose(torsion[:10], PUBLISHED, atol=5e-5)
    heavy = string(alpha=0.4).frequencies[1]
    assert np.abs(heavy - 6.68).min() < 0.005 and np.abs(heavy - 8.06).min() < 0.005  # spec 8.6
    # all inertia at the bit: pipes and collars are springs in series
    spring = 1 / (PIPE.length / PIPE.stiffness + COLLAR.length / COLLAR.stiffness)
    lumped = np.sqrt(spring / INERTIA) / (2 * np.pi)
    assert string(alpha=1e-4).frequencies[1][0] == pytest.approx(lumped, rel=1e-4)


def test_travel_times_are_whole_steps():
    times = [PIPE.travel_time, COLLAR.travel_time]
    step, counts, error = wave_step(times, 1e-3)
    assert error < 1e-14 and list(counts) == [320, 64] and step * 64 == pytest.approx(COLLAR.travel_time, rel=1e-14)
    step, counts, error = wave_step([1.0, 1.5, 0.75], 0.3)
    assert step == pytest.approx(0.25) and list(counts) == [4, 6, 3] and error < 1e-14
    step, counts, error = wave_step([1.0, np.sqrt(2.0)], 0.01)  # never: the best one, with its error
    assert step <= 0.01 and 0 < error < 1e-4
    assert np.abs(counts * step / [1.0, np.sqrt(2.0)] - 1).max() == pytest.approx(error, rel=1e-9)


def test_reflection_and_transmission_where_pipe_meets_collar():
    """field.md 3.4: spin is reflected by -.62033 and transmitted by .37967, torque by .62033 and 1.62033."""
    q = COLLAR.impedance / PIPE.impedance
    back, on = (1 - q) / (1 + q), 2 / (1 + q)
    assert (q, back, on) == pytest.approx((4.26768, -0.62033, 0.37967), abs=5e-6)
    assert (-back, q * on) == pytest.approx((0.62033, 1.62033), abs=5e-6)
    plain = string()
    step, pipe, collar = plain.internal_step, 320, 64
    centres = np.concatenate([(np.arange(pipe) + 0.5) / pipe * 1000, 1000 + (np.arange(collar) + 0.5) / collar * 200])
    out = off_bottom(step=step, top=0.0, arc_length=np.concatenate([[0.0], centres, [1200.0]]))
    # any waves running down the pipe, nothing else
    out._up[:] = out._down[:] = 0.0
    out._down[:, : pipe + 1] = np.random.default_rng(1).standard_normal((3, pipe + 1))
    before, moved = out.fields()["angular_speed"][1:-1], 40
    out.advance(moved)
    now = out.fields()
    spin = now["angular_speed"][1:-1]
    np.testing.assert_allclose(spin[moved : pipe - moved], before[: pipe - 2 * moved], atol=1e-13)
    # the first to arrive is the furthest back: reflected in reverse order
    sent = before[pipe - moved : pipe]
    up = spin[pipe - moved : pipe] - before[pipe - 2 * moved : pipe - moved]
    np.testing.assert_allclose(up, back * sent[::-1], atol=1e-13)
    np.testing.assert_allclose(spin[pipe : pipe + moved], on * sent, atol=1e-13)
    assert (spin[pipe + moved :] == 0).all() and (spin[:moved] == 0).all()


def test_a_mode_swings_for_ever():
    """Off bottom the first mode keeps shape and amplitude: a period is exact, whatever the step."""
    out = off_bottom(step=COLLAR.travel_time / 3, top=0.0, arc_length=np.linspace(0.0, 1200.0, 4801))
    assert out.internal_step == pytest.approx(out.step, rel=1e-12)
    f = out.frequencies[1][0]
    k = 2 * np.pi * f * PIPE.travel_time / PIPE.length
    s = out.arc_length
    # sine in the pipe, cosine from the free end in the collar
    shape = np.where(s < 1000, np.sin(k * s) * np.cos(k * 200) / np.sin(k * 1000), np.cos(k * (1200 - s)))
    restart(out, shape, np.zeros_like(s))
    h = out.advance(2000)  # 18 periods
    np.testing.assert_allclose(h["bit_angle"], np.cos(2 * np.pi * f * h["time"]), atol=2e-5)
    stored = h["kinetic_energy"] + h["strain_energy"] - 0.5 * MASS * h["bit_axial_speed"] ** 2
    assert np.ptp(stored) < 1e-7 * stored[0]


@pytest.mark.parametrize("alpha, tolerance", [(1.0, (2e-5, 1e-5)), (0.4, (1e-7, 1e-6))])
def test_agrees_with_finite_elements(alpha, tolerance):
    """Case C1 with the nominal start perturbed, up to the first stall of the bit; elements refined: closer."""
    until = 2.8 if alpha == 1 else 5.0
    scene = load_scene("cutting-c1", {"inertia.distributed": alpha, "rock.surface.scheme": "profile"})
    exact = _run(scene, "characteristics", until)
    errors = []
    for elements in (32, 64, 128):
        h = _run(replace(scene, mesh=replace(scene.mesh, elements=elements)).checked(), "condensed", until)
        errors.append([np.abs(h[n] - exact[n]).max() / np.abs(exact[n]).max() for n in ("bit_angle", "bit_depth")])
    assert (np.array(errors[-1]) < tolerance).all(), errors
    assert errors[-1][0] < 0.5 * errors[0][0], errors


def test_inertia_at_the_bit_leads_to_the_lumped_model():
    """Limit of case V2: all inertia but the share alpha at the bit, collars stiff in proportion (5.5.4)."""

    def history(model, alpha):
        stiff = {"youngs_modulus": 210e9, "shear_modulus": G / alpha, "density": RHO}
        over = {"model": model, "rock.surface.scheme": "profile", "time.engine": "characteristics"}
        if model == "lumped":
            over["time.engine"] = "condensed"
        else:
            over |= {"inertia.distributed": alpha, "string.1.material": stiff}
        h = StraightRun(load_scene("cutting-c1", over)).string.advance(5000, 4)
        return np.stack([h["bit_angle"], h["bit_depth"]])

    exact, alphas = history("lumped", 1.0), np.array([0.2, 0.1, 0.05, 0.025])
    errors = np.array([np.abs(history("torsional", a) - exact).max(axis=1) for a in alphas])
    rates = np.polyfit(np.log(alphas), np.log(errors), 1)[0]
    assert (rates > [0.8, 0.6]).all() and (errors[-1] < 5e-4 * np.abs(exact).max(axis=1)).all()


def _run(scene, engine, until, step=1e-3):
    from drillfem.models.straight import StraightString

    line, law = StraightString(scene), BitLaw.from_scene(scene)
    rock, ends = RockSurface.from_scene(scene), {"hook_load": scene.nominal().hook_load, "top": SPEED}
    if engine == "condensed":
        out = CondensedString(line.axial, line.torsion, law, rock, step, **ends)
    else:
        shafts, inertia = shafts_of(scene)
        out = CharacteristicString(line.axial, shafts, line.arc_length, law, rock, step, bit_inertia=inertia, **ends)
    out.reset(*line.start())
    return out.advance(round(until / step))


def test_steady_drilling_stays_steady():
    for alpha in (1.0, 0.4):
        h = string(spin=0.0, alpha=alpha).advance(1000)
        np.testing.assert_allclose(h["bit_angular_speed"], SPEED, rtol=1e-9)
        np.testing.assert_allclose(h["top_torque"], 3264.04, rtol=1e-5)
        np.testing.assert_allclose(h["bit_depth"], 2.89389e-3 * h["time"], rtol=2e-6)


@pytest.mark.parametrize("alpha, friction, size", [(1.0, 0.8, 1e-4), (0.8, 0.8, 1e-7), (1.0, 3.46, 1e-3)])
def test_energy_closes(alpha, friction, size):
    """To the error of the steps in which the bit sticks or slips: without inertia at the bit its spin jumps there."""
    out = string(alpha=alpha, friction=friction, scheme="dg")
    h = out.advance(10_000)
    assert out.counters["divided"] > 100
    turnover = h["work_top_drive"][-1] + h["work_gravity"][-1]
    assert np.abs(energy_imbalance(h)).max() < size * turnover
    assert h["work_cutting"][-1] == pytest.approx(0.252e9 * h["rock_volume"][-1], rel=5e-3)
    assert (h["dissipated"] == 0).all()


def test_energy_closes_with_a_moving_top_drive():
    """Top motion of case C3 (5-49), steady start: the bit feels nothing before the travel time, and all of it later."""

    def top(t):
        late = np.maximum(t - 2.0, 0.0)
        angle = SPEED * t + np.cos(2 * late) + 0.2 * np.cos(10 * late) - 1.2
        return angle, SPEED - 2 * np.sin(2 * late) - 2 * np.sin(10 * late)

    out = string(spin=0.0, top=top, top_inertia=10.0)
    h = out.advance(6000)
    assert np.abs(energy_imbalance(h)).max() < 1e-5 * h["work_top_drive"][-1]
    late = PIPE.travel_time + COLLAR.travel_time
    start = h["time"] < 2.0 + late - 0.01
    assert np.ptp(h["bit_angular_speed"][start]) < 5e-3 < 2 < np.ptp(h["bit_angular_speed"])
    np.testing.assert_allclose(h["top_angular_speed"], top(h["time"])[1], rtol=0, atol=5e-3)


def test_outputs_do_not_depend_on_the_chunks():
    whole = string(alpha=1.0).advance(3500, 7)
    first = string()
    a = first.advance(1234, 7)
    second = string()
    second.load(first.state_dict())
    assert second.sample() == first.sample()
    b = second.advance(3500 - 1234, 7)
    for name, values in whole.items():
        np.testing.assert_array_equal(np.concatenate([a[name], b[name]]), values, err_msg=name)


def test_outputs_between_the_internal_steps():
    """Rows at 1 ms lie between steps of 0.9946 ms; they agree with rows at those steps."""
    coarse = string(alpha=0.4)
    fine = string(alpha=0.4, step=coarse.internal_step)
    a, b = coarse.advance(1000), fine.advance(1030)
    for name, size in (("bit_angle", 1e-7), ("bit_depth", 1e-8), ("kinetic_energy", 1e-4)):
        inside = CubicSpline(b["time"], b[name])(a["time"])
        assert np.abs(a[name] - inside)[5:].max() < size * (1 if name != "kinetic_energy" else a[name].max()), name
    fields = coarse.fields()
    assert fields["angle"][-1] == pytest.approx(a["bit_angle"][-1], abs=1e-12)
    assert fields["angular_speed"][-1] == a["bit_angular_speed"][-1]
    assert fields["displacement"][0] == a["bit_depth"][-1]


def test_bad_strings_are_refused():
    with pytest.raises(ValueError, match="inertia = 0"):
        Shaft(1.0, 1.0, 0.0)
    with pytest.raises(ValueError, match="step = 0"):
        string(step=0.0)
    with pytest.raises(ValueError, match=re.escape("drill pipe: retardation_time = 0.0001 s: must be 0")):
        shafts_of(load_scene("vertical-c1-cd4"))
    out = string()
    x, body = out.arc_length, out.axial
    rest = (out.law, out.surface, 1e-3)
    with pytest.raises(ValueError, match="must run from the top to the bit"):
        CharacteristicString(body, [PIPE], x, *rest, hook_load=0.0, top=1.0)
    two = Channel(np.eye(2), np.zeros((2, 2)), np.zeros((2, 2)), 1, 0)
    with pytest.raises(ValueError, match="one rigid mass"):
        CharacteristicString(two, [PIPE, COLLAR], x, *rest, hook_load=0.0, top=1.0)
