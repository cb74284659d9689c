"""Of Nastran bulk data: faces that are glued (ties) or in contact (joints), as the case control chooses.

BSURFS names faces of solids, each by an element and three of its corners, BSURF shells that lie on them;
BGSET glues pairs of such regions, BCTSET lets them touch, BCTPARA with TIED ties them; BGADD and BCTADD
unite sets (Quick Reference Guide of NX Nastran).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..data import FaceTie, Joint
from .bdf_cards import Bulk, BulkCard, listed
from .bdf_control import Control
from .bdf_loads import Faces
from .raw import Damaged, lost

READ = {
    "BSURF",
    "BSURFS",
    "BGSET",
    "BCTSET",
    "BGADD",
    "BCTADD",
    "BCTPARA",
    "BCTPARM",
    "BCRPARA",
    "BGPARM",
}

_OTHERS = ("BEDGE", "BLSEG", "BCPROP", "BCPROPS")
"""Cards of regions that are not read."""


def faced(bulk: Bulk, control: Control) -> None:
    """Give the file's content the ties and joints of the sets that the case control chooses.

    Raises:
        Damaged: with file and line, regions that are not there, faces that no element has.
    """
    faces, made = Faces(bulk), dict[int, str]()
    tied = {card.whole(1) for card in bulk.cards["BCTPARA"] if _says(card, "TIED")}
    for name, unions, command in (("BGSET", "BGADD", "BGSET"), ("BCTSET", "BCTADD", "BCSET")):
        chosen = control.modal.number_of(command)
        left = [card for card in bulk.cards[name] if chosen is None]
        if left:
            text = f"the case control chooses none ({command} = n), so nothing of it is taken"
            bulk.raw.remarks.append(f"{left[0].where}: {text}")
            continue
        sets = {n for card in bulk.numbered([unions], chosen or 0) for n in listed(card, 2)}
        for card in (c for n in {*sets, chosen or 0} for c in bulk.numbered([name], n)):
            for source, target, value in _pairs(card):
                names = [_region(bulk, faces, made, card, number) for number in (source, target)]
                if "" in names:
                    text = (
                        f"the pair of regions {source} and {target}, which are no faces of solids,"
                    )
                    bulk.raw.lost.append(lost(card.where, text))
                elif name == "BGSET" or card.whole(1) in tied:
                    bulk.raw.links.append(FaceTie(card.where, names[0], names[1]))
                else:
                    bulk.raw.joints.append(Joint(card.where, names[0], names[1], value or None))


def _says(card: BulkCard, word: str) -> bool:
    """Whether a parameter of a card is 1 or more."""
    return any(card[p] == word and card.whole(p + 1, 0) > 0 for p in range(2, len(card)))


def _pairs(card: BulkCard) -> Iterator[tuple[int, int, float | None]]:
    """Source, target and the number behind them of each row of eight fields."""
    for place in range(2, len(card), 8):
        if card.at(place):
            yield card.whole(place), card.whole(place + 1), card.real(place + 2)


def _region(bulk: Bulk, faces: Faces, made: dict[int, str], card: BulkCard, number: int) -> str:
    """The name of a region, which becomes a set of facets and of points; empty of one that is no face of solids.

    Raises:
        Damaged: there is none, a face that no element has.
    """
    if number in made:
        return made[number]
    corners: dict[int, list[list[int]]] = {}
    own = [*bulk.numbered(["BSURF", "BSURFS"], number)]
    if any(True for _ in bulk.numbered(_OTHERS, number)):
        made[number] = ""
    elif not own:
        raise Damaged(
            f"{card.where} names the region {number}, which no BSURF or BSURFS defines; add it"
        )
    for region in own:
        if region[0] == "BSURF":
            rings = [faces.shell(region, n).tolist() for n in listed(region, 2)]
        else:
            places = [p for p in range(5, len(region), 4) if region.at(p)]
            rings = [_by_corners(bulk, faces, region, p) for p in places]
        for ring in rings:
            corners.setdefault(len(ring), []).append(ring)
    if number in made or not all(
        tuple(sorted(r)) in faces.nodes for k in corners.values() for r in k
    ):
        made[number] = ""
        return ""
    name = made[number] = f"region {number}"
    for rings in corners.values():
        bulk.raw.facets.setdefault(name, []).append(np.array(rings))
        every = [faces.nodes[tuple(sorted(ring))] for ring in rings]
        bulk.raw.add_points(name, np.unique(np.concatenate(every)))
    return name


def _by_corners(bulk: Bulk, faces: Faces, region: BulkCard, place: int) -> list[int]:
    """Corners of the face of an element by three of them."""
    number = region.whole(place)
    three = set(bulk.positions(region, [region.whole(place + k) for k in (1, 2, 3)]).tolist())
    there = faces.elements.get(number)
    if isinstance(there, tuple):
        for ring in faces.inward_of(there[0], there[1][None]):
            if three <= set(ring):
                return ring
    raise Damaged(
        f"{region.where} names no face of the solid {number} by its grid points; correct them"
    )
