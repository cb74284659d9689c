"""The checks of a solution: its energy, and the motion of its contacts read from the bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..data import Array, ComplexArray, largest
from ..results.checks import MOTION, Checks, resting, shares, work
from ..series import amplitudes
from ..system.component import Component
from .problem import Problem
from .solver import Point

if TYPE_CHECKING:
    from .response import Operating


def judged(point: Point, checks: Checks) -> Point:
    """A point that is not called converged if it fails its checks."""
    return replace(point, status=checks.failure) if point.converged and checks.failure else point


def checks(problem: Problem, found: Operating) -> Checks:
    """The checks of a solution and what belongs to it."""
    taken = sum(float(work(F, found.relative[name])) for name, F in found.force.items())
    lost = sum(float(c.lost.sum()) for c in found.cycles.values())
    still = sum(float(resting(F, found.relative[name])) for name, F in found.force.items())
    missing, uncounted = shares(found.supplied, found.damped, taken, lost, found.exchanged, still)
    return Checks(float(missing), float(uncounted), _apart(problem, found))


def _apart(problem: Problem, found: Operating) -> float:
    """See `Checks.motion`."""
    away = far = 0.0
    sides: dict[tuple[int, int], tuple[ComplexArray, Array]] = {}
    for m in problem.assembly.components:
        sides |= _moving(problem, m, found)
    for i, contact in enumerate(problem.assembly.contacts):
        G = contact.patch.kinematics
        seen = np.ascontiguousarray(amplitudes(found.relative[contact.name].T).T)
        seen[:, 0] -= contact.offset
        (first, most), (second, other) = sides[i, 0], sides.get((i, 1), (0.0, 0.0))
        away = max(away, largest(G @ (first - second - seen)))
        could = largest(np.abs(G) @ (most + other + np.abs(contact.offset)))
        far = max(far, largest(G @ seen), LEFT / MOTION * could)
    return away / far if far else 0.0


LEFT = 1e-12
"""Of the motion that coordinates as large could make of a contact's sides, and of where it is pressed to, what rounding
may leave of the relative one:
two masses that 1e12 N/m join move alike to twelve digits. Springs of 1e12 and 1e15 N/m leave 1e-14 of it."""


def _moving(
    problem: Problem, component: Component, found: Operating
) -> dict[tuple[int, int], tuple[ComplexArray, Array]]:
    """(contact, side) of a component -> (k, H + 1) its motion there, from its coordinates and the forces on it, and
    (k,) the largest that coordinates of that size could make."""
    a, sides = problem.assembly, problem.assembly.sides(component.name)
    counts = {(i, j): a.contacts[i].patch.count for i, j, _ in sides}
    moved = {at: (np.empty((n, problem.harmonics + 1), complex), np.zeros(n)) for at, n in counts.items()}
    for hs in problem.waves:
        index, q = a.index(hs[0]), np.array([found.q[component.name][h] for h in hs])
        at = component.at(index)
        labels = at.group.compliance.labels
        both = [forces_on(problem, component, h, found, labels) for h in hs] if labels else []
        lossy = 1 - 1j * component.residual_loss if hs[0] and at.loss is not None else 1.0
        forces = np.array([lossy * touched + loaded for touched, loaded in both])
        for i, j, s in sides:
            T = s.motion(at, index, a.blades)
            own, (motion, most) = T @ q.T, moved[i, j]
            np.maximum(most, np.linalg.norm(T, axis=1) * np.linalg.norm(q, axis=1).max(), out=most)
            if s.rows is None and labels:
                own = own + s.frame @ at.residual(s.labels, labels) @ forces.T * s.phase(index, a.blades)
            motion[:, hs] = own
    return moved


def forces_on(
    problem: Problem, component: Component, harmonic: int, found: Operating, labels: Sequence[str]
) -> tuple[ComplexArray, ComplexArray]:
    """(r,) amplitudes of the forces that the contacts and that the loads put on some rows of a component, N and N m.

    From a contact a body gets minus what acts on the first side of it, and what acts on the second side.

    Args:
        labels: of the rows, those of `Compliance.labels`.
    """
    a, index = problem.assembly, problem.assembly.index(harmonic)
    place = {label: i for i, label in enumerate(labels)}
    touched, loaded = np.zeros((2, len(labels)), dtype=complex)
    for i, second, side in a.sides(component.name):
        if side.rows is not None:  # a patch that deforms has no rows of the compliance
            continue
        contact, F = a.contacts[i], found.force[a.contacts[i].name]
        at = amplitudes(F.T)[harmonic] if harmonic else F[:, 0] - contact.preload
        six = np.conj(side.frame.T * side.phase(index, a.blades)) @ at * (1.0 if second else -1.0)
        for label, value in zip(side.labels, six, strict=True):
            if label in place:
                touched[place[label]] += value
    for load in a.loads:
        if load.component == component.name and load.harmonic == harmonic:
            for label, i in place.items():  # none of them for a pressure field, which has no shape beside
                if label.startswith(f"excitation:{load.row}:"):
                    loaded[i] += load.amplitude * (problem.share if harmonic else 1.0)
    return touched, loaded
