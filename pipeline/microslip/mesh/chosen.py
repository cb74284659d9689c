"""Some instances of a deck as a mesh of their own, and which instances hang together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from ..data import Equation, FaceTie, Guide, Indices, Link, Lumps, Mesh
from ..errors import UserError
from .gates import part_numbers
from .linking import moved
from .raw import joined


def with_parts(mesh: Mesh) -> Mesh:
    """The mesh with its instances; of a file without any, parts that share no points are called so.

    A part has the name of the point set that is just it, else ``part-1``, ``part-2`` in the order
    of the file.
    """
    if mesh.instances:
        return mesh
    numbers, named = part_numbers(mesh), {}
    for part in range(numbers.max() + 1):
        points = np.flatnonzero(numbers == part)
        alike = (
            name for name, s in mesh.point_sets.items() if np.array_equal(np.unique(s), points)
        )
        named[next(alike, f"part-{part + 1}")] = points
    return replace(mesh, instances=named)


def of_instances(mesh: Mesh, names: Sequence[str]) -> Mesh:
    """The mesh of these instances (see `with_parts`) alone, with their sets and constraints.

    Raises:
        UserError: an instance that the file does not have, a constraint that ties them to others.
    """
    mesh = with_parts(mesh)
    unknown = [name for name in names if name not in mesh.instances]
    if unknown:
        raise UserError(f"has no instance '{unknown[0]}'; its instances are {', '.join(mesh.instances) or 'none'}")
    inside = np.zeros(mesh.n_points, dtype=bool)
    inside[np.concatenate([mesh.instances[name] for name in names])] = True
    inside |= _hanging_on(mesh, inside)
    left = [] if mesh.state is None or inside.all() else [f"{mesh.state.where}: {_LOADS_OF_PARTS}"]
    kept = {kind: inside[cells].all(axis=1) for kind, cells in mesh.cells.items()}
    cells = {kind: cells[kept[kind]] for kind, cells in mesh.cells.items() if kept[kind].any()}
    number = np.cumsum(inside) - 1
    faces: dict[str, dict[str, Indices]] = {}
    for name, blocks in mesh.faces.items():
        if face := {t: number[f[own]] for t, f in blocks.items() if (own := inside[f].all(axis=1)).any()}:
            faces[name] = face
    sets = {name: number[s[inside[s]]] for name, s in mesh.point_sets.items()}
    sets = {name: s for name, s in sets.items() if len(s)}
    part = replace(
        mesh, points=mesh.points[inside], cells={t: number[c] for t, c in cells.items()}, faces=faces,
        point_sets=sets, node_id=mesh.node_id[inside],
        regions={t: r[kept[t]] for t, r in mesh.regions.items() if kept[t].any()},
        cell_id={t: r[kept[t]] for t, r in mesh.cell_id.items() if kept[t].any()},
        temperature=None if mesh.temperature is None else mesh.temperature[inside],
        instances={name: number[mesh.instances[name]] for name in names},
        state=mesh.state if inside.all() else None, lost=(*mesh.lost, *left),
        lumps=_lumps_of(mesh, inside, number),
    )  # fmt: skip
    return _with_links(mesh, part, inside, number)


_LOADS_OF_PARTS = "its loads are left out of parts of the file: the modes are those of the unloaded body"


def _hanging_on(mesh: Mesh, inside: Indices) -> Indices:
    """(n,) which points without cells follow points inside, or hang on them by springs."""
    loose, grown = np.ones(mesh.n_points, dtype=bool), inside.copy()
    for cells in mesh.cells.values():
        loose[cells] = False
    if mesh.lumps is None or not loose.any():
        return np.zeros(mesh.n_points, dtype=bool)
    groups = [*(nodes_of(mesh) if mesh.links is not None else ()), *mesh.lumps.pairs]
    for _ in range(3):  # a mass on a spring on a point that follows a node
        for nodes in groups:
            if grown[nodes].any():
                grown[nodes[loose[nodes]]] = True
    return grown & loose


def _lumps_of(mesh: Mesh, inside: Indices, number: Indices) -> Lumps | None:
    """The masses, springs and dashpots of the points inside, counted anew.

    Raises:
        UserError: one that joins them to others.
    """
    if (lumps := mesh.lumps) is None:
        return None
    ends = inside[lumps.pairs]
    if (ends.any(axis=1) & ~ends.all(axis=1)).any():
        raise UserError("a spring or dashpot of the file ties these instances to others; take those in too")
    heavy, joined_by = inside[lumps.points], ends.all(axis=1)
    turned = inside[lumps.lines].all(axis=1)
    if not heavy.any() and not joined_by.any():
        return None
    return Lumps(
        number[lumps.points[heavy]],
        lumps.masses[heavy],
        number[lumps.pairs[joined_by]],
        lumps.stiffness[joined_by],
        lumps.damping[joined_by],
        number[lumps.lines[turned]],
        lumps.tight[turned],
    )


def _with_links(mesh: Mesh, part: Mesh, inside: Indices, number: Indices) -> Mesh:
    """The part with the constraints that are its own."""
    if mesh.links is None:
        return replace(part, supports={n: d for n, d in mesh.supports.items() if n in part.point_sets})
    own, after = [], np.arange(len(mesh.links.references)) + part.n_points
    number = np.concatenate([number, after])
    for link, nodes in zip(mesh.links.items, nodes_of(mesh), strict=True):
        there = inside[nodes]
        if there.any() and not there.all():
            raise UserError(f"{link.where} ties these instances to others; take those in too")
        if there.any():
            own.append(moved(link, number))
    used = {n - part.n_points for link in own for n in _references(link) if n >= part.n_points}
    sets = {name: s for name, s in mesh.links.sets.items() if np.isin(s, list(used)).all()}
    places = np.concatenate([inside, np.isin(np.arange(len(mesh.links.references)), list(used))])
    for guide in (link for link in mesh.links.items if isinstance(link, Guide)):
        if (there := places[guide.nodes]).any():
            cut = replace(guide, nodes=guide.nodes[there], axes=guide.axes[there])
            own.append(moved(cut, number))
    links = replace(mesh.links, items=tuple(own), sets=sets) if own else None
    known = {*part.point_sets, *(links.sets if links else ())}
    return replace(part, links=links, supports={n: d for n, d in mesh.supports.items() if n in known})


def _references(link: Link) -> list[int]:
    """Nodes of a link that may be reference nodes."""
    if isinstance(link, FaceTie | Guide):
        return []
    return link.nodes.tolist() if isinstance(link, Equation) else [link.reference]


def nodes_of(mesh: Mesh) -> list[Indices]:
    """Points that each link takes in, those behind its reference nodes too."""
    assert mesh.links is not None
    named = [_named(mesh, link) for link in mesh.links.items]
    behind = {int(n): np.zeros(0, dtype=np.int64) for nodes in named for n in nodes[nodes >= mesh.n_points]}

    def points_of(nodes: Indices) -> Indices:
        return np.unique(joined([nodes[nodes < mesh.n_points], *(behind[int(n)] for n in nodes if n in behind)]))

    for _ in range(2):  # what a reference node moves, and what moves with that
        for nodes in named:
            points = points_of(nodes)
            behind.update({int(n): np.union1d(behind[int(n)], points) for n in nodes if n in behind})
    return [points_of(nodes) for nodes in named]


def _named(mesh: Mesh, link: Link) -> Indices:
    """Points and reference nodes that a link names, but supports, which join nothing."""
    if isinstance(link, Guide):
        return np.zeros(0, dtype=np.int64)
    if isinstance(link, Equation):
        return link.nodes
    members = [link.slave, link.master] if isinstance(link, FaceTie) else [link.members]
    sets = {*mesh.faces, *mesh.point_sets}
    points = [mesh.set_points(m) if isinstance(m, str) else m for m in members if not isinstance(m, str) or m in sets]
    return joined([*points, np.array(_references(link), dtype=np.int64)])


def bodies(mesh: Mesh) -> list[list[str]]:
    """Instances (see `with_parts`) that constraints and springs hold together, in the order of the file."""
    mesh = with_parts(mesh)
    names = list(mesh.instances)
    of = len(names) + np.arange(mesh.n_points)  # points without cells stand for themselves
    for number, name in enumerate(names):
        of[mesh.instances[name]] = number
    joining = [*(nodes_of(mesh) if mesh.links else ()), *(mesh.lumps.pairs if mesh.lumps else ())]
    pairs = [np.unique(of[nodes]) for nodes in joining]
    edges = [(p[0], q) for p in pairs if len(p) for q in p]
    rows, columns = np.array(edges, dtype=int).reshape(-1, 2).T
    graph = sp.coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(size := len(names) + mesh.n_points, size))
    group = connected_components(graph, directed=False)[1][: len(names)]
    return [[n for n, g in zip(names, group, strict=True) if g == number] for number in dict.fromkeys(group.tolist())]
