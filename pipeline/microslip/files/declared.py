"""Nouns in HDF5 files as their fields declare it (`data.Stored`): written, read, held to their shapes and numbers."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, TypeVar, get_type_hints

import h5py
import numpy as np

from ..data import INTERFACE_ROWS, MOTIONS, Array, ComplexArray, Flags, Indices, Stored
from .hdf5 import IMAGINARY, put, put_scale

Noun = TypeVar("Noun")
Scales = dict[str, h5py.Dataset]
SIZES = {"axis": 3, "component": 6, "frame_axis": 3, "interface_row": len(INTERFACE_ROWS), "motion": len(MOTIONS)}
TWIN = {"axis": "axis_", "component": "component_", "mode": "mode_column", "compliance_row": "compliance_column"}
"""What a dimension is called where it stands a second time: xarray wants distinct names."""
COORDINATES = {"mode", "compliance_row", "force"}
"""Over one of these a dataset may be complex."""


@cache
def declared(kind: type) -> dict[str, tuple[Stored, Any]]:
    """Field -> how it stands in a file and its type, in the order of writing."""
    found = {}
    for name, hint in get_type_hints(kind, include_extras=True).items():
        for how in getattr(hint, "__metadata__", ()):
            if isinstance(how, Stored):
                found[name] = how, hint.__origin__
    return dict(sorted(found.items(), key=lambda f: f[1][0].order))


def escaped(name: str) -> str:
    """A name as one HDF5 link name: no slash, not empty, not a dot alone."""
    text = name.replace("%", "%25").replace("/", "%2F").replace("\0", "%00")
    return "%2E" if text == "." else text or "%"


def unescaped(name: str) -> str:
    text = name.replace("%2E", ".").replace("%2F", "/").replace("%00", "\0").replace("%25", "%")
    return "" if name == "%" else text


# writing ---------------------------------------------------------------------------------------------------------


def write(
    group: h5py.Group, noun: Any, scales: Scales | None, name: str = "", part: str | tuple[str, ...] = "",
    homes: Mapping[str, h5py.Group] | None = None,
) -> None:  # fmt: skip
    """Write a noun's fields into its group.

    Args:
        scales: those of dimensions that stand in the group or above it; others are made of numbers from 1. None: axes
            have names alone. name: what the noun is called. part: how the places begin that are written; without it all
            that are not absolute. homes: dimension -> the group in which its scale stands, if elsewhere; it is linked.
    """
    scales, groups = scales if scales is None else dict(scales), {"": group}
    for field, (how, _) in declared(noun.__class__).items():
        at, value = how.at or field, getattr(noun, how.by or field)
        if not (at.startswith(part) if part else at[0] != "/") or how.when and (value is None or not np.size(value)):
            continue
        place, _, attributes = at.replace("<name>", escaped(name)).partition("@")
        if attributes:
            _put_attributes(group[place] if place and place in group else _group(group, place), attributes, value)
            continue
        above, _, own = place.rpartition("/")
        if above not in groups:
            groups[above] = _group(group, above)
        where, axes = groups[above], (how.over, scales, homes or {})
        unit = getattr(noun, how.unit[1:]) if how.unit.startswith("@") else how.unit
        _put(where, own, np.array(value, dtype="U") if isinstance(value, tuple) else np.asarray(value), unit, *axes)
        if how.hertz:
            _put(where, "frequency", noun.frequency, "Hz", *axes)


def _group(group: h5py.Group, place: str) -> h5py.Group:
    """The group at a place, made if need be, one link at a time: those made together share their letters' encoding."""
    if place.startswith("/"):
        group, place = group.file, place[1:]
    for part in place.split("/") if place else ():
        group = group.require_group(part)
    return group


def _put_attributes(where: Any, names: str, value: Any) -> None:
    for name, v in zip(names.split(","), value if "," in names else [value], strict=True):
        where.attrs[name] = np.nan if v is None else int(v) if isinstance(v, bool | np.bool_) else v


