"""Modes with gyroscopic coupling: closed forms, the Hermitian pencil, directions, stability, the bound of their error,
and what a change of the speed adds."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import scipy.linalg
import small
from closed_forms.rings import ring_at_rest, spinning_ring
from closed_forms.shafts import spinning_mass
from meshes import STEEL, body, brick, nearest, pipe, twisted_blade

from microslip.basis import check_basis, read_basis, write_basis
from microslip.fem.discretise import discretise, free_upper
from microslip.frames import skew
from microslip.linalg import eigen
from microslip.linalg.gyroscopic import (
    general_modes,
    gyroscopic_modes,
    hermitian_modes,
    stability_sentence,
)
from microslip.modal.campbell import crossings, gyroscopic_change, track_gyroscopic
from microslip.modal.compute import modal_basis
from microslip.modal.equilibrium import equilibrium, make_model
from microslip.modal.invariants import run_up_terms
from microslip.reduced.coordinates import in_modes
from microslip.report.body import report_html
from microslip.units import to_rpm

ROOT = {"supports": [{"face": "z0"}]}
QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])  # n x u in the plane of the rotation


def random_pencil(m, complex_numbers, seed=0):
    rng = np.random.default_rng(seed)

    def matrix():
        a = rng.normal(size=(m, m))
        return a + 1j * rng.normal(size=(m, m)) if complex_numbers else a

    A, B, C = matrix(), matrix(), matrix()
    return A @ A.conj().T + np.eye(m), C - C.conj().T, 20 * (B @ B.conj().T + np.eye(m))


# ---------------------------------------------------------------- the eigenproblem


@pytest.mark.parametrize("complex_numbers", [False, True])
def test_the_hermitian_pencil_has_the_eigenvalues_of_the_quadratic_problem(complex_numbers):
    """All omega are real, solve det(-omega^2 M + i omega G + K) = 0, and no shape is missing."""
    M, G, K = random_pencil(7, complex_numbers)
    omega, x = hermitian_modes(M, G, K)
    s, _ = general_modes(M, G, K)
    np.testing.assert_allclose(np.sort(omega), np.sort(s.imag), rtol=1e-10)
    rest = (M @ x) * omega**2 - 1j * omega * (G @ x) - K @ x
    assert np.abs(rest).max() < 1e-10 * np.abs(K @ x).max()
    assert np.linalg.matrix_rank(np.vstack([x, x * omega])) == 14


def test_real_bodies_have_one_mode_a_pair_and_complex_ones_both_waves():
    for flag, count in ((False, 6), (True, 12)):
        M, G, K = random_pencil(6, flag, seed=3)
        modes = gyroscopic_modes(M, G, K, 0.01 * G)
        assert len(modes.omega) == count and modes.stable
        assert (np.diff(np.abs(modes.omega)) >= 0).all() and ((modes.omega < 0).any() == flag)
        mass = np.einsum("ij,ij->j", modes.shapes.conj(), M @ modes.shapes)
        np.testing.assert_allclose(mass, 1, atol=1e-12)


@pytest.mark.parametrize("second", [100.0, 130.0])
def test_mass_on_two_springs(second):
    """Seen from the turning frame; the orbits of equal springs are circles, the slower one with the spin."""
    speed = 30.0
    K = np.diag([100.0**2, second**2]) - speed**2 * np.eye(2)
    modes = gyroscopic_modes(np.eye(2), 2 * speed * QUARTER, K, QUARTER)
    np.testing.assert_allclose(modes.omega, spinning_mass(100.0, second, speed), rtol=1e-12)
    assert modes.direction == ("forward", "backward")
    if second == 100.0:
        np.testing.assert_allclose(modes.sense, [1, -1], atol=1e-12)


def test_divergence_between_the_critical_speeds_and_flutter_of_none():
    """100 < Omega < 130 rad/s: K has one negative direction and the mass leaves; above both it is held by G."""

    def at(speed):
        K = np.diag([100.0**2, 130.0**2]) - speed**2 * np.eye(2)
        return gyroscopic_modes(np.eye(2), 2 * speed * QUARTER, K, QUARTER)

    between, above = at(115.0), at(160.0)
    assert not between.stable and "divergence" in stability_sentence(between)
    # (100^2 - 115^2 + s^2) (130^2 - 115^2 + s^2) + 4 115^2 s^2 = 0
    a, b = 100.0**2 - 115.0**2, 130.0**2 - 115.0**2
    square = np.roots([1.0, a + b + 4 * 115.0**2, a * b])
    assert between.growth.max() == pytest.approx(np.sqrt(square.max()), rel=1e-9)
    assert above.stable and len(above.omega) == 2
    assert (above.direction.count("forward"), above.direction.count("backward")) == (0, 2)  # both lag the frame


def test_flutter_is_told_with_its_frequency():
    """Two negative directions held by too weak a G: the quartic s^4 + (4 W^2 - 2 a) s^2 + a^2 has complex roots."""
    a, speed = 100.0, 5.0
    modes = gyroscopic_modes(np.eye(2), 2 * speed * QUARTER, -a * np.eye(2), QUARTER)
    s = np.sqrt(np.roots([1.0, 4 * speed**2 - 2 * a, a**2]).astype(complex))
    assert modes.growth.max() == pytest.approx(np.abs(s.real).max(), rel=1e-6)
    assert "flutter at" in stability_sentence(modes)


# ---------------------------------------------------------------- bodies

BLADE = twisted_blade(n=(1, 2, 5))


@cache
def blade(count, reduction="eigenmodes", rpm=30000.0):
    tip = {"name": "tip", "face": "z1", "t2": [0.0, 1.0, 0.0]}
    settings = body(
        **ROOT, modes={"count": count}, rotation={"speeds_rpm": [rpm]}, interfaces=[tip], reduction=reduction
    )
    return modal_basis(BLADE, settings)


@cache
def whole_blade(rpm=30000.0):
    """Frequencies of the unreduced blade, all of its modes kept (dense)."""
    basis = blade(4, rpm=rpm)
    g = basis.groups[0, 0]
    d = discretise(BLADE)
    fixed = np.unique(3 * BLADE.face_points("z0")[:, None] + np.arange(3))
    free = free_upper(d.pattern, fixed)
    what = body(**ROOT)
    model = make_model(
        d, what.material.material(), free, fixed, np.array([0.0, 1, 0]), np.zeros(3), None, 293.15,
        np.zeros((BLADE.n_points, 3)), True,
    )  # fmt: skip
    state = equilibrium(model, g.speed, "nonlinear", eigen.new_solver("superlu"))
    K = d.pattern.full(state.K).toarray()[np.ix_(free.free, free.free)]
    M = np.kron(model.M_full.toarray(), np.eye(3))[np.ix_(free.free, free.free)]
    N = np.kron(model.M_full.toarray(), skew(model.axis))[np.ix_(free.free, free.free)]
    _, X = scipy.linalg.eigh(K, M)
    heavy = np.abs(X).max(axis=0) < 1e8  # the four-point mass leaves a few modes without mass
    X = X[:, heavy][:, :120]
    omega, _ = hermitian_modes(np.eye(X.shape[1]), 2 * g.speed * X.T @ N @ X, X.T @ K @ X)
    return np.sort(omega[omega > 0])


@pytest.mark.parametrize("count", [4, 8, 16])
def test_the_bound_of_the_error_holds_and_is_no_larger_than_need_be(count):
    """Against 120 modes of the same blade: too high, by less than the bound, which falls with the modes kept."""
    g = blade(count).groups[0, 0]
    exact = whole_blade()[: len(g.gyroscopic.omega)]
    error = g.gyroscopic.omega / exact - 1
    assert (error > -1e-9).all() and (error <= g.gyroscopic.error + 1e-9).all()
    assert g.gyroscopic.error[0] < 3000 * max(error[0], 1e-9)
    assert blade(2 * count).groups[0, 0].gyroscopic.error[0] < g.gyroscopic.error[0]


@pytest.mark.parametrize("reduction", ["rubin", "craig-bampton", "dual-craig-bampton", "massless-boundary"])
def test_every_basis_has_gyroscopic_modes(reduction):
    """Static modes of the tip hold most of the stretching by Coriolis forces that eight eigenmodes leave out.

    Bending across the rotation pulls the blade along its length, 4e-3 of the first frequency at 30000 rpm; the
    eigenmodes that stretch it lie far above. Rubin's coordinates contain the eigenmodes: the bound still holds.
    """
    g = blade(8, reduction).groups[0, 0]
    if reduction in ("rubin", "craig-bampton"):
        np.testing.assert_allclose(g.gyroscopic.omega[:4], whole_blade()[:4], rtol=2e-3)
    else:  # static forces and massless coordinates take no part in the coupling
        np.testing.assert_allclose(g.gyroscopic.omega[:4], whole_blade()[:4], rtol=6e-3)
    own = in_modes(g)
    again = gyroscopic_modes(own.M_r, own.G_r, own.K_r, own.run_up.N)
    np.testing.assert_allclose(again.omega, g.gyroscopic.omega, rtol=1e-8)
    mass = np.einsum("ij,ij->j", own.gyroscopic.shapes.conj(), own.gyroscopic.shapes)
    np.testing.assert_allclose(mass, 1, atol=1e-9)
    if reduction == "rubin":
        eight = blade(8).groups[0, 0].gyroscopic
        assert (g.gyroscopic.omega[:8] <= eight.omega * (1 + 1e-12)).all()
        np.testing.assert_allclose(g.gyroscopic.error[:8], eight.error, rtol=1e-6)
        assert np.isnan(g.gyroscopic.error[8:]).all()


def test_a_spinning_beam_whirls_forward_and_backward_in_circles():
    mesh = brick("hexahedron20", (1, 1, 8), (0.02, 0.02, 1.0), (-0.01, -0.01, 0))
    g = modal_basis(mesh, body(**ROOT, rotation={"speeds_rpm": [120.0], "axis": [0.0, 0, 1]}, modes={"count": 6}))
    y = g.groups[0, 0].gyroscopic
    assert y.direction == ("forward", "backward") * 3
    # the turning of the cross-sections moves points along the axis: (k h)^2 / 12 of the mass, 2e-3 in the third pair
    np.testing.assert_allclose(np.abs(y.sense), 1, atol=4e-3)
    assert np.diff(y.omega)[0] == pytest.approx(2 * g.groups[0, 0].speed, rel=1e-3)


def test_at_rest_or_when_not_asked_for_there_are_none():
    assert blade(4, rpm=0.0).groups[0, 0].gyroscopic is None
    off = {"speeds_rpm": [3000.0], "gyroscopic": False}
    assert modal_basis(BLADE, body(**ROOT, rotation=off, modes={"count": 2})).groups[0, 0].gyroscopic is None


# ---------------------------------------------------------------- spinning ring

RADIUS, THICK, WIDE, SECTORS = 0.25, 0.01, 0.01, 48


@cache
def ring(speed):
    """Elastic in-plane modes of a thin free ring at speed about z: shapes (n, 3, m), lambda (m,), N (m, m)."""
    mesh = pipe("hexahedron20", (1, SECTORS, 1), RADIUS - THICK / 2, RADIUS + THICK / 2, WIDE)
    d, n = discretise(mesh), mesh.n_points
    x, y, _ = mesh.points.T
    axial = 3 * mesh.face_points("z0") + 2
    # the axisymmetric expansion moves points of the x axis along x only: holding them hinders it nowhere
    across = [3 * np.flatnonzero(np.abs(y) < 1e-9) + 1, 3 * np.flatnonzero(np.abs(x) < 1e-9)]
    held = np.unique(np.concatenate([axial, *across]))
    what = body()

    def model(fixed):
        return make_model(
            d, what.material.material(), free_upper(d.pattern, fixed), fixed, np.array([0.0, 0, 1]), np.zeros(3), None,
            293.15, np.zeros((n, 3)), True,
        )  # fmt: skip

    state = equilibrium(model(held), speed, "nonlinear", eigen.new_solver("superlu"))
    loose = model(axial)
    free = loose.free.free
    K = d.pattern.full(state.K).toarray()[np.ix_(free, free)]
    M = np.kron(loose.M_full.toarray(), np.eye(3))[np.ix_(free, free)]
    values, X = scipy.linalg.eigh(K, M, subset_by_index=[0, 14])
    X, values = X[:, 3:], values[3:]  # two translations and the turning of the whole ring
    phi = np.zeros((3 * n, X.shape[1]))
    phi[free] = X
    phi = phi.reshape(n, 3, -1)
    Mphi = (loose.M_full @ phi.reshape(n, -1)).reshape(phi.shape)
    return mesh, phi, values, run_up_terms(loose, state, phi, Mphi).N


def test_split_of_the_spinning_ring():
    """In-plane bending waves about the ring's own expanded state, at a third of its first frequency.

    At rest they lie above those of a thin ring by the mesh (membrane locking of curved cells, 0.8 % measured) less
    shear and rotary inertia; what the spin adds to them follows the closed form to n^2 (h/R)^2 / 12 of rotary inertia.
    """
    _, _, still, _ = ring(0.0)
    rest = np.sqrt(still[[0, 2]])
    thin = [ring_at_rest(n, RADIUS, STEEL["young"], STEEL["density"], THICK) for n in (2, 3)]
    np.testing.assert_allclose(rest, thin, rtol=0.012)
    speed = 0.33 * rest[0]
    _, _, values, N = ring(speed)
    modes = gyroscopic_modes(np.eye(len(values)), 2 * speed * N, np.diag(values), N)
    for j, n in enumerate((2, 3)):
        forward, backward = spinning_ring(n, rest[j], speed)
        pair = modes.omega[2 * j : 2 * j + 2]
        np.testing.assert_allclose(pair, [-forward, backward], rtol=2e-3)
        assert np.diff(pair)[0] == pytest.approx(4 * n / (n**2 + 1) * speed, rel=2e-3)
        assert modes.direction[2 * j : 2 * j + 2] == ("forward", "backward")
        assert np.abs(modes.sense[2 * j]) == pytest.approx(2 * n / (n**2 + 1), rel=2e-3)


def test_waves_of_the_ring_in_cyclic_coordinates():
    """The pair of two nodal diameters as one complex shape: the same frequencies, the same directions."""
    speed = 200.0
    mesh, phi, values, N = ring(speed)
    pair = phi[:, :, :2]
    a = 2 * np.pi / SECTORS
    R = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    here = nearest(mesh, (RADIUS + THICK / 2, 0, 0))
    there = nearest(mesh, R @ mesh.points[here])
    for sign in (1, -1):  # u(R x) = R u(x) exp(+i 2 a) is the convention
        c = np.array([1.0, sign * 1j]) / np.sqrt(2)
        if np.allclose(pair[there] @ c, R @ pair[here] @ c * np.exp(2j * a), rtol=1e-3, atol=1e-3 * np.abs(pair).max()):
            break
    else:
        pytest.fail("the pair makes no wave of two nodal diameters")
    c = c[:, None]
    n1 = c.conj().T @ N[:2, :2] @ c
    one = np.ones((1, 1), dtype=complex)
    wave = gyroscopic_modes(one, 2 * speed * n1, values[0] * one, n1)
    both = gyroscopic_modes(np.eye(2), 2 * speed * N[:2, :2], np.diag(values[:2]), N[:2, :2])
    np.testing.assert_allclose(np.abs(wave.omega), both.omega, rtol=1e-6)
    assert wave.direction == both.direction == ("forward", "backward")
    assert wave.omega[0] < 0 < wave.omega[1]
    np.testing.assert_allclose(wave.sense, both.sense, atol=1e-4)


def test_bending_waves_of_a_disc_do_not_split_in_its_own_frame():
    """Axial motion has no Coriolis force: forward and backward bending waves of a thin disc agree to (h/R)^2."""
    mesh = pipe("hexahedron20", (2, 12, 1), 0.05, 0.2, 0.002)
    turning = {"speeds_rpm": [3000.0], "axis": [0.0, 0, 1]}
    g = modal_basis(mesh, body(supports=[{"face": "x0"}], rotation=turning, modes={"count": 5})).groups[0, 0]
    np.testing.assert_allclose(g.gyroscopic.omega, g.omega, rtol=1e-3)
    pairs = g.gyroscopic.omega[1:5].reshape(2, 2)
    assert (np.diff(pairs, axis=1) < 0.02 * g.speed).all()


# ---------------------------------------------------------------- run-up


def test_run_up_terms_are_their_integrals():
    """By quadrature of the shapes: N, P, and the loads -(n x r) and (1 - n n^T) r at the displaced points."""
    g = blade(6).groups[0, 0]
    (b,) = discretise(BLADE).blocks
    dm = STEEL["density"] * b.dx
    axis = np.array([0.0, 1.0, 0.0])
    phi = np.einsum("qk,ekim->eqim", b.N, g.phi[b.cells])
    r = np.einsum("qk,eki->eqi", b.N, (BLADE.points + g.u_static)[b.cells])
    turned = np.cross(axis, phi, axisb=2, axisc=2)
    N = np.einsum("eq,eqia,eqib->ab", dm, phi, turned)
    P = np.einsum("eq,eqia,eqib->ab", dm, turned, turned)
    euler = -np.einsum("eq,eqia,eqi->a", dm, phi, np.cross(axis, r))
    pull = np.einsum("eq,eqia,eqi->a", dm, phi, r * [1, 0, 1])
    for found, exact in ((g.run_up.N, N), (g.run_up.P, P), (g.run_up.euler, euler), (g.run_up.centrifugal, pull)):
        np.testing.assert_allclose(found, exact, atol=1e-10 * np.abs(exact).max())
    np.testing.assert_allclose(g.G_r, 2 * g.speed * g.run_up.N, atol=1e-10 * np.abs(g.G_r).max())


def test_the_centrifugal_load_moves_the_static_state_with_the_speed():
    """K_r q = (W^2 - W0^2) centrifugal is the change of the static state, to first order in the change of W^2."""
    near = {"speeds_rpm": [10000.0, 10010.0]}
    basis = modal_basis(BLADE, body(**ROOT, rotation=near, modes={"count": 60}))
    a, b = basis.groups[0, 0], basis.groups[1, 0]
    q = np.linalg.solve(a.K_r, (b.speed**2 - a.speed**2) * a.run_up.centrifugal)
    change = b.u_static - a.u_static
    # what 60 modes leave out of a static deflection, and the second order of 0.2 %
    assert np.abs(a.phi @ q - change).max() < 0.01 * np.abs(change).max()


# ---------------------------------------------------------------- over the speed


def test_branches_of_the_campbell_diagram():
    """The pair of a square beam parts into a rising backward and a falling forward branch, 2 Omega apart."""
    mesh = brick("hexahedron20", (1, 1, 8), (0.02, 0.02, 1.0), (-0.01, -0.01, 0))
    turning = {"speeds_rpm": [0.0, 150.0, 300.0], "axis": [0.0, 0, 1]}
    basis = modal_basis(mesh, body(**ROOT, rotation=turning, modes={"count": 4}))
    tracks = track_gyroscopic(basis)
    assert tracks.modes.shape == (4, 3) and (tracks.modes >= 0).all()
    first = tracks.omega[:2]
    np.testing.assert_allclose(np.abs(np.diff(first, axis=0))[0], 2 * tracks.speeds, atol=1e-3 * first.max())
    assert sorted(np.sign(np.diff(first, axis=1).sum(axis=1))) == [-1, 1]
    x = tracks.speeds[-1] / first[0, 0]  # omega_0 + Omega over the uncoupled root of omega_0^2 - Omega^2
    assert gyroscopic_change(basis) == pytest.approx(np.sqrt((1 + x) / (1 - x)) - 1, rel=1e-2)
    assert track_gyroscopic(blade(4)) is None  # one speed only
    meets = [c.speed for c in crossings(tracks, [5])]  # omega_0 -+ Omega = 5 Omega
    np.testing.assert_allclose(meets, first[0, 0] / np.array([6.0, 4.0]), rtol=2e-3)
    settings = {"settings": '{"rotation": {"engine_orders": [5]}}'}
    page = report_html(replace(basis, provenance=settings), {})
    assert all(f">{to_rpm(speed):.0f}<" in page for speed in meets)
    assert "The rotating body is stable" in page and "backward" in page


# ---------------------------------------------------------------- the file


def test_the_file_keeps_them(tmp_path):
    basis = small.basis((6000.0,))
    write_basis(tmp_path / "b.h5", basis)
    g, kept = basis.groups[0, 0], read_basis(tmp_path / "b.h5").groups[0, 0]
    for name in ("N", "P", "euler", "centrifugal"):
        np.testing.assert_array_equal(getattr(kept.run_up, name), getattr(g.run_up, name))
    for name in ("omega", "shapes", "growth", "sense", "error"):
        np.testing.assert_array_equal(getattr(kept.gyroscopic, name), getattr(g.gyroscopic, name))
    assert kept.gyroscopic.direction == g.gyroscopic.direction
    assert all(c.passed for c in check_basis(read_basis(tmp_path / "b.h5")))


def test_checks_find_a_wrong_matrix_and_a_wrong_mode():
    basis = small.basis((6000.0,))
    g = basis.groups[0, 0]

    def failed(**changes):
        return {c.name for c in check_basis(replace(basis, groups={(0, 0): replace(g, **changes)})) if not c.passed}

    other = replace(g.run_up, N=1.01 * g.run_up.N)
    assert "speed_0/nd_0: G_r is 2 Omega N" in failed(run_up=other)
    shifted = replace(g.gyroscopic, omega=1.001 * g.gyroscopic.omega)
    assert "speed_0/nd_0: gyroscopic: modes satisfy their equation" in failed(gyroscopic=shifted)
    assert "speed_0/nd_0: shapes of the arrays agree" in failed(run_up=replace(g.run_up, euler=np.zeros(3)))
