"""Measured modes, or another program's, from a Universal File, by pyuff (data sets 15 or 2411: points, 55: modes, 58:
functions, 164: units; 2414: modes, which are read here).

A test knows some directions of some points, no mesh, no mass and nothing of completeness: the modal file says so by
its attribute ``source`` = ``measured``. Its points are the measured ones; a monitor ``point <number>`` has one row for
each direction that was measured there, and directions that were not are zero in phi. A direction counts as measured if
it moves in some mode.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..basis import read_basis
from ..data import Array, Compliance, Indices, Mesh, ModalBasis, ModalGroup, Rows
from ..errors import UserError, in_its_file
from ..files.store import ordinary
from ..linalg.canonical import signs
from ..mesh import UNITS
from ..mesh.raw import Damaged
from ..mesh.unv import UNIVERSAL, DataSet, data_sets, placed
from ..modal.sampling import at_points
from ..reduced.coordinates import in_modes
from ..reduced.correlation import DIRECTIONS, POINT

NORMAL = 2
_KINDS = (NORMAL, 3, 7)
"""Analysis types of a data set 55 that are modes: normal, complex of first and of second order."""
_MOVEMENTS = {8: 0, 11: 1, 12: 2}
"""Specific data type of a data set 55, type of data of a response -> how often the displacement is differentiated in
time."""
_REAL = 1e-5
"""Imaginary over real part below which a shape counts as real: the format prints six digits."""


@dataclass(frozen=True)
class _Mode:
    """omega: rad/s. damping: ratio. mass: modal mass, kg, complex if the shape is; 0 where it is not told."""

    omega: float
    damping: float
    mass: complex
    nodes: Indices
    shape: Array


_SHAPES = {55: 5, 2414: 8}
"""Data set of results at nodes -> line with their kind: analysis second, result fourth."""


def holds_modes(path: Path | str) -> bool:
    """Whether a file has mode shapes in the way of Universal Files."""
    return _holds(Path(path), lambda kind, lines: kind in _SHAPES and _analysis(kind, lines) in _KINDS)


def holds_results(path: Path | str) -> bool:
    """Whether a file has modes, other results at nodes or measured functions in the way of Universal Files."""
    return _holds(Path(path), lambda kind, _: kind in (58, *_SHAPES))


def _holds(path: Path, wanted: Callable[[int, list[str]], bool]) -> bool:
    with suppress(OSError, Damaged):
        sets = data_sets(path.read_bytes().decode("latin-1"))
        return any(wanted(data.number, data.lines) for data in sets)
    return False


def _analysis(kind: int, lines: list[str]) -> int:
    """The analysis type of displacements at nodes; 0 of damaged ones, other results, or elsewhere."""
    with suppress(IndexError, ValueError):
        words = lines[_SHAPES[kind]].split()
        if kind == 55 or int(lines[2]) == 1 and int(words[3]) in _MOVEMENTS:
            return int(words[1])
    return 0


@in_its_file
def read_measured(path: Path | str, unit: str = "m", name: str = "") -> tuple[ModalBasis, tuple[str, ...]]:
    """A measured body, and what its reader should be told.

    Args:
        path: a Universal File. unit: of its lengths, if it has no data set 164. name: of the body; the file's if empty.

    Raises:
        UserError: no points, no modes, modes at points that have no place or at other points than the first mode.
    """
    path = Path(path)
    sets = _sets(path)
    length, force, told = _units(sets, unit)
    shapes = [s for s in sets if s["type"] == 55 and s.get("analysis_type") in _KINDS]
    moving = [s for s in shapes if s.get("spec_data_type") in _MOVEMENTS]
    shapes = moving or shapes  # stresses of the same modes may stand beside them
    elastic = [s for s in shapes if _eigenvalue(s, int(s["analysis_type"]))[0] != 0]
    modes = [_mode(s, length, force) for s in elastic]
    if len(elastic) < len(shapes):
        told.append(f"{len(shapes) - len(elastic)} shapes of 0 Hz are left out")
    others = sum(s["type"] == 58 or s["type"] == 55 and s.get("analysis_type") not in _KINDS for s in sets)
    if not modes:
        found = f"{others} measured functions and no" if others else "no"
        raise UserError(
            f"holds {found} mode shapes (data sets 55, 2414); identify modes in the test program first"
            + ", or lay the functions beside a computed body: microslip compare basis.h5 FILE" * (others > 0)
        )
    number, place = _points(sets)
    modes.sort(key=lambda m: m.omega)
    used = modes[0].nodes
    for i, m in enumerate(modes):
        if not np.array_equal(m.nodes, used):
            hertz = m.omega / (2 * np.pi)
            raise UserError(f"mode {i + 1} ({hertz:.6g} Hz) is at other points than the first one")
    points = _places(number, place, used, "the modes") / length
    phi, scaled = _shapes(modes)
    told.append(
        "shapes are scaled by their modal masses"
        if scaled
        else "no modal masses: shapes are scaled to a largest displacement of 1, forces on them mean nothing"
    )
    basis = _basis(name or path.stem, points, used, modes, phi, scaled)
    if others:
        functions = [s for s in sets if s["type"] == 58] if scaled else []
        told += fit_messages(fits(functions, basis.groups[0, 0], used, length / force), others)
    return basis, tuple(told)


def opened(files: Sequence[Path], key: tuple[int, int], unit: str) -> tuple[list[ModalBasis], list[str]]:
    """Two modal files, or one and what to say of the measured functions that the other file holds alone.

    Args:
        files: modal files and Universal Files. key, unit: see `against_functions`.

    Raises:
        UserError: functions without a computed body, unreadable files.
    """
    bodies, functions, told = list[ModalBasis](), list[Path](), list[str]()
    for file in files:
        if file.suffix.lower() not in UNIVERSAL:
            bodies.append(read_basis(file))
        elif holds_results(file) and not holds_modes(file):
            functions.append(file)
        else:
            body, said = read_measured(file, unit)
            bodies.append(body)
            told += said
    for file in functions:
        if [body.source for body in bodies] in ([], ["measured"]):
            raise UserError("holds no mode shapes: give a computed modal file beside it", file=file)
        told += against_functions(file, bodies[0], key, unit)
    return bodies, told


@in_its_file
def against_functions(path: Path, basis: ModalBasis, key: tuple[int, int] = (0, 0), unit: str = "m") -> list[str]:
    """How well the modes of a computed body give the measured functions of a file (data set 58), in words.

    Args:
        key: speed (counted from 0) and nodal diameter of the body. unit: of the file's lengths if it does not tell.

    Raises:
        UserError: no functions, points without a place or outside the body.
    """
    sets = _sets(path)
    length, force, told = _units(sets, unit)
    functions = [s for s in sets if s["type"] == 58]
    if not functions:
        raise UserError("holds no functions (data set 58) and no mode shapes (55, 2414): nothing to compare")
    named = {int(s[end]) for s in functions for end in ("rsp_node", "ref_node") if int(s.get(end) or 0) > 0}
    used = np.array(sorted(named), dtype=np.int64)
    seen = at_points(basis, _places(*_points(sets), used, "the functions") / length)
    if key not in seen.groups:
        raise UserError(f"'{basis.name}' has no speed {key[0]} with nodal diameter {key[1]}")
    found = fits(functions, in_modes(seen.groups[key]), used, length / force)
    return [*told, *fit_messages(found, len(functions))]


def _places(number: Indices, place: Array, used: Indices, what: str) -> Array:
    """(u, 3) places of some of the points."""
    position = {int(n): i for i, n in enumerate(number)}
    lost = [int(n) for n in used if int(n) not in position]
    if lost:
        raise UserError(f"point {lost[0]} of {what} has no place (data set 15 or 2411)")
    return place[[position[int(n)] for n in used]]


def _sets(path: Path) -> list[dict[str, Any]]:
    """The data sets that are understood.

    Raises:
        UserError: no Universal File, or damaged.
    """
    import pyuff

    if not ordinary(path).is_file():
        raise UserError("there is no such file; correct the path")
    wanted = (15, 2411, 55, 58, 164, 2420)
    text = path.read_bytes().decode("latin-1")
    try:
        file = pyuff.UFF(str(path))
        kinds = [int(k) for k in file.get_set_types()]
        if not kinds:
            raise ValueError("it has no data sets")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            sets = [file.read_sets(i) | {"type": k} for i, k in enumerate(kinds) if k in wanted]
    except Exception as error:  # pyuff raises whatever its parsing meets
        raise UserError(
            f"cannot be read as a Universal File ({type(error).__name__}: {_short(error)}); export it again"
        ) from error
    return [*sets, *(_solved(path, data) for data in data_sets(text) if data.number == 2414)]


def _solved(path: Path, data: DataSet) -> dict[str, Any]:
    """A data set 2414 (frequency and shape at nodes) by the names that pyuff gives a data set 55."""
    if _analysis(2414, data.lines) not in _KINDS:
        return {"type": 2414}
    with placed(path, data):
        data.at = 8
        _, kind, _, result, form, count = data.whole(6, "a mode")[:6]
        data.at = 11
        _, hertz, square, mass, viscous, hysteretic = data.reals(6, "a mode")
        real, imaginary, a, b, *_ = data.reals(6, "a mode")
        width, nodes, values = count * (1 + (form in (5, 6))), list[int](), list[list[float]]()
        while data.left:
            nodes += data.whole(1, "a mode")
            values.append(data.reals(width, f"the mode at node {nodes[-1]}"))
    shape = np.array(values).reshape(len(nodes), width)
    if width > count:
        shape = shape[:, ::2] + 1j * shape[:, 1::2]
    parts = dict(zip(("r1", "r2", "r3"), shape.T, strict=False))
    return parts | {
        "type": 55, "analysis_type": kind, "spec_data_type": result, "node_nums": nodes,
        "freq": hertz or np.sqrt(max(square, 0.0)) / (2 * np.pi), "modal_m": mass, "modal_damp_vis": viscous,
        "modal_damp_his": hysteretic, "eig": complex(real, imaginary), "modal_a": complex(a, b),
    }  # fmt: skip


def _short(error: BaseException) -> str:
    return " ".join(str(error).split())[:100]


def _units(sets: list[dict[str, Any]], unit: str) -> tuple[float, float, list[str]]:
    """What a length and a force of the file are divided by to be in m and N (data set 164)."""
    for s in sets:
        if s["type"] == 164 and _number(s, "length") > 0:
            length, force = _number(s, "length"), _number(s, "force") or 1.0
            return length, force, [f"the file's units (data set 164): {1 / length:g} m, {1 / force:g} N"]
    return 1 / UNITS[unit], 1.0, [f"lengths taken in {unit}: the file does not tell its units (data set 164)"]


def _number(table: dict[str, Any], key: str) -> float:
    try:
        value = float(np.real(table.get(key) or 0.0))
    except (TypeError, ValueError):
        return 0.0
    return value if np.isfinite(value) else 0.0


def _points(sets: list[dict[str, Any]]) -> tuple[Indices, Array]:
    """(p,) numbers and (p, 3) places of all points, in the file's unit."""
    if any(s["type"] == 2420 and not _aligned(s) for s in sets):
        raise UserError("has local coordinate systems (data set 2420); export it in the global one")
    found = [s for s in sets if s["type"] in (15, 2411)]
    if not found:
        raise UserError("holds no points (data set 15 or 2411); export the geometry too")
    try:
        number = np.concatenate([np.atleast_1d(s["node_nums"]) for s in found]).astype(np.int64)
        place = np.concatenate([np.column_stack([np.atleast_1d(s[c]) for c in "xyz"]) for s in found]).astype(float)
    except (KeyError, ValueError, TypeError) as error:
        raise UserError(f"its points cannot be read ({_short(error)}); export it again") from error
    if len(number) != len(place) or not np.isfinite(place).all() or len(np.unique(number)) != len(number):
        raise UserError("its points are incomplete or numbered twice; export it again")
    return number, place


