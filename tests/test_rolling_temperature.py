"""Temperature of rolling contacts: moving sources, the marching rule, friction that falls with it (Sextro 6.7)."""

from __future__ import annotations

import numpy as np
import pytest
from refusals import refused
from scipy.integrate import quad
from scipy.special import erfcx

from microslip.rolling.temperature import (
    Conductor,
    conducted,
    falling,
    heat_share,
    heat_source,
    marched,
    settled,
    speed_parameter,
)

STEEL = Conductor(50.0, 7850.0, 450.0)
BRASS = Conductor(120.0, 8500.0, 380.0)


def places(n: int, length: float) -> np.ndarray:
    """(n,) distances of the centres from the leading edge, in the order of x."""
    return (np.arange(n)[::-1] + 0.5) * length / n


def test_constant_source() -> None:
    """Sextro Eq. (6.7-16), exactly, and by the marching rule as well."""
    source = np.full((40, 2), 3e8)
    exact = 2 / np.sqrt(np.pi) * np.sqrt(STEEL.diffusivity / 30) * 0.5 * 3e8 / 50 * np.sqrt(places(40, 0.01))
    for rule in (conducted, marched):
        assert rule(source, 0.01 / 40, STEEL, 0.5, 30.0)[:, 1] == pytest.approx(exact, rel=1e-12)


def test_convolution_is_the_integral_of_the_book() -> None:
    """Sextro Eqs. (6.7-11), (6.7-12) by quadrature, at the surface and below, for an elliptic source: second order."""
    a, V, z = 5e-3, 10.0, 3e-5
    k = STEEL.diffusivity

    def integral(x: float, depth: float) -> float:
        def inside(w: float) -> float:  # u = x - w^2 takes the pole away
            q = np.sqrt(max(1 - ((x - w * w) / a - 1) ** 2, 0)) * 1e8
            return 2 * q * np.exp(-V / k * depth**2 / (4 * w * w)) if w > 0 else 2 * q * (depth == 0)

        return 0.4 / 50 * np.sqrt(k / (np.pi * V)) * quad(inside, 0, np.sqrt(x), epsabs=1e-3, limit=200)[0]

    for depth in (0.0, z):
        errors = []
        for n in (40, 80):
            x = places(n, 2 * a)
            source = 1e8 * np.sqrt(1 - (x / a - 1) ** 2)[:, None]
            found = conducted(source, 2 * a / n, STEEL, 0.4, V, depth)
            errors.append(abs(found[n // 4, 0] - integral(x[n // 4], depth)))
        assert errors[1] < 2e-3 * found[:, 0].max() and errors[1] < 0.45 * errors[0], errors


def test_heat_below_the_surface_is_what_flowed_in() -> None:
    """rho c V integral of T over the depth = share of the sources passed so far."""
    source = np.random.default_rng(1).uniform(0, 1e8, (30, 1))
    depths = np.linspace(0, 2e-3, 4001)
    T = np.array([conducted(source, 1e-4, STEEL, 0.4, 10.0, z)[0, 0] for z in depths])
    held = STEEL.density * STEEL.heat_capacity * 10.0 * np.trapezoid(T, depths)
    flowed = 0.4 * 1e-4 * (source.sum() - source[0, 0] / 2)  # to the middle of the last element
    assert held == pytest.approx(flowed, rel=1e-4)


def test_both_surfaces_are_equally_hot() -> None:
    """That is what the share is for, unlike bodies at unlike speeds; 1/2 for like ones, all into the one that moves."""
    share = heat_share(STEEL, BRASS, 20.0, 28.0)
    source = np.full((10, 1), 1e8)
    one = conducted(source, 1e-3, STEEL, share, 20.0)
    assert conducted(source, 1e-3, BRASS, 1 - share, 28.0) == pytest.approx(one, rel=1e-12)
    assert heat_share(STEEL, STEEL, 5.0, 5.0) == 0.5 and heat_share(STEEL, BRASS, 5.0, 0.0) == 1


def test_friction_that_falls_with_the_heat_it_makes() -> None:
    """Full slip under even pressure: mu is Abel's equation, mu_0 exp(c^2 x) erfc(c sqrt(x)); second order in dx."""
    q, V, vanishing, length = 4e9, 30.0, 250.0, 0.01  # q: of mu = 1
    rate = 0.4 * q * 0.5 / 50 * np.sqrt(STEEL.diffusivity / (np.pi * V)) / vanishing
    errors = []
    for n in (50, 100, 200):
        mu, T = settled(
            lambda mu: mu * q,
            lambda s, n=n: conducted(s, length / n, STEEL, 0.5, V),
            lambda T: falling(T, 0.4, vanishing),
            np.full((n, 1), 0.4),
        )
        exact = 0.4 * erfcx(rate * np.sqrt(np.pi * places(n, length)))
        assert mu == pytest.approx(0.4 * (1 - T / vanishing), abs=1e-7)
        errors.append(np.abs(mu[0, 0] - exact[0]))
    assert mu[0, 0] < 0.15 and errors[2] < 2e-5 and errors[0] / errors[2] > 6, errors


def test_friction_does_not_turn_round() -> None:
    """Sextro Eq. (6.7-22) is cut at zero."""
    assert falling(np.array([0.0, 100, 300]), 0.4, 200.0) == pytest.approx([0.4, 0.2, 0])


def test_source_is_the_work_of_traction_on_slip() -> None:
    traction, slip = np.array([[[-3.0]], [[4.0]]]), np.array([[[0.3]], [[-0.4]]])
    assert heat_source(traction, slip, 10.0) == pytest.approx(10 * 5 * 0.5)
    assert speed_parameter(30.0, 6e-3, STEEL) == pytest.approx(30 * 6e-3 / (2 * 50 / 7850 / 450))


@pytest.mark.parametrize(
    ("key", "call"),
    [
        ("speed", lambda: conducted(np.ones((3, 1)), 1e-3, STEEL, 0.5, 0.0)),
        ("speed", lambda: heat_share(STEEL, STEEL, 0.0, 0.0)),
        ("density", lambda: Conductor(50.0, -1.0, 450.0)),
    ],
)
def test_mistakes_are_named(key: str, call) -> None:
    refused(f"{key}: ", call)
