"""The chain body.toml -> mesh -> modal file -> friction response -> pictures and report.

Each stage knows the inputs its product depends on and does nothing when they have not changed; `make` and
``microslip run`` share this rule, so editing a normal force never remeshes.
"""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from . import __version__, store
from .basis import read_basis, write_basis
from .body import BodySettings, MaterialSettings, MatrixFiles, implausible, load_body, load_toml
from .compliance import sentence
from .coordinates import own_kind
from .data import Array, GyroscopicModes, Indices, Material, Mesh, ModalBasis, ModalGroup, SpeedRange, UserError
from .gyroscopic import stability_sentence
from .mesh import UNITS, mesh_problems, part_numbers, read_mesh
from .mesh.inp import files_of
from .quality import sentences
from .report import contact_sentence
from .resonances import (
    eigenmodes,
    harmonics_of,
    resonance_csv,
    resonances,
    speeds_of,
    waves_of,
    whirl_bounds,
    whirl_sentence,
)
from .ring import certificate_words, certify_ring
from .units import SYSTEMS, usual_system

Report = Callable[[str], None]
PACKAGE = Path(__file__).parent

_NO_SETTINGS = {
    ".step", ".stp", ".brep", ".iges", ".igs", ".inp", ".cdb", ".msh", ".med", ".unv", ".bdf", ".mtx", ".mat",
}  # fmt: skip
# Parts of the package whose change makes a product anew.
_MESH_CODE = ("cad",)
_MODES_CODE = (
    "data.py", "frames.py", "body.py", "mesh", "topology.py", "eigen.py", "canonical.py", "condensed.py",
    "gyroscopic.py", "basis", "coordinates.py", "fem", "reduction", "modes", "elasticity.py", "elements.py",
    "units.py", "hostile.py",
)  # fmt: skip
_FOREIGN_CODE = (*_MODES_CODE, "exchange/matrices")
_SYSTEM_CODE = ("data.py", "body.py", "canonical.py", "frames.py", "system/lumped.py", "basis")
_REPORT_CODE = (
    "pictures", "campbell.py", "speed_range.py", "ring.py", "resonances.py", "report.py", "truncation.py",
    "compliance.py", "quality.py", "basis/checks.py",
)  # fmt: skip


@dataclass(frozen=True)
class Job:
    """One body on its way through the chain: its file, settings in SI and as written, and where products go."""

    path: Path
    settings: BodySettings
    raw: dict[str, Any]
    root: Path

    @property
    def folder(self) -> Path:
        return self.path.parent

    @property
    def mesh_file(self) -> Path:
        """The mesh the body is assembled on: the product of its build or CAD file, or the user's own."""
        own = self.settings.geometry.mesh
        if own is not None:
            return self.folder / own
        return self.root / "meshes" / f"{self.settings.name}.msh"

    @property
    def build_folder(self) -> Path:
        return self.root / "build" / self.settings.name

    @property
    def basis_file(self) -> Path:
        return self.build_folder / "basis.h5"

    @property
    def case_file(self) -> Path | None:
        """case.toml beside the body, or pipeline/cases/<name>.toml where the chain is run."""
        for place in (self.folder / "case.toml", self.root / "pipeline" / "cases" / f"{self.settings.name}.toml"):
            if place.is_file():
                return place
        return None


def open_job(path: Path | str, assignments: list[str] | None = None, root: Path | str = ".") -> Job:
    """Read a body file (or the body.toml in a folder).

    Raises:
        UserError: see `load_body`.
    """
    path = Path(path)
    if holds_a_case_alone(path):
        raise UserError(f"{path}: holds a case and no body; run it with: microslip run {shlex.quote(str(path))}")
    if path.is_dir():
        path = path / "body.toml"
    if path.suffix.lower() in _NO_SETTINGS and path.is_file():
        raise UserError(f"{path}: is no body.toml; make one around it with: microslip import {shlex.quote(str(path))}")
    settings, raw = load_body(path, assignments)
    return Job(path, settings, raw, Path(root))


def code_hash(parts: tuple[str, ...]) -> str:
    files = sorted(f for p in parts for f in ([PACKAGE / p] if p.endswith(".py") else (PACKAGE / p).rglob("*.py")))
    return store.hash_settings([[str(f.relative_to(PACKAGE)), store.hash_file(f)] for f in files])


# mesh ------------------------------------------------------------------------------------------------------------


