"""What keeps these pages true: tables made by program, examples that are run, the reference of body.toml.

Marks in a page:

    <!-- table NAME --> ... <!-- end -->     filled in by make_pictures.py
    <!-- file PATH -->                       the fenced block that follows is written to PATH
    <!-- run -->, <!-- run slow -->         the lines of the block that follows are typed into a shell
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from microslip.body import BodySettings, _is_length

HERE = Path(__file__).parent
BLOCK = re.compile(r"<!-- (file|run)(?: ([^\n]*?))? -->\n+```\w*\n(.*?)```", re.S)


def fill(page: str, name: str, text: str) -> None:
    """Put `text` between the marks ``<!-- table NAME -->`` and ``<!-- end -->`` of a page."""
    path = HERE / page
    old = path.read_text(encoding="utf-8")
    place = re.compile(rf"(<!-- table {name} -->\n).*?(<!-- end -->)", re.S)
    new, count = place.subn(lambda m: f"{m[1]}{text.strip()}\n{m[2]}", old)
    if count != 1:
        raise SystemExit(f"{page}: has {count} places for the table '{name}'")
    if new != old:
        path.write_text(new, encoding="utf-8")


def filled(page: str, name: str) -> str:
    """What stands between the marks now."""
    found = re.search(rf"<!-- table {name} -->\n(.*?)<!-- end -->", (HERE / page).read_text(encoding="utf-8"), re.S)
    assert found, f"{page} has no table {name}"
    return found[1].strip()


def table(head: list[str], rows: list[list[Any]]) -> str:
    """A Markdown table; columns that begin with a bare number, or one with its unit, are aligned right."""
    right = ["---:" if re.fullmatch(r"[-+]?[\d.e-]+( \S{1,3})?", str(v)) else "---" for v in rows[0]]
    lines = [head, right, *[[str(v) for v in row] for row in rows]]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


# examples ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Step:
    """A file to write (`path`) or lines to type; `slow` ones are left out of the quick tests."""

    path: str
    text: str
    slow: bool


def steps(page: str) -> Iterator[Step]:
    """The examples of a page in order."""
    for kind, more, text in BLOCK.findall((HERE / page).read_text(encoding="utf-8")):
        yield Step(more if kind == "file" else "", text, kind == "run" and more == "slow")


def play(page: str, folder: Path, slow: bool = True) -> str:
    """Do what a page says in an empty folder, with this Python's `microslip`; returns what the commands printed.

    Raises:
        RuntimeError: a command failed.
    """
    shown = []
    for step in steps(page):
        if step.path:
            (folder / step.path).parent.mkdir(parents=True, exist_ok=True)
            (folder / step.path).write_text(step.text, encoding="utf-8")
        elif slow or not step.slow:
            shown += [typed(line, folder) for line in step.text.splitlines() if line and not line.startswith("#")]
    return "\n".join(shown)


def typed(line: str, folder: Path) -> str:
    """Run one line in a shell."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    environment = {**os.environ, "PATH": path, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(line, shell=True, cwd=folder, env=environment, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{line}\n{done.stdout}{done.stderr}")
    return f"$ {line}\n{done.stdout}"


# body.toml ---------------------------------------------------------------------------------------------------------

