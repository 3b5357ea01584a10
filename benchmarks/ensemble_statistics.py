"""Statistics of ensembles: do intervals keep their promise, which way of sampling, do levels pay, what depends on what.

Writes docs/ensemble-statistics.md and its pictures in about ten minutes of one core.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from common import DOCS, table
from scipy import stats
from scipy.special import ndtri

from drillfem.ensemble import drawing
from drillfem.ensemble import statistics as ensemble
from drillfem.ensemble.analysis import Members
from drillfem.ensemble.multilevel import Multilevel, level_scenes, multilevel
from drillfem.ensemble.sensitivity import sensitivity
from drillfem.ensemble.store import read
from drillfem.scene import load_scene

Array = npt.NDArray[np.float64]
IMG = DOCS / "img"


# -- intervals --------------------------------------------------------------------------------------------------------
class TwoPeaks:
    """Half and half of two normal distributions, 6 standard deviations apart."""

    def rvs(self, n: int, random_state: np.random.Generator) -> Array:
        return random_state.normal(size=n) + 6.0 * random_state.integers(2, size=n)

    def mean(self) -> float:
        return 3.0

    def std(self) -> float:
        return float(np.sqrt(10.0))

    def pdf(self, x: Array) -> Array:
        return np.asarray((stats.norm.pdf(x) + stats.norm.pdf(x - 6)) / 2)

    def ppf(self, p: float) -> float:
        from scipy.optimize import brentq

        return float(brentq(lambda x: (stats.norm.cdf(x) + stats.norm.cdf(x - 6)) / 2 - p, -10, 16))


DISTRIBUTIONS: dict[str, Any] = {
    "normal": stats.norm(),
    "two peaks": TwoPeaks(),
    "lognormal, s = 0.5": stats.lognorm(s=0.5),
    "lognormal, s = 1": stats.lognorm(s=1.0),
}
REPEATS = 1000


def coverage(distribution: Any, n: int, chance: np.random.Generator) -> list[float]:
    """Share of ensembles of n whose interval holds the truth: mean, deviation, median, 95 % quantile."""
    truths = distribution.mean(), distribution.std(), distribution.ppf(0.5), distribution.ppf(0.95)
    held = np.zeros(4)
    for _ in range(REPEATS):
        x = distribution.rvs(n, random_state=chance)
        found = (
            ensemble.mean(x),
            ensemble.standard_deviation(x),
            ensemble.quantile(x, 0.5),
            ensemble.quantile(x, 0.95),
        )
        held += [e.low <= truth <= e.high for e, truth in zip(found, truths, strict=True)]
    return list(held / REPEATS)


def stopping(distribution: Any, tolerance: float, size: int, chance: np.random.Generator) -> list[float]:
    """Looking after every member: share of stopped ensembles whose interval holds the mean, and their median size.

    By the band of each number, and by that of all numbers at once.
    """
    truth, found = distribution.mean(), []
    for which in ("", "always_"):
        held, sizes = [], []
        for _ in range(REPEATS // 2):
            x = distribution.rvs(size, random_state=chance)
            band = ensemble.running(x)
            low, high = getattr(band, f"{which}low"), getattr(band, f"{which}high")
            met = np.flatnonzero((high - low) / 2 <= tolerance * np.abs(band.mean))
            at = int(met[met >= ensemble.LEAST - 1][0])
            held.append(low[at] <= truth <= high[at])
            sizes.append(at + 1)
        found += [float(np.mean(held)), float(np.median(sizes))]
    return found


def kernel_error(distribution: Any, n: int, width: Callable[[Array], float], chance: np.random.Generator) -> float:
    """Mean over 40 ensembles of the integrated squared error of the density, of the integral of its square."""
    errors = []
    for _ in range(40):
        x = distribution.rvs(n, random_state=chance)
        found = ensemble.density(x, width(x), count=801)
        exact = distribution.pdf(found.points)
        errors.append(np.trapezoid((found.values - exact) ** 2, found.points) / np.trapezoid(exact**2, found.points))
    return float(np.mean(errors))


def silverman(x: Array) -> float:
    """Rule of thumb."""
    low, high = np.quantile(x, [0.25, 0.75])
    return float(0.9 * min(x.std(ddof=1), (high - low) / 1.34) * len(x) ** -0.2)


# -- scenes -----------------------------------------------------------------------------------------------------------
RANDOM: dict[str, Any] = {
    "rock.intrinsic_specific_energy": None,
    "bit.wear_flat_length": None,
    "top_drive.weight_on_bit": None,
    "random.rock.key": "rock.intrinsic_specific_energy",
    "random.rock.distribution": "lognorm",
    "random.rock.parameters": {"s": 0.1, "scale": "0.252 GPa"},
    "random.rock.proportional": ["rock.contact_strength", "rock.contact_strength_stalled"],
    "random.weight.key": "top_drive.weight_on_bit",
    "random.weight.distribution": "norm",
    "random.weight.parameters": {"loc": "48 kN", "scale": "1.5 kN"},
    "random.wear.key": "bit.wear_flat_length",
    "random.wear.distribution": "uniform",
    "random.wear.parameters": {"loc": "1.0 mm", "scale": "0.2 mm"},
}
LUMPED = {
    "model": "lumped",
    "time.end": "5 s",
    "time.step": "5 ms",
    "output.interval": "5 ms",
    "rock.surface.scheme": "profile",
}


def g_function(u: Array) -> Array:
    """Sobol's g-function of four inputs of falling importance."""
    a = np.array([0.0, 1.0, 4.5, 9.0])
    return np.asarray(np.prod((np.abs(4 * u - 2) + a) / (1 + a), axis=1))


