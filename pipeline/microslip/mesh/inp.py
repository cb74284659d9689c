"""Reader of Abaqus and CalculiX input files: nodes, solid cells, facets, node sets and element-based surfaces.

Written against the keyword descriptions in the two programs' manuals. It keeps node numbers and reads ``*SURFACE``,
in which such programs name faces; parts are laid where their instances stand (`instances`). A file whose meaning it
cannot keep (generated nodes) is refused.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from ..data import Array, Indices
from ..elasticity import turned, turned_strain
from ..frames import rotation
from .cards import Card, data_of, fields, read_cards
from .deck import Cells, Deck, DeckConstants
from .deck_joints import KEYWORDS as JOINTS
from .deck_joints import joints_of, preloads_of, unpressed, unused_loads
from .deck_links import KEYWORDS as LINKS
from .deck_links import links_of
from .instances import local_system, numbered, outline, place, placement, places
from .materials import isotropic_rows, orthotropic_row
from .raw import Damaged, DeckMaterial, Numbering, RawMesh, joined, lost
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
    "ELGEN": "generates cells by *ELGEN", "ELCOPY": "copies cells by *ELCOPY",
}  # fmt: skip
_HELD = {
    "ENCASTRE": "xyzabc", "PINNED": "xyz", "XSYMM": "xbc", "YSYMM": "yac", "ZSYMM": "zab", "XASYMM": "yza",
    "YASYMM": "xzb", "ZASYMM": "xyc",
}  # fmt: skip


def read_inp(path: Path) -> RawMesh:
    """Read an input file and those it includes.

    Raises:
        Damaged: content that is inconsistent, or whose meaning would be lost.
    """
    found = outline(read_cards(path))
    whole = Deck()
    parts = [(card, _part(path, found.parts, card, own)) for card, own in found.instances]
    spaces = places([(card.parameters["NAME"], part) for card, part in parts])
    for (card, part), space in zip(parts, spaces, strict=False):
        at = _told(card, lambda c: placement(_table(c.lines, "*INSTANCE")))
        place(whole, part, card.parameters["NAME"], at, space)
    whole.spaces[""] = spaces[-1]
    _read(path, whole, found.rest)
    raw = _assembled(whole)
    raw.remarks = [*numbered([card.parameters["NAME"] for card, _ in parts], spaces), *_replaced(raw, whole)]
    whole.ignored += unused_loads(whole)
    if whole.ignored:
        raw.remarks.append(f"read and not used: {', '.join('*' + word for word in dict.fromkeys(whole.ignored))}")
    if not path.read_bytes().endswith(b"\n"):
        raw.unended = "a last line without an end"
    return raw


_AS = {
    "C3D8R": "reduced integration becomes full", "C3D8RH": "reduced integration becomes full",
    "C3D8I": "incompatible modes are left out", "C3D8H": "the hybrid form becomes that of displacements",
    "C3D20R": "reduced integration becomes full, a little stiffer on coarse meshes",
    "C3D20RH": "reduced integration becomes full, a little stiffer on coarse meshes",
    "C3D10M": "the modified form becomes the plain one", "C3D10I": "the improved stress is left out",
    "C3D10HS": "the hybrid form becomes that of displacements",
}  # fmt: skip
"""Solids that are taken as their plain sisters, and what that changes."""


def _replaced(raw: RawMesh, deck: Deck) -> list[str]:
    """Which cells are taken as others, and how far first-order ones lock in bending."""
    count: dict[str, int] = {}
    for cells in deck.solids:
        count[cells.written] = count.get(cells.written, 0) + len(cells.ids)
    told = []
    for written, number in count.items():
        plain = re.match(r"C3D\d+", written)
        if written in _AS and plain:
            told.append(f"{number} cells {written} are taken as {plain[0]}: {_AS[written]}")
    bricks = [nodes for kind, nodes in raw.blocks if kind == "hexahedron"]
    if bricks:
        told.append(
            f"first-order bricks lock: where one layer of them bends, stiffness is {locking(raw, bricks):.2g} times "
            "too large, with m layers the excess falls as 1/m2; export second-order cells (C3D20)"
        )
    return told


def locking(raw: RawMesh, bricks: list[Indices]) -> float:
    """How many times too stiff one layer of fully integrated bricks is in bending, of the median brick.

    (1 / (1 - nu) + a^2 / 2) / (1 + nu), a the length over the height (R. D. Cook and others, Concepts and Applications
    of Finite Element Analysis, parasitic shear), here with nu = 0 and its longest over its shortest side.
    """
    x = raw.points[np.concatenate(bricks)]
    sides = np.stack([np.linalg.norm(x[:, j] - x[:, 0], axis=1) for j in (1, 3, 4)])
    with np.errstate(all="ignore"):  # flat cells are told elsewhere
        return float(1 + 0.5 * np.median(sides.max(axis=0) / sides.min(axis=0)) ** 2)


def _part(path: Path, parts: dict[str, list[Card]], instance: Card, own: list[Card]) -> Deck:
    """A part as an instance of it begins: with what the instance itself says besides."""
    name = instance.parameters.get("PART", "")
    if "LIBRARY" in instance.parameters or name.upper() not in {*parts, ""}:
        raise Damaged(f"{instance.where}: *INSTANCE names the part '{name}', which the file does not define")
    if not name and not any(card.keyword == "NODE" for card in own):
        raise Damaged(f"{instance.where}: the *INSTANCE names no PART and has no nodes of its own")
    deck = Deck()
    _read(path, deck, [*parts.get(name.upper(), ()), *own])
    return deck


def _read(path: Path, deck: Deck, cards: list[Card]) -> None:
    """Take in cards one after the other."""
    for card in cards:
        if card.keyword in _REFUSED:
            raise Damaged(f"{card.where}: the file {_REFUSED[card.keyword]}; write out every node and cell")
        if "INPUT" in card.parameters and card.keyword in (*LINKS, *JOINTS, *_READERS):
            card.lines = [*card.lines, *_told(card, lambda c: data_of(path, c.parameters.pop("INPUT")))]
        if card.keyword in (*LINKS, *JOINTS):
            deck.links.append((card, ""))
        if card.keyword not in _READERS:
            if _COUNTS.fullmatch(card.keyword):
                deck.lost.append(lost(card.where, f"*{card.keyword}"))
            elif card.keyword not in (*_SILENT, *LINKS, *JOINTS):
                deck.ignored.append(card.keyword)
            continue
        deck.where = card.where
        _told(card, lambda c: _READERS[c.keyword](deck, c.parameters, c.lines))
        kind = card.parameters.get("TYPE", "").upper()
        if card.keyword == "ELEMENT" and card.lines and not _cell_type(kind) and kind != "DCOUP3D":
            deck.lost.append(lost(card.where, f"*ELEMENT, TYPE={kind}"))


def _told(card: Card, work: Callable[[Card], Any]) -> Any:
    """What is made of a card; what is wrong with it is told with its place."""
    try:
        return work(card)
    except Damaged as error:
        raise Damaged(f"{card.where}: {error}") from None


def _numbers(text: str, what: str) -> Indices:
    words = [word for word in text.replace(",", " ").split() if word]
    try:
        values = np.array(words, dtype=np.int64) if words else np.zeros(0, dtype=np.int64)
    except (ValueError, OverflowError):
        raise Damaged(f"{what} holds something that is no whole number") from None
    if len(values) and values.min() < 1:
        raise Damaged(f"{what} holds a number below 1")
    return values


def _read_nodes(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    ids, points = _numbered_points(lines)
    ids = ids + deck.spaces[""].nodes
    deck.node_id.append(ids)
    deck.node_where.append(deck.where)
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
    ids = _numbers(",".join(row[0] for row in rows), "*NODE")
    if len(ids) != len(rows):
        raise Damaged("*NODE holds a line without a number")
    values = _table([",".join(row[1:4]) for row in rows], "*NODE")
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
    deck.system = local_system(_table(lines, "*SYSTEM"))


def _cell_type(kind: str) -> re.Match[str] | None:
    """Family and number of nodes of a solid or a facet; None of other elements."""
    return re.match(r"(D?C3D|AC3D|CPS|CPE|CAX|M3D|SFM3D|R3D|STRI|DS|S|DC2D)(\d+)", kind)


def _read_elements(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    kind = parameters.get("TYPE", "").upper()
    match = _cell_type(kind)
    deck.kinds.append(kind)
    if match is None:
        deck.add(deck.cell_sets, parameters.get("ELSET", ""))
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
    table, own = table.reshape(-1, count + 1), deck.spaces[""]
    nodes = (table[:, 1:] if not (solid and count == 27) else table[:, 1:][:, _BRICK27]) + own.nodes
    cells = Cells(_SOLIDS[count] if solid else "facet", table[:, 0] + own.cells, nodes, kind, deck.where)
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
        members.append(_numbers(",".join(word for word in words if word.isdecimal()), what) + more)
        for word in words:
            if not word.isdecimal():
                found = deck.cells(word, space) if of_cells else deck.nodes(word, space)
                if found is None:
                    raise Damaged(f"{what} names the set '{word}', which is not defined")
                members.append(found)


def _generated(words: list[str], known: Indices, what: str) -> Indices:
    """Numbers first, first + step, ... last, of those that exist."""
    limits = _numbers(",".join(words), what)
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
        deck.surfaces.append((name, kind, rows, "", deck.where))
        deck.written.setdefault(name.upper(), name)


def _table(lines: list[str], what: str) -> list[list[float]]:
    """Numbers of the data lines; an empty place counts as 0."""
    try:
        rows = [line.rstrip().rstrip(",").split(",") for line in lines]
        return [[float(w.replace("D", "e").replace("d", "e")) if w.strip() else 0.0 for w in row] for row in rows]
    except ValueError as error:
        raise Damaged(f"{what} holds something that is no number ({str(error)[-60:]})") from None


def _read_material(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    name = parameters.get("NAME", "")
    if not name:
        raise Damaged("a *MATERIAL has no name")
    deck.current = name.upper()
    deck.materials[deck.current] = DeckConstants(name, deck.where)


def _of(deck: Deck, keyword: str) -> DeckConstants:
    if not deck.current:
        raise Damaged(f"*{keyword} stands before any *MATERIAL")
    return deck.materials[deck.current]


def _read_elastic(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
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


def _read_density(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    material = _of(deck, "DENSITY")
    rows = _table(lines, f"*DENSITY of {material.name}")
    if not rows or not rows[0]:
        raise Damaged(f"*DENSITY of the material {material.name} holds no number")
    if len({row[0] for row in rows}) > 1:
        material.refused = "a density that depends on temperature"
    material.density = rows[0][0]


def _read_expansion(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    material, kind = _of(deck, "EXPANSION"), parameters.get("TYPE", "ISO").upper()
    rows = _table(lines, f"*EXPANSION of {material.name}")
    count = 3 if kind.startswith("ORTHO") else 1
    if not rows or any(len(row) not in (count, count + 1) for row in rows) or kind.startswith("ANISO"):
        raise Damaged(f"*EXPANSION, TYPE={kind} of the material {material.name} is not read; use ISO or ORTHO")
    values = np.array([row[:count] for row in rows])
    if np.ptp(values, axis=0).any():
        material.refused = "an expansion that depends on temperature"
    material.expansion = np.broadcast_to(values[0], 3).copy()


def _read_section(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    keys = ("ELSET", "MATERIAL", "ORIENTATION")
    words = [parameters.get(key, "") for key in keys]
    deck.sections.append((words[0], words[1], words[2], "", deck.where))


def _read_orientation(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    name, system = parameters.get("NAME", ""), parameters.get("SYSTEM", "RECTANGULAR").upper()
    key = name.upper()
    if not system.startswith("R") or parameters.get("DEFINITION", "COORDINATES").upper() != "COORDINATES":
        deck.orientations[key] = f"*ORIENTATION, NAME={name} of the system {system}"
        return
    rows = _table(lines, f"*ORIENTATION, NAME={name}")
    if not rows or len(rows[0]) not in (6, 9):
        raise Damaged(f"*ORIENTATION, NAME={name} needs the six coordinates of two points")
    origin = np.array(rows[0][6:9]) if len(rows[0]) == 9 else np.zeros(3)
    a, b = np.array(rows[0][:3]) - origin, np.array(rows[0][3:6]) - origin
    normal = np.cross(a, b)
    if not np.linalg.norm(normal) > 1e-9 * np.linalg.norm(a) * np.linalg.norm(b):
        raise Damaged(f"the points of *ORIENTATION, NAME={name} lie on a line")
    x, z = a / np.linalg.norm(a), normal / np.linalg.norm(normal)
    axes = np.array([x, np.cross(z, x), z])
    if len(rows) > 1 and len(rows[1]) > 1 and rows[1][1]:
        if rows[1][0] not in (1, 2, 3):
            raise Damaged(f"*ORIENTATION, NAME={name} turns about the axis {rows[1][0]:g}, which is none of 1, 2, 3")
        axes = axes @ rotation(axes[int(rows[1][0]) - 1], np.radians(rows[1][1])).T
    deck.orientations[key] = axes


def _read_temperature(deck: Deck, parameters: dict[str, str], lines: list[str], column: int = 1) -> None:
    if "FILE" in parameters or "BSTEP" in parameters:
        raise Damaged("*TEMPERATURE reads from a results file; write the temperatures out")
    for line in lines:
        words = fields(line)
        try:
            deck.temperatures.append((column, words[0], float(words[1])))
        except (IndexError, ValueError):
            raise Damaged(f"*TEMPERATURE holds the line '{line[:60]}', no node (or set) and temperature") from None


def _read_initial(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    if parameters.get("TYPE", "").upper() == "TEMPERATURE":
        _read_temperature(deck, parameters, lines, column=0)
    elif parameters.get("TYPE", "").upper() in ("STRESS", "PLASTIC STRAIN"):
        deck.lost.append(lost(deck.where, f"*INITIAL CONDITIONS, TYPE={parameters['TYPE'].upper()}"))


def _read_step(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    deck.step += 1


def _read_transform(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
    deck.turned = True


def _read_boundary(deck: Deck, parameters: dict[str, str], lines: list[str]) -> None:
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
            deck.held.append((words[0].strip('"'), directions, deck.where))
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
    return "xyzabc"[first - 1 : last]


_SILENT = {
    "HEADING", "PREPRINT", "RESTART", "OUTPUT", "NODE OUTPUT", "ELEMENT OUTPUT", "CONTACT OUTPUT", "NODE FILE",
    "EL FILE", "NODE PRINT", "EL PRINT", "CONTACT PRINT", "PART", "END PART", "ASSEMBLY", "END ASSEMBLY", "END STEP",
    "INSTANCE", "END INSTANCE", "STATIC", "FREQUENCY", "INCLUDE", "MONITOR", "SECTION PRINT", "CONTACT FILE",
}  # fmt: skip
"""Keywords that say nothing of the body."""

_COUNTS = re.compile(
    "MASS|ROTARY INERTIA|NONSTRUCTURAL MASS|SPRING|DASHPOT|GAP|JOINT|CONNECTOR [A-Z]+|EMBEDDED ELEMENT|"
    "SHELL TO SOLID COUPLING|FASTENER|MATRIX (INPUT|ASSEMBLE)|SUBSTRUCTURE [A-Z]+|USER ELEMENT|UEL PROPERTY|"
    "CONTACT|COHESIVE BEHAVIOR|CYCLIC SYMMETRY MODEL|HYPERELASTIC|HYPERFOAM|MODEL CHANGE|FOUNDATION|"
    "(BEAM|BEAM GENERAL|SHELL|SHELL GENERAL|MEMBRANE|FRAME|COHESIVE|GASKET|CONNECTOR) SECTION"
)
"""Keywords that add mass, stiffness or constraints and are not read."""

_READERS: dict[str, Callable[[Deck, dict[str, str], list[str]], None]] = {
    "SYSTEM": _read_system,
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


def _assembled(deck: Deck) -> RawMesh:
    if not deck.node_id:
        raise Damaged("there is no *NODE")
    node_id, points = _unique_nodes(deck)
    numbering = Numbering(node_id)
    raw = RawMesh(points, node_id)
    if deck.kinds and not deck.solids:
        kinds = ", ".join(dict.fromkeys(deck.kinds))
        raise Damaged(f"it holds no volume cells (C3D4 to C3D27), only {kinds}; mesh the volume first")
    for cells in deck.solids:
        cells.nodes = numbering.positions(cells.nodes, "*ELEMENT names")
        raw.blocks.append((cells.kind, cells.nodes))
    raw.cell_id = [cells.ids for cells in deck.solids]
    ids, count = np.unique(joined(raw.cell_id), return_counts=True)
    if (count > 1).any():
        twice = ids[count > 1][0]
        raise Damaged(f"{_last(twice, raw.cell_id, [c.where for c in deck.solids])}cell {twice} is defined twice")
    _assign_materials(deck, raw)
    _assign_temperatures(deck, raw, numbering)
    for key, parts in deck.node_sets.items():
        members = np.unique(joined(parts))
        if len(members):
            name = deck.written[key]
            raw.add_points(name, numbering.positions(members, f"the node set '{name}' names"))
    raw.links, left_out = links_of(deck, numbering, points)
    raw.lost = [*deck.lost, *left_out, *unpressed(deck)]
    raw.joints, raw.preloads = joints_of(deck), preloads_of(deck)
    raw.instances = {name: numbering.positions(np.unique(ids), "") for name, ids in deck.instances.items()}
    add_supports(raw, _constraints(deck), numbering)
    for cells in deck.facets:
        cells.nodes = numbering.positions(cells.nodes[:, : _CORNERS[cells.nodes.shape[1]]], "*ELEMENT names")
    for key in deck.cell_sets:
        chosen = joined(deck.cell_sets[key])
        for cells in deck.facets:
            if (inside := np.isin(cells.ids, chosen)).any():
                raw.facets.setdefault(deck.written[key], []).append(cells.nodes[inside])
    for name, kind, rows, space, where in deck.surfaces:
        if kind == "NODE":
            _node_surface(deck, raw, numbering, name, rows, space, where)
        elif kind == "ELEMENT":
            _element_surface(deck, raw, name, rows, space, where)
        elif kind in ("UNION", "INTERSECTION", "DIFFERENCE"):
            _combined(raw, deck, name, kind, [word for row in rows for word in row if word], where)
    return raw


def _unique_nodes(deck: Deck) -> tuple[Indices, Array]:
    """Nodes that are defined twice alike count once."""
    node_id, points = np.concatenate(deck.node_id), np.concatenate(deck.points)
    _, first, inverse = np.unique(node_id, return_index=True, return_inverse=True)
    differs = (points != points[first][inverse]).any(axis=1) & np.isfinite(points).all(axis=1)
    if differs.any():
        twice = node_id[differs][0]
        raise Damaged(f"{_last(twice, deck.node_id, deck.node_where)}node {twice} is there already, at another place")
    keep = np.sort(first)
    return node_id[keep], points[keep]


def _last(number: int, numbers: list[Indices], where: list[str]) -> str:
    """The last of the cards that have a number, as the beginning of a sentence."""
    return [f"{place}: " for ids, place in zip(numbers, where, strict=True) if (ids == number).any()][-1]


def _assign_materials(deck: Deck, raw: RawMesh) -> None:
    """A region for every pair of material and orientation that sections give to cells."""
    if not deck.materials:
        return
    raw.regions = [np.full(len(cells.ids), -1) for cells in deck.solids]
    known: dict[tuple[str, str], int] = {}
    for name_of_set, material, orientation, space, where in deck.sections:
        if material.upper() not in deck.materials:
            raise Damaged(
                f"{where}: *SOLID SECTION, ELSET={name_of_set} names the material '{material}', which is not defined"
            )
        axes = deck.key(deck.orientations, orientation, space) if orientation else ""
        if axes is None:
            raise Damaged(
                f"{where}: *SOLID SECTION, ELSET={name_of_set} names the orientation '{orientation}', which is not "
                "defined"
            )
        key = (material.upper(), axes)
        if key not in known:
            known[key] = len(raw.materials)
            raw.materials.append(_deck_material(deck, key, name_of_set))
        chosen = deck.cells(name_of_set, space)
        if chosen is None:
            raise Damaged(f"{where}: *SOLID SECTION names the element set '{name_of_set}', which is not defined")
        for cells, region in zip(deck.solids, raw.regions, strict=True):
            region[np.isin(cells.ids, chosen)] = known[key]
    bare = [cells.ids[region < 0] for cells, region in zip(deck.solids, raw.regions, strict=True)]
    if count := sum(map(len, bare)):
        first = next(int(ids[0]) for ids in bare if len(ids))
        raw.materials.append(DeckMaterial("", None, None, np.zeros(6), where=f"{count} cells from number {first} on"))
        for region in raw.regions:
            region[region < 0] = len(raw.materials) - 1


def _deck_material(deck: Deck, key: tuple[str, str], where: str) -> DeckMaterial:
    found = deck.materials[key[0]]
    turn = deck.orientations[key[1]] if key[1] else None
    axes = None if isinstance(turn, str) else turn
    if refused := found.refused or (turn if isinstance(turn, str) else ""):
        text = f"{refused}, which is not read; write another form, or give density and stiffness in a body.toml"
        return DeckMaterial(found.name, None, found.density, np.zeros(6), None, where, text)
    C, table = None, None
    if found.isotropic is not None:
        C, table = isotropic_rows(found.name, found.isotropic)
    elif found.orthotropic is not None:
        C = orthotropic_row(found.name, found.orthotropic)
    elif found.stiffness is not None:
        C = _orthotropic_stiffness(found.name, found.stiffness)
    if C is not None and axes is not None:
        C = turned(C, axes)
    return DeckMaterial(
        found.name, C, found.density, turned_strain(found.expansion, axes), table, where, line=found.where
    )


def _orthotropic_stiffness(name: str, d: Array) -> Array:
    """Hooke matrix from D1111, D1122, D2222, D1133, D2233, D3333, D1212, D1313, D2323."""
    C = np.diag([d[0], d[2], d[5], d[6], d[8], d[7]])
    C[0, 1] = C[1, 0] = d[1]
    C[0, 2] = C[2, 0] = d[3]
    C[1, 2] = C[2, 1] = d[4]
    if not np.isfinite(C).all() or np.linalg.eigvalsh(C).min() <= 0:
        raise Damaged(f"the stiffness of the material '{name}' is not positive definite")
    return C


def _assign_temperatures(deck: Deck, raw: RawMesh, numbering: Numbering) -> None:
    if not deck.temperatures:
        return
    raw.temperature = np.full((len(raw.points), 2), np.nan)
    for column, word, value in deck.temperatures:
        members = deck.nodes(word)
        if members is None:
            raise Damaged(f"*TEMPERATURE names the node set '{word}', which is not defined")
        raw.temperature[numbering.positions(members, "*TEMPERATURE names"), column] = value


def _constraints(deck: Deck) -> Constraints:
    """What *BOUNDARY holds, its sets by the names they were written with."""
    held = Constraints(all_turned=deck.turned, left_out=list(deck.not_held))
    known = set(joined(deck.node_id).tolist())
    for word, directions, where in deck.held:
        key, found = deck.key(deck.node_sets, word), deck.nodes(word)
        if found is None:
            raise Damaged(f"{where}: *BOUNDARY names the node set '{word}', which is not defined")
        if not known.issuperset(found.tolist()):
            raise Damaged(f"{where}: *BOUNDARY names the node {word}, which is not defined")
        if key is not None:
            held.hold(deck.written[key], directions)
        else:
            held.hold(int(found[0]), directions)
    return held


def _node_surface(
    deck: Deck, raw: RawMesh, numbering: Numbering, name: str, rows: list[list[str]], space: str, where: str
) -> None:
    for row in rows:
        found = deck.nodes(row[0], space)
        if found is None:
            raise Damaged(f"{where}: the surface '{name}' names the node set '{row[0]}', which is not defined")
        if len(found):
            raw.add_points(name, numbering.positions(found, f"the surface '{name}' names"))


def _combined(raw: RawMesh, deck: Deck, name: str, way: str, words: list[str], where: str) -> None:
    """A surface of others: all of their facets, those that they have in common, or those of the first alone."""
    parts = []
    for word in words:
        at, tail = deck.place(word)
        if not {at.prefix + tail, tail} & {known for known, *_ in deck.surfaces}:
            raise Damaged(f"{where}: the surface '{name}' names the surface '{word}', which is not defined")
        parts.append(raw.facets.get(at.prefix + tail) or raw.facets.get(tail) or [])
    if way == "UNION":
        raw.facets[name] = [block for part in parts for block in part]
        return
    others = {tuple(row) for part in parts[1:] for block in part for row in np.sort(block, axis=1).tolist()}
    for block in parts[0] if parts else ():
        inside = np.array([tuple(row) in others for row in np.sort(block, axis=1).tolist()], dtype=bool)
        raw.facets.setdefault(name, []).append(block[inside if way == "INTERSECTION" else ~inside])


def _element_surface(deck: Deck, raw: RawMesh, name: str, rows: list[list[str]], space: str, where: str) -> None:
    """Faces S1 ... S6 of cells given by number or set; without a face the free ones."""
    for row in rows:
        everything = joined(c.ids for c in (*deck.solids, *deck.facets))
        chosen = deck.cells(row[0], space) if row[0] else everything
        face = row[1].upper() if len(row) > 1 else ""
        if chosen is None:
            raise Damaged(f"{where}: the surface '{name}' names the element set '{row[0]}', which is not defined")
        for cells in deck.solids:
            nodes = cells.nodes[np.isin(cells.ids, chosen)]
            sides = _sides(cells.kind)
            if not len(nodes) or not sides:
                continue
            if re.fullmatch(r"S[1-6]", face):
                if int(face[1]) > len(sides):
                    raise Damaged(f"{where}: the surface '{name}' names the side {face} of cells {cells.written}")
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
