"""A short film of the rotation and the waves (or of the swing): string.gif."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from drillfem.render import style
from drillfem.render.charts import finest_window
from drillfem.render.poses import draw_floor, dress, find_view, stripe_towards, thickness, tip_way, tube_of
from drillfem.render.story import SHOWN, Story
from drillfem.render.straight import (
    Brush,
    bit_things,
    close_up,
    depth_ticks,
    ground,
    hole_radius,
    marks,
    place,
    radii,
    stretched_view,
)
from drillfem.render.studio import Camera, Studio

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

FRAMES = 60
FRAMES_IN_WELL = 120
TURN_SEEN = 2.5  # rad between two frames, by which the eye still follows a stripe
LONGEST = 2.0  # s of simulated time in the film of a string that turns
MILLISECONDS = 60  # per frame


def film(studio: Studio, story: Story, field: str | None, path: Path) -> Path:
    """string.gif: the last stretch that was saved at the finest interval, or the whole swing."""
    part = slice(0, len(story.times)) if story.sideways or story.still else finest_window(story.times, LONGEST)
    chosen = start_up(story) if story.in_well else list(range(len(story.times))[part])
    most = FRAMES_IN_WELL if story.in_well else FRAMES
    if len(chosen) > most:
        chosen = [chosen[round(k)] for k in np.linspace(0, len(chosen) - 1, most)]
    scene = in_well if story.in_well else swing if story.sideways else turning
    with style.page(*((960, 700) if story.in_well else (760, 640))) as figure:
        draw = scene(studio, story, field, figure, chosen)
        frames = [draw(i) for i in chosen]
    save_gif(frames, path, story.still, _pause(story, chosen))
    return path


def _pause(story: Story, chosen: list[int]) -> int:
    """Milliseconds per frame: in a well as fast as life, if that can be watched."""
    if story.in_well and len(chosen) > 1:
        life = 1e3 * float(np.median(np.diff(story.times[chosen])))
        if 0.9 * MILLISECONDS <= life <= 2.5 * MILLISECONDS:
            return round(life / 10) * 10  # a GIF counts in hundredths
    return MILLISECONDS


def save_gif(frames: list[np.ndarray], path: Path, once: bool, pause: int = MILLISECONDS) -> None:
    """One palette for all frames, so that what rests does not flicker and compresses well. pause: per frame, ms."""
    from PIL import Image

    pictures = [Image.fromarray(f[..., :3]) for f in frames]
    sample = [pictures[k] for k in sorted({(len(pictures) - 1) * n // 5 for n in range(6)})]
    wide = Image.new("RGB", (sum(p.width for p in sample), sample[0].height))
    for k, picture in enumerate(sample):
        wide.paste(picture, (k * picture.width, 0))
    wide.paste(style.VERMILION, (0, 0, 60, 60))  # a small spot, which the palette would else forget
    palette = wide.quantize(255, method=Image.Quantize.MEDIANCUT)
    small = [p.quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures]
    pause = 160 if once else pause
    times = [pause] * len(small)
    times[-1] = 900 if once else pause
    small[0].save(path, save_all=True, append_images=small[1:], duration=times, loop=0, optimize=False)


def _flow(figure: Figure, moving: list[Any]) -> Callable[[], np.ndarray]:
    """Draw all that rests once; then only what moves."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    for artist in moving:
        artist.set_animated(True)
    canvas.draw()
    still = canvas.copy_from_bbox(figure.bbox)

    def frame() -> np.ndarray:
        canvas.restore_region(still)
        for artist in moving:
            (artist.axes or figure).draw_artist(artist)
        return np.array(canvas.buffer_rgba())[..., :3].copy()

    return frame