def samplers() -> dict[str, ensemble.Comparison]:
    """Ways of sampling on a function and on a scene."""
    found = {"g-function, 4 inputs": ensemble.compare(g_function, 4, (32, 64, 128, 256, 512), replicas=40)}
    members = Members([load_scene("vertical-c1-cd4", RANDOM | LUMPED)], "drilled_depth")
    with members.ready() as run:
        scene = ensemble.compare(lambda u: run(0, u)[0], 3, (8, 16, 32), replicas=12)
    assert not members.reasons, members.reasons
    return found | {"depth drilled in 5 s, 3 inputs": scene}


# -- levels -----------------------------------------------------------------------------------------------------------
def euler(level: int, u: Array) -> tuple[Array, Array]:
    """dS = S/20 dt + S/2 dW by Euler in 2^(level + 1) steps, cost 1 per step: alpha = beta = gamma = 1."""
    steps = 2 ** (level + 1)
    noise = ndtri(u).reshape(len(u), steps, -1).sum(axis=2) / 8
    value = np.ones(len(u))
    for i in range(steps):
        value *= 1 + 0.05 / steps + 0.5 * noise[:, i]
    return value, np.full(len(u), float(steps))


BOTH = ("mesh.elements", "time.step")
#: label: scene, changes, quantity, what is refined, levels, pairs
LEVELS: dict[str, tuple[str, dict[str, Any], str, tuple[str, ...], int, int]] = {
    "Chapter 7, power ratio of 2 s": (
        "horizontal-stochastic",
        {"time.end": "2 s", "time.step": "1 ms", "mesh.elements": 32},
        "power_ratio",
        BOTH,
        4,
        40,
    ),
    "C1 with a damping of 1e-4 s, drilled depth in 10 s": (
        "vertical-c1-cd4",
        RANDOM | {"time.end": "10 s"},
        "drilled_depth",
        BOTH,
        4,
        30,
    ),
    "C1 with a damping of 1e-5 s, spin of the bit after 30 s": (
        "vertical-c1-cd5",
        RANDOM | {"time.end": "30 s"},
        "bit_angular_speed",
        BOTH,
        4,
        40,
    ),
}


def levels(label: str) -> Multilevel:
    """Pairs of a scene."""
    name, changes, quantity, refined, count, pilot = LEVELS[label]
    members = Members(level_scenes(load_scene(name, changes), count, refined), quantity)
    with members.ready() as run:
        return multilevel(run, members.inputs[0].dimension, count, pilot=pilot)


def level_row(label: str, found: Multilevel) -> list[str]:
    """Slopes and gain."""
    cells = [f"{x.value:.2f} ± {x.error:.2f}" for x in (found.alpha, found.beta, found.gamma)]
    off = float(np.abs(found.departures).max())
    return [
        label,
        *cells,
        f"{found.correlations.min():.3f}",
        f"{off:.1f}",
        f"{found.gain.value:.2g} ({found.gain.low:.2g} to {found.gain.high:.2g})",
    ]


