"""Where one branch leaves another: the orbits born at a Hopf point, the doubled orbit at a period doubling."""

from __future__ import annotations

import numpy as np

from ..continuation import Settings, branch_off
from ..continuation.curve import State
from ..data import Array
from .dynamics import Dynamics
from .equilibria import Hopf
from .floquet import monodromy
from .shooting import Orbit, Shooting

OFF = 2e-3
"""Size of the first step off a branch, in scales of the coordinates."""


def born_at(system: Dynamics, hopf: Hopf, nodes: int, settings: Settings) -> tuple[Shooting, State]:
    """The orbits born at a Hopf point: their equations, and the first of them."""
    turn = np.exp(2j * np.pi * np.arange(nodes) / nodes)
    way = (turn[:, None] * hopf.shape).real
    way = way / np.sqrt(np.mean((way / np.asarray(system.scale)) ** 2) * system.count)
    guess = Orbit(system, hopf.x + OFF * way, 2 * np.pi / hopf.omega, hopf.p)
    problem = Shooting(system, guess, guess.period)
    ahead = np.append(way, 0.0), 0.0
    return problem, branch_off(problem, problem.unknowns(guess), hopf.p, ahead, settings)


def doubled_at(orbit: Orbit, settings: Settings) -> tuple[Shooting, State]:
    """The orbits of twice the period that are born where a Floquet multiplier passes -1, and the first of them."""
    values, vectors = np.linalg.eig(monodromy(orbit))
    first = vectors[:, np.argmin(np.abs(values + 1))].real
    ways = [first]
    for piece in orbit.derivatives[:-1]:
        ways.append(piece @ ways[-1])
    one = np.array(ways)
    way: Array = np.concatenate([one, -one])
    way = way / np.sqrt(np.mean((way / np.asarray(orbit.system.scale)) ** 2) * orbit.system.count)
    twice = np.concatenate([orbit.x, orbit.x]) + OFF * way
    guess = Orbit(orbit.system, twice, 2 * orbit.period, orbit.p, 2 * orbit.turns)
    problem = Shooting(orbit.system, guess, guess.period)
    ahead = np.append(way, 0.0) if problem.free else way.ravel(), 0.0
    return problem, branch_off(problem, problem.unknowns(guess), orbit.p, ahead, settings)
