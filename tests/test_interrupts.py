"""Ctrl-C and SIGTERM: heard at any moment, in the midst of what C calls back too; what is finished is kept."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import microslip as ms
from microslip import interrupts
from microslip.files import store
from microslip.time_domain import equations, many, orbit, recorded, samples

ROOT = Path(__file__).resolve().parents[1]
pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX systems")


def slider() -> equations.MotionEquations:
    return equations.of(ms.structure(1.0, 1.0, 0.02, force={0: 0.3}, elements=[ms.jenkins(1.0, 0.2)]), 0.8)


def test_ctrl_c_at_random_moments_of_a_motion_ends_it_and_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each is heard, though HDF5 is writing at most of them; the motion has the bits of one that nobody disturbed."""
    for module in (recorded, orbit):
        monkeypatch.setattr(module, "PAUSE", 0.0)
    path, asked = tmp_path / "orbit.h5", recorded.Integration("it", slider(), 0, 100, 16, 512)
    whole = recorded.run(tmp_path / "whole.h5", [asked])[0]
    draw, heard = random.Random(1), 0
    before = signal.getsignal(signal.SIGINT)
    for _ in range(12):
        wait = draw.uniform(0.005, 0.06)
        timer = threading.Timer(wait, signal.pthread_kill, (threading.main_thread().ident, signal.SIGINT))
        try:
            timer.start()
            recorded.run(path, [asked])
            timer.cancel()
            break
        except KeyboardInterrupt:
            heard += 1
        assert not timer.is_alive() and not path.exists()
    assert heard > 2 and signal.getsignal(signal.SIGINT) is before
    found = recorded.run(path, [asked])[0]
    assert all(np.array_equal(whole.array(name), found.array(name)) for name in samples.UNITS)


def test_how_large_a_file_of_motions_will_be_is_told(tmp_path, monkeypatch):
    """Of a large one, before its first sample: what all of its arrays take, events left out."""
    told, asked = list[str](), recorded.Integration("it", slider(), 0, 100, 16, 512)
    for announced in (recorded.ANNOUNCED, 1e3):
        monkeypatch.setattr(recorded, "ANNOUNCED", announced)
        found = recorded.run(tmp_path / "orbit.h5", [asked], fresh=True, report=told.append)[0]
    size = sum(found.array(name).nbytes for name in samples.UNITS)
    (said,) = [text for text in told if " MB" in text]
    assert float(said.split("about ")[1].split(" MB")[0]) == pytest.approx(1e-6 * size, rel=0.01)


def test_no_period_of_a_motion_is_computed_twice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ended at the 20th of 60 periods, far within the second between two states that are kept: 41 are left."""
    looks, asked = list[int](), recorded.Integration("it", slider(), 0, 60, 16, 512)

    def ended_at(number: int) -> None:
        looks.append(number)
        if len(looks) == number:
            raise KeyboardInterrupt

    monkeypatch.setattr(recorded, "PAUSE", 1e6)
    monkeypatch.setattr(orbit, "look", lambda: ended_at(20))
    with pytest.raises(KeyboardInterrupt):
        recorded.run(tmp_path / "orbit.h5", [asked])
    looks.clear()
    monkeypatch.setattr(orbit, "look", lambda: ended_at(-1))
    found = recorded.run(tmp_path / "orbit.h5", [asked])[0]
    assert len(looks) == 41
    whole = recorded.run(tmp_path / "whole.h5", [asked])[0]
    assert all(np.array_equal(whole.array(name), found.array(name)) for name in samples.UNITS)


def asked_to_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interrupts, "_requests", [signal.SIGINT])
    monkeypatch.setattr(interrupts, "_raised", 0)


def test_a_request_is_raised_once_and_leaves_room_to_write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before a file is begun; what is written of what there is comes after."""
    asked_to_end(monkeypatch)
    with pytest.raises(KeyboardInterrupt):
        store.write_text(tmp_path / "new.csv", "1")
    assert not list(tmp_path.iterdir())
    store.write_text(tmp_path / "new.csv", "1")
    assert (tmp_path / "new.csv").read_text() == "1"


