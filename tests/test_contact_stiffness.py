"""Contact stiffness from every source: the layer, Hertz and Mindlin, any round profile, finite elements, resonances."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import scipy.linalg
from closed_forms import indentation
from closed_forms.bars import rod_frequencies
from closed_forms.beams import euler_bernoulli
from closed_forms.joined_beams import hinge_spring, shear_spring
from meshes import STEEL, body, brick
from refusals import refused
from scipy.special import ellipe, ellipk, gamma

from microslip.contact import identification
from microslip.contact.hertz import Hertz, axis_ratio, ellipse_integrals, half_curvatures
from microslip.contact.identification import MeasuredResonance, identify, joined, rectangle, two_beams
from microslip.contact.layer import BOUNDARIES, Layer, modal_stiffness, quasi_static_error
from microslip.contact.partial_slip import PartialSlip
from microslip.contact.profiles import Profile, RoundContact
from microslip.contact.series import BULK, ContactStiffness, for_basis, in_series, of_layer, of_patch, of_point_contact
from microslip.contact.solids import Solid, mismatch, normal_modulus, tangential_modulus
from microslip.errors import UserError
from microslip.modal.compute import modal_basis
from microslip.reduced.compliance import BULK_AND_SURFACE, SURFACE, contact_share
from microslip.system import Body, Contact, Link, Spring, System

IRON, BRASS = Solid(2.1e11, 0.3), Solid(1.0e11, 0.35)
RIGID = Solid(np.inf, 0.3)


# the layer ---------------------------------------------------------------------------------------------------------


def hooke(solid: Solid) -> np.ndarray:
    """(3, 3) normal strains to normal stresses."""
    return np.linalg.inv((np.eye(3) * (1 + solid.poisson) - solid.poisson) / solid.young)


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_modulus_of_the_layer_is_hookes_law_with_its_sides_so_held(boundary):
    layer = Layer(IRON, 0.01, boundary)
    strain = np.linalg.solve(hooke(IRON), [-1.0, -layer.lateral_share, -layer.lateral_share])
    assert -1 / strain[0] == pytest.approx(layer.modulus, rel=1e-14)
    if boundary == "no-lateral-strain":
        assert np.abs(strain[1:]).max() < 1e-15 * abs(strain[0])
    assert layer.normal_stiffness([1e-4, 2e-4]) == pytest.approx(layer.modulus * np.array([1e-4, 2e-4]) / 0.01)
    assert layer.tangential_stiffness(1e-4) == pytest.approx(IRON.shear * 1e-2)


def test_the_three_boundaries_meet_without_lateral_contraction():
    moduli = [Layer(Solid(1e9, 0.0), 0.01, b).modulus for b in BOUNDARIES]
    assert moduli == pytest.approx([1e9] * 3, rel=1e-15)


@pytest.mark.parametrize(("boundary", "held"), [("stress-free", False), ("no-lateral-strain", True)])
def test_layer_against_finite_elements(boundary, held):
    """A block pressed uniformly is a state that quadratic cells hold exactly: 1e-8 is the factorisation's rounding."""
    size, sides = (0.05, 0.02, 0.03), ["y0", "z0", *(["y1", "z1"] if held else [])]
    supports = [{"face": s, "directions": s[0]} for s in sides] + [{"face": "x0", "directions": "x"}]
    face = [{"name": "end", "face": "x1", "t2": [0.0, 0.0, 1.0], "role": "ground"}]
    settings = body(supports=supports, interfaces=face, modes={"count": 2})
    g = modal_basis(brick("hexahedron20", (2, 2, 2), size), settings).groups[0, 0]
    found = 1 / contact_share(g, "eigenmodes", "u_n", "end").static
    solid = Solid(STEEL["young"], STEEL["poisson"])
    assert found == pytest.approx(float(Layer(solid, 0.05, boundary).normal_stiffness(6e-4)), rel=1e-8)


def test_lengthening_error_is_that_of_the_force_with_the_undeformed_length():
    layer, u = Layer(IRON, 0.01), np.array([0.0, 2e-4, 4e-4])
    exact = IRON.young / (0.01 - u) * u
    linear = IRON.young / 0.01 * u
    assert layer.lengthening_error(u[1:]) == pytest.approx((linear / np.where(u, exact, 1.0) - 1)[1:], rel=1e-10)
    assert layer.lengthening_error(4e-4) == pytest.approx(-0.04)


# yield -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_largest_shear_stress_against_the_principal_stresses_of_the_tensor(boundary):
    rng = np.random.default_rng(3)
    layer = Layer(IRON, 0.01, boundary)
    p, tau = 10 ** rng.uniform(6, 9, 60), rng.normal(size=(60, 2)) * 10 ** rng.uniform(6, 9, (60, 1))
    S = np.zeros((60, 3, 3))
    S[:, 0, 0] = -p
    S[:, 1, 1] = S[:, 2, 2] = -layer.lateral_share * p
    S[:, 0, 1:] = S[:, 1:, 0] = -tau
    principal = np.linalg.eigvalsh(S)
    assert layer.shear_stress(p, tau) == pytest.approx(0.5 * (principal[:, 2] - principal[:, 0]), rel=1e-12)


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_a_layer_loaded_to_its_strength_is_at_its_limit(boundary):
    layer, tau_s = Layer(IRON, 0.01, boundary), 2e8
    p = np.linspace(0, 0.999 * min(2 * tau_s / max(abs(1 - layer.lateral_share), 1e-9), 1e9), 12)
    tau = layer.shear_strength(p, tau_s)
    assert layer.shear_stress(p, tau) == pytest.approx(np.full(12, tau_s), rel=1e-12)
    mu = layer.largest_friction(p, tau_s)
    assert mu[0] == np.inf and mu[1:] * p[1:] == pytest.approx(tau[1:], rel=1e-14)
    assert (np.diff(mu) < 0).all()


def test_beyond_the_limiting_pressure_no_shear_is_carried():
    layer = Layer(IRON, 0.01)
    assert layer.shear_strength([4e8, 5e8], 2e8) == pytest.approx([0.0, 0.0])
    assert Layer(IRON, 0.01, "hydrostatic").shear_strength(1e12, 2e8) == 2e8