# -- sensitivity ------------------------------------------------------------------------------------------------------
A, B = 7.0, 0.1
VARIANCE = A**2 / 8 + B * np.pi**4 / 5 + B**2 * np.pi**8 / 18 + 0.5
FIRST = np.array([(1 + B * np.pi**4 / 5) ** 2 / 2, A**2 / 8, 0.0]) / VARIANCE
TOTAL = FIRST + np.array([1, 0, 1]) * 8 * B**2 * np.pi**8 / 225 / VARIANCE


def ishigami(u: Array) -> Array:
    """Ishigami's function of three inputs."""
    x = np.pi * (2 * u - 1)
    return np.asarray(np.sin(x[:, 0]) + A * np.sin(x[:, 1]) ** 2 + B * x[:, 2] ** 4 * np.sin(x[:, 0]))


def index_rows(count: int, repeats: int) -> list[list[str]]:
    """Per index: exact, found once, root mean square error and coverage over ``repeats`` seeds."""
    sets = [sensitivity(ishigami, ("1", "2", "3"), count, seed) for seed in range(repeats)]
    rows = []
    for kind, exact in (("first", FIRST), ("total", TOTAL)):
        for k, name in enumerate("123"):
            found = [getattr(s, kind)[name] for s in sets]
            error = np.sqrt(np.mean([(x.value - exact[k]) ** 2 for x in found]))
            held = np.mean([x.low <= exact[k] <= x.high for x in found])
            order = "first order" if kind == "first" else "total"
            rows.append([f"{order}, x{name}", f"{exact[k]:.4f}", str(found[0]), f"{error:.3f}", f"{100 * held:.0f} %"])
    return rows


# -- page -------------------------------------------------------------------------------------------------------------
def percent(x: float) -> str:
    """94.6 %."""
    return f"{100 * x:.1f} %"


def intervals() -> dict[str, str]:
    """Coverage of intervals, stopping, bandwidths."""
    chance = np.random.default_rng(7)
    covered = [
        [f"{name}, {n} members", *map(percent, coverage(distribution, n, chance))]
        for name, distribution in DISTRIBUTIONS.items()
        for n in (30, 100, 1000)
    ]
    stopped = []
    for name, size in (("normal", 2000), ("lognormal, s = 0.5", 6000), ("lognormal, s = 1", 20_000)):
        distribution = stats.norm(loc=3) if name == "normal" else DISTRIBUTIONS[name]
        one, few, every, more = stopping(distribution, 0.05, size, chance)
        stopped.append([name, percent(one), f"{few:.0f}", percent(every), f"{more:.0f}"])
    kernels = [
        [f"{name}, {n} members", *(percent(kernel_error(d, n, w, chance)) for w in (ensemble.bandwidth, silverman))]
        for name, d in DISTRIBUTIONS.items()
        for n in (100, 1000)
    ]
    return {
        "repeats": str(REPEATS),
        "coverage": table(["", "mean", "standard deviation", "median", "95 % quantile"], covered),
        "stopping": table(["", "each: holds", "members", "at once: holds", "members"], stopped),
        "kernels": table(["", "improved Sheather-Jones", "Silverman"], kernels),
    }


def sampling() -> dict[str, str]:
    """Slopes of ways of sampling."""
    compared = samplers()
    drawing.samplers(IMG / "ensemble-samplers.png", compared)
    rows = [
        [
            title,
            *(f"{found.slopes[m]}" for m in found.slopes),
            *(f"{found.gain(m):.3g}" for m in list(found.slopes)[1:]),
        ]
        for title, found in compared.items()
    ]
    header = [
        "",
        "Monte Carlo",
        "Sobol'",
        "Latin hypercube",
        "Sobol': times fewer members",
        "Latin hypercube: the same",
    ]
    return {"samplers": table(header, rows)}


def multilevels() -> dict[str, str]:
    """Slopes and verdicts of levels."""
    known = multilevel(euler, 64, 6, pilot=1000)
    rows, said = [level_row("dS = S/20 dt + S/2 dW, Euler (exact: 1, 1, 1)", known)], []
    for k, label in enumerate(LEVELS):
        found = levels(label)
        verdict = found.verdict(0.01)
        drawing.levels(IMG / f"ensemble-levels-{k + 1}.png", found, label, verdict)
        rows.append(level_row(label, found))
        said.append(f"- {label}: {verdict}.")
        print(label, verdict, flush=True)
    return {
        "levels": table(["", "α", "β", "γ", "least correlation", "telescoping", "gain"], rows),
        "verdicts": "\n".join(said),
    }


