"""body.toml: every mistake is one sentence with file, key and remedy; lengths become metres; overrides."""

from __future__ import annotations

import copy
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import small
from refusals import refused

from microslip.errors import UserError
from microslip.settings.body import BodySettings, implausible, load_body, validate
from microslip.settings.toml import load_toml, override

ROOT = Path(__file__).resolve().parents[1]
NAN, INF = float("nan"), float("inf")
JARGON = re.compile(
    r"tuple|function-|union|validator|pydantic|dict\b|\bint\b|\bfloat\b|\bstr\b|instance|NoneType|codec|BaseModel",
    re.IGNORECASE,
)


def changed(**changes: Any) -> dict[str, Any]:
    """The small beam's table with entries replaced (``material__young=...``), or removed (``...``)."""
    table = copy.deepcopy(small.table())
    for key, value in changes.items():
        *above, last = key.split("__")
        place: Any = table
        for step in above:
            place = place[int(step) if isinstance(place, list) else step]
        if value is ...:
            del place[last]
        else:
            place[int(last) if isinstance(place, list) else last] = value
    return table


def complaint(table: dict[str, Any]) -> str:
    with pytest.raises(UserError) as error:
        validate(BodySettings, table, Path("body.toml"))
    text = str(error.value)
    for line in text.splitlines():
        assert line.startswith("body.toml: "), line
        assert ";" in line, line  # a remedy follows
        assert not JARGON.search(line), line
        assert len(line) < 340, line
    return text


