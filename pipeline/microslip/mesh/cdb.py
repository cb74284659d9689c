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
from pathlib import Path

import numpy as np

from ..data import Array, Equation, Indices
from ..elasticity import turned, turned_strain
from ..errors import of_file
from ..topology import CELL_TYPES
from . import archive_links, archive_loads, archive_lumps, archive_nodes, archive_parameters
from .archive import Archive, Command, Element, changed, whole
from .archive_links import CONTACTS, TARGETS, constrain, ring_of
from .archive_loads import state_of_archive, temperatures_of
from .archive_parameters import commands, skipped
from .materials import isotropic_rows, orthotropic_row
from .raw import (
    Damaged,
    DeckMaterial,
    Numbering,
    RawMesh,
    Structure,
    is_number,
    locks,
    lost,
    real,
)
from .systems import BASIC, System, axes_by_angles

_SOLIDS = {
    185: 8, 45: 8, 64: 8, 65: 8, 73: 8, 190: 8, 186: 20, 95: 20, 226: 20, 187: 10, 92: 10, 227: 10, 285: 4,
}  # fmt: skip
"""Element type -> number of nodes."""
_COUPLED = {226, 227}
"""Coupled fields; the displacements are among them where KEYOPT(1) is odd."""
_BY_MESH200 = {"8": 285, "9": 187, "10": 185, "11": 186}
"""KEYOPT(1) of cells that only a mesh is made from -> the solid of the same nodes."""
_HARMLESS = {*range(151, 157), 200}
"""Those without mass and stiffness: surface effects, cells to mesh from."""
_STRUCTURES = {
    **dict.fromkeys((181, 281, 63, 43, 93, 28, 41, 91, 99, 150, 208, 209), "shells"),
    **dict.fromkeys((188, 189, 4, 44, 3, 23, 24, 54), "beams"),
    **dict.fromkeys((180, 8, 10, 1), "rods"), **dict.fromkeys((288, 289, 290, 16, 18, 20), "pipes"),
    **dict.fromkeys((7, 184), "joints"), 178: "contact between nodes", 179: "bolts' pretension",
    214: "bearings", 39: "nonlinear springs", 40: "combined springs", 37: "controlled springs", 27: "matrices",
    50: "superelements",
}  # fmt: skip
"""Types that hold or carry the solids and are not read."""
_FLAT = {25, 42, 82, 83, 182, 183, 192, 193, 212, 213, 222, 223}
_THERMAL = {55, 70, 77, 87, 90, 278, 279, 291, 292, 293}
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


def read_cdb(path: Path) -> RawMesh:
    """Read an archive, up to the solution of its first modes.

    Raises:
        Damaged: content that is inconsistent, or elements whose meaning would be lost, by their number.
    """
    lines = path.read_text(encoding="latin-1").splitlines()
    archive = Archive(path.name, path.parent, lines, _beginning(lines))
    while archive.at < len(lines) and not archive.modes:
        archive.at += 1
        archive.where = f"{path.name}, line {archive.at}"
        with of_file(f"{path}, line {archive.at}"):
            for words in commands(archive, lines[archive.at - 1]):
                _execute(archive, words)
    raw = _assembled(archive)
    raw.lost = [*archive.lost, *raw.lost, *_other_elements(archive, path.name), *_layers(archive)]
    raw.remarks += [*archive.remarks, *_integration(archive, raw)]
    if archive.unknown:
        text = "what they do to the frequencies is not known here"
        raw.remarks.append(f"read and not used: {', '.join(archive.unknown)}: {text}")
    if not any(line.strip().upper().startswith("FINI") for line in lines[-20:]):
        raw.unended = "no FINISH"  # a warning: archives that were shortened by hand have none
    return raw


def _beginning(lines: list[str]) -> int:
    """The line where the archive begins: behind the drawing (IGES) that CDWRITE may put before it."""
    marks = (n for n, line in enumerate(lines) if line.upper().startswith(":CDWRITE"))
    return next(marks, 0)


def _execute(archive: Archive, words: list[str]) -> None:
    """Do what a command says; of its name four letters count."""
    if skipped(archive, words):
        return
    name = words[0].upper()
    if name.startswith(("/POST", "/AUX", "/PREP", "/SOL")) or name[:4] == "FINI":
        archive.idle = name.startswith(("/POST", "/AUX"))
    if archive.idle and name != "*SET":
        return
    meaning = _STEMS.get(name[:4], name if name[:1].isalpha() or name[:1] == "*" else "")
    if callable(meaning):
        meaning(archive, [*words, *_BLANKS])
    elif meaning == name:
        archive.unknown[name] = None
    elif meaning:
        archive.lost.append(f"{archive.where}: {name} {meaning} and is not read, so frequencies will differ")


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


def _read_nodes(archive: Archive, words: list[str]) -> None:
    lines, at = archive.lines, archive.at
    fields = _widths(lines, at, "NBLOCK")
    integers = [f for f in fields if f[2] == "i"]
    coordinates = [f for f in fields if f[2] == "e"]
    coordinates, angles = coordinates[:3], coordinates[3:]
    if not integers or len(coordinates) < 3:
        raise Damaged("NBLOCK has a format without a number and three coordinates")
    before, announced = len(archive.node_id), _announced(words)
    for number, line in enumerate(lines[at + 1 :], at + 1):
        if line.strip() == "-1":
            archive.at = number + 1
            return
        if re.match(r"\s*[^\d\s]", line):  # N,UNBL,LOC,-1, or the next command
            if len(archive.node_id) - before < announced:
                text = f"{len(archive.node_id) - before} nodes of {announced}"
                raise Damaged(f"NBLOCK holds {text} that it announces")
            archive.at = number
            return
        archive.node_id.append(whole(line[: integers[0][1]], "NBLOCK"))
        own = [real(t, "NBLOCK") for a, b, _ in angles if (t := line[a:b].strip())]
        if any(own):
            archive.turns[archive.node_id[-1]] = System(axes=axes_by_angles(np.array([*own, 0, 0][:3])))
        given = [line[a:b] for a, b, _ in coordinates]
        archive.points.append([real(t, "NBLOCK") if t.strip() else 0.0 for t in given])
    raise Damaged("NBLOCK has no end, the file is truncated")


