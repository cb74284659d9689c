"""Measured profiles: roughness numbers and distributions of shapes whose values are known, and wrong files."""

from pathlib import Path

import jax
import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from refusals import refused

from microslip.contact.heights import Linear, Polynomial
from microslip.contact.topography import (
    SurfaceProfile,
    fit_roughness,
    heights,
    levelled,
    material_curve,
    read_instrument,
    read_profile,
    roughness,
)
from microslip.errors import UserError

AREA, VOLUME = jax.jit(lambda h, x: h.area(x)), jax.jit(lambda h, x: h.volume(x))
UM = 1e-6


def written(tmp_path: Path, text: str, name: str = "ground.txt") -> Path:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def sawtooth(teeth: int = 50) -> SurfaceProfile:
    """Peaks of 4 um, straight flanks: linear heights."""
    x = np.linspace(0, 1e-3, 2 * teeth + 1)
    return SurfaceProfile(x, 4 * UM * (np.arange(2 * teeth + 1) % 2))


def polynomial(points: int = 2001) -> SurfaceProfile:
    """A hill and its mirror image whose heights have the distribution 3 x^2 - 2 x^3 with R_Z = 7 um."""
    fine = np.linspace(0, 1, 100001)
    depth = np.interp(np.linspace(0, 1, points), fine**2 * (3 - 2 * fine), fine)
    return SurfaceProfile(np.linspace(0, 4e-3, 2 * points - 1), -7 * UM * np.concatenate([depth[::-1], depth[1:]]))


def test_roughness_numbers_of_a_sawtooth() -> None:
    """Ra = h/4 needs the straight flanks between the points; so does Rq = h/sqrt(12): sampled finely."""
    coarse = sawtooth()
    x = np.linspace(0, 1e-3, 50 * 400 + 1)
    found = roughness(SurfaceProfile(x, np.interp(x, coarse.x, coarse.z)))
    expected = [UM, 4 * UM / 12**0.5, 4 * UM, 4 * UM, 4 * UM]
    assert np.allclose([found.Ra, found.Rq, found.Rt, found.Rmax, found.Rz], expected, rtol=1e-4)


def test_roughness_depths_of_different_sampling_lengths() -> None:
    """Peak to valley 1, 2, 3, 4, 5 um in the five lengths, valleys at 0: Rz is the mean, Rmax the largest."""
    x = np.linspace(0, 5e-3, 5001)
    depth = np.minimum(np.floor(x / 1e-3), 4) + 1
    profile = SurfaceProfile(x, UM * depth * np.sin(np.pi * x / 1e-3 * 4) ** 2)
    found = roughness(profile)
    assert found.Rz == pytest.approx(3 * UM, rel=1e-3)
    assert found.Rmax == pytest.approx(5 * UM, rel=1e-3) and found.Rt == pytest.approx(5 * UM, rel=1e-3)


def test_a_sawtooth_has_linear_heights_exactly() -> None:
    """Two points a flank are enough: the profile is taken as straight between its points."""
    table = heights(sawtooth(), 4 * UM)
    x = np.linspace(-0.2, 1.3, 77)
    assert np.abs(AREA(table, x) - AREA(Linear(), x)).max() < 1e-12
    assert np.abs(VOLUME(table, x) - VOLUME(Linear(), x)).max() < 1e-12


def test_a_profile_with_the_books_distribution_gives_the_books_law() -> None:
    """3.3-24 back from a profile; straight pieces of 1/2000 of its length leave about that at the vertical peak."""
    profile = polynomial()
    fit = fit_roughness(profile)
    assert fit.roughness == pytest.approx(7 * UM, rel=1e-3) and fit.residual < 1e-3
    table = heights(profile, 7 * UM, 513)
    x = np.linspace(0, 1.2, 200)
    assert np.abs(VOLUME(table, x) - VOLUME(Polynomial(), x)).max() < 1e-4


@hypothesis_settings(max_examples=40, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), points=st.integers(10, 300), flat=st.booleans())
def test_every_profile_gives_a_law(seed, points, flat) -> None:
    """Steps, plateaus, unequal spacing: the area rises from 0 to 1, and the mean depth is that of the profile."""
    rng = np.random.default_rng(seed)
    z = rng.normal(size=points) * UM
    if flat:
        z = np.round(z, 6)
        z[0], z[1] = 0, UM
    x = np.cumsum(rng.uniform(0.1, 2, size=points)) * UM
    profile = SurfaceProfile(x, z)
    depth, share = material_curve(profile, 2049)
    assert share[0] == 0 and share[-1] == 1 and np.all(np.diff(share) >= 0)
    mean_depth = z.max() - np.trapezoid(z, x) / np.ptp(x)
    from_curve = depth[-1] - np.trapezoid(share, depth)
    assert from_curve == pytest.approx(mean_depth, abs=depth[-1] / 1024)  # one step of the table at a jump
    assert heights(profile, depth[-1]).x[-1] == pytest.approx(1)


