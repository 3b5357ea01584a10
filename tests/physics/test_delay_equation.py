"""The lumped model over rock surfaces against the same model as a delay equation, which has no rock surface."""

from __future__ import annotations

import numpy as np
import pytest
from bitlab import C1
from lumpedlab import SHARP, lumped_bit, lumped_string, reversing_top

from drillfem.bitrock import BitLaw
from drillfem.bitrock.delay import LumpedBit, delay_equation

QUANTITIES = ("bit_angular_speed", "bit_depth", "bit_axial_speed")
EVERY = 4e-3


def scalar(top):
    return lambda t: tuple(float(x) for x in top(t))


def differences(reference, steps, scheme="profile", **options):
    """Largest differences (steps, quantities) from the delay equation, relative to its largest values."""
    out = []
    for step in steps:
        end = reference["time"][-1]
        found = lumped_string(step, scheme, **options).advance(round(end / step), round(EVERY / step))
        np.testing.assert_allclose(found["time"], reference["time"][1:], rtol=1e-9)
        out.append([np.abs(found[q] - reference[q][1:]).max() / np.abs(reference[q]).max() for q in QUANTITIES])
    return np.array(out)


def orders(steps, errors):
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


STEPS = np.array([4e-3, 2e-3, 1e-3, 5e-4])


def test_tolerance_is_what_limits_the_oracle():
    results = [delay_equation(lumped_bit(), 0.6, rtol, step=EVERY) for rtol in (1e-5, 1e-7, 1e-9)]
    sizes = [np.abs(results[-1][q]).max() for q in QUANTITIES]
    errors = [
        max(np.abs(r[q] - results[-1][q]).max() / size for q, size in zip(QUANTITIES, sizes, strict=True))
        for r in results[:2]
    ]
    assert errors[0] < 2e-4 and errors[1] < 0.15 * errors[0]


@pytest.fixture(scope="module")
def chatter():
    """Case V1 = C1 of the lumped model: the bit sticks axially, a delay of one sector."""
    reference = delay_equation(lumped_bit(), 2.0, 1e-8, step=EVERY)
    assert (reference["bit_axial_speed"] < 1e-5).mean() > 0.1 and set(reference["passage"]) == {1}
    return reference


@pytest.mark.parametrize("scheme, surface", [("profile", {}), ("dg", {"degree": 3, "elements": 32})])
def test_axial_stick_slip(chatter, scheme, surface):
    errors = differences(chatter, STEPS, scheme, **surface)
    assert np.all(orders(STEPS, errors) > 1.4)
    assert errors[-1].max() < 1e-4 and errors[-1, :2].max() < 5e-6


@pytest.mark.parametrize(
    "scheme, elements, low, high", [("dg", 16, 0.0, 5e-4), ("supg", 64, 0.0, 5e-4), ("upwind", 64, 0.1, 0.4)]
)
def test_what_a_coarse_surface_costs(chatter, scheme, elements, low, high):
    """Axial speed over 2 s: first-order upwinding is beside the point, on as many elements as the thesis has."""
    assert low < differences(chatter, [1e-3], scheme, elements=elements).max() < high


def test_torsional_stick_slip():
    reference = delay_equation(lumped_bit(spin=1.0), 2.5, 1e-8, step=EVERY)
    assert (reference["bit_angular_speed"] < 1e-2).sum() > 20
    errors = differences(reference, STEPS, spin=1.0)
    assert np.all(orders(STEPS, errors) > 1.0)
    assert errors[-1].max() < 2e-4 and errors[-1, :2].max() < 5e-6


@pytest.fixture(scope="module")
def bounce():
    """The rock ahead is that of the passage before the last, or of the one before that."""
    reference = delay_equation(lumped_bit(**SHARP), 0.8, 1e-9, step=EVERY)
    cutting = reference["depth_of_cut"] > 0
    assert (~cutting).sum() > 20 and reference["passage"][cutting].max() >= 2 and reference["passage"].max() >= 3
    return reference


@pytest.mark.parametrize("scheme, surface", [("profile", {}), ("dg", {"elements": 48})])
def test_a_bouncing_bit_meets_rock_that_it_passed_over(bounce, scheme, surface):
    errors = differences(bounce, [1e-3, 1.25e-4], scheme, **SHARP, **surface)
    assert errors[-1].max() < 1e-3 and np.all(errors[-1] < 0.4 * errors[0])


def test_one_delay_is_not_enough_for_a_bouncing_bit(bounce):
    single = delay_equation(lumped_bit(**SHARP), 0.8, 1e-9, step=EVERY, passages=1)
    assert set(single["passage"]) == {1}
    for quantity in QUANTITIES:
        assert np.abs(single[quantity] - bounce[quantity]).max() > 0.05 * np.abs(bounce[quantity]).max()


def test_a_bit_that_turns_back_by_turns_covers_its_track_again():
    """The top winds the bit back by 20 rad: it then drills over its own track and those of the blades behind."""
    reference = delay_equation(lumped_bit(spin=0.0, top=scalar(reversing_top)), 4.0, 1e-8, step=EVERY)
    passage, spin = reference["passage"], reference["bit_angular_speed"]
    assert spin.min() < -20 and {-10, -1, 0, 1} <= set(passage) and passage[spin > 1].min() < -10
    steps = STEPS[2:] / 2
    errors = differences(reference, [*steps, steps[-1] / 2], spin=0.0, top=reversing_top)
    assert errors[-1].max() < 5e-3 and errors[-1, :2].max() < 1e-4 and np.all(errors[-1] < 0.6 * errors[0])


def test_wrong_input_is_refused():
    with pytest.raises(ValueError, match="delay equation: end"):
        delay_equation(lumped_bit(), -1.0)
    with pytest.raises(ValueError, match="widths"):
        delay_equation(lumped_bit(law={"axial_regularisation": 0.0}), 1.0)


def test_scene():
    from drillfem.scene import load_scene

    bit = LumpedBit.from_scene(load_scene("vertical-c1-cd4", {"model": "lumped"}))
    assert bit.stiffness == pytest.approx(938.096, rel=1e-5) and bit.law == BitLaw(**C1)
    assert bit.mass == pytest.approx(24614.4, rel=1e-5) and bit.inertia == pytest.approx(112.786, rel=1e-5)
    assert bit.spin == pytest.approx(1.1 * 14.42) and bit.damping == pytest.approx(1e-4 * bit.stiffness)
    found = delay_equation(bit, 0.05)
    assert found["bit_depth"][-1] == pytest.approx(0.05 * bit.axial_speed, rel=0.2)
