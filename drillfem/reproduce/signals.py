"""What is read from a run: the bit's signals in windows, their lines, means and extremes.

The thesis prints lines of 2|X|/N without window (`printed_spectrum`), whose lines lie 1/window apart and whose
amplitudes are up to 36 % low between them; here lines are resolved (Hann window, padded) unless asked otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from drillfem.results.spectra import Peak, amplitude_spectrum, dominant

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from drillfem.scene import Scene

Window = tuple[float, float]

SPIN, ADVANCE, TORQUE, WEIGHT, DEPTH = "bit_angular_speed", "bit_axial_speed", "bit_torque", "bit_weight", "bit_depth"
NAMES = (SPIN, ADVANCE, TORQUE, WEIGHT, DEPTH)
LINES = 60
"""How many lines of a spectrum are looked at."""


class Reading(NamedTuple):
    """How spectra and means are taken, where a variation asks for another way.

    ``printed_spectrum``: unpadded, without window. ``window``: (s), in the place of the one that a claim names.
    """

    printed_spectrum: bool = False
    window: Window | None = None


@dataclass
class Signals:
    """A run: its scene, the bit's signals (n,) over ``time`` (s), wall seconds it took, and how it is read."""

    scene: Scene
    time: NDArray[np.float64]
    values: dict[str, NDArray[np.float64]]
    wall: float = 0.0
    reading: Reading = field(default_factory=Reading)

    @classmethod
    def of(cls, scene: Scene, history: xr.Dataset, wall: float) -> Signals:
        """The signals of a history."""
        return cls(scene, history["time"].values, {name: history[name].values for name in NAMES}, wall)

    def read_as(self, reading: Reading) -> Signals:
        """The same run, read in another way."""
        return Signals(self.scene, self.time, self.values, self.wall, reading)

    @cached_property
    def _lines(self) -> dict[tuple[str, Window], list[Peak]]:
        return {}

    def part(self, name: str, window: Window) -> NDArray[np.float64]:
        """The samples of a signal in a window (s); none if the run ends before the window does."""
        a, b = self.reading.window or window
        if self.time[-1] < b - 1e-6:
            return np.zeros(0)
        return self.values[name][(self.time >= a - 1e-9) & (self.time <= b + 1e-9)]

    def lines(self, name: str, window: Window) -> list[Peak]:
        """The strongest lines of a signal in a window, strongest first; none of a signal that is still."""
        key = (name, window)
        if key not in self._lines:
            part, dt = self.part(name, window), float(self.time[1] - self.time[0])
            if self.reading.printed_spectrum and len(part) > 8:
                f, a = amplitude_spectrum(part[:-1], dt)
                tops = np.flatnonzero((a[1:-1] > a[:-2]) & (a[1:-1] >= a[2:])) + 1
                tops = tops[np.argsort(a[tops])[::-1][:LINES]]
                found = [Peak(float(f[i]), float(a[i])) for i in tops]
            else:
                found = dominant(part, dt, n=LINES, threshold=1e-4)
            self._lines[key] = [p for p in found if p.amplitude > 1e-6 * np.abs(part).max()]
        return self._lines[key]

    def strongest(self, name: str, window: Window) -> Peak | None:
        """The strongest line."""
        found = self.lines(name, window)
        return found[0] if found else None

    def near(self, name: str, window: Window, frequency: float) -> Peak | None:
        """The strongest line within 2.5 % (at least 0.1 Hz, two lines of a 20 s window) of a frequency (Hz)."""
        room = max(0.025 * frequency, 0.1)
        return next((p for p in self.lines(name, window) if abs(p.frequency - frequency) < room), None)

    def mean(self, name: str, window: Window) -> float | None:
        """Mean in a window; None if the run does not reach its end."""
        part = self.part(name, window)
        return float(part.mean()) if len(part) else None

    def at(self, name: str, time: float) -> float | None:
        """Value at a time (s); None beyond the end."""
        return float(np.interp(time, self.time, self.values[name])) if time <= self.time[-1] + 1e-6 else None
