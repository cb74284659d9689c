"""The published disc brake (geometry/disc-brake): roots, completeness and one basis over its speeds.

N. Graebner, V. Mehrmann, S. Quraishi, C. Schroeder, U. von Wagner, ZAMM 96 (2016) 1388-1405, model M0. Reference roots
at Omega = 4 pi by another program: shift-invert Arnoldi on the companion form and inverse iteration, two covers of the
window with other shifts and start vectors.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from microslip.cli import main
from microslip.linalg import winding
from microslip.linalg.quadratic import factors_near, search
from microslip.linalg.sampled import sampled
from microslip.roots.spectrum import spectrum
from microslip.stages.stability import question

BRAKE = Path(__file__).parents[2] / "geometry" / "disc-brake"
UNSTABLE = {784.9901962: 5.474173697 + 4932.238867j, 2769.2303986: 74.83064247 + 17399.58775j}
OTHERS = {224.275: -1.122, 531.048: -1.834, 560.459: -1.433, 642.724: -2.367, 777.601: -17.105, 816.561: 9.59e-05,
          1606.623: -0.043, 1630.453: -19.003, 2600.468: -1.913, 2600.938: -35.721}  # fmt: skip


@pytest.fixture(scope="module")
def brake():
    return question(BRAKE, [])


def test_the_unstable_roots_and_the_neutral_one(brake):
    """Both to 1e-8 relative, all ten others to the digits of the reference, the undecided one as neutral."""
    found = spectrum(brake.family().at(brake.at), brake.window, neutral=brake.asked.neutral, certify=False)
    s = found.roots.s
    assert len(s) == 12 and found.verdict.count("unstable") == 2 and found.verdict.count("neutral") == 1
    for hertz, root in UNSTABLE.items():
        i = int(np.abs(found.frequency - hertz).argmin())
        assert abs(s[i] - root) < 1e-8 * abs(root) and abs(s[i].real / root.real - 1) < 1e-8
        assert found.verdict[i] == "unstable" and found.roots.residual[i] < 1e-11
    for hertz, growth in OTHERS.items():
        i = int(np.abs(found.frequency - hertz).argmin())
        assert found.frequency[i] == pytest.approx(hertz, abs=6e-4)
        assert found.growth[i] == pytest.approx(growth, abs=6e-4 if abs(growth) > 1e-3 else 6e-8)
    assert found.verdict[int(np.abs(found.frequency - 816.561).argmin())] == "neutral"
    assert found.roots.backward_error.max() < 1e-15


@pytest.mark.slow
def test_no_root_of_the_window_is_missing_and_a_dropped_one_is_noticed(brake, monkeypatch):
    """The argument principle with all roots known, without one of those that grow, and without the neutral one.

    The determinant at a place of the border is that of the system, whichever roots are known: it is computed once.
    """
    Q = brake.family().at(brake.at)
    found = search(Q, brake.window)

    @cache
    def at(s):
        determinant = factors_near(Q, s).log_determinant()
        return SimpleNamespace(log_determinant=lambda: determinant)

    monkeypatch.setattr(winding, "factors_near", lambda _, s: at(s))
    assert winding.missed(Q, brake.window, found.s).missed == 0
    for hertz in (784.99, 816.56):
        dropped = int(np.abs(found.s.imag / (2 * np.pi) - hertz).argmin())
        assert winding.missed(Q, brake.window, np.delete(found.s, dropped)).missed == 1


@pytest.mark.slow
def test_one_basis_over_the_speeds(brake):
    """At speeds that the basis was not made from, to 1e-6 against full solutions; how many grow changes."""
    family, (low, high) = brake.family(), brake.asked.range
    basis = sampled(family, "speed", low, high, brake.window)
    counts = []
    for speed in (7.0, 17.3, 29.0):
        exact = spectrum(family.at({"speed": speed}), brake.window, neutral=1e-3, certify=False)
        s, error, _ = basis.at(speed)
        assert len(s) == len(exact.roots) and np.abs(basis.samples - speed).min() > 0.1
        grows = exact.growth > 1e-3
        counts.append(int((s.real > np.maximum(error, 1e-3)).sum()))
        assert counts[-1] == grows.sum()
        away = np.abs(s - exact.roots.s)
        assert (away[grows] < 1e-6 * np.abs(s[grows])).all() and (away <= error).all()
        assert (away[grows] < 1e-4 * exact.growth[grows]).all()  # the growth rates themselves
    assert counts == [2, 3, 4]


@pytest.mark.slow
def test_the_printed_damping_would_not_squeal(brake):
    """The damping as the paper prints it, D1 + DR / Omega + Omega DG + D4 / f_ref, is another system: nothing grows."""
    from dataclasses import replace

    family = brake.family()
    terms = [t for t in family.terms if not (t.role == "damping" and t.factor == -1)]
    terms = [replace(t, factor=1 / 1600) if 0 < t.factor < 1e-3 else t for t in terms]
    found = spectrum(replace(family, terms=tuple(terms)).at(brake.at), brake.window, neutral=1e-3, certify=False)
    assert "unstable" not in found.verdict
    for hertz, growth in ((783.825, -39.225), (2769.678, None)):
        i = int(np.abs(found.frequency - hertz).argmin())
        assert found.frequency[i] == pytest.approx(hertz, abs=6e-4) or growth is None
        if growth is not None:
            assert found.growth[i] == pytest.approx(growth, abs=6e-4)


@pytest.mark.slow
def test_the_command_line_tells_it_in_one_sentence(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["stability", str(BRAKE), "--set", "stability.points=3", "--no-pictures"]) == 0
    told = capsys.readouterr().out
    assert (
        "2 of 12 roots grow: 784.99 Hz by 5.474 1/s, 2769.23 Hz by 74.83 1/s; 1 neutral; complete: counted 12" in told
    )
    assert "2 of 12 roots grow" in (tmp_path / "build/disc-brake/stability.html").read_text(encoding="utf-8")
