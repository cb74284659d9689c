"""Laws of other packages, tried before they are solved: in a response a mistake in one is told from within JAX."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from ..errors import UserError
from .law import Law, Step


def is_other(thing: object) -> bool:
    """Whether a law, or a part of one, is of another package."""
    return not type(thing).__module__.startswith(f"{__name__.split('.')[0]}.")


def tried(law: Law, *parts: object) -> None:
    """Trace every method of a law for two points, which computes nothing.

    Args:
        parts: of the law, which may be of other packages too.

    Raises:
        UserError: a method that is missing, fails or returns another shape.
    """
    kind = type(law)
    if missing := [name for name in Law.NEEDED if getattr(kind, name) is getattr(Law, name)]:
        raise UserError(
            f"{kind.__name__} of {kind.__module__} has no method {', '.join(missing)}; add "
            "what is missing, docs/own_law.md says what each returns"
        )
    if not any(is_other(one) for one in (law, *parts)):
        return
    shape = running(lambda: jax.eval_shape(lambda: _methods(law)).shape, law, *parts)
    if shape != (2, 3):
        raise UserError(
            f"step of {kind.__name__} gives two points a force of shape {shape}; it has to be "
            "(2, 3), a row for each point along n, t1 and t2"
        )


def _methods(law: Law) -> Any:
    two, rest = jnp.zeros((2, 3)), law.init(2)
    force, state = law.step(two, two, 1.0, rest)
    if force.shape == two.shape:
        law.limit(force, state)
        law.slip(state)
        law.stored(two, state)
        if type(law).lost is not Law.lost:
            law.lost(Step(two, two, 1.0, force, force, rest, state))
    return force


def running(what: Callable[[], Any], *others: object) -> Any:
    """What code of other packages returns.

    Raises:
        UserError: it fails; the sentence has file and line.
    """
    try:
        return what()
    except UserError:
        raise
    except Exception as error:
        files = {getattr(sys.modules.get(type(one).__module__), "__file__", "") for one in others if is_other(one)}
        places = [f for f in traceback.extract_tb(error.__traceback__) if f.filename in files]
        if not places:
            raise
        at, said = places[-1], str(error).splitlines()[0] if str(error) else ""
        raise UserError(
            f"{at.filename}, line {at.lineno}, in {at.name}: {type(error).__name__}: {said}; correct it"
        ) from error
