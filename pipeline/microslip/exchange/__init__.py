"""Other programs' formats, one file each: a writer takes a `ModalBasis` and a path, leaves it complete or absent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from ..data import ModalBasis


@dataclass(frozen=True)
class Format:
    """module: here. function: in it. ending: of the file's name if none is asked for. reader: who takes it."""

    module: str
    function: str
    ending: str
    reader: str


WRITERS = {
    "exudyn": Format("exudyn", "write_exudyn", "_exudyn.npz", "Exudyn"),
    "mat": Format("mat", "write_mat", ".mat", "MATLAB, Octave, NLvib"),
    "mbdyn": Format("mbdyn", "write_mbdyn", ".fem", "MBDyn"),
    "mtx": Format("mtx", "write_mtx", "_mtx", "anything: Matrix Market, a folder"),
    "pvd": Format("vtu", "write_pvd", ".pvd", "ParaView: a file a mode"),
    "pyharm": Format("pyharm", "write_pyharm", "_pyharm.mat", "pyHarm"),
    "sid": Format("sid", "write_sid", ".SID_FEM", "multibody programs: standard input data"),
    "uff": Format("uff", "write_uff", ".uff", "test programs: universal file format"),
    "vtu": Format("vtu", "write_vtu", ".vtu", "ParaView"),
}
"""Formats; a module is imported when asked for, because it may need another package."""


def writer(name: str) -> Callable[[ModalBasis, Path], None]:
    """The writer of a format, a key of `WRITERS`."""
    chosen = WRITERS[name]
    return getattr(import_module(f"{__name__}.{chosen.module}"), chosen.function)


def to_xarray(basis: ModalBasis) -> Any:
    """The basis as an `xarray.DataTree` with named axes, see `labelled.to_xarray`."""
    from .labelled import to_xarray as convert

    return convert(basis)
