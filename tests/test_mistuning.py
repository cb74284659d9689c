"""Rings whose sectors differ: against the sector, closed forms and bounds; the same samples whoever computes them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.stats
from refusals import refused
from scipy.optimize import brentq

import microslip as ms
from microslip.basis import read_basis, write_basis
from microslip.case import load_case
from microslip.data import ModalBasis
from microslip.errors import UserError
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance.solver import Point, newton, solve
from microslip.mistuning import ensemble, rare
from microslip.mistuning.linear import answer, beside
from microslip.mistuning.peaks import Highest, highest
from microslip.mistuning.ring import Tuned
from microslip.mistuning.samples import Asked, Sample, SlidingRing, StickingRing, read, sample
from microslip.mistuning.samples import amplitudes as amplitudes_at
from microslip.mistuning.scatter import OF_CONTACTS, Scatter
from microslip.mistuning.sensitivity import LinearisedRing, sensitivities, softening, spread
from microslip.mistuning.statistics import Envelope, fits, quantile
from microslip.mistuning.weibull import exponent
from microslip.settings.mistakes import validate
from microslip.system.assembly import Assembly
from microslip.verbs.mistuning import Keys

RUB = {
    "interface": "right", "against": "left", "against_sector": 1, "law": "smooth", "normal_force": 20.0,
    "normal_stiffness": 2e5, "tangential_stiffness": 4e5, "friction": 0.2, "points": [1, 1],
}  # fmt: skip
FINE = {"harmonics": 1, "samples": 32}
SLIPS = 337.0
"""Hz, where friction holds the amplitude back; below 330 Hz and from 345 Hz contacts of six vanes stick."""


def amplitudes(p: balance.Problem, point: Point) -> np.ndarray:
    """(w,) complex amplitudes of the read-outs at a solution."""
    return amplitudes_at(p.at(point.Omega), point.x)


def sector(
    blades: int = 6, order: int = 1, modes: int = 2, vane: ModalBasis | Path | None = None, **contact: object
) -> Assembly:  # fmt: skip
    """One of the sample's vanes that stands for a ring, its tip rubbing on the next one's."""
    case = {"body": "vane", "excitation": "magnet", "amplitude": 2.0, "monitor": "probe", "modes": modes,
            "ring": {"blades": blades, "engine_order": order}, "contacts": [{**RUB, **contact}]}  # fmt: skip
    return ms.assemble(case, vane=vane or ms.sample()).assembly


@pytest.fixture(scope="module")
def tuned() -> Tuned:
    return Tuned(sector(), {})


@pytest.mark.parametrize("of", ["frequency", "damping", "normal_force", "gap", "friction", "stiffness", "added_mass"])
def test_no_scatter_is_the_sector(tuned: Tuned, of: str) -> None:
    """As deviations vanish the whole ring moves as the sector that stands for it: 1e-9."""
    s = Scatter(of, 1e-3, at="probe" if of == "added_mass" else None)
    ring = tuned.mistuned([(s, np.full((6, tuned.modes(s)), 1e-13))])
    lone, whole = balance.of(tuned.sector, **FINE), balance.of(ring, form="sides", **FINE)
    Omega = 2 * np.pi * SLIPS
    a, b = (np.abs(amplitudes(p, solve(p, Omega, []))) for p in (lone, whole))
    assert b == pytest.approx(a[0], rel=1e-9)


def test_uniform_deviations_move_the_ring_as_one(tuned: Tuned) -> None:
    """All blades stiffer by (1 + d)^2 are a sector of such blades: the sum rule of first order holds with it."""
    s = Scatter("frequency", 1e-3)
    ring = tuned.mistuned([(s, np.full((6, 2), 0.02))])
    y = StickingRing(ring)(290.0)
    other = Tuned(replace(tuned.sector, components=_stiffer(tuned.sector, 0.02)), {})
    assert y == pytest.approx(StickingRing(other.whole)(290.0)[0], rel=1e-10)


def _stiffer(one: Assembly, by: float) -> tuple[object, ...]:
    blade = one.components[0]
    g = blade.groups[0]
    assert g.to_diagonal is None
    stiffer = replace(g, K_r=(1 + by) ** 2 * g.K_r, omega=(1 + by) * g.omega, C_r=(1 + by) * g.C_r)
    return (replace(blade, groups={0: stiffer}),)


def stiffer_vane(by: float) -> ModalBasis:
    """The sample's vane with a modulus (1 + by)^2 times its own."""
    basis, s = read_basis(ms.sample()), (1 + by) ** 2
    g = basis.groups[0, 0]
    soft = replace(g.compliance, static=g.compliance.static / s, modal=g.compliance.modal / s)
    stiff = replace(g, omega=(1 + by) * g.omega, K_r=s * g.K_r, C_r=(1 + by) * g.C_r, compliance=soft)
    return replace(basis, groups={(0, 0): stiff})


