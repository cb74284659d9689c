"""Reader of Nastran bulk data: grid points, solid elements, materials, sets of points, shells as faces.

Written against the Quick Reference Guide: GRID, GRDSET, CORD1R, CORD1C, CORD1S, CORD2R, CORD2C, CORD2S,
CTETRA, CHEXA, CPENTA, CPYRAM, PSOLID, MAT1, PARAM WTMASS, SET1, SPC, SPC1, SPCADD, the constraints
RBE2, RBE3, MPC, MPCADD and the shells CTRIA3, CTRIA6, CQUAD4, CQUAD8; fields of eight or sixteen
columns or between commas.
"""

from __future__ import annotations

import contextlib
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..data import Array, AverageLink, Equation, Indices, Link, RigidLink
from ..elasticity import strain_tensor, turned, turned_strain
from ..topology import CELL_TYPES
from .bdf_lumps import READ as LUMPED
from .bdf_lumps import bars_of, lumps_of
from .materials import isotropic_rows, orthotropic_row
from .raw import PRESTRESSED, Damaged, DeckMaterial, Numbering, RawMesh, Structure, ignored, lost
from .supports import Constraints, add_supports, in_axes
from .systems import Chained, System, through

_BRICK20, _WEDGE15 = (
    (*range(12), *range(16, 20), *range(12, 16)),
    (*range(9), *range(12, 15), *range(9, 12)),
)
"""Places of VTK's nodes: mid-side nodes of the lower edges, the upright ones, the upper ones."""
_SOLIDS: dict[str, dict[int, tuple[str, Sequence[int]]]] = {
    "CTETRA": {4: ("tetra", range(4)), 10: ("tetra10", range(10))},
    "CHEXA": {8: ("hexahedron", range(8)), 20: ("hexahedron20", _BRICK20)},
    "CPENTA": {6: ("wedge", range(6)), 15: ("wedge15", _WEDGE15)},
    "CPYRAM": {5: ("pyramid", range(5)), 13: ("pyramid13", range(13))},
}
_SOLIDS["CPYRA"] = _SOLIDS["CPYRAM"]
_SHELLS = {"CTRIA3": 3, "CTRIAR": 3, "CTRIA6": 3, "CQUAD4": 4, "CQUADR": 4, "CQUAD8": 4}
_MATERIALS = ("MAT2", "MAT3", "MAT8", "MAT9", "MAT10", "MAT11")
_PROPERTIES = ("PCOMPS", "PLSOLID", "PCOMPLS", "PSOLID")
_SYSTEMS = ("CORD1R", "CORD1C", "CORD1S", "CORD2R", "CORD2C", "CORD2S")
_READ = {
    "GRID", "GRDSET", *_SYSTEMS, "PSOLID", "MAT1", "PARAM", "SET1", "SPC", "SPC1", "SPCADD", "RBE2", "RBE3", "MPC",
    "MPCADD", "ASET", "ASET1", *_SOLIDS, *_SHELLS, *_MATERIALS, *_PROPERTIES, *LUMPED,
}  # fmt: skip
_SILENT = re.compile(
    r"EIG\w*|CORD\w+|MATT\d+|ENDDATA|LOAD|DLOAD|TABL\w*|FREQ\d?|TSTEP|NLPARM|DTI|SET3|MDLPRM"
)
"""Cards that say nothing of the body, or only together with others that are named."""
_LOADS = r"FORCE\d?|MOMENT\d?|PLOAD\w*|GRAV|RFORCE\d?|ACCEL\d?|TEMP\w*|SLOAD|DAREA|DEFORM"
_COUNTS = re.compile(
    r"C(?!ORD|END)[A-Z]+\d?|R(?!FORCE|LOAD|AND|ING)[A-Z]+\d?|SUPORT1?|GENEL|DMIG|NSM[A-Z]*\d?|"
    r"MFLUID|BCTSET|BGSET|BCTABL[E1]|BCBODY1?|PSHELL|PCOMPG?|BCONTACT|BOLT|SPCOFF1?|SPCR|SPLINE\d|AEQUAD4"
)
"""Cards that add mass, stiffness or constraints; those beside `_READ` are not read."""


