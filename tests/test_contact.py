"""Frictionless contact in the static state: exact derivatives, balance of forces, patch test, Hertz, penalty, closure.

The blocks are bricks of `meshes.py` put into one mesh; nothing else joins them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from meshes import STEEL, body, brick, graded, rotation_matrix
from refusals import refused
from touching import SECTORS, shrouded, together

from microslip.basis import check_basis, read_basis, write_basis
from microslip.case.assemble import build
from microslip.case.problem import normal_forces
from microslip.case.settings import case_model
from microslip.data import Mesh
from microslip.errors import NotConverged, UserError
from microslip.fem.contact import (
    ContactPair,
    Plane,
    contact_stiffness,
    coupled_points,
    cut_pair,
    grip,
    make_pair,
    project,
)
from microslip.fem.discretise import discretise, free_upper
from microslip.fem.segments import clip, facet_functions, reference_nodes
from microslip.linalg import eigen
from microslip.modal import equilibrium as newton
from microslip.modal.closures import contact_curve, contact_pairs
from microslip.modal.compute import modal_basis
from microslip.modal.equilibrium import BodyModel, StaticState, equilibrium, make_model
from microslip.modal.speed_range import frequencies_over, group_at

E, NU = STEEL["young"], STEEL["poisson"]
FACETS = ("triangle", "triangle6", "quad", "quad8", "quad9")


def held(mesh: Mesh, **directions: str) -> np.ndarray:
    """Degrees of freedom of faces held in the named directions."""
    parts = [3 * mesh.face_points(f) + "xyz".index(c) for f, cs in directions.items() for c in cs]
    return np.unique(np.concatenate(parts))


def model_of(
    mesh: Mesh, pairs: tuple[ContactPair, ...], fixed: np.ndarray, load: np.ndarray | None = None
) -> BodyModel:
    d = discretise(mesh, coupled=[coupled_points(p) for p in pairs])
    material = body().material.material()
    load = np.zeros((mesh.n_points, 3)) if load is None else load
    model = make_model(
        d, material, free_upper(d.pattern, fixed), fixed, np.array([0, 1.0, 0]), np.zeros(3), None, 293.15, load, True
    )
    return replace(model, contacts=pairs)


def rest(model: BodyModel) -> StaticState:
    solver = eigen.new_solver()
    try:
        return equilibrium(model, 0.0, "nonlinear", solver)
    finally:
        solver.close()


# geometry ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", FACETS)
def test_facet_functions_interpolate_and_differentiate(kind):
    """One at their own node, zero at the others; derivatives as central differences of the functions give them."""
    nodes = reference_nodes(kind)
    np.testing.assert_allclose(facet_functions(kind, nodes)[0], np.eye(len(nodes)), atol=1e-12)
    at, h = np.array([[0.31, 0.22], [0.05, 0.6]]), 1e-4
    _, first, second = facet_functions(kind, at)
    for a in range(2):
        step = h * np.eye(2)[a]
        up, down = facet_functions(kind, at + step), facet_functions(kind, at - step)
        np.testing.assert_allclose(first[:, a], (up[0] - down[0]) / (2 * h), atol=1e-7)
        np.testing.assert_allclose(second[:, a], (up[1] - down[1]) / (2 * h), atol=1e-7)


def test_clip_of_squares():
    """Two unit squares shifted by (0.25, 0.5) share 0.75 x 0.5; apart they share nothing."""
    square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    x, y = np.array(clip(square, [(a + 0.25, b + 0.5) for a, b in square])).T
    area = 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))
    assert area == pytest.approx(0.375, rel=1e-14)
    assert clip(square, [(a + 2, b) for a, b in square]) == []


def wavy(p: np.ndarray) -> np.ndarray:
    return p + np.column_stack([0 * p[:, :2], 0.1 * np.sin(1.3 * p[:, 0] + p[:, 1]) + 0.05 * p[:, 0] ** 2])


def curved_pair(below: str, above: str, turned: bool) -> tuple[Mesh, ContactPair]:
    """Two curved blocks, meshed differently; turned: the upper one drawn elsewhere and brought there by a rotation."""
    a = brick(below, (2, 2, 1), (1, 1, 0.4), to=wavy)
    b = brick(above, (3, 2, 1), (1.2, 1.1, 0.4), (-0.1, -0.05, 0.4), to=wavy)
    R = rotation_matrix((0.2, 0.1, 0.3)) if turned else np.eye(3)
    mesh = together(a=a, b=Mesh(b.points @ R, b.cells, b.faces, {}, b.node_id))
    return mesh, make_pair(mesh, "c", "a_z1", "b_z0", 1.0, R, interference=0.02, slide=0.3)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    ("below", "above"),
    [("tetra10", "tetra10"), ("hexahedron20", "tetra10"), ("hexahedron27", "hexahedron20"), ("tetra10", "hexahedron")],
)
def test_force_and_stiffness_are_derivatives_of_one_potential(below, above, turned):
    """Central differences of the potential and of the force, curved faces, all nodes closed: 1e-6 (step 1e-5)."""
    mesh, pair = curved_pair(below, above, turned)
    pattern = discretise(mesh, coupled=[coupled_points(pair)]).pattern
    rng = np.random.default_rng(0)
    x = mesh.points + 0.02 * np.sin(mesh.points @ rng.normal(size=(3, 3)) * 3)
    made, multiplier = cut_pair(pair, x), rng.uniform(0, 0.05, len(pair.nodes)) * pair.penalty

    def at(y):
        return grip(pair, made, y, multiplier)

    def potential(y):
        g = at(y)
        return (g.area * g.pressure**2 / pair.penalty).sum() / 2

    g, v, h = at(x), rng.normal(size=x.shape), 1e-5
    assert (g.pressure > 0).all()
    work = (potential(x - h * v) - potential(x + h * v)) / (2 * h)
    assert (g.force * v).sum() == pytest.approx(work, rel=1e-6)
    stiff = pattern.full(contact_stiffness(g, pattern)) @ v.ravel()
    change = (at(x - h * v).force - at(x + h * v).force).ravel() / (2 * h)
    np.testing.assert_allclose(stiff, change, atol=1e-6 * np.abs(stiff).max())


def forces_through(g, gaps):
    """(n, 3) forces of the pressure on one side, from the derivative of the gaps by its displacements."""
    return np.asarray(gaps.T @ (g.point_weight * g.point_pressure)).reshape(-1, 3)


@pytest.mark.parametrize("turned", [False, True])
def test_action_is_reaction(turned):
    """Forces and moments of both sides cancel, the master's where it stands: to rounding."""
    mesh, pair = curved_pair("tetra10", "hexahedron20", turned)
    x = mesh.points + 0.02 * np.sin(3 * mesh.points)
    g = grip(pair, cut_pair(pair, x), x, np.zeros(len(pair.nodes)))
    there, force = pair.neighbour(x), forces_through(g, g.on_master) @ pair.turn.T
    size = np.abs(g.slave_force).sum()
    np.testing.assert_allclose(g.slave_force.sum(axis=0), -force.sum(axis=0), atol=1e-13 * size)
    moments = np.cross(x, g.slave_force).sum(axis=0), np.cross(there, force).sum(axis=0)
    np.testing.assert_allclose(moments[0], -moments[1], atol=1e-12 * size)


