"""Surveys: reading files, minimum curvature against libraries, the smooth centreline, a real well."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest

from drillfem.boreholes import (
    builtin_surveys,
    departure,
    find,
    helix,
    minimum_curvature,
    read_caliper,
    read_friction,
    read_survey,
    survey,
    with_files,
)
from drillfem.boreholes.survey import TRANSITION, Arcs
from drillfem.errors import MissingDependency, SceneError

WIDE = {"diameter": 0.2159}
DEG = math.pi / 180


@pytest.fixture
def file(tmp_path):
    def write(text, encoding="utf-8"):
        path = tmp_path / "well.csv"
        path.write_bytes(text.encode(encoding))
        return path

    return write


@pytest.fixture(scope="module")
def real():
    stations = read_survey(find("p11-a-02"))
    return stations, survey(stations, **WIDE)


# -- files ----------------------------------------------------------------------------------------------------------

ROWS = [[0, 0, 0], [30, 10 * DEG, 350 * DEG]]


@pytest.mark.parametrize(
    "text",
    [
        "DEPTH,DEVI,AZIM\n0,0,0\n30,10,350\n",
        "MD,INC,AZI\n0,0,0\n30,10,350\n",
        "Measured Depth (m),Inclination (deg),Azimuth (deg)\n0,0,0\n30,10,350\n",
        "# a comment\n\nMD [m]\tIncl [°]\tAzi [°]\n0\t0\t0\n\n30\t10\t350\n# the end\n",
        "MD;INCL;AZIM\nm;deg;deg\n0;0,0;0\n30,0;10,0;350,0\n",
        "  0   0    0\n 30  10  350\n",
        "Meas Depth   Incl   Azi TN (deg TN)\n0 0 0\n30 10 350\n",
        "md_ft,inc_deg,azi_deg\n0,0,0\n98.42519685039370,10,350\n",
        "Well,TVD,MD (RKB),INC,AZI,NS\nA,0,0,0,0,3\nA,29.8,30,10,-10,3\n",
        '"MD","INC","AZI"\r\n"0","0","0"\r\n"30","10","350"\r\n',
        "md|inc_rad|azi_rad\n0|0|0\n30|0.17453292519943295|6.1086523819801535\n",
        "\ufeffMD,INC,AZI\n0,0,0\n30,10,350\n",
        "~ASCII\n!c\n%c\n//c\nMD,INC,AZI,,\n0,0,0,,\n,,,,\n30,10,350,,\n",
    ],
)
def test_what_can_be_read(file, text):
    found = read_survey(file(text))
    assert found[:, :2] == pytest.approx(np.array(ROWS)[:, :2], abs=1e-12)
    assert found[:, 2] % (2 * math.pi) == pytest.approx([0, 350 * DEG], abs=1e-12)


def test_a_degree_sign_of_an_older_program(file):
    assert read_survey(file("MD,INC (°),AZI (°)\n0,0,0\n30,1,2\n", "latin-1"))[1] == pytest.approx([30, DEG, 2 * DEG])


def test_a_vertical_hole_needs_no_unit_and_a_first_station_below_the_surface_is_vertical(file):
    assert np.array_equal(read_survey(file("MD,INC,AZI\n0,0,0\n30,0,0\n")), [[0, 0, 0], [30, 0, 0]])
    assert read_survey(file("MD,INC,AZI\n100,0,40\n200,5,50\n")) == pytest.approx(
        np.array([[0, 0, 40 * DEG], [100, 0, 40 * DEG], [200, 5 * DEG, 50 * DEG]])
    )


@pytest.mark.parametrize(
    "text, said",
    [
        ("", "is empty, must have a header"),
        ("MD,INC,AZI\n", "has a header but no lines of numbers"),
        (
            "MD,AZI\n0,0\n",
            r"line 1: has no column for the inclination \(columns: MD, AZI\): must be called one of INCL",
        ),
        ("0,0\n1,1\n", "line 1: has numbers in 2 columns and no header: must name the columns measured depth, incl"),
        ("MD,INC,AZI\n0,0,0\n\n30,10,0\n30,12,0\n", "line 5, column MD = 30: must be more than 30 of the line above"),
        ("MD,INC,AZI\n0,0,0\n30,10,0\n20,12,0\n", "line 4, column MD = 20: must be more than 30"),
        ("MD,INC,AZI\n-1,0,0\n30,10,0\n", "line 2, column MD = -1: must not be negative"),
        ("MD,DEVI,AZI\n0,0,0\n30,190,0\n", "line 3, column DEVI = 190: must be >= 0 and < 180 deg"),
        ("MD,INC (rad),AZI\n0,0,0\n30,10,0\n", r"column INC \(rad\) = 10: must be >= 0 and < 3.142 rad"),
        ("MD,INC,AZI\n0,0,0\n30,-999.25,-999.25\n", "line 3, column INC = -999.25: must be >= 0"),
        ("MD,INC,AZI\n0,0,0\n30,10,400\n", "line 3, column AZI = 400: must be from -360 to 360 deg"),
        ("MD,INC,AZI\n0,0,0\n30,x,0\n", "line 3, column INC = 'x': must be a number"),
        ("MD,INC,AZI\n0,0,0\n30,nan,0\n", "line 3, column INC = 'nan': must be a number"),
        ("MD,INC,AZI\n0,0,0\n30,,0\n", "line 3, column INC = '': must be a number"),
        ("MD,INC,AZI\n0,0,0\n30,1\n", "line 3: has 2 columns, must have one for AZI"),
        (
            "MD,INC,AZI\n0,0,0\n30,1,2\n",
            r"may be degrees or radians: must name the unit in the header, such as 'INC \(d",
        ),
        (
            "MD,INC,AZI\n0,0,0\n30000,10,2\n",
            r"column MD = 30000: must be at most 16000 m, or name the unit .* 'MD \(ft\)'",
        ),
        ("MD (furlong),INC,AZI\n0,0,0\n", "column MD .furlong.: unit 'furlong' must be one of m, "),
        ("MD,INC,AZI\n100,5,0\n200,10,0\n", "line 2: the first station is at 100 m and inclined by 5 deg: must be at"),
        ("MD,INC,AZI\n0,0,0\n", "has one station, must have two or more"),
        ("\0\1", "is no text file"),
    ],
)
def test_one_clear_line_for_every_wrong_file(file, text, said):
    path = file(text)
    with pytest.raises(SceneError, match=said) as caught:
        read_survey(path)
    assert str(caught.value).startswith(f"survey {path}")
    assert "\n" not in str(caught.value)


def test_files_that_are_not_there(tmp_path):
    for path in (tmp_path, tmp_path / "none.csv", "a\0b"):
        with pytest.raises(SceneError, match="cannot be read"):
            read_survey(path)
    assert find("p11-a-02", tmp_path) != find("p11-a-02.csv", tmp_path) == tmp_path / "p11-a-02.csv"
    assert find(str(tmp_path / "x.csv"), tmp_path) == tmp_path / "x.csv"


def test_caliper_and_friction(file):
    rows = read_caliper(file("DEPT (ft),CALI (in)\n100,8.5\n101,9\n"))
    assert rows == pytest.approx(np.array([[30.48, 0.2159], [30.7848, 0.2286]]))
    with pytest.raises(SceneError, match=r"caliper .* CALI = 8.5: must be > 0 and at most 2 m; .* 'CALI \(in\)'"):
        read_caliper(file("DEPT,CALI\n100,8.5\n"))
    assert read_friction(file("MD,mu_s,mu_d\n0,0.3,0.2\n")) == pytest.approx(np.array([[0, 0.3, 0.2]]))
    assert read_friction(file("MD,friction\n0,0.3\n9,0.4\n"), 0.5) == pytest.approx(
        np.array([[0, 0.3, 0.15], [9, 0.4, 0.2]])
    )
    with pytest.raises(SceneError, match=r"line 2, column mu_d = 0.4: must be from 0 to the static coefficient 0.3"):
        read_friction(file("MD,mu_s,mu_d\n0,0.3,0.4\n"))


def test_names_of_files_in_a_scene_become_rows(tmp_path):
    (tmp_path / "well.csv").write_text("MD,INC,AZI\n0,0,0\n30,10,20\n")
    (tmp_path / "cal.csv").write_text("MD,CALI\n0,0.2\n30,0.3\n")
    (tmp_path / "mu.csv").write_text("MD,MU\n0,0.2\n30,0.4\n")
    data = {
        "title": "x",
        "hole": {"kind": "survey", "survey": "well.csv", "caliper": "cal.csv"},
        "contact": {"friction_static": 0.4, "friction_dynamic": 0.1, "friction_profile": "mu.csv"},
    }
    made = with_files(data, tmp_path)
    assert data["hole"]["survey"] == "well.csv"
    assert made["hole"]["survey"][1] == pytest.approx([30, 10 * DEG, 20 * DEG])
    assert made["hole"]["caliper"] == [[0, 0.2], [30, 0.3]]
    assert made["contact"]["friction_profile"] == [pytest.approx([0, 0.2, 0.05]), pytest.approx([30, 0.4, 0.1])]
    assert made["hole"]["kind"] == "survey" and made["title"] == "x"
    assert with_files(made, tmp_path) == made
    assert len(with_files({"hole": {"survey": "p11-a-02"}})["hole"]["survey"]) == 91
    assert with_files({"hole": 3, "contact": []}) == {"hole": 3, "contact": []}
    with pytest.raises(SceneError, match=r"hole.survey = 'p11': no such file, and no built-in survey: one of p11-a-02"):
        with_files({"hole": {"survey": "p11"}}, tmp_path)
    with pytest.raises(SceneError, match=r"caliper .*none.csv: cannot be read: No such file"):
        with_files({"hole": {"caliper": "none.csv"}}, tmp_path)


# -- minimum curvature ----------------------------------------------------------------------------------------------


def test_positions_are_those_of_the_libraries(real):
    stations, _ = real
    ours = Arcs(stations)
    # the arcs that we join end where the library puts the next station
    at = stations[1:, 0]
    i = np.arange(len(at))
    x = np.diff(stations[:, 0])[:, None]
    half = ours.turn[:, None] / 2
    end = ours.position[i] + x * np.sinc(half / np.pi) * (np.cos(half) * ours.tangent[i] + np.sin(half) * ours.normal)
    assert np.abs(end - minimum_curvature(stations)[1:]).max() < 1e-9
    assert np.abs(ours.frame(at)[0] - minimum_curvature(stations)[1:]).max() < 1e-9
    welleng = pytest.importorskip("welleng.survey")
    p, inclination, azimuth = stations.T
    east, north, down = np.array(welleng.MinCurve(p, inclination, azimuth).poss).T
    assert np.abs(np.stack([north, east, down], axis=1) - ours.position).max() < 1e-6


def test_without_the_library_the_message_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "wellpathpy", None)
    with pytest.raises(MissingDependency, match="pip install wellpathpy"):
        survey([[0, 0, 0], [100, 0.1, 0]], **WIDE)


def test_the_real_well(real):
    stations, hole = real
    assert "p11-a-02" in builtin_surveys()
    assert len(stations) == 91
    assert hole.length == stations[-1, 0] == 2691
    frame = hole.frame(hole.length)
    assert np.degrees(frame.inclination) == pytest.approx(89.66, abs=1e-6)
    assert np.degrees(frame.azimuth) == pytest.approx(319.61, abs=1e-6)
    # by minimum curvature: true vertical depth, north and east of the last station
    assert frame.position[0] == pytest.approx([873.317, -473.020, 1605.585], abs=0.01)
    assert math.degrees(hole.sharpest()[0]) * 30 == pytest.approx(6.567, abs=0.001)


# -- the smooth centreline ------------------------------------------------------------------------------------------


def test_curvature_does_not_jump_nor_exceed_that_of_the_arcs(real):
    stations, hole = real
    arcs = Arcs(stations)
    assert hole.sharpest()[0] <= arcs.curvature.max() * (1 + 1e-4)
    p = np.arange(0, hole.length, 0.01)
    frame = hole.frame(p)
    rate = np.linalg.norm(np.diff(frame.curvature, axis=0), axis=1) / 0.01
    vectors = arcs.curvature[:, None] * arcs.normal
    # the curvature vectors on both sides of a station, in the plane across its direction
    before = (
        vectors * np.cos(arcs.turn)[:, None] - arcs.curvature[:, None] * arcs.tangent[:-1] * np.sin(arcs.turn)[:, None]
    )
    step = np.linalg.norm(vectors[1:] - before[:-1], axis=1).max()
    assert rate.max() < 1.05 * step / TRANSITION
    # everywhere: no more than the sharpest arc within half a transition
    near = [arcs.curvature[np.clip(np.searchsorted(stations[:, 0], p + d) - 1, 0, 89)] for d in (-2.6, 0, 2.6)]
    assert np.all(frame.dogleg_severity <= np.max(near, axis=0) * (1 + 1e-4) + 1e-12)


def test_the_departure_from_minimum_curvature_is_small_and_of_second_order(real):
    stations, hole = real
    depth, near = departure(hole)
    assert near <= depth < 0.006
    found = [departure(survey(stations, w, **WIDE))[0] for w in (2.5, 5.0)]
    assert math.log2(found[1] / found[0]) == pytest.approx(2, abs=0.05)
    frame = hole.frame(stations[:, 0])
    cosine = np.einsum("ic,ic->i", frame.tangent, Arcs(stations).tangent)
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 0.15


def test_a_survey_of_one_arc_is_that_arc_and_its_ends_keep_their_direction():
    stations = np.array([[0, 0.2, 1.0], [100, 0.3, 1.0], [250, 0.45, 1.0]])
    hole = survey(stations, **WIDE)
    p = np.linspace(0, 250, 51)
    frame = hole.frame(p)
    assert np.allclose(frame.inclination, 0.2 + p / 1000, atol=1e-9)
    assert np.allclose(frame.dogleg_severity, 1e-3, atol=1e-9)
    assert departure(hole)[1] < 1e-9


def test_round_trip_through_the_stations_of_a_helix():
    """Stations every 10 m of a helix: the surveyed hole lies along it, nearer with nearer stations (second order)."""
    true, errors = helix(500, 100, 800, **WIDE), []
    for step in (20, 10):
        frame = true.frame(p := np.arange(0, 501, step))
        made = survey(np.stack([p, frame.inclination, frame.azimuth], axis=1), 1.0, **WIDE)
        at = np.linspace(0, 500, 200)
        errors.append(np.abs(made.frame(at).position - true.frame(at).position).max())
    assert errors[1] < 0.1
    assert math.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.2)


@pytest.mark.parametrize(
    "stations, transition, said",
    [
        ([[0, 0, 0]], 5, "must be two or more rows"),
        ([[10, 0, 0], [20, 0, 0]], 5, r"hole\.survey\.0: starts at a measured depth of 10 m, must start at 0"),
        ([[0, 0, 0], [20, 0, 0], [20, 0.1, 0]], 5, r"hole\.survey\.2: measured depth 20 m must be more than 20 m"),
        ([[0, 0.9, 0], [20, 0.9, 3.1]], 5, "turns by 10.* deg from 0 m to 20 m, must turn by at most 90 deg"),
        ([[0, 0, 0], [20, 0, 0]], 0, r"hole\.transition = 0: must be > 0 for a survey"),
    ],
)
def test_stations_that_make_no_hole(stations, transition, said):
    with pytest.raises(SceneError, match=said):
        survey(stations, transition, **WIDE)


def test_stations_nearer_than_the_transition():
    p = np.arange(0, 100, 1.5)
    stations = np.stack([p, 0.002 * p, 0.3 + 0.01 * np.sin(p)], axis=1)
    hole = survey(stations, **WIDE)
    assert hole.sharpest()[0] <= Arcs(stations).curvature.max()
    assert departure(hole)[0] < 0.02
