"""`microslip import`: a body.toml around another program's file that runs as it stands."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import decks
import meshes
import numpy as np
import pytest
import scipy.io
import touching
from refusals import refused_command

from microslip.basis import read_basis
from microslip.cli import main
from microslip.elasticity import isotropic
from microslip.fem.discretise import discretise
from microslip.fem.operators import mass, stiffness
from microslip.mesh import read_mesh
from microslip.mesh.materials import Substitute


def beam():
    return meshes.brick("wedge15", (1, 1, 3), (0.01, 0.015, 0.04), to=meshes.shaken(0.0003))


@pytest.fixture(autouse=True)
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def part(*keywords, name="part.inp"):
    """A deck of the beam with its material and these keywords."""
    lines = [*decks.mesh_lines(beam(), sets=("z0",)), *decks.MATERIAL, decks.section(), *keywords]
    Path(name).write_text("\n".join(lines) + "\n")


def lowest(folder, name):
    return read_basis(folder / "build" / name / "basis.h5").groups[0, 0].omega


def exact():
    """Free modes of the beam, dense."""
    import scipy.linalg

    d = discretise(beam())
    K = d.pattern.full(stiffness(d, isotropic(2.1e11, 0.3))).toarray()
    M = np.kron(d.pattern.full(mass(d, 7850.0)).toarray(), np.eye(3))
    value, vector = np.linalg.eigh(M)  # nine points a wedge: M is not regular on so few cells
    keep = value > 1e-12 * value[-1]
    light, X = vector[:, ~keep], vector[:, keep] / np.sqrt(value[keep])
    X = X - light @ np.linalg.solve(light.T @ K @ light, light.T @ K @ X) if light.shape[1] else X
    return np.sqrt(np.maximum(scipy.linalg.eigvalsh(X.T @ K @ X), 0))[6:10]


def test_a_deck_runs_at_once_with_its_material(tmp_path, capsys):
    part(name="my part.inp")
    assert main(["import", "my part.inp"]) == 0
    assert "Steel: 7850 kg/m3" in capsys.readouterr().out
    text = (tmp_path / "my-part" / "body.toml").read_text()
    assert 'mesh = "../my part.inp"' in text and 'from = "mesh"' in text and "z0" in text
    assert main(["modes", "my-part", "-q", "--set", "modes.solver=superlu"]) == 0
    np.testing.assert_allclose(lowest(tmp_path, "my-part")[6:10], exact(), rtol=1e-9)
    refused_command(["import", "my part.inp"], capsys, "nothing was changed")


def test_a_deck_without_material_says_so(tmp_path, capsys):
    (tmp_path / "part.inp").write_text("\n".join(decks.mesh_lines(beam())) + "\n")
    assert main(["import", "part.inp", "here"]) == 0
    assert "no material was taken" in capsys.readouterr().out
    for _ in range(2):  # computed, and up to date
        assert main(["modes", "here"]) == 0
        assert "no material was taken" in capsys.readouterr().out


def test_modes_under_a_load_that_is_not_taken_say_so_each_time(tmp_path, monkeypatch, capsys):
    """Of a prestressed deck the modes are those of the unloaded body, which frequencies alone do not tell."""
    monkeypatch.chdir(tmp_path)
    steps = ["*STEP, NLGEOM", "*STATIC", "*CLOAD", "1, 1, 2.", "*END STEP"]
    steps += ["*STEP, PERTURBATION", "*FREQUENCY", "4", "*END STEP"]
    (tmp_path / "part.inp").write_text("\n".join([*decks.mesh_lines(beam()), *steps]) + "\n")
    assert main(["import", "part.inp", "here"]) == 0
    assert capsys.readouterr().out.count("its loads are left out, for nothing holds the body") == 1
    for _ in range(2):
        assert main(["modes", "here"]) == 0
        assert capsys.readouterr().out.count("its loads are left out, for nothing holds the body") == 1


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("*DENSITY\n7.85e-9\n", "", "density (7850 kg/m3)"),
        ("*ELASTIC\n210000., 0.3\n", "", "elastic constants that suffice (E 2.1e+11 Pa, nu 0.3)"),
        ("7.85e-9\n", "0.\n", "density (7850 kg/m3)"),
    ],
)
def test_numbers_that_a_material_lacks_are_those_of_steel_and_told_first(
    tmp_path, capsys, old, new, words
):
    lines = "\n".join([*decks.mesh_lines(beam()), *decks.MATERIAL, decks.section()]) + "\n"
    assert old in lines
    (tmp_path / "part.inp").write_text(lines.replace(old, new))
    assert main(["import", "part.inp", "here"]) == 0
    line = lines[: lines.index("*MATERIAL")].count("\n") + 1
    first = f"part.inp, line {line}: the material 'Steel' of the cells 'EALL' has no {words}: "
    first += "what stands in brackets is taken"
    assert capsys.readouterr().out.startswith(f"warning: {first}")
    mesh = read_mesh("part.inp", "mm", "mm-t-s", instead=Substitute(7850.0, 2.1e11, 0.3))
    (material,) = mesh.materials
    np.testing.assert_allclose(material.elasticity, isotropic(2.1e11, 0.3), rtol=1e-12)
    assert material.density == pytest.approx(7850) and first in mesh.lost[0]


def test_numbers_of_a_missing_material_are_in_si(tmp_path, capsys):
    """A light and soft one: frequencies go with sqrt(E / rho)."""
    lines = [*decks.mesh_lines(beam()), "*MATERIAL, NAME=Steel", decks.section()]
    (tmp_path / "part.inp").write_text("\n".join(lines) + "\n")
    options = ["--density", "785", "--young", "0.84e11"]
    assert main(["import", "part.inp", "without", *options, "--poisson", "0"]) == 0
    assert "\npoisson = 0\n" in (tmp_path / "without" / "body.toml").read_text()
    assert main(["import", "part.inp", "here", *options]) == 0
    assert main(["modes", "here", "-q"]) == 0
    np.testing.assert_allclose(lowest(tmp_path, "here")[6:9], 2 * exact()[:3], rtol=1e-8)
    refused_command(["import", "part.inp", "there", "--young", "-1"], capsys, "--young -1")


def test_a_surface_with_a_face_inside_matters_to_nobody_who_does_not_use_it(tmp_path, capsys):
    """The upper face of the lowest cell lies between two cells; the other face of the set is on the surface."""
    part("*SURFACE, NAME=CUT", "1, S1", "1, S2")
    message = "1 of 2 facets of the set 'CUT' are not on the surface"
    assert main(["info", "part.inp"]) == 0
    out, err = capsys.readouterr()
    assert message in err and "CUT" not in out
    assert main(["import", "part.inp", "here"]) == 0
    assert f"warning: {message}" in capsys.readouterr().out
    assert main(["modes", "here", "-q"]) == 0
    path = tmp_path / "here" / "body.toml"
    path.write_text(path.read_text().replace("free = true", "") + '\n[[supports]]\nface = "CUT"\n')
    refused_command(["modes", "here", "-q"], capsys, f"supports.CUT.face: {message}")


def clamped():
    """First frequencies of the beam held at its lower end by supports of body.toml, rad/s."""
    d, held = discretise(beam()), beam().face_points("z0")
    kept = np.setdiff1d(np.arange(3 * len(beam().points)), (3 * held[:, None] + np.arange(3)).ravel())
    K = d.pattern.full(stiffness(d, isotropic(2.1e11, 0.3))).toarray()[np.ix_(kept, kept)]
    M = np.kron(d.pattern.full(mass(d, 7850.0)).toarray(), np.eye(3))[np.ix_(kept, kept)]
    return np.sqrt(1 / np.linalg.eigvals(np.linalg.solve(K, M)).real.max())


def in_turn(numbers):
    return [f"{n}, 1, 3" for n in numbers]


LOWER = [decks.ids(beam())[i] for i in beam().face_points("z0")]
HELD = {
    "a set at once": (["*BOUNDARY", "Z0, 1, 6"], "z0 in xyz"),
    "a set direction by direction": (["*BOUNDARY", "z0, 1, 1", "z0, 2, , 0.0", "z0, 3, 3, 0."], "z0 in xyz"),
    "by name in a step": (["*STEP", "*STATIC", "*BOUNDARY, OP=NEW", "part-1.z0, ENCASTRE", "*END STEP"], "z0 in xyz"),
    "a displacement before any step": (["*BOUNDARY", "z0, 1, 3, 0.5"], "z0 in xyz"),
    "node by node": (["*BOUNDARY", *in_turn(LOWER)], "z0 in xyz"),
    "what a step takes back": (["*BOUNDARY", "NALL, 1", "*STEP", "*BOUNDARY, OP=NEW", "z0, PINNED"], "z0 in xyz"),
}


@pytest.mark.parametrize("case", HELD)
def test_supports_of_a_deck_become_supports_of_the_body(tmp_path, capsys, case):
    keywords, told = HELD[case]
    part(*keywords)
    assert main(["import", "part.inp", "here"]) == 0
    assert f"supports of the file: {told}\n" in capsys.readouterr().out
    assert main(["modes", "here", "-q"]) == 0
    np.testing.assert_allclose(lowest(tmp_path, "here")[0], clamped(), rtol=1e-9)


LEFT = {
    "a plane of symmetry alone": (["*BOUNDARY", "z0, ZSYMM"], "z0 in z; they leave rigid motions", 'face = "z0"'),
    "a velocity": (["*BOUNDARY, TYPE=VELOCITY", "z0, 1"], "a *BOUNDARY of the kind VELOCITY", "free = true"),
}


@pytest.mark.parametrize("case", LEFT)
def test_what_cannot_be_a_support_is_told_and_the_body_runs_free(tmp_path, capsys, case):
    keywords, told, written = LEFT[case]
    part(*keywords)
    assert main(["import", "part.inp", "here"]) == 0
    out = capsys.readouterr().out
    assert "warning: " in out and told in out
    text = (tmp_path / "here" / "body.toml").read_text()
    assert written in text and "free = true" in text
    assert main(["modes", "here", "-q"]) == 0


@pytest.mark.parametrize(
    ("keywords", "told"),
    [
        (["*BOUNDARY", "z9, 1, 3"], "*BOUNDARY names the node set 'z9'"),
        (["*BOUNDARY", "999, 1, 3"], "*BOUNDARY names the node 999"),
        (["*SURFACE, NAME=S", "1, S9"], "the side 'S9', which no cell has"),
        (["*SURFACE, NAME=S", "Nobody, S1"], "the element set 'Nobody'"),
        (["*SURFACE, NAME=S, TYPE=NODE", "Nobody"], "the node set 'Nobody'"),
        (["*NSET, NSET=N", "Nobody"], "the set 'Nobody'"),
        (["*SYSTEM", "0,0,0,0,0,0"], "*SYSTEM lie on a line"),
        (["*SOLID SECTION, ELSET=Nobody, MATERIAL=Steel"], "the element set 'Nobody'"),
        (["*SURFACE, NAME=S", "1, S1", "*CONTACT PAIR, INTERACTION=Nope", "S, S"], "the interaction 'NOPE'"),
    ],
)
def test_names_that_nothing_answers_to_are_refused_with_their_line(tmp_path, capsys, keywords, told):
    part(*keywords)
    said = refused_command(["import", "part.inp", "here"], capsys, told)
    assert said.startswith("error: part.inp, line ") and "damaged" not in said
    assert not (tmp_path / "here").exists()


def test_a_deck_of_two_parts_is_refused_only_where_a_part_is_not_held(tmp_path, capsys):
    """The same beam twice, apart: with both held every frequency comes twice."""
    lines = decks.mesh_lines(touching.together(a=beam(), b=aside()), sets=("a_z0", "b_z0"))
    lines += [*decks.MATERIAL, decks.section(), "*BOUNDARY", "a_z0, 1, 3"]
    (tmp_path / "one.inp").write_text("\n".join(lines) + "\n")
    (tmp_path / "both.inp").write_text("\n".join([*lines, "b_z0, 1, 3"]) + "\n")
    assert main(["import", "one.inp"]) == 0 and main(["import", "both.inp"]) == 0
    assert "warning: the mesh falls into 2 parts" in capsys.readouterr().out
    refused_command(["modes", "one", "-q"], capsys, "nothing holds the part with face 'b_z0'")
    assert main(["modes", "both", "-q"]) == 0
    np.testing.assert_allclose(lowest(tmp_path, "both")[:2], clamped(), rtol=1e-9)


def aside():
    mesh = beam()
    return replace(mesh, points=mesh.points + [0.1, 0, 0])


@pytest.mark.parametrize("suffix", ["mtx", "mat"])
def test_matrices_run_at_once(tmp_path, suffix):
    d = discretise(beam())
    K = d.pattern.full(stiffness(d, isotropic(2.1e11, 0.3))) * 1e-3
    M = np.kron(d.pattern.full(mass(d, 7850.0)).toarray(), np.eye(3)) * 1e-3
    if suffix == "mat":
        scipy.io.savemat("model.mat", {"K": K, "M": M})
    else:
        scipy.io.mmwrite("model_K.mtx", K, precision=17)
        scipy.io.mmwrite("model_M.mtx", M, precision=17)
    rows = np.column_stack([beam().node_id, beam().points * 1e3])
    np.savetxt("nodes.csv", rows, "%d,%.17g,%.17g,%.17g")
    assert main(["import", "model.mat" if suffix == "mat" else "model_K.mtx", "part"]) == 0
    assert main(["modes", "part", "-q", "--set", "name=part"]) == 0
    np.testing.assert_allclose(lowest(tmp_path, "part")[6:10], exact(), rtol=1e-8)


@pytest.mark.parametrize(
    ("words", "text"),
    [(["no.inp"], "no such file"), (["K.mtx"], "no mass matrix is beside it"), (["K.mtx", "--unit", "yd"], "yd")],
)
def test_what_cannot_be_imported_is_refused(capsys, words, text):
    scipy.io.mmwrite("K.mtx", np.eye(3))
    refused_command(["import", *words], capsys, text)


DRAW = """
import gmsh
gmsh.initialize(readConfigFiles=False, interruptible=False)
gmsh.option.setNumber("General.Terminal", 0)
occ = gmsh.model.occ
occ.cut([(3, occ.addBox(0, 0, 0, 40, 20, 10))], [(3, occ.addCylinder(10, 10, -1, 0, 0, 12, 4))])
occ.synchronize()
gmsh.write("Teil 1 ü.step")
gmsh.finalize()
"""


@pytest.fixture
def step_file(tmp_path):
    """A block with a bore, in a file whose name has a blank and an umlaut."""
    if importlib.util.find_spec("gmsh") is None:
        pytest.skip("gmsh is not installed")
    subprocess.run([sys.executable, "-c", DRAW], check=True, capture_output=True)
    return tmp_path / "Teil 1 ü.step"


@pytest.mark.slow
def test_a_cad_file_runs_at_once_and_then_with_its_lines_uncommented(step_file, capsys):
    assert main(["import", step_file.name, "block"]) == 0
    out = capsys.readouterr().out
    assert "40 x 20 x 10, from (0 0 0) to (40 20 10)" in out and "radius 4" in out and "microslip run block" in out
    assert main(["modes", "block", "-q"]) == 0
    group = read_basis("build/block/basis.h5").groups[0, 0]
    assert group.kind[:7] == ("rigid",) * 6 + ("normal",)
    body = step_file.parent / "block" / "body.toml"
    text = body.read_text(encoding="utf-8").replace("free = true", "# free = true", 1)
    head, choices = text.split("# Name those you need", 1)
    lines = [line[1:] if line.startswith("#") else line for line in choices.splitlines()[1:]]
    body.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    assert main(["modes", "block", "-q", "--set", "mesh.size=8"]) == 0
    group = read_basis("build/block/basis.h5").groups[0, 0]
    assert "contact" in group.interfaces and "shaker" in group.excitations and "tip" in group.monitors
    assert group.kind[0] == "normal"


def test_a_cad_file_in_the_place_of_a_body_is_sent_to_import(step_file, capsys):
    for verb in ("modes", "run", "mesh"):
        assert main([verb, step_file.name]) == 2
        assert f"microslip import '{step_file.name}'" in capsys.readouterr().err


def test_a_face_that_no_rule_names_is_told_before_the_mesher_works(step_file, capsys, monkeypatch):
    monkeypatch.setattr("microslip.stages.importing._draw", lambda *_: "")  # a second of its own
    assert main(["import", step_file.name, "block"]) == 0
    with (step_file.parent / "block" / "body.toml").open("a") as file:
        file.write('[[supports]]\nface = "clmp"\n[[interfaces]]\nname = "a"\nface = "b"\n')
    line = ["modes", "block", "--set", "free=false"]
    refused_command(line, capsys, "supports.clmp.face: geometry.faces names no face 'clmp'", "interfaces.a.face")
    assert not (step_file.parent / "meshes").exists()


def test_numbers_stand_on_the_surfaces_that_are_seen():
    """A box from above, right and front shows these three sides and no others; many surfaces keep their numbers."""
    pytest.importorskip("pyvista")
    from microslip import pictures
    from microslip.pictures.numbered import _view
    from microslip.pictures.scene import Stage, axes_towards, fit, quiet_vtk

    if reason := pictures.can_draw():
        pytest.skip(reason)
    quiet_vtk()
    corner = np.array([[x, y, z] for x in (0, 0.03) for y in (0, 0.02) for z in (0, 0.01)])
    sides = {171: (0, 2, 3, 1), 12: (4, 5, 7, 6), 13: (0, 1, 5, 4)}
    sides |= {140: (2, 6, 7, 3), 15: (0, 4, 6, 2), 16: (1, 3, 7, 5)}
    triangles = np.array([t for a, b, c, d in sides.values() for t in ((a, b, c), (a, c, d))])
    stage = Stage()
    try:
        camera = fit(corner, axes_towards(np.array([1.0, -1.2, 0.8])), 90_000)
        _, told = _view(stage, camera, corner, triangles, np.repeat(list(sides), 2))
        assert sorted(told) == [12, 13, 16]  # x high, y low, z high
        camera = fit(corner, axes_towards(-np.array([1.0, -1.2, 0.8])), 90_000)
        _, told = _view(stage, camera, corner, triangles, np.repeat(list(sides), 2))
        assert sorted(told) == [15, 140, 171]
    finally:
        stage.close()
