"""The thesis' scenarios: what it prints about chapters 5 and 6, with the tolerances of `drillfem reproduce`."""

from __future__ import annotations

import pytest

from drillfem.reproduce import CASES, compare
from drillfem.reproduce.compare import BAD, GOOD, Studio

BY_NAME = {case.name: case for case in CASES}

#: What must hold, by case: numbers within 1 % (frequencies) or 2 % (torques) of print or within what print resolves,
#: and statements. What hangs on chance, or on the thesis' mesh and formula, is in docs/reproduction.md.
SETTLED = {
    "V1": ("psi", "beta", "omega_0", "W_0", "lambda", "I", "M", "f1", "f", "amplitude", "stick"),
    "C1": (
        *("A.f", "B.f", "mode 1", "mode 6", "A.T", "B.T", "A.sign", "B.sign", "A.back", "B.back"),
        *("A.stick", "B.stick", "A.deep", "B.deep"),
    ),
    "C2": (
        "beta",
        "A.f",
        "B.f",
        "mode 7",
        "A.T",
        "B.T",
        "A.decay",
        "B.decay",
        "A.back",
        "A.stick",
        "B.stick",
        "A.deep",
    ),
    "C3": ("A.f", "B.f", "A.back", "B.back"),
}
LONG = {
    "V2": (
        *("mode 5", "mode 6", "mode 7", "M1: 0.46 Hz", "M1: 0.46 A", "M1: 0.91 Hz", "0.4: 0.45 Hz", "0.4: 0.45 A"),
        *("0.4: 8.05 Hz", "0.4: 6.70 Hz", "0.8: 6.47 Hz", "1: 7.38 Hz", "1: 14.76 Hz", "1: 29.56 Hz", "limit"),
    ),
    "6-V1": ("t*", "L*", "H0", "f", "spin", "axial", "A", "depth"),
    "6-C1": (
        *("H0", "1e-2 S1 spin", "1e-2 S3 spin", "1e-2 spin dies", "1e-2 axial dies", "1e-2 torque"),
        *("1e-3 S1 spin", "1e-3 S1 axial", "1e-3 S2 spin", "1e-3 S2 axial", "1e-3 S3 spin", "1e-3 S3 axial"),
        *("1e-3 slow dies", "1e-3 sticks", "1e-3 torque", "1e-4 S1 axial", "1e-4 S2 3.20", "1e-4 S2 16.24"),
        *("1e-4 stays", "1e-4 sticks", "1e-4 torque", "1e-5 S2 16.20", "1e-5 S3 16.14", "1e-5 sticks", "1e-5 torque"),
        *("M2 S3", "M1 S3", "order"),
    ),
}


def unmet(name, keys, brief):
    rows = {row.claim.key: row for row in compare(BY_NAME[name], Studio(), brief=brief).rows}
    return rows, {key: (rows[key].value, rows[key].verdict) for key in keys if rows[key].verdict not in GOOD}


@pytest.mark.parametrize("name", SETTLED)
def test_chapter_5(name):
    _, wrong = unmet(name, SETTLED[name], brief=True)
    assert not wrong


def test_the_printed_spring_is_half_of_the_one_its_results_need():
    rows, _ = unmet("V1", (), brief=True)
    assert rows["C"].verdict in BAD and rows["C"].ratio == pytest.approx(2.0, abs=1e-3)


@pytest.mark.verify
@pytest.mark.parametrize("name", [*SETTLED, *LONG])
def test_all_claims_and_reasons(name):
    """Every claim, with experiments: what is settled holds, and what differs has a reason."""
    rows, wrong = unmet(name, (SETTLED | LONG)[name], brief=False)
    assert not wrong
    assert not [key for key, row in rows.items() if row.verdict in BAD and not row.reason]
