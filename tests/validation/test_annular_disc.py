"""Annular discs: the closed forms against each other and the literature, then cyclic sectors against them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import rings
from closed_forms.discs import (
    Disc,
    centrifugal_stress,
    disc_frequencies,
    membrane_frequencies,
    thin_plate_frequencies,
)
from meshes import body

from microslip.modal.compute import modal_basis

PLATE = Disc(inner=0.5, outer=1.0, thickness=0.01, young=2.1e11, poisson=0.3, density=7850.0)


def parameter(disc: Disc, omega: np.ndarray) -> np.ndarray:
    """Leissa's lambda^2 = omega b^2 sqrt(rho h / D)."""
    return omega * disc.outer**2 * np.sqrt(disc.density * disc.thickness / disc.rigidity)


# ---------------------------------------------------------------- the closed forms


@pytest.mark.parametrize(
    ("clamped", "diameters", "printed"),
    [
        (True, 0, 13.0),
        (True, 1, 13.3),
        (True, 2, 14.7),
        (True, 3, 18.5),
        (False, 0, 9.32),
        (False, 2, 4.28),
        (False, 3, 11.4),
    ],
)
def test_thin_plates_of_the_literature(clamped, diameters, printed):
    """Vogel and Skinner, J. Appl. Mech. 32 (1965) 926, b/a = 0.5, nu = 0.3: three printed digits."""
    value = parameter(PLATE, thin_plate_frequencies(replace(PLATE, clamped=clamped), diameters, 1))[0]
    assert value == pytest.approx(printed, rel=5e-3)


@pytest.mark.parametrize("clamped", [True, False])
@pytest.mark.parametrize("diameters", [2, 3, 4])
def test_shear_and_rotary_inertia_vanish_with_the_square_of_the_thickness(clamped, diameters):
    """Mindlin by Ritz against Kirchhoff by Bessel functions; the free edge's twist leaves a first power (Kirchhoff's
    corner forces), so the exponent lies between 1 and 2."""
    errors = []
    for h in (0.01, 0.005):
        disc = replace(PLATE, thickness=h, clamped=clamped)
        thin, thick = thin_plate_frequencies(disc, diameters, 2), disc_frequencies(disc, diameters, 2, terms=24)
        errors.append(1 - thick / thin)
    assert (errors[0] > 0).all() and (errors[0] < 6e-3).all()
    slope = np.log2(errors[0] / errors[1])
    assert (slope > 0.95).all() and (slope < 2.1).all()


@pytest.mark.parametrize("diameters", range(5))
def test_a_spinning_disc_without_stiffness_is_lamb_and_southwells_membrane(diameters):
    """A foil (h/b = 1e-3) at a speed where centrifugal stress is all: bending and rotary inertia leave h^2/b^2."""
    foil = Disc(0.0, 1.0, 1e-3, 2.1e11, 0.3, 7850.0, clamped=False)
    exact = membrane_frequencies(foil.poisson, diameters, 3e4, 3)
    found = disc_frequencies(foil, diameters, 3, 3e4, terms=12)
    elastic = slice(diameters == 0, None)  # the first of no diameter is the disc moving along its axis
    np.testing.assert_allclose(found[elastic], exact[elastic], rtol=2e-5)


def test_centrifugal_stress_is_in_balance_and_meets_its_edges():
    """d(r sigma_r)/dr - sigma_theta + rho Omega^2 r^2 = 0; no stress at the rim; no strain round a held bore."""
    r, step = np.linspace(0.55, 0.95, 9), 1e-5
    for clamped in (True, False):
        disc = replace(PLATE, clamped=clamped)
        stress = centrifugal_stress(disc, 500.0)
        up, down = stress(r + step)[0], stress(r - step)[0]
        slope = ((r + step) * up - (r - step) * down) / (2 * step)
        load = disc.density * 500.0**2 * r**2
        np.testing.assert_allclose(slope - stress(r)[1], -load, rtol=1e-8)
        radial, hoop = stress(np.array([disc.inner, disc.outer]))
        scale = np.abs(hoop).max()
        assert abs(radial[1]) < 1e-12 * scale
        assert abs((hoop - disc.poisson * radial)[0] if clamped else radial[0]) < 1e-12 * scale