def _read_node(archive: Archive, words: list[str]) -> None:
    """N, number, coordinates in the active system, angles; or N,R5.3,LOC or ANG, number, three of them."""
    part, rest = "", words[1:]
    if words[1].upper().startswith(("R5", "UNBL")):
        part, rest = words[2].upper(), words[3:]
    if rest[0].startswith("-"):
        return  # the end of a block
    number = whole(rest[0], "N") if rest[0] else max(archive.node_id, default=0) + 1
    values = [real(w, "N") if w else 0.0 for w in rest[1:7]]
    if part == "ANG" or any(values[3:]):
        angles = values[:3] if part == "ANG" else values[3:]
        archive.turns[number] = System(axes=axes_by_angles(np.array(angles)))
    if part != "ANG":
        active = archive.current.get("CSYS", 0) if not part else 0
        system = archive.systems.get(active, BASIC[0])
        archive.node_id.append(number)
        archive.points.append(system.points(np.array([values[:3]]))[0].tolist())


def _announced(words: list[str]) -> int:
    """How many nodes a block says that it has: NBLOCK, fields, SOLID, largest number, count."""
    return int(words[4]) if len(words) > 4 and words[4].isdecimal() else 0


def _read_elements(archive: Archive, words: list[str]) -> None:
    lines, form = archive.lines, [*words, "", ""][2].upper()
    fields = _widths(lines, archive.at, "EBLOCK")
    announced = whole(words[4], "EBLOCK") if form and len(words) > 4 and words[4] else 0
    read = {"SOLID": _read_solid, "COMPACT": _read_compact}.get(form, _read_short)
    before = len(archive.elements)
    archive.at += 1
    while archive.at < len(lines):
        first = _row(lines[archive.at], fields)
        archive.at += 1
        if first[:1] == [-1]:
            if announced not in (0, len(archive.elements) - before):
                raise Damaged(f"EBLOCK announces {announced} elements and holds {len(archive.elements) - before}")
            return
        if not first:
            raise Damaged("EBLOCK has an empty line instead of -1 at its end, the file is truncated")
        read(archive, first, fields)
    raise Damaged("EBLOCK has no end, the file is truncated")


Fields = list[tuple[int, int, str]]


def _read_solid(archive: Archive, first: list[int], fields: Fields) -> None:
    """Material, type, real constants, section, system, three more, count of nodes, one more, number, nodes."""
    if len(first) < 12:
        raise Damaged(f"EBLOCK holds the line '{archive.lines[archive.at - 1].strip()[:60]}', which is too short")
    count, nodes, line = first[8], first[11:], archive.at
    while len(nodes) < count and archive.at < len(archive.lines):
        more = _row(archive.lines[archive.at], fields)
        archive.at += 1
        if not more or more[0] == -1:
            raise Damaged(f"element {first[10]} has {len(nodes)} nodes instead of {count}")
        nodes += more
    if any(nodes[count:]):
        raise Damaged(f"element {first[10]} announces {count} nodes and lists more")
    archive.elements.append(Element(first[10], first[0], first[1], first[2], first[4], nodes[:count], line=line))


def _read_compact(archive: Archive, first: list[int], fields: Fields) -> None:
    """Number and nodes of an element of the current type, material and real constants."""
    now, line = archive.current, archive.at
    nodes = _whole_element(archive, first[1:], now["TYPE"], fields)
    archive.elements.append(
        Element(first[0], now["MAT"], now["TYPE"], now["REAL"], now.get("ESYS", 0), nodes, line=line)
    )


def _read_short(archive: Archive, first: list[int], fields: Fields) -> None:
    """An element of a block without SOLID: number, type, real constants, material, system, nodes."""
    number, *four = [*first[:5], *[0] * (5 - len(first[:5]))]
    kind, line = four[0] if four[0] in archive.kinds else archive.current["TYPE"], archive.at
    nodes = _whole_element(archive, first[5:], kind, fields)
    where = f"{archive.path}, line {line}"
    archive.elements.append(Element(number, four[2], kind, four[1], four[3], nodes, where, line))


def _whole_element(archive: Archive, nodes: list[int], kind: int, fields: Fields) -> list[int]:
    """The nodes of an element with those of the lines behind."""
    count = min(_SOLIDS.get(archive.kinds.get(kind, 0), 0), 20)
    while 8 <= len(nodes) < count and archive.at < len(archive.lines):
        if not (more := _row(archive.lines[archive.at], fields)) or more[0] == -1:
            break
        nodes, archive.at = nodes + more, archive.at + 1
    return nodes


def _row(line: str, fields: Fields, what: str = "EBLOCK") -> list[int]:
    return [whole(line[a:b], what) for a, b, _ in fields if line[a:b].strip()]


def _read_component(archive: Archive, words: list[str]) -> None:
    """Numbers; a negative one ends a range that began with the number before it."""
    if not words[3]:
        raise Damaged("a CMBLOCK has no name or number of members")
    lines, at = archive.lines, archive.at
    fields, count = _widths(lines, at, "CMBLOCK"), whole(words[3], "CMBLOCK")
    listed: list[int] = []
    at += 1
    while len(listed) < count:
        if at >= len(lines) or not (row := _row(lines[at], fields, f"the component {words[1]}")):
            raise Damaged(f"the component {words[1]} has {len(listed)} numbers instead of {count}")
        listed += row
        at += 1
    into = archive.components if words[2].upper().startswith("NODE") else archive.groups
    into.setdefault(words[1], []).extend(_ranges(listed, words[1]))
    archive.at = at


def _ranges(listed: list[int], name: str) -> list[int]:
    members: list[int] = []
    for number in listed:
        if number < 0 and (not members or -number - members[-1] > 10**8):
            raise Damaged(f"the component {name} holds a range without a beginning, or beyond all bounds")
        members += [number] if number > 0 else range(members[-1] + 1, -number + 1)
    return members


