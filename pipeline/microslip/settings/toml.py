"""Settings files as tables: TOML, and what ``--set`` changes in it."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..errors import UserError, in_its_file
from ..files.store import ordinary
from .mistakes import validate


def read_settings(
    model: type[Any], path: Path | str, assignments: Sequence[str] | None = None
) -> tuple[Any, dict[str, Any]]:
    """Read and check a settings file.

    Args:
        model: what it holds. assignments: ``--set`` texts.

    Returns:
        The settings, and the file's own table.

    Raises:
        UserError: with every mistake named by file and key.
    """
    path = Path(path)
    raw = override(load_toml(path), list(assignments or []), path)
    return validate(model, raw, path), raw


@in_its_file
def load_toml(path: Path | str) -> dict[str, Any]:
    """Read a TOML file (UTF-8, with or without a byte-order mark).

    Raises:
        UserError: missing, unreadable or not TOML.
    """
    try:
        return tomllib.loads(ordinary(Path(path)).read_bytes().decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise UserError(f"is not UTF-8 text (byte {error.start + 1}); save it as UTF-8") from error
    except OSError as error:
        raise UserError(f"cannot be read ({error.strerror}); correct the path") from error
    except tomllib.TOMLDecodeError as error:
        raise UserError(f"is not valid TOML ({_one_line(error)}); correct that place") from error
    except (ValueError, RecursionError) as error:  # a number of thousands of digits, brackets without end
        raise UserError(f"cannot be read ({_one_line(error)}); is it a settings file?") from error


def _one_line(error: BaseException) -> str:
    text = " ".join(str(error).split())
    return text[:1].lower() + text[1:120]


def override(table: dict[str, Any], assignments: list[str], path: Path, by: str = "--set ") -> dict[str, Any]:
    """Apply ``key.subkey=value`` texts (value in TOML's notation, or bare text) to a settings table of a file.

    Args:
        by: what gives them, for messages.
    """
    for text in assignments:
        key, equals, value = text.partition("=")
        key = " ".join(key.split())
        steps = [step.strip() for step in key.split(".")]
        if not equals or not all(steps):
            raise UserError("is no setting; write --set key.subkey=value", f"{by}{key + equals}")
        place: Any = table
        for number, step in enumerate(steps[:-1]):
            if isinstance(place, list):
                place = _entry(place, step, by + key, path)
            else:
                place = place.setdefault(step, {})
            if not isinstance(place, dict | list):
                above = ".".join(steps[: number + 1])
                raise UserError(f"'{above}' in {path} is a value, not a table; correct the key", by + key)
        if isinstance(place, list):
            above = ".".join(steps[:-1])
            raise UserError(f"name the entry and its key; write --set {above}.NAME.KEY=value", by + key)
        place[steps[-1]] = _parsed(value)
    return table


def _parsed(value: str) -> Any:
    """A value in TOML's notation, or the bare text."""
    try:
        table = tomllib.loads(f"v = {value}")
    except (ValueError, RecursionError):
        return value.strip()
    return table["v"] if set(table) == {"v"} else value.strip()


_NAMES = ("name", "face", "interface", "row", "monitor")
"""Keys by which an entry of a list may be addressed, the first it has."""


def _entry(items: list[Any], name: str, key: str, path: Path) -> Any:
    for number, item in enumerate(items):
        if isinstance(item, dict) and name in (*(item.get(k) for k in _NAMES), str(number)):
            return item
    tables = [(number, item) for number, item in enumerate(items) if isinstance(item, dict)]
    known = [str(next((item[k] for k in _NAMES if item.get(k)), number)) for number, item in tables]
    raise UserError(f"{path} has no entry '{name}' there; choose one of {', '.join(known) or 'none'}", key)
