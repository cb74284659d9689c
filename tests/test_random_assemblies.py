"""Random assemblies of several bodies, through their files: the answer does not depend on how a case is written down.

Answers are compared in table, response file, summary and page, see `answers.differences`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from answers import Answer
from assemblies import Drawn, draw
from attack import Case, opened, responded

pytest.importorskip("matplotlib")

SAME = 1e-9
"""Share of the largest value of its kind: the same arithmetic in another order, begun at the same places."""


@pytest.fixture(autouse=True)
def bare(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither pictures nor estimated errors, which take as long as the answer."""
    monkeypatch.setattr("microslip.pictures.response.response_picture", lambda _, path: path.write_bytes(b"picture"))
    monkeypatch.setattr("microslip.case.run._Left.out", lambda *_: [])


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("drawn")


MILD, HARD = {"hard": 1.0}, {"hard": 1.5, "rough": True}
SEEDS = [(5, MILD), *(pytest.param(*one, marks=pytest.mark.slow) for one in ((3, HARD), (11, HARD)))]
drawn_ones = pytest.mark.parametrize("seed, kind", SEEDS)

made: dict[Any, Any] = {}


def case_of(drawn: Drawn, folder: Path) -> Case:
    return opened(drawn.written(folder), root=folder)


def plain(place: Path, seed: int, kind: dict[str, Any]) -> tuple[Drawn, Case, Answer]:
    """An assembly as it is drawn, and its answer; treat it as read-only."""
    key = f"{seed}-{kind}"
    if key not in made:
        drawn = draw(seed, **kind)
        case = case_of(drawn, place / key)
        made[key] = drawn, case, responded(case.copied(place / key / "plain"))
    return made[key]
