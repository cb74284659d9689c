"""The operating shape as VTU files for ParaView: amplitudes, phases, stresses, and instants of the cycle."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..data import Array, ModalBasis
from ..errors import UserError
from ..exchange import vtu
from ..files.store import write_text
from ..frames import rotation
from ..modal.stress import von_mises
from ..ring.expansion import replicate
from ..system.component import Ring
from .cycle import at_time, longest
from .fatigue import MaterialLimits, vibration_margin
from .motion import Motion, displacement
from .stress import cycle_stress

INSTANTS = 16
"""Of a cycle, in a PVD file."""


def shape_fields(motion: Motion, basis: ModalBasis, limits: MaterialLimits | None = None) -> dict[str, Array]:
    """Fields (n, ...) at the nodes of a body at one frequency.

    ``amplitude`` (n,) m, half the longest axis of the first harmonic's ellipse; ``mean`` (n, 3) m;
    ``h1_real``, ``h1_imag``, ... (n, 3) m; ``phase`` (n, 3) rad of the first harmonic; with stress modes at the nodes
    ``stress_amplitude``, ``stress_mean``, ``stress_largest`` (n,) Pa, see `stress.CycleStress`, and with limits
    ``margin`` (n,), Goodman's for the vibration (at most 1000). ``singular`` (n,) 1 in a singular zone.
    """
    a = displacement(motion.at(0), np.arange(basis.mesh.n_points))[0]
    fields: dict[str, Array] = {"mean": a[0].real}
    if len(a) > 1:
        fields |= {"amplitude": longest(a[1]), "phase": np.angle(a[1])}
    for h in range(1, len(a)):
        fields |= {f"h{h}_real": a[h].real, f"h{h}_imag": a[h].imag}
    return fields | _stresses(motion, basis, limits)


def _stresses(motion: Motion, basis: ModalBasis, limits: MaterialLimits | None) -> dict[str, Array]:
    if any("nodes" not in p.group.stresses for p in motion.parts):
        return {}
    found = cycle_stress(motion.at(0))
    if len(found.points) != basis.mesh.n_points:
        return {}
    fields = {"stress_amplitude": found.amplitude, "stress_mean": found.mean, "stress_largest": found.largest}
    fields |= {"singular": found.singular.astype(float)} if found.singular.any() else {}
    if limits is not None:
        fields["margin"] = np.minimum(vibration_margin(limits, found.amplitude, found.mean), 1000.0)
    return fields


def write_shape_vtu(motion: Motion, basis: ModalBasis, path: Path | str, limits: MaterialLimits | None = None) -> None:
    """Write the fields of `shape_fields` on the body's mesh, complete or absent.

    Raises:
        UserError: no shapes in the modal file, no permission, no space.
    """
    import meshio

    data: dict[str, Any] = {k: vtu.single(v) for k, v in shape_fields(motion, basis, limits).items()}
    if len(basis.mesh.node_id):
        data["node"] = basis.mesh.node_id
    vtu.save(meshio.Mesh(basis.mesh.points, vtu.cells(basis.mesh), point_data=data), path)


def write_instants(motion: Motion, basis: ModalBasis, path: Path | str, count: int = INSTANTS) -> None:
    """Write instants of the cycle as VTU files, bound together by a PVD file whose time is Omega t in degrees.

    Point data: ``displacement`` (n, 3) m from the static state, ``stress`` (n,) Pa, von Mises, static stress included.

    Raises:
        UserError: no shapes in the modal file, no permission, no space.
    """
    import meshio

    path, a = Path(path), displacement(motion.at(0), np.arange(basis.mesh.n_points))[0]
    sigma = cycle_stress(motion.at(0)).harmonics if _stresses(motion, basis, None) else None
    files = {}
    for i in range(count):
        angle = 2 * np.pi * i / count
        data = {"displacement": vtu.single(at_time(a, angle, axis=0))}
        if sigma is not None:
            data["stress"] = vtu.single(von_mises(at_time(sigma, angle, axis=1)))
        degrees = round(360 * i / count)
        files[degrees] = path.with_name(f"{path.stem}_{degrees:03d}.vtu")
        vtu.save(meshio.Mesh(basis.mesh.points, vtu.cells(basis.mesh), point_data=data), files[degrees])
    write_text(path, vtu.collection(files))


def on_sector(motion: Motion, basis: ModalBasis, sector: int, ring: Ring | None = None) -> Array:
    """(H + 1, n, 3) harmonics of the displacement of sector j of a ring, m, in space: R^j a_h exp(i j k_h 2 pi / N).

    All sectors have the same amplitude. Where the rows are conjugate the wave runs the other way.

    Args:
        ring: that a body stands in which is not cyclic itself; k_h are its indices.

    Raises:
        UserError: not a cyclic body, no shapes.
    """
    if basis.sectors == 1 and ring is None:
        raise UserError(f"{basis.name}: the body is not cyclic, it has no other sectors")
    a = displacement(motion.at(0), np.arange(basis.mesh.n_points))[0]
    if ring is None:
        N, k = basis.sectors, [-p.group.harmonic if p.conjugate else p.group.harmonic for p in motion.parts]
    else:
        N, k = ring.blades, [ring.index(h) for h in range(len(motion.parts))]
    turn = np.exp(2j * np.pi * ((np.array(k) * sector) % N) / N)
    return turn[:, None, None] * (a @ rotation(basis.rotation_axis, 2 * np.pi * sector / N).T)


def write_ring_vtu(motion: Motion, basis: ModalBasis, path: Path | str) -> None:
    """The whole ring at one frequency: ``amplitude`` m, ``h1_real``, ``h1_imag``, ... (ring points, 3) m.

    Raises:
        UserError: see `on_sector`; no permission, no space.
    """
    import meshio

    ring = replicate(basis.mesh, basis.rotation_axis, basis.rotation_point, basis.sectors)
    waves = np.stack([on_sector(motion, basis, j) for j in range(basis.sectors)])  # (N, H + 1, n, 3)
    data: dict[str, Any] = {}
    for h in range(1, waves.shape[1]):
        whole = ring.gather(waves[:, h])
        data |= {f"h{h}_real": vtu.single(whole.real), f"h{h}_imag": vtu.single(whole.imag)}
        if h == 1:
            data["amplitude"] = vtu.single(longest(whole))
    vtu.save(meshio.Mesh(ring.mesh.points, dict(ring.mesh.cells), point_data=data), path)
