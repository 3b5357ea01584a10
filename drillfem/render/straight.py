"""Pictures of a string in a straight hole: stretched so that a 1200 m hair can be read, and true to scale."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from drillfem.render import style
from drillfem.render.story import Pose, Story
from drillfem.render.studio import (
    ARROW,
    DARK_STEEL,
    STEEL,
    Camera,
    Studio,
    Thing,
    box,
    drill_bit,
    hole_shell,
    lathe,
    paint,
    resample,
    rock_around,
    rock_drum,
    strata,
    tube,
    turning_arrow,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap, Normalize
    from matplotlib.figure import Figure

COLOURS = "viridis"
LOOK_AHEAD = 0.2  # s: the arrows show the turn in this time
UNKNOWN_SLENDERNESS = 120.0  # a rod without a diameter is drawn this slender


class Brush:
    """A field's colour scale, the same at all times, so that two pictures of one run compare."""

    def __init__(self, story: Story, field: str | None, stripe: float = 0.0) -> None:
        import matplotlib
        from matplotlib.colors import Normalize

        self.story, self.field, self.stripe = story, field, stripe
        low, high = style.band(story.values(field)) if field else (0.0, 1.0)
        self.norm: Normalize = Normalize(low, high, clip=True)
        self.cmap: Colormap = matplotlib.colormaps[COLOURS]

    def nodes(self, index: int) -> np.ndarray:
        """The field at the nodes at a saved time; zeros if there is no field."""
        return self.story.values(self.field)[index] if self.field else np.zeros_like(self.story.arc)

    def texture(self, index: int, top: float, bottom: float, rows: int = 512) -> np.ndarray:
        """Texture of the string between two arc lengths."""
        arc = np.linspace(top, bottom, rows)
        if self.field is None:
            return paint(np.broadcast_to([0.45, 0.55, 0.68], (rows, 3)), centre=self.stripe)
        values = np.interp(arc, self.story.arc, self.nodes(index))
        return paint(self.cmap(self.norm(values))[:, :3], centre=self.stripe)


def radii(story: Story) -> float:
    """The string's greatest outer radius, m, or one that can be drawn if the scene gives none."""
    greatest = max(part.outer for part in story.parts) / 2
    return greatest if greatest > 0 else story.length / UNKNOWN_SLENDERNESS