# one mistake each -> what the only sentence must say
MISTAKES: list[tuple[dict[str, Any], str]] = [
    ({"cyclic": {"sectors": 24, "nodal_diameters": 3}}, 'cyclic.nodal_diameters: must be "all" or a list of whole'),
    ({"cyclic": {"sectors": 24, "nodal_diameters": [0, 3.5]}}, "nodal_diameters: must be \"all\" or a list of whole n"),
    ({"materal": {}}, "materal: unknown key; did you mean 'material'?"),
    ({"material__densty": 7850.0, "material__density": ...}, "material.densty: unknown key; did you mean 'density'?"),
    ({"mesh": {"szie": 3.0}}, "mesh.szie: unknown key; did you mean 'size'?"),
    ({"size": 3.0}, "size: unknown key; it belongs in [mesh]"),
    ({"density": 3.0}, "density: unknown key; it belongs in [material]"),
    ({"xyzzy": 1}, "xyzzy: unknown key; known keys: name, description"),
    ({"excitations__0__pont": [0, 0, 0], "excitations__0__point": [0, 0, 0]}, "excitations.shaker.pont: unknown key"),
    ({"material": ...}, "material: is missing; add it"),
    ({"length_unit": ...}, "length_unit: is missing; add it"),
    ({"interfaces__0__face": ...}, "interfaces.right.face: is missing; add it"),
    ({"material__young": "2.1e11"}, 'must be a number or a list of numbers (it is "2.1e11"); write it without quotes'),
    ({"material__density": "heavy"}, 'material.density: must be a number (it is "heavy"); correct'),
    ({"material__density": ...}, "material.density: is missing; add it, in kg/m3"),
    ({"mesh": {"size": -1.0}}, "must be greater than 0 (it is -1.0); correct it, in length_unit"),
    ({"material__young": True}, "must be a number or a list of numbers (it is true)"),
    ({"material__density": True}, "material.density: must be a number (it is true)"),
    ({"material__young": {}}, "must be a number or a list of numbers (it is a table)"),
    ({"material__young": NAN}, "material.young: must be a finite number (it is nan)"),
    ({"material__density": INF}, "material.density: must be a finite number (it is inf)"),
    ({"material__density": 10**400}, "material.density: must be a finite number"),
    ({"material__density": -1.0}, "material.density: must be greater than 0 (it is -1.0)"),
    ({"material__poisson": 0.5}, "material.poisson: must be less than 0.5"),
    ({"material__young": [1e11, 2e11]}, "material: an orthotropic material needs three numbers for young"),
    ({"material__young": [1e11, "a", 2e11]}, 'material.young: entry 2 of the list must be a number (it is "a")'),
    ({"material__shear": [1e9, 1e9, 1e9]}, "material: an isotropic material has one young"),
    ({"material__axes": [[1, 0, 0], [1, 0, 0], [0, 0, 1]]}, "material: axes must be three directions at right angles"),
    ({"material__axes": [[1, 0, 0], [0, 0, 0], [0, 0, 1]]}, "axes must be three directions at right angles"),
    ({"material__temperature": [300.0]}, "temperature and modulus_factor come together"),
    ({"material__temperature": [300.0], "material__modulus_factor": [1.0, 0.9]}, "must have the same length"),
    ({"material__temperature": [400.0, 300.0], "material__modulus_factor": [1.0, 0.9]}, "temperature must rise"),
    ({"geometry": {"mesh": "a", "cad": "b"}}, "one of build, cad, mesh, matrices, and has cad and mesh"),
    ({"geometry": {}}, "geometry: needs exactly one of build, cad, mesh, matrices, and has none"),
    ({"geometry": {"mesh": ""}}, "geometry: needs exactly one of build, cad, mesh, matrices, and has none"),
    ({"geometry": 3}, "geometry: must be a table (it is 3); write [geometry] and its keys below"),
    ({"geometry": [{}]}, "geometry: must be one table; write [geometry] with single brackets"),
    (
        {"geometry": {"cad": "a", "faces": [{"name": "x", "label": "a", "box": [0, 0, 0, 1, 1, 1]}]}},
        "geometry.faces.x: a face needs exactly one of label, colour, box, surfaces, touching, and has label and box",
    ),
    ({"geometry": {"cad": "a", "faces": [{"name": "x"}]}}, "colour, box, surfaces, touching, and has none"),
    ({"geometry": {"cad": "a", "faces": [{"name": "x", "box": [0, 1]}]}}, "faces.x.box: must have 6 entries and has 2"),
    ({"geometry": {"cad": "a", "faces": [{"name": "x", "colour": [300, 0, 0]}]}}, "entry 1 of the list must not be"),
    ({"supports": {"face": "clamp"}}, "supports: must be a list; write [[supports]] with double brackets"),
    ({"supports": ["clamp"]}, "supports: entry 1 of the list must be a table; write [[supports]]"),
    ({"supports": [{"face": ""}]}, "supports.0.face: must not be empty"),
    ({"supports": [{"face": "clamp", "directions": "q"}]}, "supports.clamp.directions: must be 'x', 'y', 'z'"),
    ({"interfaces__0__role": "rihgt"}, "interfaces.right.role: must be 'left', 'right'"),
    ({"interfaces__0__t2": [0, 0, 0]}, "interfaces.right.t2: a direction must not be [0, 0, 0]"),
    ({"interfaces__0__t2": [0, 0]}, "interfaces.right.t2: must have 3 entries and has 2"),
    ({"interfaces__0__t2": [0, 0, 1, 2]}, "interfaces.right.t2: must have 3 entries and has 4"),
    ({"interfaces__0__t2": [0, True, 1]}, "interfaces.right.t2: entry 2 of the list must be a number (it is true)"),
    ({"interfaces__0__t2": [0, NAN, 1]}, "interfaces.right.t2: entry 2 of the list must be a finite number"),
    ({"interfaces__0__t2": "z"}, 'interfaces.right.t2: must be a list in [brackets] (it is "z")'),
    ({"interfaces__1__name": "right"}, "interfaces: the name 'right' is used twice; rename one"),
    ({"gauges__0__name": "tip-probe"}, "gauges: the name 'tip-probe' is used twice"),
    ({"interfaces__0__name": "a b"}, "name: must begin with a letter or digit"),
    ({"interfaces__0__name": ".."}, "name: must begin with a letter or digit"),
    ({"interfaces__0__sector_shift": 2}, "interfaces.right.sector_shift: must be -1, 0 or 1 (it is 2)"),
    ({"interfaces__0__sector_shift": True}, "interfaces.right.sector_shift: must be a whole number, not true"),
    ({"excitations__0__face": "tip"}, "excitations.shaker: needs exactly one of point, node, face, and has point"),
    ({"excitations__0__direction": ...}, "excitations.shaker: needs a direction"),
    ({"excitations__0__direction": [1e300, 0, 0]}, "excitations.shaker.direction: 1e+300 is beyond all bounds"),
    ({"interfaces__0__t2": [0, 1, 1e300]}, "interfaces.right.t2: 1e+300 is beyond all bounds"),
    ({"interfaces__0__t2": [0, 1e-300, 0]}, "interfaces.right.t2: 1e-300 is beyond all bounds"),
    ({"material__density": -1e31}, "material.density: -1e+31 is beyond all bounds"),
    ({"rotation__axis": [0, 1e300, 0]}, "rotation.axis: 1e+300 is beyond all bounds"),
    ({"damping": {"ratio": 5.0}}, "damping.ratio: a damping ratio of 5"),
    ({"damping": {"table": [0.01, 2.0]}}, "damping.table: a damping ratio of 2"),
    ({"excitations__1__direction": [1, 0, 0]}, "excitations.gas: pressure = true needs a face and no direction"),
    ({"monitors__0__point": [1, 2]}, "monitors.tip-probe.point: must have 3 entries and has 2"),
    ({"gauges__0__direction": [0, 0, 0]}, "gauges.root.direction: a direction must not be [0, 0, 0]"),
    ({"modes__count": 3.5}, "modes.count: must be a whole number (it is 3.5)"),
    ({"modes__count": 0}, "modes.count: must not be less than 1"),
    ({"modes__count": 10**400}, "modes.count: must not be greater than 2000"),
    ({"modes__count": "20"}, 'modes.count: must be a whole number (it is "20"); write it without quotes'),
    ({"modes__certify": "true"}, 'modes.certify: must be true or false (it is "true"); write it without quotes'),
    ({"modes__certify": 1}, "modes.certify: must be true or false (it is 1)"),
    ({"modes__solver": "mumps"}, "modes.solver: must be 'auto', 'pardiso', 'superlu' or 'petsc'"),
    ({"rotation__speeds_rpm": 3000.0}, "rotation.speeds_rpm: must be a list in [brackets] (it is 3000.0)"),
    ({"rotation__speeds_rpm": [3000.0, 1000.0]}, "rotation: speeds_rpm must be one or more rising numbers"),
    ({"rotation__speeds_rpm": []}, "rotation: speeds_rpm must be one or more rising numbers"),
    ({"rotation__axis": [0, 0, 0]}, "rotation.axis: a direction must not be [0, 0, 0]"),
    ({"rotation__engine_orders": [0]}, "rotation.engine_orders: entry 1 of the list must not be less than 1"),
    ({"damping": {"ratio": 0.1, "alpha": 2.0}}, "damping: give one of ratio, table, or alpha and beta"),
    ({"damping": {"ratio": -1}}, "damping.ratio: must not be less than 0"),
    ({"length_unit": "millimetre"}, "length_unit: must be 'm', 'cm', 'mm'"),
    ({"name": 3}, 'name: must be text in "quotes" (it is 3)'),
    ({"name": "../up"}, "name: must begin with a letter or digit"),
    ({"name": "x" * 65}, "name: must have at most 64 characters"),
    ({"loads": [{"kind": "pressure", "face": "tip"}]}, "loads.tip: a pressure needs face and value"),
    ({"loads": [{"kind": "wind"}]}, "loads.0.kind: must be 'gravity', 'pressure', 'force' or 'mesh'"),
    ({"loads": [{"kind": "force", "face": "a", "point": [0, 0, 0], "vector": [0, 0, 1]}]}, "a force needs vector (N)"),
    ({"mesh": {"size": 0.0}}, "mesh.size: must be greater than 0"),
    ({"mesh": {"order": 3}}, "mesh.order: must be 1 or 2"),
    ({"mesh": {"local": {"a": -1}}}, "mesh.local.a: must be greater than 0"),
    ({"mesh": {"local": 3}}, "mesh.local: must be a table (it is 3); write [mesh.local]"),
    ({"temperature": {"uniform": 300.0, "file": "a"}}, "temperature: give uniform or file, not both"),
    ({"temperature": {"uniform": -5.0}}, "temperature.uniform: must be greater than 0"),
    ({"free": "yes"}, "free: must be true or false"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "words"), MISTAKES, ids=[words[:40] for _, words in MISTAKES])
