"""Maps of linear stability of the thesis' string: lumped, torsional, axial-torsional at three dampings.

Writes docs/stability-maps.md and docs/img/stability-*.png; takes some minutes of one core.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from common import DOCS, table

from drillfem.scene import Scene, load_scene
from drillfem.scene.nominal import dimensionless
from drillfem.stability import DrillingLoop, StabilityMap, confirm, phase_crossings, pitch, stability_map
from drillfem.stability.drawing import draw_map

SPEEDS, WEIGHTS = np.linspace(5, 40, 106), np.linspace(29e3, 80e3, 52)
OWN = np.array([14.42])
CASES: dict[str, tuple[str, dict[str, str]]] = {
    "lumped": ("lumped, undamped", {"model": "lumped", "material.retardation_time": "0"}),
    "torsional": ("torsional, undamped", {"model": "torsional", "material.retardation_time": "0"}),
    "cd2": ("axial-torsional, c_d = 1e-2 s", {"material.retardation_time": "1e-2"}),
    "cd3": ("axial-torsional, c_d = 1e-3 s", {"material.retardation_time": "1e-3"}),
    "cd4": ("axial-torsional, c_d = 1e-4 s", {"material.retardation_time": "1e-4"}),
}
SURFACES: list[tuple[str, dict[str, Any]]] = [
    ("exact (`profile`)", {"rock.surface.scheme": "profile"}),
    ("`dg`, degree 2, 16 elements (default)", {}),
    ("`supg`, 64", {"rock.surface.scheme": "supg", "rock.surface.elements": 64}),
    ("`upwind`, 256", {"rock.surface.scheme": "upwind", "rock.surface.elements": 256}),
    ("`upwind`, 64", {"rock.surface.scheme": "upwind", "rock.surface.elements": 64}),
    ("`upwind`, 16", {"rock.surface.scheme": "upwind", "rock.surface.elements": 16}),
]


def scene(title: str, keys: dict[str, Any]) -> Scene:
    """Chapter 6, C1, changed."""
    return load_scene("vertical-c1-cd4", {"title": f"Chapter 6, C1, {title.rpartition(', ')[2]}", **keys})


def windows(intervals: Sequence[tuple[float, float]]) -> str:
    """Intervals of speed in words; the ends of the map are open."""
    parts = []
    for a, b in intervals:
        low = "" if a <= SPEEDS[0] else f"{a:.2f}"
        high = "" if b >= SPEEDS[-1] else f"{b:.2f}"
        parts.append(
            f"{low} to {high}" if low and high else (f"from {low}" if low else f"to {high}" if high else "all")
        )
    return ", ".join(parts) or "none"


def hertz(root: complex) -> str:
    return f"{root.imag / (2 * np.pi):.2f} Hz ({root.real:+.3g})"


def anchors() -> str:
    """What is known from elsewhere, beside what the package computes."""
    rows = []
    numbers = {"psi": 50, "lambda": 5, "omega_0": 5, "W_0": 7, "beta": 0.3, "blades": 4, "time": 1.0, "length": 1e-3}
    given = Scene.from_dict({"dimensionless": numbers, "time": {"end": 1, "step": 1e-3}})
    root = DrillingLoop.from_scene(given).roots(
        np.array([given.top_drive.speed]), pitch(given, given.nominal().weight_on_bit)
    )
    pair = [f"{r.real:.6g} + {r.imag:.7g} i" for r in root.values[0, :2]]
    rows.append(("lumped model, psi = 50, n = 4: root", "2.79763 + 14.66778 i", pair[0]))
    rows.append(("and of torsion", "about 1e-4 + 1.0032 i", pair[1]))
    spec = [
        ("1e-2", "210 GPa", "none"),
        ("1e-3", "210 GPa", "13.20 Hz (+0.51)"),
        ("1e-4", "210 GPa", "13.34 Hz (+1.87), 11.64 Hz, 9.20 Hz"),
        ("1e-3", "200.2 GPa", "13.09 Hz (+1.05)"),
    ]
    for damping, modulus, known in spec:
        one = scene("", {"material.retardation_time": damping, "material.youngs_modulus": modulus})
        found = DrillingLoop.from_scene(one).roots(OWN, pitch(one, 45.7e3)).values[0]
        below = [hertz(r) for r in found if r.real > 1e-3 and r.imag < 20 * 2 * np.pi]
        name = f"chatter below 20 Hz at c_d = {damping} s, E = {modulus}, Hz (1/s)"
        rows.append((name, known, ", ".join(below) or "none"))
    known_gains = [(1.0, "5.782 at 3.682"), (2.0, "7.455 at 7.983"), (4.0, "4.719 at 17.833")]
    for rate, known in known_gains:

        def loop(s: np.ndarray, rate: float = rate) -> np.ndarray:
            damping = np.sqrt(1 - np.log(0.7) / s)
            return 10 * np.tanh(s / 1.6 * damping) / damping * (1 - np.exp(-s / rate)) / s

        first = phase_crossings(loop, np.linspace(0.01, 100, 20_000))[0]
        name = f"Aarsnes & van de Wouw, K_a = 10, 1/t_N = {rate:g}: largest gain in opposite phase"
        rows.append((name, known, f"{first.gain:.3f} at {first.omega:.3f}"))
    return table(["", "known", "ours"], rows)


def at_own_point() -> str:
    """Unstable motions of every rung and damping at the scene's own speed and weight."""
    rows = []
    cases = [(t, k) for t, k in CASES.values()]
    cases.append(("axial-torsional, c_d = 1e-5 s", {"material.retardation_time": "1e-5"}))
    cases.append(("lumped, c_d = 1e-3 s", {"model": "lumped", "material.retardation_time": "1e-3"}))
    cases.append(("torsional, c_d = 1e-3 s", {"model": "torsional", "material.retardation_time": "1e-3"}))
    for title, keys in sorted(cases):
        one = scene(title, keys)
        loop = DrillingLoop.from_scene(one)
        rho = pitch(one, 45.7e3)
        found = loop.roots(OWN, rho)
        growing = found.values[0][found.values[0].real > 1e-6]
        band, complete = loop.band(float(rho))
        listed = ", ".join(hertz(r) for r in growing[:3]) or f"none; the last to fade: {hertz(found.values[0, 0])}"
        where = f"{band / (2 * np.pi):.0f}" + ("" if complete else " (more beyond)")
        rows.append((title, f"{len(growing)}", listed, where))
    return table(["rung", "unstable motions", "the fastest, Hz (1/s)", "looked for up to, Hz"], rows)


