"""What is done with the string, and what torque and drag answer: the interface between methods and report."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import SceneError

if TYPE_CHECKING:
    from ..scene import Scene

F8 = NDArray[np.float64]


@dataclass(frozen=True)
class Operation:
    """A motion of the whole string, and the loads on its bit.

    ``speed``: down the hole (m/s); ``spin`` (rad/s): only their ratio counts, it tells which way friction points.
    """

    name: str
    title: str
    speed: float = 0.0
    spin: float = 0.0
    weight_on_bit: float = 0.0  # N
    torque_on_bit: float = 0.0  # N m


#: The usual operations. Drilling goes on so slowly that all friction is rotary.
OPERATIONS = {
    o.name: o
    for o in (
        Operation("rotating", "rotating off bottom", spin=1.0),
        Operation("tripping-out", "tripping out", speed=-1.0),
        Operation("tripping-in", "tripping in", speed=1.0),
        Operation("drilling", "rotary drilling", spin=1.0),
        Operation("sliding", "sliding drilling", speed=1.0),
    )
}
_ON_BOTTOM = ("drilling", "sliding")


@dataclass(frozen=True)
class Profile:
    """What a method finds for an operation, (n,) each from the top down.

    ``tension``: effective (with buoyed weight), N; ``torque`` handed down, N m; ``side_force`` on the wall, N/m.
    ``method``: "soft" (this package's differential equation), "stations" (Johancsik's sum), "stiff" (a rod).
    """

    method: str
    operation: Operation
    measured_depth: F8
    tension: F8
    torque: F8
    side_force: F8

    @property
    def hook_load(self) -> float:
        """Tension at the top, N; negative: the string must be pushed."""
        return float(self.tension[0])

    @property
    def surface_torque(self) -> float:
        """Torque at the top, N m."""
        return float(self.torque[0])


def operations_of(
    scene: Scene,
    names: list[str] | None = None,
    weight_on_bit: float | None = None,
    torque_on_bit: float | None = None,
) -> list[Operation]:
    """Operations by name (all by default) with the loads on the bit of a scene, or those given (N, N m).

    Those on bottom are left out, if not asked for, where no weight on bit is known. Raises SceneError.
    """
    for name in names or ():
        if name not in OPERATIONS:
            raise SceneError(f"--operation {name!r}: must be one of {', '.join(OPERATIONS)}")
    weight, torque = weight_on_bit, torque_on_bit
    if weight is None and scene.bites:
        weight = scene.nominal().weight_on_bit
    if torque is None and weight is not None and scene.bites:
        drive = replace(scene.top_drive, weight_on_bit=weight, hook_load=None, block_speed=None)
        torque = replace(scene, top_drive=drive).nominal().torque_on_bit
    found = []
    for name, operation in OPERATIONS.items():
        if names and name not in names:
            continue
        if name in _ON_BOTTOM:
            if weight is None:
                if names:
                    raise SceneError(f"--operation {name}: needs a weight on bit: give --weight-on-bit")
                continue
            turning = (torque or 0.0) if name == "drilling" else 0.0
            operation = replace(operation, weight_on_bit=weight, torque_on_bit=turning)
        found.append(operation)
    return found


def shares(operation: Operation, radius: F8) -> tuple[F8, F8]:
    """Parts of friction along the hole (positive against a motion down it) and about it, at radii (n,) in m."""
    about = operation.spin * radius
    size = np.hypot(operation.speed, about)
    if not np.all(size > 0):
        raise ValueError(f"operation {operation.name}: the string does not move")
    return operation.speed / size, about / size


def deepest(profile: Profile, values: F8) -> tuple[float, float]:
    """Largest of values along a profile, and the measured depth (m) where it is."""
    i = int(np.argmax(values))
    return float(values[i]), float(profile.measured_depth[i])


def stretches(measured_depth: F8, inside: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """From-to measured depths (m) of the stretches where ``inside`` (n,) holds."""
    edges = np.flatnonzero(np.diff(inside, prepend=False, append=False))
    return [(float(measured_depth[a]), float(measured_depth[b - 1])) for a, b in edges.reshape(-1, 2)]
