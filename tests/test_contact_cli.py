"""`microslip contact`: what a file says is drawn and told; every mistake is one sentence with file and field."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("jax")
pytest.importorskip("matplotlib")

from refusals import refused_command

from microslip.basis import read_basis
from microslip.cli import _figure_of_the_book, main
from microslip.contact.composed import compose
from microslip.contact.law import march
from microslip.contact.series import of_patch
from microslip.contact.settings import load_contact
from microslip.contact.study import study
from microslip.programs import program

pytestmark = pytest.mark.usefixtures("undrawn")

ROOT = Path(__file__).resolve().parents[1]


def python(program: str, **environment: str) -> str:
    """What a fresh process prints; it must say nothing else."""
    given = {**os.environ, "PYTHONPATH": str(ROOT / "pipeline"), "OMP_NUM_THREADS": "1", **environment}
    given.pop("JAX_COMPILATION_CACHE_DIR", None)
    done = subprocess.run([sys.executable, "-c", program], env=given, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return done.stdout


COMPILED = """
import jax, jax.numpy as jnp
from microslip.process import prepare
prepare()
from microslip.contact.examples import EXAMPLES
from microslip.contact.law import history
seen = []
def heard(event, *_, fun_name="", **__):
    if "trace" in event:
        seen.append(str(fun_name))
