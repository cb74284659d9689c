"""A body that another program has assembled: the same modal file as from our own elements, whatever the format."""

from __future__ import annotations

import random
from functools import cache, partial
from pathlib import Path

import decks
import h5py
import meshes
import numpy as np
import pytest
import scipy.io
import scipy.linalg
import scipy.optimize
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused, refused_command

from microslip.basis import check_basis, read_basis
from microslip.cli import main
from microslip.elasticity import isotropic
from microslip.errors import UserError
from microslip.exchange.matrices import _in_si, matrix_names, read_matrices
from microslip.fem.discretise import discretise
from microslip.fem.operators import mass, stiffness
from microslip.modal.compute import modal_basis
from microslip.stages.job import open_job
from microslip.stages.modal import modes_stage

pytestmark = pytest.mark.usefixtures("undrawn", "unjudged")

SIZE = (0.01, 0.014, 0.04)
ROWS = """
[[interfaces]]
name = "tip"
face = "z1"
t2 = [0, 1, 0]
[[excitations]]
name = "shaker"
node = 30
direction = [1, 2, 0]
[[monitors]]
name = "probe"
node = 30
[damping]
ratio = 0.01
[modes]
count = 6
solver = "superlu"
"""
HEAD = "%%MatrixMarket matrix coordinate real general\n"
SUPPORT = '[[supports]]\nface = "z0"\n'


@cache
def beam():
    return meshes.brick("hexahedron20", (1, 1, 3), SIZE, to=meshes.shaken(0.0005))


@cache
def operators() -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """K (N/m) and M (kg), three rows a node in the order of the nodes."""
    d = discretise(beam())
    K = d.pattern.full(stiffness(d, isotropic(2.1e11, 0.3)))
    return K, sp.kron(d.pattern.full(mass(d, 7850.0)), np.eye(3)).tocsr()


def write_nodes(folder: Path, mesh=None, scale=1.0) -> None:
    mesh = mesh or beam()
    rows = np.column_stack([mesh.node_id, mesh.points * scale])
    np.savetxt(folder / "nodes.csv", rows, delimiter=",", header="node,x,y,z", comments="", fmt="%d,%.17g,%.17g,%.17g")


def write_body(
    folder: Path, stiff="K.mtx", mass_="M.mtx", top="", more=SUPPORT, unit="m", nodes="nodes.csv", rows=ROWS
) -> None:
    sets = "".join(f"{name} = {beam().node_id[beam().face_points(name)].tolist()}\n" for name in ("z0", "z1"))
    (folder / "body.toml").write_text(
        f'name = "part"\nlength_unit = "{unit}"\n'
        f'[geometry.matrices]\nstiffness = "{stiff}"\nmass = "{mass_}"\nnodes = "{nodes}"\n{top}'
        f"[geometry.matrices.sets]\n{sets}{more}{rows}"
    )


def made(folder: Path, *changes: str):
    path, warnings = modes_stage(open_job(folder, list(changes), root=folder))
    return read_basis(path), warnings


def given_by_market(folder: Path, **how) -> None:
    K, M = operators()
    scipy.io.mmwrite(folder / "K.mtx", K, symmetry="general", precision=17)
    scipy.io.mmwrite(folder / "M.mtx", M, symmetry="symmetric", precision=17)
    write_nodes(folder)
    write_body(folder, **how)


def own(reduction="eigenmodes", supports=True):
    """The same body from our own elements; its rows by the same even fit, so the interface is left out."""
    K = {"supports": [{"face": "z0"}]} if supports else {"free": True}
    what = meshes.body(
        excitations=[{"name": "shaker", "node": 30, "direction": [1.0, 2.0, 0.0]}],
        monitors=[{"name": "probe", "node": 30}], damping={"ratio": 0.01},
        modes={"count": 6, "solver": "superlu"}, reduction=reduction, **K,
    )  # fmt: skip
    return modal_basis(beam(), what)


# the same modal file -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("reduction", ["eigenmodes", "rubin", "macneal"])
def test_foreign_and_own_assembly_give_the_same_modal_file(tmp_path, reduction):
    """Rounding: the pencils are the same numbers; signs are decided by phi alone, without an interface."""
    rows = ROWS[ROWS.index("[[excitations]]") :]
    given_by_market(tmp_path, rows=rows)
    foreign, told = made(tmp_path, f"reduction={reduction}")
    ours = own(reduction)
    a, b = foreign.groups[0, 0], ours.groups[0, 0]
    assert not told and foreign.source == "matrices" and a.kind == b.kind
    np.testing.assert_allclose(a.omega, b.omega, rtol=1e-9)
    np.testing.assert_allclose(a.phi, b.phi, atol=1e-7 * np.abs(b.phi).max())
    for name in ("M_r", "K_r", "C_r"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), atol=1e-8 * np.abs(getattr(b, name)).max())
    for part in ("static", "modal", "plain"):
        theirs, mine = getattr(a.compliance, part), getattr(b.compliance, part)
        np.testing.assert_allclose(theirs, mine, atol=1e-8 * np.abs(mine).max())
    np.testing.assert_allclose(a.monitors["probe"].rows, b.monitors["probe"].rows, atol=1e-7 * np.abs(b.phi).max())
    assert a.checks["certified"] == 1.0
    np.testing.assert_allclose(foreign.mass, ours.mass, rtol=1e-12)
    np.testing.assert_allclose(foreign.centre, ours.centre, atol=1e-12)
    np.testing.assert_allclose(foreign.inertia, ours.inertia, rtol=1e-9, atol=1e-9 * ours.inertia.max())
    failed = [c.name for c in check_basis(foreign) if not c.passed]
    assert not failed, failed


