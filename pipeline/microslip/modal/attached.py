"""Masses, springs and dashpots of a body file on its mesh: lumped elements on nodes that follow faces."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..data import Array, AverageLink, Link, LumpedElement, Mesh, PointMass, RigidLink
from ..errors import UserError, at
from ..fem.discretise import face_blocks
from ..frames import skew
from ..mesh.lumps import attached
from ..settings.body import GROUND, AttachedDashpot, AttachedMass, AttachedSpring, BodySettings
from .boundary import require_face


def with_attached(mesh: Mesh, settings: BodySettings) -> Mesh:
    """The mesh with the masses, springs and dashpots of its body file.

    Raises:
        UserError: a face that is not there.
    """
    made = _Attaching(mesh)
    for key in ("masses", "springs", "dashpots"):
        for number, item in enumerate(getattr(settings, key), 1):
            with at(f"{key}, number {number}"):
                made.add(item, f"[[{key}]] number {number}")
    if not made.lumps:
        return mesh
    return attached(mesh, np.array(made.references).reshape(-1, 3), made.links, made.lumps)


@dataclass
class _Attaching:
    """Reference nodes, their links and what stands on them, as they are made.

    Attributes:
        known: face and coupling -> the node in its middle that follows it, or moves it.
    """

    mesh: Mesh
    references: list[Array] = field(default_factory=list)
    links: list[Link] = field(default_factory=list)
    lumps: list[PointMass | LumpedElement] = field(default_factory=list)
    known: dict[tuple[str, str], int] = field(default_factory=dict)

    def add(self, item: AttachedMass | AttachedSpring | AttachedDashpot, where: str) -> None:
        """Add one of them."""
        faces = [face for face in (item.face, getattr(item, "against", GROUND)) if face not in (None, GROUND)]
        for face in faces:
            require_face(self.mesh, face, "face", points_suffice=True)
        if item.point is not None:
            nodes, arms, ways = [self._nearest(np.array(item.point))], [np.zeros(3)], 3
        else:
            middles, ways = [self._middle(face) for face in faces], 6
            centre = np.mean(middles, axis=0) if item.centre is None else np.array(item.centre)
            arms = [centre - middle for middle in middles]
            ends = zip(faces, middles, strict=True)
            nodes = [self._follower(face, middle, item.coupling, where) for face, middle in ends]
        if isinstance(item, AttachedMass):
            self.lumps.append(PointMass(where, nodes[0], item.mass, arms[0], item.tensor()))
            return
        # motion at the centre, u + theta x arm and theta: of the first end less that of the second
        ends_of = [np.block([[np.eye(3), -skew(arm)], [np.zeros((3, 3)), np.eye(3)]]) for arm in arms]
        T = np.hstack([sign * end[:, :ways] for sign, end in zip((1, -1), ends_of, strict=False)])
        A = T.T @ item.matrix() @ T
        both = (A, 0 * A) if isinstance(item, AttachedSpring) else (0 * A, A)
        directions = np.tile(np.arange(ways), len(nodes))
        self.lumps.append(LumpedElement(where, np.repeat(nodes, ways), directions, *both))

    def _nearest(self, point: Array) -> int:
        """The node of the surface or inside that is nearest to a point."""
        solid = np.unique(np.concatenate([c.ravel() for c in self.mesh.cells.values()]))
        away = np.linalg.norm(self.mesh.points[solid] - point, axis=1)
        if away.min() > np.ptp(self.mesh.points[solid], axis=0).max() / 10:
            raise UserError(f"lies {away.min():.3g} m from the body; correct it, or name a face and a centre", "point")
        return int(solid[away.argmin()])

    def _middle(self, face: str) -> Array:
        """(3,) the centre of area of a face, or the mean of a set of points."""
        if face not in self.mesh.faces:
            return self.mesh.points[self.mesh.face_points(face)].mean(axis=0)
        blocks = face_blocks(self.mesh, face)
        area = [np.linalg.norm(b.area, axis=2) for b in blocks]
        places = [np.einsum("qk,fki->fqi", b.N, self.mesh.points[b.facets]) for b in blocks]
        moment = sum(np.einsum("fq,fqi->i", a, x) for a, x in zip(area, places, strict=True))
        return np.asarray(moment / sum(a.sum() for a in area))

    def _follower(self, face: str, middle: Array, coupling: str, where: str) -> int:
        """A new node in the middle of a face, that the face moves or that moves it."""
        if (face, coupling) not in self.known:
            there = 0 if self.mesh.links is None else len(self.mesh.links.references)
            node = self.mesh.n_points + there + len(self.references)
            self.references.append(middle)
            is_face = face in self.mesh.faces
            members = face if is_face else self.mesh.face_points(face)
            weights = None if is_face else np.ones(len(members))
            rigid = coupling == "rigid"
            self.links.append(
                RigidLink(where, node, members) if rigid else AverageLink(where, node, members, weights)
            )
            self.known[face, coupling] = node
        return self.known[face, coupling]
