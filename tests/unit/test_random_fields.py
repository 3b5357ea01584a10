"""Random fields on the hole: exact and Galerkin modes, covariances, samples and their clips."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from drillfem.ensemble import fields
from drillfem.ensemble.fields import (
    Covariance,
    KarhunenLoeve,
    covariance,
    exact_modes,
    galerkin_modes,
)
from drillfem.errors import SceneError

L, B = 60.0, 10.0
EXPONENTIAL = covariance("exponential", 1.0, B)


# -- exact modes ----------------------------------------------------------------------------------------------------
def test_eigenvalues_and_captured_variance_of_the_thesis_field() -> None:
    modes = exact_modes(L, 1.0, B, terms=100)
    assert modes.eigenvalues[:5] == pytest.approx([17.2712, 11.9759, 7.6574, 4.9473, 3.3369], abs=5e-5)
    assert modes.frequencies[:3] == pytest.approx([0.039749, 0.081855, 0.126959], abs=5e-7)
    # spec 10.6 gives 97.6 for 50 terms: the sum is 97.546
    assert 100 * modes.captured[[9, 19, 49, 99]] == pytest.approx([87.487, 93.799, 97.546, 98.778], abs=5e-4)


@pytest.mark.parametrize(("length", "b"), [(60.0, 10.0), (60.0, 6000.0), (3000.0, 1.0), (1.0, 1.0)])
def test_every_root_of_both_equations_is_found_once(length: float, b: float) -> None:
    """Roots counted by changes of sign of (c cos wa - w sin wa)(w cos wa + c sin wa) on a fine grid."""
    w = exact_modes(length, 1.0, b, terms=60).frequencies
    a, c = length / 2, 1 / b
    assert (np.diff(w) > 0).all()
    even, odd = w[::2], w[1::2]
    assert np.abs(c * np.cos(even * a) - even * np.sin(even * a)).max() < 1e-12 * (c + w[-1])
    assert np.abs(odd * np.cos(odd * a) + c * np.sin(odd * a)).max() < 1e-12 * (c + w[-1])
    x = np.linspace(1e-9 * w[0], (w[-1] + 0.1 * math.pi / a), 2_000_001)
    signs = [np.signbit(c * np.cos(x * a) - x * np.sin(x * a)), np.signbit(x * np.cos(x * a) + c * np.sin(x * a))]
    assert sum(int((s[1:] != s[:-1]).sum()) for s in signs) == len(w)


def test_eigenfunctions_are_orthonormal_and_solve_the_integral_equation() -> None:
    modes = exact_modes(L, 0.3, B, terms=12)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    x, w = (nodes + 1) * L / 2, weights * L / 2
    assert (modes(x) * w) @ modes(x).T == pytest.approx(np.eye(12), abs=1e-12)
    for at in (0.0, 7.3, 41.0, L):  # each side of the kink by itself
        total = np.zeros(12)
        for low, high in ((0.0, at), (at, L)):
            y, wy = low + (nodes + 1) * (high - low) / 2, weights * (high - low) / 2
            total += modes(y) @ (wy * 0.09 * np.exp(-np.abs(at - y) / B))
        assert total == pytest.approx(modes.eigenvalues * modes(np.array([at]))[:, 0], abs=1e-13)
    assert (modes(np.array([0.0])) > 0).all()
    assert modes(np.array([-5.0, L + 9.0])) == pytest.approx(modes(np.array([0.0, L])))


@pytest.mark.parametrize(("share", "terms"), [(0.87, 10), (0.9379, 20), (0.9754, 50), (0.9877, 100)])
def test_number_of_terms_follows_from_the_variance_to_capture(share: float, terms: int) -> None:
    modes = exact_modes(L, 2.0, B, captured=share)
    assert modes.captured[-1] >= share > modes.captured[-2]
    assert modes.terms <= terms
    assert exact_modes(L, 2.0, B, terms=terms).captured[-1] >= share
    assert modes.variance == pytest.approx(4 * L)


# -- Galerkin modes -------------------------------------------------------------------------------------------------
def _errors(terms: int = 5, kernel: Covariance = EXPONENTIAL, elements: int | None = None, degree: int = 8):  # type: ignore[no-untyped-def]
    """Largest relative error of eigenvalues, and of eigenfunctions, of the exponential covariance."""
    exact, x = exact_modes(L, 1.0, B, terms=terms), np.linspace(0, L, 1201)
    found = galerkin_modes(kernel, L, terms=terms, elements=elements, degree=degree)
    shape = exact(x)
    return np.abs(found.eigenvalues / exact.eigenvalues - 1).max(), np.abs(found(x) - shape).max() / np.abs(shape).max()


@pytest.mark.dolfinx
@pytest.mark.parametrize("terms", [1, 5, 20, 60])
def test_galerkin_and_exact_modes_agree(terms: int) -> None:
    eigenvalue, function = _errors(terms)
    assert eigenvalue < 1e-11
    assert function < 1e-6


@pytest.mark.dolfinx
@pytest.mark.parametrize("degree", [1, 2])
def test_galerkin_orders(degree: int) -> None:
    """Eigenvalues converge with order 2 (degree + 1), eigenfunctions with degree + 1."""
    errors = np.log2([_errors(4, elements=n, degree=degree) for n in (12, 24, 48)])
    orders = errors[:-1] - errors[1:]
    assert orders[-1] == pytest.approx([2 * (degree + 1), degree + 1], abs=0.15)


@pytest.mark.dolfinx
def test_gauss_points_across_the_diagonal_would_miss_the_goal(monkeypatch: pytest.MonkeyPatch) -> None:
    """The known wrong way: tensor products over the kink of the covariance."""
    right = fields._pair_rules
    monkeypatch.setattr(fields, "_pair_rules", lambda degree: (right(degree)[2],) * 3)
    assert _errors(20)[0] > 1e-4


@pytest.mark.dolfinx
def test_galerkin_modes_of_two_depths() -> None:
    """Brownian motion min(x, y): lambda_k = (2 L/((2 k - 1) pi))^2, sines; and the exponential one in that form."""
    brown = galerkin_modes(Covariance(np.minimum, 1.0, stationary=False), L, terms=8)
    k = np.arange(1, 9)
    assert brown.eigenvalues == pytest.approx((2 * L / ((2 * k - 1) * math.pi)) ** 2, rel=1e-10)
    x = np.linspace(0, L, 50)
    sines = math.sqrt(2 / L) * np.sin(np.outer((2 * k - 1) * math.pi / (2 * L), x))
    assert np.abs(brown(x)) == pytest.approx(np.abs(sines), abs=1e-7)
    assert brown.variance == pytest.approx(L**2 / 2)
    both = Covariance(lambda x, y: np.exp(-np.abs(x - y) / B), 1.0, stationary=False)
    assert _errors(10, both)[0] < 1e-11


@pytest.mark.dolfinx
@pytest.mark.parametrize("nu", [0.3, 0.5, 1.5, 40.0])
def test_galerkin_modes_of_matern(nu: float) -> None:
    """As good as on a mesh four times as fine, and with four times the terms they have all of the variance."""
    kernel = covariance("matern", 1.0, B, nu)
    coarse = galerkin_modes(kernel, L, terms=8)
    fine = galerkin_modes(kernel, L, terms=8, elements=40)
    assert coarse.eigenvalues == pytest.approx(fine.eigenvalues, rel=1e-7)
    if nu == 0.5:
        assert coarse.eigenvalues == pytest.approx(exact_modes(L, 1.0, B, terms=8).eigenvalues, rel=1e-11)
    assert np.all(coarse.captured < 1)


@pytest.mark.dolfinx
def test_a_smooth_field_has_few_eigenvalues_above_round_off() -> None:
    kernel = covariance("squared-exponential", 1.0, B)
    modes = galerkin_modes(kernel, L, captured=0.9999)
    assert modes.captured[-1] > 0.9999 and modes.terms == 10
    with pytest.raises(SceneError, match=r"terms = 60: must be at most \d+: further eigenvalues are below round-off"):
        galerkin_modes(kernel, L, terms=60)
    with pytest.raises(SceneError, match=r"terms = 2000: must be at most about 600 for Galerkin"):
        galerkin_modes(kernel, L, terms=2000)
    with pytest.raises(SceneError, match="must be positive definite"):
        galerkin_modes(Covariance(lambda d: np.where(d < 20, 1.0, 0.0), 1.0), L, terms=2)


# -- covariances ----------------------------------------------------------------------------------------------------
def test_matern_by_its_closed_forms() -> None:
    d = np.array([0.0, 1e-12, 1e-3, 0.5, 7.0, 60.0, 900.0])

    def matern(nu: float) -> np.ndarray:
        return covariance("matern", 2.0, B, nu)(d, 0.0) / 4

    x, y = math.sqrt(3) * d / B, math.sqrt(5) * d / B
    assert matern(0.5) == pytest.approx(np.exp(-d / B), rel=1e-13)
    assert matern(1.5) == pytest.approx((1 + x) * np.exp(-x), rel=1e-13)
    assert matern(2.5) == pytest.approx((1 + y + y**2 / 3) * np.exp(-y), rel=1e-13)
    assert matern(5000.0) == pytest.approx(np.exp(-((d / B) ** 2) / 2), abs=1e-4)
    for p in (9, 48, 51, 70):  # half-integers: a sum of positive terms
        x = math.sqrt(2 * p + 1) * d / B
        parts = (
            Fraction(math.comb(p, i) * math.factorial(p + i), math.factorial(2 * p)) * Fraction(2) ** (p - i)
            for i in range(p + 1)
        )
        series = sum(float(part) * x ** (p - i) for i, part in enumerate(parts))
        assert matern(p + 0.5) == pytest.approx(np.exp(-x) * series, abs=1e-11 if p < 50 else 2e-9)


OWN = """
import numpy as np
def distance(d): return np.maximum(1 - d / 30, 0)
def depths(x, y): return np.exp(-abs(x - y) / (10 + 0.1 * (x + y)))
def skew(x, y): return np.exp(-abs(x - y)) * (1 + x)
def number(d): return 1.0
def broken(d): return d / nothing
value = 3
"""


def test_own_covariances(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "my_own_rock.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    one, two = covariance("my_own_rock:distance", 2.0), covariance("my_own_rock:depths", 2.0)
    assert (one.stationary, two.stationary) == (True, False)
    assert one(0.0, 3.0) == pytest.approx(3.6)
    assert two(0.0, 10.0) == pytest.approx(4 * math.exp(-10 / 11))
    for name, said in {
        "skew": "symmetric",
        "number": "one finite number per pair",
        "broken": "NameError",
        "missing": "my_own_rock has no missing",
        "value": "must be a function",
    }.items():
        with pytest.raises(SceneError, match=said):
            covariance(f"my_own_rock:{name}", 1.0)
    with pytest.raises(SceneError, match="must be a module that Python can import"):
        covariance("no_such_rock:x", 1.0)


# -- samples --------------------------------------------------------------------------------------------------------
AT = np.linspace(0, L, 9)


def _worst(samples: np.ndarray, exact: np.ndarray) -> float:
    """Largest difference of the samples' covariance (mean known) from an exact one, in its standard errors."""
    found = samples.T @ samples / len(samples)
    return float((np.abs(found - exact) / np.sqrt((np.outer(*2 * [np.diag(exact)]) + exact**2) / len(samples))).max())


