"""A file of complete records: points of a sweep, each kept the moment it is found.

A record is one write to a file that only grows, so a process killed at any instant leaves whole records and at most
the beginning of one more, which the next run cuts off. Nothing in it is ever trusted to be code.
"""

from __future__ import annotations

import contextlib
import json
import os
import struct
import time
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..data import Array
from ..errors import UserError, in_its_file
from ..files.store import open_to_append, ordinary, refused
from ..interrupts import writing

FORMAT = "microslip-points"
FORMAT_VERSION = "0.1"
_MARK = b"\nMSLP"
_HEAD = struct.Struct("<5sQII")
"""Mark, length of all that follows, length of the part that is text, checksum of both."""

_KINDS = ("f8", "c16", "i8")
_SYNC = 1.0
"""s between two writes that wait for the disk: what a failure of the power may cost. A killed process loses nothing."""

Point = Mapping[str, Any]
"""Names -> numbers, texts, or arrays of numbers. A name may have parts, ``monitors/tip``."""


@dataclass
class Journal:
    """An open journal. `head` says what the points are of; `series` holds them: name -> key -> point. Those whose
    parameters the head names are answers, others what was found on the way to them (`answers`).

    Keys are numbers by which the points of a series are in order: frequencies, or places along a curve.
    """

    path: Path
    head: dict[str, Any]
    series: dict[str, dict[float, dict[str, Any]]]
    _file: int
    _synced: float = field(default=0.0)

    def keep(self, series: str, key: float, point: Point) -> None:
        """Append a point; one that is there already under this key gives way to it.

        Raises:
            UserError: the disk is full, the file's rights were changed.
        """
        self._append({"series": series, "key": float(key)}, point)
        self.series.setdefault(series, {})[float(key)] = dict(point)

    def say(self, head: Mapping[str, Any]) -> None:
        """Change the head: what points are of that will be added."""
        told = json.loads(json.dumps(head))
        if told != self.head:
            self.head = told
            self._append({"format": FORMAT, "format_version": FORMAT_VERSION, "head": told}, {})

    def of(self, series: str) -> dict[float, dict[str, Any]]:
        """Key -> point of a series, in order of the keys."""
        return dict(sorted(self.series.get(series, {}).items()))

    def _append(self, words: dict[str, Any], point: Point) -> None:
        whole = os.fstat(self._file).st_size
        try:
            with writing():
                _write_all(self._file, _packed(words, point))
            if time.monotonic() - self._synced > _SYNC:
                os.fsync(self._file)
                self._synced = time.monotonic()
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(self._file, whole)
            raise refused(self.path, error) from error


def once(
    journal: Journal | None,
    series: str,
    key: float,
    made: Callable[[], Point],
) -> dict[str, Any]:
    """A point that a journal keeps under a key of a series, or that is made now and kept; without a
    journal it is made."""
    if journal is None:
        return dict(made())
    if key not in journal.series.get(series, {}):
        journal.keep(series, key, made())
    return journal.series[series][key]


@contextlib.contextmanager
def open_journal(path: Path | str, inputs: str, head: Mapping[str, Any], fresh: bool = False) -> Iterator[Journal]:
    """A journal to add points to, with the points it holds of the same inputs. One process at a time (`store.making`).

    Args:
        inputs: hash of all that the value of a point depends on (not of which points are asked for); a journal of
            other inputs is begun anew. head: what JSON can hold, for readers. fresh: forget what is there.

    Raises:
        UserError: no permission, no space, or no file.
    """
    path = Path(path)
    file = open_to_append(path)
    try:
        journal = None if fresh else _continued(file, path, inputs)
        if journal is None:
            os.ftruncate(file, 0)
            journal = Journal(path, {}, {}, file)
        journal.say({**journal.head, **head, "inputs": inputs})
        yield journal
        os.fsync(file)
    finally:
        os.close(file)


def _continued(file: int, path: Path, inputs: str) -> Journal | None:
    """The journal that is there, its torn end cut off; None if it is empty, foreign or of other inputs."""
    try:
        head, series, end = _parsed(path.read_bytes())
    except UserError:
        return None
    if head.get("inputs") != inputs:
        return None
    os.ftruncate(file, end)
    return Journal(path, head, series, file)


