"""Constraints of decks: tied faces, equations, couplings, rigid bodies. CalculiX, dense algebra and merged meshes."""

from __future__ import annotations

from dataclasses import replace

import decks
import instanced
import meshes
import numpy as np
import pytest
import scipy.linalg
import sector
import test_bdf
import test_cdb
from hypothesis import given, settings
from hypothesis import strategies as st
from instanced import Placed
from refusals import refused_command

from microslip.basis import read_basis
from microslip.cli import main
from microslip.data import AverageLink, Equation, FaceTie, Links, Mesh, RigidLink
from microslip.elasticity import isotropic
from microslip.errors import UserError
from microslip.fem.discretise import discretise
from microslip.fem.links import linked
from microslip.fem.operators import mass, stiffness
from microslip.fem.tied import tied_upper
from microslip.mesh import boundary_facets, part_numbers, read_mesh
from microslip.modal.compute import modal_basis

BEAM = meshes.brick("hexahedron20", (2, 2, 3), (0.02, 0.024, 0.05), to=meshes.shaken(0.0004))
SETS = ("z0", "z1", "x1")
A, B, C = (int(BEAM.node_id[BEAM.face_points(f)[i]]) for f, i in (("z1", 0), ("z1", 3), ("x1", 16)))
HELD = ["*BOUNDARY", "z0, 1, 3"]
REF = ["*NODE, NSET=REF", "9001, 5., 6., 60."]
LOW = ["*NODE, NSET=REF", "9001, 5., 6., -10."]
COUPLED = ["*COUPLING, CONSTRAINT NAME=Foot, REF NODE=9001, SURFACE={}", "*KINEMATIC", "1, 3"]
TURNS = ["*NODE, NSET=ROT", "9002, 5., 6., -10.", "*RIGID BODY, NSET=z0, REF NODE=9001, ROT NODE=9002"]

SAME = {
    "equations": [*HELD, "*EQUATION", "3", f"{A}, 1, 1.0, {B}, 1, -0.5, {C}, 2, 0.25", "2", f"{A},3,1.,{B},3,-1."],
    "kinematic": [*HELD, *REF, *COUPLED[:1], *COUPLED[1:]],
    "rigid body": [*HELD, *REF, "*RIGID BODY, NSET=z1, REF NODE=9001"],
    "held by its reference node": [*LOW, *COUPLED, "*BOUNDARY", "REF, 1, 6"],
    "held in part": [*LOW, *TURNS, "*BOUNDARY", "REF, 1, 3", "ROT, 1, 1", "z1, 1, 1"],
}


def base():
    return [*decks.mesh_lines(BEAM, sets=SETS), *decks.MATERIAL, decks.section(), *instanced.surfaces(BEAM, SETS)]


def modes(folder, name, lines, monkeypatch, count=8):
    monkeypatch.chdir(folder)
    (folder / f"{name}.inp").write_text("\n".join(lines) + "\n")
    assert main(["import", f"{name}.inp"]) == 0
    assert main(["modes", name, "-q", "--set", f"modes.count={count}"]) == 0
    return read_basis(folder / "build" / name / "basis.h5").groups[0, 0].omega / 2 / np.pi


@pytest.mark.skipif(decks.CCX is None, reason="needs CalculiX")
@pytest.mark.parametrize("what", SAME)
def test_constraints_are_those_of_calculix(tmp_path, monkeypatch, what):
    face = "S-z0" if what.startswith("held") else "S-z1"
    lines = [*base(), *(line.format(face) for line in SAME[what])]
    there = decks.run(tmp_path, "ccx", [*lines, *decks.frequency_step(8)])
    np.testing.assert_allclose(modes(tmp_path, "ours", lines, monkeypatch)[:8], there[:8], rtol=1e-6)


