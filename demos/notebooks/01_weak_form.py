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
# # From the balance laws to the weak form
#
# A drill-string is a steel pipe, a kilometre long and as thick as a thigh. Seen from afar it is a hair. It
# stretches under its own weight, it twists by whole turns, it bends into the curve of the hole. In this
# notebook we write down the laws that govern it. Then we turn them, step by step, into the form that a
# finite element code can solve. That form is called the *weak form*. It is Appendix D of the thesis that
# this project follows (PUC-Rio, 2023), and numbers in round brackets, such as (2-51), are its equations.
#
# Nothing below is a copy. Every formula stands beside the very code that runs when `drillfem` drills a
# hole. We fetch that code from the package and print it. Where a claim can be tested, we test it, and an
# assertion guards the number. At the end you solve two problems yourself. The first is a ruler clamped at
# one end. The second is a string of 1200 metres that hangs in its hole and pushes on the rock.
#
# You need some calculus and a little linear algebra. You need no finite element experience.

# %%
import ast
import inspect
import textwrap
from types import SimpleNamespace

import dolfinx
import matplotlib.pyplot as plt
import numpy as np
import ufl
from mpi4py import MPI
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from scipy.linalg import expm

from drillfem.compat import MatrixForm, ScalarForm, VectorForm, compile_expression, lagrange
from drillfem.forms import constitutive, kinematics, virtual_work
from drillfem.forms.ansatz import ansatz
from drillfem.forms.constitutive import SECTION, Section
from drillfem.forms.kinematics import Configuration, Twist, configuration, rotation_about, strain_rates, strains
from drillfem.meshes.string import string_mesh
from drillfem.models.initial import initial_state
from drillfem.models.rod import Rod, measures
from drillfem.render import style
from drillfem.scene import load_scene
from drillfem.solve.dynamics import march
from drillfem.solve.statics import Statics

plt.rcParams.update(style.RC)


def show(*functions):
    """Print the source of functions of the package, without their docstrings."""
    for f in functions:
        source = textwrap.dedent(inspect.getsource(getattr(f, "fget", f)))
        lines = source.splitlines()
        first = ast.parse(source).body[0].body[0]
        if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
            del lines[first.lineno - 1 : first.end_lineno]
        print("\n".join(lines), end="\n\n")


def numbers(expression):
    """A UFL vector or matrix of plain numbers as a NumPy array."""
    shape = expression.ufl_shape
    return np.array([float(expression[i]) for i in np.ndindex(shape)]).reshape(shape)


# %% [markdown]
# The forms are written in UFL, the *unified form language* of FEniCS. UFL looks like mathematics: `dot`,
# `cross`, `R.T`, and `f.dx(0)` for the derivative along the rod. An expression in UFL computes nothing by
# itself. It is a formula that can be differentiated by the computer, and compiled to fast C code.

# %% [markdown]
# ## 1. A section with a place and a direction
#
# Cut the pipe across its axis. The cut face is called a *cross-section*, or just a section. The idea of the
# brothers Cosserat is to follow only two things for each section: where its centre is, and how it is
# turned.
#
# Each section has a name, and the name is a length: $s$, in metres, measured along the unloaded rod from
# its top. The top has $s = 0$, the bottom has $s = L$. Time is $t$, in seconds. The centre of section $s$
# is the point $\mathbf r(s, t)$, three numbers in metres. The turn of the section is a rotation matrix
# $\mathbf R(s, t)$, three by three, without unit. (The thesis calls it $\mathbf Q$.) Its columns are three
# unit vectors, and they ride with the section:
#
# $$ \mathbf R = [\, \mathbf d_1 \;\; \mathbf d_2 \;\; \mathbf d_3 \,]. $$
#
# They are called *directors*. The first two lie in the plane of the section. Think of them as two lines of
# paint across the cut face. The third one stands upright on it.
#
# The fixed axes of the laboratory are $\mathbf e_1, \mathbf e_2, \mathbf e_3$. We let $\mathbf e_3$ point
# down the unloaded rod. So the unloaded rod has $\mathbf r = s\,\mathbf e_3$ and $\mathbf R = \mathbf 1$.
#
# A point of the steel sits at fixed coordinates $\zeta_1, \zeta_2$ (metres) on its section, so the whole
# solid body is known (2-5):
#
# $$ \mathbf x = \mathbf r(s, t) + \zeta_1 \mathbf d_1(s, t) + \zeta_2 \mathbf d_2(s, t). $$
#
# That is the one assumption of the theory: sections stay flat, and keep their shape. In the code the pair
# of $\mathbf r$ and $\mathbf R$ is called a `Configuration`, and it carries one more vector that we meet
# soon.


# %% tags=["hide-input"]
def hat(w):
    """The matrix [w]x, with [w]x a = w x a."""
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def constant_strain_rod(v, u, s):
    """Positions (n, 3) and rotations (n, 3, 3) of a rod with r' = R v, R' = R [u]x: a matrix exponential."""
    generator = np.zeros((4, 4))
    generator[:3, :3], generator[:3, 3] = hat(u), v
    frames = np.array([expm(generator * si) for si in s])
    return frames[:, :3, 3], frames[:, :3, :3]


def draw_rod(axes, r, R, radius, every=1, directors=0.0, colour=style.SKY, stripe=style.VERMILION):
    """Sections as discs, the centreline, a painted stripe, and the directors if they get a length."""
    angle = np.linspace(0, 2 * np.pi, 33)
    for ri, Ri in zip(r[::every], R[::every], strict=True):
        rim = ri + radius * (np.outer(np.cos(angle), Ri[:, 0]) + np.outer(np.sin(angle), Ri[:, 1]))
        disc = Poly3DCollection([rim], facecolor=colour, edgecolor=style.INK, linewidth=0.6, alpha=0.55)
        axes.add_collection3d(disc)
        for k, ink in enumerate((style.VERMILION, style.GREEN, style.BLUE)):
            if directors:
                axes.quiver(*ri, *(directors * Ri[:, k]), color=ink, linewidth=1.8, arrow_length_ratio=0.25)
    axes.plot(*r.T, color=style.INK, linewidth=1.2)
    axes.plot(*(r + radius * R[:, :, 0]).T, color=stripe, linewidth=1.6)
    axes.set_axis_off()
    axes.set_facecolor("none")


def frame(axes, x, y, z, zoom, elev, azim):
    """Limits (m) and direction of view, with equal scales; z points down."""
    axes.set(xlim=x, ylim=y, zlim=z[::-1])
    axes.set_box_aspect((np.ptp(x), np.ptp(y), np.ptp(z)), zoom=zoom)
    axes.view_init(elev=elev, azim=azim)


turn_rate, lean = 3.0, 0.5  # rad/m and rad
corkscrew = np.array([-turn_rate * np.sin(lean), 0.0, turn_rate * np.cos(lean)])
r, R = constant_strain_rod((0, 0, 1), corkscrew, np.linspace(0, 2.4, 97))
upright = expm(hat(np.array([0, lean, 0])))  # so that the corkscrew winds about e3
r, R = r @ upright.T, upright @ R

figure = plt.figure(figsize=(7, 6.4))
axes = figure.add_axes((0, 0, 1, 0.93), projection="3d")
draw_rod(axes, r, R, 0.11, every=16, directors=0.28)
frame(axes, (-0.35, 0.55), (-0.35, 0.55), (-0.3, 2.5), zoom=1.25, elev=12, azim=-65)
for k, ink in enumerate((style.VERMILION, style.GREEN, style.BLUE)):
    label = rf"$\mathbf{{d}}_{k + 1}$"
    axes.text(*(r[32] + 0.36 * R[32][:, k]), label, color=ink, fontsize=14, ha="center", va="center")
axes.text(*(r[0] + (-0.3, 0, 0)), "$s = 0$", ha="center", va="center")
axes.text(*(r[-1] + (-0.3, 0, 0)), "$s = L$", ha="center", va="center")
title = "A rod is a stack of sections, each with a place and a direction"
figure.suptitle(title, weight="bold", fontsize=12)
plt.show()

