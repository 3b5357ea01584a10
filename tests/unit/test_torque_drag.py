"""Torque and drag against closed forms, against a library of others, and its report."""

import csv
import json
import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from drillfem.boreholes import Borehole, arc, build, helix, read_survey, straight, survey
from drillfem.boreholes.table import Segment
from drillfem.cli import main
from drillfem.errors import SceneError
from drillfem.models.soft_string import Line, Pieces
from drillfem.scene import load_scene
from drillfem.scene.scene import _folder
from drillfem.torque_drag import (
    OPERATIONS,
    Operation,
    greatest_weight,
    hook_loads,
    johancsik,
    limits,
    lock_up_depth,
    operations_of,
    soft_string,
    stations,
)
from drillfem.torque_drag.command import study

W, R, EI, MU = 300.0, 0.08, 1.3e6, 0.3
DIAMETER = 0.2159


def line(hole: Borehole, length: float, weight: float = W, mu: float = MU) -> Line:
    one = np.ones(1)
    return Line(hole, Pieces(length * one, weight * one, R * one, EI * one), (1.2 * mu, mu))


def p11() -> Borehole:
    stations = read_survey(_folder().parent / "surveys" / "p11-a-02.csv")
    return survey(stations, diameter=DIAMETER)


# -- closed forms ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize("inclination", [0.0, 0.5, 1.2, math.pi / 2])
def test_straight_inclined_hole_is_exact(inclination):
    length = 1000.0
    on = line(straight(length, inclination, 0.7, diameter=DIAMETER), length)
    along, across = W * math.cos(inclination) * length, W * math.sin(inclination) * length
    expected = {"rotating": along, "tripping-out": along + MU * across, "tripping-in": along - MU * across}
    for name, load in expected.items():
        found = soft_string(on, OPERATIONS[name])
        assert found.hook_load == pytest.approx(load, rel=1e-12, abs=1e-6)
        assert found.side_force == pytest.approx(np.full_like(found.side_force, across / length), rel=1e-9, abs=1e-6)
        torque = MU * R * across if name == "rotating" else 0.0
        assert found.surface_torque == pytest.approx(torque, rel=1e-12, abs=1e-6)
    broken_loose = soft_string(on, OPERATIONS["rotating"], friction="static").surface_torque
    assert broken_loose == pytest.approx(1.2 * MU * R * across, abs=1e-6)


@pytest.mark.parametrize(
    ("hole", "turn"),
    [(arc(1200.0, 600.0, diameter=DIAMETER), 2.0), (helix(1200.0, 80.0, 500.0, diameter=DIAMETER), None)],
)
def test_capstan(hole, turn):
    """A string without weight: tension falls by exp(mu theta), whichever way the hole bends."""
    if turn is None:
        turn = hole.frame(np.zeros(1)).dogleg_severity[0] * 1200.0
    on, pull = line(hole, 1200.0, weight=0.0), 1e5
    up = soft_string(on, replace(OPERATIONS["tripping-out"], weight_on_bit=-pull))
    down = soft_string(on, replace(OPERATIONS["tripping-in"], weight_on_bit=-pull))
    assert up.hook_load / pull == pytest.approx(math.exp(MU * turn), rel=1e-8)
    assert down.hook_load / pull == pytest.approx(math.exp(-MU * turn), rel=1e-8)
    turning = soft_string(on, replace(OPERATIONS["rotating"], weight_on_bit=-pull))
    assert turning.surface_torque == pytest.approx(MU * R * pull * turn, rel=1e-8)
    # a tenth of a radian per station: Johancsik's sum, which lags by half a station
    coarse = stations(on, replace(OPERATIONS["tripping-out"], weight_on_bit=-pull), spacing=0.1 * 1200.0 / turn)
    assert coarse.hook_load / pull == pytest.approx(math.exp(MU * turn), rel=0.05)
    assert coarse.hook_load < up.hook_load


