"""Of an Ansys archive: parameters, arrays, arithmetic and *IF; the words of its commands."""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from .archive import Archive, Command, Table
from .raw import Damaged, real

_NUMBER = r"[-+]?(\d+\.?\d*|\.\d+)([eEdD][-+]?\d{1,3})?"
_TEXTS = ("/COM", "/TITLE", "/STITLE", "C***", "/WB", "/INPUT")
"""Beginnings of lines that are texts, in which no command stands."""


def commands(archive: Archive, line: str) -> Iterator[list[str]]:
    """The words of the commands of a line, parameters replaced by their values."""
    line = line.split("!")[0].strip()
    if line.upper().startswith(_TEXTS):
        return
    for part in line.split("$"):
        if named := re.match(r"\s*([A-Za-z_][\w ]*?)\s*(\([^()]*\))?\s*=(.*)$", part):
            yield ["*SET", named[1] + (named[2] or "").replace(" ", ""), *_words(named[3])]
            continue
        words = _words(part)
        if words[0].upper() in ("*SET", "*DIM", "*GET", "*TAXIS"):
            yield words
        elif words[0]:
            yield [words[0], *(evaluated(archive, word) for word in words[1:])]


def _words(text: str) -> list[str]:
    """What commas part, outside of brackets."""
    return [word.strip() for word in re.split(r",(?![^()]*\))", text)]


# arithmetic -------------------------------------------------------------------------------------

_OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: math.pow, ast.USub: operator.neg, ast.UAdd: operator.pos,
}  # fmt: skip
_FUNCTIONS: dict[str, Callable[[float], float]] = {"SQRT": math.sqrt, "ABS": abs}


def evaluated(archive: Archive, word: str) -> str:
    """A word with the values of its parameters; as it stands if it is no arithmetic of known ones."""
    word = archive.parameters.get(word.strip("%").upper(), word)
    if re.fullmatch(_NUMBER, word) or not re.fullmatch(r"[\w\s.+\-*/()]+", word):
        return word
    if not re.search(r"[-+*/]", word) or len(word) > 200:
        return word
    try:
        plain = re.sub(r"(?<=[\d.])[dD](?=[-+]?\d)", "e", word.strip())
        value = _number(archive, ast.parse(plain, mode="eval").body)
    except (SyntaxError, ValueError, KeyError, ArithmeticError, RecursionError, MemoryError):
        return word
    return repr(value) if np.isfinite(value) else word


def _number(archive: Archive, node: ast.AST) -> float:
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return float(node.value)
    if isinstance(node, ast.Name):
        return float(archive.parameters[node.id.upper()])
    if isinstance(node, ast.UnaryOp):
        return float(_OPERATORS[type(node.op)](_number(archive, node.operand)))
    if isinstance(node, ast.BinOp):
        first, second = _number(archive, node.left), _number(archive, node.right)
        return float(_OPERATORS[type(node.op)](first, second))
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and len(node.args) == 1:
        return float(_FUNCTIONS[node.func.id.upper()](_number(archive, node.args[0])))
    raise ValueError(ast.dump(node))


# parameters and arrays --------------------------------------------------------------------------


def _set(archive: Archive, words: list[str]) -> None:
    """*SET, name, value: a number, or arithmetic; of an array name(row, column), values of rows."""
    if place := re.fullmatch(r"(\w+)\(([^()]*)\)", words[1]):
        _fill(archive, place[1].upper(), place[2].split(","), words[2:])
        return
    name, value = words[1].upper(), evaluated(archive, words[2])
    archive.parameters.pop(name, None)
    if re.fullmatch(_NUMBER, value):
        number = real(value, "*SET")
        whole = number.is_integer() and not re.search("[eEdD]", value) and abs(number) < 1e15
        archive.parameters[name] = str(int(number)) if whole else value


def _fill(archive: Archive, name: str, place: list[str], values: list[str]) -> None:
    """name(row, column, plane) = value, values of the rows behind it; column 0 is the axis."""
    if (table := archive.arrays.get(name)) is None or table.kind != "TABLE":
        return
    row, column, plane = (evaluated(archive, word.strip()) or "1" for word in [*place, "1", "1"][:3])
    if not row.isdecimal():
        raise Damaged(f"{name}({','.join(place)}) names no row; write its number")
    if {column, plane} <= {"0", "1"}:
        into = table.axis if column == "0" else table.values
        for i, word in enumerate(word for word in values if word):
            into[int(row) + i] = evaluated(archive, word)
    else:
        table.several = True


