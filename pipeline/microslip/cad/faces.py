"""Choosing the faces of an imported body: the rules of [[geometry.faces]], and a table to write them from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import gmsh
import numpy as np

from microslip.cad.drawing import boundary_surfaces, name_face, surfaces_where, warn
from microslip.cad.imprint import lies_in
from microslip.cad.marks import Marks, short_name
from microslip.cad.solids import load
from microslip.errors import UserError
from microslip.mesh import UNITS


def name_picked(rules: Sequence[dict[str, Any]], marks: Marks) -> None:
    """Name the surfaces that each rule picks; rules of the same name add up."""
    named: dict[str, list[int]] = {}
    for rule in rules:
        picked = pick(rule, marks)
        if not picked:
            way = ", ".join(f"{k} = {v!r}" for k, v in rule.items() if k != "name" and v is not None)
            raise UserError(
                f"geometry.faces: no surface answers to {way} of face {rule.get('name')!r}; the file "
                f"has {len(marks)} surfaces, list them with: microslip info FILE"
            )
        named.setdefault(str(rule.get("name")), []).extend(picked)
    owner: dict[int, str] = {}
    for name, tags in named.items():
        for tag in sorted(set(tags)):
            if tag in owner:
                warn(f"surface {tag} belongs to the faces {owner[tag]!r} and {name!r}")
            owner[tag] = name
        name_face(name, tags)


def pick(rule: dict[str, Any], marks: Marks) -> list[int]:
    """Boundary surfaces that answer to a rule: label (whole, else a part of it), colour, box or surface tags."""
    tags = [tag for tag in boundary_surfaces() if tag in marks]
    if rule.get("label") is not None:
        whole = [tag for tag in tags if marks[tag][0] == rule["label"]]
        return whole or [tag for tag in tags if rule["label"] in marks[tag][0]]
    if rule.get("colour") is not None:
        wanted = np.array(rule["colour"])
        return [t for t in tags if (c := marks[t][1]) is not None and np.abs(wanted - c).max() <= 1]
    if rule.get("surfaces") is not None:
        return [tag for tag in tags if tag in rule["surfaces"]]
    if rule.get("box") is not None:
        return surfaces_where(lambda _, box: lies_in(box, np.reshape(rule["box"], (2, 3))))
    raise UserError(f"geometry.faces: face {rule.get('name')!r} needs one of label, colour, box, surfaces")


def table(path: Path, unit: str) -> str:
    """Solids and boundary surfaces of a CAD file, to choose faces from."""
    marks = load(path, unit)
    head = f"{'surface':>7} {'kind':<21} {'area':>10}  {'centre':<32} {'normal or radius':<20} {'colour':<12} label"
    solids = [solid_line(tag) for _, tag in gmsh.model.getEntities(3)]
    faces = [face_line(tag, *marks.get(tag, ("", None))) for tag in boundary_surfaces()]
    low, high = np.reshape(gmsh.model.getBoundingBox(-1, -1), (2, 3)).round(6)
    size = " x ".join(numbers([v]) for v in high - low)
    first = f"{path.name}, lengths in {unit}: {size}, from ({numbers(low)}) to ({numbers(high)})"
    return "\n".join([first, *solids, head, *faces])


def write_triangles(out: str, unit: str, coarse: bool = False) -> None:
    """Triangles on the boundary of the file that `table` has read, for a picture: points in m, triangles, surfaces.

    coarse: without regard to how much the surfaces bend.
    """
    box = np.reshape(gmsh.model.getBoundingBox(-1, -1), (2, 3))
    diagonal = float(np.linalg.norm(box[1] - box[0]))
    gmsh.option.setNumber("Mesh.MeshSizeMax", diagonal / 12)
    gmsh.option.setNumber("Mesh.MeshSizeMin", diagonal / 150)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 0 if coarse else 40)
    gmsh.option.setNumber("Mesh.AlgorithmSwitchOnFailure", 0)  # good enough to be looked at, see `drawing.generate`
    gmsh.model.mesh.generate(2)
    tags, xyz, _ = gmsh.model.mesh.getNodes()
    place = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    place[tags] = np.arange(len(tags))
    found = [(tag, gmsh.model.mesh.getElementsByType(2, tag)[1]) for tag in boundary_surfaces()]
    np.savez(
        out,
        points=xyz.reshape(-1, 3) * UNITS[unit],
        triangles=place[np.concatenate([nodes for _, nodes in found]).astype(np.int64)].reshape(-1, 3),
        surface=np.concatenate([np.full(len(nodes) // 3, tag) for tag, nodes in found]),
    )


def solid_line(tag: int) -> str:
    """One solid of the table."""
    name = short_name(3, tag)
    volume, centre = gmsh.model.occ.getMass(3, tag), numbers(gmsh.model.occ.getCenterOfMass(3, tag))
    return f"solid {tag}: volume {volume:.6g}, centre {centre}  {name}".rstrip()


def face_line(tag: int, label: str, colour: tuple[int, int, int] | None) -> str:
    """One surface of the table; planes with their outward normal, cylinders and spheres with their radius."""
    kind, area = gmsh.model.getType(2, tag), gmsh.model.occ.getMass(2, tag)
    normal = ""
    if kind == "Plane":
        corner = gmsh.model.getParametrizationBounds(2, tag)[0]
        normal = numbers(np.round(gmsh.model.getNormal(tag, corner), 3))
    elif kind in ("Cylinder", "Sphere"):
        middle = np.mean(gmsh.model.getParametrizationBounds(2, tag), axis=0)
        normal = f"radius {1 / gmsh.model.getCurvature(2, tag, middle)[0]:.5g}"
    centre, paint = numbers(gmsh.model.occ.getCenterOfMass(2, tag)), ",".join(map(str, colour or ()))
    return f"{tag:>7} {kind:<21} {area:>10.4g}  {centre:<32} {normal:<20} {paint:<12} {label}".rstrip()


def numbers(values: Iterable[float]) -> str:
    """Short decimals."""
    return " ".join(f"{0.0 if abs(v) < 1e-9 else v:.5g}" for v in values)
