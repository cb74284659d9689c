"""Small systems by hand against closed forms, against direct solutions of M x'' + C x' + K x = f, and their file."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from box import edit
from closed_forms.one_harmonic import JenkinsContact, frequency_response, stuck_frequencies
from refusals import refused, refused_command

from microslip.basis import check_basis, read_basis, write_basis
from microslip.cli import main
from microslip.errors import UserError
from microslip.system import Body, Contact, Damper, Force, Monitor, Spring, System, load_system, system_basis

pytestmark = pytest.mark.usefixtures("undrawn", "unjudged")

ROOT = Path(__file__).resolve().parents[1]
THREE = (ROOT / "pipeline/microslip/templates/three-masses/system.toml").read_text(encoding="utf-8")


def chain(ratio: float = 0.01, dampers: bool = True) -> System:
    names = ["m1", "m2", "m3"]
    return System(
        "chain",
        [Body(n, 2.0, (float(i), 0, 0), free="x") for i, n in enumerate(names)],
        [Spring(a, b, 5e3) for a, b in zip(["ground", *names], names, strict=False)]
        + ([Damper("m1", "m2", 0.7)] if dampers else []),
        [Contact("rub", "m3", normal=(0, 0, 1))],
        [Force("shaker", "m1", (1, 0, 0))],
        [Monitor("end", "m3")],
        ratio=ratio,
    )


def failed(system: System) -> list[str]:
    return [c.name for c in check_basis(system.basis()) if not c.passed]


def test_chain_of_masses() -> None:
    """omega_j = 2 sqrt(k/m) sin((2j - 1) pi / (2 (2n + 1))) of a fixed-free chain."""
    g = chain().basis().groups[0, 0]
    expected = 2 * np.sqrt(5e3 / 2) * np.sin((2 * np.arange(1, 4) - 1) * np.pi / 14)
    np.testing.assert_allclose(g.omega, expected, rtol=1e-12)
    assert failed(chain()) == []


def test_rigid_bar_on_two_springs() -> None:
    """Heave 2k/m, pitch 2k (L/2)^2 / J: the springs act at the ends, off the centre of mass."""
    k, m, J, half = 3e4, 4.0, 0.2, 0.3
    bar = Body("bar", m, (0.1, 0.2, 0.3), inertia=(0.1, J, 0.1), free="z ry")
    ends = [(0.1 + s * half, 0.2, 0.3) for s in (-1, 1)]
    system = System("bar", [bar], [Spring("ground", "bar", k, axis=(0, 0, 1), at=e) for e in ends])
    np.testing.assert_allclose(
        np.sort(system.basis().groups[0, 0].omega ** 2), np.sort([2 * k / m, 2 * k * half**2 / J]), rtol=1e-12
    )


def test_two_free_bodies_keep_their_rigid_motions() -> None:
    """Twelve coordinates, one line spring: omega^2 = k (1/m1 + 1/m2) and eleven motions without stiffness."""
    J = (0.1, 0.2, 0.3)
    system = System("pair", [Body("a", 2.0, (0, 0, 0), J), Body("b", 3.0, (0, 0, 1.0), J)], [Spring("a", "b", 1e5)])
    basis = system.basis()
    g = basis.groups[0, 0]
    assert g.kind == ("rigid",) * 11 + ("normal",) and basis.free
    assert g.omega[-1] ** 2 == pytest.approx(1e5 * (1 / 2 + 1 / 3), rel=1e-12)
    assert basis.mass == 5.0
    np.testing.assert_allclose(basis.centre, [0, 0, 0.6], rtol=1e-15)
    reduced = 2 * 3 / 5
    np.testing.assert_allclose(np.diag(basis.inertia), [0.2 + reduced, 0.4 + reduced, 0.6], rtol=1e-12)
    assert failed(system) == []


def test_rows_of_a_contact_off_the_centre() -> None:
    """u(P) = u + phi x (P - c), in the contact's own frame."""
    body = Body("a", 1.0, (1.0, 0, 0), inertia=(1, 1, 1))
    system = System("one", [body], [Spring("ground", "a", (1, 1, 1, 1, 1, 1))], [Contact("c", "a", (1, 0, 0))])
    rows, point = system.rows_at("a", (1.0, 2.0, 0.0), "")
    np.testing.assert_allclose(rows[:3, 3:], [[0, 0, -2], [0, 0, 0], [2, 0, 0]])  # phi_z moves it along -x
    R = system.contacts[0].rotation
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(R) == pytest.approx(1)
    g = system.basis().groups[0, 0]
    T = g.interfaces["c"].rows
    np.testing.assert_allclose(T @ T.T, np.eye(6), atol=1e-12)  # M = 1: all six rows of a unit body


