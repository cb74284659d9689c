"""Static states at speed, heated and loaded, and the stiffness about them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from closed_forms.bars import box_frequencies
from meshes import STEEL, body, brick, nearest, roller_box, shaken, twisted_blade, with_sets
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

from microslip.errors import UserError
from microslip.fem.discretise import discretise, free_upper
from microslip.fem.operators import displacement_gradient, green_strain, internal_force, stress_stiffness
from microslip.linalg import eigen
from microslip.modal.boundary import fixed_dofs
from microslip.modal.compute import modal_basis
from microslip.modal.equilibrium import (
    equilibrium,
    heated,
    make_model,
    softening,
    stiffness_slope,
    stress_of,
)

E, NU, RHO = STEEL["young"], STEEL["poisson"], STEEL["density"]
LAME, SHEAR = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
HOT = {**STEEL, "expansion": 1.2e-5}
ROOT = {"supports": [{"face": "z0"}]}
Y = np.array([0.0, 1.0, 0.0])


def the_group(mesh, temperature=None, **what):
    what = {"modes": {"count": 4}, **what}
    return modal_basis(mesh, body(**what), temperature=temperature).groups[0, 0]


def model_of(mesh, what, load=None, spin_softening=True, axis=Y, temperature=None):
    d = discretise(mesh)
    fixed = fixed_dofs(mesh, what)
    load = np.zeros((mesh.n_points, 3)) if load is None else load
    return make_model(
        d, what.material.material(), free_upper(d.pattern, fixed), fixed, axis, np.zeros(3), temperature, 293.15, load,
        spin_softening,
    )  # fmt: skip


def at_rpm(rpm, **more):
    return {"speeds_rpm": [float(rpm)], **more}


BLADE = twisted_blade(n=(1, 3, 6))


# ---------------------------------------------------------------- equilibrium


def unbalance(model, speed, u):
    """Internal minus outer forces with everything written out again: F S, Omega^2 M P (x + u), dead loads."""
    d = model.d
    H = [displacement_gradient(b, u) for b in d.blocks]
    S = stress_of(heated(model), [green_strain(h) for h in H])
    r = model.d.mesh.points + u
    pull = speed**2 * (model.M_full @ (r - np.outer(r @ model.axis, model.axis)))
    return (internal_force(d, S, H) - pull - model.dead_load).reshape(-1)[model.free.free]


@pytest.mark.parametrize("hot", ["", "steel", "orthotropic"])
def test_forces_balance_and_the_tangent_is_their_derivative(hot):
    """Newton's end state of a twisted blade at 12000 rpm under a side load (a twentieth on wood), heated or not, and
    d(unbalance)/du = K, dK/dOmega^2 by differences of the equilibria."""
    rng = np.random.default_rng(0)
    load = np.zeros((BLADE.n_points, 3))
    load[BLADE.face_points("z1")] = np.array([30.0, -20.0, 5.0]) / (20 if hot == "orthotropic" else 1)
    material = {"": STEEL, "steel": HOT, "orthotropic": TURNED}[hot]
    T = 293.15 + 2000 * BLADE.points[:, 2] if hot else None
    model = model_of(BLADE, body(**ROOT, material=material), load, temperature=T)
    speed, solver = 12000 * np.pi / 30, eigen.new_solver("superlu")
    state = equilibrium(model, speed, "nonlinear", solver)
    scale = np.abs(internal_force(model.d, state.stress, state.H)).max()
    assert np.abs(unbalance(model, speed, state.u)).max() < 1e-7 * scale
    assert state.iterations <= 9
    v, h = np.zeros((BLADE.n_points, 3)), 1e-7
    v.reshape(-1)[model.free.free] = rng.normal(size=len(model.free.free))
    difference = (unbalance(model, speed, state.u + h * v) - unbalance(model, speed, state.u - h * v)) / (2 * h)
    Kv = (model.d.pattern.full(state.K) @ v.reshape(-1))[model.free.free]
    assert np.abs(Kv - difference).max() < 1e-6 * np.abs(Kv).max()
    _, dK = stiffness_slope(model, state, solver)
    low, high = (equilibrium(model, np.sqrt(speed**2 + s), "nonlinear", solver, state) for s in (-2e3, 2e3))
    assert np.abs((high.K - low.K) / 4e3 - dK).max() < 1e-5 * np.abs(dK).max()


def linearly_stressed(model, state):
    """(p, 3, 3) K0 + K_sigma: the textbook's linear prestress without the displaced geometry."""
    return model.K0 + stress_stiffness(model.d, state.stress)[:, None, None] * np.eye(3)


