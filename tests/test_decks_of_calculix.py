"""Small decks that mix what decks hold, with the frequencies of CalculiX 2.20 beside them (seven digits)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import decks
import meshes
import numpy as np
import pytest
from refusals import refused_command

from microslip.basis import read_basis
from microslip.cli import main
from microslip.data import Mesh

PLAIN = ["*ELASTIC", "205000., 0.29"]
HOT = ["*ELASTIC", "205000., 0.29, 20.", "150000., 0.34, 420."]
WOOD = [
    "*ELASTIC, TYPE=ENGINEERING CONSTANTS",
    "200000., 150000., 100000., 0.3, 0.25, 0.2, 70000., 60000.,",
    "50000., 20.",
    "100000., 120000., 70000., 0.25, 0.2, 0.2, 50000., 30000.,",
    "45000., 420.",
]
GROWS = [
    "*EXPANSION, ZERO=-100., TYPE=ORTHO",
    "1.e-5, 1.2e-5, 0.8e-5, 20.",
    "2.e-5, 2.4e-5, 1.6e-5, 420.",
]
EVEN = ["*EXPANSION", "1.2e-5"]
COLD = ["*INITIAL CONDITIONS, TYPE=TEMPERATURE", "NALL, 50."]
WARM = ["*TEMPERATURE", "NALL, 120.", "x1, 330."]
TILTED = ["*ORIENTATION, NAME=OR", "1., 0.4, 0.1, -0.2, 1., 0.3", "3, 25."]
SPUN = ["*DLOAD", "EALL, CENTRIF, 4.e5, 0., -50., 0., 0., 0., 1."]
PULLED = ["*DLOAD", "EALL, GRAV, 5.e6, 0., 0.6, 0.8"]
HALF = ["*AMPLITUDE, NAME=A", "0., 0., 1., 0.5"]
LAYERS = ["*DLOAD, AMPLITUDE=A", "EALL, P1, 20."]  # between cells, too
BOLT = [
    "*NODE",
    "900, 99., 0., 0.",
    "*SURFACE, NAME=CUT",
    "2, S4",
    "*PRE-TENSION SECTION, SURFACE=CUT, NODE=900",
]
ENDS = ["*BOUNDARY", "x0, 1, 3", "x1, 1, 3"]
CLAMPED = ["*BOUNDARY", "x0, 1, 3"]
BRICK = "hexahedron20"


def deck(
    cell=BRICK,
    cells=None,
    *,
    model=(),
    elastic=PLAIN,
    grows=EVEN,
    before=(),
    axes="",
    held=CLAMPED,
    loads=(),
    law="",
) -> str:
    """60 x 11 x 7 mm; the modes are about what acts in a static step, if anything does."""
    cells = cells or ((4, 1, 1) if cell == BRICK else (4, 2, 2))
    mesh = meshes.brick(cell, cells, (0.06, 0.011, 0.007))
    lines = decks.mesh_lines(mesh, sets=("x0", "x1"))
    lines += [*model, "*MATERIAL, NAME=ST", *elastic, "*DENSITY", "7.83e-9", *grows, *before]
    lines += [decks.section(material="ST", orientation=axes), *held]
    lines += [f"*STEP{law}", "*STATIC", *loads, "*END STEP"] if loads else []
    return "\n".join(
        [*lines, f"*STEP{', PERTURBATION' * bool(loads)}", "*FREQUENCY", "6", "*END STEP", ""]
    )


def spring(a: int, b: int) -> list[str]:
    axes = ["*ORIENTATION, NAME=SPO", "1., 1., 0., 0., 1., 1."]
    element = ["*ELEMENT, TYPE=SPRING2, ELSET=SP", f"6001, {a}, {b}"]
    return [*axes, *element, "*SPRING, ELSET=SP, ORIENTATION=SPO", "1, 3", "5000."]


def mass(node: int) -> list[str]:
    return ["*ELEMENT, TYPE=MASS, ELSET=MM", f"5001, {node}", "*MASS, ELSET=MM", "1.e-5"]


SMALL: dict[str, tuple[dict, list[float]]] = {
    "wedges, a spring in axes of its own": (
        {"cell": "wedge", "model": spring(40, 44), "before": COLD},
        [2376.672, 6838.873, 14198.09, 21955.17],
    ),
    "tetrahedra that turn": (
        {"cell": "tetra", "loads": SPUN},
        [4077.346, 4755.057, 22073.04, 23179.52],
    ),
    "bricks heated unevenly": (
        {"cell": "hexahedron", "elastic": HOT, "before": COLD, "loads": WARM},
        [2603.418, 3205.309, 11855.44, 16330.42],
    ),
    "moduli and expansion over temperature": (
        {"elastic": HOT, "grows": GROWS, "before": COLD, "loads": WARM},
        [1593.947, 2454.65, 9624.933, 11695.76],
    ),
    "axes of the material": (
        {"elastic": WOOD, "grows": GROWS, "before": [*COLD, *TILTED], "axes": "OR", "loads": WARM},
        [1426.725, 2213.094, 8548.816, 10371.67],
    ),
    "stressed while cold": (
        {"before": [*COLD, "x1, 100."], "loads": WARM[:2]},
        [1645.213, 2534.171, 9941.523, 12167.77],
    ),
    "pressure between layers": (
        {"cell": "hexahedron", "before": HALF, "loads": LAYERS},
        [2694.921, 3309.362, 12337.42, 16983.76],
    ),
    "masses and gravity": (
        {"cells": (3, 2, 2), "model": mass(40), "loads": PULLED},
        [1620.139, 2493.983, 8689.85, 11049.56],
    ),
    "a bolt under force": (
        {"model": BOLT, "held": ENDS, "loads": ["*CLOAD", "900, 1, 3000."]},
        [10328.70, 14363.46, 24621.20, 27071.25],
    ),
    "a bolt that is shortened": (
        {"model": BOLT, "held": ENDS, "loads": ["*BOUNDARY", "900, 1, 1, 0.02"], "law": ", NLGEOM"},
        [10344.82, 14374.48, 24625.93, 27093.36],
    ),
}
SLOW = ("moduli and expansion over temperature", "axes of the material", "a bolt that is shortened")


@pytest.fixture(autouse=True)
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def hertz(text: str, sector: int = 0) -> np.ndarray:
    Path("a.inp").write_text(text)
    assert main(["import", "a.inp", "body"]) == 0
    assert (
        main(["modes", "body", "-q", "--set", "modes.solver=superlu", "--set", "modes.count=4"])
        == 0
    )
    return read_basis(Path("build/body/basis.h5")).groups[0, sector].frequency


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n in SLOW else n for n in SMALL]
)
def test_the_frequencies_are_those_of_calculix(name):
    given, wanted = SMALL[name]
    np.testing.assert_allclose(hertz(deck(**given)), wanted, rtol=1e-6)


def sector(cell: str, sectors: int) -> tuple[Mesh, dict[str, np.ndarray]]:
    """A disc of 30 to 60 mm, 12 mm thick, in mm, and nodes of its faces."""
    mesh = meshes.brick(cell, (2, 2, 1), (1.0, 1.0, 1.0))
    p = mesh.points
    r, a = 30 + 30 * p[:, 0], 2 * np.pi / sectors * (p[:, 1] - 0.5)
    round_ = replace(mesh, points=np.column_stack([r * np.cos(a), r * np.sin(a), 12 * p[:, 2]]))
    right = p[:, 1] == 1
    sets = {
        "BORE": (p[:, 0] == 0) & ~right,
        "RIM": (p[:, 0] == 1) & ~right,
        "LEFT": p[:, 1] == 0,
        "RIGHT": right,
    }
    return round_, sets


@pytest.mark.parametrize(
    ("held", "loads", "within", "wanted"),
    [
        (["BORE, 1, 3"], ["*DLOAD", "EALL, P2, 5."], [], [10594.54, 32220.52, 32958.61, 46707.40]),
        (
            ["BORE, 3, 3", "RIM, 1, 1"],
            ["*CLOAD", "RIM, 3, 20."],
            [],
            [9880.393, 36432.08, 37447.12, 43896.35],
        ),
        (
            ["BORE, 1, 3"],
            ["*DLOAD", "EALL, CENTRIF, 4.e6, 0., 0., 0., 0., 0., 1."],
            ["*BOUNDARY", "RIM, 3, 3"],
            [32279.97, 36750.01, 46874.74, 60149.45],
        ),
    ],
)
def test_a_loaded_sector_held_on_one_cut_face_alone(held, loads, within, wanted):
    """Nodal diameter 2; CalculiX holds the independent face, which the other follows."""
    np.testing.assert_allclose(hertz(sector_deck(held, loads, within), 2), wanted, rtol=1e-6)


def sector_deck(held: list[str], loads: list[str], within: list[str]) -> str:
    mesh, sets = sector(BRICK, 8)
    lines, ids = decks.mesh_lines(mesh, scale=1.0), np.array(decks.ids(mesh))
    for name, chosen in sets.items():
        lines += [f"*NSET, NSET={name}", *(f"{i}," for i in ids[chosen])]
    lines += ["*SURFACE, NAME=SL, TYPE=NODE", "LEFT,", "*SURFACE, NAME=SR, TYPE=NODE", "RIGHT,"]
    lines += ["*TIE, NAME=T1, CYCLIC SYMMETRY, POSITION TOLERANCE=1.", "SR, SL"]
    lines += ["*CYCLIC SYMMETRY MODEL, N=8, TIE=T1, NGRAPH=1", "0., 0., 0., 0., 0., 1."]
    lines += [
        "*MATERIAL, NAME=ST",
        *PLAIN,
        "*DENSITY",
        "7.83e-9",
        decks.section(material="ST"),
        "*BOUNDARY",
        *held,
    ]
    lines += [
        "*STEP",
        "*STATIC",
        *loads,
        "*END STEP",
        "*STEP, PERTURBATION",
        "*FREQUENCY",
        "8",
        *within,
    ]
    return "\n".join([*lines, "*SELECT CYCLIC SYMMETRY MODES, NMIN=2, NMAX=2", "*END STEP", ""])


GRID = [
    "*NODE",
    "1, 0., 0., 0.",
    "3, 0., 11., 0.",
    "7, 0., 0., 7.",
    "9, 0., 11., 7.",
    "801, 60., 0., 0.",
    "803, 60., 11., 0.",
    "807, 60., 0., 7.",
    "809, 60., 11., 7.",
    "*NGEN, NSET=L1",
    "1, 3",
    "*NGEN, NSET=L2",
    "7, 9",
    "*NFILL, NSET=x0",
    "L1, L2, 2, 3",
    "*NGEN, NSET=R1",
    "801, 803",
    "*NGEN, NSET=R2",
    "807, 809",
    "*NFILL, NSET=x1",
    "R1, R2, 2, 3",
    "*NFILL, NSET=NALL",
    "x0, x1, 8, 100",
    "*ELEMENT, TYPE=C3D8",
    "1, 1, 101, 102, 2, 4, 104, 105, 5",
    "*ELGEN, ELSET=EALL",
    "1, 8, 100, 10, 2, 1, 100, 2, 3, 1000",
]


def test_generated_nodes_and_cells_are_those_written_out():
    written = deck("hexahedron", (8, 2, 2))
    generated = "\n".join([*GRID, written[written.index("*MATERIAL") :]])
    whole = hertz(written)
    Path("body").rename("first")
    np.testing.assert_allclose(hertz(generated), whole, rtol=1e-9)


def test_a_copy_in_a_mirror_is_the_other_half():
    half = [
        "*NODE, NSET=H",
        "1, 0., 0., 0.",
        "2, 30., 0., 0.",
        "3, 30., 11., 0.",
        "4, 0., 11., 0.",
        "5, 0., 0., 7.",
        "6, 30., 0., 7.",
        "7, 30., 11., 7.",
        "8, 0., 11., 7.",
        "*ELEMENT, TYPE=C3D8, ELSET=A",
        "1, 1, 2, 3, 4, 5, 6, 7, 8",
        "*NSET, NSET=x0",
        "1, 4, 5, 8",
        "*NCOPY, OLD SET=H, CHANGE NUMBER=10, REFLECT=MIRROR",
        "30., 0., 0., 30., 1., 0., 30., 0., 1.",
        "*ELCOPY, OLD SET=A, ELEMENT SHIFT=1, SHIFT NODES=10, NEW SET=B, REFLECT",
        "*ELSET, ELSET=EALL",
        "A, B",
        "*EQUATION",
    ]
    for node in (2, 3, 6, 7):
        half += [
            line
            for way in (1, 2, 3)
            for line in ("2", f"{node + 10}, {way}, 1., {node}, {way}, -1.")
        ]
    written = deck("hexahedron", (2, 1, 1))
    whole = hertz(written)
    Path("body").rename("first")
    np.testing.assert_allclose(
        hertz("\n".join([*half, written[written.index("*MATERIAL") :]])), whole, rtol=1e-9
    )


def said_of(capsys, text: str) -> str:
    Path("a.inp").write_text(text)
    assert main(["import", "a.inp", "body"]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"model": [*mass(500), "*NODE", "500, 5., 5., 99."]}, "are left out: 1"),
        (
            {"model": ["*NODE", "500, 5., 5., 99."], "held": [*CLAMPED, "500, 1, 3"]},
            "so it holds nothing",
        ),
        (
            {"before": COLD, "loads": WARM, "law": ", NLGEOM"},
            "heat stretches the body by up to 0.0034",
        ),
        ({"before": ["*PLASTIC", "300., 0."], "loads": PULLED}, "*PLASTIC is not read"),
        ({"model": mass(53), "loads": SPUN}, "point masses turn with the body"),
    ],
)
def test_what_is_taken_otherwise_is_told(capsys, given, words):
    assert words in said_of(capsys, deck(**given))


def test_heat_with_finite_displacements_is_that_of_calculix_but_for_its_moduli(capsys):
    """CalculiX raises all moduli by 1 + alpha dT = 1.0012 in Green's strain: 1645.651 and 2534.920 Hz."""
    uniform = ["*TEMPERATURE", "NALL, 150."]
    found = hertz(deck(before=COLD, loads=uniform, law=", NLGEOM"))
    np.testing.assert_allclose(found[:2] * 1.0012**0.5, [1645.651, 2534.920], rtol=1e-6)