def sensitivities() -> dict[str, str]:
    """Indices of Ishigami's function and of a scene."""
    header = ["", "exact", "found, one seed", "error, all seeds", "intervals that hold"]
    members = Members([load_scene("vertical-c1-cd4", RANDOM | {"time.end": "10 s"})], "drilled_depth")
    with members.ready() as run:
        indices = sensitivity(lambda u: run(0, u)[0], members.inputs[0].names, 64)
    drawing.sensitivities(IMG / "ensemble-sensitivity.png", indices, "drilled_depth")
    rows = [[name, str(indices.first[name]), str(indices.total[name])] for name in indices.first]
    return {
        "ishigami": table(header, index_rows(256, 100)),
        "ishigami_more": table(header, index_rows(2048, 50)),
        "indices": table(["", "first order", "total"], rows),
        "indices_members": f"{indices.evaluations} members, {indices.failed} failed",
    }


def small_ensemble() -> dict[str, str]:
    """Statistics and pictures of a hundred members of chapter 7."""
    from drillfem.ensemble.run import ensemble as run_ensemble

    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "ensemble"
        run_ensemble(load_scene("horizontal-stochastic"), 100, folder, until=4.0, keep=["bit_axial_speed"])
        data = read(folder)
    power = ensemble.of(data, "power_ratio")
    drawing.convergence(IMG / "ensemble-convergence.png", power)
    drawing.pdf(IMG / "ensemble-density.png", power)
    speed = data["history_bit_axial_speed"].values.astype(np.float64)
    where = IMG / "ensemble-realisations.png"
    drawing.realisations(where, data["time"].values, speed, "bit_axial_speed", "m/s")
    quantile = power.quantiles[0.5]
    return {"power": f"mean {power.mean}, standard deviation {power.standard_deviation}, median {quantile}"}


SECTIONS = (intervals, sampling, multilevels, sensitivities, small_ensemble)


def main(names: list[str]) -> None:
    """Measure the sections named, or all; write the page with these and the numbers that are there already."""
    store = IMG / "ensemble-statistics.json"
    for section in SECTIONS:
        if not names or section.__name__ in names:
            found = section()
            numbers = (json.loads(store.read_text()) if store.exists() else {}) | found
            store.write_text(json.dumps(numbers, indent=1, ensure_ascii=False) + "\n")
            print(section.__name__, "done", flush=True)
    text = TEXT
    for name, value in json.loads(store.read_text()).items():
        text = text.replace("{" + name + "}", value)
    text = text.replace("{heavy}", f"{ensemble.HEAVY:g}")
    (DOCS / "ensemble-statistics.md").write_text(text)


