"""MATLAB export: what is read back equals the basis to the last bit, names are legal, bytes repeat."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import small
from scipy.io import loadmat

from microslip.exchange import formats, writer
from microslip.exchange.mat import field_names, write_mat


def fields(struct: np.ndarray) -> dict[str, Any]:
    """A MATLAB struct as a dictionary."""
    return {name: struct[name][0, 0] for name in struct.dtype.names}


def text(value: np.ndarray) -> str:
    return str(value[0]) if value.size else ""


def texts(cell: np.ndarray) -> list[str]:
    return [text(entry[0]) for entry in cell]


def equal(a: np.ndarray, b: np.ndarray) -> bool:
    """Same numbers to the last bit; vectors are columns in MATLAB."""
    a, b = np.asarray(a), np.asarray(b)
    return np.array_equal(a, b.reshape(-1, 1) if b.ndim == 1 else b)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("mat") / "basis.mat"
    write_mat(small.basis((0.0, 3000.0)), path)
    return path


def test_reduced_model_comes_back_exactly(file: Path) -> None:
    read = loadmat(file)
    for (number, _), g in small.basis((0.0, 3000.0)).groups.items():
        s = fields(read[f"speed_{number}"])
        assert s["Omega"][0, 0] == g.speed
        assert text(s["prestress"]) == g.prestress
        for name, value in {
            "M": g.M_r, "D": g.C_r, "C": g.C_r, "K": g.K_r, "G": g.G_r, "omega": g.omega, "frequency": g.frequency,
            "damping_ratio": g.damping_ratio, "phi": g.phi, "u_static": g.u_static,
        }.items():  # fmt: skip
            assert equal(s[name], value), name
        assert texts(s["kind"]) == list(g.kind)
        expected = np.concatenate([rows.rows for rows in g.excitations.values()]).T
        assert equal(s["Fex1"], expected)


def test_interfaces_rows_compliance_and_stress_come_back_exactly(file: Path) -> None:
    g = small.basis((0.0, 3000.0)).groups[1, 0]
    s = fields(loadmat(file)["speed_1"])
    faces = fields(s["interfaces"])
    assert texts(faces["names"]) == list(g.interfaces)
    for field, item in zip(field_names(g.interfaces), g.interfaces.values(), strict=True):
        face = fields(faces[field])
        for name in ("origin", "rotation", "fit_residual", "points", "areas", "normals", "shapes"):
            assert equal(face[name], getattr(item, name)), name
        assert equal(face["T"], item.rows)
        assert (text(face["role"]), text(face["partner"])) == (item.role, item.partner)
        assert face["sector_shift"][0, 0] == item.sector_shift
    for kind, named in (("excitations", g.excitations), ("monitors", g.monitors), ("gauges", g.gauges)):
        group = fields(s[kind])
        for field, rows in zip(field_names(named), named.values(), strict=True):
            entry = fields(group[field])
            assert equal(entry["T"], rows.rows)
            assert equal(entry["point"], rows.point)
            assert equal(entry["static"], rows.static)
            assert texts(entry["row"]) == list(rows.labels)
            assert text(entry["unit"]) == rows.unit
    compliance = fields(s["compliance"])
    assert texts(compliance["row"]) == list(g.compliance.labels)
    assert equal(compliance["static"], g.compliance.static)
    assert equal(compliance["modal"], g.compliance.modal)
    assert equal(compliance["plain"], g.compliance.plain)
    nodes = fields(s["stress_nodes"])
    assert equal(nodes["stress"], g.stresses["nodes"].stress)
    assert equal(nodes["strain"], g.stresses["nodes"].strain)
    assert equal(nodes["static"], g.stresses["nodes"].static_stress)
    assert {k: v[0, 0] for k, v in fields(s["checks"]).items() if k != "names"} == dict(g.checks)


def test_mesh_and_body_come_back_exactly(file: Path) -> None:
    basis, read = small.basis((0.0, 3000.0)), loadmat(file)
    mesh, body = fields(read["mesh"]), fields(read["body"])
    assert equal(mesh["xyz"], basis.mesh.points)
    assert equal(mesh["node"], basis.mesh.node_id)
    assert equal(fields(mesh["cells"])["tetra10"] - 1, basis.mesh.cells["tetra10"])
    assert equal(fields(mesh["groups"])["clamp"] - 1, basis.mesh.face_points("clamp"))
    assert body["mass"][0, 0] == basis.mass
    assert equal(body["centre"], basis.centre)
    assert equal(body["inertia"], basis.inertia)


def test_same_basis_same_bytes_and_no_time_in_the_header(file: Path, tmp_path: Path) -> None:
    write_mat(small.basis((0.0, 3000.0)), tmp_path / "again.mat")
    data = (tmp_path / "again.mat").read_bytes()
    assert data == file.read_bytes()
    assert data[:10] == b"MATLAB 5.0" and b"Created on" not in data[:116]


def test_a_basis_without_rows_and_stresses(tmp_path: Path) -> None:
    from dataclasses import replace

    basis = small.basis()
    group = replace(basis.groups[0, 0], excitations={}, monitors={}, gauges={}, stresses={})
    write_mat(replace(basis, groups={(0, 0): group}), tmp_path / "a.mat")
    s = fields(loadmat(tmp_path / "a.mat")["speed_0"])
    assert s["Fex1"].shape == (6, 0)
    assert texts(fields(s["excitations"])["names"]) == []


def test_names_are_legal_and_unique() -> None:
    names = ["a", "a", "a-b", "a_b", "end", "1x", "", "ü", "x" * 80, "x" * 80, "x" * 81, "names", "_a"] + ["z"] * 12
    found = field_names(names)
    assert len(set(found)) == len(names)
    assert all(re.fullmatch(r"[A-Za-z]\w{0,62}", name) for name in found)
    assert "end" not in found and "names" not in found
    assert found[0] == "a"


def test_the_table_of_writers(tmp_path: Path) -> None:
    assert writer("mat") is write_mat
    assert set(formats()) >= {"mat", "vtu"}


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="Octave is not installed")
def test_octave_reads_it(file: Path) -> None:
    ask = f"load('{file}'); b = speed_1; r = b.K - diag(b.omega.^2);"
    ask += "printf('%g %s', max(abs(r(:))), b.interfaces.right.role)"
    done = subprocess.run(["octave-cli", "-q", "--eval", ask], capture_output=True, text=True, timeout=120)
    assert done.stdout == "0 right", done.stderr
