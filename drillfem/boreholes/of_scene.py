"""The hole of a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import SceneError
from .borehole import Borehole
from .curves import arc, build, helix, spline, straight
from .survey import TRANSITION, survey

if TYPE_CHECKING:
    from ..scene import Scene


def hole_of(scene: Scene) -> Borehole | None:
    """Geometry of a scene's hole: long enough for the string and what it drills; None where there is no hole.

    Raises SceneError for a hole that ends above the string's lower end, is narrower than the string, or bends too
    sharply for a closest point.
    """
    hole, contact = scene.hole, scene.contact
    if hole.kind == "none" or hole.diameter is None:
        return None
    reach, wide = 1.1 * (scene.length + 2 * scene.gain(weight=scene.weight)) + 100.0, hole.diameter
    radius = hole.radius or 0.0
    if hole.kind == "straight":
        made = straight(reach, hole.inclination, hole.azimuth, diameter=wide)
    elif hole.kind == "arc":
        # less than a turn, or it would run into itself
        made = arc(max(scene.length, min(reach, 5 * radius)), radius, hole.inclination, hole.azimuth, diameter=wide)
    elif hole.kind == "build":
        made = build(
            reach,
            hole.kick_off or 0.0,
            radius,
            hole.final_inclination or 0.0,
            hole.inclination,
            hole.azimuth,
            hole.transition,
            diameter=wide,
        )
    elif hole.kind == "helix":
        made = helix(reach, radius, hole.pitch or 0.0, hole.azimuth, diameter=wide)
    elif hole.kind == "spline":
        made = spline(hole.points or (), diameter=wide)
    else:
        made = survey(hole.survey or (), hole.transition or TRANSITION, diameter=wide)
    if scene.length > made.length:
        what = "points" if hole.kind == "spline" else "survey"
        raise SceneError(
            f"hole.{what}: ends at a measured depth of {made.length:.6g} m, must reach to the end of the string at "
            f"{scene.length:.6g} m"
        )
    sections = hole.section or ()
    made = made.with_diameters(wide, [(s.to, s.diameter) for s in sections], hole.caliper or ())
    touching = [d / 2 for s in scene.string if (d := s.contact_diameter or s.outer_diameter)]
    if touching:
        narrow = int(made.table.radius.argmin())
        if made.table.radius[narrow] <= max(touching):
            raise SceneError(
                f"hole: is {2 * made.table.radius[narrow]:.4g} m wide at a measured depth of "
                f"{made.table.radius_at[narrow]:.6g} m, must be wider than the string's {2 * max(touching):.4g} m"
            )
    if text := made.sharp_bend(min(touching, default=0.0)):
        raise SceneError(f"hole.kind = {hole.kind!r}: {text}")
    if contact is None:
        return made
    return made.with_friction(
        contact.friction_static,
        contact.friction_dynamic,
        [(s.to, s.friction_static, s.friction_dynamic) for s in sections],
        contact.friction_profile or (),
    )
