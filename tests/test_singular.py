"""Where a stress is a property of the mesh, and the hot spot outside: beside clamps, edges of contacts, inner edges."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from meshes import body, brick

from microslip.data import ModalGroup
from microslip.modal.compute import modal_basis
from microslip.modal.singular import singular_zones
from microslip.operating import MaterialLimits, motion_of
from microslip.operating.fatigue import endurance
from microslip.operating.motion import Motion
from microslip.operating.stress import cycle_stress, in_singular_zone, stress_peaks

LENGTH, SIDE, FORCE = 0.12, 0.02, 100.0
LIMITS = MaterialLimits(fatigue_strength=300e6, tensile_strength=900e6)


@cache
def bar(across: int) -> ModalGroup:
    """A clamped bar of cubes, so many of them across, pushed at its tip."""
    mesh = brick("hexahedron20", (across, across, 6 * across), (SIDE, SIDE, LENGTH))
    settings = body(
        supports=[{"face": "z0"}], modes={"count": 3}, reduction="rubin", output={"gauss": False},
        excitations=[{"name": "tip", "face": "z1", "direction": [1.0, 0.0, 0.0]}],
        gauges=[
            {"name": "clamp", "point": [SIDE, SIDE / 2, 0.1 * SIDE], "direction": [0.0, 0.0, 1.0]},
            {"name": "away", "point": [SIDE, SIDE / 2, 1.5 * SIDE], "direction": [0.0, 0.0, 1.0]},
        ],
    )  # fmt: skip
    return modal_basis(mesh, settings).groups[0, 0]


def pushed(group: ModalGroup) -> Motion:
    """Under FORCE cos(Omega t) far below the first mode."""
    q = np.linalg.solve(group.K_r, FORCE * group.excitations["tip"].rows[0])
    return motion_of(1.0, np.array([np.zeros_like(q), q]), group)


@pytest.mark.parametrize("finer, grows", [(4, 1.005), pytest.param(6, 1.1, marks=pytest.mark.slow)])
def test_the_hot_spot_beside_a_clamp_is_no_property_of_the_mesh(finer: int, grows: float) -> None:
    """At the rim of the clamp finer elements raise the stress on and on (three, four, six across: 8.8, 8.9, 10.2 MPa);
    outside the zone, as wide as half the section (2 V/S), it is the beam's 6 F (l - z) / b^3, to 1 %."""
    rim = []
    for across in (3, finer):
        cycle = cycle_stress(pushed(bar(across)))
        spot = endurance(cycle, LIMITS)
        assert stress_peaks(pushed(bar(across))).amplitude[0] == pytest.approx(spot.amplitude, rel=1e-12)
        assert 0.4 * SIDE < spot.point[2] < 0.75 * SIDE
        assert spot.amplitude == pytest.approx(6 * FORCE * (LENGTH - spot.point[2]) / SIDE**3, rel=0.01)
        assert spot.vibration == pytest.approx(300e6 / spot.amplitude, rel=1e-12)
        rim.append(cycle.amplitude[cycle.singular].max())
    assert rim[1] > grows * rim[0]


def test_a_gauge_beside_the_clamp_reads_the_mesh() -> None:
    g = bar(3)
    assert in_singular_zone(g, g.gauges["clamp"].point) and not in_singular_zone(g, g.gauges["away"].point)


def test_where_nothing_is_left_all_places_count() -> None:
    motion = pushed(bar(3))
    whole = replace(cycle_stress(motion), singular=np.ones(len(cycle_stress(motion).points), dtype=bool))
    assert endurance(whole, LIMITS).amplitude == whole.amplitude.max()


def test_zones_of_a_step() -> None:
    """An L of two plates: its inner edge and nothing else; a roller on a whole side is a plane of symmetry, a clamp has
    a zone at its rim, a contact that covers half of a side at all its edges."""
    size = 0.1
    mesh = brick("tetra10", (8, 2, 8), (size, size / 4, size), keep=lambda b: (b[:, 0] < 2) | (b[:, 2] < 2))
    inner = np.array([size / 4, 0.0, size / 4])
    away = np.linalg.norm((mesh.points - inner)[:, [0, 2]], axis=1)
    for supports in ([], [{"face": "y0", "directions": "y"}]):
        zones = singular_zones(mesh, body(supports=supports, free=not supports))
        ((points, width),) = zones.edges
        np.testing.assert_allclose(points[:, [0, 2]], size / 4, atol=1e-15)
        assert (zones.hold(mesh.points) == (away <= width)).mean() > 0.99
    clamped = singular_zones(mesh, body(supports=[{"face": "x1"}]))
    rim, wide = clamped.edges[1]
    np.testing.assert_allclose(rim[:, 0], size)
    assert width < wide * (1 + 1e-12) and wide < size / 4
    touching = singular_zones(mesh, body(free=True, interfaces=[{"name": "c", "face": "x1"}]))
    np.testing.assert_array_equal(touching.edges[1][0], rim)


def test_the_clamp_of_a_sector_ends_where_the_next_one_begins() -> None:
    """The bore of a sector has two rims, front and rear; on the cut faces the ring goes on."""
    import sector

    ((points, _),) = singular_zones(sector.mesh(), sector.settings(6)).edges[-2:-1]
    radius = np.linalg.norm(points[:, [0, 2]], axis=1)
    assert radius.max() < 1.001 * sector.BORE
    ends = np.abs(np.arctan2(points[:, 0], points[:, 2])) > np.pi / 6 - 1e-6
    assert 0 < ends.sum() <= 4  # corners alone
