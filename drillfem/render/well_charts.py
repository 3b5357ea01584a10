"""Charts of a string in a curved hole: plan and section, place in the clearance, loads along it, directors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from drillfem.errors import DrillfemError
from drillfem.render import style
from drillfem.render.story import Story
from drillfem.render.straight import place, subtitle
from drillfem.render.well import CASED, OPEN, TOUCHES, Well, WellBrush, colour_bar, name_places
from drillfem.render.well_view import Overview

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from drillfem.scene import Scene
    from drillfem.torque_drag.operation import Profile

#: colours of the chosen times, the last one first
TIMES = (style.INK, style.VERMILION, style.BLUE, style.GREEN, style.ORANGE, style.PURPLE)
DEGREE_PER_30_M = math.degrees(30.0)


def coloured(axes: Axes, x: np.ndarray, y: np.ndarray, values: np.ndarray, brush: WellBrush, width: float) -> None:
    """A line through points (n,) in the colours of values (n,) at them."""
    from matplotlib.collections import LineCollection

    points = np.stack([x, y], axis=1)
    lines = LineCollection(
        list(np.stack([points[:-1], points[1:]], axis=1)),
        cmap=brush.cmap, norm=brush.norm, lw=width, zorder=4, capstyle="butt", joinstyle="round",
    )  # fmt: skip
    lines.set_array((values[1:] + values[:-1]) / 2)
    axes.add_collection(lines, autolim=False)


# -- plan and section ------------------------------------------------------------------------------------
def plan_page(story: Story, field: str | None, index: int, path: Path) -> Path:
    """well.png: the well from above and from the side, to scale, with what colours the string."""
    well, brush = Well(story), WellBrush(story, field)
    p = np.linspace(0.0, well.end, 2001)
    r = well.hole.frame(p).position
    end = r[-1, :2]
    azimuth = math.atan2(end[1], end[0]) if np.linalg.norm(end) > 1e-6 * well.end else 0.0
    way = np.array([math.cos(azimuth), math.sin(azimuth)])
    with style.page(1600, 1000) as figure:
        style.heading(figure, f"{story.title}: plan and section", subtitle(story, float(story.times[index])))
        views = (
            ("Plan", r[:, 1], r[:, 0], "east (m)", "north (m)", False),
            ("Vertical section", r[:, :2] @ way, r[:, 2], _departure(azimuth), "depth (m)", True),
        )
        node = well.hole.frame(well.depth(index)).position
        strings = ((node[:, 1], node[:, 0]), (node[:, :2] @ way, node[:, 2]))  # as the views
        for k, (title, x, y, across, along, down) in enumerate(views):
            axes = place(figure, 90 + 790 * k, 120, 690, 740)
            axes.set_title(title)
            axes.set_xlabel(across)
            axes.set_ylabel(along)
            for a, b, cased in well.stretches:
                part = (p >= a) & (p <= b)
                axes.plot(x[part], y[part], color=CASED if cased else OPEN, lw=11, zorder=2, solid_capstyle="butt")
            coloured(axes, strings[k][0], strings[k][1], brush.nodes(index), brush, 4.5)
            axes.plot(x[0], y[0], "s", ms=9, color=style.INK, zorder=5)
            _frame(axes, x, y, 690 / 740, down)
            names = []
            for name, depth in [
                *((m.name, m.depth) for m in well.marks),
                ("string ends", float(well.depth(index)[-1])),
            ]:
                here, further = (np.array([np.interp(q, p, x), np.interp(q, p, y)]) for q in (depth, depth + 1e-3))
                axes.plot(*here, "o", ms=5, mfc="white", mec=style.INK, zorder=7)
                names.append((f"{name}\n{depth:.0f} m", here, further))
            name_places(axes, names)
        colour_bar(figure, brush, (90, 920, 380, 15))
        words = "Each to scale; the string is drawn wider than it is. Square: the top."
        if any(c for _, _, c in well.stretches):
            words += " Grey band: cased, brown: open hole."
        figure.text(0.34, 1 - 930 / 1000, words, fontsize=10.5, color=style.GREY, va="center")
        return style.save(figure, path)


def _departure(azimuth: float) -> str:
    return f"distance from the top towards {math.degrees(azimuth) % 360:.0f}\u00b0 (m)"


def _frame(axes: Axes, x: np.ndarray, y: np.ndarray, aspect: float, down: bool) -> None:
    """Equal scales around all points, with room for names; the vertical axis may run down."""
    half = 0.62 * max(np.ptp(x), np.ptp(y) * aspect, 1e-3 * (np.ptp(x) + np.ptp(y)))
    cx, cy = (float(v.min() + v.max()) / 2 for v in (x, y))
    axes.set_xlim(cx - half, cx + half)
    tall = half / aspect
    axes.set_ylim((cy + tall, cy - tall) if down else (cy - tall, cy + tall))


# -- in the clearance ------------------------------------------------------------------------------------
def clearance_page(story: Story, field: str | None, index: int, path: Path) -> Path | None:
    """clearance.png: the hole rolled out: where the string is in it and where it presses; None for a string that is
    taken to lie on the axis of its hole."""
    well, brush = Well(story), WellBrush(story, field)
    offsets = [well.offset(i) for i in _some(len(story.times), 60)]
    if max(float(np.abs(o).max()) for o in offsets) < 1e-6:
        return None
    everything = 1e3 * np.array(offsets)
    zoom = _zoom(well, index)
    with style.page(1600, 1320) as figure:
        style.heading(figure, f"{story.title}: the hole rolled out", subtitle(story, float(story.times[index])))
        whole = (float(well.depth(index)[0]), float(well.depth(index)[-1]))
        columns = ((88, 960, whole, "The whole string"), (1176, 390, zoom, f"{zoom[0]:.0f} to {zoom[1]:.0f} m"))
        rows = (("up", 1, 225), ("right", 0, 225), ("round", None, 170), ("force", None, 125), ("gap", None, 125))
        for x, w, window, title in columns:
            y = 168
            for row, (kind, part, h) in enumerate(rows):
                axes = place(figure, x, y, w, h)
                y += h + 34
                axes.set_xlim(window)
                first = x == columns[0][0]
                if kind in ("up", "right"):
                    assert part is not None
                    _across(axes, well, brush, index, part, everything[:, :, part], window)
                    if first:
                        axes.set_ylabel("mm to the high side" if kind == "up" else "mm to the right")
                    across = abs(float(np.diff(axes.get_ylim())[0])) * 1e-3 / h
                    times = (window[1] - window[0]) / w / across
                    words = ("High and low side", "Left and right")[row]
                    axes.set_title(f"{words}, across \u00d7{style.number(times, 2)}", fontsize=11, weight="normal")
                elif kind == "round":
                    _around(axes, well, brush, index)
                    axes.set_title("Where on the wall it presses", fontsize=11, weight="normal")
                else:
                    _at_wall(axes, well, index, kind, window)
                    if first:
                        axes.set_ylabel("side force\n(kN/m)" if kind == "force" else "gap (mm)")
                for mark in well.marks:
                    if window[0] < mark.depth < window[1]:
                        axes.axvline(mark.depth, color=style.GREY, lw=0.9, ls=(0, (4, 3)), zorder=1.5)
                axes.tick_params(labelbottom=row == len(rows) - 1)
                if row == len(rows) - 1:
                    axes.set_xlabel("measured depth (m)")
                if row == 0:
                    _parts_above(figure, axes, well, index, window, (x, 168, w), title)
        colour_bar(figure, brush, (88, 1256, 380, 15))
        figure.text(
            0.345,
            1 - 1274 / 1320,
            "Seen down the hole with its high side up. Grey band: what the clearance lets the axis of the string do; "
            "pale blue: where it was during\nthe run. Line outside the band: the wall gives way by its stiffness. "
            + _dashed(well),
            fontsize=10,
            color=style.GREY,
            va="center",
            linespacing=1.35,
        )
        return style.save(figure, path)


def _dashed(well: Well) -> str:
    """What the dashed lines at measured depths are; empty where there are none."""
    return f"Dashed: {', '.join(f'{m.name} {m.depth:.0f} m' for m in well.marks)}." if well.marks else ""


def _some(count: int, most: int) -> list[int]:
    """At most so many indices below count, spread evenly, the last one among them."""
    return sorted({round(k) for k in np.linspace(0, count - 1, min(count, most))})


def _zoom(well: Well, index: int) -> tuple[float, float]:
    """Measured depths worth a closer look: the tools above the bit, else around the first place that touches."""
    story, p = well.story, well.depth(index)
    end = float(p[-1])
    tools = 0.0
    for part in reversed(story.parts):
        if part.bottom - part.top > 0.04 * story.length:
            break
        tools += part.bottom - part.top
    if 0 < tools < 0.5 * story.length:
        return max(float(p[0]), end - 2.2 * tools), end
    touching = np.flatnonzero(well.side_force(index) > TOUCHES)
    centre = float(p[touching[0]]) if len(touching) else end
    half = 0.03 * story.length
    centre = float(np.clip(centre, p[0] + half, end - half))
    return centre - half, centre + half


def _across(
    axes: Axes, well: Well, brush: WellBrush, index: int, part: int, ever: np.ndarray, window: tuple[float, float]
) -> None:
    """One component of the string's place in the hole (mm), the clearance and the range over the run."""
    p, here = well.depth(index), 1e3 * well.offset(index)[:, part]
    at, room = well.room(index)
    room = 1e3 * room
    axes.fill_between(at, -room, room, color="#e4e6e9", lw=0, zorder=1)
    axes.fill_between(p, ever.min(axis=0), ever.max(axis=0), color=style.SKY, alpha=0.45, lw=0, zorder=2)
    axes.plot(p, here, color=style.INK, lw=3.4, zorder=3)
    coloured(axes, p, here, brush.nodes(index), brush, 2.4)
    axes.axhline(0, color=style.GREY, lw=0.7, zorder=1.4)
    inside, near = (p >= window[0]) & (p <= window[1]), (at >= window[0]) & (at <= window[1])
    limit = 1.1 * max(float(np.abs(room[near]).max()), float(np.abs(here[inside]).max()))
    axes.set_ylim(-limit, limit)


