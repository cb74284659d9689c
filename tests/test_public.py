"""What `import microslip as ms` gives: small systems against closed forms, and results that know themselves."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import matplotlib
import meshio
import numpy as np
import pytest
import small
from refusals import refused

import microslip as ms
from microslip.case import load_case, run_case
from microslip.contact.elements import Polynomial, Stop
from microslip.contact.friction import Coulomb
from microslip.contact.law import value
from microslip.contact.patch import Patch
from microslip.continuation import Settings
from microslip.errors import UserError
from microslip.harmonic_balance.by_hand import ElasticSpring, model
from microslip.harmonic_balance.forces import AFT

matplotlib.use("Agg")
ROOT = Path(__file__).resolve().parents[1]


def duffing(**more):
    return ms.structure(1.0, 1.0, 0.05, force={0: 0.4}, elements=[ms.polynomial({3: 0.05})], **more)


@pytest.fixture(scope="module")
def curve():
    return ms.follow(duffing(), 0.3, 2.5, harmonics=7, unit="rad/s")


# against closed forms -------------------------------------------------------------------------------------------------


def test_both_folds_of_duffings_oscillator(curve):
    """As found with 12 harmonics and 256 samples by another route."""
    np.testing.assert_allclose(curve.folds, [1.462616482, 1.156017684], rtol=0, atol=1e-8)
    assert curve.ended == "bound: 2.5 rad/s is reached" and curve.converged.all() and not curve.failures
    q, W = curve.harmonics()[:, 1], curve.parameter
    one = (1 - W**2 + 0.05j * W + 0.75 * 0.05 * abs(q) ** 2) * q  # of one harmonic
    assert np.abs(one - 0.4).max() < 0.05 * np.abs(q).max()


def test_a_curve_that_comes_back_is_followed_by_another():
    """From between the folds, on the small motion, the curve turns at the lower one; the large motion is on the other,
    from the stop. The picture does not join them."""
    found = ms.follow(duffing(), 1.4, 0.3, harmonics=3, unit="rad/s")
    first = found.arrays["branch"] == 0
    assert found.parameter[first][[0, -1]].tolist() == [1.4, 1.4]
    np.testing.assert_allclose(found.parameter[~first][[0, -1]], [0.3, 1.4], rtol=1e-12)
    three = found.amplitude[[0, first.sum() - 1, -1]]
    passed = ms.follow(duffing(), 0.3, 2.5, harmonics=3, unit="rad/s", settings=Settings(targets=(1.4,)))
    np.testing.assert_allclose(passed.amplitude[passed.parameter == 1.4], three[::-1], rtol=1e-6)
    assert "begun at the stop: bound" in found.ended
    assert ms.follow(duffing(), 0.01, 0.012, harmonics=1).ended == "bound: 0.012 Hz is reached"
    x, _ = found.plot().get_lines()[0].get_data()
    assert np.isnan(x).sum() == 1 and "branch" not in passed.arrays


def test_linear_elements_are_entries_of_the_matrices():
    rng = np.random.default_rng(3)
    A = rng.normal(size=(4, 4))
    M, K, W = np.eye(4) + 0.1 * A @ A.T, 50 * np.eye(4) + A @ A.T, np.linspace(1.0, 20.0, 9)
    springs = [ms.polynomial({1: 30.0}, at=1), ms.polynomial({1: 7.0}, at=3, to=0), ms.polynomial({1: 2.0}, at=A[0])]
    system = ms.structure(M, K, 0.3 * M, force={2: 1.0 + 0.5j}, elements=springs, output=[0, 3])
    found = ms.harmonic_response(system, W, unit="rad/s", harmonics=2)
    w = np.array([0, 0, 0, 1]) - np.array([1, 0, 0, 0])
    K = K + 30.0 * np.diag([0, 1, 0, 0]) + 7.0 * np.outer(w, w) + 2.0 * np.outer(A[0], A[0])
    exact = np.array([np.linalg.solve(K - x * x * M + 0.3j * x * M, [0, 0, 1.0 + 0.5j, 0]) for x in W])
    for i, dof in enumerate((0, 3)):
        np.testing.assert_allclose(found.harmonics(i)[:, 1], exact[:, dof], rtol=1e-9)
    np.testing.assert_array_equal(found.readouts, ["q 0", "q 3"])


def test_the_effective_damping_of_one_coordinate():
    found = ms.harmonic_response(ms.structure(2.0, 8.0, 0.3, force={0: 1.0}), [0.5, 2.0, 5.0], unit="rad/s")
    np.testing.assert_allclose(found.damping_ratio, 0.3 / (2 * 2.0 * np.array([0.5, 2.0, 5.0])), rtol=1e-12)


def test_a_jenkins_element_is_the_closed_form_of_one_harmonic():
    """Its describing function; many samples, because those of a cycle are fewer than its kinks need."""
    k, R = 3.0, 0.5
    system = ms.structure(1.0, 1.0, 0.02, force={0: 0.3}, elements=[ms.jenkins(k, R)])
    found = ms.harmonic_response(system, np.linspace(0.5, 2.5, 41), unit="rad/s", harmonics=1, samples=4096)
    W, a = found.parameter, found.amplitude
    ratio = np.minimum(1.0, R / (k * a))
    theta = np.arccos(1 - 2 * ratio)
    stiffness = k / np.pi * (theta - 0.5 * np.sin(2 * theta) + 1j * np.sin(theta) ** 2)
    exact = 0.3 / np.abs(1 - W**2 + 0.02j * W + stiffness)
    np.testing.assert_allclose(a, exact, rtol=1e-5)
    lost = np.where(ratio < 1, 4 * R * (a - R / k), 0.0)
    np.testing.assert_allclose(found.dissipated, lost, atol=2e-3 * lost.max())
    assert (lost > 0).any() and (lost == 0).any()


@pytest.mark.parametrize("law", [Polynomial(np.array([2.0, -3.0, 5.0])), Stop(7.0, 0.2), Stop(7.0, 0.1, both=True)])
def test_springs_by_hand_are_those_that_are_marched(law):
    shape = np.zeros((1, 3, 1))
    shape[0, 1, 0] = 1.3
    patch = Patch("element", np.zeros((1, 2)), np.ones(1), law, shape)
    hand, marched = ElasticSpring(patch, 5, 64, 3, 1e-12), AFT(patch, 5, 64, 3, 1e-12)
    assert isinstance(model([patch] * 5, 64, 3, 1e-12), ElasticSpring)
    u = 0.3 * np.random.default_rng(1).normal(size=(5, 1, 7))
    for a, b in zip(
        (hand.force(u, 1.0), *hand.forces(u, 1.0)), (marched.force(u, 1.0), *marched.forces(u, 1.0)), strict=True
    ):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 * np.abs(b).max())
    for one, other in zip(hand.traced(u, 1.0), marched.traced(u, 1.0), strict=True):
        np.testing.assert_allclose(one.force, other.force, rtol=0, atol=1e-12)
        assert one.cycle.dissipated == pytest.approx(other.cycle.dissipated, abs=1e-12) and one.cycle.lost == 0


def test_on_a_shaking_ground_motions_are_relative_to_it():
    """a / |k/m - Omega^2 + i c/m Omega| of a linear mass; with an element what the force -M r a makes, in harmonic
    balance and in time."""
    W = np.array([0.7, 1.0, 1.6])
    linear = ms.structure(2.0, 2.0, 0.2, base_acceleration=0.3)
    found = ms.harmonic_response(linear, W, unit="rad/s", harmonics=1)
    np.testing.assert_allclose(found.amplitude, 0.3 / np.abs(1 - W**2 + 0.1j * W), rtol=1e-12)
    M, K, spring = np.diag([1.0, 2.0]), np.array([[2.0, -1.0], [-1.0, 1.0]]), ms.polynomial({3: 0.5}, at=1)
    shaken = ms.structure(M, K, 0.4 * K, base_acceleration=[0.3, 0.3], elements=[spring])
    forced = ms.structure(M, K, 0.4 * K, force=[-0.3, -0.6], elements=[spring])
    a, b = (ms.harmonic_response(s, W, unit="rad/s", harmonics=3) for s in (shaken, forced))
    np.testing.assert_allclose(a.harmonics("q 1"), b.harmonics("q 1"), rtol=1e-12, atol=1e-14)
    seen = ms.integrate(shaken, 1.6, unit="rad/s", settle=100, keep=1)
    first = 2 * np.mean(seen.y[1, :256] * np.exp(-1.6j * seen.time[:256]))
    assert first == pytest.approx(a.harmonics("q 1")[2, 1], rel=1e-4)
    refused("base_acceleration", ms.structure, M, K, base_acceleration=[0.1])


def test_a_stop_is_met_beyond_its_gap():
    """The free oscillation up to the gap; beyond it stiffer, so that the resonance leans to higher frequencies."""
    free = ms.structure(1.0, 1.0, 0.04, force={0: 0.02})
    stopped = ms.structure(1.0, 1.0, 0.04, force={0: 0.02}, elements=[ms.stop(5.0, 0.3)])
    grid = np.linspace(0.6, 1.4, 81)
    a, b = (ms.harmonic_response(s, grid, unit="rad/s", harmonics=5).amplitude for s in (free, stopped))
    same = a < 0.3
    np.testing.assert_allclose(a[same][:20], b[same][:20], rtol=1e-9)
    assert b.max() < 0.95 * a.max() and grid[b.argmax()] > grid[a.argmax()]


def test_a_curve_over_the_load_meets_the_one_over_the_frequency(curve):
    i = int(np.argmin(abs(curve.parameter - 1.2)))
    at = float(curve.parameter[i])
    load = ms.follow(duffing(), 0.01, 1.2, over="load", frequency=at, harmonics=7, unit="rad/s")
    near = np.interp(1.0, load.parameter, load.amplitude) if not len(load.folds) else None
    crossings = [j for j in range(len(load) - 1) if (load.parameter[j] - 1) * (load.parameter[j + 1] - 1) <= 0]
    values = [np.interp(1.0, *(np.sort(v[[j, j + 1]]) for v in (load.parameter, load.amplitude))) for j in crossings]
    assert min(abs(v / curve.amplitude[i] - 1) for v in values) < 2e-2 and (near is None or near in values)


# results --------------------------------------------------------------------------------------------------------------


def test_tables_say_what_the_result_says(curve):
    frame, data = curve.to_dataframe(), curve.to_xarray()
    np.testing.assert_array_equal(frame["Omega"], curve.parameter)
    np.testing.assert_allclose(frame["frequency_Hz"], curve.parameter / (2 * np.pi), rtol=1e-15)
    np.testing.assert_array_equal(frame["amplitude_m"], np.abs(data["monitors.q"][:, 0].sel(harmonic=1)))
    assert data["monitors.q"].attrs["units"] == "m" and data["frequency"].attrs["units"] == "Hz"
    assert frame["converged"].all() and set(frame["status"]) == {"converged"}
    np.testing.assert_allclose(frame["supplied_J"], frame["damped_J"] + frame["dissipated_J"], rtol=1e-9)


def test_a_result_is_drawn_as_it_is(curve):
    axes = curve.plot()
    x, y = axes.lines[0].get_data()
    assert (
        y.max() == pytest.approx(curve.amplitude.max(), rel=2e-3) and axes.get_xlabel() == "angular frequency in rad/s"
    )
    np.testing.assert_allclose(np.sort(axes.lines[1].get_xdata()), np.sort(curve.folds))
    for at, amplitude in zip(curve.parameter, curve.amplitude, strict=True):  # the line passes through every point
        assert np.hypot(x - at, y - amplitude).min() < 1e-9


def test_a_result_says_where_its_largest_amplitude_is_no_resonance(curve, tmp_path):
    """A Duffing curve that ends below its fold rises to its end."""
    whole, half = ms.load(curve.save(tmp_path / "duffing.h5")), int(curve.amplitude.argmax()) // 2
    arrays = {name: values[:half] for name, values in whole.arrays.items()}
    cut = replace(whole, key=whole.key[:half], status=whole.status[:half], arrays=arrays)
    assert f" at {cut.parameter[-1]:.6g} rad/s, an end;" in repr(cut) and "an end" not in repr(whole)


def test_a_saved_result_is_the_same(curve, tmp_path):
    path = curve.save(tmp_path / "duffing.h5")
    again = ms.load(path)
    assert repr(again)[7:] == repr(curve)[8:] and again.over == "Omega"
    for name, values in curve.arrays.items():
        np.testing.assert_array_equal(again.arrays[name], values)
    np.testing.assert_array_equal(again.folds, curve.folds)
    assert ms.read_response(path).series[0].readouts == curve.readouts == ("q",)


def test_saving_takes_the_place_of_a_response_and_of_no_other_file(curve, tmp_path):
    path = curve.save(tmp_path / "curve.h5")
    assert curve.save(path) == path
    empty = tmp_path / "empty.h5"
    empty.touch()
    curve.save(empty)
    motion = ms.integrate(duffing(), 0.5, unit="rad/s", settle=0, keep=1)
    precious = tmp_path / "precious.txt"
    precious.write_text("mine")
    for found, place in ((curve, precious), (motion, precious), (motion, path)):
        before = place.read_bytes()
        refused(f"{place.name}: is there already and is ", found.save, place)
        assert place.read_bytes() == before


def test_the_error_estimate_is_what_more_harmonics_change():
    coarse = ms.harmonic_response(duffing(), [1.2], unit="rad/s", harmonics=1)
    fine = ms.harmonic_response(duffing(), [1.2], unit="rad/s", harmonics=9)
    truth = abs(fine.amplitude[0] / coarse.amplitude[0] - 1)
    assert 1e-4 < truth <= coarse.error_estimate().readout < 20 * truth
    assert "% at most" in repr(coarse.error_estimate()) and "too " in repr(coarse.error_estimate())


def test_a_point_without_a_solution_says_why():
    free = ms.structure(1.0, 0.0, 0.0, force={0: 1.0}, elements=[ms.polynomial({2: 1.0})])  # falls off its only side
    found = ms.harmonic_response(free, [1.0, 2.0], unit="rad/s")
    bad = [f for f, _ in found.failures]
    assert len(found) == 2 and len(bad) == (~found.converged).sum() and all(cause for _, cause in found.failures)
    assert len(bad) == 0 or "not converged" in repr(found)


def test_results_say_themselves_in_a_line():
    """Without their arrays."""
    decay = ms.Dynamics(lambda x, p, _: -x, ("x", "y"), np.ones(2))
    diagram = ms.bifurcate(decay, 1.0, 2.0, orbits=False)
    wheel = ms.circle(0.46)
    for one in (diagram, *diagram.branches, diagram.branches[0].orbit(decay, 0), wheel):
        assert "array(" not in repr(one) and len(repr(one)) < 200 and type(one).__name__ in repr(one)


def test_elements_of_laws_that_print_alike_keep_their_own():
    """Equal ones are evaluated together: those whose numbers are, not those that look so in eight
    digits or with the middle of a long array left out."""
    springs = [Polynomial(np.array([k, 0.0, 0.1])) for k in (1.0, 1.0 + 3e-9, 1.0)]
    contacts = ms.structure(np.eye(3), np.eye(3), elements=[ms.Element(s, i) for i, s in enumerate(springs)]).contacts
    assert contacts[0].patch is contacts[2].patch
    assert contacts[1].patch.law.stiffness[0] == 1.0 + 3e-9 and contacts[0].patch.law.stiffness[0] == 1.0


def test_a_backbone_goes_from_stuck_to_free(tmp_path):
    system = ms.structure(1.0, 1.0, 0.01, force={0: 1.0}, elements=[ms.jenkins(3.0, 0.3)])
    mode = ms.backbone(system, 1e-3, 1e2, harmonics=3)
    assert (
        mode.complete
        and mode.Omega[0] == pytest.approx(2.0, rel=1e-6)
        and mode.Omega[-1] == pytest.approx(1.0, abs=0.01)
    )
    assert "damping ratio" in repr(mode) and len(mode.to_dataframe()) == len(mode.Omega)
    assert mode.to_xarray()["frequency"].attrs["units"] == "Hz"
    np.testing.assert_array_equal(mode.plot().lines[0].get_ydata(), mode.frequency)
    again = ms.load(mode.save(tmp_path / "mode.h5"))
    assert repr(again) == repr(mode) and again.complete and again.checks == mode.checks
    np.testing.assert_allclose(again.Omega, mode.Omega, rtol=1e-15)
    for name in ("amplitude", "damping", "x"):
        np.testing.assert_array_equal(getattr(again, name), getattr(mode, name))


@pytest.mark.slow
def test_a_backbone_of_a_gauge_is_in_strains(tmp_path):
    case = CASE | {"monitor": "root", "contacts": [RUB | {"interface": "right"}]}
    of = ms.assemble(case, normal_force=20.0, vane=ms.sample())
    mode = ms.backbone(of, 1e-9, 1.1e-9, harmonics=1)
    again = ms.load(mode.save(tmp_path / "mode.h5"))
    for one in (mode, again):
        assert "amplitude_strain" in one.columns() and " m/m," in repr(one)
        assert one.plot().get_xlabel() == "amplitude in m/m" and one.to_xarray()["amplitude"].attrs["units"] == "1"


# bodies ---------------------------------------------------------------------------------------------------------------

RUB = {"normal_stiffness": 2e5, "tangential_stiffness": 4e5, "includes": "surface", "friction": 0.2, "points": [3, 2]}
CASE = {"body": "vane", "excitation": "magnet", "amplitude": 2.0, "monitor": "probe"}


def sample_case():
    """That of the sample, with few points and samples."""
    text = (ms.sample().parent / "case.toml").read_text(encoding="utf-8")
    return "samples = 24\n" + text.replace("points = [6, 3]", "points = [2, 2]")


def rubbing(**contact):
    return ms.assemble({**CASE, "contacts": [{**RUB, **contact}]}, vane=ms.sample())


@pytest.mark.usefixtures("unjudged")
def test_an_assembly_of_a_dict_is_that_of_a_file(tmp_path):
    text = sample_case()
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    of_file = ms.assemble("case.toml", tmp_path, normal_force=100.0, **{"vane-eigenmodes": ms.sample()})
    of_dict = ms.assemble(tomllib.loads(text), normal_force=100.0, **{"vane-eigenmodes": ms.read_basis(ms.sample())})
    one, other = (ms.harmonic_response(a, [260.0, 420.0], harmonics=1, samples=24) for a in (of_file, of_dict))
    np.testing.assert_array_equal(one.amplitude, other.amplitude)
    asked = "sweep={start=260.0, stop=420.0, points=2, normal_forces=[100.0]}", "harmonics=1"
    swept = load_case(tmp_path / "case.toml", [*asked])
    found = run_case(swept[0], ms.read_basis(ms.sample())).responses[100.0]
    np.testing.assert_allclose(np.abs(found.monitor[found.asked]), one.amplitude, rtol=1e-8)
    book = ms.assemble({**tomllib.loads(text), "mode": "book"}, normal_force=100.0, **{"vane-eigenmodes": ms.sample()})
    assert abs(ms.harmonic_response(book, [420.0], harmonics=1, samples=24).amplitude[0] / one.amplitude[1] - 1) < 0.05
    assert one.readouts == ("probe",) and "right" in repr(of_dict) and one.converged.all()


def test_the_modes_of_a_dict_are_those_of_its_mesh(tmp_path):
    mesh = small.beam()
    types = {"tetra10": "tetra10", "triangle6": "triangle6"}
    faces = {name: blocks["triangle6"] for name, blocks in mesh.faces.items()}
    cells = [(types["tetra10"], mesh.cells["tetra10"]), *(("triangle6", f) for f in faces.values())]
    numbers = [np.full(len(c), i, dtype=int) for i, (_, c) in enumerate(cells)]
    named = {name: np.array([i, 2]) for i, name in enumerate(faces, 1)} | {"body": np.array([0, 3])}
    data = {"gmsh:physical": numbers, "gmsh:geometrical": numbers}
    meshio.Mesh(mesh.points, cells, cell_data=data, field_data=named).write(
        tmp_path / "small.msh", file_format="gmsh22"
    )
    basis = ms.modes(small.table(), tmp_path)
    np.testing.assert_allclose(basis.groups[0, 0].frequency, small.basis().groups[0, 0].frequency, rtol=1e-9)
    assert "small: 6 coordinates" in repr(basis) and list(basis.to_dataframe()["mode"]) == [1, 2, 3, 4, 5, 6]
    assert not list(tmp_path.glob("build/*"))


def test_the_modes_of_a_system_by_hand_are_those_of_its_matrices(tmp_path):
    place = tmp_path / "pair"
    place.mkdir()
    ground, between = ["ground", "a"], ["a", "b"]
    masses = "".join(f'[[masses]]\nname = "{n}"\nmass = 1.0\nat = [0, 0, 0]\nfree = "x"\n' for n in "ab")
    springs = "".join(f"[[springs]]\nbetween = {pair}\nstiffness = 1.0\n" for pair in (ground, between))
    (place / "system.toml").write_text(f'name = "pair"\n{masses}{springs}', encoding="utf-8")
    golden = (np.sqrt(5.0) + np.array([-1.0, 1.0])) / 2.0
    for body in (place, str(place / "system.toml")):
        omega = ms.modes(body, tmp_path).groups[0, 0].frequency * 2.0 * np.pi
        np.testing.assert_allclose(omega, golden, rtol=1e-12)
    assert (tmp_path / "build/pair/basis.h5").is_file()


@pytest.mark.parametrize(("call", "loaded"), [("dir(ms)", "[]"), ("ms.read_basis(ms.sample())", "['h5py', 'numpy']")])
def test_a_call_imports_no_more_than_it_needs(call, loaded):
    heavy = "{'numpy', 'jax', 'h5py', 'matplotlib', 'skfem'}"
    code = f"import sys, microslip as ms; {call}; print(sorted({heavy} & set(sys.modules)))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == loaded


PROCESS = """import json, os, sys, warnings
def process():
    import jax, scipy.signal, scipy.sparse.linalg, scipy.special  # which have filters of their own
    return [dict(os.environ), {k: str(v) for k, v in jax.config.values.items()}, [str(f) for f in warnings.filters],
            os.listdir(os.environ["XDG_CACHE_HOME"])]