def test_modal_files_of_single_blades(tuned: Tuned, tmp_path: Path) -> None:
    """The same file again changes nothing (1e-12); a stiffer blade's file is its frequencies' scatter (1e-12), and
    what scatters besides scatters about it."""
    write_basis(tmp_path / "stiffer.h5", stiffer_vane(0.03))
    same, stiffer = (Scatter("modal_file", others={4: sector(vane=v)}) for v in (ms.sample(), tmp_path / "stiffer.h5"))
    known = Scatter("frequency", values=(0.0, 0.0, 0.0, 0.0, 0.03, 0.0))
    drawn, both = Scatter("frequency", 0.01), np.random.default_rng(0).normal(0, 0.01, (6, 2))

    def amplitudes_of(*scatter: Scatter) -> np.ndarray:
        given = [(s, both if s is drawn else s.drawn(6, tuned.modes(s), 0, 0, 0)) for s in scatter]
        p = balance.of(tuned.mistuned(given), form="sides", **FINE)
        return np.abs(amplitudes(p, solve(p, 2 * np.pi * 287.0, [])))

    alike = amplitudes_of()
    assert amplitudes_of(same) == pytest.approx(alike, rel=1e-12)
    assert amplitudes_of(stiffer) == pytest.approx(amplitudes_of(known), rel=1e-12)
    assert amplitudes_of(drawn, stiffer) == pytest.approx(amplitudes_of(known, drawn), rel=1e-12)
    assert np.abs(amplitudes_of(stiffer) / alike - 1).max() > 0.01


def test_a_blade_of_its_own_is_shuffled() -> None:
    """Where it stands is drawn for every sample, and it is there once."""
    s = Scatter("modal_file", others={4: sector()}, arrangement="shuffled")
    places = [s.drawn(6, 1, 0, 0, i)[:, 0] for i in range(40)]
    assert {int(p.argmax()) for p in places} == set(range(6)) and {p.sum() for p in places} == {1.0}


def _other(**changed: object) -> Assembly:
    """The sector with another body in it."""
    one = sector()
    g = one.components[0].groups[0]
    face = replace(g.interfaces["right"], origin=g.interfaces["right"].origin + [0, 0, 0.01])
    rows = {"interfaces": {**g.interfaces, "right": face}} if changed.pop("moved", False) else {}
    rows |= {"excitations": {}} if changed.pop("undriven", False) else {}
    return replace(one, components=(replace(one.components[0], groups={0: replace(g, **rows)}, **changed),))


@pytest.mark.parametrize(
    "of, words",
    [
        (lambda: sector(modes=3), "has 3 coordinates"),
        (lambda: _other(moved=True), "0.01 m off"),
        (lambda: _other(undriven=True), "load 'magnet'"),
        (lambda: _other(name="bucket"), "no body 'vane'"),
    ],
)
def test_modal_files_that_do_not_fit(tuned: Tuned, of, words: str) -> None:
    """A body in whose place there is none."""
    refused(words, tuned.check, (Scatter("modal_file", others={4: of()}),))
    refused("sectors 0 to 5", tuned.check, (Scatter("modal_file", others={6: sector()}),))


def test_each_contact_counts_its_own_numbers(tuned: Tuned) -> None:
    """Contacts that differ in numbers are marched together; each gives what it gives alone."""
    s = [Scatter("friction", 0.1), Scatter("stiffness", 0.1), Scatter("normal_force", 0.1)]
    rng = np.random.default_rng(1)
    ring = tuned.mistuned([(x, rng.uniform(-0.2, 0.2, (6, 1))) for x in s])
    together = balance.of(ring, form="relative", **FINE)
    assert len(together.groups) == 1
    Omega, x = 2 * np.pi * SLIPS, rng.normal(size=together.size)
    force, v = together.at(Omega).force(x), together.displacement(x)
    for contact, own in zip(ring.contacts, together.groups[0].first, strict=True):
        alone = balance.of(replace(ring, contacts=(contact,)), form="relative", **FINE)
        found = alone.at(Omega).force((v[:, own] / alone.scale).ravel())
        assert found == pytest.approx(force[:, own], rel=1e-12, abs=1e-12 * np.abs(force).max())


def test_steps_by_relative_motions_are_those_of_the_sides(tuned: Tuned) -> None:
    """The step of Newton's method by the relative motions solves the system of the sides: 1e-9."""
    ring = tuned.mistuned([(Scatter("frequency", 0.01), np.random.default_rng(0).normal(0, 0.01, (6, 2)))])
    p = balance.of(ring, form="sides", **FINE)
    rng, at = np.random.default_rng(2), p.at(2 * np.pi * SLIPS)
    J = at.jacobian(at.forces(2 * rng.normal(size=p.size))[1])
    right = rng.normal(size=p.size)
    assert J.dense() @ J.solve(right) == pytest.approx(right, abs=1e-9)


def test_steps_of_a_ring_with_a_gaping_contact(tuned: Tuned) -> None:
    """A contact that stands open feels nothing; the step still solves the system of the sides: 1e-9."""
    p = balance.of(tuned.mistuned([(Scatter("gap", 1.0), np.eye(6)[:, :1] * 1e-2)]), form="sides", **FINE)
    rng, at = np.random.default_rng(2), p.at(2 * np.pi * SLIPS)
    slopes = at.forces(np.zeros(p.size))[1]
    assert not slopes[0][0].any()
    right = rng.normal(size=p.size)
    J = at.jacobian(slopes)
    assert J.dense() @ J.solve(right) == pytest.approx(right, abs=1e-9)


FLOW = {0: 0.002j, 1: 0.004 + 0.01j, 2: -0.01 + 0.003j, 3: 0.002 + 0.004j, 4: 0.012j, 5: 0.01 - 0.001j}


