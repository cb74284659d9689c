"""What a reader of a case's responses must know, in sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby, pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from ..contact.jenkins import Jenkins
from ..data import Array
from ..harmonic_balance import FrequencyResponse
from ..harmonic_balance.problem import Problem
from ..harmonic_balance.reduced import stuck, stuck_damping, untouched
from ..harmonic_balance.response import HarmonicResponse, unsolved
from ..harmonic_balance.sweeps import overhanging
from ..results.checks import UNCERTAIN, cause
from ..results.names import apart
from ..series import fourier
from ..time_domain.swept import SettledMotion, nearer
from ..units import Quantity, counted, percent
from .assemble import Built
from .problem import book_models
from .settings import CaseSettings

if TYPE_CHECKING:
    from .beyond import Beyond
    from .curves import Followed

CUT = "the time is over"
"""Status of a curve whose time was over before it ended."""

OPEN = 0.01
"""Share of points and time that may be open in the book's mode before a message is made."""


REMEDIES = {
    "energy": "",
    "fold": "microslip respond CASE --over frequency draws the curve",
    "gaping contacts": "press them by a normal force or an interference, or hold the bodies",
    "iteration limit": "change sweep.points a little or the normal force",
    "no balance": "",
    "not a number": "see the law's settings",
    "read-out": "",
}
"""What to do about a cause, where the status of the point does not say it."""


SAID = 3
"""Frequencies, and normal forces, that a sentence names; the others are counted."""


def off(likely: float) -> str:
    """By how much an amplitude is likely to be off, and on which side: "12 % (too high)"."""
    return f"{percent(abs(likely))} (too {'high' if likely > 0 else 'low'})"


def by_the_book(built: Built) -> list[str]:
    """That it is the book's mode, and how far its tables are off."""
    if built.settings.mode != "book":
        return []
    models = book_models(built.assembly, built.settings.strips)
    errors: dict[str, str] = {}  # of every table, by the hash of its law
    for i, c in enumerate(built.assembly.contacts):
        for table in models[i].tables:
            of = f"the stiffness (normal law of {c.name})" if table.kind == "normal" else "what friction holds (orbits)"
            errors.setdefault(table.law, f"{table.error:.2g} of {of}")
    return [
        "Book mode (Sextro 5.2): one harmonic, normal forces that do not change friction within a cycle, elliptic "
        f"orbits; its tables are off by at most {' and '.join(errors.values())}. microslip respond CASE --compare-book "
        "shows what the mode leaves out."
    ]


def method(settings: CaseSettings, errors: Mapping[float, Mapping[float, float]] = MappingProxyType({})) -> str:
    """That an answer is that of one harmonic, or of too few, and what it is likely to be off by; nothing where they are
    enough.

    Args:
        errors: normal force (N) -> Hz -> see `CaseResult.errors`.
    """
    if not settings.contacts:
        return ""
    count = settings.balanced
    told = "One harmonic, the method of the book (Sextro 5.2)" if count == 1 else f"{count} harmonics"
    if settings.mode == "book":
        return (
            "Book mode (Sextro 5.2): one harmonic, constant normal forces, elliptic orbits; what it leaves "
            "out is not estimated: microslip respond CASE --compare-book shows it."
        )
    each = [(abs(e), e, n) for n, own in errors.items() for e in own.values() if np.isfinite(e)]
    if not each:
        return f"{told}; what it leaves out is not estimated." if count == 1 else ""
    most, share, normal = max(each)
    if most <= UNCERTAIN:
        return ""
    nine = "harmonics = 9, about nine times the work, shows the motion as it is"
    more = nine if count == 1 else f"take harmonics = {2 * count}"
    off_by = f"amplitudes are off by up to about {off(share)}, most under F_N = {normal:g} N"
    return f"{told}: {off_by}; {more}."


