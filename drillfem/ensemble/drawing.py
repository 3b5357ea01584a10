"""Pictures of an ensemble: realisations, convergence, density, levels, sensitivities. They run nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from matplotlib.ticker import MaxNLocator

from drillfem.ensemble.multilevel import Multilevel
from drillfem.ensemble.sensitivity import Indices
from drillfem.ensemble.statistics import Comparison, Estimate, Statistics, running
from drillfem.render import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

F8 = npt.NDArray[np.float64]

COLOURS = {"monte-carlo": style.BLUE, "sobol": style.VERMILION, "latin-hypercube": style.GREEN}
#: Realisations that are drawn one by one.
SHOWN = 30


def words(name: str, unit: str = "1") -> str:
    """A quantity as a label: ``power ratio``, ``drilled depth, m``."""
    text = name.replace("_", " ")
    return text if unit in ("1", "") else f"{text}, {unit}"


def realisations(path: Path, time: F8, values: F8, name: str, unit: str, across: str = "time, s") -> Path:
    """Members' values (n, m) over time (m,), the first as lines, with median and bands of all; nan is left out."""
    with style.page(1000, 470) as figure:
        style.heading(
            figure,
            words(name).capitalize(),
            f"{len(values)} members: 50 % and 90 % of them, median, and {min(SHOWN, len(values))} of them",
        )
        axes = figure.add_axes((0.09, 0.13, 0.88, 0.69))
        levels = np.nanquantile(values, [0.05, 0.25, 0.5, 0.75, 0.95], axis=0)
        axes.fill_between(time, levels[0], levels[4], color=style.SKY, alpha=0.25, lw=0, label="90 %")
        axes.fill_between(time, levels[1], levels[3], color=style.SKY, alpha=0.45, lw=0, label="50 %")
        for row in values[:SHOWN]:
            axes.plot(time, row, color=style.GREY, lw=0.5, alpha=0.4)
        axes.plot(time, levels[2], color=style.BLUE, lw=2, label="median")
        axes.set_xlim(time[0], time[-1])
        axes.set_xlabel(across)
        axes.set_ylabel(words(name, unit))
        _legend(axes)
        return style.save(figure, path)


def convergence(path: Path, found: Statistics) -> Path:
    """Running mean and standard deviation over the number of members, with the bands of the mean."""
    band = running(found.values)
    first = min(9, len(found.values) - 1)
    with style.page(1000, 560) as figure:
        style.heading(
            figure, f"Convergence of {words(found.name)}", f"{len(found.values)} members in the order of their numbers"
        )
        top, bottom = figure.add_axes((0.09, 0.40, 0.88, 0.42)), figure.add_axes((0.09, 0.10, 0.88, 0.24))
        at = band.count
        top.fill_between(
            at, band.always_low, band.always_high, color=style.FAINT, lw=0, label="95 %, at all numbers at once"
        )
        top.fill_between(at, band.low, band.high, color=style.SKY, alpha=0.5, lw=0, label="95 %, at each number")
        top.plot(at, band.mean, color=style.BLUE, label="mean")
        shown = slice(first, None)
        low, high = float(band.low[shown].min()), float(band.high[shown].max())
        if math.isfinite(low + high) and high > low:
            room = 0.25 * (high - low)
            top.set_ylim(low - room, high + room)
        top.set_ylabel(words(found.name, found.unit))
        _legend(top)
        bottom.plot(at[1:], band.deviation[1:], color=style.VERMILION)
        deviation = found.standard_deviation
        if math.isfinite(deviation.high):
            bottom.axhspan(deviation.low, deviation.high, color=style.ORANGE, alpha=0.25, lw=0)
        bottom.set_ylim(bottom=0)
        bottom.set_ylabel("standard deviation")
        bottom.set_xlabel("members")
        ticks = [m * 10**e for e in range(7) for m in (1, 2, 5) if at[1] <= m * 10**e <= at[-1]]
        for axes in (top, bottom):
            axes.set_xscale("log")
            axes.set_xlim(at[1], max(at[-1], 2.1))
            axes.set_xticks(ticks, [f"{tick:,}".replace(",", "\u2009") for tick in ticks])
            axes.minorticks_off()
        top.tick_params(labelbottom=False)
        return style.save(figure, path)


