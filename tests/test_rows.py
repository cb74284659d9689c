"""Interface, load, monitor and gauge rows, and the static compliance over all of them."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st
from meshes import CELLS, QUADRATIC, STEEL, body, brick, nearest, pipe, rotation_matrix, shaken, with_sets
from refusals import refused

from microslip.data import Mesh
from microslip.elasticity import isotropic
from microslip.errors import UserError
from microslip.fem.discretise import discretise, face_blocks, shape_functions
from microslip.fem.operators import displacement_gradient, mass, stiffness
from microslip.modal.body_rows import body_rows
from microslip.modal.compute import modal_basis
from microslip.modal.rigid import rigid_fields
from microslip.modal.rows import Locator, patch, point_rows, slope_rows, turning_row

SOME = np.array([[0.3, -1.0, 0.5], [2.0, 0.1, 0.4], [-0.6, 0.8, 1.0]])
E, NU, RHO = STEEL["young"], STEEL["poisson"], STEEL["density"]
BENT = {t: brick(t, (2, 3, 2), (0.1, 0.08, 0.05), to=shaken(0.004)) for t in CELLS}


def the_patch(mesh, face="x1", t2=(0.0, 0.2, 1.0)):
    return patch(mesh, face, np.array(t2), "contact")


# ---------------------------------------------------------------- six-component patches


@pytest.mark.parametrize("cell_type", CELLS)
def test_rigid_motions_are_read_exactly(cell_type):
    """Translation t and rotation w of a bent patch come back as R t, R w in its frame; the residual is zero."""
    mesh = BENT[cell_type]
    p = the_patch(mesh)
    fields = rigid_fields(mesh.points, p.origin)
    read = p.B @ fields.reshape(-1, 6)
    expected = np.zeros((6, 6))
    expected[:3, :3] = expected[3:, 3:] = p.rotation
    np.testing.assert_allclose(read, expected, atol=1e-11)
    np.testing.assert_allclose(p.fit_residual(fields), 0, atol=1e-12)


@pytest.mark.parametrize("cell_type", QUADRATIC)
def test_frame_of_a_patch(cell_type):
    """Right-handed n, t1, t2: n out of the body, t2 the hint in the plane, t1 = t2 x n."""
    mesh = brick(cell_type, (2, 2, 2), (0.1, 0.08, 0.05))
    for face, n in {"x1": (1, 0, 0), "x0": (-1, 0, 0), "y0": (0, -1, 0), "z1": (0, 0, 1)}.items():
        p = patch(mesh, face, np.array([0.3, 0.5, 0.7]), "contact")
        np.testing.assert_allclose(p.rotation[0], n, atol=1e-12)
        np.testing.assert_allclose(p.rotation @ p.rotation.T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(np.cross(p.rotation[0], p.rotation[1]), p.rotation[2], atol=1e-12)
        hint = np.array([0.3, 0.5, 0.7]) - np.array(n) * np.dot(n, [0.3, 0.5, 0.7])
        np.testing.assert_allclose(p.rotation[2], hint / np.linalg.norm(hint), atol=1e-12)
        np.testing.assert_allclose(p.normals, np.broadcast_to(n, p.normals.shape), atol=1e-12)
    assert patch(mesh, "x1", np.array([0.0, 0, 1]), "c").areas.sum() == pytest.approx(0.08 * 0.05)
    np.testing.assert_allclose(the_patch(mesh).origin, [0.1, 0.04, 0.025], atol=1e-15)


@pytest.mark.parametrize("cell_type", CELLS)
def test_forces_through_a_patch_do_the_work_of_the_rows(cell_type):
    """f = B^T (F, M): resultant F and moment M about the origin, in the patch's frame, on a bent patch."""
    mesh = BENT[cell_type]
    p = the_patch(mesh)
    for i in range(6):
        nodal = (p.B.T @ np.eye(6)[i]).reshape(-1, 3)
        force, moment = nodal.sum(axis=0), np.cross(mesh.points - p.origin, nodal).sum(axis=0)
        np.testing.assert_allclose(np.concatenate([p.rotation @ force, p.rotation @ moment]), np.eye(6)[i], atol=1e-10)
        assert not nodal[np.setdiff1d(np.arange(mesh.n_points), mesh.face_points("x1"))].any()
    rng = np.random.default_rng(0)
    u, f = rng.normal(size=3 * mesh.n_points), rng.normal(size=6)
    assert (p.B @ u) @ f == pytest.approx(u @ (p.B.T @ f), rel=1e-12)