def test_one_mistake_one_sentence(changes: dict[str, Any], words: str) -> None:
    text = complaint(changed(**changes))
    assert words in text
    assert len(text.splitlines()) == 1


@pytest.mark.parametrize(
    ("poisson", "young"), [([0.9, 0.9, 0.9], [1e11, 1e11, 1e11]), ([0.3, 0.3, 0.3], [1e11, 1e9, 1e13])]
)
def test_inadmissible_orthotropic_constants(poisson: list[float], young: list[float]) -> None:
    changes = {"material__young": young, "material__poisson": poisson, "material__shear": [1e10] * 3}
    assert "material: the orthotropic constants are not positive definite" in complaint(changed(**changes))


def test_every_mistake_of_a_file_is_named_at_once() -> None:
    table = changed(materal=1, material__density="x", modes__count=0, interfaces__0__t2=[0])
    lines = complaint(table).splitlines()
    assert len(lines) == 4


def test_the_small_table_and_the_bodies_are_sound() -> None:
    assert validate(BodySettings, small.table(), Path("body.toml")).name == "small"
    for path in sorted((ROOT / "geometry").glob("*/body.toml")):
        settings, raw = load_body(path)
        assert settings.name == path.parent.name
        assert raw["name"] == settings.name


# ---------------------------------------------------------------- files


