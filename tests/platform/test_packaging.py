"""What pip gets: forms, meshes and scenes are symlinks in the checkout and must be files in a wheel."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
LINKS = {"forms": "forms", "meshes": "meshes", "scenes": "demos/scenes", "surveys": "demos/surveys"}
BUILD = "import sys; from setuptools import build_meta as b; print(getattr(b, sys.argv[1])(sys.argv[2]))"


def build(kind: str, project: Path, out: Path) -> Path:
    """The file that a build front end would get of `project` (no network: the setuptools that is here)."""
    out.mkdir(exist_ok=True)
    command = [sys.executable, "-c", BUILD, f"build_{kind}", str(out)]
    done = subprocess.run(command, cwd=project, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return out / done.stdout.splitlines()[-1]


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("setuptools", "77")
    copy = tmp_path_factory.mktemp("project")
    junk = shutil.ignore_patterns("__pycache__", ".*_cache")
    for folder in ("drillfem", *LINKS.values()):
        shutil.copytree(CHECKOUT / folder, copy / folder, symlinks=True, ignore=junk)
    for name in ("pyproject.toml", "LICENSE", "README.md"):
        shutil.copy(CHECKOUT / name, copy / name)
    return copy


def names(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        return {name for name in archive.namelist() if ".dist-info/" not in name}


def test_wheel_has_files_where_the_checkout_has_links(project: Path, tmp_path: Path) -> None:
    for name, target in LINKS.items():
        assert (CHECKOUT / "drillfem" / name).is_symlink()
        assert (CHECKOUT / "drillfem" / name).resolve() == CHECKOUT / target
    wheel = names(build("wheel", project, tmp_path / "wheel"))
    files = [p for kind in ("*.py", "*.c") for p in (project / "drillfem").rglob(kind)]
    shipped = {f"drillfem/{p.relative_to(project / 'drillfem')}" for p in files}
    for name, target in LINKS.items():
        found = {
            f"drillfem/{name}/{p.name}"
            for p in (project / target).iterdir()
            if p.suffix in (".py", ".toml", ".csv", ".md")
        }
        assert found
        shipped |= found
    assert wheel == shipped | {"drillfem/py.typed"}


def test_sdist_gives_the_same_wheel(project: Path, tmp_path: Path) -> None:
    with tarfile.open(build("sdist", project, tmp_path / "sdist")) as archive:
        assert not any(member.issym() for member in archive)
        archive.extractall(tmp_path, filter="data")
    again = build("wheel", tmp_path / "drillfem-0.1.0", tmp_path / "again")
    assert names(again) == names(build("wheel", project, tmp_path / "wheel"))
