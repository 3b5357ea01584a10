"""Statistics of ensembles: intervals keep what they promise, failed members count, ways of sampling differ by slope."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from drillfem.ensemble import drawing
from drillfem.ensemble import statistics as ensemble
from drillfem.ensemble.analysis import share, table
from drillfem.errors import SceneError

LOGNORMAL = stats.lognorm(s=0.5)


def coverage(interval: Any, truth: float, n: int, repeats: int = 400) -> float:
    """Share of samples of a skewed distribution whose interval holds the truth."""
    chance = np.random.default_rng(1)
    found = [interval(LOGNORMAL.rvs(n, random_state=chance)) for _ in range(repeats)]
    return float(np.mean([x.low <= truth <= x.high for x in found]))


@pytest.mark.parametrize(
    "interval, truth",
    [
        (ensemble.mean, LOGNORMAL.mean()),
        (ensemble.standard_deviation, LOGNORMAL.std()),
        (lambda x: ensemble.quantile(x, 0.9), LOGNORMAL.ppf(0.9)),
        (lambda x: ensemble.probability(x > 2.0), LOGNORMAL.sf(2.0)),
    ],
    ids=["mean", "standard deviation", "quantile", "probability"],
)
def test_intervals_hold_the_truth_as_often_as_they_say(interval: Any, truth: float) -> None:
    # of 400 samples 95 % are 380 ± 4.4; skewness costs the mean and the deviation a little at n = 200
    assert 0.915 <= coverage(interval, truth, 200) <= 0.99


def test_interval_of_the_mean_is_student_s() -> None:
    x = [1.0, 2.0, 4.0, 7.0]
    found = ensemble.mean(x)
    low, high = stats.t.interval(0.95, 3, loc=3.5, scale=stats.sem(x))
    assert (found.value, found.low, found.high) == pytest.approx((3.5, low, high))
    assert ensemble.mean([2.0]).high == np.inf


def test_quantile_interval_has_the_ranks_of_the_binomial_distribution() -> None:
    x = np.arange(1.0, 101.0)
    found = ensemble.quantile(x, 0.5)
    # ranks 40 and 61: the textbook interval of a median of 100
    assert (found.low, found.high) == (40, 61)
    assert ensemble.quantile(x[:10], 0.99).high == np.inf
    assert ensemble.quantile(x[:10], 0.01).low == -np.inf


def test_failed_members_widen_quantiles_and_probabilities() -> None:
    x = np.arange(1.0, 101.0)
    whole, less = ensemble.quantile(x, 0.5), ensemble.quantile(x, 0.5, failed=10)
    assert less.low < whole.low and less.high > whole.high
    # with 95 % of the members gone nothing is known
    assert ensemble.quantile(x[:5], 0.5, failed=95).high == np.inf
    p, q = ensemble.probability(x > 90), ensemble.probability(x > 90, failed=20)
    assert p.value == q.value == 0.1
    assert q.low < p.low and q.high > 0.25  # all that failed might have been above
    assert ensemble.probability(x > 1000).low == 0.0


def test_failed_members_keep_the_promise_whatever_they_would_have_been() -> None:
    # those with the largest values fail, which is the worst case
    chance, held = np.random.default_rng(3), []
    for _ in range(300):
        x = np.sort(chance.normal(size=100))[:90]
        found = ensemble.quantile(x, 0.5, failed=10)
        held.append(found.low <= 0 <= found.high)
    assert np.mean(held) > 0.94


def test_density_integrates_to_one_and_sees_two_peaks() -> None:
    chance = np.random.default_rng(0)
    x = np.concatenate([chance.normal(0.3, 0.01, 400), chance.normal(0.6, 0.01, 400)])
    found = ensemble.density(x)
    assert np.trapezoid(found.values, found.points) == pytest.approx(1, abs=1e-3)
    # the rule of thumb takes the spread of both peaks for that of one: 0.9 x 0.15 x 800^-0.2 = 0.035
    assert found.bandwidth == pytest.approx(1.06 * 0.01 * 400**-0.2, rel=0.35)
    at = np.searchsorted(found.points, [0.3, 0.45, 0.6])
    assert found.values[at[1]] < 0.01 * found.values[at[[0, 2]]].min()
    assert (found.low <= found.values).all() and (found.values <= found.high).all()


def test_density_stays_within_its_support() -> None:
    found = ensemble.density(np.random.default_rng(0).uniform(size=3000), support=(0, 1))
    assert found.points[0] == 0 and found.points[-1] == 1
    assert np.trapezoid(found.values, found.points) == pytest.approx(1, abs=1e-6)
    # without reflection it would fall to one half at the ends
    assert found.values[0] == pytest.approx(1, abs=0.25)
    with pytest.raises(ValueError, match="equal"):
        ensemble.density([1.0, 1.0, 1.0])


def test_running_mean_ends_in_the_mean_and_the_wider_band_is_wider() -> None:
    x = 1e6 + np.random.default_rng(0).normal(size=500)
    band, whole = ensemble.running(x), ensemble.mean(x)
    assert (band.mean[-1], band.low[-1], band.high[-1]) == pytest.approx(
        (whole.value, whole.low, whole.high), rel=1e-12
    )
    assert (
        band.always_high[0] == np.inf and (band.always_low <= band.low).all() and (band.high <= band.always_high).all()
    )
    assert band.mean[99] == pytest.approx(x[:100].mean(), rel=1e-13)
    assert band.high[0] == np.inf


def test_wider_band_holds_at_all_numbers_at_once() -> None:
    chance, each, always = np.random.default_rng(0), [], []
    for _ in range(300):
        band = ensemble.running(chance.normal(size=1000))
        shown = slice(29, None)
        each.append((band.low[shown] <= 0).all() and (band.high[shown] >= 0).all())
        always.append((band.always_low[shown] <= 0).all() and (band.always_high[shown] >= 0).all())
    assert np.mean(always) > 0.93
    assert np.mean(each) < 0.85  # which is why there are two


def test_converged_says_when() -> None:
    x = np.random.default_rng(0).normal(10.0, 1.0, 4000)
    assert not ensemble.converged(x[:29], 0.5)
    assert not ensemble.converged(x[:100], 0.01)
    assert ensemble.converged(x[:600], 0.01)
    assert not ensemble.converged(x[:600], 0.01, always=True)
    assert ensemble.converged(x, 0.01, always=True)
    assert ensemble.needed(x, 0.01) == pytest.approx((1.96 * 0.1 / 0.01) ** 2, rel=0.05)
    assert not ensemble.converged(x - x.mean(), 0.01)


def test_what_is_no_sample_is_refused() -> None:
    for bad in ([], [1.0, np.nan], [[1.0]]):
        with pytest.raises(ValueError, match="member"):
            ensemble.mean(bad)


def test_sobol_beats_chance_and_the_slopes_say_so() -> None:
    def smooth(u: np.ndarray) -> np.ndarray:
        return np.asarray(np.prod(1 + (u - 0.5) / 2, axis=1))

    found = ensemble.compare(smooth, 3, (16, 32, 64, 128), replicas=40)
    assert found.slopes["monte-carlo"].value == pytest.approx(-0.5, abs=0.25)
    assert found.slopes["sobol"].high < -0.9
    # a sum is all that a Latin hypercube needs, and this is nearly one
    assert found.gain("latin-hypercube") > 5 and found.gain("sobol") > found.gain("latin-hypercube")


# -- a store ----------------------------------------------------------------------------------------------------------
def store(values: Any, status: Any = None, members: Any = None, **attributes: Any) -> xr.Dataset:
    n = len(values)
    status = ["done"] * n if status is None else status
    data = {
        "power_ratio": ("member", np.asarray(values, dtype=float), {"units": "1"}),
        "drilled_depth": ("member", np.full(n, 2.0), {"units": "m"}),
        "input_rock": ("member", np.arange(n, dtype=float)),
        "seconds": ("member", np.ones(n)),
        "rank": ("member", np.zeros(n, dtype=int)),
        "status": ("member", np.array(status, dtype=object)),
        "reason": ("member", np.array(["too stiff" if s == "failed" else "" for s in status], dtype=object)),
    }
    facts = {"method": "monte-carlo", "scene": "", "seed": 0} | attributes
    return xr.Dataset(data, {"member": np.arange(n) if members is None else members}, facts)


def test_statistics_of_a_store_name_those_that_failed() -> None:
    x = np.random.default_rng(0).normal(0.5, 0.1, 60)
    status = ["failed" if i in (3, 17) else "done" for i in range(60)]
    values = np.where(np.array(status) == "failed", np.nan, x)
    values[40] = np.nan  # done, but without the number
    found = ensemble.of(store(values, status), "power_ratio")
    assert found.failed == {3: "too stiff", 17: "too stiff", 40: "has no power_ratio"}
    assert len(found.values) == 57 and found.failed_share == pytest.approx(0.05)
    assert found.mean.value == pytest.approx(np.nanmean(values))
    assert found.quantiles[0.5].low < ensemble.quantile(found.values, 0.5).low
    text = "\n".join(" ".join(row) for row in table(found))
    assert "member 17 too stiff" in text and "5 % of all" in text
    assert json.dumps(found.to_dict(), allow_nan=False)
    assert found.probability(0.5).high > ensemble.probability(found.values > 0.5).high


def test_a_heavy_tail_is_named() -> None:
    chance = np.random.default_rng(0)
    tails = {
        heavy: ensemble.of(store(x), "power_ratio")
        for heavy, x in ((False, chance.normal(0.5, 0.1, 200)), (True, chance.lognormal(0, 1, 200)))
    }
    for heavy, found in tails.items():
        assert found.heavy_tailed is heavy
        assert ("heavy tail" in dict(table(found))) is heavy


def test_members_that_have_overtaken_others_do_not_count() -> None:
    members = [0, 1, 2, 3, 5, 6]
    found = ensemble.of(store([1.0, 2.0, 3.0, 4.0, 50.0, 60.0], members=members), "power_ratio")
    assert found.members.tolist() == [0, 1, 2, 3] and found.awaited == 2
    assert found.mean.value == 2.5


def test_quantities_are_what_members_have() -> None:
    data = store([1.0, 2.0])
    assert ensemble.quantities(data) == ["power_ratio", "drilled_depth"]
    with pytest.raises(SceneError, match=r"'seconds'.*power_ratio, drilled_depth"):
        ensemble.of(data, "seconds")
    with pytest.raises(SceneError, match="none of 2 members has it"):
        ensemble.of(store([np.nan, np.nan], ["failed", "failed"]), "power_ratio")


def test_pictures_of_a_store(tmp_path: Path) -> None:
    found = ensemble.of(store(np.random.default_rng(0).normal(0.5, 0.1, 50)), "power_ratio")
    time = np.linspace(0, 1, 20)
    made = [
        drawing.convergence(tmp_path / "a.png", found),
        drawing.pdf(tmp_path / "b.png", found),
        drawing.realisations(tmp_path / "c.png", time, np.outer(found.values, time), "bit_angle", "rad"),
    ]
    assert all(path.stat().st_size > 10_000 for path in made)


def test_command_writes_tables_and_pictures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from drillfem.cli import main
    from drillfem.ensemble import store as stored

    chance = np.random.default_rng(0)
    sets = {f"seed-{k}": store(chance.normal(0.5, 0.1, 40), seed=k, method="sobol") for k in range(3)}
    monkeypatch.setattr(stored, "read", lambda folder: sets[Path(folder).name])
    folders = [str(tmp_path / name) for name in sets]
    (tmp_path / "seed-0").mkdir()
    assert main(["statistics", *folders]) == 0
    said = capsys.readouterr().out
    assert "mean of 3 randomisations" in said and "power_ratio-density.png" in said
    told = json.loads((tmp_path / "seed-0" / "statistics.json").read_text())["power_ratio"]
    assert told["randomisations"]["value"] == pytest.approx(np.mean([s["power_ratio"].mean() for s in sets.values()]))
    sets["seed-1"].attrs["seed"] = 0
    assert main(["statistics", *folders]) == 2


@pytest.mark.parametrize("text, value", [("0.05", 0.05), ("5%", 0.05), (None, None)])
def test_share(text: str | None, value: float | None) -> None:
    assert share(text) == value


@pytest.mark.parametrize("text", ["0", "2", "no", "nan", "-5%"])
def test_share_that_is_none(text: str) -> None:
    with pytest.raises(SceneError, match="--tolerance"):
        share(text)
