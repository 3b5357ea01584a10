"""The picture of a stability map."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from drillfem.render import style
from drillfem.stability.loop import Roots
from drillfem.stability.maps import StabilityMap
from drillfem.stability.transfer import F8

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.colors import BoundaryNorm, Colormap

_STABLE = "#c9dfee"
_BANDS = 12  # of colour, at most
_MOST_LINES = 16  # natural frequencies; more are a grey page
_SLOW = 0.01  # 1/s: what grows more slowly than this doubles in more than a minute
#: Growth from pale to dark: one hue, so that it survives in grey.
_HEAT = ("#fdf6d8", "#fbe3a6", "#f8cc7e", "#f2ad5f", "#e68a4b", "#d2653f", "#b34436", "#8c2b30", "#641b28", "#3e0f1c")


def draw_map(chart: StabilityMap, path: Path, sweep_samples: int = 500) -> Path:
    """Write a PNG: the map with its boundary and the confirming runs, and the unstable roots over the top speed.

    sweep_samples : speeds at which the lower panel shows the unstable roots, at the scene's own weight on bit.
    """
    from matplotlib.cm import ScalarMappable

    speeds, roots = chart.sweep(chart.own_point[1], sweep_samples)
    with style.page(1120, 1180) as figure:
        style.heading(figure, "Linear stability of steady drilling", f"{chart.scene.title}; model {chart.model}")
        grid = figure.add_gridspec(
            2, 2, height_ratios=(1.55, 1.0), width_ratios=(1, 0.025), left=0.075, right=0.905, top=0.855, bottom=0.065,
            hspace=0.36, wspace=0.03,
        )  # fmt: skip
        levels = _levels(max(float(np.nanmax(chart.growth)), _SLOW))
        colours, norm = _colours(levels)
        upper, lower = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[1, 0])
        _map(upper, chart, colours, norm)
        _roots(lower, chart, speeds, roots, colours, norm)
        bar = figure.colorbar(
            ScalarMappable(norm, colours), cax=figure.add_subplot(grid[:, 1]), ticks=levels, spacing="uniform"
        )
        bar.ax.set_yticklabels([style.number(x, 2) for x in levels])
        bar.ax.tick_params(length=0, labelsize=9.5)
        bar.set_label("growth of a motion (above: of the fastest), 1/s", fontsize=10.5)
        return style.save(figure, path)


def _levels(top: float) -> list[float]:
    """Growth rates that part the colours: the slow ones apart, then even and round."""
    step = next((s * 10.0**e for e in range(-3, 6) for s in (1, 2, 5) if top <= s * 10.0**e * _BANDS), top / _BANDS)
    return [0.0, *([_SLOW] if step > 2 * _SLOW else []), *(step * np.arange(1, 1 + int(np.ceil(top / step - 1e-9))))]


def _colours(levels: list[float]) -> tuple[Colormap, BoundaryNorm]:
    from matplotlib.colors import BoundaryNorm, LinearSegmentedColormap, ListedColormap

    heat = LinearSegmentedColormap.from_list("heat", _HEAT)
    colours = ListedColormap([heat(x) for x in np.linspace(0, 1, len(levels) - 1)])
    return colours.with_extremes(under=_STABLE, over=_HEAT[-1]), BoundaryNorm(levels, len(levels) - 1)


def _map(axes: Axes, chart: StabilityMap, colours: Colormap, norm: BoundaryNorm) -> None:
    """Growth over speed and weight, boundary, runs, the scene's own point, and where nothing is cut."""
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    x, y, growth = chart.speeds, chart.weights * 1e-3, chart.growth
    cuts = np.isfinite(growth[:, 0])
    below = chart.least_weight * 1e-3
    axes.contourf(
        x, y[cuts], np.maximum(growth[cuts], 1e-12), levels=norm.boundaries, cmap=colours, norm=norm, extend="max"
    )
    # at the least weight that cuts an undamped string is on the boundary: that is no region
    quiet = bool((chart.unstable[cuts][1:] == 0).any())
    segments, polygons = chart.outline() if quiet else (np.zeros((0, 2, 2)), [])
    scale = np.array([1.0, 1e-3])
    axes.add_collection(PolyCollection([p * scale for p in polygons], facecolors=_STABLE, edgecolors=_STABLE, lw=0.4))
    axes.add_collection(LineCollection(list(segments * scale), colors=style.INK, lw=1.8, capstyle="round"))
    axes.set_ylim(y[0], y[-1])
    axes.set_xlim(x[0], x[-1])
    axes.grid(False)
    if not cuts.all():
        axes.axhspan(y[0], below, facecolor="white", edgecolor=style.GREY, hatch="////", lw=0, zorder=2)
        axes.axhline(below, color=style.GREY, lw=1.0, zorder=3)
    _name_lobes(axes, chart)
    own = chart.own_point
    if x[0] <= own[0] <= x[-1] and y[0] <= own[1] * 1e-3 <= y[-1]:
        axes.plot(own[0], own[1] * 1e-3, marker="*", ms=19, mfc=style.ORANGE, mec="white", mew=1.4, ls="", zorder=7)
    for p in chart.points:
        up = p.growth > 0
        axes.plot(
            p.speed, p.weight * 1e-3, marker="o", ms=9, mfc=style.INK if up else "white",
            mec="white" if up else style.INK, mew=1.4, ls="", zorder=6,
        )  # fmt: skip
        if not p.agrees:
            axes.plot(p.speed, p.weight * 1e-3, marker="x", ms=17, mec=style.BLUE, mew=2.6, ls="", zorder=8)
    axes.set_xlabel("speed of the top, rad/s")
    axes.set_ylabel("weight on bit, kN")
    rpm = axes.secondary_xaxis("top", functions=(_to_rpm, _from_rpm))
    rpm.set_xlabel("rpm", color=style.INK, labelpad=6)

    handles: list[Artist] = []
    if polygons:
        handles.append(Patch(facecolor=_STABLE, label="stable"))
    if len(segments):
        handles.append(Line2D([], [], color=style.INK, lw=1.8, label="boundary"))
    if not cuts.all():
        handles.append(Patch(facecolor="white", edgecolor=style.GREY, hatch="////", lw=0, label="wear flats carry all"))
    handles.append(Line2D([], [], marker="*", ms=15, mfc=style.ORANGE, mec="white", ls="", label="the scene"))
    if chart.points:
        agree, of = chart.agreement
        dot: dict[str, Any] = {"marker": "o", "ms": 8, "ls": "", "mew": 1.4}
        handles += [
            Line2D([], [], mfc=style.INK, mec="white", label="run grows", **dot),
            Line2D([], [], mfc="white", mec=style.INK, label="run decays", **dot),
            Line2D([], [], ls="", label=f"({agree} of {of} runs agree)"),
        ]
        if agree < of:
            handles.append(Line2D([], [], marker="x", ms=11, mec=style.BLUE, mew=2.4, ls="", label="disagrees"))
    axes.legend(
        handles=handles, loc="lower left", bbox_to_anchor=(-0.01, 1.115), ncols=len(handles), columnspacing=1.2,
        handletextpad=0.5, handlelength=1.6, borderpad=0, fontsize=10,
    )  # fmt: skip


