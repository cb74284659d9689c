"""HDF5 as the modal file uses it: named dimensions, a seal over the whole file, and no trust in foreign content.

Rules found by trial: the layout of HDF5 1.8, which libraries since 2008 read (object headers have checksums, and a
small file takes two thirds of what the older layout takes), no time stamps, no creation order, fixed-length byte
strings (variable-length ones make Octave lose the whole group), a dimension scale on every axis of a dataset or on none
(xarray refuses a mixture).
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO, Literal

import h5py
import numpy as np

from ..interrupts import deferred
from .store import complete_or_absent, refuse_other

_SEAL = b"\nmicroslip seal, sha256 of all bytes before this line: "
ANNOUNCED = 2e7
"""Bytes of a file from which on its size is told before it is written."""
IMAGINARY = "_imag"
"""Ends the name of the dataset that holds the imaginary part of the dataset beside it."""
_SEAL_LENGTH = len(_SEAL) + 64 + 1


# writing ---------------------------------------------------------------------------------------------------------


class _Sink:
    """A binary file for HDF5 that remembers the first failure and swallows what comes after it.

    HDF5 that meets a full disk fails again in every destructor, which Python can only print.
    """

    def __init__(self, file: BinaryIO) -> None:
        self.file = file
        self.error: OSError | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self.file, name)  # read, seek, tell

    def write(self, data: memoryview) -> int:
        self._try(self.file.write, data)
        return len(data)

    def truncate(self, size: int) -> int:
        self._try(self.file.truncate, size)
        return size

    def flush(self) -> None:
        self._try(self.file.flush)

    def _try(self, action: Any, *words: Any) -> None:
        if self.error is None:
            try:
                action(*words)
            except OSError as error:
                self.error = error


@contextlib.contextmanager
def create(path: Path, again: bool = False) -> Iterator[h5py.File]:
    """A new HDF5 file for writing, or one to be changed, without time stamps (h5py 3.15 and newer leave them out of
    groups too).

    Raises:
        OSError: the disk is full or the file too large, once and with its errno.
    """
    with deferred(), open(path, "r+b" if again else "w+b") as raw:
        sink = _Sink(raw)
        try:
            with h5py.File(sink, "r+" if again else "w", libver=("v108", "v110")) as file:
                yield file
        finally:
            if sink.error is not None:
                raise sink.error


@contextlib.contextmanager
def sealed(path: Path | str) -> Iterator[h5py.File]:
    """A new file to be written, complete and sealed or absent.

    Raises:
        UserError: no permission, no space.
    """
    with complete_or_absent(path) as temporary:
        with create(temporary) as file:
            yield file
        seal(temporary)


LARGE = 1 << 16
"""Bytes of a dataset in single precision from which on it is compressed."""
_PACKED: dict[str, Any] = {"compression": "gzip", "compression_opts": 1, "shuffle": True}


def put(
    group: h5py.Group, name: str, data: Any, unit: str = "", dims: tuple[str, ...] = (),
    scales: Sequence[h5py.Dataset] = (),
) -> h5py.Dataset:  # fmt: skip
    """Write a dataset with its unit and its dimensions, named by `dims` or by `scales` (one for every axis).

    Complex numbers become two datasets, the imaginary part under the name with `IMAGINARY` behind it. What is in single
    precision is compressed.
    """
    data = np.asarray(data)
    if np.iscomplexobj(data):
        put(group, name + IMAGINARY, data.imag, unit, dims, scales)
        data = data.real
    if data.dtype.kind == "U":
        data = np.char.encode(data, "utf-8") if data.size else data.astype("S1")
    packed = _PACKED if data.dtype == np.float32 and data.nbytes > LARGE else {}
    dataset = group.create_dataset(name, data=data, track_times=False, **packed)
    if unit:
        dataset.attrs["unit"] = unit
    for i, label in enumerate(dims or [s.name.rsplit("/", 1)[-1] for s in scales]):
        h5py.h5ds.set_label(dataset.id, i, label.encode())  # dataset.dims[i] asks for the shape each time
    for i, scale in enumerate(scales):
        h5py.h5ds.attach_scale(dataset.id, scale.id, i)
    return dataset


def put_scale(group: h5py.Group, name: str, data: Any) -> h5py.Dataset:
    """Write the values along a dimension, which datasets of this group and of those below it may use."""
    scale = put(group, name, data)
    scale.make_scale(name)
    return scale


# the seal --------------------------------------------------------------------------------------------------------


def seal(path: Path) -> None:
    """Append a line with the SHA-256 of the file; HDF5 looks only at what stands before it.

    A program that opens the file for writing drops the line (HDF5 cuts files to the length it knows), so a seal
    proves that nothing has touched the file since it was written; a file without one may still be sound.
    """
    with open(path, "r+b") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        file.seek(0, 2)
        file.write(_SEAL + digest.encode() + b"\n")


def seal_state(path: Path) -> Literal["intact", "broken", "absent"]:
    """Whether the bytes of a file are those it was sealed with."""
    with open(path, "rb") as file:
        size = file.seek(0, 2)
        if size < _SEAL_LENGTH:
            return "absent"
        file.seek(size - _SEAL_LENGTH)
        line = file.read()
        if not line.startswith(_SEAL):
            return "absent"
        file.seek(0)
        digest = hashlib.sha256()
        left = size - _SEAL_LENGTH
        while left and (block := file.read(min(left, 1 << 20))):
            digest.update(block)
            left -= len(block)
    return "intact" if line == _SEAL + digest.hexdigest().encode() + b"\n" else "broken"


def refuse_foreign(path: Path | str, form: str) -> None:
    """Refuse to write, before there is work, where a file stands that is none of a format (its attribute ``format``).

    Raises:
        UserError: there is one.
    """
    refuse_other(path, f"an HDF5 file ({form})")