def test_projection_on_a_cylinder():
    """Distance of points from a cylinder of radius 1: the facets (45 degrees in 4) miss the circle by 2e-5 at most."""

    def bend(p):
        return np.column_stack([(1 + p[:, 2]) * np.sin(p[:, 0]), p[:, 1], (1 + p[:, 2]) * np.cos(p[:, 0])])

    inner = brick("hexahedron20", (4, 1, 1), (np.pi / 4, 1, 0.3), (0, 0, -0.3), bend)
    outer = brick("hexahedron20", (3, 2, 1), (np.pi / 5, 1, 0.3), (0.05, 0, 0.05), bend)
    mesh = together(a=outer, b=inner)
    pair = make_pair(mesh, "c", "a_z0", "b_z1", 1.0)
    for p in cut_pair(pair, mesh.points).points:
        place = np.einsum("pk,pki->pi", p.N, mesh.points[p.slave])
        np.testing.assert_allclose(project(pair, p, mesh.points).gap, np.hypot(place[:, 0], place[:, 2]) - 1, atol=2e-5)


# the static state --------------------------------------------------------------------------------------------------


def blocks(
    below: str = "tetra10", above: str = "hexahedron20", press: float = 1e-5, layers: int = 1, **more
) -> BodyModel:
    """Two blocks 1 x 1 x 0.4 m, meshed differently, on rollers all around, pressed by an interference."""
    a = brick(below, (1, 2, layers), (1, 1, 0.4))
    b = brick(above, (2, 1, layers), (1, 1, 0.4), (0, 0, 0.4))
    mesh = together(a=a, b=b)
    pair = make_pair(mesh, "c", "a_z1", "b_z0", E, interference=press, **more)
    sides = {f"{p}_{s}0": s for p in "ab" for s in "xy"}
    return model_of(mesh, (pair,), held(mesh, a_z0="z", b_z1="z", **sides))


