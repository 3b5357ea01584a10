"""Gaussian random fields on the hole: covariances, their modes (exact and Galerkin), Karhunen-Loeve expansions.

A field of mean mu and covariance C(x, y) on measured depths 0 to L is mu + sum_k sqrt(lambda_k) Z_k phi_k(x) with
independent standard normal Z_k and the eigenpairs of C: integral of C(x, y) phi(y) dy = lambda phi(x) (7-9), spec 10.6.
The eigenfunctions have unit norm, integral of phi^2 dx = 1, and start upwards: phi(0) > 0.

>>> modes = exact_modes(60.0, 1.0, 10.0, terms=5)
>>> modes.eigenvalues.round(4)
array([17.2712, 11.9759,  7.6574,  4.9473,  3.3369])
"""

from __future__ import annotations

import importlib
import inspect
import math
import os
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from drillfem.errors import SceneError

F8 = npt.NDArray[np.floating[Any]]

#: Elements per half wave of the highest mode, and their degree: eigenfunctions are then right to 2e-7 (measured).
ELEMENTS, DEGREE = 1.25, 8
#: Eigenvalues below this share of the largest are round-off.
ROUND_OFF = 1e-12
#: A Galerkin matrix is full: no more unknowns than this.
LARGEST = 6000


# -- covariances ----------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Covariance:
    """Covariance of a field at pairs of measured depths.

    ``function``: of the distance (m) if ``stationary``, else of two depths (m), arrays of one shape; times
    ``variance``.
    """

    function: Callable[..., F8]
    variance: float
    stationary: bool = True

    def __call__(self, x: npt.ArrayLike, y: npt.ArrayLike) -> F8:
        """Covariance at depths x and y (m), broadcast."""
        a, b = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
        return self.variance * (self.function(np.abs(a - b)) if self.stationary else self.function(a, b))


def covariance(
    kind: str, standard_deviation: float, correlation_length: float | None = None, smoothness: float | None = None
) -> Covariance:
    """Covariance by its name, or the user's own "module:function".

    kind: "exponential" exp(-d/b), "squared-exponential" exp(-d^2/(2 b^2)), "matern" with ``smoothness`` nu, of the
    distance d and ``correlation_length`` b (m); or a function of the distance, or of two depths (by the number of its
    arguments), which gets and returns arrays. All are multiplied by ``standard_deviation`` squared.

    Raises SceneError for a function that cannot be found, or that is no symmetric function.
    """
    b, variance = correlation_length or 1.0, standard_deviation**2
    if kind == "exponential":
        return Covariance(_Scaled(b), variance)
    if kind == "squared-exponential":
        return Covariance(_Squared(b), variance)
    if kind == "matern":
        return Covariance(_Matern(b, smoothness or 0.5), variance)
    function = _own(kind)
    try:
        arguments = len(inspect.signature(function).parameters)
    except (TypeError, ValueError):
        arguments = 1
    made = Covariance(function, variance, arguments == 1)
    x = np.array([0.0, 0.5, 3.0, 20.0])
    try:
        values = np.asarray(made(x[:, None], x[None, :]))
    except Exception as error:
        raise SceneError(f"covariance = {kind!r}: {type(error).__name__}: {error}, for arrays of depths in m") from None
    if values.shape != (4, 4) or not np.isfinite(values).all() or not np.allclose(values, values.T):
        raise SceneError(f"covariance = {kind!r}: must give one finite number per pair of depths, symmetric in them")
    return made


@dataclass(frozen=True)
class _Scaled:
    b: float

    def __call__(self, d: F8) -> F8:
        return np.exp(-d / self.b)


@dataclass(frozen=True)
class _Squared:
    b: float

    def __call__(self, d: F8) -> F8:
        return np.exp(-0.5 * (d / self.b) ** 2)


@dataclass(frozen=True)
class _Matern:
    b: float
    nu: float

    def __call__(self, d: F8) -> F8:
        from scipy.special import gammaln, kve

        nu = self.nu
        x = math.sqrt(2 * nu) * np.maximum(d, 1e-300) / self.b
        with np.errstate(over="ignore", invalid="ignore"):
            # by logarithms: K grows beyond all numbers at 0 where the power vanishes
            log_k = _debye(nu, x) if nu > _LARGE else np.log(kve(nu, x)) - x
            value = np.exp((1 - nu) * math.log(2) - gammaln(nu) + nu * np.log(x) + log_k)
        return np.where(np.isfinite(value) & (d > 0), np.minimum(value, 1.0), 1.0)


