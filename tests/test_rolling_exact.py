"""Exact half-spaces between the profiles of a case: what the strips of the case are compared with."""

import csv
from pathlib import Path

import numpy as np
import pytest

from microslip.contact.solids import Solid
from microslip.rolling import exact as beside
from microslip.rolling.settings import load_rolling
from microslip.rolling.study import RollingAnswer, study
from microslip.rolling.wheelset import across

ROOT = Path(__file__).resolve().parents[1]
CASE = ROOT / "pipeline" / "cases" / "wheel-rail.toml"


def studied(*changes: str) -> RollingAnswer:
    return study(load_rolling(CASE, ["creep.points=31", *changes])[0], CASE)


def test_circles_are_hertz_s_bodies() -> None:
    """The gap across is B y^2 over the patch, and the largest pressure that of Hertz: 0.1 %."""
    s = studied("model.exact=2")
    p = s.patches[0]
    y, h = across(s.track, s.case.posed(), "right", p)
    inside = np.abs(y) < p.b
    np.testing.assert_allclose(h[inside], p.B * y[inside] ** 2, atol=1e-3 * p.approach)
    assert s.exact is not None and s.exact.pressure == pytest.approx(p.pressure, rel=1e-3)


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Grids of half as many elements, for what is so on any."""
    monkeypatch.setattr(beside, "ELEMENTS", 22)


@pytest.mark.usefixtures("coarse")
def test_left_and_right_mirror() -> None:
    right = studied("model.exact=3")
    left = studied("model.exact=3", "pose.side='left'", "pose.lateral=-0.004")
    assert left.exact is not None and right.exact is not None
    np.testing.assert_allclose(left.exact.x, right.exact.x, rtol=1e-6, atol=1e-6 * right.held)
    np.testing.assert_allclose(left.exact.y, -right.exact.y, rtol=1e-6)


@pytest.mark.slow
def test_the_extrapolated_answer_stays_on_finer_grids(monkeypatch: pytest.MonkeyPatch) -> None:
    """Within the 1 % of mu F_N that are told; beyond saturation the force is mu F_N to 0.1 %."""
    coarse = studied("model.exact=3").exact
    monkeypatch.setattr(beside, "ELEMENTS", 66)
    s = studied("model.exact=3")
    assert coarse is not None and s.exact is not None
    assert np.hypot(s.exact.x - coarse.x, s.exact.y - coarse.y).max() < 0.01 * s.held
    assert np.hypot(s.exact.x, s.exact.y)[-1] == pytest.approx(s.held, rel=1e-3)


def test_a_measured_profile_is_pressed_as_it_is() -> None:
    """The gap of a worn shape is no parabola: the largest pressure is 12 % above that of Hertz' ellipse of mean
    curvature, and a wheel that goes the other way on the other side says the same."""
    profiles = ROOT / "tests" / "validation" / "profiles"
    files = [f"wheel.profile='{profiles}/MBench_S1002_v3.prw'", f"rail.profile='{profiles}/MBench_UIC60_v3.prr'"]
    s = studied("model.exact=2", "rail.at=0.7605326", "wheel.at=0.75", *files)
    assert s.exact is not None and s.exact.pressure / s.patches[0].pressure == pytest.approx(1.121, abs=0.005)


@pytest.mark.usefixtures("coarse")
def test_states_are_where_the_force_changes() -> None:
    """Of 31 states up to far beyond saturation; none where none are asked for."""
    s = studied("model.exact=6")
    assert s.exact is not None and s.exact.at[0] == 0 and np.median(s.exact.at) < 10
    none = studied("model.exact=0")
    assert none.exact is None and "Exact half-spaces" not in " ".join(none.sentences())


def test_a_patch_that_is_wider_than_the_grid_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(beside, "WIDE", (0.5, 0.9))
    told = studied("creep.points=3").sentences()
    assert "Exact half-spaces could not be had: the patch is more than 0.9 times as wide as Hertz' ellipse." in told


def test_a_profile_ends_where_it_ends() -> None:
    """The rail is 20 mm wide and the wheel stands 4 mm from its edge: all of the force is on it."""
    s = studied("rail.width=0.02", "model.exact=2")
    assert s.exact is not None and s.exact.pressure > s.patches[0].pressure


@pytest.mark.usefixtures("coarse")
def test_the_table_is_what_the_sentence_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    from microslip.cli import main

    monkeypatch.chdir(tmp_path)
    assert main(["roll", str(CASE), "--no-pictures"]) == 0
    said = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("Exact half-spaces"))
    exact, curve = (list(csv.DictReader((tmp_path / f"build/wheel-rail/{n}.csv").open())) for n in ("exact", "creep"))
    by = {row["longitudinal_creepage"]: row for row in curve}
    off = [np.hypot(*(float(row[key]) - float(by[row["longitudinal_creepage"]][key]) for key in KEYS)) for row in exact]
    assert f"at most {100 * max(off):.2g} % of mu F_N" in said and f"at {len(exact)} points" in said


KEYS = ("F_x_forward_over_mu_F_N", "F_y_left_over_mu_F_N")


@pytest.mark.usefixtures("coarse")
def test_unlike_bodies_are_both_counted() -> None:
    """A soft wheel on a hard rail spreads the patch as their mean does."""
    s = studied("wheel.young=7e10", "model.exact=2")
    assert s.exact is not None and s.exact.pressure == pytest.approx(s.patches[0].pressure, rel=0.02)
    assert Solid(7e10, 0.28).shear < s.track.elastic.shear < Solid(2.1e11, 0.28).shear
