"""Wedges and pyramids: the same mathematics as every other cell, and CalculiX's wedge where it is installed."""

from __future__ import annotations

from itertools import product

import decks
import meshes
import numpy as np
import pytest

from microslip import elements
from microslip.basis import check_basis
from microslip.data import Mesh
from microslip.elasticity import isotropic
from microslip.fem.discretise import discretise, face_blocks, shape_functions
from microslip.fem.operators import mass, stiffness
from microslip.mesh import boundary_facets, mesh_problems, read_mesh
from microslip.modal.compute import modal_basis
from microslip.modal.rows import Locator
from microslip.topology import CELL_TYPES

WEDGES = meshes.WEDGES
C = isotropic(2.1e11, 0.3)


@pytest.mark.parametrize("cell_type", WEDGES)
def test_shape_functions_are_one_at_their_node_and_reproduce_their_polynomials(cell_type):
    kind = CELL_TYPES[cell_type]
    rng = np.random.default_rng(1)
    inside = rng.dirichlet(np.ones(kind.corners), 20) @ kind.reference[: kind.corners]
    N, dN = shape_functions(cell_type, inside)
    np.testing.assert_allclose(shape_functions(cell_type, kind.reference)[0], np.eye(len(kind.reference)), atol=1e-11)
    for power in product(range(kind.order + 1), repeat=3):
        if sum(power) > kind.order:
            continue
        values = np.prod(kind.reference ** np.array(power), axis=1)
        np.testing.assert_allclose(N @ values, np.prod(inside ** np.array(power), axis=1), atol=1e-11)
    step = 1e-6
    for d in range(3):
        e = step * np.eye(3)[d]
        slope = (shape_functions(cell_type, inside + e)[0] - shape_functions(cell_type, inside - e)[0]) / (2 * step)
        np.testing.assert_allclose(dN[:, d], slope, atol=1e-7)


@pytest.mark.parametrize("cell_type", WEDGES)
def test_rule_integrates_what_it_should(cell_type):
    """Degree 2 at least (degree 5 along a height), and the volume 1/2 or 1/3."""
    at, w = elements.rule(cell_type)
    wedge = cell_type.startswith("wedge")
    assert w.sum() == pytest.approx(1 / 2 if wedge else 1 / 3, abs=1e-14)
    for i, j, k in product(range(3), repeat=3):
        if i + j + k > 2:
            continue
        if wedge:  # i! j! / (i + j + 2)! on the triangle
            f = [1, 1, 2, 6, 24]
            exact = f[i] * f[j] / f[i + j + 2] / (k + 1)
        else:
            z = np.polynomial.legendre.leggauss(8)
            exact = 0.0
            for h, v in zip((z[0] + 1) / 2, z[1] / 2, strict=True):
                span = [[((1 + s * (1 - h)) / 2) ** (p + 1) / (p + 1) for s in (1, -1)] for p in (i, j)]
                exact += v * h**k * (span[0][0] - span[0][1]) * (span[1][0] - span[1][1])
        assert w @ np.prod(at ** np.array([i, j, k]), axis=1) == pytest.approx(exact, abs=1e-13)


@pytest.mark.parametrize("cell_type", WEDGES)
def test_patch_test_on_bent_and_shaken_cells(cell_type):
    """A linear displacement has the energy of its strain, rigid motions none; facets close and hold the volume."""
    mesh = meshes.brick(cell_type, (2, 2, 2), (1.0, 0.7, 0.5), to=meshes.shaken(0.03))
    d = discretise(mesh)
    K = d.pattern.full(stiffness(d, C))
    A = np.random.default_rng(2).standard_normal((3, 3))
    u = (mesh.points @ A.T).ravel()
    e = 0.5 * (A + A.T)
    strain = np.array([e[0, 0], e[1, 1], e[2, 2], 2 * e[0, 1], 2 * e[1, 2], 2 * e[0, 2]])
    assert u @ (K @ u) == pytest.approx(strain @ C @ strain * d.volume, rel=1e-11)
    spin = (mesh.points @ (A - A.T).T).ravel()
    assert np.abs(K @ spin).max() < 1e-10 * np.abs(K @ u).max()
    facets = boundary_facets(mesh)
    whole = Mesh(mesh.points, mesh.cells, {"all": facets})
    blocks = face_blocks(whole, "all")
    np.testing.assert_allclose(sum(b.area.sum(axis=(0, 1)) for b in blocks), 0, atol=1e-12)
    flux = sum(np.einsum("fqi,fqi->", b.points, b.area) for b in blocks) / 3
    assert flux == pytest.approx(d.volume, rel=2e-4)  # bent facets by a rule of degree 4
    assert mesh_problems(mesh)[0] == []


@pytest.mark.parametrize("cell_type", ["wedge15", "pyramid13"])
def test_quadratic_cells_hold_a_quadratic_displacement_exactly(cell_type):
    """Pure bending of a bar of straight cells: energy E I kappa^2 L / 2 with nu = 0."""
    mesh = meshes.brick(cell_type, (1, 2, 2), (0.3, 0.4, 1.0))
    d = discretise(mesh)
    K = d.pattern.full(stiffness(d, isotropic(2e11, 0.0)))
    y, z = mesh.points[:, 1] - 0.2, mesh.points[:, 2]
    u = np.column_stack([0 * y, 0.5 * z**2, -y * z]).ravel() * 1e-3  # curvature 1e-3 per metre
    assert 0.5 * u @ (K @ u) == pytest.approx(0.5 * 2e11 * 0.3 * 0.4**3 / 12 * 1e-6, rel=1e-11)


