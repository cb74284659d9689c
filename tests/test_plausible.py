"""Numbers in a wrong unit are doubted, each by one rule, with the likely cause; usual ones are not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import small
from test_case_contacts import STIFF, made, table

from microslip import plausible
from microslip.case.assemble import build
from microslip.case.headline import bent_by, doubted
from microslip.contact.hertz import Hertz
from microslip.contact.solids import Solid
from microslip.contact.study import study
from microslip.data import ModalBasis


@pytest.mark.parametrize("value, unit", [(2.1e5, "MPa"), (210.0, "GPa"), (2.1e14, ""), (2.1e11, None), (3e9, None)])
def test_modulus(value: float, unit: str | None) -> None:
    told = plausible.modulus("material.young", value)
    assert (told == "") == (unit is None)
    assert not unit or unit in told


@pytest.mark.parametrize("value, unit", [(7.85, "g/cm3"), (7.85e-9, "t/mm3"), (7850.0, None), (500.0, None)])
def test_density(value: float, unit: str | None) -> None:
    told = plausible.density("material.density", value)
    assert (told == "") == (unit is None)
    assert not unit or unit in told


def test_amplitude_beside_the_size_of_the_body() -> None:
    """33 mm at the tip of an airfoil of 86 mm are no small vibration, 4 mm are."""
    assert "33 mm" in plausible.amplitude("The tip", 33e-3, 86e-3) and not plausible.amplitude("The tip", 4e-3, 86e-3)


@pytest.mark.parametrize("load, doubted", [(1e5, False), (5e6, True)])
def test_pressure_of_a_wheel_on_a_rail(load: float, doubted: bool) -> None:
    """A wheel of 0.46 m on a rail of 0.3 m under 100 kN has 1.1 GPa; 4.5 GPa no steel carries."""
    steel = Solid(2.1e11, 0.28)
    pressure = float(Hertz(steel, steel, 0.5 / 0.46, 0.5 / 0.3).pressure(load, 0.0, 0.0))
    assert 1e9 < pressure < 5e9 and bool(plausible.stress("The patch", pressure, 2.1e11)) == doubted


@pytest.mark.parametrize("load, radius, doubted", [(80.0, 0.46, True), (8e4, 0.46, False), (100.0, 0.05, False)])
def test_a_load_in_kilonewtons(load: float, radius: float, doubted: bool) -> None:
    assert bool(plausible.wheel_load(load, radius)) == doubted


@pytest.mark.parametrize("young, doubted", [(2.1e11, False), (2.1e5, True)])
def test_a_contact_file_in_megapascals(tmp_path: Path, young: float, doubted: bool) -> None:
    """The layer under a contact, whose modulus nobody doubted."""
    file = tmp_path / "contact.toml"
    file.write_text(
        f'name = "layer"\n[stiffness]\nkind = "layer"\nyoung = {young}\npoisson = 0.3\nthickness = 1e-3\narea = 1e-4\n'
    )
    said = [text for text in study(file).sentences if "stiffness.young" in text]
    assert bool(said) == doubted and (not doubted or "MPa" in said[0])


def test_a_strained_gauge() -> None:
    assert plausible.strain("Gauge 'root'", 0.03) and not plausible.strain("Gauge 'root'", 1e-3)


def heavier(by: float) -> ModalBasis:
    """The small beam, its frequencies by a factor."""
    basis = small.basis()
    g = basis.groups[0, 0]
    return replace(basis, groups={(0, 0): replace(g, omega=by * g.omega, K_r=by**2 * g.K_r)})


@pytest.mark.parametrize("factor, doubted", [(1.0, False), (1e-5, True), (1e4, True)])
def test_first_frequency(factor: float, doubted: bool) -> None:
    assert bool(plausible.of_basis(heavier(factor), {})) == doubted


def test_a_static_stress_that_no_metal_bears() -> None:
    """A load in kN where N were meant: of steel 2.6 GPa are the bound."""
    steel = replace(small.basis(), provenance={"settings": '{"material": {"young": 2.1e11}}'})
    (said,) = plausible.of_basis(steel, {"static state at 0 rpm": 18.7e9})
    assert "static state at 0 rpm" in said and "load (N)" in said
    assert not plausible.of_basis(steel, {"static state at 0 rpm": 1e9})


def test_a_case_doubts_its_amplitude_and_the_pressure_of_its_contacts() -> None:
    """A resonance of 1 mm, 200 N in the contact: nothing is said. Of 20 mm on a body of 120, of 200 MN: both are."""
    basis = replace(small.basis(), provenance={"settings": '{"material": {"young": 2.1e11}}'})
    built = build(made(table(**STIFF, includes="surface")), {"small": basis})
    assert plausible.modulus_of(basis) == 2.1e11
    assert doubted(built, 1e-3, 200.0) == []
    amplitude, pressure = doubted(built, 2e-2, 2e8)
    assert "20 mm" in amplitude and "% of the modulus" in pressure


@pytest.mark.parametrize("newtons, doubted_by", [(50.0, 0), (2e4, 1), (5e4, 2)])
def test_a_load_in_the_wrong_unit_is_doubted_far_from_any_resonance(newtons: float, doubted_by: int) -> None:
    """50 N bend a bar of 20 x 30 x 120 mm by 4 um, whatever is looked at; 50 kN by 4 mm, and break it. Euler and
    Bernoulli: F L^3 / (3 E I) along each axis and M c / I of both at the root; 2 % of shear, and 10 % of
    the stress in the singular zone that does not count."""
    steel = replace(small.basis(), provenance={"settings": '{"material": {"young": 2.1e11}}'})
    group = steel.groups[0, 0]
    bent = bent_by(group, newtons * group.excitations["shaker"].rows[0])
    (b, h, L), F = small.SIZE, newtons * np.array([1.0, 2.0]) / np.sqrt(5)
    inertia, edge = np.array([h * b**3, b * h**3]) / 12, np.array([b, h]) / 2
    assert bent.distance == pytest.approx(np.linalg.norm(F * L**3 / (3 * 2.1e11 * inertia)), rel=0.03)
    assert bent.stress == pytest.approx((F * L * edge / inertia).sum(), rel=0.15)
    raw = table(**STIFF, includes="surface") | {"amplitude": newtons}
    said = doubted(build(made(raw), {"small": steel}), 0.0)
    assert len(said) == doubted_by and all("under its load held still" in text for text in said)
