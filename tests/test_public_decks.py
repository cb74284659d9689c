"""Small decks in the manner of public reports: what `import` takes, what it says, and the
frequencies of CalculiX."""

from __future__ import annotations

import tomllib
from pathlib import Path

import decks
import meshes
import numpy as np
import pytest
import touching
from refusals import refused_command
from test_bdf import bulk
from test_cdb import archive

from microslip.basis import read_basis
from microslip.cli import main
from microslip.data import Mesh
from microslip.mesh import mesh_problems, read_mesh

CLAMPED = [1722.93, 2621.09, 12218.1, 12519.8, 16245.5]
"""Hz, CalculiX 2.20: 60 x 11 x 7 mm of two C3D20, E 205 GPa, nu 0.29, 7830 kg/m3, one end clamped.
"""
STEEL = ["*MATERIAL, NAME=ST", "*ELASTIC", "205000., 0.29", "*DENSITY", "7.83e-9"]
HELD = ["*BOUNDARY", "x0, 1, 3"]


@pytest.fixture(autouse=True)
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def block(cell: str = "hexahedron20", cells=(2, 1, 1), size=(0.06, 0.011, 0.007)) -> Mesh:
    return meshes.brick(cell, cells, size)


def deck(mesh: Mesh, *more: str, sets=("x0",), material=STEEL) -> str:
    lines = [*decks.mesh_lines(mesh, sets=sets), *material, decks.section(material="ST"), *more]
    return "\n".join(lines) + "\n"


def imported(capsys, text: str, *words: str) -> str:
    """What import says of the deck a.inp; its body is the folder ``body``."""
    Path("a.inp").write_text(text)
    assert main(["import", "a.inp", "body", *words]) == 0
    return capsys.readouterr().out


def hertz(folder, name: str = "body", sector: int = 0) -> np.ndarray:
    assert main(["modes", name, "-q", "--set", "modes.solver=superlu"]) == 0
    return read_basis(folder / "build" / name / "basis.h5").groups[0, sector].frequency


def keys(folder, body: str = "body") -> dict:
    return tomllib.loads((folder / body / "body.toml").read_text())


GONE = ["*SURFACE, NAME=GONE", "8888, S1"]


def test_a_set_that_nothing_uses_may_name_nodes_that_are_not_there(tmp_path, capsys):
    text = deck(
        block(), "*NSET, NSET=LEFTOVER", "3, 7, 99999", "*ELSET, ELSET=OLD", "1, 7777", *HELD, *GONE
    )
    said = imported(capsys, text)
    for words in (
        "'LEFTOVER' names node 99999",
        "'OLD' names element 7777",
        "'8888' of the surface 'GONE'",
    ):
        assert words in said
    np.testing.assert_allclose(hertz(tmp_path)[:5], CLAMPED, rtol=5e-6)  # six digits


def test_a_support_without_a_node_that_is_there_is_told(tmp_path, capsys):
    text = deck(block(), "*NSET, NSET=GONE", "88888, 99999", "*BOUNDARY", "GONE, 1, 3")
    said = imported(capsys, text)
    assert "not taken as a support: 'GONE' in xyz: none of its nodes is there" in said
    assert keys(tmp_path)["free"] is True


STATIC = ["*STEP, NLGEOM", "*STATIC", "*CLOAD", "x1, 1, 1125", "*END STEP"]
MODES = ["*STEP{}", "*FREQUENCY", "6", "*END STEP"]


