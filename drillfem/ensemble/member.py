"""One member after the other on one process, with what they share kept alive.

A member differs from the next by numbers: friction along the hole, loads, stiffnesses. Mesh, forms, kernels and the
memory of the solver depend on none of them (`drillfem.models.rod.structure`), and take longer to set up than a member
takes to run.
"""

from __future__ import annotations

import math
from collections.abc import Hashable
from typing import TYPE_CHECKING, Any

from ..errors import SimulationError
from ..results import Result, ResultWriter
from ..scene import Scene

if TYPE_CHECKING:
    from ..models.rod import Rod

#: entries of a summary that tell of the machine, not of the member
_NOT_NUMBERS = ("wall_seconds", "dofs")


class Worker:
    """Runs members, each as `drillfem.simulate` would: bit for bit, whatever ran before.

    Where a scene differs from the last one by more than numbers, or has another engine than a rod's, it is set up anew.
    """

    def __init__(self, scene: Scene | None = None) -> None:
        """scene: one like the members, to be set up now, kernels and all; None: with the first member."""
        self._rod: Rod | None = None
        self._structure: Hashable = None
        if scene is not None:
            self.warm_up(scene)

    def warm_up(self, scene: Scene) -> Result | None:
        """Compile what members like this scene need, by the first of its time; all of it in statics.

        None where that fails: members will say so, each for itself.
        """
        until, time = None, scene.time
        if time.analysis == "dynamic":
            until = time.start + min(time.end - time.start, max(2 * time.step, 3e-3))
        try:
            return self._simulate(scene, until)
        except SimulationError:
            self._rod = None  # nobody knows what is left in it
            return None

    def run(self, scene: Scene) -> dict[str, float]:
        """Summary numbers of a member: see :func:`numbers`. Raises SceneError, SimulationError."""
        return numbers(self.simulate(scene))

    def simulate(self, scene: Scene) -> Result:
        """A member with its history, in memory and without pictures. Raises SceneError, SimulationError."""
        return self._simulate(scene, None)

    def _simulate(self, scene: Scene, until: float | None) -> Result:
        if not _steps_a_rod(scene):
            from ..solve import simulate

            return simulate(scene, until=until, warn=False)
        from ..solve.direct import march

        def writer(model: str, dofs: int, variables: dict[str, str]) -> ResultWriter:
            made = ResultWriter(None, scene, model, dofs, variables)
            made.pictured = False
            return made

        result: Result = march(self._rod_of(scene), writer, scene.time.end if until is None else until, None)
        return result

    def _rod_of(self, scene: Scene) -> Rod:
        from ..models.rod import Rod, structure

        found = structure(scene)
        if self._rod is None or found is None or found != self._structure:
            self._rod = Rod(scene)
        else:
            self._rod.take(scene)
        self._structure = found
        return self._rod


def _steps_a_rod(scene: Scene) -> bool:
    return scene.time.analysis == "dynamic" and scene.engine in ("petsc", "compiled")


def numbers(result: Result) -> dict[str, float]:
    """What statistics are made of: the numbers of a summary, and the last value of every history variable (SI)."""
    found: dict[str, Any] = {k: v for k, v in result.summary.items() if k not in _NOT_NUMBERS}
    found |= {str(name): values.values[-1] for name, values in result.history.data_vars.items()}
    kept = {k: float(v) for k, v in found.items() if isinstance(v, (int, float)) and not isinstance(v, bool)}
    return {k: v for k, v in kept.items() if math.isfinite(v)}
