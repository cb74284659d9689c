"""Blade deviations from gauge amplitudes: the ring's own model, exact derivatives, how often intervals hold."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from refusals import refused

from microslip.contact.friction import Coulomb
from microslip.contact.law import value
from microslip.contact.normal import Penalty
from microslip.contact.patch import Patch
from microslip.contact.point import PointContact
from microslip.mistuning.gauges import Stuck, blades_from_gauges
from microslip.mistuning.ring import Tuned
from microslip.mistuning.samples import StickingRing
from microslip.mistuning.scatter import Scatter
from microslip.system import Body, Contact, Force, Monitor, Spring, System
from microslip.system.assembly import Assembly, ContactFace, Load, Output, across, preloaded_contact
from microslip.system.component import Component, Ring

HERTZ = np.array([150.0, 154.0, 158.0, 160.0, 163.0, 165.0, 169.0, 172.0])
"""Through and beside the stuck ring's lower family, 159 to 165 Hz."""


@cache
def ring(blades: int) -> Stuck:
    """Blades of two modes, 159 and 236 Hz, coupled by stuck shrouds, engine order 2, 0.2 % damping."""
    faces = [Contact("right", "tip", (1, 0, 0), t2=(0, 0, 1)), Contact("left", "tip", (-1, 0, 0), t2=(0, 0, 1))]
    blade = System(
        "blade", [Body("tip", 1.0, free="x y")], [Spring("ground", "tip", (1e6, 2.2e6, 1.0))], faces,
        [Force("gas", "tip", (1, 0.4, 0))], [Monitor("tip", "tip")], ratio=0.002,
    ).basis()  # fmt: skip
    law = PointContact(Penalty(value(2e4)), Coulomb(value(0.3)), value(1e4))
    facing = across(np.diag([1.0, 1, 1]), np.diag([-1.0, -1, 1]))
    sides = ContactFace("blade", "right"), ContactFace("blade", "left", facing, 1)
    contact = preloaded_contact("shroud", Patch("right", np.zeros((1, 2)), np.array([1e-6]), law), *sides, normal=20.0)
    component, load = Component("blade", {0: blade.groups[0, 0]}), Load("blade", "gas", 1.0)
    sector = Assembly((component,), (contact,), (load,), (Output("blade", "tip", "u_x"),), Ring(blades, 2))
    return Stuck(Tuned(sector, {}))


def measured(stuck, deviation, hertz=HERTZ):
    return np.abs([stuck.amplitudes(f, deviation)[0] for f in hertz])


def test_the_model_is_that_of_a_sample():
    """A ring of which a sample is made, factorised afresh, to rounding; on, beside and above its resonances."""
    stuck, d = ring(5), np.random.default_rng(1).normal(0, 0.02, 5)
    s = Scatter("frequency", deviation=0.02)
    sample = StickingRing(stuck.tuned.mistuned([(s, np.repeat(d[:, None], 2, axis=1))]))
    for f in (150.0, 162.0, 236.0):
        assert np.allclose(np.abs(stuck.amplitudes(f, d)[0]), sample(f), rtol=1e-10)


@pytest.mark.parametrize("hertz", [150.0, 162.0, 236.0])
def test_derivatives_of_the_amplitudes(hertz):
    """Against central differences, to 1e-6 of the largest."""
    stuck, d, h = ring(5), np.random.default_rng(2).normal(0, 0.02, 5), 1e-7
    exact = stuck.amplitudes(hertz, d)[1]
    near = [stuck.amplitudes(hertz, d + w)[0] - stuck.amplitudes(hertz, d - w)[0] for w in h * np.eye(5)]
    assert np.allclose(exact, np.array(near).T / (2 * h), rtol=0, atol=1e-6 * np.abs(exact).max())


@pytest.mark.parametrize("find_level", [False, True])
def test_amplitudes_without_noise_give_the_blades_back(find_level):
    stuck, d = ring(6), np.random.default_rng(3).normal(0, 0.01, 6)
    level = 1.3 if find_level else 1.0
    found = blades_from_gauges(stuck, HERTZ, level * measured(stuck, d), 0.01, find_level=find_level)
    assert np.allclose(found.deviation, d, atol=1e-7) and found.level == pytest.approx(level)
    assert found.misfit < 1e-3


def test_uniform_shifts_move_the_response():
    """All blades alike, shifted by d without contacts between them: the amplitudes of (1 + d) times the frequency."""
    stuck = ring(4)
    alone = Stuck(Tuned(Assembly(*(getattr(stuck.tuned.sector, k) for k in ("components",)), (),
                                 stuck.tuned.sector.loads, stuck.tuned.sector.outputs, Ring(4, 2)), {}))  # fmt: skip
    d = 0.013
    found = blades_from_gauges(alone, HERTZ, measured(alone, np.zeros(4), HERTZ / (1 + d)) / (1 + d) ** 2, 0.01)
    assert np.allclose(found.deviation, d, atol=1e-9)


def test_a_wrong_model_shows_in_the_misfit():
    stuck, rng = ring(6), np.random.default_rng(4)
    a = measured(stuck, rng.normal(0, 0.01, 6)) * (1 + 0.01 * rng.standard_normal((8, 6)))
    assert blades_from_gauges(stuck, HERTZ, a, 0.01).fits
    found = blades_from_gauges(stuck, HERTZ, 1.2 * a, 0.01)
    assert found.misfit > 3 and not found.fits


@pytest.mark.slow
def test_intervals_hold_as_often_as_they_say():
    """95 +- 2 % over 150 rings of six blades, gauges of 2 %."""
    stuck, rng, inside = ring(6), np.random.default_rng(5), []
    for _ in range(150):
        d = rng.normal(0, 0.01, 6)
        a = measured(stuck, d) * (1 + 0.02 * rng.standard_normal((len(HERTZ), 6)))
        low, high = blades_from_gauges(stuck, HERTZ, a, 0.02).interval()
        inside.append((low < d) & (d < high))
    assert np.mean(inside) == pytest.approx(0.95, abs=0.02)


@pytest.mark.parametrize("a, noise", [(np.ones((8, 5)), 0.01), (-np.ones((8, 6)), 0.01), (np.ones((8, 6)), 0.0)])
def test_amplitudes_that_are_none(a, noise):
    refused((), blades_from_gauges, ring(6), HERTZ, a, noise)
