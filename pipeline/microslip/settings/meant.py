"""What a person means by a path or a name."""

from __future__ import annotations

import difflib
from pathlib import Path

from ..errors import UserError


def meant(path: Path, root: Path = Path("."), case: bool = False) -> Path:
    """What a person means by a path: a file or folder that can be run as it is; where it is a name or a folder of
    products, the case of that name (``pipeline/cases/NAME.toml``) or the body (``geometry/NAME``), or what stands in
    the folder ``NAME``. Of a body or system the case beside it, where it has to be one.

    Args:
        case: whether it has to be a case; else a body comes first.

    Raises:
        UserError: nothing of that name, with those that there are.
    """
    beside = path.parent / "case.toml"
    if case and path.name in ("body.toml", "system.toml") and beside.is_file():
        return beside
    kinds = ("case",) if case else ("body", "system", "case")
    runs = path.is_file() if path.suffix == ".toml" else any((path / f"{kind}.toml").is_file() for kind in kinds)
    named = path.is_dir() or path.name in PRODUCTS or path.parent == Path() and not path.suffix
    if runs or not named:
        return path  # of a file of another kind its reader tells what to do
    name = path.parent.name if path.name in PRODUCTS else path.resolve().name
    places = [root / "pipeline" / "cases" / f"{name}.toml", root / "geometry" / name / "case.toml"]
    places = places if case else [root / "geometry" / name / "body.toml", *places]
    places += [root / name / f"{kind}.toml" for kind in kinds]
    found = next((p for p in places if p.is_file()), None)
    if found is not None or path.is_file():
        return found or path
    cases = {p.stem for p in root.glob("pipeline/cases/*.toml")}
    bodies = {p.parent.name for p in root.glob("geometry/*/body.toml")}
    known, what = sorted(cases if case else cases | bodies), "case" if case else "body or case"
    near = difflib.get_close_matches(name, known, 1)
    said = (
        f"is '{near[0]}' meant?" if near else f"there are {', '.join(known)}" if known else "give the path of a .toml"
    )
    raise UserError(f"{path}: there is no {what} here or of this name; {said}")


def case_file(case: Path, root: Path = Path(".")) -> Path:
    """A case.toml: itself, the one in a folder, of a name or of products, or ``sample``, which travels with the
    package."""
    if str(case) == "sample" and not case.exists():
        return Path(__file__).parents[1] / "samples" / "case.toml"
    case = meant(case, root, case=True)
    return case / "case.toml" if case.is_dir() else case


PRODUCTS = ("basis.h5", "response.h5", "response.csv", "report.html", "response.html")
"""Files in build/NAME that stand for the case or body that they are made of."""
