"""What is shown of a modal file in three dimensions: mesh and faces, contact frames, modes, stresses.

Every function takes a `Studio` and returns finished images; `pictures.draw_all` names and saves them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Array, Indices, Interface, ModalBasis, ModalGroup
from ..modal.stress import static_extremes, von_mises
from ..units import rpm_text
from .lettering import (
    INK,
    Colour,
    captioned,
    colour_bar,
    font,
    legend,
    length_text,
    nice,
    pen,
    scaled,
    sheet,
    side_by_side,
    stacked,
)
from .scene import (
    GREY,
    OUTLINE,
    Camera,
    Stage,
    Surface,
    axes_towards,
    face_triangles,
    fit,
    fit_tile,
    surface,
    triangle_normals,
    view_axes,
)

if TYPE_CHECKING:
    from .lettering import Picture
    from .ring_views import RingStudio

AREA = 420_000
"""Pixels of one picture of the body."""

AMPLITUDE = 0.08
"""Largest displacement of a drawn mode, in largest extents of the body."""

STEEPEST = 0.7
"""Largest change of displacement along an element side, over its length, in a drawn mode (a turn of 35 degrees)."""

NEARER = 0.002
"""Lines on the surface are drawn nearer to the viewer by this part of the extent, so that it does not hide them."""

ONE_MILLIMETRE = 1e-3
"""Largest displacement that stress modes are scaled to, m."""

FRAME_COLOURS = ((208, 48, 40), (36, 140, 60), (36, 88, 200))
"""n, t1, t2; also x, y, z of the body's axes."""

DISPLACEMENT_MAP, STRESS_MAP = "viridis", "turbo"


@dataclass(frozen=True)
class Studio:
    """A body in front of the camera. `extent`: its largest side, m; `axes`: see `Camera`."""

    basis: ModalBasis
    outside: Surface
    stage: Stage
    axes: Array
    extent: float

    @property
    def points(self) -> Array:
        """(v, 3) vertices of the undeformed outside."""
        return self.basis.mesh.points[self.outside.source]


def open_studio(basis: ModalBasis) -> Studio:
    """Extract the surface, choose the view, open the window."""
    extent = float(np.ptp(basis.mesh.points, axis=0).max())
    return Studio(basis, surface(basis.mesh), Stage(), view_axes(basis.inertia), extent)


def at_speed(group: ModalGroup) -> str:
    """`` at 1500 rpm``."""
    return f" at {rpm_text(group.speed)}"


def hertz(frequency: float) -> str:
    """A frequency with five digits."""
    return f"{frequency:#.5g}".rstrip(".") + " Hz" if frequency < 1e5 else f"{frequency:.0f} Hz"


def number(value: float) -> str:
    """Three digits, without a power of ten where it can be avoided."""
    return f"{value:.0f}" if 1000 <= value < 1e6 else f"{value:.3g}"


def mode_title(group: ModalGroup, mode: int) -> str:
    """``Mode 3: 159.24 Hz`` or ``Mode 3: rigid motion``."""
    if group.kind[mode] == "rigid":
        return f"Mode {mode + 1}: rigid motion"
    return f"Mode {mode + 1}: {hertz(group.frequency[mode])}"


def _map(name: str) -> Array:
    import matplotlib

    return (matplotlib.colormaps[name](np.linspace(0, 1, 64))[:, :3] * 255).astype(np.uint8)


# --- mesh, faces, frames -------------------------------------------------------------------------------------------


