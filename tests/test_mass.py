"""`mass` of a body in a case: the same body made of another density."""

from __future__ import annotations

import csv
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from refusals import refused
from small import basis, beam, table

from microslip.basis import read_basis
from microslip.case import load_case, run_case
from microslip.case.loaded import load_bodies
from microslip.case.settings import BodyOfCase, case_model
from microslip.case.surveys import _at_speed
from microslip.case.thrown import normal_forces, thrown
from microslip.cli import main
from microslip.data import CENTRIFUGAL, Array, ModalBasis
from microslip.modal.compute import modal_basis
from microslip.operating.motion import read_out
from microslip.reduced.coordinates import of_density
from microslip.results import read_response
from microslip.settings.body import BodySettings
from microslip.stages.response import Wanted
from microslip.stages.running import respond
from microslip.verbs.orbit import _messages

SAMPLES = Path(__file__).parents[1] / "pipeline/microslip/samples"
BODIES = """
excitation = "magnet"
amplitude = 2.0
monitor = "probe"
name = "vane"
[[bodies]]
name = "vane"
body = "vane-eigenmodes"
MORE
[[contacts]]
interface = "right"
law = "jenkins"
normal_stiffness = 2e5
tangential_stiffness = 4e5
friction = 0.2
includes = "surface"
[sweep]
start = 315.0
stop = 355.0
points = 5
normal_forces = [50.0]
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copy(SAMPLES / "basis.h5", tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def case(folder: Path, more: str) -> Path:
    (folder / "case.toml").write_text(BODIES.replace("MORE", more))
    return folder / "case.toml"


@pytest.fixture(scope="module")
def sample() -> ModalBasis:
    return read_basis(SAMPLES / "basis.h5")


@pytest.mark.usefixtures("unjudged")
def test_the_free_response_is_that_of_the_denser_body(sample: ModalBasis, folder: Path) -> None:
    """By hand from the modes of the stored one, of three times the mass: 1e-10."""
    path = case(folder, f"mass = {3 * sample.mass!r}")
    settings, _ = load_case(path, ["harmonics=1"])
    free = run_case(settings, {"vane": sample}).free
    g = sample.groups[0, 0]
    Omega = 2 * np.pi * free.frequency[:, None]
    watched = g.monitors["probe"]
    row = watched.rows[watched.labels.index("u_x")]
    gain = row * 2.0 * g.excitations["magnet"].rows[0]
    names = g.compliance.labels
    whole = 2.0 * g.compliance.static[names.index("monitor:probe:u_x"), names.index("excitation:magnet:force")]
    dynamic = g.omega**2 - 3 * Omega**2 + 2j * g.damping_ratio * g.omega * np.sqrt(3) * Omega
    by_hand = whole - (gain / g.omega**2).sum() + (gain / dynamic).sum(axis=1)
    np.testing.assert_allclose(free.monitor, by_hand, rtol=1e-10)


def block(reduction: str, density: float) -> ModalBasis:
    """A clamped beam with a centrifugal excitation."""
    changed = table(
        material={"density": density, "young": 2.1e11, "poisson": 0.3}, reduction=reduction,
        excitations=[{"name": "spin", "centrifugal": True}], rotation={"speeds_rpm": [0.0], "point": [0.0, 0.0, -0.2]},
        interfaces=[{"name": "tip", "face": "tip"}],
    )  # fmt: skip
    return modal_basis(beam(), BodySettings.model_validate(changed))


@pytest.mark.parametrize("reduction", ["eigenmodes", "rubin", "craig-bampton", "massless-boundary"])
def test_every_reduction_is_that_of_the_denser_material(reduction: str) -> None:
    """Frequencies, matrices and centrifugal force in every coordinate system: 1e-8."""
    light, heavy = (block(reduction, density).groups[0, 0] for density in (2000.0, 5000.0))
    made = of_density(light, 2.5)
    np.testing.assert_allclose(made.omega, heavy.omega, rtol=1e-8)
    V, W = (np.eye(g.n_modes) if g.to_diagonal is None else g.to_diagonal for g in (made, heavy))
    for name in ("M_r", "K_r", "C_r"):
        mine, other = V.T @ getattr(made, name) @ V, W.T @ getattr(heavy, name) @ W
        np.testing.assert_allclose(mine, other, rtol=0, atol=1e-8 * np.abs(other).max(), err_msg=name)
    pull, wanted = made.excitations["spin"], heavy.excitations["spin"]
    assert pull.unit == CENTRIFUGAL
    mine, other = (np.abs(r.rows @ T) for r, T in ((pull, V), (wanted, W)))
    np.testing.assert_allclose(mine, other, rtol=0, atol=1e-8 * other.max())


def test_a_body_that_rotates_or_has_no_mass_is_refused(sample: ModalBasis, folder: Path) -> None:
    refused("the body rotates", of_density, replace(sample.groups[0, 0], speed=100.0), 2.0)
    path = case(folder, "mass = 1.0")
    settings, _ = load_case(path)
    light = {"vane": replace(sample, mass=0.0)}
    refused("bodies.vane.mass: the modal file of ", load_bodies, settings, light)
    refused("bodies.vane.mass", respond, path, None, ["bodies.vane.mass=-1"])


@pytest.mark.slow
def test_resonances_are_followed_over_the_mass(sample: ModalBasis, folder: Path) -> None:
    """`optimum --over bodies.vane.mass`: sticking nearly, the first resonance falls with the root of the mass (2 %)."""
    path = case(folder, "")
    law = 'law = "smooth"\npoints = [2, 2]'
    path.write_text(path.read_text().replace('law = "jenkins"', law).replace("amplitude = 2.0", "amplitude = 0.02"))
    band = ["--set", "sweep.start=280", "--set", "sweep.stop=360", "--set", "samples=32"]
    ends = ["--low", str(0.9 * sample.mass), "--high", str(1.2 * sample.mass), "--points", "3"]
    main(["optimum", str(path), "--over", "bodies.vane.mass", *ends, *band])  # all peaks are alike to rounding
    with (folder / "build/vane/optimum.csv").open(newline="") as file:
        rows = [(float(r["bodies.vane.mass_kg"]), float(r["frequency_Hz"])) for r in csv.DictReader(file)]
    mass, frequency = np.array(rows).T
    assert len(mass) == 4  # three followed, and the lowest of them once more
    np.testing.assert_allclose(frequency * np.sqrt(mass), (frequency * np.sqrt(mass))[0], rtol=0.02)


@pytest.mark.usefixtures("unjudged")
def test_coordinates_of_a_heavier_body_are_those_of_its_file(folder: Path) -> None:
    """The motion that a response file tells of a body with another mass is what its read-out says, to the compliance
    that the modes leave out at the read-out (3e-3): shapes and stresses of the file belong to it."""
    respond(case(folder, "mass = 0.05"), None, ["harmonics=1"], wanted=Wanted("none", False))
    found, basis = read_response("build/vane/response.h5"), read_basis("basis.h5")
    (series,) = found.series
    told, read = series.monitor("probe")[:, 0, 1], read_out(found.motion(series, basis), "probe")[:, 1, 0]
    np.testing.assert_allclose(read, told, rtol=3e-3)


def roof(centre: Array) -> ModalBasis:
    """Two flanks under a roof of 90 degrees, which a modal file of a beam stands for."""
    body = basis()
    flanks = {"left": [-1.0, 0.0, 1.0], "right": [1.0, 0.0, 1.0]}
    group = body.groups[0, 0]
    faces = {}
    for name, normal in flanks.items():
        n = np.array(normal) / np.sqrt(2)
        faces[name] = replace(group.interfaces[name], rotation=np.array([n, np.cross(Y, n), Y]))
    return replace(
        body, groups={(0, 0): replace(group, interfaces=faces)}, centre=centre, rotation_point=np.zeros(3),
        rotation_axis=Y,
    )  # fmt: skip


def damper(pressed: float, mass: float, centre: Array, shift: Array | None = None) -> list[float]:
    """Normal forces of both flanks."""
    place = dict[str, Any]()
    if shift is not None:
        place = {"shift": tuple(shift), "turn": 20.0}
    settings = BodyOfCase(name="damper", pressed_at_rpm=pressed, mass=mass, **place)
    about = None if shift is None else (Y, np.zeros(3))  # of the body above
    return normal_forces(settings, roof(centre), ["left", "right"], about)


Y = np.array([0.0, 1.0, 0.0])


def test_a_damper_under_a_roof_presses_both_flanks() -> None:
    """m r Omega^2 / (2 sin 45 degrees) each, whatever the place along the axis, whoever puts it there; leaning by
    10 degrees one takes more: F sin(45 +- 10 degrees) by the parallelogram of forces."""
    load = 0.04 * 0.25 * (2700 * np.pi / 30) ** 2
    for along in (0.0, 0.03):
        found = damper(2700.0, 0.04, np.array([0.0, along, 0.25]))
        np.testing.assert_allclose(found, load / (2 * np.sin(np.pi / 4)), rtol=1e-12)
    shift = 0.25 * np.array([np.sin(np.radians(20.0)), 0.0, np.cos(np.radians(20.0))])
    np.testing.assert_allclose(damper(2700.0, 0.04, np.zeros(3), shift), load / np.sqrt(2), rtol=1e-12)
    lean, right = np.radians(10.0), np.radians([35.0, 55.0])
    found = damper(2700.0, 0.04, 0.25 * np.array([np.sin(lean), 0.0, np.cos(lean)]))
    np.testing.assert_allclose(found, load * np.sin(right), rtol=1e-12)


def test_along_an_engine_order_line_a_damper_is_pressed_by_the_load_of_each_speed() -> None:
    """As the square of the speed."""
    law = {"law": "smooth", "normal_stiffness": 1e6, "tangential_stiffness": 1e6, "friction": 0.3}
    case = case_model().model_validate({
        "name": "line", "bodies": [{"name": "damper", "pressed_at_rpm": 2700.0}], "excitation": "shaker",
        "monitor": "tip-probe", "contacts": [{"interface": face, **law} for face in ("left", "right")],
        "sweep": {"start": 1.0, "stop": 2.0},
    })  # fmt: skip
    whole, half = (
        thrown(_at_speed(case, [], rpm), {"damper": roof(np.array([0.0, 0.0, 0.25]))}).contacts
        for rpm in (2700.0, 1350.0)
    )
    for one, other in zip(whole, half, strict=True):
        assert one.normal_force == pytest.approx(4 * (other.normal_force or 0.0), rel=1e-12) and one.normal_force


def test_a_run_up_tells_that_a_damper_stays_pressed_as_at_one_speed() -> None:
    loose = BodyOfCase(name="damper", pressed_at_rpm=2700.0)
    built = SimpleNamespace(settings=SimpleNamespace(components=(loose, BodyOfCase(name="blade"))), messages=())
    for ramp, told in ((True, ["up: the contacts of damper stay pressed as at 2700 rpm."]), (None, [])):
        equations = SimpleNamespace(ramp=ramp, assembly=SimpleNamespace(components=()))
        assert _messages([("up", SimpleNamespace(messages=(), equations=equations))], built) == told


def test_a_body_that_its_contacts_do_not_hold_is_refused() -> None:
    """Thrown sideways out of the roof."""
    refused(("pressed_at_rpm", "do not hold"), damper, 2700.0, 0.04, np.array([0.25, 0.0, 0.0]))
