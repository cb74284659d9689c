"""Point masses, springs, dashpots and rigid bars of decks beside CalculiX, 6 x 6 matrices and closed forms."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import decks
import meshes
import numpy as np
import pytest
import scipy.linalg
import touching
from refusals import refused_command
from test_bdf import bulk
from test_cdb import archive

from microslip.basis import read_basis
from microslip.cli import main
from microslip.errors import UserError
from microslip.frames import skew
from microslip.mesh import read_mesh
from microslip.mesh.chosen import of_instances, with_parts
from microslip.modal.compute import unreduced
from microslip.stages.job import open_job
from microslip.stages.meshing import load_mesh

STEEL = ["*MATERIAL, NAME=ST", "*ELASTIC", "205000., 0.29", "*DENSITY", "7.83e-9"]
MESH = meshes.brick("hexahedron20", (2, 1, 1), (0.06, 0.011, 0.007))
"""60 x 11 x 7 mm."""


@pytest.fixture(autouse=True)
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def number(x: float, y: float, z: float) -> int:
    """The node at a place in mm."""
    return int(MESH.node_id[np.abs(MESH.points - np.array([x, y, z]) / 1e3).sum(axis=1).argmin()])


C, D = number(60, 11, 7), number(60, 0, 0)
TIP = MESH.node_id[MESH.points[:, 0] > 0.0599]


def deck(*more: str, held: bool = True) -> str:
    lines = [*decks.mesh_lines(MESH, sets=("x0", "x1")), *STEEL, decks.section(material="ST"), *more]
    return "\n".join([*lines, *(["*BOUNDARY", "x0, 1, 3"] if held else [])]) + "\n"


def nastran(*cards: str) -> str:
    head = bulk(meshes.brick("hexahedron20", (2, 1, 1), (60.0, 11.0, 7.0))).replace("CEND", "CEND\nSPC = 1")
    root = [f"SPC1,1,123,{n}" for n in MESH.node_id[MESH.points[:, 0] < 1e-6]]
    more = ["PSOLID,1,1", "MAT1,1,205000.,,.29,7.83-9", *root, *cards, "ENDDATA"]
    return head.replace("ENDDATA\n", "\n".join(more) + "\n")


def hertz(text: str, name: str = "a.inp", count: int = 8, *words: str) -> np.ndarray:
    """Frequencies of a deck, by `import` and `modes`."""
    Path(name).write_text(text)
    assert main(["import", name, "body", *words]) == 0
    assert main(["modes", "body", "-q", "--set", "modes.solver=superlu", "--set", f"modes.count={count}"]) == 0
    return read_basis(Path("build/body/basis.h5")).groups[0, 0].frequency


HANGING = [1475.234, 2968.427, 4343.238, 5009.822, 10178.16, 12167.59, 15070.37, 20500.33]
"""Hz, CalculiX 2.20 of the deck below."""


def hanging() -> str:
    """Masses on the corner and on springs beside the block, one of these along a line; a grounded spring."""
    return deck(
        "*NODE", "901, 60., 30., 7.", "902, 70., 11., 7.",
        "*ELEMENT, TYPE=MASS, ELSET=EM", f"501, {C}", "502, 901", "*MASS, ELSET=EM", "2e-6",
        "*ELEMENT, TYPE=SPRINGA, ELSET=ES", f"601, {C}, 901", "*SPRING, ELSET=ES", "", "1500.",
        "*ELEMENT, TYPE=SPRING1, ELSET=EG", f"602, {D}", "*SPRING, ELSET=EG", "2", "3000.",
        "*ELEMENT, TYPE=SPRING2, ELSET=ET", f"603, {D}, 902", "*SPRING, ELSET=ET", "3, 3", "700.",
        "*ELEMENT, TYPE=MASS, ELSET=EN", "604, 902", "*MASS, ELSET=EN", "1e-6",
    )  # fmt: skip


def test_masses_and_springs_are_those_of_calculix():
    """Loose nodes are held where nothing resists, as the deck for CalculiX holds them."""
    np.testing.assert_allclose(hertz(hanging()), HANGING, rtol=1e-6)


def test_scalar_springs_bushes_and_masses_of_bulk_data_are_the_same_ones():
    """The same body; a damper of 50 N s/m on one displacement adds phi^2 c to C_r."""
    text = nastran(
        "GRID,901,,60.,30.,7.", "GRID,902,,70.,11.,7.", f"CONM2,501,{C},,2.-6", "CONM2,502,901,,2.-6",
        "CONM2,503,902,,1.-6", f"CBUSH,601,7,{C},901", "PBUSH,7,K,1500.", f"CELAS2,602,3000.,{D},2",
        f"CELAS1,603,8,{D},3,902,3", "PELAS,8,700.", f"CDAMP2,604,.05,{D},2",
    )  # fmt: skip
    np.testing.assert_allclose(hertz(text, "a.bdf"), HANGING, rtol=1e-6)
    basis = read_basis(Path("build/body/basis.h5"))
    group = basis.groups[0, 0]
    phi = group.phi[np.abs(basis.mesh.points - [0.06, 0, 0]).sum(axis=1).argmin(), 1]
    ratio = tomllib.loads(Path("body/body.toml").read_text())["damping"]["ratio"]
    expected = 50.0 * np.outer(phi, phi) + np.diag(2 * ratio * group.omega)
    np.testing.assert_allclose(group.C_r, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(group.damping_ratio, np.diag(expected) / (2 * group.omega), rtol=1e-9)


def test_a_rigid_body_on_a_coupled_node_is_its_six_by_six_matrices():
    """Mass, offset and inertia tensor, a rotational spring and a bush on the node that leads the end of the block:
    K and M of the block on the motions of that node, and the 6 x 6 matrices added by hand."""
    at, offset = np.array([75.0, 14.0, 9.0]), np.array([3.0, 1.0, -2.0])
    text = nastran(
        "GRID,901,,75.,14.,9.", *(f"RBE2,{700 + n},901,123456,{n}" for n in TIP), "CONM2,501,901,,5.-6,3.,1.,-2.",
        "+,2.-4,3.-5,3.-4,0.,1.-5,4.-4", "CELAS2,602,3.+5,901,4", "CBUSH,603,7,901,,,,,0",
        "PBUSH,7,K,100.,200.,300.,1.+5,2.+5,3.+5",
    )  # fmt: skip
    found = hertz(text, "a.bdf")
    Path("plain.bdf").write_text(nastran())
    assert main(["import", "plain.bdf", "plain"]) == 0
    job = open_job("plain", ["damping.ratio=0"])
    mesh, _ = load_mesh(job)
    body = unreduced(mesh, job.settings)
    dofs = np.flatnonzero(np.repeat(mesh.points[:, 0] > 1e-9, 3))
    T = np.zeros((len(dofs), len(dofs)))
    r = mesh.points - at / 1e3
    inner = [k for k, d in enumerate(dofs) if mesh.points[d // 3, 0] < 0.0599]
    T[inner, np.arange(len(inner))] = 1.0
    for k, d in enumerate(dofs):
        if k not in inner:
            T[k, len(inner) : len(inner) + 6] = np.hstack([np.eye(3), -skew(r[d // 3])])[d % 3]
    T = T[:, : len(inner) + 6]
    m, c = 5e-3, offset / 1e3
    J = 1e-3 * np.array([[2e-4, -3e-5, 0], [-3e-5, 3e-4, -1e-5], [0, -1e-5, 4e-4]])  # t mm2 = 1e-3 kg m2
    M6 = np.block([[m * np.eye(3), -m * skew(c)], [m * skew(c), J - m * skew(c) @ skew(c)]])
    K6 = np.diag([1e5, 2e5, 3e5, 400.0, 200.0, 300.0])
    K, M = (T.T @ (A @ T) for A in (body.K, body.M))
    M[-6:, -6:] += M6
    K[-6:, -6:] += K6
    expected = np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True)[:8]) / 2 / np.pi
    np.testing.assert_allclose(found, expected, rtol=1e-8)


def test_a_stiff_block_on_grounded_springs_is_a_rigid_body():
    """Grounded springs alone hold it: no support, no free motion; f = sqrt(sum k / (m + sum of masses)) / 2 pi of its
    three translations, as the springs are alike at all corners. It bends by 2e-6 of these motions."""
    corners = [number(x, y, z) for x in (0, 60) for y in (0, 11) for z in (0, 7)]
    more = ["*ELEMENT, TYPE=MASS, ELSET=EM", *(f"{500 + n}, {n}" for n in corners), "*MASS, ELSET=EM", "1e-6"]
    for way in (1, 2, 3):
        more += [f"*ELEMENT, TYPE=SPRING1, ELSET=E{way}", *(f"{1000 * way + n}, {n}" for n in corners)]
        more += [f"*SPRING, ELSET=E{way}", f"{way}", f"0.0{way}"]
    found = hertz(deck(*more, held=False), count=6)
    mass = 0.06 * 0.011 * 0.007 * 7830 + 8e-3
    expected = np.sqrt(8 * 10.0 * np.array([1, 2, 3]) / mass) / 2 / np.pi
    assert all(np.abs(found / f - 1).min() < 5e-6 for f in expected)
    assert "free" not in tomllib.loads(Path("body/body.toml").read_text())


def test_a_mass_on_a_rigid_body_is_that_of_calculix():
    """A reference node with a mass and a grounded spring: CalculiX 2.20."""
    text = deck(
        "*NODE", "901, 75., 14., 9.", "*RIGID BODY, NSET=x1, REF NODE=901",
        "*ELEMENT, TYPE=MASS, ELSET=EM", "501, 901", "*MASS, ELSET=EM", "5e-6",
        "*ELEMENT, TYPE=SPRING1, ELSET=EG", "602, 901", "*SPRING, ELSET=EG", "2", "3000.",
    )  # fmt: skip
    known = [1174.460, 3288.170, 6114.253, 8817.986, 13060.99, 19160.90, 24531.90, 28301.14]
    np.testing.assert_allclose(hertz(text), known, rtol=1e-6)


def test_beams_on_the_solids_stop_an_import_until_they_are_meant_to_be_left_out(capsys):
    text = nastran("GRID,901,,75.,14.,9.", f"CBAR,701,3,{C},901,0.,0.,1.")
    Path("a.bdf").write_text(text)
    refused_command(["import", "a.bdf", "body"], capsys, "1 CBAR", "--solids-only", "line")
    assert not Path("body").exists()
    assert main(["import", "a.bdf", "body", "--solids-only"]) == 0
    assert "1 CBAR" in capsys.readouterr().out.splitlines()[0]
    Path("b.bdf").write_text(nastran("GRID,901,,75.,14.,9.", "GRID,902,,85.,14.,9.", "CBAR,701,3,901,902,0.,0.,1."))
    assert main(["import", "b.bdf", "other"]) == 0  # they stand apart


def test_retained_displacements_become_an_interface(capsys):
    text = deck("*STEP", "*SUBSTRUCTURE GENERATE", "*RETAINED NODAL DOFS", "x1, 1, 3", "*END STEP")
    Path("a.inp").write_text(text)
    assert main(["import", "a.inp", "body"]) == 0
    keys = tomllib.loads(Path("body/body.toml").read_text())
    assert [i["face"] for i in keys["interfaces"]] == ["x1"] and [s["face"] for s in keys["supports"]] == ["x0"]


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        (["*ELEMENT, TYPE=MASS, ELSET=E", f"501, {C}"], ("501", "MASS")),
        (["*ELEMENT, TYPE=MASS, ELSET=E", f"501, {C}", "*MASS, ELSET=E", "-1."], ("MASS", "negative")),
        (["*ELEMENT, TYPE=MASS, ELSET=E", f"501, {C}, {D}", "*MASS, ELSET=E", "1."], ("MASS",)),
        (["*ELEMENT, TYPE=MASS, ELSET=E", "501, 9999", "*MASS, ELSET=E", "1."], ("9999",)),
        (["*ELEMENT, TYPE=SPRINGA, ELSET=E", f"501, {C}, {C}", "*SPRING, ELSET=E", "", "1."], ("SPRINGA",)),
        (["*ELEMENT, TYPE=SPRING1, ELSET=E", f"501, {C}", "*SPRING, ELSET=E", "7", "1."], ("direction",)),
        (["*ELEMENT, TYPE=SPRING1, ELSET=E", f"501, {C}", "*SPRING, ELSET=E, NONLINEAR", "1", "1."], ("NONLINEAR",)),
        (["*ELEMENT, TYPE=SPRING1, ELSET=E", f"501, {C}", "*SPRING, ELSET=GONE", "1", "1."], ("GONE",)),
        (["*ELEMENT, TYPE=ROTARYI, ELSET=E", f"501, {C}", "*ROTARY INERTIA, ELSET=E", "-1.,1.,1."], ("inertia",)),
        (["*ELEMENT, TYPE=SPRING1, ELSET=E", f"501, {C}", "*SPRING, ELSET=E, ORIENTATION=O", "1", "1."], ("'O'",)),
    ],
)  # fmt: skip
def test_damaged_lumped_elements_are_refused_with_their_line(capsys, keywords, words):
    Path("a.inp").write_text(deck(*keywords))
    refused_command(["import", "a.inp", "body"], capsys, "a.inp", "line", *words)
    assert not Path("body").exists()


@pytest.mark.parametrize(
    ("cards", "words"),
    [
        ([f"CELAS1,603,8,{D},3"], ("PELAS 8",)),
        ([f"CELAS2,603,1.,{D},9"], ("names no component",)),
        ([f"CBUSH,603,8,{D},{C}"], ("PBUSH 8",)),
        ([f"CBUSH,603,8,{D},{C}", "PBUSH,8,K,1.,2."], ("orientation",)),
        ([f"CONM2,603,{C},5,1."], None),
        ([f"CONM2,603,{C},5,1.,1."], ("5",)),
        ([f"CONM2,603,{C},,-1."], ("below 0",)),
        ([f"RBAR,603,{C},{D},123,45"], ("5 independent components",)),
    ],
)
def test_damaged_cards_are_refused_with_their_line(capsys, cards, words):
    """A system beside a mass without offset does not count."""
    Path("a.bdf").write_text(nastran(*cards))
    if words is None:
        assert main(["import", "a.bdf", "body"]) == 0
        return
    refused_command(["import", "a.bdf", "body"], capsys, "a.bdf", "line", *words)
    assert not Path("body").exists()


def test_inertia_on_a_node_of_solids_alone_is_told(capsys):
    """It has no rotation: the mass counts, the rest is left out."""
    Path("a.bdf").write_text(nastran(f"CONM2,501,{C},,1.-6,3.,0.,0."))
    assert main(["import", "a.bdf", "body"]) == 0
    assert "rotation" in capsys.readouterr().out


def test_masses_and_springs_of_an_archive_are_the_same_ones():
    """MASS21 with KEYOPT(3) = 2, COMBIN14 along its line and along displacements; one end held is the ground."""
    text = archive(
        MESH, ("x0",), ("MP,EX,1,205000.", "MP,PRXY,1,0.29", "MP,DENS,1,7.83e-9", "D,X0,ALL", "D,901,UX,0,,,,UZ",
        "D,902,UX,0,,,,UY", "D,903,ALL", "ET,21,21", "KEYOPT,21,3,2", "R,21,2e-6", "R,22,1e-6", "TYPE,21", "REAL,21",
        f"E,{C}", "E,901", "REAL,22", "E,902", "ET,14,14", "R,14,1500.", "TYPE,14", "REAL,14", f"E,{C},901",
        "ET,15,14", "KEYOPT,15,2,2", "R,15,3000.", "TYPE,15", "REAL,15", f"E,{D},903", "ET,16,14", "KEYOPT,16,2,3",
        "R,16,700.", "TYPE,16", "REAL,16", f"E,{D},902"),
    )  # fmt: skip
    places = {901: (60.0, 30.0, 7.0), 902: (70.0, 11.0, 7.0), 903: (60.0, -5.0, 0.0)}
    rows = [f"{n:9d}{0:9d}{0:9d}" + "".join(f"{v:21.13E}" for v in x) for n, x in places.items()]
    found = hertz(text.replace("N,R5.3", "\n".join([*rows, "N,R5.3"])), "a.cdb")
    np.testing.assert_allclose(found, HANGING, rtol=1e-6)


def test_a_part_of_a_deck_keeps_what_is_lumped_on_it():
    """Two blocks apart: each has its own mass, and one that hangs beside it; a spring between them is refused."""
    lower = meshes.brick("hexahedron", (1, 1, 1), (0.01, 0.01, 0.01))
    upper = replace(lower, points=lower.points + [0.0, 0.0, 0.05])
    both = touching.together(a=lower, b=upper)
    last = int(both.node_id[-1])
    lumped = [
        *["*NODE", "901, 30., 0., 50.", "*ELEMENT, TYPE=MASS, ELSET=EM", "501, 1", f"502, {last}", "503, 901"],
        *["*MASS, ELSET=EM", "2e-6", "*ELEMENT, TYPE=SPRINGA, ELSET=ES", f"601, {last}, 901"],
        *["*SPRING, ELSET=ES", "", "1500."],
    ]
    section = [*STEEL, decks.section(material="ST")]
    lines = [*decks.mesh_lines(both), *section, *lumped]
    Path("a.inp").write_text("\n".join(lines) + "\n")
    whole = with_parts(read_mesh("a.inp", "mm"))
    first, second = (of_instances(whole, [name]) for name in list(whole.instances)[:2])
    for part, where in ((first, [lower.points[0]]), (second, [upper.points[-1], np.array([0.03, 0.0, 0.05])])):
        assert part.lumps is not None
        np.testing.assert_allclose(part.points[part.lumps.points], where, atol=1e-9)
        np.testing.assert_allclose(part.lumps.masses, 2e-3)
    assert len(first.lumps.pairs) == 0 and first.n_points == 8 and second.n_points == 9
    ends = np.sort(second.lumps.pairs, axis=1)
    assert ends.max() == second.n_points - 1
    Path("a.inp").write_text("\n".join([*lines, "*ELEMENT, TYPE=SPRINGA, ELSET=ES", f"602, 1, {last}"]) + "\n")
    with pytest.raises(UserError, match="a spring or dashpot of the file ties these instances"):
        of_instances(with_parts(read_mesh("a.inp", "mm")), list(whole.instances)[:1])


def test_a_mass_on_one_of_two_parts_in_contact(capsys):
    """Its point is of no instance; the parts stay two bodies, and the mass is on one."""
    mesh = meshes.brick("hexahedron", (1, 1, 1), (0.01, 0.01, 0.01))
    plain = [line for line in decks.mesh_lines(mesh, sets=("x0",)) if line]
    faces = ["*SURFACE, NAME=F", "EALL, S2", "*SURFACE, NAME=B", "EALL, S1"]
    part = ["*PART, NAME=P", *plain, *faces, decks.section(material="ST")]
    place = ["*ASSEMBLY, NAME=A", "*INSTANCE, NAME=P-1, PART=P", "*END INSTANCE", "*INSTANCE, NAME=P-2, PART=P"]
    mass = ["*NODE", "1, 5., 5., 30.", "*NSET, NSET=RP", "1", "*ELEMENT, TYPE=MASS, ELSET=M"]
    mass += ["1, 1", "*MASS, ELSET=M", "2e-3", "*COUPLING, CONSTRAINT NAME=C, REF NODE=RP, SURFACE=P-1.F", "*KINEMATIC"]
    pair = ["*SURFACE INTERACTION, NAME=I", "*FRICTION", "0.2", "*CONTACT PAIR, INTERACTION=I", "P-2.B, P-1.F"]
    text = [*part, "*END PART", *place, "0., 0., 10.", "*END INSTANCE", *mass, "*END ASSEMBLY", *STEEL, *pair]
    Path("a.inp").write_text("\n".join(text) + "\n")
    assert main(["import", "a.inp", "two"]) == 0
    assert [p.name for p in sorted(Path("two").iterdir())] == ["P-1", "P-2", "case.toml"]
    assert "point masses of the file: 2 kg" in capsys.readouterr().out
