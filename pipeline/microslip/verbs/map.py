"""Amplitude over frequency and normal force as a map, with the ridge of its resonances and their lowest place, the
optimal normal force."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from ..analysis import Analysis, Answer, Drawing, Question
from ..case.assemble import Built
from ..case.problem import forces_of
from ..continuation import NO_OPTIMUM
from ..data import Array
from ..errors import UserError
from ..harmonic_balance.peak import Optimum, Top, optimum, top_of
from ..harmonic_balance.problem import Problem
from ..harmonic_balance.readout import measured
from ..harmonic_balance.response import filled_response
from ..pictures.plots import plain_numbers
from ..results import Journal
from ..results.dataset import Dataset, Variable
from ..results.journal import once
from ..settings.numbers import Model, Positive
from ..units import Quantity
from .optimum import kept_top, row_of, under_forces

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KEPT = "normal force"
"""Series of the journal: a response and its highest resonance under every normal force."""


BESIDE = 3.0
"""Steps of the sweep by which its highest point may be beside the resonance."""


class Keys(Model):
    """A map of the amplitude over the sweep's frequencies and normal force, by `microslip map`."""

    low: Positive | None = None
    """[N] the first normal force; the smallest above 0 of the sweep if not given"""
    high: Positive | None = None
    """[N] the last; the largest of the sweep if not given"""
    forces: Annotated[int, Field(ge=3, le=10000)] = 16
    """how many, in equal ratios; more are added beside the lowest resonance"""

    @model_validator(mode="after")
    def _rising(self) -> Keys:
        if self.low is not None and self.high is not None and self.high <= self.low:
            raise ValueError("high: must be above low")
        return self


def solve(q: Question) -> Answer:
    """A response under every normal force; whole if each has a resonance that is known."""
    built: Built = q.built
    values, band = _forces(q), built.settings.sweep.grid
    make = under_forces(built, values[0], values[-1])

    def look(force: float, problem: Problem) -> Top:
        return kept_top(once(q.kept, KEPT, force, partial(_responded, problem, band, q.report)))

    best = optimum(make, values, 2 * np.pi * band, report=q.report, look=look)
    of = measured(built.assembly)
    ridge, points = _ridge(best, q.kept, of), _points(q.kept, of)
    past = _passed(ridge, band)
    title = "amplitude over frequency and normal force"
    return Answer(
        sentences=[*_sentences(best, of), *past],
        data={"": ridge, "points": points},
        diagrams={"": Drawing(partial(draw, ridge, points, of), title, (8.0, 5.4))},
        largest=float(np.nanmax(ridge["amplitude"], initial=0.0)),
        whole=all(one.status == "converged" for one in best.found.values()),
    )


def _forces(q: Question) -> list[float]:
    """N, in equal ratios.

    Raises:
        UserError: no range, or nothing that is pressed.
    """
    asked: Keys = q.asked
    given = forces_of(q.built)
    if given == [None]:
        raise UserError("a normal force presses nothing here: all contacts have their own; leave it out of one")
    swept = [force for force in given if force]
    low = asked.low or min(swept, default=0.0)
    high = asked.high or max(swept, default=0.0)
    if not 0 < low < high:
        raise UserError(f"low: from {low:g} to {high:g} N there is no range; give low and high, the smaller one first")
    return [float(force) for force in np.geomspace(low, high, asked.forces)]


def _responded(problem: Problem, band: Array, report: Any) -> dict[str, Any]:
    """A response and its highest resonance, as a journal keeps them."""
    response = filled_response(problem, band, report)
    return {
        "frequency": response.frequency,
        "amplitude": np.where(response.converged, np.abs(response.monitor), np.nan),
        **row_of(top_of(problem, response)),
    }


def _ridge(best: Optimum, kept: Journal, of: Quantity) -> Dataset:
    rows = []
    for force, one in best.found.items():
        response = kept.series[KEPT][force]
        known = np.isfinite(response["amplitude"])
        top = response["frequency"][known][response["amplitude"][known].argmax()] if known.any() else np.nan
        rows.append((force, one.Omega / (2 * np.pi), one.amplitude, top))
    force, frequency, amplitude, swept = np.array(rows).T
    return Dataset("map", {
        "normal_force": Variable(force, "N", "of the contacts that the sweep presses"),
        "frequency": Variable(frequency, "Hz", "of the highest resonance; nan where none is known"),
        "amplitude": Variable(amplitude, of.unit, "of the first read-out there, 0-peak"),
        "swept_frequency": Variable(swept, "Hz", "of the highest point of the sweep"),
    }, {"optimal_normal_force_N": best.parameter})  # fmt: skip


