"""Nastran: a Craig-Bampton superelement as bulk data (.pch), DMIG matrices on GRIDs and SPOINTs.

Each interface is a GRID at its origin with the six displacements 1 to 6 in the basic system, which is the frame of the
mesh; every other coordinate is an SPOINT. ``KAAX``, ``MAAX`` and ``BAAX`` are symmetric (form 6, the lower triangle),
``GAAX`` and ``NAAX`` square (form 1); a matrix of zeros is left out. A field of 16 columns holds nine to twelve
figures of a number, as many as fit beside its exponent.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ..data import Array, Indices, Interface, ModalBasis, ModalGroup
from ..files.store import write_text
from ..units import rpm_text
from .choice import STATEMENT, Format, one_line, only_group, real
from .pyharm import physical_first

GRID, SPOINT = 90_000_001, 91_000_001
"""First numbers, where those of a model hardly are."""

_SELECT = {"KAAX": "K2GG", "MAAX": "M2GG", "BAAX": "B2GG", "GAAX": "B2PP", "NAAX": "K2PP"}
_MEANS = {"GAAX": "gyroscopic", "NAAX": "circulatory"}
_SYMMETRIC, _SQUARE = 6, 1


def write_dmig(basis: ModalBasis, path: Path | str) -> None:
    """Write one group, complete or absent. Same basis, same bytes.

    Raises:
        UserError: several groups, complex shapes, interface displacements are not coordinates, no permission.
    """
    g = real(only_group(basis, "dmig"), "dmig")
    nodes, order = physical_first(basis, g, "dmig")
    faces, tables = [g.interfaces[name] for name in nodes], matrices(g, nodes, order)
    dofs = [(GRID + i, c) for i in range(len(nodes)) for c in range(1, 7)]
    dofs += [(SPOINT + j, 0) for j in range(len(order) - len(dofs))]
    lines = [*_head(basis, g, tables), *_points(nodes, faces, len(order))]
    for name, (form, table) in tables.items():
        lines += _cards(name, form, table, dofs)
    write_text(path, "\n".join(lines) + "\n")


def matrices(g: ModalGroup, nodes: Sequence[str], order: Indices) -> dict[str, tuple[int, Array]]:
    """Name -> form and (m, m) matrix in the order of the file, of those that are not zero.

    M x'' + (B + G) x' + (K + N) x = f with B the symmetric part of the damping; what is left of it stands in G.
    """
    T = np.eye(g.n_modes)
    for i, name in enumerate(nodes):
        for at in (6 * i, 6 * i + 3):
            T[at : at + 3, at : at + 3] = g.interfaces[name].rotation

    def turned(A: Array) -> Array:
        return T.T @ A[np.ix_(order, order)] @ T

    K, M, C = (turned(A) for A in (g.K_r, g.M_r, g.C_r))
    found = {
        "KAAX": (_SYMMETRIC, (K + K.T) / 2),
        "MAAX": (_SYMMETRIC, (M + M.T) / 2),
        "BAAX": (_SYMMETRIC, (C + C.T) / 2),
        "GAAX": (_SQUARE, turned(g.G_r + (g.C_r - g.C_r.T) / 2)),
        "NAAX": (_SQUARE, np.zeros_like(K) if g.N_r is None else turned(g.N_r)),
    }
    scale = np.abs(C).max(initial=0) * 1e-14  # rounding of a damping matrix is no gyroscopic one
    return {name: (form, A) for name, (form, A) in found.items() if np.abs(A).max() > (scale if name == "GAAX" else 0)}


def _head(basis: ModalBasis, g: ModalGroup, tables: dict[str, tuple[int, Array]]) -> Iterator[str]:
    """What a reader must know, as comments, with the case control that selects the matrices."""
    at = f", nodal diameter {g.harmonic} of {basis.sectors} sectors" if basis.sectors > 1 else ""
    yield from _said(
        f"Superelement {one_line(basis.name)} ({basis.reduction}) at {rpm_text(g.speed)}{at}, by microslip."
    )
    yield from _said(
        f"{STATEMENT}. GRIDs are the interfaces, displacements 1 to 6 in the basic system, which is that of the mesh. "
        "SPOINTs are the other coordinates, in kg^1/2 m where they are modes (modal mass 1)."
    )
    yield from _said("Include this file in the bulk data and select in the case control:")
    for name in tables:
        yield f"$   {_SELECT[name]} = {name}" + (f"   ({_MEANS[name]}, any symmetry)" if name in _MEANS else "")
    elastic = " ".join(f"{f:.9g}" for f in g.frequency)
    yield from _said(f"Check: frequencies of KAAX, MAAX in Hz: {elastic}")


def _said(text: str) -> list[str]:
    return [f"$ {line}" for line in textwrap.wrap(text, 70)]


def _points(nodes: Sequence[str], faces: Sequence[Interface], count: int) -> Iterator[str]:
    """GRID and SPOINT cards, and as comments the sets that a part superelement wants."""
    for i, (name, face) in enumerate(zip(nodes, faces, strict=True)):
        yield from _said(f"interface {one_line(name)}")
        x, y, z = (f"{number(v, 'E'):>16}" for v in face.origin)
        yield f"{'GRID*':8}{GRID + i:16d}{0:16d}{x}{y}"
        yield f"{'*':8}{z}{0:16d}"
    more = count - 6 * len(nodes)
    if more:
        yield _through("SPOINT", first=SPOINT, count=more)
    yield from _said("In a part superelement (BEGIN SUPER) take the $ from the next lines; elsewhere leave them so.")
    yield "$" + _through("ASET1", "123456", first=GRID, count=len(nodes))
    if more:
        yield "$" + _through("QSET1", "0", first=SPOINT, count=more)


def _through(*start: str, first: int, count: int) -> str:
    """A card that names numbers from the first one on."""
    numbers = [first] if count == 1 else [first, "THRU", first + count - 1]
    return "".join(f"{field:<8}" for field in [*start, *numbers])


def _cards(name: str, form: int, table: Array, dofs: Sequence[tuple[int, int]]) -> Iterator[str]:
    """The header and the columns of a matrix that are not zero, of a symmetric one the lower triangle."""
    yield f"{'DMIG':8}{name:8}{0:8d}{form:8d}{2:8d}{0:8d}"
    for j, (node, component) in enumerate(dofs):
        first = j if form == _SYMMETRIC else 0
        rows = first + np.flatnonzero(table[first:, j])
        if len(rows):
            yield f"{'DMIG*':8}{name:16}{node:16d}{component:16d}"
        for i in rows.tolist():
            yield f"{'*':8}{dofs[i][0]:16d}{dofs[i][1]:16d}{number(table[i, j], 'D'):>16}"


def number(value: float, letter: str) -> str:
    """A real number in 16 columns at most, with all figures that fit beside its exponent. The first column is kept for
    a sign: equal and opposite numbers stay so, and cancel under rigid motion."""
    for digits in range(14, 0, -1):
        mantissa, exponent = f"{value:.{digits}E}".split("E")
        text = f"{mantissa}{letter}{int(exponent)}"
        if len(text) <= 15 + text.startswith("-"):
            return text
    raise AssertionError("a double has an exponent of four characters at most")


FORMATS = (Format("dmig", ".pch", "Nastran: a Craig-Bampton superelement", write_dmig),)
