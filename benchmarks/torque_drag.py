"""Torque and drag measured: errors and orders, welleng on the same survey, what the wrong sign of a bend costs.

Also the stiff string beside the soft one. Writes docs/torque-and-drag.md and its picture in a minute of one core. Needs
welleng.
"""

from __future__ import annotations

import math
import time
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from common import DOCS, processor_seconds, table

from drillfem.boreholes import Borehole, arc, find, read_survey, straight, survey
from drillfem.models.soft_string import Line, Pieces, line_of
from drillfem.scene import Scene, load_scene
from drillfem.torque_drag import OPERATIONS, Operation, johancsik, soft_string, stations
from drillfem.torque_drag.command import study
from drillfem.torque_drag.operation import operations_of
from drillfem.torque_drag.report import draw
from drillfem.torque_drag.stiff import sliding_string, stiff_string

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


# -- stiff string ----------------------------------------------------------------------------------------------------
def beside() -> str:
    """Hook load and torque of the rod beside the soft string's, every operation of two wells."""
    rows = []
    for name, weight, torque in (("off-bottom", 5e4, 3e3), ("survey-p11-a-02", 8e4, 5e3)):
        case = load_scene(name)
        for rod in stiff_string(case, operations_of(case, None, weight, torque)):
            soft = soft_string(line_of(case), rod.operation)
            cells = [f"{name}, {rod.operation.title}"]
            for a, b, turned in (
                (soft.hook_load, rod.hook_load, True),
                (soft.surface_torque, rod.surface_torque, bool(rod.operation.spin)),
            ):
                difference = f"{100 * (b / a - 1):+.2f} %" if turned else "-"
                cells += [f"{a / 1e3:.2f}", f"{b / 1e3:.2f}", difference] if turned else 3 * ["-"]
            rows.append(cells)
    head = ["", "hook load, soft, kN", "stiff", "difference", "torque, soft, kN m", "stiff", "difference"]
    return table(head, rows)


def narrow() -> str:
    """P11-A-02 with less and less clearance in its pipe, and what is left of the difference."""
    case, rows = load_scene("survey-p11-a-02"), []
    for diameter in (None, 0.19, 0.205):
        string = case.string if diameter is None else [replace(s, contact_diameter=diameter) for s in case.string]
        one = replace(case, string=tuple(string))
        operations = operations_of(one, ["rotating", "tripping-out", "tripping-in"])
        line = line_of(one)
        clearance = line.at(np.array([500.0])).clearance[0]
        cells = [f"{1e3 * clearance:.1f} mm" + (" (the scene)" if diameter is None else "")]
        for rod in stiff_string(one, operations):
            soft = soft_string(line, rod.operation)
            turns = bool(rod.operation.spin)
            ratio = rod.surface_torque / soft.surface_torque if turns else rod.hook_load / soft.hook_load
            cells.append(f"{100 * (ratio - 1):+.2f} %")
        rows.append(cells)
    return table(["clearance in the casing", "torque, rotating", "hook load, tripping out", "tripping in"], rows)


def rod_scene(length: float, hole: dict[str, Any], mass: float, **tables: Any) -> Scene:
    """A uniform string 140 mm wide in a hole 10 mm wider than its radius, friction MU, g = 10 m/s2."""
    stiffness = {"axial": 1e9, "shear": 3e8, "bending": 1e5 if mass > 1 else 1e4, "torsion": 1e6}
    string = {
        "name": "string",
        "length": length,
        "outer_diameter": 0.14,
        "mass_per_length": mass,
        "rotary_inertia": 1.0,
        "stiffness": stiffness,
    }
    data: dict[str, Any] = {
        "string": [string],
        "hole": hole | {"diameter": 0.16 if mass > 1 else 0.142},
        "contact": {"stiffness": 1e5 if mass > 1 else 1e7, "friction_static": MU, "friction_dynamic": MU},
        "gravity": {"magnitude": 10.0},
        "ends": {"top": "hung", "bottom": "free"},
        "initial": {"state": "laid"},
        "model": "spatial",
        "mesh": {"elements": 60},
        "time": {"end": 1, "step": 0.1},
    }
    return Scene.from_dict(data | tables)


