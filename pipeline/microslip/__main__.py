"""``python -m microslip``."""

from .cli import entry

entry()