def refusal(path: Path, *assignments: str) -> str:
    with pytest.raises(UserError) as error:
        load_body(path, list(assignments))
    text = str(error.value)
    assert not JARGON.search(text), text
    return text


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"name = \n", "is not valid TOML"),
        (b"name = 'a'\nname = 'b'\n", "is not valid TOML"),
        (b"[material\n", "is not valid TOML"),
        (b"\xff\xfen\x00", "is not UTF-8 text (byte 1); save it as UTF-8"),
        (b"name = 'a\xff'\n", "is not UTF-8 text (byte 10)"),
        (b"x = " + b"[" * 5000, "body.toml"),
        (b"x = " + b"9" * 5000, "body.toml"),
        (b"\x00", "is not valid TOML"),
        (b"", "name: is missing; add it"),
    ],
)
def test_what_is_no_settings_file(tmp_path: Path, content: bytes, words: str) -> None:
    (tmp_path / "body.toml").write_bytes(content)
    text = refusal(tmp_path / "body.toml")
    assert words in text
    assert all(str(tmp_path / "body.toml") in line for line in text.splitlines())


def test_missing_files_and_folders(tmp_path: Path) -> None:
    assert "cannot be read (No such file" in refusal(tmp_path / "none.toml")
    assert "is a folder" in refusal(tmp_path)
    assert "cannot be read" in refusal(tmp_path / "nul\0.toml")


def test_a_byte_order_mark_is_no_mistake(tmp_path: Path) -> None:
    text = (ROOT / "geometry" / "blade" / "body.toml").read_text(encoding="utf-8")
    (tmp_path / "body.toml").write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    assert load_body(tmp_path / "body.toml")[0] == load_body(ROOT / "geometry" / "blade" / "body.toml")[0]


# ---------------------------------------------------------------- units

BODY = """
name = "b"
length_unit = "{unit}"
[geometry]
cad = "part.step"
[[geometry.faces]]
name = "clamp"
box = [{a}, {a}, {a}, {b}, {b}, {b}]
[mesh]
size = {a}
local.clamp = {b}
[material]
density = 7850
young = 2.1e11
poisson = 0.3
[rotation]
point = [0, 0, {b}]
[[loads]]
kind = "force"
point = [{a}, {b}, {a}]
vector = [1, 2, 3]
[[excitations]]
name = "e"
point = [{a}, {b}, {a}]
direction = [1, 0, 0]
[[monitors]]
name = "m"
point = [{b}, {b}, {a}]
[[gauges]]
name = "g"
point = [{b}, {a}, {a}]
direction = [0, 0, 1]
"""


PER_METRE = {"mm": 1e3, "cm": 1e2, "in": 1 / 0.0254, "um": 1e6, "ft": 1 / 0.3048}


@pytest.mark.parametrize(("unit", "metre"), PER_METRE.items())
def test_every_length_becomes_metres_and_nothing_else(tmp_path: Path, unit: str, metre: float) -> None:
    for name, factor in (("m", 1.0), (unit, metre)):
        (tmp_path / f"{name}.toml").write_text(BODY.format(unit=name, a=repr(0.125 * factor), b=repr(0.5 * factor)))
    expected, found = load_body(tmp_path / "m.toml")[0], load_body(tmp_path / f"{unit}.toml")[0]

    def compare(a: Any, b: Any, where: str) -> None:
        if isinstance(a, dict):
            for key in a:
                if key != "length_unit":
                    compare(a[key], b[key], f"{where}.{key}")
        elif isinstance(a, (list, tuple)):
            for i, (x, y) in enumerate(zip(a, b, strict=True)):
                compare(x, y, f"{where}.{i}")
        elif isinstance(a, float):
            assert b == pytest.approx(a, rel=1e-12), where
        else:
            assert a == b, where

    compare(expected.model_dump(), found.model_dump(), "")


