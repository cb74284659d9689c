"""Hostile input with a fixed budget: whatever a file holds, the outcome is success or a `UserError`.

Never another exception, never a hang, never a crash. Examples are derandomised (conftest), so a run repeats.
"""

from __future__ import annotations

import contextlib
import copy
import os
import random
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import small
from hypothesis import example, given, settings
from hypothesis import strategies as st
from test_mesh import INP, TET

from microslip.basis import read_basis, write_basis
from microslip.body import BodySettings, load_body, override, validate
from microslip.case import load_case
from microslip.data import UserError
from microslip.mesh import mesh_problems, read_mesh
from microslip.modes import modal_basis
from microslip.system import system_basis

ROOT = Path(__file__).resolve().parents[1]


@contextlib.contextmanager
def within(seconds: float) -> Iterator[None]:
    """A hang becomes a failure (where the system has alarms)."""
    if not hasattr(signal, "setitimer"):
        yield
        return

    def stop(*_: object) -> None:
        raise AssertionError(f"still busy after {seconds} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


@contextlib.contextmanager
def user_errors_only() -> Iterator[None]:
    """`UserError` passes if it is text for a person: no traceback, no empty line."""
    with within(20):
        try:
            yield
        except UserError as error:
            assert str(error).strip()
            assert "Traceback" not in str(error)
            assert all(line.strip() for line in str(error).splitlines())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fuzz")


# ---------------------------------------------------------------- changes of a text

PIECES = [
    "", "\n", " ", "=", "[", "]", "[[", "]]", "{", "}", '"', "'", ",", ".", "-", "#", "nan", "inf", "-inf", "true",
    "0", "-1", "1e-320", "1e999", "9" * 25, "9" * 400, "0x10", "1979-05-27", "\'\'\'", "\\u0000", "\x00", "\ud7ff", "é",
    "\U0001f600", "name", "face", "[material]", "[[interfaces]]", "[geometry.parameters]", "a.b.c = 1\n", "$",
    "$EndNodes", "*NODE\n", "*ELEMENT, TYPE=C3D4\n", "*NSET, NSET=A, GENERATE\n", "1, 2, 3", "4 4 4", "-99999999999",
    "*INCLUDE, INPUT=part\n",
]  # fmt: skip
EDITS = st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 40), st.sampled_from(PIECES)), min_size=1, max_size=6)


def edited(text: str, edits: list[tuple[int, int, str]]) -> bytes:
    """Replace stretches of a text by other pieces."""
    for place, length, piece in edits:
        place %= len(text) + 1
        text = text[:place] + piece + text[place + length :]
    return text.encode("utf-8", "surrogatepass")


def token_edited(text: str, edits: list[tuple[int, int, str]]) -> bytes:
    """Replace words of a text by other pieces, so that its structure stays."""
    lines = [line.split(" ") for line in text.splitlines()]
    for place, length, piece in edits:
        line = lines[place % len(lines)]
        line[length % len(line)] = piece
    return "\n".join(" ".join(line) for line in lines).encode("utf-8", "surrogatepass")


# ---------------------------------------------------------------- body files

BODIES = [path.read_text(encoding="utf-8") for path in sorted((ROOT / "geometry").glob("*/body.toml"))]


@settings(max_examples=100)
@given(st.sampled_from(BODIES), EDITS, st.booleans())
def test_changed_body_files(folder: Path, text: str, edits: list[tuple[int, int, str]], words: bool) -> None:
    path = folder / "body.toml"
    path.write_bytes((token_edited if words else edited)(text, edits))
    with user_errors_only():
        load_body(path)


@settings(max_examples=50)
@given(st.binary(max_size=200))
def test_any_bytes_as_a_body_file(folder: Path, data: bytes) -> None:
    (folder / "body.toml").write_bytes(data)
    with user_errors_only():
        load_body(folder / "body.toml")


TEMPLATES = ROOT / "pipeline" / "microslip" / "templates" / "three-masses"
SYSTEM, CASE = ((TEMPLATES / name).read_text(encoding="utf-8") for name in ("system.toml", "case.toml"))


@settings(max_examples=150)
@given(EDITS, st.booleans())
def test_changed_system_files(folder: Path, edits: list[tuple[int, int, str]], words: bool) -> None:
    (folder / "system.toml").write_bytes((token_edited if words else edited)(SYSTEM, edits))
    with user_errors_only():
        system_basis(folder / "system.toml")


@settings(max_examples=150)
@given(EDITS, st.booleans())
def test_changed_case_files(folder: Path, edits: list[tuple[int, int, str]], words: bool) -> None:
    (folder / "case.toml").write_bytes((token_edited if words else edited)(CASE, edits))
    with user_errors_only():
        load_case(folder / "case.toml")


