"""The page: self-contained, well formed, escaped, and saying what the file says."""

from __future__ import annotations

import dataclasses
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import small
from hypothesis import given
from hypothesis import strategies as st

from microslip.data import ContactState, ModalBasis
from microslip.report.body import report_html
from microslip.report.page import page, text
from microslip.report.response import number_tables, response_html
from microslip.report.words import certificate, contact_sentence, fit_sentence, number_list

PNG = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010802000000907753de0000000c4944415408d763f8ffff3f0005fe02fe"
    "dccc59e70000000049454e44ae426082"
)
VOID = {"meta", "img", "br", "link", "input"}


class Tags(HTMLParser):
    """Checks that tags close in order, and collects what the page loads and shows."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.loads: list[str] = []
        self.words: list[str] = []
        self.ids: list[str] = []
        self.names: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list) -> None:
        self.names.add(tag)
        self.loads += [v for k, v in attrs if k in ("src", "href", "srcset", "action", "data")]
        self.ids += [v for k, v in attrs if k == "id"]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open and self.open.pop() == tag, f"</{tag}> closes something else"

    def handle_data(self, data: str) -> None:
        if not {"style", "script"} & set(self.open):
            self.words.append(data)


def parsed(page: str) -> Tags:
    tags = Tags()
    tags.feed(page)
    tags.close()
    assert not tags.open
    return tags


def said(page: str) -> str:
    return re.sub(r"\s+", " ", "".join(parsed(page).words).replace("\xa0", " "))


def tabulated(tables: dict[str, dict[str, list[str]]]) -> str:
    return page("t", number_tables(tables))


def album(tmp_path: Path, *names: str) -> dict[str, Path]:
    found = {}
    for name in names:
        found[name] = tmp_path / f"{name}.{'gif' if name.startswith('animation') else 'png'}"
        found[name].write_bytes(PNG)
    return found


def test_the_page_is_whole_and_loads_nothing(tmp_path: Path) -> None:
    names = ["mesh", "interfaces", "modes_0rpm", "mode_01_0rpm", "animation_01", "compliance", "friction response"]
    page = report_html(small.basis(), album(tmp_path, *names), ["Only a beam."])
    tags = parsed(page)
    pictures = [v for v in tags.loads if v.startswith("data:image/")]
    links = [v for v in tags.loads if not v.startswith("data:image/")]
    assert len(pictures) == len(names)
    assert links and all(v.startswith("#") and v[1:] in tags.ids for v in links)
    assert not {"link", "iframe", "object"} & tags.names and "<script src" not in page
    assert "url(" not in page and "@import" not in page and 'name="viewport"' in page
    assert "Only a beam." in said(page)


def test_the_page_says_what_the_file_holds() -> None:
    basis = small.basis()
    group, words = basis.groups[0, 0], said(report_html(basis, {}))
    limit = group.checks["upper_shift_hz"]
    held = [f"{basis.mass:.6g} kg", "20 × 30 × 120 mm", f"all 6 modes below {limit:.6g} Hz", "right + left squeezed"]
    for part in (*held, *(f"{f:#.6g}" for f in group.frequency), "shaker", "tip-probe", "root"):
        assert part in words
    assert re.search(r"All \d+ checks of the file passed", words)


def test_speeds_stand_beside_each_other_with_crossings() -> None:
    material = '"material": {"name": "steel", "density": 7850.0, "young": 2.1e11}'
    settings = {"settings": f'{{"rotation": {{"engine_orders": [30]}}, {material}}}'}
    words = said(report_html(dataclasses.replace(small.basis((0.0, 3000.0)), provenance=settings), {}))
    assert "Hz at 0 rpm" in words and "Hz at 3000 rpm" in words and "Where engine orders meet modes" in words
    assert "7850 kg/m³, E = 210 GPa" in words and "spin softening" in words


@pytest.mark.parametrize("settings", ["", "not json", "[1, 2]", '{"material": 3}', '{"rotation": null}', "3"])
def test_foreign_settings_do_no_harm(settings: str) -> None:
    basis = dataclasses.replace(small.basis((0.0, 3000.0)), provenance={"settings": settings, "material": "tin"})
    assert "tin" in said(report_html(basis, {}))


NASTY = '<script>alert("x")</script>&amp;\'"'


def test_every_text_is_escaped(tmp_path: Path) -> None:
    basis = small.basis()
    group = basis.groups[0, 0]
    left = dataclasses.replace(group.interfaces["left"], role=NASTY, partner=NASTY)
    labels = tuple(label.replace("left", NASTY) for label in group.compliance.labels)
    renamed = dataclasses.replace(
        group,
        interfaces={"right": group.interfaces["right"], NASTY: left},
        monitors={NASTY: group.monitors["tip-probe"]},
        compliance=dataclasses.replace(group.compliance, labels=tuple(x.replace("tip-probe", NASTY) for x in labels)),
    )
    nasty = dataclasses.replace(
        basis, name=NASTY, groups={(0, 0): renamed}, provenance={NASTY: NASTY, "long": NASTY * 20},
        damping_source=NASTY, reduction=NASTY,
    )  # fmt: skip
    picture = tmp_path / "p.png"
    picture.write_bytes(PNG)
    response = {NASTY: NASTY, "list": [NASTY], "rows": [{NASTY: NASTY}]}
    page = report_html(nasty, {NASTY: picture}, [NASTY], response)
    tags = parsed(page)
    assert "<script>alert" not in page and "<script" not in page
    assert "".join(tags.words).count('<script>alert("x")</script>&amp;\'"') > 12


@given(st.text(max_size=60))
def test_any_text_survives(words: str) -> None:
    back = "".join(parsed(f"<p>{text(words)}</p>").words).replace("\xa0", " ")
    shown = re.sub(r"·10(−?)(\d+)", "", back)
    assert len(shown) <= len(words) and "<" not in text(words).replace("<sup>", "").replace("</sup>", "")


@pytest.mark.parametrize(
    ("value", "wanted"),
    [
        ("1.09e-09 m/N", "1.09·10<sup>−9</sup> m/N"),
        ("2e+06", "2·10<sup>6</sup>"),
        ("bolt1e5", "bolt1e5"),
        ("0.5 %", "0.5&nbsp;%"),
    ],
)
def test_powers_of_ten_are_set_as_such(value: str, wanted: str) -> None:
    assert text(value) == wanted


def test_the_certificate_in_words_and_a_failed_check() -> None:
    group = small.basis().groups[0, 0]
    cut = certificate(dataclasses.replace(group, checks={**group.checks, "count_below_upper_shift": 9.0}))
    assert "the first 6 are kept" in cut and "all 9 modes" in cut
    open_end = dataclasses.replace(group, checks={**group.checks, "certified": 0.0})
    assert "not certified" in certificate(open_end)
    for wrong, name in ((open_end, ""), (dataclasses.replace(group, K_r=group.K_r * 1.01), "K_r")):
        words = said(report_html(dataclasses.replace(small.basis(), groups={(0, 0): wrong}), {}))
        assert re.search(rf"\d+ of \d+ checks failed: .*{name}", words)


def test_fit_residuals_in_words() -> None:
    group = small.basis().groups[0, 0]
    patch = group.interfaces["right"]
    for residual, words in (
        ((0.01, 0.02, 0.0, 0.0, 0.0, 0.0), "in all modes (at most 2.0 %"),
        ((0.01, 0.2, 0.0, 0.5, 0.3, 0.0), "modes 1, 3 and 6; it deforms in modes 2, 4 and 5 (most in mode 4: 50.0"),
        ((0.6,) * 6, "tip deforms in modes 1 to 6"),
    ):
        assert words in fit_sentence("tip", dataclasses.replace(patch, fit_residual=np.array(residual)), group)


@pytest.mark.parametrize(
    ("numbers", "words"),
    [([], ""), ([3], "3"), ([1, 2], "1 and 2"), ([1, 2, 3, 7, 9], "1 to 3, 7 and 9"), ([4, 5, 6], "4 to 6")],
)
def test_lists_of_numbers(numbers: list[int], words: str) -> None:
    assert number_list(numbers) == words


def test_a_response_is_told_whatever_it_holds(tmp_path: Path) -> None:
    peak = {"normal_force_N": 10.0, "frequency_Hz": 14.2, "amplitude_m": 1.5e-5, "stress_Pa": 3.25e6}
    response = {"case": "blade", "description": "", "stuck_frequencies_Hz": [86.5, 121.25], "resonances": [peak]}
    words = said(report_html(small.basis(), album(tmp_path, "friction response"), (), response | {"failed_points": 0}))
    told = ("stuck frequencies in Hz86.5, 121.25", "normal force in N", "frequency in Hz", "amplitude in µm")
    assert all(part in words for part in (*told, "14.2153.25", "failed points0")) and "description" not in words


def test_pictures_that_are_missing_leave_no_hole(tmp_path: Path) -> None:
    page = report_html(small.basis(), {"mesh": tmp_path / "gone.png"})
    assert "<img" not in page
    parsed(page)


def test_same_inputs_give_the_same_page(tmp_path: Path) -> None:
    found = album(tmp_path, "mesh", "compliance")
    assert report_html(small.basis(), found) == report_html(small.basis(), found)


def bare() -> ModalBasis:
    """A basis that holds hardly more than frequencies."""
    basis = small.basis()
    group = basis.groups[0, 0]
    nothing = dataclasses.replace(group.compliance, labels=(), static=np.zeros((0, 0)), modal=np.zeros((0, 0)))
    thin = dataclasses.replace(
        group, phi=np.zeros((0, 3, group.n_modes)), interfaces={}, excitations={}, monitors={}, gauges={}, stresses={},
        compliance=nothing, checks={},
    )  # fmt: skip
    return dataclasses.replace(basis, groups={(0, 0): thin}, provenance={})


def test_bare_files_and_free_bodies_have_a_page_too() -> None:
    words = said(report_html(bare(), {}))
    assert "no compliance to check" in words and "not certified" in words
    words = said(report_html(small.basis(free=True), {}))
    assert "6 of them rigid" in words and "inertia relief" in words


def test_many_patches_are_summed_up() -> None:
    group = small.basis().groups[0, 0]
    patch = dataclasses.replace(group.interfaces["right"], role="bolt", fit_residual=np.full(group.n_modes, 0.01))
    loose = dataclasses.replace(patch, fit_residual=np.array([0.0, 0.0, 0.3, 0.0, 0.0, 0.0]))
    bolts = {f"bolt_{i}": loose if i == 3 else patch for i in range(1, 7)}
    bolted = dataclasses.replace(group, interfaces=bolts, compliance=bare().groups[0, 0].compliance)
    words = said(report_html(dataclasses.replace(small.basis(), groups={(0, 0): bolted}), {}))
    assert "Of 6 patches 1 deform" in words and "bolt_3 in mode 3: 30.0 %" in words


def test_load_faces_are_no_contacts() -> None:
    assert small.basis().groups[0, 0].interfaces["contact_left"].role == "load"
    words = said(report_html(small.basis(), {}))
    assert re.search("contact_left ?load", words) and not re.search("contact_left (moves|deforms)", words)


def peak(force: float, frequency: float, amplitude: float, doubt: str = "") -> dict[str, float | str]:
    row = {"normal_force_N": force, "frequency_Hz": frequency, "amplitude_m": amplitude, "damping_ratio": 0.01}
    return row | ({"doubt": doubt} if doubt else {})


def test_the_answer_is_a_resonance_that_is_valid() -> None:
    """Contacts that would lift off make no highest resonance; numbers stand without powers of ten."""
    rows = [peak(20.0, 23.4, 0.032, "contacts would lift off: not valid"), peak(80.0, 123.0, 12.74e-6)]
    rows += [peak(1e4, 171.1, 80.65e-6)]
    for row, stress in zip(rows, (900e6, 3e6, 41.5e6), strict=True):
        row |= {"stress_amplitude_Pa": stress, "frequency_of_stress_Hz": row["frequency_Hz"]}

    def words(rows: list, error: float | None, **more: str) -> str:
        return said(response_html({"resonances": rows, "estimated_error_of_harmonics": error, **more}, {}))

    for unknown in (None, np.inf):
        assert "how uncertain amplitudes are is not known" in words(rows, unknown)
    assert "error of harmonicsnot known" in words([], np.inf) and "inf" not in words([], np.inf)
    answer = words(rows, 1.3e-13)
    for part in ("is 80.65 µm at 171.1 Hz", "lowest with 12.74 µm", "Under FN = 20 N contacts would lift off",
                 "amplitude is 41.5 MPa", "uncertain by less than 0.01", "32000", "10000"):  # fmt: skip
        assert part in answer
    assert "·10" not in answer and "of lower is 41.5 MPa" in words(rows, 1e-13, stressed_body="lower")


def test_a_contact_tells_what_is_left_of_its_penetration_where_it_is_no_rounding() -> None:
    x, one = np.zeros((3, 3)), np.ones(3)
    state = ContactState(
        "a", "b", "", "open", 0, 240.0, 0.1, 8e-17, 1.0, 0.0, x[0], x[0], x, 1e6 * one, 1e-6 * one, one
    )
    assert "at most 1 MPa; the modes leave it open" in contact_sentence("shroud", state)
    assert "(penetration left 0.002 µm)" in contact_sentence("shroud", dataclasses.replace(state, penetration=2e-9))


def test_what_stands_in_a_table_is_told_once_and_rounding_not_at_all() -> None:
    modes = [{"frequency_Hz": 874.25, "damping_ratio": 0.01, "half_power_width_Hz": 17.5}]
    told = {"stuck_modes": modes, "stuck_frequencies_Hz": [874.25], "rising_at_the_edge": []}
    words = said(response_html(told, {}))
    assert words.count("874.25") == 1 and "Modes with sticking contacts" in words and "rising" not in words
    for column, value, shown in (
        ("amplitude_m_FN_10_N", "2e-5", "FN = 10 N: amplitude in µm 20"),
        ("resonance_Hz_FN_10_N", "99.5", "FN = 10 N: resonance in Hz 99.5"),
        ("stress_amplitude_Pa_as_pressed", "1e6", "as pressed: stress amplitude in MPa 1"),
        ("load_m", "1.5e-3", "load in mm 1.5"),
        ("speed_rad_s", "2", "speed in rad/s 2"),
    ):
        assert shown in said(tabulated({"t.csv": {column: [value]}}))
    assert "1e-13" not in said(tabulated({"t.csv": {"load_m": ["1.5e-3", "1e-16"]}}))


def test_a_page_has_one_unit_of_length_and_tells_rows_apart() -> None:
    """Lengths in mm from 1 mm on, in every table; five points beside a fold, and a mean that Newton's method leaves."""
    near = ["377.4231", "300.00001", "377.4232", "377.4233", "377.4243"]
    a, mean = ["1.53e-3", "9.8e-4", "2e-5", "1e-3", "1e-3"], ["7.981e-11", "-1e-10", "3.5e-7", "0", "0"]
    curve = {"frequency_Hz": near, "amplitude_m": a, "mean_m": mean}
    table = said(tabulated({"t.csv": curve, "u.csv": {"amplitude_m": ["2e-5"]}}))
    shown = ("1.53", "0.98", "377.42", "300", "377.4232", "377.4233", "377.424", "0.00035")
    assert table.count("amplitude in mm") == 2 and all(n in table for n in shown)
    assert not any(n in table for n in ("µm", "300.0", "·10", "7.981"))
    words = said(response_html({"resonances": [peak(1.0, 2.0, 1.53e-3), peak(2.0, 2.0, 9.8e-4)]}, {}))
    assert "is 1.53 mm at 2 Hz" in words and "lowest with 0.98 mm" in words and "amplitude in mm" in words


def test_alike_warnings_fold_below_the_first_of_them() -> None:
    """Two kinds, told by turns: each kind stands together, and no sentence is cut."""
    one, two = (
        f"At F_N = {{}} N the amplitude at 90 Hz is uncertain{end}" for end in (": no solution.", ", raise it.")
    )
    words = said(response_html({"messages": [w.format(n) for n in (20, 50, 80) for w in (one, two)]}, {}))
    at = [words.index(part) for part in ("20 N the amplitude at 90 Hz is uncertain: no", "2 more", "= 80 N", ", raise")]
    assert at == sorted(at) and words.count("2 more of the same kind") == 2 and "..." not in words