# %% [markdown]
# ## 2. Strain: how a section differs from its neighbour
#
# A rigid motion of the whole rod costs no energy. What costs energy is a difference between neighbours. So
# we compare section $s$ with the next one, a hair's breadth $\mathrm ds$ further on. A prime denotes the
# derivative along the rod, $(\;)' = \partial(\;)/\partial s$.
#
# The centre moves by $\mathbf r'\,\mathrm ds$. We look at this step with the eyes of the section, that is,
# in components along its directors (2-75):
#
# $$ \mathbf v_m = \mathbf R^{\mathsf T} \mathbf r'. $$
#
# The index $m$ stands for *material*: the components of the vector along the directors, not along the fixed
# axes. $\mathbf v_m$ has no unit. Its third number is one plus the stretch. The other two say that the
# centre slides sideways while the section does not turn along. That is shear. An unloaded rod has $\mathbf
# v_m = (0, 0, 1) = \mathbf e_3$.
#
# The directors turn as well. The change of a rotation is always a small turn, and a small turn is a vector:
# its direction is the axis, its length is the angle. Per metre of rod, and again in the section's own
# components, we call it $\mathbf u_m$, in radians per metre (2-76):
#
# $$ [\mathbf u_m]_\times = \mathbf R^{\mathsf T} \mathbf R', \qquad
#    [\mathbf a]_\times \mathbf b = \mathbf a \times \mathbf b. $$
#
# Its first two numbers are bending, the third one is twist. This is the third member of `Configuration`.

# %%
show(configuration, strains)

# %% tags=["hide-input"]
modes = {
    "stretch  $v_3 = 1.4$": ((0, 0, 1.4), (0, 0, 0)),
    "shear  $v_1 = 0.5$": ((0.5, 0, 1), (0, 0, 0)),
    "bending  $u_2 = 1.4$ /m": ((0, 0, 1), (0, 1.4, 0)),
    "twist  $u_3 = 5$ /m": ((0, 0, 1), (0, 0, 5)),
}
figure = plt.figure(figsize=(10, 4.2))
for k, (name, (v, u)) in enumerate(modes.items()):
    axes = figure.add_axes((0.02 + 0.245 * k, -0.02, 0.24, 0.96), projection="3d")
    axes.plot([0, 0], [0, 0], [0, 1], color=style.GREY, lw=1, ls=(0, (4, 3)))
    draw_rod(axes, *constant_strain_rod(v, u, np.linspace(0, 1, 49)), 0.12, every=6)
    frame(axes, (-0.3, 0.7), (-0.25, 0.25), (-0.1, 1.45), zoom=1.2, elev=14, azim=-70)
    figure.text(0.14 + 0.245 * k, 0.8, name, ha="center", fontsize=12)
title = "The strains of a rod, one metre long; the red stripe was painted along the unloaded rod"
figure.suptitle(title, weight="bold", fontsize=12)
plt.show()

# %% [markdown]
# Does the code measure what we drew? The corkscrew above has a closed form. Its sections first lean by an
# angle $\beta$ about $\mathbf e_2$, then turn about $\mathbf e_3$ at a rate $k$ per metre. So $\mathbf R =
# \mathbf R_3(ks)\,\mathbf R_2(\beta)$, and by hand one finds $\mathbf u_m = k\,(-\sin\beta,\, 0,\,
# \cos\beta)$, the same in every section.
#
# We build it in UFL, on a mesh of eight elements, and ask `strains` for its opinion. Then we carry the
# whole corkscrew elsewhere, by a shift and a turn. The strains must not notice.

# %%
lesson = string_mesh(MPI.COMM_SELF, [2.0], elements=8).mesh
s = ufl.SpatialCoordinate(lesson)[0]


def at_midpoints(expression):
    """Value of a UFL vector in the middle of every element, shape (elements, components)."""
    compiled = compile_expression(expression, np.array([[0.5]]), lesson.comm)
    return compiled.eval(lesson, np.arange(8, dtype=np.int32))


R = rotation_about(3, turn_rate * s) * rotation_about(2, lean)
radius = np.sin(lean) / turn_rate
r = ufl.as_vector((radius * ufl.sin(turn_rate * s), -radius * ufl.cos(turn_rate * s), np.cos(lean) * s))
moved_R = rotation_about(1, 0.7) * rotation_about(2, -1.9)
here = configuration(r, R)
there = configuration(ufl.as_vector((5.0, -3.0, 8.0)) + moved_R * r, moved_R * R)

found = at_midpoints(ufl.as_vector([c for x in (here, there) for strain in strains(x) for c in strain]))
print("v_m, u_m in one element, here: ", found[0, :6].round(6) + 0.0)
print("the same after the rigid move: ", found[0, 6:].round(6) + 0.0)
expected = np.concatenate([(0, 0, 1), corkscrew])
assert np.allclose(found[:, :6], expected, atol=1e-12)
assert np.allclose(found[:, 6:], expected, atol=1e-12)

# %% [markdown]
# ## 3. The two laws of balance
#
# Now cut the rod at $s$ and ask what one part does to the other. The part beyond $s$, towards the bottom,
# pulls on the part above it with a force $\mathbf n(s, t)$, in newtons. It also turns it with a moment
# $\mathbf m(s, t)$, in newton metres. With this choice a positive component of $\mathbf n$ along the rod is
# tension. From outside come a force $\mathbf f$ per metre, in newtons per metre, such as the weight, and a
# moment $\mathbf c$ per metre, in newtons, such as friction that makes the pipe turn. (The thesis writes
# $\mathbf f_n$ and $\mathbf f_m$.)


# %% tags=["hide-input"]
def arrow(axes, start, step, label, shift, ink):
    head = {"arrowstyle": "-|>", "color": ink, "lw": 2, "mutation_scale": 16}
    axes.annotate("", np.add(start, step), start, arrowprops=head)
    axes.text(*np.add(np.add(start, step), shift), label, color=ink, fontsize=13, ha="center", va="center")


def moment_arrow(axes, centre, radius, begin, end, label, shift, ink):
    a = np.radians(np.linspace(begin, end, 40))
    path = np.stack([centre[0] + radius * np.cos(a), centre[1] + radius * np.sin(a)], axis=1)
    axes.plot(*path.T, color=ink, lw=2)
    head = {"arrowstyle": "-|>", "color": ink, "lw": 2, "mutation_scale": 16}
    axes.annotate("", path[-1], path[-3], arrowprops=head)
    axes.text(*np.add(centre, shift), label, color=ink, fontsize=13, ha="center", va="center")


figure, axes = plt.subplots(figsize=(9, 3.9))
a = np.linspace(np.radians(112), np.radians(68), 50)
outer, inner, middle = (rho * np.stack([np.cos(a), np.sin(a)], axis=1) for rho in (4.45, 3.55, 4.0))
axes.fill(*np.vstack([outer, inner[::-1]]).T, facecolor=style.FAINT, edgecolor=style.INK, lw=1.2)
left, right = middle[0], middle[-1]
arrow(axes, left, (-1.45, -0.35), r"$-\mathbf{n}(s)$", (-0.42, 0.05), style.BLUE)
arrow(axes, right, (1.55, 0.0), r"$\mathbf{n}(s + \mathrm{d}s)$", (0.68, 0.0), style.BLUE)
moment_arrow(axes, left, 0.68, 205, 95, r"$-\mathbf{m}(s)$", (-0.78, 0.78), style.GREEN)
moment_arrow(axes, right, 0.68, -25, 85, r"$\mathbf{m}(s + \mathrm{d}s)$", (1.05, 0.85), style.GREEN)
arrow(axes, (0, 4), (0, -1.15), r"$\mathbf{f}\,\mathrm{d}s$", (0.42, 0.15), style.VERMILION)
arrow(axes, left, right - left, r"$\mathbf{r}'\,\mathrm{d}s$", (-1.85, 0.22), style.GREY)
axes.set(xlim=(-4.4, 4.8), ylim=(2.6, 5.1), aspect="equal")
axes.set_axis_off()
axes.set_title("A slice of rod and what acts on it", loc="center")
plt.show()