def _points(kept: Journal, of: Quantity) -> Dataset:
    found = kept.of(KEPT)
    force = np.repeat(list(found), [len(one["frequency"]) for one in found.values()])
    frequency, amplitude = (np.concatenate([one[key] for one in found.values()]) for key in ("frequency", "amplitude"))
    return Dataset("map_points", {
        "normal_force": Variable(force, "N", "of the contacts that the sweep presses"),
        "frequency": Variable(frequency, "Hz", "of the sweep, and points added where it may miss something"),
        "amplitude": Variable(amplitude, of.unit, "of the first read-out, 0-peak; nan where there is no solution"),
    })  # fmt: skip


def _sentences(best: Optimum, of: Quantity) -> list[str]:
    lost = [f"F_N = {force:.5g} N: {one.status}." for force, one in best.found.items() if one.status != "converged"]
    one, ends = best.resonance, list(best.found)
    if one.status != "converged":
        return lost
    where = f"{of.sized(one.amplitude)} at {one.Omega / (2 * np.pi):.6g} Hz under F_N = {best.parameter:.5g} N"
    if best.status == NO_OPTIMUM or best.parameter in (ends[0], ends[-1]):
        return [f"The highest resonance is lowest, {where}, at an end of the range; the optimum lies beyond it.", *lost]
    return [f"The highest resonance is lowest, {where}.", *lost]


def _passed(ridge: Dataset, band: Array) -> list[str]:
    """Where the sweep has not been where the resonance is: the curve overhangs there."""
    beside = np.abs(ridge["frequency"] - ridge["swept_frequency"]) > BESIDE * (band[1] - band[0])
    forces = ridge["normal_force"][beside]
    if not len(forces):
        return []
    under = f"{forces[0]:.5g} N" if len(forces) == 1 else f"{forces[0]:.5g} to {forces[-1]:.5g} N"
    return [
        f"Under {under} the highest resonance stands on a part of the curve that overhangs: the sweep, which the map "
        "shows, jumps past it (microslip respond --over frequency follows it)."
    ]


def draw(ridge: Dataset, points: Dataset, of: Quantity, figure: Figure) -> None:
    """The map of the points at the sweep's frequencies, its ridge, and the lowest place of it."""
    from matplotlib.colors import LogNorm

    forces, every = np.unique(points["normal_force"]), points["frequency"]
    common = [f for f in np.unique(every) if (every == f).sum() == len(forces)]
    at = {(n, f): a for n, f, a in zip(points["normal_force"], every, points["amplitude"], strict=True)}
    by, unit = of.shared(points["amplitude"])
    amplitude = by * np.array([[at[n, f] for f in common] for n in forces])
    axes = figure.subplots()
    axes.set_facecolor("0.85")
    known = amplitude[np.isfinite(amplitude) & (amplitude > 0)]
    shades = axes.pcolormesh(common, forces, amplitude, norm=LogNorm(known.min(), known.max()), shading="nearest")
    axes.plot(ridge["frequency"], ridge["normal_force"], color="white", lw=1.4, label="highest resonance")
    best = ridge["normal_force"] == ridge.facts["optimal_normal_force_N"]
    axes.plot(ridge["frequency"][best], ridge["normal_force"][best], "*", color="white", ms=13, mec="black",
              label=f"lowest: {ridge['normal_force'][best][0]:.4g} N")  # fmt: skip
    axes.set(yscale="log", xlabel="frequency in Hz", ylabel="normal force in N", xlim=(common[0], common[-1]))
    plain_numbers(axes.yaxis, (1.0, 2.0, 5.0))
    axes.legend(fontsize=8, loc="upper right")
    figure.colorbar(shades, label=f"amplitude in {unit} (0-peak); grey: no solution")


ANALYSIS = Analysis("map", Keys, solve, lost="a resonance is not known under every normal force")