def direct(system: System, frequency: np.ndarray, k: float = 0.0) -> np.ndarray:
    """The last coordinate under a unit force on the first one, by (K + i w C - w^2 M)^-1; k: ground spring there."""
    M, C, K = system.matrices()
    X, omega = scipy.linalg.eigh(K, M)[1], np.sqrt(scipy.linalg.eigh(K, M)[0])
    C = C + M @ X @ np.diag(2 * system.ratio * omega) @ X.T @ M
    K = K.copy()
    K[-1, -1] += k
    w = 2 * np.pi * frequency
    return np.array([np.linalg.solve(K + 1j * v * C - v**2 * M, np.eye(len(M))[:, 0])[-1] for v in w])


def test_linear_response_is_that_of_the_matrices() -> None:
    """Dampers couple the modes: C_r is full, and the response exact all the same."""
    basis = chain().basis()
    g, f = basis.groups[0, 0], np.linspace(1, 20, 37)
    assert np.abs(g.C_r - np.diag(np.diag(g.C_r))).max() > 0.01
    found = frequency_response(g, [], g.excitations["shaker"].rows[0], g.monitors["end"].rows[0], f)
    np.testing.assert_allclose(found.monitor, direct(chain(), f), rtol=1e-10)


def test_jenkins_element_between_free_and_stuck() -> None:
    """Far below its limit a spring; with no limit nothing; between, the loop it draws loses 4 limit (a - limit/k)."""
    g, f, k = chain().basis().groups[0, 0], np.linspace(2, 12, 41), 4e3
    force, read = g.excitations["shaker"].rows[0], g.monitors["end"].rows[0]

    def rub(limit: float) -> JenkinsContact:
        return JenkinsContact("rub", np.zeros(6), 1, k, limit)

    stuck = frequency_response(g, [rub(1e9)], force, read, f)
    np.testing.assert_allclose(stuck.monitor, direct(chain(), f, k), rtol=1e-9)
    loose = frequency_response(g, [rub(1e-12)], force, read, f)
    np.testing.assert_allclose(loose.monitor, direct(chain(), f), rtol=1e-7)  # a limit of 1e-12 N against 1 N
    M, _, K = chain().matrices()
    K[-1, -1] += k
    expected = np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True)) / (2 * np.pi)
    np.testing.assert_allclose(stuck_frequencies(g, [rub(1.0)]), expected, rtol=1e-12)
    slides = frequency_response(g, [rub(0.5)], force, read, f)
    a = np.abs(slides.contact[:, 1])
    assert slides.converged.all() and (a > 0.5 / k).any()
    loop = np.where(a > 0.5 / k, 4 * 0.5 * (a - 0.5 / k), 0.0)
    np.testing.assert_allclose(slides.dissipated, loop, rtol=1e-9, atol=1e-15)


def test_matrices_and_members_give_the_same_modes() -> None:
    M, C, K = chain().matrices()
    more = {"contacts": [Contact("rub", "3", normal=(0, 0, 1))], "ratio": 0.01}
    a, b = chain().basis(), System.of_matrices("chain", M, K, C, **more).basis()
    g, h = a.groups[0, 0], b.groups[0, 0]
    np.testing.assert_allclose(h.omega, g.omega, rtol=1e-13)
    np.testing.assert_allclose(h.phi, g.phi, atol=1e-13)
    np.testing.assert_allclose(h.C_r, g.C_r, atol=1e-13)
    assert b.mass == pytest.approx(6.0, rel=1e-15)
    np.testing.assert_allclose(b.inertia, a.inertia, rtol=1e-15)


def test_signs_and_files_are_definite(tmp_path: Path) -> None:
    """The contact's rows rule; a mode that does not move it is ruled by the displacements; same bytes again."""
    g = chain().basis().groups[0, 0]
    assert (g.interfaces["rub"].rows[1] > 0).all()
    for name in ("a.h5", "b.h5"):
        write_basis(tmp_path / name, chain().basis())
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    assert read_basis(tmp_path / "a.h5").source == "matrices"


