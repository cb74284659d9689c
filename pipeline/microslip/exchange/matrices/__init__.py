"""A body that another program has assembled: its matrices, the meaning of their rows, the positions of its nodes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from ...data import Array, Indices, Matrices, MatrixTerm, Mesh
from ...errors import UserError, in_its_file, of_file
from ...files.store import ordinary
from ...units import SYSTEMS, usual_system
from . import calculix, hdf5, market, matlab, nastran, numpy_archive
from .found import StoredMatrix, Unreadable, pick
from .nodes import read_dofs, read_nodes

if TYPE_CHECKING:
    from ...settings.body import MatrixFiles
    from ...settings.body import MatrixTerm as TermSettings

READERS: dict[str, ModuleType] = {
    ".mtx": market, ".mm": market, ".mat": matlab, ".h5": hdf5, ".hdf5": hdf5, ".op4": nastran, ".pch": nastran,
    ".bdf": nastran, ".dat": nastran, ".nas": nastran, ".dmig": nastran, ".sti": calculix, ".mas": calculix,
    ".npz": numpy_archive,
}  # fmt: skip
"""Suffix -> module with `names(path)` and `read(path, name)`."""

USUAL = {
    "stiffness": ("K", "KAA", "KAAX", "KXX", "KGG", "K2GG", "STIFFNESS", "K_R"),
    "mass": ("M", "MAA", "MAAX", "MXX", "MGG", "M2GG", "MASS", "M_R"),
    "damping": ("C", "B", "BAA", "BAAX", "BXX", "BGG", "B2GG", "DAMPING", "C_R"),
    "gyroscopic": ("G", "GYRO", "GYROSCOPIC", "GAAX", "G_R"),
    "circulatory": ("N", "KR", "CIRCULATORY", "NAAX", "N_R"),
}
"""What programs call a matrix."""

_SYMMETRY = 1e-8
"""Largest difference from symmetry, over the largest entry, that can be the rounding of printed numbers."""


def split(reference: str) -> tuple[str, str]:
    """File and name of ``FILE#NAME``."""
    file, _, name = reference.partition("#")
    return file, name


def files_of(given: MatrixFiles, terms: Sequence[TermSettings] = ()) -> list[str]:
    """Every file a body's matrices are read from."""
    said = (*(getattr(given, role) for role in USUAL), given.dofs, given.nodes, *(term.matrix for term in terms))
    found = [split(text)[0] for text in said if text]
    return sorted({*found, *(str(Path(f).with_suffix(".dof")) for f in found if Path(f).suffix in (".sti", ".mas"))})


def read_matrices(
    given: MatrixFiles, folder: Path, length_unit: str, terms: Sequence[TermSettings] = ()
) -> Matrices:  # fmt: skip
    """Read and check a body's matrices, in SI.

    Args:
        given: the table of body.toml. folder: its paths start here. length_unit: of positions. terms: matrices that
            scale with a parameter.

    Raises:
        UserError: with the file at fault.
    """
    references = {role: reference for role in USUAL if (reference := getattr(given, role)) is not None}
    found = {role: _read(folder, reference, role) for role, reference in references.items()}
    mesh = _nodes(folder, given, length_unit)
    dofs, where = _dofs(folder, given, found, mesh)
    rows, loose = found["stiffness"].matrix.shape[0], given.superelement or given.nodes is None
    node, component = _meaning(dofs, mesh, rows, loose, where)
    asked = [(role, references[role], item) for role, item in found.items()]
    asked += [(term.role, term.matrix, _read(folder, term.matrix, term.role)) for term in terms]
    checked = [_checked(item, role, reference, folder, rows, dofs) for role, reference, item in asked]
    with of_file(folder / split(given.mass)[0]):
        _check_mass(checked[list(found).index("mass")][0], dofs)
    system = _system(given, length_unit)
    in_si = [_in_si(matrix, role, system, component) for (role, *_), (matrix, _) in zip(asked, checked, strict=True)]
    own = dict(zip(found, in_si, strict=False))
    scaling = [
        MatrixTerm(term.role, matrix, term.name, term.power, term.factor, term.reference)
        for term, matrix in zip(terms, in_si[len(found) :], strict=True)
    ]
    return Matrices(
        own["stiffness"], own["mass"], own.get("damping"), own.get("gyroscopic"), mesh, node, component,
        given.grounded or given.nodes is None, tuple(message for _, message in checked if message),
        own.get("circulatory"), tuple(scaling),
    )  # fmt: skip


def _checked(
    item: StoredMatrix, role: str, reference: str, folder: Path, rows: int, dofs: Indices
) -> tuple[sp.csr_matrix, str]:  # fmt: skip
    """The matrix on the rows of all, as symmetric as its role says, and what is told of that."""
    path = folder / split(reference)[0]
    with of_file(path):
        matrix = _in_order(item, dofs) if item.dofs is not None else item.matrix
        if matrix.shape[0] != rows:
            raise UserError(
                f"the {role} matrix {split(reference)[1]} has {matrix.shape[0]} rows and the stiffness {rows}; "
                "give matrices of the same coordinates"
            )
        return (matrix, "") if role == "circulatory" else _symmetric(matrix, role, path.name)