def mesh_stage(job: Job, output: Path | None = None, force: bool = False, report: Report = lambda _: None) -> Path:
    """Build, or check that it is up to date, the mesh of a body. Returns its path.

    gmsh runs in a process of its own, which leaves a file.

    Raises:
        UserError: what the mesher says, or a missing source.
    """
    geometry = job.settings.geometry
    if geometry.matrices is not None:
        raise UserError(f"{job.path}: geometry.matrices: there is nothing to mesh; type: microslip modes {job.folder}")
    if geometry.mesh is not None:
        if not store.ordinary(job.mesh_file).is_file():
            raise UserError(f"{job.path}: geometry.mesh: there is no file {job.mesh_file}; correct the path")
        return job.mesh_file
    product = output or job.mesh_file
    source = job.folder / (geometry.build or geometry.cad or "")
    if not store.ordinary(source).is_file():
        key = "build" if geometry.build else "cad"
        raise UserError(f"{job.path}: geometry.{key}: there is no file {source}; correct the path")
    if geometry.build and not source.resolve().is_relative_to(job.folder.resolve()):
        raise UserError(
            f"{job.path}: geometry.build: {source.resolve()} is outside the body's folder, and only what stands in it "
            "is run; copy it there"
        )
    if geometry.cad:
        _refuse_unnamed_faces(job)
    with store.making(product, report):
        inputs = {
            "geometry": job.raw["geometry"],
            "mesh": job.raw.get("mesh", {}),
            "unit": job.settings.length_unit,
            "source": store.hash_file(source),
            "code": code_hash(_MESH_CODE),
        }
        if not store.nothing_to_do(product, inputs, force, report):
            report(f"meshing {source.name}")
            for line in _run_mesher(job, source, product):
                report(line)
            store.note_product(product, inputs)
    return product


def _refuse_unnamed_faces(job: Job) -> None:
    """A face of a CAD file has a name only by a rule: what asks for another is told before the mesher has worked."""
    s = job.settings
    names = sorted({rule.name for rule in s.geometry.faces})
    asked = [("supports", i.face, i.face) for i in s.supports] + [("interfaces", i.name, i.face) for i in s.interfaces]
    asked += [("excitations", i.name, i.face) for i in s.excitations if i.face is not None]
    told = f"it names {', '.join(names) or 'none'}"
    wrong = [
        f"{job.path}: {table}.{label}.face: geometry.faces names no face '{face}'; {told}"
        for table, label, face in asked if face not in names
    ]  # fmt: skip
    if wrong:
        raise UserError("\n".join(wrong))


def _run_mesher(job: Job, source: Path, product: Path) -> list[str]:
    """Run gmsh in its own process; returns its warnings."""
    settings = {**job.raw, "folder": str(job.folder.resolve())}
    words = [str(source.resolve())] if job.settings.geometry.build else ["-m", "microslip.cad"]
    with store.complete_or_absent(product) as temporary, tempfile.TemporaryDirectory() as scratch:
        table = Path(scratch) / "settings.json"
        table.write_text(json.dumps(settings))
        made = Path(scratch) / "mesh.msh"
        try:
            done = run_apart([*words, str(table), str(made)], scratch)
        except OSError as error:  # not to be told as the product's: it is Python that this user may not start
            raise UserError(
                f"{sys.executable}: cannot be started to draw the body ({error.strerror}); let this user read and "
                "run it"
            ) from error
        if done.returncode or not made.is_file():
            raise UserError(_mesher_failure(job, done))
        temporary.write_bytes(made.read_bytes())
    return [line for line in done.stderr.splitlines() if line.startswith("warning:")]


def run_apart(words: list[str], scratch: str) -> subprocess.CompletedProcess[str]:
    """Run a Python file, or -m and a module, in a process of its own, as gmsh is.

    It ends when this process does, however that ends, and then removes the folder `scratch`.
    """
    paths = [str(PACKAGE.parent), os.environ.get("PYTHONPATH", "")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in paths if p)}
    read, write = os.pipe()  # which nobody writes to: its end is the end of this process
    try:
        command = [sys.executable, "-c", _TO_THE_END, scratch, *words]
        return subprocess.run(command, stdin=read, capture_output=True, text=True, env=environment)
    finally:
        os.close(read)
        os.close(write)


