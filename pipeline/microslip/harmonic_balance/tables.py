"""Tables of functions of two variables whose error is known: cubic splines, refined until it is small, kept in files.

A table is a function on the unit square. It is computed at equally spaced nodes, interpolated by cubic splines (C2, so
that Newton's method sees a smooth function), and held against the function inside its cells, where it does not know it:
the largest difference there is its error, and is kept with it.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .. import __version__
from ..contact.law import settings
from ..data import Array
from ..errors import UserError, in_its_file
from ..files.store import complete_or_absent
from ..programs import program

FORMAT, VERSION = "microslip table", 1

Flat = tuple[bool, bool]
"""Whether the slope is zero at the lower and the upper end of an axis; otherwise the end is not a knot."""


@settings
class Spline:
    """Cubic spline over equally spaced nodes.

    Attributes:
        coefficients: (..., p + 2, q + 2) of the B-splines, p x q nodes; leading axes are separate functions.
    """

    coefficients: jax.Array

    def at(self, s: jax.Array, t: jax.Array, part: jax.Array | int = 0) -> jax.Array:
        """Values (..., k) at places s, t (k,) from 0 to 1 of the k parts chosen; coefficients (part, ..., p, q)."""
        index = jnp.broadcast_to(jnp.asarray(part), s.shape)
        return _looked_up(jnp.moveaxis(self.coefficients, 1, -1), s, t, index)


@jax.custom_jvp
def _looked_up(c: jax.Array, s: jax.Array, t: jax.Array, part: jax.Array) -> jax.Array:
    """Values (m, k) of coefficients (part, p, q, m)."""
    (i, a, _), (j, b, _) = _place(s, c.shape[1]), _place(t, c.shape[2])
    return jnp.einsum("kabm,ka,kb->mk", _blocks(c, part, i, j), a, b)


@_looked_up.defjvp
def _derived(primals: tuple[jax.Array, ...], tangents: tuple[jax.Array, ...]) -> tuple[jax.Array, jax.Array]:
    """One block a point serves the value and both derivatives."""
    c, s, t, part = primals
    (i, a, da), (j, b, db) = _place(s, c.shape[1]), _place(t, c.shape[2])
    block = _blocks(c, part, i, j)
    over_t, moved_t = jnp.einsum("kabm,kb->kam", block, b), jnp.einsum("kabm,kb->kam", block, db)
    value, slope_s = jnp.einsum("kam,ka->mk", over_t, a), jnp.einsum("kam,ka->mk", over_t, da)
    return value, slope_s * tangents[1] + jnp.einsum("kam,ka->mk", moved_t, a) * tangents[2]


def _blocks(c: jax.Array, part: jax.Array, i: jax.Array, j: jax.Array) -> jax.Array:
    """(k, 4, 4, m) coefficients of the cells."""
    return jax.vmap(lambda n, x, y: jax.lax.dynamic_slice(c, (n, x, y, 0), (1, 4, 4, c.shape[3]))[0])(part, i, j)


def _place(s: jax.Array, size: int) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Cell of a place from 0 to 1, the four cubic B-splines there and their derivatives, (k, 4)."""
    x = jnp.clip(s, 0.0, 1.0) * (size - 3)
    i = jnp.clip(x.astype(int), 0, size - 4)
    r = x - i
    one = 1 - r
    middle = 4 - 6 * r**2 + 3 * r**3, 4 - 6 * one**2 + 3 * one**3
    slopes = -3 * one**2, 9 * r**2 - 12 * r, 12 * one - 9 * one**2, 3 * r**2
    return i, jnp.stack([one**3, *middle, r**3], axis=-1) / 6, jnp.stack(slopes, axis=-1) * ((size - 3) / 6)


def fitted(values: Array, flat: tuple[Flat, Flat]) -> Array:
    """(..., p + 2, q + 2) B-spline coefficients of nodal values (..., p, q), at least four along each axis."""
    along_t = np.linalg.solve(_collocation(values.shape[-1], flat[1]), _framed(values)[..., None])[..., 0]
    turned = np.swapaxes(along_t, -1, -2)
    along_both = np.linalg.solve(_collocation(values.shape[-2], flat[0]), _framed(turned)[..., None])[..., 0]
    return np.swapaxes(along_both, -1, -2)


def _framed(values: Array) -> Array:
    """Room for the two conditions at the ends of the last axis."""
    return np.pad(values, [(0, 0)] * (values.ndim - 1) + [(1, 1)])


def _collocation(count: int, flat: Flat) -> Array:
    """(count + 2, count + 2): a condition at each end, the values at the nodes between."""
    M = np.zeros((count + 2, count + 2))
    for i in range(count):
        M[i + 1, i : i + 3] = np.array([1.0, 4.0, 1.0]) / 6
    for row, end, at in ((0, flat[0], slice(0, None)), (-1, flat[1], slice(None, None, -1))):
        weights = [-1.0, 0.0, 1.0] if end else [1.0, -4.0, 6.0, -4.0, 1.0]
        M[row][at][: len(weights)] = weights
    return M


@dataclass(frozen=True)
class Table:
    """Splines of one kind of function, with the error that was found at places the splines do not know.

    Attributes:
        kind: what is tabulated. law: hash of everything it depends on. arrays: name -> coefficients and whatever
            places them. error: largest difference at the held-out places. typical: the difference that 99 of 100 of
            them stay below. tolerance: that was asked for. held_out: number of these places.
    """

    kind: str
    law: str
    arrays: dict[str, Array]
    error: float
    typical: float
    tolerance: float
    held_out: int


