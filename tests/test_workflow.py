"""The chain from body.toml to the report: only what changed is made again, and products are complete."""

from __future__ import annotations

import ast
import json
import os
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
from box import edit, write_box
from refusals import refused, refused_command

import microslip
from microslip.basis import read_basis
from microslip.case import load_case
from microslip.errors import UserError
from microslip.files import store
from microslip.settings.meant import meant
from microslip.settings.toml import load_toml
from microslip.stages import meshing, modal, places, response, running
from microslip.stages.job import Job, open_job
from microslip.stages.stage import PACKAGE, Made, Stage, _imported, folder_of_case, hash_of_code

pytestmark = pytest.mark.usefixtures("undrawn", "unjudged")

MESH, BASIS, RESPONSE = "meshes/box.msh", "build/box/basis.h5", "build/box/response.json"


def run_chain(folder: Path, assignments: list[str] | None = None) -> set[str]:
    """Run mesh, modes and response of the box in `folder`; returns which products were made."""
    made: set[str] = set()
    told: list[str] = []
    job = open_job(folder, assignments, root=folder)
    modal.modes_stage(job, report=told.append)
    assert job.case_file is not None
    response.response_stage(job.case_file, {job.settings.name: job.basis_file}, job.build_folder, report=told.append)
    begins = {"meshing": MESH, "assembling": BASIS, "friction response": RESPONSE}
    for product in (p for text in told for words, p in begins.items() if text.startswith(words)):
        made.add(product)
    return made


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory, unjudged_file: None) -> Path:
    folder = write_box(tmp_path_factory.mktemp("finished") / "box")
    assert run_chain(folder) == {MESH, BASIS, RESPONSE}
    return folder


@pytest.fixture
def box(finished: Path, tmp_path: Path) -> Path:
    """A copy of the finished chain, to change."""
    return shutil.copytree(finished, tmp_path / "box")


def test_a_second_run_makes_nothing_and_a_touch_changes_nothing(box: Path) -> None:
    before = {p: (box / p).read_bytes() for p in (MESH, BASIS, RESPONSE)}
    for name in ("body.toml", "build.py", "case.toml"):
        os.utime(box / name)
    assert run_chain(box) == set()
    assert before == {p: (box / p).read_bytes() for p in before}


def test_finished_products_are_as_new_as_what_they_were_made_from(box: Path) -> None:
    """make compares times: a stage with nothing to do must still leave its product newer than its inputs."""
    os.utime(box / "body.toml", (4e9, 4e9))
    os.utime(box / MESH, (1e9, 1e9))
    run_chain(box)
    assert (box / MESH).stat().st_mtime > 1.1e9
    assert (box / BASIS).stat().st_mtime >= (box / MESH).stat().st_mtime - 1


SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    ("name", "old", "new", "made"),
    [
        pytest.param(
            "case.toml", "normal_forces = [1.0, 100.0]", "normal_forces = [1.0, 90.0]", {RESPONSE}, marks=SLOW
        ),
        ("case.toml", "friction = 0.3", "friction = 0.31", {RESPONSE}),
        ("body.toml", "density = 7850.0", "density = 7800.0", {BASIS, RESPONSE}),
        pytest.param("body.toml", "count = 6", "count = 5", {BASIS, RESPONSE}, marks=SLOW),
        pytest.param("body.toml", "size = 20.0", "size = 10.0", {MESH, BASIS, RESPONSE}, marks=SLOW),
        pytest.param(
            "body.toml",
            "size = [20.0, 30.0, 120.0]",
            "size = [20.0, 32.0, 120.0]",
            {MESH, BASIS, RESPONSE},
            marks=SLOW,
        ),
        ("build.py", 'name_face("tip"', '# the same mesh\n    name_face("tip"', {MESH}),
        ("body.toml", "a clamped box", "a box that is clamped", set()),
        ("body.toml", "[material]", "# steel\n\n[material]", set()),
    ],
)
def test_only_what_depends_on_a_change_is_made_again(box: Path, name: str, old: str, new: str, made: set[str]) -> None:
    edit(box / name, old, new)
    assert run_chain(box) == made
    assert run_chain(box) == set()