@pytest.mark.parametrize(
    ("steps", "loaded", "words"),
    [
        ([*STATIC, MODES[0].format(", PERTURBATION"), *MODES[1:]], True, "about its static state"),
        # Abaqus takes the load here, CalculiX does not
        ([*STATIC, MODES[0].format(""), *MODES[1:]], False, "stands in no step of PERTURBATION"),
        (
            [STATIC[0].replace(", NLGEOM", ""), *STATIC[1:], MODES[0].format(""), *MODES[1:]],
            False,
            "*CLOAD: loads, which change no frequency",
        ),
        ([MODES[0].format(", PERTURBATION"), *MODES[1:], *STATIC], False, "body.toml: ready"),
    ],
)
def test_modes_are_about_the_static_step_before_them(tmp_path, capsys, steps, loaded, words):
    text = deck(block(), *HELD, *steps, sets=("x0", "x1"))
    assert words in imported(capsys, text)
    assert (read_mesh("a.inp", "mm", "mm-t-s").state is not None) == loaded
    assert ("loads" in keys(tmp_path)) == loaded


HOT = [*STEEL[:2], "205000., 0.29, 20.", "150000., 0.29, 420.", *STEEL[3:], "*EXPANSION", "{}"]
WARM = [
    "*INITIAL CONDITIONS, TYPE=TEMPERATURE",
    "NALL, {}",
    "*STEP",
    "*TEMPERATURE",
    "NALL, {}",
    "*END STEP",
]


def test_a_modulus_over_temperature_is_used_at_the_temperatures_of_the_deck(tmp_path, capsys):
    """1603.21 and 2438.96 Hz by CalculiX; the factor is sqrt(177.5/205)."""
    hot = [line.format("0.") for line in HOT]
    text = deck(block(), *HELD, *WARM[:1], "NALL, 220.", material=hot)
    said = imported(capsys, text)
    assert "temperatures of the file are in force" in said and "a factor of 0.9305" in said
    np.testing.assert_allclose(hertz(tmp_path)[:2], [1603.21, 2438.96], rtol=3e-6)


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ([line.format(220) for line in WARM], "temperatures of the file are in force"),
        ([line.format(20 + 200 * (i > 2)) for i, line in enumerate(WARM)], "they strain the body"),
        ([], "the file says none: that of its first row is taken"),
    ],
)
def test_temperatures_that_strain_the_body_are_left_to_its_owner(tmp_path, capsys, keywords, words):
    text = deck(block(), *HELD, *keywords, material=[line.format("1.2e-5") for line in HOT])
    said = imported(capsys, text)
    assert words in said and "the modulus of ST depends on temperature" in said
    assert ("temperature" in keys(tmp_path)) == ("in force" in words)


CYCLIC = """*SURFACE, NAME=SLO, TYPE=NODE
y0
*SURFACE, NAME=SHI, TYPE=NODE
y1
*TIE, CYCLIC SYMMETRY, POSITION TOLERANCE=0.1, NAME=T1
{0}
*CYCLIC SYMMETRY MODEL, N=12, NGRAPH=1, TIE=T1, ELSET=EALL
0.,0.,0.,{1},0.,0.
*STEP
*FREQUENCY
8
*SELECT CYCLIC SYMMETRY MODES, NMIN=0, NMAX=3
*END STEP"""


def sector() -> Mesh:
    """A twelfth of a ring about x: 0.2 mm wide, radii 0.6 and 1.2 mm."""

    def bend(p: np.ndarray) -> np.ndarray:
        return np.column_stack([p[:, 0], p[:, 2] * np.sin(p[:, 1]), p[:, 2] * np.cos(p[:, 1])])

    low = (0, -np.pi / 12, 0.6e-3)
    return meshes.brick("hexahedron20", (1, 2, 2), (0.2e-3, np.pi / 6, 0.6e-3), low, bend)


