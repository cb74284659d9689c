"""What a number in a wrong unit looks like: one rule for each quantity, and the likely cause.

A rule gives a sentence, or nothing. It is a remark and refuses nothing: what it doubts may be meant.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from .data import ModalBasis
from .units import percent

DENSITY = 300.0, 25_000.0
"""kg/m3 of wood and of osmium."""
MODULUS = 1e8, 1.3e12
"""Pa of rubber and of diamond."""
EXTENT = 1e-3, 100.0
"""m of a body."""
TRAVEL = 0.05
"""Amplitude over the body's extent up to which displacements are small."""
BENT = 0.01
"""Deflection by a vibrating load that is held still, over the body's extent: in resonance it is ten times as much.
Half of it doubts the same loads of the tests; twice of it lets 20 kN on a bar of 20 x 30 mm pass."""
CARRIED = 1 / 80
"""Pressure or stress over the modulus: hardened steel flows at a hundredth, a patch at 1.6 times that.
Half of it doubts the same of the tests; twice of it lets 5 MN on a rail pass."""
OF_ITS_WEIGHT = 0.1
"""Share of its own weight that a wheel carries at least."""
SOUND = 5000.0
"""m/s, in metals, ceramics and glass; a fifth of it in plastics."""
LOWEST, HIGHEST = 1e-5, 3.0
"""First elastic frequency over that of sound passing the body once: of a wire as long as 3,000 of its diameters, and
twice that of a block held at both ends."""


def density(key: str, value: float, least: float = DENSITY[0]) -> str:
    """kg/m3."""
    if least <= value <= DENSITY[1]:
        return ""
    factor = {1e3: "g/cm3", 1e12: "t/mm3", 1e9: "kg/mm3"}
    return f"{key} = {value:g} kg/m3 is no solid's; SI is kg/m3 (steel 7850){_meant(value, DENSITY, factor)}"


def modulus(key: str, value: float) -> str:
    """Pa."""
    if MODULUS[0] <= value <= MODULUS[1]:
        return ""
    meant = _meant(value, (1e9, MODULUS[1]), {1e6: "MPa", 1e9: "GPa"})
    return f"{key} = {value:g} Pa is no structural solid's; SI is Pa (steel 2.1e11){meant}"


def _meant(value: float, usual: tuple[float, float], factors: Mapping[float, str]) -> str:
    """The unit in which a value would be a usual one."""
    units = [unit for factor, unit in factors.items() if usual[0] <= factor * value <= usual[1]]
    return f"; is it in {' or '.join(units)}?" if units else ""


def extent(value: float, unit: str) -> str:
    """m, of a body whose file says a unit of length."""
    if EXTENT[0] <= value <= EXTENT[1]:
        return ""
    return f'the body is {value:g} m long; is length_unit = "{unit}" right?'


def amplitude(what: str, value: float, of: float) -> str:
    """m, of a vibration of a body `of` that extent, m."""
    if not of > 0 or not value > TRAVEL * of:
        return ""
    return (
        f"{what} moves by {1e3 * value:.3g} mm, {100 * value / of:.2g} % of the {1e3 * of:.3g} mm of its body: beyond "
        "what small displacements describe. Are load (N), modulus (Pa) and damping right?"
    )


def bent(what: str, value: float, of: float) -> str:
    """m, deflection of a body `of` that extent, m, by a load that vibrates, were it held still."""
    if not of > 0 or not value > BENT * of:
        return ""
    return (
        f"{what} under its load held still bends by {1e3 * value:.3g} mm, {percent(value / of)} of "
        f"its {1e3 * of:.3g} mm, and in resonance by many times that. Is the load in N, or the "
        "pressure in Pa, and the modulus in Pa?"
    )


def strain(what: str, value: float) -> str:
    """Of a gauge, 0-peak."""
    if not value > CARRIED:
        return ""
    return (
        f"{what} is strained by {100 * value:.2g} %, more than any metal bears without flowing. Are load (N), modulus "
        "(Pa) and damping right?"
    )


def stress(what: str, value: float, young: float, kind: str = "pressure") -> str:
    """Pa, largest pressure of a contact or stress of a body, of a modulus, Pa."""
    if not young > 0 or not value > CARRIED * young:
        return ""
    return (
        f"{what}: a {kind} of {1e-6 * value:.4g} MPa is {100 * value / young:.2g} % of the modulus, more than any "
        "metal bears without flowing. Are load (N), lengths and modulus (Pa) right?"
    )


def wheel_load(load: float, radius: float) -> str:
    """N on a wheel of a radius, m, that weighs about a disc of steel, a fifth of its radius wide."""
    weight = 9.81 * 7850.0 * np.pi * radius**3 / 5
    if load >= OF_ITS_WEIGHT * weight:
        return ""
    return (
        f"A load of {load:g} N is {100 * load / weight:.2g} % of what a wheel of {radius:g} m weighs itself (about "
        f"{weight:.2g} N); loads are in N, not in kN, and radii in m."
    )


def first_frequency(value: float, extent: float) -> str:
    """Hz, of the first elastic mode of a body of an extent, m."""
    if not value > 0 or not extent > 0:
        return ""
    share = value * extent / SOUND
    if LOWEST <= share <= HIGHEST:
        return ""
    what = "high" if share > HIGHEST else "low"
    return (
        f"the first elastic frequency, {value:.4g} Hz, is too {what} for a body of {extent:.3g} m; are modulus (Pa), "
        "density (kg/m3) and length_unit right?"
    )


def of_basis(basis: ModalBasis, static: Mapping[str, float]) -> list[str]:
    """Of a body's modes, and of the largest stress of its static states: what they are called -> Pa."""
    if not basis.mesh.n_points or _settings(basis).get("material", {}).get("unusual"):
        return []
    size = float(np.ptp(basis.mesh.points, axis=0).max())
    group = basis.groups[min(basis.groups)]
    elastic = group.omega[group.omega > 0]
    told = [first_frequency(float(elastic[0]) / (2 * np.pi), size)] if len(elastic) else []
    young = modulus_of(basis)
    told += [stress(f"The {state}", value, young, "stress") for state, value in static.items()]
    return [text for text in told if text]


def modulus_of(basis: ModalBasis) -> float:
    """Pa, the largest of a body's materials; 0 where its modal file does not tell."""
    if basis.mesh.materials:
        return float(max(1 / np.linalg.inv(m.elasticity)[0, 0] for m in basis.mesh.materials))
    young = _settings(basis).get("material", {}).get("young", 0.0)
    return float(np.max(young)) if isinstance(young, int | float | list) else 0.0


def _settings(basis: ModalBasis) -> Mapping[str, Any]:
    try:
        found = json.loads(basis.provenance.get("settings", "{}"))
    except ValueError:
        return {}
    return found if isinstance(found, dict) and isinstance(found.get("material", {}), dict) else {}
