"""Rolling contact: Hertz for many poses, Kalker's linear theory, the strip model, profiles and poses, bad input."""

from __future__ import annotations

import csv
import re
import shutil
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from closed_forms.no_slip import extrapolated
from refusals import refused
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import microslip as ms
from microslip.cli import main
from microslip.contact.friction import Coulomb
from microslip.contact.hertz import Hertz
from microslip.contact.law import value
from microslip.contact.point import opposed, slide, weight
from microslip.contact.solids import Solid
from microslip.errors import UserError
from microslip.rolling.contact_table import ContactTable
from microslip.rolling.contact_table import forces as contact_forces
from microslip.rolling.ellipse import combined, ellipses
from microslip.rolling.profiles import CrossSection, polynomial
from microslip.rolling.strips import forces, poses
from microslip.rolling.wheelset import Track

CASE = Path(__file__).parents[1] / "pipeline" / "cases" / "wheel-rail.toml"
G, NU, MU = 82e9, 0.28, 0.3
STEEL = Solid(2 * G * (1 + NU), NU)
ELASTIC = combined(STEEL, STEEL)
PATCH = {"a": 8e-3, "b": 4e-3, "normal_force": 82e3, "friction": MU, "shear": G, "poisson": NU}
HELD = MU * PATCH["normal_force"]
DISTRIBUTIONS = ("constant", "non-constant")


def reduced(stress: float) -> float:
    """Creepage xi at which C11 G a b xi / (3 mu F_N) is so large (6.6-1)."""
    c11 = float(ms.creep_coefficients(PATCH["a"] / PATCH["b"], NU)[0])
    return stress * 3 * HELD / (c11 * G * PATCH["a"] * PATCH["b"])


# --- ellipse -------------------------------------------------------------------------------------------------------


def test_ellipses_of_many_poses_are_those_of_one_in_both_directions() -> None:
    A, B = np.array([0.8, 2.4, 1.0, 0.01]), np.array([2.4, 0.8, 1.0, 3.0])
    many = ellipses(A, B, 82e3, ELASTIC.modulus)
    for i in range(4):
        one = Hertz(STEEL, STEEL, A[i], B[i])
        a, b = one.semi_axes(82e3)
        found = [many.a[i], many.b[i], many.approach[i], many.pressure[i]]
        np.testing.assert_allclose(found, [a, b, one.approach(82e3), one.largest_pressure(82e3)], rtol=1e-12)
    np.testing.assert_allclose([many.a[0], many.b[0]], [many.b[1], many.a[1]], rtol=1e-12)


# --- Kalker's coefficients -----------------------------------------------------------------------------------------


def test_coefficients_at_the_rows_and_between_poissons_ratios() -> None:
    """Kalker's table E.3 and the values that follow from 1/C over nu."""
    found = np.asarray(ms.creep_coefficients([1.0, 2.0, 0.5], [0.25, 0.28, 0.28])).T[:, :3]
    expected = [[4.12, 3.67, 1.47], [5.2037, 4.9715, 2.6566], [3.7335, 3.0256, 0.94350]]
    np.testing.assert_allclose(found, expected, rtol=2e-5)


def test_the_books_polynomials_are_near_the_table() -> None:
    """(6.4-26) for nu = 0.3 between a/b = 0.1 and 10: 2 % by the errata."""
    ratio = np.geomspace(0.1, 10, 41)
    book, table = (np.asarray(ms.creep_coefficients(ratio, 0.3, source)) for source in ("book", "table"))
    assert np.abs(book[:2] / table[:2] - 1).max() < 0.04
    assert np.abs(book[:2] / table[:2] - 1).mean() < 0.015


