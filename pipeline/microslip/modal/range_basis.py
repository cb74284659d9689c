"""One set of coordinates for a whole range of rotation speeds, and the proof that it serves.

The shapes found at a few solved speeds span common coordinates V; the exact operators about the equilibria of all
samples are projected on V, K_r = V^H K V, and interpolated entry by entry (Lagrange, barycentric weights: Berrut and
Trefethen, SIAM Review 46 (2004) 501). No mode is matched with another or differentiated, so veerings and crossings
do not matter. Two forms are tried and the better one is kept:

- ``stiffness``: K_r as a polynomial in Omega^2. Exact without prestress (affine) and with linear prestress
  (quadratic). About a nonlinear equilibrium the shapes turn with the body; in fixed coordinates the small energy of
  a bending mode is then left of large entries that cancel, and the interpolation is poor.
- ``root``: K_r^(1/2), whose eigenvalues are the frequencies and whose entries cancel far less, as a polynomial in
  sqrt(Omega^2 + a): by Southwell's law omega^2 = B (Omega^2 + a) the first frequency is a straight line in it.

Where the derivative dK/dOmega^2 of the whole operator is given as well, the polynomials are Hermite's: they agree with
it at the samples, and a sample counts twice.

Two errors are told apart at held-out speeds, where the true equilibrium and the true K are at hand:
interpolation (frequencies from the interpolated against those from the projected K) and projection (from the
projected K against those of the speed itself, for which V is widened by the residuals of all modes, solved for with one
factorisation). This also counts the eigenvalues below the band, so that a mode which the samples do not know is
noticed. The modes so found widen V where the speed becomes a sample.

Nothing here knows finite elements: the body comes as two functions. All arrays may be complex (Hermitian K).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..data import Array, SpeedRange
from ..errors import NotConverged
from ..linalg import eigen
from ..progress import Report
from ..units import rpm_text

SPAN = 1e-12
"""Directions of the union of shapes whose squared M-norm is a smaller share than this are rounding."""

SPARE = 4
"""Modes known beyond those wanted: one that comes down into the band between two samples is then known."""

ROUNDS = 6
"""Corrections at a speed at most; one does where V is good."""

MOST = 12
"""Samples at most: a range that needs more is better cut in two."""

CLEAR = 0.02
"""Eigenvalues that differ by this share are told apart by a count between them."""

FAR = 10.0
"""Where the error is so many times the tolerance, more than one sample is added at a time."""

FORMS = ("stiffness", "root")

Guess = Mapping[float, tuple[float, float]]
"""Speed -> weights of the displacements there and of their slopes over Omega^2."""


@dataclass(frozen=True)
class Settled:
    """The body in equilibrium at one speed, rad/s: its operators there, and whatever the caller keeps of the state.

    slope: makes products with dK/dOmega^2 along the equilibria, when they are wanted (its argument: whether the solver
    still is as the equilibrium left it); None where they are not.
    """

    speed: float
    pencil: eigen.Pencil
    state: Any
    slope: Callable[[bool], eigen.MatVec] | None = None


@dataclass(frozen=True)
class Solved:
    """Shapes (n, k) of one speed that belong into the common coordinates, its lowest eigenvalue, (rad/s)^2, and what
    the caller keeps of the solution."""

    shapes: Array
    lowest: float
    solution: Any


@dataclass(frozen=True)
class HeldOut:
    """Largest relative frequency errors at a speed (rad/s) that is no sample; infinite if a mode is missing."""

    speed: float
    interpolation: float
    projection: float
    total: float


@dataclass(frozen=True)
class Common:
    """Common coordinates of a range.

    Attributes:
        V: (n, c) M-orthonormal shapes. samples: the settled body at rising speeds, held-out ones among them.
        K_r: (s, c, c) at the samples. slopes: (s - h, c, c) dK_r/dOmega^2 at those not held out, or none, (0, c, c).
        solved: speed -> its solution. refined: speeds whose modes were refined from those, and are in V as well.
        held_out: the errors found. orthogonality: largest entry of |V^H M V - 1|.
        form: ``stiffness`` or ``root``. shift: a of the variable sqrt(Omega^2 + a), (rad/s)^2; None for Omega^2.
    """

    V: Array
    samples: list[Settled]
    K_r: Array
    slopes: Array
    solved: dict[float, Solved]
    refined: set[float]
    held_out: list[HeldOut]
    orthogonality: float
    form: str
    shift: float | None

    def interpolant(self) -> Interpolant:
        """The stiffness at any speed, from the samples that are not held out."""
        held = {h.speed for h in self.held_out}
        used = [i for i, s in enumerate(self.samples) if s.speed not in held]
        speeds = np.array([self.samples[i].speed for i in used])
        return Interpolant(speeds, self.K_r[used], self.slopes, self.form, self.shift)


# interpolation -----------------------------------------------------------------------------------------------------


def variable(speeds: Array | float, shift: float | None) -> Array:
    """What f is a polynomial of: Omega^2, or sqrt(Omega^2 + shift)."""
    x = np.asarray(speeds, dtype=float) ** 2
    return x if shift is None else np.sqrt(x + shift)


def lagrange(samples: Array, speed: float, shift: float | None = None) -> Array:
    """(s,) weights of the samples at a speed: f(speed) = sum of weight times f(sample)."""
    t, at = variable(samples, shift), float(variable(speed, shift))
    if len(t) == 1:
        return np.ones(1)
    gap = (at - t) / t[-1]
    if (hit := np.abs(gap) < 1e-14).any():
        return np.where(np.arange(len(t)) == int(hit.argmax()), 1.0, 0.0)
    weights = 1 / (((t[:, None] - t) / t[-1] + np.eye(len(t))).prod(axis=1) * gap)
    return weights / weights.sum()


def hermite(samples: Array, speed: float, shift: float | None) -> tuple[Array, Array]:
    """(s,) weights of the values f and (s,) weights of the slopes df/dOmega^2 at the samples."""
    t, at = variable(samples, shift), float(variable(speed, shift))
    square = lagrange(samples, speed, shift) ** 2
    own = _log_slopes(t)
    along = np.ones_like(t) if shift is None else 2 * t  # dOmega^2 / dt
    return (1 - 2 * own * (at - t)) * square, along * (at - t) * square


def _log_slopes(t: Array) -> Array:
    """(s,) derivative of each Lagrange polynomial at its own point."""
    away = t[:, None] - t + np.diag(np.full(len(t), np.inf))
    return (1 / away).sum(axis=1)


class Interpolant:
    """K_r at any speed from those of samples, and from the slopes dK_r/dOmega^2 where they are known.

    Args:
        samples: (s,) rad/s, rising. K: (s, c, c). slopes: (s, c, c), or (0, c, c). form, shift: see `Common`.
    """

    def __init__(self, samples: Array, K: Array, slopes: Array, form: str, shift: float | None) -> None:
        self.samples, self.form, self.shift = samples, form, shift
        self.values, self.slopes = K, slopes
        if form == "root":
            parts = [np.linalg.eigh(k) for k in K]
            roots = [np.sqrt(np.maximum(w, 0.0)) for w, _ in parts]
            self.values = np.array([(Q * r) @ Q.conj().T for (_, Q), r in zip(parts, roots, strict=True)])
            self.slopes = np.array(
                [_root_slope(Q, r, dK) for (_, Q), r, dK in zip(parts, roots, slopes, strict=False)]
            ).reshape(slopes.shape)

    def part(self, speed: float) -> Array:
        """(c, c) of what is interpolated: the stiffness or its root."""
        if not len(self.slopes):
            return np.tensordot(lagrange(self.samples, speed, self.shift), self.values, 1)
        of_values, of_slopes = hermite(self.samples, speed, self.shift)
        return np.tensordot(of_values, self.values, 1) + np.tensordot(of_slopes, self.slopes, 1)

    def stiffness(self, speed: float) -> Array:
        """(c, c) Hermitian."""
        part = self.part(speed)
        return part if self.form == "stiffness" else part @ part.conj().T

    def modes(self, speed: float) -> tuple[Array, Array]:
        """(c,) frequencies, rad/s, ascending, and (c, c) orthonormal modes."""
        return self.modes_of(self.part(speed))

    def modes_of(self, part: Array) -> tuple[Array, Array]:
        values, Y = np.linalg.eigh(part)
        if self.form == "stiffness":
            return np.sqrt(np.maximum(values, 0.0)), Y
        order = np.argsort(np.abs(values), kind="stable")
        return np.abs(values[order]), Y[:, order]

    def last(self) -> tuple[Array, int]:
        """(c, c) leading coefficient times the range of the variable to its power; how often each sample counts."""
        t = variable(self.samples, self.shift)
        reach = t[-1] - t[0]
        once = 1 / ((t[:, None] - t) / reach + np.eye(len(t))).prod(axis=1)
        if not len(self.slopes):
            return np.tensordot(once, self.values, 1), 1
        along = np.ones_like(t) if self.shift is None else 2 * t
        of_values, of_slopes = -2 * _log_slopes(t) * reach * once**2, along * reach * once**2
        return np.tensordot(of_values, self.values, 1) + np.tensordot(of_slopes, self.slopes, 1), 2


def interpolant(r: SpeedRange) -> Interpolant:
    """The stiffness of a range of a modal file at any of its speeds."""
    K = np.array([g.K_r for g, held in zip(r.samples, r.held, strict=True) if not held])
    return Interpolant(r.speeds[~r.held], K, r.slopes, r.form, r.shift)


def _root_slope(Q: Array, roots: Array, slope: Array) -> Array:
    """Derivative of K^(1/2) from that of K = Q roots^2 Q^H: S' S + S S' = K'."""
    inner = Q.conj().T @ slope @ Q
    return Q @ (inner / np.maximum(roots[:, None] + roots, 1e-300)) @ Q.conj().T


