"""A small clamped box as a body folder: drawn by gmsh, meshed and solved within a second, for tests of the chain."""

from __future__ import annotations

from pathlib import Path

BUILD = """
import gmsh
from microslip.cad import name_body, name_face, run, surfaces_where

def draw(parameters, mesh):
    length, width, height = parameters["size"]
    gmsh.model.occ.addBox(-length / 2, -width / 2, 0, length, width, height)
    gmsh.model.occ.synchronize()
    name_body()
    name_face("clamp", surfaces_where(lambda centre, box: centre[2] < 1e-6))
    name_face("tip", surfaces_where(lambda centre, box: centre[2] > height - 1e-6))

if __name__ == "__main__":
    run(draw)
"""

BODY = """
name = "box"
description = "a clamped box"
length_unit = "mm"

[geometry]
build = "build.py"

[geometry.parameters]
size = [20.0, 30.0, 120.0]

[mesh]
size = 20.0

[material]
name = "steel"
density = 7850.0
young = 2.1e11
poisson = 0.3

[[supports]]
face = "clamp"

[[interfaces]]
name = "tip"
face = "tip"
t2 = [0.0, 1.0, 0.0]

[[excitations]]
name = "shaker"
point = [0.0, 0.0, 120.0]
direction = [1.0, 0.0, 0.0]

[[monitors]]
name = "tip"
point = [0.0, 0.0, 120.0]

[modes]
count = 6

[damping]
ratio = 0.01
"""

CASE = """
name = "box"
body = "box"
excitation = "shaker"
monitor = "tip"
direction = "x"
harmonics = 1

[[contacts]]
interface = "tip"
law = "jenkins"
normal_stiffness = 1e7
tangential_stiffness = 1e6
friction = 0.3

[sweep]
start = 500.0
stop = 3000.0
points = 12
normal_forces = [1.0, 100.0]
"""


def write_box(folder: Path, case: bool = True) -> Path:
    """Write the body (and its case) into a folder; returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "build.py").write_text(BUILD)
    (folder / "body.toml").write_text(BODY)
    if case:
        (folder / "case.toml").write_text(CASE)
    return folder


def edit(path: Path, old: str, new: str) -> None:
    """Replace a text that stands once in a file."""
    text = path.read_text()
    assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in {path}"
    path.write_text(text.replace(old, new))
