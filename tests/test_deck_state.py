"""Decks whose modes are about a static step: the frequencies of CalculiX 2.20, which prints seven digits."""

from __future__ import annotations

from pathlib import Path

import decks
import meshes
import numpy as np
import pytest
from refusals import refused_command

from microslip.basis import read_basis
from microslip.cli import main
from microslip.mesh import read_mesh

STEEL = ["*MATERIAL, NAME=ST", "*ELASTIC", "205000., 0.29", "*DENSITY", "7.83e-9", "*EXPANSION", "1.2e-5"]
MODES = ["*STEP, PERTURBATION", "*FREQUENCY", "6", "*END STEP"]


@pytest.fixture(autouse=True)
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def deck(cell: str, *steps: str, before=(), modes=MODES, cells=(4, 1, 1)) -> str:
    """60 x 11 x 7 mm, clamped at x = 0."""
    mesh = meshes.brick(cell, cells, (0.06, 0.011, 0.007))
    lines = decks.mesh_lines(mesh, sets=("x0", "x1"))
    section = decks.section(material="ST")
    return "\n".join([*lines, *STEEL, section, *before, "*BOUNDARY", "x0, 1, 3", *steps, *modes]) + "\n"


def static(*loads: str, law: str = "") -> list[str]:
    return [f"*STEP{law}", "*STATIC", *loads, "*END STEP"]


def imported(capsys, text: str) -> str:
    Path("a.inp").write_text(text)
    assert main(["import", "a.inp", "body"]) == 0
    return capsys.readouterr().out


def hertz() -> np.ndarray:
    assert main(["modes", "body", "-q", "--set", "modes.solver=superlu", "--set", "modes.count=4"]) == 0
    return read_basis(Path("build/body/basis.h5")).groups[0, 0].frequency


PULLED = ["*CLOAD", "x1, 1, 300.", "x1, 3, 5."]
PRESSED = ["*DLOAD", "EALL, P2, 20."]
PULLING = ["*DLOAD", "EALL, GRAV, 5.e7, 1., 0., 0."]
TURNING = ["*DLOAD", "EALL, CENTRIF, 4.e6, 0., -50., 0., 0., 0., 1."]
STRETCHED = ["*BOUNDARY", "x1, 1, 1, 0.1"]
HEATED = ["*TEMPERATURE", "x1, 220.", "NALL, 120."]
COLD = ["*INITIAL CONDITIONS, TYPE=TEMPERATURE", "NALL, 20."]
LARGE = ", NLGEOM"
BRICK = "hexahedron20"


@pytest.mark.parametrize(
    ("cell", "law", "loads", "wanted"),
    [
        (BRICK, "", PULLED, [1683.764, 2557.63, 9977.832, 12160.75]),
        (BRICK, "", PRESSED, [1647.399, 2522.972, 9960.073, 12182.15]),
        (BRICK, "", TURNING, [1680.033, 2536.7, 9965.078, 12163.36]),
        (BRICK, "", HEATED, [1645.651, 2534.92, 9944.425, 12170.74]),
        (BRICK, "", STRETCHED, [2779.31, 4055.717, 12185.65, 13853.02]),
        (BRICK, LARGE, PRESSED, [1644.252, 2527.841, 9918.115, 12156.31]),  # ccx with *CONTROLS, FIELD 1e-10
        (BRICK, LARGE, STRETCHED, [2779.453, 4055.814, 12185.68, 13853.24]),
        ("hexahedron", LARGE, PRESSED, [2738.694, 3364.593, 12335.05, 17191.59]),
        ("hexahedron", "", TURNING, [2760.798, 3369.601, 12336.54, 17219.6]),
        pytest.param("tetra10", LARGE, PULLED, [1695.649, 2573.912, 10133.63, 12301.85], marks=pytest.mark.slow),
        pytest.param("tetra10", "", HEATED, [1654.057, 2548.833, 10096.74, 12318.28], marks=pytest.mark.slow),
        pytest.param(BRICK, LARGE, PULLING, [1654.323, 2538.985, 9942.455, 12159.46], marks=pytest.mark.slow),
    ],
)
def test_the_modes_are_about_the_static_step_of_the_deck(capsys, cell, law, loads, wanted):
    said = imported(capsys, deck(cell, *static(*loads, law=law), before=COLD if loads is HEATED else ()))
    assert "the modes are about its static state" in said
    np.testing.assert_allclose(hertz(), wanted, rtol=1e-6)


