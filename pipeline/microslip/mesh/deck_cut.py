"""Bolts of a deck that a *PRE-TENSION SECTION cuts through: two sides, shifted into each other.

The nodes of the section are doubled: those w of the cells beyond it move as those o of the cells
that name it do, but for the displacement q of the control node along the normal n, u_w = u_o - q n.
A force on the control node is the bolt's, positive in tension. In the modes q stands still, as in
CalculiX.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from ..data import Array, Equation, FacetLoad, Indices, StaticStep
from ..errors import of_file
from ..topology import CELL_TYPES, FACET_CORNERS
from .cards import Card, numbers
from .deck import Deck
from .deck_joints import BOLT
from .deck_mesh import sides_of
from .raw import Damaged, Numbering, RawMesh, joined, lost

Facets = set[tuple[int, ...]]


def cut_bolts(deck: Deck, raw: RawMesh, numbering: Numbering) -> None:
    """Cut `raw` at every *PRE-TENSION SECTION of a deck whose modes are about a static step.

    Raises:
        Damaged: with the line, a section that does not part its bolt.
    """
    for card in deck.linking(BOLT) if raw.state is not None else ():
        with of_file(card.place):
            if "ELEMENT" in card.parameters:
                raw.lost.append(lost(card.where, f"*{BOLT} of beams"))
                continue
            name = deck.surface(card.text("SURFACE"), card.space)
            if name is None or name not in raw.facets:
                raise Damaged(f"*{BOLT} needs a SURFACE of sides of solid cells")
            node = numbering.positions(
                deck.nodes_for(f"*{BOLT}", card.text("NODE"), card.space), f"*{BOLT} names"
            )
            if len(node) != 1:
                raise Damaged(f"*{BOLT} needs one node for its force, as NODE")
            _cut(raw, card, name, int(node[0]))


def _cut(raw: RawMesh, card: Card, name: str, control: int) -> None:
    """Double the nodes of a section, and let its control node shift them."""
    section = _keys(raw.facets[name])
    near, beyond = _sides(raw, raw.facets[name])
    normal, olds = _normal(raw, card, raw.facets[name]), _on(raw, section, near)
    news = len(raw.points) + np.arange(len(olds))
    number = np.arange(len(raw.points))
    number[olds] = news
    outside = _keys(_facets_of(raw, beyond)) - section
    for block, cell in beyond:
        nodes = raw.blocks[block][1]
        nodes[cell] = number[nodes[cell]]
    raw.facets = {
        key: [_moved(f, number, outside) for f in parts] for key, parts in raw.facets.items()
    }
    state = raw.state
    assert state is not None
    loads = [
        replace(load, facets=_moved(load.facets, number, outside))
        if isinstance(load, FacetLoad)
        else load
        for load in state.loads
    ]
    raw.points = np.vstack([raw.points, raw.points[olds]])
    raw.node_id = np.concatenate([raw.node_id, raw.node_id.max() + 1 + np.arange(len(olds))])
    if raw.temperature is not None:
        raw.temperature = np.vstack([raw.temperature, raw.temperature[olds]])
    where = f"{card.where}: *{BOLT}"
    for new, old in zip(news.tolist(), olds.tolist(), strict=True):
        for way in range(3):
            at, ways = np.array([new, old, control]), np.array([way, way, 0])
            raw.links.append(Equation(where, at, ways, np.array([1.0, -1.0, normal[way]])))
    raw.state = _locked(raw, replace(state, loads=tuple(loads)), control)


def _locked(raw: RawMesh, state: StaticStep, control: int) -> StaticStep:
    """The step as it was held; in the modes the control node stands still."""
    rest = dict(raw.supports) if state.supports is None else dict(state.supports)
    title = f"bolt {raw.node_id[control]}"
    raw.add_points(title, np.array([control]))
    raw.supports[title] = "x"
    return replace(state, supports=rest)


def _keys(facets: Iterable[Indices]) -> Facets:
    """Corners in ascending order."""
    return {tuple(row) for part in facets for row in np.sort(part, axis=1).tolist()}


def _moved(facets: Indices, number: Indices, outside: Facets) -> Indices:
    """Those facets that cells beyond the section have, with its new nodes."""
    chosen = [tuple(row) in outside for row in np.sort(facets, axis=1).tolist()]
    return np.where(np.array(chosen, dtype=bool)[:, None], number[facets], facets)


Cell = tuple[int, int]


def _facets_of(raw: RawMesh, cells: Iterable[Cell]) -> list[Indices]:
    """Corners of the sides of cells, by block and number in it."""
    return [
        raw.blocks[block][1][[cell]][:, list(side)]
        for block, cell in cells
        for side in sides_of(raw.blocks[block][0])
    ]


def _on(raw: RawMesh, section: Facets, cells: Iterable[Cell]) -> Indices:
    """Positions of the nodes of facets of these cells in a section, between corners too."""
    found = []
    for block, cell in cells:
        kind, nodes = raw.blocks[block][0], raw.blocks[block][1][cell]
        for whole, name in zip(CELL_TYPES[kind].facets, CELL_TYPES[kind].facet_types, strict=True):
            if tuple(sorted(nodes[list(whole[: FACET_CORNERS[name]])].tolist())) in section:
                found.append(nodes[list(whole)])
    return np.unique(joined(found))


def _sides(raw: RawMesh, facets: list[Indices]) -> tuple[list[Cell], list[Cell]]:
    """Cells at the section's nodes on the side whose cells name it, into which its facets look, and beyond.

    Raises:
        Damaged: the section does not part them.
    """
    section = _keys(facets)
    on = np.zeros(len(raw.points), dtype=bool)
    on[np.unique(joined(part.ravel() for part in facets))] = True
    cells = [
        (b, int(i))
        for b, (_, nodes) in enumerate(raw.blocks)
        for i in np.flatnonzero(on[nodes].any(axis=1))
    ]
    owners: dict[tuple[int, ...], list[int]] = {}
    for i, cell in enumerate(cells):
        for key in _keys(_facets_of(raw, [cell])):
            owners.setdefault(key, []).append(i)
    pairs = [o for key, o in owners.items() if len(o) == 2 and key not in section]
    rows, cols = np.array(pairs, dtype=int).reshape(-1, 2).T
    graph = sp.coo_matrix((np.ones(len(rows)), (rows, cols)), shape=(len(cells), len(cells)))
    part = connected_components(graph, directed=False)[1]
    middle = [raw.points[raw.blocks[block][1][cell]].mean(axis=0) for block, cell in cells]
    near, beyond = set[int](), set[int]()
    for row in (row for block in facets for row in block):
        ends = owners.get(tuple(sorted(row.tolist())), [])
        if len(ends) != 2:
            raise Damaged(f"*{BOLT} names the side of a cell beyond which there is none")
        x = raw.points[row]
        inwards = np.cross(x[1] - x[0], x[2] - x[0]) @ (middle[ends[0]] - x[0]) > 0
        near.add(int(part[ends[0 if inwards else 1]]))
        beyond.add(int(part[ends[1 if inwards else 0]]))
    if near & beyond:
        raise Damaged(
            f"*{BOLT} does not part the bolt: its SURFACE must go all the way through it, seen from one side"
        )
    whole = list(zip(cells, part.tolist(), strict=True))
    return [cell for cell, p in whole if p not in beyond], [
        cell for cell, p in whole if p in beyond
    ]


def _normal(raw: RawMesh, card: Card, facets: list[Indices]) -> Array:
    """(3,) unit normal, of the data line or the mean of the section, out of the near side.

    Raises:
        Damaged: one of no length.
    """
    rows = numbers(card.lines, f"*{BOLT}")
    if rows and any(rows[0][:3]):
        normal = np.array([*rows[0], 0.0, 0.0][:3])
    else:
        corners = np.concatenate([raw.points[f[:, :3]] for f in facets])
        normal = -np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
    if not np.linalg.norm(normal) > 0:
        raise Damaged(f"*{BOLT} has a normal of no length")
    return normal / np.linalg.norm(normal)