jax.monitoring.register_event_duration_secs_listener(heard)
law = EXAMPLES["point, heated"].law
force = float(history(law, jnp.full((9, 1, 3), 1e-5), 1e-4).force[-1, 0, 0])
print(force, not any("history" in name for name in seen))
"""


@pytest.mark.slow
def test_compiled_programs_are_kept_between_runs(tmp_path: Path) -> None:
    """The second process takes the program from the cache and finds the same force; damaged entries are passed over."""
    first, second = (python(COMPILED, XDG_CACHE_HOME=str(tmp_path)).split() for _ in range(2))
    assert first[1] == "False" and second[1] == "True"
    for entry in (tmp_path / "microslip" / "jax").iterdir():
        entry.write_bytes(entry.read_bytes()[:100])
    third = python(COMPILED, XDG_CACHE_HOME=str(tmp_path)).split()
    assert third[1] == "False" and first[0] == second[0] == third[0]


@pytest.mark.skipif(os.name != "posix", reason="a folder that cannot be made")
def test_without_a_place_for_the_cache_nothing_is_said() -> None:
    program = "from microslip import process; print(process.keep_compiled())"
    assert python(program, XDG_CACHE_HOME="/proc/none").strip() == "None"


def test_programs_that_were_not_used_for_longest_are_forgotten(tmp_path: Path) -> None:
    """Of ten kilobytes, all but what half of five allow; nothing before an hour has passed, or while there is room."""
    from microslip.process import forget

    for age in range(10):
        (tmp_path / f"{age}-cache").write_bytes(bytes(1000))
        os.utime(tmp_path / f"{age}-cache", (2e9 - age, 1e9))

    def kept() -> list[str]:
        return sorted(p.name for p in tmp_path.glob("*-cache"))

    os.link(tmp_path / "0-cache", tmp_path / "0-again")  # a second name takes no room
    forget(tmp_path, most=10_000)
    forget(tmp_path, most=5_000)
    assert len(kept()) == 10
    forget(tmp_path, most=5_000, every=0.0)
    assert kept() == ["0-cache", "1-cache"]
    forget(tmp_path / "none")


# what it does -----------------------------------------------------------------------------------------------------

SMALL = """
name = "small"
length_unit = "um"
[stiffness]
kind = "layer"
young = 2.1e11
poisson = 0.3
density = 7850.0
thickness = 90e3
area = 360e6
[roughness]
kind = "polynomial"
R_Z = 12.0
[friction]
kind = "coulomb"
mu = 0.3
[motion]
frequency = 140.0
normal_force = 1000.0
t1 = [0.0, 6.0]
amplitudes = [0.4, 4.0]
samples = 128
[limits]
yield_shear = 200e6
[wear]
normal_force = 1000.0
speed = 0.01
time = 7.2e6
coefficient = 1e-16
"""


def write(folder: Path, text: str = SMALL, name: str = "contact.toml") -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def columns(file: Path) -> dict[str, np.ndarray]:
    head, *rows = file.read_text(encoding="utf-8").splitlines()
    table = np.array([[float(x) for x in row.split(",")] for row in rows])
    return dict(zip(head.split(","), table.T, strict=True))


@pytest.mark.slow
def test_quiet_means_quiet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path)
    assert main(["contact", str(tmp_path), "-o", str(tmp_path / "y"), "-q"]) == 0
    assert capsys.readouterr().out == ""


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory, undrawn_file: None) -> Path:
    folder = tmp_path_factory.mktemp("contact")
    assert main(["contact", str(write(folder)), "-o", str(folder / "out")]) == 0
    return folder / "out"


@pytest.mark.slow
def test_every_table_has_its_picture(done: Path) -> None:
    names = {"normal", "loops", "motion", "friction", "wear", "yield"}
    assert {f.stem for f in done.glob("*.png")} == names
    assert {f.stem for f in done.glob("*.csv")} == names | {"wear_heights", "summary"}
    for picture in done.glob("*.png"):
        assert picture.read_bytes().startswith(b"\x89PNG") and 10_000 < picture.stat().st_size < 200_000


def test_normal_table_is_3_3_24_in_si(done: Path) -> None:
    """F = c_N0 R_Z (x^3 - x^4/2) with c_N0 = E A/l_0 = 840e6 N/m (5.3), its slope, and both stiffnesses by the area."""
    t = columns(done / "normal.csv")
    x = t["approach_m"] / 12e-6
    inside = (x > 0) & (x < 1)
    np.testing.assert_allclose(t["force_N"][inside], (840e6 * 12e-6 * (x**3 - x**4 / 2))[inside], rtol=1e-8)
    np.testing.assert_allclose(t["area_share"][inside], (3 * x**2 - 2 * x**3)[inside], rtol=1e-8)
    np.testing.assert_allclose(t["tangential_stiffness_t1_N/m"], 840e6 / 2.6 * t["area_share"], rtol=1e-8)
    assert not t["force_N"][x <= 0].any()


def test_loops_dissipate_what_jenkins_does(done: Path) -> None:
    """4 mu F_N (A - mu F_N/k) under a constant normal force, nothing below the slip limit."""
    t, normal = columns(done / "loops.csv"), columns(done / "motion.csv")
    law = columns(done / "normal.csv")
    k = 840e6 / 2.6 * np.interp(normal["u_n_m"][0], law["approach_m"], law["area_share"])
    for amplitude, expected in ((0.4e-6, 0.0), (4e-6, 4 * 300 * (4e-6 - 300 / k))):
        chosen = np.isclose(t["amplitude_m"], amplitude)
        # 128 samples miss the corners of the loop by up to half a step of 4e-6 m / 20 at 300 N
        assert t["dissipated_J"][chosen][0] == pytest.approx(expected, abs=2e-4 * 4 * 300 * 4e-6)
    np.testing.assert_allclose(normal["F_n_N"], 1000.0, rtol=1e-9)


def test_place_of_p_is_the_spring_behind_m(done: Path) -> None:
    """F_t1 = k (M less P), and P moves where the table says slip only."""
    t = columns(done / "motion.csv")
    stretch = t["u_t1_m"] - t["P_t1_m"]
    stuck = np.abs(t["F_t1_N"]) < 299.0
    k = t["F_t1_N"][stuck] / stretch[stuck]
    np.testing.assert_allclose(k, k[0], rtol=1e-6)
    moved = np.abs(np.diff(t["P_t1_m"]))
    assert moved[t["state"][1:] == 1].max() < 1e-12 < moved[t["state"][1:] == 2].min()


def test_wear_table_is_the_exact_course(done: Path) -> None:
    """V(u*) = F* (1 + t*), t* = I_W mu v c_N0 t/A_0; worn volume I_W times the work."""
    t = columns(done / "wear.csv")
    np.testing.assert_allclose(t["dimensionless_time"], 1e-16 * 0.3 * 0.01 * 840e6 * t["time_s"] / 360e-6, rtol=1e-6)
    np.testing.assert_allclose(t["worn_volume_m3"], 1e-16 * 0.3 * 1000 * 0.01 * t["time_s"], rtol=1e-8)
    x = np.minimum(t["approach_m"] / 12e-6, 1)
    V = x**3 - x**4 / 2 + np.maximum(t["approach_m"] / 12e-6 - 1, 0)
    np.testing.assert_allclose(V, 1000 / (840e6 * 12e-6) * (1 + t["dimensionless_time"]), rtol=1e-6)


def test_what_is_printed(done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write(tmp_path)
    assert main(["contact", str(file), "-o", str(tmp_path / "x"), "--set", "friction.mu=0.2"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"stiffness of the full area, normal +8.4e\+08 N/m", out)
    assert re.search(r"slip limit at the working point +200 N", out)
    assert "the quasi-static contact law may be used: it is 0.02 % too stiff" in out
    assert "The contact stays elastic" in out and "stick / slip / open" in out


@pytest.mark.parametrize("figure", ["3.5-3", "3.6-5", "3.9-2"])
def test_figures_of_the_book_by_one_word(
    figure: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert main(["contact", figure]) == 0, capsys.readouterr().err
    assert (tmp_path / "build" / f"fig-{figure}" / "normal.png").is_file()


def test_all_files_that_travel_along_are_right() -> None:
    own = ROOT / "pipeline/microslip/templates/contact/contact.toml"
    files = [own, *(ROOT / "pipeline/cases/contact").glob("*.toml")]
    assert len(files) > 10
    for file in files:
        settings = load_contact(file)
        assert settings.name == file.stem


def test_init_brings_the_example_and_the_figures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["init", "contact", str(tmp_path / "mine")]) == 0
    assert f"microslip contact {tmp_path / 'mine'}" in capsys.readouterr().out
    copied = {f.name for f in (tmp_path / "mine").iterdir()}
    assert {"contact.toml", "profile.txt", "rubber.csv", "fig-3.7-7.toml"} <= copied


ALTERNATIVES = {
    "given": ('[stiffness]\nkind = "given"\nnormal = 8.4e8\ntangential = [3.2e8, 2e8]\n', ""),
    "hertz": (
        '[stiffness]\nkind = "hertz"\nyoung = 2.1e11\npoisson = 0.3\nradii = [5e4, inf]\nradii_2 = [inf, 2e4]\n',
        "",
    ),
    "curve": ('[stiffness]\nkind = "curve"\nfile = "curve.csv"\ntangential = 3e8\n', ""),
    "profile": ("", '[roughness]\nkind = "profile"\nfile = "profile.txt"\nunit = "um"\nway_unit = "mm"\n'),
    "table": ("", '[roughness]\nkind = "table"\ndepth = [0.0, 4.0, 9.0]\nshare = [0.0, 0.3, 1.0]\n'),
    "gaussian": ("", '[roughness]\nkind = "gaussian"\nR_Z = 9.0\nR_Z_other = 4.0\n'),
    "exponential": ("", '[roughness]\nkind = "exponential"\nR_Z = 9.0\n'),
}


ALSO = ("table", "gaussian", "exponential")  # tables of heights, as a profile becomes one
KINDS = [pytest.param(k, marks=pytest.mark.slow) if k in ALSO else k for k in ALTERNATIVES]


@pytest.mark.parametrize("kind", KINDS)
def test_other_sources_and_heights(kind: str, tmp_path: Path) -> None:
    """Each is a law whose force rises from 0, whose stiffness is its slope, and whose P is held by friction."""
    stiffness, roughness = ALTERNATIVES[kind]
    text = re.sub(r"\[wear\].*|\[limits\].*(?=\[wear\])", "", SMALL, flags=re.S)
    if stiffness:
        text = re.sub(r"\[stiffness\].*?(?=\[friction\])", stiffness, text, flags=re.S)
    if roughness:
        text = re.sub(r"\[roughness\].*?(?=\[friction\])", roughness, text, flags=re.S)
    shutil.copy(ROOT / "pipeline/microslip/templates/contact/profile.txt", tmp_path)
    (tmp_path / "curve.csv").write_text("u,F\n0,0\n2,20\n5,240\n9,900\n14,2100\n")
    found = study(write(tmp_path, text))
    t = found.tables["normal"]
    u, F, k = (t[n] for n in ("approach_m", "force_N", "normal_stiffness_N/m"))
    assert (np.diff(F) >= -1e-12 * F.max()).all() and F[0] == 0 and F[-1] > 0
    # the trapezoidal rule over 401 points; a slope that jumps at separation (given, smooth) costs half a step
    assert np.abs(np.cumsum(0.5 * (k[1:] + k[:-1]) * np.diff(u)) - F[1:]).max() < 0.005 * F.max()
    motion = found.tables["motion"]
    np.testing.assert_allclose(motion["F_n_N"], 1000, rtol=1e-9)
    assert np.hypot(motion["F_t1_N"], motion["F_t2_N"]).max() <= 300 * (1 + 1e-9)


def test_stiffness_of_a_modal_file(tmp_path: Path) -> None:
    """That of `series.of_patch`, and the patch's own area."""
    shutil.copy(ROOT / "pipeline/microslip/samples/basis.h5", tmp_path)
    source = '[stiffness]\nkind = "basis"\nfile = "basis.h5"\ninterface = "right"\nfacing = "left"\n'
    text = re.sub(r"\[stiffness\].*?(?=\[friction\])", source, SMALL, flags=re.S)
    text = re.sub(r"\[motion\].*", "", text, flags=re.S)
    found = study(write(tmp_path, text)).contact
    basis = read_basis(tmp_path / "basis.h5")
    group = basis.groups[0, 0]
    assert found.stiffness == of_patch(group, basis.reduction, "right", "left")
    assert found.area == pytest.approx(group.interfaces["right"].areas.sum(), rel=1e-12)


