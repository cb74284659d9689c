"""All roots of a window, what each of them is, and the proof that none is missing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Array
from ..linalg import quadratic, winding
from ..linalg.quadratic import Quadratic, Roots, Window
from ..linalg.winding import Count
from ..progress import Report
from .drawing import Shown, new_axes, plane

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DEVIATIONS = 3.0
"""Standard deviations of a growth rate, by the accuracy of the matrices, within which its sign is not decided."""

BLOCKS = (2, 4, 8)
"""Vectors of a block, the next where the count misses roots: multiplicities that a search can see."""


@dataclass(frozen=True, repr=False)
class Spectrum(Shown):
    """The roots s of a window, in the order of their frequencies.

    Attributes:
        roots: with vectors and errors. window: that was searched. tolerance: (r,) 1/s, growth rates below it in size
            are neutral. count: what the argument principle found; None: not asked for. whole: whether all roots of the
            matrices were computed at once, so that none can be missing.
    """

    roots: Roots
    window: Window
    tolerance: Array
    count: Count | None
    whole: bool

    @property
    def frequency(self) -> Array:
        """(r,) Hz."""
        return self.roots.s.imag / (2 * np.pi)

    @property
    def growth(self) -> Array:
        """(r,) 1/s: the amplitude grows as exp(growth t)."""
        return self.roots.s.real

    @property
    def damping_ratio(self) -> Array:
        """(r,) -growth / |s|."""
        return -self.roots.s.real / np.maximum(np.abs(self.roots.s), 1e-300)

    @property
    def verdict(self) -> tuple[str, ...]:
        """``unstable``, ``stable`` or ``neutral`` (the sign of the growth rate is not decided) for each root."""
        return tuple(
            "neutral" if abs(g) <= t else "unstable" if g > 0 else "stable"
            for g, t in zip(self.growth, self.tolerance, strict=True)
        )

    @property
    def complete(self) -> bool:
        """Whether it is proved that no root of the window is missing."""
        return self.whole or self.count is not None and self.count.missed == 0

    @property
    def sentence(self) -> str:
        """The answer in one sentence."""
        verdict, n = np.array(self.verdict), len(self.roots)
        grow = np.flatnonzero(verdict == "unstable")
        each = ", ".join(f"{self._place(i)} by {self.growth[i]:.4g} 1/s" for i in grow[:6])
        more = f" and {len(grow) - 6} more" if len(grow) > 6 else ""
        roots = f"{n} roots" if self.complete else f"the {n} roots that were found"
        said = f"{len(grow) or 'none'} of {roots} grow{'s' * (len(grow) < 2)}{': ' * bool(each)}{each}{more}"
        neutral = int((verdict == "neutral").sum())
        return f"{said}; {neutral} neutral; {self.proof}"

    def _place(self, i: int) -> str:
        return f"{self.frequency[i]:.6g} Hz" if self.roots.s[i].imag else "divergence"

    @property
    def proof(self) -> str:
        """What is known of roots that might be missing."""
        if self.whole:
            return "complete: all roots of the matrices were computed"
        if self.count is None:
            return "not proved complete"
        total = len(self.roots) + self.count.missed
        if self.count.missed:
            return f"INCOMPLETE: the argument principle counts {total}"
        return f"complete: counted {total} by the argument principle"

    def to_xarray(self) -> Any:
        """An `xarray.Dataset` over the number of the root, vectors over coordinates included."""
        import xarray

        told = {name: (("root",), values) for name, values in self.columns.items()}
        vectors = {"shape": (("coordinate", "root"), self.roots.x), "left": (("coordinate", "root"), self.roots.y)}
        return xarray.Dataset({**told, **vectors}, coords={"root": np.arange(1, len(self.roots) + 1)})

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the roots in the complex plane: growth rate to the right, frequency upwards."""
        axes = axes or new_axes()
        plane(axes, self)
        return axes

    @property
    def columns(self) -> dict[str, Any]:
        """Column -> (r,) values."""
        r = self.roots
        return {
            "frequency_Hz": self.frequency, "growth_1_s": self.growth, "angular_frequency_rad_s": r.s.imag,
            "damping_ratio": self.damping_ratio, "verdict": list(self.verdict), "neutral_below_1_s": self.tolerance,
            "residual": r.residual, "backward_error": r.backward_error, "rounding_1_s": r.rounding,
        }  # fmt: skip


def spectrum(
    Q: Quadratic, window: Window, *, accuracy: float = 1e-8, neutral: float = 0.0, certify: bool = True,
    report: Report = lambda _: None,
) -> Spectrum:  # fmt: skip
    """All roots of a window.

    A root is neutral where its growth rate is smaller than `neutral`, than three standard deviations of what random
    relative changes of all entries by `accuracy` do to it, or than what rounding does.

    Args:
        accuracy: relative, of the entries. neutral: 1/s. certify: count the roots by the argument principle.

    Raises:
        NotConverged: the matrices are singular throughout.
    """
    if Q.n <= quadratic.DENSE:
        every = quadratic.every_root(Q)
        near = every.only(window.holds(every.s))
        return _judged(quadratic.refined(Q, near.s, near.x), window, None, True, accuracy, neutral)
    count = None
    for block in BLOCKS:
        report(f"search of {Q.n} coordinates")
        found = quadratic.search(Q, window, block)
        inside = window.holds(found.s)
        report(f"{int(inside.sum())} roots, {found.shifts} shifts, {found.solves} solutions; refining them")
        roots = quadratic.refined(Q, found.s[inside], found.x[:, inside])
        if not certify:
            break
        report("counting by the argument principle")
        count = winding.missed(Q, window, np.concatenate([roots.s, found.s[~inside]]))
        if not count.missed:
            break
        report(f"{count.missed} are missing")
    return _judged(roots, window, count, False, accuracy, neutral)


def _judged(
    roots: Roots, window: Window, count: Count | None, whole: bool, accuracy: float, neutral: float
) -> Spectrum:  # fmt: skip
    inside = window.holds(roots.s)
    if not inside.all():
        roots = roots.only(inside)
    tolerance = np.maximum(np.maximum(DEVIATIONS * accuracy * roots.spread, roots.rounding), neutral)
    return Spectrum(roots, window, tolerance, count, whole)
