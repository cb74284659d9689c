"""Of an Abaqus or CalculiX input file: nodes, cells, their sets, and the facets of its surfaces."""

from __future__ import annotations

import re
from contextlib import suppress

import numpy as np

from ..data import Array, Indices
from ..errors import of_file
from .cards import Card, fields, numbers, whole_numbers
from .deck import Cells, Deck, DeckSurface, Readers
from .deck_lumps import NODES as LUMPED
from .deck_lumps import read_cells
from .instances import local_system
from .raw import Damaged, Numbering, RawMesh, is_number, joined

_SOLIDS = {
    4: "tetra", 10: "tetra10", 8: "hexahedron", 20: "hexahedron20", 27: "hexahedron27", 6: "wedge", 15: "wedge15",
}  # fmt: skip
_BRICK27 = (*range(20), 26, 24, 23, 25, 21, 22, 20)
"""Places in C3D27 (after the edges the centre, then the faces S1 to S6) of VTK's nodes."""
CORNERS = {3: 3, 6: 3, 4: 4, 8: 4, 9: 4}  # nodes of a facet -> its corners


def _read_nodes(deck: Deck, card: Card) -> None:
    ids, points = _numbered_points(card.lines)
    ids = ids + deck.spaces[""].nodes
    deck.node_id.append(ids)
    deck.node_where.append(card.place)
    points = _cartesian(points, card.word("SYSTEM", "R")[:1] or "R")
    deck.points.append(points if deck.system is None else points @ deck.system[:3] + deck.system[3])
    if "NSET" in card.parameters:
        deck.add(deck.node_sets, card.parameters["NSET"]).append(ids)


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
    return np.column_stack(
        [r * np.sin(phi) * np.cos(theta), r * np.sin(phi) * np.sin(theta), r * np.cos(phi)]
    )


def _read_system(deck: Deck, card: Card) -> None:
    deck.system = local_system(numbers(card.lines, "*SYSTEM"))


def cell_type(kind: str) -> re.Match[str] | None:
    """Family and number of nodes of a solid or a facet; None of other elements."""
    return re.match(r"(D?C3D|AC3D|CPS|CPE|CAX|M3D|SFM3D|R3D|STRI|DS|S|DC2D)(\d+)", kind)


def _read_elements(deck: Deck, card: Card) -> None:
    kind = card.word("TYPE")
    match = cell_type(kind)
    deck.kinds.append(kind)
    if kind in LUMPED and card.lines:
        read_cells(deck, card, kind, numbers(card.lines, f"*ELEMENT, TYPE={kind}"))
        return
    if match is None:
        deck.add(deck.cell_sets, card.text("ELSET"))
        if card.lines:
            deck.structures.append((card.where, kind, _nodes_of_rows(card.lines, deck.spaces[""].nodes)))
        return  # beams, springs, masses and the like
    solid = match[1] in ("C3D", "DC3D", "AC3D")
    count = 6 if match[0] == "STRI65" else int(match[2])
    if solid and count not in _SOLIDS:
        first = (
            int(whole_numbers(card.lines[0].partition(",")[0], "*ELEMENT")[0]) if card.lines else 0
        )
        raise Damaged(f"element {first} is of type {kind}, which cannot be assembled")
    if not solid and count not in CORNERS:
        return
    table = whole_numbers(",".join(card.lines), f"*ELEMENT, TYPE={kind}")
    if len(table) % (count + 1):
        table = _without_rest(card.lines, count, kind)
    table, own = table.reshape(-1, count + 1), deck.spaces[""]
    nodes = (table[:, 1:] if not (solid and count == 27) else table[:, 1:][:, _BRICK27]) + own.nodes
    cells = Cells(
        _SOLIDS[count] if solid else "facet", table[:, 0] + own.cells, nodes, kind, card.place
    )
    (deck.solids if solid else deck.facets).append(cells)
    if "ELSET" in card.parameters:
        deck.add(deck.cell_sets, card.parameters["ELSET"]).append(cells.ids)


