"""The test blade of Sextro ch. 5.3: a rectangular blade with a shroud plate on its tip.

Axes: x circumferential (through the blade's thickness), y chord, z radial; clamped at z = 0, plate on top.
Arrangement 1: contacts on the plate's ends at x = +-plate_circumferential / 2; bending is normal to them.
Arrangement 2: contacts on the plate's faces at y = +-plate_chord / 2; bending is tangential to them.
With damper_radius, a second pair of faces on the blade's two sides for a friction damper: damper_right, damper_left.

The book gives no dimensions. These were fitted to its printed 14.1, 159.55 and 540.61 Hz; blade_length is the
free blade below the plate, which adds plate_thickness on top (a blade of 475 mm with the plate in it has 14.34 Hz,
this one 14.06, 158.8 and 537.7 Hz on a fine mesh). A structured mesh with two elements through the thickness and
thin layers at clamp and plate: at the default size f1 to f3 lie 0.03, 0.09 and 0.15 % above the converged values.
"""

from collections.abc import Callable
from typing import Any

import gmsh
import numpy as np

from microslip.cad import checked, name_body, name_face, positive_size, run, surfaces_where
from microslip.errors import UserError

Tiles = list[tuple[int, int]]  # gmsh's (dimension, tag)

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
    "damper_radius": 0.0,  # z of the middle of the damper's faces; 0: none
    "damper_width": 20.0,  # along the chord
    "damper_height": 10.0,  # radial
}
ARRANGEMENT_2 = {"contact_width": 20.0}
SIZE = 8.0  # mm, default element size
THROUGH = 2  # elements through the blade's thickness, at least
MOST_ALONG = 5000  # elements along one edge
END_LAYERS = (0.3, 0.6, 0.9)  # heights of the layers next to clamp and plate, in thicknesses


def draw(parameters: dict[str, Any], mesh: dict[str, Any]) -> None:
    p = settled(parameters)
    if mesh.get("local"):
        raise UserError("mesh.local has no effect on the blade's structured mesh; change mesh.size")
    if mesh.get("size") is None:
        mesh["size"] = SIZE
    size = positive_size("mesh.size", mesh["size"])
    base = section(p, size)
    extrude_blade_and_plate(p, base, size)
    name_surfaces(p)
    name_body()


def settled(parameters: dict[str, Any]) -> dict[str, Any]:
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
    refuse_damper(p)
    return p


def refuse_damper(p: dict[str, Any]) -> None:
    """Refuse faces of a damper that do not lie on the blade, apart from its ends."""
    if not p["damper_radius"]:
        return
    ends = 2 * sum(END_LAYERS) * p["thickness"]
    low, high = (p["damper_height"] + ends) / 2, p["blade_length"] - (p["damper_height"] + ends) / 2
    if not low <= p["damper_radius"] <= high:
        raise UserError(
            f"geometry.parameters.damper_radius = {p['damper_radius']:g} must lie between {low:g} and {high:g}, or be 0"
        )
    if p["damper_width"] >= p["chord"]:
        raise UserError(f"geometry.parameters.damper_width = {p['damper_width']:g} must stay below chord")


def section(p: dict[str, Any], size: float) -> list[int]:
    """The plate's rectangle at z = blade_length, cut along blade and contacts; structured mesh."""
    x, y = [p["thickness"], p["plate_circumferential"]], [p["chord"], p["plate_chord"]]
    (y if p["arrangement"] == 1 else x).append(p["contact_width"])
    if p["damper_radius"]:
        y.append(p["damper_width"])
    x, y = both_signs(x), both_signs(y)
    tiles = [
        (2, gmsh.model.occ.addRectangle(x0, y0, p["blade_length"], x1 - x0, y1 - y0))
        for x0, x1 in zip(x, x[1:], strict=False)
        for y0, y1 in zip(y, y[1:], strict=False)
    ]
    tags = [tag for _, tag in gmsh.model.occ.fragment(tiles, [])[0]]
    gmsh.model.occ.synchronize()
    for _, curve in gmsh.model.getEntities(1):
        length = gmsh.model.occ.getMass(1, curve)
        least = THROUGH if abs(length - p["thickness"]) < 1e-6 * length else 1
        gmsh.model.mesh.setTransfiniteCurve(curve, 1 + max(least, count(length, size)))
    for tag in tags:
        gmsh.model.mesh.setTransfiniteSurface(tag, "Alternate")
    return tags


def both_signs(widths: list[float]) -> list[float]:
    return sorted({round(s * w / 2, 9) for w in widths for s in (-1, 1)})


def count(length: float, size: float) -> int:
    """Elements along a length."""
    if length > MOST_ALONG * size:
        many = f"{length / size:.1g} elements along {length:g}"
        raise UserError(f"mesh.size = {size:g} puts {many}; is it in length_unit?")
    return max(1, int(np.ceil(length / size - 1e-6)))


