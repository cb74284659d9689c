"""Extended patches: characteristic constraint modes as interface coordinates, and interfaces that cannot have any."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from meshes import body, brick
from refusals import refused
from rings import bladed_sector

from microslip.basis import check_basis, read_basis, write_basis
from microslip.case import run_case
from microslip.case.settings import case_model
from microslip.fem.discretise import discretise, free_upper
from microslip.linalg import eigen
from microslip.modal.boundary import fixed_dofs
from microslip.modal.compute import modal_basis
from microslip.modal.equilibrium import make_model
from microslip.modal.spectrum import make_pencil
from microslip.reduction import METHODS
from microslip.ring import neighbours

COUNT = 3
RIGHT = {"name": "right", "face": "x1", "t2": [0.0, 0.0, 1.0]}
SHAPES = {**RIGHT, "coordinates": "characteristic", "count": COUNT}
TOP = {"name": "top", "face": "z1", "t2": [0.0, 1.0, 0.0]}
PUSH = {"name": "push", "face": "y1", "direction": [0.3, 0.5, 0.8]}
LOOK = {"name": "look", "point": [0.07, 0.02, 0.03]}
COMMON = {"excitations": [PUSH], "monitors": [LOOK]}


@cache
def mesh():
    return brick("tetra10", (3, 2, 2), (0.1, 0.06, 0.05))


@cache
def basis(method: str, free: bool = False, count: int = 8):
    held: dict = {"free": True} if free else {"supports": [{"face": "x0"}]}
    modes = {"count": count + 6 * free}
    settings = body(interfaces=[SHAPES, TOP], modes=modes, reduction=method, damping={"ratio": 0.01}, **held, **COMMON)
    return modal_basis(mesh(), settings)


def dense(free: bool = False):
    """K, M on the free degrees of freedom, and which of them those are."""
    settings = body(free=True) if free else body(supports=[{"face": "x0"}])
    d, fixed = discretise(mesh()), fixed_dofs(mesh(), settings)
    model = make_model(
        d, settings.material.material(), free_upper(d.pattern, fixed), fixed, np.array([0, 1.0, 0]), np.zeros(3), None,
        293.15, np.zeros((mesh().n_points, 3)), True,
    )  # fmt: skip
    pencil = make_pencil(model, model.K0, eigen.new_solver())
    eye = np.eye(pencil.n)
    return pencil.K(eye), pencil.M(eye), model.free.free


@pytest.mark.parametrize("method", list(METHODS))
def test_characteristic_rows_pass_every_check_and_travel_through_the_file(method, tmp_path):
    made = basis(method)
    assert [c.name for c in check_basis(made) if not c.passed] == []
    write_basis(tmp_path / "b.h5", made)
    back = read_basis(tmp_path / "b.h5")
    assert [c.name for c in check_basis(back) if not c.passed] == []
    a, b = made.groups[0, 0], back.groups[0, 0]
    assert a.compliance.labels[6:9] == ("interface:right:c1", "interface:right:c2", "interface:right:c3")
    np.testing.assert_array_equal(a.interfaces["right"].characteristic, b.interfaces["right"].characteristic)
    np.testing.assert_array_equal(a.interfaces["right"].pattern, b.interfaces["right"].pattern)


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("method", ["rubin", "craig-bampton", "dual-craig-bampton", "massless-boundary"])
def test_static_answers_over_characteristic_coordinates_are_exact(method, free):
    """Six rigid and three more coordinates on one patch, six on the other: as stiff as the full model to 1e-8."""
    c = basis(method, free).groups[0, 0].compliance
    at = [i for i, label in enumerate(c.labels) if label.startswith("interface:")]
    assert len(at) == 12 + COUNT
    scale = np.sqrt(np.outer(np.diag(c.static), np.diag(c.static)))[np.ix_(at, at)]
    assert np.abs((c.modal - c.static)[np.ix_(at, at)] / scale).max() < 1e-8


@pytest.mark.parametrize("free", [False, True])
def test_shapes_are_the_softest_of_the_condensed_patch(free):
    """Guyan condensation by dense inverses, the rigid coordinates held: the same span (largest subspace angle)."""
    K, M, dofs = dense(free)
    item = basis("rubin", free).groups[0, 0].interfaces["right"]
    face = np.intersect1d((3 * mesh().face_points("x1")[:, None] + np.arange(3)).ravel(), dofs)
    b = np.searchsorted(dofs, face)
    i = np.setdiff1d(np.arange(len(dofs)), b)
    G = -np.linalg.solve(K[np.ix_(i, i)], K[np.ix_(i, b)])
    Psi = np.zeros((len(dofs), len(b)))
    Psi[b], Psi[i] = np.eye(len(b)), G
    rigid, N = rigid_rows(face, item)
    Z = scipy.linalg.null_space(rigid / np.linalg.norm(rigid, axis=1, keepdims=True))
    V = Z @ scipy.linalg.eigh(Z.T @ Psi.T @ K @ Psi @ Z, Z.T @ Psi.T @ M @ Psi @ Z)[1][:, :COUNT]
    assert scipy.linalg.subspace_angles(N @ V, item.pattern.reshape(-1, COUNT)).max() < 1e-6


def rigid_rows(face, item):
    """The six rows of the patch on its displacements, and the displacements of its points."""
    from microslip.modal.rows import patch

    p = patch(mesh(), "x1", np.array([0.0, 0.0, 1.0]), "right")
    N = sp.kron(p.N, np.eye(3)).tocsr()[:, face].toarray()
    np.testing.assert_allclose(p.points, item.points, atol=1e-12)
    return p.B[:, face].toarray(), N


def test_rows_fit_the_shapes_and_are_blind_to_rigid_motion():
    """A rigid patch reads zero, a shape reads its own amplitude 1 and no rigid motion; unit root mean square."""
    g = basis("craig-bampton").groups[0, 0]
    item = g.interfaces["right"]
    kept = slice(0, 6 + COUNT)
    rows = np.vstack([item.rows, item.characteristic])[:, kept]
    np.testing.assert_allclose(rows, np.eye(6 + COUNT), atol=1e-8 * np.abs(g.phi).max())
    area = item.areas.sum()
    mean = np.einsum("p,pic,pic->c", item.areas, item.pattern, item.pattern) / area
    np.testing.assert_allclose(mean, 1.0, rtol=1e-12)
    assert np.abs(np.einsum("p,pic->ic", item.areas, item.pattern)).max() < 1e-9 * area
    free = basis("rubin", free=True).groups[0, 0]
    rigid = np.array(free.kind) == "rigid"
    size = np.abs(free.interfaces["right"].rows[:3, rigid]).max()
    assert np.abs(free.interfaces["right"].characteristic[:, rigid]).max() < 1e-9 * size


def test_shapes_close_in_on_a_patch_bonded_point_by_point():
    """A patch glued to the ground at every node: first frequency, coordinates held still one shape more at a time.

    Measured: six rigid coordinates are 1.9 % too low, twelve shapes more 0.7 %, all 69 of them exact.
    """
    K, M, dofs = dense()
    glued = np.isin(dofs // 3, mesh().face_points("x1"))
    inner = np.flatnonzero(~glued)
    exact = np.sqrt(scipy.linalg.eigh(
        K[np.ix_(inner, inner)], M[np.ix_(inner, inner)], eigvals_only=True, subset_by_index=(0, 0)
    )[0])  # fmt: skip
    errors = []
    for count in (0, 2, 12, 30, 69):
        more = {"coordinates": "characteristic", "count": count} if count else {}
        settings = body(
            supports=[{"face": "x0"}], interfaces=[{**RIGHT, **more}], modes={"count": 6}, reduction="craig-bampton"
        )  # fmt: skip
        g = modal_basis(mesh(), settings).groups[0, 0]
        errors.append(np.sqrt(g.K_r[6 + count, 6 + count]) / exact - 1)
    assert (np.diff(errors) > 0).all() and errors[0] < -0.01, errors
    assert abs(errors[-1]) < 1e-6  # all shapes are every displacement of the patch


@pytest.mark.parametrize("method", ["craig-bampton", "dual-craig-bampton", "massless-boundary"])
def test_an_interface_on_the_clamp_is_refused(method):
    """Facets that a support holds have no coordinate; an edge shared with the support is allowed."""
    on = {"name": "base", "face": "x0", "t2": [0.0, 0.0, 1.0]}
    settings = body(supports=[{"face": "x0"}], interfaces=[TOP, on], modes={"count": 4}, reduction=method)
    refused(("interfaces.base.face: ", " lie on the support 'x0'"), modal_basis, mesh(), settings)
    rubin = body(supports=[{"face": "x0"}], interfaces=[TOP, on], modes={"count": 4}, reduction="rubin")
    assert np.abs(modal_basis(mesh(), rubin).groups[0, 0].interfaces["base"].rows).max() == 0


def test_patches_that_cannot_have_coordinates_are_refused():
    """A roller holds one direction of the patch; more shapes than it has; shapes of a sector."""
    few = {"supports": [{"face": "x0"}], "modes": {"count": 4}}
    rolling = [{"face": "x0"}, {"face": "y1", "directions": "y"}]
    rolls = {"interfaces": [{"name": "roll", "face": "y1"}], "reduction": "craig-bampton", "supports": rolling}
    refused("roll", modal_basis, mesh(), body(**few | rolls))
    many = body(**few, interfaces=[{**SHAPES, "count": 400}])
    refused(("interfaces.right.count", "75 free displacements"), modal_basis, mesh(), many)
    shapes = {"name": "right", "face": "contact_right", "coordinates": "characteristic", "count": 2}
    sector = body(**few | {"supports": [{"face": "bore"}]}, cyclic={"sectors": 6}, interfaces=[shapes])
    refused("interfaces.right.coordinates", modal_basis, bladed_sector(), sector)


@pytest.mark.parametrize("wrong", [
    {"coordinates": "characteristic"}, {"count": 3}, {"coordinates": "characteristic", "count": 2, "role": "load"}
])  # fmt: skip
def test_settings_that_contradict_each_other_are_refused(wrong):
    with pytest.raises(ValueError, match="characteristic"):
        body(interfaces=[{**RIGHT, **wrong}])


STIFF = {"normal_stiffness": 1e8, "tangential_stiffness": 1e8}  # N/m


@pytest.mark.usefixtures("unjudged")
def test_a_case_uses_the_rigid_coordinates_of_a_patch_that_has_more():
    """The friction response with six springs a patch is the same with and without further coordinates on the patch."""
    case = case_model().model_validate({
        "name": "c", "body": "test", "excitation": "push", "monitor": "look", "direction": "y",
        "contacts": [{"interface": "right", "law": "jenkins", "friction": 1, **STIFF}],
        "sweep": {"start": 3000.0, "stop": 5000.0, "points": 4, "normal_forces": [1e9]},
    })  # fmt: skip
    plain = body(
        supports=[{"face": "x0"}], interfaces=[RIGHT, TOP], modes={"count": 8}, reduction="macneal",
        damping={"ratio": 0.01}, **COMMON,
    )  # fmt: skip
    a = run_case(case, modal_basis(mesh(), plain))
    b = run_case(case, basis("macneal"))
    np.testing.assert_allclose(b.responses[1e9].monitor, a.responses[1e9].monitor, rtol=1e-9)


@pytest.mark.parametrize("method", list(METHODS))
def test_every_method_reduces_a_sector_at_every_nodal_diameter(method):
    """Complex Hermitian at 0 < k < N/2: the file's own checks, and interface statics exact to 1e-8 where promised."""
    sector = bladed_sector()
    sides = {"right": "left", "left": "right"}
    interfaces = [
        {"name": side, "face": f"contact_{side}", "role": side, "partner": other, "t2": [0.0, 0.0, 1.0],
         "sector_shift": 1 if side == "right" else -1}
        for side, other in sides.items()
    ]  # fmt: skip
    settings = body(
        supports=[{"face": "bore"}], cyclic={"sectors": 6}, interfaces=interfaces, modes={"count": 8}, reduction=method
    )  # fmt: skip
    made = modal_basis(sector, settings)
    assert [c.name for c in check_basis(made) if not c.passed] == []
    assert [np.iscomplexobj(g.phi) for _, g in sorted(made.groups.items())] == [False, True, True, False]
    for g in made.groups.values():
        scale = np.sqrt(np.diag(g.compliance.static).real)
        error = np.abs(g.compliance.residual / np.outer(scale, scale)).max()
        assert error < 1e-8 or (error > 0.1 and method in ("eigenmodes", "macneal"))


def test_springs_between_neighbours_refuse_forces_for_coordinates():
    interfaces = [
        {"name": side, "face": f"contact_{side}", "role": side, "partner": other, "sector_shift": shift}
        for side, other, shift in (("right", "left", 1), ("left", "right", -1))
    ]
    settings = body(
        supports=[{"face": "bore"}], cyclic={"sectors": 6, "nodal_diameters": [1]}, interfaces=interfaces,
        modes={"count": 4}, reduction="dual-craig-bampton",
    )  # fmt: skip
    made = modal_basis(bladed_sector(), settings)
    refused("keeps forces", neighbours.stuck, made, made.groups[0, 1], "right", np.ones(6))
