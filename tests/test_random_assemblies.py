"""Random assemblies of several bodies, through their files: the answer does not depend on how a case is written down.

It is compared in table, response file, summary and page, see `answers.differences`.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rings
from answers import Answer, Change, apart, changed_bits, differences, known, of_rows
from assemblies import Beams, Drawn, Y, draw, places, ring, turned
from attack import SAME, Case, attack, exchangeable, exchanged, later, opened, responded, shuffled, spoilt, toml
from meshes import body
from test_assembly_cyclic import FACES

from microslip.basis import write_basis
from microslip.data import Array
from microslip.frames import rotation
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance import solver
from microslip.harmonic_balance.solver import newton
from microslip.modal.compute import modal_basis
from microslip.stages import running

pytest.importorskip("matplotlib")

EQUAL = 1e-9
"""Share of the largest value of its kind: the same arithmetic in another order, begun at the same places, and ended at
a hundredth of the residual that is asked for, as rounding decides whether one step more is taken."""


def _to_the_end(at: Any, x: Array, tolerance: float = 1e-10, *given: Any, **more: Any) -> Any:
    return newton(at, x, 0.01 * tolerance, *given, **more)


@pytest.fixture(autouse=True)
def bare(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """Neither pictures nor estimated errors, which take as long as the answer, but where a test is named whole."""
    if "whole" not in request.node.name:
        drawn = "microslip.pictures.response.response_picture"
        monkeypatch.setattr(drawn, lambda *_, **__: None)
        monkeypatch.setattr("microslip.case.run._Run._judge", lambda *_: True)
    monkeypatch.setattr(solver, "newton", _to_the_end)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("drawn")


MILD = {"harmonics": 1, "samples": 24}
HARD = {"harmonics": 2, "samples": 32, "hard": 1.5, "rough": True}
made: dict[str, tuple[Drawn, Case, Answer]] = {}


def plain(place: Path, seed: int, kind: dict[str, Any]) -> tuple[Drawn, Case, Answer]:
    """An assembly as it is drawn, and its answer."""
    key = f"{seed}-{kind['harmonics']}"
    if key not in made:
        drawn = draw(seed, **kind)
        case = opened(drawn.written(place / key), root=place / key)
        made[key] = drawn, case, responded(case.copied(place / key / "plain"))
    return made[key]


def same(a: Answer, b: Answer, share: float, *change: Change) -> bool:
    """Whether two answers differ by at most a share in everything, and converge at all."""
    found = differences(a, b, *change)
    wrong = {name: f"{size:.1e}" for name, size in found.items() if not size <= share}
    assert not wrong and all(s.converged.mean() > 0.8 for s in a.response.series)
    return True


@pytest.mark.parametrize("seed", [0, 1])
def test_steps_by_relative_motions_are_those_of_the_sides(place: Path, seed: int) -> None:
    """Bodies in a row, between others and at its ends: the step of Newton's method from what contacts feel alone solves
    the system of all sides, whatever the derivatives of the forces are: 1e-9."""
    case = opened(draw(seed, hard=1.5).written(place / f"row-{seed}"), root=place / f"row-{seed}")
    p, rng = balance.of(case.built.pressed(20.0), form="sides", harmonics=2, samples=32), np.random.default_rng(seed)
    felt = [f[..., None] & np.ones(p.coefficients, dtype=bool) for f in p.felt]
    slopes = [1e4 * rng.normal(size=(*f.shape, *f.shape[1:])) * f[..., None, None] * f[:, None, None] for f in felt]
    J, right = p.at(2 * np.pi * 110.0).jacobian(slopes), rng.normal(size=p.size)
    step = J.apart.step(right.reshape(-1, p.count) * p.scale, J.slopes)
    assert len(p.alike) == 2
    assert J.dense() @ (step / p.scale).ravel() == pytest.approx(right, abs=1e-9)


one_or_several = pytest.mark.parametrize(
    "seed, kind", [(35, MILD), *(pytest.param(seed, HARD, marks=pytest.mark.slow) for seed in (3, 7, 12))]
)


@one_or_several
def test_order_and_the_side_that_is_named_first_say_nothing(place: Path, seed: int, kind: Any) -> None:
    """Contacts between two bodies from the other side; and bodies, contacts, loads and all read-outs but the first in
    another order."""
    _, case, answer = plain(place, seed, kind)
    which = exchangeable(case)
    assert len(which) == len(case.settings.components) - 1
    raw, change = exchanged(case, which[:: 1 + seed % 2])
    raw = shuffled(raw, np.random.default_rng(seed))
    assert [c["interface"] for c in raw["contacts"]] != [c["interface"] for c in case.raw["contacts"]]
    assert same(answer, responded(case.copied(place / f"other-{seed}", raw)), EQUAL, change)


# turned and mirrored -----------------------------------------------------------------------------------------------


def axes_of(places: dict[str, tuple[float, Array]], name: str) -> Array:
    """(3, 3) axes of a body's file to those of the case."""
    return rotation(Y, np.radians(places[name][0]))