class _Card(list[str]):
    """Name and fields, and the line of the file that they begin in."""

    line = 0

    @property
    def where(self) -> str:
        return f"line {self.line}: {self.name}"

    @property
    def name(self) -> str:
        return f"{self[0]} {self.at(1)}"

    def at(self, place: int) -> str:
        return self[place] if place < len(self) else ""

    def whole(self, place: int, otherwise: int | None = None) -> int:
        text = self.at(place)
        if not text and otherwise is not None:
            return otherwise
        if not re.fullmatch(r"[+-]?\d{1,12}", text):
            raise Damaged(f"{self.name} holds '{text[:20]}' where a whole number belongs")
        return int(text)

    def real(self, place: int) -> float | None:
        """A number as Nastran writes it: 1.5-3 is 1.5E-3. None: blank."""
        text = self.at(place).replace("D", "E")
        if not text:
            return None
        try:
            return float(re.sub(r"(?<=[\d.])([+-]\d+)$", r"E\1", text) if "E" not in text else text)
        except ValueError:
            raise Damaged(f"{self.name} holds '{text[:20]}' where a number belongs") from None

    def directions(self, place: int) -> str:
        return "".join(
            name for name, digit in zip("xyzabc", "123456", strict=True) if digit in self.at(place)
        )


@dataclass
class _Bulk:
    """The cards of a file by their names. held: what its constraints hold."""

    file: str
    text: str
    cards: defaultdict[str, list[_Card]]
    raw: RawMesh
    numbering: Numbering
    held: Constraints
    systems: Chained

    def frame(self, card: _Card, number: int, node: int) -> Array:
        """(3, 3) rows are the directions of a coordinate system at the node at a position."""
        with _named(self.where(card)):
            return self.systems[number].directions(self.raw.points[[node]])[0]

    def where(self, card: _Card) -> str:
        return f"{self.file}, {card.where}"

    def positions(self, card: _Card, numbers: Sequence[int]) -> Indices:
        """Of nodes that a card names."""
        return self.numbering.positions(numbers, f"{self.where(card)} names")

    def numbered(self, names: Iterable[str], number: int) -> Iterator[_Card]:
        """Cards of these names that have a number."""
        return (card for name in names for card in self.cards[name] if card.whole(1) == number)


_EVERY = ("xyz", "abc", "xyzabc")  # directions that mean the same in every system


def read_bdf(path: Path) -> RawMesh:
    """Read a bulk data file.

    Raises:
        Damaged: content that is inconsistent, or whose meaning would be lost.
    """
    text, cards = path.read_text(encoding="latin-1"), defaultdict[str, list[_Card]](list)
    for card in _cards(text):
        cards[card[0]].append(card)
    others = {name: c for name, c in cards.items() if name not in _READ}
    raw, held, systems = _grid(cards, path.name)
    bulk = _Bulk(path.name, text, cards, raw, Numbering(raw.node_id), held, systems)
    properties = _elements(bulk)
    if any(cards[name] for name in (*_PROPERTIES, "MAT1", *_MATERIALS)):
        raw.materials = [_material(bulk, p) for p in properties]
    if not raw.materials:
        raw.regions = []
    _shells(bulk)
    for name, label, first in (("SET1", "SET", 2), ("SPC1", "SPC", 3)):
        for card in cards[name]:
            raw.add_set(f"{label} {card[1]}", _listed(card, first, bulk.numbering), bulk.numbering)
    _constrain(bulk)
    raw.lost += [
        lost(f"{path.name}, line {c[0].line}", f"{name} ({len(c)} card{'s' * (len(c) > 1)})")
        for name, c in others.items()
        if _COUNTS.fullmatch(name)
    ]
    raw.lost += [
        f"{bulk.where(c)}: a material over temperature, of which MAT1 alone is read: "
        "frequencies will differ by a factor"
        for name in others
        if name.startswith("MATT")
        for c in others[name]
    ]
    stress = _prestressed(path.name, text)
    raw.lost += stress
    unused = (n for n in others if not (_COUNTS.fullmatch(n) or _SILENT.fullmatch(n)))
    raw.remarks += ignored(unused, _LOADS, bool(stress))
    raw.links += [*_rigid(bulk), *bars_of(bulk), *_averages(bulk), *_equations(bulk)]
    raw.lumps = lumps_of(bulk)
    raw.structures = list(_structures(bulk))
    _retain(bulk)
    add_supports(raw, bulk.held, bulk.numbering)
    if not re.search(r"^\s*ENDDATA\b", text, re.IGNORECASE | re.MULTILINE):
        raw.unended = "no ENDDATA"  # a warning: decks are also kept as parts that others include
    return raw


