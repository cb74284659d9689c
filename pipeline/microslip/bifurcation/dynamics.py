"""What is followed: a smooth system of first order, x' = f(x, p, angle), free or driven with a known frequency."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import jax
import jax.numpy as jnp
import numpy as np
from pydantic import Field

from ..data import Array
from ..errors import UserError
from ..process import prepare
from ..settings.arguments import checked_fields, numbers
from ..settings.numbers import Positive
from ..units import Quantity

Rate = Callable[[Any, Any, Any], Any]
"""f of x (n,), the parameter p and the angle (rad) of what drives it, in jax: (n,)."""


@checked_fields
@dataclass(frozen=True, eq=False)
class Dynamics:
    """A system x' = f(x, p, angle).

    Attributes:
        rate: f. labels: of the n coordinates. scale: (n,) what a large change of each is. parameter_scale: what a large
            change of p is. frequency: rad/s of what drives it, a function of p in jax; None: nothing does, and f does
            not depend on the angle.
        outputs: names of what is read, units of each. read: of x (..., n) and p: (..., w); None: the coordinates.
        bends: (n, r) orthonormal, of the coordinates that f is not linear in: its derivative over all orthogonal to
            them depends on p alone; None: not known.
    """

    rate: Rate
    labels: Annotated[tuple[str, ...], Field(min_length=1)]
    scale: Annotated[Any, numbers(1, gt=0)]
    parameter_scale: Positive = 1.0
    frequency: Callable[[Any], Any] | None = None
    outputs: tuple[str, ...] = ()
    read: Callable[[Array, float], Array] | None = None
    units: tuple[str, ...] = ()
    bends: Annotated[Any, numbers(2)] | None = None

    def __post_init__(self) -> None:
        if len(self.scale) != self.count:
            raise UserError(f"Dynamics: scale: has {len(self.scale)} numbers; there are {self.count} labels")
        if self.bends is not None and len(self.bends) != self.count:
            raise UserError(f"Dynamics: bends: has {len(self.bends)} rows; there are {self.count} labels")
        if len(set(self.labels)) < self.count:
            raise UserError(f"Dynamics: labels: {', '.join(self.labels)}: two are alike; rename one")
        if self.read is None and self.outputs and len(self.outputs) != self.count:
            raise UserError(f"Dynamics: outputs: are {len(self.outputs)}, and {self.count} coordinates; give read too")
        if self.units and len(self.units) != len(self.named):
            raise UserError(f"Dynamics: units: are {len(self.units)} of {len(self.named)} read-outs; give one for each")

    @property
    def count(self) -> int:
        return len(self.labels)

    def check(self, x: Array, p: float) -> None:
        """Raise `UserError` where f or what is read is not as long as it should be, or no real
        number."""
        prepare()  # or it would be traced in single precision
        zero = jnp.zeros(())
        f = jax.eval_shape(lambda x, p: jnp.asarray(self.rate(x, p, zero)), jnp.asarray(x), jnp.asarray(float(p)))
        for key, result, count in (("rate", f, self.count), ("read", self.seen(x, p), len(self.named))):
            if np.shape(result) != (count,) or not np.issubdtype(result.dtype, np.floating):
                raise UserError(
                    f"Dynamics: {key}: gives {result.dtype} of shape {np.shape(result)}; let it give {count} real "
                    "numbers"
                )

    def seen(self, x: Array, p: float) -> Array:
        """(..., w) of x (..., n)."""
        return x if self.read is None else np.asarray(self.read(x, p))

    @property
    def named(self) -> tuple[str, ...]:
        """(w,) of the read-outs."""
        return self.outputs or self.labels

    def column(self, what: str, output: int = 0) -> str:
        """Name of a column of a table about a read-out, with its unit if that is known."""
        name = f"{what} {self.named[output]}"
        return Quantity(self.units[output]).column(name) if self.units else name

    @cached_property
    def still(self) -> Callable[[Any, Any], tuple[Any, Any, Any]]:
        """f, df/dx and df/dp at x and p, compiled, of a system that nothing drives."""

        def f(x: Any, p: Any) -> Any:
            return self.rate(x, p, jnp.zeros(()))

        return jax.jit(lambda x, p: (f(x, p), jax.jacfwd(f)(x, p), jax.jacfwd(f, 1)(x, p)))

    @cached_property
    def forms(self) -> tuple[Callable[..., Any], Callable[..., Any]]:
        """The second and third derivatives of f along given directions over the scales, compiled: of x and p over
        their scales, and two or three directions (n,)."""
        size = jnp.asarray(self.scale)

        def f(y: Any, p: Any) -> Any:
            return self.rate(y * size, p, jnp.zeros(())) / size

        def along(g: Any, way: Any) -> Any:
            return lambda y, p: jax.jvp(lambda y: g(y, p), (y,), (way,))[1]

        def second(y: Any, p: Any, a: Any, b: Any) -> Any:
            return along(along(f, a), b)(y, p)

        def third(y: Any, p: Any, a: Any, b: Any, c: Any) -> Any:
            return along(along(along(f, a), b), c)(y, p)

        return jax.jit(second), jax.jit(third)

    @cached_property
    def hopf(self) -> Callable[..., tuple[Any, Any]]:
        """Of z = (x, p, Re v, Im v, omega) and a complex vector c (n,): f, J v - i omega v and c . v - 1, real and
        imaginary parts, and their derivatives over z, compiled."""
        n = self.count

        def F(z: Any, re: Any, im: Any) -> Any:
            x, p, a, b, w = z[:n], z[n], z[n + 1 : 2 * n + 1], z[2 * n + 1 : 3 * n + 1], z[-1]

            def f(x: Any) -> Any:
                return self.rate(x, p, jnp.zeros(()))

            value, Ja = jax.jvp(f, (x,), (a,))
            Jb = jax.jvp(f, (x,), (b,))[1]
            normalised = jnp.stack([re @ a - im @ b - 1, re @ b + im @ a])
            return jnp.concatenate([value, Ja + w * b, Jb - w * a, normalised])

        return jax.jit(lambda z, re, im: (F(z, re, im), jax.jacfwd(F)(z, re, im)))