def mesh_picture(studio: Studio) -> Picture:
    """The mesh from two sides with its named faces in colours."""
    basis, outside = studio.basis, studio.outside
    names, colours = _face_colours(basis.mesh.faces)
    areas = {name: _area(studio, name) for name in names}
    paint = np.tile(np.array(GREY, dtype=np.uint8), (len(outside.triangles), 1))
    bare = np.ones(len(outside.triangles), dtype=bool)
    for name in sorted(names, key=lambda n: -areas[n]):
        here = face_triangles(outside, basis.mesh, name)
        paint[here], bare[here] = colours[name], False
    unnamed = [(GREY, "no name")] if bare.any() else []
    views = []
    for axes in (studio.axes, axes_towards(-studio.axes[2])):
        camera = fit(basis.mesh.points, axes, AREA)
        studio.stage.clear()
        studio.stage.skin(studio.points, outside.triangles, scalars=paint, rgb=True)
        nearer = basis.mesh.points + NEARER * studio.extent * axes[2]
        studio.stage.lines(nearer, outside.sides, (60, 64, 74), 1.0, opacity=0.5)
        studio.stage.lines(nearer, outside.outline, (20, 22, 28), 2.0)
        views.append(_measured(studio.stage.shoot(camera), camera))
    both = side_by_side(views)
    entries = [(colours[n], n) for n in names] + unnamed
    cells = ", ".join(f"{len(c)} {kind}" for kind, c in basis.mesh.cells.items())
    title = f"{basis.name}: mesh and named faces"
    note = f"{basis.mesh.n_points} points, {cells}. Seen from two opposite sides."
    return captioned(stacked([both, legend(entries, both.width)]), title, note, 22)


def _face_colours(names: Any) -> tuple[list[str], dict[str, Colour]]:
    import matplotlib

    twenty = matplotlib.colormaps["tab20"](range(20))[:, :3]
    table = [twenty[i] for i in (0, 2, 4, 6, 8, 16, 18, 12, 1, 3, 5, 7, 9, 17, 19, 13, 10, 11)]  # no grey: the body's
    ordered = sorted(names, key=_natural)
    return ordered, {n: tuple(round(255 * v) for v in table[i % len(table)]) for i, n in enumerate(ordered)}  # type: ignore[misc]


def _natural(name: str) -> list[Any]:
    import re

    return [(0, int(part), "") if part.isdigit() else (1, 0, part) for part in re.split(r"(\d+)", name) if part]


def _area(studio: Studio, name: str) -> float:
    chosen = face_triangles(studio.outside, studio.basis.mesh, name)
    return 0.5 * float(np.linalg.norm(triangle_normals(studio.points, studio.outside.triangles[chosen]), axis=1).sum())


def _area_text(area: float) -> str:
    """An area, m2, in the unit that suits it."""
    scale, name = (1e6, "mm²") if area < 0.1 else (1e4, "cm²")
    return f"{area * scale:.0f} {name}" if area * scale >= 100 else f"{area * scale:.3g} {name}"


def _measured(image: Picture, camera: Camera) -> Picture:
    """Add a scale bar and the body's axes in a strip below the picture."""
    from PIL import Image

    strip = 64
    out = Image.new("RGB", (image.width, image.height + strip), "white")
    out.paste(image, (0, 0))
    draw, face = pen(out), font(14)
    metres = nice(0.3 * camera.metres_per_pixel * image.width)
    pixels = metres / camera.metres_per_pixel
    x, y = 16, image.height + strip - 16
    draw.line((x, y, x + pixels, y), INK, 3)
    for end in (x, x + pixels):
        draw.line((end, y - 5, end, y + 5), INK, 2)
    draw.text((x + pixels / 2, y - 8), length_text(metres), INK, face, anchor="mb")
    middle = np.array([image.width - 48, image.height + strip / 2 + 4])
    for axis in np.argsort(camera.axes[2]):  # the axis that points at the viewer last
        tip = middle + 25 * camera.axes[:2, axis] * np.array([1, -1])
        draw.line((*middle, *tip), FRAME_COLOURS[axis], 3)
        text = middle + 36 * camera.axes[:2, axis] * np.array([1, -1])
        draw.text(tuple(text), "xyz"[axis], FRAME_COLOURS[axis], face, anchor="mm")
    return out