def test_yield_check_names_the_overloaded_points_the_worst_first():
    layer = Layer(IRON, 0.01)
    points = np.array([[0, 0, 0], [0, 1e-3, 0], [0, 2e-3, 0.5e-3], [0, 3e-3, 0]])
    check = layer.check_yield([1e8, 5e8, 0.0, 4e8], [[0, 0], [0, 0], [3e8, 4e8], [0, 0]], 2e8, points)
    assert check.utilisation == pytest.approx([0.25, 1.25, 2.5, 1.0])
    assert list(check.overloaded) == [2, 1, 3] and not check.elastic
    assert check.sentence() == (
        "The contact yields at 3 of 4 points: (0, 2, 0.5) mm (250 %), (0, 1, 0) mm (125 %), (0, 3, 0) mm (100 %) of "
        "the yield limit by Tresca."
    )
    assert "(250 %) and 2 more of" in check.sentence(1)
    hot = layer.check_yield([1e8, 1e8], 0.0, [2e8, 0.4e8], names=["cold", "hot"])  # tau_S falls with temperature
    assert list(hot.overloaded) == [1] and "hot (125 %)" in hot.sentence()
    calm = layer.check_yield([1e8, 2e8], 0.0, 2e8)
    assert calm.elastic and "at most 50 % of the yield limit, at point 2" in calm.sentence()


# frequencies of the layer ------------------------------------------------------------------------------------------


def test_eigenfrequencies_of_the_layer_are_those_of_a_rod():
    layer = Layer(IRON, 0.05, "no-lateral-strain", 7850)
    for direction, modulus in (("normal", layer.modulus), ("tangential", IRON.shear)):
        assert layer.eigenfrequencies(direction, 4) == pytest.approx(rod_frequencies(modulus, 7850, 0.05, 4), rel=1e-14)
        stiffness = float(getattr(layer, f"{direction}_stiffness")(3e-4))
        reduced = np.sqrt(stiffness / float(layer.reduced_mass(3e-4)))  # (3.2-26), (3.2-29)
        assert layer.eigenfrequencies(direction)[0] == pytest.approx(reduced, rel=1e-14)


def test_modal_stiffness_converges_with_the_first_power():
    """The error tends to (2/pi^2)/m: 0.25/m of the series is left out of pi^2/8."""
    m = np.array([5, 10, 20, 40, 80, 160])
    error = np.array([modal_stiffness(n) - 1 for n in m])
    assert np.polyfit(np.log(m[2:]), np.log(error[2:]), 1)[0] == pytest.approx(-1, abs=0.01)
    assert error[-1] * 160 == pytest.approx(2 / np.pi**2, rel=2e-3)


def test_quasi_static_error_is_the_modal_series_with_all_its_modes():
    """k_0/k = sum of (8/pi^2)/((2j - 1)^2 - r^2); the tail after m terms is (2/pi^2)/m, 1.01e-6 for 2e5."""
    r = np.array([0.0, 1e-6, 0.1, 0.7, 0.999])
    odd = (2 * np.arange(200_000)[:, None] + 1.0) ** 2
    series = 8 / np.pi**2 * np.sum(1 / (odd - r**2), axis=0) + 2 / np.pi**2 / 200_000
    assert [1 + quasi_static_error(x) for x in r] == pytest.approx(series, rel=1e-11)


def test_quasi_static_error_grows_with_the_square_of_the_frequency():
    r = np.array([0.005, 0.01, 0.02, 0.04])
    error = np.array([quasi_static_error(x) for x in r])
    assert np.polyfit(np.log(r), np.log(error), 1)[0] == pytest.approx(2, abs=2e-3)
    assert error[0] / r[0] ** 2 == pytest.approx(np.pi**2 / 12, rel=1e-4)
    assert quasi_static_error(1.0) == np.inf and quasi_static_error(0.0) == 0


@pytest.mark.parametrize("tolerance", [1e-4, 0.01, 0.5])
def test_the_allowed_frequency_meets_the_tolerance_exactly(tolerance):
    layer = Layer(IRON, 0.09, density=7850)
    m = layer.quasi_static(100.0, tolerance)
    assert m.direction == "tangential" and m.first_tangential < m.first_normal
    at = layer.quasi_static(m.allowed * (1 - 1e-9), tolerance)
    assert at.ok and at.error == pytest.approx(tolerance, rel=1e-6) and at.margin == pytest.approx(1, rel=1e-6)
    beyond = layer.quasi_static(m.allowed * (1 + 1e-6), tolerance)
    assert not beyond.ok and "must not be used" in beyond.sentence()
    assert "meaningless" in layer.quasi_static(1e5, tolerance).sentence()


# Hertz -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("g", [1.0, 1 - 1e-9, 0.9, 0.3, 0.01])
def test_elliptic_integrals_in_the_definition(g):
    """The definitions divide by e^2, so their own rounding grows like 1/e^2; K - E stays."""
    m = 1 - g * g
    K, D, B = ellipse_integrals(g)
    assert pytest.approx(ellipk(m), rel=1e-12) == K
    assert m * D == pytest.approx(ellipk(m) - ellipe(m), abs=1e-12)
    assert B + D == pytest.approx(K, rel=1e-14)
    if g == 1:
        assert (D, B) == pytest.approx((np.pi / 4, np.pi / 4), rel=1e-15)


def test_axis_ratio_meets_its_equation_and_both_limits():
    assert axis_ratio(1.0) == 1
    for q in (1 - 1e-12, 0.5, 1e-2, 1e-5):
        g = axis_ratio(q)
        _, D, B = ellipse_integrals(g)
        assert g**2 * D / B == pytest.approx(q, rel=1e-12)
    near = np.array([1e-2, 1e-3, 1e-4])  # g = 1 - (2/3)(1 - A/B) + ..., Greenwood's (A/B)^(2/3)
    off = np.array([axis_ratio(1 - d) - (1 - d) ** (2 / 3) for d in near])
    assert np.polyfit(np.log(near), np.log(np.abs(off)), 1)[0] > 1.9


def test_sphere_is_the_round_limit():
    h, F = Hertz.sphere(IRON, BRASS, 0.02), np.array([0.0, 1.0, 500.0])
    d = h.approach(F)
    assert h.force(d) == pytest.approx(F, rel=1e-13)
    assert h.force(1e-5) == pytest.approx(indentation.sphere_force(h.modulus, 0.02, 1e-5), rel=1e-13)
    assert h.semi_axes(F)[0] ** 2 == pytest.approx(0.02 * d, rel=1e-13)
    assert h.force(-1e-5) == 0 and h.largest_pressure(0.0) == 0 and h.pressure(0.0, 0.0, 0.0) == 0
    near = Hertz(IRON, BRASS, 25.0, 25.0 * (1 + 1e-11))
    assert near.force(1e-5) == pytest.approx(h.force(1e-5), rel=1e-10)  # no cancellation near the circle


