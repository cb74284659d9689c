"""Following modes over the speed: MAC, tracking through a crossing and a veering, engine-order crossings."""

from __future__ import annotations

import dataclasses
import math
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import small
from hypothesis import given
from hypothesis import strategies as st

from microslip.data import Array, ModalGroup
from microslip.modal.campbell import LINK, Tracks, crossings, mac, track, track_basis
from microslip.pictures.diagrams import campbell_plot, ceiling
from microslip.pictures.plots import save


def shapes(n: int, m: int, seed: int = 0) -> Array:
    return np.random.default_rng(seed).normal(size=(n, 3, m))


def at(speed: float, omega: Array, phi: Array) -> ModalGroup:
    """A group with nothing but speed, frequencies and shapes that matters here."""
    template = small.basis().groups[0, 0]
    order = np.argsort(omega)
    kind = ("normal",) * len(omega)
    return dataclasses.replace(template, speed=speed, omega=omega[order], phi=phi[:, :, order], kind=kind)


def orthonormal(n: int, m: int) -> Array:
    q, _ = np.linalg.qr(shapes(n, m).reshape(-1, m))
    return q.reshape(n, 3, m)


@given(st.integers(0, 10_000), st.floats(0.01, 100.0), st.booleans())
def test_mac_knows_neither_size_nor_sign_and_lies_between_0_and_1(seed: int, size: float, flip: bool) -> None:
    A, weights = shapes(7, 3, seed), np.random.default_rng(seed).uniform(0.1, 2.0, 7)
    B = A * size * (-1 if flip else 1)
    np.testing.assert_allclose(np.diag(mac(A, B, weights)), 1.0, rtol=0, atol=1e-12)
    other = mac(A, shapes(7, 4, seed + 1), weights)
    assert other.shape == (3, 4)
    assert (other >= 0).all() and (other <= 1 + 1e-12).all()


def test_mac_of_orthogonal_shapes_is_zero_and_of_a_null_shape_is_zero() -> None:
    phi = orthonormal(5, 4)
    np.testing.assert_allclose(mac(phi, phi), np.eye(4), rtol=0, atol=1e-14)
    assert mac(phi, np.zeros((5, 3, 1))).tolist() == [[0.0]] * 4


def test_weights_decide_what_is_orthogonal() -> None:
    """With the mass as weights, modes normalised by that mass are orthogonal; without weights they are not."""
    basis = small.basis()
    phi, weights = basis.groups[0, 0].phi, basis.groups[0, 0].stresses["nodes"].weights
    off = mac(phi, phi, weights) - np.eye(phi.shape[2])
    plain = mac(phi, phi) - np.eye(phi.shape[2])
    assert np.abs(off).max() < 0.02  # nodal volumes are a lumped mass, hence not exactly zero
    assert np.abs(off).max() < np.abs(plain).max()


def test_curves_cross_when_the_shapes_do() -> None:
    """Two modes whose order swaps between two speeds keep their own curve; a third stays where it is."""
    phi = orthonormal(6, 3)
    groups = [at(0.0, np.array([10.0, 20.0, 30.0]), phi), at(5.0, np.array([21.0, 20.0, 30.0]), phi)]
    tracks = track(groups)
    assert tracks.modes.tolist() == [[0, 1], [1, 0], [2, 2]]
    np.testing.assert_allclose(tracks.omega, [[10.0, 21.0], [20.0, 20.0], [30.0, 30.0]])
    np.testing.assert_allclose(tracks.mac, 1.0)


def test_curves_veer_when_the_shapes_turn() -> None:
    """Where the shapes turn by 90 degrees in small steps the frequencies do not cross (Leissa's veering)."""
    x = np.linspace(-4.0, 4.0, 33)
    phi = orthonormal(6, 2)
    groups = []
    for i, xi in enumerate(x):
        values, vectors = np.linalg.eigh(np.array([[100.0 + xi, 1.0], [1.0, 100.0 - xi]]))
        groups.append(at(float(i), np.sqrt(values), phi @ vectors))
    tracks = track(groups)
    assert tracks.modes.tolist() == [[0] * 33, [1] * 33]
    assert tracks.mac.min() > 0.9
    first, last = groups[0].phi[:, :, :1], groups[-1].phi[:, :, :1]
    assert mac(first, last)[0, 0] < 0.1  # and yet the shape at the end is the other one


def test_a_mode_that_leaves_ends_its_curve_and_a_new_one_begins() -> None:
    phi = orthonormal(6, 4)
    groups = [
        at(0.0, np.array([10.0, 20.0, 30.0]), phi[:, :, :3]),
        at(5.0, np.array([10.0, 20.0, 25.0]), phi[:, :, [0, 1, 3]]),
    ]
    tracks = track(groups)
    assert tracks.modes.tolist() == [[0, 0], [1, 1], [2, -1], [-1, 2]]
    assert np.isnan(tracks.omega[2, 1]) and np.isnan(tracks.omega[3, 0])
    assert np.isnan(tracks.mac[2:]).all()
    assert LINK < 0.5


