"""Without DOLFINx and PETSc: the straight rungs run, anywhere that pip runs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

#: Hides what is not on PyPI from an interpreter that has it.
HIDE = """
import sys
from importlib.machinery import PathFinder

class Without(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        if name.split(".")[0] in {"dolfinx", "petsc4py", "slepc4py", "mpi4py", "ufl", "basix", "ffcx"}:
            return None
        return super().find_spec(name, path, target)

sys.meta_path = [Without if finder is PathFinder else finder for finder in sys.meta_path]
"""

RUN = (
    HIDE
    + """
import drillfem.cli
sys.exit(drillfem.cli.main(sys.argv[1:]))
"""
)


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", RUN, *arguments], cwd=ROOT, capture_output=True, text=True, timeout=300
    )


@pytest.mark.parametrize("model", ["lumped", "torsional", "axial-torsional"])
def test_straight_rungs_run(model: str, tmp_path: Path) -> None:
    settings = ("--set", f"model={model}", "--set", "mesh.elements=8", "--until", "0.2", "--no-certify")
    done = run("run", "vertical-c1-cd4", *settings, "--out", str(tmp_path / "out"))
    assert done.returncode == 0, done.stderr
    assert f"{model}, " in done.stdout and (tmp_path / "out" / "history.nc").exists()


def test_the_rod_says_what_is_missing(tmp_path: Path) -> None:
    done = run("run", "vertical-c1-cd4", "--set", "model=spatial", "--out", str(tmp_path / "out"))
    assert done.returncode == 1 and "needs DOLFINx" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1 and not (tmp_path / "out").exists()


def test_list_and_info_need_nothing() -> None:
    assert "cutting-c1" in run("list").stdout
    assert "938.10" in run("info", "cutting-c1").stdout


@pytest.mark.verify
def test_pip_install_in_a_bare_environment(tmp_path: Path) -> None:
    """The real thing: a new environment from PyPI alone."""
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "env"], check=True, timeout=300)
    python = tmp_path / "env" / "bin" / "python"
    subprocess.run([python, "-m", "pip", "install", "--quiet", ROOT], check=True, timeout=900)
    without = subprocess.run([python, "-c", "import dolfinx"], capture_output=True, check=False)
    assert without.returncode == 1
    command = [tmp_path / "env" / "bin" / "drillfem", "run", "cutting-c1", "--set", "model=lumped", "--until", "5"]
    done = subprocess.run([*command, "--out", tmp_path / "out"], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert "lumped, " in done.stdout
