"""The analyses of an assembly: forced response over frequency, curves through folds, nonlinear modes."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from .case.assemble import Built
from .case.contacts import swept
from .case.problem import problem_of
from .continuation import Settings
from .errors import UserError
from .harmonic_balance import families, nonlinear_modes
from .harmonic_balance import problem as balance
from .harmonic_balance.families import CRITICAL
from .harmonic_balance.growing import fed, growing, verdict
from .harmonic_balance.nonlinear_modes import Backbone, Measure
from .harmonic_balance.problem import Problem
from .harmonic_balance.solved import Motions
from .harmonic_balance.solver import Point, sweep
from .progress import Report
from .settings.arguments import Count, Frequencies, Index, Rows, Text, Vector, checked
from .settings.mistakes import bounded, numbered, too_few
from .settings.numbers import Number, Positive
from .system.assembly import Assembly
from .units import hertz

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from .bifurcation.diagram import Diagram
    from .bifurcation.dynamics import Dynamics
    from .harmonic_balance.tones import Solved
    from .mistuning.ensemble import Ensemble
    from .mistuning.scatter import Scatter
    from .results import Journal
    from .time_domain.many import Reached
    from .time_domain.orbit import Orbit



def _to_be_analysed(system: Any) -> Any:
    if not isinstance(system, Assembly | Built | Problem):
        raise ValueError(f"{type(system).__name__} is no assembly; make one by structure or assemble")
    return system


System = Annotated[Assembly | Built | Problem, BeforeValidator(_to_be_analysed)]
"""What is analysed: bodies with contacts, loads and read-outs; such as a case describes; or their balance."""
Unit = Literal["Hz", "rad/s"]

IN_TIME = 25
"""Harmonics of the vibration that a motion in time starts on."""

HERTZ = {"Hz": 1.0, "rad/s": 1 / (2 * np.pi)}


def balanced(system: System, harmonics: int | None = None, samples: int | None = None) -> Problem:
    """The balance of an assembly.

    Args:
        harmonics: H, 3 if not given, or as many as the case says. samples: of a cycle, in which contact forces are
            evaluated; if not given 16 a harmonic and 64 at least, or as many as the case says.

    Raises:
        UserError: a case whose contacts wait for a normal force.
    """
    if isinstance(system, Problem):
        if harmonics is not None or samples is not None:
            raise UserError(
                "harmonics, samples: this is a balance that has its own; give the assembly, or leave them out"
            )
        return system
    if isinstance(system, Built):
        _pressed(system)
        asked = {"harmonics": harmonics, "samples": samples}
        return problem_of(system, None, **{key: n for key, n in asked.items() if n is not None})
    H = 3 if harmonics is None else harmonics
    if samples is not None and samples < 4 * H:
        raise UserError(f"samples: {too_few(samples, H, 4 * H, 16 * H)}")
    return balance.of(system, H, max(64, 16 * H) if samples is None else samples)


def whole_of(system: System) -> Assembly:
    """The assembly of what is analysed.

    Raises:
        UserError: a case whose contacts wait for a normal force.
    """
    if isinstance(system, Problem):
        return system.assembly
    return _pressed(system) if isinstance(system, Built) else system


def _pressed(built: Built) -> Assembly:
    """The assembly of a case.

    Raises:
        UserError: contacts that wait for a normal force.
    """
    if waiting := [c.interface for c in built.contacts if swept(c)]:
        raise UserError(
            f"contacts.{waiting[0]}: waits for a normal force, N; give normal_force to the contact, or to assemble"
        )
    return built.assembly


def _driven(problem: Problem) -> Problem:
    """Raise `UserError` where nothing drives it."""
    if not problem.assembly.loads:
        raise UserError("system: nothing drives it; give force to structure, or an excitation to assemble")
    return problem


def _warn(call: str, said: Sequence[str]) -> None:
    """Warn who called the function of that name."""
    for one in said:
        warnings.warn(f"{call}: {one}", stacklevel=4)


def _highest(problem: Problem, points: Sequence[Point]) -> list[str]:
    """Whether the largest motion is stable, where the linear part feeds motions."""
    if not (good := [p for p in points if p.converged]):
        return []
    top = max(good, key=lambda p: float(np.abs(p.x).max(initial=0.0)))
    at = f"the largest motion, at {hertz(top.Omega / (2 * np.pi))},"
    return verdict(problem, top.x, top.Omega, at)


@checked
def harmonic_response(
    system: System, frequency: Frequencies, *, harmonics: Count | None = None, samples: Count | None = None,
    unit: Unit = "Hz", report: Report = lambda _: None,
) -> Motions:  # fmt: skip
    """Steady forced vibration at given frequencies, by harmonic balance.

    Every point starts from its neighbours. Where the response has several motions at one frequency a sweep finds one of
    them and jumps at folds; `follow` finds all.

    Args:
        system: what vibrates, with its loads. frequency: (f,) in the unit, in the order of the sweep.
        harmonics: H, 3 if not given. samples: of a cycle, 16 a harmonic and 64 at least if not given.
        report: is told what is under way.

    Returns:
        A `Motions`: ``plot()``, ``to_dataframe()``, ``to_xarray()``, ``save(path)``. A point that was not found is
        there with its cause in ``status``. Python warns where damping is negative, and says then whether the largest
        motion is stable, and of friction that hangs on the samples.

    Raises:
        UserError: no frequency, or one that is not positive.

    Examples:
        >>> import microslip as ms
        >>> slider = ms.structure(1.0, 1.0, 0.02, force={0: 0.3}, elements=[ms.jenkins(1.0, 0.5)])
        >>> ms.harmonic_response(slider, [0.8, 1.0, 1.2], unit="rad/s").amplitude.round(3).tolist()
        [0.221, 0.3, 0.669]
    """
    problem = _driven(balanced(system, harmonics, samples))
    asked = np.atleast_1d(np.asarray(frequency, dtype=float)) * HERTZ[unit]
    points, hertz = sweep(problem, asked, report), HERTZ[unit]
    _warn("harmonic_response", [*fed(problem.assembly), *_highest(problem, points)])
    known = {} if hertz == 1 else {"parameter": asked / hertz}
    return Motions("response", points, lambda _: problem, over=_over("frequency", unit), known=known)


@checked
def two_tones(
    system: System, first: Frequencies, second: Frequencies, *, free: bool = False, harmonics: Count = 5,
    samples: Count | None = None, turns: Count | None = None, start: Orbit | None = None,
    unit: Unit = "Hz", kept: Journal | None = None, report: Report = lambda _: None,
) -> Solved:  # fmt: skip
    """Quasi-periodic vibration of two frequencies without a common period, by harmonic balance over both.

    Args:
        system: what vibrates, with loads of both tones (``second_force`` of `structure`, ``tone = 2`` of a case).
        first, second: numbers or (f,) in the unit, point by point: hold one of them, or ``second=ratio * first``.
        free: the second frequency is that of a self-excited vibration, unknown, and ``second`` a guess within 15 %; no
            load has a second tone then. start: a motion in time to begin from then, of `integrate`; if not given 200
            periods of the first tone from rest, and a hundred that are kept.
        harmonics: H: pairs (k1, k2) with ``abs(k1) + abs(k2) <= H`` are balanced. samples: of a turn of the faster
            angle, 8 H and 32 at least if not given. turns: of it in the line along which contacts that remember are
            marched; as many.
        kept: finished points of a run that did not end. report: is told what is under way.

    Returns:
        A `Solved`: ``of(k1, k2)``, ``plot()``, ``plot_torus()``, ``motion(time)``, ``to_dataframe()``,
        ``to_xarray()``, ``save(path)``, ``error_estimate(i)``. A point that was not found says why in ``status``.

    Raises:
        UserError: a frequency that is not positive, two that are equal; no load of a second tone, or one with ``free``;
            a ring; contacts that remember where the frequencies are as small whole numbers; rigid stops.

    Examples:
        Duffing's oscillator under two forces:

        >>> import microslip as ms
        >>> forces = {"force": {0: 0.2}, "second_force": {0: 0.1}}
        >>> duffing = ms.structure(1.0, 1.0, 0.05, **forces, elements=[ms.polynomial({3: 0.05})])
        >>> found = ms.two_tones(duffing, 1.3, 0.8, unit="rad/s")
        >>> [round(float(abs(found.of(*k)[0])), 5) for k in ((1, 0), (0, 1), (1, -2))]
        [0.29221, 0.26934, 0.00087]
    """
    from .harmonic_balance import tones, two_tone

    for key, given, has in (("start", start, "time"), ("kept", kept, "of")):
        if given is not None and not hasattr(given, has):
            raise UserError(f"two_tones: {key}: {given!r} is none; leave it out, or see its description")
    fewest = ("samples", samples, 4 * harmonics), ("turns", turns, 2 * harmonics + 1)
    for key, count, least in fewest:
        if count is not None and count < least:
            raise UserError(f"two_tones: {key}: {too_few(count, harmonics, least, 8 * harmonics)}")
    assembly, turn = whole_of(system), 2 * np.pi * HERTZ[unit]
    one, two = (np.atleast_1d(np.asarray(f, dtype=float)) * turn for f in (first, second))
    try:
        one, two = np.broadcast_arrays(one, two)
    except ValueError:
        raise UserError(f"second: {len(two)} frequencies and {len(one)} first ones; give as many, or one") from None
    _check_tones(assembly, one, two, free)
    _warn("two_tones", fed(assembly)[len(growing(assembly)) if free else 0 :])
    b = two_tone.of(assembly, float(one[0]), float(two[0]), harmonics, samples, turns, free=free)
    begin = None
    if free:
        report("a motion in time to begin from")
        at = float(one[0]) / (2 * np.pi)
        seen = start or integrate(assembly, at, settle=200, keep=100, samples=32)
        b, begin = tones.from_time(b, seen.time, seen.d, float(one[0]), float(two[0]))
    return tones.swept(b, one, two, begin, report, kept)


def _check_tones(assembly: Assembly, first: np.ndarray, second: np.ndarray, free: bool) -> None:
    """Raise `UserError` where there are no two tones."""
    if (np.abs(first - second) <= 1e-9 * first).any():
        raise UserError("second: is the first frequency; give loads of one tone and use harmonic_response")
    tones = {x.tone for x in assembly.loads if x.harmonic}
    if not free and 2 not in tones:
        raise UserError(
            "second: no load has this frequency; give second_force to structure or tone = 2 in a case, or free=True "
            "where the assembly vibrates by itself"
        )
    if free and 2 in tones:
        raise UserError("free: a load has the second frequency, which is known then; leave free out, or the load")
    if 1 not in tones:
        raise UserError("first: no load has this frequency; give force to structure, or a load of tone 1 in a case")


@checked
def follow(
    system: System, start: Number, stop: Number, *,
    over: Literal["frequency", "load", "normal_force"] = "frequency", frequency: Positive | None = None,
    harmonics: Count | None = None, samples: Count | None = None, unit: Unit = "Hz",
    settings: Settings | Mapping[str, Any] | None = None, stability: bool = False,
    report: Report = lambda _: None,
) -> Motions:  # fmt: skip
    """Steady forced vibration along the whole curve of its motions, through folds, stable or not.

    Args:
        system: what vibrates, with its loads. start, stop: of the frequency in the unit, or of the factor on the loads
            that are not steady, or on all normal forces; the first may be the larger one.
        frequency: in the unit, at which load or normal force vary. harmonics, samples: see `harmonic_response`.
        settings: of the steps along the curve where they are to be others: ``{"points": 10000}`` for more of them than
            3000, ``{"step_max": 0.1}`` for shorter ones than 0.5, a twentieth of the range, and all others of
            `continuation.Settings`. stability: whether every motion is stable, by its Floquet multipliers, and where
            that changes. report: is told what is under way.

    Returns:
        A `Motions`, with ``folds``, over the frequency ``peaks`` of the first read-out, and, in ``ended``, why the
        curve ended: "bound: 60 Hz is reached", the stop or the start again. Where it comes back to the start or gets
        stuck, the points of another curve follow, begun at the stop (``arrays["branch"]`` is 1 there), and ``ended``
        tells of both. With ``stability`` it has ``stable``, ``growth`` of a disturbance a period, and, located, the
        ``bifurcations`` beside folds; what is unstable is drawn dashed.
        Over the frequency the modes with sticking contacts and those without are among the points; a resonance that is
        narrow elsewhere may be passed over: give a shorter ``step_max``.

    Raises:
        UserError: a frequency that is not positive, or one that is missing; nothing nonlinear; a setting there is not.

    Examples:
        Both folds of Duffing's oscillator:

        >>> import microslip as ms
        >>> duffing = ms.structure(1.0, 1.0, 0.05, force={0: 0.4}, elements=[ms.polynomial({3: 0.05})])
        >>> curve = ms.follow(duffing, 0.3, 2.5, harmonics=7, unit="rad/s")
        >>> curve.folds.round(3).tolist()
        [1.463, 1.156]
    """
    problem, hertz = _driven(balanced(system, harmonics, samples)), HERTZ[unit]
    _bends(problem, "harmonic_response")
    if start == stop:
        raise UserError(f"stop: {stop:g} is the start too; give two ends between which the curve is followed")
    _between(settings, "start and stop")
    if over == "frequency":
        if frequency is not None:
            raise UserError("frequency: is what varies; leave it out, or say over what the curve goes instead")
        bounded("start", start, gt=0)
        bounded("stop", stop, gt=0)
        family = families.of_frequency(problem, start * hertz, stop * hertz)
    else:
        if frequency is None:
            raise UserError(f"frequency: is missing: at which frequency does the {over.replace('_', ' ')} vary?")
        if over == "normal_force":
            bounded("start", start, ge=0)
            bounded("stop", stop, ge=0)
            if not any(c.preload[0] > 0 for c in problem.assembly.contacts):
                raise UserError("over: no contact has a normal force; take another")
        make = families.of_load if over == "load" else families.of_normal_force
        family = make(problem, frequency * hertz, start, stop)
    found = families.from_both_ends(family, report, settings)
    found = tuple(families.with_peaks(family, one) for one in found)
    judged = [families.with_stability(family, one, report) for one in found] if stability else []
    found = tuple(one for one, _ in judged) or found
    if any(p.kind == "branch point" for one in found for p in one.points):
        text = "a multiplier passes 1 where there is no fold: a branch point, if it is there with more harmonics too"
        _warn("follow", [text])
    family = replace(family, unit=family.unit * hertz, words=unit) if over == "frequency" else family
    points = [p for one in found for p in one.points]
    _warn("follow", fed(problem.assembly))
    known = {
        "parameter": np.array([p.lam for p in points]) / family.unit,
        **{kind: np.array([p.kind == kind for p in points], dtype=float) for kind in ("fold", "peak")},
        **{kind: np.array([p.kind == kind for p in points], dtype=float) for kind in CRITICAL if stability},
        "kink": np.array([p.kink for p in points], dtype=float),
        "arclength": np.array([p.arclength for p in points]),
    }
    if stability:
        told = [s for _, each in judged for s in each]
        known["stable"] = np.array([s.stable for s in told], dtype=float)
        known["growth"] = np.array([s.growth for s in told])
    if len(found) > 1:
        known["branch"] = np.repeat([0.0, 1.0], [len(one.points) for one in found])
    ended = "; another curve, begun at the stop: ".join(map(family.ended, found))
    return Motions(
        "curve", [p for one in found for p in family.points(one)], lambda v: family.problem(v * family.unit),
        over=_over(over, unit), known=known, ended=ended,
    )  # fmt: skip


@checked
def backbone(
    system: System, low: Positive, high: Positive, *, mode: Index = 0, output: Index = 0,
    harmonics: Count | None = None, samples: Count | None = None,
    measure: Measure = "norm", settings: Settings | Mapping[str, Any] | None = None,
    report: Report = lambda _: None,
) -> Backbone:  # fmt: skip
    """A nonlinear mode: frequency and damping ratio over the amplitude, from sticking contacts to sliding ones.

    Args:
        system: what vibrates; its loads do not matter. low, high: amplitudes (m) of a read-out, from one at which
            contacts hardly slide. mode: number of the mode with sticking contacts, 0 the lowest. output: number of the
            read-out. harmonics, samples: see `harmonic_response`.
        measure: what low and high are values of: "norm" of all coordinates and harmonics, or "modal", its share in the
            linear mode, as large as the read-out is in that mode; "energy", J; "readout", its first harmonic itself,
            which vanishes in an internal resonance.
        settings: of the steps along the curve where they are to be others: ``{"points": 5000}`` for more of them than
            1000, and all others of `continuation.Settings`. report: is told what is under way.

    Returns:
        The curve, which tabulates, draws and saves itself; `complete` if it reached the high amplitude;
        ``plot(over="energy")``; ``resonances``, internal ones on the way, and ``passed``, those that are not entered.

    Raises:
        UserError: a mode that does not move the read-out, or that there is not.

    Examples:
        >>> import microslip as ms
        >>> rubbing = ms.structure(1.0, 1.0, 0.01, force={0: 1.0}, elements=[ms.jenkins(3.0, 0.3)])
        >>> mode = ms.backbone(rubbing, 1e-3, 1e2, harmonics=3)
        >>> print(f"{mode.Omega[0]:.3f} rad/s stuck, {mode.Omega[-1]:.2f} sliding")
        2.000 rad/s stuck, 1.00 sliding
    """
    problem = balanced(system, harmonics, samples)
    count = len(problem.assembly.outputs)
    if not count:
        raise UserError(f"output: there is no read-out {output}; nothing is read; give output to structure")
    numbered("output", output, count, "read-out")
    numbered("mode", mode, len(problem.parts[1][0].M), "mode")
    _bends(problem, "the eigenvalues of its matrices")
    if not high > low:
        raise UserError(f"high: {high:g} is not above low, {low:g}; give the smaller amplitude first")
    _warn("backbone", fed(problem.assembly))
    _between(settings, "low and high")
    return nonlinear_modes.backbone(
        problem, low, high, mode, output, settings=settings, report=report, measure=measure
    )


def _between(settings: Any, ends: str) -> None:
    """Refuse settings that say again between which ends a curve is followed."""
    if taken := {"direction", "low", "high"} & set(settings if isinstance(settings, Mapping) else ()):
        raise UserError(f"settings: {min(taken)}: {ends} say where the curve goes; leave it out")


def _bends(problem: Problem, other: str) -> None:
    """Refuse what has neither a contact nor an element."""
    if not problem.groups:
        raise UserError(f"system: has no contact or element, so it is linear and no curve bends; take {other}")


def _over(over: str, unit: str) -> str:
    return "Omega" if over == "frequency" and unit == "rad/s" else over


@checked
def integrate(
    system: System, frequency: Positive, *, second: Positive | None = None, unit: Unit = "Hz",
    settle: Index = 100, keep: Count = 20,
    samples: Count = 256, steps: Count | None = None,
    start: Literal["static", "rest", "balance"] | Mapping[str, Any] = "static",
    file: Path | Text | None = None, report: Report = lambda _: None,
) -> Orbit:  # fmt: skip
    """Motion in time under harmonic loads, from rest (Sextro, section 4.1).

    Between contact forces the bodies move exactly, whatever their frequencies; the contacts' laws kick them. Where a
    steady vibration is wanted, `harmonic_response` is faster; this finds what does not repeat, and what a start leads
    to.

    Args:
        system: what vibrates, with its loads. frequency: of the loads' first harmonic, in the unit. second: of loads
            of a second tone, see `two_tones`. settle: periods of the first that are left to themselves. keep: periods
            that are kept. samples: of each that are kept. steps: of each; if not given, 150 in a period of the fastest
            motion with closed contacts, and 512 at least. Of fourth order where every law allows it, and then halved
            where contacts open, close or slide; else of second.
        start: ``static``, at rest under the steady loads; ``rest``, at rest in the preloaded state; ``balance``, on
            the vibration that harmonic balance finds, its contacts remembering it. Of an assembly `IN_TIME` harmonics
            are taken; a balance or a case has its own. Or where the bodies are let go: ``{"displacement": ...,
            "velocity": ...}``, m and m/s, each of all coordinates or coordinate -> value, of bodies from modal files
            those of their modes; ``{"mode": 1, "amplitude": ...}``, of the first read-out in a mode of the bodies
            without their contacts.
        file: samples are written there as they come and read when they are asked for, so that a long motion needs no
            more memory than a short one; a run that was killed is gone on with. report: is told what is under way.

    Returns:
        An `Orbit`: ``said``, ``repeats``, ``count("closes")``, ``plot()``, ``to_dataframe()``, ``to_xarray()``,
        ``save(path)``; ``error``, estimated, of the whole run.

    Raises:
        UserError: steps that are too few for the springs of the contacts; contacts that the start presses deeper than
            steady loads do.
        NotConverged: no state of rest, or no vibration to start on, is found.

    Examples:
        A mass that hits a stop once in every period:

        >>> import microslip as ms
        >>> hammer = ms.structure(1.0, 1.0, 0.1, force={0: 1.0}, elements=[ms.stop(100.0, 0.5)])
        >>> ms.integrate(hammer, 1.5, unit="rad/s").repeats
        1
    """
    from .time_domain import equations, orbit, recorded, starts

    assembly = whole_of(system)
    turn = 2 * np.pi * HERTZ[unit]
    found = equations.of(assembly, turn * frequency, None if second is None else turn * second)
    if second is not None and start == "balance":
        raise UserError('second: "balance" begins on a periodic vibration; take "static" or "rest"')
    begin: orbit.Start | starts.PeriodicStart
    if isinstance(start, Mapping):
        begin = starts.released(found, start)
    elif start == "balance":
        many = IN_TIME if isinstance(system, Assembly) else None
        begin = starts.of_balance(found, balanced(system, many, many and 16 * many))
    else:
        begin = start
    if file is None:
        return orbit.run(found, settle, keep, samples, steps, begin, report)
    asked = recorded.Integration(f"{frequency:.6g} {unit}", found, settle, keep, samples, steps, begin)
    return recorded.run(file, [asked], report=report)[0]


@checked
def integrate_many(
    system: System, frequency: Positive, displacements: Rows, velocities: Rows, *,
    unit: Unit = "Hz", settle: Index = 100, keep: Count = 20, steps: Count | None = None,
    exponents: bool = False,
) -> Reached:  # fmt: skip
    """Which motions many starts lead to: all of them integrated by one compiled program, for basins of attraction.

    Args:
        system, unit, settle, keep, steps: see `integrate`. displacements, velocities: (n, k) of the system's
            coordinates at t = 0, m and m/s; of bodies from modal files those of their modes. exponents: look for the
            largest Lyapunov exponent of each, which takes up to four times as long.

    Returns:
        A `Reached`: ``attractor`` and ``repeats`` of each start, ``impacts``, read-outs ``y`` and their velocities
        ``y_dot`` after every period, ``exponents``.

    Raises:
        UserError: starts that are not (n, k); steps that are too few for the springs of the contacts.

    Examples:
        A buckled beam, let go on either side:

        >>> import microslip as ms
        >>> beam = ms.structure(1.0, -1.0, 0.3, force={0: 0.05}, elements=[ms.polynomial({3: 1.0})])
        >>> ms.integrate_many(beam, 0.2, [[0.8], [-0.8], [0.9]], [[0.0], [0.0], [0.0]]).attractor
        array([0, 1, 0])
    """
    from .time_domain import equations, many

    found = equations.of(whole_of(system), 2 * np.pi * frequency * HERTZ[unit])
    return many.run(found, np.asarray(displacements), np.asarray(velocities), settle, keep, steps, exponents)


@checked
def run_up(
    system: System, start: Positive, stop: Positive, time: Positive, *, unit: Unit = "Hz",
    order: Count = 1, euler: tuple[str, ...] = (), samples: Count = 256, steps: Count | None = None,
    begin: Literal["static", "rest"] = "static", file: Path | Text | None = None, report: Report = lambda _: None,
) -> Orbit:  # fmt: skip
    """Motion in time from rest while the frequency of the loads goes linearly from one to another, up or down.

    The phase of the loads is the integral of their frequency. Centrifugal loads follow the square of the rotation
    speed; matrices stay those of the modal files' speeds.

    Args:
        system: what vibrates, with its loads. start, stop: of the loads' first harmonic, in the unit. time: s, from one
            to the other. order: engine order of the first harmonic: the rotation speed is the frequency over it.
            euler: names of bodies that turn with it and feel its change as a load (Sextro Eq. (2.3-19)).
        samples, steps: of a period of the highest frequency. begin, file, report: as start, file, report of
            `integrate`.

    Returns:
        An `Orbit`: ``frequency`` of every sample; see `integrate`.

    Raises:
        UserError: see `integrate`; a body without an Euler load. NotConverged: no state of rest is found.

    Examples:
        The faster, the later the resonance at 1 rad/s is seen:

        >>> import microslip as ms
        >>> one = ms.structure(1.0, 1.0, 0.05, force={0: 1.0}, output=0)
        >>> ways = [ms.run_up(one, 0.5, 1.5, time, unit="rad/s") for time in (800.0, 200.0)]
        >>> [f"{2 * 3.14159 * way.frequency[abs(way.y[0]).argmax()]:.2f}" for way in ways]
        ['1.05', '1.12']
    """
    from .time_domain import equations, orbit, recorded
    from .time_domain.ramp import Ramp

    if start == stop:
        raise UserError("stop: is the start; give another, or integrate at one frequency")
    turn = 2 * np.pi * HERTZ[unit]
    ramp = Ramp(turn * start, turn * stop, time, order, euler)
    found = equations.of_ramp(whole_of(system), ramp)
    if file is None:
        return orbit.run(found, 0, ramp.periods, samples, steps, begin, report)
    asked = recorded.Integration(f"{start:.6g} to {stop:.6g} {unit}", found, 0, ramp.periods, samples, steps, begin)
    return recorded.run(file, [asked], report=report)[0]


@checked
def bifurcate(
    system: Dynamics | Callable[[float], Assembly | Built], start: Number, stop: Number, *, x: Vector | None = None,
    frequency: Positive | None = None, unit: Unit = "Hz", orbits: bool = True, doublings: Index = 1,
    branches: Index = 1,
    attractors: Sequence[Number] = (), starts: Count = 64, deflate: Sequence[Number] = (), nodes: Count = 32,
    step: Annotated[Positive, Field(le=1)] = 0.08, points: Count = 400, report: Report = lambda _: None,
) -> Diagram:  # fmt: skip
    """Equilibria over a parameter, their Hopf points, and the periodic orbits that are born there, stable or not.

    Args:
        system: x' = f(x, p, angle), or the assembly at a value of the parameter; its contacts' friction follows the
            velocity alone, or it has smooth springs. start, stop: of the parameter. x: (n,) a guess of the equilibrium
            at the start; at rest if not given. frequency: of an assembly's loads, in the unit.
        orbits: whether they are followed. doublings: how often from an orbit on to the one of twice its period.
            branches: how often from a branch point on to the curve that crosses there.
        attractors: values of the parameter at which `starts` motions are left alone, to find what they come to.
        deflate: values at which orbits, stable or not, are looked for beside those by deflation of what is known.
        nodes: of an orbit. step: the longest, a share of start to stop. points: of a branch. report: is told what is
            under way.

    Returns:
        A `Diagram`: ``branches``, ``hopf``, ``deflated``, ``at("fold")``, ``plot(axes)``, ``to_dataframe()``,
        ``to_xarray()``. A branch that could not be followed to its end says why in ``ended``.

    Raises:
        UserError: no equilibrium near the start; contacts that remember; a parameter that does not act smoothly.

    Examples:
        The chemical oscillator called Brusselator, whose Hopf point is at 2:

        >>> import jax.numpy as jnp, numpy as np, microslip as ms
        >>> def rate(x, p, _):
        ...     return jnp.stack([1 - (p + 1) * x[0] + x[0] ** 2 * x[1], p * x[0] - x[0] ** 2 * x[1]])
        >>> system = ms.Dynamics(rate, ("x", "y"), np.array([2.0, 2.0]))
        >>> found = ms.bifurcate(system, 1.5, 2.5, x=[1.0, 1.5], orbits=False)
        >>> [round(point.p, 9) for point in found.hopf]
        [2.0]
    """
    from .bifurcation import diagram, mechanics
    from .sliding import equilibrium, of

    if start == stop:
        raise UserError("stop: is the start; give two different values of the parameter")
    for key, asked_at in (("attractors", attractors), ("deflate", deflate)):
        if odd := [p for p in asked_at if not min(start, stop) <= p <= max(start, stop)]:
            raise UserError(f"bifurcate: {key}: {odd[0]:g} is not between {start:g} and {stop:g}; correct it")
        if len(asked_at) and not orbits:
            raise UserError(f"bifurcate: {key}: are orbits; leave them out, or orbits=False")
    if isinstance(system, diagram.Dynamics):
        if frequency is not None:
            raise UserError("bifurcate: frequency: is of an assembly's loads; give Dynamics its own")
        made = replace(system, parameter_scale=abs(stop - start))
        begin = np.zeros(made.count) if x is None else np.asarray(x, dtype=float)
    elif not callable(system):
        raise UserError(f"bifurcate: system: {system!r} is none; give Dynamics, or the assembly as a function of p")
    else:

        def at(p: float) -> Assembly:
            if not isinstance(found := system(p), Assembly | Built | Problem):
                raise UserError(f"bifurcate: system: gives {found!r} at {p:g}; let it give an assembly")
            return whole_of(found)

        if not at(start).contacts:
            raise UserError("bifurcate: system: has no contact or element, so it is linear; take stability")
        Omega = None if frequency is None else 2 * np.pi * frequency * HERTZ[unit]
        made = mechanics.dynamics(at, min(start, stop), max(start, stop), Omega)
        begin = equilibrium(of(at(start))) if x is None else np.asarray(x, dtype=float)
    if len(begin) != made.count:
        raise UserError(f"bifurcate: x: has {len(begin)} numbers; the system has {made.count}")
    made.check(begin, start)
    asked = diagram.DiagramPlan(
        start, stop, orbits, doublings, nodes, step, points, tuple(attractors), starts, deflate=tuple(deflate),
        branches=branches,
    )
    return diagram.diagram(made, begin, asked, report=report)


@checked
def mistune(
    system: Assembly, scatter: Scatter | Sequence[Scatter], frequency: Frequencies, *, samples: Count = 100,
    until: Positive | None = None, rare: Index = 0, seed: Index = 0, stuck: bool = False, harmonics: Count = 3,
    points: Count | None = None, workers: Count = 1, executor: Executor | None = None, report: Report = lambda _: None,
) -> Ensemble:  # fmt: skip
    """Whole rings whose sectors differ, sample by sample: how much higher the highest blade gets (Sextro section 5.6).

    Args:
        system: one sector that stands for its ring. scatter: what differs, see `Scatter`. frequency: (f,) Hz, rising, a
            sweep that sees every resonance; peaks are searched for between. samples: at most. until: ends when half of
            the interval of the 95 % quantile is that share of it. rare: further samples, chosen by a linear ring, for
            the 99.9 % quantile. seed: of all random numbers; a sample depends on it and its number alone. stuck:
            contacts stick. harmonics, points: of the balance, samples of a cycle.
        workers: processes. executor: in their place, such as that of a cluster. report: is told what is under way.

    Returns:
        An `Ensemble`: ``amplification`` of each sample, ``quantile(0.95)`` with its interval, ``envelope``,
        ``rare``. Python warns where the band or the sweep leaves peaks unsure (``unsure``).

    Raises:
        UserError: no ring; a scatter of what is not there, or that leaves nothing of it.

    Examples:
        >>> import numpy as np, microslip as ms
        >>> rub = {"interface": "right", "against": "left", "against_sector": 1, "law": "smooth", "normal_force": 20.0,
        ...        "normal_stiffness": 2e5, "tangential_stiffness": 4e5, "friction": 0.2, "points": [1, 1]}
        >>> case = {"body": "vane", "excitation": "magnet", "amplitude": 2.0, "monitor": "probe", "modes": 2,
        ...         "ring": {"blades": 4, "engine_order": 1}, "contacts": [rub]}
        >>> ring = ms.assemble(case, vane=ms.sample()).assembly
        >>> found = ms.mistune(ring, ms.Scatter("frequency", 0.01), np.linspace(375, 405, 31), samples=4, stuck=True)
        >>> found.amplification.shape
        (4,)
    """
    from .mistuning import ensemble
    from .mistuning.ring import Tuned
    from .mistuning.samples import Asked
    from .mistuning.scatter import Scatter, check

    if not isinstance(system, Assembly) or system.ring is None:
        raise UserError("system: is no sector of a ring; assemble a case with [ring], and give its .assembly")
    f = np.asarray(frequency, dtype=float)
    if f.ndim != 1 or len(f) < 3 or not (np.diff(f) > 0).all() or not f[0] > 0:
        raise UserError("frequency: give three or more, positive and rising, Hz")
    every = (scatter,) if isinstance(scatter, Scatter) else tuple(scatter)
    check(every)
    tuned = Tuned(replace(system, outputs=system.outputs[:1]), {})
    tuned.check(every)
    balance = {"harmonics": harmonics, "samples": points or max(64, 16 * harmonics)}
    asked = Asked(tuned, every, f, seed, balance, stuck)
    ensemble.ready(asked, samples, rare)
    found = ensemble.run(asked, samples, until, workers, executor=executor, report=report)
    if rare:
        found.rare = ensemble.choose(found, rare, workers, executor=executor, report=report)
    _warn("mistune", [*fed(system), *found.unsure])
    return found