def _prestressed(name: str, text: str) -> list[str]:
    """What is said of a case control whose modes are those under the load of another subcase."""
    for number, line in enumerate(text.upper().splitlines(), 1):
        if re.match(r"\s*BEGIN\s+BULK", line):
            break
        if re.match(r"\s*STATSUB\b", line):
            return [f"{name}, line {number}: STATSUB: {PRESTRESSED}"]
    return []


# cards ---------------------------------------------------------------------------------------------------------------


def _cards(text: str) -> Iterator[_Card]:
    """Name and fields of every card in capitals, its continuations joined."""
    lines = text.upper().splitlines()
    begin = next((i for i, line in enumerate(lines) if re.match(r"\s*BEGIN\s+BULK", line)), -1)
    card = _Card()
    for number, line in enumerate(lines[begin + 1 :], begin + 2):
        line = line.split("$")[0].expandtabs(8).rstrip()
        if not line:
            continue
        if re.match(r"\s*ENDDATA\b", line):
            break
        if re.match(r"\s*INCLUDE\b", line):
            raise Damaged("it includes another file; write the bulk data in one")
        words = _fields(line, number)
        if words[0] == "" or words[0][0] in "+*":
            if card:
                card += words[1:]
            continue
        if card:
            yield card
        card = _Card([words[0].rstrip("*").strip(), *words[1:]])
        card.line = number
    if card:
        yield card


def _fields(line: str, number: int) -> list[str]:
    """Name and eight (or four wide) fields of a line; all that stand in a free one.

    Raises:
        Damaged: a free line whose tenth field may be data or the mark of a continuation.
    """
    if "," in line:
        words = [word.strip() for word in line.rstrip(", \t").split(",")]
        count = 4 if words[0].endswith("*") or words[0].startswith("*") else 8
        data, more = words[: count + 1], words[count + 1 :]
        if more and more[0][:1] in ("+", "*"):  # the mark of a continuation
            more = more[1:]
        elif len(more) == 1 and not more[0][:1].isdecimal():  # such a mark in letters
            more = []
        elif more and (len(more) == 1 or not more[0]):
            raise Damaged(
                f"line {number} has '{more[0]}' in its field {count + 2}, which is that of the "
                "continuation; write "
                f"what follows field {count + 1} in a line of its own"
            )
        return [*data, *[""] * (count + 1 - len(data)), *more]
    width, count = (16, 4) if "*" in line[:8] else (8, 8)
    return [
        line[:8].strip(),
        *(line[8 + i * width : 8 + (i + 1) * width].strip() for i in range(count)),
    ]


def _listed(card: _Card, first: int, numbering: Numbering | None = None) -> list[int]:
    """Numbers from a place on; A THRU B (BY C) is a range, of the grid points that are there."""
    words = [w for w in card[first:] if w]
    members: list[int] = []
    while words:
        word, *words = words
        if word == "THRU" and members and words and words[0].isdecimal() and len(words[0]) < 10:
            start, end, step = members[-1], int(words[0]), 1
            words = words[1:]
            if words[:1] == ["BY"] and words[1:2] and words[1].isdecimal():
                step, words = max(int(words[1]), 1), words[2:]
            if numbering is None:
                members += range(start + step, min(end, start + 10**8) + 1, step)
                continue
            there = numbering.between(start, end)
            members = [*members[:-1], *there[(there - start) % step == 0].tolist()]
        elif word == "THRU":
            raise Damaged(f"{card.name} holds THRU without its ends")
        elif word.isdecimal() and len(word) < 13:
            members.append(int(word))
        else:
            raise Damaged(f"{card.name} holds '{word[:20]}' where the number of a point belongs")
    return members


# content -------------------------------------------------------------------------------------------------------------


