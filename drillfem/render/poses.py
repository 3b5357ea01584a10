"""Pictures of a string that swings or bends: its true shape, with other poses as ghosts."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from drillfem.render import style
from drillfem.render.story import Pose, Story, attribute
from drillfem.render.straight import Brush, place, radii, stations, subtitle
from drillfem.render.studio import Camera, Studio, Thing, resample, tube

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GHOSTS = 11
# directors that the white stripe may follow: angle from d1, and name
STRIPES = {0.0: "d_1", np.pi / 2: "d_2", np.pi: "-d_1", -np.pi / 2: "-d_2"}
AXES = ("x", "y", "z")
WORK_IN = ("work_top_drive", "work_gravity", "work_hook_load", "work_hook")
WORK_OUT = ("work_bit", "dissipated", "work_damping", "work_wall")


@dataclass(frozen=True)
class View:
    """A parallel view: unit vectors right, up and to the viewer; centre and half sizes of the frame, m."""

    right: np.ndarray
    up: np.ndarray
    near: np.ndarray
    flat: bool
    centre: np.ndarray
    half: tuple[float, float]
    floor: Floor | None = None

    def project(self, points: np.ndarray) -> np.ndarray:
        """Coordinates on the page (..., 2), m, of points (..., 3)."""
        return np.stack([points @ self.right, points @ self.up], axis=-1)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom, top on the page, m."""
        u, v = self.project(self.centre)
        return u - self.half[0], u + self.half[0], v - self.half[1], v + self.half[1]

    def camera(self) -> Camera:
        """The same view for the studio."""
        place_ = self.centre + 50 * max(self.half) * self.near
        return Camera(tuple(place_), tuple(self.centre), tuple(self.up), half_height=self.half[1])


def find_view(story: Story, width: int, tallest: int, room: float) -> tuple[View, int]:
    """How to look at all poses: along the normal of their plane if they lie in one, else from a corner.

    width: of the frame in pixels; tallest: its greatest height; room: kept free around the string, m.
    The height that the poses need is returned with the view.
    """
    points = np.concatenate([story.position.reshape(-1, 3), way_of_tip(story)])
    ground = None
    spread = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    flat = bool(spread[1][2] < 2e-3 * spread[1][0])
    gravity = np.asarray(attribute(story.scene, "gravity", "direction", default=(0.0, 0.0, 1.0)), dtype=float)
    pulled = attribute(story.scene, "gravity", "magnitude", default=9.8) != 0
    if flat:
        normal = _axis_like(spread[2][2])
        along = gravity - (gravity @ normal) * normal
        if pulled and np.linalg.norm(along) > 0.5:
            up = -along / np.linalg.norm(along)
            right = np.cross(up, normal)
        else:  # no weight: the longer side lies
            first = spread[2][0]
            if np.abs(normal).max() > 0.999:  # along a coordinate, so that the scales are those of coordinates
                first = np.eye(3)[int(np.argmax(np.abs(first)))]
            right, up = first, np.cross(normal, first)
        if right @ (story.position[0, -1] - story.position[0, 0]) < 0:  # at first the string runs to the right
            right = -right
        near = np.cross(right, up)
    else:
        start = story.position[0]
        plane = np.linalg.svd(start - start.mean(axis=0), full_matrices=False)
        up = _axis_like(plane[2][2]) if plane[1][1] > 1e-3 * plane[1][0] else -gravity / np.linalg.norm(gravity)
        move = (points @ up)[np.argmax(np.abs((points - start[0]) @ up))] - start[0] @ up
        up = up if move >= 0 else -up
        ahead = start[-1] - start[0]
        ahead = ahead - (ahead @ up) * up
        ahead /= np.linalg.norm(ahead)
        side = np.cross(ahead, up)
        # the string runs from the back left to the front right, seen from somewhat above
        ground = find_floor(story, up)
        if ground is not None:
            points = np.concatenate([points, ground.corners()])
        near = 0.45 * ahead + 0.78 * side + 0.55 * up
        near /= np.linalg.norm(near)
        right = np.cross(up, near)
        right /= np.linalg.norm(right)
        up = np.cross(near, right)
    page = np.stack([points @ right, points @ up], axis=1)
    low, high = page.min(axis=0) - room, page.max(axis=0) + room
    need = (high - low) / 2
    height = int(np.clip(width * need[1] / need[0], 0.66 * tallest, tallest))
    scale = max(need[0] / width, need[1] / height)
    middle = (low + high) / 2
    centre = middle[0] * right + middle[1] * up + float((points @ near).mean()) * near
    return View(right, up, near, flat, centre, (scale * width, scale * height), ground), height


