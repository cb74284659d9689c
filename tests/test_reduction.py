"""Reduction methods against the full model: static exactness, fixed-interface spectra, soft to stiff contacts."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from meshes import STEEL, body, brick
from refusals import refused

from microslip.basis import check_basis, read_basis, write_basis
from microslip.case import run_case
from microslip.case.settings import case_model
from microslip.fem.discretise import discretise, free_upper
from microslip.linalg import eigen
from microslip.modal.body_rows import body_rows
from microslip.modal.boundary import fixed_dofs
from microslip.modal.compute import modal_basis
from microslip.modal.equilibrium import make_model
from microslip.modal.solution import held_compliance
from microslip.modal.spectrum import make_pencil
from microslip.reduced.quality import percent_off
from microslip.reduction import METHODS, Substructure
from microslip.reduction.craig_bampton import fixed_interface_modes
from microslip.report.words import certificate
from microslip.stages.summary import basis_summary

STATICALLY_EXACT = ("rubin", "craig-bampton", "dual-craig-bampton", "massless-boundary")
PHYSICAL = ("craig-bampton", "massless-boundary")  # interface displacements are coordinates
NO_POISSON = {**STEEL, "poisson": 0.0}
# a bar on rollers with nu = 0 moves along its axis only (below its thickness modes)
ROLLERS = [{"face": "x0"}, {"face": "y0", "directions": "y"}, {"face": "z0", "directions": "z"}]
TIP = {"name": "tip", "face": "x1", "t2": [0.0, 0.0, 1.0]}
SIDE = {"name": "side", "face": "y1", "t2": [0.0, 0.0, 1.0]}
PUSH = {"name": "push", "face": "z1", "direction": [0.3, 0.5, 0.8]}
LOOK = {"name": "look", "point": [0.07, 0.02, 0.03]}


def bar(method: str, count: int = 5):
    mesh = brick("hexahedron20", (16, 1, 1), (1.0, 0.04, 0.04))
    settings = body(NO_POISSON, supports=ROLLERS, interfaces=[TIP], modes={"count": count}, reduction=method)
    return mesh, settings, modal_basis(mesh, settings).groups[0, 0]


def block(method: str, count: int = 6, **more):
    mesh = brick("tetra10", (3, 2, 2), (0.1, 0.06, 0.05))
    settings = body(
        supports=[{"face": "x0"}], interfaces=[TIP, SIDE], excitations=[PUSH], monitors=[LOOK],
        modes={"count": count}, reduction=method, damping={"ratio": 0.01}, output={"gauss": True}, **more,
    )  # fmt: skip
    return mesh, settings, modal_basis(mesh, settings)


def full_model(mesh, settings):
    """Dense K, M and rows B of all interfaces on the free degrees of freedom."""
    d = discretise(mesh)
    fixed = fixed_dofs(mesh, settings)
    free = free_upper(d.pattern, fixed)
    model = make_model(
        d, settings.material.material(), free, fixed, np.array([0, 1.0, 0]), np.zeros(3), None, 293.15,
        np.zeros((mesh.n_points, 3)), True,
    )  # fmt: skip
    pencil = make_pencil(model, model.K0, eigen.new_solver())
    B = interface_rows(mesh, settings).toarray()
    eye = np.eye(pencil.n)
    return pencil, pencil.K(eye), pencil.M(eye), B


def interface_rows(mesh, settings) -> sp.csr_matrix:
    """Six rows of each interface on the free degrees of freedom."""
    free = np.setdiff1d(np.arange(3 * mesh.n_points), fixed_dofs(mesh, settings))
    patches = body_rows(mesh, settings).patches
    return sp.vstack([patches[i.name].B[:, free] for i in settings.interfaces]).tocsr()


def with_spring(g, method: str, spring: float, row: int = 0) -> float:
    """First eigenfrequency (rad/s) of a reduced body with a spring to ground on one interface row."""
    T = g.interfaces["tip"].rows[row]
    if method == "macneal":
        spring = spring / (1 + spring * g.compliance.residual[row, row])
    if method == "dual-craig-bampton":  # the force on that row squeezes the spring; the other forces are zero
        keep = np.r_[row, 6 : g.n_modes]
        K, M = g.K_r[np.ix_(keep, keep)], g.M_r[np.ix_(keep, keep)]
        K = K - np.diag(np.eye(len(keep))[0]) / spring
        values = scipy.linalg.eigh(K, M, eigvals_only=True)
        assert (values < 0).sum() == 1  # the one that belongs to the force
        return float(np.sqrt(values[1]))
    K = g.K_r + spring * np.outer(T, T)
    return float(1 / np.sqrt(scipy.linalg.eigh(g.M_r, K, eigvals_only=True)[-1]))


def test_soft_to_stiff_contact_on_a_bar():
    """Five modes, a spring on the end 0.01 to 100 times the bar's stiffness, against the full model.

    Measured: eigenmodes 4 %, MacNeal and massless boundary 5e-4, Rubin and dual 1e-5, Craig-Bampton below 1e-6 at the
    stiff end; at the soft end Rubin is the best. Limits are three times what was measured.
    """
    groups = {m: bar(m)[2] for m in METHODS}
    mesh, settings, _ = bar("eigenmodes")
    _, K, M, B = full_model(mesh, settings)
    stiffness = STEEL["young"] * 0.04**2
    error = {}
    for ratio in (0.01, 1.0, 100.0):
        k = ratio * stiffness
        held = K + k * np.outer(B[0], B[0])
        exact = np.sqrt(scipy.linalg.eigh(held, M, eigvals_only=True, subset_by_index=(0, 0))[0])
        for method, g in groups.items():
            error[method, ratio] = abs(with_spring(g, method, k) / exact - 1)
    stiff = {m: error[m, 100.0] for m in METHODS}
    assert stiff["craig-bampton"] < stiff["rubin"] < stiff["macneal"] < stiff["eigenmodes"]
    assert 0.01 < stiff["eigenmodes"] < 0.1
    assert stiff["macneal"] < 2e-3 and stiff["rubin"] < 3e-5 and stiff["craig-bampton"] < 3e-6
    assert stiff["massless-boundary"] == pytest.approx(stiff["macneal"], rel=1e-6)  # the same flexibility
    assert stiff["dual-craig-bampton"] < 3e-5 and error["dual-craig-bampton", 0.01] < 1e-8
    assert error["rubin", 0.01] < 1e-8 and error["rubin", 0.01] < error["craig-bampton", 0.01]


@pytest.mark.parametrize("method", STATICALLY_EXACT)
def test_static_answers_are_exact(method):
    """Held compliance equals the full model's on interface rows (Rubin: on loads too).

    Two solutions of one factorised system of this stocky block differ by some 1e-12.
    """
    _, _, basis = block(method)
    c = basis.groups[0, 0].compliance
    chosen = [i for i, n in enumerate(c.labels) if n.startswith("interface:") or method == "rubin"]
    chosen = [i for i in chosen if not c.labels[i].startswith("monitor:")]
    scale = np.sqrt(np.outer(np.diag(c.static), np.diag(c.static)))[np.ix_(chosen, chosen)]
    error = (c.modal - c.static)[np.ix_(chosen, chosen)] / scale
    assert np.abs(error).max() < 1e-8


@pytest.mark.parametrize("method", list(METHODS))
def test_file_checks_pass_for_every_method(method):
    _, _, basis = block(method)
    assert [c.name for c in check_basis(basis) if not c.passed] == []


@pytest.mark.parametrize("method", STATICALLY_EXACT)
def test_stress_of_a_static_contact_force_is_exact(method):
    """Stress rows, gauge rows and shapes are carried through: the answer to a tip force equals the direct one."""
    mesh, settings, basis = block(method)
    g = basis.groups[0, 0]
    force = np.array([2.0, -1.0, 0.5, 0.01, 0.02, -0.03])
    q = static_answer(g, "tip", force)
    pencil, K, _, B = full_model(mesh, settings)
    u = np.zeros(3 * mesh.n_points)
    u[np.setdiff1d(np.arange(3 * mesh.n_points), fixed_dofs(mesh, settings))] = np.linalg.solve(K, B[:6].T @ force)
    np.testing.assert_allclose((g.phi @ q).ravel(), u, atol=1e-9 * np.abs(u).max())
    direct = direct_stress(mesh, u.reshape(-1, 3))
    np.testing.assert_allclose(g.stresses["gauss"].stress @ q, direct, atol=1e-8 * np.abs(direct).max())


def static_answer(g, name: str, force):
    """Coordinates under constant forces on one interface, every other one free."""
    load = g.interfaces[name].rows.T @ force
    if "interface-force" not in g.kind:
        return np.linalg.solve(g.K_r, load)
    given = 6 * list(g.interfaces).index(name) + np.arange(6)
    modes = np.array(g.kind) != "interface-force"
    q = np.zeros(g.n_modes)
    q[given] = force
    q[modes] = np.linalg.solve(g.K_r[np.ix_(modes, modes)], -g.K_r[np.ix_(modes, given)] @ force)
    return q


def direct_stress(mesh, u):
    from microslip.elasticity import isotropic
    from microslip.fem.operators import displacement_gradient, green_strain

    (b,) = discretise(mesh).blocks
    strain = green_strain(displacement_gradient(b, u), nonlinear=False)
    return (strain @ isotropic(STEEL["young"], STEEL["poisson"]).T).reshape(-1, 6)


def test_fixed_interface_modes_equal_the_dense_constrained_ones_and_are_certified():
    mesh, settings, _ = block("eigenmodes")
    pencil, K, M, B = full_model(mesh, settings)
    found = fixed_interface_modes(pencil, interface_rows(mesh, settings), 8, certify=True)
    Z = scipy.linalg.null_space(B)
    dense = scipy.linalg.eigh(Z.T @ K @ Z, Z.T @ M @ Z, eigvals_only=True, subset_by_index=(0, len(found.values) - 1))
    assert found.certified
    np.testing.assert_allclose(found.values, dense, rtol=1e-8)
    assert np.abs(B @ found.vectors).max() < 1e-10 * np.abs(found.vectors).max()
    assert found.backward_error.max() < 1e-9


@pytest.mark.parametrize("method", PHYSICAL)
def test_interface_coordinates_are_the_motions_of_the_patches(method):
    """The six rows of a patch read exactly its six coordinates."""
    _, _, basis = block(method)
    g = basis.groups[0, 0]
    rows = np.vstack([g.interfaces["tip"].rows, g.interfaces["side"].rows])
    assert all(kind.endswith("interface") for kind in g.kind[:12]) and g.kind[12] in ("normal", "fixed-interface")
    np.testing.assert_allclose(rows[:, :12], np.eye(12), atol=1e-9)
    assert np.abs(rows[:, 12:]).max() < 1e-9 * np.abs(g.phi).max()


@pytest.mark.parametrize(("method", "limit"), [("rubin", 2e-3), ("craig-bampton", 1.5e-2)])
def test_driving_point_response_against_the_full_model(method, limit):
    """Squeezed between its two contacts below the third mode: 4 modes and the statics beat 30 eigenmodes.

    Craig-Bampton's fixed-interface modes converge more slowly for an interface that is nearly free.
    """
    mesh, settings, basis = block(method, 4)
    _, _, many = block("eigenmodes", 30)
    pencil, K, M, B = full_model(mesh, settings)
    force = np.zeros(12)
    force[[0, 6]] = 1.0, -0.7
    error = {}
    for name, b in (("reduced", basis), ("eigenmodes", many)):
        g = b.groups[0, 0]
        T = np.vstack([g.interfaces[n].rows for n in ("tip", "side")])
        worst = 0.0
        for w in np.linspace(0.1, 0.9, 5) * many.groups[0, 0].omega[2]:
            exact = B @ np.linalg.solve(K - w**2 * M, B.T @ force)
            answer = T @ np.linalg.solve(g.K_r - w**2 * g.M_r, T.T @ force)
            worst = max(worst, abs(answer[0] / exact[0] - 1))
        error[name] = worst
    assert error["reduced"] < limit < 0.02 < error["eigenmodes"]


FREE = {"free": True, "interfaces": [TIP, SIDE], "excitations": [PUSH], "modes": {"count": 10}}


@pytest.mark.parametrize("method", STATICALLY_EXACT)
def test_free_bodies_keep_rigid_motions_and_answer_with_inertia_relief(method):
    """Six rigid motions at exactly 0 Hz, certified elastic ones, and the elastic answer to interface forces.

    Craig-Bampton needs its inertia-relief shapes for that: without them the block's worst row errs by 85 %.
    """
    mesh = brick("tetra10", (3, 2, 2), (0.1, 0.06, 0.05))
    basis = modal_basis(mesh, body(reduction=method, **FREE))
    g = basis.groups[0, 0]
    c = g.compliance
    assert c.inertia_relief and (g.omega[:6] == 0).all() and g.omega[6] > 0
    scale = np.sqrt(np.outer(np.diag(c.static), np.diag(c.static)))
    np.testing.assert_allclose((c.modal / scale)[:12, :12], (c.static / scale)[:12, :12], atol=1e-8)
    assert [x.name for x in check_basis(basis) if not x.passed] == []
    certified = modal_basis(mesh, body(reduction="eigenmodes", **FREE)).groups[0, 0].omega
    limit = 0.01 if method == "craig-bampton" else 1e-9  # ten fixed-interface modes: 0.5 % above, measured
    error = g.omega[6:9] / certified[6:9] - 1
    assert (error > -1e-9).all() and (error < limit).all()


def test_rigid_motions_of_a_free_body_in_interface_coordinates_cost_no_energy():
    """Craig-Bampton, free: K_r of the interface coordinates has six zero eigenvalues, those of a rigid patch motion."""
    mesh = brick("tetra10", (3, 2, 2), (0.1, 0.06, 0.05))
    g = modal_basis(mesh, body(reduction="craig-bampton", **FREE)).groups[0, 0]
    fixed = ("fixed-interface",) * FREE["modes"]["count"]  # as many as modes are asked for
    assert g.kind == ("interface",) * 12 + ("inertia-relief",) * 6 + fixed
    size = np.sqrt(np.diag(g.K_r)[:12])
    values = np.linalg.eigvalsh(g.K_r[:12, :12] / np.outer(size, size))
    assert np.abs(values[:6]).max() < 1e-10 < 1e-3 < values[6]


@pytest.mark.parametrize("method", PHYSICAL + ("dual-craig-bampton",))
def test_two_interfaces_on_one_face_or_none_are_refused(method):
    twice = [TIP, {**TIP, "name": "again"}]
    for interfaces in (twice, [])[: 1 + (method == "craig-bampton")]:
        settings = body(supports=[{"face": "x0"}], interfaces=interfaces, modes={"count": 4}, reduction=method)
        refused("interfaces", modal_basis, brick("tetra10", (3, 2, 2), (0.1, 0.06, 0.05)), settings)


def test_bodies_written_and_read_keep_their_own_modes_apart_from_their_coordinates(tmp_path):
    """omega and the columns of to_diagonal are fewer than the coordinates where some have no mass or are forces."""
    for method in ("massless-boundary", "dual-craig-bampton"):
        _, _, basis = block(method)
        write_basis(tmp_path / "b.h5", basis)
        back = read_basis(tmp_path / "b.h5")
        g, h = basis.groups[0, 0], back.groups[0, 0]
        assert g.n_modes == h.n_modes == len(g.omega) + 12 and h.kind == g.kind
        np.testing.assert_array_equal(h.to_diagonal, g.to_diagonal)
        assert [c.name for c in check_basis(back) if not c.passed] == []


def test_held_at_their_interfaces_the_methods_approach_the_certified_fixed_interface_modes():
    """u_b = 0: delete the interface coordinates (massless) or keep the forces (dual); first three frequencies."""
    mesh, settings, _ = block("eigenmodes")
    pencil, _, _, _ = full_model(mesh, settings)
    exact = fixed_interface_modes(pencil, interface_rows(mesh, settings), 3, certify=True).values[:3]
    g = block("massless-boundary", 20)[2].groups[0, 0]
    inner = slice(12, None)
    massless = scipy.linalg.eigh(g.K_r[inner, inner], g.M_r[inner, inner], eigvals_only=True)[:3]
    g = block("dual-craig-bampton", 20)[2].groups[0, 0]
    values = scipy.linalg.eigh(g.K_r, g.M_r, eigvals_only=True)
    assert (values < 0).sum() == 12
    dual = values[12:15]
    assert np.abs(np.sqrt(massless / exact) - 1).max() < 5e-2
    assert np.abs(np.sqrt(dual / exact) - 1).max() < 1e-2


class DenseSolver(eigen.DirectSolver):
    """Of complex Hermitian matrices given whole."""

    name = "dense"

    def factorise(self, upper):
        self.A = upper

    def solve(self, b):
        return np.linalg.solve(self.A, b)

    def negative(self):
        return int((np.linalg.eigvalsh(self.A) < 0).sum())


def problems_with_turned_phases() -> tuple[Substructure, Substructure]:
    """A real problem, and the same with every degree of freedom turned by a phase of its own: D K D^H, B D^H."""
    rng = np.random.default_rng(7)
    n, m = 40, 5
    root, weight = rng.standard_normal((n, n)), rng.standard_normal((n, n))
    K, M = root @ root.T + np.eye(n), 0.1 * weight @ weight.T + np.eye(n)
    B = rng.standard_normal((6, n))
    phase = np.exp(2j * np.pi * rng.random(n))
    values, X = scipy.linalg.eigh(K, M, subset_by_index=(0, m - 1))
    labels = (*(f"interface:a:{c}" for c in "abcde"), "excitation:e:force")

    def problem(D):
        A, C, rows = D[:, None] * K * D.conj(), D[:, None] * M * D.conj(), B * D.conj()
        pencil = eigen.Pencil(
            lambda s: A - s * C, lambda x: A @ x, lambda x: C @ x, n, np.abs(A).max(), np.abs(C).max(), DenseSolver(),
            dtype=A.dtype,
        )  # fmt: skip
        static = np.linalg.solve(A, rows.conj().T)
        return Substructure(pencil, values, D[:, None] * X, 0, sp.csr_matrix(rows), labels, static)

    return problem(np.ones(n)), problem(phase)


def test_fixed_interface_modes_of_a_body_with_few_unknowns():
    """Below 200 unknowns the eigenproblem is dense: real and Hermitian, the constraint is kept all the same."""
    for problem in problems_with_turned_phases():
        K, M = problem.pencil.K(np.eye(40)), problem.pencil.M(np.eye(40))
        Z = scipy.linalg.null_space(problem.rows.toarray())
        dense = np.linalg.eigvals(np.linalg.solve(Z.conj().T @ M @ Z, Z.conj().T @ K @ Z))
        found = fixed_interface_modes(problem.pencil, problem.rows, 6, certify=True)
        np.testing.assert_allclose(found.values[:6], np.sort(dense.real)[:6], rtol=1e-9)
        assert np.abs(problem.rows @ found.vectors).max() < 1e-9 and found.certified


@pytest.mark.parametrize("method", list(METHODS))
def test_hermitian_problems_reduce_as_their_real_twins(method):
    """Turned phases change no frequency and no compliance, and every row reads the same size."""
    real, turned = problems_with_turned_phases()
    a, b = METHODS[method](real), METHODS[method](turned)
    assert np.iscomplexobj(b.vectors) and a.kind == b.kind
    np.testing.assert_allclose(b.omega, a.omega, rtol=1e-9)
    Ta, Tb = real.rows @ a.vectors, turned.rows @ b.vectors
    np.testing.assert_allclose(np.abs(Tb), np.abs(Ta), rtol=1e-7, atol=1e-9)
    held = [held_compliance(T, x, real.labels) for T, x in ((Ta, a), (Tb, b))]
    np.testing.assert_allclose(held[1], held[0], rtol=1e-7, atol=1e-9)
    back = b.M_r if b.to_diagonal is None else b.to_diagonal.conj().T @ b.M_r @ b.to_diagonal
    np.testing.assert_allclose(back, np.eye(len(back)), atol=1e-9)


@pytest.mark.usefixtures("unjudged")
def test_friction_response_is_the_same_through_every_method_that_is_statically_exact():
    """Peaks of a stuck block between rigid neighbours: MacNeal's residual, and coordinates without mass or of force."""
    case = case_model().model_validate({
        "name": "c", "body": "test", "excitation": "push", "monitor": "look", "direction": "y", "harmonics": 1,
        "samples": 24,
        "contacts": [
            {"interface": "tip", "law": "jenkins", "normal_stiffness": 1e9, "tangential_stiffness": 1e9, "friction": 1}
        ],
        "sweep": {"start": 3000.0, "stop": 5000.0, "points": 5, "normal_forces": [1e9]},
    })  # fmt: skip
    found = {}
    for method in ("macneal", "massless-boundary", "dual-craig-bampton", "rubin"):
        result = run_case(case, block(method)[2])
        found[method] = np.concatenate([np.abs(result.responses[1e9].monitor) * 1e9, result.stuck[:3]])
    for method in ("massless-boundary", "dual-craig-bampton"):
        np.testing.assert_allclose(found[method], found["macneal"], rtol=1e-7)
    np.testing.assert_allclose(found["rubin"], found["macneal"], rtol=3e-3)  # 1e-3 measured: the inertia of the rest


