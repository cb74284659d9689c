"""Patches that deform: against full matrices, against the rigid patch, against meshes that do not match."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest
import sector
import small
from blocks import Block, block
from meshes import brick
from refusals import refused

from microslip.contact.friction import Coulomb
from microslip.contact.law import value
from microslip.contact.normal import Penalty
from microslip.contact.patch import Patch, equilibrium, pressed_by, pressure
from microslip.contact.point import PointContact
from microslip.data import Array, ModalGroup
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance import response
from microslip.harmonic_balance.solver import solve
from microslip.modal.compute import modal_basis
from microslip.settings.body import BodySettings
from microslip.system.assembly import Assembly, ContactFace, Load, Output, preloaded_contact
from microslip.system.component import Component, Ring
from microslip.system.nodal import interpolation, nodal, static_compliance
from microslip.system.pairing import facing, rigid_points

FOUNDATION = 2e13  # N/m3, stiffness of the surface per area
T2 = (0.0, 1.0, 0.0)
SIZE = (0.02, 0.016, 0.012)


def law(areas: Array, mu: float = 0.3) -> PointContact:
    return PointContact(Penalty(value(FOUNDATION * areas)), Coulomb(value(mu)),
                        jnp.asarray(0.8 * FOUNDATION * areas))  # fmt: skip


@cache
def low(n: tuple[int, int, int] = (2, 2, 2), young: float = 2.1e11) -> Block:
    """Held below, touched above."""
    return block(brick("hexahedron20", n, SIZE), {"top": ("z1", T2)}, "z0", young=young)


@cache
def high(n: tuple[int, int, int] = (2, 2, 2), young: float = 2.1e11) -> Block:
    """Lies on `low`, held above; it is a third narrower."""
    body = brick("hexahedron20", n, (0.012, 0.016, 0.012), (0.004, 0.0, 0.012))
    return block(body, {"foot": ("z0", T2)}, "z1", young=young)


def component(name: str, body: Block) -> Component:
    return Component(name, {0: body.group})


def on_ground(body: Block, tolerance: float = 0.0) -> tuple[Patch, Array, float]:
    """Patch, compliance along its coordinates, displacement that they do not follow."""
    found = nodal((component("low", body), "top"), tolerance=tolerance)
    side, _ = found.sides(ContactFace("low", "top"), None)
    patch = Patch("top", found.points, found.areas, law(found.areas), found.shapes)
    return patch, static_compliance([(component("low", body), side, 1.0)]), found.lost


def directly(body: Block, closing: Array, asked: float | None = None) -> tuple[Array, Array]:
    """Pressure and the (3,) rigid closing of the ground against a brick by full matrices and an active set.

    Args:
        closing: (3,) approach and tilts of the ground. asked: normal force (N) for which they are sought, without
            moments; None: they are given.
    """
    face = body.group.interfaces["top"]
    N = np.einsum("i,pid->pd", face.rotation[0], body.motion["top"])
    y, z = ((face.points - face.origin) @ face.rotation[1:].T).T
    R, k, d = np.column_stack([np.ones(len(y)), z, -y]), FOUNDATION * face.areas, body.K.shape[0]
    touching_ = np.ones(len(y), dtype=bool)
    for _ in range(50):
        kn = np.where(touching_, k, 0.0)
        A = body.K + N.T @ (kn[:, None] * N)
        if asked is None:
            u = np.linalg.solve(A, -N.T @ (kn * (R @ closing)))
        else:
            B = np.block([[A, N.T @ (kn[:, None] * R)], [R.T @ (kn[:, None] * N), R.T @ (kn[:, None] * R)]])
            both = np.linalg.solve(B, np.append(np.zeros(d), [asked, 0.0, 0.0]))
            u, closing = both[:d], both[d:]
        approach = N @ u + R @ closing
        if ((approach > 0) == touching_).all():
            return k * np.maximum(approach, 0.0) / face.areas, closing
        touching_ = approach > 0
    raise AssertionError("no active set")


def test_a_block_pressed_by_a_given_interference_against_full_matrices() -> None:
    """Every quadrature point's pressure, 1e-8 of the largest; it is not uniform."""
    patch, C, lost = on_ground(low())
    u = pressed_by(patch, 2e-6, C)
    expected, _ = directly(low(), np.array([2e-6, 0.0, 0.0]))
    np.testing.assert_allclose(pressure(patch, u), expected, rtol=0, atol=1e-8 * expected.max())
    assert lost < 1e-12 and expected.max() > 1.04 * expected.min() > 0


