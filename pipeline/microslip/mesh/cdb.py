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

from ..data import Array, Equation
from ..elasticity import turned, turned_strain
from ..errors import of_file
from ..topology import CELL_TYPES
from . import archive_links, archive_nodes
from .archive import Archive, Element, changed, whole
from .archive_links import CONTACTS, TARGETS, constrain, ring_of
from .materials import isotropic_rows, orthotropic_row
from .raw import (
    PRESTRESSED,
    Damaged,
    DeckMaterial,
    Numbering,
    RawMesh,
    ignored,
    is_number,
    locks,
    lost,
    real,
)
from .systems import BASIC, System, axes_by_angles

_SOLIDS = {
    185: 8, 45: 8, 64: 8, 65: 8, 73: 8, 190: 8, 186: 20, 95: 20, 226: 20, 187: 10, 92: 10, 227: 10, 285: 4,
}  # fmt: skip
"""Element type -> number of nodes. Others that are known to hold no stiffness of a solid are left out."""
_COUPLED = {226, 227}
"""Coupled fields; the displacements are among them where KEYOPT(1) is odd."""
_BY_MESH200 = {"8": 285, "9": 187, "10": 185, "11": 186}
"""KEYOPT(1) of cells that only a mesh is made from -> the solid of the same nodes."""
_OTHERS = {14, 21, 156, 184, 188, 189, 200, 208, 209, 214, 281, 290}
_OTHERS |= {*range(151, 155), *range(169, 180), 181}
_HARMLESS = {*range(151, 157), 200}
"""Those of `_OTHERS` without mass and stiffness: surface effects, cells to mesh from."""
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
    """Read an archive.

    Raises:
        Damaged: content that is inconsistent, or elements whose meaning would be lost, by their number.
    """
    lines = path.read_text(encoding="latin-1").splitlines()
    archive, at = Archive(path.name), _beginning(lines)
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
    raw.lost = [*archive.lost, *_other_elements(archive, path.name), *_layers(archive)]
    raw.remarks += [*archive.remarks, *_integration(archive, raw)]
    raw.remarks += ignored(archive.unused, _LOADS, archive.stressed)
    if not any(line.strip().upper().startswith("FINI") for line in lines[-20:]):
        raw.unended = "no FINISH"  # a warning: archives that were shortened by hand have none
    return raw


def _beginning(lines: list[str]) -> int:
    """The line where the archive begins: behind the drawing (IGES) that CDWRITE may put before it."""
    marks = (n for n, line in enumerate(lines) if line.upper().startswith(":CDWRITE"))
    return next(marks, 0)


_TEXTS = ("/COM", "/TITLE", "/STITLE", "C***", "*DIM", "/WB", "/INPUT")
"""Beginnings of lines that are texts, in which no command stands."""


def _commands(archive: Archive, line: str) -> Iterator[list[str]]:
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


def _read_nodes(archive: Archive, words: list[str], lines: list[str], at: int) -> int:
    fields = _widths(lines, at, "NBLOCK")
    integers = [f for f in fields if f[2] == "i"]
    coordinates = [f for f in fields if f[2] == "e"]
    coordinates, angles = coordinates[:3], coordinates[3:]
    if not integers or len(coordinates) < 3:
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
        archive.node_id.append(whole(line[: integers[0][1]], "NBLOCK"))
        own = [real(t, "NBLOCK") for a, b, _ in angles if (t := line[a:b].strip())]
        if any(own):
            archive.turns[archive.node_id[-1]] = System(axes=axes_by_angles(np.array([*own, 0, 0][:3])))
        given = [line[a:b] for a, b, _ in coordinates]
        archive.points.append([real(t, "NBLOCK") if t.strip() else 0.0 for t in given])
    raise Damaged("NBLOCK has no end, the file is truncated")


def _announced(words: list[str]) -> int:
    """How many nodes a block says that it has: NBLOCK, fields, SOLID, largest number, count."""
    return int(words[4]) if len(words) > 4 and words[4].isdecimal() else 0