def _aligned(s: dict[str, Any]) -> bool:
    """Whether every coordinate system is the global one."""
    matrices = np.asarray(s.get("CS_matrices", s.get("cs_matrices", ())), dtype=float).reshape(-1, 4, 3)
    return all(np.allclose(m, np.vstack([np.eye(3), np.zeros(3)]), atol=1e-9) for m in matrices)


def _mode(s: dict[str, Any], length: float, force: float) -> _Mode:
    """One data set 55; velocities and accelerations become displacements."""
    kind, moved = int(s["analysis_type"]), s.get("spec_data_type")
    if moved not in _MOVEMENTS:
        raise UserError(
            f"a mode shape (data set 55) has the specific data type {moved}; displacements, velocities and "
            "accelerations (8, 11, 12) are read"
        )
    try:
        nodes = np.atleast_1d(s["node_nums"]).astype(np.int64)
        raw = np.column_stack([np.atleast_1d(s[f"r{i}"]) for i in (1, 2, 3)])
    except (KeyError, ValueError, TypeError) as error:
        raise UserError(f"a mode shape (data set 55) cannot be read ({_short(error)})") from error
    omega, damping, mass = _eigenvalue(s, kind)
    if not omega > 0 or not np.isfinite(raw).all() or len(np.unique(nodes)) != len(nodes):
        raise UserError("a mode shape (data set 55) has no frequency, or points twice or without numbers")
    order = np.argsort(nodes)
    shape = raw[order] / (length * (1j * omega) ** _MOVEMENTS[moved])
    return _Mode(omega, damping, mass * length / force, nodes[order], shape)


