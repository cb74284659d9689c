"""The modal file: one HDF5 file per body. `write_basis`, `read_basis`, `check_basis`.

The layout is documented in ``docs/modal_file.md``. Everything is SI. Datasets are named and their dimensions too
(HDF5 dimension scales), so that xarray shows ``phi (node, axis, mode)``; MATLAB and Octave see them reversed.
Same inputs give the same bytes: nothing volatile is written.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from .data import (
    VOIGT,
    Array,
    Compliance,
    Interface,
    Mesh,
    ModalBasis,
    ModalGroup,
    Rows,
    StressSet,
    UserError,
)
from .store import complete_or_absent

FORMAT = "microslip-modal-basis"
FORMAT_VERSION = "0.1"

TOLERANCES = {
    "orthogonality": 1e-9,
    "backward_error": 1e-9,
    "mass_error": 1e-8,
    "certified": 1.0,
}
"""Limits the solver's numbers are held to by `check_basis` (``certified`` must be 1)."""

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
    "interface_rows": "u_n u_t1 u_t2 phi_n phi_t1 phi_t2 in the interface frame",
    "dimensions": "C order; MATLAB and Octave see the dimensions reversed",
}


def write_basis(path: Path | str, basis: ModalBasis) -> None:
    """Write a modal file, complete or absent.

    Raises:
        UserError: no permission, no space.
    """
    with complete_or_absent(path) as temporary, h5py.File(temporary, "w", libver=("earliest", "v110")) as file:
        _write_root(file, basis)
        _write_mesh(file, basis.mesh)
        node = file["mesh/node"]
        for (speed, harmonic), group in sorted(basis.groups.items()):
            where = file.require_group(f"speed_{speed}")
            where.attrs["rpm"] = group.speed * 30 / np.pi
            where.attrs["omega"] = group.speed
            _write_group(where.create_group(f"nd_{harmonic}"), group, node, basis.rotation_axis)
        first = basis.groups[min(basis.groups)]
        _write_frames(file, first)


def _put(group: h5py.Group, name: str, data: Any, unit: str = "", dims: tuple[str, ...] = ()) -> h5py.Dataset:
    data = np.asarray(data)
    if data.dtype.kind == "U":
        data = np.char.encode(data, "utf-8") if data.size else data.astype("S1")
    dataset = group.create_dataset(name, data=data, track_times=False)
    if unit:
        dataset.attrs["unit"] = unit
    for i, label in enumerate(dims):
        dataset.dims[i].label = label
    return dataset


def _scale(group: h5py.Group, name: str, data: Any) -> h5py.Dataset:
    scale = _put(group, name, data)
    scale.make_scale(name)
    return scale


def _attach(dataset: h5py.Dataset, scales: Mapping[int, h5py.Dataset]) -> None:
    for axis, scale in scales.items():
        dataset.dims[axis].attach_scale(scale)


def _write_root(file: h5py.File, basis: ModalBasis) -> None:
    file.attrs["format"] = FORMAT
    file.attrs["format_version"] = FORMAT_VERSION
    file.attrs["name"] = basis.name
    file.attrs["units"] = "SI: m, kg, s, N, rad, Pa"
    file.attrs["frame"] = "A: right-handed body axes of the mesh; see body.toml for where origin and axes lie"
    file.attrs["conventions"] = json.dumps(CONVENTIONS)
    file.attrs["reduction"] = basis.reduction
    file.attrs["free"] = basis.free
    file.attrs["damping_source"] = basis.damping_source
    provenance = file.create_group("provenance")
    for key, value in sorted(basis.provenance.items()):
        provenance.attrs[key] = value
    body = file.create_group("body")
    _put(body, "mass", basis.mass, "kg")
    _put(body, "centre", basis.centre, "m")
    _put(body, "inertia", basis.inertia, "kg m^2")
    rotation = file.create_group("rotation")
    _put(rotation, "axis", basis.rotation_axis, "1")
    _put(rotation, "point", basis.rotation_point, "m")


def _write_mesh(file: h5py.File, mesh: Mesh) -> None:
    group = file.create_group("mesh")
    ids = mesh.node_id if len(mesh.node_id) else np.arange(1, mesh.n_points + 1)
    node = _scale(group, "node", ids)
    _attach(_put(group, "xyz", mesh.points, "m", ("node", "axis")), {0: node})
    cells = group.create_group("cells")
    cells.attrs["order"] = "VTK node order, 0-based positions in /mesh/node"
    for cell_type, connectivity in sorted(mesh.cells.items()):
        _put(cells, cell_type, connectivity, dims=("cell", "corner"))
    faces = group.create_group("groups")
    for name, blocks in sorted(mesh.faces.items()):
        face = faces.create_group(name)
        for facet_type, facets in sorted(blocks.items()):
            _put(face, facet_type, facets, dims=("facet", "corner"))
    sets = group.create_group("point_sets")
    for name, chosen in sorted(mesh.point_sets.items()):
        _put(sets, name, chosen)


