"""What an Abaqus or CalculiX input file has said so far, and what its words name: numbers and sets of instances."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ..data import Array, Indices
from .cards import Card
from .raw import Damaged, is_number, joined


@dataclass
class Cells:
    """Cells of one type. `ids` (e,), `nodes` (e, k) node numbers. `written`: its type in the file, `where` it is."""

    kind: str
    ids: Indices
    nodes: Indices
    written: str = ""
    where: str = ""


@dataclass
class DeckConstants:
    """Constants as written: name, place; (t, 3) E, nu, T, or (t, 10) engineering constants or
    stiffnesses and T, or why they are not read; (t, 2) densities and T where they vary; expansion
    along the axes, its table over T and the T from which it counts.
    """

    name: str
    where: str = ""
    isotropic: Array | None = None
    orthotropic: Array | None = None
    stiffness: Array | None = None
    refused: str = ""
    density: float | None = None
    densities: Array | None = None
    expansion: Array = field(default_factory=lambda: np.zeros(3))
    expansion_table: Array | None = None
    zero: float = 0.0


@dataclass(frozen=True)
class DeckSurface:
    """A surface as its card has it. kind: of its `rows` of words: ELEMENT, NODE, or how it is made of others."""

    name: str
    kind: str
    rows: list[list[str]]
    card: Card


@dataclass(frozen=True)
class Space:
    """Where the numbers and names of an instance stand in the whole: added to numbers, put before names."""

    nodes: int = 0
    cells: int = 0
    prefix: str = ""


@dataclass
class Steps:
    """The steps of a deck as they are met.

    Attributes:
        number: of the step. card: its keyword line. nonlinear: whether displacements are finite in it. total: time at
            its end. period: its time. amplitudes: name -> time, value rows, and whether in total time.
        acting: cards of loads with step, and factor at its end. static: the last static step, as its keyword line and
            whether it was nonlinear. other: keyword of another one whose state is not read. modes: the keyword line
            whose modes are meant. held: what was held at the end of the last static step, as
            `Deck.held`.
    """

    number: int = 0
    card: Card = field(default_factory=lambda: Card(""))
    nonlinear: bool = False
    total: float = 0.0
    period: float = 1.0
    amplitudes: dict[str, tuple[Array, bool]] = field(default_factory=dict)
    acting: list[tuple[int, float, Card]] = field(default_factory=list)
    static: tuple[Card, bool] | None = None
    other: Card | None = None
    modes: Card | None = None
    held: list[tuple[str, str, str]] | None = None

    @property
    def perturbed(self) -> bool:
        """Whether the step is one of small motions about the state before it."""
        return "PERTURBATION" in self.card.parameters

    def factor(self, card: Card) -> float:
        """What an amplitude makes of a load at the end of the step.

        Raises:
            Damaged: an amplitude that is not defined.
        """
        if not (name := card.word("AMPLITUDE")) or not self.number:
            return 1.0
        if name not in self.amplitudes:
            raise Damaged(f"*{card.keyword} names the amplitude '{name}', which is not defined")
        table, in_total = self.amplitudes[name]
        return float(np.interp(self.total if in_total else self.period, *table.T))


@dataclass
class Deck:
    """What the keywords have said so far. Names of sets are free of case: their keys are in capitals.

    Attributes:
        spaces: instance in capitals -> its place; "" is the assembly's own (or the whole of a flat file).
        links: constraints, contacts and loads; sections: of solids; both resolved at the end.
        kinds: types of cells. lost: what counts and is not read, in words.
        transforms: cards of local directions of nodes; axes: node number -> (3, 3) these as rows, once all is read.
        turning: ROT NODE -> reference node whose rotations its displacements are. masses: number of
        a mass -> its node and mass.
        system: (4, 3) axes and origin in which nodes are written, or None. ignored: keywords that are not used.
        remarks: what is taken as something else, in words.
    """

    node_id: list[Indices] = field(default_factory=list)
    node_where: list[str] = field(default_factory=list)
    points: list[Array] = field(default_factory=list)
    solids: list[Cells] = field(default_factory=list)
    facets: list[Cells] = field(default_factory=list)
    lumped: list[Cells] = field(default_factory=list)
    structures: list[tuple[str, str, list[list[int]]]] = field(default_factory=list)
    retained: list[tuple[str, str]] = field(default_factory=list)
    written: dict[str, str] = field(default_factory=dict)
    node_sets: dict[str, list[Indices]] = field(default_factory=dict)
    cell_sets: dict[str, list[Indices]] = field(default_factory=dict)
    surfaces: list[DeckSurface] = field(default_factory=list)
    materials: dict[str, DeckConstants] = field(default_factory=dict)
    current: str = ""
    orientations: dict[str, Array | str] = field(default_factory=dict)
    sections: list[Card] = field(default_factory=list)
    temperatures: list[tuple[int, str, float]] = field(default_factory=list)
    held: list[tuple[str, str, str]] = field(default_factory=list)
    not_held: list[str] = field(default_factory=list)
    steps: Steps = field(default_factory=Steps)
    renewed: int = -1
    transforms: list[Card] = field(default_factory=list)
    axes: dict[int, Array] = field(default_factory=dict)
    turning: dict[int, int] = field(default_factory=dict)
    masses: dict[int, tuple[int, float]] = field(default_factory=dict)
    spaces: dict[str, Space] = field(default_factory=lambda: {"": Space()})
    links: list[Card] = field(default_factory=list)
    system: Array | None = None
    kinds: list[str] = field(default_factory=list)
    ignored: list[str] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    instances: dict[str, Indices] = field(default_factory=dict)

    def place(self, word: str, space: str = "") -> tuple[Space, str]:
        """The instance that a word is in, and the word without it: ``Blade-1.Tip``, ``17``, ``Tip``."""
        word = word.strip().strip('"')
        head, dot, tail = word.partition(".")
        if dot and head.upper() in self.spaces:
            return self.spaces[head.upper()], tail
        if space.upper() not in self.spaces:
            raise Damaged(f"names the instance '{space}', which is not defined")
        return self.spaces[space.upper()], word

    def key(self, known: dict, word: str, space: str = "") -> str | None:
        """The key of a named set, surface or orientation, or None where there is none."""
        at, tail = self.place(word, space)
        tries = [at.prefix.upper() + tail.upper(), tail.upper(), word.strip('"').upper()]
        if len(self.spaces) <= 2:  # nothing else can be meant
            tries.append(tail.rpartition(".")[2].upper())
        return next((name for name in tries if name in known), None)

    def nodes(self, word: str, space: str = "") -> Indices | None:
        """Node numbers of the whole that a word names: a number or a set; None where there is no such set."""
        return self._members(self.node_sets, word, space, cells=False)

    def cells(self, word: str, space: str = "") -> Indices | None:
        """Cell numbers of the whole that a word names."""
        return self._members(self.cell_sets, word, space, cells=True)

    def nodes_for(self, user: str, word: str, space: str = "") -> Indices:
        """Likewise, for what takes them in, as messages call it.

        Raises:
            Damaged: there is no such set.
        """
        if (numbers := self.nodes(word, space)) is None:
            raise Damaged(f"{user} names the node set '{word}', which is not defined")
        return numbers

    def cells_for(self, user: str, word: str, space: str = "") -> Indices:
        """Likewise of cells."""
        if (numbers := self.cells(word, space)) is None:
            raise Damaged(f"{user} names the element set '{word}', which is not defined")
        return numbers

    def _members(
        self, sets: dict[str, list[Indices]], word: str, space: str, cells: bool
    ) -> Indices | None:
        at, tail = self.place(word, space)
        number = tail if is_number(tail) or len(self.spaces) > 2 else tail.rpartition(".")[2]
        if is_number(number):
            return np.array([int(number) + (at.cells if cells else at.nodes)], dtype=np.int64)
        name = self.key(sets, word, space)
        return None if name is None else joined(sets[name])

    def surface(self, word: str, space: str = "") -> str | None:
        """The name of a surface in the whole, or None where there is none."""
        known = {surface.name.upper(): surface.name for surface in self.surfaces}
        return known.get(self.key(known, word, space) or "")

    def linking(self, keyword: str) -> list[Card]:
        """Those of `links` with this keyword."""
        return [card for card in self.links if card.keyword == keyword]

    def add(self, sets: dict[str, list[Indices]], name: str) -> list[Indices]:
        """The parts of a set, to add to."""
        self.written.setdefault(name.upper(), name)
        return sets.setdefault(name.upper(), [])


Readers = dict[str, Callable[[Deck, Card], None]]
"""Keyword -> what reads such a card into the deck."""