before = process()
import microslip as ms
for name in ms.__all__:
    getattr(ms, name)
import microslip.case.run, microslip.time_domain.orbit
from jax._src.xla_bridge import backends_are_initialized
started = backends_are_initialized()
ms.structure(1.0, 1.0, force={0: 1.0}, elements=[ms.jenkins(1.0, 1.0), ms.stop(1.0, 1.0), ms.polynomial({3: 1.0})])
imported, refusal = process(), ""
try:
    ms.prepare(double=False)
except ms.UserError as error:
    refusal = str(error)
sentences, after = ms.prepare(compiler=False, cache=False), process()
print(json.dumps({
    "imported": [a == b for a, b in zip(before, imported)], "started": started, "refusal": refusal,
    "sentences": len(sentences),
    "options": [k for k in after[1] if after[1][k] != before[1][k]], "rest": [before[i] == after[i] for i in (0, 2, 3)],
}))
"""


def processes(tmp_path, code, **environment):
    """What a program prints, in JSON, whose cache folder is empty."""
    known = {k: v for k, v in os.environ.items() if k not in ("NPROC", "XLA_FLAGS") and not k.startswith("JAX_")}
    (tmp_path / "cache").mkdir(exist_ok=True)
    known |= {"XDG_CACHE_HOME": str(tmp_path / "cache"), **environment}
    command = [sys.executable, "-c", code]
    return json.loads(subprocess.run(command, capture_output=True, text=True, check=True, env=known).stdout)


@pytest.fixture(scope="module")
def host(tmp_path_factory):
    """A program that loads every public name and makes a structure; then 64 bit are asked for alone."""
    return processes(tmp_path_factory.mktemp("host"), PROCESS)


def test_importing_changes_nothing_of_the_process(host):
    """What jax loads is its own: environment, options of jax, filters of warnings, the cache folder. Nothing is
    computed, or flags of the compiler would come too late."""
    assert host["imported"] == [True, True, True, True] and not host["started"]


@pytest.mark.slow
def test_the_first_solve_makes_jax_ready_and_tells(tmp_path):
    code = """import json, logging, os, microslip as ms
