"""Friction characteristics: the coefficient over the speed of sliding (Sextro, sections 1.2 and 3.6)."""

from __future__ import annotations

from typing import ClassVar

import jax.numpy as jnp

from .law import Array, settings


class Friction:
    """Base of the characteristics.

    Attributes:
        constant: whether the coefficient depends on nothing but the point; the return map then needs no iteration.
    """

    constant: ClassVar[bool] = False

    def coefficient(self, speed: Array) -> Array:
        """(n,) friction coefficient at the speed of sliding (n,) in m/s, not negative."""
        raise NotImplementedError


@settings
class Coulomb(Friction):
    """The same coefficient at every speed."""

    mu: Array
    constant: ClassVar[bool] = True

    def coefficient(self, speed: Array) -> Array:
        return jnp.broadcast_to(self.mu, speed.shape)
