"""Complete or absent under kill, full disks and missing rights; leftovers; the rule for what is up to date."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
import small
from refusals import refused

from microslip.basis import check_basis, read_basis, write_basis
from microslip.contact.examples import EXAMPLES
from microslip.errors import UserError
from microslip.exchange.mat import write_mat
from microslip.files import store

ROOT = Path(__file__).resolve().parents[1]
POSIX = pytest.mark.skipif(os.name != "posix", reason="signals and limits of POSIX systems")


def environment() -> dict[str, str]:
    paths = [str(ROOT / "tests"), str(ROOT / "pipeline"), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


def hidden(folder: Path) -> list[str]:
    return [p.name for p in folder.iterdir() if p.name.startswith(".")]


# ---------------------------------------------------------------- killed at any instant

WRITER = """
import sys
from microslip.basis import read_basis, write_basis
bases = [read_basis(p) for p in sys.argv[2:]]
print("ready", flush=True)
while True:
    for basis in bases:
        write_basis(sys.argv[1], basis)
"""


@pytest.mark.slow
@POSIX
def test_a_killed_writer_leaves_the_old_file_or_the_new_one(tmp_path: Path) -> None:
    sources = [tmp_path / "a.h5", tmp_path / "b.h5"]
    write_basis(sources[0], small.basis())
    write_basis(sources[1], small.basis(free=True))
    whole = {p.read_bytes() for p in sources}
    target = tmp_path / "out" / "basis.h5"
    rng = random.Random(3)
    longest = 0.15  # s; more on a machine too slow to finish a file within
    while not (target.exists() and longest > 0.3):
        process = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(target), *map(str, sources)], stdout=subprocess.PIPE, env=environment()
        )
        assert process.stdout is not None and process.stdout.readline() == b"ready\n"
        time.sleep(rng.uniform(0.0, longest))
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stdout.close()
        if target.exists():
            assert target.read_bytes() in whole
            assert all(c.passed for c in check_basis(read_basis(target)))
        longest *= 1.2
        assert longest < 30
    for leftover in hidden(target.parent):
        os.utime(target.parent / leftover, (0, 0))
    write_basis(target, small.basis())
    assert hidden(target.parent) == []


def test_leftovers_of_running_writers_and_of_other_products_stay(tmp_path: Path) -> None:
    fresh = tmp_path / f".basis.{2**22 + 1}.abc.h5"  # a process that cannot exist, but silent for a second only
    running = tmp_path / f".basis.{os.getpid()}.abc.h5"
    other = tmp_path / f".basis2.{2**22 + 1}.abc.h5"
    strange = tmp_path / ".basis.backup.of.mine.h5"
    ancient = tmp_path / f".basis.{os.getpid()}.old.h5"
    for path in (fresh, running, other, strange, ancient):
        path.write_text("")
    old = time.time() - 600
    for path in (running, other, strange):
        os.utime(path, (old, old))
    os.utime(ancient, (0, 0))
    store.write_text(tmp_path / "basis.h5", "x")
    assert all(p.exists() for p in (fresh, running, other, strange))
    assert not ancient.exists()


def test_an_exception_leaves_the_old_file(tmp_path: Path) -> None:
    target = tmp_path / "x.txt"
    store.write_text(target, "old")
    for error in (ValueError, KeyboardInterrupt, UserError):
        with pytest.raises(error), store.complete_or_absent(target) as temporary:
            temporary.write_text("half")
            raise error("stop")
    assert target.read_text() == "old"
    assert hidden(tmp_path) == []


def test_rights_are_those_of_any_new_file(tmp_path: Path) -> None:
    store.write_text(tmp_path / "a", "x")
    (tmp_path / "b").write_text("x")
    assert (tmp_path / "a").stat().st_mode == (tmp_path / "b").stat().st_mode


# ---------------------------------------------------------------- no space, no rights

LIMITED = """
import resource, sys
import small
from microslip.basis import read_basis, write_basis
from microslip.contact.examples import EXAMPLES
from microslip.errors import UserError
from microslip.exchange.mat import write_mat
from microslip.files.store import write_text
basis = read_basis(sys.argv[1])
for limit in map(int, sys.argv[3:]):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    for suffix, write in (("h5", lambda p: write_basis(p, basis)), ("mat", lambda p: write_mat(basis, p)),
                          ("txt", lambda p: write_text(p, "x" * 3000000))):
        try:
            write(f"{sys.argv[2]}/basis.{suffix}")
            print("written", suffix, limit)
        except UserError as error:
            print("refused", error)