def along_rays(a: float, b: float, x0: float, y0: float, power: float, rays: int = 720, nodes: int = 60):
    """Angles (t, 1), distances and weights (t, k) of (1 - x^2/a^2 - y^2/b^2)^power dA / r over the ellipse."""
    t = (np.arange(rays) + 0.5)[:, None] * 2 * np.pi / rays
    c, s = np.cos(t), np.sin(t)
    p, q, r = c**2 / a**2 + s**2 / b**2, x0 * c / a**2 + y0 * s / b**2, 1 - x0**2 / a**2 - y0**2 / b**2
    reach = (-q + np.sqrt(q * q + p * r)) / p
    other = (q + np.sqrt(q * q + p * r)) / p
    z, w = np.polynomial.legendre.leggauss(nodes)
    z, w = 0.5 * (1 + z), 0.5 * w
    d = reach * (1 - z**2)  # takes the root at the rim out of the integral
    value = (p * reach * z**2 * (d + other)) ** power
    return t, d, value * 2 * reach * z * w * 2 * np.pi / rays


@pytest.mark.parametrize(("A", "B"), [(10.0, 10.0), (10.0, 40.0), (300.0, 10.0)])
def test_hertz_pressure_bends_the_half_space_to_the_gap(A, B):
    """Boussinesq's integral of p over the ellipse is approach - A x^2 - B y^2 at any point inside: the whole theory."""
    h, F = Hertz(IRON, BRASS, A, B), 200.0
    a, b = h.semi_axes(F)
    for x, y in ((0, 0), (0.5 * a, 0), (0, 0.7 * b), (-0.4 * a, 0.6 * b)):
        _, _, w = along_rays(a, b, x, y, 0.5)
        moved = h.largest_pressure(F) * w.sum() / (np.pi * h.modulus)
        assert moved == pytest.approx(h.approach(F) - A * x**2 - B * y**2, rel=1e-9)


@pytest.mark.parametrize(("A", "B"), [(10.0, 10.0), (10.0, 40.0), (300.0, 10.0)])
@pytest.mark.parametrize("axis", [0, 1])
def test_sticking_traction_moves_the_ellipse_as_a_whole(A, B, axis):
    """Cerruti's integral of Q/(2 pi a b) (1 - x^2/a^2 - y^2/b^2)^(-1/2), both bodies: Q/k everywhere."""
    h, F = Hertz(IRON, BRASS, A, B), 200.0
    a, b = h.semi_axes(F)
    for x, y in ((0, 0), (0.5 * a, 0.3 * b)):
        t, _, w = along_rays(a, b, x, y, -0.5)
        turn = np.cos(t) ** 2 if axis == 0 else np.sin(t) ** 2
        moved = sum(np.sum(w * (1 - s.poisson + s.poisson * turn)) / (2 * np.pi * s.shear) for s in (IRON, BRASS))
        assert moved / (2 * np.pi * a * b) == pytest.approx(1 / h.tangential_stiffness(F)[axis], rel=1e-9)


def test_ellipse_does_not_care_how_its_axes_are_called():
    one, two = Hertz(IRON, BRASS, 10.0, 90.0), Hertz(IRON, BRASS, 90.0, 10.0)
    assert one.force(1e-5) == two.force(1e-5)
    assert one.semi_axes(50.0) == pytest.approx(two.semi_axes(50.0)[::-1])
    assert one.tangential_ratio == pytest.approx(two.tangential_ratio[::-1])
    assert one.tangential_ratio[0] < one.tangential_ratio[1]  # softer along the long axis


def test_derivative_area_and_resultant_of_the_elliptical_contact():
    h, F = Hertz(IRON, RIGID, 10.0, 60.0), 80.0
    d = float(h.approach(F))
    assert h.normal_stiffness(F) == pytest.approx((h.force(d * 1.0001) - h.force(d * 0.9999)) / (2e-4 * d), rel=1e-7)
    a, b = h.semi_axes(F)
    assert h.area(F) == pytest.approx(np.pi * a * b) and a > b
    x, y = np.meshgrid(np.linspace(-a, a, 801), np.linspace(-b, b, 801))
    dA = (a / 400) * (b / 400)
    assert h.pressure(F, x, y).sum() * dA == pytest.approx(F, rel=1e-4)  # the rim's root costs h^1.5
    assert h.pressure(F, 1.01 * a, 0.0) == 0


def test_half_curvatures_of_turned_cylinders_and_of_a_groove():
    """Crossed equal cylinders are a sphere on a flat; a ball in a groove has the difference of curvatures across it."""
    A, B, _ = half_curvatures((np.inf, 0.02), (np.inf, 0.02), 0.5 * np.pi)
    assert (A, B) == pytest.approx((25.0, 25.0))
    A, B, direction = half_curvatures((0.01, 0.01), (np.inf, -0.0105))
    assert (A, B, direction) == pytest.approx((0.5 * (100 - 1 / 0.0105), 50.0, 0.5 * np.pi))
    low, high, turned = half_curvatures((0.03, 0.01), (0.05, 0.02), 0.6)
    H = 2 * (low + high)
    assert pytest.approx(1 / 0.03 + 1 / 0.01 + 1 / 0.05 + 1 / 0.02) == H
    bent = lambda t, x, y: 0.5 * (np.cos(t) ** 2 / x + np.sin(t) ** 2 / y)  # noqa: E731
    gap = lambda t: bent(t, 0.03, 0.01) + bent(t - 0.6, 0.05, 0.02)  # noqa: E731
    angles = np.linspace(-np.pi / 2, np.pi / 2, 200_001)
    assert gap(turned) == pytest.approx(low) and low == pytest.approx(gap(angles).min(), rel=1e-9)
    assert high == pytest.approx(gap(angles).max(), rel=1e-9)
    refused("do not touch in a point", half_curvatures, (np.inf, 0.02))
    refused("do not touch in a point", half_curvatures, (0.01, 0.01), (np.inf, -0.009))
    refused("radius of curvature is 0", half_curvatures, (0.0, 0.01))


def test_moduli_of_a_pair():
    assert normal_modulus(IRON, IRON) == pytest.approx(IRON.young / (2 * (1 - 0.09)))
    assert tangential_modulus(IRON, IRON) == pytest.approx(2 * IRON.shear / 1.7)
    assert mismatch(IRON, IRON) == 0 and mismatch(IRON, BRASS) == -mismatch(BRASS, IRON)
    assert mismatch(Solid(1e9, 0.0), RIGID) == pytest.approx(0.5)
    nu = 0.2  # Spence: a stamp that sticks has 4 G a ln(3 - 4 nu)/(1 - 2 nu), a smooth one 4 G a/(1 - nu)
    beta = mismatch(Solid(1e9, nu), RIGID)
    assert np.log((1 + beta) / (1 - beta)) / (2 * beta) == pytest.approx(np.log(3 - 4 * nu) / (1 - 2 * nu) * (1 - nu))


# any round profile -------------------------------------------------------------------------------------------------


