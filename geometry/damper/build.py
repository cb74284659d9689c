"""Underplatform dampers of the spin-pit rig of Sextro section 5.4: cylinder (Z), cottage roof (C), asymmetric (A).

Axes are those of blade i (geometry/pit-blade): x circumferential, y along the rotor axis, z radial; the rotor axis is
y through the origin. The damper lies half a pitch, pi / blades, towards +x, under a roof that the platforms of blade i
(its left) and of blade i + 1 (its right) make. The roof's edge lies at roof_distance from the rotor axis, both planes
are inclined by half of roof_angle to the radial direction there. Centrifugal force wedges the damper outwards.

Contact is on lands, land_length along the rotor axis, whose middle lies land_middle down the slope from the edge. A
plane flank touches over land_width, a round one along a line; contact_left and contact_right are the plane flank's part
on the land, or a strip of line_width about the line. Flanks: cylinder round and round, cottage-roof plane and plane,
asymmetric round (left) and plane (right). A round flank has the radius that puts its line on the middle of the land.

The section is the same for every mass: mass_g makes the damper longer, and it juts out of the lands on both sides.
density is that of [material] in grams per cubic length_unit.

The book prints shapes' names and three masses, 25.9, 41.8 and 117 g; the choice is explained in docs/geometry.md. A
structured mesh, swept along the damper.
"""

from typing import Any

import gmsh
import numpy as np

from microslip.cad import checked, name_body, name_face, positive_size, round_section, run, strip_centre, surfaces_where
from microslip.errors import UserError

DEFAULTS = {  # mm and degrees
    "shape": "cottage-roof",
    "mass_g": 41.8,
    "density": 7.85e-3,  # g/mm3
    "blades": 30,
    "roof_distance": 250.0,
    "roof_angle": 90.0,
    "land_middle": 8.0,
    "land_width": 8.0,
    "land_length": 15.0,
    "line_width": 1.0,
    "keel": 8.0,  # height of the block below a plane flank
}
SHAPES = {"cylinder": ("round", "round"), "cottage-roof": ("plane", "plane"), "asymmetric": ("round", "plane")}
SIZE = 3.0  # mm


def draw(parameters: dict[str, Any], mesh: dict[str, Any]) -> None:
    p = settled(parameters)
    if mesh.get("local"):
        raise UserError("mesh.local has no effect on the damper's structured mesh; change mesh.size")
    mesh["size"] = positive_size("mesh.size", SIZE if mesh.get("size") is None else mesh["size"])
    tag = round_body(p) if p["shape"] == "cylinder" else roof_body(p)
    length = p["mass_g"] / (p["density"] * gmsh.model.occ.getMass(2, tag))
    if length <= p["land_length"]:
        raise UserError(
            f"geometry.parameters.mass_g = {p['mass_g']} makes the damper {length:.4g} long, shorter than "
            f"land_length = {p['land_length']}"
        )
    gmsh.model.occ.translate([(2, tag)], 0, -length / 2, 0)
    rim = (length - p["land_length"]) / 2
    sweep(tag, [rim, p["land_length"], rim], mesh["size"])
    gmsh.model.occ.synchronize()
    refine_lines(p)
    for name, side in (("contact_left", -1), ("contact_right", 1)):
        name_face(name, surfaces_where(near_to(land(p, side), 1e-4 * p["land_middle"])))
    name_body()


def settled(parameters: dict[str, Any]) -> dict[str, Any]:
    """All parameters, checked against each other."""
    p = checked(parameters, DEFAULTS)
    if p["shape"] not in SHAPES:
        raise UserError(f"geometry.parameters.shape = {p['shape']!r} must be one of {', '.join(SHAPES)}")
    if p["blades"] != int(p["blades"]) or p["blades"] < 4:
        raise UserError(f"geometry.parameters.blades = {p['blades']} must be a whole number, 4 or more")
    if not 30 <= p["roof_angle"] <= 150:
        raise UserError(f"geometry.parameters.roof_angle = {p['roof_angle']} must lie between 30 and 150 degrees")
    limits = [
        ("land_width", 2 * p["land_middle"], "twice land_middle, so that the land ends below the roof's edge"),
        ("line_width", p["land_width"], "land_width"),
        ("land_middle", p["roof_distance"] / 4, "a quarter of roof_distance"),
    ]
    for name, limit, what in limits:
        if p[name] >= limit:
            raise UserError(f"geometry.parameters.{name} = {p[name]} must stay below {limit:g} ({what})")
    return p