def _put(
    where: h5py.Group, name: str, value: Array, unit: str, over: str, scales: Scales | None,
    homes: Mapping[str, h5py.Group],
) -> None:  # fmt: skip
    value = value.astype(np.int64) if value.dtype == bool else value
    if scales is not None and over == name:  # the values along a dimension are its scale
        scales[name] = put_scale(where, name, value)
        return
    labels: list[str] = []
    for label in over.split():
        if label == "own_mode" and label not in (scales or {}):  # as many modes as coordinates
            label = "mode"
        labels.append(TWIN[label] if label in labels else label)
    if scales is None or {"axis_", "component_"} & set(labels):
        put(where, name, value, unit, tuple(labels))
        return
    for label, size in zip(labels, value.shape, strict=True):
        if label not in scales:
            scales[label] = _scale(where, label, size, scales, homes)
    put(where, name, value, unit, scales=[scales[label] for label in labels])


def _scale(
    where: h5py.Group, label: str, size: int, scales: Scales, homes: Mapping[str, h5py.Group]
) -> h5py.Dataset:  # fmt: skip
    """The scale of a dimension from its home, or a new one."""
    home = homes.get(label, where)
    twin = next((of for of, other in TWIN.items() if other == label), "")
    scale = home.get(label) or put_scale(home, label, scales[twin][()] if twin else np.arange(1, size + 1))
    if home != where:
        where[label] = scale
    return scale


def write_each(where: h5py.Group, nouns: Mapping[str, Any], scales: Scales) -> None:
    """Write nouns by their names into groups of their own; attribute `order`: their order of precedence."""
    where.attrs["order"] = json.dumps(list(nouns))
    for name, noun in nouns.items():
        write(where.create_group(escaped(name)), noun, scales)


# reading ---------------------------------------------------------------------------------------------------------


def read(kind: type[Noun], group: h5py.Group, sizes: Mapping[str, int], name: str = "", /, **known: Any) -> Noun:
    """A noun from its group.

    Args:
        sizes: lengths of dimensions that are known. name: as in `write`. known: the fields that are not declared.

    Raises:
        ValueError, KeyError: something is missing, of another type, or of other lengths than the rest.
    """
    sizes, values = {**SIZES, **sizes}, {}
    for field, (how, hint) in declared(kind).items():  # type: ignore[arg-type]
        place, _, attributes = (how.at or field).replace("<name>", escaped(name)).partition("@")
        if attributes:
            values[field] = _attributes(group[place] if place else group, attributes, hint)
        elif how.when and place not in group:
            shape = (0, *(sizes.get(d, 0) for d in how.over.split()[1:]))
            nothing = np.zeros(shape, bool if hint == Flags else float)
            values[field] = None if type(None) in getattr(hint, "__args__", ()) else nothing
        else:
            values[field] = _value(group, place, how, hint, sizes)
    return kind(**values, **known)


def read_each(kind: type[Noun], where: h5py.Group, sizes: Mapping[str, int]) -> dict[str, Noun]:
    """What `write_each` wrote."""
    return {name: read(kind, where[escaped(name)], sizes) for name in names(where)}


def names(where: h5py.Group) -> list[str]:
    """The names of a group's members in their order of precedence."""
    found = json.loads(str(where.attrs["order"]))
    if not isinstance(found, list) or sorted(escaped(str(n)) for n in found) != sorted(where):
        raise ValueError(f"{where.name}: its attribute 'order' does not list its members")
    return found


def _attributes(where: Any, names: str, hint: Any) -> Any:
    found = [where.attrs[name] for name in names.split(",")]
    if len(found) > 1:
        return np.array([float(v) for v in found])
    if hint in (str, int, bool, float):
        return hint(found[0])
    return None if np.isnan(found[0]) else float(found[0])


