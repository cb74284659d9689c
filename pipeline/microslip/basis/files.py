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
    UserError,
)
from ..files.hdf5 import IMAGINARY, create, put, put_scale, seal, seal_state
from ..files.hostile import inspect, trial
from ..files.store import complete_or_absent, ordinary
from ..topology import CELL_TYPES, FACET_CORNERS
from .checks import TOLERANCES, Check, check_basis

__all__ = ["Check", "check_basis", "open_file", "read_basis", "write_basis"]

FORMAT = "microslip-modal-basis"
FORMAT_VERSION = "0.1"

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
_DAMAGE = (
    OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError, IndexError, OverflowError, MemoryError,
    NotImplementedError,
)  # fmt: skip
"""What h5py and numpy raise on content that is not what it should be."""


# writing ---------------------------------------------------------------------------------------------------------


def write_basis(path: Path | str, basis: ModalBasis) -> None:
    """Write a modal file, complete or absent.

    Raises:
        UserError: no permission, no space.
    """
    with complete_or_absent(path) as temporary:
        with create(temporary) as file:
            _write(file, basis)
        seal(temporary)


def _write(file: h5py.File, basis: ModalBasis) -> None:
    _write_root(file, basis)
    _write_mesh(file, basis.mesh)
    _write_frames(file, basis.groups[min(basis.groups)])
    for (speed, harmonic), group in sorted(basis.groups.items()):
        where = file.require_group(f"speed_{speed}")
        where.attrs["rpm"] = group.speed * 30 / np.pi
        where.attrs["Omega"] = group.speed
        _write_group(where.create_group(f"nd_{harmonic}"), group, basis.rotation_axis)
    for harmonic, found in sorted(basis.ranges.items()):
        _write_range(file.create_group(f"range/nd_{harmonic}"), found, basis.rotation_axis)


def _write_root(file: h5py.File, basis: ModalBasis) -> None:
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
    put_scale(file, "axis", np.array(["x", "y", "z"]))
    put_scale(file, "component", np.array(VOIGT))
    put_scale(file, "frame_axis", np.array(["n", "t1", "t2"]))
    put_scale(file, "interface_row", np.array(INTERFACE_ROWS))
    provenance = file.create_group("provenance")
    for key, value in sorted(basis.provenance.items()):
        provenance.attrs[key] = value.replace("\0", "")
    body = file.create_group("body")
    put(body, "mass", basis.mass, "kg")
    put(body, "centre", basis.centre, "m", scales=[file["axis"]])
    put(body, "inertia", basis.inertia, "kg m^2", ("axis", "axis_"))
    rotation = file.create_group("rotation")
    put(rotation, "direction", basis.rotation_axis, "1", scales=[file["axis"]])
    put(rotation, "point", basis.rotation_point, "m", scales=[file["axis"]])
    cyclic = file.create_group("cyclic")
    cyclic.attrs["N"] = basis.sectors
    cyclic.attrs["sector_angle"] = 2 * np.pi / basis.sectors
    cyclic.attrs["left"], cyclic.attrs["right"] = basis.cyclic_faces if basis.sectors > 1 else ("", "")


def _write_mesh(file: h5py.File, mesh: Mesh) -> None:
    group = file.create_group("mesh")
    ids = mesh.node_id if len(mesh.node_id) else np.arange(1, mesh.n_points + 1)
    node = put_scale(group, "node", ids)
    file["node"] = node  # the same dataset again, where every group below finds it
    put(group, "xyz", mesh.points, "m", scales=[node, file["axis"]])
    cells = group.create_group("cells")
    cells.attrs["order"] = "VTK node order, 0-based positions in /mesh/node"
    for cell_type, connectivity in sorted(mesh.cells.items()):
        put(cells, cell_type, connectivity, dims=("cell", "corner"))
    if mesh.materials:
        _write_materials(group, mesh)
    groups = group.create_group("groups")
    groups.attrs["order"] = "nodes: ids as in /mesh/node; facets: VTK node order, 0-based positions in /mesh/node"
    for name in sorted({*mesh.faces, *mesh.point_sets}):
        where = groups.create_group(_escaped(name))
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
    names = _texts(where, "name")
    k = len(names)
    numbers = (_array(where, "density", k), _array(where, "elasticity", k, 6, 6), _array(where, "expansion", k, 6))
    regions = {t: _indices(where["cells"], t, None, k) for t in where["cells"]}
    if {t: len(r) for t, r in regions.items()} != {t: len(c) for t, c in cells.items()}:
        raise ValueError("/mesh/materials/cells does not give every cell a material")
    materials = tuple(Material(float(d), C, a, None, n) for d, C, a, n in zip(*numbers, names, strict=True))
    return {"materials": materials, "regions": regions}


