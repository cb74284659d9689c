"""What a kept package has beside its code: a citation, workflows, forms, and the check of a release."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from microslip import __version__

ROOT = Path(__file__).parents[1]


def read(path: str) -> dict:
    yaml = pytest.importorskip("yaml")
    return yaml.safe_load((ROOT / path).read_text(encoding="utf-8"))


def test_the_citation_is_that_of_the_package() -> None:
    """Keys that CFF 1.2 asks for, and the licence of the package."""
    cited = read("CITATION.cff")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert cited["cff-version"] == "1.2.0" and cited["message"] and cited["title"].startswith(project["name"])
    assert cited["license"] == project["license"]
    assert [a["name"] for a in cited["authors"]] == [a["name"] for a in project["authors"]]


def test_the_version_is_that_of_changelog_and_citation() -> None:
    """The last dated heading; another one above it is of what comes next."""
    cited = read("CITATION.cff")
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    heads = re.findall(r"^## (\S+), (\d{4}-\d\d-\d\d)$", text, flags=re.M)
    assert heads[0] == (__version__, str(cited["date-released"])) and str(cited["version"]) == __version__


def test_workflows_call_what_is_there() -> None:
    text = ""
    for name in ("ci", "release"):
        work = read(f".github/workflows/{name}.yml")
        assert all(job["steps"] for job in work["jobs"].values())
        text += (ROOT / f".github/workflows/{name}.yml").read_text(encoding="utf-8")
    called = re.findall(r"(\.ci/run|pipeline/\w+\.sh)", text)
    assert {".ci/run", "pipeline/release_check.sh"} <= set(called)
    assert all((ROOT / file).is_file() for file in called)


def test_forms_ask_for_something() -> None:
    for form in (ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"):
        if form.name != "config.yml":
            fields = read(str(form.relative_to(ROOT)))["body"]
            assert any(field.get("validations", {}).get("required") for field in fields), form.name


def test_supported_pythons_are_those_of_the_workflow() -> None:
    page = (ROOT / "docs" / "platforms.md").read_text(encoding="utf-8")
    tried = read(".github/workflows/ci.yml")["jobs"]["base"]["strategy"]["matrix"]["python"]
    head = next(line for line in page.splitlines() if line.startswith("| | Python"))
    assert re.findall(r"3\.\d+", head) == tried
