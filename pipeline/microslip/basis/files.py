"""The modal file: one HDF5 file per body. `write_basis`, `read_basis`, `check_basis`.

The layout is documented in ``docs/modal_file.md``. Everything is SI. Datasets are named and their dimensions too
(HDF5 dimension scales), so that xarray shows ``phi (node, axis, mode)``; MATLAB and Octave see them reversed.
Same inputs give the same bytes: nothing volatile is written. The last line of the file is a seal (`hdf5.seal`), by
which damage is found before HDF5 meets it.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..data import (
    INTERFACE_ROWS,
    MOTIONS,
    VOIGT,
    Array,
    Compliance,
    ContactState,
    GyroscopicModes,
    Indices,
    Interface,
    Invariants,
    Material,
    Mesh,
    ModalBasis,
    ModalGroup,
    Residual,
    Rows,
    RunUp,
    SpeedRange,
    StressSet,
)
from ..errors import UserError, in_its_file
from ..files.declared import (
    Noun,
    Scales,
    array,
    escaped,
    indices,
    names,
    read,
    read_each,
    real,
    texts,
    unescaped,
    write,
    write_each,
)
from ..files.hdf5 import ANNOUNCED, put, put_scale, sealed
from ..files.hostile import DAMAGE, inspect, refuse_damaged, short
from ..files.store import ordinary
from ..settings.arguments import checked
from ..topology import CELL_TYPES, FACET_CORNERS
from .checks import TOLERANCES, Check, check_basis
from .strains import single

__all__ = ["Check", "check_basis", "open_file", "read_basis", "write_basis"]

FORMAT = "microslip-modal-basis"
FORMAT_VERSION = "0.2"

CONVENTIONS = {
    "time": "exp(+i Omega t)",
    "amplitude": "0-peak",
    "normalisation": "phi^T M phi = 1",
    "sign": "largest component of the first interface's six rows positive (ties within 1e-6: lowest row); "
    "without interfaces the largest component of phi",
    "repeated": "inside repeated frequencies the first interface's rows are lower triangular",
    "voigt": " ".join(VOIGT),
    "shear": "engineering (gamma = 2 eps)",
    "interface_frame": "rows of rotation: n (outward normal of this body), t1, t2; right-handed",
    "interface_rows": " ".join(INTERFACE_ROWS) + " in the interface's own frame; rotations are small, from an "
    "area-weighted fit that is work-conjugate with the six forces",
    "nodal_diameter": "a sector's right-handed neighbour about the rotation axis moves as the sector itself times "
    "exp(+i k 2 pi / N)",
    "dimensions": "C order; MATLAB and Octave see the dimensions reversed",
}

_FACET_NODES = {"triangle": 3, "triangle6": 6, "quad": 4, "quad8": 8, "quad9": 9}


# writing ---------------------------------------------------------------------------------------------------------


@checked
def write_basis(path: Path | str, basis: ModalBasis) -> None:
    """Write a modal file, complete or absent.

    Raises:
        UserError: no permission, no space.
    """
    with sealed(path) as file:
        _write(file, basis)


def size_in_words(basis: ModalBasis) -> str:
    """About how large the file of a basis is, before it is compressed, and what makes it so."""
    groups = [*basis.groups.values(), *(g for r in basis.ranges.values() for g in r.samples)]
    arrays = {id(a): a.nbytes for g in groups for a in (g.phi, *(f.shapes for f in g.interfaces.values()))}
    states = {id(g.u_static): g.u_static.nbytes for g in groups}
    shapes = sum(arrays.values())
    sets = [s for g in groups for s in g.stresses.values()]
    sets_bytes = sum(s.strain.nbytes + s.stress.nbytes for s in sets) // 2
    whole = shapes + sets_bytes + sum(states.values()) + sum(s.static_stress.nbytes for s in sets)
    if whole < ANNOUNCED:
        return ""
    each = {"shapes (output.shapes, output.patch_shapes)": shapes,
            "stress modes (output.gauss, output.nodal_stress)": sets_bytes}  # fmt: skip
    told = ", ".join(f"{1e-6 * size:.0f} MB of {name}" for name, size in each.items() if size > 0.1 * whole)
    return f"about {1e-6 * whole:.0f} MB: {told}"


def _write(file: h5py.File, basis: ModalBasis) -> None:
    scales = _write_root(file, basis)
    _write_mesh(file, basis.mesh, scales)
    _write_frames(file, basis.groups[min(basis.groups)], scales)
    for (speed, harmonic), group in sorted(basis.groups.items()):
        where = file.require_group(f"speed_{speed}")
        where.attrs["rpm"] = group.speed * 30 / np.pi
        where.attrs["Omega"] = group.speed
        _write_group(where.create_group(f"nd_{harmonic}"), group, basis.rotation_axis, scales)
    for harmonic, found in sorted(basis.ranges.items()):
        _write_range(file.create_group(f"range/nd_{harmonic}"), found, basis.rotation_axis, scales)


def _write_root(file: h5py.File, basis: ModalBasis) -> Scales:
    file.attrs["format"] = FORMAT
    file.attrs["format_version"] = FORMAT_VERSION
    file.attrs["name"] = basis.name
    file.attrs["units"] = "SI: m, kg, s, N, rad, Pa"
    file.attrs["frame"] = "A: right-handed body axes of the mesh; see body.toml for where origin and axes lie"
    file.attrs["conventions"] = json.dumps(CONVENTIONS)
    file.attrs["reduction"] = basis.reduction
    file.attrs["free"] = int(basis.free)
    file.attrs["damping_source"] = basis.damping_source
    file.attrs["source"] = basis.source
    words = {"axis": "xyz", "component": VOIGT, "frame_axis": ("n", "t1", "t2"), "interface_row": INTERFACE_ROWS}
    scales = {name: put_scale(file, name, np.array(list(told))) for name, told in words.items()}
    provenance = file.create_group("provenance")
    for key, value in sorted(basis.provenance.items()):
        provenance.attrs[key] = value.replace("\0", "")
    write(file, basis, scales, part="body/")
    write(file, basis, scales, part="rotation/")
    cyclic = file.create_group("cyclic")
    cyclic.attrs["N"] = basis.sectors
    cyclic.attrs["sector_angle"] = 2 * np.pi / basis.sectors
    cyclic.attrs["left"], cyclic.attrs["right"] = basis.cyclic_faces if basis.sectors > 1 else ("", "")
    return scales


def _write_mesh(file: h5py.File, mesh: Mesh, scales: Scales) -> None:
    group = file.create_group("mesh")
    ids = mesh.node_id if len(mesh.node_id) else np.arange(1, mesh.n_points + 1)
    scales["node"] = put_scale(group, "node", ids)
    file["node"] = scales["node"]  # the same dataset again, where every group below finds it
    write(group, mesh, scales)
    cells = group.create_group("cells")
    cells.attrs["order"] = "VTK node order, 0-based positions in /mesh/node"
    for cell_type, connectivity in sorted(mesh.cells.items()):
        put(cells, cell_type, connectivity, dims=("cell", "corner"))
    if mesh.materials:
        _write_materials(group, mesh)
    groups = group.create_group("groups")
    groups.attrs["order"] = "nodes: ids as in /mesh/node; facets: VTK node order, 0-based positions in /mesh/node"
    for name in sorted({*mesh.faces, *mesh.point_sets}):
        where = groups.create_group(escaped(name))
        where.attrs["point_set"] = int(name in mesh.point_sets)
        chosen = mesh.point_sets[name] if name in mesh.point_sets else mesh.face_points(name)
        put(where, "nodes", ids[chosen], dims=("member",))
        for facet_type, facets in sorted(mesh.faces.get(name, {}).items()):
            put(where, facet_type, facets, dims=("facet", "corner"))


def _write_materials(group: h5py.Group, mesh: Mesh) -> None:
    """Those the mesh file brought; a body of one material of its settings has none here."""
    where = group.create_group("materials")
    m = mesh.materials
    put(where, "name", np.array([x.name.replace("\0", "") or "-" for x in m], dtype="U"), dims=("material",))
    put(where, "density", np.array([x.density for x in m]), "kg/m^3", dims=("material",))
    put(where, "elasticity", np.array([x.elasticity for x in m]), "Pa", ("material", "component", "component_"))
    put(where, "expansion", np.array([x.expansion for x in m]), "1/K", ("material", "component"))
    regions = where.create_group("cells")
    regions.attrs["order"] = "material of each cell, 0-based, cells as in /mesh/cells"
    for cell_type, numbers in sorted(mesh.regions.items()):
        put(regions, cell_type, numbers.astype(np.int64), dims=("cell",))


def _read_materials(group: h5py.Group, cells: dict[str, Indices]) -> dict[str, Any]:
    if "materials" not in group:
        return {}
    where = group["materials"]
    names = texts(where, "name")
    k = len(names)
    numbers = (array(where, "density", k), array(where, "elasticity", k, 6, 6), array(where, "expansion", k, 6))
    regions = {t: indices(where["cells"], t, None, k) for t in where["cells"]}
    if {t: len(r) for t, r in regions.items()} != {t: len(c) for t, c in cells.items()}:
        raise ValueError("/mesh/materials/cells does not give every cell a material")
    materials = tuple(Material(float(d), C, a, None, n) for d, C, a, n in zip(*numbers, names, strict=True))
    return {"materials": materials, "regions": regions}


def _write_frames(file: h5py.File, group: ModalGroup, scales: Scales) -> None:
    """Frames and patches do not depend on speed: they stand at the root."""
    where = file.create_group("interfaces")
    where.attrs["order"] = json.dumps(list(group.interfaces))
    for name, item in group.interfaces.items():
        write(file, item, scales, name, part="/", homes={"shape": where.require_group(escaped(name))})


def _write_group(group: h5py.Group, g: ModalGroup, axis: Array, scales: Scales) -> None:
    modes = group.create_group("modes")
    mode = put_scale(modes, "mode", np.arange(1, g.n_modes + 1))
    column = put_scale(modes, "mode_column", np.arange(1, g.n_modes + 1))
    scales = {**scales, "mode": mode, "mode_column": column}
    group["mode"], group["mode_column"] = mode, column  # where run_up and gyroscopic find them
    if len(g.omega) < g.n_modes:
        scales["own_mode"] = put_scale(modes, "own_mode", np.arange(1, len(g.omega) + 1))
    write(group, g, scales, part="modes/")
    cyclic = group.create_group("cyclic")
    cyclic.attrs["harmonic"], cyclic.attrs["real"] = g.harmonic, int(not np.iscomplexobj(g.phi))
    _write_interfaces(group, g, scales)
    for kind, field in _ROW_FIELDS.items():
        write_each(group.create_group(kind), getattr(g, field), scales)
    write(group, g.compliance, scales)
    for name, s in sorted(g.stresses.items()):
        _write_stress(group, name, s, scales)
    _write_state(group, g, axis, scales)
    if g.contacts:
        write_each(group.create_group("contacts"), g.contacts, scales)
    if g.residual is not None:
        _write_residual(group, g.residual, scales)
    if g.run_up is not None:
        write(group.create_group("run_up"), g.run_up, scales)
    if g.gyroscopic is not None:
        where = group.create_group("gyroscopic")
        where.attrs["stable"] = int(g.gyroscopic.stable)
        where.attrs["frame"] = "turns with the body; q = shapes exp(i omega t); forward: with the rotation"
        write(where, g.gyroscopic, scales)
    if g.invariants is not None:
        write(group.create_group("invariants"), g.invariants, None)
        if len(g.invariants.stiffening):
            group["invariants/stiffening"].attrs["motions"] = " ".join(MOTIONS)
    checks = group.create_group("checks")
    for name, value in sorted(g.checks.items()):
        put(checks, name, value).attrs["tolerance"] = TOLERANCES.get(name, np.nan)


def _write_range(group: h5py.Group, r: SpeedRange, axis: Array, scales: Scales) -> None:
    """The samples as groups like any other; what they share, phi and patch shapes, stands in the first alone."""
    write(group, r, None)
    for i, g in enumerate(r.samples):
        if i:
            faces = {k: replace(f, shapes=f.shapes[:0]) for k, f in g.interfaces.items()}
            g = replace(g, phi=g.phi[:0], interfaces=faces)
        where = group.create_group(f"sample_{i}")
        where.attrs["rpm"], where.attrs["Omega"] = g.speed * 30 / np.pi, g.speed
        _write_group(where, g, axis, scales)


_ROW_FIELDS = {"excitation": "excitations", "monitor": "monitors", "gauge": "gauges"}


def _write_interfaces(group: h5py.Group, g: ModalGroup, scales: Scales) -> None:
    where, frames = group.create_group("interfaces"), group.file["interfaces"]
    for name, item in g.interfaces.items():
        frame = frames[escaped(name)]
        homes = {"shape": frame, "point": frame["patch"]}
        write(where.create_group(escaped(name)), item, scales, name, homes=homes)


def _write_state(group: h5py.Group, g: ModalGroup, axis: Array, scales: Scales) -> None:
    """Rotation and the static state the modes are taken about."""
    where = group.create_group("rotation")
    where.attrs["Omega"] = g.speed * axis
    where.attrs["prestress"] = g.prestress
    where.attrs["stress_stiffening"] = int(g.prestress in ("linear", "nonlinear"))
    where.attrs["spin_softening"] = int(g.spin_softening)
    where.attrs["gyroscopic"] = 0
    where.attrs["terms"] = "1: inside K_r and the modes; the gyroscopic term never is, it stands beside as G_r, and a "
    "circulatory one as N_r"
    if (known := _state_of_speed(group, g.u_static)) is None:
        write(group, g, scales, part="rotation/")
    else:
        where["u_static"] = known
    for name, s in sorted(g.stresses.items()):
        write(group, s, None, name, part="rotation/")


def _state_of_speed(group: h5py.Group, u: Array) -> h5py.Dataset | None:
    """The static displacement that another nodal diameter of the same speed has written, if it is this one."""
    beside = (h for h in group.parent.values() if isinstance(h, h5py.Group) and h.name != group.name)
    others = (h.get("rotation/u_static") for h in beside)
    return next((d for d in others if d is not None and np.array_equal(d[()], u)), None)


def _write_residual(group: h5py.Group, r: Residual, scales: Scales) -> None:
    where = group.create_group("residual")
    write(where, r, scales)
    for name, values in r.gauges.items():
        item = where.create_group(f"gauge/{escaped(name)}")
        item["row"] = group[f"gauge/{escaped(name)}/row"]
        put(item, "T", values, "1 per unit force", scales=[item["row"], where["force"]])
    for kind, unit in (("strain", "1"), ("stress", "Pa")):
        for name, values in sorted(getattr(r, kind).items()):
            item = where.create_group(f"{kind}/{name}")
            item["place"] = group[f"stress/{name}/place"]
            axes = [item["place"], scales["component"], where["force"]]
            put(item, "T", single(values), f"{unit} per unit force", scales=axes)


def _read_residual(where: h5py.Group, n: int, gauges: dict[str, Rows], sets: dict[str, StressSet]) -> Residual:
    r = len(where["force"])
    held = {kind: {k: array(where[kind], f"{k}/T", len(sets[k].weights), 6, r) for k in where.get(kind, ())}
            for kind in ("strain", "stress")}  # fmt: skip
    own = {k: array(where, f"gauge/{escaped(k)}/T", len(v.labels), r) for k, v in gauges.items()}
    return read(Residual, where, {"node": n}, gauges=own, **held)


_SHARED = tuple(f"stress/<name>/{field}" for field in ("points", "weights", "singular"))
"""What strain and stress of a set have in common."""


def _write_stress(group: h5py.Group, name: str, s: StressSet, scales: Scales) -> None:
    """Places and weights of both stand with the stress; the strain's group has links."""
    s = replace(s, strain=single(s.strain), stress=single(s.stress))
    stress, strain = (group.require_group(kind).create_group(name) for kind in ("stress", "strain"))
    for where in (stress, strain):
        where.attrs["location"] = s.location
        where.attrs["order"] = " ".join(VOIGT)
    strain.attrs["shear"] = "engineering"
    write(group, s, scales, name, part=_SHARED)
    for shared in ("place", "points", "weights", "singular"):
        if shared in stress:
            strain[shared] = stress[shared]
    write(group, s, {**scales, "place": stress["place"]}, name, part=("strain/", "stress/<name>/T"))


