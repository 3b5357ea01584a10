"""A head-less studio: meshes of tubes, bits and rock, and an off-screen plotter that photographs them.

Pictures come back as RGBA arrays over nothing; matplotlib sets them on the page with their axes and words.
All world coordinates are the rod's: e3 points down, so the camera's "up" is -e3.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from drillfem.errors import MissingDependency
from drillfem.render.story import Pose

if TYPE_CHECKING:
    import pyvista as pv

UP = (0.0, 0.0, -1.0)
SIDES = 64
STEEL, DARK_STEEL, CUTTER = (0.66, 0.69, 0.73), (0.34, 0.37, 0.41), (0.12, 0.13, 0.15)
BRASS = (0.79, 0.63, 0.28)
SAND, DARK_SAND = np.array([0.86, 0.79, 0.68]), np.array([0.71, 0.62, 0.50])
STRIPE, STRIPE_EDGE = (255, 255, 255), (24, 26, 30)
ARROW = (0.835, 0.369, 0.0)


def load_pyvista() -> Any:
    """The module, or MissingDependency in one line."""
    try:
        import pyvista
    except ModuleNotFoundError as reason:
        raise MissingDependency(
            "pictures of the string need pyvista, which is not installed: pip install pyvista"
        ) from reason
    except ImportError as reason:  # a system library is missing, mostly libGL or libXrender
        said = " ".join(str(reason).split())
        raise MissingDependency(
            f"pyvista cannot be loaded ({said}): apt-get install libgl1 libegl1 libxrender1"
        ) from reason
    from vtkmodules.vtkCommonCore import vtkLogger

    # without a display VTK tries X first, says so, and then renders off screen as it should
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    return pyvista


@dataclass(frozen=True)
class Thing:
    """A mesh with its paint: one colour, a texture (the mesh carries its coordinates), or point colours."""

    mesh: Any
    colour: tuple[float, ...] | str = STEEL
    texture: np.ndarray | None = None
    point_colours: str | None = None
    opacity: float = 1.0
    specular: float = 0.25
    ambient: float = 0.26
    diffuse: float = 0.88
    lighting: bool = True


@dataclass(frozen=True)
class Camera:
    """Where from and where to; `half_height` (world units) makes it a parallel projection."""

    position: tuple[float, float, float]
    focus: tuple[float, float, float]
    up: tuple[float, float, float] = UP
    half_height: float | None = None
    angle: float = 24.0


class Studio:
    """One plotter for all shots. Use as a context manager; the plotter is closed at the end."""

    OVERSAMPLE = 2

    def __init__(self) -> None:
        pyvista = load_pyvista()
        self._pv = pyvista
        self._plotter: pv.Plotter = pyvista.Plotter(off_screen=True, lighting="none")

    def __enter__(self) -> Studio:
        return self

    def __exit__(self, *_: object) -> None:
        self._plotter.close()

    def shoot(self, things: Sequence[Thing], camera: Camera, width: int, height: int) -> np.ndarray:
        """Photograph: (height, width, 4) uint8 with straight alpha, transparent where there is nothing."""
        plotter, k = self._plotter, self.OVERSAMPLE
        plotter.clear_actors()
        plotter.remove_all_lights()
        plotter.render_window.SetSize(k * width, k * height)  # plotter.window_size would render as well
        for thing in things:
            style: dict[str, Any] = {
                "opacity": thing.opacity,
                "specular": thing.specular,
                "specular_power": 18,
                "ambient": thing.ambient,
                "diffuse": thing.diffuse,
                "lighting": thing.lighting,
                "smooth_shading": "Normals" in thing.mesh.point_data,
                "show_scalar_bar": False,
                "reset_camera": False,
                "render": False,
            }
            if thing.texture is not None:
                picture = self._pv.Texture(np.ascontiguousarray(thing.texture))
                picture.interpolate, picture.mipmap = True, True
                plotter.add_mesh(thing.mesh, texture=picture, **style)
            elif thing.point_colours is not None:
                plotter.add_mesh(thing.mesh, scalars=thing.point_colours, rgb=True, **style)
            else:
                plotter.add_mesh(thing.mesh, color=thing.colour, **style)
        for place, strength in (((-0.5, 0.9, 1.2), 0.95), ((1.1, 0.1, 0.9), 0.45)):
            light = self._pv.Light(position=place, light_type="camera light", intensity=strength)
            plotter.add_light(light)
        view = plotter.camera
        view.position, view.focal_point, view.up = camera.position, camera.focus, camera.up
        if camera.half_height is not None:
            view.parallel_projection = True
            view.parallel_scale = camera.half_height
        else:
            view.parallel_projection = False
            view.view_angle = camera.angle
        plotter.renderer.ResetCameraClippingRange()
        plotter.render()
        shot = np.asarray(plotter.screenshot(transparent_background=True, return_img=True))
        return _shrink(shot, k)


def _shrink(shot: np.ndarray, k: int) -> np.ndarray:
    """Average k x k pixels with premultiplied alpha, so that edges blend with any page."""
    rgba = shot.astype(np.float32)
    alpha = rgba[..., 3:] / 255
    premultiplied = np.concatenate([rgba[..., :3] * alpha, alpha], axis=2)
    h, w = shot.shape[0] // k, shot.shape[1] // k
    small = premultiplied[: h * k, : w * k].reshape(h, k, w, k, 4).mean(axis=(1, 3))
    cover = small[..., 3:]
    colour = np.divide(small[..., :3], cover, out=np.zeros_like(small[..., :3]), where=cover > 0)
    return np.concatenate([colour, 255 * cover], axis=2).round().clip(0, 255).astype(np.uint8)


# -- meshes ----------------------------------------------------------------------------------------------
def surface(points: np.ndarray, normals: np.ndarray, closed: bool, uv: np.ndarray | None = None) -> Any:
    """Quads over points (rows, columns, 3) with normals; closed: the last column meets the first."""
    pyvista = load_pyvista()
    rows, columns = points.shape[:2]
    if closed:  # the seam is doubled, so that texture coordinates run to 1 there
        points = np.concatenate([points, points[:, :1]], axis=1)
        normals = np.concatenate([normals, normals[:, :1]], axis=1)
        columns += 1
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    # VTK lights the side from which a face runs counter-clockwise: let that be the side of the normals
    across = np.cross(points[1:, 1:] - points[:-1, :-1], points[1:, :-1] - points[:-1, 1:])
    if np.sum(across * normals[:-1, :-1]) < 0:
        b, d = d, b
    faces = np.stack([np.full(a.size, 4), a.ravel(), b.ravel(), c.ravel(), d.ravel()], axis=1)
    mesh = pyvista.PolyData(points.reshape(-1, 3), faces.ravel())
    mesh.point_data.set_array(normals.reshape(-1, 3).astype(np.float32), "Normals")
    mesh.point_data.active_normals_name = "Normals"
    if uv is not None:
        mesh.active_texture_coordinates = uv.reshape(-1, 2)
    return mesh


def resample(pose: Pose, arc: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, d1, d3 (m, 3) at arc lengths: cubic through the nodes, directors orthonormal."""
    from scipy.interpolate import CubicSpline

    arc = np.clip(arc, pose.arc[0], pose.arc[-1])
    knots, keep = np.unique(pose.arc, return_index=True)
    if len(knots) > 3:
        position = CubicSpline(knots, pose.position[keep])(arc)
    else:
        position = np.stack([np.interp(arc, knots, pose.position[keep, k]) for k in range(3)], axis=1)
    d3 = np.stack([np.interp(arc, knots, pose.director3[keep, k]) for k in range(3)], axis=1)
    d1 = np.stack([np.interp(arc, knots, pose.director1[keep, k]) for k in range(3)], axis=1)
    d3 /= np.maximum(np.linalg.norm(d3, axis=1, keepdims=True), 1e-12)
    d1 -= np.sum(d1 * d3, axis=1, keepdims=True) * d3
    d1 /= np.maximum(np.linalg.norm(d1, axis=1, keepdims=True), 1e-12)
    return position, d1, d3


