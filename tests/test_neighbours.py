"""Contacts between neighbouring sectors in reduced coordinates against the whole finite-element sector."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import rings
import scipy.linalg
import scipy.sparse as sp
from meshes import body
from refusals import refused

from microslip.fem.cyclic import pair_cut_faces, sector_unknowns
from microslip.fem.discretise import discretise
from microslip.fem.operators import mass, stiffness
from microslip.modal.body_rows import body_rows
from microslip.modal.boundary import fixed_dofs
from microslip.modal.compute import modal_basis
from microslip.modal.speed_range import basis_at
from microslip.ring.expansion import certify_ring, phase
from microslip.ring.neighbours import closed_gap, frame_change, relative_rows, stuck
from microslip.ring.resonances import families, travelling, wave_tracks

N = 6
AXIS = np.array([0.0, 1.0, 0.0])
FACES = [
    {"name": "right", "face": "contact_right", "role": "right", "partner": "left", "sector_shift": 1, "t2": [0, 0, 1]},
    {"name": "left", "face": "contact_left", "role": "left", "partner": "right", "sector_shift": -1, "t2": [0, 0, 1]},
]


def settings(reduction: str):
    return body(
        supports=[{"face": "bore"}], cyclic={"sectors": N}, modes={"count": 8}, reduction=reduction, interfaces=FACES,
        rotation={"axis": [0.0, 1.0, 0.0], "speeds_rpm": [0.0]}, output={"gauss": False, "nodal_stress": False},
    )  # fmt: skip


@pytest.fixture(scope="module")
def mesh():
    return rings.bladed_sector("hexahedron20", N)


@pytest.fixture(scope="module")
def whole(mesh):
    """Nodal diameter -> K, M, and the rows of both interfaces on the sector's unknowns."""
    s = settings("eigenmodes")
    d, material = discretise(mesh), s.material.material()
    cut = pair_cut_faces(mesh, "cyclic_left", "cyclic_right", AXIS, np.zeros(3), N)
    unknowns = sector_unknowns(d.pattern, fixed_dofs(mesh, s), cut)
    rows = body_rows(mesh, s)
    free = unknowns.apart.free
    K = d.pattern.full(stiffness(d, material.elasticity, None))[free][:, free]
    M = sp.kron(d.pattern.full(mass(d, material.density)), sp.identity(3)).tocsr()[free][:, free]
    out = {}
    for k in range(N // 2 + 1):
        T = unknowns.transformation(k)
        H = T.conj().T
        B = {name: (p.B[:, free] @ T).toarray() for name, p in rows.patches.items()}
        out[k] = (H @ K @ T).toarray(), (H @ M @ T).toarray(), B
    return out


@pytest.mark.parametrize(("reduction", "first", "second"), [("rubin", 1e-5, 2e-4), ("craig-bampton", 2e-4, 6e-3)])
def test_stuck_neighbours_couple_through_disc_and_contact(mesh, whole, reduction: str, first: float, second: float):
    """Springs from soft to stiff between neighbours: 8 modes and the static answers against every unknown.

    Measured: the first frequency errs by 3e-6 with Rubin, 1.4e-4 with Craig-Bampton and 26 % with plain eigenmodes;
    the second by 8e-5, 4e-3 and more than 100 %.
    """
    basis, plain = modal_basis(mesh, settings(reduction)), modal_basis(mesh, settings("eigenmodes"))
    worst = {reduction: np.zeros(2), "eigenmodes": np.zeros(2)}
    for k, (K, M, B) in whole.items():
        g = basis.groups[0, k]
        D = frame_change(basis, g.interfaces["right"], g.interfaces["left"])
        G = D @ B["left"] * phase(g, N, 1) - B["right"]
        unit = 1 / np.abs(np.diag(G @ np.linalg.solve(K, G.conj().T)))
        for factor in (1e-2, 1.0, 1e2, 1e4):
            exact = scipy.linalg.eigh(K + G.conj().T @ ((factor * unit)[:, None] * G), M, eigvals_only=True)[:2]
            for name, b in ((reduction, basis), ("eigenmodes", plain)):
                omega, V = stuck(b, b.groups[0, k], "right", factor * unit)
                worst[name] = np.maximum(worst[name], np.abs(omega[:2] / np.sqrt(exact) - 1))
    assert worst[reduction][0] < first and worst[reduction][1] < second
    assert worst["eigenmodes"].min() > 0.1


def test_no_relative_motion_is_the_limit_of_stiff_springs(mesh) -> None:
    """The gap closes as one over the stiffness; plain eigenmodes, whose statics are not held, are not asked."""
    basis, plain = modal_basis(mesh, settings("rubin")), modal_basis(mesh, settings("eigenmodes"))
    assert closed_gap(basis) == "right" and closed_gap(plain) is None
    for k in range(N // 2 + 1):
        g = basis.groups[0, k]
        limit, V = stuck(basis, g, "right")
        assert np.abs(relative_rows(basis, g, "right") @ V[:, :4]).max() < 1e-9 * np.abs(g.phi).max()
        scale = 1 / np.abs(np.diag(g.compliance.static))[:6]
        far = [1 - stuck(basis, g, "right", factor * scale)[0][:4] / limit[:4] for factor in (1e5, 1e6)]
        assert np.abs(far[1]).max() < 1e-4
        assert np.all(far[1] < 0.2 * far[0])


def test_rigid_motions_of_the_ring_move_no_contact(mesh) -> None:
    """A shift along the axis (k = 0) and one across it (k = 1) leave facing contacts at rest to each other."""
    s = settings("eigenmodes")
    basis, rows = modal_basis(mesh, s), body_rows(mesh, s)
    along = np.tile([0.0, 1.0, 0.0], mesh.n_points)
    across = np.tile([1.0, 0.0, -1j], mesh.n_points)  # R (e_x - i e_z) = (e_x - i e_z) exp(-2 pi i / N)
    for k, motion in ((0, along), (1, across)):
        g = basis.groups[0, k]
        D = frame_change(basis, g.interfaces["right"], g.interfaces["left"])
        right, left = (rows.patches[name].B @ motion for name in ("right", "left"))
        assert np.abs(D @ left * phase(g, N, 1) - right).max() < 1e-12


def test_interfaces_that_do_not_face_the_next_sector_are_refused(mesh) -> None:
    basis = modal_basis(mesh, settings("eigenmodes"))
    for name, words in (("left", "does not face"), ("nowhere", "has no interface")):
        refused(words, relative_rows, basis, basis.groups[0, 1], name)


# ---------------------------------------------------------------- waves over a range of speeds


TOP = 600 * 30 / np.pi  # rpm


@pytest.fixture(scope="module")
def ranged(mesh):
    s = settings("rubin")
    rotation = s.rotation.model_copy(update={"speeds_rpm": (0.0, TOP), "range_rpm": (0.0, TOP)})
    return modal_basis(mesh, s.model_copy(update={"rotation": rotation}))


@pytest.mark.parametrize(
    "direction", ["forward", *(pytest.param(d, marks=pytest.mark.slow) for d in ("backward", "standing"))]
)
def test_waves_over_a_range_end_in_those_of_its_ends(ranged, direction: str) -> None:
    """The curves of the Campbell diagram, made from the range, against modes solved for at both ends.

    Both hold the Coriolis force in the space of their own coordinates; they differ by what those leave out of it,
    at most by the bound that the station's group states (and at rest by nothing).
    """
    for k in (0, 2):
        found = wave_tracks(ranged, k, direction)
        assert found is not None and len(found.speeds) > 10
        for end, station in ((0, 0), (-1, 1)):
            g = ranged.groups[station, k]
            wanted = travelling(g, direction).omega[:6]
            bound = np.nanmax(g.gyroscopic.error) if station else 1e-6
            assert bound < 0.1
            assert np.abs(np.sort(found.omega[:, end])[:6] / wanted - 1).max() < bound


def test_coriolis_parts_the_two_waves_over_a_range(ranged) -> None:
    ahead, behind = (wave_tracks(ranged, 2, d) for d in ("forward", "backward"))
    assert ahead is not None and behind is not None
    assert np.abs(ahead.omega[:6, 0] / behind.omega[:6, 0] - 1).max() < 1e-9
    assert np.nanmax(np.abs(ahead.omega[:6, -1] / behind.omega[:6, -1] - 1)) > 1e-3


def test_families_at_a_speed_are_those_of_the_stations(ranged) -> None:
    """With a range in the file the stations keep their own curves: mode numbers must not be read off the range's."""
    with_range, without = families(ranged, 1), families(replace(ranged, ranges={}), 1)
    np.testing.assert_array_equal(with_range.modes, without.modes)
    np.testing.assert_array_equal(with_range.omega, without.omega)


def test_a_station_is_a_speed_of_the_file_without_a_range(ranged) -> None:
    """`info --rpm` at a speed that was solved for gives that group; elsewhere the speeds there are told."""
    stations = replace(ranged, ranges={})
    assert basis_at(stations, TOP).groups[0, 2] is ranged.groups[1, 2]
    refused(f"choose one of its speeds, 0, {TOP:.6g} rpm", basis_at, stations, 0.5 * TOP)


@pytest.mark.parametrize("reduction", ["rubin", "craig-bampton"])
def test_the_ring_is_certified_whatever_coordinates_are_kept(mesh, reduction: str) -> None:
    """Each mode below the certified bound has its counterpart in the reduced body, which lies above it."""
    proof = certify_ring(modal_basis(mesh, settings(reduction)))
    assert proof.certified and proof.count >= 4 * N


def test_stress_of_nodal_diameters_that_cannot_be_is_refused() -> None:
    with pytest.raises(ValueError, match="is more than 6 sectors can have"):
        body(cyclic={"sectors": N}, output={"stress_nodal_diameters": [4]})
