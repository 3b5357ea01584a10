"""Motions with known answers: spin-up (appendix B.2), pendulum (B.1), free flight, waves; and rung against rung."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from rodlab import Array, bar, dynamic, gauss, order, put, stepped, take
from scipy.spatial.transform import Rotation
from scipy.special import ellipk

from drillfem.errors import SimulationError
from drillfem.models.initial import initial_state
from drillfem.models.modes import natural_frequencies
from drillfem.models.rod import Rod
from drillfem.scene import Scene, load_scene
from drillfem.solve.dynamics import march


# -- spin-up ----------------------------------------
def spin_up(step: float, end: float, damping: float = 0.0, elements: int = 16, **keys: Any) -> Array:
    """Rows (t, stretch u, lag v) of the tip in the frame that turns with the drive."""
    scene = load_scene("spin-up", {"string.0.retardation_time": damping, "time.end": end, "mesh.elements": elements})
    rod, rows = Rod(scene), []

    def observe(t: float, u: Array) -> None:
        angle = scene.top_drive.motion(t)[0]
        x, z = (take(rod, u, name)[-1] for name in ("r1", "r3"))
        c, s = math.cos(angle), math.sin(angle)
        rows.append((t, s * x + c * z - rod.length, c * x - s * z))

    march(rod, initial_state(rod), end, time=stepped(scene, step, **keys), observe=observe)
    return np.array(rows)


def extremum(t: Array, y: Array) -> tuple[float, float]:
    """Time and value of the minimum, by the parabola through its three points."""
    i = int(np.argmin(y))
    a, b, c = np.polyfit(t[i - 1 : i + 2] - t[i], y[i - 1 : i + 2], 2)
    return float(t[i] - b / (2 * a)), float(c - b**2 / (4 * a))


def test_spin_up_lags_as_published() -> None:
    found = []
    for step in (0.02, 0.01):
        history = spin_up(step, 7.2, integrator="theta")
        found.append([*extremum(history[:, 0], history[:, 2]), *extremum(history[:, 0], history[:, 1])])
    t_lag, lag, t_short, shortest = (4 * np.array(found[1]) - found[0]) / 3  # second order in the step, taken out
    assert lag == pytest.approx(-0.5738, abs=5e-5)
    assert t_lag == pytest.approx(6.762, abs=1e-3)
    assert shortest == pytest.approx(-0.01882, abs=1e-5)
    assert t_short == pytest.approx(6.74, abs=1e-3)


STEADY = 10 * (math.tan(k := 60 * math.sqrt(1.2 / 2.8e7)) / k - 1)


def test_spun_up_rod_is_stretched_by_its_own_inertia() -> None:
    assert pytest.approx(5.1432e-4, abs=1e-8) == STEADY
    # generalised-alpha: equilibrium holds at the stage inside the step, whose ends lie outside by (omega h)^2/8 L
    # damping kills the vibration left by the spin-up; on the steady state it does not act
    steps = [0.04, 0.02, 0.01]
    error = [spin_up(h, 22.0, damping=0.3, elements=4)[-1, 1] - STEADY for h in steps]
    assert order(steps, error) == pytest.approx(2.0, abs=0.02)
    assert error[-1] == pytest.approx((6 * 0.01) ** 2 / 8 * 10, rel=0.1)
    # a method of high order needs none of this: the scene as it ships
    keys = {"damping": 0.3, "elements": 4, "integrator": "arkimex", "order": 4}
    error = [spin_up(h, 22.0, **keys)[-1, 1] - STEADY for h in (0.05, 0.025)]
    assert order((0.05, 0.025), error) > 3.6
    assert error[-1] == pytest.approx(0.0, abs=2e-6)


def test_trapezoidal_rule_breaks_down_in_large_rotation() -> None:
    with pytest.raises(SimulationError, match="breaks down"):
        spin_up(0.02, 15.0, elements=4, integrator="theta")
    assert spin_up(0.02, 15.0, elements=4)[-1, 0] == pytest.approx(15.0)  # the default goes through


# -- pendulum ----------------------------------------
def swing(scene: Scene, step: float, end: float, **keys: Any) -> tuple[Rod, Array]:
    """Rows (t, height of the tip's level r3, total energy) of a pendulum under gravity along e1."""
    rod, rows = Rod(scene), []
    _, weights, interpolate = gauss(rod)
    weight = scene.mass / rod.length * scene.gravity.magnitude

    def observe(t: float, u: Array) -> None:
        rod.set_state(u, 0 * u)
        fall = weights @ interpolate(take(rod, u, "r1"))
        rows.append((t, take(rod, u, "r3")[-1], sum(rod.energies()) - weight * fall, rod.energies()[0]))

    march(rod, initial_state(rod), end, time=stepped(scene, step, **keys), observe=observe)
    return rod, np.array(rows)


def test_stiff_pendulum_swings_like_a_compound_pendulum() -> None:
    scene = bar(
        1.0,
        axial=1e8,
        shear=1e8,
        bending=1e6,
        mass=2.0,
        inertia=0.01,
        ends={"top": "pinned", "bottom": "free"},
        gravity={"direction": [1, 0, 0]},
        mesh={"elements": 2},
        time=dynamic(1.0, 0.01),
    )
    moment = 2.0 / 3 + 0.01  # about the pin
    exact = 4 * ellipk(0.5) / math.sqrt(2.0 * 9.80665 * 0.5 / moment)  # released at 90 degrees: m = sin^2(45 deg)
    steps, periods = [0.02, 0.01, 0.005], []
    for h in steps:
        _, rows = swing(scene, h, 0.6)
        i = int(np.argmax(rows[:, 1] < 0))  # passes the bottom after a quarter
        near = rows[i - 3 : i + 3]
        periods.append(4 * np.interp(0, *_cubic(near[:, 1], near[:, 0])))
    error = abs(np.array(periods) - exact)
    assert order(steps, error) == pytest.approx(2.0, abs=0.1)
    assert (4 * periods[-1] - periods[-2]) / 3 == pytest.approx(exact, rel=5e-6)


def _cubic(x: Array, y: Array) -> tuple[Array, Array]:
    """Fine samples of the polynomial through the points, x ascending."""
    p = np.polyfit(x, y, len(x) - 1)
    fine = np.linspace(x.min(), x.max(), 20001)
    return fine, np.polyval(p, fine)


def test_flexible_pendulum_keeps_its_energy() -> None:
    scene = load_scene("pendulum", {"mesh.elements": 8})
    losses, steps = [], [4e-3, 2e-3, 1e-3]
    for h in steps:
        _, rows = swing(scene, h, 0.6)
        losses.append(abs(rows[:, 2] - rows[0, 2]).max() / rows[:, 3].max())
    assert losses[-1] < 2e-3
    assert order(steps, losses) > 1.5


# -- free flight ----------------------------------------
def free_rod(reading: str = "recommended", stiffness: float = 1e4) -> Rod:
    """A short rod that floats, turning about no principal axis."""
    w, half = np.array([2.0, 1.0, 6.0]), np.array([0, 0, 0.5])
    initial = {"state": "given", "angular_velocity": list(w), "velocity": list(-np.cross(w, half))}
    scene = bar(
        1.0,
        axial=stiffness,
        shear=stiffness,
        bending=stiffness / 10,
        torsion=stiffness / 10,
        inertia=0.05,
        ends={"top": "free", "bottom": "free"},
        initial=initial,
        model="spatial",
        reading=reading,
        mesh={"elements": 2},
        time=dynamic(1.0, 0.01),
    )
    return Rod(scene)


def angular_momentum(rod: Rod, u: Array) -> Array:
    """About the origin (3, N m s); also for a literal rod, whose w is spatial."""
    _, weights, interpolate = gauss(rod)
    r, v, w, q = (
        interpolate(take(rod, u, *names))
        for names in (("r1", "r2", "r3"), ("v1", "v2", "v3"), ("w1", "w2", "w3"), ("q_a", "q_b", "q_c", "q_d"))
    )
    turn = Rotation.from_quat(q[:, [1, 2, 3, 0]])
    w_m = turn.inv().apply(w) if rod.literal else w
    spin = turn.apply(w_m * [0.05, 0.05, 0.1])
    return weights @ (np.cross(r, v) + spin)


def fly(rod: Rod, step: float, end: float = 1.0) -> tuple[Array, Array, Array]:
    """Angular momentum, energy and the rotation of the middle, after every step."""
    rows, energy, turns = [], [], []

    def observe(t: float, u: Array) -> None:
        rows.append(angular_momentum(rod, u))
        rod.set_state(u, 0 * u)
        energy.append(sum(rod.energies()))
        turns.append(rod.shape()[1][len(rod.nodes) // 2])

    march(rod, initial_state(rod), end, time=stepped(rod.scene, step), observe=observe)
    return np.array(rows), np.array(energy), np.array(turns)


def test_free_rod_keeps_energy_and_angular_momentum_and_precesses() -> None:
    rod = free_rod()
    about_centre, along = 1 / 12 + 0.05, 0.1
    w = np.array([2.0, 1.0, 6.0])
    spin = w[2] * (1 - along / about_centre)
    precession = (w * [about_centre, about_centre, along]) / about_centre  # L/I_1: of the symmetric top
    exact = (Rotation.from_rotvec(precession) * Rotation.from_rotvec([0, 0, spin])).as_matrix()
    steps, lost, spent = [0.01, 0.005, 0.0025], [], []
    for h in steps:
        momentum, energy, turns = fly(rod, h)
        lost.append(np.linalg.norm(momentum - momentum[0], axis=1).max() / np.linalg.norm(momentum[0]))
        spent.append(abs(energy / energy[0] - 1).max())
    assert order(steps, lost) == pytest.approx(2.0, abs=0.2)
    assert order(steps, spent) > 1.8
    assert lost[-1] < 2e-5
    assert spent[-1] < 2e-5
    assert np.linalg.norm(turns[-1] - exact) < 1e-3  # stretched by its own inertia, it is not quite rigid
    # without w x Theta w the rod would turn steadily about w
    assert np.linalg.norm(Rotation.from_rotvec(w).as_matrix() - exact) > 0.5


@pytest.mark.slow
def test_literal_angular_velocity_feeds_energy_to_a_free_rod() -> None:
    momentum, energy, _ = fly(free_rod("literal"), 0.0025, 0.2)
    assert np.linalg.norm(momentum - momentum[0], axis=1).max() > np.linalg.norm(momentum[0])
    assert energy[-1] > 100 * energy[0]


# -- waves ----------------------------------------
def stepped_string(model: str = "axial-torsional", **mesh: Any) -> Scene:
    """Pipe and collars of the thesis, 1000 m each, floating without weight."""
    data = load_scene("vertical-c1-cd4").to_dict()
    keep = {k: data[k] for k in ("string", "material")}
    keep["material"]["retardation_time"] = 0.0
    keep["string"][1]["length"] = 1000.0
    tables = {
        "ends": {"top": "free", "bottom": "free"},
        "time": dynamic(0.3, 5e-4),
        "mesh": {"elements": 100} | mesh,
        "model": model,
    }
    return Scene.from_dict(bar().to_dict() | keep | tables)


def pulse(rod: Rod, centre: float = 600.0, width: float = 60.0) -> Array:
    """A torsional and an axial pulse that both run down."""
    material = rod.scene.material
    assert material is not None
    E, G, _ = material.moduli()
    shape = np.exp(-(((rod.arc_length - centre) / width) ** 2))
    area = np.array([math.sqrt(math.pi) / 2 * width * math.erf((s - centre) / width) for s in rod.arc_length])
    c_t, c_a = math.sqrt(G / material.density), math.sqrt(E / material.density)
    angle, shift = -area / c_t, -area / c_a
    if "phi" in rod.ansatz.x_names:
        turn = {"phi": angle}
    else:
        turn = {"q_a": np.cos(angle / 2), "q_d": np.sin(angle / 2)}
    axial = {"r3": rod.arc_length + shift, "v3": shape} if "v3" in rod.ansatz.v_names else {}
    return put(rod, w3=shape, **turn, **axial)


def test_waves_split_at_a_change_of_section_by_their_impedances() -> None:
    rod = Rod(stepped_string())
    pipe, collars = rod.scene.string
    u = march(rod, pulse(rod), 700 / 3141.94)
    s, weights, interpolate = gauss(rod)
    incident = math.sqrt(math.pi) * 60.0
    expected = {"w3": (-0.62033, 0.37967), "v3": (-0.63632, 0.36368)}
    for name, ratio in (("w3", collars.polar_moment / pipe.polar_moment), ("v3", collars.area / pipe.area)):
        reflected, transmitted = (1 - ratio) / (1 + ratio), 2 / (1 + ratio)
        assert (reflected, transmitted) == pytest.approx(expected[name], abs=1e-5)
        speed = interpolate(take(rod, u, name))
        above, below = (weights[part] @ speed[part] / incident for part in (s < 1000, s > 1000))
        assert above == pytest.approx(reflected, abs=1e-4)
        assert below == pytest.approx(transmitted, abs=1e-4)
    spin = take(rod, u, "w3")
    assert spin.min() == pytest.approx(-0.62033, abs=5e-3)
    assert spin.max() == pytest.approx(0.37967, abs=5e-3)


def test_kelvin_voigt_damps_a_mode_by_half_c_d_omega() -> None:
    c_d = 0.04
    rod = Rod(
        bar(1.0, torsion=1.0, axial=1.0, inertia=0.5, retardation=c_d, model="torsional", time=dynamic(99.0, 0.1))
    )
    mode = natural_frequencies(rod, 1)["torsional"]
    omega = 2 * math.pi * mode.frequency[0]
    ratio = c_d * omega / 2
    assert mode.damping[0] == pytest.approx(ratio, rel=1e-6)
    damped = omega * math.sqrt(1 - ratio**2)
    shape = mode.shape[0, :, 0]
    # start on the decaying mode exp(-zeta omega t) cos(damped t)
    u0 = put(rod, phi=shape, w3=-ratio * omega * shape)
    period = 2 * math.pi / damped
    u = march(rod, u0, 5 * period, time=stepped(rod.scene, period / 40, integrator="arkimex", order=4))
    np.testing.assert_allclose(
        take(rod, u, "phi") / shape[-1], math.exp(-ratio * omega * 5 * period) * shape / shape[-1], atol=1e-5
    )


# -- one rung against the next ----------------------------------------
def test_torsional_and_axial_torsional_march_alike() -> None:
    spins = []
    for model in ("torsional", "axial-torsional"):
        rod = Rod(stepped_string(model, elements=40))
        start = pulse(rod)
        if model != "torsional":
            start = put(rod, start, r3=rod.arc_length, v3=0.0)
        spins.append(take(rod, march(rod, start, 0.1), "w3"))
    np.testing.assert_allclose(*spins, atol=1e-9)


def test_axial_torsional_and_spatial_march_alike() -> None:
    found = []
    for model in ("axial-torsional", "spatial"):
        rod = Rod(stepped_string(model, elements=40))
        found.append(take(rod, march(rod, pulse(rod), 0.05), "w3", "v3", "r3"))
    np.testing.assert_allclose(*found, atol=1e-6)


def test_planar_and_spatial_swing_alike() -> None:
    tips = []
    for elements in (8, 16):
        ends = []
        for model in ("planar", "spatial"):
            scene = load_scene("pendulum", {"model": model, "mesh.elements": elements})
            rod = Rod(scene)
            u = march(rod, initial_state(rod), 0.35, time=stepped(scene, 5e-3))
            rod.set_state(u, 0 * u)
            ends.append(rod.shape()[0][-1])
        tips.append(abs(ends[1] - ends[0]).max())
    # an interpolated angle is not an interpolated quaternion; on either mesh that is less than what Newton leaves
    assert max(tips) < 1e-7
