"""One thread (the same bits at every run), a fixed seed for the property tests, no silent skips where none may be."""

import os
import re
import signal
import sys
from collections.abc import Iterator
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy and MKL are loaded

import pytest
from hypothesis import HealthCheck, settings

settings.register_profile(
    "microslip", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow], database=None
)
settings.load_profile("microslip")

if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:  # as in a shell's background job: children would inherit it
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True, scope="module")
def programs_are_dropped() -> Iterator[None]:
    """Compiled programs of a test file go with it: each keeps pieces of memory mapped, of which a process may have
    65530; beyond that the compiler crashes."""
    yield
    if "jax" in sys.modules:
        sys.modules["jax"].clear_caches()


ABSENT = re.compile(r"is not installed|needs CalculiX|could not import|make peers|cannot draw|cannot be drawn")
"""Why a test is skipped where another program or package is missing. With MICROSLIP_PEERS=required that fails."""


def missing(outcome: str, reason: Any) -> bool:
    """Whether a skipped test wanted a program that must be there."""
    required = os.environ.get("MICROSLIP_PEERS") == "required"
    return required and outcome == "skipped" and bool(ABSENT.search(str(reason)))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[Any]:
    report = yield
    if missing(report.outcome, report.longrepr) and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"{item.nodeid}: skipped, but MICROSLIP_PEERS=required: {report.longrepr}"
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Iterator[Any]:
    report = yield
    if missing(report.outcome, report.longrepr):
        report.outcome = "failed"
        report.longrepr = f"{collector.nodeid}: skipped, but MICROSLIP_PEERS=required: {report.longrepr}"
    return report
