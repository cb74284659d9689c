"""Damping wire of Sextro Fig. 5.5-8: a round wire that runs through holes of several neighbouring blades.

Axes: y along the rotor axis, which runs through the origin, z radial through the middle of the wire; the wire is an arc
about y of as many pitches as it couples blades. Blades are counted against the rotation about +y, as everywhere:
blade_1 stands at -(coupled - 1) / 2 pitches, the last at +(coupled - 1) / 2 (an odd number puts one on the z-axis).

Under centrifugal load the wire lies on the outer side of each hole (geometry/wire-blade) and touches it along a line.
The faces blade_1, blade_2, ... are strips about these lines, contact_width along the arc of the wire's section and as
long as the hole. The holes are straight and the wire is bent, so that it touches in the middle: over a hole of 8 mm the
wire falls back by 16 micrometres at the ends. It lies where the centres of both sides' strips coincide.

The book prints 7 of 28 blades and the holes' radius of 6 mm, nothing else; the choice is explained in docs/geometry.md.
A structured mesh, swept along the wire.
"""

from typing import Any

import gmsh
import numpy as np

from microslip.cad import checked, name_body, name_face, positive_size, round_section, run, strip_centre, surfaces_where
from microslip.errors import UserError

DEFAULTS = {  # mm
    "blades": 28,
    "coupled": 7,
    "hole_distance": 500.0,  # of the middle of the holes' axis from the rotor axis
    "hole_offset": 0.0,  # of the holes' axis along the rotor axis
    "hole_radius": 6.0,
    "wire_radius": 5.8,
    "contact_length": 8.0,  # thickness of the blade
    "contact_width": 2.0,  # of the strips, along the arc of the section
    "end_gap": 2.0,  # between this wire and the next
}
SIGNED = ("hole_offset",)
SIZE = 8.0  # mm along the wire; around its section at most half of the radius
TURN_Y = (0.0, 0.0, 0.0, 0.0, 1.0, 0.0)  # point and direction of the rotor axis


def draw(parameters: dict[str, Any], mesh: dict[str, Any]) -> None:
    p = settled(parameters)
    if mesh.get("local"):
        raise UserError("mesh.local has no effect on the wire's structured mesh; change mesh.size")
    mesh["size"] = positive_size("mesh.size", SIZE if mesh.get("size") is None else mesh["size"])
    radius = bend(p)
    angles = stations(p, radius)
    section = (2, start(p, radius, angles[0]))
    for low, high in zip(angles, angles[1:], strict=False):
        layers = max(2, round((high - low) * radius / mesh["size"]))
        section = gmsh.model.occ.revolve([section], *TURN_Y, high - low, numElements=[layers])[0]
    gmsh.model.occ.synchronize()
    refine_outline(p, mesh["size"])
    reach = p["hole_distance"] + strip_centre(p["hole_radius"], p["contact_width"])
    for number, angle in enumerate(places(p), 1):
        place = np.array([reach * np.sin(angle), p["hole_offset"], reach * np.cos(angle)])
        name_face(f"blade_{number}", surfaces_where(near_to(place, 1e-2 * p["wire_radius"])))
    name_body()


def settled(parameters: dict[str, Any]) -> dict[str, Any]:
    """All parameters, checked against each other."""
    p = checked(parameters, DEFAULTS, signed=SIGNED)
    for name, least in (("blades", 4), ("coupled", 1)):
        if p[name] != int(p[name]) or p[name] < least:
            raise UserError(f"geometry.parameters.{name} = {p[name]} must be a whole number, {least} or more")
        p[name] = int(p[name])
    pitch = 2 * np.pi / p["blades"] * p["hole_distance"]
    limits = [
        ("coupled", p["blades"], "blades"),
        ("wire_radius", p["hole_radius"], "hole_radius"),
        ("hole_radius", p["hole_distance"] / 4, "a quarter of hole_distance"),
        ("contact_width", p["wire_radius"], "wire_radius"),
        ("contact_length", pitch / 2, "half of the pitch"),
        ("end_gap", pitch / 4, "a quarter of the pitch"),
    ]
    for name, limit, what in limits:
        if p[name] >= limit:
            raise UserError(f"geometry.parameters.{name} = {p[name]} must stay below {limit:g} ({what})")
    return p


def bend(p: dict[str, Any]) -> float:
    """Radius of the wire's axis for which the strips on wire and hole have the same centre.

    The area centre of the strip on the torus lies at z = integral of s^2 cos(theta) / integral of s, s = R + r cos(phi)
    over |phi| < half_width, |theta| < half_length; R follows by Newton's method, whose derivative is nearly 1.
    """
    wanted = p["hole_distance"] + strip_centre(p["hole_radius"], p["contact_width"])
    half_width = p["contact_width"] / p["wire_radius"] / 2
    radius = p["hole_distance"]
    for _ in range(50):
        half_length = p["contact_length"] / 2 / (radius + p["wire_radius"])
        sine, cosine = np.sin(half_width) / half_width, np.sin(2 * half_width) / 4 / half_width + 0.5
        first = radius + p["wire_radius"] * sine
        second = radius**2 + 2 * radius * p["wire_radius"] * sine + p["wire_radius"] ** 2 * cosine
        radius += wanted - second / first * np.sin(half_length) / half_length
    return float(radius)


def places(p: dict[str, Any]) -> np.ndarray:
    """(coupled,) angles of the blades about +y, rising from blade_1."""
    return 2 * np.pi / p["blades"] * (np.arange(p["coupled"]) - (p["coupled"] - 1) / 2)


def stations(p: dict[str, Any], radius: float) -> list[float]:
    """Rising angles at which the wire begins, strips begin and end, and the wire ends."""
    half = p["contact_length"] / 2 / (radius + p["wire_radius"])
    end = np.pi * p["coupled"] / p["blades"] - p["end_gap"] / 2 / radius
    return [-end, *(a for angle in places(p) for a in (angle - half, angle + half)), end]


def start(p: dict[str, Any], radius: float, angle: float) -> int:
    """The section at the wire's first end."""
    out, across = np.array([np.sin(angle), 0.0, np.cos(angle)]), np.array([0.0, 1.0, 0.0])
    centre = radius * out + p["hole_offset"] * across
    return round_section(centre, np.array([out, across]), p["wire_radius"], [(0.0, p["contact_width"])])


def refine_outline(p: dict[str, Any], size: float) -> None:
    """Sections: two elements across the strip, at most half a radius on the rest of the circle."""
    size = min(size, p["wire_radius"] / 2)
    for _, curve in gmsh.model.getEntities(1):
        if across_the_wire(curve):
            length = gmsh.model.occ.getMass(1, curve)
            strip = abs(length - p["contact_width"]) < 1e-6 * length
            gmsh.model.mesh.setTransfiniteCurve(curve, 3 if strip else 1 + max(2, round(length / size)))


def across_the_wire(curve: int) -> bool:
    """Whether a curve has both ends at the same angle about the rotor axis."""
    ends = [gmsh.model.getValue(0, tag, []) for _, tag in gmsh.model.getBoundary([(1, curve)])]
    angles = [np.arctan2(x, z) for x, _, z in ends]
    return bool(np.ptp(angles) < 1e-9)


def near_to(place: np.ndarray, near: float):  # noqa: ANN201
    return lambda centre, _: bool(np.linalg.norm(centre - place) < near)


if __name__ == "__main__":
    run(draw)
