"""The floating frame: inertia integrals, stiffening by inertia forces, conservation laws, and the linear limits."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from meshes import STEEL, body, brick, shaken, twisted_blade
from refusals import refused

from microslip.basis import check_basis, read_basis, write_basis
from microslip.data import MOTIONS
from microslip.fem.discretise import discretise, free_upper
from microslip.fem.operators import stress_stiffness
from microslip.linalg import eigen
from microslip.modal.boundary import fixed_dofs
from microslip.modal.compute import modal_basis
from microslip.modal.equilibrium import equilibrium, make_model
from microslip.reduced.floating_frame import (
    energy,
    first_moment,
    flight,
    floating_body,
    inertia,
    mass_matrix,
    moment_shape,
    momentum,
    rotation_shape,
    spin_up,
)

POINT = [0.01, -0.02, 0.03]


@cache
def free_body(stiffening=False):
    """A crooked brick that floats, the frame beside its centre; rubber, so that it deflects."""
    mesh = brick("hexahedron20", (1, 2, 4), (0.02, 0.03, 0.2), to=shaken(0.004))
    rubber = {"density": 1100.0, "young": 5e6, "poisson": 0.4}
    turning = {"speeds_rpm": [0.0], "axis": [0.0, 0, 1], "point": POINT}
    out = {"gauss": False, "nodal_stress": False, "stiffening": stiffening}
    return modal_basis(mesh, body(rubber, free=True, rotation=turning, modes={"count": 11}, output=out))


# ---------------------------------------------------------------- the integrals


def test_integrals_at_a_deflection_are_those_of_the_deflected_body():
    """First moment, inertia and h by quadrature at the points r + phi q."""
    basis = free_body()
    b = floating_body(basis, stiffened=False)
    q = 1e-3 * np.random.default_rng(1).normal(size=b.n_modes)
    (block,) = discretise(basis.mesh).blocks
    dm = 1100.0 * block.dx

    def at(field):
        return np.einsum("qk,ek...->eq...", block.N, field[block.cells])

    r, phi = at(basis.mesh.points + b.phi @ q - POINT), at(b.phi)
    D = np.einsum("eq,eqa,eqb->ab", dm, r, r)
    h = np.einsum("eq,eqcj->cj", dm, np.cross(r[..., None, :], phi.transpose(0, 1, 3, 2)).transpose(0, 1, 3, 2))
    pairs = (
        (first_moment(b, q), np.einsum("eq,eqa->a", dm, r)),
        (inertia(b, q), np.trace(D) * np.eye(3) - D),
        (rotation_shape(moment_shape(b, q)), h),
    )
    for found, exact in pairs:
        np.testing.assert_allclose(found, exact, atol=1e-10 * np.abs(exact).max())
    assert np.linalg.eigvalsh(mass_matrix(b, q)).min() > 0


def test_rigid_modes_carry_the_rigid_body():
    """The mass matrix of frame and rigid modes together has rank six: the modes repeat what the frame does."""
    g = free_body().groups[0, 0]
    rigid = g.omega == 0
    v = g.invariants
    S, h = v.shape[:, rigid], rotation_shape(v.position_shape[:, :, rigid])
    D, c = v.second_moment, v.first_moment
    tilde = np.array([[0, -c[2], c[1]], [c[2], 0, -c[0]], [-c[1], c[0], 0]])
    six = np.block([[v.mass * np.eye(3), -tilde], [tilde, np.trace(D) * np.eye(3) - D]])
    both = np.vstack([S, h])
    np.testing.assert_allclose(both @ both.T, six, atol=1e-9 * np.abs(six).max())


def test_elastic_modes_of_a_free_body_carry_no_momentum():
    v = free_body().groups[0, 0].invariants
    elastic = free_body().groups[0, 0].omega > 0
    assert np.abs(v.shape[:, elastic]).max() < 1e-7 * np.sqrt(v.mass)
    h = rotation_shape(v.position_shape[:, :, elastic])
    assert np.abs(h).max() < 1e-7 * np.sqrt(np.trace(v.second_moment))


def test_the_file_keeps_the_integrals(tmp_path):
    basis = free_body(True)
    write_basis(tmp_path / "b.h5", basis)
    kept = read_basis(tmp_path / "b.h5")
    for name in ("point", "mass", "first_moment", "second_moment", "shape", "position_shape", "shape_shape"):
        np.testing.assert_array_equal(
            getattr(kept.groups[0, 0].invariants, name), getattr(basis.groups[0, 0].invariants, name)
        )
    np.testing.assert_array_equal(kept.groups[0, 0].invariants.stiffening, basis.groups[0, 0].invariants.stiffening)
    assert all(c.passed for c in check_basis(kept))


def test_checks_find_a_wrong_integral():
    basis = free_body()
    g = basis.groups[0, 0]

    def failed(**changes):
        other = replace(g, invariants=replace(g.invariants, **changes))
        return {c.name for c in check_basis(replace(basis, groups={(0, 0): other})) if not c.passed}

    v = g.invariants
    assert failed() == set()
    assert "speed_0/nd_0: invariants: mass" in failed(mass=1.01 * v.mass)
    assert "speed_0/nd_0: invariants: inertia" in failed(second_moment=1.01 * v.second_moment)
    assert "speed_0/nd_0: invariants: shape_shape gives N" in failed(shape_shape=1.01 * v.shape_shape)


@pytest.mark.parametrize("name, found", [
    ("point", "first moment"), ("first_moment", "first moment"), ("second_moment", "second moment"),
    ("shape", "shape"), ("position_shape", "position_shape"),
])  # fmt: skip
def test_checks_find_a_wrong_integral_at_speed(name, found):
    """Where the body has moved its rigid numbers say nothing: the file's own mesh and static state do."""
    basis = turning_plate()
    g = basis.groups[0, 0]
    assert g.u_static.any() and all(c.passed for c in check_basis(basis))
    value = getattr(g.invariants, name)
    wrong = replace(g, invariants=replace(g.invariants, **{name: value + 1e-6 * np.abs(value).max()}))
    failed = {c.name for c in check_basis(replace(basis, groups={(0, 0): wrong})) if not c.passed}
    assert f"speed_0/nd_0: invariants: {found}" in failed


