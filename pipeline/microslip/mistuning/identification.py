"""How the blades of a disc differ, from the modes that were measured on it (after Feiner and Griffin, FMM ID).

Of one family of modes, one blade amplitude each, a ring whose blade j has the frequency 1 + d_j times the nominal one
has the stiffness, per unit of modal mass,

    K = E diag(omega_n^2) E^T + 2 P diag(e) P,    P = E diag(p_n) E^T,    2 e_j = (1 + d_j)^2 - 1

with the real waves E round the ring, the frequencies omega_n of the tuned ring at its nodal diameters, and
p_n^2 = omega_n^2 times the share of the strain energy that sits in what differs. Share 1 is the fundamental mistuning
model: K = Omega (1 + 2 D) Omega. For masses joined by springs, of which only those to the ground differ, the share is
(omega_ground / omega_n)^2, and K is exact.

A measured mode satisfies (K - omega^2) phi = 0, which is linear in e: this equation, by least squares over all modes,
is where the search begins (Feiner and Griffin, ASME J. Turbomach. 126 (2004) 150-158 and 159-165). The noise of a
shape enters it as factors of the unknowns; so the modes of K are then fitted to the measured ones, each by its
accuracy, and the intervals are those of this fit.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import numpy as np
import scipy.optimize
from numpy.typing import ArrayLike
from scipy.special import chdtri, ndtri

from ..data import Array
from ..errors import UserError
from ..settings.arguments import Rows, Vector, checked, numbers
from ..settings.numbers import Number

_ROUNDING = 1e-9
"""Share of the highest eigenvalue within which two are the same."""


DOUBTED = 1e-3
"""Probability below which what a fit leaves is no longer put down to the noise."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """Attributes:
    deviation: (N,) of each blade's frequencies, a share of the nominal ones. covariance: (N, N). misfit: root mean
        square of what the fit leaves, over the noise, per number measured beyond those found: about 1 where model and
        noise are as they were said to be; NaN where nothing is beyond. beyond: how many are.
    """

    deviation: Array
    covariance: Array
    misfit: float
    beyond: int

    @property
    def accuracy(self) -> Array:
        """(N,) standard deviations."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def fits(self) -> bool:
        """Whether the noise explains the misfit. Where it does not, intervals mean nothing: model or noise is another
        one, or the search ended beside the blades."""
        return accepted(self.misfit, self.beyond)

    def interval(self, level: float = 0.95) -> Array:
        """(2, N) ends of the confidence intervals, by the normal distribution."""
        return self.deviation + np.outer([-1, 1], self.accuracy) * ndtri(0.5 + level / 2)


def misfit(left: Array, beyond: int) -> float:
    """Of residuals over their noise, see `Estimate`."""
    return float(np.sqrt(left @ left / beyond)) if beyond > 0 else np.nan


def accepted(misfit: float, beyond: int) -> bool:
    """By the chi-square distribution; true where nothing could tell."""
    return beyond <= 0 or misfit**2 * beyond <= chdtri(beyond, DOUBTED)


def covariance(jacobian: Array) -> Array | None:
    """(y, y) of unknowns, from the derivatives of residuals over their noise; None where these leave some open."""
    _, size, turned = np.linalg.svd(jacobian, full_matrices=False)
    if len(size) < jacobian.shape[1] or size[-1] <= 1e-9 * size[0]:
        return None
    return (turned.T / size**2) @ turned


@dataclass(frozen=True, eq=False)
class FromModes(Estimate):
    """Attributes: tuned: (N//2 + 1,) Hz of the tuned ring at its nodal diameters, given or found. tuned_accuracy: Hz,
    standard deviations, 0 where given. The others are those of `Estimate`."""

    tuned: Array
    tuned_accuracy: Array


@checked
def blades_from_modes(
    tuned: Vector, frequency: Vector, shapes: Rows, frequency_noise: Number, shape_noise: Number,
    share: Annotated[Any, numbers(0, 1)] = 1.0, find_tuned: bool = False,
) -> FromModes:  # fmt: skip
    """Blade frequencies of a disc from measured modes of one family, a kind of FMM ID.

    Args:
        tuned: (N//2 + 1,) Hz of the tuned ring at the nodal diameters 0, 1, ...; with `find_tuned` only guesses.
        frequency: (m,) Hz of the measured modes. shapes: (m, N) amplitudes of one point of every blade, real,
            any scale. frequency_noise: standard deviation of a frequency over it. shape_noise: of an amplitude over
            the highest one of its mode.
        share: of the strain energy in the blades, one number or (N//2 + 1,).
        find_tuned: the tuned frequencies are found as well. A change of all blades alike is the same as one of all
            tuned frequencies; the deviations are then those whose e have the mean zero.

    Raises:
        UserError: fewer numbers than unknowns, shapes that do not fit the nodal diameters, modes in columns, or a mode
            that a ring of such blades does not have.
    """
    ring = _Family(np.asarray(tuned, float), np.asarray(share, float), find_tuned, np.shape(shapes)[-1])
    try:
        fit = _fitted(ring, frequency, shapes, frequency_noise, shape_noise)
    except UserError:
        if not _in_columns(ring, frequency, shapes, frequency_noise, shape_noise):
            raise
        raise UserError(IN_COLUMNS) from None
    if not fit.fits and _in_columns(ring, frequency, shapes, frequency_noise, shape_noise):
        raise UserError(IN_COLUMNS)
    return fit


