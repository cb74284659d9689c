"""The command line: verbs, exit codes 0, 1, 2, 130, 143, one sentence for every mistake, silence on demand."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from box import edit, write_box
from refusals import refused_command

from microslip.basis import read_basis, write_basis
from microslip.case import CaseResult, run_case
from microslip.cli import app, main
from microslip.errors import UserError

ROOT = Path(__file__).resolve().parents[1]
POSIX = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX systems")
HEAVY = "gmsh meshio skfem pyvista vtkmodules vtk matplotlib imageio PIL jax qdldl pypardiso".split()


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT / "pipeline"), "OMP_NUM_THREADS": "1"}


def start(folder: Path, *words: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "microslip", *words]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, cwd=folder, env=environment(), stdout=pipe, stderr=pipe, text=True)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the box has been meshed and solved from the command line."""
    folder = tmp_path_factory.mktemp("cli")
    write_box(folder / "box")
    process = start(folder, "modes", "box")
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    assert "6 modes, certified complete" in out and out.splitlines()[-1] == "build/box/basis.h5"
    assert "meshing build.py" in err and "\x1b" not in out + err and "\r" not in out + err, "plain when not a terminal"
    return folder


@pytest.fixture
def folder(finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    copy = shutil.copytree(finished, tmp_path / "work")
    monkeypatch.chdir(copy)
    return copy


def said(capsys: pytest.CaptureFixture[str]) -> tuple[str, str]:
    out, err = capsys.readouterr()
    assert "Traceback" not in out + err
    return out, err


# ---------------------------------------------------------------- verbs that do their work


def test_help_names_every_verb_and_loads_nothing_heavy() -> None:
    """`--help` answers in 0.3 s: numpy alone would take most of that."""
    program = (
        "import sys; from microslip.cli import main; code = main(['--help'])\n"
        "print(*sorted({m.split('.')[0] for m in sys.modules}), file=sys.stderr); sys.exit(code)"
    )
    began = os.times()
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, check=True)
    ended = os.times()
    for verb in ("init", "mesh", "modes", "run", "closure", "check", "export", "report", "info"):
        assert f" {verb} " in done.stdout
    assert not {"numpy", "scipy", "h5py", "pydantic", *HEAVY} & set(done.stderr.split())
    used = ended.children_user + ended.children_system - began.children_user - began.children_system
    assert used < 1.5, f"{used:.2f} s: 0.1 to 0.3 s are usual"


