"""Consistent systems of units in which other programs' numbers stand."""

from __future__ import annotations

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
