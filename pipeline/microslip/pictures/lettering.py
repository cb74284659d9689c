"""Words, legends, colour bars and sheets around rendered pictures. Pillow and numpy only.

VTK draws the body, this file everything that is read: so letters keep their size, never lie on the body and are
never cut off.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..data import Array
from ..files.png import BODY, with_text
from ..files.store import complete_or_absent

if TYPE_CHECKING:
    from PIL import Image, ImageDraw, ImageFont

    Picture = Image.Image
    Font = ImageFont.FreeTypeFont

INK = (32, 36, 44)
FAINT = (110, 116, 128)
Colour = tuple[int, int, int]


@functools.cache
def font(size: int, bold: bool = False) -> Font:
    """DejaVu Sans as matplotlib brings it."""
    import matplotlib
    from PIL import ImageFont

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(f"{matplotlib.get_data_path()}/fonts/ttf/{name}", size)


def picture(pixels: Array) -> Picture:
    """An image from (h, w, 3) bytes."""
    from PIL import Image

    return Image.fromarray(np.ascontiguousarray(pixels[:, :, :3]))


def blank(width: int, height: int) -> Picture:
    """A white image."""
    from PIL import Image

    return Image.new("RGB", (width, height), "white")


def pen(image: Picture) -> ImageDraw.ImageDraw:
    """Something to draw with."""
    from PIL import ImageDraw

    return ImageDraw.Draw(image)


def wrap(text: str, width: int, face: Font) -> list[str]:
    """Break a text into lines no wider than `width` pixels (single words are never broken)."""
    lines: list[str] = []
    for paragraph in text.split("\n"):
        line = ""
        for word in paragraph.split(" "):
            longer = f"{line} {word}" if line else word
            if line and face.getlength(longer) > width:
                lines.append(line)
                longer = word
            line = longer
        lines.append(line)
    return lines


def captioned(image: Picture, title: str, note: str = "", size: int = 20) -> Picture:
    """The image under a bold title and above a faint note; both wrapped to the width."""
    margin = size // 2
    heavy, light = font(size, True), font(max(size * 7 // 10, 11))
    room = image.width - 2 * margin
    top, bottom = wrap(title, room, heavy), wrap(note, room, light) if note else []
    high, low = round(1.35 * size), round(1.35 * light.size)
    head, foot = margin + high * len(top), (low * len(bottom) + margin) if bottom else 0
    out = blank(image.width, head + image.height + foot)
    out.paste(image, (0, head))
    draw = pen(out)
    for i, line in enumerate(top):
        draw.text((image.width / 2, margin + i * high), line, INK, heavy, anchor="ma")
    for i, line in enumerate(bottom):
        draw.text((image.width / 2, head + image.height + i * low), line, FAINT, light, anchor="ma")
    return out


def legend(entries: Sequence[tuple[Colour, str]], width: int, size: int = 15) -> Picture:
    """Swatches with names in as many columns as fit into `width`."""
    face = font(size)
    cell = min(round(max((face.getlength(t) for _, t in entries), default=0) + 2.6 * size), width)
    columns = max(1, min(width // cell, len(entries)))
    rows = math.ceil(len(entries) / columns) if entries else 0
    line = round(1.6 * size)
    out = blank(width, rows * line + size // 2)
    draw = pen(out)
    left = (width - columns * cell) // 2
    for number, (colour, text) in enumerate(entries):
        x, y = left + (number // rows) * cell, (number % rows) * line
        draw.rectangle((x, y + 2, x + size, y + 2 + size), colour, INK)
        draw.text((x + 1.5 * size, y + 1), text, INK, face)
    return out


def colour_bar(colours: Array, low: str, high: str, label: str, width: int, size: int = 14) -> Picture:
    """A horizontal bar with its ends and its meaning.

    Args:
        colours: (k, 3) bytes from low to high.
    """
    from PIL import Image

    face = font(size)
    lines = wrap(label, width, face)
    line = round(1.3 * size)
    ends = max(face.getlength(low), face.getlength(high)) + size / 2
    bar = max(round(min(0.7 * width, width - 2 * ends)), 20)
    out = blank(width, round(1.6 * size) + line * len(lines))
    strip = Image.fromarray(colours[None].astype(np.uint8)).resize((bar, size), Image.Resampling.BILINEAR)
    left = (width - bar) // 2
    out.paste(strip, (left, 3))
    draw = pen(out)
    draw.text((left - size / 3, 3 + size / 2), low, INK, face, anchor="rm")
    draw.text((left + bar + size / 3, 3 + size / 2), high, INK, face, anchor="lm")
    for i, text in enumerate(lines):
        draw.text((width / 2, 1.6 * size + i * line), text, INK, face, anchor="ma")
    return out


def stacked(parts: Sequence[Picture], gap: int = 0) -> Picture:
    """Images one above the other, centred."""
    width = max(p.width for p in parts)
    out = blank(width, sum(p.height for p in parts) + gap * (len(parts) - 1))
    y = 0
    for part in parts:
        out.paste(part, ((width - part.width) // 2, y))
        y += part.height + gap
    return out


def side_by_side(parts: Sequence[Picture], gap: int = 12) -> Picture:
    """Images next to each other, aligned at the top."""
    out = blank(sum(p.width for p in parts) + gap * (len(parts) - 1), max(p.height for p in parts))
    x = 0
    for part in parts:
        out.paste(part, (x, 0))
        x += part.width + gap
    return out


def sheet(parts: Sequence[Picture], title: str, note: str = "", shape: float = 1.5, gap: int = 10) -> Picture:
    """Images of one size in rows; width over height comes near `shape` and few places stay empty."""
    w, h = max(p.width for p in parts) + gap, max(p.height for p in parts) + gap
    n = len(parts)

    def cost(columns: int) -> float:
        rows = math.ceil(n / columns)
        return abs(math.log(columns * w / (rows * h) / shape)) + 3 * (rows * columns - n) / n

    columns = min(range(1, n + 1), key=cost)
    rows = math.ceil(n / columns)
    out = blank(columns * w + gap, rows * h)
    for i, part in enumerate(parts):
        out.paste(part, (gap + (i % columns) * w + (w - gap - part.width) // 2, (i // columns) * h))
    return captioned(out, title, note, 24)


def scaled(image: Picture, factor: float) -> Picture:
    """The image resized by a factor."""
    from PIL import Image

    size = max(round(image.width * factor), 1), max(round(image.height * factor), 1)
    return image.resize(size, Image.Resampling.LANCZOS)


def save_png(image: Picture, path: Path, body: str = "") -> Path:
    """Complete or absent. body: what turns on a page in its place, see `turning.turned`."""
    packed = BytesIO()
    image.save(packed, format="PNG", compress_level=6)
    png = packed.getvalue()
    with complete_or_absent(path) as temporary:
        temporary.write_bytes(with_text(png, BODY, body) if body else png)
    return path


MILLISECONDS = 60
"""Of a frame."""


def save_gif(frames: Sequence[Picture], path: Path, colours: int = 160) -> Path:
    """An endless animation, complete or absent; all frames share one palette, with pure white in it, so that nothing
    flickers."""
    from PIL import Image

    strip = stacked([scaled(f, 0.5) for f in (frames[0], frames[len(frames) // 4], frames[len(frames) // 2])])
    palette = strip.quantize(colours, Image.Quantize.MEDIANCUT)
    entries = [*(palette.getpalette() or [])[: 3 * colours], 255, 255, 255]
    flat = [_white_stays(f, f.quantize(palette=palette, dither=Image.Dither.NONE), entries) for f in frames]
    how = {"append_images": flat[1:], "duration": MILLISECONDS, "loop": 0, "optimize": False}
    with complete_or_absent(path) as temporary:
        flat[0].save(temporary, format="GIF", save_all=True, **how)
    return path


def _white_stays(frame: Picture, reduced: Picture, entries: list[int]) -> Picture:
    """The reduced frame with the last palette entry, white, wherever the frame is white."""
    from PIL import Image

    index = np.array(reduced)
    index[(np.asarray(frame) == 255).all(axis=2)] = len(entries) // 3 - 1
    out = Image.fromarray(index, "P")
    out.putpalette(entries)
    return out


def nice(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above `value`."""
    power = 10 ** math.floor(math.log10(value))
    return next(k * power for k in (5, 2, 1) if k * power <= value * (1 + 1e-12))


def length_text(metres: float) -> str:
    """A length in the unit a drawing would use."""
    if metres >= 1.0:
        return f"{metres:g} m"
    return f"{metres * 1e3:g} mm" if metres >= 1e-3 else f"{metres * 1e6:g} µm"
