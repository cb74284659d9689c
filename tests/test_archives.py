"""Ansys archives beyond the plain mesh: turned nodes, contact, remote points, cyclic edges, dropped
mid-side nodes; each beside the same body written plainly, or beside CalculiX."""

from __future__ import annotations

import tomllib
from pathlib import Path

import decks
import meshes
import numpy as np
import pytest
import touching
from refusals import refused_command
from test_cdb import as_brick, archive
from test_public_decks import sector

from microslip.basis import read_basis
from microslip.cli import main
from microslip.data import Mesh
from microslip.frames import rotation


@pytest.fixture(autouse=True)
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def hertz(capsys, text: str, name: str = "a.cdb", k: int = 0, **more: str) -> np.ndarray:
    """Frequencies of an imported deck; what import said is left in `hertz.said`."""
    body = f"{Path(name).stem}-{abs(hash(text))}"
    Path(f"{body}{Path(name).suffix}").write_text(text)
    assert main(["import", f"{body}{Path(name).suffix}"]) == 0
    hertz.said = capsys.readouterr().out
    sets = [w for key, value in more.items() for w in ("--set", f"{key.replace('_', '.')}={value}")]
    assert main(["modes", body, "-q", "--set", "modes.solver=superlu", *sets]) == 0
    return read_basis(Path("build") / body / "basis.h5").groups[0, k].frequency


def block(cells=(2, 1, 2), size=(0.06, 0.011, 0.007), kind="hexahedron20") -> Mesh:
    return meshes.brick(kind, cells, size)


def turned_about(mesh: Mesh, axis, angle: float) -> Mesh:
    R = rotation(np.array(axis) / np.linalg.norm(axis), angle)
    return Mesh(mesh.points @ R.T, mesh.cells, mesh.faces, mesh.point_sets, mesh.node_id)


def ended(text: str, *lines: str) -> str:
    return text.replace("FINISH", "\n".join([*lines, "FINISH"]))


def numbers(mesh: Mesh, face: str) -> list[int]:
    return [int(n) for n in mesh.node_id[mesh.face_points(face)]]


SLIDING = ["CMSEL,S,X0", "D,ALL,UX", "CMSEL,S,Y0", "D,ALL,UY", "CMSEL,S,Z0", "D,ALL,UZ,,,,,UX"]


def test_supports_of_turned_nodes_are_those_of_the_body_before_it_was_turned(capsys):
    """Faces that slide, in a system turned by three angles: by NROTAT, and by angles of NBLOCK."""
    angles = (25.0, -40.0, 65.0)
    straight = hertz(capsys, ended(archive(block(), ("x0", "y0", "z0")), *SLIDING))
    from microslip.mesh.systems import axes_by_angles

    R = axes_by_angles(np.array(angles)).T
    mesh = block()
    moved = Mesh(mesh.points @ R.T, mesh.cells, mesh.faces, {}, mesh.node_id)
    text = archive(moved, ("x0", "y0", "z0"))
    system = ["LOCAL,12,0,0,0,0,25,-40,65", "CMSEL,S,X0", "CMSEL,A,Y0", "ALLSEL", "NROTAT,ALL"]
    turned = hertz(capsys, ended(text, *system, "CSYS,0", *SLIDING))
    np.testing.assert_allclose(turned, straight, rtol=1e-9)
    assert "nodes are held in directions of their own" in hertz.said
    lines = text.splitlines()
    at = lines.index("(3i9,6e21.13e3)") + 1
    for i in range(at, at + mesh.n_points):
        lines[i] += "".join(f"{a:21.13E}" for a in angles)
    by_node = hertz(capsys, ended("\n".join(lines) + "\n", *SLIDING))
    np.testing.assert_allclose(by_node, straight, rtol=1e-9)


def test_systems_are_written_in_two_ways_and_nodes_chosen_by_place(capsys):
    """A slice of a ring whose flat sides are held along theta: LOCAL in one line and in three, NSEL
    in the cylindrical system and components; CalculiX with a *TRANSFORM of the same nodes."""
    text = archive(sector(), ("y0", "y1"))
    plain = ["LOCAL,11,1,0,0,0,0,0,90"]
    blocked = ["LOCAL,R5.0,LOC,11,1,0,0,0", "LOCAL,R5.0,ANG,11,1,0,0,90", "CSYS,11"]
    named = [w for n in ("Y0", "Y1") for w in (f"CMSEL,S,{n}", "NROTAT,ALL", "D,ALL,UY")]
    placed = [
        *("NSEL,S,LOC,Y,165", "NSEL,A,LOC,Y,-165.01,-164.99", "CM,SIDES,NODE"),
        *("NROTAT,ALL", "CSYS,0", "ALLSEL", "D,SIDES,UY"),
    ]
    found = [hertz(capsys, ended(text, *lines)) for lines in ([*plain, *named], [*blocked, *placed])]
    np.testing.assert_allclose(found[0], found[1], rtol=1e-9)
    np.testing.assert_allclose(found[0][1:5], THETA, rtol=3e-6)


THETA = [303688.9, 951442.2, 1385611, 2577317]
"""Hz, CalculiX 2.20: the deck of `sector` with *TRANSFORM, TYPE=C about x on both sides, 2 held there."""