@pytest.mark.parametrize("reduction", ["rubin", "craig-bampton", "dual-craig-bampton"])
def test_free_foreign_body_keeps_six_rigid_modes_in_every_reduction(tmp_path, reduction):
    given_by_market(tmp_path, more="")
    count = "modes.count=10"
    foreign, _ = made(tmp_path, "free=true", f"reduction={reduction}", count)
    g = foreign.groups[0, 0]
    assert foreign.free and (g.omega[:6] == 0).all() and (g.omega[6:] > 0).all()
    K, M = operators()
    exact = np.sqrt(scipy.linalg.eigh(K.toarray(), M.toarray(), eigvals_only=True, subset_by_index=[6, 9]))
    if reduction == "rubin":
        np.testing.assert_allclose(g.omega[6:10], exact, rtol=1e-8)
    else:  # ten modes with the patch held (or with forces on it) are a coarser space: only the first comes close
        np.testing.assert_allclose(g.omega[6], exact[0], rtol=1e-3)
    assert all(c.passed for c in check_basis(foreign))


def test_rows_of_a_node_list_read_a_rigid_motion_exactly(tmp_path):
    """u = t + w x (x - origin) of the listed nodes gives t and w in the interface's frame."""
    given_by_market(tmp_path, more="")
    g = made(tmp_path, "free=true")[0].groups[0, 0]
    face = g.interfaces["tip"]
    nodes = beam().face_points("z1")
    at = beam().points[nodes] - face.origin
    rigid = np.einsum("ij,nim->njm", np.eye(3), g.phi[nodes][:, :, :6])
    for j in range(6):
        t, w = face.rotation.T @ face.rows[:3, j], face.rotation.T @ face.rows[3:, j]
        np.testing.assert_allclose(t + np.cross(w, at), rigid[:, :, j], atol=1e-9 * np.abs(g.phi).max())
    assert face.fit_residual[:6].max() < 1e-7
    assert face.rotation[0, 2] > 0.9  # outwards: z1 is the upper end


@pytest.mark.skipif(decks.CCX is None, reason="needs CalculiX")
@pytest.mark.parametrize("grounded", [False, True])
def test_matrix_storage_of_calculix_gives_its_own_frequencies(tmp_path, grounded):
    """1e-6: CalculiX prints seven digits of a frequency and fourteen of an entry."""
    lines = [*decks.mesh_lines(beam(), sets=("z0", "z1")), *decks.MATERIAL, decks.section()]
    held = ["*BOUNDARY", "z0, 1, 3"]
    theirs = decks.run(tmp_path, "plain", [*lines, *held, *decks.frequency_step(6)])
    decks.run(tmp_path, "block", [*lines, *(held if grounded else []), *decks.frequency_step(6, storage=True)])
    write_body(
        tmp_path, "block.sti", "block.mas", "grounded = true\n" if grounded else "", "" if grounded else SUPPORT,
        "mm", "plain.inp",
    )  # fmt: skip
    basis, told = made(tmp_path)
    assert not told
    np.testing.assert_allclose(basis.groups[0, 0].frequency[:6], theirs[:6], rtol=1e-6)
    assert basis.mesh.n_cells == 3 and all(c.passed for c in check_basis(basis))


# formats -------------------------------------------------------------------------------------------------------------


def by_mat(folder):
    K, M = operators()
    scipy.io.savemat(folder / "all.mat", {"K": K, "M": M.toarray(), "other": 3.0})
    return "all.mat", "all.mat#M"


def by_hdf5(folder):
    K, M = operators()
    with h5py.File(folder / "all.h5", "w") as file:
        entries = K.tocoo()
        for part, data in (("row", entries.row), ("col", entries.col), ("data", entries.data)):
            file[f"model/K/{part}"] = data
        for part in ("indptr", "indices", "data"):
            file[f"model/M/{part}"] = getattr(M, part)
    return "all.h5#model/K", "all.h5#model/M"


def by_matlab73(folder):
    """As MATLAB 7.3 stores sparse matrices: compressed columns; and full ones with dimensions reversed."""
    K, M = operators()
    with h5py.File(folder / "all.mat", "w") as file:
        columns = K.tocsc()
        for part, data in (("jc", columns.indptr), ("ir", columns.indices), ("data", columns.data)):
            file[f"K/{part}"] = data
        file["M"] = M.toarray().T
    return "all.mat", "all.mat"


def by_op4(folder):
    op4 = pytest.importorskip("pyyeti.nastran.op4")
    K, M = operators()
    op4.write(str(folder / "all.op4"), {"kaa": K.tocoo(), "maa": M.toarray()}, sparse="auto")
    return "all.op4", "all.op4"