def _grid(cards: Mapping[str, list[_Card]], file: str) -> tuple[RawMesh, Constraints, Chained]:
    """The grid points in the basic system, and what they hold themselves (PS) in the directions of
    their systems (CD)."""
    if not cards["GRID"]:
        raise Damaged("it holds no GRID card")
    usual = next(iter(cards["GRDSET"]), _Card())
    systems, table = _systems(cards, file), np.empty((len(cards["GRID"]), 3))
    ids, held = np.array([card.whole(1) for card in cards["GRID"]], dtype=np.int64), Constraints()
    within, turned = dict[int, list[int]](), dict[int, list[int]]()
    for place, card in enumerate(cards["GRID"]):
        table[place] = [card.real(column) or 0.0 for column in (3, 4, 5)]
        for column, groups in ((2, within), (6, turned)):
            number = card.whole(column, usual.whole(column, 0))
            if number > 0:  # -1 is a grid point of a fluid
                groups.setdefault(number, []).append(place)
        held.hold(int(ids[place]), (card if card.at(7) else usual).directions(7))
    for groups, into in ((within, True), (turned, False)):
        for number, places in groups.items():
            with _named(f"{file}, {cards['GRID'][places[0]].where}"):
                system = systems[number]
            if into:
                table[places] = system.points(table[places])
            else:
                frames = system.directions(table[places])
                held.axes |= dict(zip(ids[places].tolist(), frames, strict=True))
    return RawMesh(table, ids), held, systems


@contextlib.contextmanager
def _named(where: str) -> Iterator[None]:
    """Puts the place of a card before what is wrong with it."""
    try:
        yield
    except Damaged as error:
        text = str(error.args[0])
        raise Damaged(text if ", line " in text else f"{where} {text}") from None


def _systems(cards: Mapping[str, list[_Card]], file: str) -> Chained:
    """The systems of CORD1R, C, S (through three grid points) and CORD2R, C, S."""
    known = dict[int, tuple[_Card, int]]()
    for name in _SYSTEMS:
        for card in cards[name]:
            for place in (1, 5) if name[4] == "1" else (1,):
                if place == 5 and not card.at(place):
                    continue
                number = card.whole(place)
                if number in known and known[number][0][1:] != card[1:]:
                    with _named(f"{file}, {card.where}"):
                        raise Damaged(f"defines system {number}, which is there already")
                known[number] = card, place
    grids = dict[int, _Card]()

    def at(number: int) -> Array:
        """(3,) of a grid point."""
        if not grids:
            grids.update((card.whole(1), card) for card in cards["GRID"])
        if number not in grids:
            raise Damaged(f"names grid point {number}, which is not there")
        card, usual = grids[number], next(iter(cards["GRDSET"]), _Card())
        within = chained[max(card.whole(2, usual.whole(2, 0)), 0)]
        return within.points(np.array([[card.real(column) or 0.0 for column in (3, 4, 5)]]))[0]

    def made(number: int) -> System:
        if number not in known:
            raise Damaged(f"uses the coordinate system {number}, which no CORD card defines; add it")
        card, place = known[number]
        with _named(f"{file}, {card.where}"):
            if card[0][4] == "1":
                points = np.array([at(card.whole(place + i)) for i in (1, 2, 3)])
            else:
                rows = [[card.real(3 + 3 * i + k) or 0.0 for k in range(3)] for i in range(3)]
                points = chained[card.whole(2, 0)].points(np.array(rows))
            return through({"R": 0, "C": 1, "S": 3}[card[0][5]], *points)

    chained = Chained(made)
    return chained


def _elements(bulk: _Bulk) -> list[int]:
    """Add the solids; the properties that they name, in the order of their regions."""
    blocks: dict[str, list[tuple[int, int, list[int]]]] = {}
    properties, fluids = dict[int, int](), _fluids(bulk)
    for name in _SOLIDS:
        for card in bulk.cards[name]:
            if card.whole(2, card.whole(1)) in fluids:
                continue
            number, region = card.whole(1), properties.setdefault(
                card.whole(2, card.whole(1)), len(properties)
            )
            kind, nodes = _cell(name, number, card)
            blocks.setdefault(kind, []).append((number, region, nodes))
    _add_left_out(bulk, blocks)
    bulk.raw.add_solids(blocks, bulk.numbering, "an element names")
    if fluids and not blocks:
        raise Damaged("all of its solid cells are a fluid (MAT10); give those of the structure")
    return list(properties)


