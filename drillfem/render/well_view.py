"""The well in space with the string in it, and sections across the hole, from near.

A well is kilometres long and its hole a hand wide: in the picture of the whole, hole and string are drawn much too
thick, and where the string lies in the hole is drawn as the share of the clearance. Sections across are to scale.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from drillfem.render import style
from drillfem.render.poses import View
from drillfem.render.story import Pose, Story
from drillfem.render.straight import place, radii, subtitle
from drillfem.render.studio import Studio, Thing, surface, tube
from drillfem.render.well import CASED, OFF_WALL, OPEN, TOUCHES, Well, WellBrush, colour_bar, name_places

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Block:
    """The block of rock around a well: its least and greatest coordinates north, east, down (3,), and round ones
    within, m."""

    low: np.ndarray
    high: np.ndarray
    ticks: tuple[np.ndarray, ...]

    def corners(self) -> np.ndarray:
        """(8, 3), m."""
        return np.array([[(self.low, self.high)[i >> k & 1][k] for k in range(3)] for i in range(8)])


def block_of(path: np.ndarray) -> Block:
    """Block around the points of a hole (m, 3), not too thin to be seen as one."""
    from matplotlib.ticker import MaxNLocator

    low, high = path.min(axis=0), path.max(axis=0)
    size = float((high - low).max())
    room = np.maximum(0.04 * size, 0.5 * (0.2 * size - (high - low)))
    room[2] = 0.0
    low, high = low - room, high + room
    high[2] += 0.06 * size
    ticks = []
    for a, b in zip(low, high, strict=True):
        locator = MaxNLocator(max(2, round(7 * (b - a) / size)), steps=[1, 2, 2.5, 5, 10])
        found = np.asarray(locator.tick_values(a, b))
        ticks.append(found[(found >= a - 1e-6) & (found <= b + 1e-6)])
    return Block(low, high, tuple(ticks))


def look_at(block: Block, path: np.ndarray, width: int, height: int, edges: tuple[float, float, float, float]) -> View:
    """View of a block from somewhat above, from where the well is seen best. edges: kept free left, right, at the
    bottom and top, as shares of the page."""
    down, rise = np.array([0.0, 0.0, 1.0]), math.radians(20)
    left, other, under, above = edges
    share = np.array([1 - left - other, 1 - under - above]) * [width, height]
    best: tuple[float, View] | None = None
    for turn in np.radians(np.arange(0, 360, 5)):
        level = np.array([math.cos(turn), math.sin(turn), 0.0])
        if np.abs(level[:2]).min() < 0.25:  # a side of the block would be seen edge on
            continue
        near = math.cos(rise) * level - math.sin(rise) * down
        right = np.cross(-down, level)
        up = np.cross(near, right)
        page, way = (np.stack([points @ right, points @ up], axis=1) for points in (block.corners(), path))
        low, high = page.min(axis=0), page.max(axis=0)
        scale = float(((high - low) / share).max())
        # seen best: large, wide, and running away from the viewer rather than towards him
        ahead = float((path[-1] - path[0]) @ right) / max(float(np.linalg.norm(path[-1] - path[0])), 1e-9)
        score = float(np.prod(np.ptp(way, axis=0) / scale + 0.1 * share)) * (1 + 0.05 * np.sign(ahead))
        if best is None or score > best[0]:
            half = scale * np.array([width, height]) / 2
            middle = (low + high) / 2 + half * [other - left, above - under]
            centre = middle[0] * right + middle[1] * up + float((path @ near).mean()) * near
            best = score, View(right, up, near, False, centre, (float(half[0]), float(half[1])))
    assert best is not None
    return best[1]


def gutter(path: np.ndarray, tangent: np.ndarray, radius: np.ndarray, near: np.ndarray, colour: np.ndarray) -> Thing:
    """The far half of a hole's wall around points (m, 3), its inside to the viewer."""
    side = near - np.sum(near * tangent, axis=1, keepdims=True) * tangent
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-9)
    other = np.cross(tangent, side)
    angle = np.linspace(math.pi / 2, 3 * math.pi / 2, 33)
    ring = np.cos(angle)[None, :, None] * side[:, None, :] + np.sin(angle)[None, :, None] * other[:, None, :]
    mesh = surface(path[:, None, :] + radius[:, None, None] * ring, -ring, False)
    return Thing(mesh, tuple(colour), specular=0.0, ambient=0.42, diffuse=0.62)


