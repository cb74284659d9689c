"""A unit for system simulators, driven through its functions here and by FMPy, against the closed form of its modes."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import scipy.linalg
import small
from refusals import refused
from test_exchange import body
from test_exchange_peers import ask, needs

from microslip.data import Array, ModalBasis, ModalGroup
from microslip.errors import UserError
from microslip.exchange import formats, writer
from microslip.reduced.coordinates import in_modes

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="a C compiler is not installed")
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="the binary is looked for where Linux has it")


def plain() -> ModalBasis:
    return body(reduction="eigenmodes")


CALLBACKS = type("Callbacks", (ctypes.Structure,), {"_fields_": [(n, ctypes.c_void_p) for n in "labse"]})


class Master:
    """One instance of a unit through its C functions, with the names and references of its description."""

    def __init__(self, path: Path, folder: Path, logger: object = None) -> None:
        if not folder.exists():  # a library that is loaded must not be written again
            with zipfile.ZipFile(path) as archive:
                archive.extractall(folder)
        root = ElementTree.parse(folder / "modelDescription.xml").getroot()
        self.at = {v.get("name"): int(v.get("valueReference", "")) for v in root.iter("ScalarVariable")}
        self.start = {v.get("name"): v[0].get("start") for v in root.iter("ScalarVariable")}
        name = next(root.iter("CoSimulation")).get("modelIdentifier")
        self.library = ctypes.CDLL(str(folder / "binaries" / "linux64" / f"{name}.so"))
        make = self.library.fmi2Instantiate
        make.restype = ctypes.c_void_p
        make.argtypes = [ctypes.c_char_p, ctypes.c_int, *[ctypes.c_char_p] * 2, ctypes.c_void_p, *[ctypes.c_int] * 2]
        guid = root.get("guid", "").encode()
        assert make(b"body", 1, b"another", b"", None, 0, 0) is None
        calls = CALLBACKS(ctypes.cast(logger, ctypes.c_void_p) if logger else None)
        self.one = make(b"body", 1, guid, b"", ctypes.byref(calls), 0, 0)
        assert self.one
        self.modes = sum(n.startswith("modal.q[") for n in self.at)

    def call(self, name: str, *words: object, returns: int = 0) -> None:
        assert getattr(self.library, f"fmi2{name}")(ctypes.c_void_p(self.one), *words) == returns

    def _named(self, names: list[str]) -> tuple[object, object]:
        return (ctypes.c_uint * len(names))(*(self.at[n] for n in names)), ctypes.c_size_t(len(names))

    def set(self, values: Mapping[str, float]) -> None:
        self.call("SetReal", *self._named(list(values)), (ctypes.c_double * len(values))(*values.values()))

    def slope(self, values: Mapping[str, float]) -> None:
        orders = (ctypes.c_int * len(values))(*[1] * len(values))
        rates = (ctypes.c_double * len(values))(*values.values())
        self.call("SetRealInputDerivatives", *self._named(list(values)), orders, rates)

    def get(self, *names: str) -> Array:
        found = (ctypes.c_double * len(names))()
        self.call("GetReal", *self._named(list(names)), found)
        return np.array(found)

    def state(self) -> Array:
        return self.get(*(f"modal.{s}[{j + 1}]" for s in "qv" for j in range(self.modes)))

    def step(self, time: float, h: float) -> None:
        self.call("DoStep", ctypes.c_double(time), ctypes.c_double(h), 0)

    def slopes(self, x: Array) -> Array:
        """Model exchange: x' at a state."""
        given, found = (ctypes.c_double * len(x))(*x), (ctypes.c_double * len(x))()
        self.call("SetContinuousStates", given, ctypes.c_size_t(len(x)))
        self.call("GetDerivatives", found, ctypes.c_size_t(len(x)))
        return np.array(found)


@pytest.fixture(scope="module")
def files() -> dict[int, tuple[ModalBasis, Path]]:
    return {}


