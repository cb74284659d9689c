"""The bolted joint of `drawn_joint`: from an Abaqus deck to CalculiX's modes and a friction response."""

from __future__ import annotations

import contextlib
import io
import subprocess
import sys
import tomllib
from pathlib import Path

import decks
import numpy as np
import pytest

from microslip.basis import read_basis
from microslip.cli import main

DRAWN = Path(__file__).parent / "drawn_joint.py"

# where the instances of the page stand, worked out by hand, mm
PLACES = {
    "Lower": lambda p: p,
    "Upper": lambda p: np.column_stack([170 - p[:, 0], 20 - p[:, 1], p[:, 2] + 5]),
    "Bolt": lambda p: np.column_stack([85 - p[:, 1], 10 + p[:, 0], p[:, 2] - 3]),
}


@pytest.fixture(scope="module")
def joint(tmp_path_factory):
    folder = tmp_path_factory.mktemp("joint")
    (folder / "joint").mkdir()
    subprocess.run([sys.executable, DRAWN], cwd=folder, check=True)
    return folder


def parts(folder: Path) -> dict[str, dict[str, list[str]]]:
    """Part -> first words of a keyword line -> its data lines."""
    found: dict[str, dict[str, list[str]]] = {}
    for line in (folder / "joint" / "parts.inp").read_text().splitlines():
        if line.startswith("*Part"):
            blocks = found.setdefault(line.split("=")[1], {})
        if line.startswith("*"):
            lines = blocks.setdefault(
                line.split("=")[-1] if "Surface" in line or "Nset" in line else line.split(",")[0], []
            )
        else:
            lines.append(line)
    return found


def flat(folder: Path, names: list[str]) -> list[str]:
    """Some of the instances as one flat deck: node n of the k-th is n + 1000 k, sets and surfaces end in its name."""
    lines = []
    for k, name in enumerate(names):
        own = parts(folder)["Bolt" if name == "Bolt" else "Plate"]
        table = np.array([[float(w) for w in line.split(",")] for line in own["*Node"]])
        points = PLACES[name](table[:, 1:])
        lines += [
            "*NODE",
            *(
                f"{int(n) + 1000 * k}, {x!r}, {y!r}, {z!r}"
                for n, (x, y, z) in zip(table[:, 0], points.tolist(), strict=True)
            ),
        ]
        lines.append(f"*ELEMENT, TYPE=C3D20, ELSET=E{name}")
        for line in own["*Element"]:
            words = line.rstrip(",").split(",")
            lines.append(", ".join(str(int(w) + 1000 * k) for w in words) + ("," if line.endswith(",") else ""))
        for face in ("Top", "Bottom") if name != "Bolt" else ("Head", "Nut"):
            lines.append(f"*SURFACE, NAME={face}{name}, TYPE=ELEMENT")
            lines += [f"{int(line.split(',')[0]) + 1000 * k}, {line.split(',')[1]}" for line in own[face]]
        lines += [f"*NSET, NSET=End{name}", *(f"{int(line[:-1]) + 1000 * k}," for line in own["End"])]
        lines += [decks.section(f"E{name}")]
    return [*lines, *decks.MATERIAL]


@pytest.fixture(scope="module")
def told(joint):
    """What import says of the deck."""
    with contextlib.chdir(joint), contextlib.redirect_stdout(io.StringIO()) as said:
        assert main(["import", "joint/joint.inp", "bolted"]) == 0
    return said.getvalue()


def modes(folder: Path, name: str) -> np.ndarray:
    """Hz, of a body of the joint, motions without stiffness left out."""
    with contextlib.chdir(folder):
        assert main(["modes", f"bolted/{name}", "-q"]) == 0
    omega = read_basis(folder / "build" / f"bolted-{name}" / "basis.h5").groups[0, 0].omega
    return omega[omega > 0] / 2 / np.pi


def test_import_tells_what_a_deck_becomes(joint, told):
    for line in DRAWN.with_suffix(".txt").read_text().strip().splitlines():
        assert line in told, line
    case = tomllib.loads((joint / "bolted" / "case.toml").read_text())
    assert case["sweep"]["normal_forces"] == [800] and [c["friction"] for c in case["contacts"]] == [0.15, 0.15]
    assert tomllib.loads((joint / "bolted" / "Lower" / "body.toml").read_text())["supports"][0]["face"] == "Wall"


@pytest.mark.skipif(decks.CCX is None, reason="needs CalculiX")
def test_bodies_of_a_deck_have_the_modes_of_calculix(joint, told):
    """A plate held by its reference node; the other one with the bolt tied to it and an equation, free."""
    clamp = ["*NODE, NSET=Wall", "9001, -5., 10., 2.5", "*SURFACE, NAME=Foot, TYPE=NODE", "EndLower"]
    clamp += [
        "*COUPLING, CONSTRAINT NAME=C, REF NODE=9001, SURFACE=Foot",
        "*KINEMATIC",
        "1, 3",
        "*BOUNDARY",
        "Wall, 1, 6",
    ]
    there = decks.run(joint, "lower", [*flat(joint, ["Lower"]), *clamp, *decks.frequency_step(10)])
    np.testing.assert_allclose(modes(joint, "Lower")[:10], there[:10], rtol=1e-6)
    tied = ["*TIE, NAME=T, POSITION TOLERANCE=0.1", "HeadBolt, TopUpper", "*EQUATION", "2", "1, 3, 1., 33, 3, -1."]
    there = decks.run(joint, "upper", [*flat(joint, ["Upper", "Bolt"]), *tied, *decks.frequency_step(16)])
    ours = modes(joint, "Upper-Bolt")[:10]
    np.testing.assert_allclose(ours, there[there > 10.0][: len(ours)], rtol=1e-6)


@pytest.mark.slow
def test_a_deck_ends_in_a_friction_response(joint, told, undrawn, unjudged, monkeypatch):
    monkeypatch.chdir(joint)
    keys = ["sweep.start=500", "sweep.stop=530", "sweep.points=3", "harmonics=1", "samples=16"]
    words = [word for key in keys for word in ("--set", key)]
    assert main(["run", "bolted", "-q", "--no-stress", "--no-pictures", *words]) == 0
    rows = (joint / "build" / "bolted" / "response.csv").read_text().splitlines()
    assert len(rows) > 3 and np.isfinite(float(rows[1].split(",")[1]))
