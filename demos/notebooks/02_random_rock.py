# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Random rock, and how many strings are enough
#
# Sixty metres of pipe lie in a horizontal hole. The pipes behind push them, a motor shakes them, and at the
# end the bit presses on the rock. How much of the power that is put in reaches the bit? That is the question
# of chapter 7 of the thesis that this project follows (PUC-Rio, 2023). The answer hangs on the friction
# between pipe and rock, and nobody has measured that at every metre.
#
# So we do what one does with dice. We say how likely each rock is, draw some, run the string in each, and
# look at the answers. Three questions arise. How does one draw a *function*, the friction along a hole? What
# do the answers say about the rocks that were not drawn? And when may one stop?
#
# You need a little linear algebra and the word *standard deviation*. Every claim below is guarded by an
# assertion. The last section is an exercise with its solution.

# %%
import matplotlib.pyplot as plt
import numpy as np

from drillfem.ensemble import statistics
from drillfem.ensemble.fields import KarhunenLoeve, exact_modes
from drillfem.ensemble.inputs import Inputs
from drillfem.ensemble.member import Worker
from drillfem.ensemble.sampling import Sampler
from drillfem.render import style
from drillfem.scene import load_scene

plt.rcParams.update(style.RC)
chance = np.random.default_rng(7)

# %% [markdown]
# ## 1. What is a random function?
#
# Friction at one place is a number with a mean $\mu$ and a standard deviation $\sigma$. Friction along a hole
# is one such number for every depth $x$. The numbers are not independent: rock a hand's breadth further on is
# nearly the same rock. Chapter 7 says how alike, by the *covariance* of two places,
#
# $$ C(x, y) = \sigma^2 e^{-|x - y|/b}. $$
#
# Ten metres apart, with $b = 10$ m, a third of the likeness is left. Take many points, write the covariance of
# each pair into a matrix, and you can draw samples: a Cholesky factor turns independent numbers into alike
# ones. Watch what the *correlation length* $b$ does.

# %%
mu, sigma, L, b = 0.12, 0.012, 60.0, 10.0
x = np.linspace(0, L, 241)


def covariance(x, y, b=b):
    return sigma**2 * np.exp(-np.abs(x[:, None] - y[None, :]) / b)


figure, panels = plt.subplots(1, 3, figsize=(10, 3.2), sharey=True)
for axes, length in zip(panels, (0.5, 10.0, 200.0), strict=True):
    factor = np.linalg.cholesky(covariance(x, x, length))
    for colour in (style.BLUE, style.VERMILION, style.GREEN):
        axes.plot(x, mu + factor @ chance.standard_normal(len(x)), color=colour, lw=1)
    axes.set_title(f"b = {length:g} m")
    axes.set_xlabel("measured depth, m")
panels[0].set_ylabel("friction")
figure.tight_layout()
plt.show()

# %% [markdown]
# On the left every half metre is rolled anew, and the string will feel the mean of them. On the right a hole
# has one friction, high or low. The rock of chapter 7 is in the middle, and that is the hard case.
#
# ## 2. The best few numbers: Karhunen and Loève
#
# The samples above took 241 random numbers each. They need not. The covariance matrix is symmetric, so it has
# orthogonal eigenvectors. Along these the random function has independent parts. Most of the variance is in a
# few of them. For functions instead of vectors this is the expansion of Karhunen and Loève,
#
# $$ k(x) = \mu + \sum_j \sqrt{\lambda_j}\, Z_j\, \varphi_j(x), \qquad
#    \int_0^L C(x, y)\, \varphi_j(y)\, \mathrm{d}y = \lambda_j\, \varphi_j(x), $$
#
# with independent standard normal numbers $Z_j$. Let us find the eigenvalues by hand: cut the hole into $n$
# equal cells, and the integral becomes a sum over the midpoints.

# %%
n = 1500
h = L / n
middle = (np.arange(n) + 0.5) * h
by_hand = np.linalg.eigvalsh(covariance(middle, middle) / sigma**2 * h)[::-1]

