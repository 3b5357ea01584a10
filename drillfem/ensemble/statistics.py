"""What an ensemble says, each number with its error.

>>> import numpy as np
>>> values = np.random.default_rng(0).lognormal(size=400)
>>> print(mean(values))
1.58 (1.38 to 1.78)
>>> print(quantile(values, 0.9))
3.67 (2.91 to 4.14)
>>> converged(values, 0.05), needed(values, 0.05)
(False, 2529)

An interval holds the true value in 95 % of all ensembles (``confidence``); how well they keep that is measured in
docs/ensemble-statistics.md. Values are to be in the order of the members' numbers, not in that in which they ended:
the quick ones end first, and may be a kind of their own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from drillfem.ensemble.sampling import METHODS, Sampler
from drillfem.errors import SceneError
from drillfem.results.atomic import plain

if TYPE_CHECKING:
    from xarray import Dataset

F8 = npt.NDArray[np.float64]

CONFIDENCE = 0.95
#: Members below which no ensemble is called converged, whatever its spread.
LEAST = 30
#: Kurtosis of a sample above which intervals of mean and standard deviation hold less often than they say.
HEAVY = 6.0
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
#: The quantity that is told first, where members have it.
FIRST = "power_ratio"
#: Variables of a store that are about the run and not about the string.
_RECORD = ("seconds", "wall_seconds", "rank", "clips", "memory", "steps", "newton_iterations", "rejected_steps")


@dataclass(frozen=True)
class Estimate:
    """A number that is estimated: value, interval, standard error (nan where the interval does without one)."""

    value: float
    low: float
    high: float
    error: float = math.nan

    def __str__(self) -> str:
        """With as many digits as the interval is worth."""
        near = min((abs(end - self.value) for end in (self.low, self.high) if end != self.value), default=math.inf)
        digits = 3
        if 0 < near < abs(self.value):
            digits = min(max(3, 2 + math.ceil(math.log10(abs(self.value) / near))), 12)
        value, low, high = (f"{x:.{digits}g}" for x in (self.value, self.low, self.high))
        return f"{value} ({low} to {high})"

    @property
    def relative(self) -> float:
        """Half width of the interval relative to the value; infinite where that is 0."""
        width = (self.high - self.low) / 2
        return width / abs(self.value) if self.value else math.inf


# -- estimates --------------------------------------------------------------------------------------------------------
def mean(values: npt.ArrayLike, confidence: float = CONFIDENCE) -> Estimate:
    """Mean of values (n,), with Student's interval; of one value alone the interval is infinite.

    For members drawn by Latin hypercube or from a Sobol' set the interval is too wide, for these are more even than
    chance: see :func:`replicated`.
    """
    from scipy.stats import t

    x = _sample(values)
    n, centre = len(x), float(x.mean())
    if n == 1:
        return Estimate(centre, -math.inf, math.inf, math.inf)
    error = float(x.std(ddof=1)) / math.sqrt(n)
    half = float(t.ppf((1 + confidence) / 2, n - 1)) * error
    return Estimate(centre, centre - half, centre + half, error)


def replicated(means: npt.ArrayLike, confidence: float = CONFIDENCE) -> Estimate:
    """Mean from the means (r,) of ensembles of equal size that differ in their seed: right for all ways of sampling."""
    if len(_sample(means)) < 2:
        raise ValueError("an error from randomisations needs at least two of them")
    return mean(means, confidence)


def standard_deviation(values: npt.ArrayLike, confidence: float = CONFIDENCE) -> Estimate:
    """Standard deviation of values (n,), with Bonett's interval, which does not ask for a normal distribution.

    D. G. Bonett, Approximate confidence interval for standard deviation of nonnormal distributions, Computational
    Statistics & Data Analysis 50 (2006). Below five values the interval is 0 to infinity.
    """
    from scipy.stats import norm, trim_mean

    x = _sample(values)
    n = len(x)
    if n < 5:
        return Estimate(float(x.std(ddof=1)) if n > 1 else 0.0, 0.0, math.inf, math.inf)
    variance = float(x.var(ddof=1))
    if variance == 0:
        return Estimate(0.0, 0.0, 0.0, 0.0)
    around = trim_mean(x, 1 / (2 * math.sqrt(n - 4)))
    kurtosis = n * float(((x - around) ** 4).sum()) / ((n - 1) * variance) ** 2
    error = math.sqrt(max(kurtosis - (n - 3) / n, 0.0) / (n - 1))  # of the logarithm of the variance
    z = float(norm.ppf((1 + confidence) / 2))
    centre = math.log(n / (n - z) * variance) if n > z else math.inf
    value = math.sqrt(variance)
    low, high = (math.exp((centre + sign * z * error) / 2) for sign in (-1, 1))
    return Estimate(value, min(low, value), high, value * error / 2)


def quantile(values: npt.ArrayLike, share: float, failed: int = 0, confidence: float = CONFIDENCE) -> Estimate:
    """Quantile of values (n,), with the interval between two of them that the binomial distribution gives.

    It holds for any distribution and any n; where n is too small for an end of it, that end is infinite. ``failed``
    members may have had any value: the interval is wide enough for all of them.
    """
    from scipy.stats import binom

    x = np.sort(_sample(values))
    n, every = len(x), len(x) + failed
    tail = (1 - confidence) / 2
    first = int(binom.ppf(tail, every, share)) - 1 - failed  # had all that failed been lower
    last = int(binom.ppf(1 - tail, every, share))  # higher
    low = float(x[first]) if first >= 0 else -math.inf
    high = float(x[last]) if last < n else math.inf
    value = float(np.quantile(x, share, method="median_unbiased"))
    return Estimate(value, min(low, value), max(high, value))


def probability(true: npt.ArrayLike, failed: int = 0, confidence: float = CONFIDENCE) -> Estimate:
    """Probability of what is true of some members (n,), with Clopper and Pearson's exact interval.

    ``failed`` members bound it: it might have been true of none of them, or of all.
    """
    from scipy.stats import beta

    hit = np.asarray(true, dtype=bool)
    if not hit.size:
        raise ValueError("no member to take a statistic of")
    k, every, tail = int(hit.sum()), len(hit) + failed, (1 - confidence) / 2
    low = float(beta.ppf(tail, k, every - k + 1)) if k else 0.0
    k += failed
    high = float(beta.ppf(1 - tail, k + 1, every - k)) if k < every else 1.0
    value = float(hit.mean())
    return Estimate(value, low, high, math.sqrt(value * (1 - value) / len(hit)))


# -- density ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Density:
    """Kernel density (m,) at points (m,), per unit of the quantity, and its band.

    The band is for the density smoothed with the bandwidth, point by point; it cannot tell what the smoothing has
    levelled. ``rough`` is the density with half the bandwidth: what differs between the two is not certain.
    """

    points: F8
    values: F8
    low: F8
    high: F8
    rough: F8
    bandwidth: float


def bandwidth(values: npt.ArrayLike) -> float:
    """Bandwidth of a Gaussian kernel for values (n,), in their unit; 0 where all are equal.

    Improved Sheather-Jones: right for several peaks as well. Z. I. Botev et al., Kernel density estimation via
    diffusion, Annals of Statistics 38 (2010). Where its equation has no solution, Silverman's rule.
    """
    from scipy.fft import dct
    from scipy.optimize import brentq

    x = _sample(values)
    n, spread = len(np.unique(x)), float(np.ptp(x))
    if spread == 0:
        return 0.0
    length, bins = 2 * spread, 2**12
    share, _ = np.histogram(x, bins, (x.min() - spread / 2, x.max() + spread / 2))
    power = (dct(share / len(x))[1:] / 2) ** 2
    k = np.arange(1.0, bins) ** 2

    def roughness(order: int, t: float) -> float:
        return 2 * math.pi ** (2 * order) * float((k**order * power * np.exp(-k * math.pi**2 * t)).sum())

    def residual(t: float) -> float:
        f = roughness(7, t)
        for s in range(6, 1, -1):
            odd = math.prod(range(1, 2 * s, 2)) / math.sqrt(2 * math.pi)
            f = roughness(s, (2 * odd * (1 + 0.5 ** (s + 0.5)) / 3 / (n * f)) ** (2 / (3 + 2 * s)))
        return t - float((2 * n * math.sqrt(math.pi) * f) ** -0.4)

    try:
        return length * math.sqrt(brentq(residual, 0.0, 0.1))
    except (ValueError, ZeroDivisionError, OverflowError):
        low, high = np.quantile(x, [0.25, 0.75])
        scale = min(s for s in (float(x.std(ddof=1)), float(high - low) / 1.34) if s > 0)
        return 0.9 * scale * len(x) ** -0.2


def density(
    values: npt.ArrayLike,
    width: float | None = None,
    support: tuple[float, float] = (-math.inf, math.inf),
    count: int = 401,
    confidence: float = CONFIDENCE,
) -> Density:
    """Kernel density of values (n,) that are not all equal, at ``count`` points.

    width: of the Gaussian kernel, by default :func:`bandwidth`. support: what the quantity cannot leave, such as
    (0, 1) for a power ratio; what the kernels have beyond is put back by reflection, so that the integral is 1.
    Raises ValueError where all values are equal.
    """
    from scipy.stats import norm

    x = _sample(values)
    h = bandwidth(x) if width is None else width
    if not h > 0:
        raise ValueError("all values are equal: they have no density")
    at = np.linspace(max(x.min() - 4 * h, support[0]), min(x.max() + 4 * h, support[1]), count)
    images = [x, *(2 * end - x for end in support if math.isfinite(end))]

    def kernels(points: F8, h: float) -> F8:
        each = [np.exp(-(((points[:, None] - image) / h) ** 2) / 2) for image in images]
        return np.sum(each, axis=0) / (h * math.sqrt(2 * math.pi))

    found = np.empty((3, count))
    for i in range(0, count, 32):  # a few points at a time: members may be many
        each = kernels(at[i : i + 32], h)
        found[0, i : i + 32] = each.mean(axis=1)
        found[1, i : i + 32] = each.std(axis=1, ddof=1) / math.sqrt(len(x))
        found[2, i : i + 32] = kernels(at[i : i + 32], h / 2).mean(axis=1)
    half = float(norm.ppf((1 + confidence) / 2)) * found[1]
    return Density(at, found[0], np.maximum(found[0] - half, 0), found[0] + half, found[2], h)


# -- how many are enough ----------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Running:
    """Mean of the first 1, 2, ... n members, each array (n,).

    deviation: standard deviation of these members, nan of one. low, high: Student's interval, each for itself.
    always_low, always_high: wider, and right at all numbers of members at once (asymptotically), so that one may look
    as often as one likes, and stop.
    """

    count: npt.NDArray[np.int64]
    mean: F8
    deviation: F8
    low: F8
    high: F8
    always_low: F8
    always_high: F8


def running(values: npt.ArrayLike, confidence: float = CONFIDENCE) -> Running:
    """Convergence of the mean of values (n,); intervals of the first are infinite.

    The wider band: I. Waudby-Smith et al., Time-uniform central limit theory and asymptotic confidence sequences,
    Annals of Statistics 52 (2024), tightest at n.
    """
    from scipy.stats import t

    x = _sample(values)
    count = np.arange(1, len(x) + 1)
    shift = x[0]  # sums of squares about a value near the mean keep their digits
    centre = np.cumsum(x - shift) / count
    square = np.maximum(np.cumsum((x - shift) ** 2) - count * centre**2, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        deviation = np.sqrt(square / (count - 1))
        half = t.ppf((1 + confidence) / 2, np.maximum(count - 1, 1)) * deviation / np.sqrt(count)
    alpha = 1 - confidence
    rho = (2 * math.log(1 / alpha) + math.log(1 + 2 * math.log(1 / alpha))) / len(x)  # its square
    wide = deviation * np.sqrt(2 * (count * rho + 1) / (count**2 * rho) * np.log(np.sqrt(count * rho + 1) / alpha))
    half[0] = wide[0] = math.inf
    wide = np.maximum(wide, half)  # its theory is about many
    centre = centre + shift
    return Running(count, centre, deviation, centre - half, centre + half, centre - wide, centre + wide)


def converged(
    values: npt.ArrayLike, tolerance: float, confidence: float = CONFIDENCE, least: int = LEAST, always: bool = False
) -> bool:
    """Whether the interval of the mean of values (n,) has a relative half width of at most ``tolerance``.

    Never with fewer than ``least`` values. always: by the wider band of :func:`running`, for one who stops by where
    the mean is, not only by how well it is known.
    """
    x = np.asarray(values, dtype=np.float64)
    if len(x) < max(least, 2):
        return False
    if not always:
        return mean(x, confidence).relative <= tolerance
    band = running(x, confidence)
    return float(band.always_high[-1] - band.mean[-1]) <= tolerance * abs(float(band.mean[-1]))


def needed(values: npt.ArrayLike, tolerance: float, confidence: float = CONFIDENCE) -> int | None:
    """How many members plain Monte Carlo needs for a relative half width of ``tolerance``, as far as values (n,) tell.

    None where the mean is 0, or there is one value.
    """
    from scipy.stats import norm

    x = _sample(values)
    if len(x) < 2 or x.mean() == 0:
        return None
    z = float(norm.ppf((1 + confidence) / 2))
    return max(math.ceil((z * float(x.std(ddof=1)) / (tolerance * abs(float(x.mean())))) ** 2), LEAST)


# -- ways of sampling -------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Comparison:
    """Error of the mean by way of sampling: ``errors[method]`` (m,) at counts (m,), and its slope in the logarithms."""

    counts: tuple[int, ...]
    errors: dict[str, F8]
    slopes: dict[str, Estimate]

    def gain(self, method: str) -> float:
        """How many times fewer members a method needs than plain Monte Carlo, for its error at the largest count."""
        return float((self.errors["monte-carlo"][-1] / self.errors[method][-1]) ** 2)


def compare(
    function: Callable[[F8], F8],
    dimension: int,
    counts: Sequence[int],
    replicas: int,
    seed: int = 0,
    methods: Sequence[str] = METHODS,
) -> Comparison:
    """Compare ways of sampling by the means of ``function``, of points (n, dimension) to values (n,).

    Errors are standard deviations between ``replicas`` independent randomisations, so the exact mean need not be known.
    Slopes are fitted by least squares; their 95 % intervals come from resampling the randomisations.
    """
    chance = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2**31,)))
    errors, slopes = {}, {}
    for method in methods:
        means = np.empty((replicas, len(counts)))
        for r in range(replicas):
            if method == "latin-hypercube":  # another count is another set
                for j, n in enumerate(counts):
                    means[r, j] = function(_points(method, dimension, seed, n, r)).mean()
            else:
                found = function(_points(method, dimension, seed, max(counts), r))
                means[r] = [found[:n].mean() for n in counts]
        errors[method] = means.std(axis=0, ddof=1)
        drawn = means[chance.integers(replicas, size=(400, replicas))].std(axis=1, ddof=1)
        fits = np.polyfit(np.log(counts), np.log(drawn.T), 1)[0]
        value = float(np.polyfit(np.log(counts), np.log(errors[method]), 1)[0])
        low, high = np.quantile(fits, [0.025, 0.975])
        slopes[method] = Estimate(value, float(low), float(high), float(fits.std(ddof=1)))
    return Comparison(tuple(counts), errors, slopes)


def _points(method: str, dimension: int, seed: int, count: int, replica: int) -> F8:
    sampler = Sampler(method, dimension, seed, count, (replica,))
    return np.array([sampler.member(i) for i in range(count)])


# -- a store ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Statistics:
    """What an ensemble says about one quantity.

    values (n,) in the order of members (n,); failed: reason by number of the member that has no value. density is None
    where all values are equal. awaited: members that are stored but do not count yet, see :func:`of`.
    """

    name: str
    unit: str
    members: npt.NDArray[np.int64]
    values: F8
    failed: dict[int, str]
    mean: Estimate
    standard_deviation: Estimate
    quantiles: dict[float, Estimate]
    density: Density | None
    method: str
    awaited: int = 0

    @property
    def heavy_tailed(self) -> bool:
        """Whether a few members make the spread: intervals of mean and standard deviation are then too narrow."""
        from scipy.stats import kurtosis

        return bool(np.ptp(self.values) > 0 and kurtosis(self.values, fisher=False) > HEAVY)

    @property
    def failed_share(self) -> float:
        """Share of members that have no value."""
        return len(self.failed) / (len(self.failed) + len(self.values))

    def probability(self, above: float) -> Estimate:
        """Probability that the quantity is larger, bounded by those that failed."""
        return probability(self.values > above, len(self.failed))

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON; an infinite end is None."""

        def said(x: Estimate) -> dict[str, float]:
            return {"value": x.value, "low": x.low, "high": x.high, "standard_error": x.error}

        facts = {
            "quantity": self.name,
            "unit": self.unit,
            "sampling": self.method,
            "confidence": CONFIDENCE,
            "members": len(self.values),
            "awaited": self.awaited,
            "failed": {str(i): reason for i, reason in self.failed.items()},
            "failed_share": self.failed_share,
            "mean": said(self.mean),
            "standard_deviation": said(self.standard_deviation),
            "quantiles": {f"{p:g}": said(q) for p, q in self.quantiles.items()},
            "heavy_tailed": self.heavy_tailed,
            "bandwidth": None if self.density is None else self.density.bandwidth,
        }
        return dict(plain(facts))