def tube(position: np.ndarray, d1: np.ndarray, d3: np.ndarray, radius: np.ndarray, v: np.ndarray) -> list[Any]:
    """Skin and the two end discs of a tube with rings of `radius` (m,) around `position` (m, 3).

    Texture coordinates: u = angle / 2 pi from d1 about d3, v (m,) as given. Where neighbouring rings differ
    in radius at the same place there is a shoulder; it gets its own rings, lit along the axis.
    """
    angle = 2 * math.pi * np.arange(SIDES) / SIDES
    d2 = np.cross(d3, d1)
    out = np.cos(angle)[None, :, None] * d1[:, None, :] + np.sin(angle)[None, :, None] * d2[:, None, :]
    skin = position[:, None, :] + radius[:, None, None] * out
    normals = np.array(out)
    step = np.flatnonzero((np.abs(np.diff(radius)) > 1e-12) & (np.abs(np.diff(v)) < 1e-12))
    rows = [np.arange(len(radius))]
    for i in step:  # rings i and i+1 twice, with axial normals between
        rows.append(np.array([i, i + 1]))
    u = np.linspace(0, 1, SIDES + 1)
    meshes = []
    breaks = [0, *(int(i) + 1 for i in step), len(radius)]
    for first, last in pairwise(breaks):
        piece = slice(first, last)
        uv = np.stack(np.broadcast_arrays(u[None, :], v[piece, None]), axis=2)
        if last - first > 1:
            meshes.append(surface(skin[piece], normals[piece], True, uv))
    for i in step:
        sign = math.copysign(1.0, radius[i] - radius[i + 1])
        axial = np.broadcast_to(sign * d3[i], (2, SIDES, 3))
        uv = np.stack(np.broadcast_arrays(u[None, :], v[i : i + 2, None]), axis=2)
        meshes.append(surface(skin[i : i + 2], axial, True, uv))
    for end, sign in ((0, -1.0), (len(radius) - 1, 1.0)):
        rings = np.stack([np.broadcast_to(position[end], (SIDES, 3)), skin[end]])
        uv = np.stack(np.broadcast_arrays(u[None, :], np.full((2, 1), v[end])), axis=2)
        meshes.append(surface(rings, np.broadcast_to(sign * d3[end], (2, SIDES, 3)), True, uv))
    return meshes


