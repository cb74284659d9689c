"""Contact laws: what two bodies exert on each other at a point, given how the point moves (Sextro, chapter 3).

A law is a frozen dataclass whose numbers are leaves of a jax pytree, one value or one per point, with

    init(n) -> state
    step(u, v, dt, state) -> (force, state)

on (n, 3) arrays in the frame (n, t1, t2) of the contact, u_n > 0 closing; see `law.Law`. `EXAMPLES` holds one law of
each kind, and every contract test runs over all of them. Stiffnesses and other numbers that go into a law come from
`layer`, `hertz`, `identification`, which need no jax; it is imported with the first law only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .examples import EXAMPLES as EXAMPLES


def __getattr__(name: str) -> Any:
    if name == "EXAMPLES":
        from .examples import EXAMPLES

        return EXAMPLES
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