MEANING: dict[str, tuple[str, str]] = {
    # key: (unit, meaning); "*" stands for the unit of the file's lengths
    "name": ("", "names the products: `meshes/NAME.msh`, `build/NAME/`"),
    "description": ("", "one line for the report"),
    "length_unit": ("", "unit of every length in this file and of the mesh or CAD file"),
    "reduction": ("", "method of reduction, see reduction.md"),
    "free": ("", "the body is meant to float; rigid motions are kept and flagged"),
    "note": ("", "a remark the report repeats"),
    "geometry.build": ("", "a Python file that draws the body with gmsh"),
    "geometry.cad": ("", "a STEP, BREP or IGES file"),
    "geometry.mesh": ("", "a mesh file (.inp, .msh, .med, .unv, .vtu, ...) with named sets"),
    "geometry.matrices.stiffness": ("", "K: FILE or FILE#NAME; .mtx, .mat, .h5, .op4, DMIG cards, .sti"),
    "geometry.matrices.mass": ("", "M, likewise"),
    "geometry.matrices.damping": ("", "C, likewise; instead of [damping]"),
    "geometry.matrices.gyroscopic": ("", "G, likewise, skew-symmetric, at the speed of rotation.speeds_rpm"),
    "geometry.matrices.dofs": (
        "", "node and direction (1 to 6) of every row: lines `node.direction` or two columns; not needed where the "
        "matrices name their rows, or where every node has three or six rows in the order of `nodes`",
    ),
    "geometry.matrices.nodes": ("", "number, x, y, z: .csv, .mat, .h5, GRID cards, or a mesh with its sets"),
    "geometry.matrices.units": ("", "of the matrices; m-kg-s, mm-t-s, in-lbf-s go without saying with m, mm, in"),
    "geometry.matrices.grounded": ("", "the supports are in the matrices already"),
    "geometry.matrices.superelement": ("", "rows without a node are the generalised coordinates of a superelement"),
    "geometry.matrices.sets": ("", "table: name of a set = list of node numbers"),
    "geometry.parameters": ("", "table handed to the build file"),
    "geometry.faces.name": ("", "name of the face; several rules of one name add up"),
    "geometry.faces.label": ("", "the surface's label in the CAD file, or a part of it"),
    "geometry.faces.colour": ("0-255", "the surface's colour, red, green, blue"),
    "geometry.faces.box": ("*", "x, y, z of the low and of the high corner; what lies wholly inside"),
    "geometry.faces.surfaces": ("", "numbers from the table of `microslip info FILE`"),
    "mesh.size": ("*", "size of the elements; chosen from the body where it is not given"),
    "mesh.order": ("", "order of the elements; 1 is far too stiff in bending"),
    "mesh.local": ("*", "table: name of a face = size there"),
    "material.name": ("", "for the report"),
    "material.density": ("kg/m3", ""),
    "material.young": ("Pa", "Young's modulus; orthotropic: E1, E2, E3"),
    "material.poisson": ("", "Poisson's ratio; orthotropic: nu12, nu23, nu13"),
    "material.shear": ("Pa", "orthotropic only: G12, G23, G13"),
    "material.axes": ("", "orthotropic only: the material's three axes in body axes"),
    "material.expansion": ("1/K", "thermal expansion, one or along the three material axes"),
    "material.temperature": ("K", "rising temperatures of `modulus_factor`"),
    "material.modulus_factor": ("", "factor on the moduli at those temperatures; linear between, constant outside"),
    "material.from": ("", "the mesh file's own material, or materials"),
    "material.units": ("", "of the mesh file; m-kg-s, mm-t-s, in-lbf-s go without saying with m, mm, in"),
    "material.unusual": ("", "silences the warnings about implausible units"),
    "temperature.from": ("", "both temperatures from the mesh file"),
    "temperature.scale": ("", "of the mesh file's temperatures: °C or K"),
    "temperature.reference": ("K", "free of thermal stress"),
    "temperature.uniform": ("K", "one temperature everywhere"),
    "temperature.file": ("*, K", "CSV lines x, y, z, T; linear between, nearest outside"),
    "supports.face": ("", "face, or set of points, that is held"),
    "supports.directions": ("", "body directions in which it is held"),
    "supports.rotations": ("", "hold the rotations of its nodes too (matrices only)"),
    "rotation.axis": ("", "direction of the rotor axis"),
    "rotation.point": ("*", "a point of the axis"),
    "cyclic.sectors": ("", "N, how many of this body make the ring"),
    "cyclic.left": ("", "face towards the previous sector"),
    "cyclic.right": ("", "face towards the next sector: the left one turned by 2 pi / N about the rotation axis"),
    "cyclic.nodal_diameters": ("", "which to analyse, or all from 0 to N/2"),
    "output.stress_nodal_diameters": ("", "nodal diameters whose stress modes are kept (a file grows by them)"),
    "rotation.speeds_rpm": ("rpm", "speeds to analyse, rising"),
    "rotation.prestress": ("", "how the stiffness at speed is made, see [modes](modes.md#equilibrium-at-speed)"),
    "rotation.spin_softening": ("", "whether -Omega^2 M P is in K"),
    "rotation.gyroscopic": ("", "whether the modes with gyroscopic coupling are computed at speed, see rotation.md"),
    "rotation.engine_orders": ("", "lines of the Campbell diagram"),
    "rotation.range_rpm": ("rpm", "lowest and highest speed of one basis for all speeds between, see speeds.md"),
    "rotation.range_points": ("", "speeds of the Campbell diagram over the range"),
    "rotation.range_tolerance": ("", "relative frequency error allowed at held-out speeds of the range"),
    "rotation.range_stress": ("", "strain and stress modes at every speed of the range (large files)"),
    "loads.kind": ("", "a static load that acts at every speed"),
    "loads.face": ("", "of a pressure or a force"),
    "loads.point": ("*", "of a force"),
    "loads.value": ("Pa", "of a pressure, positive into the body"),
    "loads.vector": ("m/s2 or N", "of gravity or a force"),
    "closures.name": ("", "the contact's name in the modal file and the report"),
    "closures.face": ("", "face whose points are held apart from the other side (the finer meshed one)"),
    "closures.against": ("", "the face it meets, or `ground`"),
    "closures.sector_shift": ("", "where that face is: next blade 1, previous -1, this body 0"),
    "closures.interference": ("*", "by how much the drawn faces overlap when assembled; negative: a further gap"),
    "closures.point": ("*", "of the ground; the middle of the face if not given"),
    "closures.normal": ("", "of the ground, towards the body; opposite to the face if not given"),
    "closures.modes": ("", "`open`: the modes leave the contact to the friction law, its static force stays; "
        "`closed`: they keep its stiffness along the normal, free to slide"),
    "closures.slide": ("*", "how far the faces may slide on each other; 1.5 elements if not given"),
    "closures.penalty": ("Pa/m", "only the number of iterations depends on it; chosen from the modulus if not given"),
    "bolts.name": ("", ""),
    "bolts.face": ("", "the ring under the head"),
    "bolts.against": ("", "the ring under the nut, or `ground`"),
    "bolts.preload": ("N", "force of the bolt; keeps its direction"),
    "interfaces.name": ("", ""),
    "interfaces.face": ("", "the contact patch"),
    "interfaces.role": ("", "see [conventions](conventions.md#frames)"),
    "interfaces.partner": ("", "name of the interface it faces"),
    "interfaces.sector_shift": ("", "where the partner is: next blade 1, previous -1, else 0"),
    "interfaces.t2": (
        "", "direction whose projection on the patch becomes t2; if not given z, or y where the patch lies across z",
    ),
    "interfaces.normal": ("", "outward normal of a list of nodes that does not tell it itself (matrices only)"),
    "interfaces.coordinates": ("", "rigid: six; characteristic: six and the softest shapes of the patch"),
    "interfaces.count": ("", "how many characteristic shapes"),
    "excitations.name": ("", ""),
    "excitations.point": ("*", "where a unit force acts"),
    "excitations.node": ("", "or the number of a node in the mesh file"),
    "excitations.face": ("", "or the face over which it is spread"),
    "excitations.direction": ("", "of the force; its length does not matter"),
    "excitations.pressure": ("", "a unit pressure (1 Pa) on the face instead"),
    "monitors.name": ("", ""),
    "monitors.point": ("*", "where displacements are read"),
    "monitors.node": ("", "or the number of a node in the mesh file"),
    "monitors.directions": ("", "body directions"),
    "gauges.name": ("", ""),
    "gauges.point": ("*", "where the strain is read"),
    "gauges.direction": ("", "of the strain gauge"),
    "modes.count": ("", "how many modes"),
    "modes.max_frequency": ("Hz", "only modes below it; `count` is then the upper limit"),
    "modes.certify": ("", "prove by an inertia count that none is missing"),
    "modes.solver": ("", "sparse direct solver, see [platforms](platforms.md)"),
    "damping.ratio": ("", "one damping ratio D for all modes"),
    "damping.table": ("", "a ratio per mode; the last one serves all further modes"),
    "damping.alpha": ("1/s", "Rayleigh damping alpha M + beta K"),
    "damping.beta": ("s", "Rayleigh damping"),
    "output.shapes": ("", "mode shapes at all nodes"),
    "output.patch_shapes": ("", "mode shapes at the points of contact and load faces"),
    "output.gauss": ("", "strain and stress modes at integration points (the largest part of the file)"),
    "output.stiffening": ("", "whether the modal file holds how large rigid motion stiffens the body, see rotation.md"),
    "output.nodal_stress": ("", "strain and stress modes smoothed to the nodes"),
}