def test_rotation_frees_the_string_axially():
    """Friction points against the motion: what rotation takes is missing along the hole."""
    on = line(straight(1000.0, 1.0, diameter=DIAMETER), 1000.0)
    free = soft_string(on, OPERATIONS["rotating"]).hook_load
    drag = soft_string(on, OPERATIONS["tripping-out"]).hook_load - free
    torque = soft_string(on, OPERATIONS["rotating"]).surface_torque
    both = soft_string(on, Operation("reaming", "back-reaming", speed=-0.1, spin=10.0))
    share = 0.1 / math.hypot(0.1, 10.0 * R)
    assert both.hook_load - free == pytest.approx(share * drag, rel=1e-9)
    assert both.surface_torque == pytest.approx(math.sqrt(1 - share**2) * torque, rel=1e-9)
    with pytest.raises(ValueError, match="does not move"):
        soft_string(on, Operation("none", "standing"))


def test_hole_that_builds_lifts_a_pulled_string_off_its_low_side():
    """N = |w sin(i) - F i'| in a plane; by both signs of the bend, and in azimuth the sum of squares."""
    hole = build(1500.0, 300.0, 500.0, math.radians(60), diameter=DIAMETER)
    on = line(hole, 1500.0)
    found = soft_string(on, OPERATIONS["rotating"])
    frame = hole.frame(found.measured_depth)
    in_arc = (found.measured_depth > 320) & (found.measured_depth < 800)
    expected = np.abs(W * np.sin(frame.inclination) - found.tension / 500.0)
    assert found.side_force[in_arc] == pytest.approx(expected[in_arc], rel=1e-5, abs=1e-3)
    on = line(p11(), 2691.0)
    found = soft_string(on, OPERATIONS["rotating"], spacing=1.0)
    s, frame = found.measured_depth, on.hole.frame(found.measured_depth)
    inside = (s > 400) & (s < 600)
    h = 1e-3
    before, after = on.hole.frame(s - h), on.hole.frame(s + h)
    builds, turns = ((getattr(after, x) - getattr(before, x)) / (2 * h) for x in ("inclination", "azimuth"))
    up = found.tension * builds - W * np.sin(frame.inclination)
    out = found.tension * turns * np.sin(frame.inclination)
    assert found.side_force[inside] == pytest.approx(np.hypot(up, out)[inside], rel=1e-3)


def test_drilling_puts_its_weight_and_torque_on_the_bit():
    on = line(p11(), 2691.0)
    rotating = soft_string(on, OPERATIONS["rotating"])
    drilling = soft_string(on, replace(OPERATIONS["drilling"], weight_on_bit=5e4, torque_on_bit=4e3))
    assert drilling.hook_load == pytest.approx(rotating.hook_load - 5e4, rel=1e-12)
    assert drilling.tension[-1] == -5e4
    assert drilling.torque[-1] == 4e3
    # the depth between, times the weight: no error of integration in the load of a string that turns
    frame = on.hole.frame(np.array([0.0, 2691.0]))
    assert rotating.hook_load == pytest.approx(W * float(np.diff(frame.position[:, 2])[0]), rel=1e-8)
    assert rotating.tension == pytest.approx(on.hanging(rotating.measured_depth), rel=1e-7, abs=0.5)


# -- orders ---------------------------------------------------------------------------------------------------
def test_orders_of_convergence():
    """Fourth order where nothing jumps; Johancsik's sum is of first order."""

    def bend(p):
        t = np.stack([np.sin(p / 400), 0 * p, np.cos(p / 400)], axis=1)
        return t, np.stack([np.cos(p / 400), 0 * p, -np.sin(p / 400)], axis=1) / 400

    # friction out of this world: otherwise steps of 2 m have no error to measure
    rough = line(Borehole.of("arc", [Segment(2.0 * k, bend) for k in range(1, 21)], DIAMETER), 40.0, 0.0, mu=200.0)
    pull = replace(OPERATIONS["tripping-out"], weight_on_bit=-1.0)
    wide = [abs(soft_string(rough, pull, spacing=h).hook_load / math.exp(20.0) - 1) for h in (0.5, 0.25, 0.125)]
    assert np.log2(wide[:-1] / np.array(wide[1:])) == pytest.approx([4.0, 4.0], abs=0.3)
    on = line(Borehole.of("winding", [Segment(900.0, winding)], DIAMETER), 900.0)
    pull = replace(pull, weight_on_bit=-2e5)  # the string never changes sides
    exact = soft_string(on, pull, spacing=0.5).hook_load
    assert soft_string(on, pull).hook_load == pytest.approx(exact, rel=1e-9)
    summed = [abs(stations(on, pull, spacing=x).hook_load - exact) for x in (30.0, 15.0, 7.5)]
    assert math.log2(summed[0] / summed[2]) / 2 == pytest.approx(1.0, abs=0.1)


