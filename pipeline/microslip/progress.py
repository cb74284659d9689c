"""Telling the person what is being done: a live bar on a terminal, plain lines elsewhere, all on stderr."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator

from .interrupts import look

Report = Callable[[str], None]


@contextlib.contextmanager
def progress(title: str, quiet: bool = False) -> Iterator[Report]:
    """Yield a function that is told, in words, what begins now.

    On a terminal a bar shows the present step and its time, and finished steps stay above it; when the output is a
    file or a pipe each step is one plain line. ``300 of 600 frequencies`` moves the bar of the present step (in a file
    it is a line if nothing was said for `SILENCE` seconds), and a text that begins with ``warning:`` stays on the
    screen. A request to end is heeded there: what reports is a loop that can be left (`interrupts.look`).
    """
    if quiet:
        yield lambda _: look()
    elif sys.stderr.isatty():
        with _bar(title) as report:
            yield report
    else:
        print(title, file=sys.stderr, flush=True)
        yield _lines()


SILENCE = 5.0
"""s after which even small steps are worth a line in a log."""


def _lines() -> Report:
    began = last = time.perf_counter()
    step = (0.0, began)  # how many were done when it was first told, and when

    def report(text: str) -> None:
        nonlocal last, step
        look()
        now, (total, done) = time.perf_counter(), _fraction(text)
        if total is None or done <= step[0] + 1:
            step = done, now
        if total is None or now - last > SILENCE:
            last = now
            print(f"  {now - began:6.1f} s  {text}{_left(step, now, total, done)}", file=sys.stderr, flush=True)

    return report


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


def _left(step: tuple[float, float], now: float, total: float | None, done: float) -> str:
    """The time that is left of a step at the speed it had so far, in words; nothing where that is not known."""
    first, began = step
    if total is None or done <= first:
        return ""
    left = (now - began) * (total - done) / (done - first)
    return f", about {left:.0f} s left" if left < 120 else f", about {left / 60:.0f} min left"


def _fraction(text: str) -> tuple[float | None, float]:
    """Total and count in a text like ``300 of 600 frequencies``."""
    words = text.split()
    if len(words) >= 3 and words[1] == "of" and words[0].isdigit() and words[2].isdigit():
        return float(words[2]), float(words[0])
    return None, 0.0