@pytest.fixture
def run(
    files: dict[int, tuple[ModalBasis, Path]], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[[ModalBasis], Master]]:
    """Starts a unit of a body; what is the same body is compiled once."""
    made: list[Master] = []

    def start(basis: ModalBasis) -> Master:
        if id(basis) not in files:
            files[id(basis)] = basis, tmp_path_factory.mktemp("fmu") / "b.fmu"
            writer("fmu")(*files[id(basis)])
        path = files[id(basis)][1]
        made.append(Master(path, path.with_suffix("")))
        return made[-1]

    yield start
    for one in made:
        one.library.fmi2FreeInstance(ctypes.c_void_p(one.one))


def step_response(g: ModalGroup, load: Array, t: float) -> tuple[Array, Array]:
    """q and q' of every mode at t after a constant force from rest: Sextro's one-degree-of-freedom system, D < 1."""
    D, w = g.damping_ratio, g.omega
    d = w * np.sqrt(1 - D**2)
    fade, c, s = np.exp(-D * w * t), np.cos(d * t), np.sin(d * t)
    return load / w**2 * (1 - fade * (c + D * w / d * s)), load / d * fade * s


@LINUX
@pytest.mark.parametrize("reduction", ["eigenmodes", "craig-bampton"])
def test_co_simulation_answers_a_step_exactly(reduction: str, run: Callable[[ModalBasis], Master]) -> None:
    """The same at every step length, a thirtieth of the lowest period or ten of them, to rounding."""
    basis = body(reduction=reduction)
    g, one = in_modes(basis.groups[0, 0]), run(basis)
    load = (
        3.0 * g.interfaces["right"].rows[1] - 0.2 * g.interfaces["left"].rows[3] + 5.0 * g.excitations["shaker"].rows[0]
    )
    force = {"interface.right.u_t1.force": 3.0, "interface.left.phi_n.force": -0.2, "excitation.shaker.force": 5.0}
    period, t = 2 * np.pi / g.omega[0], 0.0
    one.set(force)
    for h in (period / 30, 0.37 * period, 10 * period, 0.0, period / 1000):
        one.step(t, h)
        t += h
    q, v = step_response(g, load, t)
    rounding = 1e-12 * np.abs(step_response(g, load, period / 3)[0] * g.omega).max()  # in the norm of omega q, q'
    np.testing.assert_allclose(
        one.state() * np.r_[g.omega, np.ones_like(v)], np.r_[g.omega * q, v], atol=rounding, rtol=0
    )
    probe, face = g.monitors["tip-probe"].rows[0], g.interfaces["right"].rows[5]
    names = (
        "monitor.tip_probe.u_x.displacement",
        "monitor.tip_probe.u_x.velocity",
        "interface.right.phi_t2.displacement",
    )
    wanted = [probe @ q, probe @ v, face @ q]
    np.testing.assert_allclose(one.get(*names, "gauge.root.strain"), [*wanted, g.gauges["root"].rows[0] @ q], rtol=1e-7)


@LINUX
def test_the_answer_goes_to_the_static_one(run: Callable[[ModalBasis], Master]) -> None:
    """With much damping (2 D omega q' through D = 0.7 of all modes): the compliance of the modal file, in m/N."""
    basis = body(reduction="craig-bampton")
    c, one = basis.groups[0, 0].compliance, run(basis)
    one.set({f"modal.damping_ratio[{j + 1}]": 0.7 for j in range(one.modes)} | {"interface.left.u_n.force": 2.0})
    one.step(0.0, 60 * 2 * np.pi / basis.groups[0, 0].omega[0])
    rows = [f"interface:{n}" for n in ("left:u_n", "right:u_n", "right:phi_t1")] + ["monitor:tip-probe:u_y"]
    found = one.get(*(f"{r.replace(':', '.').replace('-', '_')}.displacement" for r in rows))
    at = [c.labels.index(r) for r in rows]
    wanted = 2.0 * c.static[at, c.labels.index("interface:left:u_n")]
    np.testing.assert_allclose(found[:3], wanted[:3], rtol=1e-8)
    modal = 2.0 * c.modal[at[3], c.labels.index("interface:left:u_n")]
    assert found[3] == pytest.approx(modal, rel=1e-8)


