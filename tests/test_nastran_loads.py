"""Nastran decks whose modes are about a static subcase: the frequencies of CalculiX 2.20 on the same mesh."""

from __future__ import annotations

from pathlib import Path

import meshes
import numpy as np
import pytest
from refusals import refused_command
from test_nastran_systems import block, bulk, card, hertz

from microslip.errors import UserError
from microslip.mesh import read_mesh
from microslip.mesh.surface import boundary_facets
from microslip.topology import CELL_TYPES, FACET_CORNERS

MATERIAL = ("MAT1,1,2.05+11,,0.29,7830.,1.2-5,20.", "PSOLID,1,1")
CONTROL = ("SPC=7", "METHOD=9", "SUBCASE 1", "LOAD=3", "SUBCASE 2", "STATSUB(PRELOAD)=1")


@pytest.fixture(autouse=True)
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def nodes(mesh, axis: int, at: float) -> list[int]:
    return mesh.node_id[np.abs(mesh.points[:, axis] - at) < 1e-9].tolist()


def deck(*cards: str, control=CONTROL, to=None, cd="", material=MATERIAL) -> str:
    """60 x 11 x 7 mm of three bricks, clamped at x = 0."""
    mesh = block(to)
    held = f"SPC1,7,123456,{','.join(map(str, nodes(block(), 0, 0.0)))}"
    return bulk(mesh, held, "EIGRL,9,,,8", *cards, control=control, cd=cd, material=material)


TIP = nodes(block(), 0, 0.06)
CORNERS = {
    tuple(np.round(1e3 * x).astype(int).tolist()): int(n)
    for n, x in zip(block().node_id, block().points, strict=True)
}


def on_tip(text: str) -> list[str]:
    return [text.format(node) for node in TIP]


PULLED = [*on_tip("FORCE,3,{},,300.,1.,0.,0."), *on_tip("FORCE,3,{},,-5.,0.,0.,-1.")]
PRESSED = [
    f"PLOAD4,3,{k + 1},2.+7,,,,{CORNERS[20 * k, 0, 7]},{CORNERS[20 * k + 20, 11, 7]}"
    for k in range(3)
]
ROUND = card("CORD2C", 8, 0, (0.03, -0.02, 0.0), (0.03, -0.02, 1.0), (1.0, -0.02, 0.0))
TURNING = ["GRID,900,,0.,-.05,0.", "RFORCE,3,900,,150.,0.,0.,2."]
STRETCHED = [f"SPC1,7,1,{','.join(map(str, TIP))}", *on_tip("SPCD,3,{},1,1.-4")]
HEATED = [
    "TEMPD,5,120.",
    *(
        f"TEMP,5,{n},{120 + 5000 * x[0]:.15g}"
        for n, x in zip(block().node_id, block().points, strict=True)
    ),
]
HEATING = (*CONTROL[:3], "TEMPERATURE(LOAD)=5", *CONTROL[4:])
COMBINED = ["LOAD,3,2.,.5,31,.25,32", *(c.replace(",3,", ",31,", 1) for c in PULLED[:8])]
COMBINED += [c.replace(",3,", ",32,", 1).replace("-5.", "-10.") for c in PULLED[8:]]
LAID = [
    f"CQUAD4,{70 + k},9,{','.join(str(CORNERS[20 * k + i, j, 7]) for i, j in ((0, 0), (0, 11), (20, 11), (20, 0)))}"
    for k in range(3)
]
"""Shells on the upper face, their normals into the body."""
ALONG = [f"{text},+\n+,,3.,1.,0." for text in PRESSED]
ALONG = [text.replace("2.+7", repr(1e7 * 10**0.5)) for text in ALONG]
LARGE = ("SOL 106", "CEND", "SPC=7", "METHOD=9", "SUBCASE 1", "LOAD=3")
SAME = [
    (PULLED, CONTROL, [1705.02, 2581.812, 10428.59, 12176.26]),
    (COMBINED, CONTROL, [1705.02, 2581.812, 10428.59, 12176.26]),
    (PRESSED, CONTROL, [1670.156, 2547.327, 10412.62, 12199.55]),
    (
        ["PLOAD2,3,2.+7,70,THRU,72", "PSHELL,9,1,1.-9", *LAID],
        CONTROL,
        [1670.156, 2547.327, 10412.62, 12199.55],
    ),
    (["GRAV,3,,1.+4,3.,0.,4."], CONTROL, [1671.496, 2560.43, 10390.35, 12174.81]),
    (TURNING, CONTROL, [1697.143, 2560.497, 10411.77, 12178.46]),
    (STRETCHED, CONTROL, [2832.759, 4107.726, 12201.25, 14713.72]),
    (ALONG, CONTROL, [1772.377, 2626.665, 10478.44, 12185.37]),  # by consistent forces
    (HEATED, HEATING, [1666.007, 2558.106, 10408.3, 12181.62]),
]


