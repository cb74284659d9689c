"""One law of each kind, with numbers of a shroud contact: the contract tests run over all of them."""

# numbers become arrays at the end
# mypy: disable-error-code="arg-type"

from __future__ import annotations

from dataclasses import replace
from typing import Any

import jax
import numpy as np

from ..process import prepare
from .curves import curve
from .friction import Coulomb, Falling, Friction, Heated, StaticSliding, characteristic, scattered
from .friction import Exponential as Rising
from .heights import Cut, Exponential, Gaussian, Heights, Linear, Polynomial, tabulated
from .hertz import Hertz
from .kinds import of_others
from .law import Example as Example
from .law import value
from .normal import Gapped, Hyperbolic, Normal, Penalty, Potential, Rough, measured
from .point import PointContact
from .point_laws import hertz_point, round_point
from .portion import Portion
from .profiles import Profile, RoundContact
from .rate import RateContact
from .regularised import MassContact
from .sliders import Iwan, mindlin, rough_strips, segalman
from .solids import Solid
from .wear import course

prepare()  # who asks for the examples computes them

_ROUGH = Rough(2.4e8, 12e-6, Polynomial())
_HYPERBOLIC = Hyperbolic(2.4e8, 12e-6, Polynomial(), 120e-6)
_MEASURED = measured(curve([0, 2e-6, 5e-6, 9e-6, 14e-6], [0, 20, 240, 900, 2100]), 2.4e8)
_GROUND = tabulated([0, 0.12, 0.3, 0.38, 0.55, 0.8, 0.95, 1.1], [0, 0.01, 0.12, 0.26, 0.63, 0.9, 0.98, 1])
_COULOMB = Coulomb(0.3)
_STEEL = Solid(2.1e11, 0.3)
_C, _C_2 = 0.9e8, 0.4e8


def _point(normal: Normal = _ROUGH, friction: Friction = _COULOMB, *more: float | None, **about: Any) -> Example:
    """A point contact by its normal law, friction, second stiffness and damping."""
    return Example(PointContact(normal, friction, _C, *more), 1.2e-5, 8e-6, **about)


def _heights(heights: Heights) -> Example:
    return _point(Rough(2.4e8, 12e-6, heights))


_EXAMPLES = {
    "smooth point": Example(PointContact(Penalty(2.4e8), _COULOMB, _C), 1e-5, 1e-5),
    "rough point": _point(),
    "rough point, two stiffnesses": _point(_ROUGH, _COULOMB, _C_2, isotropic=False),
    "portion of a rough contact": Example(Portion(PointContact(_ROUGH, _COULOMB, _C), 0.125), 1.2e-5, 8e-6),
    "linear heights": _heights(Linear()),
    "exponential heights, cut": _heights(Cut(Exponential(4.0))),
    "Gaussian heights, cut": _heights(Cut(Gaussian(0.5, 0.22))),
    "tabulated heights": _heights(_GROUND),
    "worn heights": _heights(course(_GROUND, 0.1, np.array([1.5])).heights()),
    "hyperbolic point": _point(_HYPERBOLIC),
    "potential point": _point(Potential(2e3, 12e-6, 2.5)),
    "gapped point": Example(PointContact(Gapped(_ROUGH, 2e-6), _COULOMB, _C), 1.4e-5, 8e-6),
    "measured point": _point(_MEASURED),
    "Hertz point": Example(hertz_point(Hertz(_STEEL, _STEEL, 5.0, 20.0), _COULOMB), 1.2e-5, 8e-6, isotropic=False),
    "round point": Example(
        round_point(RoundContact(_STEEL, _STEEL, Profile.power(1.0, 1e-5, 1e-3, 0.01)), _COULOMB, 2000.0), 1.2e-5, 8e-6
    ),
    "rough point, damped": _point(_ROUGH, _COULOMB, None, 2e-4),
    "point, static and sliding": _point(_ROUGH, StaticSliding(0.4, 0.3), jumps=True),
    "point, falling": _point(_ROUGH, Falling(0.3, 5.0), jumps=True),
    "point, rising": _point(_ROUGH, Rising(0.2, 0.3, 50.0)),
    "point, heated": _point(_ROUGH, Heated(0.3, 1e-6, 900.0, 4e-6), _C_2, isotropic=False, jumps=True),
    "point, measured": _point(
        _ROUGH, characteristic(np.array([1e-4, 1e-3, 1e-2]), np.array([0.4, 0.3, 0.25])), jumps=True
    ),
    "point, scattered": _point(_ROUGH, scattered(_COULOMB, 0.1, 2e-3)),
    "point with mass": Example(
        MassContact(_ROUGH, _COULOMB, _C, None, 1e-6, 1e-5, 1e6), 1.2e-5, 8e-6, inertia=0.02
    ),
    "point by its velocity": Example(RateContact(_ROUGH, Rising(0.2, 0.3, 50.0), 1e4, 1e-6), 1.2e-5, 8e-6),
    "rough strips": Example(rough_strips(2.4e8, 12e-6, Polynomial(), _C, 0.3, 6), 1.2e-5, 8e-6),
    "Mindlin": Example(mindlin(Hertz(_STEEL, _STEEL, 20.0, 20.0), 0.3, 3e-5, 6), 1.2e-5, 8e-6),
    "Mindlin, two stiffnesses": Example(
        mindlin(Hertz(_STEEL, _STEEL, 5.0, 20.0), 0.3, 3e-5, 4), 1.2e-5, 8e-6, isotropic=False
    ),
    "Iwan": Example(Iwan(_ROUGH, 0.3, _C, *segalman(5, -0.5, 0.1, 0.05)), 1.2e-5, 8e-6),
}

EXAMPLES: dict[str, Example] = {
    name: replace(example, law=jax.tree_util.tree_map(value, example.law)) for name, example in _EXAMPLES.items()
} | of_others("example")
"""Name -> law, those of other packages last."""
