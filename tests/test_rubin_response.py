"""A friction response by ten modes with Rubin's vectors against one by sixty eigenmodes of the same mesh."""

from __future__ import annotations

import numpy as np
import pytest
from meshes import STEEL, body, brick

from microslip.contact.friction import Coulomb
from microslip.contact.law import value
from microslip.contact.normal import Penalty
from microslip.contact.patch import Patch, grid
from microslip.contact.point import PointContact
from microslip.data import ModalGroup
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance.response import HarmonicResponse, harmonic_response
from microslip.modal.compute import modal_basis
from microslip.system.assembly import Assembly, ContactFace, Load, Output, preloaded_contact
from microslip.system.component import Component

TIP = {"name": "tip", "face": "x1", "t2": [0.0, 0.0, 1.0]}
PUSH = {"name": "push", "face": "z1", "direction": [0.0, 0.3, 1.0]}
LOOK = {"name": "look", "point": [0.15, 0.015, 0.02]}


def beam(method: str, count: int) -> ModalGroup:
    """300 x 30 x 20 mm of steel, clamped at one end, its other end is the contact."""
    settings = body(
        STEEL, supports=[{"face": "x0"}], interfaces=[TIP], excitations=[PUSH], monitors=[LOOK],
        modes={"count": count}, reduction=method, damping={"ratio": 0.005},
    )  # fmt: skip
    return modal_basis(brick("hexahedron20", (12, 2, 2), (0.3, 0.03, 0.02)), settings).groups[0, 0]


def rubbing(group: ModalGroup, frequency: np.ndarray) -> HarmonicResponse:
    """Pressed on a wall by 2000 N, six points, pushed until they slide."""
    places, areas = grid(0.03, 0.02, (3, 2))
    law = PointContact(Penalty(value(5e8 / 6)), Coulomb(value(0.15)), value(3e8 / 6))
    contact = preloaded_contact(
        "wall", Patch("tip", places, areas, law), ContactFace("beam", "tip"), None, normal=2000.0
    )
    loads, outputs = (Load("beam", "push", 250.0),), (Output("beam", "look", "u_z"),)
    assembly = Assembly((Component("beam", {0: group}),), (contact,), loads, outputs)
    problem = balance.of(assembly, 3, 64, length=3e-6)
    return harmonic_response(problem, frequency)


@pytest.mark.slow
def test_ten_modes_with_rubins_vectors_are_nearer_than_sixty_eigenmodes() -> None:
    """Against sixty modes with the same static vectors. Ten modes with the six of the face and the one of the load are
    nearer by two powers of ten than sixty modes alone, which do not hold the compliance under the contact, and these
    nearer than ten alone.
    """
    groups = [beam("rubin", 60), beam("rubin", 10), beam("eigenmodes", 60), beam("eigenmodes", 10)]
    assert [g.n_modes for g in groups] == [67, 17, 60, 10]
    frequency = np.linspace(2.5, 5.5, 25) * groups[0].omega[0] / (2 * np.pi)
    exact, *others = (rubbing(g, frequency) for g in groups)
    assert exact.converged.all() and exact.slipping.max() > 0.5
    top = np.abs(exact.monitor).max()
    rubin, sixty, ten = (float(np.abs(r.monitor - exact.monitor).max() / top) for r in others)
    assert rubin < 1e-4 and 100 * rubin < sixty < 0.5 * ten
