"""MAC, pairs of modes, points laid on nodes: what comparing two bodies rests on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import small
from hypothesis import given
from hypothesis import strategies as st
from refusals import refused

from microslip.data import ModalBasis
from microslip.reduced.correlation import compare_groups, mac, nearest_points, pair_table, pairs


def shapes(seed: int, count: int, d: int = 12) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(d, count)) + 1j * rng.normal(size=(d, count))


@given(st.integers(0, 1000), st.complex_numbers(min_magnitude=1e-6, max_magnitude=1e6))
def test_mac_knows_no_factor(seed: int, factor: complex) -> None:
    """MAC(A, c A) = 1, 0 <= MAC <= 1 (Cauchy-Schwarz), MAC(A, B) = MAC(B, A)^T."""
    A, B = shapes(seed, 3), shapes(seed + 1, 4)
    np.testing.assert_allclose(np.diag(mac(A, factor * A)), 1, rtol=1e-12)
    assert (mac(A, B) >= 0).all() and (mac(A, B) <= 1 + 1e-12).all()
    np.testing.assert_allclose(mac(A, B), mac(B, A).T, rtol=1e-12)


def test_mac_of_orthogonal_and_vanishing_shapes_is_zero() -> None:
    Q = np.linalg.qr(shapes(1, 4))[0]
    np.testing.assert_allclose(mac(Q, Q), np.eye(4), atol=1e-12)
    assert (mac(np.zeros((12, 1)), Q) == 0).all()


def test_pairs_are_the_best_matching_not_the_greedy_one() -> None:
    likeness = np.array([[0.9, 0.95], [0.2, 0.94]])
    assert [(p.first, p.second) for p in pairs(likeness, np.arange(2.0), np.arange(2.0))] == [(0, 0), (1, 1)]
    weak = pairs(np.array([[0.9, 0.0], [0.0, 0.3]]), np.array([10.0, 20.0]), np.array([11.0, 20.0]))
    assert [(p.first, p.second) for p in weak] == [(0, 0)] and weak[0].deviation == pytest.approx(0.1)


def thinned(basis: ModalBasis, step: int, shift: float = 0.0) -> ModalBasis:
    """A body that knows every `step`-th point only, moved by `shift`, with its modes in reverse order."""
    keep = np.arange(0, basis.mesh.n_points, step)
    mesh = replace(
        basis.mesh, points=basis.mesh.points[keep] + shift, cells={}, faces={}, point_sets={},
        node_id=basis.mesh.node_id[keep],
    )  # fmt: skip
    g = basis.groups[0, 0]
    back = np.arange(g.n_modes)[::-1]
    phi, omega = -2 * g.phi[keep][:, :, back], 1.01 * g.omega[back]
    group = replace(g, phi=phi, omega=omega, damping_ratio=g.damping_ratio[back])
    return replace(basis, mesh=mesh, groups={(0, 0): group}, source="matrices")


def test_a_body_is_found_again_in_another_order_on_fewer_points() -> None:
    basis = small.basis()
    found = compare_groups(basis, thinned(basis, 7, shift=1e-6))
    m = basis.groups[0, 0].n_modes
    assert [(p.first, p.second) for p in found.pairs] == [(i, m - 1 - i) for i in range(m)]
    np.testing.assert_allclose([p.mac for p in found.pairs], 1, rtol=1e-12)
    np.testing.assert_allclose([p.deviation for p in found.pairs], 0.01, rtol=1e-9)
    np.testing.assert_allclose(found.distance, np.sqrt(3) * 1e-6, rtol=1e-6)
    lines = pair_table(found)
    assert len(lines) == m + 2 and "+1.00%" in lines[1] and "1.0000" in lines[1]


def test_points_elsewhere_and_bodies_without_shapes_are_refused() -> None:
    basis, g = small.basis(), small.basis().groups[0, 0]
    refused("one unit of length", compare_groups, basis, thinned(basis, 7, shift=0.01))
    apart = np.array([[0.0, 0, 0], [0, 0, 1e-4]])
    refused("same nearest node", nearest_points, apart, basis.mesh.points, 1e-3)
    refused("no shapes", compare_groups, basis, replace(basis, groups={(0, 0): replace(g, phi=g.phi[:0])}))
