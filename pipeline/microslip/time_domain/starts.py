"""Where a motion begins: at rest, let go from somewhere, or on the periodic motion of a harmonic balance with what its
contacts remember."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import jax
import numpy as np

from ..data import Array
from ..errors import NotConverged, UserError
from ..harmonic_balance import accuracy
from ..harmonic_balance.problem import Problem
from ..harmonic_balance.response import operating
from ..harmonic_balance.solver import Point, sweep
from ..programs import inner
from ..settings.mistakes import bounded, whole
from ..units import counted, percent
from .contacts import ContactGroup, Held, answer, untouched
from .equations import MotionEquations
from .stepper import MotionState, Stepper

CYCLES = 30
"""Cycles at most in which contacts come to remember a periodic motion."""

SAMPLES = 4096
"""Of each of them."""

FAR = 0.01
"""Share of a periodic motion by which a start may miss it before that is told."""

PERIODIC = 1e-12
"""Share of the largest force of a point within which the end of a cycle is that of the one before."""


@dataclass(frozen=True, eq=False)
class PeriodicStart:
    """A periodic motion to start on.

    Attributes:
        q, v: (m,) modal displacements and velocities at t = 0. d: (c, W) mean, cos, sin, cos 2, ... of the contact
            coordinates, m and rad. beside: estimated share of the motion that its harmonics and samples leave out.
    """

    q: Array
    v: Array
    d: Array
    beside: float = 0.0

    @property
    def messages(self) -> tuple[str, ...]:
        """What a reader must know of it."""
        if self.beside <= FAR:
            return ()
        few = counted(self.d.shape[1] // 2, "harmonic")
        return (
            f"start: harmonic balance with {few} leaves out about {percent(self.beside)} of the motion, which begins "
            "beside the periodic one by as much; raise harmonics and samples, or settle.",
        )


@dataclass(frozen=True, eq=False)
class Released:
    """Bodies that are let go at t = 0. q, v: (m,) modal displacements and velocities."""

    q: Array
    v: Array


RELEASED = ("displacement", "velocity", "mode", "amplitude")
"""Keys of a start from which bodies are let go."""


def released(e: MotionEquations, start: Mapping[str, Any], key: str = "start") -> Released:
    """A start by its keys.

    Args:
        start: displacement, m, and velocity, m/s, of the assembly's coordinates, each (k,) or coordinate -> value, zero
            where it is not given; of bodies from modal files the coordinates are those of their modes, one body after
            the other. Or mode: number from 1 of a mode of the bodies without their contacts, and amplitude of the first
            read-out in it. key: that the caller gives it by.

    Raises:
        UserError: other keys, numbers that are not as many as coordinates, a mode that there is not or that moves no
            read-out.
    """
    if unknown := [name for name in start if name not in RELEASED]:
        raise UserError(f"{key}: '{unknown[0]}' is none of {', '.join(RELEASED)}")
    by_mode = start.get("mode") is not None
    if by_mode != (start.get("amplitude") is not None):
        raise UserError(f"{key}: mode and amplitude come together; give both, or a displacement or a velocity")
    if by_mode and (start.get("displacement") is not None or start.get("velocity") is not None):
        raise UserError(f"{key}: give a mode, or a displacement and a velocity, and not both")
    if by_mode:
        return _in_mode(e, start["mode"], start["amplitude"], key)
    to_modes = e.shapes.T @ e.assembly.joined(1).M.real
    x, v = (_coordinates(start.get(name), len(e.shapes), f"{key}: {name}") for name in RELEASED[:2])
    return Released(to_modes @ x, to_modes @ v)


def _in_mode(e: MotionEquations, mode: Any, amplitude: Any, key: str) -> Released:
    bounded(f"{key}: mode", mode, ge=1, le=len(e.omega2))
    bounded(f"{key}: amplitude", amplitude)
    if mode != int(mode) or not len(e.output):
        raise UserError(f"{key}: mode: is a whole number, and its amplitude that of a read-out; name one")
    q = np.eye(len(e.omega2))[int(mode) - 1]
    seen = float(e.output[0] @ q)
    if abs(seen) <= 1e-9 * np.abs(e.output[0]).max():
        raise UserError(f"{key}: mode: the first read-out does not move in mode {mode}; read another place first")
    return Released(amplitude / seen * q, 0 * q)


def _coordinates(given: Any, count: int, key: str) -> Array:
    """(k,) of values, or by coordinate; zeros where nothing is given."""
    values = np.zeros(count)
    if isinstance(given, Mapping):
        for i in given:
            whole(f"{key}: a coordinate", i)
            bounded(f"{key}: a coordinate", i, le=count - 1)
        bounded(key, list(given.values()))
        values[[int(i) for i in given]] = list(given.values())
    elif given is not None:
        bounded(key, given)
        values = np.atleast_1d(np.asarray(given, dtype=float))
    if values.shape != (count,):
        raise UserError(f"{key}: has shape {values.shape}; the assembly has {count} coordinates")
    return values


def of_balance(e: MotionEquations, problem: Problem, point: Point | None = None) -> PeriodicStart:
    """The solution of a harmonic balance of the same assembly at the frequency of the equations.

    Args:
        point: the solution; it is looked for if not given.

    Raises:
        NotConverged: there is none.
    """
    point = point or sweep(problem, np.array([e.Omega / (2 * np.pi)]))[0]
    if not point.converged:
        raise NotConverged(f'start: harmonic balance found no vibration ({point.status}); write start = "static"')
    beside = accuracy.SAFETY * accuracy.left_out(problem, point.x, e.Omega)
    return replace(of_point(e, problem, point), beside=beside)


def of_point(e: MotionEquations, problem: Problem, point: Point) -> PeriodicStart:
    """A solution of a harmonic balance of the same assembly, whatever it leaves out."""
    vibration, contacts = operating(problem, point), e.contacts
    bodies = [np.concatenate(parts) for parts in zip(*vibration.q.values(), strict=True)]
    M = e.assembly.joined(1).M.real
    q = np.array([e.shapes.T @ (M @ body) for body in bodies])
    turns = 1j * e.Omega * np.arange(len(q))
    relative = [vibration.relative[c.name].copy() for c in contacts]
    for body, c in zip(relative, contacts, strict=True):
        body[:, 0] -= c.offset
    d = np.concatenate(relative) if relative else np.zeros((0, problem.coefficients))
    return PeriodicStart(q.sum(axis=0).real, (turns @ q).real, d)


def begun(stepper: Stepper, start: PeriodicStart) -> MotionState:
    """On a periodic motion, the contacts led along it until what they remember is periodic too."""
    e, H = stepper.equations, start.d.shape[1] // 2
    angle = 2 * np.pi / SAMPLES * np.arange(1, SAMPLES + 1)[:, None] * np.arange(1, H + 1)
    cos, sin = start.d[:, 1::2].T, start.d[:, 2::2].T
    d = start.d[:, 0] + np.cos(angle) @ cos + np.sin(angle) @ sin
    h = e.Omega * np.arange(1, H + 1)[:, None]
    v = np.cos(angle) @ (h * sin) - np.sin(angle) @ (h * cos)
    d, v = d[:, stepper.rows], v[:, stepper.rows]
    held, before = untouched(stepper.groups), np.full(1, np.inf)
    for _ in range(CYCLES):
        held = _led(stepper.groups, held, jax.device_put(d), jax.device_put(v), 2 * np.pi / e.Omega / SAMPLES)
        points = np.concatenate([np.zeros((1, 3)), *(np.asarray(p) for p in held.forces)])
        if np.abs(points - before).max(initial=0.0) <= PERIODIC * np.abs(points).max(initial=0.0):
            break
        before = points
    return stepper.start(start.q, start.v, held=held)


@inner
def _led(groups: tuple[ContactGroup, ...], held: Held, d: Any, v: Any, dt: Any) -> Held:
    """What contacts hold after a path (s, c)."""
    return jax.lax.scan(lambda h, one: (answer(groups, None, *one, dt, h, False), None), held, (d, v))[0]
