"""Solids against closed forms: bars, beams, rotating bars and blades, spinning shafts; the forms against each other.

Wright, Smith, Thresher, Wang, J. Appl. Mech. 49 (1982) 197: centrifugally stiffened beams. Southwell and Gough, ARC
R&M 766 (1921). Kaneko, J. Phys. D 8 (1975) 1927: shear coefficients. Love, Treatise (1927) 278: rods.
"""

from __future__ import annotations

import numpy as np
import pytest
from closed_forms import bars, beams, shafts
from meshes import STEEL, body, brick, nearest, with_sets

from microslip.contact.identification import rectangle
from microslip.errors import UserError
from microslip.modal.compute import modal_basis

E, NU, RHO = STEEL["young"], STEEL["poisson"], STEEL["density"]
LAME, SHEAR = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
NO_POISSON = {**STEEL, "poisson": 0.0}


def the_modes(mesh, **what):
    return modal_basis(mesh, body(**{"modes": {"count": 6}, **what})).groups[0, 0]


def bending(group, direction):
    """Frequencies (rad/s) of the modes that move mostly along one body direction."""
    share = (group.phi**2).sum(axis=0)
    return group.omega[(share[direction] > 0.75 * share.sum(axis=0)) & (group.omega > 0)]


# ---------------------------------------------------------------- the closed forms against each other and the print


def test_euler_bernoulli_numbers():
    """(beta L)^2 of the textbooks."""
    np.testing.assert_allclose(beams.euler_bernoulli(3), [3.51601527, 22.0344916, 61.6972144], rtol=1e-8)
    np.testing.assert_allclose(beams.euler_bernoulli(2, "free-free"), [22.3732854, 61.6728229], rtol=1e-8)
    np.testing.assert_allclose(beams.euler_bernoulli(3, "pinned-pinned"), np.pi**2 * np.arange(1, 4) ** 2, rtol=1e-12)


@pytest.mark.parametrize("ends", ["clamped-free", "free-free"])
def test_slender_timoshenko_beams_are_euler_bernoulli_beams(ends):
    """The difference falls as (h/L)^2."""
    exact = beams.euler_bernoulli(3, ends)
    gaps = []
    for height in (0.04, 0.02):
        s = rectangle(1.0, height, height, E, NU, RHO)
        gaps.append(1 - beams.timoshenko(s, 3, ends) / s.unit / exact)
    assert (gaps[1] > 0).all() and (gaps[1] < 0.02).all()
    np.testing.assert_allclose(np.log2(gaps[0] / gaps[1]), 2, atol=0.1)


WRIGHT = {  # Table of the 1982 paper: clamped at the axis, flap; Omega -> first two frequencies (dimensionless)
    0: (3.5160, 22.0345), 1: (3.6816, 22.1810), 2: (4.1373, 22.6149), 3: (4.7973, 23.3203), 4: (5.5850, 24.2733),
    6: (7.3604, 26.8091), 8: (9.2568, 29.9954), 10: (11.2023, 33.6404), 12: (13.1702, 37.6031),
}  # fmt: skip


@pytest.mark.parametrize("speed", WRIGHT)
def test_rotating_beam_series_agree_and_meet_the_print(speed):
    found = beams.rotating_beam(speed, 2)
    np.testing.assert_allclose(found, WRIGHT[speed], atol=6e-5)  # four printed decimals
    np.testing.assert_allclose(beams.rotating_beam_wright(speed, 2), found, rtol=1e-8)


def test_rotating_beam_with_a_hub():
    for hub in (-1.5, 0.5, 2.0):
        np.testing.assert_allclose(beams.rotating_beam_wright(2, 3, hub), beams.rotating_beam(2, 3, hub), rtol=1e-7)


@pytest.mark.parametrize("mode", [1, 2])
def test_southwell_is_the_slope_over_the_square_of_speed(mode):
    """And, for the first mode, an upper bound (Rayleigh)."""
    for hub in (0.0, 1.0):
        B, small = beams.southwell(mode, hub), 0.1
        rest, turning = (beams.rotating_beam(s, mode, hub)[-1] ** 2 for s in (0.0, small))
        assert (turning - rest) / small**2 == pytest.approx(B, rel=1e-3)
        assert beams.rotating_beam(8, 1, hub)[0] ** 2 < beams.rotating_beam(0, 1)[0] ** 2 + beams.southwell(1, hub) * 64
    assert beams.southwell(1) == pytest.approx(1.193, abs=5e-4)  # the textbooks' 1.19


