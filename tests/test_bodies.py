"""The bodies drawn with gmsh: faces, areas, volumes, inertia and periodicity against the numbers in body.toml."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from drawn import COARSE, STEEL, about_y, build, close, face, made, parameters, tetrahedra, volume
from scipy.spatial import cKDTree

from microslip.data import Mesh
from microslip.mesh import read_mesh

pytestmark = pytest.mark.skipif(importlib.util.find_spec("gmsh") is None, reason="gmsh is not installed")

DESIGN_2 = {"design": 2, "shroud_angle": 60.0, "contact_width": 20.0}


# ---------------------------------------------------------------- half pipe


@pytest.fixture(scope="module")
def half_pipe(tmp_path_factory: pytest.TempPathFactory) -> Mesh:
    return made("half-pipe", tmp_path_factory.mktemp("half-pipe"))


def test_half_pipe_volume(half_pipe: Mesh) -> None:
    """Half a ring, two flanges that start at the round outside, minus the holes; arcs are parabolas: 1e-4."""
    p = parameters("half-pipe")
    inner, outer = p["mean_radius"] - p["wall"] / 2, p["mean_radius"] + p["wall"] / 2
    t, angle = p["flange_thickness"], np.arcsin(p["flange_thickness"] / outer)
    under_arc = (t * outer * np.cos(angle) + outer**2 * angle) / 2  # integral of sqrt(outer^2 - z^2) from 0 to t
    flange = (outer + p["flange_width"]) * t - under_arc
    holes = 2 * p["bolts_per_seam"] * np.pi / 4 * p["bolt_hole"] ** 2 * t
    expected = (np.pi / 2 * (outer**2 - inner**2) + 2 * flange) * p["length"] - holes
    assert close(volume(half_pipe), expected * 1e-9, 1e-4)


def test_half_pipe_mating_faces(half_pipe: Mesh) -> None:
    """Twelve plane patches around the bolts and the rest of the seams, normals out of the body."""
    p, n = parameters("half-pipe"), 6
    patch = p["patch_width"] * p["patch_length"] - np.pi / 4 * p["bolt_hole"] ** 2
    half = np.diag([-1.0, 1.0, -1.0])  # 180 degrees about y: the second half pipe
    for i in range(1, n + 1):
        right, left = face(half_pipe, f"bolt_{i}"), face(half_pipe, f"bolt_{i + n}")
        x, y = p["mean_radius"] + p["wall"] / 2 + p["flange_width"] / 2, p["bolt_pitch"] * (i - (n + 1) / 2)
        assert close(right[0], patch * 1e-6, 2e-4) and close(left[0], patch * 1e-6, 2e-4)
        np.testing.assert_allclose(right[1], [x * 1e-3, y * 1e-3, 0], atol=1e-8)
        np.testing.assert_allclose(half @ left[1], right[1], atol=1e-8)
        np.testing.assert_allclose(right[2], [0, 0, -1], atol=1e-9)
    seam = (p["wall"] + p["flange_width"]) * p["length"] - n * p["patch_width"] * p["patch_length"]
    for name in ("seam_right", "seam_left"):
        assert close(face(half_pipe, name)[0], seam * 1e-6, 1e-9)
    assert "bolt_13" not in half_pipe.faces


def test_half_pipe_heads(half_pipe: Mesh, tmp_path: Path) -> None:
    """Rings under the bolt heads, opposite the patches, facing away from them; none where none are asked for."""
    p = parameters("half-pipe")
    assert not any(name.startswith("head_") for name in half_pipe.faces)
    fine = {"size": 12.0, "local": {"head_1": 3.0, "head_2": 3.0}}
    mesh = made("half-pipe", tmp_path, mesh=fine, washer_radius=8.0, length=80.0, bolts_per_seam=1)
    ring = np.pi * (8.0**2 - p["bolt_hole"] ** 2 / 4) * 1e-6
    for i in (1, 2):
        area, centre, normal = face(mesh, f"head_{i}")
        assert close(area, ring, 2e-3)  # circles of six-node triangles
        np.testing.assert_allclose(normal, [0, 0, 1], atol=1e-9)
        above = face(mesh, f"bolt_{i}")[1] + [0, 0, p["flange_thickness"] * 1e-3]
        np.testing.assert_allclose(centre, above, atol=1e-5)
    assert "head_3" not in mesh.faces


def test_half_pipe_surface(half_pipe: Mesh) -> None:
    p = parameters("half-pipe")
    inner, outer = p["mean_radius"] - p["wall"] / 2, p["mean_radius"] + p["wall"] / 2
    round_part = np.pi - 2 * np.arcsin(p["flange_thickness"] / outer)
    assert close(face(half_pipe, "inside")[0], np.pi * inner * p["length"] * 1e-6, 1e-4)
    assert close(face(half_pipe, "outside")[0], round_part * outer * p["length"] * 1e-6, 1e-4)
    assert close(face(half_pipe, "end_front")[0], face(half_pipe, "end_rear")[0], 1e-4)


# ---------------------------------------------------------------- pendulum


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory: pytest.TempPathFactory) -> Mesh:
    return made("pendulum", tmp_path_factory.mktemp("pendulum"))


def test_pendulum_reduces_to_the_masses_in_the_book(pendulum: Mesh) -> None:
    """J / l^2 at stop and disc: 0.092 kg (ch. 4.2) and 5.632 kg (ch. 4.3), to the rounding of the dimensions."""
    p = parameters("pendulum")
    x, w = tetrahedra(pendulum)
    inertia = STEEL * float((w * (x[..., 0] ** 2 + x[..., 2] ** 2)).sum())
    assert close(inertia / (p["contact_radius"] * 1e-3) ** 2, 0.092, 5e-3)
    assert close(inertia / (p["friction_radius"] * 1e-3) ** 2, 5.632, 5e-3)


def test_pendulum_volume(pendulum: Mesh) -> None:
    p = parameters("pendulum")
    radius, t, w, a = p["hub_diameter"] / 2, p["arm_thickness"], p["arm_width"], p["pad_size"]
    angle = np.arcsin(t / 2 / radius)
    in_hub = radius**2 * angle + t / 2 * radius * np.cos(angle)  # of the arm's middle plane, above the axis
    arm = w * (t * (p["contact_radius"] + a) - in_hub)
    shaft = np.pi / 4 * p["shaft_diameter"] ** 2 * 2 * p["shaft_length"]
    expected = np.pi * radius**2 * p["hub_width"] + arm + shaft + 2 * a**2 * p["pad_height"]
    assert close(volume(pendulum), expected * 1e-9, 5e-4)


def test_pendulum_contacts(pendulum: Mesh) -> None:
    p = parameters("pendulum")
    tip, disc = face(pendulum, "contact_tip"), face(pendulum, "contact_disc")
    for area, _, _ in (tip, disc):
        assert close(area, p["pad_size"] ** 2 * 1e-6, 1e-9)
    np.testing.assert_allclose(tip[2], [1, 0, 0], atol=1e-9)
    np.testing.assert_allclose(disc[2], [0, -1, 0], atol=1e-9)
    assert close(tip[1][2], p["contact_radius"] * 1e-3, 1e-9)
    assert close(disc[1][2], p["friction_radius"] * 1e-3, 1e-9)
    bearing = np.pi * p["shaft_diameter"] * 2 * p["shaft_length"]
    assert close(face(pendulum, "bearing")[0], bearing * 1e-6, 2e-3)


@pytest.mark.parametrize(("held", "left"), [((0, 1, 2), 1), ((0, 2), 2)])
def test_pendulum_hinge_leaves_the_rotation(pendulum: Mesh, held: tuple[int, ...], left: int) -> None:
    """Of the six rigid motions the held hinge axis leaves the rotation about y, and the slide if y is free."""
    x = pendulum.points[pendulum.point_sets["hinge_axis"]]
    assert np.abs(x[:, [0, 2]]).max() < 1e-12
    turns = np.stack([np.cross(axis, x / np.abs(x).max()) for axis in np.eye(3)], axis=-1)
    motions = np.concatenate([np.broadcast_to(np.eye(3), (len(x), 3, 3)), turns], axis=2)[:, held]
    assert 6 - np.linalg.matrix_rank(motions.reshape(-1, 6), tol=1e-9) == left


# ---------------------------------------------------------------- shroud


@pytest.fixture(
    scope="module", params=[{}, pytest.param(DESIGN_2, marks=pytest.mark.slow)], ids=["design 1", "design 2"]
)
def shroud(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[dict, Mesh]:
    mesh = made("shroud", tmp_path_factory.mktemp("shroud"), **request.param)
    return parameters("shroud", **request.param), mesh


def test_shroud_areas(shroud: tuple[dict, Mesh]) -> None:
    p, mesh = shroud
    sector = 2 * np.pi / p["blades"]
    contact, _ = contact_face(p)
    expected = {
        "contact_left": contact,
        "contact_right": contact,
        "cyclic_left": (p["rim_radius"] - p["bore_radius"]) * p["disc_width"],
        "cyclic_right": (p["rim_radius"] - p["bore_radius"]) * p["disc_width"],
        "bore": sector * p["bore_radius"] * p["disc_width"],
        "shroud_top": sector * (p["tip_radius"] + p["contact_height"]) * p["shroud_width"],
    }
    for name, area in expected.items():
        assert close(face(mesh, name)[0], area * 1e-6, 1e-6), name


def contact_face(p: dict) -> tuple[float, float]:
    """Area and distance of the centre from the axis, in mm: a ring cut by a plane inclined by beta.

    At the distance t along the plane from the middle the ring reaches from sqrt(r^2 - t^2 sin(beta)^2) of its inner
    to the same of its outer radius.
    """
    across = p["contact_width"] * ((np.arange(2000) + 0.5) / 2000 - 0.5) * np.sin(np.deg2rad(p["shroud_angle"]))
    low, high = (np.sqrt(r**2 - across**2) for r in (p["tip_radius"], p["tip_radius"] + p["contact_height"]))
    return p["contact_width"] * (high - low).mean(), ((high**2 - low**2) / 2).mean() / (high - low).mean()


def test_shroud_contact_frames(shroud: tuple[dict, Mesh]) -> None:
    """Normals (cos beta, sin beta, 0) turned by half a sector, plane faces, b0 x h0 but for the ring's curvature."""
    p, mesh = shroud
    beta, half = np.deg2rad(p["shroud_angle"]), np.pi / p["blades"]
    for name, side in (("contact_right", 1), ("contact_left", -1)):
        _, centre, normal = face(mesh, name)
        turn = about_y(side * half)
        np.testing.assert_allclose(normal, side * turn @ [np.cos(beta), np.sin(beta), 0], atol=1e-9)
        area, radius = contact_face(p)
        assert close(area, p["contact_width"] * p["contact_height"], 2e-4)
        assert close(radius, p["tip_radius"] + p["contact_height"] / 2, 2e-4)
        np.testing.assert_allclose(centre, turn @ [0, 0, radius * 1e-3], atol=1e-9)