def _nodes_of_rows(lines: list[str], more: int) -> list[list[int]]:
    """Numbers of the nodes of elements of a type that is not read, one element a line or, behind a comma, several."""
    text = re.sub(r",\s*\n", ",", "\n".join(lines))
    rows = [[int(w) for w in fields(line) if is_number(w)] for line in text.splitlines()]
    return [[node + more for node in row[1:]] for row in rows if len(row) > 1]


def _without_rest(lines: list[str], count: int, kind: str) -> Indices:
    """Numbers and nodes of cells that begin on a line each: what stands behind their nodes there is not read.

    Raises:
        Damaged: a cell with too few nodes.
    """
    cells: list[int] = []
    for line in lines:
        numbers_there = whole_numbers(line, f"*ELEMENT, TYPE={kind}").tolist()
        lacking = -len(cells) % (count + 1) or count + 1
        cells += numbers_there[:lacking]
    if len(cells) % (count + 1):
        raise Damaged(f"*ELEMENT, TYPE={kind} holds another number of nodes than its cells need")
    return np.array(cells, dtype=np.int64)


def _read_set(deck: Deck, card: Card) -> None:
    name, of_cells = card.text(card.keyword), card.keyword == "ELSET"
    if not name:
        raise Damaged(f"a *{card.keyword} has no name")
    members = deck.add(deck.cell_sets if of_cells else deck.node_sets, name)
    at, what = deck.place("1", card.text("INSTANCE"))[0], f"*{card.keyword}, {card.keyword}={name}"
    more = at.cells if of_cells else at.nodes
    for line in card.lines:
        words = fields(line)
        if "GENERATE" in card.parameters:
            known = (
                joined(c.ids for c in (*deck.solids, *deck.facets))
                if of_cells
                else joined(deck.node_id)
            )
            members.append(_generated(words, known - more, what) + more)
            continue
        members.append(
            whole_numbers(",".join(word for word in words if word.isdecimal()), what) + more
        )
        for word in words:
            if not word.isdecimal():
                others = (deck.cells if of_cells else deck.nodes)(word, card.text("INSTANCE"))
                if others is None:
                    raise Damaged(f"{what} names the set '{word}', which is not defined")
                members.append(others)


def _generated(words: list[str], known: Indices, what: str) -> Indices:
    """Numbers first, first + step, ... last, of those that exist."""
    limits = whole_numbers(",".join(words), what)
    if len(limits) not in (2, 3):
        raise Damaged(f"{what} with GENERATE needs first, last and step")
    first, last, step = (*limits.tolist(), 1)[:3]
    return known[(known >= first) & (known <= last) & ((known - first) % step == 0)]


def _read_surface(deck: Deck, card: Card) -> None:
    name, kind = card.text("NAME"), card.word("TYPE", "ELEMENT")
    if name:
        kind = card.word("COMBINE", kind)
        rows = [
            words
            for line in card.lines
            if (words := [w.strip() for w in line.split(",")]) and any(words)
        ]
        for row in rows if kind == "ELEMENT" else ():
            if not re.fullmatch(
                "|S[1-6]|SPOS|SNEG|E[1-4]|END[12]|EDGE", (side := [*row, ""][1]).upper()
            ):
                raise Damaged(f"*SURFACE, NAME={name} names the side '{side}', which no cell has")
        deck.surfaces.append(DeckSurface(name, kind, rows, card))
        deck.written.setdefault(name.upper(), name)


_FACES: dict[str, tuple[tuple[int, ...], ...]] = {
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "hexahedron": (
        (0, 1, 2, 3),
        (4, 7, 6, 5),
        (0, 4, 5, 1),
        (1, 5, 6, 2),
        (2, 6, 7, 3),
        (3, 7, 4, 0),
    ),
}


def add_surfaces(deck: Deck, raw: RawMesh, numbering: Numbering) -> None:
    """Facets of every surface, and points of those of nodes."""
    for surface in deck.surfaces:
        with of_file(surface.card.place):
            if surface.kind == "NODE":
                for word, *_ in surface.rows:
                    nodes = deck.nodes_for(
                        f"the surface '{surface.name}'", word, surface.card.space
                    )
                    if len(nodes):
                        raw.add_set(surface.name, nodes, numbering)
            elif surface.kind == "ELEMENT":
                _element_surface(deck, raw, surface)
            elif surface.kind in ("UNION", "INTERSECTION", "DIFFERENCE"):
                _combined(raw, deck, surface)


