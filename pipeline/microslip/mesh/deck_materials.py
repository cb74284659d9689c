"""Of an Abaqus or CalculiX input file: materials, orientations, and the cells that sections give them to."""

from __future__ import annotations

import numpy as np

from ..data import Array
from ..elasticity import turned, turned_strain
from ..errors import of_file
from ..frames import rotation
from .cards import Card, numbers
from .deck import Deck, DeckConstants, Readers
from .materials import isotropic_matrices, isotropic_rows, orthotropic_row
from .raw import Damaged, DeckMaterial, RawMesh, real


def _read_material(deck: Deck, card: Card) -> None:
    name = card.text("NAME")
    if not name:
        raise Damaged("a *MATERIAL has no name")
    deck.current = name.upper()
    deck.materials[deck.current] = DeckConstants(name, card.place)


def _of(deck: Deck, keyword: str) -> DeckConstants:
    if not deck.current:
        raise Damaged(f"*{keyword} stands before any *MATERIAL")
    return deck.materials[deck.current]


def _read_elastic(deck: Deck, card: Card) -> None:
    material, kind = _of(deck, "ELASTIC"), " ".join(card.word("TYPE", "ISO").split())
    rows = numbers(card.lines, f"*ELASTIC of {material.name}")
    what = f"*ELASTIC, TYPE={kind} of the material {material.name}"
    if kind.startswith("ISO"):
        if any(len(row) not in (2, 3) for row in rows) or not rows:
            raise Damaged(f"{what} needs E, nu and perhaps a temperature a line")
        material.isotropic = np.array([[*row, 0.0][:3] for row in rows])
        return
    values = np.array([v for row in rows for v in row])
    if kind not in ("ENGINEERING CONSTANTS", "ORTHO", "ORTHOTROPIC"):
        material.refused = f"*ELASTIC, TYPE={kind}"
        return
    if len(values) == 9:
        values = np.append(values, 0.0)
    if not len(values) or len(values) % 10:
        material.refused = f"{what} with {len(values)} numbers (nine and a temperature are read)"
    elif (np.diff(values[9::10]) <= 0).any():
        raise Damaged(f"the temperatures of {what} do not rise")
    elif kind == "ENGINEERING CONSTANTS":
        material.orthotropic = values.reshape(-1, 10)
    else:
        material.stiffness = values.reshape(-1, 10)


def _read_density(deck: Deck, card: Card) -> None:
    material = _of(deck, "DENSITY")
    rows = numbers(card.lines, f"*DENSITY of {material.name}")
    if not rows or not rows[0]:
        raise Damaged(f"*DENSITY of the material {material.name} holds no number")
    if len({row[0] for row in rows}) > 1:
        material.densities = np.array([[*row, 0.0][:2] for row in rows])
        if (np.diff(material.densities[:, 1]) <= 0).any():
            raise Damaged(
                f"the temperatures of *DENSITY of the material {material.name} do not rise"
            )
    material.density = rows[0][0]


def _read_expansion(deck: Deck, card: Card) -> None:
    material, kind = _of(deck, "EXPANSION"), card.word("TYPE", "ISO")
    rows = numbers(card.lines, f"*EXPANSION of {material.name}")
    count = 3 if kind.startswith("ORTHO") else 1
    if not rows or any(len(row) not in (count, count + 1) for row in rows) or kind.startswith("ANISO"):
        raise Damaged(f"*EXPANSION, TYPE={kind} of the material {material.name} is not read; use ISO or ORTHO")
    values = np.array([row[:count] for row in rows])
    material.zero = real(card.text("ZERO") or "0", "*EXPANSION, ZERO")
    material.expansion = np.broadcast_to(values[0], 3).copy()
    if not np.ptp(values, axis=0).any():
        return
    T, first = np.array([[*row, 0.0][count] for row in rows]), np.abs(values[0]).argmax()
    factor = values[:, first] / values[0, first] if values[0, first] else np.zeros(len(T))
    if (np.diff(T) <= 0).any():
        raise Damaged(f"the temperatures of *EXPANSION of the material {material.name} do not rise")
    if not np.allclose(values, factor[:, None] * values[0], rtol=1e-9, atol=0):
        material.refused = "an expansion whose axes depend on temperature differently"
    material.expansion_table = np.column_stack([T, factor])


def _read_section(deck: Deck, card: Card) -> None:
    deck.sections.append(card)


def _read_orientation(deck: Deck, card: Card) -> None:
    name, system = card.text("NAME"), card.word("SYSTEM", "RECTANGULAR")
    key = name.upper()
    if not system.startswith("R") or card.word("DEFINITION", "COORDINATES") != "COORDINATES":
        deck.orientations[key] = f"*ORIENTATION, NAME={name} of the system {system}"
        return
    rows = numbers(card.lines, f"*ORIENTATION, NAME={name}")
    if not rows or len(rows[0]) not in (6, 9):
        raise Damaged(f"*ORIENTATION, NAME={name} needs the six coordinates of two points")
    origin = np.array(rows[0][6:9]) if len(rows[0]) == 9 else np.zeros(3)
    a, b = np.array(rows[0][:3]) - origin, np.array(rows[0][3:6]) - origin
    normal = np.cross(a, b)
    if not np.linalg.norm(normal) > 1e-9 * np.linalg.norm(a) * np.linalg.norm(b):
        raise Damaged(f"the points of *ORIENTATION, NAME={name} lie on a line")
    x, z = a / np.linalg.norm(a), normal / np.linalg.norm(normal)
    axes = np.array([x, np.cross(z, x), z])
    if len(rows) > 1 and len(rows[1]) > 1 and rows[1][1]:
        if rows[1][0] not in (1, 2, 3):
            raise Damaged(f"*ORIENTATION, NAME={name} turns about the axis {rows[1][0]:g}, which is none of 1, 2, 3")
        axes = axes @ rotation(axes[int(rows[1][0]) - 1], np.radians(rows[1][1])).T
    deck.orientations[key] = axes