def mixed() -> Mesh:
    """A brick below six pyramids, joined at a face."""
    low = meshes.brick("hexahedron20", (1, 1, 1), (1.0, 1.0, 1.0))
    high = meshes.brick("pyramid13", (1, 1, 1), (1.0, 1.0, 1.0), (0, 0, 1.0))
    points = np.vstack([low.points, high.points])
    _, first, new = np.unique(np.round(points, 9), axis=0, return_index=True, return_inverse=True)
    new = new.ravel()
    cells = {"hexahedron20": new[low.cells["hexahedron20"]], "pyramid13": new[high.cells["pyramid13"] + low.n_points]}
    return Mesh(points[first], cells, node_id=np.arange(1, len(first) + 1))


def test_pyramids_fit_bricks():
    """Patch test across their common face, and no facet of it is left on the surface."""
    mesh = mixed()
    facets = boundary_facets(mesh)
    assert {t: len(f) for t, f in facets.items()} == {"quad8": 10}
    d = discretise(mesh)
    K = d.pattern.full(stiffness(d, C))
    A = np.random.default_rng(5).standard_normal((3, 3))
    u = (mesh.points @ A.T).ravel()
    inner = [i for i in range(mesh.n_points) if not np.isin(i, np.concatenate([f.ravel() for f in facets.values()]))]
    force = (K @ u).reshape(-1, 3)
    assert np.abs(force[inner]).max() < 1e-11 * np.abs(force).max()
    assert d.volume == pytest.approx(2.0, rel=1e-12)


@pytest.mark.parametrize("cell_type", ["wedge15", "pyramid13"])
def test_clamped_bar_is_no_stiffer_than_of_tetrahedra(cell_type):
    """Against fine bricks, on the same boxes: every frequency at least as good as ten-node tetrahedra's."""

    def lowest(kind, n):
        mesh = meshes.brick(kind, n, (0.02, 0.03, 0.12))
        what = meshes.body(supports=[{"face": "z0"}], modes={"count": 4, "solver": "superlu"}, free=False)
        basis = modal_basis(mesh, what)
        assert all(c.passed for c in check_basis(basis))
        return basis.groups[0, 0].omega[:4]

    exact = lowest("hexahedron20", (3, 4, 14))
    error = {kind: np.abs(lowest(kind, (2, 2, 8)) / exact - 1) for kind in (cell_type, "tetra10")}
    assert (error[cell_type] < error["tetra10"]).all()
    assert error[cell_type].max() < 0.5 * np.abs(lowest(cell_type, (1, 1, 4)) / exact - 1).max()


@pytest.mark.parametrize("cell_type", WEDGES)
def test_points_are_found_inside_and_the_nearest_place_outside(cell_type):
    mesh = meshes.brick(cell_type, (1, 2, 2), (1.0, 0.7, 0.5), to=meshes.shaken(0.02))
    locator = Locator(mesh)
    rng = np.random.default_rng(4)
    for cell in mesh.cells[cell_type][:6]:
        kind = CELL_TYPES[cell_type]
        xi = rng.dirichlet(np.full(kind.corners, 2.0)) @ kind.reference[: kind.corners]
        point = shape_functions(cell_type, xi[None])[0][0] @ mesh.points[cell]
        found = locator.find(point, "here")
        assert found.distance < 1e-9
        np.testing.assert_allclose(found.N @ mesh.points[found.nodes], point, atol=1e-9)
        np.testing.assert_allclose(found.grad @ mesh.points[found.nodes], np.eye(3), atol=1e-8)


@pytest.mark.skipif(decks.CCX is None, reason="needs CalculiX")
def test_wedges_of_a_deck_give_calculix_own_frequencies(tmp_path):
    """C3D15, shaken: node order, rule and mass are CalculiX's; it prints seven digits."""
    mesh = meshes.brick("wedge15", (1, 2, 3), (0.01, 0.015, 0.04), to=meshes.shaken(0.0005))
    lines = [*decks.mesh_lines(mesh, sets=("z0",)), *decks.MATERIAL, decks.section()]
    theirs = decks.run(tmp_path, "part", [*lines, "*BOUNDARY", "z0, 1, 3", *decks.frequency_step(6)])
    read = read_mesh(tmp_path / "part.inp", "mm", "mm-t-s")
    what = meshes.body({"from": "mesh"}, supports=[{"face": "z0"}], modes={"count": 6, "solver": "superlu"})
    np.testing.assert_allclose(modal_basis(read, what).groups[0, 0].frequency[:6], theirs[:6], rtol=1e-6)


@pytest.mark.parametrize("cell_type", WEDGES)
def test_mass_of_a_bent_body_is_its_volume(cell_type):
    mesh = meshes.brick(cell_type, (2, 2, 2), (1.0, 0.7, 0.5), to=meshes.shaken(0.03))
    d = discretise(mesh)
    assert d.pattern.full(mass(d, 7.0)).sum() == pytest.approx(7.0 * d.volume, rel=1e-12)