def pdf(path: Path, found: Statistics) -> Path:
    """Kernel density with its band, the one with half the bandwidth, and the quantiles. Needs a density."""
    density = found.density
    if density is None:
        raise ValueError(f"all values of {found.name} are equal: they have no density")
    failed = f", {len(found.failed)} failed" if found.failed else ""
    unit = "" if found.unit == "1" else f" {found.unit}"
    with style.page(1000, 600) as figure:
        style.heading(
            figure,
            f"Density of {words(found.name)}",
            f"{len(found.values)} members{failed}; Gaussian kernel, bandwidth {style.number(density.bandwidth)}{unit}",
        )
        top, bottom = figure.add_axes((0.09, 0.36, 0.88, 0.46)), figure.add_axes((0.09, 0.10, 0.88, 0.20))
        top.fill_between(density.points, density.low, density.high, color=style.SKY, alpha=0.4, lw=0, label="95 %")
        half = "with half the bandwidth"
        top.plot(density.points, density.rough, color=style.GREY, lw=0.8, ls=(0, (4, 2)), label=half)
        top.plot(density.points, density.values, color=style.BLUE, lw=2, label="density")
        depth = -0.04 * max(density.high.max(), density.rough.max())
        shown = found.values[:2000]
        top.plot(shown, np.full(len(shown), depth), "|", color=style.GREY, ms=5)
        top.set_ylim(bottom=2 * depth)
        top.set_ylabel("density" if found.unit == "1" else f"density, 1/({found.unit})")
        top.tick_params(labelbottom=False)
        _legend(top)
        for k, quantile in enumerate(found.quantiles.values()):
            low, high = max(quantile.low, density.points[0]), min(quantile.high, density.points[-1])
            bottom.plot([low, high], [k, k], color=style.ORANGE, lw=3, alpha=0.6)
            bottom.plot(quantile.value, k, "o", color=style.VERMILION, ms=5)
        bottom.set_yticks(range(len(found.quantiles)), [f"{100 * share:g} %" for share in found.quantiles])
        bottom.set_ylim(-0.6, len(found.quantiles) - 0.4)
        bottom.set_ylabel("quantiles")
        bottom.set_xlabel(words(found.name, found.unit))
        for axes in (top, bottom):
            axes.set_xlim(density.points[0], density.points[-1])
        return style.save(figure, path)


def samplers(path: Path, comparisons: Mapping[str, Comparison]) -> Path:
    """Error of the mean over the number of members, by way of sampling: a panel per function."""
    n = len(comparisons)
    with style.page(1000, 500) as figure:
        style.heading(figure, "Ways of sampling", "standard deviation of the mean between independent randomisations")
        for k, (title, found) in enumerate(comparisons.items()):
            axes = figure.add_axes((0.08 + k * 0.93 / n, 0.13, 0.93 / n - 0.09, 0.64))
            for method, errors in found.errors.items():
                slope = found.slopes[method]
                axes.loglog(
                    found.counts,
                    errors,
                    "o-",
                    ms=4,
                    color=COLOURS[method],
                    label=f"{words(method.replace('-', ' '))}: slope {_signed(slope)}",
                )
            axes.set_title(title)
            axes.set_xlabel("members")
            axes.set_xticks(found.counts, [str(c) for c in found.counts])
            axes.minorticks_off()
            axes.set_ylim(bottom=min(e.min() for e in found.errors.values()) / 12)  # room for the legend
            axes.legend(loc="lower left")
        return style.save(figure, path)