# %% [markdown]
# Newton's law for the slice: the forces on its two faces nearly cancel. What is left is $\mathbf n' \mathrm
# ds$, plus the load $\mathbf f\,\mathrm ds$. Together they change the momentum of the slice. Its mass is
# $\rho A\,\mathrm ds$, where $\rho$ is the density in kilograms per cubic metre and $A$ the area in square
# metres. A dot is a derivative in time. So we have the balance of momentum (2-51):
#
# $$ \mathbf n' + \mathbf f = \rho A\, \ddot{\mathbf r}. $$
#
# For the moments there is one more actor. The force on the far face does not act at the near face. It has
# the arm $\mathbf r'\,\mathrm ds$, and so it turns the slice by $\mathbf r' \times \mathbf n\,\mathrm ds$.
# This is the balance of moment of momentum (2-61):
#
# $$ \mathbf m' + \mathbf r' \times \mathbf n + \mathbf c
#    = \frac{\mathrm d}{\mathrm dt}\big( \mathbf R\, \boldsymbol\Theta\, \boldsymbol\omega_m \big). $$
#
# On the right, $\boldsymbol\omega$ is the angular velocity of the section in radians per second, and
# $\boldsymbol\omega_m = \mathbf R^{\mathsf T}\boldsymbol\omega$ are its components along the directors. The
# matrix $\boldsymbol\Theta = \rho\,\mathrm{diag}(I_1, I_2, I_1 + I_2)$ holds the moments of inertia per
# metre, in kilogram metres. $I_1$ and $I_2$ are the second moments of area, in metres to the fourth power.
# In the section's own frame $\boldsymbol\Theta$ never changes: the steel does not move within its section.
# That is the first gift of the material frame. Differentiate the product, use $\dot{\mathbf R} = \mathbf R
# [\boldsymbol\omega_m]_\times$, and you get Euler's equation of the spinning top:
#
# $$ \frac{\mathrm d}{\mathrm dt}\big( \mathbf R\, \boldsymbol\Theta\, \boldsymbol\omega_m \big)
#    = \mathbf R \big( \boldsymbol\Theta\, \dot{\boldsymbol\omega}_m
#    + \boldsymbol\omega_m \times \boldsymbol\Theta\, \boldsymbol\omega_m \big). $$

# %% [markdown]
# ## 4. A virtual motion
#
# These equations hold at every point. A computer cannot check every point. So we ask a weaker question,
# which turns out to be just as strong if we ask it often enough.
#
# Imagine a small nudge of the rod, frozen in time. The centre of section $s$ shifts by $\delta\mathbf
# r(s)$, in metres. The section turns by a small angle vector $\delta\boldsymbol\theta(s)$, in radians. Such
# a nudge is called a *virtual motion*. It need not be the real motion. It may be any smooth function we
# like. We multiply each law by it, and integrate along the rod. A force times a shift is a work, and so is
# a moment times an angle. What we get is the *virtual work*, in joules, and it must vanish for every
# virtual motion:
#
# $$ \int_0^L \delta\mathbf r \cdot \big( \rho A\, \ddot{\mathbf r} - \mathbf n' - \mathbf f \big)\,\mathrm ds
#  + \int_0^L \delta\boldsymbol\theta \cdot \Big( \tfrac{\mathrm d}{\mathrm dt}(\mathbf R \boldsymbol\Theta
#    \boldsymbol\omega_m) - \mathbf m' - \mathbf r' \times \mathbf n - \mathbf c \Big)\,\mathrm ds = 0. $$
#
# The thesis calls the virtual motions $\Lambda_1$ and $\Lambda_2$. In the finite element world they are the
# *test functions*. In the code, a motion of the sections is a `Twist`: a velocity `v` along the fixed axes,
# and an angular velocity `w` along the directors. The same class serves for the real velocity, for the
# acceleration, and for the virtual motion. For the latter $\mathtt{v} = \delta\mathbf r$ and $\mathtt{w} =
# \mathbf R^{\mathsf T} \delta\boldsymbol\theta$, which we write $\delta\boldsymbol\theta_m$.

# %% [markdown]
# ### Integration by parts
#
# There is a nuisance in this integral: $\mathbf n'$. The force depends on $\mathbf r'$ already, so $\mathbf
# n'$ needs a second derivative of our unknowns. Finite elements are made of pieces, with kinks between
# them. A kink has no second derivative. The cure is as old as calculus. The product rule says
# $(\delta\mathbf r \cdot \mathbf n)' = \delta\mathbf r' \cdot \mathbf n + \delta\mathbf r \cdot \mathbf
# n'$. Integrate it, and move one term to the other side:
#
# $$ -\int_0^L \delta\mathbf r \cdot \mathbf n' \,\mathrm ds
#    = \int_0^L \delta\mathbf r' \cdot \mathbf n \,\mathrm ds - \big[ \delta\mathbf r \cdot \mathbf n \big]_0^L,
#    \qquad
#    -\int_0^L \delta\boldsymbol\theta \cdot \mathbf m' \,\mathrm ds
#    = \int_0^L \delta\boldsymbol\theta' \cdot \mathbf m \,\mathrm ds
#    - \big[ \delta\boldsymbol\theta \cdot \mathbf m \big]_0^L. $$
#
# The derivative has moved from the force to the virtual motion, which we may choose as smooth as we please.
# The square brackets, "value at the bottom minus value at the top", are the boundary terms. We keep them
# for later.
#
# One more term holds $\mathbf n$: the arm. A triple product may be turned in a circle,
# $\delta\boldsymbol\theta \cdot (\mathbf r' \times \mathbf n) = \mathbf n \cdot (\delta\boldsymbol\theta
# \times \mathbf r')$. So all that multiplies $\mathbf n$, and all that multiplies $\mathbf m$, can be
# gathered. This is the internal virtual work:
#
# $$ \delta W_{\mathrm{int}} = \int_0^L \Big( \mathbf n \cdot \big( \delta\mathbf r'
#    - \delta\boldsymbol\theta \times \mathbf r' \big) + \mathbf m \cdot \delta\boldsymbol\theta' \Big)
#    \,\mathrm ds. $$
#
# That is (D-2) and (D-3), summed over their components. The print of (D-3) has a symbol $\zeta_i$ where it
# means the $\eta_i$ that it defines, the arm term; and it differentiates the components one by one where it
# should differentiate the whole vector $\mathbf R \boldsymbol\Theta \boldsymbol\omega_m$.

# %% [markdown]
# ### The virtual strains
#
# Now go to the section's own frame. Write $\mathbf n = \mathbf R\, \mathbf n_m$ and $\mathbf m = \mathbf
# R\, \mathbf m_m$. A dot product does not care in which frame it is taken, so $\mathbf n \cdot \mathbf a =
# \mathbf n_m \cdot \mathbf R^{\mathsf T}\mathbf a$. And $\delta\boldsymbol\theta = \mathbf
# R\,\delta\boldsymbol\theta_m$ has the derivative $\mathbf R\, (\delta\boldsymbol\theta_m' + \mathbf u_m
# \times \delta\boldsymbol\theta_m)$, because $\mathbf R' = \mathbf R [\mathbf u_m]_\times$. Insert both:
#
# $$ \delta W_{\mathrm{int}} = \int_0^L \big( \mathbf n_m \cdot \delta\mathbf v_m
#    + \mathbf m_m \cdot \delta\mathbf u_m \big)\,\mathrm ds, \qquad
#    \begin{aligned}
#    \delta\mathbf v_m &= \mathbf R^{\mathsf T} \delta\mathbf r' + \mathbf v_m \times \delta\boldsymbol\theta_m, \\
#    \delta\mathbf u_m &= \delta\boldsymbol\theta_m' + \mathbf u_m \times \delta\boldsymbol\theta_m.
#    \end{aligned} $$
#
# Look at what stands beside $\mathbf n_m$. We called it $\delta\mathbf v_m$ for a good reason: it *is* the
# change of the strain $\mathbf v_m = \mathbf R^{\mathsf T}\mathbf r'$ under the nudge. The first part is
# the change of $\mathbf r'$. The second is the turn of the eyes that look at it. We did not put this in. It
# came out of the balance laws. Forces and strains belong together like voltage and current.
#
# And now replace the nudge by the real motion, $\delta\mathbf r$ by $\dot{\mathbf r}$ and
# $\delta\boldsymbol\theta_m$ by $\boldsymbol\omega_m$. Nothing in the derivation changes, so the same two
# lines give the strain rates $\dot{\mathbf v}_m$ and $\dot{\mathbf u}_m$, which the damping will need.
# Therefore one function serves both.

# %%
show(strain_rates)

# %% [markdown]
# Let us not take it on trust. We make the corkscrew move, in some arbitrary way that depends on $t$. UFL
# can differentiate the strains with respect to time directly. It can also find the angular velocity from
# $[\boldsymbol\omega_m]_\times = \mathbf R^{\mathsf T} \dot{\mathbf R}$. The two roads must meet.

# %%
t = ufl.variable(dolfinx.fem.Constant(lesson, 0.3))
R = rotation_about(3, turn_rate * s + t) * rotation_about(2, lean + t * s**2)
r = ufl.as_vector((t * ufl.sin(turn_rate * s), t**2 * s**2, s + 0.1 * t * s))
x = configuration(r, R)
motion = Twist(ufl.diff(r, t), kinematics.axial(R.T * ufl.diff(R, t)))