def interface_picture(studio: Studio, most: int = 12) -> Picture | None:
    """Where the contact patches lie, and each with its points and its frame n, t1, t2 (None without contacts)."""
    every = studio.basis.groups[min(studio.basis.groups)].interfaces
    interfaces = {name: item for name, item in every.items() if item.role != "load"}
    if not interfaces:
        return None
    names = list(interfaces)
    shown = names[:most]
    over = _overview(studio, interfaces)
    size = (330, 300) if len(shown) > 2 else (430, 380)
    tiles = [_patch_tile(studio, name, interfaces[name], size) for name in shown]
    keys = [
        (FRAME_COLOURS[0], "n outward normal"),
        (FRAME_COLOURS[1], "t1"),
        (FRAME_COLOURS[2], "t2"),
        (_DOT, "patch points"),
    ]
    title = f"{studio.basis.name}: interfaces and their frames"
    left_out = f" {len(names) - most} more interfaces are not shown." if len(names) > most else ""
    if over.width > 1.3 * over.height:
        both = stacked([over, sheet(tiles, "", shape=2.4)])
    else:
        both = side_by_side([over, sheet(tiles, "", shape=1.2 if len(tiles) > 2 else 0.6)])
    return captioned(stacked([both, legend(keys, both.width)]), title, left_out.strip(), 22)


_DOT = (240, 150, 20)


def _overview(studio: Studio, interfaces: Any) -> Picture:
    mesh = studio.basis.mesh
    tips = [item.origin + 0.1 * studio.extent * item.rotation for item in interfaces.values()]
    camera = fit(np.vstack([mesh.points, *tips]), studio.axes, AREA * 0.8)
    stage = studio.stage
    stage.clear()
    stage.skin(studio.points, studio.outside.triangles, color=GREY, opacity=0.55)
    stage.lines(mesh.points + NEARER * studio.extent * camera.axes[2], studio.outside.outline, OUTLINE, 1.5)
    for item in interfaces.values():
        stage.dots(item.points, _DOT, 4.0)
        for axis, colour in zip(item.rotation, FRAME_COLOURS, strict=True):
            stage.arrow(item.origin, axis, 0.09 * studio.extent, colour)
    return _with_names(_measured(stage.shoot(camera), camera), camera, interfaces)


def _with_names(image: Picture, camera: Camera, interfaces: Any) -> Picture:
    """Write each interface's name beside its origin, moved down or up until no two names overlap."""
    draw, face = pen(image), font(15, True)
    taken: list[tuple[float, float, float, float]] = []
    for name, item in interfaces.items():
        x, y = camera.project(item.origin)[0]
        width = face.getlength(name)
        x = float(np.clip(x + 8, 2, image.width - width - 4))
        for shift in sorted(range(-400, 401, 6), key=abs):
            box = (x - 3, y + shift - 9, x + width + 3, y + shift + 9)
            inside = box[1] > 0 and box[3] < image.height
            if inside and not any(a[0] < box[2] and box[0] < a[2] and a[1] < box[3] and box[1] < a[3] for a in taken):
                break
        taken.append(box)
        draw.text((x, (box[1] + box[3]) / 2), name, INK, face, anchor="lm", stroke_width=3, stroke_fill="white")
    return image


