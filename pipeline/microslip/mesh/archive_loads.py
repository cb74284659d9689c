"""Of an Ansys archive: what acts on the body, and the static solution that its modes are about.

Loads are kept as they are written, a later one of a place taking the place of an earlier one, until a
SOLVE; modes after PSTRES,ON, or of a perturbed restart (ANTYPE with PERTURB), are about the last of them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np

from ..data import Array, BodyLoad, FacetLoad, Indices, NodalLoad, SpinLoad, StaticStep
from ..errors import of_file
from ..topology import CELL_TYPES
from .archive import Acting, Archive, Command, Element, Solution, whole
from .archive_parameters import value_at
from .loading import Terms, facet_loads, nodal_loads
from .raw import Damaged, Numbering, RawMesh, is_number, real
from .supports import still_supports
from .systems import System

WAYS = {"X": "x", "Y": "y", "Z": "z"}
LABELS = {f"U{a}": w for a, w in WAYS.items()} | {"ROTX": "a", "ROTY": "b", "ROTZ": "c"}
"""Degree of freedom -> direction."""
_FORCES = {f"F{a}": w for a, w in WAYS.items()} | {"MX": "a", "MY": "b", "MZ": "c"}
_IMPORTANT = "so frequencies will differ from those under it"

# corners I J K L M N O P of a brick and I J K L of a tetrahedron, by faces 1 to 6 and 1 to 4
_BRICK = ((1, 0, 3, 2), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7))
_TETRA = ((1, 0, 2), (0, 1, 3), (1, 2, 3), (2, 0, 3))
_TETS, SURFACES = (187, 92, 227, 285), (152, 154)


def sides(archive: Archive, element: Element) -> dict[int, list[int]]:
    """Number of a face of an element -> nodes at its corners; those of a degenerate brick as often
    as they stand there."""
    ansys, nodes = archive.kinds.get(element.kind, 0), element.nodes
    if ansys in SURFACES:
        corners = nodes[: 4 if len(nodes) in (4, 5, 8, 9) else 3]
        return {face: corners for face in range(1, 6)} if len(nodes) > 2 else {}
    faces = _TETRA if ansys in _TETS else _BRICK if len(nodes) >= 8 else ()
    return {number: [nodes[i] for i in face] for number, face in enumerate(faces, 1)}


# reading ----------------------------------------------------------------------------------------


def _value(word: str, what: str) -> str:
    """A value as it is written: a number, or the name of a table in %; empty: 0."""
    if not word.startswith("%") and not np.isfinite(real(word or "0", what)):
        raise Damaged(f"{what} holds {word}, which is no finite number; correct it")
    return word or "0"


def put(archive: Archive, what: str, words: list[str], labels: dict[str, str]) -> list[tuple[int, str]]:
    """F or D: node, label, value, imaginary part, last node, step, further labels (of D): places and
    directions that it names, with their values among what acts."""
    where, label, value, _, last, step, *more = words[1:]
    named = dict.fromkeys(w.upper() for w in (label, *(more if what == "D" else ())))
    ways = "".join("".join(labels.values()) if w == "ALL" else labels.get(w, "") for w in named)
    if not ways:
        return []
    nodes: Iterable[int] | None = archive.nodes(where)
    if nodes is None:
        archive.leave_out(f"{what},{where},{label} (it names no nodes that are there)")
        return []
    if last and is_number(where):
        nodes = archive.through(where, last, step, what)
        archive.ranged.update(nodes[1:])
    into = archive.acting.moved if what == "D" else archive.acting.forces
    places = [(node, way) for node in nodes for way in ways]
    into.update(dict.fromkeys(places, (_value(value, what), archive.where)))
    return places


def _force(archive: Archive, words: list[str]) -> None:
    """F, node or component, label, value, imaginary part, last node, step."""
    put(archive, "F", words, _FORCES)


def _forces_block(archive: Archive, words: list[str]) -> None:
    """FBLOCK, count: node, label, value in each line."""
    for row in _rows(archive, "FBLOCK"):
        put(archive, "F", ["F", *row[:3], *[""] * 8], _FORCES)


def _rows(archive: Archive, what: str) -> Iterator[list[str]]:
    """The words of the lines of a block behind its format, up to the next command.

    Raises:
        Damaged: the file ends in it.
    """
    first = archive.at + 1
    for number, line in enumerate(archive.lines[first:], first):
        row = line.split()
        archive.at = number + 1
        if not row or not is_number(row[0]):
            archive.at = number + (row[:1] == ["-1"])
            return
        yield [*row, *[""] * 6]
    raise Damaged(f"{what} has no end, the file is truncated")


def _deleted(archive: Archive, words: list[str]) -> None:
    """FDELE, DDELE: node, label."""
    what, where, label = words[0].upper()[0], words[1] or "ALL", (words[2] or "ALL").upper()
    labels = LABELS if what == "D" else _FORCES
    into = archive.acting.moved if what == "D" else archive.acting.forces
    ways = set(labels.values()) if label == "ALL" else {labels.get(label, "")}
    nodes = archive.nodes(where)
    if nodes is None:
        archive.leave_out(f"{words[0].upper()},{where}")
        return
    if words[3] and is_number(where):
        nodes = [*archive.through(where, words[3], words[4], words[0])]
    there = set(nodes)
    for node, way in [place for place in into if place[0] in there and place[1] in ways]:
        del into[node, way]
    if what == "D":
        archive.held.release(there, ways, archive.components)


def _on_nodes(archive: Archive, words: list[str]) -> None:
    """SF, nodes, PRES, value: faces of the chosen elements whose corners are all among the nodes; none
    inside the body."""
    if words[2].upper() != "PRES":
        return
    nodes, numbers = archive.nodes(words[1]), archive.cells("ALL")
    if nodes is None or numbers is None:
        archive.leave_out(f"SF,{words[1]},PRES of a selection that is not read")
        return
    value, there, chosen = _value(words[3], "SF"), set(nodes), set(numbers)
    at: dict[frozenset[int], list[tuple[int, int]]] = {}
    for element in archive.elements:
        surface = archive.kinds.get(element.kind, 0) in SURFACES
        if element.number not in chosen or not there.issuperset(element.nodes) and surface:
            continue
        for face, corners in sides(archive, element).items():
            if len({*corners}) > 2 and there.issuperset(corners) and (face == 1 or not surface):
                at.setdefault(frozenset(corners), []).append((element.number, face))
    skins = {e.number for e in archive.elements if archive.kinds.get(e.kind, 0) in SURFACES}
    for places in at.values():
        places = [place for place in places if place[0] in skins] or places
        if len({number for number, _ in places}) == 1:
            archive.acting.faces[places[0]] = [value], archive.where
    if not at:
        archive.leave_out(f"SF,{words[1]},PRES finds no face of the chosen elements; it")


def _on_faces(archive: Archive, words: list[str]) -> None:
    """SFE, elements, face, PRES, part, values at its corners; in archives they stand in the next line."""
    if words[1].upper() == "END" or words[3].upper()[:4] != "PRES":
        return
    values = words[5:9]
    if words[5].upper().startswith(("R5", "UNBL")):
        values = archive.lines[archive.at].split() if archive.at < len(archive.lines) else []
        archive.at += 1
    if words[4] == "2":
        return  # the imaginary part
    numbers = archive.cells(words[1])
    if numbers is None:
        archive.leave_out(f"SFE,{words[1]},{words[2]},PRES of a selection that is not read")
        return
    _press(archive, numbers, whole(words[2] or "1", "SFE"), values)


def _press(archive: Archive, numbers: Iterable[int], face: int, values: list[str]) -> None:
    """Values of a face of elements; those that are left out are the first one, as Ansys has it."""
    first = _value([*values, ""][0], "SFE")
    all_of_it = [_value(word, "SFE") if word else first for word in [*values, "", "", "", ""][:4]]
    for number in numbers:
        archive.acting.faces[number, face] = all_of_it, archive.where


def _faces_block(archive: Archive, words: list[str]) -> None:
    """SFEBLOCK, values, label: element, face, part (2 is imaginary), values in each line."""
    label = words[2].upper()
    for row in _rows(archive, "SFEBLOCK"):
        if label == "PRES" and row[2] != "2":
            _press(archive, [whole(row[0], "SFEBLOCK")], whole(row[1], "SFEBLOCK"), row[3:7])


def _faces_deleted(archive: Archive, words: list[str]) -> None:
    """SFDELE, SFEDELE: those of nodes are deleted with all of their faces."""
    faces, by_nodes = archive.acting.faces, not words[0].upper().startswith("SFE")
    found = archive.nodes(words[1] or "ALL") if by_nodes else archive.cells(words[1] or "ALL")
    if found is None:
        archive.leave_out(f"{words[0].upper()},{words[1]}")
        return
    if by_nodes:
        there = set(found)
        found = {e.number for e in archive.elements if there.issuperset(e.nodes)}
    chosen, face = set(found), "ALL" if by_nodes else words[2].upper() or "ALL"
    for place in [p for p in faces if p[0] in chosen and face in ("ALL", str(p[1]))]:
        del faces[place]


def _field(archive: Archive, words: list[str]) -> None:
    """ACEL, OMEGA and others: values along x, y, z; those of components (CM...) by their name."""
    name, first = words[0].upper(), 2 if words[0].upper().startswith("CM") else 1
    values = words[1:first] + [_value(w, name) if w else "" for w in words[first:11]]
    key = name if first == 1 else f"{name} {words[1].upper()}"
    archive.acting.fields[key] = values, archive.where


def _uniform(archive: Archive, words: list[str]) -> None:
    """TUNIF, value; BFUNIF, TEMP, value; _TINY is how Ansys says none."""
    label, value = words[1:3] if words[0].upper().startswith("BF") else ("TEMP", words[1])
    if label.upper() == "TEMP":
        archive.acting.uniform = "" if value == "_TINY" else value and _value(value, "BFUNIF")


def _temperature(archive: Archive, words: list[str]) -> None:
    """BF, node or component, TEMP, value."""
    if not words[2].upper().startswith("TEMP"):
        return
    if (nodes := archive.nodes(words[1])) is None:
        archive.leave_out(f"BF,{words[1]},TEMP (it names no nodes that are there)")
        return
    archive.acting.nodal.update(dict.fromkeys(nodes, _value(words[3], "BF")))


def _temperatures_block(archive: Archive, words: list[str]) -> None:
    """BFBLOCK, values, TEMP: node, value in each line."""
    for row in _rows(archive, "BFBLOCK"):
        if words[2].upper().startswith("TEMP"):
            archive.acting.nodal[whole(row[0], "BFBLOCK")] = _value(row[1], "BFBLOCK")


def _cell_temperature(archive: Archive, words: list[str]) -> None:
    """BFE, elements, TEMP, first place among their nodes, values; one alone is that of all of it."""
    if not words[2].upper().startswith("TEMP"):
        return
    if (numbers := archive.cells(words[1])) is None:
        archive.leave_out(f"BFE,{words[1]},TEMP of a selection that is not read")
        return
    first = whole(words[3] or "1", "BFE")
    values = {first + i: _value(w, "BFE") for i, w in enumerate(words[4:8]) if w}
    for number in numbers:
        archive.acting.cells.setdefault(number, {}).update(values)


def _temperatures_deleted(archive: Archive, words: list[str]) -> None:
    """BFDELE, BFEDELE."""
    by_nodes = not words[0].upper().startswith("BFE")
    into: dict = archive.acting.nodal if by_nodes else archive.acting.cells
    found = archive.nodes(words[1] or "ALL") if by_nodes else archive.cells(words[1] or "ALL")
    if found is None:
        archive.leave_out(f"{words[0].upper()},{words[1]}")
        return
    for number in found:
        into.pop(number, None)


def _cleared(archive: Archive, words: list[str]) -> None:
    """LSCLEAR, ALL or SOLID or FE or INER."""
    if words[1].upper() in ("ALL", "FE"):
        archive.acting = Acting(fields=archive.acting.fields)
        archive.held.clear()
    if words[1].upper() in ("ALL", "INER"):
        archive.acting.fields = {}


def _added(archive: Archive, words: list[str]) -> None:
    """FCUM, DCUM, SFCUM, BFCUM: whether further values replace (REPL), are added or ignored."""
    if {"ADD", "IGNO", "IGNORE"} & {word.upper() for word in words[1:]}:
        archive.leave_out(f"{words[0].upper()},{words[1]}")


def _refuse_blocked(archive: Archive, words: list[str]) -> None:
    if words[2].upper().startswith("TEMP"):
        raise Damaged("BFEBLOCK with temperatures is not read; write them by BFE (CDWRITE, UNBLOCKED)")


# solutions --------------------------------------------------------------------------------------

_ANALYSES = ("STATIC", "BUCKLE", "MODAL", "HARMIC", "TRANS", "", "", "SUBSTR", "SPECTR")


def _analysis(archive: Archive, words: list[str]) -> None:
    """ANTYPE, kind, NEW or RESTART, load step, substep, PERTURB."""
    kind = words[1].upper()
    if kind.isdecimal() and int(kind) < len(_ANALYSES):
        kind = _ANALYSES[int(kind)]
    named = [name for name in _ANALYSES if name and kind and name.startswith(kind[:4])]
    if words[2].upper() not in ("REST", "RESTART"):
        archive.analysis, archive.nonlinear = (named or ["STATIC"])[0], False
    if "PERTURB" in (word.upper() for word in words):
        archive.perturbed = int(words[3]) if is_number(words[3]) else 0


def _perturbed(archive: Archive, words: list[str]) -> None:
    """PERTURB, MODAL, stiffness, contact, what is kept of the loads."""
    archive.analysis = words[1].upper()[:5] or "MODAL"
    archive.perturbed = archive.perturbed or 0
    kept = words[4].upper()
    if kept == "NOKEEP":
        archive.held.clear()
    elif kept not in ("", "ALLKEEP", "INERKEEP", "PARKEEP", "DZEROKEEP"):  # which keep what is held
        archive.leave_out(f"PERTURB with {kept}, which changes supports after the loads,")


def _prestress(archive: Archive, words: list[str]) -> None:
    archive.prestressed = words[1].upper() in ("ON", "1", "YES")


def _geometry(archive: Archive, words: list[str]) -> None:
    """NLGEOM, ON."""
    archive.nonlinear = words[1].upper() in ("ON", "1", "YES")


def _time(archive: Archive, words: list[str]) -> None:
    if words[1]:
        archive.time = real(words[1], "TIME")


def _solve(archive: Archive, words: list[str]) -> None:
    """SOLVE; the first one of modes is that which is taken."""
    if archive.modes or words[1].upper() == "ELFORM":
        return
    if archive.analysis == "MODAL":
        archive.modes = archive.where
        return
    time = float(len(archive.solved) + 1) if not archive.time else archive.time
    archive.solved.append(
        Solution(
            archive.where, archive.analysis, archive.nonlinear, time, archive.acting.now(), deepcopy(archive.held)
        )
    )  # fmt: skip


def _more(archive: Archive, words: list[str]) -> None:
    archive.leave_out(f"{words[0].upper()} (several load steps by files)")


COMMANDS: dict[str, Command] = {
    "F": _force, "FBLOCK": _forces_block, "FDELE": _deleted, "DDELE": _deleted, "SF": _on_nodes,
    "SFE": _on_faces, "SFEBLOCK": _faces_block, "SFDELE": _faces_deleted, "SFEDELE": _faces_deleted,
    **dict.fromkeys(("ACEL", "OMEGA", "CMOMEGA", "CMACEL", "DOMEGA", "CGOMGA", "DCGOMG", "CMDOMEGA"), _field),
    "TUNIF": _uniform, "BFUNIF": _uniform, "BF": _temperature, "BFBLOCK": _temperatures_block,
    "BFE": _cell_temperature, "BFEBLOCK": _refuse_blocked, "BFDELE": _temperatures_deleted,
    "BFEDELE": _temperatures_deleted, "LSCLEAR": _cleared, "LSSOLVE": _more,
    **dict.fromkeys(("FCUM", "DCUM", "SFCUM", "BFCUM"), _added),
    "ANTYPE": _analysis, "PERTURB": _perturbed, "PSTRES": _prestress, "NLGEOM": _geometry, "TIME": _time,
    "SOLVE": _solve,
}  # fmt: skip


# assembly ---------------------------------------------------------------------------------------


def last_of(archive: Archive) -> Solution:
    """The solution that modes are about, or what acts at the end of the archive."""
    now = Solution(archive.where, "STATIC", archive.nonlinear, archive.time or 1.0, archive.acting, archive.held)
    if not archive.solved:
        return now._replace(kind="STATIC" if archive.analysis == "MODAL" else archive.analysis)
    number = (archive.perturbed or 0) or len(archive.solved)
    if number > len(archive.solved):
        raise Damaged(f"{archive.path}: ANTYPE names the load step {number} of {len(archive.solved)}")
    return archive.solved[number - 1]


def state_of_archive(archive: Archive, raw: RawMesh, numbering: Numbering) -> None:
    """Give `raw` the static step that the archive's modes are about.

    Raises:
        Damaged: with the line, what is wrong with a load.
    """
    solution, there = last_of(archive), set(archive.node_id)
    acting = _Acting(archive, raw, numbering, solution)
    if not archive.prestressed and archive.perturbed is None:
        idle = [*acting.kinds(), *archive.unused]
        if "D" in idle:
            moved = next(w for v, w in solution.acting.moved.values() if acting.counts(v))
            raw.remarks.append(f"{moved}: D prescribes displacements: they are zero in modes, as in Ansys")
            idle.remove("D")
        if idle:
            text = "loads, which change no frequency of an unstressed body (PSTRES, PERTURB)"
            raw.remarks.append(f"read and not used: {', '.join(idle)}: {text}")
        return
    with of_file(archive.place(solution.where)):
        loads = list(acting.loads())
    if solution.kind != "STATIC":
        archive.lost.append(
            f"{solution.where}: the modes are about the state that an analysis {solution.kind} leaves, which is "
            "not computed here: frequencies will differ"
        )
    elif loads or solution.acting.nodal or solution.acting.cells or solution.acting.uniform:
        still, held = solution.held, None
        if (still.sets, still.nodes) != (archive.held.sets, archive.held.nodes):
            nodes = {n: w for n, w in still.nodes.items() if n in there or n not in archive.ranged}
            held = still_supports(raw, replace(still, nodes=nodes, axes=archive.held.axes), numbering)
        raw.state = StaticStep(f"{solution.where}: SOLVE", solution.nonlinear, tuple(loads), held)
    else:
        archive.lost.append(
            f"{archive.path}: its modes are about a static state whose loads are not in it: frequencies will differ"
        )


@dataclass
class _Acting:
    """What acts at a solution, on the mesh."""

    archive: Archive
    raw: RawMesh
    numbering: Numbering
    solution: Solution

    def at(self, word: str, where: str) -> float:
        """A value at the end of the solution; 0 of what is not read, which is noted."""
        value = value_at(self.archive, word, self.solution.time)
        if value is None:
            text = f"the table {word} hangs on something else than TIME, or is not there"
            self.raw.lost.append(f"{where}: {text}: left out, {_IMPORTANT}")
        return value or 0.0

    def kinds(self) -> list[str]:
        """Commands of what acts, without those whose numbers are zero."""
        acting, some = self.solution.acting, list[str]()
        parts = {"F": acting.forces, "D": acting.moved}
        some += [name for name, part in parts.items() if any(self.counts(v) for v, _ in part.values())]
        some += ["SFE"] * any(self.counts(v) for values, _ in acting.faces.values() for v in values)
        fields = acting.fields.items()
        return some + [name for name, (values, _) in fields if any(map(self.counts, values))]

    def counts(self, word: str) -> bool:
        """Whether a value is not zero, or a table that is not read."""
        if re.fullmatch(r"[\s0.+-]*([eEdD][-+]?\d+)?", word):
            return False
        return not word.startswith("%") or value_at(self.archive, word, self.solution.time) != 0

    def loads(self) -> Iterator[NodalLoad | FacetLoad | BodyLoad | SpinLoad]:
        """All of them, by positions in the file."""
        acting = self.solution.acting
        terms: Terms = {}
        for kind, part in (("force", acting.forces), ("displacement", acting.moved)):
            for (node, way), (word, where) in part.items():
                if amount := self.at(word, where):
                    terms[kind, node, "xyzabc".index(way)] = amount, f"{where}: {'FD'[kind[0] == 'd']}"
        yield from nodal_loads(self.raw, terms, self.archive.held.axes, self.numbering)
        yield from self._pressures()
        for name, (words, where) in acting.fields.items():
            yield from self._field(name, words, where)

    def _pressures(self) -> Iterator[FacetLoad]:
        acting = self.solution.acting.faces
        numbers = {number for number, _ in acting}
        elements = {e.number: e for e in self.archive.elements if e.number in numbers}
        solid: dict[tuple[int, ...], tuple[float | Array, str]] = {}
        facing = _Facing(self.raw, self.numbering)
        for (number, face), (words, where) in acting.items():
            place = f"{where}: SFE,{number},{face},PRES"
            amounts = [self.at(word, where) for word in words]
            if not any(amounts):
                continue
            if number not in elements:
                raise Damaged(f"{place} names the element {number}, which is not there; correct it")
            element = elements[number]
            if face not in (corners := sides(self.archive, element)):
                self._left(place, "names a face that this element does not have")
                continue
            nodes = corners[face]
            amounts = (amounts * len(nodes))[: len(nodes)]
            values = dict(zip(nodes, amounts, strict=True))
            ring = list(dict.fromkeys(nodes))
            if len(ring) < 3:
                self._left(place, "names a face that this element does not have")
                continue
            at = self.numbering.positions(ring, f"{place} names")
            yield from self._pressure(element, face, at, np.array([values[n] for n in ring]), place, facing, solid)
        yield from facet_loads(solid)

    def _pressure(
        self, element: Element, face: int, at: Indices, values: Array, place: str, facing: _Facing, solid: dict
    ) -> Iterator[FacetLoad]:
        """A pressure into the body, or of SURF154 a traction along an axis of its system."""
        ansys = self.archive.kinds[element.kind]
        where = place.partition(": ")[0] + ": SFE"
        if ansys in SURFACES:
            options = self.archive.options.get(element.kind, {})
            sign = facing.of(at)
            if not sign:
                self._left(place, "acts on no face of the solids that are read")
                return
            if face <= 3 and options.get(2, "0") == "1":
                system = self.archive.systems.get(element.system, System())
                centre = self.raw.points[at].mean(axis=0)
                yield FacetLoad(where, at[None], values[None], system.directions(centre[None])[0, face - 1])
                return
            if face != 1 or options.get(2, "0") not in ("", "0"):
                self._left(place, "acts along tangents or a vector (faces 2 to 5 of SURF154)")
                return
            values = sign * values
        key = tuple(at.tolist())  # several surface elements may lie on a face
        solid[key] = values + (solid[key][0] if key in solid else 0.0), where

    def _left(self, place: str, what: str) -> None:
        self.raw.lost.append(f"{place} {what}: left out, {_IMPORTANT}")

    def _field(self, name: str, words: list[str], where: str) -> Iterator[BodyLoad | SpinLoad]:
        """ACEL accelerates what the body stands on: it is pulled the other way."""
        label = name.partition(" ")[0]
        chosen, cells = words, None
        if label.startswith("CM"):
            numbers, chosen = self.archive.cells(words[0]), words[1:]
            if numbers is None:
                raise Damaged(f"{name} names a component of elements that is not there; correct it")
            cells = np.array(sorted(numbers), dtype=np.int64)
        values = np.array([self.at(w, where) if w else 0.0 for w in [*chosen, *[""] * 9][:9]])
        place = f"{where}: {label}"
        if not values[:3].any():
            return
        masses = {e.number for e in self.archive.elements if self.archive.kinds.get(e.kind) == 21}
        if label == "CMACEL" and cells is not None and not masses.isdisjoint(cells.tolist()):
            self._left(place, "pulls point masses (MASS21) by a component: these")
        if label in ("ACEL", "CMACEL"):
            yield BodyLoad(place, -values[:3], cells)
        elif label == "OMEGA":
            speed = float(np.linalg.norm(values[:3]))
            if [*chosen, "", "", "", ""][3] == "0":
                text = "Ansys leaves spin softening out (KSPIN = 0); here it counts"
                self.raw.remarks.append(f"{place}: {text}, see rotation.spin_softening")
            yield SpinLoad(place, speed, values[:3], np.zeros(3))
        elif label == "CMOMEGA":
            along = values[6:9] - values[3:6] if any(chosen[6:9]) else values[:3]
            if not along.any():
                raise Damaged(f"{name} has an axis of no length; correct its two points")
            speed = values[0] if any(chosen[6:9]) else float(np.linalg.norm(along))
            yield SpinLoad(place, abs(speed), along, values[3:6], cells)
        else:
            self._left(place, "is not read")


class _Facing:
    """Which way facets look: +1 if their normal by the order of their corners points out of a solid."""

    def __init__(self, raw: RawMesh, numbering: Numbering) -> None:
        self.raw, self.inside = raw, dict[frozenset[int], Array]()

    def of(self, corners: Indices) -> float:
        """+1, -1, or 0 of a facet of no solid."""
        if not self.inside:
            for kind, cells in self.raw.blocks:
                middle = self.raw.points[cells[:, : CELL_TYPES[kind].corners]].mean(axis=1)
                for facet in CELL_TYPES[kind].facets:
                    ring = [i for i in facet if i < CELL_TYPES[kind].corners]
                    for row, centre in zip(cells[:, ring].tolist(), middle, strict=True):
                        self.inside[frozenset(row)] = centre
        centre = self.inside.get(frozenset(corners.tolist()))
        if centre is None:
            return 0.0
        x = self.raw.points[corners]
        normal = np.cross(x[2] - x[0], x[-1] - x[1] if len(x) > 3 else x[1] - x[0])
        normal = normal if len(x) > 3 else -normal
        return float(np.sign(normal @ (x.mean(axis=0) - centre)))


# temperatures -----------------------------------------------------------------------------------

_MIDDLES = {
    20: ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)),
    10: ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
}  # fmt: skip


def temperatures_of(archive: Archive, raw: RawMesh, numbering: Numbering) -> None:
    """Give `raw` the stress-free and the actual temperatures, in the unit of the archive.

    Raises:
        Damaged: nodes or elements that are not there.
    """
    solution = last_of(archive)
    acting, at = solution.acting, _Acting(archive, raw, numbering, solution).at
    free = archive.reference
    if not (acting.nodal or acting.cells or acting.uniform) and free is None:
        return
    raw.temperature = np.full((len(raw.points), 2), np.nan)
    raw.temperature[:, 0] = free or 0.0
    raw.temperature[:, 1] = at(acting.uniform, archive.path) if acting.uniform else free or 0.0
    if acting.cells:
        _by_cells(archive, raw, numbering, at)
    if acting.nodal:
        places = numbering.positions(list(acting.nodal), "BF names")
        raw.temperature[places, 1] = [at(word, f"{archive.path}: BF") for word in acting.nodal.values()]


def _by_cells(
    archive: Archive, raw: RawMesh, numbering: Numbering, at: Callable[[str, str], float]
) -> None:
    """Temperatures of elements as those of their nodes."""
    values: dict[int, float] = {}
    elements = {e.number: e for e in archive.elements}
    for number, words in last_of(archive).acting.cells.items():
        if number not in elements:
            raise Damaged(f"BFE names the element {number}, which is not there; correct it")
        nodes, own = elements[number].nodes, {k: at(w, "BFE") for k, w in words.items()}
        if [*own] == [1]:
            own = dict.fromkeys(range(1, len(nodes) + 1), own[1])
        corners = 4 if len(nodes) == 10 else min(len(nodes), 8)
        for place, (a, b) in enumerate(_MIDDLES.get(len(nodes), ()), corners + 1):
            if a + 1 in own and b + 1 in own:
                own.setdefault(place, (own[a + 1] + own[b + 1]) / 2)
        for place, node in enumerate(nodes, 1):
            if place in own and node:
                if abs(values.setdefault(node, own[place]) - own[place]) > 1e-9 * abs(own[place]):
                    archive.lost.append(
                        f"{archive.path}: BFE gives node {node} two temperatures, by its elements: the first is "
                        "taken, frequencies may differ"
                    )
    assert raw.temperature is not None
    raw.temperature[numbering.positions(list(values), "BFE names"), 1] = list(values.values())