def test_the_fit_is_the_least_squares_one():
    """No other rigid motion leaves a smaller area-weighted square (brute force over the patch's points)."""
    mesh = BENT["tetra10"]
    p = the_patch(mesh)
    u = np.random.default_rng(1).normal(size=(mesh.n_points, 3))
    there = p.N @ u
    A = rigid_fields(p.points, p.origin).reshape(-1, 6) * np.sqrt(np.repeat(p.areas, 3))[:, None]
    best, left, *_ = np.linalg.lstsq(A, (there * np.sqrt(p.areas)[:, None]).ravel(), rcond=None)
    read = p.B @ u.ravel()
    np.testing.assert_allclose(np.concatenate([p.rotation.T @ read[:3], p.rotation.T @ read[3:]]), best, rtol=1e-9)
    share = np.sqrt(left[0] / (p.areas @ (there**2).sum(axis=1)))
    assert p.fit_residual(u[:, :, None])[0] == pytest.approx(share, rel=1e-9)


def test_warping_shows_in_the_residual():
    """Of u = n (y^2 - mean) on a flat patch no rigid motion explains anything; half rigid leaves a known share."""
    mesh = brick("hexahedron20", (1, 4, 4), (0.1, 0.2, 0.2), (0, -0.1, -0.1))
    p = the_patch(mesh)
    bow = mesh.points[:, 1] ** 2 - 0.2**2 / 12
    warped = np.zeros((mesh.n_points, 3, 3))
    warped[:, 0, 0] = bow
    warped[:, 0, 1] = bow + 0.01
    warped[:, 0, 2] = 0.01
    spread = np.sqrt(0.1**4 * (1 / 5 - 1 / 9))  # rms of y^2 - mean over -0.1 .. 0.1
    np.testing.assert_allclose(p.fit_residual(warped), [1, spread / np.hypot(spread, 0.01), 0], atol=1e-9)


def test_area_weights_do_not_depend_on_the_mesh():
    """A patch refined on one side reads the same smooth motion: weights are areas, not numbers of nodes."""

    def uneven(points):
        out = points.copy()
        out[:, 1] = points[:, 1] ** 2
        return out

    even = brick("hexahedron20", (1, 4, 4))
    skewed = brick("hexahedron20", (1, 6, 3), to=uneven)
    field = lambda x: np.column_stack([x[:, 1] ** 2 - x[:, 2], x[:, 1] * x[:, 2], x[:, 2] ** 2])  # noqa: E731
    a, b = (the_patch(m).B @ field(m.points).ravel() for m in (even, skewed))
    np.testing.assert_allclose(a, b, atol=2e-3)
    assert abs(a[0] - (1 / 3 - 1 / 2)) < 1e-12


def test_curved_patch():
    """The bore of a quarter pipe: area, and a mean normal towards the axis (out of the body)."""
    mesh = pipe("hexahedron20", (1, 8, 2), 0.05, 0.08, 0.1, np.pi / 2)
    p = patch(mesh, "x0", np.array([0.0, 0.0, 1.0]), "bore")
    assert p.areas.sum() == pytest.approx(np.pi / 2 * 0.05 * 0.1, rel=1e-5)
    np.testing.assert_allclose(p.rotation[0], [-np.sqrt(0.5), -np.sqrt(0.5), 0], atol=1e-9)
    np.testing.assert_allclose(
        p.normals, -p.points * [1, 1, 0] / np.linalg.norm(p.points[:, :2], axis=1)[:, None], atol=2e-3
    )


@pytest.mark.parametrize(("face", "t2"), [("x1", (0, 0, 1)), ("y0", (0, 0, 1)), ("z1", (0, 1, 0)), ("z0", (0, 1, 0))])
def test_without_a_hint_t2_is_z_or_y_where_the_patch_lies_across_z(face, t2):
    """The commonest contact, a flat one under a weight, needs no hint; one that is given is still refused there."""
    mesh = brick("tetra10", (2, 2, 2), (0.1, 0.08, 0.05))
    p = patch(mesh, face, None, "contact")
    np.testing.assert_allclose(p.rotation[2], t2, atol=1e-12)
    assert np.linalg.det(p.rotation) == pytest.approx(1)
    if face[0] == "z":
        refused("along the normal", patch, mesh, face, np.array([0.0, 0, 1]), "contact")


