"""Telling the person what is being done: a live bar on a terminal, plain lines elsewhere, all on stderr."""

from __future__ import annotations

import contextlib
import json
import os
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from .errors import UserError
from .interrupts import look

Report = Callable[[str], None]


@contextlib.contextmanager
def progress(title: str, quiet: bool = False) -> Iterator[Report]:
    """Say what will be done and about how long it takes, and yield a function that is told, in words, what begins now.

    On a terminal a bar shows the present step and its time, and finished steps stay above it; when the output is a
    file or a pipe each step is one plain line, and a step that says nothing for `BEAT` seconds is told again.
    ``300 of 600 frequencies`` moves the bar of the present step (in a file it is a line if nothing was said for
    `SILENCE` seconds, and once more at its end), and a text that begins with ``warning:`` stays on the screen. A
    request to end is heeded there: what reports is a loop that can be left (`interrupts.look`).
    """
    began, typed = time.perf_counter(), _typed or title
    if quiet:
        yield lambda _: look()
    else:
        _say_first(title, typed)
        with (_bar if sys.stderr.isatty() else _lines)(title) as report:
            yield report
    keep(typed, time.perf_counter() - began, _asked())


LOADING = 1.0
"""s after which what will be done is said, though what does it is still being loaded."""

Expected = Callable[[Sequence[str]], float | None]
"""s that what some words ask for takes on the core of `PLANS`, None where that is not known; a `UserError` where there
is nothing of it."""

WRONG = (UserError, OSError, ValueError, ArithmeticError)
"""In what is asked for: who does it tells what."""

_typed, _first = "", threading.Lock()
_asked: Callable[[], float | None] = lambda: None  # noqa: E731
_told_first = False


@contextlib.contextmanager
def announced(words: Sequence[str], expected: Expected = lambda _: None) -> Iterator[None]:
    """While the command line does what these words say: `progress` says first what will be done, or, where that takes
    longer than `LOADING`, it is said before, unless there is nothing of it."""
    global _typed, _told_first, _asked
    verb, *others = [word for word in words if not word.startswith("-")][:2] or [""]
    title, over = " ".join([verb, *others]), any(word.split("=")[0] == "--over" for word in words)
    if verb == "respond" and over:  # another work, which takes another time
        verb = "respond--over"
    _typed, _told_first = " ".join([verb, *others]), False

    def asked() -> float | None:
        with contextlib.suppress(*WRONG):
            return expected(words)
        return None

    def early() -> None:
        with contextlib.suppress(*WRONG):
            expected(words)
            _say_first(title, _typed)

    _asked = asked
    timer = threading.Timer(LOADING, early)
    timer.daemon = True
    if verb in PLANS and others and not {"-q", "--quiet", "-h", "--help"} & set(words):
        timer.start()
    try:
        yield
    finally:
        timer.cancel()
        _typed, _asked = "", lambda: None


def _say_first(title: str, typed: str) -> None:
    """What will be done and about how long it takes, once."""
    global _told_first
    with _first:
        if not (_typed and _told_first):
            plan = planned(typed, _asked())
            print(f"{title}{': ' * bool(plan)}{plan}", file=sys.stderr, flush=True)
        _told_first = True


SILENCE, BEAT = 5.0, 15.0
"""s after which even small steps are worth a line in a log, and after which the present step is told again."""


@contextlib.contextmanager
def _lines(title: str) -> Iterator[Report]:
    began = last = time.perf_counter()
    step = Step(0.0, 0.0, began, True)
    present, counted, shown, seen = title, "", "", False
    ended, lock = threading.Event(), threading.Lock()

    def line(text: str) -> None:
        nonlocal last
        last = time.perf_counter()
        print(f"  {last - began:6.1f} s  {text}", file=sys.stderr, flush=True)

    def close() -> None:
        """The last count of a step of which counts were shown."""
        total, done = _fraction(counted)
        if seen and total is not None and (shown != counted or done < total):
            line(counted if done >= total else f"{counted}; ended there")

    def report(text: str) -> None:
        nonlocal step, present, counted, shown, seen
        look()
        with lock:
            total, done = _fraction(text)
            if total is None or done < _fraction(counted)[1]:
                close()
                counted, seen = "", False
            now = time.perf_counter()
            if total is not None:
                step = step.seen(total, done, now)
            present, counted = text, text if total is not None else ""
            small = _fraction(text.rpartition(PART)[2])[0] is not None
            if not small or now - last > SILENCE:
                shown, seen = text, total is not None
                line(f"{text}{_left(step, now, total, done)}")

    def beat() -> None:
        while not ended.wait(0.1 * BEAT):
            with lock:
                if time.perf_counter() - last > BEAT:
                    line(f"still at it: {present}")

    threading.Thread(target=beat, daemon=True).start()
    try:
        yield report
        close()
    finally:
        ended.set()


