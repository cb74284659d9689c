"""Hostile input with a fixed budget: whatever a file holds, the outcome is success or a `UserError`.

Never another exception, never a hang, never a crash. Examples are derandomised (conftest), so a run repeats.
"""

from __future__ import annotations

import contextlib
import copy
import os
import random
import re
import signal
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import decks
import pytest
import small
from damage import flipped
from hypothesis import example, given, settings
from hypothesis import strategies as st
from test_mesh import INP, TET

from microslip.basis import read_basis, write_basis
from microslip.case import load_case
from microslip.cli import main
from microslip.errors import UserError
from microslip.mesh import mesh_problems, read_mesh
from microslip.modal.compute import modal_basis
from microslip.settings.body import BodySettings, load_body, validate
from microslip.settings.toml import override
from microslip.system import system_basis

pytestmark = pytest.mark.usefixtures("undrawn", "unjudged")

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
from damage import flipped
from microslip.basis import check_basis, files
from microslip.errors import UserError
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
            found = files._read_or_refuse(file)
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


# ---------------------------------------------------------------- through the command line

NONSENSE = [
    "nan", "inf", "-inf", "-1", "0", "-0.5", "1e300", "-1e300", "1e-300", '"text"', '""', "true", "[]", "[nan]", "{}",
    '"3 mm"', '"0.3"', "1979-05-27", "[1, 2, 3, 4, 5]", "9" * 400, "1e9", "1000000", "[[1, 2], [3]]", "[0, 0, 0]",
    "[1e300, 0, 0]", "0.5", '"../x"', '["a", 3]', "[1, nan, 0]", "7",
]  # fmt: skip
SIZES = ["0", "-1", "0.5", "7", "1e9", "1e29", "-1e29", "1e-29", "1e12", "1e-12", "nan", "inf", "2", "-3", "1000000"]
BEAM = """
name = "beam"
length_unit = "m"
reduction = "eigenmodes"
geometry = { mesh = "beam.inp" }
material = { density = 7850.0, young = 2.1e11, poisson = 0.3, expansion = 1.2e-5 }
temperature = { reference = 293.0, uniform = 300.0 }
[[supports]]
face = "clamp"
directions = "xyz"
[[loads]]
kind = "gravity"
vector = [0.0, 0.0, 9.81]
[[interfaces]]
name = "right"
face = "contact_right"
role = "right"
t2 = [0.0, 0.0, 1.0]
[[excitations]]
name = "shaker"
point = [0.01, 0.015, 0.12]
direction = [1.0, 2.0, 0.0]
[[monitors]]
name = "probe"
point = [0.01, 0.015, 0.12]
[[gauges]]
name = "root"
point = [0.01, 0.0, 0.01]
direction = [0.0, 0.0, 1.0]
[rotation]
axis = [0.0, 1.0, 0.0]
point = [0.0, 0.0, -0.1]
speeds_rpm = [0.0, 3000.0]
prestress = "linear"
[modes]
count = 3
solver = "superlu"
certify = true
[damping]
ratio = 0.002
[output]
gauss = false
"""
ASSIGNED = re.compile(r"\s*[\w.]+\s*=")


def spoiled(text: str, rng: random.Random) -> str:
    """One or two settings of another type or size, a letter lost from a key, a line or a table twice."""
    lines = text.splitlines()
    for _ in range(rng.choice([1, 1, 1, 2])):
        at = rng.choice([i for i, line in enumerate(lines) if ASSIGNED.match(line)])
        (key, _, value), way = lines[at].partition("="), rng.randrange(10)
        digits = re.findall(r"-?\d[\d.e-]*", value.split("#")[0])
        if way < 5 and digits and "[" in value:
            digits[rng.randrange(len(digits))] = rng.choice(SIZES)
            lines[at] = f"{key}= [{', '.join(digits)}]"
        elif way < 5 and digits:
            lines[at] = f"{key}= {rng.choice(SIZES)}"
        elif way < 7:
            lines[at] = f"{key}= {rng.choice(NONSENSE)}"
        elif way == 7:
            lost = rng.randrange(len(key.strip()))
            lines[at] = f"{key.strip()[:lost]}{key.strip()[lost + 1 :]} ={value}"
        elif way == 8:
            lines.insert(at, lines[at])
        elif tables := [i for i, line in enumerate(lines) if line.startswith("[[")]:
            first = rng.choice(tables)
            last = next((i for i in range(first + 1, len(lines)) if lines[i].startswith("[")), len(lines))
            lines[first:first] = lines[first:last]
    return "\n".join(lines) + "\n"