def _axis_like(vector: np.ndarray) -> np.ndarray:
    """The vector, or the coordinate axis it nearly is, pointing along +."""
    k = int(np.argmax(np.abs(vector)))
    if abs(vector[k]) > 0.999:
        return np.eye(3)[k]
    return np.asarray(vector if vector[k] > 0 else -vector)


def tube_of(
    story: Story, pose: Pose, thick: float, texture: np.ndarray | None, colour: tuple[float, ...]
) -> list[Thing]:
    """The string as a tube, its radii multiplied by `thick`; textured, or in one colour."""
    arc, radius = stations(story, float(story.arc[0]), float(story.arc[-1]), 240)
    position, d1, d3 = resample(pose, arc)
    v = (arc - arc[0]) / (arc[-1] - arc[0])
    meshes = tube(position, d1, d3, thick * radius, v)
    if texture is None:
        return [Thing(m, colour, specular=0.0, ambient=0.68, diffuse=0.28) for m in meshes]
    return [Thing(m, texture=texture) for m in meshes]


def ghosts(story: Story, index: int) -> list[int]:
    """Saved times to show behind the chosen one, spread over the run."""
    others = [i for i in range(len(story.times)) if i != index]
    if len(others) <= GHOSTS:
        return others
    return [others[round(k)] for k in np.linspace(0, len(others) - 1, GHOSTS)]


def ghost_tones(count: int) -> list[tuple[float, ...]]:
    """From pale (early) to darker (late)."""
    pale, dark = np.array([0.90, 0.91, 0.93]), np.array([0.66, 0.70, 0.75])
    return [tuple(pale + (dark - pale) * k / max(count - 1, 1)) for k in range(count)]


def stripe_towards(pose: Pose, view: View) -> float:
    """Angle from d1 of the painted stripe: 0, or where the view hides d1 that of -d1 or +-d2."""
    d1, d2 = pose.director1 @ view.near, np.cross(pose.director3, pose.director1) @ view.near
    if d1.min() > 0.3:
        return 0.0
    facing = {angle: side.min() + side.mean() for angle, side in zip(STRIPES, (d1, d2, -d1, -d2), strict=True)}
    return max(facing, key=lambda angle: facing[angle])


def thickness(story: Story, view: View, height: int, least: float = 9.0) -> float:
    """Round factor on the radius that makes the string at least so many pixels thick; 1 if it is anyway."""
    pixels = 2 * radii(story) * height / (2 * view.half[1])
    factor = least / pixels
    if factor <= 1:
        return 1.0
    power = 10 ** np.floor(np.log10(factor))
    return float(power * min(f for f in (1.0, 2.0, 5.0, 10.0) if f * power >= factor))