def _eigenvalue(s: dict[str, Any], kind: int) -> tuple[float, float, complex]:
    """Angular frequency, damping ratio and modal mass (0 if unknown).

    Of a complex mode the modal a is phi^T (2 lambda M + C) phi = 2 i omega_d times the modal mass of light damping.
    """
    if kind == NORMAL:
        vis, his = _number(s, "modal_damp_vis"), _number(s, "modal_damp_his")
        return 2 * np.pi * _number(s, "freq"), vis or 0.5 * his, _number(s, "modal_m")
    root = complex(s.get("eig") or 0.0)
    omega = abs(root)
    damped = abs(root.imag)
    a = complex(s.get("modal_a") or 0.0)
    return omega, -root.real / omega if omega else 0.0, a / (2j * damped) if damped else 0.0


def _shapes(modes: Sequence[_Mode]) -> tuple[Array, bool]:
    """(n, 3, m) shapes as real as they can be, the largest component positive, and whether masses scale them."""
    phi = np.stack([m.shape.astype(complex) for m in modes], axis=2)
    mass = np.array([m.mass for m in modes])
    scaled = bool((np.abs(mass) > 0).all())
    phi = phi / np.sqrt(np.where(np.abs(mass) > 0, mass, 1.0)) if scaled else phi / np.abs(phi).max(axis=(0, 1))
    flat = phi.reshape(-1, len(modes))
    flat = flat * np.exp(-0.5j * np.angle((flat**2).sum(axis=0)))  # largest real part
    if np.abs(flat.imag).max() < _REAL * np.abs(flat).max():
        flat = flat.real
    return (flat * signs(flat)).reshape(phi.shape), scaled


