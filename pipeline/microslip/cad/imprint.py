"""Faces that a CAD file does not have: parts of its surface in a box, or where it touches another body."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import gmsh
import numpy as np

from microslip.cad.drawing import boundary_surfaces
from microslip.cad.marks import Marks
from microslip.cad.solids import import_shapes, lies_on, point_on
from microslip.errors import UserError
from microslip.files.store import ordinary

Pieces = list[tuple[int, int]]


def imprint(
    rules: Sequence[dict[str, Any]], marks: Marks, folder: Path, unit: str
) -> tuple[Marks, list[dict[str, Any]]]:  # fmt: skip
    """Cut the surface where a rule asks for a part of it (`cut`, `touching`).

    Returns:
        Label and colour of the boundary surfaces as they are now, and the rules with ``surfaces`` in their new numbers,
        which stand in the place of those two ways.

    Raises:
        UserError: a rule that cuts nothing out; two that ask for the same place.
    """
    occ, solids = gmsh.model.occ, gmsh.model.getEntities(3)
    tools: Pieces = []
    whose: list[int] = []
    for i, rule in enumerate(rules):
        if rule.get("cut") or rule.get("touching"):
            found = touching(rule, folder, unit) if rule.get("touching") else in_box(rule)
            if not found:
                raise UserError(f"geometry.faces: face {rule.get('name')!r}: no part of the surface {_where(rule)}")
            tools, whose = tools + found, whose + [i] * len(found)
    if not tools:
        return marks, list(rules)
    made, came = occ.fragment(solids, tools, removeObject=False, removeTool=True)
    occ.synchronize()
    new = [entity for entity in made if entity[0] == 3]
    skin = boundary_surfaces(new)
    heirs = {tag: next((old for old in marks if lies_on(old, point_on(tag))), 0) for tag in skin}
    cut: dict[int, list[int]] = {}
    for i, pieces in zip(whose, came[len(solids) :], strict=True):
        cut.setdefault(i, []).extend(tag for dim, tag in pieces if dim == 2 and tag in skin)
    _refuse_shared(rules, cut)
    taken = {tag for tags in cut.values() for tag in tags}
    occ.remove([solid for solid in solids if solid not in new], recursive=True)
    occ.synchronize()
    return (
        {tag: marks.get(old, ("", None)) for tag, old in heirs.items()},
        [_renumbered(rule, cut.get(i), heirs, taken) for i, rule in enumerate(rules)],
    )


def _where(rule: dict[str, Any]) -> str:
    words = [f"touches {rule['touching']}"] if rule.get("touching") else []
    words += ["lies in its box"] if rule.get("box") is not None else []
    return " and ".join(words)


def _refuse_shared(rules: Sequence[dict[str, Any]], cut: dict[int, list[int]]) -> None:
    owner: dict[int, str] = {}
    for i, tags in cut.items():
        name = str(rules[i].get("name"))
        for tag in tags:
            if owner.setdefault(tag, name) != name:
                raise UserError(f"geometry.faces: faces {owner[tag]!r} and {name!r} overlap; make their boxes smaller")


def _renumbered(rule: dict[str, Any], own: list[int] | None, heirs: dict[int, int], taken: set[int]) -> dict[str, Any]:
    """A rule whose surfaces are those that are there now; parts that were cut out belong to whom they were cut for."""
    if own is not None:
        return {"name": rule.get("name"), "surfaces": own}
    if rule.get("surfaces") is not None:
        if missing := sorted(set(rule["surfaces"]) - set(heirs.values())):
            raise UserError(
                f"geometry.faces: face {rule.get('name')!r}: there is no surface {', '.join(map(str, missing))}; list "
                "them with: microslip info FILE"
            )
        left = [tag for tag, old in heirs.items() if old in rule["surfaces"] and tag not in taken]
        return {**rule, "surfaces": left}
    return rule


def in_box(rule: dict[str, Any]) -> Pieces:
    """The parts of the surface inside a box."""
    occ = gmsh.model.occ
    low, high = np.reshape(rule["box"], (2, 3))
    box = [(3, occ.addBox(*low, *(high - low)))]
    surfaces = [tag for tag in boundary_surfaces() if meet(box_of(tag), np.array([low, high]))]
    found = [piece for tag in surfaces for piece in _common((2, tag), box)]
    occ.remove(box, recursive=True)
    return found


def touching(rule: dict[str, Any], folder: Path, unit: str) -> Pieces:
    """The parts of the surface that lie on the surface of another CAD file, in the same coordinates."""
    path, occ = folder / str(rule["touching"]), gmsh.model.occ
    if not ordinary(path).is_file():
        raise UserError(f"geometry.faces: face {rule.get('name')!r}: touching: there is no file {path}")
    mine, before = boundary_surfaces(), set(gmsh.model.getEntities(3))
    import_shapes(path, unit)
    others = [solid for solid in gmsh.model.getEntities(3) if solid not in before]
    found = common_surfaces(mine, boundary_surfaces(others))
    occ.remove(others, recursive=True)
    occ.synchronize()
    if rule.get("box") is None:
        return found
    left = [(dim, tag) for dim, tag in found if not lies_in(box_of(tag), np.reshape(rule["box"], (2, 3)))]
    occ.remove(left, recursive=True)
    occ.synchronize()
    return [piece for piece in found if piece not in left]


def common_surfaces(mine: Iterable[int], theirs: Sequence[int]) -> Pieces:
    """New surfaces, what two sets of surfaces have in common."""
    pairs = [(a, b) for a in mine for b in theirs if meet(box_of(a), box_of(b))]
    return [piece for a, b in pairs for piece in _common((2, a), [(2, b)])]


def box_of(surface: int) -> np.ndarray:
    """(2, 3) low and high corner."""
    return np.reshape(gmsh.model.getBoundingBox(2, surface), (2, 3))


def lies_in(one: np.ndarray, box: np.ndarray) -> bool:
    """Whether one box lies wholly in another; OpenCASCADE widens those of shapes by 1e-7."""
    near = 1e-6 * float(np.linalg.norm(box[1] - box[0])) + 2e-7
    return bool((one[0] >= box[0] - near).all() and (one[1] <= box[1] + near).all())


def meet(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two boxes have a point in common."""
    near = 1e-6 * float(np.linalg.norm(one[1] - one[0]))
    return bool((one[0] <= other[1] + near).all() and (other[0] <= one[1] + near).all())


def _common(surface: tuple[int, int], others: Pieces) -> Pieces:
    """What a surface and other shapes have in common: surfaces alone; where they just cross it is nothing.

    Of copies: a face that lies wholly on the other is a piece itself, and would go with its body.
    """
    occ = gmsh.model.occ
    pieces, _ = occ.intersect(occ.copy([surface]), occ.copy(others), removeObject=True, removeTool=True)
    occ.remove([piece for piece in pieces if piece[0] < 2], recursive=True)
    return [piece for piece in pieces if piece[0] == 2]