@pytest.mark.parametrize("faces", ["cyclic", "contact"])
def test_shroud_sides_match_node_by_node(shroud: tuple[dict, Mesh], faces: str) -> None:
    """Left turned by +2 pi / N about y is right: same nodes, to rounding."""
    p, mesh = shroud
    left, right = (mesh.points[mesh.face_points(f"{faces}_{side}")] for side in ("left", "right"))
    assert len(left) == len(right)
    distance, partner = cKDTree(right).query(left @ about_y(2 * np.pi / p["blades"]).T)
    assert distance.max() < 1e-9 * p["tip_radius"] * 1e-3
    assert len(set(partner)) == len(left)


def test_shroud_volume(shroud: tuple[dict, Mesh]) -> None:
    """Disc, plate and the blade's sections; curved edges of 2 mm in elements of 8 mm cost 2 % of the blade."""
    p, mesh = shroud
    disc, plate = (
        np.pi / p["blades"] * ((inner + height) ** 2 - inner**2) * width
        for inner, height, width in (
            (p["bore_radius"], p["rim_radius"] - p["bore_radius"], p["disc_width"]),
            (p["tip_radius"], p["contact_height"], p["shroud_width"]),
        )
    )
    areas = [section_area(p, height) for height in (0.0, 0.5, 1.0)]
    blade = np.dot([1, 4, 1], areas) / 6 * (p["tip_radius"] - p["rim_radius"])
    assert abs(volume(mesh) - (disc + plate + blade) * 1e-9) < 0.02 * blade * 1e-9


