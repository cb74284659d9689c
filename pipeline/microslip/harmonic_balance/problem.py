"""The balance of an assembly: R(x, Omega) = 0 for the harmonics of its contact coordinates, with exact derivatives.

Two forms of the same equations. `relative`: unknown are the relative motions of all contacts, every body eliminated
together with its neighbours; few unknowns, all coupled. `sides`: unknown are the motions of both sides of every
contact, each body eliminated on its own; a body then knows only the bodies it touches, and the cost of a ring grows
with the number of its blades, not with its cube.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import product
from typing import Any

import numpy as np
import scipy.linalg

from .. import series
from ..data import Array, ComplexArray, Indices
from ..errors import UserError
from ..process import prepare
from ..settings.mistakes import bounded
from ..system.assembly import Assembly, Linear, stuck_modes
from ..units import hertz
from . import blocks, by_hand, reduced
from .blocks import Matrix
from .forces import AFT, Cycle, Forces, Traced
from .joints import Apart, Joints, Parts, Sides, apart
from .reduced import Coefficients, Driven, Eliminated, Poles, ReadOuts, Seen, View

SOFTER = 0.7
"""Share of the reference stiffness that serves where the assembly with all of it is at resonance without damping."""

AWAY = "slides away"
"""What is said of a body that nothing holds."""

NO_NUMBER = "is not a finite number"
"""What is said of a law without a value."""

RELATIVE_AT_MOST = 8
"""Members up to which all are eliminated together, and contacts of theirs up to which steps solve for all motions."""


Tried = list[tuple[Array, Array, Any]]
"""Of every group of contacts the displacements (n, k, W) that were tried, the forces, and what is known of them."""


def grouped(keys: Iterable[Any]) -> list[list[int]]:
    """Numbers of equal keys, in the order of the first of each."""
    found: dict[Any, list[int]] = {}
    for i, key in enumerate(keys):
        found.setdefault(key, []).append(i)
    return list(found.values())


@dataclass(frozen=True, eq=False)
class Group:
    """Equal contacts, evaluated together.

    Attributes:
        model: of their forces. first: (n, k) coordinates of their first sides, or relative ones; second: of the second
            sides, or None. offset, preload: (n, k). phase: (n,), see `system.assembly.Contact`. contacts: (n,) numbers
            in the assembly.
    """

    model: Forces
    first: Indices
    second: Indices | None
    offset: Array
    preload: Array
    phase: Array
    contacts: tuple[int, ...]

    @cached_property
    def _turned(self) -> bool:
        return bool(self.phase.any())

    @cached_property
    def _shifted(self) -> bool:
        return bool(self.offset.any())

    @cached_property
    def _known_turns(self) -> dict[int, Array]:
        return {}

    def relative(self, v: Array) -> Array:
        """(n, k, W) displacements, preloaded state included, from (W, c) those of the coordinates."""
        d = v[:, self.first] if self.second is None else v[:, self.first] - v[:, self.second]
        out = np.ascontiguousarray(d.transpose(1, 2, 0))
        if self._shifted:
            out[:, :, 0] += self.offset
        return out

    def force(self, u: Array, period: float) -> Array:
        """See `forces.Forces`."""
        return self._ahead(self.model.force(self._back(u), period))

    def near(self, u: Array, period: float, known: Any) -> tuple[Array, Any]:
        """See `forces.Forces`."""
        F, known = self.model.near(self._back(u), period, known)
        return self._ahead(F), known

    def forces(self, u: Array, period: float) -> tuple[Array, Array]:
        """See `forces.Forces`."""
        F, S = self.model.forces(self._back(u), period)
        return self._ahead(F), self._slope_ahead(S)

    def slope(self, u: Array, period: float) -> Array:
        """(n, k, W, k, W) derivative of the force for steps that are corrected, of few points where there are many."""
        model = self.model.few if isinstance(self.model, AFT) else self.model
        return self._slope_ahead(model.forces(self._back(u), period)[1])

    def _slope_ahead(self, S: Array) -> Array:
        if not self._turned:
            return S
        (n, k, W, *_), turn = S.shape, self._turns(S.shape[2])
        half = turn.transpose(0, 2, 1)[:, None] @ S.reshape(n, k, W, k * W)
        return (half.reshape(n, k * W * k, W) @ turn).reshape(S.shape)

    def rate(self, u: Array, period: float) -> Array | None:
        """See `forces.Forces`."""
        rate = self.model.rate(self._back(u), period)
        return None if rate is None else self._ahead(rate)

    def point_cycles(self, u: Array, period: float) -> list[Cycle]:
        """See `forces.Forces`."""
        return self.model.point_cycles(self._back(u), period)

    def traced(self, u: Array, period: float) -> list[Traced]:
        """See `forces.Forces`; where a wave leads by a phase, samples begin where it is at zero phase."""
        return self.model.traced(self._back(u), period)

    def _back(self, u: Array) -> Array:
        return np.matmul(u, self._turns(u.shape[2]).transpose(0, 2, 1)) if self._turned else u

    def _ahead(self, F: Array) -> Array:
        return np.matmul(F, self._turns(F.shape[2])) if self._turned else F

    def _turns(self, coefficients: int) -> Array:
        """(n, W, W) from harmonics of a signal to those of the same signal later by the phase."""
        if coefficients in self._known_turns:
            return self._known_turns[coefficients]
        out = self._known_turns[coefficients] = np.zeros((len(self.phase), coefficients, coefficients))
        out[:, 0, 0] = 1.0
        for h in range(1, coefficients // 2 + 1):
            cos, sin = np.cos(h * self.phase), np.sin(h * self.phase)
            a, b = 2 * h - 1, 2 * h
            out[:, a, a], out[:, a, b], out[:, b, a], out[:, b, b] = cos, -sin, sin, cos
        return out


@dataclass(frozen=True, eq=False)
class Problem:
    """An assembly and how finely it is balanced.

    The unknowns x are displacements from the preloaded state over `scale`, harmonic by harmonic: (c,) means, (c,)
    cosines, (c,) sines, (c,) cosines of 2 Omega t, ...

    Attributes:
        assembly. parts: harmonic -> what is eliminated together. at: where the coordinates of each part begin.
        stiffness: (c_i, c_i) of each part, taken into it. groups: of contacts. harmonics: H. length: m, about what the
            contacts move by; only the scaling. share: of the loads that are not steady.
        x_scale, lam_scale: what counts as a large x, and a large change of Omega (rad/s), where the solutions are
            followed by `continuation`.
    """

    assembly: Assembly
    parts: tuple[tuple[Linear, ...], ...]
    begins: tuple[int, ...]
    stiffness: tuple[Array, ...]
    groups: tuple[Group, ...]
    harmonics: int = 3
    length: float = 1e-6
    share: float = 1.0
    x_scale: float = 10.0
    lam_scale: float = 100.0

    @property
    def coefficients(self) -> int:
        """2 H + 1."""
        return 2 * self.harmonics + 1

    @cached_property
    def count(self) -> int:
        """c, number of contact coordinates."""
        return sum(part.count for part in self.parts[0])

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.count * self.coefficients

    @cached_property
    def smooth(self) -> bool:
        """Whether derivatives of the forces change without jumps."""
        return all(c.patch.law.smooth for c in self.assembly.contacts)

    @cached_property
    def scale(self) -> Array:
        """(c,) of a unit of x: every coordinate moves the points of its patch by as much as the others do."""
        out = np.ones(self.count)
        for g in self.groups:
            for row, i in enumerate(g.contacts):
                G = np.abs(self.assembly.contacts[i].patch.kinematics)
                unit = self.length / np.maximum(G.max(axis=(0, 1)), 1e-3)
                for side in (g.first, g.second):
                    if side is not None:
                        out[side[row]] = unit
        return out

    @cached_property
    def felt(self) -> list[Array]:
        """Of each group (n, k) whether a coordinate moves points of the patch."""
        patches = [[self.assembly.contacts[i].patch for i in g.contacts] for g in self.groups]
        return [np.array([np.abs(one.kinematics).max(axis=(0, 1)) > 0 for one in each]) for each in patches]

    @cached_property
    def eliminated(self) -> tuple[Eliminated, ...]:
        """Of each part, what does not depend on the frequency."""
        return tuple(Eliminated(one, k) for one, k in zip(zip(*self.parts, strict=True), self.stiffness, strict=True))

    def loaded(self, share: float) -> Problem:
        """The same with a share of the loads that are not steady."""
        return replace(self, share=share)

    @cached_property
    def slices(self) -> list[slice]:
        """Coordinates of each part."""
        return [slice(b, b + p.count) for b, p in zip(self.begins, self.parts[0], strict=True)]

    @cached_property
    def waves(self) -> list[list[int]]:
        """The mean, and the harmonics by the wave of the ring that the components move in."""
        alike = grouped(self.assembly.index(h + 1) for h in range(self.harmonics))
        return [[0], *([h + 1 for h in own] for own in alike)]

    @cached_property
    def alike(self) -> list[tuple[Indices, Indices]]:
        """Of n parts with as many coordinates their numbers, and (n, c) these."""
        begins, counts = np.array(self.begins), [part.count for part in self.parts[0]]
        each = grouped(counts)
        return [(np.array(parts), begins[parts, None] + np.arange(counts[parts[0]])) for parts in each]

    @cached_property
    def kind(self) -> list[tuple[int, int]]:
        """Of each part its place in `alike`, and its place there."""
        places = {int(i): (which, n) for which, (parts, _) in enumerate(self.alike) for n, i in enumerate(parts)}
        return [places[i] for i in range(len(places))]

    @cached_property
    def pressed(self) -> Array | None:
        """(c,) preload along the coordinates; None where there is none."""
        out = np.zeros(self.count)
        for g in self.groups:
            out[g.first] += g.preload
            if g.second is not None:
                out[g.second] -= g.preload
        return out if out.any() else None

    @cached_property
    def units(self) -> Array | None:
        """(c, c) of columns over those of rows in `scale`; None where all are the same."""
        return None if (self.scale == self.scale[:1]).all() else self.scale / self.scale[:, None]

    @cached_property
    def held(self) -> list[tuple[slice, Array]]:
        """Coordinates of each part that a stiffness is taken into, and that, transposed."""
        return [(s, k.T) for s, k in zip(self.slices, self.stiffness, strict=True) if k.any()]

    @cached_property
    def places(self) -> list[list[tuple[int, tuple[int, int], slice, slice, float]]]:
        """Of each group: (contact of it, parts, coordinates of the force's part, of the motion's, sign) of all places
        where the derivative of a force by a motion stands."""
        begins, out = np.array(self.begins), []
        for g in self.groups:
            sides: list[tuple[Any, float]] = [(g.first, 1.0)]
            sides += [] if g.second is None else [(g.second, -1.0)]
            found = []
            for n, ((row, plus), (column, minus)) in product(range(len(g.first)), product(sides, sides)):
                i, j = (int(np.searchsorted(begins, side[n, 0], "right")) - 1 for side in (row, column))
                at, to = (slice(s[n, 0] - begins[k], s[n, -1] + 1 - begins[k]) for s, k in ((row, i), (column, j)))
                found.append((n, (i, j), at, to, plus * minus))
            out.append(found)
        return out

    @cached_property
    def ranks(self) -> list[Indices]:
        """Of each group, places of its contacts among all that are there, in the order of the assembly."""
        numbers = sorted(i for g in self.groups for i in g.contacts)
        return [np.searchsorted(numbers, g.contacts) for g in self.groups]

    @cached_property
    def ways(self) -> Indices:
        """(a,) which coordinates of a contact move points of any patch."""
        most = max((f.shape[1] for f in self.felt), default=0)
        return np.flatnonzero([any(f[:, i : i + 1].any() for f in self.felt) for i in range(most)])

    @cached_property
    def sides(self) -> Sides:
        """Of all contacts, counted as in `ranks`, with the coordinates of `ways`."""
        begins, of = np.array(self.begins), list[tuple[int, float, Indices]]()
        for g, ranks in zip(self.groups, self.ranks, strict=True):
            for coordinates, sign in ((g.first, 1.0), (g.second, -1.0)):
                if coordinates is not None:
                    of += [(int(i), sign, own) for i, own in zip(ranks, coordinates, strict=True)]
        at = np.full((len(of), max((len(own) for *_, own in of), default=1)), self.count)
        for row, (*_, own) in zip(at, of, strict=True):
            row[: len(own)] = own
        part = np.searchsorted(begins, at[:, 0], "right") - 1
        return Sides(np.array([i for i, *_ in of]), part, np.array([s for _, s, _ in of]), at[:, self.ways], self.count)

    @cached_property
    def with_sides(self) -> list[Parts]:
        """Of each of `alike`."""
        k = [np.array([self.stiffness[i] for i in parts]) for parts, _ in self.alike]
        return [Parts.of(*own, self.sides, held) for own, held in zip(self.alike, k, strict=True)]

    @cached_property
    def without(self) -> list[Array]:
        """(W, c_i, W, c_i) of each part: what the stiffness taken into it takes off the derivative of the forces."""
        unit = np.eye(self.coefficients)
        return [-np.einsum("wx,ij->wixj", unit, k) for k in self.stiffness]

    def at(self, Omega: float) -> AtFrequency:
        """The problem at one frequency (rad/s)."""
        if self._poles is None:
            views = [one.at(Omega) for one in self.eliminated]
        else:
            views = [reduced.joined(poles, Omega) for poles in self._poles]
        finite = [view for view in views if view is not None]
        if len(finite) == len(views):
            both = self.stacked(finite) if self._poles is None else tuple(finite)
            return AtFrequency(self, Omega, both)
        softer = self._softer
        return AtFrequency(softer, Omega, softer.stacked([one.directly(Omega) for one in softer.eliminated]))

    def stacked(self, views: Sequence[View]) -> tuple[ComplexArray, ...]:
        """Of each of `alike`, (n, ...) `View` of its parts."""
        return tuple(np.array([views[i] for i in parts]) for parts, _ in self.alike)

    @cached_property
    def read(self) -> list[ReadOuts]:
        """Harmonic -> read-outs of the coordinates of all parts, one after the other."""
        return [ReadOuts.of(parts) for parts in self.parts]

    @cached_property
    def _poles(self) -> list[list[Poles]] | None:
        """Of each of `alike`, those of its parts together; None where a part has none, or other harmonics together."""
        out = []
        for parts, _ in self.alike:
            each = [found for i in parts if (found := self.eliminated[i].poles) is not None]
            kinds = {tuple((tuple(p.harmonics), p.values.shape) for p in own) for own in each}
            if len(each) < len(parts) or len(kinds) > 1:
                return None
            out.append([Poles.of(together) for together in zip(*each, strict=True)])
        return out

    @cached_property
    def driven(self) -> list[tuple[Indices, list[Driven]]]:
        """Parts by their numbers, and by harmonics whose matrices are the same, what moves the coordinates of them."""
        order = np.concatenate([parts for parts, _ in self.alike])
        moved = [self.eliminated[i].driven for i in order]
        kinds = grouped(tuple((tuple(d.harmonics), d.given.shape) for d in own) for own in moved)
        each = [(order[same], zip(*(moved[i] for i in same), strict=True)) for same in kinds]
        return [(parts, [Driven.of(together) for together in own]) for parts, own in each]

    @cached_property
    def _softer(self) -> Problem:
        """The same about other stiffnesses, for resonances that these make and no damping limits, and for bodies that
        nothing holds before the steady loads press them."""
        both = zip(self.parts[0], self.stiffness, strict=True)
        return replace(self, stiffness=tuple(_holding(part, SOFTER * k) for part, k in both))

    def evaluate(self, x: Array, Omega: float) -> tuple[Array, Array, Array]:
        """R, dR/dx and dR/dOmega (Omega in rad/s); (k,), (k, k), (k,)."""
        return self.at(Omega).evaluate(x)

    def displacement(self, x: Array) -> Array:
        """(W, c) harmonics of the contact coordinates from the preloaded state, m and rad."""
        return x.reshape(self.coefficients, -1) * self.scale

    def relative(self, x: Array) -> list[Array]:
        """Of every contact (k, W) its displacement as the law measures it, with the preloaded state."""
        v = self.displacement(x)
        return self.by_contact([g.relative(v) for g in self.groups])

    def by_contact(self, values: Sequence[Any]) -> list[Any]:
        """What belongs to every contact, from what belongs to every group."""
        pairs = zip(self.groups, values, strict=True)
        each = {i: one for g, many in pairs for i, one in zip(g.contacts, many, strict=True)}
        return [each[i] for i in range(len(each))]


@dataclass(frozen=True, eq=False)
class AtFrequency:
    """The residual at one frequency.

    R = v - v_ref + D p in each harmonic and part, in units of `Problem.scale`: p = E^T (F(E v + u_0) - F_0) - k v.

    Attributes: both: of each of `Problem.alike`, see `Problem.stacked`.
    """

    problem: Problem
    Omega: float
    both: tuple[ComplexArray, ...]

    @property
    def period(self) -> float:
        return 2 * np.pi / self.Omega

    @cached_property
    def seen(self) -> tuple[tuple[Seen, ...], ...]:
        """Harmonic -> part -> what its own coordinates do besides."""
        p = self.problem
        return tuple(
            tuple(reduced.seen(part, k, self.Omega, h) for part, k in zip(parts, p.stiffness, strict=True))
            for h, parts in enumerate(p.parts)
        )

    @cached_property
    def reference(self) -> Array:
        """(size,) the response with contacts that stay as stiff as the reference stiffness: a first guess."""
        p = self.problem
        return -(self._applied(np.zeros((p.coefficients, p.count)), slice(1)) / p.scale).ravel()

    @cached_property
    def lost(self) -> str:
        """Why no motion repeats, whatever the contacts do, the cause before a colon; nothing where one may."""
        p = self.problem
        bad = [np.flatnonzero(~np.isfinite(both[:, 0]).all(axis=(0, 2, 3))) for both in self.both]
        if not all(part.count for part in p.parts[0]):
            q = self.coordinates(np.zeros((p.coefficients, p.count)), p.share)
            bad.append(np.flatnonzero([not all(np.isfinite(one).all() for one in each) for each in q]))
        harmonics = np.concatenate(bad)
        if not harmonics.size:
            return ""
        h, f = int(harmonics.min()), self.Omega / (2 * np.pi)
        if h == 0:
            return (
                f"no balance: a body {AWAY}: nothing balances the steady forces on it; give it weak_springs or a spring"
            )
        of = f", harmonic {h} of {hertz(f)}" if h > 1 else ""
        return f"resonance: nothing limits a motion at {hertz(h * f)}{of}; give its mode some damping"

    @cached_property
    def rounding(self) -> tuple[float, float]:
        """As they may be seen in R, the rounding of forces as large as the preloads, and that of the contacts'
        stiffness times a motion and times a gap as long, over the largest of x."""
        p = self.problem
        pressed, stiff = np.zeros((2, p.count))
        for g in p.groups:
            k = np.array([np.abs(np.diag(p.assembly.contacts[i].stiffness)) for i in g.contacts])
            for side in (g.first, g.second):
                if side is not None:
                    np.add.at(pressed, side, np.abs(g.preload).max(axis=1, keepdims=True))
                    np.add.at(stiff, side, 2 * k)
        return self._seen(pressed * (p.length / p.scale)), self._seen(stiff * p.scale)

    def _seen(self, force: Array) -> float:
        """The rounding of forces (c,), in R."""
        p = self.problem
        seen = [
            (np.abs(both[:, 0, :, :, 1:]) @ force[at][:, None, :, None])[..., 0] / p.scale[at][:, None]
            for (_, at), both in zip(p.alike, self.both, strict=True)
        ]
        return float(np.finfo(float).eps * max((one.max(initial=0.0) for one in seen), default=0.0))

    def residual(self, x: Array) -> Array:
        """(size,) R alone."""
        return self.tried(x)[0]

    def tried(self, x: Array, near: Tried | None = None) -> tuple[Array, Tried]:
        """`residual`, and what it is of. near: of a motion near by."""
        moved = self._moved(x)
        before = [k for *_, k in near] if near else [None] * len(moved)
        pairs = zip(moved, before, strict=True)
        tried = [(u, *g.near(u, self.period, k)) for (g, u), k in pairs]
        return self.residual_of(x, self.along([F for _, F, _ in tried])), tried

    def slopes(self, x: Array, whole: bool) -> list[Array]:
        """Of every group of contacts `Group.slope`, or the whole derivative."""
        moved = self._moved(x)
        return [g.forces(u, self.period)[1] if whole else g.slope(u, self.period) for g, u in moved]

    def secant(self, slopes: list[Array], before: Tried, after: Tried) -> list[Array]:
        """Derivatives of the contact forces that tell the change of each contact's force from one motion to another.

        Broyden's update: of all derivatives that do, the nearest, coordinates counted in units of x, those left out
        that move no point of the patch. Contacts know of no frequency, so what a contact shows here serves at the next
        one too.
        """
        out, p = [], self.problem
        for g, felt, S, (u_0, F_0, _), (u_1, F_1, _) in zip(p.groups, p.felt, slopes, before, after, strict=True):
            way = felt[..., None] * (u_1 - u_0) / (unit := p.scale[g.first][..., None])
            size = np.sum(way**2, axis=(1, 2), keepdims=True)
            along = np.divide(way, size * unit, out=np.zeros_like(way), where=size > 0)
            missed = F_1 - F_0 - np.einsum("nkwlz,nlz->nkw", S, u_1 - u_0)
            out.append(S + missed[..., None, None] * along[:, None, None])
        return out

    def evaluate(self, x: Array) -> tuple[Array, Array, Array]:
        """See `Problem.evaluate`."""
        force, slopes = self.forces(x)
        R, rate = self._residual(x, force)
        return R, self.jacobian(slopes).dense(), rate

    def force(self, x: Array) -> Array:
        """(W, c) contact forces less the preload along the coordinates, N and N m."""
        return self.along([g.force(u, self.period) for g, u in self._moved(x)])

    def forces(self, x: Array) -> tuple[Array, list[Array]]:
        """`force`, and of every group of contacts its derivative (n, k, W, k, W)."""
        both = [g.forces(u, self.period) for g, u in self._moved(x)]
        return self.along([F for F, _ in both]), [S for _, S in both]

    def _moved(self, x: Array) -> list[tuple[Group, Array]]:
        """Every group of contacts with `Group.relative`."""
        v = self.problem.displacement(x)
        return [(g, g.relative(v)) for g in self.problem.groups]

    def undefined(self, x: Array) -> str:
        """Whose law has no finite force, or derivative of it, at x; nothing if all have, or x is not finite itself."""
        for g, u in self._moved(x) if np.isfinite(x).all() else ():
            F, S = g.forces(u, self.period)
            for what, value in (("force", F), ("derivative of its force", S)):
                bad = np.flatnonzero(~np.isfinite(value).all(axis=tuple(range(1, value.ndim))))
                if bad.size:
                    c = self.problem.assembly.contacts[g.contacts[bad[0]]]
                    return (
                        f"contact '{c.name}': the {what} by its law, {type(c.patch.law).__name__}, {NO_NUMBER} where "
                        f"it moves by {np.abs(u[bad[0], :3]).max():.3g} m"
                    )
        return ""

    def jacobian(self, slopes: list[Array]) -> Matrix:
        """(size, size) dR/dx for derivatives of the contact forces, those of `forces` or ones found near by."""
        p = self.problem
        if len(p.slices) == 1 and len(p.sides.contact) <= RELATIVE_AT_MOST:
            return self._of_sides(slopes)
        n, a, W = sum(map(len, p.ranks)), len(p.ways), p.coefficients
        S = np.zeros((n, W, a, W, a))
        for i, own in zip(p.ranks, slopes, strict=True):
            has = p.ways[p.ways < own.shape[1]]
            S[i, :, : len(has), :, : len(has)] = own[:, has][:, :, :, has].transpose(0, 2, 1, 4, 3)
        return Joints(self._apart, S.reshape(n, W * a, W * a), p.scale, partial(self._of_sides, slopes))

    @cached_property
    def _apart(self) -> Apart | None:
        p = self.problem
        return apart(p.sides, list(zip(p.with_sides, (both[:, 0, :, :, 1:] for both in self.both), strict=True)))

    def _of_sides(self, slopes: list[Array]) -> Matrix:
        p = self.problem
        pieces: dict[tuple[int, int], Array] = {}
        for i, without in enumerate(p.without):
            pieces[i, i] = without.copy()
        for places, S in zip(p.places, slopes, strict=True):
            for n, (i, j), at, to, sign in places:
                if (i, j) not in pieces:
                    size = [p.parts[0][part].count for part in (i, j)]
                    pieces[i, j] = np.zeros((p.coefficients, size[0], p.coefficients, size[1]))
                pieces[i, j][:, at, :, to] += (S[n] if sign > 0 else -S[n]).transpose(1, 0, 3, 2)
        where, moved = p.slices, {}
        for (i, j), P in pieces.items():
            (which, n), (W, a, _, b) = p.kind[i], P.shape
            block = self._real[which].part(n).applied(P.reshape(1, W, a, W * b), slice(1)).reshape(P.shape)
            if p.units is not None:
                block *= p.units[where[i], where[j]][:, None]
            moved[i, j] = block.reshape(W * a, W * b)
        return blocks.one_plus(moved, [s.stop - s.start for s in where], p.coefficients)

    def rate(self, x: Array, force: Array) -> Array:
        """(size,) dR/dOmega."""
        return self._residual(x, force)[1]

    def force_rates(self, x: Array) -> Array | None:
        """(W, c) derivatives of the contact forces over Omega at the same displacements; None where
        they are zero, as of most laws."""
        moved = self._moved(x)
        rates = [g.rate(u, self.period) for g, u in moved]
        if all(r is None for r in rates):
            return None
        slower = -self.period / self.Omega
        pairs = zip(moved, rates, strict=True)
        given = [np.zeros_like(u) if r is None else r * slower for (_, u), r in pairs]
        return self.along(given, preload=False)

    def load_rate(self) -> Array:
        """(size,) dR/dshare, of the loads that are not steady."""
        p = self.problem
        if p.share:
            return -(self.reference - replace(self, problem=replace(p, share=0.0)).reference) / p.share
        return -(replace(self, problem=replace(p, share=1.0)).reference - self.reference)

    def modal(self, x: Array, force: Array) -> list[list[ComplexArray]]:
        """Harmonic -> part -> (m,) amplitudes of the bodies' coordinates."""
        return self.coordinates(self._excess(self.problem.displacement(x), force), self.problem.share)

    def coordinates(self, excess: Array, share: float) -> list[list[ComplexArray]]:
        """The same, under a share of the loads that are not steady and (W, c) contact forces beyond those of the
        stiffness taken into the parts."""
        p, g = self.problem, series.amplitudes(excess)
        found: dict[tuple[int, int], ComplexArray] = {}
        for parts, each in p.driven:
            own = np.array([g[:, p.slices[i]] for i in parts])
            for one in each:
                q = one.coordinates(self.Omega, share, own)
                found |= {(h, i): q[n, j] for j, h in enumerate(one.harmonics) for n, i in enumerate(parts)}
        return [[found[h, i] for i in range(len(p.slices))] for h in range(len(g))]

    def _excess(self, v: Array, force: Array) -> Array:
        """(W, c) p: forces less the preload, less what the reference stiffness makes of the displacement."""
        out = force.copy()
        for s, k in self.problem.held:
            out[:, s] -= v[:, s] @ k
        return out

    def residual_of(self, x: Array, force: Array) -> Array:
        """(size,) R for forces that are known."""
        p = self.problem
        away = self._applied(self._excess(p.displacement(x), force), slice(1))
        return x + (away / p.scale).ravel()

    def _residual(self, x: Array, force: Array) -> tuple[Array, Array]:
        """R and dR/dOmega."""
        p = self.problem
        away = self._applied(self._excess(p.displacement(x), force), slice(2))
        rates = self.force_rates(x)
        if rates is not None:
            away[1] += self._applied(rates, slice(1), 0.0)[0]
        R, rate = (away / p.scale).reshape(2, -1)
        return x + R, rate

    def along(self, forces: list[Array], preload: bool = True) -> Array:
        """(W, c) forces of the groups (n, k, W) along the coordinates."""
        p = self.problem
        out = np.zeros((p.coefficients, p.count))
        for g, F in zip(p.groups, forces, strict=True):
            out[:, g.first] = F.transpose(2, 0, 1)
            if g.second is not None:
                out[:, g.second] = -F.transpose(2, 0, 1)
        if preload and p.pressed is not None:
            out[0] -= p.pressed
        return out

    def _applied(self, force: Array, which: slice, driven: float = 1.0) -> Array:
        """(n, W, c) D, its derivative or both, applied to (W, c), less the reference times a factor."""
        share = driven * self.problem.share
        if len(self.problem.slices) == 1:
            return self._real[0].beyond(force[None], which, driven, share)[0]
        out = np.empty((which.stop, *force.shape))
        for (_, at), D in zip(self.problem.alike, self._real, strict=True):
            out[:, :, at] = D.beyond(force[:, at].transpose(1, 0, 2), which, driven, share).transpose(1, 2, 0, 3)
        return out

    @cached_property
    def _real(self) -> list[Coefficients]:
        """Of each of `Problem.alike`."""
        return [Coefficients.of(both) for both in self.both]