# ---------------------------------------------------------------- the file


def test_the_template_is_the_same_system(tmp_path: Path) -> None:
    (tmp_path / "system.toml").write_text(THREE)
    masses = [Body(f"m{i}", 1.0, (float(i), 0, 0), free="x") for i in (1, 2, 3)]
    springs = [Spring(a, b, 1e4) for a, b in (("ground", "m1"), ("m1", "m2"), ("m2", "m3"))]
    rub = Contact("rub", "m3", (0, 0, -1), (0, 1, 0))
    by_hand = System("three-masses", masses, [*springs, Damper("m1", "m2", 0.2)], [rub], ratio=0.005).basis()
    g, h = by_hand.groups[0, 0], system_basis(tmp_path / "system.toml").groups[0, 0]
    for key in ("omega", "C_r", "phi"):
        np.testing.assert_array_equal(getattr(g, key), getattr(h, key))
    np.testing.assert_array_equal(g.interfaces["rub"].rows, h.interfaces["rub"].rows)
    np.testing.assert_allclose(g.interfaces["rub"].rotation[1], [-1, 0, 0], atol=1e-15)


def test_matrices_in_a_file(tmp_path: Path) -> None:
    path = tmp_path / "system.toml"
    path.write_text(
        'name = "two"\n[matrices]\nmass = [[2, 0], [0, 2]]\nstiffness = [[3e3, -1e3], [-1e3, 3e3]]\n'
        '[[monitors]]\nname = "end"\non = "2"\n'
    )
    np.testing.assert_allclose(system_basis(path).groups[0, 0].omega ** 2, [1e3, 2e3], rtol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('free = "x"', 'free = "q"', "no list of directions"),
        ('free = "x"', 'free = "rx"', "does not turn"),
        ("mass = 1.0", "mass = 0.0", "no mass"),
        ("stiffness = 1e4", "stiffness = -1e4", "not negative"),
        ("stiffness = 1e4", "stiffness = [1.0, 2.0]", "one, three or six"),
        ('"m2", "m3"', '"m2", "m7"', "no component 'm7'"),
        ('on = "m3"', 'on = "m4"', "no component 'm4'"),
        ("[0.0, 1.0, 0.0]", "[0.0, 0.0, 1.0]", "parallel to the normal"),
        ('name = "m2"', 'name = "m1"', "masses: the name 'm1'"),
        ('name = "m2"', 'name = "m2"\nwheight = 2', "wheight"),
        ("damping_ratio = 0.005", "damping_ratio = true", "damping_ratio"),
        ("damping_ratio = 0.005", "[matrices]\nmass = [[1.0]]\nstiffness = [[1.0]]", "free to move in 3 directions"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = tmp_path / "system.toml"
    path.write_text(THREE.replace(old, new, 1))
    refused((words, str(path)), system_basis, path)


@pytest.mark.parametrize(
    ("key", "entry"),
    [
        ("contacts", 'name = "rub"\non = "m1"\nnormal = [0.0, 1.0, 0.0]'),
        ("forces", 'name = "shaker"\non = "m2"\ndirection = [1.0, 0.0, 0.0]'),
        ("monitors", 'name = "end"\non = "m1"'),
        ("bodies", 'name = "m2"\nmass = 1.0\ninertia = [1.0, 1.0, 1.0]'),
    ],
)
def test_a_name_used_twice_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], key: str, entry: str
) -> None:
    """The second entry would take the place of the first: exit code 2, file, key and name told, nothing written."""
    monkeypatch.chdir(tmp_path)
    name = entry.split('"')[1]
    assert f'name = "{name}"' in THREE
    Path("system.toml").write_text(f"{THREE}\n[[{key}]]\n{entry}\n")
    refused_command(["run", "system.toml", "--quiet"], capsys, f"system.toml: {key}: ", f"'{name}'")
    assert not Path("build").exists()
    more = Monitor("end", "m1"), Force("shaker", "m2", (1, 0, 0)), Contact("rub", "m1", normal=(0, 0, 1))
    keys = ("monitors", "forces", "contacts")
    for kind, twice in zip(keys, more, strict=True):
        system = replace(chain(), **{kind: [*getattr(chain(), kind), twice]})
        with pytest.raises(UserError, match=f"chain: {kind}: .*'{twice.name}'"):
            system.basis()


