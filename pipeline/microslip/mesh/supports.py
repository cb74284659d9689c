"""What a file of another program holds: sets of points and the displacements that are zero there."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..data import Array, Equation, FaceTie, Guide, Indices, Link, PointMass
from .raw import Numbering, RawMesh, joined


@dataclass
class Constraints:
    """What the keywords of a file hold.

    Attributes:
        sets: set name -> directions out of x, y, z. nodes: node number -> directions.
        axes: node number -> (3, 3) rows x, y, z of its directions, where these are not the body's.
        turned: numbers of nodes whose directions are those of a local system that is not read. all_turned: some may be,
            unknown which.
        left_out: what is not read, in words.
    """

    sets: dict[str, set[str]] = field(default_factory=dict)
    nodes: dict[int, set[str]] = field(default_factory=dict)
    axes: dict[int, Array] = field(default_factory=dict)
    turned: set[int] = field(default_factory=set)
    all_turned: bool = False
    left_out: list[str] = field(default_factory=list)

    def hold(self, where: str | int, directions: Iterable[str]) -> None:
        """Add a set or a node; no direction adds nothing."""
        if directions := set(directions):
            known: dict = self.nodes if isinstance(where, int) else self.sets
            known.setdefault(where, set()).update(directions)

    def release(self, nodes: set[int], directions: set[str], members: Mapping[str, Iterable[int]]) -> None:
        """Take directions away from nodes; `members`: numbers of the nodes of each set."""
        for name in [name for name in self.sets if not nodes.isdisjoint(members.get(name, ()))]:
            ways = self.sets.pop(name)
            for node in members[name]:
                self.hold(node, ways)
        for node in nodes & self.nodes.keys():
            self.nodes[node] -= directions

    def clear(self) -> None:
        """Forget what was held before."""
        self.sets, self.nodes = {}, {}


def still_supports(raw: RawMesh, held: Constraints, numbering: Numbering) -> dict[str, str] | None:
    """Point set -> directions of what a static step holds, its sets added to `raw`; None where those of its modes are
    the same. What of it is skewed, or not read, is told."""
    still = replace(raw, supports={}, links=list(raw.links), not_held=[], lost=raw.lost)
    add_supports(still, held, numbering, "held at rest")
    guides = sum(isinstance(link, Guide) for link in raw.links)
    if (more := abs(len(still.links) - len(raw.links) - guides)) or still.not_held:
        number = more or len(still.not_held)
        raw.lost.append(
            f"{number} supports of the static step are not read: frequencies may differ"
        )
    return None if _by_node(still) == _by_node(raw) else still.supports


def _by_node(raw: RawMesh) -> set[tuple[int, str]]:
    return {
        (n, way)
        for name, ways in raw.supports.items()
        for n in raw.point_sets[name].tolist()
        for way in ways
    }


def add_supports(
    raw: RawMesh, held: Constraints, numbering: Numbering, title: str = "held"
) -> None:
    """Give `raw` the supports: named sets as they are; nodes held alike as the set that has just them, or a new one,
    whose name begins with the title.

    Rotations (a, b, c) are those of reference nodes; others have none. Single directions of a local system become
    linear equations, which hold wherever the mesh is used.
    """
    turning = _turning(raw)
    held = replace(held, sets=dict(held.sets), nodes=dict(held.nodes))
    for name, found in held.sets.items():
        if not np.isin(raw.point_sets.get(name, ()), turning).any():
            held.sets[name] = found - set("abc")
    for node, found in held.nodes.items():
        at = raw.node_id[turning] == node
        held.nodes[node] = found if at.any() else found - set("abc")
    raw.links += _guided(raw, held, numbering)
    left_out = dict.fromkeys(held.left_out)
    for name, found in held.sets.items():
        directions = _in_order(found)
        if not directions:
            continue
        if held.all_turned and directions[:3] != "xyz":
            left_out[f"'{name}' is held in {directions} of what may be a local system"] = None
        elif name in raw.point_sets:
            raw.supports[name] = directions
        else:
            left_out[f"'{name}' in {directions}: none of its nodes is there"] = None
    alike: dict[str, list[int]] = {}
    for node, found in held.nodes.items():
        if not found:
            continue
        if (held.all_turned or node in held.turned) and len(found) < 3:
            left_out[f"node {node} is held in {_in_order(found)} of a local system"] = None
        elif not np.isin(node, numbering.sorted):
            left_out[f"node {node}, which the file does not define"] = None
        else:
            alike.setdefault(_in_order(found), []).append(node)
    for directions, nodes in alike.items():
        members = np.unique(numbering.positions(nodes, "a constraint names"))
        same = (n for n, s in raw.point_sets.items() if n not in raw.supports and np.array_equal(s, members))
        name = next(same, f"{title} {directions}")
        raw.add_points(name, members)
        raw.supports[name] = directions
    told = list(left_out)
    raw.not_held = told if len(told) <= 5 else [*told[:4], f"and {len(told) - 4} more like these"]


_ALIKE = 1e-9
"""What the components of an axis may differ by from those of an axis of the body."""


def _guided(raw: RawMesh, held: Constraints, numbering: Numbering) -> list[Link]:
    """Supports in skewed directions, and of rotations alone, which are taken out of what is held; along the body's axes
    they stay there as directions of the body."""
    for name in [name for name, ways in held.sets.items() if len(ways & set("xyz")) in (1, 2)]:
        members = raw.node_id[raw.point_sets.get(name, np.zeros(0, dtype=np.int64))].tolist()
        if not held.axes.keys().isdisjoint(members):
            directions = held.sets.pop(name)
            for node in members:
                held.nodes[node] = held.nodes.get(node, set()) | directions
    skewed: dict[bool, list[tuple[int, Array]]] = {False: [], True: []}
    for node in held.axes.keys() & held.nodes.keys() & set(numbering.sorted.tolist()):
        plain = set[str]()
        for ways in ("xyz", "abc"):
            chosen = held.nodes[node] & set(ways)
            axes = held.axes[node][[ways.index(c) for c in chosen]]
            along = np.abs(axes) > 1 - _ALIKE
            used = along.any(axis=0) | (len(chosen) == 3)
            plain |= {ways[i] for i in np.flatnonzero(used)}
            if len(chosen) < 3:
                skewed[ways == "abc"] += [(node, e) for e in axes[~along.any(axis=1)]]
        held.nodes[node] = plain
    for node, left in held.nodes.items():  # rotations alone, which no line of body.toml holds
        if left and not left & set("xyz") and np.isin(node, numbering.sorted):
            skewed[True] += [(node, np.eye(3)["abc".index(c)]) for c in sorted(left)]
            held.nodes[node] = set()
    return [
        Guide(
            "supports by equations",
            numbering.positions([node for node, _ in pairs], "a constraint names"),
            np.array([e for _, e in pairs]),
            turning,
        )
        for turning, pairs in skewed.items()
        if pairs
    ]


def in_axes(where: str, nodes: Indices, first: Indices, factors: Array) -> Equation:
    """The equation of terms along directions of their own.

    Args:
        nodes: (t,) of the terms. first: (t,) 0 for a displacement, 3 for a rotation. factors: (t, 3) along x, y, z.
    """
    term, way = np.nonzero(np.abs(factors) > 1e-12 * np.abs(factors).max())
    return Equation(where, nodes[term], first[term] + way, factors[term, way], first=False)


def _in_order(directions: Iterable[str]) -> str:
    """Displacements x, y, z, then rotations a, b, c."""
    return "".join(sorted(directions, key="xyzabc".index))


def _turning(raw: RawMesh) -> Indices:
    """Positions of nodes without cells that constraints refer to: they have rotations."""
    named = [
        link.nodes if isinstance(link, Equation) else [link.reference]
        for link in raw.links
        if not isinstance(link, FaceTie | Guide)
    ]
    named += [[item.node] if isinstance(item, PointMass) else item.nodes for item in raw.lumps]
    used = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(nodes.ravel() for _, nodes in raw.blocks)]))
    return np.setdiff1d(joined(map(np.asarray, named)), used)
