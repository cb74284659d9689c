"""The whole ring of a case at one of its resonances: every sector by the wave that runs round, or by its own motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..case.assemble import Built
from ..case.loaded import place_of
from ..data import Array
from ..frames import rotation
from ..operating.cycle import farthest_at
from ..operating.motion import Motion, motion_of
from ..operating.shape import on_sector
from ..results import Series
from ..system.component import Component, Ring
from ..system.disc import spread, whole
from ..system.excitation import direction

Moving = Callable[[int], Array]
"""Number of a sector -> (H + 1, n, 3) harmonics of the displacement of a body there, m, axes of the case."""


def ring_motion(built: Built, series: Series, point: int) -> dict[str, Moving]:
    """Body -> its motion in every sector at a point of a series; bodies without elements or shapes are left out."""
    found, full = dict[str, Moving](), built.settings.ring is not None and built.settings.ring.model == "full"
    for component in built.assembly.components:
        body = built.bodies[component.name]
        if body.basis.mesh.n_cells and all(len(g.phi) for g in component.groups.values()):
            of = _of_a_full_ring if full else _of_a_sector
            found[component.name] = of(built, component, series, point)
    return found


def _of_a_sector(built: Built, component: Component, series: Series, point: int) -> Moving:
    """Of the one that stands for all: sector j moves as it does, exp(i j k_h 2 pi / N) ahead in harmonic h."""
    ring, body = built.assembly.ring, built.bodies[component.name]
    q = series.arrays[f"bodies/{component.name}/q"]
    waves = [component.at(built.assembly.index(h)) for h in range(q.shape[1])]
    groups, turned = [w.group for w in waves], [w.conjugate for w in waves]
    motion = _motion(series, point, component.name, groups, turned)
    turn = place_of(body).turn
    return lambda j: on_sector(motion, body.basis, j, ring) @ turn.T


def _of_a_full_ring(built: Built, component: Component, series: Series, point: int) -> Moving:
    """Of bodies with coordinates of their own in every sector, or of one ring, see `system.disc`."""
    assert built.assembly.ring is not None
    alone, body = Ring(built.assembly.ring.blades, 0), built.bodies[component.name]
    turn, disc = place_of(body).turn, whole(component).groups[0] if component.sectors > 1 else None

    def moving(j: int) -> Array:
        name, group = f"{component.name}_{j}", component.groups[min(component.groups)]
        if disc is not None:
            waves = [component.at(k) for k in range(component.sectors // 2 + 1)]
            shapes = [w.group.phi.conj() if w.conjugate else w.group.phi for w in waves]
            name, group = component.name, replace(disc, phi=spread(shapes, j, component.sectors))
        return on_sector(_motion(series, point, name, group), body.basis, j, alone) @ turn.T

    return moving


def _motion(series: Series, point: int, name: str, groups: Any, turned: Any = ()) -> Motion:
    """Of a component at a point of a series."""
    q, forces = series.arrays[f"bodies/{name}/q"], series.arrays.get(f"bodies/{name}/forces")
    Omega = 2 * np.pi * series.frequency[[point]]
    return motion_of(Omega, q[[point]], groups, turned, None if forces is None else forces[[point]])


def draw_ring(built: Built, series: Series, row: Mapping[str, Any], path: Path) -> Path | None:
    """The ring at a resonance, a row of their table, at the instant at which its first body is out farthest.

    Returns:
        The picture; None where no body has elements and shapes.
    """
    from ..pictures.lettering import save_png
    from ..pictures.ring_views import Round, operating_ring, turning_round
    from ..pictures.scene import quiet_vtk

    point = int(np.abs(series.frequency - row["frequency_Hz"]).argmin())
    found = ring_motion(built, series, point)
    if not found:
        return None
    ring, first = built.assembly.ring, next(iter(built.bodies.values())).basis
    assert ring is not None
    sectors = range(ring.blades)
    angle = farthest_at(next(iter(found.values()))(0))
    turns = [rotation(first.rotation_axis, 2 * np.pi * j / ring.blades) for j in sectors]
    bodies = []
    for name, moving in found.items():
        basis, place = built.bodies[name].basis, place_of(built.bodies[name])
        still = basis.mesh.points @ place.turn.T + place.shift - first.rotation_point
        round_ = np.array([still @ R.T + first.rotation_point for R in turns])
        bodies.append(Round(basis, round_, np.array([moving(j)[1:] for j in sectors])))
    quiet_vtk()
    title = f"{built.settings.name}: the ring at {row['frequency_Hz']:.5g} Hz under {row['normal_force_N']:.6g} N"
    image = operating_ring(bodies, angle, first.rotation_axis, first.rotation_point, title, _said(built, angle))
    return save_png(image, path, turning_round(bodies, title))


def _said(built: Built, angle: float) -> str:
    """What is shown, in words."""
    ring = built.assembly.ring
    assert ring is not None
    k, way = direction(ring.index(1), ring.blades, built.settings.turning)
    runs = "a standing wave" if way == "standing" else f"a wave that runs {way} on the rotor"
    return (
        f"Engine order {abs(ring.order)} on {ring.blades} sectors: nodal diameter {k}, {runs}; drawn at "
        f"{np.degrees(angle):.0f} degrees of the cycle"
    )
