"""A blade's deck of second-order wedges: `microslip import` and `microslip modes` beside CalculiX' own run.

    python benchmarks/deck.py [--quick]

CPU seconds (user and system) of whole processes, one thread each, in turns in one folder.
"""

from __future__ import annotations

import itertools
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

FLOOR = np.array([(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)])
EDGES = ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5))
STEP = ["*STEP", "*FREQUENCY", "20", "*END STEP"]


def deck(boxes: tuple[int, int, int]) -> str:
    """A twisted, tapered, cambered blade of 40 x 4 x 120 mm, two wedges a box, its foot clamped."""
    cells = []
    for box in itertools.product(*map(range, boxes)):
        for corners in ((0, 1, 2), (0, 2, 3)):
            nodes = [2 * np.array(box) + FLOOR[c] + (0, 0, up) for up in (0, 2) for c in corners]
            nodes += [(nodes[a] + nodes[b]) // 2 for a, b in EDGES]
            cells.append([tuple(node) for node in nodes])
    number = {key: i for i, key in enumerate(sorted({key for cell in cells for key in cell}), 1)}
    s = np.array(list(number)) / (2 * np.array(boxes)) * (40.0, 4.0, 120.0)
    taper, turn = 1 - 0.3 * s[:, 2] / 120, np.radians(30) * s[:, 2] / 120
    x, y = taper * (s[:, 0] - 20), taper * (s[:, 1] - 2 + 0.0015 * (s[:, 0] - 20) ** 2)
    points = np.column_stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), s[:, 2]])
    lines = [
        "*NODE",
        *(f"{i}, {', '.join(map(repr, p))}" for i, p in zip(number.values(), points.tolist(), strict=True)),
    ]
    lines.append("*ELEMENT, TYPE=C3D15, ELSET=ALL")
    lines += [", ".join(map(str, [i, *(number[key] for key in cell)])) for i, cell in enumerate(cells, 1)]
    lines += ["*NSET, NSET=FOOT", *(f"{i}," for key, i in number.items() if key[2] == 0)]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", "210000., 0.3", "*DENSITY", "7.85e-9"]
    return "\n".join([*lines, "*SOLID SECTION, ELSET=ALL, MATERIAL=STEEL", "*BOUNDARY", "FOOT, 1, 3", *STEP]) + "\n"


def seconds(command: list[str], folder: Path) -> float:
    """CPU seconds of a process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    one = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    subprocess.run(command, cwd=folder, check=True, capture_output=True, env={**os.environ, **one})
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    quick = "--quick" in sys.argv
    text = deck((4, 2, 8) if quick else (16, 4, 52))
    print("| import | modes | CalculiX | CalculiX / microslip |\n|--:|--:|--:|--:|")
    for _ in range(1 if quick else 3):
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch)
            (folder / "blade.inp").write_text(text)
            verbs = ("import", "blade.inp"), ("modes", "blade")
            ours = [seconds([sys.executable, "-m", "microslip", *words], folder) for words in verbs]
            theirs = seconds(["ccx", "blade"], folder)
            print(f"| {ours[0]:.2f} | {ours[1]:.2f} | {theirs:.2f} | {theirs / sum(ours):.2f} |", flush=True)


if __name__ == "__main__":
    main()
