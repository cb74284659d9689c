"""Steady sliding: ground that turns, tangents one by one, waves, limit cycles, what is refused; the case itself."""

from __future__ import annotations

import contextlib
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
import small
from closed_forms.oscillators import brusselator
from PIL import Image
from refusals import refused_command
from test_bifurcation import normal_form
from test_sliding import masses

from microslip import sliding
from microslip.basis import read_basis
from microslip.bifurcation.cycles import checked, cycles, in_time, refined
from microslip.case import load_case
from microslip.cli import main
from microslip.linalg.quadratic import Window, every_root, every_value
from microslip.pictures.moving import moving_shape
from microslip.roots.spectrum import spectrum
from microslip.roots.waves import waves
from microslip.stages.analysing import Varied, analysed
from microslip.stages.answer import CaseJob
from microslip.stages.places import modal_files
from microslip.system.ground import turning
from microslip.verbs.stability import State, moving, shapes, state_of

ROOT = Path(__file__).parents[1]
CASES = ROOT / "pipeline" / "cases"


def test_ground_that_turns_moves_every_point_by_the_cross_product() -> None:
    """Omega x r, along t1 and t2 of a frame that stands anyhow."""
    random = np.random.default_rng(3)
    frame = np.linalg.qr(random.standard_normal((3, 3)))[0]
    frame *= np.linalg.det(frame)
    rate, centre, origin, points = *random.standard_normal((3, 3)), random.standard_normal((20, 2))
    V = np.cross(rate, origin + points @ frame[1:] - centre) @ frame[1:].T
    np.testing.assert_allclose(turning(rate, centre, origin, frame).velocities(points), V, atol=1e-12)


def test_tangents_of_contacts_add_up_to_the_linearised_matrices() -> None:
    """C and K less those of the bodies are the contacts', each through its own rows."""
    assembly = masses(8.0)
    s = sliding.of(assembly)
    z = sliding.equilibrium(s)
    C, K = sliding.linearised(s, z)
    rows, begin = assembly.joined(0).rows @ np.asarray(s.shapes), 0
    for c, at in zip(assembly.contacts, sliding.tangents(assembly, s, z), strict=True):
        own = rows[begin : begin + c.patch.count]
        C, K, begin = C - own.T @ at.C @ own, K - own.T @ at.K @ own, begin + c.patch.count
        assert at.force[:, 0].sum() == pytest.approx(8.0) and np.hypot(*at.velocity[0, 1:]) == pytest.approx(1.0)
    np.testing.assert_allclose(C, s.C, atol=1e-9)
    np.testing.assert_allclose(K, s.K, atol=1e-9)


def test_waves_forward_and_backward() -> None:
    """Three parts of nodal diameter 4 run towards growing angles and four against it; a second turns the axis round."""
    phi = 2 * np.pi * np.arange(40) / 40
    points = np.stack([np.cos(phi), np.sin(phi), 0 * phi], axis=1)
    u = np.zeros((40, 3), dtype=complex)
    u[:, 2] = 3 * np.exp(-4j * phi) + 4 * np.exp(4j * phi)
    for axis, forward in ((1.0, 9 / 25), (-1.0, 16 / 25)):
        seen = waves(points, u, np.array([0.0, 0.0, axis]), np.zeros(3))
        assert seen.leading == 4 and seen.shares[4, 0] == pytest.approx(forward) and seen.shares[4].sum() == 1.0