@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
@pytest.mark.parametrize("ratio", [0.3, 1.0, 4.0])
def test_vanishing_creepage_gives_kalkers_linear_theory(ratio: float, distribution: str) -> None:
    """F_x = -c^2 G C11 xi, F_y = -c^2 G C22 eta - c^3 G C23 phi, exactly on any grid."""
    b, small = 4e-3, 1e-9
    a, c = ratio * b, b * np.sqrt(ratio)
    load = {"a": a, "b": b, "normal_force": 1e5, "friction": MU, "shear": G, "poisson": NU, "elements": (20, 20)}
    creep = small * np.diag([1, 1, 1 / c])
    f = ms.creep_forces(*creep, **load, distribution=distribution)
    c11, c22, c23, _ = np.asarray(ms.creep_coefficients(ratio, NU))
    expected = -(c**2) * G * small * np.array([[c11, 0, 0], [0, c22, c23]])
    np.testing.assert_allclose([f.x, f.y], expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


# --- the strip model -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("distribution", "at"), [("constant", 32 / (9 * np.pi)), ("non-constant", np.pi / 2)])
def test_everything_slides_from_the_reduced_creepage_on(distribution: str, at: float) -> None:
    """s* = 32/(9 pi) and pi/2: there the springs reach what is held at the leading edge already. But for the first
    element, in which the springs of the non-constant distribution are not those of its middle."""
    xi = reduced(at) * np.array([0.8, 1.01])
    f = ms.creep_forces(xi, 0, 0, **PATCH, distribution=distribution, elements=(80, 20))
    assert f.sliding[0] < 0.9 and f.x[0] > -0.997 * HELD
    assert f.sliding[1] > 0.99 and f.x[1] == pytest.approx(-HELD, rel=2e-4)


def test_moment_of_a_circle_that_only_spins() -> None:
    """Without any stick M_z = -mu int p r dA: 8/15 and 3 pi/16 of mu F_N a."""
    round_ = PATCH | {"b": PATCH["a"], "elements": (80, 20)}
    for distribution, share in (("constant", 8 / 15), ("non-constant", 3 * np.pi / 16)):
        f = ms.creep_forces(0, 0, 1e6, **round_, distribution=distribution)
        assert f.moment[0] == pytest.approx(-share * HELD * PATCH["a"], rel=3e-3)


def test_strips_converge_with_their_order() -> None:
    """Fitted over 10 to 80 elements along: second order for creepages, first where spin turns the slip; a thousandth
    of mu F_N off at 20."""
    creep = np.array([[1e-3, 0, 0], [0, 0, 0.3]]).T
    f = [ms.creep_forces(*creep, **PATCH, elements=(n, 20)) for n in (10, 20, 40, 80, 320)]
    error = np.array([np.hypot(one.x - f[-1].x, one.y - f[-1].y) for one in f[:-1]]) / HELD
    orders = -np.polyfit(np.log([10, 20, 40, 80]), np.log(error), 1)[0]
    assert 1.7 < orders[0] < 2.6 and 0.5 < orders[1] < 1.3
    assert error[1].max() < 2e-3


def test_strips_whose_springs_grow_to_the_edges_converge_as_well() -> None:
    """The non-constant distribution, whose stiffness is infinite at the edges: second order from little slip to nearly
    all, 0.0013 of mu F_N off at 20."""
    xi = reduced(1.0) * np.array([0.12, 0.6, 1.0, 1.3])
    f = [
        ms.creep_forces(xi, 0, 0, **PATCH, elements=(n, 20), distribution="non-constant").x / HELD
        for n in (10, 20, 40, 80, 320)
    ]
    assert -f[-1][0] < 0.3 and -f[-1][-1] > 0.95
    error = np.array([np.abs(one - f[-1]) for one in f[:-1]])
    assert (-np.polyfit(np.log([10, 20, 40, 80]), np.log(error), 1)[0] > 1.5).all()
    assert error[1].max() < 1.5e-3


def test_what_pure_spin_leaves_of_a_lateral_force() -> None:
    """Where all slides the exact one is 0; a slip that is taken half an element ahead leaves -1/n int p x_A y^2/r^3 dA,
    here by quadrature: an error of first order that two grids take out."""
    for ratio in (1.0, 2.0):
        a, b = ratio * PATCH["b"], PATCH["b"]
        f = [ms.creep_forces(0, 0, 1e5, **PATCH | {"a": a}, elements=(n, 60)).y[0] / HELD for n in (20, 40)]
        r, turn = ((np.arange(200) + 0.5) / 200)[:, None], 2 * np.pi * (np.arange(400) + 0.5) / 400
        x, y = a * r * np.cos(turn), b * r * np.sin(turn)
        ahead = a * np.sqrt(1 - (y / b) ** 2) * y**2 / np.hypot(x, y) ** 3
        limit = np.sum(2 / np.pi * (1 - r**2) * ahead * r) * 2 * np.pi / 400 / 200
        assert -20 * f[0] == pytest.approx(limit, rel=0.05)
        assert abs(2 * f[1] - f[0]) < 1e-3


def test_friction_takes_the_power_of_the_creepages() -> None:
    """Of the constant distribution, with errors of second order; the slip of (6.5-16), which leaves p' out, takes less:
    what mu p s_M is over the slip zone, here by quadrature of the closed form."""
    xi = 2e-3
    given = [ms.creep_forces(xi, 0, 0, **PATCH, elements=(n, 20)) for n in (20, 40, 80)]
    error = np.array([f.power[0] + f.x[0] * xi for f in given]) / given[-1].power[0]
    assert np.abs(error[-1]) < 5e-4
    assert np.log2(np.abs(error[0] / error[1])) > 1.5
    t = ms.tractions(xi, 0, 0, **PATCH, elements=(80, 20))
    exact = -np.sum((t.traction_x * t.slip_x + t.traction_y * t.slip_y) * t.area)
    assert exact == pytest.approx(given[-1].power[0], rel=2e-3)
    slides = np.hypot(t.traction_x, t.traction_y) > (1 - 1e-6) * MU * t.pressure
    printed = -np.sum((t.traction_x * xi * t.area)[slides])
    a, b = PATCH["a"], PATCH["b"]
    top, spring = 2 * HELD / (np.pi * a**3 * b), 3 * float(ms.creep_coefficients(a / b, NU)[0]) * G / (8 * a)
    y = b * (np.arange(2000) + 0.5) / 2000
    reach = a * np.sqrt(1 - (y / b) ** 2)
    to = np.minimum(spring * xi / top - reach, reach)  # from there to the trailing edge it slides
    closed = 2 * xi * top * np.sum((reach**2 * (to + reach) - (to**3 + reach**3) / 3)[to > -reach]) * b / 2000
    assert printed == pytest.approx(closed, rel=0.02)
    assert printed < 0.5 * exact


def test_a_strip_slides_sticks_and_slides_again_under_spin() -> None:
    t = ms.tractions(0, -6e-4, 0.8, **PATCH, elements=(80, 20))
    slides = (np.hypot(t.traction_x, t.traction_y) > (1 - 1e-6) * MU * t.pressure)[0, :, ::-1]
    assert any(s[0] and s[-1] and np.abs(np.diff(s.astype(int))).sum() == 2 for s in slides)


@pytest.mark.parametrize("distribution", [DISTRIBUTIONS[1], pytest.param(DISTRIBUTIONS[0], marks=pytest.mark.slow)])
def test_strips_are_point_contacts_element_by_element(distribution: str) -> None:
    """`PointContact` itself, marched with constant friction: the same forces, power and share that slides, rounded."""
    load = PATCH | {"distribution": distribution, "elements": (20, 20)}
    creep = np.array([3e-4, 2e-3, 2e-2]), 2e-4, 0.4
    fast = ms.creep_forces(*creep, **load)
    law = ms.forces_by_characteristic(*creep, **load | {"friction": Coulomb(value(MU))}, speed=20.0)
    for name, one, other in zip(fast._fields, fast, law, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12 * HELD, err_msg=name)


def test_without_friction_nothing_is_held() -> None:
    f = ms.creep_forces(1e-3, 1e-3, 0.2, **PATCH | {"friction": 0.0})
    assert np.abs([f.x, f.y, f.moment, f.power]).max() < 1e-6


def test_mirrored_creepages_give_mirrored_forces() -> None:
    """y -> -y turns lateral creepage and spin round, and with them F_y and M_z."""
    f = ms.creep_forces([1e-3, 1e-3], [5e-4, -5e-4], [0.2, -0.2], **PATCH)
    np.testing.assert_allclose(f.x[0], f.x[1], rtol=1e-12)
    np.testing.assert_allclose([f.y[0], f.moment[0]], [-f.y[1], -f.moment[1]], rtol=1e-9)


def test_totals_are_those_of_the_tractions() -> None:
    how = PATCH | {"distribution": "non-constant"}
    f, t = ms.creep_forces(1e-3, 4e-4, 0.2, **how), ms.tractions(1e-3, 4e-4, 0.2, **how)
    moment = ((t.x * t.traction_y - t.y * t.traction_x) * t.area).sum()
    np.testing.assert_allclose([(t.traction_x * t.area).sum(), (t.traction_y * t.area).sum(), moment],
                               [f.x[0], f.y[0], f.moment[0]], rtol=1e-10)  # fmt: skip
    assert (t.pressure * t.area).sum() == pytest.approx(PATCH["normal_force"], rel=1e-12)
    assert (t.power * t.area).sum() == pytest.approx(f.power[0], rel=1e-12)
    assert np.pi * PATCH["a"] * PATCH["b"] == pytest.approx(t.area.sum(), rel=2e-3)
    assert (np.hypot(t.traction_x, t.traction_y) <= (1 + 1e-5) * MU * t.pressure).all()
    assert (np.diff(t.x) > 0).all() and (np.diff(t.y, axis=1) > 0).all()


def test_forces_are_pure_and_have_derivatives() -> None:
    """The derivative of the force with respect to the creepage, beside a difference quotient."""
    one = jnp.ones(3)

    @jax.jit
    def along(xi):
        given = (xi, *(one * v for v in (3e-4, 0.2, 8e-3, 4e-3, 82e3, MU, G, NU)))
        shifted = lambda xi: forces(poses(xi, *given[1:], elements=(6, 6)), (6, 6)).x  # noqa: E731
        return jax.jvp(shifted, (xi,), (one,))

    force, slope = along(8e-4 + 1e-8 * jnp.array([-1.0, 0.0, 1.0]))
    assert slope[1] == pytest.approx(float(force[2] - force[0]) / 2e-8, rel=1e-5)


def test_the_short_return_is_that_of_the_point_contact() -> None:
    """`point.opposed` beside `point.slide`, stiffnesses of a ratio up to 2, forces up to ten times what is held."""
    random = np.random.default_rng(2)
    trial = random.normal(size=(2, 2000)) * 10 ** random.uniform(-1, 1, 2000)
    relative = np.stack([np.ones(2000), random.uniform(0.5, 1, 2000)])

    @jax.jit
    def both(trial: jax.Array, relative: jax.Array, held: jax.Array) -> tuple:
        theta = slide(trial, relative, relative, Coulomb(value(1.0)), held, 1.0, 0.0)
        return theta, trial * weight(theta, relative), opposed(tuple(trial), tuple(relative), held)

    theta, exact, (shares, slides) = both(trial, relative, np.ones(2000))
    assert np.abs(np.stack(shares) * trial - exact).max() < 1e-4
    np.testing.assert_array_equal(slides, theta < 1)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"normal_force": [1e5, -1e5]}, "normal_force: must be greater than 0 (entry 2 is -100000)"),
        ({"a": 0.0}, "a: must be greater than 0 (it is 0)"), ({"spin": "none"}, "'kalker' or 'book'"),
        ({"elements": (0, 20)}, ("elements: is ", " whole numbers")),
        ({"eta": [0.0] * 3, "xi": [1e-3] * 2}, "shapes do not go together: xi (2,), eta (3,)"),
    ],
)  # fmt: skip
def test_states_that_are_none_are_refused(wrong: dict, said: str) -> None:
    for model in (ms.creep_forces, ms.tractions):
        refused(said, model, **{"xi": 1e-3, "eta": 0.0, "phi": 0.1, **PATCH, **wrong})