def _escaped(name: str) -> str:
    """A set's name as one HDF5 link name: no slash, not empty, not a dot alone."""
    text = name.replace("%", "%25").replace("/", "%2F").replace("\0", "%00")
    return "%2E" if text == "." else text or "%"


def _unescaped(name: str) -> str:
    text = name.replace("%2E", ".").replace("%2F", "/").replace("%00", "\0").replace("%25", "%")
    return "" if name == "%" else text


def _write_frames(file: h5py.File, group: ModalGroup) -> None:
    """Frames and patches do not depend on speed: they stand at the root."""
    where = file.create_group("interfaces")
    where.attrs["order"] = json.dumps(list(group.interfaces))
    for name, item in group.interfaces.items():
        face = where.create_group(_escaped(name))
        for key in ("role", "partner", "sector_shift"):
            face.attrs[key] = getattr(item, key)
        put(face, "origin", item.origin, "m", scales=[file["axis"]])
        put(face, "rotation", item.rotation, "1", scales=[file["frame_axis"], file["axis"]])
        patch = face.create_group("patch")
        patch.attrs["b0"], patch.attrs["h0"] = item.extent
        if len(item.polygon):
            corner = put_scale(patch, "corner", np.arange(1, len(item.polygon) + 1))
            put(patch, "polygon", item.polygon, "m", scales=[corner, file["axis"]])
        point = put_scale(patch, "point", np.arange(1, len(item.points) + 1))
        put(patch, "points", item.points, "m", scales=[point, file["axis"]])
        put(patch, "areas", item.areas, "m^2", scales=[point])
        put(patch, "normals", item.normals, "1", scales=[point, file["axis"]])
        if len(item.characteristic):
            shape = put_scale(face, "shape", np.arange(1, len(item.characteristic) + 1))
            patch["shape"] = shape
            put(patch, "pattern", item.pattern, "1", scales=[point, file["axis"], shape])


def _write_group(group: h5py.Group, g: ModalGroup, axis: Array) -> None:
    file = group.file
    modes = group.create_group("modes")
    mode = put_scale(modes, "mode", np.arange(1, g.n_modes + 1))
    column = put_scale(modes, "mode_column", np.arange(1, g.n_modes + 1))
    group["mode"], group["mode_column"] = mode, column  # where run_up and gyroscopic find them
    fewer = len(g.omega) < g.n_modes
    own = put_scale(modes, "own_mode", np.arange(1, len(g.omega) + 1)) if fewer else mode
    for name, data, unit in (
        ("omega", g.omega, "rad/s"),
        ("frequency", g.frequency, "Hz"),
        ("damping_ratio", g.damping_ratio, "1"),
    ):
        put(modes, name, data, unit, scales=[own])
    put(modes, "kind", np.array(g.kind, dtype="U"), scales=[mode])
    for name, unit in (("M_r", "1"), ("K_r", "s^-2"), ("C_r", "s^-1"), ("G_r", "s^-1")):
        put(modes, name, getattr(g, name), unit, scales=[mode, column])
    if g.to_diagonal is not None:
        put(modes, "to_diagonal", g.to_diagonal, "1", scales=[mode, own if fewer else column])
    if g.phi.shape[0]:
        put(modes, "phi", g.phi, "kg^-1/2", scales=[file["node"], file["axis"], mode])
    cyclic = group.create_group("cyclic")
    cyclic.attrs["harmonic"], cyclic.attrs["real"] = g.harmonic, int(not np.iscomplexobj(g.phi))
    _write_rows(group, g, mode)
    labels = np.array(g.compliance.labels, dtype="U")
    row, col = (put_scale(group, f"compliance_{k}", labels) for k in ("row", "column"))
    unit = "displacement of the row per unit force of the column, SI"
    for name in ("static", "modal", "plain"):
        put(group, f"compliance_{name}", getattr(g.compliance, name), unit, scales=[row, col])
    group["compliance_static"].attrs["inertia_relief"] = int(g.compliance.inertia_relief)
    for name, s in sorted(g.stresses.items()):
        _write_stress(group, name, s, mode)
    _write_state(group, g, axis)
    if g.contacts:
        _write_contacts(group, g)
    if g.residual is not None:
        _write_residual(group, g.residual)
    if g.run_up is not None:
        _write_run_up(group, g.run_up, mode, column)
    if g.gyroscopic is not None:
        _write_gyroscopic(group, g.gyroscopic, mode)
    if g.invariants is not None:
        _write_invariants(group, g.invariants)
    checks = group.create_group("checks")
    for name, value in sorted(g.checks.items()):
        put(checks, name, value).attrs["tolerance"] = TOLERANCES.get(name, np.nan)


