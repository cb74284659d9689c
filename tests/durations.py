"""What every test costs, in CPU seconds: ``build/durations.csv`` after each run, the dearest first; of slow ones
``build/durations-slow.csv``. The next run begins with the files that took longest.

Seconds of the wall depend on what runs beside it, and compiling on what has run before: that is kept apart.
"""

from __future__ import annotations

import csv
import resource
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

QUICK = 1.5
"""CPU seconds, compiling left out, that a quick test is to take at most: those above are listed."""
NEVER = 10.0
"""A run of quick tests fails over one above this, whatever the machine is and does beside."""
BUILD = Path(__file__).resolve().parents[1] / "build"
COLUMNS = ("cpu_s", "compiling_s", "processes_s")
"""Of a test with its fixtures: CPU time of the worker; at most that of it during which jax traced and compiled, by the
wall; of its processes."""


def kept(asked: str) -> Path:
    """Where the durations of the tests with these marks are."""
    return BUILD / ("durations.csv" if asked == "not slow" else "durations-slow.csv")


def rows(asked: str) -> list[dict[str, str]]:
    try:
        with kept(asked).open(newline="") as file:
            return list(csv.DictReader(file))
    except OSError:
        return []


def longest_first(items: list[pytest.Item], before: dict[str, float]) -> list[pytest.Item]:
    """File by file: first those that took longest when they were run before (s), or have many tests."""
    took = Counter(before)
    for item in items:
        took[item.nodeid.partition("::")[0]] += 0.01
    return sorted(items, key=lambda item: -took[item.nodeid.partition("::")[0]])


class Durations:
    """A plugin: in a worker it measures, where there are none or in the process that began them it writes."""

    def __init__(self) -> None:
        self.compiling = 0.0
        self.before = self.now()
        self.tests: dict[str, Counter[str]] = {}

    def listen(self) -> None:
        import jax.monitoring

        def compiled(event: str, seconds: float, **_: Any) -> None:
            self.compiling += seconds if event.startswith("/jax/core/compile/") else 0.0

        jax.monitoring.register_event_duration_secs_listener(compiled)

    def now(self) -> tuple[float, float, float]:
        children = resource.getrusage(resource.RUSAGE_CHILDREN)
        return time.process_time(), self.compiling, children.ru_utime + children.ru_stime

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item) -> Iterator[Any]:
        report = yield
        now, before = self.now(), self.before
        cpu, compiling, processes = (b - a for a, b in zip(before, now, strict=True))
        self.before = now
        report.user_properties = [("durations", (cpu, min(compiling, cpu), processes))]
        return report

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: Any) -> None:
        """Tell a worker what files took: all have to run them in one order."""
        took: Counter[str] = Counter()
        for row in rows(node.config.getoption("markexpr")):
            took[row["test"].partition("::")[0]] += float(row["cpu_s"]) + float(row["processes_s"])
        node.workerinput["took"] = dict(took)

    def pytest_collection_finish(self) -> None:
        self.before = self.now()  # what is imported is not the first test's

    @property
    def slow(self) -> list[tuple[float, str]]:
        """CPU seconds without compiling, and name, of tests above `QUICK`; the dearest first."""
        own = {
            test: spent["cpu_s"] - spent["compiling_s"] + spent["processes_s"]
            for test, spent in self.tests.items()
        }
        return sorted(((s, test) for test, s in own.items() if s > QUICK), reverse=True)

    def pytest_terminal_summary(self, terminalreporter: Any, config: pytest.Config) -> None:
        if config.getoption("markexpr") == "not slow":
            for seconds, test in self.slow:
                verdict = f", above {NEVER:g}: make it smaller or slow" if seconds > NEVER else ""
                terminalreporter.write_line(f"{seconds:5.1f} CPU s{verdict}: {test}")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        for name, value in report.user_properties:
            if name == "durations":
                spent = self.tests.setdefault(report.nodeid, Counter())
                spent.update(dict(zip(COLUMNS, value, strict=True)))

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if hasattr(session.config, "workerinput") or not self.tests:
            return
        asked = session.config.getoption("markexpr")
        quick, ran = asked == "not slow", {test.partition("::")[0] for test in self.tests}
        if quick and self.slow and self.slow[0][0] > NEVER and session.exitstatus == 0:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED
        others = [row for row in rows(asked) if row["test"].partition("::")[0] not in ran]
        spent = [{c: f"{cost[c]:.3f}" for c in COLUMNS} | {"test": test} for test, cost in self.tests.items()]
        dearest = sorted(others + spent, key=lambda row: -float(row["cpu_s"]) - float(row["processes_s"]))
        BUILD.mkdir(exist_ok=True)
        with kept(asked).open("w", newline="") as file:
            table = csv.DictWriter(file, (*COLUMNS, "test"))
            table.writeheader()
            table.writerows(dearest)