@pytest.mark.parametrize(("cards", "control", "wanted"), SAME)
def test_the_modes_are_about_the_static_subcase(capsys, cards, control, wanted):
    found = hertz(deck(*cards, control=control))[:4]
    assert "the modes are about its static state" in capsys.readouterr().out
    np.testing.assert_allclose(found, wanted, rtol=1e-6)


def test_modes_at_finite_displacements(capsys):
    """SOL 106 with NMLOOP and LGDISP; CalculiX with NLGEOM and *CONTROLS, FIELD 1e-10."""
    text = deck(*PRESSED, "PARAM,LGDISP,1", "PARAM,NMLOOP,1", control=LARGE).replace(
        "SOL 103\nCEND\n", "", 1
    )
    np.testing.assert_allclose(hertz(text)[:4], [1667.908, 2552.549, 10371.67, 12174.29], rtol=1e-6)
    assert "finite displacements" in capsys.readouterr().out


TABLES = [
    "TABLEM1,4,,,,,,,,+\n+,20.,2.05+11,420.,1.55+11,ENDT",
    "TABLEM2,4,20.,,,,,,,+\n+,0.,1.,400.,.75609756097561,ENDT",
    "TABLEM3,4,20.,400.,,,,,,+\n+,0.,1.,1.,.75609756097561,ENDT",
    "TABLEM4,4,20.,400.,0.,999.,,,,+\n+,1.,-.24390243902439,ENDT",
]
SOFT = ("SPC=7", "METHOD=9", "TEMPERATURE(MATERIAL)=5")


def test_a_modulus_over_temperature(capsys):
    """Of an unloaded body, then of one that is strained as well; all four tables say the same."""
    found = hertz(deck("MATT1,1,4", TABLES[0], *HEATED, control=SOFT))[:4]
    np.testing.assert_allclose(found, [1577.86, 2423.092, 9634.367, 11428.53], rtol=1e-6)
    hot = (*CONTROL[:3], "TEMP = 5", *CONTROL[4:])
    found = hertz(deck("MATT1,1,4", TABLES[3], *HEATED, control=hot), "b")[:4]
    np.testing.assert_allclose(found, [1578.45, 2424.575, 9656.278, 11436.13], rtol=1e-6)
    for table in TABLES:
        Path("a.bdf").write_text(deck("MATT1,1,4", table, *HEATED, control=SOFT))
        (material,) = read_mesh("a.bdf", "m", "m-kg-s").materials
        modulus = (
            material.modulus_factor(np.array([120.0, 333.0, 420.0])) * material.elasticity[3, 3]
        )
        np.testing.assert_allclose(modulus * 2 * 1.29, [1.925e11, 1.65875e11, 1.55e11], rtol=1e-12)


