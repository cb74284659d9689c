"""VTU for ParaView: modes, stress modes and the static state at the mesh's points. For pictures, in single precision.

Several speeds stand beside each other in one file, their names then begin with the speed: ``1500rpm_mode_01_28.92Hz``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np

from ..data import Array, Indices, Mesh, ModalBasis, ModalGroup
from ..errors import UserError
from ..files.store import complete_or_absent, write_text
from ..mesh import boundary_facets
from ..reduced.coordinates import basis_in_modes, in_modes
from ..ring.expansion import expand, multiplicity, replicate, ring_scale, sector_rotation
from ..ring.resonances import eigenmodes, speeds_of
from ..units import to_rpm
from .choice import STATEMENT, Format, with_shapes


def write_vtu(basis: ModalBasis, path: Path | str) -> None:
    """Write mesh, shapes and nodal stresses as a VTU file, complete or absent.

    Of a cyclic sector this is the sector alone; its complex fields are two, ``..._real`` and ``..._imag``.

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
    save(meshio.Mesh(basis.mesh.points, cells(basis.mesh), point_data=data), path)


def write_pvd(basis: ModalBasis, path: Path | str) -> None:
    """Write a VTU file a mode, bound together by a PVD file: ParaView shows the number of the mode as its time.

    Point data: ``shape`` (n, 3) kg^-1/2, of complex modes ``shape_real`` and ``shape_imag``; ``Hz``, ``rpm``,
    ``nodal_diameter``, the same at every point. Modes of several groups follow each other.

    Raises:
        UserError: shapes are not stored, no permission, no space.
    """
    import meshio

    path, files = Path(path), dict[int, Path]()
    groups = [with_shapes(basis, in_modes(g), "pvd") for _, g in sorted(basis.groups.items())]
    for g in groups:
        for j in range(g.n_modes):
            number = len(files) + 1
            files[number] = path.with_name(f"{path.stem}_mode{number:03d}.vtu")
            state = (("Hz", g.frequency[j]), ("rpm", to_rpm(g.speed)), ("nodal_diameter", g.harmonic))
            data = _parts("shape", g.phi[:, :, j]) | {n: np.full(basis.mesh.n_points, v) for n, v in state}
            save(meshio.Mesh(basis.mesh.points, cells(basis.mesh), point_data=data), files[number])
    write_text(path, collection(files))


def write_motion(basis: ModalBasis, times: Array, moved: Array, path: Path | str) -> list[Path]:
    """Write the outside of a moving body as a VTU file a time, bound together by a PVD file with times in s.

    Point data: ``displacement`` (n, 3) m, about the mesh at rest; ParaView's filter Warp By Vector moves it.

    Args:
        times: (f,) s. moved: (f, sectors, points, 3) m, of all sectors in the axes of the ring. path: of the PVD file;
            the others stand beside it.

    Returns:
        All files, the PVD file first.

    Raises:
        UserError: no permission, no space.
    """
    import meshio

    path, files, (outside, used) = Path(path), dict[float, Path](), _outside(basis)
    if basis.sectors > 1:
        outside = replicate(outside, basis.rotation_axis, basis.rotation_point, basis.sectors).mesh
    for i, (time, shape) in enumerate(zip(times, moved, strict=True)):
        files[float(time)] = path.with_name(f"{path.stem}_{i:03d}.vtu")
        data = {"displacement": single(shape[:, used].reshape(-1, 3))}
        save(meshio.Mesh(outside.points, dict(outside.cells), point_data=data), files[float(time)])
    write_text(path, collection(files))
    return [path, *files.values()]


COMMENT = f"<!--microslip: {STATEMENT}; vectors x y z; phi^H M phi = 1; stress xx yy zz xy yz xz-->"


def save(mesh: Any, path: Path | str) -> None:
    """A meshio mesh as a VTU file; its third line says units, frame and order."""
    import meshio

    with complete_or_absent(path) as temporary:
        meshio.write(temporary, mesh, file_format="vtu")
        text = temporary.read_bytes()
        temporary.write_bytes(re.sub(rb"<!--.*?-->", COMMENT.encode(), text, count=1))


def cells(mesh: Mesh) -> dict[str, Indices]:
    """Cells to draw; points by themselves where a body has no others."""
    return dict(mesh.cells) or {"vertex": np.arange(mesh.n_points)[:, None]}


def mode_label(group: ModalGroup, mode: int) -> str:
    """``01_14.07Hz`` or ``01_rigid``."""
    rigid = group.kind[mode] == "rigid"
    return f"{mode + 1:02d}_" + ("rigid" if rigid else f"{group.frequency[mode]:.2f}Hz")


def _prefix(basis: ModalBasis, group: ModalGroup, harmonic: int) -> str:
    several = len({g.speed for g in basis.groups.values()}) > 1
    text = f"{to_rpm(group.speed):.6g}rpm_" if several else ""
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
            data |= _parts(f"{prefix}mode_{label}", group.phi[:, :, j])
        if has_stress and stress is not None:
            data |= _parts(f"{prefix}stress_{label}", stress.stress[:, :, j])
    if group.u_static.any():
        data[f"{prefix}u_static"] = single(group.u_static)
    if has_stress and stress is not None and stress.static_stress.any():
        data[f"{prefix}stress_static"] = single(stress.static_stress)
    return data


