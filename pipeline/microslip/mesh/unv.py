"""Reader of meshes in I-deas Universal Files: nodes, solid elements, groups.

Written against the description of the data sets 15, 781 and 2411 (nodes), 780 and 2412 (elements), 2420 (coordinate
systems) and 2417 to 2477 (permanent groups) in the Universal File reference of the University of Cincinnati. Parabolic
elements name corners and mid-side nodes in turn, layer after layer.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..data import Indices
from ..topology import CELL_TYPES, FACET_CORNERS
from .raw import Damaged, Numbering, RawMesh, Structure, lost

UNIVERSAL = (".unv", ".uff", ".uf", ".u")
"""Suffixes of Universal Files."""
_SOLIDS: dict[int, tuple[str, tuple[int, ...]]] = {
    111: ("tetra", (0, 1, 2, 3)),
    118: ("tetra10", (0, 2, 4, 9, 1, 3, 5, 6, 7, 8)),
    112: ("wedge", (0, 1, 2, 3, 4, 5)),
    113: ("wedge15", (0, 2, 4, 9, 11, 13, 1, 3, 5, 10, 12, 14, 6, 7, 8)),
    115: ("hexahedron", tuple(range(8))),
    116: ("hexahedron20", (0, 2, 4, 6, 12, 14, 16, 18, 1, 3, 5, 7, 13, 15, 17, 19, 8, 9, 10, 11)),
}
"""Descriptor of a solid -> cell type, and places in its list of VTK's nodes."""
_SHELLS: dict[int, tuple[str, tuple[int, ...]]] = {
    **dict.fromkeys((41, 51, 61, 74, 81, 91), ("triangle", (0, 1, 2))),
    **dict.fromkeys((42, 52, 62, 72, 82, 92), ("triangle6", (0, 2, 4, 1, 3, 5))),
    **dict.fromkeys((44, 54, 64, 71, 84, 94), ("quad", (0, 1, 2, 3))),
    **dict.fromkeys((45, 55, 65, 75, 85, 95), ("quad8", (0, 2, 4, 6, 1, 3, 5, 7))),
}
_BEAMS = {11, 21, 22, 23, 24}
"""Beams and rods, which mesh programs write for lines too; the data sets give them a line more."""
_OTHERS = {
    **dict.fromkeys((121, 122), "rigid element"),
    **dict.fromkeys((136, 137, 138, 139), "spring"),
    **dict.fromkeys((141, 142), "damper"),
    **dict.fromkeys((151, 152), "gap"),
    161: "lumped mass",
}
_NODES = (15, 781, 2411)
_CELLS = {780: 8, 2412: 6}
"""Data set of elements -> numbers of its first record, the last of which counts the nodes."""
_GROUPS = {2417: 2, 2429: 2, 2430: 2, 2432: 2, 2435: 4, 2452: 4, 2467: 4, 2477: 4}
"""Data set of groups -> numbers of each member."""
_NODE, _ELEMENT = 7, 8
_KNOWN = {0, 151, 164, 2420, *_NODES, *_CELLS, *_GROUPS}
_RESULTS = {
    **dict.fromkeys((55, 2414), "results at nodes"),
    **dict.fromkeys((56, 57), "results in cells"),
    **dict.fromkeys((1703, 1710, 1716), "materials"),
    58: "functions",
    82: "trace lines",
    790: "restraints and loads",
    791: "restraints",
    792: "loads",
}


