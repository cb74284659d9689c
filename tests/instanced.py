"""Decks of parts and instances as a pre-processor writes them, and the same bodies flattened by hand."""

from __future__ import annotations

from dataclasses import dataclass, replace

import decks
import numpy as np
from scipy.spatial.transform import Rotation

from microslip.data import Array, Mesh


@dataclass(frozen=True)
class Placed:
    """An instance: a part, moved by `shift` (mm), then turned by `angle` (degrees) about the axis a to b (mm)."""

    name: str
    part: str
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    a: tuple[float, float, float] = (0.0, 0.0, 0.0)
    b: tuple[float, float, float] = (0.0, 0.0, 1.0)
    angle: float = 0.0

    def lines(self) -> list[str]:
        moved = ", ".join(map(repr, self.shift))
        turned = ", ".join(map(repr, (*self.a, *self.b, self.angle)))
        return [f"*Instance, name={self.name}, part={self.part}", moved, turned, "*End Instance"]

    def points(self, points: Array) -> Array:
        """(n, 3) m, where the instance stands."""
        a, b = np.array(self.a), np.array(self.b)
        turn = Rotation.from_rotvec(np.radians(self.angle) * (b - a) / np.linalg.norm(b - a)).as_matrix()
        return ((1e3 * points + self.shift - a) @ turn.T + a) / 1e3


def part_lines(name: str, mesh: Mesh, sets: tuple[str, ...], body: str = "Steel") -> list[str]:
    """A *PART with its section, node sets and a *SURFACE of every face of `sets` (named S-z0 and so on)."""
    own = [*decks.mesh_lines(mesh, sets=sets), f"*Solid Section, elset=EALL, material={body}", ","]
    return [f"*Part, name={name}", *own, *surfaces(mesh, sets), "*End Part"]


def surfaces(mesh: Mesh, sets: tuple[str, ...], prefix: str = "S-", first: int = 0) -> list[str]:
    """A *SURFACE, TYPE=ELEMENT of every face, cell by cell."""
    from microslip.mesh.deck_mesh import sides_of

    lines, number = [], first
    sides = {}
    for kind, cells in mesh.cells.items():
        for cell in cells:
            number += 1
            for i, corners in enumerate(sides_of(kind), 1):
                sides[frozenset(int(cell[c]) for c in corners)] = (number, i)
    for name in sets:
        lines.append(f"*Surface, type=ELEMENT, name={prefix}{name}")
        for facets in mesh.faces[name].values():
            corners = 3 if facets.shape[1] in (3, 6) else 4
            lines += ["{}, S{}".format(*sides[frozenset(map(int, f[:corners]))]) for f in facets]
    return lines


def instanced(parts: dict[str, list[str]], placed: list[Placed], inside: list[str], behind: list[str]) -> list[str]:
    """The whole deck: parts, the assembly with what stands in it, and what follows (materials, step)."""
    lines = ["*Heading", "two parts", "** a comment"]
    for part in parts.values():
        lines += part
    lines += ["*Assembly, name=Assembly"]
    for one in placed:
        lines += [*one.lines(), "**"]
    return [*lines, *inside, "*End Assembly", *behind]


def flattened(meshes: dict[str, Mesh], placed: list[Placed], sets: tuple[str, ...]) -> tuple[list[str], dict[str, int]]:
    """One flat deck of all instances, in mm, sets and surfaces named ``I_z0``, ``S_I_z0``; first number of each."""
    lines: list[str] = []
    first, cell = {}, 0
    number = 0
    for one in placed:
        mesh = meshes[one.part]
        first[one.name] = number
        moved = replace(mesh, points=one.points(mesh.points), node_id=number + np.arange(1, mesh.n_points + 1))
        own = decks.mesh_lines(moved)
        at = next(i for i, line in enumerate(own) if line.startswith("*ELEMENT"))
        lines += [own[0].replace("NALL", f"N_{one.name}"), *own[1:at]]
        for kind, cells in mesh.cells.items():
            lines.append(f"*ELEMENT, TYPE={decks.TYPES[kind]}, ELSET=E_{one.name}")
            before = cell
            for nodes in moved.node_id[cells]:
                cell += 1
                words = [str(cell), *map(str, nodes)]
                lines.append(",\n".join(", ".join(words[i : i + 15]) for i in range(0, len(words), 15)))
        for name in sets:
            lines += [f"*NSET, NSET={one.name}_{name}"] + [f"{i}," for i in moved.node_id[mesh.face_points(name)]]
        lines += surfaces(mesh, sets, f"S_{one.name}_", before)
        number += mesh.n_points
    return lines, first
