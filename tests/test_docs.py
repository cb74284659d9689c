"""The pages of docs/: examples run, links lead somewhere, made tables are current, a number of each page is right."""

from __future__ import annotations

import ast
import doctest
import importlib
import inspect
import re
import shlex
import shutil
import sys
import tomllib
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from small import basis as small_basis

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))

import pages  # noqa: E402

import microslip  # noqa: E402
from microslip.basis import read_basis  # noqa: E402
from microslip.cli import main  # noqa: E402
from microslip.stages.job import open_job  # noqa: E402
from microslip.stages.modal import modes_stage  # noqa: E402

OF_ALL = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")]
PAGES = sorted([*DOCS.glob("*.md"), *DOCS.glob("tutorials/*.md"), *OF_ALL])
PACKAGE = ROOT / "pipeline" / "microslip"
LONG = {"your_own_model.md"}
"""Pages that are not yet short."""


def rows(page: str, name: str) -> list[list[str]]:
    """Cells of a made table, without its head."""
    return [[c.strip() for c in line.strip("|").split("|")] for line in pages.filled(page, name).splitlines()[2:]]


def number(text: str) -> float:
    """The first number of a cell."""
    found = re.search(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", text)
    assert found, text
    return float(found[0])


def made(tmp_path: Path, body: str, *changes: str):
    """A modal file made now, in a folder of its own."""
    light = ["output.gauss=false", "output.nodal_stress=false", "output.shapes=false"]
    return read_basis(modes_stage(open_job(ROOT / "geometry" / body, [*light, *changes], tmp_path))[0])


# links, tables, words ----------------------------------------------------------------------------------------------


def anchors(text: str) -> set[str]:
    """GitHub's anchors of a page's headings."""
    heads = re.findall(r"^#+ (.*)$", re.sub(r"```.*?```", "", text, flags=re.S), flags=re.M)
    return {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in heads}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"```.*?```", "", text, flags=re.S)):
        if target.startswith("http"):
            continue
        name, _, anchor = target.partition("#")
        file = (page.parent / name).resolve() if name else page
        assert file.exists(), f"{page.name}: {target}"
        if anchor and file.suffix == ".md":
            assert anchor in anchors(file.read_text(encoding="utf-8")), f"{page.name}: {target}"


def test_every_picture_is_shown_and_small() -> None:
    """No picture without a page; less than 300 kB each and 3.4 MB together."""
    link = re.compile(r"\(\S*pictures/([\w-]+\.(?:png|gif))\)")
    shown = {name for page in PAGES for name in link.findall(page.read_text(encoding="utf-8"))}
    files = list((DOCS / "pictures").glob("*"))
    assert {f.name for f in files} == shown
    assert max(f.stat().st_size for f in files) < 300_000 and sum(f.stat().st_size for f in files) < 3_400_000


def test_references_of_files_are_current() -> None:
    """`python docs/make_pictures.py reference` would change nothing."""
    for name, (page, _) in pages.FILES.items():
        assert pages.filled(page, name) == pages.file_reference(name).strip()
    assert pages.filled("python.md", "public") == pages.public_reference().strip()
    assert pages.filled("modal_file.md", "modal_file") == pages.modal_reference().strip()
    assert pages.filled("the_book.md", "wall") == pages.wall().strip()
    assert pages.filled("the_book.md", "figures") == pages.figure_states().strip()


def test_a_figure_of_the_wall_has_the_state_of_its_row() -> None:
    """Of ranges too, and only of rows that have it."""
    assert pages.state_of("1.1-3")[1] == "not reproducible"
    assert pages.state_of("4.2-2") == pages.state_of("4.2-1") != pages.state_of("4.2-3")
    with pytest.raises(LookupError):
        pages.state_of("5.5-10")


def paragraphs(page: Path) -> list[str]:
    """Those of prose: no code, tables, lists, pictures."""
    blocks = re.compile(r"<!-- table .*?<!-- end -->|^(`{3,}|:{3,}).*?^\1", flags=re.S | re.M)
    text = blocks.sub("", page.read_text(encoding="utf-8"))
    parts = [part.strip("\n") for part in re.split(r"\n\s*\n|\n(?=- |\d\. )", text)]
    return [part for part in parts if not part.startswith(("|", "    ", "![", "#"))]