def test_a_table_may_fall_and_jump():
    """Temperatures in falling order, two values at 100; a table that turns back is refused."""
    table = "TABLEM1,4,,,1,,,,,+\n+,300.,1.+11,100.,1.+11,100.,2.+11,0.,2.+11,+\n+,ENDT"
    for hot, E in ((250.0, 1e11), (50.0, 2e11)):
        Path("a.bdf").write_text(deck("MATT1,1,4", table, f"TEMPD,5,{hot}", control=SOFT))
        (material,) = read_mesh("a.bdf", "m", "m-kg-s").materials
        np.testing.assert_allclose(material.elasticity[3, 3], E / 2.58, rtol=1e-12)
    Path("a.bdf").write_text(deck("MATT1,1,4", table.replace("300.", "50."), "TEMPD,5,9.", control=SOFT))
    with pytest.raises(UserError, match="TABLEM1 4 has temperatures that neither rise nor fall"):
        read_mesh("a.bdf", "m", "m-kg-s")


def test_constants_over_an_even_temperature():
    """All of MATT1, beyond the ends of its tables in straight lines: E, nu and the density at 520."""
    cards = ["MATT1,1,4,,6,7", TABLES[1], "TABLEM1,6,,,,,,,,+\n+,20.,.29,420.,.31,ENDT"]
    cards += ["TABLEM1,7,,,1,,,,,+\n+,20.,7830.,420.,7700.,ENDT", "TEMPD,5,520."]
    Path("a.bdf").write_text(deck(*cards, control=SOFT))
    (material,) = read_mesh("a.bdf", "m", "m-kg-s").materials
    assert material.density == 7700 and material.temperature_table is None
    C, E, nu = material.elasticity, 1.425e11, 0.315
    np.testing.assert_allclose(
        [C[3, 3], C[0, 1]], [E / 2 / (1 + nu), E * nu / (1 + nu) / (1 - 2 * nu)], rtol=1e-9
    )


Q = np.array([[0.8, 0.0, -0.6], [0.0, 1.0, 0.0], [0.6, 0.0, 0.8]])


def test_loads_in_local_systems_are_those_of_the_basic_one():
    """Every grid point moves along a turned system; forces, gravity, rotation, displacements too."""
    system = card("CORD2R", 6, 0, (0.0, 0.0, 0.0), tuple(Q[2]), tuple(Q[0]))
    pull, push, g = (Q @ v for v in ((300.0, 0.0, 0.0), (0.0, 0.0, 5.0), (0.6, 0.0, 0.8)))
    words = [",".join(f"{v:.15g}" for v in vector) for vector in (pull, push, g, 2 * Q[:, 2])]
    both = [
        *(f"FORCE,31,{n},6,1.,{w}" for n in TIP for w in words[:2]),
        f"GRAV,32,6,5.+4,{words[2]}",
    ]
    both += [
        f"RFORCE,33,900,6,150.,{words[3]}",
        "GRID,900,,0.,-.05,0.",
        "LOAD,3,1.,1.,31,1.,32,1.,33",
    ]
    plain = [*(c.replace(",3,", ",31,", 1) for c in PULLED), "GRAV,32,,1.+4,3.,0.,4."]
    plain += ["RFORCE,33,900,,150.,0.,0.,2.", "GRID,900,,0.,-.05,0.", "LOAD,3,1.,1.,31,1.,32,1.,33"]
    found = hertz(deck(*both, system, cd="6")), hertz(deck(*plain), "b")
    np.testing.assert_allclose(found[0], found[1], rtol=1e-9)


def test_a_force_in_a_cylindrical_system_is_along_its_directions_at_the_node():
    corner = CORNERS[60, 11, 7]
    Path("a.bdf").write_text(deck(f"FORCE,3,{corner},8,10.,3.,4.,5.", ROUND))
    (load,) = read_mesh("a.bdf", "m", "m-kg-s").state.loads
    r = np.array([0.03, 0.031]) / np.hypot(0.03, 0.031)
    wanted = 10 * np.array([3 * r[0] - 4 * r[1], 3 * r[1] + 4 * r[0], 5.0])
    np.testing.assert_allclose(load.values, wanted, rtol=1e-12)


