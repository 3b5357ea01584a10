"""Holes: what the table of one is off by, what a search of the closest point costs, how a survey is made smooth.

Writes docs/boreholes.md and its pictures in less than a minute of one core.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from common import DOCS, processor_seconds, table

from drillfem.boreholes import (
    BEYOND,
    Borehole,
    arc,
    build,
    closest,
    departure,
    find,
    helix,
    project,
    read_survey,
    spline,
    straight,
    survey,
)
from drillfem.boreholes.profile import STEEPEST, friction_profile, radius_profile
from drillfem.boreholes.survey import TRANSITION, Arcs
from drillfem.boreholes.table import LONGEST, TOLERANCE, hermite
from drillfem.render import style

Array = npt.NDArray[np.float64]
WIDE = {"diameter": 0.2159}
STATIONS = read_survey(find("p11-a-02"))
REAL = survey(STATIONS, **WIDE)
HOLES: dict[str, tuple[str, Borehole]] = {
    "straight": ("30 deg towards north-east", straight(1500, math.pi / 6, math.pi / 4, **WIDE)),
    "arc": ("radius 573 m", arc(850, 573, 0.0, math.pi / 6, **WIDE)),
    "build": ("well A, 60 m transition", build(2500, 1500, 572.96, math.pi / 3, 0.0, 0.0, 60, **WIDE)),
    "helix": ("radius 20 m, 400 m per turn", helix(1500, 20, 400, **WIDE)),
    "spline": (
        "six points",
        spline([[0, 0, 0], [0, 0, 400], [60, 20, 800], [300, 150, 1100], [700, 250, 1250], [1100, 200, 1260]], **WIDE),
    ),
    "survey": ("P11-A-02, 91 stations", REAL),
}


def per_30(bend: Array | float) -> Any:
    """Curvature (1/m) as dogleg severity in deg per 30 m."""
    return np.degrees(bend) * 30


# -- the table ------------------------------------------------------------------------------------------------------


class Exact(NamedTuple):
    """A curve in closed form: measured depth (m,) to position, tangent, curvature (m, 3)."""

    name: str
    hole: Borehole
    curve: Callable[[Array], tuple[Array, Array, Array]]


def circle(radius: float) -> Callable[[Array], tuple[Array, Array, Array]]:
    """Arc from the vertical towards north."""

    def at(p: Array) -> tuple[Array, Array, Array]:
        s, c, o = np.sin(p / radius), np.cos(p / radius), np.zeros_like(p)
        r = radius * np.stack([2 * np.sin(p / radius / 2) ** 2, o, s], axis=1)
        return r, np.stack([s, o, c], axis=1), np.stack([c, o, -s], axis=1) / radius

    return at


def screw(radius: float, pitch: float) -> Callable[[Array], tuple[Array, Array, Array]]:
    """Helix about the vertical."""
    psi = math.atan2(2 * math.pi * radius, pitch)
    level, down = math.sin(psi), math.cos(psi)
    rate = level / radius

    def at(p: Array) -> tuple[Array, Array, Array]:
        s, c, one = np.sin(rate * p), np.cos(rate * p), np.ones_like(p)
        r = np.stack([radius * s, radius * (1 - c), down * p], axis=1)
        return r, np.stack([level * c, level * s, down * one], axis=1), level * rate * np.stack([-s, c, 0 * p], axis=1)

    return at


def tables() -> str:
    """Pieces and errors of tables against closed forms."""
    exact = [
        Exact("arc, radius 573 m", arc(850, 573, **WIDE), circle(573)),
        Exact("arc, radius 30 m", arc(45, 30, **WIDE), circle(30)),
        Exact("helix, 20 m, 400 m per turn", helix(1500, 20, 400, **WIDE), screw(20, 400)),
        Exact("helix, 5 m, 20 m per turn", helix(300, 5, 20, **WIDE), screw(5, 20)),
    ]
    rows = []
    for name, hole, curve in exact:
        p = np.linspace(0, hole.length, 50_001)
        found, (r, t, k) = hole.frame(p), curve(p)
        errors = [np.linalg.norm(a - b, axis=1).max() for a, b in zip(found[:3], (r, t, k), strict=True)]
        unit = np.abs(np.linalg.norm(found.tangent, axis=1) - 1).max()
        pieces = len(hole.table.knots) - 1
        rows.append([name, str(pieces), f"{hole.length / pieces:.3g}", *(f"{e:.1e}" for e in (*errors, unit))])
    return table(
        ["hole", "pieces", "length (m)", "position (m)", "tangent", "curvature (1/m)", "\\|dr/dp\\| − 1"], rows
    )


def order() -> str:
    """Fitted order of position, tangent and curvature on even pieces of a helix."""
    curve, sizes, errors = screw(20, 100), np.array([8, 16, 32, 64]), []
    for n in sizes:
        knots = np.linspace(0, 400, n + 1)
        r, t, k = curve(knots)
        a = hermite(knots, r, t, np.stack([k[:-1], k[1:]], axis=1))
        x = np.linspace(0, 400 / n, 41)[None, :, None]
        at = (knots[:-1, None] + x[..., 0]).ravel()
        powers = [
            sum(a[:, None, j] * x**j for j in range(6)),
            sum(j * a[:, None, j] * x ** (j - 1) for j in range(1, 6)),
            sum(j * (j - 1) * a[:, None, j] * x ** (j - 2) for j in range(2, 6)),
        ]
        errors.append([np.abs(f.reshape(-1, 3) - e).max() for f, e in zip(powers, curve(at), strict=True)])
    fit = -np.polyfit(np.log(sizes), np.log(np.array(errors)), 1)[0]
    return f"{fit[0]:.2f}, {fit[1]:.2f} and {fit[2]:.2f}"


# -- the closest point ----------------------------------------------------------------------------------------------


def search() -> str:
    """Cost of the local search, of all that the wall tells, and of the global search, per point of a string."""
    rng, cells, points = np.random.default_rng(0), 500, 4
    s = np.linspace(0, 2680, 3 * cells + 1)
    frame = REAL.frame(s)
    n = rng.normal(size=frame.position.shape)
    n -= np.einsum("ic,ic->i", n, frame.tangent)[:, None] * frame.tangent
    u = np.zeros((len(s), 13))
    u[:, :3] = frame.position + 0.04 * n / np.linalg.norm(n, axis=1)[:, None]
    nodes = (3 * np.arange(cells)[:, None] + np.arange(4)).astype(np.int32)
    x, on = (np.polynomial.legendre.leggauss(points)[0] + 1) / 2, np.linspace(0, 1, 4)
    basis = np.array([[np.prod([(a - b) / (c - b) for b in on if b != c]) for c in on] for a in x])
    wall = REAL.with_friction(0.3, 0.15).table
    start = ((np.arange(cells)[:, None] + x) * 2680 / cells).ravel()
    radius, out, total = np.full(cells, 0.0635), np.zeros((cells * points, 14)), cells * points
    r = np.einsum("qn,cnk->cqk", basis, u[nodes][:, :, :3]).reshape(-1, 3)
    exact = REAL.nearest(r)
    rows, flat = [], u.ravel()
    moved = flat + 1e-3 * rng.normal(size=flat.shape)
    p = start.copy()

    def step(v: Array) -> None:
        project(v, 13, nodes, basis, radius, wall, p, out)

    def both() -> None:
        step(moved)
        step(flat)

    both()
    assert np.abs(p - exact).max() < 1e-8
    costs = {
        "positions, closest points and the wall's numbers; the string has moved by 1 mm": processor_seconds(both) / 2,
        "the same, the string where it was": processor_seconds(lambda: step(flat)),
        "closest points alone, from starts up to 15 m away": processor_seconds(
            lambda: closest(wall, r, exact + 15 * np.sin(np.arange(total)))
        ),
        "search of the whole hole (`Borehole.nearest`)": processor_seconds(lambda: REAL.nearest(r)),
    }
    first = next(iter(costs.values()))
    for name, seconds in costs.items():
        rows.append([name, f"{1e9 * seconds / total:.0f}", f"{seconds / first:.2g}"])
    return table(["per point of a string of 2680 m, 2000 points", "ns", "ratio"], rows)


# -- surveys --------------------------------------------------------------------------------------------------------


class Line(NamedTuple):
    """A centreline through the stations, at measured depths, beside the path of minimum curvature."""

    name: str
    bend: Array  # (m,) curvature, 1/m
    away: Array  # (m,) distance from the path, m


def centrelines(p: Array) -> list[Line]:
    """Ways to make the path of minimum curvature smooth, at measured depths p (m,)."""
    arcs = Arcs(STATIONS)
    path, _ = arcs.frame(p)
    i = np.clip(np.searchsorted(arcs.at, p, side="right") - 1, 0, len(arcs.at) - 2)
    lines = [Line("arcs (minimum curvature)", arcs.curvature[i], np.zeros_like(p))]
    through = spline(arcs.position, **WIDE)
    q = through.nearest(path)
    lines.append(Line("cubic spline through the positions", through.frame(q).dogleg_severity, _far(through, path, q)))
    # quintics that keep position and direction of every station, with the mean of the curvatures around
    vector = arcs.curvature[:, None] * arcs.normal
    end = vector * np.cos(arcs.turn)[:, None] - (arcs.curvature * np.sin(arcs.turn))[:, None] * arcs.tangent[:-1]
    mean = np.vstack([vector[:1], (end[:-1] + vector[1:]) / 2, end[-1:]])
    a = hermite(arcs.at, arcs.position, arcs.tangent, np.stack([mean[:-1], mean[1:]], axis=1))[i]
    x = (p - arcs.at[i])[:, None]
    r = sum(a[:, j] * x**j for j in range(6))
    t = sum(j * a[:, j] * x ** (j - 1) for j in range(1, 6))
    k = sum(j * (j - 1) * a[:, j] * x ** (j - 2) for j in range(2, 6))
    bend = np.linalg.norm(np.cross(t, k), axis=1) / np.linalg.norm(t, axis=1) ** 3
    lines.append(Line("quintics that keep the directions too", bend, np.linalg.norm(r - path, axis=1)))
    for width in (2.5, TRANSITION, 10.0, 30.0):
        hole = REAL if width == TRANSITION else survey(STATIONS, width, **WIDE)
        name = f"chord of {width:g} m{' (default)' if width == TRANSITION else ''}"
        lines.append(Line(name, hole.frame(p).dogleg_severity, _far(hole, path, hole.nearest(path))))
    return lines


def _far(hole: Borehole, r: Array, p: Array) -> Array:
    return np.asarray(np.linalg.norm(r - hole.frame(p).position, axis=1))


def smoothing(lines: list[Line], p: Array) -> str:
    """What each centreline does to the dogleg, and how far it leaves the path."""
    rows = []
    arcs = lines[0].bend
    # the arcs around: within half of the widest chord, or between the same stations
    step = round(15 / (p[1] - p[0]))
    around = np.array([arcs[max(0, j - step) : j + step + 1].max() for j in range(len(p))])
    for line in lines:
        rise = np.abs(np.diff(line.bend)).max() / (p[1] - p[0])
        more = float(per_30((line.bend - around).max()))
        rows.append(
            [
                line.name,
                f"{per_30(line.bend.max()):.3f}",
                f"{more:.2f}" if more > 1e-3 else "0",
                "jumps" if line is lines[0] else f"{per_30(rise):.2f}",
                f"{1e3 * line.away.max():.1f}",
            ]
        )
    header = [
        "centreline",
        "greatest dogleg (deg/30 m)",
        "more than any arc within 15 m",
        "its rise (per m)",
        "off (mm)",
    ]
    return table(header, rows)


# -- pictures -------------------------------------------------------------------------------------------------------


def kinds_picture() -> None:
    """Plan, vertical section and dogleg of every kind."""
    width, row = 1500, 350
    height = row * len(HOLES) + 110
    with style.page(width, height) as figure:
        style.heading(figure, "Six kinds of hole", "each in plan, in vertical section, and its dogleg along the hole")
        for n, (kind, (said, hole)) in enumerate(HOLES.items()):
            bottom = (height - 95 - row * (n + 1) + 75) / height
            plan, section, dogleg = (
                figure.add_axes((left / width, bottom, wide / width, (row - 115) / height))
                for left, wide in ((110, 360), (580, 360), (1050, 400))
            )
            p = np.linspace(0, hole.length, 4001)
            f = hole.frame(p)
            north, east, down = f.position.T
            towards = math.atan2(east[-1], north[-1])
            level = north * math.cos(towards) + east * math.sin(towards)
            plan.plot(east, north, color=style.BLUE)
            plan.plot(0, 0, "o", color=style.INK, markersize=5)
            plan.set(xlabel="east (m)", ylabel="north (m)", title=f"{kind}: {said}")
            plan.set_aspect("equal", adjustable="datalim")
            section.plot(level, down, color=style.BLUE)
            section.plot(0, 0, "o", color=style.INK, markersize=5)
            section.invert_yaxis()
            section.set_aspect("equal", adjustable="datalim")
            section.set(xlabel=f"towards {math.degrees(towards) % 360:.0f} deg (m)", ylabel="depth (m)")
            dogleg.fill_between(p, per_30(f.dogleg_severity), color=style.SKY, alpha=0.35, linewidth=0)
            dogleg.plot(p, per_30(f.dogleg_severity), color=style.BLUE, linewidth=1.1)
            if hole.stations is not None:
                at = hole.stations[:, 0]
                dogleg.plot(at, np.full_like(at, 0.02), "|", color=style.INK, transform=dogleg.get_xaxis_transform())
            dogleg.set(xlabel="measured depth (m)", ylabel="deg/30 m", xlim=(0, hole.length))
            dogleg.set_ylim(0, max(1.0, 1.15 * per_30(f.dogleg_severity.max())))
        style.save(figure, DOCS / "img" / "boreholes-kinds.png")


def survey_picture(lines: list[Line], p: Array) -> None:
    """Dogleg and distance of the smooth centrelines around the sharpest bend."""
    colours = {0: style.INK, 1: style.ORANGE, 2: style.VERMILION, 4: style.BLUE, 6: style.GREEN}
    with style.page(1500, 860) as figure:
        style.heading(
            figure,
            "Curvature that does not jump, and does not ring",
            "P11-A-02 around its sharpest bend: ways to join the arcs of minimum curvature",
        )
        top, bottom = figure.add_axes((0.06, 0.46, 0.7, 0.42)), figure.add_axes((0.06, 0.09, 0.7, 0.28))
        for i, colour in colours.items():
            line = lines[i]
            top.plot(p, per_30(line.bend), color=colour, linewidth=2.2 if i == 4 else 1.3, label=line.name)
            if i:
                bottom.semilogy(p, 1e3 * np.maximum(line.away, 1e-7), color=colour, linewidth=2.0 if i == 4 else 1.2)
        at = STATIONS[:, 0]
        for axes in (top, bottom):
            axes.plot(at, np.full_like(at, 0.03), "|", color=style.INK, transform=axes.get_xaxis_transform())
            axes.set_xlim(1200, 1460)
        top.set(ylabel="dogleg (deg/30 m)", ylim=(0, 8.2), title="dogleg")
        bottom.set(xlabel="measured depth (m); ticks: stations", ylabel="mm", ylim=(1e-2, 1e3))
        bottom.set_title("distance from the arcs")
        figure.legend(*top.get_legend_handles_labels(), loc="upper left", bbox_to_anchor=(0.775, 0.88))
        style.save(figure, DOCS / "img" / "boreholes-survey.png")


def wall_picture() -> None:
    """Radius and friction of a cased hole with a wash-out."""
    rng, measured = np.random.default_rng(4), np.arange(520.0, 548.0, 0.3)
    wash = 0.2159 + 0.004 * rng.normal(size=len(measured)) ** 2
    wash += 0.11 * ((measured > 530) & (measured < 537.5)) * (1 + 0.15 * np.sin(3 * measured))
    caliper = np.stack([measured, wash], axis=1)
    at, radius = radius_profile(560, 0.2159, [(512, 0.2445), (560, None)], caliper)
    depth, friction = friction_profile(560, 0.3, 0.2, [(512, 0.2, 0.12), (560, None, None)])
    with style.page(1500, 620) as figure:
        style.heading(
            figure,
            "The wall: casing, open hole and a wash-out",
            f"radius may change by {STEEPEST:g} per metre at most; steps are cut into the wider side",
        )
        top, bottom = figure.add_axes((0.06, 0.42, 0.9, 0.4)), figure.add_axes((0.06, 0.12, 0.9, 0.2))
        top.plot(measured, 500 * wash, ".", color=style.VERMILION, markersize=5, label="caliper log")
        top.plot([500, 512, 512, 520], [122.25, 122.25, 107.95, 107.95], color=style.GREY, label="sections")
        p = np.linspace(500, 555, 5000)
        top.plot(p, 1e3 * np.interp(p, at, radius), color=style.BLUE, linewidth=2, label="radius of the hole")
        top.set(ylabel="radius (mm)", xlim=(500, 555))
        top.legend(loc="upper left", ncols=3)
        for column, (name, colour) in enumerate((("static", style.BLUE), ("dynamic", style.SKY))):
            bottom.plot(p, np.interp(p, depth, friction[:, column]), color=colour, label=name)
        bottom.set(xlabel="measured depth (m)", ylabel="friction", xlim=(500, 555), ylim=(0, 0.36))
        bottom.legend(loc="lower right", ncols=2)
        style.save(figure, DOCS / "img" / "boreholes-wall.png")


def main() -> None:
    """Measure, draw and write the page."""
    p = np.arange(0.05, REAL.length, 0.1)
    lines = centrelines(p)
    kinds_picture()
    survey_picture(lines, p)
    wall_picture()
    bend, where = REAL.sharpest()
    depth, near = departure(REAL)
    text = TEXT.format(
        tables=tables(),
        order=order(),
        search=search(),
        smoothing=smoothing(lines, p),
        tolerance=f"{TOLERANCE:g}",
        longest=f"{LONGEST:g}",
        beyond=f"{BEYOND:g}",
        transition=f"{TRANSITION:g}",
        steepest=f"{STEEPEST:g}",
        stations=len(STATIONS),
        end=f"{REAL.length:g}",
        inclination=f"{math.degrees(STATIONS[-1, 1]):.2f}",
        vertical=f"{Arcs(STATIONS).position[-1, 2]:.2f}",
        sharpest=f"{per_30(bend):.2f}",
        where=f"{where:.0f}",
        depth=f"{1e3 * depth:.1f}",
        near=f"{1e3 * near:.1f}",
    )
    (DOCS / "boreholes.md").write_text(text, encoding="utf-8")
    print(text)


TEXT = """\
# Boreholes