@pytest.mark.parametrize(
    ("below", "above"), [("tetra10", "hexahedron20"), ("hexahedron27", "tetra10"), ("tetra10", "tetra10")]
)
def test_patch_test(below, above):
    """Uniform pressure E i / h through faces that do not match; finite strains of 1e-5 allow a few 1e-5 in the mean."""
    model = blocks(below, above)
    state = rest(model)
    exact = E * 1e-5 / 0.8
    pressure = state.contacts[0].pressure
    np.testing.assert_allclose(pressure, exact, rtol=5e-5)
    assert np.ptp(pressure) < 1e-6 * exact  # what is left of the iteration and the shift of the cut
    s = np.concatenate([block.reshape(-1, 6) for block in state.stress])
    np.testing.assert_allclose(s[:, 2], -pressure.mean(), rtol=5e-5)
    assert np.abs(s[:, [0, 1, 3, 4, 5]]).max() < 1e-6 * exact


def test_result_does_not_depend_on_the_penalty():
    """Penalties a thousand times apart: the same pressure to 1e-6 (where the multipliers are taken to stand)."""
    soft, stiff = (rest(blocks(penalty=p)).contacts[0] for p in (2 * E, 2000 * E))
    np.testing.assert_allclose(soft.pressure, stiff.pressure, rtol=2e-6)
    assert max(soft.penetration, stiff.penetration) < 1e-6 * 1e-5


def test_newton_is_quadratic(monkeypatch):
    """With a fixed cut and fixed multipliers every step is about the square of the one before."""
    steps: list[float] = []

    def output(found):  # to the end, where Newton itself would foresee it
        steps[:] = found
        return bool(found) and found[-1] < 1e-9

    monkeypatch.setattr(newton, "_stands", output)
    monkeypatch.setattr("microslip.modal.closing.NEAR", 0.0)  # multipliers stay
    monkeypatch.setattr("microslip.modal.closing.SETTLED", 10.0)
    mesh, pair = curved_pair("tetra10", "tetra10", False)
    pair = replace(pair, interference=0.02, penalty=np.full(len(pair.nodes), 20 * E))
    monkeypatch.setattr("microslip.modal.closing.contact_stiffness", lambda g, p, bent: contact_stiffness(g, p, True))
    rest(model_of(mesh, (pair,), held(mesh, a_z0="xyz", b_z1="xyz")))
    fast = [s for s in steps if s < 0.05]
    assert len(fast) >= 3 and fast[-1] < 1e-9
    for before, after in zip(fast[:-1], fast[1:], strict=True):
        assert after < max(20 * before**2, 1e-12)