def _around(axes: Axes, well: Well, brush: WellBrush, index: int) -> None:
    """Points that press on the wall: angle round the hole against measured depth."""
    story = well.story
    at, p = story.at_wall("wall_arc_length")[index], story.at_wall("wall_depth")[index]
    force = story.at_wall("wall_side_force")[index]
    offset = np.stack([np.interp(at, story.arc, column) for column in well.offset(index).T], axis=1)
    angle = np.degrees(np.arctan2(offset[:, 0], -offset[:, 1]))  # 0 at the low side, positive to the right
    on = force > TOUCHES
    colours = brush.nodes(index) if brush.field else np.zeros_like(story.arc)
    if brush.field == "side_force":
        tone = force[on]
    else:
        tone = np.interp(at[on], story.arc, colours)
    tones = brush.cmap(brush.norm(tone))
    axes.scatter(p[on], angle[on], c=tones, s=13, lw=0.25, edgecolors=style.INK, zorder=3)
    axes.set_ylim(-180, 180)
    axes.set_yticks([-180, -90, 0, 90, 180], ["high", "left", "low", "right", "high"])


def _at_wall(axes: Axes, well: Well, index: int, kind: str, window: tuple[float, float]) -> None:
    """Side force (kN/m) or gap (mm) at the points that may touch the wall, with the range over the run."""
    story = well.story
    name, factor = {"force": ("wall_side_force", 1e-3), "gap": ("wall_gap", 1e3)}[kind]
    p, ever = story.at_wall("wall_depth")[index], factor * story.at_wall(name)
    low, high = ever.min(axis=0), ever.max(axis=0)
    axes.fill_between(p, low, high, color=style.SKY, alpha=0.45, lw=0)
    axes.plot(p, ever[index], color=style.INK, lw=1.1)
    inside = (p >= window[0]) & (p <= window[1])
    top, bottom = float(high[inside].max()), 0.0
    usual = _usual(p[inside], high[inside])
    if kind == "gap":
        bottom = min(0.0, _usual(p[inside], low[inside], 1.0))
    elif top > 1.8 * usual:
        k = int(np.argmax(np.where(inside, ever[index], -np.inf)))
        words = f"up to {style.number(float(ever[index, k]), 2)} at {p[k]:.0f} m"
        box = {"facecolor": "white", "alpha": 0.85, "edgecolor": "none", "pad": 1.5}
        axes.text(0.97, 0.93, words, transform=axes.transAxes, ha="right", va="top", fontsize=9.5, bbox=box, zorder=5)
        top = 1.3 * usual
    if kind == "gap":
        axes.axhline(0, color=style.VERMILION, lw=0.9)
    if kind == "force" and top < 1e-3 * TOUCHES:
        axes.text(0.5, 0.5, "touches nowhere", transform=axes.transAxes, ha="center", va="center", color=style.GREY)
        top = 1.0
    axes.set_ylim(bottom - 0.06 * (top - bottom), top + 0.1 * max(top - bottom, 1e-9))
    axes.locator_params(axis="y", nbins=4)


