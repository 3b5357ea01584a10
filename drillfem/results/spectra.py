"""Frequencies and amplitudes of a signal.

Two spectra. `amplitude_spectrum` is the thesis' convention, 2|X|/N without a window: right for a wave whose
period fits the record a whole number of times, up to 36 % too small for one that lies half-way between two
bins (sinc of the distance to the next bin: a 30 s record shows a wave of 14.4 rad/s at 0.4567 Hz as 12.4), and full
of side lobes. `windowed_spectrum` (Hann, zero padded) has neither fault; the peaks are taken from it.
`windows` are the stretches of time that the thesis takes its spectra from.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.fft import next_fast_len

Array = NDArray[np.floating]


class Window(NamedTuple):
    """A stretch of a run, from ``start`` to ``end`` (s)."""

    label: str
    start: float
    end: float


class Peak(NamedTuple):
    """One wave in a signal: frequency (Hz) and amplitude (half of peak to peak, in the signal's unit)."""

    frequency: float
    amplitude: float


def amplitude_spectrum(signal: ArrayLike, dt: float) -> tuple[Array, Array]:
    """Frequencies (Hz) and 2|X|/N of ``signal`` (n,), sampled every ``dt`` s: no window, DC left out."""
    x = np.asarray(signal, dtype=float)
    f: Array = np.fft.rfftfreq(len(x), dt)
    return f[1:], 2 * np.abs(np.fft.rfft(x))[1:] / len(x)


def windowed_spectrum(signal: ArrayLike, dt: float, padding: int = 8) -> tuple[Array, Array]:
    """Frequencies (Hz) and amplitudes of ``signal`` (n,), sampled every ``dt`` s: Hann window, zero padded.

    The amplitude of a wave is right (within 0.1 % of it at ``padding`` 8) wherever its frequency lies, if it
    is at least four bins (1/duration) away from the others.
    """
    x = np.asarray(signal, dtype=float)
    weight = np.sin(np.pi * np.arange(len(x)) / len(x)) ** 2
    x = weight * (x - weight @ x / weight.sum())
    length = next_fast_len(padding * len(x), real=True)
    f: Array = np.fft.rfftfreq(length, dt)
    return f, 2 * np.abs(np.fft.rfft(x, length)) / weight.sum()


def windows(start: float, end: float) -> list[Window]:
    """Where to look at a run from ``start`` to ``end`` (s).

    The thesis' windows: S1, S2, S3 for the 200 s of chapter 6; the last 20 s for the 80 s of chapter 5 (caption of
    figure 5.11), beside the first 20 s. Any other run: its first and its last third.
    """
    if abs(start) <= 0.5 and end >= 199.9:
        return [Window("S1", 0.0, 20.0), Window("S2", 90.0, 110.0), Window("S3", 180.0, 200.0)]
    if abs(start) <= 0.5 and 79.9 <= end <= 80.1:
        return [Window("start", 0.0, 20.0), Window("chapter 5", 60.0, 80.0)]
    third = (end - start) / 3
    return [Window("first third", start, start + third), Window("last third", end - third, end)]


def dominant(
    signal: ArrayLike,
    dt: float,
    window: tuple[float, float] | None = None,
    n: int = 3,
    *,
    start: float = 0.0,
    threshold: float = 0.03,
) -> list[Peak]:
    """The strongest waves in ``signal``, strongest first.

    Args:
        signal: (N,) samples.
        dt: time between samples, s.
        window: from and to which time (s) to look; all by default.
        n: how many waves at most.
        start: time of the first sample, s.
        threshold: waves weaker than this share of the strongest are left out; 0.03 is just above the Hann
            side lobes.

    Returns:
        Waves with at least two periods in the record and two bins (2/duration) between them; empty for a
        constant.
    """
    x = np.asarray(signal, dtype=float)
    if window is not None:
        # Half a sample of tolerance: 0.1 + 0.2 > 0.3.
        time = start + dt * np.arange(len(x))
        x = x[(time >= window[0] - dt / 2) & (time <= window[1] + dt / 2)]
    if len(x) < 8:
        return []
    f, a = windowed_spectrum(x, dt)
    resolution = 2 / (len(x) * dt)
    inner = np.arange(1, len(f) - 1)
    tops = inner[(a[1:-1] > a[:-2]) & (a[1:-1] >= a[2:]) & (f[1:-1] >= resolution)]
    # What is left of a constant is round-off.
    tops = tops[a[tops] > 1e-12 * np.abs(x).max(initial=0.0)]
    peaks: list[Peak] = []
    for i in tops[np.argsort(a[tops])[::-1]]:
        peak = _vertex(f, a, int(i))
        if len(peaks) == n or (peaks and peak.amplitude < threshold * peaks[0].amplitude):
            break
        if all(abs(peak.frequency - other.frequency) > resolution for other in peaks):
            peaks.append(peak)
    return peaks


def dominant_in(history: xr.Dataset, name: str, window: tuple[float, float] | None = None, n: int = 3) -> list[Peak]:
    """The strongest waves of a variable of a ``history`` between the times ``window`` (s); see `dominant`."""
    time, signal = evenly(history["time"].values, history[name].values)
    return dominant(signal, time[1] - time[0], window, n, start=time[0]) if len(time) > 1 else []


def spectra_in(
    history: xr.Dataset, name: str, window: tuple[float, float] | None = None
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """`amplitude_spectrum` and `windowed_spectrum` of a variable of a ``history`` between the times ``window`` (s).

    The last moment of the window does not count: 20 s at 1 ms are 20 000 samples, and the bins lie 0.05 Hz apart.
    """
    time, signal = evenly(history["time"].values, history[name].values)
    dt = float(time[1] - time[0])
    if window is not None:
        signal = signal[(time >= window[0] - dt / 2) & (time < window[1] - dt / 2)]
    return amplitude_spectrum(signal, dt), windowed_spectrum(signal, dt)


def evenly(time: ArrayLike, signal: ArrayLike) -> tuple[Array, Array]:
    """``time`` and ``signal`` (n,), interpolated at the median spacing if they are not evenly spaced."""
    t, x = np.asarray(time, dtype=float), np.asarray(signal, dtype=float)
    if len(t) < 3:
        return t, x
    steps = np.diff(t)
    dt = float(np.median(steps))
    if np.abs(steps - dt).max() <= 1e-6 * dt:
        return t, x
    even = t[0] + dt * np.arange(int((t[-1] - t[0]) / dt + 1e-6) + 1)
    return even, np.interp(even, t, x)


def _vertex(f: Array, a: Array, i: int) -> Peak:
    """Top of the parabola through the logarithms of three neighbouring amplitudes."""
    left, mid, right = np.log(np.maximum(a[i - 1 : i + 2], np.finfo(float).tiny))
    curvature = left - 2 * mid + right
    shift = 0.5 * (left - right) / curvature if curvature < 0 else 0.0
    height = np.exp(mid - 0.25 * (left - right) * shift)
    return Peak(float(f[i] + shift * (f[1] - f[0])), float(height))