_TO_THE_END = """
import os, runpy, shutil, sys, threading

def end(scratch):
    os.read(0, 1)
    shutil.rmtree(scratch, ignore_errors=True)
    os._exit(1)

threading.Thread(target=end, args=[sys.argv[1]], daemon=True).start()
module = sys.argv[2] == "-m"
sys.argv = sys.argv[2 + module :]
if module:
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
else:
    sys.path[0] = os.path.dirname(sys.argv[0])
    runpy.run_path(sys.argv[0], run_name="__main__")
"""


def _mesher_failure(job: Job, done: subprocess.CompletedProcess[str]) -> str:
    text = done.stderr.strip()
    if "No module named 'gmsh'" in text:
        return "gmsh is not installed, so nothing can be meshed; pip install 'microslip[fem]'"
    if "error while loading shared libraries" in text or "cannot open shared object file" in text:
        library = next((w for w in text.replace(":", " ").split() if w.startswith("lib") and ".so" in w), "a library")
        return (
            f"gmsh needs the system library {library}; type: "
            "sudo apt-get install -y libglu1-mesa libgl1 libxcursor1 libxft2 libxinerama1 libgomp1 libegl1"
        )
    if done.returncode < 0 and job.settings.geometry.cad:
        return (
            f"{job.path}: geometry.cad: the CAD kernel crashed on {job.settings.geometry.cad} "
            f"(signal {-done.returncode}); the file is probably damaged, export it again"
        )
    if done.returncode < 0:
        return f"{job.path}: gmsh stopped with signal {-done.returncode}; change mesh.size or simplify the geometry"
    if done.returncode == 2 and text:
        return text if str(job.path) in text else f"{job.path}: {text}"
    last = text.splitlines()[-1] if text else "no message"
    return f"{job.path}: meshing failed ({last}); check [geometry] and [mesh]"


def load_mesh(job: Job, path: Path | None = None, report: Report = lambda _: None) -> tuple[Mesh, list[str]]:
    """Read the mesh of a body, name its faces by the body's rules, and pass the quality gates.

    Returns:
        The mesh and warnings.

    Raises:
        UserError: everything that would spoil a solution.
    """
    path = path or job.mesh_file
    mesh, told = _read_with_materials(job, path)
    if job.settings.geometry.mesh is not None:
        mesh = _faces_by_rule(job, mesh)
    errors, warnings = mesh_problems(mesh)
    if job.settings.cyclic is not None and part_numbers(mesh).max() > 0:
        errors.append("the mesh of a cyclic sector falls into parts that share no points; join them")
    if errors:
        raise UserError("\n".join(f"{path}: {e}" for e in errors))
    size = float(np.ptp(mesh.points, axis=0).max())
    warnings = [f"{path}: {w}" for w in (*warnings, *told)]
    warnings += [f"{job.path}: {w}" for w in implausible(job.settings, size)]
    return mesh, warnings


def _read_with_materials(job: Job, path: Path) -> tuple[Mesh, list[str]]:
    """The mesh, with the file's own materials if they are asked for, and what to say of them."""
    unit, material, zero = job.settings.length_unit, job.settings.material, job.settings.temperature.zero
    if job.settings.geometry.mesh is None:
        return read_mesh(path, unit), []
    usual = usual_system(unit)
    if isinstance(material, MaterialSettings):
        try:
            mesh = read_mesh(path, unit, usual, zero)
        except UserError:  # perhaps only its materials cannot be read, which nobody asked for
            return read_mesh(path, unit), []
        told = differing_materials(material.material(), mesh.materials)
        return replace(mesh, materials=(), regions={}), told
    system = material.units or usual
    if system is None:
        raise UserError(
            f'{job.path}: material.units: with length_unit = "{unit}" it must be said; choose ' + ", ".join(SYSTEMS)
        )
    mesh = read_mesh(path, unit, system, zero)
    if not mesh.materials:
        raise UserError(f"{path}: brings no material; write density, young and poisson in [material]")
    return mesh, [] if material.unusual else [text for m in mesh.materials if (text := strange_material(m, system))]


def differing_materials(own: Material, others: tuple[Material, ...]) -> list[str]:
    """A warning where the mesh file says another material than the settings, which rule."""
    for m in others:
        rho, C = abs(m.density / own.density - 1), np.abs(m.elasticity - own.elasticity).max() / own.elasticity.max()
        if max(rho, C) > 1e-3:
            return [
                f"its material '{m.name}' ({m.density:.5g} kg/m3, C_xxxx {m.elasticity[0, 0]:.4g} Pa) is not that of "
                f"[material] ({own.density:.5g} kg/m3, {own.elasticity[0, 0]:.4g} Pa), which is used for every cell; "
                'write [material] from = "mesh" to use the file\'s'
            ]
    return []


