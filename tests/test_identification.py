"""Contact stiffness from measured frequencies, resonances over engine orders, envelopes over what is not known."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
import rings
import scipy.linalg
from refusals import refused
from test_assembly import FINE, sector
from test_neighbours import N, mesh, settings, whole  # noqa: F401 (fixtures)

from microslip.contact.patch import Patch, grid
from microslip.data import ModalBasis
from microslip.harmonic_balance import envelope, identification, response
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance.envelope import _snake
from microslip.harmonic_balance.identification import MeasuredFrequency, identify
from microslip.modal.compute import modal_basis
from microslip.ring.expansion import phase
from microslip.ring.neighbours import frame_change, stuck
from microslip.system.assembly import Assembly, Contact, ContactFace
from microslip.system.component import Component, Ring

SHROUD = (0.02, 0.03)  # m, of the patch whose springs are spread


@pytest.fixture(scope="module")
def basis() -> ModalBasis:
    return modal_basis(rings.bladed_sector("hexahedron20", N), settings("rubin"))


def ring(basis: ModalBasis) -> Assembly:
    """A sector whose right shroud meets the left one of the next sector; its law does not matter here."""
    faces = basis.groups[0, 0].interfaces
    patch = Patch("right", *grid(*SHROUD, (6, 4)), None)
    second = ContactFace("disc", "left", frame_change(basis, faces["right"], faces["left"]), 1)
    contact = Contact("shroud", patch, ContactFace("disc", "right"), second, np.zeros(6), np.zeros(6))
    component = Component("disc", {k: g for (_, k), g in basis.groups.items()}, sectors=N)
    return Assembly((component,), (contact,), (), (), Ring(N, 1))


def six(normal: float, tangential: float) -> np.ndarray:
    """Sextro Eqs. (5.2-39) to (5.2-41), uniform: n elements across b0 have the second moment b0^2 (1 - 1/n^2) / 12."""
    b, h = (size**2 / 12 * (1 - 1 / n**2) for size, n in zip(SHROUD, (6, 4), strict=True))
    return np.array([normal, tangential, tangential, tangential * (b + h), normal * h, normal * b])


def test_frequencies_are_those_of_stuck_neighbours(basis: ModalBasis) -> None:
    """Every nodal diameter, soft to stiff: the sector's eigenproblem with six springs a contact, 1e-9; the waves above
    N/2 have the frequencies of those that run the other way."""
    for normal in (1e6, 1e8, 1e10):
        found = identification.nodal_diagram(ring(basis), normal, 0.5, range(N), 5)
        for k in range(N):
            g = basis.groups[0, min(k, N - k)]
            direct = stuck(basis, g, "right", six(normal, 0.5 * normal))[0][:5] / (2 * np.pi)
            np.testing.assert_allclose(found.frequency[k], direct, rtol=1e-9)
    assert list(found.columns()) == ["nodal_diameter", *[f"mode_{j}_Hz" for j in range(1, 6)]]


@pytest.mark.parametrize("fit", [0, 1, 2, 3])
def test_one_nodal_diameter_tells_the_stiffness_and_predicts_the_others(basis: ModalBasis, fit: int) -> None:
    """Synthetic truth, c_N = 4e8 N/m and c_T half of it (Sextro section 5.4): fitted to one nodal diameter the
    stiffness comes out to 1e-6, every other frequency to 1e-9; with another ratio the fit holds, the others do not."""
    true, assembly = 4e8, ring(basis)
    f = identification.nodal_diagram(assembly, true, 0.5, None, 2).frequency
    known = [MeasuredFrequency(k, f[k, j], j) for k in range(4) for j in range(2)]
    found = identification.identify(assembly, known[2 * fit], 0.5, known)
    assert found.stiffness == pytest.approx(true, rel=1e-6)
    assert np.abs(found.error).max() < 1e-9
    wrong = identification.identify(assembly, known[2 * fit], 2.0, known)
    assert abs(wrong.error[2 * fit]) < 1e-9
    assert np.abs(wrong.error).max() > 1e-3
    words = " ".join(found.sentences())
    assert "c_N = 4e+08 N/m and c_T = 2e+08 N/m" in words and "The 7 other frequencies" in words


def test_stiffness_from_frequencies_of_the_finite_elements(basis: ModalBasis, whole) -> None:  # noqa: F811
    """Measured on the whole sector, every unknown of it: the stiffness comes out to 0.1 %, nodal diameters that were
    not fitted to 2e-4 in frequency, which is what Rubin's basis errs by."""
    true, truth = 4e8, []
    for k, (K, M, B) in whole.items():
        g = basis.groups[0, k]
        D = frame_change(basis, g.interfaces["right"], g.interfaces["left"])
        G = D @ B["left"] * phase(g, N, 1) - B["right"]
        value = scipy.linalg.eigh(
            K + G.conj().T @ (six(true, 0.5 * true)[:, None] * G), M, eigvals_only=True, subset_by_index=[0, 0]
        )
        truth.append(MeasuredFrequency(k, float(np.sqrt(value[0])) / (2 * np.pi)))
    found = identification.identify(ring(basis), truth[2], 0.5, truth)
    assert found.stiffness == pytest.approx(true, rel=1e-3)
    assert np.abs(found.error).max() < 2e-4