def test_linear_state_is_one_linear_solution():
    """u grows as Omega^2, and K is the tangent with its displacements and stresses (K_u + K_sigma - Omega^2 M P)."""
    model = model_of(BLADE, body(**ROOT))
    solver = eigen.new_solver("superlu")
    a, b = (equilibrium(model, s, "linear", solver) for s in (500.0, 1000.0))
    np.testing.assert_allclose(b.u, 4 * a.u, atol=1e-10 * np.abs(b.u).max())
    K0 = model.d.pattern.full(model.K0)
    pull = model.M_full @ ((BLADE.points) * [1, 0, 1]) * 500.0**2
    free = model.free.free
    left = (K0 @ a.u.reshape(-1) - pull.reshape(-1))[free]
    assert np.abs(left).max() < 1e-8 * np.abs(pull).max()
    textbook = linearly_stressed(model, a) + softening(model, 500.0)
    # small displacements: both agree to the order of the displacement gradient
    tiny = equilibrium(model, 5.0, "linear", solver)
    size = np.abs(tiny.K - model.K0).max()
    assert np.abs(tiny.K - (linearly_stressed(model, tiny) + softening(model, 5.0))).max() < 30 * size
    assert np.abs(a.K - textbook).max() > 0


def test_slow_rotation_makes_linear_and_nonlinear_agree():
    """The difference of displacements falls with Omega^4, of frequency shifts likewise."""
    gaps = []
    for rpm in (1500, 3000):
        a, b = (the_group(BLADE, **ROOT, rotation=at_rpm(rpm, prestress=p)) for p in ("linear", "nonlinear"))
        gaps.append((np.abs(a.u_static - b.u_static).max(), np.abs(a.omega**2 - b.omega**2).max()))
    ratio = np.log2(np.array(gaps[1]) / np.array(gaps[0]))
    np.testing.assert_allclose(ratio, 4, atol=0.3)


def test_linear_prestress_is_per_cents_off_on_a_staggered_blade():
    """A thin twisted blade untwists; without the displaced state its second to fourth frequency are 2 to 3 % off."""
    fast, thin = at_rpm(24000), twisted_blade(n=(1, 3, 8), thickness=0.002)
    a, b = (the_group(thin, **ROOT, rotation={**fast, "prestress": p}) for p in ("linear", "nonlinear"))
    assert 0.02 < np.abs(a.omega / b.omega - 1).max() < 0.05
    assert a.prestress == "linear" and b.prestress == "nonlinear"


def test_a_sweep_gives_what_single_speeds_give():
    """Warm starts change nothing (Newton ends at 1e-9 of u)."""
    speeds = [0.0, 6000.0, 12000.0]
    sweep = modal_basis(BLADE, body(**ROOT, modes={"count": 4}, rotation={"speeds_rpm": speeds}))
    for i, rpm in enumerate(speeds):
        alone = the_group(BLADE, **ROOT, rotation=at_rpm(rpm))
        np.testing.assert_allclose(sweep.groups[i, 0].omega, alone.omega, rtol=1e-8)
        np.testing.assert_allclose(
            sweep.groups[i, 0].u_static, alone.u_static, atol=1e-8 * max(np.abs(alone.u_static).max(), 1e-12)
        )
    assert sweep.groups[0, 0].prestress == "none" and sweep.groups[2, 0].speed == pytest.approx(400 * np.pi)