def turning(
    studio: Studio, story: Story, field: str | None, figure: Figure, chosen: list[int]
) -> Callable[[int], np.ndarray]:
    """The stretched string, its field against depth, and the bit on its rock."""
    brush = Brush(story, field)
    pose = story.pose(chosen[0])
    top, bottom = float(pose.position[0, 2]), float(pose.position[-1, 2])
    low, high = top - 0.055 * (bottom - top), bottom + 0.035 * (bottom - top)
    hole = hole_radius(story)
    half = 2.3 * hole
    figure.text(0.02, 0.967, story.title, fontsize=14, weight="bold", va="center")
    clock = figure.text(0.02, 0.928, "", fontsize=11, color=style.GREY, va="center")
    y, h, w = 84, 476, 126
    axes = place(figure, 82, y, w, h)
    axes.grid(False)
    ground(axes, half, hole, top, bottom, low, high)
    blank = np.zeros((2, 2, 4), np.uint8)
    tube = axes.imshow(blank, extent=(-half, half, high, low), aspect="auto", zorder=3)
    axes.set_xlim(-half, half)
    axes.set_ylim(high, low)
    axes.set_xticks([])
    axes.set_yticks(depth_ticks(top, bottom))
    axes.set_ylabel("depth (m)")
    moving: list[Any] = [tube, clock]
    depth = pose.position[:, 2]
    line = dot = None
    if brush.field is not None:
        chart = place(figure, 228, y, 190, h, sharey=axes)
        everything = story.values(brush.field)[chosen]
        chart.fill_betweenx(depth, everything.min(axis=0), everything.max(axis=0), color=style.FAINT, alpha=0.55, lw=0)
        (line,) = chart.plot([], [], color=style.INK, lw=2.2)
        (dot,) = chart.plot([], [], "o", color=style.VERMILION, ms=7)
        lo, hi = float(everything.min()), float(everything.max())
        room = 0.08 * (hi - lo) or 1.0
        chart.set_xlim(lo - room, hi + room)
        chart.tick_params(labelleft=False, labelbottom=False)
        chart.set_title(story.label(brush.field), fontsize=11)
        marks(chart, story, depth)
        bar = place(figure, 228, y + h + 6, 190, 12)
        lo, hi = chart.get_xlim()
        bar.imshow(brush.cmap(brush.norm(np.linspace(lo, hi, 256)))[None], extent=(lo, hi, 0, 1), aspect="auto")
        bar.set_yticks([])
        bar.grid(False)
        bar.set_xlim(lo, hi)
        moving += [line, dot]
    axes.set_ylim(high, low)
    view = place(figure, 436, y, 300, h)
    style.panel(view)
    view.set_facecolor("#eef1f4")
    close = view.imshow(blank, extent=(0, 1, 0, 1), aspect="auto")
    moving.append(close)
    with_bit = story.drilling and story.bit_radius > 0
    scale: float | None = None
    if with_bit:
        from drillfem.render.straight import depth_of_bit, magnification

        steps = []
        for i in chosen:
            rock = story.rock(i)
            if rock is not None:
                steps.append(float(np.ptp(rock[1] - depth_of_bit(story, i, rock[1]))))
        scale = magnification(max(steps), story.bit_radius) if steps else None
    view.set_title(
        "Bit on the rock" + (f", cuts \u00d7{scale:g}" if scale else "") if with_bit else "Lower end",
        fontsize=11,
    )
    frame = _flow(figure, moving)
    pace = _pace(story, chosen)

    def draw(i: int) -> np.ndarray:
        now = story.pose(i)
        tube.set_data(stretched_view(studio, story, brush, i, w, h, low, high, half))
        if line is not None and dot is not None and brush.field is not None:
            values = brush.nodes(i)
            line.set_data(values, depth)
            dot.set_data(values[-1:], depth[-1:])
        if with_bit:
            a = story.bit_radius
            things, _ = bit_things(story, brush, i, now, scale)
            camera = Camera((0.0, 11.5 * a, -5.4 * a), (0.0, 0.0, -1.6 * a), angle=28.0)
        else:
            wide, s = radii(story), float(story.arc[-1])
            reach = min(14 * wide, story.length)
            things = close_up(story, brush, i, now, s - reach, s, float(now.position[-1, 2]))
            camera = Camera((0.0, 30 * wide, -8 * wide), (0.0, 0.0, -4 * wide))
        close.set_data(studio.shoot(things, camera, 300, h))
        clock.set_text(f"{story.clock(now.time)}   \u00b7   {pace}")
        return frame()

    return draw


def start_up(story: Story) -> list[int]:
    """The first poses, as close as they were saved, if the turning can be followed from one to the next; else all."""
    everything = list(range(len(story.times)))
    if story.still or len(everything) < 2:
        return everything
    interval = float(story.times[1] - story.times[0])
    if interval * abs(story.nominal.speed or 0.0) > TURN_SEEN:
        return everything
    return everything[:FRAMES_IN_WELL]