def test_a_root_moves_its_bodies_through_one_period_as_cosine_and_sine(tmp_path: Path) -> None:
    """Re(u exp(i omega t)) in every file for ParaView, at most a millimetre long, over all bodies;
    a wave that runs by a quarter of its length in a quarter of the period."""
    basis = small.basis()
    z = basis.mesh.points[:, 2] / np.ptp(basis.mesh.points[:, 2])
    u = np.zeros((len(z), 3), dtype=complex)
    u[:, 0] = np.exp(-2j * np.pi * z)
    made = moving_shape({"a": 3 * u, "b": 6 * u}, {"a": basis, "b": basis}, 50.0, (), "", 1, tmp_path)
    assert [p.name for p in made if p.suffix == ".pvd"] == ["root_1_a.pvd", "root_1_b.pvd"]
    times = [float(t) for t in re.findall(r'timestep="([^"]+)"', made[0].read_text())]
    np.testing.assert_allclose(times, np.arange(32) / 32 / 50.0, atol=1e-9)
    for body, size in (("a", 5e-4), ("b", 1e-3)):
        for k in (0, 8, 20):
            shown = meshio.read(tmp_path / "motion" / f"root_1_{body}_{k:03d}.vtu")
            x = np.cos(2 * np.pi * (k / 32 - shown.points[:, 2] / np.ptp(basis.mesh.points[:, 2])))
            np.testing.assert_allclose(shown.point_data["displacement"][:, 0], size * x, atol=1e-6 * size)


def test_limit_cycles_by_harmonic_balance_are_the_circles_of_the_normal_form() -> None:
    """Radius sqrt(p), frequency 1; a motion in time stays on them. Tables tell the units of read-outs."""
    read = replace(normal_form(), units=("rad", "m"))
    (found,) = cycles(read, np.zeros(2), -1.0, 1.0, 2, (0.5, 2.0))
    radius = found.columns[f"amplitude {read.labels[0]}_rad"]
    np.testing.assert_allclose(radius, np.sqrt([o.p for o in found.orbits]), rtol=1e-3)  # of samples
    assert f"in time {read.labels[1]}_m" in found.columns
    assert found.supercritical and "bound" in found.ended and not found.lost
    for o in found.orbits:
        assert np.hypot(*o.at(np.zeros(1))[0]) == pytest.approx(np.sqrt(o.p), abs=1e-8)
        assert o.omega == pytest.approx(1.0, abs=1e-9)
    assert in_time(found.system, found.orbits[-1])[0] < 1e-7


@pytest.mark.slow
def test_harmonics_of_a_limit_cycle_are_as_many_as_its_accuracy_takes() -> None:
    """The Brusselator's at 2.3 from 3 harmonics on: the estimate covers what a motion in time leaves the orbit by, and
    is met; its multiplier is that of Liouville's formula, exp(integral of 2 x y - x^2 - p - 1)."""
    (found,) = cycles(brusselator(1.8, 2.3), np.array([1.0, 1.8]), 1.8, 2.3, 3, (0.5, 2.0), 12)
    coarse = found.orbits[-1]
    assert coarse.p == pytest.approx(2.3) and coarse.count == 3 and in_time(found.system, coarse)[0] > 1e-2
    counts = []
    for accuracy in (1e-2, 1e-5):
        one = checked(found.system, coarse, accuracy)
        assert one.drift < one.error + 1e-7 < accuracy + 1e-7 and one.stable
        counts.append(one.orbit.count)
    assert counts == sorted(set(counts))
    x, y = one.orbit.at(np.arange(4096) / 4096).T
    grown = 2 * np.pi / one.orbit.omega * np.mean(2 * x * y - x**2 - one.orbit.p - 1)
    assert np.log(one.multipliers[0].real) == pytest.approx(grown, rel=1e-5)
    assert refined(found.system, coarse, 1e-12, most=6)[1] > 1e-12