def paint(
    colours: np.ndarray, width: int = 512, half: float = 0.21, edge: float = 0.05, centre: float = 0.0
) -> np.ndarray:
    """Texture (n, width, 3) uint8: `colours` (n, 3) in 0..1 along the string, a white stripe with dark edges
    along d1 and a thin dark line along -d1, so that every view of the tube shows how it has turned.

    half, edge: half width of the stripe and width of its edges, rad; centre: its angle from d1, rad."""
    angle = (2 * math.pi * (np.arange(width) + 0.5) / width - centre + math.pi) % (2 * math.pi) - math.pi
    picture = np.repeat((255 * colours).round().astype(np.uint8)[:, None, :], width, axis=1)
    picture[:, np.abs(angle) < half + edge] = STRIPE_EDGE
    picture[:, np.abs(angle) < half] = STRIPE
    picture[:, np.abs(angle) > math.pi - 2.2 * edge] = STRIPE_EDGE
    return picture[::-1]  # the first row of an image is its top, v = 1


def lathe(profile: Sequence[tuple[float, float]], start: float = 0.0, stop: float = 2 * math.pi) -> Any:
    """Turned body around e3 through the origin: (radius, z) corners from the top down."""
    angle = np.linspace(start, stop, SIDES + 1)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    pieces = []
    for (r0, z0), (r1, z1) in pairwise(profile):
        points = np.stack([r0 * ring + [0, 0, z0], r1 * ring + [0, 0, z1]])
        slant = np.array([z1 - z0, -(r1 - r0)])
        slant = slant / max(float(np.hypot(*slant)), 1e-12)
        normal = slant[0] * ring + [0, 0, slant[1]]
        pieces.append(surface(points, np.stack([normal, normal]), False))
    return join(pieces)


def join(meshes: Sequence[Any]) -> Any:
    """One mesh of many."""
    return meshes[0].append_polydata(*meshes[1:]) if len(meshes) > 1 else meshes[0]


def box(corner: Sequence[float], size: Sequence[float]) -> Any:
    """Axis-parallel box from its least corner."""
    low, high = (
        np.asarray(corner, dtype=float),
        np.asarray(corner, dtype=float) + np.asarray(size, dtype=float),
    )
    return load_pyvista().Box((low[0], high[0], low[1], high[1], low[2], high[2]))


