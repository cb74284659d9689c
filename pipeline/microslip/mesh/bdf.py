"""Reader of Nastran bulk data: grid points, solid elements, materials, constraints, sets of points, loads.

Written against the Quick Reference Guide: GRID, GRDSET, SPOINT, CORD1R, CORD1C, CORD1S, CORD2R, CORD2C,
CORD2S, CTETRA, CHEXA, CPENTA, CPYRAM, PSOLID, SET1, SPC, SPC1, SPCADD, RBE2, RBE3, MPC, MPCADD, ASET and
the shells CTRIA3, CTRIA6, CQUAD4, CQUAD8, which name faces. Lines and fields: `bdf_cards`; the subcases:
`bdf_control`; `bdf_materials`, `bdf_lumps`, `bdf_loads` read what they are called by.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..data import Array, AverageLink, Equation, FaceTie, Link, PointMass, RigidLink
from ..topology import CELL_TYPES
from .bdf_cards import Bulk, BulkCard, at_card, cards_of, lines_of, listed, number_of, parted
from .bdf_contact import READ as FACED
from .bdf_contact import faced
from .bdf_control import Case, Control, control_of
from .bdf_loads import LOADS, OTHERS, SHELLS, state_of_bulk, temperatures
from .bdf_lumps import READ as LUMPED
from .bdf_lumps import bars_of, lumps_of, unlisted_points
from .bdf_materials import KINDS, PROPERTIES, TABLES, materials_of, stress_free
from .raw import Damaged, Numbering, RawMesh, Structure, ignored, joined, locks, lost, turn_left_handed
from .supports import Constraints, add_supports, in_axes
from .systems import Chained, System, through

_BRICK20, _WEDGE15 = (
    (*range(12), *range(16, 20), *range(12, 16)),
    (*range(9), *range(12, 15), *range(9, 12)),
)
"""Places of VTK's nodes: mid-side nodes of the lower edges, the upright ones, the upper ones."""
_SOLIDS: dict[str, dict[int, tuple[str, Sequence[int]]]] = {
    "CTETRA": {4: ("tetra", range(4)), 10: ("tetra10", range(10))},
    "CHEXA": {8: ("hexahedron", range(8)), 20: ("hexahedron20", _BRICK20)},
    "CPENTA": {6: ("wedge", range(6)), 15: ("wedge15", _WEDGE15)},
    "CPYRAM": {5: ("pyramid", range(5)), 13: ("pyramid13", range(13))},
}
_SOLIDS["CPYRA"] = _SOLIDS["CPYRAM"]
_SYSTEMS = ("CORD1R", "CORD1C", "CORD1S", "CORD2R", "CORD2C", "CORD2S")
_READ = {
    "GRID", "GRDSET", "SPOINT", *_SYSTEMS, "PARAM", "SET1", "SPC", "SPC1", "SPCADD", "RBE2", "RBE3", "MPC", "MPCADD",
    "ASET", "ASET1", "LOAD", "TEMP", "TEMPD", "MATT1", *TABLES, *_SOLIDS, *SHELLS, *KINDS, *PROPERTIES, *LUMPED, *FACED,
}  # fmt: skip
_SILENT = re.compile(
    r"EIG\w*|CORD\w+|ENDDATA|TABL\w*|DTI|SET3|MDLPRM|SUPORT1?|PLOTEL\d?|SESET|USET1?|QSET1?|GROUP|"
    r"FREQ\d?|TSTEP\w*|[RT]LOAD\d|DLOAD|LSEQ|DAREA|DELAY|DPHASE|TAB\w+|RAND\w+|PBUSHT|PELAST|PDAMPT|"  # in time
    r"NLPARM|NLPCI|NLSTEP|NLCNTL\w*|MATS1|TSTEPNL|TEMPBC|"  # nonlinear steps
    r"CHBDY\w|CONVM?|RAD\w+|VIEW3?D?|PCONVM?|PHBDY|Q(BDY\d|VOL|HBDY|VECT)|MAT[45]|MATT[45]|"  # heat
    r"D(ESVAR|CONSTR|[VT]?V[PMCT]REL\d|VGRID|RESP\d|OPTPRM|SCREEN|CONADD|EQATN|TABLE|LINK|MNCON|MRLAW)|"  # design
    r"P(BARL?|BEAML?|BEND|ROD|TUBE|SHEAR|VISC|GAP|ACABS|AABSF\d?|MIC)|AC\w+|MICPNT|PANEL|AMLREG"  # of what is told
)
"""Cards that say nothing of the body, or only together with others that are named."""
_COUNTS = re.compile(
    r"C(?!ORD|END|LOAD)[A-Z]+\d?|R(?!FORCE|LOAD|AND|ING)[A-Z]+\d?|GENEL|DMIG|NSM[A-Z]*\d?|MATT\d+|"
    r"MFLUID|BCTABL[E1]|BCBODY1?|PSHELL|PCOMPG?|BCONTACT|BOLT|SPCOFF1?|SPCR|SPLINE\d|AEQUAD4|FEEDGE|FEFACE|GMCURV|GMSURF|PVAL"
)
"""Cards that add mass, stiffness or constraints; those beside `_READ` are not read."""