def typed(words: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """Exit code and what is printed; a warning of NumPy's is an exception, and so a traceback."""
    capsys.readouterr()
    with warnings.catch_warnings(), within(120):
        warnings.simplefilter("error")
        for kind in (DeprecationWarning, ResourceWarning):
            warnings.simplefilter("ignore", kind)
        code = main(words)
    said = capsys.readouterr()
    text = said.out + said.err
    assert code in (0, 1, 2) and "Traceback" not in text and "Warning" not in text, text
    assert (code == 0) == (not said.err.strip().startswith("error:") and "\nerror:" not in said.err), said.err
    return code, text


def files_below(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def settings_of(kind: str, folder: Path) -> tuple[Path, list[str]]:
    """A settings file in a folder, and what is typed to run it."""
    if kind in ("case", "system"):
        assert main(["init", "three-masses"]) == 0
        case = folder / "three-masses" / "case.toml"
        few = case.read_text().replace("points = 141", "points = 4").replace("harmonics = 1\n", "")
        few = few.replace("[2.0, 10.0, 30.0, 1000.0]", "[2.0]")
        case.write_text("harmonics = 3\nsamples = 48\nspeed = 0\nmodes = 3\ndamping_ratio = 0.01\n" + few)
        if kind == "system":
            return folder / "three-masses" / "system.toml", ["modes", "three-masses", "-q"]
        assert main(["modes", "three-masses", "-q"]) == 0
        # where the response jumps one motion in time shows as much as two minutes of them
        return case, ["respond", str(case), "-q", "--set", "sweep.patience=1"]
    if kind == "contact":
        assert main(["init", "contact"]) == 0
        return folder / "contact" / "contact.toml", ["contact", "contact", "-q", "-o", "out"]
    (folder / "beam.inp").write_text("\n".join(decks.mesh_lines(small.beam((1, 1, 1)), 1.0, FACES)) + "\n")
    (folder / "body.toml").write_text(BEAM)
    return folder / "body.toml", ["modes", "body.toml", "-q"]


FACES = ("clamp", "tip", "contact_left", "contact_right")
SEEDS = [("case", 0, 6), ("system", 0, 40), ("body", 0, 20)]
MORE = [("case", 6, 66), ("system", 40, 240), ("body", 20, 140), ("contact", 0, 24)]
"""Kind of a settings file, and which ones are drawn."""


@pytest.mark.parametrize("drawn", [*SEEDS, *[pytest.param(one, marks=pytest.mark.slow) for one in MORE]])
def test_nonsense_settings_through_the_command_line(
    drawn: tuple[str, int, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Done, not converged, or refused with a sentence; what is refused has overwritten nothing."""
    monkeypatch.chdir(tmp_path)
    kind, first, last = drawn
    path, words = settings_of(kind, tmp_path)
    text, refused = path.read_text(), 0
    assert typed(words, capsys)[0] == 0
    before = files_below(tmp_path)
    for seed in range(first, last):
        before[path] = spoiled(text, random.Random(f"{kind}{seed}")).encode()
        path.write_bytes(before[path])
        code, _ = typed(words, capsys)
        refused += code == 2
        now = files_below(tmp_path)
        assert code != 2 or now == before, seed
        before = now
    assert (last - first) / 3 < refused < last - first


@pytest.mark.parametrize(
    ("suffix", "count"),
    [
        *[(suffix, 10) for suffix in (".inp", ".unv", ".cdb", ".bdf")],
        *[(suffix, 2) for suffix in (".h5", ".med")],
        *[pytest.param(suffix, 300, marks=pytest.mark.slow) for suffix in (".inp", ".unv", ".cdb", ".bdf")],
        *[pytest.param(suffix, n, marks=pytest.mark.slow) for suffix, n in ((".h5", 80), (".msh", 20), (".med", 20))],
        pytest.param(".step", 8, marks=pytest.mark.slow),
    ],
)
def test_changed_bytes_through_the_command_line(
    suffix: str, count: int, tmp_path: Path, modal_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Read or refused; a sealed modal file is what it was, or refused."""
    from test_readers import samples

    if suffix == ".step":
        pytest.importorskip("gmsh")
        done = subprocess.run([sys.executable, "-c", BOX], cwd=tmp_path, capture_output=True)
        assert done.returncode == 0
        whole = (tmp_path / "box.step").read_bytes()
    else:
        whole = modal_file.read_bytes() if suffix == ".h5" else samples(tmp_path)[suffix]
    path = tmp_path / f"a{suffix}"
    path.write_bytes(whole)
    words = ["check" if suffix == ".h5" else "info", str(path)]
    first = typed(words, capsys)
    assert first[0] == 0
    for seed in range(count):
        path.write_bytes(flipped(whole, random.Random(seed)))
        found = typed(words, capsys)
        assert found[0] in (0, 2) and (suffix != ".h5" or found[0] or found == first), seed


BOX = "import gmsh; gmsh.initialize(interruptible=False); gmsh.model.occ.addBox(0, 0, 0, 10, 10, 10); "
BOX += "gmsh.model.occ.synchronize(); gmsh.write('box.step')"
