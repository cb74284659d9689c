"""Bodies made to touch each other: in the rotor's axes their faces lie on each other and look at each other."""

from __future__ import annotations

import importlib.util
import tomllib
from pathlib import Path

import numpy as np
import pytest
from drawn import GEOMETRY, STEEL, about_y, build, close, face, made, parameters, volume

from microslip.data import Mesh
from microslip.modal.rows import Patch, patch
from microslip.settings.body import load_body

pytestmark = pytest.mark.skipif(importlib.util.find_spec("gmsh") is None, reason="gmsh is not installed")

MICRON = 1e-6


@pytest.fixture(scope="module")
def meshes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Mesh]:
    """Each body once, with coarse meshes where the contact does not need fine ones."""
    folder = tmp_path_factory.mktemp("bodies")
    coarse = {
        "rig-neighbour": {"size": 30.0},
        "pin": {"size": 3.0},
        "pin-blade": {"size": 20.0, "local": {"contact_left": 3.0, "contact_right": 3.0}},
        "wire": {"size": 20.0},
        "wire-blade": {"size": 20.0},
        "pit-blade": {"size": 20.0, "local": {"contact_left": 4.0, "contact_right": 4.0}},
    }
    return {body: made(body, folder, mesh=mesh) for body, mesh in coarse.items()}


def interface(mesh: Mesh, body: str, name: str) -> Patch:
    """The frame of an interface as the modal file will have it."""
    settings, _ = load_body(GEOMETRY / body / "body.toml")
    item = next(i for i in settings.interfaces if i.name == name)
    return patch(mesh, item.face, None if item.t2 is None else np.array(item.t2), name)


def assert_they_meet(a: Patch, b: Patch, turn: np.ndarray, near: float = MICRON) -> None:
    """Patch b, turned, lies on a: same centre, opposite normal, same second tangent, same area."""
    np.testing.assert_allclose(turn @ b.origin, a.origin, rtol=0, atol=near)
    np.testing.assert_allclose(turn @ b.rotation[0], -a.rotation[0], rtol=0, atol=1e-7)
    np.testing.assert_allclose(turn @ b.rotation[2], a.rotation[2], rtol=0, atol=1e-7)
    assert close(b.areas.sum(), a.areas.sum(), 1e-4)  # circles of second-order elements


# ---------------------------------------------------------------- neighbours of the rig