@pytest.fixture
def belt(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, undrawn: None) -> Path:
    """The two masses on a belt, asked for their roots."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(CASES / "masses-on-belt", tmp_path / "masses-on-belt")
    whole = (CASES / "belt.toml").read_text()
    text = whole[: whole.index("[[bifurcation]]")]
    over = "".join(
        f'[[stability.over]]\nparameter = "{name}"\nkeys = {{ {keys} }}\nstart = {low}\nstop = {high}\npoints = 5\n'
        for name, low, high, keys in (
            ("load", 0.5, 9.5, '"contacts.sole-1.normal_force" = 1.0, "contacts.sole-2.normal_force" = 1.0'),
            ("velocity", 0.8, 3.0, '"contacts.sole-1.ground.velocity" = 1.0, "contacts.sole-2.ground.velocity" = 1.0'),
        )
    )
    (tmp_path / "belt.toml").write_text(f"{text}[stability]\nfrequency = [0.0, 1.0]\n{over}")
    return tmp_path / "belt.toml"


def test_map_of_two_masses_has_as_many_roots_as_each_state_alone(
    belt: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Counts of the map against the eigenvalues of the assembly made anew; H1 and H2 lie between its columns."""
    assert main(["stability", str(belt), "--quiet"]) == 0
    rows = [line.split(",") for line in Path("build/belt/stability_map.csv").read_text().splitlines()[1:]]
    assert len(rows) == 25 and {row[2] for row in rows} == {"0", "1", "2"}
    for load, velocity, count, growth, _ in [[float(v) for v in row] for row in rows[::6]]:
        V = [f"contacts.sole-{i}.ground.velocity={velocity!r}" for i in (1, 2)]
        s = sliding.of(masses(load, *V))
        values = np.linalg.eigvals(sliding.state_matrix(s, sliding.equilibrium(s)))
        assert (values.real[values.imag > 0] > 0).sum() == count
        assert values.real[values.imag > 0].max() == pytest.approx(growth, abs=1e-8)


CYCLE = """
[stability.cycle]
parameter = "load"
keys = { "contacts.sole-1.normal_force" = 1.0, "contacts.sole-2.normal_force" = 1.0 }
start = 6.5
stop = 7.5
harmonics = 3
points = 4
[stability.cycle.across]
parameter = "speed"
keys = { "contacts.sole-1.ground.velocity" = 1.0, "contacts.sole-2.ground.velocity" = 1.0 }
start = 0.98
stop = 1.02
points = 2
"""


@pytest.mark.slow
def test_a_killed_run_goes_on_and_motions_in_time_swing_as_limit_cycles(belt: Path) -> None:
    """Rows of the map, limit cycles and checked orbits that were found before are not sought again; the map is that of
    a run without a break. Where a motion in time was made it swings as the orbit beside it, by what is told."""
    short = belt.read_text()
    belt.write_text(short + CYCLE)
    files = modal_files(load_case(belt)[0], Path(), lambda _: None)

    def run(folder: str, until: str = "to its end") -> list[str]:
        said = list[str]()

        def report(words: str) -> None:
            said.append(words)
            if until in words:
                raise KeyboardInterrupt

        with contextlib.suppress(KeyboardInterrupt):
            analysed("stability", CaseJob(belt, files, Path(folder), report=report, pictures=False))
        return said

    assert len(run("a", "3 of 5")) == 3
    again = run("a", "speed 1.02, 2 of 2")
    assert sum("of 5" in words for words in again) == 3 and not Path("a/stability.csv").exists()
    assert {words.split(",")[0] for words in run("a")} == {
        "equations over load", "speed 0.98", "speed 1.02", *(f"limit cycle {i} of 4" for i in (1, 2, 3, 4))
    }  # fmt: skip
    assert not Path("a/stability.points").exists()
    told = json.loads(Path("a/stability.json").read_text())  # four points do not reach the end
    assert not told["whole"] and sum("lost at" in line and "points: 4" in line for line in told["said"]) == 3
    for table, checks in (("stability_cycle_1.csv", 3), ("stability_relief.csv", 6)):
        rows = np.genfromtxt(Path("a", table), delimiter=",", names=True)
        rows = rows[np.isfinite(rows["in_time_leaves_by"])]
        assert len(rows) == checks and (rows["largest_multiplier"][: 3 * (checks == 3)] > 1).all()
        apart = np.abs(rows["in_time_second_u_x_m"] / rows["amplitude_second_u_x_m"] - 1)
        assert (apart < 1e-4).all() and (rows["in_time_leaves_by"] < 1e-4).all()
    belt.write_text(short)
    run("b")
    assert Path("a/stability_map.csv").read_bytes() == Path("b/stability_map.csv").read_bytes()


