"""Reader of meshes in I-deas Universal Files: nodes, solid elements, groups.

Written against the description of the data sets 2411 and 781 (nodes), 2412 (elements), 2420 (coordinate systems) and
2417 to 2477 (permanent groups) in the Universal File reference of the University of Cincinnati. Parabolic elements
name corners and mid-side nodes in turn, layer after layer.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np

from ..data import Indices
from ..topology import FACET_CORNERS
from .raw import Damaged, Numbering, RawMesh

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
"""Beams and rods; the data set gives them a line more."""
_OTHERS = {
    121,
    122,
    136,
    137,
    138,
    139,
    141,
    142,
    151,
    152,
    161,
}  # rigid bars, springs, dampers, masses
_GROUPS = {2417: 2, 2429: 2, 2430: 2, 2432: 2, 2435: 4, 2452: 4, 2467: 4, 2477: 4}
"""Data set of groups -> numbers of each member."""
_NODE, _ELEMENT = 7, 8
_KNOWN = {0, 151, 164, 781, 2411, 2412, 2420}
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


def read_unv(path: Path) -> RawMesh:
    """Read nodes, cells and groups.

    Raises:
        Damaged: content that is inconsistent, or whose meaning would be lost.
    """
    text = path.read_text(encoding="latin-1")
    sets = list(_data_sets(text.splitlines()))
    raw = _nodes(sets)
    numbering = Numbering(raw.node_id)
    shells = _elements(sets, raw, numbering)
    _groups(sets, raw, numbering, shells)
    others = dict.fromkeys(kind for kind, _ in sets if kind not in _KNOWN | {*_GROUPS})
    named = [f"{kind} ({what})" if (what := _RESULTS.get(kind)) else str(kind) for kind in others]
    if named:
        raw.remarks.append(
            f"data sets left aside: {', '.join(named)}; only nodes, cells and groups are taken"
        )
    marks = sum(line.strip() == "-1" for line in text.splitlines())
    if marks % 2 or not re.search(r"^ *-1[ \t\r]*\n*\Z", text, re.MULTILINE):
        raw.unended = "no data set that ends with its last line"
    return raw


def has_solids(path: Path) -> bool:
    """Whether a file has solid cells (data set 2412)."""
    with suppress(Damaged):
        sets = _data_sets(path.read_text(encoding="latin-1").splitlines())
        return any(e[1] in _SOLIDS for kind, lines in sets if kind == 2412 for e in _records(lines))
    return False


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


def _data_sets(lines: list[str]) -> Iterator[tuple[int, list[str]]]:
    """(number, lines) of everything between two lines of -1."""
    at = 0
    while at < len(lines):
        if lines[at].strip() != "-1":
            at += 1
            continue
        end = next((i for i in range(at + 1, len(lines)) if lines[i].strip() == "-1"), None)
        if end is None:
            if at + 1 < len(lines):
                raise Damaged("a data set has no end, the file is truncated")
            return
        if end > at + 1:
            head = lines[at + 1].split()
            yield (
                int(head[0]) if head and head[0].isdecimal() and len(head[0]) < 9 else 0,
                lines[at + 2 : end],
            )
        at = end + 1


def _whole(line: str, what: str) -> list[int]:
    try:
        values = [int(word) for word in line.split()]
    except ValueError:
        raise Damaged(
            f"{what} holds the line '{line.strip()[:60]}', which is not of whole numbers"
        ) from None
    if any(abs(v) > 10**12 for v in values):
        raise Damaged(f"{what} holds a number beyond all bounds")
    return values


def _reals(line: str, what: str) -> list[float]:
    try:
        return [float(word) for word in line.upper().replace("D", "E").split()]
    except ValueError:
        raise Damaged(
            f"{what} holds the line '{line.strip()[:60]}', which is not of numbers"
        ) from None


def _nodes(sets: list[tuple[int, list[str]]]) -> RawMesh:
    ids, points = [], []
    for kind, lines in sets:
        if kind == 2420:
            _refuse_systems(lines)
        if kind not in (2411, 781):
            continue
        if len(lines) % 2:
            raise Damaged(f"the data set {kind} of nodes has a node without a place")
        for head, place in zip(lines[::2], lines[1::2], strict=True):
            numbers, x = _whole(head, f"the data set {kind}"), _reals(place, f"the data set {kind}")
            if not numbers or len(x) != 3:
                raise Damaged(
                    f"the data set {kind} holds the lines '{head.strip()[:30]}' '{place.strip()[:60]}'"
                )
            ids.append(numbers[0])
            points.append(x)
    if not ids:
        raise Damaged("it holds no nodes (data set 2411)")
    return RawMesh(np.array(points), np.array(ids, dtype=np.int64))


def _refuse_systems(lines: list[str]) -> None:
    """Coordinate systems other than the global one: six lines each, after two of the part."""
    wanted = [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0], [0, 0, 0]]
    for at in range(2, len(lines) - 5, 6):
        kind = _whole(lines[at], "the data set 2420")
        axes = [_reals(line, "the data set 2420") for line in lines[at + 2 : at + 6]]
        if len(kind) > 1 and kind[1] != 0 or axes != wanted:
            raise Damaged(
                "it has local coordinate systems (data set 2420); export it in the global one"
            )


_Shells = dict[int, tuple[str, Indices]]


def _elements(sets: list[tuple[int, list[str]]], raw: RawMesh, numbering: Numbering) -> _Shells:
    """Add the solids; the shells by their number."""
    solids: dict[str, list[tuple[int, int, list[int]]]] = {}
    shells: dict[int, tuple[str, list[int]]] = {}
    seen: set[int] = set()
    for number, descriptor, nodes in (
        e for kind, lines in sets if kind == 2412 for e in _records(lines)
    ):
        if number in seen:
            raise Damaged(f"element {number} is defined twice")
        seen.add(number)
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
        placed = [nodes[i] for i in places]
        if descriptor in _SHELLS:
            shells[number] = kind, placed[: FACET_CORNERS[kind]]
        else:
            solids.setdefault(kind, []).append((number, 0, placed))
    raw.add_solids(solids, numbering, "the data set 2412 names")
    raw.regions = []
    return {
        n: (t, numbering.positions(c, "the data set 2412 names")) for n, (t, c) in shells.items()
    }


def _taken(lines: Iterator[str], count: int, what: str) -> list[int]:
    """So many whole numbers or more, from as many lines as they need; fewer where the lines end."""
    numbers: list[int] = []
    while len(numbers) < count and (line := next(lines, None)) is not None:
        numbers += _whole(line, what) or [0]
    return numbers


def _records(lines: list[str]) -> Iterator[tuple[int, int, list[int]]]:
    """(number, descriptor, nodes) of solids and shells."""
    rest, what = iter(lines), "the data set 2412"
    for line in rest:
        head = _whole(line, what)
        if len(head) < 6:
            raise Damaged(f"{what} holds the line '{line.strip()[:60]}', which begins no element")
        number, descriptor, count = head[0], head[1], head[5]
        if descriptor in _BEAMS:
            next(rest, None)
        nodes = _taken(rest, count, what)
        if len(nodes) != count:
            raise Damaged(f"element {number} has {len(nodes)} nodes instead of {count}")
        if descriptor not in _BEAMS | _OTHERS:
            yield number, descriptor, nodes


def _groups(
    sets: list[tuple[int, list[str]]], raw: RawMesh, numbering: Numbering, shells: _Shells
) -> None:
    """Groups of nodes become sets of points, groups of shells faces; solids in a group say nothing."""
    for kind, lines in ((k, l) for k, l in sets if k in _GROUPS):
        rest, what, width = iter(lines), f"the data set {kind}", _GROUPS[kind]
        for line in rest:
            if (name := next(rest, None)) is None:
                break
            head, name = _whole(line, what), name.strip()
            if not head or not 0 <= head[-1] <= 10**8:
                raise Damaged(f"{what} holds the line '{line.strip()[:60]}', which begins no group")
            count = width * head[-1]
            members = _taken(rest, count, what)
            if len(members) < count:
                raise Damaged(f"the group '{name}' has fewer members than it announces")
            table = np.array(members[:count], dtype=np.int64).reshape(-1, width)
            _group(raw, numbering, shells, name or f"group_{head[0]}", table)


def _group(raw: RawMesh, numbering: Numbering, shells: _Shells, name: str, table: Indices) -> None:
    nodes = table[table[:, 0] == _NODE, 1]
    found = [shells[n] for n in table[table[:, 0] == _ELEMENT, 1].tolist() if n in shells]
    for count in (3, 4):
        if facets := [nodes_of for _, nodes_of in found if len(nodes_of) == count]:
            raw.facets.setdefault(name, []).append(np.array(facets))
    if len(nodes):
        raw.add_set(name, nodes, numbering)