def strange_material(m: Material, system: str) -> str:
    """A warning about numbers that suggest other units."""
    if 300 <= m.density <= 25000 and 1e8 <= m.elasticity[0, 0] <= 2e12:
        return ""
    return (
        f"its material '{m.name}' has {m.density:.4g} kg/m3 and C_xxxx = {m.elasticity[0, 0]:.4g} Pa in the units "
        f"{system}, which is no structural solid's; correct material.units (material.unusual = true silences this)"
    )


def _faces_by_rule(job: Job, mesh: Mesh) -> Mesh:
    """Faces of a user's own mesh given by boxes, those of one name added up; named sets of the file are there already.

    Raises:
        UserError: a rule by anything but a box, nothing in its box, the name of a set of the file.
    """
    from .mesh import boundary_facets, faces_from_points

    made: dict[str, dict[str, Indices]] = {}
    for rule in job.settings.geometry.faces:
        place = f"{job.path}: geometry.faces.{rule.name}"
        if rule.box is None:
            raise UserError(f"{place}: a mesh file has no labels or colours; use box")
        if rule.name in mesh.faces:
            raise UserError(f"{place}: the mesh file has a set of that name; give the face another one")
        low, high = np.array(rule.box[:3]), np.array(rule.box[3:])
        slack = 1e-6 * np.ptp(mesh.points, axis=0).max()
        inside = ((mesh.points >= low - slack) & (mesh.points <= high + slack)).all(axis=1)
        found = faces_from_points(boundary_facets(mesh), np.flatnonzero(inside), mesh.n_points)
        if not found:
            raise UserError(f"{place}: no facet of the surface is in the box; widen it")
        face = made.setdefault(rule.name, {})
        for kind, facets in found.items():
            face[kind] = np.unique(np.concatenate([face[kind], facets]), axis=0) if kind in face else facets
    return replace(mesh, faces={**mesh.faces, **made})


# modes -----------------------------------------------------------------------------------------------------------


def modes_stage(
    job: Job, output: Path | None = None, force: bool = False, report: Report = lambda _: None
) -> tuple[Path, list[str]]:
    """Compute, or check that it is up to date, the modal file of a body. Returns its path and warnings.

    Raises:
        UserError, NotConverged: see `modes.modal_basis`.
    """
    product = output or job.basis_file
    with store.making(product, report):
        return product, _modes(job, product, force, report)


def _modes(job: Job, product: Path, force: bool, report: Report) -> list[str]:
    """Compute the modal file if it is not up to date; returns warnings."""
    matrices = job.settings.geometry.matrices
    mesh_file = mesh_stage(job, report=report) if matrices is None else job.path
    inputs = modes_inputs(job, mesh_file) if matrices is None else matrices_inputs(job, matrices)
    if store.nothing_to_do(product, inputs, force, report):
        return []
    if matrices is None:
        basis, warnings = _assembled_here(job, mesh_file, report)
    else:
        basis, warnings = _from_matrices(job, matrices, report)
    report(f"writing {product}")
    write_basis(product, basis)
    store.note_product(product, inputs, warnings=warnings)
    return warnings


def _assembled_here(job: Job, mesh_file: Path, report: Report) -> tuple[ModalBasis, list[str]]:
    """The modal basis of a body that has a mesh, and warnings."""
    from .modes import modal_basis

    mesh, warnings = load_mesh(job, mesh_file)
    for warning in warnings:
        report(f"warning: {warning}")
    try:
        settings, temperature = with_temperature(job, mesh)
        return modal_basis(mesh, settings, temperature, report, provenance(job, mesh_file)), warnings
    except UserError as error:
        raise UserError(f"{job.path}: {error}") from error


