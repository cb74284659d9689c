"""Normal contact laws: force and share of the tangential stiffness over the approach (Sextro, sections 3.3 and 3.4)."""

from __future__ import annotations

import jax.numpy as jnp

from .heights import Heights
from .law import Array, settings


class Normal:
    """Base of the normal laws. ``u`` (n,) is the approach in m, positive where the surfaces overlap."""

    def force(self, u: Array) -> Array:
        """(n,) compressive force, N; zero where the contact is open."""
        raise NotImplementedError

    def stiffness(self, u: Array) -> Array:
        """(n,) its derivative, N/m."""
        raise NotImplementedError

    def share(self, u: Array) -> Array:
        """(n,) share of the nominal tangential stiffness that acts at this approach (3.3-40)."""
        raise NotImplementedError

    def stored(self, u: Array) -> Array:
        """(n,) elastic energy, J: the integral of the force."""
        raise NotImplementedError


@settings
class Penalty(Normal):
    """A spring that cannot pull (Sextro Eq. (3.3-33)). stiffness_0: N/m. gap: m, at u = 0."""

    stiffness_0: Array
    gap: Array | float = 0.0

    def force(self, u: Array) -> Array:
        return self.stiffness_0 * jnp.maximum(u - self.gap, 0.0)

    def stiffness(self, u: Array) -> Array:
        return self.stiffness_0 * self.share(u)

    def share(self, u: Array) -> Array:
        return jnp.where(u > self.gap, 1.0, 0.0)

    def stored(self, u: Array) -> Array:
        return 0.5 * self.stiffness_0 * jnp.maximum(u - self.gap, 0.0) ** 2


@settings
class Preload(Normal):
    """A constant normal force, N, that no motion changes: the book's mode of chapter 5. The contact never opens."""

    constant: Array

    def force(self, u: Array) -> Array:
        return jnp.broadcast_to(self.constant, u.shape)

    def stiffness(self, u: Array) -> Array:
        return jnp.zeros_like(u)

    def share(self, u: Array) -> Array:
        return jnp.ones_like(u)

    def stored(self, u: Array) -> Array:
        return self.constant * u


@settings
class Rough(Normal):
    """An elastic layer under a rough surface (Sextro Eqs. (3.3-21), (3.3-40)).

    Attributes:
        stiffness_0: c_N0 of the full area, N/m. roughness: R_Z, m. heights: the cumulative height distribution.
    """

    stiffness_0: Array
    roughness: Array
    heights: Heights

    def force(self, u: Array) -> Array:
        return self.stiffness_0 * self.roughness * self.heights.volume(u / self.roughness)

    def stiffness(self, u: Array) -> Array:
        return self.stiffness_0 * self.share(u)

    def share(self, u: Array) -> Array:
        return self.heights.area(u / self.roughness)

    def stored(self, u: Array) -> Array:
        return self.stiffness_0 * self.roughness**2 * self.heights.energy(u / self.roughness)
