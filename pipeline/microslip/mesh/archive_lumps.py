"""Of Ansys archives: MASS21 and COMBIN14 with their real constants."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from ..data import LumpedElement, PointMass
from ..errors import of_file
from .archive import Archive, Command, Element, whole
from .raw import Damaged, Numbering, lost, real

KINDS = {21: "MASS21", 14: "COMBIN14"}


def _read_reals(archive: Archive, words: list[str]) -> None:
    """R, set, up to six values; RMORE, six more."""
    if words[0].upper() == "R":
        archive.open_reals = whole(words[1] or "1", "R")
        archive.reals[archive.open_reals] = []
        words = words[1:]
    values = archive.reals.setdefault(archive.open_reals, [])
    values += [real(w, "R") if w else 0.0 for w in [*words[1:], *6 * [""]][:6]]


def _read_block(archive: Archive, words: list[str]) -> None:
    """RLBLOCK, sets, largest set, largest count: two formats, then each set, seven values a line behind its number."""
    formats, lines, at = [], archive.lines, archive.at
    for line in lines[at : at + 2]:
        found = re.findall(r"(\d*)([ig])(\d+)", re.sub(r"\.\d+", "", line.lower()))
        formats.append([int(w) for n, _, w in found for _ in range(int(n or 1))])
    if len(formats) < 2 or len(formats[0]) < 3:
        raise Damaged("RLBLOCK has no lines with its formats")
    at += 2
    for _ in range(whole(words[1] or "0", "RLBLOCK")):
        if at >= len(lines):
            raise Damaged("RLBLOCK has no end, the file is truncated")
        row = _cut(lines[at], formats[0])
        number, count = whole(row[0], "RLBLOCK"), whole(row[1], "RLBLOCK")
        values, at = row[2:], at + 1
        while len(values) < count:
            if at >= len(lines):
                raise Damaged("RLBLOCK has no end, the file is truncated")
            values, at = [*values, *_cut(lines[at], formats[1])], at + 1
        archive.reals[number] = [real(w, "RLBLOCK") if w else 0.0 for w in values[:count]]
    archive.at = at


def _cut(line: str, widths: list[int]) -> list[str]:
    """The fields of a line, those behind its end left out."""
    ends = np.cumsum(widths)
    return [line[e - w : e].strip() for e, w in zip(ends, widths, strict=True) if line[e - w : e].strip()]


def lumps_of(archive: Archive, numbering: Numbering) -> Iterator[PointMass | LumpedElement]:
    """Point masses and springs, nodes by their positions in the file; forms that are not read are told.

    Raises:
        Damaged: elements without their constants or nodes.
    """
    for element in archive.elements:
        kind = archive.kinds.get(element.kind, 0)
        if kind not in KINDS:
            continue
        where = element.where or f"{archive.path}, element {element.number}"
        with of_file(where):
            nodes = [n for n in element.nodes if n]
            values = [*archive.reals.get(element.real, []), *12 * [0.0]]
            if element.real not in archive.reals:
                raise Damaged(f"{KINDS[kind]} has no real constants {element.real}; add R,{element.real}")
            if not nodes:
                raise Damaged(f"{KINDS[kind]} names no node; write it behind E")
            at = numbering.positions(nodes, f"{KINDS[kind]} names")
            options = {n: w for n, w in archive.options.get(element.kind, {}).items() if w not in ("", "0")}
            made = (_mass if kind == 21 else _spring)(archive, element, values, at, options, f"{where}: {KINDS[kind]}")
        if made is None:
            archive.lost.append(lost(where, f"{KINDS[kind]} with KEYOPTs {options} or different masses"))
        else:
            yield made


def _mass(
    archive: Archive, element: Element, r: list[float], nodes: np.ndarray, options: dict[int, str], where: str
) -> PointMass | None:
    """KEYOPT(3): 0 masses and inertias of the axes, 2 a mass; the system must be the global one."""
    form, turned = options.get(3, "0"), not set(options) <= {3} or any(n in archive.turns for n in element.nodes)
    if not set(options) <= {2, 3}:
        return None
    if form == "2":
        return PointMass(where, int(nodes[0]), r[0]) if r[0] >= 0 else None
    if form != "0" or len({*r[:3]}) > 1 or min(r[:6]) < 0 or (turned and any(r[3:6])):
        return None
    return PointMass(where, int(nodes[0]), r[0], inertia=np.diag(r[3:6]))


def _spring(
    archive: Archive, element: Element, r: list[float], nodes: np.ndarray, options: dict[int, str], where: str
) -> LumpedElement | None:
    """K, CV1 along the line; KEYOPT(2): 1 to 6 along that displacement or rotation of both nodes."""
    if r[2] or r[4] or not set(options) <= {2} or len(nodes) != 2 or r[0] < 0 or r[1] < 0:
        return None
    way = options.get(2, "0")
    if way == "0":
        points = np.array([archive.points[archive.node_id.index(n)] for n in element.nodes[:2]])
        along = points[1] - points[0]
        if not along.any():
            raise Damaged("joins two nodes at one place, so it has no direction; write KEYOPT(2)")
        axis, first = along / np.linalg.norm(along), 0
    elif way in "123456" and not any(n in archive.turns for n in element.nodes):
        axis, first = np.eye(3)[(int(way) - 1) % 3], 3 * ((int(way) - 1) // 3)
    else:
        return None
    used = np.flatnonzero(axis)
    row = np.concatenate([axis[used], -axis[used]])
    both = np.outer(row, row)
    pulls = r[0] if way == "0" else 0.0
    return LumpedElement(
        where,
        np.repeat(nodes, len(used)),
        np.tile(used + first, 2),
        r[0] * both,
        r[1] * both,
        pulls,
    )


COMMANDS: dict[str, Command] = {"R": _read_reals, "RMORE": _read_reals, "RLBLOCK": _read_block}