#: Order from which K_nu leaves the numbers of a computer where Matern's covariance is not yet 1 to round-off.
_LARGE = 50.0


def _debye(nu: float, x: F8) -> F8:
    """log K_nu(x) for large nu, to 1e-8 or better: Debye's uniform expansion (Abramowitz and Stegun 9.7.8)."""
    z = x / nu
    root = np.hypot(1.0, z)
    t = 1 / root
    u1 = (3 * t - 5 * t**3) / 24
    u2 = (81 * t**2 - 462 * t**4 + 385 * t**6) / 1152
    u3 = (30375 * t**3 - 369603 * t**5 + 765765 * t**7 - 425425 * t**9) / 414720
    series = np.log1p(-u1 / nu + u2 / nu**2 - u3 / nu**3)
    return 0.5 * np.log(math.pi / (2 * nu) * t) - nu * (root + np.log(z / (1 + root))) + series


def _own(name: str) -> Callable[..., F8]:
    """Function "module:function"; the module may lie in the current folder."""
    module, _, function = name.partition(":")
    here = os.getcwd()
    try:
        sys.path.append(here)
        found = getattr(importlib.import_module(module), function)
    except ImportError as error:
        raise SceneError(f"covariance = {name!r}: {error}; must be a module that Python can import") from None
    except AttributeError:
        raise SceneError(f"covariance = {name!r}: {module} has no {function}") from None
    finally:
        sys.path.remove(here)
    if not callable(found):
        raise SceneError(f"covariance = {name!r}: must be a function")
    return found


# -- modes ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Modes(ABC):
    """Eigenpairs of a covariance on [0, length], from the largest eigenvalue down.

    ``eigenvalues`` (n,): times length, m (for a field without unit). ``variance``: integral of C(x, x) over the length,
    the sum of all eigenvalues. Call it with points (m,) in m for the eigenfunctions (n, m), 1/sqrt(m).
    """

    eigenvalues: F8
    variance: float
    length: float

    @abstractmethod
    def __call__(self, points: npt.ArrayLike) -> F8:
        """Eigenfunctions (n, m) at points (m,) in m; those beyond the ends are taken to the ends."""

    @property
    def terms(self) -> int:
        """How many there are."""
        return len(self.eigenvalues)

    @property
    def captured(self) -> F8:
        """Share of the variance (n,) that the first 1 ... n terms have."""
        return np.cumsum(self.eigenvalues) / self.variance


@dataclass(frozen=True)
class ExactModes(Modes):
    """Of the exponential covariance: cosines and sines about the middle. ``frequencies`` (n,): w, rad/m."""

    frequencies: F8

    def __call__(self, points: npt.ArrayLike) -> F8:
        a, w = self.length / 2, self.frequencies[:, None]
        y = np.clip(np.asarray(points, dtype=np.float64), 0.0, self.length) - a
        even = (np.arange(self.terms) % 2 == 0)[:, None]
        beyond = np.sin(2 * w * a) / (2 * w)
        shape = np.where(even, np.cos(w * y) / np.sqrt(a + beyond), np.sin(w * y) / np.sqrt(a - beyond))
        start = np.where(even, np.cos(w * a), -np.sin(w * a))
        return np.where(start < 0, -shape, shape)


@dataclass(frozen=True)
class GalerkinModes(Modes):
    """Of any covariance, on a mesh. ``coefficients`` (n, elements, degree + 1): of Legendre polynomials per element."""

    coefficients: F8

    def __call__(self, points: npt.ArrayLike) -> F8:
        elements = self.coefficients.shape[1]
        x = np.clip(np.asarray(points, dtype=np.float64) / self.length, 0.0, 1.0) * elements
        cell = np.minimum(x.astype(np.int64), elements - 1)
        basis = np.polynomial.legendre.legvander(2 * (x - cell) - 1, self.coefficients.shape[2] - 1)
        return np.einsum("kmj,mj->km", self.coefficients[:, cell], basis)