def poses_page(studio: Studio, story: Story, field: str | None, index: int, path: Path) -> Path:
    """string.png: the chosen pose coloured by its field, the others as ghosts; charts beside it."""
    pose = story.pose(index)
    x, y, w = 104, 104, 930
    view, h = find_view(story, w, 960, 0.09 * story.length)
    brush = Brush(story, field, stripe_towards(pose, view))
    thick = thickness(story, view, h)
    behind = ghosts(story, index)
    tones = ghost_tones(len(behind))
    things = []
    for i, tone in zip(behind, tones, strict=True):
        things += tube_of(story, story.pose(i), thick, None, tone)
    texture = brush.texture(index, float(story.arc[0]), float(story.arc[-1]), 1024)
    now = tube_of(story, pose, thick, texture, (0, 0, 0))
    with style.page(1600, h + 240) as figure:
        words = subtitle(story, pose.time)
        if all(part.outer == 0 for part in story.parts):
            words += "   \u00b7   no diameter given: thickness chosen"
        elif thick != 1:
            words += f"   \u00b7   thickness \u00d7{thick:g}"
        style.heading(figure, story.title, words)
        axes = place(figure, x, y, w, h)
        if view.floor is not None:
            draw_floor(axes, story, view, view.floor, pose, behind)
        left, right, bottom, top = view.extent
        # the chosen pose in front of all ghosts, whatever their depth: it is what the picture is about
        axes.imshow(studio.shoot(things, view.camera(), w, h), extent=(left, right, bottom, top), zorder=3)
        tip_way(axes, story, view)
        axes.imshow(studio.shoot(now, view.camera(), w, h), extent=(left, right, bottom, top), zorder=5)
        dress(axes, view)
        label_ghosts(axes, story, view, behind, index)
        beside(figure, story, brush, index, h)
        figure.text(
            0.018,
            0.018,
            f"Coloured: the chosen pose, its white stripe along ${STRIPES[brush.stripe]}$ (director). "
            "Grey: other saved poses, darker is later. "
            "Dotted: the way of the tip.",
            fontsize=10,
            color=style.GREY,
        )
        return style.save(figure, path)


def dress(axes: Axes, view: View) -> None:
    """Scales for a plane view; a bare frame for a view into space (the box has its own)."""
    left, right, bottom, top = view.extent
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    axes.set_aspect("equal")
    if not view.flat:
        style.panel(axes)
        axes.axis("off")
        return
    for direction, axis in ((view.right, axes.xaxis), (view.up, axes.yaxis)):
        k = int(np.argmax(np.abs(direction)))
        if abs(direction[k]) < 0.999:
            axis.set_label_text("m")
            continue
        axis.set_major_formatter(_signed(1 if direction[k] > 0 else -1))
        axis.set_label_text(f"{AXES[k]} (m)")


def _signed(sign: int) -> Callable[[float, object], str]:
    """Labels of an axis that runs along (1) or against (-1) its coordinate."""
    return lambda value, _: style.number(round(sign * value, 9) + 0.0, 4)


def way_of_tip(story: Story) -> np.ndarray:
    """Positions of the lower end (m, 3)."""
    if all(f"tip_{k}" in story.history for k in AXES):
        return np.stack([np.asarray(story.history[f"tip_{k}"].values, dtype=float) for k in AXES], axis=1)
    return story.position[:, -1]


def tip_way(axes: Axes, story: Story, view: View) -> None:
    """The path of the lower end, from the history where it has it, else through the saved poses."""
    page = view.project(way_of_tip(story))
    axes.plot(page[:, 0], page[:, 1], color=style.VERMILION, lw=1.3, ls=(0, (1, 2)), zorder=4)


def label_ghosts(axes: Axes, story: Story, view: View, behind: Sequence[int], index: int) -> None:
    """Times at the tips of the poses, where there is room for them."""
    _, _, bottom, top = view.extent
    room = 0.035 * (top - bottom)
    taken: list[np.ndarray] = []
    unit = "" if story.still else " s"
    for i in [index, *reversed(behind)]:
        points = view.project(story.position[i])
        tip = points[-1]
        way = tip - points[max(len(points) - 8, 0)]
        way = way / max(float(np.linalg.norm(way)), 1e-12)
        at = tip + way * 0.028 * (top - bottom)
        if any(np.hypot(*((at - other) / (2.0, 1.0))) < 0.75 * room for other in taken):
            continue
        taken.append(at)
        axes.text(
            at[0],
            at[1],
            f"{story.times[i]:.4g}{unit}",
            ha="center",
            va="center",
            fontsize=12 if i == index else 10,
            weight="bold" if i == index else "normal",
            color=style.INK if i == index else style.GREY,
            zorder=6,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.6, "pad": 1.0},
        )


@dataclass(frozen=True)
class Floor:
    """A level patch under a string in space: axis k is the level, ticks along axes i and j (m)."""

    i: int
    j: int
    k: int
    a: np.ndarray
    b: np.ndarray
    level: float

    def corners(self) -> np.ndarray:
        """(4, 3), m."""
        out = np.zeros((4, 3))
        out[:, self.i] = self.a[[0, -1, -1, 0]]
        out[:, self.j] = self.b[[0, 0, -1, -1]]
        out[:, self.k] = self.level
        return out


