"""Multilevel Monte Carlo: many members on a coarse level, few on a fine one, and whether that gains anything.

The mean on the finest level L is E[P_L] = E[P_0] + sum over l of E[P_l - P_(l-1)]. Each term has members of its own;
both runs of a pair have the same rock, so that their difference varies little, if the levels are near each other. From
level to level |E[P_l - P_(l-1)]| ~ 2^(-alpha l), V[P_l - P_(l-1)] ~ 2^(-beta l), cost ~ 2^(gamma l).
M. B. Giles, Multilevel Monte Carlo methods, Acta Numerica 24 (2015).
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from drillfem.ensemble.sampling import Sampler
from drillfem.ensemble.statistics import CONFIDENCE, Estimate
from drillfem.errors import SceneError
from drillfem.results.atomic import plain
from drillfem.scene import Scene

F8 = npt.NDArray[np.float64]

#: Of a level and points (n, dimension): values (n,), nan of what failed, and the seconds (n,) that each took.
Run = Callable[[int, F8], tuple[F8, F8]]
#: What a level is finer in than the next coarser one.
REFINED = ("mesh.elements", "time.step")
_RESAMPLED = 400
#: The levels take turns, in so many rounds: a machine that slows down meanwhile would else bend the slope of the cost.
_ROUNDS = 4

log = logging.getLogger("drillfem.ensemble")


@dataclass(frozen=True)
class Pairs:
    """Members of one level: values (n,) on it and on the next coarser one (zeros on level 0).

    seconds: (n,) of both runs. alone: seconds (n,) of the finer run.
    failed: how many pairs have no difference, for one of its runs failed.
    """

    fine: F8
    coarse: F8
    seconds: F8
    alone: F8
    failed: int = 0

    @property
    def difference(self) -> F8:
        """P_l - P_(l-1), (n,)."""
        return self.fine - self.coarse

    def joined(self, other: Pairs) -> Pairs:
        """These and others of the same level."""
        names = ("fine", "coarse", "seconds", "alone")
        both = {name: np.concatenate([getattr(self, name), getattr(other, name)]) for name in names}
        return Pairs(**both, failed=self.failed + other.failed)

    def resampled(self, chance: np.random.Generator) -> Pairs:
        """As many, drawn from these with replacement."""
        i = chance.integers(len(self.fine), size=len(self.fine))
        return Pairs(self.fine[i], self.coarse[i], self.seconds[i], self.alone[i])


@dataclass(frozen=True)
class Multilevel:
    """What was run, from the coarsest level to the finest, and what follows from it."""

    pairs: tuple[Pairs, ...]

    # -- the answer ---------------------------------------------------------------------------------------------------
    @property
    def mean(self) -> Estimate:
        """Mean on the finest level: sum of the means of the differences; Student's interval (Satterthwaite)."""
        from scipy.stats import t

        shares = self.variances / self.counts
        error = math.sqrt(float(shares.sum()))
        freedom = error**4 / float((shares**2 / (self.counts - 1)).sum()) if error else 1.0
        half = float(t.ppf((1 + CONFIDENCE) / 2, freedom)) * error
        value = float(self.means.sum())
        return Estimate(value, value - half, value + half, error)

    @property
    def bias(self) -> float:
        """What levels finer than the finest would add, extrapolated; infinite where the differences do not fall."""
        alpha = self.alpha.value
        return abs(float(self.means[-1])) / (2**alpha - 1) if alpha > 0 else math.inf

    # -- per level ----------------------------------------------------------------------------------------------------
    @property
    def counts(self) -> F8:
        """Pairs per level, (levels,)."""
        return np.array([len(p.fine) for p in self.pairs], dtype=np.float64)

    @property
    def means(self) -> F8:
        """Mean of P_l - P_(l-1), (levels,)."""
        return np.array([p.difference.mean() for p in self.pairs])

    @property
    def variances(self) -> F8:
        """Variance of P_l - P_(l-1), (levels,)."""
        return np.array([p.difference.var(ddof=1) for p in self.pairs])

    @property
    def level_variances(self) -> F8:
        """Variance of P_l, (levels,); where pairs are alike, from that of the level below by the ratio within pairs.

        Both runs of a pair have the same rock, so that chance hardly changes this ratio, as it would that between
        levels with members of their own.
        """
        found = [float(self.variances[0])]
        for p, correlation in zip(self.pairs[1:], self.correlations, strict=True):
            found.append(found[-1] * p.fine.var() / p.coarse.var() if correlation > 0.8 else p.fine.var(ddof=1))
        return np.array(found)

    @property
    def costs(self) -> F8:
        """Seconds of a pair, (levels,)."""
        return np.array([p.seconds.mean() for p in self.pairs])

    @property
    def kurtosis(self) -> F8:
        """Kurtosis of P_l - P_(l-1), (levels,): of a large one the variance is not known well from few members."""
        from scipy.stats import kurtosis

        return np.array([kurtosis(p.difference, fisher=False) if np.ptp(p.difference) else np.nan for p in self.pairs])

    @property
    def correlations(self) -> F8:
        """Correlation of both runs of a pair, (levels - 1,)."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.array([np.corrcoef(p.fine, p.coarse)[0, 1] for p in self.pairs[1:]])

    @property
    def departures(self) -> F8:
        """Telescoping, (levels - 1,): mean of P_(l-1) from its own members less that from the pairs.

        In standard errors of the difference. More than three or four means that a level is not the same when it is
        the finer and when it is the coarser run.
        """
        found = []
        for below, p in zip(self.pairs, self.pairs[1:], strict=False):
            error = math.sqrt(below.fine.var(ddof=1) / len(below.fine) + p.coarse.var(ddof=1) / len(p.coarse))
            off = float(below.fine.mean() - p.coarse.mean())
            found.append(off / error if error else math.copysign(math.inf, off) if off else 0.0)
        return np.array(found)

    @property
    def consistent(self) -> bool:
        """Whether all telescoping departures are such as chance brings about in 99.7 % of all cases (Bonferroni)."""
        from scipy.stats import norm

        limit = norm.isf(0.0027 / 2 / max(1, len(self.pairs) - 1))
        return bool((np.abs(self.departures) < limit).all())

    # -- slopes -------------------------------------------------------------------------------------------------------
    @cached_property
    def alpha(self) -> Estimate:
        """Weak slope: the mean of the differences falls as 2^(-alpha l)."""
        return self._resampled(lambda m: -_slope(np.abs(m.means[1:])))

    @cached_property
    def beta(self) -> Estimate:
        """Variance slope: the variance of the differences falls as 2^(-beta l)."""
        return self._resampled(lambda m: -_slope(m.variances[1:]))

    @cached_property
    def gamma(self) -> Estimate:
        """Cost slope: the cost of a pair grows as 2^(gamma l)."""
        return self._resampled(lambda m: _slope(m.costs[1:]))

    @cached_property
    def gain(self) -> Estimate:
        """Cost of plain Monte Carlo on the finest level over that of multilevel, for the same error."""
        return self._resampled(lambda m: m._gain())

    def allocation(self, error: float) -> npt.NDArray[np.int64]:
        """Pairs per level (levels,) that reach a standard error at the least cost."""
        return allocation(self.variances, self.costs, error)

    def _gain(self) -> float:
        return self._plain(len(self.pairs) - 1)

    def _plain(self, level: int) -> float:
        """Cost of plain Monte Carlo on a level over that of multilevel, for the same error."""
        plain = float(self.level_variances[level] * self.pairs[level].alone.mean())
        return plain / float(np.sqrt(self.variances * self.costs).sum()) ** 2 if plain else 1.0

    def _resampled(self, of: Callable[[Multilevel], float]) -> Estimate:
        chance = np.random.default_rng(0)
        value = of(self)
        drawn = [of(Multilevel(tuple(p.resampled(chance) for p in self.pairs))) for _ in range(_RESAMPLED)]
        finite = np.array([x for x in drawn if math.isfinite(x)])
        if not len(finite):
            return Estimate(value, -math.inf, math.inf, math.inf)
        low, high = np.quantile(finite, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
        return Estimate(value, min(float(low), value), max(float(high), value), float(finite.std()))

    # -- the verdict --------------------------------------------------------------------------------------------------
    def enough(self, tolerance: float) -> int:
        """Coarsest level whose bias, at 95 % confidence, is below ``tolerance`` times the mean; else the finest."""
        last = len(self.pairs) - 1
        for level in range(last):
            above = self.pairs[level + 1 :]
            off = abs(sum(float(p.difference.mean()) for p in above))
            error = math.sqrt(sum(float(p.difference.var(ddof=1)) / len(p.fine) for p in above))
            if off + 1.96 * error <= tolerance * abs(self.mean.value):
                return level
        return last

    def verdict(self, tolerance: float) -> str:
        """One sentence or two: what multilevel gains for a mean within ``tolerance`` (relative), and why."""
        gain, beta, gamma = self.gain, self.beta, self.gamma
        slopes = f"beta = {_with_error(beta)}, gamma = {_with_error(gamma)}"
        times = f"{gain.value:.2g} times ({gain.low:.2g} to {gain.high:.2g})"
        last = len(self.pairs) - 1
        if not self.consistent:
            off = ", ".join(f"{x:.1f}" for x in self.departures)
            return f"the levels do not telescope (off by {off} standard errors): these numbers are not valid"
        level = self.enough(tolerance)
        if level < last:
            ratio = self._plain(level)
            if ratio <= 1.0:
                less = f"{1 / ratio:.2g} times less than" if ratio < 0.9 else "as much as"
                return (
                    f"MLMC gains nothing over plain Monte Carlo on level {level}, which is within {100 * tolerance:g} "
                    f"% of level {last} and costs {less} MLMC ({slopes}); plain Monte "
                    f"Carlo on level {last} costs {times} as much"
                )
        if gain.high <= 1:
            return (
                f"MLMC gains nothing: it costs {1 / gain.value:.2g} times as much as plain Monte Carlo; {self._why()}"
            )
        if gain.low <= 1:
            return f"it is not certain that MLMC gains anything: {times}; {self._why()}"
        if beta.low > gamma.high:
            where = "beta > gamma: most of the cost is on the coarsest level, and finer levels are almost free"
        elif beta.high < gamma.low:
            where = "beta < gamma: most of the cost is on the finest level"
        else:
            where = "beta and gamma do not differ for certain: the levels share the cost"
        return f"MLMC gains {times} over plain Monte Carlo on level {last} ({slopes}; {where})"

    def _why(self) -> str:
        beta, gamma = self.beta, self.gamma
        worst = float(np.nanmin(self.correlations))
        if worst < 0.5 and beta.low <= 0:
            return (
                f"both runs of a pair do not go together (least correlation {worst:.2f}), and the variance of their "
                f"differences does not fall (beta = {_with_error(beta)}): a finer level is another draw, no correction"
            )
        return (
            f"the variance of the differences falls too slowly for what the levels cost (beta = {_with_error(beta)}, "
            f"gamma = {_with_error(gamma)}, least correlation {worst:.2f})"
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON; what is infinite is None."""
        facts = {
            "mean": vars(self.mean),
            "bias": self.bias,
            "alpha": vars(self.alpha),
            "beta": vars(self.beta),
            "gamma": vars(self.gamma),
            "gain": vars(self.gain),
            "levels": [
                {
                    "level": level,
                    "pairs": len(p.fine),
                    "failed": p.failed,
                    "mean": float(p.fine.mean()),
                    "variance": float(p.fine.var(ddof=1)),
                    "mean_of_difference": float(self.means[level]),
                    "variance_of_difference": float(self.variances[level]),
                    "seconds_of_a_pair": float(self.costs[level]),
                    "seconds_alone": float(p.alone.mean()),
                    "correlation": float(self.correlations[level - 1]) if level else None,
                    "telescoping_departure": float(self.departures[level - 1]) if level else None,
                }
                for level, p in enumerate(self.pairs)
            ],
        }
        return dict(plain(facts))