@pytest.mark.parametrize("page", [p for p in PAGES if p.name not in LONG], ids=lambda p: p.name)
def test_no_paragraph_is_longer_than_600_characters(page: Path) -> None:
    long = [part for part in paragraphs(page) if len(part) > 600]
    assert not long, long[0]


@pytest.mark.parametrize("model", [model for _, model in pages.FILES.values()])
def test_every_key_says_what_it_means(model: type) -> None:
    """Or at least its unit, in the text below it."""
    assert not pages.silent(model)


def test_a_public_name_is_no_package_of_the_same_name() -> None:
    """An attribute that an import of a package sets comes before a name that is loaded when it is used."""
    rooms = {p.stem for p in PACKAGE.iterdir() if p.suffix == ".py" or (p / "__init__.py").is_file()}
    assert not rooms & set(microslip.__all__)
    assert all(inspect.getdoc(getattr(microslip, name)) for name in microslip.__all__)


def test_examples_of_the_public_names() -> None:
    """Those in their docstrings."""
    for module in microslip.PUBLIC:
        done = doctest.testmod(importlib.import_module(f"microslip.{module}"))
        assert not done.failed, module


def test_python_blocks_are_python() -> None:
    for page in PAGES:
        for block in re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.S):
            ast.parse(block)


# architecture ------------------------------------------------------------------------------------------------------


def test_ways_into_the_package_lead_somewhere() -> None:
    """Files that "Where to begin" names are there, and what it names of them stands in them."""
    text = (DOCS / "architecture.md").read_text(encoding="utf-8").split("## Where to begin", 1)[1].split("\n## ", 1)[0]
    named = re.findall(r"`([\w/]+\.py)`(?: \(`(\w+))?", text)
    assert len(named) > 15
    for file, name in named:
        code = (PACKAGE / file).read_text(encoding="utf-8")
        assert not name or re.search(rf"^(def|class) {name}\b", code, re.M), file


def room_order() -> list[str]:
    """Rooms of docs/architecture.md, first to last."""
    text = (DOCS / "architecture.md").read_text(encoding="utf-8")
    table = text.split("## Rooms", 1)[1].split("\n## ", 1)[0]
    return [m.removesuffix("/").removesuffix(".py") for m in re.findall(r"^\| `([^`]+)` \|", table, flags=re.M)]


@cache
def imports(file: Path) -> list[tuple[ast.ImportFrom, bool]]:
    """What a file imports from others, at its top or inside a function, and whether types alone need it."""
    nodes = list(ast.walk(ast.parse(file.read_text(encoding="utf-8"))))
    ifs = [node for node in nodes if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)]
    typed = {inner for node in ifs for line in node.body for inner in ast.walk(line)}
    return [(node, node in typed) for node in nodes if isinstance(node, ast.ImportFrom)]


def room_imports(room: str) -> set[str]:
    """Other rooms that a room imports, at the top of a file or inside a function."""
    folder = PACKAGE / room
    found = set()
    for file in sorted(folder.rglob("*.py")) if folder.is_dir() else [PACKAGE / f"{room}.py"]:
        package = ["microslip", *file.relative_to(PACKAGE).parts[:-1]]
        for node, _ in imports(file):
            base = package[: len(package) - node.level + 1] if node.level else []
            names = [[*base, *(node.module or "").split(".")]] if node.module else [[*base, a.name] for a in node.names]
            found |= {n[1] for n in names if n[0] == "microslip" and len(n) > 1}
    return (found & set(room_order())) - {room}


def test_rooms_import_only_from_rooms_above() -> None:
    order = room_order()
    exist = {p.stem for p in PACKAGE.iterdir() if p.suffix == ".py" or (p / "__init__.py").is_file()}
    assert set(order) == exist - {"__init__", "__main__"}
    for i, room in enumerate(order):
        assert room_imports(room) <= set(order[:i]), room


