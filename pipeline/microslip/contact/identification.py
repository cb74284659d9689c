"""Contact stiffnesses from measured resonances (Sextro 3.5): which springs give a model the measured frequencies.

A model is any function that returns the eigenfrequencies for given stiffnesses: `joined` makes one of one or two
bodies of modal files, `two_beams` that of the book's rig. By Rayleigh's principle no frequency falls when a spring
is stiffened, so every mode has a reach from the open to the rigid contact, and what lies outside is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import scipy.linalg
import scipy.ndimage
import scipy.optimize

from ..data import INTERFACE_ROWS, Array, ModalGroup
from ..errors import UserError
from ..reduced.compliance import BULK_AND_SURFACE, SURFACE
from ..reduced.coordinates import in_modes

Model = Callable[[Array], Array]
"""Stiffnesses (k,), N/m, to eigenfrequencies (m,), Hz, each of which rises with every stiffness or stays."""

BOUNDS = (1e2, 1e13)
"""N/m between which a stiffness is looked for."""

Ends = Sequence[tuple[float, float]]

UNCERTAIN = 1.0
"""Standard deviation of ln(k) from which a stiffness counts as not identified: it would be known to a factor of e."""


@dataclass(frozen=True)
class MeasuredResonance:
    """A measured one. frequency: Hz. uncertainty: its standard deviation, Hz. mode: which of the model's, from 1."""

    frequency: float
    uncertainty: float
    mode: int


@dataclass(frozen=True)
class Identified:
    """Stiffnesses that meet the measured resonances best.

    Attributes:
        names: of the k stiffnesses. stiffness: (k,) N/m. deviation: (k,) standard deviation over the stiffness.
        correlation: (k, k) of their logarithms. sensitivity: (r, k) d ln f / d ln k. frequency: (r,) of the model,
            Hz. misfit: (r,) measured less model, in standard deviations of the measurement.
    """

    names: tuple[str, ...]
    stiffness: Array
    deviation: Array
    correlation: Array
    sensitivity: Array
    frequency: Array
    misfit: Array

    def sentence(self) -> str:
        """What was found, how sure it is, and how well the resonances are met."""
        found = ", ".join(
            f"{n} {k:.4g} N/m +- {100 * d:.2g} %"
            for n, k, d in zip(self.names, self.stiffness, self.deviation, strict=True)
        )
        worst = float(np.abs(self.misfit).max())
        met = "met within their uncertainty" if worst < 2 else f"missed by up to {worst:.3g} standard deviations"
        return f"Contact stiffness: {found}; the resonances are {met}."


def identify(
    model: Model, resonances: Sequence[MeasuredResonance], names: Sequence[str] = ("normal", "tangential"),
    bounds: Mapping[str, tuple[float, float]] | None = None,
) -> Identified:  # fmt: skip
    """Stiffnesses (as many as `names`) from at least as many resonances, by least squares in ln(k).

    Uncertainties are those of the frequencies, carried through the sensitivities; the model's own are not in them.

    Args:
        model: see `Model`. resonances: measured. names: of the stiffnesses, in the model's order. bounds: name ->
            N/m between which it is looked for, `BOUNDS` if not given.

    Raises:
        UserError: fewer resonances than stiffnesses, a frequency out of the contact's reach, a stiffness that the
            resonances do not tell (the mode does not move there, or is all but free or stuck), frequencies that no
            stiffnesses meet together, or that several do (modes that change places with each other).
    """
    for r in resonances:
        if not (0 < r.frequency < np.inf and 0 < r.uncertainty < np.inf):
            raise UserError(f"resonances: {r.frequency:g} Hz +- {r.uncertainty:g} Hz; both must be greater than 0")
    if len(resonances) < len(names) or not names:
        raise UserError(
            f"resonances: {len(resonances)} measured for {len(names)} stiffnesses ({', '.join(names)}); measure as many"
        )
    ends = [(bounds or {}).get(n, BOUNDS) for n in names]
    if not all(0 < a < b < np.inf for a, b in ends):
        raise UserError(f"bounds: must be two rising numbers of N/m greater than 0 for each of {', '.join(names)}")
    picked = _picked(model, resonances, len(names))
    _within_reach(picked, resonances, ends)
    return _judged(picked, resonances, tuple(names), _best(picked, resonances, tuple(names), ends))


