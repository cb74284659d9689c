"""What a page is made of, as plain data, and its HTML by the templates beside this file."""

from __future__ import annotations

import base64
import gzip
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

from ..files.png import BODY, CURVES, text_in


@dataclass(frozen=True)
class Piece:
    """Something on a page, shown by the macro of its kind; a piece with nothing inside is left out.

    Attributes:
        inside: sentences, rows of cells, pieces, a text, or the data of a picture. title: of a fold, the caption of a
            picture. head: of a table. tone: of sentences ("lead", "note", "warn", "bad") or of a picture ("wide").
        name: of a picture; `fixed.html` has captions. curves, body: of a picture, JSON; see
            `pictures.touch` and `pictures.turning`.
    """

    kind: str
    inside: Sequence[Any]
    title: str = ""
    head: Sequence[str] = ()
    tone: str = ""
    name: str = ""
    curves: str = ""
    body: str = ""

    def __bool__(self) -> bool:
        return any(self.inside)


def say(*sentences: str, tone: str = "") -> Piece:
    """Paragraphs."""
    return Piece("words", sentences, tone=tone)


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> Piece:
    """Columns of numbers; without a head, facts and their names."""
    return Piece("table", rows, head=head)


def fold(title: str, *inside: Piece) -> Piece:
    """What unfolds under its title."""
    return Piece("fold", inside, title)


def number(value: float, digits: int = 4) -> str:
    """A number of so many digits; whole ones in full, up to a million."""
    return f"{value:.0f}" if 10**digits <= abs(value) < 1e6 else f"{value:.{digits}g}"


def answer_page(title: str, told: Sequence[str], pictures: Sequence[Path], *rest: Piece) -> str:
    """A page of sentences, those that warn apart, pictures, and what follows."""
    lead, warnings = ([s for s in told if s.startswith("warning") is w] for w in (False, True))
    shown = Album({p.name: p for p in pictures}).begun("")
    pieces = [say(*map(_sentence, lead), tone="lead"), say(*warnings, tone="warn"), *shown, *rest]
    return page(title, [piece for piece in pieces if piece])


def _sentence(words: str) -> str:
    """What has no full stop yet gets one, and a capital letter."""
    return words if words.endswith((".", "!", "?")) else f"{words[:1].upper()}{words[1:]}."


class Album:
    """Pictures by name; each is shown once, what is left at the end was not asked for."""

    def __init__(self, pictures: Mapping[str, Path]) -> None:
        self.left = dict(pictures)

    def take(self, name: str, caption: str = "", tone: str = "") -> Piece:
        """A picture, with nothing inside if there is none of this name."""
        path, data, curves, body = self.left.pop(name, None), "", "", ""
        if path is not None and path.is_file():
            picture = path.read_bytes()
            data = f"data:image/webp;base64,{base64.b64encode(_webp(picture)).decode()}"
            curves, body = (text_in(picture, key).replace("<", "\\u003c") for key in (CURVES, BODY))
        kept = {"curves": curves, "body": body} if _plotly() else {}
        return Piece("figure", data, caption, tone=tone, name=name, **kept)

    def drop(self, *prefixes: str) -> None:
        """Pictures whose names begin so are not shown."""
        self.left = {n: path for n, path in self.left.items() if not n.startswith(prefixes)}

    def begun(self, prefix: str, suffix: str = "", tone: str = "") -> list[Piece]:
        """All pictures whose names begin and end so."""
        return [self.take(n, tone=tone) for n in list(self.left) if n.startswith(prefix) and n.endswith(suffix)]


def _webp(picture: bytes) -> bytes:
    """A PNG or GIF in a third of its bytes: pages are sent by mail."""
    from PIL import Image, ImageSequence

    packed = BytesIO()
    with Image.open(BytesIO(picture)) as opened:
        first, *others = [frame.convert("RGB") for frame in ImageSequence.Iterator(opened)]
        moves = {"save_all": True, "append_images": others, "loop": 0} if others else {}
        step = opened.info.get("duration", 0)
    first.save(packed, "WEBP", quality=80 if others else 90, duration=step, **moves)
    return packed.getvalue()


def page(title: str, pieces: Iterable[Piece], sections: Mapping[str, Sequence[Piece]] | None = None) -> str:
    """The HTML of a page: pieces, then sections with links to them; sections with nothing inside are left out."""
    told = {name: inside for name, inside in (sections or {}).items() if any(inside)}
    text = _templates().get_template("page.html").render(title=title, pieces=pieces, sections=told)
    if 'class="curves"' not in text and 'class="body"' not in text:
        return text
    return text.replace("</body>", _templates().get_template("curves.html").render(program=_plotly()) + "</body>")


@cache
def _plotly() -> str:
    """The program that draws curves in a browser, packed; nothing where the package plotly is not installed."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError:
        return ""
    return base64.b64encode(gzip.compress(get_plotlyjs().encode(), mtime=0)).decode()


@cache
def _templates() -> Any:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    found = Environment(
        loader=FileSystemLoader(Path(__file__).with_name("templates")), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    found.filters["text"] = text
    return found


_POWER = re.compile(r"(?<![\w.])(-?\d+(?:\.\d+)?)e([+-])0*(\d+)(?![\w.])")


def text(value: object) -> str:
    """Escaped HTML; powers of ten of numbers in it are set as such."""
    from markupsafe import Markup, escape

    safe = escape(str(value)).replace(" %", Markup("&nbsp;%")).replace("F_N", Markup("F<sub>N</sub>"))
    return Markup(_POWER.sub(lambda m: f"{m[1]}·10<sup>{m[2].strip('+').replace('-', '−')}{m[3]}</sup>", safe))