def turning_arrow(radius: float, z: float, start: float, turn: float, thick: float) -> Any:
    """An arc around e3 from `start` through `turn` rad with a head at its end."""
    pyvista = load_pyvista()
    turn = math.copysign(min(abs(turn), 1.94 * math.pi), turn)
    head = min(5.5 * thick / radius, 0.6 * abs(turn)) * math.copysign(1.0, turn)
    angle = start + np.linspace(0, turn - head, 60)
    line = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full_like(angle, z)], axis=1)
    tangent = np.stack([-np.sin(angle), np.cos(angle), np.zeros_like(angle)], axis=1)
    outward = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    shaft = join(tube(line, outward, tangent, np.full(60, thick), np.linspace(0, 1, 60)))
    a = start + turn - head
    tip = start + turn
    base = np.array([radius * math.cos(a), radius * math.sin(a), z])
    point = np.array([radius * math.cos(tip), radius * math.sin(tip), z])
    cone = pyvista.Cone(
        center=(base + point) / 2,
        direction=point - base,
        height=float(np.linalg.norm(point - base)),
        radius=2.8 * thick,
        resolution=32,
    )
    return join([shaft, cone.triangulate()])


@lru_cache(maxsize=8)
def strata(rows: int, columns: int, seed: int = 5) -> np.ndarray:
    """A quiet picture of layered rock, (rows, columns, 3) in 0..1; always the same one."""
    rng = np.random.default_rng(seed)
    depth = np.linspace(0, 1, rows)[:, None]
    across = np.linspace(0, 1, columns)[None, :]
    bend = 0.012 * np.sin(2 * math.pi * (0.7 * across + 0.1)) + 0.006 * np.sin(2 * math.pi * (1.9 * across + 0.4))
    level = depth + bend
    tone = np.zeros((rows, columns))
    for wave in (7, 13, 29, 61):
        tone += rng.uniform(0.4, 1.0) / wave**0.45 * np.sin(2 * math.pi * (wave * level + rng.uniform()))
    tone = 0.5 + 0.5 * tone / np.abs(tone).max()
    tone = np.round(tone * 7) / 7
    return DARK_SAND + (SAND - DARK_SAND) * (0.45 + 0.55 * tone[..., None])


# -- the bit and the rock it cuts ------------------------------------------------------------------------
def drill_bit(radius: float, blades: np.ndarray, azimuth: float) -> list[Thing]:
    """A drag bit whose flat face lies in z = 0 around the origin; blade k stands at azimuth + blades[k]."""
    turn = math.degrees(azimuth)
    parts = _bit_parts(radius, tuple(float(b) for b in blades))
    return [replace(part, mesh=part.mesh.rotate_z(turn)) for part in parts]


@lru_cache(maxsize=4)
def _bit_parts(radius: float, blades: tuple[float, ...]) -> list[Thing]:
    a = radius
    body = lathe(
        [
            (0.0, -2.1 * a),
            (0.50 * a, -2.1 * a),
            (0.50 * a, -1.25 * a),
            (0.62 * a, -1.15 * a),
            (0.62 * a, -0.40 * a),
        ]
        + [(0.30 * a, -0.16 * a), (0.0, -0.16 * a)]
    )
    things = [Thing(body, DARK_STEEL, specular=0.5)]
    fins, cutters = [], []
    pyvista = load_pyvista()
    thick = 0.15 * a
    for blade in blades:
        phi = blade
        lead = np.array([-math.sin(phi), math.cos(phi), 0.0])  # the way it turns
        out = np.array([math.cos(phi), math.sin(phi), 0.0])
        # side view of a fin in (outward, down); the leading face lies in the plane of the blade's azimuth
        outline = np.array([(0.10, -0.18), (0.10, 0.0), (0.99, 0.0), (1.0, -0.05), (1.0, -0.85), (0.55, -1.22)]) * a
        front = outline[:, :1] * out + outline[:, 1:] * np.array([0, 0, 1.0])
        back = front - thick * lead
        n = len(outline)
        faces: list[int] = [n, *range(n), n, *range(2 * n - 1, n - 1, -1)]
        for i in range(n):
            j = (i + 1) % n
            faces += [4, i, i + n, j + n, j]
        fins.append(pyvista.PolyData(np.vstack([front, back]), faces).triangulate())
        for place in (0.26, 0.44, 0.62, 0.80, 0.93):
            centre = place * a * out + np.array([0, 0, -0.085 * a]) + 0.012 * a * lead
            disc = pyvista.Cylinder(center=centre, direction=lead, radius=0.075 * a, height=0.05 * a, resolution=24)
            cutters.append(disc.triangulate())
    if fins:
        things.append(Thing(join(fins), BRASS, specular=0.4))
        things.append(Thing(join(cutters), CUTTER, specular=0.9))
    return things


