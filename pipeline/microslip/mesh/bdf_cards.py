"""Cards of Nastran bulk data: lines through all includes, continuations, copied lines, fields.

Fields of eight or sixteen columns or between commas; a card goes on in lines that begin with a blank,
a plus or a star, or with the mark in the tenth field of the line before; ``=``, ``==``, ``*(x)`` and
``=(n)`` copy the card before (Quick Reference Guide, Bulk Data, format and replication).
"""

from __future__ import annotations

import contextlib
import re
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..data import Array, Indices
from ..files.store import ordinary
from .raw import Damaged, Numbering, RawMesh
from .supports import Constraints
from .systems import Chained

_MOST = 10**6
"""Copies that a line may ask for."""


class BulkLine(NamedTuple):
    """A line and its place, ``a.bdf, line 12``."""

    place: str
    text: str


class BulkCard(list[str]):
    """Name and fields, and the place of the line that they begin in."""

    place = ""

    @property
    def where(self) -> str:
        """Its place and name."""
        return f"{self.place}: {self.name}"

    @property
    def name(self) -> str:
        """The word in front and the number behind it."""
        return f"{self[0]} {self.at(1)}"

    def at(self, place: int) -> str:
        """A field, empty beyond the last."""
        return self[place] if place < len(self) else ""

    def whole(self, place: int, otherwise: int | None = None) -> int:
        """A whole number. otherwise: of a blank field.

        Raises:
            Damaged: it is none.
        """
        text = self.at(place)
        if not text and otherwise is not None:
            return otherwise
        if not re.fullmatch(r"[+-]?\d{1,12}", text):
            raise Damaged(f"{self.where} holds '{text[:20]}' where a whole number belongs")
        return int(text)

    def real(self, place: int) -> float | None:
        """A number as Nastran writes it: 1.5-3 is 1.5E-3. None: blank.

        Raises:
            Damaged: it is none.
        """
        if not self.at(place):
            return None
        try:
            return number_of(self[place])
        except ValueError:
            text = self[place][:20]
            raise Damaged(f"{self.where} holds '{text}' where a number belongs") from None

    def reals(self, place: int, count: int) -> Array:
        """(count,) numbers from a place on, blank ones 0."""
        return np.array([self.real(place + k) or 0.0 for k in range(count)])

    def directions(self, place: int) -> str:
        """Out of x, y, z, a, b, c, by the digits 1 to 6."""
        pairs = zip("xyzabc", "123456", strict=True)
        return "".join(name for name, digit in pairs if digit in self.at(place))


def number_of(text: str) -> float:
    """Of a field. Raises ValueError if it is none."""
    text = text.replace("D", "E")
    text = re.sub(r"(?<=[\d.])([+-]\d+)$", r"E\1", text) if "E" not in text else text
    if not re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)(E[+-]?\d+)?", text):
        raise ValueError
    return float(text)


@dataclass
class Bulk:
    """The cards of a file by their names.

    Attributes:
        held: what its constraints hold. middles: positions of nodes that are made between two others, with these.
        scalar: position of the first scalar point, behind the grid points.
    """

    file: str
    cards: defaultdict[str, list[BulkCard]]
    raw: RawMesh
    numbering: Numbering
    held: Constraints
    systems: Chained
    scalar: int
    middles: list[tuple[int, Indices]] = field(default_factory=list)

    def frame(self, card: BulkCard, number: int, point: Array) -> Array:
        """(3, 3) rows are the directions of a coordinate system at a point (3,)."""
        with at_card(card):
            return self.systems[number].directions(point[None])[0]

    def positions(self, card: BulkCard, numbers: Sequence[int]) -> Indices:
        """Of nodes that a card names."""
        return self.numbering.positions(numbers, f"{card.where} names")

    def numbered(self, names: Iterable[str], number: int) -> Iterator[BulkCard]:
        """Cards of these names that have a number."""
        return (card for name in names for card in self.cards[name] if card.whole(1) == number)

    def parameter(self, name: str) -> float | None:
        """Of a PARAM card, None where there is none."""
        return next((c.real(2) for c in self.cards["PARAM"] if c.at(1) == name), None)