class Overview:
    """The well in space on a page: what stays the same from pose to pose."""

    HOLE, STRING = 26.0, 13.0  # pixels across

    def __init__(self, well: Well, width: int, height: int, thin: float = 1.0) -> None:
        self.well, self.size = well, (width, height)
        frame = well.hole.frame(np.linspace(0.0, well.end, 1200))
        self.path = frame.position
        self.block = block_of(self.path)
        edges = (86 / width, 70 / width, 78 / height, 40 / height)
        self.view = look_at(self.block, self.path, width, height, edges)
        pixel = 2 * self.view.half[1] / height
        self.hole, self.string = self.HOLE * thin * pixel / 2, self.STRING * thin * pixel / 2
        self.walls = [self._wall(a, b, cased) for a, b, cased in well.stretches]

    def _wall(self, a: float, b: float, cased: bool) -> Thing:
        p: np.ndarray = np.linspace(a, b, max(2, round(1200 * (b - a) / self.well.end)))
        frame = self.well.hole.frame(p)
        wide = np.full(len(p), self.hole * (0.92 if cased else 1.0))
        return gutter(frame.position, frame.tangent, wide, self.view.near, CASED if cased else OPEN)

    def things(self, index: int, brush: WellBrush) -> list[Thing]:
        """Hole and string at a saved time."""
        well, story = self.well, self.well.story
        pose: Pose = story.pose(index)
        p = well.depth(index)
        frame, (high, right) = well.hole.frame(p), well.sides(p)
        share = well.offset(index) / np.maximum(well.clearance(index), 1e-9)[:, None]
        size = np.linalg.norm(share, axis=1, keepdims=True)
        share = share / np.maximum(size, 1.0)  # a wall that gives way is drawn as one that does not
        at = frame.position + (self.hole * 0.92 - self.string) * (share[:, :1] * right + share[:, 1:] * high)
        d1 = pose.director1 - np.sum(pose.director1 * frame.tangent, axis=1, keepdims=True) * frame.tangent
        d1 /= np.maximum(np.linalg.norm(d1, axis=1, keepdims=True), 1e-12)
        v = (story.arc - story.arc[0]) / story.length
        meshes = tube(at, d1, frame.tangent, np.full(len(at), self.string), v)
        texture = brush.wide(index)
        return [*self.walls, *(Thing(m, texture=texture, ambient=0.38, diffuse=0.78) for m in meshes)]

    def set_stage(self, axes: Axes) -> None:
        """Floor, two back walls with scales, the shadow of the well on the floor, and its marks."""
        block, view = self.block, self.view
        low, high = block.low, block.high
        floor = high[2]
        back = [low[k] if view.near[k] > 0 else high[k] for k in range(2)]
        front = [high[k] if view.near[k] > 0 else low[k] for k in range(2)]

        def draw(a: Sequence[float], b: Sequence[float], **how: Any) -> None:
            ends = view.project(np.array([a, b], dtype=float))
            axes.plot(ends[:, 0], ends[:, 1], **{"color": style.FAINT, "lw": 0.9, "zorder": 1, **how})

        behind = [*back, floor]
        for k, tone in enumerate(("#f6f7f8", "#f3f4f6", "#eceef1")):
            i, j = (n for n in range(3) if n != k)
            face = np.full((4, 3), behind[k])
            face[:, i], face[:, j] = [low[i], high[i], high[i], low[i]], [low[j], low[j], high[j], high[j]]
            corners = view.project(face)
            axes.fill(corners[:, 0], corners[:, 1], color=tone, lw=0, zorder=0)
        for x in block.ticks[0]:
            draw((x, low[1], floor), (x, high[1], floor))
            draw((x, back[1], low[2]), (x, back[1], floor))
        for y in block.ticks[1]:
            draw((low[0], y, floor), (high[0], y, floor))
            draw((back[0], y, low[2]), (back[0], y, floor))
        for z in block.ticks[2]:
            draw((back[0], low[1], z), (back[0], high[1], z))
            draw((low[0], back[1], z), (high[0], back[1], z))
        shadow = view.project(np.column_stack([self.path[:, :2], np.full(len(self.path), floor)]))
        axes.plot(shadow[:, 0], shadow[:, 1], color="#c3c8ce", lw=4, zorder=1.5, solid_capstyle="round")
        self._scales(axes, front, back, floor)

    def _scales(self, axes: Axes, front: list[float], back: list[float], floor: float) -> None:
        view, block = self.view, self.block
        unit = 2 * view.half[1] / self.size[1]  # m per pixel

        def write(point: Sequence[float], text: str, out: np.ndarray, far: float, **how: Any) -> None:
            x, y = view.project(np.array(point, dtype=float)) + far * unit * out
            axes.text(float(x), float(y), text, **{"ha": "center", "va": "center", "fontsize": 10, **how})

        centre = view.project((block.low + block.high) / 2)
        for k, name in ((0, "north"), (1, "east")):
            fixed = front[1 - k]
            spots = []
            apart = float(np.linalg.norm(view.project(np.eye(3)[k])) * np.diff(block.ticks[k][:2]).sum()) / unit
            values = block.ticks[k][:: max(1, math.ceil(52 / max(apart, 1e-9)))]
            for value in values:
                spot = [0.0, 0.0, floor]
                spot[k], spot[1 - k] = float(value), fixed
                spots.append(spot)
            edge = view.project(np.array([spots[0], [*(s + (j == k) for j, s in enumerate(spots[0]))]]))
            slope = edge[-1] - edge[0]
            out = np.array([slope[1], -slope[0]]) / max(float(np.linalg.norm(slope)), 1e-9)
            out = -out if out @ (edge.mean(axis=0) - centre) < 0 else out
            beside = {"ha": "left" if out[0] > 0.35 else "right" if out[0] < -0.35 else "center"}
            for spot, value in zip(spots, values, strict=True):
                write(spot, style.number(float(value), 4), out, 15, **beside)
            middle = [0.0, 0.0, floor]
            middle[k], middle[1 - k] = float(block.low[k] + block.high[k]) / 2, fixed
            write(middle, f"{name} (m)", out, 42 if beside["ha"] == "center" else 58, fontsize=11, **beside)
        # depth along the upright edge that is furthest left
        uprights = [[x, y] for x in (block.low[0], block.high[0]) for y in (block.low[1], block.high[1])]
        x, y = min(uprights, key=lambda e: float(view.project(np.array([*e, 0.0]))[0]))
        for z in block.ticks[2]:
            write((x, y, z), style.number(float(z), 5), np.array([-1.0, 0.0]), 8, ha="right")
        middle = [x, y, float(block.low[2] + block.high[2]) / 2]
        write(middle, "depth (m)", np.array([-1.0, 0.0]), 62, rotation=90, fontsize=11)


