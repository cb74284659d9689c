"""The whole ring in three dimensions: standing shapes of a few nodal diameters, and waves that travel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..data import Array, ComplexArray, Indices, ModalBasis, ModalGroup
from ..ring.expansion import expand, multiplicity, sector_rotation
from ..ring.resonances import eigenmodes
from ..units import METRES
from .lettering import captioned, colour_bar, nice, sheet, stacked
from .scene import Camera, Stage, Surface, axes_towards, face_triangles, fit, surface
from .turning import MOST_SHAPES, Turned, outside, together, turned
from .views import AREA, _map, at_speed, hertz, mode_scale

if TYPE_CHECKING:
    from .lettering import Picture

MOST_TRIANGLES = 400_000
"""Of the ring; above, facets are drawn by their corners only."""

SWING = 0.05
"""Largest displacement of a drawn ring mode, in diameters of the ring."""

COLOURS = "coolwarm"
DIRECTIONS = ("axial", "circumferential", "radial")


@dataclass(frozen=True)
class RingStudio:
    """A ring in front of the camera.

    Attributes:
        basis, stage: of the body. outside: of one sector. triangles: (t, 3) vertices of one sector without its cyclic
            faces. axes: of the camera. extent: diameter of the ring, m.
    """

    basis: ModalBasis
    stage: Stage
    outside: Surface
    triangles: Indices
    axes: Array
    extent: float

    def points(self) -> Array:
        """(N v, 3) vertices of the ring at rest."""
        still = self.basis.mesh.points[self.outside.source] - self.basis.rotation_point
        turns = [sector_rotation(self.basis, j) for j in range(self.basis.sectors)]
        return np.concatenate([still @ R.T for R in turns]) + self.basis.rotation_point

    def every(self, of_sector: Indices, count: int) -> Indices:
        """Indices of all sectors from those of one, which has `count` points."""
        shift = count * np.arange(self.basis.sectors)
        return (shift[:, None, None] + of_sector[None]).reshape(-1, of_sector.shape[1])


def open_ring(basis: ModalBasis, stage: Stage) -> RingStudio:
    """Extract the surface of one sector and choose the view: mostly along the axis, a little from above."""
    skin, triangles = _outside(basis, basis.sectors)
    arm = basis.mesh.points - basis.rotation_point
    axes, extent = _view(basis.rotation_axis), _diameter(arm, basis.rotation_axis)
    return RingStudio(basis, stage, skin, triangles, axes, extent)


def _outside(basis: ModalBasis, sectors: int) -> tuple[Surface, Indices]:
    """The surface of a body that is drawn so many times, and its triangles without those of cyclic faces."""
    skin = surface(basis.mesh)
    if sectors * len(skin.triangles) > MOST_TRIANGLES:
        skin = surface(basis.mesh, coarse=True)
    inside = np.zeros(len(skin.triangles), dtype=bool)
    for name in basis.cyclic_faces if basis.sectors > 1 else ():
        if name in basis.mesh.faces:
            inside |= face_triangles(skin, basis.mesh, name)
    return skin, skin.triangles[~inside]


def _view(axis: Array) -> Array:
    """(3, 3) axes of the camera that looks mostly along the axis of a ring, a little from above."""
    up = np.eye(3)[2 if abs(axis[2]) < 0.7 else 0]
    up = up - (up @ axis) * axis
    up /= np.linalg.norm(up)
    return axes_towards(-0.84 * axis + 0.40 * up + 0.26 * np.cross(up, axis), up)


def _diameter(arm: Array, axis: Array) -> float:
    """m, of a ring whose points lie at arm (n, 3) from a point of its axis."""
    return 2 * float(np.linalg.norm(arm - np.outer(arm @ axis, axis), axis=1).max())


def wave(ring: RingStudio, group: ModalGroup, mode: int) -> Array:
    """(N v, 3) complex displacement of the ring's vertices in one mode."""
    one = replace(group, phi=group.phi[:, :, mode : mode + 1])
    source = ring.outside.source
    return np.concatenate([expand(one, ring.basis, j)[source, :, 0] for j in range(ring.basis.sectors)])


def _directions(arm: Array, axis: Array) -> Array:
    """(v, 3, 3) unit vectors along the axis, the circumference and the radius (rows) at arm (v, 3) from the axis."""
    radial = arm - np.outer(arm @ axis, axis)
    radial /= np.maximum(np.linalg.norm(radial, axis=1, keepdims=True), 1e-300)
    return np.stack([np.broadcast_to(axis, radial.shape), np.cross(axis, radial), radial], axis=1)