def closure_stage(
    job: Job, name: str | None, low: float, high: float, points: int, rpm: float, output: Path | None = None,
    report: Report = lambda _: None,
) -> list[Path]:  # fmt: skip
    """Force over approach of one closure: CSV and PNG in build/<name>/ or `output`.

    Args:
        name: of the closure; None for the only one. low, high: approach of the faces, in the body's length_unit.

    Raises:
        UserError, NotConverged: see `modes.closure_curve`.
    """
    from .modes import closure_curve
    from .pictures.plots import closure_curve_plot

    known = [c.name for c in job.settings.closures]
    if name not in (known if len(known) != 1 else [*known, None]):
        raise UserError(f"{job.path}: closures: the body has {', '.join(known) or 'none'}; name one of them")
    if not low < high or points < 2:
        raise UserError("closure --from, --to, --points: give two or more points over a rising approach")
    chosen, scale = name or known[0], UNITS[job.settings.length_unit]
    mesh, warnings = load_mesh(job, mesh_stage(job, report=report))
    for warning in warnings:
        report(f"warning: {warning}")
    try:
        settings, temperature = with_temperature(job, mesh)
        levels = np.linspace(low, high, points) * scale
        curve = closure_curve(mesh, settings, chosen, levels, rpm * np.pi / 30, temperature, report)
    except UserError as error:
        raise UserError(f"{job.path}: {error}") from error
    folder = output or job.basis_file.parent
    table, picture = folder / f"closure_{chosen}.csv", folder / f"closure_{chosen}.png"
    with store.making(table, report):
        store.write_text(table, curve.table())
        return [table, closure_curve_plot(curve, f"{job.settings.name}: closure '{chosen}' at {rpm:g} rpm", picture)]


def contact_stage(
    path: Path, assignments: list[str], output: Path | None, report: Report = lambda _: None
) -> list[str]:  # fmt: skip
    """What a contact law does: tables (CSV) and pictures (PNG) in build/<name>/ or `output`.

    Returns:
        Lines to print: the short table, judgements, files.

    Raises:
        UserError, NotConverged: see `contact.study.study`; then nothing is written.
    """
    from .contact.study import study
    from .pictures.contact import draw

    path = path / "contact.toml" if path.is_dir() else path
    report("laws and motions")
    found = study(path, assignments)
    folder = output or Path("build") / found.contact.settings.name
    summary = folder / "summary.csv"
    rows = [*found.told, *(("judgement", s) for s in found.sentences)]
    report("pictures and tables")
    with store.making(summary, report):
        files = [*draw(found, folder), *(folder / f"{name}.csv" for name in found.tables), summary]
        for name, columns in found.tables.items():
            store.write_text(folder / f"{name}.csv", _columns_csv(columns))
        store.write_text(summary, "\n".join(["what,value", *(f'"{a}","{b}"' for a, b in rows)]) + "\n")
    width = max(len(what) for what, _ in found.told)
    lines = [f"{what:{width}}  {value}" for what, value in found.told]
    return [*lines, *found.sentences, *map(str, sorted(files))]


def _columns_csv(columns: Mapping[str, Array]) -> str:
    rows = zip(*columns.values(), strict=True)
    return "\n".join([",".join(columns), *(",".join(f"{x:.10g}" for x in row) for row in rows)]) + "\n"


def _from_matrices(job: Job, given: MatrixFiles, report: Report) -> tuple[ModalBasis, list[str]]:
    """The modal basis of a body that another program has assembled, and warnings."""
    from .exchange.matrices import read_matrices
    from .modes import foreign_basis

    try:
        body = read_matrices(given, job.folder, job.settings.length_unit)
        basis, remarks = foreign_basis(body, job.settings, report, provenance(job, job.path))
    except UserError as error:
        text = str(error)
        raise UserError(text if text.startswith(str(job.folder)) else f"{job.path}: {text}") from error
    warnings = [f"{job.path}: {remark}" for remark in remarks]
    for warning in warnings:
        report(f"warning: {warning}")
    return basis, warnings


def matrices_inputs(job: Job, given: MatrixFiles) -> dict[str, Any]:
    """What a modal file made of foreign matrices depends on: all settings but the prose, the files, the code."""
    from .exchange.matrices import files_of

    settings = {k: v for k, v in job.raw.items() if k not in ("description", "note")}
    files = [job.folder / name for name in files_of(given)]
    if missing := [f for f in files if not store.ordinary(f).is_file()]:
        raise UserError(f"{job.path}: geometry.matrices: there is no file {missing[0]}; correct the path")
    return {"settings": settings, "files": [store.hash_file(f) for f in files], "code": code_hash(_FOREIGN_CODE)}


def modes_inputs(job: Job, mesh_file: Path) -> dict[str, Any]:
    """What a modal file depends on: settings but those of the drawing and the prose, the mesh, the code."""
    settings = {k: v for k, v in job.raw.items() if k not in ("geometry", "mesh", "description", "note")}
    inputs = {"settings": settings, "mesh": store.hash_file(mesh_file), "code": code_hash(_MODES_CODE)}
    if mesh_file.suffix.lower() == ".inp" and (read := files_of(mesh_file)[1:]):
        inputs["included"] = [store.hash_file(f) for f in read if f.is_file()]
    if job.settings.geometry.mesh is not None:
        inputs["faces"] = job.raw["geometry"].get("faces", [])
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