def by_weight() -> str:
    """Stable speeds at several weights: what the weight moves, and what it does not."""
    rows = []
    for key in ("lumped-cd3", "cd2", "cd3"):
        title, keys = CASES.get(key, ("lumped, c_d = 1e-3 s", {"model": "lumped", "material.retardation_time": "1e-3"}))
        chart = stability_map(scene(title, keys), SPEEDS[::15], WEIGHTS[::17])
        rows.append((title, *(windows(chart.stable_speeds(w * 1e3)) for w in (32.7, 45.7, 60, 80))))
    return table(["stable speeds, rad/s", "32.7 kN", "45.7 kN", "60 kN", "80 kN"], rows)


def by_surface() -> str:
    """What the discretised rock surface makes of the same map."""
    rows = []
    for name, keys in SURFACES:
        one = scene("", {"material.retardation_time": "1e-3", **keys})
        chart = stability_map(one, np.linspace(5, 40, 8), WEIGHTS[::17], "scene")
        fast = chart.loop.roots(np.array([19.0]), pitch(one, 45.7e3))
        edges = windows(chart.stable_speeds(45.7e3))
        rows.append((name, f"{chart.own.growth[0]:.4f}", f"{fast.growth[0]:.3f}", edges))
    return table(["surface", "growth at 14.42 rad/s, 1/s", "at 19 rad/s", "stable speeds at 45.7 kN, rad/s"], rows)


def charts() -> tuple[dict[str, StabilityMap], dict[str, float]]:
    """The drawn maps with their runs, and the seconds that roots took."""
    made, seconds = {}, {}
    for key, (title, keys) in CASES.items():
        start = time.process_time()
        chart = stability_map(scene(title, keys), SPEEDS, WEIGHTS)
        seconds[key] = time.process_time() - start
        confirm(chart, (6, 3))
        draw_map(chart, DOCS / "img" / f"stability-{key}.png")
        made[key] = chart
        print(f"{title}: {seconds[key]:.1f} s, {chart.agreement[0]} of {chart.agreement[1]} agree", flush=True)
    return made, seconds


