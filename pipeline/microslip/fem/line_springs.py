"""Springs along the lines between two points, which turn with these: what that adds at finite displacements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Array, Indices, Mesh
from .discretise import Pattern


@dataclass(frozen=True)
class LineSprings:
    """Springs that pull with F = k (l - l0) along e, the line from their first point to their second.

    The tangent is k e e^T + F / l (1 - e e^T); the mesh's lumped stiffness has k e0 e0^T of them
    already, and what stands here is the difference to that.

    Attributes:
        pairs: (s, 2) points a < b. stiffness: (s,) N/m. rest: (s, 3) from a to b at rest, m.
    """

    pairs: Indices
    stiffness: Array
    rest: Array

    def _at(self, u: Array) -> tuple[Array, Array, Array]:
        """Length (s,), its direction (s, 3) and F / l (s,) at displacements u (n, 3)."""
        line = self.rest + u[self.pairs[:, 1]] - u[self.pairs[:, 0]]
        length, l0 = np.linalg.norm(line, axis=1), np.linalg.norm(self.rest, axis=1)
        return length, line / length[:, None], self.stiffness * (1 - l0 / length)

    def force(self, u: Array) -> Array:
        """(n, 3) N with which they resist displacements u (n, 3) beyond k e0 e0^T."""
        length, e, tension = self._at(u)
        e0 = self.rest / np.linalg.norm(self.rest, axis=1, keepdims=True)
        stretch = np.einsum("si,si->s", e0, u[self.pairs[:, 1]] - u[self.pairs[:, 0]])
        pull = (tension * length)[:, None] * e - (self.stiffness * stretch)[:, None] * e0
        out = np.zeros_like(u)
        np.add.at(out, self.pairs[:, 1], pull)
        np.add.at(out, self.pairs[:, 0], -pull)
        return out

    def tangent(self, u: Array, pattern: Pattern) -> Array:
        """(p, 3, 3) N/m at u beyond k e0 e0^T."""
        _, e, tension = self._at(u)
        e0 = self.rest / np.linalg.norm(self.rest, axis=1, keepdims=True)
        along = np.einsum("s,si,sj->sij", self.stiffness - tension, e, e)
        first = np.einsum("s,si,sj->sij", self.stiffness, e0, e0)
        return self._over(tension[:, None, None] * np.eye(3) + along - first, pattern)

    def slope(self, u: Array, du: Array, pattern: Pattern) -> Array:
        """(p, 3, 3) derivative of the tangent along du (n, 3)."""
        length, e, tension = self._at(u)
        d = du[self.pairs[:, 1]] - du[self.pairs[:, 0]]
        longer = np.einsum("si,si->s", e, d)
        de = (d - longer[:, None] * e) / length[:, None]
        more = (self.stiffness - tension) / length * longer  # of F / l
        turned = np.einsum("s,si,sj->sij", self.stiffness - tension, de, e)
        across = more[:, None, None] * (np.eye(3) - np.einsum("si,sj->sij", e, e))
        return self._over(across + turned + turned.transpose(0, 2, 1), pattern)

    def _over(self, blocks: Array, pattern: Pattern) -> Array:
        """Blocks (s, 3, 3) of the springs over the pattern."""
        out = np.zeros((pattern.size, 3, 3))
        a, b = self.pairs.T
        for places, sign in (
            (pattern.places(a, a), 1),
            (pattern.places(b, b), 1),
            (pattern.places(a, b), -1),
        ):
            np.add.at(out, places, sign * blocks)
        return out


def line_springs(mesh: Mesh) -> LineSprings | None:
    """Those of a mesh."""
    if mesh.lumps is None or not len(mesh.lumps.lines):
        return None
    lines = mesh.lumps.lines
    return LineSprings(lines, mesh.lumps.tight, mesh.points[lines[:, 1]] - mesh.points[lines[:, 0]])
