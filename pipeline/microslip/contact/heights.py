"""Cumulative height distributions of rough surfaces: how much of the nominal area touches (Sextro, section 3.3).

Lengths are divided by the roughness R_Z. `area` is the share of the nominal area in contact at the approach
x* = u_x / R_Z (3.3-14), `volume` its integral from minus infinity, which is the normal force (3.3-21).
"""

from __future__ import annotations

import jax.numpy as jnp

from .law import Array, settings


class Heights:
    """Base of the height distributions."""

    def area(self, x: Array) -> Array:
        """Share of the nominal area in contact at approach x*; rises from 0 to 1."""
        raise NotImplementedError

    def volume(self, x: Array) -> Array:
        """Integral of `area` from minus infinity to x* (3.3-21)."""
        raise NotImplementedError

    def energy(self, x: Array) -> Array:
        """Integral of `volume` from minus infinity to x*."""
        raise NotImplementedError


@settings
class Polynomial(Heights):
    """3 x^2 - 2 x^3 between 0 and 1 (Sextro Eqs. (3.3-4), (3.3-24)): the book's surface, whose peaks are finite."""

    def area(self, x: Array) -> Array:
        x = jnp.clip(x, 0.0, 1.0)
        return x * x * (3 - 2 * x)

    def volume(self, x: Array) -> Array:
        inside = jnp.clip(x, 0.0, 1.0)
        return inside**3 * (1 - 0.5 * inside) + jnp.maximum(x - 1, 0.0)

    def energy(self, x: Array) -> Array:
        inside, beyond = jnp.clip(x, 0.0, 1.0), jnp.maximum(x - 1, 0.0)
        return inside**4 * (0.25 - 0.1 * inside) + 0.5 * beyond * (beyond + 1)


@settings
class Smooth(Heights):
    """No roughness: all of the area touches at once (Sextro Eqs. (3.3-32), (3.3-33)), the penalty law."""

    def area(self, x: Array) -> Array:
        return jnp.where(x > 0, 1.0, 0.0)

    def volume(self, x: Array) -> Array:
        return jnp.maximum(x, 0.0)

    def energy(self, x: Array) -> Array:
        return 0.5 * jnp.maximum(x, 0.0) ** 2
