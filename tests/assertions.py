"""How many assertions the tests make, by kind: ``python tests/assertions.py [folder]``.

A mathematical one compares numbers: with a tolerance, by order, or for equality of what is no
text. One of wording looks into a text, or expects a refusal. What is left tells true from false.
"""

from __future__ import annotations

import ast
import sys
from collections import Counter
from pathlib import Path

ORDER = (ast.Lt, ast.LtE, ast.Gt, ast.GtE)
EQUAL = (ast.Eq, ast.NotEq)


def is_text(node: ast.AST) -> bool:
    """Whether a text, or one put together, stands somewhere in an expression."""
    return any(
        isinstance(n, ast.JoinedStr) or (isinstance(n, ast.Constant) and isinstance(n.value, str | bytes))
        for n in ast.walk(node)
        if not isinstance(n, ast.Subscript)
    )


def kind(node: ast.Assert) -> str:
    """Of an assertion."""
    compared = [n for n in ast.walk(node.test) if isinstance(n, ast.Compare)]
    if any(isinstance(op, ORDER) for n in compared for op in n.ops):
        return "mathematics"
    if any(isinstance(op, EQUAL) and not is_text(n) for n in compared for op in n.ops):
        return "mathematics"
    called = {n.attr for n in ast.walk(node.test) if isinstance(n, ast.Attribute)}
    if called & {"allclose", "array_equal", "isclose", "isfinite", "isnan", "approx"}:
        return "mathematics"
    return "wording" if is_text(node.test) else "truth"


def counted(folder: Path) -> Counter[str]:
    """Kind -> number, and functions of tests, in all files below a folder."""
    count: Counter[str] = Counter()
    for path in sorted(folder.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Assert):
                count[kind(node)] += 1
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                if node.func.attr.startswith("assert_"):
                    count["mathematics"] += 1
                elif node.func.attr == "raises":
                    count["wording"] += 1
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                if node.func.id in ("refused", "refused_command"):
                    count["wording"] += 1
            elif isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                count["test functions"] += 1
    return count


if __name__ == "__main__":
    here = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    for name, number in sorted(counted(here).items()):
        print(f"{number:6} {name}")
