"""Exports of random small bodies, read back by readers that know the formats and not the exporters.

The bodies are points with masses on random springs: every integral over the mass is a sum over the points, which is
written out here. Names are random text. Bits where the format holds them, printed digits where not.
"""

from __future__ import annotations

import csv
import re
import shutil
import zipfile
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import loadmat, mmread
from test_exchange import close, read_fem, read_sid, uff_sets

from microslip.basis import read_basis, write_basis
from microslip.data import INTERFACE_ROWS, Array, Invariants, ModalBasis
from microslip.exchange import to_xarray, writer
from microslip.exchange.mat import field_names
from microslip.frames import skew
from microslip.system import Body, Contact, Force, Monitor, System

NAMES = st.text(
    st.one_of(st.characters(codec="utf-8", exclude_categories=("Cc", "Cs")), st.sampled_from("\n\t\r*-")),
    min_size=1, max_size=9,
)  # fmt: skip


@st.composite
def bodies(draw: st.DrawFn) -> ModalBasis:
    """2 to 4 points on springs to each other and to the ground, damped, with 1 or 2 contacts, a force, a probe."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n, scale = draw(st.integers(2, 4)), 10.0 ** draw(st.integers(-6, 6))
    faces = draw(st.lists(NAMES, min_size=1, max_size=2, unique=True))
    force, probe = draw(NAMES), draw(NAMES)
    masses = rng.uniform(0.1, 3.0, n) * scale
    points = rng.normal(size=(n, 3))
    A, B = rng.normal(size=(2, 3 * n, 3 * n))
    K, C = scale * 1e6 * (A @ A.T + np.eye(3 * n)), scale * B @ B.T
    components = [Body(f"m{i}", m, x) for i, (m, x) in enumerate(zip(masses, points, strict=True))]
    contacts = [Contact(name, f"m{i}", rng.normal(size=3)) for i, name in enumerate(faces)]
    basis = System(
        draw(NAMES), components, contacts=contacts, forces=[Force(force, "m1", rng.normal(size=3))],
        monitors=[Monitor(probe, "m0")], stiffness=K, damping=C,
    ).basis()  # fmt: skip
    g = basis.groups[0, 0]
    return replace(basis, groups={(0, 0): replace(g, invariants=sums(masses, points, g.phi, rng.normal(size=3)))})


def sums(masses: Array, points: Array, phi: Array, about: Array) -> Invariants:
    """Integrals over the mass, point by point."""
    r = points - about
    return Invariants(
        about, float(masses.sum()), masses @ r, np.einsum("p,pa,pb->ab", masses, r, r),
        np.einsum("p,pam->am", masses, phi), np.einsum("p,pa,pbm->abm", masses, r, phi),
        np.einsum("p,pai,pbj->abij", masses, phi, phi), np.zeros((0, phi.shape[2], phi.shape[2])),
    )  # fmt: skip


def crosses(basis: ModalBasis) -> tuple[Array, Array, Array]:
    """(p,) masses from the mass matrix of the shapes, (p, 3, 3) cross-product matrices of r, (p, m, 3, 3) of phi."""
    g = basis.groups[0, 0]
    assert g.invariants is not None
    X = g.phi.reshape(-1, g.n_modes)
    masses = np.diag(np.linalg.inv(X @ X.T))[::3]  # X^T M X = 1 with all modes
    r = basis.mesh.points - g.invariants.point
    return masses, np.array([skew(x) for x in r]), np.array([[skew(u) for u in p.T] for p in g.phi])


EXAMPLES = settings(max_examples=25)


@EXAMPLES
@given(bodies())
def test_matrix_market_gives_every_bit_back(tmp_path_factory: pytest.TempPathFactory, basis: ModalBasis) -> None:
    folder, g = tmp_path_factory.mktemp("mtx") / "m", basis.groups[0, 0]
    writer("mtx")(basis, folder)
    read = {p.stem: np.asarray(mmread(p)) for p in (folder / "speed_0").glob("*.mtx")}
    for name in ("M_r", "K_r", "C_r", "G_r"):
        np.testing.assert_array_equal(read[name], getattr(g, name))
    np.testing.assert_array_equal(read["omega"].ravel(), g.omega)
    rows = {"interface": g.interfaces, "excitation": g.excitations, "monitor": g.monitors}
    for kind, named in rows.items():
        for field, item in zip(field_names(named), named.values(), strict=True):
            np.testing.assert_array_equal(read[f"{kind}_{field}"], item.rows)
    with open(folder / "speed_0" / "coordinates.csv", newline="") as file:
        assert [r["kind"] for r in csv.DictReader(file)] == list(g.kind)


@EXAMPLES
@given(bodies())
def test_matlab_files_give_every_bit_and_every_name_back(
    tmp_path_factory: pytest.TempPathFactory, basis: ModalBasis
) -> None:
    path, g = tmp_path_factory.mktemp("mat") / "b.mat", basis.groups[0, 0]
    writer("mat")(basis, path)
    b = loadmat(path, squeeze_me=False, struct_as_record=False)["speed_0"][0, 0]
    for name, value in {"M": g.M_r, "K": g.K_r, "D": g.C_r, "phi": g.phi}.items():
        np.testing.assert_array_equal(getattr(b, name), value)
    np.testing.assert_array_equal(b.W, np.concatenate([i.rows for i in g.interfaces.values()]).T)
    np.testing.assert_array_equal(b.Fex1, np.concatenate([r.rows for r in g.excitations.values()]).T)
    assert [str(w[0]) for w in b.W_row[:, 0]] == [f"{n}:{r}" for n in g.interfaces for r in INTERFACE_ROWS]
    faces = b.interfaces[0, 0]
    assert [str(w[0]) for w in faces.names[:, 0]] == list(g.interfaces)
    for field, item in zip(field_names(g.interfaces), g.interfaces.values(), strict=True):
        face = getattr(faces, field)[0, 0]
        np.testing.assert_array_equal(face.T, item.rows)
        np.testing.assert_array_equal(face.rotation, item.rotation)
        np.testing.assert_array_equal(face.origin.ravel(), item.origin)


@EXAMPLES
@given(bodies())
def test_universal_files_give_their_printed_digits_back(
    tmp_path_factory: pytest.TempPathFactory, basis: ModalBasis
) -> None:
    path, g = tmp_path_factory.mktemp("uff") / "b.uff", basis.groups[0, 0]
    writer("uff")(basis, path)
    sets = uff_sets(path)
    (nodes,) = [s for s in sets if s["type"] == 2411]
    np.testing.assert_array_equal(np.stack([nodes[a] for a in "xyz"], axis=1), basis.mesh.points)
    modes = [s for s in sets if s["type"] == 55]
    assert len(modes) == g.n_modes and sets[0]["type"] == 151 and sets[1]["type"] == 164

    def printed(values: Array) -> Array:
        return np.array([float(f"{v:.5e}") for v in np.ravel(values)])

    for j, mode in enumerate(modes):
        shape = np.stack([mode[f"r{a}"] for a in (1, 2, 3)], axis=1)
        np.testing.assert_array_equal(shape.ravel(), printed(g.phi[:, :, j]))
        assert mode["freq"] == printed(g.frequency[j])[0] and mode["modal_damp_vis"] == printed(g.damping_ratio[j])[0]


@EXAMPLES
@given(bodies())
def test_exudyns_integrals_are_the_sums_over_the_points(
    tmp_path_factory: pytest.TempPathFactory, basis: ModalBasis
) -> None:
    """Its names, as its own documentation defines them by Phi, M and the reference positions."""
    path, g = tmp_path_factory.mktemp("exudyn") / "b.npz", basis.groups[0, 0]
    writer("exudyn")(basis, path)
    read = np.load(path, allow_pickle=False)
    masses, r, u = crosses(basis)
    m = g.n_modes
    np.testing.assert_array_equal(read["modeBasis"], g.phi.reshape(-1, m))
    np.testing.assert_array_equal(read["stiffnessMatrixReduced"], g.K_r)
    assert g.invariants is not None
    np.testing.assert_array_equal(read["xRef"].reshape(-1, 3), basis.mesh.points - g.invariants.point)
    close(read["Mtt"], masses.sum() * np.eye(3), 1e-9)
    close(read["inertiaLocal"], -np.einsum("p,pab,pbc->ac", masses, r, r), 1e-9)
    close(read["mPhitTPsi"], np.einsum("p,pam->am", masses, g.phi), 1e-9)
    blocks = -np.einsum("p,pjab,pkbc->jakc", masses, u, u).reshape(3 * m, 3 * m)
    close(read["mPsiTildePsiTilde"], blocks, 1e-9)
    close(read["mPhitTPsiTilde"], np.hstack([skew(s) for s in np.einsum("p,pam->ma", masses, g.phi)]), 1e-9)


@EXAMPLES
@given(bodies())
def test_mbdyns_invariants_are_the_sums_over_the_points(
    tmp_path_factory: pytest.TempPathFactory, basis: ModalBasis
) -> None:
    """As its manual defines them: 3 m phi, 4 m r x phi, 8 -m r~ phi~, 5 m phi_j x phi_k, 9 m phi~_j phi~_k."""
    path, g = tmp_path_factory.mktemp("mbdyn") / "b.fem", basis.groups[0, 0]
    writer("mbdyn")(basis, path)
    read = read_fem(path)
    head = path.read_text(encoding="ascii").split("** RECORD GROUP 1,")[0].splitlines()
    assert all(line.startswith("** ") for line in head) and len(head) == 3 + len(read[2]) + g.n_modes
    masses, r, u = crosses(basis)
    m = g.n_modes
    np.testing.assert_array_equal(read[9], g.M_r)
    np.testing.assert_array_equal(read[10], g.K_r)
    np.testing.assert_array_equal(read[13], g.C_r)
    close(read[12][0], masses.sum(), 1e-9)
    close(read[14].reshape(3, m), np.einsum("p,pam->am", masses, g.phi), 1e-9)
    close(read[15].reshape(3, m), np.einsum("p,pab,pbm->am", masses, r, g.phi), 1e-9)
    close(read[16].reshape(3, m, 3), -np.einsum("p,pab,pjbc->ajc", masses, r, u), 1e-9)
    close(read[17].reshape(3, m, m), np.einsum("p,pjab,pbk->ajk", masses, u, g.phi), 1e-9)
    close(read[18].reshape(3, m, m, 3), np.einsum("p,pjab,pkbc->ajkc", masses, u, u), 1e-9)


@EXAMPLES
@given(bodies())
def test_the_tables_of_sid_are_the_sums_over_the_points(
    tmp_path_factory: pytest.TempPathFactory, basis: ModalBasis
) -> None:
    """The integrals on top of `exchange/sid.py`, with x = r + phi q."""
    path, g = tmp_path_factory.mktemp("sid") / "b.SID_FEM", basis.groups[0, 0]
    writer("sid")(basis, path)
    _, modal = read_sid(path)
    masses, r, u = crosses(basis)
    m = g.n_modes
    T = {name: modal[name].taylor() for name in "mdCM J Ct Cr Me Gr Ge Oe Ke De".split()}
    np.testing.assert_array_equal(T["Ke"][0], g.K_r)
    np.testing.assert_array_equal(T["De"][0], g.C_r)
    close(T["mdCM"][1][:, :, 0], np.einsum("p,pam->ma", masses, g.phi), 1e-9)
    close(T["J"][0], -np.einsum("p,pab,pbc->ac", masses, r, r), 1e-9)
    first = -np.einsum("p,pab,pqbc->qac", masses, r, u)
    close(T["J"][1], first + first.transpose(0, 2, 1), 1e-9)
    close(T["Cr"][0], np.einsum("p,pab,pbm->ma", masses, r, g.phi), 1e-9)
    close(T["Cr"][1], np.einsum("p,pqab,pbm->qma", masses, u, g.phi), 1e-9)
    close(T["Gr"][0], np.hstack(list(-2 * np.einsum("p,pab,plbc->lac", masses, r, u))), 1e-9)
    ge = -2 * np.einsum("p,pak,plab->kbl", masses, g.phi, u)  # phi_k^T phi~_l: row k, block l
    close(T["Ge"][0], ge.transpose(0, 2, 1).reshape(m, 3 * m), 1e-9)
    w = np.array([0.3, -1.1, 0.7])
    products = [w[0] ** 2, w[1] ** 2, w[2] ** 2, w[0] * w[1], w[1] * w[2], w[0] * w[2]]
    turned = skew(w) @ skew(w)
    position = basis.mesh.points - g.invariants.point  # type: ignore[union-attr]
    close(T["Oe"][0] @ products, np.einsum("p,pak,ab,pb->k", masses, g.phi, turned, position), 1e-9)
    close(T["Oe"][1] @ products, np.einsum("p,pak,ab,pbq->qk", masses, g.phi, turned, g.phi), 1e-9)


@pytest.mark.skipif(shutil.which("cc") is None, reason="a C compiler is not installed")
@settings(max_examples=5)
@given(bodies())
def test_a_unit_holds_every_bit_under_names_of_its_own(
    tmp_path_factory: pytest.TempPathFactory, basis: ModalBasis
) -> None:
    """The numbers of its source, a full damping matrix among them, and as many names as rows."""
    path, g = tmp_path_factory.mktemp("fmu") / "b.fmu", basis.groups[0, 0]
    writer("fmu")(basis, path)
    with zipfile.ZipFile(path) as archive:
        text = re.sub(r"/\*.*?\*/", "", archive.read("sources/numbers.h").decode("ascii"))
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    tables = dict(re.findall(r"(\w+)\[\w[\w *]*\](?:\[\w+\])? = \{(.*?)\};", text, flags=re.S))
    tables = {name: np.array(re.split(r"[{},\s]+", rows.strip("{}, \n"))) for name, rows in tables.items()}
    m, pairs = g.n_modes, tables["PAIR"].reshape(-1, 4)
    K, C = np.zeros((2, m, m))
    at = tuple(pairs[:, :2].T.astype(int))
    K[at], C[at] = pairs[:, 2:].T.astype(float)
    np.testing.assert_array_equal(K, g.K_r)
    np.testing.assert_array_equal(C, g.C_r)
    contacts = [i.rows for i in g.interfaces.values()]
    load = np.vstack([*contacts, *(r.rows for r in g.excitations.values())])
    read = np.vstack([*contacts, *(r.rows for r in g.monitors.values())])
    np.testing.assert_array_equal(tables["LOAD"].astype(float).reshape(-1, m), load)
    np.testing.assert_array_equal(tables["READ"].astype(float).reshape(-1, m), read)
    names = [v.get("name") for v in root.iter("ScalarVariable")]
    assert len({*names}) == len(names) == 4 * m + len(load) + 2 * len(read)


@EXAMPLES
@given(bodies())
def test_paraviews_file_holds_the_shapes_in_single_precision(
    tmp_path_factory: pytest.TempPathFactory, basis: ModalBasis
) -> None:
    meshio = pytest.importorskip("meshio")
    path, g = tmp_path_factory.mktemp("vtu") / "b.vtu", basis.groups[0, 0]
    writer("vtu")(basis, path)
    read = meshio.read(path)
    np.testing.assert_allclose(read.points, basis.mesh.points, rtol=1e-6)
    for j in range(g.n_modes):
        (name,) = [n for n in read.point_data if n.startswith(f"mode_{j + 1:02d}_")]
        np.testing.assert_array_equal(read.point_data[name], g.phi[:, :, j].astype(np.float32))


@EXAMPLES
@given(bodies())
def test_modal_file_and_xarray_hold_the_body_bit_for_bit(
    tmp_path_factory: pytest.TempPathFactory, basis: ModalBasis
) -> None:
    pytest.importorskip("xarray")
    path = tmp_path_factory.mktemp("h5") / "b.h5"
    write_basis(path, basis)
    g, back = basis.groups[0, 0], read_basis(path)
    tree = to_xarray(back)["speed_0"]
    for name in ("K_r", "C_r", "phi", "omega"):
        np.testing.assert_array_equal(tree[name].values, getattr(g, name))
    assert list(back.groups[0, 0].interfaces) == list(g.interfaces)
    for name, item in g.interfaces.items():
        np.testing.assert_array_equal(back.groups[0, 0].interfaces[name].rows, item.rows)
        label = f"interface_{name.replace('%', '%25').replace('/', '%2F')}"
        np.testing.assert_array_equal(tree[label].sel(interface_row="u_t2").values, item.rows[2])


def test_names_that_are_axes_of_xarray() -> None:
    pytest.importorskip("xarray")
    basis = System(
        "a/b", [Body("m", 1.0), Body("n", 1.0, (1.0, 0.0, 0.0))], contacts=[Contact("row", "m", (1.0, 0.0, 0.0))],
        monitors=[Monitor("x", "m"), Monitor("x_row", "n")], stiffness=1e4 * np.eye(6),
    ).basis()  # fmt: skip
    tree, g = to_xarray(basis)["speed_0"], basis.groups[0, 0]
    np.testing.assert_array_equal(tree["interface_row_"].values, g.interfaces["row"].rows)
    np.testing.assert_array_equal(tree["monitor_x_row_"].values, g.monitors["x_row"].rows)
    np.testing.assert_array_equal(tree["monitor_x"].sel(monitor_x_row="u_y").values, g.monitors["x"].rows[1])
