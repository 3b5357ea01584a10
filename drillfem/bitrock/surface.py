"""The rock surface under the bit, in the bit's frame and in the angle it turns.

The surface height L(eta, t) (m, positive down like the bit's depth U) runs from a blade (eta = 0) backwards to
the blade behind it (eta = width of the sector) and obeys dL/dt + w dL/deta = 0 (5-21).  Speed only rescales
time, so everything here is written in the turn phi of the bit: dL/dphi + dL/deta = 0.  Turning forwards, a blade
leaves ``max(U, rock ahead)`` behind it: it cuts, slides, or passes above the rock.  Turning backwards cuts nothing:
the profile passes under the blade and lies ahead of it again.  Equal blades share one sector; unequal ones have
a sector each, and what leaves sector i meets blade i - 1, the one behind.

Four schemes behind one interface:

``dg``       discontinuous Galerkin of degree k in eta;
``supg``     continuous linear elements in eta with a streamline test function, inflow imposed weakly;
``upwind``   first-order upwinding (discontinuous Galerkin of degree 0), as most published codes have it;
``profile``  the exact moving profile: a ring of knots with cubic pieces between them.

The first three march in phi with the classical Runge-Kutta method of fourth order.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drillfem.bitrock.dg import (
    PAD,
    VALID,
    DGData,
    DGOperators,
    N,
    dg_ahead,
    dg_commit,
    dg_setup,
    surface_operators,
    surface_order,
)
from drillfem.bitrock.jit import kernel
from drillfem.bitrock.profile import FIRST, SIZE, ProfileData, profile_ahead, profile_commit, profile_setup, sector_area

if TYPE_CHECKING:
    from drillfem.scene import Scene

F8 = NDArray[np.float64]
SCHEMES = ("dg", "supg", "upwind", "profile")


class SurfaceData(NamedTuple):
    """What the compiled functions need: one type for all schemes, what is unused is a dummy."""

    exact: bool  # the moving profile; else finite elements
    width: F8  # (m,) rad, sector behind each blade
    share: F8  # (m,) blades that a sector stands for
    removed: F8  # (1,) integral of the depth of cut (all blades) over the turn, m rad
    dg: DGData
    profile: ProfileData


@kernel(lean=True)
def ahead(surface: SurfaceData, turn: float, forward: bool, height: F8, slope: F8) -> None:
    """Fill ``height`` (m,) with what the blades meet after ``turn`` (rad, from the committed angle), ``slope`` d/dturn.

    ``forward`` selects the rock ahead (turn >= 0) or the rock that comes back under the blades (turn <= 0).
    Valid up to the narrowest sector: beyond it the blade would meet rock cut during this same turn.
    """
    if surface.exact:
        profile_ahead(surface.profile, surface.width, turn, forward, height, slope)
    else:
        dg_ahead(surface.dg, surface.width, turn, forward, height, slope)


@kernel(lean=True)
def commit(surface: SurfaceData, turn: float, u0: float, u1: float, s0: float, s1: float) -> None:
    """Turn by ``turn`` (rad, any size and sign) while the bit's depth goes from u0 to u1 with slopes s0, s1 (m/rad)."""
    if surface.exact:
        surface.removed[0] += profile_commit(surface.profile, surface.width, surface.share, turn, u0, u1, s0, s1)
    else:
        surface.removed[0] += dg_commit(surface.dg, surface.width, surface.share, turn, u0, u1, s0, s1)