def test_the_raw_table_keeps_the_units_of_the_file(tmp_path: Path) -> None:
    (tmp_path / "b.toml").write_text(BODY.format(unit="mm", a=125.0, b=500.0))
    settings, raw = load_body(tmp_path / "b.toml")
    assert raw["mesh"]["size"] == 125.0
    assert settings.mesh.size == pytest.approx(0.125)


# ---------------------------------------------------------------- overrides


def overridden(*assignments: str) -> dict[str, Any]:
    return override(copy.deepcopy(small.table()), list(assignments), Path("body.toml"))


def test_overrides() -> None:
    table = overridden(
        "modes.count=7", "name=other", 'description="two words"', "interfaces.right.t2=[0.0, 1.0, 0.0]", "mesh.size=3",
        "supports.clamp.directions=xy", "excitations.1.face=tip", "damping.ratio = 0.5", "output.gauss=false",
    )  # fmt: skip
    assert table["modes"]["count"] == 7
    assert table["name"] == "other"
    assert table["description"] == "two words"
    assert table["interfaces"][0]["t2"] == [0.0, 1.0, 0.0]
    assert table["mesh"] == {"size": 3}
    assert table["supports"][0]["directions"] == "xy"
    assert table["excitations"][1]["face"] == "tip"
    assert table["damping"]["ratio"] == 0.5
    assert table["output"]["gauss"] is False


def test_bare_text_is_text() -> None:
    assert overridden("name=a\nb")["name"] == "a\nb"
    assert overridden("name=1\nother=2")["name"] == "1\nother=2"
    assert overridden("name=")["name"] == ""


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("modes.count", "is no setting; write --set key.subkey=value"),
        ("=3", "is no setting"),
        ("modes..count=3", "is no setting"),
        (".=3", "is no setting"),
        ("name.sub=3", "'name' in body.toml is a value, not a table"),
        ("modes.count.sub=3", "'modes.count' in body.toml is a value"),
        ("interfaces.rihgt.t2=[0,0,1]", "has no entry 'rihgt' there; choose one of right, left"),
        ("interfaces.right=3", "write --set interfaces.NAME.KEY=value"),
    ],
)
def test_overrides_that_fit_nowhere(text: str, words: str) -> None:
    refused(words, overridden, text)


def test_mistakes_in_overrides_are_named_like_those_of_the_file() -> None:
    blade = ROOT / "geometry" / "blade" / "body.toml"
    assert "modes.cuont: unknown key; did you mean 'count'?" in refusal(blade, "modes.cuont=3")
    assert 'modes.count: must be a whole number (it is "many")' in refusal(blade, "modes.count=many")
    assert "interfaces.right.role: must be" in refusal(blade, "interfaces.right.role=3")


# ---------------------------------------------------------------- plausibility, damping


def test_implausible_units_are_warned_about_and_can_be_overridden() -> None:
    def warnings(size: float, **changes: Any) -> str:
        return "\n".join(implausible(BodySettings.model_validate(changed(**changes)), size))

    assert warnings(0.12) == ""
    assert "7.85 kg/m3" in warnings(0.12, material__density=7.85)
    assert "210000 Pa" not in warnings(0.12)
    assert "material.young" in warnings(0.12, material__young=210.0)
    assert "475 m long" in warnings(475.0)
    assert warnings(475.0, material__density=7.85, material__unusual=True) == ""


def test_damping_ratios() -> None:
    omega = np.array([0.0, 100.0, 400.0])

    def ratios(**damping: Any) -> Any:
        return BodySettings.model_validate(changed(damping=damping)).damping.ratios(omega)

    assert ratios(ratio=0.01).tolist() == [0.0, 0.01, 0.01]
    assert ratios(table=[0.0, 0.02]).tolist() == [0.0, 0.02, 0.02]
    assert np.allclose(ratios(alpha=4.0, beta=1e-4), [0.0, 0.02 + 0.005, 0.005 + 0.02], rtol=1e-14)
    assert ratios().tolist() == [0.0, 0.0, 0.0]


def test_toml_is_read_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("a = 1\n[b]\nc = [1, 2.5]\n")
    assert load_toml(tmp_path / "a.toml") == {"a": 1, "b": {"c": [1, 2.5]}}
