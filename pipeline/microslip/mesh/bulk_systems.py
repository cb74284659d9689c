"""Local coordinate systems of Nastran: rectangular, cylindrical, spherical, each within another one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..data import Array
from .raw import Damaged

_PARALLEL = 1e-8
"""Sine of the angle between two axes below which they are parallel: files have eight digits."""

_ON_AXIS = 1e-12


@dataclass(frozen=True)
class LocalSystem:
    """Coordinates x, y, z (``R``), r, theta, z (``C``) or r, theta from z, phi about z (``S``).

    Angles are in degrees.

    Attributes:
        kind: R, C or S. origin: (3,) in the basic system. axes: (3, 3) rows x, y, z in it.
    """

    kind: str
    origin: Array
    axes: Array

    def points(self, coordinates: Array) -> Array:
        """(n, 3) points in the basic system, of coordinates (n, 3) in this one."""
        a, b, c = np.asarray(coordinates, dtype=float).T
        if self.kind == "C":
            b = np.radians(b)
            a, b = a * np.cos(b), a * np.sin(b)
        elif self.kind == "S":
            b, c = np.radians(b), np.radians(c)
            a, b, c = a * np.sin(b) * np.cos(c), a * np.sin(b) * np.sin(c), a * np.cos(b)
        return self.origin + np.column_stack([a, b, c]) @ self.axes

    def directions(self, points: Array) -> Array:
        """(n, 3, 3) unit vectors (rows) of this system's three directions at points (n, 3).

        On the z axis of a cylindrical or spherical system, where these have no direction, they are
        x, y, z, as Nastran takes them there.
        """
        local = (np.asarray(points, dtype=float) - self.origin) @ self.axes.T
        frames = np.tile(np.eye(3), (len(local), 1, 1))
        radius, size = np.hypot(local[:, 0], local[:, 1]), np.linalg.norm(local, axis=1)
        off = radius > _ON_AXIS * np.maximum(size, np.linalg.norm(self.origin))
        if self.kind != "R":
            c, s = (local[off, :2] / radius[off, None]).T
            zero = np.zeros_like(c)
            around = np.column_stack([-s, c, zero])
            if self.kind == "C":
                frames[off, 0], frames[off, 1] = np.column_stack([c, s, zero]), around
            else:
                sine, cosine = radius[off] / size[off], local[off, 2] / size[off]
                frames[off, 0] = np.column_stack([sine * c, sine * s, cosine])
                frames[off, 1] = np.column_stack([cosine * c, cosine * s, -sine])
                frames[off, 2] = around
        return frames @ self.axes


def through(kind: str, origin: Array, on_z: Array, in_xz: Array) -> LocalSystem:
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
    return LocalSystem(kind, origin, np.array([np.cross(y, z), y, z]))


class Chained:
    """Systems by their numbers, each made when it is first asked for.

    Args:
        make: the system of a number, which asks here for those that it lies in.
    """

    def __init__(self, make: Callable[[int], LocalSystem]) -> None:
        self.make = make
        self.made: dict[int, LocalSystem] = {0: LocalSystem("R", np.zeros(3), np.eye(3))}
        self.within: list[int] = []

    def __getitem__(self, number: int) -> LocalSystem:
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
