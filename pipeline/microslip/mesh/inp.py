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
from .raw import Damaged, Numbering, RawMesh

_SOLIDS = {
    4: "tetra", 10: "tetra10", 8: "hexahedron", 20: "hexahedron20", 27: "hexahedron27", 6: "wedge", 15: "wedge15",
}  # fmt: skip
_CORNERS = {3: 3, 6: 3, 4: 4, 8: 4, 9: 4}  # nodes of a facet -> its corners
_FACES: dict[str, tuple[tuple[int, ...], ...]] = {
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "hexahedron": ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
}
_REFUSED = {
    "NGEN": "generates nodes by *NGEN", "NFILL": "generates nodes by *NFILL", "NCOPY": "copies nodes by *NCOPY",
    "ELGEN": "generates cells by *ELGEN", "ELCOPY": "copies cells by *ELCOPY", "SYSTEM": "uses a local *SYSTEM",
}  # fmt: skip
_KEYWORDS = {"NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "INSTANCE", "ASSEMBLY", "END ASSEMBLY"} | set(_REFUSED)


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
        elif keyword in _READERS and (not assembly or "INSTANCE" in parameters or keyword == "SURFACE"):
            if "INPUT" in parameters:
                lines = [*lines, *(line for line in _lines(path.parent / parameters["INPUT"], 1))]
            _READERS[keyword](deck, parameters, lines)
    return _assembled(deck)


def _lines(path: Path, depth: int) -> Iterator[str]:
    """Lines of a file and of those it includes, without comments and empty lines."""
    if depth > 10:
        raise Damaged(f"the file includes itself by way of {path.name}")
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
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
    try:
        values = [[float(v.replace("D", "e").replace("d", "e")) if v.strip() else 0.0 for v in r[1:4]] for r in rows]
    except ValueError as error:
        raise Damaged(f"*NODE holds something that is no number ({str(error)[-60:]})") from None
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
        raise Damaged(f"cells of type {kind} cannot be assembled")
    if not solid and count not in _CORNERS:
        return
    table = _numbers(",".join(lines), f"*ELEMENT, TYPE={kind}")
    if len(table) % (count + 1):
        raise Damaged(f"*ELEMENT, TYPE={kind} holds another number of nodes than its cells need")
    table = table.reshape(-1, count + 1)
    cells = _Cells(_SOLIDS[count] if solid else "facet", table[:, 0], table[:, 1:])
    (deck.solids if solid else deck.facets).append(cells)
    if "ELSET" in parameters:
        _set(deck, deck.cell_sets, parameters["ELSET"]).append(cells.ids)


def _set(deck: _Deck, sets: dict[str, list[Indices]], name: str) -> list[Indices]:
    deck.written.setdefault(name.upper(), name)
    return sets.setdefault(name.upper(), [])


def _read_node_set(deck: _Deck, parameters: dict[str, str], lines: list[str]) -> None:
    known = np.concatenate(deck.node_id) if deck.node_id else np.zeros(0, dtype=np.int64)
    _read_set(deck, deck.node_sets, parameters, "NSET", lines, known)


def _read_cell_set(deck: _Deck, parameters: dict[str, str], lines: list[str]) -> None:
    every = [c.ids for c in (*deck.solids, *deck.facets)]
    known = np.concatenate(every) if every else np.zeros(0, dtype=np.int64)
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


_READERS = {
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
    _check_cell_numbers(deck)
    for key, parts in deck.node_sets.items():
        members = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *parts]))
        if len(members):
            name = deck.written[key]
            raw.add_points(name, numbering.positions(members, f"the node set '{name}' names"))
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


def _check_cell_numbers(deck: _Deck) -> None:
    every = np.concatenate([np.zeros(0, dtype=np.int64), *(c.ids for c in deck.solids)])
    ids, count = np.unique(every, return_counts=True)
    if (count > 1).any():
        raise Damaged(f"cell {ids[count > 1][0]} is defined twice")


def _unique_nodes(node_id: Indices, points: Array) -> tuple[Indices, Array]:
    """Nodes that are defined twice alike count once."""
    _, first, inverse = np.unique(node_id, return_index=True, return_inverse=True)
    differs = (points != points[first][inverse]).any(axis=1) & np.isfinite(points).all(axis=1)
    if differs.any():
        raise Damaged(f"node {node_id[differs][0]} is defined twice, at different places")
    keep = np.sort(first)
    return node_id[keep], points[keep]


def _members(deck: _Deck, key: str) -> Indices:
    return np.concatenate([np.zeros(0, dtype=np.int64), *deck.cell_sets.get(key, [])])


def _node_surface(deck: _Deck, raw: RawMesh, numbering: Numbering, name: str, rows: list[list[str]]) -> None:
    for row in rows:
        word = row[0].rpartition(".")[2]
        by_number = word.isdecimal() and len(word) < 18
        for part in [np.array([int(word)])] if by_number else deck.node_sets.get(row[0].strip('"').upper(), []):
            raw.add_points(name, numbering.positions(part, f"the surface '{name}' names"))


def _element_surface(deck: _Deck, raw: RawMesh, name: str, rows: list[list[str]]) -> None:
    """Faces S1 ... S6 of cells given by number or set; without a face the free ones."""
    for row in rows:
        word = row[0].rpartition(".")[2]
        by_number = word.isdecimal() and len(word) < 18
        chosen = np.array([int(word)]) if by_number else _members(deck, row[0].strip('"').upper())
        face = row[1].upper() if len(row) > 1 else ""
        for cells in deck.solids:
            nodes = cells.nodes[np.isin(cells.ids, chosen)]
            sides = _sides(cells.kind)
            if not len(nodes) or not sides:
                continue
            if re.fullmatch(r"S[1-6]", face) and int(face[1]) <= len(sides):
                raw.facets.setdefault(name, []).append(nodes[:, list(sides[int(face[1]) - 1])])
            elif not face:
                every = np.concatenate([nodes[:, list(side)] for side in sides])
                raw.facets.setdefault(name, []).append(_free(every, raw, len(sides[0])))
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
