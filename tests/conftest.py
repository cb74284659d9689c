"""One thread (the same bits at every run), a fixed seed for the property tests, no silent skips where none may be."""

import ctypes
import gc
import os
import re
import signal
import sys
from collections.abc import Iterator
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy and MKL are loaded

import pytest
from durations import Durations, longest_first
from families import LEFT_OUT
from hypothesis import HealthCheck, settings

settings.register_profile(
    "microslip", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow], database=None
)
settings.load_profile("microslip")

PROGRAMS = Path(__file__).resolve().parents[1] / "build/programs-of-tests"
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(PROGRAMS))  # kept between runs, shared by workers
os.environ["XDG_CACHE_HOME"] = str(PROGRAMS.with_name("cache-of-tests"))  # a user's has the durations of their own runs

if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:  # as in a shell's background job: children would inherit it
    signal.signal(signal.SIGINT, signal.default_int_handler)


QUICK = (
    "--xla_cpu_use_fusion_emitters=false --xla_backend_optimization_level=0 --xla_cpu_parallel_codegen_split_count=1 "
    "--xla_llvm_disable_expensive_passes=true --xla_disable_hlo_passes=while-loop-invariant-code-motion"
)
"""Compile in a quarter of the time: a test runs a program once or twice, and each piece that a program is split into
costs a compiler of its own. That a user's gives the same numbers: test_conformance, the sample from a wheel."""


def locked(package: str) -> bool:
    """Whether requirements.lock names the installed version: another compiler might not know the flags, and stop."""
    lock = Path(__file__).resolve().parents[1] / "requirements.lock"
    try:
        return lock.is_file() and f"{package}=={version(package)}" in lock.read_text(encoding="utf-8").split()
    except PackageNotFoundError:
        return False


def pytest_configure(config: pytest.Config) -> None:
    """Before jax is loaded, and for the processes that tests start; who only hands tests to workers loads nothing."""
    if locked("jaxlib"):
        os.environ.setdefault("XLA_FLAGS", QUICK)
    gc.disable()  # what is imported stays; pytest_collection_finish
    if sys.platform == "linux":
        freed_memory_stays()
    config.pluginmanager.register(durations := Durations(), "durations-of-tests")
    with suppress(ImportError, AttributeError):  # what is drawn is to depend on no number of the modules loaded so far
        from hypothesis.internal.conjecture import providers

        providers.is_local_module_file = lambda path: False
    if find_spec("jax") and not getattr(config.option, "numprocesses", None):
        from microslip.process import forget, prepare

        PROGRAMS.mkdir(parents=True, exist_ok=True)
        prepare()  # tests call laws by themselves, before anything is solved
        forget(PROGRAMS, 2**31)  # those of the slow tests are kept beside them
        durations.listen()


def freed_memory_stays() -> None:
    """Of large arrays: given back, the kernel clears every page of the next ones, a twentieth of the time."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)  # glibc alone has it
    for threshold, size in ((-1, 2**28), (-3, 2**25)):  # M_TRIM_THRESHOLD, M_MMAP_THRESHOLD in bytes
        mallopt and mallopt(threshold, size)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """What `families` names is slow; workers begin with the files that take longest, so that they end
    together (with --no-loadscope-reorder)."""
    for item in items:
        if item.nodeid.startswith(LEFT_OUT):
            item.add_marker(pytest.mark.slow)
    if hasattr(config, "workerinput"):
        items[:] = longest_first(items, config.workerinput["took"])


def pytest_collection_finish() -> None:
    """What is imported stays to the end: it is not looked through for garbage again and again (a twentieth of the
    time, with the objects that a compilation makes and drops)."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    gc.enable()