def refined(
    function: Callable[[Array, Array], Array], measure: Callable[[Array, Array, Array], Array],
    flat: Sequence[tuple[Flat, Flat]], tolerance: float, counts: Sequence[int], inside: Sequence[float] = (0.5,),
) -> tuple[Array, Array]:  # fmt: skip
    """Coefficients (part, m, p + 2, p + 2) on the first grid that meets a tolerance, and the differences found.

    Args:
        function: values (part, m, p, q) on the grid of s (p,) and t (q,). measure: differences (part, m, p, q) at s, t
            as the size that the tolerance is about. flat: ends of every part. counts: of nodes along each axis, tried
            one after the other; the last one is taken whatever its error. inside: where in every cell, along both axes,
            the function is held against the splines.
    """
    for count in counts:
        s = np.linspace(0.0, 1.0, count)
        middle = np.sort(np.concatenate([s[:-1] + share * np.diff(s) for share in inside]))
        values, exact = function(s, s), function(middle, middle)
        parts = np.stack([fitted(v, ends) for v, ends in zip(values, flat, strict=True)])
        splined = np.stack([_on_grid(part, middle) for part in parts])
        left = measure(splined - exact, middle, middle)
        if left.max() <= tolerance:
            break
    return parts, left


@program
def _at(spline: Spline, s: jax.Array, t: jax.Array) -> jax.Array:
    return spline.at(s, t)


def _on_grid(coefficients: Array, s: Array) -> Array:
    """(m, p, p) spline values on the grid of s along both axes."""
    S, T = (x.ravel() for x in np.meshgrid(s, s, indexing="ij"))
    return np.asarray(_at(Spline(jax.device_put(coefficients[None])), S, T)).reshape(-1, len(s), len(s))


def in_chunks(function: Callable[..., Sequence[Any]], *of: Array, size: int = 512) -> tuple[Array, ...]:
    """What a function gives of arrays (..., n), ``size`` at a time: one program for any number of them.

    The last one stands in where the last chunk has none.
    """
    n, parts = of[0].shape[-1], []
    for start in range(0, n, size):
        at = np.minimum(np.arange(start, start + size), n - 1)
        parts.append(function(*(jax.device_put(x[..., at]) for x in of)))
    return tuple(np.concatenate([np.asarray(p) for p in part], axis=-1)[..., :n] for part in zip(*parts, strict=True))


# files -------------------------------------------------------------------------------------------------------------


def write(table: Table, path: Path | str) -> None:
    """Write a table, complete or absent.

    Raises:
        UserError: the file cannot be written.
    """
    notes = {
        "format": FORMAT, "version": VERSION, "kind": table.kind, "law": table.law, "error": table.error,
        "typical": table.typical, "tolerance": table.tolerance, "held_out": table.held_out,
        "seal": _seal(table.arrays), "made_by": f"microslip {__version__}",
    }  # fmt: skip
    text = np.frombuffer(json.dumps(notes, sort_keys=True).encode(), dtype=np.uint8)
    with complete_or_absent(path) as temporary, open(temporary, "wb") as file:
        np.savez(file, notes=text, **table.arrays)  # type: ignore[arg-type]


@in_its_file
def read(path: Path | str, kind: str, law: str | None = None) -> Table:
    """Read a table and check that it is whole and the one that is wanted.

    Raises:
        UserError: no such file, a damaged or foreign one, a table of something else.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        notes = json.loads(arrays.pop("notes").tobytes().decode())
        whole = notes["format"] == FORMAT and notes["seal"] == _seal(arrays)
        numbers = [float(notes[key]) for key in ("error", "typical", "tolerance", "held_out")]
    except FileNotFoundError as error:
        raise UserError("no such table; leave it out and it is computed") from error
    except Exception as error:  # whatever a damaged archive makes its readers raise
        raise UserError("damaged, or no table of microslip; delete it and it is computed again") from error
    if not whole:
        raise UserError("damaged: its numbers are not those that were written; delete it")
    if (notes["version"], notes["kind"]) != (VERSION, kind) or law not in (None, notes["law"]):
        raise UserError(f"a table of something else ({notes['kind']}, version {notes['version']}); delete it")
    return Table(kind, notes["law"], arrays, numbers[0], numbers[1], numbers[2], int(numbers[3]))


def _seal(arrays: dict[str, Array]) -> str:
    sha = hashlib.sha256()
    for name in sorted(arrays):
        sha.update(f"{name} {arrays[name].dtype.str} {arrays[name].shape}".encode())
        sha.update(np.ascontiguousarray(arrays[name]).tobytes())
    return sha.hexdigest()


def law_hash(law: Any) -> str:
    """Hash of a law: its kind and all of its numbers."""
    leaves, tree = jax.tree_util.tree_flatten(law)
    sha = hashlib.sha256(f"{tree}".encode())
    for leaf in leaves:
        array = np.asarray(leaf, dtype=float)
        sha.update(f"{array.shape}".encode() + np.ascontiguousarray(array).tobytes())
    return sha.hexdigest()


def folder() -> Path | None:
    """Where tables are kept: `$XDG_CACHE_HOME/microslip/tables` or `~/.cache/microslip/tables`; None: nowhere."""
    try:
        path = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "microslip", "tables")
        path.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):
        return None
    return path if os.access(path, os.W_OK) else None


def kept(kind: str, law: str, tolerance: float, make: Callable[[], Table], where: Path | None = None) -> Table:
    """The table from the folder of tables, or made and put there; a damaged one is made again.

    Args:
        tolerance: a kept table with a larger error is not good enough. where: folder; `folder` if None.
    """
    where = where or folder()
    path = None if where is None else where / f"{kind}-{law[:16]}-{tolerance:.0e}.npz"
    if path is not None and path.exists():
        with suppress(UserError):
            return read(path, kind, law)
    table = make()
    if path is not None:
        with suppress(UserError):  # a full disk is no reason to lose the answer
            write(table, path)
    return table
