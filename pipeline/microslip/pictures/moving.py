"""Bodies that move, over the last period of a motion or one of a root: for ParaView, and as animations."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np

from ..case.assemble import Built
from ..case.loaded import Loaded, Place
from ..data import Array, ComplexArray, ModalBasis, ModalGroup
from ..exchange.vtu import write_motion
from ..operating.cycle import longest
from ..ring.expansion import sector_rotation
from ..system.disc import spread
from ..time_domain import classification
from ..time_domain.orbit import Orbit
from ..units import METRES
from . import can_draw, lettering, ring_views, views
from .scene import Stage, axes_towards, fit, quiet_vtk, surface
from .turning import turning_assembly

FRAMES = 32
"""Of a period that is animated."""

SIZE = 1e-3
"""m, the largest displacement of a root's shape, which has no size of its own."""


def moving_bodies(found: Sequence[tuple[str, Orbit]], built: Built, folder: Path) -> list[Path]:
    """Files of every body that has a mesh and shapes; of a cyclic one all sectors, of lone blades in a ring the first.

    Returns:
        Those in ``motion/`` for ParaView, and animations in ``pictures/``.
    """
    made = list[Path]()
    for i, (name, one) in enumerate(found, 1):
        if len(one.time) < one.samples:
            continue
        at = len(one.time) - one.samples + np.arange(0, one.samples, max(one.samples // FRAMES, 1))
        for j, component in enumerate(one.equations.assembly.components):
            body = built.bodies.get(component.name.removesuffix("_0" if built.settings.ring else ""))
            if body is None or not body.basis.mesh.n_cells or not all(len(g.phi) for g in body.groups.values()):
                continue
            moved = _moved(body, classification.of_body(one, j, at))
            made += write_motion(body.basis, one.time[at], moved, folder / "motion" / f"{component.name}_{i}.pvd")
            if can_draw() is None:
                path = folder / "pictures" / f"moving_{i}_{component.name}.gif"
                title = f"{built.settings.name}: {name}, one period of the excitation"
                made.append(moving_gif(body.basis, moved, path, title))
    return made


def moving_shape(
    shape: Mapping[str, ComplexArray], bases: Mapping[str, ModalBasis], frequency: float, animated: Collection[str],
    title: str, number: int, folder: Path,
) -> list[Path]:  # fmt: skip
    """One period of the shape of a root, Re(u exp(i omega t)) without its growth, largest over all bodies `SIZE`.

    Args:
        shape: body -> (n, 3) complex motion u of its points. frequency: Hz. animated: bodies that are drawn.
        number: of the root, in names.

    Returns:
        Files of every body in ``motion/`` for ParaView, and animations in ``pictures/`` where PyVista is.
    """
    made, part, scenes = list[Path](), np.arange(FRAMES) / FRAMES, bool(animated) and can_draw() is None
    scale = SIZE / max(float(longest(u).max()) for u in shape.values())
    for name, u in shape.items():
        moved = scale * np.real(np.exp(2j * np.pi * part)[:, None, None, None] * u)
        made += write_motion(bases[name], part / frequency, moved, folder / "motion" / f"root_{number}_{name}.pvd")
        if scenes and name in animated:
            path = folder / "pictures" / f"root_{number}_{name}.gif"
            made.append(moving_gif(bases[name], moved, path, title))
    return made


def assembled_picture(
    shapes: Mapping[str, Mapping[str, ComplexArray]], bases: Mapping[str, ModalBasis], places: Mapping[str, Place],
    title: str, path: Path,
) -> Path:  # fmt: skip
    """All bodies where a case puts them, in the first of some motions, farthest out; on a page they turn and move.

    Args:
        shapes: name of a motion -> body -> (n, 3) complex motion of its points. places: of the bodies.
    """
    quiet_vtk()
    names = list(next(iter(shapes.values())))
    at = {n: bases[n].mesh.points @ places[n].turn.T + places[n].shift for n in names}
    moved = {n: np.array([shape[n] @ places[n].turn.T for shape in shapes.values()]) for n in names}
    every, first = np.concatenate(list(at.values())), [moved[n][0] for n in names]
    sizes = [longest(u) for u in first]
    most = int(np.argmax([size.max() for size in sizes]))
    top = float(sizes[most].max())
    phase = 0.5 * np.angle(np.sum(first[most][int(sizes[most].argmax())] ** 2))  # at which that point is farthest out
    factor = views.AMPLITUDE * float(np.ptp(every, axis=0).max()) / top
    stage, shown = Stage(), []
    try:
        for n, u, size in zip(names, first, sizes, strict=True):
            skin = surface(bases[n].mesh)
            shown.append(at[n] + factor * np.real(u * np.exp(-1j * phase)))
            look = {"cmap": views.DISPLACEMENT_MAP, "clim": (0.0, 1.0)}
            stage.skin(shown[-1][skin.source], skin.triangles, size[skin.source] / top, **look)
            stage.lines(at[n], skin.outline, (150, 154, 164), 1.0)
        axes = axes_towards(np.array([0.5, -0.8, 0.55]))
        picture = stage.shoot(fit(np.concatenate(shown), axes, 0.7 * views.AREA))
    finally:
        stage.close()
    note = "colour: largest displacement in the cycle over that of all; grey lines: at rest"
    told = f"{title}: {next(iter(shapes))}"
    body = turning_assembly([(bases[n].mesh, at[n], moved[n]) for n in names], list(shapes), title)
    return lettering.save_png(lettering.captioned(picture, told, note, 16), path, body)


def _moved(body: Loaded, q: Array) -> Array:
    """(f, sectors, points, 3) m of a body, by its coordinates (f, m), those of all sectors of a cyclic one."""
    if body.basis.sectors == 1:
        return np.einsum("pxm,fm->fpx", body.group.phi, q)[:, None]
    return whole_ring(body.basis, body.groups, q)


def whole_ring(basis: ModalBasis, groups: Mapping[int, ModalGroup], q: Array) -> Array:
    """(f, N, points, 3) m of all sectors in the axes of the ring, by its coordinates (f, m) of `system.disc`.

    Args:
        groups: of every nodal diameter.
    """
    waves = [groups[k].phi for k in sorted(groups)]
    found = np.empty((len(q), basis.sectors, *waves[0].shape[:2]), np.float32)
    for j in range(basis.sectors):
        shapes = spread(waves, j, basis.sectors)
        found[:, j] = np.einsum("yx,pxm,fm->fpy", sector_rotation(basis, j), shapes, q, optimize=True)
    return found


def moving_gif(basis: ModalBasis, moved: Array, path: Path, title: str) -> Path:
    """Frames of displacements (f, sectors, points, 3) in m, amplified alike; of one body over its outline at rest.

    The colour is the size of the displacement; the largest one and the amplification stand below.
    """
    quiet_vtk()
    studio = views.open_studio(basis) if basis.sectors == 1 else ring_views.open_ring(basis, Stage())
    try:
        frames = _frames(studio, moved, title)
    finally:
        studio.stage.close()
    return lettering.save_gif(frames, path)


def _frames(studio: views.Studio | ring_views.RingStudio, moved: Array, title: str) -> list[lettering.Picture]:
    sizes = np.linalg.norm(moved, axis=3)
    full_scale, (frame, sector) = float(sizes.max()), np.unravel_index(sizes.max(axis=2).argmax(), sizes.shape[:2])
    source, count = studio.outside.source, len(moved)
    swing = views.AMPLITUDE if isinstance(studio, views.Studio) else ring_views.SWING
    factor = views.mode_scale(studio, moved[frame, sector], swing)
    note = f"amplified {factor:.3g} times; largest displacement {METRES.sized(full_scale)}"
    if isinstance(studio, views.Studio):
        still, triangles, note = studio.points, studio.outside.triangles, f"{note}; grey lines: at rest"
        studio.stage.lines(studio.basis.mesh.points, studio.outside.outline, (150, 154, 164), 1.5)
    else:
        still, triangles = studio.points(), studio.every(studio.triangles, len(source))
    shown = still + factor * moved[:, :, source].reshape(count, -1, 3)
    camera = fit(shown.reshape(-1, 3), studio.axes, 0.45 * views.AREA)
    colours = {"cmap": views.DISPLACEMENT_MAP, "clim": (0.0, 1.0)}
    data = studio.stage.skin(still, triangles, np.zeros(len(still)), **colours)
    frames = []
    for points, size in zip(shown, sizes[:, :, source].reshape(count, -1) / max(full_scale, 1e-300), strict=True):
        studio.stage.reshape(data, triangles, points, size)
        frames.append(lettering.captioned(studio.stage.shoot(camera), title, note, 16))
    return frames