def flown() -> Tuned:
    """The ring in a flow that tells all six waves apart."""
    one = sector()
    return Tuned(replace(one, components=(replace(one.components[0], aerodynamic=FLOW),)), {})


def test_a_mistuned_ring_in_a_flow() -> None:
    """Contacts that stick, blades that differ, each wave damped by its own coefficient: the dense complex matrices of
    the whole ring, put together here wave by wave, 1e-10."""
    ring, d = flown(), np.random.default_rng(4).normal(0, 0.01, 6)
    one, k, w = ring.sector, ring.sector.contacts[0].stiffness, 2 * np.pi * 287.0
    g = one.components[0].groups[0]
    sides = (one.contacts[0].first, one.contacts[0].second)
    right, left = (side.frame @ g.interfaces[side.interface].rows for side in sides)
    D = np.kron(np.eye(6), right) - np.kron(np.roll(np.eye(6), 1, axis=1), left)
    A = D.T @ np.kron(np.eye(6), k) @ D + 0j
    for j, s in enumerate(1 + d):
        at = slice(2 * j, 2 * j + 2)
        A[at, at] += np.diag((s * g.omega) ** 2 - w**2 + 2j * w * g.damping_ratio * s * g.omega)
    for n, a in FLOW.items():
        E = np.kron(np.exp(2j * np.pi * n * np.arange(6) / 6)[:, None] / np.sqrt(6), np.eye(2))
        A += E @ np.diag(2 * a.real * g.omega**2 + 2j * w * a.imag * g.omega) @ E.conj().T
    force = np.kron(np.exp(2j * np.pi * np.arange(6) / 6), g.excitations["magnet"].rows[0] * 2.0)
    probe = g.monitors["probe"].rows[g.monitors["probe"].labels.index(one.outputs[0].label)]
    expected = np.abs(np.kron(np.eye(6), probe) @ np.linalg.solve(A, force))
    s = Scatter("frequency", 0.01)
    found = StickingRing(ring.mistuned([(s, np.repeat(d[:, None], 2, axis=1))]))(287.0)
    assert found == pytest.approx(expected, rel=1e-10)
    assert np.abs(StickingRing(ring.whole)(287.0) / expected - 1).max() > 0.01


def test_modal_files_of_single_blades_in_a_flow() -> None:
    """The same file again is the same ring."""
    ring = flown()
    same = Scatter("modal_file", others={4: ring.sector})
    found = StickingRing(ring.mistuned([(same, same.drawn(6, 1, 0, 0, 0))]))(287.0)
    assert found == pytest.approx(StickingRing(ring.whole)(287.0), rel=1e-12)


def _sliding(asked: Asked) -> bool:
    """Whether friction changes what the tuned ring does."""
    lone = StickingRing(asked.tuned.whole)(float(asked.frequency[0]))
    now = np.abs(amplitudes(asked.problem(asked.tuned.whole), asked.tuned_points[0]))
    return bool(np.abs(now / lone - 1).max() > 0.01)


@pytest.mark.parametrize("blade, flowing", [(0, False), (1, False), (5, False), (1, True)])
def test_sensitivities_are_differences(tuned: Tuned, blade: int, flowing: bool) -> None:
    """Central differences of Newton solutions with friction: 1e-6 (no contact switches between them)."""
    tuned = flown() if flowing else tuned
    s = Scatter("frequency", 0.003, together=0.0)
    asked = Asked(tuned, (s,), np.array([SLIPS]), balance=FINE)
    point = asked.tuned_points[0]
    assert _sliding(asked)
    _, found = sensitivities(asked, s, point)
    h, moved = 1e-6, []
    for sign in (1, -1):
        d = np.zeros((6, 2))
        d[blade, 0] = sign * h
        p = asked.problem(tuned.mistuned([(s, d)]))
        moved.append(np.abs(amplitudes(p, newton(p.at(point.Omega), point.x, 1e-13)))[0])
    assert found[blade, 0] == pytest.approx((moved[0] - moved[1]) / (2 * h), rel=1e-6)


def test_sensitivities_are_one_sided_where_sliding_begins() -> None:
    """At the frequency where Jenkins elements begin to slide, all blades made slower or faster: the differences to
    either side are the sums of the sensitivities just before and just behind it (1e-5), which are 4 % apart."""
    ring, s = Tuned(sector(law="jenkins"), {}), Scatter("frequency", 0.003)

    def moves(f: float, d: float = 0.0) -> tuple[float, float]:
        whole = ring.mistuned([(s, np.full((6, 2), d))])
        p = balance.of(whole, form="sides", **FINE)
        return float(np.abs(amplitudes(p, solve(p, 2 * np.pi * f, [])))[0]), float(StickingRing(whole)(f)[0])

    def slope(f: float) -> float:
        asked = Asked(ring, (s,), np.array([f]), balance=FINE)
        return float(sensitivities(asked, s, asked.tuned_points[0])[1].sum())

    begins = brentq(lambda f: 1.0 if np.ptp(y := moves(f)) > 1e-11 * y[0] else -1.0, 330.0, 335.0, xtol=1e-10)
    h, (y, _) = 1e-6, moves(begins)
    before, behind = slope(begins - 1e-4), slope(begins + 1e-4)
    assert (moves(begins, h)[0] - y) / h == pytest.approx(before, rel=1e-5)  # faster blades have their peak farther off
    assert (y - moves(begins, -h)[0]) / h == pytest.approx(behind, rel=1e-5)
    assert abs(behind / before - 1) > 0.03


