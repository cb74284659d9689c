"""A measured normal law: smooth, monotone, zero when open; files of every make; what is refused, with file and line."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused
from scipy.integrate import quad

from microslip.contact.curves import NormalCurve, curve, read_columns, read_curve
from microslip.contact.hertz import Hertz
from microslip.contact.series import BULK
from microslip.contact.solids import Solid
from microslip.errors import UserError
from microslip.files.tables import columns_csv
from microslip.modal.closures import ContactCurve

ROUGH, C_N0 = 12e-6, 240e6


def polynomial(u: np.ndarray) -> np.ndarray:
    """Sextro Eq. (3.3-24) with the numbers of 3.5."""
    x = np.clip(u / ROUGH, 0, 1)
    return C_N0 * ROUGH * (x**3 - 0.5 * x**4 + np.maximum(u / ROUGH - 1, 0))


def sampled(n: int = 30, first: float = 0.0) -> NormalCurve:
    u = np.linspace(first, 1.5, n) * ROUGH
    return curve(u, polynomial(u))


def test_curve_goes_through_its_points_and_is_c1_everywhere():
    c = sampled()
    assert c.force(c.knots) == pytest.approx(c.loads, abs=1e-12)
    at, step = np.concatenate([c.knots, 0.5 * (c.knots[1:] + c.knots[:-1])]), 1e-12
    left, right = c.stiffness(at - step), c.stiffness(at + step)
    assert left == pytest.approx(right, abs=1e-4 * C_N0)
    assert c.stiffness([c.separation, c.separation - 1.0]) == pytest.approx([0, 0])
    assert c.force(c.separation - 1e-6) == 0 and c.stored(c.separation) == 0


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.lists(st.tuples(st.floats(1e-8, 1e-5), st.floats(0, 1e3)), min_size=5, max_size=30), st.floats(0, 50))
def test_curve_never_falls_and_is_zero_when_open(steps, offset):
    u, F = np.cumsum(np.array(steps), axis=0).T
    F = F + offset
    if F[-1] <= F[-2]:
        F[-1] = F[-2] + 1.0
    if np.sum(F > 0) < 4 or F[0] == F[1] > 0:
        return
    c = curve(u, F)
    x = np.linspace(c.separation - 1e-6, u[-1] + 1e-5, 2001)
    force = c.force(x)
    assert (np.diff(force) >= -1e-12 * force[-1]).all() and (c.stiffness(x) >= -1e-9 * c.slopes.max()).all()
    assert (force[x <= c.separation] == 0).all() and c.force(u) == pytest.approx(F, abs=1e-9 * F[-1])


def test_a_first_force_of_rounding_is_where_the_contact_opens():
    c = curve([0, 1e-6, 2e-6, 3e-6, 4e-6], [1e-45, 1, 3, 7, 15])
    assert c.separation == 0 and c.force(0.0) == 0


def test_curve_converges_to_the_law_it_was_sampled_from():
    """The slopes of PCHIP are of second order, so the curve is of third; the end where all of the area carries is
    a kink of the second derivative, which costs nothing there since a knot stands on it."""
    counts = np.array([16, 31, 61, 121])
    x = np.linspace(0.05, 1.45, 997) * ROUGH
    error = [np.abs(sampled(n).force(x) - polynomial(x)).max() for n in counts]
    assert -4 < np.polyfit(np.log(counts), np.log(error), 1)[0] < -2
    assert error[-1] < 1e-4 * polynomial(x).max()
    assert sampled(121).stiffness_0 == pytest.approx(C_N0, rel=1e-3)


def test_energy_is_the_integral_of_the_force_and_the_inverse_inverts():
    c = sampled(20)
    for top in (0.3 * ROUGH, 1.2 * ROUGH, 2.5 * ROUGH):
        knots = c.knots[c.knots < top]
        whole = quad(lambda u: float(c.force(u)), c.separation, top, points=knots[1:], limit=200)[0]
        assert c.stored(top) == pytest.approx(whole, rel=1e-9)
    F = np.array([1e-3, 10.0, 700.0, 5e3])
    assert c.force(c.approach(F)) == pytest.approx(F, rel=1e-9)
    assert c.approach(0.0) == pytest.approx(c.separation, abs=1e-12)
    refused("must not be negative", c.approach, -1.0)


def test_a_curve_that_begins_under_load_is_led_to_zero_by_the_third_power():
    """What (3.3-25) says of light loads: exact for a cubic law, whose slope at the first point PCHIP meets to 1 %."""
    u = np.linspace(0.5, 1.0, 60) * 1e-5
    c = curve(u, 3e17 * u**3)
    assert c.separation == pytest.approx(0.0, abs=0.02e-5)
    assert c.force(0.25e-5) == pytest.approx(3e17 * (0.25e-5) ** 3, rel=0.05)
    below = np.linspace(c.separation, u[0], 50)
    assert (np.diff(c.force(below)) > 0).all()


def test_leading_zeros_are_the_open_contact():
    c = curve(np.arange(9.0) * 1e-6, [0, 0, 0, 1, 3, 6, 10, 15, 21])
    assert c.separation == 2e-6 and c.slopes[0] == 0 and c.force(1.5e-6) == 0 < c.force(2.1e-6)


def test_noise_that_is_stated_is_evened():
    u = np.arange(8) * 1e-6
    F = np.array([0, 1, 4, 3.8, 9, 16, 15.9, 25])
    refused("point 4: the force falls from 4 to 3.8 N", curve, u, F)
    c = curve(u, F, noise=0.3)
    assert (np.diff(c.loads) >= 0).all() and np.abs(c.force(u) - F).max() < 0.15
    assert curve(u, [-0.1, 0, 1, 4, 9, 16, 20, 25], noise=0.2).loads[0] == 0


# files -------------------------------------------------------------------------------------------------------------

FILES = {
    "comma": "gap_um,force_N\n10,0\n8,2\n6,9\n4,30\n2,70\n",
    "semicolon and decimal comma": "Weg;Kraft\n-10,0;0\n-8,0;2,0\n-6,0;9,0\n-4,0;30,0\n-2,0;70,0\n",
    "blanks and messages": "# rig 3\n-10 0\n-8 2  # first weight\n\n-6 9\n-4   30\n-2\t70\n",
    "blanks and decimal comma": "Weg Kraft\n-10,0 0\n-8,0 2,0\n-6,0 9,0\n-4,0 30,0\n-2,0 70,0\n",
    "comma and blanks": "-10, 0\n-8, 2\n-6, 9\n-4, 30\n-2, 70\n",
    "tabs": "-10\t0\n-8\t2\n-6\t9\n-4\t30\n-2\t70\n",
    "byte order mark and windows ends": "\ufeff-10,0\r\n-8,2\r\n-6,9\r\n-4,30\r\n-2,70\r\n",
}


@pytest.mark.parametrize("name", FILES)
def test_files_of_every_make_read_alike(tmp_path, name):
    path = tmp_path / "rig.csv"
    path.write_bytes(FILES[name].encode("utf-8"))
    c = read_curve(path, gap=name == "comma")
    assert c.knots == pytest.approx(np.array([-10, -8, -6, -4, -2]) * 1e-6)
    assert c.loads == pytest.approx([0, 2, 9, 30, 70]) and c.source == str(path)


@pytest.mark.parametrize("heading", ["Rig 7, run of May\n", "Rig\n\n", "Rig\nu;F\n", "Rig\nu;F\n[um];[N]\n"])
def test_lines_of_heading_before_the_numbers_are_passed_over(tmp_path, heading):
    (tmp_path / "rig.csv").write_text(heading + "0,0;0\n1,5;2\n")
    table, places = read_columns(tmp_path / "rig.csv", ("u", "F") if "u;F" in heading else (1, 2))
    np.testing.assert_array_equal(table, [[0, 0], [1.5, 2]])
    assert places[0] == heading.count("\n") + 1


def test_a_wrong_number_below_the_heading_is_no_heading(tmp_path):
    (tmp_path / "rig.csv").write_text("u;F\n0,O;0\n1,5;2\n")
    refused("line 2: column 1: '0.O' is no number", read_columns, tmp_path / "rig.csv", (1, 2))


def test_columns_by_name_units_and_an_opening_branch(tmp_path):
    path = tmp_path / "rig.txt"
    path.write_bytes("Zeit;F (kN);s (µm)\n0;0,07;2\n1;0,03;4\n2;0,009;6\n3;0,002;8\n4;0;10\n".encode("latin-1"))
    c = read_curve(path, displacement=3, force="F (kN)", force_unit="kN", gap=True)
    assert c.knots == pytest.approx(np.array([-10, -8, -6, -4, -2]) * 1e-6)
    assert c.loads == pytest.approx([0, 2, 9, 30, 70])


def test_a_closure_of_finite_elements_is_read_as_a_law(tmp_path):
    """The file that `microslip closure` leaves, here with Hertz' force: third order again, but for the first gap."""
    ball = Hertz.sphere(Solid(2.1e11, 0.3), Solid(2.1e11, 0.3), 0.05)
    u = np.linspace(-5e-6, 2e-5, 51)
    path = tmp_path / "closure.csv"
    path.write_text(columns_csv(ContactCurve(u, ball.force(u), np.zeros(51)).columns, 9))
    c = read_curve(path, "approach_m", "normal_force_N", "m", includes=BULK)
    assert c.separation == pytest.approx(0.0, abs=1e-12) and c.includes == BULK
    between = np.linspace(1e-6, 2e-5, 77)
    assert c.force(between) == pytest.approx(ball.force(between), abs=2e-4 * c.loads[-1])
    with pytest.raises(UserError, match="includes: 'all' is unknown"):
        read_curve(path, "approach_m", "normal_force_N", "m", includes="all")