def _basis(name: str, points: Array, number: Indices, modes: Sequence[_Mode], phi: Array, scaled: bool) -> ModalBasis:
    m, n = len(modes), len(points)
    omega, D = np.array([x.omega for x in modes]), np.array([x.damping for x in modes])
    reads = {}
    for i in range(n):
        known = [c for c in range(3) if np.abs(phi[i, c]).max() > 0]
        if known:
            labels = tuple(DIRECTIONS[c] for c in known)
            reads[f"{POINT}{number[i]}"] = Rows(phi[i, known], labels, "m", points[i], 0.0, np.zeros(len(known)))
    none = np.zeros((0, 0))
    group = ModalGroup(
        0.0, omega, ("normal",) * m, D, np.eye(m), np.diag(omega**2), np.diag(2 * D * omega), np.zeros((m, m)), phi,
        {}, {}, reads, {}, Compliance((), none, none, False, none), {}, np.zeros((n, 3)), {},
    )  # fmt: skip
    return ModalBasis(
        name, Mesh(points, {}, {}, {}, number), {(0, 0): group}, 0.0, np.zeros(3), np.zeros((3, 3)),
        np.array([0.0, 1.0, 0.0]), np.zeros(3), "measured", False, "measured modes",
        {"scaling": "modal mass" if scaled else "largest displacement 1"}, source="measured",
    )  # fmt: skip


# measured frequency responses (data set 58) beside the modes: do these give them back? --------------------------------

_RESPONSE, _FREQUENCY, _FORCE = 4, 18, 13
"""Function type of a frequency response, types of data: frequency, excitation force."""
_BAND = 0.05
"""How far a function is looked at beyond the first and the last mode, in parts of their frequencies."""
_LEAST = 8
"""Lines in that band, at least."""
_LEVEL = 3.0
"""Factor between measured and superposed level that no test explains, but a unit or a modal mass does."""