def _cell(name: str, number: int, card: _Card) -> tuple[str, list[int]]:
    """Type and nodes of a cell, 0 where a mid-side node is left out."""
    forms = _SOLIDS[name]
    nodes = [card.whole(place, 0) for place in range(3, len(card))]
    while nodes and nodes[-1] == 0:
        nodes.pop()
    corners, most = sorted(forms)
    if len(nodes) not in range(corners, most + 1) or min(nodes[:corners]) < 1 or min(nodes) < 0:
        raise Damaged(
            f"element {number} ({name}) has {sum(n > 0 for n in nodes)} nodes; {corners} or {most} are read"
        )
    kind, places = forms[corners if len(nodes) == corners else most]
    nodes += [0] * (max(places) + 1 - len(nodes))
    return kind, [nodes[i] for i in places]


def _add_left_out(bulk: _Bulk, blocks: dict[str, list[tuple[int, int, list[int]]]]) -> None:
    """Put a node in the middle of every edge without one in cells that have others: it moves as the
    mean of the edge's ends, so the edge is a straight first-order one, as Nastran takes it."""
    raw, made = bulk.raw, dict[tuple[int, int], int]()
    first = int(raw.node_id.max()) + 1
    for kind, cells in blocks.items():
        edges, corners = CELL_TYPES[kind].edges, CELL_TYPES[kind].corners
        for _, _, nodes in cells:
            for i in (i for i, node in enumerate(nodes) if not node):
                a, b = (nodes[end] for end in edges[i - corners][:2])
                nodes[i] = made.setdefault((min(a, b), max(a, b)), first + len(made))
    if not made:
        return
    at = bulk.numbering.positions(list(made), "an element names")
    new = len(raw.points) + np.arange(len(at))
    where, mean = f"{bulk.file}: mid-side nodes that are left out", np.array([1.0, -0.5, -0.5])
    raw.links += [
        Equation(where, np.array([node, *ends]), np.full(3, way), mean)
        for node, ends in zip(new, at, strict=True)
        for way in range(3)
    ]
    raw.points = np.concatenate([raw.points, raw.points[at].mean(axis=1)])
    raw.node_id = np.concatenate([raw.node_id, first + np.arange(len(at))])
    bulk.numbering = Numbering(raw.node_id)
    raw.remarks.append(f"{len(at)} mid-side nodes are left out by cells: their edges are of first order")


def _fluids(bulk: _Bulk) -> set[int]:
    """Properties of fluid cells, which are told: MAT10, or PFLUID of a PSOLID."""
    acoustic = {card.whole(1) for card in bulk.cards["MAT10"]}
    solid = {card.whole(1) for name in ("MAT1", "MAT9", "MAT11") for card in bulk.cards[name]}
    fluids = {
        card.whole(1)
        for card in bulk.cards["PSOLID"]
        if card.at(7) == "PFLUID" or card.whole(2, 0) in acoustic - solid
    }
    for number in fluids:
        count = sum(card.whole(2) == number for name in _SOLIDS for card in bulk.cards[name])
        if count:
            where = bulk.where(next(bulk.numbered(["PSOLID"], number)))
            bulk.raw.lost.append(
                f"{where}: its {count} cells are a fluid and are left out: in contact with it "
                "the structure has lower frequencies"
            )
    return fluids


