"""CalculiX decks of structured meshes, and CalculiX itself where it is installed."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np

from microslip.data import Array, Mesh

TYPES = {
    "tetra": "C3D4", "tetra10": "C3D10", "hexahedron": "C3D8", "hexahedron20": "C3D20", "wedge": "C3D6",
    "wedge15": "C3D15",
}  # fmt: skip
MATERIAL = ["*MATERIAL, NAME=Steel", "*ELASTIC", "210000., 0.3", "*DENSITY", "7.85e-9"]
CCX = shutil.which("ccx")


def mesh_lines(mesh: Mesh, scale: float = 1e3, sets: tuple[str, ...] = ()) -> list[str]:
    """Nodes, cells (set EALL) and node sets, lengths times `scale`."""
    points = (mesh.points * scale).tolist()
    lines = ["*NODE, NSET=NALL"]
    lines += [f"{i}, {x!r}, {y!r}, {z!r}" for i, (x, y, z) in zip(ids(mesh), points, strict=True)]
    number = 0
    for kind, cells in mesh.cells.items():
        lines.append(f"*ELEMENT, TYPE={TYPES[kind]}, ELSET=EALL")
        for cell in cells:
            number += 1
            words = [str(number), *(str(ids(mesh)[i]) for i in cell)]
            parts = [", ".join(words[i : i + 15]) for i in range(0, len(words), 15)]
            lines.append(",\n".join(parts))
    for name in sets:
        lines += [f"*NSET, NSET={name}", *(f"{ids(mesh)[i]}," for i in mesh.face_points(name))]
    return lines


def ids(mesh: Mesh) -> list[int]:
    return [int(i) for i in mesh.node_id]


def section(name: str = "EALL", material: str = "Steel", orientation: str = "") -> str:
    turned = f", ORIENTATION={orientation}" if orientation else ""
    return f"*SOLID SECTION, ELSET={name}, MATERIAL={material}{turned}"


def frequency_step(count: int = 8, storage: bool = False) -> list[str]:
    return ["*STEP", "*FREQUENCY" + (", SOLVER=MATRIXSTORAGE" if storage else ""), str(count), "*END STEP"]


def run(folder: Path, name: str, lines: list[str]) -> Array:
    """Write a deck and run CalculiX; the frequencies it prints (Hz, seven digits; none with matrix storage)."""
    assert CCX is not None
    (folder / f"{name}.inp").write_text("\n".join(lines) + "\n")
    done = subprocess.run([CCX, name], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0 or (folder / f"{name}.sti").is_file(), done.stdout[-2000:]
    four = re.compile(r"^\s+\d+" + 4 * r"\s+(\S+E\S+)" + "$", re.M)
    return np.array([float(r[2]) for r in four.findall((folder / f"{name}.dat").read_text())])
