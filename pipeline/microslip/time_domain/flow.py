"""What moves between two contact forces: exact flows over 1, 2, 4, ... steps, with the work of loads and dampers.

Modes that dampers do not couple flow each by itself; else all are one block. With z = (q_b, v_b, o) of a block

    z(tau) = expm(A tau) z,   work of loads = z^T [int expm(A s)^T (v f^T) expm(A s) ds] z,  that of dampers likewise

both integrals exact (C. F. Van Loan, Computing integrals involving the matrix exponential, IEEE Trans. Automat. Contr.
23, 1978). Kicks by contact forces between such flows make a splitting of second order (G. Strang, 1968) whose only
error is that of the contacts.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import numpy as np
import scipy.linalg

from ..data import Array
from .equations import Equations

DOUBLINGS = 24
"""Flights are exact leaps of at most 2^24 steps."""


class Flow(NamedTuple):
    """Flows over tau 2^k, k = 0, 1, ..., of b blocks of p modes each, s = 2 p + n. All are jax arrays.

    Attributes:
        stack: (K, b, 2 p + 2 s, s), one above the other: how (q_b, v_b, o) moves, and the symmetric matrices, J, of the
            works of loads and of dampers as quadratic forms of it. turn: (K, n, n) of the oscillators. length: (K,) s.
    """

    stack: Any
    turn: Any
    length: Any


def blocks(equations: Equations) -> tuple[int, int]:
    """Number of blocks and modes in each."""
    m = len(equations.omega2)
    coupled = np.abs(equations.C - np.diag(np.diag(equations.C))).any()
    return (1, m) if coupled else (m, 1)


def flow(equations: Equations, tau: float, doublings: int = DOUBLINGS) -> Flow:
    """Flows over tau (s) and its doublings."""
    e = equations
    b, p = blocks(e)
    n = e.turning.shape[0]
    one = _one_step(e, tau, b, p)
    moves, turns, S, L = ([x] for x in one)
    for _ in range(doublings):
        full = _whole(moves[-1], turns[-1])
        with np.errstate(over="ignore", invalid="ignore"):  # of a motion that grows, which takes no leaps
            twice = full @ full
            for kept in (S, L):
                kept.append(kept[-1] + full.transpose(0, 2, 1) @ kept[-1] @ full)
        moves.append(twice[:, : 2 * p])
        turns.append(scipy.linalg.expm(e.turning * tau * 2.0 ** len(turns)))
    assert moves[0].shape == (b, 2 * p, 2 * p + n)
    stack = np.concatenate([np.array(x) for x in (moves, S, L)], axis=2)
    return Flow(*jax.device_put((stack, np.array(turns), tau * 2.0 ** np.arange(len(turns)))))


def _whole(move: Array, turn: Array) -> Array:
    """(b, 2 p + n, 2 p + n) of motion and oscillators together."""
    b, rows, columns = move.shape
    out = np.zeros((b, columns, columns))
    out[:, :rows], out[:, rows:, rows:] = move, turn
    return out


def _one_step(e: Equations, tau: float, b: int, p: int) -> tuple[Array, ...]:
    """move (b, 2 p, 2 p + n), turn, and both quadratic forms of one step."""
    n = e.turning.shape[0]
    modes = np.arange(b * p).reshape(b, p)
    moves, S, L = list[Array](), list[Array](), list[Array]()
    for at in modes:
        A = np.zeros((2 * p + n, 2 * p + n))
        A[:p, p : 2 * p] = np.eye(p)
        A[p : 2 * p, :p] = -np.diag(e.omega2[at])
        A[p : 2 * p, p : 2 * p] = -e.C[np.ix_(at, at)]
        A[p : 2 * p, 2 * p :] = e.B[at]
        A[2 * p :, 2 * p :] = e.turning
        lost, given = np.zeros_like(A), np.zeros_like(A)
        lost[p : 2 * p, p : 2 * p] = e.C[np.ix_(at, at)]
        given[p : 2 * p, 2 * p :] = e.B[at]
        full = scipy.linalg.expm(A * tau)
        moves.append(full[: 2 * p])
        for kept, Q in ((S, given), (L, lost)):
            kept.append(_integral(A, 0.5 * (Q + Q.T), tau))
    return np.array(moves), scipy.linalg.expm(e.turning * tau), np.array(S), np.array(L)


def _integral(A: Array, Q: Array, tau: float) -> Array:
    """The integral of expm(A^T s) Q expm(A s) over tau: by doubling from a step so short that its series converges."""
    n = len(A)
    halvings = max(0, int(np.ceil(np.log2(max(np.abs(A).sum(axis=1).max(initial=0.0) * tau, 1e-300)))) + 1)
    short = tau / 2**halvings
    both = scipy.linalg.expm(np.block([[-A.T, Q], [np.zeros((n, n)), A]]) * short)
    step = both[n:, n:]
    found = step.T @ both[:n, n:]
    for _ in range(halvings):
        found = found + step.T @ found @ step
        step = step @ step
    return 0.5 * (found + found.T)
