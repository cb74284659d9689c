"""Reading and certifying the ring of 24 sectors from a modal file of one: time and memory against the sector's size.

    python benchmarks/ring.py                    # 25 000 to 200 000 degrees of freedom a sector, some minutes
    python benchmarks/ring.py --quick            # one small sector, seconds

The file is made up: an annular sector of 20-node bricks, 12 shapes at each of 13 nodal diameters that obey the phase
rule exactly and are mass-orthonormal, so every check has to pass. Each measurement is a process of its own with one
thread: read the file, then certify the ring (orthonormality of all ring modes, phase rule on the cut faces, count),
then displace all sectors in the modes of one nodal diameter. "Ring's shapes": what all ring modes on all sectors would
fill; "ring's M": one triangle of its mass matrix. Neither is ever made.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
WORK = ROOT / "build" / "bench"
SECTORS, MODES, DENSITY = 24, 12, 7850.0
EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
CORNERS = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [0, 0, 2], [2, 0, 2], [2, 2, 2], [0, 2, 2]])


def sector_mesh(n: int):
    """n x n x n bricks of an annular sector about the y-axis, its cut faces named; and cylinder coordinates."""
    from microslip.data import Mesh
    from microslip.mesh import boundary_facets

    boxes = 2 * np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    local = np.vstack([CORNERS, [(CORNERS[a] + CORNERS[b]) // 2 for a, b in EDGES]])
    keys, cells = np.unique((boxes + local).reshape(-1, 3), axis=0, return_inverse=True)
    r, angle, y = 0.2 + 0.1 * keys[:, 0] / n, 2 * np.pi / SECTORS * (keys[:, 1] / (2 * n) - 0.5), 0.04 * keys[:, 2] / n
    points = np.column_stack([r * np.sin(angle), y, r * np.cos(angle)])
    mesh = Mesh(points, {"hexahedron20": cells.reshape(-1, 20)}, node_id=np.arange(1, len(points) + 1))
    faces = {}
    outside = boundary_facets(mesh)["quad8"]
    for name, at in (("cyclic_left", 0), ("cyclic_right", 2 * n)):
        faces[name] = {"quad8": outside[(keys[outside, 1] == at).all(axis=1)]}
    return Mesh(points, mesh.cells, faces, {}, mesh.node_id), (r, angle, y)


def shapes(mesh, cylinder, k: int, seed: int, mass: float, volume: float):
    """(n, 3, m) mass-orthonormal shapes: polynomials of r and y times exp(i k angle), in the axes of the cylinder."""
    from microslip.basis.integrals import modal_mass

    r, angle, y = cylinder
    rng = np.random.default_rng(seed)
    poly = np.array([(10 * (r - 0.3)) ** a * (20 * (y - 0.04)) ** b for a in range(4) for b in range(4)])
    parts = np.einsum("cmp,pn->ncm", rng.normal(size=(3, MODES, 16)), poly)
    wave = np.exp(1j * k * angle) if 0 < k < SECTORS // 2 else np.cos(k * angle) + 0 * angle
    if 2 * k == SECTORS:
        wave = np.sin(k * angle)  # changes its sign from face to face, as N/2 wants
    s, c = np.sin(angle)[:, None], np.cos(angle)[:, None]
    x = parts[:, 0] * s + parts[:, 1] * c
    z = parts[:, 0] * c - parts[:, 1] * s
    phi = np.stack([x, parts[:, 2], z], axis=1) * wave[:, None, None]
    inner, _ = modal_mass(mesh, phi)
    return phi @ np.linalg.inv(np.linalg.cholesky(inner * mass / volume)).conj().T


def write_file(path: Path, n: int) -> int:
    """Write the modal file; returns the degrees of freedom of the sector."""
    from microslip.basis import write_basis
    from microslip.basis.integrals import modal_mass
    from microslip.data import Compliance, ModalBasis, ModalGroup

    mesh, cylinder = sector_mesh(n)
    _, volume = modal_mass(mesh, np.zeros((mesh.n_points, 3, 1)))
    mass, none = volume * DENSITY, np.zeros((0, 0))
    groups = {}
    for k in range(SECTORS // 2 + 1):
        omega = 1000.0 * np.arange(1, MODES + 1) + k
        groups[0, k] = ModalGroup(
            0.0, omega, ("normal",) * MODES, np.zeros(MODES), np.eye(MODES), np.diag(omega**2),
            np.zeros((MODES, MODES)), np.zeros((MODES, MODES)), shapes(mesh, cylinder, k, k, mass, volume), {}, {}, {},
            {}, Compliance((), none, none, False), {}, np.zeros((mesh.n_points, 3)),
            {"certified": 1.0, "count_below_upper_shift": float(MODES), "upper_shift_hz": 2000.0}, harmonic=k,
        )  # fmt: skip
    axis = np.array([0.0, 1.0, 0.0])
    basis = ModalBasis(
        "ring", mesh, groups, mass, np.zeros(3), np.eye(3), axis, np.zeros(3), "none", False, "eigenmodes", {}, SECTORS
    )
    write_basis(path, basis)
    return 3 * mesh.n_points


def measure(path: Path) -> dict[str, float]:
    """What one process spends on the file."""
    from microslip.basis import read_basis
    from microslip.ring.expansion import certify_ring, expand

    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    marks = [time.process_time()]
    basis = read_basis(path)
    marks.append(time.process_time())
    found = certify_ring(basis)
    marks.append(time.process_time())
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    for j in range(SECTORS):
        expand(basis.groups[0, 3], basis, j)
    marks.append(time.process_time())
    passed = found.certified and found.orthogonality < 1e-8 and found.phase_rule < 1e-8
    return {
        "read": marks[1] - marks[0], "certify": marks[2] - marks[1], "expand": marks[3] - marks[2], "memory": memory,
        "imports": before, "count": found.count, "passed": float(passed), "file": path.stat().st_size / 1e9,
    }  # fmt: skip


def row(n: int, work: Path) -> list[str]:
    """Make a file, measure it in a process of its own, throw it away."""
    work.mkdir(parents=True, exist_ok=True)
    path = work / f"ring_{n}.h5"
    try:
        dof = int(_child(path, "--make", str(n))["dof"])
        found = _child(path, "--measure")
    finally:
        path.unlink(missing_ok=True)
    if not found["passed"]:
        raise SystemExit(f"the ring of {dof} degrees of freedom a sector was not certified")
    whole = found["count"] * SECTORS * dof * 8 / 1e9
    entries = SECTORS * dof / 3 * 40 * 12 / 1e9  # some 40 neighbours above the diagonal, scalar mass: number and index
    cells = [f"{dof}", f"{SECTORS * dof}", f"{int(found['count'])}", f"{found['file']:.2f}", f"{found['read']:.2f}"]
    cells += [f"{found['certify']:.2f}", f"{found['expand']:.2f}", f"{found['memory']:.2f}", f"{whole:.1f}"]
    return [*cells, f"{entries:.2f}"]


def _child(path: Path, *words: str) -> dict[str, float]:
    one = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS")}
    paths = os.pathsep.join([str(ROOT / "pipeline"), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, __file__, *words, "--file", str(path)], capture_output=True, text=True,
        env={**os.environ, **one, "PYTHONPATH": paths},
    )  # fmt: skip
    if done.returncode:
        raise SystemExit(done.stderr)
    return json.loads(done.stdout)


HEAD = (
    "dof a sector", "dof of the ring", "ring modes", "file, GB", "read, CPU s", "certify, CPU s", "expand one k, CPU s",
    "peak GB", "ring's shapes, GB", "ring's M, GB",
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--work", type=Path, default=WORK)
    parser.add_argument("--make", type=int)
    parser.add_argument("--measure", action="store_true")
    parser.add_argument("--file", type=Path)
    given = parser.parse_args()
    if given.make:
        print(json.dumps({"dof": write_file(given.file, given.make)}))
    elif given.measure:
        print(json.dumps(measure(given.file)))
    else:
        print("| " + " | ".join(HEAD) + " |\n|" + "--:|" * len(HEAD))
        for n in (4,) if given.quick else (12, 16, 20, 25):
            print("| " + " | ".join(row(n, given.work)) + " |", flush=True)


if __name__ == "__main__":
    main()
