"""Excitation and damping in case files: every way of saying it gives the loads it means; mistakes are told by key."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import small
from refusals import refused, refused_command
from test_assembly import blade

from microslip.basis import write_basis
from microslip.case import load_case
from microslip.case.assemble import Built, build
from microslip.cli import main
from microslip.errors import UserError
from microslip.modal.compute import modal_basis
from microslip.system.component import Ring

CASE = """
name = "ring"
body = "blade"
monitor = "tip"
harmonics = 4
samples = 64
{body}
[ring]
blades = 12
{ring}
[[contacts]]
interface = "right"
against = "left"
against_sector = 1
normal_stiffness = 2e6
tangential_stiffness = 1e6
friction = 0.1
points = [3, 2]
width = 0.02
height = 0.01
[sweep]
start = 50.0
stop = 80.0
points = 5
normal_forces = [20.0]
{more}
"""
BEAM = """
name = "beam"
body = "small"
monitor = "tip-probe"
[[excitations]]
field = "flow.csv"
face = "contact_left"
length_unit = "mm"
amplitude = 2.0
time_factor = "-"
[[contacts]]
interface = "right"
law = "smooth"
normal_stiffness = 1e8
tangential_stiffness = 1e8
friction = 0.3
normal_force = 100.0
[sweep]
start = 500.0
stop = 900.0
points = 3
"""

GAS = '[[excitations]]\nrow = "gas"\n'


def built(tmp_path, more: str, ring: str = "", body: str = "") -> Built:
    path = tmp_path / "case.toml"
    path.write_text(CASE.format(more=more, ring=ring, body=body))
    settings, _ = load_case(path)
    return build(settings, {b.name: blade() for b in settings.components})


def loads(tmp_path, more: str, ring: str = "") -> dict[int, complex]:
    """Harmonic -> amplitude."""
    found: dict[int, complex] = {}
    for x in built(tmp_path, more, ring).assembly.loads:
        found[x.harmonic] = found.get(x.harmonic, 0.0) + x.amplitude
    return found


def test_stimulus_and_engine_orders(tmp_path) -> None:
    """Engine orders 4 and 6: base 2, harmonics 2 and 3; stimulus of the steady load; a phase in degrees."""
    more = """
[[excitations]]
row = "gas"
engine_order = 4
steady = 500.0
stimulus = 0.02
[[excitations]]
row = "gas"
engine_order = 6
amplitude = 3.0
phase = 90.0
"""
    assert loads(tmp_path, more) == {2: pytest.approx(10.0), 3: pytest.approx(3.0j)}
    assert built(tmp_path, more).assembly.ring == Ring(12, 2)
    assert built(tmp_path, more, 'rotation = "-"').assembly.ring == Ring(12, -2)
    assert loads(tmp_path, more, "engine_order = 1") == {4: pytest.approx(10.0), 6: pytest.approx(3.0j)}
    assert any("harmonic 6" in s for s in built(tmp_path, more, "engine_order = 1").messages)


def test_magnets_give_their_engine_orders(tmp_path) -> None:
    """Three equal ones: every third order; the mean pushes steadily. Where the blade stands turns the phases."""
    magnets = (
        '[[excitations]]\nrow = "gas"\nmagnets = {{ angles = [0, 120, 240], force = 5.0, width = 40, highest = 12{} }}'
    )
    found, moved = (loads(tmp_path, magnets.format(place)) for place in ("", ", place = 10.0"))
    assert sorted(found) == [0, 1, 2, 3, 4]
    assert built(tmp_path, magnets.format("")).assembly.ring == Ring(12, 3)
    for h in range(5):
        assert moved[h] == pytest.approx(found[h] * np.exp(1j * np.radians(30.0 * h)))
    assert found[0] == pytest.approx(3 * 5.0 * 0.5 * 40 / 360)  # the mean of cos^2 over its width is half


def test_damping_of_a_case(tmp_path) -> None:
    """Ratios instead of the file's, and what the flow adds to each wave."""
    (tmp_path / "aero.csv").write_text(
        "nodal_diameter,frequency_shift,damping_ratio\n"
        + "\n".join(f"{k},0,{-0.03 if k == 3 else 0.01}" for k in range(7))
    )
    text = CASE.replace('body = "blade"\n', "").format(
        more=GAS + '[[bodies]]\nname = "blade"\ndamping_ratio = [0.02, 0.01]\naerodynamics = "aero.csv"',
        ring="engine_order = 3", body="",
    )  # fmt: skip
    path = tmp_path / "case.toml"
    path.write_text(text)
    made = build(load_case(path)[0], {"blade": blade()})
    (component,) = made.assembly.components
    np.testing.assert_allclose(component.groups[0].damping_ratio, [0.02, *[0.01] * 5])
    assert (
        component.aerodynamic[3] == -0.03j and component.aerodynamic[9] == -0.03j and component.aerodynamic[4] == 0.01j
    )
    assert sum("has a total damping ratio of" in s for s in made.messages) == 12  # six modes in both waves
    assert "nodal diameter 3, backward" in " ".join(made.messages)


