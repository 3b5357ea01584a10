"""Random fields on the hole: exact and Galerkin modes, how many terms, what samples are worth.

Writes docs/random-fields.md and its pictures in less than a minute of one core.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from common import DOCS, processor_seconds, table
from scipy import stats

from drillfem.ensemble import fields
from drillfem.ensemble.fields import Covariance, KarhunenLoeve, covariance, exact_modes, galerkin_modes
from drillfem.ensemble.inputs import Inputs
from drillfem.ensemble.sampling import Sampler
from drillfem.render import style
from drillfem.scene import load_scene

Array = npt.NDArray[np.float64]
LENGTH, B = 60.0, 10.0
EXPONENTIAL = covariance("exponential", 1.0, B)
COLOURS = (style.BLUE, style.VERMILION, style.GREEN, style.ORANGE, style.PURPLE)
FIELD = {
    "key": "contact.friction",
    "mean": 0.12,
    "standard_deviation": 0.012,
    "support": [0.0, 0.6],
    "correlation_length": B,
    "terms": 20,
    "length": LENGTH,
}
CONFIDENCE = 0.999


# -- modes ----------------------------------------------------------------------------------------------------------
def errors(terms: int, kernel: Covariance = EXPONENTIAL, **mesh: int) -> tuple[float, float]:
    """Largest relative error of Galerkin eigenvalues and eigenfunctions (of their largest value)."""
    exact, x = exact_modes(LENGTH, 1.0, B, terms=terms), np.linspace(0, LENGTH, 2401)
    found, shape = galerkin_modes(kernel, LENGTH, terms=terms, **mesh), exact(x)
    function = np.abs(found(x) - shape).max() / np.abs(shape).max()
    return float(np.abs(found.eigenvalues / exact.eigenvalues - 1).max()), float(function)


def naive_errors(terms: int, elements: int, degree: int) -> tuple[float, float]:
    """The same with Gauss points across the diagonal."""
    right = fields._pair_rules
    fields._pair_rules = lambda p: (right(p)[2],) * 3
    try:
        return errors(terms, elements=elements, degree=degree)
    finally:
        fields._pair_rules = right


MESHES = (8, 12, 16, 24, 32, 48, 64, 96)


def convergence() -> dict[str, Array]:
    """Errors (meshes, 2) of five modes by name; nan where round-off is reached."""
    found = {f"degree {p}": np.array([errors(5, elements=n, degree=p) for n in MESHES]) for p in (1, 2, 4)}
    found["degree 2, Gauss points across the diagonal"] = np.array([naive_errors(5, n, 2) for n in MESHES])
    return found


def order(error: Array) -> float:
    """Fitted order of the last meshes before round-off."""
    good = np.flatnonzero(error > 1e-12)[-4:]
    return float(-np.polyfit(np.log(np.array(MESHES)[good]), np.log(error[good]), 1)[0])


def draw_modes(path: Path) -> None:
    exact, galerkin = exact_modes(LENGTH, 1.0, B, terms=5), galerkin_modes(EXPONENTIAL, LENGTH, terms=5)
    x, dots = np.linspace(0, LENGTH, 601), np.linspace(1, LENGTH - 1, 30)
    with style.page(1000, 470) as figure:
        style.heading(
            figure,
            "Modes of the thesis' field",
            "exponential covariance, b = 10 m on 60 m; lines: exact, dots: Galerkin",
        )
        axes = figure.add_axes((0.07, 0.13, 0.76, 0.68))
        for k, colour in enumerate(COLOURS):
            scale = math.sqrt(exact.eigenvalues[k])
            axes.plot(x, scale * exact(x)[k], color=colour, label=f"{k + 1}: $\\lambda$ = {exact.eigenvalues[k]:.4f}")
            axes.plot(dots, scale * galerkin(dots)[k], "o", color=colour, ms=4)
        axes.set_xlabel("measured depth, m")
        axes.set_ylabel(r"$\sqrt{\lambda_k}\,\phi_k$")
        axes.set_xlim(0, LENGTH)
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        style.save(figure, path)


KINDS: dict[str, tuple[str, float | None]] = {
    "exponential": ("exponential", None),
    "Matérn, ν = 1.5": ("matern", 1.5),
    "Matérn, ν = 5": ("matern", 5.0),
    "squared exponential": ("squared-exponential", None),
}


def spectra() -> dict[str, tuple[Array, float]]:
    """Eigenvalues (n,) and whole variance per kind of covariance."""
    found = {}
    for name, (kind, nu) in KINDS.items():
        terms = 100 if kind == "exponential" else 60 if nu == 1.5 else 16
        modes = galerkin_modes(covariance(kind, 1.0, B, nu), LENGTH, terms=terms)
        found[name] = (np.asarray(modes.eigenvalues, dtype=np.float64), modes.variance)
    return found


def draw_spectra(path: Path, found: dict[str, tuple[Array, float]]) -> None:
    with style.page(1000, 470) as figure:
        style.heading(
            figure, "How many terms", "correlation length 10 m on 60 m: the smoother the field, the fewer it takes"
        )
        left, right = figure.add_axes((0.08, 0.13, 0.40, 0.66)), figure.add_axes((0.57, 0.13, 0.40, 0.66))
        for (name, (values, variance)), colour in zip(found.items(), COLOURS, strict=False):
            k = np.arange(1, len(values) + 1)
            left.loglog(k, values, "o-", ms=3, color=colour, label=name)
            right.loglog(k, np.maximum(1 - np.cumsum(values) / variance, 1e-12), "o-", ms=3, color=colour)
        left.set_ylim(1e-6, 50)
        right.set_ylim(1e-6, 1)
        left.set_title("eigenvalues, m")
        right.set_title("share of variance that is missing")
        for axes in (left, right):
            axes.set_xlabel("terms")
        left.legend(loc="lower left")
        style.save(figure, path)


def draw_convergence(path: Path, found: dict[str, Array]) -> None:
    with style.page(1000, 470) as figure:
        style.heading(figure, "Galerkin against exact", "five modes, b = 10 m on 60 m, elements of equal length")
        sides = figure.add_axes((0.08, 0.13, 0.40, 0.66)), figure.add_axes((0.57, 0.13, 0.40, 0.66))
        for axes, what, j in zip(sides, ("eigenvalues", "eigenfunctions"), (0, 1), strict=True):
            for (name, error), colour in zip(found.items(), COLOURS, strict=False):
                axes.loglog(MESHES, error[:, j], "o-", ms=4, color=colour, label=name)
            axes.axhline(1e-6, color=style.GREY, lw=1, ls="--")
            axes.set_title(f"largest relative error of {what}")
            axes.set_xlabel("elements")
            axes.set_xticks([10, 20, 50, 100], ["10", "20", "50", "100"])
        figure.legend(*sides[0].get_legend_handles_labels(), loc="upper right", ncols=2, fontsize=9)
        style.save(figure, path)


# -- samples --------------------------------------------------------------------------------------------------------
def samples(terms: int, count: int, points: Array, seed: int = 1) -> Array:
    """Members 0 to count of the thesis' field (count, points), and their clips, from their own streams."""
    field = KarhunenLoeve(0.12, exact_modes(LENGTH, 0.012, B, terms=terms), (0.0, 0.6))
    scaled, sampler = field.scaled(points), Sampler("monte-carlo", terms, seed)
    normal = stats.norm.ppf([sampler.member(i) for i in range(count)])
    drawn = [field.sum(scaled, z) for z in normal]
    assert sum(clips for _, clips in drawn) == 0
    return np.array([values for values, _ in drawn])