def _read_types(archive: Archive, words: list[str]) -> None:
    """Number, element and 18 KEYOPTs of each type; -1 ends them."""
    lines, at = archive.lines, archive.at
    fields = _widths(lines, at, "ETBLOCK")
    if len(fields) < 4:
        raise Damaged("ETBLOCK has a format without a number, an element and its options")
    for number, line in enumerate(lines[at + 1 :], at + 1):
        row = [line[a:b].strip() for a, b, _ in fields]
        if row[0] == "-1":
            archive.at = number + 1
            return
        kind = whole(row[0], "ETBLOCK")
        archive.kinds[kind] = whole(row[1], "ETBLOCK")
        archive.options[kind] = {n: w for n, w in enumerate(row[2:], 1) if w}
    raise Damaged("ETBLOCK has no end, the file is truncated")


_BLANKS = [""] * 8
"""Fields that a line may leave out at its end."""


# commands ------------------------------------------------------------------------------------------------------------


def _read_type(archive: Archive, words: list[str]) -> None:
    if words[1].isdecimal() and words[2]:
        number, kind = re.search(r"\d+$", words[2]), whole(words[1], "ET")
        archive.kinds[kind] = int(number[0]) if number else 0
        archive.options[kind] = {n: w for n, w in enumerate(words[3:9], 1) if w}


def _read_option(archive: Archive, words: list[str]) -> None:
    """KEYOPT, type, number, value."""
    if words[1].isdecimal() and words[2].isdecimal():
        options = archive.options.setdefault(whole(words[1], "KEYOPT"), {})
        options[whole(words[2], "KEYOPT")] = words[3]


def _read_current(archive: Archive, words: list[str]) -> None:
    if words[1].isdecimal():
        archive.current[words[0].upper()[:4].rstrip()] = whole(words[1], words[0].upper())


def _read_element(archive: Archive, words: list[str]) -> None:
    """E, nodes; EN, number, nodes: of the current type, material and real constants."""
    apart = words[0].upper() == "EN"
    if "ATTR" in (word.upper() for word in words):
        return  # the end of a block of elements
    numbers = [whole(word, words[0].upper()) for word in words[1:] if word]
    now = archive.current
    nodes = numbers[apart:]
    number = numbers[0] if apart and numbers else max((e.number for e in archive.elements), default=0) + 1
    archive.elements.append(
        Element(number, now["MAT"], now["TYPE"], now["REAL"], now.get("ESYS", 0), nodes, archive.where, archive.at)
    )


def _read_more_nodes(archive: Archive, words: list[str]) -> None:
    """EMORE, nodes of the element before."""
    if archive.elements:
        more = [whole(word, "EMORE") for word in words[1:] if word]
        archive.elements[-1] = archive.elements[-1]._replace(nodes=archive.elements[-1].nodes + more)


def _mass(archive: Archive, words: list[str]) -> None:
    """LUMPM, ON: masses at nodes, instead of those that go with the stiffness."""
    if words[1].upper() in ("ON", "1"):
        archive.lost.append(f"{archive.where}: LUMPM,ON: its masses are taken as spread, so frequencies will differ")


def _end(archive: Archive, words: list[str]) -> None:
    """/EOF."""
    archive.at = len(archive.lines)


def _generated(archive: Archive, words: list[str]) -> None:
    """VMESH, NGEN and others that make nodes or elements."""
    what = f"{words[0].upper()} makes nodes or elements, which Ansys alone does"
    raise Damaged(f"{what}; write the mesh that it has made as an archive (CDWRITE,DB)")


_IN_LOOPS = {*archive_parameters.COMMANDS, "*DO", "*DOWHILE", "NSEL", "ESEL", "ALLSEL", "CMSEL", "ESLN", "CSYS"}
"""What a loop may repeat without a change of the model."""


def _loop(archive: Archive, words: list[str]) -> None:
    """*DO up to its *ENDDO, left aside where it changes nothing that is read.

    Raises:
        Damaged: it repeats something that is.
    """
    depth, first = 1, archive.at
    for number, line in enumerate(archive.lines[first:], first + 1):
        name = line.split("!")[0].strip().upper().partition(",")[0].strip()
        depth += (name[:3] == "*DO" and name[:4] != "*DOT") - (name == "*ENDDO")
        if not depth:
            archive.at = number
            return
        stems = {word[:4] for word in _IN_LOOPS}
        if _STEMS.get(name[:4]) and name[:4] not in stems and not name.startswith("/"):
            raise Damaged(f"{words[0].upper()} repeats {name}; write the commands out, or an archive (CDWRITE,DB)")
    raise Damaged(f"{words[0].upper()} has no *ENDDO, the file is truncated")


def _other_file(archive: Archive, words: list[str]) -> None:
    """/INPUT, RESUME, CDREAD: what stands in another file."""
    archive.leave_out(f"{words[0].upper()},{words[1]}, which reads another file,")


def _behind_release(words: list[str]) -> list[str]:
    """What stands behind the command and "R5.0, count" or "UNBL, count"."""
    return words[3:] if words[1].upper().startswith(("R5", "UNBL")) else words[1:]


def _read_temperatures(archive: Archive, words: list[str]) -> None:
    """MPTEMP[, R5.0, count], first place, values; alone it clears the table."""
    rest = _behind_release(words)
    if not any(rest):
        archive.temperatures = {}
        return
    start = whole(rest[0], "MPTEMP")
    for i, text in enumerate(t for t in rest[1:] if t):
        archive.temperatures[start + i] = real(text, "MPTEMP")


def _read_data(archive: Archive, words: list[str]) -> None:
    """MPDATA[, R5.0, count], label, material, first place, values."""
    rest = _behind_release(words)
    if not any(rest[3:]) or not re.fullmatch(_CONSTANTS, rest[0], re.IGNORECASE):
        return
    material, label = whole(rest[1], "MPDATA"), rest[0].upper()
    start = whole(rest[2] or "1", "MPDATA")
    values = archive.constants.setdefault(material, {}).setdefault(label, {})
    table = archive.tables.setdefault(material, {}).setdefault(label, {})
    for place, text in enumerate((t for t in rest[3:] if t), start):
        values[place], table[place] = real(text, "MPDATA"), archive.temperatures.get(place, 0.0)


