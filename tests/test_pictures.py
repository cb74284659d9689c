"""Pictures: surface and camera against geometry, the files as a user gets them, what a bare machine is told."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import meshes
import numpy as np
import pytest
import small
from hypothesis import given
from hypothesis import strategies as st

from microslip import pictures
from microslip.data import ContactState, ModalBasis
from microslip.pictures import lettering, scene
from microslip.pictures.plots import closure_plot, figure_of, save

pytest.importorskip("pyvista")
pytest.importorskip("matplotlib")
scene.quiet_vtk()
needs_scenes = pytest.mark.skipif("pictures.can_draw() is not None", reason="PyVista cannot draw here")


# --- surface -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cell", ["tetra", "tetra10", "hexahedron", "hexahedron20", "hexahedron27"])
def test_the_outside_of_a_box_is_closed_and_has_its_area(cell: str) -> None:
    mesh = meshes.brick(cell, (2, 3, 2), (0.2, 0.3, 0.5))
    outside = scene.surface(mesh)
    points = mesh.points[outside.source]
    normals = scene.triangle_normals(points, outside.triangles)
    assert 0.5 * np.linalg.norm(normals, axis=1).sum() == pytest.approx(2 * (0.06 + 0.1 + 0.15), rel=1e-12)
    np.testing.assert_allclose(normals.sum(axis=0), 0.0, atol=1e-12)  # closed, all outwards or all inwards
    centres = points[outside.triangles].mean(axis=1)
    assert (np.einsum("ti,ti->t", normals, centres - mesh.points.mean(axis=0)) > 0).all()
    edges = mesh.points[outside.outline]
    total = np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1).sum()
    assert total == pytest.approx(4 * (0.2 + 0.3 + 0.5), rel=1e-12)  # only the box's twelve edges are sharp


def test_vertices_are_split_at_edges_so_that_normals_stay_flat() -> None:
    mesh = meshes.brick("tetra10", (2, 2, 2), (1.0, 1.0, 1.0))
    outside = scene.surface(mesh)
    normals = scene.vertex_normals(mesh.points[outside.source], outside.triangles)
    np.testing.assert_allclose(
        np.sort(np.abs(normals), axis=1), np.tile([0.0, 0.0, 1.0], (len(normals), 1)), atol=1e-12
    )


def test_named_faces_are_found_on_the_outside() -> None:
    mesh = small.beam()
    outside = scene.surface(mesh)
    x, y, z = small.SIZE
    for name, area in (("clamp", x * y), ("tip", x * y), ("contact_left", y * z)):
        chosen = scene.face_triangles(outside, mesh, name)
        normals = scene.triangle_normals(mesh.points[outside.source], outside.triangles[chosen])
        assert 0.5 * np.linalg.norm(normals, axis=1).sum() == pytest.approx(area, rel=1e-12)


def test_a_patch_behind_a_wall_is_seen_to_be_covered() -> None:
    """A triangle in the plane z = 0 hides what lies behind it, not what lies before it, beside it or in it."""
    from microslip.pictures.views import covered

    wall, triangle, axes = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]), np.eye(3)
    spot = np.array([[0.2, 0.2, 0.0], [0.3, 0.3, 0.0], [2.0, 2.0, 0.0]])
    for height, hidden in ((-0.5, True), (0.5, False), (0.0, False)):
        assert covered(wall, triangle, spot + [0, 0, height], axes) is hidden
    assert not covered(wall, triangle, spot + [1.0, 0, -0.5], axes)
    assert not covered(wall, triangle, spot - [0, 0, 0.5], -axes)
    assert not covered(wall, np.array([[0, 1, 1]]), spot - [0, 0, 0.5], axes)


# --- camera --------------------------------------------------------------------------------------------------------


@given(st.integers(0, 10_000), st.floats(0.02, 50.0), st.floats(0.02, 50.0))
def test_nothing_is_cut_off_and_the_body_fills_the_picture(seed: int, stretch: float, flatten: float) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(40, 3)) * [1.0, stretch, flatten] + rng.normal(size=3)
    axes = scene.view_axes(np.cov(points.T))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    for camera in (scene.fit(points, axes, 2e5), scene.fit_tile(points, axes, (300, 200))):
        at, size = camera.project(points), np.array(camera.size)
        assert (at > 0).all() and (at < size).all()
        assert (np.ptp(at, axis=0) / size).max() > 0.85
    assert np.prod(scene.fit(points, axes, 2e5).size) == pytest.approx(2e5, rel=0.02)


def test_z_points_up_and_a_thin_plate_shows_its_broad_side() -> None:
    points = np.random.default_rng(0).uniform(-1, 1, size=(500, 3)) * [0.002, 0.04, 0.25]
    inertia = np.trace(points.T @ points) * np.eye(3) - points.T @ points
    axes = scene.view_axes(inertia)
    assert axes[1, 2] > 0.9  # the picture's up direction is mostly z
    assert axes[2, 0] > 0.5 and axes[2, 1] < 0 and axes[2, 2] > 0  # seen from +x, -y, +z


# --- lettering -----------------------------------------------------------------------------------------------------


@given(st.text(alphabet="abc efg", max_size=200), st.integers(60, 400))
def test_lines_are_as_narrow_as_asked_unless_one_word_is_wider(text: str, width: int) -> None:
    face = lettering.font(14)
    lines = lettering.wrap(text, width, face)
    assert " ".join(lines).split() == text.split()
    assert all(face.getlength(line) <= width or " " not in line.strip() for line in lines)


@pytest.mark.parametrize(
    ("value", "wanted"), [(1.0, 1.0), (0.9, 0.5), (4.99, 2.0), (73.0, 50.0), (2e-3, 2e-3), (0.3, 0.2)]
)
def test_scale_bars_are_1_2_or_5(value: float, wanted: float) -> None:
    assert lettering.nice(value) == pytest.approx(wanted, rel=1e-12)


def test_lengths_have_the_unit_of_a_drawing() -> None:
    assert [lettering.length_text(v) for v in (2.0, 0.05, 2e-5)] == ["2 m", "50 mm", "20 µm"]


# --- pictures as files ---------------------------------------------------------------------------------------------


def drawn(basis: ModalBasis, folder: Path) -> dict[str, Path]:
    return pictures.draw_all(basis, folder, engine_orders=(1, 2, 30))


@pytest.mark.slow
@needs_scenes
def test_every_picture_of_a_body_at_two_speeds(tmp_path: Path) -> None:
    from PIL import Image

    said: list[str] = []
    found = pictures.draw_all(small.basis((0.0, 3000.0)), tmp_path, said.append, (1, 2, 30))
    modes = [f"mode_{j:02d}_{rpm}rpm" for rpm in (0, 3000) for j in range(1, 7)]
    others = ["mesh", "interfaces", "modes_0rpm", "modes_3000rpm", "stress_modes", "static", "compliance", "campbell"]
    moving = [f"animation_{j:02d}" for j in (1, 2, 3)]
    assert sorted(found) == sorted(modes + others + moving)
    assert len(said) > 3 and all(p.is_file() for p in found.values())
    assert len(list(tmp_path.iterdir())) == len(found)  # nothing half-written is left
    for name, path in found.items():
        with Image.open(path) as image:
            pixels = np.asarray(image.convert("RGB"))
        assert min(pixels.shape[:2]) > 100 and max(pixels.shape[:2]) < 4000, name
        assert 0.02 < (pixels.min(axis=2) < 240).mean() < 0.9, f"{name} is empty or has no white"
        border = np.concatenate([pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]])
        assert (border > 240).mean() > 0.97, f"{name} runs over its edge"
    for name in moving:
        with Image.open(found[name]) as image:
            assert image.n_frames >= 10 and found[name].stat().st_size < 2e6
            first = np.asarray(image.convert("RGB"), dtype=int)
            image.seek(image.n_frames // 2)
            assert (
                np.abs(np.asarray(image.convert("RGB"), dtype=int) - first).max(axis=2) > 60
            ).mean() > 0.01  # it moves


@pytest.mark.slow
@needs_scenes
def test_modes_differ_from_each_other(tmp_path: Path) -> None:
    """A window that is not drawn anew shows the same mode again and again."""
    found = drawn(small.basis(), tmp_path)
    contents = {p.read_bytes() for name, p in found.items() if name.startswith("mode_")}
    assert len(contents) == small.basis().groups[0, 0].n_modes
    assert not {"campbell", "static"} & set(found)


@needs_scenes
def test_a_free_body_moves_with_its_first_elastic_modes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from microslip.pictures import views

    monkeypatch.setattr(views, "AREA", 1e4)
    monkeypatch.setattr(pictures, "MOST_MODES", 1)
    basis = small.basis(free=True)
    found = drawn(basis, tmp_path)
    elastic = [j + 1 for j, k in enumerate(basis.groups[0, 0].kind) if k != "rigid"][:3]
    assert sorted(n for n in found if n.startswith("animation")) == [f"animation_{j:02d}" for j in elastic]


def test_curves_need_no_3d(tmp_path: Path) -> None:
    found = pictures.draw_all(small.basis((0.0, 3000.0)), tmp_path, scenes=False)
    assert sorted(found) == ["campbell", "compliance"]


@pytest.mark.parametrize(
    ("count", "speeds"),
    [(1, (0.0,)), (2, (0.0, 3000.0)), pytest.param(14, (0.0, 3000.0), marks=pytest.mark.slow), (14, (0.0,))],
)
def test_pressures_of_many_closures_fit_on_a_page(count: int, speeds: tuple[float, ...], tmp_path: Path) -> None:
    from PIL import Image

    x = np.stack(np.meshgrid(np.arange(40.0), np.arange(6.0), [0.0]), axis=-1).reshape(-1, 3) * 1e-3
    one, basis, force = np.ones(len(x)), small.basis(speeds), np.array([0.0, 0.0, 240.0])
    state = ContactState("a", "b", "", "open", 0, 240.0, 1.0, 0.0, 1.0, 0.0, force, x[0], x, 1e6 * one, one, 1e-6 * one)
    groups = {k: replace(g, contacts={f"c{i}": state for i in range(count)}) for k, g in basis.groups.items()}
    path = save(partial(closure_plot, replace(basis, groups=groups)), tmp_path / "closure.png")
    assert not figure_of(partial(closure_plot, basis)).axes
    with Image.open(path) as image:
        assert max(image.size) < 2000 and min(image.size) > 150


@needs_scenes
@pytest.mark.slow
def test_drawing_says_nothing_on_the_screen(tmp_path: Path) -> None:
    """No display, no warning: neither Python's nor VTK's, which writes past sys.stderr."""
    program = (
        f"import sys; sys.path[:0] = {[str(Path(pictures.__file__).parents[2]), str(Path(__file__).parent)]!r}\n"
        "import small; from microslip import pictures\n"
        f"pictures.draw_all(small.basis(), {str(tmp_path)!r})"
    )
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "VTK_DEFAULT_OPENGL_WINDOW")}
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300, env=environment)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


# --- a machine that cannot draw ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("program", "words"),
    [
        ("kill -SEGV $$", "crashed; on Debian or Ubuntu: apt-get install libglu1-mesa libgl1"),
        ("echo 'ImportError: libGL.so.1: cannot open' >&2; exit 1", "libGL.so.1: cannot open"),
        ("echo \"ModuleNotFoundError: No module named 'pyvista'\" >&2; exit 1", "install microslip[viz]"),
    ],
)
@pytest.mark.skipif(os.name != "posix", reason="needs a shell")
def test_why_it_cannot_draw(program: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in = tmp_path / "python"
    stand_in.write_text(f"#!/bin/sh\n{program}\n")
    stand_in.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(stand_in))
    reason = pictures.can_draw()
    assert reason is not None and words in reason and "\n" not in reason


@pytest.mark.skipif(os.name != "posix", reason="needs a shell")
def test_a_machine_that_is_too_busy_to_draw_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where no picture of a body comes in time a page says so, on which they would simply be missing."""
    from microslip.stages import response

    stand_in = tmp_path / "python"
    stand_in.write_text("#!/bin/sh\nexec sleep 60\n")
    stand_in.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(stand_in))
    monkeypatch.setattr(pictures, "PATIENCE", 0.1)
    assert "in 0.1 s, wait until" in (pictures.can_draw() or "")
    (said,) = response._not_drawn()
    assert (
        said.startswith("The pictures of bodies are missing: PyVista drew nothing in 0.1 s, wait") and "--force" in said
    )


def test_egl_is_only_chosen_where_the_user_has_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setenv("VTK_DEFAULT_OPENGL_WINDOW", "vtkOSOpenGLRenderWindow")
    scene.quiet_vtk()
    assert os.environ["VTK_DEFAULT_OPENGL_WINDOW"] == "vtkOSOpenGLRenderWindow"
    monkeypatch.delenv("VTK_DEFAULT_OPENGL_WINDOW")
    monkeypatch.setenv("DISPLAY", ":0")
    scene.quiet_vtk()
    assert "VTK_DEFAULT_OPENGL_WINDOW" not in os.environ
