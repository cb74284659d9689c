"""Parts of an assembly: the solids of one file as files of their own, and the patches where parts touch."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import gmsh
import numpy as np

from microslip.cad.drawing import boundary_surfaces
from microslip.cad.imprint import box_of, common_surfaces, meet
from microslip.cad.marks import short_name
from microslip.cad.solids import import_shapes, silent
from microslip.errors import UserError


def set_apart(file: str, folder: str) -> None:
    """Write every solid of a CAD file as a STEP file of its own, in mm, and print their names as JSON."""
    path = Path(file)
    import_shapes(path, "mm")
    solids = gmsh.model.getEntities(3)
    if len(solids) < 2:
        raise UserError(f"{path.name} holds {len(solids)} solid: there is nothing to set apart; leave --apart out")
    names = _names(solids)
    for number, name in enumerate(names):
        gmsh.clear()
        import_shapes(path, "mm")
        solids = gmsh.model.getEntities(3)
        gmsh.model.occ.remove([*solids[:number], *solids[number + 1 :]], recursive=True)
        gmsh.model.occ.synchronize()
        with silent():
            gmsh.write(str(Path(folder) / f"{name}.step"))
    print(json.dumps(names))


def _names(solids: Sequence[tuple[int, int]]) -> list[str]:
    """A name for each solid: its own where all have one that differs, else part-1 and so on."""
    own = [re.sub(r"[^A-Za-z0-9_.-]+", "-", short_name(*solid)).strip("-._")[:64] for solid in solids]
    numbered = [f"part-{i}" for i in range(1, len(solids) + 1)]
    told = all(own) and not any(name.startswith("Open-CASCADE") for name in own)  # which names what has no name
    return own if told and len({name.lower() for name in own}) == len(own) else numbered


def tell_touches(unit: str, *files: str) -> None:
    """Print, as JSON, where parts touch: see `touches`, and the corners and the box of each part, in `unit`."""
    parts = [_solids(Path(file), unit) for file in files]
    corners = [_corners(solids) for solids in parts]
    boxes = [_box([gmsh.model.getBoundingBox(*solid) for solid in solids]) for solids in parts]
    found = [
        {"parts": [i, j], **patch}
        for i, j in combinations(range(len(parts)), 2)
        for patch in touches(parts[i], parts[j])
    ]
    print(json.dumps({"corners": corners, "boxes": boxes, "touches": found}))


def _solids(path: Path, unit: str) -> list[tuple[int, int]]:
    before = set(gmsh.model.getEntities(3))
    import_shapes(path, unit)
    solids = [solid for solid in gmsh.model.getEntities(3) if solid not in before]
    if not solids:
        raise UserError(f"{path.name} holds no solid; close the body in the CAD program and export it as a solid")
    return solids


def _corners(solids: Sequence[tuple[int, int]]) -> list[list[float]]:
    points = gmsh.model.getBoundary(solids, combined=False, oriented=False, recursive=True)
    return [list(gmsh.model.getValue(0, tag, [])) for _, tag in points]


def touches(one: Sequence[tuple[int, int]], other: Sequence[tuple[int, int]]) -> list[dict[str, Any]]:
    """The patches that two parts have in common, the largest first: area, box (low and high corner), normal if flat.

    Flat pieces in one plane that meet are one patch, and so are curved pieces that meet.
    """
    pieces = [tag for _, tag in common_surfaces(boundary_surfaces(one), boundary_surfaces(other))]
    gmsh.model.occ.synchronize()
    groups: list[list[int]] = []
    for tag in pieces:
        near = [g for g in groups if any(_continues(tag, of) for of in g)]
        groups = [g for g in groups if g not in near] + [[tag, *(t for g in near for t in g)]]
    found = [_patch(group) for group in groups]
    gmsh.model.occ.remove([(2, tag) for tag in pieces], recursive=True)
    gmsh.model.occ.synchronize()
    return sorted(found, key=lambda patch: -patch["area"])


def _normal(tag: int) -> np.ndarray | None:
    """Of a plane; either of its two."""
    if gmsh.model.getType(2, tag) != "Plane":
        return None
    return np.array(gmsh.model.getNormal(tag, gmsh.model.getParametrizationBounds(2, tag)[0]))


def _continues(one: int, other: int) -> bool:
    n, m = _normal(one), _normal(other)
    along = n is None and m is None or n is not None and m is not None and abs(n @ m) > 1 - 1e-9
    return along and meet(box_of(one), box_of(other))


def _patch(group: Sequence[int]) -> dict[str, Any]:
    normal = _normal(group[0])
    return {
        "area": sum(gmsh.model.occ.getMass(2, tag) for tag in group),
        "box": _box([box_of(tag).ravel() for tag in group]),
        "normal": None if normal is None else list(normal),
    }


def _box(boxes: Sequence[Any]) -> list[float]:
    """The low and the high corner of all boxes."""
    low, high = np.split(np.array(boxes), 2, axis=1)
    return [*low.min(axis=0), *high.max(axis=0)]
