"""What the first solve changes in the process that calls it; importing the package changes nothing.

jax computes in single precision, compiles with all threads and forgets what it compiled, unless it is told otherwise.
Contact forces are differences of large numbers, and a study has a hundred small programs.
"""

from __future__ import annotations

import logging
import os
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

from .errors import UserError

SMALL_LOOPS = "--xla_backend_extra_options=xla_cpu_small_while_loop_byte_threshold=4000000"
"""Loops of the contact laws as one program, without a call for every step."""

log = logging.getLogger("microslip")
_done: list[str] = []
_kept: list[Path] = []


def prepare(*, double: bool = True, compiler: bool = True, cache: bool = True) -> tuple[str, ...]:
    """Make jax ready, once: the first solve does, unless it was called before, with less if so asked.

    What it does is told to the logger ``microslip`` (level INFO) too.

    Args:
        double: 64 bit in all of jax (``jax_enable_x64``). compiler: XLA_FLAGS for short loops and NPROC = 1, one
            thread, unless they say something else; of no effect where jax has computed before. cache: compiled
            programs are kept, see `keep_compiled`.

    Returns:
        A sentence for each change; those of the first call, if this is another one.

    Raises:
        UserError: 64 bit are neither asked for nor there; what is neither true nor false.
    """
    for key, value in (("double", double), ("compiler", compiler), ("cache", cache)):
        if not isinstance(value, bool):
            raise UserError(f"prepare: {key}: must be true or false (it is {value!r}); correct it")
    if _done:
        return tuple(_done)
    if double:
        _done.append(_told("jax_enable_x64", True))
    elif not _known("jax_enable_x64"):
        raise UserError("prepare: double: jax has 32 bit, which are too few; turn jax_enable_x64 on, or leave it out")
    if compiler and "NPROC" not in os.environ:
        os.environ["NPROC"] = "1"  # the steps of contact laws are too short to be shared
        _done.append("NPROC = 1")
    if compiler and "xla_backend_extra_options" not in os.environ.get("XLA_FLAGS", ""):
        os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {SMALL_LOOPS}".strip()
        _done.append(f"XLA_FLAGS with {SMALL_LOOPS}")
    if cache and (folder := keep_compiled()):
        _done.append(f"compiled programs are kept in {folder}")
    for said in _done:
        log.info(said)
    return tuple(_done)


def keep_compiled() -> Path | None:
    """Keep compiled programs in the user's cache folder, so that the next run need not compile them again.

    `$XDG_CACHE_HOME/microslip/jax`, or `~/.cache/microslip/jax`, which stays below half a gigabyte (`forget`). A folder
    that jax was told already (JAX_COMPILATION_CACHE_DIR) is taken, and what takes 10 ms to compile is kept there too,
    unless JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS says otherwise. Without a place to write to nothing is kept and
    nothing is said, and a damaged entry (a process killed while it wrote) is compiled again.
    """
    told = _known("jax_compilation_cache_dir")
    folder = Path(told) if told else _folder()
    if folder is None:
        return None
    if not told:
        _told("jax_compilation_cache_dir", str(folder))
        forget(folder)
    for name, value in (
        ("jax_persistent_cache_min_compile_time_secs", 0.01),  # a study has a hundred small programs
        ("jax_persistent_cache_min_entry_size_bytes", -1),
        ("jax_raise_persistent_cache_errors", False),
    ):
        if name.upper() not in os.environ:
            _told(name, value)
    warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation cache")
    _kept.append(folder)
    return folder


def kept_in() -> Path | None:
    """The folder of compiled programs, None if none are kept."""
    return _kept[-1] if _kept else None


def _folder() -> Path | None:
    try:
        folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "microslip", "jax")
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except (OSError, RuntimeError):
        return None


def _known(name: str) -> Any:
    """A setting of jax."""
    import jax

    return getattr(jax.config, name, None)


def _told(name: str, value: Any) -> str:
    """Set one, if there is such a one."""
    import jax

    if hasattr(jax.config, name):
        jax.config.update(name, value)
    return f"{name} = {value}"


def forget(folder: Path, most: float = 2**29, every: float = 3600.0) -> None:
    """Programs that were not used for longest go where all take more than `most` bytes, until they take half of that.

    Looked at when it is some time (``every``, s) since the last look, which a file says: it takes 0.1 s.
    """
    looked, now = folder / "looked-through", time.time()
    try:
        if looked.exists() and 0 <= now - looked.stat().st_mtime < every:
            return
        looked.touch()
        entries = [(one.stat(), one.path) for one in os.scandir(folder) if one.path != str(looked)]
        left = sum(kept.st_size / kept.st_nlink for kept, _ in entries)  # programs have two names
        if left <= most:
            return
        for kept, path in sorted(entries, key=lambda one: max(one[0].st_atime, one[0].st_mtime)):
            if left <= most / 2:
                return
            Path(path).unlink(missing_ok=True)
            left -= kept.st_size / kept.st_nlink
    except OSError:  # another process looks through it
        return
