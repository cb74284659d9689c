"""Cases of one body on the ground with Jenkins elements: one harmonic in closed form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..data import INTERFACE_ROWS, Array
from ..harmonic_balance import (
    FrequencyResponse,
    JenkinsContact,
    Residual,
    frequency_response,
    refined_peaks,
    stuck_resonances,
)
from ..harmonic_balance.readout import measured
from ..harmonic_balance.sweeps import hidden
from .assemble import Built
from .counting import Springs
from .settings import ContactSettings

Answer = tuple[dict[float, FrequencyResponse], dict[float, list[tuple[float, float]]], tuple[Array, Array], list[str]]


def in_closed_form(
    built: Built, forces: tuple[float, ...], frequency: Array, report: Callable[[str], None],
    at_peaks: dict[float, FrequencyResponse],
) -> Answer:  # fmt: skip
    """Responses and resonances by normal force, sticking frequencies and their damping, remarks; fills `at_peaks`."""
    responses: dict[float, FrequencyResponse] = {}
    resonances = {}
    a, member = built.assembly, built.assembly.members[0]
    group, load, watch = member.groups[0], a.loads[0], a.watches[0]
    amplitude = float(load.amplitude.real)
    of = measured(a)
    force = amplitude * group.excitations[load.row].rows[0]
    row = member.at(0).monitor(watch.monitor, watch.label)
    residual = None if member.brings is None else _residual(built)
    for normal in forces:
        report(f"friction response at a normal force of {normal:g} N")
        pressed = [jenkins_contact(c, normal, s) for c, s in zip(built.contacts, built.springs, strict=True)]

        def respond(at: Array, pressed: list[JenkinsContact] = pressed) -> FrequencyResponse:
            found = frequency_response(group, pressed, force, row, at, residual=residual, amplitude=amplitude)
            return replace(found, quantity=of)

        modes = [stuck_resonances(group, *with_) for with_ in ((pressed, residual), ([], None))]
        more = hidden(frequency, *map(np.concatenate, zip(*modes, strict=True)))
        at = np.union1d(frequency, more)
        responses[normal] = replace(respond(at), added=np.isin(at, more))
        resonances[normal] = refined_peaks(responses[normal], respond)
        at_peaks[normal] = respond(np.array([f for f, _ in resonances[normal]]))
    closed = [jenkins_contact(c, max(forces), s) for c, s in zip(built.contacts, built.springs, strict=True)]
    return responses, resonances, stuck_resonances(group, closed, residual), _lift_off(responses)


def _residual(built: Built) -> Residual:
    """Residual flexibility among contacts, excitation and monitor; none of a gauge's, which the modes alone strain."""
    a = built.assembly
    member, load, watched = a.members[0].at(0), a.loads[0], a.watches[0]
    six = [f"interface:{c.interface}:{row}" for c in built.contacts for row in INTERFACE_ROWS]
    force = [n for n in member.group.compliance.labels if n.startswith(f"excitation:{load.row}:")]
    watch = [f"monitor:{watched.monitor}:{watched.label}"]
    return Residual(
        member.residual(six, six), member.residual(six, force)[:, 0], member.residual(watch, six)[0],
        float(member.residual(watch, force)[0, 0]),
    )  # fmt: skip


def _lift_off(responses: dict[float, FrequencyResponse]) -> list[str]:
    found = []
    for normal, r in responses.items():
        swing = r.normal_swing.max(axis=1, initial=0.0)
        if normal and (open_ := swing > normal).any():
            low, high = r.frequency[open_][[0, -1]]
            found.append(
                f"At F_N = {normal:g} N the normal force would swing by up to {swing.max():.3g} N between {low:.4g} "
                f'and {high:.4g} Hz: the contacts would lift off there, which law = "jenkins" does not follow '
                '(dotted in the picture, marked in the table); write law = "smooth" in the contacts.'
            )
    return found


def jenkins_contact(c: ContactSettings, normal: float, springs: Springs | None = None) -> JenkinsContact:
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
    return JenkinsContact(c.interface, six, slider, six[slider], c.coefficient * normal)
