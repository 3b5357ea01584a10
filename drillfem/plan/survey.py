"""The plan of a scene: the rung it needs, what the rules found, what pilot runs measured, what one rung lower loses."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import Any

from drillfem.meshes.points import distribute
from drillfem.plan.pilot import Pilot, run_pilot
from drillfem.results.atomic import plain
from drillfem.scene import Scene
from drillfem.scene.ladder import BESIDE, MODELS, Finding, findings, giver, lowest, obstacle, rank
from drillfem.scene.nominal import lumps, quantity
from drillfem.scene.tables import GIVES


@dataclass(frozen=True)
class Rung:
    """A rung for this scene.

    ``obstacle``: why it cannot run or give what is wanted, or empty. ``by_rules``: what the rules estimate it to be
    off by, relative; None where they have no estimate. ``measured``: the pilot's error by output against its highest
    rung. ``speed``: simulated over wall time, ``wall`` the seconds that the whole run takes with it, ``dofs`` unknowns.
    """

    model: str
    obstacle: str
    by_rules: float | None
    measured: dict[str, float]
    speed: float | None
    wall: float | None
    dofs: int | None
    main_wave: float | None

    @property
    def off(self) -> float | None:
        """The greatest measured error; None without a pilot, or for its highest rung."""
        return max(self.measured.values(), default=None)


@dataclass(frozen=True)
class Plan:
    """What `plan_of` found. ``chosen``: the lowest rung that represents the scene; ``runs_with``: the one that its
    ``model`` key leads to. ``error``: expected relative error by cause. ``lost``: what the rung ``lower`` lacks.
    ``beside``: models beside the ladder that this scene could be run with."""

    scene: Scene
    chosen: str
    reason: str
    runs_with: str
    findings: tuple[Finding, ...]
    rungs: tuple[Rung, ...]
    pilot: Pilot | None
    error: dict[str, float]
    lower: str
    lost: tuple[str, ...]
    notes: tuple[str, ...]
    beside: tuple[Rung, ...] = ()

    def rung(self, model: str) -> Rung:
        """The rung of that name."""
        return next(r for r in (*self.beside, *self.rungs) if r.model == model)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        told = {
            "scene": self.scene.name,
            "model": self.chosen,
            "reason": self.reason,
            "runs_with": self.runs_with,
            "wanted": list(self.scene.output.wanted or ()),
            "tolerance": self.scene.output.tolerance,
            "rules": [asdict(replace(f, numbers=dict(f.numbers))) for f in self.findings],
            "rungs": [asdict(r) | {"off": r.off} for r in self.rungs],
            "beside": [asdict(r) | {"off": r.off} for r in self.beside],
            "pilot": None if self.pilot is None else {"seconds": self.pilot.seconds, "reference": self.pilot.reference},
            "expected_error": self.error,
            "lower": self.lower,
            "lost": list(self.lost),
            "notes": list(self.notes),
        }
        return dict(plain(told))


def plan_of(scene: Scene, pilot: bool = True) -> Plan:
    """Plan a scene: apply the rules of the ladder and, if ``pilot``, measure them on short runs (seconds).

    Raises SceneError if no rung gives what is wanted.
    """
    wanted = replace(scene, model="auto")
    asked = scene.model if scene.model != "auto" else None
    chosen, reason = lowest(wanted.checked() if scene.output.wanted else wanted)
    found = findings(wanted)
    unbound = replace(scene, output=replace(scene.output, wanted=None))  # what a rung could run, whatever it gives
    able = [m for m in MODELS if not obstacle(unbound, m)]
    lower = next((m for m in reversed(able) if rank(m) < rank(chosen)), "")
    others = [m for m in BESIDE if scene.hole.bends and not obstacle(unbound, m)]
    worth = [*_worth(able, chosen), *others]
    measured = run_pilot(replace(scene, model=asked or chosen), chosen, worth) if pilot else None
    rungs = tuple(_rung(scene, m, found, measured) for m in MODELS)
    error = _expected(rungs[rank(chosen)], measured)
    plan = Plan(
        scene,
        chosen,
        reason,
        asked or chosen,
        found,
        rungs,
        measured,
        error,
        lower,
        (),
        (),
        tuple(_rung(scene, m, (), measured) for m in others),
    )
    return replace(plan, lost=_lost(plan), notes=_notes(plan))


def _worth(able: list[str], chosen: str) -> list[str]:
    """Rungs to pilot: the straight ones, which cost next to nothing, the chosen one and its neighbours."""
    near = {chosen, *[m for m in able if rank(m) > rank(chosen)][:1], *[m for m in able if rank(m) < rank(chosen)][-1:]}
    if chosen in able[:3] and "spatial" in able and rank(chosen) >= rank("axial-torsional"):
        near.add("spatial")
    return [m for m in able if m in near or rank(m) < rank("planar")]


def _rung(scene: Scene, model: str, found: tuple[Finding, ...], pilot: Pilot | None) -> Rung:
    below = [f.error for f in found if f.error is not None and rank(f.needs) > rank(model)]
    waves = {f.rule: f.error for f in found if f.error is not None}
    by_rules = max(below, default=None)
    if by_rules is None and waves:  # it passes: by what the rules put it off
        kinds = {"lumped": ("axial waves", "torsional waves"), "torsional": ("axial waves",)}.get(model, ())
        by_rules = max((waves[k] or 0.0 for k in kinds if k in waves), default=0.0)
    if below == [] and rank(model) >= rank("planar"):  # there is nothing to be off from
        by_rules = None
    speed = pilot.speed.get(model) if pilot else None
    why = obstacle(scene, model)
    if pilot and not why and model in pilot.failed:
        why = f"could not be tried: {pilot.failed[model]}"
    return Rung(
        model,
        why,
        by_rules,
        _measured(model, pilot) if pilot else {},
        speed,
        (scene.time.end - scene.time.start) / speed if speed else None,
        pilot.dofs.get(model) if pilot else None,
        pilot.main_wave.get(model) if pilot else None,
    )


def _measured(model: str, pilot: Pilot) -> dict[str, float]:
    """What the pilot measured a model to be off by; of one beside the ladder, its side force at the start."""
    laid = {"side_force": abs(pilot.laid[model])} if model in pilot.laid else {}
    return laid | dict(pilot.off.get(model, {}))


def _expected(rung: Rung, pilot: Pilot | None) -> dict[str, float]:
    """Expected error of the chosen rung by cause, relative."""
    error = {}
    if rung.off is not None:
        error["model"] = rung.off
    elif rung.by_rules is not None and rank(rung.model) < rank("planar"):  # above, the rules have nothing to compare
        error["model, by the rules"] = rung.by_rules
    if pilot is not None and pilot.subject == rung.model:
        for cause in ("half step", "double mesh"):
            if found := pilot.numerics.get(cause):
                error[cause] = max(found.values())
        starts = [max(x.values()) for name, x in pilot.numerics.items() if name.startswith("start") and x]
        if starts:
            error["nearby starts"] = max(starts)
    return error


# -- what is lost -----------------------------------------------------------------------------------------
def _lost(plan: Plan) -> tuple[str, ...]:
    """What the highest lower rung that could run the scene would leave out."""
    scene, chosen, lower = plan.scene, plan.chosen, plan.lower
    if not rank(chosen):
        return ("there is no lower rung",)
    beside = [f"beside the ladder: {_LEFT_OUT[r.model]}" for r in plan.beside]
    if not lower:
        why = obstacle(replace(scene, output=replace(scene.output, wanted=None)), MODELS[rank(chosen) - 1])
        found = [f"{f.rule}: {f.text}" for f in plan.findings if rank(f.needs) >= rank(chosen)]
        return (f"no lower rung can run it: {why}", *found, *beside)
    lost = []
    outputs = [n for m in MODELS[rank(lower) + 1 : rank(chosen) + 1] for n in GIVES[m]]
    if outputs:
        lost.append("outputs: " + ", ".join(outputs))
    if missing := [n for n in scene.output.wanted or () if rank(giver(n)) > rank(lower)]:
        lost.append("of what is wanted: " + ", ".join(missing))
    if rank(chosen) >= rank("planar") > rank(lower):
        lost.append("bending, buckling, whirl, and contact and friction at the wall")
    elif chosen == "spatial" and lower == "planar":
        lost.append("whatever leaves the plane: whirl, helices, turning about the axis")
    if lower in ("lumped", "torsional") and rank(chosen) > rank("torsional"):
        lump = lumps(scene)
        lost.append(
            f"axial waves and their damping: a rigid mass of {lump.mass / 1e3:.3g} t in the place of a string of "
            f"{scene.mass / 1e3:.3g} t"
        )
    if lower == "lumped":
        lost.append("torsional waves: all natural frequencies but one")
    lost += [f"{f.rule}: {f.text}" for f in plan.findings if rank(f.needs) > rank(lower)]
    rung = plan.rung(lower)
    if rung.measured and plan.pilot is not None:
        parts = ", ".join(f"{name} {_share(x)}" for name, x in rung.measured.items())
        waves = [plan.rung(m).main_wave for m in (lower, plan.pilot.reference)]
        text = f"measured by a pilot run of {plan.pilot.seconds:g} s: {parts} off"
        if waves[0] and waves[1]:
            text += f"; the bit swings at {waves[0]:.3g} Hz, not {waves[1]:.3g} Hz" if _differ(*waves) else ""
        lost.append(text)
    return (*lost, *beside)


_LEFT_OUT = {
    "soft-string": "soft-string twists in the curved hole, rubs on its wall with the force of weight and tension, and "
    "leaves out bending stiffness, clearance, and all motion but the twist: buckling, whirl, lift-off, axial "
    "waves, and friction that the motion along the hole takes away",
}


def _differ(a: float | None, b: float | None) -> bool:
    return bool(a and b and abs(a - b) > 0.02 * b)


def _share(x: float) -> str:
    return f"{100 * x:.0f} %" if x >= 0.1 else f"{100 * x:.2g} %"


# -- what else the user should know -----------------------------------------------------------------------
def _notes(plan: Plan) -> tuple[str, ...]:
    scene, pilot, notes = plan.scene, plan.pilot, []
    tolerance, chosen = scene.output.tolerance, plan.rung(plan.chosen)
    if plan.runs_with != plan.chosen:
        why = obstacle(scene, plan.runs_with)
        richer = rank(plan.runs_with) > rank(plan.chosen)
        tail = f": {why}" if why else ", which is more than it needs" if richer else ""
        notes.append(f"model = {plan.runs_with!r} is asked for{tail}; 'auto' would take {plan.chosen}")
    if chosen.off is not None and chosen.off > tolerance and pilot is not None:
        name = max(chosen.measured, key=lambda n: chosen.measured[n])
        notes.append(
            f"the pilot contradicts the rules: {plan.chosen} is {_share(chosen.off)} off in {name}, more than "
            f"{_share(tolerance)}; take {pilot.reference}"
        )
    for rung in plan.rungs[: rank(plan.chosen)]:
        if rung.off is not None and rung.off <= tolerance and not rung.obstacle:
            notes.append(f"in the pilot {rung.model} is within {_share(tolerance)} too ({_share(rung.off)})")
    moved = max(plan.error.get(cause, 0.0) for cause in ("half step", "double mesh"))
    if moved > tolerance:
        undamped = all(s.retardation_time == 0 for s in scene.string)
        why = "; without damping (retardation_time) waves of every length grow, and no mesh is fine enough" * undamped
        notes.append(f"half the step or a double mesh change {plan.chosen} by {_share(moved)}{why}")
    scatter = plan.error.get("nearby starts", 0.0)
    if scatter > tolerance:
        notes.append(f"nearby starts differ by {_share(scatter)}: errors below that say nothing about a model")
    buckling = next((f for f in plan.findings if f.rule == "buckling"), None)
    critical = buckling.numbers.get("critical", math.inf) if buckling else math.inf
    if buckling is not None and rank(buckling.needs) < rank("planar") and pilot is not None and pilot.peak_weight:
        if pilot.peak_weight > critical:
            notes.append(
                f"weight on bit reaches {quantity(pilot.peak_weight, 'N')} in the pilot, for moments above the "
                f"{quantity(critical, 'N')} at which the string buckles: model = 'spatial' shows what comes of it"
            )
        tilting = buckling.numbers.get("critical_tilting", math.inf)
        if buckling.numbers["compression"] > tilting:
            notes.append(
                f"a bit that could tilt would buckle the string at {quantity(tilting, 'N')}: it stays straight "
                "because the rungs, as the thesis, hold the bit upright"
            )
    if buckling is not None and rank(buckling.needs) >= rank("planar"):
        notes += _buckled(scene)
    bent = [f for f in plan.findings[:2] if rank(f.needs) >= rank("planar")]
    if rank(plan.chosen) >= rank("planar") and not bent:
        notes.append(
            "the scene starts straight and nothing disturbs it, so it will stay straight, stable or not: to see more, "
            "tilt gravity a little (gravity.direction = [1e-3, 0, 1])"
        )
    return tuple(notes)


def _buckled(scene: Scene) -> list[str]:
    """What a buckled string needs to be computed rightly: a wall, and elements that see it."""
    if scene.contact is None:
        return ["there is no [contact]: nothing stops a buckled string"]
    counts = distribute([s.length for s in scene.string], scene.mesh.elements)
    coarse = []
    for section, n in zip(scene.string, counts, strict=True):
        layer = (4 * section.section_stiffness().bending1 / scene.contact.stiffness) ** 0.25
        need = min(2.0, layer / 2)
        if section.length / n > need:
            coarse.append((section, section.length / n, layer, need))
    return [
        f"mesh: elements of {h:.3g} m in {s.name!r} do not see where it leaves the wall, within "
        f"(4 EI/k)^(1/4) = {layer:.3g} m; take {need:.2g} m or less ({math.ceil(s.length / need)} in that section)"
        for s, h, layer, need in coarse
    ]
