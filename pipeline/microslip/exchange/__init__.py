"""Other programs' formats, one file each: a writer takes a `ModalBasis` and a path, leaves it complete or absent."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from ..data import ModalBasis

WRITERS = {
    "mat": ("mat", "write_mat"),
    "vtu": ("vtu", "write_vtu"),
}
"""Format -> module here and its writer; imported when asked for, because each may need another package."""


def writer(name: str) -> Callable[[ModalBasis, Path], None]:
    """The writer of a format, a key of `WRITERS`."""
    module, function = WRITERS[name]
    return getattr(import_module(f"{__name__}.{module}"), function)
