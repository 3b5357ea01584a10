"""Multilevel Monte Carlo: slopes of a problem that is known, allocation, telescoping, verdicts."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ndtri

from drillfem.ensemble import drawing
from drillfem.ensemble.multilevel import Multilevel, allocation, level_scenes, multilevel
from drillfem.errors import SceneError
from drillfem.scene import load_scene

STEPS = 64


def euler(level: int, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """dS = S/20 dt + S/2 dW up to 1 by Euler in 2^(level + 1) steps, cost 1 per step; alpha = beta = gamma = 1."""
    steps = 2 ** (level + 1)
    noise = ndtri(u).reshape(len(u), steps, -1).sum(axis=2) / np.sqrt(STEPS)
    value = np.ones(len(u))
    for i in range(steps):
        value *= 1 + 0.05 / steps + 0.5 * noise[:, i]
    return value, np.full(len(u), float(steps))


def smooth(level: int, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Error 4^-level of a smooth answer: alpha = 2, beta = 4, gamma = 1."""
    return 1 + u[:, 0] + (1 + u[:, 1]) * 4.0**-level, np.full(len(u), 2.0**level)


def chaotic(level: int, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Levels that know nothing of each other."""
    return 2 + np.sin(1e3 * (1 + level) * u.sum(axis=1)), np.full(len(u), 2.0**level)


def test_slopes_of_a_problem_that_is_known() -> None:
    found = multilevel(euler, STEPS, 6, pilot=400)
    assert abs(found.beta.value - 1) < 3 * found.beta.error + 0.15
    assert found.gamma.value == pytest.approx(1, abs=1e-9)
    assert found.consistent and (found.correlations > 0.8).all()
    assert found.mean.low < np.exp(0.05) < found.mean.high
    exact = multilevel(smooth, 2, 5, pilot=50)
    assert exact.alpha.value == pytest.approx(2, abs=0.1) and exact.beta.value == pytest.approx(4, abs=0.5)
    # 1.5 x 4^-4 is what finer levels would take away
    assert exact.bias == pytest.approx(1.5 * 4.0**-4, rel=0.15)


def test_allocation_is_the_cheapest_for_its_error() -> None:
    v, c = np.array([1.0, 0.1, 0.01]), np.array([1.0, 2.0, 4.0])
    best = allocation(v, c, 0.01)
    assert (v / best).sum() <= 0.01**2
    for other in ([1.2, 1, 1], [1, 1.2, 0.9], [0.9, 1.5, 1.5]):
        n = best * np.array(other)
        n *= (v / n).sum() / 0.01**2  # to the same error
        assert (n * c).sum() >= (best * c).sum() * 0.999


def test_tolerance_is_met_where_it_is_cheapest() -> None:
    found = multilevel(smooth, 2, 5, pilot=20, tolerance=0.005)
    assert found.mean.relative <= 0.005
    assert (np.diff(found.counts) <= 0).all() and found.counts[0] > 1e4 and found.counts[-1] < 100
    # E = 1.5 + 1.5 x 4^-4 on the finest level
    assert found.mean.low - 2 * found.mean.error < 1.5 + 1.5 * 4.0**-4 < found.mean.high + 2 * found.mean.error


def test_gain_is_the_ratio_of_costs() -> None:
    found = multilevel(euler, STEPS, 6, pilot=200)
    n = found.allocation(0.001)
    multilevel_cost = float((n * found.costs).sum())
    plain = found.level_variances[-1] / 0.001**2 * found.pairs[-1].alone.mean()
    assert found.gain.value == pytest.approx(plain / multilevel_cost, rel=0.01)
    assert found.gain.low > 1 and "MLMC gains" in found.verdict(1e-4) and "nothing" not in found.verdict(1e-4)


def test_where_it_gains_nothing_the_verdict_says_so_and_why() -> None:
    lost = multilevel(chaotic, 2, 4, pilot=60)
    assert lost.gain.high < 1
    assert "gains nothing" in lost.verdict(0.01) and "do not go together" in lost.verdict(0.01)
    # the levels are so near each other that the coarsest is as good as all
    near = multilevel(lambda level, u: (1 + u[:, 0] + 1e-6 * 4.0**-level * u[:, 1], np.ones(len(u))), 2, 4)
    assert near.enough(0.01) == 0
    assert "nothing over plain Monte Carlo on level 0" in near.verdict(0.01)


def test_levels_that_do_not_telescope_are_found() -> None:
    last: list[np.ndarray] = []

    def wrong(level: int, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        value, cost = smooth(level, u)
        # the coarser run of a pair, with the points of the finer one, has a fault that others on its level have not
        again = bool(last) and np.array_equal(last[-1], u)
        last.append(u)
        return (value + 0.5 if again else value), cost

    found = multilevel(wrong, 2, 4, pilot=40)
    assert not found.consistent and "do not telescope" in found.verdict(0.01)
    assert multilevel(smooth, 2, 4, pilot=40).consistent


def test_a_machine_that_slows_down_does_not_bend_the_slope_of_the_cost() -> None:
    clock = [1.0]

    def slower(level: int, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        clock[0] *= 1 + 0.5 / 280 * len(u)  # 280 runs in all
        return smooth(level, u)[0], np.full(len(u), clock[0] * 2.0**level)

    assert multilevel(slower, 2, 4, pilot=40).gamma.value == pytest.approx(1.0, abs=0.08)  # one after the other: 1.20


def test_pairs_of_which_one_fails_are_left_out_and_counted() -> None:
    def failing(level: int, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        value, cost = smooth(level, u)
        return np.where((u[:, 0] < 0.2) & (level == 1), np.nan, value), cost

    found = multilevel(failing, 2, 4, pilot=50)
    assert [p.failed > 0 for p in found.pairs] == [False, True, True, False]
    assert all(len(p.fine) + p.failed == 50 for p in found.pairs)
    with pytest.raises(SceneError, match="level 0"):
        multilevel(lambda level, u: (np.full(len(u), np.nan), np.ones(len(u))), 2, 3)
    with pytest.raises(SceneError, match="levels = 2"):
        multilevel(smooth, 2, 2)


def test_pairs_do_not_depend_on_how_many_there_are() -> None:
    few, many = (multilevel(smooth, 2, 3, seed=5, pilot=n) for n in (10, 20))
    for a, b in zip(few.pairs, many.pairs, strict=True):
        assert (a.fine == b.fine[:10]).all() and (a.coarse == b.coarse[:10]).all()


def test_level_scenes_end_in_the_scene() -> None:
    scene = load_scene("vertical-c1-cd4", {"mesh.elements": 16, "output.interval": "1 ms"})
    scenes = level_scenes(scene, 3)
    assert [s.mesh.elements for s in scenes] == [4, 8, 16]
    assert [s.time.step for s in scenes] == pytest.approx([4e-3, 2e-3, 1e-3])
    assert {s.output.interval for s in scenes} == {4e-3}
    with pytest.raises(SceneError, match="multiple of 32"):
        level_scenes(scene, 6)
    with pytest.raises(SceneError, match=r"bit\.kind"):
        level_scenes(scene, 3, ["bit.kind"])


def test_picture_and_numbers(tmp_path: Path) -> None:
    found: Multilevel = multilevel(smooth, 2, 4, pilot=20)
    path = drawing.levels(tmp_path / "levels.png", found, "power ratio", found.verdict(0.01))
    assert path.stat().st_size > 10_000
    assert len(json.loads(json.dumps(found.to_dict(), allow_nan=False))["levels"]) == 4
