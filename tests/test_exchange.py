"""Exports read back by readers written from the formats' descriptions, and by the packages that own the formats."""

from __future__ import annotations

import csv
import re
import shutil
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg
import sector
import small
from refusals import refused, refused_command
from scipy.io import loadmat, mmread

from microslip.basis import read_basis, write_basis
from microslip.cli import main
from microslip.data import INTERFACE_ROWS, ModalBasis
from microslip.exchange import formats, to_xarray, writer
from microslip.exchange.choice import elastic, select
from microslip.frames import skew
from microslip.mesh import boundary_facets
from microslip.modal.compute import modal_basis
from microslip.reduced.floating_frame import floating_body, inertia, mass_matrix, right_side
from microslip.settings.body import BodySettings

SOURCE = {"settings": "small", "mesh_sha256": "0" * 64}
ROUNDING = 1e-12
"""Sums of a few hundred products in double precision, relative to the largest entry."""


@cache
def body(**changes: Any) -> ModalBasis:
    """The beam with other settings, as one-level keyword arguments."""
    table = small.table(rotation={"speeds_rpm": [0.0], "point": [0.0, 0.01, -0.2]}, **changes)
    return modal_basis(small.beam(), BodySettings.model_validate(table), provenance=SOURCE)


@cache
def stiffened() -> ModalBasis:
    table = small.table(rotation={"speeds_rpm": [0.0], "point": [0.0, 0.01, -0.2]}, output={"stiffening": True})
    return modal_basis(small.beam(), BodySettings.model_validate(table), provenance=SOURCE)


def close(a: Any, b: Any, relative: float = ROUNDING) -> None:
    np.testing.assert_allclose(a, b, rtol=0, atol=relative * max(np.abs(b).max(initial=0), 1e-300))


# --- Matrix Market ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("reduction", ["eigenmodes", "craig-bampton", "massless-boundary", "dual-craig-bampton"])
def test_matrix_market_gives_every_bit_back_and_the_frequencies(reduction: str, tmp_path: Path) -> None:
    basis = body(reduction=reduction)
    g = basis.groups[0, 0]
    writer("mtx")(basis, tmp_path / "m")
    read = {p.stem: np.asarray(mmread(p)) for p in (tmp_path / "m" / "speed_0").glob("*.mtx")}
    for name in ("M_r", "K_r", "C_r", "G_r"):
        np.testing.assert_array_equal(read[name], getattr(g, name))
    np.testing.assert_array_equal(read["interface_right"], g.interfaces["right"].rows)
    np.testing.assert_array_equal(read["monitor_tip_probe"], g.monitors["tip-probe"].rows)
    V = read.get("to_diagonal", np.eye(g.n_modes))
    np.testing.assert_allclose(np.diag(V.T @ read["K_r"] @ V), read["omega"].ravel() ** 2, rtol=1e-8)
    assert "u_n u_t1 u_t2" in (tmp_path / "m" / "README.txt").read_text()