def reading(Q: Array, before: Drawn, after: Drawn, monitor: str, direction: str) -> tuple[str, float]:
    """The direction that reads the same when all is turned by Q, and the sign."""
    name = monitor.partition(":")[0]
    found = axes_of(after.places, name).T @ Q @ axes_of(before.places, name)[:, "xyz".index(direction)]
    at = int(np.abs(found).argmax())
    return "xyz"[at], float(np.sign(found[at]))


def mirrored(Q: Array, name: str, values: Array) -> Array:
    """An array when all is turned by Q: a mirror leaves n and t2 of a contact, and turns t1 = t2 x n round."""
    if not name.startswith("contacts/") or values.ndim != 3 or np.linalg.det(Q) > 0:
        return values
    return values * np.array([1.0, -1, 1, -1, 1, -1])[:, None]


@one_or_several
def test_an_assembly_that_is_turned_or_mirrored(place: Path, seed: int, kind: Any) -> None:
    """By one of the 48 ways in which axes become axes, so that every read-out has its counterpart; the bodies in other
    axes of their own besides. The sense of a mode follows its first interface, and is not compared."""
    rng, (before, _, answer) = np.random.default_rng(seed), plain(place, seed, kind)
    Q = np.eye(3)[rng.permutation(3)] * rng.choice([-1.0, 1.0], 3)
    after = turned(before, Q, places(rng, before.systems))
    first = before.case["monitors"][0]
    if reading(Q, before, after, first["monitor"], first["direction"])[1] < 0:  # it is to keep its phase
        Q, after = -Q, turned(before, -Q, after.places)
    for m in after.case["monitors"]:
        m["direction"], _ = reading(Q, before, after, m["monitor"], m["direction"])

    def change(name: str, values: Array) -> tuple[str, Array]:
        kind, _, rest = name.partition("/")
        if kind != "monitors":
            return "" if kind == "bodies" else name, mirrored(Q, name, values)
        monitor, _, label = rest.rpartition("/")
        direction, sign = reading(Q, before, after, monitor, label[-1])
        return f"{kind}/{monitor}/u_{direction}", sign * values

    assert same(answer, answer_of(after, place / f"turned-{seed}"), EQUAL, change)


def answer_of(one: Drawn | Beams, folder: Path) -> Answer:
    case = opened(one.written(folder), root=folder)
    return responded(case.copied(folder / "copy"))


@pytest.mark.slow
@pytest.mark.parametrize("unit, sense", [("mm", 1.0), ("in", 1.0), ("in", -1.0)])
def test_meshes_that_are_turned_or_mirrored_and_in_other_units(place: Path, unit: str, sense: float) -> None:
    """Two beams under forces and a pressure field, their modes solved for anew, the contact from a file: 1e-6. A strain
    gauge is read first; of the monitors the three directions together are turned."""
    rng, plainly = np.random.default_rng(len(unit)), Beams()
    if "beams" not in made:
        made["beams"] = plainly, None, answer_of(plainly, place / "beams")  # type: ignore[assignment]
    Q = np.eye(3)
    if (unit, sense) != ("mm", 1.0):
        Q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        Q *= sense * np.linalg.det(Q)
    there = {n: (float(rng.uniform(-180, 180)), rng.normal(size=3)) for n in "ab"}
    one, other = made["beams"][2], answer_of(Beams(Q, there, unit), place / f"beams-{unit}-{sense}")

    def change(name: str, values: Array) -> tuple[str, Array]:
        return "" if name.startswith(("monitors", "bodies")) else name, mirrored(Q, name, values)

    assert same(one, other, SAME, change)
    a, b = (known(x.response.series[0], x) for x in (one, other))
    for n in "ab":
        x, y = (np.stack([v[f"monitors/{n}:tip/u_{d}"] for d in "xyz"]) for v in (a, b))
        felt = np.einsum("ij,jfh->ifh", axes_of(there, n).T @ Q, x)
        np.testing.assert_allclose(y, felt, rtol=0, atol=SAME * np.abs(x).max())
    assert one.response.series[0].arrays["contacts/a:right/slipping"].max() > 0.1