TEXT = """# Statistics of ensembles

An ensemble says something about strings that were not run. How much it says is an error, and every number here has
one. Numbers and pictures are written by `python benchmarks/ensemble_statistics.py`
(a part of it: `intervals`, `sampling`, `multilevels`, `sensitivities`, `small_ensemble`). They speak of 10 000 members
on [another page](chapter-7-stochastic.md).

```
drillfem statistics DIR                                  # of the power ratio, or of the drilled depth
drillfem statistics DIR --quantity drilled_depth         # of any number that members have
drillfem statistics DIR-1 DIR-2 DIR-3                    # other seeds of the same: error from their differences
drillfem multilevel SCENE --out levels --tolerance 1%    # do mesh and step levels pay?
drillfem sensitivity SCENE --out indices -n 64           # which input is it?
```

Tables go to the screen, pictures and JSON into the folder. In Python: `drillfem.ensemble.statistics` (`of(dataset,
name)`, or `mean`, `standard_deviation`, `quantile`, `probability`, `density`, `running`, `converged`, `needed` of any
array), `multilevel`, `sensitivity`.

## Intervals

All intervals are 95 %.

- mean: Student's. It relies on the central limit: skewed quantities need more members.
- standard deviation: Bonett's (2006), which estimates the kurtosis; for a normal distribution only, the χ² interval of
  textbooks is right.
- quantiles: between two members, whose ranks follow from the binomial distribution. Right for any distribution
  and any number of members; with too few, an end is infinite, and is printed so.
- a probability, such as that of a power ratio above 0.2: Clopper and Pearson's.
- density: Gaussian kernels; the bandwidth is printed. The band tells how much another ensemble would differ, not what
  the smoothing has levelled: the dashed curve has half the bandwidth, and what only one of the two shows is uncertain.

Share of {repeats} ensembles whose interval holds the true value (± 0.7 %):

{coverage}

Quantiles keep their promise throughout (with few members that of 95 % has an infinite end). Mean and standard
deviation do not where the tail is heavy: the members that would tell are rare. No interval can make up for members that
were not seen, so where the kurtosis is above {heavy}, `drillfem statistics` says that these two hold less often.

Bandwidth: improved Sheather-Jones (Botev 2010). The rule of thumb takes two peaks for one wide one. Integrated
squared error of the density, of the integral of its square:

{kernels}

## Members that fail

They are named, with their reason. Dropping them silently would make the ensemble one of strings that do not fail. A
failed member may have had any value: the intervals of quantiles and probabilities are wide enough for the worst case.
No such bound exists for mean, standard deviation and density without a bound on the quantity: they are those of the
members that did not fail, and the table says so.

In an ensemble that still runs, a member counts when all before it have ended. Otherwise the quick ones would be in
the majority.

## How many are enough

`converged(values, tolerance)` is true when the half width of the interval is below the tolerance times the mean, and
there are at least 30 members. Looking after every member, tolerance 5 %, share of ensembles whose interval holds the
mean where they stop, and how many members that took (median):

{stopping}

So to stop by the width of the interval does no harm. To stop by its position does, say as soon as it leaves out a
number that one wants to rule out: at some number of members up to 400 the interval of a third of all ensembles leaves
out the true mean (counted in the notebook `02_random_rock.py`). For such questions there is the wider band
(Waudby-Smith et al. 2024), which holds at all numbers of members at once: `running(values).always_low`,
`converged(..., always=True)`. It takes almost three times as many.

Chapter 7, 100 members of 4 s (`--until 4`): power ratio {power}.

![convergence](img/ensemble-convergence.png)

![density](img/ensemble-density.png)

![realisations](img/ensemble-realisations.png)

## Ways of sampling

Error of the mean as the standard deviation between independent randomisations (40 for the function, 12 for the scene:
lumped model, random rock strength, weight on bit, wear flat), and its slope over the number of members:

{samplers}

![samplers](img/ensemble-samplers.png)

Members of a Sobol' set or of a Latin hypercube are not independent: Student's interval of their mean is too wide, and
`drillfem statistics` says so. Run some ensembles that differ in `--seed`, and name all their folders: the error then
comes from their differences. Quantiles and density are taken as if members were independent.

## Levels

Multilevel Monte Carlo takes most members on a coarse mesh with long steps and corrects them by pairs: the same rock on
two levels. With L levels,

    E[P_L] = E[P_0] + Σ E[P_l − P_(l−1)],    |E[P_l − P_(l−1)]| ~ 2^(−αl),  V[P_l − P_(l−1)] ~ 2^(−βl),  cost ~ 2^(γl)

`drillfem multilevel` takes the scene as the finest level, doubles step and element length for each coarser one, runs
some pairs on each, and says what the slopes mean. With `--tolerance` it goes on with the cheapest numbers of pairs,
proportional to √(V/C). Telescoping: the mean of a level from its own members and from the pairs above it, in standard
errors; the gain is the cost of plain Monte Carlo on the finest level over that of multilevel, for the same error.
Errors come from resampling the pairs.

{levels}

{verdicts}

![levels of chapter 7](img/ensemble-levels-1.png)

![levels of a regular string](img/ensemble-levels-2.png)

![levels of a chaotic string](img/ensemble-levels-3.png)

A chaotic string forgets its rock: on another mesh the same rock gives another spin after 30 s, as another rock would.
No level helps there. Where the coarsest level is within the tolerance already, plain Monte Carlo on it is the
cheapest of all, and the verdict names it.

## Sensitivity

Sobol' indices by SALib (Saltelli's sample, scrambled Sobol' points). A field counts as one input, whatever the number
of its terms (`--terms`: each by itself). Ishigami's function, 256 base points (1280 members), 100 seeds:

{ishigami}

2048 base points, 50 seeds:

{ishigami_more}

Intervals come from resampling base points as if they were independent, which a Sobol' set is not: it does better, and
they are too wide, many times with many points.

C1 with a damping of 1e-4 s, depth drilled in 10 s ({indices_members}):

{indices}

![sensitivity](img/ensemble-sensitivity.png)

A failed member takes its base point with it: all members that share it. Indices are then those of the part of the rock
in which nothing fails.
"""


if __name__ == "__main__":
    main(sys.argv[1:])
