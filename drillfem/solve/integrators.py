"""Time integrators as recurrences of one number: what they do to a wave, and to a mass that meets a wall."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..scene import Scene

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

#: Where in a step the wall is met: so many places are tried.
_PHASES = 64


@dataclass(frozen=True)
class Method:
    """A time integrator and its parameter; ``kind``: bdf, theta, generalized-alpha (PETSc's), central differences."""

    kind: str
    order: int = 2
    theta: float = 0.5
    rho_infinity: float = 0.9

    def __str__(self) -> str:
        number = {"bdf": f"order = {self.order}", "theta": f"theta = {self.theta:g}"}
        return f"{self.kind!r} with {number.get(self.kind, f'rho_infinity = {self.rho_infinity:g}')}"

    @property
    def alphas(self) -> tuple[float, float, float]:
        """alpha_m = (3 - rho)/(2 + 2 rho), alpha_f = 1/(1 + rho), gamma = 1/2 + alpha_m - alpha_f (Jansen et al. 2000)
        of generalised-alpha for equations of first order."""
        rho = self.rho_infinity
        m, f = (3 - rho) / (2 + 2 * rho), 1 / (1 + rho)
        return m, f, 0.5 + m - f

    def amplification(self, exponent: Complex | complex) -> Array:
        """Growth per step, |largest root|, of u' = lambda u at ``exponent`` z = lambda h (any shape), after start-up.

        Central differences take undamped waves only: u_1 - 2 u_0 + u_-1 = z^2 u_0.

        BDF(k): sum_j (1/j) backward-difference^j = z (Hairer & Wanner, III.1).
        """
        z: Complex = np.asarray(exponent, np.complex128)
        if self.kind == "theta":
            return np.asarray(np.abs((1 + (1 - self.theta) * z) / (1 - self.theta * z)))
        if self.kind == "central differences":
            half = 1 + z**2 / 2
            return np.asarray(np.maximum(*(np.abs(half + s * np.sqrt(half**2 - 1)) for s in (1, -1))))
        if self.kind == "bdf":
            k = self.order
            c = [sum((-1) ** i * math.comb(j, i) / j for j in range(max(1, i), k + 1)) for i in range(k + 1)]
            step = np.zeros((*z.shape, k, k), dtype=np.complex128)
            step[..., 0, :] = -np.array(c[1:]) / (c[0] - z)[..., None]
            step[..., range(1, k), range(k - 1)] = 1.0
        else:
            m, f, g = self.alphas
            new, old = (np.zeros((*z.shape, 2, 2), dtype=np.complex128) for _ in range(2))
            new[..., 0, :] = 1.0, -g
            new[..., 1, 0], new[..., 1, 1] = -f * z, m
            old[..., 0, :] = 1.0, 1 - g
            old[..., 1, 0], old[..., 1, 1] = (1 - f) * z, m - 1
            step = np.asarray(np.linalg.solve(new, old), np.complex128)
        return np.asarray(np.abs(np.linalg.eigvals(step)).max(axis=-1))

    def bounce(self, turn: float) -> Array:
        """Energy of a mass after it has met a wall over that before (phases,): 1 in truth.

        The wall is a spring that pushes only, as penalty contact is, with sqrt(k/m) h = ``turn`` (rad per step); the
        phases are where in a step it is met. For theta and generalised-alpha (raises ValueError for others).
        """
        x: Array = np.asarray(-(np.arange(_PHASES) + 0.5) / _PHASES)  # steps and speed of 1
        v: Array = np.ones(_PHASES)
        x_rate: Array = np.ones(_PHASES)
        v_rate: Array = np.zeros(_PHASES)
        stiff, theta = turn**2, self.theta
        if self.kind not in ("theta", "generalized-alpha"):
            raise ValueError(f"bounce of {self.kind!r}")
        m, f, g = self.alphas
        # half a period in touch, and as long as generalised-alpha remembers the wall
        for _ in range(math.ceil(2 * math.pi / turn) + 120):
            if self.kind == "theta":
                free = v - (1 - theta) * stiff * np.maximum(x, 0.0)
                x = x + (1 - theta) * v + theta * free
                x = np.asarray(np.where(x > 0, x / (1 + theta**2 * stiff), x), np.float64)
                v = free - theta * stiff * np.maximum(x, 0.0)
                continue
            # as if there were no wall, and what a wall at the place of the stage then takes off
            rate = -(1 - m) / m * v_rate
            drift = (v + f * (g * rate + (1 - g) * v_rate) - (1 - m) * x_rate) / m
            stage = x + f * (g * drift + (1 - g) * x_rate)
            push = stiff * np.maximum(stage, 0.0) / (m + stiff * (f * g) ** 2 / m)
            rate, drift = rate - push, drift - f * g / m * push
            x, x_rate = x + g * drift + (1 - g) * x_rate, drift
            v, v_rate = v + g * rate + (1 - g) * v_rate, rate
        return np.asarray(v**2)


def method_of(scene: Scene) -> Method | None:
    """The integrator that a dynamic scene runs with, if its waves are known to suffer from it; else None.

    The exact propagation of the condensed engines does not touch waves, and ARKIMEX loses 1e-6 of them.
    """
    time = scene.time
    if time.analysis != "dynamic" or scene.engine not in ("petsc", "compiled") or time.adaptive:
        return None
    kind = time.integrator
    if kind == "default":
        if scene.bites:
            return Method("theta", theta=0.5)
        return Method("generalized-alpha", rho_infinity=time.rho_infinity)
    return Method(kind, time.order, time.theta, time.rho_infinity) if kind != "arkimex" else None
