"""Doors between the program and the files around it, from the command line: links, pipes and devices where files are
meant, two runs at once, a killed or ended run, a full disk, products of others, paths that lead elsewhere."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import pytest
from box import edit, write_box
from test_response_stage import QUICK, SAMPLES

from microslip.cli import main
from microslip.files import store
from microslip.results import open_journal, read_journal, read_response
from microslip.stages import response as making

pytest.importorskip("matplotlib")
POSIX = pytest.mark.skipif(os.name != "posix", reason="pipes, links and locks of POSIX systems")
pytestmark = [POSIX, pytest.mark.usefixtures("unjudged")]
BUILD = "build/vane"


class Stuck(BaseException):
    """Waited for what never comes."""


def stuck(*_: object) -> None:
    raise Stuck


@pytest.fixture(autouse=True)
def soon() -> Iterator[None]:
    """A pipe that is opened after all is waited for half a minute."""
    before = signal.signal(signal.SIGALRM, stuck)
    signal.alarm(30)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A modal file with a case that sticks, whose response takes little time."""
    shutil.copy(SAMPLES / "basis.h5", tmp_path)
    (tmp_path / "case.toml").write_text(QUICK)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(making, "_assessed", lambda *_: None)
    monkeypatch.setattr("microslip.pictures.response.response_picture", lambda *_, **__: None)
    return tmp_path


def refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The one sentence of a command that exits with 2."""
    capsys.readouterr()
    assert main(words) == 2
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
    return line


def odd(path: Path, kind: str) -> Path:
    """Something that is no file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    else:
        path.symlink_to({"device": "/dev/zero", "link to a pipe": odd(path.with_name("pipe"), "pipe")}[kind])
    return path


# ---------------------------------------------------------------- links under the names of products


def test_links_give_way_to_products(folder: Path) -> None:
    """Every product of a response, linked to a file of another place before: that file stays, the product is one."""
    assert main(["respond", ".", "-q"]) == 0
    products = [p for p in Path(BUILD).rglob("*") if p.is_file()]
    assert {p.suffix for p in products} >= {".csv", ".h5", ".json", ".png", ".html"}
    for product in products:
        product.unlink()
        (folder / f"mine-{product.name}").write_text("mine")
        product.symlink_to(folder / f"mine-{product.name}")
    assert main(["respond", ".", "-q"]) == 0
    assert not any(p.is_symlink() for p in products) and all(p.stat().st_size > 4 for p in products)
    assert {p.read_text() for p in folder.glob("mine-*")} == {"mine"}


