"""Answers check themselves: energy, read-outs, tables; why points fail; coarse sweeps and fine ones agree."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_harmonic_balance_time import cantilever, group, held
from test_nonlinear_modes import sliding
from test_response_stage import CASE, SAMPLES, respond

from microslip.basis import read_basis
from microslip.cli import main
from microslip.contact.friction import Coulomb
from microslip.contact.law import value
from microslip.contact.normal import Penalty
from microslip.contact.point import PointContact
from microslip.continuation import Settings
from microslip.harmonic_balance import envelope, peak, reduced, response, solver
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance.nonlinear_modes import REACHED, backbone
from microslip.harmonic_balance.solver import solve
from microslip.results import Response, read_response, write_response
from microslip.results.checks import COUNTED, cause, check_response, largest, sentence
from microslip.stages import response as making
from microslip.stages.surveying import _worst_sentences
from microslip.verbs.backbone import unreached

pytestmark = pytest.mark.usefixtures("undrawn")

CLOSED = CASE.replace('law = "smooth"\npoints = [2, 2]', 'law = "jenkins"')


@pytest.fixture(scope="module", params=["jenkins", pytest.param("smooth", marks=pytest.mark.slow)])
def answered(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """The folder of a case, and what was told."""
    folder = tmp_path_factory.mktemp("checks")
    shutil.copy(SAMPLES / "basis.h5", folder)
    (folder / "case.toml").write_text(CLOSED if request.param == "jenkins" else CASE)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(making, "_can_draw", lambda: "not in this test")
        told, converged = respond(folder, "sweep.points=3")
    assert converged
    return folder, told


def spoilt(found: Response, name: str, change: Callable[[np.ndarray], np.ndarray]) -> Response:
    """With an array of its first series changed."""
    s = found.series[0]
    return replace(found, series=(replace(s, arrays={**s.arrays, name: change(s.arrays[name].copy())}),))


def test_a_response_says_what_it_is_worth(
    answered: tuple[Path, list[str]], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, told = answered
    monkeypatch.chdir(folder)
    file = folder / "build/vane/response.h5"
    found = read_response(file)
    s, said = found.series[0], sentence(found, found.estimated)
    assert [t for t in told if t.startswith("checked: ")] == [said]
    assert "points converged" in said and "were added" in said and found.estimated is not None
    assert np.abs(s.arrays["checks/balance"]).max() < 1e-8 and s.arrays["checks/motion"].max() < 1e-8
    assert 0 < np.abs(s.arrays["checks/counted"]).max() < COUNTED
    assert main(["check", str(file)]) == 0
    out = capsys.readouterr().out
    assert "monitors probe against the modal file" in out and "table of resonances" in out and said in out


WRONG: dict[str, tuple[str, Callable[[np.ndarray], np.ndarray]]] = {
    "a read-out of another phase": ("monitors/probe", np.conj),
    "a read-out in other units": ("monitors/probe", lambda a: 1e3 * a),
    "energy on a contact": ("contacts/right/dissipated", lambda a: 2 * a),
    "energy supplied": ("supplied", lambda a: 1.01 * a),
    "damping left out": ("damped", lambda a: 0 * a),
    "coordinates of the body": ("bodies/vane-eigenmodes/q", lambda a: a[..., ::-1]),
    "forces of the wrong sign": ("contacts/right/force", lambda a: -a),
    "another motion of the contact": ("contacts/right/displacement", lambda a: a[..., [0, 2, 1]]),
    "a number that is none": ("contacts/right/open", lambda a: a * np.nan),
    "contacts that take more than they count": ("checks/counted", lambda a: a + 0.06),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_response_fails_its_check(what: str, answered: tuple[Path, list[str]]) -> None:
    sound = read_response(answered[0] / "build/vane/response.h5")
    bases = dict.fromkeys(sound.bodies, read_basis(answered[0] / "basis.h5"))
    assert all(c.passed for c in check_response(sound, bases))
    assert not all(c.passed for c in check_response(spoilt(sound, *WRONG[what]), bases))


def test_a_table_of_another_curve_fails_its_check(
    answered: tuple[Path, list[str]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sound = read_response(answered[0] / "build/vane/response.h5")
    (row, *_) = sound.resonances
    key = next(k for k in row if k.startswith("amplitude"))
    write_response(tmp_path / "response.h5", replace(sound, resonances=({**row, key: 1.001 * row[key]},)))
    assert main(["check", str(tmp_path), "--short"]) == 1
    shown, error = capsys.readouterr()
    assert "FAIL normal force 50 N: table of resonances" in shown and "1 of" in error


@pytest.mark.parametrize("what", ["supplied", "damped", "read-out"])
def test_a_wrong_solution_is_not_called_converged(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The work of the loads, the loss in the bodies, or their coordinates wrong by a tenth of a percent."""
    work, modal = reduced.work, balance.AtFrequency.modal
    if what == "read-out":
        more = lambda self, *given: [[1.001 * q for q in row] for row in modal(self, *given)]  # noqa: E731
        monkeypatch.setattr(balance.AtFrequency, "modal", more)
        monkeypatch.setattr(reduced, "work", lambda part, Omega, h, q, *rest: work(part, Omega, h, q / 1.001, *rest))
    else:
        missing = 1e-3 * (np.arange(4) == ("supplied", "damped").index(what))
        monkeypatch.setattr(reduced, "work", lambda *given: tuple(np.array(work(*given)) + missing * work(*given)[0]))
    problem = balance.of(cantilever(), 1, 64, length=0.0125)
    found = response.harmonic_response(problem, np.array([0.6]))
    assert [cause(status) for status in found.status] == ["read-out" if what == "read-out" else "energy"]