# -- sections across the hole ----------------------------------------------------------------------------
class Dial:
    """A section across the hole, to scale, seen down the hole with its high side up: string, stripe, force, spin."""

    def __init__(self, axes: Axes, well: Well, arc: float, brush: WellBrush, index: int, heads: float = 1.0) -> None:
        """heads: size of the arrows' heads."""
        from matplotlib.patches import Circle, FancyArrowPatch, Wedge

        self.well, self.arc, self.brush = well, arc, brush
        story = well.story
        p = float(np.interp(arc, story.arc, well.depth(index)))
        hole = 1e3 * float(well.hole.frame(np.array([p])).radius[0])
        cased = next((c for a, b, c in well.stretches if a <= p <= b), False)
        outer = 500 * float(story.diameter_at(np.array([arc]))[0]) or 1e3 * radii(story)
        part = next((q for q in story.parts if q.top - 1e-9 <= arc <= q.bottom + 1e-9), story.parts[-1])
        touching = 1e3 * float(np.interp(arc, story.arc, well.touching))
        axes.set_aspect("equal")
        style.panel(axes)
        reach = 1.22 * hole
        axes.set_xlim(-reach, reach)
        axes.set_ylim(-reach, reach)
        axes.set_facecolor(tuple(OPEN))
        for spine in axes.spines.values():
            spine.set_visible(False)
        if cased:
            axes.add_patch(Wedge((0, 0), 1.10 * hole, 0, 360, width=0.10 * hole, color=CASED * 0.8, lw=0))
        axes.add_patch(Circle((0, 0), hole, facecolor="#fbfbf9", edgecolor=style.INK, lw=1.2))
        axes.plot([0], [0], "+", color=style.GREY, ms=7, mew=0.9)
        self.hole, self.outer, self.touching = hole, outer, touching
        self.moving: list[Any] = []

        def add(patch: Any) -> Any:
            axes.add_patch(patch)
            self.moving.append(patch)
            return patch

        rim: dict[str, Any] = {"fill": False, "ls": (0, (4, 2)), "lw": 1.1, "ec": style.INK}
        self.joint = add(Circle((0, 0), touching, **rim)) if touching > 1.01 * outer else None
        self.body = add(Circle((0, 0), outer, facecolor=OFF_WALL, edgecolor=style.INK, lw=1.2))
        bore = 500 * part.inner or 0.55 * outer
        self.bore = add(Circle((0, 0), bore, facecolor="#fbfbf9", edgecolor=style.INK, lw=0.8))
        self.stripe = add(Wedge((0, 0), outer, 0, 1, width=outer - bore, facecolor="white", ec=style.INK))
        arrow: dict[str, Any] = {"arrowstyle": "-|>", "mutation_scale": 14 * heads, "lw": 2.1, "zorder": 5}
        self.force = add(FancyArrowPatch((0, 0), (0, 0), color="#8c1414", **arrow))
        self.turn = add(FancyArrowPatch((0, 0), (0, 0), color=style.BLUE, **arrow))
        self.show(index)

    def show(self, index: int) -> None:
        """Draw a saved time."""
        well, story, pose = self.well, self.well.story, self.well.story.pose(index)
        at = np.array([float(np.interp(self.arc, story.arc, x)) for x in well.offset(index).T])
        p = np.array([float(np.interp(self.arc, story.arc, well.depth(index)))])
        high, right = (v[0] for v in well.sides(p))
        d1 = np.array([np.interp(self.arc, story.arc, pose.director1[:, k]) for k in range(3)])
        force = float(np.interp(self.arc, story.arc, well.side_force(index)))
        centre = 1e3 * at
        for patch in (self.body, self.bore, *([self.joint] if self.joint else [])):
            patch.center = tuple(centre)
        values = np.interp(self.arc, story.arc, self.brush.nodes(index))
        self.body.set_facecolor(self.brush.cmap(self.brush.norm(values)) if self.brush.field else OFF_WALL)
        angle = math.degrees(math.atan2(d1 @ high, d1 @ right))
        self.stripe.set_center(tuple(centre))
        self.stripe.set_theta1(angle - 14)
        self.stripe.set_theta2(angle + 14)
        away = float(np.linalg.norm(centre))
        self.force.set_visible(force > TOUCHES and away > 1e-6)
        if self.force.get_visible():
            out = centre / away
            touch = centre + self.touching * out
            top = float(self.brush.norm.vmax or 1.0) if self.brush.field == "side_force" else force
            length = self.hole * (0.25 + 0.55 * min(1.0, force / top))
            self.force.set_positions(tuple(touch + 0.18 * self.hole * out), tuple(touch - length * out))
        spin = self.spin(index)
        self.turn.set_visible(abs(spin) > 0.05)
        if self.turn.get_visible():
            # clockwise as seen down the hole is positive
            sweep = math.copysign(min(1.9, 0.35 + 0.12 * abs(spin)), spin)
            bore = float(self.bore.radius)
            r = 0.66 * bore if bore > 0.6 * self.outer else 0.5 * (bore + self.outer)
            a, b = math.pi / 2 + sweep / 2, math.pi / 2 - sweep / 2
            ends = [tuple(centre + r * np.array([math.cos(t), math.sin(t)])) for t in (a, b)]
            self.turn.set_positions(*ends)
            self.turn.set_connectionstyle("arc3", rad=-math.tan(sweep / 4))

    def spin(self, index: int) -> float:
        """Spin of the string there, rad/s."""
        story = self.well.story
        if "spin" not in story.colour_fields:
            return 0.0
        return float(np.interp(self.arc, story.arc, story.values("spin")[index]))