LINES = "u,F\n0,0\n1,2\n2,9\n3,30\n4,70\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (LINES.replace("2,9", "2,nan"), "rig.csv: line 4: the force is no finite number"),
        (LINES.replace("2,9", "inf,9"), "line 4: the approach is no finite number"),
        (LINES.replace("3,30", "3,8"), "line 5: the force falls from 9 to 8 N"),
        (LINES.replace("3,30", "1.5,30"), "line 5: the contact does not close further (2e-06 m, then 1.5e-06 m)"),
        (LINES.replace("3,30", "2,30"), "line 5: the contact does not close further"),
        (LINES.replace("0,0", "0,-3"), "line 2: the force is -3 N; take off the load cell's offset"),
        (LINES.replace("4,70", "4e6,70"), "line 6: the approach is 4 m, which is no contact's; correct the unit"),
        (LINES.replace("4,70", "4,7e300"), "line 6: the force is 7e+300 N"),
        (LINES.replace("3,30", "2.0000000001,30"), "line 5: the contact does not close further"),
        (LINES.replace("2,9", "2,abc"), "line 4: column 2: 'abc' is no number"),
        (LINES.replace("2,9", "2"), "line 4: column 2: there is none"),
        ("u,F\n0,0\n1,2\n2,9\n3,30\n", "3 points with a force are too few"),
        ("u,F\n", "0 points with a force are too few"),
        ("", "is empty"),
        ("0,0\n1,2\n2,9\n3,9\n4,9\n5,9\n", "does not rise at the end of the curve (9 N)"),
        ("0,2\n1,2\n2,9\n3,10\n4,12\n", "begins at 2 N and is level there"),
    ],
)
def test_a_wrong_file_is_refused_with_its_line(tmp_path, text, words):
    path = tmp_path / "rig.csv"
    path.write_text(text)
    refused(words, read_curve, path)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.integers(0, len(LINES) - 1), st.binary(max_size=6), st.integers(0, 4))