def quantities(data: Dataset) -> list[str]:
    """Names of the numbers that members of a store have, those that do not vary last, the power ratio first."""
    names = [
        str(name)
        for name, variable in data.data_vars.items()
        if variable.dims == ("member",)
        and variable.dtype.kind in "fiu"
        and str(name) not in _RECORD
        and not str(name).startswith("input_")
    ]

    def order(name: str) -> tuple[bool, bool]:
        x = data[name].values
        x = x[np.isfinite(x)]
        return name != FIRST, not (len(x) and np.ptp(x) > 1e-12 * np.abs(x).max())

    return sorted(names, key=order)


def failures(data: Dataset) -> dict[int, str]:
    """Reason by number of the member, of those that failed."""
    failed = np.flatnonzero(data["status"].values == "failed")
    return {int(data["member"].values[k]): str(data["reason"].values[k]) for k in failed}


def of(data: Dataset, name: str) -> Statistics:
    """Statistics of a quantity of a store. Raises SceneError: no such quantity, or no member has it.

    In an ensemble that still runs, members after the first that is missing do not count: they have overtaken it, and
    the quick ones would count too often.
    """
    if name not in quantities(data):
        raise SceneError(f"quantity {name!r}: must be one of {', '.join(quantities(data))}")
    data = data.sortby("member")
    gaps = np.flatnonzero(data["member"].values != np.arange(data.sizes["member"]))
    awaited = data.sizes["member"] - int(gaps[0]) if len(gaps) else 0
    data = data.isel(member=slice(data.sizes["member"] - awaited))
    every, x = data["member"].values.astype(np.int64), data[name].values.astype(np.float64)
    failed = failures(data)
    has = np.isfinite(x) & ~np.isin(every, list(failed))
    failed |= {int(i): f"has no {name}" for i in every[~has] if int(i) not in failed}
    if not has.any():
        reason = next(iter(failed.values()), "")
        raise SceneError(f"quantity {name!r}: none of {len(every)} members has it{f' ({reason})' if reason else ''}")
    values, gone = x[has], len(failed)
    width, support = bandwidth(values), SUPPORTS.get(name, (-math.inf, math.inf))
    return Statistics(
        name,
        str(data[name].attrs.get("units", "1")),
        every[has],
        values,
        dict(sorted(failed.items())),
        mean(values),
        standard_deviation(values),
        {p: quantile(values, p, gone) for p in QUANTILES},
        density(values, width, support) if width > 0 else None,
        str(data.attrs.get("method", METHODS[0])),
        awaited,
    )


#: What a quantity cannot leave, for its density.
SUPPORTS: Mapping[str, tuple[float, float]] = {FIRST: (0.0, 1.0)}


def _sample(values: npt.ArrayLike) -> F8:
    x = np.asarray(values, dtype=np.float64)
    if x.ndim != 1 or not len(x):
        raise ValueError("no member to take a statistic of")
    if not np.isfinite(x).all():
        raise ValueError("a value is not finite: leave failed members out, and count them")
    return x
