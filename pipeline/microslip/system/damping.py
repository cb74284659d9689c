"""Damping of components: ratios by mode, as a loss factor, of stuck modes, what the flow adds to each travelling
wave."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..data import Array, ModalGroup
from ..errors import UserError, at, in_its_file
from ..files.store import ordinary
from ..reduced.coordinates import of_modes, own_shapes, own_stiffness
from ..ring.expansion import BACKWARD, FORWARD
from .component import Component
from .excitation import Turning, direction, index_of

BOTH = "both"
COLUMNS = ("nodal_diameter", "frequency_shift", "damping_ratio")


def with_ratios(group: ModalGroup, ratios: Sequence[float] | float) -> ModalGroup:
    """The group with other damping ratios D_j (Sextro Eq. (2.4-13)); rigid motions stay without.

    Args:
        ratios: one for all modes, or one a mode, the last one for all that follow.

    Raises:
        UserError: no ratio, or a negative one.
    """
    given = np.atleast_1d(np.asarray(ratios, dtype=float))
    if not len(given) or not np.isfinite(given).all() or (given < 0).any():
        raise UserError(
            "damping: ratios must be one or more numbers, none negative; flow that feeds a mode is aerodynamic"
        )
    padded = np.concatenate([given, np.full(max(len(group.omega) - len(given), 0), given[-1])])
    D = np.where(group.omega > 0, padded[: len(group.omega)], 0.0)
    return replace(group, damping_ratio=D, C_r=of_modes(group, 2 * D * group.omega))


def as_loss(group: ModalGroup) -> tuple[ModalGroup, Array]:
    """The group without its modal damping, and (m, m) H that takes its place: the stiffness K + i H of a vibration.

    H = sum_j 2 D_j omega_j^2 (M v_j)(M v_j)^H over the own modes v_j, and twice the last D of what K_r holds beside
    them: 2 D K_r where all D_j are equal. At the resonance of an own mode this damps as Sextro Eq. (2.4-13) does;
    elsewhere it takes the share 4 pi D of the elastic energy in every cycle, whatever the frequency.
    """
    P, D, omega = group.M_r @ own_shapes(group), group.damping_ratio, group.omega
    elastic = P @ own_stiffness(group.K_r, omega, group.to_diagonal, group.speed) @ P.conj().T
    H = of_modes(group, 2 * D * omega**2) + 2 * last_ratio(group) * (group.K_r - elastic)
    return replace(group, C_r=group.C_r - of_modes(group, 2 * D * omega)), 0.5 * (H + H.conj().T)


def last_ratio(group: ModalGroup) -> float:
    """Damping ratio of the highest own mode, which serves what the modes leave out."""
    return float(group.damping_ratio[-1]) if len(group.damping_ratio) and group.omega[-1] else 0.0


def structural(component: Component) -> Component:
    """The component with loss factors in the place of its modal damping, in every wave; see `as_loss`."""
    both = {k: as_loss(g) for k, g in component.groups.items()}
    last = 2 * last_ratio(component.groups[min(component.groups)])
    loss = {k: H for k, (_, H) in both.items()}
    return replace(component, groups={k: g for k, (g, _) in both.items()}, loss=loss, residual_loss=last)


@in_its_file
def read_aerodynamics(path: Path | str, blades: int, turning: Turning = 1) -> dict[int, complex]:
    """Relative frequency shift + i damping ratio of every wave of a ring, from a table.

    The file is .csv with the columns nodal_diameter, frequency_shift, damping_ratio and, where both directions differ,
    direction (``forward``: with the rotation, ``backward`` or ``both``).

    Returns:
        See `Component.aerodynamic`.

    Raises:
        UserError: a file that cannot be read, a wave that is missing, given twice or does not exist.
    """
    found: dict[int, complex] = {}
    for line, row in enumerate(_table(Path(path)), 2):
        with at(f"line {line}"):
            k, value, sense = _row(row)
            waves = {index_of(k, s, blades, turning) for s in ((FORWARD, BACKWARD) if sense == BOTH else (sense,))}
            if waves & set(found):
                raise UserError(f"nodal diameter {k}, {sense}, is given twice; remove one")
        found |= dict.fromkeys(waves, value)
    missing = [i for i in range(blades) if i not in found]
    if missing:
        words = ", ".join(_wave(i, blades, turning) for i in missing[:4]) + (", ..." if len(missing) > 4 else "")
        raise UserError(f"lacks the waves of {words}; add a line for each, with 0 where the flow does nothing")
    return found


def _table(path: Path) -> list[dict[str, str]]:
    try:
        with ordinary(path).open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(line for line in file if not line.startswith("#"))
            rows = [{str(k).strip(): str(v or "").strip() for k, v in row.items()} for row in reader]
            names = [str(n).strip() for n in reader.fieldnames or ()]
    except FileNotFoundError as error:
        raise UserError("there is no such table; correct the name") from error
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise UserError(f"cannot be read as comma-separated values ({error})") from error
    missing = [c for c in COLUMNS if c not in names]
    if missing:
        raise UserError(f"has no column {', '.join(missing)}; it needs {', '.join(COLUMNS)}")
    return rows


def _row(row: Mapping[str, str]) -> tuple[int, complex, str]:
    try:
        k, shift, ratio = int(row[COLUMNS[0]]), float(row[COLUMNS[1]]), float(row[COLUMNS[2]])
    except ValueError as error:
        raise UserError(f"{error}; a whole number and two numbers are needed") from error
    if not np.isfinite([shift, ratio]).all() or abs(shift) >= 0.5 or abs(ratio) >= 0.5:
        raise UserError("frequency_shift and damping_ratio are shares of 1, far below 0.5 in size; correct them")
    sense = row.get("direction") or BOTH
    if sense not in (FORWARD, BACKWARD, BOTH):
        raise UserError(f"direction: '{sense}' must be forward, backward or both")
    return k, complex(shift, ratio), sense


def _wave(index: int, blades: int, turning: Turning) -> str:
    k, sense = direction(index, blades, turning)
    return f"nodal diameter {k}, {sense}"


def total_damping(component: Component, index: int) -> Array:
    """(modes,) damping ratios in the wave of a ring's index, the body's own and the flow's."""
    at = component.at(index)
    return np.where(at.group.omega > 0, at.group.damping_ratio + at.aerodynamic.imag, 0.0)


def unstable(component: Component, blades: int, turning: Turning = 1) -> list[str]:
    """A sentence for every mode and wave to which the flow gives more energy than the body's damping takes."""
    found = []
    for index in range(max(blades, 1)):
        try:
            D = total_damping(component, index)
        except UserError:  # a wave that the modal file does not hold is not asked for
            continue
        for j in np.flatnonzero(D < 0):
            f = component.at(index).group.omega[j] / (2 * np.pi)
            found.append(
                f"{component.name}: mode {j + 1} ({f:.5g} Hz) of {_wave(index, blades, turning)}, has a total damping "
                f"ratio of {D[j]:.3g}: without friction it grows by itself."
            )
    return found
