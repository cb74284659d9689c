"""Nastran's coordinate systems: a deck written in local systems is the deck written in the basic one."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

import meshes
import numpy as np
import pytest
from refusals import refused_command
from test_bdf import CARD, ORDER

from microslip.basis import read_basis
from microslip.cli import main
from microslip.data import Mesh
from microslip.elasticity import isotropic, turned, turned_strain
from microslip.mesh import read_mesh
from microslip.mesh.materials import NONE, Substitute, orthotropic_row
from microslip.topology import CELL_TYPES

STEEL = ("MAT1,1,2.05+11,,0.29,7830.", "PSOLID,1,1")


@pytest.fixture(autouse=True)
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def bulk(
    mesh: Mesh,
    *cards: str,
    cp: str = "",
    cd: str = "",
    control: Sequence[str] = ("SPC=7",),
    material: Sequence[str] = STEEL,
) -> str:
    """Free fields with all digits. cp, cd: systems of the coordinates and displacements."""
    lines = ["SOL 103", "CEND", *control, "BEGIN BULK"]
    for number, x in zip(mesh.node_id, mesh.points, strict=True):
        lines.append(f"GRID,{number},{cp},{','.join(f'{v:.17g}' for v in x)},{cd}")
    for kind, cells in mesh.cells.items():
        for number, cell in enumerate(cells, 1):
            words = [number, 1, *(int(mesh.node_id[cell[i]]) for i in ORDER[kind])]
            rows = [",".join(map(str, words[i : i + 8])) for i in range(0, len(words), 8)]
            lines.append(f"{CARD[kind[:3]]}," + ",+\n+,".join(rows))
    return "\n".join([*lines, *material, *cards, "ENDDATA"]) + "\n"


def block(to: Callable | None = None) -> Mesh:
    return meshes.brick("hexahedron20", (3, 1, 1), (0.06, 0.011, 0.007), to=to)


def hertz(text: str, name: str = "a") -> np.ndarray:
    """Frequencies of a deck as it is imported."""
    Path(f"{name}.bdf").write_text(text)
    assert main(["import", f"{name}.bdf", name, "--unit", "m"]) == 0
    assert main(["modes", name, "-q", "--set", "modes.solver=superlu", "--set", "modes.count=8"]) == 0
    return read_basis(Path("build") / name / "basis.h5").groups[0, 0].frequency


def card(name: str, number: int, within: int, *points) -> str:
    """CORD2 through three points in another system."""
    numbers = [f"{v:.17g}" for point in points for v in point]
    return f"{name},{number},{within or ''},{','.join(numbers[:6])},+\n+,{','.join(numbers[6:])}"


# 5 is cylindrical in 4, which is spherical in 3, which is rectangular in the basic one: closed forms of each

C, S = np.cos(np.radians(30)), np.sin(np.radians(30))
CHAIN = [
    card("CORD2C", 5, 4, (0.2, 90.0, 90.0), (0.2 * 2**0.5, 45.0, 90.0), (0.3, 90.0, 90.0)),
    card("CORD2S", 4, 3, (0.0, 0.0, 0.1), (0.0, 0.0, 1.0), (1.0, 0.0, 0.1)),
    card("CORD2R", 3, 0, (0.5, 0.0, 0.0), (0.5, 0.0, 1.0), (0.5 + C, S, 0.0)),
]
"""3: turned by 30 degrees about z at x = 0.5. 4: as 3 but 0.1 higher. 5: its origin at y = 0.2 of 4,
its z axis along z there, its x axis along y there."""
ROTATION = np.array([[-S, C, 0.0], [-C, -S, 0.0], [0.0, 0.0, 1.0]])
ORIGIN = np.array([0.5 - 0.2 * S, 0.2 * C, 0.1])


def polar(x: np.ndarray) -> np.ndarray:
    return np.column_stack([np.hypot(x[:, 0], x[:, 1]), np.degrees(np.arctan2(x[:, 1], x[:, 0])), x[:, 2]])


def spherical(x: np.ndarray) -> np.ndarray:
    size = np.linalg.norm(x, axis=1)
    with np.errstate(invalid="ignore"):
        theta = np.degrees(np.arccos(np.where(size > 0, x[:, 2] / size, 1.0)))
    return np.column_stack([size, theta, np.degrees(np.arctan2(x[:, 1], x[:, 0]))])


def test_coordinates_in_chained_systems_are_those_of_the_basic_one():
    mesh = block(lambda x: x + 0.03)
    local = Mesh(polar((mesh.points - ORIGIN) @ ROTATION.T), mesh.cells, node_id=mesh.node_id)
    Path("a.bdf").write_text(bulk(local, *CHAIN, cp="5"))
    np.testing.assert_allclose(read_mesh("a.bdf", "m").points, mesh.points, atol=1e-15)
    ball = Mesh(spherical(mesh.points), mesh.cells, node_id=mesh.node_id)
    system = card("CORD2S", 9, 0, (0, 0, 0), (0, 0, 1), (1, 0, 0))
    Path("a.bdf").write_text(bulk(ball, system, "GRDSET,,9"))
    np.testing.assert_allclose(read_mesh("a.bdf", "m").points, mesh.points, atol=1e-15)


def test_a_system_through_grid_points(tmp_path):
    """CORD1R has two systems a card; a grid point that names 0 is not one of GRDSET."""
    mesh = block()
    cards = ["GRID,901,0,0.,0.,0.", "GRID,902,0,0.,0.,1.", "GRID,903,0,0.,1.,0.", "GRID,904,0,1.,0.,0."]
    cards += ["CORD1R,1,901,902,904,2,901,902,903", "GRDSET,,2"]
    turned = Mesh(mesh.points @ [[0, -1, 0], [1, 0, 0], [0, 0, 1]], mesh.cells, node_id=mesh.node_id)
    Path("a.bdf").write_text(bulk(turned, *cards))
    np.testing.assert_allclose(read_mesh("a.bdf", "m").points, mesh.points, atol=1e-15)


CONTROL = ("SPC=7", "MPC=5")


def constrained(mesh: Mesh, node: int) -> list[str]:
    """Supports of one direction each, an equation, a rigid and a mean link in directions of CD."""
    at = {name: mesh.node_id[near] for name, near in ends(mesh).items()}
    tip = at["tip"].tolist()
    return [
        f"SPC1,7,12,{','.join(map(str, at['root'][:6]))}",
        f"SPC1,7,3,{','.join(map(str, at['root'][:3]))}",
        f"MPC,5,{tip[0]},1,1.0,{tip[1]},2,0.5",
        f"RBE2,60,{node},13,{tip[2]},{tip[3]}",
        f"RBE3,61,,{node + 1},13,1.0,123,{','.join(map(str, tip[4:]))}",
        f"RBE2,62,{node + 1},123,{tip[1]}",
    ]


def ends(mesh: Mesh) -> dict[str, np.ndarray]:
    x = mesh.points[:, 0]
    return {"root": np.flatnonzero(x < 1e-9), "tip": np.flatnonzero(x > 0.06 - 1e-9)}


def test_constraints_in_turned_systems_are_those_of_the_body_turned_back(tmp_path):
    """The whole deck turned, CD with it: supports, MPC, RBE2 and RBE3 along directions of CD."""
    mesh, (free, mean) = block(), ((0.07, 0.0, 0.0), (0.065, 0.005, 0.01))
    cards = constrained(mesh, 900)
    points = [f"GRID,{900 + i},{{cp}},{','.join(map(str, p))},{{cp}}" for i, p in enumerate((free, mean))]
    plain = hertz(bulk(mesh, *cards, *(p.format(cp="") for p in points), control=CONTROL), "plain")
    axes = np.linalg.qr(np.array([[1.0, 2.0, -0.3], [0.2, 1.0, 3.0], [1.0, 1.0, 1.0]]))[0]
    axes *= np.sign(np.linalg.det(axes))
    skew = card("CORD2R", 3, 0, (0.1, 0.2, 0.3), axes[2] + [0.1, 0.2, 0.3], axes[0] + [0.1, 0.2, 0.3])
    local = [p.format(cp="3") for p in points]
    turned = hertz(bulk(mesh, skew, *cards, *local, cp="3", cd="3", control=CONTROL), "turned")
    np.testing.assert_allclose(turned, plain, rtol=1e-9)
    assert plain[0] > 100


def quarter(x: np.ndarray) -> np.ndarray:
    """A block as a part of a ring of radius 0.1 to 0.111 m, 0.007 m high."""
    angle = 1.3 - x[:, 0] / 0.06 * 1.1
    r = 0.1 + x[:, 1]
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), x[:, 2]])


CYLINDER = card("CORD2C", 4, 0, (0, 0, 0), (0, 0, 1), (1, 0, 0))


def curved() -> tuple[Mesh, list[int], list[int]]:
    """A part of a ring, grid points of its two ends."""
    flat, mesh = block(), block(quarter)
    return mesh, *(mesh.node_id[at].tolist() for at in ends(flat).values())


def test_supports_along_radius_and_circumference():
    """CalculiX 2.20, *TRANSFORM, TYPE=C, the same nodes and supports: see `transformed`."""
    mesh, root, tip = curved()
    cards = [f"SPC1,7,23,{','.join(map(str, root))}", f"SPC1,7,1,{','.join(map(str, tip))}"]
    found = hertz(bulk(mesh, CYLINDER, *cards, cd="4"))
    np.testing.assert_allclose(found[:5], CALCULIX, rtol=1e-6)


CALCULIX = [210.4788, 495.5865, 2789.289, 4299.959, 10208.46]


def transformed() -> str:
    """The deck of CalculiX whose frequencies are above."""
    mesh, root, tip = curved()
    lines = ["*NODE, NSET=NALL"]
    lines += [f"{n}, {', '.join(f'{v:.15g}' for v in x)}" for n, x in zip(mesh.node_id, mesh.points, strict=True)]
    lines.append("*ELEMENT, TYPE=C3D20, ELSET=EALL")
    order = [*range(12), *range(12, 20)]
    for number, cell in enumerate(mesh.cells["hexahedron20"], 1):
        words = [number, *(mesh.node_id[cell[i]] for i in order)]
        lines += [", ".join(map(str, words[:11])) + ",", ", ".join(map(str, words[11:]))]
    lines += ["*MATERIAL, NAME=ST", "*ELASTIC", "2.05e11, 0.29", "*DENSITY", "7830."]
    lines += ["*SOLID SECTION, ELSET=EALL, MATERIAL=ST", "*TRANSFORM, NSET=NALL, TYPE=C", "0,0,0,0,0,1"]
    lines.append("*BOUNDARY")
    lines += [f"{n}, 2, 3" for n in root] + [f"{n}, 1, 1" for n in tip]
    return "\n".join([*lines, "*STEP", "*FREQUENCY", "8", "*END STEP"]) + "\n"


@pytest.mark.parametrize(
    ("cards", "words"),
    [
        ([card("CORD2R", 3, 0, (0, 0, 0), (0, 0, 1), (0, 0, 2))], "CORD2R 3 has three points on a line"),
        ([card("CORD2R", 3, 4, (0, 0, 0), (0, 0, 1), (1, 0, 0))], "coordinate system 4, which no CORD"),
        (
            [
                card("CORD2R", 3, 4, (0, 0, 0), (0, 0, 1), (1, 0, 0)),
                card("CORD2C", 4, 3, (0, 0, 0), (0, 0, 1), (1, 0, 0)),
            ],
            "in a circle (3 in 4 in 3)",
        ),
        (["CORD1R,3,1,2,3"], "in a circle (3 in 3)"),
        (["GRID,901,0,0.,0.,0.", "CORD1R,3,901,901,99999"], "names grid point 99999, which is not there"),
        (["CORD2R,3,,0.,x,0.,0.,0.,1.,+", "+,1.,0.,0."], "holds 'X' where a number"),
    ],
)
def test_systems_that_are_none_are_refused_with_their_line(cards, words, capsys):
    Path("a.bdf").write_text(bulk(block(), *cards, cp="3"))
    refused_command(["import", "a.bdf", "b"], capsys, words, "a.bdf, line ")


def read(*material: str, instead: Substitute = NONE, **more) -> Mesh:
    Path("a.bdf").write_text(bulk(block(), material=material, **more))
    return read_mesh("a.bdf", "m", "m-kg-s", instead=instead)


E, NU, G = 2.05e11, 0.29, 2.05e11 / 2.58
LAME = 2 * G * NU / (1 - 2 * NU)


@pytest.mark.parametrize(
    "card",
    [
        f"MAT1,1,{E},,0.29,7830.",
        f"MAT1,1,{E},{G},,7830.",
        f"MAT1,1,,{G},0.29,7830.",
        f"MAT9,1,{LAME + 2 * G},{LAME},{LAME},,,,{LAME + 2 * G},+\n+,{LAME},,,,{LAME + 2 * G},,,,+\n"
        f"+,{G},,,{G},,{G},7830.",
        f"MAT11,1,{E},{E},{E},0.29,0.29,0.29,{G},+\n+,{G},{G},7830.",
    ],
)
def test_every_form_of_an_isotropic_material_is_the_same(card):
    (material,) = read(card, "PSOLID,1,1").materials
    np.testing.assert_allclose(material.elasticity, isotropic(E, NU), rtol=1e-9, atol=1e-3)
    assert material.density == 7830


ORTHO = "MAT11,1,1.4+11,1.+10,2.+10,.3,.25,.4,5.+9,+\n+,6.+9,4.+9,1600.,1.-6,2.-5,3.-5"
NINE = np.array([1.4e11, 1e10, 2e10, 0.3, 0.25, 0.4, 5e9, 6e9, 4e9])


def test_a_material_has_the_directions_of_its_property():
    """CORDM: Hooke's matrix and the expansions of MAT11, and of MAT9, turned into body axes."""
    (material,) = read(ORTHO, "PSOLID,1,1,3", *CHAIN).materials
    axes = np.array([[C, S, 0.0], [-S, C, 0.0], [0.0, 0.0, 1.0]])
    plain = orthotropic_row("", NINE)
    np.testing.assert_allclose(material.elasticity, turned(plain, axes), rtol=1e-9, atol=1e-3)
    np.testing.assert_allclose(material.expansion, turned_strain([1e-6, 2e-5, 3e-5], axes), rtol=1e-9)
    words = [f"{v:.17g}" for v in plain[np.triu_indices(6)]] + ["1600.", "1.-6", "2.-5", "3.-5"]
    nine = "MAT9,1," + ",+\n+,".join(",".join((["1", *words])[i : i + 8]) for i in (0, 8, 16, 24))
    nine = nine.replace("MAT9,1,1,", "MAT9,1,")
    (same,) = read(nine, "PSOLID,1,1,3", *CHAIN).materials
    np.testing.assert_allclose(same.elasticity, material.elasticity, rtol=1e-9, atol=1e-3)
    np.testing.assert_allclose(same.expansion, material.expansion, rtol=1e-9)