def _read_constant(archive: Archive, words: list[str]) -> None:
    """MP, label, material, value[, slopes over temperature]."""
    label = words[1].upper()
    if words[3] and re.fullmatch(_CONSTANTS, label):
        material, terms = whole(words[2] or "1", "MP"), [real(w, "MP") if w else 0.0 for w in words[3:8]]
        archive.constants.setdefault(material, {})[label] = {1: terms[0]}
        archive.tables.setdefault(material, {})[label] = {1: 0.0}
        archive.polynomials.pop((material, label), None)
        if any(terms[1:]):
            archive.polynomials[material, label] = terms


def _read_reference(archive: Archive, words: list[str]) -> None:
    if words[1]:
        archive.reference = real(words[1], "TREF")


_CONSTANTS = "E[XYZ]|(NU|PR|G)(XY|YZ|XZ)|DENS|(ALP|CTE)[XYZ]|MU|REFT"
"""Constants of a material that modes, static states and contacts need."""


def _modify(archive: Archive, words: list[str]) -> None:
    """EMODIF, element, MAT or TYPE or REAL or ESYS, number."""
    what = {"MAT": "material", "TYPE": "kind", "REAL": "real", "ESYS": "system"}.get(words[2].upper())
    if what is None or not is_number(words[1]) or not is_number(words[3]):
        archive.leave_out(f"EMODIF,{words[1]},{words[2]}")
        return
    archive.changes.setdefault(int(words[1]), {})[what] = int(words[3])


_LINEAR = {"ELASTIC": ("EX", "NUXY"), "ELAS": ("EX", "NUXY"), "DENS": ("DENS",), "CTE": ("ALPX",)}
"""TB table -> the constants that its values are."""
_BENDING = {"ANEL", "HYPE", "HYPER", "MOON", "BB", "OGDEN", "AHYPER", "GASKET", "FABRIC", "POROUS", "PIEZ"}
"""Tables that stand for the elasticity itself; others (plasticity, creep, damage) are beside it."""


def _read_table(archive: Archive, words: list[str]) -> None:
    """TB, table, material, temperatures, points, option."""
    label, number, option = words[1].upper(), whole(words[2] or "1", "TB"), words[5].upper()
    archive.table, archive.places["TB"] = None, ""
    if label in _LINEAR and option in ("", "ISOT"):
        archive.table = number, label
    elif label == "ANEL" and option in ("", "0", "1") and words[3] in ("", "0", "1"):
        archive.table, archive.matrices[number] = (number, label), (option == "1", {})
    elif label in _LINEAR or label in _BENDING:
        archive.refused[number] = f"TB,{label}{',' * bool(option)}{option} ({archive.where}), which is not read"
    elif label not in ("FRIC", "SDAMP", "DENS", "THERM", "JOIN", "FCLI"):
        archive.remarks.append(
            f"{archive.where}: TB,{label} of the material {number} is not used: vibration is about its elastic state"
        )


def _read_table_place(archive: Archive, words: list[str]) -> None:
    """TBTEMP, temperature; TBFIELD, TEMP, temperature."""
    field = words[0].upper() == "TBFIELD"
    if field and words[1].upper() != "TEMP":
        if archive.table:
            number, label = archive.table
            archive.refused[number] = f"TB,{label} over the field '{words[1]}' ({archive.where}), which is not read"
        archive.table = None
        return
    archive.places["TB"] = words[1 + field]


def _read_table_data(archive: Archive, words: list[str]) -> None:
    """TBDATA, place of the first value, values."""
    if archive.table is None:
        return
    number, table = archive.table
    if table == "ANEL":
        places = enumerate(words[2:8], whole(words[1] or "1", "TBDATA"))
        archive.matrices[number][1].update({p: real(w, "TBDATA") for p, w in places if w})
        return
    first, text = whole(words[1] or "1", "TBDATA"), archive.places.get("TB", "")
    for place, value in enumerate(words[2:8], first):
        if value and place <= len(_LINEAR[table]):
            label = _LINEAR[table][place - 1]
            values = archive.constants.setdefault(number, {}).setdefault(label, {})
            row = len(values) + 1
            values[row] = real(value, "TBDATA")
            over = archive.tables.setdefault(number, {}).setdefault(label, {})
            over[row] = real(text, "TBTEMP") if text else 0.0