@pytest.mark.parametrize("arrangement", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_rig_neighbours_lie_on_the_blade(tmp_path: Path, arrangement: int) -> None:
    own = {"contact_width": 20.0} if arrangement == 2 else {}
    blade = made("blade", tmp_path, mesh={"size": 20.0}, arrangement=arrangement, **own)
    for side in ("right", "left"):
        block = made("rig-neighbour", tmp_path, mesh={"size": 30.0}, arrangement=arrangement, side=side)
        area, centre, normal = face(block, "contact")
        there = face(blade, f"contact_{side}")
        assert close(area, there[0], 1e-9)
        np.testing.assert_allclose(centre, there[1], atol=1e-12)
        np.testing.assert_allclose(normal, -there[2], atol=1e-9)


def test_left_neighbour_is_the_right_one_on_the_other_side() -> None:
    """The two body files differ in the side alone."""
    right, left = (tomllib.loads((GEOMETRY / "rig-neighbour" / f"{n}.toml").read_text()) for n in ("body", "left"))
    right["name"], right["geometry"]["parameters"]["side"] = "rig-neighbour-left", "left"
    right["monitors"][0]["point"][0] *= -1
    assert right.pop("description") != left.pop("description")
    assert right == left


def test_rig_neighbour_volume(meshes: dict[str, Mesh]) -> None:
    p = parameters("rig-neighbour")
    pad = p["pad_height"] * 72.0 * p["contact_height"]
    assert close(volume(meshes["rig-neighbour"]), (pad + p["depth"] * p["width"] * p["height"]) * 1e-9, 1e-9)


# ---------------------------------------------------------------- damping element


def test_pin_lies_in_the_holes_of_two_blades(meshes: dict[str, Mesh]) -> None:
    """Its left half in blade i, its right half in blade i + 1, half a micrometre from the curvatures' difference."""
    blade, pin, turn = meshes["pin-blade"], meshes["pin"], about_y(2 * np.pi / parameters("pin")["blades"])
    assert_they_meet(interface(blade, "pin-blade", "right"), interface(pin, "pin", "left"), np.eye(3))
    assert_they_meet(interface(pin, "pin", "right"), interface(blade, "pin-blade", "left"), turn)


def test_pin_and_its_blade_agree() -> None:
    """What both files say about holes, contacts and ring is the same."""
    pin, blade = parameters("pin"), parameters("pin-blade")
    for name in set(pin) & set(blade):
        assert pin[name] == blade[name], name
    assert pin["pin_length"] / 4 == blade["contact_middle"]


def test_pin_is_pressed_outwards(meshes: dict[str, Mesh]) -> None:
    """Both normals of the pin point away from the rotor axis, through its own middle's meridian."""
    outwards = about_y(np.pi / parameters("pin")["blades"]) @ [0, 0, 1]
    for name in ("left", "right"):
        np.testing.assert_allclose(interface(meshes["pin"], "pin", name).rotation[0], outwards, atol=1e-9)


def test_pin_volume(meshes: dict[str, Mesh]) -> None:
    p = parameters("pin")
    assert close(volume(meshes["pin"]), np.pi * p["pin_radius"] ** 2 * p["pin_length"] * 1e-9, 1e-3)


def test_pin_blade_volume(meshes: dict[str, Mesh]) -> None:
    """Blade, plate between planes through the rotor axis less half of the gap, two holes cut by these planes."""
    p = parameters("pin-blade")
    low, angle = p["root_radius"] + p["blade_length"], np.pi / p["blades"]
    high, half_gap = low + p["plate_thickness"], p["gap"] / 2 / np.cos(angle)
    plate = p["plate_chord"] * ((high**2 - low**2) * np.tan(angle) - 2 * half_gap * p["plate_thickness"])
    holes = 2 * np.pi * p["hole_radius"] ** 2 * (p["hole_depth"] - p["gap"] / 2)
    expected = p["blade_length"] * p["chord"] * p["thickness"] + plate - holes
    assert close(volume(meshes["pin-blade"]), expected * 1e-9, 1e-4)


# ---------------------------------------------------------------- damping wire


def test_wire_lies_in_the_holes_of_seven_blades(meshes: dict[str, Mesh]) -> None:
    """Bent wire in straight holes: the strips' centres coincide all the same."""
    p, blade = parameters("wire"), interface(meshes["wire-blade"], "wire-blade", "wire")
    for number in range(1, 8):
        turn = about_y((number - 4) * 2 * np.pi / p["blades"])
        assert_they_meet(interface(meshes["wire"], "wire", f"blade_{number}"), blade, turn)
    assert "blade_8" not in meshes["wire"].faces


def test_wire_and_its_blade_agree() -> None:
    wire, blade = parameters("wire"), parameters("wire-blade")
    for name in set(wire) & set(blade):
        assert wire[name] == blade[name], name
    assert wire["contact_length"] == blade["thickness"]


def test_four_wires_make_the_ring(meshes: dict[str, Mesh]) -> None:
    """One wire and its share of a gap fill a quarter of the circle; its volume is section times arc (Pappus)."""
    p, x = parameters("wire"), meshes["wire"].points * 1e3
    radius = p["hole_distance"] + p["hole_radius"] - p["wire_radius"]
    assert p["blades"] == 4 * p["coupled"]
    arc = radius * np.ptp(np.arctan2(x[:, 0], x[:, 2]))
    assert close(arc + p["end_gap"], radius * np.pi / 2, 1e-4)
    assert close(volume(meshes["wire"]), np.pi * p["wire_radius"] ** 2 * arc * 1e-9, 2e-3)


def test_wire_blade_volume(meshes: dict[str, Mesh]) -> None:
    p = parameters("wire-blade")
    section = p["chord"] * p["blade_length"] - np.pi * p["hole_radius"] ** 2
    assert close(volume(meshes["wire-blade"]), section * p["thickness"] * 1e-9, 1e-5)


# ---------------------------------------------------------------- dampers under platforms

FLANKS = {  # interfaces of blade i and of blade i + 1
    "cottage-roof": ("right", "left"),
    "cylinder": ("right_line", "left_line"),
    "asymmetric": ("right_line", "left"),
}


@pytest.fixture(scope="module", params=list(FLANKS))
def damper(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Mesh]:
    return request.param, made("damper", tmp_path_factory.mktemp(request.param), shape=request.param)


def test_damper_lies_under_two_platforms(meshes: dict[str, Mesh], damper: tuple[str, Mesh]) -> None:
    """Left under blade i, right under blade i + 1; plane flanks on the lands, round ones on the lines in them."""
    shape, mesh = damper
    blade, turn = meshes["pit-blade"], about_y(2 * np.pi / parameters("damper")["blades"])
    of_this, of_next = FLANKS[shape]
    assert_they_meet(interface(blade, "pit-blade", of_this), interface(mesh, "damper", "left"), np.eye(3))
    assert_they_meet(interface(mesh, "damper", "right"), interface(blade, "pit-blade", of_next), turn)


def test_damper_keeps_out_of_the_platforms(damper: tuple[str, Mesh]) -> None:
    """No point of it lies beyond the planes of the roof, but for the rise of a strip's arc above its centre."""
    p, (_, mesh) = parameters("damper"), damper
    half, middle = np.deg2rad(p["roof_angle"]) / 2, about_y(np.pi / p["blades"])
    x = (mesh.points * 1e3) @ middle - [0, 0, p["roof_distance"]]
    beyond = np.abs(x[:, 0]) * np.cos(half) + x[:, 2] * np.sin(half)
    assert -1e-9 < beyond.max() < p["line_width"] ** 2 / (24 * p["land_middle"]) * 1.01


@pytest.mark.parametrize("mass_g", [25.9, 41.8, 117.0])
@pytest.mark.parametrize("shape", list(FLANKS))
def test_damper_has_its_mass(tmp_path: Path, shape: str, mass_g: float) -> None:
    """The three masses of section 5.4; round flanks are parabolas between nodes: 2e-4."""
    mesh = made("damper", tmp_path, mesh={"size": 6.0}, shape=shape, mass_g=mass_g)
    assert close(STEEL * volume(mesh), mass_g * 1e-3, 1e-9 if shape == "cottage-roof" else 1e-3)


def test_dampers_and_blade_agree() -> None:
    """The three body files differ in name and shape alone, and have the roof of the blade."""
    files = {shape: f"{shape}.toml" for shape in FLANKS} | {"cottage-roof": "body.toml"}
    bodies = {s: tomllib.loads((GEOMETRY / "damper" / name).read_text()) for s, name in files.items()}
    for shape, body in bodies.items():
        assert body["geometry"]["parameters"].pop("shape") == shape
        assert body["name"] in ("damper", f"damper-{shape}")
        del body["name"], body["description"]
    assert bodies["cylinder"] == bodies["cottage-roof"] == bodies["asymmetric"]
    damper, blade = parameters("damper"), parameters("pit-blade")
    for name in set(damper) & set(blade):
        assert damper[name] == blade[name], name
    assert close(damper["density"] * 1e6, bodies["cylinder"]["material"]["density"], 1e-12)


def test_pit_blade_lands(meshes: dict[str, Mesh]) -> None:
    """Lands and lines have their areas; the blade above the platform is as long as it should be."""
    p, mesh = parameters("pit-blade"), meshes["pit-blade"]
    for side in ("right", "left"):
        assert close(face(mesh, f"contact_{side}")[0], p["land_width"] * p["land_length"] * 1e-6, 1e-9)
        assert close(face(mesh, f"line_{side}")[0], p["line_width"] * p["land_length"] * 1e-6, 1e-9)
    above = p["root_radius"] + p["blade_length"] - p["platform_top"]
    assert close(face(mesh, "pressure_side")[0], above * p["chord"] * 1e-6, 1e-9)


# ---------------------------------------------------------------- nonsense

WRONG = [
    ("rig-neighbour", {"side": "top"}, "side"),
    ("rig-neighbour", {"arrangement": 3}, "arrangement"),
    ("rig-neighbour", {"width": 70.0}, "contact_width"),
    ("rig-neighbour", {"height": 4.0}, "contact_height"),
    ("pin", {"pin_radius": 6.2}, "pin_radius"),
    ("pin", {"contact_length": 25.0}, "contact_length"),
    ("pin", {"blades": 2.5}, "blades"),
    ("pin", {"contact_width": 7.0}, "contact_width"),
    ("pin-blade", {"hole_depth": 80.0}, "hole_depth"),
    ("pin-blade", {"hole_distance": 480.0}, "hole_distance"),
    ("pin-blade", {"hole_distance": 465.0}, "hole_distance"),
    ("pin-blade", {"hole_offset": -35.0}, "hole_offset"),
    ("pin-blade", {"contact_middle": 20.0}, "contact_middle"),
    ("pin-blade", {"gap": 8.0}, "gap"),
    ("pin-blade", {"chord": 80.0}, "chord"),
    ("wire", {"wire_radius": 6.0}, "wire_radius"),
    ("wire", {"coupled": 28}, "coupled"),
    ("wire", {"coupled": 2.5}, "coupled"),
    ("wire", {"contact_length": 60.0}, "contact_length"),
    ("wire", {"end_gap": 40.0}, "end_gap"),
    ("wire-blade", {"hole_distance": 597.0}, "hole_distance"),
    ("wire-blade", {"hole_distance": 304.0}, "hole_distance"),
    ("wire-blade", {"hole_offset": 25.0}, "hole_radius"),
    ("wire-blade", {"contact_width": 6.5}, "contact_width"),
    ("wire-blade", {"blades": 3}, "blades"),
    ("damper", {"shape": "wedge"}, "shape"),
    ("damper", {"mass_g": 20.0}, "mass_g"),  # shorter than its lands
    ("damper", {"roof_angle": 170.0}, "roof_angle"),
    ("damper", {"land_width": 17.0}, "land_width"),
    ("damper", {"line_width": 9.0}, "line_width"),
    ("pit-blade", {"roof_distance": 240.0}, "roof_distance"),
    ("pit-blade", {"land_middle": 20.0}, "thickness"),
    ("pit-blade", {"gap": 6.0}, "gap"),
    ("pit-blade", {"platform_top": 430.0}, "platform_top"),
    ("pit-blade", {"land_length": 50.0}, "land_length"),
    ("pit-blade", {"blades": 30.5}, "blades"),
]


FIRST = {b: c for b, c, _ in reversed(WRONG)}  # one of each body is quick: each starts a process
REFUSED = [w if FIRST[w[0]] == w[1] else pytest.param(*w, marks=pytest.mark.slow) for w in WRONG]


@pytest.mark.parametrize(("body", "changes", "key"), REFUSED, ids=[f"{b} {c}" for b, c, _ in WRONG])
def test_nonsense_is_refused(tmp_path: Path, body: str, changes: dict, key: str) -> None:
    """One sentence that names the key, exit code 2, no file."""
    run = build(body, tmp_path / "out.msh", **changes)
    assert run.returncode == 2
    assert f"geometry.parameters.{key} " in run.stderr and len(run.stderr.splitlines()) == 1
    assert [f.name for f in tmp_path.iterdir()] == ["out.json"]