def assign_materials(deck: Deck, raw: RawMesh) -> None:
    """A region for every pair of material and orientation that sections give to cells."""
    if not deck.materials:
        return
    raw.regions = [np.full(len(cells.ids), -1) for cells in deck.solids]
    known: dict[tuple[str, str], int] = {}
    for card in deck.sections:
        elset, material, orientation = map(card.text, ("ELSET", "MATERIAL", "ORIENTATION"))
        section = f"*SOLID SECTION, ELSET={elset}"
        with of_file(card.place):
            if material.upper() not in deck.materials:
                raise Damaged(f"{section} names the material '{material}', which is not defined")
            axes = deck.key(deck.orientations, orientation, card.space) if orientation else ""
            if axes is None:
                raise Damaged(f"{section} names the orientation '{orientation}', which is not defined")
            chosen = deck.cells_for("*SOLID SECTION", elset, card.space)
        key = (material.upper(), axes)
        if key not in known:
            known[key] = len(raw.materials)
            raw.materials.append(_deck_material(deck, key, elset))
        for cells, region in zip(deck.solids, raw.regions, strict=True):
            region[np.isin(cells.ids, chosen)] = known[key]
    bare = [cells.ids[region < 0] for cells, region in zip(deck.solids, raw.regions, strict=True)]
    if count := sum(map(len, bare)):
        first = next(int(ids[0]) for ids in bare if len(ids))
        raw.materials.append(DeckMaterial("", None, None, np.zeros(6), where=f"{count} cells from number {first} on"))
        for region in raw.regions:
            region[region < 0] = len(raw.materials) - 1


def _weighed(deck: Deck, found: DeckConstants) -> None:
    """Density over temperature as it is while free of strain, which the mass of the drawn body is made of."""
    if found.densities is None:
        return
    free = {value for column, _, value in deck.temperatures if column == 0} or {0.0}
    rho, T = found.densities.T
    if len({*np.interp(list(free), T, rho).tolist()}) > 1:
        found.refused = "a density that depends on temperature, and initial temperatures that vary"
    found.density = float(np.interp(min(free), T, rho))
    text = f"*DENSITY of {found.name} is {found.density:g} at the initial temperature; heat takes no mass away"
    deck.remarks.append(
        f"{found.where.rpartition('/')[2]}: {text}, though CalculiX has another at another temperature"
    )


def _deck_material(deck: Deck, key: tuple[str, str], where: str) -> DeckMaterial:
    found = deck.materials[key[0]]
    _weighed(deck, found)
    turn = deck.orientations[key[1]] if key[1] else None
    axes = None if isinstance(turn, str) else turn
    if refused := found.refused or (turn if isinstance(turn, str) else ""):
        text = f"{refused}, which is not read; write another form, or give density and stiffness in a body.toml"
        return DeckMaterial(found.name, None, found.density, np.zeros(6), None, where, text)
    C, table, matrices = None, None, None
    if found.isotropic is not None:
        with of_file(found.where):
            matrices = isotropic_matrices(found.name, found.isotropic)
            if matrices is None:
                C, table = isotropic_rows(found.name, found.isotropic)
    elif found.orthotropic is not None:
        rows = found.orthotropic
        matrices = rows[:, 9], np.array([orthotropic_row(found.name, row[:9]) for row in rows])
    elif found.stiffness is not None:
        rows = found.stiffness
        matrices = (
            rows[:, 9],
            np.array([_orthotropic_stiffness(found.name, row[:9]) for row in rows]),
        )
    if matrices is not None:
        if axes is not None:
            matrices = matrices[0], np.array([turned(matrix, axes) for matrix in matrices[1]])
        C, matrices = matrices[1][0], matrices if len(matrices[0]) > 1 else None
    elif C is not None and axes is not None:
        C = turned(C, axes)
    return DeckMaterial(
        found.name,
        C,
        found.density,
        turned_strain(found.expansion, axes),
        table,
        where,
        line=found.where,
        stiffness_table=matrices,
        expansion_table=found.expansion_table,
        zero=found.zero,
    )


def _orthotropic_stiffness(name: str, d: Array) -> Array:
    """Hooke matrix from D1111, D1122, D2222, D1133, D2233, D3333, D1212, D1313, D2323."""
    C = np.diag([d[0], d[2], d[5], d[6], d[8], d[7]])
    C[0, 1] = C[1, 0] = d[1]
    C[0, 2] = C[2, 0] = d[3]
    C[1, 2] = C[2, 1] = d[4]
    if not np.isfinite(C).all() or np.linalg.eigvalsh(C).min() <= 0:
        raise Damaged(f"the stiffness of the material '{name}' is not positive definite")
    return C


READERS: Readers = {
    "MATERIAL": _read_material,
    "ELASTIC": _read_elastic,
    "DENSITY": _read_density,
    "EXPANSION": _read_expansion,
    "SOLID SECTION": _read_section,
    "ORIENTATION": _read_orientation,
}
