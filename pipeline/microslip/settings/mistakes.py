"""Mistakes in settings, one sentence each in the words of the trade: file, key, what is wrong, what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ValidationError

from ..errors import UserError, of_file
from .numbers import BEYOND, OfFile, keys_of

_WORDS = {
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "finite_number": "must be a finite number",
    "int_type": "must be a whole number",
    "int_parsing_size": "must be a whole number of sensible size",
    "bool_type": "must be true or false",
    "string_type": 'must be text in "quotes"',
    "string_too_short": "must not be empty",
    "string_too_long": "must have at most {max_length} characters",
    "string_pattern_mismatch": "must begin with a letter or digit and hold only letters a to z, digits, _ . and -",
    "greater_than": "must be greater than {gt:g}",
    "greater_than_equal": "must not be less than {ge:g}",
    "less_than": "must be less than {lt:g}",
    "less_than_equal": "must not be greater than {le:g}",
    "literal_error": "must be {expected}",
    "callable_type": "must be a function",
    "is_instance_of": "must be of class {class}",
    "mapping_type": "must be a dict",
    "tuple_type": "must be a list in [brackets]",
    "list_type": "must be a list in [brackets]",
    "too_short": "must hold {min_length} values or more",
    "too_long": "must hold {max_length} values or fewer",
}
_SCALAR = {"float_type", "int_type", "bool_type", "string_type"}
_NO_TABLE = {"model_type", "model_attributes_type", "dict_type"}


def validate(model: type[Any], raw: dict[str, Any], path: Path | str) -> Any:
    """Check a table against a settings model, which is to stand in a file.

    Raises:
        UserError: one sentence a mistake, each with file and key.
    """
    with of_file(path):
        try:
            found = model.model_validate(raw)
        except ValidationError as error:
            lines = _sentences(error.errors(include_url=False), raw, model)
            raise UserError("\n".join(dict.fromkeys(lines))) from error
    if isinstance(found, OfFile):
        found._path = Path(path)
    return found


def bounded(what: str, value: Any, gt: float | None = None, ge: float | None = None, le: float | None = None) -> None:
    """Check a number, or an array of them, that is given in Python and not in a file.

    Args:
        what: class and field, for the sentence. gt, ge, le: bounds, as pydantic calls them.

    Raises:
        UserError: one that is not finite or out of its bounds.
    """
    if said := unfit(value, gt, ge, le):
        raise UserError(f"{what}: {said}; correct it")


def unfit(value: Any, gt: float | None = None, ge: float | None = None, le: float | None = None) -> str:
    """What is wrong with a number, or an array of them; nothing if it is finite and in its bounds."""
    if hasattr(value, "toarray"):
        return "is a sparse matrix and must be an array, .toarray() of it"
    try:
        if np.iscomplexobj(value) and np.size(value):
            return "is complex and must be real" + ", as its .real is" * (not np.any(np.imag(value)))
        if np.asarray(value).dtype.kind not in "iufO":  # of texts and truths numpy makes numbers too
            raise TypeError
        at = np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return f"{_shown(value)} is no number"
    least, most = -BEYOND if ge is None else ge, BEYOND if le is None else le
    for kind, bound, good in (
        ("finite_number", None, np.isfinite(at)),
        ("greater_than", gt, gt is None or at > gt),
        ("greater_than_equal", least, at >= least),
        ("less_than_equal", most, at <= most),
    ):
        if not np.all(good):
            wrong = int(np.argmin(good))
            which = f"entry {wrong + 1}" if at.size > 1 else "it"
            return f"{_WORDS[kind].format(gt=bound, ge=bound, le=bound)} ({which} is {at.flat[wrong]:g})"
    return ""


def too_few(count: int, harmonics: int, least: int, better: int) -> str:
    """That points of a cycle are too few for its harmonics."""
    return f"{count} are too few for {harmonics} harmonics; take at least {least}, better {better}"


def whole(what: str, value: Any, ge: int = 0) -> None:
    """Check a count that is given in Python.

    Raises:
        UserError: no whole number, or one below ge.
    """
    if not isinstance(value, int | np.integer) or isinstance(value, bool):
        raise UserError(f"{what}: {value!r} is no whole number; correct it")
    bounded(what, value, ge=ge)


def numbered(what: str, value: Any, count: int, thing: str) -> None:
    """Check the number of one of so many things, counted from 0, that is given in Python.

    Raises:
        UserError: no whole number, or one that is not there.
    """
    whole(what, value)
    if value >= count:
        has = f"there are {count}, counted from 0" if count else "there are none"
        raise UserError(f"{what}: there is no {thing} {value}; {has}")


def _sentences(errors: list[Any], raw: dict[str, Any], model: type[BaseModel]) -> Iterator[str]:
    """One sentence a key, though a setting that may be one thing or another is complained about twice."""
    by_key: dict[tuple[Any, ...], list[tuple[tuple[Any, ...], Any]]] = {}
    for error in errors:
        place = _place(error, raw)
        key = place
        while key and isinstance(key[-1], int) and not isinstance(_at(raw, key), dict):
            key = key[:-1]
        by_key.setdefault(key, []).append((place, error))
    for key in [k for k in by_key if isinstance(_at(raw, k), dict)]:  # a number or a table: the table is meant
        if any(k != key and k[: len(key)] == key for k in by_key) and by_key[key][0][1]["type"] in _SCALAR:
            del by_key[key]
    known = {key: _known_keys(model, key[:-1], raw) for key in by_key}
    meant = set()
    other_way: dict[tuple[Any, ...], list[str]] = {}
    for key, found in by_key.items():
        if found[0][1]["type"] == "extra_forbidden":
            if key[-1] in known[key]:  # of the other way to write this table
                other_way.setdefault(key[:-1], []).append(str(key[-1]))
                continue
            close = _close(str(key[-1]), known[key])
            meant |= {(*key[:-1], *close)}
            yield f"{_written(key, raw)}: unknown key; {_hint(key, close, known[key], model)}"
    for table, odd in other_way.items():
        rest = ", ".join(k for k in _at(raw, table) if k not in odd)
        yield f"{_written(table, raw)}: {', '.join(odd)} cannot stand beside {rest}; keep one of the two ways"
    for key, found in by_key.items():
        if found[0][1]["type"] != "extra_forbidden" and not (found[0][1]["type"] == "missing" and key in meant):
            unit, _ = known[key].get(key[-1] if key else "", ("", ""))
            unit = unit if "length_unit" in model.model_fields else unit.replace("length_unit", "m")
            said = _sentence(key, found, raw)
            bare = not unit or not said.endswith((" add it", " correct it"))
            yield said if bare else f"{said}, in {unit}"


def _close(key: str, known: Iterable[str]) -> list[str]:
    """The known key that may be meant, if any; R_Z for Rz too."""
    plain = {k.replace("_", "").lower(): k for k in known}
    same = plain.get(key.replace("_", "").lower())
    return [same] if same else difflib.get_close_matches(key, known, 1)


def _place(error: Any, raw: Any) -> tuple[Any, ...]:
    """The part of a location that exists in the file, and the missing key if that is the mistake.

    Between the real steps stand names of alternatives and validators.
    """
    place: list[Any] = []
    value = raw
    for step in error["loc"]:
        if isinstance(value, dict) and step in value:
            value = value[step]
        elif isinstance(value, list) and isinstance(step, int) and step < len(value):
            value = value[step]
        elif not (error["type"] == "missing" and isinstance(value, dict) and step is error["loc"][-1]):
            continue
        place.append(step)
    return tuple(place)


def _at(raw: Any, place: tuple[Any, ...]) -> Any:
    for step in place:
        raw = raw[step] if isinstance(raw, list) or step in raw else None
    return raw


def _written(place: tuple[Any, ...], raw: Any) -> str:
    """A key as a person finds it: entries of lists by their name, as ``--set`` takes them."""
    words = []
    for number, step in enumerate(place):
        items = _at(raw, place[:number])
        label = _label(items, step) if isinstance(step, int) and isinstance(items, list) else str(step)
        words.append(label)
    return ".".join(words) or "the file"


def _label(items: list[Any], number: int) -> str:
    for key in ("name", "face", "interface"):
        labels = [item.get(key) if isinstance(item, dict) else None for item in items]
        label = labels[number]
        if isinstance(label, str) and label and labels.count(label) == 1:
            return label
    return str(number)


def _hint(key: tuple[Any, ...], close: list[str], known: Iterable[str], model: Any) -> str:
    if close:
        return f"did you mean '{close[0]}'?"
    homes = sorted(table for table, keys in _tables(model) if key[-1] in keys)
    if len(key) == 2 and f"[{key[0]}]" in homes:
        return f"another kind of [{key[0]}] has it; this one knows {', '.join(known)}"
    if homes:
        return f"it belongs in {' or '.join(homes)}"
    return f"known keys: {', '.join(known)}"


def _tables(model: type[BaseModel]) -> Iterator[tuple[str, list[str]]]:
    for name, field in model.model_fields.items():
        kinds = list(_models_in(field.annotation))
        if kinds:
            many = "tuple" in str(field.annotation)
            yield f"[[{name}]]" if many else f"[{name}]", [key for kind in kinds for key in kind.model_fields]


def _sentence(key: tuple[Any, ...], found: list[tuple[tuple[Any, ...], Any]], raw: Any) -> str:
    value = _at(raw, key)
    where = _written(key, raw)
    kinds = {error["type"] for _, error in found}
    if kinds == {"missing"} and value is None:
        return f"{where}: is missing; add it"
    if "value_error" in kinds:
        text = next(str(error["ctx"]["error"]) for _, error in found if error["type"] == "value_error")
        return (f"{where}: " if key else "") + text + ("" if ";" in text else "; correct it")
    literal = [f for f in found if f[1]["type"] == "literal_error"]
    words = literal if len(literal) < len(found) else []  # a word or something else: the something is the mistake
    found = [f for f in found if f not in words]
    place, error = _most_telling(found, value)
    if error["type"].startswith("union_tag"):
        return _kind_mistake(where, value, error)
    if table := _table_mistake(key, place, value, kinds):
        return f"{where}: {table}"
    given = _at(raw, place)
    entry = f"entry {place[-1] + 1} of the list " if len(place) > len(key) else ""
    said = _words(found, error, given) + (f", or {_expected(words)}" if words and not entry else "")
    return f"{where}: {entry}{said} (it is {_shown(given)}); {_remedy(error, given)}"


def _expected(found: list[tuple[tuple[Any, ...], Any]]) -> str:
    """The words that a setting may be instead, as complaints name them."""
    return " or ".join(error["ctx"]["expected"] for _, error in found)


def _kind_mistake(where: str, value: Any, error: Any) -> str:
    """A table of which there are several kinds, told apart by its key `kind`."""
    known = ", ".join(_shown(tag.strip(" '")) for tag in error.get("ctx", {}).get("expected_tags", "").split(","))
    if error["type"] == "union_tag_not_found":
        return f"{where}.kind: is missing; add it"
    said = f"{where}.kind: {_shown(value['kind'])}" if isinstance(value, dict) else f"{where}: {_shown(value)}"
    return f"{said} is unknown; choose one of {known}"


def _table_mistake(key: tuple[Any, ...], place: tuple[Any, ...], value: Any, kinds: set[str]) -> str:
    """A table given where a list of tables belongs, or the other way round."""
    name = ".".join(step for step in key if isinstance(step, str))
    if kinds & _SCALAR and kinds & _NO_TABLE:
        return f"must be a number or a table (it is {_shown(value)}); correct it"
    if kinds & _NO_TABLE:
        if len(place) > len(key):
            return f"entry {place[-1] + 1} of the list must be a table; write [[{name}]] and its keys below"
        if isinstance(value, list):
            return f"must be one table; write [{name}] with single brackets"
        return f"must be a table (it is {_shown(value)}); write [{name}] and its keys below"
    if kinds == {"tuple_type"} and isinstance(value, dict):
        return f"must be a list; write [[{name}]] with double brackets for a list of tables"
    return ""


def _most_telling(found: list[tuple[tuple[Any, ...], Any]], value: Any) -> tuple[tuple[Any, ...], Any]:
    """Of the complaints about one key, the one that fits what was written."""
    if isinstance(value, list):  # an entry, or the length, rather than "is no number"
        return next((f for f in found if len(f[0]) > 0 and f[1]["type"] not in _SCALAR | {"tuple_type"}), found[-1])
    kinds = "tuple_type", "list_type", "is_instance_of"
    return next((f for f in found if f[1]["type"] not in kinds), found[0])


def _words(found: list[tuple[tuple[Any, ...], Any]], error: Any, given: Any) -> str:
    kind, context = error["type"], error.get("ctx", {})
    if kind in ("too_long", "missing") and isinstance(given, list):
        wanted = context.get("max_length") or 1 + max(f["loc"][-1] for _, f in found if isinstance(f["loc"][-1], int))
        return f"must have {wanted} entries and has {len(given)}"
    if isinstance(given, float) and given != given:
        return _WORDS["finite_number"]
    either = {f["type"] for _, f in found}
    if "tuple_type" in either and either & _SCALAR and not isinstance(given, list):
        return "must be a number or a list of numbers"
    return _WORDS[kind].format(**context) if kind in _WORDS else error["msg"][:1].lower() + error["msg"][1:]


def _remedy(error: Any, given: Any) -> str:
    if error["type"] in ("float_type", "int_type", "bool_type") and isinstance(given, str):
        return "write it without quotes" if is_number(given) or given in ("true", "false") else "correct it"
    return "correct it"


def is_number(text: str) -> bool:
    """Whether Python reads the text as a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _shown(value: Any) -> str:
    """A value as TOML writes it, shortened."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        text = '"' + value.replace("\n", "\\n") + '"'
    elif isinstance(value, list):
        text = "[" + ", ".join(map(_shown, value[:8])) + (", ...]" if len(value) > 8 else "]")
    elif isinstance(value, dict):
        text = "a table"
    elif isinstance(value, int) and abs(value) > 10**18:
        text = "a number beyond all bounds"
    else:
        text = " ".join(str(value).split())
    return text if len(text) <= 60 else text[:57] + "..."


def _known_keys(model: Any, place: tuple[Any, ...], raw: Any = None) -> dict[Any, tuple[str, str]]:
    """Key -> unit and meaning, of the table at a place."""
    for number, step in enumerate(place):
        if isinstance(step, str) and step in getattr(model, "model_fields", {}):
            model = _chosen(model.model_fields[step].annotation, _at(raw, place[: number + 1])) or model
    return keys_of(model) if hasattr(model, "model_fields") else {}


def _chosen(annotation: Any, table: Any) -> Any:
    """The model inside an annotation; of several the one that has the table's `kind`."""
    models = list(_models_in(annotation))
    kind = table.get("kind") if isinstance(table, dict) else None
    for model in models:
        field = model.model_fields.get("kind")
        if kind is not None and field is not None and kind in getattr(field.annotation, "__args__", ()):
            return model
    return models[0] if models else None


def _models_in(annotation: Any) -> Iterator[Any]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in getattr(annotation, "__args__", ()):
        yield from _models_in(argument)
