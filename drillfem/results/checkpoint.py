"""The state a run continues from: named arrays and scalars, bit for bit."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from drillfem.errors import SceneError

from .atomic import replacing

FILE = "state.npz"
_TIME = "__time__"


def flatten(data: Mapping[str, Any], prefix: str = "") -> dict[str, np.ndarray]:
    """Copy a nested mapping of arrays, numbers and texts into ``{"outer/inner": array}``.

    Raises:
        TypeError: a value is none of these.
    """
    flat: dict[str, np.ndarray] = {}
    for key, value in data.items():
        if isinstance(value, Mapping):
            flat |= flatten(value, f"{prefix}{key}/")
            continue
        array = np.array(value)
        if array.dtype.hasobject:
            raise TypeError(f"a checkpoint holds arrays, numbers and texts; {prefix}{key} is {type(value).__name__}")
        flat[prefix + key] = array
    return flat


def write_checkpoint(folder: Path, time: float, flat: Mapping[str, np.ndarray]) -> None:
    """Replace the checkpoint of the result ``folder`` by the state at ``time`` (s); see `flatten`."""
    target = folder / "checkpoint" / FILE
    target.parent.mkdir(exist_ok=True)
    with replacing(target) as part, open(part, "wb") as file:
        np.savez(file, allow_pickle=False, **{_TIME: np.array(time), **flat})


def read_checkpoint(folder: str | Path) -> tuple[float, dict[str, Any]]:
    """Time (s) and state of the last checkpoint of a result folder, nested as it was given.

    Raises:
        SceneError: there is none, or it cannot be read.
    """
    path = Path(folder) / "checkpoint" / FILE
    if not path.exists():
        raise SceneError(f"{folder}: no checkpoint was written yet, so there is nothing to resume from")
    data: dict[str, Any] = {}
    try:
        with np.load(path, allow_pickle=False) as file:
            time = float(file[_TIME])
            for key in file.files:
                array = file[key]
                *outer, name = key.split("/")
                level = data
                for part in outer:
                    level = level.setdefault(part, {})
                level[name] = array.item() if array.ndim == 0 else array
    except Exception as error:
        raise SceneError(f"{path}: the checkpoint cannot be read ({error})") from error
    del data[_TIME]
    return time, data
