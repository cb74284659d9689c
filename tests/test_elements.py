"""Shape functions, facets, volumes and node orders of every cell type."""

from __future__ import annotations

import numpy as np
import pytest
from meshes import CELLS, QUADRATIC, brick, pipe, shaken
from refusals import refused

from microslip.fem.discretise import discretise, face_blocks, quadrature, reference_nodes, shape_functions
from microslip.mesh import boundary_facets, mesh_problems, read_mesh
from microslip.mesh.gates import corner_volumes
from microslip.topology import CELL_TYPES, FACET_CORNERS

FACETS = tuple(FACET_CORNERS)
ORDER = {t: CELL_TYPES[t].order for t in CELLS} | {t: 1 if t in ("triangle", "quad") else 2 for t in FACETS}


def inside(cell_type: str, count: int) -> np.ndarray:
    """Random points of the reference cell."""
    d = reference_nodes(cell_type).shape[1]
    x = np.random.default_rng(3).dirichlet(np.ones(d + 1), count)[:, :d]
    return x if cell_type.startswith(("tet", "tri")) else np.random.default_rng(3).uniform(0, 1, (count, d))


@pytest.mark.parametrize("cell_type", CELLS + FACETS)
def test_shape_functions_are_one_at_their_node_and_sum_to_one(cell_type):
    nodes = reference_nodes(cell_type)
    N, _ = shape_functions(cell_type, nodes)
    np.testing.assert_allclose(N, np.eye(len(nodes)), atol=1e-14)
    N, dN = shape_functions(cell_type, inside(cell_type, 20))
    np.testing.assert_allclose(N.sum(axis=1), 1, atol=1e-14)
    np.testing.assert_allclose(dN.sum(axis=2), 0, atol=1e-13)


@pytest.mark.parametrize("cell_type", CELLS + FACETS)
def test_shape_functions_reproduce_every_polynomial_of_their_degree(cell_type):
    nodes, at = reference_nodes(cell_type), inside(cell_type, 20)
    N, dN = shape_functions(cell_type, at)
    d = nodes.shape[1]
    rng = np.random.default_rng(5)
    slope, bend = rng.normal(size=d), rng.normal(size=(d, d)) * (ORDER[cell_type] == 2)
    bend = bend + bend.T
    f = 0.7 + nodes @ slope + np.einsum("ki,ij,kj->k", nodes, bend, nodes)
    exact = 0.7 + at @ slope + np.einsum("ki,ij,kj->k", at, bend, at)
    np.testing.assert_allclose(N @ f, exact, atol=1e-13)
    np.testing.assert_allclose(dN @ f, slope + 2 * at @ bend, atol=1e-12)


@pytest.mark.parametrize("cell_type", CELLS + FACETS)
def test_gradients_are_the_differences_of_the_shape_functions(cell_type):
    at, h = inside(cell_type, 6), 1e-6
    _, dN = shape_functions(cell_type, at)
    for i in range(at.shape[1]):
        step = h * np.eye(at.shape[1])[i]
        difference = (shape_functions(cell_type, at + step)[0] - shape_functions(cell_type, at - step)[0]) / (2 * h)
        np.testing.assert_allclose(dN[:, i], difference, atol=1e-9)  # eps / h = 2e-10


@pytest.mark.parametrize("cell_type", CELLS + FACETS)
def test_quadrature_integrates_its_degree(cell_type):
    """Monomials x^a y^b z^c over simplex (a! b! c! / (a + b + c + d)!) and box (1 / ((a+1)(b+1)(c+1)))."""
    from itertools import product
    from math import factorial

    at, w = quadrature(cell_type)
    simplex = cell_type.startswith(("tet", "tri"))
    degree = {"tetra": 2, "tetra10": 2, "hexahedron": 3, "hexahedron20": 5, "hexahedron27": 5}.get(cell_type, 3)
    d = at.shape[1]
    for powers in product(range(degree + 1), repeat=d):
        if simplex and sum(powers) > degree:
            continue
        if simplex:
            exact = np.prod([factorial(p) for p in powers]) / factorial(sum(powers) + d)
        else:
            exact = np.prod([1 / (p + 1) for p in powers])
        assert w @ np.prod(at ** np.array(powers), axis=1) == pytest.approx(exact, abs=1e-14)