# rings ---------------------------------------------------------------------------------------------------------------


def all_round(one: Answer, order: int, blades: int, joined: bool) -> dict[str, Array]:
    """What a sector's answer says of all sectors, by the names of a full ring.

    Args:
        joined: of a cyclic body, whose rows are numbered instead of itself.
    """
    found: dict[str, Array] = {}
    for name, v in known(one.response.series[0], one, added=False).items():
        kind, _, rest = name.partition("/")
        for j in range(blades):
            lead = 2 * np.pi * order * j / blades
            at, _, last = rest.rpartition("/")
            if kind in ("monitors", "gauges"):
                body, _, row = at.rpartition(":")
                to = f"{row}@{j}" if joined else f"{body or 'blade'}_{j}:{row}"
                found[f"{kind}/{to}/{last}"] = v * np.exp(1j * lead * np.arange(v.shape[1]))
            elif kind == "contacts":
                found[f"{kind}/{at}_{j}/{last}"] = later(v, -lead) if v.ndim == 3 else v
            elif kind == "bodies" and not joined:
                found[f"{kind}/{at}_{j}/{last}"] = v * np.exp(1j * lead * np.arange(v.shape[1]))[:, None]
        if kind in ("supplied", "damped"):
            found[kind] = blades * v
    energies = {n: v for n, v in found.items() if "/dissipated" in n or "/lost" in n or "/by_slip" in n}
    return found | energies | {"frequency": known(one.response.series[0], one, added=False)["frequency"]}


def same_ring(case: Case, folder: Path, order: int, blades: int, joined: bool = False) -> Answer:
    """The full ring against its sector: every blade, contact, energy and resonance; the ring's answer."""
    raw = copy.deepcopy(case.raw)
    raw["ring"]["model"] = "full"
    one, full = responded(case.copied(folder / "sector")), responded(case.copied(folder / "full", raw))
    found = apart(all_round(one, order, blades, joined), known(full.response.series[0], full, added=False))
    told = [of_rows(a.summary["resonances"]) for a in (one, full)]
    for row in told[0]:  # of the ring perhaps more, between points that are added for its other waves
        found[f"resonance at {row[0]:g} Hz"] = np.abs(told[1] / row - 1).max(axis=1).min()
    assert len({f"{f:.9g}" for f in full.response.series[0].key}) == len(full.response.series[0].key)
    assert not {n: f"{d:.1e}" for n, d in found.items() if not d <= SAME}
    slipping = [v for n, v in one.response.series[0].arrays.items() if n.endswith("slipping")]
    assert full.response.series[0].converged.all() and np.max(slipping) > 0.05
    return full


BOOK = {"mode": "book", "harmonics": 1}
RINGS = {
    "5 blades, order 1": (1, 5, 1, BOOK, False),
    "8 blades, round with the rotor": (2, 8, -3, BOOK, False),
    "9 blades, above N/2, a damper": (3, 9, 13, BOOK, True),
    "7 blades, two harmonics": (4, 7, 2, {"harmonics": 2}, False),
}


@pytest.mark.parametrize("seed, blades, order, more, damper", [
    pytest.param(*one, id=name, marks=[] if name == "5 blades, order 1" else pytest.mark.slow)
    for name, one in RINGS.items()
])  # fmt: skip
def test_a_full_ring_answers_as_its_sector(
    place: Path, seed: int, blades: int, order: int, more: Any, damper: bool
) -> None:  # fmt: skip
    """1e-6: of the means and harmonics of every blade, the damper's too, each ring eliminated in its own way."""
    drawn = ring(seed, blades, order, damper=damper)
    drawn.case |= more
    folder = place / f"ring-{seed}"
    same_ring(opened(drawn.written(folder), root=folder), folder, order, blades)


