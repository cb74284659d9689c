"""A neighbour of the blade in the three-body rig of Sextro section 5.3: a stocky steel block, almost rigid.

Axes are the blade's (geometry/blade): x through its thickness, y along its chord, z radial. The block's pad lies on the
blade's contact face: contact_right for side "right", contact_left for side "left"; the block is clamped at its far
face. Arrangement 1: the blade's contacts are the ends of its plate, normal x; arrangement 2: its sides, normal y.

The book prints nothing about the neighbours, but its three coupled frequencies need them rigid: two more free blades
would move with the first at 14 Hz. Chosen: a block whose first eigenfrequency lies ten times above the 700 Hz that
the rig was driven to, with a pad as large as the contact (72 x 5 mm or 20 x 5 mm) and no larger.
"""

from typing import Any

import gmsh
import numpy as np

from microslip.cad import checked, name_body, name_face, run, surfaces_where
from microslip.errors import UserError

DEFAULTS = {  # mm
    "arrangement": 1,
    "side": "right",
    "contact_distance": 44.0,  # from the blade's axis to its contact face: half its plate
    "contact_radius": 477.5,  # z of the contact's middle
    "contact_width": 72.0,  # tangential, horizontal
    "contact_height": 5.0,  # radial
    "pad_height": 3.0,  # by which the pad stands out of the block
    "depth": 60.0,  # of the block, from the pad to the clamp
    "width": 100.0,
    "height": 60.0,
}
ARRANGEMENT_2 = {"contact_distance": 38.5, "contact_width": 20.0}
CHOICES: dict[str, tuple[Any, ...]] = {"arrangement": (1, 2), "side": ("right", "left")}


def draw(parameters: dict[str, Any], mesh: dict[str, Any]) -> None:
    p = settled(parameters)
    start, out = p["contact_distance"], p["pad_height"]
    pad = box(p, start, out, p["contact_width"], p["contact_height"])
    block = box(p, start + out, p["depth"], p["width"], p["height"])
    gmsh.option.setNumber("Geometry.OCCUnionUnify", 0)
    gmsh.model.occ.fuse([pad], [block])
    gmsh.model.occ.synchronize()
    name_face("contact", flat_at(p, start))
    name_face("clamp", flat_at(p, start + out + p["depth"]))
    name_body()


def settled(parameters: dict[str, Any]) -> dict[str, Any]:
    """All parameters, checked against each other."""
    for name, choices in CHOICES.items():
        if parameters.get(name, choices[0]) not in choices:
            known = " or ".join(repr(c) for c in choices)
            raise UserError(f"geometry.parameters.{name} = {parameters[name]!r} must be {known}")
    p = checked(parameters, {**DEFAULTS, **(ARRANGEMENT_2 if parameters.get("arrangement") == 2 else {})})
    for name, limit in (("contact_width", "width"), ("contact_height", "height")):
        if p[name] >= p[limit]:
            raise UserError(f"geometry.parameters.{name} = {p[name]} must stay below {limit} = {p[limit]}")
    return p


def outwards(p: dict[str, Any]) -> tuple[int, int]:
    """Axis (0: x, 1: y) and sign of the direction from the blade to the clamp."""
    return p["arrangement"] - 1, 1 if p["side"] == "right" else -1


def box(p: dict[str, Any], start: float, length: float, width: float, height: float) -> tuple[int, int]:
    """A box that begins at `start` from the blade's axis and is `length` long, in the middle of the contact."""
    axis, sign = outwards(p)
    size = np.full(3, width)
    size[[axis, 2]] = length, height
    low = -size / 2
    low[axis] = min(sign * start, sign * (start + length))
    low[2] += p["contact_radius"]
    return 3, gmsh.model.occ.addBox(*low, *size)


def flat_at(p: dict[str, Any], distance: float) -> list[int]:
    """Surfaces across the outward direction at a distance from the blade's axis."""
    axis, sign = outwards(p)
    near = 1e-6 * (p["contact_distance"] + p["depth"])
    return surfaces_where(lambda _, box: bool((np.abs(box[:, axis] - sign * distance) < near).all()))


if __name__ == "__main__":
    run(draw)
