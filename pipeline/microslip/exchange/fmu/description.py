"""``modelDescription.xml`` of a unit, in the order of the value references of ``body.c``."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from ... import __version__
from .unit import Unit

_CAN = {name: "true" for name in ("canGetAndSetFMUstate", "canSerializeFMUstate")}
_BASE = {
    "m": {"m": 1}, "m/s": {"m": 1, "s": -1}, "rad": {"rad": 1}, "rad/s": {"rad": 1, "s": -1}, "1": {}, "1/s": {"s": -1},
    "N": {"kg": 1, "m": 1, "s": -2}, "N.m": {"kg": 1, "m": 2, "s": -2}, "Pa": {"kg": 1, "m": -1, "s": -2},
}  # fmt: skip
"""Unit -> exponents of the base units; others are named and no more."""


def description(unit: Unit, name: str, guid: str, said: str) -> bytes:
    """The file's bytes.

    Args:
        name: identifier of the model. said: what it is, in words.
    """
    root = Element("fmiModelDescription", {
        "fmiVersion": "2.0", "modelName": name, "guid": guid, "description": _line(said), "version": "1",
        "generationTool": f"microslip {__version__}", "variableNamingConvention": "structured",
        "numberOfEventIndicators": "0",
    })  # fmt: skip
    steps = {"canHandleVariableCommunicationStepSize": "true", "canInterpolateInputs": "true"}
    for kind, more in (("ModelExchange", {}), ("CoSimulation", steps)):
        part = SubElement(root, kind, {"modelIdentifier": name, **more, **_CAN})
        SubElement(SubElement(part, "SourceFiles"), "File", {"name": "body.c"})
    _units(root, unit)
    step = output_step(unit)
    span = {"startTime": "0", "stopTime": f"{800 * step:.6g}", "stepSize": f"{step:.6g}"}
    SubElement(root, "DefaultExperiment", span)
    _variables(SubElement(root, "ModelVariables"), unit)
    _structure(SubElement(root, "ModelStructure"), unit)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def output_step(unit: Unit) -> float:
    """Between the outputs of the default experiment, s: a fortieth of the longest period."""
    elastic = unit.omega[unit.omega > 0]
    return 2 * np.pi / elastic.min() / 40 if len(elastic) else 1 / 40


def _line(text: str) -> str:
    """What XML may hold of a text, on one line."""
    return "".join(c for c in " ".join(text.split()) if c.isprintable())


def _units(root: Element, unit: Unit) -> None:
    known = [text for row in (*unit.load, *unit.read) for text in (row.unit, row.rate_unit) if text]
    place = SubElement(root, "UnitDefinitions")
    for text in dict.fromkeys(("1", *known)):
        one = SubElement(place, "Unit", {"name": text})
        if text in _BASE:
            SubElement(one, "BaseUnit", {base: str(n) for base, n in _BASE[text].items()})


def _variables(place: Element, unit: Unit) -> None:
    """q, q', q'', damping ratios, inputs, what is read, its rate."""
    m = len(unit.omega)
    state = [{"start": "0", "nominal": repr(float(v))} for v in unit.nominal]
    for j, w in enumerate(unit.omega):
        _add(place, f"modal.q[{j + 1}]", f"mode of {w / (2 * np.pi):.9g} Hz, kg^(1/2) m", "local exact", **state[j])
    for j in range(m):
        more = {"derivative": str(j + 1), **state[m + j]}
        _add(place, f"modal.v[{j + 1}]", "its rate, kg^(1/2) m/s", "local exact", **more)
    for j in range(m):
        _add(place, f"modal.a[{j + 1}]", "its second derivative", "local calculated", derivative=str(m + j + 1))
    for j, D in enumerate(unit.damping_ratio):
        more = {"unit": "1", "start": repr(float(D))}
        _add(place, f"modal.damping_ratio[{j + 1}]", "D of q'' + 2 D omega q'", "parameter exact", **more)
    for row in unit.load:
        _add(place, row.name, row.said, "input", unit=row.unit, start="0")
    for row in unit.read:
        _add(place, row.name, row.said, "output calculated", unit=row.unit)
    for row in unit.read:
        _add(place, row.rate, f"{row.said}, rate", "output calculated", unit=row.rate_unit)


def _add(place: Element, name: str, said: str, role: str, **real: str) -> None:
    """A variable; its value reference is its place. role: causality, and how it begins."""
    cause, _, initial = role.partition(" ")
    about = {"name": name, "valueReference": str(len(place)), "description": _line(said), "causality": cause}
    about |= {"variability": "tunable" if cause == "parameter" else "continuous"}
    SubElement(SubElement(place, "ScalarVariable", about | ({"initial": initial} if initial else {})), "Real", real)


def _structure(place: Element, unit: Unit) -> None:
    """What depends on what: nothing that is read depends on a force at the same instant."""
    m, p = len(unit.omega), len(unit.read)
    q, inputs = range(1, m + 1), range(4 * m + 1, 4 * m + 1 + len(unit.load))
    v, first = range(m + 1, 2 * m + 1), 4 * m + 1 + len(unit.load)
    outputs = [(first + i, [(q, v)[i >= p][j] for j in np.flatnonzero(unit.read[i % p].row)]) for i in range(2 * p)]
    resisted: list[list[int]] = [[] for _ in q]
    for i, j in unit.pairs:
        resisted[i] += [q[j], v[j]]
    accelerations = [(2 * m + 1 + j, [*sorted(resisted[j]), *inputs]) for j in range(m)]
    _unknowns(place, "Outputs", outputs)
    _unknowns(place, "Derivatives", [*((i, [i]) for i in v), *accelerations])
    _unknowns(place, "InitialUnknowns", sorted([*outputs, *accelerations]))


def _unknowns(place: Element, name: str, unknowns: Sequence[tuple[int, Iterable[int]]]) -> None:
    table = SubElement(place, name)
    for index, known in unknowns:
        SubElement(table, "Unknown", {"index": str(index), "dependencies": " ".join(map(str, known))})