def test_spinning_mass_and_shaft_agree_at_their_limits():
    np.testing.assert_allclose(shafts.spinning_mass(100.0, 100.0, 30.0), [70, 130], rtol=1e-12)
    # slow spin of unequal springs changes nothing in first order
    np.testing.assert_allclose(shafts.spinning_mass(100.0, 150.0, 1e-4), [100, 150], rtol=1e-9)
    s = rectangle(1.0, 0.01, 0.01, E, NU, RHO)
    back, forth = shafts.spinning_shaft(s, 2, 0.0)
    assert -back == pytest.approx(forth, rel=1e-9)
    assert forth == pytest.approx(beams.euler_bernoulli(2, "pinned-pinned")[1] * s.unit, rel=2e-3)
    # Rayleigh's rotor: the splitting is 2 Omega k^2 I / A to first order
    s = rectangle(1.0, 0.02, 0.02, E, NU, RHO)
    back, forth = shafts.spinning_shaft(s, 1, 50.0)
    assert forth + back == pytest.approx(2 * 50 * np.pi**2 * s.inertia / s.area, rel=5e-3)


def test_rods():
    np.testing.assert_allclose(bars.rod_frequencies(4.0, 1.0, 2.0, 2), [np.pi / 2, 3 * np.pi / 2])
    np.testing.assert_allclose(bars.rod_frequencies(4.0, 1.0, 2.0, 2, "free-free"), [np.pi, 2 * np.pi])
    box = bars.box_frequencies(RHO, LAME, SHEAR, (10.0, 0.1, 0.1), 3)  # a long box: P waves along it first
    np.testing.assert_allclose(box, bars.rod_frequencies(LAME + 2 * SHEAR, RHO, 10.0, 3, "free-free"), rtol=1e-12)
    with pytest.raises(ValueError, match="ends"):
        bars.rod_frequencies(1.0, 1.0, 1.0, 1, "pinned")
    with pytest.raises(ValueError, match="ends"):
        beams.timoshenko(rectangle(1, 1, 1, 1, 0, 1), 1, "pinned")


# ---------------------------------------------------------------- bars and beams as solids

SIDES = [{"face": f"{c}{e}", "directions": c} for c in "yz" for e in (0, 1)]


@pytest.mark.parametrize("cell_type", ["tetra10", "hexahedron20"])
@pytest.mark.parametrize("ends", ["clamped-free", "free-free"])
def test_bar_with_smooth_walls(cell_type, ends):
    """Between smooth walls a bar is one-dimensional: modulus lambda + 2 mu, exactly. Free: one rigid motion."""
    mesh = brick(cell_type, (8, 1, 1), (1.0, 0.05, 0.05))
    held = [{"face": "x0", "directions": "x"}] if ends == "clamped-free" else []
    group = the_modes(mesh, supports=SIDES + held, free=not held, modes={"count": 4})
    exact = bars.rod_frequencies(LAME + 2 * SHEAR, RHO, 1.0, 3, ends)
    elastic = group.omega[group.omega > 0]
    assert (group.kind[0] == "rigid") == (ends == "free-free")
    # a quadratic rod element errs by (k h)^4 / 1440 in frequency; Kuhn's tetrahedra somewhat more
    bound = (np.pi * np.arange(1, 4) / 8) ** 4 / 500
    assert (np.abs(elastic[:3] / exact - 1) < bound).all()


def test_free_bar_with_lateral_inertia():
    """A free steel bar: the rod, lowered by Love's lateral inertia nu^2 k^2 I_p / (2 A)."""
    length, h = 1.0, 0.06
    group = the_modes(brick("hexahedron20", (20, 1, 1), (length, h, h)), free=True, modes={"count": 26})
    share = (group.phi**2).sum(axis=0)
    axial = group.omega[(share[0] > 0.9 * share.sum(axis=0)) & (group.omega > 0)][:2]
    rod = bars.rod_frequencies(E, RHO, length, 2, "free-free")
    k = np.pi * np.arange(1, 3) / length
    love = rod / np.sqrt(1 + NU**2 * k**2 * h**2 / 6)
    np.testing.assert_allclose(axial, love, rtol=3e-5)  # next term of order nu^4 (k h)^4 / 36 and mesh
    assert (axial < rod * (1 - 1e-4)).all()


