"""CalculiX's cyclic symmetry on the same sector: frequencies of every nodal diameter at rest and at speed, statics.

The right cut face is tied to the left one (*TIE, CYCLIC SYMMETRY; the same nodes, so the tie is exact) and its nodes
are taken out of the clamp, which CalculiX wants. A nodal diameter k > 0 is solved twice over there (each frequency is
printed twice, also for k = 0 and N/2). Elements, integration and terms at speed: see `test_calculix`.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import rings
from meshes import body, with_sets
from test_calculix import PRINTED, deck, displacements, run, same_order, static, stresses

from microslip.mesh import read_mesh
from microslip.modal.compute import modal_basis

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed"),
]

ROOT = Path(__file__).resolve().parents[2]
KINDS = {"none": None, "linear": "", "nonlinear": ", NLGEOM"}


def cyclic_deck(mesh, sectors: int) -> str:
    """Nodes, cells, material, clamped bore, tied cut faces; the rotor axis is y."""
    held = np.setdiff1d(mesh.face_points("bore"), mesh.face_points("cyclic_right"))
    text = deck(with_sets(mesh, held=held), held="held")
    for name in ("cyclic_right", "cyclic_left"):
        text += f"*NSET, NSET=N{name}\n" + "".join(f"{k + 1},\n" for k in mesh.face_points(name))
        text += f"*SURFACE, NAME=S{name}, TYPE=NODE\nN{name}\n"
    text += "*TIE, NAME=CUT, POSITION TOLERANCE=1.e-6, CYCLIC SYMMETRY\nScyclic_right, Scyclic_left\n"
    return text + f"*CYCLIC SYMMETRY MODEL, N={sectors}, NGRAPH={sectors}, TIE=CUT\n0., 0., 0., 0., 1., 0.\n"


def frequency_step(count: int, first: int, last: int, perturbation: bool) -> str:
    kind = ", PERTURBATION" if perturbation else ""
    select = f"*SELECT CYCLIC SYMMETRY MODES, NMIN={first}, NMAX={last}\n"
    return f"*STEP{kind}\n*FREQUENCY\n{2 * count}\n{select}*END STEP\n"


def centrifugal(speed: float) -> str:
    return f"*DLOAD\nEALL, CENTRIF, {speed**2:.12e}, 0., 0., 0., 0., 1., 0.\n"


def cyclic_frequencies(dat: str) -> dict[int, np.ndarray]:
    """Nodal diameter -> rad/s, each once."""
    found: dict[int, list[float]] = {}
    for line in dat.splitlines():
        numbers = line.split()
        if len(numbers) == 6 and all(re.fullmatch(r"\d+", v) for v in numbers[:2]):
            found.setdefault(int(numbers[0]), []).append(float(numbers[3]))
    return {k: np.array(v)[::2] for k, v in found.items()}


def compared(folder, mesh, sectors: int, speed: float, prestress: str, count: int, last: int | None = None):
    """The .dat file and our basis, after every frequency has been compared, up to a nodal diameter or of all."""
    kind, last = KINDS[prestress], sectors // 2 if last is None else last
    text = cyclic_deck(mesh, sectors)
    if kind is not None:
        text += static(centrifugal(speed), kind)
    dat = run(folder, text + frequency_step(count, 0, last, kind is not None))
    found = modal_basis(
        mesh,
        body(
            supports=[{"face": "bore"}], cyclic={"sectors": sectors, "nodal_diameters": list(range(last + 1))},
            modes={"count": count},
            rotation={"speeds_rpm": [speed * 30 / np.pi if kind is not None else 0.0], "prestress": prestress},
            output={"gauss": True, "nodal_stress": False},
        ),
    )  # fmt: skip
    theirs = cyclic_frequencies(dat)
    assert sorted(theirs) == list(range(last + 1))
    for k, omega in theirs.items():
        np.testing.assert_allclose(found.groups[0, k].omega[:count], omega[:count], rtol=PRINTED, err_msg=f"k = {k}")
    return dat, found


@pytest.mark.parametrize("prestress", KINDS)
@pytest.mark.parametrize(("cell_type", "sectors"), [("hexahedron20", 6), ("tetra10", 5)])
def test_a_bladed_sector(cell_type, sectors, prestress, tmp_path):
    """All nodal diameters of an even and an odd number of sectors, and the static state at 600 rad/s."""
    mesh = rings.bladed_sector(cell_type, sectors)
    dat, found = compared(tmp_path, mesh, sectors, 600.0, prestress, 8)
    if prestress == "none":
        return
    u, group = displacements(dat), found.groups[0, 0]
    np.testing.assert_allclose(group.u_static, u, atol=2e-6 * np.abs(u).max())  # printed to seven digits, Newton's end
    points = len(group.stresses["gauss"].points) // mesh.n_cells
    theirs = stresses(dat, mesh.n_cells, points)
    ours = group.stresses["gauss"].static_stress.reshape(-1, points, 6)
    if points == 4:
        ours = same_order(ours, theirs)
    else:  # 27 points: CalculiX runs through the first coordinate fastest
        ours = ours[:, fastest_first(found)]
    np.testing.assert_allclose(ours, theirs, atol=1e-4 * np.abs(theirs).max())


def fastest_first(found) -> np.ndarray:
    """Order of our 27 points by their third, second, first coordinate in the reference brick."""
    from microslip.fem.discretise import quadrature

    at, _ = quadrature("hexahedron20")
    return np.lexsort(np.round(at.T, 9))


# ---------------------------------------------------------------- the shroud


@cache
def shroud():
    """The shrouded blade of 24 on a mesh as coarse as it can be."""
    pytest.importorskip("gmsh", exc_type=ImportError)
    folder = ROOT / "build" / "tests"
    folder.mkdir(parents=True, exist_ok=True)
    local = {"pressure_side": 14.0, "suction_side": 14.0, "contact_left": 8.0, "contact_right": 8.0}
    settings, mesh = folder / "coarse_shroud.json", folder / "coarse_shroud.msh"
    settings.write_text(
        json.dumps({"name": "shroud", "length_unit": "mm", "mesh": {"size": 30.0, "order": 2, "local": local}})
    )
    build = ROOT / "geometry" / "shroud" / "build.py"
    subprocess.run([sys.executable, str(build), str(settings), str(mesh)], check=True, capture_output=True)
    return read_mesh(mesh, "mm")


def test_the_shrouded_blade_on_its_disc(tmp_path):
    """24 sectors, nodal diameters 0 to 5 about the untwisting equilibrium at 4500 rpm."""
    compared(tmp_path, shroud(), 24, 150 * np.pi, "nonlinear", 4, last=5)


# ---------------------------------------------------------------- Coriolis

MODES = 60


def complex_frequencies(dat: str) -> np.ndarray:
    """rad/s of the last table of eigenvalues."""
    start = dat.rindex("E I G E N V A L U E   O U T P U T")
    rows = re.findall(r"^ +\d+ +(-?[\d.]+E[+-]\d+) +\S+ +\S+ *$", dat[start:], re.MULTILINE)
    return np.abs(np.array(rows, dtype=float))


def test_coriolis_waves_of_the_full_ring(tmp_path, monkeypatch):
    """CalculiX refuses Coriolis forces with cyclic symmetry, so it gets the whole ring: *COMPLEX FREQUENCY, CORIOLIS.

    It finds the waves among 60 modes of the ring and prints only some of them (one of most pairs), and between them
    numbers that move by percent with the order of summation (4547, 4584 or 4623 rad/s): a wave is what it prints with
    every kernel of its BLAS. Every one is a wave of ours: the first eight within 2e-6, the others as close as 60 modes
    allow, 1e-4.
    """
    sector = rings.bladed_sector()
    load = centrifugal(600.0)
    silent = static(load, ", NLGEOM").partition("*NODE PRINT")[0] + "*END STEP\n"
    text = deck(rings.full_ring(sector, 6).mesh, held="bore") + silent
    text += f"*STEP, PERTURBATION\n*FREQUENCY, STORAGE=YES\n{MODES}\n*END STEP\n"
    text += f"*STEP, PERTURBATION\n*COMPLEX FREQUENCY, CORIOLIS\n{MODES}\n{load}*END STEP\n"
    printed = []
    for kernel in ("Haswell", "Nehalem", "Sandybridge"):
        monkeypatch.setenv("OPENBLAS_CORETYPE", kernel)
        printed.append(complex_frequencies(run(tmp_path, text)))
    theirs = np.array([f for f in printed[0] if all(np.abs(p / f - 1).min() < 2e-6 for p in printed[1:])])[:20]
    described = body(
        supports=[{"face": "bore"}], cyclic={"sectors": 6}, modes={"count": 60},
        rotation={"speeds_rpm": [600.0 * 30 / np.pi]},
    )  # fmt: skip
    groups = modal_basis(sector, described).groups
    ours = np.concatenate([np.abs(g.gyroscopic.omega) for g in groups.values()])
    still = np.concatenate([g.omega for g in groups.values()])

    def nearest(candidates):
        return np.abs(theirs[:, None] / candidates - 1).min(axis=1)

    assert len(theirs) > 12
    assert nearest(ours)[:8].max() < 5e-6
    assert nearest(ours).max() < 3e-4
    assert nearest(still)[:8].max() > 5e-4  # without Coriolis forces they are no waves of ours