@dataclass
class DataSet:
    """What stands between two lines of -1.

    Attributes:
        number: of the data set, 0 if its first line is none. lines: behind it. first: number of the first of these in
            the file. at: how many are taken.
    """

    number: int
    lines: list[str]
    first: int
    at: int = 0

    def whole(self, count: int = 1, what: str = "") -> list[int]:
        """So many whole numbers or more, from as many lines as they need.

        Raises:
            Damaged: other words, or `what` is not whole.
        """
        numbers: list[int] = []
        while len(numbers) < count:
            line = self.text(what)
            try:
                numbers += [int(word) for word in line.split()]
            except ValueError:
                raise Damaged(f"'{line.strip()[:60]}' is not of whole numbers") from None
        if any(abs(v) > 10**12 for v in numbers):
            raise Damaged("holds a number beyond all bounds")
        return numbers

    def reals(self, count: int, what: str) -> list[float]:
        """Just so many numbers, from as many lines as they need.

        Raises:
            Damaged: other words, or `what` is not whole.
        """
        numbers: list[float] = []
        while len(numbers) < count:
            line = self.text(what)
            try:
                numbers += [float(word) for word in line.upper().replace("D", "E").split()]
            except ValueError:
                raise Damaged(f"'{line.strip()[:60]}' is not of numbers") from None
        if len(numbers) > count:
            raise Damaged(f"'{line.strip()[:60]}' holds more than the {count} numbers of {what}")
        return numbers

    def text(self, what: str) -> str:
        """The next line."""
        if not self.left:
            raise Damaged(f"{what} is not whole: the data set {self.number} ends before")
        self.at += 1
        return self.lines[self.at - 1]

    @property
    def left(self) -> bool:
        """Whether lines are left."""
        return self.at < len(self.lines)

    @property
    def line(self) -> int:
        """Number in the file of the line that was taken last."""
        return self.first + max(self.at, 1) - 1


@contextmanager
def placed(path: Path, data: DataSet) -> Iterator[None]:
    """A mistake in here stands at the line of the data set that was taken last."""
    try:
        yield
    except Damaged as error:
        error.file = error.file or f"{path}, line {data.line}"
        raise


def read_unv(path: Path) -> RawMesh:
    """Read nodes, cells and groups.

    Raises:
        Damaged: content that is inconsistent, or whose meaning would be lost.
    """
    text = path.read_bytes().decode("latin-1")
    sets = list(data_sets(text))
    raw = _nodes(path, sets)
    numbering = Numbering(raw.node_id)
    flat = _elements(path, sets, raw, numbering)
    for data in (d for d in sets if d.number in _GROUPS):
        with placed(path, data):
            _groups(data, raw, numbering, flat)
    others = dict.fromkeys(d.number for d in sets if d.number not in _KNOWN)
    named = [f"{kind} ({what})" if (what := _RESULTS.get(kind)) else str(kind) for kind in others]
    if named:
        raw.remarks.append(
            f"data sets that are no part of the body: {', '.join(named)}; it is of nodes, cells and groups"
        )
    if not re.search(r"^ *-1[ \t\r]*\n*\Z", text, re.MULTILINE):
        raw.unended = "no data set that ends with its last line"
    return raw


def has_solids(path: Path) -> bool:
    """Whether a file has solid cells, damaged ones too."""
    try:
        sets = data_sets(path.read_bytes().decode("latin-1"))
        cells = (cell for data in sets if data.number in _CELLS for cell in _records(data))
        return any(descriptor in _SOLIDS for _, _, descriptor, _ in cells)
    except Damaged:
        return True


def length_unit(text: str, units: Mapping[str, float]) -> str:
    """The name of the unit of length by data set 164, whose factor turns metres into it; empty
    without one."""
    said = re.search(r"^ *-1\s*\n *164\s*\n.*\n\s*(\S+)", text, re.MULTILINE)
    with suppress(ValueError, ZeroDivisionError):
        metres = 1 / float(said[1].upper().replace("D", "E")) if said else 0.0
        return (
            next((name for name, size in units.items() if abs(size / metres - 1) < 1e-3), "")
            if said
            else ""
        )
    return ""