@cache
def round_contact(kind: str) -> RoundContact:
    made = {
        "sphere": lambda: Profile.power(2, 1e-3**2 / 0.04, 1e-3, 3e-3),
        "cone": lambda: Profile.of_function(lambda r: 0.02 * r, 3e-3),
        "truncated": lambda: Profile.of_function(lambda r: 0.02 * np.maximum(r - 4e-4, 0), 3e-3, corners=[4e-4]),
        "table": lambda: Profile.of_table(np.linspace(0, 3e-3, 301), np.linspace(0, 3e-3, 301) ** 2 / 0.04),
        "stamp": lambda: Profile.of_table([0, 1e-3, 2e-3], [0, 0, 0]),
    }[kind]()
    return RoundContact(IRON, BRASS, made, edge=kind == "stamp")


@pytest.mark.parametrize("n", [1.0, 1.5, 2.0, 2.6, 4.0])
def test_transform_of_power_profiles_in_closed_form(n):
    """r^n becomes sqrt(pi)/2 n Gamma(n/2)/Gamma((n + 1)/2) x^n (Popov and Hess 3.2)."""
    x = np.array([1e-5, 3e-4, 2e-3])
    factor = 0.5 * np.sqrt(np.pi) * n * gamma(n / 2) / gamma((n + 1) / 2)
    profile = Profile.power(n, 1e-6, 1e-3, 2e-3)
    assert profile.transform(x) == pytest.approx(factor * 1e-6 * (x / 1e-3) ** n, rel=1e-8)
    assert profile.transform(0.0) == 0


def test_parabola_is_hertz_in_force_radius_pressure_and_stiffness():
    c, h = round_contact("sphere"), Hertz.sphere(IRON, BRASS, 0.02)
    F = np.array([0.01, 30.0, 1000.0])
    assert c.approach(F) == pytest.approx(h.approach(F), rel=1e-9)
    assert c.force(c.approach(F)) == pytest.approx(F, rel=1e-11)
    assert c.radius(F) == pytest.approx(h.semi_axes(F)[0], rel=1e-9)
    assert c.area(30.0) == pytest.approx(h.area(30.0), rel=1e-9)
    r = np.array([0.0, 0.4, 0.99, 1.01]) * float(c.radius(30.0))
    assert c.pressure(30.0, r) == pytest.approx(h.pressure(30.0, r, 0.0), rel=1e-8)
    assert c.normal_stiffness(F) == pytest.approx(h.normal_stiffness(F), rel=1e-9)
    assert c.tangential_stiffness(F)[1] == pytest.approx(h.tangential_stiffness(F)[1], rel=1e-9)
    assert c.tangential_ratio == pytest.approx(h.tangential_ratio, rel=1e-13)
    assert c.force([-1e-6, 0.0]) == pytest.approx([0, 0])


def test_cone_flat_stamp_and_truncated_cone_in_closed_form():
    c = round_contact("cone")
    assert c.force(1e-5) == pytest.approx(indentation.cone_force(c.modulus, 0.02, 1e-5), rel=1e-12)
    a = 2e-5 / (np.pi * 0.02)
    assert c.radius_at(1e-5) == pytest.approx(a, rel=1e-12)
    F = float(c.force(1e-5))
    assert c.pressure(F, [0.3 * a])[0] == pytest.approx(0.5 * c.modulus * 0.02 * np.arccosh(1 / 0.3), rel=1e-9)
    assert c.pressure(F, 0.0) == np.inf
    t = round_contact("truncated")
    for a in (5e-4, 2e-3):
        approach, force = indentation.truncated_cone(t.modulus, 0.02, 4e-4, a)
        assert t.force(approach) == pytest.approx(force, rel=1e-12)
    s = round_contact("stamp")
    assert s.force(1e-6) == pytest.approx(indentation.stamp_force(s.modulus, 2e-3, 1e-6), rel=1e-14)
    assert s.approach(100.0) == pytest.approx(100 / (2 * s.modulus * 2e-3), rel=1e-14)
    edge = 100 / (2 * np.pi * 2e-3 * np.sqrt(4e-6 - 1e-6))  # F/(2 pi a sqrt(a^2 - r^2))
    assert s.pressure(100.0, [1e-3, 2e-3, 2.1e-3]) == pytest.approx([edge, np.inf, 0.0])


@pytest.mark.parametrize("kind", ["cone", "truncated", "table"])
def test_pressure_has_the_force_as_its_resultant(kind):
    """The pressure has logarithmic peaks at a tip and at a ridge, which 24 points between them meet to 1e-5.

    That of a measured profile has kinks at the points measured.
    """
    c, F = round_contact(kind), 20.0
    a = float(c.radius(F))
    z, w = np.polynomial.legendre.leggauss(14 if kind == "table" else 24)
    z = 0.5 * (1 + z)
    kinks = c.profile.breaks[1:] if kind == "table" else c.profile.corners
    ends, total = [0.0, *[x for x in kinks if x < a], a], 0.0
    for p, q in zip(ends, ends[1:], strict=False):
        r = p + (q - p) * z**3 * (10 - 15 * z + 6 * z**2)  # crowds the points at both ends
        total += np.sum(0.5 * w * (q - p) * 30 * (z * (1 - z)) ** 2 * 2 * np.pi * r * c.pressure(F, r))
    assert total == pytest.approx(F, rel=1e-5)


