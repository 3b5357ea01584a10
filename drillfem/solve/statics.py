"""Equilibrium of a rod by PETSc SNES with load stepping."""

from __future__ import annotations

import itertools
import logging
from collections.abc import Callable
from dataclasses import dataclass

import dolfinx
import numpy as np
import ufl
from petsc4py import PETSc

from ..compat import Array, MatrixForm, VectorForm, lagrange
from ..errors import SimulationError
from ..forms import virtual_work as vw
from ..models.rod import Rod

log = logging.getLogger("drillfem")
_serial = itertools.count()

#: What an end condition holds in statics: the configuration fields themselves.
_HELD = {
    "free": (),
    "pinned": ("r1", "r2", "r3"),
    "clamped": ("r1", "r2", "r3", "theta", "phi", "q_a", "q_b", "q_c", "q_d"),
    "hung": ("r1", "r2", "r3", "theta", "phi", "q_a", "q_b", "q_c", "q_d"),
    "driven": ("r1", "r2", "r3", "theta", "phi", "q_a", "q_b", "q_c", "q_d"),
    "guided": ("r1", "r2"),
    "bit": ("r1", "r2"),
}


@dataclass(frozen=True)
class Equilibrium:
    """A static solution: configuration nodal values (nodes, fields), Newton iterations, load steps done."""

    x: Array
    newton_iterations: int
    load_steps: int


class Statics:
    """Static problem of a rod: configuration fields only, end loads of the scene scaled by a load factor."""

    def __init__(self, rod: Rod) -> None:
        self.rod, a = rod, rod.ansatz
        n = len(a.x_names)
        self.V = lagrange(rod.mesh, rod.scene.mesh.degree, n)
        self.x = dolfinx.fem.Function(self.V)
        #: springs to the centreline of the hole (N/m2)
        self.support = rod.constant(0.0)
        terms = vw.static_terms(
            a,
            self.x,
            ufl.TestFunction(self.V),
            rod.s,
            rod.section,
            rod.loads,
            rod.on,
            rod.literal,
            self.support if rod.bends else None,
        )
        F = vw.total({k: v for k, v in terms.items() if k not in ("inertia", "damping", "friction")})
        self.residual = VectorForm(F)
        self.jacobian = MatrixForm(ufl.derivative(F, self.x, ufl.TrialFunction(self.V)))
        ends = rod.scene.ends
        held = []
        for node, kind in ((0, ends.top), (-1, ends.bottom)):
            if not (kind == "bit" and rod.bends):  # there the hole guides it
                held += [int(rod.nodes[node]) * n + a.x_names.index(k) for k in _HELD[kind] if k in a.x_names]
        self.held = np.array(sorted(held), dtype=np.int32)

    def start(self, u: Array) -> Array:
        """Configuration part (nodes * fields) of a vector of unknowns of the rod."""
        a = self.rod.ansatz
        return u.reshape(-1, a.size)[:, : len(a.x_names)].reshape(-1).copy()

    def _set(self, values: Array) -> None:
        self.x.x.array[:] = values
        self.rod.find_hole(values, len(self.rod.ansatz.x_names))

    def solve(
        self,
        x0: Array,
        load_factors: Array,
        set_load: Callable[[float], None],
        on_step: Callable[[float, Array], None] | None = None,
    ) -> Equilibrium:
        """Follow the loads from ``x0`` (flat) through ``load_factors``; ``set_load`` applies a factor to the rod.

        A step that does not converge is halved (down to 1/64). Raises SimulationError if that does not help, with the
        load factor that was reached.
        """
        fixed, rod = x0[self.held].copy(), self.rod
        matrix = self.jacobian.create()
        snes = PETSc.SNES().create(self.rod.mesh.comm)
        prefix = f"drillfem_statics_{next(_serial)}_"
        snes.setOptionsPrefix(prefix)

        def function(_: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
            values = x.getArray(readonly=1)
            self._set(values)
            out = f.getArray()
            self.residual(out)
            if rod.wall is not None and rod.wall.trouble:
                out[:] = np.nan
            out[self.held] = values[self.held] - fixed

        def tangent(_: PETSc.SNES, x: PETSc.Vec, J: PETSc.Mat, P: PETSc.Mat) -> None:
            self._set(x.getArray(readonly=1))
            self.jacobian(P)
            P.zeroRows(self.held, diag=1.0)

        f = matrix.createVecLeft()
        snes.setFunction(function, f)
        snes.setJacobian(tangent, matrix)
        snes.setType(PETSc.SNES.Type.NEWTONLS)
        options = PETSc.Options(prefix)
        # a slender rod that bends stretches in the first iteration: the residual grows 1e4-fold and comes back
        chosen = {"snes_linesearch_type": "basic", "snes_divergence_tolerance": "1e30"}
        for name, value in chosen.items():
            options[name] = value
        snes.setFromOptions()
        for name in chosen:
            options.delValue(name)
        snes.setTolerances(rtol=1e-13, atol=1e-11, stol=1e-13, max_it=40)
        ksp = snes.getKSP()
        ksp.setType(PETSc.KSP.Type.PREONLY)
        ksp.getPC().setType(PETSc.PC.Type.LU)
        # pivoting: the rows of a virtual rotation and the columns of a quaternion do not match on the diagonal
        ksp.getPC().setFactorSolverType("mumps")
        x = matrix.createVecRight()
        x.setArray(x0)
        iterations, steps, reached = 0, 0, 0.0
        targets = list(load_factors)
        try:
            while targets:
                factor = targets[0]
                good = x.getArray().copy()
                set_load(factor)
                snes.solve(None, x)
                iterations += snes.getIterationNumber()
                if snes.getConvergedReason() > 0:
                    reached, steps = factor, steps + 1
                    targets.pop(0)
                    if on_step is not None:
                        self.x.x.array[:] = x.getArray()
                        on_step(factor, x.getArray().copy())
                    continue
                x.setArray(good)
                if abs(factor - reached) < 1e-3 or len(targets) > len(load_factors) + 64:
                    raise SimulationError(
                        f"no equilibrium beyond {100 * reached:.3g} % of the load (SNES reason "
                        f"{snes.getConvergedReason()}): try more time.load_steps or a finer mesh"
                    )
                targets.insert(0, (reached + factor) / 2)
            self.x.x.array[:] = x.getArray()
            return Equilibrium(x.getArray().copy().reshape(-1, len(self.rod.ansatz.x_names)), iterations, steps)
        finally:
            for item in (snes, matrix, f, x):
                item.destroy()
