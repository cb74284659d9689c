"""Discs in one piece whose sectors differ: a subset of nominal modes against the matrices of the whole ring."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import rings
import scipy.linalg
import scipy.sparse as sp
from meshes import body
from scipy.sparse.linalg import eigsh

from microslip.errors import UserError
from microslip.mistuning.ring import Tuned
from microslip.mistuning.scatter import Scatter
from microslip.mistuning.subset import mistuned
from microslip.modal.compute import modal_basis
from microslip.system.assembly import Assembly
from microslip.system.component import Component, Ring

N = 5
PATTERN = np.array([0.3, -1.2, 0.8, 1.1, -0.9])
MESH = rings.bladed_sector("hexahedron20", N)
TIP = int(MESH.face_points("top")[0])
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


def frequencies(deviation, count=10):
    """(count,) rad/s of the ring of sectors each (1 + d)^2 as stiff, put together node by node."""
    ring, tuned, one = whole()
    n, K = MESH.n_points, 0
    three = np.arange(3)
    for j, d in enumerate(deviation):
        rows = np.broadcast_to(3 * np.arange(n)[:, None, None] + three[:, None], (n, 3, 3))
        columns = np.broadcast_to(3 * ring.nodes[j][:, None, None] + three, (n, 3, 3))
        turned = np.broadcast_to(ring.turns[j].T, (n, 3, 3))
        S = sp.csr_matrix((turned.ravel(), (rows.ravel(), columns.ravel())), (3 * n, 3 * ring.mesh.n_points))[one.free]
        K = K + (1 + d) ** 2 * S.T @ one.K @ S
    K = K[tuned.free][:, tuned.free]
    return np.sqrt(eigsh(K.tocsc(), count, tuned.M.tocsc(), sigma=0, which="LM", v0=np.ones(K.shape[0]))[0])


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
    with pytest.raises(UserError):
        ring.check((Scatter("damping", 0.1),))


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


@pytest.mark.parametrize("deviation", [np.zeros(4), np.full(N, -1.0)])
def test_deviations_that_are_none(deviation):
    with pytest.raises(UserError):
        mistuned(disc(4), deviation)


def test_what_is_not_in_the_file():
    with pytest.raises(UserError):
        mistuned(disc(4, gauss=False), np.zeros(N))
    with pytest.raises(UserError):
        mistuned(Component("blade", {0: disc(4).groups[0]}), np.zeros(1))
