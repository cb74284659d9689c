"""Nastran's glued and touching regions: ties and joints, as the case control chooses them."""

from __future__ import annotations

from pathlib import Path

import meshes
import numpy as np
import pytest
from refusals import refused_command
from test_nastran_systems import bulk, hertz

from microslip.cli import main
from microslip.data import Mesh
from microslip.mesh import read_mesh

WHOLE = meshes.brick("hexahedron20", (2, 1, 1), (0.04, 0.01, 0.008))


@pytest.fixture(autouse=True)
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def parted() -> tuple[Mesh, list[str]]:
    """The two bricks of WHOLE without common nodes, and the cards of the two faces that touch."""
    cells = WHOLE.cells["hexahedron20"]
    points = np.concatenate([WHOLE.points[cell] for cell in cells])
    mesh = Mesh(points, {"hexahedron20": np.arange(40).reshape(2, 20)}, node_id=np.arange(1, 41))
    faces = [[n + 1 for n in range(20 * k, 20 * k + 8) if abs(points[n, 0] - 0.02) < 1e-9] for k in (0, 1)]
    return mesh, [f"BSURFS,{k + 5},,,,{k + 1},{','.join(map(str, faces[k][:3]))}" for k in (0, 1)]


def deck(*cards: str, control=("SPC=7",)) -> str:
    mesh, regions = parted()
    held = ",".join(str(n) for n, x in zip(mesh.node_id, mesh.points, strict=True) if x[0] == 0)
    return bulk(mesh, f"SPC1,7,123,{held}", *regions, *cards, control=control)


def whole() -> str:
    held = ",".join(str(n) for n, x in zip(WHOLE.node_id, WHOLE.points, strict=True) if x[0] == 0)
    return bulk(WHOLE, f"SPC1,7,123,{held}", control=("SPC=7",))


GLUED = [
    (["BGSET,9,5,6"], ("SPC=7", "BGSET = 9")),
    (["BGADD,8,9", "BGSET,9,5,6"], ("SPC=7", "BGSET = 8")),
    (["BCTSET,9,5,6,.2", "BCTPARA,9,TIED,1"], ("SPC=7", "BCSET = 9")),
]


@pytest.mark.parametrize(("cards", "control"), GLUED)
def test_glued_bricks_are_one_body(cards, control):
    """The nodes lie upon each other, so the tie is the welded body."""
    np.testing.assert_allclose(hertz(deck(*cards, control=control)), hertz(whole(), "b"), rtol=1e-9)


def test_a_tie_that_the_case_control_does_not_choose_is_told():
    Path("a.bdf").write_text(deck("BGSET,9,5,6"))
    read = read_mesh("a.bdf", "m")
    assert read.links is None and "the case control chooses none (BGSET = n)" in read.remarks[0]


def test_bricks_that_touch_become_two_bodies_with_a_contact(capsys):
    Path("a.bdf").write_text(deck("BCTSET,9,5,6,.3", control=("SPC=7", "BCSET = 9")))
    assert main(["import", "a.bdf", "two", "--unit", "m"]) == 0
    assert "BCTSET 9" in capsys.readouterr().out
    text = "".join(p.read_text() for p in Path("two").rglob("*.toml"))
    assert text.count("[geometry]") + text.count("geometry") >= 2 and "0.3" in text


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("BGSET,9,5,6", "BGSET,9,5,66", "BGSET 9 names the region 66"),
        ("BSURFS,5,,,,1", "BSURFS,5,,,,77", "no face of the solid 77"),
        ("BSURFS,5,,,,1", "BSURF,5,1,,,", "loads element 1"),
    ],
)
def test_damaged_regions_are_refused_with_their_line(capsys, old, new, words):
    text = deck("BGSET,9,5,6", control=("SPC=7", "BGSET = 9")).replace(old, new)
    Path("a.bdf").write_text(text)
    line = next(i for i, t in enumerate(text.splitlines(), 1) if t.startswith(new.rstrip(",")))
    refused_command(["import", "a.bdf", "body", "--unit", "m"], capsys, f"a.bdf, line {line}", words)
