"""docs/book.md: what it names exists, and nothing that the book numbers is missing (lists taken from its text once)."""

from __future__ import annotations

import ast
import re
import shlex
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

import microslip
from microslip.analysis import places, verb_of
from microslip.case import load_case
from microslip.contact.settings import load_contact
from microslip.rolling.settings import load_rolling

ROOT = Path(__file__).parents[1]
PACKAGE, CASES, BODIES = ROOT / "pipeline" / "microslip", ROOT / "pipeline" / "cases", ROOT / "geometry"

FIGURES = {
    "1.1": 7, "1.2": 8, "2.1": 1, "2.2": 1, "3.1": 1, "3.2": 1, "3.3": 9, "3.4": 2, "3.5": 3, "3.6": 5, "3.7": 7,
    "3.8": 4, "3.9": 4, "4.1": 1, "4.2": 3, "4.3": 2, "4.4": 3, "5.1": 3, "5.2": 7, "5.3": 11, "5.4": 4, "5.5": 9,
    "5.6": 6, "5.7": 2, "6.1": 2, "6.2": 2, "6.3": 1, "6.5": 2, "6.6": 6, "6.7": 6, "6.8": 4, "6.9": 1, "6.10": 5,
}  # fmt: skip
"""Section -> number of its figures; 133 as the title page says."""

EQUATIONS = {
    "2.1": 21, "2.2": 23, "2.3": 34, "2.4": 17, "3.1": 36, "3.2": 31, "3.3": 41, "3.4": 6, "3.6": 22, "3.7": 48,
    "3.8": 29, "3.9": 10, "4.1": 23, "4.3": 1, "4.4": 11, "5.1": 13, "5.2": 41, "5.6": 18, "6.2": 23, "6.3": 19,
    "6.4": 46, "6.5": 37, "6.6": 7, "6.7": 23, "6.8": 6,
}  # fmt: skip
"""Section -> number of its last equation."""

SKIPPED = {"6.7-6"}
"""Numbers that no equation of the book has."""

STATES = ("reproduced", "different", "not reproducible", "not there yet", "parameters reproduced")