ELEMENTS = {
    "strips": '[law]\nkind = "strips"\ncount = 24\n',
    "iwan": '[law]\nkind = "iwan"\n',
    "segalman": '[law]\nkind = "iwan"\nexponent = -0.5\nratio = 0.5\n',
    "mindlin": '[law]\nkind = "mindlin"\n',
}


@pytest.mark.parametrize("kind", ELEMENTS)
def test_microslip_elements(kind: str, tmp_path: Path) -> None:
    """A loop well below the slip limit dissipates, more than with the third power; a large one is Coulomb's rim."""
    text = re.sub(r"\[limits\].*", "", SMALL, flags=re.S).replace("[0.4, 4.0]", "[0.3, 0.6, 20.0]") + ELEMENTS[kind]
    if kind == "mindlin":
        text = re.sub(r"\[stiffness\].*?(?=\[friction\])", ALTERNATIVES["hertz"][0], text, flags=re.S)
    t = study(write(tmp_path, text)).tables["loops"]
    energy = [t["dissipated_J"][np.isclose(t["amplitude_m"], a)][0] for a in (0.3e-6, 0.6e-6)]
    assert 0 < 4 * energy[0] < energy[1] < 300 * 4 * 0.6e-6
    assert np.abs(t["F_t1_N"]).max() == pytest.approx(300, rel=1e-6)


