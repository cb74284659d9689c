"""Ensembles of mistuned rings: how many samples, by whom, what is drawn, and what they cost beside the samples."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats
from refusals import refused
from test_mistuning import FINE, SLIPS, amplitudes, sector

from microslip.harmonic_balance.forces import _with_slopes, beside
from microslip.mistuning import ensemble
from microslip.mistuning.peaks import Highest
from microslip.mistuning.ring import Tuned
from microslip.mistuning.samples import Asked, Sample, StickingRing
from microslip.mistuning.scatter import Scatter
from microslip.mistuning.statistics import fits
from microslip.system.assembly import Assembly


@pytest.fixture(scope="module")
def tuned() -> Tuned:
    return Tuned(sector(), {})


def test_a_circulant_ring_in_closed_form() -> None:
    """Equal blades of one mode, q_j = q e^(i phi j), phi = 2 pi r / N, whose contacts stick: a single equation."""
    for order in (0, 1, 3):
        ring = Tuned(sector(modes=1, order=order), {})
        one, w, turn = ring.sector, 2 * np.pi * 287.0, np.exp(2j * np.pi * order / 6)
        g, k = one.components[0].groups[0], one.contacts[0].stiffness
        right, left = (
            s.frame @ g.interfaces[s.interface].rows for s in (one.contacts[0].first, one.contacts[0].second)
        )
        d, D, w0 = right - turn * left, g.damping_ratio[0], g.omega[0]
        read = g.monitors["probe"].rows[g.monitors["probe"].labels.index(one.outputs[0].label), 0]
        q = 2.0 * g.excitations["magnet"].rows[0, 0] / (w0**2 - w**2 + 2j * D * w0 * w + (d.conj().T @ k @ d)[0, 0])
        assert StickingRing(ring.whole)(287.0) == pytest.approx(np.full(6, abs(read * q)), rel=1e-10)


def test_a_run_ends_when_its_interval_is_narrow(tuned: Tuned) -> None:
    """Not before, and not long after: half of the interval of the 95 % quantile, over it."""
    asked = Asked(tuned, (Scatter("frequency", 0.002),), np.array([286.0, 287.0, 288.0]), stuck=True)
    told = list[str]()
    found = ensemble.run(asked, 400, until=0.02, workers=1, report=told.append)
    before = replace(found, rows=found.rows[: -ensemble.EACH])
    assert found.quantile(0.95).width <= 0.02 < before.quantile(0.95).width
    assert 72 <= len(found) < 400  # fewer samples tell no upper end
    assert any(str(before.quantile(0.95)) in line for line in told)


def test_a_run_ends_at_the_same_sample_whoever_solves_them(tuned: Tuned) -> None:
    """Many at a time or one: what is solved beyond it counts nowhere."""
    asked = Asked(tuned, (Scatter("frequency", 0.002),), np.array([286.0, 287.0, 288.0]), stuck=True)
    one = ensemble.run(asked, 200, until=0.02, workers=1)
    with ThreadPoolExecutor(2) as pool:
        many = ensemble.run(asked, 200, until=0.02, workers=7, executor=pool)
    assert len(one) % 28 and len(one) < 200
    assert many.rows.tobytes() == one.rows.tobytes() and many.envelope.sums.tobytes() == one.envelope.sums.tobytes()


def test_other_peoples_processes(tuned: Tuned) -> None:
    """Anything with a map of concurrent.futures, in the place of own processes: the same bits."""
    asked = Asked(tuned, (Scatter("frequency", 0.01),), np.array([286.0, 287.0, 288.0]), stuck=True)
    with ThreadPoolExecutor(2) as pool:
        theirs = ensemble.run(asked, 9, workers=3, executor=pool)
    assert theirs.rows.tobytes() == ensemble.run(asked, 9, workers=1).rows.tobytes()


@pytest.mark.slow
def test_contacts_of_many_rings_are_one_batch(tuned: Tuned) -> None:
    """`jax.vmap` over rings whose contacts differ, without a call back to Python: forces and derivatives are those of
    each ring alone, and a batch of the same size has the same bits."""
    s, rng, how = Scatter("friction", 0.1), np.random.default_rng(0), {"samples": 32, "count": 2}
    every = [tuned.mistuned([(s, s.drawn(6, 1, 0, 1, i))]).contacts for i in range(3)]
    laws, G = [beside([c.patch.law for c in ring], 1) for ring in every], every[0][0].patch.kinematics
    u = rng.normal(size=(3, 6, 6, 3)) * 2e-5
    u[:, :, 0, 0] = 1e-4
    together = jax.tree.map(lambda *x: jnp.stack([jnp.asarray(one) for one in x]), *laws)
    batch = jax.jit(jax.vmap(partial(_with_slopes, **how), in_axes=(0, None, 0, None, None)))
    assert "callback" not in str(jax.make_jaxpr(batch)(together, G, u, 0.01, 0.0))
    found, again = (batch(together, G, u, 0.01, 0.0) for _ in range(2))
    assert all((a == b).all() for a, b in zip(found, again, strict=True))
    for i, law in enumerate(laws):
        force, slope = _with_slopes(law, G, u[i], 0.01, 0.0, **how)
        assert np.abs(found[0][i] - force).max() < 1e-12 * np.abs(force).max()
        assert np.abs(found[1][i] - slope).max() < 1e-12 * np.abs(slope).max()
    assert np.ptp([np.abs(f).max() for f in found[0][:, :, 1:]]) > 0


@pytest.mark.slow
def test_samples_with_friction_do_not_depend_on_workers(tuned: Tuned, tmp_path: Path) -> None:
    """One process and two, and a run that goes on after its first samples: the same bits."""
    scatter = Scatter("frequency", 0.01), Scatter("friction", 0.1)
    asked = Asked(tuned, scatter, np.linspace(331, 343, 5), seed=3, balance=FINE)
    one, two = (ensemble.run(asked, 6, workers=workers) for workers in (1, 2))
    ensemble.run(asked, 4, workers=1, file=tmp_path / "m.npz", inputs="a")
    going = ensemble.run(asked, 6, workers=1, file=tmp_path / "m.npz", inputs="a")
    for other in (two, going):
        assert one.rows.tobytes() == other.rows.tobytes()
        assert one.envelope.sums.tobytes() == other.envelope.sums.tobytes()


def test_many_samples_are_counted_at_no_cost(
    tuned: Tuned, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:  # fmt: skip
    """What is sorted and written again grows with the samples and not with their square: a hundred rows a sample."""
    rng = np.random.default_rng(0)
    grid, count, of = rng.uniform(1.0, 2.0, (3, 6)), 4000, ensemble.quantile

    def made(asked: Asked, number: int) -> Sample:
        top = Highest(0, 287.0, float(rng.gumbel(1.2, 0.05)), 0.0, np.array([287.0]), np.ones((1, 6)), (), False)
        return Sample(number, top, grid)

    kept, ordered = list[int](), list[int]()
    monkeypatch.setattr(ensemble, "sample", made)
    monkeypatch.setattr(ensemble, "_keep", lambda file, inputs, rows, **_: kept.append(len(rows)))
    monkeypatch.setattr(ensemble, "quantile", lambda x, *given: ordered.append(len(x)) or of(x, *given))
    asked = Asked(tuned, (Scatter("frequency", 0.01),), np.array([286.0, 287.0, 288.0]), stuck=True)
    found = ensemble.run(asked, count, workers=1, file=tmp_path / "m.npz")
    assert found.envelope.samples(6) == count and found.envelope.bins.sum() == 18 * count
    assert kept[-1] == count and sum(kept) < 110 * count and sum(ordered) < 110 * count


@pytest.mark.parametrize("distribution", ["normal", "lognormal", "uniform"])
def test_distributions(distribution: str) -> None:
    """Standard deviation and median as they are said to be, over 60,000 draws; no uniform one beyond sqrt(3) of it,
    nothing of a lognormal one below nothing."""
    s = Scatter("normal_force", 0.3, distribution)
    x = np.array([s.drawn(24, 1, 0, 1, i) for i in range(2500)]).ravel()
    assert x.std() == pytest.approx(0.3, rel=0.02)
    assert np.median(x) == pytest.approx(0.0, abs=0.006)
    least = {"normal": -np.inf, "lognormal": -1.0, "uniform": -0.3 * np.sqrt(3)}[distribution]
    assert x.min() > least and (distribution != "uniform" or x.max() < -least)


def test_patterns() -> None:
    """A/B and AAB go round the ring; drawn ones are of the values alone."""
    for values, N in (((0.0, 0.01), 6), ((0.0, 0.0, 0.01), 6)):
        s = Scatter("frequency", values=values)
        assert s.drawn(N, 1, 0, 1, 5)[:, 0] == pytest.approx(np.tile(values, N // len(values)))
    drawn = Scatter("frequency", values=(0.0, 0.01), arrangement="drawn")
    every = np.array([drawn.drawn(6, 1, 0, 1, i)[:, 0] for i in range(200)])
    assert set(every.ravel()) == {0.0, 0.01} and every.mean() == pytest.approx(0.005, abs=0.0005)


def test_the_order_of_what_scatters_is_none() -> None:
    """Blades are made and then carry what sits on them; contacts are pressed and then set apart: to rounding the same
    ring, whichever scatter is named first, and 1 um of gap is 1 um of gap."""
    one = sector()
    ring, rng = Tuned(one, {one.components[0].name: (one.contacts[0].name,)}), np.random.default_rng(0)
    sizes = {"gap": 1e-6, "added_mass": 1e-3, "frequency": 0.02, "damping": 0.1, "mass": 0.05, "friction": 0.1,
             "stiffness": 0.1, "normal_force": 0.1}  # fmt: skip
    asked = [Scatter(of, 0.1, at="probe" if of == "added_mass" else None) for of in sizes]
    known = [(s, sizes[s.of] * rng.uniform(0, 1, (6, ring.modes(s)))) for s in asked]
    first, *others = (ring.mistuned(order) for order in (known, known[::-1], [*known[4:], *known[:4]]))
    for other in others:
        for a, b in zip(first.components, other.components, strict=True):
            for name in ("M_r", "K_r", "C_r"):
                x, y = getattr(a.groups[0], name), getattr(b.groups[0], name)
                assert np.abs(x - y).max() < 1e-12 * np.abs(x).max()
        for c, d in zip(first.contacts, other.contacts, strict=True):
            assert d.offset == pytest.approx(c.offset, rel=1e-12)
    closed = ring.mistuned(known[1:])
    apart = [d.offset[0] - c.offset[0] for c, d in zip(first.contacts, closed.contacts, strict=True)]
    assert apart == pytest.approx(known[0][1][:, 0], rel=1e-9)


def test_a_ring_damped_by_its_stuck_modes() -> None:
    """Ratios a mode of the sector are those of N modes of the ring; stiffer blades damp no more by C of their own,
    which is none; ratios of bodies do not scatter, as there are none; modes that are mixed are refused."""
    for given in ((0.005,), (0.005, 0.05)):
        one = _damped(sector(), given)
        assert StickingRing(one.unrolled())(337.2) == pytest.approx(np.full(6, StickingRing(one)(337.2)[0]), rel=1e-9)
    ring = Tuned(one, {})
    faster = ring.mistuned([(Scatter("frequency", 0.1), np.full((6, 2), 0.1))])
    assert all(not m.groups[0].C_r.any() for m in faster.components)
    refused("stuck", ring.check, [Scatter("damping", 0.1)])
    mixed = _damped(sector(modes=3, tangential_stiffness=2e7, normal_stiffness=2e7), (0.005, 0.05))
    refused("one after the other", mixed.unrolled)


def _damped(one: Assembly, ratios: tuple[float, ...]) -> Assembly:
    """By its stuck modes alone."""
    groups = {0: replace(one.components[0].groups[0], C_r=0 * one.components[0].groups[0].C_r)}
    return replace(one, components=(replace(one.components[0], groups=groups),), stuck_damping=ratios)


def test_a_heavier_damper_presses_more() -> None:
    """Mass of a body whose contacts its centrifugal load presses: its density, and the forces of these contacts."""
    one = sector()
    name, contact = one.components[0].name, one.contacts[0].name
    thrown, lone = Tuned(one, {name: (contact,)}), Tuned(one, {})
    d = np.array([0.02, -0.01, 0.0, 0.03, -0.02, 0.01])[:, None]
    mass, force = Scatter("mass", 0.1), Scatter("normal_force", 0.1)
    ring = thrown.mistuned([(mass, d)])
    pressed = np.array([c.preload[0] for c in ring.contacts])
    assert pressed == pytest.approx(20.0 * (1 + d[:, 0]), rel=1e-12)
    groups = [m.groups[0] for m in ring.components]
    nominal = one.components[0].groups[0]
    for g, own in zip(groups, d[:, 0], strict=True):
        assert np.linalg.eigvals(np.linalg.solve(g.M_r, g.K_r)) == pytest.approx(nominal.omega**2 / (1 + own), rel=1e-9)
    other = lone.mistuned([(mass, d), (force, d)])
    assert _at(ring) == pytest.approx(_at(other), rel=1e-10)
    assert np.abs(_at(ring) / _at(lone.mistuned([(mass, d)])) - 1).max() > 1e-4


def _at(ring: object) -> np.ndarray:
    """Amplitudes where friction holds them back."""
    from microslip.harmonic_balance import problem as balance
    from microslip.harmonic_balance.solver import solve

    p = balance.of(ring, form="sides", **FINE)  # type: ignore[arg-type]
    return np.abs(amplitudes(p, solve(p, 2 * np.pi * SLIPS, [])))


def test_no_other_extreme_value_distribution_is_likelier() -> None:
    """Of a hundred samples each, several times: not the one that they were drawn from, nor those beside the fit."""
    kind = scipy.stats.genextreme
    for i, shape in enumerate(np.linspace(-0.1, 0.35, 30)):
        x = kind.rvs(shape, 1.06, 0.02, size=100, random_state=i)
        fit = fits(x)[0].parameters
        best = fit["shape"], fit["location"], fit["scale"]
        others = [(shape, 1.06, 0.02), *(np.array(best) * s for s in np.eye(3) * 0.04 + 0.98)]
        assert kind.nnlf(best, x) < min(kind.nnlf(other, x) for other in others)
