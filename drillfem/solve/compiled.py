"""The compiled engine: steps of a rod by loops in C, with the algorithms of the PETSc engine.

Forms, kernels, Newton's method and bookkeeping are those of the PETSc engine; what differs is who assembles and
factorises (:mod:`drillfem.solve.native`) and who steps. Both engines take the same steps up to round-off.
"""

from __future__ import annotations

from functools import cached_property, partial

import numpy as np

from ..compat import Array
from ..models.rod import Rod
from ..scene import Time
from .dynamics import Marcher, integrator_of
from .native import NativeNewton, NativeScalar, NativeSolver, NativeStage, NativeVector
from .newton import BitCoupledNewton, BitLoad, Outcome

#: as PETSc: what is left of a step whose equations find no solution, and how often
_SHORTER, _MOST_REFUSED = 0.25, 10


class CompiledSystem:
    """One stage of a step, F(t, u, u-dot) = 0 with u and u-dot linear in the unknowns x.

    u = x0 + a (x - x0) and u-dot = b (x - x0) + rate; Newton's method sees F/a, less ``known``.
    """

    def __init__(self, rod: Rod) -> None:
        self.rod = rod
        self.stage_fraction = 1.0
        size = rod.size
        self.x, self.x0, self.rate, self.known = (np.zeros(size) for _ in range(4))
        self.f, self.trusted = np.zeros(size), np.zeros(size)
        self._time, self._b = 0.0, 1.0
        self._has_rate = self._has_known = False
        if "solver" not in rod.kept:
            rod.kept["solver"] = NativeSolver(rod.tangent, rod)
        self._solver: NativeSolver = rod.kept["solver"]
        self._u, self._u_dot = rod.u.x.array, rod.u_dot.x.array
        contact = rod.scene.contact
        plain = contact is None or (contact.method != "augmented" and contact.closest_point == "newton")
        #: whether C can do all iterations of a solve at once
        self.plain = plain and not (rod.has_bit or rod.bends or rod.drive)
        self._stage = NativeStage(self.x, self.x0, self.rate, self._u, self._u_dot)

    def set(self, t: float, a: float, b: float, rate: bool, known: bool) -> None:
        """State the equations of a stage at time t (s); b in 1/s. ``rate``, ``known``: whether these take part."""
        self._time, self.stage_fraction, self._b = t, a, b
        self._has_rate, self._has_known = rate, known

    def residual(self) -> Array:
        """See :class:`drillfem.solve.newton.System`."""
        rod, f = self.rod, self.f
        self._stage(self.stage_fraction, self._b, self._has_rate)
        rod.residual(self._time, self._u, self._u_dot, f)
        if self.stage_fraction != 1.0:
            f *= 1 / self.stage_fraction
        if self._has_known:
            f -= self.known
        return f

    def iterate(self, newton: BitCoupledNewton) -> Outcome | None:
        """See :class:`drillfem.solve.newton.System`."""
        if not self.plain:
            return None
        self.rod.at(self._time)
        return self._newton(newton, self.stage_fraction, self._b, self._has_rate, self._has_known)

    @cached_property
    def _newton(self) -> NativeNewton:
        return NativeNewton(self, self._solver, self.rod)

    def settle(self) -> None:
        """See :class:`drillfem.solve.newton.System`."""
        self._stage(self.stage_fraction, self._b, self._has_rate)
        self.rod.observe(self._u, self._u_dot)

    def shift(self) -> float:
        """See :class:`drillfem.solve.newton.System`."""
        return self._b / self.stage_fraction

    def factorise(self) -> None:
        """See :class:`drillfem.solve.newton.System`."""
        self.rod.shift.value = self.shift()
        self._solver.factorise()

    def solve(self, b: Array) -> Array:
        """See :class:`drillfem.solve.newton.System`."""
        return self._solver.solve(b)


