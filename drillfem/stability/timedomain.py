"""The same stability from the other side: a short nonlinear run from a tiny perturbation, and how fast it grows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from drillfem.stability.transfer import C16, F8

if TYPE_CHECKING:
    from drillfem.scene import Scene

PERTURBATION = 1e-6
"""Excess of spin at the bit at the start, over the top speed: many e-foldings below the first stick."""

LINEAR = 0.01
"""Departure of the axial speed from nominal, over nominal, up to which a motion counts as small."""


class Motion(NamedTuple):
    """A motion exp(s t) found in a signal."""

    growth: float  # 1/s
    frequency: float  # Hz
    share: float  # its amplitude at the end of the signal, over the sum of all


@dataclass(frozen=True)
class TimePoint:
    """What a run at one operating point did, beside what the characteristic roots say."""

    speed: float  # rad/s
    weight: float  # N
    growth: float  # measured, 1/s
    frequency: float  # measured, Hz
    predicted_growth: float  # 1/s, of the root nearest to the measured motion
    predicted_frequency: float  # Hz
    rightmost: float  # growth of the rightmost root, 1/s
    window: tuple[float, float]  # s, where the motion is small and was fitted

    @property
    def agrees(self) -> bool:
        """Whether the run grows if, and decays unless, a root has a positive growth."""
        return (self.growth > 0) == (self.rightmost > 0)


def at_point(scene: Scene, speed: float, weight: float, end: float = 40.0, perturbation: float = PERTURBATION) -> Scene:
    """The scene drilling at ``speed`` (rad/s) and ``weight`` on bit (N), for ``end`` s from nearly steady drilling."""
    bit = scene.bit
    assert bit is not None
    model = scene.resolved_model().name
    step = min(scene.time.step, 2 * np.pi / (bit.blades * speed) / 24)
    return replace(
        scene,
        model=model if model in ("lumped", "torsional") else "axial-torsional",
        top_drive=replace(
            scene.top_drive, kind="imposed-speed", profile=None, speed=speed, weight_on_bit=weight, hook_load=None
        ),
        initial=replace(scene.initial, state="nominal", spin_perturbation=perturbation, seed_perturbation=0.0, seed=0),
        time=replace(scene.time, start=0.0, end=end, step=step, integrator="default", engine="default", adaptive=False),
        output=replace(scene.output, interval=step, fields_interval=end, checkpoint_interval=end),
    ).checked()


def motions_in(signal: F8, interval: float, highest: float, most: int = 60) -> list[Motion]:
    """The motions exp(s t) of which a signal (n,) of equal ``interval`` (s) is the sum, by falling growth.

    The signal is smoothed and thinned to what its spectrum below ``highest`` (Hz) needs; a filter leaves exponentials
    exponentials.  Then s follows from the shift invariance of the signal's subspace (ESPRIT).  Motions with less than
    1 % of the amplitude at the end are left out.  ``most``: largest number of exponentials.
    """
    power = np.cumsum(np.abs(np.fft.rfft(signal * np.hanning(len(signal)))) ** 2)
    full = float(np.searchsorted(power, (1 - 1e-6) * power[-1]) + 2) / (len(signal) * interval)
    highest = min(highest, 1.3 * full)
    thin = max(1, int(1 / (4 * highest * interval)))
    if thin > 1:
        window = np.hanning(4 * thin + 1)[1:-1]
        signal = np.convolve(signal, window / window.sum(), mode="valid")[::thin]
    keep = 1200
    if len(signal) > keep:
        signal = signal[-keep:]
    if len(signal) < 24:
        raise ValueError(f"stability: {len(signal)} samples are too few for a fit")
    scale = np.abs(signal).max()
    rows = len(signal) // 3
    hankel = np.lib.stride_tricks.sliding_window_view(signal / scale, rows).T
    u, size, _ = np.linalg.svd(hankel, full_matrices=False)
    rank = int(min(most, np.count_nonzero(size > 1e-5 * size[0]), rows - 1))
    z: C16 = np.linalg.eigvals(np.linalg.lstsq(u[:-1, :rank], u[1:, :rank], rcond=None)[0]).astype(complex)
    # what changes by many orders of magnitude in the window is noise
    s = np.log(z[np.abs(np.log(np.abs(z) + 1e-300)) * len(signal) < 40]) / (interval * thin)
    # amplitudes at the end of the signal
    back = interval * thin * np.arange(-len(signal) + 1, 1)
    amplitude = np.abs(np.linalg.lstsq(np.exp(np.outer(back, s)), (signal / scale).astype(complex), rcond=None)[0])
    share = amplitude / amplitude.sum()
    found = [
        Motion(float(root.real), float(abs(root.imag) / (2 * np.pi)), float(part))
        for root, part in zip(s, share, strict=True)
        if root.imag >= 0 and part > 0.005
    ]
    return sorted(found, reverse=True)


def measure(scene: Scene, highest: float, end: float = 40.0) -> tuple[Motion, tuple[float, float]]:
    """Run a scene of `at_point` and return its fastest growing motion, with the window (s) in which it was fitted.

    The signal is the depth of cut; the window ends where the axial speed has left the nominal one by `LINEAR`, and
    leaves the first third of the time to what decays.
    """
    from drillfem.solve.run import simulate

    nominal = scene.nominal()
    until = end / 16
    while True:
        history = simulate(scene, until=until, warn=False).history  # only small motions are looked at
        speed = np.abs(history["bit_axial_speed"].values / nominal.rate_of_penetration - 1)
        far = np.flatnonzero(speed > LINEAR)
        if len(far) or until >= end:
            break
        # twice as long, from the start: what comes long after the motion has ceased to be small is of no interest
        until = min(2 * until, end)
    time = np.asarray(history["time"].values, float)
    depth = np.asarray(history["depth_of_cut"].values / nominal.depth_of_cut - 1, float)
    last = int(far[0]) if len(far) else len(time) - 1
    first = last // 3
    motion = motions_in(depth[first : last + 1], float(time[1] - time[0]), highest)
    return motion[0], (float(time[first]), float(time[last]))
