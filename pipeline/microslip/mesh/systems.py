"""Local coordinate systems: rectangular, cylindrical, spherical; by angles, by points, within another one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ..data import Array
from .raw import Damaged

_PARALLEL = 1e-8
"""Sine of the angle between two axes below which they are parallel: files have eight digits."""

_ON_AXIS = 1e-12


@dataclass(frozen=True)
class System:
    """A coordinate system, whose angles are in degrees.

    Attributes:
        kind: 0 rectangular x, y, z; 1 cylindrical r, theta, z; 2 spherical r, theta about z, phi from
            the equator (Ansys); 3 spherical r, theta from z, phi about z (Nastran).
        origin: (3,) in the basic system. axes: (3, 3) rows x, y, z in it.
    """

    kind: int = 0
    origin: Array = field(default_factory=lambda: np.zeros(3))
    axes: Array = field(default_factory=lambda: np.eye(3))

    def points(self, coordinates: Array) -> Array:
        """(n, 3) points in the basic system, of coordinates (n, 3) in this one."""
        a, b, c = np.asarray(coordinates, dtype=float).T
        if self.kind == 3:
            b, c = c, 90 - b
        about, up = np.radians(b), np.radians(c)
        if self.kind >= 2:
            a, c = a * np.cos(up), a * np.sin(up)
        if self.kind >= 1:
            a, b = a * np.cos(about), a * np.sin(about)
        return self.origin + np.column_stack([a, b, c]) @ self.axes

    def directions(self, points: Array) -> Array:
        """(n, 3, 3) unit vectors (rows) of this system's three directions at points (n, 3).

        On the z axis the angle about it counts as 0; there the directions of Nastran's spherical
        systems are x, y, z.
        """
        local = (np.asarray(points, dtype=float) - self.origin) @ self.axes.T
        frames = np.tile(np.eye(3), (len(local), 1, 1))
        radius, size = np.hypot(local[:, 0], local[:, 1]), np.linalg.norm(local, axis=1)
        off = radius > _ON_AXIS * np.maximum(size, np.linalg.norm(self.origin))
        if self.kind:
            frames[off, 0, :2] = frames[off, 1, 1::-1] = local[off, :2] / radius[off, None]
            frames[off, 1, 0] *= -1
        if self.kind >= 2:
            there = size > 0 if self.kind == 2 else off
            out, around, up = (frames[there, k] for k in range(3))
            sine, cosine = (part[there, None] / size[there, None] for part in (radius, local[:, 2]))
            south = cosine * out - sine * up
            frames[there, 0] = sine * out + cosine * up
            frames[there, 1] = around if self.kind == 2 else south
            frames[there, 2] = -south if self.kind == 2 else around
        return frames @ self.axes


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


BASIC = {
    0: System(),
    1: System(1),
    2: System(2),
    5: System(1, axes=np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])),
}
"""Systems that are there from the start in Ansys: 5 is cylindrical about y."""


def through(kind: int, origin: Array, on_z: Array, in_xz: Array) -> System:
    """The system with a point on its z axis and one in its x-z plane, each (3,) in the basic one.

    Raises:
        Damaged: the three points lie on a line.
    """
    z, towards = on_z - origin, in_xz - origin
    y = np.cross(z, towards)
    size = np.linalg.norm(z) * np.linalg.norm(towards)
    if not np.linalg.norm(y) > _PARALLEL * size:
        raise Damaged("has three points on a line, which give no axes; move one off it")
    z, y = z / np.linalg.norm(z), y / np.linalg.norm(y)
    return System(kind, origin, np.array([np.cross(y, z), y, z]))


class Chained:
    """Systems by their numbers, each made when it is first asked for.

    Args:
        make: the system of a number, which asks here for those that it lies in.
    """

    def __init__(self, make: Callable[[int], System]) -> None:
        self.make = make
        self.made: dict[int, System] = {0: System()}
        self.within: list[int] = []

    def __getitem__(self, number: int) -> System:
        """Raises `Damaged` if a system lies in itself."""
        if number not in self.made:
            if number in self.within or len(self.within) > 200:
                chain = " in ".join(map(str, [*self.within[-4:], number]))
                raise Damaged(
                    f"coordinate systems lie in each other in a circle ({chain}); define one of "
                    "them in the basic system"
                )
            self.within.append(number)
            self.made[number] = self.make(number)
            self.within.pop()
        return self.made[number]