TRACK = {"wheel": ms.circle(0.5), "rail": ms.circle(0.3), "radius": 0.46, "wheel_at": 0.75, "rail_at": 0.75}
STATE = {"xi": 1e-3, "eta": 0.0, "phi": 0.0, **PATCH}


def test_a_read_table_refuses_what_is_no_state() -> None:
    table = ms.creep_table(NU, points=(4,) * 5, elements=(4, 4), checked=1)
    state = {k: v for k, v in STATE.items() if k != "poisson"}
    for key, v in (("friction", -0.3), ("xi", np.nan), ("normal_force", -1.0), ("shear", "x"), ("a", 0.0)):
        refused(key, table.forces, **{**state, key: v})
    assert np.isfinite(table.forces(**{**state, "friction": 0.0})).all()


def test_all_of_a_patch_slides_and_not_more() -> None:
    """The shares of the strips make one, however few they are, elements given as a list too."""
    f = ms.creep_forces([1.0, 0.0], [0.0, -1.0], 0.0, **PATCH, elements=[20, 20])
    np.testing.assert_allclose(f.sliding, 1, rtol=1e-13)


# --- tables --------------------------------------------------------------------------------------------------------


def test_a_table_tells_its_error_and_is_read_with_it(tmp_path: Path) -> None:
    """States of any sign and size, against the model itself: within the error that the file tells, and the finer the
    table, the nearer."""
    points = (5, 5, 5, 5, 4), (9, 9, 11, 11, 7)
    tables = [ms.creep_table(NU, points=n, elements=(20, 20), checked=2000) for n in points]
    table = ms.read_creep_table(ms.write_creep_table(tmp_path / "t.h5", tables[1]))
    random = np.random.default_rng(5)
    given = [random.normal(size=400) * s for s in (2e-3, 2e-3, 0.4)] + [8e-3, 4e-3, 82e3, MU]
    f = ms.creep_forces(*given, G, NU)
    size = HELD * np.array([[1.0], [1.0], [np.sqrt(32e-6)]])
    error = np.abs(table.forces(*given, G) - np.array([f.x, f.y, f.moment])) / size
    assert (error.max(axis=1) <= 1.2 * table.error[:, 2]).all()
    assert (table.error[:, 0] < 0.5 * tables[0].error[:, 0]).all()
    one = [float(np.ravel(v)[0]) for v in given]
    np.testing.assert_allclose(table.forces(*one, G), table.forces(*given, G)[:, 0], rtol=1e-12)
    refused("a/b is 6", table.forces, 1e-3, 0, 0, 6e-3, 1e-3, 82e3, MU, G)
    refused("write a table of creep forces", ms.read_creep_table, CASE)


