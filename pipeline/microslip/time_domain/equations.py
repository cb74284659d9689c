"""An assembly as equations in time: linear bodies whose flow is known exactly, and contacts that kick them.

With q of all bodies, v = q' and the loads' harmonics o = (1, cos h1 Omega t, sin h1 Omega t, ...), the motion between
contact forces is linear with constant coefficients,

    q' = v,  v' = M^-1 (B o - C v - K q),  o' = rotation of o,

whatever the frequency: exp(A tau) gives it after any time tau, resonance and rigid motion included (Sextro Eq. (4.1-3)
with the sign corrected). Contacts see d = D q + D_o o - R (F - F_0); R is the compliance that the modes leave out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg

from ..contact.law import Law
from ..contact.patch import stuck_stiffness
from ..contact.set_valued import SetValued
from ..data import Array
from ..errors import UserError
from ..process import prepare
from ..settings.mistakes import bounded
from ..system.assembly import Assembly, Contact, Linear, diagonal
from .ramp import Ramp, turning_loads

SEEN = 1e-12
"""Share of the largest entry below which a coupling of modes by dampers counts as rounding."""


@dataclass(frozen=True, eq=False)
class MotionEquations:
    """Real equations of motion in modal coordinates, M = 1, and rows of what is seen of them.

    Attributes:
        assembly. Omega: rad/s of the first harmonic of the loads. omega2: (m,) (rad/s)^2. C: (m, m) damping and
            gyroscopic matrix over M. shapes: (m0, m) coordinates of the assembly per modal one.
        harmonics: those of the loads, positive. B: (m, 1 + 2 H) modal forces of o.
        D: (c, m), D_o: (c, 1 + 2 H) motion of the contact coordinates. R: (c, c) m/N. F_0: (c,) preload, N and N m.
        output: (w, m), output_given: (w, 1 + 2 H), output_residual: (w, c); the read-outs are
            y = output q + output_given o - output_residual (F - F_0).
        ramp: of a run-up, whose o is `Ramp.driving`. push: (m, n) modal forces of it that kick, B those that flow.
    """

    assembly: Assembly
    Omega: float
    omega2: Array
    C: Array
    shapes: Array
    harmonics: tuple[int, ...]
    B: Array
    D: Array
    D_o: Array
    R: Array
    F_0: Array
    output: Array
    output_given: Array
    output_residual: Array
    ramp: Ramp | None = None
    push: Array | None = None

    @property
    def contacts(self) -> tuple[Contact, ...]:
        return self.assembly.contacts

    @cached_property
    def turning(self) -> Array:
        """(n, n) o' over o; zero of a run-up, whose o does not turn with one frequency."""
        if self.ramp:
            return np.zeros((self.B.shape[1], self.B.shape[1]))
        turns = [np.array([[0.0, -1.0], [1.0, 0.0]]) * h * self.Omega for h in self.harmonics]
        return diagonal([np.zeros((1, 1)), *turns])

    def turned(self, lengths: Array) -> Array:
        """(k, n, n) by which o turns in so many s: the exponentials of `turning`."""
        turns = np.tile(np.eye(len(self.turning)), (len(lengths), 1, 1))
        if self.ramp is None:
            for i, h in enumerate(self.harmonics):
                c, s = np.cos(h * self.Omega * lengths), np.sin(h * self.Omega * lengths)
                turns[:, 2 * i + 1 : 2 * i + 3, 2 * i + 1 : 2 * i + 3] = np.stack([[c, -s], [s, c]]).transpose(2, 0, 1)
        return turns

    def oscillators(self, time: Array | float) -> Array:
        """(..., n) o at times (s), n = 1 + 2 H."""
        if self.ramp:
            return np.asarray(self.ramp.driving(time, self.harmonics))
        angle = np.asarray(time)[..., None] * self.Omega * np.array(self.harmonics, dtype=float)
        pairs = np.stack([np.cos(angle), np.sin(angle)], axis=-1).reshape(*np.shape(time), -1)
        return np.concatenate([np.ones((*np.shape(time), 1)), pairs], axis=-1)

    def rates(self, time: Array) -> Array:
        """(s, n) o' at times (s)."""
        if self.ramp is None:
            return self.oscillators(time) @ self.turning.T
        h = 1e-4 / self.Omega
        return (self.oscillators(time + h) - self.oscillators(time - h)) / (2 * h)

    def frequency(self, time: Array) -> Array:
        """rad/s of the loads' first harmonic at times (s)."""
        return self.ramp.omega(time) if self.ramp else np.full(np.shape(time), self.Omega)

    @cached_property
    def still(self) -> tuple[Array, Array]:
        """(m,) modal forces and (c,) motion of the contacts by loads that do not vibrate, at the start."""
        if self.ramp is None or self.push is None:
            return self.B[:, 0], self.D_o[:, 0]
        return self.B[:, 0] + self.push[:, -2] * (self.ramp.first / self.ramp.order) ** 2, self.D_o[:, 0]

    @cached_property
    def steady(self) -> Array | None:
        """(m, 1 + 2 H) the periodic motion q = steady o that open contacts leave; None: there is none (a resonance
        without damping, a body that nothing holds under a force, a run-up)."""
        if self.ramp:
            return None
        m = len(self.omega2)
        motion = np.zeros((m, 1 + 2 * len(self.harmonics)))
        K = np.diag(self.omega2)
        for i, h in enumerate((0, *self.harmonics)):
            w = h * self.Omega
            S = K + 1j * w * self.C - w**2 * np.eye(m)
            f = self.B[:, 0] + 0j if h == 0 else self.B[:, 2 * i - 1] - 1j * self.B[:, 2 * i]
            q, *_ = np.linalg.lstsq(S, f, rcond=1e-14)
            if np.abs(S @ q - f).max(initial=0.0) > 1e-8 * np.abs(f).max(initial=0.0):
                return None
            if h == 0:
                motion[:, 0] = q.real
            else:
                motion[:, 2 * i - 1], motion[:, 2 * i] = q.real, -q.imag
        return motion

    @cached_property
    def springs(self) -> Array:
        """(c, c) N/m of the closed, sticking contacts on bodies that yield at once by R; of one that stiffens as it is
        pressed, the stiffest within `DEEPEST`; of set-valued ones, that of the bodies themselves."""
        if any(isinstance(c.patch.law, SetValued) for c in self.contacts):
            return np.linalg.pinv(self.R, rcond=1e-12, hermitian=True) + self._own
        return self._own @ self.yields

    @cached_property
    def yields(self) -> Array:
        """(c, c) share of the motion of the modes that is left to sticking contacts where R yields as well."""
        return np.linalg.inv(np.eye(len(self.R)) + self.R @ self._own)

    @cached_property
    def _own(self) -> Array:
        alike = {(id(c.patch), c.offset.tobytes()): c for c in self.contacts}
        stiffest = {key: _stiffest(c) for key, c in alike.items()}
        return diagonal([stiffest[id(c.patch), c.offset.tobytes()] for c in self.contacts])

    @cached_property
    def fastest(self) -> float:
        """rad/s: the highest frequency of the bodies with their contacts closed and stuck."""
        K = np.diag(self.omega2) + self.D.T @ self.springs @ self.D
        return float(np.sqrt(max(np.linalg.eigvalsh(0.5 * (K + K.T)).max(initial=0.0), 0.0)))

    @cached_property
    def rate(self) -> float:
        """rad/s: of the contacts' springs on bodies without springs of their own. Kicks are stable up to steps of
        2 / rate."""
        K = self.D.T @ self.springs @ self.D
        return float(np.sqrt(max(np.linalg.eigvalsh(0.5 * (K + K.T)).max(initial=0.0), 0.0)))