COUPLED = """
name = "coupled"
[[masses]]
name = "block"
mass = 1.0
free = "x z"
[[springs]]
between = ["ground", "block"]
stiffness = 3.0
axis = [0.8, 0.0, 0.6]
[[springs]]
between = ["ground", "block"]
stiffness = 1.5
axis = [0.6, 0.0, -0.8]
[[contacts]]
name = "sole"
on = "block"
normal = [0.0, 0.0, -1.0]
t2 = [0.0, -1.0, 0.0]
[[monitors]]
name = "block"
on = "block"
"""

SLIDES = """
name = "coupling"
body = "coupled"
[[monitors]]
monitor = "block"
[[contacts]]
interface = "sole"
normal_force = 1.0
points = [1, 1]
normal_stiffness = 1.0
tangential_stiffness = 1.0
friction = 0.3
law = { kind = "rate", slope = 1e7 }
ground = { velocity = 1.0 }
[stability]
frequency = [0.0, 1.0]
neutral = 1e-4
[[stability.over]]
parameter = "friction coefficient"
keys = { "contacts.sole.friction" = 1.0 }
start = 0.1
stop = 1.9
points = 7
[[stability.over]]
parameter = "normal stiffness"
keys = { "contacts.sole.normal_stiffness" = 1.0 }
start = 0.5
stop = 1.5
points = 3
"""