def _usual(p: np.ndarray, values: np.ndarray, percent: float = 99.0) -> float:
    """What values at measured depths p (n,) exceed over no more than one per cent of the length."""
    return float(np.percentile(np.interp(np.linspace(p[0], p[-1], 2000), p, values), percent))


def _parts_above(
    figure: Figure,
    axes: Axes,
    well: Well,
    index: int,
    window: tuple[float, float],
    at: tuple[float, float, float],
    title: str,
) -> None:
    """A strip above a chart with the sections of the string."""
    x, y, w = at
    strip = place(figure, x, y - 46, w, 15, sharex=axes)
    strip.set_yticks([])
    strip.tick_params(labelbottom=False, length=0)
    strip.grid(False)
    strip.set_title(title, pad=6)
    strip.set_ylim(0, 1)
    widest = max((part.outer for part in well.story.parts), default=0.0) or 1.0
    depth = well.depth(index)
    for part in well.story.parts:
        a, b = (float(np.interp(s, well.story.arc, depth)) for s in (part.top, part.bottom))
        a, b = max(a, window[0]), min(b, window[1])
        if b <= a:
            continue
        tone = 0.93 - 0.33 * part.outer / widest
        strip.axvspan(a, b, color=(tone, tone, tone + 0.02), lw=0)
        strip.axvline(a, color="white", lw=1)
        if (b - a) / (window[1] - window[0]) * w > 7.5 * len(part.name):
            strip.text((a + b) / 2, 0.46, part.name, ha="center", va="center", fontsize=9)