def body_reference() -> str:
    """Tables of every key of body.toml, made from the models that read it.

    Raises:
        SystemExit: a key without a meaning here, or a meaning without a key.
    """
    sections = list(_sections(BodySettings, "", ""))
    known = {f"{prefix}{key}" for prefix, _, _, model in sections for key in _plain_keys(model)}
    if wrong := sorted(known ^ set(MEANING)):
        raise SystemExit(f"docs/pages.py: MEANING and body.toml differ in {', '.join(wrong)}")
    return "\n\n".join(_section(*s) for s in sections)


def _sections(model: Any, prefix: str, title: str) -> Iterator[tuple[str, str, str, Any]]:
    yield prefix, title, "" if not prefix else " ".join((model.__doc__ or "").split("\n\n")[0].split()), model
    for key, field in _fields(model).items():
        for number, (inner, many) in enumerate(_inner(field.annotation)):
            name = f"{prefix}{key}"
            head = f"[[{name}]]" if many else f"[{name}]"
            yield from _sections(inner, f"{name}.", head + (", or instead" if number else ""))


def _fields(model: Any) -> dict[str, Any]:
    """Keys as they are written -> fields."""
    return {field.alias or name: field for name, field in model.model_fields.items()}


def _inner(annotation: Any, many: bool = False) -> list[tuple[Any, bool]]:
    """The settings models inside an annotation (several are alternatives), and whether a list of them is meant."""
    if isinstance(annotation, type) and hasattr(annotation, "model_fields"):
        return [(annotation, many)]
    many = many or getattr(annotation, "__origin__", None) is tuple
    return [found for argument in getattr(annotation, "__args__", ()) for found in _inner(argument, many)]