def test_gap_stays_open():
    """Blocks drawn 0.1 m apart, pressed by less: no force, no displacement."""
    a, b = brick("tetra10", (1, 1, 1)), brick("tetra10", (1, 1, 1), (1, 1, 1), (0, 0, 1.1))
    mesh = together(a=a, b=b)
    pair = make_pair(mesh, "c", "a_z1", "b_z0", E, interference=0.05)
    state = rest(model_of(mesh, (pair,), held(mesh, a_z0="xyz", b_z1="xyz")))
    assert np.abs(state.u).max() == 0 and state.contacts[0].pressure.max() == 0
    np.testing.assert_allclose(state.contacts[0].gap, 0.05, rtol=1e-12)


# Hertz -------------------------------------------------------------------------------------------------------------


def slab(fine: int, a: float, radius: float) -> Mesh:
    """Half a cylinder's neighbourhood in plane strain: `fine` boxes to 1.3 a, then growing to 40 a; lower face bent."""
    coarse = 8
    outside = 1.3 + 38.7 * graded(coarse, 60.0)(np.linspace(0, 1, coarse + 1))
    knots = np.concatenate([1.3 * np.arange(fine) / fine, outside])
    n = fine + coarse

    def along(s):
        return a * np.interp(s, np.linspace(0, 1, n + 1), knots)

    def to(p):
        x, z = along(p[:, 0]), along(p[:, 2])
        rise = radius - np.sqrt(radius**2 - np.minimum(x, 0.5 * radius) ** 2)
        return np.column_stack([x, p[:, 1], z + rise * (1 - z / (40 * a))])

    return brick("hexahedron20", (n, 1, n), (1, 0.2 * a, 1), to=to)


def hertz_error(fine: int) -> tuple[float, float]:
    """Errors of the half width (from the pressure's second moment) and of the highest pressure, for the force found.

    Johnson, Contact Mechanics (1985), Eqs. (4.43) to (4.45): a^2 = 4 F R / (pi E*), p0 = 2 F / (pi a), rigid plane.
    """
    a, radius, width, stiff = 0.01, 1.0, 0.002, E / (1 - NU**2)
    mesh = slab(fine, a, radius)
    pair = make_pair(mesh, "c", "z0", Plane(np.zeros(3), np.array([0, 0, 1.0])), E, interference=2.2e-4)
    state = rest(model_of(mesh, (pair,), held(mesh, z1="z", x0="x", y0="y", y1="y")))
    g = state.contacts[0]
    force = 2 * g.force[:, 2].sum() / width  # both halves, per metre
    half_width, peak = np.sqrt(4 * force * radius / np.pi / stiff), np.sqrt(force * stiff / np.pi / radius)
    x = np.concatenate([np.einsum("pk,pk->p", p.N, mesh.points[p.slave][..., 0]) for p in g.cut.points])
    weight = g.point_weight * g.point_pressure
    found = 2 * np.sqrt(weight @ x**2 / weight.sum())  # the half ellipse has a second moment of a^2 / 4
    assert 0.5 * a < half_width < 1.2 * a  # inside the fine boxes
    return abs(found / half_width - 1), abs(g.point_pressure.max() / peak - 1)


def test_hertz_cylinder():
    """Half width and highest pressure of the line contact; what is left is the block's size and its strain."""
    coarse, fine = hertz_error(2), hertz_error(8)
    assert fine[0] < 0.006 and fine[1] < 0.008  # measured 0.003 and 0.004, at two boxes 0.014 and 0.67
    assert fine[0] < 0.4 * coarse[0] and fine[1] < 0.4 * coarse[1]