@pytest.mark.skipif(decks.CCX is None, reason="needs CalculiX")
def test_faces_that_do_not_match_are_tied_as_calculix_does(tmp_path, monkeypatch):
    """Of instances; CalculiX gets them flattened."""
    lower = meshes.brick("hexahedron20", (2, 2, 2), (0.02, 0.02, 0.03))
    upper = meshes.brick("hexahedron20", (3, 1, 2), (0.014, 0.012, 0.03))
    own, placed = {"Lower": lower, "Upper": upper}, [Placed("L", "Lower"), Placed("U", "Upper", (3.0, 4.0, 30.0))]
    parts = {name: instanced.part_lines(name, m, SETS) for name, m in own.items()}
    tie = ["*Tie, name=Glue, adjust=yes, position tolerance=0.1", "U.S-z0, L.S-z1"]
    deck = instanced.instanced(parts, placed, tie, [*decks.MATERIAL, "*BOUNDARY", "L.z0, 1, 3"])
    flat, _ = instanced.flattened(own, placed, SETS)
    flat += [*decks.MATERIAL, *(decks.section(f"E_{p.name}") for p in placed), "*BOUNDARY", "L_z0, 1, 3"]
    flat += ["*TIE, NAME=Glue, ADJUST=NO, POSITION TOLERANCE=0.1", "S_U_z0, S_L_z1"]
    there = decks.run(tmp_path, "ccx", [*flat, *decks.frequency_step(8)])
    np.testing.assert_allclose(modes(tmp_path, "two", deck, monkeypatch)[:8], there[:8], rtol=1e-6)
    np.testing.assert_allclose(modes(tmp_path, "flat", flat, monkeypatch)[:8], there[:8], rtol=1e-6)


def torn(mesh: Mesh, first: np.ndarray) -> Mesh:
    """The mesh in two parts that share no points: cells `first` and the others, tied where they met."""
    kind, cells = next(iter(mesh.cells.items()))
    both = np.intersect1d(cells[first], cells[~first])
    twin = np.arange(mesh.n_points)
    twin[both] = mesh.n_points + np.arange(len(both))
    parted = np.where(first[:, None], cells, twin[cells])
    points = np.concatenate([mesh.points, mesh.points[both]])
    new = Mesh(points, {kind: parted}, {}, {}, np.arange(1, len(points) + 1))
    boundary, faces = boundary_facets(new), {}
    every = {**mesh.faces, "own": {}}
    for name, blocks in every.items():
        nodes = np.unique(np.concatenate([b.ravel() for b in blocks.values()])) if blocks else both
        wide = np.union1d(nodes, twin[nodes]) if blocks else nodes
        faces[name] = {t: f[np.isin(f, wide).all(axis=1)] for t, f in boundary.items()}
    faces["twin"] = {t: f[np.isin(f, twin[both]).all(axis=1)] for t, f in boundary.items()}
    links = Links((FaceTie("line 1: *TIE", "twin", "own"),), np.zeros((0, 3)), np.zeros(0, dtype=int))
    return linked(replace(new, faces=faces, links=links))[0]


def test_a_body_torn_and_tied_is_the_body_at_rest_and_at_speed():
    whole = meshes.twisted_blade("hexahedron20", (1, 2, 4))
    cells = whole.cells["hexahedron20"]
    tied = torn(whole, whole.points[cells].mean(axis=1)[:, 2] < whole.points[:, 2].mean())
    assert part_numbers(tied).max() == 1 and part_numbers(tied, tied=True).max() == 0
    setting = meshes.body(
        supports=[{"face": "z0"}], rotation={"axis": [0.0, 1.0, 0.0], "speeds_rpm": [0.0, 8000.0]}, modes={"count": 6},
        interfaces=[{"name": "tip", "face": "z1", "t2": [0.0, 1.0, 0.0]}],
    )  # fmt: skip
    ours, theirs = modal_basis(tied, setting), modal_basis(whole, setting)
    for key, group in theirs.groups.items():
        found = ours.groups[key]
        np.testing.assert_allclose(found.omega, group.omega, rtol=1e-9)
        rows = [g.interfaces["tip"].rows for g in (found, group)]
        np.testing.assert_allclose(abs(rows[0]), abs(rows[1]), rtol=1e-5, atol=1e-7 * abs(rows[1]).max())


def test_a_free_body_torn_and_tied_keeps_its_six_rigid_motions():
    cells = BEAM.cells["hexahedron20"]
    tied = torn(BEAM, BEAM.points[cells].mean(axis=1)[:, 2] < 0.02)
    setting = meshes.body(free=True, modes={"count": 10})
    ours, theirs = (modal_basis(m, setting).groups[0, 0].omega for m in (tied, BEAM))
    assert (ours[:6] == 0).all()
    np.testing.assert_allclose(ours[6:], theirs[6:], rtol=1e-9)