@contextlib.contextmanager
def _bar(title: str) -> Iterator[Report]:
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    text = TextColumn("{task.description}", markup=False)
    columns = (SpinnerColumn(), text, BarColumn(bar_width=20), TimeElapsedColumn(), TimeRemainingColumn())
    step = ""

    def finish() -> None:
        if step:
            bar.console.print(f"  [green]ok[/green] {escape(step)}", highlight=False)

    def report(text: str) -> None:
        nonlocal step
        look()
        total, done = _fraction(text)
        if text.startswith("warning:"):
            bar.console.print(text, style="yellow", highlight=False, markup=False)
            return
        if total is None:
            finish()
            step = text
        bar.update(task, description=f"{title}: {text}", total=total, completed=done)

    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=None)
        yield report
        finish()


PART = " | "
"""Between how much of the whole is done and what is said of a part."""


@dataclass
class Whole:
    """A `Report` of parts, which says before each text how many parts of the whole are done.

    Attributes:
        report: is told. total: number of parts. parts: what they are.
    """

    report: Report
    total: int
    parts: str
    done: int = 0

    def __call__(self, text: str) -> None:
        here = f"{self.done} of {self.total} {self.parts}{PART}" if self.total > 1 else ""
        self.report(text if text.startswith("warning:") else f"{here}{text}")


class Step(NamedTuple):
    """Something that is counted: of how many, the count from which on it is timed, when (s) that was, and whether that
    is the first one; of many the time of the first is left out, in which programs are compiled."""

    total: float
    first: float
    began: float
    warm: bool

    def seen(self, total: float, done: float, now: float) -> Step:
        """The same, or what another total, or fewer of it, begin."""
        if total != self.total or done < self.first:
            return Step(total, done, now, total <= MANY)
        if done > self.first and not self.warm:
            return Step(total, done, now, True)
        return self


MANY = 10


def _left(step: Step, now: float, total: float | None, done: float) -> str:
    """The time that is left of a step at the speed it had so far, in words; nothing where that is not known."""
    if total is None or not step.first < done < total:
        return ""
    return f", about {_duration((now - step.began) * (total - done) / (done - step.first))} left"


def _fraction(text: str) -> tuple[float | None, float]:
    """Total and count in a text like ``300 of 600 frequencies``."""
    words = text.split()
    if len(words) >= 3 and words[1] == "of" and words[0].isdigit() and words[2].isdigit():
        return float(words[2]), float(words[0])
    return None, 0.0


# how long it takes here ----------------------------------------------------------------------------------------------

PLANS: dict[str, tuple[str, float, float]] = {
    "run": ("mesh, modal file, what the case asks for, pictures and page, each where it is not up to date", 30, 300),
    "mesh": ("the mesh, if it is not up to date", 1, 30),
    "modes": ("mesh, assembly, eigenmodes, rows and stresses, each if it is not up to date", 5, 120),
    "respond": (
        "every point of the sweep, peaks between them, their error, stresses and pictures; where it jumps or has no "
        "solution motions in time too, minutes more",
        15,
        180,
    ),
    "respond--over": (
        "what [curve] or the table of that name asks, its error, tables and pictures",
        10,
        300,
    ),
    "orbit": ("motions period by period, their error, tables and pictures", 15, 180),
    "bifurcate": ("equilibria, periodic orbits that begin at them, tables and pictures", 30, 300),
    "two-tones": ("every pair of frequencies, tables and pictures", 30, 300),
    "ring-down": ("motions after the loads are off, the nonlinear mode beside them, tables and pictures", 20, 300),
    "map": ("a response at each normal force, its highest resonance, the lowest of these", 60, 900),
    "wear": ("a response at each jump in time, as many as the wear needs, tables and pictures", 30, 900),
    "mistune": ("the tuned ring, then sample after sample", 60, 1200),
    "roll": ("patches, creep curve, tables and pictures", 10, 300),
    "stability": ("roots and their count, pictures", 5, 300),
    "backbone": ("a nonlinear mode under each normal force", 20, 300),
    "optimum": ("a sweep at each value, then the lowest resonance between them", 60, 600),
    "closure": ("a static contact at each approach", 10, 300),
    "report": ("pictures and page", 10, 60),
}
"""Verb -> what will be done, and between how many s it took for the cases that travel with the
package, each on one quiet core of an AMD EPYC."""

