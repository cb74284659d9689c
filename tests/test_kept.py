"""Sweeps that are interrupted and go on; what is kept of a point says the same as the point."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from small import beam, table
from test_assembly import FINE, sector
from test_curves import CASE, lifting
from test_harmonic_balance_time import Cubic, cantilever, group, held
from test_refinement import Brittle, spring

from microslip.case import load_case
from microslip.case.assemble import build
from microslip.case.edges import rising
from microslip.case.problem import problem_of
from microslip.contact.friction import Coulomb
from microslip.contact.law import value
from microslip.contact.normal import Preload
from microslip.contact.patch import Patch, grid
from microslip.contact.point import PointContact
from microslip.harmonic_balance import accuracy, checkpoint, response
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance.accuracy import judged
from microslip.harmonic_balance.checkpoint import labels, record, restored, resumed_response
from microslip.harmonic_balance.checks import forces_on
from microslip.harmonic_balance.solver import Point, solve
from microslip.harmonic_balance.sweeps import overhanging
from microslip.modal.compute import modal_basis
from microslip.operating import motion_of
from microslip.operating.motion import displacement, nearest_point
from microslip.reduced.compliance import has_residual
from microslip.reduced.coordinates import in_modes
from microslip.results import open_journal, read_response, response_of
from microslip.settings.body import BodySettings
from microslip.system import Body, Contact, Force, Monitor, Spring, System
from microslip.system.assembly import Assembly, ContactFace, Load, Output, preloaded_contact
from microslip.system.assembly import Contact as Rub
from microslip.system.component import Component

FREQUENCY = np.linspace(180.0, 270.0, 16)
SERIES = "normal force 20 N"
HEAD = {"case": "ring", "parameters": {SERIES: {"normal_force": 20.0}}}


class Stop(Exception):
    pass


@pytest.fixture(scope="module")
def problem() -> balance.Problem:
    return balance.of(sector(6, 1, push=0.5), **(FINE | {"harmonics": 1}))


def free(*resonances: float) -> Assembly:
    """Modes of some resonances (Hz), damping ratio 1 %, pushed with 0.3 and read together, without any contact."""
    one = np.ones(len(resonances))
    rows = {"face": np.zeros((6, len(one))), "push": one, "tip": one}
    body = group(2 * np.pi * np.array(resonances), rows, 0.01)
    return replace(held(body, Cubic(value(0.0)), [1], np.zeros(1), np.zeros(1), 0.3), contacts=())


def pairs(peaks: list[response.Resonance]) -> list[tuple[float, float]]:
    return [(one.frequency, one.amplitude) for one in peaks]


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
                found, peaks = resumed_response(problem, FREQUENCY, journal, SERIES, impatient)
            except Stop:
                continue
    whole = response.filled_response(problem, FREQUENCY)
    computed = [t for t in told if "of 16 frequencies" in t]
    assert len(computed) == len(FREQUENCY) + 3  # the three that were under way are begun once more, no other
    assert list(dict.fromkeys(computed)) == [f"{i + 1} of 16 frequencies: {f:.6g} Hz" for i, f in enumerate(FREQUENCY)]
    for name in ("harmonics", "contact", "slip", "dissipated", "supplied", "slipping", "open"):
        a, b = getattr(found, name), getattr(whole, name)
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-7 * np.abs(b).max(), err_msg=name)
    np.testing.assert_allclose(pairs(peaks), pairs(response.refined_peaks(problem, whole)), rtol=1e-6)
    assert found.converged.all() and len(peaks) == 1 and found.slipping.max() > 0.2


def block(folder: Path) -> balance.Problem:
    """A block that is shaken off the ground, with a quarter of the samples that its landing needs:
    the balance holds at points whose energy does not."""
    (folder / "case.toml").write_text(CASE)
    more = ["harmonics=3", "samples=16", "amplitude=1.0"]
    settings, _ = load_case(folder / "case.toml", more)
    built = build(settings, {"lifting": lifting()})
    return problem_of(built, 10.0)


def brittle(_: Path) -> balance.Problem:
    """An oscillator whose law has no value where it swings by more than a metre."""
    return spring(Brittle(value(0.0)))


@pytest.mark.parametrize(
    ("made", "frequency"),
    [
        (block, np.linspace(90.0, 140.0, 11)),
        pytest.param(brittle, np.linspace(1.1, 1.4, 4) / (2 * np.pi), marks=pytest.mark.slow),
    ],
)
def test_a_sweep_with_points_that_fail_is_the_same_bit_by_bit_after_interrupts(
    made: Callable[[Path], balance.Problem], frequency: np.ndarray, tmp_path: Path
) -> None:
    """Stopped after every point and every search, some points without a solution, some that fail
    their checks: what a point begins with, and what follows from it, is what it is in one go."""
    problem, known, runs = made(tmp_path), set[str](), 0

    def impatient(text: str) -> None:
        if text not in known and known - before:
            raise Stop
        known.add(text)

    def answer(name: str, report: Callable[[str], None]) -> tuple[Any, ...]:
        with open_journal(tmp_path / name, "abc", HEAD) as journal:
            found, peaks = resumed_response(problem, frequency, journal, SERIES, report)
            return found, peaks, journal.of(SERIES)

    whole, tops, rows = answer("whole", lambda _: None)
    assert 0 < np.count_nonzero(~whole.converged) < len(whole.frequency)
    while runs < 60:
        before, runs = frozenset(known), runs + 1
        with contextlib.suppress(Stop):
            found, peaks, again = answer("points", impatient)
            break
    assert runs > 5
    for name, kept in vars(whole).items():
        np.testing.assert_array_equal(getattr(found, name), kept, err_msg=name)
    np.testing.assert_equal([p._asdict() for p in peaks], [p._asdict() for p in tops])
    np.testing.assert_equal(again, rows)


def test_nothing_is_computed_twice(tmp_path: Path) -> None:
    problem, told = balance.of(cantilever(), 1, 64, length=0.0125), list[str]()
    for series in (SERIES, SERIES, "normal force 30 N"):
        with open_journal(tmp_path / "points", "abc", HEAD) as journal:
            resumed_response(problem, np.linspace(0.5, 0.8, 3), journal, series, told.append)
    computed = [t.split(": ")[1] for t in told if " of 3 frequencies" in t]
    assert computed == 2 * ["0.5 Hz", "0.65 Hz", "0.8 Hz"]
    assert len([t for t in told if "a mode between" in t]) == 2


def test_a_peak_on_a_point_of_the_sweep_is_a_point_still(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a climb fails the highest point stands for the peak, under the same key: asked again, all is known."""
    problem, told = balance.of(free(2.2), 1, 16, length=0.01), list[str]()

    def top(problem: balance.Problem, found: response.HarmonicResponse, bracket: tuple[int, int, int]) -> object:
        f, x = found.frequency[bracket[1]], found.x[bracket[1]]
        return Point(2 * np.pi * f, x, "converged", 0.0, 0), float(abs(found.monitor[bracket[1]]))

    monkeypatch.setattr(checkpoint, "highest", top)
    for frequency in 2 * [np.array([2.0, 2.125, 2.25, 2.375])]:
        with open_journal(tmp_path / "points", "abc", HEAD) as journal:
            found, peaks = resumed_response(problem, frequency, journal, SERIES, told.append)
    assert peaks[0][0] in found.frequency and found.converged.all()
    assert len([t for t in told if " of 4 frequencies" in t]) == 4 and len([t for t in told if "peak near" in t]) == 1