def _write_frames(file: h5py.File, group: ModalGroup) -> None:
    """Frames and patches do not depend on speed: they stand at the root."""
    where = file.create_group("interfaces")
    where.attrs["order"] = json.dumps(list(group.interfaces))
    for name, item in group.interfaces.items():
        face = where.create_group(name)
        face.attrs["role"], face.attrs["partner"], face.attrs["sector_shift"] = item.role, item.partner, item.sector_shift
        _put(face, "origin", item.origin, "m")
        _put(face, "rotation", item.rotation, "1", ("n_t1_t2", "axis"))
        patch = face.create_group("patch")
        _put(patch, "points", item.points, "m", ("point", "axis"))
        _put(patch, "areas", item.areas, "m^2", ("point",))
        _put(patch, "normals", item.normals, "1", ("point", "axis"))


def _write_group(group: h5py.Group, g: ModalGroup, node: h5py.Dataset, axis: Array) -> None:
    modes = group.create_group("modes")
    mode = _scale(modes, "mode", np.arange(1, g.n_modes + 1))
    for name, data, unit in (
        ("omega", g.omega, "rad/s"),
        ("frequency", g.frequency, "Hz"),
        ("damping_ratio", g.damping_ratio, "1"),
        ("kind", np.array(g.kind, dtype="U"), ""),
    ):
        _attach(_put(modes, name, data, unit, ("mode",)), {0: mode})
    for name in ("M_r", "K_r", "C_r", "G_r"):
        _put(modes, name, getattr(g, name), dims=("mode", "mode_"))
    if g.phi.shape[0]:
        _attach(_put(modes, "phi", g.phi, "kg^-1/2", ("node", "axis", "mode")), {0: node, 2: mode})
    group.attrs["harmonic"] = g.harmonic
    _write_rows(group, g, mode)
    row = _scale(group, "compliance_row", np.array(g.compliance.labels, dtype="U"))
    for name, matrix in (("compliance_static", g.compliance.static), ("compliance_modal", g.compliance.modal)):
        where = _put(group, name, matrix, "displacement of the row per unit force of the column, SI", ("row", "column"))
        _attach(where, {0: row, 1: row})
    group["compliance_static"].attrs["inertia_relief"] = g.compliance.inertia_relief
    for name, s in sorted(g.stresses.items()):
        _write_stress(group, name, s, mode)
    _write_state(group, g, node, axis)
    checks = group.create_group("checks")
    for name, value in sorted(g.checks.items()):
        _put(checks, name, value).attrs["tolerance"] = TOLERANCES.get(name, np.nan)


_ROW_FIELDS = {"excitation": "excitations", "monitor": "monitors", "gauge": "gauges"}


def _write_rows(group: h5py.Group, g: ModalGroup, mode: h5py.Dataset) -> None:
    interfaces = group.create_group("interfaces")
    for name, item in g.interfaces.items():
        face = interfaces.create_group(name)
        rows = _put(face, "T", item.rows, "kg^-1/2; last three m^-1 kg^-1/2", ("row", "mode"))
        _attach(rows, {1: mode})
        _attach(_put(face, "fit_residual", item.fit_residual, "1", ("mode",)), {0: mode})
        if item.shapes.shape[0]:
            _attach(_put(face, "shapes", item.shapes, "kg^-1/2", ("point", "axis", "mode")), {2: mode})
    for kind in ("excitation", "monitor", "gauge"):
        where = group.create_group(kind)
        where.attrs["order"] = json.dumps(list(getattr(g, _ROW_FIELDS[kind])))
        for name, rows_ in getattr(g, _ROW_FIELDS[kind]).items():
            item = where.create_group(name)
            item.attrs["unit"] = rows_.unit
            item.attrs["distance"] = rows_.distance
            _put(item, "labels", np.array(rows_.labels, dtype="U"))
            _put(item, "point", rows_.point, "m")
            _put(item, "static", rows_.static)
            _attach(_put(item, "T", rows_.rows, "", ("row", "mode")), {1: mode})