def _frequencies(ratio: float, terms: int) -> F8:
    """Roots theta_k = w_k L/2 (terms,) of both equations of spec 10.6, for ``ratio`` = L/(2 b).

    theta tan theta = ratio for even and tan theta = -theta/ratio for odd modes: both are theta + arctan(theta/ratio) =
    (k + 1) pi/2, even k for the one and odd k for the other. The left side rises, so that there is one root for each
    k, in (k pi/2, (k + 1) pi/2): none is missed. It is also concave: Newton's method from the left end of the bracket
    rises to the root without ever passing it.
    """
    k = np.arange(terms)
    theta: F8 = k * math.pi / 2
    for _ in range(200):
        excess = theta + np.arctan(theta / ratio) - (k + 1) * math.pi / 2
        step = -excess / (1 + ratio / (ratio**2 + theta**2))
        theta = theta + step
        if (np.abs(step) <= 4e-16 * theta).all():
            break
    return theta


def exact_modes(
    length: float,
    standard_deviation: float,
    correlation_length: float,
    terms: int | None = None,
    captured: float | None = None,
) -> ExactModes:
    """Eigenpairs of sigma^2 exp(-|x - y|/b) on [0, length] from the transcendental equations (spec 10.6).

    length, correlation_length: m. terms: how many, or captured: as many as have that share of the variance.
    """
    ratio, b = length / (2 * correlation_length), correlation_length
    for n in _counts(terms, captured):
        w = _frequencies(ratio, n) * 2 / length
        eigenvalues = 2 * standard_deviation**2 * b / (1 + (w * b) ** 2)
        made = ExactModes(eigenvalues, standard_deviation**2 * length, length, w)
        if (count := _enough(made, terms, captured)) is not None:
            return replace(made, eigenvalues=eigenvalues[:count], frequencies=w[:count])
    raise SceneError(f"captured_variance = {captured}: needs more than {_MOST} terms")


def galerkin_modes(
    kernel: Covariance,
    length: float,
    terms: int | None = None,
    captured: float | None = None,
    elements: int | None = None,
    degree: int = DEGREE,
) -> GalerkinModes:
    """Eigenpairs of any covariance on [0, length] in Lagrange elements, by SLEPc.

    terms: how many, or captured: as many as have that share of the variance. elements: of equal length; by default
    `ELEMENTS` per half wave of a sine with that many. Needs DOLFINx and SLEPc.

    Raises SceneError where there are not so many eigenvalues above round-off, and for what is no covariance.
    """
    grid = np.linspace(0.0, length, 201)
    ends = np.linalg.eigvalsh(kernel(grid[:, None], grid[None, :]))[[0, -1]]
    if not ends[1] > 0 or ends[0] < -1e-8 * ends[1]:
        raise SceneError(
            f"covariance: must be positive definite; has an eigenvalue {ends[0] / abs(ends[1]):.2g} times its largest"
        )
    for n in _counts(terms, captured):
        cells = elements or max(8, math.ceil(ELEMENTS * n))
        if cells * degree >= LARGEST or n > cells * degree + 1:
            allowed = int(LARGEST / degree / ELEMENTS) if elements is None else elements * degree
            raise SceneError(
                f"terms = {n}: must be at most about {allowed} for Galerkin modes"
                + ("" if terms else f", which captured_variance = {captured} exceeds")
            )
        made = _galerkin(kernel, length, n, cells, degree)
        if (count := _enough(made, terms, captured)) is not None:
            return replace(made, eigenvalues=made.eigenvalues[:count], coefficients=made.coefficients[:count])
        if made.terms < n:
            break
    have = made.terms
    raise SceneError(
        f"terms = {terms}: must be at most {have}: further eigenvalues are below round-off"
        if terms
        else f"captured_variance = {captured}: must be at most {made.captured[-1]:.10g}, that of the {have} "
        "eigenvalues above round-off"
    )


#: No more terms than this, whatever the variance that they are to capture.
_MOST = 1 << 17


def _counts(terms: int | None, captured: float | None) -> Iterator[int]:
    """Numbers of terms to try."""
    if (terms is None) == (captured is None):
        raise ValueError("give either terms or captured")
    if terms is not None:
        yield terms
        return
    n = 16
    while n <= _MOST:
        yield n
        n *= 2


def _enough(modes: Modes, terms: int | None, captured: float | None) -> int | None:
    """How many of the modes are wanted; None if there are too few."""
    if captured is None:
        return terms if modes.terms == terms else None
    found = int(np.searchsorted(modes.captured, captured)) + 1
    return found if found <= modes.terms else None


# -- Galerkin's matrix ----------------------------------------------------------------------------------------------
def _rule(n: int) -> tuple[F8, F8]:
    """Gauss points and weights on [0, 1]."""
    x, w = np.polynomial.legendre.leggauss(n)
    return (x + 1) / 2, w / 2


