"""The four rock surfaces beside the exact growth rate and the delay equation.

Writes docs/rock-surface.md and its picture in less than a minute of one core.
"""

from __future__ import annotations

import time
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from common import DOCS, table
from scipy.linalg import expm

from drillfem import Scene, load_scene
from drillfem.bitrock import (
    SCHEMES,
    RockSurface,
    characteristic_root,
    growth_rate,
    supg_operators,
    surface_operators,
)
from drillfem.bitrock.delay import LumpedBit, delay_equation
from drillfem.bitrock.dg import STREAMLINE, DGOperators
from drillfem.render import style
from drillfem.solve.straight import StraightRun

Array = npt.NDArray[np.float64]
#: field.md's case of the literature: n, psi, rho, omega_0 of appendix C.2
CASE = (4, 50.0, 1 / np.pi, 5.0)
EXACT = characteristic_root(2.8 + 14.6j, *CASE)
FAMILIES = {
    "upwind": ("upwind", 0, (8, 16, 32, 64, 128, 256)),
    "supg": ("supg", 1, (8, 16, 32, 64, 128)),
    "dg, degree 1": ("dg", 1, (4, 8, 16, 32, 64)),
    "dg, degree 2": ("dg", 2, (4, 8, 16, 32)),
    "dg, degree 3": ("dg", 3, (2, 4, 8)),
}
QUANTITIES = ("bit_angular_speed", "bit_depth", "bit_axial_speed")
EVERY = 4e-3
SURFACES: dict[str, dict[str, Any]] = {
    "profile": {"scheme": "profile"},
    "dg, degree 3, 32": {"scheme": "dg", "degree": 3, "elements": 32},
    "dg, degree 2, 16 (default)": {"scheme": "dg", "degree": 2, "elements": 16},
    "supg, 64": {"scheme": "supg", "elements": 64},
    "upwind, 64": {"scheme": "upwind", "elements": 64},
    "upwind, 256": {"scheme": "upwind", "elements": 256},
}


def errors_of(family: str) -> tuple[Array, Array]:
    """Degrees of freedom and errors of the growth rate."""
    scheme, degree, cells = FAMILIES[family]
    operators = [surface_operators(scheme, degree, n, 1.0) for n in cells]
    return (
        np.array([float(len(op.nodes)) for op in operators]),
        np.array([abs(growth_rate(op, *CASE) - EXACT) for op in operators]),
    )


def simulated(surface: dict[str, Any]) -> complex:
    """Growth rate of a small disturbance in a run of the lumped model, by Prony's method."""
    numbers = {"psi": 50.0, "beta": 0.3, "lambda": 5.0, "omega_0": 5.0, "W_0": 7.0, "blades": 4, "time": 1.0}
    keys = {
        "dimensionless": numbers,
        "rock": {"surface": surface},
        "initial": {"spin_perturbation": 1e-6},
        "time": {"end": 4.0, "step": 1e-3},
    }
    h = StraightRun(Scene.from_dict(keys)).string.advance(4000)
    late = h["bit_axial_speed"][2000:]
    signal = (late - h["bit_axial_speed"][0])[::20]
    columns = np.lib.stride_tricks.sliding_window_view(signal, 9)
    coefficients = np.linalg.lstsq(columns[:, :-1], columns[:, -1], rcond=None)[0]
    rates = np.log(np.roots(np.append(1.0, -coefficients[::-1])).astype(complex)) / 0.02
    return complex(rates[np.abs(rates.imag - EXACT.imag).argmin()])


def growth() -> str:
    """Table of growth rates with fitted orders."""
    rows = []
    for family, (scheme, degree, cells) in FAMILIES.items():
        _, errors = errors_of(family)
        order = -np.polyfit(np.log(cells[-3:]), np.log(errors[-3:]), 1)[0]
        for n, error in zip(cells, errors, strict=True):
            rate = growth_rate(surface_operators(scheme, degree, n, 1.0), *CASE)
            run = ""
            if n in (8, 64) and degree < 2:
                surface = {"scheme": scheme, "elements": n} | ({"degree": degree} if scheme == "dg" else {})
                run = f"{simulated(surface).real:.4f}"
            last = f"{order:.2f}" if n == cells[-1] else ""
            loss = f"{100 * (EXACT.real - rate.real) / EXACT.real:.2g} %"
            rows.append([family, str(n), f"{rate.real:.5f}", f"{rate.imag:.5f}", loss, f"{error:.1e}", last, run])
    run = f"{simulated({'scheme': 'profile'}).real:.4f}"
    rows.append(["exact", "", f"{EXACT.real:.5f}", f"{EXACT.imag:.5f}", "", "", "", f"{run} (profile)"])
    header = ["surface", "elements", "growth", "frequency", "growth lost", "error", "order", "growth in a run"]
    return table(header, rows)


