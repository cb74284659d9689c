"""Other programs' formats: a file here, or in a package of one's own, is an exporter."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from ..data import ModalBasis
from ..errors import UserError
from .choice import Format

GROUP = "microslip.exporter"
"""Entry points of other packages, each one a `Format`."""


@cache
def formats() -> dict[str, Format]:
    """Name -> format: of every module here that has ``FORMATS``, and of other packages.

    Raises:
        UserError: an entry point that cannot be loaded, is no `Format` or takes a name that is taken.
    """
    modules = [import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__)]
    found = {f.name: f for module in modules for f in getattr(module, "FORMATS", ())}
    for point in entry_points(group=GROUP):
        try:
            given = point.load()
        except Exception as error:
            raise UserError(f"{GROUP}: {point.value} cannot be loaded ({error}); mend or remove its package") from error
        if not isinstance(given, Format) or given.name in found:
            raise UserError(f"{GROUP}: {point.value} is no microslip.exchange.Format of a new name; mend its package")
        found[given.name] = given
    return dict(sorted(found.items()))


def writer(name: str) -> Callable[[ModalBasis, Path], None]:
    """The writer of a format.

    Raises:
        UserError: there is no such format.
    """
    if name not in formats():
        known = ", ".join(f"{f.name} ({f.reader})" for f in formats().values())
        raise UserError(f"export --to {name}: unknown format; choose one of {known}")
    return formats()[name].write


def to_xarray(basis: ModalBasis) -> Any:
    """The basis as an `xarray.DataTree` with named axes, see `labelled.to_xarray`."""
    from .labelled import to_xarray as convert

    return convert(basis)