def between_equilibria(built: Built) -> list[str]:
    """A message where the static normal force is one between two equilibria of a speed range."""
    error = max(b.group.checks.get("normal_force_error", 0.0) for b in built.bodies.values())
    if built.settings.sweep.normal_forces != "static" or not error:
        return []
    return [f"The static normal force is interpolated between two equilibria of the speed range, to {error:.3g} N."]


def of_stuck_modes(built: Built, normal: float | None) -> list[str]:
    """How much more damping of the stuck modes takes where contacts slide or open. normal: N, see `Built.pressed`."""
    asked = built.settings.stuck_ratios
    if asked is None or not built.settings.contacts:
        return []
    part = built.pressed(normal).joined(1)
    f, D = (of(untouched(part), np.zeros((0, 0))) for of in (stuck, stuck_damping))
    inside = np.flatnonzero((D > 2 * max(asked)) & (f < built.settings.sweep.stop * built.settings.balanced))
    if not len(inside):
        return []
    at = inside[D[inside].argmax()]
    return [
        f"Damping of the stuck modes takes more where contacts slide or open: {100 * D[at]:.3g} % at {f[at]:.5g} Hz, a "
        'mode without contacts. There damping = "structural" keeps what the bodies have.'
    ]


def too_coarse(settings: CaseSettings, stuck: Array, damping: Array) -> list[str]:
    """Where the step is wider than the resonances with sticking contacts (Hz), the narrowest ones that friction leaves.

    Modes narrower than the step have points of their own, but a peak on the flank of another may show at none of them.
    """
    sweep = settings.sweep
    step = (sweep.stop - sweep.start) / (sweep.points - 1)
    inside = np.flatnonzero((stuck > sweep.start) & (stuck < sweep.stop))
    if not len(inside):
        return []
    widths = 2 * damping[inside] * stuck[inside]
    at, width = float(stuck[inside[widths.argmin()]]), float(widths.min())
    if step <= 4 * width:
        return []
    return [
        f"The step of {step:.3g} Hz is wide against a resonance with sticking contacts ({at:.5g} Hz, half-power width "
        f"{width:.3g} Hz). Modes narrower than the step have points of their own and peaks are searched for between "
        "the points, but one close beside a higher one may be missing; raise sweep.points to see."
    ]


def idle(forces: Sequence[float]) -> list[str]:
    """A message where nothing moves the first read-out."""
    if not forces:
        return []
    pressed = ", ".join(f"{normal:g}" for normal in forces)
    return [
        f"At F_N = {pressed} N the first read-out does not move: it has no resonances; read "
        "another direction or another monitor."
    ]


def not_periodic(normal: float, unsteady: Array, settings: CaseSettings) -> list[str]:
    worst = float(unsteady.max(initial=0.0))
    if worst < 1e-3:
        return []
    todo = "lower periodicity" if settings.periodicity > 1e-4 else "raise cycles"
    return [
        f"At F_N = {normal:g} N the sliders were not periodic after {settings.cycles} cycles at most: contact forces "
        f"change by up to {percent(worst)} in the next one; {todo}."
    ]


def lifting(built: Built, problem: Problem, found: HarmonicResponse, normal: float) -> list[str]:
    """A message where points would lift off in the book's mode, whose friction does not know of it."""
    if built.settings.mode != "book" or not lifted(built, found).any():
        return []
    share = np.where(found.converged[:, None], found.open, 0.0)
    at, which = np.unravel_index(int(share.argmax()), share.shape)
    return [
        f"At F_N = {normal:g} N points of {problem.assembly.contacts[which].name} would lift off, for "
        f"{percent(share[at, which])} of points and time at {found.frequency[at]:.6g} Hz; the book's mode takes "
        'their friction for that of a closed contact: compare with mode = "aft".'
    ]


def lifted(built: Built, found: HarmonicResponse) -> Array:
    """(f,) bool, points at which contacts would lift off though what stands for their law does not follow it."""
    return lifts(built, found.open) & found.converged