def after_a_step(op: DGOperators) -> tuple[float, float]:
    """Overshoot, and mean error over two sectors, of what leaves a sector into which a step of height 1 has entered."""
    rate, inflow = op.rate()
    turn = np.linspace(0.0, 2.0, 8001)
    step, rest, state = expm(turn[1] * rate), np.linalg.solve(rate, inflow), np.zeros(len(inflow))
    height = np.empty(len(turn))
    for k in range(len(turn)):
        height[k] = op.right @ state
        state = step @ (state + rest) - rest
    return float(height.max() - 1.0), float(np.abs(height - (turn > 1.0)).mean() * 2.0)


def streamline() -> str:
    """Table that the streamline parameter was chosen from."""
    rows = []
    for tau in (0.0, 0.05, 0.1, STREAMLINE, 0.2, 15**-0.5, 0.5, 1.0):
        row = [f"**{tau:.3g}**" if tau == STREAMLINE else f"{tau:.3g}"]
        for n in (16, 64):
            op = supg_operators(n, 1.0, tau)
            over, area = after_a_step(op)
            row += [f"{abs(growth_rate(op, *CASE) - EXACT):.1e}", f"{over:.3f}", f"{area:.4f}"]
        rows.append(row)
    header = ["tau / h", "growth error, 16", "overshoot", "area", "growth error, 64", "overshoot", "area"]
    return table(header, rows)


def difference(reference: dict[str, Array], step: float, keys: dict[str, Any]) -> list[float]:
    """Largest differences from the delay equation, relative to its largest values."""
    end = float(reference["time"][-1])
    scene = load_scene("cutting-v1", keys | {"time.step": step, "time.end": end, "output.interval": EVERY})
    h = StraightRun(scene).string.advance(round(end / step), round(EVERY / step))
    return [float(np.abs(h[q] - reference[q][1:]).max() / np.abs(reference[q]).max()) for q in QUANTITIES]


MOTIONS: dict[str, tuple[str, dict[str, Any], float, tuple[float, ...]]] = {
    "axial": ("axial stick-slip (case V1)", {}, 2.0, (4e-3, 2e-3, 1e-3, 5e-4)),
    "torsional": (
        "axial and torsional stick-slip (started at twice the speed)",
        {"initial.spin_perturbation": 1.0},
        2.5,
        (4e-3, 2e-3, 1e-3, 5e-4),
    ),
    "bounce": (
        "bouncing (nearly no wear flats: 0.1 mm, 16 kN)",
        {"bit.wear_flat_length": 1e-4, "top_drive.weight_on_bit": 16e3},
        0.8,
        (1e-3, 5e-4, 2.5e-4, 1.25e-4),
    ),
}


def references() -> dict[str, dict[str, Array]]:
    """The delay equation of each motion."""
    out = {}
    for name, (_, keys, end, _) in MOTIONS.items():
        out[name] = delay_equation(LumpedBit.from_scene(load_scene("cutting-v1", keys)), end, 1e-9, step=EVERY)
    return out


def steps(reference: dict[str, dict[str, Array]]) -> str:
    """Table of errors over the step, exact profile."""
    rows = []
    for name, (text, keys, _, sizes) in MOTIONS.items():
        errors = np.array([difference(reference[name], h, keys | {"rock.surface.scheme": "profile"}) for h in sizes])
        for h, error in zip(sizes, errors, strict=True):
            rows.append([text, f"{1e3 * h:g} ms", *(f"{e:.1e}" for e in error)])
        orders = [np.polyfit(np.log(sizes), np.log(e), 1)[0] for e in errors.T]
        rows.append(["", "order", *(f"{o:.2f}" for o in orders)])
    return table(["motion", "step", "spin", "depth", "axial speed"], rows)


