"""The rock surface that the bit cuts, as an advection equation on a periodic interval (5-21), (D-5).

In the frame of the bit the rock flows past the blades: dL/dt + omega_b dL/deta = 0. The speed only sets how fast
time runs, so the forms are written in the angle phi that the bit has turned: dL/dphi + dL/deta = 0. The blade is
the one point of the circle where the surface may jump: there the boundary switch decides what flows in.

Two discretisations: discontinuous elements (`mass`, `transport`), and continuous ones with a test function that looks
upstream (`streamline_mass`, `streamline_transport`), whose mass depends on the direction. The inflow is the same.
"""

from __future__ import annotations

import ufl
from ufl.core.expr import Expr


def mass(L: Expr, test: Expr, dx: ufl.Measure) -> ufl.Form:
    """Mass form of the discontinuous space."""
    return L * test * dx


def transport(
    L: Expr, test: Expr, forward: bool, dx: ufl.Measure, interior: ufl.Measure, ends: ufl.Measure
) -> ufl.Form:
    """-(dL/deta, test) with upwind traces, without the inflow: M dL/dphi = transport + inflow.

    ``forward``: the bit drills (rock flows towards +eta); else it turns backward and the rock flows towards -eta.
    ``interior``: facets between elements, ``ends``: the two sides of the blade (both are facets of one closed circle).
    """
    n = ufl.FacetNormal(ufl.domain.extract_unique_domain(L))
    way = 1 if forward else -1
    volume = way * L * test.dx(0) * dx
    flow = way * n[0]
    out = (flow + abs(flow)) / 2
    jumps = (out("+") * L("+") - out("-") * L("-")) * (test("+") - test("-")) * interior
    return volume - jumps - out * L * test * ends


def streamline_mass(L: Expr, test: Expr, forward: bool, tau: Expr, dx: ufl.Measure) -> ufl.Form:
    """(dL/dphi, test + tau dtest/dflow): what multiplies the rate where the test functions look upstream."""
    way = 1 if forward else -1
    return L * (test + way * tau * test.dx(0)) * dx


def streamline_transport(L: Expr, test: Expr, forward: bool, tau: Expr, dx: ufl.Measure, ends: ufl.Measure) -> ufl.Form:
    """-(dL/dflow, test + tau dtest/dflow), and the known half of the weak inflow: both see the whole residual."""
    n = ufl.FacetNormal(ufl.domain.extract_unique_domain(L))
    way = 1 if forward else -1
    flow = way * n[0]
    volume = -way * L.dx(0) * (test + way * tau * test.dx(0)) * dx
    return volume - (abs(flow) - flow) / 2 * L * test * ends


def inflow(test: Expr, forward: bool, ends: ufl.Measure) -> ufl.Form:
    """Load vector of a unit height that flows in at the blade."""
    n = ufl.FacetNormal(ufl.domain.extract_unique_domain(test))
    flow = (1 if forward else -1) * n[0]
    return (abs(flow) - flow) / 2 * test * ends
