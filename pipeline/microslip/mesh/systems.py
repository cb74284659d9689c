"""Local coordinate systems of Ansys: rectangular, cylindrical and spherical, by three angles."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..data import Array


def axes_by_angles(angles: Array) -> Array:
    """(3, 3) rows = axes of a system by its angles THXY, THYZ, THZX in degrees.

    It is turned about its z axis first, then about its new x axis, then about its new y axis
    (Mechanical APDL, command LOCAL).
    """
    (c, a, b), (t, s, r) = np.cos(np.radians(angles)), np.sin(np.radians(angles))
    about_z = np.array([[c, -t, 0], [t, c, 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, a, -s], [0, s, a]])
    about_y = np.array([[b, 0, r], [0, 1, 0], [-r, 0, b]])
    return (about_z @ about_x @ about_y).T


@dataclass(frozen=True)
class System:
    """A coordinate system. kind: 0 rectangular, 1 cylindrical, 2 spherical. `axes`: rows, in global
    axes."""

    kind: int = 0
    origin: Array = field(default_factory=lambda: np.zeros(3))
    axes: Array = field(default_factory=lambda: np.eye(3))

    def at(self, point: Array) -> Array:
        """(3, 3) rows = directions x, y, z (r, theta, z of a cylindrical, r, theta, phi of a spherical
        one) at a point (3,), in global axes."""
        if self.kind == 0:
            return self.axes
        x, y, z = self.axes @ (point - self.origin)
        theta = np.arctan2(y, x) if x or y else 0.0
        c, s = np.cos(theta), np.sin(theta)
        local = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        if self.kind == 2:
            phi = np.arctan2(z, np.hypot(x, y))
            a, b = np.cos(phi), np.sin(phi)
            local = np.array([[a, 0, b], [0, 1, 0], [-b, 0, a]]) @ local
        return local @ self.axes


BASIC = {
    0: System(),
    1: System(1),
    2: System(2),
    5: System(1, axes=np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])),
}
"""Systems that are there from the start: 5 is cylindrical about y."""