# reading ---------------------------------------------------------------------------------------------------------


class OtherFormat(UserError):
    """A sound HDF5 file that is no modal file. `form`: what its attribute 'format' says."""

    def __init__(self, form: object) -> None:
        super().__init__(f"is no modal file (its attribute 'format' is {form!r}, not '{FORMAT}')")
        self.form = form


@in_its_file
def open_file(path: Path | str) -> h5py.File:
    """Open a modal file for reading after looking at its seal, its format and the kind of its content.

    Raises:
        UserError: missing, damaged, foreign or of another major version.
    """
    path = Path(path)
    if not ordinary(path).is_file():
        raise UserError("no such modal file; make it first or correct the path")
    refuse_damaged(path, _TRIAL, AGAIN)
    return _open(path)


AGAIN = "make it again by microslip modes, or by the program that wrote it"

_TRIAL = "from microslip.basis.files import _open, _read; _read(_open(path))"


def _open(path: Path) -> h5py.File:
    try:
        file = h5py.File(path, "r")
    except DAMAGE as error:
        raise UserError(f"is damaged or no HDF5 file ({short(error)}); {AGAIN}") from error
    try:
        _accept(file)
    except BaseException:
        file.close()
        raise
    return file


def _accept(file: h5py.File) -> None:
    try:
        form, version = file.attrs.get("format"), file.attrs.get("format_version")
        known = form == FORMAT
    except DAMAGE as error:
        raise UserError(f"is damaged ({short(error)}); {AGAIN}") from error
    if not known:
        raise OtherFormat(form)
    if not isinstance(version, str) or version.split(".")[0] != FORMAT_VERSION.split(".")[0]:
        raise UserError(f"has format version {version}, this program reads {FORMAT_VERSION}; {AGAIN}")
    try:
        inspect(file)
    except DAMAGE as error:
        raise UserError(f"is damaged or no modal file ({short(error)}); {AGAIN}") from error