@pytest.mark.parametrize("property_", ["PSOLID,1,1,-1", "PSOLID,1,1,5", "PCOMPS,1"])
def test_directions_that_turn_from_cell_to_cell_are_refused_until_others_are_asked_for(property_, capsys):
    Path("a.bdf").write_text(bulk(block(), *CHAIN, material=(ORTHO, property_)))
    refused_command(["import", "a.bdf", "b", "--unit", "m"], capsys, "a.bdf", "--young")
    assert main(["import", "a.bdf", "b", "--unit", "m", "--young", "7e10", "--density", "1600"]) == 0
    assert main(["modes", "b", "-q", "--set", "modes.solver=superlu"]) == 0


def test_fluid_cells_beside_a_structure_are_left_out_and_counted(capsys):
    mesh = block()
    text = bulk(mesh, "MAT10,2,2.2+9,1000.", "PSOLID,2,2,,,,,PFLUID")
    Path("a.bdf").write_text(text.replace("CHEXA,3,1,", "CHEXA,3,2,"))
    assert main(["import", "a.bdf", "b", "--unit", "m"]) == 0
    assert "its 1 cells are a fluid and are left out" in capsys.readouterr().out
    assert sum(map(len, read_mesh("a.bdf", "m").cells.values())) == 2


def test_a_weight_is_turned_into_a_mass():
    (material,) = read("MAT1,1,3.+7,,.3,.283", "PSOLID,1,1", "PARAM,WTMASS,0.5").materials
    assert material.density == pytest.approx(0.1415)


