"""Material that runs through a standing shape: the same waves as from the frame that turns, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import scipy.linalg
from meshes import body, brick
from refusals import refused
from rings import AXIS, disc_sector, full_ring

from microslip.basis.integrals import convected
from microslip.case.assemble import build
from microslip.case.settings import case_model
from microslip.data import Array, ModalBasis, ModalGroup
from microslip.modal.compute import modal_basis, unreduced
from microslip.roots.full import full_matrices
from microslip.settings.mistakes import validate
from microslip.system.assembly import Assembly
from microslip.system.component import Component
from microslip.system.spin import Spin, turned
from microslip.units import to_rpm

STEEL = {"density": 7800.0, "young": 2e11, "poisson": 0.3}
SECTORS, BORE, RIM, THICK = 12, 0.05, 0.15, 0.02
RATE = 600.0  # rad/s
ABOUT = {"axis": AXIS.tolist(), "point": [0.0, 0.0, 0.0]}
SPIN = Spin(RATE, AXIS, np.zeros(3))


def disc() -> Any:
    return full_ring(disc_sector("hexahedron20", SECTORS, BORE, RIM, THICK, (2, 1, 2)), SECTORS).mesh


@cache
def free_disc() -> ModalBasis:
    """At rest and at RATE."""
    at = ABOUT | {"speeds_rpm": [0.0, to_rpm(RATE)]}
    return modal_basis(disc(), body(STEEL, free=True, rotation=at, modes={"count": 30}))


@cache
def held_disc() -> ModalBasis:
    more = {"supports": [{"face": "bore"}], "reduction": "rubin", "damping": {"beta": 1e-7}}
    faces = {"track": "front_0", "opposite": f"front_{SECTORS // 2}"}
    face = [{"name": name, "face": place, "t2": [1.0, 0.0, 0.0]} for name, place in faces.items()]
    return modal_basis(disc(), body(STEEL, rotation=ABOUT, modes={"count": 14}, interfaces=face, **more))


def standing(basis: ModalBasis, group: ModalGroup, spin: Spin = SPIN) -> ModalGroup:
    return turned(Component(basis.name, {0: group}), spin, basis.mesh, basis.mass).groups[0]


def frequencies(g: ModalGroup) -> Array:
    """(2m,) imaginary parts of the undamped roots, rad/s, ascending."""
    m = len(g.M_r)
    A = np.block([[np.zeros((m, m)), np.eye(m)], [-np.linalg.solve(g.M_r, np.hstack([g.K_r, g.G_r]))]])
    return np.sort(scipy.linalg.eigvals(A).imag)


def test_integrals_of_polynomials() -> None:
    """A disc about y: z' = -x and x' = z exactly, so D and B of coordinates are moments of inertia; constants rest."""
    mesh = disc()
    D, B = convected(mesh, tuple(AXIS), (0.0,) * 3, 3.0)
    x, _, z = mesh.points.T
    half = x @ D @ z
    assert half < 0 and z @ D @ x == pytest.approx(-half) and x @ B @ x == pytest.approx(-half)
    assert -2 * half == pytest.approx(3.0 * (BORE**2 + RIM**2) / 2, rel=1e-5)
    assert np.abs(D @ np.ones(len(x))).max() < 1e-15


def test_waves_of_a_free_disc_are_those_of_the_turning_frame_carried_round() -> None:
    """A wave of n diameters that has omega in the frame that turns has omega + n Omega in the one that stands, with
    centrifugal stress, backward and forward, across the plane and in it; found by two different sets of matrices."""
    basis = free_disc()
    g = basis.groups[1, 0]
    stands, turns = frequencies(standing(basis, g)), frequencies(g)
    elastic = stands[stands > 2.5 * RATE][:15]
    waves = np.array([-2, 2, 0, -3, 3, -1, 1, -4, -2, 4, 2, -5, -2, 2, 5])
    seen = (elastic - waves * RATE)[:, None]  # in the frame that turns
    np.testing.assert_allclose(np.abs(turns - seen).min(axis=1), 0, atol=1e-3 * RATE)
    np.testing.assert_allclose(np.abs(turns - seen).min(axis=1)[np.abs(waves) < 3], 0, atol=2e-5 * RATE)


def test_a_free_disc_rests_shifted_turned_and_tilted_and_wobbles() -> None:
    """Rigid body theory in the frame that stands: shifts, turning and a tilted axis at 0, nutation at Omega J_n / J."""
    basis = free_disc()
    found = frequencies(standing(basis, basis.groups[1, 0]))
    J = np.diag(basis.inertia)
    slow = np.abs(found[np.abs(found) < 2.5 * RATE])
    assert len(slow) == 12 and (slow < 1e-3 * RATE).sum() == 10
    np.testing.assert_allclose(slow[slow > RATE] / RATE, J[1] / J[0], rtol=1e-5)


def test_reduced_and_unreduced_matrices_part_their_waves_alike() -> None:
    basis = held_disc()
    mesh = disc()
    settings = body(
        STEEL, rotation=ABOUT, supports=[{"face": "bore"}], damping={"beta": 1e-7},
    )  # fmt: skip
    component = turned(Component("disc", {0: basis.groups[0, 0]}), SPIN, basis.mesh, basis.mass)
    g, at_rest = component.groups[0], basis.groups[0, 0]
    assembly = Assembly((component,), (), (), ())
    Q = full_matrices({"disc": unreduced(mesh, settings)}, assembly, [])
    phi = at_rest.phi.reshape(-1, at_rest.phi.shape[2])
    phi = phi[np.abs(phi).max(axis=1) > 0]  # of what is not held
    np.testing.assert_allclose(phi.T @ Q.C @ phi, g.C_r + g.G_r, rtol=0, atol=1e-9 * np.abs(g.G_r).max())
    np.testing.assert_allclose(phi.T @ Q.K @ phi, g.K_r, rtol=0, atol=1e-9 * np.abs(g.K_r).max())
    assert np.abs(g.K_r - at_rest.K_r).max() > 1e-6 * np.abs(g.K_r).max()


# ---------------------------------------------------------------- of a case


RUBS = {
    "interface": "pin:foot", "against": "disc:track", "normal_force": 10.0, "normal_stiffness": 1e7,
    "tangential_stiffness": 1e6, "includes": "surface", "friction": 0.3, "points": [2, 2],
    "law": {"kind": "rate", "slope": 1000.0}, "ground": {"rpm": 60.0},
}  # fmt: skip


@cache
def pin() -> ModalBasis:
    """A block on the disc's face."""
    settings = body(
        STEEL, supports=[{"face": "y0"}], modes={"count": 3}, rotation=ABOUT, reduction="rubin",
        interfaces=[{"name": "foot", "face": "y1", "t2": [1.0, 0.0, 0.0]}],
        monitors=[{"name": "read", "point": [0.01, -0.01, 0.08]}],
    )  # fmt: skip
    return modal_basis(brick("hexahedron20", (1, 1, 1), (0.02, 0.02, 0.04), (-0.01, -0.03, 0.08)), settings)


