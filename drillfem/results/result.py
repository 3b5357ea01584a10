"""A result: in memory, or read from its folder."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import xarray as xr

from drillfem.errors import SceneError

from .atomic import read_json


@dataclass
class Result:
    """What a simulation gave.

    Attributes:
        history: time series over ``time`` (s); every variable has ``units``.
        summary: counts, wall time, energy balance, whether it converged (summary.json).
        fields: shape and fields of the string over ``time`` and ``node``, if any were stored.
        manifest: versions, seed, and the scene as run (manifest.json); empty in memory.
        folder: where it is stored, if it is.
        given_scene: the scene, where there is no manifest to read it from.
    """

    history: xr.Dataset
    summary: dict[str, Any]
    fields: xr.Dataset | None = None
    manifest: dict[str, Any] = field(default_factory=dict)
    folder: Path | None = None
    given_scene: Any = None

    @cached_property
    def scene(self) -> Any:
        """The scene as it was run (`drillfem.scene.Scene`); ``None`` if the result carries none."""
        if self.given_scene is not None or "scene" not in self.manifest:
            return self.given_scene
        from drillfem.scene import Scene

        return Scene.from_dict(self.manifest["scene"])


def open_result(folder: str | Path) -> Result:
    """Read the result in ``folder``, also of a run that goes on, failed or was killed.

    Raises:
        SceneError: the folder is missing, is no result, holds no rows yet, or is damaged.
    """
    path = Path(folder)
    if not path.is_dir():
        raise SceneError(f"{folder}: there is no such folder")
    manifest, summary = read_json(path / "manifest.json"), read_json(path / "summary.json")
    if not (path / "history.nc").exists():
        raise SceneError(f"{folder}: no history.nc, nothing was computed before this run stopped")
    history = _dataset(path / "history.nc")
    fields = path / "fields" / "fields.nc"
    return Result(history, summary, _dataset(fields) if fields.exists() else None, manifest, path)


def _dataset(path: Path) -> xr.Dataset:
    try:
        return xr.load_dataset(path, engine="h5netcdf")
    except Exception as error:
        raise SceneError(f"{path}: cannot be read ({' '.join(str(error).split())})") from error
