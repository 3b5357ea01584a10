"""What torque and drag say: a table, a chart, and the numbers as CSV and NetCDF."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ..models.soft_string import Line
from ..render import style
from ..results.atomic import replacing
from .limits import Limits
from .operation import F8, Profile, deepest, stretches

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {
    "rotating": style.INK,
    "tripping-out": style.VERMILION,
    "tripping-in": style.BLUE,
    "drilling": style.ORANGE,
    "sliding": style.GREEN,
}
#: lines of methods beside the soft string
DASHES: dict[str, Any] = {"soft": "-", "stiff": (0, (6, 2)), "stations": (0, (1, 1.5))}


@dataclass(frozen=True)
class Broomstick:
    """Hook load over the depth of the bit, for an operation."""

    name: str
    depth: F8  # (n,) m
    hook_load: F8  # (n,) N


@dataclass(frozen=True)
class Study:
    """All that was computed for a scene. ``profiles`` by method, operations in the same order in each."""

    title: str
    line: Line
    profiles: dict[str, list[Profile]]
    limits: Limits
    broomsticks: list[Broomstick]
    notes: list[str]

    @property
    def first(self) -> list[Profile]:
        """Profiles of the first method."""
        return next(iter(self.profiles.values()))


def buckled(profile: Profile, found: Limits) -> list[tuple[str, list[tuple[float, float]]]]:
    """Stretches (measured depths in m) where the compression exceeds a limit: "helix" or only "sine"."""
    push = -profile.tension
    low, high = (np.interp(profile.measured_depth, found.measured_depth, x) for x in (found.sinusoidal, found.helical))
    parts = [("helix", push > high), ("sine", (push > low) & (push <= high))]
    named = [(name, stretches(profile.measured_depth, inside)) for name, inside in parts]
    return [(name, pieces) for name, pieces in named if pieces]


def buckling_text(profile: Profile, found: Limits) -> str:
    """Where a profile is buckled, in words; a dash for nowhere."""
    parts = buckled(profile, found)
    if not parts:
        return "-"
    return ", ".join(f"{name} {min(a for a, _ in p):.0f}-{max(b for _, b in p):.0f} m" for name, p in parts)


def print_table(study: Study, console: Console | None = None) -> None:
    """Hook load, torque at the top, largest side force and buckling of every operation; a line for each method."""
    several = len(study.profiles) > 1
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    table.add_column("", no_wrap=True)
    if several:
        table.add_column("", no_wrap=True)
    for quantity in ("hook load\nkN", "torque\nkN m", "side force\nup to kN/m", "at\nm"):
        table.add_column(quantity, justify="right", no_wrap=True)
    table.add_column("buckling")
    for k, first in enumerate(study.first):
        for method, profiles in study.profiles.items():
            p = profiles[k]
            force, depth = deepest(p, p.side_force)
            cells = [escape(first.operation.title) if p is first else "", *([method] if several else [])]
            if np.isnan(p.hook_load):  # no equilibrium found
                table.add_row(*cells, *5 * ["-"])
                continue
            cells += [f"{p.hook_load / 1e3:.1f}", f"{p.surface_torque / 1e3:.2f}" if p.operation.spin else "-"]
            table.add_row(*cells, f"{force / 1e3:.2f}", f"{depth:.0f}", buckling_text(p, study.limits))
    console = console or Console(width=None if Console().is_terminal else 100)
    console.print(table)
    for note in study.notes:
        console.print(note, markup=False, highlight=False, soft_wrap=True)


def dataset(study: Study) -> xr.Dataset:
    """All profiles over (model, operation, measured_depth), on the depths of the first method; SI units."""
    first = study.first
    depth = first[0].measured_depth
    names = [p.operation.name for p in first]

    def along(name: str) -> Any:
        rows = [
            [np.interp(depth, p.measured_depth, getattr(p, name)) for p in profiles]
            for profiles in study.profiles.values()
        ]
        return np.array(rows)

    data = xr.Dataset(coords={"model": list(study.profiles), "operation": names})
    data["measured_depth"] = ("measured_depth", depth, {"units": "m"})
    over = ("model", "operation", "measured_depth")
    for name, units in (("tension", "N"), ("torque", "N m"), ("side_force", "N/m")):
        data[name] = (over, along(name), {"units": units})
    for name in ("sinusoidal", "helical", "wound_up"):
        load = np.interp(depth, study.limits.measured_depth, getattr(study.limits, name))
        data[f"{name}_limit"] = ("measured_depth", load, {"units": "N", "long_name": "compression"})
    for name, attribute in (("weight_on_bit", "N"), ("torque_on_bit", "N m")):
        loads = [getattr(p.operation, name) for p in first]
        data[name] = ("operation", loads, {"units": attribute})
    frame = study.line.hole.frame(depth)
    data["inclination"] = ("measured_depth", frame.inclination, {"units": "rad"})
    data["azimuth"] = ("measured_depth", frame.azimuth, {"units": "rad"})
    data["vertical_depth"] = ("measured_depth", frame.position[:, 2], {"units": "m"})
    data.attrs["title"] = study.title
    return data


def write_csv(study: Study, path: Path) -> None:
    """One row per method, operation and depth: what a spreadsheet wants."""
    with replacing(path) as part, open(part, "w", newline="", encoding="utf-8") as file:
        out = csv.writer(file)
        head = ["method", "operation", "measured_depth_m", "tension_N", "torque_Nm", "side_force_N_per_m"]
        out.writerow([*head, "sinusoidal_limit_N", "helical_limit_N"])
        for method, profiles in study.profiles.items():
            for p in profiles:
                low, high = (
                    np.interp(p.measured_depth, study.limits.measured_depth, x)
                    for x in (study.limits.sinusoidal, study.limits.helical)
                )
                for row in zip(p.measured_depth, p.tension, p.torque, p.side_force, low, high, strict=True):
                    out.writerow([method, p.operation.name, *(f"{x:.8g}" for x in row)])


# -- chart ----------------------------------------------------------------------------------------------------
def _panel(figure: Figure, left: float, width: float, title: str, label: str, length: float, first: bool) -> Axes:
    axes = figure.add_axes((left, 0.075, width, 0.715))
    axes.set_title(title, pad=8)
    axes.set_xlabel(label)
    axes.set_ylim(length, 0.0)
    if first:
        axes.set_ylabel("measured depth (m)")
    else:
        axes.tick_params(labelleft=False)
    return axes


def draw(study: Study, path: Path) -> Path:
    """Hole, tension, torque, side force along the string, and hook load over the depth of the bit."""
    from matplotlib.lines import Line2D

    line, length = study.line, study.line.length
    with style.page(1900, 1050) as figure:
        methods = list(study.profiles)
        words = f"{length:,.0f} m of string".replace(",", "\u2009")
        words += (
            f"   \u00b7   {', '.join(methods)}-string" if methods == ["soft"] else f"   \u00b7   {', '.join(methods)}"
        )
        style.heading(figure, f"{study.title}: torque and drag", words)
        widths, gap = (0.115, 0.225, 0.175, 0.18, 0.16), 0.02
        lefts = [0.05]
        for width in widths[:-1]:
            lefts.append(lefts[-1] + width + gap)
        hole, pull, twist, side, hook = (
            _panel(figure, x, w, title, label, length, i == 0)
            for i, (x, w, title, label) in enumerate(
                zip(
                    lefts,
                    widths,
                    ("Hole", "Tension", "Torque", "Side force", "Hook load"),
                    ("degrees", "kN", "kN m", "kN/m", "kN, with the bit at this depth"),
                    strict=True,
                )
            )
        )
        _hole(hole, line)
        depth, limit = study.limits.measured_depth, study.limits
        pull.fill_betweenx(
            depth, -limit.helical / 1e3, -limit.sinusoidal / 1e3, color=style.PURPLE, alpha=0.22, lw=0, zorder=1
        )
        pull.fill_betweenx(depth, -1e6, -limit.helical / 1e3, color=style.PURPLE, alpha=0.42, lw=0, zorder=1)
        turning = False
        for method, profiles in study.profiles.items():
            for p in profiles:
                colour, dash = COLOURS[p.operation.name], DASHES.get(method, "-")
                look = {"color": colour, "ls": dash, "lw": 1.9}
                pull.plot(p.tension / 1e3, p.measured_depth, **look)
                for kind, pieces in buckled(p, limit):
                    for a, b in pieces:
                        at = np.linspace(a, b, 200)
                        here = np.interp(at, p.measured_depth, p.tension) / 1e3
                        wide = {"helix": 9.0, "sine": 5.0}[kind]
                        pull.plot(here, at, color=style.PURPLE, lw=wide, alpha=0.75, zorder=1.5)
                side.plot(p.side_force / 1e3, p.measured_depth, **look | {"lw": 1.2})
                if p.operation.spin:
                    turning = True
                    twist.plot(p.torque / 1e3, p.measured_depth, **look)
        for stick in study.broomsticks:
            hook.plot(stick.hook_load / 1e3, stick.depth, color=COLOURS[stick.name], lw=1.9)
        _range(pull, [p.tension for ps in study.profiles.values() for p in ps])
        pull.axvline(0.0, color=style.GREY, lw=0.9)
        if not turning:
            twist.text(0.5, 0.5, "nothing turns", transform=twist.transAxes, ha="center", color=style.GREY)
        twist.set_xlim(left=0.0)
        _side_range(side, [p for ps in study.profiles.values() for p in ps if not np.isnan(p.hook_load)])
        if study.broomsticks:
            _range(hook, [b.hook_load for b in study.broomsticks])
            hook.axvline(0.0, color=style.GREY, lw=0.9)
        _values(study, pull, twist)
        handles: list[Any] = [
            Line2D([], [], color=COLOURS[p.operation.name], lw=2.6, label=p.operation.title) for p in study.first
        ]
        if len(methods) > 1:
            handles += [Line2D([], [], color=style.GREY, ls=DASHES.get(m, "-"), lw=1.9, label=m) for m in methods]
        from matplotlib.patches import Patch

        handles += [
            Patch(color=style.PURPLE, alpha=0.22, lw=0, label="buckles: sine"),
            Patch(color=style.PURPLE, alpha=0.42, lw=0, label="buckles: helix"),
        ]
        figure.legend(
            handles=handles, loc="upper left", bbox_to_anchor=(0.043, 0.905), ncols=len(handles), columnspacing=1.8
        )
        return style.save(figure, path)


def _side_range(axes: Axes, profiles: Sequence[Profile]) -> None:
    """Range of the side force; the few metres where a rod bears on its stabilisers do not set it."""
    axes.set_xlim(left=0.0)
    ranges = [float(np.quantile(p.side_force, 0.98 if p.method == "stiff" else 1.0)) for p in profiles]
    largest = max((float(p.side_force.max()) for p in profiles), default=0.0)
    if profiles and 0 < 2 * max(ranges) < largest:
        axes.set_xlim(right=1.1e-3 * max(ranges))
        axes.annotate(
            f"up to {largest / 1e3:.1f}",
            (0.97, 0.06),
            xycoords="axes fraction",
            ha="right",
            color=style.GREY,
            fontsize=9,
        )


def _hole(axes: Axes, line: Line) -> None:
    """Inclination over depth, with dogleg severity as a shade, joints of the string and changes of the wall."""
    s: F8 = np.linspace(0.0, line.length, 1500, dtype=np.float64)
    frame = line.hole.frame(s)
    bend = np.degrees(frame.dogleg_severity) * 30
    axes.plot(np.degrees(frame.inclination), s, color=style.INK, lw=1.9)
    top = max(float(np.degrees(frame.inclination).max()) * 1.08, 5.0)
    if bend.max() > 1e-6:
        scale = 0.8 * top / float(bend.max())
        axes.fill_betweenx(s, 0.0, scale * bend, color=style.SKY, alpha=0.55, lw=0)
        worst = int(bend.argmax())
        axes.annotate(
            f"bend, up to\n{style.number(float(bend[worst]), 2)}\u00b0/30 m",
            (scale * bend[worst], s[worst]),
            xytext=(0.97, 0.985),
            textcoords="axes fraction",
            ha="right",
            va="top",
            fontsize=9.5,
            color="#20759b",
        )
    axes.set_xlim(0.0, top)
    table = line.hole.table
    for depth in np.unique(np.round(table.friction_at[1:-1])):
        if 0 < depth < line.length:
            axes.axhline(depth, color=style.GREY, lw=0.9, ls=(0, (5, 3)))
    for depth in line.joints[1:-1]:
        axes.axhline(depth, color=style.FAINT, lw=0.9)


def _range(axes: Axes, values: Sequence[F8]) -> None:
    """Room around loads in N on an axis in kN; those that were not found count for nothing."""
    values = [v for v in values if not np.isnan(v).any()]
    low, high = (1e-3 * x for x in (min(float(v.min()) for v in values), max(float(v.max()) for v in values)))
    room = 0.06 * max(high - low, 1e-9)
    axes.set_xlim(min(low, 0.0) - room, high + 2 * room)


def _values(study: Study, pull: Axes, twist: Axes) -> None:
    """Hook loads and torques at the top, written where the lines begin."""
    for axes, name, digits, scale in ((pull, "hook_load", 0, 1e-3), (twist, "surface_torque", 1, 1e-3)):
        found = [p for p in study.first if axes is pull or p.operation.spin]
        row = 0.012
        for p in sorted(found, key=lambda p: -getattr(p, name)):
            value = scale * getattr(p, name)
            axes.text(
                0.975,
                row,
                f"{value:.{digits}f}",
                transform=axes.transAxes,
                color=COLOURS[p.operation.name],
                ha="right",
                va="bottom",
                weight="bold",
                fontsize=11,
            )
            row += 0.03
        if found:
            axes.text(0.975, row, "at the top", transform=axes.transAxes, ha="right", color=style.GREY, fontsize=9.5)
