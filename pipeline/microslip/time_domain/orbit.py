"""Integrating an assembly, and what a motion in time says of itself."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import h5py
import jax
import numpy as np
import scipy.linalg

from ..contact.point import saws
from ..contact.set_valued import SetValued
from ..data import Array
from ..errors import NotConverged, UserError
from ..files.hdf5 import put, sealed
from ..interrupts import look
from ..progress import Report
from ..settings.mistakes import bounded, numbered
from ..system.assembly import Contact
from ..units import METRES, UNIT_OF_FREQUENCY, Quantity, counted, hertz
from . import classification
from .bodies import Hardest, MotionState, Snapshot
from .classification import Exponent
from .equations import MotionEquations
from .ground import steps_of_waves
from .samples import ENERGIES, ROWS, STRIP, Announced, KeptSamples, announced, of_period, read, units_with
from .starts import PeriodicStart, Released
from .starts import begun as on_its_way
from .stepper import KINDS, Stepper, static_force

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Start = Literal["static", "rest"] | Released

FORMAT = "microslip-orbit"
FORMAT_VERSION = "0.1"

OF_CONTACT = 150
"""Steps in a period of the fastest motion with closed contacts, if nothing is asked for."""

OF_PERIOD = 512
"""Steps in a period of the excitation at least."""

STABLE = 1.8
"""Steps times the rate of the contacts above which kicks may grow; they do above 2."""

PAUSE = 0.5
"""s between two reports, about: as long as periods that are left to themselves are done in one call."""

FURTHER = 64
"""Times as many periods as before that are done in a call at most, so that what the first one took is no chance."""

PENETRATES = 1e-6
"""Share of an interference by which a contact may be pressed deeper than it is under the steady loads."""

BEHIND = 1e-12
"""m by which a point may begin behind what is rigid: rounding."""

UNSOLVED = 1e-6
"""Share of the largest motion of the contacts that an implicit step may miss before a reader is told."""

AFTER = 16
"""Periods at most over which it is watched how errors die away or grow."""

APART = 1e-4
"""Share of its size by which two motions are apart to see how errors live on: above those of a step."""

FOLLOWED = 0.1
"""Share of the largest read-out: with a larger error a motion is not that of its start."""

STILL = 1e-6
"""Share of the displacements, times their frequencies, below which a swing is none."""

REPEATS = 1e-3
"""Share of the size of a motion within which it counts as having come back."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Ended:
    """How a motion ended.

    Attributes:
        steps: of a period. error: estimate of the largest deviation of a read-out that all periods together leave,
            those that are not kept too, if each of them was as hard for the steps as the hardest was; a share of the
            largest read-out at the end, 1 at most; nan if it was not looked for. diverged: time (s) at which numbers
            became infinite; inf: never. exponent: the largest Lyapunov exponent, looked for where the motion does not
            come back; None: it was not.
    """

    steps: int
    error: float = math.nan
    diverged: float = math.inf
    messages: tuple[str, ...] = ()
    exponent: Exponent | None = None

    @property
    def told(self) -> dict[str, Any]:
        """As a file has it."""
        facts = {"steps_per_period": self.steps, "error": self.error, "diverged": self.diverged}
        exponent = dict(zip(LYAPUNOV, self.exponent or (), strict=False))
        return {**facts, "messages": list(self.messages), **exponent}


def read_ended(told: Mapping[str, Any]) -> Ended:
    """What `Ended.told` was."""
    exponent = [told[name] for name in LYAPUNOV if name in told]
    return Ended(
        steps=int(told["steps_per_period"]),
        error=float(told["error"]),
        diverged=float(told["diverged"]),
        messages=tuple(json.loads(told["messages"])),
        exponent=Exponent(float(exponent[0]), float(exponent[1]), int(exponent[2])) if exponent else None,
    )