@pytest.mark.parametrize("form", ["mat", "uff", "mtx"])
def test_links_give_way_to_exports(form: str, folder: Path) -> None:
    """Matrix Market makes a folder, and refuses a link in its place."""
    (folder / "mine").mkdir() if form == "mtx" else (folder / "mine").write_text("mine")
    before = (folder / "mine").lstat()
    (folder / "out").symlink_to("mine")
    assert main(["export", "basis.h5", "--to", form, "-o", "out"]) == (2 if form == "mtx" else 0)
    after = (folder / "mine").lstat()  # a look into a folder may count as a use of it
    assert (after.st_ino, after.st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
    assert (folder / "out").is_symlink() == (form == "mtx")


def test_init_writes_through_no_link(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "own").mkdir()
    (folder / "own/body.toml").symlink_to("../elsewhere")
    assert "own/body.toml" in refused(["init", "own"], capsys) and not (folder / "elsewhere").exists()


@pytest.mark.parametrize("link", [os.symlink, os.link])
def test_a_linked_journal_is_copied_first(tmp_path: Path, link: Any) -> None:
    """Another case's points are read through a link, and added to in a file of one's own."""
    first, second = tmp_path / "response.points", tmp_path / "linked.points"
    with open_journal(first, "abc", {"case": "a"}) as journal:
        journal.keep("s", 1.0, {"x": 1.0})
    before = first.read_bytes()
    link(first, second)
    with open_journal(second, "abc", {"case": "a"}) as journal:
        journal.keep("s", 2.0, {"x": 2.0})
    assert first.read_bytes() == before and list(read_journal(second)[1]["s"]) == [1.0, 2.0]
    second.unlink()
    link(first, second)
    with open_journal(second, "other", {"case": "a"}):
        pass
    assert first.read_bytes() == before and read_journal(second)[1] == {}


@pytest.mark.parametrize("kind", ["pipe", "device", "folder", "link to a pipe"])
@pytest.mark.parametrize("name", ["response.json", "response.record.json", "response.csv"])
def test_what_is_no_file_is_no_product(name: str, kind: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = odd(folder / BUILD / name, kind).lstat()
    assert name in refused(["respond", ".", "-q"], capsys)
    assert (folder / BUILD / name).lstat().st_mode == before.st_mode


# ---------------------------------------------------------------- inputs that are no files


@pytest.mark.parametrize("kind", ["pipe", "device"])
@pytest.mark.parametrize(
    "words",
    [
        ["run", "x.toml"], ["respond", "x.toml"], ["mesh", "x.toml"], ["modes", "x.toml"], ["contact", "x.toml"],
        ["respond", ".", "x.h5"], ["check", "x.h5"], ["info", "x.inp"], ["info", "x.h5"], ["info", "x.step"],
        ["info", "x.mtx"], ["import", "x.inp"], ["import", "x.unv"], ["export", "x.h5", "--to", "mat"],
        ["backbone", "x.toml"], ["respond", "x.toml", "--over", "load"],
    ],
    ids=" ".join,
)  # fmt: skip
def test_an_input_is_a_file(words: list[str], kind: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name = next(word for word in words if word.startswith("x."))
    odd(folder / name, kind)
    assert name in refused(words, capsys)


@pytest.mark.parametrize(
    "key", ["included deck", "mesh of a body", "cad of a body", "build of a body", "curve", "flow"]
)
def test_a_file_that_a_file_names_is_a_file(key: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    odd(folder / "odd.inp", "pipe")
    box = write_box(folder / "box") / "body.toml"
    parameters = "[geometry.parameters]\nsize = [20.0, 30.0, 120.0]\n"
    if key == "included deck":
        (folder / "deck.inp").write_text("*INCLUDE, INPUT=odd.inp\n")
        words = ["info", "deck.inp"]
    elif key.endswith("body"):
        edit(box, f'build = "build.py"\n\n{parameters}', f'{key.split()[0]} = "../odd.inp"\n')
        words = ["modes", "box"]
    elif key == "curve":
        stiffness = '[stiffness]\nkind = "curve"\nfile = "odd.inp"\ntangential = 3e8\n'
        (folder / "contact.toml").write_text(f'name = "c"\n{stiffness}')
        words = ["contact", "contact.toml"]
    else:
        field = 'excitations = [{field = "odd.inp", face = "right", length_unit = "m"}]'
        text = QUICK.replace('excitation = "magnet"\namplitude = 2.0', field)
        (folder / "case.toml").write_text(text)
        words = ["respond", "."]
    assert "odd.inp" in refused(words, capsys)


# ---------------------------------------------------------------- two runs at once

HOLD = """
import sys, time
from microslip.files.store import making
with making(sys.argv[1]):
    print("ready", flush=True)
    time.sleep(60)
"""


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}


def holding(product: str) -> subprocess.Popen[str]:
    """A process that is making a product."""
    process = subprocess.Popen([sys.executable, "-c", HOLD, product], stdout=-1, text=True, env=environment())
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    process.stdout.close()
    return process


def test_a_second_run_waits_and_a_killed_one_is_not_waited_for(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is killed when it is waited for, however long it takes to come to that."""
    import fcntl

    process, flock = holding(f"{BUILD}/response.json"), fcntl.flock

    def watched(lock: int, how: int) -> None:
        try:
            flock(lock, how)
        except BlockingIOError:
            threading.Timer(0.1, process.kill).start()
            raise

    monkeypatch.setattr("fcntl.flock", watched)
    assert main(["respond", "."]) == 0
    assert process.wait() == -signal.SIGKILL
    (line,) = [line for line in capsys.readouterr().err.splitlines() if str(process.pid) in line]
    assert f"{BUILD}/response.json" in line
    assert not [p for p in folder.rglob(".*")] and read_response(f"{BUILD}/response.h5").finished


def test_locks_that_are_missing_or_left_stop_nobody(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    Path(BUILD).mkdir(parents=True)
    (folder / BUILD / ".response.json.lock").write_text("process 1 on moon")
    assert main(["respond", ".", "-q"]) == 0 and not [p for p in folder.rglob(".*")]
    monkeypatch.setattr("fcntl.flock", none)
    assert main(["respond", ".", "-q", "--force"]) == 0


def test_a_mistake_leaves_no_folder_behind(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    refused(["respond", ".", "-q", "--set", "monitor=nose"], capsys)
    assert sorted(p.name for p in folder.iterdir()) == ["basis.h5", "case.toml"]


RACER = """
import sys, time
from microslip import cli
from microslip.pictures import response
from microslip.stages import response as making
making._assessed = lambda *_: None
pause = float(sys.argv[1])
response.response_picture = lambda *_, **__: time.sleep(pause)
print("ready", flush=True)
time.sleep(float(sys.stdin.readline()))
sys.exit(cli.main(sys.argv[2:]))
"""


@pytest.mark.slow
def test_runs_of_two_cases_at_once_leave_one(folder: Path) -> None:
    """Two settings in one folder, the second run begun while the first is between two products: table, HDF5 and
    summary are of the same one, and a plain run then leaves its own."""
    changes = [[], ["--set", "amplitude=4.0"]]
    whole = []
    for change in changes:
        assert main(["respond", ".", "-q", *change]) == 0
        whole.append({n: (folder / BUILD / n).read_bytes() for n in ("response.csv", "response.h5", "response.json")})
    signal.alarm(100)
    for later in ("0.2", "0.6"):
        shutil.rmtree(BUILD)
        both = [
            subprocess.Popen(
                [sys.executable, "-c", RACER, pause, "respond", ".", "-q", *change],
                stdin=-1, stdout=-1, text=True, env=environment(),
            )
            for change, pause in zip(changes, ("1.0", "0.0"), strict=True)
        ]  # fmt: skip
        for process, begins in zip(both, ("0", later), strict=True):
            assert process.stdin is not None and process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            process.stdin.write(f"{begins}\n")
            process.stdin.flush()
        assert [process.wait() for process in both] == [0, 0]
        assert {n: (folder / BUILD / n).read_bytes() for n in whole[0]} in whole
        assert main(["respond", ".", "-q"]) == 0
        assert {n: (folder / BUILD / n).read_bytes() for n in whole[0]} == whole[0]


# ---------------------------------------------------------------- killed, ended, no room


ALIVE = """
import time
for _ in range(600):
    open("alive", "w")
    time.sleep(0.1)
"""


@pytest.mark.parametrize("script", [ALIVE, pytest.param("", marks=pytest.mark.slow)], ids=["a script", "gmsh"])
def test_a_mesher_ends_with_the_run_that_is_killed(script: str, tmp_path: Path) -> None:
    box, scratch = write_box(tmp_path / "box"), tmp_path / "scratch"
    scratch.mkdir()
    if script:
        (box / "build.py").write_text(script)
    command = [sys.executable, "-m", "microslip", "mesh", "box", "--set", "mesh.size=1"]
    process = subprocess.Popen(command, cwd=tmp_path, env=environment() | {"TMPDIR": str(scratch)}, stderr=-1)
    began = tmp_path / "alive" if script else None
    while process.poll() is None and not (began.exists() if began else list(scratch.glob("*/settings.json"))):
        time.sleep(0.02)
    time.sleep(0.0 if script else 3.0)
    assert process.poll() is None and list(scratch.iterdir())
    process.kill()
    process.communicate()
    deadline = time.monotonic() + 60
    while list(scratch.iterdir()) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not list(scratch.iterdir())
    if script:
        time.sleep(0.1)
        (tmp_path / "alive").unlink()
        time.sleep(0.3)
        assert not (tmp_path / "alive").exists()


def test_a_full_disk_in_the_middle_of_a_response(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The table of another amplitude is new, the response file is not, and the sentence claims no more than that."""
    assert main(["respond", ".", "-q"]) == 0
    before = {p: p.read_bytes() for p in (folder / BUILD).glob("response.*")}
    replace = os.replace

    def full(source: Any, target: Any) -> None:
        if str(target).endswith("response.h5"):
            raise OSError(errno.ENOSPC, "No space left on device")
        replace(source, target)

    monkeypatch.setattr(os, "replace", full)
    line = refused(["respond", ".", "-q", "--set", "amplitude=4.0"], capsys)
    assert f"{BUILD}/response.h5" in line and "nothing" not in line
    changed = {p.name for p, data in before.items() if not p.is_file() or p.read_bytes() != data}
    assert changed == {"response.csv", "response.record.json", "response.points"}
    monkeypatch.setattr(os, "replace", replace)
    assert main(["respond", ".", "-q"]) == 0
    assert (folder / BUILD / "response.csv").read_bytes() == before[folder / BUILD / "response.csv"]


def test_a_full_disk_leaves_a_journal_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write, path = os.write, tmp_path / "response.points"

    def full(file: int, data: Any) -> int:
        if len(data) < 100:
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(file, data[: len(data) - 50])

    with open_journal(path, "abc", {"case": "a"}) as journal:
        journal.keep("s", 1.0, {"x": 1.0})
        size = path.stat().st_size
        with monkeypatch.context() as patch, pytest.raises(store.UserError, match="response.points"):
            patch.setattr(os, "write", full)
            journal.keep("s", 2.0, {"x": 2.0})
        assert path.stat().st_size == size
        journal.keep("s", 3.0, {"x": 3.0})
    assert list(read_journal(path)[1]["s"]) == [1.0, 3.0]


# ---------------------------------------------------------------- paths that lead elsewhere


@pytest.mark.parametrize("way", ["path", "link"])
def test_a_build_file_outside_the_body_is_not_run(way: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    box, ran = write_box(tmp_path / "box"), tmp_path / "ran"
    (tmp_path / "elsewhere.py").write_text(f"open({str(ran)!r}, 'w')\n")
    if way == "path":
        edit(box / "body.toml", 'build = "build.py"', 'build = "../elsewhere.py"')
    else:
        (box / "build.py").unlink()
        (box / "build.py").symlink_to("../elsewhere.py")
    assert "geometry.build" in refused(["mesh", str(box)], capsys) and not ran.exists()


@pytest.mark.parametrize(
    "words",
    [
        ["mesh", "box"], ["modes", "box"], ["closure", "box", "--to", "1"], ["contact", "3.5-2"],
        ["report", "basis.h5"], ["export", "basis.h5", "--to", "mat"], ["compare", "basis.h5", "basis.h5"],
        ["info", "part.step"],
    ],
    ids=lambda words: words[0],
)  # fmt: skip
def test_no_verb_makes_the_folder_of_an_output(
    words: list[str], folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "gone/out" in refused([*words, "-o", "gone/out"], capsys)
    assert sorted(p.name for p in folder.iterdir()) == ["basis.h5", "case.toml"]


@pytest.mark.parametrize("given", ['body = "../part"', 'bodies = [{name = "vane", body = "../part"}]'])
def test_a_body_is_no_path(given: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "case.toml").write_text(QUICK.replace('body = "vane-eigenmodes"', given))
    line = refused(["run", "case.toml"], capsys)
    assert "body: " in line and "name" in line and "geometry/" in line


# ---------------------------------------------------------------- what check says


@pytest.mark.usefixtures("untried")
def test_check_tells_a_missing_seal(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["respond", ".", "-q"]) == 0
    for file in ("basis.h5", f"{BUILD}/response.h5"):
        for sealed in (True, False):
            capsys.readouterr()
            assert main(["check", file]) == 0
            assert ("not sealed" in capsys.readouterr().out) != sealed
            with h5py.File(file, "r+") as touched:
                touched.attrs["note"] = 1


def test_check_short_is_a_verdict(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "basis.h5", "--short"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 1


@pytest.mark.parametrize("verb", ["check", "report"])
@pytest.mark.parametrize("name", ["deck.inp", "deck.cdb", "part.step", "K.mtx", "case.toml"])
def test_files_of_other_programs_are_called_what_they_are(
    verb: str, name: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / name).write_text("*HEADING\n")
    line = refused([verb, name], capsys)
    assert name in line and "damaged" not in line and ("microslip import" in line or "microslip run" in line)