class CompiledStepper(Marcher):
    """Marches a rod as :class:`drillfem.solve.dynamics.Stepper` does, by theta or generalised-alpha."""

    def __init__(self, rod: Rod, u: Array, bit: BitLoad | None = None, time: Time | None = None) -> None:
        super().__init__(rod, u, bit, time)
        self.system = CompiledSystem(rod)
        self._u = u.copy()
        self._now, self._length = self.time.start, self.time.step
        kind, parameter = integrator_of(self.time, rod.has_bit)
        if kind == "theta":
            self._try = partial(self._theta, parameter)
        elif kind == "generalized-alpha":
            self._rate = np.zeros(rod.size)  # u-dot at the last step
            self._try = partial(self._alpha, parameter)
        else:
            raise ValueError(f"time.integrator = {kind!r} is not one of the compiled engine")

    @classmethod
    def adopt(cls, rod: Rod) -> None:
        """Let the rod assemble by loops in C."""
        rod.vector_form, rod.scalar_form = partial(NativeVector, rod=rod), partial(NativeScalar, rod=rod)

    @property
    def u(self) -> Array:
        """Present unknowns, shape (dofs,) (a view)."""
        return self._u

    @property
    def now(self) -> float:
        """Present time (s)."""
        return self._now

    @property
    def length(self) -> float:
        """Length of the last step (s)."""
        return self._length

    def set_state(self, now: float, u: Array, length: float) -> None:
        """Go on from another state."""
        self._now, self._length = now, length
        self._u[:] = u

    def _advance(self, h: float) -> tuple[int, str]:
        fresh = self._fresh
        for refused in range(_MOST_REFUSED + 1):
            self._length = h
            if self._try(h, fresh):
                self._u[:] = self.system.x
                self._now += h
                return refused, ""
            h *= _SHORTER
        return _MOST_REFUSED + 1, "Newton's method finds no solution"

    def _solve(self, t: float, x0: Array, a: float, b: float, rate: bool = False, known: bool = False) -> bool:
        """Solve the equations of a stage from x0; ``system.x`` is the solution."""
        system = self.system
        self.stage_time = t
        system.set(t, a, b, rate, known)
        if system.x0 is not x0:
            system.x0[:] = x0
        system.x[:] = x0
        return self.newton.solve(system, system.x) is Outcome.CONVERGED

    def _theta(self, theta: float, h: float, fresh: bool) -> bool:
        """F(t + h, u, (u - u0)/(theta h)) + (1 - theta)/theta F(t, u0, 0) = 0; the mass matrix is constant."""
        system, u0 = self.system, self._u
        if theta != 1.0:
            system.x[:], system.x0[:] = u0, u0
            system.set(self._now, 1.0, 0.0, False, False)
            np.multiply(system.residual(), (theta - 1) / theta, out=system.known)
        return self._solve(self._now + h, u0, 1.0, 1 / (theta * h), known=theta != 1.0)

    def _alpha(self, rho: float, h: float, fresh: bool) -> bool:
        """Generalised-alpha for systems of first order (Jansen, Whiting and Hulbert 2000), with radius rho."""
        am, af = (3 - rho) / (2 * (1 + rho)), 1 / (1 + rho)
        gamma = 0.5 + am - af
        system, u0, rate0 = self.system, self._u, self._rate
        if fresh and not self._start_rate(h):
            return False
        np.multiply(rate0, 1 - am / gamma, out=system.rate)
        if not self._solve(self._now + af * h, u0, af, am / (gamma * h), rate=True):
            return False
        rate0 *= 1 - 1 / gamma
        rate0 += (system.x - u0) / (gamma * h)
        return True

    def _start_rate(self, h: float) -> bool:
        """u-dot at the start, from two steps of half the length by backward Euler (as PETSc's TSALPHA)."""
        t, half = self._now, h / 2
        if not self._solve(t + half, self._u, 1.0, 1 / half):
            return False
        middle = self.system.x.copy()
        if not self._solve(t + h, middle, 1.0, 1 / half):
            return False
        self._rate[:] = (4 * middle - 3 * self._u - self.system.x) / h
        return True
