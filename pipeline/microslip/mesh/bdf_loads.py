"""Of Nastran bulk data: what acts on the body in a static subcase, and the temperatures of a subcase.

Forces and moments along coordinate systems or between grid points, pressures on faces of solids and of the
shells that lie on them, gravity, rotation, displacements of SPC and SPCD; LOAD adds up sets with factors
(Quick Reference Guide, the cards of those names).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..data import Array, BodyLoad, FacetLoad, Indices, NodalLoad, SpinLoad, StaticStep
from ..topology import CELL_TYPES, FACET_CORNERS
from .bdf_cards import Bulk, BulkCard, at_card, listed
from .bdf_control import Case
from .bdf_lumps import MASSES
from .raw import Damaged

SHELLS = {"CTRIA3": 3, "CTRIAR": 3, "CTRIA6": 3, "CQUAD4": 4, "CQUADR": 4, "CQUAD8": 4}
"""Card of a shell -> number of its corners."""
_ALIKE = 1e-9


def state_of_bulk(
    bulk: Bulk, case: Case, nonlinear: bool, enforced: dict[int, dict[int, float]]
) -> None:
    """Give the file's content the static step of a subcase; what of it is not read is told.

    Args:
        enforced: number of a node -> direction (0 to 5) -> displacement of SPC.

    Raises:
        Damaged: with file and line, what is wrong with a load.
    """
    acting = _Acting(
        bulk, Faces(bulk), case.place, {node: dict(ways) for node, ways in enforced.items()}
    )
    number = case.number_of("LOAD")
    if number is not None:
        sets = list(_sets(bulk, number))
        chosen = [(factor, card) for factor, s in sets for card in acting.cards(s)]
        if not chosen:
            place = case.place_of("LOAD")
            raise Damaged(
                f"{place}: LOAD = {number} chooses loads that the file does not hold; correct it"
            )
        for factor, card in chosen:
            acting.add(factor, card)
    if any(isinstance(load, BodyLoad | SpinLoad) for load in acting.loads):
        for card in (card for name in MASSES for card in bulk.cards[name]):
            acting.lose(card, "the weight of a mass along one direction")
    what = f"SUBCASE {case.number}" if case.number > 0 else "the case control"
    bulk.raw.state = StaticStep(f"{case.place}: {what}", nonlinear, tuple(acting.all()))


def _sets(bulk: Bulk, number: int) -> Iterator[tuple[float, int]]:
    """Factors and numbers of the sets of loads that a number stands for."""
    yield 1.0, number
    for card in bulk.numbered(["LOAD"], number):
        whole = card.real(2)
        for place in range(3, len(card), 2):
            if card.at(place + 1):
                factor = card.real(place)
                yield (
                    (1.0 if whole is None else whole) * (1.0 if factor is None else factor),
                    card.whole(place + 1),
                )


class Faces:
    """Faces of the solids and of the shells that lie on them, by positions of their corners."""

    def __init__(self, bulk: Bulk) -> None:
        self.bulk = bulk

    @cached_property
    def elements(self) -> dict[int, BulkCard | tuple[str, Indices]]:
        """Number of an element -> its type and nodes, or the card of a shell."""
        raw = self.bulk.raw
        found: dict[int, BulkCard | tuple[str, Indices]] = {
            card.whole(1): card for name in SHELLS for card in self.bulk.cards[name]
        }
        for (kind, nodes), ids in zip(raw.blocks, raw.cell_id, strict=True):
            found.update(
                (int(number), (kind, cell)) for number, cell in zip(ids, nodes, strict=True)
            )
        return found

    @cached_property
    def inward(self) -> dict[tuple[int, ...], list[int]]:
        """Corners of each facet of the solids, ascending -> in the order whose normal points into the solid."""
        rings = (
            ring for kind, nodes in self.bulk.raw.blocks for ring in self.inward_of(kind, nodes)
        )
        return {tuple(sorted(ring)): ring for ring in rings}

    def inward_of(self, kind: str, nodes: Indices) -> Iterator[list[int]]:
        """Corners of the facets of cells (e, k), in the order whose normal points into them."""
        for facet, sort in zip(CELL_TYPES[kind].facets, CELL_TYPES[kind].facet_types, strict=True):
            yield from nodes[:, list(facet[: FACET_CORNERS[sort]][::-1])].tolist()

    @cached_property
    def nodes(self) -> dict[tuple[int, ...], list[int]]:
        """Corners of each facet of the solids, ascending -> all of its nodes."""
        return {
            tuple(sorted(row[: FACET_CORNERS[sort]])): row
            for kind, nodes in self.bulk.raw.blocks
            for facet, sort in zip(
                CELL_TYPES[kind].facets, CELL_TYPES[kind].facet_types, strict=True
            )
            for row in nodes[:, list(facet)].tolist()
        }

    def shell(self, card: BulkCard, number: int) -> Indices:
        """Corners of a shell.

        Raises:
            Damaged: there is none of this number.
        """
        there = self.elements.get(number)
        if not isinstance(there, BulkCard):
            what = (
                "which the file does not define"
                if there is None
                else "a solid, whose face G1 and G3 or G4 tell"
            )
            raise Damaged(f"{card.where} loads element {number}, {what}; correct it")
        return self.bulk.positions(card, [there.whole(3 + k) for k in range(SHELLS[there[0]])])

    def side(self, card: BulkCard, number: int) -> Indices:
        """Corners of the face of a solid that G1 and G3 (across it) or G4 (of a tetrahedron, off it) tell, from G1 on
        about its inner normal.

        Raises:
            Damaged: they tell none.
        """
        kind, nodes = self.elements[number]  # type: ignore[misc]
        first, other = (
            int(self.bulk.positions(card, [card.whole(p)])[0]) if card.at(p) else -1 for p in (7, 8)
        )
        tetrahedron = CELL_TYPES[str(kind)].corners == 4
        for corners in self.inward_of(str(kind), np.asarray(nodes)[None]):
            if first not in corners:
                continue
            at = corners.index(first)
            around = [*corners[at:], *corners[:at]]
            across = len(around) == 4 and around[2] == other
            if tetrahedron:  # G4 is the corner that is off the face
                alone = other >= 0 and other not in around
            else:
                alone = len(around) == 3 and other in (-1, *around[1:])
            if across or alone:
                return np.array(around)
        raise Damaged(
            f"{card.where} names no face of element {number} by G1 = {card.at(7) or 'nothing'} and G3 or G4 = "
            f"{card.at(8) or 'nothing'}; correct them"
        )


@dataclass
class _Acting:
    """Loads as they are met. displaced: node -> direction -> displacement. nodal, facets: by card or kind."""

    bulk: Bulk
    faces: Faces
    where: str
    displaced: dict[int, dict[int, float]]
    loads: list[NodalLoad | FacetLoad | BodyLoad | SpinLoad] = field(default_factory=list)
    facets: dict[tuple, tuple[str, list[Indices], list[Array]]] = field(default_factory=dict)

    def cards(self, number: int) -> Iterator[BulkCard]:
        """Those of a set of loads."""
        for name in [*LOADS, *OTHERS]:
            yield from self.bulk.numbered([name], number)

    def add(self, factor: float, card: BulkCard) -> None:
        """Add a load.

        Raises:
            Damaged: what is wrong with it.
        """
        if card[0] in LOADS:
            LOADS[card[0]](self, card, factor)
        else:
            self.lose(card, "it")

    def lose(self, card: BulkCard, what: str) -> None:
        """Tell that a load is not taken."""
        self.bulk.raw.lost.append(
            f"{card.where}: {what} is not read, so frequencies will differ from those under it"
        )

    def vector(self, card: BulkCard, system: int, place: int, point: Array) -> Array:
        """(3,) in the basic system, of three fields in a system, at a point."""
        given = card.reals(place, 3)
        return given if not system else given @ self.bulk.frame(card, system, point)

    def along(self, card: BulkCard, place: int, pairs: int) -> Array:
        """(3,) unit vector from a grid point to a second one, or normal to two such lines."""
        x = self.bulk.raw.points[
            self.bulk.positions(card, [card.whole(place + k) for k in range(2 * pairs)])
        ]
        v = x[1] - x[0] if pairs == 1 else np.cross(x[1] - x[0], x[3] - x[2])
        if not np.linalg.norm(v) > 0:
            raise Damaged(f"{card.where} has a direction by grid points of no length; correct it")
        return v / np.linalg.norm(v)

    def straight(self, card: BulkCard, system: int) -> Array:
        """(3, 3) axes of a rectangular system."""
        with at_card(card):
            found = self.bulk.systems[system]
        if found.kind:
            raise Damaged(
                f"{card.where} has a direction in system {system}, which is cylindrical or spherical; "
                "write a rectangular one"
            )
        return found.axes

    # each card ----------------------------------------------------------------------------------

    def force(self, card: BulkCard, factor: float) -> None:
        """FORCE, MOMENT: size and vector in a system; FORCE1, MOMENT1, FORCE2, MOMENT2: by grid points."""
        node = int(self.bulk.positions(card, [card.whole(2)])[0])
        turning = card[0].startswith("MOMENT")
        if card[0][-1] in "12":
            size = card.real(3) or 0.0
            vector = size * self.along(card, 4, int(card[0][-1]))
            if size:
                self.bulk.raw.lost.append(
                    f"{card.where}: it follows its grid points in Nastran and keeps its direction here, so frequencies "
                    "may differ"
                )
        else:
            vector = (card.real(4) or 0.0) * self.vector(
                card, card.whole(3, 0), 5, self.bulk.raw.points[node]
            )
        vector = factor * vector
        at = np.flatnonzero(vector)
        if len(at):
            self.loads.append(
                NodalLoad(card.where, "force", np.full(len(at), node), at + 3 * turning, vector[at])
            )

    def gravity(self, card: BulkCard, factor: float) -> None:
        """GRAV: an acceleration along a vector."""
        vector = card.reals(4, 3)
        if not vector.any():
            raise Damaged(f"{card.where} has a direction of no length; correct it")
        a = factor * (card.real(3) or 0.0) * vector @ self.straight(card, card.whole(2, 0))
        self.loads.append(BodyLoad(card.where, a))

    def spin(self, card: BulkCard, factor: float) -> None:
        """RFORCE: revolutions per time about a vector through a grid point."""
        turns, vector = card.real(4) or 0.0, card.reals(5, 3)
        if card.real(9):
            self.lose(card, "its angular acceleration (RACC)")
        if card.at(11):
            self.lose(card, "its choice of elements (IDRF)")
            return
        if factor < 0:
            raise Damaged(
                f"{card.where} is taken times {factor:g}, which no rotation can be; correct the LOAD"
            )
        if not vector.any():
            raise Damaged(f"{card.where} has an axis of no length; correct it")
        axis = vector @ self.straight(card, card.whole(3, 0))
        speed = 2 * np.pi * abs(turns) * float(np.linalg.norm(vector)) * factor**0.5
        grid = card.whole(2, 0)
        point = self.bulk.raw.points[self.bulk.positions(card, [grid])[0]] if grid else np.zeros(3)
        if speed:
            self.loads.append(SpinLoad(card.where, speed, axis, point))

    def displace(self, card: BulkCard, factor: float) -> None:
        """SPCD: displacements of components that SPC holds."""
        for place in (2, 5):
            if node := card.whole(place, 0):
                self.bulk.positions(card, [node])
                for way in card.directions(place + 1):
                    if way not in self.bulk.held.nodes.get(node, ()):
                        raise Damaged(
                            f"{card.where} displaces node {node} in {way}, which no SPC of the "
                            "subcase holds; hold it"
                        )
                    size = factor * (card.real(place + 2) or 0.0)
                    self.displaced.setdefault(node, {})["xyzabc".index(way)] = size

    def on_corners(self, card: BulkCard, factor: float) -> None:
        """PLOAD: a pressure on three or four grid points, along the normal by their order."""
        numbers = [card.whole(place) for place in range(3, 7) if card.at(place)]
        if any(CELL_TYPES[kind].order > 1 for kind, _ in self.bulk.raw.blocks):
            self.bulk.raw.lost.append(
                f"{card.where}: is taken over the whole of its face, where Nastran loads the corners "
                "alone of cells with mid-side nodes: frequencies may differ a little; write PLOAD4"
            )
        self.on_face(card, factor * (card.real(2) or 0.0), self.bulk.positions(card, numbers))

    def on_shells(self, card: BulkCard, factor: float) -> None:
        """PLOAD2: a pressure on elements, along their normals."""
        for number in listed(card, 3):
            self.on_face(card, factor * (card.real(2) or 0.0), self.faces.shell(card, number))

    def on_face(
        self, card: BulkCard, size: float | Array, corners: Indices, along: Array | None = None
    ) -> None:
        """Add a pressure along the normal of a facet by its order, where it lies on a solid; or a traction."""
        inward = self.faces.inward.get(tuple(sorted(corners.tolist())))
        if inward is None:
            self.lose(card, "a load on grid points that are no face of a solid")
            return
        values = np.broadcast_to(size, len(corners)).astype(float)
        order = inward.index(int(corners[0]))
        against = along is None and inward[(order + 1) % len(inward)] != corners[1]
        self._press(card, corners, -values if against else values, along)

    def _press(self, card: BulkCard, corners: Indices, values: Array, along: Array | None) -> None:
        if values.any():
            key = card[0], len(corners), None if along is None else tuple(along.tolist())
            _, facets, sizes = self.facets.setdefault(key, (card.where, [], []))
            facets.append(corners)
            sizes.append(values)

    def pressure(self, card: BulkCard, factor: float) -> None:
        """PLOAD4: pressures at the corners of a face, along its inner normal or a vector."""
        first = card.real(3) or 0.0
        given = [card.real(place) for place in (3, 4, 5, 6)]
        values = factor * np.array([first if p is None else p for p in given])
        if card.at(13) not in ("", "SURF") or card.at(14) not in ("", "NORM"):
            self.lose(card, f"a load along lines ({card.at(13)} {card.at(14)})")
            return
        number, through = card.whole(2), card.at(7) == "THRU"
        last = card.whole(8) if through else number
        if last - number > 10**7:
            raise Damaged(f"{card.where} goes over {last - number} elements; correct it")
        for element in range(number, last + 1):
            if through and element not in self.faces.elements:
                continue
            solid = element in self.faces.elements and not isinstance(
                self.faces.elements[element], BulkCard
            )
            if solid and through:
                raise Damaged(
                    f"{card.where} goes over solid elements, whose faces G1 and G3 or G4 tell; write "
                    "a card for each"
                )
            corners = self.faces.side(card, element) if solid else self.faces.shell(card, element)
            vector = card.reals(10, 3)
            along = None
            if vector.any():
                middle = self.bulk.raw.points[corners].mean(axis=0)
                along = self.vector(card, card.whole(9, 0), 10, middle)
                along = along / np.linalg.norm(along)
            if solid:
                self._press(card, corners, values[: len(corners)], along)
            else:
                self.on_face(card, values[: len(corners)], corners, along)

    # all ----------------------------------------------------------------------------------------

    def all(self) -> list[NodalLoad | FacetLoad | BodyLoad | SpinLoad]:
        """What acts."""
        pressed = [
            FacetLoad(
                where,
                np.array(facets),
                np.array(values),
                None if key[2] is None else np.array(key[2]),
            )
            for key, (where, facets, values) in self.facets.items()
        ]
        nodes, ways, sizes = list[int](), list[int](), list[float]()
        for node, moved in self.displaced.items():
            for way, size in self._in_body(node, moved):
                nodes.append(node)
                ways.append(way)
                sizes.append(size)
        if nodes:
            where = f"{self.where}: displacements of SPC and SPCD"
            at = self.bulk.numbering.positions(nodes, f"{where} names")
            pressed.append(NodalLoad(where, "displacement", at, np.array(ways), np.array(sizes)))  # type: ignore[arg-type]
        return [*self.loads, *pressed]

    def _in_body(self, node: int, moved: dict[int, float]) -> Iterator[tuple[int, float]]:
        """Directions of the body and displacements, of those along the directions of a node (CD)."""
        axes = self.bulk.held.axes.get(node)
        if axes is None or not any(moved.values()):
            yield from ((way, size) for way, size in moved.items() if size)
            return
        for first, letters in ((0, "xyz"), (3, "abc")):
            sizes = {way - first: size for way, size in moved.items() if first <= way < first + 3}
            if not any(sizes.values()):
                continue
            held = {letters.index(c) for c in self.bulk.held.nodes.get(node, ()) if c in letters}
            along = all(np.abs(axes[way]).max() > 1 - _ALIKE for way in sizes)
            if len(held) < 3 and not along:
                self.bulk.raw.lost.append(
                    f"{self.bulk.file}: node {node} is displaced along a skewed direction of its system "
                    "(CD) while others are free, which is not read, so frequencies will differ; "
                    "turn the system along the axes"
                )
                continue
            total = sum((size * axes[way] for way, size in sizes.items()), np.zeros(3))
            yield from (
                (first + int(way), float(total[way])) for way in np.flatnonzero(np.abs(total) > 0)
            )


LOADS: dict[str, Callable[[_Acting, BulkCard, float], None]] = {
    **dict.fromkeys(("FORCE", "MOMENT", "FORCE1", "MOMENT1", "FORCE2", "MOMENT2"), _Acting.force),
    "GRAV": _Acting.gravity,
    "RFORCE": _Acting.spin,
    "SPCD": _Acting.displace,
    "PLOAD": _Acting.on_corners,
    "PLOAD2": _Acting.on_shells,
    "PLOAD4": _Acting.pressure,
}
OTHERS = (
    "PLOAD1",
    "PLOADX1",
    "SLOAD",
    "ACCEL",
    "ACCEL1",
    "DEFORM",
    "RFORCE1",
    "PLOADE1",
    "FORCEAX",
    "BOLTLD",
)
"""Loads that are not read, which are told where a state needs them."""


def temperatures(bulk: Bulk, number: int, place: str) -> Array:
    """(n,) temperatures of a set: of TEMP, elsewhere of TEMPD; NaN where it has none.

    Raises:
        Damaged: the file does not hold the set.
    """
    found, there = np.full(len(bulk.raw.points), np.nan), False
    for card in bulk.cards["TEMPD"]:
        for at in range(1, len(card), 2):
            if card.at(at) and card.whole(at) == number:
                found[:], there = card.real(at + 1) or 0.0, True
    for card in bulk.numbered(["TEMP"], number):
        pairs = [(card.whole(at), card.real(at + 1) or 0.0) for at in (2, 4, 6) if card.at(at)]
        found[bulk.positions(card, [node for node, _ in pairs])] = [value for _, value in pairs]
        there = True
    if not there:
        raise Damaged(
            f"{place}: TEMPERATURE = {number} chooses temperatures that the file does not hold; "
            "correct it"
        )
    return found