_EVERY = ("xyz", "abc", "xyzabc")  # directions that mean the same in every system


def read_bdf(path: Path) -> RawMesh:
    """Read a bulk data file and those that it includes.

    Raises:
        Damaged: content that is inconsistent, or whose meaning would be lost.
    """
    told = list[str]()
    lines = lines_of(path, told)
    head, data, parts = parted(lines)
    control = control_of(head, any(re.match(r"\s*BEGIN\b", line.text) for line in lines))
    cards = cards_of(data, {*_READ, *LOADS, *OTHERS})
    raw, held, systems = _grid(cards, path.name)
    raw.remarks, raw.lost = told, parts
    bulk = Bulk(path.name, cards, raw, Numbering(raw.node_id), held, systems, len(cards["GRID"]))
    properties = _elements(bulk)
    _shells(bulk)
    for name, label, first in (("SET1", "SET", 2), ("SPC1", "SPC", 3)):
        for card in cards[name]:
            raw.add_set(f"{label} {card[1]}", listed(card, first, bulk.numbering), bulk.numbering)
    enforced = _constrain(bulk, control)
    raw.links += [*_rigid(bulk), *bars_of(bulk), *_averages(bulk), *_equations(bulk, control)]
    faced(bulk, control)
    raw.lumps = lumps_of(bulk)
    _drop_islands(raw)
    raw.structures = list(_structures(bulk))
    _retain(bulk)
    _load(bulk, control, properties, enforced)
    _tell_left_out(bulk, control)
    add_supports(raw, bulk.held, bulk.numbering)
    if not any(re.match(r"\s*ENDDATA\b", line.text) for line in lines):
        raw.unended = "no ENDDATA"  # a warning: decks are also kept as parts that others include
    return raw