_RANGE_ERRORS = ("interpolation_error", "projection_error", "total_error")


def _write_range(group: h5py.Group, r: SpeedRange, axis: Array) -> None:
    """The samples as groups like any other; what they share, phi and patch shapes, stands in the first alone."""
    group.attrs["form"], group.attrs["count"], group.attrs["signs"] = r.form, r.count, r.signs
    group.attrs["shift"] = np.nan if r.shift is None else r.shift
    group.attrs["tolerance"], group.attrs["gyroscopic"] = r.tolerance, int(r.gyroscopic)
    for name in ("solved", "held"):
        put(group, name, getattr(r, name).astype(np.int64), dims=("sample",))
    put(group, "slopes", r.slopes, "1", dims=("used", "mode", "mode_column"))
    put(group, "lead", r.lead, dims=("lead", "mode"))
    put(group, "points", r.points, "rad/s", dims=("point",))
    for name in _RANGE_ERRORS:
        put(group, name, getattr(r, name), "1", dims=("held_out",))
    for i, g in enumerate(r.samples):
        if i:
            faces = {k: replace(f, shapes=f.shapes[:0]) for k, f in g.interfaces.items()}
            g = replace(g, phi=g.phi[:0], interfaces=faces)
        where = group.create_group(f"sample_{i}")
        where.attrs["rpm"], where.attrs["Omega"] = g.speed * 30 / np.pi, g.speed
        _write_group(where, g, axis)


_ROW_FIELDS = {"excitation": "excitations", "monitor": "monitors", "gauge": "gauges"}


def _write_rows(group: h5py.Group, g: ModalGroup, mode: h5py.Dataset) -> None:
    file = group.file
    interfaces = group.create_group("interfaces")
    for name, item in g.interfaces.items():
        face = interfaces.create_group(_escaped(name))
        put(face, "T", item.rows, "kg^-1/2; last three m^-1 kg^-1/2", scales=[file["interface_row"], mode])
        put(face, "fit_residual", item.fit_residual, "1", scales=[mode])
        if len(item.characteristic):
            face["shape"] = file[f"interfaces/{_escaped(name)}/shape"]
            put(face, "characteristic", item.characteristic, "kg^-1/2", scales=[face["shape"], mode])
        if item.shapes.shape[0]:
            patch = face.create_group("patch")
            patch["point"] = file[f"interfaces/{_escaped(name)}/patch/point"]
            put(patch, "shapes", item.shapes, "kg^-1/2", scales=[patch["point"], file["axis"], mode])
    for kind, field in _ROW_FIELDS.items():
        where = group.create_group(kind)
        where.attrs["order"] = json.dumps(list(getattr(g, field)))
        for name, rows in getattr(g, field).items():
            item = where.create_group(_escaped(name))
            item.attrs["unit"] = rows.unit
            item.attrs["distance"] = rows.distance
            row = put_scale(item, "row", np.array(rows.labels, dtype="U"))
            put(item, "point", rows.point, "m", scales=[file["axis"]])
            put(item, "static", rows.static, rows.unit, scales=[row])
            put(item, "T", rows.rows, scales=[row, mode])


def _write_state(group: h5py.Group, g: ModalGroup, axis: Array) -> None:
    """Rotation and the static state the modes are taken about."""
    file = group.file
    where = group.create_group("rotation")
    where.attrs["Omega"] = g.speed * axis
    where.attrs["prestress"] = g.prestress
    where.attrs["stress_stiffening"] = int(g.prestress in ("linear", "nonlinear"))
    where.attrs["spin_softening"] = int(g.spin_softening)
    where.attrs["gyroscopic"] = 0
    where.attrs["terms"] = "1: inside K_r and the modes; the gyroscopic term never is, it stands beside as G_r"
    put(where, "u_static", g.u_static, "m", scales=[file["node"], file["axis"]])
    for name, s in sorted(g.stresses.items()):
        put(where.require_group("sigma_static"), name, s.static_stress, "Pa", ("place", "component"))