def axes(p: dict[str, Any]) -> np.ndarray:
    """Rows: circumferential, along the rotor axis, radial; half a pitch from blade i."""
    angle = np.pi / p["blades"]
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])


def roof(p: dict[str, Any], side: int) -> np.ndarray:
    """Rows, in the plane of circumferential and radial direction: down the slope, and out of the damper."""
    half = np.deg2rad(p["roof_angle"]) / 2
    s, c = np.sin(half), np.cos(half)
    return np.array([[side * s, -c], [side * c, s]])


def in_space(p: dict[str, Any], place: np.ndarray) -> np.ndarray:
    """(3,) point at y = 0 of (circumferential, radial) measured from the roof's edge."""
    across, _, out = axes(p)
    return p["roof_distance"] * out + place[0] * across + place[1] * out


def land(p: dict[str, Any], side: int) -> np.ndarray:
    """(3,) middle of a land."""
    return in_space(p, p["land_middle"] * roof(p, side)[0])


def flank(p: dict[str, Any]) -> tuple[float, np.ndarray]:
    """Radius and centre, from the roof's edge, of the circle whose strips have their centres on the lands' middles."""
    depth = p["land_middle"] * np.tan(np.deg2rad(p["roof_angle"]) / 2)
    radius = depth
    for _ in range(20):
        radius += depth - strip_centre(radius, p["line_width"])
    down, normal = roof(p, 1)
    return float(radius), p["land_middle"] * down - depth * normal


def round_body(p: dict[str, Any]) -> int:
    """Section of the cylinder."""
    radius, centre = flank(p)
    across, _, out = axes(p)
    strips = [(np.arctan2(n[1], n[0]), p["line_width"]) for n in (roof(p, side)[1] for side in (1, -1))]
    return round_section(in_space(p, centre), np.array([across, out]), radius, strips)


def roof_body(p: dict[str, Any]) -> int:
    """Section with a plane flank on the right, and a plane or round one on the left."""
    bottom = (p["land_middle"] + p["land_width"] / 2) * roof(p, 1)[0] - [0.0, p["keel"]]
    right = [*plane_flank(p, 1), bottom]
    if SHAPES[p["shape"]][0] == "plane":
        return outline(p, [*right, bottom * [-1, 1], *plane_flank(p, -1)[::-1]])
    radius, centre = flank(p)
    half, middle = p["line_width"] / radius / 2, float(np.arctan2(*roof(p, -1)[1][::-1]))
    angles = [np.pi, middle + half, middle - half, np.pi / 2]
    arc = [centre + radius * np.array([np.cos(a), np.sin(a)]) for a in angles]
    return outline(p, [*right, np.array([-radius, bottom[1]]), *arc], centre)


def plane_flank(p: dict[str, Any], side: int) -> list[np.ndarray]:
    """Upper and lower end of a land in the section."""
    return [(p["land_middle"] + part * p["land_width"] / 2) * roof(p, side)[0] for part in (-1, 1)]


def outline(p: dict[str, Any], corners: list[np.ndarray], centre: np.ndarray | None = None) -> int:
    """A plane surface; with a centre, its last four corners are joined by arcs about it."""
    add = gmsh.model.occ
    points = [add.addPoint(*in_space(p, c)) for c in corners]
    middle = None if centre is None else add.addPoint(*in_space(p, centre))
    curves = []
    for number, (a, b) in enumerate(zip(points, points[1:] + points[:1], strict=True)):
        is_arc = middle is not None and len(points) - 4 <= number < len(points) - 1
        curves.append(add.addCircleArc(a, middle, b) if is_arc else add.addLine(a, b))
    return int(add.addPlaneSurface([add.addCurveLoop(curves)]))


def sweep(tag: int, lengths: list[float], size: float) -> None:
    """Sweep a section along y in steps, with layers of about the given size."""
    section = (2, tag)
    for length in lengths:
        section = gmsh.model.occ.extrude([section], 0, length, 0, numElements=[max(1, round(length / size))])[0]


def refine_lines(p: dict[str, Any]) -> None:
    """Two elements across a strip."""
    for _, curve in gmsh.model.getEntities(1):
        length = gmsh.model.occ.getMass(1, curve)
        if gmsh.model.getType(1, curve) == "Circle" and abs(length - p["line_width"]) < 1e-6 * length:
            gmsh.model.mesh.setTransfiniteCurve(curve, 3)


def near_to(place: np.ndarray, near: float):  # noqa: ANN201
    return lambda centre, _: bool(np.linalg.norm(centre - place) < near)


if __name__ == "__main__":
    run(draw)
