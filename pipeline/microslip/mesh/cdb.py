"""Reader of Ansys archives (CDWRITE, blocked) and of Workbench's input files: nodes, solid cells,
degenerate ones too, components, materials.

Written against the description of the coded database file in the Ansys Programmer's Reference
(NBLOCK, EBLOCK, ETBLOCK, CMBLOCK, MPDATA) and the node orders of SOLID185, 186, 187 and 285 in the
Element Reference. A brick whose corners coincide is a wedge (K = L, O = P), a pyramid (M = N = O = P) or
a tetrahedron (both).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..data import Array, Equation, Link, RigidLink
from ..elasticity import turned_strain
from ..errors import of_file
from .materials import isotropic_rows, orthotropic_row
from .raw import (
    PRESTRESSED,
    Damaged,
    DeckMaterial,
    Numbering,
    RawMesh,
    ignored,
    is_number,
    lost,
    real,
)
from .supports import Constraints, add_supports

_SOLIDS = {185: 8, 45: 8, 186: 20, 95: 20, 187: 10, 92: 10, 285: 4}
"""Element type -> number of nodes. Others that are known to hold no stiffness of a solid are left out."""
_OTHERS = {14, 21, 156, 184, 188, 189, 200, 208, 209, 214, 281, 290}
_OTHERS |= {*range(151, 155), *range(169, 176), *range(177, 182)}
_HARMLESS = {*range(151, 157), 200}
"""Those of `_OTHERS` without mass and stiffness: surface effects, cells to mesh from."""
# corners I J K L M N O P are 0-7; mid-sides Q R S T U V W X Y Z A B are 8-19
_FORMS: dict[int, dict[str, Sequence[int]]] = {
    8: {"hexahedron": range(8), "wedge": (0, 1, 2, 4, 5, 6), "pyramid": range(5), "tetra": (0, 1, 2, 4)},
    20: {
        "hexahedron20": range(20), "wedge15": (0, 1, 2, 4, 5, 6, 8, 9, 11, 12, 13, 15, 16, 17, 18),
        "pyramid13": (0, 1, 2, 3, 4, 8, 9, 10, 11, 16, 17, 18, 19), "tetra10": (0, 1, 2, 4, 8, 9, 11, 16, 17, 18),
    },
    10: {"tetra10": range(10)},
    4: {"tetra": range(4)},
}  # fmt: skip


@dataclass
class _Archive:
    """What the commands have said. elements: (number, material, type, system, nodes). places: of equations, by name.
    kind: of the elements that follow (TYPE). outside: kind -> where, and how many elements, beside EBLOCK,,SOLID.
    options: type -> number of a KEYOPT -> its value. selected: the component that CMSEL chose last. parameters: numbers
    of *SET, by their names in capitals. unused: loads that are not taken. ranged: numbers that ranges of D go over.
    """

    node_id: list[int] = field(default_factory=list)
    points: list[list[float]] = field(default_factory=list)
    kinds: dict[int, int] = field(default_factory=dict)
    elements: list[tuple[int, int, int, int, list[int]]] = field(default_factory=list)
    components: dict[str, list[int]] = field(default_factory=dict)
    temperatures: dict[int, float] = field(default_factory=dict)
    constants: dict[int, dict[str, dict[int, float]]] = field(default_factory=dict)
    tables: dict[int, dict[str, dict[int, float]]] = field(default_factory=dict)
    reference: float | None = None
    uniform: float | None = None
    nodal: dict[int, float] = field(default_factory=dict)
    held: Constraints = field(default_factory=Constraints)
    equations: dict[str, list[tuple[int, str, float]]] = field(default_factory=dict)
    rigid: list[tuple[int, str, str, str]] = field(default_factory=list)
    open: str = ""
    where: str = ""
    places: dict[str, str] = field(default_factory=dict)
    kind: int = 1
    outside: dict[int, tuple[str, int]] = field(default_factory=dict)
    options: dict[int, dict[int, str]] = field(default_factory=dict)
    selected: str = ""
    parameters: dict[str, str] = field(default_factory=dict)
    stressed: bool = False
    ranged: set[int] = field(default_factory=set)
    unused: list[str] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)


def read_cdb(path: Path) -> RawMesh:
    """Read an archive.

    Raises:
        Damaged: content that is inconsistent, or elements whose meaning would be lost, by their number.
    """
    lines = path.read_text(encoding="latin-1").splitlines()
    archive, at = _Archive(), _beginning(lines)
    while at < len(lines):
        archive.where = f"{path.name}, line {at + 1}"
        block = 0
        with of_file(f"{path}, line {at + 1}"):
            for words in _commands(archive, lines[at]):
                command = words[0].upper()
                if command in _BLOCKS:
                    block = _BLOCKS[command](archive, words, lines, at + 1)
                elif command in _COMMANDS:
                    _COMMANDS[command](archive, [*words, *_BLANKS])
                if command in _NOT_READ:
                    archive.lost.append(lost(archive.where, command))
                elif re.fullmatch(_LOADS, command):
                    archive.unused.append(command)
        at = block or at + 1
    raw = _assembled(archive)
    raw.lost = [*archive.lost, *_other_elements(archive, path.name)]
    raw.remarks += [*_integration(archive), *ignored(archive.unused, _LOADS, archive.stressed)]
    if not any(line.strip().upper().startswith("FINI") for line in lines[-20:]):
        raw.unended = "no FINISH"  # a warning: archives that were shortened by hand have none
    return raw


def _beginning(lines: list[str]) -> int:
    """The line where the archive begins: behind the drawing (IGES) that CDWRITE may put before it."""
    marks = (n for n, line in enumerate(lines) if line.upper().startswith(":CDWRITE"))
    return next(marks, 0)


_TEXTS = ("/COM", "/TITLE", "/STITLE", "C***", "*DIM", "/WB", "/INPUT")
"""Beginnings of lines that are texts, in which no command stands."""


def _commands(archive: _Archive, line: str) -> Iterator[list[str]]:
    """The words of the commands of a line, parameters replaced by their values."""
    line = line.split("!")[0].strip()
    if line.upper().startswith(_TEXTS):
        return
    for part in line.split("$"):
        words = [word.strip() for word in part.split(",")]
        name, sign, value = words[0].partition("=")
        if sign:
            words = ["*SET", name.strip(), value.strip()]
        if words[0].upper() == "*SET":
            yield words
        elif words[0]:
            known = archive.parameters
            yield [words[0], *(known.get(word.upper(), word) for word in words[1:])]


# blocks --------------------------------------------------------------------------------------------------------------


def _widths(lines: list[str], at: int, what: str) -> list[tuple[int, int, str]]:
    """(first, last, kind) of the fields of a format line such as ``(3i9,6e21.13e3)``."""
    line = lines[at].strip().lower() if at < len(lines) else ""
    if not line.startswith("("):
        raise Damaged(f"{what} has no line with its format")
    fields, place = [], 0
    for count, kind, width in re.findall(r"(\d*)([iea])(\d+)", re.sub(r"\.\d+(e\d+)?", "", line)):
        if not 0 < int(width) < 100 or int(count or 1) > 1000:
            raise Damaged(f"{what} has the format {line[:60]}, which cannot be")
        for _ in range(int(count or 1)):
            fields.append((place, place + int(width), kind))
            place += int(width)
    if not fields:
        raise Damaged(f"{what} has the format {line[:60]}, which is not read")
    return fields


def _whole(text: str, what: str) -> int:
    try:
        value = int(text)
    except ValueError:
        raise Damaged(f"{what} holds '{text.strip()[:30]}' where a whole number belongs") from None
    if abs(value) > 10**12:
        raise Damaged(f"{what} holds the number {value}")
    return value


def _read_nodes(archive: _Archive, words: list[str], lines: list[str], at: int) -> int:
    fields = _widths(lines, at, "NBLOCK")
    whole = [f for f in fields if f[2] == "i"]
    coordinates = [f for f in fields if f[2] == "e"]
    coordinates, angles = coordinates[:3], coordinates[3:]
    if not whole or len(coordinates) < 3:
        raise Damaged("NBLOCK has a format without a number and three coordinates")
    before, announced = len(archive.node_id), _announced(words)
    for number, line in enumerate(lines[at + 1 :], at + 1):
        if line.strip() == "-1":
            return number + 1
        if re.match(r"\s*[^\d\s]", line):  # N,UNBL,LOC,-1, or the next command
            if len(archive.node_id) - before < announced:
                text = f"{len(archive.node_id) - before} nodes of {announced}"
                raise Damaged(f"NBLOCK holds {text} that it announces")
            return number
        archive.node_id.append(_whole(line[: whole[0][1]], "NBLOCK"))
        if any(real(t, "NBLOCK") for a, b, _ in angles if (t := line[a:b].strip())):
            archive.held.turned.add(archive.node_id[-1])
        given = [line[a:b] for a, b, _ in coordinates]
        archive.points.append([real(t, "NBLOCK") if t.strip() else 0.0 for t in given])
    raise Damaged("NBLOCK has no end, the file is truncated")


def _announced(words: list[str]) -> int:
    """How many nodes a block says that it has: NBLOCK, fields, SOLID, largest number, count."""
    return int(words[4]) if len(words) > 4 and words[4].isdecimal() else 0


def _read_elements(archive: _Archive, words: list[str], lines: list[str], at: int) -> int:
    if "COMPACT" in (word.upper() for word in words):
        raise Damaged("EBLOCK is in the COMPACT form; write the archive with EBLOCK,19,SOLID (CDWRITE)")
    fields = _widths(lines, at, "EBLOCK")
    solid = len(words) > 2 and words[2].upper() == "SOLID"
    announced = _whole(words[4], "EBLOCK") if solid and len(words) > 4 and words[4] else 0
    before = len(archive.elements)
    at += 1
    while at < len(lines):
        first = _row(lines[at], fields)
        if first[:1] == [-1]:
            if announced not in (0, len(archive.elements) - before):
                raise Damaged(f"EBLOCK announces {announced} elements and holds {len(archive.elements) - before}")
            return at + 1
        if not first:
            raise Damaged("EBLOCK has an empty line instead of -1 at its end, the file is truncated")
        at += 1
        if not solid:
            known = len(first) > 1 and first[1] in archive.kinds
            _leave_out(archive, words, first[1] if known else archive.kind)
            continue
        if len(first) < 12:
            raise Damaged(f"EBLOCK holds the line '{lines[at - 1].strip()[:60]}', which is too short")
        count, nodes = first[8], first[11:]
        while len(nodes) < count and at < len(lines):
            more = _row(lines[at], fields)
            at += 1
            if not more or more[0] == -1:
                raise Damaged(f"element {first[10]} has {len(nodes)} nodes instead of {count}")
            nodes += more
        archive.elements.append((first[10], first[0], first[1], first[4], nodes[:count]))
    raise Damaged("EBLOCK has no end, the file is truncated")


def _row(line: str, fields: list[tuple[int, int, str]]) -> list[int]:
    return [_whole(line[a:b], "EBLOCK") for a, b, _ in fields if line[a:b].strip()]


def _read_component(archive: _Archive, words: list[str], lines: list[str], at: int) -> int:
    """Numbers; a negative one ends a range that began with the number before it."""
    if len(words) < 4:
        raise Damaged("a CMBLOCK has no name or number of members")
    fields, count = _widths(lines, at, "CMBLOCK"), _whole(words[3], "CMBLOCK")
    listed: list[int] = []
    at += 1
    while len(listed) < count:
        if at >= len(lines) or not (row := _row(lines[at], fields)):
            raise Damaged(f"the component {words[1]} has {len(listed)} numbers instead of {count}")
        listed += row
        at += 1
    if words[2].upper().startswith("NODE"):
        archive.components.setdefault(words[1], []).extend(_ranges(listed, words[1]))
    return at


def _ranges(listed: list[int], name: str) -> list[int]:
    members: list[int] = []
    for number in listed:
        if number < 0 and (not members or -number - members[-1] > 10**8):
            raise Damaged(f"the component {name} holds a range without a beginning, or beyond all bounds")
        members += [number] if number > 0 else range(members[-1] + 1, -number + 1)
    return members


def _read_types(archive: _Archive, words: list[str], lines: list[str], at: int) -> int:
    """Number, element and 18 KEYOPTs of each type; -1 ends them."""
    fields = _widths(lines, at, "ETBLOCK")
    if len(fields) < 4:
        raise Damaged("ETBLOCK has a format without a number, an element and its options")
    for number, line in enumerate(lines[at + 1 :], at + 1):
        row = [line[a:b].strip() for a, b, _ in fields]
        if row[0] == "-1":
            return number + 1
        kind = _whole(row[0], "ETBLOCK")
        archive.kinds[kind] = _whole(row[1], "ETBLOCK")
        archive.options[kind] = {n: w for n, w in enumerate(row[2:]) if w}
    raise Damaged("ETBLOCK has no end, the file is truncated")


_BLANKS = [""] * 8
"""Fields that a line may leave out at its end."""


_BLOCKS = {
    "NBLOCK": _read_nodes,
    "EBLOCK": _read_elements,
    "CMBLOCK": _read_component,
    "ETBLOCK": _read_types,
}


# commands ------------------------------------------------------------------------------------------------------------


def _read_type(archive: _Archive, words: list[str]) -> None:
    if words[1].isdecimal() and words[2]:
        number, kind = re.search(r"\d+$", words[2]), _whole(words[1], "ET")
        archive.kinds[kind] = int(number[0]) if number else 0
        archive.options[kind] = {n: w for n, w in enumerate(words[3:9], 1) if w}


def _read_option(archive: _Archive, words: list[str]) -> None:
    """KEYOPT, type, number, value."""
    if words[1].isdecimal() and words[2].isdecimal():
        options = archive.options.setdefault(_whole(words[1], "KEYOPT"), {})
        options[_whole(words[2], "KEYOPT")] = words[3]


def _read_parameter(archive: _Archive, words: list[str]) -> None:
    """*SET, name, value: a number, or a parameter that is."""
    name, value = words[1].upper(), archive.parameters.get(words[2].upper(), words[2])
    archive.parameters.pop(name, None)
    if re.fullmatch(_NUMBER, value):
        whole = float(value).is_integer() and "e" not in value.lower()
        archive.parameters[name] = str(int(float(value))) if whole else value


_NUMBER = r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d{1,3})?"


def _read_selection(archive: _Archive, words: list[str]) -> None:
    """CMSEL,S,component; every other selection, or all, is none that is known."""
    chosen = words[0].upper() == "CMSEL" and words[1].upper() in ("S", "")
    archive.selected = words[2].upper() if chosen else ""


def _read_current(archive: _Archive, words: list[str]) -> None:
    if words[1].isdecimal():
        archive.kind = _whole(words[1], "TYPE")


def _leave_out(archive: _Archive, words: list[str], kind: int | None = None) -> None:
    """An element, of the current type if none is given, outside EBLOCK,,SOLID: E, EN, short blocks."""
    kind = archive.kind if kind is None else kind
    where, count = archive.outside.get(kind, (archive.where, 0))
    archive.outside[kind] = where, count + 1


def _stressed(archive: _Archive, words: list[str]) -> None:
    """PSTRES,ON, and a restart of a loaded state (ANTYPE,,RESTART,,,PERTURB)."""
    on = words[0].upper() == "PSTRES" and words[1].upper() in ("ON", "1")
    if on or "PERTURB" in (word.upper() for word in words):
        archive.stressed = True
        archive.lost.append(f"{archive.where}: {words[0].upper()}: {PRESTRESSED}")


def _behind_release(words: list[str]) -> list[str]:
    """What stands behind the command and "R5.0, count" or "UNBL, count"."""
    return words[3:] if words[1].upper().startswith(("R5", "UNBL")) else words[1:]


def _read_temperatures(archive: _Archive, words: list[str]) -> None:
    """MPTEMP[, R5.0, count], first place, values; alone it clears the table."""
    rest = _behind_release(words)
    if not any(rest):
        archive.temperatures = {}
        return
    start = _whole(rest[0], "MPTEMP")
    for i, text in enumerate(t for t in rest[1:] if t):
        archive.temperatures[start + i] = real(text, "MPTEMP")


def _read_data(archive: _Archive, words: list[str]) -> None:
    """MPDATA[, R5.0, count], label, material, first place, values."""
    rest = _behind_release(words)
    if not any(rest[3:]) or not re.fullmatch(_CONSTANTS, rest[0], re.IGNORECASE):
        return
    material, label = _whole(rest[1], "MPDATA"), rest[0].upper()
    start = _whole(rest[2] or "1", "MPDATA")
    values = archive.constants.setdefault(material, {}).setdefault(label, {})
    table = archive.tables.setdefault(material, {}).setdefault(label, {})
    for place, text in enumerate((t for t in rest[3:] if t), start):
        values[place], table[place] = real(text, "MPDATA"), archive.temperatures.get(place, 0.0)


def _read_constant(archive: _Archive, words: list[str]) -> None:
    """MP, label, material, value[, slopes over temperature]."""
    if words[3] and re.fullmatch(_CONSTANTS, words[1], re.IGNORECASE):
        if any(real(w, "MP") for w in words[4:] if w):
            raise Damaged(f"MP,{words[1]},{words[2]} is a polynomial of temperature; write a table (MPTEMP, MPDATA)")
        material = _whole(words[2] or "1", "MP")
        archive.constants.setdefault(material, {})[words[1].upper()] = {1: real(words[3], "MP")}
        archive.tables.setdefault(material, {})[words[1].upper()] = {1: 0.0}


def _read_reference(archive: _Archive, words: list[str]) -> None:
    if words[1]:
        archive.reference = real(words[1], "TREF")


def _read_uniform(archive: _Archive, words: list[str]) -> None:
    if words[0].upper() == "TUNIF" and words[1]:
        archive.uniform = real(words[1], "TUNIF")
    elif words[1].upper() == "TEMP" and words[2] not in ("", "_TINY"):  # how Ansys says none
        archive.uniform = real(words[2], "BFUNIF")


def _read_body_force(archive: _Archive, words: list[str]) -> None:
    if words[2].upper() == "TEMP" and words[1].lstrip("-").isdecimal() and words[3]:
        archive.nodal[_whole(words[1], "BF")] = real(words[3], "BF")


def _refuse_temperatures(archive: _Archive, words: list[str]) -> None:
    if words[2].upper().startswith("TEMP"):
        raise Damaged("BFBLOCK with temperatures is not read; write them as BF commands (CDWRITE, UNBLOCKED)")


def _read_displacement(archive: _Archive, words: list[str]) -> None:
    """D, node or component, UX or UY or UZ or ALL, value, its imaginary part, last node, step, further labels."""
    where, label, value, _, last, step, *more = words[1:]
    directions = "".join("xyzabc" if w.upper() == "ALL" else _LABELS.get(w.upper(), "") for w in (label, *more))
    if not directions:
        return
    named = {name.upper(): name for name in archive.components}
    component = named.get(archive.selected if where.upper() == "ALL" else where.upper())
    if value.startswith("%"):
        archive.held.left_out.append(f"D,{where},{label} takes its displacement from the table {value}")
    elif value and real(value, "D") != 0:
        archive.held.left_out.append(f"D,{where},{label} prescribes a displacement")
    elif component is not None:
        archive.held.hold(component, directions)
    elif is_number(where):
        first, end = int(where), _whole(last, "D") if last else int(where)
        every = range(first, min(end, first + 10**8) + 1, max(_whole(step or "1", "D"), 1))
        archive.ranged.update(every[1:])
        for node in every:
            archive.held.hold(node, directions)
    else:
        archive.held.left_out.append(f"D,{where},{label} names no node by its number")


_LABELS = {"UX": "x", "UY": "y", "UZ": "z", "ROTX": "a", "ROTY": "b", "ROTZ": "c"}


def _read_equation(archive: _Archive, words: list[str]) -> None:
    """CE, number, constant, then node, label, factor in threes; or CE,R5.0,DEFI, length, number, constant and rows
    CE,R5.0,NODE of terms, as archives have it."""
    if words[1].upper().startswith("R5"):
        if words[2].upper() == "DEFI":
            archive.open = words[4]
            number, constant, terms = words[4], words[5], []
        else:
            number, constant, terms = archive.open, "", words[3:]
    else:
        number, constant, *terms = words[1:]
    if constant and real(constant, "CE") != 0:
        raise Damaged(f"the constraint equation CE {number} has the constant {constant}; only 0 is read")
    archive.places.setdefault(f"CE {number}", f"{archive.where}: CE {number}")
    found = archive.equations.setdefault(f"CE {number}", [])
    for place in range(0, len(terms) - 2, 3):
        node, label, factor = terms[place : place + 3]
        if node:
            if label.upper() not in _LABELS:
                raise Damaged(f"the constraint equation CE {number} takes in {label or 'nothing'} of node {node}")
            found.append((_whole(node, "CE"), _LABELS[label.upper()], real(factor, "CE")))


def _read_coupled(archive: _Archive, words: list[str]) -> None:
    """CP, number, label, nodes: displacements that are equal."""
    number, label, *nodes = words[1:]
    nodes, ways = [n for n in nodes if n], "xyz" if label.upper() == "ALL" else _LABELS.get(label.upper(), "")
    if len(nodes) < 2 or not ways or not all(map(is_number, nodes)):
        raise Damaged(f"CP {number} couples other things than {label or 'UX'} of two nodes or more in its line; use CE")
    for node in nodes[1:]:
        for way in ways:
            terms = [(_whole(nodes[0], "CP"), way, 1.0), (_whole(node, "CP"), way, -1.0)]
            name = f"CP {number}, {label} of node {node}, {way}"
            archive.places[name], archive.equations[name] = f"{archive.where}: CP {number}", terms


def _read_rigid(archive: _Archive, words: list[str]) -> None:
    """CERIG, master, slave node or component, directions."""
    master, slave, label = words[1:4]
    ways = {"": "xyzabc", "ALL": "xyzabc", "UXYZ": "xyz", "RXYZ": "abc"}.get(
        label.upper(), _LABELS.get(label.upper(), "?")
    )
    if ways == "?" or slave.upper() in ("ALL", ""):
        raise Damaged(f"CERIG,{master},{slave},{label} is not read; name one node or component, and ALL, UXYZ or UX")
    archive.rigid.append((_whole(master, "CERIG"), slave, ways, f"{archive.where}: CERIG,{master},{slave}"))


_CONSTANTS = "E[XYZ]|(NU|PR|G)(XY|YZ|XZ)|DENS|(ALP|CTE)[XYZ]"
"""Constants of a material that modes and static states need."""


_COMMANDS = {
    "CE": _read_equation, "CERIG": _read_rigid, "CP": _read_coupled,
    "D": _read_displacement, "E": _leave_out, "EN": _leave_out, "TYPE": _read_current,
    "ET": _read_type, "MPTEMP": _read_temperatures, "MPDATA": _read_data, "MP": _read_constant, "TREF": _read_reference,
    "TUNIF": _read_uniform, "BFUNIF": _read_uniform, "BF": _read_body_force, "BFBLOCK": _refuse_temperatures,
    "KEYOPT": _read_option, "KEYOP": _read_option, "KEYO": _read_option, "*SET": _read_parameter, "CMSEL": _read_selection,
    "NSEL": _read_selection, "ALLSEL": _read_selection, "ALLS": _read_selection,
    "ESEL": _read_selection, "PSTRES": _stressed, "ANTYPE": _stressed, "ANTY": _stressed,
}  # fmt: skip


_NOT_READ = {
    "RBE3", "CEINTF", "CPINTF", "CPNGEN", "CPLGEN", "CPCYC", "CECYC", "CESGEN", "CPSGEN", "MATWRITE", "EGEN", "ENGEN",
    "EMODIF", "MPCHG", "INISTATE", "CYCLIC",
}  # fmt: skip
"""Commands that constrain, or add or change elements, and are not read."""
_LOADS = "F|FBLOCK|SF|SFE|SFEBLOCK|ACEL|OMEGA|DOMEGA|CMOMEGA|CMACEL|CGOMGA|BFE|SLOAD|PSLOAD"


# assembly ------------------------------------------------------------------------------------------------------------


def _assembled(archive: _Archive) -> RawMesh:
    if not archive.node_id:
        raise Damaged("there is no NBLOCK")
    node_id = np.array(archive.node_id, dtype=np.int64)
    numbering = Numbering(node_id)
    raw = RawMesh(np.array(archive.points), node_id)
    regions: dict[tuple[int, int], int] = {}
    blocks: dict[str, list[tuple[int, int, list[int]]]] = {}
    for number, material, kind, system, nodes in archive.elements:
        named = _form(archive, number, kind, nodes)
        if named is not None:
            region = regions.setdefault((material, system), len(regions))
            blocks.setdefault(named[0], []).append((number, region, named[1]))
    raw.add_solids(blocks, numbering, "EBLOCK names")
    for name, members in archive.components.items():
        if members:
            raw.add_set(name, members, numbering)
    raw.links = _links(archive, numbering)
    for gap in archive.ranged.difference(archive.node_id):
        archive.held.nodes.pop(gap, None)
    add_supports(raw, archive.held, numbering)
    raw.materials = [_material(archive, *key) for key in regions] if archive.constants else []
    if not raw.materials:
        raw.regions = []
    _assign_temperatures(archive, raw, numbering)
    return raw


def _links(archive: _Archive, numbering: Numbering) -> list[Link]:
    """Constraint equations, and nodes that follow one rigidly."""
    found: list[Link] = []
    for name, terms in archive.equations.items():
        where = archive.places[name]
        if not terms:
            raise Damaged(f"the constraint equation {where} has no terms")
        numbers, directions, factors = map(list, zip(*terms, strict=True))
        nodes = numbering.positions(numbers, f"{where} names")
        _refuse_turned(archive, where, numbers)
        found.append(Equation(where, nodes, np.array(["xyzabc".index(d) for d in directions]), np.array(factors)))
    for master, slave, moves, where in archive.rigid:
        members = [int(slave)] if is_number(slave) else archive.components.get(slave, [])
        if not members:
            raise Damaged(f"{where} couples no nodes: '{slave}' is no node and no component of nodes")
        reference = numbering.positions([master], f"{where} names")
        positions = numbering.positions(members, f"{where} names")
        if moves not in ("xyz", "abc", "xyzabc"):
            _refuse_turned(archive, where, [master, *members])
        if moves:
            found.append(RigidLink(where, int(reference[0]), positions, moves))
    return found


def _refuse_turned(archive: _Archive, where: str, nodes: list[int]) -> None:
    """Raises `Damaged` if the directions of a node are turned (angles of NBLOCK)."""
    if found := next((node for node in nodes if node in archive.held.turned), None):
        raise Damaged(f"{where} takes directions of node {found}, which are turned in NBLOCK; turn them back (NROTAT)")


def _other_elements(archive: _Archive, name: str) -> list[str]:
    """What is said of elements that are no solids but have mass or stiffness."""
    first: dict[int, tuple[int, int]] = {}
    for number, _, kind, _, _ in archive.elements:
        ansys = archive.kinds.get(kind, 0)
        if ansys in _OTHERS - _HARMLESS:
            first[ansys] = (first.get(ansys, (number, 0))[0], first.get(ansys, (number, 0))[1] + 1)
    found = [(kind, f"{name}, element {number}", count) for kind, (number, count) in first.items()]
    beside = [(archive.kinds.get(kind, 0), where, count) for kind, (where, count) in archive.outside.items()]
    found += [one for one in beside if one[0] not in _HARMLESS]
    return [lost(where, f"the Ansys type {kind} ({count} element{'s' * (count > 1)})") for kind, where, count in found]


def _integration(archive: _Archive) -> list[str]:
    """What is said of bricks of 20 nodes that Ansys integrates at fewer points than are taken."""
    count = sum(
        archive.kinds.get(kind) == 186
        and archive.options.get(kind, {}).get(2) != "1"
        and len(set(nodes)) == 20
        for _, _, kind, _, nodes in archive.elements
    )
    text = (
        "elements SOLID186 are taken with full integration, which their KEYOPT(2) = 1 asks for; "
        "without it they are a little softer on coarse meshes"
    )
    return [f"{count} {text}"] if count else []


def _form(archive: _Archive, number: int, kind: int, nodes: list[int]) -> tuple[str, list[int]] | None:
    """Cell type and its nodes of an element; None if it is no solid."""
    if kind not in archive.kinds:
        raise Damaged(f"element {number} is of type {kind}, which no ET command defines")
    count = _SOLIDS.get(archive.kinds[kind])
    if count is None:
        if archive.kinds[kind] in _OTHERS:
            return None
        raise Damaged(
            f"element {number} is of the Ansys type {archive.kinds[kind]}, which cannot be assembled (SOLID185, 186, "
            "187, 285 can)"
        )
    if (count, len(nodes)) in ((20, 8), (10, 4)):  # every mid-side node is dropped: Ansys takes straight functions
        count = len(nodes)
    if len(nodes) != count or (count not in (8, 20) and len(set(nodes)) < count) or min(nodes) < 1:
        what = "drops mid-side nodes" if 0 in nodes else f"has {len(set(nodes))} different nodes instead of {count}"
        raise Damaged(f"element {number} {what}; write it with all its nodes")
    form = _degenerate(number, nodes) if count in (8, 20) else ""
    for name, chosen in _FORMS[count].items():
        if name.startswith(form):
            return name, [nodes[i] for i in chosen]
    raise Damaged(f"element {number} has a form that is not read")


def _degenerate(number: int, nodes: list[int]) -> str:
    i, j, k, l, m, n, o, p = nodes[:8]
    form = {(False, False): "hexahedron", (True, False): "wedge", (False, True): "pyramid", (True, True): "tetra"}[
        k == l, m == n == o == p
    ]
    corners = [i, j, k, m] + {"hexahedron": [l, n, o, p], "wedge": [n, o], "pyramid": [l], "tetra": []}[form]
    if len(set(corners)) < len(corners) or (form == "wedge" and o != p):
        raise Damaged(f"element {number} names a corner twice in a way that is neither wedge, pyramid nor tetrahedron")
    return form


def _material(archive: _Archive, number: int, system: int) -> DeckMaterial:
    c, t = archive.constants.get(number, {}), archive.tables.get(number, {})
    name = f"material {number}"
    if "EX" not in c:
        return DeckMaterial(name, None, _first(c, "DENS"), np.zeros(6))
    expansion = np.array([_first(c, f"{'ALP' if 'ALPX' in c else 'CTE'}{a}") or 0.0 for a in "XYZ"])
    if ("ALPX" in c and "ALPY" not in c) or ("CTEX" in c and "CTEY" not in c):
        expansion[1:] = expansion[0]
    table = None
    if "EY" in c and c["EY"] != c["EX"]:
        if system:
            text = f"directions of the element coordinate system {system}, which is not read; give it in body.toml"
            return DeckMaterial(name, None, _first(c, "DENS"), np.zeros(6), refused=text)
        C: Array = orthotropic_row(name, _orthotropic(name, c))
    else:
        nu = c.get("PRXY") or c.get("NUXY") or {1: 0.3}  # 0.3 is what Ansys assumes
        ratio = nu[min(nu)]
        rows = [[E, nu.get(place, ratio), t.get("EX", {}).get(place, 0.0)] for place, E in sorted(c["EX"].items())]
        C, table = isotropic_rows(name, np.array(rows))
    return DeckMaterial(name, C, _first(c, "DENS"), turned_strain(expansion, None), table)


def _first(c: dict[str, dict[int, float]], label: str) -> float | None:
    return c[label][min(c[label])] if label in c else None


def _orthotropic(name: str, c: dict[str, dict[int, float]]) -> Array:
    """E1 E2 E3 nu12 nu13 nu23 G12 G13 G23; the minor ratios NU.. become the major ones PR.. ."""
    E = {a: _first(c, f"E{a}") for a in "XYZ"}
    G = [_first(c, f"G{ab}") for ab in ("XY", "XZ", "YZ")]
    if None in E.values() or None in G:
        raise Damaged(f"the {name} is orthotropic and lacks some of EX, EY, EZ, GXY, GYZ, GXZ")
    nu = []
    for a, b in ("XY", "XZ", "YZ"):
        major, minor = _first(c, f"PR{a}{b}"), _first(c, f"NU{a}{b}")
        nu.append(major if major is not None else (minor or 0.0) * (E[a] or 0.0) / (E[b] or 1.0))
    return np.array([E["X"], E["Y"], E["Z"], *nu, *G], dtype=float)


def _assign_temperatures(archive: _Archive, raw: RawMesh, numbering: Numbering) -> None:
    if not archive.nodal and archive.uniform is None and archive.reference is None:
        return
    raw.temperature = np.full((len(raw.points), 2), np.nan)
    raw.temperature[:, 0] = archive.reference or 0.0
    raw.temperature[:, 1] = archive.reference or 0.0 if archive.uniform is None else archive.uniform
    if archive.nodal:
        at = numbering.positions(list(archive.nodal), "BF names")
        raw.temperature[at, 1] = list(archive.nodal.values())