def _read_elements(archive: Archive, words: list[str], lines: list[str], at: int) -> int:
    if "COMPACT" in (word.upper() for word in words):
        raise Damaged("EBLOCK is in the COMPACT form; write the archive with EBLOCK,19,SOLID (CDWRITE)")
    fields = _widths(lines, at, "EBLOCK")
    solid = len(words) > 2 and words[2].upper() == "SOLID"
    announced = whole(words[4], "EBLOCK") if solid and len(words) > 4 and words[4] else 0
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
            at = _read_short(archive, first, lines, at, fields)
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
        archive.elements.append(Element(first[10], first[0], first[1], first[2], first[4], nodes[:count]))
    raise Damaged("EBLOCK has no end, the file is truncated")


def _read_short(
    archive: Archive, first: list[int], lines: list[str], at: int, fields: list[tuple[int, int, str]]
) -> int:
    """An element of a block without SOLID: number, type, real constants, material, system, nodes."""
    number, *four = [*first[:5], *[0] * (5 - len(first[:5]))]
    kind, nodes = four[0] if four[0] in archive.kinds else archive.current["TYPE"], first[5:]
    count = _SOLIDS.get(archive.kinds.get(kind, 0), 0)
    while len(nodes) < min(count, 20) and len(nodes) >= 8 and at < len(lines):
        if not (more := _row(lines[at], fields)) or more[0] == -1:
            break
        nodes, at = nodes + more, at + 1
    archive.elements.append(Element(number, four[2], kind, four[1], four[3], nodes, archive.where))
    return at


def _row(line: str, fields: list[tuple[int, int, str]]) -> list[int]:
    return [whole(line[a:b], "EBLOCK") for a, b, _ in fields if line[a:b].strip()]


def _read_component(archive: Archive, words: list[str], lines: list[str], at: int) -> int:
    """Numbers; a negative one ends a range that began with the number before it."""
    if len(words) < 4:
        raise Damaged("a CMBLOCK has no name or number of members")
    fields, count = _widths(lines, at, "CMBLOCK"), whole(words[3], "CMBLOCK")
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


def _read_types(archive: Archive, words: list[str], lines: list[str], at: int) -> int:
    """Number, element and 18 KEYOPTs of each type; -1 ends them."""
    fields = _widths(lines, at, "ETBLOCK")
    if len(fields) < 4:
        raise Damaged("ETBLOCK has a format without a number, an element and its options")
    for number, line in enumerate(lines[at + 1 :], at + 1):
        row = [line[a:b].strip() for a, b, _ in fields]
        if row[0] == "-1":
            return number + 1
        kind = whole(row[0], "ETBLOCK")
        archive.kinds[kind] = whole(row[1], "ETBLOCK")
        archive.options[kind] = {n: w for n, w in enumerate(row[2:], 1) if w}
    raise Damaged("ETBLOCK has no end, the file is truncated")


_BLANKS = [""] * 8
"""Fields that a line may leave out at its end."""


_BLOCKS = {
    **archive_links.BLOCKS,
    "NBLOCK": _read_nodes,
    "EBLOCK": _read_elements,
    "CMBLOCK": _read_component,
    "ETBLOCK": _read_types,
}


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


def _read_parameter(archive: Archive, words: list[str]) -> None:
    """*SET, name, value: a number, or a parameter that is."""
    name, value = words[1].upper(), archive.parameters.get(words[2].upper(), words[2])
    archive.parameters.pop(name, None)
    if re.fullmatch(_NUMBER, value):
        whole = float(value).is_integer() and "e" not in value.lower()
        archive.parameters[name] = str(int(float(value))) if whole else value


_NUMBER = r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d{1,3})?"


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
    archive.elements.append(
        Element(numbers[0] if apart and numbers else 0, now["MAT"], now["TYPE"], now["REAL"], 0, nodes, archive.where)
    )


