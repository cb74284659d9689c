"""docs/own_law.md: its law is run through the contract that every law must satisfy, and its numbers are right."""

from __future__ import annotations

import contextlib
import inspect
import io
import itertools
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

pytest.importorskip("jax")
import test_contact_laws as contract

PAGE = (Path(__file__).parents[1] / "docs" / "own_law.md").read_text(encoding="utf-8")


def run_page() -> tuple[dict[str, Any], str]:
    """Names that the page's blocks define, and what they print."""
    module = sys.modules["own_law"] = ModuleType("own_law")  # dataclasses look their module up
    names = vars(module)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        for block in re.findall(r"```python\n(.*?)```", PAGE, flags=re.S):
            exec(block, names)
    return names, printed.getvalue()


NAMES, PRINTED = run_page()


def cases() -> Iterator[Any]:
    """Every test of the contract with every value it is tried with."""
    for name, test in inspect.getmembers(contract, inspect.isfunction):
        marks = [m for m in getattr(test, "pytestmark", []) if m.name == "parametrize"]
        if not any(m.args[0] == "example" for m in marks):
            continue
        others = [m for m in marks if m.args[0] != "example"]
        for values in itertools.product(*(m.args[1] for m in others)):
            given = dict(zip((m.args[0] for m in others), values, strict=True))
            yield pytest.param(test, given, id="-".join([name, *map(str, values)]))


@pytest.mark.parametrize("test, given", list(cases()))
def test_the_pages_law_satisfies_the_contract(test: Callable[..., None], given: dict[str, Any]) -> None:
    test(example=NAMES["pad"], **given)


def test_the_contract_is_there() -> None:
    assert len(list(cases())) >= 10


def test_what_the_page_prints() -> None:
    shown = re.search(r"```\n\n((?:    [\d(].*\n)+)", PAGE)
    assert shown and [line.strip() for line in shown[1].splitlines()] == PRINTED.splitlines()


def test_a_law_without_a_cone_fails_the_contract() -> None:
    """The contract would notice: the same pad that limits each tangential axis on its own."""
    jnp, Pad = NAMES["jnp"], NAMES["Pad"]

    @NAMES["settings"]
    class Box(Pad):  # type: ignore[misc, valid-type]
        def step(self, u, v, dt, state):
            before, spring, slipped = state
            pressed = self.normal * jnp.maximum(u[:, 0], 0.0)
            trial = jnp.where(pressed > 0, spring + self.tangential * (u.T[1:] - before), 0.0)
            force = jnp.clip(trial, -self.hold(pressed), self.hold(pressed))
            slipped = slipped + (trial - force) / self.tangential
            return jnp.concatenate([pressed[None], force]).T, jnp.stack([u.T[1:], force, slipped])

    box = NAMES["Example"](Box(2.4e8, 0.9e8, 0.3, 4e3), normal=1e-5, tangential=1e-5)
    cone = contract.test_friction_stays_in_its_cone.hypothesis.inner_test
    with pytest.raises(AssertionError):  # paths of our own: which ones hypothesis tries depends on what is imported
        for seed in range(10):
            cone(box, seed)