def test_a_mean_motion_by_single_directions_turns_with_its_body(capsys):
    """RBE3 by two directions of some points and one of others, the deck turned with its CD; points
    that tell too little are refused."""
    mesh = block()
    tip = mesh.node_id[ends(mesh)["tip"]].tolist()
    root = ",".join(map(str, mesh.node_id[ends(mesh)["root"]].tolist()))
    few = f"RBE3,61,,900,123,1.0,12,{tip[4]},{tip[5]}"
    cards = [f"SPC1,7,123,{root}", "SPC1,7,13,900"]
    whole = f"{few},+\n+,0.5,3,{tip[6]},{tip[7]},{tip[2]},1.0,1,{tip[0]}"
    grid, free = "GRID,900,{0},0.065,0.005,0.01,{0}", hertz(bulk(mesh, cards[0]), "free")
    plain = hertz(bulk(mesh, *cards, whole, grid.format("")), "plain")
    skew = card("CORD2R", 3, 0, (0, 0, 0), (1, 2, 2), (2, 1, -2))
    turned = hertz(bulk(mesh, skew, *cards, whole, grid.format("3"), cp="3", cd="3"), "turned")
    np.testing.assert_allclose(turned, plain, rtol=1e-9)
    assert (plain[:2] > 1.05 * free[:2]).all()
    Path("a.bdf").write_text(bulk(mesh, *cards, few, grid.format("")))
    refused_command(["import", "a.bdf", "b"], capsys, "RBE3 61", "do not tell all of its motion")