def test_impossible_patches_are_refused():
    mesh = brick("tetra10", (1, 1, 1))
    refused("t2", patch, mesh, "x1", np.array([1.0, 0, 0]), "contact")
    closed = Mesh(
        mesh.points,
        mesh.cells,
        {"all": {"triangle6": np.concatenate([f["triangle6"] for f in mesh.faces.values()])}},
    )
    refused("closes on itself", patch, closed, "all", np.array([1.0, 0, 0]), "contact")


# ---------------------------------------------------------------- points and gauges

COEFFICIENTS = np.random.default_rng(7).normal(size=(10, 3))


def quadratic(x):
    """A full quadratic field (.., 3) and its gradient (.., 3, 3) u_i,j."""
    x = np.atleast_2d(x)
    one = np.ones(len(x))
    a, b, c = x.T
    u = np.column_stack([one, a, b, c, a * a, b * b, c * c, a * b, b * c, a * c]) @ COEFFICIENTS
    zero = 0 * one
    d = [[zero, one, zero, zero, 2 * a, zero, zero, b, zero, c], [zero, zero, one, zero, zero, 2 * b, zero, a, c, zero],
         [zero, zero, zero, one, zero, zero, 2 * c, zero, b, a]]  # fmt: skip
    g = np.stack([np.column_stack(k) @ COEFFICIENTS for k in d], axis=-1)
    return u, g


STRAIGHT = {
    t: brick(t, (2, 3, 2), (1.0, 0.8, 0.5), to=shaken(0.06), straight=True) for t in ("tetra10", "hexahedron27")
}


@pytest.mark.parametrize("cell_type", STRAIGHT)
@settings(max_examples=25)
@given(seed=st.integers(0, 10**6))
def test_point_rows_and_gauges_reproduce_quadratic_fields(cell_type, seed):
    """At any point of straight (not rectangular) tetrahedra; in skew bricks for linear fields."""
    mesh = STRAIGHT[cell_type]
    rng = np.random.default_rng(seed)
    cell = rng.choice(mesh.cells[cell_type])
    xi = rng.dirichlet(np.ones(4))[1:] if cell_type == "tetra10" else rng.uniform(0, 1, 3)
    point = shape_functions(cell_type, xi[None])[0][0] @ mesh.points[cell]
    place = Locator(mesh).find(point, "monitor")
    assert place.distance == 0
    np.testing.assert_allclose(place.point, point, atol=1e-9)
    u, g = quadratic(mesh.points)
    exact, gradient = quadratic(point)
    if cell_type != "tetra10":
        u = mesh.points @ COEFFICIENTS[1:4]
        exact, gradient = point[None] @ COEFFICIENTS[1:4], COEFFICIENTS[None, 1:4].transpose(0, 2, 1)
    directions = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0.6, 0.8]])
    read = point_rows(mesh.n_points, place, directions) @ u.ravel()
    np.testing.assert_allclose(read, directions @ exact[0], atol=1e-8)
    d = np.array([0.36, 0.48, 0.8])
    np.testing.assert_allclose(slope_rows(mesh.n_points, place, d) @ u.ravel(), gradient[0] @ d, atol=1e-7)


@pytest.mark.parametrize("cell_type", CELLS)
def test_every_node_and_quadrature_point_is_found(cell_type):
    """On bent cells: nodes, surface points and inner points lie in the body, in a cell that interpolates them."""
    mesh = BENT[cell_type]
    locator = Locator(mesh)
    d = discretise(mesh)
    inner = np.concatenate([np.einsum("qk,eki->eqi", b.N, mesh.points[b.cells]).reshape(-1, 3) for b in d.blocks])
    surface = np.concatenate([b.points.reshape(-1, 3) for b in face_blocks(mesh, "y1")])
    for x in np.concatenate([mesh.points[::3], inner[::17], surface[::5]]):
        place = locator.find(x, "monitor")
        assert place.distance < 1e-9 * 0.1
        np.testing.assert_allclose(place.N @ mesh.points[place.nodes], x, atol=1e-9 * 0.1)