def by_dmig(folder):
    bulk = pytest.importorskip("pyyeti.nastran.bulk")
    import pandas

    K, M = operators()
    dofs = pandas.MultiIndex.from_product([beam().node_id, [1, 2, 3]], names=["id", "dof"])
    frames = {name: pandas.DataFrame(A.toarray(), dofs, dofs) for name, A in (("kaax", K), ("maax", M))}
    bulk.wtdmig(str(folder / "all.pch"), frames)
    return "all.pch", "all.pch"


def by_array(folder):
    K, M = operators()
    scipy.io.mmwrite(folder / "K.mtx", K.toarray(), symmetry="symmetric", precision=17)
    scipy.io.mmwrite(folder / "M.mtx", M.toarray(), symmetry="general", precision=17)
    return "K.mtx", "M.mtx"


WAYS = {"mat": by_mat, "h5": by_hdf5, "mat73": by_matlab73, "op4": by_op4, "dmig": by_dmig, "array": by_array}
DIGITS = {"dmig": 1e-8}  # cards print nine digits


@pytest.mark.usefixtures("untried")
@pytest.mark.parametrize("way", WAYS)
def test_every_format_brings_the_numbers_that_were_written(tmp_path, way):
    stiff, mass_ = WAYS[way](tmp_path)
    write_nodes(tmp_path)
    write_body(tmp_path, stiff, mass_)
    job = open_job(tmp_path, root=tmp_path)
    body = read_matrices(job.settings.geometry.matrices, tmp_path, "m")
    K, M = operators()
    for found, wanted in ((body.stiffness, K), (body.mass, M)):
        assert abs(found - wanted).max() <= DIGITS.get(way, 1e-15) * abs(wanted).max()
    np.testing.assert_array_equal(body.component, np.tile([0, 1, 2], beam().n_points))
    np.testing.assert_allclose(body.mesh.points, beam().points, rtol=1e-15)


@pytest.mark.usefixtures("untried")
@pytest.mark.parametrize("kind", ["grid", "h5", "mat"])
def test_nodes_come_from_grid_cards_and_tables(tmp_path, kind):
    from microslip.exchange.matrices.nodes import read_nodes

    table = np.column_stack([beam().node_id, beam().points * 1e3])
    if kind == "grid":
        bulk = pytest.importorskip("pyyeti.nastran.bulk")
        bulk.wtgrids(str(tmp_path / "a.bdf"), beam().node_id, xyz=table[:, 1:], form="{:16.10f}")
        found = read_nodes(tmp_path / "a.bdf", "", "mm")
    elif kind == "h5":
        with h5py.File(tmp_path / "a.h5", "w") as file:
            file["mesh/nodes"] = table.T  # as MATLAB writes it
        found = read_nodes(tmp_path / "a.h5", "mesh/nodes", "mm")
    else:
        scipy.io.savemat(tmp_path / "a.mat", {"nodes": table, "K": np.eye(3)})
        found = read_nodes(tmp_path / "a.mat", "", "mm")
    np.testing.assert_array_equal(found.node_id, beam().node_id)
    np.testing.assert_allclose(found.points, beam().points, atol=1e-13 if kind == "grid" else 1e-17)


def test_every_matrix_has_its_own_power_of_the_unit_of_time():
    """kN/mm, kN ms/mm and kg; of rotations kN mm, N m s and kg mm2."""
    for role, unit in (("stiffness", 1e6), ("damping", 1e3), ("gyroscopic", 1e3), ("mass", 1.0)):
        found = _in_si(sp.identity(2, format="csr"), role, "mm-kg-ms", np.array([0, 3])).toarray()
        np.testing.assert_allclose(found, unit * np.diag([1.0, 1e-6]), rtol=1e-14)


def test_rows_in_another_order_and_other_units_are_the_same_body(tmp_path):
    """Rows shuffled with a list that names them; numbers in t, mm, s."""
    given_by_market(tmp_path)
    first = made(tmp_path)[0].groups[0, 0]
    K, M = operators()
    order = np.random.default_rng(3).permutation(K.shape[0])
    other = tmp_path / "other"
    other.mkdir()
    scipy.io.mmwrite(other / "K.mtx", K[order][:, order] * 1e-3, precision=17)
    scipy.io.mmwrite(other / "M.mtx", M[order][:, order] * 1e-3, precision=17)
    write_nodes(other, scale=1e3)
    (other / "rows.txt").write_text("".join(f"{beam().node_id[i // 3]}, {i % 3 + 1}\n" for i in order))
    write_body(other, top='dofs = "rows.txt"\n', unit="mm")
    second = made(other)[0].groups[0, 0]
    np.testing.assert_allclose(second.omega, first.omega, rtol=1e-9)
    np.testing.assert_allclose(second.phi, first.phi, atol=1e-7 * np.abs(first.phi).max())
    np.testing.assert_allclose(
        second.compliance.static, first.compliance.static, atol=1e-8 * np.abs(first.compliance.static).max()
    )


# superelements, damping, small systems -------------------------------------------------------------------------------