def surfaces(reference: dict[str, dict[str, Array]]) -> str:
    """Table of errors and cost over the surface."""
    rows = []
    seconds = {name: cost(keys) for name, keys in SURFACES.items()}
    for name, keys in SURFACES.items():
        row = [name]
        for motion, step in (("axial", 5e-4), ("bounce", 1.25e-4)):
            where = {f"rock.surface.{key}": value for key, value in keys.items()}
            row += [f"{e:.1e}" for e in difference(reference[motion], step, MOTIONS[motion][1] | where)[::2]]
        rows.append([*row, f"{seconds[name] / seconds['profile']:.1f}"])
    header = ["surface", "V1: spin", "axial speed", "bounce: spin", "axial speed", "time of a step, profile = 1"]
    return table(header, rows)


def cost(keys: dict[str, Any]) -> float:
    """Processor seconds of a run of case V1 at 2 ms, the least of five."""
    where = {f"rock.surface.{key}": value for key, value in keys.items()}
    best = np.inf
    for _ in range(5):
        string = StraightRun(load_scene("cutting-v1", where | {"time.step": 2e-3, "output.interval": 4e-3})).string
        string.advance(10)
        start = time.process_time()
        string.advance(10_000, 10)
        best = min(best, time.process_time() - start)
    return best


def volume() -> str:
    """Table of what is missing in the books of a wild bit: drilling, hops, turns back."""
    rng = np.random.default_rng(5)
    t = np.arange(6001) * 1e-3
    phi = 14 * t + 2.6 * np.sin(6 * t) + 4e-4 * np.cumsum(rng.normal(size=t.size))
    u = 3e-3 * t + 4e-4 * np.sin(25 * t) + 1e-4 * np.sin(61 * t + 1)
    rows = []
    for scheme in SCHEMES:
        row = [scheme]
        for angles in (None, [0.0, 0.9, 2.1, 3.0, 4.4, 5.3]):
            surface = RockSurface(scheme, 6, angles, incline=-2e-4)
            start, worst = surface.integral(), 0.0
            for k in range(t.size - 1):
                surface.commit(phi[k + 1] - phi[k], u[k], u[k + 1])
                worst = max(worst, abs(surface.integral() - start - surface.removed))
            row.append(f"{worst / surface.removed:.0e}")
        rows.append(row)
    return table(["surface", "equal blades", "unequal blades"], rows)


def picture(reference: dict[str, dict[str, Array]]) -> None:
    """Errors of the growth rate; and the rock that a bouncing bit meets, with one delay and with all of them."""
    colours = (style.GREY, style.ORANGE, style.SKY, style.BLUE, style.GREEN)
    with plt.rc_context(style.RC):
        figure, (left, right) = plt.subplots(1, 2, figsize=(12.5, 4.8), constrained_layout=True)
        for (family, (_, _, cells)), colour in zip(FAMILIES.items(), colours, strict=True):
            dofs, errors = errors_of(family)
            order = -np.polyfit(np.log(cells[-3:]), np.log(errors[-3:]), 1)[0]
            left.loglog(dofs, errors / EXACT.real, "o-", color=colour, label=f"{family}: order {order:.1f}")
        left.set(
            title="Growth rate of the self-excitation",
            xlabel="degrees of freedom of a sector",
            ylabel="error, relative",
        )
        left.set_ylim(1e-11, 2.0)
        left.legend(loc="lower left")
        bounce = reference["bounce"]
        bit = LumpedBit.from_scene(load_scene("cutting-v1", MOTIONS["bounce"][1]))
        single = delay_equation(bit, 0.8, 1e-9, step=EVERY, passages=1)
        late = bounce["time"] > 0.45
        for h, colour, label in ((bounce, style.BLUE, "all passages"), (single, style.VERMILION, "one delay only")):
            right.plot(h["time"][late], 1e3 * h["depth_of_cut"][late], color=colour, label=label)
        several = late & (bounce["passage"] > 1)
        dots = {"color": style.INK, "markersize": 3, "linestyle": "", "marker": "o"}
        right.plot(
            bounce["time"][several], 1e3 * bounce["depth_of_cut"][several], label="rock of an earlier passage", **dots
        )
        right.axhline(0.0, color=style.GREY, linewidth=0.8)
        right.set(
            title="A bit that bounces (delay equation)", xlabel="time, s", ylabel="depth of cut, mm (< 0: off bottom)"
        )
        right.legend()
        figure.savefig(DOCS / "img" / "rock-surface.png")
        plt.close(figure)