def of(
    assembly: Assembly, harmonics: int = 3, samples: int = 64, cycles: int = 100, periodicity: float = 1e-10,
    length: float | None = None, form: str | None = None, models: dict[int, Forces] | None = None,
) -> Problem:  # fmt: skip
    """The balance of an assembly.

    Args:
        harmonics: H. samples: of a cycle. cycles: marched at most. periodicity: see `forces.AFT`. length: m, see
            `Problem`; from the contacts' limits of sliding if not given. form: ``relative`` or ``sides``; chosen by
            the number of components if not given; always relative where damping or flow couple them. models: first
            contact of a group of equal ones -> its force model, if it is not the marched law.

    Raises:
        UserError: no harmonic or cycle, a length or a share that is none, a name that no component has.
    """
    prepare()
    assembly.check_names()
    if moves := [c.name for c in assembly.contacts if c.ground is not None]:
        raise UserError(f"contacts.{moves[0]}.ground: moves, which harmonic balance cannot take; use microslip orbit")
    for name, value, bounds in (
        ("harmonics", harmonics, {"ge": 1}),
        ("cycles", cycles, {"ge": 1}),
        ("periodicity", periodicity, {"ge": 0}),
        ("length", length, {"gt": 0}),
    ):
        if value is not None:
            bounded(name, value, **bounds)
    together = len(assembly.components) <= RELATIVE_AT_MOST if form is None else form == "relative"
    together = together or assembly.stuck_damping is not None or bool(assembly.flow)
    contacts = assembly.contacts
    begins, where = _numbered(assembly, together)
    kind: Callable[[Any], Any] = id if models else by_hand.alike
    groups = []
    for same in grouped((kind(c.patch), c.second is None) for c in contacts):
        patches = [contacts[i].patch for i in same]
        model = (models or {}).get(same[0]) or by_hand.model(patches, samples, cycles, periodicity)
        first = np.array([where[i, 0] for i in same])
        second = None if together or contacts[same[0]].second is None else np.array([where[i, 1] for i in same])
        offset, preload = (np.array([getattr(contacts[i], key) for i in same]) for key in ("offset", "preload"))
        phase = np.array([contacts[i].phase for i in same])
        groups.append(Group(model, first, second, offset, preload, phase, tuple(same)))
    parts = _eliminated(assembly, harmonics, together)
    k = [c.stiffness for c in contacts]
    sides = [range(len(k))] if together else [[i for i, _, _ in assembly.sides(m.name)] for m in assembly.components]
    each = [scipy.linalg.block_diag(*[k[i] for i in own]) if own else np.zeros((0, 0)) for own in sides]
    stiffness = tuple(_no_stiffer(part, one) for part, one in zip(parts[1], each, strict=True))
    return Problem(assembly, parts, begins, stiffness, tuple(groups), harmonics, length or moves_by(assembly))


