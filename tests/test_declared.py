"""A noun's fields say how they stand in a file: one line more is written, read, checked and documented."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import h5py
import numpy as np
import pytest

from microslip.data import Array, RunUp, Stored, StressSet
from microslip.files.declared import agrees, declared, numbers, read, write
from microslip.files.hdf5 import put_scale

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs"))

import pages  # noqa: E402


@dataclass(frozen=True)
class Gyrated(RunUp):
    """A noun with one dataset more."""

    drag: Annotated[Array, Stored("mode place", "N", "what slows it", when="it is slowed")]


def made(where: h5py.Group, drag: Array) -> Gyrated:
    rng = np.random.default_rng(1)
    noun = Gyrated(*rng.normal(size=(2, 3, 3)), *rng.normal(size=(2, 3)), drag)
    scales = {name: put_scale(where, name, np.arange(1, 4)) for name in ("mode", "mode_column")}
    write(where.create_group("run_up"), noun, scales)
    return noun


@pytest.fixture
def where(tmp_path: Path) -> h5py.Group:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        yield file


def test_a_new_dataset_is_one_line(where: h5py.Group) -> None:
    noun = made(where, np.arange(6.0).reshape(3, 2) + 1j)
    again = read(Gyrated, where["run_up"], {"mode": 3})
    for field in declared(Gyrated):
        np.testing.assert_array_equal(getattr(again, field), getattr(noun, field))
    drag = where["run_up/drag"]
    assert drag.attrs["unit"] == "N" and [d.label for d in drag.dims] == ["mode", "place"]
    assert where["run_up/place"][()].tolist() == [1, 2] and drag.dims[0][0] == where["mode"]
    row = ["`S/run_up/drag`", "mode x place", "N", "what slows it; only if it is slowed"]
    assert row in pages.stored_rows("S/run_up", Gyrated)
    assert agrees(noun, {"mode": 3}) and not agrees(noun, {"mode": 3, "place": 4})
    assert any(a is noun.drag for a in numbers(noun))


def test_what_is_there_only_sometimes_may_be_left_out(where: h5py.Group) -> None:
    made(where, np.zeros((0, 2)))
    assert "drag" not in where["run_up"]
    assert read(Gyrated, where["run_up"], {"mode": 3, "place": 2}).drag.shape == (0, 2)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (None, "/run_up/P is missing"),
        (np.zeros((3, 2)), r"/run_up/P has shape \(3, 2\), expected 3 x 3"),
        (np.zeros((3, 3), dtype=int), "/run_up/P does not hold floating-point numbers"),
    ],
)
def test_what_is_wrong_is_named(where: h5py.Group, value: Array | None, words: str) -> None:
    made(where, np.ones((3, 2)))
    del where["run_up/P"]
    if value is not None:
        where["run_up/P"] = value
    with pytest.raises(ValueError, match=words):
        read(Gyrated, where["run_up"], {"mode": 3})


def test_lengths_that_nothing_else_tells_must_agree(where: h5py.Group) -> None:
    for name, shape in (("points", (4, 3)), ("weights", (5,)), ("T", (4, 6, 2))):
        where[f"stress/a/{name}"] = np.zeros(shape)
    where["strain/a/T"], where["rotation/sigma_static/a"] = np.zeros((4, 6, 2)), np.zeros((4, 6))
    where["stress/a"].attrs["location"] = "nodes"
    with pytest.raises(ValueError, match=r"/stress/a/weights has shape \(5,\), expected 4"):
        read(StressSet, where, {"mode": 2}, "a")


def test_the_schema_says_what_the_nouns_say() -> None:
    """Type, axes, unit and whether it must be there, of every dataset in the schema for other programs."""
    schema = json.loads((ROOT / "conformance" / "schema.json").read_text(encoding="utf-8"))
    entries, labels = {}, schema["labels"]
    for e in schema["entries"]:
        for word in ("interface", "excitation", "set", "contact"):
            e["path"] = e["path"].replace(f"<{word}>", "<name>")
        entries[e["path"]] = e
    for group, noun in pages.STORED:
        for field, (how, _) in declared(noun).items():
            at = how.at or field
            if "@" in at:
                continue
            entry = entries[at if at[0] == "/" else f"{group}/{at}"]
            axes, known = how.over.split(), [labels.get(d, [d]) for d in entry["shape"]]
            twins = {"mode_column": "mode", "compliance_column": "compliance_row"}
            assert all(d in k or d == twins.get(k[0]) for d, k in zip(axes, known, strict=True)), entry
            assert entry.get("unit", "") == how.unit, entry
            assert entry["required"] == (not how.when) or entry.get("when") == "one each" or at == "patch/shapes", entry
