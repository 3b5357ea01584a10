"""Charts as pictures: error against cost, orders as slopes, the Pareto front, the default ringed."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..render.style import BLUE, FAINT, GREEN, GREY, INK, ORANGE, PAPER, PURPLE, VERMILION, heading, page, save
from .points import Chart, Panel, Point

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: One colour for each family of series (the name up to the comma), one marker for each of its members.
COLOURS = (BLUE, GREEN, ORANGE, PURPLE, INK, GREY)
MARKERS = ("o", "s", "^", "D", "v", "P")
#: Errors from here on mean failure; the axis ends there.
FAILED = 2.0
_KEY = "pale band and filled marks: the Pareto front; cross: error above 1; grey fan: slopes of orders"
_ROW = 0.05  # distance of two labels, share of the axes' height
_WIDTH, _HEIGHT = 860, 660  # of a panel, pixels


def draw(chart: Chart, path: Path) -> Path:
    """Write the chart as a PNG."""
    columns = min(2, len(chart.panels))
    rows = math.ceil(len(chart.panels) / columns)
    width, height = columns * _WIDTH, rows * _HEIGHT + 120
    with page(width, height) as figure:
        unit = f"normaliser of this run {1e3 * chart.normaliser:.2f} ms of CPU"
        heading(figure, f"{chart.case}: speed against accuracy", f"{chart.title}: {chart.scene}")
        figure.text(28 / width, 1 - 88 / height, f"{_KEY}; {unit}", fontsize=10.5, color=GREY, va="center")
        for k, panel in enumerate(chart.panels):
            row, column = divmod(k, columns)
            left, bottom = (column * _WIDTH + 75) / width, ((rows - 1 - row) * _HEIGHT + 62) / height
            axes = figure.add_axes((left, bottom, (_WIDTH - 330) / width, (_HEIGHT - 125) / height))
            _panel(axes, chart, panel)
        return save(figure, path)


def _families(panel: Panel) -> dict[str, tuple[str, str]]:
    """Colour and marker of each series."""
    style: dict[str, tuple[str, str]] = {}
    families: list[str] = []
    for name in panel.series:
        family = name.split(",")[0]
        if family not in families:
            families.append(family)
        member = sum(other.split(",")[0] == family for other in style)
        style[name] = (COLOURS[families.index(family) % len(COLOURS)], MARKERS[member % len(MARKERS)])
    return style


def _panel(axes: Axes, chart: Chart, panel: Panel) -> None:
    from matplotlib.patheffects import Normal, Stroke

    style, fits, front = _families(panel), panel.fits, panel.front
    on_front = {id(point) for point in front}
    axes.set(xscale="log", yscale="log")
    worst = min(FAILED, 3 * max((p.error for p in panel.points if p.error < FAILED), default=1.0))
    _limits(axes, chart, panel, worst)
    # the front first, wide and pale, under everything
    corners = [(chart.cost(p), p.error) for p in front]
    steps = [(x, y) for (x0, y0), (x1, y1) in pairwise(corners) for x, y in ((x0, y0), (x1, y0))] + corners[-1:]
    if steps:
        x, y = zip(*steps, strict=True)
        axes.plot(x, y, color="#f3e3b3", linewidth=9, solid_joinstyle="miter", zorder=1)
    ends = []
    for name, points in panel.series.items():
        colour, marker = style[name]
        alive = [p for p in points if p.error < worst]
        axes.plot([chart.cost(p) for p in alive], [p.error for p in alive], color=colour, linewidth=1.3, zorder=2)
        for p in points:
            if p.cpu <= 0:  # refused before it ran
                continue
            failed = not p.error < worst
            axes.plot(
                chart.cost(p),
                min(p.error, worst * 0.8),
                marker="x" if failed else marker,
                markersize=6.5,
                color=colour,
                markerfacecolor=colour if id(p) in on_front else PAPER,
                markeredgewidth=1.3,
                clip_on=False,
                zorder=3,
            )
        order = f"  {fits[name].order:.1f}" if name in fits else ""
        lost = sum(p.cpu > 0 and not p.error < worst for p in points)
        order += f"  ({lost} ×)" if lost else ""
        ran = [p for p in points if p.cpu > 0]
        if not ran:
            ends.append((axes.get_xlim()[1], worst * 0.8, f"{name}  refused", colour))
            continue
        last: Point = (alive or ran)[-1]
        ends.append((chart.cost(last), min(last.error, worst * 0.8), f"{name}{order}", colour))
    for point in panel.points:
        if point.default and point.error < worst:
            axes.plot(chart.cost(point), point.error, "o", markersize=15, markerfacecolor="none", color=VERMILION)
            axes.annotate(
                "default",
                (chart.cost(point), point.error),
                (9, 9),
                textcoords="offset points",
                color=VERMILION,
                weight="bold",
                path_effects=[Stroke(linewidth=3, foreground="white"), Normal()],
                zorder=5,
            )
    for level in panel.levels:
        axes.axhline(level.error, color=GREY, linewidth=1, linestyle=(0, (5, 4)), zorder=1)
        ends.append((axes.get_xlim()[1], level.error, level.name, GREY))
    _label(axes, ends)
    _slopes(axes, chart, panel)
    _ticks(axes)
    axes.set_title(panel.title, fontsize=12.5, pad=26)
    note = f"reference: {panel.reference}" + (f"; {panel.note}" if panel.note else "")
    axes.annotate(note, (0, 1.02), xycoords="axes fraction", color=GREY, fontsize=9.5, va="bottom")
    axes.annotate(f"order in the {panel.refined}", (1.045, 1.02), xycoords="axes fraction", color=GREY, fontsize=9.5)
    axes.set_xlabel("cost of the stepping, CPU over normaliser")
    axes.set_ylabel(panel.quantity, fontsize=10)
    axes.tick_params(which="minor", length=0)


def _limits(axes: Axes, chart: Chart, panel: Panel, worst: float) -> None:
    cost = [chart.cost(p) for p in panel.points if p.cpu > 0]
    error = [p.error for p in panel.points if 0 < p.error < worst] + [level.error for level in panel.levels]
    axes.set_xlim(min(cost) / 1.6, max(cost) * 1.4)
    axes.set_ylim(min(error, default=1e-3) / 2.5, worst)


def _label(axes: Axes, ends: list[tuple[float, float, str, str]]) -> None:
    """Labels in a column on the right, in the order of the lines' ends, with a thin line to each."""
    to_axes = axes.transData + axes.transAxes.inverted()
    placed = sorted(((*to_axes.transform((x, y)), text, colour) for x, y, text, colour in ends), key=lambda e: e[1])
    heights = np.array([y for _, y, _, _ in placed])
    for _ in range(200):  # push neighbours apart until they are a row from each other
        gap = _ROW - np.diff(heights)
        push = np.where(gap > 1e-6, gap / 2, 0.0)
        if not push.any():
            break
        heights[:-1] -= push
        heights[1:] += push
        heights += max(0.0, -0.01 - heights[0])
        heights -= max(0.0, heights[-1] - 1.02)
    for (x, y, text, colour), height in zip(placed, heights, strict=True):
        axes.annotate(
            text,
            (x, y),
            (1.045, height),
            xycoords="axes fraction",
            textcoords="axes fraction",
            color=colour,
            fontsize=10,
            va="center",
            annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": FAINT, "linewidth": 0.8, "shrinkA": 1, "shrinkB": 4},
        )


