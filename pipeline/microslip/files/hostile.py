"""Files of unknown origin: what they must not hold, and a process of its own in which damaged ones may crash."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import h5py

from ..errors import UserError, in_its_file, of_file
from .hdf5 import seal_state

DAMAGE = (
    OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError, IndexError, OverflowError, MemoryError,
    RecursionError, NotImplementedError,
)  # fmt: skip
"""What h5py and numpy raise on content that is not what it should be."""

_DEPTH, _OBJECTS, _EXPANSION = 12, 200_000, 64


class HostileFile(ValueError):
    """Content that no file of numbers needs and that could harm the reader."""


def short(error: BaseException) -> str:
    """The first line of what went wrong, where it is not that of a file whose end is missing."""
    if "truncated file" in str(error):
        return "its end is missing"
    return " ".join((str(error).splitlines() or ["unreadable"])[0].split())[:120]


@in_its_file
def refuse_damaged(path: Path, code: str, again: str) -> None:
    """Look at a file's seal before HDF5 meets the file.

    A file without a seal, one that another program has written or changed, is first read by a process of its own:
    damaged HDF5 can hang the library or crash it.

    Args:
        code: what reads the file at `path`, see `trial`. again: what to do about a damaged one.

    Raises:
        UserError: damaged, no HDF5 file, or no right to read it.
    """
    try:
        state = seal_state(path)
    except OSError as error:
        raise UserError(f"cannot be read ({error.strerror}); correct the path or its rights") from error
    if state == "broken":
        raise UserError(f"is damaged (its bytes are not those it was sealed with); {again}")
    if not h5py.is_hdf5(path):
        raise UserError(f"is damaged or no HDF5 file; {again}")
    if state == "absent" and (trouble := trial(code, path)):
        raise UserError(f"is damaged (HDF5 {trouble} on it); {again}")


def inspect(file: h5py.File) -> None:
    """Look at every object before any data is read.

    Raises:
        HostileFile: links that leave the file or run in circles, types other than numbers and fixed-length text,
            data held elsewhere, more data than a file of this size can hold.
    """
    allowed = _EXPANSION * max(Path(file.filename).stat().st_size, 1 << 14)
    _inspect_group(file.id, "", (), [allowed, _OBJECTS])


@contextmanager
def reading(path: Path, form: str, version: str, again: str) -> Iterator[h5py.File]:
    """A file of a format and version of our own, looked at before it is read.

    Args:
        version: of its attribute ``format_version``; "" where the format's name says it. again: what to do about
            another one.

    Raises:
        UserError: damaged while it is read, foreign or of another version.
    """
    with of_file(path):
        yield from _read(path, (form, version), again)


def _read(path: Path, wanted: tuple[str, str], again: str) -> Iterator[h5py.File]:
    try:
        with h5py.File(path, "r") as file:
            found = file.attrs.get("format"), file.attrs.get("format_version", file.attrs.get("version", ""))
            if found != wanted:
                said, ours = (" ".join(filter(None, map(str, pair))) for pair in (found, wanted))
                raise UserError(f"is '{said}' and not '{ours}'; {again}")
            inspect(file)
            yield file
    except DAMAGE as error:
        raise UserError(f"is damaged or incomplete ({short(error)}); {again}") from error


def _inspect_group(group: h5py.h5g.GroupID, where: str, above: tuple[Any, ...], budget: list[int]) -> None:
    """By the identifiers of HDF5: objects of h5py, which ask for their file and more, take three times as long."""
    here = h5py.h5o.get_info(group).addr
    if here in above or len(above) > _DEPTH:
        raise HostileFile(f"{where or '/'} contains itself or is nested too deeply")
    for name in group:
        place = f"{where}/{name.decode(errors='backslashreplace')}"
        budget[1] -= 1
        if budget[1] < 0:
            raise HostileFile("there are too many objects")
        if group.links.get_info(name).type != h5py.h5l.TYPE_HARD:
            raise HostileFile(f"{place} is a link to another place")
        item = h5py.h5o.open(group, name)
        if isinstance(item, h5py.h5g.GroupID):
            _inspect_group(item, place, (*above, here), budget)
        elif isinstance(item, h5py.h5d.DatasetID):
            _inspect_dataset(item, place, budget)
        else:
            raise HostileFile(f"{place} is neither group nor dataset")


def _inspect_dataset(item: h5py.h5d.DatasetID, place: str, budget: list[int]) -> None:
    kind, made = item.dtype, item.get_create_plist()
    if kind.base.kind not in "fiuS":
        raise HostileFile(f"{place} holds neither numbers nor fixed-length text")
    if item.shape is None or made.get_layout() == h5py.h5d.VIRTUAL or made.get_external_count():
        raise HostileFile(f"{place} holds no data of its own")
    budget[0] -= math.prod(map(int, item.shape)) * kind.itemsize
    if budget[0] < 0:
        raise HostileFile(f"{place} claims more data than the file can hold")


def read_hdf5(path: Path, action: Callable[[h5py.File], Any]) -> Any:
    """What `action` makes of a file of unknown origin.

    Raises:
        HostileFile: hostile content, no HDF5 file, or damage in whatever way it shows. The text leaves out the file.
    """
    if trouble := tried(path, _READ_ALL):
        raise HostileFile(f"it is damaged (HDF5 {trouble} on it)")
    try:
        with h5py.File(path, "r") as file:
            inspect(file)
            return action(file)
    except HostileFile:
        raise
    except Exception as error:  # HDF5 raises whatever it meets
        raise HostileFile(f"it is damaged or no HDF5 file ({' '.join(str(error).split())[:100]})") from error


def tried(path: Path, code: str) -> str:
    """`trial`, once for each state of a file."""
    return _tried(path.resolve(), code, path.stat().st_mtime_ns, path.stat().st_size)


@cache
def _tried(path: Path, code: str, changed: int, size: int) -> str:
    return trial(code, path)


_READ_ALL = """
import h5py
from microslip.files.hostile import inspect
with h5py.File(path, "r") as file:
    inspect(file)
    file.visititems(lambda name, item: item[()] if isinstance(item, h5py.Dataset) else None)
"""

_GUARD = """
import sys
from pathlib import Path
path, memory, seconds = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
source, code = sys.argv[4], sys.argv[5]
sys.path.insert(0, source)
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
except (ImportError, ValueError, OSError):
    pass  # not on Windows
try:
    exec(code)
except MemoryError:
    sys.exit(7)
except Exception:
    pass
"""


WAITS = 10
"""How many times the processor time that a trial may take it is waited for: others may be at work, or it may sleep."""


def trial(code: str, path: Path, seconds: float = 20.0) -> str:
    """Run `code` on a file (it sees ``path``) in a process of its own, whatever becomes of it.

    Args:
        seconds: of processor time that it may take, beside some for the size of the file.

    Returns:
        Nothing if the process came to an end, with a result or a Python exception; else what happened.
    """
    size = path.stat().st_size
    seconds = math.ceil(seconds + size / 1e7)
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    source = str(Path(__file__).parents[2])
    words = [str(path.resolve()), str((4 << 30) + 100 * size), str(seconds), source, code]
    command = [sys.executable, "-c", _GUARD, *words]
    try:
        done = subprocess.run(command, capture_output=True, env=environment, timeout=WAITS * seconds)
    except subprocess.TimeoutExpired:
        return "does not come to an end"
    if -done.returncode == getattr(signal, "SIGXCPU", None):
        return "does not come to an end"
    return {0: "", 7: "wants too much memory"}.get(done.returncode, "crashes")
