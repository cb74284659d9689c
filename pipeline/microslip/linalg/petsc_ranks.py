"""What every rank of `petsc.Petsc` runs, under ``mpiexec``, in a Python that has petsc4py and not this package.

Rank 0 reads a line a task, ``factorise`` or ``solve COLUMNS``; matrices and vectors are files of the folder that stands
in the command line. The answer to a task is one line: ``ok``, of a factorisation with the numbers of negative and of
zero pivots, or ``error`` with MUMPS's INFOG(1) and INFOG(2).
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np
import petsc4py

petsc4py.init(["microslip"])
from petsc4py import PETSc  # noqa: E402

folder = Path(sys.argv[1])
comm = PETSc.COMM_WORLD
# A task travels from rank 0 as one number, in a vector that lies there whole: columns, 0 to factorise, -1 to end.
task = PETSc.Vec().createMPI((1 if comm.rank == 0 else 0, 1), comm=comm)
to_all, everywhere = PETSc.Scatter.toAll(task)
ksp = PETSc.KSP().create(comm)


def factorise() -> str:
    # Anew each time: PETSc takes a matrix that was loaded again for the one that it has factorised already.
    A = PETSc.Mat().create(comm)
    A.setType("sbaij")
    viewer = PETSc.Viewer().createBinary(str(folder / "matrix"), "r", comm=comm)
    A.load(viewer)
    viewer.destroy()
    ksp.reset()
    ksp.setOperators(A)
    ksp.setType("preonly")
    pc = ksp.getPC()
    pc.setType("cholesky")  # L D L^T
    pc.setFactorSolverType("mumps")
    pc.setFactorSetUpSolverType()
    F = pc.getFactorMatrix()
    # 13: the last front on one rank and 24: null pivots are noticed, without which there is no inertia;
    # 14: half as much memory again as was estimated, for pivots that are put off
    for control, value in ((13, 1), (24, 1), (14, 50)):
        F.setMumpsIcntl(control, value)
    ksp.setUp()
    if F.getMumpsInfog(1) < 0:
        return f"error {F.getMumpsInfog(1)} {F.getMumpsInfog(2)}"
    negative, zero, _ = F.getInertia()
    return f"ok {negative} {zero}"


def solve(columns: int) -> str:
    A, _ = ksp.getOperators()
    first, last = A.getOwnershipRange()
    size = (A.getSize()[0], columns)
    B = PETSc.Mat().createDense(((last - first, size[0]), (PETSc.DECIDE, columns)), comm=comm)
    B.setUp()
    B.getDenseArray()[:] = np.memmap(folder / "right", float, "r", shape=size, order="F")[first:last]
    B.assemble()
    X = B.duplicate()
    ksp.getPC().getFactorMatrix().matSolve(B, X)
    out = np.memmap(folder / "solution", float, "r+", shape=size, order="F")
    out[first:last] = X.getDenseArray()
    out.flush()
    for matrix in (B, X):
        matrix.destroy()
    comm.barrier()
    return "ok"


while True:
    if comm.rank == 0:
        words = sys.stdin.readline().split()
        task.array[:] = -1 if not words else int(words[1]) if words[0] == "solve" else 0
    to_all.scatter(task, everywhere)
    columns = int(everywhere.array[0])
    if columns < 0:  # asked to, or the process that asked is gone
        if comm.rank == 0:
            shutil.rmtree(folder, ignore_errors=True)
        break
    answer = solve(columns) if columns else factorise()
    if comm.rank == 0:
        print(answer, flush=True)