def _temperature_file(job: Job) -> Path:
    path = job.folder / (job.settings.temperature.file or "")
    if not store.ordinary(path).is_file():
        raise UserError(f"{job.path}: temperature.file: there is no file {path}; correct the path")
    return path


def with_temperature(job: Job, mesh: Mesh) -> tuple[BodySettings, Array | None]:
    """The settings with the stress-free temperature, and the nodal one, of the settings or of the mesh file.

    Raises:
        UserError: the mesh file brings none, or a stress-free one that is not the same everywhere.
    """
    setting = job.settings.temperature
    if setting.source is None:
        return job.settings, nodal_temperature(job, mesh)
    if mesh.temperature is None:
        raise UserError("temperature.from: the mesh file brings no temperatures; use uniform or file")
    free, actual = mesh.temperature.T
    if np.isnan(free).any() or np.ptp(free) > 1e-9 * max(np.abs(free).max(), 1.0):
        raise UserError(
            "temperature.from: the stress-free temperature (*INITIAL CONDITIONS, TYPE=TEMPERATURE) must be "
            "given for every node and be the same everywhere"
        )
    hot = np.where(np.isnan(actual), free, actual) + setting.zero
    if hot.min() <= 0 or free[0] + setting.zero <= 0:
        raise UserError("temperature.scale: the mesh file's temperatures fall below absolute zero; choose C or K")
    reference = setting.model_copy(update={"reference": float(free[0] + setting.zero)})
    return job.settings.model_copy(update={"temperature": reference}), hot


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


# report ----------------------------------------------------------------------------------------------------------


def report_stage(job: Job, response: dict[str, Any] | None, force: bool, report: Report) -> Path:
    """Pictures and the self-contained page of a body."""
    product = job.build_folder / "report.html"
    with store.making(product, report):
        _report(job, product, response, force, report)
    return product


def _report(job: Job, product: Path, response: dict[str, Any] | None, force: bool, report: Report) -> None:
    from . import pictures
    from .report import write_report

    folder, remarks = job.build_folder / "pictures", _remarks(job)
    if response is not None:
        remarks += response.get("remarks", [])
        shown = dict(response.get("pictures", {}))
        response = {k: v for k, v in response.items() if k not in ("remarks", "pictures")}
    inputs = {
        "basis": store.hash_file(job.basis_file),
        "response": response,
        "engine_orders": list(job.settings.rotation.engine_orders),
        "remarks": remarks,
        "code": code_hash(_REPORT_CODE),
    }
    if store.nothing_to_do(product, inputs, force, report):
        return
    basis = read_basis(job.basis_file)
    store.unfinished(product)
    report("starting PyVista")
    reason = pictures.can_draw()
    if reason is not None:
        report(f"warning: no pictures of the body: {reason}")
        remarks.append(f"The pictures of the body are missing: {reason}")
    engine_orders = list(job.settings.rotation.engine_orders)
    drawn = pictures.draw_all(basis, folder, report, engine_orders, scenes=reason is None)
    tables: list[Path] = []
    if basis.sectors > 1 and (basis.ranges or len(speeds_of(basis)) > 1):
        found = resonances(basis, engine_orders)
        tables = [job.build_folder / "resonances.csv"]
        store.write_text(tables[0], resonance_csv(found))
    if response is not None:
        drawn |= {title: folder / name for title, name in shown.items()}
    report("writing the report")
    write_report(basis, drawn, product, remarks, response)
    if reason is None:  # else the next run tries again
        store.note_product(product, inputs, [*drawn.values(), *tables])


def _remarks(job: Job) -> list[str]:
    remarks = [job.settings.note] if job.settings.note else []
    try:
        remarks += json.loads(store.sidecar_path(job.basis_file).read_text()).get("warnings", [])
    except (OSError, ValueError):
        pass
    return remarks


# systems by hand --------------------------------------------------------------------------------------------------


def holds_a_case_alone(path: Path) -> bool:
    """Whether a folder has a case.toml, and neither a body.toml nor a system.toml beside it."""
    return [(path / f"{name}.toml").is_file() for name in ("case", "body", "system")] == [True, False, False]


