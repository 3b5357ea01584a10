"""The soft string measured: order, speed, well A of Aarsnes and Shor, what first-order upwind makes of it, drives.

Writes docs/soft-string.md and its pictures in a minute of one core.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numba
import numpy as np
import numpy.typing as npt
from common import DOCS, table

from drillfem.models.drive import DriveLaw, law_of, lowest_frequency, reflection
from drillfem.models.soft_string import WallFriction
from drillfem.render import style
from drillfem.scene import load_scene
from drillfem.solve.characteristics import Shaft
from drillfem.solve.soft_string import SoftString, SoftStringRun

Array = npt.NDArray[np.float64]
PIPE = Shaft(2500.0, 69e9 * 2.27682e-5, 7850 * 2.27682e-5)
RPM = 30 / math.pi


def lagging(t: Array) -> tuple[Array, Array]:
    """60 rpm, wanted with a lag of 1 s, as in the code of the paper."""
    speed = 2 * math.pi
    return speed * (t - 1 + np.exp(-t)), speed * (1 - np.exp(-t))


def well_a(step: float, damping: float, law: DriveLaw | None = None) -> SoftString:
    """Their string, friction and drive."""
    run = SoftStringRun(load_scene("off-bottom-aarsnes-shor"))
    both = [damping] * len(run.string.shafts)
    return SoftString(run.string.shafts, run.friction, step, law=law or law_of(run.scene), top=lagging, damping=both)


def cycle(t: Array, bit: Array) -> Array:
    """Times between starts of the bit after 40 s (s)."""
    starts = (t[1:] > 40) & (bit[1:] > 1.0) & (bit[:-1] <= 1.0)
    at = t[1:][starts]
    return np.diff(at[np.append(True, np.diff(at) > 2.0)])


# -- order --------------------------------------------------------------------------------------------------------
def orders() -> str:
    """Errors of a start with smooth friction against a step sixteen times finer."""
    friction = WallFriction(
        lambda s: (3.0 + 0 * s, 1.5 + 0 * s), np.ones_like, np.zeros(0), velocity_scale=2.0, regularisation=1.0
    )
    law = DriveLaw(800.0, 400.0, math.inf, 2900.0, 0.0)
    steps = (0.02, 0.01, 0.005, 0.0025, 0.00025)

    def run(step: float) -> dict[str, Array]:
        string = SoftString(
            [PIPE], friction, step, law=law, top=lambda t: (0.4 * t**3 / 3, 0.4 * t**2), bottom_inertia=500.0
        )
        return string.advance(round(6.0 / step), round(0.24 / step))

    found = {step: run(step) for step in steps}
    names = {"bit_angular_speed": "spin of the bit", "bit_angle": "its angle", "top_torque": "torque of the drive"}
    gap = {
        name: [
            np.abs(found[h][name] - found[steps[-1]][name]).max() / np.abs(found[steps[-1]][name]).max()
            for h in steps[:-1]
        ]
        for name in names
    }
    rows = [
        [words, *(f"{e:.1e}" for e in gap[name]), f"{math.log2(gap[name][0] / gap[name][-1]) / 3:.2f}"]
        for name, words in names.items()
    ]
    return table(["", *(f"{1e3 * h:g} ms" for h in steps[:-1]), "order"], rows)


# -- well A -------------------------------------------------------------------------------------------------------
def settled() -> tuple[str, dict[str, dict[str, Array]]]:
    """The stick-slip of well A for steps and damping."""
    rows, kept = [], {}
    for damping, step in (
        (0.0, 2e-3),
        (0.0, 1e-3),
        (1e-4, 2e-3),
        (1e-3, 4e-3),
        (1e-3, 2e-3),
        (1e-3, 1e-3),
        (5e-3, 4e-3),
    ):
        string = well_a(step, damping)
        r = string.advance(round(100 / step))
        late = r["time"] > 40
        torque, period = r["top_torque"], cycle(r["time"], r["bit_angular_speed"])
        rows.append(
            [
                f"{damping:g} s",
                f"{1e3 * step:g} ms",
                f"{torque[r['time'] < 2].max() / 1e3:.2f}",
                f"{period.mean():.3f} ± {period.std():.2f}",
                f"{r['bit_angular_speed'].max() * RPM:.0f}",
                f"{torque[late].min() / 1e3:.1f} to {torque[late].max() / 1e3:.1f}",
                f"{balance(r):.0e}",
            ]
        )
        if step == 1e-3:
            kept[f"{damping:g}"] = r
    head = ["c_d", "step", "peak (kN m)", "cycle (s)", "bit, most (rpm)", "torque (kN m)", "energy missing"]
    return table(head, rows), kept


def balance(r: dict[str, Array]) -> float:
    """Missing energy over the work of the drive."""
    stored = r["kinetic_energy"] + r["strain_energy"]
    missing = r["work_top_drive"] - r["work_wall"] - r["dissipated"] - stored
    return float(np.abs(missing).max() / r["work_top_drive"].max())


@numba.njit
def _upwind(  # type: ignore[no-untyped-def]
    down: Array, up: Array, size: Array, speed: Array, impedance: Array, static: Array, steps: int, dt: float,
    every: int, law: tuple[float, float, float], out: Array,
) -> None:  # fmt: skip
    """First-order upwind waves with Coulomb friction: down, up are the two waves, friction levels are per cell."""
    n, top, integral = down.size, 0.0, 0.0
    for k in range(steps):
        t = k * dt
        error = 2 * math.pi * (1 - math.exp(-t)) - top
        integral += dt * error
        motor = law[0] * error + law[1] * integral
        a_in, b_out = top - up[0], up[0]
        a_last, turned = a_in, 0.0
        top += dt / law[2] * (motor - impedance[0] * (a_in - b_out))
        for i in range(n):
            a, b = down[i], up[i]
            # what comes in from below, through the joint
            if i == n - 1:
                b_in = a
            else:
                q = impedance[i + 1] / impedance[i]
                b_in = ((1 - q) * a + 2 * q * up[i + 1]) / (1 + q)
            c = speed[i] * dt / size[i]
            new_a, new_b = a - c * (a - a_last), b + c * (b_in - b)
            if i < n - 1:
                q = impedance[i + 1] / impedance[i]
                a_last = (2 * a - (1 - q) * up[i + 1]) / (1 + q)
            w, old = new_a + new_b, a + b
            unit = dt * speed[i] / (impedance[i] * size[i])  # spin per friction torque of the cell
            if abs(old) < 1.0:
                rub = min(max(w / unit, -static[i]), static[i])
            else:
                rub = 0.5 * math.copysign(static[i], old)
            down[i], up[i] = new_a - 0.5 * unit * rub, new_b - 0.5 * unit * rub
            turned = down[i] + up[i]
        if k % every == 0:
            out[k // every, 0], out[k // every, 1], out[k // every, 2] = t, motor, turned


def upwind() -> str:
    """What a first-order upwind scheme, as the peers have, makes of the same equations."""
    run = SoftStringRun(load_scene("off-bottom-aarsnes-shor"))
    pipe, collars = run.string.shafts
    rows = []
    for cells in (500, 1000, 2000, 4000):
        m = round(cells * pipe.length / 2500)
        counts = (m, cells - m)
        size, speed, impedance = (
            np.repeat([f(pipe), f(collars)], counts)
            for f in (lambda x: 0.0, lambda x: x.length / x.travel_time, lambda x: x.impedance)
        )
        size = np.repeat([pipe.length / m, collars.length / (cells - m)], counts)
        middle = np.cumsum(size) - size / 2
        static = run.friction.torque(middle)[0] * size
        dt = 0.99 * float((size / speed).min())
        steps = int(100 / dt)
        every = max(1, int(2e-3 / dt))
        out = np.zeros((steps // every + 1, 3))
        _upwind(
            np.zeros(cells),
            np.zeros(cells),
            size,
            speed,
            impedance,
            static,
            steps,
            dt,
            every,
            (38e3, 100e3, 2900.0),
            out,
        )
        t, torque, bit = out[:-1].T
        late, period = t > 40, cycle(t, bit)
        rows.append(
            [
                str(cells),
                f"{torque[t < 2].max() / 1e3:.2f}",
                f"{period.mean():.3f} ± {period.std():.2f}",
                f"{bit.max() * RPM:.0f}",
                f"{torque[late].min() / 1e3:.1f} to {torque[late].max() / 1e3:.1f}",
            ]
        )
    return table(["cells", "peak (kN m)", "cycle (s)", "bit, most (rpm)", "torque (kN m)"], rows)


# -- drives -------------------------------------------------------------------------------------------------------
def drives() -> tuple[str, dict[str, dict[str, Array]], dict[str, DriveLaw], float, float]:
    """The same start with a stiff drive, soft-torque and z-torque."""
    scene = load_scene("off-bottom-aarsnes-shor")
    zeta, lowest = SoftStringRun(scene).string.shafts[0].impedance, lowest_frequency(scene)
    plain = {"top_drive.proportional_gain": None, "top_drive.integral_gain": None}
    laws: dict[str, Any] = {"stiff PI": law_of(scene)}
    for kind, f in (("soft-torque", None), ("soft-torque", 0.16), ("z-torque", None)):
        keys = plain | {"top_drive.kind": kind, "top_drive.tuning_frequency": f}
        laws[f"{kind}, {f:g} Hz" if f else kind] = law_of(load_scene("off-bottom-aarsnes-shor", keys))
    rows, kept = [], {}
    for name, law in laws.items():
        r = kept[name] = well_a(4e-3, 1e-3, law).advance(25_000)
        late = r["time"] > 60
        bit = r["bit_angular_speed"][late]
        back = np.abs(reflection(law, 2 * math.pi * np.array([lowest, 3 * lowest, 10 * lowest]) + 0j, zeta))
        rows.append(
            [
                name,
                *(f"{x:.2f}" for x in back),
                f"{abs(bit.min()) * RPM:.0f} to {bit.max() * RPM:.0f}",
                f"{100 * np.mean(np.abs(bit) < 0.1):.0f} %",
                f"{r['top_torque'][late].min() / 1e3:.1f} to {r['top_torque'][late].max() / 1e3:.1f}",
            ]
        )
    head = ["drive", "comes back at f", "3 f", "10 f", "bit after 60 s (rpm)", "stuck", "torque (kN m)"]
    return table(head, rows), kept, laws, zeta, lowest


# -- speed --------------------------------------------------------------------------------------------------------
def speeds() -> str:
    """Simulated seconds per processor second."""
    rows = []
    still: dict[str, object] = {"string.0.material.retardation_time": 0, "string.1.retardation_time": 0}
    cases: tuple[tuple[str, dict[str, object], str], ...] = (
        ("off-bottom-soft-string", {}, "(4-7), no damping"),
        ("off-bottom-aarsnes-shor", still, "Coulomb, no damping"),
        ("off-bottom-aarsnes-shor", {}, "Coulomb, damping"),
        ("survey-p11-a-02", {"model": "soft-string", "material.retardation_time": 0}, "(4-7), no damping"),
        ("survey-p11-a-02", {"model": "soft-string"}, "(4-7), damping"),
    )
    for name, over, words in cases:
        string = SoftStringRun(load_scene(name, over)).string
        string.advance(400)
        best, node = math.inf, 0
        for _ in range(3):
            before, start = string.counters["steps"], time.process_time()
            string.advance(1000)
            best = min(best, time.process_time() - start)
            node = string.counters["steps"] - before
        nodes = len(string.arc_length)
        rows.append(
            [
                f"`{name}`",
                words,
                str(nodes),
                f"{1e3 * string.internal_step:.2f} ms",
                f"{1000 * string.step / best:.0f}",
                f"{1e9 * best / node / nodes:.0f} ns",
            ]
        )
    return table(["scene", "friction", "nodes", "step inside", "simulated / CPU", "per node and step"], rows)


# -- pictures -----------------------------------------------------------------------------------------------------
def draw_start(kept: dict[str, dict[str, Array]]) -> None:
    """Spin of bit and top, torque of the drive, with and without damping."""
    with style.page(1500, 900) as figure:
        style.heading(figure, "Well A: start-up off bottom", "60 rpm, stiff PI drive, mu = 0.3, set-valued friction")
        for k, (name, words) in enumerate((("0.001", "a little damping, c_d = 1 ms"), ("0", "no damping at all"))):
            r = kept[name]
            left = figure.add_axes((0.06, 0.525 - 0.44 * k, 0.52, 0.345))
            left.plot(r["time"], r["bit_angular_speed"] * RPM, color=style.BLUE, lw=0.9)
            left.plot(r["time"], r["top_angular_speed"] * RPM, color=style.GREY, lw=1.3)
            left.set_title(f"Spin of the bit (rpm), grey: top; {words}")
            left.set_xlim(0, 60)
            right = figure.add_axes((0.64, 0.525 - 0.44 * k, 0.345, 0.345))
            right.plot(r["time"], r["top_torque"] / 1e3, color=style.ORANGE, lw=1.1)
            right.set_title("Torque of the drive (kN m)")
            right.set_xlim(0, 60)
            for axes in (left, right):
                if k:
                    axes.set_xlabel("time (s)")
        style.save(figure, DOCS / "img" / "soft-string-well-a.png")


def draw_drives(kept: dict[str, dict[str, Array]], laws: dict[str, DriveLaw], zeta: float, lowest: float) -> None:
    """Spin of the bit with each drive, and what comes back at the top."""
    colours = dict(zip(kept, (style.VERMILION, style.BLUE, style.PURPLE, style.GREEN), strict=True))
    with style.page(1500, 620) as figure:
        style.heading(figure, "Well A: drives", "the same string, friction and wanted speed of 60 rpm")
        axes = figure.add_axes((0.055, 0.11, 0.56, 0.7))
        for name, r in kept.items():
            if "0.16" not in name:
                axes.plot(r["time"], r["bit_angular_speed"] * RPM, color=colours[name], lw=1.2)
        axes.set_xlim(0, 100)
        axes.set_title("Spin of the bit (rpm)")
        axes.set_xlabel("time (s)")
        right = figure.add_axes((0.68, 0.11, 0.305, 0.7))
        f = np.geomspace(0.02, 5.0, 400)
        for name, law in laws.items():
            right.plot(f, np.abs(reflection(law, 2 * math.pi * f + 0j, zeta)), color=colours[name], lw=1.8, label=name)
        figure.legend(loc="upper right", bbox_to_anchor=(0.985, 0.97), ncols=4)
        right.axvline(lowest, color=style.GREY, ls=(0, (5, 3)), lw=1.0)
        right.set_xscale("log")
        right.set_ylim(0, 1.05)
        right.set_title("What comes back of a wave at the top")
        right.set_xlabel("frequency (Hz); dashed: the string's lowest")
        style.save(figure, DOCS / "img" / "soft-string-drives.png")


def main() -> None:
    """Measure, draw, write."""
    (DOCS / "img").mkdir(exist_ok=True)
    cycles, kept = settled()
    driven, started, laws, zeta, lowest = drives()
    draw_start(kept)
    draw_drives(started, laws, zeta, lowest)
    parts = {"orders": orders(), "cycles": cycles, "upwind": upwind(), "drives": driven, "speeds": speeds()}
    text = TEXT
    for name, value in parts.items():
        text = text.replace(f"{{{name}}}", value)
    (DOCS / "soft-string.md").write_text(text)


TEXT = """# The soft string

