"""What moves between two contact forces: exact flows over 1, 2, 4, ... steps, with the work of loads and dampers.

Modes that dampers do not couple flow each by itself; else all are one block. With z = (q_b, v_b, o) of a block

    z(tau) = expm(A tau) z,   work of loads = z^T [int expm(A s)^T (v f^T) expm(A s) ds] z,  that of dampers likewise

both integrals exact (C. F. Van Loan, Computing integrals involving the matrix exponential, IEEE Trans. Automat. Contr.
23, 1978). Kicks by contact forces between such flows make a splitting of second order (G. Strang, 1968) whose only
error is that of the contacts.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ..data import Array
from .contacts import times
from .equations import MotionEquations

TERMS = 14
"""Of the exponential's series, whose argument has a norm of 1/8 at most: the next one is below 1e-23."""


class BodyFlow(NamedTuple):
    """Flows over tau 2^k, k = 0, 1, ..., of b blocks of p modes each, s = 2 p + n.

    Attributes:
        stack: (K, 2 p + 2 s, s, b), one above the other: how (q_b, v_b, o) moves, and the symmetric matrices, J, of the
            works of loads and of dampers as quadratic forms of it; blocks stand last, and are done side by side.
            turn: (K, n, n) of the oscillators. length: (K,) s.
    """

    stack: Any
    turn: Any
    length: Any


def blocks(equations: MotionEquations) -> tuple[int, int]:
    """Number of blocks and modes in each."""
    m = len(equations.omega2)
    coupled = np.abs(equations.C - np.diag(np.diag(equations.C))).any()
    return (1, m) if coupled else (m, 1)


def flow(equations: MotionEquations, tau: float, doublings: int) -> BodyFlow:
    """Flows over tau (s) and its doublings: of what they add, as what is added in the shortest of steps would be lost
    in the last digits of 1."""
    b, p = blocks(equations)
    grown, *works = _one_step(equations, tau, b, p)
    length, identity = tau * 2.0 ** np.arange(doublings + 1), np.eye(grown.shape[1])
    flows = [(grown, *works)]
    for _ in range(doublings):
        full = identity + grown
        with np.errstate(over="ignore", invalid="ignore"):  # of a motion that grows, which takes no leaps
            grown = 2 * grown + grown @ grown
            works = [kept + full.transpose(0, 2, 1) @ kept @ full for kept in works]
        flows.append((grown, *works))
    moves, S, L = (np.array(x) for x in zip(*flows, strict=True))
    stack = np.concatenate([(identity + moves)[:, :, : 2 * p], S, L], axis=2).transpose(0, 2, 3, 1)
    return BodyFlow(np.ascontiguousarray(stack), equations.turned(length), length)


def flown(A: Any, y: Any, o: Any) -> Any:
    """(r, b) rows A (r, s, b) of a flow times (q_b, v_b, o), of bodies at y (b, 2 p)."""
    if A.shape[2] == 1:
        return times(A[:, :, 0], jnp.concatenate([y[0], o]))[:, None]
    return sum(A[:, i] * coordinate for i, coordinate in enumerate((*y.T, *o)))


def worked(A: Any, y: Any, o: Any) -> tuple[Any, Any]:
    """(b, 2 p) after a flow A (2 p + 2 s, s, b), and (2, b) J given by loads and taken by dampers in it."""
    after, n = flown(A, y, o), y.shape[1]
    z = jnp.concatenate([y.T, jnp.broadcast_to(o[:, None], (len(o), len(y)))])
    return after[:n].T, (z * after[n:].reshape(2, *z.shape)).sum(axis=1)


def _one_step(e: MotionEquations, tau: float, b: int, p: int) -> tuple[Array, ...]:
    """(b, s, s) what (q_b, v_b, o) grow by in one step, and both quadratic forms of it, of all blocks together."""
    s, q, v, o = 2 * p + e.turning.shape[0], slice(p), slice(p, 2 * p), slice(2 * p, None)
    at = np.arange(b * p).reshape(b, p)
    C, A = e.C[at[:, :, None], at[:, None, :]], np.zeros((b, s, s))
    A[:, q, v], A[:, v, q] = np.eye(p), -e.omega2[at][:, :, None] * np.eye(p)
    A[:, v, v], A[:, v, o], A[:, o, o] = -C, e.B[at], e.turning
    lost, given = np.zeros_like(A), np.zeros_like(A)
    lost[:, v, v], given[:, v, o] = C, e.B[at]
    S, L = (_integral(A, 0.5 * (Q + Q.transpose(0, 2, 1)), tau) for Q in (given, lost))
    return grown(A * tau), S, L


def grown(A: Array) -> Array:
    """expm(A) - 1 of matrices (b, s, s), in which small A lose nothing: the series of a 2^k-th, doubled k times."""
    halvings = max(0, int(np.ceil(np.log2(max(np.abs(A).sum(axis=2).max(initial=0.0), 1e-300)))) + 3)
    growth = term = x = A / 2**halvings
    for k in range(2, TERMS):
        term = term @ x / k
        growth = growth + term
    for _ in range(halvings):
        growth = 2 * growth + growth @ growth
    return growth


def _integral(A: Array, Q: Array, tau: float) -> Array:
    """The integrals of expm(A^T s) Q expm(A s) over tau: by doubling from a step so short that its series converges."""
    n = A.shape[1]
    halvings = max(0, int(np.ceil(np.log2(max(np.abs(A).sum(axis=2).max(initial=0.0) * tau, 1e-300)))) + 1)
    rows = np.concatenate([-A.transpose(0, 2, 1), Q], axis=2), np.concatenate([0 * A, A], axis=2)
    both = grown(np.concatenate(rows, axis=1) * (tau / 2**halvings))
    step = np.eye(n) + both[:, n:, n:]
    integral = step.transpose(0, 2, 1) @ both[:, :n, n:]
    for _ in range(halvings):
        integral = integral + step.transpose(0, 2, 1) @ integral @ step
        step = step @ step
    return 0.5 * (integral + integral.transpose(0, 2, 1))