@LINUX
def test_forces_that_grow_evenly_are_exact_too(run: Callable[[ModalBasis], Master]) -> None:
    """A ramp in one step, by the response to a step integrated, and the same in parts; a held one is not."""
    basis = plain()
    g, one = basis.groups[0, 0], run(basis)
    load, T = 1e5 * g.interfaces["right"].rows[0], 1.3 * 2 * np.pi / g.omega[0]
    D, w = g.damping_ratio, g.omega
    q_step, v_step = step_response(g, load, T)  # v of a ramp is q of a step; q from the equation of motion
    wanted = (load * T - v_step - 2 * D * w * q_step) / w**2, q_step
    for parts in (1, 7):
        one.call("Reset")
        for i in range(parts):
            one.set({"interface.right.u_n.force": 1e5 * i * T / parts})
            one.slope({"interface.right.u_n.force": 1e5})
            one.step(i * T / parts, T / parts)
        assert one.get("interface.right.u_n.force")[0] == pytest.approx(1e5 * T)
        np.testing.assert_allclose(one.state(), np.concatenate(wanted), rtol=1e-9)
    one.call("Reset")
    one.step(0.0, T)
    assert not one.state().any(), "no force is left of before"


@LINUX
@pytest.mark.parametrize("ratio", [0.0, 0.03])
def test_work_is_energy_and_what_damping_takes(ratio: float, run: Callable[[ModalBasis], Master]) -> None:
    """Over held steps f (u_1 - u_0) to rounding without damping; with it also the integral of q' C q' by Simpson."""
    basis = plain()
    g, one = basis.groups[0, 0], run(basis)
    C = 2 * ratio * np.sqrt(g.K_r)
    one.set({f"modal.damping_ratio[{j + 1}]": ratio for j in range(one.modes)})
    rng = np.random.default_rng(4)
    inputs = [n for n in one.at if n.startswith("interface.") and n.endswith("force")]
    read = [n.replace("force", "displacement") for n in inputs]

    def energy() -> float:
        q, v = np.split(one.state(), 2)
        return (v @ v + q @ g.K_r @ q) / 2

    def loss() -> float:
        v = one.state()[one.modes :]
        return v @ C @ v

    h, work, lost, largest = 2 * np.pi / g.omega[-1] / 40, 0.0, 0.0, 0.0
    for i in range(60):
        force = rng.normal(size=len(inputs)) * np.where(np.char.find(inputs, ".phi") > 0, 0.1, 10.0)
        one.set(dict(zip(inputs, force, strict=True)))
        before, power = one.get(*read), [loss()]
        for half in (0, 1):
            one.step((i + half / 2) * h, h / 2)
            power.append(loss())
        work += force @ (one.get(*read) - before)
        lost += h * (power[0] + 4 * power[1] + power[2]) / 6
        largest = max(largest, energy())
    assert abs(work - lost - energy()) < (1e-12 if ratio == 0 else 1e-5) * largest
    assert ratio == 0 or lost > 0.02 * largest, "damping must show"


@LINUX
def test_a_spinning_body_and_a_circulatory_one_are_stepped_as_their_matrices_say(
    run: Callable[[ModalBasis], Master],
) -> None:
    """Full C + G and K + N and a rigid motion: one exponential of the whole, by scipy."""
    basis = small.basis(free=True)
    g, rng = in_modes(basis.groups[0, 0]), np.random.default_rng(9)
    m = g.n_modes
    elastic = np.array([0.0, 900.0, 1000.0, 1300.0, 0.0, 4000.0])
    B, N, G = rng.normal(size=(3, m, m))
    g = replace(g, omega=elastic, K_r=np.diag(elastic**2), C_r=B @ B.T, G_r=50 * (G - G.T), N_r=1e4 * N)
    one = run(replace(basis, groups={(0, 0): g}, damping_source="matrix"))
    x0, h = rng.normal(size=2 * m), 0.011
    one.set({n: x for n, x in zip(one.at, x0, strict=False)})
    one.set({"interface.left.u_n.force": 40.0})
    load = 40.0 * g.interfaces["left"].rows[0]
    A = np.block([[np.zeros((m, m)), np.eye(m)], [-g.K_r - g.N_r, -g.C_r - g.G_r]])
    whole = np.block([[A, np.r_[np.zeros(m), load][:, None]], [np.zeros((1, 2 * m + 1))]])
    wanted = scipy.linalg.expm(h * whole)[:-1] @ np.r_[x0, 1.0]
    np.testing.assert_allclose(one.slopes(x0), A @ x0 + np.r_[np.zeros(m), load], rtol=1e-12)
    one.step(0.0, h)
    np.testing.assert_allclose(one.state(), wanted, rtol=0, atol=1e-11 * np.abs(wanted).max())