TURN = "*TRANSFORM, NSET=x1, TYPE={}"
OBLIQUE, ROUND = (TURN.format("R"), "1., 1., 0., -1., 1., 0."), (TURN.format("C"), "50., -3., -2., 50., -3., 20.")


@pytest.mark.parametrize(
    ("before", "steps", "wanted"),
    [
        ([*OBLIQUE, "*BOUNDARY", "x1, 1, 1"], [], [1980.193, 10249.32, 11836.22, 19697.16]),
        ([*ROUND, "*BOUNDARY", "x1, 2, 2"], [], [2116.287, 10935.74, 11966.22, 21172.99]),
        (ROUND, static("*CLOAD", "x1, 1, 300.", "x1, 2, 50."), [1670.647, 2550.149, 9962.503, 12169.82]),
        ([*OBLIQUE, "*EQUATION", "2", "49, 1, 1., 53, 1, -0.5"], [], [1679.052, 4844.436, 10177.93, 13273.2]),
    ],
)
def test_supports_loads_and_equations_along_local_directions(capsys, before, steps, wanted):
    imported(capsys, deck(BRICK, *steps, before=before))
    np.testing.assert_allclose(hertz(), wanted, rtol=1e-6)


def test_bricks_of_eight_points_have_their_masses_by_these_too(capsys):
    """CalculiX with C3D20R."""
    imported(capsys, deck(BRICK, cells=(4, 2, 2)).replace("TYPE=C3D20,", "TYPE=C3D20R,"))
    np.testing.assert_allclose(hertz(), [1613.077, 2490.138, 9585.706, 11340.66], rtol=1e-6)


HALF = ["*AMPLITUDE, NAME=A", "0., 0., 1., 0.5"]


@pytest.mark.parametrize(
    ("steps", "before", "pull"),
    [
        (static("*CLOAD", "x1, 1, 300.", "x1, 1, 300."), (), 600),  # in one step they add up
        (static("*CLOAD", "x1, 1, 300.", "*END STEP", *static("*CLOAD", "x1, 1, 150.")[:-1]), (), 150),
        (static("*CLOAD", "x1, 1, 300.", "*END STEP", *static("*CLOAD, OP=NEW", "x1, 3, 1.")[:-1]), (), 0),
        (static("*CLOAD, AMPLITUDE=A", "x1, 1, 300."), HALF, 150),
    ],
)
def test_loads_of_several_steps_and_their_amplitudes(steps, before, pull):
    """As CalculiX takes them: frequencies 1722.188, 1664.115, 1644.159 and 1664.115 Hz are those of one step."""
    Path("a.inp").write_text(deck(BRICK, *steps, before=before))
    state = read_mesh("a.inp", "mm", "mm-t-s").state
    assert state is not None
    along = sum(load.values[load.directions == 0].sum() for load in state.loads)
    np.testing.assert_allclose(along, 8 * pull, rtol=1e-12)


def test_a_displacement_is_taken_back_and_fields_may_be_blank():
    """0.1 mm of the first step is 0 in the second; weight along -z, of a line whose second number is blank."""
    first = static("*BOUNDARY", "x1, 3, 3, 0.1")
    second = static("*BOUNDARY", "x1, 3, 3, 0.", "*DLOAD", "EALL, GRAV, 9810., , 0., -1.")
    Path("a.inp").write_text(deck(BRICK, *first[:-1], "*END STEP", *second))
    state = read_mesh("a.inp", "mm", "mm-t-s").state
    assert state is not None
    (weight,) = state.loads
    np.testing.assert_allclose(weight.acceleration, [0.0, 0.0, -9.81], rtol=1e-12)


@pytest.mark.parametrize(
    ("load", "line"),
    [
        (["*CLOAD", "x1, 9, 1."], 0),
        (["*CLOAD", "nowhere, 1, 1."], 0),
        (["*CLOAD, AMPLITUDE=NONE", "x1, 1, 1."], 0),
        (["*CLOAD", "x1, 1, abc"], 0),
        (["*DLOAD", "EALL, GRAV, 9.81, 0., 0., 0."], 0),
        (["*DLOAD", "EALL, CENTRIF, -4., 0., 0., 0., 0., 0., 1."], 0),
        (["*DSLOAD", "nowhere, P, 1."], 0),
        (["*DLOAD", "gone, P1, 1."], 0),
    ],
)
def test_a_damaged_load_is_refused_with_its_line(capsys, load, line):
    text = deck(BRICK, *static(*load))
    number = text.splitlines().index(load[line]) + 1
    Path("a.inp").write_text(text)
    refused_command(["import", "a.inp", "body"], capsys, f"a.inp, line {number}")
    assert not Path("body").exists()