def allocation(variances: npt.ArrayLike, costs: npt.ArrayLike, error: float) -> npt.NDArray[np.int64]:
    """Members per level (levels,) of least total cost for a standard error: sqrt(V/C) sum(sqrt(V C)) / error^2."""
    v, c = np.asarray(variances, dtype=np.float64), np.asarray(costs, dtype=np.float64)
    return np.ceil(np.sqrt(v / c) * np.sqrt(v * c).sum() / error**2).astype(np.int64)


def multilevel(
    run: Run, dimension: int, levels: int, seed: int = 0, pilot: int = 40, tolerance: float | None = None
) -> Multilevel:
    """Run ``pilot`` pairs on each of ``levels`` levels; with a tolerance, more where they pay, until it is met.

    tolerance: half width of the 95 % interval of the mean, relative to the mean. Pair i of level l has the point that
    follows from (seed, l, i), so that levels are independent of each other. Raises SceneError.
    """
    if levels < 3 or pilot < 4:  # a slope takes two differences
        raise SceneError(f"levels = {levels}, pilot = {pilot}: must be at least 3 levels and 4 pairs")
    samplers = [Sampler("monte-carlo", dimension, seed, stream=(level,)) for level in range(levels)]

    def more(level: int, first: int, count: int) -> Pairs:
        points = np.array([samplers[level].member(i) for i in range(first, first + count)])
        fine, alone = run(level, points)
        coarse, seconds = run(level - 1, points) if level else (np.zeros(count), np.zeros(count))
        good = np.isfinite(fine) & np.isfinite(coarse)
        seconds = seconds + alone
        return Pairs(fine[good], coarse[good], seconds[good], alone[good], int((~good).sum()))

    pairs: list[Pairs] = []
    for first in range(0, pilot, size := math.ceil(pilot / _ROUNDS)):
        log.info("pairs %d to %d of %d on each of %d levels", first + 1, min(first + size, pilot), pilot, levels)
        found = [more(level, first, min(size, pilot - first)) for level in range(levels)]
        pairs = [a.joined(b) for a, b in zip(pairs, found, strict=True)] if pairs else found
    for level, p in enumerate(pairs):
        if len(p.fine) < 4:
            raise SceneError(f"level {level}: {p.failed} of {pilot} pairs failed, so there is nothing to go by")
    known = Multilevel(tuple(pairs))
    while tolerance is not None and known.mean.relative > tolerance:
        target = tolerance * abs(known.mean.value) * known.mean.error / (known.mean.high - known.mean.value)
        lacking = known.allocation(target) - known.counts.astype(int)
        if not (lacking > 0).any():
            break
        for level in np.flatnonzero(lacking > 0):
            done = len(pairs[level].fine) + pairs[level].failed
            # at most twice as many at a time: the first few do not know the variance well
            count = int(min(lacking[level], done))
            log.info("level %d: %d more pairs", level, count)
            pairs[level] = pairs[level].joined(more(int(level), done, count))
        known = Multilevel(tuple(pairs))
    return known