@pytest.mark.parametrize(("pair", "axis"), [("SLO,SHI", 1.0), ("SHI,SLO", -2.0)])
def test_a_cyclic_deck_brings_its_sector(tmp_path, capsys, pair, axis):
    """Slave and master in either order, the axis either way: the frequencies of two nodal diameters
    by CalculiX."""
    text = deck(sector(), *CYCLIC.format(pair, axis).splitlines(), sets=("y0", "y1"))
    said = imported(capsys, text)
    assert "is not read" not in said and "one of 12 cyclic sectors" in said
    found = keys(tmp_path)
    assert found["cyclic"]["sectors"] == 12 and found["cyclic"]["nodal_diameters"] == [0, 1, 2, 3]
    # right is ahead of left about the axis, and y1 behind y0 about +x
    assert found["cyclic"]["right"] == ("SLO" if axis > 0 else "SHI")
    assert found["rotation"]["axis"] == [np.sign(axis), 0, 0]
    np.testing.assert_allclose(hertz(tmp_path, sector=2)[:3], [140782, 401182, 888852], rtol=3e-6)
    if axis > 0:
        path = tmp_path / "body" / "body.toml"
        path.write_text(path.read_text().split("[rotation]")[0] + "[modes]\ncount = 8\n")
        capsys.readouterr()
        assert main(["modes", "body"]) == 0
        assert "without [cyclic] its cut faces are free" in "".join(capsys.readouterr())


def test_columns_of_nodal_diameters_stay_apart(capsys):
    text = deck(sector(), *CYCLIC.format("SLO,SHI", 1.0).splitlines(), sets=("y0", "y1"))
    imported(capsys, text)
    assert main(["modes", "body", "--set", "modes.count=10"]) == 0
    (row,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("  k =   2")]
    numbers = row.split("k =   2")[1].split("Hz")[0].split()
    assert numbers[:3] == ["140782", "401182", "888852"] and len(numbers) == 10


def test_no_more_modes_are_asked_for_than_a_small_body_has(tmp_path, capsys):
    """Twelve free directions, of which ten modes can be asked for; a free one has its 24."""
    for number, count in enumerate((10, 20)):
        held = ["SPC1,7,123,1,3,5,7"] if count == 10 else []
        mesh = meshes.brick("hexahedron", (1, 1, 1), (20, 12, 9))
        more = "\n".join(["MAT1,1,205000.,,.29,7.83-9", "PSOLID,1,1", *held, "ENDDATA"])
        text = bulk(mesh).replace("ENDDATA", more)
        text = text.replace("CEND", "CEND\nSPC = 7") if held else text
        (tmp_path / f"a{number}.bdf").write_text(text)
        assert main(["import", f"a{number}.bdf"]) == 0
        assert keys(tmp_path, f"a{number}")["modes"]["count"] == count
        assert len(hertz(tmp_path, f"a{number}")) == count
        assert (f"modes: {count} asked for" in capsys.readouterr().out) == (count < 20)


def two(gap: float = 0.0) -> Mesh:
    """Two blocks that touch, unjoined; faces a_x0 to b_x1."""
    one = block("hexahedron20", (2, 1, 1), (0.04, 0.01, 0.008))
    other = Mesh(one.points + [0.04 + gap, 0, 0], one.cells, one.faces, {}, one.node_id)
    return touching.together(a=one, b=other)


def test_bodies_that_touch_stay_apart(tmp_path, capsys):
    """Each clamped at its far end: CalculiX has every frequency twice; a tear within one part is
    still refused."""
    text = deck(two(), "*BOUNDARY", "a_x0, 1, 3", "b_x1, 1, 3", sets=("a_x0", "b_x1"))
    said = imported(capsys, text)
    assert "8 pairs of points" in said and "neither welded nor in contact" in said
    np.testing.assert_allclose(
        hertz(tmp_path)[:6], np.repeat([4294.67, 5245.33, 19523.2], 2), rtol=3e-6
    )
    mesh = block("hexahedron", (1, 1, 2))
    torn = mesh.cells["hexahedron"].copy()
    torn[1, 0] = mesh.n_points
    points = np.vstack([mesh.points, mesh.points[mesh.cells["hexahedron"][1, 0]]])
    errors, _ = mesh_problems(
        Mesh(points, {"hexahedron": torn}, node_id=np.arange(1, len(points) + 1))
    )
    assert "merge duplicate nodes" in errors[0]


