"""Curved faces: gaps of the points, lines of contact against boundary elements, what an elastic foundation matches."""

from __future__ import annotations

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from blocks import block
from meshes import brick
from refusals import refused

from microslip.contact.curved import Line, apart, foundation_of_line, foundation_of_point, gap, in_hole, point_curve
from microslip.contact.friction import Coulomb
from microslip.contact.heights import Polynomial
from microslip.contact.hertz import Hertz
from microslip.contact.law import value
from microslip.contact.normal import Penalty, Preload, Rough
from microslip.contact.patch import Patch, equilibrium, grid, pressed_by, pressing, pressure
from microslip.contact.point import PointContact
from microslip.contact.portion import Portion
from microslip.contact.sliders import Iwan, rough_strips, uniform
from microslip.contact.solids import Solid, mean_inverse_distance
from microslip.data import Array
from microslip.system.assembly import ContactFace
from microslip.system.component import Component
from microslip.system.nodal import nodal, static_compliance

STEEL = Solid(2.1e11, 0.3)
PIN = Line(STEEL, STEEL, in_hole(6e-3, 6.1e-3), 15e-3)  # geometry/pin
STRIP = 2e-3
COULOMB = Coulomb(value(0.3))


def springs(areas: Array, k: float) -> PointContact:
    return PointContact(Penalty(value(k * areas)), COULOMB, value(k * areas))


def curved(k: float, radii: tuple[float, float], size: tuple[float, float], counts: tuple[int, int]) -> Patch:
    """Springs k (Pa/m) under a curved body."""
    points, areas = grid(*size, counts)
    return Patch("pin", points, areas, apart(springs(areas, k), gap(points, radii)))


def test_pin_in_a_hole() -> None:
    assert in_hole(6e-3, 6.1e-3) == pytest.approx(0.366, rel=1e-12)
    for pin in (6.1e-3, 7e-3, 0.0):
        refused("does not fit", in_hole, pin, 6.1e-3)


def test_moduli_are_johnsons() -> None:
    """Johnson 4.3: K/h = 1.18 E*/a of a line, 1.70 E*/a of a circle for the same width; 3 pi/8 and 16/(3 pi)."""
    F = 100.0
    line = foundation_of_line(PIN, F, STRIP, "width")
    assert line.stiffness * PIN.half_width(F) / PIN.modulus == pytest.approx(3 * math.pi / 8, rel=1e-12)
    assert line.width == pytest.approx(1) and line.peak == pytest.approx(3 * math.pi / 8, rel=1e-12)
    ball = Hertz.sphere(STEEL, STEEL, 0.01)
    point = foundation_of_point(ball, F, "width")
    assert point.stiffness * ball.semi_axes(F)[0] / ball.modulus == pytest.approx(16 / (3 * math.pi), rel=1e-12)
    assert point.approach == pytest.approx(0.5) and point.peak == pytest.approx(4 / 3, rel=1e-12)
    by_approach = foundation_of_point(ball, F)
    assert by_approach.width == pytest.approx(math.sqrt(2), rel=1e-12)
    assert by_approach.slope == pytest.approx(4 / 3, rel=1e-12)


def half_plane(F: float, strip: float, n: int = 400) -> tuple[float, Array, Array]:
    """Approach beyond the strip's mean (m), places and pressures of `PIN`, by constant pressures on n elements.

    u(x) = -2/(pi E*) int p ln|x - s| ds; contact where the gap closes. An active set on the elements.
    """
    reach = 2 * float(PIN.half_width(F))
    ends = np.linspace(-reach, reach, n + 1)
    x, load = 0.5 * (ends[1:] + ends[:-1]), F / PIN.length

    def integral(d: Array) -> Array:  # of ln|d|
        return d * np.log(np.abs(d)) - d

    A = -2 / (np.pi * PIN.modulus) * (integral(x[:, None] - ends[:-1]) - integral(x[:, None] - ends[1:]))
    h, closed = x**2 / (2 * PIN.radius), np.ones(n, dtype=bool)
    for _ in range(60):
        m = closed.sum()
        width = np.full((1, m), ends[1] - ends[0])
        B = np.block([[A[np.ix_(closed, closed)], -np.ones((m, 1))], [width, np.zeros((1, 1))]])
        found = np.linalg.solve(B, np.append(-h[closed], load))
        p = np.zeros(n)
        p[closed], delta = found[:-1], found[-1]
        if (p >= 0).all():
            break
        closed &= p > 0
    mean = -2 * load / (np.pi * PIN.modulus) * (math.log(strip) - 1.5)  # of uniform pressure, over the strip
    return delta - mean, x, p