def test_points_in_a_large_cell_beside_many_small_ones_are_found():
    """The centres of a hundred thin cells are nearer than that of the thick cell the point lies in."""

    def thin(points):
        out = points.copy()
        out[:, 0] = np.where(points[:, 0] <= 100, 1e-3 * points[:, 0], 0.1 + (points[:, 0] - 100))
        return out

    mesh = brick("hexahedron20", (101, 1, 1), (101.0, 0.2, 0.2), to=thin, straight=True)
    place = Locator(mesh).find(np.array([0.15, 0.11, 0.07]), "monitor")
    assert place.distance == 0
    np.testing.assert_allclose(place.point, [0.15, 0.11, 0.07], atol=1e-12)


def test_a_point_outside_is_drawn_to_the_surface():
    """Slightly outside: the nearest place of the body and how far; far outside: refused."""
    mesh = brick("tetra10", (3, 3, 3), (0.3, 0.2, 0.1))
    place = Locator(mesh).find(np.array([0.302, 0.11, 0.043]), "monitors.tip.point")
    np.testing.assert_allclose(place.point, [0.3, 0.11, 0.043], atol=1e-9)
    assert place.distance == pytest.approx(0.002, rel=1e-6)
    with pytest.raises(UserError, match="monitors.tip.point.*outside"):
        Locator(mesh).find(np.array([0.4, 0.1, 0.05]), "monitors.tip.point")


@settings(max_examples=25)
@given(direction=st.tuples(*[st.floats(-1, 1)] * 3), at=st.integers(0, 10**6))
def test_nearest_place_of_a_skew_body(direction, at):
    """Points pushed outwards from bent facets come back within a per cent of the shortest way."""
    mesh = BENT["tetra10"]
    points, normals = SKIN
    i = at % len(points)
    push = 5e-4 * (normals[i] + 0.5 * np.array(direction) / max(np.linalg.norm(direction), 1.0))
    x = points[i] + push
    place = Locator(mesh).find(x, "monitor")
    shortest = np.linalg.norm(DENSE - x, axis=1).min()
    assert place.distance <= shortest * 1.01 + 1e-6


def _skin():
    blocks = [b for name in BENT["tetra10"].faces for b in face_blocks(BENT["tetra10"], name)]
    normals = np.concatenate([b.area.reshape(-1, 3) for b in blocks])
    return np.concatenate([b.points.reshape(-1, 3) for b in blocks]), normals / np.linalg.norm(normals, axis=1)[:, None]


def _dense_skin():
    grid = np.array([(a, b) for a in np.linspace(0, 1, 25) for b in np.linspace(0, 1, 25) if a + b <= 1])
    N, _ = shape_functions("triangle6", grid)
    mesh = BENT["tetra10"]
    return np.concatenate(
        [np.einsum("qk,fki->fqi", N, mesh.points[f["triangle6"]]).reshape(-1, 3) for f in mesh.faces.values()]
    )


SKIN, DENSE = _skin(), _dense_skin()


# ---------------------------------------------------------------- static compliance

CLAMPED = {"supports": [{"face": "x0"}]}
ROWS = {
    "interfaces": [
        {"name": "tip", "face": "x1", "t2": [0.0, 0.0, 1.0]},
        {"name": "top", "face": "y1", "t2": [0.0, 0.0, 1.0]},
    ],
    "excitations": [
        {"name": "hammer", "point": [0.06, 0.04, 0.05], "direction": [0.0, 0.6, 0.8]},
        {"name": "gas", "face": "z1", "pressure": True},
    ],
    "monitors": [{"name": "probe", "point": [0.08, 0.03, 0.02], "directions": "xz"}],
}  # fmt: skip
STOCKY = brick("tetra10", (3, 2, 2), (0.1, 0.08, 0.05))


def operators(mesh):
    d = discretise(mesh)
    K = d.pattern.full(stiffness(d, isotropic(E, NU))).toarray()
    M = np.kron(d.pattern.full(mass(d, RHO)).toarray(), np.eye(3))
    return K, M


def the_group(mesh, count=8, **what):
    return modal_basis(mesh, body(**{"modes": {"count": count}, **what})).groups[0, 0]