def _load(
    bulk: Bulk, control: Control, properties: list[int], enforced: dict[int, dict[int, float]]
) -> None:
    """Materials at the temperatures of the deck, and the state that its modes are about."""
    raw = bulk.raw
    finite, loops = (bulk.parameter(name) or 0.0 for name in ("LGDISP", "NMLOOP"))
    static, nonlinear, told = control.static(loops > 0, finite > 0)
    raw.lost += told
    case = static or control.modal
    heat = {option: _heat(bulk, case, option) for option in ("MATE", "BOTH", "INIT", "LOAD")}
    of_material = next((heat[o] for o in ("MATE", "BOTH", "INIT") if heat[o] is not None), None)
    acting = next((heat[o] for o in ("LOAD", "BOTH") if heat[o] is not None), None)
    if any(bulk.cards[name] for name in (*PROPERTIES, *KINDS)):
        raw.materials = materials_of(bulk, properties, of_material)
        _merge_alike(raw)
    else:
        raw.regions = []
    if static is not None:
        state_of_bulk(bulk, static, nonlinear, enforced)
        for kind in ("SPC", "MPC"):
            sets = [c.number_of(kind) for c in (static, control.modal)]
            if sets[0] != sets[1]:
                raw.lost.append(
                    f"{static.place}: its {kind} = {sets[0]} is not that of the modes ({sets[1]}), which holds in both "
                    "here: frequencies may differ"
                )
    free = stress_free(bulk, properties) or [0.0]
    varied = any(material.temperature is not None for material in raw.materials)
    if acting is not None and (static is not None or not varied):
        start = np.full(len(acting), free[0]) if heat["INIT"] is None else heat["INIT"]
        raw.temperature = np.column_stack([start, acting])
        if len(free) > 1 and heat["INIT"] is None:
            raw.lost.append(
                f"{case.place}: materials are free of stress at several temperatures TREF; that of the first, "
                f"{free[0]:g}, is taken for all, so frequencies may differ"
            )
        if varied and of_material is not acting:
            raw.lost.append(
                f"{case.place}: the temperatures of the materials are not those that strain the body; the latter are "
                "taken for both, so frequencies may differ"
            )
    elif varied and of_material is not None:
        raw.temperature = np.column_stack([np.full(len(of_material), free[0]), of_material])
        raw.materials = [replace(material, expansion=np.zeros(6)) for material in raw.materials]
        raw.remarks.append(
            f"{case.place}: the temperatures are of the materials alone and strain nothing, so expansions are 0"
        )


def _merge_alike(raw: RawMesh) -> None:
    """One material for the properties that have the same."""
    keys = [repr(replace(material, where="")) for material in raw.materials]
    order = {key: number for number, key in enumerate(dict.fromkeys(keys))}
    number = np.array([order[key] for key in keys])
    raw.materials = [raw.materials[keys.index(key)] for key in order]
    raw.regions = [number[regions] for regions in raw.regions]


def _heat(bulk: Bulk, case: Case, option: str) -> Array | None:
    """(n,) temperatures that a subcase chooses, None if it chooses none."""
    command = f"TEMP({option})"
    if (number := case.number_of(command)) is None:
        return None
    found = temperatures(bulk, number, case.place_of(command))
    for new, ends in bulk.middles:
        found[new] = found[ends].mean()
    used = np.unique(joined(nodes.ravel() for _, nodes in bulk.raw.blocks))
    if len(without := used[np.isnan(found[used])]):
        raise Damaged(
            f"{case.place_of(command)}: TEMPERATURE = {number} gives node "
            f"{bulk.raw.node_id[without[0]]} no temperature; add it or a TEMPD"
        )
    return found


def _tell_left_out(bulk: Bulk, control: Control) -> None:
    """Cards that are not read or not used."""
    raw, others = bulk.raw, {name: c for name, c in bulk.cards.items() if name not in _READ and c}
    known = _SILENT if control.matrices else re.compile(f"{_SILENT.pattern}|DMIG")
    counting = [n for n in others if _COUNTS.fullmatch(n) and not known.fullmatch(n)]
    raw.lost += [
        lost(others[n][0].place, f"{n} ({len(others[n])} card{'s' * (len(others[n]) > 1)})") for n in counting
    ]
    loads = {name: others[name] for name in (*LOADS, *OTHERS) if name in others}
    taken = set() if raw.state is None else set(loads)
    names = [n for n in others if n not in taken and n not in counting and not known.fullmatch(n)]
    raw.remarks += ignored(names, "|".join((*LOADS, *OTHERS)))
    if raw.state is not None and bulk.cards["SUPORT"] + bulk.cards["SUPORT1"]:
        raw.lost.append(f"{raw.state.where}: SUPORT balances its loads by inertia, which is not done here")
    raw.remarks += _integrated(bulk)


