"""The command `drillfem reproduce`."""

from __future__ import annotations

import shlex
from pathlib import Path

from rich.console import Console

from drillfem.errors import SceneError

from .compare import CASES, LONG, reproduce
from .page import count, markdown, show


def run(cases: list[str], out: Path | None, docs: Path | None, imitate: bool, brief: bool, errors: Console) -> None:
    """Compare, print, write. Raises SceneError and SimulationError."""
    if docs is not None and not docs.parent.is_dir():
        raise SceneError(f"--docs {docs}: there is no folder {docs.parent}")

    def tell(text: str) -> None:
        if errors.is_terminal:
            errors.print(text, end="\r", markup=False, soft_wrap=True)

    reports = reproduce(cases, out, imitate, brief, tell)
    for report in reports:
        show(report, imitate)
    if len(reports) > 1:
        print(f"all cases: {count(row for report in reports for row in report.rows)}")
    if docs is not None:
        whole = {len(CASES): [], len(CASES) + len(LONG): ["all"]}
        named = whole.get(len(reports), [report.case.name for report in reports])
        options = [name for name, on in (("--imitate", imitate), ("--brief", brief)) if on]
        command = shlex.join(["drillfem", "reproduce", *named, *options, "--docs", str(docs)])
        docs.write_text(markdown(reports, imitate, command), encoding="utf-8")
        print(docs)