def test_the_error_with_sticking_contacts_is_told_within_a_few_per_cent():
    """The stored estimate against the fixed-interface modes of the full model, for errors from 1e-4 to 20 %.

    The reference's own error after one step of inverse iteration, 4e-5 at most here, is the floor.
    """
    mesh, settings, _ = block("eigenmodes")
    pencil, _, _, _ = full_model(mesh, settings)
    exact = np.sqrt(fixed_interface_modes(pencil, interface_rows(mesh, settings), 3, certify=True).values[:3])
    told = {m: block(m, 20)[2].groups[0, 0].checks for m in METHODS}
    reference = 2 * np.pi * np.array([told["rubin"][f"stuck_hz_{i}"] for i in (1, 2, 3)])
    assert (reference > exact * (1 - 1e-9)).all() and np.abs(reference / exact - 1).max() < 1e-4
    errors = {m: [c[f"stuck_error_{i}"] for i in (1, 2, 3)] for m, c in told.items()}
    assert max(errors["craig-bampton"]) < 1e-4 < min(errors["rubin"]) and max(errors["rubin"]) < 2e-3
    assert max(errors["macneal"]) < 0.02 and min(errors["eigenmodes"]) > 0.05
    g = block("eigenmodes", 20)[2].groups[0, 0]
    T = np.vstack([g.interfaces[n].rows for n in ("tip", "side")])
    N = scipy.linalg.null_space(T)
    own = np.sqrt(np.linalg.eigvalsh(N.T @ np.diag(g.omega**2) @ N)[:3])
    np.testing.assert_allclose(errors["eigenmodes"], own / exact - 1, rtol=0.02)