SHORT = 10.0
"""s below which nobody is told how long it takes."""

WORTH = 2.0
"""s from which on a run is kept: one that finds all up to date says nothing of one that does not."""

RUNS, TITLES = 5, 300
"""That are kept, of each and in all."""


def planned(title: str, expected: float | None = None) -> str:
    """What will be done, and about how long it takes: as runs of the same took on this machine, for as much as is asked
    now; or as `expected`, or else as such runs take, at the speed of this machine, those of what has its name in
    another folder with them; "" where that is soon.

    Args:
        expected: s on the core of `PLANS`; None: not known.
    """
    known, place = _durations(), _key(title)
    words, low, high = PLANS.get(title.split()[0], ("", SHORT, 300))
    if took := known.get(place):
        shares = [expected / then if expected and then else 1.0 for _, then in took]
        longest = max(s * share for (s, _), share in zip(took, shares, strict=True))
        source = "as before" if max(shares) == min(shares) == 1 else "by what it took for another amount"
        return f"{words}{'; ' * bool(words)}at most about {_duration(longest)}, {source}" * (longest > SHORT)
    speed = _speed(known, title.split()[0])
    usually = (expected / 2, 2 * expected) if expected else (low, high)
    low, high = (bound * (speed or 1.0) for bound in usually)
    if took := [one for key, more in known.items() if _named(key) == _named(place) for one in more]:
        own = [s for s, _ in took]
        usual = f"{_duration(min(low, *own))} to {_duration(max(high, *own))}"
        return f"{words}{'; ' * bool(words)}{usual}; one of that name in another folder took {_duration(max(own))}"
    source = "by others on this machine" if speed else "not timed on this machine yet, such runs take"
    usual = f"{_duration(low)} to {_duration(high)}"
    usual = f"{usual}, {source}" if speed else f"{source} {usual}"
    return f"{words}{'; ' * bool(words)}{usual}" * (high > SHORT)


def _speed(known: Durations, verb: str) -> float | None:
    """Of this machine, how many times longer runs took than was expected of them: those of the same verb, or all; None
    where none is known."""
    long = [(key.split()[0], s, expected) for key, more in known.items() for s, expected in more if s >= SHORT]
    took = [(of, s / expected) for of, s, expected in long if expected]  # a short one is the start of its process
    ratios = [ratio for of, ratio in took if of == verb] or [ratio for _, ratio in took]
    return statistics.median(ratios) if ratios else None


def keep(title: str, seconds: float, expected: float | None = None) -> None:
    """How long a run took, and was expected to, for the next one; where there is no place to write to, nothing is
    kept."""
    if seconds < WORTH or (place := _place()) is None:
        return
    known, key = _durations(), _key(title)
    took = [*known.pop(key, []), (round(seconds, 1), expected and round(expected, 2))][-RUNS:]
    with contextlib.suppress(OSError):
        place.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=place.parent, prefix=".durations.")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            json.dump(dict([*known.items(), (key, took)][-TITLES:]), file, indent=1)
        os.replace(name, place)


def _key(title: str) -> str:
    """Verb, and the whole path of what it is done to."""
    verb, _, of = title.partition(" ")
    with contextlib.suppress(OSError, ValueError, RuntimeError):  # no path, or no folder to be in
        return f"{verb} {Path(of).resolve()}"
    return title


def _named(key: str) -> str:
    """Verb, and the last name of a path that says what it is."""
    verb, _, of = key.partition(" ")
    path = Path(of)
    return f"{verb} {path.parent.name if path.name in ('body.toml', 'case.toml', 'system.toml') else path.name}"


def _place() -> Path | None:
    """Where durations are kept: `$XDG_CACHE_HOME/microslip/durations.json` or that in `~/.cache`; None: nowhere."""
    with contextlib.suppress(RuntimeError):  # no home
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "microslip", "durations.json")
    return None


Durations = dict[str, list[tuple[float, float | None]]]


def _durations() -> Durations:
    """Title and folder -> s that its last runs took, and were expected to; nothing of what is no such file."""
    try:
        found: Any = json.loads((_place() or Path(os.devnull)).read_text(encoding="utf-8"))
        return {k: [(float(s), e and float(e)) for s, e in v] for k, v in found.items() if v}
    except (OSError, ValueError, TypeError, AttributeError):
        return {}


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"
