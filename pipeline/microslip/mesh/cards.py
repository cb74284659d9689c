"""Keyword lines of Abaqus and CalculiX input files, with their parameters, data and place, through all includes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..data import Indices
from ..errors import of_file
from ..files.store import ordinary
from .raw import Damaged


@dataclass
class Card:
    """A keyword line and its data.

    Attributes:
        keyword: in capitals, without the star. parameters: in capitals -> as written, INPUT a path.
            lines: of data, without comments. where: ``part.inp, line 12``. place: with its path.
            space: the instance in which it stands, in capitals; "" is the assembly.
    """

    keyword: str
    parameters: dict[str, str] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)
    where: str = ""
    place: str = ""
    space: str = ""

    def text(self, key: str) -> str:
        """A parameter as it is written; empty where there is none."""
        return self.parameters.get(key, "")

    def word(self, key: str, otherwise: str = "") -> str:
        """A parameter in capitals."""
        return self.parameters.get(key, otherwise).upper()


def read_cards(path: Path) -> list[Card]:
    """All cards of a file and of those that it includes, in their order.

    Raises:
        Damaged: an included file that cannot be read or includes itself.
    """
    found, files = list[Card](), list[Path]()
    for file, number, line in _lines(path, (), path.parent):
        if line.startswith("*"):
            where = f", line {number}"
            found.append(Card(line, where=file.name + where, place=f"{file}{where}"))
            files.append(file)
        elif found and not found[-1].lines and found[-1].keyword.endswith(","):
            found[-1].keyword += line
        elif found:
            found[-1].lines.append(line)
    for card, file in zip(found, files, strict=True):
        head = card.keyword
        card.keyword, card.parameters = keyword(head), parameters(head)
        card.keyword = _SPACED.get(card.keyword.replace(" ", ""), card.keyword)
        if target := card.parameters.get("INPUT"):
            card.parameters["INPUT"] = str(beside(file, target, path.parent))
    return found


def _lines(path: Path, within: tuple[Path, ...], home: Path) -> Iterator[tuple[Path, int, str]]:
    """File, number and text of every line but comments and empty ones."""
    if path.resolve() in within:
        raise Damaged(f"the file includes itself by way of {path.name}")
    try:
        text = ordinary(path).read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise Damaged(f"the included file {path} cannot be read ({error.strerror})") from None
    for number, line in enumerate(text.splitlines(), 1):
        line = line.strip()
        if not line or line.startswith("**"):
            continue
        if not re.match(r"\*INCLUDE\b", line, re.IGNORECASE):
            yield path, number, line
            continue
        with of_file(f"{path}, line {number}"):
            target = parameters(line).get("INPUT", "")
            if not target:
                raise Damaged("an *INCLUDE names no file")
            yield from _lines(beside(path, target, home), (*within, path.resolve()), home)


def beside(path: Path, target: str, home: Path) -> Path:
    """A file named in another one: from its folder, else from that of the whole deck."""
    near = path.parent / target
    return near if near.is_file() or not (home / target).is_file() else home / target


def data_of(path: Path) -> list[str]:
    """Data lines of a file that a keyword's INPUT names."""
    return [line for *_, line in _lines(path, (), path.parent)]


def files_of(path: Path, within: tuple[Path, ...] = (), home: Path | None = None) -> list[Path]:
    """An input file and all that it reads from others, at any depth; what is missing is told where it is read."""
    home, path_itself = home or path.parent, path.resolve()
    data = path.read_bytes() if path.is_file() and path_itself not in within else b""
    found = [path]
    for line in re.findall(r"^\s*\*[^*\n].*$", data.decode(errors="replace"), re.M) if b"INPUT" in data.upper() else ():
        if name := parameters(line).get("INPUT"):
            found += files_of(beside(path, name, home), (*within, path_itself), home)
    return list(dict.fromkeys(found))


def keyword(line: str) -> str:
    """The keyword of a line, in capitals."""
    return " ".join(line[1:].partition(",")[0].upper().split())


def parameters(line: str) -> dict[str, str]:
    """Its parameters: in capitals -> as written, without quotes."""
    pairs = (word.partition("=") for word in line.split(",")[1:])
    named = {
        " ".join(key.upper().split()): value.strip().strip('"')
        for key, _, value in pairs
        if key.strip()
    }
    return {_SPACED.get(key.replace(" ", ""), key): value for key, value in named.items()}


_SPACED = {
    words.replace(" ", ""): words
    for words in (
        "REF NODE", "ROT NODE", "PIN NSET", "TIE NSET", "CONSTRAINT NAME", "POSITION TOLERANCE",
        "CYCLIC SYMMETRY", "OLD SET", "NEW SET", "CHANGE NUMBER", "ELEMENT SHIFT", "SHIFT NODES",
        "WEIGHTING METHOD", "INFLUENCE RADIUS", "SOLID SECTION", "RIGID BODY", "CONTACT PAIR",
        "END STEP", "INITIAL CONDITIONS", "ROTARY INERTIA", "PRE-TENSION SECTION",
        "CYCLIC SYMMETRY MODEL", "SELECT CYCLIC SYMMETRY MODES", "COMPLEX FREQUENCY",
        "KINEMATIC COUPLING", "DISTRIBUTING COUPLING", "SURFACE INTERACTION", "SURFACE BEHAVIOR",
    )
}  # fmt: skip
"""Keywords and parameters of several words by what is left of them without blanks: CalculiX reads none."""


def fields(line: str) -> list[str]:
    """The words of a data line."""
    return [word.strip() for word in line.split(",") if word.strip()]


def whole_numbers(text: str, what: str) -> Indices:
    """Of a text, each above 0."""
    words = [word for word in text.replace(",", " ").split() if word]
    try:
        values = np.array(words, dtype=np.int64) if words else np.zeros(0, dtype=np.int64)
    except (ValueError, OverflowError):
        raise Damaged(f"{what} holds something that is no whole number") from None
    if len(values) and values.min() < 1:
        raise Damaged(f"{what} holds a number below 1")
    return values


def numbers(lines: list[str], what: str) -> list[list[float]]:
    """Numbers of the data lines; an empty place counts as 0."""
    try:
        rows = [line.rstrip().rstrip(",").split(",") for line in lines]
        table = [[float(w.replace("D", "e").replace("d", "e")) if w.strip() else 0.0 for w in row] for row in rows]
        if not all(np.isfinite(v) for row in table for v in row):
            raise ValueError("it is not finite")
        return table
    except ValueError as error:
        raise Damaged(f"{what} holds something that is no number ({str(error)[-60:]})") from None
