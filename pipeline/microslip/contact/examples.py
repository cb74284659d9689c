"""One law of each kind, with numbers of a shroud contact: the contract tests run over all of them."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from ..process import prepare
from .curves import curve
from .friction import Coulomb, Falling, Friction, Heated, Scattered, StaticSliding, characteristic, scattered
from .friction import Exponential as Rising
from .heights import Cut, Exponential, Gaussian, Heights, Linear, Polynomial, tabulated
from .hertz import Hertz
from .kinds import of_others
from .law import Array
from .law import Example as Example
from .normal import Gapped, Hyperbolic, Penalty, Potential, Rough, measured
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


def _value(number: float) -> jnp.ndarray:
    return jnp.asarray(number, dtype=float)


def _rough(heights: Heights) -> Example:
    return Example(PointContact(Rough(_value(2.4e8), _value(12e-6), heights), _COULOMB, _C), 1.2e-5, 8e-6)


_ROUGH = Rough(_value(2.4e8), _value(12e-6), Polynomial())
_HYPERBOLIC = Hyperbolic(_value(2.4e8), _value(12e-6), Polynomial(), _value(120e-6))
_MEASURED = measured(curve([0, 2e-6, 5e-6, 9e-6, 14e-6], [0, 20, 240, 900, 2100]), 2.4e8)
_GROUND = tabulated([0, 0.12, 0.3, 0.38, 0.55, 0.8, 0.95, 1.1], [0, 0.01, 0.12, 0.26, 0.63, 0.9, 0.98, 1])
_COULOMB = Coulomb(_value(0.3))
_STEEL = Solid(2.1e11, 0.3)
_C = _value(0.9e8)


def _point(friction: Friction, stiffness_2: Array | None = None) -> Example:
    law = PointContact(_ROUGH, friction, _C, stiffness_2)
    jumps = not isinstance(friction, Scattered | Rising)
    return Example(law, 1.2e-5, 8e-6, isotropic=stiffness_2 is None, jumps=jumps)


EXAMPLES: dict[str, Example] = {
    "smooth point": Example(PointContact(Penalty(_value(2.4e8)), _COULOMB, _C), 1e-5, 1e-5),
    "rough point": Example(PointContact(_ROUGH, _COULOMB, _C), 1.2e-5, 8e-6),
    "rough point, two stiffnesses": Example(
        PointContact(_ROUGH, _COULOMB, _C, _value(0.4e8)), 1.2e-5, 8e-6, isotropic=False
    ),
    "portion of a rough contact": Example(Portion(PointContact(_ROUGH, _COULOMB, _C), _value(0.125)), 1.2e-5, 8e-6),
    "linear heights": _rough(Linear()),
    "exponential heights, cut": _rough(Cut(Exponential(_value(4.0)))),
    "Gaussian heights, cut": _rough(Cut(Gaussian(_value(0.5), _value(0.22)))),
    "tabulated heights": _rough(_GROUND),
    "worn heights": _rough(course(_GROUND, 0.1, np.array([1.5])).heights()),
    "hyperbolic point": Example(PointContact(_HYPERBOLIC, _COULOMB, _C), 1.2e-5, 8e-6),
    "potential point": Example(
        PointContact(Potential(_value(2e3), _value(12e-6), _value(2.5)), _COULOMB, _C), 1.2e-5, 8e-6
    ),
    "gapped point": Example(PointContact(Gapped(_ROUGH, _value(2e-6)), _COULOMB, _C), 1.4e-5, 8e-6),
    "measured point": Example(PointContact(_MEASURED, _COULOMB, _C), 1.2e-5, 8e-6),
    "Hertz point": Example(hertz_point(Hertz(_STEEL, _STEEL, 5.0, 20.0), _COULOMB), 1.2e-5, 8e-6, isotropic=False),
    "round point": Example(
        round_point(RoundContact(_STEEL, _STEEL, Profile.power(1.0, 1e-5, 1e-3, 0.01)), _COULOMB, 2000.0), 1.2e-5, 8e-6
    ),
    "rough point, damped": Example(PointContact(_ROUGH, _COULOMB, _C, None, _value(2e-4)), 1.2e-5, 8e-6),
    "point, static and sliding": _point(StaticSliding(_value(0.4), _value(0.3))),
    "point, falling": _point(Falling(_value(0.3), _value(5.0))),
    "point, rising": _point(Rising(_value(0.2), _value(0.3), _value(50.0))),
    "point, heated": _point(Heated(_value(0.3), _value(1e-6), _value(900.0), _value(4e-6)), stiffness_2=_value(0.4e8)),
    "point, measured": _point(characteristic(np.array([1e-4, 1e-3, 1e-2]), np.array([0.4, 0.3, 0.25]))),
    "point, scattered": _point(scattered(_COULOMB, 0.1, 2e-3)),
    "point with mass": Example(
        MassContact(_ROUGH, _COULOMB, _C, None, _value(1e-6), _value(1e-5), _value(1e6)), 1.2e-5, 8e-6, inertia=0.02
    ),
    "point by its velocity": Example(
        RateContact(_ROUGH, Rising(_value(0.2), _value(0.3), _value(50.0)), _value(1e4), _value(1e-6)), 1.2e-5, 8e-6
    ),
    "rough strips": Example(rough_strips(2.4e8, 12e-6, Polynomial(), 0.9e8, 0.3, 6), 1.2e-5, 8e-6),
    "Mindlin": Example(mindlin(Hertz(_STEEL, _STEEL, 20.0, 20.0), 0.3, 3e-5, 6), 1.2e-5, 8e-6),
    "Mindlin, two stiffnesses": Example(
        mindlin(Hertz(_STEEL, _STEEL, 5.0, 20.0), 0.3, 3e-5, 4), 1.2e-5, 8e-6, isotropic=False
    ),
    "Iwan": Example(Iwan(_ROUGH, _value(0.3), _C, *segalman(5, -0.5, 0.1, 0.05)), 1.2e-5, 8e-6),
} | of_others("example")
"""Name -> law, those of other packages last."""