NUMBERS = st.one_of(st.integers(), st.floats(), st.sampled_from([0, 1, -1, 10**400, -(10**400), 1e308, 5e-324]))
WORDS = st.sampled_from(["right", "clamp", "xyz", "mm", "x.msh"])
LEAVES = st.one_of(st.booleans(), NUMBERS, st.text(max_size=8), WORDS)
KEYS = st.sampled_from(
    ["name", "face", "point", "direction", "young", "shear", "axes", "box", "label", "value", "kind", "zzz", "", "a b"]
)
VALUES = st.recursive(LEAVES, lambda v: st.lists(v, max_size=4) | st.dictionaries(KEYS, v, max_size=4), max_leaves=8)


def places(table: Any, above: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every place of a nested table."""
    steps = table if isinstance(table, dict) else range(len(table)) if isinstance(table, list) else ()
    return [p for step in steps for p in ((*above, step), *places(table[step], (*above, step)))]


FULL = small.table(
    geometry={"cad": "a.step", "parameters": {"a": 1}, "faces": [{"name": "clamp", "box": [0, 0, 0, 1, 1, 1]}]},
    mesh={"size": 3.0, "order": 2, "local": {"clamp": 1.0}},
    material={
        "density": 7850.0, "young": [2e11, 2e11, 2e11], "poisson": [0.3, 0.3, 0.3], "shear": [8e10, 8e10, 8e10],
        "axes": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "temperature": [300.0, 400.0], "modulus_factor": [1.0, 0.9],
    },
    temperature={"reference": 293.0, "uniform": 300.0},
    loads=[{"kind": "force", "point": [0, 0, 0], "vector": [0, 0, 1]}, {"kind": "gravity", "vector": [0, 0, 1]}],
    damping={"alpha": 1.0, "beta": 0.0},
    output={"gauss": False},
)  # fmt: skip


def deeper(series: Any, examples: int, *strategies: Any) -> Any:
    """The slow twin of a series, with more examples."""
    return pytest.mark.slow(settings(max_examples=examples)(given(*strategies)(series.hypothesis.inner_test)))


CHANGES = st.lists(st.tuples(st.integers(0, 10**6), VALUES), min_size=1, max_size=3)
WORDS = st.lists(st.sampled_from([*PIECES, "interfaces", "right", "modes", "count", "supports", "0"]), max_size=7)


@settings(max_examples=100)
@given(CHANGES, KEYS, VALUES, st.booleans())
@example([(0, 10**400)], "zzz", True, False)
def test_any_value_at_any_place_of_the_settings(
    changes: list[tuple[int, Any]], key: str, value: Any, more: bool
) -> None:
    table = copy.deepcopy(FULL)
    for number, new in changes:
        every = places(table)
        *above, last = every[number % len(every)]
        place: Any = table
        for step in above:
            place = place[step]
        place[last] = copy.deepcopy(new)
        if more and isinstance(place, dict):
            place[key] = copy.deepcopy(value)
    with user_errors_only():
        validate(BodySettings, table, Path("body.toml"))


@settings(max_examples=100)
@given(WORDS)
def test_any_override(words: list[str]) -> None:
    with user_errors_only():
        override(copy.deepcopy(FULL), ["".join(words)], Path("body.toml"))


test_any_value_deeper = deeper(test_any_value_at_any_place_of_the_settings, 250, CHANGES, KEYS, VALUES, st.booleans())
test_any_override_deeper = deeper(test_any_override, 250, WORDS)


# ---------------------------------------------------------------- meshes


def read_any_mesh(path: Path) -> None:
    with user_errors_only():
        mesh_problems(read_mesh(path, "mm"))


@settings(max_examples=30)  # what passes the first look is tried in a process of its own
@given(EDITS, st.booleans())
def test_changed_gmsh_files(folder: Path, edits: list[tuple[int, int, str]], words: bool) -> None:
    (folder / "part.msh").write_bytes((token_edited if words else edited)(TET, edits))
    read_any_mesh(folder / "part.msh")


@settings(max_examples=100)
@given(EDITS, st.booleans())
def test_changed_abaqus_files(folder: Path, edits: list[tuple[int, int, str]], words: bool) -> None:
    (folder / "part.inp").write_bytes((token_edited if words else edited)(INP, edits))
    read_any_mesh(folder / "part.inp")


test_changed_gmsh_files_deeper = deeper(test_changed_gmsh_files, 100, EDITS, st.booleans())
test_changed_abaqus_files_deeper = deeper(test_changed_abaqus_files, 300, EDITS, st.booleans())


FOREIGN: dict[str, bytes] = {}


@pytest.fixture(scope="module")
def foreign(folder: Path) -> None:
    """A small mesh in formats that meshio reads."""
    meshio = pytest.importorskip("meshio")
    beam = small.beam((1, 1, 1))
    mesh = meshio.Mesh(beam.points, [("tetra10", beam.cells["tetra10"])], point_sets={"a": [0, 1]})
    for name, binary in (("b.msh", True), ("a.msh", False)):
        meshio.gmsh.write(folder / name, mesh, "2.2" if name == "a.msh" else "4.1", binary=binary)
        FOREIGN[name] = (folder / name).read_bytes()
    for name in ("a.vtu", "a.vtk", "a.bdf"):
        with contextlib.redirect_stdout(None), contextlib.redirect_stderr(None):
            meshio.write(folder / name, mesh)
        FOREIGN[name] = (folder / name).read_bytes()


@pytest.mark.slow
@settings(max_examples=20)  # each in a process of its own
@given(st.sampled_from(["a.msh", "b.msh", "a.vtu", "a.vtk", "a.bdf"]), st.integers(0, 2**32))
def test_flipped_bytes_in_other_meshes(folder: Path, foreign: None, name: str, seed: int) -> None:
    (folder / name).write_bytes(flipped(FOREIGN[name], random.Random(seed)))
    read_any_mesh(folder / name)


def flipped(data: bytes, rng: random.Random, cut: bool = True) -> bytes:
    """Bits, bytes and words changed, stretches copied elsewhere, sometimes cut."""
    out = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 4, 16])):
        i, j = rng.randrange(len(out)), rng.randrange(len(out))
        kind = rng.randrange(7)
        if kind == 0:
            out[i] ^= 1 << rng.randrange(8)
        elif kind == 1:
            out[i] = rng.randrange(256)
        elif kind == 2:
            out[i : i + 8] = b"\xff" * 8
        elif kind == 3:
            out[i : i + 4] = bytes(4)
        elif kind == 4:
            out[i : i + 16] = out[j : j + 16]
        elif kind == 5:
            out[i : i + 8] = rng.randrange(2**64).to_bytes(8, "little")
        elif cut and len(out) > 100 and not rng.randrange(4):
            del out[max(i, 50) :]
    return bytes(out)


# ---------------------------------------------------------------- modal files


@pytest.fixture(scope="module")
def modal_file(folder: Path) -> Path:
    """A modal file that is mostly structure."""
    table = small.table(modes={"count": 3, "solver": "superlu"}, output={"gauss": False})
    write_basis(folder / "tiny.h5", modal_basis(small.beam((1, 1, 2)), BodySettings.model_validate(table)))
    return folder / "tiny.h5"


def test_flipped_bytes_in_sealed_modal_files(folder: Path, modal_file: Path) -> None:
    data = modal_file.read_bytes()
    refused = 0
    for seed in range(150):
        changed = flipped(data, random.Random(seed), cut=False)
        (folder / "sealed.h5").write_bytes(changed)
        if changed == data:
            continue
        with within(30):
            try:
                read_basis(folder / "sealed.h5")
            except UserError:
                refused += 1
    assert refused > 120  # the rest hit the seal itself and left the content whole


WORKER = """
import random, sys
from pathlib import Path
from microslip.basis import check_basis, files
from microslip.case import load_case
from microslip.data import UserError
from test_fuzz import flipped
data, out = Path(sys.argv[1]).read_bytes()[:-120], Path(sys.argv[2])  # without its seal
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
except ImportError:
    pass
for seed in range(int(sys.argv[3]), int(sys.argv[4])):
    out.write_bytes(flipped(data, random.Random(seed)))
    print("seed", seed, flush=True)
    try:
        with files._open(out) as file:
            found = files._read_or_refuse(file, out)
        check_basis(found)
    except UserError:
        pass
print("end", flush=True)
"""


@pytest.mark.parametrize("stop", [15, pytest.param(60, marks=pytest.mark.slow)])
def test_flipped_bytes_in_unsealed_modal_files(folder: Path, modal_file: Path, stop: int) -> None:
    """Read in one process after the other. Where HDF5 itself crashes or hangs, the door in front of it must hold."""
    paths = [str(ROOT / "tests"), str(ROOT / "pipeline"), os.environ.get("PYTHONPATH", "")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    first, deaths = 0, 0
    while first < stop:
        words = [sys.executable, "-W", "error::RuntimeWarning", "-c", WORKER]
        words += [str(modal_file), str(folder / "flipped.h5"), str(first), str(stop)]
        try:
            done = subprocess.run(words, capture_output=True, text=True, env=environment, timeout=60)
            output, errors = done.stdout, done.stderr
        except subprocess.TimeoutExpired as expired:
            output, errors = (expired.stdout or b"").decode(), "timeout"
        assert "Error" not in errors and "Exception" not in errors, errors
        last = output.split()[-1]
        if last == "end":
            break
        deaths += 1
        assert deaths < 5
        with within(60), pytest.raises(UserError):
            read_basis(folder / "flipped.h5")
        first = int(last) + 1
