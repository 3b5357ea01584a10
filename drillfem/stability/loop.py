"""Steady drilling perturbed: the loop between the string and the rock it cuts, its characteristic roots, their count.

The bit answers changes of the cutting forces by u = -G_a dW and phi = -G_t dT.  Behind a blade the rock keeps what the
blade ahead has left, so that the total depth of cut changes by ``E (u - rho phi)``, with E the sum over the blades of
``1 - exp(-s w/Omega_0)``, w the angle to the blade ahead, and rho = V_0/Omega_0 = d_0/(2 pi): a bit that has turned
too far meets the past too early.  With dW = eps a zeta d, dT = eps a^2/2 d, and the wear flats saturated (they carry a
constant load), a motion exp(s t) lives on where

    1 + E(s) (eps a zeta G_a(s) - rho eps a^2/2 G_t(s)) = 0,

which for the lumped model is (s^2 + n psi E)(s^2 + 1) - n rho E s^2 = 0 in the units of Appendix C.2.  Weight on bit
enters through rho only; the speed through the delay only.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drillfem.errors import SceneError, SimulationError
from drillfem.scene.nominal import lumped_at_bit, lumps
from drillfem.stability.transfer import C16, F8, Delay, Oscillator, Receptance, Waves, exact, surface_delay

if TYPE_CHECKING:
    from drillfem.scene import Scene

UNSTABLE = 1e-6
"""Growth in 1/s above which a motion counts as unstable: undamped motions have 0."""

HIGHEST = 200.0
"""Hz: no roots are looked for beyond, where an undamped string has infinitely many that hardly grow."""

_POLES = 40  # the least damped motions of the string from which roots are looked for, besides all other places
_REAL = np.array([0.3, 3.0, 30.0], complex)  # 1/s: a torque that outgrows the string would not oscillate
_TRIVIAL = 1e-5  # rad/s: roots closer to 0 are the rigid advance of the bit, which nothing resists


class Roots(NamedTuple):
    """Characteristic roots with Im >= 0 of (p) operating points, by falling growth; padded with nan."""

    values: C16  # (p, most) rad/s
    torsional: NDArray[np.bool_]  # (p, most): the root follows the torsional half of the loop more than the axial one
    unstable: NDArray[np.int64]  # (p,) roots with growth > UNSTABLE by the argument principle; pairs count as two

    @property
    def growth(self) -> F8:
        """(p,) growth of the rightmost root, 1/s."""
        return np.asarray(self.values[:, 0].real)

    @property
    def frequency(self) -> F8:
        """(p,) frequency of the rightmost root, Hz."""
        return np.asarray(self.values[:, 0].imag / (2 * np.pi))

    @property
    def listed(self) -> NDArray[np.int64]:
        """(p,) roots with growth > UNSTABLE in the list; pairs count as two."""
        return _listed(self.values)


@dataclass(frozen=True)
class DrillingLoop:
    """The linear loop of string and rock around steady drilling, for any speed and any weight on bit.

    axial, torsion : receptances of the bit.  cutting : eps a zeta, N per m of total depth of cut.
    torque : eps a^2/2, N m per m.  sectors : angles in rad from each blade to the one ahead.
    delay : transfer function of a sector of rock.

    Operating points are pairs of arrays (p,): ``speed`` Omega_0 in rad/s and ``pitch`` rho in m/rad (see `pitch`).
    """

    axial: Receptance
    torsion: Receptance
    cutting: float
    torque: float
    sectors: tuple[float, ...]
    delay: Delay = exact

    @classmethod
    def from_scene(cls, scene: Scene, surface: str = "exact") -> DrillingLoop:
        """The loop of a scene with a cutting bit, as the rung that it runs with sees it.

        surface : "exact", or "scene" for the discretised surface of ``[rock]``.  A straight spatial string has the
        linear motions of the axial-torsional one.  Raises SceneError.
        """
        bit, rock = scene.bit, scene.rock
        if bit is None or rock is None or not scene.drills:
            raise SceneError("bit.kind: must be 'cutting' for a stability map: nothing else feeds a self-excitation")
        if not scene.top_drive.speed or scene.top_drive.speed < 0:
            raise SceneError(f"top_drive.speed = {scene.top_drive.speed}: must be > 0 rad/s for a stability map")
        load, flat = scene.nominal().weight_on_bit, rock.contact_strength * bit.radius * bit.wear_flat_length
        if load <= flat:
            raise SceneError(
                f"top_drive.weight_on_bit: {load:g} N on the bit must exceed {flat:.6g} N, or nothing is cut"
            )
        if surface not in ("exact", "scene"):
            raise ValueError(f"surface = {surface!r}: must be exact or scene")
        turn = 2 * np.pi
        angles = bit.blade_angles
        widths = [turn / bit.blades] * bit.blades
        if angles is not None:
            widths = [angles[0] + turn - angles[-1], *(b - a for a, b in pairwise(angles))]
        delay: Delay = exact
        if surface == "scene":
            delay = surface_delay(rock.surface.scheme, rock.surface.degree, rock.surface.elements)
        energy, a = rock.intrinsic_specific_energy, bit.radius
        axial, torsion = motions(scene)
        return cls(axial, torsion, energy * a * bit.inclination, energy * a**2 / 2, tuple(widths), delay)

    # -- the loop -----------------------------------------------------------------------------------------------------
    def feedback(self, s: C16, speed: F8) -> C16:
        """E(s): depth of cut, sum over the blades, per unit of u - rho phi."""
        p = s / speed
        total = np.zeros(p.shape, complex)
        for width, count in self._widths:
            total += count * (1 - self.delay(p, width))
        return total

    @cached_property
    def _widths(self) -> list[tuple[float, int]]:
        """Different sector widths, and how many sectors have each."""
        pairs = zip(*np.unique(np.round(self.sectors, 12), return_counts=True), strict=True)
        return [(float(width), int(count)) for width, count in pairs]

    def gain(self, s: C16, speed: F8, pitch: F8) -> C16:
        """Loop gain E (eps a zeta G_a - rho eps a^2/2 G_t): the characteristic equation is 1 + gain = 0."""
        axial, torsion = (n / d for n, d in (self.axial.parts(s), self.torsion.parts(s)))
        return self.feedback(s, speed) * (self.cutting * axial - self.torque * pitch * torsion)

    def characteristic(self, s: C16, speed: F8, pitch: F8) -> C16:
        """(1 + gain) times both denominators: without poles, so that Newton's method can start at one."""
        (na, da), (nt, dt) = self.axial.parts(s), self.torsion.parts(s)
        return da * dt + self.feedback(s, speed) * (self.cutting * na * dt - self.torque * pitch * nt * da)

    def boundary(self, omega: F8, lobes: int = 20) -> tuple[F8, F8]:
        """Where a root lies on the imaginary axis at i omega: (speed, pitch), each (lobes, k), for equal blades.

        With E = n (1 - exp(-i theta)) the equation splits: its real part gives rho, its imaginary part theta, and
        theta + 2 pi lobe = omega 2 pi/(n Omega_0) the speeds.  Points with rho < 0 are nan.  Raises ValueError for
        unequal blades and for a discretised surface.
        """
        n = len(self.sectors)
        if np.ptp(self.sectors) > 1e-9 or self.delay is not exact:
            raise ValueError("the boundary is known in closed form for equal blades and the exact surface only")
        s: C16 = np.asarray(1j * omega, np.complex128)
        axial, torsion = (p / q for p, q in (self.axial.parts(s), self.torsion.parts(s)))
        axial, torsion = self.cutting * axial, self.torque * torsion
        # 1/E = (1 - i cot(theta/2))/(2n)... = 1/(2n) - i cot(theta/2)/(2n)
        with np.errstate(divide="ignore", invalid="ignore"):
            pitch = (axial.real + 1 / (2 * n)) / torsion.real
            cotangent = 2 * n * (axial - pitch * torsion).imag
        theta = 2 * np.arctan2(1.0, cotangent) + 2 * np.pi * np.arange(lobes)[:, None]
        speed = np.asarray(omega) * 2 * np.pi / (n * theta)
        pitch = np.broadcast_to(np.where(pitch > 0, pitch, np.nan), speed.shape)
        return np.where(np.isnan(pitch), np.nan, speed), pitch

    # -- how far to look ----------------------------------------------------------------------------------------------
    def band(self, pitch: float) -> tuple[float, bool]:
        """Frequency (rad/s) up to which roots are counted, and whether there can be none beyond (else `HIGHEST`).

        On the imaginary axis |E| <= 2 n; where that times |receptances| stays below one, no root can cross it."""
        omega = self._grid(2 * np.pi * HIGHEST, fine=True)
        s: C16 = np.asarray(UNSTABLE + 1j * omega)
        axial, torsion = (np.abs(n / d) for n, d in (self.axial.parts(s), self.torsion.parts(s)))
        loud = 2 * len(self.sectors) * (self.cutting * axial + self.torque * pitch * torsion) >= 1
        last = int(np.flatnonzero(loud)[-1]) if loud.any() else 0
        if omega[last] > 0.9 * omega[-1]:
            return float(omega[-1]), False
        return float(1.02 * omega[last + 1]), True

    @cached_property
    def _poles(self) -> C16:
        limit = 1.2 * 2 * np.pi * HIGHEST
        return np.concatenate([self.axial.poles(limit), self.torsion.poles(limit)])

    def _grid(self, limit: float, fine: bool = False) -> F8:
        """Frequencies up to ``limit`` (rad/s) that see every resonance: even, and geometric towards each pole."""
        poles = self._poles
        near = poles.imag[poles.imag < 1.1 * limit]
        width = np.abs(poles.real[poles.imag < 1.1 * limit]) + UNSTABLE
        even = np.linspace(0, limit, max(400, 8 * len(near)) * (2 if fine else 1) + 1)[1:]
        reach = 2.0 ** np.arange(-1, 40)
        around = width[:, None] * reach
        around[around > 0.02 * limit] = np.nan
        points = np.concatenate([near[:, None] + around, near[:, None] - around, near[:, None]], axis=1).ravel()
        low = 1e-4 * limit * np.geomspace(1e-3, 1, 12)
        points = np.concatenate([even, low, points[np.isfinite(points)]])
        return np.unique(points[(points > 0) & (points <= limit)])

    # -- roots --------------------------------------------------------------------------------------------------------
    def roots(self, speed: F8, pitch: F8, least_growth: float = -2.0) -> Roots:
        """All unstable roots and the rightmost one of operating points (p,), with the count that vouches for them.

        least_growth : 1/s, roots below are not listed, except the rightmost.  Raises SimulationError if list and count
        of unstable roots disagree after all searches.
        """
        speed, pitch = np.broadcast_arrays(np.atleast_1d(np.asarray(speed, float)), np.atleast_1d(pitch))
        limit, _ = self.band(float(pitch.max()))
        count, axis = self._count(speed, pitch, limit)
        poles = self._poles[self._poles.imag <= 1.05 * limit]
        poles = poles[np.argsort(-poles.real, kind="stable")][:_POLES]
        deep = self._minima(speed, pitch, limit)
        roots = self._collect(
            self._secant(_table([np.concatenate(x) for x in zip(axis, deep, strict=True)], poles), speed, pitch), limit
        )
        # points where a root is missing: begin at the roots of the points nearby, then search box by box
        for attempt in range(2):
            lacks = np.flatnonzero(_listed(roots) != count)
            if not len(lacks):
                break
            seeds = []
            for i in lacks:
                if attempt == 0:
                    away = np.abs(np.log(speed / speed[i])) + np.abs(pitch - pitch[i]) / np.abs(pitch).max()
                    near = roots[np.argsort(away, kind="stable")[1:9]]
                    seeds.append(near[near.real > -0.1])
                else:
                    right = 2 * max(1.0, float(np.nanmax(roots[i].real, initial=0.0)))
                    x, y = np.meshgrid(np.geomspace(1e-3, right, 16), np.linspace(0, limit, 200))
                    seeds.append((x + 1j * y).ravel())
            found = self._secant(_table(seeds), speed[lacks], pitch[lacks])
            better = self._collect(np.concatenate([roots[lacks], found], axis=1), limit)
            grown = np.full((len(roots), max(roots.shape[1], int(np.isfinite(better).sum(axis=1).max()))), np.nan + 0j)
            grown[:, : roots.shape[1]] = roots
            grown[lacks] = better[:, : grown.shape[1]]
            roots = grown
        keep = (roots.real >= least_growth) | (np.arange(roots.shape[1]) == 0)
        roots = np.where(keep, roots, np.nan + 0j)
        roots = roots[:, : max(1, int(np.isfinite(roots).sum(axis=1).max()))]
        result = Roots(roots, self._is_torsional(roots, pitch), count)
        if np.any(result.listed != count):
            i = int(np.flatnonzero(result.listed != count)[0])
            raise SimulationError(
                f"stability: {count[i]} unstable roots counted, {result.listed[i]} found at {speed[i]:g} rad/s and a "
                f"pitch of {pitch[i]:g} m/rad"
            )
        return result

    def count(self, speed: F8, pitch: F8, growth: float = UNSTABLE) -> NDArray[np.int64]:
        """Roots (p,) with growth > ``growth`` > 0 (1/s) and frequency below `band`, by the argument principle."""
        speed, pitch = np.broadcast_arrays(np.atleast_1d(np.asarray(speed, float)), np.atleast_1d(pitch))
        return self._count(speed, pitch, self.band(float(pitch.max()))[0], growth)[0]

    def _count(
        self, speed: F8, pitch: F8, limit: float, growth: float = UNSTABLE
    ) -> tuple[NDArray[np.int64], list[C16]]:
        """Winding of 1 + gain around the roots, and starting points: where |1 + gain| is least along the axis.

        1 + gain has no poles right of the axis.  The path runs up the line Re s = growth, then right where the gain
        is small for good; what is left of the closed path adds the angle that remains."""
        omega = self._grid(limit)
        right = growth + limit * np.geomspace(1e-7, 10, 80)
        path = np.concatenate([growth + 1j * omega, right + 1j * omega[-1]])
        axial, torsion = (n / d for n, d in (self.axial.parts(path), self.torsion.parts(path)))
        axial, torsion = self.cutting * axial, self.torque * torsion
        counts: NDArray[np.int64] = np.zeros(len(speed), np.int64)
        seeds: list[C16] = [np.zeros(0, complex)] * len(speed)
        for value in np.unique(speed):
            echo = self.feedback(path, np.array(value))
            for block in np.array_split(np.flatnonzero(speed == value), 1 + int(np.sum(speed == value)) // 64):
                f = 1 + echo * (axial - pitch[block, None] * torsion)
                turn: F8 = np.asarray(np.angle(f[:, 1:] / f[:, :-1]), np.float64)
                total = turn.sum(axis=1) + np.angle(f[:, 0])
                total += self._refine(path, f, turn, np.full(len(block), value), pitch[block])
                # the rest of the path lies where |gain| < 1
                total -= np.angle(f[:, -1])
                counts[block] = np.rint(-total / np.pi)
                size = np.abs(f[:, : len(omega)])
                least = (size[:, 1:-1] <= size[:, :-2]) & (size[:, 1:-1] <= size[:, 2:])
                for row, i in enumerate(block):
                    seeds[i] = path[1 : len(omega) - 1][least[row]]
        return counts, seeds

    def _refine(self, path: C16, f: C16, turn: F8, speed: F8, pitch: F8) -> F8:
        """What steps of the path with a large turn turn in truth, minus that large turn, summed per point (rows)."""
        row, k = np.nonzero(np.abs(turn) > 1.0)
        change = np.zeros(len(f))
        np.subtract.at(change, row, turn[row, k])
        a, b, fa, fb = path[k], path[k + 1], f[row, k], f[row, k + 1]
        for _ in range(60):
            if not len(row):
                return change
            middle = 0.5 * (a + b)
            fm = 1 + self.gain(middle, speed[row], pitch[row])
            first, second = np.angle(fm / fa), np.angle(fb / fm)
            fine = (np.abs(first) < 1.0) & (np.abs(second) < 1.0)
            np.add.at(change, row[fine], (first + second)[fine])
            row = np.concatenate([row[~fine]] * 2)
            a, b = np.concatenate([a[~fine], middle[~fine]]), np.concatenate([middle[~fine], b[~fine]])
            fa, fb = np.concatenate([fa[~fine], fm[~fine]]), np.concatenate([fm[~fine], fb[~fine]])
        np.add.at(change, row, np.angle(fb / fa))  # a root on the line itself: either side is as good
        return change

    def _minima(self, speed: F8, pitch: F8, limit: float) -> list[C16]:
        """Where |1 + gain| is least on a lattice right of the axis: an analytic function has no minima but zeros."""
        omega = np.linspace(0, limit, max(200, 4 * int(np.sum(self._poles.imag < limit))) + 1)[1:]
        growth = np.concatenate([[UNSTABLE], np.geomspace(0.25, limit, max(4, int(2 * np.log2(4 * limit))))])
        s = growth[:, None] + 1j * omega
        axial, torsion = (n / d for n, d in (self.axial.parts(s), self.torsion.parts(s)))
        axial, torsion = self.cutting * axial, self.torque * torsion
        seeds = []
        echo: C16 = np.zeros(0, complex)
        last = np.nan
        for value, rho in zip(speed, pitch, strict=True):
            if value != last:
                echo, last = self.feedback(s, np.array(value)), value
            size = np.abs(1 + echo * (axial - rho * torsion))
            least = size[1:-1, 1:-1] <= np.minimum(size[:-2, 1:-1], size[2:, 1:-1])
            least &= size[1:-1, 1:-1] <= np.minimum(size[1:-1, :-2], size[1:-1, 2:])
            seeds.append(np.concatenate([s[1:-1, 1:-1][least], _REAL]))
        return seeds

    def _secant(self, start: C16, speed: F8, pitch: F8) -> C16:
        """Roots (p, k) that the secant method reaches from ``start`` (p, k); nan where it reaches none."""
        row, column = np.nonzero(np.isfinite(start))
        done = np.full(start.shape, np.nan, complex)
        before = start[row, column]
        z = before * (1 + 1e-4)
        f0 = self.characteristic(before, speed[row], pitch[row])
        for _ in range(60):
            if not len(z):
                break
            f = self.characteristic(z, speed[row], pitch[row])
            with np.errstate(all="ignore"):
                step = f * (z - before) / (f - f0)
                # no farther than a fraction of where we are: the neighbours are as close as that
                step *= np.minimum(1.0, (0.2 * np.abs(z) + 0.05) / np.abs(step))
                arrived = (np.abs(step) < 1e-10 * np.abs(z)) | (f == 0)
            step[f == 0] = 0
            before, f0, z = z, f, z - step
            done[row[arrived], column[arrived]] = z[arrived]
            going = ~arrived & np.isfinite(z) & (np.abs(z.real) < np.abs(z.imag) + 100) & (np.abs(z) > 0.1 * _TRIVIAL)
            row, column, z, before, f0 = row[going], column[going], z[going], before[going], f0[going]
        # a chord can be steep by accident: believe only what the tangent confirms
        row, column = np.nonzero(np.isfinite(done))
        z, w, rho = done[row, column], speed[row], pitch[row]
        h = 1e-6 * np.abs(z)
        f, up, down = (self.characteristic(z + e, w, rho) for e in (0 * h, h, -h))
        with np.errstate(all="ignore"):
            step = f * 2 * h / (up - down)
        done[row, column] = np.where(np.abs(step) < 1e-7 * np.abs(z), z - step, np.nan)
        return done

    @staticmethod
    def _collect(roots: C16, limit: float) -> C16:
        """Each root once, Im >= 0, without the trivial one, by falling growth."""
        roots = roots.real + 1j * np.abs(roots.imag)
        roots = np.where(np.abs(roots.imag) < 1e-7 * np.abs(roots), roots.real + 0j, roots)
        bad = (np.abs(roots) < _TRIVIAL) | (roots.imag > limit) | ~np.isfinite(roots)
        roots = np.where(bad, -np.inf + 0j, roots)
        roots = np.take_along_axis(roots, np.argsort(-roots.real, axis=1, kind="stable"), axis=1)
        # equal roots need not be neighbours in growth to the last digit: compare with a few before
        for k in range(1, min(12, roots.shape[1])):
            with np.errstate(invalid="ignore"):
                same = np.abs(roots[:, k:] - roots[:, :-k]) < 1e-7 * np.abs(roots[:, k:])
            roots[:, k:][same & np.isfinite(roots[:, k:])] = -np.inf
        roots = np.take_along_axis(roots, np.argsort(-roots.real, axis=1, kind="stable"), axis=1)
        return np.where(np.isfinite(roots.real), roots, np.nan + 0j)

    def _is_torsional(self, roots: C16, pitch: F8) -> NDArray[np.bool_]:
        """Whether a root follows the resonances of the torsional half of the loop more than those of the axial one."""

        def slope(motion: Receptance) -> F8:
            h = 1e-5 * np.abs(roots)
            (n1, d1), (n0, d0) = motion.parts(roots + h), motion.parts(roots - h)
            return np.abs(n1 / d1 - n0 / d0)

        with np.errstate(all="ignore"):
            return np.asarray(self.torque * pitch[:, None] * slope(self.torsion) > self.cutting * slope(self.axial))


def _listed(roots: C16) -> NDArray[np.int64]:
    """(p,) unstable roots in a table (p, k) with Im >= 0; pairs count as two."""
    with np.errstate(invalid="ignore"):
        return np.asarray(((roots.real > UNSTABLE) * np.where(roots.imag > 0, 2, 1)).sum(axis=1))


def _table(seeds: list[C16], common: C16 | None = None) -> C16:
    """Rows of unequal length, each followed by ``common``, padded with nan."""
    common = np.zeros(0, complex) if common is None else common
    width = max((len(x) for x in seeds), default=0)
    table = np.full((len(seeds), width + len(common)), np.nan + 0j)
    for row, found in zip(table, seeds, strict=True):
        row[: len(found)] = found
    table[:, width:] = common
    return table


def motions(scene: Scene) -> tuple[Receptance, Receptance]:
    """Axial and torsional receptance of the bit of a scene, for the rung that it runs with.

    lumped: a free mass, and an inertia on a spring; torsional: a free mass, and torsional waves; else axial and
    torsional waves.  What ``[inertia]`` lumps sits at the bit.
    """
    model = scene.resolved_model().name
    lump, ends, spread = lumps(scene), scene.ends, scene.inertia.distributed
    mass, inertia = lumped_at_bit(scene)
    if model == "lumped":
        return Oscillator(lump.mass), Oscillator(lump.inertia, lump.stiffness, lump.retardation)
    length = tuple(s.length for s in scene.string)
    late = tuple(s.retardation_time for s in scene.string)
    stiffness = [s.section_stiffness() for s in scene.string]
    torsion = Waves(
        length,
        tuple(k.torsion for k in stiffness),
        tuple(2 * spread * s.rotary_inertia for s in scene.string),
        late,
        held=True,
        bottom=ends.bottom_inertia + inertia,
    )
    if model == "torsional":
        return Oscillator(lump.mass), torsion
    axial = Waves(
        length,
        tuple(k.axial for k in stiffness),
        tuple(spread * s.mass_per_length for s in scene.string),
        late,
        held=False,
        top=ends.top_mass,
        bottom=ends.bottom_mass + mass,
    )
    return axial, torsion


def pitch(scene: Scene, weight: float | F8) -> F8:
    """rho = V_0/Omega_0 = d_0/(2 pi) in m/rad at weights on bit (N); negative where the bit does not drill (5-26)."""
    bit, rock = scene.bit, scene.rock
    assert bit is not None and rock is not None
    energy, a = rock.intrinsic_specific_energy, bit.radius
    flat = rock.contact_strength * a * bit.wear_flat_length
    return np.asarray((np.asarray(weight) - flat) / (2 * np.pi * energy * a * bit.inclination))