def dial_places(well: Well, index: int, count: int) -> list[tuple[str, float]]:
    """Names and arc lengths of sections worth seeing, from the top down."""
    story = well.story
    s, length = story.arc, story.length
    p, force = well.depth(index), well.side_force(index)
    bend = well.hole.frame(p).dogleg_severity
    inner = (s > s[0] + 0.02 * length) & (s < s[-1] - 0.02 * length)
    wish = [("Lower end", float(s[-1]))]
    if force.max() > TOUCHES:
        wish.append(("Strongest on the wall", float(s[int(np.where(inner, force, -1).argmax())])))
    if bend[inner].max(initial=0.0) > 1e-6:
        wish.append(("Sharpest bend", float(s[int(np.where(inner, bend, -1).argmax())])))
    for mark in well.marks:
        if mark.name in ("shoe", "horizontal"):
            wish.append(("Below the shoe" if mark.name == "shoe" else "Horizontal", mark.depth + 0.02 * length))
    shares = {"Half way": 0.5, "At a quarter": 0.25, "At three quarters": 0.75, "Near the top": 0.1}
    wish += [(name, float(s[0] + share * length)) for name, share in shares.items()]
    kept: list[tuple[str, float]] = []
    for name, at in wish:
        if len(kept) < count and at <= s[-1] + 1e-9 and all(abs(at - other) > 0.04 * length for _, other in kept):
            kept.append((name, at))
    return sorted(kept, key=lambda w: w[1])