@pytest.mark.parametrize("solver", ["auto", "superlu"])
def test_static_compliance_of_a_held_body(solver):
    """B K^-1 B^T of a dense direct solution."""
    what = {**CLAMPED, **ROWS}
    group = the_group(STOCKY, modes={"count": 8, "solver": solver}, **what)
    B, labels = body_rows(STOCKY, body(**what)).stacked
    K, _ = operators(STOCKY)
    free = np.setdiff1d(np.arange(len(K)), (3 * STOCKY.face_points("x0")[:, None] + np.arange(3)).ravel())
    B = B.toarray()[:, free]
    exact = B @ np.linalg.solve(K[np.ix_(free, free)], B.T)
    assert group.compliance.labels == labels and len(labels) == 6 + 6 + 2 + 2
    assert labels[0] == "interface:tip:u_n" and labels[-1] == "monitor:probe:u_z"
    scale = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    np.testing.assert_allclose(group.compliance.static / scale, exact / scale, atol=1e-9)
    assert not group.compliance.inertia_relief
    assert np.linalg.eigvalsh(group.compliance.static / scale).min() > -1e-10


def test_modal_compliance_rises_to_the_static_one():
    """What the modes leave out is positive semidefinite, shrinks with every mode, and is nothing for all modes."""
    mesh = brick("hexahedron20", (2, 1, 1), (0.1, 0.08, 0.05))
    what = {**CLAMPED, "interfaces": ROWS["interfaces"][:1], "monitors": ROWS["monitors"]}
    whole = the_group(mesh, 70, **what)
    static = whole.compliance.static
    scale = np.sqrt(np.outer(np.diag(static), np.diag(static)))
    rest = []
    for count in (2, 5, 10, 30, 70):
        c = the_group(mesh, count, **what).compliance
        np.testing.assert_allclose(c.static / scale, static / scale, atol=1e-9)
        values = np.linalg.eigvalsh(c.residual / scale)
        assert values.min() > -1e-9
        rest.append(np.trace(c.residual / scale))
    assert (np.diff(rest) < 0).all()
    n = 3 * (mesh.n_points - len(mesh.face_points("x0")))
    every = the_group(mesh, n - 2, **what).compliance
    assert np.abs(every.residual / scale).max() < 0.02 * rest[0]
    np.testing.assert_allclose(every.modal / scale, static / scale, atol=0.02)


@pytest.mark.parametrize("count", [6, 7, 12])
@pytest.mark.parametrize(
    ("shape", "n", "atol"),
    [((0.1, 0.08, 0.05), (3, 2, 2), 1e-7), ((1, 0.02, 0.01), (8, 1, 1), 1e-7), ((1, 0.02, 0.002), (10, 1, 1), 2e-5)],
    ids=["stocky", "slender", "thin"],
)  # the thin one: eps |K| / (lambda |M|) = 1e-6 for its first elastic mode
def test_inertia_relief_of_a_free_body(count, shape, n, atol):
    """Elastic compliance about the rigid motion: with P = 1 - M R R^T, C = B P^T K^+ P B^T (dense pseudo-inverse).

    Also for thin bodies of which only rigid modes are kept, where iterating on the search's shift hardly converges.
    """
    mesh = brick("hexahedron20", n, shape)
    what = {
        "free": True, "interfaces": ROWS["interfaces"][:1],
        "monitors": [{"name": "probe", "point": (np.array(shape) * [0.3, 0.4, 0.6]).tolist()}],
    }  # fmt: skip
    group = the_group(mesh, count, **what)
    B = body_rows(mesh, body(**what)).stacked[0].toarray()
    K, M = operators(mesh)
    R = rigid_fields(mesh.points, mesh.points.mean(axis=0)).reshape(-1, 6)
    w, Q = np.linalg.eigh(R.T @ M @ R)
    R = R @ (Q / np.sqrt(w))
    exact = relief(K, M, R, B)
    scale = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    assert group.compliance.inertia_relief
    np.testing.assert_allclose(group.compliance.static / scale, exact / scale, atol=atol)
    # and from all elastic modes: B phi phi^T B^T / omega^2
    values, vectors = scipy.linalg.eigh(K, M)
    T = B @ vectors[:, 6:]
    np.testing.assert_allclose(((T / values[6:]) @ T.T) / scale, exact / scale, atol=10 * atol)


def relief(K, M, R, B):
    """Elastic displacement u, M-orthogonal to the rigid motions, of K u = (1 - M R R^T) f, by a bordered system."""
    F = B.T - M @ (R @ (R.T @ B.T))
    border = M @ R
    scale = np.abs(K).max() / np.abs(border).max()
    A = np.block([[K, border * scale], [border.T * scale, np.zeros((6, 6))]])
    u = np.linalg.solve(A, np.vstack([F, np.zeros((6, F.shape[1]))]))[: len(K)]
    return B @ u