def find_floor(story: Story, up: np.ndarray) -> Floor | None:
    """The floor below all poses, if up is a coordinate axis."""
    from matplotlib.ticker import MaxNLocator

    k = int(np.argmax(np.abs(up)))
    if abs(up[k]) < 0.999:
        return None
    points = story.position.reshape(-1, 3)
    i, j = (n for n in range(3) if n != k)
    locator = MaxNLocator(5, steps=[1, 2, 5, 10])
    room = 1e-3 * story.length
    a, b = (np.asarray(locator.tick_values(points[:, n].min() - room, points[:, n].max() + room)) for n in (i, j))
    return Floor(i, j, k, a, b, float(points[:, k].min() if up[k] > 0 else points[:, k].max()))


def draw_floor(axes: Axes, story: Story, view: View, ground: Floor, pose: Pose, behind: Sequence[int]) -> None:
    """The floor with its scales, and the string's shadow on it."""
    i, j, k, a, b, level = ground.i, ground.j, ground.k, ground.a, ground.b, ground.level

    def page(u: np.ndarray | float, v: np.ndarray | float, w: np.ndarray | float) -> np.ndarray:
        place_ = np.zeros((*np.broadcast(u, v, w).shape, 3))
        place_[..., i], place_[..., j], place_[..., k] = u, v, w
        return view.project(place_)

    corners = view.project(ground.corners())
    axes.fill(corners[:, 0], corners[:, 1], color="#f1f3f5", zorder=0)
    for value in a:
        line = page(value, b[[0, -1]], level)
        axes.plot(line[:, 0], line[:, 1], color=style.FAINT, lw=1, zorder=1)
    for value in b:
        line = page(a[[0, -1]], value, level)
        axes.plot(line[:, 0], line[:, 1], color=style.FAINT, lw=1, zorder=1)
    for n, tone in [*((g, "#dfe2e6") for g in behind), (None, "#9aa1a9")]:
        r = pose.position if n is None else story.position[n]
        shadow = page(r[:, i], r[:, j], level)
        axes.plot(shadow[:, 0], shadow[:, 1], color=tone, lw=2.5 if n is None else 1.2, zorder=2)
    # scales along the two near edges of the floor: those lower on the page
    edges = []
    for fixed, along, name, ticks in ((b, 0, AXES[i], a), (a, 1, AXES[j], b)):
        ends = [float(fixed[0]), float(fixed[-1])]
        middles = [page(ticks.mean(), e, level) if along == 0 else page(e, ticks.mean(), level) for e in ends]
        edge = ends[int(np.argmin([m[1] for m in middles]))]
        edges.append((along, edge, name, ticks))
    centre = page(a.mean(), b.mean(), level)
    size = view.half[1]
    for along, edge, name, ticks in edges:
        spots = np.array([page(t, edge, level) if along == 0 else page(edge, t, level) for t in ticks])
        out = spots.mean(axis=0) - centre
        out = out / np.linalg.norm(out)
        for spot, tick in zip(spots[1:-1], ticks[1:-1], strict=True):
            at = spot + 0.05 * size * out
            axes.text(
                at[0],
                at[1],
                style.number(float(tick), 4),
                ha="center",
                va="center",
                fontsize=10,
                clip_on=False,
            )
        at = spots.mean(axis=0) + 0.19 * size * out
        axes.text(at[0], at[1], f"{name} (m)", ha="center", va="center", fontsize=11, clip_on=False)
    tip = pose.position[-1]
    drop = np.stack([view.project(tip), page(tip[i], tip[j], level)])
    axes.plot(drop[:, 0], drop[:, 1], color=style.GREY, lw=1, ls=(0, (2, 2)), zorder=4)
    foot = np.array(page(tip[i], tip[j], (level + tip[k]) / 2))
    axes.text(
        foot[0] - 0.02 * size,
        foot[1],
        f"{AXES[k]} = {style.number(float(tip[k]), 4)} m",
        fontsize=10.5,
        va="center",
        ha="right",
        color=style.GREY,
        zorder=6,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 1.5},
    )


