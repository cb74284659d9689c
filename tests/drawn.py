"""Drawing a body by its build file, and measuring volumes and faces of its mesh by quadrature."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from processes import run

from microslip.data import Mesh
from microslip.mesh import mesh_problems, read_mesh

GEOMETRY = Path(__file__).resolve().parents[1] / "geometry"
COARSE: dict[str, dict] = {  # element sizes in mm that keep a test within seconds; others have those of body.toml
    "half-pipe": {"size": 12.0},
    "pendulum": {"size": 6.0},
    "shroud": {"size": 14.0, "local": {"pressure_side": 8.0, "suction_side": 8.0}},
}
STEEL = 7850.0  # kg/m3


def parameters(body: str, **changes: float) -> dict:
    settings = tomllib.loads((GEOMETRY / body / "body.toml").read_text())
    return settings["geometry"]["parameters"] | changes


def meshing(body: str) -> dict:
    return tomllib.loads((GEOMETRY / body / "body.toml").read_text())["mesh"]


def drawn(script: Path, source: Path, out: Path, apart: bool = False) -> subprocess.CompletedProcess[str]:
    """What a build file says and returns, in a process of its own: a new one, or one that has gmsh at hand."""
    words = [str(script), str(source), str(out)]
    if apart:
        return subprocess.run([sys.executable, *words], capture_output=True, text=True, timeout=120)
    return run(words)


def build(
    body: str, out: Path, mesh: dict | None = None, apart: bool = False, **changes: object
) -> subprocess.CompletedProcess[str]:
    """Run the build file on the parameters of body.toml with changes."""
    mesh = mesh or COARSE.get(body) or meshing(body)
    settings = {"geometry": {"parameters": parameters(body, **changes)}, "mesh": mesh}
    source = out.with_suffix(".json")
    source.write_text(json.dumps(settings))
    return drawn(GEOMETRY / body / "build.py", source, out, apart)


def made(body: str, folder: Path, **changes: object) -> Mesh:
    """The mesh in metres; its elements are sound."""
    out = folder / f"{body}.msh"
    run = build(body, out, **changes)
    assert run.returncode == 0, run.stderr
    mesh = read_mesh(out, "mm")
    assert mesh_problems(mesh) == ([], [])
    return mesh


def tetrahedra(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Quadrature points (e, 5, 3) and weights (e, 5) of the curved elements, exact for cubic integrands."""
    corner = np.full((4, 4), 1 / 6) + np.eye(4) / 3
    places = np.vstack([np.full((1, 4), 1 / 4), corner])
    weights = np.array([-4 / 5, *4 * [9 / 20]]) / 6
    ends = np.array([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)])
    a, b = places[:, ends[:, 0]], places[:, ends[:, 1]]
    shape = np.hstack([places * (2 * places - 1), 4 * a * b])
    slope = np.vstack([-np.ones((1, 3)), np.eye(3)])  # of the barycentric coordinates
    middles = 4 * (a[..., None] * slope[ends[:, 1]] + b[..., None] * slope[ends[:, 0]])
    gradient = np.concatenate([(4 * places - 1)[..., None] * slope, middles], axis=1)
    x = mesh.points[mesh.cells["tetra10"]]
    determinant = np.linalg.det(np.einsum("eki,qkj->eqij", x, gradient))
    assert determinant.min() > 0
    return np.einsum("eki,qk->eqi", x, shape), determinant * weights


def volume(mesh: Mesh) -> float:
    return float(tetrahedra(mesh)[1].sum())


def face(mesh: Mesh, name: str) -> tuple[float, np.ndarray, np.ndarray]:
    """Area, centre (3,) and mean outward normal (3,) of a face by quadrature on its six-node triangles."""
    places = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6
    a, b = places, np.roll(places, -1, axis=1)
    shape = np.hstack([a * (2 * a - 1), 4 * a * b])
    slope = np.array([[-1, -1], [1, 0], [0, 1]])
    sides = 4 * (a[..., None] * np.roll(slope, -1, axis=0) + b[..., None] * slope)
    gradient = np.concatenate([(4 * a - 1)[..., None] * slope, sides], axis=1)
    x = mesh.points[mesh.faces[name]["triangle6"]]
    tangents = np.einsum("fki,qkj->fqij", x, gradient)
    vector = np.cross(tangents[..., 0], tangents[..., 1]) / 6
    area = np.linalg.norm(vector, axis=-1)
    centre = np.einsum("fq,fki,qk->i", area, x, shape) / area.sum()
    return float(area.sum()), centre, vector.sum(axis=(0, 1)) / area.sum()


def about_y(angle: float) -> np.ndarray:
    """Rotation that carries z towards x for positive angles."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def close(value: float, expected: float, tolerance: float) -> bool:
    return value == pytest.approx(expected, rel=tolerance)
