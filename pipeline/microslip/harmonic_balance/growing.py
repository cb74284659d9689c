"""What a balance cannot show by itself: motions that the linear part feeds, and friction that hangs on the samples.

Harmonic balance asks for a periodic motion and finds it, whether it is stable or not. Without damping that is negative
and without circulatory forces every free motion loses energy, and what nothing but friction disturbs is nearly always
stable; with them it need not be, and the multipliers of the answer tell.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

from ..contact.point import saws
from ..data import Array, largest
from ..errors import UserError
from ..system.assembly import Assembly, Linear
from ..units import hertz
from .problem import Problem
from .stability import Settings, orbit, stability

NEUTRAL = 1e-9
"""Of a matrix, over its largest entry, what rounding leaves; of a growth, over the size of its root, too. Double roots
at zero, rigid motions, are known to the square root of rounding: those below 1e-6 of the largest count as none."""


def growing(assembly: Assembly) -> list[str]:
    """A sentence on the free motion that grows fastest, with open or sliding contacts that hold nothing and with
    sticking ones; nothing where damping is nowhere negative and stiffness symmetric (Hermitian in a wave)."""
    waves = [m.at(assembly.index(1)) for m in assembly.components]
    fed = any(_feeds(at.matrices[2], at.matrices[1] + at.circulatory) for at in waves)
    fed = fed or any(_feeds(f.C, f.K) for f in assembly.flow)
    if not fed:
        return []
    part = assembly.joined(1)
    kinds = [("Without its contacts" if assembly.contacts else "By itself", part.K)]
    if assembly.contacts:
        k = assembly.stiffness @ np.linalg.inv(np.eye(part.count) + part.residual @ assembly.stiffness)
        kinds.append(("With sticking contacts", part.K + part.rows.conj().T @ k @ part.rows))
    said = []
    for when, K in kinds:
        if (root := _fastest(part, K)) is not None:
            said.append(f"{when} the motion at {hertz(abs(root.imag) / (2 * np.pi))} grows by exp({root.real:.3g} t/s)")
    if not said:
        return []
    return [f"{' and '.join([said[0], *(s[0].lower() + s[1:] for s in said[1:])])}: its damping is negative, or "
            "circulatory forces feed it, and a periodic motion need not be stable."]  # fmt: skip


def _feeds(C: Array, K: Array) -> bool:
    """Whether a damping (m, m) or a stiffness (m, m) can give a free motion energy."""
    if largest(K - K.conj().T) > NEUTRAL * largest(K):
        return True
    lowest = np.linalg.eigvalsh(0.5 * (C + C.conj().T)).min(initial=0.0)
    return bool(lowest < -NEUTRAL * largest(C))


def _fastest(part: Linear, K: Array) -> complex | None:
    """1/s, the root with the largest growth; None where all motions die out or stay."""
    n, unit = len(part.M), np.sqrt(np.linalg.norm(K) / np.linalg.norm(part.M)) or 1.0  # rad/s
    K = K if part.loss is None else K + 1j * part.loss
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-K / unit**2, -part.C / unit]])
    roots = unit * scipy.linalg.eigvals(A, scipy.linalg.block_diag(np.eye(n), part.M))
    roots = roots[np.isfinite(roots) & ((roots.imag > 0) | (part.loss is None))]
    size = np.abs(roots)
    grow = (roots.real > NEUTRAL * size) & (size > 1e-6 * size.max(initial=0.0))
    return complex(max(roots[grow], key=lambda s: s.real)) if grow.any() else None


def fed(assembly: Assembly) -> list[str]:
    """`growing`, and what static friction above the sliding one does between two samples."""
    names, sentences = [c.name for c in assembly.contacts if saws(c.patch.law)], growing(assembly)
    if names:
        sentences.append(
            f"Static friction above the sliding one ({', '.join(names)}): a point without mass sticks again as soon as "
            "it has slipped, so sliding friction saws between both values and the answer hangs on samples; write law "
            '= "rate", or friction that falls with the speed.'
        )
    return sentences


def verdict(problem: Problem, x: Array, Omega: float, at: str) -> list[str]:
    """Whether a periodic motion is stable, in a sentence, where the linear part feeds motions; its multipliers are
    computed for that.

    Args:
        x: (size,) unknowns of the solution. Omega: rad/s. at: which motion it is, "the motion at 3 Hz".
    """
    if not growing(problem.assembly):
        return []
    if not problem.groups:
        return ["Every motion is unstable: nothing holds what grows, and no motion comes to any of them."]
    try:
        one = stability(orbit(problem, x, Omega), Settings(steps=128))
    except UserError as error:
        return [f"Whether {at} is stable is not known: {error}."]
    if one.stable:
        return [f"{at} is stable: its contacts take what is fed; multipliers grow by {one.growth:.4g} a period."]
    return [
        f"{at} is unstable: a disturbance grows by {one.growth:.4g} a period and no motion comes to it; integrate in "
        "time to see what does."
    ]