def sample() -> Path:
    """The modal file that travels with the package: a twisted steel vane, 8 x 40 x 160 mm.

    It has the interfaces ``right`` and ``left`` at its tip, the excitation ``magnet`` and the monitor ``probe``.
    """
    return Path(__file__).parents[1] / "samples" / "basis.h5"


@checked
@in_its_file
def read_basis(path: Path | str) -> ModalBasis:
    """Read a modal file.

    Raises:
        UserError: see `open_file`; a missing or misshapen part is named.
    """
    with open_file(path) as file:
        return _read_or_refuse(file)


def _read_or_refuse(file: h5py.File) -> ModalBasis:
    try:
        return _read(file)
    except DAMAGE as error:
        raise UserError(f"is damaged or incomplete ({short(error)}); {AGAIN}") from error


def _read(file: h5py.File) -> ModalBasis:
    sectors = int(file["cyclic"].attrs["N"])
    if sectors < 1:
        raise ValueError(f"/cyclic: its attribute N is {sectors}")
    mesh = _read_mesh(file["mesh"])
    groups = {}
    for name, where in file.items():
        if name.startswith("speed_"):
            for sub, group in where.items():
                if sub.startswith("nd_"):
                    key = int(name.removeprefix("speed_")), int(sub.removeprefix("nd_"))
                    groups[key] = _read_group(file, where, group, mesh)
    if not groups:
        raise ValueError("no speed group")
    ranges = {}
    for sub, group in file["range"].items() if "range" in file else ():
        ranges[int(sub.removeprefix("nd_"))] = _read_range(file, group, mesh)
    return read(
        ModalBasis, file, {}, mesh=mesh, groups=groups, ranges=ranges, sectors=sectors,
        **{key: str(file.attrs[key]) for key in ("name", "damping_source", "reduction")},
        free=bool(file.attrs["free"]), source=str(file.attrs.get("source", "elements")),
        provenance={k: str(v) for k, v in file["provenance"].attrs.items()}, **_cyclic_faces(file, sectors),
    )  # fmt: skip