def _patch_tile(studio: Studio, name: str, item: Interface, size: tuple[int, int]) -> Picture:
    mesh, stage = studio.basis.mesh, studio.stage
    around = item.points - item.origin
    reach = float(np.sqrt((around**2).sum(axis=1).max()))
    arm = 0.75 * reach
    n, t1, t2 = item.rotation
    axes = axes_towards(0.78 * n + 0.45 * t1 + 0.44 * t2, t2 if abs(n[2]) > 0.7 else None)
    frame = np.vstack([item.points, item.origin, item.origin + 1.25 * arm * item.rotation])
    camera = fit_tile(frame, axes, size, 0.1)
    stage.clear()
    cut = covered(studio.points, studio.outside.triangles, item.points, axes)
    limit = item.origin @ n + 0.1 * reach if cut else np.inf  # what stands in front of a hidden patch is cut away
    behind = studio.points @ n < limit
    stage.skin(studio.points, studio.outside.triangles[behind[studio.outside.triangles].any(axis=1)], color=GREY)
    nearer, seen = 0.02 * reach * axes[2], mesh.points @ n < limit
    sides, outline = (s[seen[s].any(axis=1)] for s in (studio.outside.sides, studio.outside.outline))
    stage.lines(mesh.points + nearer, sides, (120, 124, 134), 1.0, opacity=0.6)
    stage.lines(mesh.points + nearer, outline, (40, 44, 52), 2.0)
    stage.dots(item.points + 2 * nearer, _DOT, 5.0 if len(item.points) < 200 else 3.5)
    for axis, colour in zip(item.rotation, FRAME_COLOURS, strict=True):
        stage.arrow(item.origin + 6 * nearer, axis, arm, colour)
    image = stage.shoot(camera)
    draw, face = pen(image), font(16, True)
    for axis, text, colour in zip(item.rotation, ("n", "t1", "t2"), FRAME_COLOURS, strict=True):
        at = camera.project(item.origin + 1.12 * arm * axis)[0]
        draw.text(tuple(at), text, colour, face, anchor="mm", stroke_width=3, stroke_fill="white")
    role = item.role + (f", faces {item.partner}" if item.partner else "")
    note = f"{role}; {len(item.areas)} points, {_area_text(item.area)}"
    draw.rectangle((0, 0, image.width - 1, image.height - 1), outline=(190, 194, 202))
    return captioned(image, name, note, 18)


def covered(points: Array, triangles: Indices, patch: Array, axes: Array) -> bool:
    """Whether some triangle stands between the viewer and most points of a patch.

    Args:
        points: (n, 3). triangles: (t, 3). patch: (p, 3). axes: (3, 3) right, up, towards the viewer.
    """
    corners, at = points[triangles] @ axes.T, patch @ axes.T
    apart = 1e-3 * float(np.ptp(points, axis=0).max())
    a, b, c = (corners[:, i, :2] for i in range(3))
    twice = _cross(b - a, c - a)
    flat = np.abs(twice) <= 1e-12 * float(np.abs(twice).max())
    hidden = 0
    for x in at:
        weights = np.stack([_cross(b - x[:2], c - x[:2]), _cross(c - x[:2], a - x[:2])]) / np.where(flat, 1.0, twice)
        inside = (weights >= 0).all(axis=0) & (weights.sum(axis=0) <= 1) & ~flat
        depth = corners[:, 2, 2] + weights[0] * (corners[:, 0, 2] - corners[:, 2, 2])
        depth = depth + weights[1] * (corners[:, 1, 2] - corners[:, 2, 2])
        hidden += bool((inside & (depth > x[2] + apart)).any())
    return 2 * hidden > len(at)


def _cross(a: Array, b: Array) -> Array:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


# --- modes ---------------------------------------------------------------------------------------------------------


def mode_scale(studio: Studio | RingStudio, shape: Array, amplitude: float = AMPLITUDE) -> float:
    """Factor that gives a shape (n, 3) the drawn amplitude, or less where element sides would turn too far."""
    a, b = studio.outside.sides.T
    points = studio.basis.mesh.points
    turn = np.linalg.norm(shape[a] - shape[b], axis=1) / np.linalg.norm(points[a] - points[b], axis=1)
    largest = float(np.linalg.norm(shape, axis=1).max())
    steepest = float(np.quantile(turn, 0.98))
    return min(amplitude * studio.extent / max(largest, 1e-300), STEEPEST / max(steepest, 1e-300))


