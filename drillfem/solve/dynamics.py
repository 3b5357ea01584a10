"""Time stepping of a rod by PETSc TS on F(t, u, u-dot) = 0."""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc

from ..compat import Array, ScalarForm, VectorForm
from ..errors import SimulationError
from ..models.rod import Rod
from ..scene import Time
from .newton import BitCoupledNewton, BitLoad, Outcome

_serial = itertools.count()
#: rejections beyond one per step that end a run
_TROUBLE = 200


def integrator_of(time: Time, drilling: bool) -> tuple[str, float]:
    """Integrator of a scene, and its parameter: theta, or the radius rho of generalised-alpha (else 0).

    Default: the trapezoidal rule where a bit drills, for it meets the bit law at the ends of its steps
    (generalised-alpha meets it inside, and the end speeds of a bit that sticks ring); generalised-alpha for a rod in
    free motion, where the trapezoidal rule can blow up.
    """
    kind, theta = time.integrator, time.theta
    if kind == "default":
        kind, theta = ("theta", 0.5) if drilling else ("generalized-alpha", theta)
    return kind, {"generalized-alpha": time.rho_infinity, "theta": theta}.get(kind, 0.0)


def configure(ts: PETSc.TS, time: Time, prefix: str, drilling: bool = False) -> None:
    """Choose the integrator of a scene, as :func:`integrator_of` says. Sets options under ``prefix``, applies them."""
    options = PETSc.Options(prefix)
    kind, parameter = integrator_of(time, drilling)
    if kind == "generalized-alpha":
        ts.setType(PETSc.TS.Type.ALPHA)
        ts.setAlphaRadius(parameter)
    elif kind == "theta":
        ts.setType(PETSc.TS.Type.THETA)
        ts.setTheta(parameter)
        ts.setThetaEndpoint(True)
    elif kind == "bdf":
        ts.setType(PETSc.TS.Type.BDF)
        options["ts_bdf_order"] = time.order
    elif kind == "arkimex":
        ts.setType(PETSc.TS.Type.ARKIMEX)
        ts.setARKIMEXType({2: "2e", 3: "3", 4: "4", 5: "5"}[time.order])
        ts.setARKIMEXFullyImplicit(True)
    else:
        raise ValueError(f"time.integrator = {kind!r} is not one of PETSc TS")
    options["ts_adapt_type"] = "basic" if time.adaptive else "none"
    ts.setTolerances(rtol=time.tolerance, atol=time.tolerance)
    ts.setFromOptions()
    for name in ("ts_bdf_order", "ts_adapt_type"):
        if options.hasName(name):
            options.delValue(name)


@dataclass
class StepReport:
    """What one accepted step did."""

    time: float
    step: float
    #: time at which loads, reactions and powers of the step were evaluated
    stage_time: float


_REASON = {
    Outcome.CONVERGED: PETSc.SNES.ConvergedReason.CONVERGED_SNORM_RELATIVE,
    Outcome.SLOW: PETSc.SNES.ConvergedReason.DIVERGED_MAX_IT,
    Outcome.NAN: PETSc.SNES.ConvergedReason.DIVERGED_FNORM_NAN,
}


class PetscSystem:
    """The step that TS has put into its SNES, as Newton's method sees it."""

    def __init__(self, rod: Rod, snes: PETSc.SNES) -> None:
        self.rod, self._snes = rod, snes
        self.stage_fraction = 1.0
        self.x: PETSc.Vec | None = None
        self._at_stage = 0.0
        self._only_shift = False
        self._matrix = snes.getJacobian()[1]
        self._ksp = PETSc.KSP().create(self._matrix.comm)
        self._ksp.setOperators(self._matrix)
        self._ksp.setType(PETSc.KSP.Type.PREONLY)
        pc = self._ksp.getPC()
        pc.setType(PETSc.PC.Type.LU)
        pc.setFactorOrdering("rcm")
        self._b, self._f = self._matrix.createVecLeft(), self._matrix.createVecLeft()
        self._y = self._matrix.createVecRight()
        # some integrators scale the matrix they ask for: when only the shift is wanted, this one
        self._decoy = PETSc.Mat().createConstantDiagonal(self._matrix.getSizes(), 1.0, comm=self._matrix.comm)
        self._decoy.assemble()

    def jacobian(self, shift: float, matrix: PETSc.Mat) -> None:
        """Called by TS: assemble at the present state of the rod, or only note the shift."""
        self._at_stage = shift
        if not self._only_shift:
            rod = self.rod
            rod.jacobian(rod.u.x.array.copy(), rod.u_dot.x.array.copy(), shift, matrix)

    def residual(self) -> Array:
        """See :class:`drillfem.solve.newton.System`."""
        self._snes.computeFunction(self.x, self._f)
        array: Array = self._f.getArray()
        return array

    def iterate(self, newton: BitCoupledNewton) -> Outcome | None:
        """See :class:`drillfem.solve.newton.System`."""
        return None

    def settle(self) -> None:
        """See :class:`drillfem.solve.newton.System`."""
        self._snes.computeFunction(self.x, self._f)

    def shift(self) -> float:
        """See :class:`drillfem.solve.newton.System`."""
        self._only_shift = True
        self._snes.computeJacobian(self.x, self._decoy)
        self._only_shift = False
        return self._at_stage

    def factorise(self) -> None:
        """See :class:`drillfem.solve.newton.System`."""
        self._snes.computeJacobian(self.x, self._matrix)
        self._ksp.setOperators(self._matrix)

    def solve(self, b: Array) -> Array:
        """See :class:`drillfem.solve.newton.System`."""
        self._b.setArray(b)
        self._ksp.solve(self._b, self._y)
        array: Array = self._y.getArray()
        return array

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for item in (self._ksp, self._b, self._f, self._y, self._decoy):
            item.destroy()


