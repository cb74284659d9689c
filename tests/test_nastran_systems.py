"""Nastran's coordinate systems: a deck written in local systems is the deck written in the basic one."""

from __future__ import annotations

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
from microslip.mesh import read_mesh

STEEL = ["MAT1,1,2.05+11,,0.29,7830.", "PSOLID,1,1"]


@pytest.fixture(autouse=True)
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def bulk(mesh: Mesh, *cards: str, cp: str = "", cd: str = "", control: Sequence[str] = ("SPC=7",)) -> str:
    """Free fields with all digits. cp, cd: systems of the coordinates and displacements."""
    lines = ["SOL 103", "CEND", *control, "BEGIN BULK"]
    for number, x in zip(mesh.node_id, mesh.points, strict=True):
        lines.append(f"GRID,{number},{cp},{','.join(f'{v:.17g}' for v in x)},{cd}")
    for kind, cells in mesh.cells.items():
        for number, cell in enumerate(cells, 1):
            words = [number, 1, *(int(mesh.node_id[cell[i]]) for i in ORDER[kind])]
            rows = [",".join(map(str, words[i : i + 8])) for i in range(0, len(words), 8)]
            lines.append(f"{CARD[kind[:3]]}," + ",+\n+,".join(rows))
    return "\n".join([*lines, *STEEL, *cards, "ENDDATA"]) + "\n"


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