def needed(file: Path) -> set[Path]:
    """Files of the package that a file imports to run; what types alone need is left out."""
    found = set()
    for node, types_alone in imports(file):
        if node.level and not types_alone:
            place = file.parents[node.level - 1].joinpath(*(node.module or "").split("."))
            found |= {p.with_suffix(".py") for p in (place, *(place / a.name for a in node.names))}
    return {f for f in found if f.is_file()} - {file}


def test_no_files_import_each_other() -> None:
    """Not even by a way round: what a file imports can be read before it."""
    left = {f: needed(f) for f in PACKAGE.rglob("*.py")}
    while ends := {f for f, others in left.items() if not others & left.keys()}:
        left = {f: others for f, others in left.items() if f not in ends}
    assert not left, sorted(str(f.relative_to(PACKAGE)) for f in left)


def test_gmsh_is_imported_only_where_the_page_says() -> None:
    for file in [*PACKAGE.rglob("*.py"), *(ROOT / "geometry").rglob("*.py")]:
        text = file.read_text(encoding="utf-8")
        nodes = ast.walk(ast.parse(text)) if "import gmsh" in text else ()
        names = {a.name for n in nodes if isinstance(n, ast.Import) for a in n.names}
        assert "gmsh" not in names or "cad" in file.parts or file.name == "build.py", file


# conventions, errata -----------------------------------------------------------------------------------------------