def _write_state(group: h5py.Group, g: ModalGroup, node: h5py.Dataset, axis: Array) -> None:
    """Rotation and the static state the modes are taken about."""
    where = group.create_group("rotation")
    where.attrs["omega"] = g.speed * axis
    where.attrs["prestress"] = g.prestress
    where.attrs["stress_stiffening"] = g.prestress in ("linear", "nonlinear")
    where.attrs["spin_softening_in_K"] = g.spin_softening
    where.attrs["gyroscopic_in_G_r"] = True
    _attach(_put(where, "u_static", g.u_static, "m", ("node", "axis")), {0: node})
    for name, s in sorted(g.stresses.items()):
        _put(where.require_group("sigma_static"), name, s.static_stress, "Pa", ("place", "component"))


def _write_stress(group: h5py.Group, name: str, s: StressSet, mode: h5py.Dataset) -> None:
    stress, strain = (group.require_group(kind).create_group(name) for kind in ("stress", "strain"))
    for where in (stress, strain):
        where.attrs["location"] = s.location
        where.attrs["order"] = " ".join(VOIGT)
    strain.attrs["shear"] = "engineering"
    _put(stress, "points", s.points, "m", ("place", "axis"))
    _put(stress, "weights", s.weights, "m^3", ("place",))
    for shared in ("points", "weights"):
        strain[shared] = stress[shared]
    _attach(_put(strain, "T", s.strain, "m^-1 kg^-1/2", ("place", "component", "mode")), {2: mode})
    _attach(_put(stress, "T", s.stress, "Pa m^-1 kg^-1/2", ("place", "component", "mode")), {2: mode})


def open_file(path: Path | str) -> h5py.File:
    """Open a modal file for reading after looking at its format.

    Raises:
        UserError: missing, damaged, foreign or of another major version.
    """
    path = Path(path)
    if not path.is_file():
        raise UserError(f"{path}: no such modal file; make it first or correct the path")
    try:
        file = h5py.File(path, "r")
        form, version = file.attrs.get("format"), file.attrs.get("format_version")
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        raise UserError(f"{path}: is damaged or no HDF5 file ({_short(error)}); write it again") from error
    if form != FORMAT:
        file.close()
        raise UserError(f"{path}: is no modal file (its attribute 'format' is {form!r}, not '{FORMAT}')")
    if not isinstance(version, str) or version.split(".")[0] != FORMAT_VERSION.split(".")[0]:
        file.close()
        raise UserError(f"{path}: has format version {version}, this program reads {FORMAT_VERSION}; write it again")
    return file


def _short(error: BaseException) -> str:
    return (str(error).splitlines() or ["unreadable"])[0][:120]


def read_basis(path: Path | str) -> ModalBasis:
    """Read a modal file.

    Raises:
        UserError: see `open_file`; a missing or misshapen part is named.
    """
    with open_file(path) as file:
        try:
            basis = _read(file)
        except (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError, IndexError, UnicodeDecodeError) as error:
            raise UserError(f"{path}: is damaged or incomplete ({_short(error)}); write it again") from error
    return basis


def _texts(dataset: h5py.Dataset) -> tuple[str, ...]:
    return tuple(v.decode() for v in np.asarray(dataset).ravel())


def _read(file: h5py.File) -> ModalBasis:
    mesh = Mesh(
        points=file["mesh/xyz"][:],
        cells={k: v[:].astype(np.int64) for k, v in file["mesh/cells"].items()},
        faces={n: {t: f[:].astype(np.int64) for t, f in g.items()} for n, g in file["mesh/groups"].items()},
        point_sets={n: s[:].astype(np.int64) for n, s in file["mesh/point_sets"].items()},
        node_id=file["mesh/node"][:].astype(np.int64),
    )
    groups = {}
    for name, where in file.items():
        if name.startswith("speed_"):
            for sub, group in where.items():
                if sub.startswith("nd_"):
                    key = int(name.removeprefix("speed_")), int(sub.removeprefix("nd_"))
                    groups[key] = _read_group(file, where, group, mesh)
    if not groups:
        raise ValueError("no speed group")
    return ModalBasis(
        name=str(file.attrs["name"]), mesh=mesh, groups=groups, mass=float(file["body/mass"][()]),
        centre=file["body/centre"][:], inertia=file["body/inertia"][:], rotation_axis=file["rotation/axis"][:],
        rotation_point=file["rotation/point"][:], damping_source=str(file.attrs["damping_source"]),
        free=bool(file.attrs["free"]), reduction=str(file.attrs["reduction"]),
        provenance={k: str(v) for k, v in file["provenance"].attrs.items()},
    )  # fmt: skip