def superelement(folder: Path, modes=8) -> None:
    """Craig-Bampton matrices of the beam with both ends kept, physical coordinates first (Craig, Bampton 1968)."""
    K, M = (A.toarray() for A in operators())
    nodes = np.union1d(beam().face_points("z0"), beam().face_points("z1"))
    b = (3 * nodes[:, None] + np.arange(3)).ravel()
    i = np.setdiff1d(np.arange(len(K)), b)
    constraint = -np.linalg.solve(K[np.ix_(i, i)], K[np.ix_(i, b)])
    fixed = scipy.linalg.eigh(K[np.ix_(i, i)], M[np.ix_(i, i)], subset_by_index=[0, modes - 1])[1]
    T = np.zeros((len(K), len(b) + modes))
    T[b, : len(b)] = np.eye(len(b))
    T[i, : len(b)], T[i, len(b) :] = constraint, fixed
    scipy.io.savemat(folder / "se.mat", {"K": T.T @ K @ T, "M": T.T @ M @ T})
    (folder / "rows.txt").write_text("".join(f"{beam().node_id[n]}.{c}\n" for n in nodes for c in (1, 2, 3)))
    write_nodes(folder)


@pytest.mark.usefixtures("untried")
def test_superelement_comes_in_with_its_interface(tmp_path):
    """Held at one end it has the frequencies of the whole body, from above (Rayleigh) and close."""
    superelement(tmp_path)
    rows = ROWS.replace("node = 30", f"node = {beam().node_id[beam().face_points('z1')[0]]}")
    top = 'dofs = "rows.txt"\nsuperelement = true\n'
    write_body(tmp_path, "se.mat", "se.mat", top, rows=rows)
    basis, told = made(tmp_path, "modes.count=3")
    exact = own().groups[0, 0].omega[:3]
    found = basis.groups[0, 0].omega[:3]
    assert not told and (found > exact * (1 - 1e-9)).all()
    np.testing.assert_allclose(found, exact, rtol=2e-3)
    np.testing.assert_allclose(basis.mass, operators()[1].sum() / 3, rtol=1e-9)  # constraint modes are rigid there
    assert all(c.passed for c in check_basis(basis))


@pytest.mark.usefixtures("untried")
def test_superelement_whose_interface_does_not_match_is_refused(tmp_path, capsys):
    superelement(tmp_path)
    top = 'dofs = "rows.txt"\nsuperelement = true\n'
    middle = np.setdiff1d(np.arange(beam().n_points), np.union1d(beam().face_points("z0"), beam().face_points("z1")))
    lost = beam().node_id[middle[:4]].tolist()
    rows = ROWS.replace("node = 30", f"node = {beam().node_id[beam().face_points('z1')[0]]}")
    write_body(tmp_path, "se.mat", "se.mat", top, rows=rows.replace('face = "z1"', 'face = "lost"'))
    text = (tmp_path / "body.toml").read_text()
    (tmp_path / "body.toml").write_text(text.replace("z0 = [", f"lost = {lost}\nz0 = [", 1))
    refused_command(["modes", str(tmp_path)], capsys, f"node {lost[0]}", "no rows in the matrices")
    write_body(tmp_path, "se.mat", "se.mat", 'dofs = "rows.txt"\n', rows=rows)
    refused_command(["modes", str(tmp_path)], capsys, "gives no node to 8 of the")


def chain(folder: Path, more: str = "") -> None:
    """Three masses 1, 2, 3 kg on a line, springs and dampers between them and to the ground; G couples x and y."""
    K = np.kron(np.array([[300.0, -200, 0], [-200, 300, -100], [0, -100, 100]]), np.eye(3))
    M = np.kron(np.diag([1.0, 2, 3]), np.eye(3))
    C = np.kron(np.array([[3.0, -2, 0], [-2, 2, 0], [0, 0, 0]]), np.eye(3))
    G = np.kron(np.diag([1.0, 2, 3]), np.array([[0, -4.0, 0], [4, 0, 0], [0, 0, 0]]))
    scipy.io.savemat(folder / "three.mat", {"M": M, "C": C, "K": K, "G": G, "nodes": [[i, i, 0, 0] for i in (1, 2, 3)]})
    (folder / "body.toml").write_text(
        'name = "three"\nlength_unit = "m"\n[geometry.matrices]\nstiffness = "three.mat"\nmass = "three.mat"\n'
        'damping = "three.mat"\ngyroscopic = "three.mat"\nnodes = "three.mat"\ngrounded = true\n'
        '[[excitations]]\nname = "push"\nnode = 3\ndirection = [1, 0, 0]\n[[monitors]]\nname = "at"\nnode = 1\n' + more
    )