@dataclass(frozen=True)
class ResponseFit:
    """One function against the modes. frac: 0 to 1. level: superposed over measured, root of the sums of squares."""

    label: str
    frac: float
    level: float


def fits(sets: list[dict[str, Any]], g: ModalGroup, number: Array, per_si: float) -> list[ResponseFit]:
    """Frequency responses that the modes can give.

    Args:
        sets: data sets 58. number: (n,) of the points of phi, which is scaled by modal masses.
        per_si: the file's receptance of 1 m/N.
    """
    place = {int(n): i for i, n in enumerate(number)}
    found = []
    for s in sets:
        if s.get("func_type") != _RESPONSE or s.get("abscissa_spec_data_type", _FREQUENCY) not in (0, _FREQUENCY):
            continue
        moved, force = s.get("ordinate_spec_data_type"), s.get("orddenom_spec_data_type")
        rows = [_row(g, place, s.get(f"{end}_node"), s.get(f"{end}_dir")) for end in ("rsp", "ref")]
        if moved not in _MOVEMENTS or force not in (0, _FORCE) or rows[0] is None or rows[1] is None:
            continue
        f, H = np.asarray(s.get("x"), dtype=float), np.asarray(s.get("data"), dtype=complex)
        fit = _fit(f, H / per_si, rows[0] * rows[1], g, _MOVEMENTS[moved])
        if fit is not None:
            found.append(ResponseFit(f"{_name(s, 'rsp')} due to {_name(s, 'ref')}", *fit))
    return found


def _name(s: dict[str, Any], end: str) -> str:
    return f"{int(s[f'{end}_node'])}{'xyz'[abs(int(s[f'{end}_dir'])) - 1]}"


def _row(g: ModalGroup, place: dict[int, int], node: Any, way: Any) -> Array | None:
    """(m,) shapes at one direction, None if it was not measured."""
    try:
        node, way = int(node), int(way)
    except (TypeError, ValueError):
        return None
    if node not in place or not 1 <= abs(way) <= 3:
        return None
    row: Array = np.sign(way) * g.phi[place[node], abs(way) - 1]
    return row if np.abs(row).max() > 0 else None


def _fit(f: Array, H: Array, residues: Array, g: ModalGroup, moved: int) -> tuple[float, float] | None:
    """FRAC and level of the superposition sum_j r_j (i Omega)^n / (omega_j^2 - Omega^2 + 2 i D_j omega_j Omega).

    Allemang 2003, Sound and Vibration 37(8), The modal assurance criterion - twenty years of use and abuse.
    """
    if f.ndim != 1 or f.shape != H.shape:
        return None
    band = (f >= (1 - _BAND) * g.frequency[0]) & (f <= (1 + _BAND) * g.frequency[-1]) & np.isfinite(H)
    if band.sum() < _LEAST:
        return None
    W, w = 2 * np.pi * f[band][:, None], g.omega
    S = (residues / (w**2 - W**2 + 2j * g.damping_ratio * w * W)).sum(axis=1) * (1j * W[:, 0]) ** moved
    M = H[band]
    a, b = float((np.abs(M) ** 2).sum()), float((np.abs(S) ** 2).sum())
    if not (0 < a < np.inf and 0 < b < np.inf):
        return None
    return float(abs(np.vdot(M, S)) ** 2 / (a * b)), float(np.sqrt(b / a))


def fit_messages(found: list[ResponseFit], count: int) -> list[str]:
    """What to say of them."""
    if not found:
        return [
            f"{count} measured functions (data sets 58, 55) are left aside: none is a frequency response between "
            "points of the modes, at their frequencies and with modal masses"
        ]
    worst = min(found, key=lambda x: x.frac)
    level = np.array([x.level for x in found])
    lines = [
        f"{len(found)} of {count} measured functions are frequency responses that the modes give back: FRAC "
        f"{worst.frac:.3f} ({worst.label}) to {max(x.frac for x in found):.3f}, levels {level.min():.3g} to "
        f"{level.max():.3g} times the measured ones"
    ]
    middle = float(np.median(level))
    if not 1 / _LEVEL < middle < _LEVEL:
        lines.append(
            f"warning: the modes respond {middle:.3g} times as strongly as was measured; modal masses and units "
            "(data set 164) do not belong to these functions"
        )
    return lines
