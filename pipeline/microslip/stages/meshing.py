"""The mesh of a body: drawn by gmsh in a process of its own, or brought; read, named, measured by its quality."""

from __future__ import annotations

import contextlib
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..data import Indices, Material, Mesh
from ..errors import UserError, at, in_its_file, of_file
from ..files import store
from ..interrupts import look
from ..mesh import mesh_problems, part_numbers, read_mesh
from ..mesh.chosen import of_instances, with_parts
from ..mesh.materials import Substitute
from ..mesh.raw import in_file, in_its_line, refused
from ..settings.body import FaceRule, MaterialSettings, implausible
from ..units import SYSTEMS, usual_system
from .job import Job
from .stage import PACKAGE, Made, Report, Stage, seen_from


@in_its_file
def mesh_stage(job: Job, output: Path | None = None, force: bool = False, report: Report = lambda _: None) -> Path:
    """Build, or check that it is up to date, the mesh of a body. Returns its path.

    gmsh runs in a process of its own, which leaves a file.

    Raises:
        UserError: what the mesher says, or a missing source.
    """
    geometry = job.settings.geometry
    if geometry.matrices is not None:
        raise UserError(f"there is nothing to mesh; type: microslip modes {job.folder}", "geometry.matrices")
    if geometry.mesh is not None:
        if not store.ordinary(job.mesh_file).is_file():
            raise UserError(f"there is no file {job.mesh_file}; correct the path", "geometry.mesh")
        return job.mesh_file
    product = output or job.mesh_file
    source = job.folder / (geometry.build or geometry.cad or "")
    if not store.ordinary(source).is_file():
        key = "build" if geometry.build else "cad"
        raise UserError(f"there is no file {source}; correct the path", f"geometry.{key}")
    if geometry.build and not source.resolve().is_relative_to(job.folder.resolve()):
        raise UserError(
            f"{source.resolve()} is outside the body's folder, and only what stands in it is run; copy it there",
            "geometry.build",
        )
    if geometry.cad:
        _refuse_unnamed_faces(job)
    inputs = {
        "geometry": job.raw["geometry"],
        "mesh": job.raw.get("mesh", {}),
        "unit": job.settings.length_unit,
        "source": store.hash_file(source),
        "folder": seen_from(product, job.folder),  # where what it opens is looked for
    }
    if touched := touched_files(job):
        inputs["touched"] = [store.hash_file(f) for f in touched]

    def work() -> Made:
        report(f"meshing {source.name}")
        told, opened = _run_mesher(job, source, product)
        for line in told:
            report(line)
        return Made(opened=opened)

    origin = None if output else job.path
    Stage(product, ("cad",), force, report, origin).make(inputs, work)
    return product


def touched_files(job: Job) -> list[Path]:
    """The files of other bodies on which faces of this one lie, those that are there."""
    named = [job.folder / rule.touching for rule in job.settings.geometry.faces if rule.touching is not None]
    return [file for file in named if store.ordinary(file).is_file()]


def _refuse_unnamed_faces(job: Job) -> None:
    """A face of a CAD file has a name only by a rule: what asks for another is told before the mesher has worked."""
    s = job.settings
    names = sorted({rule.name for rule in s.geometry.faces})
    asked = [("supports", i.face, i.face) for i in s.supports] + [("interfaces", i.name, i.face) for i in s.interfaces]
    asked += [("excitations", i.name, i.face) for i in s.excitations if i.face is not None]
    told = f"it names {', '.join(names) or 'none'}"
    wrong = [
        f"{table}.{label}.face: geometry.faces names no face '{face}'; {told}"
        for table, label, face in asked
        if face not in names
    ]
    if wrong:
        raise UserError("\n".join(wrong))


def _run_mesher(job: Job, source: Path, product: Path) -> tuple[list[str], list[Path]]:
    """Run gmsh in its own process; returns its warnings, and the files that it has read."""
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
        told = Path(scratch) / OPENED
        opened = [Path(name) for name in json.loads(told.read_text())] if told.is_file() else []
    return [line for line in done.stderr.splitlines() if line.startswith("warning:")], opened


