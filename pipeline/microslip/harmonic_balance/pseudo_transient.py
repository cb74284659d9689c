"""From rest to a vibration in pseudo-time: a way to solutions where Newton's method alone does not arrive.

A body that nothing but its contacts holds may slide as a whole. Its mean place then hardly matters to the forces, and
Newton's method sends it anywhere; where it stops sticking, the solution that was followed ends, and the next one is
far away. In time nothing of this is difficult: amplitudes and mean places q_h grow slowly, as the averaged equations

    B_h dq_h/dt = f_h - S_h q_h - T^H (F_h - p_h),    B_h = C + 2 i h Omega M,    B_0 = 2 Omega M

say (Krylov and Bogoliubov's method; B_0 is chosen, because inertia times acceleration would let a mean place swing).
Steps of the implicit Euler method that grow in length end as steps of Newton's (pseudo-transient continuation, Kelley
and Keyes, SIAM J. Numer. Anal. 35, 1998). A step is the balance with every coordinate tied to where it was by springs
B_h / dt, so that all of it is the solution of a problem like the one asked.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg

from ..data import Array, ComplexArray, largest
from ..errors import UserError
from ..system.assembly import Linear
from .forces import AFT
from .problem import AtFrequency, Problem
from .reduced import Eliminated, own_coordinates

Places = list[list[ComplexArray]]
"""Harmonic -> part -> (m,) amplitudes of the bodies' coordinates, as `AtFrequency.modal` gives them."""

HELD = 1e-3
"""Share of the contacts' stiffness below which a motion counts as held by nothing but the contacts."""

FREE = 1e-9
"""The same for a motion that nothing holds at all: rounding."""

ROUNDING = 1e-13
"""Share of the largest stiffness below which another one is none."""


def at_rest(problem: Problem) -> Places:
    """Nothing moves."""
    return [[np.zeros(len(part.M), dtype=complex) for part in parts] for parts in problem.parts]


def slowly(at: AtFrequency, rate: float, q: Places) -> AtFrequency:
    """The balance a step of pseudo-time 1 / rate (1/s) after q."""
    share = [[rate * _inertia(part, at.Omega, h) for part in parts] for h, parts in enumerate(at.problem.parts)]
    return _tied(at, share, q)


def in_place(at: AtFrequency, q: Places) -> AtFrequency:
    """The balance with springs that leave the mean place of bodies which nothing holds at q, about as stiff as their
    contacts."""
    springs: list[list[Array]] = [[np.zeros_like(part.M) for part in parts] for parts in at.problem.parts]
    springs[0] = [_springs(part, k) for part, k in zip(at.problem.parts[0], at.problem.stiffness, strict=True)]
    return _tied(at, springs, q)


def unbalanced(at: AtFrequency, before: Places, after: Places) -> tuple[float, str]:
    """Mean force (N, per travel of the contact that travels most) that the springs of `in_place` hold, and on whom.

    Args:
        before, after: where the springs begin, and the solution of that balance.
    """
    most, whom, p = 0.0, "", at.problem
    for i, (part, k, s) in enumerate(zip(p.parts[0], p.stiffness, p.slices, strict=True)):
        motions, shares = unconstrained(part, k)
        free = motions[:, shares < FREE]
        forces = np.abs(free.conj().T @ _stuck(part, k) @ (before[0][i] - after[0][i]))
        travel = np.abs(part.rows @ free) * (p.length / p.scale[s])[:, None]
        for force, way, motion in zip(forces, travel.T, free.T, strict=True):
            if force > most * way.max():
                most, whom = float(force / way.max()), _component(p, i, motion)
    return most, whom


def serves(problem: Problem) -> bool:
    """Whether laws are marched: those of the book's mode do not know the mean place."""
    return any(isinstance(g.model, AFT) for g in problem.groups)


def unheld(problem: Problem) -> bool:
    """Whether nothing at all but the contacts holds some motion of a body."""
    parts = zip(problem.parts[0], problem.stiffness, strict=True)
    return any(bool((unconstrained(part, k)[1] < FREE).any()) for part, k in parts)


def unconstrained(part: Linear, stiffness: Array) -> tuple[Array, Array]:
    """Mean motions that the contacts hold far better than anything else.

    Args:
        part: in harmonic 0. stiffness: (c, c) of the sticking contacts.

    Returns:
        (m, l) motions of unit stiffness with sticking contacts, (l,) what share of it is not the contacts'. None where
        sticking contacts leave a negative stiffness, of a free body that spins: Coriolis forces hold it then.

    Raises:
        UserError: motions that not even sticking contacts hold.
    """
    stuck = _stuck(part, stiffness)
    try:
        shares, motions = scipy.linalg.eigh(_symmetric(part.K), stuck)
    except np.linalg.LinAlgError as error:
        values = scipy.linalg.eigvalsh(stuck)
        if np.abs(values).min() > ROUNDING * values[-1]:  # a free body that spins drives itself away; all are held
            return np.zeros((len(stuck), 0)), np.zeros(0)
        raise UserError(
            "nothing holds the bodies as a whole, and a steady force has no balance there: hold one of them "
            "([[supports]] of its body.toml), or give free bodies weak_springs in the case"
        ) from error
    return motions[:, shares < HELD], shares[shares < HELD]


def _stuck(part: Linear, stiffness: Array) -> Array:
    """(m, m) stiffness with sticking contacts, without circulatory forces."""
    return _symmetric(part.K) + part.rows.conj().T @ stiffness @ part.rows


def _symmetric(K: Array) -> Array:
    return 0.5 * (K + K.conj().T)


def _springs(part: Linear, stiffness: Array) -> Array:
    motions, shares = unconstrained(part, stiffness)
    P = _stuck(part, stiffness) @ motions[:, shares < FREE]
    return P @ P.conj().T


def _inertia(part: Linear, Omega: float, harmonic: int) -> Array:
    return part.C + 2j * harmonic * Omega * part.M if harmonic else 2 * Omega * part.M


def _tied(at: AtFrequency, springs: list[list[Array]], q: Places) -> AtFrequency:
    """The balance with springs (m, m) by harmonic and part from every coordinate to its place in q."""
    p = at.problem
    parts = tuple(
        tuple(
            replace(part, K=part.K + S, load=part.load + S @ place / (p.share or 1.0 if h else 1.0))
            for part, S, place in zip(row, ties, places, strict=True)
        )
        for h, (row, ties, places) in enumerate(zip(p.parts, springs, q, strict=True))
    )
    by_part = zip(zip(*parts, strict=True), p.stiffness, strict=True)
    views = [Eliminated(one, k).directly(at.Omega) for one, k in by_part]
    return replace(at, problem=replace(p, parts=parts), both=p.stacked(views))


def _component(problem: Problem, part: int, motion: Array) -> str:
    """Name of the component that moves most."""
    components = problem.assembly.components
    if len(problem.parts[0]) > 1:
        return components[part].name
    size = [largest(motion[s]) for s in own_coordinates(problem.assembly, 0)]
    return components[int(np.argmax(size))].name
