"""The site of the documentation: it builds without warnings, its links lead somewhere, and its search finds things."""

from __future__ import annotations

import re
import subprocess
import sys
from collections import deque
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from test_touch import browsed

ROOT = Path(__file__).resolve().parents[1]


FOUND = [("Jenkins", "contact.html"), ("EBLOCK", "your_own_model.html"), ("backbone", "harmonic_balance.html")]


class Links(HTMLParser):
    """Where a page leads, and the places in it that others may lead to."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.to: list[str] = []
        self.places: set[str] = set()
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list) -> None:
        named = dict(attrs)
        if tag == "a" and named.get("href"):
            self.to.append(named["href"])
        self.places |= {named[key] for key in ("id", "name") if named.get(key)}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("sphinx")
    pytest.importorskip("pydata_sphinx_theme")
    made = tmp_path_factory.mktemp("site")
    line = [sys.executable, "-m", "sphinx", "-b", "html", "-q", "-W", "--keep-going", str(ROOT / "docs"), str(made)]
    run = subprocess.run(line, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return made


@pytest.mark.slow
def test_notebooks_lead_to_pages(site: Path) -> None:
    made = sorted((site / "notebooks").glob("*.ipynb"))
    assert len(made) == 9
    for file in made:
        for target in re.findall(r"\]\((\.\./[^)#]+)", file.read_text(encoding="utf-8")):
            assert (file.parent / target).is_file(), f"{file.name} -> {target}"


@pytest.mark.slow
def test_no_link_is_dead_and_three_clicks_reach_every_page(site: Path) -> None:
    pages = {page: Links(page) for page in site.rglob("*.html")}
    dead, leads = [], dict[Path, set[Path]]()
    for page, links in pages.items():
        leads[page] = set()
        for href in links.to:
            at = urlsplit(href)
            if at.scheme or href.startswith("//"):
                continue
            target = (page.parent / unquote(at.path)).resolve() if at.path else page
            place = unquote(at.fragment)
            if not target.exists() or (place and target in pages and place not in pages[target].places):
                dead.append(f"{page.name} -> {href}")
            leads[page].add(target)
    assert not dead, "\n".join(sorted(set(dead)))
    clicks, todo = {site / "index.html": 0}, deque([site / "index.html"])
    while todo:
        page = todo.popleft()
        for target in leads.get(page, set()) - clicks.keys():
            clicks[target] = clicks[page] + 1
            todo.append(target)
    of_the_theme = ("search.html", "webpack-macros.html")
    far = [page.name for page in pages if clicks.get(page, 9) > 3 and page.name not in of_the_theme]
    assert not far, far


@pytest.mark.slow
@pytest.mark.parametrize(("word", "page"), FOUND)
def test_the_search_finds_its_pages_without_a_network(site: Path, tmp_path: Path, word: str, page: str) -> None:
    """As a reader does: a word typed into the search of a page that was opened from a file."""
    search = site / "search.html"
    wrapped = site / f"search_{word}.html"
    told = f'<script>history.replaceState(null, "", "?q={word}")</script>'
    wrapped.write_text(search.read_text(encoding="utf-8").replace("<head>", f"<head>{told}", 1), encoding="utf-8")
    out = browsed(wrapped, "", tmp_path)
    found = re.findall(r'<a href="([^"?#]*)', out[out.find("search-results") :])
    assert page in found, found
