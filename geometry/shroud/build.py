"""A twisted, tapered blade on a disc sector with an interlocking shroud (Sextro Figs. 5.1-1 to 5.1-3).

Axes (Fig. 5.1-2): the rotor turns about the y-axis, z is radial in the middle of the sector, x
circumferential. A positive rotation about y by the sector angle 2 pi / blades carries blade i onto blade i+1,
which stands towards +x; "right" is the side towards blade i+1. Hence

    cyclic_right = R cyclic_left,   contact_right = R contact_left,   R = rotation about +y by +2 pi / blades,

so contact_left of blade i+1 is contact_right of blade i, but for a gap: then each contact face is turned away
from its neighbour, about y and by the same small angle, until the faces' centres are a gap apart.

The outward normal of contact_right is (cos beta, sin beta, 0), turned about y by half the sector angle; beta
is shroud_angle. The chord leans by the stagger angle from +y towards +x, so with stagger growing outwards the
blade untwists at speed in the sense that presses contacts with positive beta together. Flow is towards +y;
the pressure side is the concave one, towards +x, so a turbine with these blades turns towards -x.

Design 1: a plate whose sides are straight and inclined by beta, as in steam turbines. Design 2: Z-shaped
sides whose middle part is the contact, inclined by beta, as in aircraft engines. The plate is cut from a ring
by plane sides, so the contacts are plane, contact_width x contact_height (b0 x h0), their long edges a little
curved.
"""

import gmsh
import numpy as np

from microslip.cad import checked, name_body, name_face, run, surfaces_where
from microslip.errors import UserError

DEFAULTS = {  # mm and degrees
    "design": 1,
    "blades": 24,
    "bore_radius": 170.0,
    "rim_radius": 240.0,
    "disc_width": 70.0,
    "tip_radius": 400.0,  # underside of the shroud
    "chord_root": 66.0,
    "chord_tip": 48.0,
    "thickness_root": 7.5,
    "thickness_tip": 4.5,
    "edge_thickness": 2.0,  # diameter of the round leading and trailing edges
    "camber_root": 0.12,  # height of the mean line over the chord
    "camber_tip": 0.04,
    "stagger": 15.0,  # of the root, between chord and rotor axis
    "twist": 40.0,  # stagger of the tip minus stagger of the root
    "shroud_angle": 30.0,
    "shroud_width": 44.0,  # along the rotor axis
    "contact_width": 40.0,  # b0
    "contact_height": 6.0,  # h0, the shroud's thickness
    "gap": 0.0,  # between the centres of two facing contacts, along their normal
}
DESIGN_2 = {"shroud_angle": 60.0, "contact_width": 20.0}
SIGNED = ("camber_root", "camber_tip", "stagger", "twist", "shroud_angle")
SECTIONS = 5
STATIONS = 13  # points along the mean line of a section


def draw(parameters: dict, mesh: dict) -> None:
    p = settled(parameters)
    parts = [disc(p), blade(p), *shroud(p)]
    gmsh.option.setNumber("Geometry.OCCUnionUnify", 0)  # keeps the contacts apart from the plate's sides
    gmsh.model.occ.fuse(parts[:1], parts[1:])
    gmsh.model.occ.synchronize()
    name_surfaces(p)
    name_body()


# ---------------------------------------------------------------- parameters


def settled(parameters: dict) -> dict:
    """All parameters, checked against each other; angles of sector and gap in radians."""
    design = parameters.get("design", 1)
    if design not in (1, 2):
        raise UserError(f"geometry.parameters.design = {design!r} must be 1 or 2")
    p = checked(parameters, {**DEFAULTS, **(DESIGN_2 if design == 2 else {})}, signed=SIGNED)
    if p["blades"] != int(p["blades"]) or p["blades"] < 4:
        raise UserError(f"geometry.parameters.blades = {p['blades']} must be a whole number, 4 or more")
    refuse_outside(p, "stagger", -75, 75, "degrees")
    refuse_outside(p, "twist", -90, 90, "degrees; beyond, the blade's surface would cut itself")
    refuse_outside(p, "shroud_angle", -75, 75, "degrees")
    refuse_outside(p, "camber_root", 0, 0.3, "chord lengths")
    refuse_outside(p, "camber_tip", 0, 0.3, "chord lengths")
    limits = [("bore_radius", "rim_radius"), ("rim_radius", "tip_radius")]
    limits += [(f"thickness_{end}", f"chord_{end}") for end in ("root", "tip")]
    limits += [("edge_thickness", f"thickness_{end}") for end in ("root", "tip")]
    for small, large in limits:
        if p[small] >= p[large]:
            raise UserError(f"geometry.parameters.{small} = {p[small]} must stay below {large} = {p[large]}")
    p["sector"] = 2 * np.pi / p["blades"]
    p["beta"] = np.deg2rad(p["shroud_angle"])
    p["contact_radius"] = p["tip_radius"] + p["contact_height"] / 2
    p["half_gap"] = p["gap"] / (2 * p["contact_radius"] * np.cos(p["beta"]))
    refuse_misfits(p)
    return p