def test_too_few_samples_are_no_convergence() -> None:
    """Of eight samples of a cycle the work is not what friction takes; of 64 it is to half a percent."""
    counted = []
    for samples in (8, 64):
        problem = balance.of(cantilever(), 1, samples, length=0.0125)
        found = response.harmonic_response(problem, np.array([0.62]))
        counted.append(float(np.abs(found.counted).max()))
        assert found.converged.all() == (counted[-1] <= COUNTED)
    assert counted[0] > COUNTED and counted[1] < 0.005


def test_peaks_and_modes_are_checked_as_points_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is climbed to or followed over the amplitude: eight samples of a cycle are too few, 64 are not."""
    for samples, few in ((8, True), (64, False)):
        mode = backbone(sliding(samples=samples), 5e-5, 6e-5, settings=Settings(step=0.2, folds=False))
        assert ("energy" in mode.failing) == few != mode.complete and mode.status == REACHED
        assert ("ends early" in unreached({1.0: mode})) is False and bool(unreached({1.0: mode})) == few
        assert (abs(largest(mode.checks).counted) > COUNTED) == few
    problem, band = sliding(samples=64, force=2.0), np.linspace(90.0, 180.0, 9)
    assert peak.highest(problem, band)[0].converged
    work = reduced.work
    monkeypatch.setattr(reduced, "work", lambda *given: tuple(np.array(work(*given)) * [1.001, 1.0, 1.0, 1.0]))
    found, _, _ = peak.highest(problem, band)
    said = "not found: 11 of 11 points did not converge, first at 14.3239 Hz: energy"  # two of them added
    assert not found.converged and found.status.startswith(said)
    orders = envelope.over_orders(lambda order: problem, [1], (90.0 / 2 / np.pi, 180.0 / 2 / np.pi), 9)
    assert orders.missing[0] == found.status and orders.lost.all()
    assert "No resonance" not in " ".join(said := _worst_sentences([orders]))
    assert said[-1] == f"engine order 1: {found.status}."


def test_why_a_point_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """Newton's method at its limit, and of contacts that stay apart."""
    one = np.ones(1)
    rows = {"face": np.outer([1, 0, 0, 0, 0, 0], one), "push": one, "tip": one}
    law = PointContact(Penalty(value(1.0)), Coulomb(value(0.3)), value(1.0))
    gaping = held(group(one, rows, 0.025), law, [0], np.zeros(1), np.array([-1e3]), 0.3)
    newton = solver.newton
    monkeypatch.setattr(solver, "newton", lambda *a, **k: replace(newton(*a, **k), status="60 steps"))
    for assembly, why in ((gaping, "gaping contacts"), (cantilever(), "iteration limit")):
        problem = balance.of(assembly, 5, 128, length=0.0125)  # as in test_families: one program
        status = solve(problem, 2 * np.pi * 0.5, []).status
        assert status == f"{why}: 60 steps"


@pytest.mark.usefixtures("unjudged")
@pytest.mark.parametrize("law", [pytest.param("smooth", marks=pytest.mark.slow), "jenkins"])
def test_a_coarse_sweep_and_a_fine_one_print_the_same_resonances(
    law: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of three and of 61 points, of which none of the three is near a resonance: to a thousandth."""
    shutil.copy(SAMPLES / "basis.h5", tmp_path)
    (tmp_path / "case.toml").write_text(CASE if law == "smooth" else CLOSED)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(making, "_can_draw", lambda: "not in this test")
    tables = []
    for points in (3, 61):
        assert respond(tmp_path, f"sweep.points={points}", "sweep.start=250", "sweep.stop=450")[1]
        rows = read_response(tmp_path / "build/vane/response.h5").resonances
        tables.append([[v for k, v in row.items() if k.startswith(("frequency", "amplitude"))] for row in rows])
    assert len(tables[0])
    np.testing.assert_allclose(*tables, rtol=1e-3)
    table = np.genfromtxt(tmp_path / "build/vane/response.csv", delimiter=",", names=True)
    tops = [np.nanmax(table[name]) for name in table.dtype.names if name.startswith("amplitude_m")]
    assert table["asked"].sum() == 61
    np.testing.assert_allclose(max(tops), max(row[1] for row in tables[1]), rtol=1e-8)