def _cyclic_faces(file: h5py.File, sectors: int) -> dict[str, Any]:
    if sectors == 1:
        return {}
    return {"cyclic_faces": (str(file["cyclic"].attrs["left"]), str(file["cyclic"].attrs["right"]))}


def _read_mesh(group: h5py.Group) -> Mesh:
    node_id = indices(group, "node", None, np.iinfo(np.int64).max)
    n = len(node_id)
    if len(np.unique(node_id)) != n or len(group["xyz"]) != n:
        raise ValueError("/mesh/node does not number the points of /mesh/xyz, each once")
    known = {t: len(kind.reference) for t, kind in CELL_TYPES.items()}
    cells = {t: indices(group["cells"], t, known[t], n) for t in group["cells"]}
    faces, point_sets = {}, {}
    position = np.argsort(node_id)
    for link, where in group["groups"].items():
        name = unescaped(link)
        nodes = indices(where, "nodes", None, np.iinfo(np.int64).max)
        at = np.searchsorted(node_id, nodes, sorter=position)
        if len(nodes) and (at.max() >= n or (node_id[position[at]] != nodes).any()):
            raise ValueError(f"{where.name}/nodes names nodes that are not in /mesh/node")
        if where.attrs["point_set"]:
            point_sets[name] = position[at]
        if blocks := {t: indices(where, t, _FACET_NODES[t], n) for t in where if t in FACET_CORNERS}:
            faces[name] = blocks
    told: dict[str, Any] = {"cells": cells, "faces": faces, "point_sets": point_sets, "node_id": node_id}
    return read(Mesh, group, {"node": n}, **told, **_read_materials(group, cells))