def lifts(built: Built, share: Array) -> Array:
    """(f,) bool, the same by the shares (f, c) of points and time at which contacts are open."""
    if built.settings.mode == "book":
        return np.asarray((share > OPEN).any(axis=1))
    count = len(built.contacts)  # of a sector; the others of a ring follow
    never = [i for i in range(share.shape[1]) if not built.contacts[i % count].what.opens]
    return np.asarray((share[:, never] > 0).any(axis=1))


def pulling(built: Built, found: HarmonicResponse, normal: float) -> list[str]:
    """A message where contacts that do not open would."""
    pulls = lifted(built, found)
    if not normal or built.settings.mode == "book" or not pulls.any():
        return []
    low, high = found.frequency[pulls][[0, -1]]
    return [
        f"At F_N = {normal:g} N the contacts would lift off between {low:.4g} and {high:.4g} Hz, which law = "
        '"jenkins" does not follow; write law = "smooth" in the contacts.'
    ]


def across(problem: Problem, found: HarmonicResponse, normal: float) -> list[str]:
    """A message on the Jenkins elements whose spring without a slider pulls most above what friction would hold."""
    worst, said, first = 1.0, list[str](), 0
    wave = fourier(problem.harmonics, 8 * (problem.harmonics + 1))[0][:, 1:]
    for contact in problem.assembly.contacts:
        law, rows = contact.patch.law, slice(first, first := first + contact.patch.count)
        if not isinstance(law, Jenkins) or not law.held:
            continue
        ways = contact.patch.kinematics[:, 3 - law.slider] @ found.contact[found.converged, rows, 1:] @ wave.T
        force = float(law.across) * np.abs(ways).max(axis=(1, 2), initial=0.0)
        if force.max(initial=0.0) > worst * float(law.held):
            worst, at = float(force.max() / law.held), found.frequency[found.converged][force.argmax()]
            said = [
                f"At F_N = {normal:g} N and {at:.5g} Hz {contact.name} is pulled along t{3 - law.slider} by up to "
                f'{percent(worst)} of what friction holds, and law = "jenkins" slides along t{law.slider} alone; '
                f'write law = {{ kind = "jenkins", slides_along = "t{3 - law.slider}" }}, or law = "smooth".'
            ]
    return said


def folded(folds: Mapping[float, Sequence[tuple[float, float]]], of: Quantity) -> list[str]:
    """A message on places where a response is highest because its curve ends there."""
    return [
        f"At F_N = {normal:g} N the curve that the sweep follows turns back, at a fold, or ends at {at:.6g} Hz and "
        f"{of.sized(height)}: that is no resonance, beyond it there is another motion."
        for normal, peaks in folds.items()
        for at, height in peaks
    ]


def overhangs(
    responses: Mapping[float, FrequencyResponse], resonances: Mapping[float, list[tuple[float, float]]]
) -> list[str]:  # fmt: skip
    """A message on resonances that a sweep jumps past."""
    found = {normal: overhanging(r, resonances[normal]) for normal, r in responses.items()}
    return [
        f"At F_N = {normal:g} N the resonance at {', '.join(f'{f:.6g}' for f, _ in peaks)} Hz overhangs: beside it "
        "there are several motions at one frequency, and the sweep came along another one (a dot in the picture); "
        "microslip respond CASE --over frequency draws the whole curve."
        for normal, peaks in found.items()
        if peaks
    ]


def not_converged(responses: Mapping[float, HarmonicResponse]) -> list[str]:
    """A message for each normal force and cause."""
    found = []
    for normal, r in responses.items():
        failed = {f: text for f, text, ok in zip(r.frequency, r.status, r.converged, strict=True) if not ok}
        for why in dict.fromkeys(map(cause, failed.values())):
            at = [f for f, text in failed.items() if cause(text) == why]
            remedy = REMEDIES.get(why, REMEDIES["iteration limit"])
            many = f"At F_N = {normal:g} N {counted(len(at), 'point')} did not converge"
            said = f"{many}, first at {at[0]:.6g} Hz: {failed[at[0]]}"
            found.append(said + (f"; {remedy}." if remedy else "."))
    return found