def test_newton_is_not_misled_by_an_indefinite_step_on_its_way():
    """A foil of a blade at once at 48000 rpm: iterates have negative directions, the equilibrium has none."""
    foil = twisted_blade(n=(1, 3, 8), thickness=0.0008, twist=-1.0, stagger=1.2)
    at_once = the_group(foil, **ROOT, rotation=at_rpm(48000))
    by_steps = modal_basis(foil, body(**ROOT, modes={"count": 4}, rotation={"speeds_rpm": [12000.0, 24000.0, 48000.0]}))
    np.testing.assert_allclose(at_once.omega, by_steps.groups[2, 0].omega, rtol=1e-7)


def test_rotor_axis_and_point_are_used():
    """A blade and its copy moved along the rotor axis see the same; away from it, more pull."""
    from meshes import moved

    base = the_group(BLADE, **ROOT, rotation=at_rpm(9000))
    along = moved(BLADE, np.eye(3), np.array([0, 0.3, 0]))
    np.testing.assert_allclose(the_group(along, **ROOT, rotation=at_rpm(9000)).omega, base.omega, rtol=1e-8)
    away = moved(BLADE, np.eye(3), np.array([0, 0, 0.1]))
    further = the_group(away, **ROOT, rotation=at_rpm(9000)).omega
    assert further[0] > base.omega[0] * 1.005
    back = the_group(away, **ROOT, rotation=at_rpm(9000, point=[0.0, 0.0, 0.1]))
    np.testing.assert_allclose(back.omega, base.omega, rtol=1e-8)
    long_axis = the_group(BLADE, **ROOT, rotation=at_rpm(9000, axis=[0.0, 2.0, 0.0]))  # its length does not count
    np.testing.assert_allclose(long_axis.omega, base.omega, rtol=1e-12)


# ---------------------------------------------------------------- large displacements: the elastica


def elastica(load):
    """Tip of a clamped elastic line under a force P across it: (deflection, shortening) over L for P L^2 / E I.

    Bisshopp and Drucker, Q. Appl. Math. 3 (1945) 272: with p^2 = (1 + sin phi_0) / 2 and
    sin theta_1 = 1 / (p sqrt 2), sqrt(P L^2 / E I) = K(p) - F(theta_1, p).
    """
    from scipy.optimize import brentq

    def excess(tip):
        m = (1 + np.sin(tip)) / 2
        start = np.arcsin(1 / np.sqrt(2 * m))
        return ellipk(m) - ellipkinc(start, m) - np.sqrt(load)

    tip = brentq(excess, 1e-9, np.pi / 2 - 1e-9, xtol=1e-15)
    m = (1 + np.sin(tip)) / 2
    start = np.arcsin(1 / np.sqrt(2 * m))
    across = 1 - 2 / np.sqrt(load) * (ellipe(m) - ellipeinc(start, m))
    along = np.sqrt(2 * np.sin(tip) / load)
    return across, 1 - along


def test_elastica_numbers():
    """Mattiasson, Int. J. Num. Meth. Eng. 17 (1981) 145, table for P L^2 / E I = 1 and 10."""
    np.testing.assert_allclose(elastica(1.0), [0.30172, 0.05643], atol=1e-5)
    np.testing.assert_allclose(elastica(10.0), [0.81061, 0.55500], atol=1e-5)


@pytest.mark.parametrize("load", [1.0, 5.0])
def test_cantilever_under_a_large_dead_force_is_the_elastica(load):
    """Deflections of a third to two thirds of the length: finite rotations, small strains (h/L = 1/100)."""
    L, h = 1.0, 0.01
    mesh = brick("hexahedron20", (40, 1, 1), (L, h, h))
    P = load * E * h**4 / 12 / L**2
    group = the_group(
        mesh, material={**STEEL, "poisson": 0.0}, supports=[{"face": "x0"}], modes={"count": 2},
        loads=[{"kind": "force", "face": "x1", "vector": [0.0, P, 0.0]}],
    )  # fmt: skip
    tip = group.u_static[mesh.face_points("x1")].mean(axis=0)
    across, along = elastica(load)
    np.testing.assert_allclose([tip[1], -tip[0]], [across, along], rtol=2e-3)