@pytest.mark.parametrize("radius", [0.075, 0.095])
def test_a_sector_torn_and_tied_up_to_its_cut_faces_is_the_sector(radius):
    whole = sector.mesh()
    middle = whole.points[whole.cells["hexahedron20"]].mean(axis=1)
    tied = torn(whole, np.hypot(middle[:, 0], middle[:, 2]) < radius)
    setting = sector.settings(6)
    setting = setting.model_copy(update={"modes": setting.modes.model_copy(update={"count": 5})})
    ours, theirs = modal_basis(tied, setting), modal_basis(whole, setting)
    assert len(theirs.groups) == 4
    for key, group in theirs.groups.items():
        np.testing.assert_allclose(ours.groups[key].omega, group.omega, rtol=1e-9)


def null_space_modes(mesh: Mesh, fixed: np.ndarray, count: int) -> np.ndarray:
    """Angular frequencies with all equations of a mesh, on a dense null space of them."""
    d = discretise(mesh)
    K = d.pattern.full(stiffness(d, isotropic(2.1e11, 0.3))).toarray()
    M = np.kron(d.pattern.full(mass(d, 7850.0)).toarray(), np.eye(3))
    assert mesh.ties is not None
    rows = mesh.ties.rows.toarray()
    held = np.eye(rows.shape[1])[fixed]
    N = scipy.linalg.null_space(np.vstack([rows / np.linalg.norm(rows, axis=1)[:, None], held]))[: len(K)]
    U, s, _ = np.linalg.svd(N, full_matrices=False)
    N = U[:, s > 1e-9]
    return np.sqrt(scipy.linalg.eigh(N.T @ K @ N, N.T @ M @ N, eigvals_only=True, subset_by_index=(0, count - 1)))


def solved(mesh: Mesh, fixed: np.ndarray, count: int) -> np.ndarray:
    """The same with the transformation."""
    d = discretise(mesh)
    free = tied_upper(d.pattern, fixed, mesh.ties)
    K, M = free.matrix(stiffness(d, isotropic(2.1e11, 0.3))), free.matrix(mass(d, 7850.0)[:, None, None] * np.eye(3))
    K, M = ((a + a.T).toarray() - np.diag(a.diagonal()) for a in (K, M))
    return np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True, subset_by_index=(0, count - 1)))


SMALL = meshes.brick("hexahedron20", (1, 1, 2), (0.02, 0.024, 0.05), to=meshes.shaken(0.001))


@settings(max_examples=12, deadline=None, derandomize=True)
@given(st.data())
def test_random_constraints_are_those_of_dense_algebra(data):
    """Equations, rigid and mean links on shuffled nodes, reference nodes free or held."""
    n = SMALL.n_points
    nodes = np.array(data.draw(st.permutations(np.setdiff1d(np.arange(n), SMALL.face_points("z0")).tolist())))
    number = st.floats(0.2, 2.0)
    links = [
        Equation("a", nodes[[0, 1, 2]], np.array(data.draw(st.lists(st.integers(0, 2), min_size=3, max_size=3))),
                 np.array([data.draw(number) for _ in range(3)])),
        Equation("b", np.array([nodes[1], n + 1]), np.array([1, data.draw(st.integers(0, 5))]),
                 np.array([1.0, 0.3]), first=data.draw(st.booleans())),
        RigidLink("c", n, nodes[3 : 3 + data.draw(st.integers(1, 4))], data.draw(st.sampled_from(["xyz", "xz", "y"]))),
        AverageLink("d", n + 1, nodes[8:13], np.array([data.draw(number) for _ in range(5)]),
                    data.draw(st.sampled_from(["xyzabc", "xyz", "xyzc"]))),
    ]  # fmt: skip
    held = data.draw(st.sampled_from([[], [0, 4], [6, 7, 8], [6, 7, 8, 9, 10, 11], [0, 1, 2, 3, 4, 5, 6]]))
    references = SMALL.points.mean(axis=0) + np.array([[0.01, 0, 0], [0, 0, 0.04]])
    order = data.draw(st.permutations(links))
    mesh = linked(replace(SMALL, links=Links(tuple(order), references, np.array([901, 902]))))[0]
    fixed = (3 * SMALL.face_points("z0")[:, None] + np.arange(3)).ravel()
    fixed = np.concatenate([fixed, 3 * n + np.array(held, dtype=int)])
    try:
        ours = solved(mesh, fixed, 6)
    except UserError:
        assert held  # an equation gives what is held
        return
    np.testing.assert_allclose(ours, null_space_modes(mesh, fixed, 6), rtol=1e-7)


