"""The nine tutorials: each is typed as it stands, prints what it shows, and is short enough for ten minutes."""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))

import pages  # noqa: E402

from microslip.cli import main  # noqa: E402

TUTORIALS = sorted(p.stem for p in (DOCS / "tutorials").glob("*.md"))
NEEDS = {name: ("gmsh", "skfem") for name in ("own_step", "lap_joint", "damper", "squeal")}


def test_nine_of_at_most_600_words_and_one_picture() -> None:
    assert len(TUTORIALS) == 9
    for name in TUTORIALS:
        text = (DOCS / "tutorials" / f"{name}.md").read_text(encoding="utf-8")
        assert len(text.split()) <= 600, name
        assert len(re.findall(r"!\[", text)) == 1, name
        assert "After these ten minutes" in text.split("\n\n")[1], name


def test_notebooks_have_the_text_and_the_cells_of_their_pages() -> None:
    """The form of nbformat 4.5; what a page writes, types and prints, in its order."""
    from notebooks import notebook

    for name in TUTORIALS:
        page = DOCS / "tutorials" / f"{name}.md"
        made = notebook(page)
        assert (made["nbformat"], made["nbformat_minor"]) == (4, 5)
        assert len({cell["id"] for cell in made["cells"]}) == len(made["cells"])
        for cell in made["cells"]:
            code = cell["cell_type"] == "code"
            asked = {"cell_type", "id", "metadata", "source"} | ({"outputs", "execution_count"} if code else set())
            assert set(cell) == asked and all(isinstance(line, str) for line in cell["source"])
        parts = [(c["source"], *(o["text"] for o in c.get("outputs", ()))) for c in made["cells"]]
        text = "".join("".join(lines) for part in parts for lines in part)
        assert all(step.path in text for step in pages.steps(f"tutorials/{name}.md"))
        for block in re.findall(r"```text\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.S):
            assert block in text


@pytest.mark.slow
def test_a_notebook_runs_cell_by_cell(tmp_path: Path) -> None:
    """As a kernel would: files written, lines typed; each cell prints what is kept below it."""
    from notebooks import notebook

    ran = 0
    for cell in notebook(DOCS / "tutorials" / "python.md")["cells"]:
        if cell["cell_type"] != "code":
            continue
        source = "".join(cell["source"])
        if source.startswith("%%writefile "):
            head, text = source.split("\n", 1)
            (tmp_path / head.split()[1]).write_text(text)
        else:
            printed = "\n".join(pages.typed(line[1:], tmp_path) for line in source.splitlines())
            for output in cell["outputs"]:
                assert "".join(output["text"]).strip() in printed
                ran += 1
    assert ran == 2


@pytest.mark.slow
@pytest.mark.usefixtures("unestimated")
@pytest.mark.parametrize("name", TUTORIALS)
def test_a_tutorial_as_it_stands(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its files written, its lines typed; every line of its ```text blocks is printed."""
    for package in ("jax", *NEEDS.get(name, ())):
        pytest.importorskip(package)
    monkeypatch.chdir(tmp_path)

    def type_in(line: str, folder: Path) -> str:
        """The program's lines in this process, which has it loaded; the others in a shell."""
        program, *words = shlex.split(line)
        if program != "microslip":
            return pages.typed(line, folder)
        code, said = main(words), capsys.readouterr()
        assert code == 0, f"{line}\n{said.out}{said.err}"
        return f"$ {line}\n{said.out}"

    printed = pages.play(f"tutorials/{name}.md", tmp_path, type_in=type_in)
    text = (DOCS / "tutorials" / f"{name}.md").read_text(encoding="utf-8")
    for block in re.findall(r"```text\n(.*?)```", text, flags=re.S):
        for line in block.splitlines():
            assert line in printed, f"{line}\n--\n{printed}"