def ball(fine: int, a: float, radius: float, size: float) -> Mesh:
    """A quarter of a sphere's neighbourhood: `fine` boxes to 1.2 a, then growing to `size`; lower face bent."""
    coarse = 4
    outside = 1.2 + (size / a - 1.2) * graded(coarse, 40.0)(np.linspace(0, 1, coarse + 1))
    knots = np.concatenate([1.2 * np.arange(fine) / fine, outside])
    n = fine + coarse

    def to(p):
        q = a * np.interp(p, np.linspace(0, 1, n + 1), knots)
        r2 = np.minimum(q[:, 0] ** 2 + q[:, 1] ** 2, 0.5 * radius**2)
        q[:, 2] += (radius - np.sqrt(radius**2 - r2)) * (1 - q[:, 2] / size)
        return q

    return brick("hexahedron20", (n, n, n), to=to)


@pytest.mark.slow
def test_stiffness_of_a_sphere_on_a_plane():
    """Hertz (Johnson 1985, Eqs. (4.22) to (4.24)): F = 4/3 E* R^1/2 d^3/2, and dF/dd = 2 E* a with a from the force.

    Four boxes over the largest radius and a block of 40 radii: 1.5 % measured in the force, 0.5 % in the exponent.
    """
    a, radius, stiff = 0.01, 1.0, E / (1 - NU**2)
    mesh = ball(4, a, radius, 40 * a)
    pair = make_pair(mesh, "c", "z0", Plane(np.zeros(3), np.array([0, 0, 1.0])), E)
    model = model_of(mesh, (pair,), held(mesh, z1="z", x0="x", y0="y"))
    solver = eigen.new_solver()
    curve = contact_curve(model, "c", a**2 / radius * np.array([0.25, 0.5, 0.75, 1.0]), solver)
    solver.close()
    force, approach = 4 * curve.force, curve.approach
    np.testing.assert_allclose(force, 4 / 3 * stiff * np.sqrt(radius) * approach**1.5, rtol=0.02)
    np.testing.assert_allclose(np.diff(np.log(force)) / np.diff(np.log(approach)), 1.5, rtol=0.01)
    touch = (3 * force * radius / (4 * stiff)) ** (1 / 3)
    inner = slice(1, -1)  # differences of second order are best between two levels
    np.testing.assert_allclose(4 * curve.stiffness[inner], 2 * stiff * touch[inner], rtol=0.02)


def test_stiffness_of_flat_blocks():
    """Two blocks pressed flat: E A / h at every level, finite strains of 2e-5 apart; and its table."""
    solver, model = eigen.new_solver(), blocks()
    curve = contact_curve(model, "c", np.array([0.5e-5, 1e-5, 2e-5]), solver)
    np.testing.assert_allclose(curve.stiffness, E / 0.8, rtol=1e-4)
    assert [*curve.columns] == ["approach_m", "normal_force_N", "stiffness_N_per_m", "closed_share"]
    with pytest.raises(UserError, match="the curve needs a closure of that name"):
        contact_curve(model, "d", np.array([1e-5, 2e-5]), solver)
    solver.close()


# through body.toml -------------------------------------------------------------------------------------------------


def closure(**more) -> dict:
    return {"name": "shroud", "face": "right", "against": "left", "sector_shift": 1, **more}


def settings_of(speeds=(0.0,), **more):
    table = {
        "supports": [{"face": "z0"}], "geometry": {"mesh": "made.inp", "parameters": {"blades": SECTORS}},
        "rotation": {"speeds_rpm": list(speeds)}, "modes": {"count": 3}, "closures": [closure()],
    }  # fmt: skip
    return body(**{**table, **more})


def test_sides_of_the_shroud_are_images():
    mesh = shrouded()
    left, right = (mesh.points[mesh.face_points(f)] for f in ("left", "right"))
    turned = left @ rotation_matrix((0, 2 * np.pi / SECTORS, 0)).T
    away = np.linalg.norm(turned[:, None] - right[None], axis=2).min(axis=1)
    np.testing.assert_allclose(away, 0, atol=1e-12)


def ring_of(sector: Mesh) -> Mesh:
    """Every sector by itself, unjoined."""
    parts = {}
    for j in range(SECTORS):
        R = rotation_matrix((0, 2 * np.pi * j / SECTORS, 0))
        parts[f"s{j}"] = Mesh(sector.points @ R.T, sector.cells, sector.faces, {}, sector.node_id)
    return together(**parts)