def _write_run_up(group: h5py.Group, r: RunUp, mode: h5py.Dataset, column: h5py.Dataset) -> None:
    where = group.create_group("run_up")
    put(where, "N", r.N, "1", scales=[mode, column])
    put(where, "P", r.P, "1", scales=[mode, column])
    put(where, "euler", r.euler, "kg^1/2 m", scales=[mode])
    put(where, "centrifugal", r.centrifugal, "kg^1/2 m", scales=[mode])


def _write_invariants(group: h5py.Group, i: Invariants) -> None:
    where = group.create_group("invariants")
    pair = ("axis", "axis_")
    put(where, "point", i.point, "m", ("axis",))
    put(where, "mass", i.mass, "kg")
    put(where, "first_moment", i.first_moment, "kg m", ("axis",))
    put(where, "second_moment", i.second_moment, "kg m^2", pair)
    put(where, "shape", i.shape, "kg^1/2", ("axis", "mode"))
    put(where, "position_shape", i.position_shape, "kg^1/2 m", (*pair, "mode"))
    put(where, "shape_shape", i.shape_shape, "1", (*pair, "mode", "mode_column"))
    if len(i.stiffening):
        motion = put(where, "stiffening", i.stiffening, "per unit of the motion", ("motion", "mode", "mode_column"))
        motion.attrs["motions"] = " ".join(MOTIONS)


def _write_gyroscopic(group: h5py.Group, modes: GyroscopicModes, mode: h5py.Dataset) -> None:
    where = group.create_group("gyroscopic")
    where.attrs["stable"] = int(modes.stable)
    where.attrs["frame"] = "turns with the body; q = shapes exp(i omega t); forward: with the rotation"
    whirl = put_scale(where, "whirl", np.arange(1, len(modes.omega) + 1))
    put(where, "omega", modes.omega, "rad/s", scales=[whirl])
    put(where, "frequency", modes.frequency, "Hz", scales=[whirl])
    put(where, "growth", modes.growth, "s^-1", scales=[whirl])
    put(where, "sense", modes.sense, "1", scales=[whirl])
    put(where, "direction", np.array(modes.direction, dtype="U"), scales=[whirl])
    put(where, "error", modes.error, "1", scales=[whirl])
    put(where, "shapes", modes.shapes, "1", scales=[mode, whirl])


def _write_residual(group: h5py.Group, r: Residual) -> None:
    file, where = group.file, group.create_group("residual")
    force = put_scale(where, "force", np.array(r.labels, dtype="U"))
    if r.phi.shape[0]:
        put(where, "phi", r.phi, "m per unit force", scales=[file["node"], file["axis"], force])
    for name, values in r.gauges.items():
        item = where.create_group(f"gauge/{_escaped(name)}")
        item["row"] = group[f"gauge/{_escaped(name)}/row"]
        put(item, "T", values, "1 per unit force", scales=[item["row"], force])
    for kind, unit in (("strain", "1"), ("stress", "Pa")):
        for name, values in sorted(getattr(r, kind).items()):
            item = where.create_group(f"{kind}/{name}")
            item["place"] = group[f"stress/{name}/place"]
            put(item, "T", values, f"{unit} per unit force", scales=[item["place"], file["component"], force])


def _read_residual(where: h5py.Group, n: int, gauges: dict[str, Rows], sets: dict[str, StressSet]) -> Residual:
    labels = _texts(where, "force")
    r = len(labels)
    held = [{k: _array(where[kind], f"{k}/T", len(sets[k].weights), 6, r) for k in where.get(kind, ())}
            for kind in ("strain", "stress")]  # fmt: skip
    return Residual(
        labels, _array(where, "phi", n, 3, r) if "phi" in where else np.zeros((0, 3, r)),
        {k: _array(where, f"gauge/{_escaped(k)}/T", len(v.labels), r) for k, v in gauges.items()}, *held,
    )  # fmt: skip