@cache
def turning_plate():
    mesh = brick("hexahedron20", (2, 1, 3), (0.02, 0.005, 0.1), to=shaken(0.0005))
    turning = {"speeds_rpm": [9000.0], "axis": [1.0, 0, 0], "point": [0.0, 0.01, -0.05]}
    out = {"gauss": False, "nodal_stress": False}
    return modal_basis(mesh, body(supports=[{"face": "z0"}], rotation=turning, modes={"count": 6}, output=out))


def test_what_is_missing_is_told():
    refused("stiffening = true", floating_body, free_body())
    refused("choose a lower number", floating_body, free_body(), 3, stiffened=False)


# ---------------------------------------------------------------- free motion


def test_a_free_body_keeps_its_momenta_and_its_energy():
    """Tumbling and vibrating by some per cent of its length for two periods of the first mode and half a turn."""
    b = floating_body(free_body(), stiffened=False)
    first = np.sqrt(np.diag(b.K).min())
    q = np.zeros(b.n_modes)
    q[0], q[2] = 2e-3, 1e-3
    times = np.linspace(0, 2 * 2 * np.pi / first, 41)
    f = flight(b, times, np.array([0.3, 0.2, 0.1]) * first, np.array([0.5, -0.2, 0.1]), q)
    state = zip(f.velocity, f.angular_velocity, f.q, f.q_velocity, strict=True)
    found = [(energy(b, *s), *momentum(b, *s)) for s in state]
    E = np.array([e for e, _, _ in found])
    p = np.array([A @ p for A, (_, p, _) in zip(f.attitude, found, strict=True)])
    L = np.array([A @ h + np.cross(r, A @ p) for A, r, (_, p, h) in zip(f.attitude, f.position, found, strict=True)])
    np.testing.assert_allclose(E, E[0], rtol=1e-8)
    np.testing.assert_allclose(p, np.tile(p[0], (len(p), 1)), atol=1e-8 * np.abs(p[0]).max())
    np.testing.assert_allclose(L, np.tile(L[0], (len(L), 1)), atol=1e-8 * np.abs(L[0]).max())
    assert np.abs(f.q[:, 1]).max() > 1e-5  # the motions are coupled


def test_a_stiff_body_turns_as_a_rigid_one():
    """Euler's equations about the centre: rubber deflects little while it tumbles about once a second."""
    b = floating_body(free_body(), stiffened=False)
    w = np.array([5.0, 2.0, 1.0])
    times = np.linspace(0, 0.5, 5)
    f = flight(b, times, w, tolerance=1e-7)
    c = b.invariants.first_moment / b.invariants.mass
    about = inertia(b, 0 * b.pull) - b.invariants.mass * (c @ c * np.eye(3) - np.outer(c, c))
    from scipy.integrate import solve_ivp

    exact = solve_ivp(
        lambda t, x: np.linalg.solve(about, -np.cross(x, about @ x)), (0, 0.5), w, t_eval=times, rtol=1e-10, atol=1e-12
    ).y.T
    # (speed over first frequency)^2 is 4e-4
    np.testing.assert_allclose(f.angular_velocity, exact, atol=2e-3 * np.linalg.norm(w))


