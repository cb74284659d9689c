"""A picture computes nothing: every number written into one is a value of a result, carried.

Read from the code itself: of each number in a formatted string of `pictures/`, and of each that is
given to a function which words numbers, the names are followed back, from function to function of
the module, to where they come from. On the way there may be attributes, subscripts, choices, changes
of the unit and counts, and a function of another room that the tables of `report/`, `stages/` or `verbs/` are
made by as well. Everything else is arithmetic, which belongs to the room whose table the number
stands in.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import microslip

ROOM = Path(microslip.__file__).parent

WORDS = {"sized", "percent", "number", "hertz", "rpm_text", "_energy", "_number", "_area_text", "length_text"}
"""Functions and methods that make words of a number."""

CARRY = WORDS | set(
    """
    _sized in_shades in_unit abs array astype columns counted dict enumerate float fromkeys in_modes int
    items len list max min open_studio range replace reshape reversed round scale shared sorted
    span stack str to_rpm tolist tuple unique values zip
    """.split()
)
"""Calls that leave a value what it is, choose one by its place, count, or change the unit it is shown in."""

OF_THE_DRAWING = {"grown", "factor", "degrees", "metres", "top", "full_scale"}
"""Names of numbers that say how something is drawn, and stand in no table: how many times as large,
at which instant, how long the bar is, where a scale ends."""


def numbers(tree: ast.AST) -> Iterator[ast.expr]:
    """Every expression that is written as a number."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FormattedValue) and node.format_spec is not None:
            yield node.value
        elif isinstance(node, ast.Call) and named(node) in WORDS:
            yield from node.args[:1]


def named(call: ast.Call) -> str:
    """The last part of the name of what is called."""
    return getattr(call.func, "attr", getattr(call.func, "id", ""))


def imported(tree: ast.AST) -> set[str]:
    """Names that a module has from other rooms."""
    far = [n for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) and n.level > 1]
    return {alias.asname or alias.name for node in far for alias in node.names}


@cache
def of_tables() -> frozenset[str]:
    """Names that tables and pages are made by."""
    files = [f for room in ("report", "stages", "verbs") for f in (ROOM / room).glob("*.py")]
    return frozenset().union(*(imported(ast.parse(f.read_text(encoding="utf-8"))) for f in files))


class Module:
    """Where the names of each function of a module come from."""

    def __init__(self, source: str) -> None:
        tree = ast.parse(source)
        self.functions = {n.name: n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)}
        self.shared = imported(tree) & of_tables()
        self.origins = {name: self._bound(function) for name, function in self.functions.items()}
        self.calls = [(name, n) for name, f in self.functions.items() for n in ast.walk(f) if isinstance(n, ast.Call)]

    def _bound(self, function: ast.AST) -> dict[str, list[ast.expr]]:
        found: dict[str, list[ast.expr]] = {}
        for node in ast.walk(function):
            if isinstance(node, ast.Assign):
                for target in node.targets:
                    bind(found, target, node.value)
            elif isinstance(node, (ast.AnnAssign, ast.NamedExpr)) and node.value is not None:
                bind(found, node.target, node.value)
            elif isinstance(node, (ast.For, ast.comprehension)):
                bind(found, node.target, node.iter)
        return found

    def arithmetic(self) -> list[str]:
        """Numbers that the module computes itself: line, what is written, and what it comes from."""
        found = dict[str, None]()
        for name, function in self.functions.items():
            for value in numbers(function):
                if (why := self.computed(value, name, frozenset())) is not None:
                    found[f"{value.lineno}: {ast.unparse(value)} by {ast.unparse(why)}"] = None
        return list(found)

    def computed(self, value: ast.expr | None, where: str, seen: frozenset[tuple[str, str]]) -> ast.expr | None:
        """The arithmetic that a value of a function comes from, if there is any."""
        match value:
            case ast.Name(id=name):
                if (where, name) in seen or name in OF_THE_DRAWING:
                    return None
                seen |= {(where, name)}
                if (known := self.origins[where].get(name)) is not None:
                    return self._first(known, where, seen)
                given = self._given(where, name)
                return next((w for at, v in given if (w := self.computed(v, at, seen)) is not None), None)
            case ast.Call(func=ast.Name(id=name)) if name in self.functions and name not in CARRY:
                function = self.functions[name]
                told = [n.value for n in ast.walk(function) if isinstance(n, ast.Return) and n.value]
                own = seen | {(name, p) for p in parameters(function)}  # which are looked at as they are here
                return self._first(told, name, own) or self._first(value.args, where, seen)
            case ast.Call():
                if named(value) not in CARRY and not (isinstance(value.func, ast.Name) and named(value) in self.shared):
                    return value
                method = [value.func.value] if isinstance(value.func, ast.Attribute) else []
                if method and named(value) in ("max", "min"):
                    return value  # of an array; of names beside each other it is a choice
                return self._first([*method, *value.args], where, seen)
            case ast.BinOp(left=left, op=op, right=right):
                rest = [side for side in (left, right) if not is_unit(side)]
                ordinal = isinstance(op, ast.Add) and isinstance(right, ast.Constant) and right.value == 1
                if not (isinstance(op, (ast.Mult, ast.Div)) or ordinal) or len(rest) > 1:
                    return value
                return self._first(rest, where, seen)
            case ast.BoolOp(values=values) | ast.Tuple(elts=values) | ast.List(elts=values):
                return self._first(values, where, seen)
            case ast.IfExp(body=body, orelse=other):
                return self._first([body, other], where, seen)
            case ast.Attribute(value=of) | ast.Subscript(value=of) | ast.Starred(value=of):
                return self.computed(of, where, seen)
            case ast.UnaryOp(operand=of):
                return self.computed(of, where, seen)
            case ast.ListComp(elt=of) | ast.GeneratorExp(elt=of):
                return self.computed(of, where, seen)
        return None

    def _first(self, values: list[ast.expr], where: str, seen: frozenset[tuple[str, str]]) -> ast.expr | None:
        return next((found for v in values if (found := self.computed(v, where, seen)) is not None), None)

    def _given(self, function: str, parameter: str) -> list[tuple[str, ast.expr]]:
        """(function, value) that a private function is given for a parameter; also by `partial`."""
        if not function.startswith("_") or parameter not in (names := parameters(self.functions[function])):
            return []
        at, found = names.index(parameter), []
        for where, call in self.calls:
            args = call.args
            if named(call) == "partial" and args and getattr(args[0], "id", "") == function:
                args = args[1:]
            elif named(call) != function:
                continue
            found += [(where, args[at])] if at < len(args) else []
            found += [(where, k.value) for k in call.keywords if k.arg == parameter]
        return found