_CONTACT_NUMBERS = {
    "normal_force": "N", "closed_share": "1", "penetration": "m", "penalty": "Pa/m", "interference": "m",
}  # fmt: skip
_CONTACT_FIELDS = {"pressure": "Pa", "gap": "m", "areas": "m^2"}
_CONTACT_TEXTS = ("face", "against", "interface", "modes")


def _write_contacts(group: h5py.Group, g: ModalGroup) -> None:
    """Closures of the static state."""
    axis, where = group.file["axis"], group.create_group("contacts")
    where.attrs["order"] = json.dumps(list(g.contacts))
    for name, c in g.contacts.items():
        item = where.create_group(_escaped(name))
        for key in (*_CONTACT_TEXTS, "sector_shift"):
            item.attrs[key] = getattr(c, key)
        for key, unit in _CONTACT_NUMBERS.items():
            put(item, key, getattr(c, key), unit)
        put(item, "force", c.force, "N", scales=[axis])
        put(item, "centre", c.centre, "m", scales=[axis])
        point = put_scale(item, "point", np.arange(1, len(c.points) + 1))
        put(item, "points", c.points, "m", scales=[point, axis])
        for key, unit in _CONTACT_FIELDS.items():
            put(item, key, getattr(c, key), unit, scales=[point])


def _read_contacts(where: h5py.Group) -> dict[str, ContactState]:
    out = {}
    for name in _names(where):
        item = where[_escaped(name)]
        p = len(item["areas"])
        values: dict[str, Any] = {key: str(item.attrs[key]) for key in _CONTACT_TEXTS}
        values |= {key: float(_array(item, key)) for key in _CONTACT_NUMBERS}
        values |= {key: _array(item, key, p) for key in _CONTACT_FIELDS}
        values |= {key: _array(item, key, 3) for key in ("force", "centre")}
        out[name] = ContactState(
            sector_shift=int(item.attrs["sector_shift"]), points=_array(item, "points", p, 3), **values
        )
    return out


def _write_stress(group: h5py.Group, name: str, s: StressSet, mode: h5py.Dataset) -> None:
    file = group.file
    stress, strain = (group.require_group(kind).create_group(name) for kind in ("stress", "strain"))
    for where in (stress, strain):
        where.attrs["location"] = s.location
        where.attrs["order"] = " ".join(VOIGT)
    strain.attrs["shear"] = "engineering"
    place = put_scale(stress, "place", np.arange(1, len(s.points) + 1))
    put(stress, "points", s.points, "m", scales=[place, file["axis"]])
    put(stress, "weights", s.weights, "m^3", scales=[place])
    for shared in ("place", "points", "weights"):
        strain[shared] = stress[shared]
    put(strain, "T", s.strain, "m^-1 kg^-1/2", scales=[place, file["component"], mode])
    put(stress, "T", s.stress, "Pa m^-1 kg^-1/2", scales=[place, file["component"], mode])


# reading ---------------------------------------------------------------------------------------------------------


class OtherFormat(UserError):
    """A sound HDF5 file that is no modal file. `form`: what its attribute 'format' says."""

    def __init__(self, path: Path, form: object) -> None:
        super().__init__(f"{path}: is no modal file (its attribute 'format' is {form!r}, not '{FORMAT}')")
        self.form = form


def open_file(path: Path | str) -> h5py.File:
    """Open a modal file for reading after looking at its seal, its format and the kind of its content.

    A file without a seal, one that another program has written or changed, is first read by a process of its own:
    damaged HDF5 can hang the library or crash it.

    Raises:
        UserError: missing, damaged, foreign or of another major version.
    """
    path = Path(path)
    if not ordinary(path).is_file():
        raise UserError(f"{path}: no such modal file; make it first or correct the path")
    try:
        state = seal_state(path)
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror}); correct the path or its rights") from error
    if state == "broken":
        raise UserError(f"{path}: is damaged (its bytes are not those it was sealed with); write it again")
    if not h5py.is_hdf5(path):
        raise UserError(f"{path}: is damaged or no HDF5 file; write it again")
    if state == "absent" and (trouble := trial(_TRIAL, path)):
        raise UserError(f"{path}: is damaged (HDF5 {trouble} on it); write it again")
    return _open(path)


_TRIAL = "from microslip.basis.files import _open, _read; _read(_open(path))"


