"""microslip: modal bases of elastic bodies for vibration with friction contacts.

After W. Sextro, Dynamical Contact Problems with Friction, 2nd edition, Springer 2007.

    import microslip as ms

gives the names below; each is loaded when it is first used. `docs/python.md` shows them at work.
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.2.0"

PUBLIC = {
    "errors": "UserError",
    "process": "prepare",
    "basis": "read_basis write_basis sample",
    "results.files": "read_response",
    "time_domain.recorded": "load read_orbits",
    "exchange.labelled": "to_xarray",
    "bodies": "modes assemble stability",
    "system.structure": "structure polynomial jenkins stop friction Element",
    "bifurcation.dynamics": "Dynamics",
    "bifurcation.recorded": "read_bifurcation",
    "analyses": "harmonic_response two_tones follow backbone integrate integrate_many run_up bifurcate mistune",
    "stages.analysing": "analyse",
    "mistuning.scatter": "Scatter",
    "mistuning.identification": "blades_from_modes",
    "mistuning.gauges": "blades_from_gauges",
    "mistuning.weibull": "amplitude_spread",
    "rolling.profiles": "read_profile circle",
    "rolling.ellipse": "ellipses",
    "rolling.kalker": "creep_coefficients",
    "rolling.strips": "creep_forces tractions",
    "rolling.laws": "forces_by_characteristic",
    "rolling.fastsim": "fastsim",
    "rolling.table": "creep_table write_creep_table read_creep_table",
    "rolling.wheelset": "Track Pose patches axle",
    "rolling.contact_table": "contact_table write_contact_table read_contact_table",
}
"""Module -> the names of it that are public."""

_HOME = {name: module for module, names in PUBLIC.items() for name in names.split()}

__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'microslip' has no attribute '{name}'")
    return getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