@pytest.mark.parametrize(
    ("lines", "text"),
    [
        (["*EQUATION", "2", "{A}, 1, 1., {B}, 1, -1.", "2", "{A}, 1, 1., {C}, 1, -1."], "gives already"),
        (["*EQUATION", "2", "{A}, 1, 1., {B}, 1, -1.", "2", "{B}, 1, 1., {A}, 1, 2."], "leads in a circle"),
        (["*EQUATION", "3", "{A}, 1, 1., {B}, 1, -1."], "announces 3 terms"),
        (["*MPC", "BEAM, {A}, {B}", "BEAM, {B}, {C}"], "moves node {B}, which leads others"),
        (["*SURFACE, NAME=U, COMBINE=UNION", "S-z1, S-z9"], "names the surface 'S-z9', which is not defined"),
        (["*MPC", "BEAMM, {A}, {B}"], "kind 'BEAMM' is not read"),
        (["*MPC", "PIN, {A}"], "fewer than two nodes"),
        (
            [*REF, "*TRANSFORM, NSET=z1", "0,1,0,1,0,0", COUPLED[0].format("S-z1"), "*KINEMATIC", "1, 2"],
            "beside a *TRANSFORM",
        ),
        (
            [
                *REF,
                *REF[:1],
                "9003, 1., 1., 99.",
                "*SURFACE, NAME=L, TYPE=NODE",
                "9003, 2.",
                "*COUPLING, REF NODE=9001, SURFACE=L",
                "*DISTRIBUTING",
            ],
            "node 9003, which no solid cell uses",
        ),
        (["*MPC", "PIN, {A}, Nobody"], "'Nobody', which is not defined"),
        (["*EQUATION", "2", "{A}, 7, 1., {B}, 1, -1."], "'7' is no degree of freedom"),
        (["*EQUATION", "2", "{A}, 5, 1., {B}, 1, -1."], "takes in the rotation of node {A}, which has none"),
        (["*EQUATION", "2", "{A}, 1, 1., Nobody, 1, -1."], "'Nobody', which is not defined"),
        (["*TIE, NAME=T", "S-z0, S-z1"], "no node of 'S-z0' lies within"),
        (["*TIE, NAME=T", "S-z0, S-z9"], "the surface 'S-z9', which is not defined"),
        ([*REF, "*COUPLING, REF NODE=9001, SURFACE=S-z1", "*NSET, NSET=Q", "1"], "neither *KINEMATIC nor"),
        ([*REF, "*NSET, NSET=Q", "*RIGID BODY, NSET=Q, REF NODE=9001"], "couples no nodes"),
        ([*REF, "*KINEMATIC COUPLING, REF NODE=9001"], "couples no nodes"),
        (["*COUPLING, SURFACE=S-z1", "*KINEMATIC"], "names no reference node"),
    ],
)
def test_wrong_constraints_are_told_with_file_and_line(tmp_path, monkeypatch, capsys, lines, text):
    words = {"A": A, "B": B, "C": C}
    (tmp_path / "part.inp").write_text("\n".join([*base(), *(line.format(**words) for line in lines)]) + "\n")
    monkeypatch.chdir(tmp_path)
    refused_command(["import", "part.inp"], capsys, text.format(**words), "part.inp, line ")
    assert not (tmp_path / "part").exists()


CHAINS = {
    "kinematic": ["*KINEMATIC COUPLING, REF NODE=9002", "9001, 1, 6"],
    "beam": ["*MPC", "BEAM, 9001, 9002"],
    "rigid": ["*NSET, NSET=TIED", "9001,", "*RIGID BODY, TIE NSET=TIED, REF NODE=9002"],
}


