"""The notebooks run from top to bottom without warnings, and convert to .ipynb; they assert their own numbers."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("dolfinx")
jupytext = pytest.importorskip("jupytext")
nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")

FOLDER = Path(__file__).parents[2] / "demos" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.py"))

pytestmark = pytest.mark.dolfinx


def execute(notebook: Any, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Run all cells in a kernel of this Python; raises CellExecutionError at the first that fails."""
    import matplotlib.font_manager  # noqa: F401  builds the font cache here, not noisily in a cell

    # an MPI of this process must not be taken for the launcher of the kernel's
    for name in [n for n in os.environ if n.startswith(("OMPI_", "PMIX_", "PRTE_", "PMI_"))]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("PYDEVD_DISABLE_FILE_VALIDATION", "1")
    client = nbclient.NotebookClient(
        notebook, kernel_name="python3", timeout=600, resources={"metadata": {"path": str(folder)}}
    )
    return client.execute()


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_notebook_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    notebook = execute(jupytext.read(path), tmp_path, monkeypatch)
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    noise = [o.text for o in outputs if o.output_type == "stream" and o.name == "stderr"]
    assert not noise, "cells warn: " + "".join(noise)
    pictures = [o for o in outputs if o.output_type == "display_data" and "image/png" in o.data]
    assert pictures, "a lesson without a picture"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_notebook_converts(path: Path) -> None:
    notebook = jupytext.read(path)
    again = nbformat.reads(jupytext.writes(notebook, fmt="ipynb"), as_version=4)
    nbformat.validate(again)
    assert [cell.source for cell in again.cells] == [cell.source for cell in notebook.cells]
    assert {cell.cell_type for cell in again.cells} == {"markdown", "code"}
    assert again.metadata.kernelspec.name == "python3"


def test_there_is_a_first_notebook() -> None:
    assert any(path.stem.startswith("01_") for path in NOTEBOOKS)