@pytest.mark.parametrize("verb", ["init", "mesh", "modes", "run", "closure", "check", "export", "report", "info"])
def test_help_of_every_verb(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([verb, "--help"]) == 0
    out, err = said(capsys)
    assert f"Usage: microslip {verb}" in out and err == ""


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    from microslip import __version__

    assert main(["--version"]) == 0
    assert said(capsys)[0].strip() == __version__


def test_closure_presses_a_face_step_by_step(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A prism of 120 mm on the ground: E A / L = 1.05e9 N/m, 1 % more because the clamp hinders contraction."""
    ground = """closures=[{name="floor", face="tip", against="ground"}]"""
    words = ["closure", "box", "--set", ground, "--to", "0.02", "--points", "3", "-q", "-o", "out"]
    assert main(words) == 0
    rows = np.genfromtxt(folder / "out" / "closure_floor.csv", delimiter=",", names=True)
    np.testing.assert_allclose(rows["approach_m"], [0, 1e-5, 2e-5], atol=1e-18)
    assert rows["normal_force_N"][0] == 0 and rows["closed_share"][1:] == pytest.approx(1)
    assert rows["stiffness_N_per_m"] == pytest.approx(2.1e11 * 20e-3 * 30e-3 / 0.12, rel=0.03)
    assert (folder / "out" / "closure_floor.png").read_bytes().startswith(b"\x89PNG")
    said(capsys)
    for wrong, reason in (
        (["closure", "box", "--to", "1"], "the body has none"),
        ([*words[:4], "roof", "--to", "1"], "the body has floor"),
        ([*words[:4], "--to", "-1"], "rising approach"),
        ([*words[:4], "--set", "free=true", "--set", "supports=[]", "--to", "1"], "free"),
    ):
        assert main(wrong) == 2
        assert reason in said(capsys)[1]


def test_the_folder_of_a_modal_file_does_for_it(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "build/box", "-q"]) == 0
    assert main(["export", "build/box", "--to", "mat"]) == 0 and (folder / "build/box/basis.mat").is_file()
    assert main(["compare", "build/box", "build/box/basis.h5"]) == 0 and "1.0000" in said(capsys)[0]


def test_check_info_and_export_of_a_modal_file(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = "build/box/basis.h5"
    assert main(["check", file]) == 0
    out, err = said(capsys)
    assert err == "" and "FAIL" not in out and out.count("ok   ") > 15 and "checks passed" in out.splitlines()[-1]
    assert main(["check", file, "--short"]) == 0
    assert said(capsys)[0].splitlines()[-1] == out.splitlines()[-1]
    assert main(["info", file, "--speed", "0"]) == 0
    assert "6 modes, certified complete" in said(capsys)[0]
    for format_ in ("mat", "vtu"):
        assert main(["export", file, "--to", format_, "-o", f"out.{format_}"]) == 0
        assert said(capsys)[0].strip() == f"out.{format_}" and (folder / f"out.{format_}").stat().st_size > 1000


def test_info_of_bodies_and_meshes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", "box"]) == 0
    assert "box: a clamped box" in said(capsys)[0]
    assert main(["info", "meshes/box.msh", "--unit", "mm"]) == 0
    out, _ = said(capsys)
    assert "0.02 x 0.03 x 0.12 m" in out and "faces: clamp, tip" in out


def test_set_overrides_and_output_goes_where_it_is_told(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["mesh", "box", "--set", "mesh.size=40", "--set", "geometry.parameters.size=[20, 30, 60]"]) == 0
    out, err = said(capsys)
    assert out.startswith("meshes/box.msh: ") and "meshing" in err
    assert main(["modes", "box", "--set", "modes.count=2", "-o", "two.h5", "--quiet"]) == 0
    assert said(capsys) == ("", ""), "--quiet says nothing"
    assert read_basis(folder / "two.h5").groups[0, 0].n_modes == 2


def test_init_without_a_name_lists_what_can_be_had(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The names of the list that a wrong name is answered with; nothing is written."""
    assert main(["init"]) == 0
    listed = said(capsys)[0].split(": ")[1].strip()
    assert main(["init", "blad"]) == 2 and listed in said(capsys)[1] and "blade, " in listed
    assert not any(p.name == "blade" for p in folder.iterdir())


def test_init_copies_a_runnable_body_and_overwrites_nothing(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("blade", "shroud", "pendulum", "half-pipe"):
        assert main(["init", name]) == 0
        assert (folder / name / "body.toml").is_file() and (folder / name / "build.py").is_file()
        assert main(["info", name]) == 0
    assert (folder / "blade" / "case.toml").is_file()
    assert main(["init", "blade", "mine"]) == 0 and (folder / "mine" / "body.toml").is_file()
    assert main(["init", "sample", "vane"]) == 0
    case = (folder / "vane" / "case.toml").read_text()
    assert 'name = "vane"' in case and 'body = "vane-eigenmodes"' in case
    said(capsys)
    before = (folder / "blade" / "body.toml").read_bytes()
    (folder / "my part").mkdir()
    (folder / "my part" / "part.step").write_text("mine")  # a folder that holds the part already
    assert main(["init", "own", "my part"]) == 0 and "microslip run 'my part'" in said(capsys)[0]
    assert (folder / "my part" / "part.step").read_text() == "mine"
    assert main(["init", "own", "my part"]) == 2 and "my part/body.toml: is there already" in said(capsys)[1]
    assert main(["init", "blade"]) == 2
    assert "is there already" in said(capsys)[1] and (folder / "blade" / "body.toml").read_bytes() == before


def test_bodies_of_a_folder_have_names_of_their_own(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Copied under another name too, and what a copied file names is copied. Two of one name would write one product:
    refused by their files. A case beside them finds each by its name."""
    from microslip.stages.job import open_job
    from microslip.stages.places import find_body

    assert main(["init", "pendulum", "pp"]) == 0 and main(["init", "blade", "bb"]) == 0
    for file, name in (("pp/body", "pp"), ("pp/sliding", "pp-sliding"), ("bb/body", "bb"), ("bb/damped", "bb-damped")):
        assert open_job(folder / f"{file}.toml").settings.name == name
    case = folder / "pp" / "case.toml"
    assert find_body(case, "pp-sliding", folder) == folder / "pp" / "sliding.toml"
    assert find_body(case, "pp", folder) == folder / "pp" / "body.toml"
    for copied in (*folder.glob("pp/*.toml"), *folder.glob("bb/*.toml")):
        for name in re.findall(r"[\w./-]+\.(?:toml|py)\b", copied.read_text()):
            assert (copied.parent / name).is_file(), (copied, name)
    sliding = folder / "pp" / "sliding.toml"
    sliding.write_text(sliding.read_text().replace('"pp-sliding"', '"pp"'))
    for file, other in (("body", "sliding"), ("sliding", "body")):
        refused_command(["modes", f"pp/{file}.toml"], capsys, f"pp/{file}.toml: name: {other}.toml")
    assert not (folder / "build" / "pp").exists()
    assert open_job(sliding, ["name=another"]).settings.name == "another"


def test_every_question_takes_the_modal_file_beside_a_case(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Also those that make modal files where a body.toml is: the case alone is wrong then, no body is looked for."""
    assert main(["init", "sample", "vane"]) == 0
    for verb, words in (("mistune", "mistuning: is missing"), ("bifurcate", ""), ("orbit", "")):
        assert "nor in" not in refused_command([verb, "vane"], capsys, words), verb


def test_run_prints_the_first_frequencies(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("microslip.stages.running.run_body", lambda job, *_: (job.build_folder / "report.html", True))
    assert main(["run", "box"]) == 0
    table, page = said(capsys)[0].splitlines()
    first = read_basis(folder / "build/box/basis.h5").groups[0, 0].frequency[:5]
    shown = table.partition("rpm")[2].partition("Hz")[0].split()
    np.testing.assert_allclose([float(f) for f in shown], first, rtol=1e-4)  # five digits are printed
    assert page.endswith("build/box/report.html")
    assert main(["run", "box", "-q"]) == 0 and said(capsys) == ("", "")


@pytest.mark.slow
def test_run_of_a_case_and_a_response_that_does_not_converge(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.move(folder / "box", folder / "geometry" / "box")
    case = Path(shutil.copy(folder / "geometry/box/case.toml", folder / "other.toml"))
    edit(case, 'name = "box"', 'name = "other"')
    assert main(["run", "other.toml", "--set", "sweep.points=4", "-q"]) == 0
    assert said(capsys) == ("", "")
    assert len((folder / "build/other/response.csv").read_text().splitlines()) > 4

    def spoilt(*words: Any) -> CaseResult:
        result = run_case(*words)
        failed = {f: replace(r, converged=np.zeros_like(r.converged)) for f, r in result.responses.items()}
        return replace(result, responses=failed)

    monkeypatch.setattr("microslip.stages.response.run_case", spoilt)
    assert main(["run", "other.toml", "--set", "sweep.points=5"]) == 1
    out, err = said(capsys)
    assert out == "build/other/response.csv\n" and "did not converge" in err.splitlines()[-1]


# ---------------------------------------------------------------- 1: a check that fails


def test_a_check_that_fails_is_named_and_exits_1(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    basis = read_basis(folder / "build/box/basis.h5")
    group = basis.groups[0, 0]
    spoilt = replace(group, K_r=group.K_r * 1.01)
    write_basis(folder / "spoilt.h5", replace(basis, groups={(0, 0): spoilt}))
    assert main(["check", "spoilt.h5"]) == 1
    out, err = said(capsys)
    assert "FAIL speed_0/nd_0: K_r is diag(omega^2)" in out and "checks failed" in err
    assert main(["check", "spoilt.h5", "-q"]) == 1
    assert said(capsys)[0].splitlines() == [line for line in out.splitlines() if line.startswith("FAIL")]


# ---------------------------------------------------------------- 2: bad input, one sentence each


MISTAKES = [
    (["bla"], "Unknown command"),
    (["modes"], "BODY requires an argument"),
    (["modes", "box", "extra"], "extra"),
    (["modes", "box", "--colour"], "--colour"),
    (["export", "build/box/basis.h5"], "--to requires an argument"),
    (["export", "build/box/basis.h5", "--to", "docx"], "unknown format; choose one of dmig (Nastran"),
    (["export", "build/box/basis.h5", "--to", "mat", "-o", "body.toml/x.mat"], "body.toml/x.mat: there is no folder"),
    (["modes", "gone"], "gone: cannot be read"),
    (["modes", "gone.toml"], "gone.toml: cannot be read"),
    (["run", "gone.toml"], "gone.toml: cannot be read"),
    (["modes", "empty"], "empty/body.toml: cannot be read"),
    (["modes", "bad.toml"], "bad.toml: is not valid TOML"),
    (["run", "bad.toml"], "bad.toml: is not valid TOML"),
    (["modes", "build/box/basis.h5"], "build/box/basis.h5: is not UTF-8 text"),
    (["run", "build/lost/basis.h5"], "build/lost/basis.h5: is not UTF-8 text"),
    (["modes", "box", "--set", "nonsense"], "write --set key.subkey=value"),
    (["modes", "box", "--set", "modes.cuont=3"], "modes.cuont: unknown key; did you mean 'count'?"),
    (["modes", "box", "--set", "supports.clamp.face=clmp", "-q"], "clmp"),
    (["modes", "box", "--set", "modes.count=100000"], "modes.count"),
    (["run", "box/case.toml", "--set", "sweep.stop=1"], "stop must be above start"),
    (["run", "box/case.toml", "--set", "monitor=top", "-q"], "no monitor 'top'; it has tip"),
    (["run", "stray.toml"], "no body.toml of a body 'nobody'"),
    (["check", "gone.h5"], "gone.h5"),
    (["info", "build/box/basis.h5", "--speed", "1"], "--speed 1: the file has 1; count from 0"),
    (["export", "gone.h5", "--to", "dmig"], "gone.h5"),
    (["check", "empty"], "empty: is a folder without a modal file"),
    (["check", "box"], "box: holds a body, not its modal file"),
    (["modes", "meshes/box.msh"], "microslip import meshes/box.msh"),
    (["modes", "box", "--set", "material.from=mesh"], "name cannot stand beside density, young, poisson, from"),
    (["check", "bad.toml"], "bad.toml"),
    (["check", "zero.h5"], "zero.h5"),
    (["check", "other.h5"], "other.h5"),
    (["check", "cut.h5"], "cut.h5"),
    pytest.param(["report", "cut.h5"], "cut.h5", marks=pytest.mark.slow),
    (["info", "gone.step"], "there is no such file"),
    (["info", "cut.msh"], "cut.msh"),
    (["info", "zero.h5"], "zero.h5"),
    (["info", "bad.stl"], "bad.stl"),
    (["info", "meshes/box.msh", "--unit", "parsec"], "unknown unit of length; choose one of m, "),
    (["init", "rotor"], "there is no such body; choose one of blade, "),
    (["init", "blade", "body.toml/x"], "body.toml/x"),
]


@pytest.fixture
def mistakes(folder: Path) -> Path:
    basis = (folder / "build/box/basis.h5").read_bytes()
    (folder / "empty").mkdir()
    (folder / "build/lost").mkdir(exist_ok=True)
    (folder / "build/lost/basis.h5").write_bytes(basis)
    (folder / "zero.h5").write_bytes(b"")
    (folder / "cut.h5").write_bytes(basis[: len(basis) // 2])
    with h5py.File(folder / "other.h5", "w") as file:
        file["x"] = 1.0
    (folder / "cut.msh").write_bytes((folder / "meshes/box.msh").read_bytes()[:3000])
    (folder / "bad.toml").write_text('name = "box\n')
    (folder / "body.toml").write_text("")
    (folder / "bad.stl").write_bytes(bytes(range(256)))
    case = (folder / "box/case.toml").read_text()
    (folder / "stray.toml").write_text(case.replace('body = "box"', 'body = "nobody"'))
    return folder


@pytest.mark.usefixtures("untried")
@pytest.mark.parametrize(("words", "sentence"), MISTAKES, ids=lambda w: " ".join(w) if isinstance(w, list) else "")
def test_a_mistake_gives_one_sentence_and_exit_code_2(
    mistakes: Path, words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(str(p) for p in mistakes.rglob("*"))
    assert main(words) == 2
    out, err = said(capsys)
    errors = [line for line in err.splitlines() if line.startswith("error: ")]
    assert out == "" and len(errors) == 1 and sentence in errors[0]
    assert len(errors[0]) < 400
    assert sorted(str(p) for p in mistakes.rglob("*")) == before, "nothing was made or lost"


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="rights bind no administrator")
def test_files_without_the_right_to_read_or_write(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for file, words in (("box/body.toml", ["modes", "box"]), ("build/box/basis.h5", ["check", "build/box/basis.h5"])):
        (folder / file).chmod(0)
        assert main(words) == 2
        assert file in said(capsys)[1]
        (folder / file).chmod(0o644)
    (folder / "meshes").chmod(0o500)
    refused_command(["mesh", "box", "--force"], capsys, "meshes/box.msh: cannot be written")


@pytest.mark.parametrize(
    ("raised", "code", "sentence"),
    [
        (MemoryError(), 1, "not enough memory"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (PermissionError(13, "Permission denied", "secret"), 2, "secret: Permission denied"),
        (ModuleNotFoundError("No module named 'skfem.element'", name="skfem.element"), 2, "microslip[fem]"),
        (ModuleNotFoundError("No module named 'pyvista'", name="pyvista"), 2, "microslip[viz]"),
        (ModuleNotFoundError("No module named 'jax'", name="jax"), 2, "microslip[solve]"),
    ],
)
def test_what_may_happen_anywhere_is_said_in_one_sentence(
    raised: BaseException, code: int, sentence: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: Path) -> None:
        raise raised

    monkeypatch.setattr("microslip.basis.read_basis", fail)
    assert main(["check", "any.h5"]) == code
    assert sentence in said(capsys)[1]


def test_a_mistake_of_the_program_is_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: Path) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("microslip.basis.read_basis", fail)
    with pytest.raises(ZeroDivisionError):
        main(["check", "any.h5"])


# ---------------------------------------------------------------- 130 and 143: interrupted, ended


@POSIX
@pytest.mark.parametrize(
    ("words", "sign", "absent", "number"),
    [
        (["mesh", "box", "--set", "mesh.size=1"], "meshing", "meshes/box.msh", signal.SIGINT),
        (["mesh", "box", "--set", "mesh.size=1"], "meshing", "meshes/box.msh", signal.SIGTERM),
        pytest.param(
            ["modes", "box", "--set", "mesh.size=3.5", "--set", "modes.count=400"], "eigenmodes: ",
            "build/box/basis.h5", signal.SIGINT, marks=pytest.mark.slow,
        ),
    ],
    ids=["while gmsh works", "ended while gmsh works", "while the modes are solved"],
)  # fmt: skip
def test_an_interrupt_exits_130_or_143_and_leaves_no_half_product(
    tmp_path: Path, words: list[str], sign: str, absent: str, number: signal.Signals
) -> None:
    write_box(tmp_path / "box")
    process = start(tmp_path, *words)
    assert process.stderr is not None
    lines = []
    for line in process.stderr:
        lines.append(line)
        if sign in line:
            break
    time.sleep(0.3)
    assert process.poll() is None, "".join(lines)
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 128 + number, err
    assert "error: interrupted; what is finished is kept" in err.splitlines()[-1]
    assert "Traceback" not in err
    assert not (tmp_path / absent).exists() and not (tmp_path / (absent + ".json")).exists()
    assert not [p for p in tmp_path.rglob(".*") if p.is_file()], "temporary files are left"
    if "modes" in words:
        assert (tmp_path / "meshes/box.msh").is_file(), "the finished mesh is kept"


@POSIX
def test_a_reader_that_leaves_is_no_error(finished: Path) -> None:
    command = f"{sys.executable} -m microslip check build/box/basis.h5 | head -n 1"
    done = subprocess.run(command, shell=True, cwd=finished, env=environment(), capture_output=True, text=True)
    assert done.stderr == "" and done.stdout.startswith("ok   ")


# ---------------------------------------------------------------- the base install


BASE = f"""
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {HEAVY!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Absent())
from microslip.cli import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        (["check", "build/box/basis.h5"], 0, "checks passed"),
        pytest.param(["info", "build/box/basis.h5"], 0, "6 modes", marks=pytest.mark.slow),
        pytest.param(["info", "box"], 0, "a clamped box", marks=pytest.mark.slow),
        pytest.param(["export", "build/box/basis.h5", "--to", "mat"], 0, "basis.mat", marks=pytest.mark.slow),
        (["init", "blade"], 0, "ready"),
        (["modes", "box", "--force"], 2, "pip install 'microslip[fem]'"),
    ],
    ids=lambda w: w[0] if isinstance(w, list) else "",
)
def test_the_base_install_reads_checks_and_converts(folder: Path, words: list[str], code: int, text: str) -> None:
    """Without gmsh, meshio, scikit-fem, VTK, matplotlib, jax; what needs them names the extra."""
    done = subprocess.run(
        [sys.executable, "-c", BASE, *words], cwd=folder, env=environment(), capture_output=True, text=True
    )
    assert done.returncode == code, done.stderr
    assert text in done.stdout + done.stderr and "Traceback" not in done.stderr


def test_progress_on_a_terminal_keeps_steps_and_warnings(monkeypatch: pytest.MonkeyPatch) -> None:
    import io

    from microslip.progress import progress

    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    with progress("run box") as report:
        for text in ("meshing [a]", "warning: small [b]", "sweep", "300 of 600 frequencies", "done [c]"):
            report(text)
    shown = screen.getvalue()
    assert all(text in shown for text in ("meshing [a]", "warning: small [b]", "sweep", "done [c]", "run box"))
    assert "ok" in shown and "\x1b" in shown


def test_progress_in_a_log_shows_small_steps_only_after_silence(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    from microslip import progress

    with progress.progress("run box") as report:
        report("eigenmodes")
        report("4 of 80 vectors")
        monkeypatch.setattr(progress, "SILENCE", 0.0)
        report("8 of 80 vectors")
    shown = capsys.readouterr().err
    assert "eigenmodes" in shown and "8 of 80" in shown and "4 of 80" not in shown


def test_what_is_counted_one_by_one_says_what_is_left(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    """At the speed since the first, in which programs are compiled; other lines between do not stop the clock, and
    a run that goes on counts from where it does."""
    from microslip import progress

    clock = [0.0]
    monkeypatch.setattr(progress.time, "perf_counter", lambda: clock[0])
    monkeypatch.setattr(progress, "SILENCE", 0.0)
    with progress.progress("orbit box") as report:
        for at, text in (
            (1.0, "400 of 500 periods"), (61.0, "401 of 500 periods"), (62.0, "402 of 500 periods"),
            (62.5, "a line"), (63.0, "403 of 500 periods"), (70.0, "1 of 3 speeds"), (80.0, "2 of 3 speeds"),
        ):  # fmt: skip
            clock[0] = at
            report(text)
        clock[0] = 90.0
        report("3 of 3 speeds")
    shown = said(capsys)[1]
    assert "402 of 500 periods, about 98 s left" in shown and "403 of 500 periods, about 97 s left" in shown
    assert "401 of 500 periods\n" in shown and "2 of 3 speeds, about 10 s left" in shown
    assert "3 of 3 speeds\n" in shown


def test_a_part_is_told_with_what_is_left_of_the_whole(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    """Its steps are lines, its counts are not; a warning stands for itself."""
    from microslip import progress

    clock = [0.0]
    monkeypatch.setattr(progress.time, "perf_counter", lambda: clock[0])
    with progress.progress("modes box") as report:
        whole = progress.Whole(report, 4, "speeds")
        for part in range(4):
            whole("eigenmodes")
            whole(f"{part} of 80 vectors")
            clock[0] += 3.0
            whole.done += 1
        whole("warning: odd")
    lines = [line.split(" s  ", 1)[-1] for line in said(capsys)[1].splitlines()[1:]]
    left = ["", ", about 9 s left", ", about 6 s left", ", about 3 s left"]
    assert [*(f"{n} of 4 speeds | eigenmodes{left[n]}" for n in range(4)), "warning: odd"] == lines[:4] + lines[-1:]


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "microslip" / "durations.json"


def test_durations_of_tests_are_not_kept_with_those_of_the_user() -> None:
    from microslip import progress

    where = progress._place()
    assert where is not None and Path(__file__).parents[1] / "build" in where.parents


def test_a_run_says_what_it_will_do_and_how_long_it_took_here(
    cache: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The longest of the last ones in this folder, else of the same name in others; short ones say nothing of it."""
    from microslip import progress

    def first(title: str) -> str:
        with progress.progress(title):
            pass
        return said(capsys)[1].splitlines()[0]

    assert "modal file" in first("run box") and not cache.exists(), "it took no time"
    assert "not timed on this machine yet" in first("run box")
    for seconds in (150.0, 90.0):
        progress.keep("run box", seconds)
    assert first("run box").endswith("at most about 2 min, as before")
    (cache.parent / "box").mkdir()
    monkeypatch.chdir(cache.parent)
    elsewhere = "one of that name in another folder took 2 min"
    assert first("run box/body.toml").endswith(elsewhere) and first("run box").endswith(elsewhere)
    progress.keep("run box", 30.0)
    assert first("run box").endswith("at most about 30 s, as before")
    progress.keep("run box", 0.1)
    assert first("run box").endswith("at most about 30 s, as before"), "all was up to date"
    progress.keep("mesh box", 3.0)
    assert " s" not in first("mesh box").replace("mesh", "")
    cache.write_text("damaged")
    assert "not timed on this machine yet" in first("run box")


def ring_with_case(folder: Path) -> None:
    """A body of a sector, and a case beside it."""
    (folder / "ring").mkdir()
    (folder / "ring" / "body.toml").write_text(
        'name = "ring"\n[geometry]\nbuild = "build.py"\n[cyclic]\nsectors = 24\n'
        "[rotation]\nspeeds_rpm = [0.0, 2250.0, 4500.0]\n"
    )
    (folder / "ring" / "case.toml").write_text('body = "ring"\n[sweep]\npoints = 200\nnormal_forces = [1.0, 2.0]\n')


def test_a_time_is_said_by_how_much_is_asked_for(
    cache: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Speeds, nodal diameters, mesh, points and forces count, and how fast this machine was with others."""
    from microslip import progress
    from microslip.settings.amount import START, expected

    monkeypatch.chdir(cache.parent.parent)
    cache.parent.mkdir()
    ring_with_case(Path())
    one, many = (expected(["modes", "ring", *s]) for s in (["--set", "rotation.speeds_rpm=[0]"], []))
    assert many - START == pytest.approx(3 * (one - START)) and many > 120
    alone = expected(["modes", "ring", "--set=cyclic.nodal_diameters=[2]", "--set", "rotation.speeds_rpm=[0]"])
    assert one - START == pytest.approx(13 * (alone - START))
    Path("meshes").mkdir()
    Path("meshes/ring.msh").write_bytes(bytes(6_000_000))
    assert expected(["modes", "ring"]) - START == pytest.approx(2 * (many - START)), "twice as large as is supposed"
    respond = expected(["respond", "ring"])
    assert expected(["run", "ring"]) == pytest.approx(respond + expected(["modes", "ring"]))
    less = expected(["respond", "ring", "--set", "sweep.points=8"])
    assert less - START == pytest.approx((respond - START) * 8 / 200)
    rough = Path(__file__).parents[1] / "pipeline" / "cases" / "blade-rough.toml"
    few = [f"--set=contacts.{i}.points=[12,2]" for i in range(2)]
    whole = expected(["respond", str(rough)])
    assert 250 < whole < 1000, "490 s of one core"
    assert expected(["respond", str(rough), *few]) < whole / 4
    assert expected(["respond", str(rough), "--set=mode='book'"]) < whole / 4, "its tables are read"
    with pytest.raises(UserError, match="there is no body or case here or of this name"):
        expected(["run", "nonesuch"])

    assert many == pytest.approx(209, abs=1), "which is what the next lines say"
    first = "not timed on this machine yet, such runs take 104 s to 7 min"
    assert progress.planned("modes ring", many).endswith(first)
    progress.keep("modes other", 60.0, 20.0)  # a slow machine
    slow = "5 min to 21 min, by others on this machine"
    assert progress.planned("modes ring", many).endswith(slow)
    progress.keep("respond ring", 80.0, 10.0)
    assert progress.planned("respond ring", 10.0).endswith("at most about 80 s, as before")
    assert progress.planned("respond ring", 5.0).endswith("at most about 40 s, by what it took for another amount")
    assert progress.planned("modes ring", many).endswith(slow), "those of the same verb tell most"


def test_nothing_is_promised_of_what_is_not_there(
    cache: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from microslip import progress
    from microslip.settings.amount import expected

    monkeypatch.setattr(progress, "LOADING", 0.01)
    blade = str(Path(__file__).parents[1] / "geometry" / "blade")
    for words, said_first in ((["run", "nonesuch"], False), (["mesh", "nonesuch"], False), (["mesh", blade], True)):
        with progress.announced(words, expected):
            time.sleep(0.3)
        assert bool(said(capsys)[1]) == said_first


def test_what_will_be_done_is_said_before_what_does_it_is_loaded(
    cache: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from microslip import progress

    monkeypatch.setattr(progress, "LOADING", 0.01)
    with progress.announced(["run", "box", "--force"]):
        time.sleep(0.2)
        before = said(capsys)[1]
        with progress.progress("run ./box/body.toml"):
            pass
        assert before.startswith("run box: mesh, modal file") and not said(capsys)[1]
    for words, plan in (([], "every point of the sweep"), (["--over=load"], "what [curve]")):
        with progress.announced(["respond", "box", *words]):
            time.sleep(0.2)
        assert said(capsys)[1].startswith(f"respond box: {plan}")
    for words in (["run", "box", "-q"], ["run"], ["init", "box"]):
        with progress.announced(words):
            time.sleep(0.05)
        assert not said(capsys)[1]


def test_a_silent_step_is_told_again_and_counts_come_to_their_end(
    cache: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from microslip import progress

    monkeypatch.setattr(progress, "BEAT", 0.05)
    with progress.progress("run box") as report:
        report("a long step")
        time.sleep(0.3)
    assert "still at it: a long step" in said(capsys)[1]
    monkeypatch.setattr(progress, "BEAT", 1e3)
    with progress.progress("run box") as report:
        monkeypatch.setattr(progress, "SILENCE", 0.0)
        for text in ("27 of 400 points", "3 of 8 steps"):
            report(text)
        monkeypatch.setattr(progress, "SILENCE", 1e3)
        report("8 of 8 steps")
        report("pictures")
        report("5 of 9 pictures")
    lines = [line.split("s  ", 1)[-1].split(", about")[0] for line in said(capsys)[1].splitlines()[1:]]
    assert lines == ["27 of 400 points", "27 of 400 points; ended there", "3 of 8 steps", "8 of 8 steps", "pictures"]


@pytest.mark.parametrize("encoding, shown", [("utf-8", "2 µm ✓"), ("ascii", "2 um ?"), ("latin-1", "2 µm ?")])
def test_a_terminal_that_cannot_show_a_letter_shows_another(
    monkeypatch: pytest.MonkeyPatch, encoding: str, shown: str
) -> None:
    import io

    from microslip.cli import _plain_where_needed

    bytes_ = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(bytes_, encoding=encoding))
    _plain_where_needed()
    print("2 µm ✓", end="", flush=True)
    assert bytes_.getvalue().decode(encoding) == shown


def test_every_verb_is_documented() -> None:
    for verb in app:
        if not verb.startswith("-"):
            assert app[verb].help
