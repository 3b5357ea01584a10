"""A string pushed in its hole: onset, snaking, winding, found from the rod and held against theory."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from drillfem.buckling import (
    Column,
    equal_energy,
    find_onset,
    follow,
    helix,
    onset,
    pinned_onset,
    pipe_of,
    pipe_scene,
    record,
    snake,
    wound,
)
from drillfem.cli import main
from drillfem.models.rod import Rod
from drillfem.models.soft_string import line_of
from drillfem.scene import load_scene
from drillfem.torque_drag.command import coarse

LEVEL = math.pi / 2


def pinned(
    waves: float, clearance: float = 0.01, spacing: float = 4.0, degree: int = 3, stiffness: float = 1e8
) -> Column:
    """A level pipe, so many waves long."""
    wave = pipe_of(pipe_scene(1.0, LEVEL, clearance)).wave
    return Column(Rod(pipe_scene(waves * wave, LEVEL, clearance, spacing, degree, stiffness)), pinned=True)


# -- theories ---------------------------------------------------------------------------------------------------------
def test_theories_agree_with_each_other() -> None:
    pipe = pipe_of(pipe_scene(1.0, LEVEL, 0.01))
    rigid = pipe._replace(shear=math.inf, axial=math.inf)
    length = 6 * pipe.wave
    load, halves = pinned_onset(rigid, length)
    assert halves == 12 and load == pytest.approx(pipe.snaking, rel=1e-9)
    assert onset(rigid, length) == pytest.approx(load, rel=1e-9)
    softer, _ = pinned_onset(pipe, length)
    assert -5e-4 < softer / load - 1 < -1e-4  # shear and stretch
    # between two lengths that waves fit in, the string needs more
    assert pinned_onset(rigid, 1.2 * pipe.wave)[0] > 1.01 * pipe.snaking
    # Lubinski (1950): 1.94 at a length of 8
    vertical = pipe_of(pipe_scene(1.0, 0.0, 0.01))
    unit = vertical.along * vertical.scale
    assert onset(vertical, 8 * vertical.scale) / unit == pytest.approx(1.937, abs=5e-4)


def test_shapes_on_the_wall() -> None:
    snakes, coils = snake(np.array([1.001, 1.01, 1.3])), helix(np.array([4.0, 3.0]))
    # just beyond the onset, theta = A sin(s): e = -(beta - 1) A^2/2 + 11 A^4/64
    for wave in snakes[:2]:
        assert wave.amplitude**2 == pytest.approx(16 / 11 * (wave.beta - 1), rel=0.02)
        assert wave.energy == pytest.approx(-4 / 11 * (wave.beta - 1) ** 2, rel=0.03)
    assert snake(np.array([1.3]), 1.0)[0].amplitude < 0.98 * snakes[2].amplitude
    assert snake(np.array([1.3]), 1.0)[0].energy > snakes[2].energy
    # an even helix: e = 1 - beta^2/2, q^2 = beta
    for wave in coils:
        assert wave.energy == pytest.approx(1 - wave.beta**2 / 2, abs=0.01)
        assert wave.wave_number**2 == pytest.approx(wave.beta, rel=2e-3)
    assert 2 * equal_energy() == pytest.approx(2.901, abs=2e-3)


# -- onset ------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("clearance", "load", "wave"), [(0.0100, 370.5e3, 16.5), (0.0445, 175.7e3, 24.0)])
def test_level_string_snakes_where_theory_says(clearance: float, load: float, wave: float) -> None:
    column = pinned(6, clearance, spacing=3.0)
    pipe = pipe_of(column.rod.scene)
    exact, halves = pinned_onset(pipe, column.rod.length)
    found = find_onset(column, column.lying(), 0.9 * exact, 2 * exact)
    assert found is not None
    assert found.load == pytest.approx(exact, rel=2e-4)
    assert found.load == pytest.approx(load, rel=1e-3)
    # the motion: sideways, in half waves of the predicted length
    way = found.motion[column.rod.nodes]
    assert np.abs(way[:, 0]).max() < 1e-3 * np.abs(way[:, 1]).max()
    s = column.rod.arc_length
    turns = s[1:-1][np.diff(np.sign(np.diff(way[:, 1]))) != 0]
    assert len(turns) == halves == 12
    assert 2 * np.mean(np.diff(turns)) == pytest.approx(wave, rel=0.01)
    # below, the string comes back; above, it does not
    straight = column.equilibrium(found.x, 0.99 * found.load)
    assert column.softest(straight)[0] > 0
    assert column.softest(column.equilibrium(straight, 1.01 * found.load))[0] < 0


@pytest.mark.parametrize("degrees", [0.0, 3.0, 45.0])
def test_weight_along_the_hole_counts(degrees: float) -> None:
    angle = math.radians(degrees)
    pipe = pipe_of(pipe_scene(1.0, angle, 0.0445))
    length = 5 * pipe.wave if degrees else 8 * pipe.scale
    column = Column(Rod(pipe_scene(length, angle, 0.0445, length / 40)), pinned=True)
    theory = onset(pipe_of(column.rod.scene), length)
    found = find_onset(column, column.lying(), 0.95 * theory, 2 * theory)
    assert found is not None
    assert found.load == pytest.approx(theory, rel=3e-4)  # shear and stretch
    plain = pipe.snaking if degrees else 1.94 * pipe.along * pipe.scale
    assert found.load / plain == pytest.approx({0.0: 0.9985, 3.0: 1.180, 45.0: 1.039}[degrees], rel=5e-3)
    assert find_onset(column, column.lying(), 0.5 * theory, 0.6 * theory) is None


def test_stiffness_is_the_slope_of_the_force_and_force_that_of_the_energy() -> None:
    column = pinned(2, spacing=3.0, stiffness=1e6)
    pipe = pipe_of(column.rod.scene)
    x = column.settle(column.lying(), 1.3 * pipe.snaking)
    column.push(1.5 * pipe.snaking)  # no longer an equilibrium
    _, motion = column.softest(x)
    n, free = column.fields, column._free

    def moved(step: float) -> np.ndarray:
        """The state shifted and turned along the motion."""
        y = x.reshape(-1, n).copy()
        y[:, :3] += step * motion[:, :3]
        a, b, c, d = y[:, 3:].T / 2
        u, v, w = step * motion[:, 3:].T
        y[:, 3:] += np.stack(
            [-b * u - c * v - d * w, a * u - d * v + c * w, d * u + a * v - b * w, -c * u + b * v + a * w], axis=1
        )
        y[:, 3:] /= np.linalg.norm(y[:, 3:], axis=1)[:, None]
        return y.reshape(-1)

    def force(y: np.ndarray) -> np.ndarray:
        """Residual of the free displacements and rotations."""
        out = np.zeros(len(y))
        column._set(y)
        column.residual(out)
        return np.delete(out.reshape(-1, n), 3, axis=1).reshape(-1)[free]

    flat, step = motion.reshape(-1)[free], 1e-6 / np.abs(motion).max()
    slope = (force(moved(step)) - force(moved(-step))) / (2 * step)
    stiffness = column.tangent(x) @ flat
    np.testing.assert_allclose(slope, stiffness, atol=5e-3 * np.abs(stiffness).max())
    step *= 10
    work = (column.energy(moved(step)) - column.energy(moved(-step))) / (2 * step)
    assert work == pytest.approx(force(x) @ flat, rel=1e-3)
    assert abs(work) > 1e-2


# -- beyond -----------------------------------------------------------------------------------------------------------
def test_snake_swings_as_the_least_energy_says() -> None:
    column = pinned(4, spacing=2.5, stiffness=1e9)
    pipe = pipe_of(column.rod.scene)
    steps = list(follow(column, column.lying(), np.array([0.97, 1.05, 1.2]) * pipe.snaking))
    assert steps[0].turns < 1e-9 and steps[0].softest > 0
    for step in steps[1:]:
        # as many waves as it is long: its ends let it have no other number
        (theory,) = snake(np.array([step.load / pipe.snaking]), 1.0)
        assert step.swing(1.2 * pipe.wave) == pytest.approx(theory.amplitude, rel=5e-3)
        assert step.turns < 0.5 and step.softest > 0
        assert step.side[:, 1].max() > 1.2 * pipe.across
    # and back: no memory
    back = record(column, column.settle(steps[-1].x, 0.97 * pipe.snaking))
    assert back.turns < 1e-3


def test_helix_holds_on_below_the_load_that_winds_it_and_lets_go_at_last() -> None:
    column = pinned(4, spacing=2.5)
    pipe = pipe_of(column.rod.scene)
    column.push(2.0 * pipe.snaking)
    x = wound(column, round(4 * math.sqrt(2.0)), 2.0 * pipe.snaking, pipe.wave / 3)
    steps = list(follow(column, x, np.array([2.0, 1.5, 1.1]) * pipe.snaking))
    assert steps[0].turns > 4 and steps[1].turns > 3
    assert steps[2].turns < 0.5
    # a helix presses with r F^2/(4 EI) on average
    s, force = steps[0].side.T
    inside = (s > pipe.wave) & (s < s[-1] - pipe.wave)
    expected = pipe.clearance * steps[0].load ** 2 / (4 * pipe.bending)
    assert force[inside].mean() == pytest.approx(expected, rel=0.08)


def test_command_pushes_a_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = tmp_path / "inclined.toml"
    scene.write_text(
        """
        [[string]]
        name = "pipe"
        length = 60
        outer_diameter = 0.127
        inner_diameter = 0.108
        [material]
        youngs_modulus = 210e9
        shear_modulus = 77e9
        density = 7800
        [hole]
        kind = "straight"
        inclination = "85 deg"
        diameter = 0.147
        [contact]
        stiffness = 1e7
        friction_static = 0.3
        friction_dynamic = 0.3
        [ends]
        top = "hung"
        bottom = "free"
        [initial]
        state = "laid"
        [mesh]
        elements = 20
        [time]
        end = 1
        step = 0.01
        """
    )
    out = tmp_path / "pushed"
    assert main(["buckling", str(scene), "--out", str(out), "--weight-on-bit", "450 kN", "--steps", "2"]) == 0
    rows = json.loads((out / "buckling.json").read_text())["steps"]
    assert [row["weight_on_bit"] for row in rows] == [225e3, 450e3]
    assert rows[0]["compression_over_limit"] < 1 < rows[1]["compression_over_limit"]
    assert rows[0]["turns"] < 0.02 < rows[1]["turns"]
    assert (out / "buckling.png").stat().st_size > 20_000
    printed = capsys.readouterr().out
    assert "winds by" in printed
    assert main(["buckling", str(scene), "--out", str(tmp_path / "x"), "--weight-on-bit", "0"]) == 2
    assert main(["buckling", str(scene), "--out", str(tmp_path / "x"), "--weight-on-bit", "9 kN", "--steps", "0"]) == 2
    assert not (tmp_path / "x").exists()
    loaded = load_scene(scene, {"mesh.elements": 4})
    assert coarse(load_scene(scene), line_of(loaded), 450e3) == []
    (text,) = coarse(loaded, line_of(loaded), 450e3)
    assert "cannot see the string buckle" in text


# -- long -------------------------------------------------------------------------------------------------------------
@pytest.mark.verify
@pytest.mark.parametrize(("degree", "spacings"), [(1, (2.0, 1.0)), (2, (4.0, 2.0)), (3, (4.0, 2.5))])
def test_onset_converges_with_twice_the_degree(degree: int, spacings: tuple[float, float]) -> None:
    errors, lengths = [], []
    for spacing in spacings:
        column = pinned(10, spacing=spacing, degree=degree)
        exact, _ = pinned_onset(pipe_of(column.rod.scene), column.rod.length)
        found = find_onset(column, column.lying(), 0.9 * exact, 2 * exact)
        assert found is not None
        errors.append(found.load / exact - 1)
        lengths.append(column.rod.length / column.rod.scene.mesh.elements)
    order = math.log(errors[0] / errors[1]) / math.log(lengths[0] / lengths[1])
    assert order == pytest.approx(2 * degree, abs=0.3)


@pytest.mark.verify
def test_linear_elements_of_twelve_metres_do_not_see_it() -> None:
    column = pinned(10, spacing=12.5, degree=1)
    pipe = pipe_of(column.rod.scene)
    x = column.equilibrium(column.lying(), 1.5 * pipe.snaking)
    assert column.softest(x)[0] > 0  # a string that should long have wound up
    fine = pinned(10, spacing=2.0, degree=1)
    assert fine.softest(fine.equilibrium(fine.lying(), 1.1 * pipe.snaking))[0] < 0


@pytest.mark.verify
def test_unloading_and_loading_do_not_meet() -> None:
    """Pushed, the string winds later than the helix lets go."""
    column = pinned(10, spacing=2.0)
    pipe = pipe_of(column.rod.scene)
    pushed = list(follow(column, column.lying(), np.arange(1.1, 2.01, 0.1) * pipe.snaking))
    first = next(s.load for s in pushed if s.turns >= 1) / pipe.snaking
    assert 2.7 < 2 * first < 3.3
    column = pinned(10, spacing=2.0)
    column.push(2.0 * pipe.snaking)
    x = wound(column, 14, 2.0 * pipe.snaking, pipe.wave / 3)
    let_go = list(follow(column, x, np.arange(2.0, 1.09, -0.1) * pipe.snaking))
    last = min(s.load for s in let_go if s.turns >= 1) / pipe.snaking
    assert 2.3 < 2 * last < 2.9
    assert last < first


@pytest.mark.verify
def test_vertical_string_winds() -> None:
    scale = pipe_of(pipe_scene(1.0, 0.0, 0.0445)).scale
    column = Column(Rod(pipe_scene(16 * scale, 0.0, 0.0445, 4.0, 3, 1e7)), pinned=True)
    pipe = pipe_of(column.rod.scene)
    unit = pipe.along * pipe.scale
    loads = np.array([1.5, 3.0, 4.5, 5.5, 9.0])
    steps = dict(zip(loads.tolist(), follow(column, column.hanging(), loads * unit), strict=True))
    assert steps[1.5].radius.max() < 1e-9
    assert steps[3.0].radius.max() == pytest.approx(pipe.clearance, rel=0.01) and steps[3.0].turns < 0.02  # in a plane
    assert 0.2 < steps[4.5].turns < 0.7 < steps[5.5].turns < 1.0 < 1.5 < steps[9.0].turns
