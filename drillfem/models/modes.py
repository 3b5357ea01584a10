"""Natural frequencies of a rod: small vibrations K x + C x-dot + M x-ddot = 0 of the one weak form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from petsc4py import PETSc
from scipy.sparse.linalg import eigs

from ..compat import Array
from ..errors import SimulationError
from ..forms.constitutive import SECTION
from .initial import initial_state
from .rod import Rod, section_table

#: Velocity components of the families into which the vibrations of a straight string fall apart.
FAMILIES = {"axial": ("v3",), "torsional": ("w3",), "bending": ("v1", "v2", "w1", "w2")}


@dataclass(frozen=True)
class Modes:
    """Vibrations of one family, slowest first; motions of the unstrained rod (frequency zero) are left out.

    ``frequency`` (n,) in Hz; ``damping`` (n,): ratio to critical damping, c_d omega/2 for one Kelvin-Voigt time
    (spec 3.3); ``shape`` (n, nodes, fields): nodal velocities from the top down, components as ``ansatz.v_names``.
    """

    frequency: Array
    damping: Array
    shape: Array


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
        matrix: PETSc.Mat = rod._jacobian(rod.create_matrix())
        indptr, indices, values = matrix.getValuesCSR()
        out = sp.csr_matrix((values.copy(), indices.copy(), indptr.copy()), shape=(rod.size, rod.size))
        matrix.destroy()
        return out

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
    curved rod) the only key is ``coupled``. Gyroscopic terms of a turning string are left out: ``u`` is taken at rest.
    Raises SimulationError if the loads are not conservative (a dead moment on a rod that can bend).
    """
    K, C, M = linearise(rod, initial_state(rod) if u is None else u)
    names = rod.ansatz.v_names
    held = np.array(sorted([*rod.held, *rod.driven]), dtype=np.int64)
    node, component = held // rod.ansatz.size, held % rod.ansatz.size - len(rod.ansatz.x_names)
    free = np.ones(K.shape[0], dtype=bool)
    free[node * len(names) + component] = False
    names_of = np.array(names)[np.arange(K.shape[0]) % len(names)]
    families = {k: np.flatnonzero(np.isin(names_of, f) & free) for k, f in FAMILIES.items()}
    families = {k: dofs for k, dofs in families.items() if len(dofs)}
    if len(families) > 1 and not _uncoupled(K, families):
        families = {"coupled": np.flatnonzero(free)}
    out = {}
    for family, dofs in families.items():
        k, c, m = (X[dofs][:, dofs] for X in (K, C, M))
        scale = _slow(rod, family)
        wanted = min(count + 6, len(dofs) - 2)
        # not quite symmetric: virtual rotations are interpolated, the quaternions that they vary are too
        squares, vectors = eigs(k, wanted, m, sigma=-scale, which="LM")
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
        shape = np.zeros((len(order), K.shape[0]))
        shape[:, dofs] = vectors.T
        damping = np.einsum("ij,ij->j", vectors, c @ vectors) / (2 * omega)
        out[family] = Modes(omega / (2 * np.pi), damping, shape.reshape(len(order), -1, len(names))[:, rod.nodes])
    return out


def _uncoupled(K: sp.csr_matrix, families: dict[str, npt.NDArray[np.int64]]) -> bool:
    """Whether the stiffness has no entries between the families."""
    size = {k: abs(K[i][:, i]).max() for k, i in families.items()}
    return all(
        abs(K[i][:, j]).max() <= 1e-9 * np.sqrt(size[a] * size[b])
        for a, i in families.items()
        for b, j in families.items()
        if a != b
    )


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
