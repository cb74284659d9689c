"""Files that are complete or absent, their hashes, and the rule that decides whether a product is up to date.

A product ``X`` may have a sidecar ``X.json`` (``X.record.json``, if it is ``X.json`` itself) with the hash of exactly
the inputs and settings it was made from (key ``inputs``), of the product itself, of every further file that was written
with it (``files``), and with what changes from run to run (time, commit). The product itself holds nothing volatile.
"""

from __future__ import annotations

import contextlib
import errno
import glob
import hashlib
import json
import math
import os
import platform
import re
import stat
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import UserError, in_its_file
from ..interrupts import look, writing

_ODD = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def _odd(path: Path) -> str:
    """What stands under a name, or at the end of a link, if it is neither a file nor nothing."""
    try:
        return _ODD.get(stat.S_IFMT(path.stat().st_mode), "")
    except (OSError, ValueError):  # whoever opens it tells why
        return ""


@in_its_file
def ordinary(path: Path | str) -> Path:
    """The path of something to read, before it is opened: pipes and devices may be waited for without end.

    Raises:
        UserError: something else than a file stands there, or a link leads to it.
    """
    path = Path(path)
    if odd := _odd(path):
        raise UserError(f"is {odd}, not a file; correct the path")
    return path


@contextlib.contextmanager
def complete_or_absent(path: Path | str) -> Iterator[Path]:
    """Yield a temporary path beside `path`; on success it is synced and renamed onto `path`, else removed.

    A process killed at any instant leaves the old file or the new one, and perhaps a hidden temporary one, which
    the next write of the same product removes. A link under the name gives way; what it leads to stays as it is.

    Raises:
        UserError: if the folder is missing, not writable, the disk is full, or something else than a file of this kind
            stands there.
    """
    path = Path(path)
    _refuse_odd(path)
    look()
    with writing():
        temporary: Path | None = None
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            _remove_leftovers(path)
            prefix = f".{path.stem}.{os.getpid()}."
            handle, name = tempfile.mkstemp(dir=path.parent, prefix=prefix, suffix=path.suffix)
            os.close(handle)
            temporary = Path(name)
            yield temporary
            refuse_other(path, kind_of(temporary))
            put_in_place(temporary, path)
            temporary = None
        except OSError as error:
            raise refused(path, error) from error
        finally:
            if temporary is not None:
                with contextlib.suppress(OSError):
                    temporary.unlink(missing_ok=True)


def put_in_place(temporary: Path, path: Path) -> None:
    """Give a whole file, on the same disk, the name of a product."""
    os.chmod(temporary, 0o666 & ~_umask())
    _sync(temporary)
    os.replace(temporary, path)
    _sync(path.parent)


_BEGINS = {
    rb"\x89HDF": "an HDF5 file", rb"\x89PNG": "a PNG picture", rb"GIF8": "a GIF picture",
    rb"PK\x03\x04": "a zip archive", rb"MATLAB 5\.0": "a MATLAB file", rb"<\?xml": "an XML file",
    rb"<!DOCTYPE html": "a page", rb"\$MeshFormat": "a mesh of gmsh", rb"\s*-1\s*\n": "a universal file",
    rb"\*\*": "a file of MBDyn", rb"\$": "bulk data", rb"\d+ nodes, \d+ modes": "a SID",
}  # fmt: skip
"""How a file begins -> what it is; anything else is text, or bytes."""

_UNMARKED = ("text", "bytes", "a page", "a PNG picture", "a GIF picture", "a mesh of gmsh")
_MARK = re.compile(rb"microslip-[a-z-]*[a-z]|microslip table|by microslip|microslip \d|microslip: |modelDescr|\.npy")
"""What tells one kind of the others from another, near their beginning."""


def kind_of(path: Path) -> str:
    """What a file is, by its first bytes: its format, and whether this program wrote it; "" if it is empty."""
    with open(path, "rb") as file:
        head = file.read(4096)
    other = "" if not head else "bytes" if b"\0" in head else "text"
    kind = next((kind for begin, kind in _BEGINS.items() if re.match(begin, head)), other)
    mark = None if kind in ("", *_UNMARKED) else _MARK.search(head)
    return f"{kind} ({mark[0].decode().strip(': ')})" if mark else kind


