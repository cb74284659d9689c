"""Reader of gmsh's MSH 4.1 in ASCII, the format the bodies are meshed to.

Written against the format description in gmsh's manual, section "MSH file format". Other versions and binary files
go through meshio, which neither keeps node numbers nor notices every truncation.
"""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np

from ..data import Array, Indices
from ..topology import CELL_TYPES, FACET_CORNERS
from .raw import NODES, Damaged, Numbering, RawMesh

_TYPES = {
    1: "line", 2: "triangle", 3: "quad", 4: "tetra", 5: "hexahedron", 6: "wedge", 7: "pyramid", 8: "line3",
    9: "triangle6", 10: "quad9", 11: "tetra10", 12: "hexahedron27", 13: "wedge18", 14: "pyramid14", 15: "vertex",
    16: "quad8", 17: "hexahedron20", 18: "wedge15", 19: "pyramid13",
}  # fmt: skip
_EDGES = {  # by the number of corners
    4: [(0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3)],
    5: [(0, 1), (0, 3), (0, 4), (1, 2), (1, 4), (2, 3), (2, 4), (3, 4)],
    6: [(0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5)],
    8: [(0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 7), (5, 6), (6, 7)],
}
_HEX_FACES = [(0, 1, 2, 3), (0, 1, 4, 5), (0, 3, 4, 7), (1, 2, 5, 6), (2, 3, 6, 7), (4, 5, 6, 7)]


def to_vtk(cell_type: str) -> list[int]:
    """Where VTK's nodes of a cell stand in gmsh's order; both name mid-side nodes by their corners."""
    kind = CELL_TYPES[cell_type]
    groups: list[tuple[int, ...]] = [(i,) for i in range(kind.corners)]
    if kind.order == 2:
        groups.extend(_EDGES[kind.corners])
    if cell_type == "hexahedron27":
        groups += [*_HEX_FACES, tuple(range(8))]
    corners = kind.reference[: kind.corners]
    middle = np.array([corners[list(g)].mean(axis=0) for g in groups])
    return [int(np.abs(middle - x).max(axis=1).argmin()) for x in kind.reference]


def is_msh41(path: Path) -> bool:
    """Whether a file says that it is MSH 4.1 in ASCII."""
    with open(path, "rb") as file:
        return re.match(rb"\s*\$MeshFormat\s+4\.1\s+0\s", file.read(200)) is not None


def read_msh41(path: Path) -> RawMesh:
    """Read nodes, cells and physical groups.

    Raises:
        Damaged: see the class.
    """
    sections = _sections(path.read_text(encoding="utf-8", errors="replace"))
    for name in ("Nodes", "Elements"):
        if name not in sections:
            raise Damaged(f"the section ${name} is missing")
    if "PartitionedEntities" in sections:
        raise Damaged("the mesh is partitioned, write it in one piece")
    names = _physical_names(sections.get("PhysicalNames", ""))
    groups = _entity_groups(_Numbers(sections.get("Entities", "0 0 0 0"), "$Entities"), names)
    points, node_id = _nodes(_Numbers(sections["Nodes"], "$Nodes"))
    raw = RawMesh(points, node_id)
    _elements(_Numbers(sections["Elements"], "$Elements"), raw, groups)
    return raw


def _sections(text: str) -> dict[str, str]:
    """Section name -> what stands between $NAME and $EndNAME."""
    found: dict[str, str] = {}
    place = 0
    while match := re.compile(r"^\$(\w+)[ \t\r]*$", re.MULTILINE).search(text, place):
        name = match[1]
        end = re.compile(rf"^\$End{name}[ \t\r]*$", re.MULTILINE).search(text, match.end())
        if end is None:
            raise Damaged(f"the section ${name} has no end, the file is truncated")
        if name in found and name in ("Nodes", "Elements", "Entities", "PhysicalNames"):
            raise Damaged(f"the section ${name} stands there twice")
        found[name] = text[match.end() : end.start()]
        place = end.end()
    return found


