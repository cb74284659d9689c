"""What the commands of an Ansys archive have said so far."""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from .raw import Damaged, is_number, lost, real
from .supports import Constraints
from .systems import BASIC, System


class Element(NamedTuple):
    """An element of any kind. `kind`, `real`: numbers of its type and its set of real constants.

    `system`: number of its coordinate system. `where`: line, of those outside EBLOCK,,SOLID. `line`: its number.
    """

    number: int
    material: int
    kind: int
    real: int
    system: int
    nodes: list[int]
    where: str = ""
    line: int = 0


def changed(element: Element, changes: Mapping[str, int]) -> Element:
    """An element with other numbers of its material, type, real constants or system (EMODIF)."""
    return Element(**{**element._asdict(), **changes}) if changes else element


class CyclicCommands(NamedTuple):
    """CYCLIC: number of sectors (0: by the angle between its edges), number of the coordinate system, name."""

    where: str
    sectors: int
    system: int
    name: str


@dataclass
class Acting:
    """What acts on the body at a time, each value as it is written: a number, or a table's name in %.

    Attributes:
        forces, moved: number of a node, direction -> value, place. faces: number of an element and of its
            face -> values at the corners, place. fields: ACEL, OMEGA and the like -> words, place.
        nodal: temperature of each node. cells: of elements, by place among their nodes; 0: everywhere.
        uniform: temperature of all others.
    """

    forces: dict[tuple[int, str], tuple[str, str]] = field(default_factory=dict)
    moved: dict[tuple[int, str], tuple[str, str]] = field(default_factory=dict)
    faces: dict[tuple[int, int], tuple[list[str], str]] = field(default_factory=dict)
    fields: dict[str, tuple[list[str], str]] = field(default_factory=dict)
    nodal: dict[int, str] = field(default_factory=dict)
    cells: dict[int, dict[int, str]] = field(default_factory=dict)
    uniform: str = ""

    def now(self) -> Acting:
        """What acts now, whatever is changed later."""
        return copy.deepcopy(self)


class Solution(NamedTuple):
    """What a SOLVE solves. kind: STATIC, TRANS and so on. time: at its end. held: its supports."""

    where: str
    kind: str
    nonlinear: bool
    time: float
    acting: Acting
    held: Constraints


@dataclass
class Table:
    """An array of *DIM. variable: that of its rows, TIME or empty. rows: place -> of the axis; values."""

    kind: str
    variable: str
    several: bool
    axis: dict[int, str] = field(default_factory=dict)
    values: dict[int, str] = field(default_factory=dict)


