"""Every way in which the bit can move, by runs of the lumped model: each test checks that the motion has occurred."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from bitlab import C1
from lumpedlab import (
    INERTIA,
    MASS,
    SHARP,
    SPEED,
    STIFFNESS,
    UNEQUAL,
    WEIGHT,
    lumped_bit,
    lumped_string,
    reversing_top,
)

from drillfem.solve.condensed import energy_imbalance

#: surfaces that are accurate enough for statements about every step
SURFACES = [("profile", {}), ("dg", {"degree": 3, "elements": 24}), ("supg", {"elements": 64})]
AREA = C1["radius"] ** 2 / 2


def runs(mask):
    """(first, last + 1) of every stretch of True."""
    edge = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return edge.reshape(-1, 2)


def assert_books_close(string, history, start, volume=1e-12, energy=1e-6):
    """Rock gone from the profile is rock booked; energy that came in is stored, cut, rubbed or damped."""
    gone = AREA * (string.surface.integral() - start)
    assert gone == pytest.approx(history["rock_volume"][-1], rel=volume)
    assert np.abs(energy_imbalance(history)).max() < energy * history["work_top_drive"].max()


@pytest.mark.parametrize("scheme, surface", SURFACES)
@pytest.mark.parametrize("angles", [None, UNEQUAL])
def test_bouncing(scheme, surface, angles):
    string = lumped_string(5e-4, scheme, blade_angles=angles, **SHARP, **surface)
    start = string.surface.integral()
    h = string.advance(3600)
    flights = [(a, b) for a, b in runs(h["depth_of_cut"] < 0) if b - a > 10]
    assert len(flights) >= 5
    for a, b in flights:
        inside = slice(a, b)
        # off bottom: no force, no torque, free fall under the weight on bit, and the rock stays as it is
        assert not h["bit_weight"][inside].any() and not h["bit_torque"][inside].any()
        off = np.abs(np.diff(h["bit_axial_speed"][inside]) / (SHARP["weight"] / MASS * 5e-4) - 1)
        # (between two rows a blade may brush a crest)
        assert np.mean(off < 1e-8) > 0.95 and off.max() < 1e-3
        assert np.ptp(h["rock_volume"][inside]) < 1e-6 * h["rock_volume"][-1]
    # it comes back each time, and cuts much deeper than in steady drilling
    for (_, a), (b, _) in pairwise(flights):
        assert h["bit_weight"][a:b].max() > 0
    assert h["depth_of_cut"].max() > 3 * string.law.depth_of_cut(SHARP["weight"])
    assert_books_close(string, h, start, 1e-9 if scheme == "profile" else 1e-12)


@pytest.mark.parametrize("scheme, surface", SURFACES)
def test_lift_and_contact_again(scheme, surface):
    """A bit thrown up leaves the rock where it lifted off, and lands on what it left there."""
    errors = []
    for step in (1e-3, 2.5e-4):
        string = lumped_string(step, scheme, axial_speed=-0.04, **surface)
        h = string.advance(round(0.15 / step))
        a, b = runs(h["depth_of_cut"] < 0)[0]
        t, u, v = h["time"], h["bit_depth"], h["bit_axial_speed"]
        assert v[a] < -0.02 and v[b - 1] > 0.02 and h["bit_weight"][b:].max() > WEIGHT
        # a throw parabola from lift to contact, over rock that has its first slope
        advance = string.law.depth_of_cut(WEIGHT) / (2 * np.pi)
        angle = h["bit_angle"] - h["bit_angle"][a] + (u[a] - h["depth_of_cut"][a] / 6) / advance
        late = t[a:b] - t[a]
        np.testing.assert_allclose(u[a:b], u[a] + v[a] * late + 0.5 * WEIGHT / MASS * late**2, atol=1e-9)
        ahead = u - h["depth_of_cut"] / 6
        errors.append(np.abs(ahead[a:b] - advance * angle[a:b])[angle[a:b] < 0].max())
    assert errors[-1] < 2e-8


@pytest.mark.parametrize("scheme, surface", SURFACES)
def test_axial_stick(scheme, surface):
    """The wear flats carry what the cutting force leaves of the weight: the bit turns and stays where it is."""
    string = lumped_string(1e-3, scheme, **surface)
    start = string.surface.integral()
    h = string.advance(3000)
    stuck = [(a, b) for a, b in runs(h["bit_axial_speed"] < 1e-5) if b - a > 15]
    assert len(stuck) >= 3
    for a, b in stuck:
        inside = slice(a + 4, b - 4)
        assert h["bit_angular_speed"][inside].min() > 3
        assert np.ptp(h["bit_depth"][inside]) < 1e-5 * (b - a) * 1e-3
        np.testing.assert_allclose(h["bit_weight"][inside], WEIGHT, rtol=1e-3)
        # less than all of the wear-flat force
        cutting = C1["specific_energy"] * C1["inclination"] * C1["radius"] * h["depth_of_cut"][inside]
        assert np.all(h["bit_weight"][inside] - cutting < 32.66e3)
    # between the sticks the wear-flat force is whole
    assert h["bit_weight"].max() > 1.2 * WEIGHT
    assert_books_close(string, h, start, 1e-9)


def test_torsional_stick():
    """The spring winds up at the speed of the top, the rock holds until it is strong enough, and hardly any is cut."""
    string = lumped_string(1e-3, spin=1.0)
    start = string.surface.integral()
    h = string.advance(3000)
    spin, stuck = h["bit_angular_speed"], runs(h["bit_angular_speed"] < 2e-3)
    a, b = max(stuck, key=lambda run: run[1] - run[0])
    assert b - a > 50 and spin[:a].max() > 20 and spin[b:].max() > 20
    a, b = a + 5, b - 5
    assert spin[a:b].min() > -1e-3  # regularised: it creeps
    time, torque = h["time"][a:b], h["bit_torque"][a:b]
    assert np.polyfit(time, torque, 1)[0] == pytest.approx(STIFFNESS * SPEED, rel=0.01)
    np.testing.assert_allclose(torque, STIFFNESS * (SPEED * time - h["bit_angle"][a:b]), rtol=5e-3)
    assert np.ptp(h["rock_volume"][a:b]) < 1e-3 * h["rock_volume"][-1]
    assert_books_close(string, h, start, 1e-9)


@pytest.mark.parametrize("scheme, surface", SURFACES)
@pytest.mark.parametrize("angles", [None, UNEQUAL])
def test_backward_rotation(scheme, surface, angles):
    """Wound back by several sectors, the bit cuts nothing and its flats brake it; then it drills on as before."""
    string = lumped_string(5e-4, scheme, spin=0.0, top=reversing_top, blade_angles=angles, **surface)
    start = string.surface.integral()
    h = string.advance(8000)
    spin = h["bit_angular_speed"]
    a, b = max(runs(spin < 0), key=lambda run: run[1] - run[0])
    assert h["bit_angle"][a] - h["bit_angle"][b] > 5 * np.pi / 3 and spin[a:b].min() < -10
    inside = slice(a, b)
    # (the exact profile joins knots now and then)
    limit = 1e-4 * h["rock_volume"][a] if scheme == "profile" else 0.0
    assert np.ptp(h["rock_volume"][inside]) <= limit and np.ptp(h["work_cutting"][inside]) == 0.0
    assert h["bit_torque"][inside].max() <= 0.0 and h["bit_torque"][inside].min() < -1500
    assert np.diff(h["work_wear_flat"][inside]).min() >= 0 and np.ptp(h["work_wear_flat"][inside]) > 1e3
    # all blades together have cut the whole bottom to where it turned back: as much rock per turn as before
    again = slice(b, b + np.argmax(h["bit_angle"][b:] > h["bit_angle"][a]))
    drilled = [np.ptp(h["rock_volume"][k]) / np.ptp(h["bit_angle"][k]) for k in (slice(0, a - 200), again)]
    assert drilled[1] == pytest.approx(drilled[0], rel=0.2)
    assert_books_close(string, h, start, 1e-9 if scheme == "profile" else 1e-12, 1e-5)


@pytest.mark.parametrize("scheme, surface", SURFACES)
def test_a_short_turn_back_leaves_the_own_track_ahead(scheme, surface):
    """Thrown back by less than a sector, the bit deepens its own track first, and meets whole rock where that ends."""
    string = lumped_string(5e-4, scheme, spin=-1.6, **surface)
    h = string.advance(1000)
    angle = h["bit_angle"] - string.nominal()[1][1]
    back = np.argmin(angle)
    assert -np.pi / 3 < angle[back] < -0.3 and angle[-1] > np.pi / 3
    advance, cut = string.law.depth_of_cut(WEIGHT) / (2 * np.pi), h["depth_of_cut"] / 6
    own = (np.arange(len(angle)) > back) & (angle < -0.08)
    # (further on lies what the next blade has deepened in the meantime)
    beyond, limit = (angle > 0.08) & (angle < np.pi / 3 + angle[back] - 0.08), 1e-8 if scheme == "profile" else 1e-5
    assert own.sum() > 50 and beyond.sum() > 20
    np.testing.assert_allclose(cut[own], (h["bit_depth"] - advance * angle)[own], atol=limit)
    np.testing.assert_allclose(cut[beyond], (h["bit_depth"] - advance * (angle - np.pi / 3))[beyond], atol=limit)
    assert cut[beyond][0] > cut[own][-1] + 1e-4


def test_backward_rotation_with_the_printed_torque():
    """(5-9) as printed does not change the sign of the wear-flat torque: it drives a bit that turns backwards."""
    string = lumped_string(5e-4, law={"literal": True}, spin=0.0, top=reversing_top)
    h = string.advance(4000)
    back = h["bit_angular_speed"] < -1
    assert back.any() and h["bit_torque"][back].max() > 1500
    assert np.diff(h["work_wear_flat"])[back[1:]].min() < -1


@pytest.mark.parametrize("scheme, surface", [("profile", {}), ("dg", {"degree": 3, "elements": 48})])
def test_a_pit_meets_one_unequal_blade_after_the_other(scheme, surface):
    """A pit in one sector, too deep to be cut: each blade of a heavy bit passes it at its own time, once per turn."""
    turn, pit, lines = 2 * np.pi / SPEED, 2, []
    for angles in (UNEQUAL, None):
        string = lumped_string(
            1e-3, scheme, blade_angles=angles, spin=0.0, mass=1e3 * MASS, inertia=1e4 * INERTIA, **surface
        )
        slope = string.law.depth_of_cut(WEIGHT) / (2 * np.pi)
        sectors = len(string.surface.data.width)
        string.surface.set_profile(
            [lambda eta, a=slope, deep=i == pit % sectors: pitted(eta, a, deep) for i in range(sectors)], knots=512
        )
        u, twist = string.nominal()
        string.reset(u, np.array([slope * SPEED]), twist, np.full(2, SPEED))
        h = string.advance(round(4 * turn / 1e-3))
        cut, angle = h["depth_of_cut"], h["bit_angle"] - twist[1]
        dips = np.array([angle[a:b].mean() for a, b in runs(cut < 0.9 * np.median(cut)) if b - a > 3])
        if angles:
            # the pit lies 0.4 rad behind blade number 2; the blades behind that one come first
            meets = np.sort((UNEQUAL[pit] - 0.4 - np.array(UNEQUAL)) % (2 * np.pi))
        else:
            meets = np.pi / 3 * np.arange(1, 7) - 0.4
        np.testing.assert_allclose(dips[:18], np.concatenate([meets + 2 * np.pi * k for k in range(3)]), atol=0.06)
        spectrum = np.abs(np.fft.rfft(cut - cut.mean()))
        lines.append(spectrum[4] / spectrum[24])  # once per turn over six times per turn
    assert lines[0] > 0.1 and lines[1] < 0.03


def pitted(eta, slope, deep):
    return -slope * eta + (0.02 * np.exp(-(((eta - 0.4) / 0.05) ** 2)) if deep else 0.0)


def test_steady_drilling_of_unequal_blades_is_that_of_equal_ones():
    h = lumped_string(1e-3, "dg", spin=0.0, blade_angles=UNEQUAL).advance(1000)
    np.testing.assert_allclose(h["bit_torque"], lumped_bit().law.torque(1.26095e-3), rtol=1e-5)
    np.testing.assert_allclose(h["bit_angular_speed"], SPEED, rtol=1e-9)
