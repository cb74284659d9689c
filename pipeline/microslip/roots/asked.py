"""From what a caller gives to the roots: matrices checked, the window closed."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from ..data import MatrixTerm, ModalBasis
from ..errors import UserError
from ..exchange.choice import select
from ..files import hdf5
from ..linalg import quadratic
from ..linalg.parametric import Family, family_of_group
from ..linalg.quadratic import Quadratic, Window
from ..progress import Report
from ..ring.resonances import speeds_of
from ..settings.mistakes import unfit
from .diagram import Diagram, diagram
from .spectrum import Spectrum, spectrum


def roots_of(
    body: Any, frequency: tuple[float, float] | None, growth: tuple[float, float], over: str | None, values: Any,
    at: Mapping[str, float] | None, accuracy: float, neutral: float, certify: bool, speed: int | None,
    report: Report,
) -> Spectrum | Diagram:  # fmt: skip
    """See `bodies.stability`; body: a basis, matrices or a family."""
    family = _family(body, speed)
    window = _window(family, growth, frequency)
    if odd := sorted(set(at or {}) - {t.parameter for t in family.terms}):
        raise UserError(f"stability: at: no matrix scales with the parameter '{odd[0]}'; leave it out")
    if over is None:
        if values is not None:
            raise UserError("stability: values: of which parameter? Give over, too")
        Q = family.at(at or {})
        return spectrum(Q, window, accuracy=accuracy, neutral=neutral, certify=certify, report=report)
    points = np.asarray([] if values is None else values, dtype=float)
    if len(points) < 2 or not np.isfinite(points).all() or (np.diff(points) <= 0).any():
        raise UserError(f"stability: values: of '{over}' must be two or more rising numbers")
    return diagram(family, over, points, window, at=at, neutral=neutral, report=report)


def window_of(asked: Any) -> Window:
    """The window, in 1/s and rad/s, of keys whose `frequency` is in Hz and `growth` in 1/s."""
    low, high = asked.frequency
    return Window(asked.growth, (2 * np.pi * low, 2 * np.pi * high))


def _family(body: Any, speed: int | None) -> Family:
    if speed is not None and not isinstance(body, ModalBasis):
        raise UserError("stability: speed: is that of a modal file or basis; leave it out")
    if isinstance(body, Family):
        return body
    if isinstance(body, ModalBasis):
        speeds = len(speeds_of(body))
        if speeds > 1 and speed is None:
            raise UserError(f"stability: {body.name} holds {speeds} speeds; give speed = 0 to {speeds - 1}")
        body = select(body, speed or 0, None)
        return family_of_group(body.name, body.groups[min(body.groups)])
    if isinstance(body, Quadratic):
        body = (body.M, body.C, body.K)
    if not isinstance(body, tuple | list) or len(body) != 3:
        raise UserError("stability: body: give a path, a modal basis or three matrices (M, C, K)")
    matrices = [_matrix(A, key) for A, key in zip(body, "MCK", strict=True)]
    sizes = {key: A.shape[0] for A, key in zip(matrices, "MCK", strict=True)}
    if len(set(sizes.values())) > 1:
        told = ", ".join(f"{key} {n} x {n}" for key, n in sizes.items())
        raise UserError(f"stability: the matrices are {told}; give them the same size")
    if any(map(sp.issparse, matrices)):
        matrices = [sp.csr_matrix(A) for A in matrices]
    return Family(tuple(MatrixTerm(r, A) for r, A in zip(("mass", "damping", "stiffness"), matrices, strict=True)))


def _matrix(A: Any, key: str) -> Any:
    if said := unfit(A.tocsr().data if sp.issparse(A) else A):
        raise UserError(f"stability: body: {key}: {said}; correct it")
    A = A.tocsr().astype(float) if sp.issparse(A) else np.atleast_2d(np.asarray(A, dtype=float))
    if A.ndim != 2 or A.shape[0] != A.shape[1]:
        raise UserError(f"stability: body: {key}: has shape {A.shape}; give a square matrix")
    if not np.isfinite(A.data if sp.issparse(A) else A).all():
        raise UserError(f"stability: body: {key}: holds a number that is not finite; correct it")
    return A


def _window(family: Family, growth: tuple[float, float], frequency: tuple[float, float] | None) -> Window:
    """The window in 1/s and rad/s; where everything is computed at once it may be open."""
    small = family.terms[0].matrix.shape[0] <= quadratic.DENSE
    low, high = frequency or (0.0, math.inf)
    if not small and not np.isfinite([low, high, *growth]).all():
        raise UserError("stability: frequency and growth: give both ends of both for matrices of this size")
    if not 0 <= low < high or not growth[0] < growth[1]:
        raise UserError(
            f"stability: the window of {low:g} to {high:g} Hz and {growth[0]:g} to {growth[1]:g} 1/s has no area or "
            "begins below 0 Hz; give the smaller number first"
        )
    return Window((float(growth[0]), float(growth[1])), (2 * np.pi * low, 2 * np.pi * high))


# file --------------------------------------------------------------------------------------------


def write_roots(path: Path, found: Spectrum, over: Diagram | None, values: Mapping[str, float]) -> None:
    """Roots, their right and left vectors, and the roots over a range, as HDF5 with named dimensions.

    Raises:
        UserError: no permission, no space.
    """
    with hdf5.sealed(path) as file:
        file.attrs["format"], file.attrs["complete"] = "microslip-roots", int(found.complete)
        file.attrs["values"] = json.dumps(dict(values))
        where = file.create_group("roots")
        for name, column in found.columns.items():
            hdf5.put(where, name, np.array(column), dims=("root",))
        hdf5.put(where, "s", found.roots.s, "1/s", ("root",))
        for name, vectors in (("shape", found.roots.x), ("left", found.roots.y)):
            hdf5.put(where, name, vectors, dims=("coordinate", "root"))
        for name, column in over.columns.items() if over else ():
            hdf5.put(file.require_group("over"), name, column, dims=("row",))