Written by `benchmarks/boreholes.py`.

A hole is a centreline with a radius and a friction along it. It starts at the origin and goes down: e1 is north, e2
east, e3 down; azimuth turns from north to east, inclination from the vertical. p is measured depth, the length
along the hole: |dr/dp| = 1.

| `hole.kind` | needs | what it is |
| --- | --- | --- |
| `straight` | | a line, inclined by `inclination` towards `azimuth` |
| `arc` | `radius` | an arc of a circle that builds inclination from its top |
| `build` | `kick_off`, `radius`, `final_inclination` | straight, arc, straight; `transition`: clothoids between them |
| `helix` | `radius`, `pitch` | about a vertical axis, to the right; starts towards `azimuth` |
| `spline` | `points` | natural cubic spline through points (north, east, down) |
| `survey` | `survey` | minimum curvature through stations, its curvature made continuous |

![six kinds of hole](img/boreholes-kinds.png)

```python
from drillfem.boreholes import build, find, read_survey, survey

well_a = build(2500, kick_off=1500, radius=572.96, final_inclination=1.0472, diameter=0.2159)
real = survey(read_survey(find("p11-a-02")), diameter=0.2159)
frame = real.frame([1000.0, 2000.0])  # position, tangent, curvature, inclination, azimuth, dogleg_severity, radius
```