def _slopes(axes: Axes, chart: Chart, panel: Panel) -> None:
    """A fan of slopes where there is room: what each order looks like where cost grows as refinement does."""
    orders = sorted({round(f.order) for f in panel.fits.values() if 0.5 <= f.order < 6.5})
    if not orders:
        return
    (x0, x1), (y0, y1) = np.log10(axes.get_xlim()), np.log10(axes.get_ylim())
    wide, high = 0.12, 0.2  # of the axes
    places = [(math.log10(chart.cost(p)), math.log10(p.error)) for p in _drawn(panel)]
    taken = [((x - x0) / (x1 - x0), (y - y0) / (y1 - y0)) for x, y in places]
    spots = [(x, y) for x in (0.03, 0.2, 0.4, 0.6, 0.8) for y in (0.3, 0.5, 0.7, 0.9)]

    def room(spot: tuple[float, float]) -> float:
        x, y = spot[0] + wide / 2, spot[1] - high / 2
        return min((math.hypot(a - x, b - y) for a, b in taken), default=1.0) - 0.02 * spot[0] - 0.02 * spot[1]

    left, top = max(spots, key=room)
    left, top, dx, dy = x0 + left * (x1 - x0), y0 + top * (y1 - y0), wide * (x1 - x0), high * (y1 - y0)
    for order in orders:
        x = left + min(dx, dy / order)
        y = top - order * (x - left)
        axes.plot([10**left, 10**x], [10**top, 10**y], color=GREY, linewidth=0.9)
        axes.annotate(
            str(order), (10**x, 10**y), (3, -1), textcoords="offset points", color=GREY, fontsize=9, va="center"
        )


def _drawn(panel: Panel) -> list[Point]:
    """Points with a place on logarithmic axes."""
    return [p for p in panel.points if p.cpu > 0 and 0 < p.error < math.inf]


def _ticks(axes: Axes) -> None:
    """Plain numbers where the axis spans less than two decades, powers of ten elsewhere."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = np.log10(axes.get_xlim())
    if high - low < 2:
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 3, 5) if high - low < 1 else (1, 2, 5)))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:.2g}" if x < 100 else f"{x:.0f}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())
