"""The condensed string: frequencies, integrators and their order, energy, and the thesis' chapter 6 vertical cases."""

from __future__ import annotations

import numpy as np
import pytest
from bitlab import C1

from drillfem.bitrock import BitLaw, RockSurface
from drillfem.scene import load_scene
from drillfem.solve.condensed import INTEGRATORS, Channel, CondensedString, energy_imbalance, stable_step
from drillfem.solve.straight import StraightRun

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
    retardation,
    step=1e-3,
    scheme="dg",
    elements=(53, 11),
    spin=0.1,
    top=SPEED,
    collar_retardation=None,
    parts=None,
    integrator="exact",
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
    bit = BitLaw(**C1)
    cut = bit.depth_of_cut(WEIGHT_ON_BIT)
    rock = RockSurface(scheme, 6, incline=-cut / (2 * np.pi))
    hook = float(axial.load.sum() - WEIGHT_ON_BIT)
    string = CondensedString(
        axial, torsion, bit, rock, step, hook_load=hook, top=top, parts=parts, integrator=integrator
    )
    u, twist = string.nominal()
    string.reset(u, np.full(len(s), cut * SPEED / (2 * np.pi)), twist, SPEED * (1 + spin * s / s[-1]))
    return string


def lumped(blades, step, surface, friction=0.3, weight=7.0, spin=0.0, integrator="exact", parts=None):
    """M1 in the units of appendix C.2: psi = 50, lambda = 5, omega_0 = 5, W = d + lambda g, T = d + beta lambda g."""
    law = BitLaw(
        specific_energy=0.5, contact_strength=2.5, contact_strength_stalled=2.5, radius=2.0, wear_flat_length=1.0,
        inclination=1.0, friction=friction, blades=blades,
        axial_regularisation=0.0, torsional_regularisation=0.0, cutting_regularisation=0.0,
    )  # fmt: skip
    cut = law.depth_of_cut(weight)
    rock = RockSurface(*surface[:1], blades, incline=-cut / (2 * np.pi), **surface[1])
    axial = Channel(np.array([[1 / 50.0]]), np.zeros((1, 1)), np.zeros((1, 1)), 0, 0, np.array([weight]))
    spring = np.array([[1.0, -1.0], [-1.0, 1.0]])
    torsion = Channel(np.diag([0.0, 1.0]), 0 * spring, spring, 1, 0)
    string = CondensedString(
        axial, torsion, law, rock, step, hook_load=0.0, top=5.0, integrator=integrator, parts=parts
    )
    u, twist = string.nominal()
    string.reset(u, np.array([cut * 5.0 / (2 * np.pi)]), twist, np.array([5.0, 5.0 * (1 + spin)]))
    return string


def test_natural_frequencies_of_the_string():
    axial, torsion = c1_string(1e-3).frequencies
    np.testing.assert_allclose(axial[:9], [0, 1.69, 4.02, 6.49, 8.96, 11.28, 12.97, 14.66, 16.99], atol=0.006)
    published = [0.4534, 1.7108, 3.1781, 4.6768, 6.1440, 7.4014, 8.3083, 9.5657, 11.0329, 12.5316]
    np.testing.assert_allclose(torsion[:10], published, atol=6e-5)


@pytest.mark.parametrize("surface", [("dg", {"degree": 2, "elements": 16}), ("profile", {})])
def test_growth_of_the_self_excitation(surface):
    """Linear anchor of the lumped model, n = 4: 2.79763 + 14.66778 i."""
    string = lumped(4, 1e-3, surface, spin=1e-6)
    h = string.advance(4000)
    y = h["bit_axial_speed"][2000:] - 2.0 * 5.0 / (2 * np.pi)
    assert np.abs(y).max() < 0.1
    y, order = y[::20], 8
    columns = np.lib.stride_tricks.sliding_window_view(y, order + 1)
    coefficients = np.linalg.lstsq(columns[:, :-1], columns[:, -1], rcond=None)[0]
    rates = np.log(np.roots(np.append(1.0, -coefficients[::-1])).astype(complex)) / 0.02
    assert np.abs(rates - (2.79763 + 14.66778j)).min() < 2e-4


