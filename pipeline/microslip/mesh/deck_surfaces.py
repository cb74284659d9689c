"""Of an Abaqus or CalculiX input file: the facets of its surfaces, by cells and sides, by nodes, by other surfaces."""

from __future__ import annotations

import re

import numpy as np

from ..data import Indices
from ..errors import of_file
from .cards import Card
from .deck import Deck
from .raw import Damaged, Numbering, RawMesh, joined

_FACES: dict[str, tuple[tuple[int, ...], ...]] = {
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "hexahedron": ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
}


def add_surfaces(deck: Deck, raw: RawMesh, numbering: Numbering) -> None:
    """Facets of every surface, and points of those of nodes."""
    for name, kind, rows, space, card in deck.surfaces:
        with of_file(card.place):
            if kind == "NODE":
                _node_surface(deck, raw, numbering, name, rows, space)
            elif kind == "ELEMENT":
                _element_surface(deck, raw, name, rows, space, card)
            elif kind in ("UNION", "INTERSECTION", "DIFFERENCE"):
                _combined(raw, deck, name, kind, [word for row in rows for word in row if word])


def _node_surface(
    deck: Deck,
    raw: RawMesh,
    numbering: Numbering,
    name: str,
    rows: list[list[str]],
    space: str,
) -> None:
    for row in rows:
        found = deck.nodes(row[0], space)
        if found is None:
            raise Damaged(f"the surface '{name}' names the node set '{row[0]}', which is not defined")
        if len(found):
            raw.add_set(name, found, numbering)


def _combined(raw: RawMesh, deck: Deck, name: str, way: str, words: list[str]) -> None:
    """A surface of others: all of their facets, those that they have in common, or those of the first alone."""
    parts = []
    for word in words:
        at, tail = deck.place(word)
        if not {at.prefix + tail, tail} & {known for known, *_ in deck.surfaces}:
            raise Damaged(f"the surface '{name}' names the surface '{word}', which is not defined")
        parts.append(raw.facets.get(at.prefix + tail) or raw.facets.get(tail) or [])
    if way == "UNION":
        raw.facets[name] = [block for part in parts for block in part]
        return
    others = {tuple(row) for part in parts[1:] for block in part for row in np.sort(block, axis=1).tolist()}
    for block in parts[0] if parts else ():
        inside = np.array([tuple(row) in others for row in np.sort(block, axis=1).tolist()], dtype=bool)
        raw.facets.setdefault(name, []).append(block[inside if way == "INTERSECTION" else ~inside])


def _element_surface(
    deck: Deck,
    raw: RawMesh,
    name: str,
    rows: list[list[str]],
    space: str,
    card: Card,
) -> None:
    """Faces S1 ... S6 of cells given by number or set; without a face the free ones."""
    for row in rows:
        everything = joined(c.ids for c in (*deck.solids, *deck.facets))
        chosen = deck.cells(row[0], space) if row[0] else everything
        face = row[1].upper() if len(row) > 1 else ""
        if chosen is None:
            raise Damaged(f"the surface '{name}' names the element set '{row[0]}', which is not defined")
        if not np.isin(chosen, everything).any():
            raw.remarks.append(f"{card.where}: no cell that is read is '{row[0]}' of the surface '{name}'")
        for cells in deck.solids:
            nodes = cells.nodes[np.isin(cells.ids, chosen)]
            sides = sides_of(cells.kind)
            if not len(nodes) or not sides:
                continue
            if re.fullmatch(r"S[1-6]", face):
                if int(face[1]) > len(sides):
                    raise Damaged(f"the surface '{name}' names the side {face} of cells {cells.written}")
                raw.facets.setdefault(name, []).append(nodes[:, list(sides[int(face[1]) - 1])])
            elif not face:
                for corners in sorted({len(side) for side in sides}):
                    every = np.concatenate([nodes[:, list(side)] for side in sides if len(side) == corners])
                    raw.facets.setdefault(name, []).append(_free(every, raw, corners))
        for cells in deck.facets:
            if (inside := np.isin(cells.ids, chosen)).any() and face in ("", "SPOS", "SNEG"):
                raw.facets.setdefault(name, []).append(cells.nodes[inside])


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