def test_whitehead_is_never_exceeded() -> None:
    """One family of modes, equal damping, scattered frequencies: the highest blade is at most (1 + sqrt N) / 2 times
    the tuned ring's, and some patterns come near (Whitehead 1966)."""
    ring = Tuned(sector(blades=5, modes=1, normal_stiffness=300.0, tangential_stiffness=600.0), {})
    asked = Asked(ring, (Scatter("frequency", 0.004),), np.linspace(266, 277, 45), stuck=True)
    found = ensemble.run(asked, 60, workers=1)
    bound = 0.5 * (1 + np.sqrt(5))
    assert 1.15 < found.amplification.max() < bound


def test_peaks_are_between_points() -> None:
    """Resonances of two read-outs, seen on a coarse sweep: the higher one to the tolerance."""

    def respond(f: float) -> np.ndarray:
        w = np.array([100.31, 103.77])
        return np.abs(np.array([1.0, 1.01]) / (w**2 - f**2 + 2j * 0.004 * w * f)) * w**2

    found = highest(respond, np.linspace(95, 110, 16))
    assert (found.output, found.frequency) == (1, pytest.approx(103.77, rel=1e-4))
    assert found.amplitude == pytest.approx(1.01 / 0.008, rel=1e-4)


@pytest.mark.parametrize(
    ("missed", "end", "words"), [(0.002, False, None), (0.03, False, "3 % higher"), (0.03, True, "at an end")]
)
def test_a_tuned_ring_without_a_peak_is_said(tuned: Tuned, missed: float, end: bool, words: str | None) -> None:
    """Amplifications are over the tuned ring's peak: a warning where that is at an end of the band, or by a jump."""
    top = Highest(0, 2.0, 1.0, missed, np.array([1.0, 2.0, 3.0]), np.array([[0.4], [1.0], [0.95]]), (), end)
    asked = Asked(tuned, (), np.zeros(0))
    none = np.zeros((0, len(ensemble.COLUMNS)))
    said = ensemble.Ensemble(asked, Sample(-1, top, top.amplitudes), none, Envelope.empty(3, 1.0)).unsure
    assert said == [] if words is None else words in said[0]


def test_the_highest_sample_is_searched_for_again(tuned: Tuned) -> None:
    """From below and from above, in steps a quarter as wide, to the same peak; of one that was missed a warning says
    by how much."""
    asked = Asked(tuned, (Scatter("frequency", 0.01),), np.linspace(386, 400, 15), stuck=True)
    found = ensemble.run(asked, 3, workers=1)
    one = found.search_again()
    assert found.again is not None and one.number == found.highest == found.column("amplitude").argmax()
    for top in found.again:
        assert top.amplitude == pytest.approx(one.top.amplitude, rel=1e-3)
        assert np.diff(top.frequencies).max() == pytest.approx(0.25)
    assert not any("first search" in s for s in found.unsure)
    found.rows[:, 0] *= 0.98
    assert found.lacked == pytest.approx(0.02, abs=1e-3) and "2 % of the highest" in " ".join(found.unsure)


def test_python_warns_as_the_command_line_does() -> None:
    """A band without the tuned ring's peak; and known deviations, as given, are one ring whatever is asked for."""
    pattern = Scatter("frequency", values=(0.0, 0.01))
    with pytest.warns(UserWarning, match="end of the band"):
        found = ms.mistune(sector(), pattern, np.linspace(280, 284, 5), samples=7, stuck=True)
    assert len(found) == 1
    refused("nothing scatters", Scatter, "frequency", 0.0)


def test_fewer_samples_than_are_kept_are_the_first(tuned: Tuned, tmp_path: Path) -> None:
    """Without solving them again, and more of them go on from all."""
    asked = Asked(tuned, (Scatter("frequency", 0.01),), np.linspace(284, 290, 13), stuck=True)
    file = tmp_path / "kept.npz"
    all_of = ensemble.run(asked, 6, workers=1, file=file).rows
    told = list[str]()
    few = ensemble.run(asked, 2, workers=1, file=file, report=told.append)
    assert np.array_equal(few.rows, all_of[:2]) and told == ["the tuned ring"]
    alone = ensemble.run(asked, 2, workers=1).envelope
    assert few.envelope.samples(6) == 2
    assert np.array_equal(few.envelope.sums, alone.sums) and np.array_equal(few.envelope.bins, alone.bins)
    assert np.array_equal(ensemble.run(asked, 6, workers=1, file=file, report=told.append).rows, all_of)
    assert told == ["the tuned ring"] * 2