def test_matrices_that_no_system_has() -> None:
    for M, K, words in (
        (np.eye(2), [[1.0, 2], [3, 4]], "not symmetric"),
        (np.eye(2), [[1.0, 2], [2, 1]], "not positive"),
        (np.diag([1.0, 0]), np.eye(2), "no mass"),
        (np.eye(2), np.full((2, 2), np.nan), "not finite"),
        (np.eye(2), "abc", "lists of 2 numbers"),
    ):
        refused(words, System.of_matrices("s", M, K).basis)
    with pytest.raises(UserError, match="no spring holds"):
        System("s", [Body("a", 1.0, free="x")], [Damper("ground", "a", 1.0)]).basis()
    refused("Give its axis", System("s", [Body("a", 1.0)], [Spring("ground", "a", 1.0)]).basis)


def test_a_point_contact_has_the_extents_of_its_case(tmp_path: Path) -> None:
    """A rigid body on one patch of the case's size: its rotations are held by k b0^2 / 12 (Sextro Eq. (5.2-41))."""
    from microslip.case import load_case, run_case

    body = Body("hub", 2.0, inertia=(0.1, 0.2, 0.3))
    soft = Spring("ground", "hub", (1.0,) * 6)
    system = System("hub", [body], [soft], [Contact("pad", "hub", (0, 0, 1), (0, 1, 0))],
                    [Force("push", "hub", (1, 0, 0))], [Monitor("read", "hub")])  # fmt: skip
    (tmp_path / "case.toml").write_text(
        'name = "hub"\nbody = "hub"\nexcitation = "push"\nmonitor = "read"\nharmonics = 1\nsamples = 24\n[[contacts]]\n'
        'interface = "pad"\nlaw = "jenkins"\n'
        "normal_stiffness = 1e6\ntangential_stiffness = 4e5\nwidth = 0.3\nheight = 0.6\nfriction = 0.2\n"
        "[sweep]\nstart = 1.0\nstop = 9.0\npoints = 3\nnormal_forces = [1e6]\n"
    )
    stuck = run_case(load_case(tmp_path / "case.toml")[0], system.basis()).stuck
    kn, kt, b2, h2 = 1e6, 4e5, 0.3**2 / 12, 0.6**2 / 12
    held = [(kt + 1) / 2, (kt + 1) / 2, (kn + 1) / 2]  # x = t1, y = t2, z = n
    held += [(kn * h2 + 1) / 0.1, (kn * b2 + 1) / 0.2, (kt * (b2 + h2) + 1) / 0.3]
    np.testing.assert_allclose((2 * np.pi * stuck) ** 2, np.sort(held), rtol=1e-9)


# ---------------------------------------------------------------- the command line


def test_from_init_to_the_response(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["init", "three-masses"]) == 0
    case = tmp_path / "three-masses" / "case.toml"
    edit(case, "points = 141", "points = 9")
    edit(case, "[2.0, 10.0, 30.0, 1000.0]", "[2.0, 1000.0]")
    assert main(["run", "three-masses", "-q"]) == 0
    summary = json.loads((tmp_path / "build" / "three-masses" / "response.json").read_text())
    assert summary["failed_points"] == 0
    stuck = summary["stuck_frequencies_Hz"]
    M, _, K = load_system("three-masses/system.toml").matrices()
    K[-1, -1] += 5e3
    np.testing.assert_allclose(stuck, np.sqrt(np.linalg.eigvalsh(K)) / (2 * np.pi), rtol=1e-10)
    assert M.tolist() == np.eye(3).tolist()
    assert main(["respond", "three-masses", "build/three-masses/basis.h5", "-q"]) == 0
    assert main(["check", "build/three-masses/basis.h5", "-q"]) == 0
    assert main(["info", "build/three-masses/basis.h5"]) == 0
    assert main(["modes", "three-masses", "--set", "masses.m1.mass=-1", "-q"]) == 2
    case.write_text(case.read_text().replace('body = "three-masses"', 'body = "four"'))
    assert main(["respond", "three-masses", "build/three-masses/basis.h5", "-q"]) == 2


