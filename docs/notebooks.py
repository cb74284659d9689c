"""The tutorials as notebooks (nbformat 4.5), made of their Markdown: files are written, lines typed, by its cells."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from pathlib import Path
from typing import Any

from pages import BLOCK, HERE

PRINTED = re.compile(r"\s*```text\n(.*?)```", re.S)


def notebook(page: Path) -> dict[str, Any]:
    """Cells of a page: its words; a cell for each file that it writes, for the lines that it types, with what
    they print as it is shown."""
    text, cells, at = page.read_text(encoding="utf-8"), list[dict[str, Any]](), 0
    for block in BLOCK.finditer(text):
        cells.append(_words(text[at : block.start()], page))
        kind, path, inside = block.groups()
        at = block.end()
        shown = PRINTED.match(text, at) if kind == "run" else None
        at = at if shown is None else shown.end()
        cells.append(_code(_written(path, inside) if kind == "file" else _typed(inside), shown[1] if shown else ""))
    cells.append(_words(text[at:], page))
    kept = [cell for cell in cells if "".join(cell["source"]).strip()]
    for number, cell in enumerate(kept):
        cell["id"] = hashlib.sha256(f"{page.stem}{number}".encode()).hexdigest()[:8]
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return {"cells": kept, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}


def write_notebooks(folder: Path) -> None:
    """All of them; those that have not changed stay."""
    folder.mkdir(parents=True, exist_ok=True)
    for page in sorted((HERE / "tutorials").glob("*.md")):
        file, text = folder / f"{page.stem}.ipynb", json.dumps(notebook(page), indent=1, ensure_ascii=False)
        if not file.is_file() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")


def _words(text: str, page: Path) -> dict[str, Any]:
    """Links lead to pages of the site beside the notebooks; pictures are inside."""

    def inlined(m: re.Match[str]) -> str:
        data = base64.b64encode((page.parent / m[2]).read_bytes()).decode()
        return f"![{m[1]}](data:image/png;base64,{data})"

    text = re.sub(r"!\[([^\]]*)\]\(([^)]+\.png)\)", inlined, text)
    text = re.sub(r"\]\(\.\./([\w/-]+)\.md(#[\w-]+)?\)", r"](../\1.html\2)", text)
    text = re.sub(r"\]\(([\w-]+)\.md(#[\w-]+)?\)", r"](../tutorials/\1.html\2)", text)
    return {"cell_type": "markdown", "metadata": {}, "source": text.strip().splitlines(keepends=True)}


def _code(source: str, printed: str) -> dict[str, Any]:
    shown = [{"output_type": "stream", "name": "stdout", "text": printed.splitlines(keepends=True)}] if printed else []
    return {"cell_type": "code", "metadata": {}, "execution_count": None, "outputs": shown,
            "source": source.splitlines(keepends=True)}  # fmt: skip


def _written(path: str, text: str) -> str:
    return f"%%writefile {path}\n{text.rstrip()}" if "/" not in path else (
        f"from pathlib import Path\n\nPath({path!r}).parent.mkdir(parents=True, exist_ok=True)\n"
        f"Path({path!r}).write_text({text!r})"
    )  # fmt: skip


def _typed(lines: str) -> str:
    whole = re.sub(r"\\\n\s*", " ", lines).splitlines()
    return "\n".join(line if line.startswith("#") or not line else f"!{line}" for line in whole)