def test_sensitivity_is_the_slope_of_the_frequency(basis: ModalBasis) -> None:
    """d ln f / d ln c by the strain energy in the springs: half its share of the whole, 1e-5."""
    assembly = ring(basis)
    f = identification.nodal_diagram(assembly, 4e8, 0.5, [1], 1).frequency[0, 0]
    found = identification.identify(assembly, MeasuredFrequency(1, f), 0.5)
    g = basis.groups[0, 1]
    omega, V = stuck(basis, g, "right", six(4e8, 2e8))
    own = (V[:, 0].conj() @ g.K_r @ V[:, 0]).real / omega[0] ** 2
    assert found.sensitivity == pytest.approx(0.5 * (1 - own), rel=1e-5)
    assert found.limits[0] == pytest.approx(g.omega[0] / (2 * np.pi), rel=1e-6)
    # a rigid joint: no relative motion at all
    assert found.limits[1] == pytest.approx(stuck(basis, g, "right")[0][0] / (2 * np.pi), rel=1e-3)


def test_a_ring_of_lone_blades_is_identified_alike() -> None:
    """Six blades joined by contacts alone, all nodal diameters from one group."""
    assembly = sector(6, 1)
    f = identification.nodal_diagram(assembly, 2e6, 0.5, range(4), 1).frequency[:, 0]
    measured = [MeasuredFrequency(k, f[k]) for k in range(4)]
    found = identification.identify(assembly, measured[3], 0.5, measured)
    assert found.stiffness == pytest.approx(2e6, rel=1e-8)
    assert np.abs(found.error).max() < 1e-9
    rows = found.columns()
    assert rows["fitted"].tolist() == [0, 0, 0, 1] and rows["nodal_diameter"].tolist() == [0, 1, 2, 3]


def test_frequencies_that_no_stiffness_gives_are_told(basis: ModalBasis) -> None:
    assembly = ring(basis)
    for words, call in (
        ("no stiffness gives the measured 1 Hz", lambda: identify(assembly, MeasuredFrequency(1, 1.0), 0.5)),
        ("no stiffness gives the measured 1e", lambda: identify(assembly, MeasuredFrequency(1, 1e6), 0.5)),
        ("must be above 0", lambda: identify(assembly, MeasuredFrequency(1, 1e3), 0.0)),
        ("have only", lambda: identify(assembly, MeasuredFrequency(1, 1e3, 500), 0.5)),
        ("have no contact", lambda: identify(replace(assembly, contacts=()), MeasuredFrequency(1, 1e3), 0.5)),
    ):
        refused(words, call)


# ---------------------------------------------------------------- resonance over engine order


@pytest.mark.slow
def test_resonances_over_engine_order_are_those_of_the_stuck_ring() -> None:
    """Pressed hard, so that contacts only stick: each order's peak is that of the linear sector, searched for on a
    grid of a millionth; amplitudes to 1e-6, orders beyond N/2 like those that alias onto them."""
    one = sector(6, 1, normal=1e4, push=1.0)

    def build(order: int) -> balance.Problem:
        return balance.of(replace(one, ring=Ring(6, order)), harmonics=1, samples=16, cycles=10, length=1e-6)

    found = envelope.over_orders(build, [1, 2, 3, 4], (150.0, 600.0), points=46)
    for i, order in enumerate((1, 2, 3, 4)):
        problem = build(order)
        part, k = problem.parts[1][0], problem.stiffness[0]
        K = part.K + part.rows.conj().T @ k @ part.rows
        fine = 2 * np.pi * found.frequency[i] * (1 + np.linspace(-1e-3, 1e-3, 2001))
        size = [abs((part.output @ np.linalg.solve(K - w**2 * part.M + 1j * w * part.C, part.load))[0]) for w in fine]
        assert found.amplitude[i] == pytest.approx(max(size), rel=1e-6)
        assert found.frequency[i] == pytest.approx(fine[int(np.argmax(size))] / (2 * np.pi), rel=3e-6)
    assert found.index.tolist() == [1, 2, 3, 4] and not found.failed.any()
    assert found.frequency[3] == pytest.approx(found.frequency[1], rel=1e-4)
    assert found.stuck[0] == pytest.approx(found.frequency[0], rel=2e-3)


