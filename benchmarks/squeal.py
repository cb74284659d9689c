"""The map of a brake over 1,000 states by `microslip stability`, beside SciPy's shift-invert at ten of them.

    OMP_NUM_THREADS=1 python benchmarks/squeal.py

The case is pipeline/cases/squeal.toml with its map alone, modal files made before; the verb is timed from reading to
the page, without pictures. The peers, those of benchmarks/stability.py, get the unreduced matrices of ten states along
the map's diagonal, whose assembly is not counted, and find the 24 roots nearest to the middle of the window, about as
many as lie in it; the companion form at two of them. CPU seconds of one thread.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from functools import partial
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from microslip.modal.unreduced import unreduced
from stability import companion, condensed, cpu

from microslip.basis import read_basis
from microslip.case import load_case
from microslip.cli import main as typed
from microslip.linalg.quadratic import Quadratic, every_value
from microslip.roots.asked import window_of
from microslip.roots.full import full_matrices
from microslip.stages.analysing import Varied
from microslip.stages.places import modal_files
from microslip.verbs.stability import state_of

ROOT = Path(__file__).resolve().parents[1]
STATES = 10
CASE = Path("squeal.toml")


def prepared() -> Varied:
    """The case with its map alone, and its modal files, in the folder in which it works."""
    for body in ("brake-disc", "pad"):
        shutil.copytree(ROOT / "geometry" / body, Path("geometry") / body)
    text = (ROOT / "pipeline" / "cases" / CASE).read_text()
    whole = text[: text.index("[stability.cycle]")]
    CASE.write_text("\n".join(line for line in whole.splitlines() if not line.startswith("full =")) + "\n")
    settings, raw = load_case(CASE)
    files = modal_files(settings, Path(), lambda _: None)
    return Varied(CASE, raw, {name: read_basis(file) for name, file in files.items()})


def states(varied: Varied) -> list[tuple[Quadratic, int]]:
    """Unreduced matrices along the diagonal of the map, and how many roots the reduced ones say grow."""
    settings, _ = load_case(CASE)
    asked, found = settings.asked["stability"], []
    named = {b.name: varied.meshed(b.body or b.name, "bodies") for b in settings.components}
    window, bodies = window_of(asked), {name: unreduced(*of) for name, of in named.items()}
    for share in ((np.arange(STATES) + 0.5) / STATES).tolist():
        values = {k: f * (o.start + share * (o.stop - o.start)) for o in asked.over for k, f in o.keys.items()}
        state = state_of(varied, values, CASE)
        s = every_value(state.matrices)
        grow = int((s.real[window.holds(s)] > 0).sum())
        found.append((full_matrices(bodies, state.assembly, state.contacts), grow))
    return found


def main() -> None:
    varied = prepared()
    seconds, code = cpu(partial(typed, ["stability", str(CASE), "--no-pictures", "--quiet"]))
    count = len(Path("build/squeal/stability_map.csv").read_text().splitlines()) - 1
    assert code == 0
    settings, _ = load_case(CASE)
    window, known = window_of(settings.asked["stability"]), states(varied)
    print("| what | coordinates | states | CPU s | a state |\n|---|--:|--:|--:|--:|")
    n = sum(b.groups[0, 0].n_modes for b in varied.bases.values())
    print(f"| `microslip stability`, the map | {n} | {count} | {seconds:.1f} | {seconds / count:.3f} |")
    for name, solve, tried in (("half-size factors", condensed, STATES), ("companion form", companion, 2)):
        total, same = 0.0, 0
        for Q, grow in known[:: STATES // tried]:
            spent, s = cpu(partial(solve, Q, window))
            total += spent
            same += int((np.real(s)[window.holds(np.asarray(s))] > 0).sum()) == grow
        print(f"| `eigs`, {name} | {known[0][0].n} | {tried} | {total:.1f} | {total / tried:.2f} |")
        thousand = 1000 * total / tried
        print(f"\n{same} of {tried} have as many roots that grow as the reduced matrices; a thousand would take "
              f"{thousand:.0f} s, {thousand / seconds:.0f} times the map\n")  # fmt: skip


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        main()