@pytest.mark.parametrize("kind", ["massless", "strips", "iwan", "mindlin", "mindlin, turned"])
def test_both_tangential_stiffnesses_reach_every_element(kind: str, tmp_path: Path) -> None:
    """Stuck, moved along t1 and t2 alike: the forces are as the stiffnesses are; of the ellipse, by its axes."""
    source = ALTERNATIVES["hertz" if "mindlin" in kind else "given"][0] + ("axis = 1\n" if "turned" in kind else "")
    text = re.sub(r"\[stiffness\].*?(?=\[roughness\]|\[friction\])", source, SMALL, flags=re.S)
    text = re.sub(r"\[roughness\].*?(?=\[friction\])", "", text, flags=re.S) if "mindlin" in kind else text
    text = re.sub(r"\[limits\].*", "", text, flags=re.S) + ELEMENTS.get(kind.split(",")[0], "")
    path = write(tmp_path, text)
    made = compose(load_contact(path), path)
    u = np.array([[[3e-6, 0, 0]], [[3e-6, 1e-12, 1e-12]]])
    force = np.array(program(march)(made.law, u, 1e-4, made.law.init(1))[0])[-1, 0]
    t1, t2 = made.stiffness.tangential
    assert force[2] / force[1] == pytest.approx(t2 / t1, rel=1e-9)
    assert (t2 > t1) == ("mindlin" == kind) and t1 != t2


