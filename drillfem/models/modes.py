"""Natural frequencies of a rod: small vibrations K x + C x-dot + M x-ddot = 0 of the one weak form, by SLEPc."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
import ufl
from petsc4py import PETSc

from ..compat import Array, MatrixForm
from ..errors import MissingDependency, SimulationError
from ..forms.constitutive import SECTION
from ..forms.kinematics import E3
from .initial import initial_state
from .rod import Rod, section_table

try:
    from slepc4py import SLEPc
except ImportError as error:
    raise MissingDependency(
        f"natural frequencies of a rod need SLEPc ({error}): `apt install python3-slepc4py-real` (Debian 13) or "
        "`conda install -c conda-forge slepc4py`"
    ) from None

#: Velocity components of the families into which the vibrations of a straight string fall apart.
FAMILIES = {"axial": ("v3",), "torsional": ("w3",), "bending": ("v1", "v2", "w1", "w2")}

#: Eigenvalues that are asked for besides those wanted: motions of the unstrained rod come with them.
_SPARE = 6


@dataclass(frozen=True)
class Modes:
    """Vibrations of one family, slowest first; motions of the unstrained rod (frequency zero) are left out.

    ``frequency`` (n,) in Hz; ``damping`` (n,): ratio to critical damping, c_d omega/2 for one Kelvin-Voigt time
    (spec 3.3); ``shape`` (n, nodes, fields): nodal velocities from the top down, components as ``ansatz.v_names``.
    """

    frequency: Array
    damping: Array
    shape: Array


@dataclass(frozen=True)
class Whirl:
    """Bending vibrations of a rod that turns about its axis, slowest first; in the fixed frame.

    ``frequency`` (n,) in Hz; ``forward`` (n,): whether the rod goes round in the sense in which it turns; ``growth``
    (n,) in 1/s: negative for a motion that dies out; ``shape`` (n, nodes, fields): complex amplitudes of the nodal
    displacements and rotations, components as ``ansatz.v_names``.
    """

    frequency: Array
    forward: npt.NDArray[np.bool_]
    growth: Array
    shape: npt.NDArray[np.complex128]


def linearise(rod: Rod, u: Array) -> tuple[sp.csr_matrix, sp.csr_matrix, sp.csr_matrix]:
    """Stiffness K, damping C and mass M (velocity dofs, block per node) about the state ``u`` at rest.

    The unknowns are the nodal velocities integrated in time: displacements and material rotations. Loads are those
    that the rod's constants hold.
    """
    a, n = rod.ansatz, len(rod.ansatz.x_names)
    rest = u.reshape(-1, a.size).copy()
    rest[:, n:] = 0.0
    still = np.zeros(rod.size)

    def jacobian(shift: float) -> sp.csr_matrix:
        rod.set_state(rest.reshape(-1), still)
        rod.shift.value = shift
        return _sparse(rod._jacobian)

    A = jacobian(0.0)
    B = jacobian(1.0) - A
    component = np.arange(rod.size) % a.size
    x, v = np.flatnonzero(component < n), np.flatnonzero(component >= n)
    # the kinematic rows W (x-dot - T v) = 0 are collocated: W is diagonal
    T = sp.diags(-1.0 / B[x][:, x].diagonal()) @ A[x][:, v]
    return A[v][:, x] @ T, A[v][:, v], B[v][:, v]


def natural_frequencies(rod: Rod, count: int = 10, u: Array | None = None) -> dict[str, Modes]:
    """The ``count`` slowest vibrations of each family about the equilibrium ``u`` (default: the start of the scene).

    Keys: ``axial``, ``torsional``, ``bending``, those that the ansatz has; where they do not fall apart (a bent or
    curved rod) the only key is ``coupled``. The rod is at rest: turning about its axis leaves the axial and torsional
    vibrations as they are and splits those in bending, see `whirling`.
    Raises SimulationError if the loads are not conservative (a dead moment on a rod that can bend).
    """
    K, C, M = linearise(rod, initial_state(rod) if u is None else u)
    out = {}
    for family, dofs in _families(rod, K).items():
        k, c, m = (X[dofs][:, dofs] for X in (K, C, M))
        scale = _slow(rod, family)
        # not quite symmetric: virtual rotations are interpolated, the quaternions that they vary are too
        squares, vectors = eigenpairs(k, m, min(count + _SPARE, len(dofs)), -scale)
        order = np.argsort(squares.real)
        order = order[squares.real[order] > 1e-3 * scale][:count]
        squares, vectors = squares[order], vectors[:, order]
        if np.any(abs(squares.imag) > 1e-3 * squares.real):
            raise SimulationError(
                "natural frequencies need conservative loads: a dead moment on a rod that bends is none"
            )
        # two real shapes out of a conjugate pair
        squares, vectors = squares.real, np.where(squares.imag < 0, vectors.imag, vectors.real)
        vectors = vectors / np.sqrt(np.einsum("ij,ij->j", vectors, m @ vectors))
        omega = np.sqrt(squares)
        damping = np.einsum("ij,ij->j", vectors, c @ vectors) / (2 * omega)
        out[family] = Modes(omega / (2 * np.pi), damping, _nodal(rod, dofs, vectors))
    return out


def whirling(rod: Rod, spin: float, count: int = 10, u: Array | None = None) -> Whirl:
    """The ``count`` slowest bending vibrations of a straight round rod that turns with ``spin`` (rad/s) about its axis.

    In the fixed frame the rod obeys M x-ddot + (C + G) x-dot + (K - spin C J) x = 0 with J x = e3 cross x: the angular
    momentum along the rod makes the gyroscopic moments G = spin (rho I_1 + rho I_2) (theta-dot cross e3), and the
    Kelvin-Voigt damping C turns with the rod, so that a forward whirl slower than the spin grows.
    ``u``: equilibrium, default the start of the scene; it may be twisted and stretched.
    Raises SimulationError if the rod cannot bend or is not straight.
    """
    K, C, M = linearise(rod, initial_state(rod) if u is None else u)
    dofs = _families(rod, K).get("bending")
    if dofs is None:
        raise SimulationError("whirling needs a straight rod that can bend (model spatial)")
    names = rod.ansatz.v_names
    number = len(names)
    turned = sp.lil_matrix((number, number))
    for a, b in (("v1", "v2"), ("w1", "w2")):
        turned[names.index(a), names.index(b)], turned[names.index(b), names.index(a)] = -1.0, 1.0
    J = sp.kron(sp.identity(K.shape[0] // number), turned, format="csr")
    G = spin * _gyroscopic(rod)
    stiffness, damping, mass = (X.tocsr()[dofs][:, dofs] for X in (K - spin * (C @ J), C + G, M))
    slow = np.sqrt(_slow(rod, "bending"))
    values, vectors = _quadratic_eigenpairs(stiffness, damping, mass, min(2 * (count + _SPARE), 2 * len(dofs)), slow)
    order = np.argsort(values.imag)
    order = order[values.imag[order] > 0.03 * slow][:count]
    values, shape = values[order], _nodal(rod, dofs, vectors[:, order])
    across, other = (shape[:, :, names.index(name)] for name in ("v1", "v2"))
    about_e3 = np.sum(across.conj() * other, axis=1).imag < 0
    forward = about_e3 if spin >= 0 else ~about_e3
    return Whirl(values.imag / (2 * np.pi), forward, values.real, shape)


def _gyroscopic(rod: Rod) -> sp.csr_matrix:
    """Moments (rho I_1 + rho I_2)(theta-dot cross e3) of a rod that turns with 1 rad/s (velocity dofs)."""
    a, on = rod.ansatz, rod.on
    test, trial = (a.twist(a.split(f(rod.V))[1], None).w for f in (ufl.TestFunction, ufl.TrialFunction))
    moment = ufl.dot(ufl.cross(trial, E3), test)
    form = rod.section.Theta[2, 2] * moment * on.mass
    for load, ds in ((rod.loads.top, on.top), (rod.loads.bottom, on.bottom)):
        form += load.Theta[2, 2] * moment * ds
    v = np.flatnonzero(np.arange(rod.size) % a.size >= len(a.x_names))
    return _sparse(MatrixForm(form))[v][:, v]


def _families(rod: Rod, K: sp.csr_matrix) -> dict[str, npt.NDArray[np.int64]]:
    """Velocity dofs that are free to move, by family; all of them as ``coupled`` where K couples the families."""
    names = rod.ansatz.v_names
    held = np.array(sorted([*rod.held, *rod.driven]), dtype=np.int64)
    node, component = held // rod.ansatz.size, held % rod.ansatz.size - len(rod.ansatz.x_names)
    free = np.ones(K.shape[0], dtype=bool)
    free[node * len(names) + component] = False
    names_of = np.array(names)[np.arange(K.shape[0]) % len(names)]
    families = {k: np.flatnonzero(np.isin(names_of, f) & free) for k, f in FAMILIES.items()}
    families = {k: dofs for k, dofs in families.items() if len(dofs)}
    if len(families) > 1 and not _uncoupled(K, families):
        return {"coupled": np.flatnonzero(free)}
    return families


def _uncoupled(K: sp.csr_matrix, families: dict[str, npt.NDArray[np.int64]]) -> bool:
    """Whether the stiffness has no entries between the families."""
    size = {k: abs(K[i][:, i]).max() for k, i in families.items()}
    return all(
        abs(K[i][:, j]).max() <= 1e-9 * np.sqrt(size[a] * size[b])
        for a, i in families.items()
        for b, j in families.items()
        if a != b
    )


def _nodal(rod: Rod, dofs: npt.NDArray[np.int64], vectors: npt.NDArray) -> npt.NDArray:
    """Vectors (dofs, n) as shapes (n, nodes, fields), nodes from the top down; held dofs are zero."""
    number = len(rod.ansatz.v_names)
    shape = np.zeros((vectors.shape[1], len(rod.nodes) * number), dtype=vectors.dtype)
    shape[:, dofs] = vectors.T
    return shape.reshape(vectors.shape[1], -1, number)[:, rod.nodes]


def _slow(rod: Rod, family: str) -> float:
    """Squared frequency (1/s2) well below the slowest vibration of a family: where the eigenvalue solver looks."""
    lowest, highest = section_table(rod.scene).min(axis=0), section_table(rod.scene).max(axis=0)
    low, high = dict(zip(SECTION, lowest, strict=True)), dict(zip(SECTION, highest, strict=True))
    ends, length = rod.scene.ends, rod.length
    mass = high["mass"] + (ends.top_mass + ends.bottom_mass) / length
    if family == "torsional":
        lumped = (ends.top_inertia + ends.bottom_inertia) / length
        return float(low["torsion"] / ((2 * high["inertia1"] + lumped) * length**2) / 10)
    if family == "axial":
        return float(low["axial"] / (mass * length**2) / 10)
    return float(low["bending1"] / (mass * length**4) / 10)


# -- SLEPc ------------------------------------------------------------------------------------------------------------
def _sparse(form: MatrixForm) -> sp.csr_matrix:
    matrix = form(form.create())
    indptr, indices, values = matrix.getValuesCSR()
    out = sp.csr_matrix((values.copy(), indices.copy(), indptr.copy()), shape=matrix.getSize())
    matrix.destroy()
    return out


@contextmanager
def _petsc(*matrices: sp.csr_matrix) -> Iterator[list[PETSc.Mat]]:
    """PETSc matrices of scipy ones, freed at the end."""
    made = []
    for matrix in matrices:
        rows = matrix.tocsr()
        rows.sort_indices()
        made.append(PETSc.Mat().createAIJ(rows.shape, csr=(rows.indptr, rows.indices, rows.data), comm=PETSc.COMM_SELF))
    try:
        yield made
    finally:
        for m in made:
            m.destroy()


def eigenpairs(k: sp.csr_matrix, m: sp.csr_matrix, count: int, near: float) -> tuple[npt.NDArray, npt.NDArray]:
    """The ``count`` eigenvalues of k x = lambda m x nearest to the number ``near``, and their vectors (n, count)."""
    solver = SLEPc.EPS().create(PETSc.COMM_SELF)
    with _petsc(k, m) as (stiffness, mass):
        solver.setOptionsPrefix("drillfem_modes_")
        solver.setOperators(stiffness, mass)
        solver.setProblemType(SLEPc.EPS.ProblemType.GNHEP)
        return _solve(solver, SLEPc.EPS.Which.TARGET_MAGNITUDE, count, near)


def _quadratic_eigenpairs(
    k: sp.csr_matrix, c: sp.csr_matrix, m: sp.csr_matrix, count: int, near: float
) -> tuple[npt.NDArray, npt.NDArray]:
    """The ``count`` roots of (k + lambda c + lambda^2 m) x = 0 nearest to ``near``, and their vectors (n, count)."""
    solver = SLEPc.PEP().create(PETSc.COMM_SELF)
    with _petsc(k, c, m) as matrices:
        solver.setOptionsPrefix("drillfem_whirl_")
        solver.setOperators(matrices)
        solver.setScale(SLEPc.PEP.Scale.SCALAR)
        return _solve(solver, SLEPc.PEP.Which.TARGET_MAGNITUDE, count, near)


def _solve(
    solver: SLEPc.EPS | SLEPc.PEP, which: int, count: int, near: float
) -> tuple[npt.NDArray[np.complex128], npt.NDArray[np.complex128]]:
    """Shift and invert about ``near`` with a direct solver. Raises SimulationError if fewer than ``count`` converge."""
    solver.setDimensions(count)
    solver.setTolerances(1e-12, 500)
    solver.setTarget(near)
    solver.setWhichEigenpairs(which)
    transformation = solver.getST()
    transformation.setType(SLEPc.ST.Type.SINVERT)
    inner = transformation.getKSP()
    inner.setType(PETSc.KSP.Type.PREONLY)
    inner.getPC().setType(PETSc.PC.Type.LU)
    solver.setFromOptions()
    try:
        solver.solve()
    except PETSc.Error as error:
        raise SimulationError(f"natural frequencies: PETSc failed ({error})") from error
    found = solver.getConverged()
    if found < count:
        reason = solver.getConvergedReason()
        solver.destroy()
        raise SimulationError(f"natural frequencies: {found} of {count} found (SLEPc reason {reason})")
    matrix = solver.getOperators()[0]
    real, imaginary = matrix.createVecs()
    values, vectors = np.zeros(count, complex), np.zeros((matrix.getSize()[0], count), complex)
    for i in range(count):
        pair = solver.getEigenpair(i, real, imaginary)
        values[i] = pair
        vectors[:, i] = real.array + 1j * imaginary.array
    for thing in (real, imaginary, solver):
        thing.destroy()
    return values, vectors