def test_sector_closes_on_its_own_image_as_a_full_ring_does():
    """Twelve unjoined blades in contact with each other against one in contact with its own image."""
    sector, rpm = shrouded((1, 1, 4)), 3000.0
    one = modal_basis(sector, settings_of([rpm], closures=[closure(interference=2e-5)])).groups[0, 0]
    ring = ring_of(sector)
    closures = [
        {"name": f"c{j}", "face": f"s{j}_right", "against": f"s{(j + 1) % SECTORS}_left", "interference": 2e-5}
        for j in range(SECTORS)
    ]
    supports = [{"face": f"s{j}_z0"} for j in range(SECTORS)]
    whole = modal_basis(ring, settings_of([rpm], closures=closures, supports=supports)).groups[0, 0]
    expected = one.contacts["shroud"]
    assert expected.normal_force > 10
    for c in whole.contacts.values():
        assert c.normal_force == pytest.approx(expected.normal_force, rel=1e-6)
        np.testing.assert_allclose(c.pressure, expected.pressure, atol=1e-5 * expected.pressure.max())


def top_force(r) -> float:
    return r.samples[-1].contacts["shroud"].normal_force


def test_a_range_follows_the_stiffness_through_the_closing_of_an_open_contact():
    """Apart at rest, pressed at the top: the range's frequencies at speeds between against equilibria of their own."""
    mesh, top, between = shrouded((1, 1, 4), gap=1e-5), 8000.0, (3000.0, 5500.0)
    rotation = settings_of([0.0]).rotation.model_copy(update={"range_rpm": (0.0, top)})
    ranged = modal_basis(mesh, settings_of([0.0]).model_copy(update={"rotation": rotation}))
    true = modal_basis(mesh, settings_of(between)).groups
    assert true[1, 0].contacts["shroud"].normal_force > 0
    r = ranged.ranges[0]
    omega, _ = frequencies_over(r, np.array(between) * np.pi / 30)
    for i in range(len(between)):
        assert np.abs(omega[i] / true[i, 0].omega[: r.count] - 1).max() < 3 * r.tolerance  # held to it elsewhere
        at, found = group_at(ranged, between[i]), true[i, 0].contacts["shroud"]
        c = at.contacts["shroud"]
        assert abs(c.normal_force - found.normal_force) <= at.checks["normal_force_error"] < 0.5 * top_force(r)
        assert c.areas @ c.pressure == pytest.approx(c.normal_force) and (c.pressure >= 0).all()
    for g in r.samples:  # at the equilibria themselves nothing is lost
        again = group_at(ranged, g.speed * 30 / np.pi)
        assert again.contacts["shroud"].normal_force == pytest.approx(g.contacts["shroud"].normal_force, abs=1e-9)
        assert again.checks["normal_force_error"] == 0
    closed = settings_of([0.0], closures=[closure(modes="closed")]).model_copy(update={"rotation": rotation})
    refused("rotation.range_rpm: closures", modal_basis, mesh, closed)


def test_shroud_closes_at_a_speed_and_presses_harder_beyond():
    """Open below, closed above; an interference presses harder at every one."""
    mesh, speeds = shrouded((1, 1, 4), gap=1e-5), (0.0, 4000.0, 12000.0)
    groups = modal_basis(mesh, settings_of(speeds)).groups
    found = [groups[i, 0].contacts["shroud"] for i in range(len(speeds))]
    force = np.array([c.normal_force for c in found])
    assert force[0] == 0 and found[0].gap.min() > 0 and (np.diff(force) >= 0).all() and force[-1] > 0
    assert all((c.normal_force > 0) == (c.closed_share > 0) for c in found)
    pressed = modal_basis(mesh, settings_of(speeds, closures=[closure(interference=3e-5)])).groups
    assert all(pressed[i, 0].contacts["shroud"].normal_force > force[i] for i in range(len(speeds)))