Written by `benchmarks/soft_string.py`.

`model = "soft-string"` is a rung beside the torsional one, for a string that turns off bottom in any hole:
waves of twist, with friction at the wall all along. It is the model R that chapter 4 lays beside the rod, after
Aarsnes and Shor (2018). It has no bending, no axial motion and no bit on rock; it is run where a scene asks for
it by name, without DOLFINx or PETSc.

    ρJ φ_tt = GJ φ_ss + (c_d GJ φ_st)_s − b φ_t − r k(v) q_N(s)

| in the scene | what it does |
| --- | --- |
| `soft_string.side_load` | `inclination`: q_N = w sin θ. `weight-and-curvature` (default): of weight and tension |
| `soft_string.friction_argument` | `contact-speed` (default): v = r φ_t. `spin`: v = φ_t, as (4-12) is printed |
| `soft_string.law` | `stribeck`: (4-7), n and ε of `[contact]`. `coulomb`: μ_s below `threshold_spin`, μ_d above |
| `[contact]`, `[[hole.section]]` | coefficients of friction, anywhere along the hole |
| `contact_diameter` | what touches the wall: r |
| `[mud]` | buoyancy; with `viscosity` the laminar drag b = 4πη/(1/r_i² − 1/r_o²) of concentric cylinders |
| `[top_drive]` | imposed speed or angle, `pi`, `soft-torque`, `z-torque`, with torque limit |
| `ends.bottom_inertia`, `ends.bottom` | inertia at the free end; `clamped` holds it |

