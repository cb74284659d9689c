"""A cyclic sector of a bladed disc against the whole ring of it: disc and contacts couple the blades."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import rings
from meshes import body

from microslip.contact.friction import Coulomb
from microslip.contact.law import value
from microslip.contact.normal import Penalty
from microslip.contact.patch import Patch, grid
from microslip.contact.point import PointContact
from microslip.data import ModalBasis
from microslip.errors import UserError
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance import response
from microslip.harmonic_balance.reduced import stuck
from microslip.harmonic_balance.solver import solve
from microslip.modal.compute import modal_basis
from microslip.ring.neighbours import frame_change
from microslip.ring.neighbours import stuck as stuck_neighbours
from microslip.system.assembly import Assembly, ContactFace, Load, Output, preloaded_contact
from microslip.system.component import Component, Ring
from microslip.system.damping import structural
from microslip.system.disc import whole
from microslip.system.nodal import nodal
from microslip.system.pairing import in_ring

N = 5
FACES = [
    {"name": "right", "face": "contact_right", "role": "right", "partner": "left", "sector_shift": 1, "t2": [0, 0, 1]},
    {"name": "left", "face": "contact_left", "role": "left", "partner": "right", "sector_shift": -1, "t2": [0, 0, 1]},
]


@pytest.fixture(scope="module")
def basis() -> ModalBasis:
    return made()


def made(**shape: float) -> ModalBasis:
    settings = body(
        supports=[{"face": "bore"}], cyclic={"sectors": N}, modes={"count": 5}, reduction="rubin", interfaces=FACES,
        rotation={"axis": [0.0, 1.0, 0.0], "speeds_rpm": [3000.0], "prestress": "none"},
        excitations=[{"name": "gas", "face": "front", "pressure": True}],
        monitors=[{"name": "top", "point": [0.0, 0.0, 0.26]}], output={"gauss": False, "nodal_stress": False},
        damping={"ratio": 0.002},
    )  # fmt: skip
    return modal_basis(rings.bladed_sector("hexahedron20", N, **shape), settings)


def sector(basis: ModalBasis, order: int, normal: float, push: float) -> Assembly:
    groups = {k: g for (_, k), g in basis.groups.items()}
    faces = groups[0].interfaces
    places, areas = grid(*faces["right"].extent, (3, 2))
    n = len(areas)
    law = PointContact(Penalty(value(2e7 / n)), Coulomb(value(0.1)), value(1e7 / n))
    facing = frame_change(basis, faces["right"], faces["left"])
    patch = Patch("right", places, areas, law)
    contact = preloaded_contact(
        "gap", patch, ContactFace("disc", "right"), ContactFace("disc", "left", facing, 1), normal=normal
    )
    component = Component("disc", groups, N)
    loads, outputs = (Load("disc", "gas", push),), (Output("disc", "top", "u_y"),)
    return Assembly((component,), (contact,), loads, outputs, Ring(N, order))


FINE = {"harmonics": 3, "samples": 36, "cycles": 30, "periodicity": 1e-13, "length": 1e-7}


@pytest.mark.parametrize("order", [0, 1, 2, 3, -1])
def test_a_cyclic_sector_stands_for_the_whole_disc(basis: ModalBasis, order: int) -> None:
    """1e-9 of the amplitude in every harmonic and blade, rotating disc with gyroscopic coupling, sliding contacts.

    Every harmonic of a wave has its own nodal diameter h e mod N, so the sector's matrices differ from one to the next.
    """
    one = sector(basis, order, 50.0, 3e3)
    lone, ring = balance.of(one, **FINE), balance.of(one.unrolled(), **FINE)
    Omega = 2 * np.pi * 700.0
    a, b = solve(lone, Omega, []), solve(ring, Omega, [])
    assert a.converged and b.converged
    x, y = response.operating(lone, a), response.operating(ring, b)
    h = np.arange(4)
    turned = x.outputs[0] * np.exp(2j * np.pi * h * order * np.arange(N)[:, None] / N)
    np.testing.assert_allclose(y.outputs, turned, rtol=0, atol=1e-9 * np.abs(turned).max())
    assert y.supplied == pytest.approx(N * x.supplied, rel=1e-9)
    assert x.cycles["gap"].slipping.mean() > 0.01 or order == 0


@pytest.mark.parametrize("kind", ["structural", "stuck", "flow"])
def test_loss_factors_and_stuck_damping_of_a_cyclic_sector(basis: ModalBasis, kind: str) -> None:
    """As above, for a wave against the numbers; with loss factors the sector alone has 2 D K, and its own D; with a
    flow that tells the two directions of a nodal diameter apart."""
    one = sector(basis, -1, 50.0, 3e3)
    if kind == "stuck":
        one = replace(one, stuck_damping=(0.003,))
    elif kind == "flow":
        flow = {0: 0.01j, 1: 0.004 + 0.02j, 2: -0.01 + 0.005j, 3: 0.002 + 0.01j, 4: 0.03j}
        one = replace(one, components=(replace(one.components[0], aerodynamic=flow),))
    else:
        one = replace(one, components=(structural(one.components[0]),))
        part = one.part(one.components[0], 1)
        np.testing.assert_allclose(part.loss, 0.004 * part.K, rtol=0, atol=1e-9 * np.abs(part.K).max())
    a, b = (balance.of(x, **FINE) for x in (one, one.unrolled()))
    x, y = (response.operating(p, solve(p, 2 * np.pi * 700.0, [])) for p in (a, b))
    turned = x.outputs[0] * np.exp(-2j * np.pi * np.arange(4) * np.arange(N)[:, None] / N)
    np.testing.assert_allclose(y.outputs, turned, rtol=0, atol=1e-9 * np.abs(turned).max())
    assert y.damped == pytest.approx(N * x.damped, rel=1e-9)


def test_the_whole_ring_has_the_modes_of_all_nodal_diameters(basis: ModalBasis) -> None:
    """Eigenfrequencies of the ring with sticking contacts: those of `neighbours.stuck`, pairs for 0 < k < N/2; 1e-9."""
    one = sector(basis, 1, 1e6, 1.0)
    stiffness = one.contacts[0].stiffness
    ring = one.unrolled()
    found = stuck(ring.joined(1), np.kron(np.eye(N), stiffness))
    wanted = []
    for k in range(N // 2 + 1):
        omega = stuck_neighbours(basis, basis.groups[0, k], "right", np.diag(stiffness))[0] / (2 * np.pi)
        wanted += [*omega] * (1 if k in (0, N / 2) else 2)
    np.testing.assert_allclose(found, np.sort(wanted), rtol=1e-9)


def test_compliance_of_the_whole_ring_is_that_of_its_waves(basis: ModalBasis) -> None:
    """A force pattern of one wave on all sectors moves them as the nodal diameter's own compliance says; 1e-12."""
    ring, k = whole(sector(basis, 1, 50.0, 1.0).components[0]), 2
    c, wave = ring.groups[0].compliance, basis.groups[0, k].compliance
    r = len(wave.labels)
    turn = np.exp(2j * np.pi * k * np.arange(N) / N)
    force = np.random.default_rng(0).normal(size=r)
    moved = (c.static @ np.kron(turn, force)).reshape(N, r)
    np.testing.assert_allclose(moved, turn[:, None] * (wave.static @ force), rtol=0, atol=1e-12 * np.abs(moved).max())
    assert c.labels[r] == c.labels[0].replace("@0", "@1")


