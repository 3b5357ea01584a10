"""Torque and drag measured: errors and orders, welleng on the same survey, what the wrong sign of a bend costs.

Writes docs/torque-and-drag.md and its picture in seconds of one core. Needs welleng.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from common import DOCS, processor_seconds, table

from drillfem.boreholes import Borehole, arc, find, read_survey, straight, survey
from drillfem.models.soft_string import Line, Pieces
from drillfem.scene import load_scene
from drillfem.torque_drag import OPERATIONS, Operation, johancsik, soft_string, stations
from drillfem.torque_drag.command import study
from drillfem.torque_drag.report import draw

Array = npt.NDArray[np.float64]
STATIONS = read_survey(find("p11-a-02"))
REAL = survey(STATIONS, diameter=0.2159)
W, R, EI, MU = 300.0, 0.08, 1.3e6, 0.3


def line(hole: Borehole, length: float, weight: float = W, mu: float = MU) -> Line:
    """A uniform string."""
    one = np.ones(1)
    return Line(hole, Pieces(length * one, weight * one, R * one, EI * one), (mu, mu))


def closed_forms() -> str:
    """Against what is known exactly."""
    rows = []
    on = line(straight(1000.0, 1.0, diameter=0.2159), 1000.0)
    exact = 1000 * W * (math.cos(1.0) + MU * math.sin(1.0))
    found = soft_string(on, OPERATIONS["tripping-out"])
    rows.append(["straight, 57 deg, pulled: w L (cos i + μ sin i)", f"{abs(found.hook_load / exact - 1):.0e}"])
    rows.append(["side force there: w sin i", f"{np.abs(found.side_force / (W * math.sin(1.0)) - 1).max():.0e}"])
    bend = line(arc(1200.0, 600.0, diameter=0.2159), 1200.0, weight=0.0)
    pulled = soft_string(bend, replace(OPERATIONS["tripping-out"], weight_on_bit=-1e5))
    rows.append(["capstan, 2 rad, μ = 0.3: exp(μ θ)", f"{abs(pulled.hook_load / 1e5 / math.exp(0.6) - 1):.0e}"])
    real = line(REAL, 2691.0)
    turning = soft_string(real, OPERATIONS["rotating"])
    deep = float(REAL.frame(2691.0).position[0, 2])
    rows.append(["P11-A-02, turning: w times the depth", f"{abs(turning.hook_load / (W * deep) - 1):.0e}"])
    for name in ("tripping-out", "tripping-in", "rotating"):
        fine = soft_string(real, OPERATIONS[name], spacing=0.05)
        here = soft_string(real, OPERATIONS[name])
        rough = stations(real, OPERATIONS[name])
        values = [(p.surface_torque if name == "rotating" else p.hook_load) for p in (here, rough, fine)]
        what = "torque" if name == "rotating" else "hook load"
        error = abs(values[0] / values[2] - 1), abs(values[1] / values[2] - 1)
        rows.append(
            [
                f"P11-A-02, {OPERATIONS[name].title}: {what}, against steps of 5 cm",
                f"{error[0]:.0e}; sum {error[1]:.1e}",
            ]
        )
    seconds = processor_seconds(lambda: soft_string(real, OPERATIONS["rotating"]))
    rows.append(["time of one operation, 600 steps", f"{1e3 * seconds:.1f} ms"])
    return table(["", "relative error"], rows)


def against_welleng() -> str:
    """welleng on the same survey, the same sum with the right sign, and the differential equation."""
    import welleng
    from welleng import architecture, torque_drag

    warnings.simplefilter("ignore")
    md, inclination, azimuth = STATIONS.T
    header = welleng.survey.SurveyHeader(deg=False)
    path = welleng.survey.Survey(md, inclination, azimuth, header=header, deg=False)
    wall = architecture.WellBore("wall", 0.0, md[-1], method="top_down")
    wall.add_section(bottom=md[-1], id=0.2159, coeff_friction_sliding=MU)
    pipe = architecture.BHA("pipe", 0.0, md[-1], method="top_down")
    pipe.add_section(bottom=md[-1], od=2 * R, unit_weight=W / (1 - 1.2 / 7.85), density=7.85)
    theirs = torque_drag.TorqueDrag(path, wall, pipe, fluid_density=1.2, wob=5e4, tob=4e3)
    mean, builds = (inclination[1:] + inclination[:-1]) / 2, np.diff(inclination)
    turns = (np.diff(azimuth) + np.pi) % (2 * np.pi) - np.pi
    one = np.ones(len(mean))

    def summed(operation: Operation, lowest: tuple[float, float], sign: float) -> tuple[float, float]:
        friction = np.sign(operation.speed) * MU * one, np.sign(operation.spin) * MU * one
        t, m, _ = johancsik(np.diff(md), mean, sign * builds, turns, W * one, friction, R * one, lowest)
        return float(t[0]), float(m[0])

    rows = []
    keys = {"rotating": "rotating", "tripping-out": "pickup", "tripping-in": "slackoff", "drilling": "drilling"}
    for name, key in keys.items():
        lowest = (-5e4, 4e3) if name == "drilling" else (0.0, 0.0)
        operation = replace(OPERATIONS[name], weight_on_bit=-lowest[0], torque_on_bit=lowest[1])
        exact = soft_string(line(REAL, 2691.0), operation, buckled=False)
        right, wrong = summed(operation, lowest, 1.0), summed(operation, lowest, -1.0)
        twist = bool(operation.spin)
        numbers = [
            float(np.asarray((theirs.torque if twist else theirs.tension)[key])[0]),
            wrong[twist],
            right[twist],
            exact.surface_torque if twist else exact.hook_load,
        ]
        what = "torque, kN m" if twist else "hook load, kN"
        rows.append(
            [
                f"{operation.title}: {what}",
                *(f"{x / 1e3:.3f}" for x in numbers),
                f"{100 * (numbers[0] / numbers[3] - 1):+.1f} %",
            ]
        )
    head = ["", "welleng 0.30", "`johancsik`, its sign", "right sign", "drillfem", "welleng off by"]
    return table(head, rows)


def main() -> None:
    """Measure, draw, write."""
    (DOCS / "img").mkdir(exist_ok=True)
    found = study(load_scene("survey-p11-a-02"), weight_on_bit=8e4, torque_on_bit=5e3)
    draw(found, DOCS / "img" / "torque-drag-p11.png")
    loads = {p.operation.name: p for p in found.first}
    text = TEXT.replace("{closed}", closed_forms()).replace("{welleng}", against_welleng())
    rows = [
        [
            p.operation.title,
            f"{p.hook_load / 1e3:.1f}",
            f"{p.surface_torque / 1e3:.2f}" if p.operation.spin else "-",
            f"{p.side_force.max() / 1e3:.2f}",
        ]
        for p in loads.values()
    ]
    text = text.replace("{table}", table(["", "hook load (kN)", "torque (kN m)", "side force, up to (kN/m)"], rows))
    (DOCS / "torque-and-drag.md").write_text(text)


TEXT = """# Torque and drag