# ---------------------------------------------------------------- heat and dead loads


def three_points(mesh):
    """A statically determinate support: 3-2-1 at three corners."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    a = nearest(mesh, low)
    b = nearest(mesh, (high[0], low[1], low[2]))
    c = nearest(mesh, (low[0], high[1], low[2]))
    held = with_sets(mesh, a=np.array([a]), b=np.array([b]), c=np.array([c]))
    supports = [{"face": "a"}, {"face": "b", "directions": "yz"}, {"face": "c", "directions": "z"}]
    return held, supports


TURNED = {
    "density": 500.0, "young": [120e9, 9e9, 14e9], "poisson": [0.28, 0.35, 0.31], "shear": [5e9, 3.4e9, 6e9],
    "axes": [[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.0, 1.0]], "expansion": [3e-6, 3e-5, 3e-5],
}  # fmt: skip


@pytest.mark.parametrize("prestress", ["linear", "nonlinear"])
@pytest.mark.parametrize("material", [HOT, TURNED], ids=["steel", "orthotropic"])
def test_uniform_heat_makes_no_stress_in_a_body_free_to_expand(prestress, material):
    """Statically determinate, orthotropic expansion in turned axes too; the box grows by alpha dT, every distance in
    it by its own: 1e-9, where Newton ends."""
    mesh, supports = three_points(brick("tetra10", (2, 2, 2), (0.3, 0.2, 0.1)))
    group = the_group(
        mesh, np.full(mesh.n_points, 493.15), material=material, supports=supports, output={},
        rotation={"prestress": prestress}, modes={"count": 2},
    )  # fmt: skip
    stiff = np.max(material["young"])
    for stresses in group.stresses.values():
        assert np.abs(stresses.static_stress).max() < 1e-9 * stiff * 1e-3
    if material is HOT:
        corner = nearest(mesh, (0.3, 0.2, 0.1))
        np.testing.assert_allclose(group.u_static[corner], np.array([0.3, 0.2, 0.1]) * 1.2e-5 * 200, rtol=1e-9)
    elif prestress == "nonlinear":
        axes = np.array(TURNED["axes"])
        U = np.eye(3) + 200 * axes.T @ np.diag(TURNED["expansion"]) @ axes
        apart, stretched = mesh.points - mesh.points[0], mesh.points + group.u_static
        distance = np.linalg.norm(stretched - stretched[0], axis=1)
        np.testing.assert_allclose(distance, np.linalg.norm(apart @ U, axis=1), rtol=1e-9)


def test_no_element_ends_turned_inside_out():
    """Newton's first step through so much heat lands at a mirrored body, which is in balance as well: y is -1 of y."""
    mesh = brick("tetra10", (1, 2, 4), (0.02, 0.03, 0.12))
    held = with_sets(mesh, **{n: np.flatnonzero(mesh.points[:, k] < 1e-9) for k, n in enumerate("xyz")})
    group = the_group(
        held, np.full(mesh.n_points, 593.15), material={**HOT, "expansion": [1.2e-3, 0.0, 4e-3]}, output={},
        supports=[{"face": n, "directions": n} for n in "xyz"], modes={"count": 2},
    )  # fmt: skip
    np.testing.assert_allclose(group.u_static, mesh.points * [0.36, 0.0, 1.2], rtol=0, atol=1e-9)


ALONG = {k: v for k, v in TURNED.items() if k != "axes"}


