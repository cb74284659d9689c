"""A contact shared out among the points of a patch: each carries its share of what the whole one would."""

from __future__ import annotations

from typing import Any

from .law import Array, Law, Scalar, State, Step, number, settings


def portion(whole: Law, share: Array) -> Law:
    """The law of points that share out a whole contact: with numbers of their own where it can have them."""
    own = whole.scaled(share)
    return Portion(whole, share) if own is None else own


@settings
class Portion(Law):
    """A law of a whole contact, of which each point carries a share (Sextro Eq. (5.2-34)).

    A point answers its own displacement as the whole contact would, times its share: force, limit and energy are
    extensive, path and state are not. Any law will do, because nothing of it has to be taken apart.

    Attributes:
        whole: law of the full area. share: of a point, one number or one per point; all of them together are 1.
    """

    whole: Law
    share: Array = number(gt=0)

    def init(self, n: int) -> State:
        return self.whole.init(n)

    def step(self, u: Array, v: Array, dt: Scalar, state: State) -> tuple[Array, State]:
        force, after = self.whole.step(u, v, dt, state)
        return (self.share * force.T).T, after

    @property
    def viscous(self) -> bool:
        return self.whole.viscous

    @property
    def remembers(self) -> int | None:
        return self.whole.remembers

    @property
    def follows(self) -> float:
        return self.whole.follows

    def rates(self, u: Array, v: Array, x: Array, time: Scalar, lag: float) -> tuple[Array, Array]:
        force, rate = self.whole.rates(u, v, x, time, lag)
        return (self.share * force.T).T, rate

    @property
    def smooth(self) -> bool:  # type: ignore[override]
        return self.whole.smooth

    @property
    def brakes(self) -> bool:  # type: ignore[override]
        return self.whole.brakes

    def slowed(self, u: Array, v: Array, dt: Scalar, state: State, yielding: Array) -> Array:
        return self.whole.slowed(u, v, dt, state, self.share * yielding)

    def memory(self, force: Array, state: State) -> Array:
        return self.share * self.whole.memory((force.T / self.share).T, state)

    def recalled(self, state: State, memory: Array) -> State | None:
        return self.whole.recalled(state, memory / self.share)

    def way(self, u: Array, v: Array, dt: Scalar, state: State) -> Any:
        return self.whole.way(u, v, dt, state)

    def drag(self, way: Any, memory: Array) -> tuple[Array, Array]:
        force, after = self.whole.drag(way, memory / self.share)
        return self.share * force, self.share * after

    def limit(self, force: Array, state: State) -> Array:
        return self.share * self.whole.limit((force.T / self.share).T, state)

    def slip(self, state: State) -> Array:
        return self.whole.slip(state)

    def stored(self, u: Array, state: State) -> Array:
        return self.share * self.whole.stored(u, state)

    def pressed(self, approach: Array) -> Array:
        return self.share * self.whole.pressed(approach)

    def overlap(self, u: Array) -> Array:
        return self.whole.overlap(u)

    def lost(self, step: Step) -> Array:
        before, force = ((f.T / self.share).T for f in (step.force_before, step.force))
        return self.share * self.whole.lost(step._replace(force_before=before, force=force))
