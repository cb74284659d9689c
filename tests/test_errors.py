"""Where a mistake stands: key and file, put in front of its sentence by what reads them."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from microslip.errors import UserError, at, in_its_file, of_file


def mistake(*contexts: object, key: str = "", file: object = None) -> UserError:
    """As it leaves contexts, the innermost last."""
    with pytest.raises(UserError) as caught:
        _within(contexts, UserError("is wrong; correct it", key, file))
    return caught.value


def _within(contexts: tuple, error: UserError) -> None:
    if not contexts:
        raise error
    with contexts[0]:
        _within(contexts[1:], error)


def test_keys_stand_one_behind_the_other() -> None:
    """And one without a key of its own is that of the table."""
    error = mistake(at("contacts.right"), at("stiffness"), key="normal")
    assert (error.key, error.file, str(error)) == (
        "contacts.right.stiffness.normal",
        None,
        "contacts.right.stiffness.normal: is wrong; correct it",
    )
    assert mistake(at("contacts.right")).key == "contacts.right"
    assert mistake(at("")).key == ""


def test_a_mistake_of_another_file_stands_whole_behind_the_key_that_names_it() -> None:
    named = at("contacts.right.file")
    error = mistake(of_file("case.toml"), named, of_file("pad.toml"), key="law.mass")
    assert (error.key, error.file) == ("contacts.right.file", "case.toml")
    assert str(error) == "case.toml: contacts.right.file: pad.toml: law.mass: is wrong; correct it"


def test_a_file_is_not_named_twice() -> None:
    """Where the key says why something of the same file is read."""
    error = mistake(at("orbit", "case.toml"), of_file("case.toml"), key="sweep")
    assert (error.key, error.file) == ("orbit", "case.toml")
    assert str(error) == "case.toml: orbit: sweep: is wrong; correct it"
    other = mistake(at("body", "case.toml"), of_file("body.toml"), key="mesh")
    assert str(other) == "case.toml: body: body.toml: mesh: is wrong; correct it"


def test_the_innermost_file_is_that_of_the_mistake() -> None:
    assert mistake(of_file("outer"), of_file("inner")).file == "inner"
    assert mistake(of_file("outer"), file="its own").file == "its own"


def test_every_line_of_several_mistakes_has_its_place() -> None:
    with pytest.raises(UserError) as caught, of_file("a.toml"), at("x"):
        raise UserError("one\ntwo")
    assert str(caught.value) == "a.toml: x: one\na.toml: x: two"


@in_its_file
def read(path: object) -> None:
    raise UserError("is wrong")


def test_a_function_that_reads_a_file_names_it() -> None:
    """Given as a path, or by what was read from it."""
    for of in (Path("a.toml"), SimpleNamespace(path=Path("a.toml"))):
        with pytest.raises(UserError) as caught:
            read(of)
        assert caught.value.file == Path("a.toml")
    with pytest.raises(UserError) as caught:
        read(path=Path("b.toml"))
    assert caught.value.file == Path("b.toml")


def test_other_exceptions_pass() -> None:
    with pytest.raises(ZeroDivisionError), of_file("a"), at("b"):
        raise ZeroDivisionError