def flow(folder: Path, pressure: str) -> None:
    """A uniform pressure on the beam's face x = 0, in millimetres."""
    points = [(0, y, z) for y in np.linspace(0, 30, 7) for z in np.linspace(0, 120, 13)]
    lines = [f"{x},{y},{z},{pressure}" for x, y, z in points]
    (folder / "flow.csv").write_text("\n".join(["x,y,z,p_real,p_imag", *lines]))


@pytest.mark.slow
@pytest.mark.usefixtures("unestimated")
def test_the_response_follows_an_edited_field(tmp_path, monkeypatch, capsys) -> None:
    """From the command line: a field that is twice as large makes the response anew, twice as large while the contact
    sticks; the same field again is up to date; a field that is no field is one sentence and exit code 2."""
    monkeypatch.chdir(tmp_path)
    write_basis(tmp_path / "basis.h5", small.basis())
    (tmp_path / "case.toml").write_text(BEAM)
    found = []
    for pressure in ("1,0", "2,0", "2,0"):
        flow(tmp_path, pressure)
        assert main(["respond", "case.toml"]) == 0
        found.append(float((tmp_path / "build/beam/response.csv").read_text().splitlines()[1].split(",")[1]))
    assert found[1] == pytest.approx(2 * found[0], rel=1e-6) and found[2] == found[1]
    assert "up to date" in "".join(capsys.readouterr())
    (tmp_path / "flow.csv").write_text("nothing")
    words = "excitations.contact_left.field: flow.csv: has no x, y, z, p_real"
    refused_command(["respond", "case.toml"], capsys, words)


@pytest.mark.usefixtures("unestimated")
@pytest.mark.slow
def test_a_field_needs_no_residual_shape(tmp_path, monkeypatch) -> None:
    """MacNeal's basis keeps residual shapes of its own rows; a field has none, and the response goes without: a fifth
    of the modal answer at most is missing against Rubin's basis, whose modes hold the face's statics."""
    monkeypatch.chdir(tmp_path)
    found = []
    for reduction in ("macneal", "rubin"):
        settings = small.BodySettings.model_validate(small.table(reduction=reduction))
        sealed = {"settings": "small", "mesh_sha256": "0" * 64}
        write_basis(tmp_path / "basis.h5", modal_basis(small.beam(), settings, provenance=sealed))
        (tmp_path / "case.toml").write_text(BEAM)
        flow(tmp_path, "3,4")
        assert main(["respond", "case.toml", "-q"]) == 0
        table = np.genfromtxt(tmp_path / "build/beam/response.csv", delimiter=",", names=True)
        found.append(table[table.dtype.names[1]][table["asked"] == 1])
    np.testing.assert_allclose(found[0], found[1], rtol=0.2)


