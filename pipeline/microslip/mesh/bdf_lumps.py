"""Of Nastran bulk data: concentrated and scalar masses, springs and dampers, bushes, rigid bars."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from ..data import Array, Equation, Indices, Link, LumpedElement, PointMass, RigidLink
from ..frames import skew
from .bdf_cards import Bulk, BulkCard
from .raw import Damaged, lost
from .supports import in_axes

SPRINGS = ("CELAS1", "CELAS2", "CELAS3", "CELAS4", "CDAMP1", "CDAMP2", "CDAMP3", "CDAMP4")
MASSES = ("CMASS1", "CMASS2", "CMASS3", "CMASS4")
RIGID = ("RBAR", "RBAR1", "RBE1", "RROD")
READ = {"CONM1", "CONM2", *SPRINGS, "PELAS", "PDAMP", *MASSES, "PMASS", "CBUSH", "PBUSH", *RIGID}


def lumps_of(bulk: Bulk) -> list[PointMass | LumpedElement]:
    """The lumped elements of bulk data, nodes by their positions in the file.

    Raises:
        Damaged: with the card, what is wrong with one.
    """
    factor = bulk.parameter("WTMASS")
    scale = 1.0 if factor is None else factor
    return [*_masses(bulk, scale), *_scalar_masses(bulk, scale), *_scalars(bulk), *_bushes(bulk)]


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
    """Raises `Damaged` of a mass that no body has, unless it cannot move."""
    still = set("xyzabc") <= bulk.held.nodes.get(card.whole(2), set())
    if still:
        return
    if m < 0 or np.linalg.eigvalsh(J)[0] < -1e-9 * np.abs(J).max():
        raise Damaged(f"{card.where} has a mass or inertia below 0; correct it")


def _value(bulk: Bulk, card: BulkCard) -> float:
    """Of a scalar spring, damper or mass: its own (even kinds) or that of its property.

    Raises:
        Damaged: there is no such property.
    """
    if card[0][-1] in "24":
        return card.real(2) or 0.0
    kind, number = f"P{card[0][1:-1]}", card.whole(2, card.whole(1))
    for other in bulk.cards[kind]:
        for place in range(1, min(len(other), 9), 4 if kind == "PELAS" else 2):
            if other.at(place) == str(number):
                return other.real(place + 1) or 0.0
    raise Damaged(f"{card.where} names {kind} {number}, which is not there")


def _ends(bulk: Bulk, card: BulkCard) -> tuple[Indices, Indices, Array]:
    """Nodes, directions and factors (t,) whose sum is the displacement that a scalar element acts on: that of its
    first end less that of its second.

    Kinds 3 and 4 join scalar points, 1 and 2 components of grid points or scalar points; 0 and blank are the ground.

    Raises:
        Damaged: it has no end, a component that is none.
    """
    places = (3, 4) if card[0][-1] in "34" else (3, 5)
    nodes, ways, factors = list[int](), list[int](), list[float]()
    for place, sign in zip(places, (1.0, -1.0), strict=True):
        if not (number := card.whole(place, 0)):
            continue
        node = int(bulk.positions(card, [number])[0])
        if node >= bulk.scalar:
            way, axis = 0, np.array([sign, 0.0, 0.0])
        else:
            way = card.whole(place + 1, 0) - 1 if places[1] == 5 else -1
            if not 0 <= way < 6:
                raise Damaged(f"{card.where} names no component (1 to 6) of grid point {number}; write one")
            axis = sign * bulk.held.axes.get(number, np.eye(3))[way % 3]
        for k in np.flatnonzero(axis):
            nodes.append(node)
            ways.append(3 * (way // 3) + int(k))
            factors.append(float(axis[k]))
    if not nodes:
        raise Damaged(f"{card.where} joins nothing; name a point")
    return np.array(nodes), np.array(ways), np.array(factors)


def unlisted_points(cards: Mapping[str, list[BulkCard]]) -> Iterator[tuple[BulkCard, int]]:
    """Scalar points that stand on scalar elements, which need no SPOINT; and the element."""
    for card in (card for name in (*SPRINGS, *MASSES) for card in cards.get(name, ())):
        for place in (3, 4) if card[0][-1] in "34" else (3, 5):
            alone = card[0][-1] in "34" or card.at(place + 1) in ("", "0")
            if alone and (number := card.whole(place, 0)):
                yield card, number


def _scalars(bulk: Bulk) -> Iterator[LumpedElement]:
    """CELAS1 to 4, CDAMP1 to 4 between two displacements, or one and the ground."""
    for card in (card for name in SPRINGS for card in bulk.cards[name]):
        nodes, ways, row = _ends(bulk, card)
        A = _value(bulk, card) * np.outer(row, row)
        zero = np.zeros_like(A)
        yield LumpedElement(card.where, nodes, ways, *((A, zero) if card[0][1] == "E" else (zero, A)))


def _scalar_masses(bulk: Bulk, scale: float) -> Iterator[PointMass]:
    """CMASS1 to 4: the mass of a scalar point; of a grid point what is alike in all directions, else a mass on a point
    that moves along one direction as the element's two ends move apart."""
    alike: dict[int, dict[int, tuple[float, str]]] = {}
    for card in (card for name in MASSES for card in bulk.cards[name]):
        nodes, ways, row = _ends(bulk, card)
        m = scale * _value(bulk, card)
        if m < 0:
            raise Damaged(f"{card.where} has a mass below 0; correct it")
        if len(nodes) == 1:
            before = alike.setdefault(int(nodes[0]), {})
            way = int(ways[0])
            before[way] = m + before.get(way, (0.0, ""))[0], before.get(way, (0.0, card.where))[1]
        else:
            yield _alone(bulk, card.where, nodes, ways, row, m)
    for node, found in alike.items():
        sizes = np.array([found.get(way, (0.0, ""))[0] for way in range(6)])
        where = next(iter(found.values()))[1]
        least = np.array([sizes[0] if node >= bulk.scalar else sizes[:3].min(), sizes[3:].min()])
        if least.any():
            yield PointMass(where, node, float(least[0]), inertia=float(least[1]) * np.eye(3))
        for at in np.flatnonzero((sizes > np.repeat(least, 3)) & (node < bulk.scalar)):
            rest = float(sizes[at] - least[at // 3])
            yield _alone(bulk, where, np.array([node]), np.array([at]), np.ones(1), rest)


def _alone(bulk: Bulk, where: str, nodes: Indices, ways: Indices, row: Array, mass: float) -> PointMass:
    """The mass of one displacement, on a new point that has no other."""
    raw = bulk.raw
    new, way = len(raw.points), int(ways[np.abs(row).argmax()]) % 3
    raw.points = np.vstack([raw.points, raw.points[nodes[:1]]])
    raw.node_id = np.append(raw.node_id, raw.node_id.max() + 1)
    every, factors = np.append(new, nodes), np.append(1.0, -row)
    raw.links.append(Equation(where, every, np.append(way, ways), factors))
    raw.links += [Equation(where, np.array([new]), np.array([k]), np.ones(1)) for k in range(3) if k != way]
    return PointMass(where, new, mass)


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
    """RBAR, RBAR1, RBE1: points that move as one rigid body; RROD: two that keep their distance.

    The equations are the same whichever displacements are called independent: six of them at several points, one of
    which takes part with all its six.

    Raises:
        Damaged: independent components that are not six, or no such point.
    """
    for card in bulk.cards["RROD"]:
        ends = bulk.positions(card, [card.whole(2), card.whole(3)])
        along = np.diff(bulk.raw.points[ends], axis=0)[0]
        if not along.any():
            raise Damaged(f"{card.where} joins points at one place; take it out")
        yield in_axes(card.where, ends, np.zeros(2, dtype=np.int64), np.array([along, -along]))
    for card in (card for name in RIGID[:3] for card in bulk.cards[name]):
        free, bound = _components(card)
        if sum(map(len, free.values())) != 6:
            raise Damaged(f"{card.where} has {sum(map(len, free.values()))} independent components; write six")
        ways = {n: free.get(n, "") + bound.get(n, "") for n in [*free, *bound]}
        leading = next((n for n, w in ways.items() if set(w) == set("xyzabc")), None)
        if leading is None:
            raise Damaged(f"{card.where} has no point of which all six components take part; write an RBE2")
        for node, taken in ways.items():
            axes = bulk.held.axes.get(node) if taken not in ("xyz", "abc", "xyzabc") else None
            at = bulk.positions(card, [leading, node])
            if node != leading:
                yield RigidLink(card.where, int(at[0]), at[1:], "".join(sorted(set(taken), key="xyzabc".index)), axes)


def _components(card: BulkCard) -> tuple[dict[int, str], dict[int, str]]:
    """Of each point of a rigid element its independent and its dependent components."""
    free, bound = dict[int, str](), dict[int, str]()
    if card[0] == "RBE1":
        middle = card.index("UM") if "UM" in card else len(card)
        end = card.index("ALPHA") if "ALPHA" in card else len(card)
        for into, first, last in ((free, 2, middle), (bound, middle + 1, end)):
            words = [p for p in range(first, min(last, len(card))) if card[p] and "." not in card[p]]
            for p, q in zip(words[::2], words[1::2], strict=False):
                into[card.whole(p)] = into.get(card.whole(p), "") + card.directions(q)
        return free, bound
    a, b = card.whole(2), card.whole(3)
    if card[0] == "RBAR1":
        return {a: "xyzabc"}, {b: card.directions(4) or "xyzabc"}
    for node, first, then in ((a, 4, 6), (b, 5, 7)):
        free[node], bound[node] = card.directions(first), card.directions(then)
    if not any(bound.values()):
        bound = {n: "".join(w for w in "xyzabc" if w not in own) for n, own in free.items()}
    return free, bound