by_twist = [c for rate in strain_rates(x, motion) for c in rate]
by_clock = [c for strain in strains(x) for c in ufl.diff(strain, t)]
difference = at_midpoints(ufl.as_vector([*by_twist, *by_clock]))
worst = np.abs(difference[:, :6] - difference[:, 6:]).max()
print(f"largest strain rate {np.abs(difference).max():.3f}, largest difference of the two roads {worst:.1e}")
assert worst < 1e-13

# %% [markdown]
# ### Inertia and weight
#
# The other terms need no such care. The inertia of the slice works against the virtual motion, and Euler's
# equation is there, word for word. The weight is a load $\mathbf f = \rho A\,\mathbf g$, with $\mathbf g$
# the acceleration of gravity in metres per second squared. It will get a minus sign, since loads stand on
# the other side of the equation. You will find it in one line of the whole form, in section 7.

# %%
show(virtual_work.spin_rate, virtual_work.inertia)

# %% [markdown]
# Here, too, there are two roads. UFL can differentiate the spin momentum $\mathbf R\,\boldsymbol\Theta\,
# \boldsymbol\omega_m$ of the moving corkscrew with respect to time, and look at the result along the
# directors. Or it can take Euler's word.

# %%
Theta = ufl.diag(ufl.as_vector((1.0, 2.0, 3.0)))  # kg m, a lopsided section
still = ufl.as_vector((0.0, 0.0, 0.0))
by_euler = virtual_work.spin_rate(Theta, motion, Twist(still, ufl.diff(motion.w, t)))
by_clock = R.T * ufl.diff(R * Theta * motion.w, t)
difference = at_midpoints(ufl.as_vector([*by_euler, *by_clock]))
worst = np.abs(difference[:, :3] - difference[:, 3:]).max()
print(f"largest rate {np.abs(difference).max():.3f}, largest difference of the two roads {worst:.1e}")
assert worst < 1e-12

# %% [markdown]
# ### The ends
#
# The boundary terms remain. At the bottom, $s = L$, nothing lies beyond the cut but what we attach there: a
# load $\mathbf F_L$ in newtons, and perhaps a bit of mass $M_L$ in kilograms. Newton's law for the bit says
# $\mathbf n(L) = \mathbf F_L - M_L \ddot{\mathbf r}$. At the top the rod pulls with $+\mathbf n(0)$ on
# whatever hangs it, so $\mathbf n(0) = -\mathbf F_0 + M_0 \ddot{\mathbf r}$. Insert these, and both ends
# take the same form:
#
# $$ -\big[ \delta\mathbf r \cdot \mathbf n \big]_0^L
#    = \sum_{\text{ends}} \delta\mathbf r \cdot \big( M \ddot{\mathbf r} - \mathbf F \big). $$
#
# The moments follow suit. So a load at an end needs no special treatment: it is one more term of virtual
# work. And an end that is *held* needs none either. There we choose virtual motions that leave it in place,
# $\delta\mathbf r = \mathbf 0$, and the unknown force of the support drops out of the equation. When the
# rest is solved, we can read it off.

# %%
show(virtual_work.end_load)

# %% [markdown]
# ## 5. What the material answers
#
# So far nothing was said about steel. The balance laws hold for spaghetti as well. The *constitutive law*
# says what force a strain produces. For small strains it is linear (2-107), (2-108):
#
# $$ \mathbf n_m = \mathbf K_n (\mathbf v_m - \mathbf e_3), \qquad
#    \mathbf m_m = \mathbf K_m (\mathbf u_m - \mathbf u_0), $$
#
# $$ \mathbf K_n = \mathrm{diag}(GA,\, GA,\, EA), \qquad
#    \mathbf K_m = \mathrm{diag}\big( EI_1,\, EI_2,\, G(I_1 + I_2) \big). $$
#
# Here $E$ is Young's modulus and $G$ the shear modulus, both in pascals. For steel they are about 210 and
# 77 billion. $\mathbf K_n$ is in newtons, $\mathbf K_m$ in newton metres squared. The vector $\mathbf u_0$
# is the curvature of the stress-free rod, zero for a straight one.
#
# Steel also damps a little. In the model of Kelvin and Voigt each stress is joined by a part that grows
# with the strain rate (2-111), (2-115):
#
# $$ \mathbf n_m \leftarrow \mathbf n_m + c_d\, \mathbf K_n \dot{\mathbf v}_m, \qquad
#    \mathbf m_m \leftarrow \mathbf m_m + c_d\, \mathbf K_m \dot{\mathbf u}_m. $$
#
# The one number $c_d$ is a time, in seconds. A vibration of frequency $\nu$, in hertz, is damped by the
# fraction $\pi\,\nu\,c_d$ of critical damping, that is, of the damping that lets nothing swing at all. So
# high tones die first.

# %%
show(constitutive.elastic_resultants, constitutive.viscous_resultants)

for frequency in (0.45, 13.09):  # Hz: slow twisting of a long string, fast rattling of its bit
    print(f"c_d = 0.01 s damps {frequency:5.2f} Hz by {100 * np.pi * frequency * 1e-2:4.1f} % of critical")
assert round(100 * np.pi * 13.09 * 1e-2) == 41

# %% [markdown]
# ### Why the material frame? An experiment
#
# The function above has a switch called `literal`. It follows (2-113) to the letter, where the stiffness
# matrices stand in front of vectors along the *fixed* axes. It looks harmless. Here is a bar that is tilted
# by an angle $\alpha$, and stretched along its own axis by one per cent. It has $EA = 1$ and $GA = 0.4$.
# Whichever way the bar points, the tension must be 0.01.

# %%
alpha = dolfinx.fem.Constant(lesson, 0.0)
steel = Section(ufl.as_vector([0.4, 0.4, 1.0, 1, 1, 1, 0, 0, 0, 0, 0]))
R = rotation_about(2, alpha)
bar = Configuration(R * ufl.as_vector((0, 0, 1.01 * s)), R, ufl.as_vector((0, 0, 0)))
no_curvature = ufl.as_vector((0.0, 0.0, 0.0))
tension_of = []
for literal in (False, True):
    n_m, _ = constitutive.elastic_resultants(bar, steel, no_curvature, literal)
    tension_of.append(ScalarForm(n_m[2] / 2 * ufl.dx(lesson)))  # the mean over two metres

tilt = np.radians(np.arange(0, 181, 10))
measured = np.empty((len(tilt), 2))
for i, angle in enumerate(tilt):
    alpha.value = angle
    measured[i] = [tension() for tension in tension_of]
assert np.allclose(measured[:, 0], 0.01)
assert np.allclose(measured[:, 1], 0.01 * (np.cos(tilt) ** 2 + 0.4 * np.sin(tilt) ** 2))

# %% tags=["hide-input"]
figure, axes = plt.subplots(figsize=(7.5, 3.6))
degrees, ratio = np.degrees(tilt), 100 * measured
axes.plot(degrees, ratio[:, 0], "o-", color=style.BLUE, label=r"$\mathbf{K}$ in the material frame")
axes.plot(degrees, ratio[:, 1], "s-", color=style.VERMILION, label=r"$\mathbf{K}$ in front of spatial vectors")
axes.set(xlabel="tilt of the bar, degrees", ylabel="tension / (EA · stretch)", ylim=(0, 1.15), xlim=(0, 180))
axes.set_xticks(range(0, 181, 30))
axes.legend(loc="lower center")
axes.set_title("A bar must not know where north is")
plt.show()

# %% [markdown]
# Literally read, a bar that lies across has only its shear stiffness left. The right law in fixed axes is
# $\mathbf n = \mathbf R\,\mathbf K_n\,\mathbf R^{\mathsf T}(\mathbf r' - \mathbf d_3)$, and that is what
# the material form says without effort. For a pipe that hangs straight down and spins about its own axis,
# both agree. That is how such a slip survives a hundred test runs. It is erratum 14 on our list.

# %% [markdown]
# ## 6. How to store a rotation
#
# A rotation has three degrees of freedom, so three angles should do. But every choice of three angles has a
# pole, as the globe has: a place where the angles jump though nothing happens. A pipe that spins and bends
# will find it. Four numbers have no pole. They form a *quaternion* $\mathbf q = (q_a, q_b, q_c, q_d)$,
# without unit. For a turn by the angle $\varphi$ about the unit axis $\mathbf a$ it is
# $(\cos\tfrac\varphi2,\; \mathbf a\sin\tfrac\varphi2)$. Its rotation matrix is (2-18), with one addition:

# %%
show(kinematics.rotation_of_quaternion)

# %% [markdown]
# The addition is the division by $\mathbf q\cdot\mathbf q$ at the end. A proper quaternion has length one,
# and then the division does nothing. But a time integrator makes small errors, and the length drifts.
# Without the division, a quaternion of length 1.05 would swell the pipe by ten per cent, and what it calls
# a rotation would strain the steel. With the division, every quaternion but zero is a pure rotation. That
# is erratum 1.

# %%
q = 1.05 * np.array([0.5, 0.5, -0.5, 0.5])
R = numbers(kinematics.rotation_of_quaternion(ufl.as_vector(q)))
printed = R * (q @ q)  # the matrix as printed, without the division
print(f"R^T R differs from 1 by {np.abs(R.T @ R - np.eye(3)).max():.3f} with the division,", end=" ")
print(f"and by {np.abs(printed.T @ printed - np.eye(3)).max():.3f} without; |q|^4 - 1 is {1.05**4 - 1:.3f}")
assert np.allclose(R.T @ R, np.eye(3))
assert np.allclose(printed.T @ printed, 1.05**4 * np.eye(3))

# %% [markdown]
# The quaternion must follow the angular velocity. That is one more differential equation, the kinematic
# equation (2-26):
#
# $$ \dot{\mathbf q} = \tfrac12\, \mathbf q \otimes (0, \boldsymbol\omega_m) + \kappa\,(1 - \mathbf q\cdot\mathbf q)\,
#    \mathbf q. $$
#
# The sign $\otimes$ is the product of quaternions, and in the code it is a small matrix times
# $\boldsymbol\omega_m$. The last term, with a rate $\kappa$ of one per second, pulls the length of $\mathbf
# q$ gently back to one. It acts along $\mathbf q$ itself. So it changes only the length, and the rotation
# does not feel it. (The thesis adds a multiple of the largest quaternion along the string instead. That
# would turn all the others: erratum 3.)
#
# Which components of the angular velocity belong here? The thesis speaks of spatial ones, yet the matrix it
# prints wants material ones. Let us decide by an experiment. A top leans out by an angle that grows like
# $1.1\,t$, while it is carried about the vertical at $0.8$ radians per second: $\mathbf R(t) = \mathbf
# R_3(0.8\,t)\,\mathbf R_1(1.1\,t)$. We know its angular velocity in both frames. We feed both to the same
# equation, with a careful time integrator, and compare the axis of the top with the truth.

# %%
show(kinematics.quaternion_rate)


def truth(t):
    return numbers(rotation_about(3, 0.8 * t) * rotation_about(1, 1.1 * t))


def spatial_velocity(t):
    return 0.8 * np.array([0, 0, 1]) + truth(t) @ np.array([1.1, 0, 0])  # R e1 = R_3 e1


def material_velocity(t):
    return truth(t).T @ spatial_velocity(t)


def axis_of_top(velocity, h=0.1, steps=40):
    """Director d3 over time: the kinematic equation by the classical Runge-Kutta method."""

    def rate(t, q):
        return numbers(kinematics.quaternion_rate(ufl.as_vector(q), ufl.as_vector(velocity(t))))

    q, axis = np.array([1.0, 0, 0, 0]), [np.array([0.0, 0, 1])]
    for t in h * np.arange(steps):
        k1 = rate(t, q)
        k2 = rate(t + h / 2, q + h / 2 * k1)
        k3 = rate(t + h / 2, q + h / 2 * k2)
        k4 = rate(t + h, q + h * k3)
        q = q + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        axis.append(numbers(kinematics.rotation_of_quaternion(ufl.as_vector(q)))[:, 2])
    return np.array(axis)


clock = 0.1 * np.arange(41)
exact = np.array([truth(t)[:, 2] for t in clock])
with_material, with_spatial = axis_of_top(material_velocity), axis_of_top(spatial_velocity)
errors = [np.abs(axis - exact).max() for axis in (with_material, with_spatial)]
print(f"largest error of the axis: {errors[0]:.1e} with material, {errors[1]:.2f} with spatial components")
assert errors[0] < 1e-5 and errors[1] > 0.5

# %% tags=["hide-input"]
figure, panels = plt.subplots(1, 2, figsize=(9, 3.6), sharey=True)
for axes, axis, name in zip(panels, (with_material, with_spatial), ("material", "spatial"), strict=True):
    for k, ink in enumerate((style.VERMILION, style.GREEN, style.BLUE)):
        axes.plot(clock, exact[:, k], color=ink, lw=1.6, label=rf"$\mathbf{{d}}_3\cdot\mathbf{{e}}_{k + 1}$")
        axes.plot(clock[::2], axis[::2, k], "o", ms=4, color=ink)
    axes.set(xlabel="time, s", title=f"fed with {name} components", xlim=(0, 4), ylim=(-1.1, 1.1))
panels[1].legend(loc="center left", bbox_to_anchor=(1, 0.5))
caption = "lines: where the top points; dots: where the quaternion says it points"
figure.text(0.5, -0.1, caption, ha="center", color=style.GREY)
plt.show()

# %% [markdown]
# The material components win, and it is no matter of taste. Had we chosen a turn about a fixed axis, both
# would have been right. So once more a straight, spinning pipe could not tell. This is erratum 2. In
# `drillfem`, the angular velocity is the material one, unless you ask for the literal reading.
#
# The three equations are now complete: momentum, moment of momentum, and the quaternion. Multiplied by a
# test function and integrated, the last one is (D-4). The other two terms of Appendix D concern the rock
# and the wall of the hole. They have modules of their own.

# %% [markdown]
# ## 7. The weak form, whole
#
# Here it is. Each term has a name, and together they must vanish for every virtual motion. The code writes
# the sum as a dictionary, so that a test, or an energy audit, can pick a term by its name. Read it slowly:
# there is no term in it that we have not met, but the touch of the wall, the friction there, and the push
# of the rock.

# %%
show(virtual_work.virtual_work)

# %% [markdown]
# The letters `on.mass`, `on.internal` and so on are *measures*. They say where to integrate, and by which
# rule. We shall see in a moment that the rule matters.
#
# The unknowns have not been named yet. The function does not care. It sees an $\mathbf r$ and an $\mathbf
# R$, and whatever they are made of is the business of an *ansatz*. In space, they are made of three
# coordinates and a quaternion. In a plane, of two coordinates and one angle. For a straight string, of a
# depth and an angle. Here is the planar one, whole:

# %%
planar = ansatz("planar")
show(type(planar))
print("unknowns:", ", ".join(planar.x_names), " with velocities", ", ".join(planar.v_names))

# %% [markdown]
# ## 8. From the form to numbers
#
# Finite elements now do the rest. We cut the rod into elements. On each element we let the unknowns be
# polynomials, of degree one, two or three, that are known once their values at a few *nodes* are known. For
# the virtual motion we take the same polynomials, one after the other. Each gives one equation. There are
# as many equations as unknown numbers. They are not linear, and we solve them by Newton's method: write
# down the error, and its derivative with respect to all unknowns; solve the linear system; repeat until
# nothing changes. UFL finds the derivative by itself, without a mistake.
#
# The next cell is a complete static solver of a clamped rod in a plane. The package has a better one. But
# it is good to see once that there is no magic.


# %%
def clamped_rod(properties, length, elements, degree=3, reduced=True):
    """A planar rod with unknowns (x, z, theta) at every node, straight along e3, clamped at s = 0."""
    string = string_mesh(MPI.COMM_SELF, [length], elements)

    def constant(value):
        return dolfinx.fem.Constant(string.mesh, np.asarray(value, dtype=float))

    V = lagrange(string.mesh, degree, 3)
    x, test = dolfinx.fem.Function(V), ufl.TestFunction(V)
    nodes = V.tabulate_dof_coordinates()[:, 0]
    x.x.array.reshape(-1, 3)[:, 1] = nodes  # z = s
    top, tip = int(np.argmin(nodes)), int(np.argmax(nodes))
    section = Section(ufl.as_vector([constant(properties.get(name, 0.0)) for name in SECTION]))
    nothing, force, moment = constant((0, 0, 0)), constant((0, 0, 0)), constant((0, 0, 0))
    unloaded = virtual_work.EndLoad(nothing, nothing, constant(0), constant(0))
    loaded = virtual_work.EndLoad(force, moment, constant(0), constant(0))
    loads = virtual_work.Loads(g=nothing, u0=nothing, top=unloaded, bottom=loaded)
    on, s = measures(string, degree, reduced), ufl.SpatialCoordinate(string.mesh)[0]
    terms = virtual_work.static_terms(planar, x, test, s, section, loads, on)
    return SimpleNamespace(
        x=x,
        test=test,
        section=section,
        force=force,
        moment=moment,
        on=on,
        terms={name: terms[name] for name in ("internal force", "internal moment", "tip load")},
        held=3 * top + np.arange(3),
        tip=slice(3 * tip, 3 * tip + 3),
        order=np.argsort(nodes),
    )


