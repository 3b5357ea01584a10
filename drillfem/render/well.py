"""Where the string of a story lies in its curved hole, and what pictures of that have in common: colours and names."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from drillfem.render import style
from drillfem.render.story import SHOWN, Story, attribute
from drillfem.render.straight import Brush, place, radii
from drillfem.render.studio import paint

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from drillfem.boreholes import Borehole

STEEP = math.radians(85)  # an inclination from which a hole counts as level
KICKED = math.radians(3)  # and from which it has left the vertical
CASED, OPEN = np.array([0.70, 0.75, 0.80]), np.array([0.82, 0.72, 0.57])
OFF_WALL = (0.56, 0.62, 0.68)  # of a string that does not touch
TOUCHES = 1.0  # N/m of side force that count as contact
STRIPE = 0.42  # rad, half width of the painted stripe in the picture of the whole


@dataclass(frozen=True)
class Mark:
    """A place on the hole that has a name: measured depth in m."""

    name: str
    depth: float


class Well:
    """Where a story's string lies in its hole."""

    def __init__(self, story: Story) -> None:
        self.story = story
        hole = attribute(story.scene, "borehole")
        assert hole is not None
        self.hole: Borehole = hole
        #: radius (n,) of what touches the wall at the nodes, m
        self.touching = np.interp(story.arc, *self._touching)
        deepest = float(story.at_wall("wall_depth").max())
        #: measured depth (m) to which the hole is drawn: all that was surveyed, else a little further than the string
        self.end = self.hole.length
        if self.hole.kind not in ("survey", "spline"):
            self.end = min(self.end, deepest + 0.01 * story.length)
        self._depth: dict[int, np.ndarray] = {}

    # -- the hole ----------------------------------------------------------------------------------------
    def sides(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Unit vectors (m, 3) across the hole at measured depths p (m,): to its high side, and to its right.

        Right is as seen down the hole with the high side up. Where the hole is vertical its high side is that towards
        which it first builds.
        """
        frame = self.hole.frame(p)
        azimuth = self._azimuth(p)
        i = frame.inclination
        level = np.cos(i)
        high = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), -np.sin(i)], axis=1)
        high -= np.sum(high * frame.tangent, axis=1, keepdims=True) * frame.tangent
        high /= np.maximum(np.linalg.norm(high, axis=1, keepdims=True), 1e-12)
        return high, np.cross(frame.tangent, high)

    def _azimuth(self, p: np.ndarray) -> np.ndarray:
        """Azimuth (m,) of the hole in rad, from the nearest inclined place where it is vertical."""
        at, azimuth = self._inclined
        if not len(at):
            return np.zeros_like(p)
        frame = self.hole.frame(p)
        return np.where(frame.inclination > 0.02, frame.azimuth, azimuth[np.abs(p[:, None] - at).argmin(axis=1)])

    @cached_property
    def _inclined(self) -> tuple[np.ndarray, np.ndarray]:
        p = np.linspace(0, self.end, 800)
        frame = self.hole.frame(p)
        there = frame.inclination > 0.02
        return p[there], frame.azimuth[there]

    @cached_property
    def stretches(self) -> list[tuple[float, float, bool]]:
        """From, to (m) and whether it is cased: a stretch counts as casing if the next one is rougher or narrower."""
        cuts = [float(s.to) for s in attribute(self.story.scene, "hole", "section", default=()) if s.to < self.end]
        table, out = self.hole.table, []
        for a, b in pairwise([0.0, *cuts]):
            above, below = b - 0.5, b + 0.5
            rough = (
                np.interp([above, below], table.friction_at, table.friction[:, 1]) if table.friction.size else (0, 0)
            )
            wide = self.hole.frame(np.array([(a + b) / 2, below])).radius
            out.append((a, b, bool(rough[0] < rough[1] or wide[0] > wide[1])))
        return [*out, (cuts[-1] if cuts else 0.0, self.end, False)]

    @cached_property
    def marks(self) -> list[Mark]:
        """Kick-off, shoes, sharpest bend, where the hole becomes level: from the top down."""
        found = [Mark("shoe" if cased else "change of wall", b) for _, b, cased in self.stretches[:-1]]
        p = np.linspace(0, self.end, 4001)
        frame = self.hole.frame(p)
        kick = attribute(self.story.scene, "hole", "kick_off")
        bent = np.flatnonzero(frame.inclination > KICKED)
        if kick is None and len(bent) and frame.inclination[0] < KICKED:
            kick = float(p[bent[0]])
        if kick:
            found.append(Mark("kick-off", float(kick)))
        level = np.flatnonzero(frame.inclination > STEEP)
        if len(level) and level[0] > 0:
            found.append(Mark("horizontal", float(p[level[0]])))
        bend = frame.dogleg_severity
        if bend.max() > 1e-6 and np.ptp(bend[bend > 0.05 * bend.max()]) > 0.05 * bend.max():  # not that of an arc
            found.append(Mark("sharpest bend", float(p[int(bend.argmax())])))
        return sorted(found, key=lambda m: m.depth)

    # -- the string in it --------------------------------------------------------------------------------
    def depth(self, index: int) -> np.ndarray:
        """Measured depth (n,) of the nodes at a saved time, m."""
        if index not in self._depth:
            at, p = self.story.at_wall("wall_arc_length")[index], self.story.at_wall("wall_depth")[index]
            self._depth[index] = np.interp(self.story.arc, at, p) + self._beyond(at, p)
        return self._depth[index]

    def _beyond(self, at: np.ndarray, p: np.ndarray) -> np.ndarray:
        """What nodes above the first and below the last wall point are further on, m."""
        s = self.story.arc
        return np.where(s < at[0], s - at[0], np.where(s > at[-1], s - at[-1], 0.0))

    def offset(self, index: int) -> np.ndarray:
        """Where the string is across the hole (n, 2), m: to its right and to its high side."""
        p = self.depth(index)
        away = self.story.position[index] - self.hole.frame(p).position
        high, right = self.sides(p)
        return np.stack([np.sum(away * right, axis=1), np.sum(away * high, axis=1)], axis=1)

    def clearance(self, index: int) -> np.ndarray:
        """How far the string can move from the axis of its hole (n,), m."""
        return np.asarray(self.hole.frame(self.depth(index)).radius - self.touching)

    def room(self, index: int) -> tuple[np.ndarray, np.ndarray]:
        """Measured depths (m,) and the clearance there (m,), both in m, with its steps at the joints of the string."""
        s, radius = self._touching
        fine = np.sort(np.concatenate([s, np.linspace(s[0], s[-1], 1500)]))
        p = np.interp(fine, self.story.arc, self.depth(index))
        return p, np.asarray(self.hole.frame(p).radius - np.interp(fine, s, radius))

    @cached_property
    def _touching(self) -> tuple[np.ndarray, np.ndarray]:
        """Arc lengths of the ends of all sections, those of joints a micrometre apart, and what touches there (m)."""
        s: list[float] = []
        radius: list[float] = []
        for part, section in zip(self.story.parts, attribute(self.story.scene, "string", default=()), strict=False):
            wide = attribute(section, "contact_diameter") or part.outer or 2 * radii(self.story)
            s += [part.top + 1e-6, part.bottom]
            radius += 2 * [wide / 2]
        return np.array(s), np.array(radius)

    def side_force(self, index: int) -> np.ndarray:
        """Side force at the nodes (n,), N/m."""
        return self.story.values("side_force")[index]


class WellBrush(Brush):
    """Colours of a string in a well: the side force from nought up, off the wall in grey; else as any field."""

    def __init__(self, story: Story, field: str | None, stripe: float = 0.0) -> None:
        super().__init__(story, field, stripe)
        if field != "side_force":
            return
        import matplotlib
        from matplotlib.colors import ListedColormap, Normalize

        force = story.values(field)
        touching = force[force > TOUCHES]
        high = float(np.percentile(touching, 98)) if touching.size else 1.0
        warm = matplotlib.colormaps["YlOrRd"](np.linspace(0.16, 1.0, 255))
        self.cmap = ListedColormap(np.vstack([[*OFF_WALL, 1.0], warm]))
        self.norm = Normalize(0.0, _round_up(high), clip=True)

    @property
    def shown(self) -> tuple[float, str]:
        """Shown per saved unit, and what the colour means with the unit shown."""
        return SHOWN.get(self.field or "", (1.0, self.story.label(self.field) if self.field else ""))

    def wide(self, index: int, rows: int = 2048) -> np.ndarray:
        """Texture of the whole string with a broad stripe."""
        values = np.interp(np.linspace(self.story.arc[0], self.story.arc[-1], rows), self.story.arc, self.nodes(index))
        if self.field is None:
            return paint(np.broadcast_to(OFF_WALL, (rows, 3)), half=STRIPE, edge=0.07)
        return paint(self.cmap(self.norm(values))[:, :3], half=STRIPE, edge=0.07)


def _round_up(value: float) -> float:
    """The next 1, 1.5, 2, 3, 4, 5, 6, 8 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(max(value, 1e-12)))
    return float(power * next(f for f in (1, 1.5, 2, 3, 4, 5, 6, 8, 10) if f * power >= value * (1 - 1e-9)))


