"""Named arrays with axes, units and meaning: a table, an HDF5 file, an xarray, from one declaration."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from ..data import Array
from ..errors import UserError
from ..files.hdf5 import IMAGINARY, put, sealed
from ..files.hostile import DAMAGE, reading, refuse_damaged
from ..files.store import ordinary
from ..units import Quantity

FORMAT = "microslip-dataset"
FORMAT_VERSION = "1.0"


class Variable(NamedTuple):
    """An array. Attributes: values. unit: SI, "1" of what has none. holds: what it is. axes: their names."""

    values: Array
    unit: str = "1"
    holds: str = ""
    axes: tuple[str, ...] = ("point",)


@dataclass(frozen=True)
class Dataset:
    """Arrays over shared axes, as rows of a table where there is one axis.

    Attributes:
        kind: what it is of, the name of an analysis. variables: name -> array, of numbers that may be complex, or of
            words. facts: what JSON can hold.
    """

    kind: str
    variables: Mapping[str, Variable]
    facts: Mapping[str, Any] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Array:
        return self.variables[name].values

    def __len__(self) -> int:
        return len(next(iter(self.variables.values())).values)

    def columns(self) -> dict[str, Array]:
        """Name with unit -> values."""
        return {n if v.unit == "1" else Quantity(v.unit).column(n): v.values for n, v in self.variables.items()}

    def to_dataframe(self) -> Any:
        """The table, as a `pandas.DataFrame`."""
        import pandas

        return pandas.DataFrame(self.columns())

    def to_xarray(self) -> Any:
        """An `xarray.Dataset`; units and meanings are attributes."""
        import xarray

        arrays = {
            name: (v.axes, v.values, {"units": v.unit, "long_name": v.holds}) for name, v in self.variables.items()
        }
        return xarray.Dataset(arrays, attrs={"kind": self.kind, **self.facts})

    def save(self, path: Path | str) -> Path:
        """Write a file, complete or absent; `microslip.load` reads it.

        Raises:
            UserError: no permission, no space; another file stands there.
        """
        with sealed(path) as file:
            file.attrs["format"], file.attrs["format_version"] = FORMAT, FORMAT_VERSION
            file.attrs["kind"], file.attrs["facts"] = self.kind, json.dumps(dict(self.facts))
            file.attrs["order"] = json.dumps(list(self.variables))
            for name, v in self.variables.items():
                put(file, name, v.values, v.unit, v.axes).attrs["holds"] = v.holds
        return Path(path)


def is_dataset(path: Path | str) -> bool:
    """Whether a file is one, as far as its head can be read."""
    try:
        with h5py.File(path, "r") as file:
            return bool(file.attrs.get("format") == FORMAT)
    except (OSError, *DAMAGE):
        return False


def read_dataset(path: Path | str) -> Dataset:
    """What `Dataset.save` wrote.

    Raises:
        UserError: missing, damaged, foreign or of another version.
    """
    path = Path(path)
    if not ordinary(path).is_file():
        raise UserError(f"{path}: no such file; save the dataset first or correct the path")
    refuse_damaged(path, "from microslip.results.dataset import _read; _read(path)", "make it again")
    return _read(path)


def _read(path: Path) -> Dataset:
    with reading(path, FORMAT, FORMAT_VERSION, "make it again") as file:
        variables, sizes = {}, dict[str, int]()
        for name in json.loads(file.attrs["order"]):
            array = file[name]
            axes = tuple(dimension.label for dimension in array.dims)
            unit, holds = str(array.attrs["unit"]), str(array.attrs["holds"])
            values = array.asstr()[()].astype(str) if array.dtype.kind == "S" else np.asarray(array[()])
            if name + IMAGINARY in file:
                values = values + 1j * file[name + IMAGINARY][()]
            if any(sizes.setdefault(axis, n) != n for axis, n in zip(axes, values.shape, strict=True)):
                raise ValueError("arrays of different lengths")
            variables[name] = Variable(values, unit, holds, axes)
        return Dataset(str(file.attrs["kind"]), variables, json.loads(file.attrs["facts"]))