def test_touching_parts_of_a_deck_become_bodies_in_contact(tmp_path, capsys):
    text = deck(two(), "*BOUNDARY", "a_x0, 1, 3", "b_x1, 1, 3", sets=("a_x0", "b_x1"))
    said = imported(capsys, text, "--apart")
    assert "part-1 touches part-2 over 80 mm2" in said
    case = tomllib.loads((tmp_path / "body" / "case.toml").read_text())
    assert [b["name"] for b in case["bodies"]] == ["part-1", "part-2"]
    for part, other in (("part-1", "part-2"), ("part-2", "part-1")):
        assert main(["modes", f"body/{part}", "-q", "--set", "modes.solver=superlu"]) == 0
        basis = read_basis(tmp_path / "build" / f"body-{part}" / "basis.h5")
        np.testing.assert_allclose(basis.groups[0, 0].frequency[:2], [4294.67, 5245.33], rtol=3e-6)
        assert basis.groups[0, 0].interfaces[other].areas.sum() == pytest.approx(80e-6)
    (tmp_path / "one.inp").write_text(deck(block()))
    refused_command(["import", "one.inp", "--apart"], capsys, "there is nothing to set apart")


FACES = {"SMALL": "a_z1", "LARGE": "b_z0", "SIDE": "b_z1"}
SURFACES = [line for n, s in FACES.items() for line in (f"*SURFACE, NAME={n}, TYPE=NODE", s)]
SURFACES += ["*SURFACE INTERACTION, NAME=DRY", "*FRICTION", "0.15"]


def plate_and_block(cells=(1, 1)) -> Mesh:
    """A block of 8 x 10 x 4 mm under a plate of 40 x 10 x 4 mm, in five cells or, of a finer block, in a
    single one whose middle lies beside it."""
    fine = cells != (1, 1)
    small = meshes.brick("hexahedron20", (*cells, 1), (0.008, 0.01, 0.004))
    start = (-0.03 if fine else -0.016, 0, 0.004)
    large = meshes.brick("hexahedron20", (1 if fine else 5, 1, 1), (0.04, 0.01, 0.004), start)
    return touching.together(a=small, b=large)


def paired(mesh: Mesh, *pairs: str) -> str:
    lines = [line for pair in pairs for line in ("*CONTACT PAIR, INTERACTION=DRY", pair)]
    held = ["*BOUNDARY", "a_z0, 1, 3", "b_x0, 1, 3"]
    return deck(mesh, *SURFACES, *lines, *held, sets=("a_z0", "a_z1", "b_z0", "b_z1", "b_x0"))


@pytest.mark.parametrize("cells", [(1, 1), (2, 2)])
def test_a_contact_pair_is_the_same_in_either_order(tmp_path, capsys, cells):
    """Both faces are cut to the facets that touch: 80 mm2 of the large one, or its only facet,
    which is larger."""
    areas, said = [], []
    for name, pair in (("one", "SMALL, LARGE"), ("other", "LARGE, SMALL")):
        (tmp_path / f"{name}.inp").write_text(paired(plate_and_block(cells), pair))
        assert main(["import", f"{name}.inp"]) == 0
        said.append(capsys.readouterr().out)
        sets = ["--set", "modes.solver=superlu", "--set", "modes.count=4", "--set", f"name={name}"]
        assert main(["modes", f"{name}/part-2", "-q", *sets]) == 0
        faces = read_basis(tmp_path / "build" / name / "basis.h5").groups[0, 0].interfaces
        areas += [(key, face.areas.sum()) for key, face in faces.items()]
        case = tomllib.loads((tmp_path / name / "case.toml").read_text())
        assert case["contacts"][0]["normal_stiffness"] == pytest.approx(4e11 * 80e-6)
    cut = cells == (1, 1)
    wanted = ("LARGE-on-SMALL", pytest.approx(80e-6)) if cut else ("LARGE", pytest.approx(400e-6))
    assert areas == [wanted, wanted] and all("80 mm2, friction 0.15" in text for text in said)
    assert all(("of 'LARGE' what touches" in text) == cut for text in said)