def _stressed(archive: Archive, words: list[str]) -> None:
    """PSTRES,ON, and a restart of a loaded state (ANTYPE,,RESTART,,,PERTURB)."""
    on = words[0].upper() == "PSTRES" and words[1].upper() in ("ON", "1")
    if on or "PERTURB" in (word.upper() for word in words):
        archive.stressed = True
        archive.lost.append(f"{archive.where}: {words[0].upper()}: {PRESTRESSED}")


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
    if words[3] and re.fullmatch(_CONSTANTS, words[1], re.IGNORECASE):
        if any(real(w, "MP") for w in words[4:] if w):
            raise Damaged(f"MP,{words[1]},{words[2]} is a polynomial of temperature; write a table (MPTEMP, MPDATA)")
        material = whole(words[2] or "1", "MP")
        archive.constants.setdefault(material, {})[words[1].upper()] = {1: real(words[3], "MP")}
        archive.tables.setdefault(material, {})[words[1].upper()] = {1: 0.0}


def _read_reference(archive: Archive, words: list[str]) -> None:
    if words[1]:
        archive.reference = real(words[1], "TREF")


def _read_uniform(archive: Archive, words: list[str]) -> None:
    if words[0].upper() == "TUNIF" and words[1]:
        archive.uniform = real(words[1], "TUNIF")
    elif words[1].upper() == "TEMP" and words[2] not in ("", "_TINY"):  # how Ansys says none
        archive.uniform = real(words[2], "BFUNIF")


def _read_body_force(archive: Archive, words: list[str]) -> None:
    if words[2].upper() == "TEMP" and words[1].lstrip("-").isdecimal() and words[3]:
        archive.nodal[whole(words[1], "BF")] = real(words[3], "BF")


def _refuse_temperatures(archive: Archive, words: list[str]) -> None:
    if words[2].upper().startswith("TEMP"):
        raise Damaged("BFBLOCK with temperatures is not read; write them as BF commands (CDWRITE, UNBLOCKED)")


_CONSTANTS = "E[XYZ]|(NU|PR|G)(XY|YZ|XZ)|DENS|(ALP|CTE)[XYZ]|MU"
"""Constants of a material that modes, static states and contacts need."""


def _modify(archive: Archive, words: list[str]) -> None:
    """EMODIF, element, MAT or TYPE or REAL or ESYS, number."""
    what = {"MAT": "material", "TYPE": "kind", "REAL": "real", "ESYS": "system"}.get(words[2].upper())
    if what is None or not is_number(words[1]) or not is_number(words[3]):
        archive.lost.append(lost(archive.where, f"EMODIF,{words[1]},{words[2]}"))
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
    first, text = whole(words[1] or "1", "TBDATA"), archive.places.get("TB", "")
    for place, value in enumerate(words[2:8], first):
        if value and place <= len(_LINEAR[table]):
            label = _LINEAR[table][place - 1]
            values = archive.constants.setdefault(number, {}).setdefault(label, {})
            row = len(values) + 1
            values[row] = real(value, "TBDATA")
            over = archive.tables.setdefault(number, {}).setdefault(label, {})
            over[row] = real(text, "TBTEMP") if text else 0.0


_COMMANDS = {
    **dict.fromkeys(("E", "EN"), _read_element),
    **dict.fromkeys(("TYPE", "REAL", "MAT"), _read_current),
    **dict.fromkeys(("KEYOPT", "KEYOP", "KEYO"), _read_option),
    **dict.fromkeys(("EMODIF", "EMOD"), _modify),
    **dict.fromkeys(("TUNIF", "BFUNIF"), _read_uniform),
    **dict.fromkeys(("TBDATA", "TBDAT"), _read_table_data),
    **dict.fromkeys(("TBTEMP", "TBTEM", "TBFIELD"), _read_table_place),
    **dict.fromkeys(("PSTRES", "ANTYPE", "ANTY"), _stressed),
    "ET": _read_type,
    "MPTEMP": _read_temperatures,
    "MPDATA": _read_data,
    "MP": _read_constant,
    "TREF": _read_reference,
    "BF": _read_body_force,
    "BFBLOCK": _refuse_temperatures,
    "*SET": _read_parameter,
    "TB": _read_table,
    **archive_nodes.COMMANDS,
    **archive_links.COMMANDS,
}


