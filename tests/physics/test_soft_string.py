"""The soft string against exact waves, closed forms, well A of Aarsnes and Shor, and another integrator."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

import drillfem
from drillfem.boreholes import build, straight
from drillfem.errors import SceneError
from drillfem.models.drive import DriveLaw, impedance, law_of, lowest_frequency, reflection, response, slip
from drillfem.models.soft_string import Line, Pieces, WallFriction, line_of, wall_friction
from drillfem.scene import load_scene
from drillfem.scene.frequencies import End, Uniform, standing_waves
from drillfem.solve.characteristics import Shaft
from drillfem.solve.soft_string import SoftString, SoftStringRun, merged

#: the thesis' pipe of chapter 4: stiffness and inertia
PIPE = Shaft(2500.0, 69e9 * 2.27682e-5, 7850 * 2.27682e-5)
SMOOTH = WallFriction(lambda s: (0 * s, 0 * s), np.ones_like, np.zeros(0))


def uniform(static: float, dynamic: float, **law: float | str) -> WallFriction:
    """The same friction torque per length all along (N m/m)."""
    return WallFriction(lambda s: (static + 0 * s, dynamic + 0 * s), np.ones_like, np.zeros(0), **law)


def steady(speed: float):
    return lambda t: (speed * t, np.full_like(t, speed))


def balance(rows) -> float:
    """Largest missing energy, over the largest work."""
    stored = rows["kinetic_energy"] + rows["strain_energy"]
    missing = rows["work_top_drive"] - rows["work_wall"] - rows["dissipated"] - stored
    return float(np.abs(missing - missing[0]).max() / max(np.abs(rows["work_top_drive"]).max(), stored.max()))


# -- waves ----------------------------------------------------------------------------------------------------
def test_waves_are_exact_without_friction():
    """The top jumps to a speed: the bit turns twice as fast from L/c to 3 L/c, stands until 5 L/c, and so on."""
    string = SoftString([PIPE], SMOOTH, 5e-3, law=None, top=steady(2.0))
    rows = string.advance(2000)
    travel = PIPE.travel_time
    expected = np.where(rows["time"] % (4 * travel) < travel, 0.0, 4.0)
    expected = np.where(rows["time"] % (4 * travel) > 3 * travel, 0.0, expected)
    away = np.abs((rows["time"] / travel) % 2 - 1) > 0.02  # outputs between two steps smear the jumps
    assert rows["bit_angular_speed"][away] == pytest.approx(expected[away], abs=1e-10)
    assert balance(rows) < 1e-13


def test_frequency_and_decay_with_damping_inside():
    """Free vibration of two sections: the frequency of exact waves, damping ratio c_d omega/2 (spec 3.3)."""
    two = [Shaft(2000.0, PIPE.stiffness, PIPE.inertia), Shaft(500.0, 3 * PIPE.stiffness, 3 * PIPE.inertia)]
    late = 0.02
    string = SoftString(two, SMOOTH, 1e-2, law=None, top=steady(0.0), damping=[late, late])
    first = 2 * math.pi * standing_waves([Uniform(*vars(x).values()) for x in two], End(True), End(False), 2.0)[0]
    string.reset(np.ones(len(string.arc_length)))  # all turns, and the top is stopped
    rows = string.advance(6000)
    w, t = rows["bit_angular_speed"], rows["time"]
    left = t > 25  # higher modes have died
    decay, turn = late * first**2 / 2, first * math.sqrt(1 - (late * first / 2) ** 2)

    def wave(p):
        return np.exp(-p[0] * t[left]) * (p[2] * np.cos(p[1] * t[left]) + p[3] * np.sin(p[1] * t[left]))

    found = least_squares(lambda p: wave(p) - w[left], [decay, turn, 1.0, 0.0], x_scale=[1e-3, 1, 1, 1], xtol=1e-13)
    assert found.x[1] == pytest.approx(turn, rel=5e-6)
    assert found.x[0] == pytest.approx(decay, rel=5e-4)
    assert balance(rows) < 1e-12


def test_steady_rotation_stays_steady():
    law = DriveLaw(200.0, 100.0, math.inf, 2900.0, 0.0)
    friction = replace(uniform(4.0, 2.0), drag=lambda s: 0.1 + 0 * s)
    string = SoftString([PIPE], friction, 5e-3, law=law, top=steady(10.0), bottom_inertia=300.0)
    string.reset(10.0)
    before, rows = string.fields(), string.advance(4000, 10)
    assert rows["bit_angular_speed"] == pytest.approx(np.full(400, 10.0), rel=1e-11)
    torque = 2500.0 * (string._rubbing(5, 10.0) / string.arc_length[1] + 0.1 * 10.0)
    assert rows["top_torque"] == pytest.approx(np.full(400, torque), rel=1e-9)
    assert rows["wall_torque"] == pytest.approx(np.full(400, torque - 2500.0), rel=1e-9)
    after = string.fields()
    assert after["torque"] == pytest.approx(before["torque"], abs=1e-8 * torque)
    assert after["torque"][0] == pytest.approx(-torque, rel=1e-6)
    # friction spread evenly: the twist is a parabola
    assert after["angle"][-1] - after["angle"][0] == pytest.approx(-torque * 2500.0 / 2 / PIPE.stiffness, rel=1e-4)


# -- the drive ------------------------------------------------------------------------------------------------
ZETA = PIPE.impedance
LAWS = {
    "pi": DriveLaw(200.0, 100.0, math.inf, 2900.0, 0.0),
    "soft-torque": DriveLaw(ZETA, (2 * math.pi * 0.3) ** 2 * 2900.0, math.inf, 2900.0, 0.0),
    "z-torque": DriveLaw(ZETA, 0.1 * 2 * math.pi * 0.3 * ZETA, math.inf, 2900.0, 1.0),
}


@pytest.mark.parametrize("kind", LAWS)
def test_reflection_at_the_drive(kind):
    """A pulse that runs up comes back as (Z - zeta)/(Z + zeta) says, at every frequency."""
    law = LAWS[kind]
    # a string so long that nothing comes back from below
    length, step = 300_000.0, 0.02
    string = SoftString([Shaft(length, PIPE.stiffness, PIPE.inertia)], SMOOTH, step, law=law, top=steady(0.0))
    dt = string.internal_step
    at = string.arc_length * string.shafts[0].travel_time / length
    string.reset(np.exp(-(((at - 3.0) / 0.5) ** 2)))  # half of it runs up, half down
    coming = string._up.copy()
    steps = int(90.0 / dt)
    rows = string.advance(int(steps * dt / step))
    middle = dt * (np.arange(steps - 4) + 0.5)  # where outputs have no error of interpolation, nor waves
    top = np.interp(middle, rows["time"], rows["top_angular_speed"])
    gone = top - coming[: len(middle)]
    omega = 2 * math.pi * np.fft.rfftfreq(len(middle), dt)
    part = (omega > 2 * math.pi * 0.1) & (omega < 2 * math.pi * 0.8)
    spectrum = np.fft.rfft(gone)[part] / np.fft.rfft(coming[: len(middle)])[part]
    expected = -reflection(law, omega[part].astype(complex), ZETA)
    assert spectrum == pytest.approx(expected, abs=4e-3)
    if kind == "soft-torque":
        assert abs(reflection(law, np.array([2 * math.pi * 0.3 + 0j]), ZETA)[0]) < 1e-12
    if kind == "z-torque":
        assert np.abs(reflection(law, omega[part].astype(complex), ZETA)).max() < 0.16


def test_drive_laws_of_scenes():
    scene = load_scene("off-bottom-soft-string")
    law = law_of(scene)
    assert law == DriveLaw(200.0, 100.0, math.inf, 2900.0, 0.0)
    zeta = math.sqrt(PIPE.stiffness * PIPE.inertia)
    tuned = {"top_drive.proportional_gain": None, "top_drive.integral_gain": None}
    soft = law_of(load_scene("off-bottom-soft-string", tuned | {"top_drive.kind": "soft-torque"}))
    lowest = lowest_frequency(scene)
    assert lowest == pytest.approx(math.sqrt(69e9 / 7850) / 4 / 2500, rel=1e-9)
    assert soft.proportional == pytest.approx(zeta, rel=1e-4)
    assert impedance(soft, np.array([2 * math.pi * lowest + 0j]))[0] == pytest.approx(soft.proportional)
    masked = law_of(load_scene("off-bottom-soft-string", tuned | {"top_drive.kind": "z-torque"}))
    assert masked.masks == 1.0
    assert law_of(load_scene("cutting-c1")) is None


def test_drive_response_and_its_derivatives():
    law = DriveLaw(200.0, 100.0, 5e3, 2900.0, 1.0)
    at = np.array([3.0, -2.0, 0.5])
    torque, *slopes = response(law, *at)
    assert torque == pytest.approx(100 * 3.0 - 200 * 2.0 + 2900 * 0.5)
    h = 1e-3
    for i, sign in enumerate((-1, -1, 1)):  # errors fall as angle and speed grow
        step = np.zeros(3)
        step[i] = h
        slope = (response(law, *(at + step))[0] - response(law, *(at - step))[0]) / (2 * h)
        assert sign * slope == pytest.approx(slopes[i])
    for sign in (1, -1):
        assert response(law, sign * 90.0, sign * 2.0, 0.0) == (sign * 5e3, 0.0, 0.0, 0.0)
        # at the limit the integral waits, unless the error leads back
        assert slip(law, sign * 90.0, sign * 2.0, 0.0, 0.01) == pytest.approx(sign * 0.02)
        assert slip(law, sign * 90.0, -sign * 2.0, 0.0, 0.01) == 0.0
    assert slip(law, 1.0, 1.0, 0.0, 0.01) == 0.0


@pytest.mark.parametrize("masks", [0.0, 1.0])
def test_torque_limit_without_wind_up(masks):
    """The drive stays at its limit while the string is stuck, and does not overshoot for it afterwards."""
    friction = uniform(4.0, 2.0, law="coulomb", threshold=0.5)
    weak = DriveLaw(2000.0, 2000.0, 2.5e3, 2900.0, masks)  # the string breaks loose at 10 kN m
    string = SoftString([PIPE], friction, 5e-3, law=weak, top=steady(5.0))
    rows = string.advance(8_000, 10)
    assert np.abs(rows["top_torque"]).max() <= 2.5e3 * (1 + 1e-12)
    assert rows["bit_angular_speed"].max() == 0.0
    assert np.abs(rows["top_angular_speed"][-200:]).max() < 1e-2
    assert balance(rows) < 1e-12
    strong = SoftString([PIPE], friction, 5e-3, law=weak._replace(limit=9e3), top=steady(5.0), damping=[2e-3])
    rows = strong.advance(30_000, 10)
    assert rows["top_torque"].max() == pytest.approx(9e3)
    assert rows["top_angular_speed"][-1000:].mean() == pytest.approx(5.0, rel=0.01)
    assert balance(rows) < 1e-12


# -- friction -------------------------------------------------------------------------------------------------
def test_second_order_and_the_same_as_another_integrator():
    """Smooth friction (4-7): second order, against finite elements in space and Runge-Kutta in time."""
    friction = uniform(3.0, 1.5, velocity_scale=2.0, regularisation=1.0)
    law = DriveLaw(800.0, 400.0, math.inf, 2900.0, 0.0)
    motion = lambda t: (0.4 * t**3 / 3, 0.4 * t**2)  # noqa: E731

    def errors(step):
        string = SoftString([PIPE], friction, step, law=law, top=motion, bottom_inertia=500.0)
        return string.advance(round(6.0 / step), round(0.24 / step))

    found = {step: errors(step) for step in (0.02, 0.01, 0.005, 0.00125)}
    for name in ("bit_angular_speed", "top_torque", "bit_angle"):
        fine = found[0.00125][name]
        gaps = [np.abs(found[h][name] - fine).max() / np.abs(fine).max() for h in (0.02, 0.01, 0.005)]
        assert math.log2(gaps[0] / gaps[2]) / 2 == pytest.approx(2.05, abs=0.2), name
    assert gaps[2] < 2e-3
    # finite differences on 500 cells, each half of a node's friction from either side
    n = 500
    h = PIPE.length / n
    inertia = np.full(n + 1, PIPE.inertia * h)
    inertia[[0, -1]] = PIPE.inertia * h / 2 + np.array([2900.0, 500.0])
    share = np.full(n + 1, h)
    share[[0, -1]] = h / 2
    peak = 2 * math.sqrt(3.0 * 1.5)

    def rates(t, y):
        phi, w = y[: n + 1], y[n + 1 :]
        u = 2.0 * w
        rub = share * (1.5 * np.sqrt(u * u + 1.0) + peak) * u / (u * u + 1.0)
        force = -rub
        shaft = PIPE.stiffness / h * np.diff(phi)
        force[:-1] += shaft
        force[1:] -= shaft
        angle, speed = motion(t)
        force[0] += 800.0 * (speed - w[0]) + 400.0 * (angle - phi[0])
        return np.concatenate([w, force / inertia])

    rows = found[0.005]
    out = solve_ivp(rates, (0, 6.0), np.zeros(2 * n + 2), method="RK45", rtol=1e-6, atol=1e-8, t_eval=rows["time"])
    assert rows["bit_angular_speed"] == pytest.approx(out.y[-1], abs=1e-3 * np.abs(out.y[-1]).max())
    assert rows["bit_angle"] == pytest.approx(out.y[n], abs=1e-3 * np.abs(out.y[n]).max())
    for rows in found.values():
        assert balance(rows) < 1e-12


def test_grid_is_made_fine_where_friction_falls_fast():
    steep = uniform(8.0, 2.0, velocity_scale=30.0)
    string = SoftString([PIPE], steep, 0.02, law=None, top=steady(1.0))
    assert string.internal_step < 0.02 / 2
    assert balance(string.advance(200)) < 1e-12
    with pytest.raises(SceneError, match=r"friction_velocity_scale = 20000: must be at most \d+ for time.step"):
        SoftString([PIPE], replace(steep, velocity_scale=2e4), 0.02, law=None, top=steady(1.0))
    with pytest.raises(ValueError, match="must be > 0"):
        SoftString([PIPE], steep, 0.0, law=None, top=steady(1.0))


def test_short_sections_are_joined():
    """A string cut into pieces is the same string; a stabiliser shorter than a cell counts by its mass and softness."""
    cut = [replace(PIPE, length=x) for x in (700.0, 3.0, 1797.0)]
    one, late = merged(cut, [1e-3] * 3, 5e-3)
    assert one == [PIPE]
    assert late == pytest.approx([1e-3])
    heavy = Shaft(2.0, 9 * PIPE.stiffness, 9 * PIPE.inertia)
    two, late = merged([PIPE, heavy, replace(PIPE, length=200.0)], [0.0, 0.0, 0.0], 5e-3)
    assert len(two) == 2
    assert two[0].length == 2502.0
    assert two[0].inertia * 2502.0 == pytest.approx(PIPE.inertia * (2500 + 18))
    assert 2502.0 / two[0].stiffness == pytest.approx((2500 + 2 / 9) / PIPE.stiffness)
    scene = load_scene("survey-p11-a-02", {"model": "soft-string"})
    run = SoftStringRun(scene)
    assert len(run.string.shafts) < len(scene.string)
    assert run.string.internal_step > 2e-3
    pieces = [Uniform(s.length, s.stiffness, s.inertia) for s in run.string.shafts]
    assert standing_waves(pieces, End(True), End(False), 1.0)[0] == pytest.approx(lowest_frequency(scene), rel=1e-5)


def test_side_load_of_the_specification():
    """q_N/(rho A g) of well A at 60 deg (spec 6): 1.20 at the kick-off, 0 at 1874 m, 0.866 at the end."""
    one = np.ones(1)
    hole = build(2600.0, 1500.0, 600.0 * 3 / math.pi, math.pi / 3, diameter=0.17)
    line = Line(hole, Pieces(2500.0 * one, 383.19 * one, 0.07326 * one, one))
    entry = math.sin(math.pi / 3) + 400 * math.cos(math.pi / 3) / (1800 / math.pi)  # tension over w R
    load = line.side_load(np.array([1000.0, 1500.01, 1874.0, 2099.0, 2400.0])) / 383.19
    assert load[[0, 1, 4]] == pytest.approx([0.0, entry, math.sin(math.pi / 3)], abs=1e-3)
    assert load[2] < 2e-3
    inclined = line.side_load(np.array([1800.0, 2400.0]), "inclination") / 383.19
    assert inclined == pytest.approx([0.5, math.sin(math.pi / 3)], rel=1e-6)


def test_friction_arguments():
    """At 100 rpm the law takes 0.244 of the contact speed and 0.158 of the spin (errata 20)."""
    for argument, coefficient in (("contact-speed", 0.244), ("spin", 0.158)):
        scene = load_scene("off-bottom-soft-string", {"soft_string.friction_argument": argument})
        run = SoftStringRun(scene)
        run.string.reset(10.472)
        whole = run.string.sample()["wall_torque"]
        levels = run.string._nodes[:, 1].sum() / 0.3
        assert whole / levels == pytest.approx(coefficient, abs=1e-3)


# -- well A ---------------------------------------------------------------------------------------------------
def well_a(**changes):
    run = SoftStringRun(load_scene("off-bottom-aarsnes-shor", changes))
    return run.scene, run


def test_well_a_statics_and_frequency():
    scene, run = well_a(**{"time.step": "1 ms"})
    levels = run.string._nodes[:, 1]
    assert run.string.break_off_torque == pytest.approx(0.3 * 32132, rel=1e-3)
    below = np.cumsum(levels[::-1])[::-1][1:]
    twist = run.string.internal_step * float((below / run.string._impedance).sum())
    assert twist == pytest.approx(0.3 * 50.478, rel=1e-3)
    pipe = run.friction.torque(np.array([2200.0]))[0][0]
    assert pipe == pytest.approx(0.3 * 24.314, rel=1e-3)
    # their code gives the collars the wave speed of the pipe: 0.2209 Hz; with their own it is 0.2261 Hz
    own = lowest_frequency(scene)
    assert own == pytest.approx(0.22613, rel=1e-4)
    pieces = [Uniform(s.length, s.section_stiffness().torsion, 2 * s.rotary_inertia) for s in scene.string]
    speed2 = pieces[0].stiffness / pieces[0].inertia
    theirs = [pieces[0], pieces[1]._replace(inertia=pieces[1].stiffness / speed2)]
    assert standing_waves(theirs, End(True), End(False), 1.0)[0] == pytest.approx(0.2209, abs=1e-4)


def test_well_a_breaks_off_at_its_torque():
    """Twisted up slowly, the bit lets go when the top carries the static friction of the whole string."""
    _, run = well_a()
    friction = run.friction
    string = SoftString(run.string.shafts, friction, 0.02, law=None, top=steady(0.12), damping=[0.05, 0.05])
    rows = string.advance(8_000)
    loose = int(np.argmax(rows["bit_angular_speed"] > 0.05))
    assert loose > 0
    assert rows["top_torque"][:loose].max() == pytest.approx(0.3 * 32132, rel=0.01)
    assert 0.12 * rows["time"][loose] == pytest.approx(0.3 * 50.478, rel=0.03)
    assert np.all(rows["bit_angular_speed"][: loose // 2] == 0.0)  # it sticks, it does not creep


def test_well_a_start_up():
    """Start-up peak 17.2 kN m with their lag of 1 s, and stick-slip with their period."""
    _, run = well_a()
    speed = 2 * math.pi

    def lagging(t):
        return speed * (t - 1 + np.exp(-t)), speed * (1 - np.exp(-t))

    law = law_of(run.scene)
    string = SoftString(run.string.shafts, run.friction, 4e-3, law=law, top=lagging, damping=[1e-3, 1e-3])
    rows = string.advance(25_000)
    t, torque, bit = rows["time"], rows["top_torque"], rows["bit_angular_speed"]
    assert torque[t < 2].max() == pytest.approx(17.2e3, rel=0.01)
    late = t > 40
    starts = t[1:][late[1:] & (bit[1:] > 1) & (bit[:-1] <= 1)]
    assert np.diff(starts).mean() == pytest.approx(5.65, rel=0.02)
    assert np.diff(starts).std() < 0.2
    assert bit.max() * 30 / math.pi == pytest.approx(197, abs=4)
    assert [torque[late].min(), torque[late].max()] == pytest.approx([-4.4e3, 12.8e3], abs=0.5e3)
    assert balance(rows) < 1e-12


# -- runs -----------------------------------------------------------------------------------------------------
SHORT = {"time.end": 3.0, "output.checkpoint_interval": 0.5, "output.fields_interval": 0.5}


def test_run_and_resume_to_the_bit(tmp_path):
    scene = load_scene("off-bottom-aarsnes-shor", SHORT | {"output.interval": "40 ms"})
    whole = drillfem.simulate(scene)
    drillfem.simulate(scene, tmp_path / "part", until=1.3)
    continued = drillfem.resume(tmp_path / "part", until=3.0)
    assert whole.history.identical(continued.history)
    assert whole.fields.equals(continued.fields)


def test_results_of_a_run():
    scene = load_scene("off-bottom-soft-string", SHORT)
    result = drillfem.simulate(scene)
    summary, history, fields = result.summary, result.history, result.fields
    assert summary["model"] == "soft-string"
    assert summary["energy_balance_error"] < 1e-12
    assert summary["natural_frequencies"]["torsional"]
    assert {"bit_angular_speed", "top_torque", "wall_torque", "side_force", "work_wall"} <= set(history)
    assert history["top_torque"].attrs["units"] == "N m"
    assert {"spin", "torque", "wall_side_force", "position"} <= set(fields)
    end = fields["position"].values[-1, -1]
    assert end == pytest.approx(scene.borehole.frame(scene.length).position[0])
    across = np.sum(fields["director1"].values * fields["director3"].values, axis=2)
    assert np.abs(across).max() < 1e-12


def test_chunks_of_any_size_agree_to_the_bit():
    scene = load_scene("off-bottom-soft-string")
    one, many = SoftStringRun(scene).string, SoftStringRun(scene).string
    whole = one.advance(400, 2)
    parts = [many.advance(k, 2) for k in (1, 2, 97, 150, 149, 1)]
    for name, values in whole.items():
        assert np.array_equal(values, np.concatenate([p[name] for p in parts])), name
    assert np.array_equal(one.fields()["torque"], many.fields()["torque"])


def test_without_friction_it_is_the_torsional_string():
    """A vertical hole presses on nothing: start-up by an imposed speed gives the exact waves."""
    keys = {"hole.kind": "straight", "hole.kick_off": None, "hole.radius": None, "hole.final_inclination": None}
    keys |= {"top_drive.kind": "imposed-speed", "top_drive.proportional_gain": None, "top_drive.integral_gain": None}
    scene = load_scene("off-bottom-soft-string", SHORT | keys | {"initial.state": "rest", "ends.top_inertia": 0})
    result = drillfem.simulate(scene)
    t, w = result.history["time"].values, result.history["bit_angular_speed"].values
    travel = scene.length / math.sqrt(69e9 / 7850)
    assert w[(t > 1.02 * travel) & (t < 2.98 * travel)] == pytest.approx(2 * scene.top_drive.speed, rel=1e-9)
    assert float(result.history["side_force"][-1]) == 0.0


def test_mud_slows_the_string():
    """Laminar drag between cylinders, Couette: 4 pi mu/(1/r_i^2 - 1/r_o^2) per length."""
    scene = load_scene("off-bottom-soft-string", {"mud.density": 1200.0, "mud.viscosity": 0.05})
    drag = wall_friction(scene).drag(np.array([100.0, 2000.0]))
    inner, outer = 0.073264, 0.083264
    assert drag == pytest.approx(4 * math.pi * 0.05 / (1 / inner**2 - 1 / outer**2), rel=1e-6)
    run = SoftStringRun(scene)
    speed = scene.top_drive.speed
    run.string.reset(speed)
    rows = run.string.advance(100)
    assert rows["dissipated"][-1] == pytest.approx(drag[0] * 2500 * speed**2 * rows["time"][-1], rel=1e-6)
    dry = line_of(load_scene("off-bottom-soft-string")).hanging(np.zeros(1))
    assert line_of(scene).hanging(np.zeros(1)) / dry == pytest.approx(1 - 1200 / 7850)


def test_a_soft_string_needs_a_wall():
    for keys, words in (
        ({"contact": None}, "contact"),
        ({"hole.diameter": "120 mm"}, "must be larger"),
    ):
        with pytest.raises(SceneError, match=words):
            line_of(load_scene("off-bottom-soft-string", keys))
    assert straight(10.0, diameter=0.2).length == 10.0