def refuse_outside(p: dict, name: str, low: float, high: float, unit: str) -> None:
    if not low <= p[name] <= high:
        raise UserError(f"geometry.parameters.{name} = {p[name]} must lie between {low} and {high} {unit}")


def refuse_misfits(p: dict) -> None:
    """Contact on the shroud, the blade's root on the disc sector, its tip under the shroud: all must fit."""
    key = "geometry.parameters."
    axial = p["contact_width"] * np.cos(p["beta"])
    room = p["shroud_width"] * (1 + 1e-9 if p["design"] == 1 else 0.95)
    if axial > room:
        raise UserError(
            f"{key}contact_width = {p['contact_width']} needs {axial:.4g} of the shroud's axial width "
            f"at this shroud_angle, but shroud_width = {p['shroud_width']}"
        )
    if p["gap"] < 0 or 2 * p["half_gap"] > 0.1 * p["sector"]:
        raise UserError(f"{key}gap = {p['gap']} must lie between 0 and a tenth of the blade pitch")
    root, tip = section(p, p["rim_radius"]), section(p, p["tip_radius"])
    if np.abs(root[:, 1]).max() >= p["disc_width"] / 2:
        raise UserError(f"{key}chord_root = {p['chord_root']} is too long for disc_width = {p['disc_width']}")
    if np.abs(root[:, 0]).max() >= p["rim_radius"] * np.sin(p["sector"] / 2):
        raise UserError(f"{key}blades = {p['blades']} leaves too little rim for chord_root and stagger")
    if bottom_of_blade(p) <= p["bore_radius"]:
        raise UserError(f"{key}bore_radius = {p['bore_radius']} leaves a rim too thin to hold the blade")
    if p["tip_radius"] - p["rim_radius"] < p["chord_root"] / 4:
        raise UserError(f"{key}tip_radius = {p['tip_radius']} makes the blade shorter than a quarter of its chord")
    x, y = side_of_shroud(p).T
    if np.abs(x).max() > p["tip_radius"] / 2:
        raise UserError(f"{key}shroud_angle = {p['shroud_angle']} is too much for the width of shroud and contact")
    half_pitch = p["tip_radius"] * np.sin(p["sector"] / 2)
    beyond = np.abs(tip[:, 0] - np.interp(tip[:, 1], y, x)) >= half_pitch
    if beyond.any() or np.abs(tip[:, 1]).max() >= p["shroud_width"] / 2:
        raise UserError(f"{key}chord_tip = {p['chord_tip']} does not fit under the shroud (stagger + twist)")
    if not top_of_blade(p) > p["tip_radius"]:  # also if there is no such height
        raise UserError(f"{key}contact_height = {p['contact_height']} is too thin to hold the blade's tip")


# ---------------------------------------------------------------- solids


def disc(p: dict) -> tuple[int, int]:
    return ring(p["bore_radius"], p["rim_radius"], p["disc_width"], p["sector"] / 2)


def ring(inner: float, outer: float, width: float, half: float) -> tuple[int, int]:
    """Arc of a ring about the y-axis between the angles -half and half: a rectangle, turned."""
    y = width / 2
    corners = [(0, -y, inner), (0, y, inner), (0, y, outer), (0, -y, outer)]
    base = polygon([gmsh.model.occ.addPoint(*turned(c, -half)) for c in corners])
    return gmsh.model.occ.revolve([(2, base)], 0, 0, 0, 0, 1, 0, 2 * half)[1]


def turned(point: tuple[float, float, float], angle: float) -> np.ndarray:
    """The point rotated about the y-axis; positive angles carry z towards x."""
    return rotation(angle) @ point