def test_frequencies_of_a_reduced_body_are_not_called_certified():
    """Craig-Bampton's are those of the reduced body, Rubin's attachment shapes no modes; the others
    are certified."""
    said = {m: "\n".join(basis_summary(block(m)[2])) for m in METHODS}
    for method in ("eigenmodes", "macneal", "massless-boundary", "dual-craig-bampton"):
        assert "6 modes, certified complete" in said[method], method
    g = block("craig-bampton")[2].groups[0, 0]
    count, limit = g.checks["count_below_upper_shift"], g.checks["upper_shift_hz"]
    assert (
        f"18 modes of the reduced body; of the body itself {count:.0f} are certified below "
        f"{limit:.6g} Hz" in said["craig-bampton"]
    )
    assert "certified complete" not in said["craig-bampton"]
    assert "6 modes and 13 static shapes, the modes certified complete" in said["rubin"]
    assert "no modes of the body" in certificate(block("rubin")[2].groups[0, 0])
    assert "above" in certificate(g) and "these are all" not in certificate(g)


def test_the_summary_says_how_good_a_basis_is():
    lines = "\n".join(basis_summary(block("craig-bampton")[2]))
    assert "contacts exact" in lines and "above the certified ones" in lines and "every contact stuck" in lines
    assert "the solver adds the rest" in "\n".join(basis_summary(block("macneal")[2]))
    assert "no motion left" in "\n".join(basis_summary(block("eigenmodes", 6)[2]))
    shares = {1e-7: "less than 0.0001 %", 2.34e-5: "0.0023 %", 0.0123: "1.2 %", 0.1: "10 %", 0.9999: "100 %"}
    assert {e: percent_off(e) for e in shares} == shares