@pytest.mark.parametrize("stuck", [True, False])
def test_stress_at_the_worst_node(stuck: bool) -> None:
    """The von Mises stress of all nodes of all blades at a thousand instants of the peak's cycle, and the gauges'
    strain, from coordinates whose read-out is the amplitude."""
    one, s = sector(), Scatter("frequency", 0.01)
    g = one.components[0].groups[0]
    gauge = {"root": replace(g.gauges["root"], rows=np.array([[3.0, -2.0]]))}  # its own feels nothing
    tuned = Tuned(replace(one, components=(replace(one.components[0], groups={0: replace(g, gauges=gauge)}),)), {})
    asked = Asked(tuned, (s,), np.linspace(335, 339, 5), balance=FINE, stuck=stuck)
    ring = tuned.mistuned(asked.deviations(0))
    found, respond = sample(asked, 0), StickingRing(ring) if stuck else SlidingRing(asked.problem(ring))
    respond(found.top.frequency)
    q = np.concatenate(respond.coordinates(found.top.frequency)).reshape(6, 2)
    probe = tuned.sector.components[0].groups[0].monitors["probe"]
    read = probe.rows[probe.labels.index(tuned.sector.outputs[0].label)]
    assert np.abs(q @ read).max() == pytest.approx(found.top.amplitude, rel=1e-6)
    wave = np.exp(1j * np.linspace(0, 2 * np.pi, 1001))
    xx, yy, zz, *shear = np.einsum("pim,jm,t->ipjt", g.stresses["nodes"].stress, q, wave).real
    mises = 0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3 * sum(t**2 for t in shear)
    assert found.stress == pytest.approx(np.sqrt(mises.max()), rel=1e-5)
    assert found.strain == pytest.approx(np.abs(q @ [3.0, -2.0]).max(), rel=1e-6)


def same_bits(one: ensemble.Ensemble, other: ensemble.Ensemble) -> None:
    assert one.rows.tobytes() == other.rows.tobytes()
    assert one.envelope.sums.tobytes() == other.envelope.sums.tobytes()
    assert (one.envelope.bins == other.envelope.bins).all()


def test_a_run_goes_on_after_its_first_samples(tuned: Tuned, tmp_path: Path) -> None:
    asked = Asked(tuned, (Scatter("frequency", 0.01),), np.linspace(275, 300, 12), seed=3, stuck=True)
    ensemble.run(asked, 16, workers=1, file=tmp_path / "m.npz", inputs="a")
    going = ensemble.run(asked, 20, workers=1, file=tmp_path / "m.npz", inputs="a")
    same_bits(ensemble.run(asked, 20, workers=1), going)


@pytest.mark.slow
def test_samples_do_not_depend_on_workers(tuned: Tuned) -> None:
    """One process and two: the same bits. The quick tests share samples between threads (test_mistuning_ensembles)."""
    asked = Asked(tuned, (Scatter("frequency", 0.01),), np.linspace(275, 300, 12), seed=3, stuck=True)
    same_bits(ensemble.run(asked, 20, workers=1), ensemble.run(asked, 20, workers=2))


def test_a_sample_is_what_its_number_says(tuned: Tuned) -> None:
    """Deviations depend on seed, sample and place alone."""
    s = (Scatter("frequency", 0.01), Scatter("friction", 0.1))
    asked = Asked(tuned, s, np.linspace(275, 300, 4), seed=3, stuck=True)
    first, again = asked.deviations(7), replace(asked, scatter=s).deviations(7)
    assert all((a[1] == b[1]).all() for a, b in zip(first, again, strict=True))
    assert not np.allclose(first[0][1][:, 0], asked.deviations(8)[0][1][:, 0])
    assert sample(asked, 7).top.amplitude == sample(asked, 7).top.amplitude


CASE = """
name = "ring"
excitations = [{{ row = "vane:magnet", amplitude = 2.0 }}]
monitors = [{{ monitor = "vane:probe" }}]
ring = {{ blades = 4, engine_order = 1 }}
sweep = {{ start = 270.0, stop = 300.0, points = 13 }}

[[bodies]]
name = "vane"
file = "{file}"
modes = 2

[[contacts]]
interface = "vane:right"
against = "vane:left"
against_sector = 1
law = "smooth"
normal_force = 20.0
normal_stiffness = 2e5
tangential_stiffness = 4e5
friction = 0.2
points = [1, 1]

[mistuning]
samples = {samples}
stuck = true
scatter = [
  {{ of = "frequency", file = "blades.csv", arrangement = "shuffled" }}, {{ of = "stiffness", deviation = 0.1 }},
  {{ of = "modal_file", others = {{ {sector} = "other.h5" }} }},
]
"""


def test_a_case_leaves_its_samples(tmp_path: Path) -> None:
    """The table holds the samples of the ring, more of them go on, and measured frequencies are shuffled."""
    from microslip.stages.analysing import analysed
    from microslip.stages.answer import CaseJob

    path, files, told = tmp_path / "case.toml", {"vane": ms.sample()}, list[str]()
    (tmp_path / "blades.csv").write_text("blade,frequency_Hz\n0,99\n1,100\n2,101\n3,100\n")
    write_basis(tmp_path / "other.h5", stiffer_vane(0.01))
    rows = {}
    for samples in (4, 8):
        path.write_text(CASE.format(file=ms.sample(), samples=samples, sector=2))
        job = CaseJob(path, files, tmp_path, ["mistuning.workers=1"], report=told.append, pictures=False)
        made, sentences, fine, _ = analysed("mistuning", job)
        rows[samples] = (tmp_path / "samples.csv").read_text().splitlines()
    assert fine
    assert rows[8][:5] == rows[4]
    assert len(rows[8]) == 9
    assert not any(line.startswith("1 of 8") for line in told)
    found = np.genfromtxt(tmp_path / "samples.csv", delimiter=",", names=True)
    assert (found["stress_Pa"] > 0).all() and (found["strain"] > 0).all()
    assert f"{found['amplification'].max():.4g}" in " ".join(sentences)
    assert any("tuned ring is highest at an end" in s for s in sentences)  # its peak is at 392 Hz
    assert all(p.is_file() for p in made)
    for sector, words in (("7", "sectors 0 to 3"), ("two", "no sector"), ("3", "other.h5")):
        path.write_text(CASE.format(file=ms.sample(), samples=4, sector=sector))
        if words == "other.h5":
            (tmp_path / "other.h5").unlink()
        refused(words, analysed, "mistuning", CaseJob(path, files, tmp_path, pictures=False))
    assert (tmp_path / "samples.csv").read_text().splitlines() == rows[8]