def equilibrium(rod, terms=None):
    """Compile the form and its derivative; return Newton's method, which moves rod.x to equilibrium."""
    form = virtual_work.total(terms or rod.terms)
    error = VectorForm(form)
    derivative = MatrixForm(ufl.derivative(form, rod.x, ufl.TrialFunction(rod.x.function_space)))
    values, b = rod.x.x.array, np.zeros(len(rod.x.x.array))

    def newton(iterations=30):
        for _ in range(iterations):
            error(b)
            J = derivative.dense()
            b[rod.held], J[rod.held, :], J[rod.held, rod.held] = 0.0, 0.0, 1.0  # what is held does not move
            step = np.linalg.solve(J, b)
            values[:] -= step
            if np.abs(step).max() < 1e-10:
                break

    return newton


# %% [markdown]
# ### Locking: an experiment
#
# Take a hundred metres of drill pipe, clamped at one end, and turn its free end by a small moment. We use
# straight elements, of degree one, and integrate everything exactly. What could be wrong with exactness?
#
# In pure bending the angle $\theta$ grows linearly along the rod, and its axis $x(s)$ is a parabola. The
# angle we can represent. The parabola we cannot: our elements are straight. So $x' - \theta$, which should
# be zero, cannot be zero along an element. It is a shear that does not exist in the pipe. Shear is very
# stiff. The element pays for each bit of bending with a shear that nobody ordered, and refuses to bend.
# This is called *locking*. The price can be worked out on paper. An element of length $h$ has, in place of
# $EI$, the stiffness
#
# $$ EI + \frac{GA\,h^2}{12}. $$
#
# The middle of the element is the one point where the shear does vanish. So evaluate the internal work
# there, and only there. This is *reduced integration*. In general, elements of degree $p$ get $p$ points.
# The rule looks like a cheat, but it is not: it forgets exactly the part of the strain that the element
# cannot get right.

# %%
pipe = load_scene("vertical-c1-cd4").string[0]
stiffness = pipe.section_stiffness()._asdict()
EI, GA = stiffness["bending2"], stiffness["shear1"]

factors = []
for elements in (4, 8, 16, 32, 64):
    row = [100.0 / elements]
    for reduced in (False, True):
        rod = clamped_rod(stiffness, 100.0, elements, degree=1, reduced=reduced)
        rod.moment.value[1] = 1.0
        equilibrium(rod)(iterations=1)  # a tiny load: one linear step is enough
        theta = rod.x.x.array[rod.tip][2]
        row.append(1.0 * 100.0 / EI / theta)  # exact angle over computed angle
    factors.append(row)
h, full, relaxed = np.array(factors).T
print(f"computed over true stiffness, elements of 12.5 m: {full[1]:.0f}; with one point each: {relaxed[1]:.9f}")
assert np.allclose(full, 1 + GA * h**2 / (12 * EI), rtol=1e-6)
assert np.allclose(relaxed, 1.0, rtol=1e-6)

# %% tags=["hide-input"]
fine = np.linspace(1.2, 30, 100)
figure, axes = plt.subplots(figsize=(7.5, 3.8))
axes.loglog(fine, 1 + GA * fine**2 / (12 * EI), color=style.GREY, lw=1.2, label=r"$1 + GA\,h^2/(12\,EI)$")
axes.loglog(h, full, "s", ms=8, color=style.VERMILION, label="integrated exactly")
axes.loglog(h, relaxed, "o", ms=8, color=style.BLUE, label="one point per element")
axes.set(xlabel="length of an element, m", ylabel="computed stiffness / true stiffness", ylim=(0.5, 3e4))
axes.set_xticks([2, 5, 10, 20], ["2", "5", "10", "20"])
axes.minorticks_off()
axes.legend()
axes.set_title("Straight elements that lock, and the same ones that do not")
plt.show()

# %% [markdown]
# The package uses cubic elements by default, with three points each. Then even long elements bend as they
# should.

# %% [markdown]
# ## 9. The power balance: does it all add up?
#
# There is one virtual motion that tells us more than all others: the real one. Put the actual velocity in
# the place of $\delta\mathbf r$ and $\delta\boldsymbol\theta_m$. Then each term of virtual work becomes a
# power, in watts. Inertia becomes the rate of the kinetic energy. The internal terms become the rate of the
# elastic energy. Damping becomes heat per second. And their sum must be zero at every instant, since the
# virtual work vanishes for *every* virtual motion. So we get the law of conservation of energy for free,
# term by term, from the very terms that are solved.
#
# We try it on a rubber cord. It is a metre long and four centimetres thick. It is pinned at one end, starts
# level and at rest, and falls under its own weight. We take soft rubber, of one megapascal, and add some
# damping, $c_d = 30$ milliseconds. The package marches it through time. At some moments we stop and ask for
# the accelerations, which enter the form linearly, and so need one linear solve. Then we evaluate the named
# terms, and beside them the rates of three energies.

# %%
scene = load_scene("pendulum", {"material.youngs_modulus": "1 MPa", "material.retardation_time": "30 ms"})
cord = Rod(scene)
print("model chosen:", cord.model, "with", cord.size, "unknowns")

residual = virtual_work.total(cord.terms)
inertia_matrix = MatrixForm(ufl.derivative(residual, cord.u_dot, ufl.TrialFunction(cord.V)))
powers = virtual_work.powers(cord.ansatz, cord.u, cord.u_dot, cord.s, cord.section, cord.loads, cord.on)
names = ("inertia", "internal force", "internal moment", "damping", "gravity")
watts = {name: ScalarForm(powers[name]) for name in names}
position, _ = planar.split(cord.u)
centre = planar.configuration(position, cord.s).r
given = (cord.s, cord.section, cord.loads, cord.on)
energies = {
    "kinetic": virtual_work.kinetic_energy(planar, cord.u, *given),
    "elastic": virtual_work.strain_energy(planar, position, *given),
    "height": -cord.section["mass"] * ufl.dot(cord.loads.g, centre) * cord.on.mass,
}
energy_rates = [ScalarForm(ufl.derivative(energy, cord.u, cord.u_dot)) for energy in energies.values()]

history, shapes = [], []


def rates(u):
    """The u-dot that makes F(u, u-dot) = 0: F is linear in it."""
    F, M = np.zeros(cord.size), np.zeros(cord.size)
    cord.residual(0.0, u, 0 * u, F)
    M = inertia_matrix.dense()
    F[cord.held], M[cord.held, :], M[cord.held, cord.held] = 0.0, 0.0, 1.0
    return np.linalg.solve(M, -F)


def observe(time, u):
    if round(1000 * time) % 10 == 0:
        cord.set_state(u, rates(u))
        history.append([time, *(power() for power in [*watts.values(), *energy_rates])])
    if round(1000 * time) % 80 == 0:
        cord.set_state(u, 0 * u)
        shapes.append(cord.shape()[0])


march(cord, initial_state(cord), end=1.2, observe=observe)
time, inertia, force, moment, damping, gravity, kinetic, elastic, height = np.array(history).T
largest = np.abs(gravity).max()
unbalanced = np.abs(inertia + force + moment + damping + gravity).max()
print(f"the largest power is {largest:.2f} W, the sum of all is at most {unbalanced:.0e} W")
assert unbalanced < 1e-9 * largest
assert np.allclose(inertia, kinetic, atol=1e-9 * largest)
assert np.allclose(force + moment, elastic, atol=1e-7 * largest)
assert np.allclose(gravity, height, atol=1e-9 * largest)
assert damping.min() >= 0.0 and damping.max() > 0.01 * largest

# %% tags=["hide-input"]
figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.0), width_ratios=(1, 1.25))
for k, shape in enumerate(shapes):
    left.plot(shape[:, 2], -shape[:, 0], color=plt.cm.cividis(k / len(shapes)), lw=3)