def _value(group: h5py.Group, place: str, how: Stored, hint: Any, sizes: dict[str, int]) -> Any:
    shape = [sizes.get(d) for d in how.over.split()]
    if hint == tuple[str, ...]:
        value: Any = texts(group, place, *shape)
    elif hint == Flags:
        value = indices(group, place, None, 2).astype(bool)
    else:
        value = (array if COORDINATES & set(how.over.split()) else real)(group, place, *shape)
    for d, n in zip(how.over.split(), np.shape(value), strict=True):
        if sizes.setdefault(d, n) != n:
            raise ValueError(f"{group.name}/{place} has shape {np.shape(value)}, but {d} is {sizes[d]} long")
    if how.hertz:
        hertz = real(group, f"{place.removesuffix('omega')}frequency", *shape)
        if not np.allclose(hertz * 2 * np.pi, np.abs(value), rtol=1e-12, atol=0, equal_nan=True):
            raise ValueError(f"{group.name}/{place} is not 2 pi times the frequency beside it")
    return float(value) if hint is float else value.astype(complex) if hint == ComplexArray else value


def array(group: h5py.Group, name: str, *shape: int | None) -> Array:
    """Numbers of the given shape (None: any length), complex where their imaginary part stands beside them.

    Raises:
        ValueError: missing, of another shape or type.
    """
    found = real(group, name, *shape)
    if name + IMAGINARY in group:
        found = found.astype(np.complex128)  # parts put in one by one keep the signs of zeros
        found.imag = real(group, name + IMAGINARY, *shape)
    return found


def real(group: h5py.Group, name: str, *shape: int | None) -> Array:
    """Likewise, real whatever stands beside."""
    return np.asarray(_dataset(group, name, shape, "f", "floating-point numbers")[()], dtype=np.float64)


def indices(group: h5py.Group, name: str, columns: int | None, limit: int) -> Indices:
    """Whole numbers from 0 to below `limit`: (any, columns), or (any,) without columns.

    Raises:
        ValueError: missing, of another shape or type, or beyond the limit.
    """
    dataset = _dataset(group, name, (None,) if columns is None else (None, columns), "iu", "whole numbers")
    values = np.asarray(dataset[()]).astype(np.int64)
    if values.size and (values.min() < 0 or values.max() >= limit):
        raise ValueError(f"{group.name}/{name} has numbers beyond 0 to {limit - 1}")
    return values


def texts(group: h5py.Group, name: str, count: int | None = None) -> tuple[str, ...]:
    """Words.

    Raises:
        ValueError: missing, no text, or another number of words.
    """
    return tuple(v.decode() for v in _dataset(group, name, (count,), "S", "text")[()])


def _dataset(group: h5py.Group, name: str, shape: tuple[int | None, ...], kinds: str, what: str) -> h5py.Dataset:
    try:
        dataset = group[name]
    except KeyError as error:
        raise ValueError(f"{group.name}/{name} is missing") from error
    found = getattr(dataset, "shape", None)
    if found is None or len(found) != len(shape) or any(b not in (None, a) for a, b in zip(found, shape, strict=True)):
        wanted = " x ".join("any" if n is None else str(n) for n in shape) or "one number"
        raise ValueError(f"{group.name}/{name} has shape {found}, expected {wanted}")
    if dataset.dtype.kind not in kinds:
        raise ValueError(f"{group.name}/{name} does not hold {what}")
    return dataset


# checking --------------------------------------------------------------------------------------------------------


def nouns(noun: Any) -> Iterator[Any]:
    """A noun and those in its fields."""
    yield noun
    for field in fields(noun):
        value = getattr(noun, field.name)
        for inner in value.values() if isinstance(value, Mapping) else [value]:
            if is_dataclass(inner):
                yield from nouns(inner)


def agrees(noun: Any, sizes: Mapping[str, int]) -> bool:
    """Whether fields over the same dimension have the same length there. sizes: lengths that are known."""
    sizes = {**SIZES, **sizes}
    for field, (how, _) in declared(noun.__class__).items():
        value, over = getattr(noun, how.by or field), how.over.split()
        if not over or value is None or how.when and not np.size(value):
            continue
        shape = np.shape(value)
        if len(shape) != len(over) or any(sizes.setdefault(d, n) != n for d, n in zip(over, shape, strict=True)):
            return False
    return True


def numbers(noun: Any) -> Iterator[Array]:
    """The datasets of a noun that must be finite."""
    for field, (how, _) in declared(noun.__class__).items():
        value = np.asarray(getattr(noun, how.by or field))
        if how.finite and "@" not in how.at and value.dtype.kind in "fc":
            yield value
