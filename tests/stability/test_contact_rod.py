"""Where contact methods fail on a rod, measured beside theory; and the guards that say so before."""

from __future__ import annotations

import math

import numpy as np
import pytest
from contactfailures import (
    bounced,
    buckling_growth,
    dropped,
    fastest_growth,
    fed_by_torque,
    kink,
    laid_in_arc,
    lying,
    peak,
    rolling,
    sliding_down,
    spatial_spin,
    stretch,
    thrown,
    torque_wave,
    turning,
    twist,
)
from holelab import EI, GJ, HORIZONTAL, MASS, RADIUS, SECOND, WEIGHT, in_hole, period, stepping
from rodlab import Array, order

from drillfem.scene import Scene, load_scene
from drillfem.solve.guards import warnings
from drillfem.solve.integrators import Method
from drillfem.solve.wall_guards import CHATTER, NARROW, boundary_layer, creep, fed_turns, worst_bounce

SPEED = 100 * math.pi / 30


def said(scene: Scene, about: str) -> bool:
    """Whether a warning of a scene has these words."""
    return any(about in text for text in warnings(scene))


# -- too soft ----------------------------------------
def test_soft_penalty_sinks_deeper_than_the_clearance() -> None:
    s, sunk, scene = lying(1e4)
    middle = sunk[np.abs(s - 0.6 * s[-1]) < 6].mean()
    assert middle == pytest.approx(WEIGHT / 1e4, rel=0.03) and middle > 2 * 0.01
    assert said(scene, "26.8 mm into the wall behind a clearance of 10 mm")
    s, sunk, scene = lying(1e6)
    assert sunk[np.abs(s - 0.6 * s[-1]) < 6].mean() == pytest.approx(WEIGHT / 1e6, rel=0.03)
    assert not said(scene, "soft")


# -- too stiff ----------------------------------------
@pytest.mark.parametrize("integrator, rho", [("theta", 0.5), ("generalized-alpha", 0.9), ("generalized-alpha", 0.0)])
def test_bounces_of_the_guard_are_those_of_petsc(integrator: str, rho: float) -> None:
    method = Method(integrator, rho_infinity=rho)
    for turn in (0.8, 3.0):
        gains = method.bounce(turn)
        for k in (9, 41):
            phase = (k + 0.5) / len(gains)
            assert bounced(turn, phase, integrator, rho) == pytest.approx(float(gains[k]), rel=1e-4)


@pytest.mark.parametrize("integrator, rho", [("theta", 0.9), ("generalized-alpha", 0.9), ("generalized-alpha", 0.5)])
def test_stiff_penalty_feeds_a_pipe_that_bounces(integrator: str, rho: float) -> None:
    # a pipe that falls through its clearance of 10 mm keeps its energy where the steps resolve the bounce
    assert dropped(8, integrator, rho)[1].max() < 1.3
    assert dropped(2, integrator, rho, 0.5)[1].max() > 5


def test_what_does_not_feed_a_pipe_that_bounces() -> None:
    assert dropped(2, "generalized-alpha", 0.0, 0.5)[1].max() < 1 + 1e-6
    for integrator in ("theta", "generalized-alpha"):
        assert dropped(2, integrator, end=0.5, method="augmented")[1].max() < 1 + 1e-6


def test_guard_against_chatter_knows_the_steps() -> None:
    for steps, speaks in ((2, True), (8, False)):
        time = stepping(1.0, period(1e6) / steps, "theta")
        scene = in_hole(HORIZONTAL, 2.0, 1, time=time, ends={"top": "free"})
        assert said(scene, "chatters") == speaks
        turn = 2 * math.pi / steps
        assert (worst_bounce(Method("theta"), turn) > CHATTER) == speaks


def short(stiffness: float, integrator: str, rho: float = 0.9, method: str = "penalty") -> tuple[Array, bool]:
    """Rows of 20 m of pipe driven round in a bend with steps of 10 ms; whether the guards speak of chatter."""
    bend = {"kind": "arc", "radius": 50.0}
    rows, _, scene = turning(
        stiffness, 1e-2, integrator, rho, 0.8, length=20.0, elements=2, hole=bend, contact={"method": method}
    )
    return rows, said(scene, "chatters")