left.plot(0, 0, "o", color=style.INK, ms=7)
left.set(aspect="equal", xlabel="m", ylabel="m", title="a rubber cord, every 80 ms")
right.plot(time, inertia, color=style.BLUE, label="into motion")
right.plot(time, force + moment, color=style.GREEN, label="into elastic energy")
right.plot(time, damping, color=style.VERMILION, label="into heat")
right.plot(time, gravity, color=style.PURPLE, label="from gravity")
right.plot(time, inertia + force + moment + damping + gravity, color=style.INK, lw=2.4, label="sum")
right.set(xlabel="time, s", ylabel="power, W", xlim=(0, 1.2))
right.set_title("the terms of the weak form along the motion")
right.legend(loc="center left", bbox_to_anchor=(1, 0.5), fontsize=9)
figure.tight_layout()
plt.show()

# %% [markdown]
# The black line is zero to the last digits of the machine. That is no merit of small time steps. It is the
# equation itself, read along the motion, so the line says only that the equation was solved. The merit is
# in the other assertions. They take three energies that we wrote down without any weak form: one half of
# mass times speed squared, one half of strain times stress, and weight times height. UFL differentiates
# them in time. The inertia term *is* the rate of the first, the internal terms *are* the rate of the
# second, and the gravity term is the rate of the third. What is left is heat, and it never runs backwards.
# So the sum of the three energies falls by just what becomes heat. A slip in the sign of one term, and one
# of these lines fails.
#
# Whether the *stored* energy is still right after many steps is a second question. It tests the time
# integrator, and `drillfem` reports it for every run.

# %% [markdown]
# ## 10. Your turn: the ruler
#
# Take a steel ruler: one metre long, 30 millimetres wide, one millimetre thick. Clamp it at one end on the
# edge of a table. It reaches out horizontally, along $\mathbf e_3$. Forget its weight. Press on the tip
# with a force $F$, downwards, along $\mathbf e_1$. How far does the tip go down?
#
# The number that decides is $FL^2/EI$, a force measured in units of the ruler's stiffness. One unit is
# about half a newton, a slice of cheese. Euler solved the problem as the *elastica*. The deflections $w/L$
# are known:
#
# | $FL^2/EI$ | 1 | 2 | 5 | 10 |
# |---|---|---|---|---|
# | $w/L$, the elastica | 0.3017 | 0.4935 | 0.7138 | 0.8106 |
#
# Chapter 3 of the thesis compares three models here. CR3 is the full rod, and it should meet this table.
# CR1 is the linear one that you know from the handbook, $w = FL^3/3EI$. CR2 turns its sections properly,
# but takes the arm $\mathbf r'$ in the balance of moments as $\mathbf e_3$, as though the rod were still
# straight.
#
# **Exercise.** Find the deflection of the three models at the four loads. The functions `clamped_rod` and
# `equilibrium` are all you need for CR3. Raise the force in steps, so that Newton's method always starts
# near the answer. For CR1, think about what a single Newton step from the straight rod means. For CR2, you
# must write two lines of weak form yourself. Look at section 4 for the place where $\mathbf r'$ enters.

# %%
E, G = 210e9, 80e9  # Pa
width, thickness, L = 0.030, 0.001, 1.0  # m
A, I = width * thickness, width * thickness**3 / 12  # m2, m4
ruler = {"shear1": G * A, "shear2": G * A, "axial": E * A, "bending2": E * I}
units = (1, 2, 5, 10)  # F L^2 / EI
table = {
    "CR1": (0.3333, 0.6667, 1.6667, 3.3333),
    "CR2": (0.3239, 0.5935, 0.7411, -0.2506),
    "CR3": (0.3017, 0.4935, 0.7138, 0.8106),
}

your_deflections = {}  # your answer: for instance {"CR3": [0.30, ...]}


def compare(deflections):
    for model, w in deflections.items():
        print(model, "computed", np.round(w, 4), " known", np.array(table[model]))
        assert np.allclose(w, table[model], atol=1e-4), f"{model} is not there yet"


compare(your_deflections)

# %% [markdown]
# **Solution.** For the full rod we raise the load in forty steps and note the tip at each.
#
# For the linear rod, one Newton step: solve the equations that are linearised about the straight rod, and
# stop. Linear theory is nothing else.
#
# For CR2, the moment of the force came from $\delta\boldsymbol\theta \cdot (\mathbf r' \times \mathbf n)$.
# With $\mathbf r'$ replaced by $\mathbf e_3$, the internal force works on $\delta\mathbf r' -
# \delta\boldsymbol\theta \times \mathbf e_3$, and nothing else changes.


# %%
def deflections(rod, newton, **options):
    """Tip deflection over length at the loads 0, 0.25, ... 10."""
    straight, found = rod.x.x.array.copy(), []
    for load in np.linspace(0, 10, 41):
        rod.force.value[0] = load * E * I / L**2
        if options:
            rod.x.x.array[:] = straight
        newton(**options)
        found.append(rod.x.x.array[rod.tip][0] / L)
    return np.array(found)


rod = clamped_rod(ruler, L, elements=16)
newton = equilibrium(rod)
CR1 = deflections(rod, newton, iterations=1)
rod.x.x.array[:] = clamped_rod(ruler, L, elements=16).x.x.array  # straight again
CR3 = deflections(rod, newton)

rod2 = clamped_rod(ruler, L, elements=16)
at = planar.configuration(rod2.x, None)
nudge = planar.variation(rod2.test, rod2.x)
n_m, _ = constitutive.elastic_resultants(at, rod2.section, no_curvature)
arm = ufl.as_vector((0, 0, 1))  # the line that makes it CR2: should be r'
wrong_work = ufl.dot(at.R * n_m, nudge.v.dx(0) - ufl.cross(at.R * nudge.w, arm))
CR2 = deflections(rod2, equilibrium(rod2, rod2.terms | {"internal force": wrong_work * rod2.on.internal}))

loads = np.linspace(0, 10, 41)
pick = [int(np.argmin(np.abs(loads - u))) for u in units]
compare({"CR1": CR1[pick], "CR2": CR2[pick], "CR3": CR3[pick]})

# %% tags=["hide-input"]
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), width_ratios=(1, 1.2))
for u in (0, *units):
    r2 = clamped_rod(ruler, L, elements=16)
    solve = equilibrium(r2)
    for load in np.linspace(0, u, 2 * u + 1):
        r2.force.value[0] = load * E * I / L**2
        solve()
    line = r2.x.x.array.reshape(-1, 3)[r2.order]
    left.plot(line[:, 1], -line[:, 0], lw=3, color=plt.cm.cividis(u / 11))
    left.text(line[-1, 1] + 0.02, -line[-1, 0] - 0.03, f"{u}", color=style.GREY)
left.set(aspect="equal", xlim=(-0.02, 1.1), ylim=(-0.95, 0.08), xlabel="m", ylabel="m")
left.set_title(r"the ruler at $FL^2/EI = 0, 1, 2, 5, 10$")
right.plot(loads, CR1, color=style.ORANGE, label="CR1: linear")
right.plot(loads, CR2, color=style.GREEN, label=r"CR2: arm $\mathbf{e}_3$")
right.plot(loads, CR3, color=style.BLUE, label=r"CR3: the full rod")
right.plot(units, table["CR3"], "o", color=style.INK, ms=6, label="elastica, known")
right.set(xlabel="$FL^2/EI$", ylabel="deflection $w/L$", ylim=(-0.4, 1.8), xlim=(0, 10.3))
right.legend(loc="upper left", fontsize=9)
right.set_title("which arm you take decides")
figure.tight_layout()
plt.show()

# %% [markdown]
# CR2 is the instructive one. It bends more and more, and at a load of ten its tip comes up *above* the
# table. It knows large rotations, and yet it is wrong. It never learns that the arm of the force becomes
# shorter as the ruler hangs down. A term of the balance law is missing its partner, and no mesh in the
# world will mend that.
#
# With the package, such a problem is a *scene*: a description of what is to be computed, in a text file.
# One of the scenes that come with it is `roll-up`. A strip of ten metres is clamped, and a moment of $2\pi
# EI/L$ turns its free end. In pure bending the curvature is $M/EI$, the same everywhere. So the strip must
# close to a full circle of circumference $L$. Its tip returns to the clamp, having turned by $2\pi$.