_COMMANDS: dict[str, Command | str] = {
    "NBLOCK": _read_nodes, "N": _read_node, "EBLOCK": _read_elements, "CMBLOCK": _read_component,
    "ETBLOCK": _read_types,
    **dict.fromkeys(("E", "EN"), _read_element), "EMORE": _read_more_nodes,
    **dict.fromkeys(("TYPE", "REAL", "MAT", "ESYS"), _read_current),
    "ET": _read_type, "KEYOPT": _read_option, "EMODIF": _modify,
    "MPTEMP": _read_temperatures, "MPDATA": _read_data, "MP": _read_constant, "TREF": _read_reference,
    "TB": _read_table, "TBDATA": _read_table_data, **dict.fromkeys(("TBTEMP", "TBFIELD"), _read_table_place),
    "LUMPM": _mass, "/EOF": _end, **dict.fromkeys(("/INPUT", "RESUME", "CDREAD", "*USE"), _other_file),
    **archive_parameters.COMMANDS, **archive_nodes.COMMANDS, **archive_links.COMMANDS,
    **archive_lumps.COMMANDS, **archive_loads.COMMANDS,
    **dict.fromkeys("CEINTF CPINTF CPNGEN CPLGEN CPCYC CECYC CESGEN CPSGEN".split(), "constrains nodes"),
    **dict.fromkeys("VMESH VSWEEP AMESH LMESH KMESH NGEN FILL EGEN ENGEN NSYM *REPEAT".split(), _generated),
    **dict.fromkeys(
        "ESYM EDELE NDELE NUMMRG NSCALE ESURF EINTF TRANSFER EREF EMID".split(), "changes nodes or elements"
    ),
    **dict.fromkeys(("*DO", "*DOWHILE"), _loop),
    **dict.fromkeys("MPCHG EKILL EALIVE MPAMOD".split(), "changes materials of elements"),
    **dict.fromkeys(
        "INISTATE ISTRESS SLOAD PSLOAD SFGRAD SFFUN SFSCALE FSCALE DSCALE BFSCALE".split(), "loads the body"
    ),
    "MATWRITE": "holds matrices", "SE": "holds matrices",
    **dict.fromkeys(
        "NUMO DOF KUSE NEQI NCNV ERES EXTO IRLF CRPL BETA ALPH DMPR DMPS TOFF OUTR NLDI SHPP FINI ETCO XMLO EQSL CNTR "
        "CEWR NSUB RESC DMPO SECT SECD SECO SECC SECB AUTO CSCI TRNO TINT TIMI TBIN STAB KBC CNCH RSTS TSHA MODO MXPA "
        "CMWR CMDE TBLI TBPT SCOP QRDO MODC CNVT CDWR SAVE WPCS LNSR PRED CUTC OPNC MDAM HROP HARF CGLO ERNO MPLI "
        "NLIS ELIS DLIS FLIS ETLI SLIS CSLI ALLO PARS NORL EXIT EPLO NPLO GPLO PLNS PRNS SET PLDI PRRS PRES SFLI BFLI "
        "MPWR NWRI EWRI SPEC OUTP NOPR GOPR MPPL STEF THOP CYCS RESV SNOP PCGO LANB KEYW PMAP DESI CMLI CMPL SEOP "
        "PRIN NROP EMAT MONI JPEG MODE BETT CORI DSYS RSYS UIMP CHEC *END *IF *ELS *VWR *CFO *CFC NUMC *MSG *STA *LIS "
        "*VEC *NRM *DOT *MAT *EXP *PRI *VGE *VPU *VFI *VRE *VME *CYC *EXI *RET *ASK *ULI *TRE *DEL".split(), ""
    ),
}  # fmt: skip
"""Command -> what reads it; or why it counts and is not read; nothing: it changes no frequency."""
_STEMS = {name[:4]: meaning for name, meaning in _COMMANDS.items()}
"""The same by the first four letters, which alone count."""


# assembly ------------------------------------------------------------------------------------------------------------


def _assembled(archive: Archive) -> RawMesh:
    if not archive.node_id:
        raise Damaged("there are no nodes (NBLOCK or N); write the mesh as an archive (CDWRITE,DB)")
    archive.elements = [changed(e, archive.changes.get(e.number, {})) for e in archive.elements]
    _take_mesh200(archive)
    middle = _Middle(archive)
    regions: dict[tuple[int, int], int] = {}
    blocks: dict[str, list[tuple[int, int, list[int]]]] = {}
    there = {*archive.node_id, 0}
    for element in archive.elements:
        try:
            if (named := _form(archive, element)) is None:
                continue
            if not there.issuperset(named[1]):
                missing = next(n for n in named[1] if n not in there)
                raise Damaged(f"element {element.number} names node {missing}, which the file does not define")
            nodes = middle.filled(element.number, *named)
        except Damaged as error:
            error.file = error.file or archive.place(element.line)
            raise
        region = regions.setdefault((element.material, element.system), len(regions))
        blocks.setdefault(named[0], []).append((element.number, region, nodes))
    if not blocks:
        told = [text.split(" is not read")[0] for text in _other_elements(archive, archive.path)]
        text = f"holds no solid elements ({'; '.join(told) or 'nothing but nodes'})"
        raise Damaged(f"{text}; mesh the volume with SOLID186 or 187")
    node_id = np.array([*archive.node_id, *middle.new], dtype=np.int64)
    numbering = Numbering(node_id)
    raw = RawMesh(np.array([*archive.points, *middle.places(numbering)]), node_id)
    raw.add_solids(blocks, numbering, "EBLOCK names")
    for name, members in archive.components.items():
        if members:
            raw.add_set(name, members, numbering)
    raw.links += middle.links(numbering)
    raw.sector = ring_of(archive, raw)
    raw.lumps = list(archive_lumps.lumps_of(archive, numbering))
    raw.structures = _structures(archive, numbering)
    if archive.masters:
        raw.add_set("M", archive.masters, numbering)
        raw.retained.append("M")
    constrain(archive, raw, numbering)
    temperatures_of(archive, raw, numbering)
    made = archive.constants or archive.refused
    raw.materials = [_material(archive, raw, *key) for key in regions] if made else []
    raw.regions = raw.regions if made else []
    _stress_free(archive, raw, [material for material, _ in regions])
    state_of_archive(archive, raw, numbering)
    return raw


def _structures(archive: Archive, numbering: Numbering) -> list[Structure]:
    """Beams, shells and the like by their types."""
    kinds, there = dict[int, Structure](), set(archive.node_id)
    for element in archive.elements:
        ansys = archive.kinds.get(element.kind, 0)
        nodes = [n for n in element.nodes if n in there]
        if nodes and ansys in _STRUCTURES and not archive_links.is_rigid(archive, element):
            where = element.where or f"{archive.path}, element {element.number}"
            made = kinds.setdefault(ansys, Structure(where, f"{_STRUCTURES[ansys]} (type {ansys})", []))
            made.elements.append(numbering.positions(nodes, "").tolist())
    return list(kinds.values())