def beside(figure: Figure, story: Story, brush: Brush, index: int, height: int) -> None:
    """Right of the picture: the field along the string, the tip over time, and the energies."""
    from matplotlib.collections import LineCollection

    x, w = 1140, 420
    charts = ["field"] if brush.field else []
    if len(story.times) > 2:
        charts.append("tip")
    energies = [n for n in ("kinetic_energy", "strain_energy") if n in story.history]
    if energies and len(story.history["time"]) > 2:
        charts.append("energy")
    h = (height - 86 * (len(charts) - 1)) / max(len(charts), 1)
    h = min(h, 420)
    arc = story.arc - story.arc[0]
    for k, chart in enumerate(charts):
        axes = place(figure, x, 130 + k * (h + 86), w, h - 26)
        if chart == "field" and brush.field:
            everything = story.values(brush.field)
            now = everything[index]
            axes.fill_between(
                arc,
                np.nanmin(everything, axis=0),
                np.nanmax(everything, axis=0),
                color=style.FAINT,
                alpha=0.55,
                lw=0,
                label="range over the run",
            )
            axes.plot(arc, now, color=style.INK, lw=5)
            points = np.stack([arc, now], axis=1)
            lines = LineCollection(
                list(np.stack([points[:-1], points[1:]], axis=1)),
                cmap=brush.cmap,
                norm=brush.norm,
                lw=3.4,
                zorder=4,
            )
            lines.set_array((now[1:] + now[:-1]) / 2)
            axes.add_collection(lines, autolim=False)
            axes.set_title(story.label(brush.field))
            axes.set_xlabel("arc length (m)")
            axes.set_xlim(0, float(arc[-1]))
            axes.margins(y=0.18)
            axes.legend(loc="lower right", bbox_to_anchor=(1.02, 0.98), handlelength=1.2)
            limits = axes.get_ylim()
            bar = place(figure, x + w + 6, 130 + k * (h + 86), 14, h - 26)
            bar.imshow(
                brush.cmap(brush.norm(np.linspace(limits[1], limits[0], 256)))[:, None],
                extent=(0, 1, *limits),
                aspect="auto",
            )
            style.panel(bar)
            axes.set_ylim(limits)
        elif chart == "tip":
            tip = story.position[:, -1]
            moving = [n for n in range(3) if np.ptp(tip[:, n]) > 1e-6 * story.length]
            for n in moving:
                colour = (style.BLUE, style.ORANGE, style.GREEN)[n]
                name = f"tip_{AXES[n]}"
                if name in story.history:
                    axes.plot(story.history["time"], story.history[name], color=colour, label=AXES[n])
                else:
                    axes.plot(story.times, tip[:, n], "o-", ms=4, color=colour, label=AXES[n])
            axes.axvline(float(story.times[index]), color=style.GREY, lw=1, ls=(0, (4, 3)))
            axes.set_title("Tip position (m)")
            axes.margins(x=0, y=0.2)
            axes.set_xlabel("load factor" if story.still else "time (s)")
            axes.legend(loc="lower right", bbox_to_anchor=(1.02, 0.98), ncols=3, handlelength=1.4, columnspacing=1.2)
        else:
            time = story.history["time"].values
            total = np.zeros(len(time))
            for energy, colour in zip(energies, (style.BLUE, style.ORANGE), strict=False):
                values = np.asarray(story.history[energy].values, dtype=float)
                total = total + values
                if not (story.still and energy == "kinetic_energy"):
                    axes.plot(time, values, color=colour, label=energy.removesuffix("_energy"))
            fed, lost = (
                sum(
                    (np.asarray(story.history[n].values, dtype=float) for n in names if n in story.history),
                    np.zeros(len(time)),
                )
                for names in (WORK_IN, WORK_OUT)
            )
            if len(energies) > 1 and not story.still and np.ptp(fed - lost) > 0:
                axes.plot(time, total[0] + fed - lost, color=style.INK, lw=1, ls=(0, (5, 3)), label="work put in")
            axes.axvline(float(story.times[index]), color=style.GREY, lw=1, ls=(0, (4, 3)))
            axes.set_title("Energy (J)")
            axes.margins(x=0, y=0.2)
            axes.set_xlabel("load factor" if story.still else "time (s)")
            axes.legend(loc="lower right", bbox_to_anchor=(1.02, 0.98), ncols=3, handlelength=1.4, columnspacing=1.2)