def test_modal_file_keeps_the_contact(tmp_path):
    """Written, read and checked; a negative pressure and a wrong force are found."""
    interfaces = [{"name": "r", "face": "right", "role": "right", "t2": [0.0, 0.0, 1.0]}]
    basis = modal_basis(shrouded(), settings_of([6000.0], closures=[closure(interference=2e-5)], interfaces=interfaces))
    write_basis(tmp_path / "b.h5", basis)
    back = read_basis(tmp_path / "b.h5").groups[0, 0].contacts["shroud"]
    kept = basis.groups[0, 0].contacts["shroud"]
    assert back.interface == "r" and back.normal_force == kept.normal_force > 0 and back.against == "left"
    np.testing.assert_array_equal(back.pressure, kept.pressure)
    np.testing.assert_array_equal(back.points, basis.groups[0, 0].interfaces["r"].points)
    assert all(c.passed for c in check_basis(basis)), [c for c in check_basis(basis) if not c.passed]
    assert kept.spread is not None
    skew = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 0]]) * np.trace(kept.spread)
    for bad in (
        replace(kept, pressure=-kept.pressure), replace(kept, normal_force=2 * kept.normal_force),
        replace(kept, force=1.01 * kept.force), replace(kept, centre=kept.centre + [0, 0.1, 0]),
        replace(kept, spread=-kept.spread), replace(kept, spread=kept.spread + 0.01 * skew),
        replace(kept, closed_share=1.01), replace(kept, areas=0.9 * kept.areas),
    ):  # fmt: skip
        group = replace(basis.groups[0, 0], contacts={"shroud": bad})
        assert not all(c.passed for c in check_basis(replace(basis, groups={(0, 0): group})))


def test_case_takes_the_normal_force_of_the_static_state():
    """One normal force, that of the closure, for both sides; without a closure a sentence."""
    sides = {"right": (1, "left"), "left": (-1, "right")}
    interfaces = [
        {"name": n, "face": n, "role": n, "partner": other, "sector_shift": shift, "t2": [0.0, 0.0, 1.0]}
        for n, (shift, other) in sides.items()
    ]
    point = [float(v) for v in shrouded().points[-1]]
    more = {
        "interfaces": interfaces, "monitors": [{"name": "m", "point": point}],
        "excitations": [{"name": "e", "point": point, "direction": [1.0, 0.0, 0.0]}],
    }  # fmt: skip
    contact = {"law": "jenkins", "normal_stiffness": 1e8, "tangential_stiffness": 1e7, "friction": 0.2}
    case = case_model().model_validate({
        "name": "c", "body": "test", "excitation": "e", "monitor": "m",
        "contacts": [{"interface": n, **contact} for n in sides],
        "sweep": {"start": 50.0, "stop": 60.0, "points": 3, "normal_forces": "static"},
    })  # fmt: skip
    basis = modal_basis(shrouded(), settings_of([6000.0], closures=[closure(interference=2e-5)], **more))
    (force,) = normal_forces(build(case, {"test": basis}))
    assert force == basis.groups[0, 0].contacts["shroud"].normal_force > 0
    open_one = modal_basis(shrouded(), settings_of([6000.0], closures=[], **more))
    with pytest.raises(UserError, match="the modal file has no closure on interface 'right'"):
        normal_forces(build(case, {"test": open_one}))


def test_closed_modes_are_those_of_a_roller():
    """A bar pressed on the ground: kept closed it vibrates as on rollers, left open as with that end free."""
    mesh = brick("hexahedron20", (2, 2, 4), (0.05, 0.06, 0.2))
    ground = {"name": "g", "face": "z1", "against": "ground", "interference": 1e-7}

    def frequencies(closures, supports=()):
        table = {"supports": [{"face": "z0"}, *supports], "closures": closures, "modes": {"count": 6}}
        return modal_basis(mesh, body(**table)).groups[0, 0].frequency

    rollers = frequencies([], [{"face": "z1", "directions": "z"}])
    # the mean gaps of the face are held, and the prestress of 1e-7 / 0.2 counts: 1e-3
    np.testing.assert_allclose(frequencies([{**ground, "modes": "closed"}]), rollers, rtol=1e-3)
    np.testing.assert_allclose(frequencies([ground]), frequencies([]), rtol=1e-4)