class _Numbers:
    """The numbers of a section, taken one after the other."""

    def __init__(self, text: str, section: str) -> None:
        self.section, self.at = section, 0
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                self.values: Array = np.fromstring(text, sep=" ")
            except (DeprecationWarning, ValueError):
                raise Damaged(f"{section} holds something that is no number") from None

    def take(self, count: float) -> Array:
        if not 0 <= count <= len(self.values) - self.at:
            raise Damaged(f"{self.section} holds fewer numbers than it announces")
        taken = self.values[self.at : self.at + int(count)]
        self.at += int(count)
        return taken

    def whole(self, count: float) -> Indices:
        taken = self.take(count)
        whole = np.where(np.abs(taken) < 2**53, taken, 0.5).astype(np.int64)
        if (whole != taken).any():
            raise Damaged(f"{self.section} holds a number that is not whole where one belongs")
        return whole

    def end(self) -> None:
        if self.at != len(self.values):
            raise Damaged(f"{self.section} holds more numbers than it announces")


def _physical_names(text: str) -> dict[tuple[int, int], str]:
    """(dimension, tag) -> name."""
    names: dict[tuple[int, int], str] = {}
    lines = [line for line in text.splitlines() if line.strip()]
    for line in lines[1:]:
        match = re.match(r'\s*([0-3])\s+(\d{1,9})\s+"(.*)"\s*$', line)
        if match is None:
            raise Damaged(f"$PhysicalNames holds the line {line[:60]!r}")
        names[int(match[1]), int(match[2])] = match[3]
    if lines and lines[0].strip() != str(len(names)):
        raise Damaged("$PhysicalNames holds another number of names than it announces")
    return names


def _entity_groups(numbers: _Numbers, names: dict[tuple[int, int], str]) -> dict[tuple[int, int], list[str]]:
    """(dimension, entity) -> names of its physical groups; nameless groups are called by their tag."""
    groups: dict[tuple[int, int], list[str]] = {}
    for dimension, count in enumerate(numbers.whole(4)):
        for _ in range(min(int(count), len(numbers.values))):
            (entity,) = numbers.whole(1)
            numbers.take(3 if dimension == 0 else 6)
            tags = numbers.whole(numbers.whole(1)[0])
            marks = [abs(int(t)) for t in tags]  # negative where the entity is turned
            groups[dimension, int(entity)] = [names.get((dimension, t), f"physical_{t}") for t in marks]
            if dimension:
                numbers.take(numbers.whole(1)[0])
    numbers.end()
    return groups


def _nodes(numbers: _Numbers) -> tuple[Array, Indices]:
    blocks, total, _, _ = numbers.whole(4)
    ids, points = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 3))]
    for _ in range(min(int(blocks), len(numbers.values))):
        dimension, _, parametric, count = numbers.whole(4)
        ids.append(numbers.whole(count))
        columns = 3 + (min(max(int(dimension), 0), 3) if parametric else 0)
        points.append(numbers.take(count * columns).reshape(-1, columns)[:, :3])
    numbers.end()
    if sum(map(len, ids)) != total:
        raise Damaged("$Nodes holds another number of nodes than it announces")
    return np.concatenate(points), np.concatenate(ids)


def _elements(numbers: _Numbers, raw: RawMesh, groups: dict[tuple[int, int], list[str]]) -> None:
    numbering = Numbering(raw.node_id)
    blocks, total, _, _ = numbers.whole(4)
    done = 0
    for _ in range(min(int(blocks), len(numbers.values))):
        dimension, entity, number, count = numbers.whole(4)
        if int(number) not in _TYPES:
            raise Damaged(f"$Elements holds cells of gmsh's type {number}, which are of too high an order or unknown")
        kind = _TYPES[int(number)]
        table = numbers.whole(count * (1 + NODES[kind])).reshape(-1, 1 + NODES[kind])
        nodes = numbering.positions(table[:, 1:], "$Elements names")
        done += len(table)
        if kind in FACET_CORNERS or kind in ("vertex", "line", "line3"):
            for name in groups.get((int(dimension), int(entity)), []):
                raw.add_to_set(name, kind, nodes)
        else:
            raw.blocks.append((kind, nodes[:, to_vtk(kind)] if kind in CELL_TYPES else nodes))
    numbers.end()
    if done != total:
        raise Damaged("$Elements holds another number of cells than it announces")