@pytest.mark.slow
def test_an_override_counts_as_a_change_and_leaves_the_file_alone(box: Path) -> None:
    text = (box / "body.toml").read_text()
    assert run_chain(box, ["material.young=2.0e11"]) == {BASIS, RESPONSE}
    assert (box / "body.toml").read_text() == text
    assert run_chain(box) == {BASIS, RESPONSE}


@pytest.mark.parametrize(
    ("product", "spoil"),
    [
        (BASIS, lambda p: p.write_bytes(p.read_bytes()[:-1000])),
        (BASIS, lambda p: p.unlink()),
        (BASIS, lambda p: store.sidecar_path(p).unlink()),
        (BASIS, lambda p: store.sidecar_path(p).write_text("{")),
        (MESH, lambda p: p.write_text("")),
    ],
    ids=["truncated", "deleted", "without sidecar", "spoilt sidecar", "emptied mesh"],
)
def test_a_damaged_product_is_made_again_with_the_same_bytes(box: Path, product: str, spoil: object) -> None:
    good = (box / product).read_bytes()
    spoil(box / product)
    assert run_chain(box) == {product}
    assert (box / product).read_bytes() == good


def test_what_changes_between_runs_stands_in_the_sidecar_only(box: Path) -> None:
    note = json.loads(store.sidecar_path(box / BASIS).read_text())
    assert {"inputs", "product", "written"} <= set(note)
    assert note["product"] == store.hash_file(box / BASIS)
    provenance = read_basis(box / BASIS).provenance
    assert provenance["mesh_sha256"] == store.hash_file(box / MESH)
    assert not any(str(box) in text for text in provenance.values())


class Stopped(Exception):
    pass


def stopped(*_: object, **__: object) -> None:
    raise Stopped


def answered(box: Path, job: Job, wanted: response.Wanted, *names: str) -> Path:
    """The page of a chain, which is whole, with products beside it."""
    page, converged = running.run_body(job, wanted=wanted)
    assert converged and page == box / "build/box/report.html"
    text = page.read_text()
    assert text.rstrip().endswith("</html>") and "Hz" in text and 'src="http' not in text
    for name in ("basis.h5", "response.csv", "response.json", *names):
        assert (page.parent / name).stat().st_size > 100, name
    return page


def test_products_of_a_chain_without_pictures_are_complete(box: Path) -> None:
    job, wanted, told = open_job(box, root=box), response.Wanted("all", False), list[str]()
    answered(box, job, wanted)
    running.run_body(job, report=told.append, wanted=wanted)
    assert sum("is up to date" in t for t in told) == 4


