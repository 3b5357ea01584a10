"""Discontinuous Galerkin advection of the rock surface in the angle of the bit (scheme ``dg``)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

F8 = NDArray[np.float64]
I8 = NDArray[np.int64]


@dataclass(frozen=True)
class DGOperators:
    """Upwind DG operators on one sector, dense arrays, n degrees of freedom.

    For the bit turning forwards by phi, and backwards by phi' = -phi,

        mass dL/dphi  = forward  @ L + left  * inflow      inflow enters at eta = 0
        mass dL/dphi' = backward @ L + right * inflow      inflow enters at eta = width

    ``left @ L`` and ``right @ L`` are also the heights at eta = 0 and eta = width.  ``nodes`` (n,) are the eta of the
    (Lagrange) degrees of freedom.  The sector may have any width: the operators are rescaled to others.
    """

    mass: F8
    forward: F8
    backward: F8
    left: F8
    right: F8
    nodes: F8
    width: float


def dg_operators(degree: int, elements: int, width: float) -> DGOperators:
    """DG operators by numpy: Lagrange polynomials on Gauss-Lobatto points (midpoint for degree 0), equal elements."""
    if degree < 0 or elements < 1 or not width > 0:
        raise ValueError(f"surface: degree {degree}, elements {elements}, width {width}: need degree >= 0, elements >= 1, width > 0")
    legendre = np.polynomial.legendre.Legendre
    inner = np.real(legendre.basis(degree).deriv().roots()) if degree > 1 else np.array([])
    points = np.concatenate([[-1.0], np.sort(inner), [1.0]]) if degree else np.array([0.0])
    x, weight = np.polynomial.legendre.leggauss(degree + 1)

    inverse = np.linalg.inv(np.polynomial.legendre.legvander(points, degree))
    value = np.polynomial.legendre.legvander(x, degree) @ inverse
    slopes = np.stack([legendre.basis(i).deriv()(x) if i else 0 * x for i in range(degree + 1)], axis=1) @ inverse
    left, right = (np.polynomial.legendre.legvander([e], degree)[0] @ inverse for e in (-1.0, 1.0))

    size, h = degree + 1, width / elements
    one = np.eye(elements)
    stiff = slopes.T @ (weight[:, None] * value)  # int u psi' deta on an element
    return DGOperators(
        mass=np.kron(one, 0.5 * h * value.T @ (weight[:, None] * value)),
        forward=np.kron(one, stiff - np.outer(right, right)) + np.kron(np.eye(elements, k=-1), np.outer(left, right)),
        backward=np.kron(one, -stiff - np.outer(left, left)) + np.kron(np.eye(elements, k=1), np.outer(right, left)),
        left=np.concatenate([left, np.zeros(size * (elements - 1))]),
        right=np.concatenate([np.zeros(size * (elements - 1)), right]),
        nodes=((np.arange(elements)[:, None] + 0.5 * (points + 1)) * h).ravel(),
        width=width,
    )


class DGData(NamedTuple):
    """Operators of a sector of unit width for both directions (index 0 forwards, 1 backwards), rows compressed."""

    start: I8  # (2, n + 1)
    column: I8  # (2, nonzeros)
    value: F8  # (2, nonzeros)
    source: F8  # (2, n): response of dL/dphi to the inflow
    end: F8  # (2, n): height where the rock leaves (row 0: right end) when turning that way
    mean: F8  # (n,): integral of the height over the unit sector
    taylor_column: I8  # (2, k): degrees of freedom that reach the outflow within one Runge-Kutta step
    taylor: F8  # (2, 5, k): derivatives of the outflow height with respect to the turn
    limit: float  # longest stable turn, in sectors
    height: F8  # (m, n): the state
    scratch: F8  # (5, m, n)


def dg_setup(op: DGOperators, sectors: int) -> DGData:
    """Compress operators for the compiled stepping, and find the stable step."""
    n = op.nodes.size
    inverse = np.linalg.inv(op.mass / op.width)
    scale = np.abs(inverse).max() * np.abs(op.forward).max()
    rates = [inverse @ op.forward, inverse @ op.backward]
    rates = [np.where(np.abs(a) < 1e-13 * scale, 0.0, a) for a in rates]
    inflow, end = np.stack([op.left, op.right]), np.stack([op.right, op.left])
    starts, columns, values, powers = [], [], [], []
    for a, e in zip(rates, end, strict=True):
        rows, cols = np.nonzero(a)
        starts.append(np.searchsorted(rows, np.arange(n + 1)))
        columns.append(cols)
        values.append(a[rows, cols])
        powers.append(np.stack([e @ np.linalg.matrix_power(a, k) for k in range(5)]))
    longest = max(len(c) for c in columns)
    used = [np.nonzero(np.any(p != 0, axis=0))[0] for p in powers]
    widest = max(len(u) for u in used)
    for i in range(2):
        columns[i] = np.pad(columns[i], (0, longest - len(columns[i])))
        values[i] = np.pad(values[i], (0, longest - len(values[i])))
        spare = np.setdiff1d(np.arange(n), used[i])[: widest - len(used[i])]
        used[i] = np.concatenate([used[i], spare])
    # closed to a ring the operator is (nearly) normal, so its spectrum gives the stable step of the Runge-Kutta scheme
    ring = np.linalg.eigvals(rates[0] + np.outer(inverse @ op.left, op.right))
    lo, hi = 0.0, 4.0 / max(np.abs(ring).max(), 1.0)
    for _ in range(60):
        z = 0.5 * (lo + hi) * ring
        growth = np.abs(1 + z * (1 + z / 2 * (1 + z / 3 * (1 + z / 4)))).max()
        lo, hi = (0.5 * (lo + hi), hi) if growth <= 1 + 1e-10 else (lo, 0.5 * (lo + hi))
    return DGData(
        start=np.stack(starts).astype(np.int64),
        column=np.stack(columns).astype(np.int64),
        value=np.stack(values),
        source=np.stack([inverse @ f for f in inflow]),
        end=end,
        mean=np.ones(n) @ op.mass / op.width,
        taylor_column=np.stack(used).astype(np.int64),
        taylor=np.stack([p[:, u] for p, u in zip(powers, used, strict=True)]),
        limit=0.95 * lo,
        height=np.zeros((sectors, n)),
        scratch=np.zeros((5, sectors, n)),
    )


@njit(cache=True)
def _end_height(dg: DGData, side: int, height: F8) -> float:
    """Height where the rock leaves the sector (Taylor term 0 covers every nonzero of the end functional)."""
    total = 0.0
    for k in range(dg.taylor_column.shape[1]):
        total += dg.taylor[side, 0, k] * height[dg.taylor_column[side, k]]
    return total


@njit(cache=True)
def _rate(dg: DGData, side: int, height: F8, inflow: float, scale: float, out: F8) -> None:
    for i in range(height.size):
        total = dg.source[side, i] * inflow
        for k in range(dg.start[side, i], dg.start[side, i + 1]):
            total += dg.value[side, k] * height[dg.column[side, k]]
        out[i] = scale * total


@njit(cache=True)
def _cut(u0: float, u1: float, s0: float, s1: float, x: float) -> float:
    """Depth of the bit at the fraction x of a turn; s0, s1 are slopes times the turn."""
    y = 1.0 - x
    return u0 * y * y * (1.0 + 2.0 * x) + u1 * x * x * (3.0 - 2.0 * x) + x * y * (s0 * y - s1 * x)


@njit(cache=True)
def _inflow(
    dg: DGData, side: int, heights: F8, blade: int, u: float
) -> tuple[float, float]:
    """What enters sector ``blade`` now, and what leaves the sector that the blade works on."""
    m = heights.shape[0]
    if side == 0:
        out = _end_height(dg, 0, heights[(blade + 1) % m])
        return max(u, out), out
    out = _end_height(dg, 1, heights[(blade - 1) % m])
    return out, out


@njit(cache=True)
def _advance(
    dg: DGData, width: F8, share: F8, state: F8, stage: F8, total: F8, rate: F8, turn: float, u0: float, u1: float, s0: float, s1: float
) -> float:
    """Runge-Kutta steps of ``state`` over a turn of either sign.  Returns the rock removed, m rad over all blades."""
    m = width.size
    side = 0 if turn >= 0.0 else 1
    substeps = max(1, int(np.ceil(abs(turn) / (dg.limit * width.min()))))
    step = abs(turn) / substeps
    removed = 0.0
    for sub in range(substeps):
        for part in range(4):
            lead = 0.0 if part == 0 else (1.0 if part == 3 else 0.5)
            weight = step / 6.0 if part == 0 or part == 3 else step / 3.0
            u = _cut(u0, u1, s0, s1, (sub + lead) / substeps)
            source = state if part == 0 else stage
            for b in range(m):
                entering, leaving = _inflow(dg, side, source, b, u)
                removed += share[b] * weight * (entering - leaving)
                _rate(dg, side, source[b], entering, 1.0 / width[b], rate[b])
            ahead = 0.5 * step if part < 2 else step
            for b in range(m):
                for i in range(state.shape[1]):
                    total[b, i] = (state[b, i] if part == 0 else total[b, i]) + weight * rate[b, i]
                    stage[b, i] = state[b, i] + ahead * rate[b, i]
        state[:] = total
    return removed


@njit(cache=True)
def dg_commit(dg: DGData, width: F8, share: F8, turn: float, u0: float, u1: float, s0: float, s1: float) -> float:
    """Turn the bit; returns the rock removed (m rad over all blades)."""
    if turn == 0.0:
        return 0.0
    w = dg.scratch
    return _advance(dg, width, share, dg.height, w[0], w[1], w[2], turn, u0, u1, s0 * turn, s1 * turn)


@njit(cache=True)
def dg_ahead(dg: DGData, width: F8, turn: float, forward: bool, height: F8, slope: F8) -> None:
    """Height of the rock that each blade meets after ``turn``, and its slope in the turn."""
    m = width.size
    side = 0 if forward else 1
    state = dg.height
    x = abs(turn)
    if x > dg.limit * width.min():
        # beyond one Runge-Kutta step: turn a copy (what enters does not come out within a sector)
        state = dg.scratch[3]
        state[:] = dg.height
        w = dg.scratch
        deep = dg.height.min() - 1.0
        _advance(dg, width, width, state, w[0], w[1], w[2], turn, deep, deep, 0.0, 0.0)
        x = 0.0
    for b in range(m):
        source = (b + 1) % m if forward else b
        # backwards the rock that was behind blade b comes under it: the left end of its own sector
        value = rate = 0.0
        h = 1.0 / width[source]
        term, before = 1.0, 0.0  # (h x)^k / k! and its derivative in x
        for k in range(5):
            derivative = 0.0
            for j in range(dg.taylor_column.shape[1]):
                derivative += dg.taylor[side, k, j] * state[source, dg.taylor_column[side, j]]
            value += derivative * term
            rate += derivative * before
            before = term * h
            term *= x * h / (k + 1.0)
        height[b] = value
        slope[b] = rate if forward else -rate