@pytest.mark.slow
def test_cyclic_sectors_that_are_joined_to_a_full_ring(place: Path) -> None:
    """A bladed disc of finite elements with stress modes, through all of its products."""
    N, folder = 7, place / "disc"
    folder.mkdir()
    settings = body(
        name="disc", supports=[{"face": "bore"}], cyclic={"sectors": N}, modes={"count": 5}, reduction="rubin",
        rotation={"axis": [0.0, 1.0, 0.0], "speeds_rpm": [3000.0], "prestress": "none"}, interfaces=FACES,
        excitations=[{"name": "gas", "face": "front", "pressure": True}], damping={"ratio": 0.02},
        monitors=[{"name": "top", "point": [0.0, 0.0, 0.26]}], output={"gauss": False, "nodal_stress": True},
    )  # fmt: skip
    write_basis(folder / "basis.h5", modal_basis(rings.bladed_sector("hexahedron20", N, gap=0.0), settings))
    contact = {"interface": "right", "against": "left", "against_sector": 1, "law": "smooth", "points": [2, 2],
               "normal_stiffness": 2e7, "tangential_stiffness": 1e7, "friction": 0.1}  # fmt: skip
    raw = {
        "name": "disc", "body": settings.name, "harmonics": 2, "samples": 32, "ring": {"blades": N, "engine_order": 3},
        "excitations": [{"row": "gas", "amplitude": 3e3}, {"row": "gas", "amplitude": 1e3, "harmonic": 2}],
        "monitors": [{"monitor": "top", "direction": d} for d in "yx"], "contacts": [contact],
        "sweep": {"start": 600.0, "stop": 800.0, "points": 5, "normal_forces": [50.0]},
    }  # fmt: skip
    (folder / "case.toml").write_text(toml(raw))
    full = same_ring(opened(folder / "case.toml", root=folder), folder, 3, N, joined=True)
    assert not full.response.bodies and "stress" not in str(full.summary["resonances"])


# kept from an earlier run --------------------------------------------------------------------------------------------


def put(*keys: Any) -> Callable[[dict[str, Any]], None]:
    """Change an entry of a case: its keys, and the value."""
    *where, last, value = keys

    def change(raw: dict[str, Any]) -> None:
        for key in where:
            raw = raw[key]
        assert raw.get(last) != value
        raw[last] = value

    return change


def larger(*keys: Any) -> Callable[[dict[str, Any]], None]:
    """A number of a case by a hundredth."""
    *where, last = keys

    def change(raw: dict[str, Any]) -> None:
        for key in where:
            raw = raw[key]
        raw[last] *= 1.01

    return change


def pressed(at: int, **how: float) -> Callable[[dict[str, Any]], None]:
    """Press a contact in another way."""

    def change(raw: dict[str, Any]) -> None:
        left = {k: v for k, v in raw["contacts"][at].items() if k not in ("normal_force", "interference")}
        raw["contacts"][at] = left | how

    return change


CHANGES: dict[str, Callable[[dict[str, Any]], Any]] = {
    "friction": put("contacts", 0, "friction", 0.05),
    "normal stiffness": put("contacts", 0, "normal_stiffness", 9e5),
    "tangential stiffness": put("contacts", 1, "tangential_stiffness", 2e5),
    "roughness": lambda raw: raw["contacts"][0].update(law="rough", roughness=2e-5),
    "what it includes": put("contacts", 0, "includes", "bulk+surface"),
    "normal force": pressed(0, normal_force=11.0),
    "interference": pressed(1, interference=1e-5),
    "contacts in another order": lambda raw: raw["contacts"].reverse(),
    "normal forces": larger("sweep", "normal_forces", 0),
    "more normal forces": lambda raw: raw["sweep"]["normal_forces"].insert(0, 42.0),
    "start": larger("sweep", "start"),
    "stop": larger("sweep", "stop"),
    "points": put("sweep", "points", 4),
    "harmonics": put("harmonics", 2),
    "samples": put("samples", 32),
    "periodicity": put("periodicity", 1e-3),
    "mode": put("mode", "book"),
    "amplitude": larger("excitations", 0, "amplitude"),
    "phase": put("excitations", 0, "phase", 77.0),
    "load": put("excitations", 0, "row", "b:shake"),
    "direction": put("monitors", 0, "direction", "z"),
    "monitor": put("monitors", 0, "monitor", "b:eye"),
    "one more monitor": lambda raw: raw["monitors"].append({"monitor": "b:eye", "direction": "z"}),
    "damping": put("damping", "modal"),
    "damping ratio": put("damping_ratio", 0.1),
    "stuck damping": lambda raw: raw.update(damping="stuck", damping_ratio=0.03),
    "mass": put("bodies", 1, "mass", 0.7),
    "bodies in another order": lambda raw: raw["bodies"].reverse(),
    "description": put("description", "x"),
}