def rotation(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def polygon(points: list[int]) -> int:
    """Plane surface with the given corners."""
    lines = [gmsh.model.occ.addLine(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    return gmsh.model.occ.addPlaneSurface([gmsh.model.occ.addCurveLoop(lines)])


def shroud(p: dict) -> list[tuple[int, int]]:
    """The plate: an arc of a ring, cut by a prism on either side."""
    reach = np.abs(side_of_shroud(p)[:, 0]).max() / p["tip_radius"]
    half = p["sector"] / 2 + 1.2 * np.arcsin(reach) + 0.1 * p["sector"]
    inner, outer = p["tip_radius"], p["tip_radius"] + p["contact_height"]
    arc = ring(inner, outer, p["shroud_width"], half)
    cut = p["sector"] / 2 - p["half_gap"]
    return gmsh.model.occ.cut([arc], [prism(p, side, side * cut) for side in (-1, 1)])[0]


def prism(p: dict, side: int, angle: float) -> tuple[int, int]:
    """Everything beyond the plate's side at the given angle; its plane sides leave the plate's."""
    outline = side_of_shroud(p)
    outwards = outline[[0, -1]] - outline[[1, -2]]
    lengths = np.linalg.norm(outwards, axis=1)[:, None]
    ends = outline[[0, -1]] + 0.2 * p["shroud_width"] * outwards / lengths  # beyond the plate's front and rear
    far = side * 1.5 * p["tip_radius"]
    outline = np.vstack([ends[:1], outline[1:-1], ends[1:], [[far, ends[1, 1]], [far, ends[0, 1]]]])
    low, high = 0.5 * p["tip_radius"], 1.1 * (p["tip_radius"] + p["contact_height"])
    base = polygon([gmsh.model.occ.addPoint(*turned((x, y, low), angle)) for x, y in outline])
    return gmsh.model.occ.extrude([(2, base)], *turned((0, 0, high - low), angle))[1]


def side_of_shroud(p: dict) -> np.ndarray:
    """Corners (x, y) of a side in top view, front to rear, x from the sector's edge; contact in the middle."""
    s, c = np.sin(p["beta"]), np.cos(p["beta"])
    contact = p["contact_width"] / 2 * np.array([[s, -c], [-s, c]])
    end = p["shroud_width"] / 2
    if end - contact[1, 1] < 1e-9 * end:
        return contact
    x = end * s / c if p["design"] == 1 else contact[0, 0]
    return np.array([[x, -end], *contact, [-x, end]])


def blade(p: dict) -> tuple[int, int]:
    """Loft through plane sections, from within the disc to within the shroud."""
    wires = [wire(p, z) for z in np.linspace(bottom_of_blade(p), top_of_blade(p), SECTIONS)]
    return gmsh.model.occ.addThruSections(wires, makeSolid=True, makeRuled=False)[0]


def bottom_of_blade(p: dict) -> float:
    """Below every point of the curved rim that the root covers."""
    reach = np.abs(section(p, p["rim_radius"])[:, 0]).max() * 1.2
    return np.sqrt(p["rim_radius"] ** 2 - reach**2) - 0.05 * (p["rim_radius"] - p["bore_radius"])


def top_of_blade(p: dict) -> float:
    """Halfway between the shroud's underside and its lowest point above the tip."""
    reach = np.abs(section(p, p["tip_radius"])[:, 0]).max() * 1.2
    outer = p["tip_radius"] + p["contact_height"]
    return (p["tip_radius"] + np.sqrt(outer**2 - reach**2)) / 2


def wire(p: dict, z: float) -> int:
    """Outline of a section: convex and concave side, each a spline from leading to trailing edge."""
    convex, concave = sides(p, z)
    points = [gmsh.model.occ.addPoint(x, y, z) for x, y in convex]
    inner = [gmsh.model.occ.addPoint(x, y, z) for x, y in concave[1:-1]]
    splines = [gmsh.model.occ.addSpline(s) for s in (points, [points[-1], *inner[::-1], points[0]])]
    return gmsh.model.occ.addCurveLoop(splines)


def section(p: dict, z: float) -> np.ndarray:
    """Points (x, y) all around the section at height z."""
    return np.vstack(sides(p, z))


def sides(p: dict, z: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (x, y) of the convex and the concave side, leading edge to trailing edge.

    A parabolic mean line carries half thicknesses r + (t/2 - r) sin(pi s^0.75)^2, largest at 40 % of the
    chord, and ends in half circles of radius r; both join smoothly. The middle of the mean line lies on the z-axis.
    """
    height = (z - p["rim_radius"]) / (p["tip_radius"] - p["rim_radius"])

    def at(root: float, tip: float) -> float:
        return root + (tip - root) * height

    r = p["edge_thickness"] / 2
    length = at(p["chord_root"], p["chord_tip"]) - 2 * r
    camber = at(p["camber_root"], p["camber_tip"])
    s = (1 - np.cos(np.linspace(0, np.pi, STATIONS))) / 2
    half = r + (at(p["thickness_root"], p["thickness_tip"]) / 2 - r) * np.sin(np.pi * s**0.75) ** 2
    mean = length * np.column_stack([s - 0.5, camber * (4 * s * (1 - s) - 2 / 3)])
    along = np.column_stack([np.ones_like(s), 4 * camber * (1 - 2 * s)])
    along /= np.linalg.norm(along, axis=1)[:, None]
    across = along @ [[0, 1], [-1, 0]]
    turn = np.linspace(0, np.pi / 2, 4)[:-1, None]
    outlines = []
    for side in (1, -1):
        nose = mean[0] + r * (side * np.sin(turn) * across[0] - np.cos(turn) * along[0])
        tail = mean[-1] + r * (side * np.sin(turn) * across[-1] + np.cos(turn) * along[-1])
        outlines.append(np.vstack([nose, mean + side * half[:, None] * across, tail[::-1]]))
    gamma = np.deg2rad(at(p["stagger"], p["stagger"] + p["twist"]))
    to_body = np.array([[np.sin(gamma), np.cos(gamma)], [-np.cos(gamma), np.sin(gamma)]])  # chord, its normal
    return outlines[0] @ to_body, outlines[1] @ to_body


# ---------------------------------------------------------------- names


def name_surfaces(p: dict) -> None:
    """Cyclic faces and contacts (meshed alike on both sides), bore, shroud's top, the blade's two sides."""
    half, near = p["sector"] / 2, 1e-5 * p["tip_radius"]

    def centred(low: float, high: float, angle: float) -> list[int]:
        """Plane radial faces whose centre lies between two radii at the given angle."""

        def holds(centre: np.ndarray, box: np.ndarray) -> bool:
            local = turned(centre, -angle)
            return bool(np.abs(local[:2]).max() < near and low < local[2] < high)

        return surfaces_where(holds)

    for face, low, high, angle in (
        ("cyclic", p["bore_radius"], p["rim_radius"], half),
        ("contact", p["rim_radius"], 2 * p["tip_radius"], half - p["half_gap"]),
    ):
        left, right = centred(low, high, -angle), centred(low, high, angle)
        name_face(f"{face}_left", left)
        name_face(f"{face}_right", right)
        matrix = np.eye(4)
        matrix[:3, :3] = rotation(2 * angle)
        gmsh.model.mesh.setPeriodic(2, right, left, matrix.ravel())
    name_face("bore", surfaces_where(lambda centre, box: abs(box[1, 2] - p["bore_radius"]) < near))
    top, wide = p["tip_radius"] + p["contact_height"] - near, p["shroud_width"] / 2
    name_face("shroud_top", surfaces_where(lambda c, box: box[1, 2] > top and np.ptp(box[:, 1]) > wide))
    convex = {tag: is_convex(p, tag) for tag in surfaces_where(lambda centre, box: on_blade(p, centre))}
    name_face("pressure_side", [tag for tag, side in convex.items() if not side])
    name_face("suction_side", [tag for tag, side in convex.items() if side])


def on_blade(p: dict, centre: np.ndarray) -> bool:
    """True between rim and shroud."""
    margin = 0.2 * (p["tip_radius"] - p["rim_radius"])
    return bool(p["rim_radius"] + margin < np.hypot(centre[0], centre[2]) < p["tip_radius"] - margin)


def is_convex(p: dict, tag: int) -> bool:
    """Whether a point in the middle of the surface lies nearer to the section's convex side."""
    low, high = gmsh.model.getParametrizationBounds(2, tag)
    x, y, z = gmsh.model.getValue(2, tag, (np.array(low) + np.array(high)) / 2)
    near = [np.linalg.norm(side - [x, y], axis=1).min() for side in sides(p, z)]
    return bool(near[0] < near[1])


if __name__ == "__main__":
    run(draw)
