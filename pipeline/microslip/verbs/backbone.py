"""Nonlinear mode of a case: frequency and damping over the amplitude, at every normal force."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import partial
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field

from ..analysis import Analysis, Answer, Question
from ..case import headline
from ..case.assemble import Built
from ..case.problem import forces_of, pressed_by, problem_of
from ..errors import UserError
from ..harmonic_balance import nonlinear_modes
from ..harmonic_balance.nonlinear_modes import REACHED, RIGID, Backbone
from ..harmonic_balance.problem import Problem
from ..harmonic_balance.readout import measured
from ..report.response import number_tables
from ..results.checks import Checks, checked, largest
from ..results.dataset import Dataset, Variable
from ..results.journal import once
from ..settings.numbers import Model, Positive
from ..units import Quantity

SPREAD = 30.0
"""From so small a part of the amplitude at which contacts begin to slide to so many times as
much."""


class Keys(Model):
    """Nonlinear mode of the case under every normal force of the sweep, by `microslip backbone`."""

    mode: Annotated[int, Field(ge=1, le=2000)] | None = None
    """number of the mode with sticking contacts, 1 the lowest; the one that answers the excitation
    most in the band of the sweep if not given"""
    low: Positive | None = None
    """[m] smallest amplitude of the first read-out (m/m of a gauge); a thirtieth of where the
    contacts begin to slide if not given"""
    high: Positive | None = None
    """[m] largest amplitude; thirty times that if not given"""


class FollowedMode(NamedTuple):
    """A nonlinear mode, the balance that it is of, and its number, 0 the lowest."""

    mode: Backbone
    problem: Problem
    number: int


def solve(q: Question) -> Answer:
    """A nonlinear mode under every normal force; whole if all amplitudes are reached."""
    from ..pictures.following import backbone_plot

    built: Built = q.built
    asked_for, found = forces_of(built), dict[float, FollowedMode]()
    forces = [force for force in asked_for if force != 0] or asked_for
    if 0.0 in asked_for:
        q.report("left out: a normal force of 0 N, under which nothing sticks")
    for count, force in enumerate(forces, 1):
        problem = nonlinear_modes.about_rest(problem_of(built, force, form="relative"))[0]
        normal = pressed_by(built, problem) if force is None else force
        q.report(f"backbone at F_N = {normal:g} N, {count} of {len(forces)}")
        number, of = _number(q.asked, built, problem), measured(problem.assembly)
        row = once(
            q.kept,
            f"normal force {normal!r} N",
            0.0,
            partial(_row, q.asked, problem, number, q.report),
        )
        found[normal] = FollowedMode(_of_row(row, of), problem, number)
        q.report(
            f"F_N = {normal:g} N: mode {number + 1}, {checked(largest(found[normal].mode.checks))}"
        )
    found, of = dict(sorted(found.items())), measured(built.assembly)
    modes = {normal: one.mode for normal, one in found.items()}
    data, title = dataset_of(modes, of), f"{built.settings.name}: nonlinear mode"
    return Answer(
        [
            *(_sentence(normal, mode, of) for normal, mode in modes.items()),
            *remarks(found, built, q.report),
        ],
        data={"": data},
        tables=number_tables({"backbone.csv": data.columns()}),
        largest=None,
        files={"pictures/backbone.png": lambda path: backbone_plot(modes, title, path, of)},
        missing=unreached(modes),
    )


def _number(asked: Keys, built: Built, problem: Problem) -> int:
    """Of a mode with sticking contacts, 0 the lowest: the one asked for, or the band's
    strongest."""
    sweep = built.settings.sweep
    if asked.mode is not None:
        return counted_from_1(problem, asked.mode)
    return nonlinear_modes.strongest(problem, 2 * np.pi * sweep.start, 2 * np.pi * sweep.stop)


def counted_from_1(problem: Problem, mode: int) -> int:
    """Number of a mode with sticking contacts, 0 the lowest, that a person counts from 1.

    Raises:
        UserError: a rigid motion that neither supports nor contacts hold.
    """
    omega = nonlinear_modes.stuck_modes(problem)[0]
    rigid = int((omega <= RIGID * omega.max(initial=0.0)).sum())
    if not 1 <= mode <= rigid:
        return mode - 1
    first = (
        f"; the first is --mode {rigid + 1}, {omega[rigid] / (2 * np.pi):.5g} Hz"
        if rigid < len(omega)
        else ""
    )
    raise UserError(
        f"{mode}: is a rigid motion at 0 Hz, which neither supports nor sticking contacts hold, "
        "and has no "
        f"backbone; choose a mode that vibrates{first}",
        "mode",
    )


STORED = ("amplitude", "Omega", "damping", "x", "stuck", "status")


def _row(asked: Keys, problem: Problem, number: int, report: Any) -> dict[str, Any]:
    """A nonlinear mode as a journal keeps it."""
    begins = nonlinear_modes.sliding_amplitude(problem, number)
    low, high = asked.low or begins / SPREAD, asked.high or begins * SPREAD
    mode = nonlinear_modes.backbone(problem, low, high, number, report=report)
    checks = {
        f"checks/{f.name}": np.array([getattr(c, f.name) for c in mode.checks])
        for f in fields(Checks)
    }
    return {name: getattr(mode, name) for name in STORED} | checks


def _of_row(row: Mapping[str, Any], of: Quantity) -> Backbone:
    checks = zip(*(row[f"checks/{f.name}"].tolist() for f in fields(Checks)), strict=True)
    stored = {name: row[name] for name in STORED}
    return Backbone(**stored, checks=tuple(Checks(*one) for one in checks), quantity=of)


def dataset_of(modes: Mapping[float, Backbone], of: Quantity) -> Dataset:
    """A row a point, one nonlinear mode after the other."""
    every = list(modes.values())
    normal = np.repeat(list(modes), [len(one.amplitude) for one in every])
    amplitude, frequency, damping = (
        np.concatenate([getattr(one, name) for one in every])
        for name in ("amplitude", "frequency", "damping")
    )
    return Dataset(
        "backbone",
        {
            "normal_force": Variable(normal, "N", "of the contacts that the sweep presses"),
            amplitude_name(of): Variable(amplitude, of.unit, "of the first read-out, 0-peak"),
            "frequency": Variable(frequency, "Hz", "of the nonlinear mode"),
            "damping_ratio": Variable(damping, "1", "of the nonlinear mode"),
        },
    )


def amplitude_name(of: Quantity) -> str:
    """Of a variable whose column says what it measures."""
    return of.column("amplitude") if of.unit == "1" else "amplitude"


def _sentence(normal: float, one: Backbone, of: Quantity) -> str:
    """A nonlinear mode in a sentence."""
    if not len(one.amplitude):
        return f"F_N = {normal:g} N: no motion was found: {one.status}."
    i, f = int(one.damping.argmax()), one.frequency
    said = (
        f"F_N = {normal:g} N: from {f[0]:.5g} Hz (sticking: {one.stuck / 2 / np.pi:.5g} Hz) to "
        f"{f[-1]:.5g} Hz; most "
        f"damped, {100 * one.damping[i]:.3g} %, at an amplitude of {of.sized(one.amplitude[i], 3)} "
        f"and {f[i]:.5g} Hz"
    )
    said += f"; {one.failing}" if one.failing else ""
    return said + ("." if one.status == REACHED else f"; it ends early: {one.status}.")


def remarks(found: Mapping[float, FollowedMode], built: Built, report: Any) -> list[str]:
    """How uncertain the largest damping ratio is for want of harmonics, and what looks like a
    number in a wrong unit."""
    known = [(n, one) for n, one in found.items() if len(one.mode.damping) and not one.mode.failing]
    if not known:
        return []
    normal, (mode, problem, number) = max(known, key=lambda pair: float(pair[1].mode.damping.max()))
    at, error = int(mode.damping.argmax()), None
    if headline.is_estimated(built, problem):
        report("error of harmonics and samples")
        error = nonlinear_modes.error(problem, mode, at, number)
    amplitude = float(mode.amplitude[at])
    where = f"The damping ratio at {mode.quantity.sized(amplitude, 3)} under F_N = {normal:g} N"
    said = headline.said_of(built.settings, where, error)
    return [*said, *headline.doubted(built, amplitude, max(found))]


def unreached(modes: Mapping[float, Backbone]) -> str:
    """Which nonlinear modes do not reach all amplitudes, or hold motions that fail their checks;
    nothing where none."""
    early = [f"{normal:g} N" for normal, one in modes.items() if one.status != REACHED]
    said = [f"the backbone at {', '.join(early)} ends early"] if early else []
    said += [f"at {normal:g} N {one.failing}" for normal, one in modes.items() if one.failing]
    return "; ".join(said)


ANALYSIS = Analysis(
    "backbone",
    Keys,
    solve,
    lost="a nonlinear mode ends early",
    options=("mode", "low", "high"),
)
