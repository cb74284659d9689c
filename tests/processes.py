"""Programs that use gmsh, each in a process of its own that finds gmsh loaded: its start takes a second otherwise."""

from __future__ import annotations

import io
import multiprocessing
import runpy
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from multiprocessing.connection import Connection

READY = multiprocessing.get_context("forkserver")
CAD = ("microslip.cad.drawing", "microslip.cad.faces", "microslip.cad.solids")
READY.set_forkserver_preload(["gmsh", *CAD, "processes"])


def run(words: list[str], module: bool = False) -> subprocess.CompletedProcess[str]:
    """What a script, or a module of this name, says and returns; the words behind it are its arguments."""
    ours, theirs = READY.Pipe()
    process = READY.Process(target=_run, args=(words, module, theirs))
    process.start()
    theirs.close()
    try:
        code, told, said = ours.recv()
    except EOFError:
        code, told, said = -1, "", "the process ended without a word"
    process.join()
    return subprocess.CompletedProcess(words, code, told, said)


def _run(words: list[str], module: bool, answer: Connection) -> None:
    told, said, code = io.StringIO(), io.StringIO(), 0
    sys.argv = words
    with redirect_stdout(told), redirect_stderr(said):
        try:
            (runpy.run_module if module else runpy.run_path)(words[0], run_name="__main__")
        except SystemExit as end:
            code = int(end.code or 0)
    answer.send((code, told.getvalue(), said.getvalue()))
