"""Random small systems by the harmonic balance: against an independent dense balance, against integration in time, and
with mistakes put back on purpose, each of which has to be seen."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import dense
import numpy as np
import pytest
from random_systems import AT_HOME, HARD, Verdict, at_home, compared, drawn, integrated, lasts, right, totalled, verdict

from microslip.harmonic_balance import accuracy, reduced, response
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance.forces import Cycle
from microslip.results.checks import COUNTED
from microslip.system.assembly import Assembly

COUNT = 40

ALONE = (1, 16, 18, 23, 29)
"""Of them, those whose contacts are sliders on a line: nothing is compiled for these."""

SOON = 27.0
"""Periods in which free vibrations of those that are integrated die out: most of them, contacts of each kind."""

BETWEEN = 49
"""A slider that, of 64 samples, turns less than a quarter of a step beside one, where twice as many miss as much: its
error was 2.7 times the estimate when samples were doubled only."""


# the program against others ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [*ALONE, BETWEEN])
def test_sliders_on_a_line_are_within_their_estimate_of_a_dense_balance(seed: int) -> None:
    agree(compared(seed))


@pytest.mark.slow
def test_random_systems_are_within_their_estimate_of_a_dense_balance() -> None:
    """Every one; and the estimate is of the size of the error: three times that, in the median."""
    found = [compared(seed) for seed in at_home(COUNT)]
    for one in found:
        agree(one)
    shares = [one.off / one.estimate for one in found if one.off > 1e-6]
    assert len(found) == 24 and len(shares) > 16 and 0.2 < np.median(shares) < 0.5
    assert np.median([one.own / one.off for one in found if one.off > 1e-6]) < 0.1


def agree(one: Verdict) -> None:
    assert one.missing <= dense.TOLERANCE and one.status == "converged"
    assert not one.flags, one


@pytest.mark.slow
def test_systems_that_are_hard_to_solve_are_brought_from_rest() -> None:
    """All are solutions within their estimates; of two the program says that they need more samples (`counted`)."""
    found = [compared(seed) for seed in HARD]
    assert all(one.missing <= dense.TOLERANCE and one.status == "converged" for one in found)
    assert not {"amplitude", "balance", "motion"} & {flag for one in found for flag in one.flags}
    assert sum("counted" in one.flags for one in found) <= 2


@pytest.mark.parametrize("seed", [1, 23])
def test_sliders_on_a_line_are_within_their_estimate_of_integration_in_time(seed: int) -> None:
    off, estimate, own = integrated(seed)
    assert off <= estimate + own and own < 2e-3


@pytest.mark.slow
def test_random_systems_are_within_their_estimate_of_integration_in_time() -> None:
    """Two bodies, four modes, points that lift off among them; second order in the step, as the sliders allow."""
    short = [seed for seed in at_home(COUNT) if lasts(drawn(seed)) < SOON]
    assert len(short) == 15 and {t.kind for seed in short for t in drawn(seed).touches} == {"jenkins", *AT_HOME}
    for seed, (off, estimate, own) in zip(short, map(integrated, short), strict=True):
        assert off <= estimate + own and own < 2e-3, seed


# mistakes ----------------------------------------------------------------------------------------------------------

PAIR = 124
"""Two bodies of two modes each, two sliders on lines: one between the bodies, one to the ground; both slide."""


def changed(patch: pytest.MonkeyPatch, where: Any, name: str, after: Callable) -> None:
    """A function whose answer is made wrong. after: of its answer and its arguments."""
    original = getattr(where, name)
    patch.setattr(where, name, lambda *given, **more: after(original(*given, **more), *given))


def alike(made: Assembly, signs: Callable = Assembly.signs.func) -> np.ndarray:
    """What the sides of contacts count for, without a sign."""
    return np.abs(signs(made))


def of_parts(wrong: Callable) -> Callable:
    """A mistake in what is linear in a harmonic. wrong: of a part and its harmonic."""
    return lambda patch: changed(
        patch, balance, "eliminated", lambda parts, _, harmonic, *more: tuple(wrong(p, harmonic) for p in parts)
    )


def damped(times: float) -> Callable:
    """Damping of the first harmonic, so many times what it is."""
    return of_parts(lambda part, harmonic: replace(part, C=(times if harmonic == 1 else 1.0) * part.C))


def of_motion(**wrong: Callable) -> Callable:
    """A mistake in what is told of a solution. wrong: attribute of `Operating` -> of its value."""

    def after(found: response.Operating, *_: Any) -> response.Operating:
        return replace(found, **{key: f(getattr(found, key)) for key, f in wrong.items()})

    return lambda patch: changed(patch, response, "Operating", after)


def of_cycles(**wrong: Callable) -> Callable:
    """The same of what the points do in a cycle."""

    def each(cycles: Mapping[str, Cycle]) -> dict[str, Cycle]:
        return {n: c._replace(**{key: f(getattr(c, key)) for key, f in wrong.items()}) for n, c in cycles.items()}

    return of_motion(cycles=each)


def exchanged(values: Mapping[str, Any]) -> dict[str, Any]:
    return dict(zip(values, reversed(list(values.values())), strict=True))


MISTAKES = {
    "read-outs exchanged": ("amplitude", lambda p: changed(p, reduced, "read", lambda found, *_: found[::-1])),
    "rows of read-outs exchanged": ("amplitude", of_parts(lambda part, _: replace(part, output=part.output[::-1]))),
    "damping twice": ("amplitude", damped(2.0)),
    "damping left out": ("amplitude", damped(0.0)),
    "second side like the first": ("amplitude", lambda p: p.setattr(Assembly, "signs", property(alike))),
    "no error": (
        "amplitude",
        lambda p: changed(p, accuracy, "error", lambda e, *_: replace(e, by_harmonics=0.0, by_samples=0.0)),
    ),
    "damping counted twice": ("balance", lambda p: changed(p, reduced, "work", lambda w, *_: (w[0], 2 * w[1], *w[2:]))),
    "loads counted twice": ("balance", lambda p: changed(p, reduced, "work", lambda w, *_: (2 * w[0], *w[1:]))),
    "work of a contact with the other sign": ("balance", of_motion(force=lambda F: F | {"contact 0": -F["contact 0"]})),
    "loss of the law counted twice": ("counted", of_cycles(lost=lambda lost: 2 * lost)),
    "work of the points counted twice": ("taken", of_cycles(dissipated=lambda work: 2 * work)),
    "work at the other contact": ("taken", of_motion(cycles=exchanged)),
    "contacts exchanged": ("motion", of_motion(relative=exchanged)),
    "bodies exchanged": ("motion", of_motion(q=exchanged)),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_seen(mistake: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """And what the program itself checks is then no solution."""
    (flag, put_back), one = MISTAKES[mistake], right(PAIR)
    put_back(monkeypatch)
    found = verdict(drawn(PAIR), one)
    assert flag in found.flags
    assert bool(found.checks.failure) == bool(found.flags & {"balance", "counted", "motion"})


def test_without_a_mistake_nothing_is_seen() -> None:
    agree(verdict(drawn(PAIR), right(PAIR)))


def test_samples_that_cut_off_reversals_are_seen() -> None:
    """Eight of a slider that slides nearly all the time: by what the contact takes. With as few as hold the harmonics,
    energies may agree; the estimate tells."""
    assert "counted" in verdict(drawn(1), right(1), samples=8).flags
    for seed, fewest in ((29, 7), (BETWEEN, 11)):
        found = verdict(drawn(seed), right(seed), samples=fewest)
        assert 0.05 < found.off <= found.estimate


def test_an_estimate_that_only_doubles_samples_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not verdict(drawn(BETWEEN), right(BETWEEN), samples=64).flags
    monkeypatch.setattr(accuracy, "DENSER", 2)
    assert verdict(drawn(BETWEEN), right(BETWEEN), samples=64).flags == {"amplitude"}


@pytest.mark.slow
def test_a_tangential_stiffness_in_its_total_form_is_seen() -> None:
    """A rough point that sticks while its normal force swings, by what it takes."""
    honest, printed = (totalled(19, total) for total in (False, True))
    assert not honest.failure and printed.failure and abs(printed.counted) > COUNTED
