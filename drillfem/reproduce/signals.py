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
TOP_SPIN, TOP_TORQUE, POWER = "top_angular_speed", "top_torque", "top_power"
SIDE_FORCE, WALL_TORQUE, PENETRATION = "side_force", "wall_torque", "penetration"
BIT_WORK, END_WORK = "work_bit", "work_hook_load"
NAMES = (
    SPIN,
    ADVANCE,
    TORQUE,
    WEIGHT,
    DEPTH,
    TOP_SPIN,
    TOP_TORQUE,
    POWER,
    SIDE_FORCE,
    WALL_TORQUE,
    PENETRATION,
    BIT_WORK,
    END_WORK,
)
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
    """A run: its scene, signals (n,) over ``time`` (s), wall seconds it took, how it is read, and its pictures."""

    scene: Scene
    time: NDArray[np.float64]
    values: dict[str, NDArray[np.float64]]
    wall: float = 0.0
    reading: Reading = field(default_factory=Reading)
    fields: xr.Dataset | None = None

    @classmethod
    def of(cls, scene: Scene, history: xr.Dataset, wall: float, fields: xr.Dataset | None = None) -> Signals:
        """The signals of a history, and the pictures of the whole string that were kept."""
        values = {name: history[name].values for name in NAMES if name in history}
        return cls(scene, history["time"].values, values, wall, fields=fields)

    def read_as(self, reading: Reading) -> Signals:
        """The same run, read in another way."""
        return Signals(self.scene, self.time, self.values, self.wall, reading, self.fields)

    def picture(self, time: float) -> dict[str, NDArray[np.float64]] | None:
        """Fields along the string at the picture nearest to a time (s); None if none is within an interval of it."""
        if self.fields is None:
            return None
        at = self.fields["time"].values
        i = int(np.argmin(np.abs(at - time)))
        if abs(at[i] - time) > self.scene.output.fields_interval:
            return None
        return {str(name): x.values[i] if "time" in x.dims else x.values for name, x in self.fields.data_vars.items()}

    def side_load(self, time: float = 0.0) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Arc lengths (n,) in m, and the wall's normal force (n,) there over the weight per length of the string.

        Of the picture at a time (s), at the start by default; None if there is none, or no wall.
        """
        seen = self.picture(time)
        if seen is None or "wall_side_force" not in seen:
            return None
        s, sections = seen["wall_arc_length"], self.scene.string
        i = np.clip(np.searchsorted(self.scene.interfaces, s) - 1, 0, len(sections) - 1)
        weight = self.scene.gravity.magnitude * np.array([x.mass_per_length for x in sections])[i]
        return s, seen["wall_side_force"] / weight

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