def colour_bar(figure: Figure, brush: WellBrush, where: tuple[float, float, float, float], brief: bool = False) -> None:
    """The brush's scale; what grey means and how far values go beyond it, unless in brief."""
    if brush.field is None:
        return
    bar = place(figure, *where)
    factor, words = brush.shown
    low, high = (float(v or 0.0) * factor for v in (brush.norm.vmin, brush.norm.vmax))
    tones = brush.cmap(np.linspace(0, 1, 256))[:: 1 if low <= high else -1]
    bar.imshow(tones[None], extent=(min(low, high), max(low, high), 0, 1), aspect="auto")
    bar.set_yticks([])
    bar.grid(False)
    for spine in bar.spines.values():
        spine.set_visible(False)
    greatest = float(brush.story.values(brush.field).max()) * factor
    if brush.field == "side_force" and not brief:
        words += "; blue-grey: off the wall"
        if greatest > high:
            words += f"; up to {style.number(greatest, 2)}"
    bar.set_xlabel(words, fontsize=10.5, labelpad=1)


def name_places(
    axes: Axes, places: Sequence[tuple[str, np.ndarray, np.ndarray]], clear_of: Sequence[np.ndarray] = ()
) -> None:
    """Write names beside a line, each on the side and as far away as there is room.

    places: name, point on the line (2,) and one a little further along it (2,). clear_of: points to keep clear of.
    """
    data = axes.transData
    taken: list[np.ndarray] = []
    busy = [data.transform(point) for point in clear_of]
    frame = axes.get_window_extent()
    for name, point, further in places:
        at = data.transform(point)
        way = data.transform(further) - at
        way = way / max(float(np.linalg.norm(way)), 1e-9)
        out = np.array([way[1], -way[0]])
        out = out if out[0] >= 0 else -out
        wide = 4 + 7.2 * max(map(len, name.split("\n")))
        for far, side in ((f, s) for f in (46, 92, 138) for s in (out, -out)):
            tip = at + far * side
            # the corners of the words, which stand away from the line
            lean = 0.5 * (np.sign(side[0]) if abs(side[0]) > 0.3 else 0.0)
            rise = 0.5 * np.sign(side[1]) if abs(side[1]) > 0.75 else 0.0
            middle = tip + [lean * wide, rise * 34]
            inside = abs(middle - np.mean(frame.get_points(), axis=0)) < np.array(frame.size) / 2 - [wide / 2, 17]
            free = all(abs(middle[0] - m[0]) > (wide + m[2]) / 2 or abs(middle[1] - m[1]) > 36 for m in taken)
            if inside.all() and free and all(np.linalg.norm(tip - spot) > 40 for spot in busy):
                break
        taken.append(np.array([*middle, wide]))
        start, stop = (data.inverted().transform(spot) for spot in (at + 5 * side, tip - 2 * side))
        axes.plot([start[0], stop[0]], [start[1], stop[1]], color=style.INK, lw=1.0, zorder=6)
        axes.annotate(
            name,
            (float(point[0]), float(point[1])),
            xytext=(float(tip[0] - at[0]), float(tip[1] - at[1])),
            textcoords="offset pixels",
            ha=("right", "center", "left")[int(2 * lean) + 1],
            va=("top", "center", "bottom")[int(2 * rise) + 1],
            fontsize=10.5,
            linespacing=1.1,
            zorder=8,
            bbox={"facecolor": "white", "alpha": 0.85, "edgecolor": "none", "pad": 1.5},
        )