def _integrated(bulk: Bulk) -> list[str]:
    """How Nastran integrates bricks and wedges, and how they are integrated here."""
    raw, options, told = bulk.raw, dict[str, set[tuple[str, str]]](), []
    by_number = {card.whole(1): card for card in bulk.cards["PSOLID"]}
    words = {"": "", "0": "", "BUBBLE": "", "2": "TWO", "3": "THREE", "1": "FULL", "REDUCED": ""}
    for name, (least, _) in {name: sorted(forms) for name, forms in _SOLIDS.items()}.items():
        for card in bulk.cards[name]:
            solid = by_number.get(card.whole(2, card.whole(1)))
            if solid is not None and name in ("CHEXA", "CPENTA"):
                kind = f"{name} of {least if sum(map(bool, card[3:])) == least else {8: 20, 6: 15}[least]} nodes"
                pair = words.get(solid.at(4), solid.at(4)), words.get(solid.at(6), solid.at(6))
                options.setdefault(kind, set()).add(pair)
    for kind, pairs in options.items():
        if kind == "CHEXA of 20 nodes" and {rule for rule, _ in pairs} == {"TWO"}:
            raw.integration = "reduced"
        elif pairs - {("TWO", "FULL"), ("THREE", "FULL")}:
            how = "bubble functions" if kind[-7] in " 86" and kind[-8] == " " else "reduced shear"
            told.append(
                f"{kind} are integrated in full, without Nastran's {how} (PSOLID, IN and ISOP): stiffer, by less on "
                "finer meshes"
            )
    coupled = bulk.parameter("COUPMASS")
    if coupled is None or coupled < 0:
        told.append(
            "masses are consistent, where Nastran lumps them without PARAM,COUPMASS,1: its frequencies are lower, by "
            "less on finer meshes"
        )
    return [*told, *locks(raw)]


# content -------------------------------------------------------------------------------------------------------------


def _grid(cards: Mapping[str, list[BulkCard]], file: str) -> tuple[RawMesh, Constraints, Chained]:
    """The grid points in the basic system, and what they hold themselves (PS) in the directions of
    their systems (CD)."""
    if not cards["GRID"]:
        raise Damaged("it holds no GRID card; give the file that has them")
    usual = next(iter(cards["GRDSET"]), BulkCard())
    _once(cards["GRID"])
    systems, table = _systems(cards, file), np.empty((len(cards["GRID"]), 3))
    ids, held = np.array([card.whole(1) for card in cards["GRID"]], dtype=np.int64), Constraints()
    within, turned = dict[int, list[int]](), dict[int, list[int]]()
    for place, card in enumerate(cards["GRID"]):
        table[place] = [card.real(column) or 0.0 for column in (3, 4, 5)]
        for column, groups in ((2, within), (6, turned)):
            number = card.whole(column, usual.whole(column, 0))
            if number > 0:  # -1 is a grid point of a fluid
                groups.setdefault(number, []).append(place)
        held.hold(int(ids[place]), (card if card.at(7) else usual).directions(7))
    for groups, into in ((within, True), (turned, False)):
        for number, places in groups.items():
            with at_card(cards["GRID"][places[0]]):
                system = systems[number]
            if into:
                table[places] = system.points(table[places])
            else:
                frames = system.directions(table[places])
                held.axes |= dict(zip(ids[places].tolist(), frames, strict=True))
    points = {n: card for card in cards["SPOINT"] for n in listed(card, 1)}
    points |= {n: c for c, n in unlisted_points(cards) if not np.isin(n, ids)}
    scalar = np.array(sorted(points), dtype=np.int64)
    if len(both := np.intersect1d(scalar, ids)):
        raise Damaged(f"{points[int(both[0])].where}: point {both[0]} is a GRID as well; take one out")
    middle = np.tile(table.mean(axis=0), (len(scalar), 1))
    return RawMesh(np.vstack([table, middle]), np.concatenate([ids, scalar])), held, systems


def _once(cards: list[BulkCard]) -> None:
    """Take out cards that say the same again, as Nastran allows.

    Raises:
        Damaged: one that says something else under the same number.
    """
    known = dict[int, BulkCard]()
    for card in [*cards]:
        number = card.whole(1)
        if number not in known:
            known[number] = card
            continue
        if _numbers(card) != _numbers(known[number]):
            raise Damaged(f"{card.where} is there already, with other fields, in {known[number].place}; take one out")
        cards[:] = [other for other in cards if other is not card]