def not_found(
    responses: Mapping[float, HarmonicResponse], resonances: Mapping[float, Sequence[tuple[float, float]]]
) -> list[str]:  # fmt: skip
    """A message for each normal force without a resonance under which points have no solution."""
    return [
        f"At F_N = {normal:g} N no resonance was found, though there may be one: {unsolved(r)}."
        for normal, r in responses.items()
        if not resonances[normal] and unsolved(r)
    ]


def at_places(places: Mapping[float, Sequence[float]]) -> str:
    """Normal force (N) -> frequencies (Hz), in words."""
    said = [
        f"at {_some([f'{f:.6g}' for f in at], ' Hz')} under F_N = {force} N"
        for force, at in zip(apart(list(places)), places.values(), strict=True)
    ]
    return _some(said, "", "; ", " normal forces")


def _some(names: Sequence[str], unit: str, between: str = ", ", what: str = "") -> str:
    """The first of some names, and how many more there are."""
    more = f" and {len(names) - SAID} more{what}" if len(names) > SAID else ""
    return between.join(names[:SAID]) + unit + more


# motions in time ---------------------------------------------------------------------------------------------------


def what_moves(b: Beyond) -> list[str]:
    """Which motion is reached from rest, which other ones there are, how high, and how they are
    reached; what the curve of periodic motions is and whether it is stable."""
    return [*_in_time(b), *(_of_curve(one, b.patience) for one in b.curves), *_stable(b)]


def _in_time(b: Beyond) -> list[str]:
    of = f"Under F_N = {b.normal:g} N"
    if b.why:
        more = "respond --over frequency follows the curve"
        return [f"{of} motions in time are not known: {b.why}; {more}."]
    if b.cut and not b.down:
        return [f"{of} motions in time are not known.", *_cut(b)]
    if not b.down:
        return []
    top = max(b.down, key=lambda m: m.swing)
    highest = f"at most {b.quantity.sized(top.swing, 3)} at {top.frequency:.5g} Hz"
    if two := b.two:
        top = max((high for _, high in two), key=lambda m: m.swing)
        said = [
            f"{of} there are two motions {_span([m for m, _ in two])}, found by integrating in time; the higher one "
            f"swings by up to {b.quantity.sized(top.swing, 3)} at {top.frequency:.5g} Hz.",
            *_from_rest(b, two),
            *_left(b, two),
        ]
    elif b.cut:
        said = [f"{of} motions in time are known in part, {highest}."]
    else:
        said = [f"{of} sweeps in time, upwards and downwards, meet the same motion, {highest}."]
    return [*said, *_cut(b), *_wild(b)]


def _span(motions: Sequence[SettledMotion], words: str = "") -> str:
    """Where motions are, in words."""
    f = [m.frequency for m in motions]
    low, high = min(f), max(f)
    return f"at {low:.5g} Hz" if low == high else f"{words}from {low:.5g} to {high:.5g} Hz"


def _cut(b: Beyond) -> list[str]:
    """Where the time for motions was over, and what to do."""
    if not b.cut:
        return []
    way, f = b.cut
    return [
        f"Motions in time ended with their share of {b.patience:g} s, {way} before {f:.5g} Hz: what comes then is not "
        f"known; run again with --set sweep.patience={2 * b.patience:g}, which goes on from there."
    ]


def _from_rest(b: Beyond, two: Sequence[tuple[SettledMotion, SettledMotion]]) -> list[str]:
    """Which of two motions is reached from rest, in ranges of frequency."""
    at = {low.frequency: (low, high) for low, high in two}
    known = sorted((m for m in b.rest if m.frequency in at), key=lambda m: m.frequency)
    if not known:
        return []
    runs = list[str]()
    for higher, group in groupby(known, lambda m: nearer(m, *at[m.frequency])):
        run = list(group)
        contacts = "open" if any(m.opens for m in run) else "closed"
        top = b.quantity.sized(max(m.amplitude for m in run), 3)
        which = "higher" if higher else "lower"
        runs.append(f"the {which} one {_span(run)} (contacts {contacts}, at most {top})")
    return [f"From rest it comes to {', to '.join(runs)}."]


