"""A railway wheel, held at its bore, with a patch on its tread where it touches the rail (geometry/rail).

Axes: the axle is y through the origin, x points along rolling, z up; the patch lies about the lowest line of the tread,
at y = 0. Faces: bore, patch. The section is a hub, a plane web, a rim without flange and a cylindrical tread: the
profiles belong to the case, the body to what yields behind them.
"""

import gmsh
import numpy as np

from microslip.cad import checked, name_body, name_face, run, surfaces_where
from microslip.errors import UserError

DEFAULTS = {  # mm
    "radius": 460.0,
    "bore_radius": 95.0,
    "hub_radius": 140.0,
    "hub_width": 170.0,
    "web_thickness": 25.0,
    "rim_thickness": 60.0,
    "rim_width": 130.0,
    "patch_length": 30.0,  # along rolling
    "patch_width": 26.0,
}


def draw(parameters: dict, mesh: dict) -> None:
    p = settled(parameters)
    add = gmsh.model.occ
    wheel = whole(p)
    sides = p["patch_length"], p["patch_width"], p["rim_thickness"] / 2
    block = add.addBox(-sides[0] / 2, -sides[1] / 2, -p["radius"] - sides[2], *sides[:2], 2 * sides[2])
    under = add.intersect([(3, block)], [wheel], removeTool=False)[0]
    add.fragment([wheel], under)
    gmsh.model.occ.synchronize()
    name_surfaces(p)
    name_body()


def settled(parameters: dict) -> dict:
    """All parameters, checked against each other."""
    p = checked(parameters, DEFAULTS)
    rising = [
        ("bore_radius", p["hub_radius"], "hub_radius"),
        ("hub_radius", p["radius"] - p["rim_thickness"], "radius less rim_thickness"),
        ("web_thickness", min(p["hub_width"], p["rim_width"]), "the widths of hub and rim"),
        ("patch_width", p["rim_width"], "rim_width"),
        ("patch_length", p["radius"], "radius"),
    ]
    for name, limit, what in rising:
        if p[name] >= limit:
            raise UserError(f"geometry.parameters.{name} = {p[name]} must stay below {limit:g} ({what})")
    return p


def section(p: dict) -> list[tuple[float, float]]:
    """(radius, y) of the corners."""
    hub, web, rim = (p[k] / 2 for k in ("hub_width", "web_thickness", "rim_width"))
    inner, outer = p["radius"] - p["rim_thickness"], p["radius"]
    half = [(p["bore_radius"], hub), (p["hub_radius"], hub), (p["hub_radius"], web), (inner, web), (inner, rim),
            (outer, rim)]  # fmt: skip
    return half + [(r, -y) for r, y in half[::-1]]


def whole(p: dict) -> tuple[int, int]:
    """The section turned about the axle; it begins at the top."""
    add = gmsh.model.occ
    points = [add.addPoint(0, y, r) for r, y in section(p)]
    lines = [add.addLine(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    flat = add.addPlaneSurface([add.addCurveLoop(lines)])
    return next(e for e in add.revolve([(2, flat)], 0, 0, 0, 0, 1, 0, 2 * np.pi) if e[0] == 3)


def name_surfaces(p: dict) -> None:
    near = 1e-3 * p["patch_width"]
    low, bore = 0.99 * p["radius"], p["bore_radius"] + near
    patch, hub = p["patch_width"] / 2 + near, p["hub_width"] / 2
    name_face("bore", surfaces_where(lambda _, box: bool(
        np.abs(box[:, [0, 2]]).max() < bore and np.ptp(box[:, 1]) > hub
    )))  # fmt: skip
    name_face("patch", surfaces_where(lambda c, box: bool(c[2] < -low and np.abs(box[:, 1]).max() < patch)))


if __name__ == "__main__":
    run(draw)
