"""What else a case may ask: responses over engine orders, speeds or ranges; contact stiffness from a measurement."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from ..contact.friction import OfCoulomb
from ..data import ModalBasis
from ..errors import UserError, in_its_file
from ..harmonic_balance import envelope
from ..harmonic_balance.envelope import Envelope, OverOrders, SpeedResponse
from ..harmonic_balance.identification import (
    IdentifiedStiffness,
    MeasuredFrequency,
    NodalDiagram,
    identify,
    nodal_diagram,
)
from ..harmonic_balance.problem import Problem
from ..progress import Report
from ..results.names import apart
from ..system.assembly import Assembly
from .assemble import Built, build
from .problem import models_of, normal_forces, problem_of
from .settings import BodyOfCase, CaseSettings

Bases = Mapping[str, ModalBasis]


# --- from settings to answers ----------------------------------------------------------------------------------------


def _asked(settings: CaseSettings, key: str) -> Any:
    found = getattr(settings, key)
    if found is None:
        raise UserError(f"is not asked for in this case; add [{key}]", key)
    return found


def _one_force(built: Built, key: str) -> float | None:
    """The one normal force of the sweep; None where it presses nothing."""
    forces = normal_forces(built)
    if len(forces) > 1:
        raise UserError(f"the sweep compares {len(forces)} normal forces; say which is meant", f"{key}.normal_force")
    return forces[0] if forces else None


def at_its_beginning(settings: CaseSettings, bases: Bases, kind: str) -> Built:
    """The case as a survey (``orders``, ``speeds``, or another that changes neither) begins with it."""
    if kind == "orders" and settings.ring is not None and settings.orders is not None:
        orders = settings.orders.engine_orders
        return build(_of_order(settings, 1 if orders == "all" else orders[0]), bases)
    if kind == "speeds" and settings.speeds is not None:
        turning = [b.name for b in settings.components if bases[b.name].ranges]
        return build(_at_speed(settings, turning, settings.speeds.start_rpm), bases)
    return build(settings, bases)


def _of_order(settings: CaseSettings, order: int) -> CaseSettings:
    assert settings.ring is not None
    ring = settings.ring.model_copy(update={"engine_order": order})
    return settings.model_copy(update={"ring": ring})


@in_its_file
def over_orders(
    settings: CaseSettings, bases: Bases, report: Report,
    keep: Callable[[dict[str, OverOrders]], None] = lambda _: None,
) -> dict[str, OverOrders]:  # fmt: skip
    """Normal force in words -> resonances over the engine order.

    Args:
        keep: is given what there is after every engine order.

    Raises:
        UserError: no ring, or excitations that name their own engine orders.
    """
    asked, ring = _asked(settings, "orders"), settings.ring
    if ring is None:
        raise UserError("engine orders need a ring; add [ring] with its blades", "orders")
    if any(x.orders for x in settings.loads):
        raise UserError("excitations name their own engine orders; leave these out, the survey has its", "orders")
    orders = range(1, ring.blades // 2 + 1) if asked.engine_orders == "all" else asked.engine_orders

    @cache
    def at(order: int) -> Built:
        return build(_of_order(settings, order), bases)

    found: dict[str, OverOrders] = {}
    sweep = settings.sweep
    forces = normal_forces(at(orders[0]))
    for normal, told in zip(forces or (None,), apart(forces) or [""], strict=True):
        label = "as pressed" if normal is None else f"$F_N$ = {told} N"
        under = "" if normal is None else f", F_N = {told} N"

        def problem(order: int, normal: float | None = normal) -> Problem:
            return problem_of(at(order), normal)

        band, points = (sweep.start, sweep.stop), asked.points or sweep.points
        pressed = partial(replace, normal_force=np.nan if normal is None else normal)

        def so_far(one: OverOrders, label: str = label, pressed: Callable[..., OverOrders] = pressed) -> None:
            keep({**found, label: pressed(one)})

        found[label] = pressed(envelope.over_orders(problem, list(orders), band, points, report, under, so_far))
    return found


@in_its_file
def over_speeds(
    settings: CaseSettings, bases: Bases, report: Report,
    keep: Callable[[SpeedResponse], None] = lambda _: None,
) -> SpeedResponse:  # fmt: skip
    """The response along the engine-order line of a case. keep: is given what there is after every speed.

    Bodies without a range of speeds are the same at all of them.

    Raises:
        UserError: no engine order, or a speed outside of a body's range.
    """
    asked = _asked(settings, "speeds")
    named = settings.ring is not None and settings.ring.engine_order is not None
    if not named and not any(x.orders for x in settings.loads):
        raise UserError("no engine order is named; give engine_order in the excitations or in [ring]", "speeds")
    turning = [b.name for b in settings.components if bases[b.name].ranges]

    def at(rpm: float) -> Assembly:
        built = build(_at_speed(settings, turning, rpm), bases)
        return built.pressed(_force_at(built, asked.normal_force, rpm))

    rpm = np.linspace(asked.start_rpm, asked.stop_rpm, asked.points)
    order = abs(settings.base_order)
    models = partial(models_of, settings)
    return envelope.along(at, rpm, order, report, keep, models, harmonics=settings.balanced, **settings.marching)


def _at_speed(settings: CaseSettings, turning: list[str], rpm: float) -> CaseSettings:
    """The case at a speed: of bodies whose files know it, of loose ones that it presses, of centrifugal loads."""

    def at(b: BodyOfCase) -> BodyOfCase:
        pressed = {} if b.pressed_at_rpm is None else {"pressed_at_rpm": rpm}
        return b.model_copy(update=pressed | ({"speed_rpm": rpm} if b.name in turning else {}))

    bodies = tuple(map(at, settings.components))
    loads = tuple(x if x.speed_rpm is None else x.model_copy(update={"speed_rpm": rpm}) for x in settings.loads)
    return settings.model_copy(update={"bodies": bodies, "excitations": loads})


def _force_at(built: Built, asked: Any, rpm: float) -> float | None:
    if asked is None:
        return _one_force(built, "speeds")
    if asked == "static":
        return normal_forces(built, "static")[0]
    if isinstance(asked, tuple):
        n, force = np.array(asked).T
        if not n[0] <= rpm <= n[-1]:
            raise UserError(f"is known from {n[0]:g} to {n[-1]:g} rpm, not at {rpm:g} rpm", "speeds.normal_force")
        return float(np.interp(rpm**2, n**2, force))
    return float(asked)


@in_its_file
def over_ranges(
    settings: CaseSettings, bases: Bases, report: Report,
    keep: Callable[[Envelope], None] = lambda _: None,
) -> Envelope:  # fmt: skip
    """The envelope of a case. keep: is given what there is after every combination.

    Raises:
        UserError: friction of a contact whose tables say it.
    """
    asked = _asked(settings, "ranges")
    told = [c.interface for c in settings.contacts if not isinstance(c.friction, OfCoulomb)]
    if asked.friction and told:
        raise UserError(f"the friction of contact '{told[0]}' is no number, or in its file", "ranges.friction")

    @cache
    def at(damping_ratio: float | None, friction: float | None) -> Built:
        changed: dict[str, Any] = {}
        if damping_ratio is not None:
            every = {"damping_ratio": damping_ratio}
            if settings.damping_as == "stuck":
                changed |= every
            else:
                changed["bodies"] = tuple(b.model_copy(update=every) for b in settings.components)
        if friction is not None:
            changed["contacts"] = tuple(
                c.model_copy(update={"friction": OfCoulomb(kind="coulomb", mu=friction)}) for c in settings.contacts
            )
        return build(settings.model_copy(update=changed), bases)

    forces = () if asked.normal_force else (_one_force(at(None, None), "ranges"),)

    def problem(
        damping_ratio: float | None = None, load: float = 1.0, friction: float | None = None,
        normal_force: float | None = forces[0] if forces else None,
    ) -> Problem:  # fmt: skip
        return problem_of(at(damping_ratio, friction), normal_force).loaded(load)

    return envelope.envelope(problem, asked.given, settings.sweep.grid, report, keep)


@in_its_file
def identification(settings: CaseSettings, bases: Bases) -> tuple[IdentifiedStiffness, list[NodalDiagram]]:
    """The contact stiffness that meets a case's measured frequency, and diagrams of rising stiffness with it.

    Raises:
        UserError: a frequency that no stiffness gives, a nodal diameter that the ring or the modal file does not have.
    """
    asked = _asked(settings, "identification")
    a = build(settings, bases).assembly
    most = a.blades // 2
    wrong = [m.nodal_diameter for m in (asked.fit, *asked.measured) if m.nodal_diameter > most]
    if wrong:
        raise UserError(f"nodal diameter {wrong[0]}: the ring has 0 to {most}; correct it", "identification")
    fit, *others = (MeasuredFrequency(m.nodal_diameter, m.frequency, m.mode - 1) for m in (asked.fit, *asked.measured))
    found = identify(a, fit, asked.ratio, others)
    drawn = sorted({*asked.stiffnesses, found.stiffness})
    return found, [nodal_diagram(a, c, asked.ratio, modes=asked.modes) for c in drawn]
