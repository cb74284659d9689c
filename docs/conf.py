"""The site: these pages with a search that needs no network. `make site` writes build/site/."""

from __future__ import annotations

import inspect
import subprocess
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import notebooks
import pages

import microslip

project = "microslip"
author = copyright = "The microslip developers"
release = microslip.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax", "sphinx_design"]
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 4
exclude_patterns = ["pictures", "generated/gallery.md", "generated/extra"]
html_theme = "pydata_sphinx_theme"
html_title = "microslip"
html_show_sourcelink = False
html_show_search_summary = False  # a page of a file may not fetch another
html_theme_options = {
    "show_toc_level": 2, "navigation_with_keys": False, "use_edit_page_button": False, "show_prev_next": True,
    "navbar_align": "left", "header_links_before_dropdown": 6, "secondary_sidebar_items": ["page-toc"],
}  # fmt: skip
html_static_path: list[str] = []
html_extra_path = ["generated/extra"]
add_module_names = False
autodoc_typehints = "none"
autodoc_member_order = "bysource"
suppress_warnings = ["myst.xref_missing", "myst.header", "image.not_readable"]
"""Links to files of the repository, which are no pages; tests/test_site.py finds dead ones."""

HERE = Path(__file__).parent
MADE = HERE / "generated"


def _names() -> str:
    """A page of every public name with its docstring."""
    pages = ["# Python names\n\nOf `import microslip as ms`; [the Python route](../python.md) shows them at work.\n"]
    for module, names in microslip.PUBLIC.items():
        for name in names.split():
            kind = "autoclass" if inspect.isclass(getattr(microslip, name)) else "autofunction"
            members = "\n   :members:" if kind == "autoclass" else ""
            pages.append(f"## ms.{name}\n\n```{{eval-rst}}\n.. {kind}:: microslip.{module}.{name}{members}\n```\n")
    return "\n".join(pages)


def _verbs() -> str:
    """A page of every verb with its help."""
    from microslip.cli import app

    own = [name for name in app if not name.startswith("-")]
    said = [_help()] + [f"\n## {name}\n\n```text\n{_help(name)}\n```" for name in own]
    return f"# Verbs of the command line\n\n```text\n{said[0]}\n```\n" + "\n".join(said[1:])


def _help(*verb: str) -> str:
    line = [sys.executable, "-m", "microslip", *verb, "--help"]
    return subprocess.run(line, capture_output=True, text=True, check=True).stdout.strip()


def _with_notebook(app: object, name: str, source: list[str]) -> None:
    """A tutorial leads to its notebook below its heading."""
    if name.startswith("tutorials/"):
        file = f"{name.removeprefix('tutorials/')}.ipynb"
        link = f'<p><a class="notebook" href="../notebooks/{file}" download>Download as a notebook</a></p>'
        source[0] = source[0].replace("\n\n", f"\n\n{link}\n\n", 1)


def setup(app: Any) -> None:
    MADE.mkdir(exist_ok=True)
    notebooks.write_notebooks(MADE / "extra" / "notebooks")
    app.connect("source-read", _with_notebook)
    for name, text in (("names.md", _names()), ("verbs.md", _verbs()), ("gallery.md", pages.gallery())):
        file = MADE / name
        if not file.is_file() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")