def test_a_folder_with_a_case_alone_is_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    """It complained of a body.toml that nobody meant; what needs a body says that it is a case."""
    monkeypatch.chdir(tmp_path)
    assert main(["init", "three-masses"]) == 0
    (tmp_path / "mine").mkdir()
    write_basis(tmp_path / "mine" / "masses.h5", system_basis(tmp_path / "three-masses" / "system.toml"))
    case = tmp_path / "mine" / "case.toml"
    case.write_text((tmp_path / "three-masses" / "case.toml").read_text())
    edit(case, "points = 141", "points = 5")
    edit(case, "[2.0, 10.0, 30.0, 1000.0]", "[2.0]")
    edit(case, 'name = "three-masses"', 'name = "mine"')
    edit(case, 'body = "three-masses"\n', "")
    case.write_text(case.read_text() + '[[bodies]]\nname = "masses"\nfile = "masses.h5"\n')
    assert main(["run", "mine", "-q"]) == 0
    assert (tmp_path / "build" / "mine" / "response.csv").is_file()
    refused_command(["modes", "mine"], capsys, "microslip run mine")


def test_a_read_out_that_nothing_moves_and_a_case_without_contacts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The masses slide along x: along y there is rounding, and no resonances of it. Without contacts the resonances are
    those of the body; a damping ratio in percent is refused."""
    monkeypatch.chdir(tmp_path)
    assert main(["init", "three-masses"]) == 0 and main(["modes", "three-masses", "-q"]) == 0
    summary = tmp_path / "build" / "three-masses" / "response.json"
    few = ["--set", "sweep.points=5", "-q"]
    for forces in ("[2.0]", "[0.0]"):
        more = ["--set", f"sweep.normal_forces={forces}", "--set", 'direction="y"']
        assert main(["respond", "three-masses", *more, *few]) == 0
        found = json.loads(summary.read_text())
        assert found["resonances"] == [] and found["rising_at_the_edge"] == []
        assert any("does not move" in message for message in found["messages"])
    assert main(["respond", "three-masses", "--set", "contacts=[]", *few]) == 0
    omega = np.sqrt(scipy.linalg.eigvalsh(*reversed(load_system("three-masses/system.toml").matrices()[::2])))
    tops = {round(one["frequency_Hz"], 3) for one in json.loads(summary.read_text())["resonances"]}
    np.testing.assert_allclose(sorted(tops), omega / (2 * np.pi), rtol=1e-3)
    assert main(["respond", "three-masses", "--set", "damping_ratio=1.5", *few]) == 2


# nonsense given in Python --------------------------------------------------------------------------------------------

LIMIT = np.array([0.3])


def rubbed(g=None, law=None, **changed):
    """The chain whose end rubs on the ground, under 2 N on its first mass."""
    pytest.importorskip("jax")
    from microslip.contact.patch import Patch
    from microslip.contact.sliders import jenkins
    from microslip.system.assembly import Assembly, ContactFace, Load, Output, preloaded_contact
    from microslip.system.component import Component

    g = g or chain().basis().groups[0, 0]
    patch = Patch("rub", np.zeros((1, 2)), np.ones(1), law or jenkins(2e3, 0.3, 1.0))
    parts = {
        "components": (Component("m", {0: g}),),
        "contacts": (preloaded_contact("rub", patch, ContactFace("m", "rub"), None, normal=1.0),),
        "loads": (Load("m", "shaker", 2.0),),
        "outputs": (Output("m", "end", "u_x"),),
    }
    if "amplitude" in changed:
        changed = {"loads": (Load("m", "shaker", changed["amplitude"]),)}
    for key in ("loads", "outputs"):
        if isinstance(name := changed.get(key), tuple) and isinstance(name[0], str):
            changed[key] = (replace(parts[key][0], **dict([name])),)
    return Assembly(**(parts | changed))


def swept(assembly=None, frequency=(5.0,), **more):
    from microslip.harmonic_balance import problem
    from microslip.harmonic_balance.response import harmonic_response

    return harmonic_response(problem.of(assembly or rubbed(), **more), np.array(frequency, dtype=float))


def one(mass=1.0, k=1.0, axis=None, normal=(0, 0, 1), direction=(1, 0, 0), inertia=None, at=(0, 0, 0), ratio=0.0):
    springs = [Spring("ground", "a", (k, k, k))] + ([Spring("ground", "a", k, axis=axis)] if axis else [])
    contacts, forces = [Contact("c", "a", normal)], [Force("f", "a", direction)]
    return System("s", [Body("a", mass, at, inertia)], springs, contacts, forces, ratio=ratio).basis()


def shaken(**changed):
    return swept(rubbed(**changed))


@pytest.mark.parametrize(
    ("what", "given", "key"),
    [
        *[(swept, {"frequency": f}, "frequency") for f in ([0.0], [-5.0], [5, np.nan])],
        (swept, {"frequency": []}, "frequency"),
        (swept, {"harmonics": 0}, "harmonics"),
        (swept, {"harmonics": -1}, "harmonics"),
        (swept, {"cycles": 0}, "cycles"),
        (swept, {"periodicity": np.nan}, "periodicity"),
        (swept, {"length": -1.0}, "length"),
        (shaken, {"amplitude": np.nan}, "amplitude"),
        (shaken, {"amplitude": complex(0, np.inf)}, "amplitude"),
        (shaken, {"components": ()}, "component"),
        (shaken, {"loads": ("component", "x")}, "x"),
        (shaken, {"loads": ("row", "x")}, "x"),
        (shaken, {"outputs": ("component", "x")}, "x"),
        (shaken, {"outputs": ("monitor", "x")}, "x"),
        *[(one, {key: bad}, key) for key in ("mass", "ratio") for bad in (np.nan, np.inf, -1.0)],
        (one, {"ratio": 5.0}, "ratio"),
        (one, {"k": np.inf}, "link"),
        (one, {"inertia": (np.nan, 1, 1)}, "inertia"),
        (one, {"at": (np.nan, 0, 0)}, "at"),
        *[
            (one, {key: v}, key)
            for key in ("axis", "normal", "direction")
            for v in ((0, 0, 0), (0, np.nan, 1), (0, 1e300, 0), (1e-300, 0, 0))
        ],
    ],
)
def test_nonsense_given_in_python_is_one_sentence(what, given, key) -> None:
    """It ended in a ZeroDivisionError, a LinAlgError, rows of zeros, or in an answer."""
    refused(key, what, **given)


def test_what_nothing_drives_stays_where_it_is() -> None:
    """It ended without an answer, the residual's rounding being infinite against a motion of zero."""
    found = shaken(amplitude=0.0)
    assert found.converged.all() and np.abs(found.monitor).max() < 1e-15