def test_measured_profile_converges_to_the_function():
    h, error, counts = Hertz.sphere(IRON, BRASS, 0.02), [], np.array([10, 20, 40, 80])
    for n in counts:
        r = np.linspace(0, 2e-3, n + 1)
        c = RoundContact(IRON, BRASS, Profile.of_table(r, 7.0 + r**2 / 0.04))  # the offset is taken off
        error.append(abs(float(c.force(5e-5) / h.force(5e-5)) - 1))
    assert np.polyfit(np.log(counts), np.log(error), 1)[0] < -1.9 and error[-1] < 1e-4


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Layer(IRON, 0.01).check_yield([1e8, np.nan], 0.0, 2e8), "pressure: entry 2 is not finite"),
        (lambda: Layer(IRON, 0.01).check_yield([1e8, -1.0], 0.0, 2e8), "pressure: entry 2 is -1 Pa"),
        (lambda: Layer(IRON, 0.01).check_yield([1e8] * 2, [0.0, 1.0, 2.0], 2e8), "shear: 3 entries for 2"),
        (lambda: Layer(IRON, 0.01).check_yield([1e8], 0.0, 0.0), "yield_shear"),
        (lambda: Layer(IRON, 0.01).check_yield([1e8] * 2, 0.0, 2e8, None, ["a"]), "names: 1 entries for 2"),
        (lambda: Layer(IRON, 0.01, "free"), "boundary: 'free' is unknown; choose one of stress-free"),
        (lambda: Layer(IRON, 0.0), "thickness"),
        (lambda: Layer(IRON, 0.01, density=-1.0), "density"),
        (lambda: Layer(Solid(1e6, 0.5), 0.01, "hydrostatic"), "poisson: 0.5"),
        (lambda: Layer(IRON, 0.01).eigenfrequencies("normal"), "density: not given"),
        (lambda: Layer(IRON, 0.01, density=1.0).eigenfrequencies("n"), "direction"),
        (lambda: Layer(IRON, 0.01, density=1.0).quasi_static(-1.0), "frequency"),
        (lambda: Layer(IRON, 0.01, density=1.0).quasi_static(1.0, 0.0), "tolerance"),
        (lambda: Solid(0.0, 0.3), "young"),
        (lambda: Solid(1.0, 0.6), "poisson"),
        (lambda: Solid(1.0, 0.3, 0.0), "shear"),
        (lambda: normal_modulus(RIGID, RIGID), "both bodies are rigid"),
        (lambda: Hertz(IRON, BRASS, 0.0, 1.0), "half curvatures"),
        (lambda: Hertz(IRON, BRASS, np.nan, 1.0), "half curvatures"),
        (lambda: Hertz.sphere(IRON, BRASS, 0.01).approach(-1.0), "must not be negative"),
        (lambda: of_point_contact(Hertz.sphere(IRON, BRASS, 0.01), 0.0), "unloaded"),
        (lambda: PartialSlip(Hertz.sphere(IRON, BRASS, 0.01), 0.0, 0.3), "normal_force"),
        (lambda: PartialSlip(Hertz.sphere(IRON, BRASS, 0.01), 1.0, 0.0), "friction"),
        (lambda: PartialSlip(Hertz.sphere(IRON, BRASS, 0.01), 1.0, 0.3, 2), "axis"),
        (lambda: PartialSlip(Hertz.sphere(IRON, BRASS, 0.01), 1.0, 0.3).displacement(0.4), "more than friction holds"),
        (lambda: Profile.of_table([0, 1], [0, 1]), "at least three"),
        (lambda: Profile.of_table([0, 1, 2], [0, np.nan, 1], "ball.csv"), "ball.csv: gap: entry 2 is not finite"),
        (lambda: Profile.of_table([0, 2, 1], [0, 1, 2]), "entry 3 does not rise"),
        (lambda: Profile.of_table([1, 2, 3], [0, 1, 2]), "begins at 1 m instead of 0"),
        (lambda: Profile.power(-1, 1e-6, 1e-3, 2e-3), "is not finite at r = "),
        (lambda: Profile.of_function(lambda r: r, 1e-3, corners=[2e-3]), "corners"),
        (lambda: RoundContact(IRON, IRON, Profile.of_table([0, 1, 2, 3], [0, 2, 0, 4])), "touches in a ring"),
        (lambda: round_contact("cone").approach(1e9), "a wider one"),
        (lambda: round_contact("cone").force(1.0), "needs a wider one"),
        (lambda: round_contact("cone").approach(-1.0), "must not be negative"),
    ],
)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_what_stands_for_no_contact_is_refused(make, words):
    refused(words, make)


# partial slip ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("share", [0.01, 0.3, 0.97, 1.0])
def test_hertz_contact_slips_as_cattaneo_and_mindlin_say(share):
    h, N, mu = Hertz.sphere(IRON, IRON, 0.02), 100.0, 0.3
    k = float(h.tangential_stiffness(N)[0])
    assert k == pytest.approx(indentation.mindlin_stiffness(IRON.shear, 0.3, float(h.semi_axes(N)[0])), rel=1e-13)
    s, T = PartialSlip(h, N, mu), share * mu * N
    u = float(s.displacement(T))
    assert u == pytest.approx(indentation.cattaneo_displacement(T, mu, N, k), rel=1e-12)
    assert s.force([u, -u]) == pytest.approx([T, -T], rel=1e-12)
    assert s.dissipated(u) == pytest.approx(indentation.cattaneo_loss(T, mu, N, k), rel=1e-7)  # a difference at 1 %


@pytest.mark.parametrize("axis", [0, 1])
def test_elliptical_contact_slips_as_deresiewicz_says(axis):
    """The same curve as Mindlin's with the ellipse's own stiffness; its slope at rest is that stiffness."""
    h, N, mu = Hertz(IRON, BRASS, 10.0, 150.0), 100.0, 0.2
    s, k = PartialSlip(h, N, mu, axis), float(h.tangential_stiffness(N)[axis])
    for T in (2.0, 11.0, 20.0):
        assert s.displacement(T) == pytest.approx(indentation.cattaneo_displacement(T, mu, N, k), rel=1e-12)
    step = 1e-6 * s.full_slip
    assert s.force(step) / step == pytest.approx(k, rel=1e-6)
    assert s.full_slip == pytest.approx(1.5 * mu * N / k, rel=1e-12)


def test_every_profile_starts_with_its_stiffness_and_ends_at_full_slip():
    for kind in ("cone", "truncated", "table"):
        c = round_contact(kind)
        s = PartialSlip(c, 50.0, 0.25)
        step = 1e-5 * s.full_slip
        assert s.force(step) / step == pytest.approx(float(c.tangential_stiffness(50.0)[0]), rel=2e-5)
        assert s.force([s.full_slip, 3 * s.full_slip]) == pytest.approx([12.5, 12.5], rel=1e-9)
        u = np.linspace(0, s.full_slip, 9)
        assert (np.diff(s.force(u), 2) < 0).all()  # ever softer
        assert s.displacement(s.force(u[1:-1])) == pytest.approx(u[1:-1], rel=1e-8)


def test_flat_stamp_sticks_until_it_slides():
    """No partial slip under a flat stamp: its pressure and its sticking traction have one shape (Jaeger 1998)."""
    c = round_contact("stamp")
    s = PartialSlip(c, 100.0, 0.3)
    u = np.array([0.2, 0.9, 1.0, 1.5]) * s.full_slip
    k = float(c.tangential_stiffness(100.0)[0])
    assert s.force(u) == pytest.approx(np.minimum(k * u, 30.0), rel=1e-12)
    assert s.dissipated(1.5 * s.full_slip) == pytest.approx(4 * 30 * 0.5 * s.full_slip, rel=1e-9)  # Jenkins' loop


@pytest.mark.parametrize("share", [0.5, 1.3])
def test_area_of_the_loop_is_the_energy_lost(share):
    s = PartialSlip(round_contact("truncated"), 50.0, 0.25)
    u, T = s.loop(share * s.full_slip, 400)
    assert (u[0], T[0]) == pytest.approx((u[-1], T[-1]), abs=1e-9 * T[0])
    assert np.trapezoid(T, u) == pytest.approx(s.dissipated(share * s.full_slip), rel=1e-4)  # trapezia of 400 steps


# series, finite elements, counted once -----------------------------------------------------------------------------