@pytest.mark.parametrize(("material", "kelvin"), [(HOT, 400.0), (HOT, 2000.0), (ALONG, 2000.0)])
def test_a_heated_body_in_rotation_is_the_same_drawn_at_its_heated_size(material, kelvin):
    """Mass stays, Hooke's law holds for the heated body: drawn by U larger with rho / det U, without heat, it has the
    same places, frequencies, Cauchy stress and stress modes at speed: 1e-8, where Newton ends."""
    mesh, supports = three_points(brick("tetra10", (2, 2, 2), (0.3, 0.2, 0.1)))
    U = 1 + kelvin * np.broadcast_to(material["expansion"], 3)
    larger = replace(mesh, points=mesh.points * U)
    cold = {**material, "density": material["density"] / U.prod()}
    what = {"supports": supports, "rotation": at_rpm(12000, axis=[0, 1, 0], point=[-0.5, 0, 0]), "output": {}}
    hot = the_group(mesh, np.full(mesh.n_points, 293.15 + kelvin), material=material, **what)
    drawn = the_group(larger, material=cold, **what)
    np.testing.assert_allclose(hot.omega, drawn.omega, rtol=1e-8)
    pulled = np.abs(drawn.u_static).max()
    np.testing.assert_allclose(mesh.points + hot.u_static, larger.points + drawn.u_static, rtol=0, atol=1e-8 * pulled)
    a, b = hot.stresses["gauss"], drawn.stresses["gauss"]
    np.testing.assert_allclose(a.static_stress, b.static_stress, rtol=0, atol=1e-7 * np.abs(b.static_stress).max())
    np.testing.assert_allclose(a.stress, b.stress, rtol=0, atol=1e-6 * np.abs(b.stress).max())


def test_a_heated_free_bar_sounds_higher_by_the_root_of_its_stretch():
    """omega^2 ~ E L A / (m L^2) grows with 1 + alpha dT as the bar grows and its mass stays: 1e-9."""
    mesh, supports = three_points(brick("hexahedron20", (4, 1, 1), (1.0, 0.1, 0.1)))
    hot, cold = (the_group(mesh, T, material=HOT, supports=supports) for T in (np.full(mesh.n_points, 793.15), None))
    np.testing.assert_allclose(hot.omega / cold.omega, np.sqrt(1 + 1.2e-5 * 500), rtol=1e-9)


def test_a_linear_temperature_bends_without_stress():
    """T = a y in a body held at three points: u is quadratic, linear strain compatible, stress zero."""
    mesh, supports = three_points(brick("hexahedron20", (3, 2, 2), (0.3, 0.1, 0.1)))
    T = 293.15 + 500 * mesh.points[:, 1]
    group = the_group(
        mesh,
        T,
        material=HOT,
        supports=supports,
        output={},
        rotation={"prestress": "linear"},
        modes={"count": 2},
    )
    assert np.abs(group.stresses["gauss"].static_stress).max() < 1e-9 * E * 1.2e-5 * 50


@pytest.mark.parametrize("dT", [60.0, -80.0])
def test_heated_between_walls_the_eigenvalues_fall_by_the_stress(dT):
    """Rollers on all faces: F = 1, so that the material is compressed by 1 / U, with U = 1 + alpha dT:
    S = -3 K (U - 1/U) / 2 in all directions, the waves see the moduli over U, and lambda changes by S |k|^2 / rho."""
    size, U = (0.5, 0.4, 0.3), 1 + 1.2e-5 * dT
    mesh = brick("hexahedron20", (4, 4, 4), size)
    stress = -(3 * LAME + 2 * SHEAR) * (U - 1 / U) / 2
    cold = the_group(mesh, **roller_box())
    hot = the_group(mesh, np.full(mesh.n_points, 293.15 + dT), material=HOT, **roller_box(), output={})
    exact = box_frequencies(RHO, LAME / U, SHEAR / U, size, 4, (stress,) * 3) / box_frequencies(
        RHO, LAME, SHEAR, size, 4
    )
    np.testing.assert_allclose(hot.omega / cold.omega, exact, rtol=3e-6)  # the mesh errs by 6e-4 of the change
    np.testing.assert_allclose(hot.stresses["gauss"].static_stress[:, :3], stress, rtol=1e-9)