def test_first_loading_table_is_3_8_26(tmp_path: Path) -> None:
    """Without heat and strength: mu (F_N(u) - F_N(u - c w/mu c_N0)) with (3.3-24), to full slip."""
    text = re.sub(r"\[motion\].*", "[microslip]\nnormal_forces = [500.0, 2000.0]\n", SMALL, flags=re.S)
    t = study(write(tmp_path, text)).tables["microslip"]

    def volume(x: np.ndarray) -> np.ndarray:
        x = np.clip(x, 0, None)
        return np.where(x < 1, x**3 - x**4 / 2, x - 0.5)

    cN, R, slope = 840e6, 12e-6, 1 / (0.3 * 2.6)
    slid = np.minimum(slope * t["displacement_m"], t["approach_m"])
    expected = 0.3 * cN * R * (volume(t["approach_m"] / R) - volume((t["approach_m"] - slid) / R))
    np.testing.assert_allclose(t["F_t_N"], expected, atol=1e-6)
    assert t["coefficient"].max() == pytest.approx(0.3, rel=1e-9)


# mistakes ---------------------------------------------------------------------------------------------------------

HEIGHTS = 'kind = "polynomial"\nR_Z = 12.0'
FRICTION = 'kind = "coulomb"\nmu = 0.3'


def table(depth: list[float], share: list[float]) -> str:
    return f'kind = "table"\ndepth = {depth}\nshare = {share}'


