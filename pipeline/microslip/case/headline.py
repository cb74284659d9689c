"""What is said of the largest motion of an answer, whichever analysis found it: whether it looks like a number in a
wrong unit, and by how much the harmonics and samples that are left out would change it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .. import plausible
from ..contact.study import moduli_doubted
from ..data import Array, ModalGroup
from ..harmonic_balance import accuracy
from ..harmonic_balance.accuracy import Error
from ..harmonic_balance.growing import fed, growing
from ..harmonic_balance.problem import Problem
from ..harmonic_balance.readout import measured
from ..modal.stress import outside, von_mises
from ..units import counted, percent
from .assemble import Built
from .contacts import swept
from .messages import method, off
from .settings import CaseSettings

TRUNCATION = 0.01
"""Estimated error by harmonics that are left out, over the amplitude, above which a message is made."""

# numbers in a wrong unit -----------------------------------------------------------------------------------------


def doubted(
    built: Built, largest: float, normal: float | None = None, stress: float = 0.0, in_time: bool = False
) -> list[str]:
    """What grows by itself, and what looks like a number in a wrong unit: an amplitude, a stress, the pressure of
    contacts, and loads by themselves, which may be far from any resonance.

    Args:
        largest: amplitude of the first read-out, in its unit. normal: N, the largest that presses the contacts of the
            sweep. stress: Pa, the largest amplitude in the body that is read. Zero or NaN: not known. in_time: a motion
            in time, which tells itself what friction does between two steps.
    """
    said = (growing if in_time else fed)(built.pressed(normal))
    if built.assembly.outputs:
        read = built.assembly.outputs[0]
        body, unit = built.bodies[read.component], measured(built.assembly).unit
        if unit == "m":
            said.append(plausible.amplitude(f"'{read.monitor}'", largest, body.extent))
        if unit == "1":
            said.append(plausible.strain(f"Gauge '{read.monitor}'", largest))
        said += stressed(built, stress)
    return [text for text in [*said, *_pressures(built, normal), *_loads(built)] if text]


def stressed(built: Built, stress: float) -> list[str]:
    """That no metal bears a stress amplitude, Pa, of the body that is read."""
    name = built.assembly.outputs[0].component
    young = plausible.modulus_of(built.bodies[name].basis)
    said = plausible.stress(name, stress, young, "stress amplitude")
    return [said] if said else []


def _pressures(built: Built, normal: float | None) -> Iterator[str]:
    """Of the contacts under the largest normal force (N), and the moduli of their solids."""
    for c in built.contacts:
        yield from moduli_doubted(f"{c.interface}.", c)
        if c.young is not None:
            yield plausible.modulus(f"{c.interface}.young", c.young)
        body, face = built.settings.ends(c)[0]
        b, force = built.bodies[body], normal if swept(c) else c.normal_force
        area = float(b.group.interfaces[face].areas.sum())
        if force and area > 0 and not c.is_curved:
            yield plausible.stress(f"{c.interface}", force / area, plausible.modulus_of(b.basis))


def _loads(built: Built) -> Iterator[str]:
    """Of the vibrating loads on every body, held still: how far they bend it, and how they stress it."""
    for component in built.assembly.components:
        body = built.bodies[component.name]
        loads = [x for x in built.assembly.loads if x.component == component.name and x.harmonic]
        for harmonic in dict.fromkeys(x.harmonic for x in loads):
            at = component.at(built.assembly.index(harmonic))
            f = sum(np.conj(at.excitation(x.row)) * x.amplitude for x in loads if x.harmonic == harmonic)
            bent = bent_by(at.group, np.conj(f) if at.conjugate else np.asarray(f))
            yield plausible.bent(component.name, bent.distance, body.extent)
            young = plausible.modulus_of(body.basis)
            yield plausible.stress(f"{component.name} under its load held still", bent.stress, young, "stress")


@dataclass(frozen=True)
class Bent:
    """A body under loads that are held still. Attributes: distance: m. stress: Pa, 0 where it is not known."""

    distance: float
    stress: float


def bent_by(group: ModalGroup, force: Array) -> Bent:
    """By its elastic modes alone, V omega^-2 V^H f, whatever holds it or lets it go; stress outside singular zones.

    Args:
        force: (m,) generalised.
    """
    V = np.eye(len(group.M_r)) if group.to_diagonal is None else group.to_diagonal
    elastic = group.omega > 0
    V = V[:, elastic]
    q = V @ ((V.conj().T @ force) / group.omega[elastic] ** 2)
    moved = np.linalg.norm(group.phi @ q, axis=-1).max(initial=0.0) if len(group.phi) else 0.0
    if "nodes" not in group.stresses:
        return Bent(float(moved), 0.0)
    nodes = group.stresses["nodes"]
    sigma = nodes.stress @ q
    values = np.hypot(von_mises(sigma.real), von_mises(sigma.imag))
    values = values[outside(nodes.singular)] if len(nodes.singular) else values
    return Bent(float(moved), float(values.max(initial=0.0)))


# harmonics and samples -------------------------------------------------------------------------------------------


def is_estimated(built: Built, problem: Problem, ring: bool = False) -> bool:
    """Whether what harmonics leave out of a motion is estimated. The book's mode is one harmonic by what it is, and of
    a whole ring its sector says the same: neither is, the latter unless `ring`."""
    settings = built.settings
    whole = settings.ring is not None and settings.ring.model == "full"
    return bool(problem.groups) and settings.mode != "book" and (ring or not whole)


def estimated(built: Built, problem: Problem, x: Array, Omega: float) -> Error | None:
    """Error of the first read-out's amplitude at a solution x (size,), Omega in rad/s; None where none is estimated."""
    return accuracy.error(problem, x, Omega) if is_estimated(built, problem) else None


def uncertain(where: str, e: Error, share: float, likely: float) -> str:
    """That a number is uncertain, by how much, and what would make it less so.

    Args:
        share, likely: of its error, see `Error.over` and `Error.likely`.
    """
    what = "harmonics" if e.by_harmonics > e.by_samples else "samples"
    said = f"mostly for want of {what}, with {counted(e.harmonics, 'harmonic')} and {e.samples} samples; raise {what}"
    said += f" (and samples to {16 * (e.harmonics + 2)} or more)." if what == "harmonics" else "."
    return f"{where} is uncertain by about {off(likely)}, {percent(share)} at most, {said}"


def said_of(settings: CaseSettings, where: str, e: Error | None) -> list[str]:
    """The estimated error of a headline in a sentence, or what the method is known to leave out.

    Args:
        where: what it is the error of, and where it stands. e: None: none was estimated.
    """
    if e is None:
        return [how] if (how := method(settings)) else []
    if not np.isfinite(e.readout):
        return [
            f"{where} is uncertain, nobody knows by how much: with twice the harmonics and samples no solution was "
            "found; raise them."
        ]
    if e.readout > TRUNCATION:
        return [uncertain(where, e, e.readout, e.likely())]
    return [f"{where}: error of harmonics and samples estimated as {percent(e.readout)} at most."]