STIFFER = 1e6
"""How many times stiffer than the bodies along a coordinate what is taken into them may be: where a contact is open, R
is what two displacements that are equal to so many digits leave."""


def _no_stiffer(part: Linear, stiffness: Array) -> Array:
    """A stiffness (c, c) of the contacts, reduced along coordinates where it is more than `STIFFER` times the body's:
    of modes phi that swing with omega, 1 / sum (T phi)^2 / omega^2."""
    if not stiffness.any() or not len(part.M):
        return stiffness
    values, shapes = stuck_modes(part, np.zeros_like(stiffness))
    squares = np.abs(values)
    elastic = squares[squares > RIGID * squares.max(initial=0.0)]
    if not elastic.size:
        return stiffness
    yields = (np.abs(part.rows @ shapes) ** 2 / np.maximum(squares, elastic.min())).sum(axis=1)
    excess = np.diag(stiffness) * (yields + np.diag(part.residual)) / STIFFER
    if not (excess > 1).any():
        return stiffness
    less = 1 / np.sqrt(np.maximum(excess, 1.0))
    return stiffness * less * less[:, None]


def _holding(part: Linear, stiffness: Array) -> Array:
    """A stiffness (c, c), and more where contacts feel a motion that neither it nor the body holds: as much as makes
    that motion as stiff as the softest other one."""
    if not part.count or not len(part.M):
        return stiffness
    squares, shapes = stuck_modes(part, stiffness)
    free = squares <= RIGID * np.abs(squares).max()
    felt = (np.abs(part.rows @ shapes[:, free]) ** 2).sum(axis=1)
    far = felt > RIGID * (np.abs(part.rows @ shapes) ** 2).sum(axis=1)
    softest = squares[~free].min(initial=np.inf)
    return stiffness + np.diag(
        np.divide(softest if softest < np.inf else 1.0, felt, out=np.zeros_like(felt), where=far)
    )


