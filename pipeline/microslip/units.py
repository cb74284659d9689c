"""Consistent systems of units in which other programs' numbers stand; the units of read-outs, one name for each."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from .data import Array

Speed = TypeVar("Speed", float, Array)

SYSTEMS: dict[str, tuple[float, float, float]] = {
    "m-kg-s": (1.0, 1.0, 1.0),
    "mm-t-s": (1e-3, 1e3, 1.0),
    "mm-kg-ms": (1e-3, 1.0, 1e-3),
    "in-lbf-s": (0.0254, 0.45359237 * 9.80665 / 0.0254, 1.0),
}
"""Name -> its units of length (m), mass (kg) and time (s)."""


def usual_system(length_unit: str) -> str | None:
    """The system that nearly everybody uses with a unit of length, or None."""
    return {"m": "m-kg-s", "mm": "mm-t-s", "in": "in-lbf-s"}.get(length_unit)


def stress(system: str) -> float:
    """Pa of the system's unit of stress."""
    length, mass, time = SYSTEMS[system]
    return mass / length / time**2


def density(system: str) -> float:
    """kg/m3 of the system's unit of density."""
    length, mass, _ = SYSTEMS[system]
    return mass / length**3


def in_si(value: Any, system: str, length: int = 0, mass: int = 0, time: int = 0) -> Any:
    """A number of a system, or an array, in SI: the powers of its units of length, mass and time."""
    return value * np.prod(np.power(SYSTEMS[system], (length, mass, time)))


def to_rpm(speed: Speed) -> Speed:
    """Revolutions per minute of an angular speed, rad/s."""
    return speed * 30 / math.pi


def from_rpm(rpm: Speed) -> Speed:
    """rad/s."""
    return rpm * math.pi / 30


def rpm_text(speed: float) -> str:
    """An angular speed (rad/s) for people: "4500 rpm"."""
    return f"{to_rpm(speed):.6g} rpm"


UNIT_OF_FREQUENCY: ContextVar[str] = ContextVar("unit of frequencies", default="Hz")
"""In which sentences give frequencies: that which a public function was asked for, "Hz" or "rad/s"."""


@contextmanager
def frequencies_in(unit: Any) -> Iterator[None]:
    """Sentences give frequencies in this unit, in the one as before if it is none."""
    before = UNIT_OF_FREQUENCY.set(unit if unit in ("Hz", "rad/s") else UNIT_OF_FREQUENCY.get())
    try:
        yield
    finally:
        UNIT_OF_FREQUENCY.reset(before)


def hertz(frequency: float, unit: str = "") -> str:
    """A frequency (Hz) for people, "80 Hz" or "503 rad/s". unit: `UNIT_OF_FREQUENCY` if empty."""
    unit = unit or UNIT_OF_FREQUENCY.get()
    return f"{frequency * (2 * math.pi if unit == 'rad/s' else 1.0):.6g} {unit}"


def counted(number: int, thing: str) -> str:
    """A number of things: "1 harmonic", "3 harmonics"."""
    return f"{number} {thing}" + ("" if number == 1 else "s")


def percent(share: float) -> str:
    """A share of 1 in percent, two digits: 0.0074 -> "0.74 %", 7.4 -> "740 %"."""
    return f"{float(f'{100 * share:.2g}'):.15g} %"


@dataclass(frozen=True)
class Quantity:
    """What a read-out measures. Attributes: unit: SI, as rows of the modal file name it: "m", "rad", "1" of a strain.

    Numbers stand in it in files and columns; people see them larger, in µm or mm, µrad, µm/m.
    """

    unit: str = "m"

    def column(self, name: str) -> str:
        """Name of a column: ``amplitude`` -> ``amplitude_m``, ``amplitude_rad``, ``amplitude_strain``."""
        return f"{name}_{_COLUMNS.get(self.unit, self.unit).replace('/', '_')}"

    @property
    def said(self) -> str:
        """The unit behind a number: m, rad, m/m."""
        return "m/m" if self.unit == "1" else self.unit

    def sized(self, value: float, digits: int = 4) -> str:
        """A value with the unit in which its number is neither long nor a power of ten: 0.00193 m -> "1.93 mm"."""
        factor, unit = self.scale(value)
        return f"{value * factor:.{digits}g} {unit}"

    def shared(self, values: Iterable[float]) -> tuple[float, str]:
        """Factor and name of the unit of many that stand together: that of the largest, no less than a millionth."""
        return self.scale(max(max((abs(v) for v in values if math.isfinite(v)), default=0.0), 2e-6))

    def scale(self, value: float) -> tuple[float, str]:
        """Factor and name of that unit: 0.00193 m -> (1e3, "mm"). Forces and pressures alone have larger units."""
        least, factor, name = _TAKEN.get(self.unit, (math.inf, 1.0, ""))
        if abs(value) >= least:
            return factor, name
        factors = _PREFIXES[0 if self.unit in ("N", "Pa") else 3 :]
        smallest = (1e9, "n") if self.unit == "J" else (1e6, "µ")
        factor, prefix = next(((f, p) for least, f, p in factors if abs(value) * f >= least), smallest)
        return factor, f"{prefix}{self.said}"


_PREFIXES = (
    (1.0, 1e-9, "G"), (1.0, 1e-6, "M"), (10.0, 1e-3, "k"), (1.0, 1.0, ""), (1.0, 1e3, "m"), (1.0, 1e6, "µ"),
    (1.0, 1e9, "n"),
)  # fmt: skip
"""The smallest number that stands before a unit of this prefix, its factor, and the prefix."""
_TAKEN = {"s": (7200.0, 1 / 3600, "h"), "N/m": (1e5, 1e-6, "N/µm")}
"""Unit -> from which value on the trade takes another one, its factor, and its name."""
_COLUMNS = {"1": "strain"}
METRES = Quantity()


def amplitude_of(row: Mapping[str, Any]) -> tuple[float, Quantity]:
    """The amplitude in a row of a table of resonances, whatever it measures."""
    name = next(key for key in row if key.startswith("amplitude_"))
    unit = name.removeprefix("amplitude_")
    return float(row[name]), Quantity(next((u for u, column in _COLUMNS.items() if column == unit), unit))