def _numbers(card: BulkCard) -> list[object]:
    """Fields with their values, however they are written."""
    fields = [card.at(place) for place in range(1, max(len(card), 9))]
    while fields and not fields[-1]:
        fields.pop()
    made = list[object]()
    for text in fields:
        try:
            made.append(number_of(text) if text else "")
        except ValueError:
            made.append(text)
    return made


def _systems(cards: Mapping[str, list[BulkCard]], file: str) -> Chained:
    """The systems of CORD1R, C, S (through three grid points) and CORD2R, C, S."""
    known = dict[int, tuple[BulkCard, int]]()
    for name in _SYSTEMS:
        for card in cards[name]:
            for place in (1, 5) if name[4] == "1" else (1,):
                if place == 5 and not card.at(place):
                    continue
                number = card.whole(place)
                if number in known and _numbers(known[number][0]) != _numbers(card):
                    raise Damaged(f"{card.where} defines system {number}, which is there already; take one out")
                known[number] = card, place
    grids = dict[int, BulkCard]()

    def at(number: int) -> Array:
        """(3,) of a grid point."""
        if not grids:
            grids.update((card.whole(1), card) for card in cards["GRID"])
        if number not in grids:
            raise Damaged(f"names grid point {number}, which is not there")
        card, usual = grids[number], next(iter(cards["GRDSET"]), BulkCard())
        within = chained[max(card.whole(2, usual.whole(2, 0)), 0)]
        return within.points(np.array([[card.real(column) or 0.0 for column in (3, 4, 5)]]))[0]

    def made(number: int) -> System:
        if number not in known:
            raise Damaged(f"uses the coordinate system {number}, which no CORD card defines; add it")
        card, place = known[number]
        with at_card(card):
            if card[0][4] == "1":
                points = np.array([at(card.whole(place + i)) for i in (1, 2, 3)])
            else:
                rows = [[card.real(3 + 3 * i + k) or 0.0 for k in range(3)] for i in range(3)]
                points = chained[card.whole(2, 0)].points(np.array(rows))
            return through({"R": 0, "C": 1, "S": 3}[card[0][5]], *points)

    chained = Chained(made)
    return chained


def _elements(bulk: Bulk) -> list[int]:
    """Add the solids; the properties that they name, in the order of their regions."""
    blocks: dict[str, list[tuple[int, int, list[int]]]] = {}
    properties, fluids, there = dict[int, int](), _fluids(bulk), dict[int, BulkCard]()
    for name in _SOLIDS:
        for card in bulk.cards[name]:
            if card.whole(2, card.whole(1)) in fluids:
                continue
            number, region = card.whole(1), properties.setdefault(
                card.whole(2, card.whole(1)), len(properties)
            )
            if (before := there.setdefault(number, card)) is not card:
                raise Damaged(f"{card.where} is there already, in {before.place}; take one out")
            kind, nodes = _cell(name, number, card)
            bulk.positions(card, [n for n in nodes if n])
            blocks.setdefault(kind, []).append((number, region, nodes))
    _add_left_out(bulk, blocks)
    bulk.raw.add_solids(blocks, bulk.numbering, "an element names")
    turn_left_handed(bulk.raw, bricks=True)
    if fluids and not blocks:
        where = next(card for card in bulk.cards["PSOLID"] if card.whole(1) in fluids).where
        raise Damaged(f"{where}: all solid cells are a fluid (MAT10); give those of the structure")
    return list(properties)


def _cell(name: str, number: int, card: BulkCard) -> tuple[str, list[int]]:
    """Type and nodes of a cell, 0 where a mid-side node is left out."""
    forms = _SOLIDS[name]
    nodes = [card.whole(place, 0) for place in range(3, len(card))]
    while nodes and nodes[-1] == 0:
        nodes.pop()
    corners, most = sorted(forms)
    if len(nodes) not in range(corners, most + 1) or min(nodes[:corners]) < 1 or min(nodes) < 0:
        raise Damaged(
            f"{card.where}: the element has {sum(n > 0 for n in nodes)} nodes; {corners} or {most} are read"
        )
    kind, places = forms[corners if len(nodes) == corners else most]
    nodes += [0] * (max(places) + 1 - len(nodes))
    return kind, [nodes[i] for i in places]