@contextlib.contextmanager
def at_card(card: BulkCard) -> Iterator[None]:
    """Puts the place of a card before what is wrong with it."""
    try:
        yield
    except Damaged as error:
        text = str(error.args[0])
        raise Damaged(text if ", line " in text else f"{card.where} {text}") from None


# lines ------------------------------------------------------------------------------------------


def lines_of(path: Path, left_out: list[str]) -> list[BulkLine]:
    """The lines of a file and of those that it includes, in capitals, without comments and empty ones.

    Args:
        left_out: takes in what is said of files that the executive control names and that are not there.

    Raises:
        Damaged: with file and line, a file that is not there or includes itself.
    """
    return list(_lines(path, (), path.parent, left_out))


def _lines(
    path: Path, within: tuple[Path, ...], home: Path, left_out: list[str]
) -> Iterator[BulkLine]:
    every = enumerate(ordinary(path).read_text(encoding="latin-1").splitlines(), 1)
    for number, line in every:
        place = f"{path.name}, line {number}"
        if not re.match(r"\s*INCLUDE\b", line, re.IGNORECASE):
            if text := line.split("$")[0].expandtabs(8).rstrip().upper():
                yield BulkLine(place, text)
            continue
        name = line.strip()[7:].strip()
        quote = name[:1] if name[:1] in ("'", '"') else ""
        while quote and name.count(quote) < 2:
            _, more = next(every, (0, None))
            if more is None:
                raise Damaged(f"{place}: INCLUDE has a name without its closing quote; add it")
            name += more.strip()
        name = name.split(quote)[1].strip() if quote else name.split("$")[0].strip()
        target = _beside(path, name, home)
        if target.resolve() in (*within, path.resolve()):
            raise Damaged(
                f"{place}: INCLUDE: the file {name} includes itself; take one of the lines out"
            )
        if target.is_file():
            yield from _lines(target, (*within, path.resolve()), home, left_out)
        elif any(re.match(r"\s*CEND\b", later, re.IGNORECASE) for later in _rest(path, number)):
            left_out.append(
                f"{place}: INCLUDE {name}: not there; the executive control holds no model"
            )
        else:
            raise Damaged(
                f"{place}: INCLUDE names {name or 'no file'}, which is not there; put it beside it"
            )


def _rest(path: Path, number: int) -> list[str]:
    return path.read_text(encoding="latin-1").splitlines()[number:]


def _beside(path: Path, name: str, home: Path) -> Path:
    """A file named in another one: from its folder, else from that of the whole deck."""
    places = [
        folder / word for word in (name, name.replace("\\", "/")) for folder in (path.parent, home)
    ]
    return next((place for place in places if place.is_file()), places[0])


def included(path: Path, within: tuple[Path, ...] = (), home: Path | None = None) -> list[Path]:
    """A file and all that it includes; what is missing is told where it is read."""
    home, own = home or path.parent, path.resolve()
    text = path.read_text(encoding="latin-1") if path.is_file() and own not in within else ""
    every = [path]
    for found in re.finditer(r"^\s*INCLUDE\s*(?:'([^']*)'|\"([^\"]*)\"|(\S+))", text, re.I | re.M):
        name = "".join(
            part.strip() for part in (found[1] or found[2] or found[3] or "").splitlines()
        )
        every += included(_beside(path, name, home), (*within, own), home)
    return list(dict.fromkeys(every))