@pytest.mark.parametrize("cell_type", ["tetra10", "hexahedron20", "hexahedron27"])
def test_free_beam(cell_type):
    """Free steel beam, h/L = 1/10, three bending modes in each plane against Timoshenko with Kaneko's coefficient."""
    length, b, h = 0.5, 0.04, 0.05
    n = (12, 2, 2) if cell_type == "tetra10" else (20, 3, 3)
    group = the_modes(brick(cell_type, n, (length, b, h)), free=True, modes={"count": 16})
    for direction, height, width in ((2, h, b), (1, b, h)):
        exact = beams.timoshenko(rectangle(length, width, height, E, NU, RHO), 3, "free-free")
        # the beam theory itself errs with (k h)^4, 0.1 % in mode 3; coarse tetrahedra are up to 1 % stiffer
        allowed = [1.5e-3, 5e-3, 1e-2] if cell_type == "tetra10" else [3e-4, 8e-4, 1.6e-3]
        assert (np.abs(bending(group, direction)[:3] / exact - 1) < allowed).all()


def test_clamped_beam():
    """Clamped beam without Poisson's ratio (its clamp is the beam theory's), h/L = 1/20."""
    length, b, h = 1.0, 0.04, 0.05
    group = the_modes(brick("hexahedron20", (40, 2, 2), (length, b, h)), material=NO_POISSON, supports=[{"face": "x0"}])
    for direction, height, width in ((2, h, b), (1, b, h)):
        exact = beams.timoshenko(rectangle(length, width, height, E, 0.0, RHO), 2)
        np.testing.assert_allclose(bending(group, direction)[:2], exact, rtol=3e-4)


def test_clamped_steel_beam_is_a_little_stiffer():
    """With Poisson's ratio the clamp also holds the section's width: up to 1 % at h/L = 1/20, never softer."""
    length, h = 1.0, 0.05
    group = the_modes(brick("hexahedron20", (20, 2, 2), (length, h, h)), supports=[{"face": "x0"}])
    exact = beams.timoshenko(rectangle(length, h, h, E, NU, RHO), 2)
    # a square section: its pairs lie at the same frequency in any plane
    pairs = group.omega[[0, 1, 2, 3]].reshape(2, 2)
    np.testing.assert_allclose(pairs[:, 0], pairs[:, 1], rtol=1e-8)
    ratio = pairs[:, 0] / exact
    assert (ratio > 1.0).all() and (ratio < 1.01).all()


# ---------------------------------------------------------------- rotation

BLADE = {"length": 1.0, "height": 0.01}


def rotating_blade(speeds, hub=0.0, **rotation):
    """Slender square bar along z from radius hub; flap is along y (the rotor axis), lag along x. Speeds in rad/s."""
    L, h = BLADE["length"], BLADE["height"]
    mesh = brick("hexahedron20", (1, 1, 40), (h, h, L), (-h / 2, -h / 2, hub * L))
    return modal_basis(
        mesh,
        body(
            material=NO_POISSON, supports=[{"face": "z0"}], modes={"count": 6},
            rotation={"speeds_rpm": [float(s) * 30 / np.pi for s in speeds], **rotation},
        ),
    )  # fmt: skip


SECTION = rectangle(1.0, 0.01, 0.01, E, 0.0, RHO)
ETA = (0.0, 2.0, 6.0, 12.0)


@pytest.mark.parametrize(("hub", "prestress"), [(0.0, "nonlinear"), (0.0, "linear"), (0.5, "nonlinear")])
def test_rotating_beam_frequencies(hub, prestress):
    """Flap and lag over speed (Southwell, Wright): two modes each; lag^2 = flap^2 - Omega^2."""
    basis = rotating_blade([e * SECTION.unit for e in ETA], hub, prestress=prestress)
    for i, eta in enumerate(ETA):
        flap = beams.rotating_beam(eta, 2, hub) * SECTION.unit
        lag = beams.rotating_beam(eta, 2, hub, "lag") * SECTION.unit
        group = basis.groups[i, 0]
        if eta == 0:
            np.testing.assert_allclose(group.omega[:4], np.repeat(flap, 2), rtol=1e-4)
            continue
        # mesh and shear 1e-4; the spin lengthens the blade by eta^2 (1 + 2 hub) (h/L)^2 / 24, 6e-4 at the most
        allowed = 1e-4 + eta**2 * (1 + 2 * hub) * 4e-6
        np.testing.assert_allclose(bending(group, 1)[:2], flap, rtol=allowed)
        np.testing.assert_allclose(bending(group, 0)[:2], lag, rtol=allowed)
        assert (np.diff(group.omega) >= 0).all()