def test_a_share_may_be_written_in_percent() -> None:
    """As `mistune --until 2%` does; what is none is refused by its key."""
    scatter = [{"of": "frequency", "deviation": 0.01}]
    assert validate(Keys, {"scatter": scatter, "until": "2%"}, Path("c")).until == pytest.approx(0.02)
    for wrong in ("200%", "%", "two"):
        refused("until", validate, Keys, {"scatter": scatter, "until": wrong}, Path("c"))


def test_only_a_ring_is_mistuned(tmp_path: Path) -> None:
    """A case without [ring] is refused before anything of it is built."""
    text = CASE.format(file=ms.sample(), samples=4, sector=2)
    (tmp_path / "case.toml").write_text(text.replace("ring = { blades = 4, engine_order = 1 }", ""))
    refused(("mistuning", "[ring]"), load_case, tmp_path / "case.toml")


@pytest.mark.parametrize("of", ["frequency", "damping"])
def test_one_transposed_solution_holds_all_sensitivities(tuned: Tuned, of: str) -> None:
    """From the left (one solution) as from the right (one a mode): all modes of a blade to 1e-9."""
    s, body = Scatter(of, 0.003, together=0.0), 2
    asked = Asked(tuned, (s,), np.array([SLIPS]), balance=FINE)
    now = LinearisedRing.of(asked.problem(tuned.whole), asked.tuned_points[0])
    _, found = sensitivities(asked, s, asked.tuned_points[0])
    for mode in range(2):
        push = [softening(now.at, body, s, mode, h) @ now.q[h][body] for h in (0, 1)]
        assert found[body, mode] == pytest.approx(_forward(now, body, push), rel=1e-9)


def _forward(now: LinearisedRing, body: int, push: list[np.ndarray]) -> float:
    """Change of the first read-out's amplitude by forces on a body, of the harmonics 0 and 1."""
    own = slice(body * 12, body * 12 + 12)
    R = np.zeros((3, now.at.problem.count))
    parts = [now._of_part(body, h) for h in (0, 1)]
    moved = [np.linalg.solve(A, f) for (A, _), f in zip(parts, push, strict=True)]
    mean, first = (rows @ q for (_, rows), q in zip(parts, moved, strict=True))
    R[0, own], R[1, own], R[2, own] = mean.real, first.real, -first.imag
    p = now.at.problem
    v = p.displacement(now.matrix.solve(-(R / p.scale).ravel()))
    changed = now.felt(v)
    held = np.hstack([v[:, s] @ k.T for s, k in zip(p.slices, p.stiffness, strict=True)])
    dq = now.at.coordinates(changed - held, 0.0)[1]
    dy = read(now.at, dq, changed, 0.0) - (p.parts[1][body].output @ moved[1])
    return float((np.conj(now.y[0]) * dy[0]).real / np.abs(now.y[0]))


def test_the_linear_ring_is_the_ring_that_sticks(tuned: Tuned) -> None:
    """Where contacts stick, the blades of samples on and between the frequencies are those of the whole ring: 1e-3, as
    modes deviate to first order there."""
    asked = Asked(tuned, (Scatter("frequency", 0.002),), np.array([320.0, 337.0]), balance=FINE, stuck=True)
    linear = beside(asked)
    for i in range(4):
        d = asked.deviations(i)
        sticks = StickingRing(tuned.mistuned(d))
        for f in (320.0, 333.3, 337.0):
            y = linear.amplitudes(np.array([(2 * np.pi * f) ** 2]), linear.own(d))
            assert y[0] == pytest.approx(sticks(f), rel=1e-3)


def test_the_linear_ring_is_highest_at_its_peak(tuned: Tuned) -> None:
    """Of ten rings on frequencies 6 Hz apart, 0.7 Hz within half power: as high as on 3000 of them."""
    band, s = np.linspace(315.0, 357.0, 8), Scatter("frequency", 0.01, together=0.5)
    asked = Asked(tuned, (s,), band, seed=3, balance=FINE, stuck=True)
    linear, drawn = beside(asked), [asked.deviations(i) for i in range(10)]
    fine = np.linspace(linear.square[0], linear.square[-1], 3001)
    found = np.array([linear(d) for d in drawn])
    there, grid = (np.array([linear.amplitudes(x, linear.own(d)).max() for d in drawn]) for x in (fine, linear.square))
    assert found == pytest.approx(there, rel=3e-4)
    assert (found > 1.5 * grid).any()