def parted(lines: list[BulkLine]) -> tuple[list[BulkLine], list[BulkLine], list[str]]:
    """The lines before the bulk data, those in it, and what is said of parts that are left out."""
    begin = [i for i, line in enumerate(lines) if re.match(r"\s*BEGIN\b", line.text)]
    ends = (i for i, line in enumerate(lines) if re.match(r"\s*ENDDATA\b", line.text))
    end = next((i for i in ends if not begin or i > begin[0]), len(lines))
    parts = [i for i in begin[1:] if i < end]
    first = begin[0] + 1 if begin else 0
    told = []
    if parts:
        words = " ".join(lines[parts[0]].text.split())
        told = [
            f"{lines[parts[0]].place}: {words}: {len(parts)} parts of superelements are left out: their mass and "
            "stiffness are missing, so frequencies will differ; write the model as one"
        ]
    return lines[: max(first - 1, 0)], lines[first : min([end, *parts])], told


# cards ------------------------------------------------------------------------------------------


def cards_of(lines: list[BulkLine], wanted: Collection[str]) -> defaultdict[str, list[BulkCard]]:
    """Cards by their names in capitals. wanted: names of those whose fields count.

    Raises:
        Damaged: with file and line, fields that may be read in two ways, copies of nothing.
    """
    cards = defaultdict[str, list[BulkCard]](list)
    for card in _copied(_joined(lines, wanted)):
        cards[card[0]].append(card)
    return cards


def _joined(lines: list[BulkLine], wanted: Collection[str]) -> Iterator[BulkCard]:
    """Name and fields of every card, its continuations joined."""
    cards, card, mark = list[BulkCard](), BulkCard([""]), ""
    marked, later = dict[str, BulkCard | None](), dict[str, int]()
    for number, line in enumerate(lines):
        head = line.text.split(",")[0] if "," in line.text else line.text[:8]
        head = line.text.split()[0] if head.startswith("=") and "," not in line.text else head
        name, *inside = head.split() or [""]  # `NAME 1, 2` has its first field before the comma
        goes_on = not name or name[0] in "+*"
        target = card
        if goes_on:
            sought = name.lstrip("+*")
            if sought and sought != mark:
                later = later or _last_marks(lines)
            if sought and sought != mark and (sought in marked or later.get(sought, -1) > number):
                there = marked.get(sought)
                if there is None:
                    raise Damaged(
                        f"{line.place}: goes on with the mark {name}, which does not stand once at the end of a line "
                        "before it; put it behind the line that it continues"
                    )
                target = there
        if inside and "," in line.text:
            text = f"{name},{' '.join(inside)}{line.text[len(head) :]}"
            line = BulkLine(line.place, text)
        words, mark, wide = _fields(
            line, name, (target[0] if goes_on else name.rstrip("*")) in wanted
        )
        if not goes_on:
            target = BulkCard([name.rstrip("*")])
            target.place = line.place
            cards.append(target)
        elif not wide and len(target) % 8 == 5:
            target += [""] * 4  # half a line in wide fields has no second half
        target += words
        card = target
        if mark:
            marked[mark] = target if mark not in marked or marked[mark] is target else None
    yield from cards


def _last_marks(lines: list[BulkLine]) -> dict[str, int]:
    """What stands at the end of lines, where a mark would -> the last of these lines."""
    ends = (re.split(r"[,\s]", t if "," in t else t[72:])[-1] for _, t in lines)
    return {end.lstrip("+*"): number for number, end in enumerate(ends)}


