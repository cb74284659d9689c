"""Of an Ansys archive: coordinate systems, turned nodes, and which nodes are chosen."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..data import Array
from .archive import Archive, whole
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
        step = max(whole(words[3] or "1", "NROTAT"), 1)
        nodes = range(int(words[1]), whole(words[2], "NROTAT") + 1, step)
    system = _known(archive, archive.current.get("CSYS", 0), "NROTAT")
    archive.turns.update(dict.fromkeys(nodes, system))


def _modify(archive: Archive, words: list[str]) -> None:
    """NMODIF, node, , , , angles of the node."""
    if any(words[5:8]) and is_number(words[1]):
        archive.turns[int(words[1])] = System(axes=axes_by_angles(_numbers(words[5:8], "NMODIF")))


# selections -------------------------------------------------------------------------------------


def _component_selected(archive: Archive, words: list[str]) -> None:
    """CMSEL, S or R or A or U, component of nodes; one of elements chooses no nodes."""
    how, name = words[1].upper() or "S", words[2]
    nodes = archive.component(name)
    if nodes is not None:
        _select(archive, how, set(nodes))
        archive.chosen = name if how == "S" else ""
    elif how == "S":
        archive.unread, archive.chosen = f"CMSEL,{how},{name}", ""


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
    elif item == "LOC" and axis.upper() in ("X", "Y", "Z") and low:
        _select(archive, how, _at_place(archive, "XYZ".index(axis.upper()), low, high))
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


def _select(archive: Archive, how: str, nodes: set[int]) -> None:
    before = _selected(archive)
    made = {"S": nodes, "R": before & nodes, "A": before | nodes, "U": before - nodes}
    archive.chosen = ""
    if how == "S":
        archive.unread = ""
    if how in made:
        archive.selected = made[how]
    else:
        archive.unread = f"of the kind '{how}'"


def _everything(archive: Archive, words: list[str]) -> None:
    """ALLSEL."""
    archive.selected, archive.chosen, archive.unread = None, "", ""


def _by_elements(archive: Archive, words: list[str]) -> None:
    """NSLE and others that choose nodes by elements, lines, areas."""
    archive.chosen, archive.unread = "", ",".join(word for word in words if word)


def _component(archive: Archive, words: list[str]) -> None:
    """CM, name, NODE: the nodes that are chosen."""
    if words[2].upper() == "NODE" and (nodes := archive.nodes("ALL")) is not None:
        archive.components[words[1]] = list(nodes)


COMMANDS = {
    "LOCAL": _system,
    "CS": _by_nodes,
    "CLOCAL": _relative,
    "CSYS": _activate,
    "NROTAT": _turn,
    "NMODIF": _modify,
    "CMSEL": _component_selected,
    "NSEL": _nodes_selected,
    "ALLSEL": _everything,
    "ALLS": _everything,
    **dict.fromkeys(("NSLE", "NSLA", "NSLL", "NSLK", "NSLV"), _by_elements),
    "CM": _component,
}