def data_sets(text: str) -> Iterator[DataSet]:
    """Everything between two lines of -1.

    Raises:
        Damaged: the last one has no end.
    """
    text = text.removeprefix("\xef\xbb\xbf")
    if "\n" not in text:
        text = text.replace("\r", "\n")
    text = re.sub(r"[^\t\r\n\x20-\x7e\xa0-\xff]", " ", text)
    at, line = 0, 1
    while begin := _MARK.search(text, at):
        line += text.count("\n", at, begin.end())
        head = text[begin.end() + 1 : begin.end() + 82].partition("\n")[0].split()
        end = _MARK.search(text, begin.end() + _binary(head))
        if end is None:
            if text[begin.end() :].strip():
                raise Damaged(f"line {line}: the data set has no end, the file is truncated")
            return
        number = int(head[0]) if head and head[0].isdecimal() and len(head[0]) < 9 else 0
        yield DataSet(number, text[begin.end() : end.start()].split("\n")[2:-1], line + 2)
        line, at = line + text.count("\n", begin.end(), end.end()), end.end()


_MARK = re.compile(r"^ *-1[ \t\r]*$", re.MULTILINE)


def _binary(head: list[str]) -> int:
    """Bytes of a binary data set (58b), in which a line of -1 may stand."""
    told = head[5] if len(head) > 5 and head[0].endswith("b") else ""
    return int(told) if told.isdecimal() and len(told) < 18 else 0


def _nodes(path: Path, sets: list[DataSet]) -> RawMesh:
    ids, points, lines = list[int](), list[list[float]](), dict[int, int]()
    local = {label for data in sets if data.number == 2420 for label in _local(path, data)}
    for data in (d for d in sets if d.number in _NODES):
        with placed(path, data):
            while data.left:
                if data.number == 15:
                    *head, x, y, z = data.reals(7, "a node")
                    number, system, place = int(head[0]), int(head[1]), [x, y, z]
                else:
                    number, system = data.whole(2, "a node")[:2]
                    place = data.reals(3, f"node {number}")
                if system in local:
                    raise Damaged(
                        f"node {number} stands in the local coordinate system {system} (data set 2420); "
                        "export it in the global one"
                    )
                if number in lines:
                    raise Damaged(f"node {number} is defined twice, first in line {lines[number]}")
                lines[number] = data.line
                ids.append(number)
                points.append(place)
    if not ids:
        raise Damaged("it holds no nodes (data set 2411)")
    return RawMesh(np.array(points), np.array(ids, dtype=np.int64))


def _local(path: Path, data: DataSet) -> Iterator[int]:
    """Numbers of the coordinate systems that are not the global one: six lines each, after two of the part."""
    wanted = [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0], [0, 0, 0]]
    with placed(path, data):
        data.at = 2
        while len(data.lines) - data.at >= 6:
            label, kind = data.whole(2, "a system")[:2]
            data.text("a system")
            if [data.reals(3, "a system") for _ in range(4)] != wanted or kind:
                yield label


_Flat = dict[int, Indices]
"""Number of a shell or line -> positions of its corners."""


def _elements(path: Path, sets: list[DataSet], raw: RawMesh, numbering: Numbering) -> _Flat:
    """Add the solids and what is left out beside them; shells and lines by their number."""
    solids: dict[str, list[tuple[int, int, list[int]]]] = {}
    flat: dict[int, tuple[str, int, list[int]]] = {}
    seen, known = set[int](), {*raw.node_id.tolist()}
    first, others = dict[str, str](), Counter[str]()
    for data in (d for d in sets if d.number in _CELLS):
        with placed(path, data):
            for line, number, descriptor, nodes in _records(data):
                if number in seen:
                    raise Damaged(f"element {number} is defined twice")
                seen.add(number)
                if absent := [n for n in nodes if n not in known]:
                    raise Damaged(
                        f"element {number} names node {absent[0]}, which the file does not define"
                    )
                where = f"{path.name}, line {line}"
                if what := _OTHERS.get(descriptor):
                    first.setdefault(what, where)
                    others[what] += 1
                elif descriptor in _BEAMS:
                    flat[number] = where, descriptor, [nodes[0], nodes[-1]]
                elif descriptor in _SHELLS:
                    kind, nodes = _in_order(number, descriptor, nodes)
                    flat[number] = where, descriptor, nodes[: FACET_CORNERS[kind]]
                else:
                    kind, nodes = _in_order(number, descriptor, nodes)
                    solids.setdefault(kind, []).append((number, 0, nodes))
    raw.lost += [lost(first[w], f"{n} {w}{'s' * (n > 1)}") for w, n in others.items()]
    raw.add_solids(solids, numbering, "an element names")
    raw.regions = []
    found = {n: numbering.positions(c, "") for n, (*_, c) in flat.items()}
    edges = _edges(raw) if any(len(c) == 2 for c in found.values()) else set()
    kinds: dict[int, Structure] = {}
    for n, (where, descriptor, _) in flat.items():
        ends = found[n]
        if len(ends) > 2 or (min(ends), max(ends)) not in edges:
            what = f"of type {descriptor} ({'shell' if len(ends) > 2 else 'beam'})"
            kinds.setdefault(descriptor, Structure(where, what, [])).elements.append(ends.tolist())
    raw.structures = list(kinds.values())
    return found