def _combined(raw: RawMesh, deck: Deck, surface: DeckSurface) -> None:
    """A surface of others: all of their facets, those that they have in common, or those of the first alone."""
    parts, name = [], surface.name
    for word in (word for row in surface.rows for word in row if word):
        at, tail = deck.place(word)
        if not {at.prefix + tail, tail} & {known.name for known in deck.surfaces}:
            raise Damaged(f"the surface '{name}' names the surface '{word}', which is not defined")
        parts.append(raw.facets.get(at.prefix + tail) or raw.facets.get(tail) or [])
    if surface.kind == "UNION":
        raw.facets[name] = [block for part in parts for block in part]
        return
    others = {
        tuple(row)
        for part in parts[1:]
        for block in part
        for row in np.sort(block, axis=1).tolist()
    }
    for block in parts[0] if parts else ():
        inside = np.array(
            [tuple(row) in others for row in np.sort(block, axis=1).tolist()], dtype=bool
        )
        raw.facets.setdefault(name, []).append(
            block[inside if surface.kind == "INTERSECTION" else ~inside]
        )


def _element_surface(deck: Deck, raw: RawMesh, surface: DeckSurface) -> None:
    """Faces S1 ... S6 of cells given by number or set; without a face the free ones."""
    name, facets = surface.name, raw.facets
    everything = joined(c.ids for c in (*deck.solids, *deck.facets))
    for word, *sides_named in surface.rows:
        face = sides_named[0].upper() if sides_named else ""
        chosen = (
            deck.cells_for(f"the surface '{name}'", word, surface.card.space)
            if word
            else everything
        )
        if not np.isin(chosen, everything).any():
            raw.remarks.append(
                f"{surface.card.where}: no cell that is read is '{word}' of the surface '{name}'"
            )
        for cells in deck.solids:
            nodes = cells.nodes[np.isin(cells.ids, chosen)]
            sides = sides_of(cells.kind)
            if not len(nodes) or not sides:
                continue
            if re.fullmatch(r"S[1-6]", face):
                if int(face[1]) > len(sides):
                    raise Damaged(
                        f"the surface '{name}' names the side {face} of cells {cells.written}"
                    )
                facets.setdefault(name, []).append(nodes[:, list(sides[int(face[1]) - 1])])
            elif not face:
                for corners in sorted({len(side) for side in sides}):
                    every = np.concatenate(
                        [nodes[:, list(side)] for side in sides if len(side) == corners]
                    )
                    facets.setdefault(name, []).append(_free(every, raw, corners))
        for cells in deck.facets:
            if (inside := np.isin(cells.ids, chosen)).any() and face in ("", "SPOS", "SNEG"):
                facets.setdefault(name, []).append(cells.nodes[inside])


def sides_of(kind: str) -> tuple[tuple[int, ...], ...]:
    """Corners of the faces S1, S2, ... of a solid cell."""
    return next((sides for family, sides in _FACES.items() if kind.startswith(family)), ())


def _free(facets: Indices, raw: RawMesh, corners: int) -> Indices:
    """Those facets that belong to one solid cell only."""
    every = []
    for kind, nodes in raw.blocks:
        every += [nodes[:, list(side)] for side in sides_of(kind) if len(side) == corners]
    keys, count = np.unique(np.sort(np.concatenate(every), axis=1), axis=0, return_counts=True)
    single = {tuple(row) for row in keys[count == 1].tolist()}
    return facets[[tuple(row) in single for row in np.sort(facets, axis=1).tolist()]]


READERS: Readers = {
    "SYSTEM": _read_system,
    "NODE": _read_nodes,
    "ELEMENT": _read_elements,
    "NSET": _read_set,
    "ELSET": _read_set,
    "SURFACE": _read_surface,
}
