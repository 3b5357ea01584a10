"""Performance of drilling: rate of penetration, energy per volume of rock, depth per energy.

Teale's mechanical specific energy is what the bit spends, axially and in turning, on a volume of rock; at steady
drilling E = W/A + 2 pi T/(A d) with the bit's area A = pi a^2 and the depth of cut per turn d. What is put in at the
top is more: the string dissipates, and stores.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr

FED = ("work_top_drive", "work_gravity", "work_hook_load")
"""History variables (J) that add up to the energy put in: drive, weight, and the hook's pull."""


def performance(history: xr.Dataset, radius: float, window: tuple[float, float]) -> dict[str, float]:
    """Performance between two times (s) of a run of a bit of this ``radius`` (m); SI units.

    ``rate_of_penetration`` (m/s); ``mechanical_specific_energy`` (J/m3): work of the bit, axial and torsional, over the
    volume of rock cut; ``specific_energy_input`` (J/m3): energy put in over the same volume; ``drilled_per_energy``
    (m/J): depth over the energy put in. What the history does not allow (no rock cut, no works) is left out.
    """
    time = history["time"].values

    def gained(name: str) -> float:
        return float(np.diff(np.interp(window, time, history[name].values))[0])

    names = set(map(str, history.data_vars))
    if "bit_depth" not in names or not window[1] > window[0]:
        return {}
    depth = gained("bit_depth")
    volume = gained("rock_volume") if "rock_volume" in names else math.pi * radius**2 * depth
    found = {"rate_of_penetration": depth / (window[1] - window[0])}
    if volume > 0 and "work_bit" in names:
        found["mechanical_specific_energy"] = gained("work_bit") / volume
    if volume > 0 and names.issuperset(FED):
        fed = math.fsum(map(gained, FED))
        found["specific_energy_input"] = fed / volume
        if fed > 0:
            found["drilled_per_energy"] = depth / fed
    return found


def nominal_performance(scene: Any) -> dict[str, float]:
    """What `performance` is in steady drilling, where nothing is lost between top and bit; scene with a cutting bit."""
    nominal, speed = scene.nominal(), scene.top_drive.speed or 0.0
    if not nominal.rate_of_penetration > 0:
        return {}
    power = nominal.weight_on_bit * nominal.rate_of_penetration + nominal.torque_on_bit * speed
    energy = power / (math.pi * scene.bit.radius**2 * nominal.rate_of_penetration)
    return {
        "rate_of_penetration": nominal.rate_of_penetration,
        "mechanical_specific_energy": energy,
        "specific_energy_input": energy,
        "drilled_per_energy": nominal.rate_of_penetration / power,
    }