@pytest.mark.parametrize("frequency", [np.linspace(2.0, 6.0, 9), np.linspace(0.45, 2.25, 6)])
def test_a_resonance_beside_the_end_of_a_sweep_is_found(frequency: np.ndarray, tmp_path: Path) -> None:
    """2.2 Hz, between the first two points or the last two; asked again, it is known."""
    problem, told = balance.of(free(2.2), 1, 16, length=0.01), []
    for _ in range(2):
        with open_journal(tmp_path / "points", "abc", HEAD) as journal:
            found, peaks = resumed_response(problem, frequency, journal, SERIES, told.append)
        np.testing.assert_allclose(pairs(peaks), [(2.2, 50 / (2 * np.pi * 2.2) ** 2 * 0.3)], rtol=1e-3)
    assert len([t for t in told if "peak near" in t]) == 1
    alone = response.harmonic_response(problem, frequency)
    assert rising({1.0: found}, {1.0: pairs(peaks)}) == [] and len(rising({1.0: alone}, {1.0: []})) == 1


def test_a_search_that_found_no_peak_is_not_made_again(tmp_path: Path) -> None:
    """The flank of 2.2 Hz at the end of the band."""
    problem, told = balance.of(free(2.2), 1, 16, length=0.01), list[str]()
    for _ in range(2):
        with open_journal(tmp_path / "points", "abc", HEAD) as journal:
            frequency = np.array([1.0, 1.5, 2.0])
            found = resumed_response(problem, frequency, journal, SERIES, told.append)
            assert found[1] == []
    assert len([t for t in told if t == "peak near 2 Hz"]) == 1