def run_apart(words: list[str], scratch: str, limit: float | None = None) -> subprocess.CompletedProcess[str]:
    """Run a Python file, or -m and a module, in a process of its own, as gmsh is.

    It ends when this process does, however that ends, and then removes the folder `scratch`. There it leaves a list of
    the files that it read, but for those of Python, of this package and of `scratch`. After `limit` seconds it is ended
    and `subprocess.TimeoutExpired` raised.
    """
    paths = [str(PACKAGE.parent), os.environ.get("PYTHONPATH", "")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in paths if p)}
    read, write = os.pipe()  # which nobody writes to: its end is the end of this process
    try:
        command = [sys.executable, "-c", _TO_THE_END.format(name=OPENED, own=str(PACKAGE)), scratch, *words]
        pipes: dict[str, Any] = dict.fromkeys(("stdout", "stderr"), subprocess.PIPE)
        process = subprocess.Popen(command, stdin=read, text=True, env=environment, **pipes)
        try:
            return _ended(process, limit)
        finally:
            process.kill()
            process.communicate()
    finally:
        os.close(read)
        os.close(write)


def _ended(process: subprocess.Popen[str], limit: float | None) -> subprocess.CompletedProcess[str]:
    """What a process leaves, which is waited for in Python, where a request to end is heard, `limit` s at most."""
    began = time.monotonic()
    while True:
        with contextlib.suppress(subprocess.TimeoutExpired):
            out, err = process.communicate(timeout=store.POLLED)
            look()  # a terminal asks both
            return subprocess.CompletedProcess(process.args, process.returncode, out, err)
        look()
        if limit is not None and time.monotonic() - began > limit:
            raise subprocess.TimeoutExpired(process.args, limit)


OPENED = "opened.json"
"""Of `run_apart`: files that were read."""