def probes(f: Interpolant, kept: Sequence[float], count: int) -> list[float]:
    """Two held-out speeds: those kept, and more where the frequencies are likely to err most.

    The error of a polynomial f through the samples t_i is about its last coefficient times the product of all t - t_i
    (squared where slopes are known); what that does to the first `count` frequencies is looked at on a grid.
    """
    t = variable(f.samples, f.shift)
    reach = t[-1] - t[0]
    last, times = f.last()
    at = t[0] + 0.5 * reach * (1 - np.cos(np.pi * np.arange(1, 80) / 80))
    grid = np.sqrt(at if f.shift is None else at**2 - f.shift)
    size = np.abs((at[:, None] - t) / reach).prod(axis=1) ** times
    effect = []
    for speed, share in zip(grid, size, strict=True):
        here = f.part(float(speed))
        omega, changed = (f.modes_of(A)[0][:count] for A in (here, here + share * last))
        effect.append(largest_difference(changed, omega) + 1e-9 * share / size.max())
    found = list(kept)
    while len(found) < 2:
        away = np.abs((at[:, None] - variable(np.array(found), f.shift)) / reach).prod(axis=1) if found else 1.0
        found.append(float(grid[(np.array(effect) * away).argmax()]))
    return sorted(found)


# common coordinates ------------------------------------------------------------------------------------------------