def level_scenes(scene: Scene, levels: int, refined: Sequence[str] = REFINED) -> list[Scene]:
    """Scenes from the coarsest level to the finest, which is the scene itself; each is refined in all of the keys.

    Keys whose name ends with ``step`` are halved from level to level, others doubled. Raises SceneError: a key that the
    scene does not have, or a number of elements that cannot be halved so often.
    """
    from drillfem.scene.uncertain import value_at, with_value

    data = scene.to_dict()
    if "time.step" in refined:  # what is written is the same on all levels
        step = scene.time.step * 2 ** (levels - 1)
        for key in ("output.interval", "output.fields_interval"):
            interval = value_at(data, key)
            if interval:
                data = with_value(data, key, step * max(1, math.ceil(interval / step - 1e-9)))
    found = []
    for level in range(levels):
        coarse = data
        for key in refined:
            value = value_at(data, key)
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise SceneError(f"{key} = {value!r}: must be a number that a level can have half or twice of")
            factor = 2 ** (levels - 1 - level)
            if isinstance(value, int):
                if value % factor:
                    raise SceneError(f"{key} = {value}: must be a multiple of {2 ** (levels - 1)} for {levels} levels")
                value //= factor
            else:
                value *= factor if key.endswith("step") else 1 / factor
            coarse = with_value(coarse, key, value)
        found.append(Scene.from_dict(coarse))
    return found


def _slope(values: F8) -> float:
    """Slope of the binary logarithm per level; nan with fewer than two levels, or where one is 0."""
    if len(values) < 2 or not (values > 0).all():
        return math.nan
    return float(np.polyfit(np.arange(len(values)), np.log2(values), 1)[0])


def _with_error(x: Estimate) -> str:
    return f"{x.value:.2f} ± {x.error:.2f}"
