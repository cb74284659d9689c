"""Set-up, packaging and the Makefile: what a stranger's machine meets first. Nothing here needs the network."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
LIBRARIES = "libglu1-mesa libgl1 libxcursor1 libxft2 libxinerama1 libgomp1 libegl1"
POSIX = pytest.mark.skipif(os.name != "posix", reason="setup.sh is for POSIX shells")

# ---------------------------------------------------------------- setup.sh on made-up machines

TOOLS = "sh cat cksum id grep mkdir dirname rm tail pwd ln cp chmod env printf".split()

PYTHON = """#!/bin/sh
# a stand-in: answers what setup.sh asks, makes an environment of itself, notes what pip is told
case "$*" in
    *"version_info < (3, 11)"*) [ "{version}" != 3.9 ] ;;
    *"sys.prefix == sys.base_prefix"*) case "$0" in *.venv/*) ;; *) exit 1 ;; esac ;;
    -V) echo "Python {version}" ;;
    *"import venv, ensurepip"*) [ "{venv}" = yes ] ;;
    "-m venv "*) mkdir -p "$3/bin" && cp "$0" "$3/bin/python" ;;
    "-m pip -V") ;;
    "-m pip "*) echo "$*" >>"$LOG"; [ ! -e "$NO_NETWORK" ] ;;
    *"import gmsh"*) [ "{gmsh}" = yes ] || {{ echo "OSError: libGLU.so.1: cannot open" >&2; exit 1; }} ;;
    *can_draw*) [ "{vtk}" = yes ] ;;
    *) exit 9 ;;
esac
"""


class Machine:
    """A folder with a checkout and a PATH that holds only what the machine is said to have."""

    def __init__(self, folder: Path, **python: str) -> None:
        self.checkout, self.path, self.log = folder / "check out", folder / "path", folder / "log"
        for place in (self.checkout / "pipeline", self.path):
            place.mkdir(parents=True)
        for name in ("requirements.lock", "pyproject.toml", "pipeline/setup.sh"):
            shutil.copy(ROOT / name, self.checkout / name)
        for tool in TOOLS:
            if found := shutil.which(tool):
                (self.path / tool).symlink_to(found)
        self.home = folder / "home"
        self.home.mkdir()
        self.has("id", "#!/bin/sh\necho 1000\n")
        if python is not None and python.get("version") != "none":
            self.has_python(**python)

    def has(self, name: str, script: str) -> None:
        (self.path / name).unlink(missing_ok=True)
        (self.path / name).write_text(script)
        (self.path / name).chmod(0o755)

    def has_python(self, version: str = "3.12", venv: str = "yes", gmsh: str = "yes", vtk: str = "yes") -> None:
        self.has("python3", PYTHON.format(version=version, venv=venv, gmsh=gmsh, vtk=vtk))

    def has_apt(self, installed: str = "") -> None:
        self.has("apt-get", '#!/bin/sh\necho "apt-get $*" >>"$LOG"\n')
        query = f'for p; do :; done\ncase " {installed} " in *" $p "*) echo installed ;; *) exit 1 ;; esac\n'
        self.has("dpkg-query", f"#!/bin/sh\n{query}")

    def set_up(self, **more: str) -> tuple[int, str]:
        """Run setup.sh; returns its exit code and what it said."""
        environment = {"PATH": str(self.path), "HOME": str(self.home), "LOG": str(self.log), "NO_NETWORK": "", **more}
        done = subprocess.run(
            ["sh", "pipeline/setup.sh"], cwd=self.checkout, env=environment, capture_output=True, text=True, timeout=60
        )
        assert done.stdout == ""
        return done.returncode, done.stderr

    def done(self) -> list[str]:
        """What pip and apt were told since the last call."""
        lines = self.log.read_text().splitlines() if self.log.exists() else []
        self.log.unlink(missing_ok=True)
        return lines


@POSIX
def test_setup_of_a_complete_machine_installs_the_lock_once(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    code, text = machine.set_up()
    assert code == 0 and text.count("\n") == 1 and "packages into .venv" in text
    told = machine.done()
    assert len(told) == 2 and "-r requirements.lock" in told[0] and told[1].endswith("--no-deps -e .")
    assert (machine.checkout / ".venv/.ready").read_text().strip() == str(machine.checkout)
    assert machine.set_up() == (0, "") and machine.done() == [], "nothing is done twice"


@POSIX
def test_a_changed_lock_updates_and_a_moved_checkout_is_set_up_again(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    machine.set_up()
    (machine.checkout / ".venv" / "kept").touch()
    with open(machine.checkout / "requirements.lock", "a") as file:
        file.write("# changed\n")
    machine.done()
    assert machine.set_up()[0] == 0 and len(machine.done()) == 2
    assert (machine.checkout / ".venv" / "kept").exists(), "updated in place"
    machine.checkout = machine.checkout.rename(tmp_path / "elsewhere")
    assert machine.set_up()[0] == 0 and len(machine.done()) == 2
    assert (machine.checkout / ".venv/.ready").read_text().strip() == str(machine.checkout)


@POSIX
def test_a_half_made_environment_is_made_anew(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    (tmp_path / "cut").touch()
    code, text = machine.set_up(NO_NETWORK=str(tmp_path / "cut"))
    assert code == 2 and "could not be installed" in text and "network" in text
    (machine.checkout / ".venv" / "half").touch()
    machine.done()
    assert machine.set_up()[0] == 0 and len(machine.done()) == 2
    assert not (machine.checkout / ".venv" / "half").exists()
    (machine.checkout / ".venv/bin/python").unlink()  # as when the system's Python was upgraded
    assert machine.set_up()[0] == 0 and len(machine.done()) == 2


@POSIX
def test_an_environment_that_is_the_systems_own_is_not_installed_into(tmp_path: Path) -> None:
    """A link to the system's Python without the rest of an environment would install into the system."""
    machine = Machine(tmp_path)
    machine.set_up()
    system = (machine.path / "python3").read_text().replace("*.venv/*) ;;", "*/never/*) ;;")
    (machine.checkout / ".venv/bin/python").write_text(system)
    machine.done()
    assert machine.set_up()[0] == 0
    assert "*.venv/*) ;;" in (machine.checkout / ".venv/bin/python").read_text(), "made anew"


@POSIX
@pytest.mark.parametrize(("version", "found"), [("3.9", "Python 3.9 was found"), ("none", "no Python was found")])
def test_an_old_python_gives_one_sentence(tmp_path: Path, version: str, found: str) -> None:
    code, text = Machine(tmp_path, version=version).set_up()
    assert code == 2 and text.count("\n") == 1
    assert text.startswith("Python 3.11 or newer is needed") and found in text and "uv" in text


@POSIX
def test_a_newer_python_of_another_name_is_found(tmp_path: Path) -> None:
    machine = Machine(tmp_path, version="3.9")
    machine.has("python3.12", PYTHON.format(version="3.12", venv="yes", gmsh="yes", vtk="yes"))
    assert machine.set_up()[0] == 0
    machine = Machine(tmp_path / "b", version="3.9")
    machine.has("own-python", PYTHON.format(version="3.14", venv="yes", gmsh="yes", vtk="yes"))
    assert machine.set_up(PYTHON3=str(machine.path / "own-python"))[0] == 0


@POSIX
def test_without_rights_the_line_to_type_is_printed_once_for_everything(tmp_path: Path) -> None:
    machine = Machine(tmp_path, version="none")
    machine.has_apt()
    code, text = machine.set_up()
    line = "sudo apt-get update && sudo apt-get install -y --no-install-recommends"
    assert code == 2 and f"    {line} python3 python3-venv {LIBRARIES}\n" in text
    machine.has_python(venv="no", gmsh="no")
    machine.has_apt("python3 libgl1")
    code, text = machine.set_up()
    assert code == 2 and f"    {line} python3-venv {LIBRARIES.replace('libgl1 ', '')}\n" in text
    machine.has_python(gmsh="no")
    code, text = machine.set_up()
    assert code == 2 and f"{line} {LIBRARIES.replace('libgl1 ', '')}\n" in text
    machine.done()
    machine.has_python()
    shutil.copy(machine.path / "python3", machine.checkout / ".venv/bin/python")  # the libraries are there now
    assert machine.set_up() == (0, "") and machine.done() == [], "the packages need not be installed again"


@POSIX
def test_the_administrators_apt_installs_what_is_missing(tmp_path: Path) -> None:
    machine = Machine(tmp_path, gmsh="no")
    machine.has_apt("libgl1")
    machine.has("id", "#!/bin/sh\necho 0\n")
    code, text = machine.set_up()
    asked = [line for line in machine.done() if line.startswith("apt-get install")]
    assert asked == [f"apt-get install -y -qq --no-install-recommends {LIBRARIES.replace('libgl1 ', '')}"]
    assert code == 2 and "gmsh does not start" in text and "libGLU.so.1" in text, "and says so if that did not help"
    machine.has("apt-get", "#!/bin/sh\necho 'E: Unable to locate package'\nexit 100\n")
    code, text = machine.set_up()
    assert code == 2 and "Unable to locate" in text and "could not install" in text


@POSIX
def test_other_systems_hear_what_gmsh_lacks_and_do_without_pictures(tmp_path: Path) -> None:
    code, text = Machine(tmp_path / "a", gmsh="no").set_up()
    assert code == 2 and "libGLU.so.1" in text
    code, text = Machine(tmp_path / "b", vtk="no").set_up()
    assert code == 0 and "warning: PyVista cannot draw" in text


@POSIX
@pytest.mark.parametrize("home", ["a file/home", ""])
def test_no_home_is_needed(tmp_path: Path, home: str) -> None:
    (tmp_path / "a file").touch()
    home = home and str(tmp_path / home)
    machine = Machine(tmp_path)
    script = (machine.path / "python3").read_text()
    machine.has("python3", script.replace('echo "$*" >>"$LOG"', 'echo "$* cache=$PIP_NO_CACHE_DIR" >>"$LOG"'))
    assert machine.set_up(HOME=home)[0] == 0
    assert machine.done()[0].endswith("cache=1")
    machine = Machine(tmp_path / "b")
    machine.has("python3", script.replace('echo "$*" >>"$LOG"', 'echo "$* cache=$PIP_NO_CACHE_DIR" >>"$LOG"'))
    assert machine.set_up()[0] == 0 and machine.done()[0].endswith("cache=")


@POSIX
def test_uv_is_used_where_it_is(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    make = 'mkdir -p .venv/bin; cp "$(command -v python3)" .venv/bin/python'
    machine.has("uv", f'#!/bin/sh\necho "uv $*" >>"$LOG"\nif [ "$1" = venv ]; then {make}; fi\n')
    assert machine.set_up()[0] == 0
    told = machine.done()
    assert [t.split()[:3] for t in told] == [["uv", "venv", "-q"], ["uv", "pip", "install"], ["uv", "pip", "install"]]
    assert machine.set_up() == (0, "") and machine.done() == []


# ---------------------------------------------------------------- the lock, the libraries


def test_the_lock_holds_every_dependency_at_an_allowed_version() -> None:
    locked: dict[str, list[str]] = {}
    for line in (ROOT / "requirements.lock").read_text().splitlines():
        if match := re.match(r"([A-Za-z0-9_.-]+)==([^ ;]+)", line):
            locked.setdefault(match[1].lower().replace("_", "-"), []).append(match[2])
    project = PROJECT["project"]
    extras = {k: e for k, e in project["optional-dependencies"].items() if k not in ("all", "profile")}
    asked = project["dependencies"] + [r for e in extras.values() for r in e]
    asked += [r for group in PROJECT["dependency-groups"].values() for r in group]
    for requirement in map(Requirement, asked):
        versions = locked.get(requirement.name.lower())
        assert versions, f"{requirement.name} is not in requirements.lock"
        assert all(requirement.specifier.contains(v) for v in versions), f"{requirement} but locked {versions}"


def test_the_system_libraries_are_the_same_everywhere() -> None:
    from microslip import pictures
    from microslip.stages import meshing

    assert f'LIBRARIES="{LIBRARIES}"' in (ROOT / "pipeline/setup.sh").read_text()
    assert pictures.PACKAGES == tuple(LIBRARIES.split())
    assert LIBRARIES in Path(meshing.__file__).read_text()


# ---------------------------------------------------------------- packages


def build(target: str, folder: Path, source: Path = ROOT) -> Path:
    command = [sys.executable, "-m", "hatchling", "build", "-t", target, "-d", str(folder)]
    subprocess.run(command, cwd=source, check=True, capture_output=True)
    (made,) = folder.iterdir()
    return made


def test_the_wheel_holds_the_package_and_the_bodies_and_nothing_else(tmp_path: Path) -> None:
    names = zipfile.ZipFile(build("wheel", tmp_path)).namelist()
    assert {n.split("/")[0].split("-")[0] for n in names} == {"microslip"}
    assert len({n.split("/")[0] for n in names}) == 2, "the package and its dist-info: no pipeline, no geometry"
    for body in ("blade", "shroud", "pendulum", "half-pipe"):
        assert {f"microslip/bodies/{body}/body.toml", f"microslip/bodies/{body}/build.py"} <= set(names)
    assert {"microslip/cases/blade.toml", "microslip/py.typed", "microslip/cad/__main__.py"} <= set(names)
    assert "microslip/exchange/fmu/body.c" in names
    assert {f"microslip/report/templates/{n}" for n in ("page.html", "pieces.html", "style.css")} <= set(names)
    assert [n for n in names if n.endswith((".msh", ".h5", ".pyc"))] == ["microslip/samples/basis.h5"]


@pytest.mark.slow
def test_the_wheel_offers_its_bodies_and_meshes_them(tmp_path: Path) -> None:
    zipfile.ZipFile(build("wheel", tmp_path / "dist")).extractall(tmp_path / "site")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "site")}

    def type_(*words: str) -> str:
        command = [sys.executable, "-m", "microslip", *words]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert "ready" in type_("init", "blade", "mine")
    assert {"body.toml", "build.py", "case.toml"} <= {p.name for p in (tmp_path / "mine").iterdir()}
    assert "case mine/case.toml" in type_("info", "mine")
    type_("init", "pendulum")
    coarse = ("--set", "mesh.size=20", "--set", "mesh.local.contact_tip=10", "--set", "mesh.local.contact_disc=10")
    assert "contact_tip" in type_("mesh", "pendulum", *coarse)


@pytest.mark.slow
def test_the_source_archive_makes_the_same_wheel(tmp_path: Path) -> None:
    with tarfile.open(build("sdist", tmp_path / "sdist")) as archive:
        archive.extractall(tmp_path, **({"filter": "data"} if hasattr(tarfile, "data_filter") else {}))
    (folder,) = tmp_path.glob("microslip-*")
    for name in ("Makefile", "requirements.lock", "pipeline/setup.sh", "LICENSE", "tests/test_setup.py"):
        assert (folder / name).is_file(), name
    from_archive = zipfile.ZipFile(build("wheel", tmp_path / "a", folder)).namelist()
    assert sorted(from_archive) == sorted(zipfile.ZipFile(build("wheel", tmp_path / "b")).namelist())


# ---------------------------------------------------------------- the Makefile


def make(*words: str, folder: Path = ROOT) -> str:
    environment = {k: v for k, v in os.environ.items() if not k.startswith("MAKE")}
    done = subprocess.run(["make", *words], cwd=folder, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_help_lists_every_target() -> None:
    text = make("help")
    targets = re.findall(r"^([a-z-]+):(?!=)", (ROOT / "Makefile").read_text(), re.M)
    assert {"setup", "all", "test", "test-all", "lint", "docs", "bench", "clean"} <= set(targets)
    for target in (*targets, "blade", "shroud", "pendulum", "half-pipe", "blade-mesh", "blade-modes"):
        assert target in text


@pytest.mark.slow
def test_a_run_of_tests_that_loses_a_worker_fails(tmp_path: Path) -> None:
    """By a native fault, which takes the worker with it: with another in its place the run waited for ever."""
    pytest.importorskip("xdist")
    crash = "import os\ndef test_a(): pass\ndef test_b(): os.abort()\ndef test_c(): pass\n"
    wait = "import time, pytest\n@pytest.mark.parametrize('n', range(3))\ndef test(n): time.sleep(0.3)\n"
    for name, text in {"a": crash, **dict.fromkeys("bcdef", wait)}.items():
        (tmp_path / f"test_{name}.py").write_text(text)
    (words,) = re.findall(r"^PYTEST +:= \$\(PYTHON\) (.*)$", (ROOT / "Makefile").read_text(), re.M)
    command = [sys.executable, *words.split(), "-p", "no:cacheprovider"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 1 and "crashed while running 'test_a.py::test_b'" in done.stdout


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bare clone: what make would do is asked there, whatever has been built in this checkout."""
    folder = tmp_path_factory.mktemp("make") / "clone"
    for name in ("geometry", "pipeline"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("Makefile", "requirements.lock", "pyproject.toml"):
        shutil.copy(ROOT / name, folder / name)
    return folder


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_make_of_a_body_is_set_up_then_run(clone: Path) -> None:
    """On a bare clone, from the two commands of the README."""
    for target, verb in (("blade", "run"), ("blade-mesh", "mesh"), ("blade-modes", "modes")):
        steps = make("-n", target, folder=clone).splitlines()
        assert [s.split()[-2:] for s in steps] == [["sh", "pipeline/setup.sh"], [verb, "geometry/blade"]]
    assert "setup.sh" in make("-n", "test", folder=clone).splitlines()[0]
    for target in ("test-all", "lint", "docs", "bench", "clean", "all", "half-pipe", "pendulum-mesh"):
        make("-n", target, folder=clone)


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_make_leaves_it_to_the_stages_whether_a_product_is_there(clone: Path, tmp_path: Path) -> None:
    """Of a body whose page is newer than all it was made from, a table may be missing."""
    folder = shutil.copytree(clone, tmp_path / "clone")
    for name in (".venv/.ready", "meshes/blade.msh", "build/blade/basis.h5", "build/blade/report.html"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(str(folder.resolve()))
    steps = make("-n", "blade", folder=folder).splitlines()
    assert [s.split()[-2:] for s in steps] == [["run", "geometry/blade"]]


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_make_of_a_case_runs_its_file_and_one_of_a_body_is_run_with_the_body(clone: Path) -> None:
    """Every file of pipeline/cases has a target of its own name, is listed by help, and says that name itself."""
    text = make("help").split("cases:        ")[1].splitlines()[0].split("   ")[0].split()
    cases = {p.stem: p for p in (ROOT / "pipeline/cases").glob("*.toml")}
    bodies = {p.parent.name for p in (ROOT / "geometry").glob("*/body.toml")}
    assert set(text) == set(cases) - bodies
    for name, path in cases.items():
        assert tomllib.loads(path.read_text())["name"] == name
        step = ["run", f"geometry/{name}"] if name in bodies else ["run", f"pipeline/cases/{name}.toml"]
        assert make("-n", name, folder=clone).splitlines()[-1].split()[-2:] == step