said = []
class Kept(logging.Handler):
    def emit(self, record):
        said.append(record.getMessage())
logging.getLogger("microslip").addHandler(Kept())
logging.getLogger("microslip").setLevel("INFO")
system = ms.structure(1.0, 1.0, 0.1, force={0: 0.3}, elements=[ms.jenkins(1.0, 0.5)])
ms.integrate(system, 0.1, settle=0, keep=1)
import jax
print(json.dumps([os.environ["NPROC"], "small_while_loop" in os.environ["XLA_FLAGS"], jax.config.jax_enable_x64,
                  len(os.listdir(os.environ["XDG_CACHE_HOME"] + "/microslip/jax")) > 1, said == list(ms.prepare()),
                  len(said)]))"""
    assert processes(tmp_path, code) == ["1", True, True, True, True, 4]


def test_a_host_can_keep_its_process(host):
    """All but 64 bit, without which nothing is solved."""
    assert host["sentences"] == 1 and host["rest"] == [True, True, True]
    assert host["options"] == ["jax_enable_x64"] and "double" in host["refusal"]


def test_a_law_from_another_process_makes_jax_ready_and_leaves_what_the_host_chose(tmp_path):
    """As a worker of an ensemble gets it: 0.3 in double precision; the host's threads, folder and limits stay."""
    (tmp_path / "law").write_bytes(pickle.dumps(Coulomb(value(0.3))))
    code = """import json, os, pathlib, pickle
law = pickle.loads(pathlib.Path(os.environ["XDG_CACHE_HOME"], "../law").read_bytes())
import jax
print(json.dumps([[float(law.mu), jax.config.jax_persistent_cache_min_compile_time_secs,
                   jax.config.jax_persistent_cache_min_entry_size_bytes], os.environ["NPROC"],
                  jax.config.jax_compilation_cache_dir, os.listdir(os.environ["XDG_CACHE_HOME"])]))"""
    own = {"JAX_COMPILATION_CACHE_DIR": str(tmp_path / "own"), "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "7"}
    (mu, seconds, size), *words = processes(tmp_path, code, NPROC="3", **own)
    assert mu == 0.3
    assert seconds == 0.01 and size == 7
    assert words == ["3", str(tmp_path / "own"), []]


def test_gyroscopic_forces_in_the_damping_matrix_are_solved_exactly():
    """Of two coordinates with forces across, a spring at each: against the direct solution at every frequency."""
    M, K, C = np.diag([1.0, 2.0]), np.array([[4.0, -1.0], [-1.0, 9.0]]), np.array([[0.1, 1.5], [-1.5, 0.2]])
    springs = [ms.polynomial({1: 0.7}, at=0), ms.polynomial({1: 0.3}, at=1)]
    whirling = ms.structure(M, K, C, force={0: 1.0}, elements=springs, output=[0, 1])
    Omega = np.linspace(0.5, 4.0, 15)
    matrices = K + np.diag([0.7, 0.3]) - Omega[:, None, None] ** 2 * M + 1j * Omega[:, None, None] * C
    exact = np.linalg.solve(matrices, np.array([1.0, 0.0])[:, None])[:, :, 0]
    swept = ms.harmonic_response(whirling, Omega, harmonics=3, unit="rad/s")
    for i in range(2):
        np.testing.assert_allclose(swept.harmonics(f"q {i}")[:, 1], exact[:, i], rtol=1e-9)
    curve = ms.follow(whirling, 0.5, 4.0, harmonics=1, unit="rad/s")
    w = 2 * np.pi * np.asarray(curve.frequency)
    there = K + np.diag([0.7, 0.3]) - w[:, None, None] ** 2 * M + 1j * w[:, None, None] * C
    first = np.linalg.solve(there, np.array([1.0, 0.0])[:, None])[:, 0, 0]
    np.testing.assert_allclose(curve.amplitude, np.abs(first), rtol=1e-7)


SLIDER = ms.structure(1.0, 1.0, 0.02, force={0: 0.3}, elements=[ms.jenkins(1.0, 0.5)])


# mistakes -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "make, said",
    [
        (lambda: ms.structure(np.eye(2), np.eye(3)), "K is 3 x 3 and M is 2 x 2"),
        (lambda: ms.structure(np.ones((2, 3)), 1.0), "M: has shape (2, 3); give a square matrix"),
        (lambda: ms.structure(np.diag([1.0, 0.0]), np.eye(2)), "a coordinate has no mass"),
        (lambda: ms.structure([[1, 2], [0, 1]], np.eye(2)), "M is not symmetric"),
        (lambda: ms.structure(np.eye(2), [[1, 2], [0, 5]]), "K is not symmetric: circulatory"),
        (lambda: ms.structure(1.0, np.nan), "structure: K"),
        (lambda: ms.structure(1.0, 1.0, damping_ratio=-0.1), "damping_ratio"),
        (lambda: ms.structure(1.0, 1.0, force={3: 1.0}), "there is no coordinate 3; the structure has 1"),
        (lambda: ms.structure(1.0, 1.0, output=2), "there is no coordinate 2"),
        (lambda: ms.structure(1.0, 1.0, elements=ms.jenkins(1.0, 1.0)), "structure: elements: must be a list"),
        (lambda: ms.structure(1.0, 1.0, damping_ratio=5.0), "5 % is 0.05"),
        (lambda: ms.polynomial([1.0, 2.0]), "give it by power"),
        (lambda: ms.structure(1.0, 1.0, force={0: "1 N"}), "structure: force: "),
        (lambda: ms.structure([[1, 2], [3]], 1.0), "structure: M"),
        (lambda: ms.structure(1.0, 1.0, elements=[ms.jenkins(1.0, 1.0, at=0, to=0)]), "nothing moves it"),
        (lambda: ms.follow(ms.structure(1.0, 1.0, force={0: 1.0}), 0.5, 2.0), "no contact or element"),
        (lambda: ms.backbone(ms.structure(1.0, 1.0, force={0: 1.0}), 0.1, 1.0), "no contact or element"),
        (lambda: ms.harmonic_response(SLIDER, ["300"]), "harmonic_response: frequency"),
        (lambda: ms.follow(SLIDER, 0.5, 2.0, settings={"pionts": 10}), "there is no pionts"),
        (lambda: ms.follow(SLIDER, 1.0, 1.0), "stop: 1 is the start too"),
        (lambda: ms.Element(5.0, 0), "Element: law"),
        (lambda: ms.structure(1.0, 1.0, elements=[ms.jenkins(1.0, 1.0, at=5)]), "there is no coordinate 5"),
        (lambda: ms.structure(np.eye(2), np.eye(2), elements=[ms.stop(1.0, 0.1, at=[1.0])]), "weights of shape (1,)"),
        (lambda: ms.polynomial({}), "give one or more whole numbers"),
        (lambda: ms.polynomial({0: 1.0}), "powers [0]"),
        (lambda: ms.jenkins(0.0, 1.0), "jenkins: stiffness"),
        (lambda: ms.stop(1.0, np.inf), "stop: gap"),
        (lambda: ms.follow(duffing(), 0.3, 2.5, unit="rpm"), "follow: unit"),
        (lambda: ms.follow(duffing(), 0.0, 2.5), "start"),
        (lambda: ms.follow(duffing(), 0.1, 1.0, over="load"), "frequency: is missing"),
        (lambda: ms.follow(duffing(), 0.1, 1.0, over="time"), "follow: over"),
        (lambda: ms.harmonic_response(duffing(), []), "frequency"),
        (lambda: ms.harmonic_response("blade", [1.0]), "str is no assembly"),
        (lambda: ms.harmonic_response(duffing(), [1.0], harmonics=2.5), "harmonic_response: harmonics"),
        (lambda: ms.two_tones(duffing(), 1.0, 1.3, harmonics=2.5), "two_tones: harmonics"),
        (lambda: ms.harmonic_response(duffing(), [1.0]).harmonics("tip"), "read-out 'tip': the response has q"),
        (lambda: rubbing(interface="rigth", normal_force=1.0),
         "no interface 'rigth'"),
        (lambda: ms.assemble({**CASE, "contacts": []}, wing=ms.sample()), "there is no body 'wing'"),
        (lambda: ms.assemble({**CASE, "contact": []}, vane=ms.sample()), "contact: unknown key"),
        (lambda: ms.modes({"name": "plate"}), "geometry"),
        (lambda: ms.load("nowhere.h5"), "no such response"),
        (lambda: ms.harmonic_response(rubbing(interface="right"), [250.0]), "contacts.right: waits for a normal force"),
        (lambda: ms.backbone(ms.structure(1.0, 1.0), 1e-3, 1.0), "nothing is read; give output to structure"),
        (lambda: ms.backbone(duffing(), 1.0, 1e-3), "high: 0.001 is not above low"),
        (lambda: ms.backbone(duffing(), 1e-3, 1.0, mode=9), "there is no mode 9; there are 1, counted from 0"),
        (lambda: ms.harmonic_response(ms.structure(1.0, 1.0, output=0), [1.0]), "nothing drives it"),
        (lambda: ms.harmonic_response(duffing(), [1.0], harmonics=3, samples=8), "8 are too few for 3 harmonics"),
        (lambda: ms.jenkins("stiff", 1.0), "jenkins: stiffness"),
        *((lambda e=e: ms.harmonic_response(ms.structure(1.0, 1.0, 0.1, force={0: 1.0}, elements=[e]), [1.0]), name)
          for e, name in ((ms.friction(2.0), "element friction 1: "), (ms.stop(np.inf, 0.1), "element stop 1: "),
                          (ms.friction(2.0, name="pad"), "element pad: "))),
    ],
)  # fmt: skip
def test_mistakes(make, said):
    with pytest.raises(UserError, match=".*") as caught:
        make()
    assert said in str(caught.value)


