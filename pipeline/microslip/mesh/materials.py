"""Materials that stand in a mesh file: from its constants to `Material` in SI."""

from __future__ import annotations

import numpy as np

from ..data import Array, Material
from ..elasticity import isotropic, orthotropic
from ..units import density, stress
from .raw import Damaged, DeckMaterial, Unread

_SAME = 1e-6


def isotropic_rows(name: str, rows: Array) -> tuple[Array, Array | None]:
    """Hooke matrix at the first temperature and the factor over temperature, from (t, 3) E, nu, temperature.

    Raises:
        Damaged: impossible constants; a Poisson's ratio that depends on temperature.
    """
    E, nu, T = rows.T
    if not (E > 0).all() or not ((nu > -1) & (nu < 0.5)).all() or not np.isfinite(rows).all():
        raise Damaged(f"the material '{name}' has E = {E[0]:g} and nu = {nu[0]:g}, which no solid has")
    if np.ptp(nu) > _SAME:
        raise Damaged(
            f"Poisson's ratio of the material '{name}' depends on temperature; only the modulus may (write the mean)"
        )
    if len(rows) == 1:
        return isotropic(E[0], nu[0]), None
    if (np.diff(T) <= 0).any():
        raise Damaged(f"the temperatures of the material '{name}' do not rise")
    return isotropic(E[0], nu[0]), np.column_stack([T, E / E[0]])


def orthotropic_row(name: str, c: Array) -> Array:
    """Hooke matrix in material axes from E1, E2, E3, nu12, nu13, nu23, G12, G13, G23.

    Raises:
        Damaged: constants of no stable material.
    """
    if not np.isfinite(c).all() or (c[[0, 1, 2, 6, 7, 8]] <= 0).any():
        raise Damaged(f"the material '{name}' has moduli that are not positive")
    try:
        return orthotropic(c[:3], c[[3, 5, 4]], c[[6, 8, 7]])
    except ValueError as error:
        raise Damaged(f"the material '{name}': {error}") from None


def in_si(found: DeckMaterial, system: str, zero: float = 0.0) -> Material:
    """A material of a file in SI.

    Args:
        system: of units, a key of `units.SYSTEMS`. zero: K of the file's temperature 0.

    Raises:
        Damaged: impossible or none. Unread: it is of another kind, or lacks constants or density.
    """
    at, line = f" of the cells '{found.where}'" if found.where else "", found.line or None
    if not found.name:
        raise Damaged(f"the cells '{found.where}' have no material" if found.where else "cells have no material")
    if found.refused:
        raise Unread(f"the material '{found.name}'{at} has {found.refused}")
    if found.elasticity is None:
        text = "has no elastic constants that are read (iso- or orthotropic)"
        raise Unread(f"the material '{found.name}'{at} {text}", file=line)
    if found.density is None:
        text = "has no density; give it one, no other can stand for it"
        raise Unread(f"the material '{found.name}'{at} {text}", file=line)
    if not 0 < found.density < np.inf:
        text = f"has a density of {found.density:g}; correct it"
        raise Unread(f"the material '{found.name}'{at} {text}", file=line)
    if not (np.isfinite(found.expansion).all() and np.isfinite(found.elasticity).all()):
        raise Damaged(f"the material '{found.name}'{at} holds a number that is not finite")
    table = None if found.temperature is None else found.temperature + np.array([zero, 0.0])
    return Material(
        found.density * density(system), found.elasticity * stress(system), found.expansion, table, found.name
    )