def parameters(function: ast.FunctionDef) -> list[str]:
    """Names of what a function is called with, in their order."""
    return [a.arg for a in (*function.args.args, *function.args.kwonlyargs)]


def bind(found: dict[str, list[ast.expr]], target: ast.expr, value: ast.expr) -> None:
    """Add what the names of a target are assigned from: parts to parts where both are known, else the
    whole."""
    if isinstance(target, ast.Name):
        found.setdefault(target.id, []).append(value)
    if not isinstance(target, (ast.Tuple, ast.List)):
        return
    if isinstance(value, ast.Name) and len(found.get(value.id, [])) == 1:
        (value,) = found[value.id]
    if isinstance(value, ast.Call) and named(value) in ("list", "tuple") and value.args:
        value = value.args[0]
    parts: list[ast.expr] = [value] * len(target.elts)
    if isinstance(value, (ast.Tuple, ast.List)) or (isinstance(value, ast.Call) and named(value) == "zip"):
        own = value.elts if isinstance(value, (ast.Tuple, ast.List)) else value.args
        parts = own if len(own) == len(target.elts) else parts
    elif isinstance(value, ast.Call) and named(value) == "enumerate":
        parts = [ast.Constant(0), value.args[0]]
    for one, part in zip(target.elts, parts, strict=True):
        bind(found, one, part)


def is_unit(value: ast.expr) -> bool:
    """Whether a factor changes the unit alone: a number, 2 pi, or a name of a scale."""
    if isinstance(value, ast.BinOp):
        return is_unit(value.left) and is_unit(value.right)
    scale = isinstance(value, ast.Name) and value.id in ("scale", "by", "ratio")
    return scale or isinstance(value, ast.Constant) or (isinstance(value, ast.Attribute) and value.attr == "pi")


PICTURES = [file for file in sorted((ROOM / "pictures").glob("*.py")) if file.stem != "touch"]
"""`touch` copies what is drawn: test_touch compares it number by number."""


@pytest.mark.parametrize("module", PICTURES, ids=lambda path: path.stem)
def test_no_number_of_a_picture_is_computed_by_it(module: Path) -> None:
    assert Module(module.read_text(encoding="utf-8")).arithmetic() == []


@pytest.mark.parametrize("text", [
    'def f(a, x):\n    s = a.sum()\n    return f"{s:.3g} J"',
    'def f(a, x):\n    return METRES.sized(a - x)',
    'def f(a):\n    return _f(2 * own(a)[0])\ndef _f(area):\n    return f"{area:.4g}"',
    'def f(a):\n    return partial(_f, a.max())\ndef _f(area):\n    return f"{area:.4g}"',
])  # fmt: skip
def test_arithmetic_is_seen(text: str) -> None:
    """A sum, a difference, one that is given to another function, one that is given for later."""
    assert len(Module(text).arithmetic()) == 1


def test_what_is_carried_is_not_called_arithmetic() -> None:
    text = "def f(found, scale):\n    for i, (name, v) in enumerate(found.rows.items()):\n"
    text += "        label = f\"{name} {i + 1}: {1e6 * v.loss:.3g} of {scale * v.columns()['a']:g}\""
    assert Module(text).arithmetic() == []
