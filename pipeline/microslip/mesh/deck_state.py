"""Of an Abaqus or CalculiX input file: its steps up to the first modes, and what acts on the body in them."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product

import numpy as np

from ..data import BodyLoad, FacetLoad, NodalLoad, SpinLoad, StaticStep
from ..errors import of_file
from .cards import Card
from .deck import Deck, Readers
from .deck_conditions import constraints
from .deck_mesh import sides_of
from .loading import Terms, facet_loads, nodal_loads
from .raw import Damaged, Numbering, RawMesh, lost, real
from .supports import still_supports

_MODES = ("FREQUENCY", "COMPLEX FREQUENCY")
_OTHER_STATES = {
    "DYNAMIC", "HEAT TRANSFER", "COUPLED TEMPERATURE-DISPLACEMENT", "UNCOUPLED TEMPERATURE-DISPLACEMENT", "VISCO",
    "MODAL DYNAMIC", "STEADY STATE DYNAMICS", "GREEN", "ELECTROMAGNETICS", "CFD", "BUCKLE",
}  # fmt: skip


def until_modes(cards: list[Card]) -> tuple[list[Card], list[str]]:
    """The cards up to the end of the first step of modes, and what is said of the steps behind it."""
    first = next((i for i, card in enumerate(cards) if card.keyword in _MODES), None)
    if first is None:
        return cards, []
    end = next((i for i in range(first, len(cards)) if cards[i].keyword == "END STEP"), len(cards))
    more = sum(card.keyword in _MODES for card in cards[end:])
    step = f"{cards[first].where}: *{cards[first].keyword}"
    told = f"{step} is the first of {more + 1} steps of modes; it is the one taken"
    return cards[: end + 1], [told] * bool(more)


def _read_step(deck: Deck, card: Card) -> None:
    steps = deck.steps
    if steps.static is not None and steps.static[0] is steps.card:
        steps.held = list(deck.held)
    steps.number, steps.card, steps.period = steps.number + 1, card, 1.0
    if "NLGEOM" in card.parameters:
        steps.nonlinear = card.word("NLGEOM") != "NO"


def _read_static(deck: Deck, card: Card) -> None:
    steps = deck.steps
    words = card.lines[0].split(",") if card.lines else []
    if len(words) > 1 and words[1].strip():
        steps.period = real(words[1], "*STATIC") or 1.0
    if not steps.perturbed:
        steps.total += steps.period
        steps.static, steps.other = (steps.card, steps.nonlinear), None


def _read_other(deck: Deck, card: Card) -> None:
    deck.steps.other = card
    deck.ignored.append(card.keyword)


def _read_modes(deck: Deck, card: Card) -> None:
    if deck.steps.modes is None:
        deck.steps.modes = replace_step(card, deck.steps.card)


def replace_step(card: Card, step: Card) -> Card:
    """The keyword line of modes with the parameters of its step."""
    return Card(card.keyword, dict(step.parameters), where=card.where, place=card.place)


def _read_amplitude(deck: Deck, card: Card) -> None:
    if card.word("DEFINITION", "TABULAR") != "TABULAR" or card.word("USER"):
        raise Damaged(f"*AMPLITUDE, DEFINITION={card.word('DEFINITION')} is not read; write a table of time and value")
    words = [word.strip() for line in card.lines for word in line.rstrip().rstrip(",").split(",")]
    values = [real(word or "0", "*AMPLITUDE") for word in words if word]
    if not values or len(values) % 2:
        raise Damaged("*AMPLITUDE needs pairs of time and value")
    table = np.reshape(values, (-1, 2)).astype(float)
    deck.steps.amplitudes[card.word("NAME")] = table, card.word("TIME").startswith("TOTAL")


def _read_load(deck: Deck, card: Card) -> None:
    steps = deck.steps
    if not steps.perturbed:
        steps.acting.append((steps.number, steps.factor(card), card))


READERS: Readers = {
    "STEP": _read_step, "STATIC": _read_static, "AMPLITUDE": _read_amplitude, "CLOAD": _read_load,
    "DLOAD": _read_load, "DSLOAD": _read_load,
    **dict.fromkeys(_MODES, _read_modes), **dict.fromkeys(_OTHER_STATES, _read_other),
}  # fmt: skip


# what acts --------------------------------------------------------------------------------------------------------


def stressed(deck: Deck, of_parts: bool) -> bool:
    """Whether the deck's modes are about a static state.

    With parts (Abaqus) they are after a static step with NLGEOM; else (CalculiX) in a step of PERTURBATION after any.
    """
    steps = deck.steps
    if steps.modes is None or steps.static is None:
        return False
    return steps.static[1] if of_parts else "PERTURBATION" in steps.modes.parameters


def state_of_deck(deck: Deck, raw: RawMesh, numbering: Numbering, of_parts: bool) -> None:
    """Give `raw` the static step that the deck's modes are about.

    Raises:
        Damaged: with the line, what is wrong with a load.
    """
    steps = deck.steps
    if steps.modes is not None and steps.other is not None and "PERTURBATION" in steps.modes.parameters:
        raw.lost.append(
            f"{steps.modes.where}: its modes are about the state that *{steps.other.keyword} leaves, which is not "
            "computed here: frequencies will differ"
        )
    if not stressed(deck, of_parts):
        if steps.static is not None and steps.modes is not None and steps.static[1]:
            raw.lost.append(
                f"{steps.modes.where}: *{steps.modes.keyword} stands in no step of PERTURBATION: CalculiX takes the "
                "body without its loads there, and so it is here; Abaqus would take it under them"
            )
        return
    assert steps.static is not None
    loads = _Acting(deck, raw, numbering)
    for number, factor, card in steps.acting:
        with of_file(card.place):
            loads.add(number, factor, card)
    step, nonlinear = steps.static
    held = None
    if steps.held is not None and steps.held != deck.held:
        held = still_supports(raw, constraints(deck, steps.held), numbering)
        _tell_local(deck, raw)
    raw.state = StaticStep(f"{step.where}: *STEP", nonlinear, tuple(loads.all()), held)


def _tell_local(deck: Deck, raw: RawMesh) -> None:
    """Supports along local directions are equations, which the static step shares with its modes."""
    assert deck.steps.held is not None
    for word, directions, place in {*deck.steps.held} ^ {*deck.held}:
        nodes = deck.nodes_for("*BOUNDARY", word)
        if set(directions) & set("xyz") not in (
            set(),
            set("xyz"),
        ) and not deck.axes.keys().isdisjoint(nodes.tolist()):
            where = place.rpartition("/")[2]
            text = (
                "holds local directions in the static step and not in its modes, or in these alone"
            )
            raw.lost.append(
                f"{where}: *BOUNDARY {text}: it is taken as those of the modes, so frequencies will differ"
            )


_Loading = NodalLoad | FacetLoad | BodyLoad | SpinLoad
_NOT_READ = {"USER", "LOAD CASE", "SUBMODEL", "SECTOR", "OMEGA0", "ORIENTATION", "FILE"}


@dataclass
class _Acting:
    """Loads in force. nodal, facets, fields: where they act -> step, value and place; a later step takes the place of
    an earlier one, in the same step they add up."""

    deck: Deck
    raw: RawMesh
    numbering: Numbering
    nodal: dict[tuple[str, int, int], tuple[int, float, str]] = field(default_factory=dict)
    facets: dict[tuple[int, ...], tuple[int, float, str]] = field(default_factory=dict)
    fields: dict[tuple[str, ...], tuple[int, list[_Loading]]] = field(default_factory=dict)

    def add(self, number: int, factor: float, card: Card) -> None:
        """Add the loads of a card.

        Raises:
            Damaged: what is wrong with them.
        """
        if card.word("OP") == "NEW":
            self._forget(number, card.keyword)
        other = _NOT_READ & set(card.parameters)
        if other and not (other == {"LOAD CASE"} and card.word("LOAD CASE") == "1"):
            self.raw.lost.append(lost(card.where, f"*{card.keyword} with {', '.join(sorted(other))}"))
            return
        for line in card.lines:
            words = [word.strip() for word in line.split(",")]
            if card.keyword in ("CLOAD", "BOUNDARY"):
                self._nodal(number, factor, card, [*words, "", ""])
            else:
                self._distributed(number, factor, card, words)

    def _forget(self, number: int, keyword: str) -> None:
        if keyword == "DLOAD":
            self.facets = {k: v for k, v in self.facets.items() if v[0] == number}
        kept = {"CLOAD": "force", "BOUNDARY": "displacement"}.get(keyword, "")
        self.nodal = {k: v for k, v in self.nodal.items() if k[0] != kept or v[0] == number}
        if keyword in ("DLOAD", "DSLOAD"):
            other = keyword == "DLOAD"
            items = self.fields.items()
            self.fields = {k: v for k, v in items if v[0] == number or k[0].startswith("surface ") == other}

    def _nodal(self, number: int, factor: float, card: Card, words: list[str]) -> None:
        kind = "force" if card.keyword == "CLOAD" else "displacement"
        first, value = words[1], words[2] if kind == "force" else words[3]
        last = (words[2] if kind == "displacement" else "") or first
        if kind == "displacement" and not value:
            value = "0"
        if not {first, last} <= set("123456"):
            raise Damaged(f"*{card.keyword} names the direction '{words[1][:20]}', which is none of 1 to 6")
        nodes = self.deck.nodes_for(f"*{card.keyword}", words[0], card.space)
        amount = factor * real(value or "0", f"*{card.keyword}")
        for node, way in product(nodes.tolist(), range(int(first) - 1, int(last))):
            turns = self.deck.turning.get(node) if way < 3 else None  # moments and rotations
            key = (kind, node, way) if turns is None else (kind, turns, way + 3)
            self._put(self.nodal, key, number, amount, card.where, kind == "force")

    def _put(self, into: dict, key: tuple, number: int, amount: float, where: str, adds: bool = True) -> None:
        before = into.get(key)
        if adds and before is not None and before[0] == number:
            amount += before[1]
        into[key] = number, amount, where

    def _distributed(self, number: int, factor: float, card: Card, words: list[str]) -> None:
        word, label, *more = [*words, ""]
        label = label.upper()
        if card.keyword == "DSLOAD":
            self._on_surface(number, factor, card, word, label, [w for w in more if w])
            return
        while more and not more[-1]:
            more.pop()
        numbers = [real(w or "0", f"*{card.keyword}") for w in more]
        chosen = self.deck.cells_for(f"*{card.keyword}", word, card.space) if word else None
        where = f"{card.where}: *{card.keyword}, {label}"
        if label in ("P1", "P2", "P3", "P4", "P5", "P6") and chosen is not None:
            for corners in self._sides(chosen, int(label[1]), where):
                self._put(self.facets, corners, number, factor * (numbers or [0.0])[0], where)
            return
        load: BodyLoad | SpinLoad
        if label == "GRAV" and len(numbers) in (3, 4):
            way = np.array([*numbers[1:], 0.0][:3])
            if not way.any():
                raise Damaged(f"*{card.keyword} with GRAV has a direction of no length")
            load = BodyLoad(where, factor * numbers[0] * way / np.linalg.norm(way), chosen)
            self._pull(number, load, (word, label, "masses"))
        elif label == "CENTRIF" and len(numbers) == 7:
            if factor * numbers[0] < 0 or not any(numbers[4:]):
                raise Damaged(f"*{card.keyword} with CENTRIF needs the square of a speed, a point and an axis")
            load = SpinLoad(where, (factor * numbers[0]) ** 0.5, np.array(numbers[4:]), np.array(numbers[1:4]), chosen)
        else:
            text = f"*{card.keyword} '{', '.join(words)[:50]}'"
            self.raw.lost.append(f"{card.where}: {text} is not read, so frequencies will differ from those under it")
            return
        self._field((word, label), number, load)

    def _pull(self, number: int, load: BodyLoad, key: tuple[str, ...]) -> None:
        """The weight of the point masses that the load names."""
        if load.cells is None:
            return  # that of everything has theirs
        heavy = [m for n, m in self.deck.masses.items() if n in load.cells]
        if heavy:
            nodes = np.repeat([node for node, _ in heavy], 3)
            values = np.outer([mass for _, mass in heavy], load.acceleration)
            ways = np.tile(np.arange(3), len(heavy))
            self._field(key, number, NodalLoad(load.where, "force", nodes, ways, values.ravel()))

    def _field(self, key: tuple[str, ...], number: int, load: _Loading) -> None:
        before = self.fields.get(key)
        self.fields[key] = number, [*(before[1] if before and before[0] == number else []), load]

    def _sides(self, chosen: np.ndarray, side: int, where: str) -> list[tuple[int, ...]]:
        """Corners, by positions, of a side of these cells."""
        corners: list[tuple[int, ...]] = []
        for cells in self.deck.solids:
            own = cells.nodes[np.isin(cells.ids, chosen)]
            sides = sides_of(cells.kind)
            if len(own) and side > len(sides):
                raise Damaged(f"{where} names a side that cells {cells.written} do not have")
            if len(own):
                corners += map(tuple, own[:, list(sides[side - 1])].tolist())
        return corners

    def _on_surface(
        self, number: int, factor: float, card: Card, word: str, label: str, more: list[str]
    ) -> None:  # fmt: skip
        name = self.deck.surface(word, card.space)
        if name is None:
            raise Damaged(f"*DSLOAD names the surface '{word}', which is not defined")
        numbers = [real(w, "*DSLOAD") for w in more]
        where = f"{card.where}: *DSLOAD, {label}"
        if label == "P" and numbers:
            direction = None
        elif label == "TRVEC" and len(numbers) == 4 and any(numbers[1:]):
            direction = np.array(numbers[1:]) / np.linalg.norm(numbers[1:])
        else:
            self.raw.lost.append(f"{where} is not read, so frequencies will differ from those under it")
            return
        if name not in self.raw.facets:
            raise Damaged(f"*DSLOAD names the surface '{word}', which has no facets of cells that are read")
        for facets in self.raw.facets[name]:
            load = FacetLoad(where, facets, np.full(len(facets), factor * numbers[0]), direction)
            self._field((f"surface {name}", label), number, load)

    def all(self) -> list[_Loading]:
        """What is in force, by the places where it was written."""
        words = {"force": "CLOAD", "displacement": "BOUNDARY"}
        terms: Terms = {
            key: (amount, f"{where}: *{words[key[0]]}") for key, (_, amount, where) in self.nodal.items()
        }
        facets = {corners: (amount, where) for corners, (_, amount, where) in self.facets.items() if amount}
        loads: list[_Loading] = [
            *nodal_loads(self.raw, terms, self.deck.axes, self.numbering),
            *facet_loads(facets, inside=True),
        ]  # fmt: skip
        return [*loads, *(load for _, chosen in self.fields.values() for load in chosen)]
