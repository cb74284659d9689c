"""The motion of an assembly, step by step: exact flow, contact forces that kick; leaps where nothing touches.

A step of tau: the contacts' force F kicks the velocities by F - F_0, the bodies flow as if nothing touched (`flow`),
the contacts say their force at the place they came to, and that kicks too. Of second order (`kicks`) with any law, of
fourth (`fourth`) with those that say how their force changes in time. What the bodies have of energy is what loads
gave, less what dampers and kicks took, to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg

from ..data import Array
from ..errors import UserError
from ..harmonic_balance.forces import repeated
from ..programs import program
from . import fourth, loop
from .bodies import Bodies, Hardest, MotionState, Options, Snapshot, Spots, spots
from .contacts import Braking, ContactGroup, Held, Yielding, force_at, gapes, slope_at, untouched
from .equations import MotionEquations
from .flow import BodyFlow, blocks, flow
from .ground import moving
from .inclusion import Meets, meets

EVENTS = 8192
"""Events that one call of the loop keeps; of more, only their number is known."""

FEWEST = 64
"""Samples that one call of the loop has room for; of more, a power of two: one program serves many numbers of them."""

DOUBLINGS = 16
"""Of the step, for leaps: their number is a multiple of it, so that one program serves steps of many lengths."""

KINDS = ("closes", "opens", "slips", "sticks")


@dataclass(frozen=True, eq=False)
class Stepper:
    """The loop of an assembly's equations, with steps of tau (s).

    Attributes:
        equations. tau. accounts: whether what contacts store and lose is followed, which every law can tell or not.
            order: of its steps, 2 or 4; of 4 only where every law says how its force changes in time.
    """

    equations: MotionEquations
    tau: float
    accounts: bool = True
    order: int = 4

    @cached_property
    def groups(self) -> tuple[ContactGroup, ...]:
        contacts, groups = self.equations.contacts, []
        for same in self.same:
            patch = contacts[same[0]].patch
            offset = np.array([contacts[i].offset for i in same])
            law = repeated(patch.law, len(patch.points), len(same))
            if (ground := contacts[same[0]].ground) is not None:
                law = moving(law, ground, np.tile(patch.points, (len(same), 1)))
            G = np.broadcast_to(patch.kinematics, (len(same), *patch.kinematics.shape))
            groups.append(ContactGroup(law, G, offset))
        return _sent(tuple(groups))

    @cached_property
    def same(self) -> list[list[int]]:
        """Numbers of the contacts, those of one patch object on the same ground together."""
        alike: dict[tuple, list[int]] = {}
        for i, c in enumerate(self.equations.contacts):
            alike.setdefault((id(c.patch), c.ground), []).append(i)
        return list(alike.values())

    @cached_property
    def rows(self) -> Array:
        """(c,) of the equations' contact coordinates, those of the loop."""
        begins = np.cumsum([0, *(c.patch.count for c in self.equations.contacts)])
        parts = [np.arange(begins[i], begins[i + 1]) for same in self.same for i in same]
        return np.concatenate([np.zeros(0, int), *parts])

    @cached_property
    def numbers(self) -> Array:
        """(contacts,) of the equations, those of the loop."""
        return np.array([i for same in self.same for i in same], dtype=int)

    @cached_property
    def options(self) -> Options:
        e = self.equations
        opens = bool(self.same) and all(gapes(e.contacts[same[0]].patch) for same in self.same)
        dissipative = np.linalg.eigvalsh(0.5 * (e.C + e.C.T)).min(initial=0.0) >= -1e-9 * np.abs(e.C).max(initial=0.0)
        bounded = bool(dissipative) and not (e.omega2 < 0).any()  # else (a free body that turns) energy bounds no swing
        leaps = opens and not e.F_0.any() and e.steady is not None and bounded
        flows = self.order == 4 and bool(self.groups) and not e.R.any() and e.ramp is None
        flows = flows and all(g.law.follows * e.fastest > fourth.SLOW for g in self.groups)
        halvings = fourth.HALVINGS if flows else 0
        return Options(leaps, self.accounts, (e.ramp, e.harmonics) if e.ramp else None, halvings)

    def halved(self) -> Stepper:
        """With half the step; what hangs on that alone is made anew."""
        fine = replace(self, tau=self.tau / 2)
        for name in ("groups", "same", "rows", "numbers", "options", "_fixed"):
            fine.__dict__[name] = getattr(self, name)
        fine.__dict__["_flow"] = BodyFlow(*(x[:-1] for x in self._flows))
        return fine

    @cached_property
    def bodies(self) -> Bodies:
        enough = np.array(fourth.MISSED * (self.tau * self.equations.fastest) ** 4)
        fixed, meets = self._fixed, self._meets(self._flow)
        sent = _sent(fixed._replace(flow=self._flow, meets=meets, braking=self._braking, enough=enough))
        return sent._replace(groups=self.groups)

    @cached_property
    def _flow(self) -> BodyFlow:
        return BodyFlow(*(x[1:] for x in self._flows))

    @cached_property
    def _flows(self) -> BodyFlow:
        """Those of half the step too, the shortest first."""
        e, shorter = self.equations, self.options.halvings + 1
        doublings = shorter
        if self.options.leaps:  # over a period at least
            period = int(np.ceil(np.log2(2 * np.pi / e.Omega / self.tau)))
            doublings = -(-(shorter + max(period, 0)) // DOUBLINGS) * DOUBLINGS
        return flow(e, self.tau / 2**shorter, doublings)

    @cached_property
    def _fixed(self) -> Bodies:
        """What does not hang on the step."""
        e, rows = self.equations, self.rows
        b, p = blocks(e)
        n = e.turning.shape[0]
        steady, still = np.zeros((b, 2 * p, n)), np.zeros((b * p, n)) if e.steady is None else e.steady
        steady[:, :p] = still.reshape(b, p, n)
        steady[:, p:] = (still @ e.turning).reshape(b, p, n)
        moved, given = self._points
        sways, w = (moved @ still + given) @ e.turning, np.sqrt(np.abs(e.omega2))
        reach = np.linalg.norm(moved, axis=(1, 2)), _most(sways)
        bends = sum(np.linalg.norm(x, axis=(1, 2)) for x in (moved * w, moved @ e.C)), _most(sways @ e.turning)
        D, D_o, F_0 = e.D[rows], e.D_o[rows], e.F_0[rows]
        R = e.R[np.ix_(rows, rows)]
        loads = (np.zeros((b * p, n)) if e.push is None else e.push).reshape(b, p, n)
        yielding = Yielding(R, e.yields[np.ix_(rows, rows)], F_0) if R.any() else None
        arrays = (F_0, D, D_o, e.turning, e.omega2.reshape(b, p), steady, reach, bends, loads, -D.T, np.zeros(()))
        harmonics = e.Omega * np.array(e.harmonics, dtype=float)
        return Bodies._make(((), None, yielding, None, None, *arrays, harmonics, self._moved, D.T @ F_0))

    @property
    def _moved(self) -> tuple[Spots, ...]:
        """Of steps of fourth order, group by group."""
        if not self.options.halvings:
            return ()
        rest = np.concatenate([np.einsum("cnik,ck->cni", g.G, g.offset).reshape(-1, 3) for g in self.groups])
        return tuple(spots(*parts) for parts in zip(*map(self._by_group, (*self._points, rest)), strict=True))

    def _by_group(self, of_points: Array) -> list[Array]:
        return np.split(of_points, np.cumsum([g.G.shape[0] * g.G.shape[1] for g in self.groups])[:-1])

    @property
    def _braking(self) -> Braking | None:
        if not any(g.law.brakes for g in self.groups):
            return None
        D, moved = self.equations.D[self.rows], self._points[0][:, 1:].reshape(-1, len(self.equations.omega2))
        most = 0.5 * self.tau * np.abs(moved @ moved.T).sum(axis=1).reshape(-1, 2).max(axis=1, initial=0.0)
        return Braking(0.5 * self.tau * D @ D.T, tuple(self._by_group(most)))

    def _meets(self, flows: BodyFlow) -> Meets | None:
        """Of set-valued points, see `inclusion`.

        Raises:
            UserError: they stand beside other laws on bodies that yield, or some yield and some do not.
        """
        e, points = self.equations, [np.full(g.G.shape[0] * g.G.shape[1], g.rigid) for g in self.groups]
        rigid = np.concatenate([np.zeros(0, dtype=bool), *points])
        if not rigid.any():
            return None
        if not e.R.any():
            p = blocks(e)[1]
            speeds = scipy.linalg.block_diag(*flows.stack[0][:p, p : 2 * p].transpose(2, 0, 1))
            D = self._points[0][rigid].reshape(-1, len(e.omega2))
            return meets(D @ speeds @ D.T * self.tau, self.tau * e.Omega)
        names = ", ".join(c.name for c in e.contacts)
        if not rigid.all() or any(g.over.normal is not None for g in self.groups):
            raise UserError(
                f"contacts {names}: on bodies that yield beside their modes, set-valued laws stand alone and press of "
                'themselves; give all of them law = "set-valued" and no normal stiffness'
            )
        if any(float(np.max(g.over.restitution)) > 0 for g in self.groups):
            raise UserError(
                f"contacts {names}: restitution: is for bodies of modes alone; these yield beside them, and what "
                "comes back is theirs: leave it out"
            )
        rows = self._rows.reshape(-1, len(e.D))
        yields, moves = rows @ e.R[np.ix_(self.rows, self.rows)] @ rows.T, np.abs(rows).any(axis=1)
        if np.diag(yields)[moves].min() <= 1e-9 * np.diag(yields).max():
            raise UserError(
                f"contacts {names}: some of these bodies yield beside their modes and some do not; keep the residual "
                "compliance of all contacts, or of none"
            )
        return meets(yields)

    @cached_property
    def _rows(self) -> Array:
        """(points, 3, c): motion of all points by the contact coordinates, as the loop has them."""
        each = [np.asarray(G).reshape(-1, G.shape[-1]) for g in self.groups for G in g.G]
        rows = scipy.linalg.block_diag(np.zeros((0, 0)), *each)
        return np.asarray(rows.reshape(len(rows) // 3, 3, len(self.rows)))

    @property
    def _points(self) -> tuple[Array, Array]:
        """(points, 3, m) and (points, 3, n): motion of all points by modes and by what the loads move beside them."""
        return self._rows @ self.equations.D[self.rows], self._rows @ self.equations.D_o[self.rows]

    def start(self, q: Array, v: Array, held: Held | None = None) -> MotionState:
        """At time 0, at rest or moving, from modal coordinates (m,) and velocities; contacts come there on a straight
        way from what they held, from u = 0 if it is not given."""
        e = self.equations
        b, p = blocks(e)
        y = np.concatenate([np.reshape(q, (b, p)), np.reshape(v, (b, p))], axis=1)
        return loop.begun(self.options, self.bodies, y, e.oscillators(0.0), held)

    def run(
        self, now: MotionState, steps: Array, rows: int | None = None, events: int = EVENTS
    ) -> tuple[MotionState, Snapshot, Array, int]:
        """`advanced`, without its hardest row."""
        return self.advanced(now, steps, rows, events)[:4]

    def advanced(
        self, now: MotionState, steps: Array, rows: int | None = None, events: int = EVENTS
    ) -> tuple[MotionState, Snapshot, Array, int, Hardest]:
        """So many rows further, all samples if it is not said, the i-th after steps[i modulo s] of tau, (s,); compiled
        anew for another power of two above s alone. It ends early where numbers become infinite, in the last sample
        then.

        Returns:
            Where the motion is; the samples, the last s of more; (e, 3) events: time in s, contact, kind, an index of
            `KINDS`; how many there were, which may be more; the row in which steps missed most.
        """
        s = len(steps)
        done = int(np.rint(float(now.time) / self.tau))  # or the last digits would hang on how much is done in a call
        fine = 2**self.options.halvings
        each = np.zeros(max(FEWEST, 1 << (s - 1).bit_length()), int)
        each[:s] = fine * np.asarray(steps)
        now, listed, seen, i, hardest = loop.run(
            self.options, events, self.bodies, now, each, s, s if rows is None else rows, fine * done
        )
        count, back = int(listed.count), np.argsort(self.rows)
        events_listed = np.array(np.asarray(listed.rows)[: min(count, events)])
        events_listed[:, 1] = self.numbers[events_listed[:, 1].astype(int)] if len(events_listed) else 0
        last = np.arange(max(int(i) - s, 0), int(i)) % s
        seen = Snapshot._make(np.asarray(x)[last] for x in seen)
        return now, seen._replace(d=seen.d[:, back], force=seen.force[:, back]), events_listed, count, hardest


@program
def _sent(arrays: Any) -> Any:
    """Arrays of numpy as jax has them; all in one call, which takes a fifth of `jax.device_put`."""
    return loop.typed(arrays)


def _most(rates: Array) -> Array:
    """(points,) largest size of rows (points, 3, n) times o."""
    return np.linalg.norm(np.abs(rates).sum(axis=2), axis=1)


def static_force(stepper: Stepper) -> Callable[[Array], tuple[Array, Array]]:
    """Function of modal displacements (m,): modal forces (m,) of contacts that came there on a straight way, and (m, m)
    their slope."""
    groups, bodies = stepper.groups, stepper.bodies
    states, D = untouched(groups).states, stepper.equations.D[stepper.rows]
    if bodies.meets is not None:
        raise UserError('start: set-valued contacts have no stiffness to find a rest by; begin from "rest"')
    if bodies.yielding is not None:
        raise UserError('start: where modes leave compliance out of the contacts, begin from "rest"')

    @jax.jit
    def found(q: Any) -> tuple[Any, Any]:
        d = D @ q + jnp.asarray(stepper.equations.still[1][stepper.rows])
        still = jnp.zeros_like(d)
        force = force_at(groups, d, still, 1.0, states)[0]
        return D.T @ (force - bodies.F_0), D.T @ slope_at(groups, d, still, 1.0, states) @ D

    return lambda q: tuple(np.asarray(x) for x in found(q))  # type: ignore[return-value]
