"""A brake pad: a block with the plan of a part of a ring that lies on a brake disc (geometry/brake-disc).

Axes: those of the disc, whose axis is z through the origin; the pad lies about the x-axis, its face "lining" in the
plane z = lining_height, its "back" at z = lining_height + height. A structured mesh of bricks of second order.
"""

from math import ceil, radians

import gmsh
import numpy as np

from microslip.cad import checked, name_body, name_face, positive_size, run, surfaces_where
from microslip.errors import UserError

DEFAULTS = {  # mm and degrees
    "inner_radius": 105.0,
    "outer_radius": 140.0,
    "angle": 30.0,
    "height": 18.0,
    "lining_height": 6.0,
}
SIZE = 15.0  # mm


def draw(parameters: dict, mesh: dict) -> None:
    p = settled(parameters)
    if mesh.get("local"):
        raise UserError("mesh.local has no effect on the pad's structured mesh; change mesh.size")
    mesh["size"] = size = positive_size("mesh.size", SIZE if mesh.get("size") is None else mesh["size"])
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
    add = gmsh.model.occ
    width, low = p["outer_radius"] - p["inner_radius"], p["lining_height"]
    section = add.addRectangle(p["inner_radius"], low, 0, width, p["height"])
    add.rotate([(2, section)], 0, 0, 0, 1, 0, 0, np.pi / 2)
    add.rotate([(2, section)], 0, 0, 0, 0, 0, 1, radians(-p["angle"] / 2))
    along = max(2, ceil(radians(p["angle"]) * p["outer_radius"] / size))
    counts = [along, ceil(width / size), ceil(p["height"] / size)]
    add.revolve([(2, section)], 0, 0, 0, 0, 0, 1, radians(p["angle"]))
    gmsh.model.occ.synchronize()
    divide(counts, p)
    name_face("lining", surfaces_where(lambda c, box: bool(np.abs(box[:, 2] - low).max() < 1e-3 * p["height"])))
    name_face("back", surfaces_where(lambda c, box: bool(box[0, 2] > low + 0.999 * p["height"])))
    name_body()


def settled(parameters: dict) -> dict:
    """All parameters, checked against each other."""
    p = checked(parameters, DEFAULTS)
    if p["inner_radius"] >= p["outer_radius"]:
        raise UserError(
            f"geometry.parameters.inner_radius = {p['inner_radius']} must stay below outer_radius = {p['outer_radius']}"
        )
    if p["angle"] > 170:
        raise UserError(f"geometry.parameters.angle = {p['angle']} must stay below 170 degrees")
    return p


def divide(counts: list[int], p: dict) -> None:
    """Bricks: counts along the arc, the radius and the height."""
    for _, curve in gmsh.model.getEntities(1):
        box = np.reshape(gmsh.model.getBoundingBox(1, curve), (2, 3))
        upright = np.ptp(box[:, 2]) > 0.5 * p["height"]
        which = 0 if gmsh.model.getType(1, curve) != "Line" else 2 if upright else 1
        gmsh.model.mesh.setTransfiniteCurve(curve, counts[which] + 1)
    for _, surface in gmsh.model.getEntities(2):
        gmsh.model.mesh.setTransfiniteSurface(surface)
        gmsh.model.mesh.setRecombine(2, surface)
    for _, volume in gmsh.model.getEntities(3):
        gmsh.model.mesh.setTransfiniteVolume(volume)


if __name__ == "__main__":
    run(draw)