@in_its_file
def read_journal(path: Path | str) -> tuple[dict[str, Any], dict[str, dict[float, dict[str, Any]]]]:
    """Head and series of a journal, also of one that is being written or whose writer was killed.

    Raises:
        UserError: no such file, no journal, or one of another major version.
    """
    try:
        data = ordinary(path).read_bytes()
    except OSError as error:
        raise UserError(f"cannot be read ({error.strerror}); correct the path or its rights") from error
    return _parsed(data)[:2]


def answers(
    head: Mapping[str, Any], series: Mapping[str, dict[float, dict[str, Any]]]
) -> dict[str, dict[float, dict[str, Any]]]:
    """The series whose parameters a head names: without those that hold searches and estimates."""
    return {name: series[name] for name in head.get("parameters", {}) if name in series}


def is_journal(path: Path | str) -> bool:
    """Whether a file begins like a journal."""
    with open(path, "rb") as file:
        return file.read(len(_MARK)) == _MARK


# records -----------------------------------------------------------------------------------------------------------


def _write_all(file: int, data: bytes) -> None:
    view = memoryview(data)
    while view:
        view = view[os.write(file, view) :]


def _packed(words: dict[str, Any], point: Point) -> bytes:
    arrays, layout, plain = [], {}, {}
    for name, value in point.items():
        if isinstance(value, str):
            plain[name] = value
            continue
        array = np.asarray(value)
        kind = "c16" if array.dtype.kind == "c" else "i8" if array.dtype.kind in "iub" else "f8"
        layout[name] = [kind, list(array.shape)]
        arrays.append(np.ascontiguousarray(array, dtype=f"<{kind}").tobytes())
    text = json.dumps({**words, "text": plain, "arrays": layout}).encode()
    body = text + b"".join(arrays)
    return _HEAD.pack(_MARK, len(body), len(text), zlib.crc32(body)) + body


def _parsed(data: bytes) -> tuple[dict[str, Any], dict[str, dict[float, dict[str, Any]]], int]:
    """Head, series, and where the last complete record ends.

    Raises:
        UserError: the first record is not a journal's.
    """
    records, end = _records(data)
    if not records or records[0][0].get("format") != FORMAT:
        raise UserError("is no journal of a response, or its beginning is damaged; run the case again")
    first = records[0][0]
    if str(first.get("format_version")).split(".")[0] != FORMAT_VERSION.split(".")[0]:
        version = first.get("format_version")
        raise UserError(f"has format version {version}, this program reads {FORMAT_VERSION}; run the case again")
    series: dict[str, dict[float, dict[str, Any]]] = {}
    for words, point in records:
        if "head" in words:
            first = words
        else:
            series.setdefault(str(words["series"]), {})[float(words["key"])] = point
    return dict(first["head"]), series, end


def _records(data: bytes) -> tuple[list[tuple[dict[str, Any], dict[str, Any]]], int]:
    """Every record up to the first that is not whole, and where that begins."""
    found, at = [], 0
    while at + _HEAD.size <= len(data):
        mark, length, text, check = _HEAD.unpack_from(data, at)
        body = data[at + _HEAD.size : at + _HEAD.size + length]
        if mark != _MARK or len(body) < length or text > length or zlib.crc32(body) != check:
            break
        try:
            found.append(_unpacked(body, text))
        except (ValueError, KeyError, TypeError, AttributeError):
            break
        at += _HEAD.size + length
    return found, at


def _unpacked(body: bytes, text: int) -> tuple[dict[str, Any], dict[str, Any]]:
    words = json.loads(body[:text])
    point: dict[str, Any] = dict(words.pop("text"))
    at = text
    for name, (kind, shape) in words.pop("arrays").items():
        if kind not in _KINDS or any(n < 0 for n in shape):
            raise ValueError("not an array of numbers")
        count = int(np.prod(shape, dtype=object)) if shape else 1
        array: Array = np.frombuffer(body, f"<{kind}", count, at).reshape(shape)
        point[name] = array.copy() if shape else array.reshape(()).item()
        at += array.nbytes
    if "series" in words:
        float(words["key"])
    elif "head" not in words:
        raise KeyError("head")
    return words, point