@pytest.mark.slow
@pytest.mark.drawn
def test_products_of_the_whole_chain_are_complete(box: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    job, build = open_job(box, root=box), box / "build" / "box"
    page = answered(box, job, response.ALL, "pictures/response.png")
    drawn = json.loads(store.sidecar_path(page).read_text())["files"] if store.sidecar_path(page).is_file() else {}
    assert not drawn or {f"pictures/{name}.png" for name in ("mesh", "interfaces", "compliance")} <= set(drawn)
    assert all((build / name).stat().st_size > 1000 for name in drawn)
    assert not [p for p in box.rglob(".*") if p.is_file()], "temporary files are left"
    if not drawn:
        pytest.skip("pictures of bodies cannot be drawn on this machine")
    told: list[str] = []
    running.run_body(job, report=told.append)
    assert sum("is up to date" in t for t in told) == 4  # the stuck modes are told again
    mesh = build / "pictures" / "mesh.png"
    mesh.write_bytes(mesh.read_bytes()[:-1])
    monkeypatch.setattr("microslip.pictures.draw_all", stopped)
    with pytest.raises(Stopped):  # it is about to draw them anew
        running.run_body(job)


def test_a_case_of_another_name_has_its_own_folder(box: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(box)
    other = box / "stiff.toml"
    other.write_text((box / "case.toml").read_text().replace('name = "box"', 'name = "stiff"', 1))
    assert places.is_case(other) and not places.is_case(box / "body.toml")
    product, converged = running.run_case_file(other)
    assert converged and product == Path("build/stiff/response.csv") and product.is_file()
    assert (box / BASIS).is_file() and not (box / "build/stiff/basis.h5").exists()


def test_a_case_finds_its_body_wherever_it_is_run(tmp_path: Path) -> None:
    """Around the case first, the nearest first; where it is run last; not where anybody may write."""
    case, elsewhere = tmp_path / "mine/project/cases/case.toml", tmp_path / "elsewhere"

    def found(place: str, name: str = "box", root: Path = elsewhere) -> bool:
        file = tmp_path / place
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f'name = "{name}"\n')
        return places.find_body(case, name, root) == file

    for folder in (case.parent, elsewhere / "geometry"):
        folder.mkdir(parents=True)
    refused("body: no body.toml of a body 'box'", places.find_body, case, "box", elsewhere)
    for place in ("elsewhere/box", "mine/geometry/box", "mine/project/box", "mine/project/geometry/box"):
        assert found(f"{place}/body.toml")
    assert found("mine/project/geometry/box/other.toml", "box-other")
    for place in ("geometry/box", "box"):
        shutil.rmtree(tmp_path / "mine/project" / place)
    (tmp_path / "mine").chmod(0o777)
    assert places.find_body(case, "box", elsewhere) == elsewhere / "box/body.toml"
    for place in ("cases/box", "cases"):
        assert found(f"mine/project/{place}/body.toml")


@pytest.mark.parametrize(
    ("script", "sentence"),
    [
        ("import sys; sys.exit('the wall is thicker than the pipe')", ("meshing failed", "thicker")),
        ("import sys; print('wall = 9 is too much', file=sys.stderr); sys.exit(2)", "body.toml: wall = 9 is too much"),
        ("raise ValueError('odd')", "body.toml: build.py, line 1: ValueError: odd; correct it"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "signal 11"),
        ("", ("meshing failed", "no message")),
        ("raise ModuleNotFoundError(\"No module named 'gmsh'\")", "microslip[fem]"),
        ("raise OSError('libGLU.so.1: cannot open shared object file')", "libGLU.so.1; type: sudo apt-get install"),
    ],
)
def test_a_mesher_that_fails_leaves_the_old_mesh(box: Path, script: str, sentence: str | tuple[str, ...]) -> None:
    old = (box / MESH).read_bytes()
    (box / "build.py").write_text(script)
    refused(sentence, run_chain, box)
    assert (box / MESH).read_bytes() == old
    assert not list((box / "meshes").glob(".*"))


def test_a_mesher_that_may_not_be_started_is_not_told_as_a_product(
    box: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "python").write_text("")
    monkeypatch.setattr("sys.executable", str(tmp_path / "python"))
    refused(("python: cannot be started", "Permission denied"), meshing.mesh_stage, open_job(box), force=True)


@pytest.mark.parametrize("key", ["build", "cad", "mesh"])
def test_a_missing_source_is_named_with_its_key(box: Path, key: str) -> None:
    edit(box / "body.toml", 'build = "build.py"', f'{key} = "gone.step"')
    edit(box / "body.toml", "[geometry.parameters]\nsize = [20.0, 30.0, 120.0]\n", "")
    refused((f"geometry.{key}: there is no file ", "gone.step"), run_chain, box)


def test_temperatures_of_a_table_reach_the_nodes(box: Path) -> None:
    """T = 300 + 2 z (z in mm) is linear: interpolation of a coarse table must return it at every node."""
    rows = [f"{x}, {y}, {z}, {300 + 2 * z}" for x in (-10, 10) for y in (-15, 15) for z in (0, 70, 120)]
    (box / "heat.csv").write_text("# x, y, z in mm, T in K\n" + "\n".join(rows) + "\n")
    edit(box / "body.toml", "[[supports]]", '[temperature]\nfile = "heat.csv"\n\n[[supports]]')
    job = open_job(box, root=box)
    mesh, _ = meshing.load_mesh(job)
    found = modal.nodal_temperature(job, mesh)
    assert found == pytest.approx(300 + 2000 * mesh.points[:, 2], rel=1e-9)
    (box / "heat.csv").write_text("1, 2, 3\n")
    refused("heat.csv: must be lines of x, y, z, T", modal.nodal_temperature, job, mesh)
    (box / "heat.csv").unlink()
    refused("temperature.file: there is no file", run_chain, box)


# ---------------------------------------------------------------- what products depend on


def source(module: str) -> Path:
    path = PACKAGE / module.replace(".", "/")
    return path.with_suffix(".py") if path.with_suffix(".py").is_file() else path / "__init__.py"


def imported(module: str) -> set[str]:
    """Modules of the package that a module imports, at any depth of its text."""
    inside = module if source(module).name == "__init__.py" else module.rpartition(".")[0]
    found: set[str] = set()
    for node in ast.walk(ast.parse(source(module).read_text())):
        if not isinstance(node, ast.ImportFrom):
            continue
        parts = inside.split(".") if inside else []
        base = ".".join([*parts[: len(parts) + 1 - node.level], *([node.module] if node.module else [])])
        if not node.level:
            base = "" if node.module == "microslip" else (node.module or "").removeprefix("microslip.")
            if not (node.module or "").startswith("microslip"):
                continue
        found |= {base, *(f"{base}.{a.name}".strip(".") for a in node.names)}
    return {m for m in found if m and source(m).is_file()}


def test_every_module_behind_a_product_counts_as_its_input() -> None:
    """What a file is found to import, by its text, is what Python's own parser finds, for every file of the package."""
    for file in PACKAGE.rglob("*.py"):
        found = {
            ".".join(f.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__") for f in _imported(file)
        }
        module = ".".join(file.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__")
        assert found - {"__init__", module} == imported("" if module == "__init__" else module) - {module}, file


def test_a_change_of_code_is_another_input(monkeypatch: pytest.MonkeyPatch) -> None:
    """The step of a law counts for responses, not for modal files; the solver behind modes counts for both.

    What is no module counts with those beside it: how a page looks, a table that a closed form reads.
    """
    first = {m: hash_of_code.__wrapped__((m,)) for m in ("modal.compute", "stages.response")}
    own = store.hash_file
    for changed, differing in (
        ("contact/point.py", {"stages.response"}),
        ("linalg/eigen.py", set(first)),
        ("report/templates/page.html", {"stages.response"}),
        ("report/templates/style.css", {"stages.response"}),
        ("harmonic_balance/ellipse.npz", {"stages.response"}),
        ("templates/own.toml", set()),
    ):
        monkeypatch.setattr(store, "hash_file", lambda f, c=changed: "other" if f == PACKAGE / c else own(f))
        assert {m for m in first if hash_of_code.__wrapped__((m,)) != first[m]} == differing


def test_the_bodies_of_the_project_have_what_make_asks_for() -> None:
    root = PACKAGE.parents[1]
    bodies = [p.parent.name for p in (root / "geometry").glob("*/body.toml")]
    assert {"blade", "shroud", "pendulum", "half-pipe"} <= set(bodies)
    for name in bodies:
        assert load_toml(root / "geometry" / name / "body.toml")["name"] == name


def test_boxes_of_one_name_add_up_and_none_takes_a_sets_name(tmp_path: Path) -> None:
    """Two boxes of one name: both ends, as rules of a CAD file add up; a name of the mesh file is refused."""
    from small import SIZE, beam, table

    from microslip.settings.body import BodySettings

    x, y, z = SIZE
    ends = [{"name": "ends", "box": [0, 0, h, x, y, h]} for h in (0.0, z)]

    def faces(rules: list[dict]) -> dict:
        settings = BodySettings.model_validate(table(geometry={"mesh": "small.msh", "faces": rules}))
        job = Job(tmp_path / "body.toml", settings, {}, tmp_path)
        return meshing._faces_by_rule(job, beam()).faces

    own, made = beam().faces, faces([*ends, ends[0]])["ends"]["triangle6"]
    assert len(made) == len(own["clamp"]["triangle6"]) + len(own["tip"]["triangle6"])
    refused("geometry.faces.tip: ", faces, [{**ends[0], "name": "tip"}])


def test_what_a_mesh_includes_counts_as_its_input(tmp_path: Path) -> None:
    """A deck in three files: a node moved in the innermost is another mesh."""
    from small import table

    from microslip.settings.body import BodySettings

    (tmp_path / "sets").mkdir()
    deck, inner = tmp_path / "part.inp", tmp_path / "sets" / "nodes.inp"
    deck.write_text("*NODE, INPUT=sets/all.inp\n** *INCLUDE, INPUT=none.inp\n*STEP\n")
    (tmp_path / "sets" / "all.inp").write_text("*include, input=nodes.inp\n")
    settings = BodySettings.model_validate(table(geometry={"mesh": "part.inp"}))
    job = Job(tmp_path / "body.toml", settings, {"geometry": {}}, tmp_path)
    inner.write_text("1, 0, 0, 0\n")
    first = modal.modes_inputs(job, deck)
    inner.write_text("1, 0, 0, 1\n")
    assert modal.modes_inputs(job, deck) != first
    inner.write_text("1, 0, 0, 0\n")
    assert modal.modes_inputs(job, deck) == first


def test_what_a_path_means(tmp_path, monkeypatch):
    """A name, a folder of products and a product stand for the case or the body that they are of."""
    monkeypatch.chdir(tmp_path)
    for name in ("geometry/blade/body.toml", "pipeline/cases/blade.toml", "pipeline/cases/rig.toml", "own/case.toml"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("", encoding="utf-8")
    (tmp_path / "build" / "rig").mkdir(parents=True)
    case, body = Path("pipeline/cases/blade.toml"), Path("geometry/blade/body.toml")
    assert meant(Path("blade")) == body and meant(Path("blade"), case=True) == case
    assert meant(Path("geometry/blade")) == Path("geometry/blade")
    assert meant(Path("geometry/blade"), case=True) == case
    assert meant(Path("build/rig/response.h5")) == meant(Path("build/rig")) == Path("pipeline/cases/rig.toml")
    (tmp_path / "build" / "own").mkdir()
    assert meant(Path("own/system.toml"), case=True) == Path("own/case.toml")
    assert meant(Path("build/own"), case=True) == Path("own/case.toml")
    assert meant(Path("own")) == Path("own") and meant(Path("away.toml")) == Path("away.toml")
    refused("is 'blade' meant", meant, Path("blad"))
    refused("no case here or of this name; there are blade, rig", meant, Path("geometry"), case=True)


FEW = ["sweep.start=350.0", "sweep.stop=420.0", "sweep.points=5", "sweep.normal_forces=[100.0]", "harmonics=1",
       "samples=24", "contacts.0.points=[2,2]", "contacts.1.points=[2,2]"]  # fmt: skip


def resonance(at: Path, how: response.Wanted) -> dict[str, float]:
    """Of the packaged sample, with what is wanted of it and nothing else in a folder."""
    case, basis = (PACKAGE / "samples" / name for name in ("case.toml", "basis.h5"))
    found, _ = response.response_stage(case, {"vane-eigenmodes": basis}, at, FEW, wanted=how)
    assert bool(list(at.rglob("*.png"))) == how.pictures
    assert (at / "pictures" / "stress_over_frequency.png").is_file() == (how.stresses == "all" and how.pictures)
    return found["resonances"][0]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, undrawn_file: None, unjudged_file: None) -> dict[str, float]:
    return resonance(tmp_path_factory.mktemp("whole"), response.ALL)


@pytest.mark.parametrize(
    "wanted",
    [
        response.Wanted("resonances"),
        pytest.param(response.Wanted("none"), marks=pytest.mark.slow),
        response.Wanted("all", False),
    ],
)
def test_stresses_and_pictures_can_be_left_out(wanted, whole, tmp_path):
    """The stress of a resonance does not depend on whether it is drawn over the whole sweep."""
    part = resonance(tmp_path, wanted)
    assert part["amplitude_m"] == pytest.approx(whole["amplitude_m"], rel=1e-12)
    stress = None if wanted.stresses == "none" else pytest.approx(whole["stress_amplitude_Pa"], rel=1e-12)
    assert part.get("stress_amplitude_Pa") == stress


def test_what_a_build_file_imports_or_reads_is_an_input_of_the_mesh(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A helper beside it, a table above it, a model that gmsh reads: a change of any makes the mesh out of date."""
    monkeypatch.chdir(tmp_path)
    body = write_box(tmp_path / "box", case=False)
    (body / "sizes.py").write_text("LENGTH = 1.0\n")
    (tmp_path / "table.csv").write_text("1.0")
    (body / "point.geo").write_text("Point(9001) = {0, 0, 0, 1};")
    build = (body / "build.py").read_text()
    more = (
        "from pathlib import Path\nfrom sizes import LENGTH\nHERE = Path(__file__).parent\n"
        "assert (HERE.parent / 'table.csv').read_text() and LENGTH\n"
    )
    assert build.count("gmsh.model.occ.synchronize()") == 1
    build = build.replace(
        "gmsh.model.occ.synchronize()", "gmsh.model.occ.synchronize(); gmsh.merge(str(HERE / 'point.geo'))"
    )
    (body / "build.py").write_text(build.replace("import gmsh\n", f"import gmsh\n{more}", 1))

    def made() -> bool:
        told: list[str] = []
        meshing.mesh_stage(open_job(body), report=told.append)
        return "meshes/box.msh is up to date" not in told

    assert made() and not made()
    opened = json.loads((tmp_path / "meshes/box.msh.json").read_text())["opened"]
    assert set(opened) == {"../box/build.py", "../box/sizes.py", "../table.csv", "../box/point.geo"}
    for file in (body / "sizes.py", tmp_path / "table.csv", body / "point.geo"):
        file.write_text(file.read_text() + "\n")
        assert made() and not made(), file


def test_a_mesh_counts_for_the_folder_it_was_drawn_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same body.toml and build.py beside another table draw another body: 33 mm, not 11 mm."""
    monkeypatch.chdir(tmp_path)
    body = write_box(tmp_path / "box", case=False)
    table = "float(open(__file__.replace('build.py', 'width.txt')).read())"
    build = (body / "build.py").read_text()
    build = build.replace("length, width, height =", f"length, width, height = {table}, 20, 120 #", 1)
    (body / "build.py").write_text(build)
    (body / "width.txt").write_text("11")
    thick = tmp_path / "thick"
    shutil.copytree(body, thick)
    (thick / "width.txt").write_text("33")

    def width(of: Path) -> float:
        mesh, _ = meshing.load_mesh(open_job(of), meshing.mesh_stage(open_job(of)))
        return float(np.ptp(mesh.points[:, 0]))

    assert width(body) == pytest.approx(0.011)
    edit(body / "body.toml", 'name = "box"', 'name = "slender"')  # so that both may be called box
    assert width(thick) == pytest.approx(0.033)


def test_bodies_of_one_name_do_not_overwrite_each_other(
    box: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Mesh and modal file are of one body.toml: another one is refused until the first is gone or is
    called otherwise; what was moved as a whole still is its own."""
    monkeypatch.chdir(box)
    other = shutil.copytree(box, tmp_path / "other", ignore=shutil.ignore_patterns("build", "meshes"))
    (other / "body.toml").write_text((other / "body.toml").read_text().replace("2.1e11", "7e10"))
    kept = {p: (box / p).read_bytes() for p in (MESH, BASIS)}
    first = read_basis(BASIS).groups[0, 0].omega[0]
    assert run_chain(box) == set()
    for force in (False, True):
        with pytest.raises(UserError, match=r"name: \S*box.msh is made of body.toml, which has the same"):
            modal.modes_stage(open_job(other), force=force)
    assert kept == {p: (box / p).read_bytes() for p in (MESH, BASIS)}
    aluminium = meshing.mesh_stage(open_job(other, ['name="aluminium"']))
    assert aluminium == Path("meshes/aluminium.msh")
    case = (box / "case.toml").rename(other / "case.toml")
    with pytest.raises(UserError, match=r"bodies.box: means \S*other/body.toml, but .* is made of b"):
        places.existing_files(load_case(case)[0], None, Path())
    edit(box / "body.toml", 'name = "box"', 'name = "steel"')
    again, _ = modal.modes_stage(open_job(other))
    assert again == Path(BASIS) and read_basis(again).groups[0, 0].omega[0] < 0.6 * first
    assert places.existing_files(load_case(case)[0], None, Path()) == {"box": Path(BASIS)}


CASES = Path(__file__).parents[1] / "pipeline" / "cases"
SAMPLE = Path(microslip.__file__).parent / "samples" / "case.toml"
VERBS = [
    (SAMPLE, verb)
    for verb in ("respond", "respond --over frequency", "respond --stability", "respond --compare-book", "run", "orbit")
] + [
    (SAMPLE, "backbone"),
    (SAMPLE, "optimum"),
    (SAMPLE, "identify"),
    (SAMPLE, "two-tones"),
    (SAMPLE, "mistune"),
    (CASES / "belt.toml", "bifurcate"),
    (CASES / "squeal.toml", "stability"),
    (CASES / "wheel-rail.toml", "roll"),
    (CASES / "unround-wheel.toml", "roll"),
    (CASES / "slip-jump.toml", "roll"),
]


def test_no_verb_overwrites_another_case_of_one_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What a case has left in build/NAME stays, whatever is asked of another case of that name, until one of them has
    another name or the first one's folder is gone; of the same case nothing is refused."""
    monkeypatch.chdir(tmp_path)
    for number, (file, verb) in enumerate(VERBS):
        first, second = (Path(f"{number}{side}") / "case.toml" for side in "ab")
        for copy in (first, second):
            copy.parent.mkdir()
            shutil.copyfile(file, copy)
        name = tomllib.loads(file.read_text())["name"]
        folder = folder_of_case(first, name)
        product = folder / "orders.txt"  # of whichever verb

        def work(product: Path = product) -> Made:
            store.write_text(product, "of the first case")
            return Made()

        Stage(product, (), case=first).make({}, work)
        with monkeypatch.context() as few:  # nothing is looked for, and nothing computed, before
            few.setattr(places, "find_body", pytest.fail)
            few.setattr(places, "existing_files", pytest.fail)
            refused_command([*verb.split(), str(second)], capsys, f"{second}: name", str(first), f"delete {folder}")
        assert {p.name for p in folder.iterdir()} == {"orders.txt", "orders.txt.json"}
        assert folder_of_case(first, name) == folder
        shutil.rmtree("build")


def test_a_case_that_is_moved_or_renamed_gives_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is asked of a case is of that case too. Moved with its products it is the same."""
    first, moved = tmp_path / "first" / "case.toml", tmp_path / "moved"
    first.parent.mkdir()
    shutil.copyfile(SAMPLE, first)
    shutil.copytree(first.parent, tmp_path / "second")
    monkeypatch.chdir(first.parent)
    folder = folder_of_case(Path("case.toml"), "sample")

    def work() -> Made:
        store.write_text(folder / "backbone.json", "{}")
        return Made()

    Stage(folder / "backbone.json", (), case=Path("case.toml")).make({}, work)
    shutil.move(first.parent, moved)
    monkeypatch.chdir(moved)
    assert folder_of_case(Path("case.toml"), "sample") == folder
    refused(str(folder), folder_of_case, Path("../second/case.toml"), "sample")
    edit(Path("case.toml"), 'name = "sample"', 'name = "other"')
    assert folder_of_case(Path("../second/case.toml"), "sample") == folder