def _fields(line: BulkLine, name: str, counts: bool) -> tuple[list[str], str, bool]:
    """Eight (or four wide) fields of a line, all that stand in a free one; the mark in the next; whether it is wide.

    Raises:
        Damaged: a free line whose tenth field may be data or the mark of a continuation, if it counts.
    """
    text = line.text
    wide = name.endswith("*") or name.startswith("*")
    count = 4 if wide else 8
    if "," not in text:
        size = 64 // count
        words = [text[8 + i * size : 8 + (i + 1) * size].strip() for i in range(count)]
        return words, text[72:80].strip().lstrip("+*"), wide
    _, *words = (word.strip() for word in text.rstrip(", \t").split(","))
    data, more, mark = words[:count], words[count:], ""
    if more and more[0][:1] in ("+", "*"):
        mark, more = more[0].lstrip("+*"), more[1:]
    elif len(more) == 1 and not more[0][:1].isdecimal():  # such a mark in letters
        mark, more = more[0], []
    elif more and (len(more) == 1 or not more[0]) and counts:
        raise Damaged(
            f"{line.place} has '{more[0]}' in its field {count + 2}, which is that of the continuation; write "
            f"what follows field {count + 1} in a line of its own"
        )
    return [*data, *[""] * (count - len(data)), *more], mark, wide


def _copied(cards: Iterable[BulkCard]) -> Iterator[BulkCard]:
    """The cards, those among them that copy the one before written out."""
    before, pattern = None, None
    for card in cards:
        if not card[0].startswith("="):
            before, pattern = card, None
            yield card
            continue
        repeated = re.fullmatch(r"=\(?(\d+)\)?", card[0])
        if before is None or (repeated and pattern is None):
            raise Damaged(
                f"{card.place}: {card[0]} copies a card, but none is before it; write it out"
            )
        if not repeated:
            pattern = card
        count = (
            int(repeated[1])
            if repeated and len(repeated[1]) < 9
            else 1
            if not repeated
            else _MOST + 1
        )
        if count > _MOST:
            raise Damaged(f"{card.place}: {card[0]} asks for more than {_MOST} copies; correct it")
        assert pattern is not None
        for _ in range(count):
            before = _copy(before, pattern, card.place)
            yield before


def _copy(before: BulkCard, pattern: BulkCard, place: str) -> BulkCard:
    """A card by that before it: = the same field, == all that follow, *(x) the field and x more."""
    made = BulkCard([before[0]])
    made.place = place
    last = max(i for i, word in enumerate(pattern) if word)
    while len(made) < len(pattern):
        i = len(made)
        word = pattern[i]
        if word == "==":
            end = len(before) if i == last else i + 8 - (i - 1) % 8
            made += before[i:end]
            if i == last:
                break
        elif word == "=":
            made.append(before.at(i))
        elif word.startswith("*"):
            made.append(_more(before.at(i), word.lstrip("*").strip("()"), place))
        else:
            made.append(word)
    return made


def _more(text: str, step: str, place: str) -> str:
    """A field and an increment."""
    whole = re.compile(r"[+-]?\d{1,12}")
    try:
        if whole.fullmatch(text or "0") and whole.fullmatch(step):
            return str(int(text or 0) + int(step))
        return repr(number_of(text or "0") + number_of(step)).upper()
    except ValueError:
        raise Damaged(
            f"{place}: *({step}) adds to '{text[:20]}', which is no number; write it out"
        ) from None


def listed(card: BulkCard, first: int, numbering: Numbering | None = None) -> list[int]:
    """Numbers from a place on; A THRU B (BY C) is a range, of the grid points that are there."""
    words = [w for w in card[first:] if w]
    members: list[int] = []
    while words:
        word, *words = words
        if word == "THRU" and members and words and words[0].isdecimal() and len(words[0]) < 10:
            start, end, step = members[-1], int(words[0]), 1
            words = words[1:]
            if words[:1] == ["BY"] and words[1:2] and words[1].isdecimal():
                step, words = max(int(words[1]), 1), words[2:]
            if numbering is None:
                members += range(start + step, min(end, start + 10**8) + 1, step)
                continue
            there = numbering.between(start, end)
            members = [*members[:-1], *there[(there - start) % step == 0].tolist()]
        elif word == "THRU":
            raise Damaged(f"{card.where} holds THRU without its ends")
        elif word.isdecimal() and len(word) < 13:
            members.append(int(word))
        else:
            raise Damaged(f"{card.where} holds '{word[:20]}' where the number of a point belongs")
    return members