def test_names_that_are_not_there():
    with pytest.raises(AttributeError, match="no attribute 'harmonic'"):
        _ = ms.harmonic


def test_results_and_systems_of_both_kinds_have_the_same_names(curve):
    """rad/s whatever a result runs over; messages of a structure, which needs none."""
    np.testing.assert_allclose(curve.Omega, curve.parameter, rtol=1e-12)
    in_hertz = ms.harmonic_response(duffing(), [0.1, 0.2])
    np.testing.assert_allclose(in_hertz.Omega, 2 * np.pi * in_hertz.frequency, rtol=0)
    assert duffing().messages == ()


def test_a_backbone_says_in_words_why_it_ends():
    found = ms.backbone(duffing(), 0.1, 0.2)
    assert found.complete and repr(found).endswith("; all amplitudes were reached>")


@pytest.mark.parametrize("normal", [20.0, 2e4])
def test_where_nothing_vibrates_no_energy_is_missing(normal):
    """What damping takes of rounding, 1e-34 of F_0 u_0, is no failure of the balance."""
    a = ms.assemble(tomllib.loads(sample_case()), normal_force=normal, **{"vane-eigenmodes": ms.sample()}).assembly
    rest = replace(a, loads=tuple(replace(x, amplitude=0.0) for x in a.loads))
    still = ms.harmonic_response(rest, [870.0], harmonics=1, samples=48)
    assert still.arrays["damped"][0] > 0 and still.amplitude[0] < 1e-15 and still.converged.all()
