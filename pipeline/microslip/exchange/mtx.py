"""Matrix Market: a folder of text matrices that anything can read, with a README of its coordinates.

One folder a group, ``speed_0`` or ``speed_0_nd_3``: ``M_r.mtx``, ``K_r.mtx``, ``C_r.mtx``, ``G_r.mtx``, ``omega.mtx``,
``to_diagonal.mtx`` where the first are not diagonal, and the rows ``interface_<name>.mtx``, ``excitation_<name>.mtx``,
``monitor_<name>.mtx``. All digits of double precision are printed, so what is read back is the same bit for bit;
complex matrices are written as complex ones. ``coordinates.csv`` says what each coordinate is, ``README.txt`` the rest.
"""

from __future__ import annotations

import io
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

from ..data import Array, ModalBasis, ModalGroup
from ..errors import UserError
from ..files.store import refused
from ..reduced.coordinates import compliance_row
from ..units import rpm_text
from .choice import STATEMENT, Format
from .mat import field_names

MARK = "Reduced matrices in Matrix Market form, written by microslip"
"""First line of the README; a folder that begins so may be replaced."""


def write_mtx(basis: ModalBasis, path: Path | str) -> None:
    """Write a folder, complete or absent. Same basis, same bytes.

    Raises:
        UserError: the folder holds something else, no permission, no space.
    """
    with folder_complete_or_absent(Path(path), MARK) as folder:
        for (speed, harmonic), group in sorted(basis.groups.items()):
            inside = folder / (f"speed_{speed}" + (f"_nd_{harmonic}" if basis.sectors > 1 else ""))
            inside.mkdir()
            _write_group(group, inside)
        (folder / "README.txt").write_text(_readme(basis), encoding="utf-8")


@contextmanager
def folder_complete_or_absent(path: Path, mark: str) -> Iterator[Path]:
    """Yield a temporary folder beside `path`, renamed onto it at the end; an older one with the same mark makes way.

    Raises:
        UserError: something else stands there, or it cannot be written.
    """
    readme = path / "README.txt"
    ours = readme.is_file() and readme.read_text(encoding="utf-8", errors="replace").startswith(mark)
    if path.exists() and not ours and not (path.is_dir() and not any(path.iterdir())):
        raise UserError(f"{path}: is there already and is not an export of this kind; choose another name with -o")
    temporary: Path | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(dir=path.parent, prefix=f".{path.name}."))
        os.chmod(temporary, 0o755)
        yield temporary
        if path.exists():
            shutil.rmtree(path)
        os.replace(temporary, path)
        temporary = None
    except OSError as error:
        raise refused(path, error) from error
    finally:
        if temporary is not None:
            with suppress(OSError):
                shutil.rmtree(temporary)


def _write_group(g: ModalGroup, folder: Path) -> None:
    tables: dict[str, Array] = {"M_r": g.M_r, "K_r": g.K_r, "C_r": g.C_r, "G_r": g.G_r, "omega": g.omega[:, None]}
    if g.N_r is not None:
        tables["N_r"] = g.N_r
    if g.to_diagonal is not None:
        tables["to_diagonal"] = g.to_diagonal
    for kind, named in (
        ("interface", {n: np.vstack([i.rows, *_more(i.characteristic)]) for n, i in g.interfaces.items()}),
        ("excitation", {n: r.rows for n, r in g.excitations.items()}),
        ("monitor", {n: r.rows for n, r in g.monitors.items()}),
    ):
        tables |= {f"{kind}_{field}": rows for field, rows in zip(field_names(named), named.values(), strict=True)}
    for name, table in tables.items():
        (folder / f"{name}.mtx").write_text(matrix_market(np.asarray(table)), encoding="ascii")
    (folder / "coordinates.csv").write_text(_coordinates(g), encoding="utf-8")


def _more(rows: Array) -> list[Array]:
    return [rows] if len(rows) else []


def matrix_market(table: Array) -> str:
    """A full matrix in array form, with the 17 digits that give every double back."""
    from scipy.io import mmwrite

    text = io.BytesIO()
    mmwrite(text, table, precision=17, symmetry="general")
    return text.getvalue().decode("ascii")


def _coordinates(g: ModalGroup) -> str:
    names = interface_coordinates(g)
    lines = ["number,kind,meaning"]
    lines += [f"{j + 1},{kind},{names.get(j, '')}" for j, kind in enumerate(g.kind)]
    return "\n".join(lines) + "\n"


def interface_coordinates(g: ModalGroup) -> dict[int, str]:
    """Coordinate (counted from 0) -> ``interface:row``, for coordinates that are the displacement of an interface.

    They stand in the order of the compliance's labels; a file whose rows say otherwise has none.
    """
    columns = [j for j, kind in enumerate(g.kind) if kind in ("interface", "massless-interface")]
    labels = [text.removeprefix("interface:") for text in g.compliance.labels if text.startswith("interface:")]
    if len(columns) != len(labels):
        return {}
    rows = np.array([compliance_row(g, f"interface:{text}") for text in labels]).reshape(-1, g.n_modes)
    wanted = np.eye(g.n_modes)[columns]
    unlike = np.abs(rows - wanted).max(initial=0.0)  # rounding of the constraint, in units of the row
    return dict(zip(columns, labels, strict=True)) if unlike < 1e-6 else {}


def _readme(basis: ModalBasis) -> str:
    groups = [
        f"  speed_{s}{f'_nd_{k}' if basis.sectors > 1 else ''}: {rpm_text(g.speed)}"
        + (f", nodal diameter {k} of {basis.sectors} sectors" if basis.sectors > 1 else "")
        + (", complex" if np.iscomplexobj(g.K_r) or np.iscomplexobj(g.phi) else "")
        for (s, k), g in sorted(basis.groups.items())
    ]
    return f"""{MARK}

Body {" ".join(basis.name.split())}, reduction {basis.reduction}.
{STATEMENT}. Time factor exp(+i omega t).

M_r q'' + (C_r + G_r) q' + (K_r + N_r) q = T^H f, displacements u = T q, with T the rows in interface_*, excitation_*
and monitor_* (T^H: conjugate transpose, T^T where everything is real); N_r is zero where it has no file. Eigenmodes are
scaled to phi^H M phi = 1.
coordinates.csv: what each coordinate is, in the order of rows and columns of the matrices.
interface_*: rows u_n u_t1 u_t2 phi_n phi_t1 phi_t2 (then characteristic ones), in the frame of the interface, whose
axes n (outwards), t1, t2 stand in the modal file. omega: rad/s, with nothing on the interfaces.
to_diagonal: V with V^H M_r V = 1 and V^H K_r V = diag(omega^2), where the matrices are not diagonal themselves.

Check: the eigenvalues of V^H K_r V (or of K_r) are omega^2.

Folders:
{chr(10).join(groups)}
"""


FORMATS = (Format("mtx", "_mtx", "anything: Matrix Market, a folder", write_mtx),)