@pytest.mark.usefixtures("untried")
def test_three_masses_with_damper_and_spin_keep_their_own_complex_eigenvalues(tmp_path):
    chain(tmp_path)
    basis, _ = made(tmp_path)
    g = basis.groups[0, 0]
    files = scipy.io.loadmat(tmp_path / "three.mat")

    def eigenvalues(M, D, K):
        n = len(M)
        A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, D)]])
        return np.sort_complex(np.linalg.eigvals(A))

    exact = eigenvalues(files["M"], files["C"] + files["G"], files["K"])
    np.testing.assert_allclose(eigenvalues(g.M_r, g.C_r + g.G_r, g.K_r), exact, atol=1e-9 * np.abs(exact).max())
    at = 1j * 7.0  # a receptance through the file's own rows
    D = at**2 * files["M"] + at * (files["C"] + files["G"]) + files["K"]
    r = at**2 * g.M_r + at * (g.C_r + g.G_r) + g.K_r
    own_ = g.monitors["at"].rows @ np.linalg.solve(r, g.excitations["push"].rows[0])
    np.testing.assert_allclose(own_, np.linalg.inv(D)[:3, 6], atol=1e-12 * np.abs(own_).max() * 100)
    assert basis.damping_source == "matrix" and all(c.passed for c in check_basis(basis))


@pytest.mark.usefixtures("untried")
def test_a_node_with_rotations_is_an_interface_of_its_own(tmp_path):
    """A rigid block on a six-way spring: rows of the single node are its own displacements and rotations, turned."""
    K, M = np.diag([4e4, 9e4, 1.6e5, 1.0, 4.0, 9.0]), np.diag([1.0, 1, 1, 1e-4, 1e-4, 1e-4])
    scipy.io.savemat(tmp_path / "b.mat", {"K": K, "M": M, "nodes": [[7.0, 0.1, 0.2, 0.3]]})
    (tmp_path / "body.toml").write_text(
        'name = "b"\nlength_unit = "m"\n[geometry.matrices]\nstiffness = "b.mat"\nmass = "b.mat"\nnodes = "b.mat"\n'
        'grounded = true\nsets = { hub = [7] }\n[[interfaces]]\nname = "hub"\nface = "hub"\nt2 = [0, 0, 1]\n'
        "normal = [0, 1, 0]\n"
    )
    g = made(tmp_path)[0].groups[0, 0]
    np.testing.assert_allclose(g.omega, np.sort(np.sqrt(np.diag(K) / np.diag(M))), rtol=1e-12)
    R = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])  # n = y, t1 = t2 x n = -x, t2 = z
    np.testing.assert_allclose(g.interfaces["hub"].rotation, R, atol=1e-15)
    static = scipy.linalg.block_diag(R, R) @ np.linalg.inv(K) @ scipy.linalg.block_diag(R, R).T
    np.testing.assert_allclose(g.compliance.static, static, atol=1e-14)


LINE_K = 1e6 * np.array([[2.0, -1, 0], [-1, 2, -1], [0, -1, 1]])
LINE_CASE = """
name = "line"
body = "line"
excitation = "push"
amplitude = 2.0
monitor = "at"
harmonics = 1
samples = 512
[[contacts]]
interface = "rub"
normal_stiffness = 1e6
tangential_stiffness = 5e5
friction = 0.3
law = "LAW"
[sweep]
start = 90.0
stop = 110.0
points = 3
normal_forces = [5.0]
"""


def line(folder: Path, each: int) -> None:
    """Three masses of 1 kg in a line, spring by spring, as two .mtx files: `each` directions a node, one or three."""
    for name, A in (("K", LINE_K), ("M", np.eye(3))):
        scipy.io.mmwrite(folder / f"{name}.mtx", sp.csr_matrix(np.kron(A, np.eye(each))), precision=17)
    (folder / "nodes.csv").write_text("node,x,y,z\n1,0,0,0\n2,0.1,0,0\n3,0.2,0,0\n")
    (folder / "dofs.csv").write_text("node,direction\n1,1\n2,1\n3,1\n")
    (folder / "body.toml").write_text(
        'name = "line"\nlength_unit = "m"\n[geometry.matrices]\nstiffness = "K.mtx"\nmass = "M.mtx"\n'
        'nodes = "nodes.csv"\ngrounded = true\nsets = { end = [3] }\n' + ('dofs = "dofs.csv"\n' if each == 1 else "")
        + '[[interfaces]]\nname = "rub"\nface = "end"\nnormal = [0, 0, 1]\nt2 = [0, 1, 0]\n'
        '[[excitations]]\nname = "push"\nnode = 1\ndirection = [1, 0, 0]\n[[monitors]]\nname = "at"\nnode = 3\n'
        "[damping]\nratio = 0.01\n[modes]\ncount = 9\n"
    )  # fmt: skip


def rubbing_line(frequency: float, samples: int) -> complex:
    """The motion of the last mass with one harmonic: dense matrices, a Jenkins element marched in steps of time."""
    w, (values, X) = 2 * np.pi * frequency, np.linalg.eigh(LINE_K)
    S = np.linalg.inv(LINE_K + 1j * w * X @ np.diag(0.02 * np.sqrt(values)) @ X.T - w**2 * np.eye(3))
    turns, k, limit = np.exp(2j * np.pi * np.arange(samples) / samples), 5e5, 0.3 * 5.0

    def friction(u: complex) -> complex:
        path, force, out = (u * turns).real, 0.0, [0.0] * samples
        steps = (k * (path - np.roll(path, 1))).tolist()
        for _ in range(3):
            for i, step in enumerate(steps):
                out[i] = force = min(max(force + step, -limit), limit)
        return 2 * np.mean(out / turns)

    def left(x):
        u = 1e-6 * complex(*x)
        r = u - S[2, 0] * 2.0 + S[2, 2] * friction(u)
        return 1e6 * np.array([r.real, r.imag])

    stuck = S[2, 0] * 2.0 / (1 + S[2, 2] * k) * 1e6
    return 1e-6 * complex(*scipy.optimize.root(left, [stuck.real, stuck.imag], tol=1e-10).x)