# --- profiles and poses --------------------------------------------------------------------------------------------


def track(wheel: CrossSection | None = None, rail: CrossSection | None = None) -> Track:
    """Two circles: a hollow wheel of 0.5 m on a rail of 0.3 m."""
    return Track(wheel or ms.circle(0.5), rail or ms.circle(0.3), 0.46, 0.75, 0.75, ELASTIC)


def test_circles_touch_where_their_slopes_are_one() -> None:
    """y / 0.3 = (y - 4 mm) / 0.5, so y = -6 mm; A = 1/(2 r), B = (1/0.3 - 1/0.5)/2 but for the angle of 0.02 rad."""
    (p,) = ms.patches(track(), ms.Pose(lateral=4e-3, speed=20.0), "right", 1e5)
    np.testing.assert_allclose([p.on_rail, p.on_wheel], [-6e-3, -10e-3], atol=5e-6)
    np.testing.assert_allclose([p.A, p.B], [1 / 0.92, (1 / 0.3 - 1 / 0.5) / 2], rtol=2e-3)
    exact = ellipses(p.A, p.B, p.normal_force, ELASTIC.modulus)
    np.testing.assert_allclose([p.a, p.b, p.approach], [exact.a, exact.b, exact.approach], rtol=1e-3)
    assert p.normal_force * np.cos(p.angle) == pytest.approx(1e5, rel=1e-6)
    assert p.phi == pytest.approx(0.02 / 0.46, rel=2e-3)


def test_left_and_right_wheels_mirror() -> None:
    """A pose and its mirror image: the left wheel of the one is the right wheel of the other."""
    pose = ms.Pose(3e-3, 2e-3, 1e-3, 20.0)
    left = ms.patches(track(), ms.Pose(3e-3, 2e-3, 1e-3, 20.0), "left", 1e5)[0]
    right = ms.patches(track(), pose.mirrored(), "right", 1e5)[0]
    np.testing.assert_allclose(left.place, right.place * [1, -1, 1], atol=1e-12)
    np.testing.assert_allclose([left.xi, left.eta, left.phi], [right.xi, -right.eta, -right.phi], rtol=1e-12)


STEEP = {"wheel": ms.circle(0.025, 0.044), "rail": ms.circle(0.02, 0.0355)}
"""Touch at 55 degrees for a shift of 4.1 mm to the flange, as y/0.02 = (y - 4.1 mm)/0.025."""


def turned(about: int, angle: float) -> np.ndarray:
    """Rotation matrix about an axis of x, y, z."""
    return np.asarray(Rotation.from_rotvec(angle * np.eye(3)[about]).as_matrix())


