"""What a mesh file holds, before units, unused points and the surface have been dealt with."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..data import (
    Array,
    Indices,
    Joint,
    Link,
    LumpedElement,
    PointMass,
    Sector,
    StaticStep,
)
from ..errors import UserError
from ..topology import FACET_CORNERS

NODES = {
    "vertex": 1, "line": 2, "line3": 3, "triangle": 3, "triangle6": 6, "quad": 4, "quad8": 8, "quad9": 9, "tetra": 4,
    "tetra10": 10, "hexahedron": 8, "hexahedron20": 20, "hexahedron27": 27, "wedge": 6, "wedge15": 15, "wedge18": 18,
    "pyramid": 5, "pyramid13": 13, "pyramid14": 14,
}  # fmt: skip
"""Cell or facet type -> number of its nodes."""


class Damaged(UserError):
    """A mesh file that contradicts itself or ends too early. file: with its line, if one does."""


class Unread(Damaged):
    """A material that is not read or not whole. Another one in its place would be wrong."""


@dataclass(frozen=True)
class DeckMaterial:
    """A material as a file writes it, in the file's units.

    Attributes:
        name: as in the file. elasticity: (6, 6) Hooke matrix in the order `VOIGT`, in body axes; None: missing.
        density: None: missing. expansion: (6,) thermal strain per degree. temperature: (t, 2) temperature and factor on
            the elasticity, or None. where: the set of cells that it was given to. refused: what of it is not read, in
            words, and what to do. line: its place in the file, ``part.inp, line 12``, if known. young, poisson, shear:
            what is there of them where they do not suffice for an elasticity. stiffness_table,
            expansion_table, zero: as of a `Material`, in the file's units.
    """

    name: str
    elasticity: Array | None
    density: float | None
    expansion: Array
    temperature: Array | None = None
    where: str = ""
    refused: str = ""
    line: str = ""
    young: float | None = None
    poisson: float | None = None
    shear: float | None = None
    stiffness_table: tuple[Array, Array] | None = None
    expansion_table: Array | None = None
    zero: float = 0.0


@dataclass(frozen=True)
class Structure:
    """Elements of one type that are left out because they are no solids: beams, shells, trusses.

    Attributes:
        where: the first of them. kind: as the file calls it. elements: positions of the nodes of each.
    """

    where: str
    kind: str
    elements: list[list[int]]


@dataclass
class RawMesh:
    """A file's content.

    Attributes:
        points: (n, 3) in the file's unit. node_id: (n,) the file's own numbers.
        blocks: (type, (e, k) positions in `points` in VTK's node order), volumes only.
        facets: set name -> corner positions of its facets, (f, 3) or (f, 4) arrays.
        point_sets: set name -> positions.
        regions: of each block, (e,) number of each cell's material, or nothing where the file brings none.
        materials: those of the file, in its own units. temperature: (n, 2) stress-free and actual ones in the file's
            unit, NaN where none is given, or None.
        cell_id: of each block, (e,) the file's own numbers of the cells, or nothing.
        supports: point set -> directions out of x, y, z held at zero. not_held: constraints not read, in words.
        links: constraints between nodes, by positions in `points`, tolerances in the file's unit.
        unended: what the file lacks at its end, in words: it may be cut there. Nothing if it tells that it is whole.
        lost: what carries mass, stiffness or a constraint and is not read, in words.
        remarks: what was read as something else or not used, in words. instances: name -> positions. joints: pairs of
            faces in contact. sector: of a cyclic ring. preloads: of bolts: where it stands, force
            in the file's unit. lumps: masses, springs and dashpots, by positions in `points`. structures:
            elements that are left out. retained: point sets whose displacements the file keeps.
        state: the static step that the file's modes are about: a reader fills it with loads by positions in `points`,
            corners of facets and numbers of cells, in the file's units. integration: as `mesh.integration` of a body
            file.
    """

    points: Array
    node_id: Indices
    blocks: list[tuple[str, Indices]] = field(default_factory=list)
    facets: dict[str, list[Indices]] = field(default_factory=dict)
    point_sets: dict[str, Indices] = field(default_factory=dict)
    regions: list[Indices] = field(default_factory=list)
    materials: list[DeckMaterial] = field(default_factory=list)
    temperature: Array | None = None
    cell_id: list[Indices] = field(default_factory=list)
    supports: dict[str, str] = field(default_factory=dict)
    not_held: list[str] = field(default_factory=list)
    links: list[Link] = field(default_factory=list)
    unended: str = ""
    lost: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    instances: dict[str, Indices] = field(default_factory=dict)
    joints: list[Joint] = field(default_factory=list)
    sector: Sector | None = None
    preloads: list[tuple[str, float]] = field(default_factory=list)
    lumps: list[PointMass | LumpedElement] = field(default_factory=list)
    structures: list[Structure] = field(default_factory=list)
    retained: list[str] = field(default_factory=list)
    state: StaticStep | None = None
    integration: str = "full"

    def add_points(self, name: str, positions: Indices) -> None:
        """Add to a point set."""
        before = self.point_sets.get(name, np.zeros(0, dtype=np.int64))
        self.point_sets[name] = np.union1d(before, positions).astype(np.int64)

    def add_to_set(self, name: str, kind: str, nodes: Indices) -> None:
        """Add to a named set: facets of a type, by their corners, or the points of lines."""
        if kind in FACET_CORNERS:
            self.facets.setdefault(name, []).append(nodes[:, : FACET_CORNERS[kind]])
        else:
            self.add_points(name, np.unique(nodes))

    def add_set(self, name: str, numbers: Iterable[int] | Indices, numbering: Numbering) -> None:
        """Add to a point set the nodes of these numbers that are there; a remark names those that
        are not."""
        ids = np.unique(np.fromiter(numbers, dtype=np.int64))
        there = np.isin(ids, numbering.sorted)
        if not there.all():
            self.remarks.append(undefined(name, "node", ids[~there]))
        if there.any():
            self.add_points(name, numbering.positions(ids[there], ""))

    def add_solids(
        self, solids: Mapping[str, list[tuple[int, int, list[int]]]], numbering: Numbering, what: str
    ) -> None:
        """Add cells: type -> number, region and node numbers of each.

        Raises:
            Damaged: a node that is not there, a cell that is there twice.
        """
        for kind, found in solids.items():
            ids, regions, nodes = (np.array(part, dtype=np.int64) for part in zip(*found, strict=True))
            self.blocks.append((kind, numbering.positions(nodes, what, ids)))
            self.cell_id.append(ids)
            self.regions.append(regions)
        refuse_twice(self.cell_id)


@contextmanager
def in_its_line(path: Path) -> Iterator[None]:
    """A mistake in here stands in a file, in the line with which its sentence begins if it does."""
    try:
        yield
    except UserError as error:
        if error.file:
            raise
        raise refused(path, str(error)) from error.__cause__


def in_file(path: Path, text: str) -> str:
    """A sentence about a file, with its name once: ``deck/a.inp, line 3: ...`` of ``a.inp, line 3: ...``."""
    return f"{path}{text.removeprefix(path.name)}" if text.startswith(f"{path.name}, ") else f"{path}: {text}"


def refused(path: Path, text: str) -> UserError:
    """The mistake of a file, or of a line of it, that a sentence tells; see `in_file`."""
    place, _, told = text.partition(": ") if text.startswith(f"{path.name}, ") else (path.name, "", text)
    return UserError(told, file=f"{path}{place.removeprefix(path.name)}")


def undefined(name: str, what: str, numbers: Indices) -> str:
    """What is said of a set that names nodes or elements (`what`) which the file does not define."""
    first, count = numbers[0], len(numbers)
    which = f"{what} {first}" if count == 1 else f"{count} {what}s ({first}, ...)"
    return f"the set '{name}' names {which} that the file does not define: left out of it"


def lost(where: str, what: str) -> str:
    """What is said of something that is not read although it counts; `where`: file and line."""
    return f"{where}: {what} is not read: the mass, stiffness or constraint is missing, so frequencies will differ"


PRESTRESSED = (
    "the frequencies of the deck are those under the load of its static step; that load is not "
    "taken, and stress can "
    "change a frequency by a factor"
)
"""What is said of a deck whose modes are those of a loaded body."""


def ignored(words: Iterable[str], loads: str, stressed: bool = False) -> list[str]:
    """What is said of keywords that are not used.

    Args:
        loads: a pattern of those that load the body. stressed: the deck's modes are those under them.
    """
    every = list(dict.fromkeys(words))
    pressing = [word for word in every if re.fullmatch(loads, word)]
    others = [word for word in every if word not in pressing]
    idle = "loads, which change no frequency of an unstressed body"
    said = [(pressing, "loads, under which the deck's frequencies are" if stressed else idle)]
    said += [(others, "what they do to the frequencies is not known here")]
    return [f"read and not used: {', '.join(named)}: {effect}" for named, effect in said if named]


def locks(raw: RawMesh) -> list[str]:
    """What is said of first-order bricks."""
    bricks = [nodes for kind, nodes in raw.blocks if kind == "hexahedron"]
    if not bricks:
        return []
    return [
        f"first-order bricks lock: where one layer of them bends, stiffness is {locking(raw, bricks):.2g} times "
        "too large, with m layers the excess falls as 1/m2; export second-order cells (C3D20, SOLID186)"
    ]


def locking(raw: RawMesh, bricks: list[Indices]) -> float:
    """How many times too stiff one layer of fully integrated bricks is in bending, of the median brick.

    (1 / (1 - nu) + a^2 / 2) / (1 + nu), a the length over the height (R. D. Cook and others, Concepts and Applications
    of Finite Element Analysis, parasitic shear), here with nu = 0 and its longest over its shortest side.
    """
    x = raw.points[np.concatenate(bricks)]
    sides = np.stack([np.linalg.norm(x[:, j] - x[:, 0], axis=1) for j in (1, 3, 4)])
    with np.errstate(all="ignore"):  # flat cells are told elsewhere
        return float(1 + 0.5 * np.median(sides.max(axis=0) / sides.min(axis=0)) ** 2)


_MIRRORED = {
    "tetra": (0, 2, 1, 3),
    "tetra10": (0, 2, 1, 3, 6, 5, 4, 7, 9, 8),
    "wedge": (3, 4, 5, 0, 1, 2),
    "wedge15": (3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8, 12, 13, 14),
    "hexahedron": (4, 5, 6, 7, 0, 1, 2, 3),
    "hexahedron20": (4, 5, 6, 7, 0, 1, 2, 3, 12, 13, 14, 15, 8, 9, 10, 11, 16, 17, 18, 19),
    "pyramid": (0, 3, 2, 1, 4),
    "pyramid13": (0, 3, 2, 1, 4, 8, 7, 6, 5, 9, 12, 11, 10),
}
"""Nodes of a left-handed cell in a right-handed order."""
_AROUND = {
    "hexa": ((1, 3, 4), (2, 0, 5), (3, 1, 6), (0, 2, 7), (7, 5, 0), (4, 6, 1), (5, 7, 2), (6, 4, 3)),
    "pyra": ((1, 3, 4), (2, 0, 4), (3, 1, 4), (0, 2, 4)),
}
"""Ends of the three edges from each corner, in a right-handed order."""


def turn_left_handed(raw: RawMesh, bricks: bool = False) -> None:
    """Count the nodes of left-handed tetrahedra and wedges the other way, as the solvers that allow
    them do. bricks: those of bricks and pyramids as well, where all of their corners are left-handed."""
    for number, (kind, cells) in enumerate(raw.blocks):
        if kind not in _MIRRORED or not len(cells) or (kind[:4] in _AROUND and not bricks):
            continue
        left = np.ones(len(cells), dtype=bool)
        for corner, ends in enumerate(_AROUND.get(kind[:4], ((1, 2, 3),))):
            edges = raw.points[cells[:, ends]] - raw.points[cells[:, corner]][:, None]
            left &= np.linalg.det(edges) < 0
        if left.any():
            cells = cells.copy()
            cells[left] = cells[left][:, _MIRRORED[kind]]
            raw.blocks[number] = kind, cells
            raw.remarks.append(f"{left.sum()} left-handed cells {kind} are counted the other way round")


def joined(parts: Iterable[Indices]) -> Indices:
    """Whole numbers one behind the other; none where there are no parts."""
    return np.concatenate([np.zeros(0, dtype=np.int64), *parts])


def refuse_twice(numbers: Iterable[Indices]) -> None:
    """Raises `Damaged` if a number of elements stands there twice."""
    ids, count = np.unique(joined(numbers), return_counts=True)
    if (count > 1).any():
        raise Damaged(f"element {ids[count > 1][0]} is defined twice")


def is_number(word: str) -> bool:
    """Whether a word is a node's or a cell's number, which fits into 64 bits."""
    return word.isdecimal() and len(word) < 18


def real(text: str, what: str) -> float:
    """A number of a deck, with Fortran's exponent D as well."""
    try:
        return float(text.replace("D", "e").replace("d", "e"))
    except ValueError:
        raise Damaged(f"{what} holds '{text.strip()[:40]}' where a number belongs") from None


class Numbering:
    """Positions of a file's node numbers.

    Raises:
        Damaged: a number is used twice.
    """

    def __init__(self, node_id: Indices) -> None:
        self.order = np.argsort(node_id, kind="stable")
        self.sorted = node_id[self.order]
        twice = np.flatnonzero(np.diff(self.sorted) == 0)
        if len(twice):
            raise Damaged(f"node {self.sorted[twice[0]]} is defined twice")

    def between(self, first: int, last: int) -> Indices:
        """The numbers from first to last that nodes have, ascending."""
        return self.sorted[np.searchsorted(self.sorted, first) : np.searchsorted(self.sorted, last, "right")]

    def positions(self, numbers: Indices | Sequence[Any], what: str, of: Indices | None = None) -> Indices:
        """Positions of node numbers, any shape. of: (e,) the elements that name them, row by row.

        Raises:
            Damaged: a number that no node has.
        """
        try:
            ids = np.asarray(numbers, dtype=np.int64)
        except OverflowError:
            raise Damaged(f"{what} a node whose number is beyond all bounds") from None
        if not len(self.sorted):
            raise Damaged(f"{what} but there are no nodes before it")
        at = np.minimum(np.searchsorted(self.sorted, ids), len(self.sorted) - 1)
        missing = self.sorted[at] != ids
        if missing.any():
            if of is not None:
                what = f"element {of[np.nonzero(missing)[0][0]]} names"
            raise Damaged(f"{what} node {ids[missing].flat[0]}, which the file does not define")
        return self.order[at]