def levels(path: Path, found: Multilevel, name: str, verdict: str) -> Path:
    """Variance, mean and cost per level with their slopes, and the verdict."""
    import textwrap

    at = np.arange(len(found.pairs))
    error = np.sqrt(found.variances / found.counts)
    with style.page(1000, 560) as figure:
        style.heading(figure, f"Levels: {words(name)}", "0 is the coarsest; pairs are the same rock on two levels")
        panels: tuple[tuple[str, F8, F8, str, Estimate, float], ...] = (
            ("variance", found.level_variances, found.variances, r"$\beta$", found.beta, -1),
            ("absolute mean", np.array([abs(p.fine.mean()) for p in found.pairs]), np.abs(found.means), r"$\alpha$",
             found.alpha, -1),
            ("processor time, s", np.array([p.alone.mean() for p in found.pairs]), found.costs, r"$\gamma$",
             found.gamma, 1),
        )  # fmt: skip
        for k, (title, one, pair, letter, slope, sign) in enumerate(panels):
            axes = figure.add_axes((0.075 + k * 0.325, 0.27, 0.245, 0.50))
            axes.semilogy(at, one, "s-", ms=5, color=style.GREY, label="a level alone")
            x, y = at[1:], pair[1:]
            axes.semilogy(x, y, "o", ms=6, color=style.BLUE, label="pairs: their difference, the cost of both")
            if k == 1:
                half = np.minimum(1.96 * error[1:], 0.999 * y), 1.96 * error[1:]
                axes.errorbar(x, y, yerr=half, fmt="none", ecolor=style.BLUE, capsize=3)
                if (y > 0).all():
                    axes.set_ylim(bottom=y.min() / 5)
            good = (y > 0) & np.isfinite(y)
            if good.all() and math.isfinite(slope.value):
                middle = float(np.log2(y).mean())
                axes.semilogy(x, 2 ** (middle + sign * slope.value * (x - x.mean())), color=style.VERMILION, lw=1.2)
            axes.set_title(f"{title}\n{letter} = {_signed(slope)}", fontsize=11)
            axes.set_xlabel("level")
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        figure.legend(
            *axes.get_legend_handles_labels(), loc="upper right", bbox_to_anchor=(0.985, 0.93), ncols=2, fontsize=10
        )
        figure.text(0.028, 0.085, "\n".join(textwrap.wrap(verdict, 112)), fontsize=10.5, color=style.INK, va="center")
        return style.save(figure, path)


def sensitivities(path: Path, found: Indices, name: str) -> Path:
    """First-order and total indices of every input, with their intervals; the most important on top."""
    inputs = sorted(found.total, key=lambda key: found.total[key].value)
    height = 190 + 62 * len(inputs)
    with style.page(1000, height) as figure:
        style.heading(
            figure,
            f"What {words(name)} depends on",
            f"Sobol' indices from {found.evaluations} members, with 95 % intervals",
        )
        axes = figure.add_axes((0.20, 70 / height, 0.76, 1 - 180 / height))
        for k, (label, indices, colour) in enumerate(
            (("total", found.total, style.SKY), ("first order", found.first, style.BLUE))
        ):
            at = np.arange(len(inputs)) + (0.18 if k else -0.18)
            value = np.array([indices[i].value for i in inputs])
            half = np.array([indices[i].high - indices[i].value for i in inputs])
            axes.barh(
                at, value, 0.34, color=colour, label=label, xerr=half, error_kw={"ecolor": style.INK, "capsize": 3}
            )
        axes.set_yticks(range(len(inputs)), [words(i) for i in inputs])
        axes.axvline(0, color=style.GREY, lw=0.8)
        axes.grid(axis="y", visible=False)
        axes.set_xlabel("share of the variance")
        _legend(axes)
        return style.save(figure, path)


def _legend(axes: Axes) -> None:
    """Above the axes, at the right: it covers nothing."""
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4)


def _signed(slope: Estimate) -> str:
    return f"{slope.value:.2f} ± {slope.error:.2f}".replace("-", "\u2212")
