"""MUMPS on several ranks, through PETSc: factors that are too large or too slow for one process."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
import tempfile
import weakref
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from ..data import Array
from ..errors import NotConverged, UserError
from .direct import DirectSolver

AT_DEBIAN = "/usr/lib/petscdir/petsc*/*-real/lib/python3/dist-packages/petsc4py"
SINGULAR = "the sparse solver met a singular matrix; the body is not held"
OUT_OF_MEMORY = (-9, -13, -19, -20)
"""INFOG(1) of MUMPS's user guide: a work array too small, an allocation that failed."""


@cache
def interpreter() -> tuple[str, dict[str, str]]:
    """The Python that has petsc4py, and what its environment needs besides: this one, or Debian's.

    Raises:
        UserError: there is none, or no ``mpiexec``; with what to install.
    """
    if shutil.which("mpiexec"):
        if find_spec("petsc4py"):
            return sys.executable, {}
        if places := sorted(Path("/").glob(AT_DEBIAN[1:])):
            return "/usr/bin/python3", {"PYTHONPATH": str(places[-1].parent)}
    raise UserError(
        "petsc needs petsc4py and mpiexec, which are not here; apt-get install python3-petsc4py "
        "openmpi-bin (or petsc4py with MUMPS in this environment)",
        "modes.solver",
    )


class Petsc(DirectSolver):
    """MUMPS, L D L^T with pivoting and null pivots noticed, in processes of their own under ``mpiexec -n ranks``.

    The processes start with the first matrix and end with `close`, or with this one. Matrices and vectors pass through
    files below ``TMPDIR``, which hosts of one job must share; orders, a line each, through a pipe.
    """

    name = "petsc"

    def __init__(self, ranks: int = 1) -> None:
        self._python, self._environment = interpreter()
        self._ranks = ranks
        self._process: subprocess.Popen[str] | None = None
        self._folder = Path()
        self._size = self._negative = 0
        self._end: weakref.finalize | None = None

    def factorise(self, upper: sp.csr_matrix) -> None:
        self._size = upper.shape[0]
        if self._process is None:
            self._start()
        if upper.nnz >= 2**31:
            raise NotConverged("the matrix has more entries than PETSc's 32-bit numbers count; use a coarser mesh")
        with (self._folder / "matrix").open("wb") as file:  # PETSc's binary format, big-endian
            np.array([1211216, *upper.shape, upper.nnz], dtype=">i4").tofile(file)
            for part, kind in ((np.diff(upper.indptr), ">i4"), (upper.indices, ">i4"), (upper.data, ">f8")):
                part.astype(kind).tofile(file)
        self._negative, zero = self._ask("factorise")
        if zero:
            raise NotConverged(SINGULAR)

    def solve(self, b: Array) -> Array:
        flat = np.asfortranarray(b.reshape(self._size, -1), dtype=float)
        flat.T.tofile(self._folder / "right")
        with (self._folder / "solution").open("wb") as file:
            file.truncate(flat.nbytes)
        self._ask(f"solve {flat.shape[1]}")
        return np.fromfile(self._folder / "solution").reshape(flat.shape, order="F").reshape(b.shape)

    def negative(self) -> int:
        return self._negative

    def close(self) -> None:
        if self._end is not None:
            self._end()
        self._process = self._end = None

    def _start(self) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="microslip-petsc-"))
        # OpenMPI's words for what other launchers do unasked: more ranks than cores, root in a container,
        # and a rank that waits gives its core away
        mpi = {"ALLOW_RUN_AS_ROOT": "1", "ALLOW_RUN_AS_ROOT_CONFIRM": "1", "MCA_rmaps_base_oversubscribe": "1"}
        mpi |= {"MCA_mpi_yield_when_idle": "1", "MCA_hwloc_base_binding_policy": "none"}
        environment = {"OMP_NUM_THREADS": "1", **{f"OMPI_{key}": value for key, value in mpi.items()}}
        script = Path(__file__).with_name("petsc_ranks.py")
        words = (self._folder / "words").open("w+")
        self._process = subprocess.Popen(
            ["mpiexec", "-n", str(self._ranks), self._python, str(script), str(self._folder)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=words, text=True, start_new_session=True,
            env=os.environ | self._environment | environment,
        )  # fmt: skip
        words.close()
        self._end = weakref.finalize(self, _ended, self._process, self._folder)

    def _ask(self, task: str) -> tuple[int, int]:
        """Negative and zero pivots of a factorisation.

        Raises:
            NotConverged: no memory, or the ranks are gone.
        """
        assert self._process is not None and self._process.stdin is not None and self._process.stdout is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.write(f"{task}\n")
            self._process.stdin.flush()
        answer = self._process.stdout.readline().split()
        if not answer:
            lines = (self._folder / "words").read_text(errors="replace").strip().splitlines()
            lines = [line for line in lines if not line.startswith("---")] or ["nothing"]
            self.close()
            raise NotConverged(
                f"the {self._ranks} ranks of the sparse solver have ended before their answer; run it again, with more "
                f"memory or fewer ranks; their last words: {lines[-1].strip()[:200]}"
            )
        if answer[0] == "error":
            code, detail = int(answer[1]), answer[2]
            if code == -10:
                raise NotConverged(SINGULAR)
            cause = "ran out of memory; use more ranks on more machines, or a coarser mesh"
            if code not in OUT_OF_MEMORY:
                cause = "failed"
            raise NotConverged(f"the sparse solver MUMPS {cause} (INFOG(1) = {code}, INFOG(2) = {detail})")
        return (int(answer[1]), int(answer[2])) if len(answer) > 1 else (0, 0)


def _ended(process: subprocess.Popen[str], folder: Path) -> None:
    """The ranks are told to end, and made to; what they left is removed."""
    with contextlib.suppress(OSError):
        assert process.stdin is not None
        process.stdin.close()
    try:
        process.wait(5.0)
    except subprocess.TimeoutExpired:
        process.terminate()  # mpiexec ends its ranks
        process.wait()
    assert process.stdout is not None
    process.stdout.close()
    shutil.rmtree(folder, ignore_errors=True)