def orthonormal_union(shapes: Array, M: eigen.MatVec) -> tuple[Array, float]:
    """(n, c) M-orthonormal basis of the span of shapes, rounding left out, and its largest entry of |V^H M V - 1|."""
    gram = shapes.conj().T @ M(shapes)
    V = shapes / np.sqrt(np.diag(gram).real)
    for limit in (SPAN, 0.0, 0.0):  # the second pass cleans what the first leaves; the third confirms
        gram = V.conj().T @ M(V)
        gram = 0.5 * (gram + gram.conj().T)
        worst = float(np.abs(gram - np.eye(len(gram))).max())
        if worst < 1e-13:
            break
        w, Q = np.linalg.eigh(gram)
        keep = w > limit * w[-1]
        V = V @ (Q[:, keep] / np.sqrt(w[keep]))
    return V, worst


def beyond(V: Array, shapes: Array, M: eigen.MatVec, least: float = SPAN**0.5) -> Array:
    """(n, k) M-orthonormal basis of what shapes, of M-norm 1 at most, have outside V, where that exceeds `least`."""
    if V.shape[1]:
        MV = M(V)
        for _ in range(2):
            shapes = shapes - V @ (MV.conj().T @ shapes)
        size = norms(shapes, M)
        shapes = shapes[:, size > least] / size[size > least]
        shapes = shapes - V @ (MV.conj().T @ shapes)
    return orthonormal_union(shapes, M)[0] if shapes.shape[1] else shapes


def norms(shapes: Array, M: eigen.MatVec) -> Array:
    return np.sqrt(np.einsum("ij,ij->j", shapes.conj(), M(shapes)).real)


def projected(K: eigen.MatVec, V: Array) -> Array:
    K_r = V.conj().T @ K(V)
    return 0.5 * (K_r + K_r.conj().T)


def bordered(K_r: Array, K: eigen.MatVec, V: Array, W: Array) -> Array:
    """`projected` on [V, W] from K_r on V."""
    KW = K(W)
    side, corner = V.conj().T @ KW, W.conj().T @ KW
    return np.block([[K_r, side], [side.conj().T, 0.5 * (corner + corner.conj().T)]])


