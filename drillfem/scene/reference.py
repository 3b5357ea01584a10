"""The reference of all keys, written from the dataclasses.

`python -m drillfem.scene.reference > docs/scene-format.md` renews the page; a test compares the two.
"""

from __future__ import annotations

import dataclasses
import inspect
import typing
from typing import Any

from drillfem.scene.keys import Slot, slots
from drillfem.scene.scene import Scene
from drillfem.scene.tables import Numbers

_HEAD = """# Scene files: all keys

Written from the dataclasses in `drillfem/scene` by `python -m drillfem.scene.reference`; do not edit.

A scene is a TOML file. A number is in the SI unit shown; text with any unit of the same kind does too:
`"5 in"`, `"45.7 kN"`, `"120 rpm"`, `"1 ms"`, `"10 deg"`. Angles are not pure numbers, and `Hz` is not a spin.
The fixed frame has e3 along the unstressed straight string, downwards; x, y, z are along e1, e2, e3.

`drillfem run SCENE --set bit.blades=4 --set string.0.length="900 m"` changes keys by their dotted names;
sections are counted from 0, from the top down. In Python: `load_scene("vertical-c1-cd4", {"bit.blades": 4})`.

A key that is unknown, missing, of a wrong unit or impossible ends in one line that names it, and exit code 2.
"""


def _table(kind: Any) -> type | None:
    """The dataclass behind a nested table, or None for a plain value."""
    if typing.get_origin(kind) is tuple:
        kind = typing.get_args(kind)[0]
    return kind if dataclasses.is_dataclass(kind) and isinstance(kind, type) else None


def _default(slot: Slot) -> str:
    if slot.required:
        return "**required**"
    if slot.key.default_text or slot.default is None:
        return slot.key.default_text or "none"
    if slot.type is bool:
        return f"`{str(slot.default).lower()}`"
    if isinstance(slot.default, str):
        return f'`"{slot.default}"`'
    if isinstance(slot.default, tuple):
        return "`[" + ", ".join(f"{x:g}" for x in slot.default) + "]`"
    return f"`{slot.default:.7g}`"


def _section(title: str, table: type) -> list[str]:
    about = " ".join((inspect.getdoc(table) or "").split())
    lines = [
        "",
        title,
        "",
        about,
        "",
        "| key | meaning | unit | allowed | default |",
        "|---|---|---|---|---|",
    ]
    for name, slot in slots(table).items():
        numeric = slot.type is float or (typing.get_origin(slot.type) is tuple and not _table(slot.type))
        unit = slot.key.unit if numeric else ""
        allowed = slot.expects if not _table(slot.type) else "table, see below"
        allowed = allowed.removesuffix(f" in {unit}, or text with such a unit").removesuffix(f" in {unit}")
        default = (
            "see below" if _table(slot.type) and not slot.required and slot.default is not None else _default(slot)
        )
        lines.append(f"| `{name}` | {slot.key.doc} | {unit} | {allowed} | {default} |")
    return lines


def reference() -> str:
    """The whole page, in Markdown."""
    lines = [_HEAD.rstrip()]
    queue: list[tuple[str, type]] = [("", Scene)]
    while queue:
        path, table = queue.pop(0)
        lines += _section(f"## `{path}`" if path else "## Top level", table)
        nested = []
        for name, slot in slots(table).items():
            inner = _table(slot.type)
            if (inner is not None and name != "material") or (inner is not None and not path):
                inside = f"{path.strip('[]')}.{name}" if path else name
                many = f"[{inside}.NAME]" if slot.key.named else f"[[{inside}]]"
                nested.append((many if typing.get_origin(slot.type) is tuple else f"[{inside}]", inner))
        queue = nested + queue
    lines += _section("## `[dimensionless]`", Numbers)
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(reference(), end="")
