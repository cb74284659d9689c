"""What a case reads, by the names that people and response files have for it."""

from __future__ import annotations

from dataclasses import dataclass

from ..data import ComplexArray
from ..harmonic_balance.checkpoint import array_of, labels
from ..harmonic_balance.readout import measured
from ..results.series import Series
from ..system.assembly import Assembly
from ..units import Quantity


@dataclass(frozen=True)
class Readout:
    """A read-out of an assembly.

    Attributes:
        number: in the assembly. name: like ``blade:tip, x``. array, row: where a response file keeps it.
    """

    number: int
    name: str
    array: str
    row: int
    quantity: Quantity

    @property
    def column(self) -> str:
        """Name of its amplitude in a table of resonances."""
        return self.quantity.column(f"{self.name} amplitude")

    def harmonics(self, series: Series) -> ComplexArray:
        """(f, H + 1) complex amplitudes in a series of a response file."""
        return series.arrays[self.array][:, self.row]


def readouts(a: Assembly) -> list[Readout]:
    """Those of an assembly in its order, each once."""
    found: dict[tuple[str, str], Readout] = {}
    rows = labels(a)
    for i, w in enumerate(a.outputs):
        array = array_of(a, w)
        short = array.split("/", 1)[1]
        name = f"{short}, {w.label.removeprefix('u_')}" if array.startswith("monitors/") else short
        if (array, w.label) not in found:
            found[array, w.label] = Readout(i, name, array, rows[array].index(w.label), measured(a, i))
    return list(found.values())