# %%
scene = load_scene("roll-up")
strip = Rod(scene)
full_moment, rolling = strip.tip_moment.value.copy(), []


def set_load(factor):
    strip.tip_moment.value = factor * full_moment


problem = Statics(strip)
problem.solve(
    problem.start(initial_state(strip)),
    np.linspace(0.1, 1, 10),
    set_load,
    on_step=lambda factor, x: rolling.append(x.reshape(-1, 3)[strip.nodes]),
)
circle = rolling[-1]
print("tip at", circle[-1, :2].round(9) + 0.0, f"m, turned by {circle[-1, 2] / (2 * np.pi):.9f} turns")
print(f"diameter {np.ptp(circle[:, 0]):.6f} m; L/pi = {scene.length / np.pi:.6f} m")
assert np.allclose(circle[-1], (0, 0, 2 * np.pi), atol=1e-6)
assert np.isclose(np.ptp(circle[:, 0]), scene.length / np.pi, rtol=1e-4)

# %% tags=["hide-input"]
figure, axes = plt.subplots(figsize=(7, 4.6))
for k, line in enumerate(rolling):
    axes.plot(line[:, 1], -line[:, 0], lw=3, color=plt.cm.cividis(k / 10))
axes.set(aspect="equal", xlabel="m", ylabel="m", title="ten steps of the moment roll the strip to a circle")
plt.show()

# %% [markdown]
# ## 11. Your turn: a string that hangs
#
# Now the real thing. A thousand metres of drill pipe hang from the hook of a rig. Below them come two
# hundred metres of thick pipes, called *collars*. Their weight is what pushes the bit into the rock. The
# driller lets the hook carry all but a chosen part of the weight, $W_0$, in newtons. It is called the
# *weight on bit*, and it rests on the rock.
#
# The string is straight, so one component is left of the balance of momentum: $n_3' + \rho A g = 0$, with
# $n_3$ the tension. The hook carries $n_3(0) = H_0$, the *hook load*. The rock pushes up, so $n_3(L) =
# -W_0$. (The print of (6-8) lacks this minus sign.) Let $f(s)$ be the displacement of section $s$ down the
# hole, in metres. The tension stretches the pipe, $EA\,f' = n_3$. Integrated twice by hand, this is (6-2).
# For the pipe:
#
# $$ f(s) = \frac{s\,(2 H_0 - \rho A_p\, g\, s)}{2 E A_p}, \qquad s \le L_p, $$
#
# and it continues through the collars with their own area $A_c$. The section is then found at $r_3(s) = s +
# f(s)$. (The print of (6-3) lacks the $s$.)
#
# **Exercise.** Load the scene `vertical-c1-cd4`. Find its static equilibrium. Check the displacement of the
# bit against (6-2), the tension at the bit against $-W_0$, and the tension at the hook against the weight
# of the string less $W_0$. Then find the *neutral point*, where tension becomes compression. It should be
# inside the collars. Why does a driller want that?

# %%
scene = load_scene("vertical-c1-cd4")
nominal = scene.nominal()
W0, H0 = nominal.weight_on_bit, nominal.hook_load
for what, force in {"the string weighs": scene.weight, "weight on bit": W0, "hook load": H0}.items():
    print(f"{what:18s}{force / 1e3:8.2f} kN")

your_displacement_of_the_bit = None  # your answer, in metres

# %% [markdown]
# **Solution.** A straight string needs only a depth and an angle per section, and the package chooses that
# model by itself. The form knows the rock through two numbers, a weight and a torque, `rod.weight` and
# `rod.torque`. We raise both to their values in steady drilling. The problem is linear, so one load step is
# plenty.

# %%
string = Rod(scene)
print("model chosen:", string.model, "with", len(string.nodes), "nodes")


def set_rock(factor):
    string.weight.value = factor * W0
    string.torque.value = factor * nominal.torque_on_bit


problem = Statics(string)
answer = problem.solve(problem.start(initial_state(string)), np.array([1.0]), set_rock)

state = np.zeros((len(string.nodes), string.ansatz.size))
state[:, : answer.x.shape[1]] = answer.x
string.set_state(state.reshape(-1), 0 * state.reshape(-1))
arc, tension = string.arc_length, string.resultants()[0][:, 2]
displacement = string.shape()[0][:, 2] - arc
twist = answer.x[string.nodes, 1]

# %%
drill_pipe, collars = scene.string
g, rho, Y = scene.gravity.magnitude, scene.material.density, scene.material.youngs_modulus
Ap, Ac, Lp, depth = drill_pipe.area, collars.area, drill_pipe.length, scene.length


def f(s):
    """The static displacement (6-2), in metres, integrated by hand."""
    pipe = s * (2 * H0 - rho * Ap * g * s) / (2 * Y * Ap)
    joint = Lp * (2 * H0 - rho * Ap * g * Lp) / (2 * Y * Ap)
    at_joint, d = H0 - rho * Ap * g * Lp, s - Lp
    return np.where(s <= Lp, pipe, joint + d * (2 * at_joint - rho * Ac * g * d) / (2 * Y * Ac))


neutral = np.interp(0.0, -tension, arc)
print(f"displacement of the bit {displacement[-1]:.6f} m; (6-2) gives {f(depth):.6f} m")
print(f"tension at the hook {tension[0] / 1e3:.4f} kN, at the bit {tension[-1] / 1e3:.4f} kN")
print(f"neutral point {depth - neutral:.2f} m above the bit; twist {twist[-1]:.3f} rad")
assert np.allclose(displacement, f(arc), atol=1e-8)
assert np.isclose(tension[-1], -W0, rtol=1e-8)
assert np.isclose(tension[0], H0, rtol=1e-8) and np.isclose(H0, scene.weight - W0)
assert np.isclose(depth - neutral, W0 / (rho * Ac * g), rtol=1e-6)
assert np.isclose(twist[-1], -3.64, atol=0.01)
assert your_displacement_of_the_bit is None or np.isclose(your_displacement_of_the_bit, f(depth), atol=1e-3)

# %% tags=["hide-input"]
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 5), sharey=True)
left.plot(1000 * f(arc), arc, color=style.GREY, lw=5, alpha=0.4, label="(6-2), by hand")
left.plot(1000 * displacement, arc, color=style.BLUE, label="the weak form")
left.set(xlabel="displacement $f$, mm", ylabel="arc length $s$, m", ylim=(depth, 0), xlim=(0, None))
left.legend(loc="lower left")
left.set_title("how far each section hangs down")
right.plot(tension / 1e3, arc, color=style.BLUE)
right.axvline(0, color=style.INK, lw=0.8)
right.axhspan(Lp, depth, color=style.FAINT, alpha=0.5, lw=0)
right.text(360, Lp + 60, "collars", color=style.GREY, va="center")
right.plot(0, neutral, "o", color=style.VERMILION)
right.text(22, neutral + 4, "neutral point", color=style.VERMILION, va="center")
right.set(xlabel="tension $n_3$, kN")
right.set_title("who carries the weight")
figure.tight_layout()
plt.show()

# %% [markdown]
# The neutral point lies 38 metres above the bit, well inside the collars. That is the answer to the last
# question. Everything above that point is in tension, and a rope in tension stays straight. Everything
# below is in compression and might buckle. So one makes that part of thick pipe.
#
# The string is also wound up: the torque of the rock has twisted it by more than half a turn, and that is
# steady drilling. Release that spring at the wrong moment, and the bit will stick, and slip, and whip
# around. That is what this project is about.

# %% [markdown]
# ## 12. Where to go on
#
# You have seen every term of the rod. Four modules hold them. Read them in this order:
# `forms/kinematics.py`, then `forms/constitutive.py`, `forms/ansatz.py` and `forms/virtual_work.py`.
# Together they are a few hundred lines, and half of that is explanation. Contact with the wall and its
# friction are in the last one: try to derive the friction term as a virtual work of the point that touches
# the wall.
#
# The rock comes next. Its surface is a small equation of its own, in `forms/surface.py`: the bit turns, and
# what one blade leaves behind is what the next blade finds. That memory is what makes a bit chatter.
#
# Then let it move. On the command line, `drillfem run vertical-c1-cd4 --out my-first-hole` drills for 200
# seconds, and `drillfem render my-first-hole` draws it. In Python, `drillfem.simulate(scene)` does the
# same. Change the damping from `1e-4` to `1e-5` seconds, and watch the bit stick.
#
# And if you doubt a term of the rod: put a wrong sign into it, run this notebook again, and see which
# assertion catches you.