# -- along the string ------------------------------------------------------------------------------------
Column = tuple[str, str, float]  # field, title with unit, factor
COLUMNS: tuple[Column, ...] = (
    ("side_force", "Side force (kN/m)", 1e-3),
    ("axial_force", "Tension (kN)", 1e-3),
    ("shear_force", "Shear force (kN)", 1e-3),
    ("torque", "Torque (kN m)", -1e-3),
    ("bending_moment", "Bending\nmoment (kN m)", 1e-3),
    ("gap", "Gap (mm)", 1e3),
    ("spin", "Spin (rpm)", 30 / math.pi),
)


def along_page(story: Story, shown: Sequence[int], path: Path) -> Path:
    """along.png: the hole's inclination and bend, and the loads of the string, against measured depth at some times;
    beside them what a soft string says that turns steadily."""
    well = Well(story)
    columns = [c for c in COLUMNS if c[0] in story.colour_fields and np.ptp(story.values(c[0])) > 0]
    main = shown[-1]
    depth = well.depth(main)
    soft = steady(story)
    with style.page(1600, 1150) as figure:
        words = ["one pose"] if len(story.times) < 2 else [f"{story.times[0]:g} to {story.times[-1]:g} s"]
        style.heading(
            figure,
            f"{story.title}: along the string",
            "   \u00b7   ".join([f"{story.model} model", *words, f"string of {style.number(story.length, 4)} m"]),
        )
        room, gap, left = 1600 - 84 - 24, 22, 84
        wide = (room - gap * len(columns)) / (len(columns) + 1)
        y, h = 166, 900
        first = place(figure, left, y, wide, h)
        _hole_column(first, well)
        first.set_ylim(float(depth[-1]), 0.0)
        first.set_ylabel("measured depth (m)")
        for k, (name, title, factor) in enumerate(columns, start=1):
            axes = place(figure, left + k * (wide + gap), y, wide, h, sharey=first)
            axes.tick_params(labelleft=False)
            axes.set_title(title, fontsize=11.5, loc="center", pad=7)
            ever = factor * story.values(name)
            axes.fill_betweenx(depth, ever.min(axis=0), ever.max(axis=0), color=style.FAINT, alpha=0.6, lw=0)
            for i, colour in zip(reversed(shown), TIMES, strict=False):
                lw, zorder = (1.6, 4) if i == main else (1.1, 3)
                axes.plot(ever[i], well.depth(i), color=colour, lw=lw, zorder=zorder)
            dashed = _of_soft(soft, name)
            if dashed is not None:
                axes.plot(*dashed, color=style.PURPLE, lw=1.6, ls=(0, (5, 3)), zorder=5)
            axes.axvline(0.0, color=style.GREY, lw=0.8, zorder=1.5)
            _limits(axes, depth, ever, main, dashed)
            axes.locator_params(axis="x", nbins=4)
        for axes in figure.axes:
            for part in story.parts[:-1]:
                z = float(np.interp(part.bottom, story.arc, depth))
                axes.axhline(z, color="#c8ccd1", lw=0.9, zorder=1)
            for mark in well.marks:
                axes.axhline(mark.depth, color=style.GREY, lw=0.9, ls=(0, (4, 3)), zorder=1.5)
        _legend(figure, story, shown, soft)
        figure.text(
            0.985,
            1 - 1128 / 1150,
            f"Grey: range over the run. {_dashed(well)}{' Thin: joints.' if len(story.parts) > 1 else ''}",
            fontsize=10,
            color=style.GREY,
            ha="right",
        )
        return style.save(figure, path)