def _open(path: Path) -> h5py.File:
    try:
        file = h5py.File(path, "r")
    except _DAMAGE as error:
        raise UserError(f"{path}: is damaged or no HDF5 file ({_short(error)}); write it again") from error
    try:
        _accept(file, path)
    except BaseException:
        file.close()
        raise
    return file


def _accept(file: h5py.File, path: Path) -> None:
    try:
        form, version = file.attrs.get("format"), file.attrs.get("format_version")
        known = form == FORMAT
    except _DAMAGE as error:
        raise UserError(f"{path}: is damaged ({_short(error)}); write it again") from error
    if not known:
        raise OtherFormat(path, form)
    if not isinstance(version, str) or version.split(".")[0] != FORMAT_VERSION.split(".")[0]:
        raise UserError(f"{path}: has format version {version}, this program reads {FORMAT_VERSION}; write it again")
    try:
        inspect(file)
    except (*_DAMAGE, RecursionError) as error:
        raise UserError(f"{path}: is damaged or no modal file ({_short(error)}); write it again") from error


def _short(error: BaseException) -> str:
    return " ".join((str(error).splitlines() or ["unreadable"])[0].split())[:120]


def read_basis(path: Path | str) -> ModalBasis:
    """Read a modal file.

    Raises:
        UserError: see `open_file`; a missing or misshapen part is named.
    """
    with open_file(path) as file:
        return _read_or_refuse(file, Path(path))


def _read_or_refuse(file: h5py.File, path: Path) -> ModalBasis:
    try:
        return _read(file)
    except (*_DAMAGE, RecursionError) as error:
        raise UserError(f"{path}: is damaged or incomplete ({_short(error)}); write it again") from error


def _array(group: h5py.Group, name: str, *shape: int | None) -> Array:
    """Numbers of the given shape (None: any length).

    Raises:
        ValueError: another shape or type.
    """
    dataset = group[name]
    found = getattr(dataset, "shape", None)
    if found is None or len(found) != len(shape) or any(b not in (None, a) for a, b in zip(found, shape, strict=True)):
        wanted = " x ".join("any" if n is None else str(n) for n in shape) or "one number"
        raise ValueError(f"{group.name}/{name} has shape {found}, expected {wanted}")
    if dataset.dtype.kind != "f":
        raise ValueError(f"{group.name}/{name} does not hold floating-point numbers")
    real = np.asarray(dataset[()], dtype=np.float64)
    if not name.endswith(IMAGINARY) and name + IMAGINARY in group:
        both = real.astype(np.complex128)  # parts put in one by one keep the signs of zeros
        both.imag = _array(group, name + IMAGINARY, *shape)
        return both
    return real


def _indices(group: h5py.Group, name: str, columns: int | None, limit: int) -> Indices:
    """Positions below `limit`: (any, columns), or (any,) without columns."""
    dataset = group[name]
    shape = getattr(dataset, "shape", ())
    if dataset.dtype.kind not in "iu" or shape[1:] != (() if columns is None else (columns,)) or not shape:
        raise ValueError(f"{group.name}/{name} holds no table of {columns or 1} whole numbers")
    values = np.asarray(dataset[()]).astype(np.int64)
    if values.size and (values.min() < 0 or values.max() >= limit):
        raise ValueError(f"{group.name}/{name} refers to nodes that do not exist")
    return values


def _texts(group: h5py.Group, name: str, count: int | None = None) -> tuple[str, ...]:
    values = tuple(v.decode() for v in np.asarray(group[name]).ravel())
    if count is not None and len(values) != count:
        raise ValueError(f"{group.name}/{name} has {len(values)} entries, expected {count}")
    return values


def _names(group: h5py.Group) -> list[str]:
    """The names of a group's members in their order of precedence."""
    names = json.loads(str(group.attrs["order"]))
    if not isinstance(names, list) or sorted(_escaped(str(n)) for n in names) != sorted(group):
        raise ValueError(f"{group.name}: its attribute 'order' does not list its members")
    return names


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
    return ModalBasis(
        name=str(file.attrs["name"]), mesh=mesh, groups=groups, mass=float(_array(file, "body/mass")),
        centre=_array(file, "body/centre", 3), inertia=_array(file, "body/inertia", 3, 3),
        rotation_axis=_array(file, "rotation/direction", 3), rotation_point=_array(file, "rotation/point", 3),
        damping_source=str(file.attrs["damping_source"]),
        free=bool(file.attrs["free"]), reduction=str(file.attrs["reduction"]),
        provenance={k: str(v) for k, v in file["provenance"].attrs.items()}, sectors=sectors, ranges=ranges,
        source=str(file.attrs.get("source", "elements")),
        **_cyclic_faces(file, sectors),
    )  # fmt: skip