# ---------------------------------------------------------------- stiffening


@cache
def blade():
    mesh = twisted_blade(n=(1, 2, 5))
    out = {"gauss": False, "nodal_stress": False, "stiffening": True}
    turning = {"speeds_rpm": [0.0, 600.0], "prestress": "linear"}
    what = body(supports=[{"face": "z0"}], rotation=turning, modes={"count": 30}, output=out)
    return modal_basis(mesh, what)


def test_stiffening_by_rotation_is_the_geometric_stiffness_of_the_linear_state():
    """Per Omega^2 about y the textbook's K_sigma of one linear solution at 600 rpm, on 30 shapes at rest."""
    basis = blade()
    rest, speed = basis.groups[0, 0], basis.groups[1, 0].speed
    assert rest.invariants.stiffening.shape == (12, 30, 30)
    d, what = discretise(basis.mesh), body(supports=[{"face": "z0"}])
    fixed = fixed_dofs(basis.mesh, what)
    model = make_model(
        d, what.material.material(), free_upper(d.pattern, fixed), fixed, np.array([0.0, 1, 0]), np.zeros(3), None,
        293.15, np.zeros((basis.mesh.n_points, 3)), True,
    )  # fmt: skip
    state = equilibrium(model, speed, "linear", eigen.new_solver("superlu"))
    phi = rest.phi.reshape(-1, 30)
    K_sigma = stress_stiffness(d, state.stress)[:, None, None] * np.eye(3)
    exact = phi.T @ (d.pattern.full(K_sigma) @ phi)
    np.testing.assert_allclose(speed**2 * rest.invariants.stiffening[1], exact, atol=1e-7 * np.abs(exact).max())


def test_gravity_stiffens_a_hanging_body():
    """An upward acceleration of the frame stretches the blade that hangs from it, as K_sigma of rho a L A does."""
    rod = brick("hexahedron20", (1, 1, 10), (0.01, 0.01, 1.0), (-0.005, -0.005, 0.0))
    out = {"gauss": False, "nodal_stress": False, "stiffening": True}
    g = modal_basis(rod, body(supports=[{"face": "z0"}], modes={"count": 4}, output=out)).groups[0, 0]
    found = g.invariants.stiffening[MOTIONS.index("az")]
    # w = the first bending shape; integral of T w'^2 with T = -rho A a (L - z) for an acceleration along +z
    z = rod.points[:, 2]
    line = np.unique(z)
    w = np.array([[g.phi[z == s][:, a, 0].mean() for a in (0, 1)] for s in line])
    slope = np.gradient(w, line, axis=0)
    T = -STEEL["density"] * 1e-4 * (1 - line)
    exact = np.trapezoid(T[:, None] * slope**2, line, axis=0).sum()
    assert found[0, 0] == pytest.approx(exact, rel=0.02)  # gradient and trapezoid on 21 points


# ---------------------------------------------------------------- prescribed rotation


@pytest.mark.slow
def test_a_slow_spin_up_ends_in_the_static_deflection():
    """Omega raised smoothly to 600 rpm: the modal coordinates end where K(Omega) q = Omega^2 centrifugal has them."""
    b = floating_body(blade())
    end, T = blade().groups[1, 0].speed, 0.8

    def speed(t):
        return end * (t / T - np.sin(2 * np.pi * t / T) / (2 * np.pi)) if t < T else end

    def acceleration(t):
        return end / T * (1 - np.cos(2 * np.pi * t / T)) if t < T else 0.0

    run = spin_up(b, speed, acceleration, np.array([0.0, 1.05 * T]), tolerance=1e-6)
    rest = blade().groups[0, 0]
    K = rest.K_r + end**2 * (rest.invariants.stiffening[1] - rest.run_up.P)
    q = np.linalg.solve(K, end**2 * rest.run_up.centrifugal)
    # the profile's third derivative jumps at its ends, which leaves the first mode swinging by some 1e-4
    np.testing.assert_allclose(run.q[-1], q, atol=1e-3 * np.abs(q).max())
    np.testing.assert_allclose(rest.phi @ q, blade().groups[1, 0].u_static, atol=0.02 * np.abs(rest.phi @ q).max())