@dataclass(frozen=True)
class _Shown:
    """One mode ready to be drawn: displacement (V, 3), m; its strongest component (V,) over the largest; its name."""

    moved: Array
    value: Array
    direction: str


def _prepare(ring: RingStudio, group: ModalGroup, mode: int) -> _Shown:
    moved = mode_scale(ring, group.phi[:, :, mode], SWING) * wave(ring, group, mode)
    directions = _directions(ring.points() - ring.basis.rotation_point, ring.basis.rotation_axis)
    parts = np.einsum("vdi,vi->dv", directions, moved)
    strongest = int((np.abs(parts) ** 2).sum(axis=1).argmax())
    value = parts[strongest]
    return _Shown(moved, value / max(float(np.abs(value).max()), 1e-300), DIRECTIONS[strongest])


def ring_camera(ring: RingStudio, area: float = 0.45 * AREA) -> Camera:
    """One camera for all modes of the ring."""
    return fit(ring.points() * (1 + 1.2 * SWING), ring.axes, area)


def _skin(ring: RingStudio) -> tuple[object, Indices]:
    count, stage = len(ring.outside.source), ring.stage
    triangles = ring.every(ring.triangles, count)
    points = ring.points()
    stage.clear()
    data = stage.skin(points, triangles, np.zeros(len(points)), cmap=COLOURS, clim=(-1.0, 1.0))
    return data, triangles