class _Middle:
    """Mid-side nodes that elements drop: put in the middle of their edges, where the ends move them.

    A dropped node makes the edge straight and the displacement along it linear, which is that of a
    node with u = (u_1 + u_2) / 2. `new`: number of such a node -> the two ends.
    """

    def __init__(self, archive: Archive) -> None:
        self.archive, self.new, self.at = archive, dict[int, tuple[int, int]](), dict[tuple[int, int], int]()

    def filled(self, element: int, kind: str, nodes: list[int]) -> list[int]:
        """The nodes of a cell with those that it drops."""
        if 0 not in nodes:
            return nodes
        cell, nodes = CELL_TYPES[kind], list(nodes)
        if 0 in nodes[: cell.corners]:
            raise Damaged(f"element {element} drops a corner; write it with all its nodes")
        for place, (a, b) in enumerate(cell.edges, cell.corners):
            if not nodes[place]:
                ends = min(nodes[a], nodes[b]), max(nodes[a], nodes[b])
                fresh = max(self.archive.node_id) + len(self.new) + 1 if ends not in self.at else 0
                nodes[place] = self.at.setdefault(ends, fresh)
                self.new.setdefault(nodes[place], ends)
        return nodes

    def places(self, numbering: Numbering) -> Array:
        """(k, 3) coordinates of the new nodes."""
        known = Numbering(np.array(self.archive.node_id, dtype=np.int64))
        ends = known.positions(np.array([*self.new.values()], dtype=np.int64).reshape(-1, 2), "EBLOCK names")
        return np.array(self.archive.points)[ends].mean(axis=1)

    def links(self, numbering: Numbering) -> Iterator[Equation]:
        """What moves the new nodes."""
        if self.new:
            text = f"{len(self.new)} mid-side nodes that elements drop stand in the middle of their edges"
            self.archive.remarks.append(f"{text} and move as these do, in straight lines, as in Ansys")
        for number, ends in self.new.items():
            at = numbering.positions([number, *ends], "EBLOCK names")
            for way in range(3):
                factors = np.array([1.0, -0.5, -0.5])
                yield Equation("mid-side nodes that elements drop", at, np.full(3, way), factors)


def _take_mesh200(archive: Archive) -> None:
    """Cells that only a mesh is made from are the body where the archive has no other solids."""
    kinds = archive.kinds
    if any(kinds.get(e.kind) in _SOLIDS for e in archive.elements):
        return
    for number, kind in list(kinds.items()):
        new = _BY_MESH200.get(archive.options.get(number, {}).get(1, "")) if kind == 200 else None
        if new and any(e.kind == number for e in archive.elements):
            kinds[number], archive.options[number] = new, {2: "1"} if new == 186 else {}
            text = f"the cells MESH200 of the type {number} are taken as SOLID{new}"
            archive.remarks.append(f"{text}: no others are there")


def _other_elements(archive: Archive, name: str) -> list[str]:
    """What is said of elements that are no solids but have mass or stiffness."""
    told: dict[int, tuple[str, int]] = {}
    for element in archive.elements:
        ansys = archive.kinds.get(element.kind, 0)
        if ansys in _SOLIDS or ansys in _TAKEN or archive_links.is_rigid(archive, element):
            continue
        where, count = told.get(ansys, (element.where or f"{name}, element {element.number}", 0))
        told[ansys] = where, count + 1
    lines = []
    for kind, (where, count) in told.items():
        means = f", {_STRUCTURES[kind]}" if kind in _STRUCTURES else ""
        lines.append(lost(where, f"the Ansys type {kind}{means} ({count} element{'s' * (count > 1)})"))
    return lines


_TAKEN = {*_HARMLESS, *CONTACTS, *TARGETS, *archive_lumps.KINDS}
"""Types that are read elsewhere, or have neither mass nor stiffness."""


def _reduced(archive: Archive, element: Element) -> bool | None:
    """Whether a brick of 20 nodes has its stiffness by eight points; None of what is none.

    KEYOPT(2) of SOLID186: 0 uniform reduced, 1 full; KEYOPT(11) = 1 of SOLID95. Its mass is by
    27 points in either case (Mechanical APDL Theory Reference, SOLID186).
    """
    nodes, kind = element.nodes, archive.kinds.get(element.kind)
    if kind not in (186, 95, 226) or len({*nodes[:8]}) < 8 or not any(nodes[8:]):
        return None
    options = archive.options.get(element.kind, {})
    return options.get(2, "0") != "1" if kind == 186 else kind == 95 and options.get(11) == "1"


_BRICKS = {"": "B-bar", "0": "B-bar", "1": "reduced integration", "2": "enhanced strain",
           "3": "simplified enhanced strain"}  # fmt: skip
"""KEYOPT(2) of SOLID185."""


def _integration(archive: Archive, raw: RawMesh) -> list[str]:
    """What is said of elements that Ansys forms in another way than they are taken."""
    rules = [rule for e in archive.elements if (rule := _reduced(archive, e)) is not None]
    few, count, said = sum(rules), dict[str, int](), list[str]()
    if few > len(rules) - few and (alone := _strands(raw)):
        text = "have no neighbours in two directions, where reduced integration leaves motions without stiffness"
        said.append(f"{alone} bricks {text}: all have full integration here (KEYOPT(2) = 1), a little stiffer")
        few = 0
    elif few > len(rules) - few:
        raw.integration, few = "reduced", len(rules) - few
        said.append(f"{len(rules)} bricks of 20 nodes have reduced integration, as their KEYOPT(2) says")
    if few:
        other = "full" if raw.integration == "reduced" else "reduced"
        raw.lost.append(
            f"{few} of {len(rules)} bricks of 20 nodes ask for {other} integration (KEYOPT(2)) and have that of the "
            "others: frequencies will differ a little"
        )
    for element in archive.elements:
        kind, options = archive.kinds.get(element.kind), archive.options.get(element.kind, {})
        brick = len({*element.nodes}) == 8
        if kind == 185 and brick:
            how = _BRICKS.get(options.get(2, ""), "another form")
            what = f"SOLID185 are taken with full integration in place of {how} (KEYOPT(2)), stiffer in bending"
            what += "" if how == "B-bar" else " by far; take SOLID186"
        elif kind == 45 and options.get(1) != "1" and brick:
            what = "SOLID45 are taken without extra displacement shapes"
        elif kind in _COUPLED:
            what = f"SOLID{kind} are taken by their displacements alone"
        else:
            continue
        count[what] = count.get(what, 0) + 1
    return [*said, *(f"{number} elements {what}" for what, number in count.items()), *locks(raw)]


