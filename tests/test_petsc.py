"""MUMPS on several ranks: the same spectra as in one process, and what is said where ranks are missing or gone."""

from __future__ import annotations

import os
import signal
import subprocess

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from meshes import body, brick, shaken
from test_eigen import CLAMPED, dense, pencil_of
from test_reduction import TIP

from microslip.errors import NotConverged, UserError
from microslip.linalg import eigen, petsc
from microslip.linalg.condensed import new_condensed
from microslip.modal.compute import modal_basis

try:
    petsc.interpreter()
    absent = ""
except UserError as error:
    absent = f"PETSc is not installed: {error}"
needed = pytest.mark.skipif(bool(absent), reason=absent)

A = np.diag([1.0, 2.0, 3.0, 4.0]) + 0.1
SINGULAR = np.kron(np.eye(2), np.ones((2, 2))) + 1e-300  # no entry is left out


def upper(matrix):
    return sp.csr_matrix(np.triu(matrix))


@needed
@pytest.mark.parametrize("ranks", [1, pytest.param(3, marks=pytest.mark.slow)])
def test_factors_inertia_and_solutions(ranks):
    """Several matrices one after the other, one and many right-hand sides; more ranks than some have rows."""
    solver = petsc.Petsc(ranks)
    b = np.random.default_rng(0).normal(size=(4, 7))
    for shift in (0.0, 2.5, 9.0):
        shifted = A - shift * np.eye(4)
        solver.factorise(upper(shifted))
        assert solver.negative() == (np.linalg.eigvalsh(shifted) < 0).sum()
        np.testing.assert_allclose(shifted @ solver.solve(b), b, atol=1e-14)
        np.testing.assert_allclose(shifted @ solver.solve(b[:, 2]), b[:, 2], atol=1e-14)
    with pytest.raises(NotConverged, match="singular matrix; the body is not held"):
        solver.factorise(upper(SINGULAR))
    solver.factorise(upper(A))  # after a refusal
    np.testing.assert_allclose(A @ solver.solve(b), b, atol=1e-14)
    folder = solver._folder
    assert folder.exists()
    solver.close()
    assert not folder.exists()


@needed
@pytest.mark.slow
def test_spectra_are_those_of_dense_algebra():
    pencil, _ = pencil_of(brick("tetra10", (3, 2, 2), (0.1, 0.07, 0.06), to=shaken(0.004)), body(**CLAMPED))
    pencil.solver = petsc.Petsc(2)
    exact = scipy.linalg.eigh(*dense(pencil), eigvals_only=True, subset_by_index=(0, 11))
    found = eigen.certify(pencil, eigen.search(pencil, 12))
    pencil.solver.close()
    assert found.certified and found.refound == 0 and found.backward_error.max() < 1e-14
    np.testing.assert_allclose(found.values, exact, rtol=1e-10)


@needed
@pytest.mark.slow
@pytest.mark.parametrize(
    "what",
    [
        {**CLAMPED, "rotation": {"speeds_rpm": [9000.0], "axis": [0.0, 1.0, 0.0], "prestress": "nonlinear"}},
        {"free": True},
        {**CLAMPED, "reduction": "craig-bampton", "interfaces": [TIP]},
    ],
    ids=["prestressed", "free", "attachment"],
)
def test_bases_are_those_of_one_process(what):
    mesh = brick("hexahedron20", (5, 2, 2), (0.4, 0.05, 0.05))
    one, ranks = (
        modal_basis(mesh, body(**what, modes={"count": 8, **solver})).groups[0, 0]
        for solver in ({}, {"solver": "petsc", "ranks": 2})
    )
    np.testing.assert_allclose(ranks.omega, one.omega, rtol=1e-9, atol=1e-3)
    assert ranks.checks["certified"] == 1


@needed
@pytest.mark.slow
def test_a_sector_is_condensed_as_in_one_process():
    """Interior on ranks: solutions of the whole matrix, forward and backward, and the Schur complement."""
    n, edge = 40, np.array([3, 17, 28])
    whole = sp.random_array((n, n), density=0.2, rng=np.random.default_rng(1))
    whole = (whole + whole.T + 6.0 * sp.eye_array(n)).tocsr()
    by = []
    for name in ("superlu", "petsc"):
        condensed = new_condensed(edge, name, 2)
        condensed.factorise(sp.csr_matrix(sp.triu(whole)))
        by.append(condensed.schur)
        condensed.close()
    np.testing.assert_allclose(by[1], by[0], rtol=1e-12, atol=1e-13)


@needed
@pytest.mark.slow
def test_a_rank_that_is_killed_is_told_and_leaves_nothing():
    solver = petsc.Petsc(2)
    solver.factorise(upper(A))
    folder = solver._folder
    ranks = subprocess.run(["pgrep", "-f", str(folder)], capture_output=True, text=True).stdout.split()
    assert len(ranks) >= 3  # mpiexec and two ranks
    os.kill(int(ranks[-1]), signal.SIGKILL)
    with pytest.raises(NotConverged, match="2 ranks of the sparse solver have ended before their answer; run it again"):
        for _ in range(100):
            solver.solve(np.ones(4))
    assert not folder.exists()
    assert not subprocess.run(["pgrep", "-f", str(folder)], capture_output=True, text=True).stdout.split()
    solver.factorise(upper(A))  # begins again
    np.testing.assert_allclose(A @ solver.solve(np.ones(4)), np.ones(4), atol=1e-14)
    solver.close()


def test_what_is_missing_is_told_with_what_to_install(monkeypatch):
    monkeypatch.setattr(petsc, "AT_DEBIAN", "/nowhere/*")
    monkeypatch.setattr(petsc, "find_spec", lambda name: None)
    petsc.interpreter.cache_clear()
    try:
        with pytest.raises(
            UserError, match=r"modes\.solver: petsc needs .*apt-get install python3-petsc4py"
        ):
            eigen.new_solver("petsc", 2)
    finally:
        petsc.interpreter.cache_clear()


@pytest.mark.parametrize("modes", [{"ranks": 0}, {"ranks": 1.5}, {"ranks": 2}, {"ranks": 2, "solver": "superlu"}])
def test_ranks_belong_to_this_solver(modes):
    with pytest.raises(ValueError, match="ranks"):
        body(modes=modes)