def held() -> float:
    """Bytes of memory this process holds; 0 where that is not known (only Linux limits what is mapped)."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return 0.0


MOST = {"bytes": 1.5e9}
"""What a process may hold at the end of a file before compiled programs are dropped."""
WITHIN_A_FILE = 1e9
"""How much more within one: its tests share most of their programs, and would trace and compile them again."""


def drop(most: float) -> None:
    """Compiled programs are shared by all tests until there are too many: each keeps memory, in pieces of which a
    process may have 65530 mapped (20,000 at 1.5 GB); beyond that the compiler crashes."""
    if "microslip.programs" in sys.modules and held() > most:
        sys.modules["microslip.programs"].dropped()
        gc.collect()
        if sys.platform == "linux":
            trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # give it back: glibc alone has it
            trim and trim(0)
        MOST["bytes"] = max(1.5e9, held() + 5e8)


@pytest.fixture(autouse=True)
def programs_are_dropped() -> Iterator[None]:
    yield
    drop(MOST["bytes"] + WITHIN_A_FILE)


@pytest.fixture(autouse=True, scope="module")
def programs_of_a_file_are_dropped() -> Iterator[None]:
    yield
    drop(MOST["bytes"])


PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108000000003a7e9b550"
    "000000a49444154789c63f80f0001010100b138f6140000000049454e44ae426082"
)
"""A picture of one white pixel."""


def _undrawn(request: pytest.FixtureRequest) -> Iterator[None]:
    """Figures of a quick test are composed, but a pixel is saved of them, unless it is marked `drawn`: half a second
    each. The slow tests draw as a user does."""

    def save(canvas: Any, to: Any, **how: Any) -> None:
        if "draw" in vars(canvas.figure):  # who measures a text, and leaves by what drawing raises
            canvas.draw()
        to.write(PIXEL) if hasattr(to, "write") else Path(to).write_bytes(PIXEL)

    with pytest.MonkeyPatch.context() as patched:
        quick = request.config.getoption("markexpr") == "not slow" and not request.node.get_closest_marker("drawn")
        if quick and find_spec("matplotlib"):
            patched.setattr("matplotlib.backends.backend_agg.FigureCanvasAgg.print_png", save)
        yield


def _unjudged(request: pytest.FixtureRequest) -> Iterator[None]:
    """The error that the harmonics of a case leave is not estimated in a quick test that does not look at it: it takes
    three balances more, whose programs take longer to compile than the answer's; nor is integrated in time where a
    sweep jumps or has no solution. The slow tests do both as a user does."""
    with pytest.MonkeyPatch.context() as patched:
        if request.config.getoption("markexpr") == "not slow" and find_spec("jax"):
            from microslip.case import headline
            from microslip.stages import response

            patched.setattr(response, "jumps", lambda result: [])
            patched.setattr(response, "with_motions", lambda result, *_: result)
            asked = headline.is_estimated
            patched.setattr(headline, "is_estimated", lambda *given, ring=False: ring and asked(*given, ring))
        yield


undrawn = pytest.fixture(_undrawn, name="undrawn")
unjudged = pytest.fixture(_unjudged, name="unjudged")
undrawn_file = pytest.fixture(_undrawn, scope="module", name="undrawn_file")
unjudged_file = pytest.fixture(_unjudged, scope="module", name="unjudged_file")
"""In every test of a file, and in what they share."""


@pytest.fixture
def untried(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """A quick test that looks at the sentence which refuses a file has it read at once, not in a process of its own
    first (0.7 s), as files without a seal are. Damage that is drawn is tried there as a user's is."""
    if request.config.getoption("markexpr") == "not slow":
        monkeypatch.setattr("microslip.files.hostile.trial", lambda *_, **__: "")


@pytest.fixture
def unestimated(monkeypatch: pytest.MonkeyPatch) -> None:
    """A slow test whose subject is not the error that harmonics leave does without its estimate as well."""
    monkeypatch.setattr("microslip.case.headline.is_estimated", lambda *_, **__: False)


@pytest.fixture
def compiled_for_users(monkeypatch: pytest.MonkeyPatch) -> None:
    """Processes that a test starts compile as a user's do, where time or memory is what is tested."""
    if os.environ.get("XLA_FLAGS", "").startswith(QUICK):  # the package adds to them when it is loaded
        monkeypatch.delenv("XLA_FLAGS")


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