def _material(bulk: _Bulk, property_: int) -> DeckMaterial:
    """What a property's cells are made of."""
    where, nothing = f"PSOLID {property_}", np.zeros(6)
    for layered in bulk.numbered(_PROPERTIES[:-1], property_):
        refused = (
            "a property that is not read; write PSOLID with a MAT1, or [material] in a body.toml"
        )
        return DeckMaterial(f"{layered[0]} {property_}", None, None, nothing, refused=refused)
    solid = next(bulk.numbered(["PSOLID"], property_), None)
    if solid is None:
        return DeckMaterial("", None, None, nothing, where=f"property {property_}, which no PSOLID defines")
    number = solid.whole(2, 0)
    factor = next((c.real(2) for c in bulk.cards["PARAM"] if c.at(1) == "WTMASS"), None)

    def mass(card: _Card, place: int) -> float | None:
        """Density: PARAM,WTMASS turns a weight into a mass."""
        rho = card.real(place)
        return rho if rho is None or factor is None else rho * factor

    for card in bulk.numbered(["MAT1"], number):
        E, G, nu = map(card.real, (2, 3, 4))
        density, name, line = mass(card, 5), card.name, bulk.where(card)
        if not E and G and nu is not None:
            E = 2 * G * (1 + nu)
        if nu is None and E and G:
            nu = E / (2 * G) - 1
        if not E or nu is None:
            return DeckMaterial(
                name, None, density, nothing, None, where, line=line, young=E, poisson=nu, shear=G
            )
        C, _ = isotropic_rows(name, np.array([[E, nu, 0.0]]))
        expansion = turned_strain(np.full(3, card.real(6) or 0.0), None)
        return DeckMaterial(name, C, density, expansion, where=where, line=line)
    for card in bulk.numbered(["MAT9", "MAT11"], number):
        nine, line = card[0] == "MAT9", bulk.where(card)
        density = mass(card, 23 if nine else 11)
        axes, refused = _material_axes(bulk, solid)
        if refused:
            return DeckMaterial(card.name, None, density, nothing, None, where, refused, line)
        if nine:
            C, expansion = _anisotropic(card)
            C, expansion = turned(C, axes), _turned_expansion(expansion, axes)
        else:
            constants = np.array([card.real(place) or 0.0 for place in range(2, 11)])
            C = turned(orthotropic_row(card.name, constants), axes)
            along = np.array([card.real(place) or 0.0 for place in (12, 13, 14)])
            expansion = turned_strain(along, axes)
        return DeckMaterial(card.name, C, density, expansion, where=where, line=line)
    for other in (c for m in _MATERIALS for c in bulk.cards[m] if c.at(1) == str(number)):
        refused = "a form that is not read; write it as MAT1, MAT9 or MAT11, or give it in a body.toml"
        return DeckMaterial(other.name, None, None, nothing, None, where, refused, bulk.where(other))
    return DeckMaterial(f"MAT1 {number} (missing)", None, None, nothing, where=where)


def _material_axes(bulk: _Bulk, solid: _Card) -> tuple[Array, str]:
    """(3, 3) rows: the material's axes by CORDM of a PSOLID, or why they are not read."""
    number = int(solid.at(3) or 0) if re.fullmatch(r"-?\d*", solid.at(3)) else -1
    remedy = "write a rectangular CORDM, or give density and stiffness in a body.toml"
    if number < 0:
        return np.eye(3), f"directions of each cell (CORDM {solid.at(3)}), which are not read; {remedy}"
    with _named(bulk.where(solid)):
        system = bulk.systems[number]
    if system.kind:
        return np.eye(3), f"directions that turn along the body (CORDM {number}), which are not read; {remedy}"
    return system.axes, ""


def _anisotropic(card: _Card) -> tuple[Array, Array]:
    """Hooke matrix and expansions (6,) of a MAT9 in its axes, order xx, yy, zz, xy, yz, zx.

    Raises:
        Damaged: a matrix that is not positive definite.
    """
    C = np.zeros((6, 6))
    C[np.triu_indices(6)] = [card.real(place) or 0.0 for place in range(2, 23)]
    C = C + np.triu(C, 1).T
    if not np.linalg.eigvalsh(C).min() > 0:
        raise Damaged(f"{card.where} has a matrix that is not positive definite")
    return C, np.array([card.real(place) or 0.0 for place in range(24, 30)])


def _turned_expansion(strain: Array, axes: Array) -> Array:
    """(6,) strain with engineering shear, xx, yy, zz, xy, yz, zx, in body axes."""
    tensor = axes.T @ strain_tensor(strain) @ axes
    return np.concatenate([np.diag(tensor), 2 * tensor[[0, 1, 0], [1, 2, 2]]])