"""


@POSIX
def test_no_room_gives_one_sentence_and_leaves_the_old_file(tmp_path: Path) -> None:
    write_basis(tmp_path / "source.h5", small.basis())
    folder = tmp_path / "out"
    write_basis(folder / "basis.h5", small.basis(free=True))
    before = (folder / "basis.h5").read_bytes()
    size = (tmp_path / "source.h5").stat().st_size
    limits = [0, 2048, 300_000, size - 1]
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(tmp_path / "source.h5"), str(folder), *map(str, limits)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment(), timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""  # HDF5's destructors must not chatter
    lines = done.stdout.splitlines()
    assert len(lines) == 3 * len(limits)
    h5 = lines[::3]
    assert all("basis.h5: cannot be written (File too large)" in line for line in h5)
    assert (folder / "basis.h5").read_bytes() == before
    assert hidden(folder) == []


@pytest.fixture
def tiny_disk(tmp_path: Path) -> Iterator[Path]:
    place = tmp_path / "disk"
    place.mkdir()
    words = ["mount", "-t", "tmpfs", "-o", "size=200k", "tmpfs", str(place)]
    may = os.name == "posix" and os.geteuid() == 0 and shutil.which("mount") is not None
    if not may or subprocess.run(words, capture_output=True).returncode:
        pytest.skip("needs the right to mount a small disk")
    yield place
    subprocess.run(["umount", str(place)], check=False)


def test_a_full_disk(tiny_disk: Path) -> None:
    store.write_text(tiny_disk / "basis.h5", "old")
    for write in (lambda p: write_basis(p, small.basis()), lambda p: write_mat(small.basis(), p)):
        refused(("No space left on device)", "free some space"), write, tiny_disk / "basis.h5")
        assert (tiny_disk / "basis.h5").read_text() == "old"
        assert hidden(tiny_disk) == []


@POSIX
def test_the_command_line_says_it_in_one_line(tmp_path: Path) -> None:
    write_basis(tmp_path / "basis.h5", small.basis())
    code = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (20000, resource.RLIM_INFINITY));"
        "from microslip.cli import main; sys.exit(main(['export', sys.argv[1], '--to', 'mat']))"
    )
    done = subprocess.run(
        [sys.executable, "-B", "-c", code, str(tmp_path / "basis.h5")], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, env=environment(), timeout=120,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.startswith("error: ") and len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "basis.mat").exists()


@pytest.mark.parametrize("where", ["a file as folder", "a folder as file", "a name too long"])
def test_places_that_cannot_be_written(tmp_path: Path, where: str) -> None:
    (tmp_path / "file").write_text("mine")
    (tmp_path / "folder").mkdir()
    target = {
        "a file as folder": tmp_path / "file" / "sub" / "basis.h5",
        "a folder as file": tmp_path / "folder",
        "a name too long": tmp_path / ("x" * 300 + ".h5"),
    }[where]
    refused("cannot be written", store.write_text, target, "x")
    assert (tmp_path / "file").read_text() == "mine"
    assert (tmp_path / "folder").is_dir()


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may write anywhere")
def test_no_right_to_write(tmp_path: Path) -> None:
    folder = tmp_path / "closed"
    folder.mkdir(mode=0o500)
    refused("you may write to", store.write_text, folder / "x", "x")


# ---------------------------------------------------------------- what is up to date


def test_up_to_date_means_same_inputs_and_untouched_product(tmp_path: Path) -> None:
    product, inputs = tmp_path / "p.h5", {"mesh": "abc", "settings": {"a": 1, "b": [1.0, 2.0]}}
    assert not store.is_up_to_date(product, inputs)
    store.write_text(product, "content")
    assert not store.is_up_to_date(product, inputs)  # no sidecar: nobody knows what it was made from
    store.note_product(product, inputs, warnings=["w"])
    assert store.is_up_to_date(product, inputs)
    assert store.is_up_to_date(product, {"settings": {"b": [1.0, 2.0], "a": 1}, "mesh": "abc"})
    assert not store.is_up_to_date(product, {**inputs, "mesh": "abd"})
    assert not store.is_up_to_date(product, {**inputs, "more": 1})
    os.utime(product, (0, 0))
    assert store.is_up_to_date(product, inputs)
    store.write_text(product, "Content")  # replaced, but killed before the sidecar was written
    assert not store.is_up_to_date(product, inputs)
    store.note_product(product, inputs)
    product.unlink()
    assert not store.is_up_to_date(product, inputs)


def test_json_is_json(tmp_path: Path) -> None:
    """Numbers that are not finite are null at any depth, of numpy too; the rest stays as it is."""

    def refused(word: str) -> None:
        raise ValueError(word)

    told = {"b": [np.float64(np.inf), (1.5, np.nan)], "a": {"c": -np.inf, "d": [None, True, "NaN", 3]}}
    store.write_json(tmp_path / "a.json", told)
    found = json.loads((tmp_path / "a.json").read_text(), parse_constant=refused)
    assert found == {"b": [None, [1.5, None]], "a": {"c": None, "d": [None, True, "NaN", 3]}}


def test_every_file_of_a_product_counts(tmp_path: Path) -> None:
    """Changed, cut short or gone, wherever it stands below; and without a sidecar nothing is finished."""
    product, files = tmp_path / "response.json", [tmp_path / "response.csv", tmp_path / "pictures/response.png"]
    for path in (product, *files):
        store.write_text(path, "content")
    store.note_product(product, {}, files)
    for path in files:
        for text in ("Content", "conten", "", None):
            path.unlink() if text is None else path.write_text(text)
            assert not store.is_up_to_date(product, {})
            store.write_text(path, "content")
            assert store.is_up_to_date(product, {})
    told: list[str] = []
    os.utime(product, (0, 0))
    assert store.nothing_to_do(product, {}, report=told.append) and len(told) == 1 and product.stat().st_mtime > 0
    assert not store.nothing_to_do(product, {}, force=True) and not store.nothing_to_do(product, {"more": 1})
    former = tmp_path / "response.json.json"  # where the sidecar of this product stood before
    former.write_text("{}")
    store.unfinished(product)
    store.unfinished(product)
    assert not former.exists() and not (tmp_path / "response.record.json").exists()
    assert not store.is_up_to_date(product, {})


@pytest.mark.parametrize("note", ["", "{", "[]", "3", '{"inputs": 3}', '"x"', "null", "\udcff"])
def test_a_damaged_sidecar_means_out_of_date(tmp_path: Path, note: str) -> None:
    store.write_text(tmp_path / "p", "x")
    store.sidecar_path(tmp_path / "p").write_bytes(note.encode(errors="surrogateescape"))
    assert not store.is_up_to_date(tmp_path / "p", {})


def test_what_is_volatile_stands_in_the_sidecar_only(tmp_path: Path) -> None:
    write_basis(tmp_path / "basis.h5", small.basis())
    first = store.hash_file(tmp_path / "basis.h5")
    store.note_product(tmp_path / "basis.h5", {})
    assert store.hash_file(tmp_path / "basis.h5") == first
    assert "written" in store.sidecar_path(tmp_path / "basis.h5").read_text()


def test_hashes() -> None:
    assert store.hash_settings({"a": 1, "b": 2}) == store.hash_settings({"b": 2, "a": 1})
    assert store.hash_settings({"a": 1}) != store.hash_settings({"a": 1.5})
    assert store.hash_settings({"a": np.float64(2).item()}) == store.hash_settings({"a": 2.0})
    assert len(store.hash_settings([])) == 64


@dataclass(frozen=True)
class Held:
    name: str
    values: object


def test_a_fingerprint_is_of_every_bit_and_of_nothing_else() -> None:
    """Arrays of jax are those of numpy, the order of a mapping does not count; kind, shape, place and last bit do."""
    law = next(iter(EXAMPLES.values()))
    same = Held("a", {"x": np.arange(3.0), "y": [None, law]}), Held("a", {"y": [None, law], "x": jnp.arange(3.0)})
    assert len({store.fingerprint(v) for v in same}) == 1
    x = np.arange(3.0)
    others = [
        x, x[:2], x.reshape(3, 1), np.nextafter(x, 9.0), x.astype(int), [*x], [[*x]], {"x": x}, Held("a", x),
        Held("b", x), law, *EXAMPLES.values(), "x", None, ["x", None], [["x"], None], "None",
    ]  # fmt: skip
    assert len({store.fingerprint(v) for v in others}) == len({id(v) for v in others})
    with pytest.raises(TypeError):
        store.fingerprint(lambda: 0)


def test_a_file_of_another_kind_is_not_replaced(tmp_path: Path) -> None:
    """Nor is one that another program wrote in a format of ours; a table gives way to a table, an empty file and a link
    to anything, a product with a sidecar to a whole one."""
    import h5py

    from microslip.files.hdf5 import sealed

    path = tmp_path / "it.h5"

    def write(form: str) -> None:
        with sealed(path) as file:
            file.attrs["format"] = form

    def others() -> None:
        with h5py.File(path, "w") as file:
            file["x"] = [1.0, 2.0]

    path.touch()
    for form in ("microslip-orbit", "microslip-orbit"):
        write(form)
    for other in (lambda: write("microslip-response"), others, lambda: path.write_text("notes")):
        path.unlink()
        other()
        before = path.read_bytes()
        refused("it.h5: is there already and is ", write, "microslip-orbit")
        assert path.read_bytes() == before and [p.name for p in tmp_path.iterdir()] == ["it.h5"]
    refused((), store.write_text, path.with_name("it.h5"), "<!DOCTYPE html>")
    store.write_text(path, "a,b")
    path.write_bytes(b"torn")
    store.sidecar_path(path).write_text("{}")
    write("microslip-orbit")