def test_no_contact_pair_vanishes(tmp_path, capsys):
    text = paired(plate_and_block(), "SMALL, LARGE", "SIDE, LARGE", "LARGE, SMALL")
    said = imported(capsys, text)
    assert (
        "'SIDE' on 'LARGE': both lie on one body" in said and "'LARGE' on 'SMALL': the pair" in said
    )
    assert len(tomllib.loads((tmp_path / "body" / "case.toml").read_text())["contacts"]) == 1
    (tmp_path / "b.inp").write_text(paired(plate_and_block(), "SIDE, LARGE"))
    assert main(["import", "b.inp"]) == 0
    assert "'SIDE' on 'LARGE': both lie on one body" in capsys.readouterr().out


BOLT = """*NODE, NSET=P
9000, 0., 0., 0.
*PRE-TENSION SECTION, SURFACE=SIDE, NODE=P
*STEP
*STATIC
*CLOAD
P, 1, -800.
*END STEP
"""


def test_numbers_of_a_deck_that_hold_or_press_nothing_are_told(tmp_path, capsys):
    """*BOUNDARY with its last direction below the first, a negative preload; a negative friction is
    refused."""
    pair = paired(plate_and_block(), "SMALL, LARGE")
    text = pair.replace("b_x0, 1, 3", "b_x0, 3, 1") + BOLT
    said = imported(capsys, text)
    assert "not taken as a support: the line 'b_x0, 3, 1' of *BOUNDARY" in said
    assert "the preload -800 N presses nothing together: not used" in said
    case = tomllib.loads((tmp_path / "body" / "case.toml").read_text())
    assert case["sweep"]["normal_forces"] == [1000.0]
    (tmp_path / "b.inp").write_text(pair.replace("\n0.15\n", "\n-0.15\n"))
    refused_command(["import", "b.inp"], capsys, "*FRICTION has the coefficient -0.15")
    assert not (tmp_path / "b").exists()
    more = "*FRICTION, EXPONENTIAL DECAY\n0.15\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n1e6"
    (tmp_path / "c.inp").write_text(pair.replace("*FRICTION\n0.15", more))
    assert main(["import", "c.inp"]) == 0
    said = capsys.readouterr().out
    assert "of *FRICTION only the first" in said and "*SURFACE BEHAVIOR is not read" in said


def test_left_handed_tetrahedra_and_wedges_are_turned(tmp_path):
    """Mirrored numbering, mid-side nodes with it: the same body, and a remark."""
    flips = {
        "tetra": [0, 2, 1, 3],
        "tetra10": [0, 2, 1, 3, 6, 5, 4, 7, 9, 8],
        "wedge": [3, 4, 5, 0, 1, 2],
        "wedge15": [3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8, 12, 13, 14],
    }
    for kind, order in flips.items():
        mesh = meshes.brick(kind, (1, 1, 2), (0.02, 0.01, 0.03), to=meshes.shaken(0.0007))
        cells = mesh.cells[kind].copy()
        cells[::2] = cells[::2][:, order]
        for name, text in (("a.bdf", bulk), ("a.cdb", lambda m: archive(m, scale=1.0))):
            (tmp_path / name).write_text(
                text(Mesh(mesh.points, {kind: cells}, node_id=mesh.node_id))
            )
            read = read_mesh(tmp_path / name, "m")
            assert not mesh_problems(read)[0], (kind, name)
            assert any(
                f"{len(cells[::2])} left-handed cells {kind}" in text for text in read.remarks
            )
            assert sorted(read.cells[kind][0]) == sorted(mesh.cells[kind][0])
