"""Chapter 7 with random friction: density of the power ratio, convergence, realisations (figures 7.4 and 7.5).

    python benchmarks/chapter_7_stochastic.py [A B]

A: an ensemble of horizontal-stochastic with `--keep bit_depth`, B: 1000 members of the same fields with the weight as
normal force, as these make them; else they are made here, on one process (an hour and a half):

    mpirun -n 2 drillfem ensemble horizontal-stochastic -n 10000 --seed 2023 --keep bit_depth --out A
    mpirun -n 2 drillfem ensemble horizontal-stochastic -n 1000 --seed 2023 --out B \
        --set contact.normal_force=weight --set contact.retardation_time=0

Writes docs/chapter-7-stochastic.md and docs/img/chapter-7-stochastic-*.png.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

import numpy as np
from common import DOCS, table

from drillfem.ensemble import drawing
from drillfem.ensemble.run import ensemble
from drillfem.ensemble.statistics import Statistics, needed, of
from drillfem.ensemble.store import read
from drillfem.render import style

SCENE, SEED, MEMBERS, BESIDE = "horizontal-stochastic", 2023, 10_000, 1000
QUANTITIES = ("power_ratio", "drilled_depth")
WEIGHT = {"contact.normal_force": "weight", "contact.retardation_time": 0.0}
STEMS = {"power_ratio": "power", "drilled_depth": "depth"}


def draw_beside(path: Path, a: Statistics, b: Statistics) -> None:
    with style.page(1000, 480) as figure:
        what = f"contact by penalty (A, {len(a.values)} members), weight as normal force (B, {len(b.values)} members)"
        style.heading(figure, "Density of the power ratio", what)
        axes = figure.add_axes((0.09, 0.13, 0.88, 0.69))
        for found, colour, label in ((a, style.BLUE, "A"), (b, style.VERMILION, "B")):
            if found.density is not None:
                axes.fill_between(found.density.points, found.density.low, found.density.high, color=colour, alpha=0.2)
                axes.plot(found.density.points, found.density.values, color=colour, lw=2, label=label)
        axes.set_xlabel("power ratio p_r")
        axes.set_ylabel("density")
        axes.set_ylim(bottom=0)
        axes.legend(loc="upper right")
        style.save(figure, path)


def numbers(found: Statistics) -> list[str]:
    scale, digits = (1e3, 4) if found.unit == "m" else (1.0, 5)

    def said(x: float) -> str:
        return f"{scale * x:.{digits}g}"

    cells = [f"{said(found.mean.value)} ± {scale * found.mean.error:.2g}"]
    deviation = found.standard_deviation
    cells.append(f"{said(deviation.value)} ({said(deviation.low)} to {said(deviation.high)})")
    cells += [f"{said(q.value)} ({said(q.low)} to {said(q.high)})" for q in found.quantiles.values()]
    bandwidth = "" if found.density is None else f"{scale * found.density.bandwidth:.2g}"
    return [*cells, bandwidth, f"{len(found.values)}, {len(found.failed)} failed"]


def share(found: Statistics, above: float) -> str:
    p = found.probability(above)
    return f"{100 * p.value:.2g} % ({100 * p.low:.2g} to {100 * p.high:.2g})"


def main() -> None:
    images = DOCS / "img"
    with tempfile.TemporaryDirectory() as scratch:
        if len(sys.argv) > 2:
            folder, weighed = Path(sys.argv[1]), Path(sys.argv[2])
        else:
            folder, weighed = Path(scratch) / "a", Path(scratch) / "b"
            ensemble(SCENE, MEMBERS, folder, seed=SEED, keep=["bit_depth"])
            ensemble(SCENE, BESIDE, weighed, seed=SEED, overrides=WEIGHT)
        data, other = read(folder), read(weighed)
        sessions = json.loads((folder / "ensemble.json").read_text())["sessions"]
    a = {name: of(data, name) for name in QUANTITIES}
    b = {name: of(other, name) for name in QUANTITIES}
    for name, found in a.items():
        drawing.pdf(images / f"chapter-7-stochastic-{STEMS[name]}.png", found)
    drawing.convergence(images / "chapter-7-stochastic-convergence.png", a["power_ratio"])
    depth = data["history_bit_depth"]
    values = depth.values[np.isfinite(depth.values).all(axis=1)].astype(np.float64)
    drawing.realisations(
        images / "chapter-7-stochastic-realisations.png", depth["time"].values, values, "displacement of the bit", "m"
    )
    draw_beside(images / "chapter-7-stochastic-cases.png", a["power_ratio"], b["power_ratio"])

    def rows(name: str) -> str:
        labels = [f"{100 * p:g} %" for p in a[name].quantiles]
        head = ["", "mean ± its standard error", "standard deviation", *labels, "bandwidth", "members"]
        return table(head, [["A", *numbers(a[name])], ["B", *numbers(b[name])]])

    x, y = a["power_ratio"], a["drilled_depth"]
    seconds = float(data["seconds"].sum())
    wall = sum(float(s.get("seconds", 0.0)) for s in sessions)
    ranks = max(int(s.get("ranks", 1)) for s in sessions)
    clips = int(data["clips"].sum())
    worst = float(np.nanmax(data["energy_balance_error"].values))
    resolved = {t: needed(x.values, t) for t in (0.05, 0.01, 0.001)}
    text = f"""# Chapter 7 with random friction

Written by `benchmarks/chapter_7_stochastic.py`. Scene `horizontal-stochastic`: case A of [chapter 7](chapter-7.md)
with friction as a [random field](random-fields.md) along the hole, mean 0.12, standard deviation 0.012, exponential
covariance over 10 m, 100 terms; {len(data["member"])} members of seed {SEED} by plain Monte Carlo. They took
{seconds / 3600:.2f} hours of processor time, {seconds / len(data["member"]):.2f} s each, and {wall / 60:.0f} minutes on
the clock, on {ranks} ranks that shared two cores with other work. {clips} random numbers were clipped at the support,
0 to 0.6, whose ends are 10 and 40 standard deviations away. Balance of energy: {worst:.1e} at worst.

```
mpirun -n 2 drillfem ensemble horizontal-stochastic -n 10000 --seed {SEED} --keep bit_depth --out rock
drillfem statistics rock
```

## Power ratio (figure 7.5)

p_r = p_out/p_in over the 10 s, with p_out the power that goes into the rock (spec of the power: [chapter
7](chapter-7.md)); with 95 % intervals.

{rows("power_ratio")}

![density](img/chapter-7-stochastic-power.png)

![A and B](img/chapter-7-stochastic-cases.png)

![convergence](img/chapter-7-stochastic-convergence.png)

The mean is known to 5 % with {resolved[0.05]} members, to 1 % with {resolved[0.01]}, to 0.1 % with {resolved[0.001]};
the thesis does not say how many it takes.

## Displacement (figure 7.4)

After 10 s, in mm:

{rows("drilled_depth")}

![realisations](img/chapter-7-stochastic-realisations.png)

![density of the displacement](img/chapter-7-stochastic-depth.png)

The bit passes 0.1 m in {share(y, 0.1)} of the members.

## Beside print

Print has figures only, and says: a density "very different" from that in the literature, where the weight is the
normal force (B), "showing a better performance". B here has the same fields, member by member. The mean power ratio of
A is {x.mean.value / b["power_ratio"].mean.value:.3f} times that of B, the mean displacement
{y.mean.value / b["drilled_depth"].mean.value:.2f} times. Both depend on the clearance, which is not printed, as in the
deterministic case.
"""
    (DOCS / "chapter-7-stochastic.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