def winding(p):
    """A hole whose inclination and azimuth swing: unit tangent and curvature vector."""
    a, b = 0.8 + 0.3 * np.sin(p / 150), 0.5 * np.sin(p / 200)
    da, db = 0.3 / 150 * np.cos(p / 150), 0.5 / 200 * np.cos(p / 200)
    t = np.stack([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)], axis=1)
    by_a = np.stack([np.cos(a) * np.cos(b), np.cos(a) * np.sin(b), -np.sin(a)], axis=1)
    by_b = np.stack([-np.sin(a) * np.sin(b), np.sin(a) * np.cos(b), 0 * a], axis=1)
    return t, da[:, None] * by_a + db[:, None] * by_b


# -- a library of others --------------------------------------------------------------------------------------
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_welleng_on_a_real_survey():
    """welleng's numbers come out of `johancsik` to round-off if the build changes its sign.

    It counts the build down the hole and the tension upwards, so that a hole that builds presses a pulled string down
    where it lifts it: its loads of this well are off by what this test prints.
    """
    welleng = pytest.importorskip("welleng")
    from welleng import architecture, torque_drag

    hole = p11()
    md, inclination, azimuth = hole.stations.T
    header = welleng.survey.SurveyHeader(deg=False)
    path = welleng.survey.Survey(md, inclination, azimuth, header=header, deg=False)
    wall = architecture.WellBore("wall", 0.0, md[-1], method="top_down")
    wall.add_section(bottom=md[-1], id=DIAMETER, coeff_friction_sliding=MU)
    pipe = architecture.BHA("pipe", 0.0, md[-1], method="top_down")
    pipe.add_section(bottom=md[-1], od=2 * R, unit_weight=W / (1 - 1.2 / 7.85), density=7.85)
    theirs = torque_drag.TorqueDrag(path, wall, pipe, fluid_density=1.2, wob=5e4, tob=4e3)

    mean, builds = (inclination[1:] + inclination[:-1]) / 2, np.diff(inclination)
    turns = (np.diff(azimuth) + np.pi) % (2 * np.pi) - np.pi
    one = np.ones(len(mean))
    names = {"rotating": "rotating", "slackoff": "tripping-in", "pickup": "tripping-out", "drilling": "drilling"}
    for key, name in names.items():
        operation = OPERATIONS[name]
        lowest = (-5e4, 4e3) if name == "drilling" else (0.0, 0.0)
        along, about = np.sign(operation.speed) * MU * one, np.sign(operation.spin) * MU * one
        numbers = (W * one, (along, about), R * one, lowest)
        tension, torque, _ = johancsik(np.diff(md), mean, -builds, turns, *numbers)
        assert np.asarray(theirs.tension[key])[: len(mean)] == pytest.approx(tension[:-1], rel=1e-9)
        if operation.spin:
            assert np.asarray(theirs.torque[key])[: len(mean)] == pytest.approx(torque[:-1], rel=1e-9)
        # with the right sign, the same sum is near the differential equation
        ours = johancsik(np.diff(md), mean, builds, turns, *numbers)
        on = replace(operation, weight_on_bit=-lowest[0], torque_on_bit=lowest[1])
        exact = soft_string(line(hole, md[-1]), on, buckled=False)
        assert ours[0][0] == pytest.approx(exact.hook_load, rel=0.01)
        print(name, tension[0] / exact.hook_load - 1, torque[0] / max(exact.surface_torque, 1.0) - 1)


def test_stations_are_near_the_differential_equation():
    on = line(p11(), 2691.0)
    for name, operation in OPERATIONS.items():
        exact, summed = soft_string(on, operation, buckled=False), stations(on, operation)
        assert summed.hook_load == pytest.approx(exact.hook_load, rel=0.01), name
        assert summed.surface_torque == pytest.approx(exact.surface_torque, rel=0.02), name