modes = exact_modes(L, 1.0, b, terms=100)  # what the package takes
print("by hand", by_hand[:5].round(4))
print("exact  ", modes.eigenvalues[:5].round(4))
assert np.allclose(modes.eigenvalues[:5], [17.2712, 11.9759, 7.6574, 4.9473, 3.3369], atol=5e-5)
assert np.allclose(by_hand[:5], modes.eigenvalues[:5], rtol=1e-4)

# %% [markdown]
# For this covariance the eigenfunctions are sines and cosines, and the package knows them exactly. For any
# other it solves the eigenproblem with finite elements. The first eigenfunction is the whole hole being a
# little rougher or smoother. The next ones add waves, shorter and shorter, with less and less weight.
#
# How many terms? The eigenvalues add up to the whole variance, here $L\sigma^2$. So count how much you have.

# %%
captured = modes.captured
for terms in (1, 5, 10, 20, 100):
    print(f"{terms:3d} terms have {100 * captured[terms - 1]:5.1f} % of the variance")
assert np.allclose(captured[[9, 19, 99]], [0.875, 0.938, 0.988], atol=5e-4)

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), width_ratios=(1, 1.3))
for j, colour in enumerate((style.BLUE, style.VERMILION, style.GREEN, style.ORANGE)):
    left.plot(x, np.sqrt(modes.eigenvalues[j]) * modes(x)[j], color=colour, label=f"{j + 1}")
left.set_title(r"$\sqrt{\lambda_j}\,\varphi_j$, first four")
left.legend(ncols=4, loc="lower center", fontsize=9)
Z = chance.standard_normal(100)
for terms, colour in ((3, style.SKY), (20, style.BLUE), (100, style.INK)):
    few = KarhunenLoeve(mu, exact_modes(L, sigma, b, terms=terms))
    right.plot(x, few.at(x, Z[:terms])[0], color=colour, lw=1.2, label=f"{terms} terms")
right.set_title("the same rock, with more and more terms")
right.legend(fontsize=9)
for axes in (left, right):
    axes.set_xlabel("measured depth, m")
figure.tight_layout()
plt.show()

# %% [markdown]
# A rock is now a short list of numbers. That is worth more than the memory saved. The same list gives the same
# rock on any computer, and the most important numbers come first.
#
# Are these the right rocks? Draw many and measure the covariance. It is itself uncertain: from $N$ samples, by
# $\sqrt{(C_{xx}C_{yy} + C_{xy}^2)/N}$. "It looks right" is no test; "it differs by two standard errors" is.

# %%
field, at, N = KarhunenLoeve(mu, exact_modes(L, sigma, b, terms=100)), np.linspace(5, 55, 6), 4000
drawn = field.scaled(at).T @ chance.standard_normal((100, N))
C = field.covariance(at)
error = np.sqrt((np.outer(np.diag(C), np.diag(C)) + C**2) / N)
off = np.abs(drawn @ drawn.T / N - C) / error
print("off by so many standard errors:\n", off.round(1))
assert off.max() < 4

# %% [markdown]
# ## 3. A small ensemble
#
# The scene `horizontal-stochastic` is the string of chapter 7. Its file names what is random:
#
#     [random.friction]
#     key = "contact.friction"
#     mean = 0.12
#     standard_deviation = 0.012
#     correlation_length = "10 m"
#
# We run one second of it on a coarse mesh, so that this notebook stays quick. `Inputs` makes the scene of a
# *member* from numbers between 0 and 1, and `Sampler` gives these numbers. Member 17 has the same rock always,
# whoever computes it, alone or among a million. On a cluster this is one command, `mpirun -n 64 drillfem
# ensemble horizontal-stochastic -n 100000 --out rocks`.

# %%
quick = {"time.end": "1 s", "time.step": "4 ms", "output.interval": "20 ms", "mesh.elements": 8}
inputs = Inputs.of(load_scene("horizontal-stochastic", quick))
sampler = Sampler("monte-carlo", inputs.dimension, seed=1)
worker = Worker()  # keeps mesh and kernels from member to member
members = [inputs.member(sampler.member(i)) for i in range(60)]
ratio = np.array([worker.run(member.scene)["power_ratio"] for member in members])
again = worker.run(inputs.member(sampler.member(17)).scene)["power_ratio"]
assert again == ratio[17]  # to the last bit
print(f"{len(ratio)} strings: the bit gets from {100 * ratio.min():.1f} to {100 * ratio.max():.1f} % of the power")

