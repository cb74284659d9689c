"""Reader of Abaqus and CalculiX input files: nodes, solid cells, facets, node sets and element-based surfaces.

Written against the keyword descriptions in the two programs' manuals. It keeps node numbers and reads ``*SURFACE``,
in which such programs name faces; a file whose meaning it cannot keep (instances that are moved, generated nodes,
local systems) is refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..data import Array, Indices
from ..elasticity import turned, turned_strain
from ..files.store import ordinary
from .materials import isotropic_rows, orthotropic_row
from .raw import Damaged, DeckMaterial, Numbering, RawMesh, is_number, joined, refuse_twice
from .supports import Constraints, add_supports

_SOLIDS = {
    4: "tetra", 10: "tetra10", 8: "hexahedron", 20: "hexahedron20", 27: "hexahedron27", 6: "wedge", 15: "wedge15",
}  # fmt: skip
_BRICK27 = (*range(20), 26, 24, 23, 25, 21, 22, 20)
"""Places in C3D27 (after the edges the centre, then the faces S1 to S6) of VTK's nodes."""
_CORNERS = {3: 3, 6: 3, 4: 4, 8: 4, 9: 4}  # nodes of a facet -> its corners
_FACES: dict[str, tuple[tuple[int, ...], ...]] = {
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "hexahedron": ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
}
_REFUSED = {
    "NGEN": "generates nodes by *NGEN", "NFILL": "generates nodes by *NFILL", "NCOPY": "copies nodes by *NCOPY",
    "ELGEN": "generates cells by *ELGEN", "ELCOPY": "copies cells by *ELCOPY", "SYSTEM": "uses a local *SYSTEM",
}  # fmt: skip
_KEYWORDS = {"NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "INSTANCE", "ASSEMBLY", "END ASSEMBLY"} | set(_REFUSED)
_KEYWORDS |= {"MATERIAL", "ELASTIC", "DENSITY", "EXPANSION", "SOLID SECTION", "ORIENTATION"}
_KEYWORDS |= {"INITIAL CONDITIONS", "TEMPERATURE", "BOUNDARY", "STEP", "TRANSFORM"}
_ANYWHERE = {"MATERIAL", "ELASTIC", "DENSITY", "EXPANSION", "INITIAL CONDITIONS", "TEMPERATURE"}
_ANYWHERE |= {"BOUNDARY", "STEP", "TRANSFORM"}
_HELD = {
    "ENCASTRE": "xyz", "PINNED": "xyz", "XSYMM": "x", "YSYMM": "y", "ZSYMM": "z", "XASYMM": "yz", "YASYMM": "xz",
    "ZASYMM": "xy",
}  # fmt: skip


@dataclass
class _Cells:
    """Solid cells of one type. `ids` (e,), `nodes` (e, k) node numbers."""

    kind: str
    ids: Indices
    nodes: Indices


@dataclass
class _Deck:
    """What the keywords have said so far. Names of sets are free of case: their keys are in capitals."""

    node_id: list[Indices] = field(default_factory=list)
    points: list[Array] = field(default_factory=list)
    solids: list[_Cells] = field(default_factory=list)
    facets: list[_Cells] = field(default_factory=list)
    written: dict[str, str] = field(default_factory=dict)
    node_sets: dict[str, list[Indices]] = field(default_factory=dict)
    cell_sets: dict[str, list[Indices]] = field(default_factory=dict)
    surfaces: list[tuple[str, str, list[list[str]]]] = field(default_factory=list)
    instances: int = 0
    materials: dict[str, _Material] = field(default_factory=dict)
    current: str = ""
    orientations: dict[str, Array | str] = field(default_factory=dict)
    sections: list[tuple[str, str, str]] = field(default_factory=list)
    temperatures: list[tuple[int, str, float]] = field(default_factory=list)
    held: list[tuple[str, str]] = field(default_factory=list)
    not_held: list[str] = field(default_factory=list)
    step: int = 0
    renewed: int = -1
    turned: bool = False


@dataclass
class _Material:
    """Constants as written: name; (t, 3) E, nu, T or 9 engineering constants, or text why they are not read."""

    name: str
    isotropic: Array | None = None
    orthotropic: Array | None = None
    stiffness: Array | None = None
    refused: str = ""
    density: float | None = None
    expansion: Array = field(default_factory=lambda: np.zeros(3))


def read_inp(path: Path) -> RawMesh:
    """Read an input file and those it includes.

    Raises:
        Damaged: content that is inconsistent, or whose meaning would be lost.
    """
    deck = _Deck()
    assembly = False
    for keyword, parameters, lines in _blocks(_lines(path, 0)):
        if keyword in _REFUSED:
            raise Damaged(f"the file {_REFUSED[keyword]}; write out every node and cell")
        if keyword in ("ASSEMBLY", "END ASSEMBLY"):
            assembly = keyword == "ASSEMBLY"
        elif keyword == "INSTANCE":
            deck.instances += 1
            if deck.instances > 1 or any(_fields(line) for line in lines):
                raise Damaged("the file holds several or moved *INSTANCEs; write it without parts and assemblies")
        elif keyword in _READERS and (
            not assembly or "INSTANCE" in parameters or keyword == "SURFACE" or keyword in _ANYWHERE
        ):
            if "INPUT" in parameters:
                lines = [*lines, *(line for line in _lines(path.parent / parameters["INPUT"], 1))]
            _READERS[keyword](deck, parameters, lines)
    raw = _assembled(deck)
    if not path.read_bytes().endswith(b"\n"):
        raw.unended = "a last line without an end"
    return raw


def _lines(path: Path, depth: int) -> Iterator[str]:
    """Lines of a file and of those it includes, without comments and empty lines."""
    if depth > 10:
        raise Damaged(f"the file includes itself by way of {path.name}")
    try:
        text = ordinary(path).read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise Damaged(f"the included file {path} cannot be read ({error.strerror})") from None
    for line in text.splitlines():
        line = line.strip()
        if re.match(r"\*INCLUDE\b", line, re.IGNORECASE):
            target = _parameters(line).get("INPUT", "")
            if not target:
                raise Damaged("an *INCLUDE names no file")
            yield from _lines(path.parent / target, depth + 1)
        elif line and not line.startswith("**"):
            yield line


def files_of(path: Path, depth: int = 0) -> list[Path]:
    """An input file and all that it reads from others, at any depth; what is missing is told where it is read."""
    data = path.read_bytes() if path.is_file() and depth <= 10 else b""
    found = [path]
    for line in re.findall(r"^\s*\*[^*\n].*$", data.decode(errors="replace"), re.M) if b"INPUT" in data.upper() else ():
        if name := _parameters(line).get("INPUT"):
            found += files_of(path.parent / name, depth + 1)
    return list(dict.fromkeys(found))


def _blocks(lines: Iterator[str]) -> Iterator[tuple[str, dict[str, str], list[str]]]:
    """(keyword, parameters, data lines) of each keyword that matters. A keyword line may go on after a comma."""
    head = ""
    data: list[str] = []
    for line in lines:
        if line.startswith("*"):
            if _keyword(head) in _KEYWORDS:
                yield _keyword(head), _parameters(head), data
            head, data = line, []
        elif head.endswith(",") and not data:
            head += line
        else:
            data.append(line)
    if _keyword(head) in _KEYWORDS:
        yield _keyword(head), _parameters(head), data


def _keyword(line: str) -> str:
    return " ".join(line[1:].partition(",")[0].upper().split())


def _parameters(line: str) -> dict[str, str]:
    pairs = (word.partition("=") for word in line.split(",")[1:])
    return {key.strip().upper(): value.strip().strip('"') for key, _, value in pairs if key.strip()}


def _fields(line: str) -> list[str]:
    return [word.strip() for word in line.split(",") if word.strip()]


def _numbers(text: str, what: str) -> Indices:
    words = [word for word in text.replace(",", " ").split() if word]
    try:
        values = np.array(words, dtype=np.int64) if words else np.zeros(0, dtype=np.int64)
    except (ValueError, OverflowError):
        raise Damaged(f"{what} holds something that is no whole number") from None
    if len(values) and values.min() < 1:
        raise Damaged(f"{what} holds a number below 1")
    return values


def _read_nodes(deck: _Deck, parameters: dict[str, str], lines: list[str]) -> None:
    if parameters.get("SYSTEM", "R").upper() not in ("R", ""):
        raise Damaged("*NODE uses cylindrical or spherical coordinates; write Cartesian ones")
    rows = [line.split(",") for line in lines]
    ids = _numbers(",".join(row[0] for row in rows), "*NODE")
    if len(ids) != len(rows):
        raise Damaged("*NODE holds a line without a number")
    values = _table([",".join(row[1:4]) for row in rows], "*NODE")
    deck.node_id.append(ids)
    deck.points.append(np.array([v + [0.0] * (3 - len(v)) for v in values]).reshape(-1, 3))
    if "NSET" in parameters:
        _set(deck, deck.node_sets, parameters["NSET"]).append(ids)


def _read_elements(deck: _Deck, parameters: dict[str, str], lines: list[str]) -> None:
    kind = parameters.get("TYPE", "").upper()
    match = re.match(r"(D?C3D|AC3D|CPS|CPE|CAX|M3D|SFM3D|R3D|STRI|DS|S|DC2D)(\d+)", kind)
    if match is None:
        return  # beams, springs, masses and the like
    solid = match[1] in ("C3D", "DC3D", "AC3D")
    count = 6 if match[0] == "STRI65" else int(match[2])
    if solid and count not in _SOLIDS:
        first = _numbers(lines[0].partition(",")[0], "*ELEMENT") if lines else np.zeros(1, dtype=np.int64)
        raise Damaged(f"element {first[0]} is of type {kind}, which cannot be assembled")
    if not solid and count not in _CORNERS:
        return
    table = _numbers(",".join(lines), f"*ELEMENT, TYPE={kind}")
    if len(table) % (count + 1):
        raise Damaged(f"*ELEMENT, TYPE={kind} holds another number of nodes than its cells need")
    table = table.reshape(-1, count + 1)
    nodes = table[:, 1:] if not (solid and count == 27) else table[:, 1:][:, _BRICK27]
    cells = _Cells(_SOLIDS[count] if solid else "facet", table[:, 0], nodes)
    (deck.solids if solid else deck.facets).append(cells)
    if "ELSET" in parameters:
        _set(deck, deck.cell_sets, parameters["ELSET"]).append(cells.ids)


def _set(deck: _Deck, sets: dict[str, list[Indices]], name: str) -> list[Indices]:
    deck.written.setdefault(name.upper(), name)
    return sets.setdefault(name.upper(), [])


def _read_node_set(deck: _Deck, parameters: dict[str, str], lines: list[str]) -> None:
    _read_set(deck, deck.node_sets, parameters, "NSET", lines, joined(deck.node_id))


def _read_cell_set(deck: _Deck, parameters: dict[str, str], lines: list[str]) -> None:
    known = joined(cells.ids for cells in (*deck.solids, *deck.facets))
    _read_set(deck, deck.cell_sets, parameters, "ELSET", lines, known)


def _read_set(
    deck: _Deck, sets: dict[str, list[Indices]], parameters: dict[str, str], keyword: str, lines: list[str],
    known: Indices,
) -> None:  # fmt: skip
    name = parameters.get(keyword, "")
    if not name:
        raise Damaged(f"a *{keyword} has no name")
    members = _set(deck, sets, name)
    for line in lines:
        words = _fields(line)
        if "GENERATE" in parameters:
            members.append(_generated(words, known, f"*{keyword}, {keyword}={name}"))
            continue
        numbers = [word.rpartition(".")[2] for word in words if word.rpartition(".")[2].isdecimal()]
        members.append(_numbers(",".join(numbers), f"*{keyword}, {keyword}={name}"))
        for word in words:
            if not word.rpartition(".")[2].isdecimal():
                members += sets.get(word.strip('"').upper(), [])


def _generated(words: list[str], known: Indices, what: str) -> Indices:
    """Numbers first, first + step, ... last, of those that exist."""
    limits = _numbers(",".join(words), what)
    if len(limits) not in (2, 3):
        raise Damaged(f"{what} with GENERATE needs first, last and step")
    first, last, step = (*limits.tolist(), 1)[:3]
    return known[(known >= first) & (known <= last) & ((known - first) % step == 0)]


def _read_surface(deck: _Deck, parameters: dict[str, str], lines: list[str]) -> None:
    name, kind = parameters.get("NAME", ""), parameters.get("TYPE", "ELEMENT").upper()
    if name and "COMBINE" not in parameters:
        deck.surfaces.append((name, kind, [words for line in lines if (words := _fields(line))]))


def _table(lines: list[str], what: str) -> list[list[float]]:
    """Numbers of the data lines; an empty place counts as 0."""
    try:
        rows = [line.rstrip().rstrip(",").split(",") for line in lines]
        return [[float(w.replace("D", "e").replace("d", "e")) if w.strip() else 0.0 for w in row] for row in rows]
    except ValueError as error:
        raise Damaged(f"{what} holds something that is no number ({str(error)[-60:]})") from None


def _read_material(deck: _Deck, parameters: dict[str, str], lines: list[str]) -> None:
    name = parameters.get("NAME", "")
    if not name:
        raise Damaged("a *MATERIAL has no name")
    deck.current = name.upper()
    deck.materials[deck.current] = _Material(name)


def _of(deck: _Deck, keyword: str) -> _Material:
    if not deck.current:
        raise Damaged(f"*{keyword} stands before any *MATERIAL")
    return deck.materials[deck.current]


def _read_elastic(deck: _Deck, parameters: dict[str, str], lines: list[str]) -> None:
    material, kind = _of(deck, "ELASTIC"), " ".join(parameters.get("TYPE", "ISO").upper().split())
    rows, what = _table(lines, f"*ELASTIC of {material.name}"), f"*ELASTIC, TYPE={kind} of the material {material.name}"
    if kind.startswith("ISO"):
        if any(len(row) not in (2, 3) for row in rows) or not rows:
            raise Damaged(f"{what} needs E, nu and perhaps a temperature a line")
        material.isotropic = np.array([[*row, 0.0][:3] for row in rows])
        return
    values = np.array([v for row in rows for v in row])
    if kind not in ("ENGINEERING CONSTANTS", "ORTHO", "ORTHOTROPIC"):
        material.refused = f"*ELASTIC, TYPE={kind}"
    elif len(values) not in (9, 10):
        material.refused = f"{what} with {len(values)} numbers (nine, at one temperature, are read)"
    elif kind == "ENGINEERING CONSTANTS":
        material.orthotropic = values[:9]
    else:
        material.stiffness = values[:9]


def _read_density(deck: _Deck, parameters: dict[str, str], lines: list[str]) -> None:
    material = _of(deck, "DENSITY")
    rows = _table(lines, f"*DENSITY of {material.name}")
    if not rows or not rows[0]:
        raise Damaged(f"*DENSITY of the material {material.name} holds no number")
    if len({row[0] for row in rows}) > 1:
        material.refused = "a density that depends on temperature"
    material.density = rows[0][0]


def _read_expansion(deck: _Deck, parameters: dict[str, str], lines: list[str]) -> None:
    material, kind = _of(deck, "EXPANSION"), parameters.get("TYPE", "ISO").upper()
    rows = _table(lines, f"*EXPANSION of {material.name}")
    count = 3 if kind.startswith("ORTHO") else 1
    if not rows or any(len(row) not in (count, count + 1) for row in rows) or kind.startswith("ANISO"):
        raise Damaged(f"*EXPANSION, TYPE={kind} of the material {material.name} is not read; use ISO or ORTHO")
    values = np.array([row[:count] for row in rows])
    if np.ptp(values, axis=0).any():
        material.refused = "an expansion that depends on temperature"
    material.expansion = np.broadcast_to(values[0], 3).copy()


def _read_section(deck: _Deck, parameters: dict[str, str], lines: list[str]) -> None:
    keys = ("ELSET", "MATERIAL", "ORIENTATION")
    deck.sections.append((parameters.get(keys[0], ""), parameters.get(keys[1], ""), parameters.get(keys[2], "")))


def _read_orientation(deck: _Deck, parameters: dict[str, str], lines: list[str]) -> None:
    name, system = parameters.get("NAME", ""), parameters.get("SYSTEM", "RECTANGULAR").upper()
    key = name.upper()
    if not system.startswith("R") or parameters.get("DEFINITION", "COORDINATES").upper() != "COORDINATES":
        deck.orientations[key] = f"*ORIENTATION, NAME={name} of the system {system}"
        return
    rows = _table(lines, f"*ORIENTATION, NAME={name}")
    if len(rows) > 1 and len(rows[1]) > 1 and rows[1][1]:
        deck.orientations[key] = f"*ORIENTATION, NAME={name} with an additional rotation"
        return
    if not rows or len(rows[0]) not in (6, 9):
        raise Damaged(f"*ORIENTATION, NAME={name} needs the six coordinates of two points")
    origin = np.array(rows[0][6:9]) if len(rows[0]) == 9 else np.zeros(3)
    a, b = np.array(rows[0][:3]) - origin, np.array(rows[0][3:6]) - origin
    normal = np.cross(a, b)
    if not np.linalg.norm(normal) > 1e-9 * np.linalg.norm(a) * np.linalg.norm(b):
        raise Damaged(f"the points of *ORIENTATION, NAME={name} lie on a line")
    x, z = a / np.linalg.norm(a), normal / np.linalg.norm(normal)
    deck.orientations[key] = np.array([x, np.cross(z, x), z])


def _read_temperature(deck: _Deck, parameters: dict[str, str], lines: list[str], column: int = 1) -> None:
    if "FILE" in parameters or "BSTEP" in parameters:
        raise Damaged("*TEMPERATURE reads from a results file; write the temperatures out")
    for line in lines:
        words = _fields(line)
        try:
            deck.temperatures.append((column, words[0], float(words[1])))
        except (IndexError, ValueError):
            raise Damaged(f"*TEMPERATURE holds the line '{line[:60]}', no node (or set) and temperature") from None


def _read_initial(deck: _Deck, parameters: dict[str, str], lines: list[str]) -> None:
    if parameters.get("TYPE", "").upper() == "TEMPERATURE":
        _read_temperature(deck, parameters, lines, column=0)


def _read_step(deck: _Deck, parameters: dict[str, str], lines: list[str]) -> None:
    deck.step += 1


def _read_transform(deck: _Deck, parameters: dict[str, str], lines: list[str]) -> None:
    deck.turned = True


def _read_boundary(deck: _Deck, parameters: dict[str, str], lines: list[str]) -> None:
    """Displacements that are zero. OP=NEW takes the place of all there was before the step."""
    if parameters.get("OP", "").upper() == "NEW" and deck.renewed != deck.step:
        deck.held, deck.not_held, deck.renewed = [], [], deck.step
    other = {"SUBMODEL", "USER", "FIXED", "BASE NAME"} & set(parameters)
    if other or parameters.get("TYPE", "DISPLACEMENT").upper() != "DISPLACEMENT":
        deck.not_held.append(f"a *BOUNDARY of the kind {', '.join(other) or parameters['TYPE']}")
        return
    for line in lines:
        words = [word.strip() for word in line.split(",")] + 3 * [""]
        try:
            directions = _HELD.get(words[1].upper()) or _zeros(words)
            deck.held.append((words[0].strip('"'), directions))
        except ValueError:
            deck.not_held.append(f"the line '{line[:60]}' of *BOUNDARY")


def _zeros(words: list[str]) -> str:
    """Directions of a data line: set, first, last direction, value.

    Raises:
        ValueError: not such a line, or a displacement that is prescribed.
    """
    first = int(words[1])
    last = int(words[2]) if words[2] else first
    if first < 1 or (first <= 3 and words[3] and float(words[3]) != 0):
        raise ValueError
    return "xyz"[first - 1 : last]


_READERS = {
    "BOUNDARY": _read_boundary,
    "STEP": _read_step,
    "TRANSFORM": _read_transform,
    "MATERIAL": _read_material,
    "ELASTIC": _read_elastic,
    "DENSITY": _read_density,
    "EXPANSION": _read_expansion,
    "SOLID SECTION": _read_section,
    "ORIENTATION": _read_orientation,
    "INITIAL CONDITIONS": _read_initial,
    "TEMPERATURE": _read_temperature,
    "NODE": _read_nodes,
    "ELEMENT": _read_elements,
    "NSET": _read_node_set,
    "ELSET": _read_cell_set,
    "SURFACE": _read_surface,
}


# from numbers to positions ---------------------------------------------------------------------------------------


def _assembled(deck: _Deck) -> RawMesh:
    if not deck.node_id:
        raise Damaged("there is no *NODE")
    node_id, points = _unique_nodes(np.concatenate(deck.node_id), np.concatenate(deck.points))
    numbering = Numbering(node_id)
    raw = RawMesh(points, node_id)
    for cells in deck.solids:
        cells.nodes = numbering.positions(cells.nodes, "*ELEMENT names")
        raw.blocks.append((cells.kind, cells.nodes))
    raw.cell_id = [cells.ids for cells in deck.solids]
    refuse_twice(raw.cell_id, "cell")
    _assign_materials(deck, raw)
    _assign_temperatures(deck, raw, numbering)
    for key, parts in deck.node_sets.items():
        members = np.unique(joined(parts))
        if len(members):
            name = deck.written[key]
            raw.add_points(name, numbering.positions(members, f"the node set '{name}' names"))
    add_supports(raw, _constraints(deck), numbering)
    for cells in deck.facets:
        cells.nodes = numbering.positions(cells.nodes[:, : _CORNERS[cells.nodes.shape[1]]], "*ELEMENT names")
    for key in deck.cell_sets:
        chosen = _members(deck, key)
        for cells in deck.facets:
            if (inside := np.isin(cells.ids, chosen)).any():
                raw.facets.setdefault(deck.written[key], []).append(cells.nodes[inside])
    for name, kind, rows in deck.surfaces:
        if kind == "NODE":
            _node_surface(deck, raw, numbering, name, rows)
        elif kind == "ELEMENT":
            _element_surface(deck, raw, name, rows)
    return raw


def _unique_nodes(node_id: Indices, points: Array) -> tuple[Indices, Array]:
    """Nodes that are defined twice alike count once."""
    _, first, inverse = np.unique(node_id, return_index=True, return_inverse=True)
    differs = (points != points[first][inverse]).any(axis=1) & np.isfinite(points).all(axis=1)
    if differs.any():
        raise Damaged(f"node {node_id[differs][0]} is defined twice, at different places")
    keep = np.sort(first)
    return node_id[keep], points[keep]


def _assign_materials(deck: _Deck, raw: RawMesh) -> None:
    """A region for every pair of material and orientation that sections give to cells."""
    if not deck.materials:
        return
    raw.regions = [np.full(len(cells.ids), -1) for cells in deck.solids]
    known: dict[tuple[str, str], int] = {}
    for name_of_set, material, orientation in deck.sections:
        if material.upper() not in deck.materials:
            raise Damaged(f"*SOLID SECTION, ELSET={name_of_set} names the material '{material}', which is not defined")
        key = (material.upper(), orientation.upper())
        if key not in known:
            known[key] = len(raw.materials)
            raw.materials.append(_deck_material(deck, key, name_of_set))
        if name_of_set.upper() not in deck.cell_sets:
            raise Damaged(f"*SOLID SECTION names the element set '{name_of_set}', which is not defined")
        chosen = _members(deck, name_of_set.upper())
        for cells, region in zip(deck.solids, raw.regions, strict=True):
            region[np.isin(cells.ids, chosen)] = known[key]
    bare = [cells.ids[region < 0] for cells, region in zip(deck.solids, raw.regions, strict=True)]
    if count := sum(map(len, bare)):
        first = next(int(ids[0]) for ids in bare if len(ids))
        raw.materials.append(DeckMaterial("", None, None, np.zeros(6), where=f"{count} cells from number {first} on"))
        for region in raw.regions:
            region[region < 0] = len(raw.materials) - 1


def _deck_material(deck: _Deck, key: tuple[str, str], where: str) -> DeckMaterial:
    found = deck.materials[key[0]]
    if key[1] and key[1] not in deck.orientations:
        raise Damaged(f"*SOLID SECTION, ELSET={where} names the orientation '{key[1]}', which is not defined")
    turn = deck.orientations[key[1]] if key[1] else None
    axes = None if isinstance(turn, str) else turn
    if refused := found.refused or (turn if isinstance(turn, str) else ""):
        name = f"{found.name} ({refused}, which is not read)"
        return DeckMaterial(name, None, found.density, np.zeros(6), None, where)
    C, table = None, None
    if found.isotropic is not None:
        C, table = isotropic_rows(found.name, found.isotropic)
    elif found.orthotropic is not None:
        C = orthotropic_row(found.name, found.orthotropic)
    elif found.stiffness is not None:
        C = _orthotropic_stiffness(found.name, found.stiffness)
    if C is not None and axes is not None:
        C = turned(C, axes)
    return DeckMaterial(found.name, C, found.density, turned_strain(found.expansion, axes), table, where)


def _orthotropic_stiffness(name: str, d: Array) -> Array:
    """Hooke matrix from D1111, D1122, D2222, D1133, D2233, D3333, D1212, D1313, D2323."""
    C = np.diag([d[0], d[2], d[5], d[6], d[8], d[7]])
    C[0, 1] = C[1, 0] = d[1]
    C[0, 2] = C[2, 0] = d[3]
    C[1, 2] = C[2, 1] = d[4]
    if not np.isfinite(C).all() or np.linalg.eigvalsh(C).min() <= 0:
        raise Damaged(f"the stiffness of the material '{name}' is not positive definite")
    return C


def _assign_temperatures(deck: _Deck, raw: RawMesh, numbering: Numbering) -> None:
    if not deck.temperatures:
        return
    raw.temperature = np.full((len(raw.points), 2), np.nan)
    for column, word, value in deck.temperatures:
        if is_number(word):
            members = np.array([int(word)])
        elif word.strip('"').upper() in deck.node_sets:
            members = joined(deck.node_sets[word.strip('"').upper()])
        else:
            raise Damaged(f"*TEMPERATURE names the node set '{word}', which is not defined")
        raw.temperature[numbering.positions(members, "*TEMPERATURE names"), column] = value


def _constraints(deck: _Deck) -> Constraints:
    """What *BOUNDARY holds, its sets by the names they were written with."""
    held = Constraints(all_turned=deck.turned, left_out=list(deck.not_held))
    for word, directions in deck.held:
        tail = word.rpartition(".")[2]
        key = next((k for k in (word.upper(), tail.upper()) if k in deck.node_sets), None)
        if key is not None:
            held.hold(deck.written[key], directions)
        elif is_number(tail):
            held.hold(int(tail), directions)
        else:
            held.left_out.append(f"*BOUNDARY names the node set '{word}', which is not defined")
    return held


def _members(deck: _Deck, key: str) -> Indices:
    return joined(deck.cell_sets.get(key, []))


def _named(word: str, sets: dict[str, list[Indices]]) -> list[Indices]:
    """The node or cell of that number, or the parts of the set of that name, if there is one."""
    number = word.rpartition(".")[2]
    return [np.array([int(number)])] if is_number(number) else sets.get(word.strip('"').upper(), [])


def _node_surface(deck: _Deck, raw: RawMesh, numbering: Numbering, name: str, rows: list[list[str]]) -> None:
    for row in rows:
        for part in _named(row[0], deck.node_sets):
            raw.add_points(name, numbering.positions(part, f"the surface '{name}' names"))


def _element_surface(deck: _Deck, raw: RawMesh, name: str, rows: list[list[str]]) -> None:
    """Faces S1 ... S6 of cells given by number or set; without a face the free ones."""
    for row in rows:
        chosen = joined(_named(row[0], deck.cell_sets))
        face = row[1].upper() if len(row) > 1 else ""
        for cells in deck.solids:
            nodes = cells.nodes[np.isin(cells.ids, chosen)]
            sides = _sides(cells.kind)
            if not len(nodes) or not sides:
                continue
            if re.fullmatch(r"S[1-6]", face) and int(face[1]) <= len(sides):
                raw.facets.setdefault(name, []).append(nodes[:, list(sides[int(face[1]) - 1])])
            elif not face:
                for corners in sorted({len(side) for side in sides}):
                    every = np.concatenate([nodes[:, list(side)] for side in sides if len(side) == corners])
                    raw.facets.setdefault(name, []).append(_free(every, raw, corners))
        for cells in deck.facets:
            if (inside := np.isin(cells.ids, chosen)).any() and face in ("", "SPOS", "SNEG"):
                raw.facets.setdefault(name, []).append(cells.nodes[inside])


def _sides(kind: str) -> tuple[tuple[int, ...], ...]:
    """Corners of the faces S1, S2, ... of a solid cell."""
    return next((sides for family, sides in _FACES.items() if kind.startswith(family)), ())


def _free(facets: Indices, raw: RawMesh, corners: int) -> Indices:
    """Those facets that belong to one solid cell only."""
    every = []
    for kind, nodes in raw.blocks:
        every += [nodes[:, list(side)] for side in _sides(kind) if len(side) == corners]
    keys, count = np.unique(np.sort(np.concatenate(every), axis=1), axis=0, return_counts=True)
    single = {tuple(row) for row in keys[count == 1].tolist()}
    return facets[[tuple(row) in single for row in np.sort(facets, axis=1).tolist()]]
