"""Materials that stand in a mesh file: from its constants to `Material` in SI."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Array, Material
from ..elasticity import isotropic, orthotropic
from ..units import density, stress
from .raw import Damaged, DeckMaterial, Unread

_SAME = 1e-6


def isotropic_rows(name: str, rows: Array) -> tuple[Array, Array | None]:
    """Hooke matrix at the first temperature and the factor over temperature, from (t, 3) E, nu, temperature.

    Raises:
        Damaged: impossible constants; a Poisson's ratio that depends on temperature (see
        `isotropic_matrices`).
    """
    E, nu, T = rows.T
    if not (E > 0).all() or not ((nu > -1) & (nu < 0.5)).all() or not np.isfinite(rows).all():
        raise Damaged(
            f"the material '{name}' has E = {E[0]:g} and nu = {nu[0]:g}, which no solid has"
        )
    if np.ptp(nu) > _SAME:
        raise Damaged(
            f"Poisson's ratio of the material '{name}' depends on temperature; only the modulus may (write the mean)"
        )
    if len(rows) == 1:
        return isotropic(E[0], nu[0]), None
    if (np.diff(T) <= 0).any():
        raise Damaged(f"the temperatures of the material '{name}' do not rise")
    return isotropic(E[0], nu[0]), np.column_stack([T, E / E[0]])


def isotropic_matrices(name: str, rows: Array) -> tuple[Array, Array] | None:
    """Temperatures and Hooke matrices where Poisson's ratio depends on temperature, else None.

    E and nu are linear between the rows (t, 3) E, nu, temperature, which a hundred matrices between
    two of them follow to 1e-6.
    """
    E, nu, T = rows.T
    if np.ptp(nu) <= _SAME or not np.isfinite(rows).all() or (np.diff(T) <= 0).any():
        return None
    fine = np.unique(
        np.concatenate([np.linspace(a, b, 101) for a, b in zip(T[:-1], T[1:], strict=True)])
    )
    if not (E > 0).all() or not ((nu > -1) & (nu < 0.5)).all():
        raise Damaged(f"the material '{name}' has E = {E[0]:g} and nu = {nu[0]:g}, which no solid has")
    return fine, np.array([isotropic(np.interp(t, T, E), np.interp(t, T, nu)) for t in fine])


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


@dataclass(frozen=True)
class Substitute:
    """Numbers in SI that stand where a material of a file lacks them; None: none does.

    Attributes:
        density: kg/m3. young: Pa. poisson: Poisson's ratio. whole: whether young stands for a material of a kind that
            is not read, too.
    """

    density: float | None = None
    young: float | None = None
    poisson: float | None = None
    whole: bool = True


NONE = Substitute()

STANDS = (
    "what stands in brackets is taken; [material] of body.toml, or import's --density, --young, "
    "--poisson, give another"
)
"""End of what is said of a number that a material lacks."""


def in_si(
    found: DeckMaterial, system: str, zero: float = 0.0, instead: Substitute = NONE
) -> tuple[Material, str]:
    """A material of a file in SI, and what is said of numbers that it lacks; empty if there are none.

    Args:
        system: of units, a key of `units.SYSTEMS`. zero: K of the file's temperature 0. instead: of what it lacks.

    Raises:
        Damaged: impossible or none. Unread: it is of another kind, or lacks constants or density.
    """
    at, line = f" of the cells '{found.where}'" if found.where else "", found.line or None
    name = f"the material '{found.name}'{at}" if found.name else f"the material{at}"
    whole, table = found.elasticity, found.temperature
    C, lacking = (None if whole is None else whole * stress(system)), []
    if found.refused and (instead.young is None or not instead.whole):
        raise Unread(f"{name} has {found.refused} (or --young and --density for all of it)", file=line)
    if C is None or found.refused:
        C, table = _isotropic(found, system, instead), None
        if C is not None:
            E, nu = _young(found, system, instead), _poisson(found, instead)
            lacking.append(f"elastic constants that suffice (E {E:.4g} Pa, nu {nu:g})")
    if C is None:
        text = "has no elastic constants that are read (iso- or orthotropic)" if found.name else "is missing"
        raise Unread(f"{name} {text}", file=line)
    rho = None if not found.density else found.density * density(system)
    if rho is None and instead.density is not None:
        rho = instead.density
        lacking.append(f"density ({rho:g} kg/m3)")
    if rho is None:
        text = "has no density; give it one, no other can stand for it"
        raise Unread(f"{name} {text}", file=line)
    if not 0 < rho < np.inf:
        text = f"has a density of {found.density:g}; correct it"
        raise Unread(f"{name} {text}", file=line)
    if not (np.isfinite(found.expansion).all() and np.isfinite(C).all()):
        raise Damaged(f"{name} holds a number that is not finite")
    if table is not None:
        table = table + np.array([zero, 0.0])
    matrices, grown = found.stiffness_table, found.expansion_table
    if matrices is not None:
        matrices = matrices[0] + zero, matrices[1] * stress(system)
    grown = None if grown is None else grown + np.array([zero, 0.0])
    place = f"{line}: " if line else ""
    said = f"{place}{name} has no {' and no '.join(lacking)}: {STANDS}" if lacking else ""
    name = found.name or "material"
    return Material(rho, C, found.expansion, table, name, matrices, grown, found.zero + zero), said


def _poisson(found: DeckMaterial, instead: Substitute) -> float | None:
    return instead.poisson if found.poisson is None else found.poisson


def _young(found: DeckMaterial, system: str, instead: Substitute) -> float | None:
    """Pa: the file's, that of its shear modulus, or another."""
    nu = _poisson(found, instead)
    if found.young is not None:
        return found.young * stress(system)
    if found.shear is not None and nu is not None:
        return 2 * found.shear * stress(system) * (1 + nu)
    return instead.young


def _isotropic(found: DeckMaterial, system: str, instead: Substitute) -> Array | None:
    """Hooke matrix, Pa, of what there is and what stands for the rest; None if that is not all."""
    E, nu = _young(found, system, instead), _poisson(found, instead)
    if E is None or nu is None:
        return None
    return isotropic_rows(found.name, np.array([[E, nu, 0.0]]))[0]
