"""Damping element of Sextro Fig. 5.5-6: a pin that lies in holes of two neighbouring blade tips (geometry/pin-blade).

Axes are those of blade i: x circumferential, y along the rotor axis, z radial, the rotor axis is y through the origin.
The pin lies half a pitch, pi / blades, towards +x: along the circumferential direction there, its left half in blade
i, its right half in blade i + 1. It is pressed outwards and touches each hole along a line. The two faces are strips
about these lines, contact_width along the arc and contact_length along the pin; by Hertz the contact of these radii is
0.33 mm wide under 100 N and 1.04 mm under 1 kN. The pin lies so far out that its outermost line is that of the holes.

The book prints no dimensions; the choice is explained in docs/geometry.md. A structured mesh, swept along the pin.
"""

from typing import Any

import gmsh
import numpy as np

from microslip.cad import checked, name_body, name_face, positive_size, round_section, run, strip_centre, surfaces_where
from microslip.errors import UserError

DEFAULTS = {  # mm
    "blades": 24,
    "hole_distance": 470.0,  # of the holes' axis from the rotor axis
    "hole_offset": 20.0,  # of the holes' axis along the rotor axis
    "hole_radius": 6.1,
    "pin_radius": 6.0,
    "pin_length": 40.0,
    "contact_length": 15.0,  # of each strip, in the middle of its half of the pin
    "contact_width": 2.0,  # along the arc
}
SIGNED = ("hole_offset",)
SIZE = 2.5  # mm


def draw(parameters: dict[str, Any], mesh: dict[str, Any]) -> None:
    p = settled(parameters)
    if mesh.get("local"):
        raise UserError("mesh.local has no effect on the pin's structured mesh; change mesh.size")
    mesh["size"] = positive_size("mesh.size", SIZE if mesh.get("size") is None else mesh["size"])
    along, across, out = axes(p)
    rim = (p["pin_length"] / 2 - p["contact_length"]) / 2
    start = middle(p) - p["pin_length"] / 2 * along
    strips = [(0.0, p["contact_width"])]
    tag = round_section(start, np.array([out, across]), p["pin_radius"], strips)
    sweep(tag, along, [rim, p["contact_length"], 2 * rim, p["contact_length"], rim], mesh["size"])
    gmsh.model.occ.synchronize()
    refine_outline(p, mesh["size"])
    reach = strip_centre(p["pin_radius"], p["contact_width"])
    for name, side in (("contact_left", -1), ("contact_right", 1)):
        place = middle(p) + side * p["pin_length"] / 4 * along + reach * out
        name_face(name, surfaces_where(near_to(place, 1e-3 * p["pin_radius"])))
    name_body()


def settled(parameters: dict[str, Any]) -> dict[str, Any]:
    """All parameters, checked against each other."""
    p = checked(parameters, DEFAULTS, signed=SIGNED)
    if p["blades"] != int(p["blades"]) or p["blades"] < 4:
        raise UserError(f"geometry.parameters.blades = {p['blades']} must be a whole number, 4 or more")
    limits = [
        ("pin_radius", p["hole_radius"], "hole_radius"),
        ("contact_length", p["pin_length"] / 2, "half of pin_length"),
        ("contact_width", p["pin_radius"], "pin_radius"),
        ("hole_radius", p["hole_distance"], "hole_distance"),
    ]
    for name, limit, what in limits:
        if p[name] >= limit:
            raise UserError(f"geometry.parameters.{name} = {p[name]} must stay below {what} = {limit:g}")
    return p


def axes(p: dict[str, Any]) -> np.ndarray:
    """Rows: along the pin (circumferential), across it (rotor axis), outwards (radial), half a pitch from blade i."""
    angle = np.pi / p["blades"]
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])


def middle(p: dict[str, Any]) -> np.ndarray:
    """(3,) middle of the pin, whose outermost line touches that of the holes."""
    _, across, out = axes(p)
    return (p["hole_distance"] + p["hole_radius"] - p["pin_radius"]) * out + p["hole_offset"] * across


def sweep(tag: int, along: np.ndarray, lengths: list[float], size: float) -> None:
    """Sweep a section along a direction in steps, with layers of about the given size."""
    section = (2, tag)
    for length in lengths:
        layers = max(1, round(length / size))
        made = gmsh.model.occ.extrude([section], *(length * along), numElements=[layers])
        section = made[0]


def refine_outline(p: dict[str, Any], size: float) -> None:
    """Two elements across the strip; about the given size on the rest of the circle."""
    for _, curve in gmsh.model.getEntities(1):
        if gmsh.model.getType(1, curve) == "Circle":
            length = gmsh.model.occ.getMass(1, curve)
            strip = abs(length - p["contact_width"]) < 1e-6 * length
            gmsh.model.mesh.setTransfiniteCurve(curve, 3 if strip else 1 + max(2, round(length / size)))


def near_to(place: np.ndarray, near: float):  # noqa: ANN201
    return lambda centre, _: bool(np.linalg.norm(centre - place) < near)


if __name__ == "__main__":
    run(draw)