class RockSurface:
    """Rock surface of all blades, with its state.

    Parameters
    ----------
    scheme : "dg" (``degree``, ``elements`` per sector), "supg" or "upwind" (``elements``), or "profile".
    blades : number of blades.
    blade_angles : (blades,) rad, increasing within one turn in the direction of drilling; None for equal spacing.
    incline : dL/deta of the first profile, m/rad: -d_0 / (2 pi) in nominal drilling, L(0) = 0.
    operators : of the scheme on one sector, when assembled elsewhere (from the UFL form); override degree and elements.
    """

    def __init__(
        self,
        scheme: str = "dg",
        blades: int = 1,
        blade_angles: Any = None,
        *,
        degree: int = 2,
        elements: int = 16,
        incline: float = 0.0,
        operators: DGOperators | None = None,
    ) -> None:
        if scheme not in SCHEMES:
            raise ValueError(f"surface: scheme = {scheme!r}: must be one of {', '.join(SCHEMES)}")
        turn = 2 * np.pi
        if blade_angles is None:
            width, share = np.array([turn / blades]), np.array([float(blades)])
        else:
            angle = np.asarray(blade_angles, float)
            width, share = angle - np.roll(angle, 1), np.ones(angle.size)
            width[0] += turn
            if angle.shape != (blades,) or np.any(width <= 0):
                raise ValueError("surface: blade_angles must be one angle per blade, increasing within one turn")
        exact = scheme == "profile"
        if operators is None:
            operators = (
                surface_operators("upwind", 0, 1, 1.0)
                if exact
                else surface_operators(scheme, degree, elements, float(width[0]))
            )
        # the unused scheme is kept as small as its compiled type allows
        self.data = SurfaceData(
            exact,
            width,
            share,
            np.zeros(1),
            dg_setup(operators, width),
            profile_setup(width) if exact else profile_setup(width, 2),
        )
        order = surface_order(operators)
        self._unit_nodes = operators.nodes[order] / operators.width
        self._unit_mass = operators.mass.sum(axis=0)[order] / operators.width
        if exact:
            self.set_profile([lambda eta: incline * eta] * width.size)
        else:
            # the straight profile that the scheme itself keeps: upwinding carries it half an element on
            rate = operators.rate()[0]
            self._heights[:] = (
                -incline * width[:, None] * np.linalg.solve(operators.width * rate, np.ones(order.size))[order]
            )

    @classmethod
    def from_scene(cls, scene: Scene, operators: DGOperators | None = None) -> RockSurface:
        """The surface of a scene; it starts in nominal drilling."""
        bit, rock = scene.bit, scene.rock
        if bit is None or rock is None:
            raise ValueError("surface: the scene has no bit or no rock")
        return cls(
            rock.surface.scheme,
            bit.blades,
            bit.blade_angles,
            degree=rock.surface.degree,
            elements=rock.surface.elements,
            incline=-scene.nominal().depth_of_cut / (2 * np.pi),
            operators=operators,
        )

    def set_profile(self, height: list[Any], knots: int = 64) -> None:
        """Set the heights: one function of eta per sector.  ``knots``: pieces per sector of the scheme "profile"."""
        data = self.data
        for i, function in enumerate(height):
            if not data.exact:
                self._heights[i] = function(self._unit_nodes * data.width[i])
                continue
            p = data.profile
            key = np.linspace(0.0, data.width[i], knots + 1)
            values = np.broadcast_to(function(data.width[i] - key), key.shape)
            chord = np.diff(values) / np.diff(key)
            self._put(i, np.stack([p.phi[0] + key, values, np.append(0.0, chord), np.append(chord, 0.0)], axis=1))

    @property
    def removed(self) -> float:
        """Integral of the total depth of cut over the turn, m rad; times (bit radius)^2 / 2 it is the volume cut."""
        return float(self.data.removed[0])

    def ahead(self, turn: float) -> tuple[F8, F8]:
        """Heights (m,) that the blades meet after ``turn`` (rad) and their slopes (m/rad); 0 counts as forwards."""
        height, slope = np.empty((2, self.data.width.size))
        ahead(self.data, float(turn), turn >= 0, height, slope)
        return height, slope

    def depth_of_cut(self, depth: float) -> float:
        """Signed total depth of cut (m) of a bit at ``depth`` (m): negative off bottom."""
        gap = depth - self.ahead(0.0)[0]
        if np.all(gap < 0):
            return float(gap.max() * self.data.share.sum())
        return float(self.data.share @ np.maximum(gap, 0.0))

    def commit(self, turn: float, u0: float, u1: float, s0: float | None = None, s1: float | None = None) -> None:
        """Turn by ``turn`` (rad) while the depth goes from u0 to u1 (m); s0, s1 (m/rad): slopes, default straight."""
        chord = (u1 - u0) / turn if turn else 0.0
        commit(self.data, float(turn), u0, u1, chord if s0 is None else s0, chord if s1 is None else s1)

    def integral(self) -> float:
        """Integral of the height over all sectors, m rad; it grows by exactly what `removed` books."""
        data = self.data
        if not data.exact:
            return float(np.sum(data.share * data.width * (self._heights @ self._unit_mass)))
        return float(sum(data.share[i] * sector_area(data.profile, i) for i in range(data.width.size)))

    def profile(self) -> list[tuple[F8, F8]]:
        """Pairs (eta, height) of each sector, eta increasing from the blade backwards, for pictures."""
        data = self.data
        if not data.exact:
            return [(self._unit_nodes * w, self._heights[i].copy()) for i, w in enumerate(data.width)]
        out = []
        for i, w in enumerate(data.width):
            key, height = self._knots(i)[:, :2].T
            out.append(((data.profile.phi[0] + w - key)[::-1], height[::-1]))
        return out

    @property
    def _heights(self) -> F8:
        """Writable view (m, n) of the degrees of freedom; what was derived from them is forgotten."""
        dg, m = self.data.dg, self.data.width.size
        n, pad = dg.number[N], dg.number[PAD]
        dg.number[VALID : VALID + 2] = 0
        return dg.state[: m * (n + 2 * pad)].reshape(m, -1)[:, pad : pad + n]

    def _knots(self, sector: int) -> F8:
        """Knots (k, 4) of a sector: key, height, slopes on both sides."""
        p = self.data.profile
        return p.ring[sector, (p.number[FIRST, sector] + np.arange(p.number[SIZE, sector])) % p.ring.shape[1]]

    def _put(self, sector: int, knots: F8) -> None:
        p = self.data.profile
        p.number[:, sector] = 0, len(knots)
        p.ring[sector, : len(knots)] = knots

    def state_dict(self) -> dict[str, F8]:
        """The state as plain arrays: `load` restores it to the bit."""
        data = self.data
        state = {"removed": data.removed.copy()}
        if not data.exact:
            return state | {"height": self._heights.copy()}
        return state | {"phi": data.profile.phi.copy()} | {f"knots_{i}": self._knots(i) for i in range(data.width.size)}

    def load(self, state: dict[str, Any]) -> None:
        """Take over a state of `state_dict` (of a surface made in the same way)."""
        data = self.data
        data.removed[:] = state["removed"]
        if not data.exact:
            self._heights[:] = state["height"]
            return
        data.profile.phi[:] = state["phi"]
        for i in range(data.width.size):
            self._put(i, np.asarray(state[f"knots_{i}"]))
