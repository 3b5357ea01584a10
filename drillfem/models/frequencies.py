"""Which natural frequencies a scene's string has: what its spectra are compared with."""

from __future__ import annotations

from ..errors import MissingDependency, SimulationError
from ..scene import Scene
from ..scene.frequencies import straight_frequencies

#: Vibrations of each kind that are looked for in a rod that bends.
_COUNT = 20


def natural_frequencies_of(scene: Scene, upto: float = 40.0) -> dict[str, list[float]]:
    """Natural frequencies (Hz) of a scene's string up to ``upto`` (Hz), by kind, slowest first.

    A drilling string, and whatever does not bend: ``axial`` and ``torsional`` from exact waves, no bending (that of a
    kilometre of pipe is dense), the rock left out. Other rods: the slowest of every kind about the start of the scene,
    by SLEPc (`drillfem.models.modes`), double ones once; ``coupled`` where kinds mix. Empty for a static analysis, for
    loads that are not conservative, and for a rod that bends where there is no DOLFINx.
    """
    if scene.time.analysis == "static":
        return {}
    model = scene.resolved_model().name
    if scene.drills or model in ("lumped", "torsional", "axial-torsional", "soft-string"):
        return straight_frequencies(scene, upto)
    try:
        from .modes import natural_frequencies
        from .rod import Rod

        modes = natural_frequencies(Rod(scene), _COUNT)
    except (MissingDependency, SimulationError):
        return {}
    slow = {kind: [float(f) for f in found.frequency if f <= upto] for kind, found in modes.items()}
    return {kind: _distinct(frequencies) for kind, frequencies in slow.items()}


def _distinct(frequencies: list[float]) -> list[float]:
    """Without repetitions: a round rod bends both ways alike. ``frequencies`` slowest first."""
    return [f for i, f in enumerate(frequencies) if i == 0 or f > frequencies[i - 1] * (1 + 1e-6)]