def runs(made: dict[str, StabilityMap], seconds: dict[str, float]) -> str:
    """Agreement of roots and runs."""
    rows = []
    for key, chart in made.items():
        agree, of = chart.agreement
        off = max(abs(p.growth - p.rightmost) for p in chart.points)
        # the runs know the default surface, not the exact one
        speeds, weights = (np.array([getattr(p, name) for p in chart.points]) for name in ("speed", "weight"))
        own = DrillingLoop.from_scene(chart.scene, "scene").roots(speeds, pitch(chart.scene, weights)).growth
        left = max(abs(p.growth - g) for p, g in zip(chart.points, own, strict=True))
        hz = max(abs(p.frequency - p.predicted_frequency) for p in chart.points)
        cuts = np.isfinite(chart.growth)
        stable = 100 * float(np.mean(chart.unstable[cuts] == 0))
        points = int(cuts.sum())
        row = (f"{agree} of {of}", f"{off:.1e}", f"{left:.1e}", f"{hz:.1e}", f"{stable:.0f} %")
        rows.append((CASES[key][0], *row, f"{points} in {seconds[key]:.0f} s"))
    head = ["map", "runs that do what the roots say", "growth differs by at most, 1/s", "with the surface's own roots"]
    return table([*head, "frequency, Hz", "stable part", "points of the map, CPU"], rows)


def points(chart: StabilityMap) -> str:
    """Every run of one map."""
    rows = [
        (f"{p.speed:.2f}", f"{p.weight / 1e3:.1f}", f"{p.growth:+.4f}", f"{p.rightmost:+.4f}", f"{p.frequency:.3f}",
         f"{p.predicted_frequency:.3f}", f"{p.window[0]:.1f} to {p.window[1]:.1f}")
        for p in chart.points
    ]  # fmt: skip
    head = ["speed, rad/s", "weight, kN", "growth of the run, 1/s", "of the root", "frequency, Hz", "of the root"]
    return table([*head, "fitted, s"], rows)


def main() -> None:
    """Draw, measure, write the page."""
    made, seconds = charts()
    lumped, cd3 = made["lumped"].scene, made["cd3"]
    numbers = dimensionless(lumped)
    blades = len(cd3.loop.sectors)
    half = np.pi / (blades * numbers.omega_0)  # of the torsional vibration, in half a blade passage: omega_t tau/2
    rho = float(pitch(lumped, 45.7e3)) / numbers.length
    creep = rho / np.tan(half) / (4 * blades * numbers.psi**2 * numbers.time)
    text = PAGE.format(
        anchors=anchors(),
        own=at_own_point(),
        weight=by_weight(),
        surface=by_surface(),
        runs=runs(made, seconds),
        points=points(cd3),
        calm=2 * np.sqrt(2 * numbers.psi / blades) / numbers.time,
        creep=creep,
        creeps=float(made["lumped"].own.values[0, 1].real),
        hours=np.log(10) / float(made["lumped"].own.values[0, 1].real) / 3600,
        edge=cd3.stable_speeds(45.7e3)[0][1],
        inside=100 * (1 - cd3.stable_speeds(45.7e3)[0][1] / 14.42),
    )
    (DOCS / "stability-maps.md").write_text(text)


