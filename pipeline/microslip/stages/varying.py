"""The answers of a verb under several values of one key: all in one picture and one table, the key as a column."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis import Answer, Files
from ..data import Array
from ..errors import UserError
from ..files import store
from ..files.png import BESIDE, CURVES, text_in
from ..pictures.overlaid import can_overlay, overlaid
from ..results.dataset import Dataset, Variable
from ..settings.toml import load_toml, override
from ..units import Quantity
from .answer import Written, answered, written
from .stage import Report, Stage, folder_of_case

Tables = dict[str, dict[str, list[str]]]
"""Stem of a table -> its columns, as they are written."""


def varied(
    path: Path, vary: str, assignments: Sequence[str], answer: Callable[[list[str], Path], Written],
    root: Path = Path("build"), report: Report = lambda _: None, force: bool = False,
) -> Written:  # fmt: skip
    """The answers under all values, each in the folder of its value, and what is made of them beside these.

    Args:
        path: the settings file. vary: ``KEY=a,b,c``, values as ``--set`` has them. assignments: of other keys.
        answer: is called with assignments and a folder. root: holds the folder of the file's name.

    Raises:
        UserError: fewer than two values; a key or a value that the file cannot have.
    """
    key, values = values_of(vary)
    name = str(override(load_toml(path), list(assignments), path).get("name", path.stem))
    folder = folder_of_case(path, name if re.fullmatch(r"[\w.-]+", name) else path.stem, root)
    answers = dict[str, Written]()
    for value in values:
        report(f"{key} = {value}")
        one = f"{key}={value}"
        try:
            answers[value] = answer([*assignments, one], folder / _called([one, *assignments]))
        except UserError as error:
            error.key = error.key.replace(f"--set {key}", f"--vary {key}")
            raise
    pages = [f.stem for f in next(iter(answers.values())).files if f.suffix == ".html"]
    stem = pages[0] if pages else "contact"  # whose answer has none
    own = folder / _called([f"{key}={','.join(values)}", *assignments])
    files = {value: [f for f in one.files if f.suffix in (".csv", ".png")] for value, one in answers.items()}
    inputs = {"files": {v: [store.hash_file(f) for f in each] for v, each in files.items()}, "beside": BESIDE.get()}
    stage = Stage(own / f"{stem}.json", ("stages.varying",), force, report)

    def work() -> Written:
        stage.begin()
        gathered = _gathered(key, stem, files, {v: one.said for v, one in answers.items()}, name)
        return written(gathered, stem, own, f"{name}: {stem} over {key}", True)

    found = answered(stage, inputs, work)
    lost = [f"{key} = {value}: {one.missing or 'not whole'}" for value, one in answers.items() if not one.whole]
    return Written(found.files, found.said, not lost, "; ".join(lost))


def values_of(vary: str) -> tuple[str, list[str]]:
    """Key and values of ``KEY=a,b,c``; commas within brackets or quotes part nothing.

    Raises:
        UserError: no key, or not two different values.
    """
    key, _, text = (part.strip() for part in vary.partition("="))
    parts, depth, quoted = [""], 0, False
    for sign in text:
        quoted ^= sign == '"'
        depth += 0 if quoted else (sign in "[{") - (sign in "]}")
        if sign == "," and not depth and not quoted:
            parts.append("")
        else:
            parts[-1] += sign
    values = [part.strip() for part in parts]
    if not key or len(set(values)) < max(2, len(values)) or "" in values:
        raise UserError("give two or more different values: --vary key.subkey=a,b,c", f"--vary {key}")
    if key == "name":
        raise UserError("names do not vary, products are kept by them; give a number of the case", "--vary name")
    return key, values


def _called(assignments: Sequence[str]) -> str:
    """Folder of the products under these assignments, the same ones in the same folder."""
    words = "+".join(of for of in assignments if not of.startswith("name="))
    plain = re.sub(r"[^\w.=,+-]+", "_", words)
    return plain if plain == words and len(plain) <= 80 else f"{plain[:60]}-{store.hash_settings(words)[:8]}"


def _gathered(
    key: str, stem: str, files: Mapping[str, Sequence[Path]], said: Mapping[str, Sequence[str]], name: str
) -> Answer:
    """What is made of the tables and the pictures that all answers have."""
    tables = {value: _tables(each) for value, each in files.items()}
    shared = [t for t in next(iter(tables.values())) if all(t in each for each in tables.values())]
    data = {
        re.sub(rf"^{re.escape(stem)}_?", "", table): _joined(key, {v: each[table] for v, each in tables.items()})
        for table in shared
    }
    drawn = [{f.name: f for f in each if f.suffix == ".png"} for each in files.values()]
    pictures: Files = {}
    for file in (f for f in drawn[0] if all(f in each for each in drawn)):
        texts = [text_in(each[file].read_bytes(), CURVES) for each in drawn]
        curves = {value: json.loads(text) for value, text in zip(files, texts, strict=True) if text}
        if len(curves) == len(files) and can_overlay(list(curves.values())):
            title = f"{name}: {Path(file).stem.replace('_', ' ')} over {key}"
            pictures[f"pictures/{file}"] = partial(overlaid, curves, key, title)
    sentences = [f"{key} = {value}: {of[0]}" for value, of in said.items() if of]
    return Answer(sentences, data, files=pictures)


def _tables(files: Sequence[Path]) -> Tables:
    """Those of an answer that have rows."""
    found = {}
    for file in (f for f in files if f.suffix == ".csv"):
        with file.open(newline="", encoding="utf-8") as lines:
            head, *rows = csv.reader(lines)
        found[file.stem] = {name: [row[i] for row in rows] for i, name in enumerate(head)}
    return found


def _joined(key: str, tables: Mapping[str, Mapping[str, Sequence[str]]]) -> Dataset:
    """One below the other, with the value of the key before them; a column that one lacks is empty there."""
    names = dict.fromkeys(name for table in tables.values() for name in table)
    counts = [len(next(iter(table.values()))) for table in tables.values()]
    columns: dict[str, Any] = {key: [v for v, n in zip(tables, counts, strict=True) for _ in range(n)]}
    for name in names:
        each = zip(tables.values(), counts, strict=True)
        own = f"{name} of the table" if name == key else name
        columns[own] = [cell for table, n in each for cell in table.get(name, [""] * n)]
    return Dataset("varied", dict(_variable(name, cells) for name, cells in columns.items()), {"key": key})


def _variable(column: str, cells: Sequence[str]) -> tuple[str, Variable]:
    """Name and array of a column; its unit is what its name ends with."""
    try:
        values: Array = np.array([float(cell or "nan") for cell in cells])
    except ValueError:
        values = np.array(cells)
    name, _, unit = column.rpartition("_")
    alone = name and not re.search(r"_(m|rad|N|Pa|J|kg|W|1)$", name)  # not m_s, rad_s, which the name tells
    known = unit in ("m", "rad", "N", "Hz", "Pa", "J", "s", "kg", "W", "K") and alone
    assert not known or Quantity(unit).column(name) == column
    return (name, Variable(values, unit)) if known else (column, Variable(values))
