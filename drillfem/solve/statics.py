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
from ..forms.ansatz import DEPTH
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
    # held where it is, or nothing would balance what pushes it
    "sliding": ("r1", "r2", "r3", "theta", "phi", "q_a", "q_b", "q_c", "q_d"),
    "guided": ("r1", "r2"),
    "bit": ("r1", "r2"),
}


#: How often the multipliers of the augmented Lagrangian are moved before it gives up.
MOST_UPDATES = 200


@dataclass(frozen=True)
class Equilibrium:
    """A static solution: configuration nodal values (nodes, fields), Newton iterations, load steps done."""

    x: Array
    newton_iterations: int
    load_steps: int


class Statics:
    """Static problem of a rod: configuration fields only, end loads of the scene scaled by a load factor."""

    def __init__(self, rod: Rod) -> None:
        self.rod, a = rod, rod.ansatz.bare
        n = self.fields = len(a.x_names)
        self._updates = 0
        self.V = lagrange(rod.mesh, rod.scene.mesh.degree, n)
        self.x = dolfinx.fem.Function(self.V)
        #: springs to the centreline of the hole (N/m2)
        self.support = rod.constant(0.0)
        F = vw.total(self.terms())
        self.residual = VectorForm(F)
        self.jacobian = MatrixForm(ufl.derivative(F, self.x, ufl.TrialFunction(self.V)))
        ends = rod.scene.ends
        held = []
        for node, kind in ((0, ends.top), (-1, ends.bottom)):
            if not (kind == "bit" and rod.bends):  # there the hole guides it
                held += [int(rod.nodes[node]) * n + a.x_names.index(k) for k in _HELD[kind] if k in a.x_names]
        self.held = np.array(sorted(held), dtype=np.int32)

    def terms(self) -> vw.Terms:
        """The terms of equilibrium, by name: without motion there is neither inertia nor damping nor friction."""
        rod, test, a = self.rod, ufl.TestFunction(self.V), self.rod.ansatz.bare
        support = self.support if rod.bends or a.name == "planar" else None
        terms = vw.static_terms(a, self.x, test, rod.s, rod.section, rod.loads, rod.on, rod.literal, support)
        return {k: v for k, v in terms.items() if k not in ("inertia", "damping", "friction")}

    def start(self, u: Array) -> Array:
        """Configuration part (nodes * fields) of a vector of unknowns of the rod."""
        return u.reshape(-1, self.rod.ansatz.size)[:, : self.fields].reshape(-1).copy()

    def state(self, x: Array) -> Array:
        """Unknowns of the rod (dofs,), at rest, of a configuration (nodes * fields)."""
        a = self.rod.ansatz
        u = np.zeros((len(self.rod.nodes), a.size))
        u[:, : self.fields] = x.reshape(-1, self.fields)
        if DEPTH in a.x_names and self.rod.wall is not None:
            u[:, a.index(DEPTH)] = self.rod.wall.hole.nearest(u[:, :3])
        return u.reshape(-1)

    def _set(self, values: Array) -> None:
        self.x.x.array[:] = values
        self.rod.find_hole(values, self.fields)

    def _augment(self, values: Array) -> bool:
        """Move the multipliers of an augmented Lagrangian (Uzawa) to a state; False where they may stay."""
        wall, contact = self.rod.wall, self.rod.scene.contact
        if wall is None or contact is None or contact.method != "augmented":
            return False
        self._set(values)
        limit = contact.penetration_tolerance
        left = wall.augment(values, contact.stiffness, limit, size=self.fields)
        if left <= limit:
            self._updates = 0
            return False
        self._updates += 1
        if self._updates > MOST_UPDATES:
            raise SimulationError(
                f"contact.method = 'augmented' leaves a penetration of {left:.3g} m after {MOST_UPDATES} updates of "
                "its multipliers: try a larger contact.stiffness, a finer mesh, or contact.penetration_tolerance = "
                f"{2 * left:.1g}"
            )
        return True

    def solve(
        self,
        x0: Array,
        load_factors: Array,
        set_load: Callable[[float], None],
        on_step: Callable[[float, Array], None] | None = None,
        least: float = 1e-3,
    ) -> Equilibrium:
        """Follow the loads from ``x0`` (flat) through ``load_factors``; ``set_load`` applies a factor to the rod.

        A step that does not converge is halved, unless it is ``least`` or smaller. Raises SimulationError if that does
        not help, with the load factor that was reached.
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
                good, there = x.getArray().copy(), rod.there()
                set_load(factor)
                while True:
                    snes.solve(None, x)
                    iterations += snes.getIterationNumber()
                    if snes.getConvergedReason() <= 0 or not self._augment(x.getArray()):
                        break
                if snes.getConvergedReason() > 0:
                    reached, steps = factor, steps + 1
                    targets.pop(0)
                    if on_step is not None:
                        self.x.x.array[:] = x.getArray()
                        on_step(factor, x.getArray().copy())
                    continue
                x.setArray(good)
                rod.go_back(there)  # an iteration that ran away took the closest points with it
                if abs(factor - reached) <= least or len(targets) > len(load_factors) + 64:
                    raise SimulationError(
                        f"no equilibrium beyond {100 * reached:.3g} % of the load (SNES reason "
                        f"{snes.getConvergedReason()}): try more time.load_steps or a finer mesh"
                    )
                targets.insert(0, (reached + factor) / 2)
            self.x.x.array[:] = x.getArray()
            return Equilibrium(x.getArray().copy().reshape(-1, self.fields), iterations, steps)
        finally:
            for item in (snes, matrix, f, x):
                item.destroy()
