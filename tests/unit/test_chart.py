"""Charts: the exact wave, orders, the Pareto front, cost, pictures and numbers on disk."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from drillfem.chart import Chart, drilling
from drillfem.chart.draw import draw
from drillfem.chart.exact import ExactWave, Pulse
from drillfem.chart.points import Panel, Point, cpu_seconds, fit, normalise, pareto, reach
from drillfem.chart.report import main, rows


def wave(lengths=(1000.0, 200.0), speeds=(3000.0, 3000.0), impedances=(1.0, 4.26768)) -> ExactWave:
    return ExactWave(lengths, speeds, impedances, Pulse(500.0, 40.0))


# -- the exact wave ---------------------------------------------------------------------------------------------------


def test_step_of_impedance():
    """Field of waves 3.4: spin reflected and transmitted at the joint of pipe and collars, and the torque."""
    exact = wave()
    assert exact.reflection == pytest.approx(-0.62033, abs=1e-5)
    assert exact.transmission == pytest.approx(0.37967, abs=1e-5)
    assert exact.resultant_transmission == pytest.approx(1.62033, abs=1e-5)
    # the pulse passed the joint 0.2 s ago: 600 m back in the pipe, 600 m ahead in very long collars
    exact = wave(lengths=(1000.0, 5000.0))
    t = 500 / 3000 + 0.15
    s = np.array([1000.0 - 450.0, 1000.0 + 450.0])
    np.testing.assert_allclose(exact.speed(s, t), [exact.reflection, exact.transmission], rtol=1e-12)
    np.testing.assert_allclose(exact.resultant(s, t), [exact.reflection, -4.26768 * exact.transmission], rtol=1e-12)


@pytest.mark.parametrize("speeds", [(3000.0, 3000.0), (3100.0, 2900.0)])
def test_exact_wave_meets_its_conditions(speeds):
    """Ends, joint, equations of motion by differences, and energy, after many echoes; of delays that match or not."""
    exact = wave(speeds=speeds)
    top, bottom, joint = np.array([0.0]), np.array([1200.0]), np.array([1000.0 - 1e-9, 1000.0 + 1e-9])
    s = np.linspace(0, 1200, 12001)[:-1] + 0.05
    x, w = np.array([300.0, 950.0, 1100.0]), 1e-3

    def rate(f, what, step):
        return (f(what + step) - f(what - step)) / (2 * step)

    impedance = np.where(s < 1000, *exact.impedances)
    speed_of = np.where(s < 1000, *exact.wave_speeds)
    energies = []
    for t in (0.05, 0.4, 1.3, 3.0):
        assert abs(exact.speed(top, t)[0]) < 1e-12
        assert abs(exact.resultant(bottom, t)[0]) < 1e-12
        for field in (exact.speed, exact.resultant):
            assert np.ptp(field(joint, t)) < 1e-7
        c, z = (np.where(x < 1000, *pair) for pair in (exact.wave_speeds, exact.impedances))
        momentum = z / c * rate(lambda t: exact.speed(x, t), t, w / 3000) - rate(
            lambda x, t=t: exact.resultant(x, t), x, w
        )
        assert np.abs(momentum).max() < 1e-8
        square = impedance / speed_of * exact.speed(s, t) ** 2 + exact.resultant(s, t) ** 2 / impedance / speed_of
        energies.append(square.sum())
    np.testing.assert_allclose(energies, energies[0], rtol=1e-6)


def test_start_of_the_wave():
    exact = wave()
    s = np.linspace(0, 1200, 4801)
    angle, speed = exact.start(s)
    assert angle[0] == 0
    np.testing.assert_allclose(speed, exact.speed(s, 0.0), atol=1e-14)
    slope = np.gradient(angle, s, edge_order=2)
    np.testing.assert_allclose(slope * exact.impedances[0] * 3000, exact.resultant(s, 0.0), atol=1e-4)


# -- orders, front, cost ----------------------------------------------------------------------------------------------


def series(name, order, cost=1.0, sizes=(0.5, 0.25, 0.125, 0.0625, 0.03125), floor=0.0):
    return [Point(name, h, h**order + floor, {"x": h**order + floor}, cost / h, {"step": h}) for h in sizes]


def panel(*points: Point, floor=0.0) -> Panel:
    return Panel("p", "A panel", "step", "s", "error", "theory", tuple(points), floor)


def test_orders_are_fitted_where_they_hold():
    assert fit(series("a", 2)).order == pytest.approx(2, abs=1e-12)
    # what is coarse, and what the floor bends, stays out
    bent = fit(series("a", 3, floor=1e-5), floor=1e-5)
    assert bent.order == pytest.approx(3, abs=0.15) and bent.sizes == (0.03125, 0.25)
    assert fit(series("a", 3, floor=5e-5)).order < 2.7
    assert fit(series("a", 0)) is None
    assert fit(series("a", 1, sizes=(0.5, 0.25))) is None
    assert fit([replace(p, error=math.inf) for p in series("a", 2)]) is None


def test_front_is_not_dominated():
    rng = np.random.default_rng(1)
    points = [Point("a", 1.0, e, {}, c, {}) for e, c in rng.uniform(size=(200, 2))]
    front = pareto([*points, Point("a", 1.0, math.inf, {}, 1e-9, {})])
    for p in front:
        assert not any(q.cpu <= p.cpu and q.error < p.error for q in points)
    for p in points:  # and whoever is not on it is beaten, up to a per cent of accuracy
        assert any(q.cpu <= p.cpu and 0.99 * q.error <= p.error for q in front)
    assert [p.cpu for p in front] == sorted(p.cpu for p in front)


def test_cost_of_an_accuracy():
    points = series("a", 2)
    cpu, size = reach(points, 0.01)
    assert size == pytest.approx(0.1) and cpu == pytest.approx(10)
    assert reach(points, 1e-6) is None
    assert reach(points, 0.9) == (2.0, 0.5)


def test_cpu_seconds_count_work_and_not_waiting():
    import time

    calls = []
    cpu, result = cpu_seconds(lambda: calls.append(1) or time.sleep(0.03), repeat=2, prepare=lambda: calls.append(0))
    assert calls[:4] == [0, 1, 0, 1] and result is None
    assert cpu < 0.01
    one, two = normalise(), normalise()
    assert 0.3 < one / two < 3


def test_chart_on_disk(tmp_path):
    fast, slow = series("fast, a", 2), series("slow", 1, cost=3)
    slow[-1] = replace(slow[-1], error=math.inf, default=False)
    fast[2] = replace(fast[2], default=True)
    chart = Chart("waves", "A title", "a scene", [panel(*fast, *slow)], 0.5)
    again = Chart.read(chart.write(tmp_path / "chart.json"))
    assert again.panels == chart.panels and again.normaliser == 0.5
    data = json.loads((tmp_path / "chart.json").read_text())["panels"][0]
    assert data["points"][0]["cost"] == pytest.approx(2 * data["points"][0]["cpu_seconds"])
    assert [p["pareto"] for p in data["points"]] == [True] * 5 + [False] * 5
    assert data["points"][-1]["error"] is None
    assert data["fits"][0]["order"] == pytest.approx(2)
    assert draw(chart, tmp_path / "chart.png").stat().st_size > 20_000
    table = rows(chart, chart.panels[0])
    assert table[0][0] == "fast, a" and table[0][-1] == "5 of 5" and table[1][-1] == "never"


def test_unknown_case_is_refused_at_once(tmp_path, capsys):
    from drillfem.cli import main as command

    assert command(["chart", "lumped", "planetary", "--out", str(tmp_path / "x")]) == 2
    assert "'planetary': must be one of waves, lumped" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


# -- small charts -----------------------------------------------------------------------------------------------------


def check_front(panel: Panel) -> None:
    for p in panel.front:
        assert not any(q.cpu < p.cpu and q.error <= p.error for q in panel.points)
    assert panel.front


@pytest.mark.dolfinx
def test_waves():
    pytest.importorskip("dolfinx")
    from drillfem.chart import waves

    effort = waves.Effort((48, 3), (16, 32), 128, ("generalised-alpha, 0.9", "ARKIMEX, order 4"), 2, 1)
    chart = waves.chart(effort)
    assert chart.facts["torque transmitted at the joint"] == pytest.approx(1.62033, abs=1e-5)
    steps, modes, meshes = (chart.panel(name) for name in ("integrators", "modes", "meshes"))
    for p in chart.panels:
        check_front(p)
    assert steps.fits["generalised-alpha, 0.9"].order == pytest.approx(2, abs=0.1)
    assert steps.series["ARKIMEX, order 4"][-1].error < 1.5 * steps.floor < 2e-4
    assert modes.fits["trapezoidal modes"].order == pytest.approx(2, abs=0.05)
    # central differences: accurate inside their limit, nothing beyond it
    for p in modes.series["explicit modes"]:
        assert math.isfinite(p.error) == (p.size < chart.facts["explicit limit of the step (s)"])
    # the trapezoidal rule of PETSc and of the modes are one method
    problem = waves.Problem(16, 2)
    keys = {"integrator": "theta", "theta": 0.5}
    one, two = problem.petsc(1.5625e-3, keys, 1)[0], problem.modal(1.5625e-3, "trapezoidal", 1)[0]
    assert one["torque"] == pytest.approx(two["torque"], rel=1e-9)
    errors = {name: points[-1].error for name, points in meshes.series.items()}
    assert errors["degree 4"] < 5e-5 and errors["degree 1"] > 1000 * errors["degree 4"]


def test_lumped():
    effort = replace(drilling.QUICK["lumped"], horizon=1.0, repeat=1)
    chart = drilling.chart("lumped", effort)
    steps, surfaces = chart.panel("steps"), chart.panel("surfaces")
    for p in chart.panels:
        check_front(p)
    # the two common integrators are of second order; the exact one is nearer at every step
    exact, rule = steps.series["condensed, exact surface"], steps.series["condensed trapezoidal"]
    assert steps.fits["condensed trapezoidal"].order == pytest.approx(2, abs=0.1)
    assert steps.fits["condensed explicit"].order == pytest.approx(2, abs=0.1)
    assert all(one.error < two.error / 5 for one, two in zip(exact, rule, strict=True))
    assert exact[-1].error < 1e-4
    assert chart.facts["condensed: reference against itself at twice its step"] < 0.1 * exact[-1].error
    # an oracle that shares nothing with the engine converges to the same motion
    assert chart.facts["delay equation, finest, against the reference"] < 1e-3
    last = {name: points[-1].error for name, points in surfaces.series.items()}
    assert surfaces.fits["DG, degree 1"].order == pytest.approx(3, abs=0.5)
    assert last["DG, degree 2"] < last["DG, degree 1"] < last["upwind"]
    assert sum(p.default for p in steps.points) == sum(p.default for p in surfaces.points) == 1


def test_torsional():
    effort = replace(drilling.QUICK["torsional"], horizon=0.5, repeat=1, panels=("steps", "meshes"))
    chart = drilling.chart("torsional", replace(effort, steps=(0, 1, 2)))
    steps, meshes = chart.panels
    for p in chart.panels:
        check_front(p)
    # both engines converge, to each other but for the mesh
    for name in ("characteristics", "condensed, exact surface"):
        coarse, *_, last = steps.series[name]
        assert last.error < coarse.error / 5 and last.error < 1e-4
    assert steps.fits["characteristics"].order > 1.5
    assert steps.levels[0].error < 1e-3
    fine = {name: points[-1].error for name, points in meshes.series.items()}
    assert fine["degree 3"] < fine["degree 1"] / 3 and fine["degree 3"] < 1e-3


@pytest.mark.dolfinx
def test_axial_torsional():
    pytest.importorskip("dolfinx")
    effort = replace(drilling.QUICK["axial-torsional"], horizon=0.3, repeat=1, panels=("steps", "rungs"))
    chart = drilling.chart("axial-torsional", replace(effort, steps=(1, 2, 3), slow_steps=(1, 2)))
    steps, rungs = chart.panels
    for p in chart.panels:
        check_front(p)
    kept, full = steps.series["PETSc, kept Jacobian"], steps.series["PETSc, full Newton"]
    assert steps.fits["PETSc, kept Jacobian"].order == pytest.approx(2, abs=0.3)
    for one, two in zip(kept, full, strict=False):
        assert one.error == pytest.approx(two.error, rel=1e-2) and one.cpu < two.cpu
    # refused beyond its limit, and said so
    refused = chart.facts["refused: condensed explicit, step (s)"]
    assert all(p.size < refused for p in steps.series["condensed explicit"])
    # what the lower rungs leave out cannot be refined away
    for level, name in zip(rungs.levels, ("lumped", "torsional"), strict=True):
        errors = [p.error for p in rungs.series[name]]
        assert max(errors) < 1.2 * level.error and level.error > 100 * rungs.series["axial-torsional"][-1].error


def test_command(tmp_path, monkeypatch, capsys):
    small = replace(drilling.QUICK["lumped"], horizon=0.2, repeat=1, panels=("steps",))
    monkeypatch.setitem(drilling.QUICK, "lumped", small)
    main(["lumped"], tmp_path / "out", quick=True)
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["chart-lumped.json", "chart-lumped.png"]
    assert Chart.read(tmp_path / "out" / "chart-lumped.json").quick
    assert "condensed, exact surface" in capsys.readouterr().out


@pytest.mark.dolfinx
def test_off_bottom(tmp_path):
    pytest.importorskip("dolfinx")
    from drillfem.chart import off_bottom

    effort = replace(off_bottom.QUICK, horizon=0.2, laid=(100, 200), stiffness=(1e6,), panels=("laid",))
    # each march starts where the string was laid
    well = off_bottom.Well(effort, time__engine="petsc")
    rows, again = (well.march(step=1e-2)[0] for _ in range(2))
    for name in ("top torque", "side force"):
        assert len(rows[name]) == 10 and rows[name] == pytest.approx(again[name], rel=1e-9)
    # what lies in the inclined part rests on the wall, whatever the method
    assert well.stands().sum() == pytest.approx(240.7e3, rel=1e-3)
    chart = off_bottom.chart(effort)
    (laid,) = chart.panels
    check_front(laid)
    assert len(laid.points) == 2 and all(1e-3 < p.error < 0.05 for p in laid.points)
    assert draw(chart, tmp_path / "chart.png").stat().st_size > 20_000


@pytest.mark.slow
@pytest.mark.dolfinx
def test_off_bottom_over_steps():
    pytest.importorskip("dolfinx")
    from drillfem.chart import off_bottom

    chart = off_bottom.chart(replace(off_bottom.QUICK, panels=("steps",), dear_steps=(1e-2,)))
    series = chart.panel("steps").series
    at = {name: {p.size: p for p in points}[1e-2] for name, points in series.items()}
    same = [at[name] for name in ("compiled, gen-alpha 0.9", "compiled, full Newton", "PETSc, full Newton")]
    assert same[0].error == pytest.approx(same[1].error, rel=1e-3) == pytest.approx(same[2].error, rel=1e-3)
    assert same[0].cpu < same[2].cpu and chart.facts["steps: PETSc over compiled, CPU, least"] > 1
    for name in ("gen-alpha 0.9", "trapezoidal rule"):
        errors = [p.error for p in series[f"compiled, {name}"]]
        assert errors[0] > 2 * errors[-1] and errors[-1] < 0.02
