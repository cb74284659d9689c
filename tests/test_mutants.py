"""The table of mistakes keeps up with the package; `python tests/mutants.py` tries that quick tests catch them."""

from __future__ import annotations

import mutants
import pytest


@pytest.mark.parametrize("mistake", mutants.MISTAKES, ids=lambda mistake: mistake.what)
def test_a_mistake_can_be_made_and_has_a_test(mistake: mutants.Mistake) -> None:
    """Where its text stands no more, once, write what stands there now."""
    text = (mutants.ROOT / "pipeline/microslip" / mistake.file).read_text(encoding="utf-8")
    tests = (mutants.ROOT / "tests" / mistake.tests).read_text(encoding="utf-8")
    assert text.count(mistake.old) == 1 and mistake.new not in ("", mistake.old)
    assert f"def {mistake.test.partition('[')[0]}" in tests
