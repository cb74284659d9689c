"""A text in the file of a picture, which programs that show it pass over."""

from __future__ import annotations

import struct
import zlib
from contextvars import ContextVar
from pathlib import Path

BESIDE: ContextVar[str] = ContextVar("beside", default="")
"""``svg``, ``pdf`` or ``300dpi``: pictures of curves are drawn so too, beside the PNG; nothing else."""

_ENDS = {"svg": ".svg", "pdf": ".pdf", "300dpi": "_300dpi.png"}

CURVES = "microslip curves"
"""Key of the curves of a picture, JSON for plotly."""

BODY = "microslip body"
"""Key of the body of a picture that turns, see `pictures.turning`."""

_PRIVATE = b"msLp"
"""Type of the chunk: not needed to show the picture, private, kept by editors."""

_SIGNATURE, _END = 8, 12
"""Bytes of the first and of the last part of a PNG file."""


def draw_beside(kind: str | None) -> None:
    """Set `BESIDE` from here on."""
    BESIDE.set(kind or "")


def beside(picture: Path) -> list[Path]:
    """The file that is drawn beside a picture, if one is."""
    kind = BESIDE.get()
    return [picture.with_name(f"{picture.stem}{_ENDS[kind]}")] if kind else []


def with_text(png: bytes, key: str, text: str) -> bytes:
    """The PNG file with a compressed text in a private chunk (PNG 1.2, section 3.3; in one of those for texts Pillow
    refuses more than a megabyte, and with it the picture)."""
    body = _PRIVATE + key.encode() + b"\0\0" + zlib.compress(text.encode(), 9)
    chunk = struct.pack(">I", len(body) - 4) + body + struct.pack(">I", zlib.crc32(body))
    return png[:-_END] + chunk + png[-_END:]


def text_in(png: bytes, key: str) -> str:
    """The text of this key; nothing where a PNG file has none, or is none."""
    head, at = _PRIVATE + key.encode() + b"\0\0", _SIGNATURE
    while at + _END <= len(png):
        (size,) = struct.unpack_from(">I", png, at)
        if png[at + 4 :].startswith(head):
            return zlib.decompress(png[at + 4 + len(head) : at + 8 + size]).decode()
        at += _END + size
    return ""
