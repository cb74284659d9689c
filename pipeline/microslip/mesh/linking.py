"""Constraints of a file: from positions among all of its nodes to points of the mesh and reference nodes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..data import Array, AverageLink, Equation, FaceTie, Guide, Indices, Link, Links, RigidLink
from .raw import Damaged, RawMesh


def renumbered(raw: RawMesh, points: Array, number: Indices, metres: float) -> Links | None:
    """The links of a file on its mesh, None without any.

    A node that rigid or mean motions refer to has rotations, so it is a reference node besides a point if cells use it,
    and moves as the point does.

    Args:
        points: (n, 3) m, all of the file's nodes. number: (n,) of the mesh's points, -1 of nodes that no cell uses.

    Raises:
        Damaged: rotations of a node that has none.
    """
    if not raw.links:
        return None
    found = _References(raw, number)
    order = sorted(raw.links, key=lambda link: isinstance(link, Guide))  # which need to know the others
    items = [item for link in order for item in found.of(link, metres)]
    found.refuse_chains()
    at = np.array(list(found.known), dtype=np.int64)
    sets = {name: np.flatnonzero(np.isin(at, s) & (number[at] < 0)) for name, s in raw.point_sets.items()}
    return Links(tuple(items), points[at], raw.node_id[at], {name: s for name, s in sets.items() if len(s)})


def moved(link: Link, number: Indices) -> Link:
    """A link with its points and reference nodes counted anew. number: (n + k,) of all of them."""
    if isinstance(link, FaceTie):
        return link
    if isinstance(link, Equation | Guide):
        return replace(link, nodes=number[link.nodes])
    members = link.members if isinstance(link.members, str) else number[link.members]
    return replace(link, reference=int(number[link.reference]), members=members)


@dataclass
class _References:
    """Reference nodes as they are met. known: position in the file -> number among them."""

    raw: RawMesh
    number: Indices
    known: dict[int, int] = field(default_factory=dict)

    def of(self, link: Link, metres: float) -> list[Link]:
        """The link on the mesh, and what joins a reference node to the point that it is."""
        if isinstance(link, FaceTie):
            return [replace(link, tolerance=None if link.tolerance is None else metres * link.tolerance)]
        if isinstance(link, Equation):
            pairs = zip(link.nodes, link.directions, strict=True)
            return [replace(link, nodes=np.array([self._node(int(p), int(d), link.where) for p, d in pairs]))]
        if isinstance(link, Guide):
            places = enumerate(map(int, link.nodes))
            there = [i for i, p in places if self.number[p] >= 0 or p in self.known]
            way = 3 if link.turning else 0
            nodes = [self._node(int(link.nodes[i]), way, link.where) for i in there]
            return [replace(link, nodes=np.array(nodes), axes=link.axes[there])] if there else []
        new = link.reference not in self.known
        reference = self._reference(link.reference)
        made = replace(link, reference=reference, members=self._members(link))
        if not new or self.number[link.reference] < 0:
            return [made]
        pair = np.array([reference, self.number[link.reference]])
        one = np.array([1.0, -1.0])
        return [*(Equation(f"{link.where}, reference", pair, np.array([w, w]), one) for w in range(3)), made]

    def refuse_chains(self) -> None:
        """Raises `Damaged` if a node of cells follows a node and leads others, which would take its rotations."""
        for link in self.raw.links:
            if isinstance(link, RigidLink) and not isinstance(link.members, str) and set(link.directions) & set("abc"):
                for node in link.members[self.number[link.members] >= 0]:
                    if int(node) in self.known and node != link.reference:
                        raise Damaged(
                            f"{link.where} moves node {self.raw.node_id[node]}, which leads others and belongs to "
                            "solid cells; let these others follow the first node themselves"
                        )

    def _reference(self, position: int) -> int:
        return int(self.number.max()) + 1 + self.known.setdefault(position, len(self.known))

    def _node(self, position: int, direction: int, where: str) -> int:
        if self.number[position] >= 0 and direction < 3:
            return int(self.number[position])
        if self.number[position] >= 0 and position not in self.known:
            raise Damaged(
                f"{where} takes in the rotation of node {self.raw.node_id[position]}, which has none: it belongs to "
                "solid cells"
            )
        return self._reference(position)

    def _members(self, link: RigidLink | AverageLink) -> Indices | str:
        if isinstance(link.members, str):
            return link.members
        there = self.number[link.members] >= 0
        if isinstance(link, AverageLink) and not there.all():
            loose = self.raw.node_id[link.members[~there][0]]
            raise Damaged(f"{link.where} takes in node {loose}, which no solid cell uses; name nodes of cells")
        others = [self._reference(int(p)) for p in link.members[~there]]
        return np.concatenate([self.number[link.members[there]], np.array(others, dtype=np.int64)])
