"""A piece of rail, held at its foot, with a patch on its head where the wheel touches it (geometry/wheel).

Axes: x along the rail, z up from the top of the head, the patch about the origin. Faces: foot, patch. The section has
corners and a flat top, the height and the widths of a 60E1: the profiles belong to the case, the body to what yields
behind them. The foot is held all along: what the rail bends between sleepers belongs to the track.
"""

import gmsh
import numpy as np

from microslip.cad import checked, name_body, name_face, run, surfaces_where
from microslip.errors import UserError

DEFAULTS = {  # mm
    "length": 600.0,
    "height": 172.0,
    "head_width": 72.0,
    "head_height": 45.0,
    "web_thickness": 16.5,
    "foot_width": 150.0,
    "foot_height": 20.0,
    "patch_length": 30.0,
    "patch_width": 26.0,
}


def draw(parameters: dict, mesh: dict) -> None:
    p = settled(parameters)
    half, end = p["patch_length"] / 2, p["length"] / 2
    parts = [piece(p, a, b) for a, b in [(-half, half), (-end, -half), (half, end)]]
    gmsh.model.occ.fragment(parts[:1], parts[1:])
    gmsh.model.occ.synchronize()
    name_surfaces(p)
    name_body()


def settled(parameters: dict) -> dict:
    """All parameters, checked against each other."""
    p = checked(parameters, DEFAULTS)
    limits = [
        ("patch_length", p["length"], "length"),
        ("patch_width", p["head_width"], "head_width"),
        ("web_thickness", min(p["head_width"], p["foot_width"]), "the widths of head and foot"),
        ("head_height", p["height"] - p["foot_height"], "height less foot_height"),
    ]
    for name, limit, what in limits:
        if p[name] >= limit:
            raise UserError(f"geometry.parameters.{name} = {p[name]} must stay below {limit:g} ({what})")
    return p


def section(p: dict) -> list[tuple[float, float]]:
    """(y, z) of the corners; the top is cut where the patch ends."""
    head, web, foot, patch = (p[k] / 2 for k in ("head_width", "web_thickness", "foot_width", "patch_width"))
    neck, ankle, ground = -p["head_height"], p["foot_height"] - p["height"], -p["height"]
    half = [(patch, 0.0), (head, 0.0), (head, neck), (web, neck), (web, ankle), (foot, ankle), (foot, ground)]
    return half + [(-y, z) for y, z in half[::-1]]


def piece(p: dict, start: float, end: float) -> tuple[int, int]:
    """The rail from one x to another."""
    add = gmsh.model.occ
    points = [add.addPoint(start, y, z) for y, z in section(p)]
    lines = [add.addLine(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    flat = add.addPlaneSurface([add.addCurveLoop(lines)])
    return next(e for e in add.extrude([(2, flat)], end - start, 0, 0) if e[0] == 3)


def name_surfaces(p: dict) -> None:
    near = 1e-3 * p["patch_width"]
    half = np.array([p["patch_length"], p["patch_width"], 0.0]) / 2 + near
    name_face("foot", surfaces_where(lambda c, box: bool(np.abs(box[:, 2] + p["height"]).max() < near)))
    name_face("patch", surfaces_where(lambda c, box: bool((np.abs(box) < half).all())))


if __name__ == "__main__":
    run(draw)
