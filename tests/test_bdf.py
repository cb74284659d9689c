"""Nastran bulk data: the node orders of its solid elements, which differ from VTK's on quadratic bricks and wedges."""

from __future__ import annotations

import re

import meshes
import numpy as np
import pytest
from refusals import refused_command

from microslip.data import Mesh
from microslip.errors import UserError
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
    """SPC1 and SPC by set; SPCADD; another set is left out, a displacement is zero in modes."""
    mesh = meshes.brick("hexahedron", (1, 1, 1), (0.02, 0.01, 0.03))
    cards = ["SPC1,7,123,1,THRU,3", "SPC,8,4,1,0.0,5,2,0.1", "SPC1,9,123456,8", "SPCADD,20,7,8"]
    lines = bulk(mesh).replace("CEND", "CEND\nSPC = 20").splitlines()
    lines = [line for line in lines if line != "ENDDATA"] + cards + ["ENDDATA"]
    (tmp_path / "a.bdf").write_text("\n".join(lines))
    read = read_mesh(tmp_path / "a.bdf", "m")
    named = {
        name: (directions, read.node_id[read.point_sets[name]].tolist()) for name, directions in read.supports.items()
    }
    assert named == {"SPC 7": ("xyz", [1, 2, 3]), "held x": ("x", [4]), "held y": ("y", [5])}
    (tmp_path / "a.bdf").write_text("\n".join(lines).replace("SPC = 20", "SUBCASE 1"))
    read = read_mesh(tmp_path / "a.bdf", "m")
    assert not read.supports and "several sets of SPC" in read.not_held[0]


def constrained(folder, cards, control=(), system=None):
    """A cube of two bricks with more cards."""
    text = bulk(meshes.brick("hexahedron", (1, 1, 2), (0.02, 0.01, 0.03)))
    text = text.replace("CEND", "\n".join(["CEND", *control])).replace("ENDDATA", "\n".join([*cards, "ENDDATA"]))
    (folder / "a.bdf").write_text(text)
    return read_mesh(folder / "a.bdf", "m", system)


def test_equations_hold_where_the_case_control_chooses_them(tmp_path):
    cards = ["MPC,5,9,1,1.0,10,1,-1.0"]
    assert constrained(tmp_path, cards, ["MPC = 5"]).links is not None
    both = constrained(tmp_path, [*cards, "MPC,6,11,1,1.0,12,1,-1.0"], ["SUBCASE 1", "MPC = 5", "SUBCASE 2", "MPC = 6"])
    assert "subcases choose several sets of MPC (5, 6); 5 is taken" in both.remarks[0]
    assert both.node_id[both.links.items[0].nodes].tolist() == [9, 10]
    left = constrained(tmp_path, cards)
    assert left.links is None and "the only set of MPC, of which the case control chooses none" in left.lost[0]
    assert "MPC = 6 of the case control is not defined" in constrained(tmp_path, [], ["MPC = 6"]).lost[0]


def test_a_deck_in_small_letters_is_the_same(tmp_path):
    """Nastran has no case; `thru` of an RBE2 left out all nodes between its ends."""
    cards = ["PARAM,WTMASS,0.5", "MAT1,1,2.1+11,,0.3,7.8D3", "PSOLID,1,1"]
    cards += ["SPC1,7,123,1,THRU,4", "RBE2,6,12,123,5,THRU,8"]
    large = constrained(tmp_path, cards, ["SPC = 7"], "m-kg-s")
    small = constrained(tmp_path, [card.lower() for card in cards], ["spc = 7"], "m-kg-s")
    for read in (small, large):
        assert read.node_id[read.links.items[-1].members].tolist() == [5, 6, 7, 8]
        assert read.node_id[read.point_sets["SPC 7"]].tolist() == [1, 2, 3, 4] and read.supports["SPC 7"] == "xyz"
        assert read.materials[0].density == 3900


@pytest.mark.parametrize(
    "card",
    [
        "RTRPLT,61,9,10,11,123456",
        "CTRIAX6,62,1,9,10",
        "CBAR,63,1,9,10,0.,0.,1.",
        "BCBODY,1,3D,DEFORM,3",
        "BCTABL1,1,2",
        "MFLUID,5,,,1.-9",
    ],
)
def test_cards_that_count_and_are_not_read_are_told_with_their_line(tmp_path, card):
    read = constrained(tmp_path, [card, "FORCE,1,9,0,1.0,1.0,0.0,0.0"])
    (told,) = read.lost
    assert re.match(rf"a.bdf, line \d+: {card.split(',')[0]} \(1 card\) is not read: .* frequencies will differ", told)
    assert told in mesh_problems(read)[1]