def _strands(raw: RawMesh) -> int:
    """How many bricks of 20 nodes have free faces on both sides in two directions."""
    rows: dict[int, list[Indices]] = {3: [], 4: []}
    for kind, cells in raw.blocks:
        for facet in CELL_TYPES[kind].facets:
            ring = [i for i in facet if i < CELL_TYPES[kind].corners]
            rows[len(ring)].append(np.sort(cells[:, ring], axis=1))
    if not rows[4]:
        return 0
    _, place, count = np.unique(np.concatenate(rows[4]), axis=0, return_inverse=True, return_counts=True)
    free, first, alone = (count == 1)[place.ravel()], 0, 0
    for kind, cells in raw.blocks:
        n = sum(len([i for i in f if i < CELL_TYPES[kind].corners]) == 4 for f in CELL_TYPES[kind].facets)
        if kind == "hexahedron20":  # facets stand in pairs of opposite ones
            sides = free[first : first + n * len(cells)].reshape(3, 2, -1)
            alone += int((sides.all(axis=1).sum(axis=0) > 1).sum())
        first += n * len(cells)
    return alone


def _layers(archive: Archive) -> list[str]:
    """What is said of layered solids and of solids that stand for shells."""
    layered = sum(
        archive.kinds.get(e.kind) in (185, 186) and archive.options.get(e.kind, {}).get(3) == "1"
        for e in archive.elements
    )
    thin = sum(archive.kinds.get(e.kind) == 190 for e in archive.elements)
    told = []
    if layered:
        text = "are taken as of one material, that of the element: their sections (SECDATA) are not read, so"
        told.append(f"{layered} layered solids (KEYOPT(3) = 1) {text} frequencies will differ")
    if thin:
        text = "elements SOLSH190 are taken as plain bricks, far too stiff where one layer of them bends"
        told.append(f"{thin} {text}; mesh them with SOLID186")
    return told


def _form(archive: Archive, element: Element) -> tuple[str, list[int]] | None:
    """Cell type and its nodes of an element, 0 where it drops one; None if it is no solid."""
    number, kind, nodes = element.number, element.kind, element.nodes
    if kind not in archive.kinds:
        if element.where:
            return None  # told with the others
        raise Damaged(f"element {number} is of type {kind}, which no ET command defines")
    ansys = archive.kinds[kind]
    count = _SOLIDS.get(ansys)
    if count is None:
        if ansys in _STRUCTURES or ansys in _TAKEN or element.where:
            return None
        raise Damaged(f"element {number} is of the Ansys type {ansys}, {_why_not(ansys)}")
    if ansys in _COUPLED and archive.options.get(kind, {}).get(1, "0")[-1:] not in tuple("13579"):
        raise Damaged(f"element {number} is of the Ansys type {ansys} without displacements; {_INSTEAD}")
    if (count, len(nodes)) in ((20, 8), (10, 4)):  # every mid-side node is dropped: Ansys takes straight functions
        count = len(nodes)
    nodes = nodes + [0] * (count - len(nodes)) if count in (10, 20) and len(nodes) > count // 2 else nodes
    if len(nodes) != count or (count not in (8, 20) and len({*nodes} - {0}) < count - nodes.count(0)) or min(nodes) < 0:
        raise Damaged(f"element {number} has {len(set(nodes))} different nodes instead of {count}; write all of them")
    form = _degenerate(number, nodes) if count in (8, 20) else ""
    if count == 20 and not any(nodes[8:]):
        count = 8
    for name, chosen in _FORMS[count].items():
        if name.startswith(form):
            return name, [nodes[i] for i in chosen]
    raise Damaged(f"element {number} has a form that is not read")


_INSTEAD = "change ET to the structural solid of the same nodes (185, 186, 187) and give EX, NUXY, DENS"


def _why_not(ansys: int) -> str:
    """What is said of a type that cannot be assembled."""
    if ansys in _FLAT:
        return "a plane or axisymmetric one, which is no solid; mesh the volume (SOLID186, 187)"
    if ansys in _THERMAL:
        return f"which conducts heat and has no stiffness; {_INSTEAD}"
    return "which cannot be assembled (SOLID185, 186, 187, 285 can); change ET to one of these of the same nodes"


def _degenerate(number: int, nodes: list[int]) -> str:
    i, j, k, l, m, n, o, p = nodes[:8]
    form = {(False, False): "hexahedron", (True, False): "wedge", (False, True): "pyramid", (True, True): "tetra"}[
        k == l, m == n == o == p
    ]
    corners = [i, j, k, m] + {"hexahedron": [l, n, o, p], "wedge": [n, o], "pyramid": [l], "tetra": []}[form]
    if len(set(corners)) < len(corners) or (form == "wedge" and o != p):
        raise Damaged(f"element {number} names a corner twice in a way that is neither wedge, pyramid nor tetrahedron")
    return form


