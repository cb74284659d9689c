"""The test blade of Sextro ch. 5.3: a rectangular blade with a shroud plate on its tip.

Axes: x circumferential (through the blade's thickness), y chord, z radial; clamped at z = 0, plate on top.
Arrangement 1: contacts on the plate's ends at x = +-plate_circumferential / 2; bending is normal to them.
Arrangement 2: contacts on the plate's faces at y = +-plate_chord / 2; bending is tangential to them.
"""

import gmsh
import numpy as np
from microslip.cad import checked, name_body, name_face, run, surfaces_where
from microslip.data import UserError

DEFAULTS = {  # mm
    "arrangement": 1,
    "blade_length": 475.0,
    "chord": 77.0,
    "thickness": 5.0,
    "plate_circumferential": 88.0,
    "plate_chord": 77.0,
    "plate_thickness": 5.0,
    "contact_width": 72.0,  # tangential, horizontal
    "contact_height": 5.0,  # radial
}
ARRANGEMENT_2 = {"contact_width": 20.0}


def draw(parameters: dict, mesh: dict) -> None:
    p = settled(parameters)
    size = mesh.get("size", 6.0)
    base = section(p, size)
    extrude_blade_and_plate(p, base, size)
    name_surfaces(p)
    name_body()


def settled(parameters: dict) -> dict:
    """All parameters, checked against each other."""
    arrangement = parameters.get("arrangement", 1)
    if arrangement not in (1, 2):
        raise UserError(f"geometry.parameters.arrangement = {arrangement!r} must be 1 or 2")
    p = checked(parameters, {**DEFAULTS, **(ARRANGEMENT_2 if arrangement == 2 else {})})
    room = p["plate_chord"] if arrangement == 1 else p["plate_circumferential"]
    limits = [
        ("contact_width", room, "the plate's side"),
        ("contact_height", p["plate_thickness"], "plate_thickness"),
        ("chord", p["plate_chord"], "plate_chord"),
        ("thickness", p["plate_circumferential"], "plate_circumferential"),
    ]
    for name, limit, what in limits:
        if p[name] > limit:
            raise UserError(f"geometry.parameters.{name} = {p[name]} must not exceed {what} = {limit}")
    return p


def section(p: dict, size: float) -> list[int]:
    """The plate's rectangle at z = blade_length, cut along blade and contacts; structured mesh."""
    x, y = [p["thickness"], p["plate_circumferential"]], [p["chord"], p["plate_chord"]]
    (y if p["arrangement"] == 1 else x).append(p["contact_width"])
    x, y = both_signs(x), both_signs(y)
    tiles = [
        (2, gmsh.model.occ.addRectangle(x0, y0, p["blade_length"], x1 - x0, y1 - y0))
        for x0, x1 in zip(x, x[1:], strict=False)
        for y0, y1 in zip(y, y[1:], strict=False)
    ]
    tags = [tag for _, tag in gmsh.model.occ.fragment(tiles, [])[0]]
    gmsh.model.occ.synchronize()
    for _, curve in gmsh.model.getEntities(1):
        gmsh.model.mesh.setTransfiniteCurve(curve, 1 + count(gmsh.model.occ.getMass(1, curve), size))
    for tag in tags:
        gmsh.model.mesh.setTransfiniteSurface(tag, "Alternate")
    return tags


def both_signs(widths: list[float]) -> list[float]:
    return sorted({s * w / 2 for w in widths for s in (-1, 1)})


def count(length: float, size: float) -> int:
    """Elements along a length."""
    return max(1, int(np.ceil(length / size - 1e-6)))


def extrude_blade_and_plate(p: dict, base: list[int], size: float) -> None:
    """The plate upwards (in three steps where the contact is lower), the blade down to the clamp."""
    rim = (p["plate_thickness"] - p["contact_height"]) / 2
    tiles = [(2, tag) for tag in base]
    blade = [t for t in tiles if inside_blade(p, np.array(gmsh.model.occ.getCenterOfMass(*t)))]
    step(blade, -p["blade_length"], size)
    for height in (rim, p["contact_height"], rim):
        if height > 1e-9 * p["plate_thickness"]:
            tiles = step(tiles, height, size)
    gmsh.model.occ.synchronize()


def inside_blade(p: dict, centre: np.ndarray) -> bool:
    return bool(abs(centre[0]) < p["thickness"] / 2 and abs(centre[1]) < p["chord"] / 2)


def step(tiles: list[tuple[int, int]], height: float, size: float) -> list[tuple[int, int]]:
    """Extrude in layers; returns the surfaces at the far end."""
    made = gmsh.model.occ.extrude(tiles, 0, 0, height, numElements=[count(abs(height), size)])
    return [made[i - 1] for i, (dim, _) in enumerate(made) if dim == 3]


def name_surfaces(p: dict) -> None:
    """Clamp, the two big blade faces, the plate's top, the two contacts."""
    low = p["blade_length"]
    middle, top = low + p["plate_thickness"] / 2, low + p["plate_thickness"]
    near = 1e-6 * top
    across, along = (0, 1) if p["arrangement"] == 1 else (1, 0)
    reach = p["plate_circumferential" if p["arrangement"] == 1 else "plate_chord"] / 2
    half = np.array([p["contact_width"], p["contact_height"]]) / 2 + near

    def plane(axis: int, value: float):
        return lambda centre, box: np.ptp(box[:, axis]) < near and abs(centre[axis] - value) < near

    def side(x: float):
        return lambda centre, box: plane(0, x)(centre, box) and centre[2] < low

    def contact(value: float):
        def holds(centre, box):
            offset = np.abs(box[:, [along, 2]] - [0, middle])
            return plane(across, value)(centre, box) and bool((offset <= half).all())

        return holds

    name_face("clamp", surfaces_where(plane(2, 0.0)))
    name_face("plate_top", surfaces_where(plane(2, top)))
    name_face("pressure_side", surfaces_where(side(p["thickness"] / 2)))
    name_face("suction_side", surfaces_where(side(-p["thickness"] / 2)))
    name_face("contact_right", surfaces_where(contact(reach)))
    name_face("contact_left", surfaces_where(contact(-reach)))


if __name__ == "__main__":
    run(draw)
