"""Materials, orientations and temperatures that a deck brings itself: used as they are, conflicts told."""

from __future__ import annotations

import decks
import meshes
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused_command

from microslip.basis import check_basis, read_basis
from microslip.data import Mesh
from microslip.elasticity import isotropic, orthotropic
from microslip.errors import UserError
from microslip.mesh import read_mesh
from microslip.stages.job import open_job
from microslip.stages.modal import modes_stage

BODY = """
name = "part"
length_unit = "mm"
[geometry]
mesh = "part.inp"
[material]
{material}
[[supports]]
face = "z0"
[modes]
count = 8
solver = "superlu"
"""
ORTHO = [
    "*MATERIAL, NAME=Wood", "*ELASTIC, TYPE=ENGINEERING CONSTANTS",
    "12000., 900., 500., 0.37, 0.42, 0.47, 700., 650.,", "250.", "*DENSITY", "6e-10",
    "*ORIENTATION, NAME=GRAIN, SYSTEM=RECTANGULAR", "0.8, 0.6, 0., -0.6, 0.8, 0.",
]  # fmt: skip
HELD = ["*BOUNDARY", "z0, 1, 3"]


def beam():
    return meshes.brick("hexahedron20", (1, 2, 4), (0.01, 0.015, 0.05), to=meshes.shaken(0.0005))


def halves() -> list[str]:
    return ["*ELSET, ELSET=LOW, GENERATE", "1, 4", "*ELSET, ELSET=HIGH, GENERATE", "5, 8"]


def made(folder, lines, material='from = "mesh"', more=""):
    (folder / "part.inp").write_text("\n".join(lines) + "\n")
    (folder / "body.toml").write_text(BODY.format(material=material) + more)
    path, warnings = modes_stage(open_job(folder, root=folder))
    return read_basis(path), warnings


def test_deck_and_settings_say_the_same_material(tmp_path):
    lines = [*decks.mesh_lines(beam(), sets=("z0",)), *decks.MATERIAL, decks.section()]
    (tmp_path / "a").mkdir(), (tmp_path / "b").mkdir()
    own, none = made(tmp_path / "a", lines, "density = 7850.0\nyoung = 2.1e11\npoisson = 0.3")
    deck, told = made(tmp_path / "b", lines)
    assert not none and not told
    np.testing.assert_allclose(deck.groups[0, 0].omega, own.groups[0, 0].omega, rtol=1e-10)
    assert deck.mesh.materials[0].name == "Steel"
    assert all(c.passed for c in check_basis(deck))


def test_another_material_in_the_settings_is_told(tmp_path):
    lines = [*decks.mesh_lines(beam(), sets=("z0",)), *decks.MATERIAL, decks.section()]
    _, told = made(tmp_path, lines, "density = 7850.0\nyoung = 7e10\npoisson = 0.3")
    assert any("'Steel'" in t and "from" in t for t in told)


@pytest.mark.skipif(decks.CCX is None, reason="needs CalculiX")
def test_two_materials_one_turned_give_calculix_own_frequencies(tmp_path):
    """1e-6: CalculiX prints seven digits. Element sets, engineering constants, orientation, mass checked too."""
    lines = [*decks.mesh_lines(beam(), sets=("z0",)), *halves(), *decks.MATERIAL, *ORTHO]
    lines += [decks.section("LOW"), decks.section("HIGH", "Wood", "GRAIN")]
    theirs = decks.run(tmp_path, "ccx", [*lines, *HELD, *decks.frequency_step()])
    basis, told = made(tmp_path, lines)
    assert not told and len(theirs) >= 8
    np.testing.assert_allclose(basis.groups[0, 0].frequency[:8], theirs[:8], rtol=1e-6)
    assert {m.name for m in basis.mesh.materials} == {"Steel", "Wood"}
    failed = [c.name for c in check_basis(basis) if not c.passed]
    assert not failed, failed


