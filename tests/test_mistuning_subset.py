"""Discs in one piece whose sectors differ: a subset of nominal modes against the matrices of the whole ring."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import rings
import scipy.linalg
import scipy.sparse as sp
from meshes import body
from refusals import refused
from scipy.sparse.linalg import eigsh

from microslip.data import Mesh
from microslip.mesh import boundary_facets
from microslip.mistuning.ring import Tuned
from microslip.mistuning.scatter import Scatter
from microslip.mistuning.subset import mistuned, of_blade_modes
from microslip.modal.compute import modal_basis
from microslip.system.assembly import Assembly
from microslip.system.component import Component, Ring

N = 5
PATTERN = np.array([0.3, -1.2, 0.8, 1.1, -0.9])
MESH = rings.bladed_sector("hexahedron20", N)
TIP = int(MESH.face_points("top")[0])
RIM = 0.16
"""m, where the blade begins."""
HELD = {"supports": [{"face": "bore"}]}


@cache
def disc(count: int, gauss: bool = True) -> Component:
    output = {"gauss": gauss, "nodal_stress": False}
    tip = {"name": "tip", "point": MESH.points[TIP].tolist()}
    settings = body(
        **HELD, cyclic={"sectors": N}, modes={"count": count}, reduction="eigenmodes", output=output, monitors=[tip]
    )
    return Component("disc", {k: g for (_, k), g in modal_basis(MESH, settings).groups.items()}, sectors=N)


@cache
def whole():
    """The ring of the sector, its matrices, and those of one sector on its own nodes with what holds it."""
    ring = rings.full_ring(MESH, N)
    return ring, rings.matrices(ring.mesh, body(**HELD)), rings.matrices(MESH, body(**HELD))


@cache
def in_ring(j):
    """(3 n, 3 ring) the nodes of sector j, in their own axes, from those of the ring."""
    ring, n, three = whole()[0], MESH.n_points, np.arange(3)
    rows = np.broadcast_to(3 * np.arange(n)[:, None, None] + three[:, None], (n, 3, 3))
    columns = np.broadcast_to(3 * ring.nodes[j][:, None, None] + three, (n, 3, 3))
    turned = np.broadcast_to(ring.turns[j].T, (n, 3, 3))
    return sp.csr_matrix((turned.ravel(), (rows.ravel(), columns.ravel())), (3 * n, 3 * ring.mesh.n_points))


def frequencies(deviation, count=10):
    """(count,) rad/s of the ring of sectors each (1 + d)^2 as stiff, put together node by node."""
    one = whole()[2]
    return lowest(ring_of([(1 + d) ** 2 * one.K for d in deviation], one.free), count)


def ring_of(K, at):
    """Stiffness on all nodes of the ring, of K in each sector on some rows of its own."""
    return sum((S := in_ring(j)[at]).T @ sp.csr_matrix(own) @ S for j, own in enumerate(K))


def lowest(K, count=10):
    """(count,) rad/s of the ring with a stiffness on all its nodes."""
    tuned = whole()[1]
    K = K[tuned.free][:, tuned.free]
    return np.sqrt(eigsh(K.tocsc(), count, tuned.M.tocsc(), sigma=0, which="LM", v0=np.ones(K.shape[0]))[0])


@cache
def blade(count):
    """Its nodes in the sector, its modes alone, held at the rim, and (3 n, 3 n) stiffness of the blade that nothing
    holds."""
    cells = MESH.cells["hexahedron20"]
    nodes, at = np.unique(cells[radius(MESH.points[cells].mean(axis=1)) > RIM], return_inverse=True)
    mesh = Mesh(MESH.points[nodes], {"hexahedron20": at.reshape(-1, 20)}, node_id=np.arange(len(nodes)) + 1)
    facets = boundary_facets(mesh)["quad8"]
    root = facets[(radius(mesh.points[facets]) < RIM + 1e-9).all(axis=1)]
    mesh = replace(mesh, faces={"root": {"quad8": root}})
    settings = body(
        supports=[{"face": "root"}], modes={"count": count}, reduction="eigenmodes",
        output={"gauss": True, "nodal_stress": False},
    )  # fmt: skip
    return nodes, modal_basis(mesh, settings).groups[0, 0], rings.matrices(mesh, body()).K


def radius(points):
    return np.hypot(points[..., 0], points[..., 2])


def test_uniform_shifts():
    """All sectors alike: every frequency of the ring by d, whatever couples them."""
    tuned = mistuned(disc(4), np.zeros(N)).groups[0].omega
    assert np.allclose(mistuned(disc(4), np.full(N, 0.02)).groups[0].omega, 1.02 * tuned, rtol=1e-11)


def test_a_ring_takes_its_disc_in_one_piece():
    """Two scatters of one disc multiply, and other things of it do not scatter."""
    ring = Tuned(Assembly((disc(4),), (), (), (), Ring(N, 1)), {})
    one, two = Scatter("frequency", values=tuple(0.01 * PATTERN)), Scatter("frequency", 0.01)
    drawn = [(s, s.drawn(N, ring.modes(s), i, 0, 0)) for i, s in enumerate((one, two))]
    found = ring.mistuned(drawn).components[0].groups[0].omega
    both = (1 + drawn[0][1][:, 0]) * (1 + drawn[1][1][:, 0]) - 1
    assert np.allclose(found, mistuned(disc(4), both).groups[0].omega, rtol=1e-12)
    refused((), ring.check, (Scatter("damping", 0.1),))


def test_frequencies_of_the_whole_ring():
    """From above (Ritz), with an error of the second order in the deviations; smaller with more modes."""
    error = {}
    for count in (4, 12):
        for size in (0.01, 0.02):
            exact = frequencies(size * PATTERN)
            error[count, size] = mistuned(disc(count), size * PATTERN).groups[0].omega[:10] / exact - 1
            assert (error[count, size] > -1e-9).all() and error[count, size].max() < 4 * size**2
    assert np.log2(error[4, 0.02].mean() / error[4, 0.01].mean()) == pytest.approx(2, abs=0.15)
    assert (error[12, 0.02] < 0.9 * error[4, 0.02]).all()


def test_masses_on_the_tips():
    """Screws at the tips, against the matrices of the whole ring with these masses: from above, and the nearer the more
    modes there are."""
    ring, tuned, _ = whole()
    kg, masses, error = 0.01 * np.arange(N), np.zeros(3 * ring.mesh.n_points), {}
    masses.reshape(-1, 3)[ring.nodes[:, TIP]] = kg[:, None]
    M = tuned.M + sp.diags(masses[tuned.free])
    exact = np.sqrt(eigsh(tuned.K.tocsc(), 10, M.tocsc(), sigma=0, which="LM", v0=np.ones(M.shape[0]))[0])
    for count in (4, 12):
        tip = Tuned(Assembly((disc(count),), (), (), (), Ring(N, 1)), {})
        group = tip.mistuned([(Scatter("added_mass", values=tuple(kg), at="tip"), kg[:, None])]).components[0].groups[0]
        error[count] = np.sqrt(scipy.linalg.eigvalsh(group.K_r, group.M_r)[:10]) / exact - 1
    assert (error[4] > -1e-9).all() and (error[12] < error[4]).all() and error[12].max() < 1e-3
    assert np.abs(mistuned(disc(4), np.zeros(N)).groups[0].omega[:10] / exact - 1).max() > 0.01


def test_blades_whose_modes_differ_each_by_itself():
    """Component modes (CMM) against the whole ring, node by node, in each of whose blades three modes of the blade
    alone are stiffer or softer by themselves: from above, of the second order."""
    nodes, own, K = blade(3)
    at = (3 * nodes[:, None] + np.arange(3)).ravel()
    push, alike = (K @ own.phi.reshape(-1, 3)) / own.omega, ring_of([whole()[2].K] * N, whole()[2].free)
    d, error = np.random.default_rng(1).normal(size=(N, 3)), {}
    for size, counts in ((0.01, (4,)), (0.02, (4, 12))):
        exact = lowest(alike + ring_of([(push * ((1 + size * one) ** 2 - 1)) @ push.T for one in d], at))
        for count in counts:
            error[count, size] = of_blade_modes(disc(count), own, size * d).groups[0].omega[:10] / exact - 1
    assert (error[4, 0.01] > -1e-9).all() and error[4, 0.01].max() < 4e-5
    assert np.log2(error[4, 0.02].mean() / error[4, 0.01].mean()) == pytest.approx(2, abs=0.15)
    assert (error[12, 0.02] < 0.7 * error[4, 0.02]).all()
    assert np.abs(exact / lowest(alike) - 1).max() > 5e-3


def test_a_blade_that_is_not_the_disc_s():
    """Other cells, or more modes than it has."""
    own = blade(3)[1]
    points = own.stresses["gauss"]
    moved = replace(own, stresses={"gauss": replace(points, points=points.points + 1e-3)})
    for wrong, modes in ((moved, 3), (own, 4)):
        refused("blade", of_blade_modes, disc(4), wrong, np.zeros((N, modes)))


def test_the_order_of_the_sectors_turns_with_the_ring():
    """A pattern that begins one sector later, or is mirrored in time, has the same frequencies; a permuted one not."""
    one, other, mixed = (
        mistuned(disc(4), 0.02 * p).groups[0].omega[:5]
        for p in (PATTERN, np.roll(PATTERN, 2), PATTERN[[1, 0, 2, 3, 4]])
    )
    assert np.allclose(one, other, rtol=1e-11) and not np.allclose(one, mixed, rtol=1e-6)


def test_part_of_a_sector():
    """What the halves of a sector add is what the whole one adds, and one half is not all of it."""
    points = disc(4).groups[0].stresses["gauss"].points
    r = np.hypot(points[:, 0], points[:, 2])
    upper = r > 0.16
    tuned, up, down, both = (
        mistuned(disc(4), 0.01 * PATTERN, part).groups[0].K_r for part in (np.zeros(len(r), bool), upper, ~upper, None)
    )
    assert np.allclose(up + down - tuned, both, atol=1e-9 * np.abs(both).max())
    assert not np.allclose(up, both, atol=1e-3 * np.abs(both - tuned).max())


def test_deviations_that_are_none_and_what_is_not_in_the_file_are_refused():
    for deviation in (np.zeros(4), np.full(N, -1.0)):
        refused((), mistuned, disc(4), deviation)
    refused((), mistuned, disc(4, gauss=False), np.zeros(N))
    refused((), mistuned, Component("blade", {0: disc(4).groups[0]}), np.zeros(1))