# %% [markdown]
# Where does the difference come from? Compare each string's answer with the friction under it.

# %%
friction = np.array([np.interp(x, *member.fields["friction"].T) for member in members])
along = friction.mean(axis=1)
correlation = np.corrcoef(along, ratio)[0, 1]
print(f"correlation with the mean friction of the hole: {correlation:.2f}")
assert correlation < -0.5

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6))
order = np.argsort(ratio)
for i, colour in ((order[0], style.VERMILION), (order[-1], style.BLUE)):
    left.plot(x, friction[i], color=colour, label=f"power ratio {ratio[i]:.3f}")
left.set(xlabel="measured depth, m", title="worst and best rock", ylabel="friction")
left.legend(fontsize=9)
right.plot(along, ratio, "o", ms=4, color=style.BLUE)
right.set(xlabel="mean friction of the hole", ylabel="power ratio", title="each string is a dot")
figure.tight_layout()
plt.show()

# %% [markdown]
# ## 4. What do 60 strings say about all the others?
#
# The mean of 60 answers is not the mean. It is a random number itself: another 60 rocks would give another.
# Its standard deviation is the *standard error*, $s/\sqrt N$, where $s$ is that of the answers. An interval of
# about two standard errors to either side holds the true mean in 95 of 100 ensembles.

# %%
mean, deviation = statistics.mean(ratio), statistics.standard_deviation(ratio)
print("mean               ", mean)
print("standard deviation ", deviation)
for share in (0.05, 0.5, 0.95):
    print(f"{100 * share:3.0f} % quantile     ", statistics.quantile(ratio, share))
assert np.isclose(mean.error, ratio.std(ddof=1) / np.sqrt(len(ratio)))

# %% [markdown]
# Quantiles need no formula for the error, only counting. How many of $N$ answers lie below the true median? It
# is like throwing a coin $N$ times. So the median lies between two of the *sorted* answers, whose ranks come
# from the coin. This holds for any distribution. For the 5 % quantile one needs enough answers below it. With 60
# strings there may be none, and then the honest lower end is minus infinity.
#
# Let us test the promise of the interval with numbers whose median is known. We draw a thousand ensembles of 60.

# %%
held = [
    found.low <= 1.0 <= found.high
    for found in (statistics.quantile(chance.lognormal(size=60), 0.5) for _ in range(1000))
]
print(f"the interval holds the true median in {100 * np.mean(held):.1f} % of 1000 ensembles")
assert 0.93 < np.mean(held) < 0.985

# %% [markdown]
# A picture of all answers is the *density*. Each answer becomes a small hill, and the hills are added. How wide?
# Narrow hills show every accident, wide ones hide what is there. The package chooses a width, prints it, and
# draws half the width as well. Believe what both curves show.

# %%
pdf = statistics.density(ratio, support=(0, 1))
assert np.isclose(np.trapezoid(pdf.values, pdf.points), 1, atol=1e-3)

figure, axes = plt.subplots(figsize=(7, 3.6))
axes.fill_between(pdf.points, pdf.low, pdf.high, color=style.SKY, alpha=0.4, lw=0, label="95 % band")
axes.plot(pdf.points, pdf.rough, color=style.GREY, lw=0.8, ls="--", label="half the width")
axes.plot(pdf.points, pdf.values, color=style.BLUE, lw=2, label=f"width {pdf.bandwidth:.2g}")
axes.plot(ratio, np.full(len(ratio), -0.03 * pdf.high.max()), "|", color=style.GREY)
axes.set(xlabel="power ratio", ylabel="density")
axes.legend(fontsize=9)
plt.show()

# %% [markdown]
# ## 5. How many are enough?
#
# Enough for what? Say how well you want to know the mean: to one half of a percent, perhaps. The standard error
# falls with $\sqrt N$. Ten times as exact takes a hundred times as many strings. From the spread of a few
# strings one knows how many it will take.