def test_hinged_body_has_its_inertia_relief_too():
    """One rigid motion left: held along an edge."""
    mesh = brick("hexahedron20", (3, 2, 1), (0.1, 0.08, 0.05))
    edge = np.flatnonzero((mesh.points[:, 0] == 0) & (mesh.points[:, 1] == 0))
    mesh = with_sets(mesh, hinge=edge)
    what = {"free": True, "supports": [{"face": "hinge"}], "interfaces": ROWS["interfaces"][:1]}
    group = the_group(mesh, 5, **what)
    B = body_rows(mesh, body(**what)).stacked[0].toarray()
    K, M = operators(mesh)
    free = np.setdiff1d(np.arange(len(K)), (3 * edge[:, None] + np.arange(3)).ravel())
    values, vectors = scipy.linalg.eigh(K[np.ix_(free, free)], M[np.ix_(free, free)])
    T = B[:, free] @ vectors[:, 1:]
    exact = (T / values[1:]) @ T.T
    scale = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    np.testing.assert_allclose(group.compliance.static / scale, exact / scale, atol=1e-7)


def test_reciprocity_and_loads():
    """Unit loads: a face force of resultant one along its direction; a pressure of one Pa pushes inwards."""
    what = {**CLAMPED, **ROWS}
    what["excitations"] = [*ROWS["excitations"], {"name": "pull", "face": "x1", "direction": [2.0, 0.0, 0.0]}]
    rows = body_rows(STOCKY, body(**what))
    pull = rows.excitations["pull"].B.toarray().reshape(-1, 3)
    np.testing.assert_allclose(pull.sum(axis=0), [1, 0, 0], atol=1e-12)
    gas = rows.excitations["gas"].B.toarray().reshape(-1, 3)
    np.testing.assert_allclose(gas.sum(axis=0), [0, 0, -0.1 * 0.08], atol=1e-15)
    np.testing.assert_allclose(
        np.cross(STOCKY.points, gas).sum(axis=0), np.cross([0.05, 0.04, 0.05], [0, 0, -0.008]), atol=1e-15
    )
    hammer = rows.excitations["hammer"].B.toarray().reshape(-1, 3)
    np.testing.assert_allclose(hammer.sum(axis=0), [0, 0.6, 0.8], atol=1e-12)
    group = the_group(STOCKY, **what)
    np.testing.assert_allclose(group.compliance.static, group.compliance.static.T, rtol=0, atol=0)
    assert set(group.interfaces) == {"tip", "top", "z1", "x1"} and group.interfaces["z1"].role == "load"


OFF_AXIS = {"axis": [0.0, 1.0, 0.0], "point": [-0.2, 0.0, -0.3]}
WHOLE = {"excitations": [{"name": "spin", "centrifugal": True}]}


