"""Telling the person what is being done: a live bar on a terminal, plain lines elsewhere, all on stderr."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator

Report = Callable[[str], None]


@contextlib.contextmanager
def progress(title: str, quiet: bool = False) -> Iterator[Report]:
    """Yield a function that is told, in words, what begins now.

    On a terminal a spinner with the elapsed time shows the present step and finished steps stay above it; when
    the output is a file or a pipe each step is one plain line.
    """
    began = time.perf_counter()
    if quiet:
        yield lambda _: None
        return
    if not sys.stderr.isatty():
        print(f"{title}", file=sys.stderr)
        yield lambda text: print(f"  {time.perf_counter() - began:6.1f} s  {text}", file=sys.stderr, flush=True)
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    bar = Progress(
        SpinnerColumn(), TextColumn("{task.description}"), BarColumn(bar_width=20), TimeElapsedColumn(),
        console=Console(stderr=True), transient=True,
    )  # fmt: skip
    with bar:
        task = bar.add_task(title, total=None)
        previous = [""]

        def report(text: str) -> None:
            if previous[0]:
                bar.console.print(f"  [green]ok[/green] {previous[0]}", highlight=False)
            previous[0] = text
            total, done = _fraction(text)
            bar.update(task, description=f"{title}: {text}", total=total, completed=done)

        yield report
        if previous[0]:
            bar.console.print(f"  [green]ok[/green] {previous[0]}", highlight=False)


def _fraction(text: str) -> tuple[float | None, float]:
    """Total and count in a text like ``300 of 600 frequencies``."""
    words = text.split()
    if len(words) >= 3 and words[1] == "of" and words[0].isdigit() and words[2].isdigit():
        return float(words[2]), float(words[0])
    return None, 0.0