def system_file(path: Path) -> Path | None:
    """The system.toml that a path names: a file of masses, rigid bodies or matrices, or the folder that holds it."""
    if path.is_dir() and not (path / "body.toml").is_file():
        path = path / "system.toml"
    if path.is_file() and path.suffix == ".toml" and {"masses", "bodies", "matrices"} & set(keys := load_toml(path)):
        return None if "sweep" in keys else path  # a case has bodies too
    return None


def system_stage(
    path: Path, assignments: list[str] | None = None, output: Path | None = None, force: bool = False,
    report: Report = lambda _: None, root: Path = Path("."),
) -> Path:  # fmt: skip
    """Compute, or check that it is up to date, the modal file of a system by hand. Returns its path.

    Raises:
        UserError: see `system.load_system` and `System.basis`.
    """
    from .system import load_system, system_basis

    system = load_system(path, assignments)
    product = output or root / "build" / system.name / "basis.h5"
    inputs = {"settings": dict(system.settings), "code": code_hash(_SYSTEM_CODE)}
    with store.making(product, report):
        if not store.nothing_to_do(product, inputs, force, report):
            write_basis(product, system_basis(path, assignments))
            store.note_product(product, inputs)
    return product


def whirl_rows(modes: GyroscopicModes) -> list[str]:
    """A line for each mode with gyroscopic coupling."""
    out = []
    for f, way, sense, growth, error in zip(
        modes.frequency, modes.direction, modes.sense, modes.growth, modes.error, strict=True
    ):
        sure = "" if np.isnan(error) else f"   within {100 * error:.2g} %"
        out.append(f"{f:14.6g} Hz   {way} ({sense:+.2f}){sure}" + (f"   GROWS {growth:.3g} 1/s" if growth else ""))
    return out


def basis_summary(basis: ModalBasis) -> list[str]:
    """What a modal file holds, in lines for the terminal."""
    extent = np.ptp(basis.mesh.points, axis=0) * 1e3
    lines = [
        f"{basis.name}: {basis.mesh.n_points} points, {basis.mesh.n_cells} cells, mass {basis.mass:.6g} kg, "
        f"{extent[0]:.4g} x {extent[1]:.4g} x {extent[2]:.4g} mm, reduction {basis.reduction}",
    ]
    ranges = [line for k, r in sorted(basis.ranges.items()) for line in range_summary(k, r)]
    if basis.sectors > 1:
        return lines + _ring_summary(basis) + ranges
    for (_, harmonic), g in sorted(basis.groups.items()):
        state = f"{g.speed * 30 / np.pi:g} rpm" + (f", {g.prestress} prestress" if g.prestress != "none" else "")
        proof = between_stations([g]) or ("certified complete" if g.checks.get("certified") else "NOT certified")
        if basis.source == "measured":
            proof = "measured: others may have been missed"
        lines.append(f"{state}, nodal diameter {harmonic}: {len(g.omega)} modes, {proof}")
        lines += contact_lines(g)
        lines += [f"  {text}" for text in sentences(g, basis.reduction)]
        lines += [
            f"  {i + 1:4d}  {f:14.6g} Hz   D = {d:.4g}   {k}"
            for i, (f, d, k) in enumerate(zip(g.frequency, g.damping_ratio, own_kind(g), strict=True))
        ]
        if g.gyroscopic is not None:
            lines.append(f"  with gyroscopic coupling, in the rotating frame. {stability_sentence(g.gyroscopic)}")
            lines += [f"  {i + 1:4d}  {row}" for i, row in enumerate(whirl_rows(g.gyroscopic))]
    if any(group.interfaces for group in basis.groups.values()):
        lines.append(f"compliance: {sentence(basis, basis.groups[min(basis.groups)])}")
    return lines + ranges


def between_stations(groups: list[ModalGroup]) -> str:
    """What stands for a certificate at a speed of a range that was not solved for; empty where it was."""
    errors = [g.checks["held_out_error"] for g in groups if "held_out_error" in g.checks]
    if not errors:
        return ""
    return (
        f"from the basis of the speed range; at the speeds held out its frequencies err by {max(errors):.1e} at most "
        "and the inertia count finds no further mode"
    )


