"""The bit-rock law (5-5)-(5-19) with the sign decisions of the specification."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bitlab import C1

import drillfem.bitrock
from drillfem.bitrock import BitLaw


def test_nominal_values_of_the_thesis():
    law = BitLaw(**C1)
    depth = law.depth_of_cut(45.7e3)
    assert depth == pytest.approx(1.26095e-3, rel=1e-5)
    assert law.torque(depth) == pytest.approx(3264.0, rel=2e-5)
    forces = law.forces(2.9e-3, 14.42, depth)
    assert forces.weight == pytest.approx(45.7e3) and forces.torque == pytest.approx(law.torque(depth))
    # W0 lies between what the wear flats carry turning and stalled
    assert law.forces(1e-3, 14.0, 0.0).wear_weight == pytest.approx(32659.2)
    assert law.forces(1e-3, 0.0, 0.0).wear_weight == pytest.approx(65318.4)


@pytest.mark.parametrize(
    "v, w, d, wc, wf, tc, tf",
    [
        (0.0, 14.0, 1e-3, 1, 0, 1, 0),  # sliding: only cutting
        (-1.0, 14.0, 1e-3, 1, 0, 1, 0),
        (5e-6, 14.0, 1e-3, 1, 0.5, 1, 0.5),  # half of c1
        (1.0, 0.0, 1e-3, 0, 2, 0, 0),  # stalled: sigma_2, no cutting, no direction of the torque
        (1.0, 5e-4, 1e-3, 0.5, 2 - 5e-3, 0.5, 0.5 * (2 - 5e-3)),  # half of c3
        (1.0, 0.05, 1e-3, 1, 1.5, 1, 1.5),  # half of c2
        (1.0, -1.0, 1e-3, 0, 2, 0, -2),  # backwards: the wear flats brake
        (1.0, 14.0, -1e-9, 0, 0, 0, 0),  # off bottom
    ],
)
def test_branches(v, w, d, wc, wf, tc, tf):
    law = BitLaw(**C1)
    cut, wear = 0.252e9 * 0.38 * 0.108 * 1e-3, 32659.2
    expected = [wc * cut, wf * wear, tc * cut * 0.108 / 0.76, tf * wear * 0.054 * 0.8]
    np.testing.assert_allclose(law.forces(v, w, d)[2:], expected, rtol=1e-12, atol=1e-12)


def test_literal_reading_feeds_a_bit_that_turns_backwards():
    power = [BitLaw(**C1, literal=literal).forces(1.0, -1.0, 0.0).torque * -1.0 for literal in (False, True)]
    assert power[0] > 0 > power[1]


def test_bad_parameters_are_named():
    for name, value in (("radius", 0.0), ("friction", -1.0), ("inclination", np.nan), ("blades", 0)):
        with pytest.raises(ValueError, match=name):
            BitLaw(**C1 | {name: value})


def test_from_scene():
    scene = SimpleNamespace(
        reading="literal",
        bit=SimpleNamespace(
            radius=0.108,
            wear_flat_length=1.2e-3,
            friction=0.8,
            inclination=0.38,
            geometry=1.0,
            blades=6,
            axial_regularisation=1e-5,
            torsional_regularisation=0.1,
            cutting_regularisation=1e-3,
        ),
        rock=SimpleNamespace(
            intrinsic_specific_energy=0.252e9, contact_strength=0.252e9, contact_strength_stalled=0.504e9
        ),
    )
    assert BitLaw.from_scene(scene) == BitLaw(**C1, literal=True)


def test_cached_kernels_notice_a_change_in_any_file(tmp_path):
    """Numba alone would keep the old caller when only the callee's file changes."""
    package = Path(drillfem.bitrock.__file__).parents[1]
    copy = tmp_path / "drillfem" / "bitrock"
    shutil.copytree(package / "bitrock", copy, ignore=shutil.ignore_patterns("__pycache__"))
    (copy.parent / "__init__.py").touch()
    program = (
        "import numpy as np, numba; from drillfem.bitrock import law, jit\n"
        "@jit.kernel()\ndef twice(x):\n    return 2 * law.ramp(x, 1.0)\n"
        "assert numba.config.CACHE_DIR.endswith('cache'); print(twice(0.25))\n"
    )
    script = tmp_path / "script.py"
    script.write_text(program)
    paths = {"PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    seen = []
    for _ in range(2):
        run = subprocess.run(
            [sys.executable, script], env=os.environ | paths, capture_output=True, text=True, check=True
        )
        seen.append(float(run.stdout))
        text = (copy / "law.py").read_text()
        (copy / "law.py").write_text(text.replace("return x / width", "return 2.0 * x / width"))
    assert seen == [0.5, 1.0]