def softening(harmonics: int) -> balance.Problem:
    """q'' + 0.05 q' + q - 0.004 q^3 = 0.3 cos t, which leans to lower frequencies."""
    one = np.ones(1)
    rows = {"face": np.outer([0, 1, 0, 0, 0, 0], one), "push": one, "tip": one}
    soft = held(group(one, rows, 0.025), Cubic(value(-0.004)), [1], np.zeros(1), np.zeros(1), 0.3)
    return balance.of(soft, harmonics, 64, length=1.0)


def test_a_coarse_sweep_and_a_fine_one_have_the_same_overhanging_peak() -> None:
    """A fine sweep upwards comes along the lower motion past the peak and jumps, a coarse one happens to come near it.
    Both climb to the same peak: 1e-6."""
    problem, peaks = softening(3), []
    for points, past in ((7, False), (97, True)):
        found = response.harmonic_response(problem, np.linspace(0.6, 1.1, points) / (2 * np.pi))
        peaks += pairs(response.refined_peaks(problem, found))
        assert bool(overhanging(found, peaks[-1:])) == past
    np.testing.assert_allclose(peaks[0], peaks[1], rtol=1e-6)


def test_what_is_kept_is_the_point(problem: balance.Problem) -> None:
    point = solve(problem, 2 * np.pi * 60.0, [])
    found = response.operating(problem, point)
    again, same = restored(problem, record(problem, point, found))
    assert again.Omega == pytest.approx(point.Omega, rel=1e-15) and again.status == point.status
    np.testing.assert_array_equal(again.x, point.x)
    np.testing.assert_array_equal(same.outputs, found.outputs)
    assert len(again.history) == point.iterations + 1 and again.history[-1] == point.error
    for a, b in zip(same.q["blade"], found.q["blade"], strict=True):
        np.testing.assert_array_equal(a, b)
    whole = response_of(HEAD, {SERIES: {60.0: record(problem, point, found)}}).one(normal_force=20.0)
    assert labels(problem.assembly) == {"monitors/tip": ["u_x"]}
    np.testing.assert_array_equal(whole.monitor("tip")[0], found.outputs)


