"""[[masses]], [[springs]] and [[dashpots]] of a body file: closed forms, the same body as a deck, refusals."""

from __future__ import annotations

from pathlib import Path

import decks
import meshes
import numpy as np
import pytest
import scipy.optimize
from refusals import refused_command
from test_lumped import MESH

from microslip.basis import read_basis
from microslip.cli import main

STEEL = "[material]\ndensity = 7830\nyoung = 205e9\npoisson = 0.29\n"


@pytest.fixture(autouse=True)
def there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def body(more, mesh=MESH, name="part", held=True, count=6, free=False, material=STEEL):
    """The modes of a mesh with faces x0, x1, ..., of the block of 60 x 11 x 7 mm if not given."""
    Path(f"{name}.inp").write_text("\n".join(decks.mesh_lines(mesh, sets=("x0", "x1", "z0", "z1"))) + "\n")
    head = f'name = "{name}"\nlength_unit = "mm"\nfree = {str(free).lower()}\n'
    support = '[[supports]]\nface = "x0"\n' if held else ""
    rest = f'[geometry]\nmesh = "{name}.inp"\n{material}{support}{more}[modes]\ncount = {count}\nsolver = "superlu"\n'
    Path(f"{name}.toml").write_text(head + rest)
    assert main(["modes", f"{name}.toml", "-q"]) == 0
    return read_basis(Path(f"build/{name}/basis.h5"))


def hertz(*given, **named) -> np.ndarray:
    return body(*given, **named).groups[0, 0].frequency


RIGID = """
[[masses]]
face = "x1"
centre = [78, 15, 7]
mass = 0.005
inertia = [2e-7, 3e-7, 4e-7, -3e-8, -1e-8, 0]
coupling = "rigid"
[[springs]]
face = "x1"
centre = [75, 14, 9]
stiffness = [100e3, 200e3, 300e3]
rotational = [400, 200, 300]
coupling = "rigid"
"""


DECK = [1492.66513, 1944.90699, 5822.67537, 8381.48015, 10838.525, 19170.9667]
"""Hz, of the same body as bulk data (RBE2, CONM2 with offset, CBUSH, as in test_lumped beside 6 x 6 matrices)."""


def test_what_is_attached_is_what_a_deck_has():
    """A rigid body and a spring with rotational springs at two places beside a face that moves rigidly."""
    np.testing.assert_allclose(hertz(RIGID), DECK, rtol=1e-8)


def test_a_mass_on_the_tip_of_a_beam():
    """Euler and Bernoulli: 1 + cos l cosh l + m l (cos l sinh l - sin l cosh l) = 0, m the mass over that of the
    beam; a slender beam of 1 : 120 is slower by 1e-4 of shear, and Poisson's ratio 0 leaves its clamp alone."""
    L, h, mass = 1.2, 0.01, 0.3
    beam = meshes.brick("hexahedron20", (30, 1, 1), (L, h, 1.5 * h))
    plain = STEEL.replace("0.29", "0")
    on_face = f'[[masses]]\nface = "x1"\nmass = {mass}\n'
    found = hertz(on_face, mesh=beam, count=1, material=plain)
    ratio = mass / (7830 * 1.5 * h * h * L)
    f = lambda l: 1 + np.cos(l) * np.cosh(l) + ratio * l * (np.cos(l) * np.sinh(l) - np.sin(l) * np.cosh(l))  # noqa: E731
    l = scipy.optimize.brentq(f, 0.1, 1.9)
    expected = l**2 / (2 * np.pi * L**2) * np.sqrt(205e9 * h**2 / 12 / 7830)
    np.testing.assert_allclose(found[0], expected, rtol=2e-4)
    at_point = f"[[masses]]\npoint = [1200, 5, 7.5]\nmass = {mass}\n"
    found = hertz(at_point, mesh=beam, count=1, name="other", material=plain)
    np.testing.assert_allclose(found[0], expected, rtol=2e-4)


def test_a_block_on_soft_springs_is_a_rigid_body():
    """f = sqrt(k / m) / 2 pi along x, y, z; grounded springs alone hold it, in the mean of a face and by its centre."""
    mass = 0.06 * 0.011 * 0.007 * 7830 + 0.02
    more = """[[springs]]
face = "x1"
centre = [30, 5.5, 3.5]
stiffness = [10, 20, 30]
rotational = [1e-3, 1e-3, 1e-3]
[[masses]]
face = "x0"
centre = [30, 5.5, 3.5]
mass = 0.02
"""
    found = hertz(more, held=False)
    expected = np.sqrt(np.array([10, 20, 30]) / mass) / 2 / np.pi
    assert all(np.abs(found / f - 1).min() < 1e-5 for f in expected)


def test_a_spring_between_faces_leaves_rigid_motions_free_and_a_dashpot_damps():
    """Between two faces it acts at one place, so it turns with the body; phi^T C phi of the dashpot's own motion."""
    more = '[[springs]]\nface = "z0"\nagainst = "z1"\nstiffness = [1e6, 2e6, 3e6]\n'
    basis = body(more, held=False, count=8, free=True)
    assert (basis.groups[0, 0].frequency[:6] < 1e-2).all() and basis.groups[0, 0].frequency[6] > 100
    basis = body('[[dashpots]]\npoint = [60, 0, 0]\ndirection = [0, 3, 0]\ndamping = 50\n', name="damped")
    g = basis.groups[0, 0]
    phi = g.phi[np.abs(basis.mesh.points - [0.06, 0, 0]).sum(axis=1).argmin(), 1]
    np.testing.assert_allclose(g.C_r, 50.0 * np.outer(phi, phi), rtol=1e-9, atol=1e-9 * 50 * phi.max() ** 2)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('[[masses]]\nface = "gone"\nmass = 1\n', ("masses, number 1", "no face 'gone'")),
        ('[[masses]]\nface = "x1"\nmass = 1\ninertia = [1, 1, 3]\n', ("masses", "no rigid body")),
        ("[[masses]]\npoint = [60, 0, 0]\nmass = 1\ninertia = [1, 1, 1]\n", ("masses", "does not turn")),
        ("[[masses]]\npoint = [600, 0, 0]\nmass = 1\n", ("masses, number 1", "from the body")),
        ("[[masses]]\nmass = 1\n", ("masses", "face", "point")),
        ('[[springs]]\nface = "x1"\nstiffness = 5\n', ("springs", "direction")),
        ('[[springs]]\nface = "x1"\n', ("springs", "no force")),
        ('[[springs]]\nface = "x1"\nagainst = "x1"\nstiffness = [1, 1, 1]\n', ("springs", "itself")),
        ('[[dashpots]]\npoint = [60, 0, 0]\nagainst = "x1"\ndamping = [1, 1, 1]\n', ("dashpots", "ground alone")),
    ],
)
def test_what_cannot_be_attached(capsys, more, words):
    Path("part.inp").write_text("\n".join(decks.mesh_lines(MESH, sets=("x0", "x1"))) + "\n")
    Path("part.toml").write_text(
        f'name = "part"\nlength_unit = "mm"\n[geometry]\nmesh = "part.inp"\n{STEEL}[[supports]]\nface = "x0"\n{more}'
    )
    refused_command(["modes", "part.toml"], capsys, "part.toml", *words)
