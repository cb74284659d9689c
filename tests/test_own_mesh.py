"""A user's own mesh goes through the same body.toml whatever its format: the same frequencies from each."""

from __future__ import annotations

import subprocess
import sys
from functools import cache

import pytest

from microslip.modal.compute import modal_basis
from microslip.stages.job import open_job
from microslip.stages.meshing import load_mesh, mesh_stage

DRAW = """
import gmsh, sys
gmsh.initialize(interruptible=False)
gmsh.option.setNumber("General.Terminal", 0)
gmsh.model.occ.addBox(0, 0, 0, 10, 12, 30)
gmsh.model.occ.synchronize()
for name, tag in (("clamp", 5), ("top", 6)):
    gmsh.model.addPhysicalGroup(2, [tag], name=name)
gmsh.model.addPhysicalGroup(3, [1], name="body")
gmsh.option.setNumber("Mesh.MeshSizeMax", 8)
gmsh.model.mesh.generate(3)
gmsh.model.mesh.setOrder(2)
gmsh.option.setNumber("Mesh.MshFileVersion", float(sys.argv[2]))
gmsh.write(sys.argv[1])
"""

BODY = """
name = "part"
length_unit = "mm"
free = false
[geometry]
mesh = "{file}"
[material]
density = 7850
young = 2.1e11
poisson = 0.3
[[supports]]
face = "clamp"
[[interfaces]]
name = "top"
face = "top"
t2 = [0, 1, 0]
[modes]
count = 4
"""


@pytest.fixture(scope="module")
def frequencies(tmp_path_factory):
    @cache
    def of(name):
        folder = tmp_path_factory.mktemp("own")
        command = [sys.executable, "-c", DRAW, str(folder / name), "2.2" if name == "b.msh" else "4.1"]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            assert "med" in name, done.stderr  # gmsh may be built without MED
            pytest.skip("this gmsh writes no MED")
        (folder / "body.toml").write_text(BODY.format(file=name))
        job = open_job(folder, root=folder)
        mesh_stage(job)
        mesh, warnings = load_mesh(job)
        assert not warnings
        return modal_basis(mesh, job.settings).groups[0, 0].frequency

    return of


@pytest.mark.parametrize(
    "name", ["c.unv", *(pytest.param(n, marks=pytest.mark.slow) for n in ("b.msh", "d.inp", "e.med"))]
)
def test_every_format_gives_the_same_frequencies(frequencies, name):
    """1e-6: the formats print different numbers of digits."""
    assert frequencies(name) == pytest.approx(frequencies("a.msh"), rel=1e-6)