@pytest.mark.parametrize("loop", ["many", "settling", "newton", "waiting"])
def test_loops_heed_a_request(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, loop: str) -> None:
    e = slider()
    asked_to_end(monkeypatch)
    with pytest.raises(KeyboardInterrupt):
        if loop == "many":
            many.run(e, np.zeros((1, 1)), np.zeros((1, 1)), 1, 1, 512)
        elif loop == "settling":
            orbit.run(e, 1, 1, 16, 512)
        elif loop == "newton":
            ms.harmonic_response(e.assembly, [0.8], unit="rad/s", harmonics=1)
        else:
            monkeypatch.setattr(interrupts, "_raised", 1)
            with store.making(tmp_path / "a.h5"):
                monkeypatch.setattr(store, "_MINE", set())
                interrupts._requests.append(signal.SIGINT)
                with store.making(tmp_path / "a.h5"):
                    pass


def test_requests_are_heard_before_the_command_line_is_loaded() -> None:
    """While it is imported, a second on a busy machine, Ctrl-C would be a traceback of Python."""
    code = "import sys, microslip.__main__; raise SystemExit(sum(m in sys.modules for m in ('cyclopts', 'numpy')))"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


IN_A_CALLBACK = """
import gc, os, sys, time
from microslip import cli, interrupts

def ask(phase, info):
    gc.callbacks.remove(ask)
    os.kill(os.getpid(), int(sys.argv[1]))
    for _ in range(1000):  # where the interpreter looks for signals
        pass

def work(*words, **more):
    gc.callbacks.append(ask)
    gc.collect()
    while True:
        interrupts.look()
        time.sleep(0.01)

cli.app = work
cli.entry()
"""

DEAF = """
import sys, time
from pathlib import Path
from microslip import cli
from microslip.files import store

def work(*words, **more):
    with store.complete_or_absent("written.csv") as file:
        print("writing", flush=True)
        time.sleep(1.5)
        file.write_text("all of it")
    time.sleep(600)

cli.app = work
cli.entry()
"""


def process(folder: Path, code: str, *words: str) -> subprocess.Popen[str]:
    (folder / "it.py").write_text(code)
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "pipeline")}
    pipe = subprocess.PIPE
    return subprocess.Popen(
        [sys.executable, "it.py", *words], cwd=folder, env=environment, stdout=pipe, stderr=pipe, text=True
    )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_request_to_end_is_heard_in_the_midst_of_a_callback_too(tmp_path: Path, number: signal.Signals) -> None:
    """An exception that a callback of the garbage collector raises goes no further."""
    done = process(tmp_path, IN_A_CALLBACK, str(int(number)))
    _, said = done.communicate(timeout=120)
    assert done.returncode == 128 + number
    assert [line[:37] for line in said.splitlines()] == ["error: interrupted; what is finished "]


def test_a_second_request_ends_what_hears_none_but_lets_it_write(tmp_path: Path) -> None:
    done = process(tmp_path, DEAF)
    assert done.stdout is not None and done.stdout.readline() == "writing\n"
    done.send_signal(signal.SIGINT)
    time.sleep(2 * interrupts.APART)
    done.send_signal(signal.SIGINT)
    _, said = done.communicate(timeout=30)
    assert done.returncode == 130 and "ended at once" in said
    assert (tmp_path / "written.csv").read_text() == "all of it"


ORBIT = """
import sys
import microslip as ms
from microslip import cli, progress
from microslip.time_domain import equations, orbit, recorded, samples

slider = ms.structure(1.0, 1.0, 0.02, force={0: 0.3}, elements=[ms.jenkins(1.0, 0.2)])
asked = recorded.Integration("it", equations.of(slider, 0.8), 5, 40000, 16, 512)

def work(*words, **more):
    print("begins", flush=True)
    with progress.progress("orbit", True) as report:
        recorded.run("orbit.h5", [asked], report=report)

cli.app = work
cli.entry()
"""


@pytest.mark.slow
def test_a_long_motion_of_the_command_line_ends_at_any_moment(tmp_path: Path) -> None:
    draw = random.Random(2)
    for number in (signal.SIGINT, signal.SIGTERM) * 3:
        done = process(tmp_path, ORBIT)
        assert done.stdout is not None and done.stdout.readline() == "begins\n"
        time.sleep(draw.uniform(0.3, 3.0))
        done.send_signal(number)
        _, said = done.communicate(timeout=30)
        assert done.returncode == 128 + number and said.startswith("error: interrupted; what is finished is kept"), said
        assert not (tmp_path / "orbit.h5").exists()
