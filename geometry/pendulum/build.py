"""The pendulum of the test stand of Sextro Figs. 3.6-1 and 4.2-1: a slender arm on an air bearing.

Axes: y is the axis of rotation (through the origin), z runs along the arm, x is the direction in which the
arm swings. Two contact pads: contact_tip near the arm's end (normal +x) hits the stop of ch. 4.2;
contact_disc near the hub (normal -y, parallel to the axis) rubs on the disc of ch. 4.3.

The bearing: two shaft stubs whose surface is the face "bearing" and whose centre line is the set
"hinge_axis". Holding hinge_axis in x, y, z leaves exactly one rigid motion, the rotation about y; the air
bearing also lets the shaft slide (ch. 4.2), which is hinge_axis held in x and z only. Holding the face
"bearing" clamps the shaft.

The book prints no dimensions, only the oscillator reduced to the contact: 0.092 kg and 99.085 N/m at the stop
(ch. 4.2), 5.632 kg and 5610 N/m at the disc (ch. 4.3). The roots of the two ratios, 7.82 and 7.52, nearly
agree, as they do when one pendulum is reduced to two points whose distances from the axis stand in that
ratio. Chosen here: 400 mm to the stop and a steel arm of 8 x 10.4 mm, so that the moment of inertia J =
0.0147 kg m2 gives J / (400 mm)^2 = 0.092 kg; then the disc's pad sits where J / r^2 = 5.632 kg, at r = 51.15
mm. What is not printed and follows from this choice: the elastic frequencies. Springs and exciter belong to
the case, not to the body.
"""

import gmsh
import numpy as np

from microslip.cad import checked, name_body, name_face, run, surfaces_where
from microslip.errors import UserError

DEFAULTS = {  # mm
    "contact_radius": 400.0,  # axis to the centre of contact_tip
    "friction_radius": 51.15,  # axis to the centre of contact_disc
    "arm_thickness": 8.0,  # along x
    "arm_width": 10.4,  # along y
    "hub_diameter": 40.0,
    "hub_width": 16.0,
    "shaft_diameter": 16.0,
    "shaft_length": 20.0,  # of each of the two stubs
    "pad_size": 6.0,  # the contacts are squares
    "pad_height": 3.0,
}


def draw(parameters: dict, mesh: dict) -> None:
    p = settled(parameters)
    body = gmsh.model.occ.fuse([hub(p)], [arm(p), *shaft(p), *pads(p)])[0]
    gmsh.model.occ.fragment(body, axis_lines(p))
    gmsh.model.occ.synchronize()
    name_surfaces(p)
    gmsh.model.addPhysicalGroup(1, lines_on_axis(p), name="hinge_axis")
    name_body()


def settled(parameters: dict) -> dict:
    """All parameters, checked against each other."""
    p = checked(parameters, DEFAULTS)
    room = p["contact_radius"] - 1.5 * p["pad_size"]
    limits = [
        ("arm_width", p["hub_width"], "hub_width"),
        ("arm_thickness", p["hub_diameter"], "hub_diameter"),
        ("shaft_diameter", p["hub_diameter"], "hub_diameter"),
        ("pad_size", min(p["arm_width"], p["arm_thickness"]), "the arm"),
        ("hub_diameter", 2 * room, "the place left by contact_radius"),
        ("friction_radius", room, "contact_radius and half the pads"),
    ]
    for name, limit, what in limits:
        if p[name] >= limit:
            raise UserError(f"geometry.parameters.{name} = {p[name]} must stay below {limit:g} ({what})")
    least = (p["hub_diameter"] + p["pad_size"]) / 2
    if p["friction_radius"] <= least:
        value = p["friction_radius"]
        raise UserError(f"geometry.parameters.friction_radius = {value} must exceed {least:g} (the hub)")
    return p


def hub(p: dict) -> tuple[int, int]:
    w = p["hub_width"]
    return 3, gmsh.model.occ.addCylinder(0, -w / 2, 0, 0, w, 0, p["hub_diameter"] / 2)


def arm(p: dict) -> tuple[int, int]:
    """From the axis to one pad beyond the contact."""
    t, w = p["arm_thickness"], p["arm_width"]
    return 3, gmsh.model.occ.addBox(-t / 2, -w / 2, 0, t, w, p["contact_radius"] + p["pad_size"])


def shaft(p: dict) -> list[tuple[int, int]]:
    """The two stubs."""
    start, length, radius = p["hub_width"] / 2, p["shaft_length"], p["shaft_diameter"] / 2
    add = gmsh.model.occ.addCylinder
    return [(3, add(0, side * start, 0, 0, side * length, 0, radius)) for side in (-1, 1)]


def pads(p: dict) -> list[tuple[int, int]]:
    """Two square pads, one on the arm's side +x, one on its side -y."""
    a, h, box = p["pad_size"], p["pad_height"], gmsh.model.occ.addBox
    tip = box(p["arm_thickness"] / 2, -a / 2, p["contact_radius"] - a / 2, h, a, a)
    disc = box(-a / 2, -p["arm_width"] / 2 - h, p["friction_radius"] - a / 2, a, h, a)
    return [(3, tip), (3, disc)]


def axis_lines(p: dict) -> list[tuple[int, int]]:
    """The centre lines of the stubs; they become lines of nodes inside the body."""
    start, end = p["hub_width"] / 2, p["hub_width"] / 2 + p["shaft_length"]
    point, line = gmsh.model.occ.addPoint, gmsh.model.occ.addLine
    return [(1, line(point(0, side * start, 0), point(0, side * end, 0))) for side in (-1, 1)]


def lines_on_axis(p: dict) -> list[int]:
    near = 1e-4 * p["pad_size"]
    lines = [tag for _, tag in gmsh.model.getEntities(1)]
    boxes = [np.reshape(gmsh.model.getBoundingBox(1, tag), (2, 3)) for tag in lines]
    return [tag for tag, box in zip(lines, boxes, strict=True) if np.abs(box[:, [0, 2]]).max() < near]


def name_surfaces(p: dict) -> None:
    """The two contacts and the bearing."""
    near = 1e-4 * p["pad_size"]
    tip = p["arm_thickness"] / 2 + p["pad_height"]
    disc = -p["arm_width"] / 2 - p["pad_height"]
    stub = p["hub_width"] / 2 + p["shaft_length"] / 2
    reach = p["shaft_diameter"] / 2 + near

    def is_pad(axis: int, value: float, radius: float):
        place = np.array([0.0, 0.0, radius])
        place[axis] = value
        return lambda centre, box: np.linalg.norm(centre - place) < near and np.ptp(box[:, axis]) < near

    def is_bearing(centre: np.ndarray, box: np.ndarray) -> bool:
        return abs(abs(centre[1]) - stub) < near and np.abs(box[:, [0, 2]]).max() < reach

    name_face("contact_tip", surfaces_where(is_pad(0, tip, p["contact_radius"])))
    name_face("contact_disc", surfaces_where(is_pad(1, disc, p["friction_radius"])))
    name_face("bearing", surfaces_where(is_bearing))


if __name__ == "__main__":
    run(draw)