def turning_ring(basis: ModalBasis, groups: Sequence[ModalGroup], modes: int) -> str:
    """The first modes of nodal diameters on all sectors, as they turn on a page: travelling where there are two."""
    skin = outside(basis.mesh, basis.cyclic_faces)
    turns = [sector_rotation(basis, j) for j in range(basis.sectors)]
    still = (basis.mesh.points[skin.source] - basis.rotation_point) @ np.transpose(turns, (0, 2, 1))
    shapes = []
    for group in groups:
        for j in range(min(modes, eigenmodes(group).n_modes, -(-MOST_SHAPES // len(groups)))):
            one = replace(group, phi=group.phi[:, :, j : j + 1])
            wave = [expand(one, basis, sector)[skin.source, :, 0] for sector in range(basis.sectors)]
            name = f"nodal diameter {group.harmonic}, mode {j + 1}: {hertz(group.frequency[j])}"
            shapes.append(Turned(name, np.concatenate(wave)[None]))
    return turned(still.reshape(-1, 3), together([skin] * basis.sectors), shapes, f"{basis.name}: modes of the ring")


def ring_sheet(
    ring: RingStudio, groups: Sequence[ModalGroup], modes: int, camera: Camera, across: int | None = None
) -> Picture:
    """The first modes of nodal diameters as standing shapes.

    Args:
        across: how many pictures a row has; the modes of one nodal diameter if not given.
    """
    data, triangles = _skin(ring)
    still, tiles = ring.points(), []
    for group in groups:
        for j in range(min(modes, eigenmodes(group).n_modes)):
            shown = _prepare(ring, group, j)
            ring.stage.reshape(data, triangles, still + shown.moved.real, shown.value.real)  # type: ignore[arg-type]
            image = ring.stage.shoot(camera)
            title = f"k = {group.harmonic}, mode {j + 1}: {hertz(group.frequency[j])}"
            tiles.append(captioned(image, title, f"{shown.direction} displacement", 17))
    across = across or min(modes, min(eigenmodes(g).n_modes for g in groups))
    shape = across * tiles[0].width / (max(len(tiles) // across, 1) * tiles[0].height)
    title = f"{ring.basis.name}: modes of the ring of {ring.basis.sectors} sectors{at_speed(groups[0])}"
    note = "Amplified. k: nodal diameter; of each pair (0 < k < N/2) one member is shown, the other is turned."
    page = sheet(tiles, title, note, shape)
    return stacked([page, colour_bar(_map(COLOURS), "-1", "1", "named displacement over its largest value", 700)], 4)


def ring_wave(ring: RingStudio, group: ModalGroup, mode: int, camera: Camera, steps: int = 20) -> list[Picture]:
    """Frames of one period of a mode: u = Re(phi exp(i omega t)); for 0 < k < N/2 a wave that runs backward."""
    data, triangles = _skin(ring)
    still, shown = ring.points(), _prepare(ring, group, mode)
    kind = "standing" if multiplicity(group.harmonic, ring.basis.sectors) == 1 else "backward wave"
    title = f"Nodal diameter {group.harmonic}, {kind}: {hertz(group.frequency[mode])}{at_speed(group)}"
    frames = []
    for t in np.arange(steps) * 2 * np.pi / steps:
        turn = np.exp(1j * t)
        moved, value = (shown.moved * turn).real, (shown.value * turn).real
        ring.stage.reshape(data, triangles, still + moved, value)  # type: ignore[arg-type]
        frames.append(captioned(ring.stage.shoot(camera), title, size=13))
    return frames


@dataclass(frozen=True)
class Round:
    """A body in every sector of a ring. Attributes: basis. still: (N, n, 3) its mesh at rest, m, in common axes.
    moving: (N, H, n, 3) harmonics of its displacement, m, in them, from the first one on."""

    basis: ModalBasis
    still: Array
    moving: ComplexArray


def turning_round(bodies: Sequence[Round], title: str) -> str:
    """All bodies of a ring over the cycle, as they turn on a page."""
    skins, still, moving = [], [], []
    for body in bodies:
        faces = body.basis.cyclic_faces if body.basis.sectors > 1 else ()
        skin = outside(body.basis.mesh, faces)
        skins += [skin] * len(body.still)
        still.append(body.still[:, skin.source].reshape(-1, 3))
        each = np.moveaxis(body.moving[:, :, skin.source], 0, 1)
        moving.append(each.reshape(each.shape[0], -1, 3))
    shape = Turned("displacement", np.concatenate(moving, axis=1), sized=True)
    return turned(np.concatenate(still), together(skins), [shape], title)


def operating_ring(
    bodies: Sequence[Round], angle: float, axis: Array, point: Array, title: str, note: str
) -> Picture:
    """All bodies of a ring at an instant, deformed, coloured by the displacement along one direction.

    Args:
        angle: rad, of the cycle. axis, point: (3,) of the rotation. note: what is shown, without a full stop.
    """
    skins = [_round_skin(b, angle) for b in bodies]
    still, moved = (np.concatenate([s[i] for s in skins]) for i in (0, 1))
    begins = np.cumsum([0, *(len(s[0]) for s in skins)])
    triangles = np.concatenate([s[2] + start for s, start in zip(skins, begins, strict=False)])
    parts = np.einsum("vdi,vi->dv", _directions(still - point, axis), moved)
    strongest = int((parts**2).sum(axis=1).argmax())
    full_scale = float(np.linalg.norm(moved, axis=1).max())
    grown = nice(SWING * _diameter(still - point, axis) / max(full_scale, 1e-300))
    top = float(np.abs(parts[strongest]).max())
    value, (scale, unit) = parts[strongest] / max(top, 1e-300), METRES.scale(top)
    stage = Stage()
    try:
        drawn = still + grown * moved
        stage.skin(drawn, triangles, value, cmap=COLOURS, clim=(-1.0, 1.0))
        image = stage.shoot(fit(np.vstack([still, drawn]), _view(axis), AREA))
    finally:
        stage.close()
    bar = colour_bar(
        _map(COLOURS), f"{-(scale * top):.3g}", f"{scale * top:.3g}", f"{DIRECTIONS[strongest]} displacement in {unit}",
        image.width,
    )  # fmt: skip
    told = f"{note}, {grown:g} times as large; largest displacement {METRES.sized(full_scale, 3)}."
    return captioned(stacked([image, bar], 4), title, told, 20)


def _round_skin(body: Round, angle: float) -> tuple[Array, Array, Indices]:
    """Vertices (N v, 3) at rest, their displacement (N v, 3), and the triangles of a body all round."""
    skin, triangles = _outside(body.basis, len(body.still))
    turn = np.exp(1j * angle * np.arange(1, body.moving.shape[1] + 1))[:, None, None]
    moved = (body.moving * turn).sum(axis=1).real
    still, moved = (x[:, skin.source].reshape(-1, 3) for x in (body.still, moved))
    shift = len(skin.source) * np.arange(len(body.still))[:, None, None]
    return still, moved, (triangles[None] + shift).reshape(-1, 3)