def _constrain(bulk: _Bulk) -> None:
    """Zero displacements: GRID's own, and those of the sets that the case control chooses, or the only one."""
    held, cards = bulk.held, bulk.cards
    chosen = _chosen(bulk, held)
    for card in cards["SPC1"]:
        if card.whole(1) in chosen:
            for node in _listed(card, 3, bulk.numbering):
                held.hold(node, card.directions(2))
    for card in cards["SPC"]:
        for place in (2, 5) if card.whole(1) in chosen else ():
            node = card.whole(place, 0)
            if node and (card.real(place + 2) or 0.0) != 0:
                held.left_out.append(f"SPC {card[1]} displaces node {node}")
            elif node:
                held.hold(node, card.directions(place + 1))


def _chosen(bulk: _Bulk, held: Constraints, kind: str = "SPC") -> set[int]:
    """Numbers of the sets of constraints that hold, those that they are made of included."""
    control = re.split(
        r"^\s*BEGIN\s+BULK", bulk.text, maxsplit=1, flags=re.IGNORECASE | re.MULTILINE
    )
    pattern = re.compile(rf"^\s*{kind}\s*=\s*(\d{{1,9}})\b", re.IGNORECASE | re.MULTILINE)
    named = pattern.findall(control[0]) if len(control) > 1 else []
    every = {c.whole(1) for name in (kind, f"{kind}1") for c in bulk.cards[name]}
    if not named and every and len(control) > 1:
        sets = "the only set" if len(every) == 1 else "several sets"
        held.left_out.append(
            f"{sets} of {kind}, of which the case control chooses none: not held (write {kind} = {min(every)})"
        )
        return set()
    if not named and len(every) > 1:
        held.left_out.append(f"several sets of {kind} without a case control that chooses")
        return set()
    chosen = {int(n) for n in named} if named else every
    if len(set(named)) > 1:
        held.left_out.append(
            f"subcases choose several sets of {kind} ({', '.join(named)}); all of them hold here at once"
        )
    unions = bulk.cards[f"{kind}ADD"]
    known = every | {c.whole(1) for c in unions}
    if unknown := sorted(chosen - known):
        held.left_out.append(
            f"the set {kind} = {unknown[0]} of the case control is not defined, so it does not hold"
        )
    for card in unions:
        if card.whole(1) in chosen:
            chosen |= set(_listed(card, 2))
    return chosen


def _rigid(bulk: _Bulk) -> Iterator[Link]:
    """RBE2: points that follow one as a rigid body does, in some of its directions."""
    for card in bulk.cards["RBE2"]:
        listed = [word for word in card[4:] if word.isdecimal()] if "THRU" not in card else card[4:]
        members = _listed(_Card([*card[:4], *listed]), 4, bulk.numbering)
        if not members:
            raise Damaged(f"{bulk.where(card)} couples no nodes to its node {card.at(2)}; add them")
        reference, ways = bulk.positions(card, [card.whole(2)]), card.directions(3)
        link = RigidLink(bulk.where(card), int(reference[0]), bulk.positions(card, members), ways)
        turned = bulk.held.axes.keys() & set(members) if ways not in _EVERY else set()
        if len(turned) < len(members):
            plain = [number for number in members if number not in turned]
            yield replace(link, members=bulk.positions(card, plain))
        for number in sorted(turned):
            alone = bulk.positions(card, [number])
            yield replace(link, members=alone, axes=bulk.held.axes[number])


def _averages(bulk: _Bulk) -> Iterator[Link]:
    """RBE3: a point that follows others in the mean."""
    for card in bulk.cards["RBE3"]:
        where = bulk.where(card)
        if "UM" in card:
            raise Damaged(
                f"{where} names its dependent displacements by UM, which is not read; leave it out"
            )
        members: list[int] = []
        weights: list[Array] = []
        place, end = 5, card.index("ALPHA") if "ALPHA" in card else len(card)
        while place < end:
            if not card.at(place):
                place += 1
                continue
            weight = card.real(place) or 0.0
            digits = [int(c) - 1 for c in card.at(place + 1) if c in "123"]
            place += 2
            while place < end and (not card[place] or card[place].isdecimal()):
                if card[place]:
                    members.append(int(card[place]))
                    axes = bulk.held.axes.get(members[-1], np.eye(3))[digits]
                    weights.append(weight * axes.T @ axes)
                place += 1
        if not members:
            raise Damaged(f"{where} follows no nodes; add them")
        ways = card.directions(4)
        own_axes = bulk.held.axes.get(card.whole(3)) if ways not in _EVERY else None
        reference, positions = bulk.positions(card, [card.whole(3)]), bulk.positions(card, members)
        W = np.array(weights)
        even = (W == W[:, :1, :1] * np.eye(3)).all()
        factors = W[:, 0, 0] if even else W
        yield AverageLink(where, int(reference[0]), positions, factors, ways, own_axes)


