"""Finite elements for the rock surface in the angle of the bit: schemes ``dg``, ``supg`` and ``upwind``.

All of them are one kind of semi-discrete system, ``mass dL/dphi = matrix @ L + vector * inflow``, and share the
Runge-Kutta stepping.  They differ in the operators only: discontinuous Galerkin of degree k, of which first-order
upwinding is k = 0, and continuous linear elements with a streamline test function.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drillfem.bitrock.jit import kernel

F8 = NDArray[np.float64]
I8 = NDArray[np.int64]

#: tau of the streamline test function in element widths.  The error of the growth rate of the self-excitation is
#: proportional to it, and the error behind a step in the rock is least near here (docs/rock-surface.md); without, it
#: rings.
STREAMLINE = 0.15


@dataclass(frozen=True)
class DGOperators:
    """Upwind finite element operators on one sector, dense arrays, n degrees of freedom.

    For the bit turning forwards by phi, and backwards by phi' = -phi,

        mass          dL/dphi  = forward  @ L + left  * inflow      inflow enters at eta = 0
        mass_backward dL/dphi' = backward @ L + right * inflow      inflow enters at eta = width

    ``left @ L`` and ``right @ L`` are also the heights at eta = 0 and eta = width.  ``nodes`` (n,) are the eta of the
    (Lagrange) degrees of freedom.  The sector may have any width: the operators are rescaled to others.
    ``mass_backward``: None if it is ``mass``, which holds unless the test functions look upstream.
    """

    mass: F8
    forward: F8
    backward: F8
    left: F8
    right: F8
    nodes: F8
    width: float
    mass_backward: F8 | None = None

    def rate(self, forward: bool = True) -> tuple[F8, F8]:
        """Matrix A (n, n) and vector b (n,) of dL/dphi = A L + b inflow, per rad of a sector of this width."""
        mass = self.mass if forward or self.mass_backward is None else self.mass_backward
        inverse: F8 = np.asarray(np.linalg.inv(mass), np.float64)
        if forward:
            return inverse @ self.forward, inverse @ self.left
        return inverse @ self.backward, inverse @ self.right


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


def supg_operators(elements: int, width: float, streamline: float = STREAMLINE) -> DGOperators:
    """Continuous linear elements with the test functions psi + tau dpsi/dflow, tau = ``streamline`` h.

    The streamline part multiplies the whole residual, dL/dphi + dL/deta, so that it changes the mass too; the inflow
    is imposed weakly, through the flux of psi.
    """
    if elements < 1 or not width > 0 or streamline < 0:
        given = f"elements {elements}, width {width}, streamline {streamline}"
        raise ValueError(f"surface: {given}: need elements >= 1, width > 0, streamline >= 0")
    n, h = elements + 1, width / elements
    mass, slope, stiff = np.zeros((3, n, n))  # (psi_i, psi_j), (psi_i, psi_j'), (psi_i', psi_j')
    for e in range(elements):
        part = np.ix_((e, e + 1), (e, e + 1))
        mass[part] += h / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
        slope[part] += 0.5 * np.array([[-1.0, 1.0], [-1.0, 1.0]])
        stiff[part] += 1.0 / h * np.array([[1.0, -1.0], [-1.0, 1.0]])
    tau, (left, right) = streamline * h, np.eye(n)[[0, -1]]
    return DGOperators(
        mass=mass + tau * slope.T,
        forward=-slope - tau * stiff - np.outer(left, left),
        backward=slope - tau * stiff - np.outer(right, right),
        left=left,
        right=right,
        nodes=np.asarray(np.linspace(0.0, width, n), np.float64),
        width=width,
        mass_backward=mass - tau * slope.T,
    )


def surface_operators(scheme: str, degree: int, elements: int, width: float) -> DGOperators:
    """Operators of the scheme "dg", "supg" (always degree 1) or "upwind" (always degree 0)."""
    if scheme == "supg":
        return supg_operators(elements, width)
    return dg_operators(0 if scheme == "upwind" else degree, elements, width)


class DGData(NamedTuple):
    """A surface on finite elements: few flat arrays, because the compiled functions hand them on in every step."""

    number: I8  # sizes and offsets, named below
    constant: F8  # longest stable turn, rad; then the coefficients of (1 + z + z^2/2 + z^3/6 + z^4/24)^(1 ... 4)
    table: F8  # (2, rows, n): rows named below, for a sector of unit width; index 0 forwards, 1 backwards
    state: F8  # (rows, m, pad + n + pad): heights, and what is derived from them; zero in the padding
    moment: F8  # (2, m, 1 + TERMS): height of the inflow, and derivatives of that of the outflow, between commits


# DGData.number: degrees of freedom, padding, rows of a table; then for each side the lowest column offset and the
# (even) number of diagonals of the rate; how many derivatives in `moment` are valid, and how many blocks ahead the
# surface is that they are of; and for each side and row of OUT first and count of the nonzeros
N, PAD, ROWS, LOWEST, DIAGONALS, VALID, BLOCKS, FIRST = 0, 1, 2, 3, 5, 7, 9, 11
# DGData.table: response to the inflow, outflow functional and its derivatives in the turn, diagonals of the rate
TERMS = 17
SOURCE, OUT, BAND = 0, 1, 1 + TERMS
# DGData.state: the surface; stage, sum and rate of a step; for each side the surface some blocks of steps ahead
NOW, STAGE, TOTAL, RATE, COPY, STATES = 0, 1, 2, 3, 4, 6


def surface_order(op: DGOperators) -> I8:
    """Degrees of freedom in the order of their angle, in which the operators have a narrow band."""
    return np.argsort(np.round(op.nodes / op.width, 9), kind="stable")


def dg_setup(op: DGOperators, width: F8) -> DGData:
    """Compress operators for the compiled stepping over sectors of ``width`` (m,), and find the stable step."""
    n, order = op.nodes.size, surface_order(op)
    rates = [op.width * a[np.ix_(order, order)] for a in (op.rate(True)[0], op.rate(False)[0])]
    sources = [op.width * b[order] for b in (op.rate(True)[1], op.rate(False)[1])]
    ends = [op.right[order], op.left[order]]
    # closed to a ring the operator is (nearly) normal, so its spectrum gives the stable step of the Runge-Kutta scheme
    ring = np.linalg.eigvals(rates[0] + np.outer(sources[0], ends[0]))
    lo, hi = 0.0, 4.0 / max(np.abs(ring).max(), 1.0)
    for _ in range(60):
        z = 0.5 * (lo + hi) * ring
        growth = np.abs(1 + z * (1 + z / 2 * (1 + z / 3 * (1 + z / 4)))).max()
        lo, hi = (0.5 * (lo + hi), hi) if growth <= 1 + 1e-10 else (lo, 0.5 * (lo + hi))

    number, bands = np.zeros(FIRST + 4 * TERMS, np.int64), []
    for side, rate in enumerate(rates):
        rate[np.abs(rate) < 1e-16 * np.abs(rate).max()] = 0.0
        offset = np.subtract(*np.nonzero(rate)[::-1])
        number[LOWEST + side], number[DIAGONALS + side] = offset.min(), 2 * (np.ptp(offset) // 2 + 1)
        band = np.zeros((number[DIAGONALS + side], n))
        for k, shift in enumerate(range(offset.min(), offset.max() + 1)):
            band[k, max(0, -shift) : n - max(0, shift)] = np.diagonal(rate, shift)
        bands.append(band)
    rows = BAND + max(len(band) for band in bands)
    table = np.zeros((2, rows, n))
    for side, (rate, band) in enumerate(zip(rates, bands, strict=True)):
        table[side, SOURCE], table[side, OUT], table[side, BAND : BAND + len(band)] = sources[side], ends[side], band
        for k in range(TERMS):
            some = np.flatnonzero(table[side, OUT + k])
            number[FIRST + 2 * (side * TERMS + k) :][:2] = some[0], np.ptp(some) + 1
            if k + 1 < TERMS:
                table[side, OUT + k + 1] = table[side, OUT + k] @ rate
    pad = max(int(max(-number[LOWEST + i], number[LOWEST + i] + number[DIAGONALS + i] - 1)) for i in range(2))
    number[N], number[PAD], number[ROWS] = n, pad, rows
    series: list[F8] = [np.ones(1)]
    for _ in range(4):
        series.append(np.asarray(np.convolve(series[-1], [1, 1, 1 / 2, 1 / 6, 1 / 24]), np.float64))
    return DGData(
        number=number,
        constant=np.concatenate(
            [[0.95 * lo * width.min()], *(np.resize([*s, *np.zeros(17)], TERMS) for s in series[1:])]
        ),
        table=table.ravel(),
        state=np.zeros(STATES * width.size * (n + 2 * pad)),
        moment=np.zeros(2 * width.size * (1 + TERMS)),
    )


@kernel(lean=True)
def _cut(u0: float, u1: float, s0: float, s1: float, x: float) -> float:
    """Depth of the bit at the fraction x of a turn; s0, s1 are slopes times the turn."""
    y = 1.0 - x
    return u0 * y * y * (1.0 + 2.0 * x) + u1 * x * x * (3.0 - 2.0 * x) + x * y * (s0 * y - s1 * x)


@kernel(lean=True)
def _end_height(number: I8, table: F8, state: F8, side: int, at: int) -> float:
    """Height at the outflow end of a turn to ``side``, of the surface that starts at ``at``."""
    first, total = number[FIRST + 2 * side * TERMS], 0.0
    row = (side * number[ROWS] + OUT) * number[N]
    for j in range(first, first + number[FIRST + 2 * side * TERMS + 1]):
        total += table[np.uintp(row + j)] * state[np.uintp(at + number[PAD] + j)]
    return total


@kernel("contract", lean=True)
def _rate(number: I8, table: F8, state: F8, side: int, at: int, entering: float, out: int) -> None:
    """d height / d turn, on a sector of unit width, of the surface at ``at`` into ``out``: diagonal by diagonal.

    Indices are unsigned, which spares the test for negative ones and lets the loops run in parallel lanes.
    """
    n, pad = number[N], number[PAD]
    row, column, to = side * number[ROWS] * n, at + pad + number[LOWEST + side], out + pad
    source, band = row + SOURCE * n, row + BAND * n
    for i in range(n):
        state[np.uintp(to + i)] = table[np.uintp(source + i)] * entering
    for _ in range(number[DIAGONALS + side] // 2):  # two at a time, to load and store less
        for i in range(n):
            state[np.uintp(to + i)] += table[np.uintp(band + i)] * state[np.uintp(column + i)] + (
                table[np.uintp(band + n + i)] * state[np.uintp(column + 1 + i)]
            )
        band, column = band + 2 * n, column + 2


@kernel("contract", lean=True)
def _advance(
    dg: DGData,
    width: F8,
    share: F8,
    copy: int,
    turn: float,
    blocks: int,
    tail: int,
    rest: float,
    u0: float,
    u1: float,
    s0: float,
    s1: float,
) -> float:
    """Turn the surface in row ``copy`` by ``blocks`` of 4 longest Runge-Kutta steps and ``tail`` ones over ``rest``.

    The depth of the bit belongs to the whole turn (s0, s1: slopes times ``turn``).  Returns the rock removed, m rad
    over all blades.
    """
    number, table, state = dg.number, dg.table, dg.state
    m, n, pad = width.size, number[N], number[PAD]
    stride, side = n + 2 * pad, 0 if turn >= 0.0 else 1
    ahead = 1 if side == 0 else m - 1
    # forwards blade b meets what leaves the sector ahead of it; backwards the rock just returns
    removed = done = 0.0
    whole = abs(turn)
    for sub in range(4 * blocks + tail):
        step = dg.constant[0] if sub < 4 * blocks else rest / tail
        for part in range(4):
            lead = 0.0 if part == 0 else (step if part == 3 else 0.5 * step)
            weight = step / 6.0 if part == 0 or part == 3 else step / 3.0
            u = _cut(u0, u1, s0, s1, (done + lead) / whole)
            row = copy if part == 0 else STAGE
            for b in range(m):
                leaving = _end_height(number, table, state, side, (row * m + (b + ahead) % m) * stride)
                entering = max(u, leaving) if side == 0 else leaving
                removed += share[b] * weight * (entering - leaving)
                _rate(number, table, state, side, (row * m + b) * stride, entering, (RATE * m + b) * stride)
            lead = 0.5 * step if part < 2 else step
            for b in range(m):
                base, stage = (copy * m + b) * stride + pad, (STAGE * m + b) * stride + pad
                total, rate = (TOTAL * m + b) * stride + pad, (RATE * m + b) * stride + pad
                w, x = weight / width[b], lead / width[b]
                if part == 3:
                    for i in range(n):
                        state[np.uintp(base + i)] = state[np.uintp(total + i)] + w * state[np.uintp(rate + i)]
                    continue
                old = base if part == 0 else total
                for i in range(n):
                    slope = state[np.uintp(rate + i)]
                    state[np.uintp(total + i)] = state[np.uintp(old + i)] + w * slope
                    state[np.uintp(stage + i)] = state[np.uintp(base + i)] + x * slope
        done += step
    return removed


@kernel(lean=True)
def _partition(longest: float, turn: float) -> tuple[int, int, float]:
    """Divide a turn (rad, >= 0) into blocks of 4 longest steps, and a number of equal steps over the rest."""
    blocks = int(turn / (4.0 * longest))
    rest = max(turn - 4.0 * longest * blocks, 0.0)
    tail = min(int(np.ceil(rest / longest)), 4)
    return blocks, tail, rest


@kernel(lean=True)
def dg_commit(dg: DGData, width: F8, share: F8, turn: float, u0: float, u1: float, s0: float, s1: float) -> float:
    """Turn the bit; returns the rock removed (m rad over all blades)."""
    if turn == 0.0:
        return 0.0
    dg.number[VALID] = dg.number[VALID + 1] = 0
    blocks, tail, rest = _partition(dg.constant[0], abs(turn))
    return _advance(dg, width, share, NOW, turn, blocks, tail, rest, u0, u1, s0 * turn, s1 * turn)


@kernel("reassoc", "contract", "nsz", lean=True)
def _derivatives(dg: DGData, width: F8, side: int, blocks: int, first: int, last: int) -> None:
    """Fill ``moment`` with derivatives ``first`` to ``last`` of the outflow height, of the surface ``blocks`` ahead."""
    number, table, state, moment = dg.number, dg.table, dg.state, dg.moment
    m, n, pad = width.size, number[N], number[PAD]
    stride, row = n + 2 * pad, NOW if blocks == 0 else COPY + side
    for b in range(m):
        at, to = (row * m + b) * stride, (side * m + b) * (1 + TERMS)
        # what leaves may depend a little on what enters: on what enters now, and constant heights stay constant
        level = _end_height(number, table, state, 1 - side, at)
        moment[to] = level
        for k in range(first, last + 1):
            start = number[FIRST + 2 * (side * TERMS + k)]
            d, h = (side * number[ROWS] + OUT + k) * n + start, at + pad + start
            total = 0.0
            for j in range(number[FIRST + 2 * (side * TERMS + k) + 1]):
                total += table[np.uintp(d + j)] * (state[np.uintp(h + j)] - level)
            moment[to + 1 + k] = total


@kernel(lean=True)
def dg_ahead(dg: DGData, width: F8, turn: float, forward: bool, height: F8, slope: F8) -> None:
    """Height of the rock that each blade meets after ``turn``, and its slope in the turn."""
    number, constant, moment = dg.number, dg.constant, dg.moment
    m, side = width.size, 0 if forward else 1
    blocks, tail, rest = _partition(constant[0], abs(turn))
    if number[VALID + side] == 0 or number[BLOCKS + side] != blocks:
        if blocks > 0:
            size = m * (number[N] + 2 * number[PAD])
            for i in range(size):
                dg.state[(COPY + side) * size + i] = dg.state[i]
            level = -1e30  # what enters on the way: as above in `_derivatives`, or the rock itself
            for b in range(m):
                level = max(level, _end_height(number, dg.table, dg.state, 1 - side, b * (number[N] + 2 * number[PAD])))
            way = 4.0 * constant[0] * blocks if forward else -4.0 * constant[0] * blocks
            _advance(dg, width, width, COPY + side, way, blocks, 0, 0.0, level, level, 0.0, 0.0)
        number[VALID + side], number[BLOCKS + side] = 0, blocks
    steps = max(tail, 1)
    if number[VALID + side] < 4 * steps + 1:
        _derivatives(dg, width, side, blocks, number[VALID + side], 4 * steps)
        number[VALID + side] = 4 * steps + 1
    series = 1 + (steps - 1) * TERMS
    for b in range(m):
        # backwards the rock that was behind blade b comes under it: the left end of its own sector
        sector = (b + 1) % m if forward else b
        row = (side * m + sector) * (1 + TERMS)
        h = 1.0 / width[sector]
        # exactly what the Runge-Kutta steps will let out: a power of their stability polynomial at the end functional
        z = h * rest / steps
        value = rate = 0.0
        for k in range(4 * steps, 0, -1):
            value = (value + constant[series + k] * moment[row + 1 + k]) * z
            rate = rate * z + k * constant[series + k] * moment[row + 1 + k]
        height[b] = value + moment[row + 1] + moment[row]
        rate *= h / steps
        slope[b] = rate if forward else -rate