def test_waves_against_the_rotation_are_faster_on_the_disc():
    """The Coriolis split is odd in n and of first order in the speed, and none without a diameter."""

    def split(speed):
        forward, backward = (disc_frequencies(PLATE, n, 1, speed, coriolis=True)[0] for n in (-2, 2))
        middle = disc_frequencies(PLATE, 2, 1, speed)[0]
        assert forward < middle < backward
        np.testing.assert_allclose(forward * backward, middle**2, rtol=1e-7)  # the square of the coupling is 1e-8
        return backward - forward

    assert split(40.0) / split(20.0) == pytest.approx(2.0, rel=5e-3)  # the stress changes the shape by Omega^2
    same = [disc_frequencies(PLATE, 0, 1, 200.0, coriolis=c)[0] for c in (True, False)]
    np.testing.assert_allclose(same[0], same[1], rtol=1e-6)


# ---------------------------------------------------------------- a cyclic sector of solids

SPEED = 400.0  # rad/s; lifts the first frequencies by a sixth
DIAMETERS = range(5)
SOLID = Disc(inner=0.2, outer=0.5, thickness=0.01, young=2.1e11, poisson=0.3, density=7850.0)


@cache
def solid_disc():
    """One of 90 sectors of four degrees, at rest and at speed; boxes grow from the clamp to the rim."""
    mesh = rings.disc_sector("hexahedron20", 90, SOLID.inner, SOLID.outer, SOLID.thickness, (1, 2, 20), last=8.0)
    described = body(
        supports=[{"face": "bore"}], cyclic={"sectors": 90, "nodal_diameters": list(DIAMETERS)},
        modes={"count": 20}, rotation={"speeds_rpm": [0.0, SPEED * 30 / np.pi]},
    )  # fmt: skip
    return modal_basis(mesh, described)


def plate_waves(group, count: int = 2) -> np.ndarray:
    """(count,) lowest frequencies, rad/s, of the modes that move along the axis."""
    along = np.abs(group.phi[:, 1]).max(axis=0) > 0.6 * np.abs(group.phi).max(axis=(0, 1))
    return group.omega[along][:count]


@pytest.mark.parametrize("diameters", DIAMETERS)
def test_a_cyclic_sector_is_the_annular_plate(diameters):
    """Two frequencies at rest and at speed. Solids lie 0.1 to 0.35 per cent above Mindlin's plate: half of it is the
    mesh, half the clamp, which in three dimensions holds the thickness too (it falls with the thickness)."""
    for i, speed in ((0, 0.0), (1, SPEED)):
        exact = disc_frequencies(SOLID, diameters, 2, speed)
        error = plate_waves(solid_disc().groups[i, diameters]) / exact - 1
        assert (error > 0).all() and (error < 5e-3).all()


@pytest.mark.parametrize("diameters", DIAMETERS)
def test_the_centrifugal_stress_stiffens_the_disc_as_it_should(diameters):
    """omega^2 at speed less omega^2 at rest against the plate under its plane stress, per nodal diameter."""
    rest, turning = (plate_waves(solid_disc().groups[i, diameters]) for i in (0, 1))
    exact = disc_frequencies(SOLID, diameters, 2, SPEED) ** 2 - disc_frequencies(SOLID, diameters, 2) ** 2
    np.testing.assert_allclose(turning**2 - rest**2, exact, rtol=5e-3)


@pytest.mark.parametrize("diameters", DIAMETERS)
def test_forward_and_backward_waves_of_the_disc(diameters):
    """Rotary inertia and Coriolis force part the waves of +n and -n; exp(+i omega t) at +n runs backward, the faster.

    The split is 1e-4 of the frequency; both come from the same modes, so the mesh hardly enters.
    """
    waves = solid_disc().groups[1, diameters].gyroscopic
    if diameters:
        backward, forward = (
            min(abs(w) for w, d in zip(waves.omega, waves.direction, strict=True) if d == direction)
            for direction in ("backward", "forward")
        )
    else:
        backward = forward = waves.omega[0]
    exact = [disc_frequencies(SOLID, sign * diameters, 1, SPEED, coriolis=True)[0] for sign in (1, -1)]
    if diameters:
        assert backward - forward == pytest.approx(exact[0] - exact[1], rel=5e-3)
    else:
        assert exact[0] == pytest.approx(exact[1], rel=1e-10)
    assert 0 < backward / exact[0] - 1 < 5e-3