def _parts(name: str, values: Array) -> dict[str, Any]:
    """One field, or the two of a complex one."""
    if not np.iscomplexobj(values):
        return {name: single(values)}
    return {f"{name}_real": single(values.real), f"{name}_imag": single(values.imag)}


def single(values: Array) -> Any:
    return np.ascontiguousarray(values, dtype=np.float32)


# --- the whole ring ------------------------------------------------------------------------------------------------


def write_ring(basis: ModalBasis, path: Path | str, speed: int = 0) -> Path:
    """Write the surface of all sectors of a cyclic body: a VTU file per nodal diameter, bound together by a PVD file.

    ParaView shows the nodal diameter as its time. Point data of the eigenmodes, ``mode_<number>_real`` and
    ``mode_<number>_imag`` (ring points, 3), kg^-1/2: the ring moves as real cos(omega t) - imag sin(omega t), for
    0 < k < N/2 a backward wave; both parts by themselves are the two standing modes of the pair, normalised on the
    ring. ``u_static`` m; cell data ``sector``. The frequencies are in a table (CSV) beside the PVD file.

    Args:
        path: of the PVD file; the others stand beside it. speed: which of the file's, counted from 0.

    Returns:
        The PVD file.

    Raises:
        UserError: not a cyclic body, no such speed, no shapes in the file, no permission, no space.
    """
    if basis.sectors == 1:
        raise UserError(f"{basis.name}: export --ring: the body is not cyclic; leave --ring out")
    groups = {k: eigenmodes(g) for (s, k), g in sorted(basis.groups.items()) if s == speed}
    if not groups:
        raise UserError(f"{basis.name}: --speed {speed}: the file has {len(speeds_of(basis))}; count from 0")
    path, (outside, used) = Path(path), _outside(basis)
    ring = replicate(outside, basis.rotation_axis, basis.rotation_point, basis.sectors)
    rows = ["rpm,nodal diameter,mode,Hz,modes of the ring"]
    files = {k: path.with_name(f"{path.stem}_nd{k:02d}.vtu") for k in groups}
    for k, g in groups.items():
        thin = replace(g, phi=g.phi[used] if len(g.phi) else g.phi, u_static=g.u_static[used])
        _write_ring_group(basis, ring.mesh, thin, files[k])
        twice = multiplicity(k, basis.sectors)
        rows += [f"{to_rpm(g.speed):.6g},{k},{j + 1},{f:.8g},{twice}" for j, f in enumerate(g.frequency)]
    write_text(path.with_suffix(".csv"), "\n".join(rows) + "\n")
    write_text(path, collection(files))
    return path


def _outside(basis: ModalBasis) -> tuple[Mesh, Indices]:
    """The surface of a sector without its cyclic faces as a mesh of facets, and its points' numbers."""
    mesh = basis.mesh
    cut = [f for name in basis.cyclic_faces for f in mesh.faces.get(name, {}).values()]
    inside = {tuple(row) for f in cut for row in np.sort(f, axis=1).tolist()}
    kept = {}
    for kind, facets in boundary_facets(mesh).items():
        free = np.array([tuple(row) not in inside for row in np.sort(facets, axis=1).tolist()])
        kept[kind] = facets[free]
    used = np.unique(np.concatenate([f.ravel() for f in kept.values()]))
    return Mesh(mesh.points[used], {t: np.searchsorted(used, f) for t, f in kept.items()}), used


def _write_ring_group(basis: ModalBasis, ring: Mesh, group: ModalGroup, path: Path) -> None:
    import meshio

    scale = ring_scale(group, basis.sectors)
    waves = [scale * expand(group, basis, j) for j in range(basis.sectors)]
    data: dict[str, Any] = {}
    for m in range(group.n_modes):
        whole = np.concatenate([w[:, :, m] for w in waves])
        data[f"mode_{m + 1:02d}_real"] = single(whole.real)
        data[f"mode_{m + 1:02d}_imag"] = single(whole.imag)
    if group.u_static.any():
        turned = [group.u_static @ sector_rotation(basis, j).T for j in range(basis.sectors)]
        data["u_static"] = single(np.concatenate(turned))
    sector = [np.repeat(np.arange(basis.sectors), len(c) // basis.sectors) for c in ring.cells.values()]
    save(meshio.Mesh(ring.points, dict(ring.cells), point_data=data, cell_data={"sector": sector}), path)


def collection(files: Mapping[int, Path] | Mapping[float, Path]) -> str:
    """A PVD file: the nodal diameter, or the number of the mode, stands as the time, or time itself in s."""
    sets = "".join(f'    <DataSet timestep="{k}" part="0" file="{escape(f.name)}"/>\n' for k, f in files.items())
    return (
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n'
        f"{COMMENT}\n  <Collection>\n{sets}  </Collection>\n</VTKFile>\n"
    )


FORMATS = (
    Format("pvd", ".pvd", "ParaView: a file a mode", write_pvd),
    Format("vtu", ".vtu", "ParaView", write_vtu),
)