@LINUX
def test_model_exchange_converges_in_the_order_of_the_integrator(run: Callable[[ModalBasis], Master]) -> None:
    """Runge and Kutta's fourth order through GetDerivatives: errors fall by 16 as the step is halved."""
    basis = plain()
    g, one = basis.groups[0, 0], run(basis)
    one.set({"interface.right.u_n.force": 1.0})
    T, errors = 2 * np.pi / g.omega[0], []
    exact = np.concatenate(step_response(g, g.interfaces["right"].rows[0], T))
    scale = np.r_[g.omega, np.ones(one.modes)]
    for steps in (120, 240, 480):
        x, h = np.zeros(2 * one.modes), T / steps
        for _ in range(steps):
            k1 = one.slopes(x)
            k2 = one.slopes(x + h / 2 * k1)
            k3 = one.slopes(x + h / 2 * k2)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + one.slopes(x + h * k3))
        errors.append(np.linalg.norm((x - exact) * scale) / np.linalg.norm(exact * scale))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 4.0, atol=0.1)


@LINUX
def test_states_are_kept_taken_back_and_copied(run: Callable[[ModalBasis], Master]) -> None:
    one = run(plain())
    one.set({"interface.right.u_n.force": 1.0, "modal.q[2]": 1e-6})
    one.step(0.0, 1e-4)
    kept, size = ctypes.c_void_p(), ctypes.c_size_t()
    one.call("GetFMUstate", ctypes.byref(kept))
    one.call("SerializedFMUstateSize", kept, ctypes.byref(size))
    data = ctypes.create_string_buffer(size.value)
    one.call("SerializeFMUstate", kept, data, size)
    seen = one.state()
    one.step(1e-4, 1e-3)
    later = one.state()
    one.call("SetFMUstate", kept)
    np.testing.assert_array_equal(one.state(), seen)
    copy = ctypes.c_void_p()
    one.call("DeSerializeFMUstate", data, size, ctypes.byref(copy))
    one.call("SetFMUstate", copy)
    one.step(1e-4, 1e-3)
    np.testing.assert_array_equal(one.state(), later)
    for state in (kept, copy):
        one.call("FreeFMUstate", ctypes.byref(state))


@LINUX
def test_what_cannot_be_is_an_error_of_the_unit(run: Callable[[ModalBasis], Master]) -> None:
    one = run(plain())
    some, value = (ctypes.c_uint * 1)(), (ctypes.c_double * 1)(1.0)
    for name in ("modal.a[1]", "interface.right.u_n.displacement", "interface.right.u_n.velocity"):
        some[0] = one.at[name]
        one.call("SetReal", some, ctypes.c_size_t(1), value, returns=3)
    some[0] = len(one.at)
    one.call("GetReal", some, ctypes.c_size_t(1), value, returns=3)
    one.call("GetInteger", some, ctypes.c_size_t(1), (ctypes.c_int * 1)(), returns=3)
    one.call("GetDerivatives", value, ctypes.c_size_t(1), returns=3)
    one.step(0.0, 1e-4)
    before = one.state()
    for h in (-1e-3, np.nan, np.inf, 1e10, 1e300):  # the last ones would take years
        one.call("DoStep", ctypes.c_double(0.0), ctypes.c_double(h), 0, returns=3)
    assert np.array_equal(one.state(), before)


@LINUX
def test_a_logger_that_does_not_format_gets_the_whole_sentence(tmp_path: Path) -> None:
    said: list[str] = []
    logger = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, *[ctypes.c_char_p] * 2])(
        lambda *words: said.append(words[-1].decode())
    )
    writer("fmu")(plain(), tmp_path / "b.fmu")
    one = Master(tmp_path / "b.fmu", tmp_path / "b", logger)
    one.call("GetInteger", (ctypes.c_uint * 1)(), ctypes.c_size_t(1), (ctypes.c_int * 1)(), returns=3)
    assert said == ["every variable is a real one"]