def _read_group(file: h5py.File, where: h5py.Group, group: h5py.Group, mesh: Mesh) -> ModalGroup:
    modes = group["modes"]
    omega = modes["omega"][:]
    m = len(omega)
    state = group["rotation"]
    static = group["compliance_static"]
    return ModalGroup(
        speed=float(where.attrs["omega"]), omega=omega, kind=_texts(modes["kind"]),
        damping_ratio=modes["damping_ratio"][:], M_r=modes["M_r"][:], K_r=modes["K_r"][:], C_r=modes["C_r"][:],
        G_r=modes["G_r"][:], phi=modes["phi"][:] if "phi" in modes else np.zeros((0, 3, m)),
        interfaces={
            n: _read_interface(file[f"interfaces/{n}"], group[f"interfaces/{n}"], m)
            for n in json.loads(str(file["interfaces"].attrs["order"]))
        },
        excitations=_read_rows(group["excitation"]), monitors=_read_rows(group["monitor"]),
        gauges=_read_rows(group["gauge"]),
        compliance=Compliance(
            _texts(group["compliance_row"]), static[:], group["compliance_modal"][:], bool(static.attrs["inertia_relief"]),
        ),
        stresses={n: _read_stress(group, n) for n in group["stress"]} if "stress" in group else {},
        u_static=state["u_static"][:], checks={k: float(v[()]) for k, v in group["checks"].items()},
        prestress=str(state.attrs["prestress"]), harmonic=int(group.attrs["harmonic"]),
        spin_softening=bool(state.attrs["spin_softening_in_K"]),
    )  # fmt: skip


def _read_interface(frame: h5py.Group, group: h5py.Group, m: int) -> Interface:
    return Interface(
        frame["origin"][:], frame["rotation"][:], group["T"][:], group["fit_residual"][:], frame["patch/points"][:],
        frame["patch/areas"][:], frame["patch/normals"][:],
        group["shapes"][:] if "shapes" in group else np.zeros((0, 3, m)),
        str(frame.attrs["role"]), str(frame.attrs["partner"]), int(frame.attrs["sector_shift"]),
    )  # fmt: skip


def _read_rows(where: h5py.Group) -> dict[str, Rows]:
    return {
        name: Rows(
            g["T"][:], _texts(g["labels"]), str(g.attrs["unit"]), g["point"][:], float(g.attrs["distance"]),
            g["static"][:],
        )
        for name in json.loads(str(where.attrs["order"]))
        for g in (where[name],)
    }  # fmt: skip


def _read_stress(group: h5py.Group, name: str) -> StressSet:
    stress, strain = group[f"stress/{name}"], group[f"strain/{name}"]
    static = group[f"rotation/sigma_static/{name}"][:]
    return StressSet(
        str(stress.attrs["location"]), stress["points"][:], strain["T"][:], stress["T"][:], static, stress["weights"][:]
    )


@dataclass(frozen=True)
class Check:
    """One finding of `check_basis`."""

    name: str
    value: float
    limit: float
    passed: bool
    remark: str = ""


def check_basis(basis: ModalBasis) -> list[Check]:
    """Verify what a modal file claims from its own content, and the numbers stored by the solver.

    Without the full matrices M and K this covers: shapes and sizes; finite numbers; ascending frequencies;
    M_r = 1 and K_r = diag(omega^2) for normal modes; skew G_r; interface rows reproduce the patch's shapes; patch
    areas; orthonormal right-handed frames; modal compliance against the rows; static not below modal compliance;
    the solver's certificate, orthogonality and backward error.
    """
    out: list[Check] = []

    def limit(name: str, value: float, bound: float, remark: str = "") -> None:
        out.append(Check(name, float(value), bound, bool(value <= bound), remark))

    total = sum(len(c) for c in basis.mesh.cells.values())
    limit("mesh: cells", 0.0 if total else 1.0, 0.0, f"{total} cells")
    highest = max((int(c.max()) for c in basis.mesh.cells.values() if c.size), default=-1)
    limit("mesh: cells refer to points", float(highest), basis.mesh.n_points - 1)
    for (speed, harmonic), g in sorted(basis.groups.items()):
        where = f"speed_{speed}/nd_{harmonic}"
        for name, value, bound, remark in _group_checks(basis, g):
            limit(f"{where}: {name}", value, bound, remark)
    return out