def _to_rpm(speed: Any) -> Any:
    return speed * (30 / np.pi)


def _from_rpm(speed: Any) -> Any:
    return speed / (30 / np.pi)


def _name_lobes(axes: Axes, chart: StabilityMap) -> None:
    """Frequency of the dominant root, where the growth over speed is greatest in each lobe."""
    from matplotlib.patheffects import withStroke

    # along the top, out of the way of the scene's own point and of the runs
    height = chart.weights[-1] - 0.05 * (chart.weights[-1] - chart.weights[0])
    row = int(np.argmin(np.abs(chart.weights - height)))
    growth, speeds = chart.growth[row], chart.speeds
    if not np.isfinite(growth[0]):
        return
    peak = np.flatnonzero((growth[1:-1] >= growth[:-2]) & (growth[1:-1] > growth[2:]) & (growth[1:-1] > _SLOW)) + 1
    shown: list[float] = []
    for k in sorted(peak, key=lambda i: -growth[i]):
        if any(abs(speeds[k] - s) < 0.095 * (speeds[-1] - speeds[0]) for s in shown):
            continue
        kind = " torsion" if chart.torsional[row, k] else ""
        margin = (0.065 if kind else 0.03) * (speeds[-1] - speeds[0])
        shown.append(float(np.clip(speeds[k], speeds[0] + margin, speeds[-1] - margin)))
        axes.text(
            shown[-1], height * 1e-3, f"{chart.frequency[row, k]:.1f} Hz{kind}", ha="center", va="center",
            fontsize=10, color=style.INK, path_effects=[withStroke(linewidth=3.0, foreground="white")], zorder=5,
            clip_on=True,
        )  # fmt: skip