def _add_left_out(bulk: Bulk, blocks: dict[str, list[tuple[int, int, list[int]]]]) -> None:
    """Put a node in the middle of every edge without one in cells that have others: it moves as the
    mean of the edge's ends, so the edge is a straight first-order one, as Nastran takes it."""
    raw, made = bulk.raw, dict[tuple[int, int], int]()
    first = int(raw.node_id.max()) + 1
    for kind, cells in blocks.items():
        edges, corners = CELL_TYPES[kind].edges, CELL_TYPES[kind].corners
        for _, _, nodes in cells:
            for i in (i for i, node in enumerate(nodes) if not node):
                a, b = (nodes[end] for end in edges[i - corners][:2])
                nodes[i] = made.setdefault((min(a, b), max(a, b)), first + len(made))
    if not made:
        return
    at = bulk.numbering.positions(list(made), "an element names")
    new = len(raw.points) + np.arange(len(at))
    where, mean = f"{bulk.file}: mid-side nodes that are left out", np.array([1.0, -0.5, -0.5])
    raw.links += [
        Equation(where, np.array([node, *ends]), np.full(3, way), mean)
        for node, ends in zip(new, at, strict=True)
        for way in range(3)
    ]
    bulk.middles = list(zip(new.tolist(), at, strict=True))
    raw.points = np.concatenate([raw.points, raw.points[at].mean(axis=1)])
    raw.node_id = np.concatenate([raw.node_id, first + np.arange(len(at))])
    bulk.numbering = Numbering(raw.node_id)
    raw.remarks.append(f"{len(at)} mid-side nodes are left out by cells: their edges are of first order")


def _fluids(bulk: Bulk) -> set[int]:
    """Properties of fluid cells, which are told: MAT10, or PFLUID of a PSOLID."""
    acoustic = {card.whole(1) for card in bulk.cards["MAT10"]}
    solid = {card.whole(1) for name in ("MAT1", "MAT9", "MAT11") for card in bulk.cards[name]}
    fluids = {
        card.whole(1)
        for card in bulk.cards["PSOLID"]
        if card.at(7) == "PFLUID" or card.whole(2, 0) in acoustic - solid
    }
    for number in fluids:
        count = sum(card.whole(2) == number for name in _SOLIDS for card in bulk.cards[name])
        if count:
            where = next(bulk.numbered(["PSOLID"], number)).where
            bulk.raw.lost.append(
                f"{where}: its {count} cells are a fluid and are left out: in contact with it "
                "the structure has lower frequencies"
            )
    return fluids


def _constrain(bulk: Bulk, control: Control) -> dict[int, dict[int, float]]:
    """Hold GRID's own directions and those of the sets that the case control chooses, or of the only one; the
    displacements that SPC prescribes in a static step: node -> direction (0 to 5) -> size."""
    held, cards, enforced = bulk.held, bulk.cards, dict[int, dict[int, float]]()
    chosen = _chosen(bulk, control, "SPC", held.left_out)
    scalar = set(bulk.raw.node_id[bulk.scalar :].tolist())
    for card in cards["SPC1"]:
        if card.whole(1) in chosen:
            for node in listed(card, 3, bulk.numbering):
                held.hold(node, "x" if node in scalar else card.directions(2))
    for card in cards["SPC"]:
        for place in (2, 5) if card.whole(1) in chosen else ():
            if not (node := card.whole(place, 0)):
                continue
            ways = "x" if node in scalar else card.directions(place + 1)
            held.hold(node, ways)
            if size := card.real(place + 2) or 0.0:
                bulk.positions(card, [node])
                enforced.setdefault(node, {}).update({"xyzabc".index(way): size for way in ways})
    return enforced