@pytest.mark.parametrize("kind", CHAINS)
def test_a_reference_node_that_follows_another_one_turns_with_it(tmp_path, kind):
    """Rigid on rigid is rigid: the end held through a chain of two is the end held."""
    found = []
    for chain in ([], CHAINS[kind]):
        lines = [*base(), *REF, "*NODE", "9002, 30., 0., 80.", *COUPLED, *chain]
        (tmp_path / "a.inp").write_text("\n".join([line.format("S-z1") for line in lines]) + "\n")
        mesh = linked(read_mesh(tmp_path / "a.inp", "mm"))[0]
        last = 3 * mesh.n_points + 6 * (len(mesh.links.references) - 1) + np.arange(6)
        found.append(solved(mesh, last, 6))
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9)


WEIGHTS = ["*COUPLING, REF NODE=9001, SURFACE={}", "*DISTRIBUTING", "*BOUNDARY", "9001, 1, 3"]


def test_a_distributing_coupling_weighs_by_area_or_by_its_numbers(tmp_path):
    """Unequal facets: areas as the surface has them, as numbers written by hand, and one for all where none is."""
    mesh = meshes.brick("hexahedron20", (2, 1, 1), (0.02, 0.01, 0.03), to=lambda x: x + np.maximum(x - [0.01, 1, 1], 0))
    face = mesh.faces["z1"]["quad8"]
    area = np.zeros(mesh.n_points)
    for facet in face:
        sides = np.ptp(mesh.points[facet[:4]], axis=0)
        area[facet] += sides[0] * sides[1] * np.array([-1 / 12] * 4 + [1 / 3] * 4)
    nodes = mesh.face_points("z1")
    numbers = [f"{mesh.node_id[n]}, {1e6 * area[n]:.15g}" for n in nodes]
    kinds = {
        "S-z1": instanced.surfaces(mesh, ("z1",)),
        "A": ["*SURFACE, NAME=A, TYPE=NODE", *numbers],
        "B": ["*SURFACE, NAME=B, TYPE=NODE", *(f"{mesh.node_id[n]}," for n in nodes)],
    }
    found = {}
    for name, lines in kinds.items():
        text = [*decks.mesh_lines(mesh), *REF, *lines, *(line.format(name) for line in WEIGHTS)]
        (tmp_path / "a.inp").write_text("\n".join(text) + "\n")
        found[name] = linked(read_mesh(tmp_path / "a.inp", "mm"))[0].ties.rows.toarray()
    np.testing.assert_allclose(found["A"], found["S-z1"], atol=1e-9 * abs(found["A"]).max())
    assert abs(found["A"] - found["B"]).max() > 0.1


def test_what_counts_and_is_not_read_is_a_warning_with_its_line(tmp_path, monkeypatch, capsys):
    lines = ["*EMBEDDED ELEMENT", "EALL"]
    lines += ["*INITIAL CONDITIONS, TYPE=STRESS", "EALL, 1., 0., 0., 0., 0., 0."]
    (tmp_path / "part.inp").write_text("\n".join([*base(), *lines, "*CLOAD", "1, 1, 2."]) + "\n")
    monkeypatch.chdir(tmp_path)
    assert main(["import", "part.inp"]) == 0
    told = [line for line in capsys.readouterr().out.splitlines() if "frequencies will differ" in line]
    assert [line.split(": ")[2].split(" is not")[0] for line in told] == [
        "*EMBEDDED ELEMENT",
        "*INITIAL CONDITIONS, TYPE=STRESS",
    ]
    assert all(line.startswith("warning: part.inp, line ") for line in told)


def test_a_support_on_what_an_equation_gives_is_refused_with_its_line(tmp_path, monkeypatch, capsys):
    lines = [*base(), *HELD, "*EQUATION", "2", f"{int(BEAM.node_id[BEAM.face_points('z0')[2]])}, 1, 1., {B}, 1, -1."]
    (tmp_path / "part.inp").write_text("\n".join(lines) + "\n")
    monkeypatch.chdir(tmp_path)
    code = main(["import", "part.inp"]) or main(["modes", "part", "-q"])
    said = capsys.readouterr().err
    assert code == 2 and "that a support holds" in said and "part.inp, line " in said


