"""`drillfem torque-drag`: hook load, torque and side force of a scene's string, operation by operation."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import SceneError, SimulationError
from ..models.soft_string import Line, line_of
from ..results.atomic import replacing, write_json
from ..results.manifest import check_new_folder
from ..scene.units import to_si
from ..solve.wall_guards import unseen_buckling
from .limits import limits
from .operation import F8, OPERATIONS, Operation, Profile, deepest, operations_of
from .report import Broomstick, Study, buckling_text, dataset, draw, print_table, write_csv
from .soft import greatest_weight, hook_loads, lock_up_depth, soft_string, stations

if TYPE_CHECKING:
    from rich.console import Console

    from ..scene import Scene

METHODS = ("soft", "stations", "stiff")
_TRIPS = ("rotating", "tripping-out", "tripping-in")


def load_of(text: str | None, unit: str, option: str) -> float | None:
    """A load such as ``50 kN`` or ``50000`` in SI units, not negative. Raises SceneError."""
    if text is None:
        return None
    try:
        value = float(text)
    except ValueError:
        try:
            value = to_si(text, unit)
        except ValueError as error:
            raise SceneError(f"{option} {text!r}: must be a number in {unit}, or with such a unit ({error})") from None
    if not value >= 0:
        raise SceneError(f"{option} {text!r}: must be >= 0 {unit}")
    return value


def study(
    scene: Scene,
    operations: list[str] | None = None,
    methods: list[str] | None = None,
    weight_on_bit: float | None = None,
    torque_on_bit: float | None = None,
    friction: str = "dynamic",
    buckled: bool = True,
) -> Study:
    """All that the command shows, for a scene. Raises SceneError."""
    for method in methods or ():
        if method not in METHODS:
            raise SceneError(f"--method {method!r}: must be one of {', '.join(METHODS)}")
    if friction not in ("dynamic", "static"):
        raise SceneError(f"--friction {friction!r}: must be one of dynamic, static")
    line = line_of(scene)
    wanted = operations_of(scene, operations, weight_on_bit, torque_on_bit)
    notes = []
    missing = [o.title for o in OPERATIONS.values() if not operations and o.name not in {w.name for w in wanted}]
    if missing:
        notes.append(f"left out, for want of a weight on bit (--weight-on-bit): {', '.join(missing)}")
    profiles: dict[str, list[Profile]] = {}
    for method in methods or METHODS[:1]:
        if method == "soft":
            profiles[method] = [soft_string(line, o, friction=friction, buckled=buckled) for o in wanted]
        elif method == "stations":
            profiles[method] = [stations(line, o, friction=friction) for o in wanted]
        else:
            profiles[method] = _stiff(scene, wanted, friction, notes)
    depths: F8 = np.linspace(0.02 * line.length, line.length, 50, dtype=np.float64)
    sticks = [
        Broomstick(o.name, depths, hook_loads(line, o, depths, friction=friction, buckled=buckled))
        for o in wanted
        if o.name in _TRIPS
    ]
    notes += _lock_up(line, [o.name for o in wanted], friction, buckled)
    found = limits(line, next(iter(profiles.values()))[0].measured_depth)
    return Study(scene.title, line, profiles, found, sticks, notes)


def coarse(scene: Scene, line: Line, weight: float) -> list[str]:
    """What the guard of a run would say of the mesh of a string that carries a weight on bit (N)."""
    tangent = line.hole.frame(line.length).tangent[0]
    ends = replace(scene.ends, tip_force=tuple(float(x) for x in -weight * tangent))
    return list(unseen_buckling(replace(scene, model="spatial", bit=None, ends=ends)))


def _stiff(scene: Scene, wanted: list[Operation], friction: str, notes: list[str]) -> list[Profile]:
    """The rod's profiles; where it finds no equilibrium, one of nan and a note."""
    from .stiff import sliding_string  # DOLFINx and PETSc

    notes += [f"stiff string: {text}" for text in coarse(scene, line_of(scene), max(o.weight_on_bit for o in wanted))]
    sliding, laid = sliding_string(scene, friction)
    found: list[Profile] = []
    for operation in wanted:
        try:
            found.append(sliding.operate(laid, operation))
        except SimulationError as error:
            notes.append(f"stiff string, {error}")
            none = np.full(2, np.nan)
            found.append(Profile("stiff", operation, np.array([0.0, scene.length]), none, none, none))
    return found


def _lock_up(line: Line, names: list[str], friction: str, buckled: bool) -> list[str]:
    """How far the string can be pushed, in words."""
    notes = []
    if "tripping-in" in names:
        depth = lock_up_depth(line, OPERATIONS["tripping-in"], friction=friction, buckled=buckled)
        if depth is not None:
            notes.append(
                f"tripping in: the hook load is used up with the bit at {depth:.0f} m, from there it needs a push"
            )
    if "sliding" in names:
        most = greatest_weight(line, OPERATIONS["sliding"], friction=friction, buckled=buckled)
        notes.append(f"sliding: the string's own weight can put at most {most / 1e3:.1f} kN on the bit")
    return notes


def run(
    scene: Scene,
    out: Path,
    operations: list[str] | None = None,
    methods: list[str] | None = None,
    weight_on_bit: str | None = None,
    torque_on_bit: str | None = None,
    friction: str = "dynamic",
    buckled: bool = True,
    console: Console | None = None,
) -> Study:
    """Compute, print the table, and write ``torque-drag.csv``, ``.nc``, ``.png`` and ``.json`` into ``out``."""
    check_new_folder(out)
    weight = load_of(weight_on_bit, "N", "--weight-on-bit")
    torque = load_of(torque_on_bit, "N m", "--torque-on-bit")
    found = study(scene, operations, methods, weight, torque, friction, buckled)
    out.mkdir(parents=True, exist_ok=True)
    print_table(found, console)
    write_csv(found, out / "torque-drag.csv")
    with replacing(out / "torque-drag.nc") as part:
        dataset(found).to_netcdf(part, engine="h5netcdf")
    draw(found, out / "torque-drag.png")
    write_json(
        out / "torque-drag.json",
        {
            "scene": scene.to_dict(),
            "friction": friction,
            "buckled": buckled,
            "notes": found.notes,
            "operations": [
                {
                    "method": p.method,
                    "operation": p.operation.name,
                    "weight_on_bit": p.operation.weight_on_bit,
                    "torque_on_bit": p.operation.torque_on_bit,
                    "hook_load": p.hook_load,
                    "surface_torque": p.surface_torque,
                    "largest_side_force": deepest(p, p.side_force)[0],
                    "largest_side_force_at": deepest(p, p.side_force)[1],
                    "buckling": buckling_text(p, found.limits),
                }
                for profiles in found.profiles.values()
                for p in profiles
            ],
        },
    )
    for name in ("torque-drag.png", "torque-drag.csv", "torque-drag.nc"):
        print(out / name)
    return found
