"""The modal file of a body, of matrices that another program assembled, or of a system by hand."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__, plausible
from ..basis import write_basis
from ..basis.files import FORMAT, size_in_words
from ..data import Array, Mesh, ModalBasis
from ..errors import UserError, in_its_file, of_file
from ..files import store
from ..files.hdf5 import refuse_foreign
from ..mesh import UNITS, read_files
from ..settings.body import BodySettings, MatrixFiles
from ..units import rpm_text
from .job import Job
from .meshing import load_mesh, mesh_stage, touched_files
from .stage import Made, Report, Stage

_CODE = ("modal.compute", "basis", "mesh")


def modes_stage(
    job: Job, output: Path | None = None, force: bool = False, report: Report = lambda _: None
) -> tuple[Path, list[str]]:
    """Compute, or check that it is up to date, the modal file of a body. Returns its path and warnings.

    Raises:
        UserError, NotConverged: see `modes.modal_basis`.
    """
    matrices = job.settings.geometry.matrices
    if output is not None:
        refuse_foreign(output, FORMAT)
    if matrices is None:
        mesh_file = mesh_stage(job, report=report)
        code: tuple[str, ...] = _CODE
        inputs = modes_inputs(job, mesh_file)
    else:
        inputs, code = matrices_inputs(job, matrices), (*_CODE, "exchange.matrices")
    origin, warnings = None if output else job.path, list[str]()
    stage = Stage(output or job.basis_file, code, force, report, origin)

    def work() -> Made:
        basis, told = basis_of(job, mesh_file, report) if matrices is None else _from_matrices(job, matrices, report)
        size = size_in_words(basis)
        report(f"writing {stage.product}{', ' * bool(size)}{size}")
        write_basis(stage.product, basis)
        for text in (*plausible.of_basis(basis, _static(basis)), *held_faces(basis)):
            told.append(f"{job.path}: {text}")
            report(f"warning: {told[-1]}")
        warnings.extend(told)
        return Made(note={"warnings": warnings})

    if not stage.make(inputs, work):
        warnings = warnings_of(stage.product)
        for text in warnings:
            report(f"warning: {text}")
    return stage.product, warnings


def warnings_of(basis_file: Path) -> list[str]:
    """What was warned of when a modal file was made, which stays true while it is up to date."""
    try:
        return list(json.loads(store.sidecar_path(basis_file).read_text()).get("warnings", []))
    except (OSError, ValueError):
        return []


def held_faces(basis: ModalBasis) -> list[str]:
    """A sentence for each face of contacts that the supports hold, on which a case is refused later."""
    faces = basis.groups[min(basis.groups)].interfaces
    return [
        f"interfaces.{name}: the supports hold its whole face, so that nothing can open or slip there, "
        "and a contact on it is refused; free it in [[supports]], or take another face"
        for name, face in faces.items()
        if face.role != "load" and face.held_share == 1.0
    ]


def _static(basis: ModalBasis) -> dict[str, float]:
    """The largest stress of every static state, Pa, by what it is called."""
    stressed = [g for g in basis.groups.values() if g.stresses]
    if not stressed:
        return {}
    from ..modal.stress import static_extremes

    return {f"static state at {rpm_text(g.speed)}": static_extremes(g).stress for g in stressed}


def basis_of(job: Job, mesh_file: Path, report: Report) -> tuple[ModalBasis, list[str]]:
    """The modal basis of a body that has a mesh, and warnings.

    Raises:
        UserError, NotConverged: see `modes.modal_basis`.
    """
    from ..modal.compute import modal_basis

    mesh, warnings = load_mesh(job, mesh_file)
    for warning in warnings:
        report(f"warning: {warning}")
    with of_file(job.path):
        settings, temperature = with_temperature(job, mesh)
        return modal_basis(mesh, settings, temperature, report, provenance(job, mesh_file)), warnings


def _from_matrices(job: Job, given: MatrixFiles, report: Report) -> tuple[ModalBasis, list[str]]:
    """The modal basis of a body that another program has assembled, and warnings."""
    from ..exchange.matrices import read_matrices
    from ..modal.foreign import foreign_basis

    with of_file(job.path):
        body = read_matrices(given, job.folder, job.settings.length_unit, job.settings.parameters)
        basis, messages = foreign_basis(body, job.settings, report, provenance(job, job.path))
    warnings = [f"{job.path}: {message}" for message in messages]
    for warning in warnings:
        report(f"warning: {warning}")
    return basis, warnings


@in_its_file
def matrices_inputs(job: Job, given: MatrixFiles) -> dict[str, Any]:
    """What a modal file made of foreign matrices depends on: all settings but the prose, the files, the code."""
    from ..exchange.matrices import files_of

    settings = {k: v for k, v in job.raw.items() if k not in ("description", "note")}
    files = [job.folder / name for name in files_of(given, job.settings.parameters)]
    if missing := [f for f in files if not store.ordinary(f).is_file()]:
        raise UserError(f"there is no file {missing[0]}; correct the path", "geometry.matrices")
    return {"settings": settings, "files": [store.hash_file(f) for f in files]}


def modes_inputs(job: Job, mesh_file: Path) -> dict[str, Any]:
    """What a modal file depends on: settings but those of the drawing and the prose, the mesh, the code."""
    settings = {k: v for k, v in job.raw.items() if k not in ("geometry", "mesh", "description", "note")}
    inputs = {"settings": settings, "mesh": store.hash_file(mesh_file)}
    if (rule := job.raw.get("mesh", {}).get("integration", "full")) != "full":
        inputs["integration"] = rule
    if read := read_files(mesh_file)[1:]:
        inputs["included"] = [store.hash_file(f) for f in read if f.is_file()]
    if job.settings.geometry.mesh is not None:
        inputs["faces"] = job.raw["geometry"].get("faces", [])
        if names := job.raw["geometry"].get("instances"):
            inputs["instances"] = names
        if touched := touched_files(job):
            inputs["touched"] = [store.hash_file(f) for f in touched]
    if job.settings.temperature.file:
        inputs["temperature"] = store.hash_file(_temperature_file(job))
    return inputs


def provenance(job: Job, mesh_file: Path) -> dict[str, str]:
    """What the file tells about its making, without anything that changes between identical runs."""
    from importlib.metadata import PackageNotFoundError, version

    found = {"microslip": __version__, "python": ".".join(map(str, sys.version_info[:2]))}
    for package in ("numpy", "scipy", "scikit-fem", "gmsh", "meshio", "pypardiso"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    found["settings"] = json.dumps(job.raw, sort_keys=True, default=str)
    found["settings_sha256"] = store.hash_settings(job.raw)
    found["mesh_sha256"] = store.hash_file(mesh_file)
    found["threads"] = os.environ.get("OMP_NUM_THREADS", "default")
    found["material"] = job.settings.material.name
    found["note"] = job.settings.note
    return found


@in_its_file
def _temperature_file(job: Job) -> Path:
    path = job.folder / (job.settings.temperature.file or "")
    if not store.ordinary(path).is_file():
        raise UserError(f"there is no file {path}; correct the path", "temperature.file")
    return path


def with_temperature(job: Job, mesh: Mesh) -> tuple[BodySettings, Array | None]:
    """The settings with the stress-free temperature, and the nodal one, of the settings or of the mesh file: (n,), or
    (n, 2) with the stress-free one where that is not the same everywhere.

    Raises:
        UserError: the mesh file brings none.
    """
    setting = job.settings.temperature
    if setting.source is None:
        return job.settings, nodal_temperature(job, mesh)
    if mesh.temperature is None:
        raise UserError("temperature.from: the mesh file brings no temperatures; use uniform or file")
    free, actual = mesh.temperature.T
    if np.isnan(free).any():
        raise UserError(
            "temperature.from: the stress-free temperature (*INITIAL CONDITIONS, TYPE=TEMPERATURE) must be "
            "given for every node"
        )
    hot = np.where(np.isnan(actual), free, actual) + setting.zero
    if hot.min() <= 0 or free.min() + setting.zero <= 0:
        raise UserError("temperature.scale: the mesh file's temperatures fall below absolute zero; choose C or K")
    reference = setting.model_copy(update={"reference": float(free[0] + setting.zero)})
    alike = np.ptp(free) <= 1e-9 * max(np.abs(free).max(), 1.0)
    both = hot if alike else np.column_stack([hot, free + setting.zero])
    return job.settings.model_copy(update={"temperature": reference}), both


def nodal_temperature(job: Job, mesh: Mesh) -> Array | None:
    """(n,) temperature at the points, K, or None for the reference temperature.

    A file of x, y, z, T is interpolated linearly; points outside its hull take the nearest value.
    """
    setting = job.settings.temperature
    if setting.file is None:
        return None if setting.uniform is None else np.full(mesh.n_points, setting.uniform)
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    path = _temperature_file(job)
    try:
        table = np.loadtxt(path, delimiter=",", comments="#", ndmin=2)
    except ValueError as error:
        raise UserError(f"{path}: must be lines of x, y, z, T ({error}); correct it") from error
    if table.shape[1] != 4 or not np.isfinite(table).all() or (table[:, 3] <= 0).any():
        raise UserError(f"{path}: must be lines of x, y, z, T with T in K above 0; correct it")
    where = table[:, :3] * UNITS[job.settings.length_unit]
    nearest = NearestNDInterpolator(where, table[:, 3])(mesh.points)
    try:
        linear = LinearNDInterpolator(where, table[:, 3])(mesh.points)
    except Exception:  # the points span no volume: Qhull refuses
        return nearest
    return np.where(np.isnan(linear), nearest, linear)


def system_stage(
    path: Path, assignments: list[str] | None = None, output: Path | None = None, force: bool = False,
    report: Report = lambda _: None, root: Path = Path("."),
) -> Path:  # fmt: skip
    """Compute, or check that it is up to date, the modal file of a system by hand. Returns its path.

    Raises:
        UserError: see `system.load_system` and `System.basis`.
    """
    from ..system import load_system, system_basis

    system = load_system(path, assignments)
    product = output or root / "build" / system.name / "basis.h5"
    origin = None if output else path
    stage = Stage(product, ("system.settings", "basis"), force, report, origin)

    def work() -> Made:
        write_basis(stage.product, system_basis(path, assignments))
        return Made()

    stage.make({"settings": dict(system.settings)}, work)
    return stage.product