def test_a_damaged_file_gives_a_law_or_a_sentence(tmp_path_factory, place, put, taken):
    path = tmp_path_factory.mktemp("rig") / "rig.csv"
    path.write_bytes(LINES.encode()[:place] + put + LINES.encode()[place + taken :])
    try:
        law = read_curve(path)
    except UserError as error:
        assert str(error).startswith(str(path))
    else:
        assert (np.diff(law.knots) > 0).all() and (np.diff(law.loads) >= 0).all() and np.isfinite(law.slopes).all()


def test_wrong_requests_are_refused(tmp_path):
    path = tmp_path / "rig.csv"
    path.write_text(LINES)
    for arguments, words in (
        ({"force": "kraft"}, "column 'kraft': the file has u, F"),
        ({"force": 0}, "columns are counted from 1"),
        ({"length_unit": "inch"}, "length_unit: 'inch' is unknown; choose one of m, mm, um, nm"),
        ({"force_unit": "lbf"}, "force_unit"),
    ):
        refused(words, read_curve, path, **arguments)
    refused("cannot be read", read_curve, tmp_path / "none.csv")
    path.write_bytes(b"\x00\x01\x02")
    refused("is no text file", read_curve, path)
    refused("one force for each approach", curve, [0, 1], [0, 1, 2])
