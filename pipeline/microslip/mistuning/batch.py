"""Many mistuned rings at a time, as one compiled program: what ensembles of rings and rows are solved by.

Unknown are the relative motions d of the contacts, gap by gap. With the receptance C of every blade by itself, as a sum
over its poles, the motion r under the loads and the contact forces F less the preload p

    R = d - r + C (F(d) - p),    (1 + C S) dd = -R

C joins a gap to itself and to the two beside it. S, the derivative of the forces, is found exactly where steps do not
serve, and follows from step to step and from frequency to frequency else, contact by contact (Broyden). A lane of the
batch is a ring at one of its frequencies; whatever ends there makes room at once, so that no ring waits for another.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from itertools import product
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from .. import series
from ..contact.law import point_axes
from ..contact.periodic import near, unknown, with_slopes
from ..data import Array, ComplexArray, Indices
from ..harmonic_balance.forces import AFT
from ..harmonic_balance.problem import Problem
from ..harmonic_balance.solver import Point, carried
from ..interrupts import look
from ..programs import often
from ..system.assembly import Assembly
from .peaks import Highest, Wanted, search
from .samples import Asked, Sample, Solutions, ended, on_sweep, sample, worst

# the compiled program --------------------------------------------------------------------------


Values = Any
"""An array of numpy or of jax."""


class Frame(NamedTuple):
    """How the contacts of a ring stand to its blades: the same of all rings of an ensemble.

    Of N gaps with q motions each, K blades with r motions each that contacts feel, harmonics 0 to H.

    Attributes:
        pairs, factors: (3, N, q, q, 2) places among the blades' (K r r) receptances, and (..., H + 1) signs and phases,
            of what moves a gap by its own forces, those of the next gap and those of the one before. driven, signs:
            (N, q, 2) places among the blades' (K r) motions, and (..., H + 1). felt, given: (K, r) places among the
            gaps' (N q) forces, and (K, r, H + 1) what the blade has of them.
        cells: of every group of equal contacts (c,) its places in the gaps; order: (M,) the other way. kinematics: of
            each (n, 3, k).
        unit: (k,) m or rad of a motion.
    """

    pairs: Values
    factors: Values
    driven: Values
    signs: Values
    felt: Values
    given: Values
    cells: tuple[Values, ...]
    order: Values
    kinematics: tuple[Values, ...]
    unit: Values


class Rings(NamedTuple):
    """What is known of rings (l, ...) at any frequency.

    Attributes:
        poles: (l, K, p). left: (l, K, r + 1, p), right: (l, K, p, H + r) both sides of 1/(s - pole), of the loads of
            every harmonic in front, and the read-out in the last row. static: (l, K, r + 1, H + r) beside the poles.
            mean: (l, K, r + 1, 1 + r) all of it in harmonic 0. laws: of every group. offset, preload: (l, N, q).
    """

    poles: Values
    left: Values
    right: Values
    static: Values
    mean: Values
    laws: tuple[Any, ...]
    offset: Values
    preload: Values


class Lanes(NamedTuple):
    """Where rings are.

    Attributes:
        Omega: (l,) rad/s. d: (l, N, q, W) m. slope: (l, M, k, W, k, W) S of all M contacts. before, force: (l, N, q, W)
            the motion before and the forces there; told: (l,) whether they are known. sliders: see `periodic.Known`,
            of every group.
    """

    Omega: Values
    d: Values
    slope: Values
    before: Values
    force: Values
    told: Values
    sliders: tuple[Any, ...]


class Marching(NamedTuple):
    """How finely rings are balanced.

    Attributes: samples: of a cycle. cycles: at most. periodicity. highest: H. harmonics: those that move, 0 the mean;
        of forces that are as large either way only the odd ones.
    """

    samples: int
    cycles: int
    periodicity: float
    highest: int
    harmonics: tuple[int, ...]

    @property
    def waves(self) -> tuple[int, ...]:
        """Without the mean."""
        return tuple(h for h in self.harmonics if h)

    @property
    def columns(self) -> Indices:
        """(W,) places of their coefficients among those of all harmonics."""
        return np.concatenate([[0] if h == 0 else [2 * h - 1, 2 * h] for h in self.harmonics])

    def series(self) -> tuple[Values, Values]:
        """(s, W) of them at the samples of a cycle, and (W, s) their coefficients from samples."""
        values, transform = series.fourier(self.highest, self.samples)
        return values[:, self.columns], transform[self.columns]


@partial(often, static_argnames=("marching",))
def stepped(
    frame: Frame, rings: Rings, at: Lanes, marching: Marching
) -> tuple[Lanes, jax.Array, jax.Array, jax.Array]:  # fmt: skip
    """One step of Newton's method in every lane, (l,) its length over that of the motion, (l, K) read-outs and
    (l, N, q, W) forces after it."""
    (l, N, q, W), k = at.d.shape, len(frame.unit)
    force, sliders = _forces(frame, rings, at, marching)
    slope = _secant(frame, at, force)
    C, reference, read = _seen(frame, rings, at.Omega, marching)
    excess = _excess(force, rings.preload, marching)
    around = jnp.stack([jnp.roll(excess, -away, axis=1) for away in (0, 1, -1)], axis=1)
    R = at.d - _coefficients(reference - (C * around[:, :, :, None]).sum(axis=(1, 4)), W % 2)
    B = _of_coefficients(C.astype(jnp.complex64), W % 2)
    S = _of_gaps(slope.astype(jnp.float32), N)
    A = [B[:, i] @ jnp.roll(S, -away, axis=1) for i, away in enumerate((0, 1, -1))]
    A[0] += jnp.eye(q * W, dtype=A[0].dtype)
    unit = jnp.tile(jnp.repeat(frame.unit, W), q // k).astype(A[0].dtype)  # single numbers reach from 1e-38
    A = [block * (unit / unit[:, None]) for block in A]
    right = -R.reshape(l, N, q * W) / unit
    size = jnp.abs(right).max(axis=(1, 2), keepdims=True) + 1e-300
    step = _around(A[0], A[1], A[2], (right / size).astype(A[0].dtype)).astype(float) * size
    length = jnp.abs(step).max(axis=(1, 2)) / jnp.abs(at.d.reshape(l, N, q * W) / unit).max(axis=(1, 2))
    step = (step * unit).reshape(at.d.shape)
    cells = step.reshape(l, -1, k, W)
    after = force + jnp.einsum("lmawbx,lmbx->lmaw", slope, cells).reshape(force.shape)
    one = marching.harmonics.index(1)
    first = _amplitudes(after)[..., one].reshape(l, -1)
    y = read[..., 0] - ((first[:, frame.felt] * frame.given[..., one]) * read[..., 1:]).sum(axis=-1)
    moved = Lanes(at.Omega, at.d + step, slope, at.d, force, jnp.ones_like(at.told), sliders)
    return moved, length, jnp.abs(y), after


@partial(often, static_argnames=("marching",))
def derived(
    frame: Frame, rings: Rings, d: jax.Array, slope: jax.Array, lanes: jax.Array, marching: Marching
) -> jax.Array:  # fmt: skip
    """Slopes, those of some lanes found exactly at d."""
    W = d.shape[-1]
    some = rings._replace(laws=jax.tree_util.tree_map(lambda x: x[lanes], rings.laws), offset=rings.offset[lanes])
    found = []
    values, transform = marching.series()
    for group, (G, law) in enumerate(zip(frame.kinematics, some.laws, strict=True)):
        path, both = _path(frame, some.offset, d[lanes], group, values)
        still = jnp.zeros_like(path), 1.0, marching.cycles, marching.periodicity  # no law here asks how fast
        one = with_slopes(_of_points(law), path, *still, values, np.zeros_like(values), transform)[1]
        one = one.reshape(W, W, 3, *both, len(G), 3)  # of force w by motion x along j, along i
        found.append(jnp.einsum("nia,wxjlcni,njb->lcawbx", G, one, G))
    return slope.at[lanes].set(_in_cells(frame, found))


@often
def turned(
    slope: jax.Array, top: jax.Array, first: jax.Array, keep: jax.Array, back: jax.Array, begin: jax.Array
) -> tuple[jax.Array, jax.Array]:  # fmt: skip
    """Slopes of lanes and those at their tops, where some are the highest so far, go back there, or begin anew."""
    keep, back, begin = (mask.reshape(-1, *[1] * (slope.ndim - 1)) for mask in (keep, back, begin))
    top = jnp.where(keep, slope, top)
    return jnp.where(begin, first, jnp.where(back, top, slope)), top


def _of_points(law: Any) -> Any:
    """Leaves (..., l c n) of (l, ..., c n)."""
    return jax.tree_util.tree_map(lambda x: jnp.moveaxis(x, 0, -2).reshape(*x.shape[1:-1], -1), law)


def _path(
    frame: Frame, offset: Values, d: Values, group: int, values: Values
) -> tuple[jax.Array, tuple[int, ...]]:  # fmt: skip
    """(s, l c n, 3) of all points of a group, and (l, c)."""
    k, cells = len(frame.unit), frame.cells[group]
    u = d.reshape(len(d), -1, k, d.shape[-1])[:, cells]
    path = jnp.einsum("sw,lcaw->slca", values, u) + offset.reshape(len(d), -1, k)[:, cells]
    return jnp.einsum("nia,slca->slcni", frame.kinematics[group], path).reshape(len(values), -1, 3), u.shape[:2]


def _in_cells(frame: Frame, found: Sequence[jax.Array]) -> jax.Array:
    """(l, M, ...) from (l, c, ...) of every group."""
    return jnp.concatenate(found, axis=1)[:, frame.order]


def _forces(frame: Frame, rings: Rings, at: Lanes, marching: Marching) -> tuple[jax.Array, tuple[Any, ...]]:
    """(l, N, q, W) forces, and what sliders remember."""
    (values, transform), found, kept = marching.series(), [], []
    for group, (G, law, known) in enumerate(zip(frame.kinematics, rings.laws, at.sliders, strict=True)):
        path, both = _path(frame, rings.offset, at.d, group, values)
        still = jnp.zeros_like(path), 1.0, marching.cycles, marching.periodicity
        force, known = near(_of_points(law), path, *still, transform, known)
        found.append(jnp.einsum("nia,wilcn->lcaw", G, force.reshape(len(force), 3, *both, len(G))))
        kept.append(known)
    return _in_cells(frame, found).reshape(at.d.shape), tuple(kept)


def _secant(frame: Frame, at: Lanes, force: jax.Array) -> Values:
    """S that tells the change of every contact's force over the last step, see `AtFrequency.secant`."""
    l, M, k, W, *_ = at.slope.shape
    change, way = ((now - old).reshape(l, M, k, W) for now, old in ((force, at.force), (at.d, at.before)))
    scaled = way / frame.unit[:, None]
    size = (scaled**2).sum(axis=(2, 3), keepdims=True) * at.told[:, None, None, None]
    along = jnp.where(size > 0, scaled / jnp.where(size > 0, size, 1.0), 0.0) / frame.unit[:, None]
    missed = change - jnp.einsum("lmawbx,lmbx->lmaw", at.slope, way)
    return at.slope + missed[..., None, None] * along[:, :, None, None]