@pytest.mark.parametrize("blades, friction, low, high, rate", [
    (8, 0.3, 0.91, 9.09, None), (10, 0.3, 1.51, 8.49, None), (4, 1.3, 4.93, 5.09, 1.304), (6, 1.3, 4.94, 5.07, 1.218),
])  # fmt: skip
def test_lumped_model_without_stick(blades, friction, low, high, rate):
    """field.md 3.5, statistics on 200-250: range of the spin, and rate of penetration over the nominal one."""
    h = lumped(blades, 2e-3, ("profile", {}), friction, spin=0.1).advance(125_000)
    late = h["time"] >= 200
    spin, depth = h["bit_angular_speed"][late], h["bit_depth"][late]
    assert spin.min() == pytest.approx(low, abs=0.03) and spin.max() == pytest.approx(high, abs=0.03)
    if rate is not None:
        assert (depth[-1] - depth[0]) / 50.0 / (10.0 / (2 * np.pi)) == pytest.approx(rate, abs=0.004)


def test_set_valued_law_at_small_steps():
    """The spin may leave zero as slowly as it likes: the path of the bit over the turn has any slope then."""
    h = lumped(6, 2.5e-3, ("profile", {}), spin=0.1).advance(20_000)
    assert h["bit_angular_speed"].min() < 0.01 and all(np.isfinite(values).all() for values in h.values())


def start_with_a_pulse(string):
    """Steady drilling, and a smooth pulse of spin on its way to the bit: nothing that a step must resolve jumps."""
    u, twist = string.nominal()
    s = np.linspace(0, 1, len(u))
    pulse = np.where(abs(s - 0.6) < 0.3, np.cos(np.pi * (s - 0.6) / 0.6) ** 8, 0.0)
    string.reset(u, np.full(len(u), string.sample()["bit_axial_speed"]), twist, SPEED * (1 + 0.2 * pulse))


@pytest.mark.parametrize("integrator, scheme, steps, order, size", [
    ("exact", "profile", (8e-3, 4e-3, 2e-3), 3.7, 2e-10), ("exact", "dg", (4e-3, 2e-3), 1.0, 2e-9),
    ("trapezoidal", "profile", (4e-3, 2e-3, 1e-3), 1.9, 5e-5), ("explicit", "profile", (8e-4, 4e-4), 1.9, 1e-5),
])  # fmt: skip
def test_order_in_the_step(integrator, scheme, steps, order, size):
    """Angle of a bit that cuts throughout; exact modes with a parabola for the cutting force: fourth order."""

    def run(step, integrator):
        string = c1_string(1e-4, step=step, scheme=scheme, elements=(26, 6), integrator=integrator)
        start_with_a_pulse(string)
        h = string.advance(round(0.56 / step), round(8e-3 / step))
        assert string.counters["divided"] == 0
        return h["bit_angle"]

    exact = run(2.5e-4, "exact")
    errors = np.array([np.abs(run(h, integrator) - exact).max() for h in steps])
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] > order
    assert errors[-1] < size


def test_second_order_where_the_bit_sticks():
    """A step in which the bit begins or ceases to stick is resolved by its parts; all else is much better."""

    def run(step, parts):
        string = c1_string(1e-4, step=step, scheme="profile", spin=0.6, elements=(26, 6), parts=parts)
        h = string.advance(round(2.0 / step), round(4e-3 / step))
        return np.stack([h["bit_angle"], h["bit_depth"]]), string.counters

    exact, counters = run(2.5e-4, 8)
    assert counters["divided"] > 1000
    coarse, fine = (np.abs(run(2e-3, parts)[0] - exact).max(axis=1) for parts in (4, 8))
    assert (coarse > 3 * fine).all() and (fine < np.abs(exact).max(axis=1) * [1e-5, 1e-4]).all()


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_integrators_swing_like_themselves(integrator):
    """One torsional mode off bottom: the frequency of each integrator is known."""
    step = 0.1
    string = lumped(4, step, ("profile", {}), integrator=integrator, parts=1)
    string.surface.set_profile([lambda eta: 2.0 + eta])
    string.reset(np.array([0.0]), np.array([-1000.0]), np.zeros(2), np.array([5.0, 9.0]))
    t = step * np.arange(1, 21)
    swing = string.advance(20)["bit_angle"] - 5 * t
    turned = {"exact": step, "trapezoidal": 2 * np.arctan(step / 2), "explicit": 2 * np.arcsin(step / 2)}[integrator]
    np.testing.assert_allclose(swing, swing[0] / np.sin(turned) * np.sin(turned * t / step), atol=1e-12)