def test_a_block_pressed_by_a_given_force_against_full_matrices() -> None:
    """The ground finds its approach and its tilt; pressures to 1e-8 of the largest, the resultant to rounding."""
    body = low((3, 2, 2))
    patch, C, _ = on_ground(body)
    u = equilibrium(patch, 3000.0, compliance=C)
    expected, _ = directly(body, np.zeros(3), 3000.0)
    found = pressure(patch, u)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * expected.max())
    assert found @ patch.areas == pytest.approx(3000.0, rel=1e-11)


def test_a_patch_that_opens_against_full_matrices() -> None:
    """Moments that lift a rim off: the active set of Newton's method is that of the full matrices, 1e-8."""
    body = low()
    patch, C, _ = on_ground(body)
    u = equilibrium(patch, 1000.0, (0.0, 5.0), C)
    found = pressure(patch, u)
    closing = np.append(0.0, 0.0)
    assert 0 < (found == 0).mean() < 0.7
    # the ground of the full model is put where the reduced one has found it: its elastic part is taken off again
    closing = u[[0, 4, 5]] + (C @ forces(patch, u))[[0, 4, 5]]
    expected, _ = directly(body, closing)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * expected.max())
    assert found @ (patch.areas * -patch.points[:, 0]) == pytest.approx(5.0, rel=1e-10)


def forces(patch: Patch, u: Array) -> Array:
    return patch.kinematics[:, 0].T @ (pressure(patch, u) * patch.areas)


@pytest.mark.slow
def test_what_is_left_out_is_what_the_tolerance_says() -> None:
    """A bar with all its modes: more deformations, less motion that they miss, more accurate pressures; all of them,
    and nothing is missed."""
    bar = block(small.beam(), {"right": ("contact_right", (0.0, 0.0, 1.0))}, "clamp").group
    expected, _ = bar_pressed(bar, 1e-7)
    counts, errors, lost = [], [], []
    for tolerance in (0.5, 0.2, 0.1, 0.05, 0.01):
        found, count = bar_pressed(bar, tolerance)
        counts.append(count)
        errors.append(np.abs(found - expected).max() / expected.max())
        lost.append(nodal((Component("bar", {0: bar}), "right"), tolerance=tolerance).lost)
    assert counts == sorted(counts) and counts[0] < 5
    assert errors == sorted(errors, reverse=True) and lost == sorted(lost, reverse=True)
    assert errors[0] > 0.3 and errors[-1] < 1e-9 and lost[-1] == 0