def _dimension(archive: Archive, words: list[str]) -> None:
    """*DIM, name, kind, rows, columns, planes, variables."""
    kind, more = (words[2] or "ARRAY").upper(), [w for w in words[4:6] if w not in ("", "0", "1")]
    archive.arrays[words[1].upper()] = Table(kind, words[6].upper(), bool(more))


def _axis(archive: Archive, words: list[str]) -> None:
    """*TAXIS, name(row), dimension, values."""
    name, _, row = words[1].partition("(")
    table = archive.arrays.get(name.strip().upper())
    if table is not None and words[2] in ("", "1"):
        first = row.strip(" )").partition(",")[0] or "1"
        for i, word in enumerate((w for w in words[3:] if w), int(first) if first.isdecimal() else 1):
            table.axis[i] = evaluated(archive, word)


def value_at(archive: Archive, word: str, time: float) -> float | None:
    """A number, or a table's at a time; None of a table that hangs on something else, or is not there.

    Raises:
        Damaged: neither a number nor a name in %.
    """
    if not word.startswith("%"):
        return real(word, "a load")
    table = archive.arrays.get(word.strip("%").upper())
    if table is None or table.several or not table.values:
        return None
    rows = sorted(table.values)
    values = [real(table.values[row], word) for row in rows]
    if len(set(values)) == 1:
        return values[0]
    if table.variable != "TIME" or any(row not in table.axis for row in rows):
        return None
    return float(np.interp(time, [real(table.axis[row], word) for row in rows], values))


# branches ---------------------------------------------------------------------------------------

_TESTS: dict[str, Callable[[float, float], bool]] = {
    "EQ": operator.eq, "NE": operator.ne, "LT": operator.lt, "GT": operator.gt, "LE": operator.le,
    "GE": operator.ge,
}  # fmt: skip


def skipped(archive: Archive, words: list[str]) -> bool:
    """Whether a command is not executed, *IF and what belongs to it among them.

    A parameter that is not defined is zero, as in Ansys; one of *GET counts as such.
    """
    word, branches = words[0].upper(), archive.branches
    if word == "*IF" and [*words, *[""] * 4][4].upper() == "THEN":
        holds = all(reading for reading, _ in branches) and _holds(words)
        branches.append((holds, holds))
    elif word in ("*ELSEIF", "*ELSE") and branches:
        holds = not branches[-1][1] and (word == "*ELSE" or _holds(words))
        holds = holds and all(reading for reading, _ in branches[:-1])
        branches[-1] = holds, branches[-1][1] or holds
    elif word == "*ENDIF" and branches:
        branches.pop()
    else:
        return not all(reading for reading, _ in branches)
    return True


def _holds(words: list[str]) -> bool:
    first, test, second = [*words, "", ""][1:4]
    a, b = (float(w) if re.fullmatch(_NUMBER, w) else 0.0 for w in (first, second))
    texts = "'" in first + second
    if test.upper() not in _TESTS:
        raise Damaged(f"*IF,{first},{test},{second} has a test that is not read; write EQ, NE, LT, GT")
    return first == second if texts else _TESTS[test.upper()](a, b)


def _macro(archive: Archive, words: list[str]) -> None:
    """*CREATE: what stands up to *END is another file's."""
    while archive.at < len(archive.lines):
        archive.at += 1
        if archive.lines[archive.at - 1].strip().upper() == "*END":
            return
    raise Damaged("*CREATE has no *END, the file is truncated")


def _got(archive: Archive, words: list[str]) -> None:
    """*GET, parameter: its value comes from the program's database; what it was before does not stand any more."""
    archive.parameters.pop(words[1].upper(), None)


COMMANDS: dict[str, Command] = {
    "*SET": _set, "*DIM": _dimension, "*TAXIS": _axis, "*GET": _got,
    "*CREATE": _macro,
}  # fmt: skip
