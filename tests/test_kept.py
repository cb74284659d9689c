"""Sweeps that are interrupted and go on; what is kept of a point says the same as the point."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small import beam, table
from test_assembly import FINE, sector

from microslip.body import BodySettings
from microslip.compliance import statics_beside
from microslip.coordinates import in_modes
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance import response
from microslip.harmonic_balance.kept import beside, kept_response, labels, record, restored
from microslip.harmonic_balance.solver import solve
from microslip.modes import modal_basis
from microslip.operating import motion_of
from microslip.operating.motion import displacement, nearest_point
from microslip.results import open_journal, response_of
from microslip.system.assembly import Assembly, Load, Member, Side, Watch, touching

FREQUENCY = np.linspace(180.0, 270.0, 16)
SERIES = "normal force 20 N"
HEAD = {"case": "ring", "parameters": {SERIES: {"normal_force": 20.0}}}


class Stop(Exception):
    pass


@pytest.fixture(scope="module")
def problem() -> balance.Problem:
    return balance.of(sector(6, 1, push=0.5), **(FINE | {"harmonics": 1, "samples": 24}))


@pytest.mark.slow
def test_an_interrupted_sweep_goes_on_where_it_was(problem: balance.Problem, tmp_path: Path) -> None:
    """Stopped three times, each point is computed once; the response is that of one go, to the solver's 1e-10."""
    told: list[str] = []

    def impatient(text: str) -> None:
        told.append(text)
        if len(told) in (5, 9, 18):
            raise Stop

    for _ in range(4):
        with open_journal(tmp_path / "points", "abc", HEAD) as journal:
            try:
                found, peaks = kept_response(problem, FREQUENCY, np.ones(1), journal, SERIES, impatient)
            except Stop:
                continue
    whole = response.harmonic_response(problem, FREQUENCY, np.ones(1))
    computed = [t for t in told if "frequencies" in t]
    assert len(computed) == len(FREQUENCY) + 3  # the three that were under way are begun once more, no other
    assert list(dict.fromkeys(computed)) == [f"{i + 1} of 16 frequencies: {f:.6g} Hz" for i, f in enumerate(FREQUENCY)]
    for name in ("harmonics", "contact", "slip", "dissipated", "supplied", "slipping", "open"):
        a, b = getattr(found, name), getattr(whole, name)
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-7 * np.abs(b).max(), err_msg=name)
    np.testing.assert_allclose(peaks, response.refined_peaks(problem, whole), rtol=1e-6)
    assert found.converged.all() and len(peaks) == 1 and found.slipping.max() > 0.2


def test_nothing_is_computed_twice_and_a_wider_sweep_adds_to_it(problem: balance.Problem, tmp_path: Path) -> None:
    told: list[str] = []
    for frequency in (FREQUENCY[::3], FREQUENCY[::3], FREQUENCY):
        with open_journal(tmp_path / "points", "abc", HEAD) as journal:
            kept_response(problem, frequency, np.ones(1), journal, SERIES, told.append)
    computed = [t.split(": ")[1] for t in told if "frequencies" in t]
    assert sorted(computed) == sorted(f"{f:.6g} Hz" for f in FREQUENCY)


def test_what_is_kept_is_the_point(problem: balance.Problem) -> None:
    point = solve(problem, 2 * np.pi * 60.0, [])
    found = response.operating(problem, point)
    again, same = restored(problem, record(problem, point, found))
    assert again.Omega == pytest.approx(point.Omega, rel=1e-15) and again.status == point.status
    np.testing.assert_array_equal(again.x, point.x)
    np.testing.assert_array_equal(same.watched, found.watched)
    assert len(again.history) == point.iterations + 1 and again.history[-1] == point.error
    for a, b in zip(same.q["blade"], found.q["blade"], strict=True):
        np.testing.assert_array_equal(a, b)
    whole = response_of(HEAD, {SERIES: {60.0: record(problem, point, found)}}).one(normal_force=20.0)
    assert labels(problem) == {"monitors/tip": ["u_x"]}
    np.testing.assert_array_equal(whole.monitor("tip")[0], found.watched)


def test_displacement_by_residual_shapes_is_what_the_monitor_reads() -> None:
    """MacNeal: contact forces and excitation on the residual shapes, at the node the monitor stands on, 1e-9.

    The monitor reads through the residual compliance of the rows, the node through shapes of the whole body.
    """
    settings = BodySettings.model_validate(table(reduction="macneal"))
    basis = modal_basis(beam(), settings)
    stored = basis.groups[0, 0]
    assert statics_beside(stored, basis.reduction)
    group = in_modes(stored)
    from test_operating import linear_patch

    patch, _ = linear_patch()
    contact = touching("rub", patch, Side("small", "right"), None, normal=100.0)
    member = Member("small", {0: group}, brings=np.ones(len(group.compliance.labels)))
    watches = tuple(Watch("small", "tip-probe", f"u_{x}") for x in "xyz")
    assembly = Assembly((member,), (contact,), (Load("small", "shaker", 300.0),), watches)
    problem = balance.of(assembly, harmonics=3, samples=64)
    point = solve(problem, 2 * np.pi * 400.0, [])
    assert point.converged
    found = response.operating(problem, point)
    assert 0 < found.cycles["rub"].slipping.mean()
    forces = np.array([beside(problem, member, h, found) for h in range(4)])
    motion = motion_of(point.Omega, np.array(found.q["small"]), group, forces=forces)
    node, away = nearest_point(basis, group.monitors["tip-probe"].point)
    assert away < 1e-12
    read = displacement(motion, node)[0, :, 0].T
    np.testing.assert_allclose(read, found.watched, rtol=0, atol=1e-9 * np.abs(found.watched).max())
    alone = displacement(motion_of(point.Omega, np.array(found.q["small"]), group), node)[0, :, 0].T
    assert np.abs(alone - found.watched).max() > 1e-4 * np.abs(found.watched).max()  # it would be missed
