"""The test blade as gmsh draws it: dimensions, faces, quality, refusals. gmsh runs in its own process."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from drawn import drawn

from microslip.data import Mesh
from microslip.mesh import mesh_problems, read_mesh

pytestmark = pytest.mark.skipif(importlib.util.find_spec("gmsh") is None, reason="gmsh is not installed")

BUILD = Path(__file__).parents[1] / "geometry" / "blade" / "build.py"
FACES = {"clamp", "contact_left", "contact_right", "plate_top", "pressure_side", "suction_side"}


def build(
    out: Path, mesh: dict | None = None, apart: bool = False, **parameters: object
) -> subprocess.CompletedProcess[str]:
    note = out.with_suffix(".json")
    note.write_text(json.dumps({"geometry": {"parameters": parameters}, "mesh": mesh or {}}))
    return drawn(BUILD, note, out, apart)


def built(out: Path, mesh: dict | None = None, **parameters: object) -> Mesh:
    """The blade's mesh, read as if its millimetres were metres so that the numbers below are in mm."""
    done = build(out, mesh, **parameters)
    assert done.returncode == 0, done.stderr
    blade = read_mesh(out, "m")
    errors, _ = mesh_problems(blade)
    assert not errors
    assert set(blade.cells) == {"tetra10"} and set(blade.faces) == FACES
    return blade


@pytest.fixture(scope="module")
def blade(tmp_path_factory: pytest.TempPathFactory) -> Mesh:
    return built(tmp_path_factory.mktemp("blade") / "blade.msh")


def corners(mesh: Mesh) -> np.ndarray:
    return mesh.points[mesh.cells["tetra10"][:, :4]]


def volumes(mesh: Mesh) -> np.ndarray:
    x = corners(mesh)
    return np.linalg.det(x[:, 1:] - x[:, :1]) / 6


def area_vector(mesh: Mesh, face: str) -> np.ndarray:
    """Integral of the outward normal."""
    x = mesh.points[mesh.faces[face]["triangle6"][:, :3]]
    return np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]).sum(axis=0) / 2


def spread(mesh: Mesh, face: str) -> np.ndarray:
    """Low and high corner of a face's box, (2, 3)."""
    x = mesh.points[mesh.face_points(face)]
    return np.array([x.min(axis=0), x.max(axis=0)])


def test_dimensions(blade: Mesh) -> None:
    """475 x 77 x 5 mm and, on top of it, the plate of 88 x 77 x 5 mm; clamped at z = 0."""
    assert blade.points.min(axis=0) == pytest.approx([-44, -38.5, 0], abs=1e-6)
    assert blade.points.max(axis=0) == pytest.approx([44, 38.5, 480], abs=1e-6)
    assert volumes(blade).sum() == pytest.approx(475 * 77 * 5 + 88 * 77 * 5, rel=1e-9)


def test_mass_moments(blade: Mesh) -> None:
    """Centre and inertia about the clamp's centre, of two bricks, exact for straight tetrahedra."""
    x, v = corners(blade), volumes(blade)
    masses, middles = np.array([475 * 77 * 5.0, 88 * 77 * 5.0]), np.array([475 / 2, 477.5])
    assert v @ x.mean(axis=1) == pytest.approx([0, 0, masses @ middles], rel=1e-9, abs=1e-3)
    total = x.sum(axis=1)
    second = np.einsum("e,eci,ecj->ij", v, x, x) / 20 + np.einsum("e,ei,ej->ij", v, total, total) / 20
    sides = np.array([[5, 77, 475], [88, 77, 5.0]])
    expected = masses @ (sides**2 / 12) + [0, 0, masses @ middles**2]
    assert second == pytest.approx(np.diag(expected), rel=1e-9, abs=1e-3 * expected.min())


@pytest.mark.parametrize(
    "face, area",
    [
        ("clamp", [0, 0, -5 * 77]),
        ("plate_top", [0, 0, 88 * 77]),
        ("pressure_side", [475 * 77, 0, 0]),
        ("suction_side", [-475 * 77, 0, 0]),
        ("contact_right", [72 * 5, 0, 0]),
        ("contact_left", [-72 * 5, 0, 0]),
    ],
)
def test_faces(blade: Mesh, face: str, area: list[float]) -> None:
    assert area_vector(blade, face) == pytest.approx(area, rel=1e-9, abs=1e-6)