def test_displacement_by_residual_shapes_is_what_the_monitor_reads() -> None:
    """MacNeal: contact forces and excitation on the residual shapes, at the node the monitor stands on, 1e-9.

    The monitor reads through the residual compliance of the rows, the node through shapes of the whole body.
    """
    settings = BodySettings.model_validate(table(reduction="macneal"))
    basis = modal_basis(beam(), settings)
    stored = basis.groups[0, 0]
    assert has_residual(stored, basis.reduction)
    group = in_modes(stored)
    patch = Patch("right", *grid(0.012, 0.004, (3, 2)), sector(6, 1).contacts[0].patch.law)
    contact = preloaded_contact("rub", patch, ContactFace("small", "right"), None, normal=100.0)
    component = Component("small", {0: group}, residual_share=np.ones(len(group.compliance.labels)))
    outputs = tuple(Output("small", "tip-probe", f"u_{x}") for x in "xyz")
    assembly = Assembly((component,), (contact,), (Load("small", "shaker", 300.0),), outputs)
    problem = balance.of(assembly, harmonics=3, samples=FINE["samples"], cycles=FINE["cycles"])
    point = solve(problem, 2 * np.pi * 400.0, [])
    assert point.converged
    found = response.operating(problem, point)
    assert 0 < found.cycles["rub"].slipping.mean()
    labels_of = group.residual.labels
    forces = np.array([sum(forces_on(problem, component, h, found, labels_of)) for h in range(4)])
    motion = motion_of(point.Omega, np.array(found.q["small"]), group, forces=forces)
    node, away = nearest_point(basis, group.monitors["tip-probe"].point)
    assert away < 1e-12
    read = displacement(motion, node)[0, :, 0].T
    np.testing.assert_allclose(read, found.outputs, rtol=0, atol=1e-9 * np.abs(found.outputs).max())
    alone = displacement(motion_of(point.Omega, np.array(found.q["small"]), group), node)[0, :, 0].T
    assert np.abs(alone - found.outputs).max() > 1e-4 * np.abs(found.outputs).max()  # it would be missed


READ = (("p0", "u_x"), ("p1", "u_x"), ("p0", "u_y"), ("p0", "u_x"))


def test_directions_of_a_monitor_that_are_not_neighbours(tmp_path: Path) -> None:
    """Read-outs p0 x, p1 x, p0 y, and p0 x once more: each row under its own name, that of (K + i Omega C - Omega^2 M)
    q = f with the contact's springs to 1e-9; a second run with more points reads the first one's rows back."""
    group = System(
        "pair", [Body("a", 1.0, free="xy"), Body("b", 2.0, (1, 0, 0), free="xy")],
        [Spring("ground", "a", [1e4, 3e4, 0.0]), Spring("a", "b", [2e4, 5e3, 0.0])],
        [Contact("sole", "b", (0, 0, -1))], [Force("f", "b", (1, 2, 0))], [Monitor("p0", "a"), Monitor("p1", "b")],
        ratio=0.02,
    ).basis().groups[0, 0]  # fmt: skip
    law = PointContact(Preload(value(1e4)), Coulomb(value(0.5)), value(5e3))  # which sticks
    along, T = np.array([[[0.0], [1.0], [0.0]]]), group.interfaces["sole"].rows[1:2]
    patch, none = Patch("sole", np.zeros((1, 2)), np.ones(1), law, along), np.zeros(1)
    rub = Rub("rub", patch, ContactFace("pair", "sole", np.eye(6)[1:2], rows={0: T}), None, none, none)
    outputs = tuple(Output("pair", name, label) for name, label in READ)
    pair = Assembly((Component("pair", {0: group}),), (rub,), (Load("pair", "f"),), outputs)
    problem = balance.of(pair, harmonics=1, samples=16)
    head = HEAD | {"labels": labels(problem.assembly)}
    for count in (2, 4):
        with open_journal(tmp_path / "points", "abc", head) as journal:
            found, _ = resumed_response(problem, np.linspace(9.0, 12.0, count), journal, SERIES)
        told = read_response(tmp_path / "points")
    assert told.labels == {"monitors/p0": ("u_x", "u_y"), "monitors/p1": ("u_x",)}
    for f, watched in zip(found.frequency, found.outputs, strict=True):
        Omega = 2 * np.pi * f
        A = group.K_r + 5e3 * T.T @ T - Omega**2 * group.M_r + 1j * Omega * group.C_r
        q = np.linalg.solve(A, group.excitations["f"].rows[0])
        exact = {w: group.monitors[w[0]].rows[("u_x", "u_y").index(w[1])] @ q for w in READ}
        np.testing.assert_allclose(watched[:, 1], [exact[w] for w in READ], rtol=1e-9)
        (series,) = told.series
        for name, rows in told.labels.items():
            held = series.arrays[name][np.argmin(np.abs(series.key - f)), :, 1]
            np.testing.assert_allclose(held, [exact[name.split("/")[1], label] for label in rows], rtol=1e-9)