def test_bolt_presses_with_its_preload():
    """Two plates bolted on each other: between them, and on the ground below the lower one, the preload arrives."""
    a = brick("tetra10", (2, 2, 1), (0.1, 0.1, 0.02))
    b = brick("hexahedron20", (3, 3, 1), (0.1, 0.1, 0.02), (0, 0, 0.02))
    mesh = together(a=a, b=b)
    sides = [{"face": f"{p}_{s}0", "directions": s} for p in "ab" for s in "xy"]
    joint = {"name": "joint", "face": "b_z0", "against": "a_z1", "modes": "closed"}  # it alone holds the upper plate
    bolt = {"name": "m8", "face": "b_z1", "against": "a_z0", "preload": 5e4}
    held_below = [*sides, {"face": "a_z0", "directions": "z"}]
    table = {"supports": held_below, "closures": [joint], "bolts": [bolt], "modes": {"count": 2}}
    group = modal_basis(mesh, body(**table)).groups[0, 0]
    assert group.contacts["joint"].normal_force == pytest.approx(5e4, rel=1e-6)
    assert group.contacts["joint"].closed_share == pytest.approx(1, rel=1e-9)


BAD = {
    "closures.shroud.face": (closure(face="nowhere"), "the mesh has no face 'nowhere'"),
    "closures.shroud.against": (closure(against="nowhere"), "the mesh has no face 'nowhere'"),
    "closures.shroud: face 'right'": (closure(against="z0", sector_shift=0), "do not face each other"),
    "closures.shroud:": (closure(sector_shift=-1), "do not face each other"),
}


@pytest.mark.parametrize("key", BAD)
def test_closures_that_cannot_be_are_refused(key):
    bad, reason = BAD[key]
    assert refused(reason, modal_basis, shrouded((1, 1, 4)), settings_of(closures=[bad])).startswith(key)


def test_faces_that_overlap_and_an_unknown_number_of_sectors_are_refused():
    refused("inside 'left' of the neighbouring sector", modal_basis, shrouded((1, 1, 4), gap=-0.02), settings_of())
    no_number = settings_of(geometry={"mesh": "made.inp"})
    refused("the number of sectors is not known", modal_basis, shrouded((1, 1, 4)), no_number)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"rotation": {"prestress": "linear"}}, "found by Newton only"),
        ({"closures": [closure(against="ground")]}, "the ground has no sectors"),
        ({"closures": [closure(point=[0.0, 0, 0])]}, "describe the ground"),
        ({"closures": [closure(), closure()]}, "used twice"),
        ({"bolts": [{"name": "b", "face": "z0", "preload": -1.0}]}, "greater than 0"),
    ],
)
def test_settings_that_cannot_be_are_refused(change, reason):
    with pytest.raises(ValueError, match=reason):
        settings_of(**change)


@pytest.mark.slow
def test_interference_beyond_all_measure_is_refused():
    """Half a metre pressed into blocks of 0.4 m: a sentence, not a number."""
    with pytest.raises((UserError, NotConverged), match="closures|equilibrium|unstable"):
        rest(blocks(press=0.7))


@pytest.mark.parametrize("share", [0.04, 0.06])
def test_interference_is_held_against_the_body_before_anything_is_solved(share):
    """A twentieth of the body's extent is the limit, whatever the stiffness."""
    mesh = shrouded()
    press = share * float(np.ptp(mesh.points, axis=0).max())
    settings = settings_of([6000.0], closures=[closure(interference=press)])
    given = mesh, settings, [settings.material.material()]
    if share < 0.05:
        assert contact_pairs(*given)[0].interference == press
    else:
        refused(("closures", "interference: ", "too much for a body of"), contact_pairs, *given)