def test_approach_of_a_line_against_boundary_elements() -> None:
    """The approach beyond the strip's own, Hertz' half width and largest pressure: 400 elements, 0.1 %."""
    for F in (30.0, 300.0):
        delta, x, p = half_plane(F, STRIP)
        assert delta == pytest.approx(float(PIN.approach(F, STRIP)), rel=1e-3)
        assert p.max() == pytest.approx(float(PIN.largest_pressure(F)), rel=1e-3)
        assert np.abs(x[p > 0]).max() == pytest.approx(float(PIN.half_width(F)), rel=0.01)  # an element's width
    k = (PIN.approach(101.0, STRIP) - PIN.approach(99.0, STRIP)) / 2
    assert float(PIN.stiffness(100.0, STRIP)) == pytest.approx(1 / float(k), rel=1e-4)
    refused("wider by half", PIN.curve, 3000.0, STRIP)


def test_uniform_pressure_on_a_strip_has_the_mean_that_is_taken_off() -> None:
    """ln(w) - 3/2, the mean of ln|x - s| over a strip: its inner integral in closed form, the outer by Gauss, 1e-5."""
    x, w = np.polynomial.legendre.leggauss(400)
    mean = w @ (0.5 * ((1 + x) * np.log(1 + x) + (1 - x) * np.log(1 - x)) - 1) / 2
    assert mean == pytest.approx(math.log(2) - 1.5, abs=1e-5)


def test_point_law_counts_the_face_once() -> None:
    """Hertz' approach of an ellipse less what a rectangle of the face yields: both curves differ by F C, 1e-6."""
    ball, face = Hertz(STEEL, STEEL, 2.0, 5.0), (8e-3, 6e-3)
    curve = point_curve(ball, 200.0, face)
    held = mean_inverse_distance(*face) / (math.pi * ball.modulus)
    np.testing.assert_allclose(curve.knots + held * curve.loads, ball.approach(curve.loads), rtol=1e-12)
    rise = np.gradient(curve.loads, curve.knots)[40:-1]
    np.testing.assert_allclose(curve.slopes[40:-1], rise, rtol=5e-3)
    refused("some times larger", point_curve, ball, 2e4, (2e-3, 2e-3))


@pytest.mark.parametrize("match", ["approach", "width"])
def test_points_on_springs_are_the_foundation(match: str) -> None:
    """Resultant 4/3 k l sqrt(2R) delta^1.5, half width sqrt(2 R delta) and the ratios that `Foundation` tells, from
    the pressures of 1 x 160 points: 0.5 %, widths to a point."""
    F = 100.0
    found = foundation_of_line(PIN, F, STRIP, match)
    patch = curved(found.stiffness, (math.inf, PIN.radius), (PIN.length, STRIP), (1, 160))
    u = equilibrium(patch, F)
    p, z = pressure(patch, u), patch.points[:, 1]
    assert p @ patch.areas == pytest.approx(F, rel=1e-11)
    assert u[0] == pytest.approx(found.approach * float(PIN.approach(F, STRIP)), rel=5e-3)
    assert p.max() == pytest.approx(found.peak * float(PIN.largest_pressure(F)), rel=5e-3)
    half = found.width * float(PIN.half_width(F))
    assert np.abs(z[p > 0]).max() == pytest.approx(half, abs=STRIP / 160)
    np.testing.assert_allclose(p, np.maximum(p.max() * (1 - (z / half) ** 2), 0), rtol=0, atol=0.02 * p.max())
    up = equilibrium(patch, 1.02 * F)[0] - equilibrium(patch, 0.98 * F)[0]
    assert 0.04 * F / up == pytest.approx(found.slope * float(PIN.stiffness(F, STRIP)), rel=0.02)


def test_points_across_the_line_converge() -> None:
    """Force at a given approach over the number of points: the rim lies between points, order 3/2 or better."""
    k, delta = 1e14, 1e-7
    exact = 4 / 3 * k * PIN.length * math.sqrt(2 * PIN.radius) * delta**1.5
    errors = []
    for n in (16, 64, 256):
        patch = curved(k, (math.inf, PIN.radius), (PIN.length, STRIP), (1, n))
        errors.append(abs(pressing(patch, np.array([delta, 0, 0, 0, 0, 0]))[0] / exact - 1))
    assert errors[0] < 0.05 and errors[2] < 1e-3
    assert np.polyfit(np.log([16, 64, 256]), np.log(errors), 1)[0] < -1.4