def mode_camera(studio: Studio, groups: Sequence[ModalGroup], count: int, area: float = AREA) -> Camera:
    """One camera in which all modes fit, whichever way they swing."""
    still = studio.points @ studio.axes.T
    corners = [still.min(axis=0), still.max(axis=0)]
    for group in groups:
        for j in range(min(count, group.n_modes)):
            moved = np.abs(
                mode_scale(studio, group.phi[:, :, j]) * group.phi[studio.outside.source, :, j] @ studio.axes.T
            )
            corners += [(still - moved).min(axis=0), (still + moved).max(axis=0)]
    return fit(np.array(corners) @ studio.axes, studio.axes, area)


def mode_pictures(studio: Studio, group: ModalGroup, count: int, camera: Camera) -> Iterator[Picture]:
    """Each of the first `count` modes, deformed, over the outline of the body at rest. Not captioned."""
    data = _deformable(studio, DISPLACEMENT_MAP, (0.0, 1.0))
    for j in range(min(count, group.n_modes)):
        _deform(studio, data, group, j, 1.0)
        yield studio.stage.shoot(camera)


def _deformable(studio: Studio, colours: str, limits: tuple[float, float]) -> Any:
    studio.stage.clear()
    studio.stage.lines(studio.basis.mesh.points, studio.outside.outline, (150, 154, 164), 1.5)
    return studio.stage.skin(
        studio.points, studio.outside.triangles, np.zeros(len(studio.points)), cmap=colours, clim=limits
    )


def _deform(studio: Studio, data: Any, group: ModalGroup, mode: int, phase: float) -> None:
    shape = group.phi[:, :, mode]
    moved = mode_scale(studio, shape) * shape[studio.outside.source]
    size = np.linalg.norm(moved, axis=1)
    value = size / max(size.max(), 1e-300)
    studio.stage.reshape(data, studio.outside.triangles, studio.points + phase * moved, value)


def mode_caption(studio: Studio, image: Picture, group: ModalGroup, mode: int) -> Picture:
    """The picture with number, frequency, speed and nodal diameter."""
    state = at_speed(group) + of_nodal_diameter(studio, group)
    return captioned(image, mode_title(group, mode) + state, "amplified; grey lines: at rest", 20)


def of_nodal_diameter(studio: Studio, group: ModalGroup) -> str:
    """Which nodal diameter a sector is shown at; nothing for a body without cyclic symmetry."""
    return f", nodal diameter {group.harmonic}" if studio.basis.sectors > 1 else ""


def contact_sheet(studio: Studio, group: ModalGroup, images: Sequence[Picture]) -> Picture:
    """All modes of one speed on one sheet."""
    factor = np.sqrt(2.4e6 / len(images) / (images[0].width * images[0].height))
    tiles = [
        captioned(scaled(image, min(factor, 1.0)), mode_title(group, j), size=17) for j, image in enumerate(images)
    ]
    left = f" The other {group.n_modes - len(images)} modes are not drawn." if group.n_modes > len(images) else ""
    page = sheet(tiles, f"{studio.basis.name}: modes{at_speed(group)}", f"Amplified; grey lines: at rest.{left}")
    return stacked([page, colour_bar(_map(DISPLACEMENT_MAP), "0", "1", "displacement over its largest value", 700)], 4)


def animation(studio: Studio, group: ModalGroup, mode: int, camera: Camera, steps: int = 11) -> list[Picture]:
    """Frames of one full swing of a mode."""
    data = _deformable(studio, DISPLACEMENT_MAP, (0.0, 1.0))
    title = mode_title(group, mode) + at_speed(group) + of_nodal_diameter(studio, group)
    half = []
    for phase in np.sin(np.linspace(-np.pi / 2, np.pi / 2, steps)):
        _deform(studio, data, group, mode, float(phase))
        half.append(captioned(studio.stage.shoot(camera), title, size=16))
    return half + half[-2:0:-1]


# --- stresses ------------------------------------------------------------------------------------------------------