def true_poses_page(studio: Studio, story: Story, field: str | None, index: int, path: Path) -> Path:
    """string-true.png: the chosen pose with its true thickness, and three places of it from near."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Rectangle

    pose = story.pose(index)
    x, y, w = 104, 104, 910
    view, h = find_view(story, w, 960, 0.09 * story.length)
    brush = Brush(story, field, stripe_towards(pose, view))
    texture = brush.texture(index, float(story.arc[0]), float(story.arc[-1]), 1024)
    things = tube_of(story, pose, 1.0, texture, (0, 0, 0))
    with style.page(1600, 1200) as figure:
        words = subtitle(story, pose.time)
        given = any(part.outer > 0 for part in story.parts)
        if not given:
            words += "   \u00b7   no diameter given: thickness chosen"
        style.heading(figure, f"{story.title}: true proportions", words)
        axes = place(figure, x, y + (960 - h) // 2, w, h)
        if view.floor is not None:
            draw_floor(axes, story, view, view.floor, pose, [])
        line = view.project(pose.position)
        axes.plot(line[:, 0], line[:, 1], color=style.FAINT, lw=1.0, zorder=2)
        axes.imshow(studio.shoot(things, view.camera(), w, h), extent=view.extent, zorder=5)
        dress(axes, view)
        bend = np.linalg.norm(np.gradient(pose.director3, pose.arc, axis=0), axis=1)
        inner = slice(len(bend) // 8, -len(bend) // 8 or None)
        middle = int(np.argmax(bend[inner])) + (inner.start or 0) if np.ptp(bend[inner]) > 1e-9 else len(bend) // 2
        size = (330, 290)
        half = 5.0 * radii(story)
        spots = (
            ("Upper end", 0),
            ("Where it bends most" if bend.max() > 1e-9 else "Middle", middle),
            ("Lower end", -1),
        )
        for k, (name, node) in enumerate(spots):
            centre = pose.position[node]
            close = Camera(tuple(centre + 50 * half * view.near), tuple(centre), tuple(view.up), half_height=half)
            frame = place(figure, 1180, 130 + k * 325, *size)
            style.panel(frame)
            for spine in frame.spines.values():
                spine.set(visible=True, color=style.GREY)
            frame.set_facecolor("#eef1f4")
            frame.imshow(studio.shoot(things, close, *size), extent=(0, 1, 0, 1), aspect="auto")
            nearer = size[1] / half / (h / view.half[1])
            frame.set_title(f"{name}, \u00d7{style.number(nearer, 2)}")
            bar = style.number(2 * radii(story) * 1e3, 3)
            if given:
                frame.text(
                    0.03,
                    0.04,
                    f"thickness {bar} mm",
                    transform=frame.transAxes,
                    fontsize=10,
                    bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 2},
                )
            u, v = view.project(centre)
            wide = half * size[0] / size[1]
            axes.add_patch(
                Rectangle((u - wide, v - half), 2 * wide, 2 * half, fill=False, ec=style.VERMILION, lw=1.3, zorder=8)
            )
            for sign, corner in ((1, 1.0), (-1, 0.0)):
                start = axes.transData.transform((u + wide, v + sign * half))
                stop = frame.transAxes.transform((0.0, corner))
                ends = figure.transFigure.inverted().transform([start, stop])
                figure.add_artist(Line2D(ends[:, 0], ends[:, 1], color=style.VERMILION, lw=0.9, alpha=0.5))
        if brush.field is not None:
            bar_axes = place(figure, 1180, 1112, 330, 16)
            low, high = float(brush.norm.vmin or 0.0), float(brush.norm.vmax or 1.0)
            bar_axes.imshow(brush.cmap(np.linspace(0, 1, 256))[None], extent=(low, high, 0, 1), aspect="auto")
            bar_axes.set_yticks([])
            bar_axes.grid(False)
            bar_axes.set_title(story.label(brush.field), fontsize=11, weight="normal")
        return style.save(figure, path)