def stations(story: Story, top: float, bottom: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Arc lengths of rings between two ends, doubled at changes of section, and the outer radii there (m)."""
    default = radii(story)
    arcs, widths = [], []
    for part in story.parts:
        a, b = max(part.top, top), min(part.bottom, bottom)
        if b - a <= 1e-12 * max(1.0, bottom):
            continue
        n = max(2, round(count * (b - a) / (bottom - top)))
        arcs.append(np.linspace(a, b, n))
        widths.append(np.full(n, part.outer / 2 if part.outer > 0 else default))
    return np.concatenate(arcs), np.concatenate(widths)


def close_up(
    story: Story, brush: Brush, index: int, pose: Pose, top: float, bottom: float, datum: float
) -> list[Thing]:
    """The string between two arc lengths at its true shape (m), with z = 0 at depth `datum`."""
    arc, radius = stations(story, top, bottom, 60)
    position, d1, d3 = resample(pose, arc)
    position = position - np.array([0.0, 0.0, datum])
    texture = brush.texture(index, top, bottom)
    return [Thing(m, texture=texture) for m in tube(position, d1, d3, radius, (arc - top) / (bottom - top))]


def azimuth(pose: Pose, arc: float) -> float:
    """Angle of d1 about e3 at an arc length, rad."""
    _, d1, _ = resample(pose, np.array([arc]))
    return math.atan2(float(d1[0, 1]), float(d1[0, 0]))


def angle_along(pose: Pose) -> np.ndarray:
    """Angle of d1 about e3 relative to the top, rad (n,), continuous along the string."""
    angle = np.unwrap(np.arctan2(pose.director1[:, 1], pose.director1[:, 0]))
    return np.asarray(angle - angle[0])


def arrow_at(spin: float | None, radius: float, z: float, thick: float) -> list[Thing]:
    """The arrow of the turn in LOOK_AHEAD seconds, its middle to the viewer; none if the string stands."""
    if spin is None or abs(spin) * LOOK_AHEAD < 0.06:
        return []
    turn = math.copysign(min(abs(spin) * LOOK_AHEAD, 1.9 * math.pi), spin)
    return [Thing(turning_arrow(radius, z, math.pi / 2 - turn / 2, turn, thick), ARROW, specular=0.1)]


# -- the stretched picture -------------------------------------------------------------------------------
def stretched_view(
    studio: Studio,
    story: Story,
    brush: Brush,
    index: int,
    width: int,
    height: int,
    low: float,
    high: float,
    half: float,
) -> np.ndarray:
    """The whole string, depths low..high (m), -half..half (m) across: RGBA of width x height pixels."""
    pose = story.pose(index)
    scale = (2 * half) * height / width / (high - low)  # m of the picture per m of depth: pixels stay square
    with_bit = story.drilling and story.bit_radius > 0
    first, last = float(story.arc[0]), float(story.arc[-1])
    # the bit is drawn as large across as it is, so it takes the place of a piece of the squeezed string
    end = last - 1.3 * story.bit_radius / scale if with_bit else last
    arc, radius = stations(story, first, max(end, 0.5 * (first + last)), 400)
    position, d1, d3 = resample(pose, arc)
    position = position * np.array([1.0, 1.0, scale])
    v = (arc - arc[0]) / (arc[-1] - arc[0])
    texture = brush.texture(index, float(arc[0]), float(arc[-1]), 1024)
    things = [Thing(m, texture=texture) for m in tube(position, d1, d3, radius, v)]
    top, wide = position[0], float(radius.max())
    if with_bit:
        bit = drill_bit(story.bit_radius, story.blades, azimuth(pose, last))
        for thing in bit:
            thing.mesh.translate(pose.position[-1] * np.array([1.0, 1.0, scale]), inplace=True)
        things += bit
    motor = [
        (0.0, -3.4 * wide),
        (2.1 * wide, -3.4 * wide),
        (2.3 * wide, -3.2 * wide),
        (2.3 * wide, -1.2 * wide),
        (1.5 * wide, -0.7 * wide),
        (1.5 * wide, 0.0),
        (0.0, 0.0),
    ]
    head = lathe(motor)
    head.translate(top, inplace=True)
    things.append(Thing(head, DARK_STEEL, specular=0.4))
    middle = (low + high) / 2 * scale
    camera = Camera((0.0, 10.0, middle), (0.0, 0.0, middle), half_height=(high - low) / 2 * scale)
    return studio.shoot(things, camera, width, height)


def ground(axes: Axes, half: float, hole: float, surface: float, bottom: float, low: float, high: float) -> None:
    """Rock left and right of the hole and under it, the sky above: the set behind the string."""
    layers = strata(500, 220)
    share = (high - surface) / (high - low)
    shown = layers[: int(500 * share)]
    axes.imshow(shown, extent=(-half, half, high, surface), aspect="auto", interpolation="bilinear", zorder=0)
    x = np.linspace(-1, 1, 200)
    wall = np.sqrt(1 - x**2) * 0.35 + 0.28  # the far wall of an empty hole, darker at its edges
    shade = np.repeat(wall[None, :, None], 2, axis=0) * np.array([0.74, 0.66, 0.56])
    axes.imshow(shade, extent=(-hole, hole, bottom, surface), aspect="auto", interpolation="bilinear", zorder=1)
    axes.axhline(surface, color="#5d5140", lw=1.5, zorder=1.5)
    axes.set_xlim(-half, half)
    axes.set_ylim(high, low)


def hole_radius(story: Story) -> float:
    """Radius of the hole in m: the scene's, the bit's, or half as wide again as the string."""
    from drillfem.render.story import attribute

    given = float(attribute(story.scene, "hole", "diameter", default=0.0) or 0.0) / 2
    return max(given, story.bit_radius) or 1.5 * radii(story)


def place(figure: Figure, x: float, y: float, w: float, h: float, **kwargs: Any) -> Axes:
    """Axes at pixels from the page's upper left corner."""
    width, height = (v * style.DPI for v in figure.get_size_inches())
    return figure.add_axes((x / width, 1 - (y + h) / height, w / width, h / height), **kwargs)


def string_page(studio: Studio, story: Story, field: str | None, index: int, path: Path) -> Path:
    """string.png: the whole string, stretched, its field and twist against depth, and three close-ups."""
    pose, brush = story.pose(index), Brush(story, field)
    z_top, z_bottom = float(pose.position[0, 2]), float(pose.position[-1, 2])
    length = z_bottom - z_top
    low, high = z_top - 0.055 * length, z_bottom + 0.035 * length
    hole = hole_radius(story)
    half = 2.9 * hole
    with style.page(1600, 1200) as figure:
        style.heading(figure, story.title, subtitle(story, pose.time))
        y, h, w = 128, 960, 262
        axes = place(figure, 92, y, w, h)
        axes.grid(False)
        ground(axes, half, hole, z_top, z_bottom, low, high)
        picture = stretched_view(studio, story, brush, index, w, h, low, high, half)
        axes.imshow(picture, extent=(-half, half, high, low), aspect="auto", zorder=3)
        axes.set_ylabel("depth below the top drive (m)")
        axes.set_ylim(high, low)
        axes.set_xlim(-half, half)
        axes.set_yticks(depth_ticks(z_top, z_bottom))
        axes.set_xticks([-hole, 0, hole], [f"{-1e3 * hole:.0f}", "0", f"{1e3 * hole:.0f}"])
        axes.set_xlabel("across (mm)")
        squeeze = (2 * half / w) / ((high - low) / h)
        axes.set_title(f"The string, width \u00d7{style.number(1 / squeeze, 2)}", fontsize=12)
        profiles(figure, story, brush, index, pose, axes, (382, y, 232, h), (640, y, 150, h))
        insets(figure, studio, story, brush, index, pose, axes)
        figure.text(
            0.018,
            0.018,
            "White stripe: the director $d_1$, painted on the tube; black line: its back. "
            f"Orange arrows: the turn in {LOOK_AHEAD:g} s. Drilling turns clockwise seen from above.",
            fontsize=10,
            color=style.GREY,
        )
        return style.save(figure, path)


def subtitle(story: Story, time: float) -> str:
    """Model, time and length in one grey line."""
    words = [story.clock(time)]
    if story.model:
        words.append(f"{story.model} model")
    words.append(f"string of {style.number(story.length, 4)} m")
    return "   \u00b7   ".join(words)


def depth_ticks(top: float, bottom: float) -> np.ndarray:
    """Round depths from top to bottom."""
    from matplotlib.ticker import MaxNLocator

    ticks = np.asarray(MaxNLocator(7, steps=[1, 2, 2.5, 5, 10]).tick_values(top, bottom))
    return ticks[(ticks >= top - 1e-3 * (bottom - top)) & (ticks <= bottom + 1e-3 * (bottom - top))]


def profiles(
    figure: Figure,
    story: Story,
    brush: Brush,
    index: int,
    pose: Pose,
    beside: Axes,
    where: tuple[float, float, float, float],
    second: tuple[float, float, float, float],
) -> None:
    """The field against depth, with its range over the run; its axis is the colour bar. Then the twist."""
    from matplotlib.collections import LineCollection

    depth = pose.position[:, 2]
    if brush.field is not None:
        axes = place(figure, *where, sharey=beside)
        axes.tick_params(labelleft=False)
        everything = story.values(brush.field)
        now = everything[index]
        low, high = np.nanmin(everything, axis=0), np.nanmax(everything, axis=0)
        axes.fill_betweenx(depth, low, high, color=style.FAINT, alpha=0.55, lw=0, label="range over the run")
        points = np.stack([now, depth], axis=1)
        lines = LineCollection(
            list(np.stack([points[:-1], points[1:]], axis=1)),
            cmap=brush.cmap,
            norm=brush.norm,
            lw=3.5,
            zorder=4,
        )
        lines.set_array((now[:-1] + now[1:]) / 2)
        axes.plot(now, depth, color=style.INK, lw=5.0, zorder=3, solid_capstyle="round")
        axes.add_collection(lines, autolim=False)
        lo, hi = float(low.min()), float(high.max())
        room = 0.06 * (hi - lo) or 1.0
        lo, hi = lo - room, hi + room
        axes.set_xlim(lo, hi)
        marks(axes, story, depth)
        axes.set_title(story.label(brush.field), fontsize=12)
        axes.tick_params(labelbottom=False, length=0)
        axes.legend(loc="upper right", bbox_to_anchor=(1.02, 1.0), handlelength=1.2, borderpad=0.2)
        bar = place(figure, where[0], where[1] + where[3] + 8, where[2], 16)
        bar.imshow(brush.cmap(brush.norm(np.linspace(lo, hi, 256)))[None], extent=(lo, hi, 0, 1), aspect="auto")
        bar.set_yticks([])
        bar.grid(False)
        bar.set_xlim(lo, hi)
        bar.set_xlabel(story.label(brush.field))
    axes = place(figure, *second, sharey=beside)
    axes.tick_params(labelleft=False)
    angle = angle_along(pose)
    axes.plot(angle, depth, color=style.INK, lw=2)
    axes.fill_betweenx(depth, 0, angle, color=style.SKY, alpha=0.25, lw=0)
    low, high = min(float(angle.min()), 0.0), max(float(angle.max()), 0.0)
    room = 0.08 * (high - low) or 1.0
    axes.set_xlim(low - room, high + room)
    marks(axes, story, depth)
    axes.set_title("twist (rad)", fontsize=12)
    axes.set_xlabel("angle from the top (rad)")
    beside.set_ylim(beside.get_ylim())


def marks(axes: Axes, story: Story, depth: np.ndarray) -> None:
    """Where a section of the string ends and the next begins."""
    for part in story.parts[:-1]:
        z = float(np.interp(part.bottom, story.arc, depth))
        axes.axhline(z, color=style.GREY, lw=0.8, ls=(0, (4, 3)), zorder=2)


# -- close-ups -------------------------------------------------------------------------------------------
def insets(figure: Figure, studio: Studio, story: Story, brush: Brush, index: int, pose: Pose, whole: Axes) -> None:
    """Top drive, the change of section, and the bit on its rock, each with what is measured there."""
    x, y, across = 872, 128, 420
    heights = {"top": 240, "junction": 240, "bit": 400} if len(story.parts) > 1 else {"top": 380, "bit": 540}
    for k, (name, height) in enumerate(heights.items()):
        view = place(figure, x, y, across, height)
        style.panel(view)
        size = (across, height)
        view.set_facecolor("#eef1f4")
        for spine in view.spines.values():
            spine.set(visible=True, color=style.GREY, linewidth=0.9)
        if name == "top":
            shot, facts, depth = top_inset(studio, story, brush, index, pose, size)
            title = "Top drive"
        elif name == "junction":
            last = len(story.parts) - 2
            shot, facts, depth = junction_inset(studio, story, brush, index, pose, last, size)
            title = f"{story.parts[last].name.capitalize()} to {story.parts[last + 1].name}"
        else:
            shot, facts, depth, title = bit_inset(studio, story, brush, index, pose, size)
        view.imshow(shot, extent=(0, 1, 0, 1), aspect="auto")
        view.set_title(title, fontsize=12)
        leader(figure, whole, depth, view, 824 + 10 * k)
        readings(figure, facts, x + across + 20, y + 6)
        y += height + 40


def leader(figure: Figure, whole: Axes, depth: float, view: Axes, turn: float) -> None:
    """A mark at a depth of the string; a line from there to its close-up, with a bend at pixel `turn`."""
    from matplotlib.lines import Line2D

    edge = whole.get_xlim()[1]
    whole.plot([edge], [depth], marker="<", ms=8, color=style.VERMILION, clip_on=False, zorder=6)
    level = figure.transFigure.inverted().transform(whole.transData.transform((edge, depth)))[1]
    frame = view.get_position()
    middle = (frame.y0 + frame.y1) / 2
    x = [808 / 1600, turn / 1600, turn / 1600, frame.x0]
    figure.add_artist(Line2D(x, [level, level, middle, middle], color=style.VERMILION, lw=1.2))
    figure.add_artist(Line2D(x[:1], [level], marker="o", ms=5, color=style.VERMILION))


def readings(figure: Figure, facts: list[tuple[str, str]], x: float, y: float) -> None:
    """Names in grey with their values under them, from a pixel counted from the page's upper left."""
    width, height = (v * style.DPI for v in figure.get_size_inches())
    for k, (name, value) in enumerate(facts):
        top = y + 60 * k
        figure.text(x / width, 1 - top / height, name, fontsize=10.5, color=style.GREY, va="top")
        figure.text(x / width, 1 - (top + 20) / height, value, fontsize=14, va="top")


def rpm(speed: float) -> str:
    """'14.42 rad/s (138 rpm)'."""
    return f"{speed:.2f} rad/s  ({speed * 30 / math.pi:.0f} rpm)"


def spin_at(story: Story, index: int, arc: float, history: str | None = None) -> float | None:
    """Angular speed about the string's axis at a saved time, rad/s."""
    if "spin" in story.colour_fields:
        return float(np.interp(arc, story.arc, story.values("spin")[index]))
    return story.at(history, float(story.times[index])) if history else None


def top_inset(
    studio: Studio, story: Story, brush: Brush, index: int, pose: Pose, size: tuple[int, int]
) -> tuple[np.ndarray, list[tuple[str, str]], float]:
    """The motor and the first metre of the string."""
    width = radii(story)
    s0 = float(story.arc[0])
    reach = min(9 * width, story.length)
    datum = float(pose.position[0, 2])
    things = close_up(story, brush, index, pose, s0, s0 + reach, datum)
    motor = [
        (0.0, -4.8 * width),
        (3.0 * width, -4.8 * width),
        (3.3 * width, -4.5 * width),
        (3.3 * width, -1.9 * width),
        (2.9 * width, -1.6 * width),
        (1.7 * width, -1.3 * width),
        (1.7 * width, 0.0),
        (0.0, 0.0),
    ]
    things.append(Thing(lathe(motor), DARK_STEEL, specular=0.5))
    things.append(Thing(lathe([(1.9 * width, -0.9 * width), (1.9 * width, -0.35 * width)]), ARROW, specular=0.2))
    for side in (-1, 1):
        things.append(
            Thing(
                box(
                    (side * 4.6 * width - 0.3 * width, -0.4 * width, -6 * width),
                    (0.6 * width, 0.8 * width, 20 * width),
                ),
                STEEL,
            )
        )
        things.append(
            Thing(
                box(
                    (min(side * 3.2, side * 4.6) * width, -0.3 * width, -3.4 * width),
                    (1.4 * width, 0.6 * width, 0.7 * width),
                ),
                STEEL,
            )
        )
    spin = spin_at(story, index, s0, "top_angular_speed")
    things += arrow_at(spin, 2.1 * width, 3.6 * width, 0.17 * width)
    camera = Camera((0.0, 36 * width, -9 * width), (0.0, 0.0, 0.5 * width))
    facts = []
    if spin is not None:
        facts.append(("spin", rpm(spin)))
    for name, words, unit, factor in (
        ("top_torque", "torque", "kN m", 1e-3),
        ("hook_load", "hook load", "kN", 1e-3),
        ("top_power", "power", "kW", 1e-3),
    ):
        value = story.at(name, pose.time)
        if value is not None:
            facts.append((words, f"{style.number(factor * value)} {unit}"))
    return studio.shoot(things, camera, *size), facts, datum


def junction_inset(
    studio: Studio, story: Story, brush: Brush, index: int, pose: Pose, k: int, size: tuple[int, int]
) -> tuple[np.ndarray, list[tuple[str, str]], float]:
    """Where part k ends and part k + 1 begins, in the hole."""
    above, below = story.parts[k], story.parts[k + 1]
    width = radii(story)
    s = above.bottom
    datum = float(np.interp(s, story.arc, pose.position[:, 2]))
    reach = min(8 * width, above.bottom - above.top, below.bottom - below.top)
    things = close_up(story, brush, index, pose, s - reach, s + reach, datum)
    things.append(hole_shell(hole_radius(story), -reach, reach))
    spin = spin_at(story, index, s)
    things += arrow_at(spin, 1.30 * width, -1.7 * width, 0.08 * width)
    camera = Camera((0.0, 17 * width, -4.5 * width), (0.0, 0.0, 0.0))
    facts = [("depth", f"{style.number(datum, 5)} m")]
    if above.outer and below.outer:
        facts.append(("outer diameter", f"{1e3 * above.outer:.0f} \u2192 {1e3 * below.outer:.0f} mm"))
    if spin is not None:
        facts.append(("spin", rpm(spin)))
    # the torque that is handed down, positive like those of the top drive and on the bit: minus the section moment
    for name, unit, factor in (("torque", "kN m", -1e-3), ("axial_force", "kN", 1e-3)):
        if name in story.colour_fields:
            value = factor * float(np.interp(s, story.arc, story.values(name)[index]))
            facts.append((name.replace("_", " "), f"{style.number(value)} {unit}"))
    return studio.shoot(things, camera, *size), facts[:4], datum


def magnification(steps: float, radius: float) -> float:
    """A round factor (1, 2, 5, 10, ...) that makes steps of the rock a fifth of the bit's radius high."""
    raw = 0.22 * radius / max(steps, 1e-9)
    power = 10.0 ** math.floor(math.log10(raw))
    return max(1.0, power * max(f for f in (1.0, 2.0, 5.0) if f * power <= raw))


def bit_things(
    story: Story, brush: Brush, index: int, pose: Pose, scale: float | None = None
) -> tuple[list[Thing], float | None]:
    """The bit at the origin, the string above, the rock below, its heights magnified; that factor."""
    a = story.bit_radius
    s = float(story.arc[-1])
    datum = float(pose.position[-1, 2])
    turn = azimuth(pose, s)
    top = s - min(9 * a, story.length)
    things = []
    for thing in close_up(story, brush, index, pose, top, s, datum):
        thing.mesh.translate((0.0, 0.0, -2.0 * a), inplace=True)  # the bit's own length is no part of the rod
        things.append(thing)
    things += drill_bit(a, story.blades, turn)
    rock = story.rock(index)
    if rock is None:
        azimuths: np.ndarray = np.linspace(0, 2 * math.pi, 73)[:-1]
        z: np.ndarray = np.zeros(72)
    else:
        angle, depth = rock
        azimuths, around = rock_around(angle, depth, story.blades, turn)
        z = around - depth_of_bit(story, index, depth)
        if scale is None:
            scale = magnification(float(np.ptp(z)), a)
        z = scale * z
    things += rock_drum(1.0 * a, azimuths, z, float(z.max()) + 0.55 * a)
    things.append(hole_shell(1.03 * a, -6 * a, float(z.max()) + 0.55 * a))
    return things, scale


def depth_of_bit(story: Story, index: int, rock: np.ndarray) -> float:
    """Depth drilled at a saved time on the scale of the rock's heights, m."""
    found = story.at("bit_depth", float(story.times[index]))
    return float(rock.max()) if found is None else found


def bit_inset(
    studio: Studio, story: Story, brush: Brush, index: int, pose: Pose, size: tuple[int, int]
) -> tuple[np.ndarray, list[tuple[str, str]], float, str]:
    """The lower end: the bit on the rock it cuts, or the free end of a string without one."""
    s, depth = float(story.arc[-1]), float(pose.position[-1, 2])
    width = radii(story)
    spin = spin_at(story, index, s, "bit_angular_speed")
    if not (story.drilling and story.bit_radius):
        reach = min(10 * width, story.length)
        things = close_up(story, brush, index, pose, s - reach, s, depth)
        things += arrow_at(spin, 1.6 * width, -2.0 * width, 0.11 * width)
        camera = Camera((0.0, 26 * width, -7 * width), (0.0, 0.0, -2.5 * width))
        facts = [("spin", rpm(spin))] if spin is not None else []
        return studio.shoot(things, camera, *size), facts, depth, "Lower end"
    a = story.bit_radius
    things, scale = bit_things(story, brush, index, pose)
    things += arrow_at(spin, 0.85 * a, -2.45 * a, 0.055 * a)
    camera = Camera((0.0, 9.0 * a, -4.6 * a), (0.0, 0.0, -0.95 * a))
    facts = [("spin", rpm(spin))] if spin is not None else []
    for name, words, unit, factor in (
        ("bit_axial_speed", "axial speed", "mm/s", 1e3),
        ("bit_weight", "weight on bit", "kN", 1e-3),
        ("bit_torque", "torque on bit", "kN m", 1e-3),
        ("depth_of_cut", "depth of cut", "mm", 1e3),
        ("bit_depth", "drilled", "m", 1.0),
    ):
        value = story.at(name, pose.time)
        if value is not None:
            facts.append((words, f"{style.number(factor * value)} {unit}"))
    title = "Bit on the rock"
    if scale is not None:
        title += f", its cuts \u00d7{scale:g}"
    return studio.shoot(things, camera, *size), facts, depth, title


# -- true aspect -----------------------------------------------------------------------------------------
def true_page(studio: Studio, story: Story, field: str | None, index: int, path: Path) -> Path:
    """string-true.png: nothing stretched, so several pictures, each ten times closer to the lower end."""
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D
    from matplotlib.patches import Rectangle

    pose, brush = story.pose(index), Brush(story, field)
    depth, bottom = pose.position[:, 2], float(pose.position[-1, 2])
    wide, hole = 2 * radii(story), hole_radius(story)
    spans = [1.06 * story.length]
    while spans[-1] / 10 > 4.5 * wide and len(spans) < 5:
        spans.append(spans[-1] / 10)
    count = len(spans)
    with style.page(1600, 1200) as figure:
        style.heading(figure, f"{story.title}: true proportions", subtitle(story, pose.time))
        y, h = 128, 920
        gap = 108
        w = int((1600 - 96 - 30 - (count - 1) * gap) / count)
        before: Axes | None = None
        for k, span in enumerate(spans):
            x = 96 + k * (w + gap)
            axes = place(figure, x, y, w, h)
            axes.grid(False)
            half = span * w / h / 2
            high = bottom + (0.02 if k == 0 else 0.12) * span
            low = high - span
            surface = float(depth[0])
            if k == 0:
                low, high = surface - 0.03 * story.length, surface - 0.03 * story.length + span
            ground(axes, half, hole, max(surface, low), bottom, low, high)
            pixel = span / h
            if wide / pixel < 4:
                values = brush.nodes(index)
                points = np.stack([pose.position[:, 0], depth], axis=1)
                colours = brush.cmap(brush.norm((values[1:] + values[:-1]) / 2))
                segments = list(np.stack([points[:-1], points[1:]], axis=1))
                axes.plot(points[:, 0], points[:, 1], color="white", lw=3.6, zorder=4, solid_capstyle="butt")
                axes.add_collection(LineCollection(segments, colors=colours, lw=2.2, zorder=5), autolim=False)
                note = f"drawn 3 px wide\n({style.number(wide / pixel, 2)} to scale)"
            else:
                picture = true_view(studio, story, brush, index, pose, w, h, low, high)
                axes.imshow(picture, extent=(-half, half, high, low), aspect="auto", zorder=3)
                note = "to scale"
            axes.set_xlim(-half, half)
            axes.set_ylim(high, low)
            axes.set_yticks(depth_ticks(max(low, surface), min(high, bottom)))
            axes.xaxis.set_major_locator(_few_ticks())
            axes.set_xlabel("across (m)")
            if k == 0:
                axes.set_ylabel("depth below the top drive (m)")
            title = "The whole string" if k == 0 else f"\u00d7{10**k:,}".replace(",", "\u2009")
            axes.set_title(title)
            axes.text(
                0.03,
                0.985,
                note,
                transform=axes.transAxes,
                va="top",
                fontsize=9.5,
                bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 3},
                zorder=7,
            )
            if before is not None:
                outer = before
                frame = Rectangle((-half, low), 2 * half, high - low, fill=False, ec=style.VERMILION, lw=1.4, zorder=8)
                outer.add_patch(frame)
                for level, corner in ((low, 1.0), (high, 0.0)):
                    start = outer.transData.transform((half, level))
                    stop = axes.transAxes.transform((0.0, corner))
                    ends = figure.transFigure.inverted().transform([start, stop])
                    figure.add_artist(Line2D(ends[:, 0], ends[:, 1], color=style.VERMILION, lw=1.0, alpha=0.55))
            before = axes
        if brush.field is not None:
            bar = place(figure, 96, 1118, 420, 16)
            low, high = float(brush.norm.vmin or 0.0), float(brush.norm.vmax or 1.0)
            bar.imshow(brush.cmap(np.linspace(0, 1, 256))[None], extent=(low, high, 0, 1), aspect="auto")
            bar.set_yticks([])
            bar.grid(False)
            figure.text(536 / 1600, 1 - 1126 / 1200, story.label(brush.field), va="center")
        figure.text(
            0.5,
            1 - 1126 / 1200,
            "Each frame is ten times closer. Depth and width have one scale in every frame.",
            va="center",
            color=style.GREY,
            fontsize=10.5,
        )
        return style.save(figure, path)


def _few_ticks() -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(3, symmetric=True)


def true_view(
    studio: Studio,
    story: Story,
    brush: Brush,
    index: int,
    pose: Pose,
    width: int,
    height: int,
    low: float,
    high: float,
) -> np.ndarray:
    """The lower end between depths low..high (m), from the side, to scale."""
    bottom = float(pose.position[-1, 2])
    with_bit = story.drilling and story.bit_radius > 0
    last, first = float(story.arc[-1]), float(story.arc[0])
    end = last - 2.0 * story.bit_radius if with_bit else last
    start = max(first, last - 1.2 * (bottom - low))
    things = close_up(story, brush, index, pose, start, end, bottom)
    if with_bit:
        things += drill_bit(story.bit_radius, story.blades, azimuth(pose, last))
    middle = (low + high) / 2 - bottom
    reach = 20 * (high - low)
    camera = Camera((0.0, reach, middle), (0.0, 0.0, middle), half_height=(high - low) / 2)
    return studio.shoot(things, camera, width, height)
