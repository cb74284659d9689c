"""A text in the file of a picture, which programs that show it pass over."""

from __future__ import annotations

import struct
import zlib

CURVES = "microslip curves"
"""Key of the curves of a picture, JSON for plotly."""

_SIGNATURE, _END = 8, 12
"""Bytes of the first and of the last part of a PNG file."""


def with_text(png: bytes, key: str, text: str) -> bytes:
    """The PNG file with a compressed text (PNG 1.2, chunk zTXt, section 4.2.3)."""
    body = b"zTXt" + key.encode() + b"\0\0" + zlib.compress(text.encode(), 9)
    chunk = struct.pack(">I", len(body) - 4) + body + struct.pack(">I", zlib.crc32(body))
    return png[:-_END] + chunk + png[-_END:]


def text_in(png: bytes, key: str) -> str:
    """The text of this key; nothing where a PNG file has none, or is none."""
    head, at = b"zTXt" + key.encode() + b"\0\0", _SIGNATURE
    while at + _END <= len(png):
        (size,) = struct.unpack_from(">I", png, at)
        if png[at + 4 :].startswith(head):
            return zlib.decompress(png[at + 4 + len(head) : at + 8 + size]).decode()
        at += _END + size
    return ""
