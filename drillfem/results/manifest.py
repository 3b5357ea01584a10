"""What a result came from: versions, machine, command line, seed, and the scene as it was run."""

from __future__ import annotations

import json
import platform
import shlex
import sys
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from drillfem.errors import SceneError

FORMAT = 1


def versions() -> dict[str, str]:
    """Versions of Python, of this package, and of those of its tools that are installed."""
    found = {"python": platform.python_version()}
    for name, distributions in {
        "drillfem": ("drillfem",),
        "numpy": ("numpy",),
        "scipy": ("scipy",),
        "numba": ("numba",),
        "xarray": ("xarray",),
        "dolfinx": ("fenics-dolfinx", "dolfinx"),
        "ufl": ("fenics-ufl", "ufl"),
        "petsc4py": ("petsc4py",),
    }.items():
        version = getattr(sys.modules.get(name), "__version__", None)
        for distribution in distributions:
            if version is None:
                try:
                    version = metadata.version(distribution)
                except metadata.PackageNotFoundError:
                    continue
        if version is not None:
            found[name] = str(version)
    # Asking PETSc itself means initialising it (and MPI): only where the run has done so already.
    if petsc := sys.modules.get("petsc4py.PETSc"):
        found["petsc"] = ".".join(map(str, petsc.Sys.getVersion()))
    return found


def seed_of(scene: Any) -> int | None:
    """Seed of the random part of the scene's initial state, if it has one."""
    return getattr(getattr(scene, "initial", None), "seed", None)


def new_manifest(scene: Any, model: str) -> dict[str, Any]:
    """Manifest of a run of ``scene`` that starts now."""
    return {
        "format": FORMAT,
        "name": getattr(scene, "name", ""),
        "model": model,
        "seed": seed_of(scene),
        "versions": versions(),
        "platform": platform.platform(),
        "runs": [this_run()],
        "scene": scene.to_dict(),
    }


def this_run() -> dict[str, Any]:
    """When and with which command this process runs."""
    return {"started": datetime.now(UTC).isoformat(timespec="seconds"), "command": shlex.join(sys.argv)}


def is_result(folder: Path) -> bool:
    """Whether ``folder`` holds a result of this package."""
    try:
        return {"scene", "versions"} <= set(json.loads((folder / "manifest.json").read_text(encoding="utf-8")))
    except (OSError, ValueError):
        return False


def check_new_folder(folder: str | Path) -> Path:
    """``folder`` as a path, if a new result may go there: it does not exist, or is empty.

    Raises:
        SceneError: it holds something, is no folder, or lies in something that is no folder.
    """
    path = Path(folder)
    if not path.exists():
        parent = next(p for p in path.absolute().parents if p.exists())
        if not parent.is_dir():
            raise SceneError(f"{folder}: cannot be made, {parent} is not a folder")
        return path
    if not path.is_dir():
        raise SceneError(f"{folder}: is not a folder; choose another one for the result")
    if is_result(path):
        how = f"drillfem resume {shlex.quote(str(folder))}"
        raise SceneError(f"{folder}: holds a result already; choose another folder, or continue it with: {how}")
    if any(path.iterdir()):
        raise SceneError(f"{folder}: is not empty and not a result; choose another folder for the result")
    return path