# ---------------------------------------------------------------- .ci/run and the programs that exports are for


def continuous_integration(folder: Path, *fails: str, **environment: str) -> tuple[int, list[str], str]:
    """Exit code, the targets asked for, and the words of .ci/run where make and apt-get are stand-ins."""
    (folder / ".ci").mkdir(parents=True)
    shutil.copy(ROOT / ".ci" / "run", folder / ".ci" / "run")
    path, log = folder / "path", folder / "log"
    path.mkdir()
    for tool in ("bash", "env", "id", "dirname"):
        (path / tool).symlink_to(str(shutil.which(tool)))
    failing = "|".join(map(shlex.quote, fails or ("nothing",)))
    scripts = {
        "make": f'echo "$MICROSLIP_PEERS $*" >>"{log}"\ncase "$*" in {failing}) exit 2 ;; esac',
        "apt-get": f'case "$1" in {failing}) exit 100 ;; esac',
    }
    for name, text in scripts.items():
        (path / name).write_text(f"#!/bin/sh\n{text}\n")
        (path / name).chmod(0o755)
    (path / "id").unlink()
    (path / "id").write_text("#!/bin/sh\necho 0\n")
    (path / "id").chmod(0o755)
    done = subprocess.run(
        [str(folder / ".ci" / "run")], capture_output=True, text=True, timeout=60,
        env={"PATH": str(path), **environment},
    )  # fmt: skip
    return done.returncode, log.read_text().splitlines() if log.exists() else [], done.stdout + done.stderr