def test_rows_of_several_members_with_a_monitor_of_one_name() -> None:
    """Read in turns, they are kept under the component's name and come back in the order of the assembly."""
    held = [Spring("ground", "m", [1e4, 3e4, 0.0])]
    group = System("one", [Body("m", 1.0, free="xy")], held, monitors=[Monitor("tip", "m")]).basis().groups[0, 0]
    components = tuple(Component(name, {0: group}) for name in ("left", "right"))
    asked = [("left", "u_x"), ("right", "u_x"), ("left", "u_y"), ("right", "u_y")]
    assembly = Assembly(components, (), (), tuple(Output(m, "tip", label) for m, label in asked))
    problem: Any = SimpleNamespace(assembly=assembly, harmonics=1)
    watched = np.arange(8.0).reshape(4, 2) + 0j
    row = {name: watched[list(rows.values())] for name, rows in checkpoint._outputs(assembly).items()}
    np.testing.assert_array_equal(row["monitors/right:tip"], watched[[1, 3]])
    np.testing.assert_array_equal(checkpoint._outputs_of(problem, row), watched)


def test_the_error_of_an_overhanging_resonance_is_that_of_its_own_motion() -> None:
    """Beside the peak the sweep came along a lower motion; one harmonic leaves out as much of the peak as more show."""
    problem = softening(1)
    found = response.harmonic_response(problem, np.linspace(0.6, 1.1, 97) / (2 * np.pi))
    (peak,) = response.refined_peaks(problem, found)
    assert overhanging(found, [(peak.frequency, peak.amplitude)])
    errors = {one.point.Omega: (one.error, one.bound) for one in judged(problem, found, [peak])}
    e, share = errors[2 * np.pi * peak.frequency]
    assert e.amplitude == pytest.approx(peak.amplitude, rel=1e-6) and 0 < share < 0.1
    another = peak._replace(amplitude=0.5 * peak.amplitude)
    assert 2 * np.pi * peak.frequency not in {one.point.Omega for one in judged(problem, found, [another])}


def test_estimates_of_errors_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped before each of them and asked once more: each is computed once, and bit by bit what
    it is without a journal; also that of a peak that is not found again."""
    problem = softening(1)
    found = response.harmonic_response(problem, np.linspace(0.6, 1.1, 13) / (2 * np.pi))
    (peak,) = response.refined_peaks(problem, found)
    lost = peak._replace(frequency=0.999 * peak.frequency, x=np.full_like(peak.x, np.nan))
    whole, calls = judged(problem, found, [peak, lost]), list[str]()
    for name in ("left_out", "_estimated"):
        kept = getattr(accuracy, name)

        def once_a_run(*given: Any, name: str = name, kept: Any = kept) -> Any:
            if calls and calls[-1] != "again":
                raise Stop
            calls.append(name)
            return kept(*given)

        monkeypatch.setattr(accuracy, name, once_a_run)
    for _ in range(40):
        calls.append("again")
        with contextlib.suppress(Stop), open_journal(tmp_path / "points", "abc", HEAD) as journal:
            again = judged(problem, found, [peak, lost], journal, SERIES)
            break
    assert calls.count("left_out") == 13 and 3 <= calls.count("_estimated") <= 5
    for one, other in zip(again, whole, strict=True):
        np.testing.assert_equal(
            [vars(one.point), vars(one.error), one[2:]],
            [vars(other.point) | {"slope": None, "history": ()}, vars(other.error), other[2:]],
        )
