"""docs/own_law.md: its law is run through the contract that every law must satisfy, and its numbers are right."""

from __future__ import annotations

import contextlib
import inspect
import io
import itertools
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from functools import cache
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np
import pytest

pytest.importorskip("jax")
import test_contact_laws as contract
from refusals import refused, refused_command

from microslip.contact import composed, kinds
from microslip.contact.kinds import LawKind, sources_of_others
from microslip.contact.law import Law
from microslip.contact.settings import ContactLaw
from microslip.results import read_response

PAGE = (Path(__file__).parents[1] / "docs" / "own_law.md").read_text(encoding="utf-8")


@cache
def run_page() -> tuple[dict[str, Any], str]:
    """Names that the page's blocks define, and what they print."""
    module = sys.modules["own_law"] = ModuleType("own_law")  # dataclasses look their module up
    names = vars(module)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        for block in re.findall(r"```python\n(.*?)```", PAGE, flags=re.S):
            exec(block, names)
    return names, printed.getvalue()


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
    test(example=run_page()[0]["pad"], **given)


@pytest.fixture
def package(tmp_path: Path) -> dict[str, str]:
    """Environment in which the page's package is installed, beside the case that the page names it in."""
    site = tmp_path / "site"
    found = site / "pads-0.1.dist-info"
    found.mkdir(parents=True)
    settings = tomllib.loads(re.search(r"```toml\n(\[project\]\n.*?)```", PAGE, flags=re.S)[1])["project"]
    head = f"Name: {settings['name']}\nVersion: {settings['version']}\n"
    (found / "METADATA").write_text(f"Metadata-Version: 2.1\n{head}")
    groups = settings["entry-points"].items()
    lines = [f"[{group}]\n" + "".join(f"{k} = {v}\n" for k, v in own.items()) for group, own in groups]
    (found / "entry_points.txt").write_text("\n".join(lines))
    (site / "pads.py").write_text(re.search(r"```python\n(.*?)```", PAGE, flags=re.S)[1])
    masses = Path(composed.__file__).parents[1] / "templates" / "three-masses"
    shutil.copy(masses / "system.toml", tmp_path)
    contact = re.search(r"```toml\n(\[\[contacts\]\]\n.*?)```", PAGE, flags=re.S)[1]
    case = (masses / "case.toml").read_text()
    case, band = re.subn(r"start = .*\nstop = .*\npoints = \d+", "start = 9.0\nstop = 12.0\npoints = 3", case)
    assert band == 1  # with the first resonance alone
    whole = re.sub(r"\[\[contacts\]\].*?(?=\[sweep\])", contact, case, flags=re.S)
    (tmp_path / "case.toml").write_text(re.sub(r"normal_forces = .*", "normal_forces = [10.0, 1000.0]", whole))
    return {**os.environ, "PYTHONPATH": str(site)}


TYPED = """
import json, sys
from microslip.case import run
from microslip.cli import main
run._Run._judge = lambda *_: True  # no estimate of the error of harmonics
for words in json.loads(sys.argv[1]):
    print(main(words), file=sys.stderr)
"""


def microslip(where: Path, environment: dict[str, str], *lines: str) -> str:
    """What lines typed one after another say on standard error, with their exit codes, in one process."""
    call = [sys.executable, "-c", TYPED, json.dumps([line.split() for line in lines])]
    return subprocess.run(call, cwd=where, env=environment, capture_output=True, text=True, check=True).stderr