@pytest.mark.parametrize(
    ("each", "law"),
    [(1, "jenkins"), *(pytest.param(*how, marks=pytest.mark.slow) for how in ((3, "jenkins"), (1, "smooth")))],
)
def test_masses_in_a_line_rub_at_a_single_node(tmp_path, capsys, monkeypatch, each, law):
    """Two .mtx files, an interface on one node without rotations, a Jenkins element there; against dense matrices.

    The march of this page is off by the second order of a step of 2 pi/2048, some 1e-5 of the friction.
    """
    pytest.importorskip("jax")
    from microslip.case import run

    monkeypatch.setattr(run._Run, "_judge", lambda *_: True)  # no estimate of the error of harmonics
    monkeypatch.chdir(tmp_path)
    line(tmp_path, each)
    (tmp_path / "case.toml").write_text(LINE_CASE.replace("LAW", law))
    assert main(["modes", "body.toml"]) == 0
    said = capsys.readouterr().err
    assert "'rub'" in said and "phi_x phi_y phi_z" in said and ("u_y" in said) == (each == 1)
    assert main(["check", "build/line/basis.h5"]) == 0
    still = "u_n, u_t2, phi_n, phi_t1, phi_t2" if each == 1 else "along phi_n, phi_t1, phi_t2"
    assert still in capsys.readouterr().out
    basis = read_basis(tmp_path / "build/line/basis.h5")
    rows = basis.groups[0, 0].interfaces["rub"].rows
    assert basis.mass == pytest.approx(3.0) and rows.shape == (6, 3 * each) and not rows[3:].any()
    assert main(["respond", "case.toml", "-q"]) == 0
    table = np.genfromtxt(tmp_path / "build/line/response.csv", delimiter=",", names=True)
    found = table["amplitude_m_FN_5_N"] * np.exp(1j * table["phase_rad_FN_5_N"])
    exact = np.array([rubbing_line(f, 2048) for f in table["frequency_Hz"]])
    assert (np.abs(exact) > 0.3 * 5.0 / 5e5).all()  # it slides
    np.testing.assert_allclose(found, exact, rtol=1e-4 if law == "jenkins" else 1e-3)


def beam_with_rotations(folder: Path, support: str) -> None:
    """Six Euler beams on a line, six rows a node; the cross-section's torsion moves no node."""
    n, length, EA, GJ, EI, rho, J = 7, 0.1, 4e7, 1e3, 2e3, 1.5, 5e-4
    K, M = np.zeros((6 * n, 6 * n)), np.zeros((6 * n, 6 * n))
    bar, mass = np.array([[1.0, -1], [-1, 1]]), np.array([[2.0, 1], [1, 2]]) / 6
    for e in range(n - 1):
        for sign, at in ((1, [1, 5, 7, 11]), (-1, [2, 4, 8, 10])):
            a, b = sign * 6 * length, 2 * length**2
            bend = np.array([[12, a, -12, a], [a, 2 * b, -a, b], [-12, -a, 12, -a], [a, b, -a, 2 * b]])
            K[np.ix_(6 * e + np.array(at), 6 * e + np.array(at))] += EI / length**3 * bend
        for k, m, first in ((EA, rho, 0), (GJ, J, 3)):
            at = [6 * e + first, 6 * e + first + 6]
            K[np.ix_(at, at)] += k / length * bar
            M[np.ix_(at, at)] += m * length * mass
    for i in range(n):
        M[6 * i + 1, 6 * i + 1] = M[6 * i + 2, 6 * i + 2] = rho * length
        M[6 * i + 4, 6 * i + 4] = M[6 * i + 5, 6 * i + 5] = 1e-4 * rho * length
    M[1, 1] = M[2, 2] = M[-5, -5] = M[-4, -4] = rho * length / 2
    nodes = [[i + 1, i * length, 0, 0] for i in range(n)]
    scipy.io.savemat(folder / "b.mat", {"K": K, "M": M, "nodes": np.array(nodes, dtype=float)})
    (folder / "body.toml").write_text(
        'name = "b"\nlength_unit = "m"\n[geometry.matrices]\nstiffness = "b.mat"\nmass = "b.mat"\nnodes = "b.mat"\n'
        f'sets = {{ root = [1] }}\n[[supports]]\nface = "root"\n{support}\n[modes]\ncount = 30\n'
    )