def _hole_column(axes: Axes, well: Well) -> None:
    """Inclination (deg) and, shaded, the bend of the hole (deg per 30 m)."""
    p = np.linspace(0.0, well.end, 2001)
    frame = well.hole.frame(p)
    bend = DEGREE_PER_30_M * frame.dogleg_severity
    axes.plot(np.degrees(frame.inclination), p, color=style.INK, lw=1.8)
    top = max(1.08 * float(np.degrees(frame.inclination).max()), 5.0)
    axes.set_xlim(0.0, top)
    axes.set_title("Inclination (\u00b0)", fontsize=11.5, loc="center", pad=7)
    if bend.max() > 1e-6:
        axes.fill_betweenx(p, 0, 0.7 * top * bend / bend.max(), color=style.SKY, alpha=0.55, lw=0)
        axes.text(
            0.97, 0.988, f"shaded: bend,\nup to {style.number(float(bend.max()), 2)}\u00b0/30 m",
            transform=axes.transAxes, ha="right", va="top", fontsize=9.5, color="#20759b",
            bbox={"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 1},
        )  # fmt: skip
    axes.locator_params(axis="x", nbins=4)


def _limits(
    axes: Axes, depth: np.ndarray, ever: np.ndarray, main: int, dashed: tuple[np.ndarray, np.ndarray] | None
) -> None:
    """Limits that hold the values over 99 % of the length; how far the others go is said."""
    low, high = float(min(ever.min(), 0.0)), float(ever.max())
    few = min(_usual(depth, ever.min(axis=0), 1.0), 0.0), _usual(depth, ever.max(axis=0))
    ends = []
    for usual, end in zip(few, (low, high), strict=True):
        ends.append(usual * 1.2 if abs(end) > 1.8 * abs(usual) + 1e-12 and usual != 0 else end)
    if dashed is not None:
        ends = [min(ends[0], float(dashed[0].min())), max(ends[1], float(dashed[0].max()))]
    room = 0.06 * max(ends[1] - ends[0], 1e-9)
    axes.set_xlim(ends[0] - room, ends[1] + room)
    if ever[main].max() > ends[1] + room:
        k = int(ever[main].argmax())
        low_down = k > len(depth) // 2
        axes.annotate(
            f"up to {style.number(float(ever[main, k]), 2)}\nat {depth[k]:.0f} m", (0.96, depth[k]),
            xycoords=axes.get_yaxis_transform(), xytext=(0, 8 if low_down else -8), textcoords="offset points",
            ha="right", va="bottom" if low_down else "top", fontsize=9.5, color=style.INK, zorder=6,
            bbox={"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1},
        )  # fmt: skip


def steady(story: Story) -> Profile | None:
    """What a soft string says that turns steadily with the same friction; None where that cannot be said."""
    scene: Scene | None = story.scene
    if scene is None or story.model == "soft-string":
        return None
    from drillfem.models.soft_string import line_of
    from drillfem.torque_drag.operation import operations_of
    from drillfem.torque_drag.soft import soft_string

    try:
        operation = operations_of(scene, ["drilling" if story.nominal.weight else "rotating"])[0]
        return soft_string(line_of(scene), operation)
    except (DrillfemError, ValueError):
        return None


def _of_soft(soft: Profile | None, name: str) -> tuple[np.ndarray, np.ndarray] | None:
    """A column's values and depths from a soft string."""
    if soft is None or name not in ("side_force", "axial_force", "torque"):
        return None
    values = {"side_force": soft.side_force, "axial_force": soft.tension, "torque": soft.torque}[name]
    return 1e-3 * values, soft.measured_depth


def _legend(figure: Figure, story: Story, shown: Sequence[int], soft: Profile | None) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=colour, lw=2.4, label=story.clock(float(story.times[i])))
        for i, colour in zip(reversed(shown), TIMES, strict=False)
    ][::-1]
    if soft is not None:
        words = "soft string, steady " + ("drilling" if soft.operation.name == "drilling" else "rotation off bottom")
        handles.append(Line2D([], [], color=style.PURPLE, lw=2.0, ls=(0, (5, 3)), label=words))
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.045, 0.928), ncols=len(handles), fontsize=11)


