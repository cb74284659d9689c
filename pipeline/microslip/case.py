"""case.toml: an assembly of bodies and what is asked of it, and how it is run.

So far one body whose interfaces meet rigid neighbours: through a linear spring and a Jenkins element in closed form, or
through point contacts with a law of the contact room.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from .body import Model, Name, NotNegative, Number, Numbers, Positive, _tuple, load_toml, override, validate
from .compliance import (
    BULK_AND_SURFACE,
    SURFACE,
    Share,
    contact_share,
    facing,
    statics_beside,
    without_bulk,
)
from .coordinates import in_modes
from .data import INTERFACE_ROWS, Array, ModalBasis, ModalGroup, Rows, UserError
from .harmonic_balance import (
    FrequencyResponse,
    JenkinsContact,
    Residual,
    frequency_response,
    refined_peaks,
    stuck_frequencies,
)
from .speed_range import basis_at

if TYPE_CHECKING:
    from .harmonic_balance.patch import Patch


Count = Annotated[int, Field(ge=1, le=1000)]


class ContactSettings(Model):
    """A contact of one interface with a rigid neighbour. Stiffnesses in N/m for the whole patch (book: c_N0, c_R0).

    width (along t1) and height (along t2) in m are the patch's own if not given. includes: which compliance the
    stiffnesses count, that of the surface alone or of bulk and surface (the book's E A / l0); see `compliance`.

    law: ``jenkins``, linear springs and one Jenkins element along `slides_along` in closed form, one harmonic; or point
    contacts that stick, slide in any direction and open, ``smooth`` (a spring that cannot pull) or ``rough`` (3.3, with
    `roughness` R_Z in m). points: how many along t1 and t2.
    """

    interface: Name
    normal_stiffness: Positive
    tangential_stiffness: Positive
    width: Positive | None = None
    height: Positive | None = None
    friction: NotNegative
    slides_along: Literal["t1", "t2"] = "t1"
    includes: Literal["surface", "bulk+surface"] | None = None
    law: Literal["jenkins", "smooth", "rough"] = "jenkins"
    roughness: Positive | None = None
    points: Annotated[tuple[Count, Count], BeforeValidator(_tuple)] | None = None

    @model_validator(mode="after")
    def _belongs_to_the_law(self) -> ContactSettings:
        if (self.law == "rough") != (self.roughness is not None):
            raise ValueError('roughness (R_Z in m) belongs to law = "rough": give both or neither')
        if self.law == "jenkins" and self.points is not None:
            raise ValueError('points belong to law = "smooth" or "rough"; the closed form needs none')
        return self


class Sweep(Model):
    """Frequencies (Hz), linearly spaced, and the normal forces (N) to compare, or ``static``: the modal file's own."""

    start: Positive
    stop: Positive
    points: Annotated[int, Field(ge=2, le=200000)] = 600
    normal_forces: Literal["static"] | Numbers

    @model_validator(mode="after")
    def _rising(self) -> Sweep:
        if self.stop <= self.start:
            raise ValueError("stop must be above start")
        if self.normal_forces != "static" and (not self.normal_forces or min(self.normal_forces) < 0):
            raise ValueError('normal_forces must be one or more numbers, none negative, or "static"')
        return self


class CaseSettings(Model):
    """A whole case.toml.

    harmonics, samples (of a cycle), cycles (marched until the last one counts): of contacts with a law.
    """

    name: Name
    description: str = ""
    body: Name
    speed: Annotated[int, Field(ge=0)] = 0
    speed_rpm: NotNegative | None = None
    excitation: Name
    amplitude: Number = 1.0
    monitor: Name
    direction: Literal["x", "y", "z"] = "x"
    harmonics: Annotated[int, Field(ge=1, le=200)] = 3
    samples: Annotated[int, Field(ge=8, le=100000)] = 64
    cycles: Annotated[int, Field(ge=1, le=1000)] = 2
    contacts: Annotated[tuple[ContactSettings, ...], BeforeValidator(_tuple)]
    sweep: Sweep

    @model_validator(mode="after")
    def _fits_together(self) -> CaseSettings:
        if len({c.law == "jenkins" for c in self.contacts}) > 1:
            raise ValueError('contacts: law = "jenkins" is one harmonic in closed form and cannot stand beside others')
        if self.samples < 4 * self.harmonics:
            raise ValueError(
                f"samples: {self.samples} are too few for {self.harmonics} harmonics; take at least "
                f"{4 * self.harmonics}, better {16 * self.harmonics}"
            )
        return self

    @property
    def has_laws(self) -> bool:
        """Whether the contacts are points with a law, and not the closed form."""
        return any(c.law != "jenkins" for c in self.contacts)


@dataclass(frozen=True)
class CaseResult:
    """Responses by normal force (N), the free response, and the eigenfrequencies with sticking contacts (Hz).

    resonances: normal force -> (frequency in Hz, amplitude in m) of each peak, searched for between the points of the
    sweep. speed: rad/s. remarks: sentences a reader must know.
    """

    settings: CaseSettings
    responses: dict[float, FrequencyResponse]
    free: FrequencyResponse
    stuck: Array
    resonances: dict[float, list[tuple[float, float]]]
    speed: float
    remarks: tuple[str, ...]


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
    if basis.sectors > 1:
        raise UserError(
            f"{path}: body: '{basis.name}' is one of {basis.sectors} cyclic sectors, whose contacts join neighbours; a "
            "case follows one body alone: leave [cyclic] out of its body.toml to study a lone sector"
        )
    stored = _at_speed(settings, basis, path)
    beside = statics_beside(stored, basis.reduction)
    group = in_modes(stored) if beside else stored
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
    forces = _normal_forces(settings, group, path)
    contacts = [_sized(c, group, path) for c in settings.contacts]
    springs, counted = _counted_once(contacts, stored, basis.reduction, path)
    residual = _residual(group, settings, label, basis.reduction, beside)
    sweep = settings.sweep
    frequency = np.linspace(sweep.start, sweep.stop, sweep.points)
    asked = _Asked(group, settings, contacts, springs, force, watch, residual, frequency)
    answer = _by_laws if settings.has_laws else _in_closed_form
    responses, resonances, stuck, remarks = answer(asked, forces, report)
    free = frequency_response(group, [], force, watch, frequency)
    remarks = counted + _between(settings, group) + remarks + _too_coarse(group, settings)
    remarks += _not_converged(responses)
    return CaseResult(settings, responses, free, stuck, resonances, group.speed, tuple(remarks))


@dataclass(frozen=True)
class _Asked:
    """A case with its names looked up: sized contacts, springs along n, t1, t2, modal force and row, Hz."""

    group: ModalGroup
    settings: CaseSettings
    contacts: list[ContactSettings]
    springs: list[Springs]
    force: Array
    watch: Array
    residual: Residual | None
    frequency: Array


_Answer = tuple[dict[float, FrequencyResponse], dict[float, list[tuple[float, float]]], Array, list[str]]


def _in_closed_form(asked: _Asked, forces: tuple[float, ...], report: Callable[[str], None]) -> _Answer:
    """Responses and resonances by normal force, sticking frequencies, remarks: one harmonic, Jenkins elements."""
    responses: dict[float, FrequencyResponse] = {}
    resonances = {}
    a, amplitude = asked, asked.settings.amplitude
    for normal in forces:
        report(f"friction response at a normal force of {normal:g} N")
        pressed = [_contact(c, normal, s) for c, s in zip(a.contacts, a.springs, strict=True)]

        def respond(at: Array, pressed: list[JenkinsContact] = pressed) -> FrequencyResponse:
            return frequency_response(a.group, pressed, a.force, a.watch, at, residual=a.residual, amplitude=amplitude)

        responses[normal] = respond(a.frequency)
        resonances[normal] = refined_peaks(responses[normal], respond)
    closed = [_contact(c, max(forces), s) for c, s in zip(a.contacts, a.springs, strict=True)]
    stuck = stuck_frequencies(a.group, closed, a.residual)
    return responses, resonances, stuck, _lift_off(responses)


def _by_laws(asked: _Asked, forces: tuple[float, ...], report: Callable[[str], None]) -> _Answer:
    """The same with the laws of the contact room and as many harmonics as the case asks for."""
    from .harmonic_balance import response
    from .harmonic_balance.reduced import stuck

    a, s = asked, asked.settings
    patches = tuple(_patch(c, k) for c, k in zip(a.contacts, a.springs, strict=True))
    fine = {"harmonics": s.harmonics, "samples": s.samples, "cycles": s.cycles, "length": _moves_by(a, max(forces))}
    responses: dict[float, FrequencyResponse] = {}
    resonances, frequencies, remarks = {}, np.zeros(0), []
    for normal in forces:
        report(f"friction response at a normal force of {normal:g} N")
        problem = response.of_body(
            a.group, patches, np.full(len(patches), normal), a.force, a.watch, s.amplitude, a.residual, **fine
        )
        limits = np.array([c.friction * normal for c in a.contacts])
        found = response.harmonic_response(problem, a.frequency, limits, report)
        responses[normal], resonances[normal] = found, response.refined_peaks(problem, found)
        remarks += _not_periodic(normal, found.unsteady, s.cycles)
        if normal == max(forces):
            frequencies = stuck(problem.body)
    return responses, resonances, frequencies, remarks


def _patch(c: ContactSettings, springs: Springs) -> Patch:
    """The point contacts of a patch, its stiffnesses shared out evenly (Sextro Eq. (5.2-34))."""
    import jax.numpy as jnp

    from .contact.friction import Coulomb
    from .contact.heights import Polynomial
    from .contact.point_laws import rough_point, smooth_point
    from .contact.series import ContactStiffness
    from .harmonic_balance.patch import Patch, grid

    asked = c.points or (24, 5)
    counts = (asked[0] if c.width else 1, asked[1] if c.height else 1)
    places, areas = grid(c.width or 0.0, c.height or 0.0, counts)
    n, t1, t2 = (k / len(areas) for k in springs)
    stiffness = ContactStiffness(n, (t1, t2), c.includes or BULK_AND_SURFACE, "case.toml")
    friction = Coulomb(jnp.asarray(c.friction, dtype=float))
    if c.law == "smooth":
        return Patch(c.interface, places, areas, smooth_point(stiffness, friction))
    return Patch(c.interface, places, areas, rough_point(stiffness, c.roughness or 0.0, Polynomial(), friction))


def _moves_by(asked: _Asked, normal: float) -> float:
    """About how far the contacts move before they slide, m: the unit of the unknowns."""
    found = [c.friction * normal / k[1] for c, k in zip(asked.contacts, asked.springs, strict=True)]
    return max(*found, 1e-9)


def _not_periodic(normal: float, unsteady: Array, cycles: int) -> list[str]:
    worst = float(unsteady.max(initial=0.0))
    if worst < 1e-3:
        return []
    return [
        f"At F_N = {normal:g} N the sliders were not periodic after {cycles} cycles: contact forces change by up to "
        f"{100 * worst:.2g} % in the next one; raise cycles."
    ]


Springs = tuple[float, float, float]
"""Stiffness of a patch along n, t1 and t2, N/m."""


def _counted_once(
    contacts: list[ContactSettings], group: ModalGroup, reduction: str, path: Path | str
) -> tuple[list[Springs], list[str]]:  # fmt: skip
    """The springs of every contact without the bulk that the basis holds, and what a reader must know of it.

    Raises:
        UserError: a stiffness that is said to count the bulk, but is stiffer than the bulk alone.
    """
    springs, remarks, names = [], [], tuple(c.interface for c in contacts)
    for c in contacts:
        b = facing(group, c.interface, names)
        shares = [contact_share(group, reduction, row, c.interface, b) for row in ("u_n", "u_t1", "u_t2")]
        given = (c.normal_stiffness, c.tangential_stiffness, c.tangential_stiffness)
        kept = given
        if c.includes == BULK_AND_SURFACE:
            kept = _taken_out(c, given, shares, path)
        springs.append(kept)
        remarks.append(_what_is_counted(c, given, kept, shares, reduction))
    return springs, list(dict.fromkeys(r for r in remarks if r))


def _taken_out(c: ContactSettings, given: Springs, shares: list[Share], path: Path | str) -> Springs:
    kept = [without_bulk(k, s) for k, s in zip(given, shares, strict=True)]
    for k, new, s, key in zip(given, kept, shares, ("normal", "tangential", "tangential"), strict=True):
        if not 0 < new < np.inf:
            raise UserError(
                f"{path}: contacts.{c.interface}.{key}_stiffness: {k:g} N/m is said to count the bulk of the body, but "
                f"the bulk alone, which the basis holds, is as soft as {s.contacts / s.beyond:.3g} N/m ({s.label}); "
                f'write includes = "{SURFACE}" if it is the stiffness of the surface, or lower it'
            )
    return (kept[0], kept[1], kept[2])


def _what_is_counted(
    c: ContactSettings, given: Springs, kept: Springs, shares: list[Share], reduction: str
) -> str:  # fmt: skip
    """A sentence where the bulk stands in the basis too, or is added to a law of the surface; else nothing."""
    s = shares[0]
    held = f"the basis ({reduction}) already holds {s.beyond:.4g} m/N of the body's own elasticity there ({s.label})"
    if c.includes == SURFACE and s.left:
        return (
            f"Compliance counted once: the contact stiffness is that of the surface, so {s.left:.4g} m/N of bulk that "
            f"the {reduction} leave out ({s.label}) is added to it from the file."
        )
    most = max(k * s.beyond / s.contacts for k, s in zip(given, shares, strict=True))
    if most < 0.01:  # no reader would see it
        return ""
    if c.includes == BULK_AND_SURFACE:
        new, old = (", ".join(f"{k:.4g}" for k in springs) for springs in (kept, given))
        return f"Compliance counted once: {held}, so the springs along n, t1, t2 become {new} N/m instead of {old} N/m."
    if c.includes is None:
        return (
            f"Compliance may be counted twice: {held}, a spring of {s.contacts / s.beyond:.3g} N/m at each contact. If "
            f"normal_stiffness = {c.normal_stiffness:.3g} N/m counts it too, as E A / l0 of the book does, write "
            f'includes = "{BULK_AND_SURFACE}"; if it is that of the surface alone, write includes = "{SURFACE}".'
        )
    return ""


def _at_speed(settings: CaseSettings, basis: ModalBasis, path: Path | str) -> ModalGroup:
    """The group of a stored speed (`speed`, a number), or of one in rpm, stored or in the body's range."""
    if settings.speed_rpm is not None:
        try:
            return basis_at(basis, settings.speed_rpm).groups[0, 0]
        except UserError as error:
            raise UserError(f"{path}: speed_rpm: {error}") from error
    if (settings.speed, 0) not in basis.groups:
        raise UserError(f"{path}: speed: the modal file of '{basis.name}' has {len(basis.groups)} speeds; count from 0")
    return basis.groups[settings.speed, 0]


def _normal_forces(settings: CaseSettings, group: ModalGroup, path: Path | str) -> tuple[float, ...]:
    """The forces asked for, or the one that the static state at speed has in every contact of the case."""
    asked = settings.sweep.normal_forces
    if not isinstance(asked, str):
        return asked
    found = [_static_force(c.interface, group) for c in settings.contacts]
    missing = [c.interface for c, force in zip(settings.contacts, found, strict=True) if force is None]
    if missing:
        raise UserError(
            f'{path}: sweep.normal_forces: "static", but the modal file has no closure on interface '
            f"'{missing[0]}' or its partner; add [[closures]] to the body or give numbers"
        )
    forces = [force for force in found if force is not None]
    if not forces or max(forces) - min(forces) > 0.01 * max(forces):
        raise UserError(
            f'{path}: sweep.normal_forces: "static" needs contacts that are pressed alike; they have '
            f"{', '.join(f'{force:.4g}' for force in forces) or 'none'} N; give numbers"
        )
    return (forces[0],)


def _static_force(interface: str, group: ModalGroup) -> float | None:
    """Normal force of the closure on an interface, or on the one it faces, N."""
    partner = group.interfaces[interface].partner
    return next((c.normal_force for c in group.contacts.values() if c.interface in {interface, partner} - {""}), None)


def _between(settings: CaseSettings, group: ModalGroup) -> list[str]:
    """A remark where the static normal force is one between two equilibria of a speed range."""
    error = group.checks.get("normal_force_error", 0.0)
    if settings.sweep.normal_forces != "static" or not error:
        return []
    return [f"The static normal force is interpolated between two equilibria of the speed range, to {error:.3g} N."]


def _lift_off(responses: dict[float, FrequencyResponse]) -> list[str]:
    found = []
    for normal, r in responses.items():
        swing = r.normal_swing.max(axis=1, initial=0.0)
        if normal and (open_ := swing > normal).any():
            low, high = r.frequency[open_][[0, -1]]
            found.append(
                f"At F_N = {normal:g} N the normal force would swing by up to {swing.max():.3g} N between {low:.4g} "
                f"and {high:.4g} Hz: the contacts would lift off there, which this stage does not follow."
            )
    return found


def _too_coarse(group: ModalGroup, settings: CaseSettings) -> list[str]:
    """Peaks between the points are searched for, but a step wider than a peak may pass over it altogether."""
    sweep = settings.sweep
    step = (sweep.stop - sweep.start) / (sweep.points - 1)
    elastic = group.omega > 0
    width = 2 * group.damping_ratio[elastic].min(initial=1.0) * sweep.start
    if step > 4 * width:
        return [
            f"The step of {step:.3g} Hz is wide against the half-power width of {width:.3g} Hz at {sweep.start:g} Hz: "
            "narrow resonances may be passed over; raise sweep.points."
        ]
    return []


def _not_converged(responses: dict[float, FrequencyResponse]) -> list[str]:
    return [
        f"At F_N = {normal:g} N {int(np.sum(~r.converged))} of {len(r.frequency)} points did not converge (first at "
        f"{r.frequency[~r.converged][0]:.6g} Hz); change sweep.points a little or the normal force."
        for normal, r in responses.items()
        if not r.converged.all()
    ]


def _sized(c: ContactSettings, group: ModalGroup, path: Path | str) -> ContactSettings:
    """The contact with the extents of its patch; given ones that differ by more than 5 % are refused."""
    b0, h0 = (float(v) for v in group.interfaces[c.interface].extent)
    sizes = {"width": b0, "height": h0}
    for key, own in (("width", b0), ("height", h0)):
        given = getattr(c, key)
        if own == 0:  # a point, of a system by hand: the patch is what the case says
            sizes[key] = given or 0.0
        elif given is not None and abs(given / own - 1) > 0.05:
            raise UserError(
                f"{path}: contacts.{c.interface}.{key}: {given:g} m is not the patch's, which is {own:g} m; "
                "leave it out or correct it (metres)"
            )
    return c.model_copy(update=sizes)


def _residual(
    group: ModalGroup, settings: CaseSettings, label: str, reduction: str, beside: bool
) -> Residual | None:  # fmt: skip
    """Residual flexibility among contacts, excitation and monitor: beside the modes, or for laws of the surface."""
    names = list(group.compliance.labels)
    bring = np.ones(len(names))
    if not beside:
        wanting = [c.interface for c in settings.contacts if c.includes == SURFACE and _leaves(group, c, reduction)]
        if not wanting:
            return None
        counted = tuple(f"interface:{c.interface}:" for c in settings.contacts if c.interface not in wanting)
        bring[[name.startswith(counted) for name in names]] = 0.0
    left = group.compliance.residual * np.outer(bring, bring)
    six = [f"interface:{c.interface}:{row}" for c in settings.contacts for row in INTERFACE_ROWS]
    at = [names.index(row) for row in six]
    force = next(i for i, n in enumerate(names) if n.startswith(f"excitation:{settings.excitation}:"))
    watch = names.index(f"monitor:{settings.monitor}:{label}")
    return Residual(left[np.ix_(at, at)], left[at, force], left[watch, at], float(left[watch, force]))


def _leaves(group: ModalGroup, c: ContactSettings, reduction: str) -> bool:
    """Whether a basis leaves static compliance at a contact, beyond rounding."""
    return any(contact_share(group, reduction, row, c.interface).left for row in INTERFACE_ROWS)


def _row(rows: Any, name: str, path: Path | str, key: str) -> Rows:
    if name not in rows:
        raise UserError(f"{path}: {key}: the modal file has no {key} '{name}'; it has {', '.join(rows) or 'none'}")
    return rows[name]


def _contact(c: ContactSettings, normal: float, springs: Springs | None = None) -> JenkinsContact:
    """Springs of a patch of width b0 along t1 and height h0 along t2 (Sextro Eqs. (5.2-39) to (5.2-41), uniform).

    Args:
        springs: along n, t1, t2 if not those of the settings.
    """
    b2, h2 = (c.width or 0.0) ** 2 / 12, (c.height or 0.0) ** 2 / 12
    cn, c1, c2 = springs or (c.normal_stiffness, c.tangential_stiffness, c.tangential_stiffness)
    six = np.array([cn, c1, c2, c2 * b2 + c1 * h2, cn * h2, cn * b2])
    if normal == 0:
        six = np.zeros(6)
    slider = 1 if c.slides_along == "t1" else 2
    return JenkinsContact(c.interface, six, slider, six[slider], c.friction * normal)
