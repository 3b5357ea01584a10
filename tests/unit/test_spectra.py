"""Spectra and peaks of known waves."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from drillfem.results.spectra import amplitude_spectrum, dominant, dominant_in, spectra_in, windowed_spectrum, windows

DT = 1e-3


def wave(duration: float, *parts: tuple[float, float], mean: float = 0.0) -> np.ndarray:
    t = DT * np.arange(round(duration / DT))
    return mean + sum(a * np.cos(2 * np.pi * f * t + k) for k, (f, a) in enumerate(parts))


def test_the_convention_of_the_thesis() -> None:
    f, a = amplitude_spectrum(wave(20, (0.45, 14.4), (7.4, 2.0), mean=14.42), DT)
    assert f[0] == pytest.approx(0.05)  # DC is left out
    assert a[np.isclose(f, 0.45)] == pytest.approx(14.4, rel=1e-9)
    assert a[np.isclose(f, 7.4)] == pytest.approx(2.0, rel=1e-9)
    assert np.sort(a)[-3] < 1e-9


@pytest.mark.parametrize("apart", [0.0, 0.15, 0.3, 0.5])
def test_the_trap_of_a_wave_between_two_bins(apart: float) -> None:
    """Without window a wave that lies ``apart`` from the next bin is shown as sinc(apart) of it."""
    x = wave(30, ((14 - apart) / 30, 14.4), mean=14.42)
    shown = amplitude_spectrum(x, DT)[1].max()
    assert shown == pytest.approx(14.4 * np.sinc(apart), rel=0.02)
    if apart == 0.3:  # 0.4567 Hz, the first torsional vibration: 14.4 rad/s is shown as 12.4
        assert shown == pytest.approx(12.4, abs=0.05)
    (peak,) = dominant(x, DT)
    assert peak.amplitude == pytest.approx(14.4, rel=1e-3)
    assert peak.frequency == pytest.approx((14 - apart) / 30, abs=1e-3 / 30)


@pytest.mark.parametrize("shift", np.linspace(0, 1, 11))
def test_the_windowed_amplitude_does_not_depend_on_the_bins(shift: float) -> None:
    x = wave(20, ((260 + shift) / 20, 2.0), mean=3.0)
    (peak,) = dominant(x, DT)
    assert peak.amplitude == pytest.approx(2.0, rel=1e-3)
    assert peak.frequency == pytest.approx((260 + shift) / 20, abs=1e-3 / 20)
    _, a = windowed_spectrum(x, DT)
    assert a.max() == pytest.approx(2.0, rel=1e-2)
    assert a[0] < 1e-6  # no mean left


def test_three_waves_strongest_first() -> None:
    x = wave(20, (7.41, 7.9), (6.47, 7.7), (0.45, 3.1), mean=-5)
    peaks = dominant(x, DT)
    assert [round(p.frequency, 2) for p in peaks] == [7.41, 6.47, 0.45]
    assert [p.amplitude for p in peaks] == pytest.approx([7.9, 7.7, 3.1], rel=2e-3)
    assert dominant(x, DT, n=1) == peaks[:1]


def test_side_lobes_are_no_waves() -> None:
    assert len(dominant(wave(20, (3.2, 10.0)), DT, n=10)) == 1
    assert len(dominant(wave(20, (3.2, 10.0), (9.0, 0.2)), DT, n=10)) == 1
    assert len(dominant(wave(20, (3.2, 10.0), (9.0, 0.5)), DT, n=10)) == 2


def test_the_window_in_time() -> None:
    x = np.concatenate([wave(20, (0.45, 14.0)), wave(20, (13.1, 2.0))])
    assert dominant(x, DT, (0, 20))[0].frequency == pytest.approx(0.45, abs=1e-3)
    assert dominant(x, DT, (20, 40))[0].frequency == pytest.approx(13.1, abs=1e-3)
    assert dominant(x, DT, (120, 140), start=100)[0].frequency == pytest.approx(13.1, abs=1e-3)


@pytest.mark.parametrize("x", [np.zeros(5000), np.full(5000, 14.42), np.ones(3), np.empty(0)])
def test_a_constant_has_no_waves(x: np.ndarray) -> None:
    assert dominant(x, DT) == []


def test_a_trend_is_no_wave() -> None:
    assert all(p.frequency > 0.1 for p in dominant(np.linspace(0, 1, 20000), DT))


def test_uneven_samples() -> None:
    time = np.sort(np.random.default_rng(0).uniform(0, 20, 20000))
    history = xr.Dataset({"w": ("time", 2 * np.sin(2 * np.pi * 3.2 * time))}, coords={"time": time})
    (peak,) = dominant_in(history, "w", n=1)
    assert peak == pytest.approx((3.2, 2.0), rel=1e-2)


def test_the_windows_of_the_thesis() -> None:
    assert windows(0.0, 200.0) == [("S1", 0, 20), ("S2", 90, 110), ("S3", 180, 200)]
    assert windows(0.0, 1000.0)[2] == ("S3", 180, 200)
    assert windows(0.0, 80.0)[-1] == ("chapter 5", 60, 80)
    assert [w[1:] for w in windows(10.0, 40.0)] == [(10, 20), (30, 40)]


def test_both_spectra_of_a_window() -> None:
    time = DT * np.arange(40001)
    signal = np.where(time < 20, 5.0 * np.cos(2 * np.pi * 7.4 * time), 2.0 * np.cos(2 * np.pi * 3.225 * time))
    history = xr.Dataset({"w": ("time", signal)}, coords={"time": time})
    (f, a), (fine, smooth) = spectra_in(history, "w", (0.0, 20.0))
    assert f[1] - f[0] == pytest.approx(0.05, rel=1e-12)  # 20 000 samples: 7.4 Hz is a bin
    assert a[np.isclose(f, 7.4)] == pytest.approx(5.0, rel=1e-9)
    assert smooth.max() == pytest.approx(5.0, rel=1e-3)
    (f, a), (fine, smooth) = spectra_in(history, "w", (20.0, 40.0))
    assert a.max() == pytest.approx(2.0 * 2 / np.pi, rel=0.02)  # half-way between two bins
    assert smooth.max() == pytest.approx(2.0, rel=1e-3)
    assert fine[np.argmax(smooth)] == pytest.approx(3.225, abs=0.005)