def _roots(
    axes: Axes,
    chart: StabilityMap,
    speeds: F8,
    roots: Roots,
    colours: Colormap,
    norm: BoundaryNorm,
) -> None:
    """Frequencies of the unstable roots over speed, with what they lie near: blade passages and natural frequencies."""
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D

    growing = np.isfinite(roots.values) & (roots.values.real > 0)
    hertz = roots.values.imag / (2 * np.pi)
    # an undamped string has motions that hardly grow up to any frequency
    tell = growing & (roots.values.real > 0.005 * np.max(roots.values.real, where=growing, initial=0.0))
    top = 1.25 * float(hertz[tell].max()) if growing.any() else chart.band
    axes.set_xlim(speeds[0], speeds[-1])
    axes.set_ylim(0, top)
    axes.grid(False)
    legend = []
    twisting = bool((growing & roots.torsional).any())
    for name, motion, dashes, shown in (
        ("axial", chart.loop.axial, "-", True),
        ("torsional", chart.loop.torsion, ":", twisting),
    ):
        natural = motion.poles(2 * np.pi * top).imag / (2 * np.pi)
        if shown and 0 < len(natural) <= _MOST_LINES:
            axes.hlines(natural, speeds[0], speeds[-1], color="#bcc1c7", lw=0.9, ls=dashes, zorder=1)
            legend.append(Line2D([], [], color="#bcc1c7", lw=1.2, ls=dashes, label=f"{name} natural frequency"))
    passage = len(chart.loop.sectors) * speeds / (2 * np.pi)
    for k in range(1, 7):
        inside = np.flatnonzero(k * passage < 0.93 * top)
        axes.plot(speeds, k * passage, color=style.GREY, lw=0.9, ls=(0, (5, 3)), zorder=1)
        if len(inside) > 0.08 * len(speeds):
            i = min(int(inside[-1]), int(0.965 * len(speeds)))
            at = (float(speeds[i]), float(k * passage[i]))
            where: dict[str, Any] = {"textcoords": "offset points", "ha": "right", "color": style.GREY, "fontsize": 9.5}
            axes.annotate(f"{k}×", at, (-4, 5), **where)
    legend.append(Line2D([], [], color=style.GREY, lw=0.9, ls=(0, (5, 3)), label="multiple of the blades' passage"))
    for kind, width in ((False, 3.4), (True, 1.8)):
        segments, growth = _branches(speeds, roots, kind)
        if len(segments):
            segments[..., 1] /= 2 * np.pi
            case = LineCollection(list(segments), colors=style.INK, lw=width + 1.0, capstyle="round", zorder=2)
            heat = LineCollection(list(segments), cmap=colours, norm=norm, lw=width, capstyle="round", zorder=3)
            heat.set_array(growth)
            axes.add_collection(case)
            axes.add_collection(heat)
    if twisting:
        legend.append(Line2D([], [], color=style.INK, lw=1.2, label="thin line: a root of torsion"))
    own = chart.own_point
    axes.axvline(own[0], color=style.ORANGE, lw=1.6, zorder=2)
    axes.set_xlabel("speed of the top, rad/s")
    axes.set_ylabel("frequency, Hz")
    axes.set_title(f"Unstable roots at {style.number(own[1] * 1e-3, 4)} kN", fontsize=11.5, pad=24)
    axes.legend(
        handles=legend, loc="lower left", bbox_to_anchor=(-0.01, 0.995), ncols=len(legend), columnspacing=1.4,
        handletextpad=0.5, handlelength=2.0, borderpad=0.2, fontsize=10,
    )  # fmt: skip


def _branches(speeds: F8, roots: Roots, torsional: bool) -> tuple[F8, F8]:
    """Unstable roots joined from speed to speed: segments (q, 2, 2) in (speed, rad/s), and their growth (q,)."""
    segments, growth = [], []
    for i in range(len(speeds) - 1):
        here, there = (roots.values[k][np.isfinite(roots.values[k])] for k in (i, i + 1))
        kind = roots.torsional[i, : len(here)]
        for root in here[(here.real > 0) & (kind == torsional)]:
            to = there[np.argmin(np.abs(there - root))]
            # neighbours on a branch are close in both parts
            if abs(to - root) < 0.02 * abs(root) + 0.3 and to.real > 0:
                segments.append([(speeds[i], root.imag), (speeds[i + 1], to.imag)])
                growth.append(0.5 * (root.real + to.real))
    return np.array(segments).reshape(-1, 2, 2), np.array(growth)