The thesis says both "in proportion to the dogleg" and "to the inclination" (errata 22): the dogleg is zero in
the straight inclined part where its figure shows friction, so it cannot be the dogleg alone. By weight and
curvature

    q_N = |F t′ + w − (w·t) t|         t: tangent of the hole, w: weight per length, F: tension

which in a plane is |w sin θ − F θ′|. The tension F is that of a string that hangs freely and turns: the weight
below, ∫ w cos θ ds, which is w times the depth between.

The history has the names of every run, with `bit_angular_speed` of the lower end, `side_force` (N, all of it)
and `wall_torque` (N m, friction on the whole string); fields are `spin`, `torque`, `angle`, `axial_force`,
`wall_side_force`, and the shape of the hole.

## How it is solved

The spin is a sum of two waves. A cell is as long as a wave travels in a step, so that a step hands every wave
from node to node as it is: no dispersion, no damping, no limit of the step. What acts on the half cells about a
node acts at the node, with the mean spin w of the step,

    (Z₁ + Z₂ + b) w + T(w) = 2 (Z₁ a + Z₂ b),        Z = √(GJ ρJ)

a single equation per node, solved by Newton's method within brackets ((4-7)) or at once (Coulomb: a node whose
push is below the static level stands still, exactly). Ends: inertia and drive join in by the midpoint rule.
With Kelvin-Voigt damping the nodes are coupled by a tridiagonal matrix; Newton's method then runs on the
solutions of the single nodes. Sections that a wave passes in less than a step are joined to their neighbours
(stabilisers), with their mass and softness; travel times are met to 2e-4. `time.step` sets the cells as well: 5
ms are 15 m of steel. The torque at a node times its spin is just what the waves lose: the balance of energy
closes to round-off.