@pytest.mark.parametrize(
    ("load", "words"),
    [
        (["*DLOAD", "EALL, HP1, 1."], "is not read"),
        (["*DLOAD", "1, CENTRIF, 4.e6, 0., 0., 0., 0., 0., 1."], "[rotation] turns the whole body"),
    ],
)
def test_a_load_that_is_not_taken_is_told(capsys, load, words):
    assert words in imported(capsys, deck(BRICK, *static(*load)))


SPUN = [
    "*NODE", "200, 90., 20., 0.", "*ELEMENT, TYPE=SPRINGA, ELSET=SP", "900, 200, 53", "*SPRING, ELSET=SP", "", "20000.",
]  # fmt: skip


@pytest.mark.parametrize(
    ("law", "wanted"),
    [
        ("", [1865.284, 3965.591, 10324.74, 12334.0]),
        pytest.param(LARGE, [1867.495, 3964.101, 10327.44, 12334.35], marks=pytest.mark.slow),
    ],
)
def test_a_spring_along_a_line_turns_with_it(capsys, law, wanted):
    """F / l across the line, 2 % of the first frequency (ccx with *CONTROLS, FIELD 1e-10 where NLGEOM)."""
    steps = static("*CLOAD", "53, 1, -6000.", law=law)
    imported(capsys, deck(BRICK, "*BOUNDARY", "200, 1, 3", *steps, before=SPUN))
    np.testing.assert_allclose(hertz(), wanted, rtol=1e-6)


def within_modes(*lines: str) -> list[str]:
    return [*MODES[:-1], *lines, MODES[-1]]


ALONG = ["*BOUNDARY", "x1, 1, 1, 0.05", *PULLED[:2], *PRESSED]


@pytest.mark.parametrize(
    ("law", "before", "loads", "modes", "wanted"),
    [
        ("", ["*BOUNDARY", "x0, 1, 3"], PRESSED, ["*BOUNDARY", "x1, 3, 3"], [2533.216, 7283.712, 14182.47, 20783.55]),
        (
            "", [], ["*BOUNDARY", "x0, 1, 3", *PULLED[:2]], ["*BOUNDARY, OP=NEW", "x1, 1, 3"],
            [1684.672, 2558.297, 9979.722, 12179.68],
        ),
        ("", [], ALONG, ["*BOUNDARY, OP=NEW", "x0, 1, 3"], [1848.190, 2665.835, 10190.36, 12147.02]),
        pytest.param(
            LARGE, [], ALONG, ["*BOUNDARY, OP=NEW", "x0, 1, 3"], [1943.225, 2734.283, 10302.70, 12141.28],
            marks=pytest.mark.slow,
        ),
    ],
)  # fmt: skip
def test_the_static_step_has_supports_of_its_own(capsys, law, before, loads, modes, wanted):
    said = imported(
        capsys, deck(BRICK, *before, *static(*loads, law=law), modes=within_modes(*modes))
    )
    assert "held there by" in said
    np.testing.assert_allclose(hertz(), wanted, rtol=1e-6)


RIGID = [
    "*NODE",
    "200, 90., 10., 5.",
    "201, 100., 0., 0.",
    "*RIGID BODY, NSET=x1, REF NODE=200, ROT NODE=201",
]


def pulled(name: str) -> list[str]:
    return ["*DLOAD", f"{name}, GRAV, 5.e7, 1., 0., 0."]


HEAVY = [
    "*ELEMENT, TYPE=MASS, ELSET=MM",
    "910, 53",
    "*MASS, ELSET=MM",
    "2.e-5",
    "*ELSET, ELSET=BOTH",
    "EALL, MM",
]


@pytest.mark.parametrize(
    ("before", "load", "wanted"),
    [
        (RIGID, ["*CLOAD", "201, 1, 2000."], [1644.175, 2532.413, 9933.861, 12160.75]),
        (HEAVY, pulled("EALL"), [912.0861, 1404.333, 7238.898]),
        (HEAVY, pulled("BOTH"), [921.6428, 1410.591, 7254.683]),
        (HEAVY, pulled(""), [921.6428, 1410.591, 7254.683]),
        (HEAVY, pulled("MM"), [916.1278, 1407.019, 7248.831]),
    ],
)  # fmt: skip
def test_moments_of_rigid_bodies_and_the_weight_of_masses(capsys, before, load, wanted):
    """The weight of a mass acts where its element is named."""
    imported(capsys, deck(BRICK, *static(*load), before=before))
    np.testing.assert_allclose(hertz()[: len(wanted)], wanted, rtol=1e-6)
