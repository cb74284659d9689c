"""The checks of a solution: its energy, and the motion of its contacts read from the bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..data import ComplexArray
from ..results.checks import Checks, resting, shares, work
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
    away = largest = 0.0
    each = [_moving(problem, m, found) for m in problem.assembly.components]
    sides: dict[tuple[int, int], ComplexArray] = {key: moved for one in each for key, moved in one.items()}
    for i, contact in enumerate(problem.assembly.contacts):
        G, u = contact.patch.kinematics, found.relative[contact.name]
        seen = np.column_stack([u[:, 0] - contact.offset, u[:, 1::2] - 1j * u[:, 2::2]])
        read = sides[i, 0] - sides.get((i, 1), 0.0)
        away = max(away, float(np.abs(G @ (read - seen)).max(initial=0.0)))
        largest = max(largest, float(np.abs(G @ seen).max(initial=0.0)))
    return away / largest if largest else 0.0


def _moving(problem: Problem, component: Component, found: Operating) -> dict[tuple[int, int], ComplexArray]:
    """(contact, side) of a component -> (k, H + 1) its motion there, from its coordinates and the forces on it."""
    a, sides = problem.assembly, problem.assembly.sides(component.name)
    moved = {(i, j): np.empty((a.contacts[i].patch.count, problem.harmonics + 1), complex) for i, j, _ in sides}
    for hs in problem.waves:
        index, q = a.index(hs[0]), np.array([found.q[component.name][h] for h in hs])
        at = component.at(index)
        labels = at.group.compliance.labels
        both = [forces_on(problem, component, h, found, labels) for h in hs] if labels else []
        lossy = 1 - 1j * component.residual_loss if hs[0] and at.loss is not None else 1.0
        forces = np.array([lossy * touched + loaded for touched, loaded in both])
        for i, j, s in sides:
            own = s.motion(at, index, a.blades) @ q.T
            if s.rows is None and labels:
                own = own + s.frame @ at.residual(s.labels, labels) @ forces.T * s.phase(index, a.blades)
            moved[i, j][:, hs] = own
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
        at = F[:, 0] - contact.preload if harmonic == 0 else F[:, 2 * harmonic - 1] - 1j * F[:, 2 * harmonic]
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