def _chosen(bulk: Bulk, control: Control, kind: str, left_out: list[str]) -> set[int]:
    """Numbers of the sets of constraints that hold, those that they are made of included."""
    every = {c.whole(1) for name in (kind, f"{kind}1") for c in bulk.cards[name]}
    case = control.modal
    number = case.number_of(kind)
    if number is None and every and control.there:
        sets = "the only set" if len(every) == 1 else "several sets"
        left_out.append(
            f"{sets} of {kind}, of which the case control chooses none: not held (write {kind} = {min(every)})"
        )
        return set()
    if number is None and len(every) > 1:
        left_out.append(f"several sets of {kind} without a case control that chooses")
        return set()
    every_case = dict.fromkeys(c.number_of(kind) for c in control.cases)
    if len(every_case) > 1:
        names = ", ".join(str(n) for n in every_case if n is not None)
        bulk.raw.remarks.append(
            f"{case.place}: subcases choose several sets of {kind} ({names}); {number} is taken"
        )
    unions = bulk.cards[f"{kind}ADD"]
    chosen = every if number is None else {number}
    if unknown := sorted(chosen - every - {c.whole(1) for c in unions}):
        left_out.append(
            f"the set {kind} = {unknown[0]} of the case control is not defined, so it does not hold"
        )
    for card in unions:
        if card.whole(1) in chosen:
            chosen |= set(listed(card, 2))
    return chosen


def _rigid(bulk: Bulk) -> Iterator[Link]:
    """RBE2: points that follow one as a rigid body does, in some of its directions."""
    for card in bulk.cards["RBE2"]:
        words = card[4:] if "THRU" in card else [word for word in card[4:] if word.isdecimal()]
        members = listed(BulkCard([*card[:4], *words]), 4, bulk.numbering)
        if not members:
            raise Damaged(f"{card.where} couples no nodes to its node {card.at(2)}; add them")
        reference, ways = bulk.positions(card, [card.whole(2)]), card.directions(3)
        link = RigidLink(card.where, int(reference[0]), bulk.positions(card, members), ways)
        turned = bulk.held.axes.keys() & set(members) if ways not in _EVERY else set()
        if len(turned) < len(members):
            plain = [number for number in members if number not in turned]
            yield replace(link, members=bulk.positions(card, plain))
        for number in sorted(turned):
            alone = bulk.positions(card, [number])
            yield replace(link, members=alone, axes=bulk.held.axes[number])


def _averages(bulk: Bulk) -> Iterator[Link]:
    """RBE3: a point that follows others in the mean."""
    for card in bulk.cards["RBE3"]:
        where = card.where  # behind UM stand those that the equations give, which are others here
        members: list[int] = []
        weights: list[Array] = []
        place, end = 5, min(card.index(word) if word in card else len(card) for word in ("UM", "ALPHA"))
        while place < end:
            if not card.at(place):
                place += 1
                continue
            weight = card.real(place) or 0.0
            digits = [int(c) - 1 for c in card.at(place + 1) if c in "123"]
            place += 2
            while place < end and (not card[place] or card[place].isdecimal()):
                if card[place]:
                    members.append(int(card[place]))
                    axes = bulk.held.axes.get(members[-1], np.eye(3))[digits]
                    weights.append(weight * (np.eye(3) if len(digits) == 3 else axes.T @ axes))
                place += 1
        if not members:
            raise Damaged(f"{where} follows no nodes; add them")
        ways = card.directions(4)
        own_axes = bulk.held.axes.get(card.whole(3)) if ways not in _EVERY else None
        reference, positions = bulk.positions(card, [card.whole(3)]), bulk.positions(card, members)
        W = np.array(weights)
        even = (W == W[:, :1, :1] * np.eye(3)).all()
        factors = W[:, 0, 0] if even else W
        yield AverageLink(where, int(reference[0]), positions, factors, ways, own_axes)