def in_well(
    studio: Studio, story: Story, field: str | None, figure: Figure, chosen: list[int]
) -> Callable[[int], np.ndarray]:
    """The well with the string in it, its spin over time and depth, and sections in which it turns."""
    from drillfem.render.charts import even_grid
    from drillfem.render.well import Well, WellBrush, colour_bar
    from drillfem.render.well_view import Dial, Overview, dial_places

    well, brush = Well(story), WellBrush(story, field)
    figure.text(0.018, 0.965, story.title, fontsize=14, weight="bold", va="center")
    clock = figure.text(0.018, 0.927, "", fontsize=11, color=style.GREY, va="center")
    w, h = 500, 575
    view = Overview(well, w, h, thin=0.72)
    axes = place(figure, 0, 66, w, h)
    style.panel(axes)
    axes.axis("off")
    view.set_stage(axes)
    picture = axes.imshow(np.zeros((2, 2, 4), np.uint8), extent=view.view.extent, zorder=3)
    axes.set_xlim(view.view.extent[:2])
    axes.set_ylim(view.view.extent[2:])
    colour_bar(figure, brush, (84, 646, 300, 10), brief=True)
    moving: list[Any] = [picture, clock]
    depth, times = well.depth(chosen[0]), story.times[chosen]
    name = next((n for n in ("spin", "torque", "side_force") if n in story.colour_fields), None)
    if name is not None:
        factor, label = (30 / np.pi, "spin (rpm)") if name == "spin" else SHOWN[name]
        values = factor * story.values(name)[chosen]
        fall = place(figure, 572, 92, 218, 340)
        grid = even_grid(times, depth, values)
        limits = (min(0.0, float(values.min())), max(float(np.percentile(values, 99.8)), 1e-9))
        colours = matplotlib_colours("cividis", limits, grid)
        extent = (float(times[0]), float(times[-1]), float(depth[-1]), float(depth[0]))
        image = fall.imshow(np.zeros((2, 2, 4)), extent=extent, aspect="auto")
        fall.set_xlim(extent[:2])
        fall.set_ylim(extent[2:])
        fall.grid(False)
        fall.set_ylabel("measured depth (m)", fontsize=10)
        fall.set_xlabel("time (s)", fontsize=10)
        fall.set_title(f"Since the start, {label}", fontsize=11)
        now = place(figure, 812, 92, 128, 340, sharey=fall)
        now.tick_params(labelleft=False)
        (line,) = now.plot([], [], color=style.INK, lw=1.8)
        now.set_xlim(limits[0] - 0.05 * (limits[1] - limits[0]), 1.05 * limits[1])
        now.set_xlabel(label, fontsize=10)
        now.locator_params(axis="x", nbins=3)
        scale = place(figure, 812, 76, 128, 8)
        scale.imshow(np.linspace(0, 1, 128)[None], cmap="cividis", extent=(*limits, 0, 1), aspect="auto")
        scale.set_xlim(now.get_xlim())
        scale.axis("off")
        now.set_title("Now", fontsize=11, pad=20)
        moving += [image, line]
    dials = []
    for k, (words, arc) in enumerate(dial_places(well, chosen[-1], 3)):
        spot = place(figure, 520 + 146 * k, 528, 132, 132)
        dials.append(Dial(spot, well, arc, brush, chosen[0], heads=0.7))
        words = f"{words}\n{np.interp(arc, story.arc, depth):.0f} m"
        spot.set_title(words, fontsize=9, loc="center", pad=3, weight="normal")
        moving += dials[-1].moving
    words = "down the hole, high side up; red: force of the wall"
    figure.text(520 / 960, 1 - 678 / 700, words, fontsize=9.5, color=style.GREY)
    frame = _flow(figure, moving)
    pace = _pace(story, chosen)

    def draw(i: int) -> np.ndarray:
        picture.set_data(studio.shoot(view.things(i, brush), view.view.camera(), w, h))
        if name is not None:
            t = float(story.times[i])
            seen = colours.copy()
            seen[:, round(seen.shape[1] * (t - times[0]) / max(times[-1] - times[0], 1e-12)) :, 3] = 0.0
            image.set_data(seen)
            line.set_data(factor * story.values(name)[i], depth)
        for dial in dials:
            dial.show(i)
        clock.set_text(f"{story.clock(float(story.times[i]))}   \u00b7   {pace}")
        return frame()

    return draw


def matplotlib_colours(name: str, limits: tuple[float, float], values: np.ndarray) -> np.ndarray:
    """RGBA (..., 4) in 0..1 of values (...) in a colour map between limits."""
    import matplotlib

    share = (values - limits[0]) / (limits[1] - limits[0])
    return np.asarray(matplotlib.colormaps[name](np.clip(share, 0, 1)))


def _pace(story: Story, chosen: list[int]) -> str:
    """How much slower than life the film runs."""
    if len(chosen) < 2:
        return "one pose"
    step = float(np.median(np.diff(story.times[chosen])))
    pace = 1e-3 * _pause(story, chosen) / step
    if pace > 1.05:
        return f"{style.number(pace, 2)} times slower than life"
    return (
        "as fast as life" if pace > 0.95 else f"one pose every {style.number(step)} s: the turning between is not seen"
    )


def swing(
    studio: Studio, story: Story, field: str | None, figure: Figure, chosen: list[int]
) -> Callable[[int], np.ndarray]:
    """The string in its plane or in space, the way of its tip behind it."""
    first = story.pose(chosen[-1])
    w, tallest = 650, 470
    view, h = find_view(story, w, tallest, 0.09 * story.length)
    brush = Brush(story, field, stripe_towards(first, view))
    thick = thickness(story, view, h, least=7.0)
    figure.text(0.02, 0.967, story.title, fontsize=14, weight="bold", va="center")
    clock = figure.text(0.02, 0.928, "", fontsize=11, color=style.GREY, va="center")
    axes = place(figure, 84, 84, w, h)
    if view.floor is not None:
        draw_floor(axes, story, view, view.floor, first, [])
    tip_way(axes, story, view)
    picture = axes.imshow(np.zeros((2, 2, 4), np.uint8), extent=view.extent, zorder=5)
    dress(axes, view)
    frame = _flow(figure, [picture, clock])

    def draw(i: int) -> np.ndarray:
        texture = brush.texture(i, float(story.arc[0]), float(story.arc[-1]))
        things = tube_of(story, story.pose(i), thick, texture, (0, 0, 0))
        picture.set_data(studio.shoot(things, view.camera(), w, h))
        colour = f"   \u00b7   colour: {story.label(brush.field)}" if brush.field else ""
        clock.set_text(story.clock(float(story.times[i])) + colour)
        return frame()

    return draw
