"""Arguments of public functions, checked by their annotations as the keys of a file are by theirs."""

from __future__ import annotations

import inspect
import reprlib
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import is_dataclass
from functools import cache, partial, reduce, wraps
from operator import index, or_
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, ParamSpec, TypeVar, Union, get_args, get_origin

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, InstanceOf, create_model

from ..errors import UserError
from ..units import frequencies_in
from .mistakes import unfit, validate

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")

Count = Annotated[int, Field(ge=1)]
Index = Annotated[int, Field(ge=0)]
Text = Annotated[str, Field(min_length=1)]


def numbers(
    *dimensions: int, gt: float | None = None, ge: float | None = None, le: float | None = None
) -> BeforeValidator:
    """What an array may be: how many dimensions it has, any if none are named, and bounds of its entries, of which
    there is one at least."""

    def check(value: Any) -> Any:
        if said := unfit(value, gt, ge, le):
            raise ValueError(said)
        if dimensions and (found := np.ndim(value)) not in dimensions:
            wanted = " or ".join({0: "one number", 1: "a list", 2: "rows of numbers"}[d] for d in dimensions)
            raise ValueError(f"must be {wanted}, and has {found} dimensions")
        if not np.size(value):
            raise ValueError("must not be empty")
        return value

    return BeforeValidator(check)


def wholes(*least: int) -> BeforeValidator:
    """What a list of whole numbers may be: the least of each."""

    def check(value: Any) -> Any:
        try:
            good = [index(n) >= m for n, m in zip(value, least, strict=True)]
        except (TypeError, ValueError):
            good = [False]
        if not all(good):
            wanted = f"{len(least)} whole numbers of {', '.join(map(str, least))} or more"
            raise ValueError(f"is {value!r}; give {wanted}")
        return value

    return BeforeValidator(check)


Frequencies = Annotated[Any, numbers(0, 1, gt=0)]
"""One or (f,), positive."""
Vector = Annotated[Any, numbers(1)]
Rows = Annotated[Any, numbers(2)]


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """The function, whose arguments are looked at before it is called.

    A call raises `UserError`: an argument that is none of what its annotation says; the sentence begins with the
    names of the function and the argument. Sentences made during the call give frequencies in its ``unit``, if it has
    one.
    """
    signature = inspect.signature(function)

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        given = _bound(function, signature, args, kwargs)
        check(function, given.arguments)
        with frequencies_in(given.arguments.get("unit")):
            return function(*args, **kwargs)

    return call


def checked_fields(of: type[T]) -> type[T]:
    """The same of a dataclass and what it is made from."""
    make, signature = of.__init__, inspect.signature(of)

    @wraps(make)
    def init(made: T, *args: Any, **kwargs: Any) -> None:
        check(of, _bound(of, signature, args, kwargs).arguments)
        make(made, *args, **kwargs)

    of.__init__ = init  # type: ignore[method-assign, assignment]
    return of


def _bound(
    of: Callable[..., Any], signature: inspect.Signature, args: tuple[Any, ...], kwargs: dict[str, Any]
) -> inspect.BoundArguments:
    """The arguments of a call by their names.

    Raises:
        UserError: one that there is not, or that is missing; what does not fit of those that are given is told too.
    """
    name, known = of.__name__, signature.parameters.values()
    try:
        given = signature.bind_partial(*args, **kwargs)
    except TypeError as error:
        raise UserError(f"{name}: {error}; it takes {', '.join(signature.parameters)}") from None
    some = inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD
    if missing := [
        p.name for p in known if p.default is p.empty and p.kind not in some and p.name not in given.arguments
    ]:
        one = len(missing) == 1
        said = f"{name}: {', '.join(missing)}: {'is missing; give it' if one else 'are missing; give them'}"
        try:
            check(of, given.arguments)
        except UserError as error:
            said = f"{error}\n{said}"
        raise UserError(said)
    return given


def check(of: Callable[..., Any], given: dict[str, Any]) -> None:
    """Raise `UserError` for what does not fit the annotations of a function or a class. given: name -> value."""
    model = _model(of)
    validate(model, {k: _plain(v) for k, v in given.items() if k in model.model_fields}, of.__name__)


def _plain(value: Any) -> Any:
    """A number of numpy or jax as one of Python."""
    return value.item() if getattr(value, "ndim", None) == 0 else value


def _made(annotation: Any) -> Any:
    """The annotation, whose dataclasses and named tuples stand for what was made by them, not for what makes them."""
    kind, of = get_origin(annotation), get_args(annotation)
    if isinstance(annotation, type) and (is_dataclass(annotation) or hasattr(annotation, "_fields")):
        return Annotated[annotation, InstanceOf()]
    if kind is Annotated:
        return Annotated[_made(of[0]), *of[1:]]
    if kind in (Union, UnionType):
        made = reduce(or_, map(_made, of))
        return Annotated[made, BeforeValidator(partial(_one_of, of))] if _told(of) else made
    return kind[tuple(map(_made, of))] if kind in (Sequence, tuple) else annotation


_KINDS = {Path: "a path", str: "text", Mapping: "a dict", NoneType: ""}


def _told(of: tuple[Any, ...]) -> bool:
    """Whether an argument of several kinds is one that words tell: a path or a dict, text, things
    made here."""
    kinds = list(map(_kind, of))
    return bool({Path, Mapping} & set(kinds)) and all(isinstance(k, type) or k is Literal for k in kinds)


def _kind(annotation: Any) -> Any:
    """A class, or Literal."""
    origin = get_origin(annotation)
    return _kind(get_args(annotation)[0]) if origin is Annotated else (origin or annotation)


def _one_of(of: tuple[Any, ...], value: Any) -> Any:
    """Refuse what is of none of some kinds."""
    words: list[str] = []
    for one in of:
        kind, choices = _kind(one), get_args(one)
        fits = isinstance(value, str) and value in choices if kind is Literal else isinstance(value, kind)
        if fits:
            return value
        words += map(repr, choices) if kind is Literal else [_KINDS.get(kind, kind.__name__)]
    *some, last = filter(None, words)
    raise ValueError(f"is {reprlib.repr(value)}; give {', '.join(some)}{' or ' if some else ''}{last}")


@cache
def _model(of: Callable[..., Any]) -> type[BaseModel]:
    """Keys and what they may be; names that only a type checker knows may be anything."""
    names, scope = dict(inspect.get_annotations(of)), vars(sys.modules[of.__module__])
    keys: dict[str, Any] = {}
    for name, annotation in names.items():
        try:
            keys[name] = (_made(eval(annotation, scope) if isinstance(annotation, str) else annotation), None)
        except NameError:
            continue
    keys.pop("return", None)
    if not isinstance(of, type):
        more = {p.name for p in inspect.signature(of).parameters.values() if p.kind is p.VAR_KEYWORD}
        keys = {name: key for name, key in keys.items() if name not in more}
    return create_model(of.__name__, __config__=ConfigDict(strict=True, arbitrary_types_allowed=True), **keys)