def test_interface_frame_is_the_one_of_the_page() -> None:
    """n outward, t1 = t2 x n; with t2 = z the right side has (x, y, z), the left one (-x, -y, z)."""
    faces = small_basis().groups[0, 0].interfaces
    np.testing.assert_allclose(faces["right"].rotation, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(faces["left"].rotation, np.diag([-1.0, -1.0, 1.0]), atol=1e-12)


def test_gyroscopic_matrix_has_the_sign_of_the_page() -> None:
    """G_r = phi^T 2 Omega (n x) M phi, n = y: a velocity along z meets +2 Omega m on x."""
    group = small_basis((0.0, 3000.0)).groups[1, 0]
    np.testing.assert_allclose(group.G_r, -group.G_r.T, atol=1e-9 * np.abs(group.G_r).max())
    cross = np.array([[0, 0, 1], [0, 0, 0], [-1, 0, 0.0]])  # y x
    lumped = 2 * group.speed * np.einsum("nia,ij,njb->ab", group.phi, cross, group.phi)  # equal masses: the sign only
    assert (lumped * group.G_r).sum() > 0.5 * np.linalg.norm(lumped) * np.linalg.norm(group.G_r)


def test_loss_of_the_jenkins_element_in_the_errata() -> None:
    """The closed form quoted there against the integral of force over displacement."""
    from closed_forms.one_harmonic import jenkins_harmonic

    c, limit, amplitude = 3.0, 2.0, 1.9
    x = c * amplitude / limit
    value = complex(jenkins_harmonic(np.array([amplitude]), c, limit)[0][0])
    assert value.imag == pytest.approx(c * 4 * (x - 1) / (np.pi * x**2), rel=1e-12)
    loop = 4 * limit * (amplitude - limit / c)  # area of the parallelogram
    assert np.pi * value.imag * amplitude**2 == pytest.approx(loop, rel=1e-12)


# numbers of the other pages ----------------------------------------------------------------------------------------


def test_blade_page(tmp_path: Path) -> None:
    """The coarsest mesh of the convergence table, computed again."""
    group = made(tmp_path, "blade", "mesh.size=24", "modes.count=10").groups[0, 0]
    told = next(r for r in rows("blade.md", "convergence") if r[0] == "24")
    np.testing.assert_allclose(group.frequency[[0, 2, 6]], [float(v) for v in told[2:]], rtol=1e-4)


def test_blade_page_agrees_with_itself() -> None:
    """Deviations follow from the frequencies beside them; all six printed ones are met within 3.3 %."""
    for _, printed, value, deviation in rows("blade.md", "stuck"):
        assert number(deviation) == pytest.approx(100 * (float(value) / float(printed) - 1), abs=0.05)
        assert abs(number(deviation)) < 3.3
    assert all(abs(number(v)) < 0.6 for v in rows("blade.md", "convergence")[-1][2:])


@pytest.mark.slow
def test_modes_page(tmp_path: Path) -> None:
    """Prestress "none" at 4500 rpm on the coarse shroud: frequencies fall, as the table says."""
    coarse = "mesh.local={pressure_side=7, suction_side=7, contact_left=5, contact_right=5}"
    change = ["mesh.size=12", coarse, 'rotation.prestress="none"', "rotation.speeds_rpm=[0.0, 4500.0]", "modes.count=6"]
    change += ["cyclic.nodal_diameters=[0]", "closures=[]"]
    basis = made(tmp_path, "shroud", *change, "modes.certify=false")
    told = rows("modes.md", "speed")
    for i, column in ((0, 1), (1, 2)):
        np.testing.assert_allclose(basis.groups[i, 0].frequency[:6], [float(r[column]) for r in told], rtol=1e-4)


@pytest.mark.slow
def test_cyclic_page(tmp_path: Path) -> None:
    """Aliases as computed, resonances on their engine-order lines, frequencies of the free shroud at two k."""
    from microslip.ring.expansion import aliased, multiplicity

    for e, k, wave in rows("cyclic.md", "aliases"):
        assert aliased(int(e), 24) == (int(k), wave)
    for rpm, hertz, e, k, wave, *_ in rows("cyclic.md", "resonances"):
        assert float(hertz) == pytest.approx(float(rpm) * int(e) / 60, rel=2e-4)  # rpm has one decimal
        assert aliased(int(e), 24) == (int(k), wave)
    told = {int(r[0]): r for r in rows("cyclic.md", "frequencies")}
    coarse = "mesh.local={pressure_side=7, suction_side=7, contact_left=5, contact_right=5}"
    change = ["mesh.size=12", coarse, "rotation.speeds_rpm=[0.0]", "modes.count=4", "modes.certify=false"]
    basis = made(tmp_path, "shroud", *change, "cyclic.nodal_diameters=[0, 6]", "reduction=eigenmodes", "closures=[]")
    for k in (0, 6):
        assert int(told[k][1]) == multiplicity(k, 24)
        np.testing.assert_allclose(basis.groups[0, k].frequency[:3], [float(v) for v in told[k][2:5]], rtol=1e-4)


def test_bifurcation_page() -> None:
    """Deviations follow from the values beside them; all but H1 and the turning point, which hang on it, are met within
    0.2 %; at H2 a pair of eigenvalues of the linear part is on the axis."""
    from closed_forms.oscillators import belt

    told = {r[0]: r for r in rows("bifurcation.md", "belt")}
    for name, (_, _, printed, value, deviation) in told.items():
        assert number(deviation) == pytest.approx(100 * (float(value) / float(printed) - 1), abs=0.01)
        assert abs(number(deviation)) < (6.0 if name[:2] in ("H1", "T1") else 0.2)
    J = np.asarray(belt(0.2, 9.8).still(np.zeros(4), float(told["H2, Hopf point"][3]))[1])
    assert np.abs(np.linalg.eigvals(J).real).min() < 1e-5


@pytest.mark.slow
def test_contact_statics_page(tmp_path: Path) -> None:
    """Normal force of the coarse shroud at 1500 rpm without interference."""
    coarse = "mesh.local={pressure_side=7, suction_side=7, contact_left=5, contact_right=5}"
    closed = 'closures=[{name="shroud", face="contact_right", against="contact_left", sector_shift=1}]'
    few = ["rotation.speeds_rpm=[1500.0]", "modes.count=2", "cyclic.nodal_diameters=[0]"]
    basis = made(tmp_path, "shroud", "mesh.size=12", coarse, closed, *few)
    told = next(r for r in rows("contact_statics.md", "closure") if r[0] == "0")
    assert basis.groups[0, 0].contacts["shroud"].normal_force == pytest.approx(float(told[2]), rel=2e-3)


def test_contact_stiffness_page(capsys: pytest.CaptureFixture[str]) -> None:
    """Its table made again, and what its example prints."""
    import stiffness_study

    assert pages.filled("contact_stiffness.md", "layers") == pages.table(*stiffness_study.layers())
    text = (DOCS / "contact_stiffness.md").read_text(encoding="utf-8")
    for code, printed in re.findall(r"```python\n(.*?)```\n\n    (.*?)\n", text, flags=re.S):
        exec(compile(code, "contact_stiffness.md", "exec"), {})
        assert capsys.readouterr().out.strip() == printed


def test_half_space_page(capsys: pytest.CaptureFixture[str]) -> None:
    """What its example prints, and its table of worn profiles made again."""
    import half_space_study

    assert pages.filled("half_space.md", "worn_profiles") == pages.table(*half_space_study.worn_profiles())
    text = (DOCS / "half_space.md").read_text(encoding="utf-8")
    code, printed = re.findall(r"```python\n(.*?)```\n\n    (.*?)\n", text, flags=re.S)[0]
    exec(compile(code, "half_space.md", "exec"), {})
    assert capsys.readouterr().out.strip() == printed


def test_the_book_page_has_the_numbers_of_its_figure() -> None:
    """Of eight elements in Fig. 5.2-2, as its command prints them."""
    import figure_study

    force, moment = 100 * figure_study.discretisation()
    told = f"{force:.1f} % of the force, {moment:.1f} % of the moment at most, which the command prints"
    assert told in (DOCS / "book.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_contact_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Its tables made again, and what its examples print; the profile is the invented one of the table."""
    import microslip_study
    import rough_study

    assert pages.filled("contact.md", "strips") == pages.table(*microslip_study.errors())
    assert pages.filled("contact.md", "profile") == pages.table(*rough_study.numbers())
    assert pages.filled("contact.md", "worn") == pages.table(*rough_study.worn())
    profile = rough_study.ground()
    np.savetxt(tmp_path / "ground.txt", np.column_stack([1e3 * profile.x, 1e6 * profile.z]), fmt="%.6f")
    monkeypatch.chdir(tmp_path)
    text = (DOCS / "contact.md").read_text(encoding="utf-8")
    for code, printed in re.findall(r"```python\n(.*?)```\n\n    (.*?)\n", text, flags=re.S):
        exec(compile(code, "contact.md", "exec"), {})
        assert capsys.readouterr().out.strip() == printed


@pytest.mark.slow
def test_python_page(capsys: pytest.CaptureFixture[str]) -> None:
    """Every block of the page goes on from the one before, and prints what stands below it."""
    names: dict[str, object] = {}
    text = (DOCS / "python.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```\n\n((?:    [^\n]*\n)+)", text, flags=re.S)
    assert len(blocks) == text.count("```python")
    for code, printed in blocks:
        exec(compile(code, "python.md", "exec"), names)
        assert [line.strip() for line in printed.splitlines()] == capsys.readouterr().out.splitlines()


@pytest.mark.slow
def test_geometry_page(tmp_path: Path) -> None:
    """The pendulum's mass, and the reduced masses 0.092 and 5.632 kg that fix its arm."""
    basis = made(tmp_path, "pendulum", "modes.count=3")
    told = next(r for r in rows("geometry.md", "bodies") if "pendulum" in r[0])
    assert basis.mass == pytest.approx(float(told[2]), rel=1e-3)
    x, _, z = basis.centre
    about_axis = basis.inertia[1, 1] + basis.mass * (x**2 + z**2)
    assert about_axis / 0.4**2 == pytest.approx(0.092, rel=5e-3)
    assert about_axis / 0.05115**2 == pytest.approx(5.632, rel=5e-3)


def test_build_file_of_the_geometry_page(tmp_path: Path) -> None:
    """The build.py printed there draws, and its faces can be used."""
    text = (DOCS / "geometry.md").read_text(encoding="utf-8")
    (tmp_path / "build.py").write_text(re.findall(r"```python\n(.*?)```", text, flags=re.S)[0])
    (tmp_path / "body.toml").write_text(
        'name = "box"\nlength_unit = "mm"\n[geometry]\nbuild = "build.py"\n[mesh]\nsize = 20.0\n'
        "[material]\ndensity = 7850.0\nyoung = 2.1e11\npoisson = 0.3\n"
        '[[supports]]\nface = "clamp"\n[[interfaces]]\nname = "tip"\nface = "tip"\nt2 = [1, 0, 0]\n[modes]\ncount = 3\n'
    )
    assert read_basis(modes_stage(open_job(tmp_path, [], tmp_path))[0]).groups[0, 0].n_modes == 3


def test_platforms_page() -> None:
    """Its system libraries are those the set-up installs and the pictures ask for; its solvers are all there are."""
    from typing import get_args

    from microslip import pictures
    from microslip.linalg import eigen
    from microslip.settings.body import Modes

    text = (DOCS / "platforms.md").read_text(encoding="utf-8")
    line = re.search(r"apt-get install -y (lib.*)", text)
    assert line and line[1].split() == list(pictures.PACKAGES)
    assert line[1] in (ROOT / "pipeline" / "setup.sh").read_text(encoding="utf-8")
    solvers = set(get_args(Modes.model_fields["solver"].annotation))
    assert solvers == {*eigen.BACKENDS, "petsc", "auto"} and all(f'"{name}"' in text for name in solvers)


@pytest.mark.slow
@pytest.mark.usefixtures("unestimated")
def test_own_model_page(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """The three decks as the page has them: what it shows is printed, and each ends in a response. Few frequencies,
    and no motions in time where an assembly jumps."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ROOT / "meshes" / "tiny", tmp_path / "meshes" / "tiny")

    def type_in(line: str, folder: Path) -> str:
        code, said = main(shlex.split(line)[1:]), capsys.readouterr()
        assert code == 0, f"{line}\n{said.out}{said.err}"
        return f"$ {line}\n{said.out}"

    shown = pages.play("your_own_model.md", tmp_path, {"microslip run ": "--set sweep.patience=0"}, type_in)
    text = (DOCS / "your_own_model.md").read_text(encoding="utf-8")
    prose = " ".join(line for line in text.splitlines() if not line.startswith("|"))  # keywords are no prose
    assert len(prose.split()) <= 1500
    for block in re.findall(r"```text\n(.*?)```", text, flags=re.S):
        for line in block.splitlines():
            assert line in shown, line
    responses = [tmp_path / "build" / f"lap-{name}" / "response.csv" for name in ("abaqus", "ansys", "nastran")]
    assert all(len(path.read_text().splitlines()) >= 10 for path in responses)


@pytest.mark.slow
def test_rolling_page(capsys: pytest.CaptureFixture[str]) -> None:
    """What its examples print."""
    text = (DOCS / "rolling.md").read_text(encoding="utf-8")
    for code, printed in re.findall(r"```python\n(.*?)```\n\n    (.*?)\n", text, flags=re.S):
        exec(compile(code, "rolling.md", "exec"), {})
        assert capsys.readouterr().out.strip() == printed


def test_pages_on_rolling_unround_wheels_and_tyres() -> None:
    """All keys of their cases are keys."""
    from microslip.rolling.settings import RollingCase
    from microslip.rolling.tyre import TyreCase
    from microslip.vehicle.settings import KinematicsCase, VehicleCase

    blocks = [
        re.findall(r"```toml\n(.*?)```", (DOCS / page).read_text(encoding="utf-8"), flags=re.S)
        for page in ("unround_wheels.md", "tyre.md")
    ]
    first = re.findall(r"```toml\n(.*?)```", (DOCS / "rolling.md").read_text("utf-8"), flags=re.S)[0]
    RollingCase.model_validate(tomllib.loads(first))
    for block, model in zip(sum(blocks, []), (KinematicsCase, VehicleCase, TyreCase), strict=True):
        model.model_validate(tomllib.loads(block))