_NOT_READ = {
    "CEINTF", "CPINTF", "CPNGEN", "CPLGEN", "CPCYC", "CECYC", "CESGEN", "CPSGEN", "MATWRITE", "EGEN", "ENGEN",
    "MPCHG", "INISTATE",
}  # fmt: skip
"""Commands that constrain, or add or change elements, and are not read."""
_LOADS = "F|FBLOCK|SF|SFE|SFEBLOCK|ACEL|OMEGA|DOMEGA|CMOMEGA|CMACEL|CGOMGA|BFE|SLOAD|PSLOAD"


# assembly ------------------------------------------------------------------------------------------------------------


def _assembled(archive: Archive) -> RawMesh:
    if not archive.node_id:
        raise Damaged("there is no NBLOCK")
    archive.elements = [changed(e, archive.changes.get(e.number, {})) for e in archive.elements]
    _take_mesh200(archive)
    middle = _Middle(archive)
    regions: dict[tuple[int, int], int] = {}
    blocks: dict[str, list[tuple[int, int, list[int]]]] = {}
    for element in archive.elements:
        named = _form(archive, element)
        if named is not None:
            region = regions.setdefault((element.material, element.system), len(regions))
            cell = element.number, region, middle.filled(element.number, *named)
            blocks.setdefault(named[0], []).append(cell)
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
    constrain(archive, raw, numbering)
    raw.materials = [_material(archive, *key) for key in regions] if archive.constants else []
    if not raw.materials:
        raw.regions = []
        archive.lost += [f"{archive.path}: the material {n} has {text}" for n, text in archive.refused.items()]
    _assign_temperatures(archive, raw, numbering)
    return raw


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
            kinds[number], archive.options[number] = new, {2: "1"}
            text = f"the cells MESH200 of the type {number} are taken as SOLID{new}"
            archive.remarks.append(f"{text}: no others are there")


_MEANS = {
    14: "springs", 21: "point masses", 178: "contact between nodes", 179: "bolts' pretension", 181: "shells",
    184: "joints and rigid links", 188: "beams", 189: "beams", 208: "shells", 209: "shells", 214: "bearings",
    281: "shells", 290: "pipes",
}  # fmt: skip


def _other_elements(archive: Archive, name: str) -> list[str]:
    """What is said of elements that are no solids but have mass or stiffness."""
    told: dict[int, tuple[str, int]] = {}
    for element in archive.elements:
        ansys = archive.kinds.get(element.kind, 0)
        if ansys in _SOLIDS or ansys in _HARMLESS | CONTACTS | TARGETS:
            continue
        where, count = told.get(ansys, (element.where or f"{name}, element {element.number}", 0))
        told[ansys] = where, count + 1
    found = []
    for kind, (where, count) in told.items():
        means = f", {_MEANS[kind]}" if kind in _MEANS else ""
        found.append(lost(where, f"the Ansys type {kind}{means} ({count} element{'s' * (count > 1)})"))
    return found