def section_area(p: dict, height: float) -> float:
    """Thickness integrated along the mean line, and the two half circles at its ends."""
    chord, thickness, camber = (
        (1 - height) * p[f"{name}_root"] + height * p[f"{name}_tip"] for name in ("chord", "thickness", "camber")
    )
    r = p["edge_thickness"] / 2
    s = (np.arange(2000) + 0.5) / 2000
    half = r + (thickness / 2 - r) * np.sin(np.pi * s**0.75) ** 2
    along = np.sqrt(1 + (4 * camber * (1 - 2 * s)) ** 2) * (chord - 2 * r)
    return float((2 * half * along).mean() + np.pi * r**2)


def test_shroud_blade_sides(shroud: tuple[dict, Mesh]) -> None:
    """The pressure side looks towards +x, the suction side towards -x and is the longer way round."""
    _, mesh = shroud
    pressure, suction = face(mesh, "pressure_side"), face(mesh, "suction_side")
    assert pressure[2][0] > 0.5 and suction[2][0] < -0.5
    assert suction[0] > pressure[0]


def test_shroud_gap(tmp_path: Path) -> None:
    """Facing contacts keep the asked distance along their normal."""
    p = parameters("shroud", gap=0.5)
    mesh = made("shroud", tmp_path, gap=0.5)
    (_, left, _), (_, right, normal) = face(mesh, "contact_left"), face(mesh, "contact_right")
    opening = about_y(2 * np.pi / p["blades"]) @ left - right
    assert close(float(opening @ normal), 0.5e-3, 1e-3)


