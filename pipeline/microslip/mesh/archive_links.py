"""Of an Ansys archive: supports, constraint equations, coupled and rigid nodes, remote points, contact.

Contact elements and their targets of one set of real constants are a pair. What is bonded there is tied, a pair with a
pilot node makes that node lead the surface (or follow it in the mean), other pairs are joints.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ..data import Array, AverageLink, Equation, FaceTie, Indices, Joint, Link, RigidLink, Sector
from .archive import Archive, Command, CyclicCommands, Element, whole
from .archive_loads import LABELS, put
from .raw import Damaged, Numbering, RawMesh, Structure, is_number, joined, real
from .supports import add_supports, in_axes
from .systems import System


def _displacement(archive: Archive, words: list[str]) -> None:
    """D, node or component, UX or UY or UZ or ALL, value, its imaginary part, last node, step, further labels.

    What is moved is held in modes, as in Ansys.
    """
    where, label = words[1:3]
    every = where.upper() == "ALL"
    if every and archive.unread:
        text = f"is for the selection {archive.unread}, which is not read"
        archive.held.left_out.append(f"D,{where},{label} {text}")
        return
    named = {name.upper(): name for name in archive.components}
    component = named.get(archive.chosen.upper() if every else where.upper())
    if component is None and not every and not is_number(where):
        archive.held.left_out.append(f"D,{where},{label} names no node by its number")
        return
    places = put(archive, "D", words, LABELS)
    if component is not None:
        archive.held.hold(component, {way for _, way in places})
    else:
        for node, way in places:
            archive.held.hold(node, way)


def _displacements_block(archive: Archive, words: list[str]) -> None:
    """DBLOCK, count; then its format and in each line a node, a label, a value."""
    count = whole(words[1] or "0", "DBLOCK")
    rows = archive.lines[archive.at + 1 : archive.at + 1 + count]
    if len(rows) < count:
        raise Damaged("DBLOCK has no end, the file is truncated")
    for row in rows:
        fields = row.split()
        if len(fields) < 3 or not is_number(fields[0]):
            raise Damaged(
                f"DBLOCK holds the line '{row.strip()[:60]}'; a node, a label and a value belong there"
            )
        _displacement(archive, ["D", *fields[:3], *[""] * 8])
    archive.at += 1 + count


def _equation(archive: Archive, words: list[str]) -> None:
    """CE, number, constant, then node, label, factor in threes; or CE,R5.0,DEFI, length, number, constant and rows
    CE,R5.0,NODE of terms, as archives have it."""
    if words[1].upper().startswith(("R5", "UNBL")):
        if words[2].upper() == "DEFI":
            archive.open = words[4]
            number, constant, terms = words[4], words[5], []
        else:
            number, constant, terms = archive.open, "", words[3:]
    else:
        number, constant, *terms = words[1:]
        number = _numbered(archive, "CE", number)
    if constant and real(constant, "CE") != 0:
        raise Damaged(
            f"the constraint equation CE {number} has the constant {constant}; only 0 is read"
        )
    archive.places.setdefault(f"CE {number}", f"{archive.where}: CE {number}")
    found = archive.equations.setdefault(f"CE {number}", [])
    for place in range(0, len(terms) - 2, 3):
        node, label, factor = terms[place : place + 3]
        if node:
            if label.upper() not in LABELS:
                raise Damaged(
                    f"the constraint equation CE {number} takes in {label or 'nothing'} of node {node}"
                )
            found.append((whole(node, "CE"), LABELS[label.upper()], real(factor, "CE")))


def _numbered(archive: Archive, command: str, number: str) -> str:
    """The number of a set, which may be NEXT, or HIGH: the highest there is."""
    if number.upper() in ("NEXT", "HIGH", ""):
        first = (name.split()[1].rstrip(",") for name in archive.equations if name.startswith(f"{command} "))
        highest = max((int(text) for text in first if text.isdecimal()), default=0)
        return str(max(1, highest + (number.upper() != "HIGH")))
    return number


def _coupled(archive: Archive, words: list[str]) -> None:
    """CP, number, label, nodes: displacements that are equal; or CP, number, label, count and the nodes in the lines
    that follow, as archives have it."""
    number, label, *nodes = [*words[1:], "", ""]
    nodes, ways = (
        [n for n in nodes if n],
        "xyz" if label.upper() == "ALL" else LABELS.get(label.upper(), ""),
    )
    if label.upper() in ("TEMP", "VOLT", "MAG", "PRES", "HDSP"):
        return
    if len(nodes) == 1 and not is_number(nodes[0]):
        nodes = [str(node) for node in archive.nodes(nodes[0]) or []]
    lines = archive.lines
    if len(nodes) == 1 and is_number(nodes[0]):
        count, nodes = int(nodes[0]), []
        while len(nodes) < count and archive.at < len(lines) and all(map(is_number, lines[archive.at].split())):
            nodes += lines[archive.at].split()
            archive.at += 1
    if len(nodes) < 2 or not ways or not all(map(is_number, nodes)):
        raise Damaged(
            f"CP {number} couples other things than {label or 'UX'} of two nodes or more; use CE"
        )
    number = _numbered(archive, "CP", number)
    prime = archive.primes.setdefault((number, label.upper()), nodes[0])  # more nodes of a set join its first one
    nodes = [prime, *(node for node in nodes if node != prime)]
    for node in nodes[1:]:
        for way in ways:
            terms = [(whole(nodes[0], "CP"), way, 1.0), (whole(node, "CP"), way, -1.0)]
            name = f"CP {number}, {label} of node {node}, {way}"
            archive.places[name], archive.equations[name] = f"{archive.where}: CP {number}", terms


_RIGID = {"": "xyzabc", "ALL": "xyzabc", "UXYZ": "xyz", "RXYZ": "abc"}


def _rigid(archive: Archive, words: list[str]) -> None:
    """CERIG, master, slave node or component, directions."""
    master, slave, label = words[1:4]
    labels = [label, *(word for word in words[4:8] if word)]
    ways = "".join(_RIGID.get(word.upper(), LABELS.get(word.upper(), "?")) for word in labels)
    if "?" in ways or slave == "":
        raise Damaged(
            f"CERIG,{master},{slave},{label} is not read; name one node or component, and ALL, UXYZ or UX"
        )
    if not (members := archive.nodes(slave)):
        raise Damaged(
            f"CERIG,{master},{slave} couples no nodes: '{slave}' is no node and no component of nodes"
        )
    archive.rigid.append(
        (whole(master, "CERIG"), members, ways, f"{archive.where}: CERIG,{master},{slave}")
    )


def _spread(archive: Archive, words: list[str]) -> None:
    """RBE3, node that follows, directions, component of nodes, weights."""
    node, label, members, weights = words[1:5]
    ways = _RIGID.get(label.upper(), LABELS.get(label.upper(), "?"))
    nodes = archive.nodes(members)
    if ways == "?" or not nodes or weights:
        text = f"RBE3,{node},{label},{members} is not read"
        raise Damaged(f"{text}; name a component of nodes, without weights, and ALL, UXYZ or UX")
    place = f"{archive.where}: RBE3,{node},{members}"
    archive.spread.append((whole(node, "RBE3"), nodes, [1.0] * len(nodes), ways, place))


# assembly ---------------------------------------------------------------------------------------


def constrain(archive: Archive, raw: RawMesh, numbering: Numbering) -> None:
    """Give `raw` its links, supports and joints.

    Raises:
        Damaged: nodes that are not there, constraints without any.
    """
    archive.held.axes = _axes(archive, raw, numbering)
    for gap in archive.ranged.difference(archive.node_id):
        archive.held.nodes.pop(gap, None)
    raw.links += [*_equations(archive, numbering), *_leading(archive, numbering)]
    raw.links += _rigid_elements(archive, raw, numbering)
    raw.links += _pairs(archive, raw, numbering)
    add_supports(raw, archive.held, numbering)


def _axes(archive: Archive, raw: RawMesh, numbering: Numbering) -> dict[int, Array]:
    """Directions of nodes that are turned against global ones."""
    there = [node for node in archive.turns if np.isin(node, numbering.sorted)]
    at: Indices = numbering.positions(np.array(there, dtype=np.int64), "NROTAT names")
    axes = {node: archive.turns[node].directions(raw.points[[p]])[0] for node, p in zip(there, at, strict=True)}
    return {node: own for node, own in axes.items() if np.abs(own - np.eye(3)).max() > 1e-12}


def _equations(archive: Archive, numbering: Numbering) -> Iterator[Link]:
    for name, terms in archive.equations.items():
        where = archive.places[name]
        if not terms:
            raise Damaged(f"the constraint equation {where} has no terms")
        numbers, directions, factors = map(list, zip(*terms, strict=True))
        nodes = numbering.positions(numbers, f"{where} names")
        ways = np.array(["xyzabc".index(d) for d in directions])
        if archive.held.axes.keys().isdisjoint(numbers):
            yield Equation(where, nodes, ways, np.array(factors))
            continue
        own = np.array(
            [archive.held.axes.get(n, np.eye(3))[w % 3] for n, w in zip(numbers, ways, strict=True)]
        )
        yield in_axes(where, nodes, ways // 3 * 3, own * np.array(factors)[:, None])


def _leading(archive: Archive, numbering: Numbering) -> Iterator[Link]:
    """Nodes that follow one rigidly, and one that follows others in the mean."""
    for master, members, moves, where in archive.rigid:
        reference = numbering.positions([master], f"{where} names")
        positions = numbering.positions(members, f"{where} names")
        _refuse_turned(archive, where, moves, [master, *members])
        if moves:
            yield RigidLink(where, int(reference[0]), positions, moves)
    for node, members, weights, moves, where in archive.spread:
        reference = numbering.positions([node], f"{where} names")
        _refuse_turned(archive, where, moves, [node, *members])
        yield AverageLink(
            where,
            int(reference[0]),
            numbering.positions(members, f"{where} names"),
            np.array(weights),
            moves,
        )


def is_rigid(archive: Archive, element: Element) -> bool:
    """Whether it is a rigid link or beam, MPC184 with KEYOPT(1) = 0 or 1."""
    option = archive.options.get(element.kind, {}).get(1, "0")
    return archive.kinds.get(element.kind) == 184 and option in ("", "0", "1") and len(element.nodes) >= 2


def _rigid_elements(archive: Archive, raw: RawMesh, numbering: Numbering) -> Iterator[Link]:
    """MPC184: beams that share nodes are one rigid body; a link keeps the distance of its nodes."""
    bodies: list[tuple[str, set[int], Counter[int]]] = []
    for element in (e for e in archive.elements if is_rigid(archive, e)):
        where = f"{element.where or f'{archive.path}, element {element.number}'}: MPC184"
        ends = element.nodes[:2]
        at = numbering.positions(ends, f"{where} names")
        if archive.options.get(element.kind, {}).get(1, "0") != "1":
            along = raw.points[at[1]] - raw.points[at[0]]
            if not along.any():
                raise Damaged(f"{where} is a link between two nodes at one place; make it a beam (KEYOPT(1) = 1)")
            yield in_axes(where, at, np.zeros(2, dtype=np.int64), np.array([along, -along]) / np.linalg.norm(along))
            continue
        near = [body for body in bodies if not body[1].isdisjoint(ends)]
        nodes, count = set(ends).union(*(b[1] for b in near)), sum((b[2] for b in near), Counter(ends))
        first = near[0][0] if near else where
        bodies = [*(body for body in bodies if body not in near), (first, nodes, count)]
    for where, nodes, count in bodies:
        leader = count.most_common(1)[0][0]
        members = numbering.positions(sorted(nodes - {leader}), f"{where} names")
        yield RigidLink(where, int(numbering.positions([leader], where)[0]), members, "xyzabc")


def _refuse_turned(archive: Archive, where: str, moves: str, nodes: list[int]) -> None:
    """Raises `Damaged` if single directions of a turned node are taken, which are others."""
    if moves in ("xyz", "abc", "xyzabc"):
        return
    if found := next((node for node in nodes if node in archive.held.axes), None):
        text = f"{where} takes single directions of node {found}, which is turned (NROTAT)"
        raise Damaged(f"{text}; turn it back, or take UXYZ or ALL")


# cyclic symmetry --------------------------------------------------------------------------------


def _ring(archive: Archive, words: list[str]) -> None:
    """CYCLIC, sectors, angle, coordinate system, name; CYCLIC,CDWR of an archive, of which only the components are
    taken."""
    if words[1].upper() in ("OFF", "STATUS", "UNDOUBLE"):
        archive.rings = [] if words[1].upper() == "OFF" else archive.rings
        return
    plain = is_number(words[1]) or not words[1]
    system = int(words[3]) if plain and is_number(words[3]) else 1
    name = words[4].strip("'") if plain else ""
    archive.rings.append(
        CyclicCommands(
            f"{archive.where}: CYCLIC", int(words[1] or 0) if plain else 0, system, name or "CYCLIC"
        )
    )


def _cyclic_option(archive: Archive, words: list[str]) -> None:
    """CYCOPT,HINDEX, first, last, step of the harmonic indices, or EVEN, ODD, ALL."""
    if words[1].upper() != "HINDEX":
        return
    named = {"EVEN": (0, -1, 2), "ODD": (1, -1, 2), "ALL": None}
    if words[2].upper() in named:
        archive.diameters = named[words[2].upper()]
    elif is_number(words[2]):
        first = int(words[2])
        last = int(words[3]) if is_number(words[3]) else first
        archive.diameters = first, last, max(int(words[4]) if is_number(words[4]) else 1, 1)


def _stages(archive: Archive, words: list[str]) -> None:
    raise Damaged(
        "MSOPT is a multistage cyclic model, which is not read; write an archive of each stage, then of each"
    )


def ring_of(archive: Archive, raw: RawMesh) -> Sector | None:
    """The sector of CYCLIC, by the components of its low and its high edge.

    Raises:
        Damaged: several stages, edges that are no whole share of a turn apart.
    """
    names = {ring.name.upper() for ring in archive.rings}
    if len(names) > 1:
        ring = archive.rings[-1]
        text = f"{ring.where} is given for {' and '.join(sorted(names))}: a multistage model is not read"
        raise Damaged(f"{text}; write an archive of each stage and import these")
    if not archive.rings:
        return None
    ring, (name,) = archive.rings[-1], names
    edges = []
    for letter in "LH":
        parts = [
            n
            for n in raw.point_sets
            if re.fullmatch(rf"{re.escape(name)}_M\d\d{letter}", n, re.IGNORECASE)
        ]
        for part in parts[:1] if len(parts) == 1 else []:
            edges.append(part)
        if len(parts) > 1:
            edges.append(f"{name}_{letter}")
            for part in parts:
                raw.add_points(edges[-1], raw.point_sets[part])
    if len(edges) < 2:
        archive.lost.append(
            f"{ring.where}: the archive has no components {name}_M01L and {name}_M01H, the edges of the sector, which "
            "Ansys finds when it solves; name the two faces in [cyclic], without it the cut is free"
        )
        return None
    system = archive.systems.get(ring.system, System(1))
    first, last = (
        ((raw.points[raw.point_sets[n]] - system.origin) @ system.axes.T).mean(axis=0)
        for n in edges
    )
    turn = (np.arctan2(last[1], last[0]) - np.arctan2(first[1], first[0])) % (2 * np.pi)
    count = 2 * np.pi / turn if turn else 0.0
    sectors = ring.sectors or round(count)
    if abs(count - sectors) > 0.02 * sectors:
        raise Damaged(
            f"{ring.where}: its edges are {np.degrees(turn):.4g} degrees apart about the z axis of the "
            f"coordinate system {ring.system}, which makes {count:.4g} sectors, not {sectors}; correct the "
            "sectors or the system"
        )
    picked = archive.diameters
    half = sectors // 2
    last_one = half if picked is None or picked[1] < 0 else min(picked[1], half)
    diameters = () if picked is None else tuple(range(picked[0], last_one + 1, picked[2]))
    axis, point = tuple(system.axes[2].tolist()), tuple(system.origin.tolist())
    return Sector(ring.where, sectors, (edges[0], edges[1]), axis, point, diameters)


# contact ----------------------------------------------------------------------------------------

CONTACTS = {*range(171, 176), 177}
TARGETS = {169, 170}
_STATES = {"1": "rough", "2": "no separation", "4": "no separation"}
_BONDED = ("3", "5", "6")


@dataclass
class _Pair:
    """Contact elements and their targets of one set of real constants."""

    number: int
    contact: list[Element] = field(default_factory=list)
    target: list[Element] = field(default_factory=list)

    @property
    def where(self) -> str:
        first = [*self.contact, *self.target][0]
        place = first.where or f"element {first.number}"
        return f"{place}: contact of the real constants {self.number}"

    def nodes(self) -> tuple[set[int], set[int]]:
        """Numbers of the nodes of either side."""
        sides = (self.contact, self.target)
        one, other = ({n for element in side for n in element.nodes if n} for side in sides)
        return one, other


_LEFT_OUT = {
    "which lack their other side": "they join nothing",
    "on what is no solid": "nothing of them is taken, and what they join falls apart; mesh it with solids, or hold "
    "what is loose by [[supports]]",
    "against what is no solid": "their nodes move freely; hold them by [[supports]] or make [[interfaces]] of them",
    "which say what others say from the other side": "they are taken once",
}
"""Kind of pairs that are not taken -> what follows."""


def _pairs(archive: Archive, raw: RawMesh, numbering: Numbering) -> list[Link]:
    """Ties, remote points and joints of contact elements; what is neither is told."""
    pairs: dict[int, _Pair] = {}
    for element in archive.elements:
        kind = archive.kinds.get(element.kind, 0)
        if kind in CONTACTS | TARGETS:
            pair = pairs.setdefault(element.real, _Pair(element.real))
            (pair.target if kind in TARGETS else pair.contact).append(element)
    used = np.unique(joined(nodes.ravel() for _, nodes in raw.blocks))
    solid, found, left = set(raw.node_id[used].tolist()), list[Link](), dict[str, list[_Pair]]()
    taken: list[tuple[set[int], set[int]]] = []
    for pair in pairs.values():
        members, others = pair.nodes()
        options = archive.options.get(pair.contact[0].kind, {}) if pair.contact else {}
        bonded = options.get(12, "0") in _BONDED
        pilots = {e.nodes[0] for e in pair.target if len({*e.nodes} - {0}) == 1}
        if not members or not others:
            left.setdefault("which lack their other side", []).append(pair)
        elif not solid.issuperset(members):
            left.setdefault("on what is no solid", []).append(pair)
        elif len(pilots) == 1 and bonded:
            found.append(_remote(archive, raw, numbering, pair, min(pilots)))
        elif not solid.issuperset(others):
            left.setdefault("against what is no solid", []).append(pair)
        elif any(members & b and others & a for a, b in taken):
            left.setdefault("which say what others say from the other side", []).append(pair)
        else:
            taken.append((members, others))
            found += _faced(archive, raw, numbering, pair, options.get(12, "0"))
    hanging = {node for s in raw.structures for row in s.elements for node in raw.node_id[row].tolist()}
    among: dict[str, list[list[int]]] = {}
    for pair in (pair for why, several in left.items() if "no solid" in why for pair in several):
        nodes = sorted(set.union(*pair.nodes()))
        if not hanging.isdisjoint(nodes):
            at = numbering.positions(nodes, f"{pair.where} names").tolist()
            among.setdefault(next(iter(among), pair.where), []).append(at)
    raw.structures += [Structure(where, "contact pairs with beams or shells", rows) for where, rows in among.items()]
    for why, several in left.items():
        counts = [
            sum(map(len, side))
            for side in zip(*((p.contact, p.target) for p in several), strict=True)
        ]
        more = f" and {len(several) - 1} pairs more" if len(several) > 1 else ""
        which = f"{several[0].where}{more} ({counts[0]} contact and {counts[1]} target elements)"
        said = archive.remarks if "other side" in why else archive.lost
        said.append(f"{which}, {why}: {_LEFT_OUT[why]}")
    return found


def _faced(
    archive: Archive, raw: RawMesh, numbering: Numbering, pair: _Pair, state: str
) -> Iterator[Link]:
    """A pair of faces of solids: the tie of a bonded one; another is a joint of `raw`."""
    parts = {"contact": pair.contact, "target": pair.target}
    names = [_facets(raw, numbering, f"{side} {pair.number}", own) for side, own in parts.items()]
    if state in _BONDED:
        text = "is bonded: tied, where Ansys has stiff springs (FKN) or a tie (MPC)"
        archive.remarks.append(f"{pair.where} {text}")
        yield FaceTie(pair.where, names[0], names[1])
        return
    mu = archive.constants.get(pair.contact[0].material, {}).get("MU", {})
    said = _STATES.get(state, "frictional" if mu else "frictionless")
    friction = mu[min(mu)] if mu else None
    raw.joints.append(Joint(f"{pair.where}, {said}", names[0], names[1], friction))


def _facets(raw: RawMesh, numbering: Numbering, name: str, elements: list[Element]) -> str:
    """A set of the facets of elements, by their corners; of nodes alone a set of points."""
    corners: dict[int, list[list[int]]] = {}
    for element in elements:
        nodes = [n for n in element.nodes if n]
        ring = list(
            dict.fromkeys(nodes[: 4 if len(nodes) in (4, 8) else 3 if len(nodes) in (3, 6) else 1])
        )
        corners.setdefault(len(ring), []).append(ring)
    for count, rings in corners.items():
        at = numbering.positions(rings, f"the {name} names")
        if count > 2:
            raw.facets.setdefault(name, []).append(at)
        else:
            raw.add_points(name, np.unique(at))
    return name


def _remote(archive: Archive, raw: RawMesh, numbering: Numbering, pair: _Pair, pilot: int) -> Link:
    """A pilot node that leads the nodes of a surface, or follows them in the mean (by areas).

    KEYOPT(4) of the target has a digit for each of ROTZ, ROTY, ROTX, UZ, UY, UX, 1 where it is tied; 0: all.
    """
    first = pair.contact[0]
    digits = archive.options.get(pair.target[0].kind, {}).get(4, "0")
    tied = digits.rjust(6, "0")[::-1] if int(digits or 0) else "111111"
    ways = "".join(way for way, digit in zip("xyzabc", tied, strict=True) if digit == "1")
    where = f"{pair.where}, pilot node {pilot}"
    reference = int(numbering.positions([pilot], f"{where} names")[0])
    nodes: Indices = numbering.positions(sorted(pair.nodes()[0]), f"{where} names")
    if archive.options.get(first.kind, {}).get(4, "0") != "1":
        return RigidLink(where, reference, nodes, "".join(w for w in ways if w in "xyz"))
    if archive.kinds[first.kind] in (175, 177):
        return AverageLink(where, reference, nodes, np.ones(len(nodes)), ways)
    face = _facets(raw, numbering, f"contact {pair.number}", pair.contact)
    return AverageLink(where, reference, face, None, ways)


COMMANDS: dict[str, Command] = {
    "D": _displacement,
    "DBLOCK": _displacements_block,
    "CP": _coupled,
    "CE": _equation,
    "CERIG": _rigid,
    "RBE3": _spread,
    "CYCLIC": _ring,
    "CYCOPT": _cyclic_option,
    "MSOPT": _stages,
}