def test_southwells_law_holds_for_the_solid():
    """omega^2 = omega_0^2 + B Omega^2 at small speed, to the accuracy of the slope."""
    speed = 0.3 * SECTION.unit
    basis = rotating_blade([0.0, speed])
    rest, turning = basis.groups[0, 0], basis.groups[1, 0]
    for mode, at in ((1, 0), (2, 2)):
        slope = (bending(turning, 1)[mode - 1] ** 2 - rest.omega[at] ** 2) / speed**2
        assert slope == pytest.approx(beams.southwell(mode), rel=5e-3)


def test_softening_alone_lets_frequencies_fall():
    """K - Omega^2 M P as the book prints it (prestress none): lag^2 = omega_0^2 - Omega^2, flap nearly stays."""
    speed = 2.0 * SECTION.unit
    basis = rotating_blade([0.0, speed], prestress="none")
    rest, turning = basis.groups[0, 0], basis.groups[1, 0]
    lag, flap = bending(turning, 0), bending(turning, 1)
    assert lag[0] ** 2 == pytest.approx(rest.omega[0] ** 2 - speed**2, rel=1e-4)
    # flap turns the section, which moves along z: a share of (k h)^2 / 12 of Omega^2
    assert 0 < rest.omega[0] ** 2 - flap[0] ** 2 < 1e-3 * speed**2
    assert turning.prestress == "none" and np.all(turning.u_static == 0)


def test_without_softening_flap_is_the_same_and_lag_is_flap():
    speed = 6.0 * SECTION.unit
    basis = rotating_blade([speed], spin_softening=False)
    group = basis.groups[0, 0]
    flap = beams.rotating_beam(6.0, 2) * SECTION.unit
    np.testing.assert_allclose(group.omega[:4], np.repeat(flap, 2), rtol=3e-4)


@pytest.mark.parametrize("prestress", ["linear", "nonlinear"])
def test_rotating_bar_stress(prestress):
    """sigma = rho Omega^2 (R^2 - r^2) / 2 at the integration points, and the displacement that goes with it.

    Slow enough (strain 1e-5) for the linear theory; the error falls with the second order of the elements.
    """
    root, tip, speed = 0.2, 0.8, 30.0
    errors = []
    for n in (4, 8):
        mesh = brick("hexahedron20", (1, 1, n), (0.01, 0.01, tip - root), (-0.005, -0.005, root))
        group = the_modes(
            mesh, material=NO_POISSON, supports=[{"face": "z0"}], modes={"count": 1}, output={"nodal_stress": False},
            rotation={"speeds_rpm": [speed * 30 / np.pi], "prestress": prestress},
        )  # fmt: skip
        s = group.stresses["gauss"]
        exact = bars.rotating_bar_stress(RHO, speed, s.points[:, 2], tip)
        errors.append(np.abs(s.static_stress[:, 2] - exact).max() / exact.max())
        u = bars.rotating_bar_displacement(E, RHO, speed, mesh.points[:, 2], root, tip)
        np.testing.assert_allclose(group.u_static[:, 2], u, atol=1e-4 * u.max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.2)
    assert errors[1] < 3e-3


def test_speed_beyond_divergence_is_refused():
    """Softening alone: the lag mode diverges at Omega = omega_0, and far beyond several modes have."""
    first = beams.rotating_beam(0, 1)[0] * SECTION.unit
    rotating_blade([0.97 * first], prestress="none")
    for factor, count in ((1.03, "1 eigenvalue is"), (8.0, "2 eigenvalues are")):
        with pytest.raises(UserError, match=count):
            rotating_blade([factor * first], prestress="none")