def _pair_rules(degree: int) -> tuple[tuple[F8, F8, F8], ...]:
    """Points (xi, eta) and weights for a pair of elements of unit length: one and the same, neighbours, others.

    A covariance is smooth in the distance r, but only for r > 0: often |r|, or r to some power. So squares that touch
    the diagonal are cut along lines of constant r. One coordinate is r = t^4, which makes powers harmless, the
    other runs along the line.
    """
    n = degree + 4
    x, w = _rule(n)
    xi, eta = (a.ravel() for a in np.meshgrid(x, x, indexing="ij"))
    far = (xi, eta, np.outer(w, w).ravel())
    t, wt = _rule(4 * degree + 8)  # in t, the functions are polynomials of four times their degree
    r, s = (a.ravel() for a in np.meshgrid(t**4, x, indexing="ij"))
    weight = np.outer(4 * t**3 * wt, w).ravel()
    low, high = (1 - r) * s, (1 - r) * s + r
    same = (np.r_[low, high], np.r_[high, low], np.tile(weight * (1 - r), 2))
    rho, s2 = xi, eta  # of the far half of two neighbours: r = 1 + rho
    touching = (
        np.r_[1 - r * s, (1 - rho) * s2],
        np.r_[r * (1 - s), rho + (1 - rho) * s2],
        np.r_[weight * r, far[2] * (1 - rho)],
    )
    return same, touching, far


def kernel_blocks(kernel: Covariance, length: float, elements: int, degree: int, basis: F8) -> F8:
    """Integrals (elements, elements, degree + 1, degree + 1) of C(x, y) phi_i(x) phi_j(y) over pairs of elements.

    basis (degree + 1, degree + 1): Legendre coefficients of each function of an element.
    """
    h, n = length / elements, degree + 1
    rules = [
        (xi, eta, np.einsum("q,qi,qj->qij", weight * h**2, _values(basis, xi), _values(basis, eta)).reshape(-1, n * n))
        for xi, eta, weight in _pair_rules(degree)
    ]
    blocks = np.empty((elements, elements, n, n))
    for e in range(1 if kernel.stationary else elements):
        row = np.empty((elements - e, n * n))
        for step, (xi, eta, weighted) in enumerate(rules):
            others = np.arange(e + step, elements)[: 1 if step < 2 else None]
            if len(others):
                # distances from local coordinates: those of the depths themselves are rounded off
                x, y = (e + xi) * h, (others[:, None] + eta) * h
                distance = np.abs((others[:, None] - e) + (eta - xi)) * h
                values = kernel.variance * kernel.function(distance) if kernel.stationary else kernel(x, y)
                row[others - e] = values @ weighted
        blocks[e, e:] = row.reshape(-1, n, n)
    for e in range(1, elements):
        if kernel.stationary:
            blocks[e, e:] = blocks[0, : elements - e]
        blocks[e, :e] = blocks[:e, e].swapaxes(1, 2)
    return blocks


def _values(basis: F8, xi: F8) -> F8:
    """Functions of an element (q, degree + 1) at local coordinates (q,) from 0 to 1."""
    return np.polynomial.legendre.legvander(2 * xi - 1, len(basis) - 1) @ basis


def _galerkin(kernel: Covariance, length: float, terms: int, elements: int, degree: int) -> GalerkinModes:
    from drillfem import compat  # first: it says what to do where DOLFINx is missing

    import dolfinx.fem.petsc  # isort: skip
    import ufl
    from mpi4py import MPI

    mesh = dolfinx.mesh.create_interval(MPI.COMM_SELF, elements, [0.0, length])
    space = dolfinx.fem.functionspace(mesh, ("Lagrange", degree))
    at = space.tabulate_dof_coordinates()[:, 0]
    dofs = np.array([space.dofmap.cell_dofs(c) for c in range(elements)])
    dofs = np.take_along_axis(dofs, at[dofs].argsort(axis=1), axis=1)  # along each element, and from one to the next
    dofs = dofs[at[dofs[:, 0]].argsort()]
    nodes = at[dofs[0]] * elements / length
    basis = np.linalg.inv(np.polynomial.legendre.legvander(2 * nodes - 1, degree))
    blocks = kernel_blocks(kernel, length, elements, degree, basis)
    size = len(at)
    full = np.zeros((size, size))
    for i in range(degree + 1):
        for j in range(degree + 1):
            full[np.ix_(dofs[:, i], dofs[:, j])] += blocks[:, :, i, j]
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    mass = dolfinx.fem.petsc.assemble_matrix(compat.compile_form(u * v * ufl.dx))
    mass.assemble()
    eigenvalues, vectors = _eigenpairs(full, mass, terms, at / length)
    x, w = _rule(2 * degree + 4)
    depth = (np.arange(elements)[:, None] + x) * (length / elements)
    variance = float((kernel(depth, depth) * w).sum() * length / elements)
    keep = eigenvalues > ROUND_OFF * eigenvalues[0]
    coefficients = np.einsum("ij,kej->kei", basis, vectors[:, dofs])
    start = coefficients[:, 0] @ (-1.0) ** np.arange(degree + 1)
    coefficients[start < 0] *= -1
    mass.destroy()
    return GalerkinModes(eigenvalues[keep], variance, length, coefficients[keep])