@in_its_file
def refuse_other(path: Path | str, kind: str) -> None:
    """Refuse to replace a file that is none of a kind (`kind_of`), and no product with a sidecar; an empty one may go.

    Raises:
        UserError: there is one.
    """
    path = Path(path)
    known = path.is_symlink() or sidecar_path(path).is_file()  # a link gives way
    if known or not path.is_file() or not os.access(path, os.R_OK):
        return
    if (there := kind_of(path)) not in ("", kind):
        is_, would = there.split(" (")[0], kind.split(" (")[0]
        words = f"{is_}, not {would}" if is_ != would else f"{is_} of another kind"
        raise UserError(f"is there already and is {words}; give another name or remove it")


@in_its_file
def open_to_append(path: Path | str) -> int:
    """Descriptor of a file that grows, made if it is not there.

    A link under its name, hard or symbolic, gives way to a copy of the file, which stays as it is.

    Raises:
        UserError: no right to, or something else than a file stands there.
    """
    path = Path(path)
    _refuse_odd(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_symlink() or (path.exists() and path.stat().st_nlink > 1):
            data = path.read_bytes() if path.exists() else b""
            with complete_or_absent(path) as temporary:
                temporary.write_bytes(data)
        flags = getattr(os, "O_BINARY", 0) | getattr(os, "O_NOFOLLOW", 0)
        return os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | flags, 0o666)
    except OSError as error:
        raise refused(path, error) from error


@in_its_file
def _refuse_odd(path: Path) -> None:
    if odd := _odd(path):
        raise UserError(f"cannot be written: {odd} has that name; choose another one")


def refused(path: Path, error: OSError) -> UserError:
    """Why a file could not be written, and what to do, in one sentence."""
    reason = os.strerror(error.errno) if error.errno else " ".join(str(error).split())[:120] or "unknown reason"
    remedies = {
        errno.ENOSPC: "free some space or choose another folder",
        errno.EFBIG: "this file system takes no larger file, choose another folder",
        errno.EDQUOT: "free some space or choose another folder",
        errno.EACCES: "choose a folder you may write to",
        errno.EPERM: "choose a folder you may write to",
        errno.EROFS: "choose a folder you may write to",
        errno.EEXIST: "a file stands where its folder should be, choose another one",
        errno.ENOTDIR: "a file stands where its folder should be, choose another one",
    }
    remedy = remedies.get(error.errno or 0, "choose another folder")
    return UserError(f"cannot be written ({reason}); this file was not changed, {remedy}", file=path)


def _remove_leftovers(path: Path) -> None:
    """Remove temporary files of this product whose process is gone (killed, or the power failed).

    A minute's silence is asked for as well, because the process may run on another machine that shares the folder.
    """
    for leftover in path.parent.glob(f".{glob.escape(path.stem)}.*.*{glob.escape(path.suffix)}"):
        owner = leftover.name.removeprefix(f".{path.stem}.").split(".")[0]
        with contextlib.suppress(OSError):
            age = time.time() - leftover.stat().st_mtime
            if owner.isdecimal() and age > 60 and (age > 86400 or not _is_running(int(owner))):
                leftover.unlink(missing_ok=True)


def _is_running(process: int) -> bool:
    if os.name == "nt":  # no harmless signal there: leftovers wait for a day
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True


def _umask() -> int:
    current = os.umask(0)
    os.umask(current)
    return current


def _sync(path: Path) -> None:
    """Flush a file, or a folder's entries, to the disk (folders cannot be opened on Windows)."""
    if path.is_dir() and os.name == "nt":
        return
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def write_text(path: Path | str, text: str) -> None:
    """Write a text file, complete or absent."""
    with complete_or_absent(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path | str, value: Any, **how: Any) -> None:
    """Write `json_text` in lines, complete or absent."""
    write_text(path, json_text(value, indent=1, **how) + "\n")


