"""CalculiX's full ring with a modulus of its own in every blade, against the tuned sector's modal file.

Elements, integration and digits printed: see `test_calculix`. Rings made of nominal modes are Ritz approximations, so
their frequencies lie above CalculiX's.
"""

from __future__ import annotations

import shutil

import numpy as np
import pytest
import rings
import scipy.linalg
from meshes import STEEL, body
from test_calculix import deck, frequencies, run

from microslip.basis.files import read_basis, write_basis
from microslip.mistuning import subset
from microslip.mistuning.ring import Tuned
from microslip.mistuning.scatter import Scatter
from microslip.modal.compute import modal_basis
from microslip.system.assembly import Assembly
from microslip.system.component import Component, Ring

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed"),
]

N, COUNT, RIM = 6, 12, 0.17
SECTOR = rings.bladed_sector("hexahedron20", N)
DEVIATION = 0.01 * np.array([0.3, -1.2, 0.8, 1.1, -0.9, 0.4])


@pytest.fixture(scope="module")
def disc(tmp_path_factory: pytest.TempPathFactory) -> Component:
    """The sector as its modal file has it, 12 modes a nodal diameter."""
    output = {"gauss": True, "nodal_stress": False}
    settings = body(supports=[{"face": "bore"}], cyclic={"sectors": N}, modes={"count": 12}, output=output)
    file = tmp_path_factory.mktemp("disc") / "basis.h5"
    write_basis(file, modal_basis(SECTOR, settings))
    return Component("disc", {k: g for (_, k), g in read_basis(file).groups.items()}, sectors=N)


def theirs(folder, cells: np.ndarray, deviation: np.ndarray = DEVIATION) -> np.ndarray:
    """(COUNT,) rad/s of the ring whose sectors are (1 + d)^2 as stiff in some of their cells (bool)."""
    text, n = deck(rings.full_ring(SECTOR, N).mesh, held="bore"), len(cells)
    for j, d in enumerate(deviation):
        own = np.flatnonzero(cells) + j * n + 1
        text += f"*ELSET, ELSET=E{j}\n" + "".join(f"{e},\n" for e in own)
        text += f"*MATERIAL, NAME=M{j}\n*ELASTIC\n{STEEL['young'] * (1 + d) ** 2:.12e}, {STEEL['poisson']:.12e}\n"
        text += f"*DENSITY\n{STEEL['density']:.12e}\n*SOLID SECTION, ELSET=E{j}, MATERIAL=M{j}\n"
    return frequencies(run(folder, text + f"*STEP\n*FREQUENCY\n{COUNT}\n*END STEP\n"))


def test_sectors_that_differ(disc: Component, tmp_path) -> None:
    """A modulus for each sector: the ring that `ms.mistune` solves has CalculiX's frequencies to 1e-4."""
    expected = theirs(tmp_path, np.ones(SECTOR.n_cells, bool))
    ring = Tuned(Assembly((disc,), (), (), (), Ring(N, 1)), {})
    of = Scatter("frequency", values=tuple(DEVIATION))
    part = ring.mistuned([(of, DEVIATION[:, None])]).joined(1)
    found = np.sqrt(scipy.linalg.eigvalsh(part.K, part.M))[:COUNT]
    np.testing.assert_allclose(found, expected, rtol=1e-4)
    alike = ring.whole.components[0].groups[0].omega[:COUNT]
    assert np.abs(alike / expected - 1).max() > 5e-3


@pytest.mark.parametrize("deviation, error", [(DEVIATION, 1e-4), (np.sqrt(1.1) * np.eye(N)[2] - np.eye(N)[2], 3e-4)])
def test_blades_that_differ(disc: Component, deviation: np.ndarray, error: float, tmp_path) -> None:
    """A modulus for each blade, its disc alike all round: nominal modes (SNM) to 1e-4, from above. One blade whose
    modulus is 10 % higher moves frequencies by up to 1.4 %, and nominal modes miss them by 2.2e-4."""
    points = disc.groups[0].stresses["gauss"].points
    of_cells = np.hypot(*SECTOR.points[SECTOR.cells["hexahedron20"]].mean(axis=1)[:, [0, 2]].T) > RIM
    blade = np.repeat(of_cells, len(points) // SECTOR.n_cells)
    expected = theirs(tmp_path, of_cells, deviation)
    found = subset.mistuned(disc, deviation, blade).groups[0].omega[:COUNT]
    np.testing.assert_allclose(found, expected, rtol=error)
    assert (found > expected * (1 - 1e-6)).all()