def assembled(contacts: list[dict], disc: ModalBasis) -> Assembly:
    names = dict.fromkeys(c["interface"].partition(":")[0] for c in contacts)
    bodies = [{"name": name, "turn": 180.0 * i} for i, name in enumerate(names)]
    case = {"name": "rubs", "bodies": [*bodies, {"name": "disc"}], "contacts": contacts, "damping": "modal"}
    case |= {"monitors": [{"monitor": "pin:read", "direction": "x"}], "stability": {"frequency": [0.0, 1000.0]}}
    settings = validate(case_model(), case, "case")
    return build(settings, dict.fromkeys(names, pin()) | {"disc": disc}).assembly


def rubs(**ground: Any) -> list[dict]:
    return [RUBS | {"ground": {"rpm": 60.0} | ground}]


def opposite(**ground: Any) -> dict:
    """A second contact on the disc, by another pin."""
    return rubs(**ground)[0] | {"interface": "other:foot", "against": "disc:opposite"}


def test_a_case_takes_the_inertia_of_the_body_that_its_contact_is_against() -> None:
    basis = held_disc()
    at_rest, expected = basis.groups[0, 0], standing(basis, basis.groups[0, 0], Spin(2 * np.pi, AXIS, np.zeros(3)))
    still, turns = assembled(rubs(), basis).components
    assert turns.spin is not None and still.spin is None and not still.groups[0].G_r.any()
    np.testing.assert_allclose(turns.groups[0].G_r, expected.G_r, atol=1e-12 * np.abs(expected.G_r).max())
    np.testing.assert_allclose(turns.groups[0].K_r, expected.K_r)
    about = assembled(rubs(axis=[0, -2, 0], point=[0, 5, 0]), basis).components[1].groups[0]
    np.testing.assert_allclose(about.G_r, -expected.G_r, atol=1e-12 * np.abs(expected.G_r).max())
    without = assembled(rubs(inertia=False), basis).components[1]
    assert without.spin is None and without.groups[0] is not None and not without.groups[0].G_r.any()
    np.testing.assert_array_equal(without.groups[0].K_r, at_rest.K_r)


@pytest.mark.parametrize(
    "ground, text",
    [
        ({"axis": [1, 0, 0]}, "no body of revolution about that axis"),
        ({"point": [0.03, 0, 0]}, "no body of revolution about that axis"),
    ],
)
def test_a_shape_that_would_not_stand_is_refused(ground: dict, text: str) -> None:
    refused(("contacts.pin:foot.ground: ", text, "inertia = false"), assembled, rubs(**ground), held_disc())


def test_what_the_inertia_needs_of_the_modal_file() -> None:
    basis, two = held_disc(), [*rubs(), opposite(rpm=61.0)]
    refused("'disc' otherwise than another contact does; write the same rpm", assembled, two, basis)
    refused("point and inertia in both", assembled, [*rubs(), opposite(inertia=False)], basis)
    assert assembled([*rubs(), opposite()], basis).components[2].spin is not None
    slides = [RUBS | {"ground": {"velocity": 1.0, "inertia": False}}]
    refused(("inertia: ", "add rpm"), assembled, slides, basis)
    free = free_disc()
    at_rest, at_speed = (free.groups[i, 0] for i in range(2))
    for g, rate, word in ((at_rest, RATE, "is free"), (at_speed, 0.1 * RATE, "with 572.958")):
        refused(("5729.58 rpm", word), standing, free, g, Spin(rate, AXIS, np.zeros(3)))
    held = basis.groups[0, 0]
    fast = Spin(0.2 * held.omega[0], AXIS, np.zeros(3))
    disc = Component("disc", {0: held})
    refused(("at rest, but at ", "the centrifugal stress"), turned, disc, fast, basis.mesh, basis.mass)
    for g, text in (
        (replace(held, phi=held.phi[:0]), "output.shapes = true"),
        (replace(held, kind=("interface-force", *held.kind[1:])), "coordinates without mass"),
    ):
        refused(text, standing, basis, g)
    refused("no mesh to integrate over, or no mass", turned, disc, SPIN, basis.mesh, 0.0)