Written by `benchmarks/torque_drag.py`.

    drillfem torque-drag SCENE --out DIR [--operation NAME]... [--weight-on-bit LOAD] [--torque-on-bit TORQUE]

answers what hangs on the hook, what turns the string, and where it presses on the wall, while the whole string
moves steadily. SCENE needs a hole and `[contact]`; the string lies in it from the top down.

| operation | motion | at the bit |
| --- | --- | --- |
| `rotating` | turns off bottom | free |
| `tripping-out`, `tripping-in` | up, down the hole | free |
| `drilling` | turns; goes down too slowly for friction to notice | weight and torque |
| `sliding` | down the hole | weight |

Weight on bit is the scene's, or given; torque on bit is that of the scene's bit under it, or given. `--friction
static` takes the static coefficient: what it needs to break loose. `--method` chooses between `soft` and
`stations`, and shows both if given twice. The folder holds `torque-drag.png`, `.csv` (a row per method,
operation and depth), `.nc` (for xarray) and `.json`.

![torque and drag of P11-A-02](img/torque-drag-p11.png)

`survey-p11-a-02` with 80 kN and 5 kN m on the bit:

{table}

## Soft string

    dF/ds = −w cos i + μ N (share of the motion down the hole)
    dM/ds = −μ N r (share about it)                                        from the bit upwards
    N = |F t′ + w − (w·t) t| = √((F i′ − w sin i)² + (F a′ sin i)²)

F is the effective tension (buoyed weight w), M the torque handed down, t the tangent of the hole, i and a
inclination and azimuth, r the radius that touches (`contact_diameter`). A motion both ways shares the friction
by its direction, so that turning frees a string: `Operation("reaming", "reaming", speed=-0.1, spin=10)`.
Coefficients change along the hole (`[[hole.section]]`, `contact.friction_profile`).

The sign matters. Where a hole builds, tension lifts the string off the low side; i′ is the gain down the hole,
and N is the difference. Johancsik counts angles from the bit upwards, where the same term has a plus.

Steps of fourth order between the places where anything jumps, 5 m long; where N passes zero the slope of N
jumps, which is what is left of the error. `stations` is Johancsik's own sum over the survey's stations, of
first order:

{closed}

```python
from drillfem.models.soft_string import line_of
from drillfem.torque_drag import OPERATIONS, greatest_weight, limits, lock_up_depth, soft_string

line = line_of(scene)
found = soft_string(line, OPERATIONS["tripping-out"])
found.hook_load, found.surface_torque, found.measured_depth, found.tension, found.torque, found.side_force
soft_string(line.to_depth(1500.0), OPERATIONS["rotating"])      # with the bit at 1500 m
```

## welleng

The same survey and a uniform string (300 N/m, radius 80 mm, μ = 0.3, 50 kN and 4 kN m on the bit where it
drills). Its numbers come out of `drillfem.torque_drag.johancsik` to round-off if the build changes its sign
(`tests/unit/test_torque_drag.py`): it counts the build down the hole, and adds it as if counted up. In a well
that builds from vertical to level that presses a pulled string down where it should lift it:

{welleng}

## Buckling, and how far a string can be pushed

A compressed string in clearance r buckles at 2 √(EI N/r) into a sine wave (Dawson and Paslay 1984) and at 2.83
√(EI N/r) into a helix (Chen, Lin and Cheatham 1990; 3.66 where all of it has wound up, Wu and Juvkam-Wold
1993). N is the force on the wall of the straight string under the same load (He and Kyllingstad 1995): a hole
that builds holds a pushed string down, one that drops lets it go. In a vertical hole the limits are those of
the column, 1.94 and 5.55 (EI w²)^(1/3). The chart shades the loads beyond a limit, and marks where an operation
exceeds it; the table says from where to where.

Wound up, a string presses on the wall with r F²/(4 EI) more, and friction grows with the push: it locks up.
This is taken into account (`--no-buckled` leaves it out). The command says with the bit at which depth the hook
load is used up when tripping in, and how much weight the string can put on the bit when sliding; the panel
"hook load" shows it with the bit at every depth. In a level hole, wound up all along, the tension is a tangent
of the length: met to 1e-6."""

if __name__ == "__main__":
    main()