def test_shells_that_hang_by_a_tie_alone_stop_an_import(capsys):
    shell = [
        "*NODE",
        "500, 60., 20., 0.",
        "501, 60., 20., 7.",
        "502, 60., 30., 0.",
        "503, 60., 30., 7.",
    ]
    shell += [
        "*ELEMENT, TYPE=S4, ELSET=SH",
        "900, 500, 501, 503, 502",
        "*SURFACE, NAME=A, TYPE=NODE",
        "x1",
    ]
    shell += ["*SURFACE, NAME=B", "SH, SPOS", "*TIE, NAME=T, POSITION TOLERANCE=20.", "A, B"]
    Path("a.inp").write_text(deck(model=shell))
    refused_command(["import", "a.inp", "body"], capsys, "1 S4 share nodes with the solids")


@pytest.mark.parametrize(
    ("model", "line"),
    [
        ([*BOLT[:3], "2, S3", BOLT[4]], "*PRE-TENSION SECTION, SURFACE=CUT, NODE=900"),
        (["*NGEN", "1, 8, 2"], "*NGEN"),
        (["*NFILL", "x0, NALL, 4, 1"], "*NFILL"),
        (
            ["*ELCOPY, ELEMENT SHIFT=9, SHIFT NODES=1, OLD SET=GONE"],
            "*ELCOPY, ELEMENT SHIFT=9, SHIFT NODES=1, OLD SET=GONE",
        ),
        (
            ["*NCOPY, OLD SET=x0, CHANGE NUMBER=500, POLE"],
            "*NCOPY, OLD SET=x0, CHANGE NUMBER=500, POLE",
        ),
    ],
)
def test_damaged_cuts_and_copies_are_refused_with_their_line(capsys, model, line):
    text = deck(model=model, held=ENDS, loads=["*CLOAD", "x1, 1, 1."])
    Path("a.inp").write_text(text)
    refused_command(
        ["import", "a.inp", "body"], capsys, f"a.inp, line {text.splitlines().index(line) + 1}"
    )