@pytest.mark.slow
def test_a_band_without_a_resonance_says_so() -> None:
    one = sector(6, 1, normal=1e4, push=1.0)

    def build(order: int) -> balance.Problem:
        return balance.of(replace(one, ring=Ring(6, order)), harmonics=1, samples=16, cycles=10)

    said: list[str] = []
    found = envelope.over_orders(build, [1], (5.0, 10.0), points=5, report=said.append)
    assert np.isnan(found.frequency[0]) and "no resonance in the band" in said[-1]


# ---------------------------------------------------------------- envelopes


def shaken(damping: float, load: float, normal: float) -> balance.Problem:
    one = sector(6, 1, normal=normal, push=load)
    component = one.components[0]
    g = component.groups[0]
    damped = replace(g, C_r=g.C_r * (damping / 0.01))
    return balance.of(replace(one, components=(Component("blade", {0: damped}),)), **{**FINE, "harmonics": 1})


@pytest.mark.slow
def test_envelope_encloses_every_combination() -> None:
    """Each combination against its own cold sweep, 1e-8; smallest and largest of them at every frequency."""
    f = np.linspace(50, 75, 7)
    ranges = {"damping": (0.01, 0.03), "load": (1.0, 4.0), "normal": (5.0, 20.0)}
    found = envelope.envelope(shaken, ranges, f)
    assert found.converged.all() and len(found.values) == 8
    cold = [np.abs(response.harmonic_response(shaken(*c), f).monitor) for c in found.values]
    np.testing.assert_allclose(np.abs(found.monitor), cold, rtol=1e-8)
    np.testing.assert_allclose(found.low, np.min(cold, axis=0), rtol=1e-8)
    np.testing.assert_allclose(found.high, np.max(cold, axis=0), rtol=1e-8)
    assert list(found.columns())[:3] == ["frequency_Hz", "low_m", "high_m"]
    assert list(found.corners()) == ["combination", "damping", "load", "normal", "peak_m", "failed_points"]


def test_combinations_change_one_value_at_a_time() -> None:
    order = list(_snake([[1, 2, 3], [4, 5], [6, 7, 8]]))
    assert len({tuple(x) for x in order}) == 18
    assert all(sum(a != b for a, b in zip(x, y, strict=True)) == 1 for x, y in pairwise(order))
    refused("load: give one or more", envelope.envelope, shaken, {"load": ()}, np.array([50.0]))


def test_pictures_are_drawn(tmp_path, basis: ModalBasis) -> None:
    """Every picture from results with a gap in them (a peak that is missing, a point that failed)."""
    from microslip.pictures import coupled
    from microslip.pictures.plots import save

    diagram = identification.nodal_diagram(ring(basis), 4e8, 0.5, None, 2)
    known = [MeasuredFrequency(k, diagram.frequency[k, 0] * (1 + 0.001 * k)) for k in range(4)]
    found = identification.identify(ring(basis), known[1], 0.5, known)
    draws = [partial(coupled.nodal_diameter_picture, [diagram], title="a", found=found)]
    gap = np.array([1.0, np.nan, 2.0])
    orders = envelope.OverOrders(
        np.arange(3), np.arange(3), 100 * gap, 1e-6 * gap, 90 * gap, np.zeros(3, int), 1e6 * gap, 99 * gap
    )
    draws.append(partial(coupled.over_orders_picture, {"100 N": orders}, title="b"))
    f, a = np.linspace(10, 20, 5), np.outer([1, 2], 1e-6 * np.arange(1, 6))
    ok = np.ones((2, 5), dtype=bool)
    ok[:, 2] = False
    many = envelope.Envelope(f, ("load",), np.array([[1.0], [2.0]]), a + 0j, ok, np.ones((2, 5)))
    assert np.isnan(many.low[2]) and many.high[1] == 4e-6
    draws.append(partial(coupled.envelope_picture, many, title="c"))
    draws.append(partial(coupled.speed_line_picture, f, 2 * f, a[0], np.outer(f, [1, 2]), title="d"))
    assert all(save(draw, tmp_path / "a.png").stat().st_size > 10000 for draw in draws)