def json_text(value: Any, **how: Any) -> str:
    """A value as JSON, in which numbers that are not finite are null, which every program can read.

    Args:
        how: for `json.dumps`.
    """
    return json.dumps(_finite(value), allow_nan=False, **how)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def hash_file(path: Path | str) -> str:
    """SHA-256 of a file's bytes, as hexadecimal text."""
    with open(ordinary(path), "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def hash_settings(settings: Any) -> str:
    """SHA-256 of anything that JSON can hold, independent of key order."""
    text = json.dumps(settings, sort_keys=True, separators=(",", ":"), default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def fingerprint(*values: Any) -> str:
    """SHA-256 of values down to the last bit of every number, whatever holds them.

    Args:
        values: arrays (jax arrays too), numbers, texts, None; dataclasses, mappings (in any order) and sequences of
            them, at any depth.

    Raises:
        TypeError: something else, which could hide what changes.
    """
    sha = hashlib.sha256()
    for value in values:
        _add(sha, value)
    return sha.hexdigest()


def _add(sha: Any, value: Any) -> None:
    """Into the hash, each part with its kind and size before it, so that no two values look alike."""
    kind = type(value)
    if is_dataclass(value):
        _add(sha, [f"{kind.__module__}.{kind.__qualname__}"])
        _add(sha, {f.name: getattr(value, f.name) for f in fields(value)})
    elif isinstance(value, Mapping):
        sha.update(f"mapping {len(value)};".encode())
        for key in sorted(value, key=repr):
            _add(sha, key)
            _add(sha, value[key])
    elif isinstance(value, list | tuple):
        sha.update(f"sequence {len(value)};".encode())
        for item in value:
            _add(sha, item)
    elif value is None or isinstance(value, str):
        text = repr(value).encode()
        sha.update(b"text %d;" % len(text) + text)
    else:
        array = np.asarray(value)
        if array.dtype.kind not in "biufcSU":
            raise TypeError(f"{kind.__name__} cannot be told from others of its kind")
        sha.update(f"{array.dtype.str} {array.shape};".encode() + np.ascontiguousarray(array).tobytes())


POLLED = 0.1
"""s between two looks whether another process has ended."""

_MINE: set[Path] = set()
"""Products that this process is making."""


@contextlib.contextmanager
def making(product: Path | str, report: Callable[[str], None] = lambda _: None) -> Iterator[None]:
    """Let one process at a time make a product and what is written with it; another one says so, and waits here.

    The lock is one of the operating system on a hidden file beside the product. It ends with its process, however that
    ends; a file that is left means nothing. Where a folder takes no file or has no locks nobody waits.
    """
    product = Path(product)
    place = product.parent.resolve() / product.name
    if place in _MINE:
        yield
        return
    new = [folder for folder in product.parents if not folder.exists()]
    file = product.with_name(f".{product.name}.lock")
    lock = _locked(file, f"is making {product}", report)
    _MINE.add(place)
    try:
        yield
    finally:
        _MINE.discard(place)
        if lock is not None:
            with contextlib.suppress(OSError):
                file.unlink()
            os.close(lock)
            with contextlib.suppress(OSError):  # as it was, if nothing was made
                for folder in new:
                    folder.rmdir()


def _locked(file: Path, why: str, report: Callable[[str], None]) -> int | None:
    """Descriptor of a locked file, which is waited for, or None where there are no locks."""
    try:
        import fcntl  # noqa: F401

        for _ in range(100):
            with contextlib.suppress(FileNotFoundError):  # whoever had it has removed it, or its folder
                file.parent.mkdir(parents=True, exist_ok=True)
                lock = os.open(file, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
                if _taken(lock, file, why, report):
                    return lock
    except (ImportError, OSError):  # Windows; no right to write here, no locks on this file system
        pass
    return None


def _taken(lock: int, file: Path, why: str, report: Callable[[str], None]) -> bool:
    """Whether an open file, once it is locked, still is the one of that name; else it is closed."""
    import fcntl

    taken = False
    try:
        waits = False
        while True:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if not waits:
                    owner = os.pread(lock, 100, 0).decode(errors="replace") or "a process"
                    report(f"waiting for {owner}, which {why}")
                waits = True
                look()
                time.sleep(POLLED)
        if taken := os.path.samestat(os.fstat(lock), os.stat(file)):
            with contextlib.suppress(OSError):  # a full disk: then nobody is named
                os.ftruncate(lock, 0)
                os.pwrite(lock, f"process {os.getpid()} on {platform.node()}".encode(), 0)
        return taken
    finally:
        if not taken:
            os.close(lock)


def sidecar_path(product: Path | str) -> Path:
    """Where the sidecar of a product stands: ``basis.h5.json``, ``response.record.json`` of ``response.json``."""
    product = Path(product)
    return product.with_name(f"{product.stem}.record.json" if product.suffix == ".json" else f"{product.name}.json")


def nothing_to_do(
    product: Path | str, inputs: Mapping[str, Any], force: bool = False, report: Callable[[str], None] = lambda _: None
) -> bool:
    """Whether a stage has no work to do: `product` and all that was written with it is up to date. Said to `report`.

    Make is told that the product is as new as what it was made from.
    """
    if force or not is_up_to_date(product, inputs):
        return False
    report(f"{product} is up to date")
    with contextlib.suppress(OSError):  # others' products stay as they are, and so does what a link leads to
        if not Path(product).is_symlink():
            os.utime(product)
    return True


def is_up_to_date(product: Path | str, inputs: Mapping[str, Any]) -> bool:
    """True if `product` and the files beside it are what its sidecar describes, and were made from these `inputs` and
    from what was opened besides (`note_product`)."""
    product = Path(product)
    try:
        note = json.loads(ordinary(sidecar_path(product)).read_text())
        made = {product.name: note["product"], **note["files"], **note.get("opened", {})}
        same = note["inputs"] == hash_settings(inputs)
        return same and all(hash_file(product.parent / name) == digest for name, digest in made.items())
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return False


def unfinished(product: Path | str) -> None:
    """Take the sidecar of a product away, before the first of its files is written: a run that ends here is begun anew.
    What it lists is remembered until `clear_former`.

    Raises:
        UserError: no right to.
    """
    product = Path(product)
    try:
        if sidecar_path(product).is_file():
            os.replace(sidecar_path(product), _former(product))
        for name in {sidecar_path(product).name, f"{product.name}.json"}:  # as it was called first
            product.with_name(name).unlink(missing_ok=True)
    except OSError as error:
        raise refused(sidecar_path(product), error) from error


def _former(product: Path) -> Path:
    """Where the sidecar of a product's former making stands while it is made anew."""
    return product.with_name(f".{product.name}.former")


def clear_former(product: Path | str, keep: Iterable[Path] = ()) -> None:
    """Remove what a former making of a product has left, as soon as files of the new one stand beside it: of the files
    that its sidecar listed those which nobody has changed.

    Args:
        keep: files of the new making, and others that stay.
    """
    product, stay = Path(product), {Path(file) for file in keep}
    try:
        note = json.loads(ordinary(_former(product)).read_text())
        listed = {product.name: note["product"], **note["files"]}
    except (OSError, ValueError, KeyError, TypeError):  # none, or not ours
        listed = {}
    for file, digest in ((product.parent / name, digest) for name, digest in listed.items()):
        inside = product.parent in file.parents and ".." not in file.parts
        if inside and file not in stay and file.is_file() and hash_file(file) == digest:
            file.unlink()
    _former(product).unlink(missing_ok=True)


def note_product(
    product: Path | str, inputs: Mapping[str, Any], files: Iterable[Path] = (), opened: Iterable[Path] = (), **more: Any
) -> None:  # fmt: skip
    """Write the sidecar of a finished product: hashes, and what is volatile (UTC time, git commit).

    Args:
        files: written with the product, in its folder or below. opened: read on the way, which `inputs` do not tell.
    """
    product = Path(product)
    note = {
        "inputs": hash_settings(inputs),
        "product": hash_file(product),
        "files": {str(file.relative_to(product.parent)): hash_file(file) for file in sorted(set(files))},
        "opened": {os.path.relpath(file, product.parent.resolve()): hash_file(file) for file in sorted(set(opened))},
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
        **git_state(Path(__file__).parent),
        **more,
    }
    write_json(sidecar_path(product), note, sort_keys=True)


def git_state(folder: Path) -> dict[str, Any]:
    """Commit and whether the tree is dirty, or nothing outside a checkout."""
    try:

        def ask(*words: str) -> str:
            return subprocess.run(
                ["git", "-C", str(folder), *words], capture_output=True, text=True, check=True, timeout=10
            ).stdout.strip()

        return {"commit": ask("rev-parse", "HEAD"), "dirty": bool(ask("status", "--porcelain", "-uno"))}
    except (OSError, subprocess.SubprocessError):
        return {}