def test_two_layers_in_series_are_one_layer_of_both_depths():
    both = in_series(of_layer(Layer(IRON, 0.03), 1e-4), of_layer(Layer(IRON, 0.06), 1e-4))
    whole = of_layer(Layer(IRON, 0.09), 1e-4)
    assert both.all == pytest.approx(whole.all, rel=1e-14) and both.includes == BULK
    rigid = in_series(whole, ContactStiffness(np.inf, (np.inf, np.inf), SURFACE))
    assert rigid.all == pytest.approx(whole.all) and rigid.includes == BULK_AND_SURFACE
    refused("counted twice", in_series, rigid, ContactStiffness(1e9, (1e9, 1e9), SURFACE))
    refused("includes: 'all'", ContactStiffness, 1e9, (1e9, 1e9), "all")
    refused("tangential: 0 N/m", ContactStiffness, 1e9, (0.0, 1e9), SURFACE)
    refused("tangential: nan N/m", ContactStiffness, 1e9, (1e9, np.nan), SURFACE)


def test_two_bodies_of_a_point_contact_are_in_series():
    """Each half-space against a rigid one of the same contact ellipse has twice the share of the approach."""
    F = 100.0
    pair = of_point_contact(Hertz.sphere(IRON, BRASS, 0.02), F)
    a = float(Hertz.sphere(IRON, BRASS, 0.02).semi_axes(F)[0])
    halves = []
    for s in (IRON, BRASS):
        n, t = 2 * normal_modulus(s, RIGID) * a, 2 * tangential_modulus(s, RIGID) * a
        halves.append(ContactStiffness(n, (t, t), BULK))
    assert in_series(*halves).all == pytest.approx(pair.all, rel=1e-13) and pair.includes == BULK
    table = of_point_contact(round_contact("table"), F)
    assert table.all == pytest.approx(pair.all, rel=1e-5)


LENGTH, AREA = 1.0, 0.04 * 0.05


@cache
def bar(method: str, count: int = 4):
    """A rod along x, held at x = 0, without lateral contraction."""
    sliding = [{"face": "y0", "directions": "y"}, {"face": "z0", "directions": "z"}]
    supports = [{"face": "x0"}, *sliding]
    face = [{"name": "right", "face": "x1", "t2": [0.0, 0.0, 1.0], "role": "ground"}]
    material = {**STEEL, "poisson": 0.0}
    settings = body(material, supports=supports, interfaces=face, modes={"count": count}, reduction=method)
    return modal_basis(brick("hexahedron20", (12, 1, 1), (LENGTH, 0.04, 0.05)), settings).groups[0, 0]


def test_finite_element_source_is_what_the_eigenmodes_leave():
    """Of L/(E A) four modes of a rod hold the sum of 8/(pi (2j - 1))^2; 1e-4: twelve quadratic elements."""
    left = LENGTH / (STEEL["young"] * AREA) * (1 - sum(8 / (np.pi * (2 * j - 1)) ** 2 for j in range(1, 5)))
    for method in ("eigenmodes", "rubin", "craig-bampton"):
        found = of_patch(bar(method), method, "right")
        assert found.normal == pytest.approx(1 / left, rel=1e-3), method
        assert found.includes == BULK and min(found.tangential) > 0
    refused("no interface 'left'; the file has right", of_patch, bar("rubin"), "rubin", "left")


@pytest.mark.parametrize("method", ["eigenmodes", "rubin", "craig-bampton"])
def test_one_contact_on_every_basis_moves_alike(method):
    """Bulk from finite elements in series with a surface, freed of what the basis holds: one static compliance.

    1e-5: that of a statically exact basis is the difference of large numbers.
    """
    surface = ContactStiffness(3e9, (2e9, 2e9), SURFACE)
    g = bar(method)
    share = contact_share(g, method, "u_n", "right")
    whole = share.static + 1 / surface.normal
    for given in (surface, in_series(of_patch(g, method, "right"), surface)):
        beside = for_basis(given, g, method, "right")
        assert share.held + share.supplied + 1 / beside.normal == pytest.approx(whole, rel=1e-5), given.includes


def test_two_elastic_bodies_are_freed_of_their_bulk_one_after_the_other():
    """Two bars end to end with a surface between them; what both bases hold and what is left make the whole."""
    surface, g = ContactStiffness(3e9, (2e9, 2e9), SURFACE), bar("rubin")
    whole = in_series(in_series(of_patch(g, "rubin", "right"), of_patch(g, "rubin", "right")), surface)
    once = for_basis(whole, g, "rubin", "right")
    assert for_basis(once, g, "rubin", "right").all == pytest.approx(surface.all, rel=1e-4)
    assert whole.normal < once.normal < surface.normal


def test_stiffness_that_cannot_count_the_bulk_is_refused():
    stiff = ContactStiffness(1e12, (1e12, 1e12), BULK_AND_SURFACE)
    refused("said to count the bulk", for_basis, stiff, bar("rubin"), "rubin", "right")


# resonances --------------------------------------------------------------------------------------------------------

BEAM = rectangle(0.2, 0.02, 0.01, 2.1e11, 0.3, 7850)
RIG = two_beams(BEAM, 0.01)


def test_limits_of_the_two_beams_are_those_of_single_ones():
    """Free: cantilevers. Rigid: the first mode of a clamped-clamped beam of both, and of a clamped-pinned one."""
    free = BEAM.unit * euler_bernoulli(1)[0]
    assert identification.frequencies(BEAM, 0.0, 0.0) == pytest.approx((free, free), rel=1e-12)
    rigid = identification.frequencies(BEAM, np.inf, np.inf)
    twice = rectangle(0.4, 0.02, 0.01, 2.1e11, 0.3, 7850)
    whole = twice.unit * euler_bernoulli(2, "clamped-clamped")
    assert rigid == pytest.approx(tuple(whole), rel=1e-10)  # one piece


def test_two_beams_against_a_sum_over_modes():
    """Cantilever modes with the tip's spring: the sum converges like 1/m for the slope, 1/m^3 for the displacement."""
    b2 = euler_bernoulli(60)
    tip = 4 / (BEAM.density * BEAM.area * BEAM.length)  # every mode has the tip amplitude 2
    b = np.sqrt(b2)
    sigma = np.ones(60)  # (sinh - sin)/(cosh + cos), 1 to rounding beyond the first few
    sigma[:6] = (np.sinh(b[:6]) - np.sin(b[:6])) / (np.cosh(b[:6]) + np.cos(b[:6]))
    slope = np.sqrt(tip) * sigma * b / BEAM.length  # both up to a sign that the rank-one spring does not see
    k_phi, k_t = 800.0, 3e7
    for row, k, found in (
        (slope, 2 * k_phi, identification.frequencies(BEAM, k_phi, k_t)[0]),
        (np.sqrt(tip) * np.ones(60), 2 * k_t, identification.frequencies(BEAM, k_phi, k_t)[1]),
    ):
        K = np.diag((BEAM.unit * b2) ** 2) + k * np.outer(row, row)
        assert found == pytest.approx(np.sqrt(scipy.linalg.eigvalsh(K)[0]), rel=5e-3)