def _system(given: MatrixFiles, length_unit: str) -> str:
    system = given.units or usual_system(length_unit)
    if system is None:
        raise UserError(
            f'geometry.matrices.units: with length_unit = "{length_unit}" it must be said; choose one of '
            + ", ".join(SYSTEMS)
        )
    return system


def matrix_names(path: Path) -> list[str]:
    """The matrices a file holds.

    Raises:
        UserError: unreadable.
    """
    reader = _reader(path)
    with _readable(path):
        return reader.names(path)


def own_nodes(path: Path) -> tuple[bool, bool]:
    """Whether a file of matrices holds its nodes as well, and rows without a node: a superelement of Nastran's."""
    if _reader(path) is not nastran or path.suffix.lower() == ".op4":
        return False, False
    try:
        nastran.grids(path)
        dofs = nastran.read(path, nastran.names(path)[0]).dofs
    except Unreadable:
        return False, False
    return True, dofs is not None and bool((dofs[:, 1] == 0).any())


@in_its_file
def _reader(path: Path) -> ModuleType:
    if path.suffix.lower() not in READERS:
        raise UserError(f"matrices are not read from a file '{path.suffix}'; use one of {', '.join(sorted(READERS))}")
    if not ordinary(path).is_file():
        raise UserError("there is no such file; correct the path")
    return READERS[path.suffix.lower()]


@contextmanager
def _readable(path: Path, what: str = "") -> Iterator[None]:
    """What cannot be read here is told with its file."""
    with of_file(path):
        try:
            yield
        except (Unreadable, OSError) as error:
            told = error if isinstance(error, Unreadable) else f"cannot be read ({getattr(error, 'strerror', error)})"
            raise UserError(f"{what}{told}; write it again") from error
        except MemoryError as error:
            raise UserError(f"{what or 'it '}needs more memory than there is; store it sparse") from error


@in_its_file
def _there(path: Path, key: str) -> Path:
    if not ordinary(path).is_file():
        raise UserError(f"there is no such file; correct geometry.matrices.{key}")
    return path


def _read(folder: Path, reference: str, role: str) -> StoredMatrix:
    file, name = split(reference)
    path = folder / file
    reader = _reader(path)
    with _readable(path, f"the {role} matrix: "):
        return reader.read(path, pick(reader.names(path), name, USUAL[role], path))


def _nodes(folder: Path, given: MatrixFiles, unit: str) -> Mesh:
    if given.nodes is None:
        return Mesh(np.zeros((0, 3)), {}, {}, {}, np.zeros(0, dtype=np.int64))
    file, name = split(given.nodes)
    path = _there(folder / file, "nodes")
    with _readable(path):
        mesh = read_nodes(path, name, unit)
    sets = dict(mesh.point_sets)
    position = {int(number): i for i, number in enumerate(mesh.node_id)}
    for key, numbers in given.sets.items():
        missing = [n for n in numbers if n not in position]
        if missing or not numbers:
            what = f"node {missing[0]} is not in {path.name}" if missing else "it names no node"
            raise UserError(f"geometry.matrices.sets.{key}: {what}; correct the list")
        sets[key] = np.unique([position[n] for n in numbers])
    return replace(mesh, point_sets=sets)


def _dofs(folder: Path, given: MatrixFiles, found: dict[str, StoredMatrix], mesh: Mesh) -> tuple[Indices, str]:
    """(k, 2) node number and component of the rows, and where that is said."""
    if given.nodes is None:
        return np.zeros((0, 2), dtype=np.int64), "nothing"
    if given.dofs is not None:
        path = _there(folder / given.dofs, "dofs")
        with _readable(path):
            return read_dofs(path), path.name
    if own := [f.dofs for f in found.values() if f.dofs is not None]:
        alike = all(np.array_equal(a, own[0]) for a in own)
        return own[0] if alike else np.unique(np.vstack(own), axis=0), "the matrices' file"
    rows, nodes = found["stiffness"].matrix.shape[0], len(mesh.points)
    for count in (3, 6):
        if rows == count * nodes:
            pairs = np.column_stack([np.repeat(mesh.node_id, count), np.tile(np.arange(1, count + 1), nodes)])
            return pairs, "the order of the nodes"
    raise UserError(
        f"geometry.matrices.dofs: the stiffness has {rows} rows and there are {nodes} nodes, neither three nor six a "
        "node; give a file with node and direction (1 to 6) of every row"
    )