@pytest.mark.parametrize("cell_type", CELLS)
def test_spatial_gradients_of_a_bent_cell(cell_type):
    """Gradient of a linear field is exact on any isoparametric cell; volumes add up to the boundary integral."""
    mesh = brick(cell_type, (2, 2, 2), (1.0, 0.7, 0.5), to=shaken(0.05))
    g = np.array([0.3, -1.2, 2.0])
    for b in discretise(mesh).blocks:
        found = np.einsum("eqik,ek->eqi", b.grad, (mesh.points @ g)[b.cells])
        np.testing.assert_allclose(found, np.broadcast_to(g, found.shape), atol=1e-12)


@pytest.mark.parametrize("cell_type", CELLS)
def test_facets_point_outwards_and_close(cell_type):
    mesh = brick(cell_type, (2, 1, 2), (1.0, 0.7, 0.5), to=shaken(0.03))
    facets = CELL_TYPES[cell_type].facets
    x = mesh.points[mesh.cells[cell_type]]
    for f, facet_type in zip(facets, CELL_TYPES[cell_type].facet_types, strict=True):
        a = x[:, list(f)]
        corners = FACET_CORNERS[facet_type]
        normal = np.cross(a[:, 1] - a[:, 0], a[:, corners - 1] - a[:, 0])
        outwards = a[:, :corners].mean(axis=1) - x[:, : CELL_TYPES[cell_type].corners].mean(axis=1)
        assert (np.einsum("ei,ei->e", normal, outwards) > 0).all()
    blocks = [b for name in mesh.faces for b in face_blocks(mesh, name)]
    closed = sum(b.area.sum(axis=(0, 1)) for b in blocks)
    np.testing.assert_allclose(closed, 0, atol=1e-12)


@pytest.mark.parametrize("cell_type", CELLS)
def test_volume_and_moments_by_gauss_theorem(cell_type):
    """V = 1/3 of the surface integral of x.n, and the centre from x_i^2 n_i / 2: volume and facets agree.

    Exact up to the volume rule: a bent quadratic tetrahedron has a Jacobian of degree 3, the rule degree 2, so
    bent cells are integrated with a rule of degree 8 here.
    """
    mesh = brick(cell_type, (2, 2, 2), (1.0, 0.7, 0.5), to=shaken(0.04))
    d = discretise(mesh, {cell_type: 8})
    blocks = [b for name in mesh.faces for b in face_blocks(mesh, name)]
    surface = sum(np.einsum("fqi,fqi->", b.points, b.area) for b in blocks) / 3
    assert d.volume == pytest.approx(surface, rel=2e-6)  # the facet rule has degree 4 or 5, x.n dA more when bent
    total = sum(len(f) for f in boundary_facets(mesh).values())
    assert total == sum(len(b.facets) for b in blocks)


@pytest.mark.parametrize("cell_type", CELLS)
def test_volume_and_areas_of_a_box(cell_type):
    mesh = brick(cell_type, (2, 3, 1), (0.3, 0.2, 0.1))
    assert discretise(mesh).volume == pytest.approx(0.006, rel=1e-13)
    for name, area in {"x0": 0.02, "y1": 0.03, "z1": 0.06}.items():
        vector = sum(b.area.sum(axis=(0, 1)) for b in face_blocks(mesh, name))
        normal = {"x": 0, "y": 1, "z": 2}[name[0]]
        expected = np.eye(3)[normal] * area * (1 if name[1] == "1" else -1)
        np.testing.assert_allclose(vector, expected, atol=1e-16)
    assert mesh_problems(mesh)[0] == []


@pytest.mark.parametrize("cell_type", QUADRATIC)
def test_curved_sides_converge_with_fourth_order(cell_type):
    """Volume of a pipe whose mid-side nodes lie on the circle: error O(h^4)."""
    exact = np.pi * (0.1**2 - 0.06**2) * 0.05
    errors = [abs(discretise(pipe(cell_type, (1, n, 1), 0.06, 0.1, 0.05)).volume - exact) / exact for n in (8, 16)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.15)


@pytest.mark.parametrize("cell_type", QUADRATIC)
def test_inverted_cells_are_refused(cell_type):
    mesh = brick(cell_type, (1, 1, 1))
    mirrored = type(mesh)(mesh.points * [1, 1, -1], mesh.cells, {}, {}, mesh.node_id)
    assert "inside out" in mesh_problems(mirrored)[0][0]
    assert (corner_volumes(mirrored, cell_type) < 0).all()
    refused("inside out", discretise, mirrored)


# ---------------------------------------------------------------- node orders of files

