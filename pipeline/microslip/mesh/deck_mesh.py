"""Of an Abaqus or CalculiX input file: nodes, cells, their sets, and surfaces as they are written."""

from __future__ import annotations

import re
from contextlib import suppress

import numpy as np

from ..data import Array, Indices
from .cards import fields, numbers, whole_numbers
from .deck import Cells, Deck, Readers
from .instances import local_system
from .raw import Damaged, joined

_SOLIDS = {
    4: "tetra", 10: "tetra10", 8: "hexahedron", 20: "hexahedron20", 27: "hexahedron27", 6: "wedge", 15: "wedge15",
}  # fmt: skip
_BRICK27 = (*range(20), 26, 24, 23, 25, 21, 22, 20)
"""Places in C3D27 (after the edges the centre, then the faces S1 to S6) of VTK's nodes."""
CORNERS = {3: 3, 6: 3, 4: 4, 8: 4, 9: 4}  # nodes of a facet -> its corners


def _read_nodes(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    ids, points = _numbered_points(lines)
    ids = ids + deck.spaces[""].nodes
    deck.node_id.append(ids)
    deck.node_where.append(deck.card.place)
    points = _cartesian(points, parameters.get("SYSTEM", "R").upper()[:1] or "R")
    deck.points.append(points if deck.system is None else points @ deck.system[:3] + deck.system[3])
    if "NSET" in parameters:
        deck.add(deck.node_sets, parameters["NSET"]).append(ids)


def _numbered_points(lines: list[str]) -> tuple[Indices, Array]:
    """Numbers (n,) and coordinates (n, 3) of the lines of *NODE; short lines end in zeros."""
    if lines and all("." not in line.partition(",")[0] for line in lines):
        with suppress(ValueError, OverflowError):  # empty places, Fortran's exponents, short lines
            table = np.loadtxt(lines, dtype="i8,f8,f8,f8", delimiter=",", comments=None, ndmin=1)
            if table["f0"].min() > 0:
                return table["f0"], np.column_stack([table[name] for name in ("f1", "f2", "f3")])
    rows = [line.split(",") for line in lines]
    ids = whole_numbers(",".join(row[0] for row in rows), "*NODE")
    if len(ids) != len(rows):
        raise Damaged("*NODE holds a line without a number")
    values = numbers([",".join(row[1:4]) for row in rows], "*NODE")
    return ids, np.array([v + [0.0] * (3 - len(v)) for v in values]).reshape(-1, 3)


def _cartesian(points: Array, system: str) -> Array:
    """Of rectangular (R), cylindrical (C: r, theta in degrees, z) or spherical coordinates (S: r, theta, phi)."""
    if system == "R":
        return points
    if system not in "CS":
        raise Damaged(f"*NODE, SYSTEM={system} is not read; use R, C or S")
    r, theta, last = points[:, 0], np.radians(points[:, 1]), points[:, 2]
    if system == "C":
        return np.column_stack([r * np.cos(theta), r * np.sin(theta), last])
    phi = np.radians(last)  # from the z axis, see the keyword's description
    return np.column_stack([r * np.sin(phi) * np.cos(theta), r * np.sin(phi) * np.sin(theta), r * np.cos(phi)])


def _read_system(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    deck.system = local_system(numbers(lines, "*SYSTEM"))


def cell_type(kind: str) -> re.Match[str] | None:
    """Family and number of nodes of a solid or a facet; None of other elements."""
    return re.match(r"(D?C3D|AC3D|CPS|CPE|CAX|M3D|SFM3D|R3D|STRI|DS|S|DC2D)(\d+)", kind)


def _read_elements(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    kind = parameters.get("TYPE", "").upper()
    match = cell_type(kind)
    deck.kinds.append(kind)
    if match is None:
        deck.add(deck.cell_sets, parameters.get("ELSET", ""))
        return  # beams, springs, masses and the like
    solid = match[1] in ("C3D", "DC3D", "AC3D")
    count = 6 if match[0] == "STRI65" else int(match[2])
    if solid and count not in _SOLIDS:
        first = whole_numbers(lines[0].partition(",")[0], "*ELEMENT") if lines else np.zeros(1, dtype=np.int64)
        raise Damaged(f"element {first[0]} is of type {kind}, which cannot be assembled")
    if not solid and count not in CORNERS:
        return
    table = whole_numbers(",".join(lines), f"*ELEMENT, TYPE={kind}")
    if len(table) % (count + 1):
        raise Damaged(f"*ELEMENT, TYPE={kind} holds another number of nodes than its cells need")
    table, own = table.reshape(-1, count + 1), deck.spaces[""]
    nodes = (table[:, 1:] if not (solid and count == 27) else table[:, 1:][:, _BRICK27]) + own.nodes
    cells = Cells(_SOLIDS[count] if solid else "facet", table[:, 0] + own.cells, nodes, kind, deck.card.place)
    (deck.solids if solid else deck.facets).append(cells)
    if "ELSET" in parameters:
        deck.add(deck.cell_sets, parameters["ELSET"]).append(cells.ids)


def _read_node_set(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    _read_set(deck, deck.node_sets, parameters, "NSET", lines)


def _read_cell_set(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    _read_set(deck, deck.cell_sets, parameters, "ELSET", lines)


def _read_set(
    deck: Deck, sets: dict[str, list[Indices]], parameters: dict[str, str], keyword: str, lines: list[str]
) -> None:
    name, space = parameters.get(keyword, ""), parameters.get("INSTANCE", "")
    if not name:
        raise Damaged(f"a *{keyword} has no name")
    members, of_cells = deck.add(sets, name), keyword == "ELSET"
    at, what = deck.place("1", space)[0], f"*{keyword}, {keyword}={name}"
    more = at.cells if of_cells else at.nodes
    for line in lines:
        words = fields(line)
        if "GENERATE" in parameters:
            known = joined(c.ids for c in (*deck.solids, *deck.facets)) if of_cells else joined(deck.node_id)
            members.append(_generated(words, known - more, what) + more)
            continue
        members.append(whole_numbers(",".join(word for word in words if word.isdecimal()), what) + more)
        for word in words:
            if not word.isdecimal():
                found = deck.cells(word, space) if of_cells else deck.nodes(word, space)
                if found is None:
                    raise Damaged(f"{what} names the set '{word}', which is not defined")
                members.append(found)


def _generated(words: list[str], known: Indices, what: str) -> Indices:
    """Numbers first, first + step, ... last, of those that exist."""
    limits = whole_numbers(",".join(words), what)
    if len(limits) not in (2, 3):
        raise Damaged(f"{what} with GENERATE needs first, last and step")
    first, last, step = (*limits.tolist(), 1)[:3]
    return known[(known >= first) & (known <= last) & ((known - first) % step == 0)]


def _read_surface(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    name, kind = parameters.get("NAME", ""), parameters.get("TYPE", "ELEMENT").upper()
    if name:
        kind = parameters.get("COMBINE", kind).upper()
        rows = [words for line in lines if (words := [w.strip() for w in line.split(",")]) and any(words)]
        for row in rows if kind == "ELEMENT" else ():
            if not re.fullmatch("|S[1-6]|SPOS|SNEG|E[1-4]|END[12]|EDGE", (side := [*row, ""][1]).upper()):
                raise Damaged(f"*SURFACE, NAME={name} names the side '{side}', which no cell has")
        deck.surfaces.append((name, kind, rows, "", deck.card))
        deck.written.setdefault(name.upper(), name)


READERS: Readers = {
    "SYSTEM": _read_system,
    "NODE": _read_nodes,
    "ELEMENT": _read_elements,
    "NSET": _read_node_set,
    "ELSET": _read_cell_set,
    "SURFACE": _read_surface,
}