RIGID = 1e-9
"""omega^2 over the largest one, up to which a motion is one of rounding: of a body that nothing holds."""


def _eliminated(assembly: Assembly, harmonics: int, together: bool) -> tuple[tuple[Linear, ...], ...]:
    """`eliminated` in the harmonics 0 to H; those of one wave that nothing drives are the same."""
    driven, made = {0, *(x.harmonic for x in assembly.loads)}, dict[Any, tuple[Linear, ...]]()
    kinds = [(True, h) if h in driven else (False, assembly.index(h)) for h in range(harmonics + 1)]
    for h, kind in enumerate(kinds):
        if kind not in made:
            made[kind] = eliminated(assembly, h, together)
    return tuple(made[kind] for kind in kinds)


def eliminated(assembly: Assembly, harmonic: int, together: bool) -> tuple[Linear, ...]:
    """What is eliminated in one harmonic: all bodies together, or each by itself."""
    if together:
        return (assembly.joined(harmonic),)
    return tuple(assembly.part(m, harmonic) for m in assembly.components)


def _numbered(assembly: Assembly, together: bool) -> tuple[tuple[int, ...], dict[tuple[int, int], Array]]:
    """Where the coordinates of each part begin, and (contact, side) -> its coordinates."""
    if together:
        starts = np.cumsum([0, *(c.patch.count for c in assembly.contacts)])
        return (0,), {(i, 0): np.arange(a, b) for i, (a, b) in enumerate(zip(starts[:-1], starts[1:], strict=True))}
    where = {(i, j): np.arange(start, start + k) for i, j, start, k in assembly.coordinates}
    counts = [sum(assembly.contacts[i].patch.count for i, *_ in assembly.sides(m.name)) for m in assembly.components]
    return tuple(int(b) for b in np.cumsum([0, *counts[:-1]])), where


def moves_by(assembly: Assembly) -> float:
    """About how far the contacts move before they slide or close, m: the unit of the unknowns. Where none is pressed or
    gapes, how far the loads move the stiffest."""
    pairs = [(abs(float(c.preload[0])) * 0.3, float(np.diag(c.stiffness)[:2][-1])) for c in assembly.contacts]
    gaps = [-float(c.offset[0]) for c in assembly.contacts]
    lengths = [c.length for c in assembly.contacts if c.length]
    reach = max([*(limit / k for limit, k in pairs if k), *gaps, *lengths], default=0.0)
    if reach <= 0:
        stiffest = max((float(np.diag(c.stiffness)[:3].max()) for c in assembly.contacts), default=0.0)
        reach = max((abs(x.amplitude) for x in assembly.loads), default=0.0) / stiffest if stiffest else 0.0
    return max(reach, 1e-9)