def test_explicit_steps_are_refused_beyond_the_stability_limit():
    string = c1_string(1e-4, elements=(10, 3))
    limit = stable_step(string.axial, string.torsion)
    assert limit == pytest.approx(1 / (np.pi * max(f.max() for f in string.frequencies)), rel=1e-9)
    with pytest.raises(ValueError, match=f"stable up to {limit:.4g} s"):
        c1_string(1e-4, elements=(10, 3), step=1.001 * limit, integrator="explicit")
    with pytest.raises(ValueError, match="must be one of exact, trapezoidal, explicit"):
        c1_string(1e-4, elements=(10, 3), integrator="bdf")
    h = c1_string(1e-2, elements=(10, 3), step=0.99 * limit, integrator="explicit").advance(3000)
    assert np.abs(h["bit_angular_speed"]).max() < 20


@pytest.mark.parametrize("integrator, size", [("trapezoidal", 1e-12), ("explicit", 1e-4)])
def test_energy_of_the_classical_integrators(integrator, size):
    """The trapezoidal rule keeps the books to round-off; central differences to their error, and of second order."""
    errors = []
    for step in (4e-4, 2e-4):
        h = c1_string(1e-4, step=step, elements=(26, 6), spin=0.5, integrator=integrator).advance(round(3 / step))
        errors.append(np.abs(energy_imbalance(h)).max() / (h["work_top_drive"][-1] + h["work_gravity"][-1]))
    assert errors[1] < size
    assert integrator == "trapezoidal" or 1e-12 < errors[1] < errors[0] / 3


@pytest.mark.parametrize("retardation, divided", [(1e-2, False), (1e-4, True), (1e-5, True)])
def test_energy_closes(retardation, divided):
    string = c1_string(retardation, spin=0.5)
    h = string.advance(20_000)
    assert (string.counters["divided"] > 0) == divided
    turnover = h["work_top_drive"][-1] + h["work_gravity"][-1]
    assert np.abs(energy_imbalance(h)).max() < 1e-6 * turnover
    assert h["dissipated"][-1] > 0 and np.diff(h["dissipated"]).min() > -1e-6
    # what the cutting forces do is the specific energy of the rock that is gone (and a thousandth of axial work)
    assert h["work_cutting"][-1] == pytest.approx(0.252e9 * h["rock_volume"][-1], rel=5e-3)


def test_energy_closes_with_a_moving_top_drive():
    """Top motion of case C3 (5-49): its acceleration jumps at t = 2 s."""

    def top(t):
        late = np.maximum(t - 2.0, 0.0)
        angle = SPEED * t + np.cos(2 * late) + 0.2 * np.cos(10 * late) - 1.2
        return angle, SPEED - 2 * np.sin(2 * late) - 2 * np.sin(10 * late)

    errors = []
    for step in (2e-3, 1e-3):
        h = c1_string(1e-2, step=step, spin=0.0, top=top).advance(round(6 / step))
        errors.append(np.abs(energy_imbalance(h)).max() / h["work_top_drive"][-1])
        start = h["time"] < 2.0
        np.testing.assert_allclose(h["bit_angular_speed"][start], SPEED, rtol=1e-9)
        assert np.ptp(h["bit_angular_speed"]) > 2
    assert errors[1] < 2e-6 and errors[0] > 3 * errors[1]


def test_steady_drilling_stays_steady():
    h = c1_string(1e-2, spin=0.0).advance(2000)
    np.testing.assert_allclose(h["bit_angular_speed"], SPEED, rtol=1e-9)
    np.testing.assert_allclose(h["bit_weight"], WEIGHT_ON_BIT, rtol=1e-9)
    np.testing.assert_allclose(h["top_torque"], 3264.04, rtol=1e-5)
    np.testing.assert_allclose(h["bit_depth"], 2.89389e-3 * h["time"], rtol=2e-6)


def test_coupled_damping_agrees_with_modal_damping_and_closes():
    """Two retardation times couple the modes; nearly equal ones must give what equal ones give."""
    small = {"elements": (10, 3), "step": 1e-3, "spin": 0.3}
    equal = c1_string(1e-3, **small).advance(1500)
    near = c1_string(1e-3, collar_retardation=1e-3 * (1 + 1e-7), **small).advance(1500)
    for name in ("bit_angle", "bit_depth", "bit_torque", "dissipated", "top_torque"):
        np.testing.assert_allclose(near[name], equal[name], rtol=1e-6, atol=1e-6 * np.abs(equal[name]).max())
    other = c1_string(1e-4, collar_retardation=1e-2, **small).advance(1500)
    assert np.abs(energy_imbalance(other)).max() < 1e-9 * other["work_top_drive"][-1]
    assert np.abs(other["bit_torque"] - equal["bit_torque"]).max() > 1.0