def test_a_pressure_field_in_a_case(tmp_path) -> None:
    """A beam on the ground loaded by a field from a file: the modal force of the uniform pressure."""
    flow(tmp_path, "3,4")
    path = tmp_path / "case.toml"
    path.write_text(BEAM)
    made = build(load_case(path)[0], {"small": small.basis()})
    part = made.assembly.part(made.assembly.components[0], 1)
    gas = small.basis().groups[0, 0].excitations["gas"].rows[0]
    np.testing.assert_allclose(part.load, 2 * (3 - 4j) * gas, rtol=1e-9)
    assert any("on face 'contact_left'" in s for s in made.messages)
    path.write_text(BEAM.replace("amplitude", "harmonic = 0\namplitude"))
    made = build(load_case(path)[0], {"small": small.basis()})  # Re(p exp(0)) of a steady one
    part = made.assembly.part(made.assembly.components[0], 0)
    np.testing.assert_allclose(part.load, 2 * 3 * gas, rtol=1e-9)
    path.write_text(BEAM.replace('"mm"', '"m"'))
    with pytest.raises(UserError, match=r"case.toml: excitations.contact_left.field: .*length_unit mm instead of m"):
        build(load_case(path)[0], {"small": small.basis()})


@pytest.mark.parametrize(("more", "ring", "words"), [
    ("[[excitations]]\namplitude = 1.0", "", "give a row of the body, or a pressure field"),
    ('[[excitations]]\nfield = "a.csv"', "", "needs face and length_unit"),
    (GAS + 'face = "right"', "", "belong to a pressure field"),
    (GAS + "stimulus = 0.1", "", "stimulus and steady come together"),
    (GAS + "stimulus = 0.1\nsteady = 2.0\namplitude = 3.0", "", "stimulus and steady come together"),
    (GAS + "engine_order = 0", "", "0 is steady"),
    (GAS + "harmonic = 0\nphase = 30.0", "", "phase"),
    (GAS + "engine_order = 2\nharmonic = 2", "", "give one of them"),
    (GAS + "magnets = { angles = [0], width = 10 }\nengine_order = 3", "", "magnets and engine_order"),
    (GAS + "magnets = { angles = [0, 120], force = [1.0], width = 10 }", "", "one force or as many as angles"),
    (GAS + "magnets = { angles = [0], width = 400 }", "", "more than a whole turn"),
    (GAS + "speed_rpm = 100.0\nharmonic = 2", "", "a centrifugal load is steady"),
    (GAS + "speed_rpm = 100.0", "", "is no centrifugal load"),
    (GAS + "engine_order = 3", "engine_order = 2", "no multiple of the base order 2"),
    (GAS + "engine_order = 3\n" + GAS + "engine_order = -9", "", "the other way round"),
    ('[[excitations]]\nfield = "a.csv"\nface = "right"\nlength_unit = "m"', "", "no such file"),
    (GAS + "amplitude = 0.0", "", "moves nothing"),
    (GAS + "stimulus = 0\nsteady = 3\n" + GAS + "magnets = {angles = [0], force = 0, width = 9}", "", "moves nothing"),
])  # fmt: skip
def test_mistakes_are_told_by_key(tmp_path, more: str, ring: str, words: str) -> None:
    refused((words, "case.toml", "excitations"), built, tmp_path, more, ring)


def test_aerodynamics_are_looked_for_beside_the_case(tmp_path) -> None:
    text = CASE.replace('body = "blade"\n', "").format(
        more=GAS + '[[bodies]]\nname = "blade"\naerodynamics = "aero.csv"', ring='model = "full"', body="")  # fmt: skip
    path = tmp_path / "case.toml"
    path.write_text(text)
    with pytest.raises(UserError, match=r"case.toml: bodies.blade.aerodynamics: .*aero.csv: there is no such table"):
        build(load_case(path)[0], {"blade": blade()})


def test_entries_are_set_by_their_names(tmp_path) -> None:
    """`--set` reaches contacts by their interface and excitations by their row, as their file names them."""
    path = tmp_path / "case.toml"
    path.write_text(CASE.format(more=GAS, ring="", body=""))
    settings, _ = load_case(path, ["contacts.right.friction=0.4", "excitations.gas.amplitude=7.0"])
    assert settings.contacts[0].coefficient == 0.4 and settings.loads[0].amplitude == 7.0
    refused("no entry 'left' there; choose one of right", load_case, path, ["contacts.left.friction=0.4"])