# -- pushing --------------------------------------------------------------------------------------------------
def test_buckling_limits():
    """The thesis' pipe in a horizontal hole (field.md 3.3), a vertical one, and what a bend does."""
    ei, w = 1.2792e6, 268.3
    for clearance, load in ((0.010, 370.5e3), (0.0445, 175.7e3)):
        hole = straight(100.0, math.pi / 2, diameter=2 * (R + clearance))
        one = np.ones(1)
        lying = Line(hole, Pieces(100 * one, w * one, R * one, ei * one))
        found = limits(lying, np.array([50.0]))
        assert found.sinusoidal[0] == pytest.approx(load, rel=1e-3)
        assert found.helical[0] / found.sinusoidal[0] == pytest.approx(2.83 / 2)
        assert found.wound_up[0] / found.sinusoidal[0] == pytest.approx(3.66 / 2)
    upright = limits(line(straight(100.0, diameter=DIAMETER), 100.0), np.array([50.0]))
    assert upright.sinusoidal[0] == pytest.approx(1.94 * (EI * W**2) ** (1 / 3))
    assert upright.helical[0] == pytest.approx(5.55 * (EI * W**2) ** (1 / 3))
    bent = limits(line(build(700.0, 100.0, 400.0, 1.2, diameter=DIAMETER), 700.0), np.array([400.0]))
    push, angle = bent.sinusoidal[0], 300.0 / 400.0
    assert push == pytest.approx(
        2 * math.sqrt(EI * (W * math.sin(angle) + push / 400.0) / (DIAMETER / 2 - R)), rel=1e-6
    )


def test_helix_presses_harder():
    """A horizontal string wound up all along: dF/ds = -mu (w + r F^2/(4 EI)) upwards, a tangent."""
    hole = straight(400.0, math.pi / 2, diameter=DIAMETER)
    on, push = line(hole, 400.0), 6e5
    found = soft_string(on, replace(OPERATIONS["sliding"], weight_on_bit=push))
    a = math.sqrt((DIAMETER / 2 - R) / (4 * EI * W))
    expected = math.tan(math.atan(a * push) + MU * W * a * 400.0) / a
    assert -found.hook_load == pytest.approx(expected, rel=1e-6)
    straight_on = soft_string(on, replace(OPERATIONS["sliding"], weight_on_bit=push), buckled=False)
    assert -straight_on.hook_load == pytest.approx(push + MU * W * 400.0, rel=1e-12)


def test_lock_up():
    # the vertical part pushes the horizontal one as far as mu lets it; the arc costs a little
    hole = build(4000.0, 500.0, 50.0, math.pi / 2, diameter=DIAMETER)
    on = line(hole, 4000.0)
    depth = lock_up_depth(on, OPERATIONS["tripping-in"], buckled=False)
    assert depth is not None
    end = on.to_depth(depth)
    assert soft_string(end, OPERATIONS["tripping-in"], buckled=False).hook_load == pytest.approx(0.0, abs=20.0)
    assert depth < 500.0 + 550.0 / MU + 100.0
    assert lock_up_depth(line(straight(500.0, diameter=DIAMETER), 500.0), OPERATIONS["tripping-in"]) is None
    steep = line(straight(500.0, 1.4, diameter=DIAMETER), 500.0)  # tan(1.4) > 1/mu: it does not slide by itself
    assert lock_up_depth(steep, OPERATIONS["tripping-in"]) == pytest.approx(20.0, abs=21.0)
    assert greatest_weight(steep, OPERATIONS["sliding"]) == 0.0
    assert greatest_weight(on.to_depth(500.0), OPERATIONS["sliding"], buckled=False) == pytest.approx(
        500.0 * W, rel=1e-5
    )


def test_string_at_another_depth_loses_its_top():
    hole = p11()
    pieces = Pieces(np.array([2000.0, 600.0]), np.array([W, 2 * W]), np.array([R, R]), np.array([EI, EI]))
    on = Line(hole, pieces, (MU, MU))
    assert on.to_depth(2600.0).pieces.length == pytest.approx([2000.0, 600.0])
    assert on.to_depth(2650.0).pieces.length == pytest.approx([2050.0, 600.0])
    assert on.to_depth(900.0).pieces.length == pytest.approx([300.0, 600.0])
    assert on.to_depth(600.0).pieces.length == pytest.approx([600.0])
    assert on.to_depth(100.0).pieces.weight == pytest.approx([2 * W])
    loads = hook_loads(on, OPERATIONS["rotating"], np.array([600.0, 2600.0]))
    assert loads[1] == pytest.approx(soft_string(on, OPERATIONS["rotating"]).hook_load)


