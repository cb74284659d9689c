"""A body as a functional mock-up unit: its matrices in its modes, what acts on it and what is read, with names."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ...data import INTERFACE_ROWS, Array, ModalBasis, ModalGroup, Rows
from ...errors import UserError
from ..mat import field_names


@dataclass(frozen=True)
class Row:
    """An input, or what is read.

    Attributes:
        name: ``interface.right.u_n.force``. unit: of its value. said: its original name. row: (m,). rate, rate_unit:
            name and unit of its rate of change, where it is read.
    """

    name: str
    unit: str
    said: str
    row: Array
    rate: str = ""
    rate_unit: str = ""


@dataclass(frozen=True)
class Unit:
    """q'' + C q' + K q = sum of load f, in the modes of the body.

    Attributes:
        nominal: (2 m,) of q and q', what a static newton moves a mode of the body's mean mass by. read: rows of
            displacements, rotations or strains.
    """

    omega: Array
    damping_ratio: Array
    K: Array
    C: Array
    load: tuple[Row, ...]
    read: tuple[Row, ...]
    nominal: Array

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Entries of K and C that are not zero, and the diagonal."""
        i, j = np.nonzero((self.K != 0) | (self.C != 0) | np.eye(len(self.omega), dtype=bool))
        return list(zip(i.tolist(), j.tolist(), strict=True))


def unit_of(basis: ModalBasis, g: ModalGroup) -> Unit:
    """The unit of a group that stands in its modes.

    Raises:
        UserError: there is nothing to act on, or nothing to read.
    """
    faces, gauges = list(_faces(g)), _named("gauge", g.gauges)
    load = [Row(f"{name}.force", {"m": "N", "rad": "N.m"}[unit], said, row) for name, said, row, unit in faces]
    load += [Row(name, unit, said, row) for name, said, row, unit in _named("excitation", g.excitations)]
    read = [
        Row(f"{name}.displacement", unit, said, row, f"{name}.velocity", f"{unit}/s")
        for name, said, row, unit in (*faces, *_named("monitor", g.monitors))
    ]
    read += [Row(name, unit, said, row, f"{name}_rate", "1/s") for name, said, row, unit in gauges]
    if not load or not read:
        raise UserError(
            f"{basis.name}: export --to fmu: there is nothing to {'read' if load else 'act on'}; give the body "
            "[[interfaces]], or [[excitations]] and [[monitors]]"
        )
    pace = np.where(g.omega > 0, g.omega, g.omega[g.omega > 0].min() if g.omega.any() else 1.0)
    nominal = 1 / (np.sqrt(basis.mass or 1.0) * pace**2)
    K = g.K_r if g.N_r is None else g.K_r + g.N_r
    own = basis.damping_source.startswith("matrix")  # else C_r is diagonal but for rounding
    C = (g.C_r if own else np.diag(2 * g.damping_ratio * g.omega)) + g.G_r
    return Unit(g.omega, g.damping_ratio, K, C, tuple(load), tuple(read), np.concatenate([nominal, nominal * pace]))


Named = tuple[str, str, Array, str]
"""Name, original name, row and unit of what it reads."""


def _faces(g: ModalGroup) -> Iterator[Named]:
    for field, (name, face) in zip(field_names(g.interfaces), g.interfaces.items(), strict=True):
        for label in (*INTERFACE_ROWS, *(f"c{i + 1}" for i in range(len(face.characteristic)))):
            unit = "rad" if label.startswith("phi") else "m"
            yield f"interface.{field}.{label}", f"interface {name}, {label}", face.row(label), unit


def _named(kind: str, named: Mapping[str, Rows]) -> Iterator[Named]:
    for field, (name, rows) in zip(field_names(named), named.items(), strict=True):
        for label, text, row in zip(field_names(rows.labels), rows.labels, rows.rows, strict=True):
            yield f"{kind}.{field}.{label}", f"{kind} {name}, {text}", row, rows.unit


def numbers(unit: Unit) -> Iterator[str]:
    """The lines of ``numbers.h``."""
    sizes = {"MODES": len(unit.omega), "INPUTS": len(unit.load), "OUTPUTS": len(unit.read), "PAIRS": len(unit.pairs)}
    yield from (f"#define {name} {size}" for name, size in sizes.items())
    yield f"static const double OMEGA[MODES] = {_braced(unit.omega)};"
    yield f"static const double DAMPING_RATIO[MODES] = {_braced(unit.damping_ratio)};"
    yield f"static const double NOMINAL[2 * MODES] = {_braced(unit.nominal)};"
    yield "static const struct { int i, j; double k, c; } PAIR[PAIRS] = {"
    for i, j in unit.pairs:
        yield f"{{{i}, {j}, {float(unit.K[i, j])!r}, {float(unit.C[i, j])!r}}},"
    yield "};"
    for name, size, rows in (("LOAD", "INPUTS", unit.load), ("READ", "OUTPUTS", unit.read)):
        yield f"static const double {name}[{size}][MODES] = {{"
        yield from (f"{_braced(row.row)}, /* {row.name} */" for row in rows)
        yield "};"


def _braced(values: Iterable[float]) -> str:
    return "{" + ", ".join(repr(float(v)) for v in values) + "}"
