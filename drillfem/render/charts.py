"""Charts of a saved result: time series, spectra, spin and speed over depth and time, and the rock."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from drillfem.errors import SceneError
from drillfem.render import style
from drillfem.render.story import SHOWN, Story, attribute
from drillfem.render.straight import depth_ticks, marks, rpm, subtitle
from drillfem.results.spectra import Peak, Window, dominant_in, spectra_in, windows

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MIN_POSES = 8  # fewer are no film and no diagram
ENVELOPE = 1500  # more samples than this are drawn as their range


def curve(axes: Axes, time: np.ndarray, values: np.ndarray, colour: str, label: str | None = None) -> None:
    """A line, or where there are more samples than the page has pixels, the range that they cover."""
    if len(time) <= 2 * ENVELOPE:
        axes.plot(time, values, color=colour, lw=1.2, label=label)
        return
    edges = np.linspace(0, len(time), ENVELOPE + 1).astype(int)[:-1]
    low, high = np.minimum.reduceat(values, edges), np.maximum.reduceat(values, edges)
    # neighbouring columns overlap by a sample, so that a steep line stays a line
    low[1:], high[1:] = (
        np.minimum(low[1:], values[edges[1:] - 1]),
        np.maximum(high[1:], values[edges[1:] - 1]),
    )
    axes.fill_between(time[edges], low, high, color=colour, lw=0.8, alpha=0.9, label=label)


def stuck(time: np.ndarray, spin: np.ndarray, limit: float) -> list[tuple[float, float]]:
    """Intervals of time in which |spin| stays below the limit."""
    still = np.concatenate([[False], np.abs(spin) < limit, [False]])
    edges = np.flatnonzero(np.diff(still.astype(int)))
    last = len(time) - 1
    return [(float(time[a]), float(time[min(b, last)])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def zoom_window(time: np.ndarray) -> tuple[float, float]:
    """The last few seconds, in which the single waves are seen."""
    end, whole = float(time[-1]), float(time[-1] - time[0])
    return end - min(3.0, whole / 4), end


Row = tuple[str, str, float, str, str]  # history name, words, factor, unit, colour
ROWS: tuple[Row, ...] = (
    ("bit_angular_speed", "bit spin", 1.0, "rad/s", style.BLUE),
    ("bit_axial_speed", "axial speed", 1e3, "mm/s", style.BLUE),
    ("depth_of_cut", "depth of cut", 1e3, "mm", style.GREEN),
    ("bit_weight", "weight on bit", 1e-3, "kN", style.GREEN),
    ("bit_torque", "torque on bit", 1e-3, "kN m", style.GREEN),
    ("bit_depth", "drilled depth", 1.0, "m", style.PURPLE),
)


#: of a string in a well, besides those of its bit
IN_WELL: tuple[Row, ...] = (
    ("top_torque", "drive torque", 1e-3, "kN m", style.ORANGE),
    ("wall_torque", "friction torque", 1e-3, "kN m", style.ORANGE),
    ("hook_load", "hook load", 1e-3, "kN", style.ORANGE),
    ("side_force", "side force", 1e-3, "kN", style.PURPLE),
    ("penetration", "into the wall", 1e3, "mm", style.PURPLE),
)


def rows_of(story: Story) -> list[Row]:
    """What to show of a history."""
    rows = [row for row in ROWS if row[0] in story.history]
    if story.in_well:
        spin = ("bit_angular_speed", "bit spin", 30 / math.pi, "rpm", style.BLUE)
        rows = [spin if row[0] == spin[0] else row for row in rows]
        there = [row for row in IN_WELL if row[0] in story.history]
        rows += [row for row in there if np.ptp(story.history[row[0]].values) > 0]
    return rows or other_rows(story)


def other_rows(story: Story) -> list[Row]:
    """What changes in the history of a run without a bit: the tip first, at most six; energies come by themselves."""
    names = [
        str(n)
        for n, v in story.history.items()
        if v.dims == ("time",) and not str(n).startswith("work_") and str(n) != "dissipated"
    ]
    names = [n for n in names if not n.endswith("_energy") and np.ptp(story.history[n].values) > 1e-12]
    names.sort(key=lambda n: not n.startswith("tip_"))
    return [(n, n.replace("_", " "), 1.0, str(story.history[n].attrs.get("units", "")), style.BLUE) for n in names[:6]]


def time_series(story: Story, path: Path) -> Path:
    """time-series.png: what happened at the bit and to the energy, the whole run and its last seconds."""
    history = story.history
    time = np.asarray(history["time"].values, dtype=float)
    rows = rows_of(story)
    energies = [str(n) for n, v in history.items() if str(n).endswith("_energy") and v.dims == ("time",)]
    count, columns = len(rows) + bool(energies), 2 if story.drilling else 1
    limit = float(attribute(story.scene, "bit", "torsional_regularisation", default=0.1))
    start, stop = zoom_window(time)
    near = (time >= start) & (time <= stop)
    with style.page(1600, max(1400, 125 * count + 190) if count > 5 else max(500, 230 * count + 190)) as figure:
        style.heading(figure, story.title, subtitle_of_history(story, time))
        height = figure.get_size_inches()[1] * style.DPI
        top, bottom = 1 - 125 / height, 66 / height
        grid = figure.add_gridspec(
            count,
            columns,
            width_ratios=[1.75, 1][:columns],
            left=0.075,
            right=0.985,
            top=top,
            bottom=bottom,
            hspace=0.16,
            wspace=0.09,
        )
        axes_left: list[Axes] = []
        for k, column in np.ndindex(count, columns):
            window = near if column else slice(None)
            axes = figure.add_subplot(grid[k, column])
            if k == 0:
                axes.set_title(f"Its last {style.number(stop - start)} s" if column else "The whole run")
            if k < len(rows):
                if rows[k][0] == "bit_angular_speed" and story.nominal.speed:
                    spin = np.asarray(history["bit_angular_speed"].values)
                    shade_stick(axes, time, spin, limit, column == 1, rows[k][2])
                draw_row(axes, story, rows[k], time, window)
            else:
                draw_energies(axes, story, energies, time, window)
                if column == columns - 1:
                    axes.legend(loc="upper right", ncols=min(len(energies), 4), borderaxespad=0.1)
            axes.set_xlim(float(time[window][0]), float(time[window][-1]))
            axes.margins(y=0.12 if k < len(rows) else 0.5)
            axes.locator_params(axis="y", nbins=5)
            if k < count - 1:
                axes.tick_params(labelbottom=False)
            else:
                axes.set_xlabel("load factor" if story.still else "time (s)")
            if column == 0:
                axes_left.append(axes)
            else:
                axes.set_ylabel("")
        figure.align_ylabels(axes_left)
        said = ["Dashed: the nominal steady state."] if story.nominal.depth_of_cut is not None else []
        if story.in_well and "top_angular_speed" in history:
            said.append("Grey, above: the top." if said else "Grey, above: the top; dashed: what it shall reach.")
        if story.nominal.speed and "bit_angular_speed" in history:
            share = stick_share(time, np.asarray(history["bit_angular_speed"].values), limit)
            said.append(f"Orange: the bit sticks (below {limit:g} rad/s), {100 * share:.1f} % of the run.")
        figure.text(0.985, 1 - 62 / height, "  ".join(said), ha="right", fontsize=10.5, color=style.GREY)
        return style.save(figure, path)


def draw_row(axes: Axes, story: Story, row: Row, time: np.ndarray, window: np.ndarray | slice) -> None:
    """One variable over a window of time, with its nominal level."""
    name, words, factor, unit, colour = row
    t = time[window]
    if story.in_well and name == "bit_angular_speed" and "top_angular_speed" in story.history:
        top = factor * np.asarray(story.history["top_angular_speed"].values, dtype=float)
        axes.plot(t, top[window], color=style.GREY, lw=1.1)
    curve(axes, t, factor * np.asarray(story.history[name].values, dtype=float)[window], colour)
    nominal = story.nominal
    level = {
        "bit_angular_speed": nominal.speed,
        "bit_axial_speed": nominal.penetration,
        "depth_of_cut": nominal.depth_of_cut,
        "bit_weight": nominal.weight,
        "bit_torque": nominal.torque,
    }.get(name)
    dashed: dict[str, Any] = {"color": style.VERMILION, "lw": 1.1, "ls": (0, (5, 3)), "zorder": 3}
    if level is not None:
        axes.axhline(factor * level, **dashed)
    if name == "bit_depth" and nominal.penetration is not None:
        axes.plot(t, factor * nominal.penetration * (t - time[0]), **dashed)
    axes.set_ylabel(f"{words}\n({unit})")


def draw_energies(axes: Axes, story: Story, names: list[str], time: np.ndarray, window: np.ndarray | slice) -> None:
    """The energies over a window of time, in J or kJ."""
    greatest = max(float(np.abs(story.history[n].values).max()) for n in names)
    factor, unit = (1e-3, "kJ") if greatest > 2e3 else (1.0, "J")
    for n, colour in zip(names, (style.BLUE, style.ORANGE, style.GREEN, style.PURPLE, style.SKY), strict=False):
        values = factor * np.asarray(story.history[n].values, dtype=float)[window]
        curve(axes, time[window], values, colour, n.removesuffix("_energy").replace("_", " "))
    axes.set_ylabel(f"energy\n({unit})")


def subtitle_of_history(story: Story, time: np.ndarray) -> str:
    """Model and the time that was simulated."""
    words = [f"{story.model} model"] if story.model else []
    words.append(f"load factor {time[0]:g} to {time[-1]:.6g}" if story.still else f"{time[0]:g} to {time[-1]:.6g} s")
    return "   \u00b7   ".join(words)


def stick_share(time: np.ndarray, spin: np.ndarray, limit: float) -> float:
    """Share of the time in which the bit stands."""
    return sum(b - a for a, b in stuck(time, spin, limit)) / max(float(time[-1] - time[0]), 1e-12)


def shade_stick(axes: Axes, time: np.ndarray, spin: np.ndarray, limit: float, near: bool, factor: float = 1.0) -> None:
    """Orange where the bit stands: intervals in time, and in the overview a band in speed as well (shown per rad/s:
    factor)."""
    for a, b in stuck(time, spin, limit):
        if near or len(time) < 20000:
            axes.axvspan(a, b, color=style.ORANGE, alpha=0.28, lw=0)
    axes.axhspan(-factor * limit, factor * limit, color=style.ORANGE, alpha=0.55, lw=0, zorder=2.5)


# -- spectra ---------------------------------------------------------------------------------------------
DRILLING: tuple[Row, ...] = (
    ("bit_angular_speed", "Bit spin", 1.0, "rad/s", style.BLUE),
    ("bit_axial_speed", "Axial speed of the bit", 1e3, "mm/s", style.GREEN),
)
OWN = {"bit_angular_speed": "torsional", "bit_axial_speed": "axial"}  # the vibrations that a channel is about
KINDS = {"torsional": style.BLUE, "axial": style.GREEN, "bending": style.PURPLE, "coupled": style.INK}
TOP = 25.0  # Hz that are shown
DECADES = 3.5  # below the strongest wave


def spectra(story: Story, path: Path, chosen: Sequence[tuple[float, float]] | None = None) -> Path | None:
    """spectra.png: what frequencies the bit's two speeds have, in windows of time; None without a bit that cuts.

    Thin: 2|X|/N, the thesis' convention; thick: Hann window, zero padded. Natural frequencies of the string, as the
    run noted them, stand above; the blade passing frequency is marked. ``chosen``: windows (s) other than the usual.
    """
    history = story.history
    time = np.asarray(history["time"].values, dtype=float)
    wanted = [row for row in DRILLING if row[0] in history]
    if not wanted or len(time) < 64 or story.still:
        return None
    rows = looked_at(story, chosen)
    fastest = 0.5 / float(np.median(np.diff(time)))
    top = min(TOP, fastest)
    if story.in_well:
        top = min(top, max(loudest(story, [row[0] for row in wanted], rows), 1.0))
    height = 150 + 410 * len(rows) + 60
    with style.page(1600, height) as figure:
        style.heading(figure, f"{story.title}: spectra of the bit's speeds", subtitle_of_history(story, time))
        grid = figure.add_gridspec(
            len(rows),
            len(wanted),
            left=0.065,
            right=0.985,
            top=1 - 165 / height,
            bottom=66 / height,
            hspace=0.42,
            wspace=0.14,
        )
        for column, (name, words, factor, unit, colour) in enumerate(wanted):
            for row, window in enumerate(rows):
                plain, smooth = spectra_in(history, name, window[1:])
                waves = dominant_in(history, name, window[1:], n=6)
                axes = figure.add_subplot(grid[row, column])
                strongest = 0.0
                for (f, a), width, tone, z in ((smooth, 2.4, colour, 2.0), (plain, 0.8, style.INK, 2.1)):
                    near = (f > 0) & (f <= top)
                    strongest = max(strongest, factor * float(a[near].max()))
                    axes.semilogy(f[near], np.maximum(factor * a[near], 1e-300), color=tone, lw=width, zorder=z)
                strongest = max(strongest, 1e-12)
                axes.set_xlim(0, top)
                axes.set_ylim(strongest * 10**-DECADES, 12 * strongest)
                natural_marks(axes, story, OWN[name])
                passing_mark(axes, story, row == 0 and column == 0)
                name_peaks(axes, [Peak(f, factor * a) for f, a in waves], top)
                label = f"{window.label}: " if window.label else ""
                axes.set_title(f"{words}, {label}{window.start:.4g} to {window.end:.4g} s", pad=34)
                axes.set_ylabel(f"amplitude ({unit})")
                if row == len(rows) - 1:
                    axes.set_xlabel("frequency (Hz)")
        said = "Thick: Hann window, zero padded. Thin: 2|X|/N without window. Dots: waves, frequency and amplitude."
        if story.natural_frequencies and not story.in_well:
            said += " Above: natural frequencies."
        figure.text(0.985, 1 - 62 / height, said, ha="right", fontsize=10.5, color=style.GREY)
        return style.save(figure, path)


def loudest(story: Story, names: list[str], rows: list[Window]) -> float:
    """A round frequency (Hz) above all that is louder than a 200th of the strongest wave of its channel."""
    highest = 0.0
    for name in names:
        for window in rows:
            f, a = spectra_in(story.history, name, window[1:])[1]
            f, a = f[f > 0], a[f > 0]
            highest = max(highest, float(f[a > a.max() / 200].max()))
    return float(next((top for top in (1, 2, 3, 4, 5, 6, 8, 10, 15, 20) if top > 1.05 * highest), TOP))


def looked_at(story: Story, chosen: Sequence[tuple[float, float]] | None) -> list[Window]:
    """The ``chosen`` windows (s), or the usual ones of the run. Raises SceneError for one that leaves the run."""
    start, end = (float(story.history["time"].values[i]) for i in (0, -1))
    for a, b in chosen or ():
        if not start - 1e-9 <= a < b <= end + 1e-9:
            raise SceneError(f"window {a:g}:{b:g}: must be FROM:TO in s within the run, from {start:g} s to {end:g} s")
    return [Window("", *window) for window in chosen] if chosen else windows(start, end)


def natural_marks(axes: Axes, story: Story, own: str) -> None:
    """Ticks above the axes at the string's natural frequencies, numbered; lines through it for the channel's own."""
    top = axes.get_xlim()[1]
    across = axes.get_xaxis_transform()
    level = 0
    for kind, colour in KINDS.items():
        found = [f for f in story.natural_frequencies.get(kind, []) if f <= top]
        # those of a string that hangs free say nothing of one that lies in its hole
        if not found or (story.in_well and kind == "coupled"):
            continue
        low = 1.01 + 0.058 * level
        level += 1
        axes.text(-0.008, low, kind, fontsize=8.5, color=colour, transform=axes.transAxes, ha="right", va="bottom")
        for number, f in enumerate(found, start=1):
            axes.plot([f, f], [low, low + 0.022], color=colour, lw=1.6, transform=across, clip_on=False)
            at: dict[str, Any] = {"transform": across, "ha": "left", "va": "bottom"}
            axes.text(f + 0.004 * top, low, str(number), fontsize=7.5, color=colour, **at)
            if kind == own:
                axes.axvline(f, color=colour, lw=0.7, alpha=0.35, zorder=1)


def passing_mark(axes: Axes, story: Story, words: bool) -> None:
    """A dashed line where the blades pass, at the drive's speed."""
    f = story.blade_passing
    if f is None or f > axes.get_xlim()[1]:
        return
    axes.axvline(f, color=style.VERMILION, lw=1.1, ls=(0, (5, 3)), zorder=1.5)
    if words:
        axes.annotate(
            f"blades pass\n{f:.2f} Hz",
            (f, 1.0),
            xycoords=axes.get_xaxis_transform(),
            xytext=(5, -4),
            textcoords="offset points",
            fontsize=9.5,
            color=style.VERMILION,
            va="top",
            bbox={"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 0.5},
        )


def name_peaks(axes: Axes, waves: list[Peak], top: float) -> None:
    """Marks and labels at the dominant waves; a label that would cover a stronger wave's is left out."""
    taken: list[tuple[float, float]] = []
    low, high = np.log(axes.get_ylim())
    for x, y in waves:
        if x > top:
            continue
        axes.plot([x], [y], "o", ms=4.5, color=style.VERMILION, zorder=5)
        if any(abs(x - u) < 0.095 * top and abs(np.log(y / v)) < 0.15 * (high - low) for u, v in taken):
            continue
        taken.append((x, y))
        right = x > 0.9 * top
        axes.annotate(
            f"{x:.2f} Hz\n{style.number(y, 2)}",
            (x, y),
            xytext=(-7 if right else 7, 1),
            textcoords="offset points",
            fontsize=10,
            va="bottom",
            ha="right" if right else "left",
            linespacing=1.05,
            bbox={"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 0.5},
            zorder=4,
        )


# -- space and time --------------------------------------------------------------------------------------
def finest_window(times: np.ndarray, longest: float, least: int = 12) -> slice:
    """The saved poses to look at: the last stretch at the finest interval, at most `longest` s of it."""
    steps = np.diff(times)
    fine = steps < 1.5 * steps.min()
    last = int(np.flatnonzero(fine)[-1]) + 1
    first = last
    while first > 0 and fine[first - 1] and times[last] - times[first - 1] <= longest:
        first -= 1
    if last - first + 1 < least:  # too few that are close: show all there is
        return slice(0, len(times))
    return slice(first, last + 1)


def wave_speeds(story: Story) -> tuple[float | None, float | None]:
    """Speeds of torsional and axial waves, m/s: sqrt(G/rho), sqrt(E/rho); None where not given."""
    material = attribute(story.scene, "material")
    density = attribute(material, "density")
    shear, youngs = attribute(material, "shear_modulus"), attribute(material, "youngs_modulus")
    ratio = attribute(material, "poisson_ratio")
    if not density:
        return None, None
    if shear is None and youngs is not None and ratio is not None:
        shear = youngs / (2 * (1 + ratio))
    return (
        math.sqrt(shear / density) if shear else None,
        math.sqrt(youngs / density) if youngs else None,
    )


def space_time(story: Story, path: Path) -> Path | None:
    """space-time.png: spin and axial speed over depth and time, so that waves are seen to travel.

    None where too few poses were saved: between them waves run up and down unseen, and a picture would mislead.
    """
    if story.fields is None or len(story.times) < MIN_POSES or story.still:
        return None
    speeds = dict(zip(("spin", "axial_speed"), wave_speeds(story), strict=True))
    fastest = speeds.get("spin")
    part = slice(0, len(story.times)) if story.in_well else finest_window(story.times, 3.0)
    coarse = float(np.median(np.diff(story.times[part])))
    wanted: tuple[str, ...] = ("spin", "axial_speed")
    names = [n for n in wanted if n in story.colour_fields]
    if story.in_well:
        slow = fastest is not None and coarse > story.length / fastest  # waves come and go unseen
        names = ["side_force", "bending_moment"] if slow else ["spin", "torque", "side_force"]
        names = [n for n in names if n in story.colour_fields]
    elif story.sideways or not names:
        wanted = ("spin", "bending_moment", "curvature", "axial_force")
        names = [n for n in wanted if n in story.colour_fields][:2]
    if not names:
        return None
    times = story.times[part]
    arc = story.arc - story.arc[0]
    if not (story.in_well or story.sideways) and fastest and coarse > 0.25 * story.length / fastest:
        return None
    with style.page(1600, (900, 1200, 1500)[len(names) - 1]) as figure:
        height = figure.get_size_inches()[1] * style.DPI
        note = f"one pose every {style.number(coarse)} s"
        style.heading(
            figure,
            f"{story.title}: along the string and over time",
            f"{subtitle_of_history(story, times)}   \u00b7   {note}",
        )
        grid = figure.add_gridspec(
            len(names),
            2,
            width_ratios=[1, 0.016],
            left=0.065,
            right=0.93,
            top=1 - 130 / height,
            bottom=70 / height,
            hspace=0.22,
            wspace=0.025,
        )
        for row, name in enumerate(names):
            axes = figure.add_subplot(grid[row, 0])
            values = story.values(name)[part]
            factor, label = (1e3, "axial speed (mm/s)") if name == "axial_speed" else (1.0, story.label(name))
            if story.in_well:
                factor, label = SHOWN.get(name, (factor, label))
            values = factor * values
            middle = {"spin": story.nominal.speed, "axial_speed": story.nominal.penetration}.get(name)
            if middle is not None:  # two-sided colours: slower and faster than nominal differ in hue
                middle *= factor
                low, high = style.band(values)
                reach = max(middle - low, high - middle, 1e-9)
                limits, colours = (middle - reach, middle + reach), "PuOr_r"
            elif name == "side_force":  # a few stabilisers would hide all the rest
                pressing = values[values > 0]
                limits, colours = (0.0, float(np.percentile(pressing, 98)) if pressing.size else 1.0), "YlOrRd"
            else:
                limits, colours = style.band(values), "cividis"
            image = axes.imshow(
                even_grid(times, arc, values),
                extent=(times[0], times[-1], arc[-1], arc[0]),
                aspect="auto",
                interpolation="bilinear",
                cmap=colours,
                vmin=limits[0],
                vmax=limits[1],
            )
            axes.grid(False)
            axes.set_ylim(float(arc[-1]), 0.0)
            axes.set_yticks(depth_ticks(0.0, float(arc[-1])))
            axes.set_ylabel("arc length from the top (m)")
            axes.set_title(f"{name.replace('_', ' ').capitalize()}")
            marks(axes, story, arc)
            for section in story.parts if len(story.parts) > 1 else ():
                if section.bottom - section.top < 0.07 * story.length:
                    continue
                axes.text(
                    times[0] + 0.006 * (times[-1] - times[0]),
                    section.top - story.arc[0] + 0.012 * story.length,
                    section.name,
                    va="top",
                    fontsize=10,
                    color=style.INK,
                    bbox={"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 2},
                )
            speed = speeds.get(name)
            if speed and coarse <= 0.25 * story.length / speed:
                wave_guide(axes, times, story.length, speed)
            bar = figure.colorbar(image, cax=figure.add_subplot(grid[row, 1]))
            bar.set_label(label)
            bar.outline.set_visible(False)
            if middle is not None:
                bar.ax.axhline(middle, color=style.INK, lw=1.2)
                words = "drive" if story.in_well else "nominal"
                bar.ax.set_title(f"{words}\n{style.number(middle, 4)}", fontsize=9, weight="normal", loc="center")
            if row == len(names) - 1:
                axes.set_xlabel("time (s)")
        return style.save(figure, path)


def even_grid(times: np.ndarray, arc: np.ndarray, values: np.ndarray) -> np.ndarray:
    """`values` (time, node), linearly interpolated on even times and arc lengths: an image (arc, time)."""
    t, s = np.linspace(times[0], times[-1], 1400), np.linspace(arc[0], arc[-1], 420)
    along = np.stack([np.interp(s, arc, row) for row in values])
    return np.stack([np.interp(t, times, column) for column in along.T])


def wave_guide(axes: Axes, times: np.ndarray, length: float, speed: float) -> None:
    """A line as steep as a wave travels, from the top to the bit, with its speed."""
    start = times[0] + 0.82 * (times[-1] - times[0])
    end = start + length / speed
    if end > times[-1]:
        return
    axes.plot([start, end], [0, length], color=style.INK, lw=1.4, ls=(0, (6, 3)))
    axes.annotate(
        f"{speed:.0f} m/s",
        (start + 0.5 * length / speed, 0.5 * length),
        xytext=(8, 0),
        textcoords="offset points",
        fontsize=10.5,
        bbox={"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 2},
    )


# -- the rock --------------------------------------------------------------------------------------------
def rock(story: Story, index: int, path: Path) -> Path | None:
    """rock.png: the hole's bottom from above and unrolled, and how the profile behind a blade changed."""
    found = story.rock(index)
    if found is None or not len(story.blades) or not story.bit_radius:
        return None
    from drillfem.render.studio import rock_around

    angle, depth = found
    time = float(story.times[index])
    azimuth, around = rock_around(angle, depth, story.blades, 0.0)
    drilled = story.at("bit_depth", time)
    face = float(depth.max()) if drilled is None else drilled
    above = 1e3 * (face - around)  # mm above the bit's face
    with style.page(1600, 1200) as figure:
        spin = story.at("bit_angular_speed", time)
        words = f"{subtitle(story, time)}   \u00b7   drilled {style.number(face, 4)} m"
        if spin is not None:
            words += f"   \u00b7   bit spin {rpm(spin)}"
        style.heading(figure, f"{story.title}: the rock under the bit", words)
        polar(figure, story, azimuth, above)
        unrolled(figure, story, azimuth, above)
        passage(figure, story, index)
        return style.save(figure, path)


def polar(figure: Figure, story: Story, azimuth: np.ndarray, above: np.ndarray) -> None:
    """The bottom of the hole from above, as the driller would see it: the bit turns clockwise."""
    axes = figure.add_axes((0.045, 0.375, 0.40, 0.46), projection="polar")
    axes.set_theta_direction(-1)  # type: ignore[attr-defined]
    axes.set_theta_zero_location("N")  # type: ignore[attr-defined]
    order = np.argsort(azimuth % (2 * np.pi), kind="stable")
    a, y = (azimuth % (2 * np.pi))[order], above[order]
    edge = np.append(a, a[0] + 2 * np.pi)
    theta, radius = np.linspace(0, 2 * np.pi, 721), np.array([0.1, 1.0]) * 1e3 * story.bit_radius
    centre = 0.5 * (theta[1:] + theta[:-1])
    height = np.interp(centre, np.concatenate([[a[-1] - 2 * np.pi], edge]), np.concatenate([[y[-1]], y, [y[0]]]))
    image = axes.pcolormesh(theta, radius, height[None], cmap="cividis", shading="flat", rasterized=True)
    for k, blade in enumerate(story.blades):
        axes.plot([blade, blade], radius, color=style.INK, lw=5, solid_capstyle="butt")
        axes.plot([blade, blade], radius, color=style.ORANGE, lw=2.6, solid_capstyle="butt")
        axes.text(blade, 1.10 * radius[1], str(k + 1), ha="center", va="center", weight="bold")
    axes.set_ylim(0, radius[1])
    axes.set_yticks([])
    axes.set_xticks([])
    axes.grid(False)
    axes.spines["polar"].set_visible(False)
    axes.set_title(f"From above, radius {radius[1]:.0f} mm; blades turn clockwise", pad=34)
    bar = figure.colorbar(image, ax=axes, shrink=0.75, pad=0.09)
    bar.set_label("rock above the bit's face (mm)")
    bar.outline.set_visible(False)


def unrolled(figure: Figure, story: Story, azimuth: np.ndarray, above: np.ndarray) -> None:
    """Height of the rock all around, with the blades that cut it."""
    axes = figure.add_axes((0.065, 0.075, 0.915, 0.215))
    turn = np.degrees(azimuth % (2 * np.pi))
    order = np.argsort(turn, kind="stable")
    x, y = turn[order], above[order]
    x, y = np.concatenate([x[-1:] - 360, x, x[:1] + 360]), np.concatenate([y[-1:], y, y[:1]])
    floor = min(0.0, float(y.min())) - 0.28 * max(float(np.ptp(y)), 1e-6)
    roof = float(y.max()) + 0.45 * max(float(np.ptp(y)), 1e-6)
    axes.fill_between(x, floor, y, color=style.ORANGE, alpha=0.22, lw=0)
    axes.plot(x, y, color="#6b4a1f", lw=1.8)
    axes.axhline(0.0, color=style.INK, lw=0.9, ls=(0, (5, 3)))
    thick = 6.0
    for k, blade in enumerate(np.degrees(story.blades) % 360):
        for shift in (0.0, 360.0):
            left = blade + shift - thick
            axes.fill(
                [left, left + thick, left + thick, left],
                [0, 0, roof, roof],
                color=style.GREY,
                alpha=0.85,
                lw=0,
                zorder=4,
            )
        axes.text(blade + 1.5, 0.93 * roof, f"{k + 1}", va="top", weight="bold", zorder=5)
    axes.annotate(
        "turning",
        (0.985, 0.86),
        (0.90, 0.86),
        xycoords="axes fraction",
        textcoords="axes fraction",
        va="center",
        fontsize=11,
        arrowprops={"arrowstyle": "-|>", "color": style.VERMILION, "lw": 2},
        color=style.VERMILION,
        zorder=6,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 2},
    )
    axes.set_xlim(0, 360)
    axes.set_ylim(floor, roof)
    axes.set_xticks(np.arange(0, 361, 30))
    axes.set_xlabel("angle on the bit, from its first blade (degrees)")
    axes.set_ylabel("rock above\nthe face (mm)")
    arc = 2 * math.pi * story.bit_radius * 1e3
    axes.set_title(f"Unrolled: {arc:.0f} mm around, steps of {style.number(float(np.ptp(above)), 2)} mm")


def passage(figure: Figure, story: Story, index: int) -> None:
    """The profile behind one blade over the last saved times: what the next blade will meet."""
    part = finest_window(story.times, 3.0)
    chosen = [i for i in range(len(story.times))[part] if story.rock(i) is not None]
    if len(chosen) < 3:
        return
    axes = figure.add_axes((0.545, 0.375, 0.365, 0.49))
    reference = story.rock(index)
    assert reference is not None
    angle = np.linspace(float(reference[0][0]), float(reference[0][-1]), 90)
    rows = []
    for i in chosen:
        a, d = story.rock(i) or reference
        face = story.at("bit_depth", float(story.times[i]))
        rows.append(1e3 * ((float(d.max()) if face is None else face) - np.interp(angle, a, d)))
    image = axes.pcolormesh(
        np.degrees(angle),
        story.times[chosen],
        np.array(rows),
        cmap="cividis",
        shading="gouraud",
        rasterized=True,
    )
    axes.grid(False)
    axes.set_xlabel("angle behind the blade (degrees)")
    axes.set_ylabel("time (s)")
    axes.set_title("The rock behind a blade over time")
    box = axes.get_position()
    bar = figure.colorbar(image, cax=figure.add_axes((box.x1 + 0.012, box.y0 + 0.06, 0.012, box.height - 0.12)))
    bar.set_label("rock above the bit's face (mm)")
    bar.outline.set_visible(False)