def facts_at(well: Well, index: int, arc: float) -> list[str]:
    """What is measured at a section of the string, in words."""
    story = well.story

    def here(values: np.ndarray) -> float:
        return float(np.interp(arc, story.arc, values))

    p = here(well.depth(index))
    frame = well.hole.frame(np.array([p]))
    bend = math.degrees(float(frame.dogleg_severity[0])) * 30
    lines = [
        f"{p:.0f} m, inclined {math.degrees(float(frame.inclination[0])):.0f}\u00b0",
        f"bend {_plain(bend, 0.01)}\u00b0 per 30 m",
        f"side force {_plain(1e-3 * here(well.side_force(index)), 0.001)} kN/m",
    ]
    for name, words, factor, unit, least in (
        ("spin", "spin", 30 / math.pi, "rpm", 0.1),
        ("axial_force", "tension", 1e-3, "kN", 0.1),
        ("torque", "torque", -1e-3, "kN m", 0.01),
    ):
        if name in story.colour_fields:
            lines.append(f"{words} {_plain(factor * here(story.values(name)[index]), least)} {unit}")
    return lines


def _plain(value: float, least: float) -> str:
    """Three digits of a value, but none finer than the least that counts."""
    value = round(value / least) * least
    return style.number(value, 3) if value else "0"