def test_coordinates_of_matrix_market_name_the_interface_displacements(tmp_path: Path) -> None:
    basis = body(reduction="craig-bampton")
    writer("mtx")(basis, tmp_path / "m")
    with open(tmp_path / "m" / "speed_0" / "coordinates.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    named = [r["meaning"] for r in rows if r["kind"] == "interface"]
    assert named == [f"{name}:{row}" for name in ("right", "left") for row in INTERFACE_ROWS]
    assert not any(r["meaning"] for r in rows if r["kind"] != "interface")


def test_a_complex_group_is_written_complex(tmp_path: Path) -> None:
    basis = sector.basis()
    writer("mtx")(basis, tmp_path / "m")
    for (_, k), g in basis.groups.items():
        inside = tmp_path / "m" / f"speed_0_nd_{k}"
        np.testing.assert_array_equal(np.asarray(mmread(inside / "G_r.mtx")), g.G_r)
        for name, item in g.interfaces.items():
            np.testing.assert_array_equal(np.asarray(mmread(inside / f"interface_{name}.mtx")), item.rows)


def test_a_folder_of_ours_is_replaced_and_another_one_is_not(tmp_path: Path) -> None:
    writer("mtx")(small.basis(), tmp_path / "m")
    (tmp_path / "m" / "speed_0" / "old.mtx").write_text("old")
    writer("mtx")(small.basis(), tmp_path / "m")
    assert not (tmp_path / "m" / "speed_0" / "old.mtx").exists()
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter1").write_text("years of work")
    refused("choose another name", writer("mtx"), small.basis(), tmp_path / "thesis")
    assert (tmp_path / "thesis" / "chapter1").read_text() == "years of work"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["m", "thesis"]


# --- universal file format -------------------------------------------------------------------------------------------


def uff_sets(path: Path) -> list[dict[str, Any]]:
    pyuff = pytest.importorskip("pyuff")
    found = pyuff.UFF(str(path)).read_sets()
    return found if isinstance(found, list) else [found]


def test_uff_is_read_by_pyuff_to_its_printed_digits(tmp_path: Path) -> None:
    basis, g = small.basis(), small.basis().groups[0, 0]
    writer("uff")(basis, tmp_path / "b.uff")
    sets = uff_sets(tmp_path / "b.uff")
    assert [s["type"] for s in sets] == [151, 164, 2411, 2412] + [55] * g.n_modes
    header, units, nodes = sets[:3]
    assert header["model_name"].strip() == "small"
    assert (units["units_code"], units["length"], units["force"]) == (1, 1.0, 1.0)
    np.testing.assert_array_equal(np.stack([nodes["x"], nodes["y"], nodes["z"]], axis=1), basis.mesh.points)
    np.testing.assert_array_equal(nodes["node_nums"], basis.mesh.node_id)
    skin = {frozenset(f[:3]) for f in boundary_facets(basis.mesh)["triangle6"].tolist()}
    drawn = {frozenset(np.searchsorted(basis.mesh.node_id, f)) for f in sets[3]["triangle"]["nodes_nums"]}
    assert drawn == skin
    for j, mode in enumerate(s for s in sets if s["type"] == 55):
        assert (mode["analysis_type"], mode["data_ch"], mode["spec_data_type"], mode["mode_n"]) == (2, 2, 8, j + 1)
        shape = np.stack([mode["r1"], mode["r2"], mode["r3"]], axis=1)
        printed = np.vectorize(lambda v: float(f"{v:.5e}"))
        np.testing.assert_array_equal(shape, printed(g.phi[:, :, j]))
        assert mode["freq"] == printed(g.frequency[j]) and mode["modal_damp_vis"] == printed(g.damping_ratio[j])
        assert mode["modal_m"] == 1.0


def test_complex_modes_in_uff_keep_phase_and_eigenvalue(tmp_path: Path) -> None:
    basis = select(sector.basis(), None, 2)
    g = basis.groups[0, 2]
    assert np.iscomplexobj(g.phi)
    writer("uff")(basis, tmp_path / "b.uff")
    modes = [s for s in uff_sets(tmp_path / "b.uff") if s["type"] == 55]
    for j, mode in enumerate(modes):
        shape = np.stack([mode["r1"], mode["r2"], mode["r3"]], axis=1)
        np.testing.assert_allclose(shape, g.phi[:, :, j], rtol=0, atol=6e-6 * np.abs(g.phi).max())
        D, w = g.damping_ratio[j], g.omega[j]
        np.testing.assert_allclose(mode["eig"], w * (-D + 1j * np.sqrt(1 - D**2)), rtol=2e-5)
        np.testing.assert_allclose(mode["modal_a"], 2 * mode["eig"] * g.M_r[j, j] + g.C_r[j, j], rtol=2e-5)
        np.testing.assert_allclose(mode["modal_b"], g.K_r[j, j] - mode["eig"] ** 2 * g.M_r[j, j], rtol=2e-5)


# --- SID: a reader from the description of the format -----------------------------------------------------------------


@dataclass
class Block:
    """What stands between a keyword and its ``end``."""

    name: str
    values: dict[str, str] = field(default_factory=dict)
    inside: list[Block] = field(default_factory=list)
    entries: list[tuple[str, tuple[int, ...], float]] = field(default_factory=list)

    def __getitem__(self, name: str) -> Block:
        (one,) = [b for b in self.inside if b.name == name]
        return one

    def taylor(self) -> tuple[np.ndarray, np.ndarray]:
        """m0 (rows, columns) and m1 (q, rows, columns)."""
        rows, columns, modes = (int(self.values[n]) for n in ("nrow", "ncol", "nq"))
        m0, m1 = np.zeros((rows, columns)), np.zeros((modes, rows, columns))
        for which, at, value in self.entries:
            if which == "m0":
                m0[at[0] - 1, at[1] - 1] = value
            else:
                m1[at[1] - 1, at[0] - 1, at[2] - 1] = value
        return m0, m1


def read_sid(path: Path) -> tuple[str, Block]:
    """First line and the part of a SID file."""
    first, *lines = path.read_text(encoding="ascii").splitlines()
    stack = [Block("file")]
    for line in map(str.strip, lines):
        if entry := re.fullmatch(r"(m[01])\(([\d, ]+)\) = (\S+)", line):
            stack[-1].entries.append((entry[1], tuple(map(int, entry[2].split(","))), float(entry[3])))
        elif line.startswith("end "):
            closed = stack.pop()
            assert line.removeprefix("end ") == closed.name, line
            stack[-1].inside.append(closed)
        elif line.startswith("new node"):
            stack.append(Block("node", {"number": line.split("=")[1].strip()}))
        elif "=" in line:
            key, _, value = line.partition("=")
            stack[-1].values[key.strip()] = value.strip()
        else:
            stack.append(Block(line.removeprefix("new ")))
    assert len(stack) == 1
    return first, stack[0]["part"]["modal"]


@pytest.fixture(scope="module")
def sid(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Block]:
    path = tmp_path_factory.mktemp("sid") / "b.SID_FEM"
    writer("sid")(stiffened(), path)
    return read_sid(path)


def test_sid_says_what_it_holds(sid: tuple[str, Block]) -> None:
    first, modal = sid
    g = stiffened().groups[0, 0]
    assert first.startswith(f"4 nodes, {g.n_modes} modes") and "SI" in first and "m1(row, q, column)" in first
    assert float(modal["refmod"].values["mass"]) == stiffened().groups[0, 0].invariants.mass
    assert int(modal["refmod"].values["nelastq"]) == g.n_modes
    names = [b.name for b in modal.inside]
    assert names == "refmod frame mdCM J Ct Cr Me Gr Ge Oe ksigma Ke De".split()
    assert [n.values["number"] for n in modal["frame"].inside] == ["1", "2", "3", "4"]


def test_equations_of_motion_from_sid_are_those_of_the_floating_frame(sid: tuple[str, Block]) -> None:
    """The SID's terms, put together as its description says, against Sextro (2.3-23) at a random state."""
    modal, b = sid[1], floating_body(stiffened())
    T = {name: modal[name].taylor() for name in "mdCM J Ct Cr Me Gr Ge Oe Ke De".split()}
    rng = np.random.default_rng(7)
    m = b.n_modes
    q, velocity = 1e-4 * rng.normal(size=m), rng.normal(size=m)
    w, alpha, a = rng.normal(size=3) * 100, rng.normal(size=3) * 1e3, rng.normal(size=3) * 10

    def at(name: str, x: np.ndarray) -> np.ndarray:
        m0, m1 = T[name]
        return m0 + np.tensordot(x, m1, axes=1) if len(m1) else m0

    # first-order inertia: the even part beyond q = 0 is what the format leaves out
    J = inertia(b, 0 * q) + (inertia(b, q) - inertia(b, -q)) / 2
    close(at("J", q), J)
    M = mass_matrix(b, q)
    M[3:6, 3:6] = J
    c, geometric = at("mdCM", q)[:, 0], b.invariants.stiffening
    Cr_plain = at("Cr", q) - np.einsum("kij,j->ik", geometric[9:], q)
    close(float(modal["refmod"].values["mass"]) * np.eye(3), M[:3, :3])
    close(skew(c), M[3:6, :3])
    close(T["Ct"][0], M[6:, :3])
    close(Cr_plain, M[6:, 3:6])
    close(T["Me"][0], M[6:, 6:])
    # elastic rows with all stiffening, from acceleration, angular acceleration and centrifugal force
    products = np.array([w[0] ** 2, w[1] ** 2, w[2] ** 2, w[0] * w[1], w[1] * w[2], w[0] * w[2]])
    Ge = T["Ge"][0].reshape(m, m, 3)
    elastic_rows = (
        at("Ct", q) @ a + at("Cr", q) @ alpha + np.einsum("klc,l,c->k", Ge, velocity, w) + at("Oe", q) @ products
        + T["Ke"][0] @ q + T["De"][0] @ velocity
    )  # fmt: skip
    rest = -right_side(b, w, q, velocity)
    stiff = np.tensordot(np.concatenate([a, alpha]), geometric[6:], axes=1) @ q
    expected = M[6:, :3] @ a + M[6:, 3:6] @ alpha + rest[6:] + stiff
    assert np.linalg.norm(stiff) > 1e-6 * np.linalg.norm(expected), "the stiffening must show"
    close(elastic_rows, expected)
    # the frame's rows
    close(2 * skew(w) @ T["Ct"][0].T @ velocity + skew(w) @ skew(w) @ c, rest[:3])
    Gr = at("Gr", q).reshape(3, m, 3)
    turning = np.einsum("alc,l,c->a", Gr, velocity, w) + skew(w) @ J @ w
    exact = rest[3:6] - skew(w) @ inertia(b, q) @ w + skew(w) @ J @ w
    close(turning, exact)


def test_a_free_body_has_no_coupling_with_its_frame(tmp_path: Path) -> None:
    """Elastic modes of a free body are orthogonal to its rigid motions: Ct and Cr vanish at q = 0."""
    table = small.table(supports=[], free=True, modes={"count": 9, "solver": "superlu"})
    basis = modal_basis(small.beam(), BodySettings.model_validate(table), provenance=SOURCE)
    writer("sid")(basis, tmp_path / "b.SID_FEM")
    first, modal = read_sid(tmp_path / "b.SID_FEM")
    assert first.startswith("4 nodes, 3 modes")
    scale = np.sqrt(basis.mass)
    assert np.abs(modal["Ct"].taylor()[0]).max() < 1e-9 * scale
    assert np.abs(modal["Cr"].taylor()[0]).max() < 1e-9 * scale * max(small.SIZE)


def test_nodes_of_sid_are_the_interfaces_in_body_axes(sid: tuple[str, Block]) -> None:
    g = stiffened().groups[0, 0]
    nodes = sid[1]["frame"].inside
    for node, (_, face) in zip(nodes, g.interfaces.items(), strict=False):
        origin, moved = node["origin"].taylor()
        close(origin[:, 0], face.origin - g.invariants.point)
        close(moved[:, :, 0].T, node["phi"].taylor()[0])
        close(face.rotation @ node["phi"].taylor()[0], face.rows[:3])
        close(face.rotation @ node["psi"].taylor()[0], face.rows[3:])
        turn, turned = node["AP"].taylor()
        np.testing.assert_array_equal(turn, np.eye(3))
        close(turned[0], skew(node["psi"].taylor()[0][:, 0]))


# --- MBDyn: a reader from the layout of its record groups -------------------------------------------------------------


def read_fem(path: Path) -> dict[int, np.ndarray]:
    """Record group -> its numbers; the shapes (8) as (modes, nodes, 6)."""
    groups: dict[int, list[str]] = {}
    here = 0
    for line in path.read_text(encoding="ascii").splitlines():
        if found := re.match(r"\*\* RECORD GROUP (\d+),", line):
            here = int(found[1])
            groups[here] = []
        elif here and not line.startswith("**"):
            groups[here] += line.replace("REV0", "").split()
    read = {k: np.array(v, dtype=float) for k, v in groups.items()}
    nodes, modes = int(read[1][0]), int(read[1][1])
    read[8] = read[8].reshape(modes, nodes, 6)
    for k in (9, 10, 13):
        read[k] = read[k].reshape(modes, modes)
    return read


def test_mbdyn_fem_holds_the_body(tmp_path: Path) -> None:
    basis = body()
    g, v = basis.groups[0, 0], basis.groups[0, 0].invariants
    writer("mbdyn")(basis, tmp_path / "b.fem")
    read = read_fem(tmp_path / "b.fem")
    m = g.n_modes
    np.testing.assert_array_equal(read[1], [4, m, 0, 0, 0])
    np.testing.assert_array_equal(read[2], [1, 2, 3, 4])
    assert not read[3].any() and not read[4].any() and len(read[3]) == len(read[4]) == m, "at rest"
    where = np.stack([read[5], read[6], read[7]], axis=1)
    face = g.interfaces["right"]
    close(where[0], face.origin - v.point)
    close(face.rotation @ read[8][:, 0, :3].T, face.rows[:3])
    close(face.rotation @ read[8][:, 0, 3:].T, face.rows[3:])
    np.testing.assert_allclose(np.sqrt(scipy.linalg.eigvalsh(read[10], read[9])), g.omega, rtol=1e-12)
    close(read[13], g.C_r)
    mass, centre, about = read[12][0], read[12][1:4], read[12][4:].reshape(3, 3)
    assert mass == pytest.approx(basis.mass, rel=1e-12)
    close(centre + v.point, basis.centre)
    close(about, basis.inertia, 1e-10)  # differences of moments about a point 0.26 m away
    close(read[14].reshape(3, m), v.shape)


def test_mbdyn_invariants_are_the_derivatives_of_the_inertia(tmp_path: Path) -> None:
    """Inv8 + Inv8^T is dJ/dq; Inv5 is antisymmetric; Inv4 is the coupling of rotation and deflection."""
    basis = body()
    writer("mbdyn")(basis, tmp_path / "b.fem")
    read, b = read_fem(tmp_path / "b.fem"), floating_body(basis, stiffened=False)
    m = b.n_modes
    Inv8 = read[16].reshape(3, m, 3)
    Inv5 = read[17].reshape(3, m, m)
    for j, e in enumerate(np.eye(m)):
        slope = (inertia(b, e) - inertia(b, -e)) / 2
        close(Inv8[:, j] + Inv8[:, j].T, slope)
        close(read[15].reshape(3, m) + Inv5[:, j], mass_matrix(b, e)[3:6, 6:])
    close(Inv5, -Inv5.transpose(0, 2, 1))


def test_inertia_from_mbdyns_invariants_is_that_of_the_deformed_body(tmp_path: Path) -> None:
    """J(q) = J_0 + (Inv8 + Inv8^T) q - Inv9 q q at a deflection as large as the body, to rounding."""
    basis = body()
    writer("mbdyn")(basis, tmp_path / "b.fem")
    read, b = read_fem(tmp_path / "b.fem"), floating_body(basis, stiffened=False)
    m = b.n_modes
    mass, centre, about = read[12][0], read[12][1:4], read[12][4:].reshape(3, 3)
    J0 = about + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    Inv8, Inv9 = read[16].reshape(3, m, 3), read[18].reshape(3, m, m, 3)
    q = np.random.default_rng(5).normal(size=m) * max(small.SIZE) * np.sqrt(mass)
    first, second = np.einsum("ijk,j->ik", Inv8, q), np.einsum("ijlk,j,l->ik", Inv9, q, q)
    assert np.abs(second).max() > 1e-2 * np.abs(J0).max(), "the second order must show"
    close(J0 + first + first.T - second, inertia(b, q), 1e-11)


def test_equations_of_motion_from_mbdyns_groups_are_those_of_the_floating_frame(tmp_path: Path) -> None:
    """The terms of the modal joint's equations in its local frame, by the invariants, against Sextro (2.3-23)."""
    basis = body()
    writer("mbdyn")(basis, tmp_path / "b.fem")
    read, b = read_fem(tmp_path / "b.fem"), floating_body(basis, stiffened=False)
    m, rng = b.n_modes, np.random.default_rng(8)
    q, velocity, w = 1e-3 * rng.normal(size=m), rng.normal(size=m), 100 * rng.normal(size=3)
    mass, centre, about = read[12][0], read[12][1:4], read[12][4:].reshape(3, 3)
    Inv3, Inv4, Inv5 = read[14].reshape(3, m), read[15].reshape(3, m), read[17].reshape(3, m, m)
    Inv8, Inv9 = read[16].reshape(3, m, 3).transpose(1, 0, 2), read[18].reshape(3, m, m, 3).transpose(1, 2, 0, 3)
    S, T = mass * centre + Inv3 @ q, Inv4 + np.einsum("akl,k->al", Inv5, q)
    bent = Inv8 - np.einsum("jlab,j->lab", Inv9, q)  # -(r + phi q)~ phi~_l over the mass
    J = about + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    J = J + np.einsum("lab,l->ab", Inv8 + Inv8.transpose(0, 2, 1), q) - np.einsum("jlab,j,l->ab", Inv9, q, q)
    M = mass_matrix(b, q)
    close(M[3:6, :3], skew(S))
    close(M[3:6, 3:6], J, 1e-11)
    close(M[6:, 3:6].T, T)
    rest, turn = -right_side(b, w, q, velocity), skew(w)
    close(rest[:3], turn @ turn @ S + 2 * turn @ Inv3 @ velocity)
    close(rest[3:6], turn @ J @ w + 2 * np.einsum("lab,l,b->a", bent, velocity, w), 1e-11)
    centrifugal = -np.einsum("a,kba,b->k", w, bent, w)
    coriolis = -2 * np.einsum("akl,l,a->k", Inv5, velocity, w)
    close(rest[6:], centrifugal + coriolis + read[10] @ q + read[13] @ velocity, 1e-11)


# --- pyHarm -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("reduction", ["craig-bampton", "massless-boundary"])
def test_pyharm_gets_physical_coordinates_first(reduction: str, tmp_path: Path) -> None:
    basis = body(reduction=reduction)
    g = basis.groups[0, 0]
    writer("pyharm")(basis, tmp_path / "b.mat")
    read = loadmat(tmp_path / "b.mat", squeeze_me=True)
    nodes, count = list(read["nodes"]), int(read["nnodes"])
    assert nodes == ["right", "left"] and count * 6 + int(read["nmodes"]) == g.n_modes
    w2 = scipy.linalg.eigvals(read["K"], read["M"])
    w = np.sqrt(np.sort(w2[np.isfinite(w2) & (np.abs(w2) < 1e15)].real)[: len(g.omega)])
    np.testing.assert_allclose(w[: len(g.omega) // 2], g.omega[: len(w) // 2], rtol=1e-6)
    # a unit force on u_n of the second node: static displacement there is the stored compliance
    dof = 6 + INTERFACE_ROWS.index("u_n")
    answer = np.linalg.solve(read["K"], np.eye(g.n_modes)[dof])[dof]
    i = g.compliance.labels.index(f"interface:{nodes[1]}:u_n")
    assert answer == pytest.approx(g.compliance.static[i, i], rel=1e-8)


def test_pyharm_puts_characteristic_coordinates_among_the_modal_ones(tmp_path: Path) -> None:
    faces = [dict(i) for i in small.table()["interfaces"]]
    faces[0] |= {"coordinates": "characteristic", "count": 3}
    table = small.table(interfaces=faces, reduction="craig-bampton")
    basis = modal_basis(small.beam(), BodySettings.model_validate(table), provenance=SOURCE)
    g = basis.groups[0, 0]
    writer("pyharm")(basis, tmp_path / "b.mat")
    read = loadmat(tmp_path / "b.mat", squeeze_me=True)
    dof = 6 + INTERFACE_ROWS.index("u_t1")
    answer = np.linalg.solve(read["K"], np.eye(g.n_modes)[dof])[dof]
    i = g.compliance.labels.index(f"interface:{read['nodes'][1]}:u_t1")
    assert answer == pytest.approx(g.compliance.static[i, i], rel=1e-8)


def test_pyharms_c_holds_the_gyroscopic_matrix_of_a_spinning_body(tmp_path: Path) -> None:
    """pyHarm adds C times the frequency, and G times its square, to the balance of cosines and sines."""
    table = small.table(reduction="craig-bampton", rotation={"speeds_rpm": [3000.0], "axis": [1.0, 0.0, 0.0]})
    basis = modal_basis(small.beam((1, 1, 2)), BodySettings.model_validate(table), provenance=SOURCE)
    g, w = basis.groups[0, 0], 9e3
    writer("pyharm")(basis, tmp_path / "b.mat")
    read, turn = loadmat(tmp_path / "b.mat"), np.array([[0.0, 1.0], [-1.0, 0.0]])
    xc, xs = np.random.default_rng(2).normal(size=(2, g.n_modes))
    terms = w**2 * np.kron(turn @ turn, read["M"]) + w * np.kron(turn, read["C"]) + w**2 * np.kron(turn, read["G"])
    found = (terms + np.kron(np.eye(2), read["K"])) @ np.r_[xc, xs]
    gyroscopic = 1j * w * g.G_r @ (xc - 1j * xs)
    wanted = (-(w**2) * g.M_r + 1j * w * g.C_r + g.K_r) @ (xc - 1j * xs) + gyroscopic
    assert np.linalg.norm(gyroscopic) > 1e-8 * np.linalg.norm(wanted), "it must show"
    close(found, np.r_[wanted.real, -wanted.imag])


# --- xarray -----------------------------------------------------------------------------------------------------------


def test_xarray_names_axes_and_shares_the_numbers() -> None:
    pytest.importorskip("xarray")
    basis, g = body(reduction="craig-bampton"), body(reduction="craig-bampton").groups[0, 0]
    tree = to_xarray(basis)
    phi = tree["speed_0"]["phi"]
    assert phi.dims == ("node", "axis", "mode") and phi.attrs["units"] == "kg^-1/2"
    np.testing.assert_array_equal(tree["xyz"].values, basis.mesh.points)
    np.testing.assert_array_equal(tree["speed_0"]["to_diagonal"].values, g.to_diagonal)
    right = tree["speed_0"]["interface_right"].sel(interface_row="u_t2").values
    np.testing.assert_array_equal(right, g.interfaces["right"].rows[2])
    tip = tree["speed_0"]["phi"].sel(axis="z", mode=1).values
    np.testing.assert_array_equal(tip, g.phi[:, 2, 0])
    where = tree["speed_0"]["stress_nodes"].sel(component="xy").values
    np.testing.assert_array_equal(where, g.stresses["nodes"].stress[:, 3])


def test_xarray_of_a_sector_has_a_group_per_nodal_diameter() -> None:
    pytest.importorskip("xarray")
    basis = sector.basis()
    tree = to_xarray(basis)
    for (_, k), g in basis.groups.items():
        np.testing.assert_array_equal(tree[f"speed_0/nd_{k}"]["phi"].values, g.phi)


# --- ParaView ---------------------------------------------------------------------------------------------------------


def test_pvd_of_modes_is_read_by_vtk(tmp_path: Path) -> None:
    pyvista = pytest.importorskip("pyvista")
    basis, g = small.basis(), small.basis().groups[0, 0]
    writer("pvd")(basis, tmp_path / "b.pvd")
    reader = pyvista.get_reader(str(tmp_path / "b.pvd"))
    assert reader.time_values == [float(j + 1) for j in range(g.n_modes)]
    for j in range(g.n_modes):
        reader.set_active_time_point(j)
        block = reader.read()[0]
        np.testing.assert_allclose(block.point_data["shape"], g.phi[:, :, j], rtol=1e-6, atol=1e-6)
        assert block.point_data["Hz"][0] == g.frequency[j]


def test_pvd_of_the_ring_is_read_by_vtk(tmp_path: Path) -> None:
    pyvista = pytest.importorskip("pyvista")
    from microslip.exchange.vtu import write_ring

    basis = sector.basis()
    reader = pyvista.get_reader(str(write_ring(basis, tmp_path / "ring.pvd")))
    assert reader.time_values == [float(k) for _, k in sorted(basis.groups)]
    reader.set_active_time_point(1)
    block = reader.read()[0]
    assert {"mode_01_real", "mode_01_imag"} <= set(block.point_data.keys())
    assert set(np.unique(block.cell_data["sector"])) == set(range(basis.sectors))


def test_a_body_that_knows_points_only_is_shown_as_points(tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio")
    basis = replace(small.basis(), name="Prüfling", mesh=replace(small.basis().mesh, cells={}, faces={}, point_sets={}))
    for form in ("exudyn", "uff", "vtu"):
        writer(form)(basis, tmp_path / form)
    assert np.load(tmp_path / "exudyn", allow_pickle=False)["trigList"].shape == (0, 3)
    assert (tmp_path / "uff").read_bytes().isascii()
    (tmp_path / "vtu").rename(tmp_path / "b.vtu")
    assert len(meshio.read(tmp_path / "b.vtu").cells_dict["vertex"]) == basis.mesh.n_points


# --- what is refused --------------------------------------------------------------------------------------------------

MOTION = ("exudyn", "mbdyn", "sid")
COMPILER = pytest.mark.skipif(shutil.which("cc") is None, reason="a C compiler is not installed")
ALL = [pytest.param(form, marks=COMPILER) if form == "fmu" else form for form in formats()]


@pytest.mark.parametrize("form", ALL)
def test_a_folder_that_cannot_be_written(form: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    basis = body(reduction="craig-bampton") if form in ("pyharm", "dmig") else small.basis()
    refused("cannot be written", writer(form), basis, tmp_path / "file" / "export")
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("form", ALL)
def test_same_basis_same_bytes(form: str, tmp_path: Path) -> None:
    basis = body(reduction="craig-bampton")
    for name in ("a", "b"):
        writer(form)(basis, tmp_path / name / f"x{formats()[form].ending}")
    files = [p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*") if p.is_file()]
    assert files
    for file in files:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes(), file


@pytest.mark.parametrize("form", ALL)
def test_every_file_says_units_frame_order_and_signs(form: str, tmp_path: Path) -> None:
    """In words, where its reader sees them; the universal file has 80 columns and a data set of units for it."""
    path = tmp_path / f"x{formats()[form].ending}"
    writer(form)(body(reduction="craig-bampton"), path)
    if form in ("mat", "pyharm"):
        said = str(loadmat(path, squeeze_me=True)["readme"])
    elif form == "exudyn":
        said = str(np.load(path)["microslip_readme"])
    elif form == "fmu":
        said = zipfile.ZipFile(path).read("modelDescription.xml").decode()
    else:
        endings = (".txt", ".vtu", ".pvd", ".fem", ".SID_FEM", ".uff", ".pch")
        files = [p for p in tmp_path.rglob("*") if p.suffix in endings]
        texts = [p.read_bytes()[:3000].decode("latin-1") for p in files]
        said = texts[0].replace("\n$ ", " ")  # comments in lines of cards
        assert all("SI" in t for t in texts)
    order = {
        "pyharm": "Physical coordinates first", "exudyn": "x, y, z of each node in turn", "mtx": "coordinates.csv",
        "mbdyn": "x y z rx ry rz", "sid": "m1(row, q, column)", "uff": "x y z of each node", "vtu": "vectors x y z",
        "pvd": "vectors x y z", "fmu": "n outwards, t1, t2", "dmig": "displacements 1 to 6 in the basic system",
    }  # fmt: skip
    assert "SI" in said and "of the mesh" in said and order.get(form, "") in said
    assert form == "uff" or "forces positive along their displacements" in said


def without(**changes: Any) -> ModalBasis:
    return replace(small.basis(), groups={(0, 0): replace(small.basis().groups[0, 0], **changes)})


CANNOT: dict[str, tuple[tuple[str, ...], Callable[[], ModalBasis]]] = {
    "shapes = true": (("exudyn", "uff", "pvd"), lambda: without(phi=np.zeros((0, 3, 6)))),
    "--speed 0 to 1": ((*MOTION, "pyharm", "dmig", "fmu"), lambda: small.basis((0.0, 3000.0))),
    "--nodal-diameter 0 to": ((*MOTION, "pyharm", "dmig", "fmu"), sector.basis),
    "complex shapes": (("pyharm", "dmig"), lambda: select(sector.basis(), None, 1)),
    'reduction = "craig-bampton"': (("pyharm", "dmig"), small.basis),
    "at rest": (MOTION, lambda: select(small.basis((0.0, 3000.0)), 1, None)),
    "mesh the whole body": ((*MOTION, "fmu"), lambda: select(sector.basis(), None, 1)),
    "no inertia integrals": (MOTION, lambda: without(invariants=None)),
    "attach": (("mbdyn", "sid"), lambda: without(interfaces={}, monitors={})),
    # coordinates without mass, forces, residual shapes hold part of the static answer: not in modes alone
    **{
        f'"{name}" keeps flexibility beside the modes': ((*MOTION, "fmu"), partial(body, reduction=name))
        for name in ("massless-boundary", "dual-craig-bampton", "macneal")
    },
}


@pytest.mark.parametrize("words", CANNOT)
def test_what_a_format_cannot_hold_is_refused(words: str, tmp_path: Path) -> None:
    forms, basis = CANNOT[words]
    for form in forms:
        refused(words, writer(form), basis(), tmp_path / "x")
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("reduction", ["craig-bampton", "rubin"])
def test_sid_holds_the_static_answer_of_the_interfaces(reduction: str, tmp_path: Path) -> None:
    basis = body(reduction=reduction)
    g = basis.groups[0, 0]
    writer("sid")(basis, tmp_path / "b.SID_FEM")
    _, modal = read_sid(tmp_path / "b.SID_FEM")
    nodes, K = modal["frame"].inside, modal["Ke"].taylor()[0]
    face = g.interfaces["left"]
    T = face.rotation @ nodes[1]["phi"].taylor()[0]
    at = [g.compliance.labels.index(f"interface:left:{row}") for row in INTERFACE_ROWS[:3]]
    wanted = g.compliance.static[np.ix_(at, at)]
    close(T @ np.linalg.solve(K, T.T), wanted, 1e-8)


def test_free_bodies_leave_their_rigid_modes_to_the_frame(tmp_path: Path) -> None:
    basis = small.basis(free=True)
    g = basis.groups[0, 0]
    assert list(g.kind).count("rigid") == 6 == g.n_modes
    refused("rigid motions only", elastic, g, "sid")


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("cli") / "basis.h5"
    write_basis(path, body(reduction="craig-bampton"))
    return path


@pytest.mark.parametrize("form", ALL)
def test_the_command_line_writes_each_format(form: str, file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(file), "--to", form]) == 0
    said = Path(capsys.readouterr().out.strip())
    assert said.exists() and said.name == f"basis{formats()[form].ending}"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--to", "nastran"], "unknown format; choose one of dmig"),
        (["--to", "sid", "--speed", "3"], "count from 0"),
        (["--to", "uff", "--nodal-diameter", "2"], "the file has 0"),
    ],
)
def test_mistakes_are_one_sentence_and_exit_code_2(
    words: list[str], says: str, file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    refused_command(["export", str(file), *words, "-o", str(tmp_path / "out")], capsys, says)
    assert not any(tmp_path.iterdir())


# --- the page ---------------------------------------------------------------------------------------------------------


def blocks() -> dict[str, str]:
    """Heading of docs/exchange.md -> its Python."""
    page = (Path(__file__).parents[1] / "docs" / "exchange.md").read_text(encoding="utf-8")
    parts = re.findall(r"^#+ (.*)$((?:.|\n)*?)(?=^#+ |\Z)", page, flags=re.M)
    return {head: "\n".join(re.findall(r"```python\n(.*?)```", text, flags=re.S)) for head, text in parts}


@pytest.mark.parametrize("head", ["Matrix Market", "Universal files", "xarray"])
def test_the_readers_lines_of_the_page_run(
    head: str, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip({"Universal files": "pyuff", "xarray": "xarray"}.get(head, "scipy"))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "basis.h5").write_bytes(file.read_bytes())
    for form in ("mtx", "uff"):
        assert main(["export", "basis.h5", "--to", form]) == 0
    names: dict[str, Any] = {}
    exec(blocks()[head], names)
    g = read_basis(file).groups[0, 0]
    if head == "Matrix Market":
        i = g.compliance.labels.index("interface:right:u_n")
        assert names["normal_compliance"] == pytest.approx(g.compliance.static[i, i], rel=1e-8)
    elif head == "Universal files":
        assert f"{g.frequency[0]:.5e}" == f"{names['modes'][0]['freq']:.5e}"
    else:
        np.testing.assert_array_equal(names["normal"], g.interfaces["right"].rows[0])


def test_the_table_names_what_there_is() -> None:
    page = (Path(__file__).parents[1] / "docs" / "exchange.md").read_text(encoding="utf-8")
    first = [line.split("|")[1] for line in page.splitlines() if line.startswith("| [")]
    named = {name for cell in first for name in re.findall(r"`(\w+)`", cell)}
    assert named - {"to_xarray"} <= set(formats())


def test_an_exporter_of_another_package_is_one_file(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Named by an entry point; one that is none, or takes a name that is taken, is refused."""
    package = tmp_path / "site"
    (package / "other-1.0.dist-info").mkdir(parents=True)
    (package / "other.py").write_text(
        "from microslip.exchange import Format\n"
        "own = Format('names', '.txt', 'people', lambda basis, path: path.write_text(basis.name))\n"
        "taken = Format('mat', '.m', 'nobody', own.write)\n"
    )
    points = package / "other-1.0.dist-info" / "entry_points.txt"
    (package / "other-1.0.dist-info" / "METADATA").write_text("Name: other\nVersion: 1.0\n")
    monkeypatch.syspath_prepend(package)
    for value, code in (("other:own", 0), ("other:taken", 2), ("other:write", 2)):
        points.write_text(f"[microslip.exporter]\nx = {value}\n")
        formats.cache_clear()
        assert main(["export", str(file), "--to", "names", "-o", str(tmp_path / "names.txt")]) == code
        assert code == 0 or "microslip.exporter: other:" in capsys.readouterr().err
    formats.cache_clear()
    assert (tmp_path / "names.txt").read_text() == read_basis(file).name


@pytest.mark.parametrize("form", ALL)
def test_an_export_replaces_its_like_and_neither_notes_nor_its_own_input(
    form: str, file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, notes = tmp_path / "vane.h5", tmp_path / "notes.txt"
    shutil.copy(file, source)
    notes.write_text("microslip: buy milk")
    for target in (source, notes):
        before = target.read_bytes()
        assert main(["export", str(source), "--to", form, "-o", str(target)]) == 2
        assert str(target) in capsys.readouterr().err and target.read_bytes() == before
    for _ in range(2):
        assert main(["export", str(source), "--to", form, "-o", str(tmp_path / "new")]) == 0
