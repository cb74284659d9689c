"""case.toml: an assembly of bodies and what is asked of it, and how it is run.

So far one body whose interfaces meet rigid neighbours through a linear spring and a Jenkins element; the
harmonic-balance stage grows it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from .body import Model, Name, NotNegative, Number, Numbers, Positive, _tuple, load_toml, override, validate
from .data import Array, ModalBasis, ModalGroup, Rows, UserError
from .harmonic_balance import FrequencyResponse, JenkinsContact, Residual, frequency_response, stuck_frequencies


class ContactSettings(Model):
    """A contact of one interface with a rigid neighbour. Stiffnesses in N/m for the whole patch (book: c_N0, c_R0)."""

    interface: Name
    normal_stiffness: Positive
    tangential_stiffness: Positive
    width: Positive
    height: Positive
    friction: NotNegative
    slides_along: Literal["t1", "t2"] = "t1"


class Sweep(Model):
    """Frequencies (Hz), linearly spaced, and the normal forces (N) to compare."""

    start: Positive
    stop: Positive
    points: Annotated[int, Field(ge=2, le=200000)] = 600
    normal_forces: Numbers

    @model_validator(mode="after")
    def _rising(self) -> Sweep:
        if self.stop <= self.start:
            raise ValueError("stop must be above start")
        if not self.normal_forces or min(self.normal_forces) < 0:
            raise ValueError("normal_forces must be one or more numbers, none negative")
        return self


class CaseSettings(Model):
    """A whole case.toml."""

    name: Name
    description: str = ""
    body: Name
    speed: Annotated[int, Field(ge=0)] = 0
    excitation: Name
    amplitude: Number = 1.0
    monitor: Name
    direction: Literal["x", "y", "z"] = "x"
    contacts: Annotated[tuple[ContactSettings, ...], BeforeValidator(_tuple)]
    sweep: Sweep


@dataclass(frozen=True)
class CaseResult:
    """Responses by normal force (N), the free response, and the eigenfrequencies with sticking contacts (Hz)."""

    settings: CaseSettings
    responses: dict[float, FrequencyResponse]
    free: FrequencyResponse
    stuck: Array


def load_case(path: Path | str, assignments: list[str] | None = None) -> tuple[CaseSettings, dict[str, Any]]:
    """Read and check a case file (SI units).

    Raises:
        UserError: with every mistake named by file and key.
    """
    path = Path(path)
    raw = override(load_toml(path), assignments or [], path)
    return validate(CaseSettings, raw, path), raw


def run_case(
    settings: CaseSettings, basis: ModalBasis, path: Path | str, report: Callable[[str], None] = lambda _: None
) -> CaseResult:
    """Frequency responses at every normal force.

    Raises:
        UserError: names that the modal file does not hold.
    """
    if (settings.speed, 0) not in basis.groups:
        raise UserError(f"{path}: speed: the modal file of '{basis.name}' has {len(basis.groups)} speeds; count from 0")
    group = basis.groups[settings.speed, 0]
    force = settings.amplitude * _row(group.excitations, settings.excitation, path, "excitation").rows[0]
    monitored = _row(group.monitors, settings.monitor, path, "monitor")
    label = f"u_{settings.direction}"
    if label not in monitored.labels:
        known = ", ".join(monitored.labels)
        raise UserError(f"{path}: direction: monitor '{settings.monitor}' reads {known}, not {label}; choose one")
    watch = monitored.rows[monitored.labels.index(label)]
    for c in settings.contacts:
        if c.interface not in group.interfaces:
            raise UserError(
                f"{path}: contacts: the modal file of '{basis.name}' has no interface '{c.interface}'; it has "
                f"{', '.join(group.interfaces) or 'none'}"
            )
    residual = _residual(group, settings, label) if basis.reduction == "macneal" else None
    sweep = settings.sweep
    frequency = np.linspace(sweep.start, sweep.stop, sweep.points)
    responses = {}
    for normal in sweep.normal_forces:
        report(f"friction response at a normal force of {normal:g} N")
        responses[normal] = frequency_response(
            group, [_contact(c, normal) for c in settings.contacts], force, watch, frequency, report, residual,
            settings.amplitude,
        )  # fmt: skip
    free = frequency_response(group, [], force, watch, frequency)
    stuck = stuck_frequencies(group, [_contact(c, max(sweep.normal_forces)) for c in settings.contacts], residual)
    return CaseResult(settings, responses, free, stuck)


def _residual(group: ModalGroup, settings: CaseSettings, label: str) -> Residual:
    """Residual flexibility among the contacts, the excitation and the monitor, from the file's static compliance."""
    names = list(group.compliance.labels)
    left = group.compliance.residual
    at = [i for c in settings.contacts for i, n in enumerate(names) if n.startswith(f"interface:{c.interface}:")]
    force = next(i for i, n in enumerate(names) if n.startswith(f"excitation:{settings.excitation}:"))
    watch = names.index(f"monitor:{settings.monitor}:{label}")
    return Residual(left[np.ix_(at, at)], left[at, force], left[watch, at], float(left[watch, force]))


def _row(rows: Any, name: str, path: Path | str, key: str) -> Rows:
    if name not in rows:
        raise UserError(f"{path}: {key}: the modal file has no {key} '{name}'; it has {', '.join(rows) or 'none'}")
    return rows[name]


def _contact(c: ContactSettings, normal: float) -> JenkinsContact:
    """Springs of a patch of width b0 along t1 and height h0 along t2 (Sextro Eqs. (5.2-39) to (5.2-41), uniform)."""
    b2, h2 = c.width**2 / 12, c.height**2 / 12
    cn, ct = c.normal_stiffness, c.tangential_stiffness
    springs = np.array([cn, ct, ct, ct * (b2 + h2), cn * h2, cn * b2])
    if normal == 0:
        springs = np.zeros(6)
    slider = 1 if c.slides_along == "t1" else 2
    return JenkinsContact(c.interface, springs, slider, ct if normal else 0.0, c.friction * normal)
