"""How good a reduction is when every contact sticks: its frequencies with the interfaces held, against a reference.

A basis that answers a free body well may fail once its contacts stick. The reference is Rubin's space under B u = 0,
improved by one step of inverse iteration in that space of the full model (Bathe 11.6, subspace iteration); it costs
a few right-hand sides with the factors that are there already.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from ..data import Array
from ..linalg.eigen import Pencil
from .problem import Reduced, hermitian, own_modes, without_modes

COUNT = 3  # frequencies that are told
_BLOCK = 8  # shapes iterated


def reference(pencil: Pencil, values: Array, X: Array, B: sp.csr_matrix, answers: Array, relieved: bool) -> Array:
    """(at most 3,) lowest angular frequencies with B u = 0, rad/s, slightly from above; pencil factorised at a shift.

    Args:
        values, X: (m,) eigenvalues and (n, m) modes. B: (b, n) interface rows. answers: (n, b) static ones.
        relieved: whether the answers are those of a body with rigid motions.
    """
    if not B.shape[0]:
        return np.zeros(0)
    more, W = own_modes(pencil, without_modes(pencil, X, answers))
    S = np.hstack([X, W])
    lowest = _lowest(np.diag(np.concatenate([values, more])), np.eye(S.shape[1]), np.asarray(B @ S))[1]
    if not lowest.shape[1]:
        return np.zeros(0)
    shapes = S @ lowest[:, :_BLOCK]
    U = pencil.solve(B.conj().T.toarray()) if relieved else answers
    step = pencil.solve(pencil.M(shapes))
    step = step - U @ _least(np.asarray(B @ U), np.asarray(B @ step))
    return np.sqrt(own_modes(pencil, step)[0][:COUNT])


def frequencies(method: str, reduced: Reduced, T: Array, residual: Array) -> Array:
    """(at most 3,) lowest angular frequencies of a reduced body with its interfaces held, rad/s.

    Args:
        T: (b, c) interface rows of the coordinates. residual: (b, b) compliance that they leave out, for "macneal".
    """
    kind = np.array(reduced.kind)
    if "interface-force" in reduced.kind:
        values = scipy.linalg.eigh(reduced.K_r, reduced.M_r, eigvals_only=True)
        values = values[values > 0]
    elif (kind == "interface").any() or (kind == "massless-interface").any():
        inner = np.flatnonzero((kind != "interface") & (kind != "massless-interface"))
        pick = np.ix_(inner, inner)
        values = scipy.linalg.eigh(reduced.K_r[pick], reduced.M_r[pick], eigvals_only=True)
    elif method == "macneal":
        values = np.linalg.eigvalsh(reduced.K_r + hermitian(T.conj().T @ _least(residual, T)))
    else:
        values = _lowest(reduced.K_r, reduced.M_r, T)[0]
    return np.sqrt(np.maximum(values[:COUNT], 0.0))


def _least(flexibility: Array, motion: Array) -> Array:
    """Forces that hold against a motion; none along rows that cannot move or that follow from others."""
    size = np.sqrt(np.maximum(np.diag(flexibility).real, 0.0))
    scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 1e-7 * size.max(initial=0.0))
    w, Q = np.linalg.eigh(hermitian(flexibility) * np.outer(scale, scale))
    inverse = np.divide(1.0, w, out=np.zeros_like(w), where=w > 1e-13 * w.max(initial=0.0))
    return scale[:, None] * (Q @ (inverse[:, None] * (Q.conj().T @ (scale[:, None] * motion))))


def _lowest(K: Array, M: Array, T: Array) -> tuple[Array, Array]:
    """Eigenvalues and vectors of a reduced pencil under T q = 0, all of them, ascending."""
    size = np.linalg.norm(T, axis=1, keepdims=True)
    N = scipy.linalg.null_space(T / np.where(size > 0, size, 1.0), rcond=1e-11)
    values, V = scipy.linalg.eigh(hermitian(N.conj().T @ K @ N), hermitian(N.conj().T @ M @ N))
    return values, N @ V


def indicators(
    method: str, reduced: Reduced, T: Array, labels: Sequence[str], static: Array, held: Array, stuck: Array,
    certified: Array, rigid: int,
) -> dict[str, float]:  # fmt: skip
    """Numbers that say how good a reduced body is.

    ``static_error_interface``, ``_excitation``, ``_monitor``: the largest share of the static compliance of one such
    row that the coordinates leave out. ``free_error_1..3``: the lowest elastic frequencies against the certified
    ones. ``stuck_hz_1..3`` and ``stuck_error_1..3``: the lowest with every interface held, and how far this basis is
    off; an error is missing where the basis has no motion left.

    Args:
        T: (r, c) rows of the coordinates, named by `labels`. static, held: (r, r) compliance of the body, and of
            the coordinates. stuck: `reference`. certified: (m,) eigenvalues of the full model, `rigid` first.
    """
    found = _static_errors(labels, static, held)
    low = np.sqrt(certified[rigid : rigid + COUNT])
    for i, (a, b) in enumerate(zip(reduced.omega[rigid:], low, strict=False), 1):
        if b > 0:  # not of a mechanism that is none of the rigid motions
            found[f"free_error_{i}"] = float(abs(a / b - 1))
    at = [i for i, label in enumerate(labels) if label.startswith("interface:")]
    if not len(stuck):
        return found
    own = frequencies(method, reduced, T[at], (static - held)[np.ix_(at, at)])
    for i, exact in enumerate(stuck, 1):
        found[f"stuck_hz_{i}"] = float(exact / 2 / np.pi)
    for i, (a, b) in enumerate(zip(own, stuck, strict=False), 1):
        found[f"stuck_error_{i}"] = float(abs(a / b - 1))
    return found


def _static_errors(labels: Sequence[str], static: Array, held: Array) -> dict[str, float]:
    whole, left = np.diag(static).real, np.abs(np.diag(static - held))
    share = np.divide(left, whole, out=np.zeros_like(left), where=whole > 0)
    found: dict[str, float] = {}
    for label, value in zip(labels, share, strict=True):
        key = f"static_error_{label.split(':')[0]}"
        found[key] = max(found.get(key, 0.0), float(value))
    return found