def test_chosen_samples_of_a_ring_that_sticks(tuned: Tuned, tmp_path: Path) -> None:
    """The linear ring knows all but second order: the quantile is that of all samples that were drawn, to 1 %, and
    what a killed run left is not solved again."""
    asked = Asked(tuned, (Scatter("frequency", 0.003),), np.linspace(330.0, 344.0, 8), balance=FINE, stuck=True)
    found, linear = ensemble.run(asked, 20, workers=1), beside(asked)
    told = ensemble.choose(found, 6, workers=1, file=tmp_path / "rare.npz")
    drawn = [linear(asked.deviations(ensemble.FIRST + i)) for i in range(told.drawn)]
    assert told.correlation > 0.99 and told.drawn == 6 * rare.EACH
    assert told.quantile.value == pytest.approx(np.quantile(drawn, 0.999) / found.tuned.top.amplitude, rel=0.01)
    left, lines = (tmp_path / "rare.npz").read_bytes(), list[str]()
    assert ensemble.choose(found, 6, workers=1, file=tmp_path / "rare.npz", report=lines.append) == told
    assert len(lines) == 1 and (tmp_path / "rare.npz").read_bytes() == left


def test_the_linear_ring_answers_as_contacts_do_on_average(tuned: Tuned) -> None:
    """k u is the mean over all phases of the tangent's force, turned back: 1e-12."""
    asked = Asked(tuned, (Scatter("frequency", 0.002),), np.array([SLIPS]), balance=FINE)
    now = LinearisedRing.of(asked.problem(tuned.whole), asked.tuned_points[0])
    k, turns = answer(now.at, now.slopes), np.exp(2j * np.pi * np.arange(8) / 8)
    u, S = np.random.default_rng(0).normal(size=(6, 2)) @ [1, 1j], now.slopes[0][0]
    back = []
    for turn in turns:
        v = np.array([0 * u.real, (turn * u).real, -(turn * u).imag])
        F = np.einsum("kwlz,zl->wk", S, v)
        back.append((F[1] - 1j * F[2]) / turn)
    assert k[:6, :6] @ u == pytest.approx(np.mean(back, axis=0), rel=1e-12)


@pytest.mark.parametrize("correlated", [0.7, 0.9])
def test_chosen_samples_tell_rare_quantiles(correlated: float) -> None:
    """Of pairs of normal numbers the 99.9 % quantile, over 300 repeats: intervals hold the truth in 95 % or more, and
    where the pairs correlate by 0.9 the error is smaller than that of twenty times as many plain samples."""
    truth, n, repeats = scipy.stats.norm.ppf(0.999), 100, 300
    held, off, plain = 0, [], []
    for i in range(repeats):
        g = np.random.default_rng([i, 1])
        z = g.standard_normal(rare.EACH * n)
        y = 5 + correlated * z + np.sqrt(1 - correlated**2) * g.standard_normal(len(z))
        pi = rare.chances(z, n, 0.999, correlated, 100)
        assert pi.sum() == pytest.approx(n, rel=1e-6)
        chosen = rare.chosen(pi, i)
        q = rare.estimate(y[chosen], pi[chosen], len(z), 0.999, correlated).quantile
        held += q.low <= 5 + truth <= q.high
        off.append(q.value - 5 - truth)
        plain.append(np.quantile(g.standard_normal(20 * n), 0.999) - truth)
    assert held >= 0.94 * repeats
    if correlated == 0.9:
        assert np.std(off) < np.std(plain)
        assert abs(np.mean(off)) < 0.5 * np.std(plain)


@pytest.mark.parametrize("share, n", [(0.5, 60), (0.95, 400)])
def test_intervals_hold_the_truth(share: float, n: int) -> None:
    """Of a thousand repeats 95 +- 2 % of the intervals hold the quantile they are of."""
    truth = scipy.stats.gumbel_r.ppf(share)
    hit = 0
    for i in range(1000):
        q = quantile(5 + scipy.stats.gumbel_r.rvs(size=n, random_state=i), share)
        hit += q.low <= 5 + truth <= q.high
    assert 930 <= hit <= 970


@pytest.mark.parametrize("share, n", [(0.5, 60), (0.95, 400)])
def test_intervals_are_no_wider_than_they_must_be(share: float, n: int) -> None:
    """Of n samples that are their own ranks: at either end 2.5 % are left out at most, and
    one rank less would leave out more."""
    q, below = quantile(np.arange(1.0, n + 1), share), scipy.stats.binom(n, share)
    assert below.cdf(q.low - 1) <= 0.025 < below.cdf(q.low)
    assert below.sf(q.high - 1) <= 0.025 < below.sf(q.high - 2)


def test_envelopes_are_those_of_all_samples() -> None:
    """Mean, deviation, k and quantiles that need no memory are those of all numbers together."""
    y = np.random.default_rng(0).weibull(3.0, (400, 2, 10))
    e = Envelope.empty(2, 1.0)
    for one in y:
        e.add(one)
    every = y.transpose(1, 0, 2).reshape(2, -1)
    told = e.columns()
    assert told["mean"] == pytest.approx(every.mean(axis=1), rel=1e-12)
    assert told["deviation"] == pytest.approx(every.std(axis=1, ddof=1), rel=1e-9)
    assert told["weibull_exponent"] == pytest.approx(3.0, rel=0.05)
    assert told["quantile_97.5_percent"] == pytest.approx(np.quantile(every, 0.975, axis=1), rel=0.01)
    e.sums[:], e.bins[:] = Envelope.empty(*e.bins.shape[:1], 1.0).sums, 0
    e.add(every[:, :1])
    told = e.columns()
    for name in ("quantile_2.5_percent", "quantile_97.5_percent"):  # of one blade: itself, not its bin's middle
        assert told[name] == pytest.approx(told["highest"], rel=1e-12)