def _integration(archive: Archive, raw: RawMesh) -> list[str]:
    """What is said of elements that Ansys forms in another way than they are taken."""
    count: dict[str, int] = {}
    for element in archive.elements:
        kind, options = archive.kinds.get(element.kind), archive.options.get(element.kind, {})
        brick = len(set(element.nodes)) in (8, 20)
        if kind == 186 and options.get(2) != "1" and brick:
            what = "SOLID186 are taken with full integration, which their KEYOPT(2) = 1 asks for; "
            what += "without it they are a little softer on coarse meshes"
        elif kind == 185 and brick:
            how = {"1": "reduced integration", "2": "enhanced strain", "3": "enhanced strain"}
            what = f"SOLID185 are taken with full integration in place of {how.get(options.get(2, ''), 'B-bar')}"
        elif kind == 45 and options.get(1) != "1" and brick:
            what = "SOLID45 are taken without extra displacement shapes"
        elif kind in _COUPLED:
            what = f"SOLID{kind} are taken by their displacements alone"
        else:
            continue
        count[what] = count.get(what, 0) + 1
    return [*(f"{number} elements {what}" for what, number in count.items()), *locks(raw)]


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
        if ansys in _OTHERS or element.where:
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


def _material(archive: Archive, number: int, system: int) -> DeckMaterial:
    c, t = archive.constants.get(number, {}), archive.tables.get(number, {})
    name, density = f"material {number}", _first(c, "DENS")
    if number in archive.refused and "EX" not in c:
        text = f"{archive.refused[number]}; write MP,EX, NUXY and DENS (or nine constants of an orthotropic one)"
        return DeckMaterial(name, None, density, np.zeros(6), refused=text)
    if "EX" not in c:
        return DeckMaterial(name, None, density, np.zeros(6))
    along = np.array([_first(c, f"{'ALP' if 'ALPX' in c else 'CTE'}{a}") or 0.0 for a in "XYZ"])
    if ("ALPX" in c and "ALPY" not in c) or ("CTEX" in c and "CTEY" not in c):
        along[1:] = along[0]
    table, axes = None, None
    if len({*c.get("DENS", {}).values()}) > 1:
        archive.remarks.append(f"the density of the {name} depends on temperature: that of its first row is taken")
    if _orthotropic(c):
        local = archive.systems.get(system, BASIC[0])
        if local.kind != 0:
            text = f"directions of the element coordinate system {system}, which is no rectangular one"
            text += "; give it in body.toml"
            return DeckMaterial(name, None, density, np.zeros(6), refused=text)
        if max(len(c[label]) for label in c if label[0] in "EG") > 1:
            archive.remarks.append(f"the orthotropic {name} depends on temperature: its first row is taken")
        axes = local.axes
        C: Array = turned(orthotropic_row(name, _nine(name, c)), axes)
    else:
        nu = c.get("PRXY") or c.get("NUXY") or {1: 0.3}  # 0.3 is what Ansys assumes
        ratio = nu[min(nu)]
        rows = [[E, nu.get(place, ratio), t.get("EX", {}).get(place, 0.0)] for place, E in sorted(c["EX"].items())]
        C, table = isotropic_rows(name, np.array(rows))
    return DeckMaterial(name, C, density, turned_strain(along, axes), table)


def _orthotropic(c: dict[str, dict[int, float]]) -> bool:
    """Whether the constants of a material are others than those that EX and NUXY alone make."""
    E = _first(c, "EX") or 0.0
    nu = _first(c, "PRXY") if "PRXY" in c else _first(c, "NUXY") if "NUXY" in c else 0.3
    plain = {"E": E, "G": E / (2 * (1 + (nu or 0.0)))}
    return any(abs((_first(c, key) or 0.0) / plain[key[0]] - 1) > 1e-4 for key in c if key[0] in plain)


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


def _assign_temperatures(archive: Archive, raw: RawMesh, numbering: Numbering) -> None:
    if not archive.nodal and archive.uniform is None and archive.reference is None:
        return
    raw.temperature = np.full((len(raw.points), 2), np.nan)
    raw.temperature[:, 0] = archive.reference or 0.0
    raw.temperature[:, 1] = archive.reference or 0.0 if archive.uniform is None else archive.uniform
    if archive.nodal:
        at = numbering.positions(list(archive.nodal), "BF names")
        raw.temperature[at, 1] = list(archive.nodal.values())
