"""Nastran bulk data: the node orders of its solid elements, which differ from VTK's on quadratic bricks and wedges."""

from __future__ import annotations

import meshes
import numpy as np
import pytest

from microslip.data import Mesh
from microslip.fem.discretise import discretise
from microslip.mesh import mesh_problems, read_mesh

# Quick Reference Guide: mid-side nodes of CHEXA on the lower edges, the upright ones, the upper ones; CPENTA likewise.
ORDER = {
    "hexahedron20": [*range(12), *range(16, 20), *range(12, 16)],
    "wedge15": [*range(9), 12, 13, 14, 9, 10, 11],
    **{kind: list(range(n)) for kind, n in (("tetra10", 10), ("hexahedron", 8), ("wedge", 6))},
    **{kind: list(range(n)) for kind, n in (("tetra", 4), ("pyramid", 5), ("pyramid13", 13))},
}
CARD = {"hex": "CHEXA", "wed": "CPENTA", "tet": "CTETRA", "pyr": "CPYRAM"}


def bulk(mesh: Mesh) -> str:
    """Wide GRID cards and elements in small fields."""
    lines = ["SOL 103", "CEND", "BEGIN BULK"]
    for number, (x, y, z) in zip(mesh.node_id, mesh.points, strict=True):
        lines += [f"{'GRID*':8}{number:16d}{'':16}{x:16.9E}{y:16.9E}", f"{'*':8}{z:16.9E}"]
    for kind, cells in mesh.cells.items():
        for number, cell in enumerate(cells, 1):
            words = [number, 1, *(int(mesh.node_id[cell[i]]) for i in ORDER[kind])]
            rows = ["".join(f"{w:8d}" for w in words[i : i + 8]) for i in range(0, len(words), 8)]
            lines.append(f"{CARD[kind[:3]]:8}" + f"+\n{'+':8}".join(rows))
    return "\n".join([*lines, "ENDDATA"]) + "\n"


@pytest.mark.parametrize("cell_type", ORDER)
def test_every_card_comes_back_as_its_cell(tmp_path, cell_type):
    """Bent cells: a wrong place of a mid-side node would change the volume. Cards print ten digits."""
    mesh = meshes.brick(cell_type, (2, 1, 2), (0.02, 0.01, 0.03), to=meshes.shaken(0.0007))
    (tmp_path / "a.bdf").write_text(bulk(mesh))
    read = read_mesh(tmp_path / "a.bdf", "m")
    np.testing.assert_array_equal(read.cells[cell_type], mesh.cells[cell_type])
    assert discretise(read).volume == pytest.approx(discretise(mesh).volume, rel=1e-9)
    assert not mesh_problems(read)[0]


def test_constraints_of_the_chosen_set_are_supports(tmp_path):
    """SPC1 and SPC by set, GRID's own; SPCADD; another set, a displacement and a local system are left out."""
    mesh = meshes.brick("hexahedron", (1, 1, 1), (0.02, 0.01, 0.03))
    cards = ["SPC1,7,123,1,THRU,3", "SPC,8,4,1,0.0,5,2,0.1", "SPC1,9,123456,8", "SPCADD,20,7,8"]
    lines = bulk(mesh).replace("CEND", "CEND\nSPC = 20").splitlines()
    lines = [line for line in lines if line != "ENDDATA"] + cards + ["ENDDATA"]
    (tmp_path / "a.bdf").write_text("\n".join(lines))
    read = read_mesh(tmp_path / "a.bdf", "m")
    named = {
        name: (directions, read.node_id[read.point_sets[name]].tolist()) for name, directions in read.supports.items()
    }
    assert named == {"SPC 7": ("xyz", [1, 2, 3]), "held x": ("x", [4])}
    assert read.not_held == ("SPC 8 displaces node 5",)
    (tmp_path / "a.bdf").write_text("\n".join(lines).replace("SPC = 20", "SUBCASE 1"))
    read = read_mesh(tmp_path / "a.bdf", "m")
    assert not read.supports and "several sets of SPC" in read.not_held[0]
