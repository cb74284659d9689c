"""Complex pressure fields of another program on a named load face: read, interpolated, made into rows of a component.

A field of one engine order stands for the pressure Re(p exp(i Omega t)) on the sector that the modal file holds; on
the next sectors it acts with the phase of its order. Real and imaginary part become a row each, because a row serves
waves of both directions and a complex one would be turned round with the wave.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from ..data import Array, ComplexArray, Interface, ModalGroup, Rows
from ..errors import UserError, in_its_file
from ..files.store import ordinary
from ..mesh import UNITS, point_data
from .assembly import Load
from .component import Component

COLUMNS = ("x", "y", "z", "p_real", "p_imag")

NEIGHBOURS = 12
"""Points of the field in the plane that is laid through them at each point of the face."""


@dataclass(frozen=True, eq=False)
class PressureField:
    """Attributes: points: (n, 3) m. pressure: (n,) complex 0-peak, Pa, positive pushes into the body. source: of it."""

    points: Array
    pressure: ComplexArray
    source: str = "pressure field"


@dataclass(frozen=True, eq=False)
class FacePressure:
    """A field on the quadrature points of a face.

    Attributes:
        pressure: (p,) Pa. force: (3,) resultant, N. distance: m, the largest from a point of the face to the field.
        error: root mean square of what changes where the pressure comes from half of the field's points, over that of
            the pressure: more than the error with all of them.
        source: of the field. face: name.
    """

    pressure: ComplexArray
    force: ComplexArray
    distance: float
    error: float
    source: str
    face: str

    def sentence(self) -> str:
        """What a reader should see before believing the load."""
        size = ", ".join(f"{abs(f):.4g}" for f in self.force)
        return (
            f"{self.source} on face '{self.face}': amplitudes of the whole force along x, y, z are {size} N; the "
            f"field's points are at most {self.distance:.3g} m from the face's; interpolated to better than "
            f"{100 * self.error:.2g} %."
        )


# --- reading ---------------------------------------------------------------------------------------------------------


@in_its_file
def read_field(path: Path | str, length_unit: str, conjugate: bool = False) -> PressureField:
    """A field from a file: .csv with a line of names (x, y, z, p_real, p_imag), .npz with arrays of these names, or any
    mesh that meshio reads (.vtu, .vtk) with point data p_real and p_imag.

    Args:
        length_unit: of x, y, z. conjugate: for programs with the time factor exp(-i Omega t).

    Raises:
        UserError: the file cannot be read, lacks something, or holds what is no number.
    """
    path = Path(path)
    if length_unit not in UNITS:
        raise UserError(f"'{length_unit}' is none of {', '.join(UNITS)}", "length_unit")
    if not ordinary(path).is_file():
        raise UserError("there is no such file of a pressure field; correct the name")
    readers = {".csv": _from_csv, ".npz": _from_npz}
    columns = readers.get(path.suffix.lower(), _from_mesh)(path)
    missing = [name for name in COLUMNS[:4] if name not in columns]
    if missing:
        raise UserError(f"has no {', '.join(missing)}; a pressure field needs {', '.join(COLUMNS)}")
    try:
        values = [np.asarray(columns[n], dtype=float).ravel() for n in COLUMNS if n in columns]
    except (TypeError, ValueError) as error:
        raise UserError(f"{error}; the columns must be real numbers") from error
    if len({len(v) for v in values}) > 1 or len(values[0]) < 3:
        raise UserError("needs three points or more, with as many values of each column")
    table = np.array(values)
    if not np.isfinite(table).all():
        row = int(np.flatnonzero(~np.isfinite(table).all(axis=0))[0]) + 1
        raise UserError(f"point {row} holds something that is no finite number; correct it")
    p = table[3] + 1j * (table[4] if len(table) > 4 else 0.0)
    return PressureField(table[:3].T * UNITS[length_unit], p.conj() if conjugate else p, str(path))


def _from_csv(path: Path) -> Mapping[str, object]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = [line for line in csv.reader(row for row in file if row.strip() and not row.startswith("#"))]
    except (UnicodeDecodeError, csv.Error) as error:
        raise UserError(f"is no text of comma-separated values ({error})") from error
    names = [name.strip() for name in lines[0]] if lines else []
    short = next((i for i, line in enumerate(lines[1:], 1) if len(line) != len(names)), None)
    if short is not None:
        raise UserError(f"point {short} has {len(lines[short])} values and the line of names {len(names)}")
    wanted = {name: i for i, name in enumerate(names) if name in COLUMNS}
    try:
        return {name: [float(line[i]) for line in lines[1:]] for name, i in wanted.items()}
    except ValueError as error:
        raise UserError(f"{error}; correct it") from error


def _from_npz(path: Path) -> Mapping[str, object]:
    try:
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in COLUMNS if name in file.files}
    except Exception as error:  # damaged archives raise a dozen kinds
        raise UserError(f"cannot be read as an .npz archive of plain arrays ({error})") from error


def _from_mesh(path: Path) -> Mapping[str, object]:
    if path.suffix.lower() not in (".vtu", ".vtk"):
        raise UserError(f"a pressure field is not read from '{path.suffix}'; use .csv, .npz, .vtu or .vtk")
    try:
        points, values = point_data(path)
    except ImportError as error:
        raise UserError("to read this kind of file install microslip[fem], or write .csv") from error
    return dict(zip("xyz", points.T, strict=True)) | {n: v for n, v in values.items() if n in COLUMNS}


# --- onto the face ---------------------------------------------------------------------------------------------------


def on_face(field: PressureField, face: Interface, name: str) -> FacePressure:
    """The field at the quadrature points of a face.

    At each of them a plane over the tangents is fitted to the field's points around, the nearer the heavier: exact for
    a linear pressure. Points off the tangent plane count as far away, so that a thin blade's other side does not mix
    in.

    Args:
        name: of the face, for messages.

    Raises:
        UserError: a face without points; a field that is not where the face is.
    """
    if not len(face.points):
        raise UserError(f"load face '{name}': the modal file holds no points of it; name the face in an excitation")
    distance = _distance(field, face, name)
    pressure = _fitted(field.points, field.pressure, face)
    rms = np.sqrt(face.areas @ np.abs(pressure) ** 2)
    order, error = np.random.default_rng(0).permutation(len(field.points)), 0.0
    for half in (order[::2], order[1::2]):
        change = _fitted(field.points[half], field.pressure[half], face) - pressure
        error = max(error, float(np.sqrt(face.areas @ np.abs(change) ** 2) / max(rms, 1e-300)))
    force = -(face.areas * pressure) @ face.normals
    return FacePressure(pressure, force, distance, error, field.source, name)


def _distance(field: PressureField, face: Interface, name: str) -> float:
    """Largest distance of a point of the face from the field, refused where it is large.

    Raises:
        UserError: with the unit that would fit, if one does.
    """
    allowed, distance = _allowed(field.points, face)
    if distance <= allowed:
        return distance
    factors = {unit: UNITS[unit] for unit in ("m", "cm", "mm", "in")}
    scales = {f"{a} instead of {b}": factors[a] / factors[b] for a in factors for b in factors if a != b}
    fitting = []
    for words, scale in scales.items():
        most, away = _allowed(field.points * scale, face)
        if away <= most:
            fitting.append(words)
    hint = f"; it would fit with length_unit {fitting[0]}" if fitting else ""
    raise UserError(
        f"{field.source}: the field does not cover face '{name}': a point of the face is {distance:.4g} m away from "
        f"the nearest point of the field, {allowed:.3g} m are allowed{hint}; correct length_unit, axes or face"
    )


def _allowed(points: Array, face: Interface) -> tuple[float, float]:
    """How far a point of the face may be from the field, twice the field's own spacing between 2 % and 25 % of the
    face's size, and how far the farthest one is."""
    size = float(np.linalg.norm(np.ptp(face.points, axis=0)))
    away, nearest = KDTree(points).query(face.points)
    around = np.unique(nearest)
    spacing = np.asarray(KDTree(points).query(points[around], k=2)[0])[:, 1]
    return float(np.clip(2 * np.median(spacing), 0.02 * size, 0.25 * size)), float(np.max(away))