LYAPUNOV = "lyapunov_exponent", "lyapunov_uncertainty", "lyapunov_periods"


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Orbit(Ended, Announced):
    """A motion in time, sampled.

    Attributes:
        arrays: name -> (rows, s) or (s,), as a file has them (`samples.UNITS`), and ``event``. missed: how many events
            are not listed. model: see `equations`. shown: unit of frequencies in sentences.

    ``time``: (s,) s. ``y``, ``v``: (w, s) read-outs in the units of `of`, and their velocities. ``q``, ``q_dot``:
    (m, s) modal coordinates of `MotionEquations.shapes`. ``d``, ``force``: (c, s) of the contact coordinates, m and N.
    ``events``: (e, 3) time in s, number of the contact, kind (an index of `KINDS`).
    """

    arrays: Mapping[str, Array]
    missed: int = 0
    model: MotionEquations | None = None
    shown: str = field(default_factory=UNIT_OF_FREQUENCY.get)

    def __repr__(self) -> str:
        w = self.Omega
        return (
            f"<Orbit: {len(self.time) // self.samples} periods at {w / 2 / np.pi:.6g} Hz ({w:.6g} rad/s); {self.said}>"
        )

    time = property(lambda self: self.array("time"))
    y = property(lambda self: self.array("displacement"))
    v = property(lambda self: self.array("velocity"))
    q = property(lambda self: self.array("modal_displacement"))
    q_dot = property(lambda self: self.array("modal_velocity"))
    d = property(lambda self: self.array("contact_displacement"))
    force = property(lambda self: self.array("contact_force"))
    events = property(lambda self: self.array("event"))

    @property
    def energy(self) -> Mapping[str, Array]:
        """Name -> (s,) J: ``mechanical`` of the bodies; since the start ``given`` by loads and preloads, ``damped``,
        and ``contacts``, done on them; of that, and of what moving ``ground`` gave them, ``stored`` and ``lost``, nan
        where a law does not tell."""
        return {name: self.array(f"energy_{name}") for name in ENERGIES}

    @property
    def equations(self) -> MotionEquations:
        """Those that it was computed with."""
        assert self.model is not None
        return self.model

    def of(self, read_out: int = 0) -> Quantity:
        """What a read-out measures: a displacement, an angle, a strain."""
        return Quantity(self.units[read_out]) if read_out < len(self.units) else METRES

    @property
    def section(self) -> tuple[Array, Array]:
        """The first read-out and its velocity after every period: the Poincare section."""
        last = slice(self.samples - 1, None, self.samples)
        return self.y[0][last], self.v[0][last]

    @property
    def contacts(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(c.name for c in self.touching)

    @property
    def period(self) -> float:
        """s, of the excitation."""
        return 2 * np.pi / self.Omega

    def array(self, name: str, part: slice = slice(None)) -> Array:
        """What a file has under a name, or a part of the samples of it."""
        return np.asarray(self.arrays[name][..., part])

    def strips(self, *names: str) -> Iterator[list[Array]]:
        """Arrays, so many samples at a time."""
        for begin in range(0, len(self.time), STRIP):
            yield [self.array(name, slice(begin, begin + STRIP)) for name in names]

    @cached_property
    def repeats(self) -> int:
        """After how many periods of the excitation the motion comes back within `REPEATS`, in the last half of the
        periods that are kept; 0: it does not within half of them."""
        return comes_back(*self.stroboscopic)

    @cached_property
    def drifts(self) -> float:
        """Share of its size by which a motion that comes back is elsewhere at the end of the last
        half of the periods that are kept than at its beginning; see `classification.SETTLED`."""
        after, size = self.stroboscopic
        last = after[:, after.shape[1] // 2 :]
        if not self.repeats or not size:
            return 0.0
        begin = (last.shape[1] - 1) % self.repeats
        return float(np.abs(last[:, -1] - last[:, begin]).max(initial=0.0) / size)

    @cached_property
    def stroboscopic(self) -> tuple[Array, float]:
        """(2 m, periods) modal coordinates, times their frequency, and velocities after every
        period; by how much the largest of them swings, m kg^1/2 / s."""
        strips = self.strips("modal_displacement", "modal_velocity")
        return stroboscopic(strips, self.omega2, self.Omega, self.samples)

    @cached_property
    def else_repeats(self) -> int:
        """`repeats` of all but the places of bodies that nothing holds."""
        return else_comes_back(*self.stroboscopic, self.omega2, self.Omega)

    def times(self, kind: str, contact: int | None = None) -> Array:
        """Times (s) of the events of a kind ("closes", "opens", "slips", "sticks") in the periods that are kept."""
        if kind not in KINDS:
            raise UserError(f"kind: '{kind}' is none of {', '.join(KINDS)}")
        if contact is not None:
            numbered("contact", contact, len(self.touching), "contact")
        chosen = self.events[:, 2] == KINDS.index(kind)
        return self.events[chosen if contact is None else chosen & (self.events[:, 1] == contact), 0]

    def count(self, kind: str, contact: int | None = None) -> int:
        """Number of those events."""
        return len(self.times(kind, contact))

    @cached_property
    def cycles(self) -> float:
        """Periods of the excitation that are kept, one at least; of a run-up by its phase."""
        if not self.run_up:
            return max(len(self.time) // self.samples, 1)
        turned = sum(float(w.sum()) for (w,) in self.strips("angular_frequency")) * self.period / self.samples
        return max(turned / (2 * np.pi), 1.0)

    def repeated(self, periods: int) -> int:
        """Of so many periods those that are whole repetitions of a motion that comes back, or all."""
        return periods // self.repeats * self.repeats if self.repeats else periods

    def _a_period(self, times: Array) -> float:
        """Events at times (s) per period of the excitation, over whole repetitions of a motion that comes back."""
        if self.run_up or len(self.time) < self.samples:
            return len(times) / self.cycles
        periods = self.repeated(len(self.time) // self.samples)
        return int((times > self.time[-1] - periods * self.period).sum()) / periods

    @property
    def impacts(self) -> float:
        """Impacts of all contacts per period of the excitation."""
        return self._a_period(self.times("closes"))

    @property
    def slips(self) -> float:
        """Times that a contact with friction begins to slide, per period of the excitation."""
        rubbing = [i for i in range(len(self.touching)) if classification.rubs(self, i)]
        return sum(self._a_period(self.times("slips", i)) for i in rubbing)

    @cached_property
    def said(self) -> str:
        """What motion it is, in words."""
        return classification.said(self)

    @property
    def frequency(self) -> Array:
        """(s,) Hz of the excitation; it changes in a run-up."""
        return self.array("angular_frequency") / (2 * np.pi)

    @property
    def run_up(self) -> str:
        """What a run-up met, in words; empty if it is none."""
        begun, (last,) = (self.array("angular_frequency", part) for part in (slice(2), slice(-1, None)))
        if len(begun) < 2 or begun[0] == last:
            return ""
        first = begun[0] - (begun[1] - begun[0]) / (self.time[1] / self.time[0] - 1)  # at time 0, before any sample
        top, at = -1.0, 0.0
        for y, w in self.strips("displacement", "angular_frequency"):
            if len(y) and (high := float(np.abs(y[0]).max())) > top:
                top, at = high, float(w[np.abs(y[0]).argmax()]) / (2 * np.pi)
        way = "up" if last > first else "down"
        sentence = f"run-{way} from {hertz(first / 2 / np.pi, self.shown)} to {hertz(last / 2 / np.pi, self.shown)}"
        return f"{sentence}, largest at {hertz(at, self.shown)}" if self.labels else sentence

    @property
    def drift(self) -> float:
        """Share of the energy that passed through the contacts by which what they store and lost differs from it."""
        gone, passed, first = 0.0, Range(), None
        ground = Range()
        for contacts, by_ground, stored, lost in self._energies("contacts", "ground", "stored", "lost"):
            left = contacts + by_ground - stored - lost
            first = left[0] if first is None else first
            gone = np.maximum(gone, np.abs(left - first).max())
            passed.see(contacts)
            ground.see(by_ground)
        most = max(passed.width, ground.width)
        return float(gone / most) if most else 0.0

    @property
    def balance(self) -> float:
        """Largest deviation of the bodies' energy from what they got, a share of what was given or is there at most."""
        left, gained, most = Range(), Range(), 0.0
        for mechanical, supplied, damped, contacts in self._energies("mechanical", "given", "damped", "contacts"):
            left.see(mechanical - supplied + damped + contacts)
            gained.see(supplied)
            most = max(most, float(np.abs(mechanical).max(initial=0.0)))
        size = max(most, gained.width)
        return left.width / size if size else 0.0

    def _energies(self, *names: str) -> Iterator[list[Array]]:
        return self.strips(*(f"energy_{name}" for name in names))

    # tables and files ------------------------------------------------------------------------------------------------

    def to_dataframe(self) -> Any:
        """Read-outs, their velocities and energies as a `pandas.DataFrame`, a row a sample."""
        import pandas

        y, v = self.y, self.v
        columns = {"time_s": self.time}
        for i, label in enumerate(self.labels):
            columns |= {self.of(i).column(label): y[i], f"{self.of(i).column(label)}_per_s": v[i]}
        return pandas.DataFrame({**columns, **{f"{name}_J": values for name, values in self.energy.items()}})

    def to_xarray(self) -> Any:
        """Everything as an `xarray.Dataset` over the axis ``time``; events have an axis of their own, units are
        attributes."""
        import xarray

        variables = {
            name: ((ROWS[name], "time") if name in ROWS else ("time",), self.array(name), {"units": unit})
            for name, unit in units_with(self.units).items()
            if name != "time"
        }
        when, where, kind = self.events.T
        variables |= {
            "event_time": (("event",), when, {"units": "s"}),
            "event_contact": (("event",), np.array(self.contacts, dtype=str)[where.astype(int)], {}),
            "event_kind": (("event",), np.array(KINDS)[kind.astype(int)], {}),
        }
        coords = {"time": ("time", self.time, {"units": "s"}), "read_out": list(self.labels)}
        attrs = {"Omega": self.Omega, "samples_per_period": self.samples, "said": self.said, **self._facts}
        return xarray.Dataset(variables, coords=coords, attrs={**attrs, "messages": list(self.messages)})

    @property
    def _facts(self) -> dict[str, Any]:
        return {"steps_per_period": self.steps, "missed_events": self.missed, **self.told}

    def save(self, path: Path | str) -> Path:
        """Write a file of this motion (``docs/time_domain.md``), complete or absent; `load` reads it.

        Raises:
            UserError: no permission, no space; a file that is none of motions stands there.
        """
        with sealed(path) as file:
            head(file)
            group = file.create_group("motion_1")
            replace(self, name=f"{self.Omega:.6g} rad/s").put(group)
            for name, unit in units_with(self.units).items():
                put(group, name, self.array(name), unit)
            put(group, "event", self.events)
            tell(group, self._facts)
        return Path(path)

    def plot(self, axes: Axes | None = None, read_out: int = 0) -> Axes:
        """Draw its phase portrait: velocity over displacement of a read-out, and a point after every period.

        Args:
            axes: of matplotlib, new ones with a legend if not given. read_out: its number.
        """
        numbered("read_out", read_out, len(self.labels), "read-out")
        alone = axes is None
        if axes is None:
            import matplotlib.pyplot as plt

            axes = plt.subplots(layout="constrained")[1]
        y, v, last = self.y[read_out], self.v[read_out], slice(self.samples - 1, None, self.samples)
        (by, unit), (rate, per_second) = (self.of(read_out).scale(np.abs(x).max(initial=0.0)) for x in (y, v))
        axes.plot(by * y, rate * v, color="#0b4f9c", linewidth=0.7)
        axes.plot(by * y[last], rate * v[last], "o", color="#c8382c", markersize=4, label="after every period")
        axes.set(xlabel=f"{self.labels[read_out]} in {unit}", ylabel=f"velocity in {per_second}/s")
        if alone:
            axes.legend(fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False)
        return axes


@dataclass
class Range:
    """Between what some numbers lie."""

    low: float = math.inf
    high: float = -math.inf

    def see(self, values: Array) -> None:
        self.low = np.minimum(self.low, values.min(initial=math.inf))
        self.high = np.maximum(self.high, values.max(initial=-math.inf))

    @property
    def width(self) -> float:
        """0 where there were none; nan where one was."""
        return 0.0 if self.low > self.high else float(self.high - self.low)


def head(file: h5py.File) -> None:
    """Of a file of motions."""
    file.attrs["format"], file.attrs["format_version"] = FORMAT, FORMAT_VERSION
    file.attrs["units"] = "SI: m, kg, s, N, rad"


def tell(group: h5py.Group, told: Mapping[str, Any]) -> None:
    """What a motion says of itself beside its arrays."""
    for key, value in told.items():
        group.attrs[key] = json.dumps(value) if isinstance(value, list) else value


def stroboscopic(
    strips: Iterable[list[Array]], omega2: Array, Omega: float, samples: int
) -> tuple[Array, float]:  # fmt: skip
    """See `Orbit.stroboscopic`, of strips of modal displacements and velocities. A body that
    nothing holds swings by its velocity, or it would seem to come back the further it is; and
    nothing swings by less than `STILL`."""
    rows = 2 * len(omega2)
    after, begin, most, fast = [np.zeros((rows, 0))], 0, 0.0, 0.0
    low, high = np.full(rows, math.inf), np.full(rows, -math.inf)
    for q, q_dot in strips:
        z = np.concatenate([classification.pace(omega2, Omega)[:, None] * q, q_dot])
        low = np.minimum(low, z.min(axis=1, initial=math.inf))
        high = np.maximum(high, z.max(axis=1, initial=-math.inf))
        most, fast = (max(a, float(np.abs(x).max(initial=0.0))) for a, x in ((most, z), (fast, q_dot)))
        after.append(z[:, (-1 - begin) % samples :: samples])
        begin += z.shape[1]
    swings = 0.5 * (high - low)[: len(omega2)][classification.held(omega2, Omega)]
    return np.concatenate(after, axis=1), max(float(swings.max(initial=0.0)), fast, STILL * most)


def else_comes_back(after: Array, size: float, omega2: Array, Omega: float) -> int:
    """See `Orbit.else_repeats`."""
    held = classification.held(omega2, Omega)
    return comes_back(after[np.append(held, np.ones_like(held))], size)


def comes_back(after: Array, size: float) -> int:
    """See `Orbit.repeats`. The last half, where the start is forgotten best, is held against what was p periods before:
    in a multiple of p less of a start may show, and it would be found first. A motion that comes in from one side and
    from the other in turn has not twice its period."""
    half = after.shape[1] // 2
    for p in range(1, half + 1):
        if _missed(after, p).max(initial=0.0) <= REPEATS * size:
            return next((d for d in range(1, p) if p % d == 0 and _left(_missed(after, d), p) <= REPEATS * size), p)
    return 0


def _missed(after: Array, p: int) -> Array:
    """(half,) by how much states (n, count) of the last half miss those p periods before."""
    count = after.shape[1]
    return np.abs(after[:, count // 2 :] - after[:, count // 2 - p : count - p]).max(axis=0, initial=0.0)


def _left(missed: Array, p: int) -> float:
    """What is missed in the end, if it falls geometrically: by three parts of the last half, each of some times p."""
    part = len(missed) // 3 // p * p
    if not part:
        return math.inf
    first, second, last = missed[-3 * part :].reshape(3, part).max(axis=1)
    falls, less = first - second, second - last
    return last - less**2 / (falls - less) if falls > less > 0 else last


def run(
    equations: MotionEquations, settle: int, keep: int, samples: int = 256, steps: int | None = None,
    start: Start | PeriodicStart = "static", report: Report = lambda _: None,
) -> Orbit:  # fmt: skip
    """Motion in time from a start: see `microslip.integrate`.

    Args:
        settle: periods that are left to themselves. keep: that are kept. samples, steps: of a period.

    Raises:
        UserError: steps that are too few for the contacts' springs. NotConverged: no state of rest is found.
    """
    kept = KeptSamples()
    ended = march(equations, settle, keep, samples, steps, start, report, kept)
    facts = vars(announced(f"{equations.Omega:.6g} rad/s", equations, samples)) | vars(ended)
    return Orbit(arrays=kept.arrays(equations), missed=kept.missed, model=equations, **facts)


def march(
    equations: MotionEquations, settle: int, keep: int, samples: int, steps: int | None, start: Start | PeriodicStart,
    report: Report,
    kept: KeptSamples,
) -> Ended:  # fmt: skip
    """`run`, its samples kept elsewhere, and gone on with where that has been begun."""
    for name, value, least in (("settle", settle, 0), ("keep", keep, 1), ("samples", samples, 8)):
        bounded(name, value, ge=least)
    each = steps_of_a_sample(equations, samples, steps)
    stepper = Stepper(equations, 2 * np.pi / equations.Omega / (each * samples))
    first = on_its_way(stepper, start) if isinstance(start, PeriodicStart) else stepper.start(*begun(equations, start))
    (now, hardest), done = kept.begun((first, Hardest(-1.0, 0.0)))
    many, reported = 1, time.monotonic()
    while done < settle + keep:
        look()
        before, dense = now, done >= settle
        ahead, began = 1 if dense else min(many, settle - done), time.monotonic()
        rows = np.full(samples, each if dense else each * samples)
        now, seen, listed, count, among = stepper.advanced(now, rows, samples if dense else ahead)
        if dense:
            among = Hardest(float(now.missed) - float(before.missed), float(before.time))
        hardest = max(hardest, among, key=lambda one: float(one.missed))
        done, kept.met = done + ahead, kept.met + count
        if not np.isfinite(seen.mechanical[-1]):
            when, why = _divergence(stepper, before, seen, kept if dense else None)
            return Ended(steps=each * samples, diverged=when, messages=(why,))
        if dense:
            kept.keep(of_period(equations, seen), listed, count - len(listed))
        kept.mark((now, hardest), done)
        if time.monotonic() - reported >= PAUSE or done in (settle, settle + keep):
            met = counted(kept.met, "event")
            report(f"{done} of {settle + keep} periods, {float(now.time):.6g} s, {met}")
            reported = time.monotonic()
        took = max(time.monotonic() - began, 1e-6)
        many = int(np.clip(0.5 * PAUSE / took * ahead, 1, FURTHER * ahead))
    error, told = _error(stepper, first, now, hardest, samples, each, settle + keep)
    exponent = _exponent(stepper, now, kept, samples, each, settle + keep)
    more = (*_warnings(equations, kept, float(now.worst)), told, exponent.message if exponent else "")
    beside = start.messages if isinstance(start, PeriodicStart) else ()
    messages = (*beside, *(text for text in more if text))
    return Ended(steps=each * samples, error=error, messages=messages, exponent=exponent)


def _exponent(
    stepper: Stepper, now: MotionState, kept: KeptSamples, samples: int, each: int, done: int
) -> Exponent | None:
    """The largest Lyapunov exponent of a motion that has not come back in what was kept; of so many periods at most as
    were done."""
    periods = classification.periods_of(done)
    e, strips = stepper.equations, kept.strips("modal_displacement", "modal_velocity")
    after, size = stroboscopic(strips, e.omega2, e.Omega, samples)
    few = not periods or after.shape[1] < classification.FEWEST
    if few or e.ramp or else_comes_back(after, size, e.omega2, e.Omega):
        return None
    return classification.exponent(stepper, now, samples, each, periods)


def _divergence(stepper: Stepper, before: MotionState, seen: Snapshot, kept: KeptSamples | None) -> tuple[float, str]:
    """When a motion became infinite, s, and why; what is finite of its last period is kept."""
    finite = np.isfinite(np.asarray(seen.mechanical))
    whole = int(np.argmin(finite))
    sound = Snapshot._make(np.asarray(x)[:whole] for x in seen)
    if kept is not None and whole:
        kept.keep(of_period(stepper.equations, sound), np.zeros((0, 3)), 0)
    when = float(sound.time[-1]) if whole else float(before.time)
    energy = float(sound.mechanical[-1]) if whole else math.nan
    wrong = ~np.isfinite(np.asarray(seen.force)[whole])
    owners = [c.name for c in stepper.equations.contacts for _ in c.offset]
    named = ", ".join(dict.fromkeys(name for name, bad in zip(owners, wrong, strict=True) if bad))
    reached = f"its energy was {energy:.3g} J until then" + (f", the force of {named} is none" if named else "")
    return when, f"From {when:.6g} s on it is no number: {reached}; take more steps, or look for what drives it."


def _warnings(equations: MotionEquations, kept: KeptSamples, worst: float) -> tuple[str, ...]:
    """What a reader must know. worst: m, of the contacts that yield at once."""
    warnings = []
    if any(H.any() for c in equations.assembly.components for H in c.loss.values()):
        warnings.append(
            f"Loss factors (structural damping) have no form in time: dampers that take as much at "
            f"{hertz(equations.Omega / (2 * np.pi))} stand for them, and take h times as much in the h-th harmonic, "
            "where a harmonic balance does not; with modal damping both mean the same."
        )
    if names := [c.name for c in equations.contacts if saws(c.patch.law)]:
        warnings.append(
            f"Static friction above the sliding one ({', '.join(names)}): a point without mass sticks again as soon as "
            "it has slipped, so sliding friction saws between both values, with teeth that hang on the step; "
            'write law = "set-valued" or "rate", or friction that falls with the speed.'
        )
    if worst > UNSOLVED * kept.widest:
        warnings.append(f"Contacts were not solved for in every step, to {worst:.2g} m at worst; take more steps.")
    if kept.missed:
        warnings.append(f"{counted(kept.missed, 'event')} more than are listed, and counted, happened.")
    return tuple(warnings)


@dataclass(frozen=True)
class Again:
    """A period done with the step and with half of it.

    Attributes:
        ends: where both lead to. differ: the largest deviation of a read-out, infinite where one of them became so.
            size: the largest read-out. missed: by its steps, see `MotionState`, and swing: the largest of the motion,
            both in m kg^1/2 / s.
    """

    ends: tuple[MotionState, MotionState]
    differ: float
    size: float
    missed: float
    swing: float


def _again(stepper: Stepper, begin: MotionState, samples: int, each: int) -> Again:
    e, steppers = stepper.equations, ((stepper, each), (stepper.halved(), 2 * each))
    (end, seen, *_), (fine_end, fine, *_) = (s.run(begin, np.full(samples, k)) for s, k in steppers)
    missed, swing = float(end.missed) - float(begin.missed), math.sqrt(2 * seen.mechanical.max(initial=0.0))
    if not np.isfinite(seen.mechanical[-1] + fine.mechanical[-1]):
        return Again((end, fine_end), math.inf, 1.0, missed, swing)
    y, exact, order = read(e, seen), read(e, fine), 4 if stepper.options.halvings else 2
    differ = float(np.abs(y - exact).max(initial=0.0)) * 2**order / (2**order - 1)
    return Again((end, fine_end), differ, float(np.abs(exact).max(initial=0.0)), missed, swing)


def _error(
    stepper: Stepper, first: MotionState, now: MotionState, hardest: Hardest, samples: int, each: int, done: int
) -> tuple[float, str]:  # fmt: skip
    """What all periods together leave in the read-outs, a share of the largest, and what a reader must know.

    The period that follows, done again with half the step, tells what one leaves; the hardest one leaves as much more
    as its steps missed more, by their own reckoning. Where nothing is missed any more, the first period tells what that
    is worth. How two motions that far apart, but for a factor, come nearer or part in `AFTER` periods, or in an eighth
    of those that were done, tells what all periods leave, each as much as the hardest.
    """
    last = _again(stepper, now, samples, each)
    missed = last if last.differ * last.missed > 0 else _again(stepper, first, samples, each)
    if not math.isfinite(last.differ + missed.differ):
        return 1.0, ""
    size, periods = last.size or missed.size or 1.0, min(AFTER, done // 8, samples)
    leaves = (
        missed.differ / missed.missed
        if missed.differ * missed.missed > 0
        else size / (last.swing or missed.swing or 1.0)
    )
    worst = leaves * float(hardest.missed)
    parts = _separations(stepper, *last.ends, samples, each, periods)
    parts = parts if len(parts) else _separations(stepper, *missed.ends, samples, each, periods)
    half = len(parts) // 2
    if not half or not np.isfinite(parts).all():
        return min(1.0, max(last.differ, worst) / size * done), ""
    keeps = max(float((parts[-half:].sum() / (parts[:half].sum() or 1.0)) ** (1 / (len(parts) - half))), 1e-300)
    share = max(last.differ, worst) / size
    n = max(done - 1 - len(parts), 0)
    grown = np.expm1(min(n * np.log(keeps), 100.0))  # beyond it nothing is left of what there was
    more = parts[-half:].mean() * (n if abs(keeps - 1) < 1e-9 else keeps * grown / (keeps - 1))
    whole = min(1.0, share * (1 + parts.sum() + more))
    if keeps <= 1 or whole < FOLLOWED:
        return whole, ""
    return whole, (
        f"Errors grow {keeps:.3g} times in a period: after {done} this motion is one of those possible, not the "
        "one that this start leads to; what it is on average holds all the same."
    )


def _separations(stepper: Stepper, a: MotionState, b: MotionState, samples: int, each: int, periods: int) -> Array:
    """(periods,) how far two motions are apart after each, over what they are now; none where they are not apart."""
    stiff = np.sqrt(np.abs(stepper.equations.omega2)).reshape(len(a.y), -1)
    weights = np.concatenate([stiff, np.ones_like(stiff)], axis=1)

    def far(y: Any) -> float:
        return float(np.linalg.norm(weights * y))

    apart, size = far(np.asarray(a.y) - np.asarray(b.y)), far(np.asarray(a.y))
    if not apart > 0 or classification.whole(a.held.states):
        return np.zeros(0)
    b = classification.between(a, b, APART * size / apart)
    begin, rows = APART * size, np.full(samples, samples * each)
    runs, pace = [stepper.run(now, rows, periods)[1] for now in (a, b)], np.sqrt(np.abs(stepper.equations.omega2))
    phases, neighbour = (np.concatenate([seen.q * pace, seen.q_dot], axis=1) for seen in runs)
    if len(phases) != len(neighbour):  # one of them became infinite
        return np.zeros(0)
    return np.linalg.norm(phases - neighbour, axis=1) / begin


def steps_of_a_sample(e: MotionEquations, samples: int, steps: int | None) -> int:
    """Steps from one sample to the next, a power of two where nothing is asked for.

    Raises:
        UserError: so few that the contacts' springs would make the motion grow.
    """
    if steps is None:
        wanted = max(OF_PERIOD, OF_CONTACT * e.fastest / e.Omega, steps_of_waves(e.contacts, 2 * np.pi / e.Omega))
        return int(2 ** max(0, math.ceil(math.log2(wanted / samples))))
    least = math.ceil(2 * np.pi / e.Omega * e.rate / STABLE)
    if steps < least:
        raise UserError(
            f"steps: {steps} a period are unstable with the springs of these contacts; take {least} or more"
        )
    if steps < (least := steps_of_waves(e.contacts, 2 * np.pi / e.Omega)):
        raise UserError(f"steps: {steps} a period are too few for the waviness of the ground; take {least} or more")
    return max(1, math.ceil(steps / samples))


def begun(e: MotionEquations, start: Start) -> tuple[Array, Array]:
    """(m,) modal displacements and velocities to start from.

    Raises:
        NotConverged: Newton's method finds no rest under the steady loads. UserError: no such
            start, or one behind a rigid stop.
    """
    if isinstance(start, Released):
        q, v = start.q, start.v
    elif start in ("static", "rest"):
        q, v = _at_rest(e, start == "static"), np.zeros(len(e.omega2))
    else:
        raise UserError(f"start: '{start}' is none of static, rest, balance")
    refuse_behind(e, q)
    return q, v


def _at_rest(e: MotionEquations, loaded: bool) -> Array:
    """(m,) under the steady loads, or as preloaded."""
    tight = any(c.offset[0] > 0 and not c.preload.any() for c in e.contacts)
    if loaded and (e.still[0].any() or tight or any(map(_closed, e.contacts))):
        return _static(e)
    if not loaded and tight and not e.R.any():
        _refuse_penetration(e, _static(e))
    return np.zeros(len(e.omega2))  # preloads are in balance there


def _closed(contact: Contact) -> bool:
    """Whether a law whose gap is its own presses at q = 0, without a preload that balances it."""
    if contact.preload.any() or isinstance(contact.patch.law, SetValued):
        return False
    overlap = contact.patch.law.overlap(jax.device_put(contact.patch.kinematics @ contact.offset))
    return bool((np.asarray(overlap) > 0).any())


def refuse_behind(e: MotionEquations, q: Array) -> None:
    """Raise `UserError` where bodies of modes alone begin at q (m,) behind what is rigid: nothing
    would bring them out. Waves of the ground are left out."""
    parts = np.split(e.D @ q + e.D_o @ e.oscillators(0.0), np.cumsum([c.patch.count for c in e.contacts])[:-1])
    for c, d in zip(e.contacts, parts, strict=False):
        law = c.patch.law
        if e.R.any() or not isinstance(law, SetValued) or law.normal is not None or (c.ground and c.ground.waves):
            continue
        u = c.patch.kinematics @ (d + c.offset)
        deep = float(np.max(u[:, 0] - np.asarray(law.gap), initial=0.0))
        if deep > BEHIND:
            raise UserError(
                f"start: begins {deep:.4g} m behind {c.name}, which is rigid; let the bodies go where its gap is open, "
                "or correct the gap"
            )


def _refuse_penetration(e: MotionEquations, q: Array) -> None:
    """Contacts that are pressed deeper at q = 0 than under the steady loads would throw the bodies apart."""
    nearer, begins = e.D @ q + e.still[1], np.cumsum([0, *(c.patch.count for c in e.contacts)])
    for c, i in zip(e.contacts, begins, strict=False):
        if c.offset[0] > 0 and nearer[i] < -PENETRATES * c.offset[0]:
            depth = f"{c.offset[0]:.4g} m deep, where steady loads press it {c.offset[0] + nearer[i]:.4g} m"
            raise UserError(f'start: "rest" begins with {c.name} {depth}; write start = "static"')


def _static(e: MotionEquations, most: int = 60) -> Array:
    """(m,) where steady loads and contacts that came there on a straight way are in balance, by Newton's method."""
    q, force = np.zeros(len(e.omega2)), static_force(Stepper(e, 1.0, accounts=False))
    scale = np.abs(e.still[0]).max(initial=0.0) + np.abs(e.D.T @ e.F_0).max(initial=0.0)

    def missing(q: Array) -> tuple[Array, Array]:
        F, S = force(q)
        return e.omega2 * q - e.still[0] + F, S

    R, S = missing(q)
    scale = max(scale, np.abs(R).max(initial=0.0))
    for _ in range(most):
        if np.abs(R).max(initial=0.0) <= 1e-10 * scale:
            return q
        K = np.diag(e.omega2) + S
        step = -scipy.linalg.lstsq(K, R)[0]
        share = 1.0
        for _ in range(12):
            trial, slope = missing(q + share * step)
            if np.linalg.norm(trial) < np.linalg.norm(R):
                break
            share *= 0.5
        q, R, S = q + share * step, trial, slope
    raise NotConverged('no rest under the steady loads was found; write start = "rest" to begin at q = 0')
