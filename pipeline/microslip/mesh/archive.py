"""What the commands of an Ansys archive have said so far."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from .raw import Damaged, is_number, real
from .supports import Constraints
from .systems import BASIC, System


class Element(NamedTuple):
    """An element of any kind. `kind`, `real`: numbers of its type and its set of real constants.

    `system`: number of its coordinate system. `where`: line, of those outside EBLOCK,,SOLID.
    """

    number: int
    material: int
    kind: int
    real: int
    system: int
    nodes: list[int]
    where: str = ""


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
class Archive:
    """What the commands have said.

    Attributes:
        reals: values of each set of real constants; open_reals: the last set of R.
        path: name of the file. changes: of EMODIF, by element. table: of TB that is read: material,
            label. refused: material -> what of its elasticity is not read.
        kinds: number of a type -> Ansys's element. options: number of a type -> number of a KEYOPT
            -> its value.
        places: of equations, by name. rigid: master, slaves, directions, place. spread: RBE3, likewise with weights.
        current: of elements that follow: TYPE, REAL, MAT, ESYS, and CSYS. selected: numbers of the nodes that are
            chosen, None: all. chosen: the component that they are. unread: a selection that is not read.
        parameters: numbers of *SET, by their names in capitals. unused: loads that are not taken.
        ranged: numbers that ranges of D go over. systems: coordinate systems. turns: nodes -> coordinate system
        (NROTAT), or angles (NBLOCK, NMODIF). rings: CYCLIC. diameters: of CYCOPT.
    """

    path: str = ""
    node_id: list[int] = field(default_factory=list)
    points: list[list[float]] = field(default_factory=list)
    kinds: dict[int, int] = field(default_factory=dict)
    options: dict[int, dict[int, str]] = field(default_factory=dict)
    elements: list[Element] = field(default_factory=list)
    changes: dict[int, dict[str, int]] = field(default_factory=dict)
    reals: dict[int, list[float]] = field(default_factory=dict)
    open_reals: int = 1
    components: dict[str, list[int]] = field(default_factory=dict)
    temperatures: dict[int, float] = field(default_factory=dict)
    constants: dict[int, dict[str, dict[int, float]]] = field(default_factory=dict)
    tables: dict[int, dict[str, dict[int, float]]] = field(default_factory=dict)
    table: tuple[int, str] | None = None
    refused: dict[int, str] = field(default_factory=dict)
    reference: float | None = None
    uniform: float | None = None
    nodal: dict[int, float] = field(default_factory=dict)
    held: Constraints = field(default_factory=Constraints)
    equations: dict[str, list[tuple[int, str, float]]] = field(default_factory=dict)
    rigid: list[tuple[int, list[int], str, str]] = field(default_factory=list)
    spread: list[tuple[int, list[int], list[float], str, str]] = field(default_factory=list)
    open: str = ""
    where: str = ""
    places: dict[str, str] = field(default_factory=dict)
    current: dict[str, int] = field(default_factory=lambda: {"TYPE": 1, "MAT": 1, "REAL": 1})
    selected: set[int] | None = None
    chosen: str = ""
    unread: str = ""
    parameters: dict[str, str] = field(default_factory=dict)
    stressed: bool = False
    ranged: set[int] = field(default_factory=set)
    systems: dict[int, System] = field(default_factory=lambda: dict(BASIC))
    turns: dict[int, System] = field(default_factory=dict)
    rings: list[CyclicCommands] = field(default_factory=list)
    diameters: tuple[int, int, int] | None = None
    unused: list[str] = field(default_factory=list)
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