def _picked(model: Model, resonances: Sequence[MeasuredResonance], count: int) -> Callable[[Array], Array]:
    """ln(k) -> frequencies (r,) of the measured modes."""
    modes = np.array([r.mode for r in resonances]) - 1
    known = len(model(np.full(count, 1e6)))
    for r, i in zip(resonances, modes, strict=True):
        if not 0 <= i < known:
            raise UserError(f"resonances: {r.frequency:g} Hz: mode {r.mode} is none of the model's 1 to {known}")
    return lambda x: model(np.exp(x))[modes]


def _within_reach(picked: Callable[[Array], Array], resonances: Sequence[MeasuredResonance], ends: Ends) -> None:
    low, high = (picked(np.log([e[side] for e in ends])) for side in (0, 1))
    for r, a, b in zip(resonances, low, high, strict=True):
        if b - a <= 1e-9 * b:
            raise UserError(
                f"resonances: {r.frequency:g} Hz: mode {r.mode} ({a:.6g} Hz) does not move at the contact, whose "
                "stiffness it cannot tell; measure another mode"
            )
        if not a < r.frequency < b:
            side, limit = ("open", a) if r.frequency <= a else ("rigid", b)
            near = abs(r.frequency - limit) <= 2 * r.uncertainty
            why = (
                f"within its uncertainty of the {side} contact, so it only bounds the stiffness"
                if near else f"out of the contact's reach, {a:.6g} Hz open to {b:.6g} Hz rigid; check which mode it is"
            )  # fmt: skip
            raise UserError(f"resonances: {r.frequency:g} Hz (mode {r.mode}) is {why}")


def _best(
    picked: Callable[[Array], Array], resonances: Sequence[MeasuredResonance], names: tuple[str, ...], ends: Ends
) -> Array:  # fmt: skip
    """(k,) ln(k): least squares from the low points of a grid; modes are flat far from where they feel a spring."""
    f, s = np.array([r.frequency for r in resonances]), np.array([r.uncertainty for r in resonances])
    residual = lambda x: (picked(x) - f) / s  # noqa: E731
    axes = [np.linspace(np.log(a), np.log(b), 25) for a, b in ends]
    grid = np.array(list(product(*axes)))
    cost = np.array([float(residual(x) @ residual(x)) for x in grid])
    table = cost.reshape([len(a) for a in axes])
    cross = scipy.ndimage.generate_binary_structure(len(names), 1)
    low = np.flatnonzero((table == scipy.ndimage.minimum_filter(table, footprint=cross, mode="nearest")).ravel())
    starts = [*low[np.argsort(cost[low], kind="stable")][:8], *np.argsort(cost, kind="stable")[:8]]
    answers = [
        scipy.optimize.least_squares(
            residual, grid[i], "3-point", tuple(np.log(ends).T), xtol=1e-14, ftol=1e-14, gtol=1e-14, max_nfev=200,
            diff_step=[1e-5] * len(names),
        )
        for i in dict.fromkeys(starts)
    ]  # fmt: skip
    best = min(answers, key=lambda a: a.cost)
    alike = [a.x for a in answers if a.cost < best.cost + 2 and np.abs(a.x - best.x).max() > 0.05]
    if alike and _apart(residual, best.x, alike[0]):
        sets = " or ".join(
            ", ".join(f"{n} {k:.4g} N/m" for n, k in zip(names, np.exp(x), strict=True)) for x in (best.x, alike[0])
        )
        raise UserError(
            f"resonances: several stiffnesses meet them alike: {sets}; give bounds that leave one of them, or measure "
            "another mode"
        )
    return best.x


def _apart(residual: Callable[[Array], Array], a: Array, b: Array) -> bool:
    """Whether worse stiffnesses lie between two that meet the resonances alike; else they are one flat minimum."""
    between = [float(r @ r) for r in (residual(a + t * (b - a)) for t in np.linspace(0, 1, 9)[1:-1])]
    return max(between) > 4 + 2 * max(float(residual(x) @ residual(x)) for x in (a, b))


def _judged(
    picked: Callable[[Array], Array], resonances: Sequence[MeasuredResonance], names: tuple[str, ...], x: Array
) -> Identified:  # fmt: skip
    f, s = np.array([r.frequency for r in resonances]), np.array([r.uncertainty for r in resonances])
    found, k = picked(x), len(names)
    step = 1e-4
    J = np.array([(picked(x + step * e) - picked(x - step * e)) / (2 * step) for e in np.eye(k)]).T  # df/d ln k
    scaled = J / s[:, None]
    _, sizes, V = np.linalg.svd(scaled)
    if sizes[k - 1] * UNCERTAIN < 1:
        raise UserError(_not_told(names, resonances, scaled, V[k - 1]))
    misfit = (f - found) / s
    if len(resonances) == k and np.abs(misfit).max() > 3:
        met = ", ".join(f"{a:.6g} Hz for {b:g} Hz" for a, b in zip(found, f, strict=True))
        raise UserError(f"resonances: no stiffnesses meet them together (at best {met}); check which modes they are")
    covariance = np.linalg.inv(scaled.T @ scaled)
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviation, deviation)
    return Identified(names, np.exp(x), deviation, correlation, J / found[:, None], found, misfit)