# -- directors -------------------------------------------------------------------------------------------
def directors_page(story: Story, shown: Sequence[int], path: Path) -> Path:
    """directors.png: the shape at some times, with the directors at places along the string."""
    well = Well(story)
    count = len(shown)
    w = int((1600 - 40) / count)
    h = 960
    with style.page(1600, 1130) as figure:
        style.heading(
            figure,
            f"{story.title}: directors",
            f"{story.model} model   \u00b7   string of {style.number(story.length, 4)} m",
        )
        view = Overview(well, w, h)
        extent, size = view.view.extent, float(np.ptp(view.path, axis=0).max())
        for k, i in enumerate(shown):
            axes = place(figure, 20 + k * w, 104, w, h)
            style.panel(axes)
            axes.axis("off")
            axes.set_xlim(extent[0], extent[1])
            axes.set_ylim(extent[2], extent[3])
            view.set_stage(axes)
            axes.set_title(story.clock(float(story.times[i])), loc="center", fontsize=14)
            page = view.view.project(story.position[i])
            axes.plot(page[:, 0], page[:, 1], color="#c9b393", lw=7, solid_capstyle="round", zorder=2)
            axes.plot(page[:, 0], page[:, 1], color=style.INK, lw=1.4, zorder=3)
            pose = story.pose(i)
            for s in np.linspace(story.arc[0], story.arc[-1], 11):
                at, d1, d3 = (
                    np.array([np.interp(s, story.arc, v[:, c]) for c in range(3)])
                    for v in (pose.position, pose.director1, pose.director3)
                )
                for vector, colour in ((d1, style.VERMILION), (np.cross(d3, d1), style.BLUE), (d3, style.INK)):
                    start, stop = view.view.project(np.stack([at, at + 0.075 * size * vector]))
                    look = {"arrowstyle": "-|>", "color": colour, "lw": 1.8, "shrinkA": 0, "shrinkB": 0}
                    axes.annotate("", tuple(stop), tuple(start), arrowprops=look, zorder=5)
            axes.set_xlim(extent[0], extent[1])
            axes.set_ylim(extent[2], extent[3])
        for k, (words, colour) in enumerate(
            (("$d_1$", style.VERMILION), ("$d_2$", style.BLUE), ("$d_3$, along the string", style.INK))
        ):
            figure.text(0.03 + 0.05 * k, 0.028, words, color=colour, fontsize=14, weight="bold")
        words = f"The well is to scale; directors are drawn {style.number(0.075 * size, 2)} m long."
        figure.text(0.985, 0.030, words, ha="right", fontsize=10.5, color=style.GREY)
        return style.save(figure, path)