def _left(b: Beyond, two: Sequence[tuple[SettledMotion, SettledMotion]]) -> list[str]:
    """Where each sweep leaves the motion on which it comes."""
    said = []
    for way, motions, other, pair in (("up", b.up, b.down, two[-1]), ("down", b.down, b.up, two[0])):
        i = next(i for i, m in enumerate(motions) if m.frequency == pair[0].frequency)
        which = "lower" if motions[i] is pair[0] else "higher"
        alike = {m.frequency for m in other}  # beyond the last place where both differ
        until = next((j for j in range(i + 1, len(motions)) if motions[j].frequency in alike), i)
        steps = list(pairwise(motions[i : until + 1]))
        last, after = max(steps, key=lambda s: s[0].distance(s[1]), default=(motions[-1], None))
        on = f"{last.frequency:.5g} Hz ({b.quantity.sized(last.amplitude, 3)})"
        at = after and f" and is at {b.quantity.sized(after.amplitude, 3)} at {after.frequency:.5g} Hz"
        ends = at or ", where it ends"
        said.append(f"A slow sweep {way}wards stays on the {which} one {way} to {on}{ends}.")
    return said


def _wild(b: Beyond) -> list[str]:
    """Where motions are irregular."""
    if not b.irregular:
        return []
    top = b.quantity.sized(max(m.swing for m in b.irregular), 3)
    span = _span(b.irregular, "at frequencies ")
    return [f"Motions are irregular, without a period, {span}, with swings of up to {top}."]


def _of_curve(one: Followed, patience: float) -> str:
    """A curve in a sentence; patience: s after which it was cut, if it was."""
    said = f"Curve of periodic motions, {one.sentences()[0]}"
    more = f"; it goes on from {one.parameter[-1]:.5g} Hz (respond --over frequency)."
    if one.status == CUT and one.rows:
        more = f"; after {patience:g} s it is left at {one.parameter[-1]:.5g} Hz, run again with --set "
        more += f"sweep.patience={2 * patience:g}, which goes on from there."
    return said.removesuffix(".") + more if one.status.startswith(("points", CUT)) else said


def _stable(b: Beyond) -> list[str]:
    """How many of the motions on the curves are stable, where some are not, and beside which of
    these motions in time stay."""
    looked = [
        (float(one.parameter[i]), float(one.amplitude[i]), s.stable)
        for one, each in zip(b.curves, b.stability, strict=True)
        for i, s in each.items()
    ]
    if not looked:
        return []
    lost = sorted((f, amplitude) for f, amplitude, stable in looked if not stable)
    many = f"{len(looked) - len(lost)} of {counted(len(looked), 'motion')} that were looked at are stable"
    said = f"On the curve, by harmonic balance with {b.samples} samples of a cycle, {many}"
    if not lost:
        return [f"{said}."]
    left = f"those that are not, {_between([f for f, _ in lost])}, are left at the least disturbance"
    about = [(f, m) for f, amplitude in lost for m in b.beside(f, amplitude)]
    if not about:
        return [f"{said}; {left}: what is reached, motions in time say."]
    varies = percent(max(1 - m.least / m.swing for _, m in about))
    return [
        f"{said}; {left}. Beside them, {_between([f for f, _ in about])}, motions in time stay, as high and with "
        f"swings that differ from period to period by up to {varies}."
    ]


def _between(frequencies: Sequence[float]) -> str:
    """Where some of several points are, in order, in words."""
    low, high = frequencies[0], frequencies[-1]
    return f"at {low:.5g} Hz" if low == high else f"between {low:.5g} and {high:.5g} Hz"