def test_chunks_and_checkpoints_repeat_to_the_bit():
    for scheme in ("dg", "profile"):
        whole = c1_string(1e-5, scheme=scheme, spin=0.6).advance(3000, 7)
        first = c1_string(1e-5, scheme=scheme, spin=0.6)
        a = first.advance(1234, 7)
        second = c1_string(1e-5, scheme=scheme, spin=0.6)
        second.load(first.state_dict())
        b = second.advance(3000 - 1234, 7)
        for name, values in whole.items():
            np.testing.assert_array_equal(np.concatenate([a[name], b[name]]), values, err_msg=name)


def test_fields_belong_to_the_outputs():
    string = c1_string(1e-5, spin=0.6)
    h = string.advance(2345)
    fields, mass = string.fields(), string.torsion.mass
    assert fields["angle"][-1] == pytest.approx(h["bit_angle"][-1], rel=1e-12)
    assert fields["angular_speed"][-1] == pytest.approx(h["bit_angular_speed"][-1], rel=1e-9)
    assert fields["axial_speed"][-1] == pytest.approx(h["bit_axial_speed"][-1], rel=1e-9)
    kinetic = fields["angular_speed"] @ mass @ fields["angular_speed"] / 2
    kinetic += fields["axial_speed"] @ string.axial.mass @ fields["axial_speed"] / 2
    assert kinetic == pytest.approx(h["kinetic_energy"][-1], rel=1e-10)
    strain = fields["angle"] @ string.torsion.stiffness @ fields["angle"] / 2
    strain += fields["displacement"] @ string.axial.stiffness @ fields["displacement"] / 2
    assert strain == pytest.approx(h["strain_energy"][-1], rel=1e-8)
    gravity = string.axial.load @ (fields["displacement"] - string.nominal()[0])
    assert gravity == pytest.approx(h["work_gravity"][-1], rel=1e-8)


def test_one_free_mode_is_exact():
    """A bit off bottom: modes swing freely, whatever the step."""
    for step in (1e-3, 0.05):
        string = lumped(4, step, ("profile", {}))
        string.surface.set_profile([lambda eta: 2.0 + eta])
        string.reset(np.array([0.0]), np.array([-50.0]), np.zeros(2), np.array([5.0, 9.0]))
        h = string.advance(round(0.2 / step))
        t = h["time"]
        assert h["bit_torque"].max() == 0
        np.testing.assert_allclose(h["bit_angle"], 5 * t + 4 * np.sin(t), atol=1e-12)
        np.testing.assert_allclose(h["bit_depth"], -50 * t + 0.5 * 350 * t**2, atol=1e-11)


def test_a_stuck_bit_does_not_ring():
    """Without division, modes beyond the sampling rate answer a sticking bit with the wrong sign (known wrong way)."""

    def rattle(parts):
        v = c1_string(1e-5, spin=0.6, parts=parts).advance(40_000)["bit_axial_speed"][20_000:]
        power = np.abs(np.fft.rfft(v - v.mean())) ** 2
        return power[np.fft.rfftfreq(len(v), 1e-3) > 450].sum() / power.sum()

    assert c1_string(1e-5).parts == (2, 2)
    assert 20 * rattle(None) < rattle(1)


def apart(string, other, until, spacing=0.05):
    """Separation of two runs in spin, axial speed and depth of cut, scaled: the largest of each second."""
    a, b = (x.advance(round(until / x.step), round(spacing / x.step)) for x in (string, other))
    d = sum(
        ((a[n] - b[n]) / np.abs(a[n] - a[n].mean()).max()) ** 2
        for n in ("bit_angular_speed", "bit_axial_speed", "depth_of_cut")
    )
    return np.sqrt(d).reshape(round(until), -1).max(axis=1)


def test_the_lumped_model_is_predictable():
    """Case C1: runs that start 1e-8 apart in spin stay so for good, although the bit sticks and slips both ways."""

    def start(nudge):
        over = {"model": "lumped", "rock.surface.scheme": "profile", "initial.spin_perturbation": 0.1 * (1 + nudge)}
        return StraightRun(load_scene("cutting-c1", over)).string

    one = start(0.0)
    d = apart(one, start(1e-8), 80)
    assert one.counters["divided"] > 1000 and one.counters["solved"] > 1000
    assert d.max() < 1e-6 and np.median(d[40:]) < 10 * np.median(d[:10])