def _read_group(file: h5py.File, where: h5py.Group, group: h5py.Group, mesh: Mesh) -> ModalGroup:
    modes, state, faces, n = group["modes"], group["rotation"], file["interfaces"], mesh.n_points
    sizes = {"node": n, "mode": len(modes["kind"]), "own_mode": len(modes["omega"])}

    def part(kind: type[Noun], name: str) -> Noun | None:
        return read(kind, group[name], sizes) if name in group else None

    rows = {field: read_each(Rows, group[kind], sizes) for kind, field in _ROW_FIELDS.items()}
    stresses = {name: read(StressSet, group, sizes, name) for name in group.get("stress", ())}
    return read(
        ModalGroup, group, sizes, speed=float(where.attrs["Omega"]), **rows, stresses=stresses,
        interfaces={k: read(Interface, group["interfaces"][escaped(k)], sizes, k) for k in names(faces)},
        compliance=read(Compliance, group, sizes),
        checks={name: float(real(group["checks"], name)) for name in group["checks"]},
        prestress=str(state.attrs["prestress"]), harmonic=int(group["cyclic"].attrs["harmonic"]),
        spin_softening=bool(state.attrs["spin_softening"]),
        run_up=part(RunUp, "run_up"), gyroscopic=part(GyroscopicModes, "gyroscopic"),
        invariants=part(Invariants, "invariants"),
        contacts=read_each(ContactState, group["contacts"], sizes) if "contacts" in group else {},
        residual=_read_residual(group["residual"], n, rows["gauges"], stresses) if "residual" in group else None,
    )  # fmt: skip


def _read_range(file: h5py.File, group: h5py.Group, mesh: Mesh) -> SpeedRange:
    samples: list[ModalGroup] = []
    for i in range(sum(name.startswith("sample_") for name in group)):
        where = group[f"sample_{i}"]
        g = _read_group(file, where, where, mesh)
        if samples:
            first = samples[0]
            faces = {k: replace(f, shapes=first.interfaces[k].shapes) for k, f in g.interfaces.items()}
            g = replace(g, phi=first.phi, interfaces=faces)
        samples.append(g)
    if len(samples) < 2:
        raise ValueError(f"{group.name} holds fewer than two samples")
    return read(SpeedRange, group, {"mode": samples[0].n_modes}, samples=tuple(samples))