def test_trapezoidal_rule_blows_up_on_a_stiff_wall() -> None:
    turning_alone = 7800 * SECOND * SPEED**2 * 20.0  # rho I_p Omega^2 L/2
    rows, speaks = short(1e7, "theta")
    assert rows[:, 1].max() > 20 * turning_alone and speaks
    for keys in (
        {"stiffness": 1e7, "integrator": "generalized-alpha", "rho": 0.0},
        {"stiffness": 1e7, "integrator": "theta", "method": "augmented"},
    ):
        rows, speaks = short(**keys)
        assert rows[:, 1].max() < 1.5 * turning_alone and rows[-1, 4] < 0.01 and not speaks


# -- too coarse ----------------------------------------
def test_mesh_coarser_than_the_boundary_layer_misses_the_peak_at_a_kink() -> None:
    layer = float(boundary_layer(EI, 1e6))
    found = {n: kink(n) for n in (10, 20, 40, 160)}
    peaks = {n: peak(s, force) for n, (s, force, _, _) in found.items()}
    error = {n: abs(peaks[n] / peaks[160] - 1) for n in (10, 20, 40)}
    assert error[10] > 0.1 > 0.07 > error[20] > error[40] and error[40] < 0.015
    assert order([80 / n for n in error], list(error.values())) == pytest.approx(1.9, abs=0.4)
    for n, (_, _, total, scene) in found.items():
        assert said(scene, "kink") == (80 / n > NARROW * layer)
        assert total == pytest.approx(found[160][2], rel=0.03)  # what the wall carries in sum is right on any mesh


def test_straight_elements_do_not_follow_a_bend() -> None:
    (coarse, speaks), (fine, _), (cubic, _) = (laid_in_arc(*mesh) for mesh in ((8, 1), (64, 1), (8, 3)))
    assert coarse > 3 * fine and fine == pytest.approx(cubic, rel=0.01)
    assert said(speaks, "cannot follow the hole") and not said(laid_in_arc(8, 3)[1], "follow")


@pytest.mark.parametrize("per_wave, degree, error", [(8, 3, 1e-3), (10 / 3, 3, 2e-3), (10, 1, 0.03)])
def test_buckling_waves_grow_as_they_should_where_the_guard_is_silent(
    per_wave: float, degree: int, error: float
) -> None:
    found, exact, scene = buckling_growth(per_wave, degree)
    assert found == pytest.approx(exact, rel=error)
    assert not said(scene, "buckle")


@pytest.mark.parametrize("per_wave, degree", [(1, 3), (4, 1), (3, 1)])
def test_coarse_meshes_do_not_see_buckling(per_wave: float, degree: int) -> None:
    found, exact, scene = buckling_growth(per_wave, degree)
    assert found < 0.6 * exact
    assert said(scene, "cannot see the string buckle")


@pytest.mark.parametrize("elements, degree", [(15, 3), (30, 3), (30, 2), (30, 1)])
def test_torque_feeds_sections_that_reduced_integration_lets_turn(elements: int, degree: int) -> None:
    found, frequency, scene = fed_by_torque(elements, "reduced", degree=degree)
    rate, omega = fed_turns(scene.string[0], 750 / elements, degree, 3000.0)
    assert 0.5 < found / rate < 2.1 and 0.5 < frequency / (omega / (2 * math.pi)) < 5
    if elements == 15:  # half of the torque, half of the growth
        assert fed_by_torque(elements, "reduced", 1500.0, degree)[0] == pytest.approx(found / 2, rel=0.1)
    if degree > 1:
        assert fed_by_torque(elements, "full", degree=degree)[0] < 0.05 * found


def test_fed_sections_break_a_run_and_the_guard_says_so() -> None:
    sizes = {}
    for quadrature in ("reduced", "full"):
        rows, _ = torque_wave(quadrature)
        early, late = (rows[abs(rows[:, 0] - t) < 0.05, 1].max() for t in (0.1, 0.45))
        sizes[quadrature] = late / early
    assert sizes["reduced"] > 100 and sizes["full"] < 3
    # well A on half of its elements
    for keys, speaks in (
        ({}, False),
        ({"mesh.elements": 100}, True),
        ({"mesh.elements": 100, "mesh.quadrature": "full"}, False),
    ):
        assert (
            said(load_scene("off-bottom", keys | {"time.step": 1.25e-3, "output.interval": 5e-3}), "by themselves")
            == speaks
        )