@pytest.mark.slow
def test_a_patch_that_deforms_on_a_sector_and_on_the_whole_disc() -> None:
    """Node-wise patch between the blades of the sector, and of the disc: 1e-9 of the amplitude in all blades."""
    basis = made(gap=0.0)
    groups = {k: g for (_, k), g in basis.groups.items()}
    faces, disc = groups[0].interfaces, Component("disc", groups, N)
    met = in_ring(faces["right"], faces["left"], basis.rotation_axis, basis.rotation_point, N, ("right", "left"))
    found = nodal((disc, "right"), (disc, "left"), met, range(N // 2 + 1), tolerance=0.3)  # few, to be fast
    share = found.areas / found.areas.sum()
    law = PointContact(Penalty(value(2e7 * share)), Coulomb(value(0.1)), value(1e7 * share))
    sides = found.sides(ContactFace("disc", "right"), ContactFace("disc", "left", met.frame, 1))
    patch = Patch("right", found.points, found.areas, law, found.shapes)
    one = replace(sector(basis, 2, 50.0, 3e3), contacts=(preloaded_contact("gap", patch, *sides, normal=50.0),))
    lone, ring = (balance.of(a, **{**FINE, "harmonics": 1}) for a in (one, one.unrolled()))
    points = [solve(p, 2 * np.pi * 700.0, []) for p in (lone, ring)]
    assert all(p.converged for p in points) and found.count > 6
    x, y = (response.operating(p, q) for p, q in zip((lone, ring), points, strict=True))
    turned = x.outputs[0] * np.exp(2j * np.pi * np.arange(2) * 2 * np.arange(N)[:, None] / N)
    np.testing.assert_allclose(y.outputs, turned, rtol=0, atol=1e-9 * np.abs(turned).max())
    assert x.cycles["gap"].slipping.mean() > 0.01
    with pytest.raises(UserError, match="that of nodal diameter 0 was not asked for"):
        first = replace(sides[0], rows={2: sides[0].rows[2]})
        replace(one, contacts=(replace(one.contacts[0], first=first),)).unrolled()