@pytest.mark.slow
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_border_of_a_map_is_where_two_modes_meet(
    way: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, undrawn: None
) -> None:
    """Flutter by mode coupling (N. Hoffmann and others, Acta Mech. 154, 2002): a block on leaning springs and a belt,
    K = [[a, b + way mu k], [b, d + k]] with the normal stiffness k. The roots meet at s^2 = -(a + d + k) / 2 where
    ((a - d - k) / 2)^2 + b (b + way mu k) = 0, and part from there; with the belt the other way they never do."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "coupled").mkdir()
    (tmp_path / "coupled" / "system.toml").write_text(COUPLED)
    (tmp_path / "case.toml").write_text(SLIDES.replace("velocity = 1.0", f"velocity = {way}"))
    assert main(["stability", "case.toml", "--quiet"]) == 0
    axes = np.array([[0.8, 0.6], [0.6, -0.8]])
    K = axes.T @ np.diag([3.0, 1.5]) @ axes
    rows = Path("build/coupling/stability_map.csv").read_text().splitlines()[1:]
    seen = {0: 0, 1: 0}
    for mu, k, count, growth, frequency in [[float(v) for v in row.split(",")] for row in rows]:
        a, b, d = K[0, 0], K[0, 1], K[1, 1] + k
        apart = ((a - d) / 2) ** 2 + b * (b + way * mu * k)
        s = np.sqrt(-(a + d) / 2 - np.array([1, -1]) * np.sqrt(complex(apart)))
        assert count == (apart < 0)
        assert growth == pytest.approx(np.abs(s.real).max(), abs=1e-5)
        if count:
            assert 2 * np.pi * frequency == pytest.approx(np.abs(s.imag).max(), rel=1e-6)
        seen[int(count)] += 1
    assert seen[0] and bool(seen[1]) == (way < 0)


@pytest.mark.parametrize(
    "text, wrong, key",
    [
        ('keys = { "contacts.sole-1.normal_force"', 'keys = { "contacts.sole-9.normal_force"', "sole-9"),
        ('keys = { "contacts.sole-1.normal_force"', 'keys = { "contacts.sole-1.normal_farce"', "normal_farce"),
        ("mu_0 = 0.470610579508", "mu_0 = -0.47", "mu_0"),
        ("[stability]\n", "[stability]\nfull = 2\n", "has no mesh, so there is nothing unreduced"),
        ('law = { kind = "rate", slope = 100.0 }', 'law = "smooth"', "belt.toml: contacts.sole-1: its law"),
        ("ground = { velocity = 1.0 }              # v_0", "", "ground"),
        ("[stability]\nfrequency = [0.0, 1.0]", "[stability]\nfrequency = [1.0, 1.0]", "frequency"),
        ("ground = { velocity = 1.0 }              # v_0", "ground = { rpm = 1.0, velocity = 1.0 }", "rpm"),
        ("normal_force = 8.0          # N; the load parameter B in m", "interference = -1.0", "lifts off"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(
    belt: Path, capsys: pytest.CaptureFixture[str], text: str, wrong: str, key: str
) -> None:
    whole = belt.read_text()
    assert text in whole
    if key == "lifts off":  # whose map follows normal_force, which this case has no more
        whole = whole[: whole.index("[[stability.over]]")]
    belt.write_text(whole.replace(text, wrong, 1))
    refused_command(["stability", str(belt), "--quiet"], capsys, key)
    assert not Path("build/belt/stability.csv").exists()


@pytest.mark.parametrize(
    "keys", ["[stability.cycle]\n{}", "[stability.cycle]\n{}[stability.cycle.across]\n{}", "[stability]\nfull = 2\n"]
)
def test_ranges_are_tried_before_anything_is_computed(
    belt: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, keys: str
) -> None:
    """A limit cycle's key, or a body without a mesh, was told when the roots and the map were there."""
    good = 'parameter = "load"\nkeys = {"contacts.sole-1.normal_force" = 1.0}\nstart = 1.0\nstop = 9.0\n'
    ranges = [good] * (keys.count("{}") - 1) + [good.replace("sole-1", "sole-9")]
    text = belt.read_text()
    if "full" in keys:
        belt.write_text(text.replace("[stability]\n", keys, 1))
    else:
        belt.write_text(text + keys.format(*ranges))
    monkeypatch.setattr("microslip.verbs.stability.state_of", pytest.fail)
    refused_command(["stability", str(belt), "-q"], capsys, "mesh" if "full" in keys else "sole-9")


def test_a_case_that_does_not_ask_is_refused(belt: Path, capsys: pytest.CaptureFixture[str]) -> None:
    belt.write_text((CASES / "belt.toml").read_text())
    refused_command(["stability", str(belt), "--quiet"], capsys, "stability")


# the brake of the case ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def brake(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Disc and pads of the case, each by Rubin's method and by Craig and Bampton's, and the case beside them."""
    folder = tmp_path_factory.mktemp("brake")
    for body in ("brake-disc", "pad"):
        shutil.copytree(ROOT / "geometry" / body, folder / "geometry" / body)
    shutil.copy(CASES / "squeal.toml", folder / "squeal.toml")
    return folder


def state_at(folder: Path, *assignments: str) -> State:
    """The case with other keys, about its sliding."""
    path = folder / "squeal.toml"
    settings, raw = load_case(path, list(assignments))
    files = modal_files(settings, folder, lambda _: None)
    return state_of(Varied(path, raw, {name: read_basis(file) for name, file in files.items()}), {})


def mu(value: float) -> list[str]:
    return [f"contacts.{side}:lining.friction={value!r}" for side in ("upper", "lower")]


def fastest(state: State) -> complex:
    s = every_value(state.matrices)
    s = s[s.imag < 2 * np.pi * 4000]
    return complex(s[np.argmax(s.real)])