def _meaning(dofs: Indices, mesh: Mesh, rows: int, superelement: bool, where: str) -> tuple[Indices, Indices]:
    """Point and component (0 to 5, -1 generalised) of every row."""
    if len(dofs) > rows:
        raise UserError(f"geometry.matrices.dofs: {where} names {len(dofs)} rows, the stiffness has {rows}")
    free = rows - len(dofs) + int((dofs[:, 1] == 0).sum())
    if free and not superelement:
        raise UserError(
            f"geometry.matrices.dofs: {where} gives no node to {free} of the {rows} rows; if they are the generalised "
            "coordinates of a superelement write superelement = true, else complete it"
        )
    whole = np.vstack([dofs, np.zeros((rows - len(dofs), 2), dtype=np.int64)])
    bad = (whole[:, 1] < 0) | (whole[:, 1] > 6)
    if bad.any():
        raise UserError(f"geometry.matrices.dofs: {where} has a direction {whole[bad][0, 1]}; directions are 1 to 6")
    physical = whole[:, 1] > 0
    pairs, count = np.unique(whole[physical], axis=0, return_counts=True)
    if (count > 1).any():
        n, c = pairs[count > 1][0]
        raise UserError(f"geometry.matrices.dofs: {where} names direction {c} of node {n} twice; correct it")
    if not physical.any():
        return np.full(rows, -1), np.full(rows, -1)
    order = np.argsort(mesh.node_id, kind="stable")
    at = np.minimum(np.searchsorted(mesh.node_id, whole[:, 0], sorter=order), len(order) - 1)
    missing = physical & (mesh.node_id[order[at]] != whole[:, 0])
    if missing.any():
        row = int(np.flatnonzero(missing)[0])
        raise UserError(
            f"geometry.matrices.nodes: row {row + 1} belongs to node {whole[row, 0]} ({where}), whose position is not "
            "given; complete the list of nodes"
        )
    return np.where(physical, order[at], -1), whole[:, 1] - 1


def _in_order(item: StoredMatrix, dofs: Indices) -> sp.csr_matrix:
    """A matrix with rows of its own on the rows of all."""
    assert item.dofs is not None
    if item.dofs.shape == dofs.shape and (item.dofs == dofs).all():
        return item.matrix
    place = {tuple(d): i for i, d in enumerate(dofs.tolist())}
    try:
        at = np.array([place[tuple(d)] for d in item.dofs.tolist()], dtype=np.int64)
    except KeyError as error:
        raise UserError(f"has a row of node {error.args[0][0]} that geometry.matrices.dofs lacks") from None
    entries = item.matrix.tocoo()
    return sp.coo_matrix((entries.data, (at[entries.row], at[entries.col])), shape=(len(dofs),) * 2).tocsr()


def _symmetric(matrix: sp.csr_matrix, role: str, name: str) -> tuple[sp.csr_matrix, str]:
    """The matrix made exactly (skew-)symmetric; a triangle alone is completed, which is told.

    Raises:
        UserError: it is not symmetric (skew, for the gyroscopic one).
    """
    sign = -1.0 if role == "gyroscopic" else 1.0
    lower, upper = (part(matrix, k, format="csr") for part, k in ((sp.tril, -1), (sp.triu, 1)))
    off = (matrix - sp.diags(matrix.diagonal())).tocsr()
    message = ""
    if off.nnz and (not _largest(lower)) != (not _largest(upper)):
        matrix = (matrix + sign * off.T).tocsr()
        message = f"{name}: only a triangle of the {role} matrix is stored; the other one was completed"
    top = _largest(matrix)
    if not top and role in ("stiffness", "mass"):
        raise UserError(f"the {role} matrix is zero; write it again")
    wrong = _largest(matrix - sign * matrix.T)
    if wrong > _SYMMETRY * top:
        kind = "skew-symmetric" if sign < 0 else "symmetric"
        way = ""
        if role == "stiffness":
            way = ", or give what is not symmetric (friction, follower forces) the role circulatory"
        raise UserError(
            f"the {role} matrix is not {kind} (entries differ by {wrong / top:.2g} of the largest); rows and "
            f"columns must be in the same order{way}"
        )
    return (0.5 * (matrix + sign * matrix.T)).tocsr(), message


def _largest(matrix: sp.csr_matrix) -> float:
    return float(np.abs(matrix.data).max(initial=0.0))


def _check_mass(mass: sp.csr_matrix, dofs: Indices) -> None:
    low = int(mass.diagonal().argmin())
    if mass.diagonal()[low] < 0:
        what = f" (node {dofs[low, 0]})" if low < len(dofs) else ""
        raise UserError(f"the mass of row {low + 1}{what} is negative; is it the mass matrix?")


def _in_si(matrix: sp.csr_matrix, role: str, system: str, component: Indices) -> sp.csr_matrix:
    """A matrix in SI: rotations stay radians, generalised coordinates keep their own scale."""
    length, mass, time = SYSTEMS[system]
    force = mass * length / time**2
    per_time = {"damping": time, "gyroscopic": time, "mass": time**2}.get(role, 1.0)
    # a row reads force (or moment, or generalised force = energy), a column displacement (or angle, or 1)
    size: Array = np.where((component >= 0) & (component < 3), 1.0, length)
    scale = sp.diags(size)
    return (scale @ matrix @ scale * (force / length * per_time)).tocsr()
