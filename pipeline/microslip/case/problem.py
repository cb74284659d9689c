"""The balance of a case, and the normal forces that press its contacts."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..data import ModalGroup
from ..errors import UserError
from ..harmonic_balance import problem as balance
from ..harmonic_balance.book import BookPatch, book_patch
from ..harmonic_balance.problem import Forces, Problem
from ..harmonic_balance.solver import resting
from ..system.assembly import Assembly
from .assemble import Built
from .contacts import swept
from .settings import CaseSettings, ContactSettings


def problem_of(built: Built, normal: float | None, **finer: Any) -> Problem:
    """The balance of a case whose swept contacts a normal force (N) presses. finer: other settings of `problem.of`."""
    return balanced(built.settings, built.pressed(normal), **finer)


def balanced(settings: CaseSettings, assembly: Assembly, **finer: Any) -> Problem:
    """The balance of any assembly as a case asks for it; finer: see `problem_of`."""
    asked: dict[str, Any] = {"harmonics": settings.balanced, **settings.marching}
    return balance.of(assembly, **{**asked, "models": models_of(settings, assembly), **finer})


def models_of(settings: CaseSettings, assembly: Assembly) -> dict[int, Forces] | None:
    """What stands for the laws of the contacts: the book's contact in its mode, else nothing."""
    return dict(book_models(assembly, settings.strips)) if settings.mode == "book" else None


def book_models(assembly: Assembly, strips: int) -> dict[int, BookPatch]:
    """The book's contact for every contact; equal patches share one."""
    made: dict[int, BookPatch] = {}
    for c in assembly.contacts:
        if id(c.patch) not in made:
            made[id(c.patch)] = book_patch(c.patch, strips)
    return {i: made[id(c.patch)] for i, c in enumerate(assembly.contacts)}


def pressed_by(built: Built, problem: Problem) -> float:
    """Normal force (N) in the first contact of the resting assembly, which names a response that no sweep presses.

    Raises:
        NotConverged: no state of rest is found.
    """
    given = [c.normal_force for c in built.contacts if c.normal_force is not None]
    if given or not built.contacts:
        return float(given[0]) if given else 0.0
    point, group = resting(problem, 2 * np.pi * built.settings.sweep.start), problem.groups[0]
    return float(group.force(group.relative(problem.displacement(point.x)), 1.0)[0, 0, 0])


def normal_forces(built: Built, asked: Any = None) -> tuple[float, ...]:
    """The forces asked for, or the one that the static state at speed has in every contact that the sweep presses; none
    where it presses no contact.

    Args:
        asked: ``static``, or the sweep's own if None.

    Raises:
        UserError: a static force that no closure tells, or that differs from contact to contact.
    """
    settings = built.settings
    asked = settings.sweep.normal_forces if asked is None else asked
    contacts = [c for c in settings.contacts if swept(c)]
    if not contacts:
        return ()
    if not isinstance(asked, str):
        return asked or ()
    found = [_static_force(*_first_face(built, c)) for c in contacts]
    missing = [c.interface for c, force in zip(contacts, found, strict=True) if force is None]
    if missing:
        raise UserError(
            f"\"static\", but the modal file has no closure on interface '{missing[0]}' or its partner; add "
            "[[closures]] to the body or give numbers",
            "sweep.normal_forces",
        )
    forces = [force for force in found if force is not None]
    if not forces or max(forces) - min(forces) > 0.01 * max(forces):
        raise UserError(
            '"static" needs contacts that are pressed alike; they have '
            f"{', '.join(f'{force:.4g}' for force in forces) or 'none'} N; give numbers",
            "sweep.normal_forces",
        )
    return (forces[0],)


def forces_of(built: Built, asked: float | None = None) -> list[float | None]:
    """Normal forces (N) of an analysis: the one asked for, else those of the sweep; None: all contacts have their own.

    Raises:
        UserError: one is asked for that presses nothing.
    """
    forces = normal_forces(built)
    if asked is None:
        return [*forces] or [None]
    if not forces:
        raise UserError("presses nothing: all contacts have a force or an interference; leave it out", "normal_force")
    return [asked]


def _first_face(built: Built, c: ContactSettings) -> tuple[str, ModalGroup]:
    body, interface = built.settings.address(c.interface)
    return interface, built.bodies[body].group


def _static_force(interface: str, group: ModalGroup) -> float | None:
    """Normal force of the closure on an interface, or on the one it faces, N."""
    partner = group.interfaces[interface].partner
    return next((c.normal_force for c in group.contacts.values() if c.interface in {interface, partner} - {""}), None)
