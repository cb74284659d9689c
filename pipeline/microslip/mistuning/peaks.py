"""The highest of many read-outs over frequency: a sweep, then points where its curves may be higher yet.

Near a resonance g = 1/|y|^2 is a parabola over the frequency, exactly so for one mode, so one through the three highest
points of a read-out says where its peak is and how high. A point is added where the highest is said to be, as long as
that is higher than what is known. Where contacts open or begin to slide, amplitudes jump and bend, which no parabola
tells. So every interval between points says how high the curves may be in it (`may_be`), and the highest of them is
halved as long as that is more than is known. Where there are two solutions, as beside a jump, the higher one is
followed to where it ends.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ..data import Array, largest

Respond = Callable[[float], Array | None]
"""(w,) amplitudes of the read-outs at a frequency (Hz); None where there is no solution."""


class Wanted(NamedTuple):
    """What a search asks for at a frequency (Hz): amplitudes, with little work or else with all that there is; or, by
    what else a `Follow` is given, the solution that goes on."""

    frequency: float
    at_once: bool = False
    onward: tuple[float, float, bool] | None = None


Found = TypeVar("Found")

Asking = Generator[Wanted, Any, Found]
"""Is sent what a `Respond` or a `Follow` finds, and returns something."""

Follow = Callable[[float, float, float, bool], tuple[list[tuple[float, Array]], bool]]
"""Frequencies and amplitudes of the solution that goes on towards a frequency (Hz) from the one at another, the second,
and whether it ends on the way; the third is the width (Hz) of what is between two points of the sweep, the last one
whether that is worth many steps."""

Tells = Callable[[float, float], bool]
"""Whether the solution at a frequency (Hz) is where the one at another leads, as what is known beyond that tells."""

TOLERANCE = 1e-4
"""Share of the highest amplitude by which it may be missed."""

LEFT = 5e-4
"""Share of the highest amplitude by which intervals may tell more, where no parabola does."""

MOST = 25
"""Points added at most."""

FAILING = 3
"""Points without a solution among them."""

STEADY, NARROW = 0.9, 0.125
"""Amplitude over that of the neighbouring point above which no other solution is looked for between them, unless they
are as close as this share of what is between two points of the sweep and still tell different heights."""


@dataclass(frozen=True)
class Highest:
    """Attributes:
    output: number of the read-out. frequency: Hz. amplitude. missed: share of it by which it may be higher between the
        points, see `may_be`. frequencies: (f,) Hz of all points with a solution, rising, amplitudes: (f, w). failed: Hz
        of those without. at_end: whether it is at an end of the band.
    """

    output: int
    frequency: float
    amplitude: float
    missed: float
    frequencies: Array
    amplitudes: Array
    failed: tuple[float, ...]
    at_end: bool


def highest(
    respond: Respond, frequency: Array, tolerance: float = TOLERANCE, most: int = MOST, follow: Follow | None = None,
    at_once: Respond | None = None, tells: Tells | None = None,
) -> Highest:  # fmt: skip
    """The highest amplitude of all read-outs in a band.

    Args:
        frequency: (f,) Hz, rising or falling, a sweep that sees every resonance. tolerance, most: see `TOLERANCE`,
            `MOST`. follow: where it is given, a sweep that jumps goes back on the higher side. at_once: where it is
            given, what is found with little work from what is known: the sweep goes as far as that leads, then back
            from its other end, and the rest is looked for in what is between. tells: where it is given, no solution is
            followed to where it is told to lead.
    """
    asking, found = search(frequency, tolerance, most, follow is not None, at_once is not None, tells), None
    while True:
        try:
            f, with_little, onward = asking.send(found)
        except StopIteration as ended:
            return ended.value  # type: ignore[no-any-return]
        if onward is not None and follow is not None:
            found = follow(f, *onward)
        else:
            found = (at_once if with_little and at_once is not None else respond)(f)


def search(
    frequency: Array, tolerance: float = TOLERANCE, most: int = MOST, follow: bool = True, at_once: bool = True,
    tells: Tells | None = None,
) -> Asking[Highest]:  # fmt: skip
    """`highest`, by what it is sent where it asks for it: whoever solves many rings solves what all ask for."""
    search = _Search(follow, at_once, tells, frequency)
    known, failed = search.known, search.failed
    yield from search.sweep([float(f) for f in frequency])
    before = np.inf  # what was left where a parabola placed the last point
    count, may_fail = 0, len(failed) + FAILING
    while known and count < most and len(failed) < may_fail:
        top = max(float(y.max()) for y in known.values())
        told, (more, low, high) = told_by(known) or (0.0, 0.0), may_be(known)
        promised = told[0] > top * (1 + tolerance) and more - top <= 0.5 * before
        promised = promised and not _beside(told[1], known, failed)
        if more <= top * (1 + (tolerance if promised else LEFT)):
            if not (yield from search.leads_on(top, tolerance)) and not (yield from search.mended()):
                break
            continue
        if not promised and (yield from search.goes_on(low, high, tolerance)):
            continue
        yield from search.look(told[1] if promised else _middle(low, high, failed))
        count, before = count + 1, more - top if promised else np.inf
    while (yield from search.mended()):
        pass
    if not known:
        return Highest(-1, np.nan, np.nan, np.nan, np.zeros(0), np.zeros((0, 0)), tuple(failed), False)
    x, y = _table(known)
    i, output = np.unravel_index(int(y.argmax()), y.shape)
    missed = max(may_be(known)[0] / y.max() - 1, 0.0)
    ends = x[i] in (min(frequency), max(frequency))
    return Highest(int(output), float(x[i]), float(y.max()), missed, x, y, tuple(failed), bool(ends))


class _Search:
    """Attributes: known: Hz -> (w,) amplitudes. failed: Hz without a solution. tried: ways back that were gone. led:
    Hz, whereto they led. ends: Hz, where they ended. looked: Hz without a solution that were looked for again, and what
    was known beside them then."""

    def __init__(self, follow: bool, at_once: bool, tells: Tells | None, frequency: Array) -> None:
        self.follow, self.at_once, self.tells = follow, at_once, tells
        self.low, self.high = float(min(frequency)), float(max(frequency))
        self.width = largest(np.diff(frequency))
        self.known: dict[float, Array] = {}
        self.failed: list[float] = []
        self.tried: set[tuple[float, float, float, bool]] = set()
        self.led: set[float] = set()
        self.looked: set[tuple[float, float, float]] = set()
        self.ends: list[float] = []

    def look(self, f: float) -> Asking[None]:
        y = yield Wanted(f)
        if y is None:
            self.failed.append(f)
        else:
            self.known[f] = y

    def sweep(self, rest: list[float]) -> Asking[None]:
        """On as far as that leads, back from the other end, then what is between."""
        if self.at_once:
            rest = rest[(yield from self._leads(rest)) :][::-1]
            rest = rest[(yield from self._leads(rest)) :]
        for f in rest:
            yield from self.look(f)

    def _leads(self, frequencies: list[float]) -> Asking[int]:
        """How many in their order are found at once."""
        for count, f in enumerate(frequencies):
            y = yield Wanted(f, True)
            if y is None:
                return count
            self.known[f] = y
        return len(frequencies)

    def mended(self) -> Asking[bool]:
        """Whether one of the points without a solution is found by now, from what is known about it or on either side
        of it."""
        for f in self.failed:
            sides = max((x for x in self.known if x < f), default=f), min((x for x in self.known if x > f), default=f)
            if (f, *sides) in self.looked:
                continue
            self.looked.add((f, *sides))
            y = (yield Wanted(f, True)) if self.at_once else None
            for near in sides:
                if y is None and near != f and self.follow:
                    y = dict((yield Wanted(f, onward=(near, self.width, False)))[0]).get(f)
            if y is not None:
                self.failed.remove(f)
                self.known[f] = y
                return True
        return False

    def leads_on(self, top: float, tolerance: float) -> Asking[bool]:
        """Whether a solution that is about as high as the top, and beside which there is a lower one, leads to more
        than is known: not only in this interval. A wide one is halved while what is known does not tell."""
        x = sorted(self.known)
        for low, high in zip(x, x[1:], strict=False):
            a, b = self.known[low].max(), self.known[high].max()
            if min(a, b) >= STEADY * max(a, b) or max(a, b) <= STEADY * top or self._told(low, high):
                continue
            middle = 0.5 * (low + high)
            if self.tells is not None and self._wide(low, high) and middle not in self.failed:
                yield from self.look(middle)
                return True
            if (yield from self.goes_on(low, high, tolerance, True)):
                return True
        return False

    def _wide(self, low: float, high: float) -> bool:
        return high - low > NARROW * self.width

    def _told(self, low: float, high: float) -> bool:
        """Whether the higher of two points leads to the other one."""
        far, near = sorted((low, high), key=lambda f: float(self.known[f].max()))
        return self.tells is not None and self.tells(far, near)

    def goes_on(self, low: float, high: float, tolerance: float, last: bool = False) -> Asking[bool]:
        """Whether the higher of two points leads to more at the other one, or on the way there, than is known. Where it
        ends, a point is looked for beside that. last: whether the interval is not halved any more."""
        known = self.known
        far, near = sorted((low, high), key=lambda f: known[f].max())
        told, wide = known[near].max(), self._wide(low, high)
        smooth = wide and known[far].max() > STEADY * told and near not in self.led
        ended = any(abs(near - end) < ENDED * self.width for end in self.ends)
        arc = last or not wide
        if not self.follow or smooth or ended or (far, near, told, arc) in self.tried:
            return False
        self.tried.add((far, near, told, arc))
        if self._told(low, high):
            return False
        points, ends = yield Wanted(far, onward=(near, self.width, arc))
        higher = {
            f: y for f, y in points if y.max() > (1 + tolerance) * known[far].max() and self.low <= f <= self.high
        }
        known |= higher
        self.led |= set(higher)
        if ends:
            end = max([near, *higher], key=lambda f: abs(f - near))
            self.ends.append(end)
            beside = end + BESIDE * (far - end)
            yield from self.look(beside)
        return bool(higher) or ends


BESIDE = 1e-3
"""Share of the way from where a solution ends to a point without it, at which that is looked for."""


ENDED = 0.02
"""Share of what is between two points of the sweep, within which of an end nothing is followed again."""


def _beside(f: float, known: dict[float, Array], failed: list[float]) -> bool:
    """Whether a point without a solution is between the known ones about a frequency."""
    low, high = max((x for x in known if x < f), default=-np.inf), min((x for x in known if x > f), default=np.inf)
    return any(low < x < high for x in failed)


def _middle(low: float, high: float, failed: list[float]) -> float:
    """Of the widest part of an interval between points that have no solution."""
    x = np.array([low, *sorted(f for f in failed if low < f < high), high])
    i = int(np.diff(x).argmax())
    return float(0.5 * (x[i] + x[i + 1]))


def _table(known: dict[float, Array]) -> tuple[Array, Array]:
    """(f,) frequencies, rising, and (f, w) amplitudes."""
    x = np.array(sorted(known))
    return x, np.array([known[f] for f in x])


def may_be(known: dict[float, Array]) -> tuple[float, float, float]:
    """The highest that an amplitude may be between points, and the ends of that interval (Hz).

    In an interval a curve is smooth as points of one side and the interval's other end tell, or it is smooth from both
    sides up to a jump or a kink. What tells less is believed, and that an interval is no wider than a resonance between
    its half-power points: so its ends are no less than 1/sqrt(2) of what is in it.
    """
    x, y = _table(known)
    if len(x) < 2 or not y.max():
        return float(y.max()), float(x[0]), float(x[0])
    y = np.maximum(y, 1e-9 * y.max())
    (smooth, up_to), (smooth_back, from_) = _ahead(x, y), _ahead(-x[::-1], y[::-1])
    told = np.minimum(np.minimum(smooth, smooth_back[::-1]), np.maximum(up_to, from_[::-1]))
    told = np.minimum(told, np.sqrt(2) * np.maximum(y[1:], y[:-1])).max(axis=1)
    i = int(told.argmax())
    return float(told[i]), float(x[i]), float(x[i + 1])


def _ahead(x: Array, y: Array) -> tuple[Array, Array]:
    """(f - 1, w) highest of every interval: of a smooth curve, and of one that goes on from the left up to a jump."""
    smooth, up_to = np.full((2, len(x) - 1, y.shape[1]), np.inf)
    up_to[0] = y[0]
    g, h = y**-2.0, np.diff(x)[:, None]
    up_to[1:] = _height(g[1:-1] + np.diff(g, axis=0)[:-1] / h[:-1] * h[1:])  # g of a resonance bends away from a line
    up_to = np.maximum(up_to, y[:-1])
    if len(x) > 3:
        smooth[2:] = _smooth(x, g, h)
        up_to[2:] = np.maximum(up_to[2:], _folded(y, h))
    return smooth, up_to


def _smooth(x: Array, g: Array, h: Array) -> Array:
    """(f - 3, w) by the parabola through the interval's left end and two points before, and twice what it misses the
    right end by, either way, as it grows towards it."""
    a, b, end = (x[:-3] - x[2:-1])[:, None], (x[1:-2] - x[2:-1])[:, None], h[2:]
    to_a, to_b, to_end = (g[:-3] - g[2:-1]) / a, (g[1:-2] - g[2:-1]) / b, (g[3:] - g[2:-1]) / end
    bend = (to_b - to_a) / (b - a)
    off = ((to_end - to_a) / (end - a) - bend) / (end - b)
    least = [_least(g[2:-1], to_a - bend * a + c * a * b, bend - c * (a + b), c, end) for c in (2 * off, -2 * off)]
    return _height(np.minimum(*least))


def _least(c0: Array, c1: Array, c2: Array, c3: Array, end: Array) -> Array:
    """Least values of c0 + c1 t + c2 t^2 + c3 t^3 in 0 <= t <= end."""
    with np.errstate(all="ignore"):
        q = -(c2 + np.copysign(np.sqrt(np.maximum(c2**2 - 3 * c1 * c3, 0.0)), c2))
        turns = np.nan_to_num(np.array([q / (3 * c3), c1 / q]), posinf=0.0, neginf=0.0)
    t = np.clip(np.stack([*turns, 0 * c0, end + 0 * c0]), 0.0, end)
    return np.asarray((c0 + t * (c1 + t * (c2 + t * c3))).min(axis=0))


def _folded(y: Array, h: Array) -> Array:
    """(f - 3, w) what a curve that rises ever faster to an interval's left end comes to in it, the frequency taken as a
    parabola over the amplitude, which may turn back; 0 of other curves."""
    a, b = y[1:-2] - y[:-3], y[2:-1] - y[1:-2]
    with np.errstate(all="ignore"):
        bend = (h[1:-1] / b - h[:-2] / a) / (a + b)
        rate = h[1:-1] / b + bend * b
        rise = (np.sqrt(np.maximum(rate**2 + 4 * bend * h[2:], 0.0)) - rate) / (2 * bend)
    return np.where((a > 0) & (b > 0) & (bend < 0) & (rate > 0), y[2:-1] + rise, 0.0)


def _height(g: Array) -> Array:
    """1/sqrt(g), and no bound where g is not positive."""
    return np.where(g > 0, np.maximum(g, 1e-300) ** -0.5, np.inf)


def told_by(known: dict[float, Array]) -> tuple[float, float] | None:
    """The highest amplitude that parabolas tell, and its frequency (Hz), where no point is yet."""
    if len(known) < 3:
        return None
    at, y = _table(known)
    tops = (y[1:-1] >= y[:-2]) & (y[1:-1] >= y[2:])
    middle, which = np.nonzero(tops)
    if not len(middle):
        return None
    three = middle + np.arange(3)[:, None]
    x, g = at[three], y[three, which] ** -2.0
    left, right = (g[1] - g[0]) / (x[1] - x[0]), (g[2] - g[1]) / (x[2] - x[1])
    bend = (right - left) / (x[2] - x[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        place = 0.5 * (x[0] + x[1] - left / bend)
        lowest = g[0] + left * (place - x[0]) + bend * (place - x[0]) * (place - x[1])
    place = np.clip(np.where(bend > 0, place, x[1]), x[0], x[2])
    narrow = 1e-9 * x[1]
    new = np.min(np.abs(place - x), axis=0) > narrow
    # a parabola whose foot is below zero saw a resonance narrower than its points
    height = np.where(lowest > 0, np.maximum(lowest, 1e-300) ** -0.5, np.inf)
    height = np.where(new & (bend > 0), height, 0.0)
    best = int(height.argmax())
    return (float(height[best]), float(place[best])) if height[best] > 0 else None
