"""One flanged half pipe of the bolted pipe of Sextro ch. 5.7.

Axes: x across the pipe, y along it, z out of the split plane; the body lies at z >= 0, the middle of its
length at y = 0. The mating faces lie in z = 0 and their outward normal is -z. The second half is the same
body turned by 180 degrees about y: bolt i of one half (side +x) then meets bolt i + bolts_per_seam of the
other.

The book prints no dimensions; these are a common steel pipe with M8 bolts at a pitch of 100 mm.
"""

import math
from collections.abc import Callable

import gmsh
import numpy as np

from microslip.cad import checked, name_body, name_face, positive_size, run, surfaces_where
from microslip.errors import UserError

DEFAULTS = {  # mm
    "mean_radius": 50.0,
    "wall": 5.0,
    "length": 600.0,
    "flange_width": 25.0,  # outwards from the pipe's outer radius, in the split plane
    "flange_thickness": 8.0,
    "bolts_per_seam": 6,
    "bolt_pitch": 100.0,
    "bolt_hole": 9.0,  # diameter
    "patch_width": 25.0,  # contact patch of a bolt, across the flange
    "patch_length": 40.0,  # along the pipe
    "washer_radius": 0.0,  # of the rings under the bolt heads; 0: none are drawn
}
SIDES_OF_HOLE = 8  # elements around a bolt hole, at least


def draw(parameters: dict, mesh: dict) -> None:
    p = settled(parameters)
    volume = gmsh.model.occ.extrude([(2, cross_section(p))], 0, p["length"], 0)[1]
    drilled = gmsh.model.occ.cut([volume], drills(p))[0]
    imprints = [patch for x, y in bolts(p) for patch in contact_patch(p, x, y)]
    if p["washer_radius"]:
        imprints += [ring for x, y in bolts(p) for ring in head_ring(p, x, y)]
    gmsh.model.occ.fragment(drilled, imprints)
    gmsh.model.occ.synchronize()
    name_surfaces(p)
    name_body()
    refine_holes(p, mesh)


def settled(parameters: dict) -> dict:
    """All parameters, checked against each other."""
    p = checked(parameters, DEFAULTS)
    if p["bolts_per_seam"] != int(p["bolts_per_seam"]):
        raise UserError(f"geometry.parameters.bolts_per_seam = {p['bolts_per_seam']} must be a whole number")
    p["bolts_per_seam"] = int(p["bolts_per_seam"])
    p["inner"] = p["mean_radius"] - p["wall"] / 2
    p["outer"] = p["mean_radius"] + p["wall"] / 2
    limits = [
        ("wall", 2 * p["mean_radius"], "the pipe's diameter"),
        ("flange_thickness", p["inner"], "the inner radius"),
        ("bolt_hole", min(p["patch_width"], p["patch_length"]), "the patch around it"),
        ("patch_width", p["flange_width"] * (1 + 1e-9), "flange_width"),
    ]
    if p["bolts_per_seam"] > 1:
        limits += [("patch_length", p["bolt_pitch"], "bolt_pitch, so that patches stay apart")]
    for name, limit, what in limits:
        if p[name] >= limit:
            raise UserError(f"geometry.parameters.{name} = {p[name]} must stay below {limit:g} ({what})")
    refuse_washer(p)
    row = (p["bolts_per_seam"] - 1) * p["bolt_pitch"] + p["patch_length"]
    if row > p["length"]:
        raise UserError(f"geometry.parameters.length = {p['length']} is too short for a bolt row of {row:g}")
    return p


def refuse_washer(p: dict) -> None:
    """Refuse rings under the heads that do not lie on the flange between hole, edge, pipe and their neighbours."""
    if p["washer_radius"] == 0:
        return
    limits = [
        (p["flange_width"] / 2, "half of flange_width, so that the washer lies on the flange"),
        (p["patch_length"] / 2, "half of patch_length, so that washers stay apart and on the flange"),
    ]
    if p["washer_radius"] <= p["bolt_hole"] / 2:
        raise UserError(
            f"geometry.parameters.washer_radius = {p['washer_radius']} must be above {p['bolt_hole'] / 2:g} (half of "
            "bolt_hole), or 0 for no washers"
        )
    for limit, what in limits:
        if p["washer_radius"] >= limit:
            raise UserError(
                f"geometry.parameters.washer_radius = {p['washer_radius']} must stay below {limit:g} ({what})"
            )


def cross_section(p: dict) -> int:
    """The profile at the front end y = -length / 2: half a ring with a flange on either side."""
    add, y = gmsh.model.occ, -p["length"] / 2
    top, reach = p["flange_thickness"], p["outer"] + p["flange_width"]
    half = [(p["inner"], 0), (reach, 0), (reach, top), (math.sqrt(p["outer"] ** 2 - top**2), top)]
    right = [add.addPoint(x, y, z) for x, z in half]
    left = [add.addPoint(-x, y, z) for x, z in reversed(half)]
    crown, inside = add.addPoint(0, y, p["outer"]), add.addPoint(0, y, p["inner"])
    centre = add.addPoint(0, y, 0)
    curves = [add.addLine(a, b) for a, b in zip(right, right[1:], strict=False)]
    curves += [add.addCircleArc(right[-1], centre, crown), add.addCircleArc(crown, centre, left[0])]
    curves += [add.addLine(a, b) for a, b in zip(left, left[1:], strict=False)]
    curves += [add.addCircleArc(left[-1], centre, inside), add.addCircleArc(inside, centre, right[0])]
    return add.addPlaneSurface([add.addCurveLoop(curves)])