def _not_told(names: tuple[str, ...], resonances: Sequence[MeasuredResonance], scaled: Array, direction: Array) -> str:
    modes = ", ".join(str(r.mode) for r in resonances)
    column = np.linalg.norm(scaled, axis=0)
    blind = [n for n, c in zip(names, column, strict=True) if c * UNCERTAIN < 1]
    if blind:
        return (
            f"resonances: modes {modes} do not tell the {' and the '.join(blind)} stiffness: a change by a tenth moves "
            f"them by {0.1 * column.min():.2g} of their uncertainty; measure a mode that moves there, or more precisely"
        )
    which = " and ".join(n for n, d in zip(names, direction, strict=True) if abs(d) > 0.1)
    return f"resonances: modes {modes} tell only one combination of the {which} stiffness; measure another mode"


# models ------------------------------------------------------------------------------------------------------------


def two_beams(section: Section, height: float) -> Model:
    """The rig of Sextro 3.5 (`frequencies`): (k_n, k_t) to the first two frequencies in Hz.

    The normal stiffness works as a hinge with c_phi = c_N h^2/12; the tangential one as c_T.

    Args:
        section: of one beam. height: of the contact in the plane of bending, m.
    """

    def model(k: Array) -> Array:
        return np.array(frequencies(section, k[0] * height**2 / 12, k[1])) / (2 * np.pi)

    return model


def joined(
    first: ModalGroup, contact: str, second: ModalGroup | None = None, other: str = "",
    includes: str = BULK_AND_SURFACE, given: Mapping[str, float] | None = None,
) -> Model:  # fmt: skip
    """Eigenfrequencies (Hz, all, ascending, rigid motions first) of one or two bodies held by a contact's springs.

    Three translations, and the rotations that springs spread over the patch make: k_t (b0^2 + h0^2)/12 about n,
    k_n h0^2/12 about t1, k_n b0^2/12 about t2 (Sextro 5.2).

    Args:
        first, contact: a body and its interface, real or of a nodal diameter (complex). second, other: the body that
            faces it; a rigid wall if None.
        includes: SURFACE adds the static compliance that the modes leave out in series, so that the stiffness found
            is the surface's; BULK_AND_SURFACE leaves it to the stiffness, as the book's c_N0 beside eigenmodes.
        given: {"normal": N/m} or {"tangential": N/m}: known, and not among the stiffnesses of the model then.

    Raises:
        UserError: no such interface, unknown words.
    """
    known = dict(given or {})
    if includes not in (SURFACE, BULK_AND_SURFACE) or set(known) - {"normal", "tangential"}:
        raise UserError(
            f"includes, given: '{includes}' and '{', '.join(known)}'; includes must be '{SURFACE}' or "
            f"'{BULK_AND_SURFACE}', and given may hold normal or tangential"
        )
    groups = [(in_modes(first), contact)] + ([(in_modes(second), other)] if second is not None else [])
    for g, name in groups:
        if name not in g.interfaces:
            raise UserError(f"contact: no interface '{name}'; the body has {', '.join(g.interfaces) or 'none'}")
    omega2, T, R = _relative(groups)
    b0, h0 = groups[0][0].interfaces[contact].extent
    spread_n = np.array([1, 0, 0, 0, h0**2 / 12, b0**2 / 12])
    spread_t = np.array([0, 1, 1, (b0**2 + h0**2) / 12, 0, 0])
    if includes == BULK_AND_SURFACE:
        R = np.zeros_like(R)

    def model(k: Array) -> Array:
        asked = iter(k)
        k_n, k_t = (known[n] if n in known else next(asked) for n in ("normal", "tangential"))
        springs = k_n * spread_n + k_t * spread_t
        joint = springs[:, None] * np.linalg.inv(np.eye(6) + R * springs)  # also where a spring is zero
        values = scipy.linalg.eigvalsh(np.diag(omega2) + T.conj().T @ (0.5 * (joint + joint.conj().T)) @ T)
        return np.sqrt(np.maximum(values, 0.0)) / (2 * np.pi)

    return model


