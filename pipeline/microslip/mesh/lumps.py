"""Masses, springs and dashpots of a file -> masses of points, and matrices between translations of points.

A node that leads others (or that no solid uses) turns as well as moves. Its rotation is that of points that follow it
rigidly: two of them beside the node tell it, so a rotational spring is a matrix between their translations; a rigid
body with the inertia J about its centre is point masses on its principal axes a_i at both distances l,

    m_i = (tr J / 2 - J_i) / (2 l^2),   the rest of its mass at the centre,

which have the same mass, centre and inertia, and so the same inertia, centrifugal and Coriolis forces. A node of solids
that leads none has no rotation. A loose node does not move where nothing resists.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

from ..data import (
    Array,
    Equation,
    FaceTie,
    Guide,
    Indices,
    Link,
    Links,
    LumpedElement,
    Lumps,
    Mesh,
    NodalLoad,
    PointMass,
    RigidLink,
)
from ..units import SYSTEMS
from .linking import moved
from .raw import RawMesh, joined

_WITHOUT = 1e-9
"""Share of the largest stiffness of a loose node below which nothing resists a direction."""


def spread(raw: RawMesh, system: str | None) -> Lumps | None:
    """What a file lumps, by positions among its nodes; the points that this needs are added to them with their links.

    Args:
        system: of units, a key of `units.SYSTEMS`; None: they are told as left out.
    """
    if not raw.lumps:
        return None
    if system is None:
        raw.lost.append(
            f"{raw.lumps[0].where} and {len(raw.lumps) - 1} other masses, springs and dashpots are left out, as the "
            "units of mass are not known: write length_unit as m, mm or in, or material.units"
        )
        return None
    _, mass, time = SYSTEMS[system]
    made = _Spread(raw)
    for item in made.joined():
        if isinstance(item, PointMass):
            made.weigh(item)
        else:
            made.connect(item)
    made.finish()
    pairs = np.array(list(made.blocks), dtype=np.int64).reshape(-1, 2)
    blocks = np.array(list(made.blocks.values())).reshape(-1, 2, 3, 3)
    points = np.array(list(made.masses), dtype=np.int64)
    weights = mass * np.array(list(made.masses.values()))
    lines = np.array([pair for *pair, _ in made.lines], dtype=np.int64).reshape(-1, 2)
    tight = np.array([k for *_, k in made.lines]) * mass / time**2
    return Lumps(
        points,
        weights,
        pairs,
        blocks[:, 0] * mass / time**2,
        blocks[:, 1] * mass / time,
        lines,
        tight,
    )


def on_mesh(lumps: Lumps, number: Indices) -> Lumps:
    """The same by the points of a mesh. number: (n,) of each position."""
    pairs = number[lumps.pairs]
    swapped = (pairs[:, 0] > pairs[:, 1])[:, None, None]
    K, C = (np.where(swapped, np.swapaxes(A, 1, 2), A) for A in (lumps.stiffness, lumps.damping))
    lines = np.sort(number[lumps.lines], axis=1)
    return Lumps(
        number[lumps.points], lumps.masses, np.sort(pairs, axis=1), K, C, lines, lumps.tight
    )


def points_of(lumps: Lumps | None) -> Indices:
    """Points that carry masses, springs or dashpots, ascending."""
    return np.unique(joined([] if lumps is None else [lumps.points, lumps.pairs.ravel()]))


def attached(
    mesh: Mesh, references: Array, links: Sequence[Link], lumps: Sequence[PointMass | LumpedElement]
) -> Mesh:
    """A mesh with more masses, springs and dashpots, in SI.

    Args:
        references: (r, 3) m, new nodes without cells, counted on behind the reference nodes that are there. links: of
            them to the mesh. lumps: on them, or on points of cells.
    """
    old = mesh.links or Links((), np.zeros((0, 3)), np.zeros(0, dtype=np.int64))
    places = np.vstack([mesh.points, old.references, references])
    raw = RawMesh(places, np.arange(len(places)), list(mesh.cells.items()))
    raw.links, raw.lumps = [*old.items, *links], list(lumps)
    new = spread(raw, "m-kg-s")
    assert new is not None
    n, count = mesh.n_points, len(raw.points) - len(places)
    number = np.concatenate([np.arange(n), np.arange(n, len(places)) + count, n + np.arange(count)])
    new, first = on_mesh(new, number), mesh.node_id.max(initial=0) + old.reference_id.max(initial=0) + 1
    loads = () if mesh.state is None else mesh.state.loads
    loads = tuple(replace(f, nodes=number[f.nodes]) if isinstance(f, NodalLoad) else f for f in loads)
    items = tuple(moved(link, number) for link in raw.links)
    known = Links(
        items, np.vstack([old.references, references]),
        np.concatenate([old.reference_id, first + count + np.arange(len(references))]), old.sets,
    )  # fmt: skip
    T = mesh.temperature
    if T is not None and count:
        T = np.vstack([T, np.tile(np.nanmedian(T, axis=0), (count, 1))])
    if mesh.lumps is not None:
        names = [f.name for f in fields(Lumps)]
        new = Lumps(*(np.concatenate([getattr(mesh.lumps, n), getattr(new, n)]) for n in names))
    return replace(
        mesh, points=np.vstack([mesh.points, raw.points[len(places) :]]), temperature=T, links=known, lumps=new,
        node_id=np.concatenate([mesh.node_id, first + np.arange(count)]), lost=(*mesh.lost, *raw.lost),
        state=mesh.state and replace(mesh.state, loads=loads),
    )  # fmt: skip


@dataclass
class _Spread:
    """Masses and blocks as they are made.

    Attributes:
        solid: positions that cells use. leading: those that others follow, turning: those with rotations.
        frames: position -> points that follow it: (where, positions). masses: position -> mass. blocks: (a, b) ->
            stiffness and damping (2, 3, 3). lines: of springs between two points. resisted: loose
            position -> (6, 6) stiffness of its own.
    """

    raw: RawMesh
    solid: set[int] = field(default_factory=set)
    leading: set[int] = field(default_factory=set)
    turning: set[int] = field(default_factory=set)
    loose: set[int] = field(default_factory=set)
    size: float = 1.0
    added: list[Array] = field(default_factory=list)
    frames: dict[int, tuple[str, list[int]]] = field(default_factory=dict)
    centres: dict[int, int] = field(default_factory=dict)
    turned: dict[int, tuple[int, int]] = field(default_factory=dict)
    masses: dict[int, float] = field(default_factory=dict)
    blocks: dict[tuple[int, int], Array] = field(default_factory=dict)
    lines: list[tuple[int, int, float]] = field(default_factory=list)
    resisted: dict[int, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        raw = self.raw
        used = np.unique(joined(nodes.ravel() for _, nodes in raw.blocks))
        self.solid = {*used.tolist()}
        self.size = float(np.ptp(raw.points[used], axis=0).max()) if len(used) else 1.0
        tied: set[int] = set()
        for link in raw.links:
            if isinstance(link, Equation | Guide):
                tied.update(link.nodes.tolist())
            elif not isinstance(link, FaceTie):
                self.leading.add(int(link.reference))
                tied.update([] if isinstance(link.members, str) else link.members.tolist())
        lumped = {node for item in raw.lumps for node in _nodes(item)}
        self.loose = lumped - self.solid - self.leading - tied
        spinning = {node for item in raw.lumps for node in _turned(item)}
        self.turning = self.leading | (tied - self.solid) | (self.loose & spinning)

    def joined(self) -> list[PointMass | LumpedElement]:
        """The lumped elements without masses on nodes that nothing joins to anything; these are told."""
        ends = {
            n for item in self.raw.lumps if isinstance(item, LumpedElement) for n in _nodes(item)
        }
        idle = [
            m for m in self.raw.lumps if isinstance(m, PointMass) and m.node in self.loose - ends
        ]
        if idle:
            self.loose -= {mass.node for mass in idle}
            said = f"masses on nodes that nothing joins to the solids are left out: {len(idle)}"
            self.raw.remarks.append(f"{idle[0].where}: {said}")
        return [item for item in self.raw.lumps if not any(item is mass for mass in idle)]

    def weigh(self, item: PointMass) -> None:
        """Add a rigid body."""
        node, m, J = item.node, item.mass, item.inertia
        if not (item.offset.any() or J.any()):
            self._load(self.point(node, item.where), m)
            return
        if node not in self.turning:
            self._no_rotation(item.where, node)
            self._load(self.point(node, item.where), m)
            return
        values, axes = np.linalg.eigh(J)
        second = values.sum() / 2 - values
        second[np.abs(second) < 1e-12 * np.abs(values).max()] = 0.0
        most = np.abs(second).max()
        away = min(np.sqrt(3 * most / m), self.size) if m > 0 else 0.1 * self.size
        for moment, axis in zip(second, axes.T, strict=True):
            for side in (away, -away) if moment else ():
                self._load(self._follower(node, item.where, item.offset + side * axis), moment / (2 * away**2))
        rest = m - second.sum() / away**2 if most else m
        if abs(rest) > 1e-12 * m:
            away = item.offset.any()
            self._load(
                self._follower(node, item.where, item.offset) if away else self.point(node, item.where), rest
            )

    def connect(self, item: LumpedElement) -> None:
        """Add a spring or dashpot."""
        rows = [self._row(int(n), int(d), item.where) for n, d in zip(item.nodes, item.directions, strict=True)]
        kept = np.array([row is not None for row in rows], dtype=bool)
        given = [row for row in rows if row is not None]
        points = sorted({point for row in given for point, _ in row})
        rows_of = np.zeros((len(given), len(points), 3))
        for k, row in enumerate(given):
            for point, vector in row:
                rows_of[k, points.index(point)] += vector
        B = rows_of.reshape(len(given), 3 * len(points))
        both = [B.T @ A[np.ix_(kept, kept)] @ B for A in (item.stiffness, item.damping)]
        for i, a in enumerate(points):
            for j, b in enumerate(points[i:], i):
                block = [A[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] for A in both]
                self.blocks[a, b] = self.blocks.get((a, b), np.zeros((2, 3, 3))) + np.array(block)
        if item.along:
            a, b = (self.point(int(node), item.where) for node in item.nodes[[0, -1]])
            self.lines.append((a, b, item.along))
        for node in self.loose & {*item.nodes.tolist()}:
            at = np.flatnonzero(item.nodes == node)
            total = self.resisted.setdefault(node, np.zeros((6, 6)))
            np.add.at(total, np.ix_(item.directions[at], item.directions[at]), item.stiffness[np.ix_(at, at)])

    def point(self, node: int, where: str) -> int:
        """The point that moves as a node does: itself, or one that follows it."""
        if node in self.solid or node not in self.turning:
            return node
        if node not in self.centres:
            self.centres[node] = self._follower(node, where, np.zeros(3))
        return self.centres[node]

    def finish(self) -> None:
        """Give the file its new points, the links that hold them, and loose nodes no motion that nothing resists."""
        raw, count = self.raw, len(self.added)
        held = [link for node in sorted(self.loose) for link in self._unresisted(node)]
        followed = [RigidLink(w, node, np.array(points), "xyz") for node, (w, points) in self.frames.items()]
        raw.links = [*followed, *held, *raw.links]
        raw.points = np.vstack([raw.points, *self.added])
        raw.node_id = np.concatenate([raw.node_id, raw.node_id.max(initial=0) + 1 + np.arange(count)])
        if raw.temperature is not None:
            usual = [np.nanmedian(t) if np.isfinite(t).any() else np.nan for t in raw.temperature.T]
            raw.temperature = np.vstack([raw.temperature, np.tile(usual, (count, 1))])
            loose = np.array(sorted({*range(len(raw.points))} - self.solid), dtype=np.int64)
            raw.temperature[loose] = usual  # of no solid: they heat nothing

    def _load(self, point: int, mass: float) -> None:
        self.masses[point] = self.masses.get(point, 0.0) + mass

    def _follower(self, node: int, where: str, away: Array) -> int:
        """A new point that follows a node rigidly."""
        self.added.append(self.raw.points[node] + away)
        new = len(self.raw.points) + len(self.added) - 1
        self.frames.setdefault(node, (where, []))[1].append(new)
        return new

    def _row(self, node: int, direction: int, where: str) -> list[tuple[int, Array]] | None:
        """A displacement or rotation of a node by displacements of points; None of a rotation that is none."""
        if direction < 3:
            return [(self.point(node, where), np.eye(3)[direction])]
        if node not in self.turning:
            self._no_rotation(where, node)
            return None
        away = 0.1 * self.size
        if node not in self.turned:
            x, y = (self._follower(node, where, away * np.eye(3)[i]) for i in (0, 1))
            self.turned[node] = x, y
        # phi x e_x = (0, phi_z, -phi_y), phi x e_y = (-phi_z, 0, phi_x)
        arm, ahead, sign = ((1, 2, 1.0), (0, 2, -1.0), (0, 1, 1.0))[direction - 3]
        vector = sign * np.eye(3)[ahead] / away
        return [(self.turned[node][arm], vector), (self.point(node, where), -vector)]

    def _no_rotation(self, where: str, node: int) -> None:
        self.raw.lost.append(
            f"{where} acts on the rotation of node {self.raw.node_id[node]}, which has none, as solids alone use it: "
            "that part is left out; couple the node to a face (RBE2, RBE3, *COUPLING, CERIG) to give it one"
        )

    def _unresisted(self, node: int) -> Iterable[Equation]:
        """A loose node stands still where it meets no stiffness, as it could not be solved for there."""
        ways = "xyzabc" if node in self.turning else "xyz"
        K = self.resisted.get(node, np.zeros((6, 6)))
        known = [d for name, d in self.raw.supports.items() if node in self.raw.point_sets.get(name, ())]
        for first in range(0, len(ways), 3):
            left = [first + k for k in range(3) if not any(ways[first + k] in d for d in known)]
            values, V = np.linalg.eigh(K[np.ix_(left, left)])
            free = V[:, values <= _WITHOUT * max(values.max(initial=0.0), 1e-300)].T
            for vector in _along_axes(free):
                at = np.flatnonzero(vector)
                where = f"node {self.raw.node_id[node]}, which no stiffness holds"
                yield Equation(where, np.full(len(at), node), np.array(left)[at], vector[at], first=False)


def _along_axes(vectors: Array) -> Array:
    """The same span of (r, k) orthonormal vectors, by unit vectors of the axes where these lie in it."""
    projector = vectors.T @ vectors
    axes = np.eye(len(projector))[np.diag(projector) > 1 - 1e-9]
    left = projector - axes.T @ axes
    values, V = np.linalg.eigh(left)
    others = V[:, values > 0.5].T
    return np.vstack([axes, np.where(np.abs(others) < 1e-12, 0.0, others)])


def hanging(raw: RawMesh) -> str:
    """Which elements left out share nodes with the solids or with constraints, in words; nothing if none does.

    Shells whose nodes are all of solids lie on them and name their faces.
    """
    solid = {*joined(nodes.ravel() for _, nodes in raw.blocks).tolist()}
    near = set(solid)
    for link in raw.links:
        if isinstance(link, Equation | Guide):
            near.update(link.nodes.tolist())
        elif isinstance(link, FaceTie):
            near.update(_surface(raw, link.slave) | _surface(raw, link.master))
        else:
            members = link.members
            near.update(_surface(raw, members) if isinstance(members, str) else members.tolist(), [link.reference])
    near.update(node for item in raw.lumps for node in _nodes(item))
    counts, where = list[str](), ""
    for s in raw.structures:
        flat = len(s.elements[0]) > 2
        beside = [nodes for nodes in s.elements if not (flat and solid.issuperset(nodes))]
        if not near.isdisjoint(node for nodes in beside for node in nodes):
            counts.append(f"{len(beside)} {s.kind}")
            where = where or s.where
    return f"{where}: {', '.join(counts)} share nodes with the solids or their constraints" if counts else ""


def _surface(raw: RawMesh, name: str) -> set[int]:
    """Positions of the nodes of a surface."""
    facets = (block.ravel() for block in raw.facets.get(name, ()))
    return {*joined([raw.point_sets.get(name, np.zeros(0, dtype=np.int64)), *facets]).tolist()}


def _nodes(item: PointMass | LumpedElement) -> list[int]:
    return [item.node] if isinstance(item, PointMass) else item.nodes.tolist()


def _turned(item: PointMass | LumpedElement) -> list[int]:
    """Nodes whose rotation an element acts on."""
    if isinstance(item, PointMass):
        return [item.node] if item.offset.any() or item.inertia.any() else []
    return item.nodes[item.directions >= 3].tolist()