def test_without_shapes_modes_are_joined_by_number() -> None:
    none = np.zeros((0, 3, 2))
    tracks = track([at(0.0, np.array([10.0, 20.0]), none), at(1.0, np.array([11.0, 21.0]), none)])
    assert tracks.modes.tolist() == [[0, 0], [1, 1]]


@given(st.floats(10.0, 500.0), st.floats(0.0, 0.9), st.integers(1, 8))
def test_an_engine_order_meets_southwells_curve_where_the_closed_form_says(rest: float, b: float, order: int) -> None:
    """omega^2 = omega_0^2 + B Omega^2 and omega = k Omega meet at Omega = omega_0 / sqrt(k^2 - B)."""
    exact = rest / math.sqrt(order**2 - b)
    speeds = np.array([0.0, 0.4, 1.7, 3.0]) * exact
    omega = np.sqrt(rest**2 + b * speeds**2)
    tracks = Tracks(speeds, np.zeros((1, 4), dtype=np.int64), omega[None], np.ones((1, 3)))
    (found,) = crossings(tracks, [order])
    assert found.speed == pytest.approx(exact, rel=1e-9)
    assert found.frequency == pytest.approx(order * exact / (2 * np.pi), rel=1e-9)
    middle = np.array([0.7 * exact, 2.0 * exact])
    np.testing.assert_allclose(tracks.frequency(0, middle), np.sqrt(rest**2 + b * middle**2) / (2 * np.pi), rtol=1e-12)


@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_an_engine_order_meets_a_whirl_between_two_speeds_where_the_closed_form_says(way: float) -> None:
    """A mass that swings alike in all directions, seen from the frame that turns: omega_0 -+ Omega, which meets k Omega
    at omega_0 / (k +- 1); without gyroscopic coupling it has omega_0^2 - Omega^2 there."""
    rest, order, speeds = 100.0, 3, np.array([0.0, 60.0])
    omega = rest + way * speeds
    one = Tracks(speeds, np.zeros((1, 2), dtype=np.int64), omega[None], np.ones((1, 1)))
    (found,) = crossings(one.coupled(np.sqrt(rest**2 - speeds**2)[:, None]), [order])
    assert found.speed == pytest.approx(rest / (order - way), rel=1e-9)


def test_no_crossing_beyond_the_speeds_and_none_counted_twice_at_a_station() -> None:
    tracks = Tracks(
        np.array([0.0, 10.0, 20.0]), np.zeros((1, 3), dtype=np.int64), np.full((1, 3), 20.0), np.ones((1, 2))
    )
    assert [c.speed for c in crossings(tracks, [2])] == [10.0]  # exactly at the middle station
    assert [c.speed for c in crossings(tracks, [1])] == [20.0]  # exactly at the last one
    assert crossings(tracks, [0, -3]) == []
    line = np.array([[10.0 - 2e-15, 20.0 + 4e-15]])  # a whirl of a free body
    assert crossings(Tracks(np.array([10.0, 20.0]), np.zeros((1, 2), dtype=np.int64), line, np.ones((1, 1))), [1]) == []
    slow = Tracks(np.array([0.0, 5.0]), np.zeros((1, 2), dtype=np.int64), np.full((1, 2), 20.0), np.ones((1, 1)))
    assert crossings(slow, [2]) == []


def test_the_curves_of_a_modal_file() -> None:
    assert track_basis(small.basis()) is None
    basis = small.basis((0.0, 3000.0))
    tracks = track_basis(basis)
    assert tracks is not None
    assert sorted(tracks.modes[:, 1].tolist()) == sorted(range(basis.groups[0, 0].n_modes))
    assert tracks.mac.min() > 0.95
    np.testing.assert_allclose(tracks.speeds, [0.0, 100 * np.pi])


@pytest.mark.parametrize("lowest", [40.0, 500.0])
def test_the_lowest_mode_is_seen_above_all_engine_orders(lowest: float) -> None:
    """Orders reach 100 Hz; the diagram ends above the first mode wherever it is."""
    modes = [np.array([lowest, 1.1 * lowest]), np.array([9e3, 9e3])]
    assert ceiling(modes, 100.0, 1.2, 1.1) == pytest.approx(max(120.0, 1.1 * 1.1 * lowest))


def test_a_mode_of_one_speed_alone_is_drawn(tmp_path: Path) -> None:
    """Among the highest ones kept a mode may be there at a single speed, between those of the diagram's grid."""
    omega = np.array([[1000.0, 1010.0, 1020.0, 1040.0], [np.nan, np.nan, 3050.0, np.nan]])
    modes = np.where(np.isnan(omega), -1, np.arange(2)[:, None])
    tracks = Tracks(np.array([0.0, 100.0, 217.0, 300.0]), modes, omega, np.full((2, 3), 0.9))
    assert save(partial(campbell_plot, small.basis(), tracks, []), tmp_path / "c.png").is_file()
