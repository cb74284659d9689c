"""A flat blade whose tip plate has a hole on either side for a damping element (Sextro Fig. 5.5-6).

Axes: x circumferential (through the blade's thickness), y along the rotor axis and the chord, z radial; the rotor axis
is y through the origin. Half of a pin (geometry/pin) lies in the hole on the right, towards blade i + 1, the other half
in that blade's hole on the left. The holes are drilled at half a pitch, pi / blades, along the circumferential
direction there, so that contact_right = R contact_left, R the rotation about +y by 2 pi / blades.

contact_right and contact_left are strips of the holes' walls about their outermost lines, contact_width along the arc
and contact_length along the hole; normals point out of the blade, that is inwards to the rotor axis. The plate's sides
leave a gap between neighbours, so that nothing but the pins couples them.

The blade is one "from the experiments" of section 5.3 (section 77 x 5 mm, steel) that fits on a ring of 24: the blade
of 5.3 itself, 475 mm long with a plate of 88 mm, would need a rotor axis above its own clamp. No dimensions are
printed; the choice is explained in docs/geometry.md.
"""

from typing import Any

import gmsh
import numpy as np

from microslip.cad import checked, name_body, name_face, round_section, run, strip_centre, surfaces_where
from microslip.errors import UserError

DEFAULTS = {  # mm
    "blades": 24,
    "root_radius": 160.0,  # of the clamp
    "blade_length": 300.0,
    "chord": 77.0,
    "thickness": 5.0,
    "plate_chord": 77.0,
    "plate_thickness": 20.0,  # radial
    "gap": 1.0,  # between neighbouring plates
    "hole_distance": 470.0,  # of the holes' axis from the rotor axis
    "hole_offset": 20.0,  # of the holes' axis along the rotor axis
    "hole_radius": 6.1,
    "hole_depth": 24.0,  # from the middle of the gap
    "contact_length": 15.0,
    "contact_middle": 10.0,  # of a strip, from the middle of the gap
    "contact_width": 2.0,  # along the arc
}
SIGNED = ("hole_offset",)
WALL = 2.0  # least thickness of the plate around a hole


def draw(parameters: dict[str, Any], mesh: dict[str, Any]) -> None:
    p = settled(parameters)
    low, t, c = p["root_radius"], p["thickness"], p["chord"]
    blade = (3, gmsh.model.occ.addBox(-t / 2, -c / 2, low, t, c, p["blade_length"]))
    whole = gmsh.model.occ.fuse([blade], [plate(p)])[0]
    drills = [tool for side in (1, -1) for tool in drill(p, side)]
    gmsh.model.occ.cut(whole, drills)
    gmsh.model.occ.synchronize()
    name_surfaces(p)
    name_body()


def settled(parameters: dict[str, Any]) -> dict[str, Any]:
    """All parameters, checked against each other."""
    p = checked(parameters, DEFAULTS, signed=SIGNED)
    if p["blades"] != int(p["blades"]) or p["blades"] < 4:
        raise UserError(f"geometry.parameters.blades = {p['blades']} must be a whole number, 4 or more")
    low = p["root_radius"] + p["blade_length"]
    half_pitch = low * np.tan(np.pi / p["blades"])
    limits = [
        ("chord", p["plate_chord"] * (1 + 1e-9), "plate_chord"),
        ("hole_depth", half_pitch - p["thickness"], "the plate's half, less the blade"),
        ("contact_middle", p["hole_depth"] - p["contact_length"] / 2, "hole_depth less half of contact_length"),
        ("contact_width", p["hole_radius"], "hole_radius"),
        ("gap", 2 * p["contact_middle"] - p["contact_length"], "what the strips of contact leave"),
        ("hole_distance", low + p["plate_thickness"] - p["hole_radius"] - WALL, "what leaves a wall above the hole"),
    ]
    for name, limit, what in limits:
        if p[name] >= limit:
            raise UserError(f"geometry.parameters.{name} = {p[name]} must stay below {limit:g} ({what})")
    if p["hole_distance"] <= low + p["hole_radius"] + WALL:
        raise UserError(f"geometry.parameters.hole_distance = {p['hole_distance']} leaves no wall under the hole")
    if abs(p["hole_offset"]) + p["hole_radius"] + WALL >= p["plate_chord"] / 2:
        raise UserError(f"geometry.parameters.hole_offset = {p['hole_offset']} puts the hole outside plate_chord")
    return p


def plate(p: dict[str, Any]) -> tuple[int, int]:
    """The tip plate; its sides are planes through the rotor axis, moved inwards by half of the gap."""
    low, width = p["root_radius"] + p["blade_length"], p["plate_chord"]
    high, angle = low + p["plate_thickness"], np.pi / p["blades"]
    reach = [z * np.tan(angle) - p["gap"] / 2 / np.cos(angle) for z in (low, high)]
    corners = [(-reach[0], low), (reach[0], low), (reach[1], high), (-reach[1], high)]
    add = gmsh.model.occ
    points = [add.addPoint(x, -width / 2, z) for x, z in corners]
    lines = [add.addLine(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    face = add.addPlaneSurface([add.addCurveLoop(lines)])
    return next(tile for tile in add.extrude([(2, face)], 0, width, 0) if tile[0] == 3)


def axes(p: dict[str, Any], side: int) -> np.ndarray:
    """Rows: into the plate along the hole, along the rotor axis, outwards; at half a pitch to one side."""
    angle = side * np.pi / p["blades"]
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[-side * c, 0.0, side * s], [0.0, 1.0, 0.0], [s, 0.0, c]])


def drill(p: dict[str, Any], side: int) -> list[tuple[int, int]]:
    """The hole on one side in three steps: before, along and behind the strip of contact."""
    into, across, out = axes(p, side)
    mouth = p["hole_distance"] * out + p["hole_offset"] * across
    strips = [(0.0, p["contact_width"])]
    ends = p["contact_middle"] + p["contact_length"] / 2 * np.array([-1.0, 1.0])
    section = (2, round_section(mouth, np.array([out, across]), p["hole_radius"], strips))
    steps = []
    for length in (ends[0], p["contact_length"], p["hole_depth"] - ends[1]):
        made = gmsh.model.occ.extrude([section], *(length * into))
        section = made[0]
        steps.append(next(tile for tile in made if tile[0] == 3))
    return steps


def name_surfaces(p: dict[str, Any]) -> None:
    """Clamp, the two big blade faces, the plate's top, the two strips of contact."""
    low = p["root_radius"]
    top = low + p["blade_length"] + p["plate_thickness"]
    near = 1e-6 * top
    name_face("clamp", surfaces_where(on_plane(2, low, near)))
    name_face("plate_top", surfaces_where(on_plane(2, top, near)))
    for name, x in (("pressure_side", p["thickness"] / 2), ("suction_side", -p["thickness"] / 2)):
        name_face(name, surfaces_where(on_plane(0, x, near)))
    reach = p["hole_distance"] + strip_centre(p["hole_radius"], p["contact_width"])
    for name, side in (("contact_right", 1), ("contact_left", -1)):
        into, across, out = axes(p, side)
        place = p["contact_middle"] * into + p["hole_offset"] * across + reach * out
        name_face(name, surfaces_where(near_to(place, 1e-3 * p["hole_radius"])))


def on_plane(axis: int, value: float, near: float):  # noqa: ANN201
    return lambda _, box: bool((np.abs(box[:, axis] - value) < near).all())


def near_to(place: np.ndarray, near: float):  # noqa: ANN201
    return lambda centre, _: bool(np.linalg.norm(centre - place) < near)


if __name__ == "__main__":
    run(draw)