@pytest.mark.parametrize(
    "changes",
    [
        {"blades": 36, "chord_root": 45.0, "chord_tip": 45.0, "stagger": 10.0},
        pytest.param({"blades": 8}, marks=pytest.mark.slow),
        pytest.param({"shroud_angle": 0.0, "contact_width": 44.0}, marks=pytest.mark.slow),
        pytest.param({"shroud_angle": -30.0, "stagger": -15.0, "twist": -40.0}, marks=pytest.mark.slow),
    ],
    ids=["36 blades", "8 blades", "no shroud angle, contact as wide as the shroud", "mirrored"],
)
def test_shroud_other_parameters(tmp_path: Path, changes: dict) -> None:
    mesh = made("shroud", tmp_path, **changes)
    p = parameters("shroud", **changes)
    assert close(face(mesh, "contact_left")[0], contact_face(p)[0] * 1e-6, 1e-6)
    assert close(face(mesh, "contact_right")[0], contact_face(p)[0] * 1e-6, 1e-6)


# ---------------------------------------------------------------- all three


ONE_QUICK = ["half-pipe", *(pytest.param(b, marks=pytest.mark.slow) for b in sorted(COARSE) if b != "half-pipe")]


@pytest.mark.parametrize("body", ONE_QUICK)
def test_same_settings_same_bytes(tmp_path: Path, body: str) -> None:
    coarse = {"size": 20.0}
    for name in ("a", "b"):
        assert build(body, tmp_path / f"{name}.msh", mesh=coarse, apart=name == "b").returncode == 0
    assert (tmp_path / "a.msh").read_bytes() == (tmp_path / "b.msh").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("body", ONE_QUICK)
def test_length_unit_is_free(tmp_path: Path, body: str) -> None:
    """Drawn in metres, each body is the one drawn in millimetres."""
    plain = {"design", "blades", "camber_root", "camber_tip", "stagger", "twist", "shroud_angle", "bolts_per_seam"}
    metres = {name: value * (1 if name in plain else 1e-3) for name, value in parameters(body).items()}
    assert build(body, tmp_path / "mm.msh", mesh={"size": 12.0}).returncode == 0
    assert build(body, tmp_path / "m.msh", mesh={"size": 12e-3}, **metres).returncode == 0
    a, b = read_mesh(tmp_path / "mm.msh", "mm"), read_mesh(tmp_path / "m.msh", "m")
    assert sorted(a.faces) == sorted(b.faces)
    assert close(volume(a), volume(b), 2e-3)  # two meshes of one shape