def well_page(studio: Studio, story: Story, field: str | None, index: int, path: Path) -> Path:
    """string.png: the well in space with the string in it, coloured by its field, and sections across, to scale."""
    well, brush = Well(story), WellBrush(story, field)
    x, y, w, h = 24, 104, 1046, 1000
    view = Overview(well, w, h)
    with style.page(1600, 1200) as figure:
        style.heading(figure, story.title, subtitle(story, float(story.times[index])))
        axes = place(figure, x, y, w, h)
        extent = view.view.extent
        style.panel(axes)
        axes.axis("off")
        axes.set_xlim(extent[0], extent[1])
        axes.set_ylim(extent[2], extent[3])
        view.set_stage(axes)
        axes.imshow(studio.shoot(view.things(index, brush), view.view.camera(), w, h), extent=extent, zorder=3)
        axes.set_xlim(extent[0], extent[1])
        axes.set_ylim(extent[2], extent[3])
        letters = sections(figure, well, view, axes, brush, index)
        marks = [*((m.name, m.depth) for m in well.marks if m.name != "sharpest bend")]
        names = []
        for name, depth in [*marks, ("string ends", float(well.depth(index)[-1]))]:
            frame = well.hole.frame(np.array([depth]))
            at = view.view.project(frame.position[0])
            names.append((f"{name}\n{depth:.0f} m", at, at + view.view.project(frame.tangent[0])))
        name_places(axes, names, letters)
        colour_bar(figure, brush, (84, 1122, 380, 15))
        pixel = 2 * view.view.half[1] / h
        wide = 2e3 * float(well.hole.frame(np.array([0.5 * well.end])).radius[0])
        times = 2e3 * view.hole / wide
        cased = any(c for _, _, c in well.stretches)
        aside = np.abs(well.offset(index)).max() > 1e-9
        on_axis = "" if aside else "This model's string lies on the axis of its hole. "
        walls = "Wall: grey cased, brown open. " if cased else ""
        figure.text(
            0.345,
            1 - 1136 / 1200,
            f"Left: the path to scale, {style.number(pixel, 2)} m per pixel; thickness \u00d7{style.number(times, 2)}, "
            "and the string's place in the hole as its share of the clearance.\n"
            f"{on_axis}{walls}White stripe: the director $d_1$. "
            "Right: sections to scale, seen down the hole with its high side up;\n"
            "red: force of the wall; blue: turning; dashed: what touches the wall (tool joints, stabilisers).",
            fontsize=10,
            color=style.GREY,
            va="center",
            linespacing=1.35,
        )
        return style.save(figure, path)


def sections(figure: Figure, well: Well, view: Overview, whole: Axes, brush: WellBrush, index: int) -> list[np.ndarray]:
    """Dials at the right of the page, with letters at their places on the well: where these are on the page (2,), m."""
    letters = []
    places = dial_places(well, index, 4)
    side, gap, top = 212, 40, 122
    for k, (name, arc) in enumerate(places):
        y = top + k * (side + gap)
        axes = place(figure, 1112, y, side, side)
        Dial(axes, well, arc, brush, index)
        axes.set_title(f"{'ABCD'[k]}  {name}", fontsize=12)
        for i, line in enumerate(facts_at(well, index, arc)):
            figure.text(1342 / 1600, 1 - (y + 14 + 31 * i) / 1200, line, fontsize=11.5, va="center")
        p = np.array([float(np.interp(arc, well.story.arc, well.depth(index)))])
        frame = well.hole.frame(p)
        at, way = view.view.project(frame.position[0]), view.view.project(frame.tangent[0])
        out = np.array([-way[1], way[0]]) / max(float(np.linalg.norm(way)), 1e-9)
        unit = 2 * view.view.half[1] / view.size[1]
        out = -out if (out[0], out[1]) > (0, 0) else out
        spot = at + 30 * unit * out
        whole.text(
            float(spot[0]), float(spot[1]), "ABCD"[k],
            fontsize=10.5, weight="bold", ha="center", va="center", zorder=8, color=style.VERMILION,
            bbox={"boxstyle": "circle,pad=0.25", "facecolor": "white", "edgecolor": style.VERMILION, "lw": 1.1},
        )  # fmt: skip
        letters.append(spot)
    return letters