def test_constraints_of_nastran_and_ansys_are_those_of_abaqus(tmp_path):
    """RBE2 as a kinematic coupling, RBE3 as a distributing one, MPC and CE as an equation, CERIG as a coupling."""
    n = BEAM.node_id
    top, side = (n[BEAM.face_points(f)] for f in ("z1", "x1"))
    fixed = (3 * BEAM.face_points("z0")[:, None] + np.arange(3)).ravel()
    free = np.setdiff1d(side, np.union1d(top, n[BEAM.face_points("z0")]))
    abaqus = [
        *decks.mesh_lines(BEAM, 1.0, ("z1",)), "*NODE", "901, 0.005, 0.006, 0.07", "902, 0.03, 0.02, 0.02",
        "*NSET, NSET=FREE", *(f"{i}," for i in free), "*SURFACE, NAME=F, TYPE=NODE", "FREE",
        "*KINEMATIC COUPLING, REF NODE=901", "z1, 1, 3", "*COUPLING, REF NODE=902, SURFACE=F", "*DISTRIBUTING",
        "*EQUATION", "2", f"{free[0]}, 1, 2., {free[1]}, 2, -1.", "2", "901, 5, 1., 902, 4, -0.5",
    ]  # fmt: skip
    (tmp_path / "a.inp").write_text("\n".join(abaqus) + "\n")
    one = linked(read_mesh(tmp_path / "a.inp", "m"))[0]
    grid = ["GRID,901,,0.005,0.006,0.07", "GRID,902,,0.03,0.02,0.02"]
    cards = [
        *grid, *_listed("RBE2,1,901,123456", top), *_listed("RBE3,2,,902,123456,1.0,123", free),
        f"MPC,3,{free[0]},1,2.0,{free[1]},2,-1.0", "MPC,3,901,5,1.0,902,4,-0.5",
    ]  # fmt: skip
    bulk = (
        test_bdf.bulk(BEAM).replace("CEND", "CEND\nMPC = 3").replace("ENDDATA\n", "\n".join([*cards, "ENDDATA"]) + "\n")
    )
    (tmp_path / "a.bdf").write_text(bulk)
    two = linked(read_mesh(tmp_path / "a.bdf", "m"))[0]
    ours, theirs = solved(one, fixed, 6), solved(two, fixed, 6)
    np.testing.assert_allclose(theirs, ours, rtol=1e-6)  # cards of bulk data have ten digits
    np.testing.assert_allclose(ours, null_space_modes(one, fixed, 6), rtol=1e-7)
    extra = f"{901:9d}{0:9d}{0:9d}" + "".join(f"{v:21.13E}" for v in (0.005, 0.006, 0.07))
    text = test_cdb.archive(BEAM, ("z1",), scale=1.0).replace("N,R5.3,LOC", extra + "\nN,R5.3,LOC")
    ce = [
        "CE,R5.0,DEFI,       2,       1,  0.0",
        f"CE,R5.0,NODE,{free[0]},UX,2.0,{free[1]},UY,-1.0",
        "CERIG,901,Z1,UXYZ",
    ]
    (tmp_path / "a.cdb").write_text(text.replace("FINISH", "\n".join([*ce, "FINISH"])))
    three = linked(read_mesh(tmp_path / "a.cdb", "m"))[0]
    short = [line for line in abaqus[:-2] if not line.startswith(("*COUPLING", "*DISTRIBUTING"))]
    (tmp_path / "b.inp").write_text("\n".join(short) + "\n")
    four = linked(read_mesh(tmp_path / "b.inp", "m"))[0]
    np.testing.assert_allclose(solved(three, fixed, 6), solved(four, fixed, 6), rtol=1e-9)


def _listed(head: str, nodes) -> list[str]:
    """A card of bulk data, eight fields a line."""
    words = [*head.split(","), *(str(i) for i in nodes)]
    lines = [",".join(words[:9])]
    return [*lines, *(",".join(["+", *words[i : i + 8]]) for i in range(9, len(words), 8))]