def frequencies(K_r: Array, count: int) -> Array:
    """(count,) rad/s of the lowest eigenvalues; negative ones count as zero."""
    return np.sqrt(np.maximum(np.linalg.eigvalsh(K_r)[:count], 0.0))


def largest_difference(omega: Array, reference: Array) -> float:
    """Frequencies are compared in ascending order: eigenvalues move continuously also where modes veer or cross."""
    return float(np.abs(omega / np.maximum(reference, 1e-300) - 1).max())


# held-out speeds ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Refined:
    """Frequencies (count,), rad/s, and M-orthonormal modes (n, k) of one speed, the count of them confirmed."""

    frequencies: Array
    shapes: Array


def refined(held: Settled, V: Array, K_r: Array, count: int, tolerance: float) -> Refined | None:
    """The modes of a speed with one factorisation, begun from V; None if V does not know one of them.

    r = (K - theta M) V y is what V leaves of a mode; (K - sigma M)^-1 r is its correction (Davidson's method with an
    exact inverse). V is widened by the corrections of all modes until the frequencies move by less than a tenth of the
    tolerance; what is left then is of second order in the last corrections.
    """
    pencil = held.pencil
    theta, Y = np.linalg.eigh(K_r)
    band, sigma = _end_of_band(theta, count)
    pencil.solver.factorise(pencil.shifted(sigma))
    below = pencil.solver.negative()
    for _ in range(ROUNDS):
        X, before = V @ Y[:, :band], theta[:count]
        W = beyond(V, pencil.solve(pencil.K(X) - pencil.M(X) * theta[:band]), pencil.M, least=1e-9)
        K_r, V = bordered(K_r, pencil.K, V, W), np.hstack([V, W])
        theta, Y = np.linalg.eigh(K_r)
        if largest_difference(_roots(theta[:count]), _roots(before)) < 0.1 * tolerance:
            break
    if below != (theta < sigma).sum():
        return None
    return Refined(_roots(theta[:count]), V @ Y[:, : count + SPARE])


def _roots(values: Array) -> Array:
    return np.sqrt(np.maximum(values, 0.0))


def _end_of_band(theta: Array, count: int) -> tuple[int, float]:
    """How many values, at least `count`, lie below a shift, and the shift: in the first clear gap, near its lower end.

    The values are upper bounds, the less exact the higher they are, so those above the gap may come down into it.
    """
    if len(theta) <= count:
        return len(theta), float(theta[-1]) * 1.01
    last = min(count + SPARE, len(theta) - 1)
    gaps = theta[count : last + 1] / np.maximum(theta[count - 1 : last], 1e-300) - 1
    clear = np.flatnonzero(gaps > CLEAR)
    band = count + int(clear[0] if len(clear) else gaps.argmax())
    return band, float(theta[band - 1]) * (1 + min(0.25 * float(gaps[band - count]), CLEAR))