@pytest.mark.usefixtures("untried")
def test_a_node_held_without_its_rotations_is_told_so_about_all_three_axes(tmp_path, capsys):
    """Nodes on a line do not move when it turns about itself: that rotation must be named all the same."""
    beam_with_rotations(tmp_path, "")
    axes = [f"rotation about {a} through" for a in "xyz"]
    refused_command(["modes", str(tmp_path)], capsys, *axes, "rotations = true")


@pytest.mark.usefixtures("untried")
def test_a_mode_of_rotations_alone_is_not_drawn_from_rounding(tmp_path):
    from microslip.pictures.points import moves

    beam_with_rotations(tmp_path, "rotations = true")
    g = made(tmp_path)[0].groups[0, 0]
    torsion = np.sqrt(1e3 / 5e-4) * np.pi / 2 / 0.6  # of a rod held at one end, rad/s
    still = [j for j in range(g.n_modes) if not moves(g, j)]
    assert len(still) == 6 and g.omega[still[0]] == pytest.approx(torsion, rel=0.01)


# what is refused -----------------------------------------------------------------------------------------------------


def swapped(folder):
    write_nodes(folder)
    rows = (folder / "nodes.csv").read_text().splitlines()
    rows[1], rows[-1] = rows[-1], rows[1]
    (folder / "nodes.csv").write_text("\n".join(rows))


def lopsided(folder):
    K = operators()[0].tolil()
    K[0, 5] = K[0, 5] + 1e9
    scipy.io.mmwrite(folder / "K.mtx", K.tocsr(), symmetry="general")


@pytest.mark.parametrize(
    ("spoil", "text"),
    [
        (swapped, "resists rigid motions"),
        (lopsided, "stiffness matrix is not symmetric"),
        (lambda f: (f / "M.mtx").unlink(), "there is no file"),
        (lambda f: (f / "K.mtx").write_text(f"{HEAD}9 9 4\n1 1 2.\n"), "announces"),
        (lambda f: (f / "K.mtx").write_text(f"{HEAD}9 8 0\n"), "square"),
        (lambda f: scipy.io.mmwrite(f / "M.mtx", -operators()[1]), "is negative; is it the mass matrix"),
        (lambda f: scipy.io.mmwrite(f / "M.mtx", sp.eye(9)), "has 9 rows"),
        (lambda f: (f / "nodes.csv").write_text("1, 0, 0, 0\n1, 1, 0, 0\n"), "node 1 is given twice"),
        (lambda f: (f / "nodes.csv").write_text("1, 0, 0\n"), "has 3 entries instead of 4"),
        (lambda f: (f / "nodes.csv").write_text("1, 0, 0, 0\n2, 1, 0, 0\n"), "sets.z0: node"),
    ],
)  # fmt: skip
def test_matrices_that_cannot_be_are_refused_in_a_sentence(tmp_path, capsys, spoil, text):
    given_by_market(tmp_path)
    spoil(tmp_path)
    refused_command(["modes", str(tmp_path)], capsys, text)


@pytest.mark.usefixtures("untried")
def test_supports_in_the_matrices_must_be_said(tmp_path, capsys):
    K, M = operators()
    free = np.setdiff1d(np.arange(K.shape[0]), (3 * beam().face_points("z0")[:, None] + np.arange(3)).ravel())
    scipy.io.savemat(tmp_path / "a.mat", {"K": K[free][:, free], "M": M[free][:, free]})
    (tmp_path / "rows.txt").write_text("".join(f"{beam().node_id[i // 3]}.{i % 3 + 1}\n" for i in free))
    write_nodes(tmp_path)
    write_body(tmp_path, "a.mat", "a.mat", 'dofs = "rows.txt"\n', more="")
    refused_command(["modes", str(tmp_path)], capsys, "grounded = true")
    write_body(tmp_path, "a.mat", "a.mat", 'dofs = "rows.txt"\ngrounded = true\n', more="")
    np.testing.assert_allclose(made(tmp_path)[0].groups[0, 0].omega[:6], own().groups[0, 0].omega[:6], rtol=1e-9)


def test_wrong_units_of_matrices_are_told(tmp_path):
    """K and M in N, m, kg said to be in N, mm, t: no solid has that density."""
    given_by_market(tmp_path, top='units = "mm-t-s"\n')
    assert any("no solid's" in t for t in made(tmp_path)[1])