def _in_order(number: int, descriptor: int, nodes: list[int]) -> tuple[str, list[int]]:
    """The type of a solid or shell, and its nodes in VTK's order."""
    form = _SOLIDS.get(descriptor) or _SHELLS.get(descriptor)
    if form is None:
        raise Damaged(
            f"element {number} is of the I-deas type {descriptor}, which cannot be assembled"
        )
    kind, places = form
    if len(nodes) != len(places):
        raise Damaged(
            f"element {number} has {len(nodes)} nodes, its type {descriptor} ({kind}) {len(places)}"
        )
    return kind, [nodes[i] for i in places]


def _edges(raw: RawMesh) -> set[tuple[int, int]]:
    """Ends of the edges of all solids: lines along them are of the mesh program, no beams."""
    pairs = [cells[:, np.array(CELL_TYPES[kind].edges)].reshape(-1, 2) for kind, cells in raw.blocks]
    return {*map(tuple, np.unique(np.sort(np.vstack(pairs), axis=1), axis=0).tolist())} if pairs else set()


def _records(data: DataSet) -> Iterator[tuple[int, int, int, list[int]]]:
    """(line, number, descriptor, nodes) of the elements of a data set."""
    width = _CELLS[data.number]
    while data.left:
        head = data.whole(width, "an element")
        line, number, descriptor, count = data.line, head[0], head[1], head[width - 1]
        if descriptor in _BEAMS:
            data.text(f"element {number}")
        if count < 1:
            raise Damaged(f"element {number} has {count} nodes")
        nodes = data.whole(count, f"element {number}")
        if len(nodes) != count:
            raise Damaged(f"element {number} has {len(nodes)} nodes instead of {count}")
        yield line, number, descriptor, nodes


def _groups(data: DataSet, raw: RawMesh, numbering: Numbering, flat: _Flat) -> None:
    """Groups of nodes and lines become sets of points, groups of shells faces; solids in a group say nothing."""
    width = _GROUPS[data.number]
    while data.left:
        head = data.whole(1, "a group")
        if not data.left:
            return
        name = data.text("a group").strip() or f"group_{head[0]}"
        count = width * head[-1]
        if not 0 <= count <= width * 10**8:
            raise Damaged(f"the group '{name}' has {head[-1]} members")
        members = data.whole(count, f"the group '{name}'")
        table = np.array(members[:count], dtype=np.int64).reshape(-1, width)
        ids = table[table[:, 0] == _ELEMENT, 1].tolist()
        found = [flat[n] for n in ids if n in flat]
        for corners in (3, 4):
            if facets := [c for c in found if len(c) == corners]:
                raw.facets.setdefault(name, []).append(np.array(facets))
        if lines := [c for c in found if len(c) == 2]:
            raw.add_points(name, np.unique(lines))
        if len(nodes := table[table[:, 0] == _NODE, 1]):
            raw.add_set(name, nodes, numbering)
