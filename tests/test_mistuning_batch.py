"""Rings that are solved together: the same answers as one by one, and the same bits whoever asks for which of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_mistuning import RUB, sector

from microslip.mistuning import batch as batches
from microslip.mistuning import ensemble
from microslip.mistuning.batch import Batch, Lanes, batch, derived, stepped, unknown_of
from microslip.mistuning.ring import Tuned
from microslip.mistuning.samples import Asked, SlidingRing, sample
from microslip.mistuning.scatter import Scatter

JENKINS = {**RUB, "law": "jenkins", "normal_force": 10.0}
MIXED = tuple(Scatter(of, by) for of, by in [("frequency", 0.01), ("normal_force", 0.1), ("stiffness", 0.05),
                                             ("damping", 0.1), ("friction", 0.1)])  # fmt: skip


def asked(scatter: tuple[Scatter, ...], grid: np.ndarray, harmonics: int = 3, **contact: object) -> Asked:
    balance = {"harmonics": harmonics, "samples": 32 if harmonics == 1 else 64}
    return Asked(Tuned(sector(**contact), {}), scatter, grid, 3, balance)


@pytest.fixture(autouse=True)
def large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Gaps of many points too, as on a GPU."""
    monkeypatch.setattr(batches, "LARGEST", 100)


def of(what: Asked) -> Batch:
    found = batch(what)
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("contact", "harmonics"),
    [({"law": "jenkins", "normal_force": 3.0}, (1, 3)), ({"normal_force": 5.0}, (0, 1, 2, 3)),
     ({"points": [2, 2], "normal_force": 5.0}, (0, 1, 2, 3))],
)  # fmt: skip
def test_a_solution_of_one_ring_is_one_of_the_batch(contact: dict[str, object], harmonics: tuple[int, ...]) -> None:
    """Where contacts slide and open, of blades, springs, forces and friction that differ: Newton's step from there, of
    another set of unknowns, is rounding, the read-outs are the same, and so are the unknowns on the way back."""
    what = asked(MIXED, np.linspace(330.0, 340.0, 3), **contact)
    together = of(what)
    assert together.marching.harmonics == harmonics
    whole = what.tuned.mistuned(what.deviations(7))
    one = SlidingRing(what.problem(whole), what.tuned_points)
    assert one(335.0) is not None
    y = one.ended(335.0)
    d, force = together.of_gaps(one.problem, one.known[335.0])
    rings, good, _ = together.rings([whole])
    at = Lanes(np.array([2 * np.pi * 335.0]), d[None], np.zeros(0), d[None], force[None], np.zeros(1, bool),
               unknown_of(together, rings))  # fmt: skip
    M, k, W = len(together.frame.order), len(together.frame.unit), d.shape[-1]
    slope = derived(together.frame, rings, d[None], np.zeros((1, M, k, W, k, W)), np.zeros(1, int), together.marching)
    moved, length, read, _ = stepped(together.frame, rings, at._replace(slope=slope), together.marching)
    assert good.all() and float(length[0]) < 1e-8
    assert np.asarray(read)[0, together.readers] == pytest.approx(y, rel=1e-8)
    assert np.asarray(moved.force)[0] == pytest.approx(force, rel=1e-8, abs=1e-8 * np.abs(force).max())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("contact", "grid", "harmonics"),
    [({"law": "jenkins", "normal_force": 10.0}, np.linspace(320, 345, 14), 3), ({}, np.linspace(325, 350, 14), 1),
     ({"points": [2, 2], "normal_force": 60.0}, np.linspace(325, 350, 14), 1)],
)  # fmt: skip
def test_samples_are_those_of_the_solver_of_single_rings(
    contact: dict[str, object], grid: np.ndarray, harmonics: int
) -> None:  # fmt: skip
    """Peaks to 1e-6; of those beside jumps it is the very answer."""
    what = asked(MIXED, grid, harmonics, **contact)
    for one in ensemble.several(what, range(40, 46)):
        alone = sample(what, one.number)
        assert one.top.amplitude == pytest.approx(alone.top.amplitude, rel=0.0 if one.alone else 1e-6)
        assert one.grid == pytest.approx(alone.grid, abs=1e-5 * one.top.amplitude, nan_ok=True)
        if not one.alone:  # the peak is as high, and may be a little beside: stress changes along it
            assert (one.top.output, one.stress) == (alone.top.output, pytest.approx(alone.stress, rel=1e-4))


@pytest.mark.slow
def test_a_sample_does_not_depend_on_which_others_are_asked_for() -> None:
    what = asked((MIXED[0],), np.linspace(320, 345, 8), 1, **{"law": "jenkins", "normal_force": 10.0})
    few, many = (ensemble.run(what, count, workers=1) for count in (19, 24))
    assert few.rows.tobytes() == many.rows[:19].tobytes()
    assert not many.column("alone")[16:].all()


def test_pieces_are_whole_blocks() -> None:
    """The first samples one by one; of chosen ones as many in their order."""
    first, block = ensemble.ALONE, ensemble.BLOCK
    found = ensemble._pieces(list(range(first - 2, first + block + 3)), True)
    assert found == [[first - 2], [first - 1], list(range(first, first + block)),
                     list(range(first + block, first + 2 * block))]  # fmt: skip
    chosen = [ensemble.FIRST + i for i in range(0, 3 * block, 2)]
    assert [len(piece) for piece in ensemble._pieces(chosen, True)] == [block, block // 2]
    assert ensemble._pieces([0, 1, first + 1], False) == [[0], [1], [first + 1]]


def test_what_is_solved_one_by_one() -> None:
    """Contacts that stick, blades of other modal files, friction that follows the speed."""
    scatter, grid = (Scatter("frequency", 0.01),), np.linspace(330.0, 340.0, 3)
    assert batch(replace(asked(scatter, grid, 1), stuck=True)) is None
    assert batch(asked((Scatter("modal_file", others={1: sector()}),), grid, 1)) is None
    assert batch(asked(scatter, grid, 1, friction={"kind": "falling", "mu_0": 0.3, "p_v": 1.0})) is None
