"""The balance of an assembly under two frequencies that have no common period.

The unknowns are the harmonics of the relative motions d of all contacts in every pair k of `torus`; the bodies are
eliminated exactly at the frequency k . omega of each (`reduced`). Contact forces are taken on the samples of the closed
line, as they come in time there: of laws without memory from displacement and velocity, the velocity being that of
omega itself; of laws that remember by marching until the line's memory is periodic (`contact.periodic`). Derivatives
are exact. Where the second frequency is not given it is unknown too, and with a reference motion c_0

    sum of (d c_0 / d theta_2) . (c - c_0) = 0

chooses among the motions that differ by a shift of theta_2 alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..contact.law import Law
from ..data import Array, ComplexArray
from ..errors import UserError
from ..programs import program
from ..series import Torus, closed, commensurate, differentiated
from ..system.assembly import Assembly, Linear
from . import problem as balance
from . import reduced
from .by_hand import ElasticSpring
from .forces import AFT
from .problem import Group, Problem

CYCLES = 100
"""Marched at most along the closed line."""

PERIODICITY = 1e-10
"""Share of the largest force within which sliders are periodic along it."""


@dataclass(frozen=True, eq=False)
class TwoToneContacts:
    """Equal contacts. Attributes: group. model: of their forces on the closed line. ground: (c n, 3) m/s under them."""

    group: Group
    model: AFT
    ground: Array

    @cached_property
    def marched(self) -> bool:
        """Whether their forces do not follow from displacement and velocity of the moment."""
        return self.model.law.remembers != 0 or isinstance(self.model, ElasticSpring)

    @property
    def remember(self) -> bool:
        return self.model.law.remembers != 0

    @property
    def law(self) -> Law:
        """Of all points."""
        return self.model.law

    def on(self, torus: Torus) -> TwoToneContacts:
        """The same on another line."""
        return replace(self, model=replace(self.model, torus=torus))

    @cached_property
    def kinematics(self) -> Array:
        """(n, 3, k)."""
        return np.asarray(self.model.patch.kinematics)


@dataclass(frozen=True, eq=False)
class TwoTone:
    """An assembly and how finely it is balanced: `continuation.Equations` over the first frequency, rad/s.

    Attributes:
        problem: its one-tone balance, for what does not depend on frequencies. parts: pair -> what is linear, with the
            loads of that pair; (0, 0) is the mean. contacts: in groups. torus.
        second: rad/s; where it is free, the guess.
        free: whether the second frequency is unknown. reference: (W, c) motion whose phase is kept then.
        shares: of the loads of the first and of the second tone. least: turns of the faster angle in the line.
    """

    problem: Problem
    parts: dict[tuple[int, int], Linear]
    contacts: tuple[TwoToneContacts, ...]
    torus: Torus
    second: float
    free: bool = False
    reference: Array | None = None
    shares: tuple[float, float] = (1.0, 1.0)
    lam_scale: float = 1.0
    least: int = 32

    @property
    def x_scale(self) -> Array | float:
        if not self.free:
            return self.problem.x_scale
        return np.append(np.full(self.size, self.problem.x_scale), self.second)

    @property
    def size(self) -> int:
        """Number of unknown coefficients."""
        return self.torus.coefficients * self.problem.count

    def at(self, first: float, second: float) -> TwoTone:
        """The same at other frequencies (rad/s), with a line of its own where contacts remember.

        Raises:
            UserError: contacts that remember while the two have a common period.
        """
        other = replace(self, second=second, lam_scale=first)
        if not any(one.remember for one in self.contacts):
            return other
        small = commensurate(first, second, self.torus.order)
        if small and not self.free:
            raise UserError(
                f"second: the frequencies are as {small[0]} to {small[1]}, so that the motion repeats and contacts "
                f"that remember depend on the phase between the tones; give loads of the harmonics {small[0]} and "
                f"{small[1]} of their common frequency and use harmonic_response"
            )
        torus = replace(self.torus, turns=closed(first, second, self.least))
        return replace(other, torus=torus, contacts=tuple(one.on(torus) for one in self.contacts))

    def frequencies(self, x: Array, first: float) -> tuple[float, float]:
        """rad/s."""
        return first, float(x[-1]) if self.free else self.second

    def displacement(self, x: Array) -> Array:
        """(W, c) m and rad."""
        return x[: self.size].reshape(self.torus.coefficients, -1) * self.problem.scale

    def linear(self, pair: Sequence[int]) -> tuple[Linear, float]:
        """What is linear in a pair, and the share of its loads."""
        a, b = (int(k) for k in pair)
        share = self.shares[1] if a == 0 and b else self.shares[0] if a else 1.0
        return self.parts.get((a, b), self.parts[1, 1]), share

    def views(self, first: float, second: float) -> list[reduced.Seen]:
        """Of the mean and every pair, at their frequencies; of negative ones conjugate."""
        w, k = self.torus.frequencies(first, second), self.problem.stiffness[0]
        seen = [reduced.seen(self.parts[0, 0], k, 0.0, 0)]
        for pair, one in zip(self.torus.pairs, w, strict=True):
            part, share = self.linear(pair)
            part = replace(part, load=share * part.load, given=share * part.given)
            seen.append(reduced.seen(part, k, float(abs(one)), 1))
        return seen

    def evaluate(self, x: Array, lam: float) -> tuple[Array, Array, Array]:
        """R, dR/dx and dR/dlam; of a free second frequency with the phase condition as the last row."""
        try:
            return self._evaluate(x, lam)
        except np.linalg.LinAlgError:  # a resonance without damping
            n = len(x)
            return np.full(n, np.nan), np.full((n, n), np.nan), np.full(n, np.nan)

    def _evaluate(self, x: Array, lam: float) -> tuple[Array, Array, Array]:
        p, n = self.problem, self.size
        first, second = self.frequencies(x, lam)
        if not second > 0:
            raise np.linalg.LinAlgError
        v = self.displacement(x)
        force, slope, by_tone = self.forces(v, first, second, slopes=True)
        views = Stacked(self.views(first, second), self.torus.frequencies(first, second))
        excess = force - v @ p.stiffness[0].T
        R = x[:n] + (views.applied(excess) / p.scale).ravel()
        for i in range(p.count):
            slope[:, :, :, i] -= np.einsum("wx,j->wjx", np.eye(len(v)), p.stiffness[0][:, i])
        A = views.compliant(slope.reshape(len(v), p.count, n)).reshape(len(v), p.count, len(v), p.count)
        A = np.eye(n) + (A * p.scale / p.scale[:, None, None]).reshape(n, n)
        tones = [
            ((views.rate(excess, self.torus.pairs[:, i]) + views.compliant(by_tone[i][..., None])[..., 0]) / p.scale)
            for i in (0, 1)
        ]
        if not self.free:
            return R, A, tones[0].ravel()
        assert self.reference is not None
        phase = (differentiated(self.torus.pairs[:, 1]) @ self.reference / p.scale).ravel()
        off = (v - self.reference) / p.scale
        size = np.linalg.norm(phase) or 1.0
        big = np.block([[A, tones[1].reshape(-1, 1)], [phase[None] / size, np.zeros((1, 1))]])
        return np.append(R, phase @ off.ravel() / size), big, np.append(tones[0].ravel(), 0.0)

    def forces(self, v: Array, first: float, second: float, slopes: bool) -> tuple[Array, Array, Array]:
        """(W, c) contact forces less the preload at (W, c) displacements, their derivative (W, c, W, c) and (2, W, c)
        those over the two frequencies."""
        W, c = v.shape
        force, over, tones = np.zeros((W, c)), np.zeros((W, c, W, c) if slopes else 0), np.zeros((2, W, c))
        for one in self.contacts:
            F, S, rates = self._of(one, one.group.relative(v), first, second, slopes)
            at = one.group.first
            F[:, :, 0] -= one.group.preload
            force[:, at] += F.transpose(2, 0, 1)
            tones[:, :, at] += rates.transpose(0, 3, 1, 2)
            for row, s in zip(at, S, strict=True) if slopes else ():
                over[:, row[0] : row[-1] + 1, :, row[0] : row[-1] + 1] += s.transpose(1, 0, 3, 2)
        return force, over, tones

    def _of(
        self, one: TwoToneContacts, u: Array, first: float, second: float, slopes: bool
    ) -> tuple[Array, Array, Array]:  # fmt: skip
        """(c, k, W) forces of equal contacts, (c, k, W, k, W) slopes and (2, c, k, W) those over the frequencies."""
        t, none = self.torus, np.zeros((2, *u.shape))
        if one.marched:
            period = self.period(first, second)
            F, S = one.model.forces(u, period) if slopes else (one.model.force(u, period), np.zeros(0))
            return F.copy(), S, none
        rates = [t.values @ differentiated(t.pairs[:, i]) for i in (0, 1)]
        ahead = first * rates[0] + second * rates[1]
        F, S, D = map(np.asarray, _pointwise(one.law, one.kinematics, u, one.ground, t.values, ahead))
        force = np.einsum("ws,scj->cjw", t.transform, F)
        if not slopes:
            return force, np.zeros(0), none
        moved = [np.einsum("scab,sx,cbx->sca", D, rate, u, optimize=True) for rate in rates]
        by_tone = np.array([np.einsum("ws,scj->cjw", t.transform, m) for m in moved])
        return force, self._transformed(S, D, ahead), by_tone

    def _transformed(self, S: Array, D: Array, ahead: Array) -> Array:
        """(c, k, W, k, W) from slopes over displacement and velocity at the samples, (S, c, k, k)."""
        t, (_, c, k, _) = self.torus, S.shape
        out = np.zeros((c, k, t.coefficients, k, t.coefficients))
        for i, a, b in np.ndindex(c, k, k):
            if S[:, i, a, b].any():
                out[i, a, :, b] = (t.transform * S[:, i, a, b]) @ t.values
            if D[:, i, a, b].any():
                out[i, a, :, b] += (t.transform * D[:, i, a, b]) @ ahead
        return out

    def lost(self, x: Array, first: float) -> float:
        """W that the contacts take, as they count it themselves: friction times the path slid, dampers."""
        own = self.frequencies(x, first)
        v, total = self.displacement(x), 0.0
        for one in self.contacts:
            u = one.group.relative(v)
            if one.marched:
                period = self.period(*own)
                total += sum(float(c.lost.sum()) for c in one.model.point_cycles(u, period)) / period
            else:
                ahead = self.torus.values @ differentiated(self.torus.frequencies(*own))
                F = np.asarray(_pointwise(one.law, one.kinematics, u, one.ground, self.torus.values, ahead)[0])
                total += float((F * np.einsum("sw,cjw->scj", ahead, u)).sum() / len(F))
        return total

    def period(self, first: float, second: float) -> float:
        """s of the closed line, by the faster tone."""
        q, p = self.torus.turns
        return 2 * np.pi * (q / first if q >= p else p / second)


class Stacked:
    """What is seen in the mean and all pairs, at frequencies (P,) that may be negative."""

    def __init__(self, views: Sequence[reduced.Seen], w: Array) -> None:
        self.sign = np.append(1.0, np.where(w < 0, -1.0, 1.0))
        self.D, self.D_rate = (np.array([getattr(v, k) for v in views]) for k in ("compliance", "compliance_rate"))
        self.d, self.d_rate = (np.array([getattr(v, k) for v in views]) for k in ("reference", "reference_rate"))

    def applied(self, excess: Array) -> Array:
        """(W, c) D p - d_ref."""
        return self.compliant(excess[..., None], self.d)[..., 0]

    def compliant(self, V: Array, less: ComplexArray | None = None) -> Array:
        """(W, c, m) D applied to (W, c, m)."""
        return self._real(self.D @ self.complex(V) - (0 if less is None else less[..., None]))

    def rate(self, excess: Array, k: Array) -> Array:
        """(W, c) derivative of `applied` over a frequency of which pairs hold (P,) k."""
        moved = self.D_rate @ self.complex(excess[..., None]) - self.d_rate[..., None]
        factor = np.append(0.0, k) * self.sign
        return self._real(moved * factor[:, None, None])[..., 0]

    def complex(self, V: Array) -> ComplexArray:
        """(P + 1, ...) amplitudes of (W, ...) coefficients."""
        amplitude = V[1::2] - 1j * (self.sign[1:] * V[2::2].T).T
        return np.concatenate([V[:1].astype(complex), amplitude])

    def _real(self, a: ComplexArray) -> Array:
        out = np.empty((2 * len(a) - 1, *a.shape[1:]))
        out[0], out[1::2] = a[0].real, a[1:].real
        out[2::2] = -self.sign[1:, None, None] * a[1:].imag
        return out


@program
def _pointwise(
    law: Law, G: jax.Array, u: jax.Array, ground: jax.Array, values: jax.Array, ahead: jax.Array
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """(S, c, k) forces at the samples, and (S, c, k, k) their slopes over displacement and velocity."""
    c = u.shape[0]
    d, v = (jnp.einsum("sw,caw->sca", e, u) for e in (values, ahead))

    def one(d: jax.Array, v: jax.Array) -> jax.Array:
        at, speed = (jnp.einsum("nia,ca->cni", G, x).reshape(-1, 3) for x in (d, v))
        force = law.rates(at, speed - ground, jnp.zeros((0, len(at))), 0.0, 0.0)[0]
        return jnp.einsum("nia,cni->ca", G, force.reshape(c, -1, 3))

    def both(d: jax.Array, v: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        ways = jnp.broadcast_to(jnp.eye(d.shape[1])[:, None], (d.shape[1], *d.shape))
        S = jax.vmap(lambda way: jax.jvp(lambda x: one(x, v), (d,), (way,))[1])(ways)
        D = jax.vmap(lambda way: jax.jvp(lambda x: one(d, x), (v,), (way,))[1])(ways)
        return one(d, v), jnp.moveaxis(S, 0, -1), jnp.moveaxis(D, 0, -1)

    return jax.vmap(both)(d, v)


def of(
    assembly: Assembly, first: float, second: float, order: int = 5, samples: int | None = None,
    turns: int | None = None, free: bool = False,
) -> TwoTone:  # fmt: skip
    """The balance of an assembly whose loads have two tones.

    Args:
        first, second: rad/s. order: H. samples: of a turn of the faster angle, 8 H and 32 at least if not given. turns:
            of the faster angle in the closed line, at least; as many if not given.
        free: see `TwoTone`.

    Raises:
        UserError: a ring; a load of a tone that is none; contacts that remember while the two have a common period.
    """
    if assembly.ring is not None:
        raise UserError("ring: two frequencies of one sector that stands for a ring are not solved; take a lone blade")
    samples, turns = samples or max(32, 8 * order), turns or max(32, 8 * order)
    grounds = [c.ground for c in assembly.contacts]
    plain = replace(
        assembly,
        loads=tuple(replace(x, tone=1) for x in assembly.loads),
        contacts=tuple(replace(c, ground=None) for c in assembly.contacts),
    )
    problem = balance.of(plain, 1, form="relative")
    torus = Torus(order, closed(first, second, turns), samples * round(1.5 * turns))  # one program for all lines
    groups = tuple(_contacts(g, grounds, torus) for g in problem.groups)
    parts = _parts(assembly, order)
    balanced = TwoTone(problem, parts, groups, torus, second, free=free, lam_scale=first, least=turns)
    return balanced.at(first, second)


def _contacts(g: Group, grounds: Sequence[Any], torus: Torus) -> TwoToneContacts:
    assert isinstance(g.model, AFT)
    patch, n = g.model.patch, len(g.contacts)
    ground = np.zeros((n, len(patch.points), 3))
    for i, number in enumerate(g.contacts):
        if (moves := grounds[number]) is not None:
            if moves.waves:
                raise UserError("ground: wavy ground has frequencies of its own; leave waviness out")
            ground[i, :, 1:] = moves.velocity * np.array([np.cos(moves.angle), np.sin(moves.angle)])
    made = replace(g.model, samples=torus.count, cycles=CYCLES, periodicity=PERIODICITY, torus=torus)
    contacts = TwoToneContacts(g, made, ground.reshape(-1, 3))
    if contacts.remember and ground.any():
        raise UserError("ground: moves under a contact that remembers; take friction by the velocity alone")
    return contacts


def _parts(assembly: Assembly, order: int) -> dict[tuple[int, int], Linear]:
    """Pair -> what is linear; (1, 1) stands for all pairs that nothing drives."""

    def linear(tone: int, harmonic: int) -> Linear:
        loads = tuple(replace(x, tone=1) for x in assembly.loads if x.tone == tone or not x.harmonic)
        return replace(assembly, loads=loads).joined(harmonic)

    parts = {(0, 0): linear(1, 0), (1, 1): replace(assembly, loads=()).joined(1)}
    for tone, harmonic in sorted({(x.tone, x.harmonic) for x in assembly.loads if x.harmonic}):
        if harmonic > order:
            raise UserError(f"harmonics: {order} are balanced and a load has harmonic {harmonic}; raise harmonics")
        parts[(harmonic, 0) if tone == 1 else (0, harmonic)] = linear(tone, harmonic)
    return parts