def test_forces_by_grid_points():
    """FORCE1 along a line of two, FORCE2 normal to two lines; they keep their directions, which is told."""
    a, b, c = (CORNERS[x] for x in ((0, 0, 0), (60, 0, 0), (0, 11, 0)))
    Path("a.bdf").write_text(deck(f"FORCE1,3,{b},7.,{a},{b}", f"FORCE2,3,{b},9.,{a},{b},{a},{c}"))
    mesh = read_mesh("a.bdf", "m", "m-kg-s")
    assert [(load.directions.tolist(), load.values.tolist()) for load in mesh.state.loads] == [
        ([0], [7.0]),
        ([2], [9.0]),
    ]
    assert "FORCE1 3: it follows its grid points" in mesh.lost[0]


def test_pressures_at_the_corners_of_a_face_go_about_its_inner_normal():
    """P1 at G1, P3 at G3 across it; a wedge's triangle has G1 alone, a tetrahedron's face G1 and G4 off it."""
    a, b, c, d = (CORNERS[x] for x in ((0, 0, 7), (0, 11, 7), (20, 11, 7), (20, 0, 7)))
    Path("a.bdf").write_text(deck(f"PLOAD4,3,1,1.,2.,3.,4.,{a},{c}"))
    mesh = read_mesh("a.bdf", "m", "m-kg-s")
    (load,) = mesh.state.loads
    at = dict(zip(mesh.node_id[load.facets[0][:4]].tolist(), load.values[0].tolist(), strict=True))
    assert at == {a: 1.0, b: 2.0, c: 3.0, d: 4.0}


def solids(kind: str, *cards: str, shape=(1, 1, 1)) -> str:
    return bulk(
        meshes.brick(kind, shape), "SPC1,7,123,1", *cards, control=CONTROL, material=MATERIAL
    )


@pytest.mark.parametrize("kind", ["wedge", "tetra10", "pyramid", "hexahedron"])
def test_every_face_can_be_pressed(kind):
    """All of the surface under one pressure, each face by its own card: no force and no moment; told by the state."""
    mesh = meshes.brick(kind, (1, 1, 1))
    cell, nodes = CELL_TYPES[kind], mesh.cells[kind]
    cards, corners = [], cell.corners
    for number, row in enumerate(nodes, 1):
        for facet, sort in zip(cell.facets, cell.facet_types, strict=True):
            ring = [int(mesh.node_id[row[i]]) for i in facet[: FACET_CORNERS[sort]]]
            off = next(int(mesh.node_id[n]) for n in row[:corners] if mesh.node_id[n] not in ring)
            other = (
                ring[2]
                if len(ring) == 4
                else off
                if corners == 4
                else ring[1]
                if corners == 5
                else ""
            )
            cards.append(f"PLOAD4,3,{number},5.,,,,{ring[0]},{other}")
    Path("a.bdf").write_text(solids(kind, *cards))
    read = read_mesh("a.bdf", "m", "m-kg-s")
    pressed = {tuple(sorted(f.tolist())) for load in read.state.loads for f in load.facets}
    surface = sum(map(len, boundary_facets(read).values()))
    assert len(pressed) == surface and all((load.values == 5).all() for load in read.state.loads)