def _relative(groups: Sequence[tuple[ModalGroup, str]]) -> tuple[Array, Array, Array]:
    """omega^2 (m,), rows (6, m) of the relative motion in the first contact's frame, residual compliance (6, 6)."""
    turn = groups[0][0].interfaces[groups[0][1]].rotation
    rows, left = [], []
    for sign, (g, name) in zip((1.0, -1.0), groups, strict=False):
        face = g.interfaces[name]
        Q = np.kron(np.eye(2), turn @ face.rotation.T)
        rows.append(sign * Q @ face.rows)
        labels = [f"interface:{name}:{row}" for row in INTERFACE_ROWS]
        at = [g.compliance.labels.index(label) for label in labels]
        left.append(Q @ g.compliance.residual[np.ix_(at, at)] @ Q.T)
    return np.concatenate([g.omega**2 for g, _ in groups]), np.hstack(rows), sum(left[1:], left[0])


# two equal cantilevers in line ---------------------------------------------------------------------------------------
#
# The rig that tells contact stiffnesses (Sextro 3.5, Treyde 1995): clamped at their outer ends, the slender beams meet
# in the middle. Where both bend alike, the slopes at the contact are opposite and it works as a hinge with the spring
# c_phi; where they bend against each other, the slopes are equal and the contact shears, c_T. Each half is a cantilever
# with the spring 2 c_phi on its tip's rotation or 2 c_T across it. With b^4 = omega^2 rho A L^4/(E I), C, S = cosh b,
# sinh b and c, s = cos b, sin b:
#
#     2 c_phi L/(E I) = -b (1 + C c)/(C s + S c),    2 c_T L^3/(E I) = -b^3 (1 + C c)/(C s - S c).
#
# The normal force on the contact is left out (it must be small against the buckling load).

FREE, HINGE_LOCKED, SHEAR_LOCKED = 1.8751040687119611, 2.3650203724313523, 3.9266023120479188
"""b without contact, with the slopes at the contact held at zero, and with the tips held in place."""


@dataclass(frozen=True)
class Section:
    """A uniform beam. length: m. young, shear: Pa. density: kg/m3. area: m2. inertia: second moment, m4.

    kappa: shear coefficient (`rectangle_kappa`).
    """

    length: float
    young: float
    shear: float
    density: float
    area: float
    inertia: float
    kappa: float

    @property
    def unit(self) -> float:
        """sqrt(E I / (rho A L^4)), rad/s: the frequency that makes a beam's numbers dimensionless."""
        return float(np.sqrt(self.young * self.inertia / (self.density * self.area * self.length**4)))


def rectangle(length: float, width: float, height: float, young: float, poisson: float, density: float) -> Section:
    """The beam of rectangular section that bends in the direction of `height` (m)."""
    shear = young / (2 * (1 + poisson))
    return Section(length, young, shear, density, width * height, width * height**3 / 12, rectangle_kappa(poisson))


def rectangle_kappa(poisson: float) -> float:
    """Shear coefficient of a vibrating rectangle (Kaneko, J. Phys. D 8 (1975) 1927); Cowper's is 2 % lower."""
    return 5 * (1 + poisson) / (6 + 5 * poisson)


def frequencies(section: Section, hinge: float, shear: float) -> tuple[float, float]:
    """Angular frequencies (rad/s) of the mode with both beams alike and of that against each other.

    Args:
        hinge: c_phi, N m/rad. shear: c_T, N/m.
    """
    stiffness = section.young * section.inertia / section.length
    alike = _root(hinge_number, 2 * hinge / stiffness, HINGE_LOCKED)
    against = _root(shear_number, 2 * shear * section.length**2 / stiffness, SHEAR_LOCKED)
    return section.unit * alike**2, section.unit * against**2


def _root(function: Callable[[float], float], value: float, top: float) -> float:
    below = top * (1 - 1e-15)
    if function(below) < value:
        return top
    if value <= 0:
        return FREE
    return float(scipy.optimize.brentq(lambda b: function(b) - value, FREE, below, xtol=1e-15, rtol=1e-15))


def hinge_number(b: float) -> float:
    """2 c_phi L/(E I)."""
    return float(-b * (1 + np.cosh(b) * np.cos(b)) / (np.cosh(b) * np.sin(b) + np.sinh(b) * np.cos(b)))


def shear_number(b: float) -> float:
    """2 c_T L^3/(E I)."""
    return float(-(b**3) * (1 + np.cosh(b) * np.cos(b)) / (np.cosh(b) * np.sin(b) - np.sinh(b) * np.cos(b)))