def rod_closed_forms() -> str:
    """The rod against what is known exactly."""
    across, along, rows = 300.0 * math.sin(math.pi / 3), 300.0 * math.cos(math.pi / 3), []
    case = rod_scene(600.0, {"kind": "straight", "inclination": math.pi / 3}, 30.0)
    climbs = math.sqrt(1 + MU**2)
    out, turned = stiff_string(case, [OPERATIONS["tripping-out"], OPERATIONS["rotating"]])
    for found, what, side, values, rate in (
        (out, "pulled: tension falls by w (cos i + μ sin i)", across, out.tension, along + MU * across),
        (
            turned,
            "turned: torque by μ w sin i r/√(1 + μ²)",
            across / climbs,
            turned.torque,
            MU * 0.07 * across / climbs,
        ),
    ):
        inside = (found.measured_depth > 60) & (found.measured_depth < 540)
        slope = -np.polyfit(found.measured_depth[inside], values[inside], 1)[0]
        rows.append([f"straight, 60 deg, {what}", f"{abs(slope / rate - 1):.0e}"])
        error = np.abs(found.side_force[inside] / side - 1).max()
        rows.append(["  side force there, more than 60 m from the ends", f"{error:.0e}"])
    # a light string, gravity towards the inside of the bend, where the pull holds it
    gravity = {"magnitude": 10.0, "direction": [math.sqrt(0.5), 0.0, -math.sqrt(0.5)]}
    bend = rod_scene(100 * math.pi, {"kind": "arc", "radius": 200.0}, 0.03, gravity=gravity)
    for name, sign in (("tripping-out", 1), ("tripping-in", -1)):
        operation = replace(OPERATIONS[name], weight_on_bit=-1e6)
        (pulled,) = stiff_string(bend, [operation])
        error = abs(pulled.hook_load / 1e6 / math.exp(sign * MU * math.pi / 2) - 1)
        rows.append(
            [f"capstan, 90 deg, μ = 0.3, {operation.title}; its ends leave the wall: exp(±μ θ)", f"{error:.0e}"]
        )
    return table(["rod", "relative error"], rows)


def rod_meshes() -> str:
    """P11-A-02: what the mesh costs."""
    operations = [OPERATIONS["tripping-out"], OPERATIONS["rotating"]]

    def numbers(elements: int) -> tuple[Array, float]:
        sliding, laid = sliding_string(load_scene("survey-p11-a-02", {"mesh.elements": elements}))
        start = time.process_time()
        out, turned = (sliding.operate(laid, operation) for operation in operations)
        seconds = (time.process_time() - start) / 2
        return np.array([out.hook_load, turned.surface_torque]), seconds

    exact, _ = numbers(1200)
    rows = []
    for elements in (75, 150, 300, 600):
        found, seconds = numbers(elements)
        rows.append([f"{elements}", *(f"{e:.0e}" for e in np.abs(found / exact - 1)), f"{seconds:.2f}"])
    return table(["elements", "hook load, tripping out", "torque, rotating", "CPU seconds per operation"], rows)


def main() -> None:
    """Measure, draw, write."""
    (DOCS / "img").mkdir(exist_ok=True)
    found = study(load_scene("survey-p11-a-02"), weight_on_bit=8e4, torque_on_bit=5e3)
    draw(found, DOCS / "img" / "torque-drag-p11.png")
    both = study(load_scene("survey-p11-a-02"), None, ["soft", "stiff"], 8e4, 5e3)
    draw(both, DOCS / "img" / "torque-drag-stiff.png")
    loads = {p.operation.name: p for p in found.first}
    text = TEXT.replace("{closed}", closed_forms()).replace("{welleng}", against_welleng())
    for part in (beside, narrow, rod_closed_forms, rod_meshes):
        text = text.replace(f"{{{part.__name__}}}", part())
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
    (DOCS / "torque-and-drag.md").write_text(text, encoding="utf-8")


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
static` takes the static coefficient: what it needs to break loose. `--method` chooses between `soft`,
`stations` and `stiff`, and shows all that are given. The folder holds `torque-drag.png`, `.csv` (a row per method,
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
soft_string(line.to_depth(1500.0), OPERATIONS["rotating"])  # with the bit at 1500 m
```

## Stiff string

`--method stiff` is the rod itself, with its bending stiffness, its clearance and its contact: laid in the hole
without friction, then slid steadily, so that friction μ N points against the motion of every touching point,
which is known. Loads and friction grow together, in steps that are halved where Newton's iteration fails. All
operations of the table above; motions both ways too.

    drillfem torque-drag survey-p11-a-02 --out td --method soft --method stiff --weight-on-bit '80 kN'

![soft and stiff string in P11-A-02](img/torque-drag-stiff.png)

The same wells and loads (50 kN and 3 kN m; 80 kN and 5 kN m), by both:

{beside}

In a smooth well they agree, but for the torque: a string that turns climbs the wall until friction and weight
balance, and presses less, N = w sin i/√(1 + μ²) (1.1 % at μ = 0.15, 2.3 % at 0.22); the soft string of the books
does not climb. In a real survey, the clearance counts as well: a pulled string cuts the corners of the doglegs by
as much as it has room, and rubs less. With the pipe made as wide as here, half of that goes:

{narrow}

The largest side force is another matter: a rod bears on stabilisers and on the edges of doglegs, over a length
that its stiffness and the wall's decide (10.9 kN/m at the stabilisers of P11-A-02, where the soft string has
1.2), a soft string on all of its length. Compare forces per joint, not per metre.

{rod_closed_forms}

{rod_meshes}

Errors against 1200 elements. Where compression comes near buckling on a mesh too coarse for its waves, the
command says so, with the elements it takes; where friction leaves Newton's iteration no way on (a string that
buckles while it slides), it names how far loads and friction got and shows dashes (`drillfem torque-drag
off-bottom --method stiff --weight-on-bit '400 kN' --torque-on-bit '3 kN m'`: 85 % drilling, 64 % sliding).

In Python: `drillfem.torque_drag.stiff.stiff_string(scene, operations)`, profiles as above with `bending_moment`,
`gap` and `touching` (share of every element on the wall).

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
of the length: met to 1e-6.
"""

if __name__ == "__main__":
    main()