def test_contacts_of_arrangement_1(blade: Mesh) -> None:
    assert spread(blade, "contact_right") == pytest.approx(np.array([[44, -36, 475], [44, 36, 480]]), abs=1e-6)
    assert spread(blade, "contact_left") == pytest.approx(np.array([[-44, -36, 475], [-44, 36, 480]]), abs=1e-6)


def test_contacts_of_arrangement_2(tmp_path: Path) -> None:
    """20 x 5 mm, normal to the chord."""
    blade = built(tmp_path / "a.msh", arrangement=2)
    assert spread(blade, "contact_right") == pytest.approx(np.array([[-10, 38.5, 475], [10, 38.5, 480]]), abs=1e-6)
    assert area_vector(blade, "contact_left") == pytest.approx([0, -100, 0], abs=1e-6)


def test_contact_lower_than_the_plate(tmp_path: Path) -> None:
    blade = built(tmp_path / "a.msh", contact_height=3.0, contact_width=77.0, plate_chord=90.0)
    assert spread(blade, "contact_right") == pytest.approx(np.array([[44, -38.5, 476], [44, 38.5, 479]]), abs=1e-6)


def test_quality_of_the_default_mesh(blade: Mesh) -> None:
    """Two elements through the thickness, 40 000 to 60 000 degrees of freedom, no slivers."""
    assert 40_000 < 3 * blade.n_points < 60_000
    x = corners(blade)
    longest = max(np.linalg.norm(x[:, i] - x[:, j], axis=1).max() for i in range(4) for j in range(i))
    assert longest < 3 * 8.0
    edges = np.stack([x[:, i] - x[:, j] for i in range(4) for j in range(i)])
    quality = 6 * np.sqrt(2) * volumes(blade) / np.sqrt((edges**2).sum(axis=2).mean(axis=0)) ** 3
    assert quality.min() > 0.1  # 1 for the regular tetrahedron
    inside = (np.abs(blade.points[:, 0]) < 1e-6) & (blade.points[:, 2] < 475)
    assert inside.sum() > 500  # nodes on the middle plane


def test_same_bytes(tmp_path: Path) -> None:
    for name in ("a.msh", "b.msh"):
        built(tmp_path / name, {"size": 20}, apart=name == "b.msh")
    assert (tmp_path / "a.msh").read_bytes() == (tmp_path / "b.msh").read_bytes()


def test_toml_settings(tmp_path: Path) -> None:
    (tmp_path / "body.toml").write_text('length_unit = "mm"\n[mesh]\nsize = 20\n')
    command = [sys.executable, BUILD, tmp_path / "body.toml", tmp_path / "a.msh"]
    assert subprocess.run(command, capture_output=True, timeout=60).returncode == 0
    assert (tmp_path / "a.msh").is_file()


@pytest.mark.parametrize(
    "parameters, words",
    [
        ({"blade_length": -475}, "blade_length"),
        ({"thickness": 0}, "thickness"),
        ({"chord": "77"}, "chord"),
        ({"chord": True}, "chord"),
        ({"plate_thickness": float("nan")}, "plate_thickness"),
        ({"contact_width": 78}, "contact_width"),
        ({"contact_height": 5.1}, "contact_height"),
        ({"chord": 78}, "plate_chord"),
        ({"arrangement": 3}, "arrangement"),
        ({"arrangement": [1]}, "arrangement"),
        ({"blade_lenght": 475}, "blade_lenght"),
        ({"blade_length": 1e12}, "mesh.size"),
    ],
)
def test_nonsense_parameters(tmp_path: Path, parameters: dict, words: str) -> None:
    """One sentence that names the key, exit code 2, no file."""
    done = build(tmp_path / "a.msh", **parameters)
    assert done.returncode == 2
    assert words in done.stderr and done.stderr.count("\n") == 1 and "Error" not in done.stderr
    assert not (tmp_path / "a.msh").exists()


@pytest.mark.parametrize(
    "mesh, word",
    [
        ({"size": 0}, "mesh.size"),
        ({"size": 1e-3}, "mesh.size"),
        ({"size": 0.2}, "mesh.size"),
        ({"order": 4}, "mesh.order"),
        ({"local": {"clamp": 1.0}}, "mesh.local"),
    ],
)
def test_nonsense_mesh_settings(tmp_path: Path, mesh: dict, word: str) -> None:
    done = build(tmp_path / "a.msh", mesh)
    assert done.returncode == 2 and word in done.stderr and done.stderr.count("\n") == 1
    assert not (tmp_path / "a.msh").exists()