def _cyclic_faces(file: h5py.File, sectors: int) -> dict[str, Any]:
    if sectors == 1:
        return {}
    return {"cyclic_faces": (str(file["cyclic"].attrs["left"]), str(file["cyclic"].attrs["right"]))}


def _read_mesh(group: h5py.Group) -> Mesh:
    points = _array(group, "xyz", None, 3)
    n = len(points)
    node_id = _indices(group, "node", None, np.iinfo(np.int64).max)
    if len(np.unique(node_id)) != n or len(node_id) != n:
        raise ValueError("/mesh/node does not number the points of /mesh/xyz, each once")
    known = {t: len(kind.reference) for t, kind in CELL_TYPES.items()}
    cells = {t: _indices(group["cells"], t, known[t], n) for t in group["cells"]}
    faces, point_sets = {}, {}
    position = np.argsort(node_id)
    for link, where in group["groups"].items():
        name = _unescaped(link)
        nodes = _indices(where, "nodes", None, np.iinfo(np.int64).max)
        at = np.searchsorted(node_id, nodes, sorter=position)
        if len(nodes) and (at.max() >= n or (node_id[position[at]] != nodes).any()):
            raise ValueError(f"{where.name}/nodes names nodes that are not in /mesh/node")
        if where.attrs["point_set"]:
            point_sets[name] = position[at]
        if blocks := {t: _indices(where, t, _FACET_NODES[t], n) for t in where if t in FACET_CORNERS}:
            faces[name] = blocks
    return Mesh(points, cells, faces, point_sets, node_id, **_read_materials(group, cells))


def _read_group(file: h5py.File, where: h5py.Group, group: h5py.Group, mesh: Mesh) -> ModalGroup:
    modes = group["modes"]
    omega = _array(modes, "omega", None)
    kind = _texts(modes, "kind")
    p, m, n = len(omega), len(kind), mesh.n_points
    if not np.allclose(_array(modes, "frequency", p) * 2 * np.pi, omega, rtol=1e-12, atol=0, equal_nan=True):
        raise ValueError(f"{modes.name}/frequency is not omega / (2 pi)")
    state = group["rotation"]
    labels = _texts(group, "compliance_row")
    r = len(labels)
    gauges = _read_rows(group["gauge"], m)
    stresses = {name: _read_stress(group, name, m) for name in group["stress"]} if "stress" in group else {}
    return ModalGroup(
        speed=float(where.attrs["Omega"]), omega=omega, kind=kind,
        damping_ratio=_array(modes, "damping_ratio", p), M_r=_array(modes, "M_r", m, m), K_r=_array(modes, "K_r", m, m),
        C_r=_array(modes, "C_r", m, m), G_r=_array(modes, "G_r", m, m),
        to_diagonal=_array(modes, "to_diagonal", m, p) if "to_diagonal" in modes else None,
        phi=_array(modes, "phi", n, 3, m) if "phi" in modes else np.zeros((0, 3, m)),
        interfaces={
            name: _read_interface(file["interfaces"][_escaped(name)], group["interfaces"][_escaped(name)], m)
            for name in _names(file["interfaces"])
        },
        excitations=_read_rows(group["excitation"], m), monitors=_read_rows(group["monitor"], m),
        gauges=gauges,
        compliance=Compliance(
            labels, _array(group, "compliance_static", r, r), _array(group, "compliance_modal", r, r),
            bool(group["compliance_static"].attrs["inertia_relief"]),
            _array(group, "compliance_plain", r, r),
        ),
        stresses=stresses,
        u_static=_array(state, "u_static", n, 3),
        checks={name: float(_array(group["checks"], name)) for name in group["checks"]},
        prestress=str(state.attrs["prestress"]), harmonic=int(group["cyclic"].attrs["harmonic"]),
        spin_softening=bool(state.attrs["spin_softening"]),
        run_up=_read_run_up(group["run_up"], m) if "run_up" in group else None,
        gyroscopic=_read_gyroscopic(group["gyroscopic"], m) if "gyroscopic" in group else None,
        invariants=_read_invariants(group["invariants"], m) if "invariants" in group else None,
        contacts=_read_contacts(group["contacts"]) if "contacts" in group else {},
        residual=_read_residual(group["residual"], n, gauges, stresses) if "residual" in group else None,
    )  # fmt: skip