def stress_sheet(studio: Studio, group: ModalGroup, count: int, camera: Camera) -> Picture | None:
    """Equivalent stress of the first elastic modes at 1 mm largest displacement (None without nodal stresses)."""
    stress = group.stresses.get("nodes")
    chosen = [j for j in range(group.n_modes) if group.kind[j] != "rigid"][:count]
    known = stress is not None and len(stress.points) == len(group.phi) == studio.basis.mesh.n_points
    if stress is None or not known or not chosen:
        return None
    tiles = []
    for j in chosen:
        factor = ONE_MILLIMETRE / np.linalg.norm(group.phi[:, :, j], axis=1).max()
        shape = mode_scale(studio, group.phi[:, :, j]) * group.phi[:, :, j]
        values = 1e-6 * factor * von_mises(stress.stress[:, :, j])
        image = stress_tile(studio, values, shape, camera, 0.75, "MPa", np.nan)
        tiles.append(captioned(image, mode_title(group, j), size=17))
    title = f"{studio.basis.name}: stress modes{at_speed(group)}"
    note = (
        "Equivalent stress (von Mises) in MPa when the largest displacement of the mode is 1 mm; shapes amplified. "
        "The colours leave out the highest 0.2 % of the values."
    )
    return sheet(tiles, title, note)


ZONES = "The largest value is that outside the singular zones of supports, contact edges and sharp inner edges."


def stress_tile(
    studio: Studio, values: Array, shape: Array, camera: Camera, factor: float, unit: str, largest: float,
    colours: str = STRESS_MAP, mark: int | None = None,
) -> Picture:  # fmt: skip
    """One deformed body coloured by nodal values (n,), with its colour bar; a ring is drawn round the node `mark`.

    Args:
        largest: value that is written below, of the table; NaN: none.
    """
    outside = studio.outside
    seen = values[outside.source]
    top = float(np.quantile(seen, 0.998)) or 1.0
    data = _deformable(studio, colours, (0.0, top))
    studio.stage.reshape(data, outside.triangles, studio.points + shape[outside.source], seen)
    image = studio.stage.shoot(camera)
    if mark is not None:
        x, y = camera.project(studio.basis.mesh.points[mark] + shape[mark])[0]
        for radius, colour, width in ((15, "white", 6), (14, INK, 3)):
            pen(image).ellipse((x - radius, y - radius, x + radius, y + radius), outline=colour, width=width)
    image = scaled(image, factor)
    told = f"; largest {number(largest)} {unit}" if np.isfinite(largest) else ""
    return stacked([image, colour_bar(_map(colours), "0", number(top), f"{unit}{told}", image.width)], 4)


def static_picture(studio: Studio, group: ModalGroup) -> Picture | None:
    """Equivalent stress and displacement of the static state at speed (None if there is none)."""
    u = group.u_static
    size = np.linalg.norm(u, axis=1) if len(u) == studio.basis.mesh.n_points else np.zeros(1)
    if not size.any():
        return None
    static = static_extremes(group)
    grown = nice(0.06 * studio.extent / size.max())
    shape = grown * u
    moved = (studio.basis.mesh.points + shape)[studio.outside.source]
    camera = fit(np.vstack([studio.points, moved]), studio.axes, AREA)
    tiles = []
    stress = group.stresses.get("nodes")
    if stress is not None and len(stress.points) == studio.basis.mesh.n_points:
        values = 1e-6 * von_mises(stress.static_stress)
        image = stress_tile(studio, values, shape, camera, 1.0, "MPa", 1e-6 * static.stress)
        tiles.append(captioned(image, "Equivalent stress", size=17))
    image = stress_tile(studio, 1e3 * size, shape, camera, 1.0, "mm", 1e3 * static.displacement, DISPLACEMENT_MAP)
    tiles.append(captioned(image, "Displacement", size=17))
    title = f"{studio.basis.name}: static state{at_speed(group)}"
    zones = f" {ZONES}" if stress is not None and np.any(stress.singular) else ""
    return captioned(
        side_by_side(tiles), title, f"Displacements drawn {grown:g} times as large; grey lines: at rest.{zones}", 22
    )