@POSIX
def test_ci_stops_where_a_step_or_a_peer_fails(tmp_path: Path) -> None:
    steps = ["setup", "peers", "-j2 -O blade shroud lint", "test", "test-slow"]  # the second beside the third

    def ordered(asked: list[str], how: str = "required") -> list[str]:
        return sorted((a.removeprefix(f"{how} ") for a in asked), key=steps.index)

    code, asked, said = continuous_integration(tmp_path / "whole")
    assert (code, ordered(asked)) == (0, steps) and "required test-slow" == asked[-1], said
    for number, failing in enumerate(steps):
        code, asked, said = continuous_integration(tmp_path / str(number), failing)
        assert code != 0 and failing in ordered(asked) and set(ordered(asked)) <= {*steps[: max(3, number + 1)]}, said
        assert number != 0 or asked == ["required setup"]
    code, asked, said = continuous_integration(tmp_path / "no-apt", "install")
    assert code != 0 and not asked and "apt-get install calculix-ccx octave" in said
    code, asked, said = continuous_integration(tmp_path / "asked", "peers", "install", MICROSLIP_PEERS="optional")
    assert (code, ordered(asked, "optional")) == (0, steps), said


@pytest.mark.parametrize(("required", "code"), [("required", 1), ("optional", 0)])
def test_a_skip_for_want_of_a_program_fails_where_it_is_required(required: str, code: int, tmp_path: Path) -> None:
    for name in ("conftest.py", "durations.py", "families.py"):
        shutil.copy(ROOT / "tests" / name, tmp_path / name)
    (tmp_path / "test_a.py").write_text(
        "import pytest\n"
        "@pytest.mark.skipif(True, reason='Octave is not installed')\ndef test_a(): pass\n"
        "def test_b(): pytest.importorskip('no_such_package')\n"
        "@pytest.mark.skipif(True, reason='signals of POSIX systems')\ndef test_c(): pass\n"
    )
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", ".", "test_a.py"]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=60,
        env={**os.environ, "MICROSLIP_PEERS": required},
    )  # fmt: skip
    assert done.returncode == code, done.stdout + done.stderr
    if required == "required":
        assert "1 skipped" in done.stdout and "Octave is not installed" in done.stdout
        assert "no_such_package" in done.stdout