@dataclass
class _Search:
    """State of `common_coordinates`: what is known so far."""

    settle: Callable[[float, Guess], Settled]
    solve: Callable[[Settled], Solved]
    count: int
    tolerance: float
    thrice: bool
    samples: dict[float, Settled] = field(default_factory=dict)
    solved: dict[float, Solved] = field(default_factory=dict)
    held: dict[float, Settled] = field(default_factory=dict)
    form: str = "root"
    shift: float | None = None
    V: Array = field(default_factory=lambda: np.zeros((0, 0)))
    K_r: dict[float, Array] = field(default_factory=dict)
    slopes: dict[float, Array] = field(default_factory=dict)
    slope_of: dict[float, eigen.MatVec] = field(default_factory=dict)
    true: dict[float, Refined | None] = field(default_factory=dict)
    refined: set[float] = field(default_factory=set)

    def settled(self, speed: float) -> Settled:
        """Equilibrium at a speed, begun from those known: from the samples with their slopes where they have some."""
        known = sorted(self.slope_of or {*self.samples, *self.held})
        if self.slope_of:
            weights = hermite(np.array(known), speed, self.shift)
            return self.settle(speed, dict(zip(known, zip(*weights, strict=True), strict=True)))
        start = lagrange(np.array(known), speed, self.shift) if len(known) > 1 else np.zeros(0)
        return self.settle(speed, {s: (w, 0.0) for s, w in zip(known, start, strict=False)})

    def add(self, settled: Settled, modes: bool) -> None:
        """Make a speed a sample, with its modes if they are to widen the coordinates."""
        speed = settled.speed
        self.samples[speed] = settled
        before = self.held.pop(speed, None)
        if settled.slope is not None:
            self.slope_of[speed] = settled.slope(before is None)
        if not modes:
            return
        if self.thrice or len(self.solved) < 2 or self._found(settled) is None:
            self.solved[speed] = self.solve(settled)
        else:
            self.refined.add(speed)
        self._widen(self._shapes(speed), settled.pencil.M)

    def _widen(self, shapes: Array, M: eigen.MatVec) -> None:
        """V and all that is projected on it, widened by shapes."""
        shapes = shapes / norms(shapes, M)
        if not self.V.size:
            self.V = orthonormal_union(shapes, M)[0]
            return
        W = beyond(self.V, shapes, M)
        settled = {**self.samples, **self.held}
        self.K_r = {s: bordered(A, settled[s].pencil.K, self.V, W) for s, A in self.K_r.items()}
        self.slopes = {s: bordered(A, self.slope_of[s], self.V, W) for s, A in self.slopes.items()}
        self.V = np.hstack([self.V, W])

    def _found(self, settled: Settled) -> Refined | None:
        """The modes of a speed found from the coordinates as they are, or as they were when it was first asked for."""
        if self.true.get(settled.speed) is None:
            self.project()
            K_r = self.K_r[settled.speed]
            self.true[settled.speed] = refined(settled, self.V, K_r, self.count, self.tolerance)
        return self.true[settled.speed]

    def begin(self, low: float, high: float) -> None:
        """Both ends, and between them the middle of the variable that they suggest."""
        self.add(self.settled(low), modes=True)
        self.project()
        if low in self.slopes:
            lowest = np.linalg.eigh(self.K_r[low])[1][:, 0]
            self._vary(low, float((lowest.conj() @ self.slopes[low] @ lowest).real))  # a first guess
        self.add(self.settled(high), modes=True)
        self._vary(low, (self.solved[high].lowest - self.solved[low].lowest) / (high**2 - low**2))
        middle = 0.5 * float(variable(low, self.shift) + variable(high, self.shift))
        square = middle if self.shift is None else middle**2 - self.shift
        self.add(self.settled(float(np.sqrt(square))), modes=True)

    def _vary(self, low: float, rise: float) -> None:
        """The variable in which the lowest frequency, whose square rises by so much over Omega^2, is straight."""
        self.shift = self.solved[low].lowest / rise - low**2 if rise > 0 else None

    def begin_like(self, other: Common) -> None:
        self.form, self.shift = other.form, other.shift
        held = {h.speed for h in other.held_out}
        settled = {s.speed: self.settled(s.speed) for s in other.samples}
        for speed in sorted(settled, key=lambda s: s not in other.solved):  # those solved for first
            if speed in held:
                self.held[speed] = settled[speed]
            else:
                self.add(settled[speed], speed in other.solved or speed in other.refined)

    def interpolant(self, form: str) -> Interpolant:
        speeds = sorted(self.samples)
        K = np.array([self.K_r[s] for s in speeds])
        slopes = np.array([self.slopes[s] for s in speeds if s in self.slopes]).reshape(-1, *K.shape[1:])
        return Interpolant(np.array(speeds), K, slopes, form, self.shift if form == "root" else None)

    def hold_out(self) -> None:
        for speed in probes(self.interpolant(self.form), list(self.held), self.count):
            if speed not in self.held:
                self.held[speed] = self.settled(speed)

    def project(self) -> None:
        """The projected K and its slope at every speed, as far as they are not known."""
        for speed, settled in {**self.samples, **self.held}.items():
            if speed not in self.K_r:
                self.K_r[speed] = projected(settled.pencil.K, self.V)
        for speed, slope in self.slope_of.items():
            if speed not in self.slopes:
                self.slopes[speed] = projected(slope, self.V)

    def _shapes(self, speed: float) -> Array:
        found = self.solved.get(speed) or self.true[speed]
        assert found is not None
        return found.shapes

    def examine(self) -> list[HeldOut]:
        """Errors of the better form at every held-out speed.

        The modes of a speed that is far off by interpolation alone, and will be a sample, are not looked for.
        """
        self.project()
        off = {form: [self._interpolation(self.interpolant(form), s) for s in sorted(self.held)] for form in FORMS}
        self.form = min(FORMS, key=lambda form: max(off[form]))
        f, worst = self.interpolant(self.form), max(off[self.form])
        pairs = zip(sorted(self.held), off[self.form], strict=True)
        return [self._error(f, s, e, e == worst or e <= FAR * self.tolerance) for s, e in pairs]

    def _interpolation(self, f: Interpolant, speed: float) -> float:
        return largest_difference(f.modes(speed)[0][: self.count], frequencies(self.K_r[speed], self.count))

    def _error(self, f: Interpolant, speed: float, interpolation: float, known: bool) -> HeldOut:
        if not known:
            return HeldOut(speed, interpolation, 0.0, interpolation)
        true = self._found(self.held[speed])
        if true is None:
            return HeldOut(speed, interpolation, np.inf, np.inf)
        here, guess = frequencies(self.K_r[speed], self.count), f.modes(speed)[0][: self.count]
        projection, total = (largest_difference(omega, true.frequencies) for omega in (here, guess))
        return HeldOut(speed, interpolation, projection, total)

    def widen(self, found: list[HeldOut], report: Report) -> None:
        """Held-out speeds that fail become samples; the one with the largest projection error brings its modes."""
        unknown = max(found, key=lambda h: h.projection)
        worst = max(found, key=lambda h: h.interpolation)
        for h in found:
            modes = h is unknown and h.projection > 0.5 * self.tolerance
            far = h.interpolation > FAR * self.tolerance
            if modes or far or (h is worst and h.interpolation > 0.5 * self.tolerance):
                report(f"one sample more: {rpm_text(h.speed)}" + (", with its modes" if modes else ""))
                self.add(self.held[h.speed], modes)
        if len(self.held) == len(found):  # both within half of the tolerance, their sum is not
            self.add(self.held[unknown.speed], True)