@LINUX
def test_no_number_that_is_not_finite_enters_the_unit_by_any_door(run: Callable[[ModalBasis], Master]) -> None:
    """Nor does a force beyond all numbers leave one: the state stays what it was, and goes on."""
    one = run(plain())
    force, size = "interface.right.u_n.force", ctypes.c_size_t(1)
    assert force in one.at
    at, order = (ctypes.c_uint * 1)(one.at[force]), (ctypes.c_int * 1)(1)
    one.step(0.0, 1e-4)
    before = one.get("modal.q[1]", "modal.v[1]", force)
    for bad in (np.nan, np.inf, -np.inf):
        value, states = (ctypes.c_double * 1)(bad), (ctypes.c_double * (2 * one.modes))(bad)
        one.call("SetReal", at, size, value, returns=3)
        one.call("SetRealInputDerivatives", at, size, order, value, returns=3)
        one.call("SetContinuousStates", states, ctypes.c_size_t(2 * one.modes), returns=3)
        one.call("SetTime", ctypes.c_double(bad), returns=3)
        one.call("SetupExperiment", 0, ctypes.c_double(0.0), ctypes.c_double(bad), 0, ctypes.c_double(1.0), returns=3)
        one.call("DoStep", ctypes.c_double(bad), ctypes.c_double(1e-4), 0, returns=3)
        for known, tolerance, ends, stop in ((1, bad, 0, 1.0), (1, 1e-6, 1, bad)):
            words = known, ctypes.c_double(tolerance), ctypes.c_double(0.0), ends, ctypes.c_double(stop)
            one.call("SetupExperiment", *words, returns=3)
        one.call("SetupExperiment", 0, ctypes.c_double(bad), ctypes.c_double(0.0), 0, ctypes.c_double(bad))
    assert np.array_equal(before, one.get("modal.q[1]", "modal.v[1]", force))
    one.set({force: 1e308})
    one.call("DoStep", ctypes.c_double(1e-4), ctypes.c_double(0.1), 0, returns=3)
    one.set({force: 1.0})
    one.step(1e-4, 1e-4)
    assert np.isfinite(one.state()).all()


def test_the_description_tells_units_names_and_what_depends_on_what(tmp_path: Path) -> None:
    basis = replace(plain(), name="Läufer & <Sohn>\n1")
    g = basis.groups[0, 0]
    odd = {"1. Stufe/links": g.interfaces["right"], "1. Stufe links": g.interfaces["left"]}
    basis = replace(basis, groups={(0, 0): replace(g, interfaces=odd)})
    writer("fmu")(basis, tmp_path / "b.fmu")
    with zipfile.ZipFile(tmp_path / "b.fmu") as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
        source = archive.read("sources/body.c").decode("ascii")
        assert any(n.startswith("binaries/") for n in archive.namelist())
    variables = list(root.iter("ScalarVariable"))
    names = [v.get("name", "") for v in variables]
    assert len({*names}) == len(names) and all(re.fullmatch(r"[A-Za-z_][\w.]*(\[\d+\])?", n) for n in names)
    assert [int(v.get("valueReference", "")) for v in variables] == [*range(len(names))]
    assert "interface 1. Stufe/links, u_n" in {v.get("description") for v in variables}
    outputs = {int(u.get("index", "")): u.get("dependencies", "").split() for u in root.find("ModelStructure/Outputs")}
    inputs = {str(i + 1) for i, v in enumerate(variables) if v.get("causality") == "input"}
    assert [*outputs] == [i + 1 for i, v in enumerate(variables) if v.get("causality") == "output"]
    assert all(known and not inputs & {*known} for known in outputs.values()), "a force is not read at once"
    derivatives = [int(u.get("index", "")) for u in root.find("ModelStructure/Derivatives")]
    assert [variables[i - 1][0].get("derivative") for i in derivatives] == [str(i + 1) for i in range(2 * g.n_modes)]
    units = {v.get("name"): v[0].get("unit") for v in variables}
    assert units[names[4 * g.n_modes]] == "N" and units["gauge.root.strain_rate"] == "1/s"
    assert root.get("description", "").startswith("Läufer & <Sohn> 1 at 0 rpm")
    assert "SI units" in root.get("description", "") and "exact solution to rounding" in source