def _seen(
    frame: Frame, rings: Rings, Omega: jax.Array, marching: Marching
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """(l, 3, N, q, q, H) C, (l, N, q, H) r, and (l, K, 1 + r) the read-outs by the loads and by forces in the first
    harmonic."""
    C, d = _of_blades(rings, Omega, marching)
    l, K, r1, r, _ = C.shape
    one = marching.harmonics.index(1)
    read = jnp.concatenate([d[:, :, -1:, one], C[:, :, -1, :, one]], axis=-1)
    C, d = C[:, :, :-1].reshape(l, K * r * r, -1), d[:, :, :-1].reshape(l, K * r, -1)
    both = (C[:, frame.pairs] * frame.factors).sum(axis=-2), (d[:, frame.driven] * frame.signs).sum(axis=-2)
    return *both, read


def _of_blades(rings: Rings, Omega: Any, marching: Marching) -> tuple[Any, Any]:
    """(l, K, r + 1, r, H) receptances and (l, K, r + 1, H) motions under the loads of blades by
    themselves, read-outs in the last row."""
    xp, waves = rings.mean.__array_namespace__(), np.array(marching.waves)
    n = len(waves)
    once = 1 / (1j * Omega[:, None, None, None] * waves[:, None] - rings.poles[:, :, None])  # (l, K, H, p)
    rows = rings.left[:, :, None] * once[:, :, :, None]  # (l, K, H, r + 1, p)
    C = rows @ rings.right[:, :, None, :, n:] + rings.static[:, :, None, :, n:]
    d = (rows * rings.right[..., :n].swapaxes(2, 3)[:, :, :, None]).sum(axis=-1)
    d += rings.static[..., :n].swapaxes(2, 3)
    if 0 in marching.harmonics:
        C = xp.concatenate([rings.mean[:, :, None, :, 1:], C], axis=2)
        d = xp.concatenate([rings.mean[:, :, None, :, 0], d], axis=2)
    return xp.moveaxis(C, 2, -1), xp.moveaxis(d, 2, -1)


def _excess(force: Any, preload: Any, marching: Marching) -> Any:
    """(..., H) amplitudes of forces (..., W) beyond the preload."""
    F = _amplitudes(force)
    if 0 not in marching.harmonics:
        return F
    return F - preload[..., None] * (np.arange(F.shape[-1]) == 0)


def _amplitudes(v: Any) -> Any:
    """(..., H) complex amplitudes of (..., W) coefficients, an odd number of which begins with the mean."""
    mean, xp = v.shape[-1] % 2, v.__array_namespace__()
    return xp.concatenate([v[..., :mean] + 0j, v[..., mean::2] - 1j * v[..., mean + 1 :: 2]], axis=-1)


def _coefficients(v: Any, mean: int) -> Any:
    """The other way."""
    xp = v.__array_namespace__()
    waves = xp.stack([v[..., mean:].real, -v[..., mean:].imag], axis=-1).reshape(*v.shape[:-1], -1)
    return xp.concatenate([v[..., :mean].real, waves], axis=-1)


def _of_coefficients(C: jax.Array, mean: int) -> jax.Array:
    """(..., q W, q W) real matrices of (..., q, q, H) complex ones of the harmonics."""
    *lead, q, _, count = C.shape
    W = 2 * count - mean
    real, imaginary = np.zeros((2, count, W, W), np.float32)
    real[:mean, :mean, :mean] = 1.0
    for h in range(mean, count):
        a, b = 2 * h - mean, 2 * h - mean + 1
        real[h, a, a] = real[h, b, b] = imaginary[h, a, b] = 1.0
        imaginary[h, b, a] = -1.0
    out = jnp.einsum("...pqh,hwx->...pwqx", C.real, real) + jnp.einsum("...pqh,hwx->...pwqx", C.imag, imaginary)
    return out.reshape(*lead, q * W, q * W)


def _of_gaps(slope: jax.Array, gaps: int) -> jax.Array:
    """(l, N, q W, q W) of the contacts (l, M, k, W, k, W) in each gap."""
    l, M, k, W, *_ = slope.shape
    each = M // gaps
    S = slope.reshape(l, gaps, each, k * W, k * W)
    if each == 1:
        return S[:, :, 0]
    apart = jnp.eye(each, dtype=S.dtype)[:, None, :, None]
    return (S[:, :, :, :, None] * apart).reshape(l, gaps, each * k * W, each * k * W)


def _around(D: jax.Array, behind: jax.Array, before: jax.Array, r: jax.Array) -> jax.Array:
    """(l, n, s) x of rings, see `blocks.around`."""
    (n, s), at = r.shape[1:], np.arange(r.shape[1])
    if n <= 3:
        A = jnp.zeros((len(r), n, s, n, s), D.dtype)
        for block, to in ((D, at), (behind, (at + 1) % n), (before, (at - 1) % n)):
            A = A.at[:, at, :, to].add(block.swapaxes(0, 1))
        return jnp.linalg.solve(A.reshape(-1, n * s, n * s), r.reshape(-1, n * s, 1)).reshape(r.shape)
    out, kept = at[1 : n - n % 2 : 2], at[::2]
    X = jnp.linalg.solve(D[:, out], jnp.concatenate([r[:, out, :, None], before[:, out], behind[:, out]], axis=3))
    m = len(out)
    up, down = np.arange(m), np.arange(1, m + 1) % len(kept)
    after, ahead, D, r0 = behind[:, kept], before[:, kept], D[:, kept], r[:, kept]
    behind_it, before_it = after[:, up] @ X, ahead[:, down] @ X
    r0 = r0.at[:, up].add(-behind_it[..., 0]).at[:, down].add(-before_it[..., 0])
    D = D.at[:, up].add(-behind_it[..., 1 : 1 + s]).at[:, down].add(-before_it[..., 1 + s :])
    after, ahead = after.at[:, up].set(-behind_it[..., 1 + s :]), ahead.at[:, down].set(-before_it[..., 1 : 1 + s])
    found = _around(D, after, ahead, r0)
    between = jnp.concatenate([found[:, up], found[:, down]], axis=2)
    x = X[..., 0] - (X[..., 1:] @ between[..., None])[..., 0]
    return jnp.zeros_like(r).at[:, kept].set(found).at[:, out].set(x)


# rings as numbers ------------------------------------------------------------------------------


LANES = 16
"""Rings that are solved side by side."""

LARGEST = 24
"""Unknowns of a gap, above which a core solves rings no slower one by one: a step goes with their cube."""

MOST = 25
"""Steps at a frequency."""

SEARCHED, ENDED = 5e-7, 1e-9
"""Length of the last step, over that of the motion: while the peak is searched for, and there."""

SIZES = 0.1, 0.5, 2.0, 10.0
"""Of motions, over about what makes contacts slide, by which forces are tried."""

SLOW = 0.3
"""Of a step over the one before, from which on derivatives are found anew."""

DERIVED = 2
"""Lanes whose derivatives are found together."""


@dataclass(frozen=True, eq=False)
class Batch:
    """What rings of an ensemble have in common.

    Attributes: asked. problem: of the ring of equal sectors, form ``sides``.
    """

    asked: Asked
    problem: Problem

    @cached_property
    def marching(self) -> Marching:
        p, model = self.problem, self.models[0]
        harmonics = tuple(range(p.harmonics + 1) if self._skew else range(1, p.harmonics + 1, 2))
        return Marching(model.samples, model.cycles, model.periodicity, p.harmonics, harmonics)

    @property
    def models(self) -> list[AFT]:
        """Of every group of contacts."""
        return [g.model for g in self.problem.groups if isinstance(g.model, AFT)]

    @property
    def _skew(self) -> bool:
        """Whether forces are not as large either way, or loads have even harmonics."""
        p, W = self.problem, self.problem.coefficients
        even = np.array([0, *(i for h in range(2, p.harmonics + 1, 2) for i in (2 * h - 1, 2 * h))])
        loads = [part for h in range(0, p.harmonics + 1, 2) for part in p.parts[h]]
        if any(part.load.any() or part.given.any() for part in loads):
            return True
        rng = np.random.default_rng(0)
        for size in SIZES:
            for g in p.groups:
                d = rng.normal(size=(*g.offset.shape, W)) * size * p.length
                d[:, :, even] = 0.0
                d[:, :, 0] += g.offset
                force = np.array(g.model.force(d, 1.0))
                force[:, :, 0] -= g.preload
                if np.abs(force[:, :, even]).max() > 1e-12 * np.abs(force).max():
                    return True
        return False

    @cached_property
    def sides(self) -> list[list[tuple[int, float, Indices]]]:
        """Of every blade (contact, sign, places among the blade's contact coordinates) of its sides."""
        ring, ways, found = self.problem.assembly, self.problem.ways, []
        for component in ring.components:
            begins, own = 0, []
            for i, j, _ in ring.sides(component.name):
                own.append((i, -1.0 if j else 1.0, begins + ways))
                begins += ring.contacts[i].patch.count
            found.append(own)
        return found

    @cached_property
    def felt(self) -> int:
        """r."""
        return max(map(len, self.sides)) * len(self.problem.ways)

    @cached_property
    def frame(self) -> Frame:
        p, k = self.problem, len(self.problem.ways)
        gaps, K, r = p.sides.ring, len(self.sides), self.felt
        assert gaps is not None
        N, each, q = gaps.count, gaps.each, gaps.each * k
        h = np.array(self.marching.harmonics)
        phases = np.exp(-1j * np.outer([c.phase for c in p.assembly.contacts], h))
        cell = gaps.gap * each + gaps.place
        pairs, factors = np.zeros((3, N, q, q, 2), int), np.zeros((3, N, q, q, 2, len(h)), complex)
        driven, signs = np.zeros((N, q, 2), int), np.zeros((N, q, 2, len(h)), complex)
        felt, given = np.zeros((K, r), int), np.zeros((K, r, len(h)), complex)
        pair_count, count, way = np.zeros((3, N, each, each), int), np.zeros((N, each), int), np.arange(k)
        for blade, own in enumerate(self.sides):
            for a, (i, sign, _) in enumerate(own):
                gap, place = gaps.gap[i], gaps.place[i]
                rows, mine = place * k + way, a * k + way
                n = count[gap, place]
                driven[gap, rows, n], signs[gap, rows, n] = blade * r + mine, sign * phases[i]
                felt[blade, mine], given[blade, mine] = cell[i] * k + way, sign * phases[i].conj()
                count[gap, place] += 1
                for b, (j, other, _) in enumerate(own):
                    away = (gaps.gap[j] - gap) % N
                    away = 2 if away == N - 1 else away
                    at = away, gap, rows[:, None], gaps.place[j] * k + way[None]
                    n = pair_count[away, gap, place, gaps.place[j]]
                    pairs[*at, n] = (blade * r + mine[:, None]) * r + b * k + way
                    factors[*at, n] = sign * other * phases[i] * phases[j].conj()
                    pair_count[away, gap, place, gaps.place[j]] += 1
        cells = tuple(cell[list(g.contacts)] for g in p.groups)
        kinematics = tuple(model.patch.kinematics[:, :, p.ways] for model in self.models)
        unit = p.scale[p.groups[0].first[0]][p.ways]
        return Frame(pairs, factors, driven, signs, felt, given, cells, np.argsort(np.concatenate(cells)), kinematics,
                     unit)  # fmt: skip

    @cached_property
    def still(self) -> tuple[Array, ...]:
        """Of every blade what does not scatter: rows (K, r, m) and read-outs (K, m), loads (K, H + 1, m),
        compliance (K, r + 1, r) beside the coordinates and motions (K, H + 1, r + 1) by the loads; of the mean and of
        all waves."""
        p, r, waves = self.problem, self.felt, (0, *self.marching.waves)
        K, H, m = len(self.sides), len(waves), len(p.parts[0][0].M)
        rows, output, load = np.zeros((K, r, m)), np.zeros((K, m)), np.zeros((K, H, m), complex)
        beside, moved = np.zeros((K, r + 1, r), complex), np.zeros((K, H, r + 1), complex)
        outputs = [w.component for w in p.assembly.outputs]
        for blade, (component, own) in enumerate(zip(p.assembly.components, self.sides, strict=True)):
            parts = [p.parts[h][blade] for h in waves]
            felt = np.concatenate([at for *_, at in own])
            n = len(felt)
            rows[blade, :n] = parts[1].rows[felt]
            beside[blade, :n, :n] = parts[1].yielding[np.ix_(felt, felt)]
            load[blade], moved[blade, :, :n] = [one.load for one in parts], [one.given[felt] for one in parts]
            if component.name in outputs:
                w = outputs.index(component.name)
                output[blade], beside[blade, -1, :n] = parts[1].output[w], parts[1].output_residual[w, felt]
                moved[blade, :, -1] = [one.output_given[w] for one in parts]
        return rows, output, load, beside, moved

    @cached_property
    def readers(self) -> Indices:
        """(w,) blades of the read-outs."""
        names = [m.name for m in self.problem.assembly.components]
        return np.array([names.index(w.component) for w in self.problem.assembly.outputs])

    def rings(self, rings: Sequence[Assembly]) -> tuple[Rings, Array, Array]:
        """The numbers of rings, (l,) whether each has them, and (l, K, 3, m, m) M, K + i H and C of their blades."""
        rows, output, load, beside, moved = self.still
        K, r, m = rows.shape
        matrices = np.zeros((len(rings), K, 3, m, m), complex)
        static = np.zeros((len(rings), K, m, m))
        for n, ring in enumerate(rings):
            for j, component in enumerate(ring.components):
                wave = component.at(0)
                M, stiff, C = wave.matrices
                static[n, j] = stiff + wave.circulatory
                matrices[n, j] = M, static[n, j] + (0 if wave.loss is None else 1j * wave.loss), C
        M, stiff, C = matrices.swapaxes(0, 2).swapaxes(1, 2)
        companion = np.zeros((len(rings), K, 2 * m, 2 * m), complex)
        companion[..., :m, m:] = np.eye(m)
        companion[..., m:, :] = -np.linalg.solve(M, np.concatenate([stiff, C], axis=-1))
        poles, V = np.linalg.eig(companion)
        inverse = np.concatenate([np.zeros_like(M), np.linalg.inv(M)], axis=-2)
        W = np.linalg.solve(V, inverse)
        right = W @ np.concatenate([load[:, 1:].swapaxes(1, 2), rows.swapaxes(1, 2)], axis=-1)
        left = np.concatenate([rows, output[:, None]], axis=1) @ V[..., :m, :]
        good = (np.abs(poles).min(axis=-1) > 1e-9 * np.abs(poles).max(axis=-1)).all(axis=-1)
        static_rows = np.concatenate([moved[:, 1:].swapaxes(1, 2), beside], axis=-1)
        X = np.linalg.solve(static, np.concatenate([load[:, 0].real[..., None], rows.swapaxes(1, 2)], axis=-1))
        mean = np.concatenate([rows, output[:, None]], axis=1) @ X
        mean += np.concatenate([moved[:, 0, :, None], beside], axis=-1).real
        laws, offset, preload = self._contacts(rings)
        every = np.broadcast_to(static_rows, (len(rings), *static_rows.shape))
        return Rings(poles, left, right, every, mean, laws, offset, preload), good, matrices

    def _contacts(self, rings: Sequence[Assembly]) -> tuple[tuple[Any, ...], Array, Array]:
        """Laws with their numbers (l, c n) point by point, and (l, N, q) offset and preload."""
        p, frame = self.problem, self.frame
        N, k = len(frame.driven), len(p.ways)
        state = np.zeros((2, len(rings), len(frame.order), k))
        laws = []
        for g, model, cells in zip(p.groups, self.models, frame.cells, strict=True):
            n = len(model.patch.points)
            axes = point_axes(model.patch.law, n)
            leaves, tree = jax.tree_util.tree_flatten(model.patch.law)
            found: list[list[Array]] = [[] for _ in leaves]
            for i, ring in enumerate(rings):
                for number, cell in zip(g.contacts, cells, strict=True):
                    c = ring.contacts[number]
                    state[:, i, cell] = c.offset[p.ways], c.preload[p.ways]
                    for kept, leaf in zip(found, jax.tree_util.tree_leaves(c.patch.law), strict=True):
                        kept.append(np.asarray(leaf))
            numbers = []
            for axis, values in zip(axes, found, strict=True):
                if axis is None and values[0].ndim == 0:
                    numbers.append(np.repeat(np.array(values), n).reshape(len(rings), -1))
                elif axis == -1:
                    stacked = np.array(values)  # (l c, ..., n)
                    both = np.moveaxis(stacked.reshape(len(rings), len(cells), *stacked.shape[1:]), 1, -2)
                    numbers.append(both.reshape(*both.shape[:-2], -1))
                else:  # tables, which are those of all
                    numbers.append(values[0])
            laws.append(jax.tree_util.tree_unflatten(tree, numbers))
        offset, preload = state.reshape(2, len(rings), N, -1)
        return tuple(laws), offset, preload


    def sample(self, one: _Way, matrices: ComplexArray) -> Sample:
        """Of a ring that has ended; matrices: (K, 3, m, m)."""
        top = one.highest
        assert top is not None
        rows, _, load, *_ = self.still
        first = self.marching.harmonics.index(1)
        F = np.asarray(_amplitudes(one.known[top.frequency].slope)[..., first]).ravel()
        w = 2 * np.pi * top.frequency
        M, K, C = matrices.swapaxes(0, 1)
        given = load[:, 1] - np.einsum("jam,ja->jm", rows, F[self.frame.felt] * self.frame.given[..., first])
        motions = np.linalg.solve(K - w**2 * M + 1j * w * C, given[..., None])[..., 0]
        return Sample(one.sample, top, on_sweep(self.asked, top), *worst(one.ring, list(motions)), alone=False)

    @cached_property
    def unit(self) -> Array:
        """(q, 1) m or rad of a motion."""
        return np.tile(self.frame.unit, self.felt_of_gap // len(self.frame.unit))[:, None]

    @cached_property
    def felt_of_gap(self) -> int:
        return self.frame.driven.shape[1]

    def of_gaps(self, problem: Problem, point: Point) -> tuple[Array, Array]:
        """(N, q, W) motions from a solution of `Problem`, and forces."""
        frame, p = self.frame, self.problem
        found = np.zeros((2, len(frame.order), len(p.ways), p.coefficients))
        columns = self.marching.columns
        for g, u, cells in zip(problem.groups, _motions(problem, point.x), frame.cells, strict=True):
            force = g.model.force(u, 2 * np.pi / point.Omega)
            u[:, :, 0] -= g.offset
            found[0, cells], found[1, cells] = u[:, p.ways], force[:, p.ways]
        d, force = found[..., columns].reshape(2, len(frame.driven), -1, len(columns))
        return d, force

    @cached_property
    def begun(self) -> Array:
        """(N, q, W) the motion of the ring of equal sectors at the first frequency."""
        return self.of_gaps(self.problem, self.asked.tuned_points[0])[0]


class _Way(Solutions):
    """A ring of the batch on its way.

    Attributes:
        batch. every: numbers of all rings. number, sample: its own among those, and of the ensemble. ring. asking: see
            `peaks.search`. wanted: what it asks for now, None: its peak, solved to the end. behind: of how many points
            the start is carried on, where a solution is followed. amplitudes: Hz -> (w,). top: the highest so far.
            highest: the answer. hard: whether it is left to the solver of single rings: beside a jump, or without a
            solution.
    """

    def __init__(self, batch: Batch, every: Rings, number: int, sample: int, ring: Assembly) -> None:
        super().__init__()
        self.batch, self.every, self.number, self.sample, self.ring = batch, every, number, sample, ring
        self.asking = search(batch.asked.frequency, tells=self.tells)
        self.wanted: Wanted | None = next(self.asking)
        self.amplitudes: dict[float, Array] = {}
        self.behind, self.top = 0, 0.0
        self.highest: Highest | None = None
        self.hard = False

    @property
    def frequency(self) -> float:
        """Hz, at which it is."""
        assert self.wanted is not None or self.highest is not None
        return self.wanted.frequency if self.wanted else self.highest.frequency  # type: ignore[union-attr]

    def start(self) -> Array:
        """(size,) from what is known."""
        Omega = 2 * np.pi * self.frequency
        if not self.known:
            return (self.batch.begun / self.batch.unit).ravel()
        if self.behind and self.wanted and self.wanted.onward:
            return carried(self.beyond(self.frequency, self.wanted.onward[0])[: self.behind], Omega)
        near = self.near(Omega, 4)
        inside = min(p.Omega for p in near) < Omega < max(p.Omega for p in near)
        return carried(near if inside else near[:3], Omega)

    def goes_on(self, point: Point | None, y: Array) -> bool:
        """Whether there is more to solve in a lane, by the solution at the frequency, None where there is none."""
        if self.wanted is None:
            assert self.highest is not None
            self.hard = point is None
            if point is not None:
                self.known[self.frequency] = point
                self.highest = ended(self.highest, y)
            return False
        f = self.frequency
        answer: Any = None
        if self.wanted.onward is None:
            if point is not None:
                answer = self._kept(point, y)
            elif not self.wanted.at_once:
                self.hard = True
                return False
        elif point is not None and not y.max() <= self.amplitudes.get(f, np.zeros(1)).max():
            answer = [(f, self._kept(point, y))], False
        elif self.behind > 1:
            self.behind -= 1
            return True
        elif self.wanted.onward[2]:
            self.hard = True
            return False
        else:
            answer = [], False
        return self._asks(answer)

    def _asks(self, answer: Any) -> bool:
        try:
            self.wanted, self.behind = self.asking.send(answer), 0
        except StopIteration as found:
            self.wanted, self.highest = None, found.value
            self.hard = not np.isfinite(self.highest.amplitude)
            return not self.hard
        if self.wanted.onward:
            self.behind = min(2, len(self.beyond(self.frequency, self.wanted.onward[0])))
        return True

    def _kept(self, point: Point, y: Array) -> Array:
        self.known[self.frequency], self.amplitudes[self.frequency] = point, y
        return y


def unknown_of(batch: Batch, rings: Rings) -> tuple[Any, ...]:
    """That nothing is known of the sliders of rings."""
    l, f = len(rings.mean), batch.frame
    each = zip(rings.laws, f.cells, f.kinematics, strict=True)
    return tuple(unknown(_of_points(law), l * len(cells) * len(G)) for law, cells, G in each)


def solved(batch: Batch, numbers: Sequence[int]) -> list[Sample]:
    """Samples; hard ones by the solver of single rings."""
    lanes = _Run(batch, numbers)
    while lanes.filled():
        look()
        lanes.step()
    return [lanes.found.get(i) or sample(batch.asked, n) for i, n in enumerate(numbers)]


class _Run:
    """Rings on their way through the lanes.

    Attributes: found: samples, by their places among those asked for.
    """

    def __init__(self, batch: Batch, numbers: Sequence[int]) -> None:
        asked, l = batch.asked, LANES
        whole = [asked.tuned.mistuned(asked.deviations(n)) for n in numbers]
        self.batch, self.frame = batch, jax.device_put(batch.frame)
        self.every, good, self.matrices = batch.rings(whole)
        ways = [_Way(batch, self.every, i, n, ring) for i, (n, ring) in enumerate(zip(numbers, whole, strict=True))]
        self.waiting = [way for way in ways[::-1] if good[way.number]]
        self.found: dict[int, Sample] = {}
        self.lanes: list[_Way | None] = [None] * l
        self.rows, self.rings = np.zeros(l, int), self.every
        d = np.broadcast_to(batch.begun, (l, *batch.begun.shape))
        k, W = len(batch.frame.unit), d.shape[-1]
        slope = jnp.zeros((l, len(batch.frame.order), k, W, k, W))
        self._placed(range(l))
        given = self.rings, d, slope, np.zeros(DERIVED, int), batch.marching
        self.first = derived(self.frame, *given)[0]
        self.top = jnp.broadcast_to(self.first, slope.shape)
        sliders = unknown_of(batch, self.rings)
        self.at = Lanes(np.ones(l), d, self.top, d, 0 * d, np.zeros(l, bool), sliders)
        self.count, self.last = np.zeros(l, int), np.full(l, np.inf)

    def _placed(self, lanes: Iterable[int]) -> None:
        """Numbers of the rings to where they are."""
        for lane in lanes:
            self.rows[lane] = self.lanes[lane].number if self.lanes[lane] else self.rows[lane]  # type: ignore[union-attr]
        self.rings = jax.device_put(jax.tree_util.tree_map(lambda x: x[self.rows], self.every))

    def filled(self) -> bool:
        """Whether any lane has a ring, those that wait taken in."""
        free = [i for i, way in enumerate(self.lanes) if way is None][: len(self.waiting)]
        for lane in free:
            self.lanes[lane] = self.waiting.pop()
        if free:
            self._placed(free)
            self._begin(free, free)
        return any(self.lanes)

    def _begin(
        self, anew: Sequence[int], moved: Sequence[int], keep: Sequence[int] = (), back: Sequence[int] = ()
    ) -> None:
        """Lanes to where they go on: some with the first derivatives of all, some with those of their tops, which are
        kept before."""
        slope = self.at.slope
        if anew or keep or back:
            masks = (np.isin(np.arange(len(self.lanes)), which) for which in (keep, back, anew))
            slope, self.top = turned(slope, self.top, self.first, *masks)
        Omega, d, told = (np.array(x) for x in (self.at.Omega, self.at.d, self.at.told))
        told[list(anew)] = False
        for lane in moved:
            way = self.lanes[lane]
            if way is not None:
                Omega[lane], d[lane] = 2 * np.pi * way.frequency, way.start().reshape(d[lane].shape) * self.batch.unit
                self.count[lane], self.last[lane] = 0, np.inf
        self.at = self.at._replace(Omega=Omega, d=d, told=told, slope=slope)

    def step(self) -> None:
        """One step in all lanes, and on to other frequencies where that was the last one."""
        self.at, *got = stepped(self.frame, self.rings, self.at, self.batch.marching)
        length, y, force = map(np.asarray, got)
        Omega, d = np.asarray(self.at.Omega), np.asarray(self.at.d) / self.batch.unit
        self.count += 1
        ratio = np.where(self.last < np.inf, length / self.last, 1.0)
        error = length * np.minimum(ratio, 0.9) / (1 - np.minimum(ratio, 0.9))
        self.last = length.copy()
        slow, anew, keep, back, moved = list[int](), list[int](), list[int](), list[int](), list[int]()
        for lane, way in enumerate(self.lanes):
            if way is None:
                continue
            small = bool(error[lane] < (SEARCHED if way.wanted else ENDED))
            if not small and np.isfinite(length[lane]) and self.count[lane] < MOST:
                if self.count[lane] > 1 and not ratio[lane] < SLOW:
                    slow.append(lane)
                continue
            moved.append(lane)
            Y, point = y[lane, self.batch.readers], None
            if small:
                point = Point(float(Omega[lane]), d[lane].ravel(), slope=force[lane])
                if Y.max() > way.top:
                    way.top = float(Y.max())
                    keep.append(lane)
            if not way.goes_on(point, Y):
                if not way.hard:
                    self.found[way.number] = self.batch.sample(way, self.matrices[way.number])
                self.lanes[lane] = None
            elif not small:
                anew.append(lane)
            elif way.frequency < max(way.known):
                back.append(lane)
        if moved:
            self._begin(anew, moved, keep, back)
        for begins in range(0, len(slow), DERIVED):
            some = slow[begins : begins + DERIVED]
            given = self.at.d, self.at.slope, np.resize(some, DERIVED), self.batch.marching
            self.at = self.at._replace(slope=derived(self.frame, self.rings, *given))
            self.last[some] = np.inf


@lru_cache(maxsize=1)
def batch(asked: Asked) -> Batch | None:
    """None where rings are solved one by one."""
    if asked.stuck or asked.models is not None or any(s.of == "modal_file" for s in asked.scatter):
        return None
    p = asked.problem(asked.tuned.whole)
    outputs = [w.component for w in p.assembly.outputs]
    models = [g.model for g in p.groups]
    alone = len(p.slices) > 3 and len({len(part.M) for part in p.parts[0]}) == 1
    alike = len({tuple(p.scale[g.first[0]][p.ways]) for g in p.groups}) == 1
    marched = all(isinstance(m, AFT) for m in models)
    rows = p.coefficients * len(p.ways) * (p.sides.ring.each if p.sides.ring else 1)
    marched = marched and (rows <= LARGEST or jax.default_backend() != "cpu")
    if not (asked.tuned_points and alone and alike and marched and p.sides.ring and len(set(outputs)) == len(outputs)):
        return None
    rng = np.random.default_rng(0)
    for g, size in product(p.groups, SIZES):  # where contacts stick and where they slide
        u = rng.normal(size=(*g.offset.shape, p.coefficients)) * size * p.length
        u[:, :, 0] += g.offset
        if not np.array_equal(g.model.force(u, 1.0), g.model.force(u, 3.0)):
            return None  # depends on how fast it moves
    found = Batch(asked, p)
    try:
        return found if found.rings([asked.tuned.whole])[1].all() else None
    except np.linalg.LinAlgError:  # a body that nothing but its contacts holds
        return None


def _motions(p: Problem, x: Array) -> list[Array]:
    """Of every group (c, k, W) its motions, as the law measures them."""
    return [g._back(g.relative(p.displacement(x))) for g in p.groups]