@pytest.mark.parametrize("by", [pytest.param("sweep", marks=pytest.mark.slow), "curve"])
def test_a_law_without_a_value_is_named(by) -> None:
    """Its force is not a number beyond 10 um of sliding, or its derivative is not: name of law and contact are told, by
    a sweep and by a curve, instead of a step that is too long."""
    pytest.importorskip("jax")
    import jax.numpy as jnp

    from microslip.contact.friction import Coulomb
    from microslip.contact.law import settings
    from microslip.contact.normal import Penalty
    from microslip.contact.point import PointContact
    from microslip.harmonic_balance import families, problem

    @settings
    class Broken(PointContact):
        def step(self, u, v, dt, state):
            force, after = super().step(u, v, dt, state)
            return jnp.where(jnp.abs(u[:, 1:2]) < 1e-5, force, jnp.nan), after

    @settings
    class Rooted(PointContact):
        def step(self, u, v, dt, state):
            force, after = super().step(u, v, dt, state)
            far = jnp.abs(u[:, 1:2]) - 1e-5
            return force + 0 * jnp.where(far > 0, jnp.sqrt(jnp.minimum(far, 0.0)), 0.0), after

    parts, few = (Penalty(1e5), Coulomb(0.3), 1e5), {"harmonics": 1, "samples": 8, "cycles": 2}
    if by == "sweep":
        found = swept(rubbed(law=Broken(*parts)), **few)
        assert not found.converged.any() and "Broken" in found.status[0] and "'rub'" in found.status[0]
    else:
        family = families.of_load(problem.of(rubbed(law=Rooted(*parts)), **few), 5.0, 1e-3, 1.0)
        status = families.followed(family).status
        assert "Rooted" in status and "'rub'" in status


def test_a_law_without_a_value_under_its_preload_is_named() -> None:
    """LAPACK's own complaint went to the screen."""
    pytest.importorskip("jax")
    import jax.numpy as jnp

    from microslip.contact.law import Law, settings

    @settings
    class Pressed(Law):
        def init(self, n):
            return jnp.zeros(n)

        def step(self, u, v, dt, state):
            return jnp.sqrt(-u * u - 1), state

    refused("Pressed", rubbed, law=Pressed())
