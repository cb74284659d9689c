"""The modal file: write, read, check. The layout is documented in ``docs/modal_file.md``."""

from .checks import TOLERANCES, Check, check_basis
from .files import CONVENTIONS, FORMAT, FORMAT_VERSION, open_file, read_basis, write_basis

__all__ = [
    "CONVENTIONS",
    "FORMAT",
    "FORMAT_VERSION",
    "TOLERANCES",
    "Check",
    "check_basis",
    "open_file",
    "read_basis",
    "write_basis",
]