def main() -> None:
    reference = references()
    picture(reference)
    passages = {k: int((reference["bounce"]["passage"] == k).sum()) for k in (2, 3)}
    samples = len(reference["bounce"]["time"])
    text = f"""# The rock surface, four ways, and without one

Written by `benchmarks/rock_surface.py`.

`rock.surface.scheme` is one of

| scheme | what it is | order (smooth) |
| --- | --- | --- |
| `dg` | discontinuous Galerkin of `degree` k on `elements` per sector; the default, 2 on 16 | 2k + 1 in what leaves |
| `supg` | continuous linear elements, streamline test function, inflow imposed weakly | 3 |
| `upwind` | first-order upwinding, which is `dg` of degree 0; what most published codes have | 1 |
| `profile` | the exact profile: a ring of knots that move, with cubics between them | 4 in the step |

All are written in the angle that the bit turns. The first three share one system, `mass dL/dphi = matrix L + vector
inflow`, its operators from the UFL forms in `forms/surface.py` (or by NumPy, the same to 1e-12), and one Runge-Kutta
stepping of fourth order. The switch at a blade decides what flows in: the bit's depth, or the rock itself.

![growth rates and bouncing](img/rock-surface.png)

## What a surface leaves of the self-excitation

The axial self-excitation of the lumped model grows at a root of (s² + nψE)(s² + 1) − nρEs² = 0 with
E = 1 − exp(−2πs/(nω₀)); n = 4, ψ = 50, λ = 5, W₀ = 7, ω₀ = 5 has s = {EXACT.real:.5f} + {EXACT.imag:.5f}i. Below:
eigenvalues of the linear model over each surface (`drillfem.bitrock.growth_rate`), and growth fitted to simulations.

{growth()}

Numerical diffusion eats the delay: with upwinding on 64 elements the self-excitation grows 9 % slower than it should.
Discontinuous elements lose nothing worth mention, because what leaves a sector converges with twice the order of
what is in it.

## Streamline parameter

tau is chosen by measurement: growth error, and what leaves a sector into which a step has entered (overshoot, and mean
error over two sectors). The growth error is proportional to tau; without it the step rings.

{streamline()}

## The delay equation

`drillfem.bitrock.delay` is the lumped model without any surface: (5-20) with delays that depend on the state. The rock
ahead is the deepest passage of any blade over the same spot; one passage back in steady drilling, two or three behind a
bit that was off bottom, and the bit's own track (or that of the blades behind it) after turning back. It shares
neither the surfaces nor the solver of the engine: Radau's method with its steps divided where the bit lands, leaves or
turns. Largest differences of the engine (surface `profile`) from it, relative to the largest value:

{steps(reference)}

Where the bit lands the engine is of first order. In the bouncing run {passages[2]} of {samples} samples have rock ahead
that the last passage but one has left, {passages[3]} that the one before has; with one delay only it is another bit
within a bounce. The same comparison with a top that winds the bit back by 17 sectors is in
`tests/physics/test_delay_equation.py`.

The surfaces against the delay equation, at 0.5 ms (V1, 2 s) and 0.125 ms (bouncing, 0.8 s, where rock has steps and
kinks), with the time of a run of V1 at 2 ms:

{surfaces(reference)}

## Volume

Rock that is booked as removed is rock that is gone from the profile, in every step of a bit that drills, hops and turns
back; largest difference relative to all that was removed (`degree` 2, 16 elements):

{volume()}

Round-off for all of them: the elements are conservative by construction, the profile books what it changes. Where a bit
stands or turns back for long, `profile` joins knots closer than 1/2048 of a sector, and books that too: up to some 1e-5
of the volume may then move without being cut.
"""
    (DOCS / "rock-surface.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