def test_centrifugal_load_does_the_work_of_a_mass_at_its_centre():
    """A free brick along the axes: m r of its centre on translations, no moment about it (no products of inertia)."""
    group = the_group(STOCKY, free=True, rotation=OFF_AXIS, **WHOLE)
    spin = group.excitations["spin"]
    assert (spin.unit, spin.labels) == ("rad2/s2", ("centrifugal",))
    np.testing.assert_allclose(spin.point, [0.05, 0.04, 0.025], atol=1e-12)
    mass, arm = RHO * 0.1 * 0.08 * 0.05, np.array([0.25, 0.0, 0.325])
    rigid = group.phi.reshape(-1, group.n_modes)[:, :6]
    fields = rigid_fields(STOCKY.points, np.array([0.05, 0.04, 0.025])).reshape(-1, 6)
    share = np.linalg.lstsq(fields, rigid, rcond=None)[0]  # of translations and turns in each rigid mode
    np.testing.assert_allclose(spin.rows[0, :6], mass * arm @ share[:3], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("reduction", ["eigenmodes", "rubin"])
def test_centrifugal_load_bends_as_the_slow_equilibrium_does(reduction):
    """Compliance of monitor and load times Omega^2 is the equilibrium's displacement, but for softening, 1e-7 here."""
    what = {**CLAMPED, "reduction": reduction, "monitors": ROWS["monitors"], **WHOLE}
    c = the_group(STOCKY, rotation=OFF_AXIS, **what).compliance
    rows = [c.labels.index(f"monitor:probe:u_{d}") for d in "xz"]
    column = c.static[rows, c.labels.index("excitation:spin:centrifugal")]
    turning = the_group(STOCKY, rotation={**OFF_AXIS, "speeds_rpm": [30.0], "prestress": "linear"}, **what)
    np.testing.assert_allclose(np.pi**2 * column, turning.monitors["probe"].static, rtol=1e-6)


def test_modal_rows_are_the_rows_times_the_shapes():
    """T of every row set is its B times phi; patch shapes are the shapes at the patch's points."""
    what = {
        **CLAMPED,
        **ROWS,
        "gauges": [{"name": "foil", "point": [0.05, 0.04, 0.05], "direction": [3.0, 0.0, 0.0]}],
    }
    group = the_group(STOCKY, **what)
    rows = body_rows(STOCKY, body(**what))
    phi = group.phi.reshape(-1, group.n_modes)
    for name, p in rows.patches.items():
        i = group.interfaces[name]
        np.testing.assert_allclose(i.rows, p.B @ phi, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(i.shapes, np.einsum("pn,nim->pim", p.N.toarray(), group.phi), atol=1e-12)
        np.testing.assert_allclose(i.areas.sum(), p.areas.sum())
    foil = rows.gauges["foil"]
    np.testing.assert_allclose(group.gauges["foil"].rows, np.array([[1.0, 0, 0]]) @ (foil.B @ phi), rtol=1e-12)
    for kind in ("excitations", "monitors"):
        for name, r in getattr(rows, kind).items():
            np.testing.assert_allclose(getattr(group, kind)[name].rows, r.B @ phi, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(group.compliance.modal, group.compliance.modal.T, rtol=1e-12)


# ---------------------------------------------------------------- read-outs of the static state


def test_gauge_in_a_static_state_reads_strain_not_rotation():
    """A cantilever that bends far: its fibres strain by +- kappa h / 2 although the section turns by half a radian."""
    L, h = 1.0, 0.01
    mesh = brick("hexahedron27", (40, 1, 1), (L, h, h))
    P = 1.0 * E * h**4 / 12 / L**2
    where = [0.8 * L, h, h / 2]
    gauge = {"name": "foil", "point": where, "direction": [1.0, 0.0, 0.0]}
    monitor = {"name": "tip", "point": [L, h / 2, h / 2]}
    group = the_group(
        mesh, 2, material={**STEEL, "poisson": 0.0}, supports=[{"face": "x0"}], gauges=[gauge], monitors=[monitor],
        loads=[{"kind": "force", "face": "x1", "vector": [0.0, P, 0.0]}],
    )  # fmt: skip
    tip, here = (group.u_static[nearest(mesh, x)] for x in ([L, h / 2, h / 2], [0.8 * L, h / 2, h / 2]))
    np.testing.assert_allclose(group.monitors["tip"].static, tip, atol=1e-9)
    arm = 0.2 * L + tip[0] - here[0]
    strain = -P * arm / (E * h**4 / 12) * h / 2  # the fibre at +y is compressed
    assert group.gauges["foil"].static[0] == pytest.approx(strain, rel=0.03)


def test_gauge_modes_are_strain_modes():
    """The row of a gauge equals the strain mode at its place, along the fibre it is glued to (F d at speed)."""
    mesh = brick("tetra10", (1, 2, 6), (0.01, 0.04, 0.2), (0, 0, 0.1))
    mesh = Mesh(mesh.points @ rotation_matrix((0, 0, 0.5)).T, mesh.cells, mesh.faces, mesh.point_sets, mesh.node_id)
    (block,) = discretise(mesh).blocks
    centre = np.einsum("qk,eki->eqi", block.N, mesh.points[block.cells])
    e, q = 30, 2
    d = np.array([0.48, 0.6, 0.64])
    gauge = {"name": "foil", "point": centre[e, q].tolist(), "direction": d.tolist()}
    group = the_group(
        mesh, 4, supports=[{"face": "z0"}], gauges=[gauge],
        rotation={"speeds_rpm": [15000.0]}, output={"nodal_stress": False},
    )  # fmt: skip
    strain = group.stresses["gauss"].strain[4 * e + q]
    d = d + displacement_gradient(block, group.u_static)[e, q] @ d
    read = np.array([d[0] ** 2, d[1] ** 2, d[2] ** 2, d[0] * d[1], d[1] * d[2], d[0] * d[2]]) @ strain
    np.testing.assert_allclose(group.gauges["foil"].rows[0], read, rtol=1e-6)


def test_extent_and_outline_of_a_patch():
    """b0 along t1, h0 along t2, and the four corners anticlockwise about the outward normal."""
    mesh = brick("tetra10", (2, 3, 2), (0.1, 0.07, 0.05))
    p = patch(mesh, "x1", np.array([0.0, 0.0, 1.0]), "tip")
    np.testing.assert_allclose(p.extent, [0.07, 0.05], rtol=1e-12)
    assert len(p.polygon) == 4
    area = 0.5 * sum(np.cross(a, b) for a, b in zip(p.polygon, np.roll(p.polygon, -1, axis=0), strict=True))
    np.testing.assert_allclose(area, 0.07 * 0.05 * p.rotation[0], atol=1e-12)


# ---------------------------------------------------------------- the angle by which points turn


def turned(points, w, centre):
    """Small rotation w (3,) of points about a centre, and a shift, as (3n,)."""
    return (np.array([0.3, -0.2, 0.1]) + np.cross(w, points - centre)).reshape(-1)


def angle_rows(mesh, points, axis):
    locator = Locator(mesh)
    return turning_row(mesh.n_points, [locator.find(np.array(at), "at") for at in points], np.array(axis), "twist")


@pytest.mark.parametrize("centre", [(0, 0, 0), (0.4, -0.7, 0.2)])
def test_points_of_a_body_that_turns_rigidly_tell_the_angle_about_any_axis(centre):
    """a . w for points off a line, wherever the axis stands and however long the vector that names it is (1e-12)."""
    mesh, w, axis = BENT["tetra10"], np.array([2e-3, -1e-3, 3e-3]), np.array([1.0, 2.0, -0.5])
    corners = mesh.points[[0, 3, 11, 20, 31]]
    for scale in (1.0, 40.0):
        read = angle_rows(mesh, corners, scale * axis) @ turned(mesh.points, w, np.array(centre))
        assert read == pytest.approx(w @ axis / np.linalg.norm(axis), abs=1e-12)


def test_two_points_tell_the_difference_of_their_displacements_over_their_distance():
    """Two accelerometers 60 mm apart along y, angle about z: (u_x(-y) - u_x(y)) / 60 mm, of any motion (1e-12)."""
    mesh = brick("tetra10", (2, 2, 2), (0.1, 0.08, 0.05))
    rows = angle_rows(mesh, [(0.1, 0.01, 0.02), (0.1, 0.07, 0.02)], (0, 0, 1))
    (low, high), u = [Locator(mesh).find(np.array([0.1, y, 0.02]), "at") for y in (0.01, 0.07)], mesh.points**2 @ SOME
    reads = [float((point_rows(mesh.n_points, place, np.eye(3)[:1]) @ u.reshape(-1))[0]) for place in (low, high)]
    assert rows @ u.reshape(-1) == pytest.approx((reads[0] - reads[1]) / 0.06, abs=1e-12)
    assert rows @ turned(mesh.points, np.array([5e-3, 7e-3, 2e-3]), np.zeros(3)) == pytest.approx(2e-3, abs=1e-12)


def test_rows_and_supports_that_cannot_be_are_refused():
    """An angle of points along its axis, or without one; a centrifugal load along a direction; no free point."""
    mesh = brick("tetra10", (2, 2, 2), (0.1, 0.08, 0.05))
    for points in ([(0.02, 0.01, 0.02), (0.08, 0.01, 0.02)], [(0.02, 0.01, 0.02)] * 2):
        refused("monitors.twist.points", angle_rows, mesh, points, (1, 0, 0))
    for words, rows in (
        ("points and axis belong together", {"monitors": [{"name": "twist", "points": [[0, 0, 0], [1, 0, 0]]}]}),
        ("whole body", {"excitations": [{"name": "spin", "centrifugal": True, "direction": [1.0, 0.0, 0.0]}]}),
    ):
        with pytest.raises(ValueError, match=words):
            body(**rows)
    held = body(supports=[{"face": "x0"}, {"face": "x1"}])
    refused("supports: hold every point", modal_basis, brick("hexahedron", (1, 1, 1)), held)