def test_an_ellipse_of_points_against_hertz() -> None:
    """Force, half axes and the largest pressure as `foundation_of_point` tells them: 1 % of 40 x 40 points."""
    F, radii = 50.0, (0.05, 0.02)
    ball = Hertz(STEEL, STEEL, 0.5 / radii[0], 0.5 / radii[1])
    found = foundation_of_point(ball, F)
    size = 4 * float(np.max(ball.semi_axes(F)))
    patch = curved(found.stiffness, radii, (size, size), (60, 60))
    u = equilibrium(patch, F)
    p = pressure(patch, u)
    assert u[0] == pytest.approx(float(ball.approach(F)), rel=0.01)
    assert p.max() == pytest.approx(found.peak * float(ball.largest_pressure(F)), rel=0.01)
    assert np.abs(patch.points[p > 0]).max() == pytest.approx(found.width * np.max(ball.semi_axes(F)), abs=size / 40)


def test_a_pin_that_is_tilted_finds_its_moments() -> None:
    """Newton's method with moments about both tangents: resultants to rounding, pressure only where it is pressed."""
    found = foundation_of_line(PIN, 100.0, STRIP)
    patch = curved(found.stiffness, (math.inf, PIN.radius), (PIN.length, STRIP), (20, 60))
    u = equilibrium(patch, 100.0, (0.002, 0.3))
    p = pressure(patch, u) * patch.areas
    y, z = patch.points.T
    np.testing.assert_allclose([p.sum(), p @ z, -p @ y], [100.0, 0.002, 0.3], rtol=1e-9)
    assert (p == 0).any() and (p >= 0).all()


def test_elastic_bodies_under_a_curved_face_against_full_matrices() -> None:
    """A block under a cylinder: body elasticity by its modes, gaps by the law, 1e-8 of the largest pressure."""
    body = block(brick("hexahedron20", (3, 4, 2), (0.02, 0.016, 0.012)), {"top": ("z1", (0.0, 1.0, 0.0))}, "z0")
    made, k = Component("low", {0: body.group}), 2e13
    found = nodal((made, "top"), tolerance=0.0)
    h = gap(found.points, (math.inf, 5.0))
    patch = Patch("top", found.points, found.areas, apart(springs(found.areas, k), h), found.shapes)
    side, _ = found.sides(ContactFace("low", "top"), None)
    p = pressure(patch, pressed_by(patch, 3e-6, static_compliance([(made, side, 1.0)])))
    face = body.group.interfaces["top"]
    N = np.einsum("i,pid->pd", face.rotation[0], body.motion["top"])
    closed = np.ones(len(h), dtype=bool)
    for _ in range(50):
        kn = np.where(closed, k * found.areas, 0.0)
        u = np.linalg.solve(body.K + N.T @ (kn[:, None] * N), N.T @ (kn * (h - 3e-6)))
        approach = 3e-6 - h + N @ u
        if ((approach > 0) == closed).all():
            break
        closed = approach > 0
    expected = k * np.maximum(approach, 0)
    assert 0.2 < closed.mean() < 0.8
    np.testing.assert_allclose(p, expected, rtol=0, atol=1e-8 * expected.max())


STEP = jax.jit(lambda law, path: law.step(path, jnp.zeros_like(path), 1.0, law.init(len(path)))[0])


def test_every_law_with_a_gap_begins_later() -> None:
    """Force at u + gap is that without at u, for smooth, rough, Iwan's and strips; given normal forces are refused."""
    h, u = jnp.asarray([0.0, 1e-6, 5e-6]), jnp.asarray([4e-6, 4e-6, 4e-6])
    rough = Rough(value(1e8), value(7.5e-6), Polynomial())
    laws = [PointContact(rough, COULOMB, value(1e8)), springs(np.ones(3), 1e8),
            Iwan(rough, jnp.asarray(0.3), jnp.asarray(1e8), *uniform(4)),
            rough_strips(1e8, 7.5e-6, Polynomial(), 8e7, 0.3, 12)]  # fmt: skip
    laws.append(Portion(laws[0], jnp.asarray(0.25)))

    def pressed(law: object, at: Array) -> Array:
        path = jnp.stack([at, jnp.zeros(3), jnp.zeros(3)], axis=1)
        return np.asarray(STEP(law, path)[:, 0])

    for law in laws:
        np.testing.assert_allclose(pressed(apart(law, h), u), pressed(law, u - h), rtol=1e-12)
    for law in (replace(laws[0], normal=Preload(value(10.0))), laws[3].under(10.0)):
        refused("the law's normal force is given", apart, law, h)
    for radii in ((0.0, 1.0), (1.0, -2.0)):
        refused("curvature: radii of", gap, np.zeros((1, 2)), radii)