@pytest.mark.skipif(decks.CCX is None, reason="needs CalculiX")
def test_heated_deck_between_walls_gives_calculix_own_frequencies(tmp_path):
    """Thermal stress of the deck's own temperatures, linear prestress as CalculiX' PERTURBATION step makes it."""
    lines = decks.mesh_lines(beam(), sets=("z0", "z1"))
    lines += [*decks.MATERIAL, "*EXPANSION", "1.2e-5", decks.section()]
    lines += ["*INITIAL CONDITIONS, TYPE=TEMPERATURE", "NALL, 20."]
    held = ["*BOUNDARY", "z0, 1, 3", "z1, 1, 3"]
    hot = ["*STEP", "*STATIC", "*TEMPERATURE", "NALL, 120.", "*END STEP"]
    step = ["*STEP, PERTURBATION", "*FREQUENCY", "6", "*END STEP"]
    theirs = decks.run(tmp_path, "ccx", [*lines, *held, *hot, *step])
    more = '[[supports]]\nface = "z1"\n[temperature]\nfrom = "mesh"\n[rotation]\nprestress = "linear"\n'
    basis, _ = made(tmp_path, [*lines, *hot], more=more)
    cold, _ = made(tmp_path, lines, more='[[supports]]\nface = "z1"\n')
    np.testing.assert_allclose(basis.groups[0, 0].frequency[:6], theirs[:6], rtol=2e-6)
    assert basis.groups[0, 0].frequency[0] < 0.999 * cold.groups[0, 0].frequency[0]  # it does soften


def test_orthotropic_stiffness_and_engineering_constants_are_one_material(tmp_path):
    """*ELASTIC, TYPE=ORTHO lists D1111 D1122 D2222 D1133 D2233 D3333 D1212 D1313 D2323."""
    C = orthotropic(np.array([12e3, 900.0, 500.0]), np.array([0.37, 0.47, 0.42]), np.array([700.0, 250.0, 650.0]))
    d = [C[0, 0], C[0, 1], C[1, 1], C[0, 2], C[1, 2], C[2, 2], C[3, 3], C[5, 5], C[4, 4]]
    words = [f"{v:.15e}" for v in d]
    stiff = ["*MATERIAL, NAME=Wood", "*ELASTIC, TYPE=ORTHO", ", ".join(words[:8]) + ",", words[8], "*DENSITY", "6e-10"]
    lines = decks.mesh_lines(beam(), sets=("z0",))
    (tmp_path / "a").mkdir(), (tmp_path / "b").mkdir()
    a, _ = made(tmp_path / "a", [*lines, *ORTHO, decks.section(material="Wood", orientation="GRAIN")])
    b, _ = made(tmp_path / "b", [*lines, *stiff, *ORTHO[-2:], decks.section(material="Wood", orientation="GRAIN")])
    np.testing.assert_allclose(b.mesh.materials[0].elasticity, a.mesh.materials[0].elasticity, atol=1e-2)
    np.testing.assert_allclose(b.groups[0, 0].omega, a.groups[0, 0].omega, rtol=1e-9)


def test_modulus_over_temperature_becomes_a_factor(tmp_path):
    table = ["*MATERIAL, NAME=Hot", "*ELASTIC", "200000., 0.3, 20.", "150000., 0.3, 420.", "*DENSITY", "7.85e-9"]
    lines = [*decks.mesh_lines(beam(), sets=("z0",)), *table, decks.section(material="Hot")]
    basis, _ = made(tmp_path, lines, more="[temperature]\nuniform = 493.15\n")  # half way between 20 and 420 degrees C
    cold, _ = made(tmp_path, lines)
    np.testing.assert_allclose(cold.mesh.materials[0].elasticity, isotropic(2e11, 0.3), rtol=1e-12)
    ratio = basis.groups[0, 0].omega / cold.groups[0, 0].omega
    np.testing.assert_allclose(ratio, np.sqrt(0.875), rtol=1e-9)


@pytest.mark.skipif(decks.CCX is None, reason="needs CalculiX")
@pytest.mark.parametrize("axis", [1, 2, 3])
def test_an_orientation_turned_about_one_of_its_axes_is_that_of_calculix(tmp_path, axis):
    mesh = meshes.brick("hexahedron20", (1, 1, 2), (0.01, 0.012, 0.05))
    lines = [*decks.mesh_lines(mesh, sets=("z0",)), *ORTHO[:-1], "1., .4, .1, -.3, 1., .2", f"{axis}, 25."]
    lines.append(decks.section("EALL", "Wood", "GRAIN"))
    theirs = decks.run(tmp_path, "ccx", [*lines, *HELD, *decks.frequency_step()])
    basis, _ = made(tmp_path, lines)
    np.testing.assert_allclose(basis.groups[0, 0].omega[:8] / 2 / np.pi, theirs[:8], rtol=1e-6)


