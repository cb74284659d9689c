"""The small meshes of meshes/tiny: `python tests/kept.py` (with PYTHONPATH=pipeline) writes them again."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import decks
import numpy as np
import sector
import touching
from meshes import brick, pipe, twisted_blade
from test_archives import ended, pairs
from test_bdf import bulk
from test_cdb import archive

from microslip.data import Mesh
from microslip.mesh.msh import _TYPES, to_vtk

TINY = Path(__file__).resolve().parents[1] / "meshes" / "tiny"
NASTRAN = ["PSOLID         1       1", "MAT1           1 210000.              .3 7.85E-9"]


def named(mesh: Mesh, **names: str) -> Mesh:
    """With points in whole 1e-5 mm, which every format prints, and these of its faces under other names."""
    faces = {new: mesh.faces[old] for new, old in names.items()}
    return Mesh(np.round(1e3 * mesh.points, 5) / 1e3, mesh.cells, faces, {}, mesh.node_id)


def blade() -> Mesh:
    return named(twisted_blade("hexahedron20", (1, 2, 5)), root="z0", tip="z1")


def half_pipe() -> Mesh:
    return named(pipe("hexahedron20", (1, 5, 4), 0.045, 0.05, 0.3, np.pi), front="z0")


def cyclic_sector() -> Mesh:
    return named(
        sector.mesh(12), **{name: name for name in ("bore", "rim", "cyclic_left", "cyclic_right")}
    )


def plate(second: bool) -> Mesh:
    """120 x 30 x 4 mm; the second one lies on the last third of the first."""
    mesh = brick(
        "hexahedron20", (6, 2, 1), (0.12, 0.03, 0.004), (0.08 * second, 0.0, 0.004 * second)
    )
    return named(mesh, clamp="x1" if second else "x0")


def lap() -> Mesh:
    """Both plates in one file, unjoined."""
    sides = [
        brick("hexahedron20", (6, 2, 1), (0.12, 0.03, 0.004), at)
        for at in ((0, 0, 0), (0.08, 0, 0.004))
    ]
    return touching.together(
        lower=named(sides[0], clamp="x0", top="z1"), upper=named(sides[1], clamp="x1", below="z0")
    )


PAIR = [
    *(
        "*SURFACE, NAME=UPPER, TYPE=NODE",
        "upper_below",
        "*SURFACE, NAME=LOWER, TYPE=NODE",
        "lower_top",
    ),
    *(
        "*SURFACE INTERACTION, NAME=DRY",
        "*FRICTION",
        "0.15",
        "*CONTACT PAIR, INTERACTION=DRY",
        "UPPER, LOWER",
    ),
    *("*BOUNDARY", "lower_clamp, 1, 3", "upper_clamp, 1, 3"),
]


def deck(mesh: Mesh, *more: str) -> str:
    lines = [
        *decks.mesh_lines(mesh, sets=tuple(mesh.faces)),
        *decks.MATERIAL,
        decks.section(),
        *more,
    ]
    return "\n".join(lines) + "\n"


def gmsh_41(mesh: Mesh) -> str:
    """MSH 4.1 as text, in mm: one volume, a surface a face."""
    low, high = (
        "{} {} {}".format(*ends(1e3 * mesh.points))
        for ends in (lambda x: x.min(0), lambda x: x.max(0))
    )
    kinds, faces = {name: number for number, name in _TYPES.items()}, list(mesh.faces)
    blocks = [(2, i, mesh.faces[name]) for i, name in enumerate(faces, 1)] + [(3, 1, mesh.cells)]
    lines = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(faces) + 1)]
    lines += [f'2 {i} "{name}"' for i, name in enumerate(faces, 1)] + [
        '3 1 "body"',
        "$EndPhysicalNames",
        "$Entities",
    ]
    lines += [
        f"0 0 {len(faces)} 1",
        *(f"{i} {low} {high} 1 {i} 0" for i in range(1, len(faces) + 1)),
    ]
    lines += [f"1 {low} {high} 1 1 0", "$EndEntities", "$Nodes"]
    n = mesh.n_points
    lines += [f"1 {n} 1 {n}", f"3 1 0 {n}", *map(str, decks.ids(mesh))]
    lines += [" ".join(map(repr, x)) for x in (1e3 * mesh.points).round(5).tolist()] + [
        "$EndNodes",
        "$Elements",
    ]
    count = sum(len(c) for _, _, cells in blocks for c in cells.values())
    lines.append(f"{sum(len(cells) for _, _, cells in blocks)} {count} 1 {count}")
    number = 0
    for dimension, tag, cells in blocks:
        for kind, rows in cells.items():
            lines.append(f"{dimension} {tag} {kinds[kind]} {len(rows)}")
            order = np.argsort(to_vtk(kind)) if dimension == 3 else np.arange(rows.shape[1])
            for row in rows[:, order] + 1:
                number += 1
                lines.append(" ".join(map(str, [number, *row])))
    return "\n".join([*lines, "$EndElements"]) + "\n"


def nastran(mesh: Mesh, *held: str) -> str:
    """held: faces of SPC 1."""
    in_mm = Mesh(1e3 * mesh.points, mesh.cells, {}, {}, mesh.node_id)
    nodes = [str(mesh.node_id[i]) for name in held for i in mesh.face_points(name)]
    supports = [",".join(["SPC1", "1", "123", *nodes[i : i + 6]]) for i in range(0, len(nodes), 6)]
    text = bulk(in_mm).replace("ENDDATA", "\n".join([*NASTRAN, *supports, "ENDDATA"]))
    return text.replace("CEND", "CEND\nSPC = 1") if held else text


def ansys(mesh: Mesh) -> str:
    """Both plates, held, with frictional contact."""
    material = ("MP,EX,1,210000", "MP,NUXY,1,0.3", "MP,DENS,1,7.85E-9", "MP,MU,3,0.15")
    held = [w for n in ("LOWER", "UPPER") for w in (f"CMSEL,S,{n}_CLAMP", "D,ALL,ALL")]
    text = archive(mesh, ("lower_clamp", "upper_clamp"), material)
    return ended(text, *pairs(mesh, "upper_below", "lower_top"), *held)


def files() -> Iterator[tuple[str, str]]:
    yield "blade.msh", gmsh_41(blade())
    yield "blade.inp", deck(blade())
    yield "blade.bdf", nastran(blade())
    yield "blade.cdb", archive(blade(), sets=("root", "tip"))
    yield "sector.inp", deck(cyclic_sector())
    yield "half-pipe.bdf", nastran(half_pipe())
    yield "lap-a.inp", deck(plate(False))
    yield "lap-b.cdb", archive(plate(True), sets=("clamp",))
    yield "lap.inp", deck(lap(), *PAIR)
    yield "lap.cdb", ansys(lap())
    yield "lap.bdf", nastran(lap(), "lower_clamp", "upper_clamp")


if __name__ == "__main__":
    for name, text in files():
        (TINY / name).write_text(text)
