"""What a file of another program holds: sets of points and the displacements that are zero there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from .raw import Numbering, RawMesh


@dataclass
class Constraints:
    """What the keywords of a file hold.

    Attributes:
        sets: set name -> directions out of x, y, z. nodes: node number -> directions.
        turned: numbers of nodes whose directions are those of a local system. all_turned: some may be, unknown which.
        left_out: what is not read, in words.
    """

    sets: dict[str, set[str]] = field(default_factory=dict)
    nodes: dict[int, set[str]] = field(default_factory=dict)
    turned: set[int] = field(default_factory=set)
    all_turned: bool = False
    left_out: list[str] = field(default_factory=list)

    def hold(self, where: str | int, directions: Iterable[str]) -> None:
        """Add a set or a node; no direction adds nothing."""
        if directions := set(directions):
            known: dict = self.nodes if isinstance(where, int) else self.sets
            known.setdefault(where, set()).update(directions)

    def clear(self) -> None:
        """Forget what was held before."""
        self.sets, self.nodes = {}, {}


def add_supports(raw: RawMesh, held: Constraints, numbering: Numbering) -> None:
    """Give `raw` the supports: named sets as they are; nodes held alike as the set that has just them, or a new one."""
    left_out = dict.fromkeys(held.left_out)
    for name, found in held.sets.items():
        directions = "".join(sorted(found))
        if held.all_turned and directions != "xyz":
            left_out[f"'{name}' is held in {directions} of what may be a local system"] = None
        elif name in raw.point_sets:
            raw.supports[name] = directions
    alike: dict[str, list[int]] = {}
    for node, found in held.nodes.items():
        if (held.all_turned or node in held.turned) and len(found) < 3:
            left_out[f"node {node} is held in {''.join(sorted(found))} of a local system"] = None
        elif not np.isin(node, numbering.sorted):
            left_out[f"node {node}, which the file does not define"] = None
        else:
            alike.setdefault("".join(sorted(found)), []).append(node)
    for directions, nodes in alike.items():
        members = np.unique(numbering.positions(np.array(nodes, dtype=np.int64), "a constraint names"))
        same = (n for n, s in raw.point_sets.items() if n not in raw.supports and np.array_equal(s, members))
        name = next(same, f"held {directions}")
        raw.add_points(name, members)
        raw.supports[name] = directions
    told = list(left_out)
    raw.not_held = told if len(told) <= 5 else [*told[:4], f"and {len(told) - 4} more like these"]
