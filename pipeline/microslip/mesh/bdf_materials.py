"""Of Nastran bulk data: what the properties of solids are made of, at the temperatures of a subcase.

MATT1 names a table for each constant of a MAT1: TABLEM1 y(T), TABLEM2 Z y(T - X1), TABLEM3 Z y((T - X1)/X2),
TABLEM4 Z times a polynomial of (T - X1)/X2 between X3 and X4, with Z the constant itself; beyond their
ends the first three go on as straight lines (Quick Reference Guide).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..data import Array
from ..elasticity import isotropic, strain_tensor, turned, turned_strain
from .bdf_cards import Bulk, BulkCard, at_card
from .materials import isotropic_rows, orthotropic_row
from .raw import Damaged, DeckMaterial

KINDS = ("MAT1", "MAT2", "MAT3", "MAT8", "MAT9", "MAT10", "MAT11", "MATHP", "MATHE")
PROPERTIES = ("PCOMPS", "PLSOLID", "PCOMPLS", "PSOLID")
TABLES = ("TABLEM1", "TABLEM2", "TABLEM3", "TABLEM4")
_LIGHT = 1e-9
"""Share of the largest density that a solid without mass has: its matrix stays definite."""
_SAMPLES = 2001
"""Temperatures at which a polynomial stands in a table."""
_REFUSED = {
    "PCOMPS": "layers, which are not read; write PSOLID with a MAT9 of the laminate",
    "PCOMPLS": "layers, which are not read; write PSOLID with a MAT9 of the laminate",
    "PLSOLID": "a hyperelastic material without A10 and A01 of a MATHP; write a MAT1 of small strains",
}


def materials_of(
    bulk: Bulk, properties: Sequence[int], temperature: Array | None
) -> list[DeckMaterial]:
    """Of each property.

    Args:
        temperature: (n,) at which the materials are taken, None: as MAT1 has them.

    Raises:
        Damaged: with file and line, impossible constants, tables that are not there.
    """
    made = [_material(bulk, number, temperature) for number in properties]
    heaviest = max((material.density or 0.0 for material in made), default=0.0)
    for number, material in enumerate(made):
        if (
            heaviest
            and not material.density
            and material.elasticity is not None
            and not material.refused
        ):
            made[number] = replace(material, density=_LIGHT * heaviest)
            bulk.raw.remarks.append(
                f"{material.line} has no density: its cells weigh nothing, as in Nastran, where others "
                f"have one ({_LIGHT:g} of the heaviest is taken)"
            )
    return made


def stress_free(bulk: Bulk, properties: Sequence[int]) -> list[float]:
    """Temperatures TREF of the materials of properties, each once."""
    places = {"MAT1": 7, "MAT9": 30, "MAT11": 15}
    solids = [c for p in properties for c in bulk.numbered(["PSOLID"], p)]
    found = [
        card.real(places[card[0]]) or 0.0
        for solid in solids
        for card in bulk.numbered(places, solid.whole(2, 0))
    ]
    return list(dict.fromkeys(found))


def _material(bulk: Bulk, property_: int, temperature: Array | None) -> DeckMaterial:
    where, nothing = f"PSOLID {property_}", np.zeros(6)
    for other in bulk.numbered(PROPERTIES[:-1], property_):
        made = _hyperelastic(bulk, other) if other[0] == "PLSOLID" else None
        name = f"{other[0]} {property_}"
        return made or DeckMaterial(
            name, None, None, nothing, refused=_REFUSED[other[0]], line=other.where
        )
    solid = next(bulk.numbered(["PSOLID"], property_), None)
    if solid is None:
        return DeckMaterial(
            "", None, None, nothing, where=f"property {property_}, which no PSOLID defines"
        )
    number = solid.whole(2, 0)
    for card in bulk.numbered(["MAT1"], number):
        return _isotropic(bulk, card, where, temperature)
    for card in bulk.numbered(["MAT9", "MAT11"], number):
        nine, line = card[0] == "MAT9", card.where
        density = _mass(bulk, card.real(23 if nine else 11))
        axes, refused = _material_axes(bulk, solid)
        if refused:
            return DeckMaterial(card.name, None, density, nothing, None, where, refused, line)
        if nine:
            C, expansion = _anisotropic(card)
            C, expansion = turned(C, axes), _turned_expansion(expansion, axes)
        else:
            C = turned(orthotropic_row(card.name, card.reals(2, 9)), axes)
            expansion = turned_strain(card.reals(12, 3), axes)
        return DeckMaterial(card.name, C, density, expansion, where=where, line=line)
    for card in (c for m in KINDS for c in bulk.cards[m] if c.at(1) == str(number)):
        refused = (
            "a form that is not read; write it as MAT1, MAT9 or MAT11, or give it in a body.toml"
        )
        return DeckMaterial(card.name, None, None, nothing, None, where, refused, card.where)
    return DeckMaterial(f"MAT1 {number} (missing)", None, None, nothing, where=where)


def _mass(bulk: Bulk, density: float | None) -> float | None:
    """Density: PARAM,WTMASS turns a weight into a mass."""
    factor = bulk.parameter("WTMASS")
    return density if density is None or factor is None else density * factor


def _hyperelastic(bulk: Bulk, property_: BulkCard) -> DeckMaterial | None:
    """Of MATHP at small strains: G = 2 (A10 + A01), K = 2 D1 (Quick Reference Guide, MATHP)."""
    for card in bulk.numbered(["MATHP"], property_.whole(2, 0)):
        A, D = card.reals(2, 2).sum(), card.real(4)
        if not A > 0:
            return None
        G, K = 2 * A, 2 * (1000 * A if D is None else D)
        E, nu = 9 * K * G / (3 * K + G), (3 * K - 2 * G) / (6 * K + 2 * G)
        bulk.raw.remarks.append(f"{card.where}: taken at small strains: E {E:.4g}, nu {nu:.4g}")
        expansion = turned_strain(np.full(3, card.real(6) or 0.0), None)
        where = f"PLSOLID {property_[1]}"
        return DeckMaterial(
            card.name,
            isotropic(E, nu),
            _mass(bulk, card.real(5)),
            expansion,
            where=where,
            line=card.where,
        )
    return None


def _isotropic(bulk: Bulk, card: BulkCard, where: str, temperature: Array | None) -> DeckMaterial:
    E, G, nu, rho, along = map(card.real, range(2, 7))
    name, line, table, nothing = card.name, card.where, None, np.zeros(6)
    for hot in bulk.numbered(["MATT1"], card.whole(1)):
        if temperature is None:
            bulk.raw.remarks.append(
                f"{hot.where}: the case control chooses no temperatures of materials, so {name} stands as it is"
            )
            continue
        tables = {k: _table(bulk, hot, hot.whole(k)) for k in range(2, 7) if hot.whole(k, 0)}
        least, most = float(np.nanmin(temperature)), float(np.nanmax(temperature))
        values = dict(zip(range(2, 7), (E, G, nu, rho, along), strict=True))
        even = most - least <= 1e-9 * max(abs(least), abs(most), 1.0)
        varied = [k for k in tables if k != 2 or even or (nu is None and G is not None)]
        for k in varied:
            values[k] = float(tables[k](np.array([(least + most) / 2]), values[k])[0])
        if varied and not even:
            bulk.raw.lost.append(
                f"{hot.where}: of constants over temperature the modulus alone varies over the body; the others are "
                f"those at {(least + most) / 2:.6g}"
            )
        E, G, nu, rho, along = (values[k] for k in range(2, 7))
        if 2 in tables and 2 not in varied:
            T = np.linspace(least, most, _SAMPLES)
            moduli = tables[2](T, E)
            E = float(moduli[0])
            table = np.column_stack([T, moduli / E])
    if not E and G and nu is not None:
        E = 2 * G * (1 + nu)
    if nu is None and E and G:
        nu = E / (2 * G) - 1
    density = _mass(bulk, rho)
    if not E or nu is None:
        return DeckMaterial(
            name, None, density, nothing, None, where, line=line, young=E, poisson=nu, shear=G
        )
    try:
        C, _ = isotropic_rows(name, np.array([[E, nu, 0.0]]))
    except Damaged as error:
        raise Damaged(f"{card.place}: {error.args[0]}; correct it") from None
    if table is not None and not (table[:, 1] > 0).all():
        raise Damaged(
            f"{line} has a modulus that is not positive at the temperatures of the file; correct its table"
        )
    expansion = turned_strain(np.full(3, along or 0.0), None)
    return DeckMaterial(name, C, density, expansion, table, where=where, line=line)


def _table(bulk: Bulk, hot: BulkCard, number: int) -> Callable[[Array, float | None], Array]:
    """The constant over temperature, of temperatures (t,) and the value Z of the card itself.

    Raises:
        Damaged: there is no such table, or one of another form.
    """
    card = next(bulk.numbered(TABLES, number), None)
    if card is None:
        raise Damaged(
            f"{hot.where} names the table {number}, which no TABLEM1 to TABLEM4 defines; add it"
        )
    kind, shift, scale = card[0][-1], card.real(2) if card[0][-1] != "1" else 0.0, 1.0
    if kind in "34":
        scale = card.real(3) or 0.0
        if not scale:
            raise Damaged(f"{card.where} divides by X2 = 0; correct it")
    if kind == "1" and not {card.at(2), card.at(3)} <= {"", "LINEAR"}:
        raise Damaged(
            f"{card.where} has logarithmic axes, which are not read; write a table with linear ones"
        )
    words = card[9:]
    ends = words.index("ENDT") if "ENDT" in words else len(words)
    places = [p for p in range(9, 9 + ends) if card[p] and card[p] != "SKIP"]
    if kind == "4":
        a = card.reals(9, max(places, default=8) - 8)
        low, high = card.real(4), card.real(5)

        def polynomial(T: Array, Z: float | None) -> Array:
            x = (np.clip(T, low, high) - (shift or 0.0)) / scale
            return (1.0 if Z is None else Z) * np.polynomial.polynomial.polyval(x, a)

        return polynomial
    numbers = np.array([card.real(p) or 0.0 for p in places])
    if len(numbers) < 4 or len(numbers) % 2:
        raise Damaged(f"{card.where} needs two pairs of temperature and value at least; correct it")
    x, y = numbers.reshape(-1, 2).T
    if (np.diff(x) <= 0).all():
        x, y = x[::-1], y[::-1]
    if (np.diff(x) < 0).any() or x[0] == x[1] or x[-1] == x[-2]:
        raise Damaged(f"{card.where} has temperatures that neither rise nor fall; correct it")
    level = kind == "1" and card.at(4) == "1"

    def lines(T: Array, Z: float | None) -> Array:
        at = (T - (shift or 0.0)) / scale
        found = np.interp(at, x, y)
        for end, beyond in ((0, at < x[0]), (-2, at > x[-1])):
            if not level:
                slope = (y[end + 1] - y[end]) / (x[end + 1] - x[end])
                found = np.where(beyond, y[end] + slope * (at - x[end]), found)
        return found if kind == "1" else (1.0 if Z is None else Z) * found

    return lines


def _material_axes(bulk: Bulk, solid: BulkCard) -> tuple[Array, str]:
    """(3, 3) rows: the material's axes by CORDM of a PSOLID, or why they are not read."""
    number = int(solid.at(3) or 0) if re.fullmatch(r"-?\d*", solid.at(3)) else -1
    remedy = "write a rectangular CORDM, or give density and stiffness in a body.toml"
    if number < 0:
        return np.eye(
            3
        ), f"directions of each cell (CORDM {solid.at(3)}), which are not read; {remedy}"
    with at_card(solid):
        system = bulk.systems[number]
    if system.kind:
        return np.eye(
            3
        ), f"directions that turn along the body (CORDM {number}), which are not read; {remedy}"
    return system.axes, ""


def _anisotropic(card: BulkCard) -> tuple[Array, Array]:
    """Hooke matrix and expansions (6,) of a MAT9 in its axes, order xx, yy, zz, xy, yz, zx.

    Raises:
        Damaged: a matrix that is not positive definite.
    """
    C = np.zeros((6, 6))
    C[np.triu_indices(6)] = card.reals(2, 21)
    C = C + np.triu(C, 1).T
    if not np.linalg.eigvalsh(C).min() > 0:
        raise Damaged(f"{card.where} has a matrix that is not positive definite")
    return C, card.reals(24, 6)


def _turned_expansion(strain: Array, axes: Array) -> Array:
    """(6,) strain with engineering shear, xx, yy, zz, xy, yz, zx, in body axes."""
    tensor = axes.T @ strain_tensor(strain) @ axes
    return np.concatenate([np.diag(tensor), 2 * tensor[[0, 1, 0], [1, 2, 2]]])
