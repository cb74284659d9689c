"""Of an Ansys archive: coordinate systems, turned nodes, and which nodes are chosen."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

from ..data import Array
from .archive import Archive, Command, whole
from .raw import Damaged, is_number, real
from .systems import System, axes_by_angles


def _numbers(words: list[str], what: str) -> Array:
    """Three numbers, empty places 0."""
    return np.array([real(word, what) if word else 0.0 for word in [*words, "", "", ""][:3]])


def _system(archive: Archive, words: list[str]) -> None:
    """LOCAL, number, kind, origin, angles, ratios; or LOCAL,R5.0,LOC or ANG or PRM, number, kind, values."""
    if words[1].upper().startswith(("R5", "UNBL")):
        part, number, kind = (
            words[2].upper(),
            whole(words[3], "LOCAL"),
            whole(words[4] or "0", "LOCAL"),
        )
        before = archive.systems.get(number, System(kind))
        values = _numbers(words[5:8], "LOCAL")
        if part == "LOC":
            archive.systems[number] = System(kind, values, before.axes)
        elif part == "ANG":
            archive.systems[number] = System(kind, before.origin, axes_by_angles(values))
        elif part == "PRM" and (values[:2] != 1).any() and words[5]:
            archive.systems[number] = System(-1)
        return
    number, kind = whole(words[1], "LOCAL"), whole(words[2] or "0", "LOCAL")
    ratios = [word for word in words[9:11] if word and real(word, "LOCAL") != 1]
    axes = axes_by_angles(_numbers(words[6:9], "LOCAL"))
    archive.systems[number] = System(-1 if ratios else kind, _numbers(words[3:6], "LOCAL"), axes)
    archive.current["CSYS"] = number


def _by_nodes(archive: Archive, words: list[str]) -> None:
    """CS, number, kind, nodes at the origin, on the x axis, in the x-y plane."""
    number, kind, *nodes = (whole(word or "0", "CS") for word in words[1:6])
    place = {
        n: np.array(p) for n, p in zip(archive.node_id, archive.points, strict=True) if n in nodes
    }
    if len(place) < 3 or words[6] or words[7]:
        raise Damaged(
            f"CS,{number} names fewer than three nodes that are there before it, or ratios; write LOCAL"
        )
    origin, on, beside = (place[n] for n in nodes)
    x = on - origin
    z = np.cross(x, beside - origin)
    if not np.linalg.norm(z) > 0:
        raise Damaged(f"CS,{number} names three nodes on a line; name one beside it")
    axes = np.array([x, np.cross(z, x), z])
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    archive.systems[number] = System(kind, origin, axes)
    archive.current["CSYS"] = number


def _relative(archive: Archive, words: list[str]) -> None:
    """CLOCAL, number, kind, origin and angles in the active system."""
    active = _known(archive, archive.current.get("CSYS", 0), "CLOCAL")
    if active.kind:
        raise Damaged("CLOCAL in a cylindrical or spherical system is not read; write LOCAL")
    number, kind = whole(words[1], "CLOCAL"), whole(words[2] or "0", "CLOCAL")
    origin = active.origin + _numbers(words[3:6], "CLOCAL") @ active.axes
    axes = axes_by_angles(_numbers(words[6:9], "CLOCAL")) @ active.axes
    archive.systems[number] = System(kind, origin, axes)
    archive.current["CSYS"] = number


def _known(archive: Archive, number: int, command: str) -> System:
    system = archive.systems.get(number)
    if system is None or system.kind not in (0, 1, 2):
        why = "is not defined" if system is None else "is a torus or an ellipse, which is not read"
        raise Damaged(
            f"{command} takes the coordinate system {number}, which {why}; write it by LOCAL before"
        )
    return system


def _activate(archive: Archive, words: list[str]) -> None:
    """CSYS, number."""
    archive.current["CSYS"] = (
        whole(words[1] or "0", "CSYS") if words[1].lstrip("-").isdecimal() else -1
    )


def _turn(archive: Archive, words: list[str]) -> None:
    """NROTAT, node or component or ALL[, last[, step]]: nodes turned into the active system."""
    nodes: Iterable[int] | None = archive.nodes(words[1])
    if nodes is None:
        archive.held.all_turned = True
        archive.lost.append(
            f"{archive.where}: NROTAT,{words[1]} turns nodes of the selection {archive.unread}, which is not read"
        )
        return
    if words[2] and is_number(words[1]):
        nodes = archive.through(words[1], words[2], words[3], "NROTAT")
    system = _known(archive, archive.current.get("CSYS", 0), "NROTAT")
    archive.turns.update(dict.fromkeys(nodes, system))


def _modify(archive: Archive, words: list[str]) -> None:
    """NMODIF, node, , , , angles of the node."""
    if any(words[5:8]) and is_number(words[1]):
        archive.turns[int(words[1])] = System(axes=axes_by_angles(_numbers(words[5:8], "NMODIF")))


# selections -------------------------------------------------------------------------------------


def _component_selected(archive: Archive, words: list[str]) -> None:
    """CMSEL, S or R or A or U, component of nodes or of elements."""
    how, name = words[1].upper() or "S", words[2]
    nodes = archive.component(name)
    if nodes is not None:
        _select(archive, how, set(nodes))
        archive.chosen = name if how == "S" else ""
    elif how == "ALL" or (cells := archive.cells(name)) is None or name.upper() == "ALL":
        archive.unread, archive.chosen = f"CMSEL,{how},{name}", ""
    else:
        _pick(archive, how, set(cells))


def _nodes_selected(archive: Archive, words: list[str]) -> None:
    """NSEL, S or R or A or U, NODE or LOC, axis, from, to, step; NSEL, ALL or NONE or INVE."""
    how, item, axis, low, high, step = words[1].upper() or "S", words[2].upper(), *words[3:7]
    archive.chosen = ""
    if how in ("ALL", "NONE"):
        archive.unread, archive.selected = "", None if how == "ALL" else set()
    elif how == "INVE":
        archive.selected = {*archive.node_id} - _selected(archive)
    elif item in ("NODE", "") and is_number(low):
        last = whole(high or low, "NSEL")
        inside = range(int(low), last + 1, max(whole(step or "1", "NSEL"), 1))
        _select(archive, how, {n for n in archive.node_id if n in inside})
    elif item == "LOC" and axis.upper() in ("X", "Y", "Z") and archive.points:
        _select(archive, how, _at_place(archive, "XYZ".index(axis.upper()), low or "0", high))
    else:
        archive.unread = ",".join(word for word in words if word)


def _at_place(archive: Archive, axis: int, low: str, high: str) -> set[int]:
    """Nodes whose coordinate in the active system lies between two numbers, or at one number.

    At one number it may be off by 0.5 per cent, at 0 by 1e-6 (Mechanical APDL, command NSEL).
    """
    system = _known(archive, archive.current.get("CSYS", 0), "NSEL,LOC")
    if system.kind == 2:
        raise Damaged("NSEL,LOC in a spherical system is not read; choose nodes by a component")
    x, y, z = system.axes @ (np.array(archive.points) - system.origin).T
    if system.kind == 1:
        x, y = np.hypot(x, y), np.degrees(np.arctan2(y, x))
    value = (x, y, z)[axis]
    first = real(low, "NSEL")
    last = real(high, "NSEL") if high else first
    near = (0.005 * abs(first) or 1e-6) if first == last else 1e-8 * abs(last - first)
    inside = (value >= first - near) & (value <= last + near)
    return set(np.array(archive.node_id)[inside].tolist())


def _selected(archive: Archive) -> set[int]:
    return {*archive.node_id} if archive.selected is None else archive.selected


def _changed(before: set[int], how: str, some: set[int]) -> set[int] | None:
    """A selection after S, R, A or U of some; None after another command."""
    return {"S": some, "R": before & some, "A": before | some, "U": before - some}.get(how)


def _select(archive: Archive, how: str, nodes: set[int]) -> None:
    archive.chosen = ""
    archive.unread = "" if how == "S" else archive.unread
    if (made := _changed(_selected(archive), how, nodes)) is not None:
        archive.selected = made
    else:
        archive.unread = f"of the kind '{how}'"


def _everything(archive: Archive, words: list[str]) -> None:
    """ALLSEL."""
    archive.selected, archive.chosen, archive.unread = None, "", ""
    archive.picked, archive.unread_cells = None, ""


def _nodes_of_cells(archive: Archive, words: list[str]) -> None:
    """NSLE, S or R or A or U: nodes of the chosen elements."""
    if (numbers := archive.cells("ALL")) is None or words[2].upper() not in ("", "ALL"):
        _not_read(archive, words)
        return
    chosen = set(numbers)
    nodes = {n for e in archive.elements if e.number in chosen for n in e.nodes if n}
    _select(archive, words[1].upper() or "S", nodes)


def _not_read(archive: Archive, words: list[str]) -> None:
    """NSLA and others that choose nodes by lines, areas, volumes."""
    archive.chosen, archive.unread = "", ",".join(word for word in words if word)


def _cells_selected(archive: Archive, words: list[str]) -> None:
    """ESEL, S or R or A or U, TYPE or MAT or REAL or ESYS or ELEM or ENAME, , from, to, step; ESEL, ALL or
    NONE or INVE."""
    how, item, low, high, step = words[1].upper() or "S", words[2].upper(), *words[4:7]
    known = {"TYPE": "kind", "MAT": "material", "REAL": "real", "ESYS": "system", "ELEM": "number", "": "number"}
    if how in ("ALL", "NONE"):
        archive.unread_cells, archive.picked = "", None if how == "ALL" else set()
    elif how == "INVE":
        archive.picked = {e.number for e in archive.elements} - set(archive.cells("ALL") or ())
    elif is_number(low) and (item in known or item[:4] == "ENAM"):
        inside = range(int(low), whole(high or low, "ESEL") + 1, max(whole(step or "1", "ESEL"), 1))
        if item in known:
            numbers = {e.number for e in archive.elements if getattr(e, known[item]) in inside}
        else:
            numbers = {e.number for e in archive.elements if archive.kinds.get(e.kind, 0) in inside}
        _pick(archive, how, numbers)
    elif item[:4] == "ENAM" and (number := re.search(r"\d+$", low)):
        numbers = {e.number for e in archive.elements if archive.kinds.get(e.kind) == int(number[0])}
        _pick(archive, how, numbers)
    else:
        archive.unread_cells = ",".join(word for word in words if word)


def _cells_of_nodes(archive: Archive, words: list[str]) -> None:
    """ESLN, S or R or A or U, 1 if all of their nodes must be chosen."""
    if (nodes := archive.nodes("ALL")) is None or words[3].upper() not in ("", "ALL"):
        archive.unread_cells = ",".join(word for word in words if word)
        return
    there, whole_ones = set(nodes), words[2] == "1"
    inside = {
        e.number
        for e in archive.elements
        if (there.issuperset({*e.nodes} - {0}) if whole_ones else not there.isdisjoint(e.nodes))
    }
    _pick(archive, words[1].upper() or "S", inside)


def _pick(archive: Archive, how: str, cells: set[int]) -> None:
    before = set(archive.cells("ALL") or ())
    archive.unread_cells = "" if how == "S" else archive.unread_cells
    if (made := _changed(before, how, cells)) is not None:
        archive.picked = made
    else:
        archive.unread_cells = f"of the kind '{how}'"


def _component(archive: Archive, words: list[str]) -> None:
    """CM, name, NODE or ELEM: what is chosen."""
    if words[2].upper().startswith("NODE") and (nodes := archive.nodes("ALL")) is not None:
        archive.components[words[1]] = list(nodes)
    if words[2].upper().startswith("ELEM") and (cells := archive.cells("ALL")) is not None:
        archive.groups[words[1]] = list(cells)


def _masters(archive: Archive, words: list[str]) -> None:
    """M, node, direction, last node, step, further directions: degrees of freedom that are kept."""
    if (nodes := archive.nodes(words[1])) is None:
        archive.leave_out(f"M,{words[1]} (it names no nodes that are there)")
        return
    if words[3] and is_number(words[1]):
        nodes = [*archive.through(words[1], words[3], words[4], "M")]
    archive.masters += nodes


COMMANDS: dict[str, Command] = {
    "LOCAL": _system,
    "CS": _by_nodes,
    "CLOCAL": _relative,
    "CSYS": _activate,
    "NROTAT": _turn,
    "NMODIF": _modify,
    "CMSEL": _component_selected,
    "NSEL": _nodes_selected,
    "ESEL": _cells_selected,
    "ESLN": _cells_of_nodes,
    "ALLSEL": _everything,
    "NSLE": _nodes_of_cells,
    **dict.fromkeys(("NSLA", "NSLL", "NSLK", "NSLV"), _not_read),
    "CM": _component,
    "M": _masters,
}
