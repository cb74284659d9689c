"""An annular brake disc, clamped at its bore, with a patch on either side where a pad lies (geometry/pad).

Axes: the disc turns about z through the origin, its middle plane is z = 0. The pads lie about the x-axis, on the part
of the ring from pad_inner to pad_outer and from -pad_angle / 2 to pad_angle / 2. Faces: bore, pad_top (z > 0),
pad_bottom.

A structured mesh of bricks of second order, with whole elements under the pad.
"""

from math import ceil

import gmsh
import numpy as np

from microslip.cad import checked, name_body, name_face, positive_size, run, surfaces_where
from microslip.errors import UserError

DEFAULTS = {  # mm and degrees
    "bore_radius": 50.0,
    "outer_radius": 150.0,
    "thickness": 12.0,
    "pad_inner": 105.0,
    "pad_outer": 140.0,
    "pad_angle": 30.0,
}
SIZE = 20.0  # mm


def draw(parameters: dict, mesh: dict) -> None:
    p = settled(parameters)
    if mesh.get("local"):
        raise UserError("mesh.local has no effect on the disc's structured mesh; change mesh.size")
    mesh["size"] = size = positive_size("mesh.size", SIZE if mesh.get("size") is None else mesh["size"])
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
    rings = ["bore_radius", "pad_inner", "pad_outer", "outer_radius"]
    parts = [
        part(p, p[inner], p[outer], *arc) for inner, outer in zip(rings, rings[1:], strict=False) for arc in arcs(p)
    ]
    gmsh.model.occ.fragment(parts[:1], parts[1:])
    gmsh.model.occ.synchronize()
    divide(p, size)
    name_surfaces(p)
    name_body()


def settled(parameters: dict) -> dict:
    """All parameters, checked against each other."""
    p = checked(parameters, DEFAULTS)
    rising = ["bore_radius", "pad_inner", "pad_outer", "outer_radius"]
    for small, large in zip(rising, rising[1:], strict=False):
        if p[small] >= p[large]:
            raise UserError(f"geometry.parameters.{small} = {p[small]} must stay below {large} = {p[large]}")
    if p["pad_angle"] > 170:
        raise UserError(f"geometry.parameters.pad_angle = {p['pad_angle']} must stay below 170 degrees")
    return p


def arcs(p: dict) -> list[tuple[float, float]]:
    """(first, last) angle of the parts round the axis, the patch first."""
    ends = np.radians(np.linspace(p["pad_angle"] / 2, 360 - p["pad_angle"] / 2, 4))
    return [(-ends[0], ends[0]), *zip(ends, ends[1:], strict=False)]


def part(p: dict, inner: float, outer: float, first: float, last: float) -> tuple[int, int]:
    """A piece of a ring between two angles: its section, swept round the axis."""
    add = gmsh.model.occ
    section = add.addRectangle(inner, -p["thickness"] / 2, 0, outer - inner, p["thickness"])
    add.rotate([(2, section)], 0, 0, 0, 1, 0, 0, np.pi / 2)
    add.rotate([(2, section)], 0, 0, 0, 0, 0, 1, first)
    return next(one for one in add.revolve([(2, section)], 0, 0, 0, 0, 0, 1, last - first) if one[0] == 3)


def divide(p: dict, size: float) -> None:
    """Bricks in every piece: one through the thickness, along radius and arc as the size says, two at least."""
    for _, curve in gmsh.model.getEntities(1):
        length, ends = gmsh.model.occ.getMass(1, curve), gmsh.model.getParametrizationBounds(1, curve)
        x, y, z = gmsh.model.getValue(1, curve, [(ends[0][0] + ends[1][0]) / 2])
        if gmsh.model.getType(1, curve) != "Line":
            count = max(2, ceil(length / np.hypot(x, y) * p["pad_outer"] / size))
        else:
            count = 1 if abs(z) < 1e-6 * p["thickness"] else max(1, round(length / size))
        gmsh.model.mesh.setTransfiniteCurve(curve, count + 1)
    for _, surface in gmsh.model.getEntities(2):
        gmsh.model.mesh.setTransfiniteSurface(surface)
        gmsh.model.mesh.setRecombine(2, surface)
    for _, volume in gmsh.model.getEntities(3):
        gmsh.model.mesh.setTransfiniteVolume(volume)


def name_surfaces(p: dict) -> None:
    near, middle = 1e-3 * p["thickness"], (p["pad_inner"] + p["pad_outer"]) / 2
    inside = p["bore_radius"] + near

    def on_patch(z: float):
        return lambda c, _: bool(
            abs(c[2] - z) < near and abs(c[1]) < near and abs(c[0] - middle) < (p["pad_outer"] - p["pad_inner"]) / 2
        )

    name_face("bore", surfaces_where(lambda c, box: bool(np.abs(box[:, :2]).max() < inside and abs(c[2]) < near)))
    name_face("pad_top", surfaces_where(on_patch(p["thickness"] / 2)))
    name_face("pad_bottom", surfaces_where(on_patch(-p["thickness"] / 2)))


if __name__ == "__main__":
    run(draw)
