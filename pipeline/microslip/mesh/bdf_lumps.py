"""Of Nastran bulk data: concentrated masses, scalar springs and dampers, bushes, rigid bars."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..data import Array, Link, LumpedElement, PointMass, RigidLink
from ..frames import skew
from .bdf_cards import Bulk, BulkCard
from .raw import Damaged, lost

READ = {
    "CONM1", "CONM2", "CELAS1", "CELAS2", "PELAS", "CDAMP1", "CDAMP2", "PDAMP", "CBUSH", "PBUSH", "RBAR",
}  # fmt: skip


def lumps_of(bulk: Bulk) -> list[PointMass | LumpedElement]:
    """The lumped elements of bulk data, nodes by their positions in the file.

    Raises:
        Damaged: with the card, what is wrong with one.
    """
    factor = bulk.parameter("WTMASS")
    scale = 1.0 if factor is None else factor
    return [*_masses(bulk, scale), *_scalars(bulk), *_bushes(bulk)]


def _masses(bulk: Bulk, scale: float) -> Iterator[PointMass]:
    for card in bulk.cards["CONM2"]:
        node, system = int(bulk.positions(card, [card.whole(2)])[0]), card.whole(3, 0)
        m, x = card.real(4) or 0.0, np.array([card.real(p) or 0.0 for p in (5, 6, 7)])
        xx, xy, yy, xz, yz, zz = (card.real(p) or 0.0 for p in range(9, 15))
        J = np.array([[xx, -xy, -xz], [-xy, yy, -yz], [-xz, -yz, zz]])
        if system == -1:
            x = x - bulk.raw.points[node]
        elif system and not (x.any() or _round(J)):
            pass  # alike in every system
        elif system:
            Q = bulk.frame(card, system, bulk.raw.points[node])
            x, J = Q.T @ x, Q.T @ J @ Q
        _refuse_impossible(bulk, card, m, J)
        yield PointMass(card.where, node, scale * m, x, scale * J)
    for card in bulk.cards["CONM1"]:
        M, at = np.zeros((6, 6)), 4
        for i in range(6):
            for j in range(i + 1):
                M[i, j] = M[j, i] = card.real(at) or 0.0
                at += 1
        m = M[0, 0]
        c = np.array([M[1, 5] - M[2, 4], M[2, 3] - M[0, 5], M[0, 4] - M[1, 3]]) / (2 * m) if m else np.zeros(3)
        J = M[3:, 3:] + m * skew(c) @ skew(c)
        size = np.abs(M).max() or 1.0
        rigid = np.block([[m * np.eye(3), -m * skew(c)], [m * skew(c), M[3:, 3:]]])
        if card.whole(3, 0) or np.abs(rigid - M).max() > 1e-6 * size:
            bulk.raw.lost.append(lost(card.where, "a CONM1 that is no rigid body in the basic system"))
            continue
        _refuse_impossible(bulk, card, m, J)
        yield PointMass(card.where, int(bulk.positions(card, [card.whole(2)])[0]), scale * m, c, scale * J)


def _round(J: Array) -> bool:
    """Whether a tensor differs from a multiple of the identity."""
    return bool(np.abs(J - np.trace(J) / 3 * np.eye(3)).max() > 0)


def _refuse_impossible(bulk: Bulk, card: BulkCard, m: float, J: Array) -> None:
    if m < 0 or np.linalg.eigvalsh(J)[0] < -1e-9 * np.abs(J).max():
        raise Damaged(f"{card.where} has a mass or inertia below 0; correct it")


def _scalars(bulk: Bulk) -> Iterator[LumpedElement]:
    """CELAS1, CELAS2, CDAMP1, CDAMP2 between components of grid points, or one and the ground."""
    for name in ("CELAS1", "CELAS2", "CDAMP1", "CDAMP2"):
        for card in bulk.cards[name]:
            value = card.real(2) if name[-1] == "2" else _property(bulk, card, f"P{name[1:-1]}")
            ends = [(card.whole(p, 0), card.whole(p + 1, 0)) for p in (3, 5)]
            ends = [(node, way) for node, way in ends if node]
            if any(not 1 <= way <= 6 for _, way in ends) or not ends:
                bulk.raw.lost.append(lost(card.where, f"{card.name} on scalar points"))
                continue
            basic, signs = np.eye(3), (1.0, -1.0)
            axes = [sign * bulk.held.axes.get(n, basic)[(w - 1) % 3] for (n, w), sign in zip(ends, signs, strict=False)]
            row = np.concatenate(axes)
            used = row != 0
            A = (value or 0.0) * np.outer(row[used], row[used])
            zero = np.zeros_like(A)
            nodes = np.repeat(bulk.positions(card, [node for node, _ in ends]), 3)[used]
            ways = np.concatenate([3 * ((way - 1) // 3) + np.arange(3) for _, way in ends])[used]
            both = (A, zero) if name[1] == "E" else (zero, A)
            yield LumpedElement(card.where, nodes, ways, *both)


def _property(bulk: Bulk, card: BulkCard, kind: str) -> float:
    """The value of PELAS (four fields a property) or PDAMP (two)."""
    number, step = card.whole(2, card.whole(1)), 4 if kind == "PELAS" else 2
    for other in bulk.cards[kind]:
        for place in range(1, min(len(other), 9), step):
            if other.at(place) == str(number):
                return other.real(place + 1) or 0.0
    raise Damaged(f"{card.where} names {kind} {number}, which is not there")


def _in_basic(bulk: Bulk, card: BulkCard, nodes: list[int]) -> None:
    if turned := next((node for node in nodes if node in bulk.held.axes), None):
        raise Damaged(
            f"{card.where} takes single directions of GRID {turned} in a local system (CD); write it in the "
            "basic one"
        )


def _bushes(bulk: Bulk) -> Iterator[LumpedElement]:
    """CBUSH: six springs and dashpots at a place between two grid points, which it meets by rigid arms."""
    for card in bulk.cards["CBUSH"]:
        numbers = [n for n in (card.whole(3, 0), card.whole(4, 0)) if n]
        nodes = bulk.positions(card, numbers)
        if not numbers or card.whole(10, -1) > -1 or any(card.at(p) for p in (11, 12, 13)):
            raise Damaged(f"{card.where} has no grid point or an offset (OCID), which is not read; leave it out")
        K, B = _bush_values(bulk, card)
        x = bulk.raw.points[nodes]
        Q, share = _bush_axes(bulk, card, x, K, B), 0.5 if card.real(9) is None else card.real(9)
        place = x[0] + (share or 0.0) * (x[-1] - x[0])
        rows = []
        for at, sign in zip(x, (-1.0, 1.0) if len(x) > 1 else (1.0,), strict=True):
            arm = place - at
            motion = np.block([[np.eye(3), -skew(arm)], [np.zeros((3, 3)), np.eye(3)]])
            rows.append(sign * np.kron(np.eye(2), Q) @ motion)
        R = np.hstack(rows)
        both = [R.T @ (values[:, None] * R) for values in (K, B)]
        used = (np.abs(both[0]) + np.abs(both[1])).max(axis=0) > 0
        at = np.ix_(used, used)
        ways = np.tile(np.arange(6), len(nodes))[used]
        yield LumpedElement(card.where, np.repeat(nodes, 6)[used], ways, both[0][at], both[1][at])


def _bush_values(bulk: Bulk, card: BulkCard) -> tuple[Array, Array]:
    """(6,) stiffness and damping of PBUSH: words K and B, each before six numbers."""
    number = card.whole(2, card.whole(1))
    found = next(bulk.numbered(["PBUSH"], number), None)
    if found is None:
        raise Damaged(f"{card.where} names PBUSH {number}, which is not there")
    values = {"K": np.zeros(6), "B": np.zeros(6)}
    for place in range(2, len(found)):
        if found[place] in values:
            values[found[place]] = np.array([found.real(place + k) or 0.0 for k in range(1, 7)])
    return values["K"], values["B"]


def _bush_axes(bulk: Bulk, card: BulkCard, x: Array, K: Array, B: Array) -> Array:
    """(3, 3) rows are the axes of a bush."""
    system = card.whole(8, -1)
    if system == 0:
        return np.eye(3)
    if system > 0:
        return bulk.frame(card, system, x[0])
    along = x[-1] - x[0]
    if not along.any():
        if all(np.ptp(v[part]) == 0 for v in (K, B) for part in (slice(0, 3), slice(3, 6))):
            return np.eye(3)
        raise Damaged(f"{card.where} joins points at one place and has no CID; write 0 for the basic system")
    along = along / np.linalg.norm(along)
    if card.at(6) or "." in card.at(5):
        v = np.array([card.real(p) or 0.0 for p in (5, 6, 7)])
    elif card.at(5):
        v = bulk.raw.points[bulk.positions(card, [card.whole(5)])[0]] - x[0]
    elif any(value[k] for value in (K, B) for k in (1, 2, 4, 5)):
        raise Damaged(f"{card.where} has no orientation (GO, X or CID) for its lateral springs; give one")
    else:
        v = np.eye(3)[int(np.abs(along).argmin())]
    z = np.cross(along, v)
    if not np.linalg.norm(z) > 1e-9 * np.linalg.norm(v):
        raise Damaged(f"{card.where} has an orientation along its line; correct it")
    z = z / np.linalg.norm(z)
    return np.array([along, np.cross(z, along), z])


def bars_of(bulk: Bulk) -> Iterator[Link]:
    """RBAR: a point that follows another one rigidly.

    Raises:
        Damaged: independent components at both ends.
    """
    for card in bulk.cards["RBAR"]:
        a, b = card.whole(2), card.whole(3)
        first, second = card.directions(4), card.directions(5)
        if (first, second) not in (("xyzabc", ""), ("", "xyzabc")):
            raise Damaged(
                f"{card.where} has independent components at both ends ({card.at(4)}, {card.at(5)}), which is "
                "not read; write 123456 at one end"
            )
        leading, following = (a, b) if first else (b, a)
        ways = card.directions(7 if first else 6) or "xyzabc"
        if ways not in ("xyz", "abc", "xyzabc"):
            _in_basic(bulk, card, [a, b])
        at = bulk.positions(card, [leading, following])
        yield RigidLink(card.where, int(at[0]), at[1:], ways)
