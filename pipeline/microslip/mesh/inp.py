"""Reader of Abaqus and CalculiX input files: nodes, solid cells, facets, node sets and element-based surfaces.

Written against the keyword descriptions in the two programs' manuals. It keeps node numbers and reads ``*SURFACE``,
in which such programs name faces; parts are laid where their instances stand (`instances`). A file whose meaning it
cannot keep (mapped nodes) is refused.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ..data import Array, Indices
from ..errors import of_file
from . import deck_conditions, deck_generated, deck_materials, deck_mesh, deck_state
from .cards import Card, data_of, numbers, read_cards
from .deck import Deck
from .deck_conditions import assign_temperatures, constraints, local_axes, local_supports
from .deck_cut import cut_bolts
from .deck_joints import KEYWORDS as JOINTS
from .deck_joints import joints_of, preloads_of, sector_of, unread
from .deck_links import KEYWORDS as LINKS
from .deck_links import links_of
from .deck_lumps import KEYWORDS as LUMPING
from .deck_lumps import NODES as LUMPED
from .deck_lumps import lumps_of
from .deck_materials import assign_materials
from .deck_mesh import CORNERS, add_surfaces, cell_type
from .deck_state import state_of_deck, until_modes
from .instances import numbered, outline, place, placement, places
from .raw import Damaged, Numbering, RawMesh, Structure, ignored, joined, locks, lost, undefined
from .supports import add_supports

_REFUSED = {"NMAP": "maps nodes by *NMAP"}

_LINKING = (*LINKS, *JOINTS, *LUMPING)
READERS = {
    word: read
    for of in (deck_mesh, deck_generated, deck_materials, deck_conditions, deck_state)
    for word, read in of.READERS.items()
}


def read_inp(path: Path) -> RawMesh:
    """Read an input file and those it includes.

    Raises:
        Damaged: content that is inconsistent, or whose meaning would be lost.
    """
    found = outline(read_cards(path))
    whole = Deck()
    parts = [(card, _part(found.parts, card, own)) for card, own in found.instances]
    spaces = places([(card.parameters["NAME"], part) for card, part in parts])
    for (card, part), space in zip(parts, spaces, strict=False):
        with of_file(card.place):
            at = placement(numbers(card.lines, "*INSTANCE"))
        place(whole, part, card.parameters["NAME"], at, space)
    whole.spaces[""] = spaces[-1]
    cards, later = until_modes(found.rest)
    _read(whole, cards)
    raw = _assembled(whole, bool(found.instances))
    raw.remarks += [
        *numbered([card.parameters["NAME"] for card, _ in parts], spaces),
        *_replaced(raw, whole, bool(found.instances)),
        *later,
    ]
    if raw.state is not None and "PLASTIC" in whole.ignored:
        text = "*PLASTIC is not read: the state is elastic, and where it yields frequencies will differ"
        raw.lost.append(f"{raw.state.where}: {text}")
        whole.ignored = [word for word in whole.ignored if word != "PLASTIC"]
    if raw.state is None:
        whole.ignored += [card.keyword for *_, card in whole.steps.acting if card.keyword != "BOUNDARY"]
    raw.remarks += ignored([f"*{word}" for word in whole.ignored], _LOADS, raw.state is not None)
    if not path.read_bytes().endswith(b"\n"):
        raw.unended = "a last line without an end"
    return raw


_LOADS = r"\*(C|D|DS)(LOAD|FLUX)|\*(D|S)?FILM|\*D?RADIATE|\*INERTIA RELIEF|\*MASS FLOW RATE"


CALCULIX = ("tetra", "wedge")
_AS = {
    "C3D8R": "reduced integration becomes full", "C3D8RH": "reduced integration becomes full",
    "C3D8I": "incompatible modes are left out", "C3D8H": "the hybrid form becomes that of displacements",
    "C3D20R": "reduced integration becomes full, a little stiffer on coarse meshes",
    "C3D20RH": "reduced integration becomes full, a little stiffer on coarse meshes",
    "C3D10M": "the modified form becomes the plain one", "C3D10I": "the improved stress is left out",
    "C3D10HS": "the hybrid form becomes that of displacements",
}  # fmt: skip
"""Solids that are taken as their plain sisters, and what that changes."""


def _replaced(raw: RawMesh, deck: Deck, of_parts: bool) -> list[str]:
    """Which cells are taken as others, and how far first-order ones lock in bending.

    Where all bricks of 20 nodes are integrated by eight points they are so here, stiffness and mass, if the deck is of
    CalculiX (it has no parts); so are its tetrahedra of 4 and wedges of 6 nodes by one and two.
    """
    count: dict[str, int] = {}
    for cells in deck.solids:
        count[cells.written] = count.get(cells.written, 0) + len(cells.ids)
    told: list[str] = []
    bricks20 = {cells.written for cells in deck.solids if cells.kind == "hexahedron20"}
    if {cells.kind for cells in deck.solids} & set(CALCULIX) and not of_parts:
        raw.integration = "calculix"
    if bricks20 == {"C3D20R"} and not of_parts:
        raw.integration = "reduced-mass"
        count = {written: number for written, number in count.items() if written != "C3D20R"}
    for written, number in count.items():
        plain = re.match(r"C3D\d+", written)
        if written in _AS and plain:
            text = f"{number} cells {written} are taken as {plain[0]}: {_AS[written]}"
            bricks = plain[0] == "C3D8" and written != "C3D8H"  # whose bending is another
            (raw.lost if bricks else told).append(text + "; frequencies will differ" * bricks)
    return [*told, *locks(raw)]


def _part(parts: dict[str, list[Card]], instance: Card, own: list[Card]) -> Deck:
    """A part as an instance of it begins: with what the instance itself says besides."""
    name = instance.parameters.get("PART", "")
    if "LIBRARY" in instance.parameters or name.upper() not in {*parts, ""}:
        text = f"*INSTANCE names the part '{name}', which the file does not define"
        raise Damaged(text, file=instance.place)
    if not name and not any(card.keyword == "NODE" for card in own):
        text = "the *INSTANCE names no PART and has no nodes of its own"
        raise Damaged(text, file=instance.place)
    deck = Deck()
    _read(deck, [*parts.get(name.upper(), ()), *own])
    return deck


def _read(deck: Deck, cards: list[Card]) -> None:
    """Take in cards one after the other."""
    for card in cards:
        with of_file(card.place):
            _read_card(deck, card)


def _read_card(deck: Deck, card: Card) -> None:
    if card.keyword in _REFUSED:
        raise Damaged(f"the file {_REFUSED[card.keyword]}; write out every node and cell")
    if "INPUT" in card.parameters and card.keyword in (*_LINKING, *READERS):
        card.lines = [*card.lines, *data_of(Path(card.parameters.pop("INPUT")))]
    if card.keyword in _LINKING:
        deck.links.append(card)
    if card.keyword not in READERS:
        if _COUNTS.fullmatch(card.keyword):
            deck.lost.append(lost(card.where, f"*{card.keyword}"))
        elif card.keyword not in (*_SILENT, *_LINKING):
            deck.ignored.append(card.keyword)
        return
    READERS[card.keyword](deck, card)
    kind = card.word("TYPE")
    if card.keyword == "ELEMENT" and card.lines and not cell_type(kind) and kind not in (*LUMPED, "DCOUP3D"):
        deck.lost.append(lost(card.where, f"*ELEMENT, TYPE={kind}"))


_SILENT = {
    "HEADING", "PREPRINT", "RESTART", "OUTPUT", "NODE OUTPUT", "ELEMENT OUTPUT", "CONTACT OUTPUT", "NODE FILE",
    "EL FILE", "NODE PRINT", "EL PRINT", "CONTACT PRINT", "PART", "END PART", "ASSEMBLY", "END ASSEMBLY", "END STEP",
    "INSTANCE", "END INSTANCE", "INCLUDE", "MONITOR", "SECTION PRINT", "CONTACT FILE", "SUBSTRUCTURE GENERATE",
}  # fmt: skip
"""Keywords that say nothing of the body."""

_COUNTS = re.compile(
    "NONSTRUCTURAL MASS|GAP|JOINT|CONNECTOR [A-Z]+|EMBEDDED ELEMENT|"
    "SHELL TO SOLID COUPLING|FASTENER|MATRIX (INPUT|ASSEMBLE)|SUBSTRUCTURE (PROPERTY|PATH|DIRECTORY)|"
    "USER ELEMENT|UEL PROPERTY|"
    "CONTACT|COHESIVE BEHAVIOR|HYPERELASTIC|HYPERFOAM|MODEL CHANGE|FOUNDATION|"
    "(BEAM|BEAM GENERAL|SHELL|SHELL GENERAL|MEMBRANE|FRAME|COHESIVE|GASKET|CONNECTOR) SECTION"
)
"""Keywords that add mass, stiffness or constraints and are not read."""


# from numbers to positions ---------------------------------------------------------------------------------------


def _assembled(deck: Deck, of_parts: bool) -> RawMesh:
    if not deck.node_id:
        raise Damaged("there is no *NODE")
    node_id, points = _unique_nodes(deck)
    numbering = Numbering(node_id)
    raw = RawMesh(points, node_id)
    if deck.kinds and not deck.solids:
        kinds = ", ".join(dict.fromkeys(deck.kinds))
        raise Damaged(f"it holds no volume cells (C3D4 to C3D27), only {kinds}; mesh the volume first")
    for cells in deck.solids:
        with of_file(cells.where):
            cells.nodes = numbering.positions(cells.nodes, "*ELEMENT names", cells.ids)
        raw.blocks.append((cells.kind, cells.nodes))
    raw.cell_id = [cells.ids for cells in deck.solids]
    raw.remarks += _unknown_cells(deck)
    ids, count = np.unique(joined(raw.cell_id), return_counts=True)
    if (count > 1).any():
        twice = ids[count > 1][0]
        place = _last(twice, raw.cell_id, [c.where for c in deck.solids])
        raise Damaged(f"cell {twice} is defined twice", file=place)
    assign_materials(deck, raw)
    assign_temperatures(deck, raw, numbering)
    for key, parts in deck.node_sets.items():
        members = np.unique(joined(parts))
        if len(members):
            raw.add_set(deck.written[key], members, numbering)
    deck.axes = local_axes(deck, numbering, points)
    raw.links, left_out = links_of(deck, numbering, points)
    raw.links += local_supports(deck, numbering)
    raw.lumps = list(lumps_of(deck, numbering, points))
    raw.structures = _structures(deck, numbering)
    raw.retained = _retained(deck, raw, numbering)
    raw.sector, uncut = sector_of(deck)
    raw.preloads, unpressed = preloads_of(deck)
    raw.lost = [*deck.lost, *left_out, *uncut, *unpressed]
    raw.remarks += [*dict.fromkeys(deck.remarks), *unread(deck)]
    raw.joints = joints_of(deck)
    raw.instances = {name: numbering.positions(np.unique(ids), "") for name, ids in deck.instances.items()}
    add_supports(raw, constraints(deck, deck.held), numbering)
    for cells in deck.facets:
        cells.nodes = numbering.positions(cells.nodes[:, : CORNERS[cells.nodes.shape[1]]], "*ELEMENT names")
    for key in deck.cell_sets:
        chosen = joined(deck.cell_sets[key])
        for cells in deck.facets:
            if (inside := np.isin(cells.ids, chosen)).any():
                raw.facets.setdefault(deck.written[key], []).append(cells.nodes[inside])
    add_surfaces(deck, raw, numbering)
    state_of_deck(deck, raw, numbering, of_parts)
    cut_bolts(deck, raw, numbering)
    return raw


def _structures(deck: Deck, numbering: Numbering) -> list[Structure]:
    """Beams, shells, connectors and the like by their types."""
    shells = [
        (c.where.rpartition("/")[2], c.written, c.nodes.tolist())
        for c in deck.facets
        if re.match(r"(S|STRI|M3D)\d", c.written)
    ]
    kinds: dict[str, Structure] = {}
    for where, kind, rows in (*deck.structures, *shells):
        there = [[n for n in nodes if n in numbering.sorted] for nodes in rows]
        elements = [numbering.positions(nodes, "").tolist() for nodes in there if nodes]
        if elements and kind != "DCOUP3D":
            kinds.setdefault(kind, Structure(where, kind, [])).elements.extend(elements)
    return list(kinds.values())


def _retained(deck: Deck, raw: RawMesh, numbering: Numbering) -> list[str]:
    """Sets of nodes whose displacements a substructure keeps."""
    names = []
    for word, at in deck.retained:
        with of_file(at):
            key, nodes = deck.key(deck.node_sets, word), deck.nodes_for("*RETAINED NODAL DOFS", word)
        if key is None:
            raw.add_set(f"retained {word}", nodes, numbering)
        names.append(f"retained {word}" if key is None else deck.written[key])
    return list(dict.fromkeys(names))


def _unknown_cells(deck: Deck) -> list[str]:
    """What is said of element sets that name cells which are not there; nothing beside kinds that are not read."""
    if not all(kind in LUMPED or cell_type(kind) for kind in deck.kinds):
        return []
    known = joined(cells.ids for cells in (*deck.solids, *deck.facets, *deck.lumped))
    gone = {key: np.setdiff1d(joined(parts), known) for key, parts in deck.cell_sets.items()}
    return [undefined(deck.written[key], "element", ids) for key, ids in gone.items() if len(ids)]


def _unique_nodes(deck: Deck) -> tuple[Indices, Array]:
    """Nodes that are defined twice alike count once."""
    node_id, points = np.concatenate(deck.node_id), np.concatenate(deck.points)
    _, first, inverse = np.unique(node_id, return_index=True, return_inverse=True)
    differs = (points != points[first][inverse]).any(axis=1) & np.isfinite(points).all(axis=1)
    if differs.any():
        twice = node_id[differs][0]
        place = _last(twice, deck.node_id, deck.node_where)
        raise Damaged(f"node {twice} is there already, at another place", file=place)
    keep = np.sort(first)
    return node_id[keep], points[keep]


def _last(number: int, numbers: list[Indices], places: list[str]) -> str:
    """Place of the last of the cards that have a number."""
    return [place for ids, place in zip(numbers, places, strict=True) if (ids == number).any()][-1]