(4-7) falls with speed behind its peak. Where it falls faster than the waves can follow on a cell the equation
of a node would have three solutions: the grid is made finer by itself, up to 64 times, and beyond that the
scene is refused with the greatest n.

Errors of a start with smooth friction (n = 2, ε = 1), relative to the largest value; the order is 2. With
friction that sticks, the moment of sticking is known to a step:

{orders}

{speeds}

## Well A

`off-bottom-aarsnes-shor` has the string, drive and friction of the paper: 60 deg, 60 rpm, μ_s = 0.3, μ_d =
0.15, set-valued below 1 rad/s, k_p = 38 000, k_i = 100 000.

| | here | Aarsnes and Shor's parameters |
| --- | ---: | ---: |
| torque that breaks the string loose, over μ | 32 131 N m | 32 132 N m |
| twist of the top then, over μ | 50.47 rad | 50.478 rad |
| measured: torque at which the bit lets go, twisted slowly | within 1 % | |
| lowest frequency | 0.2261 Hz | 0.2209 Hz: with the pipe's wave speed in the collars too |
| start-up peak | 17.21 kN m | 17.2 kN m |
| cycle of stick-slip | 5.58 s | 5.65 s |

![start-up of well A](img/soft-string-well-a.png)

Without any damping the model is not well behaved: friction that falls from static to dynamic feeds every wave,
however short, and nothing takes it from the collars, which ring between the pipe and the free end (impedance
ratio 3.9). That is what the equations say: it is the same for steps of 2, 1 and 0.5 ms up to 14 s. (With 4 ms
the bit comes loose at the first wave, at 3 s; with a finer grid it is a close call that fails.) A retardation
time of 0.1 ms is enough to settle on a cycle of two beats, 5.45 and 5.70 s, with any step:

{cycles}

A first-order upwind scheme of the same equations, which is what the published code has, damps by its grid, and
what it finds hangs on the grid (5.65 s was found so with 2000 cells by other hands):

{upwind}

## Drives

The law of the drive stands once, in `drillfem.models.drive`: T = k_p (Ω − w) + k_i ∫(Ω − w) dt within the
torque limit, the integral waiting at the limit. From the string it is the impedance Z = J s + k_p + k_i/s; of a
wave of torque (Z − ζ)/(Z + ζ) comes back, ζ = √(GJ ρJ) of the pipe. `soft-torque` takes k_p = ζ, k_i = (2πf)²
J: Z = ζ at the tuning frequency f (the string's lowest, if not given). `z-torque` hides the inertia as well: Z
= ζ at all frequencies but for a weak integral that holds the mean speed. A pulse sent up a long string comes
back as the formula says to 4e-3 from 0.1 to 0.8 Hz (`tests/physics/test_soft_string.py`).

{drives}

With the inertia of 2900 kg m² soft-torque is matched in a narrow band only: a tenth off the tuning frequency ωJ
less k_i/ω is 1.6 ζ. Stick-slip of 0.18 Hz is outside; tuned lower it is milder, and does not cease. With the
inertia hidden it does.

![drives](img/soft-string-drives.png)
"""

if __name__ == "__main__":
    main()
