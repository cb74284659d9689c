"""MATLAB 5 files (.mat) for MATLAB, Octave and the harmonic-balance programs written in them.

One struct per speed, ``speed_0`` ..., holds the reduced model under the names such programs use: with ``b = speed_0``
the system is ``b.M q'' + b.D q' + b.K q = b.Fex1 f``, and ``b.interfaces.<name>.T`` reads, its transpose loads, a
contact; the columns of ``b.W`` are all these force directions side by side, named in ``b.W_row``. Numbers are those of
the modal file, bit for bit; columns stay columns. A cyclic sector has one struct per nodal diameter, ``speed_0_nd_3``;
its arrays are complex where the file's are, and the conjugate transpose (``T'`` in MATLAB) loads.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..basis import CONVENTIONS, FORMAT, FORMAT_VERSION
from ..data import INTERFACE_ROWS, Array, Interface, ModalBasis, ModalGroup, Rows
from ..errors import UserError
from ..files.store import complete_or_absent
from .choice import STATEMENT, Format, node_numbers

_HEADER = b"MATLAB 5.0 MAT-file, modal basis written by microslip"
_KEYWORDS = set(
    "break case catch classdef continue else elseif end for function global if otherwise parfor persistent return spmd "
    "switch try while".split()
)


def write_mat(basis: ModalBasis, path: Path | str) -> None:
    """Write a basis as a MATLAB 5 file, complete or absent. Same basis, same bytes.

    Raises:
        UserError: no permission, no space, or an array beyond the format's 2 GiB.
    """
    from scipy.io import savemat
    from scipy.io.matlab import MatWriteError

    with complete_or_absent(path) as temporary:
        try:
            savemat(temporary, mat_tables(basis), appendmat=False, long_field_names=True, oned_as="column")
        except (MatWriteError, OverflowError) as error:
            raise UserError(f"{path}: the MATLAB 5 format cannot hold this basis ({error}); use fewer modes") from error
        clean_header(temporary)


def clean_header(path: Path) -> None:
    """Replace the text at the head of a MATLAB 5 file, which holds the time."""
    with open(path, "r+b") as file:
        file.write(_HEADER.ljust(116))


def mat_tables(basis: ModalBasis) -> dict[str, Any]:
    """What the file holds, as nested dictionaries of arrays."""
    tables: dict[str, Any] = {
        "format": f"{FORMAT} {FORMAT_VERSION}",
        "units": "SI: m, kg, s, N, rad, Pa",
        "readme": STATEMENT,
        "conventions": {key: text for key, text in CONVENTIONS.items() if key != "dimensions"},
        "name": basis.name,
        "reduction": basis.reduction,
        "damping_source": basis.damping_source,
        "free": float(basis.free),
        "cyclic": {"sectors": float(basis.sectors), "left": basis.cyclic_faces[0], "right": basis.cyclic_faces[1]},
        "mesh": _mesh(basis),
        "body": {"mass": basis.mass, "centre": _column(basis.centre), "inertia": basis.inertia},
        "rotation": {"direction": _column(basis.rotation_axis), "point": _column(basis.rotation_point)},
        "provenance": _struct(basis.provenance, str),
    }
    for (speed, harmonic), group in sorted(basis.groups.items()):
        tables[f"speed_{speed}" + (f"_nd_{harmonic}" if harmonic else "")] = _group(group)
    return tables


def words(texts: Iterable[str]) -> Array:
    """A column of cells of text."""
    return np.array(list(texts), dtype=object).reshape(-1, 1)


def _column(values: Array) -> Array:
    return np.asarray(values, dtype=float).reshape(-1, 1)


def _mesh(basis: ModalBasis) -> dict[str, Any]:
    mesh = basis.mesh
    groups = {name: mesh.face_points(name) for name in sorted({*mesh.faces, *mesh.point_sets})}
    return {
        "node": _column(node_numbers(basis)),
        "xyz": mesh.points,
        "cells": _struct(mesh.cells, lambda c: c.astype(float) + 1),
        "groups": _struct(groups, lambda chosen: _column(chosen) + 1),
    }


def _group(g: ModalGroup) -> dict[str, Any]:
    loads = [rows.rows for rows in g.excitations.values()]
    contacts = [i.rows for i in g.interfaces.values()]
    return {
        "Omega": g.speed,
        "harmonic": float(g.harmonic),
        "prestress": g.prestress,
        "M": g.M_r,
        "D": g.C_r,
        "C": g.C_r,
        "K": g.K_r,
        "G": g.G_r,
        **({} if g.N_r is None else {"N": g.N_r}),
        "Fex1": np.concatenate(loads).conj().T if loads else np.zeros((g.n_modes, 0)),
        "W": np.concatenate(contacts).conj().T if contacts else np.zeros((g.n_modes, 0)),
        "W_row": words(f"{n}:{r}" for n in g.interfaces for r in INTERFACE_ROWS),
        "omega": _column(g.omega),
        "frequency": _column(g.frequency),
        "damping_ratio": _column(g.damping_ratio),
        "kind": words(g.kind),
        "to_diagonal": np.eye(g.n_modes) if g.to_diagonal is None else g.to_diagonal,
        "phi": g.phi,
        "u_static": g.u_static,
        "interfaces": _struct(g.interfaces, _interface),
        "excitations": _struct(g.excitations, _rows),
        "monitors": _struct(g.monitors, _rows),
        "gauges": _struct(g.gauges, _rows),
        "compliance": {
            "row": words(g.compliance.labels),
            "static": g.compliance.static,
            "modal": g.compliance.modal,
            "plain": g.compliance.plain,
            "inertia_relief": float(g.compliance.inertia_relief),
        },
        "stress_nodes": _stress(g),
        "checks": _struct(g.checks, float),
        **_rotation(g),
    }


def _rotation(g: ModalGroup) -> dict[str, Any]:
    """What a change of the speed adds, and the modes with gyroscopic coupling, where the basis has them."""
    out: dict[str, Any] = {}
    if (r := g.run_up) is not None:
        out["run_up"] = {"N": r.N, "P": r.P, "euler": r.euler[:, None], "centrifugal": r.centrifugal[:, None]}
    if (y := g.gyroscopic) is not None:
        out["gyroscopic"] = {
            "omega": _column(y.omega), "shapes": y.shapes, "growth": _column(y.growth), "sense": _column(y.sense),
            "direction": words(y.direction), "error": _column(y.error),
        }  # fmt: skip
    return out


def _interface(item: Interface) -> dict[str, Any]:
    return {
        "role": item.role,
        "partner": item.partner,
        "sector_shift": float(item.sector_shift),
        "origin": _column(item.origin),
        "rotation": item.rotation,
        "T": item.rows,
        "fit_residual": _column(item.fit_residual),
        "characteristic": item.characteristic,
        "pattern": item.pattern,
        "points": item.points,
        "areas": _column(item.areas),
        "normals": item.normals,
        "shapes": item.shapes,
    }


def _rows(rows: Rows) -> dict[str, Any]:
    return {
        "T": rows.rows,
        "row": words(rows.labels),
        "unit": rows.unit,
        "point": _column(rows.point),
        "distance": rows.distance,
        "static": _column(rows.static),
    }


def _stress(g: ModalGroup) -> dict[str, Any]:
    """Strain and stress at the nodes, order of the components as in the conventions; empty if not computed."""
    s = g.stresses.get("nodes")
    if s is None:
        none = np.zeros((0, 6, g.n_modes))
        return {"strain": none, "stress": none, "static": np.zeros((0, 6))}
    return {"strain": s.strain, "stress": s.stress, "static": s.static_stress}


def _struct(items: Mapping[str, Any], convert: Any) -> dict[str, Any]:
    """A MATLAB struct; its field ``names`` holds the original names, one for each of the other fields in order."""
    fields = {field: convert(value) for field, value in zip(field_names(items), items.values(), strict=True)}
    return {"names": words(items), **fields}


def field_names(names: Iterable[str]) -> list[str]:
    """Names as MATLAB allows them (letters, digits, underscores, a letter first, 63 at most), each once."""
    out: list[str] = []
    for name in names:
        text = re.sub(r"[^A-Za-z0-9_]", "_", name)
        text = text if text[:1].isalpha() and text not in _KEYWORDS | {"names"} else f"x_{text}"
        text, number = text[:63], 1
        while text in out:
            number += 1
            text = f"{text[:58].removesuffix(f'_{number - 1}')}_{number}"
        out.append(text)
    return out


FORMATS = (Format("mat", ".mat", "MATLAB, Octave, NLvib", write_mat),)