def bolts(p: dict) -> list[tuple[float, float]]:
    """Centres (x, y) of bolt_1, bolt_2, ...: side +x from front to rear, then side -x."""
    x, n = p["outer"] + p["flange_width"] / 2, p["bolts_per_seam"]
    return [(side * x, p["bolt_pitch"] * (i - (n - 1) / 2)) for side in (1, -1) for i in range(n)]


def drills(p: dict) -> list[tuple[int, int]]:
    """Cylinders that cut the bolt holes."""
    t = p["flange_thickness"]
    add = gmsh.model.occ.addCylinder
    return [(3, add(x, y, -t, 0, 0, 3 * t, p["bolt_hole"] / 2)) for x, y in bolts(p)]


def contact_patch(p: dict, x: float, y: float) -> list[tuple[int, int]]:
    """Rectangle around a bolt without its hole, to be imprinted on the mating face."""
    a, b = p["patch_width"], p["patch_length"]
    rectangle = gmsh.model.occ.addRectangle(x - a / 2, y - b / 2, 0, a, b)
    hole = gmsh.model.occ.addDisk(x, y, 0, p["bolt_hole"] / 2, p["bolt_hole"] / 2)
    return gmsh.model.occ.cut([(2, rectangle)], [(2, hole)])[0]


def head_ring(p: dict, x: float, y: float) -> list[tuple[int, int]]:
    """Ring under a bolt's head, to be imprinted on the flange's far side."""
    add, top = gmsh.model.occ.addDisk, p["flange_thickness"]
    disk, hole = (add(x, y, top, r, r) for r in (p["washer_radius"], p["bolt_hole"] / 2))
    return gmsh.model.occ.cut([(2, disk)], [(2, hole)])[0]


def name_surfaces(p: dict) -> None:
    """Bolt patches, rings under the heads, the rest of the mating faces, the ends, the pipe's outside and inside."""
    near, end = 1e-5 * p["length"], p["length"] / 2

    def flat(axis: int, value: float):
        return lambda centre, box: np.ptp(box[:, axis]) < near and abs(centre[axis] - value) < near

    def round_face(radius: float):
        return lambda centre, box: abs(box[1, 2] - radius) < near and np.ptp(box[:, 1]) > end

    mating = flat(2, 0.0)
    patches = {}
    for number, place in enumerate(bolts(p), 1):
        patches[f"bolt_{number}"] = surfaces_where(
            lambda centre, box, place=place: mating(centre, box) and np.hypot(*(centre[:2] - place)) < near
        )
    taken = {tag for tags in patches.values() for tag in tags}
    for name, tags in patches.items():
        name_face(name, tags)
    for name, side in (("seam_right", 1), ("seam_left", -1)):
        rest = surfaces_where(lambda c, box, side=side: mating(c, box) and side * c[0] > 0)
        name_face(name, [tag for tag in rest if tag not in taken])
    if p["washer_radius"]:
        name_heads(p, flat(2, p["flange_thickness"]), near)
    name_face("end_front", surfaces_where(flat(1, -end)))
    name_face("end_rear", surfaces_where(flat(1, end)))
    for name, radius in (("outside", p["outer"]), ("inside", p["inner"])):
        name_face(name, surfaces_where(round_face(radius)))


def name_heads(p: dict, far_side: Callable[[np.ndarray, np.ndarray], bool], near: float) -> None:
    """Rings head_1, head_2, ... opposite the patches bolt_1, bolt_2, ..."""
    reach = 2 * p["washer_radius"] + near
    for number, place in enumerate(bolts(p), 1):
        ring = surfaces_where(
            lambda centre, box, place=place: (
                far_side(centre, box) and np.hypot(*(centre[:2] - place)) < near and np.ptp(box[:, 0]) < reach
            )
        )
        name_face(f"head_{number}", ring)


def refine_holes(p: dict, mesh: dict) -> None:
    """Enough elements around each hole, whatever mesh.size."""
    around = math.pi * p["bolt_hole"]
    size = positive_size("mesh.size", mesh.get("size", around))
    elements = max(SIDES_OF_HOLE, math.ceil(around / size))
    circles = [tag for _, tag in gmsh.model.getEntities(1) if gmsh.model.getType(1, tag) == "Circle"]
    for tag in circles:
        if abs(gmsh.model.occ.getMass(1, tag) - around) < 1e-6 * around:
            gmsh.model.mesh.setTransfiniteCurve(tag, 1 + elements)


if __name__ == "__main__":
    run(draw)
