"""Where methods fail on a drilling string: experiments for tests/stability and benchmarks/failure_atlas.py."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.linalg import eigh

from drillfem.models.straight import StraightString
from drillfem.scene import Scene, load_scene
from drillfem.solve.run import simulate

Array = npt.NDArray[np.float64]


# -- explicit steps ---------------------------------------------------------------------------------------------------
def central_differences(factor: float, steps: int, elements: int = 24, degree: int = 1) -> tuple[Array, float, float]:
    """Largest spin (steps,) of the thesis' undamped string in twist, stepped explicitly at ``factor`` times the limit.

    Returns it with the limit 2/omega of the fastest wave of the mesh (s), and h/c of the mesh (s).
    """
    scene = load_scene("cutting-c1", {"model": "torsional", "mesh.elements": elements, "mesh.degree": degree})
    line = StraightString(scene)
    free = slice(1, None)  # the top is held
    mass, stiff = line.torsion.mass[free, free], line.torsion.stiffness[free, free]
    fastest = math.sqrt(eigh(stiff, mass, eigvals_only=True)[-1])
    h = factor * 2 / fastest
    rate = np.linalg.solve(mass, stiff)
    s = line.arc_length[free]
    twist, spin = np.zeros(len(s)), np.exp(-(((s - 600) / 150) ** 2))
    spin = spin - h / 2 * rate @ twist
    size = []
    for _ in range(steps):
        twist = twist + h * spin
        spin = spin - h * rate @ twist
        size.append(abs(spin).max())
    G, density = 77e9, 7800.0
    return np.array(size), 2 / fastest, 1200.0 / elements / degree / math.sqrt(G / density)


def growth_near(signal: Array, interval: float, frequency: float, room: float = 1.0) -> float:
    """Growth (1/s) of the strongest motion exp(s t) of a signal within ``room`` of a frequency (Hz); or nan.

    Exponentials are taken from the shift of the signal's subspace (ESPRIT), on samples about eight to the period.
    """
    every = max(1, round(1 / (8 * frequency * interval)))
    y, h = signal[::every], every * interval
    hankel = np.lib.stride_tricks.sliding_window_view(y / abs(y).max(), len(y) // 3).T
    u, size, _ = np.linalg.svd(hankel, full_matrices=False)
    rank = min(40, np.count_nonzero(size > 1e-7 * size[0]))
    z = np.linalg.eigvals(np.linalg.lstsq(u[:-1, :rank], u[1:, :rank], rcond=None)[0])
    z = z[abs(np.log(abs(z))) * len(y) < 60]
    weight = abs(np.linalg.lstsq(z ** np.arange(len(y))[:, None], y.astype(complex), rcond=None)[0])
    s = np.log(z) / h
    near = abs(s.imag / (2 * np.pi) - frequency) < room
    return float(s.real[near][np.argmax(weight[near])]) if near.any() else math.nan


# -- the rock surface -------------------------------------------------------------------------------------------------
def cutting_wave(scene: Scene, end: float = 8.0) -> tuple[Array, Array, float]:
    """Axial speed of the bit over the nominal one, less 1, in a run: time (n,), value (n,), and its growth (1/s).

    The growth is that of the motion near 11 Hz, where the bit and the rock that it cuts vibrate; a slow twist of the
    string, which neither grows nor dies, lies beneath it.
    """
    history = simulate(scene, until=end).history
    t, y = history["time"].values, history["bit_axial_speed"].values / scene.nominal().rate_of_penetration - 1
    far = int(np.argmax(abs(y) > 0.05)) or len(y)
    small = y[: min(far, round(3.0 / (t[1] - t[0])))]
    return t, y, growth_near(small[100:], t[1] - t[0], 11.0, 2.0)


def surface_scene(speed: float, elements: int, scheme: str = "upwind", degree: int = 0) -> Scene:
    """Case C1, lumped, at a speed of the top (rad/s), on a rock surface of so many elements."""
    surface = {"rock.surface.scheme": scheme, "rock.surface.elements": elements, "rock.surface.degree": degree}
    return load_scene(
        "cutting-c1", {"model": "lumped", "top_drive.speed": speed, "initial.spin_perturbation": 1e-5} | surface
    )


def cutting_growth(engine: str, steps: int, frequency: float = 13.34) -> float:
    """Growth (1/s) of a motion of chapter 6's string at c_d = 1e-4 s, with so many steps between two blades.

    The characteristic roots are 1.8705 + 83.8196i (13.34 Hz) and 1.8819 + 165.4152i (26.33 Hz). Nan if none is near.
    """
    scene = load_scene("vertical-c1-cd4", {"mesh.elements": 24, "initial.spin_perturbation": 1e-6})
    h, end = scene.blade_passage / steps, 4.0
    scene = replace(
        scene,
        time=replace(scene.time, end=end, step=h, engine=engine),
        output=replace(scene.output, interval=h, fields_interval=end, checkpoint_interval=end),
    ).checked()
    history = simulate(scene).history
    depth = history["depth_of_cut"].values[len(history["time"]) // 3 :] / scene.nominal().depth_of_cut - 1
    return growth_near(depth, h, frequency)