@pytest.mark.slow  # test_response_stage has another sweep that was run before
@pytest.mark.parametrize("what", CHANGES)
def test_another_case_that_was_run_before_leaves_no_trace(place: Path, what: str) -> None:
    """The same folder, a case that differs in one entry, and then the case itself: every bit of a fresh folder."""
    _, case, answer = plain(place, 35, MILD)
    raw = copy.deepcopy(case.raw)
    CHANGES[what](raw)
    bits = {*changed_bits(answer, responded(case.copied(place / "used", raw)))}
    assert (bits == {"json description", "h5 settings"}) == (what == "description")
    assert changed_bits(answer, responded(case.copied(place / "used"))) == []


CURVE = "displacement force\n0 0\n5 2\n15 12\n30 31\n60 73\n"  # um, N


@pytest.mark.slow
def test_files_that_are_replaced_and_put_back_leave_no_trace(place: Path) -> None:
    """A modal file, a contact.toml and the curve that it names, each changed, answered with, and put back."""
    drawn = draw(35, **MILD)
    own = {k: v for k, v in drawn.case["contacts"][1].items() if k in ("interface", "points", "normal_force")}
    drawn.case["contacts"][1] = own | {"file": "contact.toml"}
    path = drawn.written(place / "files")
    stiffness = {"kind": "curve", "file": "curve.txt", "tangential": 8e5, "includes": "surface"}
    friction = {"kind": "coulomb", "mu": 0.36}
    contact = {"name": "c", "stiffness": stiffness, "friction": friction}
    (place / "files" / "contact.toml").write_text(toml(contact))
    (place / "files" / "curve.txt").write_text(CURVE)
    case = opened(path, root=place / "files")
    folder = case.copied(place / "files" / "copy")
    answer = responded(folder)
    assert {"case.toml", "build/b/basis.h5", "contact.toml", "curve.txt"} < {*case.inputs}
    for name in case.inputs[1:]:
        held = spoilt(folder / name)
        assert "csv" in changed_bits(answer, responded(folder)), name
        (folder / name).write_bytes(held)
        assert changed_bits(answer, responded(folder)) == [], name


@pytest.mark.slow
def test_what_was_interrupted_leaves_no_trace(place: Path) -> None:
    """Another case that is left at its third point; the case itself left at its second one and resumed, 1e-9."""
    _, case, answer = plain(place, 35, MILD)
    raw = copy.deepcopy(case.raw) | {"damping_ratio": 0.1}
    for at, left in (("3", raw), ("2", case.raw)):

        def leave(text: str, at: str = at) -> None:
            if text.startswith(f"{at} of"):
                raise KeyboardInterrupt

        folder = case.copied(place / "left", left)
        with pytest.raises(KeyboardInterrupt):
            running.respond(folder / "case.toml", None, report=leave, root=folder)
    assert same(answer, responded(folder), EQUAL)


# all of it -----------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_an_attack_on_an_assembly(place: Path) -> None:
    """`attack`, with a process that is really ended; everything that it tries is tried."""
    found = dict(attack(draw(35, **MILD).written(place / "attacked"), root=place / "attacked"))
    files = [f"{name} changed and restored" for name in ("case.toml", "build/a/basis.h5", "build/b/basis.h5")]
    resumed = "interrupted with exit code 143 and resumed"
    assert [*found] == ["in another order", "sides of contacts exchanged: 1", resumed, *files]
    assert max(found.values()) <= EQUAL


@pytest.mark.slow
def test_a_whole_attack_on_a_shipped_case(tmp_path: Path) -> None:
    """With pictures and pages, as a person runs it."""
    path = Path(running.__file__).parents[1] / "templates" / "three-masses" / "case.toml"
    found = dict(attack(path, assignments=["sweep.points=15", "sweep.normal_forces=[2.0, 30.0]"], root=tmp_path))
    assert {"case.toml changed and restored", "basis.h5 changed and restored"} < {*found}
    assert max(found.values()) <= EQUAL
