"""What a read-out measures has one name, in whatever table it stands."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from small import basis as small_basis

import microslip as ms
from microslip.case.curves import Followed
from microslip.harmonic_balance.envelope import Envelope, OverOrders
from microslip.harmonic_balance.readout import measured
from microslip.pictures.response import _driven_by
from microslip.system.assembly import Assembly, Output
from microslip.system.component import Component
from microslip.units import METRES, Quantity, amplitude_of, counted, percent

STRAIN = Quantity("1")


@pytest.mark.parametrize(("unit", "column", "micro"), [
    ("m", "amplitude_m", "µm"), ("rad", "amplitude_rad", "µrad"), ("1", "amplitude_strain", "µm/m"),
])  # fmt: skip
def test_names_and_back(unit: str, column: str, micro: str) -> None:
    of = Quantity(unit)
    assert of.column("amplitude") == column and of.scale(1e-4) == (1e6, micro)
    assert amplitude_of({"frequency_Hz": 1.0, column: 3.0, "stress_amplitude_Pa": 7.0}) == (3.0, of)


def test_shares_and_numbers_in_words() -> None:
    assert [percent(share) for share in (0.00742, 0.05, 7.42)] == ["0.74 %", "5 %", "740 %"]
    assert (counted(1, "harmonic"), counted(3, "harmonic")) == ("1 harmonic", "3 harmonics")


def test_what_an_assembly_reads() -> None:
    """By the row: a gauge's strain, a monitor's metres; nothing read is in metres."""
    component = Component("beam", {0: small_basis().groups[0, 0]})
    probe, gauge = Output("beam", "tip-probe", "u_x"), Output("beam", "root", "strain")
    a = Assembly((component,), (), (), (probe, gauge))
    assert measured(a) == METRES and measured(a, 1) == STRAIN
    assert measured(replace(a, outputs=(gauge, probe))) == STRAIN and measured(replace(a, outputs=())) == METRES


def test_tables_of_surveys_and_curves() -> None:
    """No column of a strain is one of metres."""
    one, ok = np.ones(1), np.ones((1, 1), dtype=bool)
    row = {"parameter": 1.0, "fold": 0, "gauges/root": np.ones((1, 2), dtype=complex)}
    tables = [
        OverOrders(*8 * [one], quantity=STRAIN).columns(),
        Envelope(one, ("load",), one[None], one[None], ok, one[None], quantity=STRAIN).columns(),
        Envelope(one, ("load",), one[None], one[None], ok, one[None], quantity=STRAIN).corners(),
        Followed("frequency", 1.0, None, (1.0, 2.0), "", (row,), "bound", STRAIN).columns(),
    ]
    for columns in tables:
        assert any(name.endswith("_strain") for name in columns) and not any(name.endswith("_m") for name in columns)


def test_each_read_out_of_two_tones_has_its_own_unit() -> None:
    """A displacement beside a strain is none."""
    case = {
        "body": "vane", "modes": 2, "contacts": [], "monitors": [{"monitor": "root"}, {"monitor": "probe"}],
        "excitations": [{"row": "magnet"}, {"row": "magnet", "tone": 2}],
    }  # fmt: skip
    found = ms.two_tones(ms.assemble(case, vane=ms.sample()), [500.0], second=707.3, harmonics=1)
    assert found.units == ("1", "m") and "amplitude_m" in found.columns(1)


@pytest.mark.parametrize(("row", "unit"), [("gas", "Pa"), ("shaker", "N")])
def test_the_picture_of_a_response_tells_the_unit_of_its_load(row: str, unit: str) -> None:
    """A pressure is none in newtons."""
    case = {"body": "small", "excitation": row, "amplitude": 20.0, "monitor": "tip-probe", "contacts": []}
    built = ms.assemble(case, small=small_basis())
    assert _driven_by(SimpleNamespace(settings=built.settings, built=built)) == f" to 20 {unit} at {row}"


def test_a_nonlinear_mode_tells_its_progress_in_the_unit_of_its_read_out() -> None:
    """A strain is none in metres."""
    rub = {"interface": "right", "normal_stiffness": 2e6, "tangential_stiffness": 4e6, "includes": "bulk+surface"}
    rub |= {"law": "jenkins", "friction": 0.2, "points": [1, 1], "normal_force": 20.0}
    case = {"body": "vane", "excitation": "magnet", "modes": 2, "contacts": [rub], "monitor": "root", "harmonics": 1}
    told = list[str]()
    found = ms.backbone(ms.assemble(case, vane=ms.sample()), 1e-7, 1.2e-7, report=told.append)
    assert found.quantity == STRAIN and told[-1].endswith(" nm/m") and not any(t.endswith(" m") for t in told)