def test_weibull_is_inverted() -> None:
    """k = 1 at s = 1, and k = 2, Rayleigh's distribution, at sqrt(4/pi - 1) (Sextro Eq. (5.6-17))."""
    assert exponent([1.0, np.sqrt(4 / np.pi - 1)]) == pytest.approx([1.0, 2.0], rel=1e-12)


def test_fits_find_their_own_distribution() -> None:
    """Samples of an extreme-value distribution: its tail quantile, and a misfit smaller than Weibull's."""
    x = scipy.stats.genextreme.rvs(0.1, 1.3, 0.05, size=4000, random_state=1)
    extreme, weibull = fits(x)
    assert extreme.quantiles[0.999] == pytest.approx(scipy.stats.genextreme.ppf(0.999, 0.1, 1.3, 0.05), rel=0.01)
    assert extreme.distance < weibull.distance


def test_correlations_are_as_asked() -> None:
    """Between modes and from sector to sector, over many samples: 0.02."""
    s = Scatter("frequency", 0.01, together=0.3, neighbours=0.6)
    z = np.array([s.drawn(24, 2, 0, 1, i) for i in range(4000)]) / 0.01
    assert z.std() == pytest.approx(1.0, abs=0.02)
    assert (z[:, :, 0] * z[:, :, 1]).mean() == pytest.approx(0.3, abs=0.02)
    assert (z[:, :, 0] * np.roll(z[:, :, 0], 1, axis=1)).mean() == pytest.approx(0.6, abs=0.02)


def test_a_table_tells_its_blades(tmp_path: Path) -> None:
    """Rows in any order, numbered from 1: the same ring; one blade twice is none, nor are some of all blades."""
    from microslip.verbs.mistuning import _measured

    (file := tmp_path / "blades.csv").write_text("blade,frequency_Hz\n3,101\n1,99\n4,102\n2,98\n")
    assert _measured(file, "frequency") == pytest.approx([-0.01, -0.02, 0.01, 0.02])
    for text, words in (("blade,deviation\n3,0.1\n1,0.2\n3,0.3\n", "each once"),
                        ("blade,deviation\n1,0.1\n0,0.2\n", "2 of 4"),
                        ("frequency_Hz\n99\n0\n", "above zero"), ("frequency_Hz\n99\nnan\n", "finite")):  # fmt: skip
        file.write_text(text)
        refused(words, _measured, file, "frequency", 4)


def test_not_every_blade_of_an_odd_ring_is_against_the_next() -> None:
    """It would scatter by more than was asked."""
    refused("neighbours", Scatter("frequency", 0.01, neighbours=-0.9).drawn, 5, 1, 0, 1, 0)
    Scatter("frequency", 0.01, neighbours=-0.9).drawn(6, 1, 0, 1, 0)


@pytest.mark.parametrize("together, neighbours", [(1.0, 0.0), (0.3, 0.9), (0.0, -0.5)])
def test_first_order_spreads_as_samples_do(together: float, neighbours: float) -> None:
    """What is linear in the deviations, over many samples, whatever correlates: 0.03, of 4000."""
    s = Scatter("frequency", 0.01, together=together, neighbours=neighbours)
    S = np.random.default_rng(0).normal(size=(3, 6, 2))
    y = np.einsum("fjm,njm->nf", S, [s.drawn(6, 2, 0, 1, i) for i in range(4000)])
    assert spread(S, s) == pytest.approx(y.std(axis=0), rel=0.03)


@pytest.mark.parametrize(
    "given, words",
    [
        ({"of": "colour", "deviation": 0.1}, "colour"),
        ({"of": "frequency"}, "deviation"),
        ({"of": "frequency", "values": (0.1, 0.2, 0.3, 0.4)}, "6 sectors"),
        ({"of": "frequency", "deviation": 0.9}, "leaves nothing"),
        ({"of": "frequency", "deviation": 0.1, "component": "rotor"}, "rotor"),
        ({"of": "friction", "deviation": 0.1, "contact": "root"}, "root"),
        ({"of": "added_mass", "values": (0.001,), "at": "nose"}, "monitor"),
        ({"of": "frequency", "deviation": 0.1, "together": 2.0}, "together"),
        ({"of": "friction", "deviation": 0.1, "component": "vane"}, "body: nothing depends"),
        ({"of": "frequency", "deviation": 0.1, "at": "probe"}, "at: nothing depends"),
        ({"of": "frequency", "values": (0.1, 0.0), "neighbours": 0.5}, "neighbours: nothing depends"),
        ({"of": "friction", "deviation": 0.1}, "friction: nothing depends"),
        ({"of": "gap", "deviation": 1e-5}, "gap: nothing depends"),
    ],
)
def test_bad_scatter(tuned: Tuned, given: dict[str, object], words: str) -> None:
    """Each is told in a sentence."""
    with pytest.raises(UserError, match=words):
        s = Scatter(**given)  # type: ignore[arg-type]
        tuned.check((s,))
        ensemble.ready(Asked(tuned, (s,), np.array([287.3]), balance=FINE, stuck=s.of in OF_CONTACTS), 40, 0)
