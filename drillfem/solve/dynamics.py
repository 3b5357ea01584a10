"""Time stepping of a rod by PETSc TS on F(t, u, u-dot) = 0."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc

from ..compat import Array
from ..errors import SimulationError
from ..models.rod import Rod
from ..scene import Time
from .newton import BitCoupledNewton, BitLoad

_serial = itertools.count()
#: rejections beyond one per step that end a run
_TROUBLE = 200


def configure(ts: PETSc.TS, time: Time, prefix: str, drilling: bool = False) -> None:
    """Choose the integrator of a scene. Sets options under ``prefix`` and applies them.

    Default: the trapezoidal rule where a bit drills, for it meets the bit law at the ends of its steps
    (generalised-alpha meets it inside, and the end speeds of a bit that sticks ring); generalised-alpha for a rod in
    free motion, where the trapezoidal rule can blow up.
    """
    options = PETSc.Options(prefix)
    kind, theta = time.integrator, time.theta
    if kind == "default":
        kind, theta = ("theta", 0.5) if drilling else ("generalized-alpha", theta)
    if kind == "generalized-alpha":
        ts.setType(PETSc.TS.Type.ALPHA)
        ts.setAlphaRadius(time.rho_infinity)
    elif kind == "theta":
        ts.setType(PETSc.TS.Type.THETA)
        ts.setTheta(theta)
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


class Stepper:
    """Marches a rod with PETSc TS, one accepted step at a time.

    ``u``: present unknowns. ``bit``: the rock's answer, or None. The rock surface is moved by the caller between steps.
    """

    def __init__(self, rod: Rod, u: Array, bit: BitLoad | None = None, time: Time | None = None) -> None:
        self.rod, self.time = rod, time or rod.scene.time
        self.newton = BitCoupledNewton(rod, bit, keep=self.time.jacobian == "kept")
        self._matrix = rod.create_matrix()
        self._f = self._matrix.createVecLeft()
        self.vec = self._matrix.createVecRight()
        self.vec.setArray(u)
        self.stage_time = self.time.start
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
        snes.setPythonContext(self.newton)
        ts.setSolution(self.vec)
        ts.setTime(self.time.start)
        ts.setTimeStep(self.time.step)
        self._alpha = ts.getType() == PETSc.TS.Type.ALPHA
        self.newton.extrapolate = ts.getType() != PETSc.TS.Type.ARKIMEX
        self.rejected = 0
        self._trouble = 0
        self._restart = True

    def _function(self, ts: PETSc.TS, t: float, u: PETSc.Vec, u_dot: PETSc.Vec, f: PETSc.Vec) -> None:
        self.stage_time = t
        if self._alpha:
            # (alpha_m, alpha_f, gamma): PETSc starts with backward Euler, where they are 1
            self.newton.stage_fraction = ts.getAlphaParams()[1]
        self.rod.residual(t, u.getArray(readonly=1), u_dot.getArray(readonly=1), f.getArray())

    def _jacobian(
        self, ts: PETSc.TS, t: float, u: PETSc.Vec, u_dot: PETSc.Vec, shift: float, J: PETSc.Mat, P: PETSc.Mat
    ) -> None:
        self.newton.jacobian(shift, P)

    def restart(self) -> None:
        """Forget everything but the state, as a run does that is resumed here."""
        self.ts.restartStep()
        self.newton.forget()
        self._restart = True

    @property
    def u(self) -> Array:
        """Present unknowns, shape (dofs,) (a view)."""
        array: Array = self.vec.getArray(readonly=1)
        return array

    def step(self, until: float) -> StepReport:
        """One accepted step that does not pass ``until``. Raises SimulationError when no step length succeeds."""
        ts, nominal = self.ts, self.time.step
        t = ts.getTime()
        h = ts.getTimeStep() if self.time.adaptive and not self._restart else nominal
        left = until - t
        # never leave a sliver: the last step before ``until`` may be up to half a per cent longer
        h = left if left < 1.005 * h else h
        if abs(h - ts.getTimeStep()) > 0:
            ts.setTimeStep(h)
        self._restart = False
        before = ts.getStepRejections()  # a failed solve is a rejection too
        ts.step()
        after = ts.getStepRejections()
        self.rejected += after - before
        reason = ts.getConvergedReason()
        if reason < 0:
            raise SimulationError(
                f"no time step succeeds at t = {t:.6g} s (PETSc TS reason {reason}, step down to "
                f"{ts.getTimeStep():.2g} s): try a smaller time.step or another time.integrator"
            )
        now = ts.getTime()
        if after > before:
            self.newton.forget()
        self._trouble = max(0, self._trouble + after - before - 1)
        if self._trouble > _TROUBLE:
            raise SimulationError(
                f"time stepping breaks down at t = {now:.6g} s (step {now - t:.2g} s, nearly every one refused): "
                "try a smaller time.step or another time.integrator"
            )
        return StepReport(now, now - t, self.stage_time)

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for item in (self.ts, self._matrix, self._f, self.vec):
            item.destroy()


def march(rod: Rod, u0: Array, end: float, time: Time | None = None, observe: Any = None) -> Array:
    """March a rod without rock from its start to ``end``; ``observe(t, u)`` after each step. Returns the last u."""
    stepper = Stepper(rod, u0, None, time)
    try:
        if observe is not None:
            observe(stepper.ts.getTime(), stepper.u)
        while stepper.ts.getTime() < end * (1 - 1e-12):
            report = stepper.step(end)
            if observe is not None:
                observe(report.time, stepper.u)
        return stepper.u.copy()
    finally:
        stepper.destroy()
