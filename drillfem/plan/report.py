"""A plan as text, for the command line."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace

from drillfem.plan.survey import Plan, Rung, plan_of
from drillfem.scene import Output, load_scene
from drillfem.scene.keys import read
from drillfem.scene.ladder import MODELS


def _percent(x: float | None) -> str:
    if x is None:
        return "-"
    if x >= 1:
        return ">= 100 %"
    return f"{100 * x:.0f} %" if x >= 0.1 else f"{100 * x:.2g} %"


def _table(rows: list[tuple[str, ...]], indent: str = "  ") -> list[str]:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return [indent + "  ".join(f"{x:{w}}" for x, w in zip(row, widths, strict=True)).rstrip() for row in rows]


def _speed(rung: Rung) -> tuple[str, str]:
    if rung.speed is None or rung.wall is None:
        return "-", "-"
    wall = f"{rung.wall:.2g} s" if rung.wall < 120 else f"{rung.wall / 60:.3g} min"
    return f"{rung.speed:.2g}" if rung.speed < 100 else f"{rung.speed:.0f}", wall


def as_text(plan: Plan) -> str:
    """The plan in lines: choice, reason, rules, rungs with error and cost, what is lost one rung lower, notes."""
    scene, pilot = plan.scene, plan.pilot
    wanted = ", ".join(scene.output.wanted or ()) or ("motion and loads of the bit" if scene.bit else "all motion")
    lines = [
        f"{scene.name}: {plan.chosen}",
        f"because {plan.reason}",
        f"wanted: {wanted}, to {_percent(scene.output.tolerance)}",
        "",
        "rules",
        *_table([("rule", "from rung", "found"), *((f.rule, f.needs, f.text) for f in plan.findings)]),
        "",
    ]
    if pilot is None:
        lines.append("rungs (no pilot runs: errors are estimates of the rules)")
    elif pilot.reference:
        lines.append(
            f"rungs (measured by pilot runs of {pilot.seconds:g} s: error of their last half against "
            f"{pilot.reference}, relative to mean plus spread)"
        )
    elif pilot.speed:
        lines.append("rungs (speed measured over a few steps, errors not)")
    else:
        lines.append("rungs (a static analysis: no pilot runs)")
    head = (
        "rung",
        "",
        "off, by rules",
        "off, measured",
        "in",
        "bit swings at",
        "unknowns",
        "simulated/wall",
        "this run",
    )
    rows: list[tuple[str, ...]] = [head]
    for rung in (*plan.rungs, *plan.beside):
        speed, wall = _speed(rung)
        worst = max(rung.measured, key=lambda name: rung.measured[name]) if rung.measured else ""
        mark = "chosen" if rung.model == plan.chosen else ""
        rows.append(
            (
                rung.model,
                mark or ("no" if rung.obstacle else ""),
                _percent(rung.by_rules),
                "reference" if pilot and rung.model == pilot.reference else _percent(rung.off),
                worst,
                f"{rung.main_wave:.3g} Hz" if rung.main_wave else "-",
                str(rung.dofs or "-"),
                speed,
                wall,
            )
        )
    told = [i for i in range(len(head)) if i == 0 or any(row[i] not in ("", "-") for row in rows[1:])]
    lines += _table([tuple(row[i] for i in told) for row in rows])
    lines += [f"  {rung.model}: {rung.obstacle}" for rung in (*plan.rungs, *plan.beside) if rung.obstacle]
    if pilot is not None:
        lines += [f"  {name}: {why}" for name, why in pilot.failed.items() if name not in MODELS]
    lines.append("")
    lines += [f"expected error of {plan.chosen}: {_expected(plan)}"]
    lines += ["", f"lost one rung lower{f' ({plan.lower})' if plan.lower else ''}", *(f"  - {x}" for x in plan.lost)]
    if plan.notes:
        lines += ["", "notes", *(f"  - {x}" for x in plan.notes)]
    return "\n".join(lines)


def _expected(plan: Plan) -> str:
    if not plan.error:
        return "not measured: no rung above tells; for step and mesh, drillfem run --certify"
    causes = ", ".join(f"{cause} {_percent(x)}" for cause, x in plan.error.items())
    time, pilot = plan.scene.time, plan.pilot
    how = "step and mesh were not tried"
    if pilot is not None and set(plan.error) - {"model, by the rules"}:
        how = f"measured by a pilot run of {pilot.seconds:g} s of {time.end - time.start:g} s"
    return f"{_percent(max(plan.error.values()))} ({causes}; {how})"


def main(
    scene: str,
    overrides: Mapping[str, str],
    outputs: str | None = None,
    tolerance: str | None = None,
    pilot: bool = True,
    as_json: bool = False,
) -> None:
    """Print the plan of a scene. ``outputs``: names joined by commas, and ``tolerance``, in the place of the scene's.

    What is wanted does not bind a model that the scene asks for: the plan says what that model lacks. Raises
    SceneError.
    """
    loaded = load_scene(scene, overrides)
    given: dict[str, object] = {}
    if outputs is not None:
        given["wanted"] = [name.strip() for name in outputs.split(",")]
    if tolerance is not None:
        given["tolerance"] = _number(tolerance)
    asked = read(Output, given, "output")
    output = replace(loaded.output, **{name: getattr(asked, name) for name in given})
    plan = plan_of(replace(loaded, output=output), pilot)
    print(json.dumps(plan.to_dict(), indent=1) if as_json else as_text(plan))


def _number(text: str) -> float | str:
    """0.05, "5 %" or "5%" as a number; anything else as it is, for the reader to complain about."""
    share = text.strip()
    try:
        return float(share[:-1]) / 100 if share.endswith("%") else float(share)
    except ValueError:
        return text