def extrude_blade_and_plate(p: dict[str, Any], base: list[int], size: float) -> None:
    """The plate upwards (in three steps where the contact is lower), the blade down to the clamp."""
    rim = (p["plate_thickness"] - p["contact_height"]) / 2
    tiles = [(2, tag) for tag in base]
    blade = [t for t in tiles if inside_blade(p, np.array(gmsh.model.occ.getCenterOfMass(*t)))]
    lower = blade
    for depth, layers in blade_steps(p, size):
        lower = step(lower, -depth, layers)
    for height in (rim, p["contact_height"], rim):
        if height > 1e-9 * p["plate_thickness"]:
            tiles = step(tiles, height, [height / (n := count(height, size))] * n)
    gmsh.model.occ.synchronize()


def inside_blade(p: dict[str, Any], centre: np.ndarray) -> bool:
    return bool(abs(centre[0]) < p["thickness"] / 2 and abs(centre[1]) < p["chord"] / 2)


def blade_layers(p: dict[str, Any], size: float) -> list[float]:
    """Heights of the element layers along the blade: thin where stress concentrates, at both ends."""
    ends = [fraction * p["thickness"] for fraction in END_LAYERS]
    middle = p["blade_length"] - 2 * sum(ends)
    if middle < size or max(ends) > size:
        ends, middle = [], p["blade_length"]
    layers = count(middle, size)
    return ends + [middle / layers] * layers + ends[::-1]


def blade_steps(p: dict[str, Any], size: float) -> list[tuple[float, list[float]]]:
    """(depth, element layers) of the steps from the plate down: one, or three with a damper's faces in the second."""
    layers = blade_layers(p, size)
    if not p["damper_radius"]:
        return [(p["blade_length"], layers)]
    top = p["blade_length"] - p["damper_radius"] - p["damper_height"] / 2
    depths = [top, p["damper_height"], p["blade_length"] - top - p["damper_height"]]
    ends = [fraction * p["thickness"] for fraction in END_LAYERS] if layers[0] < layers[len(layers) // 2] else []
    found = []
    for depth, first, last in zip(depths, (ends, [], []), ([], [], ends[::-1]), strict=True):
        middle = depth - sum(first) - sum(last)
        n = count(middle, size)
        found.append((depth, [*first, *[middle / n] * n, *last]))
    return found


def step(tiles: Tiles, height: float, layers: list[float]) -> Tiles:
    """Extrude by `height` in layers; returns the surfaces at the far end."""
    ends = np.cumsum(layers) / np.sum(layers)
    made = gmsh.model.occ.extrude(tiles, 0, 0, height, numElements=[1] * len(layers), heights=list(ends))
    return [made[i - 1] for i, (dim, _) in enumerate(made) if dim == 3]


Test = Callable[[np.ndarray, np.ndarray], bool]  # of centre (3,) and box (2, 3) of a surface


def name_surfaces(p: dict[str, Any]) -> None:
    """Clamp, the two big blade faces, the plate's top, the two contacts."""
    low, top = p["blade_length"], p["blade_length"] + p["plate_thickness"]
    near = 1e-6 * top
    name_face("clamp", surfaces_where(on_plane(2, 0.0, near)))
    name_face("plate_top", surfaces_where(on_plane(2, top, near)))
    for name, x in (("pressure_side", p["thickness"] / 2), ("suction_side", -p["thickness"] / 2)):
        side = on_plane(0, x, near)
        faces = [tag for tag in surfaces_where(side) if tag in surfaces_where(below(low))]
        name_face(name, faces)
        if p["damper_radius"]:
            half = np.array([0.0, p["damper_width"], p["damper_height"]]) / 2 + near
            middle = np.array([x, 0.0, p["damper_radius"]])
            patch = [tag for tag in surfaces_where(within(middle, half)) if tag in faces]
            name_face("damper_right" if x > 0 else "damper_left", patch)
    normal, reach = (0, p["plate_circumferential"]) if p["arrangement"] == 1 else (1, p["plate_chord"])
    middle = np.array([0.0, 0.0, (low + top) / 2])
    middle[normal] = reach / 2
    half = np.full(3, p["contact_width"] / 2)
    half[[normal, 2]] = 0.0, p["contact_height"] / 2
    name_face("contact_right", surfaces_where(within(middle, half + near)))
    middle[normal] *= -1
    name_face("contact_left", surfaces_where(within(middle, half + near)))


def on_plane(axis: int, value: float, near: float) -> Test:
    return lambda _, box: bool((np.abs(box[:, axis] - value) < near).all())


def below(height: float) -> Test:
    return lambda centre, _: bool(centre[2] < height)


def within(middle: np.ndarray, half: np.ndarray) -> Test:
    return lambda _, box: bool((np.abs(box - middle) <= half).all())


if __name__ == "__main__":
    run(draw)