class _Context:
    """Python context of the SNES of a :class:`Stepper`."""

    def __init__(self, rod: Rod, newton: BitCoupledNewton) -> None:
        self.rod, self.newton = rod, newton
        self.system: PetscSystem | None = None

    def setUp(self, snes: PETSc.SNES) -> None:
        """Create work space and the direct solver."""
        self.system = PetscSystem(self.rod, snes)

    def solve(self, snes: PETSc.SNES, b: PETSc.Vec | None, x: PETSc.Vec) -> None:
        """Solve the step; sets the converged reason of ``snes``."""
        assert self.system is not None
        self.system.x = x
        snes.setConvergedReason(_REASON[self.newton.solve(self.system, x.getArray())])

    def reset(self, snes: PETSc.SNES) -> None:
        """Free what belongs to a set-up."""
        if self.system is not None:
            self.system.destroy()
            self.system = None


class Marcher(ABC):
    """Marches a rod, one accepted step at a time. The rock surface is moved by the caller between steps.

    ``newton``: the iteration that solves the steps. ``rejected``: steps refused so far.
    """

    def __init__(self, rod: Rod, u: Array, bit: BitLoad | None = None, time: Time | None = None) -> None:
        """u (dofs,): the start, at ``time.start``. bit: the rock's answer, or None. time: else the scene's."""
        self.rod, self.time = rod, time or rod.scene.time
        self.newton = BitCoupledNewton(rod, bit, keep=self.time.jacobian == "kept")
        self.stage_time = self.time.start
        self.rejected = 0
        self._trouble = 0
        self._fresh = True
        kind, theta = integrator_of(self.time, rod.has_bit)
        rod.begin(u, theta if kind == "theta" else 1.0)

    @classmethod
    def adopt(cls, rod: Rod) -> None:
        """Tell a new rod who assembles for it."""
        rod.vector_form, rod.scalar_form = VectorForm, ScalarForm

    @property
    @abstractmethod
    def u(self) -> Array:
        """Present unknowns, shape (dofs,) (a view)."""

    @property
    @abstractmethod
    def now(self) -> float:
        """Present time (s)."""

    @property
    @abstractmethod
    def length(self) -> float:
        """Length of the last step, or of the next one where steps adapt (s)."""

    @abstractmethod
    def set_state(self, now: float, u: Array, length: float) -> None:
        """Go on from another state."""

    @abstractmethod
    def _advance(self, h: float) -> tuple[int, str]:
        """One step of length h (s), or of less: how many were refused, and why none succeeds (else empty)."""

    def restart(self) -> None:
        """Forget everything but the state, as a run does that is resumed here."""
        self.newton.forget()
        self._fresh = True

    def step(self, until: float) -> StepReport:
        """One accepted step that does not pass ``until``. Raises SimulationError when no step length succeeds."""
        t = self.now
        h = self.length if self.time.adaptive and not self._fresh else self.time.step
        left = until - t
        # never leave a sliver: the last step before ``until`` may be up to half a per cent longer
        h = left if left < 1.005 * h else h
        refused, why = self._advance(h)
        self._fresh = False
        self.rejected += refused
        if why:
            why = self.newton.complaint or why
            raise SimulationError(
                f"no time step succeeds at t = {t:.6g} s ({why}, step down to {self.length:.2g} s): "
                "try a smaller time.step or another time.integrator"
            )
        if refused:
            self.newton.forget()
        now = self.now
        self._trouble = max(0, self._trouble + refused - 1)
        if self._trouble > _TROUBLE:
            raise SimulationError(
                f"time stepping breaks down at t = {now:.6g} s (step {now - t:.2g} s, nearly every one refused): "
                "try a smaller time.step or another time.integrator"
            )
        self.rod.accept(now, self.u)
        return StepReport(now, now - t, self.stage_time)

    def destroy(self) -> None:
        """Free what is kept."""
        self.newton.forget()


