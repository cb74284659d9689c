"""A solid rubber wheel on a rigid hub that stands on the ground, as in Sextro 6.10.

Axes: the axle is y through the origin, x points along rolling, z up; the ground is the plane z = -outer_radius. Faces:
hub (the bore, bonded), tread (the part of the outer surface within contact_angle about the lowest line).

A structured mesh of bricks of second order, finer towards the ground.
"""

from math import atan2, ceil, degrees, radians

import gmsh
import numpy as np

from microslip.cad import checked, name_body, name_face, positive_size, run, surfaces_where
from microslip.errors import UserError

DEFAULTS = {  # mm and degrees
    "hub_radius": 25.0,
    "outer_radius": 50.0,
    "width": 20.0,
    "contact_angle": 40.0,
}
SIZE = 4.0  # mm
FINE, COARSE = 0.5, 4
"""Times as long round the axle are elements near the ground, and away from it."""


def draw(parameters: dict, mesh: dict) -> None:
    p = settled(parameters)
    if mesh.get("local"):
        raise UserError("mesh.local has no effect on the tyre's structured mesh; change mesh.size")
    mesh["size"] = size = positive_size("mesh.size", SIZE if mesh.get("size") is None else mesh["size"])
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
    half = radians(p["contact_angle"]) / 2
    rest = (2 * np.pi - 2 * half) / 3
    starts = [-np.pi / 2 - half, *(-np.pi / 2 + half + k * rest for k in range(3))]
    parts = [sector(p, a, b) for a, b in zip(starts, [2 * half, rest, rest, rest], strict=True)]
    gmsh.model.occ.fragment(parts[:1], parts[1:])
    gmsh.model.occ.synchronize()
    divide(p, size)
    name_surfaces(p)
    name_body()


def settled(parameters: dict) -> dict:
    """All parameters, checked against each other."""
    p = checked(parameters, DEFAULTS)
    if p["hub_radius"] >= p["outer_radius"]:
        raise UserError(f"geometry.parameters.hub_radius = {p['hub_radius']} must stay below {p['outer_radius']}")
    if p["contact_angle"] > 120:
        raise UserError(f"geometry.parameters.contact_angle = {p['contact_angle']} must stay below 120 degrees")
    return p


def sector(p: dict, start: float, angle: float) -> tuple[int, int]:
    """A part of the ring, angles from x to z."""
    add = gmsh.model.occ
    flat = add.addRectangle(p["hub_radius"], -p["width"] / 2, 0, p["outer_radius"] - p["hub_radius"], p["width"])
    add.rotate([(2, flat)], 0, 0, 0, 0, 1, 0, -start)
    return next(e for e in add.revolve([(2, flat)], 0, 0, 0, 0, 1, 0, -angle) if e[0] == 3)


def divide(p: dict, size: float) -> None:
    """Bricks: over the radius and the width, round the axle finer near the ground."""
    low = -p["hub_radius"] * np.cos(radians(p["contact_angle"]) / 2)
    for _, curve in gmsh.model.getEntities(1):
        box = np.reshape(gmsh.model.getBoundingBox(1, curve), (2, 3))
        if gmsh.model.getType(1, curve) == "Line":
            length = p["width"] if np.ptp(box[:, 1]) > 0.5 * p["width"] else p["outer_radius"] - p["hub_radius"]
            count = ceil(length / size)
        else:
            near = box[1, 2] < 0.99 * low
            angle = p["contact_angle"] if near else (360 - p["contact_angle"]) / 3
            count = ceil(radians(angle) * p["outer_radius"] / (FINE * size if near else COARSE * size))
        gmsh.model.mesh.setTransfiniteCurve(curve, count + 1)
    for _, surface in gmsh.model.getEntities(2):
        gmsh.model.mesh.setTransfiniteSurface(surface)
        gmsh.model.mesh.setRecombine(2, surface)
    for _, volume in gmsh.model.getEntities(3):
        gmsh.model.mesh.setTransfiniteVolume(volume)


def name_surfaces(p: dict) -> None:
    half = p["contact_angle"] / 2

    def on_tread(c: np.ndarray, box: np.ndarray) -> bool:
        low = box[0, 2] < -0.999 * p["outer_radius"] and np.hypot(c[0], c[2]) > 0.9 * p["outer_radius"]
        return bool(low and np.ptp(box[:, 1]) > 0.5 * p["width"] and abs(degrees(atan2(c[0], -c[2]))) < half)

    def on_hub(c: np.ndarray, box: np.ndarray) -> bool:
        reach = np.abs(box[:, [0, 2]]).max()
        return bool(reach < 1.001 * p["hub_radius"] and np.ptp(box[:, 1]) > 0.5 * p["width"])

    name_face("tread", surfaces_where(on_tread))
    name_face("hub", surfaces_where(on_hub))


if __name__ == "__main__":
    run(draw)