@dataclass
class Archive:
    """What the commands have said.

    Attributes:
        path: name of the file. folder: of it. lines, at: its lines and the number of the next one. where: of the one
            that is read. idle: whether results are looked at (/POST1), which changes nothing.
        reals: values of each set of real constants; open_reals: the last set of R.
        matrices: of TB,ANEL, whether they are compliances, and their constants.
        changes: of EMODIF, by element. table: of TB that is read: material, label. refused: material -> what of its
            elasticity is not read.
        kinds: number of a type -> Ansys's element. options: number of a type -> number of a KEYOPT
            -> its value.
        components: of nodes. groups: of elements.
        places: of equations, by name. primes: first nodes of CP, by number and label.
        rigid: master, slaves, directions, place. spread: RBE3, likewise with weights.
        current: of elements that follow: TYPE, REAL, MAT, ESYS, and CSYS. selected: numbers of the nodes that are
            chosen, None: all. chosen: the component that they are. unread: a selection that is not read. picked,
            unread_cells: those of elements.
        parameters: numbers of *SET, by their names in capitals. arrays: of *DIM. branches: of *IF that are open:
            whether one is read, whether one was.
        ranged: numbers that ranges of D go over. systems: coordinate systems. turns: nodes -> coordinate system
        (NROTAT), or angles (NBLOCK, NMODIF). rings: CYCLIC. diameters: of CYCOPT. masters: nodes of M.
        acting: what acts now. solved: what was solved. analysis: of the next SOLVE. prestressed: PSTRES.
            perturbed: the number of the solution that modes are about (ANTYPE with PERTURB), 0: the last. modes: where
            they are asked for.
    """

    path: str = ""
    folder: Path = Path()
    lines: list[str] = field(default_factory=list)
    at: int = 0
    node_id: list[int] = field(default_factory=list)
    points: list[list[float]] = field(default_factory=list)
    kinds: dict[int, int] = field(default_factory=dict)
    options: dict[int, dict[int, str]] = field(default_factory=dict)
    elements: list[Element] = field(default_factory=list)
    changes: dict[int, dict[str, int]] = field(default_factory=dict)
    reals: dict[int, list[float]] = field(default_factory=dict)
    open_reals: int = 1
    components: dict[str, list[int]] = field(default_factory=dict)
    groups: dict[str, list[int]] = field(default_factory=dict)
    temperatures: dict[int, float] = field(default_factory=dict)
    constants: dict[int, dict[str, dict[int, float]]] = field(default_factory=dict)
    tables: dict[int, dict[str, dict[int, float]]] = field(default_factory=dict)
    polynomials: dict[tuple[int, str], list[float]] = field(default_factory=dict)
    table: tuple[int, str] | None = None
    matrices: dict[int, tuple[bool, dict[int, float]]] = field(default_factory=dict)
    refused: dict[int, str] = field(default_factory=dict)
    reference: float | None = None
    held: Constraints = field(default_factory=Constraints)
    equations: dict[str, list[tuple[int, str, float]]] = field(default_factory=dict)
    primes: dict[tuple[str, str], str] = field(default_factory=dict)
    rigid: list[tuple[int, list[int], str, str]] = field(default_factory=list)
    spread: list[tuple[int, list[int], list[float], str, str]] = field(default_factory=list)
    open: str = ""
    where: str = ""
    idle: bool = False
    places: dict[str, str] = field(default_factory=dict)
    current: dict[str, int] = field(default_factory=lambda: {"TYPE": 1, "MAT": 1, "REAL": 1})
    selected: set[int] | None = None
    chosen: str = ""
    unread: str = ""
    picked: set[int] | None = None
    unread_cells: str = ""
    parameters: dict[str, str] = field(default_factory=dict)
    arrays: dict[str, Table] = field(default_factory=dict)
    branches: list[tuple[bool, bool]] = field(default_factory=list)
    ranged: set[int] = field(default_factory=set)
    systems: dict[int, System] = field(default_factory=lambda: dict(BASIC))
    turns: dict[int, System] = field(default_factory=dict)
    rings: list[CyclicCommands] = field(default_factory=list)
    diameters: tuple[int, int, int] | None = None
    masters: list[int] = field(default_factory=list)
    acting: Acting = field(default_factory=Acting)
    solved: list[Solution] = field(default_factory=list)
    analysis: str = "STATIC"
    nonlinear: bool = False
    time: float | None = None
    prestressed: bool = False
    perturbed: int | None = None
    modes: str = ""
    unused: dict[str, None] = field(default_factory=dict)
    unknown: dict[str, None] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)

    def component(self, name: str) -> list[int] | None:
        """Numbers of nodes of a component, however it is written; None where there is none."""
        named = {known.upper(): known for known in self.components}
        return self.components[named[name.upper()]] if name.upper() in named else None

    def nodes(self, word: str) -> list[int] | None:
        """Nodes by number, by component, or those that are selected; None where the word says none of these."""
        if is_number(word):
            return [int(word)]
        if word.upper() == "ALL":
            if self.unread:
                return None
            return self.node_id if self.selected is None else sorted(self.selected)
        return self.component(word)

    def through(self, first: str, last: str, step: str, what: str) -> Sequence[int]:
        """Nodes from first to last: of a range beyond what the file can hold those that are there."""
        span = range(int(first), whole(last, what) + 1, max(whole(step or "1", what), 1))
        if len(span) <= 10**6:
            return span
        return [int(first), *(n for n in self.node_id if n in span and n != int(first))]

    def cells(self, word: str) -> Iterable[int] | None:
        """Numbers of elements by number, by component, or those that are selected; None of none of these."""
        if is_number(word):
            return [int(word)]
        if word.upper() == "ALL":
            if self.unread_cells:
                return None
            return [e.number for e in self.elements] if self.picked is None else sorted(self.picked)
        named = {group.upper(): group for group in self.groups}
        return self.groups[named[word.upper()]] if word.upper() in named else None

    def place(self, where: str | int) -> str:
        """The file with its folder and a line, by number or as it is in `where`; without one where it is none."""
        line = f"{self.path}, line {where}" if isinstance(where, int) else where
        return str(self.folder / (line if where else self.path))

    def leave_out(self, what: str) -> None:
        """Note that what counts is not read, in words."""
        self.lost.append(lost(self.where, what))


Command = Callable[[Archive, list[str]], None]
"""What reads a command: its words, and lines of the archive behind it."""


def whole(text: str, what: str) -> int:
    """A whole number of a command or block.

    Raises:
        Damaged: it is none, or beyond all bounds.
    """
    try:
        value = int(text)
    except ValueError:
        if not re.fullmatch(r"[-+]?\d{1,12}\.0*", text.strip()):
            wrong = f"{what} holds '{text.strip()[:30]}' where a whole number belongs"
            raise Damaged(wrong) from None
        value = int(real(text, what))
    if abs(value) > 10**12:
        raise Damaged(f"{what} holds the number {value}")
    return value