# %%
for tolerance in (0.02, 0.005, 0.001):
    wanted = statistics.needed(ratio, tolerance)
    enough = "enough" if statistics.converged(ratio, tolerance) else "not enough"
    print(f"mean to {100 * tolerance:.1f} %: {wanted} strings; {len(ratio)} are {enough}")
relative = ratio.std(ddof=1) / ratio.mean()
exact = max((1.96 * relative / 0.001) ** 2, statistics.LEAST)
assert np.isclose(statistics.needed(ratio, 0.001), exact, rtol=0.01)

band = statistics.running(ratio)
figure, axes = plt.subplots(figsize=(8, 3.6))
shown = slice(4, None)
axes.fill_between(
    band.count[shown],
    band.always_low[shown],
    band.always_high[shown],
    color=style.FAINT,
    lw=0,
    label="at all N at once",
)
axes.fill_between(
    band.count[shown], band.low[shown], band.high[shown], color=style.SKY, alpha=0.5, lw=0, label="at each N"
)
axes.plot(band.count[shown], band.mean[shown], color=style.BLUE, label="running mean")
axes.set(xlabel="strings N", ylabel="power ratio", xlim=(5, len(ratio)))
axes.legend(fontsize=9, ncols=3)
plt.show()

# %% [markdown]
# Why two bands? The narrow one is right if you look *once*, at an $N$ that you chose beforehand. You may also stop
# when it is narrow enough. But who looks after every string, and stops when the *number* pleases, looks many
# times, and will be fooled more often. The wide band holds at all $N$ at once. Here is the proof, with a thousand
# games whose mean is 0.

# %%
games = [statistics.running(chance.standard_normal(400)) for _ in range(1000)]
fooled = np.mean([(np.abs(g.mean) > g.high - g.mean)[29:].any() for g in games])
never = np.mean([(np.abs(g.mean) > g.always_high - g.mean)[29:].any() for g in games])
print(f"0 has left the narrow band at some N in {100 * fooled:.0f} % of the games, the wide one in {100 * never:.0f} %")
assert fooled > 0.15 and never < 0.07

# %% [markdown]
# ## 6. Your turn: better than dice
#
# Dice leave gaps and make heaps. The points of a *Sobol' set* fill the cube evenly, and the mean of a smooth
# function converges nearly like $1/N$. The catch: these points are not independent, so $s/\sqrt N$ is no longer
# their error. The way out is to scramble the set at random, several times, and to look how the means differ.
#
# **Exercise.** Take the function below, of five inputs with the exact mean 1. Find the error of its mean with
# 256 points, by chance and by Sobol' points, from 20 scrambled sets each: `Sampler(method, 5, seed=r,
# count=256)`, with `method` `"monte-carlo"` or `"sobol"`. How many points would chance need for what Sobol' does
# with 256?


# %%
def f(u):
    return np.prod(1 + (u - 0.5) / np.arange(1, 6), axis=1)


your_errors = {}  # your answer: {"monte-carlo": ..., "sobol": ...}

# %% [markdown]
# **Solution.**

# %%
errors = {}
for method in ("monte-carlo", "sobol"):
    samplers = [Sampler(method, 5, seed=r, count=256) for r in range(20)]
    means = [f(np.array([s.member(i) for i in range(256)])).mean() for s in samplers]
    errors[method] = np.std(means, ddof=1)
    assert abs(np.mean(means) - 1) < 4 * errors[method] / np.sqrt(20)
    print(f"{method:12s} error {errors[method]:.1e}")
factor = (errors["monte-carlo"] / errors["sobol"]) ** 2
print(f"chance needs {256 * factor:,.0f} points for the error of 256 Sobol' points")
assert factor > 50
for method, error in your_errors.items():
    assert 0.5 < error / errors[method] < 2, f"{method} is not there yet"

# %% [markdown]
# Does that help the string? Its rock is a hundred numbers, but the first few matter most, and the package gives
# these the best coordinates of the set. `drillfem ensemble ... --method sobol` does it; run it with some seeds,
# and give all folders to `drillfem statistics`. [The page on statistics](../../docs/ensemble-statistics.md) has
# what was measured, also of the other idea: many strings on a coarse mesh, and few on a fine one.
