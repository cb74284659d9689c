"""A blade of the spin-pit rig of Sextro section 5.4, with a platform under which friction dampers lie.

Axes: x circumferential (through the blade's thickness), y along the rotor axis and the chord, z radial; the rotor axis
is y through the origin, the foot is clamped at z = root_radius. A flat blade stands on a platform; below it goes on to
the clamp. Magnets pull at its tip.

The platform's underside is chamfered on either side. With the neighbour's it makes a roof whose edge lies half a pitch,
pi / blades, away at roof_distance from the rotor axis; both planes are inclined by half of roof_angle to the radial
direction there. On each chamfer stands a land, the only place where a damper (geometry/damper) touches: land_length
along the rotor axis and land_width down the slope, its middle land_middle down from the edge.

contact_right and contact_left are the whole lands; line_right and line_left are the strips in their middle, line_width
wide, that a round flank touches. contact_right = R contact_left, R the rotation about +y by 2 pi / blades.

The book prints 30 blades and no lengths; the choice is explained in docs/geometry.md.
"""

from typing import Any

import gmsh
import numpy as np

from microslip.cad import checked, name_body, name_face, run, surfaces_where
from microslip.errors import UserError

DEFAULTS = {  # mm and degrees
    "blades": 30,
    "root_radius": 190.0,
    "blade_length": 240.0,  # clamp to tip
    "chord": 40.0,
    "thickness": 7.0,
    "platform_top": 254.0,  # from the rotor axis, in the middle of the platform
    "platform_bottom": 239.0,
    "platform_length": 44.0,  # along the rotor axis
    "gap": 2.0,  # between neighbouring platforms
    "roof_distance": 250.0,
    "roof_angle": 90.0,
    "land_middle": 8.0,
    "land_width": 8.0,
    "land_length": 15.0,
    "line_width": 1.0,
    "relief": 0.5,  # by which the lands stand out of the chamfers
}


def draw(parameters: dict[str, Any], mesh: dict[str, Any]) -> None:
    p = settled(parameters)
    t, c = p["thickness"], p["chord"]
    blade = (3, gmsh.model.occ.addBox(-t / 2, -c / 2, p["root_radius"], t, c, p["blade_length"]))
    gmsh.option.setNumber("Geometry.OCCUnionUnify", 0)  # keeps the bands of a land apart
    platform = gmsh.model.occ.cut([plate(p)], [chamfer(p, side) for side in (1, -1)])[0]
    lands = [band for side in (1, -1) for band in bands(p, side)]
    gmsh.model.occ.fuse([blade], [*platform, *lands])
    gmsh.model.occ.synchronize()
    name_surfaces(p)
    name_body()


def settled(parameters: dict[str, Any]) -> dict[str, Any]:
    """All parameters, checked against each other."""
    p = checked(parameters, DEFAULTS)
    if p["blades"] != int(p["blades"]) or p["blades"] < 4:
        raise UserError(f"geometry.parameters.blades = {p['blades']} must be a whole number, 4 or more")
    if not 30 <= p["roof_angle"] <= 150:
        raise UserError(f"geometry.parameters.roof_angle = {p['roof_angle']} must lie between 30 and 150 degrees")
    start = p["land_middle"] - p["land_width"] / 2
    limits = [
        ("root_radius", p["platform_bottom"], "platform_bottom"),
        ("platform_bottom", p["platform_top"], "platform_top"),
        ("platform_top", p["root_radius"] + p["blade_length"], "the tip"),
        ("line_width", p["land_width"], "land_width"),
        ("land_length", p["platform_length"] * (1 + 1e-9), "platform_length"),
        ("gap", 2 * start * np.sin(half_roof(p)), "what keeps the lands on the platform"),
        ("thickness", 2 * (reach(p, p["platform_bottom"]) - p["land_middle"] - p["land_width"]), "the lands' room"),
    ]
    for name, limit, what in limits:
        if p[name] >= limit:
            raise UserError(f"geometry.parameters.{name} = {p[name]} must stay below {limit:g} ({what})")
    low = in_space(p, 1, (p["land_middle"] + p["land_width"] / 2) * roof(p, 1)[0])[2]
    high = in_space(p, 1, start * roof(p, 1)[0])[2]
    if not p["platform_bottom"] < low or not high + p["relief"] < p["platform_top"]:
        raise UserError(
            f"geometry.parameters.roof_distance = {p['roof_distance']} puts the lands outside the platform, which "
            f"reaches from {p['platform_bottom']} to {p['platform_top']}"
        )
    return p


def half_roof(p: dict[str, Any]) -> float:
    return float(np.deg2rad(p["roof_angle"]) / 2)