def test_the_source_compiles_without_a_warning(tmp_path: Path) -> None:
    """By whoever gets it, in standard C."""
    writer("fmu")(plain(), tmp_path / "b.fmu")
    with zipfile.ZipFile(tmp_path / "b.fmu") as archive:
        archive.extractall(tmp_path)
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wno-unused-parameter", "-Werror", "-fsyntax-only"]
    done = subprocess.run(["cc", *flags, "body.c"], cwd=tmp_path / "sources", capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@contextmanager
def environment(monkeypatch: pytest.MonkeyPatch, **variables: str) -> Iterator[None]:
    with monkeypatch.context() as patched:
        for name, value in variables.items():
            patched.setenv(name, value)
        yield


def test_what_cannot_become_a_unit_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    basis = plain()
    g = basis.groups[0, 0]
    bare = replace(basis, groups={(0, 0): replace(g, interfaces={}, excitations={})})
    refused("nothing to act on", writer("fmu"), bare, tmp_path / "x.fmu")
    with (
        environment(monkeypatch, CC="no-such-compiler -O2"),
        pytest.raises(UserError, match="no C compiler no-such-co"),
    ):
        writer("fmu")(basis, tmp_path / "x.fmu")
    for compiler in ("false", "true"):  # fails; does nothing
        with environment(monkeypatch, CC=compiler), pytest.raises(UserError, match=f"C compiler {compiler} fails"):
            writer("fmu")(basis, tmp_path / "x.fmu")
    with environment(monkeypatch, CC='gcc "'), pytest.raises(UserError, match="see to CC"):
        writer("fmu")(basis, tmp_path / "x.fmu")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "nowhere"))
    refused("TMPDIR", writer("fmu"), basis, tmp_path / "x.fmu")
    assert not any(tmp_path.iterdir())


def test_modes_that_a_simulator_cannot_follow_are_told() -> None:
    """Outputs a fortieth of the longest period apart: 20 periods of the highest mode are 800 times as fast."""
    basis = plain()
    g = basis.groups[0, 0]
    for ratio, count in ((799, 0), (801, 1)):
        omega = np.append(g.omega[:-1], ratio * g.omega[0])
        given = replace(basis, groups={(0, 0): replace(g, omega=omega, K_r=np.diag(omega**2))})
        told = formats()["fmu"].warnings(given)
        assert len(told) == count and all(f"{omega[-1] / (2e3 * np.pi):.4g} kHz" in t for t in told)
    assert not formats()["mat"].warnings(basis)


@needs("fmpy")
@pytest.mark.slow
def test_fmpy_takes_the_unit_and_steps_it(tmp_path: Path) -> None:
    """Valid; by FMPy's CVode and in its co-simulation the closed form; the source agrees with the standard's header."""
    basis = body(reduction="craig-bampton")
    g = in_modes(basis.groups[0, 0])
    writer("fmu")(basis, tmp_path / "b.fmu")
    ask("fmpy", "fmpy_step.py", tmp_path / "b.fmu", tmp_path / "out.npz")
    found = np.load(tmp_path / "out.npz")
    assert not len(found["problems"]), found["problems"]
    T = g.monitors["tip-probe"].rows[0]
    for way, tolerance in (("ModelExchange", 2e-5), ("CoSimulation", 1e-9)):
        t, u, v = found[way].T
        assert t[0] == 0 and len(t) > 100
        wanted = np.array([[T @ x for x in step_response(g, 4.0 * g.interfaces["right"].rows[0], s)] for s in t])
        np.testing.assert_allclose(u, wanted[:, 0], rtol=0, atol=tolerance * np.abs(wanted[:, 0]).max())
        np.testing.assert_allclose(v, wanted[:, 1], rtol=0, atol=tolerance * np.abs(wanted[:, 1]).max())