AT = np.linspace(0, LENGTH, 9)


def departures(terms: int, count: int) -> dict[str, float]:
    """Largest difference of sampled covariances at nine depths from the exact ones, and from the terms', in standard
    errors; mean known."""
    away = samples(terms, count, AT) - 0.12
    sampled = away.T @ away / count
    exact = 0.012**2 * EXPONENTIAL(AT[:, None], AT[None, :])
    own = KarhunenLoeve(0.0, exact_modes(LENGTH, 0.012, B, terms=terms)).covariance(AT)
    return {
        name: float((np.abs(sampled - c) / np.sqrt((np.outer(np.diag(c), np.diag(c)) + c**2) / count)).max())
        for name, c in (("exact", exact), ("own", own))
    }


def draw_samples(path: Path, count: int) -> None:
    x = np.linspace(0, LENGTH, 321)
    few = samples(20, 5, x)
    many = samples(100, count, np.linspace(0, LENGTH, 61)) - 0.12
    lags = np.arange(0, 41)
    start = 10  # from a depth of 10 m on
    found = many[:, start, None] * many[:, start + lags]
    sampled = found.mean(axis=0) / 0.012**2
    exact = np.exp(-lags / B)
    half = stats.norm.isf((1 - CONFIDENCE) / 2 / len(lags)) * np.sqrt((1 + exact**2) / count)
    with style.page(1000, 470) as figure:
        style.heading(
            figure,
            "Friction that nobody knows exactly",
            f"left: five members, 20 terms, and ±2 standard deviations; right: {count} members, 100 terms",
        )
        left, right = figure.add_axes((0.08, 0.13, 0.48, 0.66)), figure.add_axes((0.65, 0.13, 0.32, 0.66))
        band = 2 * np.sqrt(np.diag(KarhunenLoeve(0.0, exact_modes(LENGTH, 0.012, B, terms=20)).covariance(x)))
        left.fill_between(x, 0.12 - band, 0.12 + band, color=style.FAINT, lw=0)
        for values, colour in zip(few, COLOURS, strict=True):
            left.plot(x, values, color=colour)
        left.set_xlim(0, LENGTH)
        left.set_title("friction coefficient")
        left.set_xlabel("measured depth, m")
        right.fill_between(lags, exact - half, exact + half, color=style.FAINT, lw=0, label="99.9 % of all sets")
        right.plot(lags, exact, color=style.INK, label="exact")
        right.plot(lags, sampled, "o", ms=4, color=style.BLUE, label="sampled")
        right.set_title("correlation with that at 10 m")
        right.set_xlabel("distance, m")
        right.legend()
        style.save(figure, path)


