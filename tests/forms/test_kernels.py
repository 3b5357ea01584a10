"""The compiled sum of all terms is the sum of the terms compiled one by one, at every degree."""

from __future__ import annotations

import numpy as np
import pytest
from rodlab import bar, dynamic, put, wave

from drillfem.compat import VectorForm
from drillfem.models.rod import Rod


@pytest.mark.parametrize(("model", "degree"), [("planar", 1), ("planar", 4), ("spatial", 1)])
def test_terms_in_one_kernel_do_not_disturb_each_other(model: str, degree: int) -> None:
    # FFCx 0.9 reuses fields at the point of a one-point rule (P1) for the other rules of a kernel, and gives the Gauss
    # and the Lobatto rule of P4 the same name
    mesh = {"elements": 3, "degree": degree}
    tip = {"top": "clamped", "bottom": "free", "tip_moment": [0, 1.0, 0], "tip_force": [1.0, 0, 2.0]}
    rod = Rod(
        bar(model=model, retardation=0.1, ends=tip, mesh=mesh, time=dynamic(1.0, 0.1), gravity={"direction": [1, 0, 0]})
    )
    rng = np.random.default_rng(5)
    names = rod.ansatz.x_names + rod.ansatz.v_names
    u = put(rod) + put(rod, np.zeros(rod.size), **{n: wave(rng, 1.0, 0.2) for n in names})
    u_dot = put(rod, np.zeros(rod.size), **{n: wave(rng, 1.0, 1.0) for n in names})
    rod.set_state(u, u_dot)
    parts = [VectorForm(term)(np.zeros(rod.size)) for term in rod.terms.values() if not term.empty()]
    whole = rod._residual(np.zeros(rod.size))
    np.testing.assert_allclose(whole, sum(parts), atol=1e-12 * max(abs(p).max() for p in parts))