DEEPEST = 6.6e-5
"""m: how deep contacts that stiffen are taken to be pressed where their largest stiffness is needed."""


def _stiffest(contact: Contact) -> Array:
    """(k, k) N/m."""
    if isinstance(contact.patch.law, SetValued):
        return np.zeros(2 * contact.offset.shape)
    deep = np.zeros((9, len(contact.offset)))
    deep[:, 0] = DEEPEST / 4.0 ** np.arange(9)
    stiffnesses = [contact.stiffness, *stuck_stiffness(contact.patch, deep)]
    return stiffnesses[int(np.argmax([np.trace(k) for k in stiffnesses]))]


def of(assembly: Assembly, Omega: float, second: float | None = None) -> MotionEquations:
    """The equations of an assembly driven at a frequency (rad/s); a sector that stands for a ring is unrolled.

    Loads of a second frequency (rad/s) count as a harmonic of the first one that is no whole number.

    Loss factors of bodies count as dampers that take as much at that frequency.

    Raises:
        UserError: a frequency that is not positive; modes that are not real; a law that does not say what it remembers;
            circulatory forces; rigid contacts that nothing can press.
    """
    prepare()
    bounded("frequency", Omega / (2 * np.pi), gt=0)
    assembly = (assembly if second is None else _of_two(assembly, second / Omega)).unrolled()
    assembly.check_names()
    for contact in assembly.contacts:
        _remembers(contact)
    harmonics = tuple(sorted({x.harmonic for x in assembly.loads if x.harmonic}))
    parts = {h: assembly.joined(h) for h in sorted({0, 1, *harmonics})}
    mean, first = parts[0], parts[1]
    M, K, C, rows = (_real(a, assembly) for a in (first.M, first.K, first.viscous(Omega), mean.rows))
    if circulating := [c.name for c in assembly.components if any(g.N_r is not None for g in c.groups.values())]:
        raise UserError(
            f"{circulating[0]}: has circulatory forces (N_r in its modal file), which a motion in time does not take; "
            "the harmonic balance does, and microslip stability tells whether they make it grow"
        )
    omega2, V = scipy.linalg.eigh(0.5 * (K + K.T), 0.5 * (M + M.T))
    omega2 = np.where(np.abs(omega2) < SEEN * np.abs(omega2).max(initial=0.0), 0.0, omega2)
    C = V.T @ C @ V
    C = np.where(np.abs(C) < SEEN * np.abs(C).max(initial=0.0), 0.0, C)
    D = rows @ V
    _can_press(assembly.contacts, D, _real(mean.residual, assembly))
    F_0 = np.concatenate([c.preload for c in assembly.contacts]) if assembly.contacts else np.zeros(0)
    B = _of_harmonics(parts, harmonics, lambda p: V.T @ p.load)
    return MotionEquations(
        assembly, float(Omega), omega2, C, V, harmonics, B, D,
        _of_harmonics(parts, harmonics, lambda p: p.given), _real(mean.residual, assembly), F_0,
        _real(mean.output, assembly) @ V, _of_harmonics(parts, harmonics, lambda p: p.output_given),
        _real(mean.output_residual, assembly),
    )  # fmt: skip