def _read_run_up(where: h5py.Group, m: int) -> RunUp:
    return RunUp(
        _array(where, "N", m, m), _array(where, "P", m, m), _array(where, "euler", m), _array(where, "centrifugal", m)
    )


def _read_invariants(where: h5py.Group, m: int) -> Invariants:
    return Invariants(
        _array(where, "point", 3), float(_array(where, "mass")), _array(where, "first_moment", 3),
        _array(where, "second_moment", 3, 3), _array(where, "shape", 3, m), _array(where, "position_shape", 3, 3, m),
        _array(where, "shape_shape", 3, 3, m, m),
        _array(where, "stiffening", len(MOTIONS), m, m) if "stiffening" in where else np.zeros((0, m, m)),
    )  # fmt: skip


def _read_gyroscopic(where: h5py.Group, m: int) -> GyroscopicModes:
    omega = _array(where, "omega", None)
    w = len(omega)
    return GyroscopicModes(
        omega, _array(where, "shapes", m, w).astype(complex), _array(where, "growth", w), _array(where, "sense", w),
        _texts(where, "direction", w), _array(where, "error", w),
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
    c, h, shift = samples[0].n_modes, len(group["total_error"]), float(group.attrs["shift"])
    return SpeedRange(
        samples=tuple(samples), form=str(group.attrs["form"]), slopes=_array(group, "slopes", None, c, c),
        **{name: np.asarray(group[name][()]).astype(bool) for name in ("solved", "held")},
        shift=None if np.isnan(shift) else shift, count=int(group.attrs["count"]),
        lead=_array(group, "lead", None, c), signs=int(group.attrs["signs"]),
        tolerance=float(group.attrs["tolerance"]), gyroscopic=bool(group.attrs["gyroscopic"]),
        points=_array(group, "points", None), **{name: _array(group, name, h) for name in _RANGE_ERRORS},
    )  # fmt: skip


def _read_interface(frame: h5py.Group, group: h5py.Group, m: int) -> Interface:
    p = len(frame["patch/areas"])
    return Interface(
        _array(frame, "origin", 3), _array(frame, "rotation", 3, 3), _array(group, "T", 6, m),
        _array(group, "fit_residual", m), _array(frame, "patch/points", p, 3), _array(frame, "patch/areas", p),
        _array(frame, "patch/normals", p, 3),
        _array(group, "patch/shapes", p, 3, m) if "patch/shapes" in group else np.zeros((0, 3, m)),
        str(frame.attrs["role"]), str(frame.attrs["partner"]), int(frame.attrs["sector_shift"]),
        np.array([float(frame["patch"].attrs[k]) for k in ("b0", "h0")]),
        _array(frame, "patch/polygon", None, 3) if "patch/polygon" in frame else np.zeros((0, 3)),
        _array(group, "characteristic", None, m) if "characteristic" in group else np.zeros((0, m)),
        _array(frame, "patch/pattern", p, 3, None) if "characteristic" in group else np.zeros((0, 3, 0)),
    )  # fmt: skip


def _read_rows(where: h5py.Group, m: int) -> dict[str, Rows]:
    out = {}
    for name in _names(where):
        item = where[_escaped(name)]
        labels = _texts(item, "row")
        r = len(labels)
        out[name] = Rows(
            _array(item, "T", r, m), labels, str(item.attrs["unit"]), _array(item, "point", 3),
            float(item.attrs["distance"]), _array(item, "static", r),
        )  # fmt: skip
    return out


def _read_stress(group: h5py.Group, name: str, m: int) -> StressSet:
    stress, strain = group[f"stress/{name}"], group[f"strain/{name}"]
    s = len(stress["weights"])
    return StressSet(
        str(stress.attrs["location"]), _array(stress, "points", s, 3), _array(strain, "T", s, 6, m),
        _array(stress, "T", s, 6, m), _array(group, f"rotation/sigma_static/{name}", s, 6),
        _array(stress, "weights", s),
    )  # fmt: skip
