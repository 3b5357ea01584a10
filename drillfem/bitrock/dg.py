"""Discontinuous Galerkin advection of the rock surface in the angle of the bit (scheme ``dg``)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drillfem.bitrock.jit import kernel

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
        given = f"degree {degree}, elements {elements}, width {width}"
        raise ValueError(f"surface: {given}: need degree >= 0, elements >= 1, width > 0")
    legendre = np.polynomial.legendre.Legendre
    inner: F8 = np.real(legendre.basis(degree).deriv().roots()) if degree > 1 else np.zeros(0)
    points = np.array([-1.0, *np.sort(inner), 1.0]) if degree else np.zeros(1)
    x, weight = np.polynomial.legendre.leggauss(degree + 1)

    inverse: F8 = np.linalg.inv(np.polynomial.legendre.legvander(points, degree))
    value: F8 = np.polynomial.legendre.legvander(x, degree) @ inverse
    derivatives = [legendre.basis(i).deriv()(x) if i else 0 * x for i in range(degree + 1)]
    slopes: F8 = np.asarray(derivatives, np.float64).T @ inverse
    left, right = (np.polynomial.legendre.legvander([e], degree)[0] @ inverse for e in (-1.0, 1.0))

    size, h = degree + 1, width / elements
    one: F8 = np.eye(elements)
    stiff: F8 = slopes.T @ (weight[:, None] * value)  # int u psi' deta on an element
    return DGOperators(
        mass=np.asarray(np.kron(one, 0.5 * h * value.T @ (weight[:, None] * value)), np.float64),
        forward=np.kron(one, stiff - np.outer(right, right)) + np.kron(np.eye(elements, k=-1), np.outer(left, right)),
        backward=np.kron(one, -stiff - np.outer(left, left)) + np.kron(np.eye(elements, k=1), np.outer(right, left)),
        left=np.concatenate([left, np.zeros(size * (elements - 1))]),
        right=np.concatenate([np.zeros(size * (elements - 1)), right]),
        nodes=((np.arange(elements)[:, None] + 0.5 * (points + 1)) * h).ravel(),
        width=width,
    )


class DGData(NamedTuple):
    """Operators of a sector of unit width for both directions (index 0 forwards, 1 backwards)."""

    column: I8  # (2, k, n): the k-th nonzero of each row, padded with zeros; rows side by side for SIMD
    value: F8  # (2, k, n)
    source: F8  # (2, n): response of dL/dphi to the inflow
    end_column: I8  # (2, e)
    end: F8  # (2, e): height where the rock leaves (row 0: right end) when turning that way
    mean: F8  # (n,): integral of the height over the unit sector
    column_ahead: I8  # (2, n): degrees of freedom in the order in which they reach the outflow
    reach: I8  # (2, 5): how many of them do within 0 ... 4 Runge-Kutta steps
    derivative: F8  # (2, 17, n): derivatives of the outflow height with respect to the turn, in that order
    series: F8  # (5, 17): coefficients of (1 + z + z^2/2 + z^3/6 + z^4/24)^steps
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
    longest = max(1, max(int(np.count_nonzero(a, axis=1).max()) for a in rates))
    column = np.stack([np.argsort(a == 0, axis=1, kind="stable")[:, :longest].T for a in rates])
    value = np.stack([a[np.arange(n), c] for a, c in zip(rates, column, strict=True)])
    power, orders, reach = np.empty((2, 17, n)), [], np.empty((2, 5), np.int64)
    for i in range(2):
        power[i, 0] = end[i]
        for k in range(16):
            power[i, k + 1] = power[i, k] @ rates[i]
        first = np.where(power[i].any(axis=0), np.argmax(power[i] != 0, axis=0), 17)
        orders.append(np.argsort(first, kind="stable"))
        reach[i] = [np.count_nonzero(first <= 4 * steps) for steps in range(5)]
    series = np.zeros((5, 17))
    series[0, 0] = 1.0
    for steps in range(4):
        series[steps + 1] = np.convolve(series[steps], [1, 1, 1 / 2, 1 / 6, 1 / 24])[:17]
    edge = max(int(np.count_nonzero(e)) for e in end)
    end_column = np.argsort(end == 0, axis=1, kind="stable")[:, :edge]
    # closed to a ring the operator is (nearly) normal, so its spectrum gives the stable step of the Runge-Kutta scheme
    ring = np.linalg.eigvals(rates[0] + np.outer(inverse @ op.left, op.right))
    lo, hi = 0.0, 4.0 / max(np.abs(ring).max(), 1.0)
    for _ in range(60):
        z = 0.5 * (lo + hi) * ring
        growth = np.abs(1 + z * (1 + z / 2 * (1 + z / 3 * (1 + z / 4)))).max()
        lo, hi = (0.5 * (lo + hi), hi) if growth <= 1 + 1e-10 else (lo, 0.5 * (lo + hi))
    return DGData(
        column=column.astype(np.int64),
        value=value,
        source=np.stack([inverse @ f for f in inflow]),
        end_column=end_column.astype(np.int64),
        end=np.take_along_axis(end, end_column, axis=1),
        mean=op.mass.sum(axis=0) / op.width,
        column_ahead=np.stack(orders).astype(np.int64),
        reach=reach,
        derivative=np.stack([p[:, o] for p, o in zip(power, orders, strict=True)]),
        series=series,
        limit=0.95 * lo,
        height=np.zeros((sectors, n)),
        scratch=np.zeros((5, sectors, n)),
    )


@kernel()
def _end_height(column: I8, value: F8, height: F8) -> float:
    """Height where the rock leaves the sector."""
    total = 0.0
    for k in range(value.size):
        total += value[k] * height[column[k]]
    return total


@kernel("contract")
def _rate(column: I8, value: F8, source: F8, height: F8, inflow: float, scale: float, out: F8) -> None:
    """d height / d turn of one sector: row-wise sparse product, all rows side by side."""
    n = height.size
    for i in range(n):
        out[i] = source[i] * inflow
    for k in range(column.shape[0]):
        c, a = column[k], value[k]
        for i in range(n):
            out[i] += a[i] * height[c[i]]
    for i in range(n):
        out[i] *= scale


@kernel()
def _cut(u0: float, u1: float, s0: float, s1: float, x: float) -> float:
    """Depth of the bit at the fraction x of a turn; s0, s1 are slopes times the turn."""
    y = 1.0 - x
    return u0 * y * y * (1.0 + 2.0 * x) + u1 * x * x * (3.0 - 2.0 * x) + x * y * (s0 * y - s1 * x)


@kernel("contract")
def _advance(
    dg: DGData,
    width: F8,
    share: F8,
    state: F8,
    scratch: F8,
    turn: float,
    u0: float,
    u1: float,
    s0: float,
    s1: float,
) -> float:
    """Runge-Kutta steps of ``state`` over a turn of either sign.  Returns the rock removed, m rad over all blades."""
    m = width.size
    side = 0 if turn >= 0.0 else 1
    stage, total, rate = scratch[0], scratch[1], scratch[2]
    column, value, source = dg.column[side], dg.value[side], dg.source[side]
    end_column, end = dg.end_column[side], dg.end[side]
    substeps = max(1, int(np.ceil(abs(turn) / (dg.limit * width.min()))))
    step = abs(turn) / substeps
    removed = 0.0
    for sub in range(substeps):
        for part in range(4):
            lead = 0.0 if part == 0 else (1.0 if part == 3 else 0.5)
            weight = step / 6.0 if part == 0 or part == 3 else step / 3.0
            u = _cut(u0, u1, s0, s1, (sub + lead) / substeps)
            at = state if part == 0 else stage
            for b in range(m):
                # forwards blade b meets what leaves the sector ahead of it; backwards the rock just returns
                leaving = _end_height(end_column, end, at[(b + 1) % m if side == 0 else (b - 1) % m])
                entering = max(u, leaving) if side == 0 else leaving
                removed += share[b] * weight * (entering - leaving)
                _rate(column, value, source, at[b], entering, 1.0 / width[b], rate[b])
            lead = 0.5 * step if part < 2 else step
            for b in range(m):
                base, slope, new, next_at = state[b], rate[b], total[b], stage[b]
                if part == 0:
                    for i in range(base.size):
                        new[i] = base[i] + weight * slope[i]
                        next_at[i] = base[i] + lead * slope[i]
                elif part < 3:
                    for i in range(base.size):
                        new[i] += weight * slope[i]
                        next_at[i] = base[i] + lead * slope[i]
                else:
                    for i in range(base.size):
                        base[i] = new[i] + weight * slope[i]
    return removed


@kernel()
def dg_commit(dg: DGData, width: F8, share: F8, turn: float, u0: float, u1: float, s0: float, s1: float) -> float:
    """Turn the bit; returns the rock removed (m rad over all blades)."""
    if turn == 0.0:
        return 0.0
    return _advance(dg, width, share, dg.height, dg.scratch, turn, u0, u1, s0 * turn, s1 * turn)


@kernel("reassoc", "contract", "nsz")
def dg_ahead(dg: DGData, width: F8, turn: float, forward: bool, height: F8, slope: F8) -> None:
    """Height of the rock that each blade meets after ``turn``, and its slope in the turn."""
    m = width.size
    side = 0 if forward else 1
    state, x = dg.height, abs(turn)
    steps = max(1, int(np.ceil(x / (dg.limit * width.min()))))
    if steps > 4 or (steps > 1 and dg.reach[side, steps] == state.shape[1]):
        # what leaves now may depend on what enters: turn a copy (above the rock, so that nothing is cut)
        state = dg.scratch[3]
        state[:] = dg.height
        deep = dg.height.min() - 1.0
        _advance(dg, width, width, state, dg.scratch, turn, deep, deep, 0.0, 0.0)
        steps, x = 1, 0.0
    column, reach, series = dg.column_ahead[side], dg.reach[side, steps], dg.series[steps]
    for b in range(m):
        # backwards the rock that was behind blade b comes under it: the left end of its own sector
        height_of = state[(b + 1) % m if forward else b]
        h = 1.0 / width[(b + 1) % m if forward else b]
        # exactly what the Runge-Kutta steps will let out: a power of their stability polynomial at the end functional
        value = rate = before = 0.0
        term = 1.0  # (h x / steps)^k, and its derivative in x
        for k in range(4 * steps + 1):
            row = dg.derivative[side, k]
            total = 0.0
            for j in range(reach):
                total += row[j] * height_of[column[j]]
            value += series[k] * total * term
            rate += series[k] * total * before
            before = (k + 1) * h / steps * term
            term *= h * x / steps
        height[b] = value
        slope[b] = rate if forward else -rate
