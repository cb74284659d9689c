"""CalculiX on the same mesh: two shrouded blades that touch at speed, NLGEOM with surface-to-surface penalty contact.

CalculiX checks the gap at every integration point of the slave face and lets it penetrate by pressure over stiffness;
microslip holds mean gaps at zero. The blades of the pair tilt and touch along an edge of the face only, the hardest
case: each program places the edge a part of an element too far inside. The difference must vanish with the element.
"""

from __future__ import annotations

import re
import shutil

import numpy as np
import pytest
from meshes import STEEL, body, rotation_matrix
from test_calculix import deck, displacements, run
from touching import SECTORS, shrouded, together

from microslip.data import Mesh
from microslip.modal.compute import modal_basis

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed"),
]

SPEED = 400.0  # rad/s
FACES = {  # S1, S2, ... by their corners
    "hexahedron20": ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
    "tetra10": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
}
CENTRIFUGAL = f"*DLOAD\nEALL, CENTRIF, {SPEED**2:.12e}, 0., 0., 0., 0., 1., 0.\n"
CONTROLS = "*CONTROLS, PARAMETERS=FIELD\n1.e-7, 1.e-7, 1.e-7, , 1.e-7\n"


def pair(n: tuple[int, int, int], gap: float, lean: tuple[float, float]) -> Mesh:
    """Two neighbours; the right side of the first meets the left side of the second."""
    one = shrouded(n, gap, lean)
    R = rotation_matrix((0, 2 * np.pi / SECTORS, 0))
    mesh = together(a=one, b=Mesh(one.points @ R.T, one.cells, one.faces, {}, one.node_id))
    held = {t: np.vstack([mesh.faces["a_z0"][t], mesh.faces["b_z0"][t]]) for t in mesh.faces["a_z0"]}
    return Mesh(mesh.points, mesh.cells, {**mesh.faces, "held": held}, {}, mesh.node_id)


def surface(mesh: Mesh, face: str, name: str) -> str:
    """Element faces of a named face."""
    ((kind, cells),), (facets,) = mesh.cells.items(), mesh.faces[face].values()
    wanted = {tuple(sorted(f)) for f in facets[:, : facets.shape[1] // 2].tolist()}
    lines = [f"*SURFACE, NAME={name}, TYPE=ELEMENT"]
    for e, cell in enumerate(cells):
        for number, local in enumerate(FACES[kind]):
            if tuple(sorted(cell[list(local)].tolist())) in wanted:
                lines.append(f"{e + 1}, S{number + 1}")
    assert len(lines) == 1 + len(wanted)
    return "\n".join(lines) + "\n"


def closed_by_calculix(mesh: Mesh, folder, stiffness: float) -> tuple[np.ndarray, np.ndarray]:
    """Displacements (n, 3) and the contact force (3,) on the slave face."""
    text = deck(mesh, held="held") + surface(mesh, "a_right", "SLAVE") + surface(mesh, "b_left", "MASTER")
    text += "*SURFACE INTERACTION, NAME=HARD\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n"
    text += f"{stiffness:.6e}, 1.e3\n"
    text += "*CONTACT PAIR, INTERACTION=HARD, TYPE=SURFACE TO SURFACE\nSLAVE, MASTER\n"
    text += f"*STEP, NLGEOM, INC=200\n*STATIC\n0.1, 1., 1.e-5, 0.2\n{CONTROLS}{CENTRIFUGAL}"
    text += "*NODE PRINT, NSET=NALL, FREQUENCY=1000\nU\n"
    text += "*CONTACT PRINT, SLAVE=SLAVE, MASTER=MASTER, FREQUENCY=1000\nCF\n*END STEP\n"
    dat = run(folder, text)
    found = re.findall(r"total surface force \(fx,fy,fz\).*?\n\s*\n(.*?)\n", dat, re.S)
    force = np.array([float(v) for v in found[-1].split()[:3]])
    n = mesh.n_points
    return displacements(dat)[-n:], force


def both(folder, n, gap, lean) -> tuple[float, float]:
    """Our contact force over theirs, less one, and the largest difference of displacements over the largest one."""
    mesh = pair(n, gap, lean)
    u, force = closed_by_calculix(mesh, folder, 50 * STEEL["young"] / 0.01)
    settings = body(
        supports=[{"face": "held"}], modes={"count": 1}, rotation={"speeds_rpm": [SPEED * 30 / np.pi]},
        closures=[{"name": "c", "face": "a_right", "against": "b_left"}],
    )  # fmt: skip
    group = modal_basis(mesh, settings).groups[0, 0]
    ours = group.contacts["c"].normal_force
    return ours / float(np.linalg.norm(force)) - 1, float(np.abs(group.u_static - u).max() / np.abs(u).max())


def test_difference_halves_with_the_element(tmp_path):
    """Straight blades drawn 0.2 mm into each other: contact along one edge, elements halved across it."""
    found = [both(tmp_path, (1, 2, n), -2e-4, (0.0, 0.0)) for n in (8, 16, 32)]
    force, shape = (np.abs(np.array(v)) for v in zip(*found, strict=True))
    assert (force[1:] < 0.6 * force[:-1]).all() and force[-1] < 0.025  # 7.5, 3.7, 1.9 %; 0.8 % at 64
    assert (shape[1:] < 0.6 * shape[:-1]).all() and shape[-1] < 0.007  # 2.2, 1.0, 0.5 %


@pytest.mark.parametrize("gap", [0.0, 1e-4])
def test_twisted_blades_close_at_speed(gap, tmp_path):
    """Blades that the rotation untwists against each other; contact at one corner, 5 mm elements: 3.5 % measured."""
    force, shape = both(tmp_path, (1, 8, 12), gap, (0.9, -0.5))
    assert abs(force) < 0.05 and shape < 0.03