HURT = [
    ("FORCE,3,9999,,1.,1.,0.,0.", "FORCE 3 names node 9999"),
    ("FORCE,3,1,77,1.,1.,0.,0.", "coordinate system 77"),
    ("FORCE,3,1,,1.x,1.,0.,0.", "'1.X' where a number"),
    ("FORCE1,3,1,1.,5,5", "no length"),
    ("GRAV,3,,9.81,0.,0.,0.", "no length"),
    ("RFORCE,3,1,,10.,0.,0.,0.", "no length"),
    ("PLOAD4,3,999,1.,,,,1,2", "loads element 999"),
    ("PLOAD4,3,1,1.,,,,1,2", "no face of element 1"),
    ("PLOAD4,3,1,1.,,,,THRU,3", "goes over solid elements"),
    ("PLOAD2,3,1.,55", "loads element 55"),
    ("SPCD,3,9999,1,.1", "SPCD 3 names node 9999"),
    (f"SPCD,3,{TIP[0]},1,.1", "which no SPC of the subcase holds"),
    ("LOAD,3,1.,1.x,31", "'1.X' where a number"),
    ("TEMPD,3,x", "'X' where a number"),
]


@pytest.mark.parametrize(("text", "words"), HURT)
def test_a_damaged_load_is_refused_with_its_line(capsys, text, words):
    control = (*CONTROL[:4], "TEMP(LOAD)=3", *CONTROL[4:]) if text.startswith("TEMP") else CONTROL
    whole = deck(text, control=control)
    Path("a.bdf").write_text(whole)
    line = [i for i, t in enumerate(whole.splitlines(), 1) if t == text]
    refused_command(
        ["import", "a.bdf", "body", "--unit", "m"], capsys, f"a.bdf, line {line[0]}", words
    )
    assert not Path("body").exists()


@pytest.mark.parametrize(
    ("control", "words"),
    [
        (("SPC=7", "METHOD=9", "STATSUB=1"), "line 5: STATSUB = 1 names no other subcase"),
        (
            ("SPC=7", "SUBCASE 1", "LOAD=8", "SUBCASE 2", "METHOD=9", "STATSUB=1"),
            "line 5: LOAD = 8 chooses loads",
        ),
        (("SPC=X",), "line 3: SPC = X is no number"),
        ((*CONTROL[:3], "TEMP(LOAD)=8", *CONTROL[4:]), "line 6: TEMPERATURE = 8"),
    ],
)
def test_a_case_control_that_chooses_what_is_not_there_is_refused(capsys, control, words):
    Path("a.bdf").write_text(deck(control=control))
    refused_command(["import", "a.bdf", "body", "--unit", "m"], capsys, words)


def test_stress_free_temperatures_are_those_of_init_or_of_the_material():
    control = (*HEATING[:2], "TEMP(INIT)=6", *HEATING[2:])
    Path("a.bdf").write_text(deck("TEMPD,5,120.,6,35.", "TEMP,6,1,36.", control=control))
    np.testing.assert_array_equal(read_mesh("a.bdf", "m").temperature[:2], [[36, 120], [35, 120]])
    Path("a.bdf").write_text(deck("TEMPD,5,120.", control=HEATING))
    np.testing.assert_array_equal(read_mesh("a.bdf", "m").temperature[:2], [[20, 120], [20, 120]])
    Path("a.bdf").write_text(deck("TEMP,5,1,120.", control=HEATING))
    with pytest.raises(UserError, match="line 6: TEMPERATURE = 5 gives node 2 no temperature"):
        read_mesh("a.bdf", "m")


def test_a_static_subcase_that_is_held_otherwise_is_told():
    control = ("METHOD=9", "SUBCASE 1", "SPC=8", "LOAD=3", "SUBCASE 2", "SPC=7", "STATSUB=1")
    Path("a.bdf").write_text(deck(*PULLED, "SPC1,8,123,1", control=control))
    assert any("its SPC = 8 is not that of the modes (7)" in text for text in read_mesh("a.bdf", "m").lost)


def test_modes_of_a_static_solution_are_those_of_the_unloaded_body(capsys):
    text = deck(*PULLED, control=("SPC=7", "LOAD=3")).replace("SOL 103", "SOL 101")
    np.testing.assert_allclose(hertz(text)[:4], [1665.394, 2556.59, 10384.92, 12173.87], rtol=1e-6)
    assert "FORCE: loads, which change no frequency of an unstressed body" in capsys.readouterr().out