def test_little_damping_is_chaotic():
    """c_d = 1e-5 s: nearby runs part exponentially, at a rate that no nudge changes; c_d = 1e-4 s: they do not."""
    damped = apart(c1_string(1e-4, step=2e-3), c1_string(1e-4, step=2e-3, spin=0.1 * (1 + 1e-8)), 60)
    assert damped.max() < 1e-5
    rates = []
    for nudge in (1e-10, 1e-8):
        d = apart(c1_string(1e-5, step=2e-3), c1_string(1e-5, step=2e-3, spin=0.1 * (1 + nudge)), 60)
        rates.append(np.polyfit(np.arange(20, 60), np.log(d[20:]), 1)[0])
        assert d[-5:].max() > 1e3 * nudge
    assert 0.08 < min(rates) and max(rates) < 0.3


def test_inertia_at_the_bit_leads_to_the_lumped_model():
    """All inertia but the share alpha at the bit, collars stiff in proportion (5.5.4): the axial waves die out, too."""

    def history(model, alpha):
        stiff = {"youngs_modulus": 210e9, "shear_modulus": 77e9 / alpha, "density": 7800.0}
        over = {"model": model, "rock.surface.scheme": "profile", "mesh.elements": 24}
        if model != "lumped":
            over |= {"inertia.distributed": alpha, "string.1.material": stiff}
        return StraightRun(load_scene("cutting-c1", over)).string.advance(2000, 4)["bit_angle"]

    exact, alphas = history("lumped", 1.0), np.array([6.4e-3, 3.2e-3, 1.6e-3])
    errors = [np.abs(history("axial-torsional", a) - exact).max() for a in alphas]
    assert np.polyfit(np.log(alphas), np.log(errors), 1)[0] > 0.8
    assert errors[-1] < 2e-4 * np.abs(exact).max()


def spectrum(history, name, window):
    some = (history["time"] > window[0]) & (history["time"] <= window[1])
    y = history[name][some]
    y = y - y.mean()
    return np.fft.rfftfreq(len(y), history["time"][1] - history["time"][0]), 2 * np.abs(np.fft.rfft(y)) / len(y)


def peak(history, name, window, low=0.2, high=60.0):
    f, amplitude = spectrum(history, name, window)
    some = (f > low) & (f < high)
    k = np.argmax(amplitude[some])
    return f[some][k], amplitude[some][k]


def test_case_cd2_decays():
    h = c1_string(1e-2).advance(60_000, 10)
    end = h["time"] > 40
    assert h["bit_torque"][end].mean() == pytest.approx(3264, abs=2)
    assert np.ptp(h["bit_angular_speed"][end]) < 0.25 * np.ptp(h["bit_angular_speed"][h["time"] < 20])
    assert peak(h, "bit_angular_speed", (40, 60))[0] == pytest.approx(0.45, abs=0.03)


def test_case_cd3_locks_axially():
    h = c1_string(1e-3).advance(200_000, 5)
    assert peak(h, "bit_axial_speed", (90, 110))[0] == pytest.approx(13.12, abs=0.06)
    assert peak(h, "bit_axial_speed", (180, 200))[0] == pytest.approx(13.1, abs=0.06)
    torsion = [peak(h, "bit_angular_speed", w, high=1.0)[1] for w in ((0, 20), (90, 110), (180, 200))]
    assert torsion[0] > 3 * torsion[1] > 6 * torsion[2]


def test_case_cd4_keeps_swinging_without_stick():
    h = c1_string(1e-4).advance(200_000, 5)
    assert peak(h, "bit_axial_speed", (0, 20))[0] == pytest.approx(13.1, abs=0.1)
    assert peak(h, "bit_angular_speed", (90, 110), 1.0)[0] == pytest.approx(3.2, abs=0.06)
    assert peak(h, "bit_angular_speed", (180, 200), high=1.0)[1] > 0.5
    assert h["bit_angular_speed"].min() > 5.0


def test_case_cd5_sticks_and_slips():
    h = c1_string(1e-5).advance(200_000, 5)
    late = h["time"] > 100
    assert peak(h, "bit_angular_speed", (180, 200), 10.0)[0] == pytest.approx(16.16, abs=0.06)
    assert h["bit_angular_speed"][late].min() < 0.05 and h["bit_angular_speed"].max() > 28
    assert h["bit_torque"][h["time"] > 195].mean() == pytest.approx(3300, rel=0.04)
