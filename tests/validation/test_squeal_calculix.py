"""CalculiX on the same mesh: complex frequencies of a leaning pin that is pressed on a disc and slides on it.

A static step presses the pin and turns the disc until every point of the contact slips; *FREQUENCY as a perturbation
then takes K with the part of friction that is not symmetric, mu k_n t n^T at each integration point, and prints complex
frequencies. Matched: both bodies (C3D10), normal springs, friction that follows the normal force, its direction at each
point. Made small, as the two differ there: CalculiX holds a slipping point across its way by the stick slope, here
1e-5 of the normal stiffness; microslip damps it by mu N / |V|, here 7e-6 N over 1e4 m/s. CalculiX finds the opposite
points anew where the disc has been turned to, microslip before it turns: the difference grows with that way, which is
as short as all points need to slip (a fifth of it, and they stick): so they are pressed little.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from meshes import body, brick
from test_calculix import deck, frequencies, run, table
from test_contact_calculix import surface
from touching import together

from microslip import sliding
from microslip.case.assemble import build
from microslip.case.settings import case_model
from microslip.data import Mesh, ModalBasis
from microslip.linalg.quadratic import Window
from microslip.modal.compute import modal_basis
from microslip.roots.spectrum import Spectrum, spectrum
from microslip.verbs.stability import State

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed"),
]

CELLS = 10  # round the disc
ANGLE = 2 * np.pi / CELLS  # that the pin takes
BORE, INNER, OUTER, THICK = 0.04, 0.07, 0.10, 0.008  # m, the pin from the second radius to the third
HIGH, LEAN = 0.1, 0.3  # m of the pin, and by how much its back stands ahead over that
STIFF = 3e10  # N/m3, normal; 0.3 to 0.7 of what the pin is pressed by is overlap, so no point opens
PRESSED = 3e-13  # m, so little that stresses and ways do not count
TURNED = 1e-6  # rad, of the disc
HELD = (("disc", "x0"), ("pin", "z1"))
WINDOW = Window((-1e4, 1e4), (0.0, 2 * np.pi * 7300.0))
COUNT = 12  # roots in it


def on_disc(p: np.ndarray) -> np.ndarray:
    """Radius, angle and height to places."""
    return np.column_stack([p[:, 0] * np.cos(p[:, 1]), p[:, 0] * np.sin(p[:, 1]), p[:, 2]])


def leaning(p: np.ndarray) -> np.ndarray:
    ahead = np.array([-np.sin(ANGLE / 2), np.cos(ANGLE / 2), 0.0])
    return on_disc(p) + LEAN * np.outer(p[:, 2], ahead)


def places(mesh: Mesh, facets: np.ndarray) -> list[tuple]:
    return [tuple(sorted(map(tuple, np.round(mesh.points[f], 9).tolist()))) for f in facets]


@pytest.fixture(scope="module")
def meshes() -> dict[str, Mesh]:
    """A disc, its facets under the pin called ``track``, and the pin."""
    across = round((OUTER - BORE) / (OUTER - INNER))
    disc = brick(
        "tetra10", (across, CELLS, 1), (OUTER - BORE, 2 * np.pi, THICK), (BORE, 0, -THICK), on_disc,
        straight=True, closed=True,
    )  # fmt: skip
    pin = brick("tetra10", (1, 1, 2), (OUTER - INNER, ANGLE, HIGH), (INNER, 0, 0), leaning, straight=True)
    (top,), (foot,) = disc.faces["z1"].values(), pin.faces["z0"].values()
    under = [place in set(places(pin, foot)) for place in places(disc, top)]
    assert sum(under) == len(foot)
    return {"disc": Mesh(disc.points, disc.cells, disc.faces | {"track": {"triangle6": top[under]}}, {}, disc.node_id),
            "pin": pin}  # fmt: skip


def by_calculix(meshes: dict[str, Mesh], folder: Path, mu: float, turned: float) -> np.ndarray:
    """(COUNT,) complex angular frequencies, rad/s, of the disc turned by an angle (rad) under the pin."""
    mesh = together(**meshes)
    back = "".join(f"{k + 1},\n" for k in mesh.face_points("pin_z1"))
    text = deck(mesh, held="disc_x0") + f"*NSET, NSET=BACK\n{back}*BOUNDARY\nBACK, 1, 3\n"
    text += surface(mesh, "pin_z0", "SLAVE") + surface(mesh, "disc_track", "MASTER")
    text += f"*SURFACE INTERACTION, NAME=RUBS\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n{STIFF:.12e}\n"
    more, change = 1.001 * mu, ""  # pressed at the limit, rounding would decide whether a point sticks
    if mu:
        text += f"*FRICTION\n{more:.12e}, {1e-5 * STIFF:.12e}\n"
        change = f"*CHANGE FRICTION, INTERACTION=RUBS\n*FRICTION\n{mu:.12e}, {1e-5 * STIFF:.12e}\n"
    text += "*CONTACT PAIR, INTERACTION=RUBS, TYPE=SURFACE TO SURFACE\nSLAVE, MASTER\n"
    text += "*STEP, INC=1000\n*STATIC\n0.1, 1., 1.e-5, 0.1\n"
    text += "*CONTROLS, PARAMETERS=FIELD\n1.e-9, 1.e-9, 1.e-9, , 1.e-9\n"
    text += f"*BOUNDARY\nBACK, 3, 3, {-PRESSED:.12e}\n"
    for k in mesh.face_points("disc_x0"):
        x, y, _ = turned * mesh.points[k]
        text += f"{k + 1}, 1, 1, {-y:.12e}\n{k + 1}, 2, 2, {x:.12e}\n"
    text += f"*END STEP\n*STEP, PERTURBATION\n{change}*FREQUENCY\n{COUNT}\n*END STEP\n"
    dat = run(folder, text)
    if not mu:
        return frequencies(dat).astype(complex)
    found = table(dat, "E I G E N V A L U E   O U T P U T", 4)
    return found[:, 1] + 1j * found[:, 3]


@pytest.fixture(scope="module")
def bases(meshes: dict[str, Mesh]) -> dict[str, ModalBasis]:
    """Both bodies with all the modes they have but a few of the highest."""
    found = {}
    for (name, held), face in zip(HELD, ("track", "z0"), strict=True):
        mesh = meshes[name]
        free = 3 * (mesh.n_points - len(mesh.face_points(held)))
        settings = body(
            name=name, supports=[{"face": held}], modes={"count": free - 8}, reduction="craig-bampton",
            interfaces=[{"name": "rubs", "face": face}], output={"patch_shapes": True},
            rotation={"axis": [0, 0, 1], "point": [0, 0, 0]},
            monitors=[{"name": "read", "point": mesh.points[-1].tolist()}],
        )  # fmt: skip
        found[name] = modal_basis(mesh, settings)
    return found


def ours(bases: dict[str, ModalBasis], mu: float) -> Spectrum:
    area = bases["pin"].groups[0, 0].interfaces["rubs"].areas.sum()
    contact = {
        "interface": "pin:rubs", "against": "disc:rubs", "patch": "nodal", "normal_force": 0.5 * STIFF * PRESSED * area,
        "normal_stiffness": STIFF * area, "tangential_stiffness": 1.0, "includes": "surface", "friction": mu,
        "law": {"kind": "rate", "slope": 1e9}, "ground": {"rpm": 1e6, "inertia": False},
    }  # fmt: skip
    case = {
        "name": "pin-on-disc", "bodies": [{"name": "disc"}, {"name": "pin"}], "damping": "modal",
        "contacts": [contact], "monitors": [{"monitor": "disc:read", "direction": "z"}],
        "stability": {"frequency": [0.0, 7300.0]},
    }  # fmt: skip
    assembly = build(case_model().model_validate(case), bases).assembly
    equations = sliding.of(assembly)
    return spectrum(State(assembly, equations, sliding.equilibrium(equations)).matrices, WINDOW)


def apart(theirs: np.ndarray, s: np.ndarray) -> float:
    """Largest distance of a root of theirs, exp(i omega t), from the nearest of ours, over its size; the one that
    decays has the frequency of the one that grows."""
    mine = np.concatenate([-1j * s, (-1j * s).conj()])
    return float(max(np.abs(mine - w).min() / abs(w) for w in theirs))


def test_frequencies_of_the_pair_without_friction(meshes, bases, tmp_path):
    """Normal springs alone: 6e-7."""
    theirs, found = by_calculix(meshes, tmp_path, 0.0, TURNED), ours(bases, 0.0)
    assert found.complete and len(found.roots) == COUNT and "unstable" not in found.verdict
    assert apart(theirs, found.roots.s) < 1e-6


def test_complex_frequencies_with_friction(meshes, bases, tmp_path):
    """All roots to 4e-6 of their size, the growth rate of the one that grows, 182 1/s at 3913 Hz, to 4e-5; this falls
    with the way that the disc is turned by."""
    found = ours(bases, 0.4)
    assert found.complete and len(found.roots) == COUNT and found.verdict.count("unstable") == 1
    grows = found.growth.max()
    assert grows == pytest.approx(182.4, abs=0.1)
    assert apart(by_calculix(meshes, tmp_path, 0.0, TURNED), found.roots.s) > 1e-3
    one, far = (by_calculix(meshes, tmp_path, 0.4, turned) for turned in (TURNED, 10 * TURNED))
    assert apart(one, found.roots.s) < 1e-5
    assert np.abs(one.imag).max() == pytest.approx(grows, rel=1e-4)
    assert np.abs(far.imag).max() - grows > 5 * abs(np.abs(one.imag).max() - grows)