def _material(archive: Archive, raw: RawMesh, number: int, system: int) -> DeckMaterial:
    c, t = archive.constants.get(number, {}), archive.tables.get(number, {})
    for label in [label for n, label in archive.polynomials if n == number]:
        c[label], t[label] = _tabulated(archive, raw, archive.polynomials[number, label])
    name, density = f"material {number}", _first(c, "DENS")
    if number in archive.refused and "EX" not in c:
        text = f"{archive.refused[number]}; write MP,EX, NUXY and DENS (or nine constants of an orthotropic one)"
        return DeckMaterial(name, None, density, np.zeros(6), refused=text)
    if "EX" not in c and number not in archive.matrices:
        return DeckMaterial(name, None, density, np.zeros(6))
    along = np.array([_first(c, f"{'ALP' if 'ALPX' in c else 'CTE'}{a}") or 0.0 for a in "XYZ"])
    if ("ALPX" in c and "ALPY" not in c) or ("CTEX" in c and "CTEY" not in c):
        along[1:] = along[0]
    if any(len({*values.values()}) > 1 for label, values in c.items() if label[:3] in ("ALP", "CTE")):
        said = archive.lost if archive.prestressed or archive.perturbed is not None else archive.remarks
        said.append(f"the expansion of the {name} depends on temperature: that of its first row is taken")
    table, axes = None, None
    if len({*c.get("DENS", {}).values()}) > 1:
        archive.remarks.append(f"the density of the {name} depends on temperature: that of its first row is taken")
    if number in archive.matrices or _orthotropic(c):
        local = archive.systems.get(system, BASIC[0])
        if local.kind != 0:
            text = f"directions of the element coordinate system {system}, which is no rectangular one"
            text += "; give it in body.toml"
            return DeckMaterial(name, None, density, np.zeros(6), refused=text)
        if max((len(c[label]) for label in c if label[0] in "EG"), default=1) > 1:
            archive.remarks.append(f"the orthotropic {name} depends on temperature: its first row is taken")
        axes = local.axes
        own = _matrix(archive, number) if number in archive.matrices else orthotropic_row(name, _nine(name, c))
        C: Array = turned(own, axes)
    else:
        nu = c.get("PRXY") or c.get("NUXY") or {1: 0.3}  # 0.3 is what Ansys assumes
        ratio = nu[min(nu)]
        rows = [[E, nu.get(place, ratio), t.get("EX", {}).get(place, 0.0)] for place, E in sorted(c["EX"].items())]
        C, table = isotropic_rows(name, np.array(rows))
    return DeckMaterial(name, C, density, turned_strain(along, axes), table)


def _matrix(archive: Archive, number: int) -> Array:
    """Hooke matrix of TB,ANEL: its 21 constants by columns below the diagonal, of stiffness or of compliance.

    Raises:
        Damaged: it is not positive definite.
    """
    inverse, constants = archive.matrices[number]
    C = np.zeros((6, 6))
    row, column = np.triu_indices(6)  # the upper triangle by rows is the lower one by columns
    C[row, column] = C[column, row] = [constants.get(place, 0.0) for place in range(1, 22)]
    if not np.isfinite(C).all() or np.linalg.eigvalsh(C).min() <= 0:
        raise Damaged(f"TB,ANEL of the material {number} is not positive definite; correct its 21 constants")
    return np.linalg.inv(C) if inverse else C


def _orthotropic(c: dict[str, dict[int, float]]) -> bool:
    """Whether the constants of a material are others than those that EX and NUXY alone make."""
    E = _first(c, "EX") or 0.0
    nu = _first(c, "PRXY") if "PRXY" in c else _first(c, "NUXY") if "NUXY" in c else 0.3
    plain = {"E": E, "G": E / (2 * (1 + (nu or 0.0)) or 1.0)}
    parts = ((_first(c, key) or 0.0, plain[key[0]]) for key in c if key[0] in plain)
    return any(abs(value - usual) > 1e-4 * abs(usual) for value, usual in parts)


def _first(c: dict[str, dict[int, float]], label: str) -> float | None:
    return c[label][min(c[label])] if label in c else None


def _nine(name: str, c: dict[str, dict[int, float]]) -> Array:
    """E1 E2 E3 nu12 nu13 nu23 G12 G13 G23; the minor ratios NU.. become the major ones PR.. ."""
    E = {a: _first(c, f"E{a}") or _first(c, "EX") for a in "XYZ"}
    G = [_first(c, f"G{ab}") for ab in ("XY", "XZ", "YZ")]
    if None in E.values() or None in G:
        raise Damaged(f"the {name} is orthotropic and lacks some of EX, EY, EZ, GXY, GYZ, GXZ")
    nu: list[float] = []
    for a, b in ("XY", "XZ", "YZ"):
        major, minor = _first(c, f"PR{a}{b}"), _first(c, f"NU{a}{b}")
        if major is None and minor is None:
            major = nu[0] if nu else 0.3  # what Ansys assumes
        nu.append(major if major is not None else (minor or 0.0) * (E[a] or 0.0) / (E[b] or 1.0))
    return np.array([E["X"], E["Y"], E["Z"], *nu, *G], dtype=float)


def _tabulated(
    archive: Archive, raw: RawMesh, terms: list[float]
) -> tuple[dict[int, float], dict[int, float]]:
    """Values and temperatures of a polynomial C0 + C1 T + ...: at the points of MPTEMP, as Ansys does; without
    them at the temperatures of the archive."""
    T = np.array([archive.temperatures[place] for place in sorted(archive.temperatures)])
    if len(T) < 2:
        known = np.zeros(1) if raw.temperature is None else raw.temperature[np.isfinite(raw.temperature)]
        T = np.unique(np.linspace(known.min(initial=np.inf), known.max(initial=-np.inf), 401))
    values = np.polynomial.polynomial.polyval(T, terms)
    return dict(enumerate(values.tolist(), 1)), dict(enumerate(T.tolist(), 1))


def _stress_free(archive: Archive, raw: RawMesh, materials: list[int]) -> None:
    """Stress-free temperatures that materials bring (MP,REFT)."""
    free = [_first(archive.constants.get(number, {}), "REFT") for number in materials]
    if not raw.regions or all(value is None for value in free):
        return
    usual = archive.reference or 0.0
    if raw.temperature is None:
        raw.temperature = np.full((len(raw.points), 2), usual)
    wanted = np.array([usual if value is None else value for value in free])
    for (_, cells), regions in zip(raw.blocks, raw.regions, strict=True):
        raw.temperature[cells, 0] = wanted[regions][:, None]
    for (_, cells), regions in zip(raw.blocks, raw.regions, strict=True):
        if (raw.temperature[cells, 0] != wanted[regions][:, None]).any():
            text = "materials of different stress-free temperatures (MP,REFT) share nodes"
            archive.lost.append(f"{archive.path}: {text}: there one of them is taken, stresses will differ")
            return