def test_levelling_takes_off_what_it_says() -> None:
    x = np.linspace(0, 2e-3, 501)
    z = UM * np.sin(np.linspace(0, 40 * np.pi, 501))
    tilted = SurfaceProfile(x, z + 0.01 * x + 5e-6)
    straight = levelled(tilted, 1)
    assert np.abs(straight.z - levelled(SurfaceProfile(x, z), 1).z).max() < 1e-15
    assert np.abs(levelled(SurfaceProfile(x, z + 3 * x**2), 2).z - levelled(SurfaceProfile(x, z), 2).z).max() < 1e-15
    assert levelled(tilted, None) is tilted
    assert abs(np.trapezoid(straight.z * (x - 1e-3), x)) < 1e-12 * UM * 1e-3


def test_a_map_is_its_lines_together() -> None:
    one = sawtooth()
    both = SurfaceProfile(one.x, np.array([one.z, 0.5 * one.z]))
    found = roughness(both)
    assert found.Rt == 4 * UM and found.Rz == pytest.approx(3 * UM)
    table = heights(both, 4 * UM, 513)
    x = np.linspace(0, 1, 50)
    expected = 0.5 * x + 0.5 * np.clip((x - 0.5) / 0.5, 0, 1)
    assert np.abs(AREA(table, x) - expected).max() < 1e-12


@pytest.mark.parametrize("separator", [" ", "\t", ",", ";", " ; "])
def test_columns_units_and_headings_are_read(tmp_path, separator) -> None:
    rows = "\n".join(f"{0.01 * i}{separator}{(-1) ** i * 2.5}" for i in range(20))
    path = written(tmp_path, f"# disc, ground\nx{separator}z\n\n{rows}\n")
    profile = read_profile(path, ("mm", "um"), None)
    assert np.allclose(profile.x, 1e-5 * np.arange(20)) and np.allclose(np.abs(profile.z), 2.5 * UM)
    assert np.ptp(read_profile(path, "um", None).x) == pytest.approx(0.19 * UM)


def lines(change: dict[int, str], count: int = 12) -> str:
    return "\n".join(change.get(i, f"{i} {i % 3}") for i in range(1, count + 1))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (lines({3: "3 nan"}), r"line 3: z is no finite number"),
        (lines({1: "nan 3"}), r"line 1: x is no finite number"),
        (lines({4: "4 abc"}), r"line 4: column 2: 'abc' is no number"),
        (lines({5: "2 1"}), r"line 5: x = 2 does not lie behind 4; sort"),
        (lines({5: "4 1"}), r"line 5: x = 4 does not lie behind 4"),
        (lines({6: "6"}), r"line 6: column 2: there is none"),
        (lines({}, 9), r"9 points; a profile needs ten"),
        ("", r"is empty"),
        ("\n".join(f"{i} 4.5" for i in range(20)), r"z is 4.5e-06 m everywhere"),
    ],
)
def test_a_wrong_file_is_told_in_a_sentence(tmp_path, text, sentence) -> None:
    path = written(tmp_path, text)
    refused((sentence, str(path)), read_profile, path, "um")


def test_missing_files_units_and_extras_are_told(tmp_path, monkeypatch) -> None:
    refused("cannot be read", read_profile, tmp_path / "none.txt", "um")
    refused("unit of length 'furlong'", read_profile, written(tmp_path, lines({})), ("mm", "furlong"))
    monkeypatch.setitem(__import__("sys").modules, "SurfaceTopography", None)
    refused('pip install "microslip[profile]"', read_profile, tmp_path / "disc.sur", "um")


def test_files_of_instruments(tmp_path) -> None:
    """A line and a map that SurfaceTopography itself has written."""
    st_ = pytest.importorskip("SurfaceTopography", reason="the extra [profile], half a gigabyte, is not locked")
    z = UM * np.sin(np.linspace(0, 30, 60))
    st_.UniformLineScan(z / UM, 1000.0, unit="um").to_netcdf(str(tmp_path / "line.nc"))
    line = read_instrument(tmp_path / "line.nc", None)
    assert np.allclose(line.z, z, atol=1e-12) and line.x[1] - line.x[0] == pytest.approx(1e-3 / 60)
    st_.Topography(np.outer(z / UM, [1, 0.5, 2, 1]), (1000.0, 40.0), unit="um").to_netcdf(str(tmp_path / "map.nc"))
    surface = read_profile(tmp_path / "map.nc", "um", None)
    assert surface.z.shape == (4, 60) and np.allclose(surface.z[2], 2 * z, atol=1e-12)
    broken = written(tmp_path, "no topography", "disc.x3p")
    refused("cannot read it", read_instrument, broken)
    refused("no such file", read_instrument, tmp_path / "none.sur")


@hypothesis_settings(max_examples=60, deadline=None, derandomize=True)
@given(change=st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1, max_size=6))
def test_bytes_turned_over_end_in_a_law_or_a_sentence(tmp_path_factory, change) -> None:
    whole = bytearray(lines({}, 40).encode())
    for place, value in change:
        whole[place % len(whole)] = value
    path = tmp_path_factory.mktemp("hostile") / "ground.txt"
    path.write_bytes(bytes(whole))
    try:
        assert np.all(np.isfinite(heights(read_profile(path, "um"), 1e-6).volume_at))
    except UserError as error:
        assert str(path) in str(error) and "\n" not in str(error)