def test_stiffnesses_of_the_rig_come_back_and_agree_with_the_explicit_inverse():
    k = np.array([82.5e6, 31.7e6])
    f = RIG(k)
    found = identify(RIG, [MeasuredResonance(f[0], 0.1, 1), MeasuredResonance(f[1], 0.1, 2)])
    assert found.stiffness == pytest.approx(k, rel=1e-8)
    assert hinge_spring(BEAM, 2 * np.pi * f[0]) * 12 / 0.01**2 == pytest.approx(k[0], rel=1e-10)
    assert shear_spring(BEAM, 2 * np.pi * f[1]) == pytest.approx(k[1], rel=1e-10)
    assert found.sensitivity[0, 1] == found.sensitivity[1, 0] == 0  # each mode tells one of them
    assert found.correlation == pytest.approx(np.eye(2))
    assert "normal 8.25e+07 N/m" in found.sentence() and "within their uncertainty" in found.sentence()


def test_stated_uncertainty_is_the_scatter_of_repeated_measurements():
    """400 draws tell a standard deviation to 1/sqrt(800) = 3.5 %; three times that."""
    k, sigma = np.array([82.5e6, 31.7e6]), 0.05
    f = RIG(k)
    found = identify(RIG, [MeasuredResonance(f[0], sigma, 1), MeasuredResonance(f[1], sigma, 2)])
    rng = np.random.default_rng(1)
    draws = f + sigma * rng.normal(size=(400, 2))
    normal = [np.log(hinge_spring(BEAM, 2 * np.pi * a)) for a in draws[:, 0]]
    shear = [np.log(shear_spring(BEAM, 2 * np.pi * a)) for a in draws[:, 1]]
    assert [np.std(normal), np.std(shear)] == pytest.approx(found.deviation, rel=0.11)


def test_more_resonances_than_stiffnesses_are_averaged_by_their_uncertainty():
    k = np.array([82.5e6, 31.7e6])
    f = RIG(k)
    two = [
        MeasuredResonance(f[0] + 0.1, 0.1, 1),
        MeasuredResonance(f[0] - 0.2, 0.2, 1),
        MeasuredResonance(f[1], 0.1, 2),
    ]
    found = identify(RIG, two)
    mean = f[0] + (0.1 / 0.01 - 0.2 / 0.04) / (1 / 0.01 + 1 / 0.04)
    assert found.frequency[0] == pytest.approx(mean, abs=1e-6)
    assert found.misfit == pytest.approx([(f[0] + 0.1 - mean) / 0.1, (f[0] - 0.2 - mean) / 0.2, 0], abs=1e-4)


FREE, STIFF = RIG(np.full(2, 1e2)), RIG(np.full(2, 1e13))
GOOD = RIG(np.array([82.5e6, 31.7e6]))


@pytest.mark.parametrize(
    ("resonances", "words"),
    [
        ([MeasuredResonance(GOOD[0], 0.1, 1)], "1 measured for 2 stiffnesses"),
        (
            [MeasuredResonance(GOOD[0], 0.1, 1), MeasuredResonance(GOOD[0], 0.2, 1)],
            "do not tell the tangential stiffness",
        ),
        ([MeasuredResonance(100.0, 0.1, 1), MeasuredResonance(GOOD[1], 0.1, 2)], "out of the contact's reach, 208"),
        ([MeasuredResonance(GOOD[0], 0.1, 1), MeasuredResonance(2000.0, 0.1, 2)], "out of the contact's reach"),
        (
            [MeasuredResonance(GOOD[0], 0.1, 1), MeasuredResonance(STIFF[1] + 0.05, 0.1, 2)],
            "of the rigid contact, so it only bounds",
        ),
        ([MeasuredResonance(FREE[0] - 0.1, 0.1, 1), MeasuredResonance(GOOD[1], 0.1, 2)], "of the open contact"),
        ([MeasuredResonance(GOOD[0], 40.0, 1), MeasuredResonance(GOOD[1], 0.1, 2)], "do not tell the normal stiffness"),
        (
            [MeasuredResonance(GOOD[0], 0.1, 1), MeasuredResonance(GOOD[1], 0.1, 3)],
            "mode 3 is none of the model's 1 to 2",
        ),
        ([MeasuredResonance(GOOD[0], 0.0, 1), MeasuredResonance(GOOD[1], 0.1, 2)], "greater than 0"),
        ([MeasuredResonance(np.nan, 0.1, 1), MeasuredResonance(GOOD[1], 0.1, 2)], "greater than 0"),
    ],
)
def test_resonances_that_tell_nothing_are_refused(resonances, words):
    refused(words, identify, RIG, resonances)


def mass(name: str, normal: float) -> System:
    """1 kg on 1e6 N/m each way; its contact looks along +-x."""
    return System(
        name, [Body(name, 1.0, free="x y")],
        [Spring("ground", name, 1e6, [1, 0, 0]), Spring("ground", name, 2e6, [0, 1, 0])],
        contacts=[Contact("face", name, normal=(normal, 0.0, 0.0), t2=(0.0, 0.0, 1.0))],
    )  # fmt: skip


def test_two_bodies_joined_by_a_contact_in_closed_form():
    """In phase the contact is at rest; against each other it counts twice. Frames of both sides are turned right."""
    one, two = (mass(n, s).basis().groups[0, 0] for n, s in (("a", 1.0), ("b", -1.0)))
    k_n, k_t = 3e6, 5e5
    f = joined(one, "face", two, "face")(np.array([k_n, k_t]))
    expected = np.sqrt(np.sort([1e6, 1e6 + 2 * k_n, 2e6, 2e6 + 2 * k_t])) / (2 * np.pi)
    assert f == pytest.approx(expected, rel=1e-12)
    measured = [MeasuredResonance(f[3], 0.1, 4), MeasuredResonance(f[2], 0.1, 3)]
    with pytest.raises(UserError, match=r"alike: normal 1e\+06 N/m, tangential 2.5e\+06 N/m or normal 3e\+06"):
        identify(joined(one, "face", two, "face"), measured)  # the two modes may change places
    found = identify(joined(one, "face", two, "face"), measured, bounds={"tangential": (1e2, 1e6)})
    assert found.stiffness == pytest.approx([k_n, k_t], rel=1e-7)
    refused("bounds", identify, joined(one, "face", two, "face"), measured, bounds={"tangential": (1e6, 1e2)})
    in_phase = joined(one, "face", two, "face", given={"tangential": k_t}), [MeasuredResonance(f[0], 0.1, 1)]
    refused(("mode 1 ", "does not move at the contact"), identify, *in_phase, ["normal"])
    refused("no interface 'side'; the body has face", joined, one, "side")
    refused("includes must be", joined, one, "face", includes="all")