def contact_lines(group: ModalGroup) -> list[str]:
    """What each closure does, and how well that is known at a speed inside a range."""
    lines = [f"  {contact_sentence(name, c)}" for name, c in group.contacts.items()]
    if lines and "held_out_error" in group.checks:
        error = group.checks.get("normal_force_error", float("nan"))
        sure = f"to about {error:.3g} N" if np.isfinite(error) else "how well is not known"
        lines.append(f"    (between the equilibria of the range, along straight lines in the speed squared; {sure})")
    return lines


def range_summary(harmonic: int, r: SpeedRange) -> list[str]:
    """Samples and held-out errors of a speed range, in lines for the terminal."""
    solved, known, rpm = (
        ", ".join(f"{v:.6g}" for v in speeds * 30 / np.pi)
        for speeds in (r.speeds[r.solved], r.speeds[~r.held], r.speeds[[0, -1]])
    )
    lines = [
        f"{rpm.replace(', ', ' to ')} rpm, nodal diameter {harmonic}: one basis of {r.samples[0].n_modes} coordinates "
        f"for {r.count} modes",
        f"  modes taken from {solved} rpm, stiffness from {known} rpm",
    ]
    held = zip(r.held_out * 30 / np.pi, r.interpolation_error, r.projection_error, r.total_error, strict=True)
    lines += [
        f"  held out {v:.6g} rpm: frequency error {total:.1e} (interpolation {a:.1e}, projection {b:.1e})"
        for v, a, b, total in held
    ]
    return lines


MOST_COLUMNS = 10
"""Frequencies shown of each nodal diameter on the terminal."""


def _hertz_line(frequency: Array, most: int = MOST_COLUMNS) -> str:
    return "".join(f"{f:10.5g}" for f in frequency[:most])


def frequency_lines(basis: ModalBasis, columns: int = 5, rows: int = 15) -> list[str]:
    """The first frequencies of each speed and nodal diameter, a line each, in few lines for the terminal."""
    table = [
        f"{g.speed * 30 / np.pi:8.6g} rpm{f', k = {k:3d}' if basis.sectors > 1 else ''}  "
        f"{_hertz_line(eigenmodes(g).frequency, columns)}  Hz{f'  of {g.n_modes}' if g.n_modes > columns else ''}"
        for (_, k), g in sorted(basis.groups.items())[:rows]
    ]
    more = len(basis.groups) - rows
    return [*table, f"{'':8} and {more} lines more: microslip info shows them"] if more > 0 else table


def _ring_whirl(groups: list[ModalGroup]) -> list[str]:
    """A line of frequencies with gyroscopic coupling for each nodal diameter and wave, if a speed's groups hold it."""
    if (words := whirl_sentence(groups)) is None:
        return []
    lines = [f"  with gyroscopic coupling, in the rotating frame. {words}"]
    for g in groups:
        lines += [f"  k = {g.harmonic:3d}  {_hertz_line(f)}  Hz {way}" for way, (f, _) in waves_of(g).items()]
    bounds = 100 * whirl_bounds(groups)[:MOST_COLUMNS]
    if np.isfinite(bounds).any():
        shown = "".join(f"{b:10.2g}" if np.isfinite(b) else f"{'':10}" for b in bounds)
        lines.append(f"  at most  {shown}  % too high")
    return lines


def _ring_summary(basis: ModalBasis) -> list[str]:
    """A line of frequencies for each nodal diameter, at each speed."""
    lines = [f"one of {basis.sectors} cyclic sectors; the numbers above are of one"]
    for speed in speeds_of(basis):
        groups = [eigenmodes(basis.groups[speed, k]) for k in harmonics_of(basis)]
        first = basis.groups[speed, harmonics_of(basis)[0]]
        state = f"{first.speed * 30 / np.pi:g} rpm" + (f", {first.prestress} prestress" * (first.prestress != "none"))
        proof = between_stations([basis.groups[speed, k] for k in harmonics_of(basis)])
        lines.append(f"{state}: {proof or certificate_words(certify_ring(basis, speed))}")
        lines += contact_lines(first)
        lines += [f"  {text}" for text in sentences(first, basis.reduction)]
        for g in groups:
            more = f"   and {g.n_modes - MOST_COLUMNS} more" if g.n_modes > MOST_COLUMNS else ""
            lines.append(f"  k = {g.harmonic:3d}  {_hertz_line(g.frequency)}  Hz{more}")
        lines += _ring_whirl([basis.groups[speed, k] for k in harmonics_of(basis)])
    first = basis.groups[min(basis.groups)]
    if first.interfaces:
        lines.append(f"compliance at nodal diameter {first.harmonic}: {sentence(basis, first)}")
    return lines