def interpolation(terms: int) -> float:
    """Standard deviation of the error of a member's table half way between its rows, of a field of deviation 1."""
    field = KarhunenLoeve(0.0, exact_modes(LENGTH, 1.0, B, terms=terms))
    x = np.linspace(0, LENGTH, 1 + round(LENGTH / field.spacing))
    scaled, middle = field.scaled(x), field.scaled((x[1:] + x[:-1]) / 2)
    return float(np.sqrt((((scaled[:, 1:] + scaled[:, :-1]) / 2 - middle) ** 2).sum(axis=0)).max())


# -- page -----------------------------------------------------------------------------------------------------------
def power(value: float) -> str:
    """1.3e-7."""
    mantissa, exponent = f"{value:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def main() -> None:
    img = DOCS / "img"
    exact = exact_modes(LENGTH, 1.0, B, terms=100)
    found = convergence()
    spectrum = spectra()
    draw_modes(img / "random-modes.png")
    draw_spectra(img / "random-spectra.png", spectrum)
    draw_convergence(img / "random-galerkin.png", found)
    draw_samples(img / "random-samples.png", 5000)

    captured = table(
        ["terms", "exact", "Galerkin"],
        [
            [
                str(n),
                f"{100 * exact.captured[n - 1]:.2f} %",
                f"{100 * np.cumsum(spectrum['exponential'][0])[n - 1] / LENGTH:.2f} %",
            ]
            for n in (10, 20, 50, 100)
        ],
    )
    agreement, cost = [], []
    for n in (5, 20, 100):
        value, function = errors(n)
        agreement.append([str(n), power(value), power(function)])
        cost.append(
            [
                str(n),
                f"{1e3 * processor_seconds(lambda n=n: exact_modes(LENGTH, 1.0, B, terms=n)):.2f} ms",
                f"{processor_seconds(lambda n=n: galerkin_modes(EXPONENTIAL, LENGTH, terms=n), 2):.2g} s",
            ]
        )
    orders = table(
        ["", "eigenvalues", "eigenfunctions"],
        [[name, f"{order(e[:, 0]):.2f}", f"{order(e[:, 1]):.2f}"] for name, e in found.items()],
    )
    smooth = []
    for nu in (0.3, 0.5, 1.5, 5.0):
        kernel = covariance("matern", 1.0, B, nu)
        x = np.linspace(0, LENGTH, 601)
        coarse, fine = (galerkin_modes(kernel, LENGTH, terms=20, elements=n) for n in (None, 200))
        assert coarse.terms == fine.terms
        value = float(np.abs(coarse.eigenvalues / fine.eigenvalues - 1).max())
        smooth.append(
            [f"{nu:g}", power(value), power(float(np.abs(coarse(x) / fine(x).max() - fine(x) / fine(x).max()).max()))]
        )
    limit = stats.norm.isf((1 - CONFIDENCE) / 2 / 45)
    checks = []
    for terms, count in ((100, 2000), (100, 20000), (20, 20000)):
        away = departures(terms, count)
        cells = [f"{v:.2f}{'' if v < limit else ' (no)'}" for v in (away["exact"], away["own"])]
        checks.append([f"{terms} terms, {count} members", *cells])
    friction = {"contact.friction_static": None, "contact.friction_dynamic": None, "random.friction": FIELD}
    scene = load_scene("vertical-c1-cd4", {**friction, "model": "lumped"})
    inputs = Inputs.of(scene)
    sampler = Sampler("monte-carlo", inputs.dimension, 1)
    numbers: dict[str, Any] = {
        "eigenvalues": ", ".join(f"{x:.4f}" for x in exact.eigenvalues[:5]),
        "captured": captured,
        "agreement": table(["terms", "eigenvalues", "eigenfunctions"], agreement),
        "orders": orders,
        "naive": power(naive_errors(20, 25, 8)[0]),
        "smooth": table(["ν", "eigenvalues", "eigenfunctions"], smooth),
        "cost": table(["terms", "exact", "Galerkin"], cost),
        "limit": f"{limit:.2f}",
        "checks": table(["", "from the exact covariance", "from that of the terms"], checks),
        "interpolation": ", ".join(f"{power(interpolation(n))} for {n}" for n in (5, 20, 100)),
        "member": f"{1e3 * processor_seconds(lambda: inputs.member(sampler.member(3))):.1f}",
        "degree": str(fields.DEGREE),
        "elements": f"{fields.ELEMENTS:g}",
        "round_off": power(fields.ROUND_OFF),
        "most": str(int(fields.LARGEST / fields.DEGREE / fields.ELEMENTS)),
    }
    text = TEXT
    for name, value in numbers.items():
        text = text.replace("{" + name + "}", value)
    (DOCS / "random-fields.md").write_text(text)