def test_hdf5_that_leads_out_of_the_file_is_refused(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["K"] = h5py.ExternalLink("/etc/passwd", "/K")
    refused("link to another place", matrix_names, tmp_path / "a.h5")
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file.create_dataset("K", (10**6, 10**6), chunks=(1000, 1000))
    refused("claims more data", matrix_names, tmp_path / "b.h5")


def small(folder: Path, kind: str) -> str:
    K = np.diag([2.0, 3.0, 4.0])
    if kind == "mtx":
        scipy.io.mmwrite(folder / "a.mtx", sp.csr_matrix(K))
    elif kind == "mat":
        scipy.io.savemat(folder / "a.mat", {"K": sp.csr_matrix(K), "M": K})
    elif kind == "op4":
        pytest.importorskip("pyyeti.nastran.op4").write(str(folder / "a.op4"), {"k": K})
    elif kind == "pch":
        wide = f"{'DMIG*':8}{'K':16}{1:16}{1:16}\n{'*':8}{1:16}{1:16}{'2.0D0':16}\n"
        (folder / "a.pch").write_text(f"{'DMIG':8}{'K':8}{0:8}{6:8}{2:8}{0:8}{'':16}{3:8}\n{wide}")
    else:
        (folder / "a.sti").write_text("1 1 2.0\n1 2 0.5\n2 2 3.0\n3 3 1.0\n")
        (folder / "a.dof").write_text("1.1\n1.2\n1.3\n")
    return f"a.{kind}"


@pytest.mark.parametrize("kind", ["mtx", "sti", "op4", "pch"])
def test_flipped_bytes_are_read_or_refused_but_never_crash(tmp_path_factory, kind):
    """Whatever a byte becomes: matrices, or one sentence."""
    from microslip.exchange.matrices import _read

    folder = tmp_path_factory.mktemp("flip")
    name = small(folder, kind)
    whole = (folder / name).read_bytes()

    @settings(max_examples=60, deadline=None)
    @given(st.lists(st.tuples(st.integers(0, len(whole) - 1), st.integers(0, 255)), min_size=1), st.booleans())
    def flip(changes, cut):
        data = bytearray(whole)
        for place, value in changes:
            data[place] = value
        (folder / name).write_bytes(data[: changes[0][0]] if cut else data)
        try:
            found = _read(folder, name, "stiffness")
        except UserError as error:
            assert str(folder / name) in str(error)
        else:
            assert found.matrix.shape[0] == found.matrix.shape[1]

    flip()


@pytest.mark.drawn
def test_shapes_of_lone_nodes_are_drawn(tmp_path):
    """A picture that shows something: not one colour."""
    pytest.importorskip("matplotlib")
    from PIL import Image

    from microslip.pictures.plots import save
    from microslip.pictures.points import points_sheet

    given_by_market(tmp_path)
    basis, _ = made(tmp_path)
    path = save(partial(points_sheet, basis, basis.groups[0, 0], most=4), tmp_path / "a.png")
    assert len(Image.open(path).convert("RGB").getcolors(10**7)) > 20


@pytest.mark.slow
def test_damage_that_kills_the_parser_is_a_sentence(tmp_path):
    """scipy's compiled reader of .mat files crashes on some flipped bytes: the process that tries it first does."""
    from test_fuzz import flipped

    from microslip.exchange.matrices import _read
    from microslip.files.hostile import trial

    scipy.io.savemat(tmp_path / "whole.mat", {"K": sp.csr_matrix(np.diag([2.0, 3.0, 4.0])), "M": np.eye(3)})
    whole = (tmp_path / "whole.mat").read_bytes()
    said = set()
    for seed in range(5):
        path = tmp_path / f"{seed}.mat"
        path.write_bytes(flipped(whole, random.Random(seed)))
        try:
            _read(tmp_path, path.name, "stiffness")
        except UserError as error:
            said.add(str(error).partition(": ")[2][:40])
    assert said
    assert trial("import os; os.kill(os.getpid(), 11)", tmp_path / "whole.mat") == "crashes"


@pytest.mark.parametrize("kind", ["h5", "mat"])
def test_flipped_bytes_of_hdf5_are_read_or_refused(tmp_path, kind):
    from test_fuzz import flipped, user_errors_only

    from microslip.exchange.matrices import _read

    with h5py.File(tmp_path / f"whole.{kind}", "w") as file:
        columns = sp.csc_matrix(np.diag([2.0, 3.0, 4.0]))
        for part, data in (("jc", columns.indptr), ("ir", columns.indices), ("data", columns.data)):
            file[f"K/{part}"] = data
        file["M"] = np.eye(3)
    whole = (tmp_path / f"whole.{kind}").read_bytes()
    for seed in range(4):  # each is tried in a process of its own
        (tmp_path / f"{seed}.{kind}").write_bytes(flipped(whole, random.Random(seed)))
        with user_errors_only():
            _read(tmp_path, f"{seed}.{kind}", "stiffness")


NODES = "node,x,y,z\n" + "".join(f"{i},{0.1 * i},{0.2 * i},0.3\n" for i in range(1, 9))
ROWS_OF = "".join(f"{i}.{c}\n" for i in range(1, 5) for c in (1, 2, 3))


@pytest.mark.parametrize(("name", "text"), [("nodes.csv", NODES), ("rows.txt", ROWS_OF), ("rows.dof", ROWS_OF)])
def test_flipped_bytes_of_tables_are_read_or_refused(tmp_path, name, text):
    from test_fuzz import flipped

    from microslip.exchange.matrices.found import Unreadable
    from microslip.exchange.matrices.nodes import read_dofs, read_nodes

    refused = 0
    for seed in range(300):
        (tmp_path / name).write_bytes(flipped(text.encode(), random.Random(seed)))
        try:
            if name == "nodes.csv":
                assert np.isfinite(read_nodes(tmp_path / name, "", "mm").points).all()
            else:
                assert read_dofs(tmp_path / name).shape[1] == 2
        except (UserError, Unreadable) as error:
            refused += bool(str(error).strip())
    assert 50 < refused < 300