def test_joined_bodies_are_those_with_a_link_between_them():
    """Two unlike blocks, whose patches of 20 x 50 mm have frames of their own, against springs written down as a link:
    k_t (b0^2 + h0^2)/12 about the normal y, k_n h0^2/12 about z, k_n b0^2/12 about x. Rounding of dense eigenvalues."""
    members = {
        "a": Body("a", 2.0, (0.0, 0.0, 0.0), (2e-3, 3e-3, 5e-3)),
        "b": Body("b", 0.7, (0.2, 0.03, 0.0), (1e-3, 4e-4, 7e-4)),
    }
    springs = [3e5, 7e5, 2e5, 800.0, 500.0, 300.0]
    ground = {n: Link("ground", n, springs, at=(x, 0.02, 0.01)) for n, x in (("a", -0.1), ("b", 0.3))}
    middle = (0.1, 0.01, -0.02)
    faces = {
        "a": Contact("face", "a", (0, 1.0, 0), (1.0, 0, 0), middle, width=0.02, height=0.05),  # t1 = z, t2 = x
        "b": Contact("face", "b", (0, -1.0, 0), (2.0, 0, 1.0), middle, width=0.02, height=0.05),
    }
    k_n, k_t, b0, h0 = 4e6, 9e5, 0.02, 0.05
    springs = [k_t, k_n, k_t, k_n * b0**2 / 12, k_t * (b0**2 + h0**2) / 12, k_n * h0**2 / 12]
    whole = System("whole", list(members.values()), [*ground.values(), Link("a", "b", springs, at=middle)])
    parts = (System(n, [members[n]], [ground[n]], contacts=[faces[n]]) for n in members)
    one, two = (p.basis().groups[0, 0] for p in parts)
    found = joined(one, "face", two, "face")(np.array([k_n, k_t]))
    assert found == pytest.approx(whole.basis().groups[0, 0].frequency, rel=1e-9)


def solid_beam(tip: str, root: str):
    """Slender (1:40), without lateral contraction."""
    face = [{"name": "tip", "face": tip, "t2": [0.0, 0.0, 1.0], "role": "ground"}]
    material = {**STEEL, "poisson": 0.0}
    settings = body(material, supports=[{"face": root}], interfaces=face, modes={"count": 8})
    return modal_basis(brick("hexahedron20", (16, 1, 1), (0.4, 0.02, 0.01)), settings).groups[0, 0]


@pytest.mark.parametrize("k", [(8e6, 3e5), (82.5e6, 31.7e6)])
def test_the_rig_in_solid_elements_is_the_rig_in_closed_form(k):
    """Two solid beams, tips facing: their first and third mode are those of `two_beams` once what eight modes leave of
    the compliance is added. 5e-4: shear and rotary inertia, (h/L)^2 = 6e-4 times a number below 1. The stiffnesses
    identified from the closed form's frequencies follow with 1/sensitivity, which is 10 and 100 here."""
    one, two = solid_beam("x1", "x0"), solid_beam("x0", "x1")
    section = rectangle(0.4, 0.02, 0.01, STEEL["young"], 0.0, STEEL["density"])
    f = two_beams(section, 0.01)(np.array(k))
    model = joined(one, "tip", two, "tip", includes=SURFACE)
    assert model(np.array(k))[[0, 2]] == pytest.approx(f, rel=5e-4)
    found = identify(model, [MeasuredResonance(f[0], 1e-4 * f[0], 1), MeasuredResonance(f[1], 1e-4 * f[1], 3)])
    assert found.stiffness == pytest.approx(k, rel=0.01)


def test_a_nodal_diameter_is_joined_like_its_real_form():
    """Turning the phase of every mode (a complex basis of the same body) must not move a frequency."""
    g = bar("eigenmodes", 4)
    face, phase = g.interfaces["right"], np.exp(1j * np.arange(4))
    turned = replace(face, rows=face.rows * phase, shapes=face.shapes * phase)
    twisted = replace(g, interfaces={"right": turned})
    k = np.array([2e9, 1e9])
    for includes in (SURFACE, BULK_AND_SURFACE):
        real, waves = (joined(x, "right", includes=includes)(k) for x in (g, twisted))
        assert waves == pytest.approx(real, rel=1e-12)


def test_node_of_a_mode_at_the_contact_is_refused():
    """Three masses in a row, the contact on the middle one: the second mode has its node there."""
    chain = System(
        "chain", [Body(str(i), 1.0, (float(i), 0, 0), free="x") for i in range(3)],
        [Spring("ground", "0", 1e6), Spring("0", "1", 1e6), Spring("1", "2", 1e6), Spring("2", "ground", 1e6)],
        contacts=[Contact("face", "1", normal=(1.0, 0.0, 0.0), t2=(0.0, 0.0, 1.0))],
    ).basis().groups[0, 0]  # fmt: skip
    model = joined(chain, "face", given={"tangential": 0.0})
    f = model(np.array([1e6]))
    second = [MeasuredResonance(f[1], 0.1, 2)]
    refused(("mode 2 ", "does not move at the contact"), identify, model, second, ["normal"])
    assert identify(model, [MeasuredResonance(f[0], 0.1, 1)], ["normal"]).stiffness == pytest.approx([1e6], rel=1e-8)


def test_stiffness_found_is_the_surfaces_once_the_bulk_is_added():
    """A rod of length L whose end stands on a spring: k L/(E A) = -x cot x. Two modes of the free rod, and the rest.

    With the static rest the spring is found to 1 %, its dynamics being all that is left out; without it the spring has
    to bring the bulk that two modes leave (20 % of L/(E A)) and comes out far softer, as the book's c_N0 does.
    """
    k = 2 * STEEL["young"] * AREA / LENGTH
    x = 2.288929728  # x cot x = -2
    assert x / np.tan(x) == pytest.approx(-2, rel=1e-8)
    f = x / LENGTH * np.sqrt(STEEL["young"] / STEEL["density"]) / (2 * np.pi)
    g = bar("eigenmodes", 2)
    known = {"tangential": 0.0}
    surface = identify(
        joined(g, "right", includes=SURFACE, given=known), [MeasuredResonance(f, 1e-4 * f, 1)], ["normal"]
    )
    assert surface.stiffness[0] == pytest.approx(k, rel=0.01)
    both = identify(joined(g, "right", given=known), [MeasuredResonance(f, 1e-4 * f, 1)], ["normal"])
    assert both.stiffness[0] < 0.9 * k