def test_friction_of_the_hole_goes_before_that_of_the_string():
    hole = straight(1000.0, 1.0, diameter=DIAMETER).with_friction(0.4, 0.2, [(400.0, 0.1, 0.1)])
    found = soft_string(line(hole, 1000.0), OPERATIONS["rotating"])
    force = W * math.sin(1.0) * R
    assert found.surface_torque == pytest.approx(force * (400 * 0.1 + 600 * 0.2), rel=1e-5)
    loose = soft_string(line(hole, 1000.0), OPERATIONS["rotating"], friction="static")
    assert loose.surface_torque == pytest.approx(force * (400 * 0.1 + 600 * 0.4), rel=1e-5)


# -- scenes and the command -----------------------------------------------------------------------------------
def test_operations_of_scenes():
    off = load_scene("off-bottom-soft-string")
    assert [o.name for o in operations_of(off)] == ["rotating", "tripping-out", "tripping-in"]
    assert [o.name for o in operations_of(off, ["sliding"], weight_on_bit=1e4)] == ["sliding"]
    with pytest.raises(SceneError, match="--weight-on-bit"):
        operations_of(off, ["sliding"])
    with pytest.raises(SceneError, match="must be one of rotating"):
        operations_of(off, ["flying"])
    curved = load_scene("curved-c2")
    drilling = next(o for o in operations_of(curved) if o.name == "drilling")
    steady = curved.nominal()
    assert drilling.weight_on_bit == pytest.approx(steady.weight_on_bit)
    assert drilling.torque_on_bit == pytest.approx(steady.torque_on_bit)


def test_mud_takes_its_share_of_the_weight():
    dry = study(load_scene("off-bottom-soft-string"), ["rotating"]).first[0]
    wet = study(load_scene("off-bottom-soft-string", {"mud.density": 1200.0}), ["rotating"]).first[0]
    assert wet.hook_load / dry.hook_load == pytest.approx(1 - 1200 / 7850)
    assert wet.surface_torque / dry.surface_torque == pytest.approx(1 - 1200 / 7850, rel=1e-6)


def test_command(tmp_path, capsys):
    out = tmp_path / "found"
    arguments = ["torque-drag", "off-bottom-soft-string", "--out", str(out), "--weight-on-bit", "50 kN"]
    assert main([*arguments, "--method", "soft", "--method", "stations"]) == 0
    said = capsys.readouterr().out
    assert "rotating off bottom" in said
    assert "sliding: the string's own weight can put at most" in said
    data = xr.load_dataset(out / "torque-drag.nc")
    assert data["tension"].dims == ("model", "operation", "measured_depth")
    assert data["tension"].attrs["units"] == "N"
    found = study(load_scene("off-bottom-soft-string"), weight_on_bit=5e4).first
    tripping = next(p for p in found if p.operation.name == "tripping-out")
    top = float(data["tension"].sel(model="soft", operation="tripping-out")[0])
    assert top == pytest.approx(tripping.hook_load)
    with open(out / "torque-drag.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {r["operation"] for r in rows} == set(OPERATIONS)
    assert (out / "torque-drag.png").stat().st_size > 50_000
    numbers = json.loads((out / "torque-drag.json").read_text())
    assert {o["method"] for o in numbers["operations"]} == {"soft", "stations"}
    assert main([*arguments[:4], "--operation", "rotating"]) == 2  # the folder is taken
    assert "not empty" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--method", "guess"], "must be one of soft, stations"),
        (["--operation", "flying"], "must be one of rotating"),
        (["--weight-on-bit", "5 m"], "--weight-on-bit '5 m'"),
        (["--weight-on-bit", "-5"], "must be >= 0 N"),
        (["--friction", "none"], "must be one of dynamic, static"),
    ],
)
def test_command_refuses(tmp_path, capsys, arguments, words):
    out = tmp_path / "found"
    assert main(["torque-drag", "off-bottom-soft-string", "--out", str(out), *arguments]) == 2
    assert words in capsys.readouterr().err
    assert not out.exists()


def test_command_needs_a_hole(tmp_path, capsys):
    assert main(["torque-drag", "spin-up", "--out", str(tmp_path / "x")]) == 2
    assert "must be a hole" in capsys.readouterr().err