def common_coordinates(
    settle: Callable[[float, Guess], Settled], solve: Callable[[Settled], Solved], low: float, high: float, count: int,
    tolerance: float, report: Report = lambda _: None, before: Common | None = None, thrice: bool = True,
) -> Common:  # fmt: skip
    """Common coordinates for all speeds between `low` and `high`, rad/s.

    Both ends are solved for, one speed between is refined from them, and these are samples. Where a held-out speed
    fails by interpolation it becomes a sample (its equilibrium is known already), where it fails by projection its
    modes are added too, and others are held out in its place.

    Args:
        settle: (speed, weights) -> equilibrium; the weighted displacements and slopes of the speeds settled before are
            a first guess (none: from rest). solve: equilibrium -> its shapes. count: modes whose frequencies must be
            right. tolerance: relative error of a frequency allowed at held-out speeds. before: of another nodal
            diameter, whose samples are taken over. thrice: every speed whose modes are added is solved for, the
            one between too, as static answers need that are to be exact at all speeds; for frequencies the modes
            refined there do.

    Raises:
        NotConverged: `MOST` samples do not suffice.
    """
    search = _Search(settle, solve, count, tolerance, thrice)
    if before is None:
        search.begin(low, high)
    else:
        search.begin_like(before)
    while True:
        search.project()
        search.hold_out()
        found = search.examine()
        for h in found:
            report(
                f"held out {rpm_text(h.speed)}: interpolation ({search.form}) {h.interpolation:.1e}, "
                f"projection {h.projection:.1e}"
            )
        if max(h.total for h in found) <= tolerance:
            return _result(search, found)
        if len(search.samples) >= MOST:
            raise NotConverged(
                f"{len(search.samples)} samples between {rpm_text(low)} and {rpm_text(high)} leave a frequency error "
                f"of {max(h.total for h in found):.1e}; cut the range in two or raise the tolerance {tolerance:g}"
            )
        search.widen(found, report)


def _result(search: _Search, found: list[HeldOut]) -> Common:
    """In the modes at the lowest speed."""
    every = {**search.samples, **search.held}
    samples = [every[s] for s in sorted(every)]
    Y = np.linalg.eigh(search.K_r[samples[0].speed])[1]
    V = search.V @ Y
    worst = float(np.abs(V.conj().T @ samples[0].pencil.M(V) - np.eye(V.shape[1])).max())
    f = search.interpolant(search.form)
    K_r = np.array([Y.conj().T @ search.K_r[s.speed] @ Y for s in samples])
    slopes = [Y.conj().T @ search.slopes[s] @ Y for s in f.samples if s in search.slopes]
    return Common(
        V, samples, K_r, np.array(slopes).reshape(-1, *K_r.shape[1:]), search.solved, search.refined, found, worst,
        search.form, f.shift,
    )  # fmt: skip