def reach(p: dict[str, Any], height: float) -> float:
    """Half of the platform's width at a height: to the plane half a pitch away, less half of the gap."""
    angle = np.pi / p["blades"]
    return float(height * np.tan(angle) - p["gap"] / 2 / np.cos(angle))


def roof(p: dict[str, Any], side: int) -> np.ndarray:
    """Rows, in the plane of circumferential and radial direction: down the slope, and out of the blade."""
    s, c = np.sin(half_roof(p)), np.cos(half_roof(p))
    return np.array([[-side * s, -c], [side * c, -s]])


def in_space(p: dict[str, Any], side: int, place: np.ndarray, y: float = 0.0) -> np.ndarray:
    """(3,) point of (circumferential, radial) measured from the roof's edge on one side."""
    angle = side * np.pi / p["blades"]
    c, s = np.cos(angle), np.sin(angle)
    out, across = np.array([s, 0.0, c]), np.array([c, 0.0, -s])
    return p["roof_distance"] * out + place[0] * across + place[1] * out + np.array([0.0, y, 0.0])


def prism(corners: list[np.ndarray], length: float) -> tuple[int, int]:
    """A plane polygon at y = -length / 2 swept along y."""
    add = gmsh.model.occ
    points = [add.addPoint(x, y, z) for x, y, z in corners]
    lines = [add.addLine(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    face = add.addPlaneSurface([add.addCurveLoop(lines)])
    return next(tile for tile in add.extrude([(2, face)], 0, length, 0) if tile[0] == 3)


def plate(p: dict[str, Any]) -> tuple[int, int]:
    """The platform before it is chamfered; its sides are planes through the rotor axis moved inwards."""
    y, low, high = -p["platform_length"] / 2, p["platform_bottom"], p["platform_top"]
    ends = [(-reach(p, low), low), (reach(p, low), low), (reach(p, high), high), (-reach(p, high), high)]
    return prism([np.array([x, y, z]) for x, z in ends], p["platform_length"])


def chamfer(p: dict[str, Any], side: int) -> tuple[int, int]:
    """What is cut off below the plane of the lands, which lies deeper by the relief."""
    down, normal = roof(p, side)
    long = 2 * (p["platform_top"] - p["platform_bottom"] + p["land_middle"] + p["land_width"])
    sides = [-long * down, long * down, long * down + long * normal, -long * down + long * normal]
    corners = [in_space(p, side, c - p["relief"] * normal, -p["platform_length"]) for c in sides]
    return prism(corners, 2 * p["platform_length"])


def bands(p: dict[str, Any], side: int) -> list[tuple[int, int]]:
    """The land in three bands, rooted in the platform: above, on and below the line of a round flank."""
    down, normal = roof(p, side)
    half, line = p["land_width"] / 2, p["line_width"] / 2
    edges = [p["land_middle"] + d for d in (-half, -line, line, half)]
    made = []
    for a, b in zip(edges, edges[1:], strict=False):
        sides = [a * down, b * down, b * down - 3 * p["relief"] * normal, a * down - 3 * p["relief"] * normal]
        corners = [in_space(p, side, c, -p["land_length"] / 2) for c in sides]
        made.append(prism(corners, p["land_length"]))
    return made


def name_surfaces(p: dict[str, Any]) -> None:
    """Clamp, tip, the two sides of the blade above the platform, lands and lines."""
    low, tip = p["root_radius"], p["root_radius"] + p["blade_length"]
    near = 1e-6 * tip
    name_face("clamp", surfaces_where(on_plane(2, low, near)))
    name_face("tip", surfaces_where(on_plane(2, tip, near)))
    for name, x in (("pressure_side", p["thickness"] / 2), ("suction_side", -p["thickness"] / 2)):
        flat = on_plane(0, x, near)
        name_face(name, surfaces_where(lambda c, box, flat=flat: flat(c, box) and c[2] > p["platform_top"]))
    shift = (p["land_width"] + p["line_width"]) / 4
    for name, side in (("right", 1), ("left", -1)):
        found = []
        for away in (-shift, 0.0, shift):
            place = in_space(p, side, (p["land_middle"] + away) * roof(p, side)[0])
            found.append(surfaces_where(near_to(place, 1e-3 * p["line_width"])))
        name_face(f"contact_{name}", [tag for tags in found for tag in tags])
        name_face(f"line_{name}", found[1])


def on_plane(axis: int, value: float, near: float):  # noqa: ANN201
    return lambda _, box: bool((np.abs(box[:, axis] - value) < near).all())


def near_to(place: np.ndarray, near: float):  # noqa: ANN201
    return lambda centre, _: bool(np.linalg.norm(centre - place) < near)


if __name__ == "__main__":
    run(draw)