def test_too_much_heat_between_walls_is_unstable():
    """-S beyond the shear modulus: the plane waves stand still."""
    mesh = brick("hexahedron20", (2, 2, 2), (0.5, 0.4, 0.3))
    dT = 1.1 * SHEAR / ((3 * LAME + 2 * SHEAR) * 1.2e-5)
    with pytest.raises(UserError, match="^temperature: .*(negative|unstable)"):
        the_group(mesh, np.full(mesh.n_points, 293.15 + dT), material=HOT, **roller_box())


def test_a_column_that_buckles_at_rest_names_its_loads():
    """Pressed end to end beyond Euler's load: no speed is at fault."""
    size, E = (0.01, 0.01, 0.4), 2.1e11
    mesh = brick("hexahedron20", (1, 1, 8), size)
    euler = np.pi**2 * E * size[0] ** 4 / 12 / (4 * size[2] ** 2)
    for prestress in ("nonlinear", "linear"):
        more = {"supports": [{"face": "z0"}], "rotation": {"prestress": prestress}}
        loads = [{"kind": "force", "face": "z1", "vector": [0.0, 0.0, -1.5 * euler]}]
        with pytest.raises(UserError, match="^loads: .*0 rpm"):
            the_group(mesh, loads=loads, **more)


def test_modulus_over_temperature_lowers_the_frequencies():
    """Uniform: omega ~ sqrt(E(T)). Along the body: the same as two materials with a ramp (scikit-fem in test_fem)."""
    table = {"temperature": [300.0, 800.0], "modulus_factor": [1.0, 0.64]}
    mesh = brick("tetra10", (2, 2, 4), to=shaken(0.02))
    cold = the_group(mesh, **ROOT)
    for T, factor in ((200.0, 1.0), (550.0, 0.82), (1000.0, 0.64)):
        warm = the_group(mesh, np.full(mesh.n_points, T), material={**STEEL, **table}, **ROOT)
        np.testing.assert_allclose(warm.omega, cold.omega * np.sqrt(factor), rtol=1e-9)
    ramp = the_group(mesh, 300 + 500 * mesh.points[:, 2].clip(0, 1), material={**STEEL, **table}, **ROOT)
    assert (ramp.omega < cold.omega).all() and (ramp.omega > 0.8 * cold.omega).all()


def test_a_bar_under_its_own_weight():
    """u = rho g (L x - x^2 / 2) / E, sigma = rho g (L - x): the quadratic element is exact."""
    mesh = brick("hexahedron20", (4, 1, 1), (2.0, 0.1, 0.1))
    group = the_group(
        mesh, material={**STEEL, "poisson": 0.0}, supports=[{"face": "x0"}], output={},
        loads=[{"kind": "gravity", "vector": [9.81, 0.0, 0.0]}], rotation={"prestress": "linear"},
    )  # fmt: skip
    x = mesh.points[:, 0]
    u = RHO * 9.81 * (2 * x - x**2 / 2) / E
    np.testing.assert_allclose(group.u_static[:, 0], u, atol=1e-9 * u.max())
    for s in group.stresses.values():
        np.testing.assert_allclose(s.static_stress[:, 0], RHO * 9.81 * (2 - s.points[:, 0]), atol=1e-7 * RHO * 9.81)


def test_pressure_all_round_squeezes_evenly():
    """-p in all directions, volume change -p / K, on bent cells."""
    mesh, supports = three_points(brick("tetra10", (2, 2, 2), (0.3, 0.2, 0.1), to=shaken(0.01), straight=True))
    loads = [{"kind": "pressure", "face": f, "value": 1e7} for f in mesh.faces]
    group = the_group(mesh, supports=supports, loads=loads, output={}, rotation={"prestress": "linear"})
    stress = group.stresses["gauss"].static_stress
    np.testing.assert_allclose(stress, np.broadcast_to([-1e7] * 3 + [0] * 3, stress.shape), atol=1.0)