def _threshold(pairs: int, confidence: float) -> float:
    """Standard errors that none of so many entries exceeds at that confidence (Bonferroni)."""
    return float(stats.norm.isf((1 - confidence) / 2 / pairs))


def test_samples_have_the_covariance() -> None:
    """All 45 covariances between nine depths, at 99.9 % confidence; the test would see a wrong length, and too few
    terms."""
    limit = _threshold(45, 0.999)
    exact = EXPONENTIAL(AT[:, None], AT[None, :])
    z = np.random.default_rng(5).standard_normal((20_000, 400))

    def drawn(terms: int, n: int, b: float = B) -> np.ndarray:
        field = KarhunenLoeve(0.0, exact_modes(L, 1.0, b, terms=terms))
        return z[:n, :terms] @ field.scaled(AT)

    assert _worst(drawn(400, 20_000), exact) < limit
    assert _worst(drawn(100, 2000), exact) < limit
    assert _worst(drawn(400, 20_000, b=11.0), exact) > limit
    assert _worst(drawn(20, 20_000), exact) > limit
    truncated = KarhunenLoeve(0.0, exact_modes(L, 1.0, B, terms=20)).covariance(AT)
    assert _worst(drawn(20, 20_000), truncated) < limit


def test_clips_are_counted() -> None:
    field = KarhunenLoeve(0.12, exact_modes(L, 0.012, B, terms=20), (0.11, 0.13))
    free = KarhunenLoeve(0.12, field.modes)
    x, z = np.linspace(0, L, 321), np.random.default_rng(1).standard_normal(20)
    values, clips = field.at(x, z)
    unclipped, none = free.at(x, z)
    outside = (unclipped < 0.11) | (unclipped > 0.13)
    assert none == 0 and clips == outside.sum() > 0
    assert (values[~outside] == unclipped[~outside]).all()
    assert values.min() == 0.11 and values.max() == 0.13
    thesis = KarhunenLoeve(0.12, field.modes, (0.0, 0.6))
    assert sum(thesis.at(x, z)[1] for z in np.random.default_rng(2).standard_normal((500, 20))) == 0
    with pytest.raises(ValueError, match=r"must be \(20,\)"):
        field.at(x, z[:3])


def test_a_sample_does_not_depend_on_the_points_around_it() -> None:
    field = KarhunenLoeve(0.0, exact_modes(L, 1.0, B, terms=20))
    x, z = np.linspace(0, L, 321), np.random.default_rng(3).standard_normal(20)
    assert (field.at(x[100:140], z)[0] == field.at(x, z)[0][100:140]).all()


def test_linear_interpolation_between_the_points_of_a_table_is_enough() -> None:
    field = KarhunenLoeve(0.0, exact_modes(L, 1.0, B, terms=20))
    x = np.linspace(0, L, 1 + round(L / field.spacing))
    middle = (x[1:] + x[:-1]) / 2
    scaled = field.scaled(x)
    error = np.sqrt((((scaled[:, 1:] + scaled[:, :-1]) / 2 - field.scaled(middle)) ** 2).sum(axis=0))
    assert error.max() < 2e-3  # standard deviation of the error, that of the field is 1