# Edges in gmsh's order (gmsh manual, node ordering); the tetrahedron's last two are swapped against VTK's.
_GMSH_TET = [(0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3)]
_GMSH_HEX = [(0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 7), (5, 6), (6, 7)]
_GMSH_HEX_FACES = [(0, 1, 2, 3), (0, 1, 4, 5), (0, 3, 4, 7), (1, 2, 5, 6), (2, 3, 6, 7), (4, 5, 6, 7)]
_GMSH_NUMBER = {"tetra10": 11, "hexahedron20": 17, "hexahedron27": 12}


def gmsh_order(cell_type: str) -> list[int]:
    """VTK's local node at each place of gmsh's list, found from the reference coordinates."""
    nodes = reference_nodes(cell_type)
    corners = 4 if cell_type == "tetra10" else 8
    groups = [(i,) for i in range(corners)] + (_GMSH_TET if corners == 4 else _GMSH_HEX)
    if cell_type == "hexahedron27":
        groups += [*_GMSH_HEX_FACES, tuple(range(8))]
    wanted = np.array([nodes[list(g)].mean(axis=0) for g in groups])
    return [int(np.abs(nodes - w).max(axis=1).argmin()) for w in wanted]


@pytest.mark.parametrize("cell_type", QUADRATIC)
def test_a_gmsh_file_comes_back_in_our_order(cell_type, tmp_path):
    """A bent mesh written with gmsh's node order gives the same volume elements and named face."""
    mesh = brick(cell_type, (2, 1, 1), (1000.0, 700.0, 500.0), to=lambda p: 1e3 * shaken(0.05)(p / 1e3))
    order = gmsh_order(cell_type)
    ((facet_type, facets),) = mesh.faces["x1"].items()
    number = {"triangle6": 9, "quad8": 16, "quad9": 10}[facet_type]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "2", '2 1 "tip"', '3 2 "body"']
    lines += ["$EndPhysicalNames", "$Nodes", str(mesh.n_points)]
    lines += [f"{i + 1} {x!r} {y!r} {z!r}" for i, (x, y, z) in enumerate(mesh.points.tolist())]
    lines += ["$EndNodes", "$Elements", str(len(facets) + mesh.n_cells)]
    rows = [(number, 1, f) for f in facets] + [(_GMSH_NUMBER[cell_type], 2, c[order]) for c in mesh.cells[cell_type]]
    lines += [f"{i + 1} {t} 2 {g} {g} " + " ".join(str(k + 1) for k in nodes) for i, (t, g, nodes) in enumerate(rows)]
    path = tmp_path / "bent.msh"
    path.write_text("\n".join([*lines, "$EndElements", ""]))
    read = read_mesh(path, "mm")
    np.testing.assert_allclose(read.points, mesh.points / 1e3, rtol=1e-15)
    np.testing.assert_array_equal(read.cells[cell_type], mesh.cells[cell_type])
    np.testing.assert_array_equal(np.sort(read.faces["tip"][facet_type], axis=0), np.sort(facets, axis=0))


@pytest.mark.parametrize(("cell_type", "abaqus"), [("tetra10", "C3D10"), ("hexahedron20", "C3D20"), ("tetra", "C3D4")])
def test_an_abaqus_file_comes_back_in_our_order(cell_type, abaqus, tmp_path):
    mesh = brick(cell_type, (2, 1, 1), (1.0, 0.7, 0.5), to=shaken(0.05))
    held = mesh.face_points("x0")
    lines = ["*NODE", *(f"{i + 1}, {x!r}, {y!r}, {z!r}" for i, (x, y, z) in enumerate(mesh.points.tolist()))]
    lines += [f"*ELEMENT, TYPE={abaqus}, ELSET=body"]
    for e, cell in enumerate(mesh.cells[cell_type]):
        text = [str(e + 1), *(str(k + 1) for k in cell)]
        lines += [", ".join(text[i : i + 12]) + ("," if i + 12 < len(text) else "") for i in range(0, len(text), 12)]
    lines += ["*NSET, NSET=root", *(f"{k + 1}," for k in held), ""]
    path = tmp_path / "bent.inp"
    path.write_text("\n".join(lines))
    read = read_mesh(path, "cm")
    np.testing.assert_allclose(read.points, mesh.points * 1e-2, rtol=1e-15)
    np.testing.assert_array_equal(read.cells[cell_type], mesh.cells[cell_type])
    np.testing.assert_array_equal(read.point_sets["root"], held)
    np.testing.assert_array_equal(read.face_points("root"), held)
