"""Deviations of blades as a fit leaves them: with covariance, intervals, and whether the fit is one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, ndtri

from ..data import Array

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