@pytest.mark.slow
def test_a_law_of_another_package_is_named_in_a_case(
    tmp_path: Path, package: dict[str, str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is solved, it is the pad (which holds less than Coulomb under 1000 N), and it is no other one's."""
    again = "respond case.toml --no-pictures"
    said = microslip(tmp_path, package, "modes . -q", f"{again} -q", again)
    assert said.startswith("0\n0\n") and said.endswith("0\n") and "up to date" in said, said
    found = read_response(tmp_path / "build/three-masses/response.h5")
    for series, normal in zip(found.series, (10.0, 1000.0), strict=True):
        swing = np.abs(series.arrays["contacts/rub/force"][:, 1, 1:3]).max()
        assert swing <= 4 / np.pi * float(run_page()[0]["Pad"](1e4, 5e3, 0.3, 40.0).hold(normal))
    law, table = tmp_path / "site" / "pads.py", tmp_path / "build/three-masses/response.csv"
    before = table.read_text()
    text = law.read_text()  # a number of the law and not its arithmetic: the programs are those of before
    law.write_text(text.replace("first, contact.mu,", "first, 0.5 * contact.mu,"))
    said = microslip(tmp_path, package, again, "respond case.toml --set contacts.rub.law.kind=mad")
    assert "up to date" not in said and said.endswith("2\n") and '"pad"' in said.splitlines()[-2]
    assert table.read_text() != before
    monkeypatch.chdir(tmp_path)
    refused_command(["respond", "case.toml"], capsys, 'law.kind: "pad" is unknown; choose one of')


class Elsewhere(LawKind):
    """A kind of another package, this file."""

    kind: Literal["elsewhere"]


def test_a_case_depends_on_other_packages_kinds_that_it_names_alone() -> None:
    own = {"normal_stiffness": 1e4, "tangential_stiffness": 5e3, "friction": 0.3}
    plain = ContactLaw.model_validate({**own, "law": "smooth"})
    other = plain.model_copy(update={"law": Elsewhere(kind="elsewhere")})
    assert sources_of_others([plain]) == {}
    assert sources_of_others([plain, other]) == {__name__: Path(__file__)}


@pytest.mark.slow
def test_the_contract_runs_on_a_law_of_another_package(package: dict[str, str]) -> None:
    path = Path(__file__).with_name("test_contact_laws.py")
    call = [sys.executable, "-m", "pytest", str(path), "-k", "pad and not without", "-p", "no:cacheprovider"]
    done = subprocess.run(call, env=package, capture_output=True, text=True)
    assert done.returncode == 0 and int(re.search(r"(\d+) passed", done.stdout)[1]) >= 10, done.stdout


class Half(Law):
    """A law that was begun."""

    def init(self, n):
        return ()


class OfGiven(LawKind):
    kind: Literal["given"]
    made: Any

    def law(self, contact):
        return self.made


def composed_with(**kinds):
    own = {"normal_stiffness": 1e4, "tangential_stiffness": 5e3, "friction": 0.3}
    return composed.compose(ContactLaw.model_validate(own).model_copy(update=kinds), Path("case.toml"))


@pytest.mark.parametrize(
    ("law", "words"),
    [
        ("Half", ("Half of ", " has no method step, limit, slip, stored;")),
        ("Turned", ("step of Turned gives", " of shape (3, 2);")),
        ("Misspelt", ("test_own_law.py, line ", ", in stored: AttributeError", "pres")),
    ],
)
def test_a_law_that_cannot_be_asked_is_refused_before_anything_is_solved(law, words) -> None:
    """One without a method, with a force of another shape, with a mistake in its code."""
    names, _ = run_page()
    Pad = names["Pad"]

    @names["settings"]
    class Turned(Pad):  # type: ignore[misc, valid-type]
        def step(self, u, v, dt, state):
            force, after = Pad.step(self, u, v, dt, state)
            return force.T, after

    made = {"Half": Half, "Misspelt": Misspelt, "Turned": lambda: Turned(1e4, 5e3, 0.3, 40.0)}[law]()
    refused(("law: ", *words), composed_with, law=OfGiven(kind="given", made=made))


class Misspelt(Law):
    """A law whose energy speaks of a name there is not."""

    def init(self, n):
        return np.zeros(n)

    def step(self, u, v, dt, state):
        return u, state

    def limit(self, force, state):
        return state

    def slip(self, state):
        return np.zeros((2, 2))

    def stored(self, u, state):
        return self.presed * u[:, 0]


def test_the_pages_friction_makes_a_contact() -> None:
    names, _ = run_page()
    made = composed_with(friction=names["OfTiring"](kind="tiring", mu_0=0.3, force_p=40.0))
    two = np.full((2, 3), 40.0 / 1e4)
    force, _ = made.law.step(two, two, 1.0, made.law.init(2))
    np.testing.assert_allclose(np.hypot(force[:, 1], force[:, 2]), 0.15 * 40.0, rtol=1e-6)


def test_the_contract_is_there() -> None:
    assert len(list(cases())) >= 10


def test_what_the_page_prints() -> None:
    shown = re.search(r"```\n\n((?:    [\d(].*\n)+)", PAGE)
    assert shown and [line.strip() for line in shown[1].splitlines()] == run_page()[1].splitlines()


def test_a_law_without_a_cone_fails_the_contract() -> None:
    """The contract would notice: the same pad that limits each tangential axis on its own."""
    names, _ = run_page()
    jnp, Pad = names["jnp"], names["Pad"]

    @names["settings"]
    class Box(Pad):  # type: ignore[misc, valid-type]
        def step(self, u, v, dt, state):
            before, spring, slipped = state
            pressed = self.normal * jnp.maximum(u[:, 0], 0.0)
            trial = jnp.where(pressed > 0, spring + self.tangential * (u.T[1:] - before), 0.0)
            force = jnp.clip(trial, -self.hold(pressed), self.hold(pressed))
            slipped = slipped + (trial - force) / self.tangential
            return jnp.concatenate([pressed[None], force]).T, jnp.stack([u.T[1:], force, slipped])

    box = names["Example"](Box(2.4e8, 0.9e8, 0.3, 4e3), normal=1e-5, tangential=1e-5)
    with pytest.raises(AssertionError):
        contract.test_friction_stays_in_its_cone(box)


def test_what_another_package_misnames_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kinds, "entry_points", lambda group: [EntryPoint("pad", "json:OfNothing", group)])
    with pytest.warns(UserWarning, match="microslip.law: pad of another package, json:OfNothing, cannot be loaded"):
        assert kinds.of_others("law") == {}