_TO_THE_END = """
import atexit, json, os, runpy, shutil, sys, sysconfig, threading

def end(scratch):
    os.read(0, 1)
    shutil.rmtree(scratch, ignore_errors=True)
    os._exit(1)

opened = set()

def hear(event, words):
    if event == "open" and isinstance(words[0], (str, bytes)):
        name, mode, flags = words
        if not (set(mode) & set("wax+") if mode else flags & (os.O_WRONLY | os.O_RDWR)):
            opened.add(os.path.abspath(os.fsdecode(name)))

def tell(scratch):
    known = [scratch, {own!r}, *sysconfig.get_paths().values(), sys.base_prefix, "/proc", "/sys", "/dev", "/etc"]
    known = [os.path.join(os.path.realpath(folder), "") for folder in known]
    read = opened | {{m.__file__ for m in list(sys.modules.values()) if getattr(m, "__file__", None)}}
    read = {{f for f in map(os.path.realpath, read) if os.path.isfile(f) and not f.endswith(".pyc")}}
    with open(os.path.join(scratch, {name!r}), "w") as file:
        json.dump(sorted(f for f in read if not any(f.startswith(folder) for folder in known)), file)

sys.addaudithook(hear)
atexit.register(tell, sys.argv[1])
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
            f"geometry.cad: the CAD kernel crashed on {job.settings.geometry.cad} "
            f"(signal {-done.returncode}); the file is probably damaged, export it again"
        )
    if done.returncode < 0:
        return f"gmsh stopped with signal {-done.returncode}; change mesh.size or simplify the geometry"
    if done.returncode == 2 and text:
        return text
    last = text.splitlines()[-1] if text else "no message"
    folder, built = str(job.folder.resolve()), job.settings.geometry.build
    lines = re.findall(rf'File "{re.escape(folder)}[/\\]([^"/\\]+)", line (\d+)', text)
    if built and lines:  # it ends before it draws
        return f"{lines[-1][0]}, line {lines[-1][1]}: {last}; correct it"
    return f"meshing failed ({last}); check [geometry] and [mesh]"


@in_its_file
def load_mesh(job: Job, path: Path | None = None) -> tuple[Mesh, list[str]]:
    """Read the mesh of a body, name its faces by the body's rules, and pass the quality gates.

    Returns:
        The mesh and warnings.

    Raises:
        UserError: everything that would spoil a solution.
    """
    path = path or job.mesh_file
    mesh, told = _read_with_materials(job, path)
    if names := job.settings.geometry.instances:
        with at(f"geometry.instances: {path}"):
            mesh = of_instances(mesh, names)
    if job.settings.geometry.mesh is not None:
        mesh = _faces_by_rule(job, mesh)
    if job.settings.masses or job.settings.springs or job.settings.dashpots:
        from ..modal.attached import with_attached

        with of_file(job.path):
            mesh = with_attached(mesh, job.settings)
    mesh = linked_mesh(path, mesh)
    errors, warnings = mesh_problems(mesh)
    if job.settings.cyclic is not None and part_numbers(mesh, tied=True).max() > 0:
        errors.append("the mesh of a cyclic sector falls into parts that share no points; join them")
    if errors:
        with of_file(path):
            raise UserError("\n".join(errors))
    if mesh.sector is not None and job.settings.cyclic is None:
        warnings.append(
            f"{mesh.sector.where}: the body is one of {mesh.sector.sectors} cyclic sectors; "
            "without [cyclic] its cut "
            "faces are free and every frequency is another one"
        )
    size = float(np.ptp(mesh.points, axis=0).max())
    warnings = [in_file(path, w) for w in (*warnings, *told)]
    warnings += [f"{job.path}: {w}" for w in implausible(job.settings, size)]
    return mesh, warnings


def linked_mesh(path: Path, mesh: Mesh) -> Mesh:
    """The mesh with the equations that its file ties it by.

    Raises:
        UserError: with the file, what is wrong with one.
    """
    if mesh.links is None:
        return mesh
    from ..fem.links import linked

    with in_its_line(path):
        return linked(mesh)[0]


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
        raise UserError(f'with length_unit = "{unit}" it must be said; choose ' + ", ".join(SYSTEMS), "material.units")
    instead = Substitute(material.density, material.young, material.poisson)
    mesh = read_mesh(path, unit, system, zero, instead)
    if not mesh.materials:
        raise refused(path, "brings no material; write density, young and poisson in [material]")
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
    """Faces of a user's own mesh given by boxes or by another mesh, those of one name added up; named sets of the file
    are there already.

    Raises:
        UserError: a rule of another kind, nothing that answers to it, the name of a set of the file.
    """
    made: dict[str, dict[str, Indices]] = {}
    for rule in job.settings.geometry.faces:
        with at(f"geometry.faces.{rule.name}"):
            if rule.name in mesh.faces:
                raise UserError("the mesh file has a set of that name; give the face another one")
            answering = _answering(job, mesh, rule)
        face = made.setdefault(rule.name, {})
        for kind, facets in answering.items():
            face[kind] = np.unique(np.concatenate([face[kind], facets]), axis=0) if kind in face else facets
    return replace(mesh, faces={**mesh.faces, **made})


def _answering(job: Job, mesh: Mesh, rule: FaceRule) -> dict[str, Indices]:
    """Type -> facets of a mesh's surface that answer to a rule: those in its box, on another mesh, or both.

    Raises:
        UserError: a rule of another kind, or no facet.
    """
    from ..mesh import boundary_facets, faces_from_points
    from ..mesh.touching import touching_facets

    if rule.cut or rule.box is None and rule.touching is None:
        raise UserError("a mesh file has no labels or colours and is not cut; use box or touching alone")
    found = boundary_facets(mesh)
    if rule.box is not None:
        low, high = np.array(rule.box[:3]), np.array(rule.box[3:])
        slack = 1e-6 * np.ptp(mesh.points, axis=0).max()
        inside = ((mesh.points >= low - slack) & (mesh.points <= high + slack)).all(axis=1)
        found = faces_from_points(found, np.flatnonzero(inside), mesh.n_points)
    if found and rule.touching is not None:
        found = touching_facets(mesh, _other_mesh(job, rule.touching), found)
    if not found:
        where = f"lies on {rule.touching}" if rule.touching is not None else "is in the box; widen it"
        raise UserError(f"no facet of the surface {where}")
    return found


def _other_mesh(job: Job, name: str) -> Mesh:
    """The mesh that a face lies on: of another file, or what of the body's own deck is not this
    body."""
    file, instances = job.folder / name, job.settings.geometry.instances
    if not store.ordinary(file).is_file():
        raise UserError(f"there is no file {file}", "touching")
    mesh = read_mesh(file, job.settings.length_unit)
    if file.resolve() != job.mesh_file.resolve():
        return mesh
    others = [part for part in with_parts(mesh).instances if part not in instances]
    if not instances or not others:
        raise UserError("names the body's own mesh, of which geometry.instances leaves nothing out", "touching")
    return of_instances(mesh, others)