class Stepper(Marcher):
    """Marches a rod with PETSc TS. ``bit``: the rock's answer, or None."""

    def __init__(self, rod: Rod, u: Array, bit: BitLoad | None = None, time: Time | None = None) -> None:
        super().__init__(rod, u, bit, time)
        self._matrix = rod.create_matrix()
        self._f = self._matrix.createVecLeft()
        self.vec = self._matrix.createVecRight()
        self.vec.setArray(u)
        ts = self.ts = PETSc.TS().create(rod.mesh.comm)
        prefix = f"drillfem_ts_{next(_serial)}_"
        ts.setOptionsPrefix(prefix)
        ts.setProblemType(PETSc.TS.ProblemType.NONLINEAR)
        ts.setEquationType(PETSc.TS.EquationType.IMPLICIT)
        ts.setIFunction(self._function, self._f)
        ts.setIJacobian(self._jacobian, self._matrix)
        ts.setExactFinalTime(PETSc.TS.ExactFinalTime.STEPOVER)
        # a step gives up after its rejections; failures add up over the whole run and must not end it
        ts.setMaxSNESFailures(2**31 - 2)
        ts.setErrorIfStepFails(False)
        configure(ts, self.time, prefix, rod.has_bit)
        ts.setMaxSteps(2**31 - 2)
        ts.setMaxTime(np.inf)
        snes = ts.getSNES()
        snes.setType(PETSc.SNES.Type.PYTHON)
        self.context = _Context(rod, self.newton)
        snes.setPythonContext(self.context)
        ts.setSolution(self.vec)
        ts.setTime(self.time.start)
        ts.setTimeStep(self.time.step)
        self._alpha = ts.getType() == PETSc.TS.Type.ALPHA
        self.newton.extrapolate = ts.getType() != PETSc.TS.Type.ARKIMEX

    def _function(self, ts: PETSc.TS, t: float, u: PETSc.Vec, u_dot: PETSc.Vec, f: PETSc.Vec) -> None:
        self.stage_time = t
        if self._alpha and self.context.system is not None:
            # (alpha_m, alpha_f, gamma): PETSc starts with backward Euler, where they are 1
            self.context.system.stage_fraction = ts.getAlphaParams()[1]
        self.rod.residual(t, u.getArray(readonly=1), u_dot.getArray(readonly=1), f.getArray())

    def _jacobian(
        self, ts: PETSc.TS, t: float, u: PETSc.Vec, u_dot: PETSc.Vec, shift: float, J: PETSc.Mat, P: PETSc.Mat
    ) -> None:
        assert self.context.system is not None
        self.context.system.jacobian(shift, P)

    def restart(self) -> None:
        """Forget everything but the state, as a run does that is resumed here."""
        super().restart()
        self.ts.restartStep()

    @property
    def u(self) -> Array:
        """Present unknowns, shape (dofs,) (a view)."""
        array: Array = self.vec.getArray(readonly=1)
        return array

    @property
    def now(self) -> float:
        """Present time (s)."""
        return float(self.ts.getTime())

    @property
    def length(self) -> float:
        """Length of the last step, or of the next one where steps adapt (s)."""
        return float(self.ts.getTimeStep())

    def set_state(self, now: float, u: Array, length: float) -> None:
        """Go on from another state."""
        self.vec.setArray(u)
        self.ts.setTime(now)
        self.ts.setTimeStep(length)

    def _advance(self, h: float) -> tuple[int, str]:
        ts = self.ts
        if abs(h - ts.getTimeStep()) > 0:
            ts.setTimeStep(h)
        before = ts.getStepRejections()  # a failed solve is a rejection too
        ts.step()
        reason = ts.getConvergedReason()
        return ts.getStepRejections() - before, f"PETSc TS reason {reason}" if reason < 0 else ""

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for item in (self.ts, self._matrix, self._f, self.vec):
            item.destroy()


def march(rod: Rod, u0: Array, end: float, time: Time | None = None, observe: Any = None) -> Array:
    """March a rod without rock from its start to ``end``; ``observe(t, u)`` after each step. Returns the last u."""
    stepper = Stepper(rod, u0, None, time)
    try:
        if observe is not None:
            observe(stepper.now, stepper.u)
        while stepper.now < end * (1 - 1e-12):
            report = stepper.step(end)
            if observe is not None:
                observe(report.time, stepper.u)
        return stepper.u.copy()
    finally:
        stepper.destroy()