def _equations(bulk: _Bulk) -> Iterator[Link]:
    """MPC of the sets that the case control chooses, or of the only one of a file without case control."""
    own = Constraints()
    chosen = _chosen(bulk, own, "MPC")
    bulk.raw.lost += [f"{bulk.file}: {left_out}" for left_out in own.left_out]
    for card in bulk.cards["MPC"]:
        if card.whole(1) not in chosen:
            continue
        places = [p + s for p in range(2, len(card), 8) for s in (0, 3) if card.at(p + s)]
        numbers = [card.whole(p) for p in places]
        nodes, ways = bulk.positions(card, numbers), [card.whole(p + 1, 0) - 1 for p in places]
        if not all(0 <= way < 6 for way in ways):
            raise Damaged(f"{bulk.where(card)} names a component that no grid point has (1 to 6)")
        factors = np.array([card.real(p + 2) or 0.0 for p in places])
        if bulk.held.axes.keys().isdisjoint(numbers):
            yield Equation(bulk.where(card), nodes, np.array(ways), factors)
            continue
        pairs = zip(numbers, ways, strict=True)
        along = np.array([bulk.held.axes.get(node, np.eye(3))[way % 3] for node, way in pairs])
        first = np.array(ways) // 3 * 3
        yield in_axes(bulk.where(card), nodes, first, along * factors[:, None])


def _retain(bulk: _Bulk) -> None:
    """ASET, ASET1: displacements that a reduction keeps; they are held by nothing."""
    nodes = [card.whole(p) for card in bulk.cards["ASET"] for p in range(1, len(card), 2) if card.at(p)]
    nodes += [n for card in bulk.cards["ASET1"] for n in _listed(card, 2, bulk.numbering)]
    if nodes:
        bulk.raw.add_set("ASET", nodes, bulk.numbering)
        bulk.raw.retained.append("ASET")


def _structures(bulk: _Bulk) -> Iterator[Structure]:
    """Beams, rods and shells, which are not read."""
    for name, (first, count) in _OTHERS.items():
        if cards := bulk.cards[name]:
            nodes = [[card.whole(p, 0) for p in range(first, first + count)] for card in cards]
            nodes = [[n for n in each if n in bulk.numbering.sorted] for each in nodes]
            elements = [bulk.numbering.positions(each, "").tolist() for each in nodes if each]
            if elements:
                yield Structure(f"{bulk.file}, line {cards[0].line}", name, elements)


_OTHERS = {
    **dict.fromkeys(("CBAR", "CBEAM", "CBEND", "CROD", "CTUBE", "CGAP", "CVISC", "CBEAM3"), (3, 2)), "CONROD": (2, 2),
    **{name: (3, corners) for name, corners in _SHELLS.items()}, "CSHEAR": (3, 4),
}  # fmt: skip
"""Card of an element that is no solid -> place of its first node, and how many it has at its corners."""


def _shells(bulk: _Bulk) -> None:
    """Faces by the property of the shells that lie on them."""
    facets: dict[tuple[str, int], list[list[int]]] = {}
    for name, corners in _SHELLS.items():
        for card in bulk.cards[name]:
            nodes = [card.whole(3 + i) for i in range(corners)]
            facets.setdefault((f"PSHELL {card.whole(2, card.whole(1))}", corners), []).append(nodes)
    for (label, _), numbers in facets.items():
        positions = bulk.numbering.positions(numbers, f"a shell of {label} names")
        bulk.raw.facets.setdefault(label, []).append(positions)
