"""A flat blade with a borehole for a damping wire (Sextro Fig. 5.5-8).

Axes: x circumferential (through the blade's thickness), y along the rotor axis and the chord, z radial; the rotor axis
is y through the origin, the foot is clamped at z = root_radius. The hole runs along x through the whole thickness.

The wire (geometry/wire) is pressed against the outer side of the hole and touches it along a line. contact_wire is the
strip of the wall about it, contact_width along the arc and as long as the blade is thick; its normal points out of the
blade, that is inwards to the rotor axis.

The book prints 28 blades and the hole's radius of 6 mm, nothing else; the choice is explained in docs/geometry.md.
"""

from typing import Any

import gmsh
import numpy as np

from microslip.cad import checked, name_body, name_face, round_section, run, strip_centre, surfaces_where
from microslip.errors import UserError

DEFAULTS = {  # mm
    "blades": 28,
    "root_radius": 300.0,  # of the clamp
    "blade_length": 300.0,
    "chord": 60.0,
    "thickness": 8.0,
    "hole_distance": 500.0,  # of the hole's axis from the rotor axis
    "hole_offset": 0.0,  # of the hole's axis along the rotor axis
    "hole_radius": 6.0,
    "contact_width": 2.0,  # along the arc
}
SIGNED = ("hole_offset",)
AROUND = 16  # elements around the hole, at least


def draw(parameters: dict[str, Any], mesh: dict[str, Any]) -> None:
    p = settled(parameters)
    t, c, out = p["thickness"], p["chord"], np.array([0.0, 0.0, 1.0])
    add = gmsh.model.occ
    blade = (3, add.addBox(-t / 2, -c / 2, p["root_radius"], t, c, p["blade_length"]))
    mouth = np.array([-t / 2, p["hole_offset"], p["hole_distance"]])
    axes = np.array([out, [0.0, 1.0, 0.0]])
    disc = round_section(mouth, axes, p["hole_radius"], [(0.0, p["contact_width"])])
    drill = next(tile for tile in add.extrude([(2, disc)], t, 0, 0) if tile[0] == 3)
    add.cut([blade], [drill])
    add.synchronize()
    name_surfaces(p)
    name_body()
    refine_hole(p)


def settled(parameters: dict[str, Any]) -> dict[str, Any]:
    """All parameters, checked against each other."""
    p = checked(parameters, DEFAULTS, signed=SIGNED)
    if p["blades"] != int(p["blades"]) or p["blades"] < 4:
        raise UserError(f"geometry.parameters.blades = {p['blades']} must be a whole number, 4 or more")
    tip, room = p["root_radius"] + p["blade_length"], 2 * p["root_radius"] * np.sin(np.pi / p["blades"])
    limits = [
        ("thickness", room, "the pitch at the clamp"),
        ("hole_radius", p["chord"] / 2 - abs(p["hole_offset"]), "what hole_offset leaves of the chord"),
        ("contact_width", p["hole_radius"], "hole_radius"),
        ("hole_distance", tip - p["hole_radius"], "the tip, less the hole"),
    ]
    for name, limit, what in limits:
        if p[name] >= limit:
            raise UserError(f"geometry.parameters.{name} = {p[name]} must stay below {limit:g} ({what})")
    if p["hole_distance"] <= p["root_radius"] + p["hole_radius"]:
        raise UserError(f"geometry.parameters.hole_distance = {p['hole_distance']} puts the hole below the clamp")
    return p


def name_surfaces(p: dict[str, Any]) -> None:
    """Clamp, tip, the two big blade faces, the strip of contact."""
    low, tip = p["root_radius"], p["root_radius"] + p["blade_length"]
    near = 1e-6 * tip
    name_face("clamp", surfaces_where(on_plane(2, low, near)))
    name_face("tip", surfaces_where(on_plane(2, tip, near)))
    for name, x in (("pressure_side", p["thickness"] / 2), ("suction_side", -p["thickness"] / 2)):
        name_face(name, surfaces_where(on_plane(0, x, near)))
    reach = p["hole_distance"] + strip_centre(p["hole_radius"], p["contact_width"])
    place = np.array([0.0, p["hole_offset"], reach])
    name_face("contact_wire", surfaces_where(near_to(place, 1e-3 * p["hole_radius"])))


def refine_hole(p: dict[str, Any]) -> None:
    """Enough elements around the hole, whatever mesh.size; two across the strip of contact."""
    for _, curve in gmsh.model.getEntities(1):
        if gmsh.model.getType(1, curve) == "Circle":
            length = gmsh.model.occ.getMass(1, curve)
            strip = abs(length - p["contact_width"]) < 1e-6 * length
            share = length / (2 * np.pi * p["hole_radius"])
            gmsh.model.mesh.setTransfiniteCurve(curve, 3 if strip else 1 + int(np.ceil(AROUND * share)))


def on_plane(axis: int, value: float, near: float):  # noqa: ANN201
    return lambda _, box: bool((np.abs(box[:, axis] - value) < near).all())


def near_to(place: np.ndarray, near: float):  # noqa: ANN201
    return lambda centre, _: bool(np.linalg.norm(centre - place) < near)


if __name__ == "__main__":
    run(draw)