MISTAKES = {
    "a wrong key": ("R_Z = 12.0", "Rz = 12.0", "roughness.Rz: unknown key; did you mean 'R_Z'?"),
    "a wrong table": ("[friction]", "[fricton]", "fricton: unknown key; did you mean 'friction'?"),
    "a key of another kind": ("mu = 0.3", "mu = 0.3\np_v = 4.5", "friction.p_v: unknown key; another kind of"),
    "negative roughness": ("R_Z = 12.0", "R_Z = -12.0", "roughness.R_Z: must be greater than 0 (it is -12.0)"),
    "unknown heights": ('"polynomial"', '"parabolic"', 'roughness.kind: "parabolic" is unknown; choose one of'),
    "no kind": ('kind = "coulomb"\n', "", "friction.kind: is missing"),
    "zero area": ("area = 360e6", "area = 0", "stiffness.area: must be greater than 0 (it is 0)"),
    "frequency 0": ("frequency = 140.0", "frequency = 0.0", "motion.frequency: must be greater than 0 (it is 0.0)"),
    "NaN": ("mu = 0.3", "mu = nan", "friction.mu: must be a finite number (it is nan)"),
    "friction in percent": ("mu = 0.3", "mu = 30.0", "friction.mu: a friction coefficient of 30"),
    "slope 0": (
        "[motion]", '[law]\nkind = "with-mass"\nmass = 0.1\nslope = 0.0\n[motion]',
        "law.slope: must be greater than 0 (it is 0.0)",
    ),
    "text": ("poisson = 0.3", 'poisson = "0.3"', 'stiffness.poisson: must be a number (it is "0.3")'),
    "incompressible": (
        "poisson = 0.3", 'poisson = 0.5\nboundary = "hydrostatic"', "stiffness.poisson: 0.5 and held sides make",
    ),
    "heights that fall": (HEIGHTS, table([0.0, 1.0, 2.0, 3.0], [0.0, 0.6, 0.5, 1.0]), "area falls from 0.6 to 0.5"),
    "heights that end early": (HEIGHTS, table([0.0, 1.0, 2.0], [0.0, 0.6, 0.9]), "goes from 0 to 0.9; it must go"),
    "depths that fall": (HEIGHTS, table([0.0, 2.0, 1.0], [0.0, 0.6, 1.0]), "contact.toml: roughness: "),
    "one share too many": (HEIGHTS, table([0.0, 1.0], [0.0, 0.6, 1.0]), "roughness: 2 depths and 3 shares; give one"),
    "NaN in a profile": (HEIGHTS, 'kind = "profile"\nfile = "nan.txt"', "nan.txt: line 7: z is no finite number"),
    "NaN in heights": (HEIGHTS, 'kind = "table"\nfile = "nan.txt"', "nan.txt: line 7: the share is no finite number"),
    "NaN in friction": (FRICTION, 'kind = "table"\nfile = "nan.txt"', "nan.txt: line 7: the coefficient is no finite"),
    "no such file": (HEIGHTS, 'kind = "profile"\nfile = "none.txt"', "roughness.file: there is no file"),
    "no modal file": (
        SMALL[SMALL.index('kind = "layer"') : SMALL.index("[roughness]")],
        'kind = "basis"\nfile = "none.h5"\ninterface = "left"\n', "contact.toml: stiffness.file: there is no file",
    ),
    "no [temperature]": (FRICTION, 'kind = "heated"\nmu_0 = 0.3', 'friction: kind = "heated" needs the heat of'),
    "no friction": (f"[friction]\n{FRICTION}\n", "", "motion: a contact that moves needs its friction"),
    "wear by two numbers": (
        "coefficient = 1e-16", "coefficient = 1e-16\nenergy_density = 1e9", "wear: needs exactly one of coefficient",
    ),
    "two ways to press": ("t1 = [0.0, 6.0]", "normal = [5.0]", "motion: normal_force and the mean of normal"),
    "microslip without friction": (
        f"[friction]\n{FRICTION}", '[microslip]\n[friction]\nkind = "falling"\nmu_0 = 0.3\np_v = 1.0',
        "microslip.mu: is missing, and there is no friction",
    ),
    "strips that fall": (
        FRICTION, 'kind = "falling"\nmu_0 = 0.3\np_v = 1.0\n[law]\nkind = "strips"',
        'law: "strips" slides by Coulomb; write [friction] kind = "coulomb"',
    ),
    "no TOML": ("[friction]", "[friction", "is not valid TOML"),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_one_sentence(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """File, field, what is wrong; exit code 2; nothing written."""
    old, new, sentence = MISTAKES[name]
    assert old in SMALL
    (tmp_path / "nan.txt").write_text("x y\n" + "\n".join(f"{i} {'nan' if i == 6 else i}" for i in range(1, 20)))
    file = write(tmp_path, SMALL.replace(old, new))
    line = ["contact", str(file), "-q", "-o", str(tmp_path / "out")]
    assert refused_command(line, capsys, sentence, str(tmp_path)).count("error:") == 1
    assert sorted(f.name for f in tmp_path.iterdir()) == ["contact.toml", "nan.txt"]


def test_a_missing_file_and_an_unknown_figure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("none.toml", "3.7-99"):
        refused_command(["contact", str(tmp_path / name)], capsys, f"{tmp_path / name}: cannot be read")
    assert _figure_of_the_book(Path("fig-3.7-7")) == _figure_of_the_book(Path("3.7-7")) != Path("3.7-7")
    refused_command(["contact", "3.7-99"], capsys, "3.7-99: there is no such figure; choose one of 3.4-1")


def test_a_contact_that_never_closes_is_told_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write(tmp_path, SMALL.replace("normal_force = 1000.0\nt1", "normal = [-60.0, 4.0]\nt1"))
    assert main(["contact", str(file), "-o", str(tmp_path / "out")]) == 0
    assert "never closes" in capsys.readouterr().out
