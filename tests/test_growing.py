"""What harmonic balance says of motions that feed themselves, and of friction that hangs on its samples."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import microslip as ms
from microslip.contact.friction import StaticSliding
from microslip.contact.law import value
from microslip.contact.normal import Preload
from microslip.contact.point import PointContact
from microslip.contact.portion import portion
from microslip.harmonic_balance.growing import growing


def warned(call, *args, **keys):
    """What a call warns of, and what it returns."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = call(*args, **keys)
    return [str(w.message) for w in said], found


def test_motions_of_what_feeds_itself_are_told_stable_or_not() -> None:
    """c = -0.02 N s/m: without a contact all motions are unstable; below the limit of a Jenkins element the motion
    grows by exp(0.01 T) a period, and where the element slides it takes what is fed and time comes to the motion."""
    fed = partial(ms.structure, 1.0, 1.0, -0.02, force={0: 0.3})
    said, _ = warned(ms.harmonic_response, fed(), [0.8], unit="rad/s")
    assert len(said) == 2 and "Every motion is unstable" in said[1]
    assert "0.99995 rad/s grows by exp(0.01 t/s)" in said[0]
    held = fed(elements=[ms.jenkins(1.0, 0.5)])
    said, found = warned(ms.harmonic_response, held, [0.8], unit="rad/s")
    assert found.amplitude[0] == pytest.approx(0.3 / (2 - 0.64), rel=1e-3)  # sticks
    grown = float(re.search(r"unstable.*grows by ([\d.]+) a period", said[1])[1])
    assert grown == pytest.approx(np.exp(0.01 * 2 * np.pi / 0.8), rel=1e-3)
    said, found = warned(ms.harmonic_response, held, [1.2], harmonics=7, unit="rad/s")
    assert "at 1.2 rad/s, is stable" in said[1]
    there = ms.integrate(held, 1.2, unit="rad/s", settle=100, keep=2)
    assert 0.5 * np.ptp(there.y) == pytest.approx(found.amplitude[0], rel=1e-2)
    assert warned(ms.follow, held, 1.2, 1.3, unit="rad/s")[0][0].startswith("follow: Without its contacts")
    damped = ms.structure(1.0, 1.0, 0.02, force={0: 0.3}, elements=[ms.jenkins(1.0, 0.5)])
    assert not warned(ms.harmonic_response, damped, [0.8], unit="rad/s")[0]


def test_circulatory_forces_that_make_flutter_are_told() -> None:
    """K = [[2, k], [-k, 2]] flutters for every k without damping, s^2 = -2 +- i k; skew C gives no motion energy."""
    base = ms.structure(np.eye(2), 2 * np.eye(2), force={0: 1.0})
    part = base.components[0]
    circling = replace(part.groups[0], N_r=np.array([[0.0, 0.1], [-0.1, 0.0]]))
    whole = replace(base, components=(replace(part, groups={0: circling}),))
    rate = np.sqrt(-2 + 0.1j + 0j).real
    assert f"exp({abs(rate):.3g} t/s)" in growing(whole)[0]
    turning = ms.structure(np.eye(2), 2 * np.eye(2), np.array([[0.0, 0.3], [-0.3, 0.0]]), force={0: 1.0})
    assert not growing(turning) and not growing(base)


def test_friction_that_saws_in_a_balance_is_told() -> None:
    """Static above sliding friction of a point without mass hangs on the samples."""
    for static in (0.6, 0.3):
        law = PointContact(Preload(value(1.0)), StaticSliding(value(static), value(0.3)), value(1.0))
        shoe = ms.Element(portion(law, value(1.0)), 0, name="shoe")
        rubbed = ms.structure(1.0, 1.0, 0.05, force={0: 0.5}, elements=[shoe])
        said, _ = warned(ms.harmonic_response, rubbed, [1.1], unit="rad/s")
        assert sum("Static friction above the sliding one (shoe)" in one for one in said) == (static > 0.3)