def test_a_blade_that_points_inwards_buckles_where_the_beam_does():
    """Root outside, tip towards the axis: the beam series says where its lag frequency reaches zero."""
    from scipy.optimize import brentq

    hub = -1.5
    critical = brentq(lambda s: beams.rotating_beam_eigenvalues(s, 1, hub, "lag")[0], 0.1, 9.0) * SECTION.unit
    ok = rotating_blade([0.9 * critical], hub).groups[0, 0]
    expected = beams.rotating_beam(0.9 * critical / SECTION.unit, 1, hub, "lag")[0] * SECTION.unit
    assert bending(ok, 0)[0] == pytest.approx(expected, rel=1e-3)
    for speed in (1.02 * critical, 2 * critical):
        with pytest.raises(UserError, match="rotation.speeds_rpm"):
            rotating_blade([speed], hub)


# ---------------------------------------------------------------- gyroscopic terms


def whirl(group):
    """Frequencies, rad/s, of M q'' + G q' + K q = 0 in the turning frame, ascending."""
    m = group.n_modes
    A = np.block([[np.zeros((m, m)), np.eye(m)], [-group.K_r, -group.G_r]])
    values = np.linalg.eigvals(A)
    assert np.abs(values.real).max() < 1e-9 * np.abs(values).max()  # conservative
    return np.sort(values.imag[values.imag > 0])


def test_gyroscopic_splitting_of_a_slender_spinning_bar():
    """A bar that spins about its own axis is, in its frame, a mass on two springs: omega_0 -+ Omega."""
    L, h = 1.0, 0.01
    mesh = brick("hexahedron20", (1, 1, 16), (h, h, L), (-h / 2, -h / 2, 0))
    speed = 1.2 * SECTION.unit
    basis = modal_basis(
        mesh,
        body(
            supports=[{"face": "z0"}], modes={"count": 8},
            rotation={"axis": [0.0, 0.0, 1.0], "speeds_rpm": [0.0, speed * 30 / np.pi]},
        ),
    )  # fmt: skip
    rest, turning = basis.groups[0, 0], basis.groups[1, 0]
    np.testing.assert_allclose(turning.G_r, -turning.G_r.T, atol=0)
    assert abs(turning.G_r[0, 1]) == pytest.approx(2 * speed, rel=1e-3)  # 2 Omega: both move the same mass
    exact = shafts.spinning_mass(rest.omega[0], rest.omega[1], speed)
    np.testing.assert_allclose(whirl(turning)[:2], exact, rtol=1e-3)  # rotary inertia (k h)^2 / 12
    assert np.all(rest.G_r == 0)


def test_gyroscopic_splitting_of_a_stocky_shaft():
    """Simply supported Timoshenko shaft, h/L = 1/8: forward and backward whirl in the inertial frame.

    In first order all of the splitting is rotary inertia, 2 Omega k^2 I/A, and it only comes out if geometric
    stiffness, softening and gyroscopic matrix are all right: each of them alone is of that size.
    """
    L, h = 0.8, 0.1
    mesh = brick("hexahedron20", (2, 2, 12), (h, h, L), (-h / 2, -h / 2, 0))
    mesh = with_sets(mesh, middle=np.array([nearest(mesh, (0, 0, L / 2))]))
    section = rectangle(L, h, h, E, NU, RHO)
    speed = 0.25 * shafts.spinning_shaft(section, 1, 0.0)[1]
    supports = [{"face": "z0", "directions": "xy"}, {"face": "z1", "directions": "xy"}]
    group = the_modes(
        mesh, supports=[*supports, {"face": "middle", "directions": "z"}], modes={"count": 30},
        rotation={"axis": [0.0, 0.0, 1.0], "speeds_rpm": [speed * 30 / np.pi]},
    )  # fmt: skip
    found = whirl(group)[:2]
    back, forth = shafts.spinning_shaft(section, 1, speed)
    # the turning frame sees omega - Omega: forward whirl slower, backward faster
    forward, backward = found[0] + speed, found[1] - speed
    still = shafts.spinning_shaft(section, 1, 0.0)[1]
    np.testing.assert_allclose([forward, backward], [forth, -back], rtol=6e-4)  # mesh
    assert (forward - backward) / still == pytest.approx((forth + back) / still, rel=5e-3)