def _eigenpairs(full: F8, mass: object, terms: int, start: F8) -> tuple[F8, F8]:
    """Largest eigenvalues (n,) and eigenvectors (n, size; of unit mass) of full x = lambda mass x."""
    from petsc4py import PETSc
    from slepc4py import SLEPc

    matrix = PETSc.Mat().createDense(full.shape, array=np.asfortranarray(full), comm=PETSc.COMM_SELF)
    matrix.assemble()
    first = matrix.createVecRight()
    first.array = 1.0 + start + start**2  # not SLEPc's random one: the same modes every time
    solver = SLEPc.EPS().create(PETSc.COMM_SELF)
    solver.setOperators(matrix, mass)
    solver.setProblemType(SLEPc.EPS.ProblemType.GHEP)
    solver.setWhichEigenpairs(SLEPc.EPS.Which.LARGEST_REAL)
    solver.setDimensions(min(terms, len(full)))
    solver.setConvergenceTest(SLEPc.EPS.Conv.NORM)  # eigenvalues near round-off cannot converge relative to themselves
    solver.setTolerances(1e-13, 1000)
    solver.setInitialSpace([first])
    solver.solve()
    found = min(terms, solver.getConverged())
    if found == 0:
        raise SceneError("covariance: SLEPc finds no eigenvalue")
    eigenvalues, vectors = np.empty(found), np.empty((found, len(full)))
    for k in range(found):
        eigenvalues[k] = solver.getEigenpair(k, first).real
        vectors[k] = first.array
    for made in (solver, first, matrix):
        made.destroy()
    return eigenvalues, vectors


# -- expansion ------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class KarhunenLoeve:
    """A Gaussian field by its modes: mean + sum_k sqrt(lambda_k) z_k phi_k(x), clipped to a support."""

    mean: float
    modes: Modes
    support: tuple[float, float] = (-math.inf, math.inf)

    @property
    def terms(self) -> int:
        """Number of terms, and of standard normal numbers that a sample takes."""
        return self.modes.terms

    @property
    def captured(self) -> float:
        """Share of the variance that the terms have."""
        return float(self.modes.captured[-1])

    def scaled(self, points: npt.ArrayLike) -> F8:
        """sqrt(lambda_k) phi_k (terms, m) at points (m,) in m."""
        return np.sqrt(self.modes.eigenvalues)[:, None] * self.modes(points)

    def covariance(self, points: npt.ArrayLike) -> F8:
        """Covariance (m, m) of what the terms give at points (m,), before clipping."""
        scaled = self.scaled(points)
        return scaled.T @ scaled

    def at(self, points: npt.ArrayLike, z: npt.ArrayLike) -> tuple[F8, int]:
        """A sample (m,) at points (m,) in m for standard normal z (terms,), and how many values were clipped."""
        return self.sum(self.scaled(points), z)

    def sum(self, scaled: F8, z: npt.ArrayLike) -> tuple[F8, int]:
        """The same for what `scaled` gave: cheaper for many samples at the same points."""
        z = np.asarray(z, dtype=np.float64)
        if z.shape != (self.terms,):
            raise ValueError(f"z has shape {z.shape}, must be ({self.terms},)")
        # row by row, not as a product of matrices: no library chooses the order of the sum
        values = self.mean + (scaled * z[:, None]).sum(axis=0)
        clipped = np.clip(values, *self.support)
        return clipped, int((clipped != values).sum())

    @property
    def spacing(self) -> float:
        """Distance of points (m) that shows the field: linear interpolation between them is right to 1 % in the last
        term, and better than 1e-3 in the whole (measured in docs/random-fields.md)."""
        return self.modes.length / (16 * self.terms)