IN_COLUMNS = "shapes: fit as columns and not as rows; give a row for each mode, that is shapes.T"


def _fitted(ring: _Family, frequency: ArrayLike, shapes: ArrayLike, noise: float, shape_noise: float) -> FromModes:
    measured = _Measured.of(ring, frequency, shapes, noise, shape_noise)
    fit = scipy.optimize.least_squares(
        lambda y: measured.compare(ring, y)[0], ring.start(measured), lambda y: measured.compare(ring, y)[1],
        x_scale="jac", xtol=1e-12, ftol=1e-12, gtol=1e-12,
    )  # fmt: skip
    return ring.identified(fit.x, fit.fun, fit.jac)


def _in_columns(ring: _Family, frequency: ArrayLike, shapes: ArrayLike, noise: float, shape_noise: float) -> bool:
    """Whether as many modes as blades, which no shape of the array tells apart, fit the other way round."""
    if np.shape(shapes) != (ring.blades, ring.blades):
        return False
    try:
        return _fitted(ring, frequency, np.transpose(shapes), noise, shape_noise).fits
    except UserError:
        return False


@dataclass(frozen=True, eq=False)
class _Family:
    """The ring over its unknowns y: e of the blades, those of mean zero and N/2 + 1 relative shifts if `shifting`."""

    tuned: Array
    share: Array
    shifting: bool
    blades: int

    def __post_init__(self) -> None:
        if self.tuned.shape != (self.blades // 2 + 1,) or not (self.tuned > 0).all():
            raise UserError(
                f"tuned: {self.blades} blades need a positive frequency for each of the nodal diameters 0 to "
                f"{self.blades // 2}, not {self.tuned.size}"
            )
        if not ((self.share > 0) & (self.share <= 1)).all() or self.share.shape not in ((), self.tuned.shape):
            raise UserError("share: of the strain energy must be above 0 and not above 1, one or one a nodal diameter")

    @cached_property
    def diameters(self) -> Array:
        """(N,) nodal diameter of each wave."""
        return (np.arange(self.blades) + 1) // 2

    @cached_property
    def waves(self) -> Array:
        """(N, N) orthonormal, by blade and wave: cosines and sines round the ring, by nodal diameter."""
        N, j = self.blades, np.arange(self.blades)
        E = np.empty((N, N))
        for i, n in enumerate(self.diameters):
            single = n == 0 or 2 * n == N
            angle = 2 * np.pi * n * j / N
            E[:, i] = (np.cos(angle) if i % 2 or single else np.sin(angle)) * np.sqrt((1 if single else 2) / N)
        return E

    @cached_property
    def basis(self) -> Array:
        """(N, y) e per unit of the first unknowns."""
        return self.waves[:, 1:] if self.shifting else np.eye(self.blades)

    def split(self, y: Array) -> tuple[Array, Array]:
        """e (N,) and the shifts (N//2 + 1,)."""
        count = self.basis.shape[1]
        return self.basis @ y[:count], y[count:] if self.shifting else np.zeros(len(self.tuned))

    def parts(self, shift: Array) -> tuple[Array, Array]:
        """(N,) angular frequencies omega_n and p_n of the waves."""
        omega = 2 * np.pi * self.tuned * (1 + shift)
        return omega[self.diameters], (omega * np.sqrt(self.share))[self.diameters]

    def stiffness(self, y: Array) -> Array:
        """(N, N) K in waves, s^-2."""
        e, shift = self.split(y)
        omega, p = self.parts(shift)
        return np.diag(omega**2) + 2 * p[:, None] * ((self.waves.T * e) @ self.waves) * p

    def slopes(self, y: Array, right: Array, left: Array) -> Array:
        """(m, q, y) left^T dK right over the unknowns, of the rows of right (m, N) and of left (q, N), in waves."""
        e, shift = self.split(y)
        omega, p = self.parts(shift)
        E = self.waves
        a, b = (p * right) @ E.T, (p * left) @ E.T  # by blade
        found = 2 * (a[:, None] * b) @ self.basis
        if not self.shifting:
            return found
        grown = (2 * omega**2 * right + 2 * p * ((e * a) @ E))[:, None] * left
        grown += (2 * p * right)[:, None] * ((e * b) @ E)
        first = self.diameters[:, None] == np.arange(len(self.tuned))
        return np.concatenate([found, grown @ first / (1 + shift)], axis=2)

    def start(self, measured: _Measured) -> Array:
        """Unknowns that leave least of (K - omega^2) phi over all modes; from the second step on each by what the
        noise of frequencies and shapes leaves of it, that of the frequencies at first taken too high, as K is."""
        y = np.zeros(self.basis.shape[1] + len(self.tuned) * self.shifting)
        phi, values, one = measured.waves, measured.omega**2, np.eye(self.blades)
        for more in (np.inf, 100.0, 30.0, 10.0, 3.0, 1.0):
            A = self.stiffness(y) - values[:, None, None] * one
            X = np.concatenate([self.slopes(y, phi, one), A @ phi[..., None]], axis=2)
            if np.isfinite(more):
                own = 2 * more * measured.frequency_noise * values[:, None] * phi
                noise = measured.shape_noise**2 * A @ A + own[:, :, None] * own[:, None]
                X = np.linalg.solve(np.linalg.cholesky(noise + (_ROUNDING * values.max()) ** 2 * one), X)
            X = X.reshape(-1, X.shape[2])
            y = y - np.linalg.lstsq(X[:, :-1], X[:, -1])[0]
        return y

    def identified(self, y: Array, left: Array, jacobian: Array) -> FromModes:
        """The deviations with their covariance, from the fit's residuals and their derivatives."""
        e, shift = self.split(y)
        count = self.basis.shape[1]
        every = covariance(jacobian)
        if every is None or 1 + 2 * e.min() <= 0:
            raise UserError("shapes: these modes do not tell all blades apart; measure more of them")
        out = self.basis / np.sqrt(1 + 2 * e)[:, None]
        own = out @ every[:count, :count] @ out.T
        shifts = np.sqrt(np.diag(every)[count:]) if self.shifting else np.zeros(len(self.tuned))
        beyond = len(left) - len(left) // (self.blades + 1) - jacobian.shape[1]  # a shape's scale is found as well
        d = np.sqrt(1 + 2 * e) - 1
        return FromModes(d, own, misfit(left, beyond), beyond, self.tuned * (1 + shift), self.tuned * shifts)


@dataclass(frozen=True, eq=False)
class _Measured:
    """Modes: (m,) angular frequencies and (m, N) shapes in waves, highest amplitude 1, with their noise."""

    omega: Array
    waves: Array
    frequency_noise: float
    shape_noise: float

    @classmethod
    def of(cls, ring: _Family, frequency: ArrayLike, shapes: ArrayLike, noise: float, shape_noise: float) -> _Measured:
        f, shapes = np.asarray(frequency, dtype=float), np.asarray(shapes)
        if f.ndim != 1 or shapes.shape != (len(f), ring.blades) or np.iscomplexobj(shapes):
            raise UserError("shapes: give a row of real amplitudes, one a blade, for each of the frequencies")
        if not (np.isfinite(f) & (f > 0)).all() or not np.isfinite(shapes).all() or not shapes.any(axis=1).all():
            raise UserError("frequency, shapes: must be finite, frequencies positive, and no shape zero everywhere")
        if not (noise > 0 and shape_noise > 0):
            raise UserError("frequency_noise, shape_noise: must be positive; intervals follow from them")
        highest = np.abs(shapes).max(axis=1, keepdims=True)
        return cls(2 * np.pi * f, (shapes / highest) @ ring.waves, noise, shape_noise)

    def compare(self, ring: _Family, y: Array) -> tuple[Array, Array]:
        """Modes of the ring less measured ones over the noise, and the derivatives: a frequency and N amplitudes each.

        Modes are paired by their shapes; the scale of a measured shape is the one that fits best.
        """
        values, modes = np.linalg.eigh(ring.stiffness(y))
        q = scipy.optimize.linear_sum_assignment(-np.abs(self.waves @ modes))[1]
        own = np.maximum(values[q], _ROUNDING * values[-1])
        changes = ring.slopes(y, modes[:, q].T, modes.T)  # modes^T dK mode
        apart = own[:, None] - values
        alike = np.abs(apart) <= _ROUNDING * values[-1]  # of two modes of one frequency any sum is one
        turning = np.where(alike, 0.0, 1 / np.where(alike, 1.0, apart))[..., None] * changes
        seen = self.waves @ modes
        fitted = np.where(alike, seen, 0.0)
        scale = np.take_along_axis(seen, q[:, None], 1)[..., None]
        moved = scale * turning  # of the fitted shape, over the modes: outside of its mode, and along it
        moved[np.arange(len(q)), q] += np.einsum("mq,mqy->my", seen, turning)
        slope = np.take_along_axis(changes, q[:, None, None], 1)[:, 0] / (2 * own * self.frequency_noise)[:, None]
        left = np.log(np.sqrt(own) / self.omega) / self.frequency_noise
        shape = (fitted - seen) @ modes.T / self.shape_noise
        moved = (modes @ moved).reshape(-1, len(y)) / self.shape_noise
        return np.concatenate([left, shape.ravel()]), np.vstack([slope, moved])