def moved(of: Track, pose: ms.Pose, p: Any, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Where the point of the wheel that touches at the time 0 is, and how the wheel is turned: a rigid body that
    moves forward and turns about its axle, which is yawed and rolled."""
    stands = turned(2, pose.yaw) @ turned(0, pose.roll)
    side = 1.0 if p.side == "right" else -1.0
    radius = of.radius + float(of.wheel.height(p.on_wheel))
    across = side * (of.wheel_at + p.on_wheel)

    def circle(angle: float) -> np.ndarray:
        return np.array([radius * np.sin(angle), across, radius * np.cos(angle)])

    angle = brentq(lambda v: (stands @ circle(v))[0] - p.place[0], -0.3, 0.3, xtol=1e-12)
    assert (stands @ circle(angle))[1] + pose.lateral == pytest.approx(p.place[1], abs=1e-7)
    assert pose.turning is not None
    turn = stands @ turned(1, -pose.turning * time)
    return turn @ circle(angle) + [pose.speed * time, pose.lateral, 0.0], turn


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("yaw", [0.02, -0.012])
def test_creepages_are_those_of_the_wheels_rigid_motion(side: str, yaw: float) -> None:
    """On the tread and on a flange of 58 degrees, the contact's velocity by differences of the wheel's motion in time;
    there the usual omega r sin(yaw) cos(angle)/V is a third of it."""
    toward = 1.0 if side == "right" else -1.0
    for shape, lateral, steepest in ((STEEP, 2.26e-3, 1.0), ({}, 2.2e-3, 0.02)):  # 1.8 mm by the roll
        of = track(**shape)
        pose = ms.Pose(toward * lateral, yaw, toward * -0.004, 3.0, 6.4)
        (p,) = ms.patches(of, pose, side, 1e4)
        assert abs(p.angle) == pytest.approx(steepest, abs=0.1)
        h = 1e-4
        (after, turned_after), (before, turned_before) = (moved(of, pose, p, t) for t in (h, -h))
        velocity = (after - before) / (2 * h)
        spin = Rotation.from_matrix(turned_after @ turned_before.T).as_rotvec() / (2 * h)
        c, s = np.cos(p.angle), np.sin(p.angle)
        up, left = np.array([0.0, s, -c]), np.array([0.0, -c, -s])
        V = 3.0 - 0.5 * velocity[0]
        assert p.speed == pytest.approx(V, rel=1e-6)
        assert p.xi == pytest.approx(velocity[0] / V, abs=1e-6)
        assert p.eta == pytest.approx(left @ velocity / V, abs=1e-6)
        assert p.phi == pytest.approx(up @ spin / V, abs=1e-6)
        assert abs(up @ velocity) < 0.02 * abs(left @ velocity)  # it neither lifts off nor digs in
        gentle = 6.4 * 0.46 * np.sin(yaw) * c / V
        assert p.eta / gentle == pytest.approx(1 / c**2, rel=0.05)


@pytest.mark.parametrize("yaw", [0.02, -0.012])
@pytest.mark.parametrize("side", ["left", "right"])
def test_a_wheel_is_in_equilibrium_with_its_friction(side: str, yaw: float) -> None:
    """Vertical forces on a flange; moments about the axle by the power of the rigid motion: forces on the wheel times
    its velocities are what friction takes. N = P/(cos +- F_y/N sin)."""
    of, mu = track(**STEEP), 0.3
    toward = 1.0 if side == "right" else -1.0
    pose = ms.Pose(toward * 4.1e-3, yaw, 0.0, 3.0, 6.6)
    (p,) = ms.patches(of, pose, side, 1e4, mu)
    f = ms.creep_forces(p.xi, p.eta, p.phi, p.a, p.b, p.normal_force, mu, G, NU)
    felt = p.felt(f.x[0], f.y[0], f.moment[0], np.array([0.0, *p.axle]))
    assert -felt[2] == pytest.approx(1e4, rel=1e-7)
    axle = turned(2, yaw) @ [0, 1, 0]
    power = felt[0] * pose.speed - pose.turning * felt[3:] @ axle
    slip = f.x[0] * p.xi + f.y[0] * p.eta + f.moment[0] * p.phi
    assert power == pytest.approx(slip * p.speed, rel=0.02)  # N moves by 4e-4 of the speed
    climbs = np.sign(yaw) * toward  # towards the flange, friction carries
    steep, across = abs(p.angle), -climbs * toward * f.y[0] / p.normal_force
    assert 0.15 < across <= mu
    carried = np.cos(steep) + climbs * across * np.sin(steep)
    assert carried == pytest.approx(1e4 / p.normal_force, rel=1e-7)
    alone = ms.patches(of, pose, side, 1e4)[0]
    assert alone.normal_force == pytest.approx(1e4 / np.cos(alone.angle), rel=1e-7)
    assert climbs * np.log(alone.normal_force / p.normal_force) > 0.15


def test_friction_that_holds_a_wheel_down_is_told() -> None:
    """mu tan(60 degrees) > 1: no normal force lifts a wheel that runs down its flange."""
    pose = ms.Pose(4.1e-3, -0.02, 0.0, 3.0, 6.6)
    refused("friction drags the wheel down", ms.patches, track(**STEEP), pose, "right", 1e4, 0.9)


def test_an_axle_shares_its_load_by_its_roll() -> None:
    """Level, both wheels carry half, as each alone would; turned by more than their approach, one carries all."""
    left, right, _ = ms.axle(track(), ms.Pose(speed=20.0), 2e5)
    (alone,) = ms.patches(track(), ms.Pose(speed=20.0), "right", 1e5)
    np.testing.assert_allclose([right[0].normal_force, left[0].normal_force], alone.normal_force, rtol=1e-6)
    left, right, _ = ms.axle(track(), ms.Pose(roll=2e-3), 1e5)
    assert not left and right[0].normal_force * np.cos(right[0].angle) == pytest.approx(1e5, rel=1e-6)
    left, right, pose = ms.axle(track(), ms.Pose(lateral=3e-3, roll=0.01), 2e5, even=True)
    lifted = [p.normal_force * np.cos(p.angle) for p in (*left, *right)]
    np.testing.assert_allclose(lifted, 1e5, rtol=1e-5)
    assert ms.axle(track(), pose, 0.0)[:2] == ([], [])


def test_two_patches_share_the_vertical_force_by_their_stiffness() -> None:
    """A rail with two equal crowns below a flat wheel: half each, and Hertz' force of the approach in both."""
    y = np.linspace(-0.03, 0.03, 1201)
    z = np.minimum((y - 0.012) ** 2, (y + 0.012) ** 2) / 0.2
    rail = CrossSection(y, np.minimum(z, 6e-4))
    found = ms.patches(track(polynomial([0.0]), rail), ms.Pose(), "right", 5e4)
    assert len(found) == 2
    np.testing.assert_allclose(sorted(p.on_rail for p in found), [-0.012, 0.012], atol=1e-4)
    np.testing.assert_allclose([p.normal_force for p in found], 2.5e4, rtol=1e-3)
    exact = ellipses(1 / 0.92, 5.0, 2.5e4, ELASTIC.modulus)
    np.testing.assert_allclose([p.approach for p in found], exact.approach, rtol=1e-2)


@pytest.fixture(scope="module")
def contacts() -> ContactTable:
    return ms.contact_table(track(), 1e5, 4e-3, 0.02, points=(6, 2), checked=2)


def test_a_table_of_contacts_is_the_axle_between_its_poses(contacts: ContactTable, tmp_path: Path) -> None:
    """Patches, creepages, forces and moments of both wheels at a pose beside those of `axle`, through a file."""
    table = ms.read_contact_table(ms.write_contact_table(tmp_path / "t.h5", contacts))
    at = ms.Pose(2.9e-3, -0.013, 0.0, 20.0, 44.0)
    left, right, pose = ms.axle(track(), at, 2e5, even=True, friction=MU)
    read = table.forces([2.9e-3, 0.0], -0.013, 20.0, MU, turning=44.0)
    assert read.roll[0] == pytest.approx(pose.roll, abs=1e-8) and not read.jumps.any()
    for k, (p,) in enumerate((left, right)):
        got = [v[0, k, 0] for v in (read.patches.ahead, read.patches.y, read.patches.z, read.xi, read.eta, read.phi)]
        np.testing.assert_allclose(got, [*p.place, p.xi, p.eta, p.phi], rtol=1e-4, atol=1e-7)
        f = ms.creep_forces(p.xi, p.eta, p.phi, p.a, p.b, p.normal_force, MU, G, NU)
        felt = p.felt(f.x[0], f.y[0], f.moment[0], np.array([0.0, *p.axle]))
        np.testing.assert_allclose(read.felt[0, k, :3], felt[:3], atol=1e-4 * MU * 1e5)
        np.testing.assert_allclose(read.felt[0, k, 3:], felt[3:], atol=1e-4 * MU * 1e5)
    assert (table.error[3, 2], table.checked, table.jumping) < (1e-3, 4, 1e-9)


def test_a_table_of_contacts_is_read_for_other_loads_and_creepages(contacts: ContactTable) -> None:
    """Hertz' axes of the load on each wheel; creepages add; mirrored poses; no load, no force; as a pure function."""
    y, yaw = np.array([3e-3, -3e-3]), np.array([0.01, -0.01])
    read = contacts.forces(y, yaw, 20.0, MU, load=[8e5, 0.0], xi=1e-3)
    plain = contacts.forces(y, yaw, 20.0, MU)
    np.testing.assert_allclose(read.patches.a[:, 0], 2 * plain.patches.a[:, 0], rtol=1e-4)
    np.testing.assert_allclose(read.felt[:, 0, 2], -8e5, rtol=1e-6)
    np.testing.assert_allclose(read.xi, plain.xi + 1e-3, rtol=1e-12)
    yawing = contacts.forces(y, yaw, 20.0, MU, xi=[[1e-3, -1e-3]])
    np.testing.assert_allclose(yawing.xi[..., 0], plain.xi[..., 0] + [1e-3, -1e-3], rtol=1e-12)
    alone = contacts.forces(y, yaw, 20.0, MU, xi=-1e-3)
    np.testing.assert_allclose(yawing.felt[:, 1], alone.felt[:, 1], rtol=1e-12)
    assert (read.felt[:, 1] == 0).all()
    np.testing.assert_allclose(plain.felt[0, 0], plain.felt[1, 1] * [1, -1, 1, -1, 1, -1], rtol=1e-9, atol=1e-6)
    flat = [np.full(2, v) for v in (20.0, MU, 20 / 0.46, 0.0, 0.0, 0.0)]
    pure = jax.jit(lambda y: contact_forces(contacts, y, yaw, *flat, np.full((2, 2), 1e5)).felt)
    np.testing.assert_allclose(pure(y), plain.felt, rtol=1e-9, atol=1e-6)
    for wrong, said in (
        ({"lateral": 5e-3}, "lateral: is 0.005"),
        ({"speed": 0.0}, "speed"),
        ({"load": -1.0}, "load"),
        ({"load": [1e5] * 3}, "load: shapes"),
        ({"lateral": [0.0] * 3, "xi": [0.0] * 2}, "shapes"),
    ):
        given = {"lateral": 0.0, "yaw": 0.0, "speed": 20.0, "friction": MU} | wrong
        refused(said, contacts.forces, **given)


def test_jumps_are_flagged_and_not_read_across() -> None:
    """A rail with two crowns below a convex wheel, which touches both in the middle and one of them on either side."""
    y = np.linspace(-0.03, 0.03, 1201)
    z = np.minimum((y - 0.012) ** 2, (y + 0.012) ** 2) / 0.2
    two = track(polynomial([-1.0]), CrossSection(y, np.minimum(z, 6e-4)))
    table = ms.contact_table(two, 2e4, 3e-3, 0.01, points=(5, 2), checked=1)
    assert (table.jumping, "not known" in table.sentence()) in ((1.0, True), (0.0, False))
    read = table.forces(np.linspace(-3e-3, 3e-3, 25), 0.0, 1.0, MU)
    there = read.patches.normal_force > 0
    assert set(there.sum(axis=-1).ravel()) == {1, 2} and 0 < read.jumps.mean() < 0.5
    assert (np.abs(np.abs(read.patches.on_rail[there]) - 0.01) < 1e-3).all()  # between the crowns there is none
    changes = (np.diff(there.sum(axis=-1), axis=0) != 0).any(axis=1)
    assert (read.jumps[1:].any(axis=1) | read.jumps[:-1].any(axis=1))[changes].all()


def test_wheels_off_the_rail_have_no_patch() -> None:
    assert ms.patches(track(), ms.Pose(), "right", 0.0) == []


def test_profiles_are_read_with_their_header(tmp_path: Path) -> None:
    """mirror.y and the unit of a .prw; a table with commas; both are one curve, whatever the order of its points."""
    y = np.linspace(-30, 30, 61)
    z = y**2 / 600
    body = "\n".join(f"{a} {b}" for a, b in zip(-y / 1e3, z / 1e3, strict=True))
    text = f"! a wheel\nmirror.y = 1 ! yes\nunits.len.f = 1.0\npoint.begin\n!1 2\n{body}\npoint.end\n"
    (tmp_path / "w.prw").write_text(text)
    (tmp_path / "w.csv").write_text("y,z\n" + "\n".join(f"{a},{b}" for a, b in zip(y, z, strict=True)))
    one, other = (ms.read_profile(tmp_path / name) for name in ("w.prw", "w.csv"))
    np.testing.assert_allclose(one.height([-0.02, 0.01]), other.height([-0.02, 0.01]), atol=1e-12)
    assert one.height(0.02) == pytest.approx(0.4 / 600, rel=1e-6)


def test_profiles_of_miniprof(tmp_path: Path) -> None:
    """Keys before the points, columns of angle and curvature, points marked as left out; y or z the other way."""
    y = np.linspace(-30, 30, 61)
    rows = [f"{a:.4f}\t{-(a**2) / 600:.6f}\t0.1 -0.003" for a in y]
    rows[7] = '" ' + rows[7]
    points = "\n".join(rows)
    head = 'Filename=r.ban\nXOffset=0.0000\n"ColumnDef=X,Y,A"\nRefPoint1=0.0, 0.0\nColumnDef=X,Y,A,C\n\n'
    (tmp_path / "r.ban").write_text(head + points)
    found = ms.read_profile(tmp_path / "r.ban", mirror="yz", between=(-0.02, 0.03))
    assert len(found.y) == 50 and found.y[0] == -0.02  # one of 51 is left out
    np.testing.assert_allclose(found.height([-0.0185, 0.0205]), np.array([-0.0185, 0.0205]) ** 2 / 0.6, atol=1e-9)
    (tmp_path / "r.ban").write_text(head.replace("0.0000", "1.5") + points)
    (tmp_path / "w.csv").write_text("\n".join(f"{a},{b}" for a, b in zip(y, -(y**2) / 30, strict=True)))
    refused("upside down", ms.read_profile, tmp_path / "w.csv")
    refused("XOffset", ms.read_profile, tmp_path / "r.ban")


def test_an_inclined_circle_is_the_same_circle() -> None:
    """A rail canted by 1:40 about its axis keeps its curvature; the highest point stays the origin."""
    arc = ms.circle(0.3).turned(0.025)
    np.testing.assert_allclose(arc.height([0.0, 0.01]), [0, 0.3 - np.sqrt(0.09 - 1e-4)], atol=2e-7)


# --- the verb ------------------------------------------------------------------------------------------------------


def test_a_case_makes_its_curve_pictures_and_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Numbers of the table are those of the library; once more there is nothing to do."""
    shutil.copy(CASE, tmp_path / "case.toml")
    monkeypatch.chdir(tmp_path)
    assert main(["roll", "case.toml", "--set", "creep.points=21", "--set", "model.exact=2"]) == 0
    folder = tmp_path / "build" / "wheel-rail"
    assert {p.name for p in (folder / "pictures").iterdir()} == {"creep.png", "tractions.png"}
    rows = list(csv.DictReader((folder / "creep.csv").open()))
    patch = next(csv.DictReader((folder / "patches.csv").open()))
    assert patch.pop("side") == "right"
    patch = {k: float(v) for k, v in patch.items()}
    row = {k: float(v) for k, v in rows[3].items()}
    solid = Solid(2.1e11, 0.28)
    f = ms.creep_forces(row["longitudinal_creepage"], row["lateral_creepage"], row["spin_1_per_m"], patch["a_m"],
                        patch["b_m"], patch["normal_force_N"], 0.3, solid.shear, 0.28)  # fmt: skip
    np.testing.assert_allclose(
        [row["F_x_forward_N"], row["F_y_left_N"], row["M_z_up_Nm"]], [f.x[0], f.y[0], f.moment[0]], rtol=1e-4
    )
    said = capsys.readouterr().out
    assert re.search(r"largest creep force is 1 mu F_N", said)
    assert "data:image/webp" in (folder / "rolling.html").read_text()
    meshio = pytest.importorskip("meshio")
    shown = min(rows, key=lambda row: abs(float(row["longitudinal_creepage"]) - 0.0015))
    cells = {name: of[0] for name, of in meshio.read(folder / "tractions.vtu").cell_data.items()}
    sums = [*(cells["area"] @ cells["traction"])[:2], cells["area"] @ cells["pressure"]]
    expected = [float(shown["F_x_forward_N"]), float(shown["F_y_left_N"]), patch["normal_force_N"]]
    np.testing.assert_allclose(sums, expected, rtol=1e-5)


WRONG = {
    "a wheel in millimetres": ("wheel.radius=460", "wheel.radius"),
    "pulled off": ("vertical_force=-1", "vertical_force"),
    "no overlap": ("rail.at=0.9", "overlap"),
    "no file": ('rail.profile="none.prr"; rail.at=0.76; wheel.at=0.75', "none.prr"),
    "friction in percent": ("friction=30", "friction"),
    "flat": ("rail.width=1.0", "radius"),
    "a track in millimetres": ("rail.at=750", "rail.at"),
    "coefficients of another unit": ("rail.profile=[1e9]", "rail: a profile of coefficients"),
    "no radius": ("wheel.profile=0", "wheel: a profile of radius 0 m"),
    "a measured profile that stands anywhere": ('rail.profile="UIC60.prr"; wheel.at=0.75', "rail.at"),
    "files exchanged": ('rail.profile="S1002.prw"; rail.at=0.75; wheel.at=0.75', "exchange wheel and rail"),
    "nothing to run over": ("creep.stop=0.0", "creep"),
    "no friction": ("friction=0", "friction"),
    "off the edge of the rail": ("rail.width=0.002", "profile ends"),
    "noise in mm": ("wheel.noise=0.01", "wheel.noise"),
    "a key that is none": ("creep.form=1", "creep.form"),
    "a table that is none": ('wheel.profile="case.toml"', "case.toml"),
    "heated by what is not there": ('friction={kind="heated", mu_0=0.4}', "heat.limit"),
    "random in time": ('friction={kind="falling", mu_0=0.4, p_v=1.0, deviation=0.1}', "friction.deviation"),
    "no file of friction": ('friction={kind="table", file="mu.csv"}', "mu.csv"),
    "friction that vanishes": ('friction={kind="falling", mu_0=0, p_v=1.0}', "friction: is 0"),
    "lighter than nothing": ("heat.density=-1", "heat.density"),
    "below absolute zero": ("heat.start=-300", "heat.start"),
    "wear that adds": ("wear.coefficient=-1", "wear.coefficient"),
    "a table of contacts without a load": ("contacts={lateral=0.004, yaw=0.01}; vertical_force=0", "contacts: "),
    "contacts beyond the rail": ("contacts={lateral=0.04, yaw=0.01, points=[4, 4]}; model.exact=0", "smaller reach"),
    "profiles renewed by nothing": ("wear={coefficient=1e-13, updates=3}", "passages"),
    "a roll that follows": ('pose={side="both", roll=0.001}', "pose.roll"),
    "two wheels that wear": ('pose.side="both"; wear={coefficient=1e-13, updates=3, passages=1e5}', "wear.updates"),
    "rough by nothing": ("roughness=0", "roughness"),
    "rough in um": ("roughness=5", "roughness: R_Z"),
    "a table of smooth bodies": ("table={}; roughness=1e-5", "table"),
    "a table of constant friction": ("table={}; heat.limit=300", "table"),
}


@pytest.mark.parametrize("what", WRONG)
def test_bad_input_is_one_sentence(
    what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(CASE, tmp_path / "case.toml")
    monkeypatch.chdir(tmp_path)
    settings, named = WRONG[what]
    sets = [word for setting in settings.split("; ") for word in ("--set", setting)]
    assert main(["roll", "case.toml", *sets, "-q"]) == 2
    said = capsys.readouterr().err.strip()
    assert named in said and len(said.splitlines()) == 1
    assert not (tmp_path / "build" / "wheel-rail" / "rolling.html").exists()


TABLES = {
    "numbers its rows": "1,-20,3\n2,-10,1\n3,0,0\n4,10,1\n5,20,3",
    "names what is no profile": "index,z\n1,3\n2,1\n3,0\n4,1\n5,3",
    "has decimal commas": "-20,5;3,1\n-10,5;1,1\n0,5;0\n10,5;1,1\n20,5;3,1",
    "has decimal commas and blanks": "-20,5 3,1\n-10,5 1,1\n0,5 0\n10,5 1,1\n20,5 3,1",
    "has decimal commas and commas": "-20,5,3,1\n-10,5,1,1\n0,5,0,0\n10,5,1,1\n20,5,3,1",
}


@pytest.mark.parametrize("what", TABLES)
def test_a_table_that_is_no_profile_is_refused(what: str, tmp_path: Path) -> None:
    """It was read by its first two numbers."""
    (tmp_path / "p.csv").write_text(TABLES[what])
    with pytest.raises(UserError, match="columns|decimal commas"):
        ms.read_profile(tmp_path / "p.csv")


def test_columns_of_a_profile_are_those_that_its_head_names(tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text("worn_mm,z_mm,y_mm\n" + "\n".join(f"9,{y * y / 400},{y}" for y in range(-20, 21)))
    p = ms.read_profile(tmp_path / "p.csv")
    np.testing.assert_allclose(p.z, p.y**2 / 0.4, atol=1e-15)


@pytest.mark.parametrize("mirror", ["", "z"])
def test_a_profile_upside_down_is_told_which_mirror_turns_it(mirror: Any, tmp_path: Path) -> None:
    """The one that is set is not asked for."""
    y = np.linspace(-30, 30, 61)
    up = -1 if mirror else 1
    z = up * np.where(y < 25, 0.0, (y - 25) * -5.0)
    np.savetxt(tmp_path / "p.csv", np.column_stack([y, z]), delimiter=",")
    turns = f"set mirror = {'' if mirror else 'z'!r}"
    refused(turns, ms.read_profile, tmp_path / "p.csv", mirror=mirror)


def test_an_inclined_rail_stands_by_its_highest_point() -> None:
    """A circle of 0.3 m inclined by 25 mrad is highest 7.5 mm beside its origin."""
    turned = ms.circle(0.3).turned(0.025)
    assert turned.moved[0] == pytest.approx(0.3 * np.sin(0.025), rel=1e-3)
    assert turned.moved[1] == pytest.approx(0.3 * (1 - np.cos(0.025)), rel=1e-3)
    assert float(turned.height(0.0)) == pytest.approx(0.0, abs=1e-12)


def test_profiles_that_turn_back_are_named(tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text("\n".join(f"{y},0" for y in (0, 10, 20, 15, 30, 40)))
    refused("turns back or crosses itself at point 4", ms.read_profile, tmp_path / "p.csv")


def test_what_should_be_doubted_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """No contact has no forces; bodies that conform and friction above 1.5 are warnings."""
    shutil.copy(CASE, tmp_path / "case.toml")
    monkeypatch.chdir(tmp_path)
    few = ["--set", "creep.points=3", "--set", "model.exact=0", "--no-pictures", "-q"]
    close = ["--set", "friction=1.6", "--set", "wheel.profile=-0.301", "--set", "pose.lateral=0"]
    assert main(["roll", "case.toml", *close, *few[:-1]]) == 0
    said = capsys.readouterr().out
    assert "friction is 1.6" in said and "conform" in said
    assert main(["roll", "case.toml", "--set", "vertical_force=0", *few[:-1]]) == 0
    assert "all forces are zero" in capsys.readouterr().out
    left = {p.name for p in (tmp_path / "build" / "wheel-rail").iterdir()}
    assert left.isdisjoint({"creep.csv", "exact.csv", "forces.csv"}) and "patches.csv" in left


@pytest.mark.slow
def test_the_table_of_coefficients_is_that_of_the_half_space() -> None:
    """C33, computed, and the other three, published, between rows too: to 1.5 %."""
    for ratio, nu in ((1.0, 0.25), (0.15, 0.25), (1 / 0.15, 0.25), (0.1, 0.5), (10.0, 0.0), (0.55, 0.3)):
        c11, c22, c23, other, c33 = extrapolated(ratio, nu)
        assert other == pytest.approx(c23, rel=5e-3)  # the force of spin is the moment of creepage
        np.testing.assert_allclose(np.asarray(ms.creep_coefficients(ratio, nu)), [c11, c22, c23, c33], rtol=0.015)