def rock_around(
    angle: np.ndarray, depth: np.ndarray, blades: np.ndarray, azimuth: float
) -> tuple[np.ndarray, np.ndarray]:
    """The surface all around the bit: azimuths (rad), depths (m), from a profile behind the blade(s)."""
    whole = len(blades) < 2 or angle[-1] > 2 * math.pi / len(blades) * 1.01
    sectors = np.array([0.0]) if whole else blades
    # a blade's step is two points at nearly, not exactly, one angle: sorting keeps them in order
    turn = 2 * math.pi if whole else 2 * math.pi / len(blades)
    behind = np.clip(angle[::-1], 1e-5, turn - 1e-5)
    azimuths = np.concatenate([azimuth + b - behind for b in sectors])
    return azimuths, np.concatenate([depth[::-1]] * len(sectors))


def rock_drum(radius: float, azimuth: np.ndarray, z: np.ndarray, foot: float) -> list[Thing]:
    """Hole bottom with its steps (z at azimuth, magnified), its rim, and rock under it to z = foot."""
    order = np.argsort(azimuth % (2 * math.pi), kind="stable")
    a, z = (azimuth % (2 * math.pi))[order], z[order]
    a, z = np.append(a, a[0] + 2 * math.pi), np.append(z, z[0])
    # every step is two points at nearly one angle, so plain interpolation keeps it sharp
    ring = np.stack([np.cos(a), np.sin(a), np.zeros_like(a)], axis=1)
    down = np.array([0, 0, 1.0])
    radii = np.array([0.10, 0.5, 1.0]) * radius
    top = radii[:, None, None] * ring[None] + (z[:, None] * down)[None]
    side = np.stack([top[-1], radius * ring + foot * down])
    floor = surface(top, np.broadcast_to(-down, top.shape), False)
    shade = (z - z.min()) / max(float(np.ptp(z)), 1e-12)
    pale, deep = np.array([0.98, 0.94, 0.84]), np.array([0.62, 0.47, 0.33])
    tint = pale + (deep - pale) * shade[:, None]
    floor.point_data["tint"] = (255 * np.tile(tint, (3, 1))).astype(np.uint8)
    layers = strata(256, 4)[:, 0]
    grid = side[0][None] + np.linspace(0, 1, 40)[:, None, None] * (side[1] - side[0])[None]
    wall = surface(grid, np.broadcast_to(ring, grid.shape), False)
    # layers lie level: colour by true height, not by place in the grid
    level = np.clip((grid[..., 2] - z.min()) / max(foot - float(z.min()), 1e-12), 0, 1)
    wall.point_data["tint"] = (255 * layers[(level * 255).astype(int)].reshape(-1, 3)).astype(np.uint8)
    rim = join(
        tube(
            top[-1] - 0.002 * radius * down,
            ring,
            np.stack([-np.sin(a), np.cos(a), np.zeros_like(a)], axis=1),
            np.full(len(a), 0.012 * radius),
            np.linspace(0, 1, len(a)),
        )[:1]
    )
    return [
        Thing(floor, point_colours="tint", specular=0.0, diffuse=0.68),
        Thing(wall, point_colours="tint", specular=0.0),
        Thing(rim, (0.25, 0.18, 0.10), specular=0.0),
    ]


def hole_shell(radius: float, top: float, bottom: float, camera_side: float = math.pi / 2) -> Thing:
    """The far half of the hole's wall, seen from azimuth `camera_side`, from z = top to z = bottom."""
    angle = np.linspace(camera_side + math.pi / 2, camera_side + 3 * math.pi / 2, SIDES + 1)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    z = np.linspace(top, bottom, 120)
    points = radius * ring[None] + z[:, None, None] * np.array([0, 0, 1.0])
    mesh = surface(points, np.broadcast_to(-ring, points.shape), False)
    layers = strata(512, 2)[:, 0]
    rows = np.clip((np.linspace(0, 511, 120)).astype(int), 0, 511)
    mesh.point_data["tint"] = (255 * 0.93 * np.repeat(layers[rows], SIDES + 1, axis=0)).astype(np.uint8)
    return Thing(mesh, point_colours="tint", specular=0.0)
