"""Decks of parts and instances: the same body as flattened by hand, and as CalculiX has it."""

from __future__ import annotations

import decks
import instanced
import meshes
import numpy as np
import pytest
from instanced import Placed
from refusals import refused_command

from microslip.basis import read_basis
from microslip.cli import main
from microslip.mesh import read_mesh

PARTS = {
    "Root": meshes.brick("hexahedron20", (2, 2, 3), (0.01, 0.012, 0.03), to=meshes.shaken(0.0002)),
    "Vane": meshes.brick("wedge15", (1, 2, 3), (0.008, 0.015, 0.04)),
}
SETS = ("z0", "z1", "x1")
PLACED = [
    Placed("Root-1", "Root"),
    Placed("Vane-1", "Vane", (40.0, 5.0, 1.0), (1.0, 2.0, 3.0), (2.0, 3.0, 5.0), 33.0),
    Placed("Vane-2", "Vane", (-30.0, 0.0, 0.0)),
]
ENCASTRE = ["*BOUNDARY"] + [f"{p.name}.z0, ENCASTRE" for p in PLACED]


def deck(placed=PLACED, inside=(), behind=ENCASTRE, tail=()):
    parts = {name: instanced.part_lines(name, mesh, SETS) for name, mesh in PARTS.items()}
    return instanced.instanced(parts, placed, list(inside), [*decks.MATERIAL, *behind, *tail])


def modes(folder, name, monkeypatch, *more):
    """Frequencies (Hz) of a deck, from import to the modal file."""
    monkeypatch.chdir(folder)
    assert main(["import", f"{name}.inp"]) == 0
    assert main(["modes", name, "-q", "--set", "modes.count=8", *more]) == 0
    return read_basis(folder / "build" / name / "basis.h5").groups[0, 0].omega / 2 / np.pi


def write(folder, name, lines):
    (folder / f"{name}.inp").write_text("\n".join(lines) + "\n")


def test_instances_are_the_body_flattened_by_hand(tmp_path, monkeypatch, capsys):
    write(tmp_path, "two", deck())
    flat, _ = instanced.flattened(PARTS, PLACED, SETS)
    held = ["*BOUNDARY"] + [f"{p.name}_z0, 1, 3" for p in PLACED]
    sections = [decks.section(f"E_{p.name}") for p in PLACED]
    write(tmp_path, "flat", [*flat, *decks.MATERIAL, *sections, *held])
    ours = read_mesh(tmp_path / "two.inp", "mm")
    np.testing.assert_allclose(ours.points, read_mesh(tmp_path / "flat.inp", "mm").points, rtol=0, atol=1e-16)
    assert {"Root-1.z0", "Vane-2.z1", "Vane-2.S-x1"} <= set(ours.faces)
    found = modes(tmp_path, "two", monkeypatch)
    assert "supports of the file: Root-1.z0 in xyz, Vane-1.z0 in xyz, Vane-2.z0 in xyz" in capsys.readouterr().out
    np.testing.assert_allclose(found, modes(tmp_path, "flat", monkeypatch), rtol=1e-10)
    if decks.CCX is not None:
        step = decks.frequency_step(8)
        there = decks.run(tmp_path, "ccx", [*flat, *decks.MATERIAL, *sections, *held, *step])
        np.testing.assert_allclose(found, there[:8], rtol=1e-6)


def test_nodes_in_a_system_of_their_own_and_files_in_files(tmp_path):
    """*SYSTEM moves what follows it, until the next; cylindrical coordinates; an include in an include."""
    mesh = PARTS["Root"]
    lines = decks.mesh_lines(mesh)
    at = next(i for i, line in enumerate(lines) if line.startswith("*ELEMENT"))
    one = Placed("", "", (7.0, -2.0, 4.0), (0, 0, 0), (0, 0, 1.0), 90.0)
    axes = ["*SYSTEM", "7., -2., 4., 7., -1., 4.", "6., -2., 4.", *lines[:at], "*SYSTEM"]
    (tmp_path / "deep").mkdir()
    write(tmp_path / "deep", "nodes", axes[:9])
    write(tmp_path / "deep", "more", axes[9:])
    write(tmp_path / "deep", "first", ["*Include, input=nodes.inp", "*Include, input=more.inp"])
    write(tmp_path, "system", ["*INCLUDE, INPUT=deep/first.inp", *lines[at:], "*NODE, SYSTEM=C", "9999, 3., 90., 2."])
    found = read_mesh(tmp_path / "system.inp", "mm")
    turned = Placed("", "", (0, 0, 0), angle=90.0).points(mesh.points) + np.array(one.shift) / 1e3
    np.testing.assert_allclose(found.points, turned, rtol=0, atol=1e-15)