def _of_two(assembly: Assembly, ratio: float) -> Assembly:
    """The same with loads of the second tone as harmonics of the first."""
    bounded("second", ratio, gt=0)
    if assembly.ring is not None:
        raise UserError("second: of a ring, one engine order drives; leave second out")
    if all(x.tone == 1 for x in assembly.loads):
        raise UserError(
            "second: no load has this frequency; give second_force to structure or tone = 2 in a case, or leave it out"
        )
    loads = (x if x.tone == 1 else replace(x, tone=1, harmonic=x.harmonic * ratio) for x in assembly.loads)  # type: ignore[arg-type]
    return replace(assembly, loads=tuple(loads))


def _can_press(contacts: Sequence[Contact], D: Array, R: Array) -> None:
    """Refuse rigid contacts along whose normal nothing moves: no force would ever press them, nor friction act."""
    ends = np.cumsum([len(c.offset) for c in contacts])
    for contact, end in zip(contacts, ends, strict=True):
        law, rows = contact.patch.law, slice(end - len(contact.offset), end)
        normal = contact.patch.kinematics[:, 0]
        moves = np.hstack([D[rows], R[rows]])
        if isinstance(law, SetValued) and law.normal is None and not (normal @ moves).any():
            raise UserError(
                f'contacts.{contact.name}: law "set-valued" is pressed by what moves along its normal, and here '
                'nothing does, so that it would hold no friction; let the body move there (free = "xz", say), or take '
                "another law"
            )


def _remembers(contact: Contact) -> None:
    """Refuse a law of another package that lacks what a motion in time marches and reads of its history."""
    law = getattr(contact.patch.law, "whole", contact.patch.law)
    if lacks := [name for name in MARCHED if getattr(type(law), name, None) is getattr(Law, name)]:
        raise UserError(
            f"contacts.{contact.name}: {type(law).__name__} has no {', '.join(lacks)}; a motion in time follows what a "
            "law remembers: write them (docs/own_law.md)"
        )


MARCHED = ("init", "step", "slip", "stored")
"""What every law has to say of its state."""


def _real(values: Array, assembly: Assembly) -> Array:
    if np.abs(values.imag).max(initial=0.0) > 1e-9 * np.abs(values).max(initial=0.0):
        names = ", ".join(c.name for c in assembly.components)
        raise UserError(f"{names}: has complex modes, which a motion in time cannot take; leave the flow or speed out")
    return np.ascontiguousarray(values.real)


def _of_harmonics(parts: dict[int, Linear], harmonics: Sequence[int], of: Callable[[Linear], Array]) -> Array:
    """(n, 1 + 2 H): complex amplitudes a of every harmonic as Re(a exp(i h Omega t)) = a' cos - a'' sin."""
    columns = [of(parts[0]).real]
    for h in harmonics:
        a = of(parts[h])
        columns += [a.real, -a.imag]
    return np.stack(columns, axis=1)


def of_ramp(assembly: Assembly, ramp: Ramp) -> MotionEquations:
    """The equations of an assembly whose loads' frequency changes.

    Loads in rad2/s2 (centrifugal) follow the square of the rotation speed. Matrices stay as they are: those of the
    modal files' speeds. Loss factors of bodies count as dampers that take as much at the highest frequency.

    Raises:
        UserError: see `of` and `ramp.turning_loads`.
    """
    assembly = assembly.unrolled()
    rest, square, rising = turning_loads(assembly, ramp)
    e = of(rest, max(ramp.first, ramp.last))
    turning = e.shapes.T @ np.stack([square, rising], axis=1)
    push = np.concatenate([np.zeros((len(e.B), 1)), e.B[:, 1:], turning], axis=1)
    flowing = np.concatenate([e.B[:, :1], np.zeros((len(e.B), push.shape[1] - 1))], axis=1)

    def wider(given: Array) -> Array:
        return np.concatenate([given, np.zeros((len(given), 2))], axis=1)

    return replace(
        e, B=flowing, D_o=wider(e.D_o), output_given=wider(e.output_given), ramp=ramp, push=push, assembly=assembly
    )