def _plain_keys(model: Any) -> list[str]:
    return [k for k, f in _fields(model).items() if not _inner(f.annotation)]


def _section(prefix: str, title: str, text: str, model: Any) -> str:
    schema = model.model_json_schema()["properties"]
    rows = []
    for key in _plain_keys(model):
        field = _fields(model)[key]
        unit, meaning = MEANING[f"{prefix}{key}"]
        if _is_length(field) and not unit.startswith("*"):
            raise SystemExit(f"docs/pages.py: {prefix}{key} is a length; mark its unit with *")
        unit = unit.replace("*", "length_unit")
        rows.append([f"`{key}`", _type(schema[key]), unit, _default(field), meaning])
    head = f"## {title}" if title else "## Top of the file"
    return f"{head}\n\n" + (f"{text}\n\n" if text else "") + table(["key", "value", "unit", "default", "meaning"], rows)


def _default(field: Any) -> str:
    if field.is_required():
        return "**required**"
    value = field.get_default(call_default_factory=True)
    if value is None or value in ("", (), {}):
        return ""
    return f"`{_toml(value)}`"


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml(v) for v in value) + "]"
    return f'"{value}"' if isinstance(value, str) else str(value)


WORDS = {"number": "number", "integer": "integer", "string": "text", "boolean": "true or false"}
SIGNS = {"exclusiveMinimum": ">", "gt": ">", "minimum": ">=", "exclusiveMaximum": "<", "lt": "<", "maximum": "<="}


def _type(schema: dict[str, Any]) -> str:
    """What may be written, in words, from a field's JSON schema."""
    if "anyOf" in schema:
        return " or ".join(dict.fromkeys(_type(s) for s in schema["anyOf"] if s.get("type") != "null"))
    if "enum" in schema or "const" in schema:
        return ", ".join(f"`{_toml(v)}`" for v in schema.get("enum", [schema.get("const")]))
    kind = schema.get("type")
    if kind == "array":
        count = schema.get("minItems") if schema.get("minItems") == schema.get("maxItems") else None
        item = (schema.get("prefixItems") or [schema.get("items", {})])[0]
        inner = re.sub(r"\b(number|integer)\b", r"\1s", _type(item))
        return f"{count} x ({inner})" if item.get("type") == "array" else f"{count or 'list of'} {inner}"
    if kind == "object":
        return "table"
    bounds = [f"{sign} {schema[k]:g}" for k, sign in SIGNS.items() if k in schema]
    return " ".join([WORDS.get(str(kind), "any"), ", ".join(bounds)]).strip()