@pytest.mark.parametrize(
    ("card", "words"),
    [
        ("MAT9,2,1.+11", "MAT9 2 has a matrix that is not positive definite"),
        ("MAT8,2,1.+11,1.+10,.3,1.+9", "'MAT8 2'"),
    ],
)
def test_a_material_that_is_not_read_refuses_the_import(tmp_path, capsys, card, words):
    constrained(tmp_path, ["PSOLID,1,2"])
    text = (tmp_path / "a.bdf").read_text().replace("ENDDATA", f"{card}\nENDDATA")
    (tmp_path / "a.bdf").write_text(text)
    refused_command(["import", str(tmp_path / "a.bdf"), str(tmp_path / "out")], capsys, words)
    assert not (tmp_path / "out").exists()


def block(tmp_path, *cards: str, control=()) -> Mesh:
    """One brick whose grid points have the numbers 10, 20, ... 80, the lower ones 10 to 40, and
    further cards."""
    mesh = meshes.brick("hexahedron", (1, 1, 1))
    mesh = Mesh(mesh.points, mesh.cells, node_id=10 * np.arange(1, 9))
    text = (
        bulk(mesh)
        .replace("ENDDATA", "\n".join([*cards, "ENDDATA"]))
        .replace("CEND", "\n".join(["CEND", *control]))
    )
    (tmp_path / "a.bdf").write_text(text)
    return read_mesh(tmp_path / "a.bdf", "m")


def test_free_lines_longer_than_ten_fields_go_on(tmp_path):
    """All eight points are held; a mark in the tenth field is none of them; what may be either is
    refused."""
    for card in ("SPC1,7,123,10,20,30,40,50,60,70,80", "SPC1,7,123,10,20,30,40,50,60,+,70,80"):
        read = block(tmp_path, card)
        assert read.node_id[read.point_sets["SPC 7"]].tolist() == list(range(10, 90, 10))
    with pytest.raises(UserError, match=r"line \d+ has '70' in its field 10"):
        block(tmp_path, "SPC1,7,123,10,20,30,40,50,60,70")
    read = block(tmp_path, "SPC1,7,123,10,20,30,40,50,60,ABC", "+ABC,70,80")
    assert len(read.point_sets["SPC 7"]) == 8


def test_a_range_goes_over_numbers_that_are_no_grid_points(tmp_path):
    """SPC1 A THRU B and SET1 A THRU B BY C; a number of its own that is not there is a remark."""
    cards = ["SPC1,7,123,1,THRU,45", "SET1,9,10,THRU,90,BY,20", "SET1,8,10,11,80"]
    read = block(tmp_path, *cards, control=["SPC = 7"])
    assert (
        read.node_id[read.point_sets["SPC 7"]].tolist() == [10, 20, 30, 40]
        and read.supports["SPC 7"] == "xyz"
    )
    assert read.node_id[read.point_sets["SET 9"]].tolist() == [10, 30, 50, 70] and not read.not_held
    assert read.node_id[read.point_sets["SET 8"]].tolist() == [10, 80]
    assert read.remarks[0] == "the set 'SET 8' names node 11 that the file does not define: left out of it"


def test_what_bulk_data_holds_besides_is_named(tmp_path, capsys):
    """Loads, unknown cards; a layered solid refuses the import, where steel took its place."""
    read = block(tmp_path, "FORCE,1,10,0,1.0,1.0,0.0,0.0", "XYZZY,1", "EIGRL,1,,,8")
    assert "FORCE: loads, which change no frequency" in read.remarks[0] and "XYZZY: " in read.remarks[1]
    (told,) = block(tmp_path, "MATT9,1,5").lost
    assert "MATT9 (1 card) is not read" in told
    block(tmp_path, "PCOMPS,1,,,SB", "MAT1,1,2.1+11,,.3,7850.")
    line = ["import", str(tmp_path / "a.bdf"), str(tmp_path / "out"), "--unit", "m"]
    refused_command(line, capsys, "PCOMPS 1")
    assert not (tmp_path / "out").exists()


def test_a_solid_without_density_beside_others_weighs_nothing(tmp_path):
    """As in Nastran; a deck without any density gets that of --density or steel's."""
    mesh = meshes.brick("hexahedron", (1, 1, 2), (0.02, 0.01, 0.03))
    text = bulk(mesh).replace("CHEXA          2       1", "CHEXA          2       5")
    cards = ["PSOLID,1,1", "PSOLID,5,2", "MAT1,1,2.1+11,,.3,7800.", "MAT1,2,2.1+11,,.3,0."]
    (tmp_path / "a.bdf").write_text(text.replace("ENDDATA", "\n".join([*cards, "ENDDATA"])))
    read = read_mesh(tmp_path / "a.bdf", "m", "m-kg-s")
    np.testing.assert_allclose([m.density for m in read.materials], [7800, 7.8e-6])
    assert any("MAT1 2 has no density: its cells weigh nothing" in text for text in read.remarks)
