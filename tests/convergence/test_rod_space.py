"""Orders in space: degree + 1 in L2 for the fields, degree for the strains, twice the degree at the tip."""

from __future__ import annotations

import numpy as np
import pytest
from rodexact import cantilever, helix
from rodlab import bar, equilibrium, gauss, l2, order, quaternions, take

from drillfem.models.rod import Rod

MESHES = {1: (16, 32, 64), 2: (8, 16, 32), 3: (4, 8, 16), 4: (3, 6, 12)}


@pytest.mark.parametrize("degree", MESHES)
def test_cantilever_in_the_plane(degree: int) -> None:
    load, EI, EA, GA = 5.0, 1.0, 60.0, 25.0  # bends, stretches and shears
    exact = cantilever(load, EI, EA, GA)
    ends = {"top": "clamped", "bottom": "free", "tip_force": [load, 0, 0]}
    h, place, angle, strain, tip = [], [], [], [], []
    for elements in MESHES[degree]:
        rod = Rod(bar(axial=EA, shear=GA, bending=EI, ends=ends, mesh={"elements": elements, "degree": degree}))
        equilibrium(rod, np.linspace(0.2, 1, 5))
        u = rod.u.x.array
        h.append(1 / elements)
        place.append(l2(rod, take(rod, u, "r1", "r3"), lambda s: exact(s)[[2, 3]].T))
        angle.append(l2(rod, take(rod, u, "theta"), lambda s: exact(s)[0]))
        s, weights, slope = gauss(rod, derivative=True)
        strain.append(np.sqrt(weights @ (slope(take(rod, u, "theta")) - exact(s)[1] / EI) ** 2))
        tip.append(np.linalg.norm(take(rod, u, "r1", "r3")[-1] - exact(1.0)[[2, 3]]))
    assert order(h, place) == pytest.approx(degree + 1, abs=0.25)
    assert order(h, angle) == pytest.approx(degree + 1, abs=0.25)
    assert order(h, strain) == pytest.approx(degree, abs=0.25)
    if degree < 4:  # for quartics it is round-off
        assert order(h, tip) == pytest.approx(2 * degree, abs=0.4)


@pytest.mark.parametrize("degree", [pytest.param(d, marks=[] if d == 3 else pytest.mark.slow) for d in MESHES])
def test_helix_in_space(degree: int) -> None:
    meshes = [2 * n for n in MESHES[degree]]
    h, place, turn, tip = [], [], [], []
    for elements in meshes:
        rod, r, R = helix(2.5, 3.0, elements=elements, degree=degree)
        q = take(rod, rod.u.x.array, "q_a", "q_b", "q_c", "q_d")
        np.testing.assert_allclose((q**2).sum(axis=1), 1.0, atol=1e-12)
        h.append(1 / elements)
        place.append(l2(rod, rod.shape()[0], r))
        turn.append(l2(rod, q, lambda s, R=R: quaternions(R(s))))
        tip.append(np.linalg.norm(rod.shape()[0][-1] - r(1.0)[0]))
    assert order(h, place) == pytest.approx(degree + 1, abs=0.1)
    assert order(h, turn) == pytest.approx(degree + 1, abs=0.1)
    if degree < 4:
        assert order(h, tip) == pytest.approx(2 * degree, abs=0.1)