def test_a_material_in_axes_that_are_not_read_is_no_steel(tmp_path, monkeypatch, capsys):
    lines = [*decks.mesh_lines(beam()), *ORTHO, decks.section("EALL", "Wood", "GRAIN")]
    (tmp_path / "part.inp").write_text("\n".join(lines).replace("RECTANGULAR", "CYLINDRICAL") + "\n")
    monkeypatch.chdir(tmp_path)
    refused_command(["import", "part.inp", "out"], capsys, "'Wood'", "*ORIENTATION, NAME=GRAIN", "CYLINDRICAL")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (("*DENSITY\n7.85e-9\n", ""), "material 'Steel' of the cells 'EALL' has no density"),
        (("210000., 0.3", "210000., 0.5"), "nu = 0.5"),
        (("*ELASTIC\n210000., 0.3", "*ELASTIC, TYPE=ANISO\n1.,2.,3.,4.,5.,6.,7.,8.,"), "TYPE=ANISO, which is not read"),
        (("ELSET=EALL, MATERIAL=Steel", "ELSET=EALL, MATERIAL=Brass"), "'Brass', which is not defined"),
        (("*SOLID SECTION, ELSET=EALL", "*SOLID SECTION, ELSET=OTHER"), "set 'OTHER', which is not defined"),
        (("*SOLID SECTION", "*ELSET, ELSET=ONE\n1,\n*SOLID SECTION, ELSET=ONE, MATERIAL=Steel\n**"), "7 cells from"),
        (("210000., 0.3", "210000., x"), "no number"),
    ],
)
def test_incomplete_materials_are_refused_in_a_sentence(tmp_path, capsys, change, text):
    lines = "\n".join([*decks.mesh_lines(beam(), sets=("z0",)), *decks.MATERIAL, decks.section()]) + "\n"
    assert change[0] in lines
    (tmp_path / "part.inp").write_text(lines.replace(*change))
    (tmp_path / "body.toml").write_text(BODY.format(material='from = "mesh"'))
    refused_command(["modes", str(tmp_path)], capsys, text, "part.inp")


def test_wrong_units_are_told(tmp_path):
    """Numbers in kg and m read as t and mm: the density is a million millions too large."""
    lines = [*decks.mesh_lines(beam(), sets=("z0",)), "*MATERIAL, NAME=Steel", "*ELASTIC", "2.1e11, 0.3", "*DENSITY"]
    _, told = made(tmp_path, [*lines, "7850.", decks.section()])
    assert any("correct material.units" in t for t in told)


def test_flipped_bytes_of_a_deck_are_read_or_refused(tmp_path_factory):
    """Materials, orientations, sections and temperatures included: a mesh, or one sentence."""
    folder = tmp_path_factory.mktemp("flip")
    lines = [*decks.mesh_lines(meshes.brick("wedge", (1, 1, 1)), sets=("z0",)), *decks.MATERIAL, *ORTHO]
    lines += [decks.section(), "*ELSET, ELSET=TWO", "2", decks.section("TWO", "Wood", "GRAIN"), "*EXPANSION", "1e-5"]
    lines += ["*INITIAL CONDITIONS, TYPE=TEMPERATURE", "NALL, 20.", "*TEMPERATURE", "z0, 30."]
    whole = "\n".join(lines).encode()

    @settings(max_examples=150, deadline=None)
    @given(st.lists(st.tuples(st.integers(0, len(whole) - 1), st.integers(0, 255)), min_size=1), st.booleans())
    def flip(changes, cut):
        data = bytearray(whole)
        for place, value in changes:
            data[place] = value
        (folder / "part.inp").write_bytes(data[: changes[0][0]] if cut else data)
        try:
            read = read_mesh(folder / "part.inp", "mm", "mm-t-s")
        except UserError as error:
            assert "part.inp" in str(error)
        else:
            assert all(np.isfinite(m.elasticity).all() for m in read.materials)

    flip()


def test_a_bad_cell_is_named_by_its_number_though_cells_are_sorted_by_material(tmp_path, capsys):
    """The second section's cells come first in the file; cell 2 is turned inside out."""
    mesh = beam()
    cells = mesh.cells["hexahedron20"].copy()
    cells[1] = cells[1][[*range(4, 8), *range(4), *range(12, 16), *range(8, 12), *range(16, 20)]]
    turned = Mesh(mesh.points, {"hexahedron20": cells}, mesh.faces, node_id=mesh.node_id)
    lines = [*decks.mesh_lines(turned, sets=("z0",)), *halves(), *decks.MATERIAL, *ORTHO]
    lines += [decks.section("HIGH", "Wood"), decks.section("LOW")]
    (tmp_path / "part.inp").write_text("\n".join(lines) + "\n")
    (tmp_path / "body.toml").write_text(BODY.format(material='from = "mesh"'))
    refused_command(["modes", str(tmp_path)], capsys, "inside out (first: element 2)")
