"""A case that takes fewer modes than its body stores: leading blocks, the compliance they leave, refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from refusals import refused

from microslip.basis import read_basis
from microslip.case import load_case, run_case
from microslip.case.assemble import build
from microslip.case.run import free_response
from microslip.data import ModalBasis
from microslip.errors import UserError
from microslip.operating.motion import motion_of
from microslip.reduced.coordinates import first_modes
from microslip.stages.running import respond

pytestmark = pytest.mark.usefixtures("undrawn", "unjudged")

SAMPLES = Path(__file__).parents[1] / "pipeline/microslip/samples"


@pytest.fixture(scope="module")
def sample() -> ModalBasis:
    return read_basis(SAMPLES / "basis.h5")


def test_first_modes_are_the_leading_ones_and_leave_more_compliance(sample: ModalBasis) -> None:
    """Matrices and rows are leading parts; the compliance held is the sum over those modes, 1e-9; static stays."""
    g, few = sample.groups[0, 0], first_modes(sample.groups[0, 0], 4)
    np.testing.assert_array_equal(few.omega, g.omega[:4])
    np.testing.assert_allclose(few.K_r, g.K_r[:4, :4], rtol=1e-15)
    np.testing.assert_array_equal(few.phi, g.phi[..., :4])
    name = next(iter(g.interfaces))
    rows = g.interfaces[name].rows
    np.testing.assert_array_equal(few.interfaces[name].rows, rows[:, :4])
    at = [g.compliance.labels.index(f"interface:{name}:{row}") for row in ("u_n", "u_t1", "u_t2")]
    by_hand = (rows[:3, :4] / g.omega[:4] ** 2) @ rows[:3, :4].T
    np.testing.assert_allclose(few.compliance.modal[np.ix_(at, at)], by_hand, rtol=1e-9)
    np.testing.assert_array_equal(few.compliance.static, g.compliance.static)
    assert first_modes(g, g.n_modes) is g


LINEAR = [
    "sweep.normal_forces=[100.0]",
    "harmonics=1",
    "samples=48",
    *(f"contacts.{side}.{key}" for side in ("right", "left") for key in ('law="jenkins"', "points=[2, 1]")),
]


def test_a_case_takes_as_many_modes_as_it_says(sample: ModalBasis) -> None:
    """The free response is the sum over the first four modes, and what they leave of the static one: 1e-10.

    The law of the sample counts the surface alone, so the file's static compliance stands beside the modes."""
    settings, _ = load_case(SAMPLES / "case.toml", ["modes=4", "sweep.points=5", *LINEAR])
    result = run_case(settings, sample)
    g = sample.groups[0, 0]
    Omega = 2 * np.pi * result.free.frequency[:, None]
    watched = g.monitors[settings.monitor]
    row = watched.rows[watched.labels.index(f"u_{settings.direction}")]
    gain = row * settings.amplitude * g.excitations[settings.excitation].rows[0]
    names = g.compliance.labels
    at = names.index(f"monitor:{settings.monitor}:u_{settings.direction}")
    whole = settings.amplitude * g.compliance.static[at, names.index(f"excitation:{settings.excitation}:force")]
    left = whole - (gain / g.omega**2)[:4].sum()
    by_hand = left + (gain / (g.omega**2 - Omega**2 + 2j * g.damping_ratio * g.omega * Omega))[:, :4].sum(axis=1)
    np.testing.assert_allclose(result.free.monitor, by_hand, rtol=1e-10)


@pytest.mark.parametrize("points", [5, 400])
def test_the_free_response_has_its_true_peak_on_any_grid(sample: ModalBasis, points: int) -> None:
    """Against 20001 frequencies about the resonance, within 0.2 %; the ends of the sweep stay the ends."""
    settings, _ = load_case(SAMPLES / "case.toml", [f"sweep.points={points}"])
    built = build(settings, {settings.components[0].name: sample})
    free = free_response(built, np.linspace(settings.sweep.start, settings.sweep.stop, points))
    assert free.frequency[0] == settings.sweep.start and free.frequency[-1] == settings.sweep.stop
    assert np.all(np.diff(free.frequency) > 0)
    top = np.abs(free.monitor).argmax()
    f = free.frequency[top]
    near = free_response(built, np.linspace(0.99 * f, 1.01 * f, 20001))
    highest = np.abs(near.monitor).max()
    assert 0.998 * highest <= np.abs(free.monitor[top]) <= highest * (1 + 1e-12)


@pytest.mark.parametrize(("modes", "words"), [(99, "99 modes are asked for, but"), (0, "modes")])
def test_more_modes_than_stored_are_refused_in_one_sentence(sample: ModalBasis, modes: int, words: str) -> None:
    with pytest.raises(UserError, match=words) as caught:
        settings, _ = load_case(SAMPLES / "case.toml", [f"modes={modes}"])
        run_case(settings, sample)
    assert "\n" not in str(caught.value).strip()


def test_what_a_response_file_keeps_is_read_with_as_many_modes(tmp_path: Path, sample: ModalBasis) -> None:
    """Displacements of the kept coordinates with the whole modal file are those of its first modes."""
    from microslip.results import read_response

    changes = ["modes=4", "sweep.points=3", 'name="few"', *LINEAR]
    respond(SAMPLES / "case.toml", SAMPLES / "basis.h5", changes, root=tmp_path)
    response = read_response(tmp_path / "build/few/response.h5")
    motion = response.motion(response.series[0], sample)
    assert motion.parts[1].group.n_modes == motion.parts[1].q.shape[1] == 4
    few = motion.parts[1].q[:, None]
    refused("4 coordinates of a body were given", motion_of, motion.Omega, few, sample.groups[0, 0])