def _fitted(points: Array, values: ComplexArray, face: Interface) -> ComplexArray:
    """(p,) values of (n,) ones at the points of a face, see `on_face`."""
    many = min(4 * NEIGHBOURS, len(points))
    near = np.asarray(KDTree(points).query(face.points, k=many)[1]).reshape(len(face.points), many)
    r = points[near] - face.points[:, None]
    along = np.einsum("pki,pi->pk", r, face.normals)
    far = np.sqrt(np.einsum("pki,pki->pk", r, r) + 8 * along**2)  # three times as far along the normal
    kept = np.argsort(far, axis=1, kind="stable")[:, : min(NEIGHBOURS, many)]
    r = np.take_along_axis(r, kept[..., None], axis=1)
    far, near = (np.take_along_axis(a, kept, axis=1) for a in (far, near))
    scale = np.median(far, axis=1, keepdims=True)
    weight = 1 / ((far / scale) ** 2 + 1e-6)
    t1, t2 = _tangents(face.normals)
    flat = np.stack([np.ones(r.shape[:2]), np.einsum("pki,pi->pk", r, t1), np.einsum("pki,pi->pk", r, t2)], axis=2)
    flat[:, :, 1:] /= scale[..., None]
    inverse = np.linalg.pinv(flat * weight[..., None], rcond=1e-6)
    return np.einsum("pk,pk->p", inverse[:, 0], weight * values[near])