## One table for all kinds

Every kind gives its unit tangent and curvature as functions of p; position follows by Gauss quadrature. What the
solvers read is a table of quintics in p: each has the position, tangent and curvature of the hole at its two ends,
so that the whole is C2 wherever the hole is (a `build` without `transition` is not: there the curvature jumps, as
that hole does). Pieces are halved until the tangent is right to {tolerance} within them, and are at most {longest}
m long. Against closed forms:

{tables}

Fitted orders of position, tangent and curvature on even pieces of a helix: {order}; Hermite's quintics promise 6, 5
and 4.

Beyond its ends a hole goes on straight, as wide and as rough as it ends.

## Surveys

`hole.survey` is the name of a text file (or of a built-in survey, `p11-a-02`), or rows of measured depth (m),
inclination and azimuth (rad). In a file:

- columns are found by name (`MD`, `DEPTH`, `Measured Depth`; `INC`, `INCL`, `DEVI`; `AZI`, `AZIM`, ...), in any
  order among others, separated by comma, semicolon, tab, bar or blanks; a file of three columns of numbers needs no
  header. With semicolons or tabs decimals may have commas. Lines that start with `#`, `//`, `!`, `%` or `~`, and
  empty ones, are passed over.
- units stand behind the name (`MD (ft)`, `inc_deg`, `Azi [°]`) or in a line below the names. Without one, depths
  are metres, and refused beyond 16 km; angles are degrees if one is too large for radians, and else refused: a file
  that could be either has to say it.