@pytest.mark.parametrize("kind", ["hexahedron20", "tetra10", "wedge15"])
def test_a_cell_that_leaves_out_mid_side_nodes_has_straight_edges(kind):
    """All but one left out by one cell, which is no edge of others: the body of the first-order cell,
    with the equation written by hand in the whole one."""
    mesh = meshes.brick(kind, (1, 1, 1), (0.06, 0.011, 0.007))
    cell = mesh.cells[kind][0]
    text = bulk(mesh, "SPC1,7,123,1,2,3,4")
    edge, gone = CELL_TYPES[kind].edges[0], mesh.node_id[cell[CELL_TYPES[kind].corners]]
    a, b = (mesh.node_id[cell[i]] for i in edge[:2])
    ways = [f"MPC,5,{gone},{w},1.0,{a},{w},-0.5,+\n+,,{b},{w},-0.5" for w in (1, 2, 3)]
    control = ("SPC=7", "MPC=5")
    by_hand = hertz(bulk(mesh, "SPC1,7,123,1,2,3,4", *ways, control=control), "hand")
    head, body = text.split("BEGIN BULK")
    grid, cells = body[: body.index(f"{CARD[kind[:3]]},")], body[body.index(f"{CARD[kind[:3]]},") :]
    cells = re.sub(rf"(?<=,){gone}(?=[,\n])", "", cells)
    left = hertz(f"{head}BEGIN BULK{grid}{cells}", "left")
    np.testing.assert_allclose(left, by_hand, rtol=1e-9)


def test_a_rotation_alone_is_held_at_a_reference_node():
    """RBE2 from a point that may not turn about x: torsion of the end is held, of the free one not."""
    mesh = block()
    root, tip = (",".join(map(str, mesh.node_id[at].tolist())) for at in ends(mesh).values())
    cards = [f"SPC1,7,123,{root}", "GRID,900,,0.06,0.0055,0.0035", f"RBE2,60,900,123,{tip}"]
    free, held = (hertz(bulk(mesh, *cards, *more), name) for more, name in (((), "free"), (["SPC1,7,4,900"], "held")))
    bending = [i for i, f in enumerate(free[:6]) if np.abs(held / f - 1).min() < 1e-6]
    assert len(bending) < 6 and len(bending) >= 4
