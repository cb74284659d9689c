"""The page of an imported file: what it holds, what was taken as what, what was left out, what to do.

Its sentences are those that `microslip import` prints.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..data import FaceTie, Mesh
from .page import Album, Piece, fold, number, page, say, table

TO_DO = {
    "Mesh": r"cells|points|parts|facets|element(s)? .* twice|overlap|first-order|is it whole|may be cut",
    "Materials and temperatures": r"material|modulus|temperature|density|elastic|steel",
    "Supports and constraints": r"support|held|contact|constraint|tied|cyclic|couple|NROTAT|MPC|RBE|hold",
    "Loads": r"load|pressure|preload|static step|prescrib|PSTRES|\*FREQUENCY",
    "Elements that are no solids": r"type \d+|TYPE=|spring|mass|beam|shell|element",
    "Units": r"lengths in|unit",
}
"""Heading -> what sentences under it speak of; the first that fits."""

HELD, JOINED, CUT = (214, 92, 92), (98, 150, 96), (88, 128, 198)
"""Colours of faces that are held, tied or in contact, and cut from a ring."""


def marked_faces(mesh: Mesh) -> dict[str, tuple[int, int, int]]:
    """Face -> colour in the picture."""
    links = mesh.links.items if mesh.links else ()
    tied = [name for tie in links if isinstance(tie, FaceTie) for name in (tie.slave, tie.master)]
    joined = [name for joint in mesh.joints for name in (joint.slave, joint.master)]
    cut = mesh.sector.faces if mesh.sector else ()
    every = {**dict.fromkeys([*tied, *joined], JOINED), **dict.fromkeys(cut, CUT)}
    every |= dict.fromkeys(mesh.supports, HELD)
    return {name: colour for name, colour in every.items() if name in mesh.faces}


def import_page(
    file: Path, mesh: Mesh, told: Sequence[str], picture: Path | None, modes: Sequence[str] = (), body: str = ""
) -> str:  # fmt: skip
    """HTML of the page.

    Args:
        told: sentences of import; ``warning: `` what changes frequencies, ``note: `` what was taken
            as something else or is not used. modes: lines of the first frequencies. body: the new body.toml.
    """
    warnings = [text.removeprefix("warning: ") for text in told if text.startswith("warning: ")]
    notes = [text.removeprefix("note: ") for text in told if text.startswith("note: ")]
    taken = [text for text in told if not text.startswith(("warning: ", "note: "))]
    count = len(warnings)
    lead = (
        "Nothing that is known to decide frequencies was left out."
        if not count
        else f"{count} thing{'s' * (count > 1)} to look at before the frequencies can be trusted: see To do."
    )
    album = Album({} if picture is None else {picture.name: picture})
    shown = album.begun("")
    colours = [
        f"{what}: {', '.join(sorted(n for n, c in marked_faces(mesh).items() if c == colour))}"
        for what, colour in (
            ("red, held", HELD),
            ("green, joined", JOINED),
            ("blue, cut from the ring", CUT),
        )
        if colour in marked_faces(mesh).values()
    ]
    pieces = [say(lead, tone="warn" if count else "lead"), *shown, say("; ".join(colours))]
    sections = {
        "First frequencies": [Piece("verbatim", "\n".join(modes))],
        "To do": _grouped(warnings),
        "Taken as something else, or not used": [say(*map(_whole, notes))],
        "What was taken": [
            _counts(file, mesh),
            _materials(mesh),
            _supports(mesh),
            say(*map(_whole, taken)),
        ],
        "Sets to name faces by": [_sets(mesh)],
        "Next": [say(f"{body} runs as it stands: microslip run {Path(body).parent}.")]
        if body
        else [],
    }
    return page(f"{file.name} as a body", [p for p in pieces if p], sections)


def _whole(words: str) -> str:
    if not re.match(r"\S+\.\w+[,:]", words):  # the name of a file stays as it is
        words = f"{words[:1].upper()}{words[1:]}"
    return words if words.endswith(".") else f"{words}."


def _grouped(warnings: Sequence[str]) -> list[Piece]:
    groups: dict[str, list[str]] = {}
    for text in warnings:
        fits = (name for name, words in TO_DO.items() if re.search(words, text, re.IGNORECASE))
        groups.setdefault(next(fits, "Others"), []).append(_whole(text))
    order = [*TO_DO, "Others"]
    return [
        piece
        for name in sorted(groups, key=order.index)
        for piece in (Piece("h3", name), say(*groups[name]))
    ]


def _counts(file: Path, mesh: Mesh) -> Piece:
    solid = np.unique(np.concatenate([c.ravel() for c in mesh.cells.values()]))
    size = 1e3 * np.ptp(mesh.points[solid], axis=0)
    cells = ", ".join(f"{len(c)} {kind}" for kind, c in mesh.cells.items())
    rows = [
        ("file", str(file)),
        ("size", " x ".join(f"{v:.5g}" for v in size) + " mm"),
        ("points", mesh.n_points),
        ("cells", cells),
        ("links", len(mesh.links.items) if mesh.links else ""),
        ("point masses", f"{mesh.lumps.masses.sum():.6g} kg" if mesh.lumps else ""),
        ("instances", ", ".join(mesh.instances)),
    ]
    return table([], [row for row in rows if row[1] != ""])


def _materials(mesh: Mesh) -> Piece:
    rows = []
    for place, material in enumerate(mesh.materials):
        compliance = np.linalg.inv(material.elasticity)
        E = 1e-9 / np.diag(compliance)[:3]
        plain = np.ptp(E) < 1e-6 * E[0]
        moduli = number(E[0], 6) if plain else ", ".join(number(v, 5) for v in E)
        ratio = number(-compliance[0, 1] / compliance[0, 0], 4)
        count = sum(int((r == place).sum()) for r in mesh.regions.values())
        hot = "over temperature" if material.softening is not None else ""
        rows.append((material.name, number(material.density, 6), moduli, ratio, count or "", hot))
    return table(["material", "kg/m3", "E in GPa", "Poisson's ratio", "cells", "modulus"], rows)


def _supports(mesh: Mesh) -> Piece:
    none = np.zeros(0, dtype=np.int64)
    rows = [
        (name, len(mesh.point_sets.get(name, none)), ways) for name, ways in mesh.supports.items()
    ]
    return table(["held", "points", "directions"], rows)


def _sets(mesh: Mesh, most: int = 60) -> Piece:
    names = sorted({*mesh.faces, *mesh.point_sets})
    rows = [
        (name, len(mesh.face_points(name)) if name in mesh.faces else len(mesh.point_sets[name]),
         sum(map(len, mesh.faces[name].values())) if name in mesh.faces else "no face")
        for name in names[:most]
    ]  # fmt: skip
    more = [say(f"And {len(names) - most} sets more.")] if len(names) > most else []
    return (
        fold(f"{len(names)} sets", table(["set", "points", "facets"], rows), *more)
        if rows
        else say()
    )