PAGE = """# Stability maps

Written by `benchmarks/stability_maps.py`. String, bit and rock are those of the thesis' chapter 6, C1 (six blades,
E = 210 GPa); everything here is linear: whether steady drilling, pushed a little, comes back.

```
drillfem stability vertical-c1-cd3 --out map                    # stability.png, stability.json, a short table
drillfem stability vertical-c1-cd3 --set model=lumped --speeds '50..380 rpm' --weights '29..80 kN' --out lumped
drillfem stability vertical-c1-cd3 --set rock.surface.scheme=upwind --surface scene --no-runs --out upwind
```

In Python: `drillfem.stability.stability_map(scene, speeds, weights)`, `confirm(map)`, and for single points
`DrillingLoop.from_scene(scene).roots(speed, pitch(scene, weight))`.

## The equation

The bit answers changes of the cutting forces by u = -G_a dW and phi = -G_t dT. Behind a blade the rock keeps what the
blade ahead has left, so the depth of cut changes by E(s) (u - rho phi): E is the sum over the blades of 1 - exp(-s
w/Omega_0), w the angle to the blade ahead (blades may be unequal), and rho = V_0/Omega_0 = d_0/(2 pi). With dW = eps
a zeta d and dT = eps a^2/2 d, while the wear flats carry a constant load,

    1 + E(s) (eps a zeta G_a(s) - rho eps a^2/2 G_t(s)) = 0.

For the lumped model this is (s^2 + n psi E)(s^2 + 1) - n rho E s^2 = 0. G_a and G_t are exact: the transfer matrices
of the sections with the complex stiffness (1 + c_d s), lumps at the ends, top on a constant hook load and turned at
constant speed. **Weight on bit enters through rho only, speed through the delay only.** Where one blade passes every
tau, E is periodic along the imaginary axis, and the boundary has a closed form, `DrillingLoop.boundary`, which a test
holds against the roots.

Unstable roots are counted by the argument principle, with steps along the imaginary axis that halve until no step
turns by more than 1 rad, and found by the secant method from all minima of |1 + gain|; a map is refused where list
and count disagree (so far: nowhere). Where the loop gain stays below one for good, there can be no root beyond: so
the search has an end. An undamped string has no such end, and infinitely many motions that hardly grow.

{anchors}

## Lumped

![lumped](img/stability-lumped.png)

The axial self-excitation hardly knows of torsion: its growth barely changes with the weight, and it ends above
2 sqrt(2 psi/n)/t* = {calm:.2f} rad/s, where the blades come faster than the mass can follow. The torsional vibration
never ends: a bit that turns too far meets the past too early, cuts less, and is braked less. To first order that
makes it grow by rho/(4 n psi^2) cot(omega_t tau/2) in the units of Appendix C.2: {creep:.2e} 1/s at the thesis'
point, and {creeps:.2e} by its root. It takes {hours:.1f} hours to grow tenfold, while the stick-slip of case C1 is
there within seconds: that takes the axial self-excitation.

## Torsional

![torsional](img/stability-torsional.png)

Torsional waves on a rigid mass. The strong self-excitation is that of the lumped model; now the weight on bit
matters, because the torsional motions near 8 to 11 Hz answer it. The other torsional motions grow too, slowly, in
wedges bounded by multiples of half the blades' passage. Undamped, no speed is stable.

## Axial-torsional, three dampings

![c_d = 1e-2 s](img/stability-cd2.png)

![c_d = 1e-3 s](img/stability-cd3.png)

![c_d = 1e-4 s](img/stability-cd4.png)

Chatter sets in where, with rising speed, a multiple of the blades' passage has passed an axial natural frequency,
lags behind the passage, and dies out: lobes, one for each multiple. With c_d = 1e-2 s only the slowest speeds
chatter; with 1e-3 s two windows of stable speeds are left; with 1e-4 s none, because lobes of higher motions fill the
gaps. There, at the thesis' point, a motion at 26 Hz grows as fast as the one at 13 Hz.

The thesis' own point (the star) lies {inside:.1f} % above the edge of a lobe, {edge:.2f} rad/s. Hence its chatter at
c_d = 1e-3 s is weak, doubles its growth with E = 200.2 instead of 210 GPa, and vanishes with a slightly diffusive
rock surface (below).

{own}

Weight on bit moves two things: the edge beside a torsional frequency (10.3 to 12.8 rad/s, a motion near 7 Hz), and
the torsional fundamental, which a heavy and fast bit drives unstable against the damping (upper right of the map for
1e-3 s). The other edges are axial, and hardly move:

{weight}

## What a discretised surface does

The delay exp(-s w/Omega_0) becomes the transfer function of the elements, [k/k+1]-Pade for DG of degree k; here at
c_d = 1e-3 s:

{surface}

First-order upwinding, even with 256 cells, makes the thesis' point stable (-0.0034 1/s is the torsional fundamental).

## Do runs agree?

At even points of every map the scene was run from an excess of spin of 1e-6, nonlinear and with its default surface.
While the axial speed stays within 1 % of nominal, the motions in the depth of cut are fitted (exponentials, by
ESPRIT; 40 s at most); the fastest is compared with the rightmost root. Filled dots grow, open ones fade.

{runs}

The largest difference, at 28 Hz and the slowest speed, is made by the default surface (`dg`, degree 2, 16 elements),
on which four waves lie there between two blades: with that surface's own roots it is gone. The map at c_d = 1e-3 s,
point by point:

{points}
"""

if __name__ == "__main__":
    main()