@pytest.mark.slow
def test_friction_makes_the_brake_squeal_by_the_work_it_does(brake: Path) -> None:
    """Nothing grows without friction; the printed root grows with it, by the work of the part of K that is not
    symmetric over a cycle less what C takes."""
    for force in ("100.0", "3000.0"):
        sets = [f"contacts.{side}:lining.normal_force={force}" for side in ("upper", "lower")]
        assert fastest(state_at(brake, *mu(0.0), *sets)).real < 0
    Q = state_at(brake).matrices
    every = every_root(Q)
    i = int(np.argmax(np.where(every.s.imag < 2 * np.pi * 4000, every.s.real, -np.inf)))
    s, x = every.s[i], every.x[:, i]
    assert s.imag / (2 * np.pi) == pytest.approx(2350.41, abs=0.01) and s.real == pytest.approx(58.57, abs=0.01)
    work, damped = -np.pi * np.vdot(x, Q.K @ x).imag, np.vdot(x, Q.C @ x)
    taken = np.pi * s.imag * damped.real
    assert work > 0
    swings = np.pi * (2 * s.imag * np.vdot(x, x).real + damped.imag)  # the second is gyroscopic
    assert (work - taken) / swings == pytest.approx(s.real, rel=1e-8)


@pytest.mark.slow
def test_the_wave_of_the_root_that_grows_is_drawn_as_it_is_told(brake: Path, tmp_path: Path) -> None:
    """The rim of the disc in the files for ParaView, Fourier transformed round the axis and over time: four nodal
    diameters, and forward and backward shares as in the sentence; the animation has all frames and moves."""
    path = brake / "squeal.toml"
    settings, raw = load_case(path)
    files = modal_files(settings, brake, lambda _: None)
    bases = {name: read_basis(file) for name, file in files.items()}
    state = state_of(Varied(path, raw, bases), {})
    found = spectrum(state.matrices, Window((0.0, 1e4), (1e3, 2 * np.pi * 4000)), certify=False)
    made = moving(state, found, bases, settings, tmp_path)
    assert {p.stem for p in made if p.suffix == ".pvd"} == {f"root_1_{body}" for body in ("disc", "upper", "lower")}
    shown = [meshio.read(p) for p in made if re.fullmatch(r"root_1_disc_\d+\.vtu", p.name)]
    points = shown[0].points
    rim = np.flatnonzero(np.hypot(*points[:, :2].T) > 0.1499)
    u = np.fft.fft([m.point_data["displacement"][rim, 2] for m in shown], axis=0)[1]
    seen = waves(points[rim], np.stack([0 * u, 0 * u, u], axis=1), np.array([0.0, 0.0, 1.0]), np.zeros(3))
    (told,) = shapes(state, found, bases, settings)
    assert told.endswith(seen.sentence) and seen.leading == 4
    (animation,) = [p for p in made if p.suffix == ".gif"]
    with Image.open(animation) as drawn:
        frames = []
        for k in (0, 8):
            drawn.seek(k)
            frames.append(np.asarray(drawn.convert("L"), dtype=float))
        assert drawn.n_frames == len(shown) == 32 and np.abs(frames[1] - frames[0]).mean() > 5


@pytest.mark.slow
def test_the_root_that_grows_does_not_depend_on_the_reduction(brake: Path) -> None:
    """Twice the modes of the pads move it by less than 3e-5; bodies by Craig and Bampton, which converge
    from above, come nearer with more modes."""
    rubin = fastest(state_at(brake))
    files = [brake / "geometry" / body / "body.toml" for body in ("brake-disc", "pad")]
    own = [file.read_text() for file in files]

    def away(reduction: str, *counts: int) -> float:
        for file, text, count in zip(files, own, counts, strict=True):
            text = text.replace('reduction = "rubin"', f'reduction = "{reduction}"')
            file.write_text(re.sub(r"(?m)^count = \d+", f"count = {count}", text))
        return abs(fastest(state_at(brake)) - rubin) / abs(rubin)

    assert away("rubin", 24, 40) < 3e-5
    few, many = away("craig-bampton", 24, 20), away("craig-bampton", 60, 60)
    assert many < 0.6 * few < 0.6 * 4e-3