def test_point_force_and_face_force_have_their_resultants():
    mesh = brick("tetra10", (2, 2, 4), (0.1, 0.1, 0.4))
    for place in ({"face": "z1"}, {"point": [0.03, 0.07, 0.4]}):
        load = {"kind": "force", "vector": [0.0, 0.0, 5e4], **place}
        group = the_group(mesh, **ROOT, loads=[load], rotation={"prestress": "linear"})
        mean = group.u_static[mesh.face_points("z1"), 2].mean()
        assert mean == pytest.approx(5e4 * 0.4 / (E * 0.01), rel=0.1)  # the clamp holds the width, the point dents


def test_temperature_and_speed_together():
    """Hot, loaded and turning: the state is in balance."""
    model = model_of(BLADE, body(material=HOT, **ROOT), temperature=300 + 800 * (BLADE.points[:, 2] - 0.12))
    model = replace(model, dead_load=np.full((BLADE.n_points, 3), 0.3))
    state = equilibrium(model, 1000.0, "nonlinear", eigen.new_solver("superlu"))
    scale = np.abs(internal_force(model.d, state.stress, state.H)).max()
    assert np.abs(unbalance(model, 1000.0, state.u)).max() < 1e-7 * scale


# ---------------------------------------------------------------- gyroscopic matrix


def test_gyroscopic_matrix_is_its_integral():
    """G_ab = 2 Omega times the integral of rho phi_a . (n x phi_b), by quadrature of the shapes."""
    axis = np.array([0.48, 0.6, 0.64])
    group = the_group(BLADE, **ROOT, rotation=at_rpm(6000, axis=axis.tolist()))
    (b,) = discretise(BLADE).blocks
    phi = np.einsum("qk,ekim->eqim", b.N, group.phi[b.cells])
    turned = np.cross(axis, phi, axisb=2, axisc=2)
    exact = 2 * group.speed * RHO * np.einsum("eq,eqia,eqib->ab", b.dx, phi, turned)
    np.testing.assert_allclose(group.G_r, exact, atol=1e-10 * np.abs(exact).max())


def test_the_slower_whirl_goes_with_the_spin():
    """In the frame that turns with +Omega about z, forward whirl (from x to y) is at omega_0 - Omega."""
    mesh = brick("hexahedron20", (1, 1, 8), (0.02, 0.02, 1.0), (-0.01, -0.01, 0))
    rest = the_group(mesh, **ROOT)
    rpm = 0.3 * rest.omega[0] * 30 / np.pi
    group = the_group(mesh, **ROOT, rotation=at_rpm(rpm, axis=[0.0, 0.0, 1.0]))
    m = group.n_modes
    values, vectors = np.linalg.eig(np.block([[np.zeros((m, m)), np.eye(m)], [-group.K_r, -group.G_r]]))
    order = np.argsort(np.where(values.imag > 0, values.imag, np.inf))
    tip = nearest(mesh, (0, 0, 1.0))
    slow, fast = (group.phi[tip] @ vectors[:m, order[i]] for i in (0, 1))
    assert slow[1] / slow[0] == pytest.approx(-1j, abs=1e-6)  # cos in x, sin in y
    assert fast[1] / fast[0] == pytest.approx(1j, abs=1e-6)


def test_no_gyroscopic_coupling_of_motions_in_one_plane():
    """With the rotor axis across the beam's only moving direction G vanishes."""
    mesh = brick("hexahedron20", (1, 1, 6), (0.02, 0.05, 0.5))
    held = [{"face": "z0"}, {"face": "y0", "directions": "yz"}, {"face": "y1", "directions": "yz"}]
    group = the_group(mesh, supports=held, rotation=at_rpm(3000), modes={"count": 2})
    across = the_group(mesh, supports=held, rotation=at_rpm(3000, axis=[1.0, 0.0, 0.0]), modes={"count": 2})
    scale = 2 * group.speed
    assert np.abs(across.G_r).max() < 1e-2 * scale  # modes move along x, the axis
    assert np.abs(np.diag(group.G_r)).max() == 0