def _equations(bulk: Bulk, control: Control) -> Iterator[Link]:
    """MPC of the sets that the case control chooses, or of the only one of a file without case control."""
    left_out = list[str]()
    chosen = _chosen(bulk, control, "MPC", left_out)
    bulk.raw.lost += [f"{bulk.file}: {text}" for text in left_out]
    for card in bulk.cards["MPC"]:
        if card.whole(1) not in chosen:
            continue
        places = [p + s for p in range(2, len(card), 8) for s in (0, 3) if card.at(p + s)]
        numbers = [card.whole(p) for p in places]
        nodes, ways = bulk.positions(card, numbers), [card.whole(p + 1, 0) - 1 for p in places]
        if not all(0 <= way < 6 for way in ways):
            raise Damaged(f"{card.where} names a component that no grid point has (1 to 6)")
        factors = np.array([card.real(p + 2) or 0.0 for p in places])
        if bulk.held.axes.keys().isdisjoint(numbers):
            yield Equation(card.where, nodes, np.array(ways), factors)
            continue
        pairs = zip(numbers, ways, strict=True)
        along = np.array([bulk.held.axes.get(node, np.eye(3))[way % 3] for node, way in pairs])
        first = np.array(ways) // 3 * 3
        yield in_axes(card.where, nodes, first, along * factors[:, None])


def _drop_islands(raw: RawMesh) -> None:
    """Leave out links whose nodes meet neither solids nor lumps, directly or by other links."""
    near = {*joined(nodes.ravel() for _, nodes in raw.blocks).tolist()}
    for item in raw.lumps:
        near.update([item.node] if isinstance(item, PointMass) else item.nodes.tolist())
    left = [link for link in raw.links if not isinstance(link, FaceTie)]
    nodes = {id(link): _nodes_of(link) for link in left}
    size = -1
    while size != len(near):
        size = len(near)
        for link in left:
            if not near.isdisjoint(nodes[id(link)]):
                near |= nodes[id(link)]
    alone = [link for link in left if near.isdisjoint(nodes[id(link)])]
    if alone:
        raw.remarks.append(
            f"{alone[0].where}: it and {len(alone) - 1} other constraints join nothing to the solids: left out"
        )
        gone = {id(link) for link in alone}
        raw.links = [link for link in raw.links if id(link) not in gone]


def _nodes_of(link: Link) -> set[int]:
    """Positions of the nodes of a link that names no face."""
    if isinstance(link, Equation):
        return {*link.nodes.tolist()}
    assert isinstance(link, RigidLink | AverageLink) and not isinstance(link.members, str)
    return {link.reference, *link.members.tolist()}


def _retain(bulk: Bulk) -> None:
    """ASET, ASET1: displacements that a reduction keeps; they are held by nothing."""
    nodes = [card.whole(p) for card in bulk.cards["ASET"] for p in range(1, len(card), 2) if card.at(p)]
    nodes += [n for card in bulk.cards["ASET1"] for n in listed(card, 2, bulk.numbering)]
    if nodes:
        bulk.raw.add_set("ASET", nodes, bulk.numbering)
        bulk.raw.retained.append("ASET")


def _structures(bulk: Bulk) -> Iterator[Structure]:
    """Beams, rods and shells, which are not read."""
    for name, (first, count) in _OTHERS.items():
        if cards := bulk.cards[name]:
            nodes = [[card.whole(p, 0) for p in range(first, first + count)] for card in cards]
            nodes = [[n for n in each if n in bulk.numbering.sorted] for each in nodes]
            elements = [bulk.numbering.positions(each, "").tolist() for each in nodes if each]
            if elements:
                yield Structure(cards[0].place, name, elements)


_OTHERS = {
    **dict.fromkeys(("CBAR", "CBEAM", "CBEND", "CROD", "CTUBE", "CGAP", "CVISC", "CBEAM3"), (3, 2)), "CONROD": (2, 2),
    **{name: (3, corners) for name, corners in SHELLS.items()}, "CSHEAR": (3, 4),
}  # fmt: skip
"""Card of an element that is no solid -> place of its first node, and how many it has at its corners."""


def _shells(bulk: Bulk) -> None:
    """Faces by the property of the shells that lie on them."""
    facets: dict[tuple[str, int], list[list[int]]] = {}
    for name, corners in SHELLS.items():
        for card in bulk.cards[name]:
            nodes = [card.whole(3 + i) for i in range(corners)]
            facets.setdefault((f"PSHELL {card.whole(2, card.whole(1))}", corners), []).append(nodes)
    for (label, _), numbers in facets.items():
        positions = bulk.numbering.positions(numbers, f"a shell of {label} names")
        bulk.raw.facets.setdefault(label, []).append(positions)
