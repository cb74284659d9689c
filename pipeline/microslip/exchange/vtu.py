"""VTU for ParaView: modes, stress modes and the static state at the mesh's points. For pictures, in single precision.

Several speeds stand beside each other in one file, their names then begin with the speed: ``1500rpm_mode_01_28.92Hz``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..coordinates import basis_in_modes
from ..data import Array, ModalBasis, ModalGroup
from ..store import complete_or_absent


def write_vtu(basis: ModalBasis, path: Path | str) -> None:
    """Write mesh, shapes and nodal stresses as a VTU file, complete or absent.

    Point data: ``mode_<number>_<Hz>Hz`` (n, 3) in kg^-1/2; ``stress_<number>_<Hz>Hz`` (n, 6) in Pa per unit modal
    coordinate, order xx yy zz xy yz xz (VTK's); ``u_static`` (n, 3) m and ``stress_static`` (n, 6) Pa where there
    is a static state; ``face_<name>`` 1 on the points of a named face; ``node`` numbers of the mesh file.

    Raises:
        UserError: no permission, no space.
    """
    basis = basis_in_modes(basis)
    import meshio

    data: dict[str, Any] = {}
    for (_, harmonic), group in sorted(basis.groups.items()):
        data |= _group_data(basis, group, _prefix(basis, group, harmonic))
    for name in basis.mesh.faces:
        marker = np.zeros(basis.mesh.n_points, dtype=np.uint8)
        marker[basis.mesh.face_points(name)] = 1
        data[f"face_{name}"] = marker
    if len(basis.mesh.node_id):
        data["node"] = basis.mesh.node_id
    mesh = meshio.Mesh(basis.mesh.points, dict(basis.mesh.cells), point_data=data)
    with complete_or_absent(path) as temporary:
        meshio.write(temporary, mesh, file_format="vtu")


def mode_label(group: ModalGroup, mode: int) -> str:
    """``01_14.07Hz`` or ``01_rigid``."""
    rigid = group.kind[mode] == "rigid"
    return f"{mode + 1:02d}_" + ("rigid" if rigid else f"{group.frequency[mode]:.2f}Hz")


def _prefix(basis: ModalBasis, group: ModalGroup, harmonic: int) -> str:
    several = len({g.speed for g in basis.groups.values()}) > 1
    text = f"{group.speed * 30 / np.pi:.6g}rpm_" if several else ""
    return text + (f"nd{harmonic}_" if any(h for _, h in basis.groups) else "")


def _group_data(basis: ModalBasis, group: ModalGroup, prefix: str) -> dict[str, Any]:
    """The fields of one speed; what the file does not hold is left out."""
    n = basis.mesh.n_points
    data: dict[str, Any] = {}
    stress = group.stresses.get("nodes")
    has_stress = stress is not None and len(stress.points) == n
    for j in range(group.n_modes):
        label = mode_label(group, j)
        if len(group.phi) == n:
            data[f"{prefix}mode_{label}"] = _single(group.phi[:, :, j])
        if has_stress and stress is not None:
            data[f"{prefix}stress_{label}"] = _single(stress.stress[:, :, j])
    if group.u_static.any():
        data[f"{prefix}u_static"] = _single(group.u_static)
    if has_stress and stress is not None and stress.static_stress.any():
        data[f"{prefix}stress_static"] = _single(stress.static_stress)
    return data


def _single(values: Array) -> Any:
    return np.ascontiguousarray(values, dtype=np.float32)
