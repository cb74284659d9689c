"""`microslip import`: a body.toml around another program's file that runs as it stands."""

from __future__ import annotations

import decks
import meshes
import numpy as np
import pytest
import scipy.io

from microslip.basis import read_basis
from microslip.cli import main
from microslip.fem.discretise import discretise
from microslip.fem.operators import isotropic, mass, stiffness


def beam():
    return meshes.brick("wedge15", (1, 1, 3), (0.01, 0.015, 0.04), to=meshes.shaken(0.0003))


def lowest(folder, name):
    return read_basis(folder / "build" / name / "basis.h5").groups[0, 0].omega


def exact():
    """Free modes of the beam, dense."""
    import scipy.linalg

    d = discretise(beam())
    K = d.pattern.full(stiffness(d, isotropic(2.1e11, 0.3))).toarray()
    M = np.kron(d.pattern.full(mass(d, 7850.0)).toarray(), np.eye(3))
    value, vector = np.linalg.eigh(M)  # nine points a wedge: M is not regular on so few cells
    keep = value > 1e-12 * value[-1]
    light, X = vector[:, ~keep], vector[:, keep] / np.sqrt(value[keep])
    X = X - light @ np.linalg.solve(light.T @ K @ light, light.T @ K @ X) if light.shape[1] else X
    return np.sqrt(np.maximum(scipy.linalg.eigvalsh(X.T @ K @ X), 0))[6:10]


def test_a_deck_runs_at_once_with_its_material(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    lines = [*decks.mesh_lines(beam(), sets=("z0",)), *decks.MATERIAL, decks.section()]
    (tmp_path / "my part.inp").write_text("\n".join(lines) + "\n")
    assert main(["import", "my part.inp"]) == 0
    assert "Steel: 7850 kg/m3" in capsys.readouterr().out
    text = (tmp_path / "my-part" / "body.toml").read_text()
    assert 'mesh = "../my part.inp"' in text and 'from = "mesh"' in text and "z0" in text
    assert main(["modes", "my-part", "-q", "--set", "modes.solver=superlu"]) == 0
    np.testing.assert_allclose(lowest(tmp_path, "my-part")[6:10], exact(), rtol=1e-9)
    assert main(["import", "my part.inp"]) == 2
    assert "nothing was changed" in capsys.readouterr().err


def test_a_deck_without_material_says_so(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "part.inp").write_text("\n".join(decks.mesh_lines(beam())) + "\n")
    assert main(["import", "part.inp", "here"]) == 0
    assert "no material was taken" in capsys.readouterr().out
    assert main(["modes", "here", "-q"]) == 0


@pytest.mark.parametrize("suffix", ["mtx", "mat"])
def test_matrices_run_at_once(tmp_path, monkeypatch, suffix):
    monkeypatch.chdir(tmp_path)
    d = discretise(beam())
    K = d.pattern.full(stiffness(d, isotropic(2.1e11, 0.3))) * 1e-3
    M = np.kron(d.pattern.full(mass(d, 7850.0)).toarray(), np.eye(3)) * 1e-3
    if suffix == "mat":
        scipy.io.savemat("model.mat", {"K": K, "M": M})
    else:
        scipy.io.mmwrite("model_K.mtx", K, precision=17)
        scipy.io.mmwrite("model_M.mtx", M, precision=17)
    rows = np.column_stack([beam().node_id, beam().points * 1e3])
    np.savetxt("nodes.csv", rows, "%d,%.17g,%.17g,%.17g")
    assert main(["import", "model.mat" if suffix == "mat" else "model_K.mtx", "part"]) == 0
    assert main(["modes", "part", "-q", "--set", "name=part"]) == 0
    np.testing.assert_allclose(lowest(tmp_path, "part")[6:10], exact(), rtol=1e-8)


@pytest.mark.parametrize(
    ("words", "text"),
    [(["no.inp"], "no such file"), (["K.mtx"], "no mass matrix is beside it"), (["K.mtx", "--unit", "yd"], "yd")],
)
def test_what_cannot_be_imported_is_refused(tmp_path, monkeypatch, capsys, words, text):
    monkeypatch.chdir(tmp_path)
    scipy.io.mmwrite("K.mtx", np.eye(3))
    assert main(["import", *words]) == 2
    assert text in capsys.readouterr().err
