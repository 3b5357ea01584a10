"""Spectra and peaks of known waves."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from drillfem.results.spectra import amplitude_spectrum, dominant, dominant_in, windowed_spectrum

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


def test_the_trap_of_a_wave_between_two_bins() -> None:
    x = wave(30, (13.7 / 30, 14.4), mean=14.42)
    assert amplitude_spectrum(x, DT)[1].max() == pytest.approx(12.4, abs=0.2)
    (peak,) = dominant(x, DT)
    assert peak.amplitude == pytest.approx(14.4, rel=1e-3)
    assert peak.frequency == pytest.approx(13.7 / 30, abs=1e-3 / 30)


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