- depths must increase, inclinations lie from 0 to 180 deg, azimuths within a turn. A first station below the
  surface must be vertical, and the hole is vertical above it.

What is wrong is said in one line with file, line, column and what is allowed; the exit code is 2.

Between stations runs an arc of a circle (minimum curvature; station positions by the library
[wellpathpy](https://github.com/Zabamund/wellpathpy), the same as welleng's to 1e-6 m). Its curvature jumps at every
station, and with it the bending moment of a string that lies in it. No smooth line goes through all stations in
their directions without bending more than the arcs in between: the mean bend between two stations is that of the
arc, so if it is less at the ends it is more elsewhere, and lines through the positions alone ring. So the smooth
hole gives way by millimetres instead, far less than a survey knows: its direction at p is that of the chord of the
arcs from p − {half} m to p + {half} m. Its curvature is then a mean of those around, which passes from one arc to
the next within {transition} m and is never more than theirs. `transition` sets the length. On the real well:

{smoothing}

![dogleg of smooth centrelines](img/boreholes-survey.png)

P11-A-02 ({stations} stations to {end} m, {inclination} deg at the end, {vertical} m deep there) has its sharpest
bend, {sharpest} deg/30 m, at {where} m. Its smooth hole is at most {depth} mm from the arcs at the same measured
depth, {near} mm at the nearest point; the distance grows with the square of the transition.

## The wall

`diameter` holds everywhere but where `[[hole.section]]` says otherwise: sections follow each other from the top,
each to its measured depth `to`, with `diameter`, `friction_static`, `friction_dynamic`; below the last one
they are those of the scene. `caliper` is a log (file with measured depth and diameter, or rows in m) that replaces
them where it reaches;
`contact.friction_profile` (file with measured depth, `friction_static` and, if it differs, `friction_dynamic`; or
rows) is friction as a field of depth. A step of the radius would be a wall across the hole: the radius is the
greatest profile below the given one that changes by no more than {steepest} per metre. Nothing is wider than
measured. Friction may step: within a millimetre.

![radius and friction along a hole](img/boreholes-wall.png)

## The closest point

The closest point c = r(p) of a point r of the string has (r − c)·t = 0. Newton's method from the last p finds it:
the slope of that function is −(t·t − k·(r − c)), negative as long as r is nearer than the centre of curvature, and
steps are bounded where it is small. `Borehole.nearest` searches the whole hole for starts. The forms know the hole
as the quadratic about c, so that they see the point move with r, δp = δr·t/(t·t − k·(r − c)); tests hold both to
differences. Cost:

{search}

## What is refused, and what is lost

- A hole that ends above the string's end, or is narrower than the string somewhere: SceneError with depth and
  numbers.
- A bend whose radius is less than the string's clearance: the closest point would not be unique. SceneError with
  both numbers and the depth.
- A string that leaves a hole by more than {beyond} m where it is not known how the hole goes on (`survey`,
  `spline`, `arc`, `helix`; at the top: all): the run stops and says where the end is.
- A point whose search does not end, or ends at the farthest point: the run stops and says which point, where it was
  last and how far it is from there. A step that is too long, or a wall that is too soft, is the usual reason.
"""
TEXT = TEXT.replace("{half}", f"{TRANSITION / 2:g}")


if __name__ == "__main__":
    main()