def _tangents(normals: Array) -> tuple[Array, Array]:
    least = np.eye(3)[np.abs(normals).argmin(axis=1)]
    t1 = np.cross(normals, least)
    t1 /= np.linalg.norm(t1, axis=1, keepdims=True)
    return t1, np.cross(normals, t1)


# --- rows of a component ------------------------------------------------------------------------------------------


def with_pressure(component: Component, name: str, found: FacePressure) -> Component:
    """The component with rows ``name:real`` and ``name:imag`` of a pressure on one of its faces.

    Raises:
        UserError: no shapes of the face in the modal file.
    """
    return replace(
        component, groups={k: _with_rows(g, component.name, name, found) for k, g in component.groups.items()}
    )


def _with_rows(group: ModalGroup, component: str, name: str, found: FacePressure) -> ModalGroup:
    face = group.interfaces[found.face]
    if not len(face.shapes):
        raise UserError(
            f"{component}: the modal file holds no shapes of face '{found.face}' at nodal diameter {group.harmonic} "
            "(output.patch_shapes, output.shape_nodal_diameters), which a pressure field needs; write it with them"
        )
    centre = face.areas @ face.points / face.areas.sum()
    rows = {}
    for part, p in (("real", found.pressure.real), ("imag", found.pressure.imag)):
        row = -np.einsum("p,pi,pim->m", face.areas * p, face.normals, face.shapes)
        rows[f"{name}:{part}"] = Rows(row[None], ("pressure",), "1", centre)
    return replace(group, excitations={**group.excitations, **rows})


def field_loads(component: str, name: str, harmonic: int, factor: complex = 1.0) -> tuple[Load, ...]:
    """The two loads of a pressure field that `with_pressure` put into a component, times a factor; of one that is
    steady the real part alone, Re(p exp(0))."""
    real = Load(component, f"{name}:real", factor, harmonic)
    return (real, Load(component, f"{name}:imag", 1j * factor, harmonic)) if harmonic else (real,)


def load_face(component: Component, name: str) -> Interface:
    """A face of a component, by its name.

    Raises:
        UserError: there is none of that name.
    """
    faces = next(iter(component.groups.values())).interfaces
    if name not in faces:
        known = ", ".join(faces) or "none"
        raise UserError(
            f"{component.name}: the modal file has no face '{name}' with points; it has {known}; name it in an "
            'interface (role = "load") or in an excitation of body.toml'
        )
    return faces[name]