# -- friction ----------------------------------------
@pytest.mark.parametrize("scale, speaks", [(5, True), (100, False)])
def test_rounded_friction_never_sticks(scale: float, speaks: bool) -> None:
    """On a slope of 0.2, friction of 0.3 holds a pipe: the law lets it creep, at the speed that the guard computes."""
    found, scene = sliding_down(scale)
    assert found == pytest.approx(creep(scene, 2 / 3), rel=0.01)
    assert found == pytest.approx(0.1002 * 5 / scale, rel=0.01)
    drive = {"ends": {"top": "driven", "bottom": "free"}, "top_drive": {"kind": "imposed-speed", "speed": SPEED}}
    turned = Scene.from_dict(scene.to_dict() | drive)
    assert said(turned, "never sticks") == speaks


def test_unprojected_friction_is_weakened_by_bouncing() -> None:
    def lost(projected: bool, lift: float) -> tuple[float, float]:
        """What friction took of the speed over what Coulomb's takes, and the height of the second bounce."""
        rows, _ = thrown(projected, lift)
        t, along, down, height = rows.T
        # the wall pushes with the weight and stops the fall: mu times the sum of that
        return (3.0 - along[-1]) / (0.2 * (9.80665 * t[-1] - down[-1])), height[t > 0.4].max()

    for projected in (True, False):
        assert lost(projected, 0.0)[0] == pytest.approx(1.0, abs=5e-3)  # a pipe that slides without bouncing
    share, height = lost(True, 0.2)
    assert share == pytest.approx(1.0, abs=5e-3) and height == pytest.approx(0.2, rel=0.01)
    share, height = lost(False, 0.2)
    assert share < 0.95 and height < 0.9 * 0.2
    assert said(thrown(False, 0.0)[1], "bounces") is False  # nothing turns, nothing is driven: no speed to compare with


def test_steps_too_long_for_a_string_that_rolls() -> None:
    """Backward whirl: the pipe rolls along the wall, -Omega r/R, as the guard computes."""
    circle = 0.005 + math.sqrt(0.005**2 + MASS * (SPEED * RADIUS) ** 2 / 1e6)

    def late(step: float, integrator: str) -> tuple[float, float, float, bool]:
        rows, scene = rolling(step, integrator)
        _, rate, radius = rows[rows[:, 0] > 0.6].T
        return rate.mean(), rate.std(), radius.mean(), said(scene, "rolls")

    rate, shake, radius, speaks = late(2e-3, "generalized-alpha")
    assert rate == pytest.approx(-SPEED * RADIUS / circle, rel=0.02) and shake < 1 and not speaks
    # 0.9 rad per step: generalised-alpha meets the wall on the chord, and runs on a wider circle
    _, shake, wide, speaks = late(1.5e-2, "generalized-alpha")
    assert wide / radius - 1 == pytest.approx((rate * 1.5e-2) ** 2 / 8, rel=0.15) and shake < 1 and speaks
    # 0.3 rad per step: the speed of the trapezoidal rule rings
    _, shake, _, speaks = late(5e-3, "theta")
    assert shake > 20 and speaks


# -- the thesis as printed ----------------------------------------
def test_unrotated_stiffness_in_a_hole_that_leans() -> None:
    """Errata 14: EA and GA, EI and GJ change places as the hole leans."""
    lean = math.pi / 3
    assert stretch("literal", lean) / stretch("recommended", lean) == pytest.approx(0.25 + 0.75 * 210 / 77, rel=1e-3)
    assert twist("literal", lean) / twist("recommended", lean) == pytest.approx(0.25 + 0.75 * GJ / EI, rel=1e-3)
    assert twist("recommended", lean) == pytest.approx(10 / GJ, rel=1e-3)
    assert stretch("literal", 1e-6) == pytest.approx(stretch("recommended", 1e-6), rel=1e-6)  # nothing leans


def test_spatial_spin_in_a_bend_makes_vibrations_grow() -> None:
    """Errata 2: the printed angular velocity moves the string by one rule and carries its momentum by another."""
    assert fastest_growth() < 1e-3
    with spatial_spin():
        assert fastest_growth() > 100


def test_spatial_spin_in_a_bend_turns_wrongly() -> None:
    bend = {"kind": "build", "kick_off": 5.0, "radius": 60.0, "final_inclination": math.radians(60)}

    def rows() -> Array:
        contact = {"friction_velocity_scale": 5}
        return turning(1e5, 1e-2, "generalized-alpha", end=1.0, length=40.0, elements=4, hole=bend, contact=contact)[0]

    right = rows()
    with spatial_spin():
        wrong = rows()
    assert right[-1, 4] < 2e-3 and wrong[-1, 4] > 0.02  # the energy that goes in does not come out
    assert wrong[:, 1].max() < 0.95 * right[:, 1].max()  # and it carries the wrong energy