def test_first_order_bricks_lock_as_far_as_is_told(tmp_path, monkeypatch, capsys):
    """One layer in bending against the same bricks of second order, without lateral contraction; unused keywords."""
    lines = {"C3D8I": "hexahedron", "C3D20": "hexahedron20"}
    found = []
    for kind, cell in lines.items():
        mesh = meshes.brick(cell, (40, 1, 1), (0.4, 0.005, 0.005))
        own = [line.replace("TYPE=C3D8,", f"TYPE={kind},") for line in decks.mesh_lines(mesh, sets=("x0",))]
        steel = [line.replace("0.3", "0.0") for line in decks.MATERIAL]
        own += [*steel, decks.section(), "*BOUNDARY", "x0, 1, 3", "*DLOAD", "1, GRAV, 9.81, 0., 0., -1."]
        write(tmp_path, kind, own)
        found.append(modes(tmp_path, kind, monkeypatch)[0])
    told = capsys.readouterr().out
    assert "C3D8I are taken as C3D8: incompatible modes are left out" in told and "not used: *DLOAD" in told
    factor = float(told.split("stiffness is ")[1].split(" times")[0])
    assert factor == 3.0  # 1 + 2^2 / 2
    assert (found[0] / found[1]) ** 2 == pytest.approx(factor, rel=0.02)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("name=Vane-2", "name=Vane-1", "the *INSTANCE 'Vane-1' is there twice"),
        ("name=Root-1, part=Root", "name=Root-1, part=Rot", "names the part 'Rot', which the file does not define"),
        ("name=Root-1,", "", "has no NAME"),
        ("1.0, 2.0, 3.0, 2.0, 3.0, 5.0, 33.0", "1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 33.0", "has no length"),
        ("*End Assembly", "*Nset, nset=A, instance=Nobody\n1,\n*End Assembly", "the instance 'Nobody'"),
        ("*End Assembly", "*Include, input=two.inp\n*End Assembly", "includes itself by way of two.inp"),
        ("*End Assembly", "*Include, input=none.inp\n*End Assembly", "none.inp cannot be read"),
        ("*Part, name=Vane", "*Part, name=Root", "the *PART 'Root' is there twice"),
        ("*End Part\n", "", "the *PART has no *END PART before two.inp, line "),
        ("*End Instance\n", "", "the *INSTANCE has no *END INSTANCE before two.inp, line "),
        ("*End Assembly\n", "", "the *ASSEMBLY has no *END ASSEMBLY before the end"),
        ("*Assembly, name=Assembly\n", "", "the *INSTANCE stands outside of an *ASSEMBLY"),
        ("name=Root-1, part=Root", "name=Root-1", "names no PART and has no nodes"),
        ("40.0, 5.0, 1.0", "40.0, nan, 1.0", "not finite"),
    ],
)
def test_wrong_assemblies_are_told_with_file_and_line(tmp_path, monkeypatch, capsys, old, new, text):
    lines = "\n".join(deck())
    assert old in lines
    write(tmp_path, "two", lines.replace(old, new, 1).splitlines())
    monkeypatch.chdir(tmp_path)
    refused_command(["import", "two.inp"], capsys, text, "two.inp", "line ")
    assert not (tmp_path / "two").exists()


CUBE = meshes.brick("hexahedron20", (2, 1, 1), (0.02, 0.01, 0.01))


def stacked(*inside):
    """Two cubes, one on the other, with nodes at the same places."""
    part = instanced.part_lines("Cube", CUBE, SETS)
    half = ["*Surface, type=ELEMENT, name=Half", "1, S1"]
    lines = {"Cube": [*part[:-1], *half, part[-1]]}
    return instanced.instanced(
        lines, [Placed("A", "Cube"), Placed("B", "Cube", (0.0, 0.0, 10.0))], list(inside), [*decks.MATERIAL, *HOLD]
    )


HOLD = ["*BOUNDARY", "A.z0, ENCASTRE"]
TIE = ("*Tie, name=T", "B.Half, A.S-z1")


def test_touching_instances_tied_in_part_stay_apart_beside_the_tie(tmp_path, monkeypatch, capsys):
    """Their coincident points are no mistake, for info, import and modes; unjoined ones are told as parts."""
    write(tmp_path, "two", stacked(*TIE))
    found = modes(tmp_path, "two", monkeypatch)
    assert main(["info", "two.inp"]) == 0 and "coincide" not in "".join(capsys.readouterr())
    write(tmp_path, "whole", stacked("*Tie, name=T", "B.S-z0, A.S-z1"))
    assert found[0] < 0.95 * modes(tmp_path, "whole", monkeypatch)[0]  # merged nodes would give the whole's
    write(tmp_path, "loose", stacked())
    capsys.readouterr()
    assert main(["info", "loose.inp"]) == 0 and "falls into 2 parts" in capsys.readouterr().err


def test_a_bolt_that_is_one_body_with_what_it_holds_loses_its_preload_aloud(tmp_path, monkeypatch, capsys):
    bolt = ["*Node, nset=P", "1, 0., 0., 0.", "*Surface, type=ELEMENT, name=Cut", "B.1, S2"]
    bolt += ["*Pre-tension Section, surface=Cut, node=P"]
    write(tmp_path, "a", [*stacked(*TIE, *bolt), "*STEP", "*CLOAD", "P, 1, 500.", "*END STEP"])
    write(tmp_path, "b", stacked(*TIE, *bolt))
    monkeypatch.chdir(tmp_path)
    for name, text in (("a", "the preload of 500 N is not used: the bolt"), ("b", "has no *CLOAD on its node")):
        assert main(["import", f"{name}.inp"]) == 0
        assert any(text in t and t.startswith("warning: ") for t in capsys.readouterr().out.splitlines())


def test_an_import_repeated_into_its_folder_changes_nothing(tmp_path, monkeypatch, capsys):
    write(tmp_path, "two", stacked(*TIE))
    monkeypatch.chdir(tmp_path)
    assert main(["import", "two.inp", "Out"]) == 0
    before = (tmp_path / "Out" / "body.toml").read_bytes()
    capsys.readouterr()
    refused_command(["import", "two.inp", "Out"], capsys, "Out/body.toml: is there already")
    assert before == (tmp_path / "Out" / "body.toml").read_bytes() and not (tmp_path / "two-Out").exists()


def test_what_a_part_holds_is_held_in_each_of_its_instances(tmp_path):
    lines = stacked(*TIE)
    lines.insert(lines.index("*End Part"), "*Boundary\nx1, 2, 2")
    write(tmp_path, "two", lines)
    assert {"A.x1": "y", "B.x1": "y"}.items() <= dict(read_mesh(tmp_path / "two.inp", "mm").supports).items()