@cache
def rows() -> list[list[str]]:
    """Cells of the chapters' tables: printed, what, where, test, state."""
    text = (ROOT / "docs" / "book.md").read_text(encoding="utf-8")
    cells = [[c.strip() for c in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]
    return [row for row in cells if len(row) == 5 and row[0] != "printed" and "---" not in row[0]]


def numbered(cell: str, bracketed: bool) -> list[str]:
    """Equations (in brackets) or figures of the first cell, ranges written out."""
    form = r"\((\d\.\d+-\d+)\)" if bracketed else r"(?<![(\d.])(\d\.\d+-\d+)"
    found = [(m[1], m.start(), m.end()) for m in re.finditer(form, cell)]
    out = [n for n, *_ in found]
    for (first, _, end), (last, start, _) in pairwise(found):
        if cell[end:start] == " to ":
            section, low = first.split("-")
            out += [f"{section}-{i}" for i in range(int(low) + 1, int(last.split("-")[1]))]
    return out


def counted(sections: dict[str, int]) -> set[str]:
    return {f"{section}-{i}" for section, n in sections.items() for i in range(1, n + 1)}


def test_every_figure_and_equation_has_a_row() -> None:
    assert sum(FIGURES.values()) == 133
    assert {n for row in rows() for n in numbered(row[0], bracketed=False)} == counted(FIGURES)
    equations = [n for row in rows() for n in numbered(row[0], bracketed=True)]
    assert set(equations) == counted(EQUATIONS) - SKIPPED
    assert len(equations) == len(set(equations))


def test_every_row_says_what_became_of_it() -> None:
    for printed, _, where, test, state in rows():
        assert state.startswith(STATES), printed
        assert where or test or state.startswith(("not reproducible", "not there yet")), printed


@cache
def tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


@cache
def checks() -> set[str]:
    """Names of all test functions."""
    files = (ROOT / "tests").rglob("test_*.py")
    return {name for f in files for name in re.findall(r"^def (test_\w+)", f.read_text(encoding="utf-8"), flags=re.M)}


def holds(body: list[ast.stmt], name: str) -> list[ast.stmt] | None:
    """What stands in a class or function of that name, [] of a value; None: there is nothing of that name."""
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == name:
            return node.body
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        if name in {t.id for t in targets if isinstance(t, ast.Name)}:
            return []
    return None


def is_code(name: str) -> bool:
    """A module of the package, or something in one."""
    where, parts = PACKAGE, name.split(".")
    while parts and (where / parts[0]).is_dir():
        where = where / parts.pop(0)
    file = where / "__init__.py"
    if parts and (where / f"{parts[0]}.py").is_file():
        file = where / f"{parts.pop(0)}.py"
    body: list[ast.stmt] | None = tree(file).body
    for part in parts:
        body = holds(body, part)
        if body is None:
            return False
    return True


@cache
def verbs() -> set[str]:
    """Of the analyses that have one."""
    return {verb_of(name).name for name in places()}


@cache
def drawn() -> set[str]:
    """Numbers of the figures that docs/figures.py draws."""
    bodies = [tree(ROOT / "docs" / f"{name}_study.py").body for name in ("figure", "rolling", "heat")]
    tables = [n.value for body in bodies for n in body if isinstance(n, ast.AnnAssign) and n.target.id == "FIGURES"]
    return {key.value for table in tables for key in table.keys}


def is_command(text: str) -> bool:
    """A verb with its case, body or figure; a target of make; a study of the pictures."""
    program, verb, *rest = shlex.split(text)
    cases, bodies = {p.stem for p in CASES.glob("*.toml")}, {p.parent.name for p in BODIES.glob("*/body.toml")}
    if program == "make" and verb.startswith("figure-"):
        return not rest and verb.removeprefix("figure-") in drawn()
    if program == "make":
        return not rest and (verb in cases | bodies or verb.removesuffix("-modes") in bodies)
    if program == "python":
        names = {n.name for n in tree(ROOT / verb).body if isinstance(n, ast.FunctionDef)}
        return verb == "docs/make_pictures.py" and set(rest) <= names
    figures = {p.stem.removeprefix("fig-") for p in (CASES / "contact").glob("fig-*.toml")}
    known = figures if verb == "contact" else cases | bodies | {"CASE"}
    there = rest[0] in known or (ROOT / rest[0]).is_file()
    return there and (verb in verbs() or holds(tree(PACKAGE / "cli.py").body, verb) is not None)


def exists(name: str) -> bool:
    if name.startswith("test_"):
        return name in checks()
    if name.startswith(("make ", "microslip ", "python ")):
        return is_command(name)
    if name.startswith("ms."):
        return name.removeprefix("ms.") in microslip.__all__
    return (ROOT / name).is_file() if "/" in name else is_code(name)


@pytest.mark.parametrize("column", [2, 3], ids=["where", "test"])
def test_what_is_named_exists(column: int) -> None:
    missing = [(row[0], n) for row in rows() for n in re.findall(r"`([^`]+)`", row[column]) if not exists(n)]
    assert not missing


def test_settings_of_commands_are_keys_of_their_files() -> None:
    commands = [c for row in rows() for c in re.findall(r"`(microslip [^`]+ --set [^`]+)`", row[2])]
    for _, verb, what, *rest in map(shlex.split, commands):
        load = {"contact": load_contact, "roll": load_rolling}.get(verb, load_case)
        file = CASES / f"contact/fig-{what}.toml" if verb == "contact" else CASES / f"{Path(what).stem}.toml"
        load(file, [text for flag, text in pairwise(rest) if flag == "--set"])
    assert len(commands) > 5


def test_errata_name_code_that_exists() -> None:
    text = (ROOT / "docs" / "errata.md").read_text(encoding="utf-8")
    named = [n for n in re.findall(r"`([^`]+)`", text) if re.fullmatch(r"[a-z_]+(\.\w+)+", n)]
    assert len(named) > 20 and not [n for n in named if not is_code(n)]


def test_names_that_do_not_exist_are_found() -> None:
    bad = ["contact.layer.Layer.moduli", "contact.lawyer", "test_nothing", "ms.none", "geometry/blade/third.toml"]
    bad += ["make ringlet", "microslip contact 3.7-9", "microslip respond rung", "microslip answer ring"]
    bad += ["python docs/make_pictures.py rings"]
    assert not any(map(exists, bad))
    good = ["contact.layer.Layer.modulus", "contact.layer", "sliding", "make blade-modes", "microslip respond ring"]
    assert all(map(exists, good))