def _group_checks(basis: ModalBasis, g: ModalGroup) -> list[tuple[str, float, float, str]]:
    m = g.n_modes
    found: list[tuple[str, float, float, str]] = []
    shapes_ok = all(
        a.shape == (m, m) for a in (g.M_r, g.K_r, g.C_r, g.G_r)
    ) and len(g.kind) == len(g.damping_ratio) == m and g.phi.shape[0] in (0, basis.mesh.n_points)
    shapes_ok = shapes_ok and all(i.rows.shape == (6, m) for i in g.interfaces.values())
    shapes_ok = shapes_ok and all(r.rows.shape[1] == m for k in (g.excitations, g.monitors, g.gauges) for r in k.values())
    found.append(("shapes of the arrays agree", 0.0 if shapes_ok else 1.0, 0.0, ""))
    if not shapes_ok:
        return found
    numbers = [g.omega, g.M_r, g.K_r, g.C_r, g.G_r, g.phi, g.u_static, g.compliance.static, g.compliance.modal]
    numbers += [i.rows for i in g.interfaces.values()] + [s.stress for s in g.stresses.values()]
    found.append(("every number is finite", float(sum((~np.isfinite(a)).sum() for a in numbers)), 0.0, ""))
    found.append(("frequencies ascend", float(np.maximum(-np.diff(g.omega), 0).max(initial=0.0)), 1e-9 * float(g.omega.max(initial=1.0)), ""))
    normal = all(k in ("rigid", "normal") for k in g.kind)
    scale = max(float((g.omega**2).max(initial=0.0)), 1.0)
    if normal:
        found.append(("M_r is the identity", float(np.abs(g.M_r - np.eye(m)).max(initial=0.0)), 1e-9, ""))
        found.append(("K_r is diag(omega^2)", float(np.abs(g.K_r - np.diag(g.omega**2)).max(initial=0.0)) / scale, 1e-9, ""))
    found.append(("G_r is skew", float(np.abs(g.G_r + g.G_r.T).max(initial=0.0)), 1e-9 * max(float(np.abs(g.G_r).max(initial=0.0)), 1e-12), ""))
    for name, item in g.interfaces.items():
        R = item.rotation
        found.append((f"interface {name}: frame is right-handed", float(np.abs(R @ R.T - np.eye(3)).max() + abs(np.linalg.det(R) - 1)), 1e-9, ""))
        if item.shapes.shape[0]:
            mean = R @ np.einsum("p,pim->im", item.areas, item.shapes) / item.areas.sum()
            error = np.abs(mean - item.rows[:3]).max() / max(np.abs(item.rows[:3]).max(), 1e-300)
            found.append((f"interface {name}: rows agree with the patch's shapes", float(error), 1e-9, ""))
    T = _all_rows(g)
    if T.shape[0] and T.shape[0] == len(g.compliance.labels) and normal:
        elastic = g.omega > 0
        modal = (T[:, elastic] / g.omega[elastic] ** 2) @ T[:, elastic].T
        top = max(float(np.abs(modal).max()), 1e-300)
        found.append(("modal compliance follows from the rows", float(np.abs(modal - g.compliance.modal).max()) / top, 1e-9, ""))
    if len(g.compliance.labels) and normal:
        d = np.sqrt(np.maximum(np.diag(g.compliance.static), 1e-300))
        worst = float(np.linalg.eigvalsh(g.compliance.residual / np.outer(d, d)).min())
        found.append(("static compliance is not below its modal part", max(-worst, 0.0), 1e-6, ""))
    for key in ("orthogonality", "backward_error", "mass_error"):
        if key in g.checks:
            found.append((f"solver: {key.replace('_', ' ')}", g.checks[key], TOLERANCES[key], ""))
    if "certified" in g.checks:
        remark = "" if g.checks["certified"] else "modes.certify was false; the spectrum may have gaps"
        found.append(("solver: spectrum certified complete", 1.0 - g.checks["certified"], 0.0, remark))
    return found


def _all_rows(g: ModalGroup) -> Array:
    """Rows in the order of the compliance labels, as far as they are stored."""
    parts = []
    for label in g.compliance.labels:
        kind, name, row = label.split(":", 2)
        if kind == "interface":
            parts.append(g.interfaces[name].rows[["u_n", "u_t1", "u_t2", "phi_n", "phi_t1", "phi_t2"].index(row)])
        else:
            rows = (g.excitations if kind == "excitation" else g.monitors)[name]
            parts.append(rows.rows[rows.labels.index(row)])
    return np.array(parts).reshape(len(parts), g.n_modes)
