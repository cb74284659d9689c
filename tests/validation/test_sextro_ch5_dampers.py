"""Sextro, Dynamical Contact Problems with Friction, 2nd ed., sections 5.4 and 5.5: underplatform dampers, damping
element and damping wire, by the book's own method (5.2) on the case files.

The book prints numbers of blades, engine orders, masses and the bore's radius, no lengths, stiffnesses or amplitudes.
What is tested is what it says about the curves: where they have a minimum, and which way resonances move. Bodies are
meshed coarsely; docs/dampers.md has the numbers of the default meshes.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from microslip.case.problem import problem_of
from microslip.data import ModalBasis
from microslip.harmonic_balance.response import operating
from microslip.harmonic_balance.solver import solve
from microslip.modal.compute import modal_basis
from microslip.stages.job import open_job
from microslip.stages.meshing import load_mesh, mesh_stage

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "docs"))
import damper_study as study  # noqa: E402

pytestmark = pytest.mark.skipif(importlib.util.find_spec("gmsh") is None, reason="gmsh is not installed")

COARSE = {
    "pit-blade": ("pit-blade", "mesh.size=16", "mesh.local={contact_left=4, contact_right=4}"),
    "damper": ("damper", "mesh.size=5"),
    "damper-cylinder": ("damper/cylinder.toml", "mesh.size=5"),
    "pin": ("pin", "mesh.size=4"),
    "pin-blade": ("pin-blade", "mesh.size=25", "mesh.local={contact_left=3, contact_right=3}"),
    "wire": ("wire", "mesh.size=16", "modes.count=24"),
    "wire-blade": ("wire-blade", "mesh.size=20"),
}


@pytest.fixture(scope="module")
def bases(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], ModalBasis]:
    folder = tmp_path_factory.mktemp("bases")

    @cache
    def basis(name: str) -> ModalBasis:
        where, *changes = COARSE[name]
        job = open_job(ROOT / "geometry" / where, [*changes, "output.gauss=false", "output.nodal_stress=false"], folder)
        mesh_stage(job)
        return modal_basis(load_mesh(job)[0], job.settings)

    return basis


# ---------------------------------------------------------------- spin pit, 5.4


@pytest.mark.slow
@pytest.mark.parametrize("shape", [pytest.param("cottage-roof", marks=pytest.mark.slow), "cylinder"])
def test_strain_over_damper_mass_has_a_minimum_and_the_resonance_rises(bases, shape: str) -> None:
    """Fig. 5.4-4: a heavier damper presses harder, the resonance rises; the strain falls, then rises with the mass."""
    masses = (0.008, 0.0259, 0.0418, 0.117) if shape == "cottage-roof" else (0.0259, 0.075, 0.117, 0.3)
    frequency = np.linspace(104, 160, 29)
    found = [study.under_platforms(shape, m, bases, frequency, finer=1)[1] for m in masses]
    assert all(c.converged.all() for c in found)
    at, strain = np.array([c.largest(study.bending) for c in found]).T
    assert (np.diff(at) >= 0).all() and at[-1] > at[0] + 10
    assert strain[0] > 3 * strain.min() and strain[-1] > 1.5 * strain.min()
    assert 0 < strain.argmin() < len(masses) - 1


def test_twice_the_force_on_twice_the_mass_is_twice_the_strain(bases) -> None:
    """Springs that cannot pull and Coulomb friction know no scale of their own: only the force over the normal force
    matters, so the choice of 20 N moves the optimal mass and nothing else. Same frequency, same inertia; 1e-8."""
    found = []
    for share in (1.0, 2.0):
        built = study.opened("spin-pit-cottage-roof", bases, f"bodies.damper.pressed_at_rpm={2700 * share**0.5}")
        problem = problem_of(built, None).loaded(share)
        point = solve(problem, 2 * np.pi * 140.0, [])
        assert point.converged
        found.append(operating(problem, point).outputs[0, 1])
    assert found[1] == pytest.approx(2 * found[0], rel=1e-8)


def test_normal_force_of_a_damper_is_its_centrifugal_force_over_the_roof(bases) -> None:
    """m r Omega^2 / (2 sin 45 degrees) on either platform, twice as much with twice the mass; 1e-6 of the coarse mesh's
    own symmetry."""
    body = bases("damper-cylinder")
    for mass in (0.0418, 0.0836):
        built = study.opened("spin-pit-cylinder", bases, f"bodies.damper.mass={mass}")
        force = mass * np.hypot(*(body.centre - body.rotation_point)[[0, 2]]) * (2700 * np.pi / 30) ** 2
        pressed = [c.normal_force for c in built.contacts]
        np.testing.assert_allclose(pressed, force / (2 * np.sin(np.pi / 4)), rtol=1e-3)


# ---------------------------------------------------------------- damping element, 5.5


@pytest.fixture(scope="module")
def element(bases):
    built = study.opened("damping-element", bases)
    frequency = np.concatenate([np.linspace(16, 34, 13), np.linspace(40, 184, 25)])
    return study.over_forces(built, (20.0, 50.0, 70.0, 100.0, 400.0), frequency, finer=1)


@pytest.mark.slow
def test_bending_and_torsion_have_their_minimum_at_about_the_same_normal_force(element) -> None:
    """Fig. 5.5-6b, c: within a factor of two, between the softest and the hardest coupling tried."""
    best = [study.optimum(element, pick) for pick in (study.bending, study.torsion)]
    assert all(20 < force < 400 for force, *_ in best)
    assert 0.5 <= best[0][0] / best[1][0] <= 2
    for pick, (_, _, least) in zip((study.bending, study.torsion), best, strict=True):
        assert element[20.0].largest(pick)[1] > 5 * least and element[400.0].largest(pick)[1] > 1.5 * least


@pytest.mark.slow
def test_coupling_raises_the_resonance_with_the_normal_force(element) -> None:
    """Fig. 5.5-7b: by increasing the normal force the coupling is increased, and the resonance frequency with it."""
    assert all(c.converged.all() for c in element.values())
    at = [c.largest(study.bending)[0] for c in element.values()]
    assert (np.diff(at) > 0).all()


@pytest.mark.slow
def test_resonances_rise_with_the_engine_order_up_to_three(bases) -> None:
    """Fig. 5.5-7: sticking pins, engine orders 0 to 3. Beyond, the book goes on rising and this ring does not."""
    built = study.opened("damping-element", bases)
    at = [study.sticking(problem_of(study.of_order(built, e), 100.0))[0] for e in range(4)]
    assert (np.diff(at) > 20).all()


# ---------------------------------------------------------------- damping wire, 5.5


@pytest.mark.slow
def test_first_resonance_of_the_wired_blades_has_an_optimal_normal_force(bases) -> None:
    """Fig. 5.5-8b: seven blades on an elastic wire with its rigid motions."""
    built = study.opened("damping-wire", bases)
    wire = built.bodies["wire"].group
    assert list(wire.kind[:6]) == ["rigid"] * 6
    curves = study.over_forces(built, (10.0, 50.0, 1000.0), np.linspace(64, 82, 19), finer=1)
    assert all(c.converged.all() for c in curves.values())
    soft, best, hard = (c.largest(study.bending)[1] for c in curves.values())
    assert soft > 3 * best and hard > 3 * best