def test_a_body_that_does_not_deform_has_the_rigid_patch() -> None:
    """Shapes that are rigid motions: six coordinates, rows and forces of the rigid patch to rounding."""
    body = low()
    face = body.group.interfaces["top"]
    rng = np.random.default_rng(4)
    six = rng.normal(size=(6, 5))
    arm = face.points - face.origin
    moved = (face.rotation.T @ six[:3])[None] + np.cross((face.rotation.T @ six[3:]).T[None], arm[:, None]).transpose(
        0, 2, 1
    )
    omega = body.group.omega[:5]
    stiff = replace(body.group, interfaces={"top": replace(face, rows=six, shapes=moved)}, omega=omega, M_r=np.eye(5),
                    K_r=np.diag(omega**2), C_r=np.eye(5), G_r=np.zeros((5, 5)))  # fmt: skip
    found = nodal((Component("stiff", {0: stiff}), "top"))
    assert found.count == 6 and found.lost == 0
    np.testing.assert_allclose(found.first[0], six, rtol=0, atol=1e-13 * np.abs(six).max())
    points, areas = rigid_points(face)
    np.testing.assert_array_equal(found.points, points)
    rigid = Patch("top", points, areas, law(areas))
    u = np.array([1e-6, 0, 0, 0, 1e-5, -2e-5])
    np.testing.assert_allclose(found.shapes, rigid.kinematics, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(pressure(replace(rigid, shapes=found.shapes), u), pressure(rigid, u))


def test_interpolation_is_exact_for_quadratics_and_of_third_order_else() -> None:
    """Scattered points: a quadratic to rounding, a known point gets its own value, a sine falls with h^3."""
    rng = np.random.default_rng(0)
    wanted, errors, counts = rng.uniform(0.1, 0.9, size=(40, 2)), [], (10, 20, 40)
    for n in counts:
        lattice = (np.stack(np.meshgrid(*2 * [np.arange(n)], indexing="ij"), axis=-1).reshape(-1, 2) + 0.5) / n
        known = lattice + rng.uniform(-0.2, 0.2, size=lattice.shape) / n
        P = interpolation(known, wanted)

        def smooth(x: Array) -> Array:
            return np.sin(3 * x[:, 0]) * np.cos(2 * x[:, 1])

        def quadratic(x: Array) -> Array:
            return 1 + x[:, 0] - 2 * x[:, 0] * x[:, 1] + 3 * x[:, 1] ** 2

        np.testing.assert_allclose(P @ quadratic(known), quadratic(wanted), rtol=0, atol=1e-11)
        errors.append(np.abs(P @ smooth(known) - smooth(wanted)).max())
    np.testing.assert_array_equal(interpolation(known, known[:7]), np.eye(len(known))[:7])
    assert np.polyfit(np.log(counts), np.log(errors), 1)[0] < -2.5


def bar_pressed(group: ModalGroup, tolerance: float = 1e-4) -> tuple[Array, int]:
    """Pressure of the right face under 3 kN through the surface of section 5.3, and the number of deformations."""
    bar = Component("bar", {0: group})
    found = nodal((bar, "right"), tolerance=tolerance)
    side, _ = found.sides(ContactFace("bar", "right"), None)
    k = jnp.asarray(2.3e12 * found.areas)
    patch = Patch("right", found.points, found.areas, PointContact(Penalty(k), Coulomb(value(0.3)), k),
                  found.shapes)  # fmt: skip
    u = equilibrium(patch, 3000.0, compliance=static_compliance([(bar, side, 1.0)]))
    return pressure(patch, u), found.count - 6


@pytest.mark.parametrize(
    ("reduction", "shapes", "deformations", "error"),
    [("eigenmodes", 0, 20, 0.038), ("rubin", 0, 28, 0.037), ("rubin", 6, 34, 0.020), ("rubin", 24, 52, 0.013)],
)
def test_what_a_basis_knows_of_its_patch(reduction: str, shapes: int, deformations: int, error: float) -> None:
    """The table of docs/harmonic_balance.md: root mean square error of the pressure over its mean, to two digits."""
    bar = block(small.beam(), {"right": ("contact_right", (0.0, 0.0, 1.0))}, "clamp")
    expected, _ = bar_pressed(bar.group, 1e-7)
    face = {"name": "right", "face": "contact_right", "t2": [0.0, 0.0, 1.0]}
    if shapes:
        face |= {"coordinates": "characteristic", "count": shapes}
    raw = small.table(reduction=reduction, interfaces=[face], modes={"count": 20, "solver": "superlu"})
    basis = modal_basis(small.beam(), BodySettings.model_validate(raw))
    found, count = bar_pressed(basis.groups[0, 0])
    assert count == deformations
    assert np.sqrt(np.mean((found - expected) ** 2)) / expected.mean() == pytest.approx(error, abs=0.0006)
    assert np.sqrt(np.mean((expected / expected.mean() - 1) ** 2)) == pytest.approx(1.25, abs=0.006)  # rigid patch


def pair(a: Block, b: Block, tolerance: float = 1e-4) -> tuple[Patch, ContactFace, ContactFace, Array]:
    """`low` below `high`: patch, sides, compliance."""
    one, two = component("low", a), component("high", b)
    met = facing(a.group.interfaces["top"], b.group.interfaces["foot"])
    found = nodal((one, "top"), (two, "foot"), met, tolerance=tolerance)
    first, second = found.sides(ContactFace("low", "top", np.eye(6)), ContactFace("high", "foot", met.frame))
    assert second is not None
    C = static_compliance([(one, first, 1.0), (two, second, -1.0)])
    return Patch("top", found.points, found.areas, law(found.areas), found.shapes), first, second, C


@pytest.mark.slow
def test_meshes_that_do_not_match_agree_with_those_that_do() -> None:
    """A narrow block on a wide one, pressed by 2 um. Facets that meet (3 x 2 below 5 x 2) or not: force within 0.5 %,
    pressure at the middle within 2 %, of the finest; the points are those of the narrow face and fill it."""
    finest, middles, totals = None, [], []
    for a, b in (((10, 4, 2), (6, 4, 2)), ((5, 2, 2), (3, 2, 2)), ((4, 3, 2), (3, 2, 2)), ((3, 2, 2), (2, 3, 2))):
        patch, _, _, C = pair(low(a), high(b))
        p = pressure(patch, pressed_by(patch, 2e-6, C))
        assert patch.areas.sum() == pytest.approx(0.012 * 0.016, rel=1e-12)
        totals.append(p @ patch.areas)
        inner = (np.abs(patch.points) < 0.3 * np.array([0.012, 0.016])).all(axis=1)
        middles.append((p * patch.areas)[inner].sum() / patch.areas[inner].sum())
        finest = finest or (totals[0], middles[0])
    np.testing.assert_allclose(totals, finest[0], rtol=5e-3)
    np.testing.assert_allclose(middles, finest[1], rtol=2e-2)


FINE: dict[str, float] = {"harmonics": 1, "samples": 32, "cycles": 20, "periodicity": 1e-12, "length": 1e-7}


def problem_of(a: Block, b: Block, push: float = 60.0, **settings: float) -> balance.Problem:
    patch, first, second, C = pair(a, b)
    contact = preloaded_contact("joint", patch, first, second, normal=100.0, compliance=C)
    whole = Assembly((component("low", a), component("high", b)), (contact,), (Load("low", "push", push),),
                     (Output("low", "end", "u_x"),))  # fmt: skip
    return balance.of(whole, **FINE | settings)


def soft(n: tuple[int, int, int], of: str) -> Block:
    """Plastic, so that the first modes of the bricks lie where the contact slides."""
    return (low if of == "low" else high)(n, 3e9)


def test_jacobian_of_a_patch_that_deforms_against_differences() -> None:
    """Central differences of the residual at a state with slip: 1e-6."""
    problem = problem_of(soft((2, 2, 1), "low"), soft((2, 2, 1), "high"))
    assert problem.assembly.contacts[0].patch.count > 12
    rng, Omega, h = np.random.default_rng(3), 2 * np.pi * 2000.0, 1e-6
    x, d = 0.2 * rng.normal(size=problem.size), rng.normal(size=problem.size)
    _, J, rate = problem.evaluate(x, Omega)
    along = (problem.evaluate(x + h * d, Omega)[0] - problem.evaluate(x - h * d, Omega)[0]) / (2 * h)
    np.testing.assert_allclose(J @ d, along, rtol=0, atol=1e-6 * np.abs(along).max())
    h = 1e-2
    along = (problem.evaluate(x, Omega + h)[0] - problem.evaluate(x, Omega - h)[0]) / (2 * h)
    np.testing.assert_allclose(rate, along, rtol=0, atol=1e-5 * np.abs(along).max())


@pytest.mark.slow
def test_forced_vibration_with_a_patch_that_deforms() -> None:
    """It slips here and sticks there, and what is supplied is dissipated, in the contact by its path in time: that
    path is sampled, with an error that falls with the square of the step."""
    errors = []
    for samples in (32, 64):
        problem = problem_of(soft((2, 2, 1), "low"), soft((2, 2, 1), "high"), 200.0, samples=samples)
        point = solve(problem, 2 * np.pi * 2000.0, [])
        assert point.converged
        found = response.operating(problem, point)
        cycle = found.cycles["joint"]
        errors.append(abs(cycle.by_slip.sum() / (found.supplied - found.damped) - 1))
        assert abs(cycle.lost.sum() / (found.supplied - found.damped) - 1) < 2e-3
    assert cycle.slipping.max() > 0.9 and cycle.slipping.min() < 0.3
    assert errors[0] > 3.5 * errors[1] and errors[1] < 6e-3


def test_preload_by_a_force_is_the_interference_that_makes_it() -> None:
    """Without friction: the mean state is known beforehand (given force, patches that yield), or the analysis finds it
    (given interference): the same vibration to 1e-8, with points that lift off."""
    a, b = soft((2, 2, 1), "low"), soft((2, 2, 1), "high")
    patch, first, second, C = pair(a, b)
    patch = replace(patch, law=law(patch.areas, 0.0))
    by_force = preloaded_contact("joint", patch, first, second, normal=20.0, compliance=C)
    far = by_force.offset + C @ by_force.preload
    assert np.abs(far[[4, 5]]).max() < 1e-9 * far[0] / 0.01  # the bricks stand straight, so that nothing tilts
    by_balance = preloaded_contact("joint", patch, first, second, interference=float(far[0]))
    found = []
    for contact in (by_force, by_balance):
        whole = Assembly((component("low", a), component("high", b)), (contact,), (Load("low", "push", 60.0),),
                         (Output("low", "end", "u_z"),))  # fmt: skip
        problem = balance.of(whole, **FINE)
        point = solve(problem, 2 * np.pi * 3000.0, [])
        assert point.converged
        found.append(response.operating(problem, point))
    assert 0 < found[0].cycles["joint"].open.mean() < 0.9
    moving = [f.outputs[0, 1] for f in found]
    assert moving[1] == pytest.approx(moving[0], rel=1e-8)


def test_coordinates_serve_all_waves_of_a_ring() -> None:
    """Complex shapes of three nodal diameters in one set of real coordinates: each wave's motion is found again."""
    basis = sector.basis(6, 5)
    whole = Component("sector", {k: g for (_, k), g in basis.groups.items()}, 6)
    indices = [Ring(6, 1).index(h) for h in range(6)]
    found = nodal((whole, "rim"), indices=indices, tolerance=0.0)
    side, _ = found.sides(ContactFace("sector", "rim"), None)
    for index in indices:
        wave = whole.at(index)
        face = wave.group.interfaces["rim"]
        shapes = face.shapes.conj() if wave.conjugate else face.shapes
        moved = np.einsum("ab,pbm->pam", face.rotation, shapes)
        rows = side.motion(wave, index, 6)
        np.testing.assert_allclose(
            np.tensordot(found.shapes, rows, axes=1), moved, rtol=0, atol=1e-9 * np.abs(moved).max()
        )
        centre = wave.interface("rim")[:3]  # the rim is curved, so that its rotations move its points off a flat patch
        np.testing.assert_allclose(rows[:3], centre, rtol=0, atol=1e-9 * np.abs(centre).max())


def test_a_file_without_patch_shapes_is_refused() -> None:
    face = low().group.interfaces["top"]
    bare = replace(low().group, interfaces={"top": replace(face, shapes=face.shapes[:0])})
    refused("output.patch_shapes", nodal, (Component("low", {0: bare}), "top"))
    refused("no interface 'bottom'; it has top", nodal, (component("low", low()), "bottom"))