WRONG = [
    ("half-pipe", {"wall": -5.0}, "wall"),
    ("half-pipe", {"lenght": 600.0}, "lenght"),
    ("half-pipe", {"bolts_per_seam": 2.5}, "bolts_per_seam"),
    ("half-pipe", {"bolts_per_seam": 9}, "length"),
    ("half-pipe", {"bolt_hole": 26.0}, "bolt_hole"),
    ("half-pipe", {"patch_width": 30.0}, "patch_width"),
    ("half-pipe", {"patch_length": 120.0}, "patch_length"),
    ("half-pipe", {"flange_thickness": 60.0}, "flange_thickness"),
    ("half-pipe", {"washer_radius": 12.5}, "washer_radius"),  # beyond the flange
    ("half-pipe", {"washer_radius": 4.5}, "washer_radius"),  # no wider than the hole
    ("half-pipe", {"washer_radius": -8.0}, "washer_radius"),
    ("pendulum", {"arm_width": 0.0}, "arm_width"),
    ("pendulum", {"radius": 1.0}, "radius"),
    ("pendulum", {"pad_size": 9.0}, "pad_size"),
    ("pendulum", {"friction_radius": 20.0}, "friction_radius"),
    ("pendulum", {"friction_radius": 399.0}, "friction_radius"),
    ("pendulum", {"shaft_diameter": "thick"}, "shaft_diameter"),
    ("shroud", {"bore_radius": -1.0}, "bore_radius"),
    ("shroud", {"bore_radius": 300.0}, "bore_radius"),
    ("shroud", {"bore_radius": 239.5}, "bore_radius"),
    ("shroud", {"tip_radius": 242.0}, "tip_radius"),
    ("shroud", {"beta": 30.0}, "beta"),
    ("shroud", {"design": 3}, "design"),
    ("shroud", {"blades": 24.5}, "blades"),
    ("shroud", {"blades": 60}, "blades"),
    ("shroud", {"twist": 200.0}, "twist"),
    ("shroud", {"shroud_angle": 90.0}, "shroud_angle"),
    ("shroud", {"contact_width": 100.0}, "contact_width"),
    ("shroud", {"contact_height": 0.3}, "contact_height"),
    ("shroud", {"chord_root": 90.0}, "chord_root"),
    ("shroud", {"chord_tip": 90.0}, "chord_tip"),
    ("shroud", {"thickness_tip": 1.5}, "edge_thickness"),
    ("shroud", {"gap": -0.1}, "gap"),
    ("shroud", {"camber_root": float("nan")}, "camber_root"),
]


FIRST = {b: c for b, c, _ in reversed(WRONG)}  # one of each body is quick: each starts a process
REFUSED = [w if FIRST[w[0]] == w[1] else pytest.param(*w, marks=pytest.mark.slow) for w in WRONG]


@pytest.mark.parametrize(("body", "changes", "key"), REFUSED, ids=[f"{b} {c}" for b, c, _ in WRONG])
def test_nonsense_is_refused(tmp_path: Path, body: str, changes: dict, key: str) -> None:
    """One sentence that names the key, exit code 2, no file."""
    run = build(body, tmp_path / "out.msh", **changes)
    assert run.returncode == 2
    assert f"geometry.parameters.{key} " in run.stderr and len(run.stderr.splitlines()) == 1
    assert "Traceback" not in run.stderr
    assert [f.name for f in tmp_path.iterdir()] == ["out.json"]


@pytest.mark.parametrize("size", ["fine", 0, -1.0])
def test_nonsense_size_is_refused(tmp_path: Path, size: object) -> None:
    run = build("half-pipe", tmp_path / "out.msh", mesh={"size": size})
    assert run.returncode == 2 and "mesh.size" in run.stderr and len(run.stderr.splitlines()) == 1