TEXT = """# Random fields and inputs

Rock is not known exactly. A scene may say so: any of its numbers can be random, and friction can be a random field
along the hole. What follows from many such scenes is an ensemble; this page is about one of its members. Numbers and
pictures are written by `python benchmarks/random_fields.py`.

## In a scene

```toml
[random.friction]                  # the name is yours; any number of such tables, independent of each other
key = "contact.friction"           # mu_s and mu_d together; also contact.friction_static, contact.friction_dynamic
mean = 0.12
standard_deviation = 0.012
support = [0.0, 0.6]               # what is beyond is clipped, and counted
covariance = "exponential"         # squared-exponential, matern (with smoothness), or "module:function"
correlation_length = "10 m"
terms = 20                         # or captured_variance = 0.95 (the default)
length = "60 m"                    # from the top of the hole

[random.weight]
key = "top_drive.weight_on_bit"    # any number of the scene
distribution = "norm"              # a name of scipy.stats, with its parameters
parameters = { loc = "45 kN", scale = "2 kN" }

[random.rock]
key = "rock.intrinsic_specific_energy"
distribution = "lognorm"
parameters = { s = 0.1, scale = "0.25 GPa" }
proportional = ["rock.contact_strength", "rock.contact_strength_stalled"]   # these keep their ratio to it
```

`mean`, `standard_deviation`, `support` and the `loc` and `scale` of a distribution have the unit of the key; shape
parameters are pure numbers. A whole number (`bit.blades`) takes a discrete distribution. All keys are in
[scene-format.md](scene-format.md#randomname).

Such a scene is valid by itself: it stands for its means, and `drillfem run` says that it runs at them. The random keys
are left out of the other tables (or have the value of the mean).

In Python:

```python
from drillfem.ensemble.inputs import Inputs
from drillfem.ensemble.sampling import Sampler

inputs = Inputs.of(scene)
sampler = Sampler("monte-carlo", inputs.dimension, seed=1)
member = inputs.member(sampler.member(17))  # scene, scalars, fields, clips
Path("member.toml").write_text(member.scene.to_toml())
```

`member.scene` is a plain scene without randomness: the file can be run, rendered and sent to somebody. A field
becomes rows of `contact.friction_profile`. `member.clips` counts the values that lay outside their support, and, where
the two coefficients are fields of their own, those of the dynamic one that had to be cut down to the static one. All
members have the model that the scene has at its means.

Member i comes from numbers between 0 and 1, through the inverse of each distribution, so that any way of sampling
works:

- `monte-carlo`: a stream of its own from `SeedSequence(seed, spawn_key=(i,))`. Member i is the same bit for bit on
  any number of processes and in any order.
- `sobol` (scrambled) and `latin-hypercube`: row i of a set that is fixed by the seed (and by the number of members for
  the latter). The first coordinates of such sets are the best: they go to the scalars, then to the terms of fields from
  the greatest share of variance down.

`Inputs` can be pickled, modes and all: one process computes the modes and hands them to the others.

## On the hole

The field is a function of measured depth: a string that slides takes other rock with every metre. It covers the
string and twice what it gains in the run, by its block speed or by steady drilling at the means; `length` says
otherwise. Below its end it goes on as it ends. How far a string slides that is pushed by a force is not known
beforehand; then the field covers the string at its start (chapter 7: 60 m).

A member's table has 16 rows per term and is linear in between. Error of that half way between rows, as standard
deviation of a field of deviation 1, by number of terms: {interpolation}.

## Exact modes

The field is μ + Σ √λ_k Z_k φ_k with independent standard normal Z_k (Karhunen-Loève). For exp(−d/b) on [0, L] the
eigenfunctions are cosines and sines about the middle. With θ = wL/2 and κ = L/2b, both equations of the thesis,
θ tan θ = κ and tan θ = −θ/κ, read

    θ + arctan(θ/κ) = (k + 1) π/2,    k = 0, 1, 2 ...

even k for the cosines, odd k for the sines. The left side rises with θ, so there is exactly one root for each k,
between kπ/2 and (k + 1)π/2: none can be missed, and eigenvalues λ = 2σ²b/(1 + w²b²) come out in order. It is concave
as well, so Newton's method from the left end of the bracket never passes the root.

For σ = 1, L = 60 m, b = 10 m: λ = {eigenvalues} m.

![modes](img/random-modes.png)

{captured}

The truncation to [0, 0.6] at mean 0.12 and deviation 0.012 is ten deviations away: of the members drawn for this page,
none was clipped anywhere.

## Galerkin modes

Any other covariance: C φ = λ M φ in Lagrange elements of degree {degree} on an interval mesh (DOLFINx), the largest
eigenvalues by SLEPc. A covariance is smooth in the distance, but not across 0: Gauss points on the square of a
pair of elements do not see the kink (relative error of 20 eigenvalues: {naive}). So the squares of an element with
itself and with its neighbour are cut along lines of constant distance r; in r = t⁴ any power of r is harmless.
{elements} elements per half wave of the last term are used. Against the exact modes, b = 10 m on 60 m, largest
relative error:

{agreement}

![convergence](img/random-galerkin.png)

Fitted orders on even meshes, five modes (theory: twice degree + 1, and degree + 1):

{orders}

Matérn's covariance (SciPy's K_ν; for ν > 50 Debye's expansion, for K_ν is then beyond all numbers of a computer) is
rough at small ν: eigenfunctions then have singular slopes at the ends, and converge slower there. 20 terms, relative
to 200 elements:

{smooth}

![spectra](img/random-spectra.png)

Your own covariance is a function in a module that Python finds (the current folder counts), of the distance or of two
depths, arrays in m, in units of `standard_deviation` squared:

```python
def layers(x, y):  # covariance = "my_rock:layers"
    return np.exp(-np.abs(x - y) / (5 + 0.01 * (x + y)))
```

It has to be symmetric and positive definite, and is refused with one line if it is not. Smooth fields have few
eigenvalues above round-off ({round_off} of the largest); asking for more terms ends in a line that says how many there
are. Galerkin matrices are full: {most} terms at most.

Processor time for the modes, once per ensemble:

{cost}

A member of a straight scene with this field takes {member} ms, most of it to check the scene.

## Are the samples right?

Covariances between nine depths, 45 in all, from members of the ensemble, the mean known. Each has a standard error of
√((C_ii C_jj + C_ij²)/N). At 99.9 % confidence none of 45 is off by more than {limit} of its standard errors
(Bonferroni):

{checks}

With enough members one sees the variance that the terms leave out: 20 terms have 94 % of it. That is the last
line, and why the number of terms belongs to the answer.

![samples](img/random-samples.png)
"""


if __name__ == "__main__":
    main()
