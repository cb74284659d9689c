"""Contacts of a case file: node-wise and curved patches, faces that do not meet; every mistake is one sentence."""

from __future__ import annotations

import copy
import dataclasses
import shutil
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest
import small
from attack import toml
from refusals import refused, refused_command

from microslip.basis import write_basis
from microslip.case import CaseSettings, assemble, run_case
from microslip.case.assemble import build
from microslip.case.checkpoint import files_of, of_points
from microslip.case.contacts import memory_of
from microslip.case.curves import curves
from microslip.case.settings import case_model
from microslip.cli import main
from microslip.contact.curved import Line, foundation_of_line
from microslip.contact.patch import pressure
from microslip.contact.solids import Solid
from microslip.errors import UserError
from microslip.files import store
from microslip.harmonic_balance.forces import aft_bytes
from microslip.modal.compute import modal_basis
from microslip.settings.body import BodySettings, validate
from microslip.stages import checkpoint
from microslip.stages.modal import held_faces

pytestmark = pytest.mark.usefixtures("undrawn", "unjudged")

PATH = Path("case.toml")
HEIGHT, DEPTH = small.SIZE[2], small.SIZE[1]


def table(**contact: Any) -> dict[str, Any]:
    """A beam on the ground, its right face pressed."""
    return {
        "name": "pressed", "body": "small", "excitation": "shaker", "monitor": "tip-probe", "harmonics": 1,
        "samples": 16, "cycles": 20, "contacts": [{"interface": "right", "friction": 0.3} | contact],
        "sweep": {"start": 400.0, "stop": 440.0, "points": 2, "normal_forces": [200.0]},
    }  # fmt: skip


STIFF = {"normal_stiffness": 1e9, "tangential_stiffness": 8e8}
GIVEN = {"kind": "given", "normal": 1e9, "tangential": 8e8}


def made(raw: dict[str, Any], path: Path = PATH) -> CaseSettings:
    return validate(case_model(), copy.deepcopy(raw), path)


def two(second: dict[str, Any] | None = None, **contact: Any) -> dict[str, Any]:
    """Two beams side by side: the right face of one lies on the left face of the other."""
    raw = table(**{"interface": "a:right", "against": "b:left", **STIFF, **contact})
    del raw["body"]
    other = {"name": "b", "body": "small"} | (second or {"shift": [small.SIZE[0], 0, 0]})
    return raw | {
        "bodies": [{"name": "a", "body": "small"}, other], "excitation": "a:shaker", "monitor": "a:tip-probe"
    }  # fmt: skip


@pytest.mark.parametrize("reduction", ["eigenmodes", "rubin"])
def test_what_drives_a_held_place_is_refused_and_what_reads_there_is_told(reduction: str) -> None:
    """At the clamp a force moves nothing and a monitor reads nothing."""
    foot = [small.SIZE[0] / 2, small.SIZE[1] / 2, 0.0]
    held = {"name": "held", "point": foot, "direction": [1.0, 2.0, 0.0]}
    own = small.table(reduction=reduction, monitors=[{"name": "tip-probe", "point": foot}])
    own["excitations"].append(held)
    basis = modal_basis(small.beam(), BodySettings.model_validate(own))
    raw = table(**STIFF, includes="surface")
    drives = made(raw | {"excitation": "held"})
    refused("excitation: 'held' moves nothing", build, drives, {"small": basis})
    found = build(made(raw), {"small": basis})
    assert [m for m in found.messages if "Monitor 'tip-probe' reads no u_x: 'small' is held there" in m]
    sound = build(made(raw), {"small": small.basis()})
    assert not [m for m in sound.messages if "Monitor" in m]


def clamped_beside(part: float) -> dict[str, Any]:
    """The beam held on its right face, from the foot up to a part of its height."""
    mesh = small.beam()
    x, _, z = mesh.points.T
    sets = dict(mesh.point_sets) | {"clamped": np.flatnonzero((x > small.SIZE[0] - 1e-9) & (z < part * HEIGHT + 1e-9))}
    own = small.table(supports=[{"face": "clamped"}])
    return {"small": modal_basis(dataclasses.replace(mesh, point_sets=sets), BodySettings.model_validate(own))}


@pytest.mark.parametrize("raw", [table(**STIFF), two()], ids=["ground", "two"])
def test_a_contact_on_a_face_that_supports_hold_is_refused(raw: dict[str, Any]) -> None:
    """With the face and the reason; of a part that is held the share of the area is told."""
    whole = dict.fromkeys(["small", "a", "b"], clamped_beside(1.0)["small"])
    refused(("contacts", "the supports of 'small' hold the face"), build, made(raw), whole)
    some = build(made(raw), dict.fromkeys(["small", "a", "b"], clamped_beside(0.5)["small"]))
    assert [m for m in some.messages if "hold" in m and "% of the face 'right'" in m]
    free = build(made(raw), dict.fromkeys(["small", "a", "b"], small.basis()))
    assert not [m for m in free.messages if "of the face" in m]
    (said,) = held_faces(clamped_beside(1.0)["small"])
    assert said.startswith("interfaces.right: the supports hold its whole face")
    assert held_faces(clamped_beside(0.5)["small"]) == held_faces(small.basis()) == []


TWICE = table(**STIFF) | {"contacts": [{"interface": "right", "friction": 0.3} | STIFF] * 2}
BETWEEN = two() | {"contacts": two()["contacts"] + two(interface="b:right", against="a:right")["contacts"]}


def built(raw: dict[str, Any]) -> Any:
    settings = made(raw)
    return build(settings, {b.name: small.basis() for b in settings.components})


@pytest.mark.slow
@pytest.mark.parametrize("patch", ["nodal", "rigid"])
def test_a_beam_whose_patch_deforms_on_the_ground(patch: str, request: Any) -> None:
    """It converges, and says how many deformations there are."""
    if patch == "nodal":
        request.getfixturevalue("unestimated")
    result = run_case(made(table(**STIFF, patch=patch, law="smooth")), {"small": small.basis()})
    assert result.responses[200.0].converged.all()
    assert any("deformations of the bodies" in r for r in result.messages) == (patch == "nodal")


def test_patches_that_deform_between_two_beams() -> None:
    """Six rigid coordinates and at most the modes of both bodies; pressed by the normal force of the sweep."""
    found = built(two(patch="nodal"))
    contact = found.pressed(200.0).contacts[0]
    assert 6 < contact.patch.count <= 6 + 2 * 6
    p = pressure(contact.patch, contact.offset)
    assert p @ contact.patch.areas == pytest.approx(200.0, rel=1e-9)
    assert contact.first.rows is not None and contact.second is not None and contact.second.rows is not None


def test_a_held_face_is_refused_before_any_contact_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where it is that of the last contact: the others take seconds to compile."""
    raw = two()
    raw["contacts"] = [raw["contacts"][0], {"interface": "a:left", "friction": 0.2, **STIFF}]
    own = small.table(supports=[{"face": "clamped"}])
    mesh = small.beam()
    at = mesh.points[:, 0] < 1e-9
    mesh = dataclasses.replace(mesh, point_sets=dict(mesh.point_sets) | {"clamped": np.flatnonzero(at)})
    bases = {"a": modal_basis(mesh, BodySettings.model_validate(own)), "b": small.basis()}

    def made_too_early(*_: object) -> None:
        raise AssertionError("a contact was made")

    monkeypatch.setattr(assemble, "springs_of", made_too_early)
    with pytest.raises(UserError, match="hold the face 'left'"):
        build(made(raw), bases)


def test_faces_are_set_against_each_other_by_their_places() -> None:
    """The same frame for two beams side by side, and for both turned and moved alike; others do not meet."""
    plain = built(two()).assembly.contacts[0].second.frame
    np.testing.assert_allclose(plain, np.kron(np.eye(2), np.diag([-1.0, -1, 1])), rtol=0, atol=1e-12)
    raw = two()
    for b in raw["bodies"]:
        b["turn"] = 30.0
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    raw["bodies"][1]["shift"] = [c * small.SIZE[0], 0.0, -s * small.SIZE[0]]  # the axis of rotation is y
    np.testing.assert_allclose(built(raw).assembly.contacts[0].second.frame, plain, rtol=0, atol=1e-12)


RADIUS = 1000.0  # m: a line 17 mm wide on the face of 120 mm
PIN = {"curvature": [float("inf"), RADIUS], "young": 2.1e11}
CURVED = [pytest.param("approach", [2, 44], marks=pytest.mark.slow), ("exact", [3, 1])]


def test_a_curved_face_is_fitted_to_hertz() -> None:
    """The foundation of a line along t1 whose length and strip are the face's; springs shared out by area."""
    found = built(table(**PIN, points=[2, 60]))
    steel = Solid(2.1e11, 0.3)
    line = Line(steel, steel, RADIUS, DEPTH)
    k = foundation_of_line(line, 200.0, HEIGHT).stiffness
    assert found.springs[0][0] == pytest.approx(k * DEPTH * HEIGHT, rel=1e-12)
    assert found.springs[0][1] == pytest.approx(0.7 * found.springs[0][0], rel=1e-12)  # along the line: 1 - nu
    assert any("agrees with Hertz in approach at 200 N" in r for r in found.messages)
    contact = found.pressed(200.0).contacts[0]
    assert contact.offset[0] == pytest.approx(float(line.approach(200.0, HEIGHT)), rel=0.02)
    p = pressure(contact.patch, contact.offset)
    assert (p[np.abs(contact.patch.points[:, 1]) > 0.4 * HEIGHT] == 0).all()


@pytest.mark.usefixtures("unestimated")
@pytest.mark.parametrize("contact", [{}, pytest.param({"fit": "exact", "points": [5, 1]}, marks=pytest.mark.slow)])
def test_the_answer_under_one_force_knows_of_no_other(contact: dict[str, Any]) -> None:
    """A curved contact is fitted at the force that presses it: to the last bit the same, whatever forces stand beside
    it; nor do the points that are kept of it depend on them. Loads of 150 and 800 N give springs that differ."""
    raw = table(**PIN, **contact)
    found = {}
    for forces in ([150.0], [150.0, 800.0], [800.0, 150.0, 400.0]):
        raw["sweep"]["normal_forces"] = forces
        one = built(raw)
        found[len(forces)] = store.fingerprint(one.pressed(150.0).contacts), of_points(one)
    assert found[1] == found[2] == found[3]
    stiff = [contact.stiffness[0, 0] for n in (150.0, 800.0) for contact in one.pressed(n).contacts]
    assert stiff[1] > 1.02 * stiff[0]
    if "fit" not in contact:
        line = Line(Solid(2.1e11, 0.3), Solid(2.1e11, 0.3), RADIUS, DEPTH)
        k = foundation_of_line(line, 150.0, HEIGHT).stiffness * DEPTH * HEIGHT
        patch = one.pressed(150.0).contacts[0].patch
        assert float(patch.law.normal.normal.stiffness_0) * len(patch.points) == pytest.approx(k, rel=1e-12)


def test_no_force_fits_no_curve() -> None:
    """Nothing to fit at: 0 N among the forces, and a curve over the force, along which the law is one."""
    raw = table(**PIN)
    raw["sweep"]["normal_forces"] = [0.0, 200.0]
    refused("case.toml: contacts.right: fitted_at", built, raw)
    raw["sweep"]["normal_forces"] = [100.0, 200.0]
    over = "normal_force", lambda _: nullcontext(), lambda _: None
    refused("case.toml: contacts.right.fitted_at", curves, made(raw), {"small": small.basis()}, *over)


def test_jenkins_elements_of_a_file_are_those_of_the_case(tmp_path: Path) -> None:
    """Four elements that hold mu F_N of the case's force, which the file need not name; none on a nodal patch."""
    law = 'normal_stiffness = 1e9\ntangential_stiffness = 8e8\nfriction = 0.3\nlaw = "jenkins"\n'
    (tmp_path / "contact.toml").write_text(f'name = "c"\n{law}')
    raw, path, bases = table(file="contact.toml"), tmp_path / "case.toml", {"small": small.basis()}
    del raw["contacts"][0]["friction"]
    found = build(made(raw, path), bases).pressed(200.0).contacts[0].patch
    own = build(made(table(**STIFF, law="jenkins")), bases).pressed(200.0).contacts[0].patch
    assert len(found.points) == 4 and found.law == own.law
    raw["contacts"][0]["patch"] = "nodal"
    refused("contact.toml: patch: law = ", build, made(raw, path), bases)


CURVE = "0 0\n1 10\n2 30\n3 60\n4 100\n"


def test_points_depend_on_every_file_that_a_file_names(tmp_path: Path) -> None:
    """contact.toml names a curve: its force a hundred times larger is another contact, and another input."""
    contact = 'name = "c"\n[stiffness]\nkind = "curve"\nfile = "curve.txt"\ntangential = 1e7\n'
    (tmp_path / "contact.toml").write_text(f'{contact}[friction]\nkind = "coulomb"\nmu = 0.3\n')
    raw, path = table(file="contact.toml", points=[2, 2]), tmp_path / "case.toml"
    del raw["contacts"][0]["friction"]
    settings, found = made(raw, path), []
    for scale in (1, 100, 1):
        rows = (line.split() for line in CURVE.splitlines())
        (tmp_path / "curve.txt").write_text("".join(f"{u} {scale * float(f)}\n" for u, f in rows))
        files = checkpoint.hashes_of(files_of(settings))
        found.append((files, of_points(build(settings, {"small": small.basis()}))))
    assert len(found[0][0]) == 2 and found[0] == found[2]
    assert found[0][0] != found[1][0] and found[0][1] != found[1][1]


IWAN = {"kind": "iwan", "count": 5, "exponent": -0.5}
ROUGH = {"kind": "polynomial", "R_Z": 1e-5}
TABLES: dict[str, dict[str, Any]] = {
    "short stiffness": {**STIFF, "law": IWAN},
    "a coefficient": {"stiffness": {"kind": "given", "normal": 1e9, "tangential": [8e8, 7e8]}, "roughness": ROUGH},
    "heated": {
        "stiffness": {"kind": "layer", "young": 2e11, "poisson": 0.3, "thickness": 1e-3, "area": 1e-4},
        "friction": {"kind": "heated", "mu_0": 0.3}, "temperature": {"resistance": 1e-6, "limit": 900.0},
    },
    "a file of a table": {
        "stiffness": {"kind": "curve", "file": "curve.txt", "tangential": 1e7}, "law": "smooth",
    },
}  # fmt: skip


@pytest.mark.parametrize("tables", TABLES.values(), ids=list(TABLES))
def test_tables_in_a_case_are_those_of_a_file(tables: dict[str, Any], tmp_path: Path) -> None:
    """The same law to the last bit, and the files that it depends on are known."""
    (tmp_path / "curve.txt").write_text(CURVE)
    tables, path = {"friction": 0.3, **tables}, tmp_path / "case.toml"
    own = {k: v for k, v in tables.items() if k not in STIFF}
    stiffness = {"kind": "given", "normal": 1e9, "tangential": 8e8}
    (tmp_path / "contact.toml").write_text(toml({"name": "c", "stiffness": stiffness, **own}))
    laws, files = [], []
    for contact in (tables, {"file": "contact.toml"}):
        raw = table(points=[2, 2])
        only = {k: v for k, v in raw["contacts"][0].items() if k not in ("friction", "law", *STIFF)}
        settings = made({**raw, "contacts": [{**only, **contact}]}, path)
        laws.append(build(settings, {"small": small.basis()}).assembly.contacts[0].patch.law)
        files.append({name.split(": ")[-1] for name in files_of(settings)} - {"contact.toml"})
    first, second = (jax.tree.flatten(law) for law in laws)
    assert first[1] == second[1] and all(np.array_equal(a, b) for a, b in zip(first[0], second[0], strict=True))
    assert files[0] == files[1]


def rubbing(**contact: Any) -> dict[str, Any]:
    return {"contacts": table(**{**STIFF, "law": "smooth", **contact})["contacts"]}


CHANGES: dict[str, tuple[dict[str, Any], bool]] = {
    "friction": (rubbing(friction=0.31), True),
    "stiffness": (rubbing(normal_stiffness=1.0000001e9), True),
    "roughness": (rubbing(law="rough", roughness=1e-5), True),
    "amplitude": ({"amplitude": 1.1}, True),
    "load": ({"excitation": "gas"}, True),
    "read-out": ({"direction": "y"}, True),
    "modes": ({"modes": 4}, True),
    "harmonics": ({"harmonics": 2}, True),
    "samples": ({"samples": 17}, True),
    "periodicity": ({"periodicity": 1e-8}, True),
    "cycles": ({"cycles": 21}, True),
    "mode": ({"mode": "book"}, True),
    "name": ({"name": "other", "description": "x"}, False),
    "sweep": ({"sweep": {"start": 300.0, "stop": 500.0, "points": 7, "normal_forces": [1.0, 7.0]}}, False),
    "limits": ({"material_limits": {"fatigue_strength": 2e8, "tensile_strength": 9e8}}, False),
    "curve": ({"curve": {"points": 10}}, False),
}


@pytest.mark.parametrize("change, matters", CHANGES.values(), ids=list(CHANGES))
def test_points_depend_on_what_enters_the_balance(change: dict[str, Any], matters: bool) -> None:
    """Whatever key of the case changes it, and on nothing else."""
    raw = table() | rubbing()
    assert (of_points(built(raw)) != of_points(built(raw | change))) == matters


def test_a_line_of_contact_in_pieces() -> None:
    """fit = "exact": the approach of the line under the force of the sweep, to the cubic between the law's knots."""
    found = built(table(**PIN, fit="exact", points=[5, 1]))
    contact = found.pressed(200.0).contacts[0]
    steel = Solid(2.1e11, 0.3)
    assert len(contact.patch.points) == 5 and np.ptp(contact.patch.points[:, 1]) == 0
    line = Line(steel, steel, RADIUS, DEPTH)
    assert contact.offset[0] == pytest.approx(float(line.approach(200.0, HEIGHT)), rel=1e-3)


@pytest.mark.usefixtures("unestimated")
@pytest.mark.parametrize("fit, points", CURVED)
@pytest.mark.slow
def test_the_books_mode_of_a_curved_contact(fit: str, points: list[int]) -> None:
    """Gaps and Hertz' law in book mode, with one tangential stiffness; two are refused in one sentence."""
    raw = table(**PIN, fit=fit, points=points) | {"mode": "book"}
    refused("isotropic", run_case, made(raw), {"small": small.basis()})
    raw["contacts"][0]["isotropic"] = True
    assert run_case(made(raw), {"small": small.basis()}).responses[200.0].converged.all()


def test_one_round_contact() -> None:
    found = built(table(curvature=[0.5, 1.0], young=2.1e11, fit="exact"))
    contact = found.pressed(200.0).contacts[0]
    assert len(contact.patch.points) == 1 and contact.offset[0] > 0


@pytest.mark.slow
@pytest.mark.usefixtures("unestimated")
@pytest.mark.parametrize("fit, points", CURVED)
def test_a_curved_face_that_converges_in_a_case(fit: str, points: list[int]) -> None:
    result = run_case(made(table(**PIN, fit=fit, points=points)), {"small": small.basis()})
    assert result.responses[200.0].converged.all()


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "no table": (table(**STIFF, law=3), "law: must be the name of a law, or a table"),
    "neither": (table(**STIFF, friction="0.3"), "friction: must be a number or a table"),
    "unknown kind": (table(**STIFF, law="iwam"), 'right.law: "iwam" is unknown; choose one of'),
    "part of it": (table(**STIFF, friction={"kind": "coulomb"}), "contacts.right.friction.mu: is missing; add it"),
    "a length": (
        table(**STIFF, roughness={"kind": "polynomial", "R_Z": -1.0}), "(it is -1.0); correct it, in m"
    ),
    "both": (table(**STIFF, stiffness=GIVEN), "normal_stiffness: is short for a table"),
    "smooth strips": (table(**STIFF, law="strips"), "law: strips are those of a rough surface"),
    "cold": (table(**STIFF, friction={"kind": "heated", "mu_0": 0.3}), "the heat of sliding; add [temperature]"),
    "no such table": (
        table(**STIFF, friction={"kind": "table", "file": "no.csv"}), "right.friction.file: there is no file no.csv"
    ),

    "no stiffness": (table(), "normal_stiffness: is missing"),
    "twice": (table(**STIFF, **PIN), "young stands for both stiffnesses"),
    "young alone": (table(young=2e11), "young stands for both stiffnesses where a curvature is given"),
    "young and a slip spring": (table(**PIN, tangential_stiffness=1e7), "young stands for both stiffnesses"),
    "young and a table": (table(**PIN, friction={"kind": "static-sliding", "static": 0.3, "sliding": 0.2}),
                          "friction: of a curved contact (young) is one coefficient"),
    "young and heat": (table(**PIN, friction={"kind": "heated", "mu_0": 0.3}), "friction: of a curved contact"),
    "young and a damper": (table(**PIN, law={"kind": "smooth", "damping": 1e-4}), "law: of a curved contact"),
    "exact and rough": (table(**PIN, fit="exact", roughness=1e-5), "roughness: of a curved contact"),
    "fitted springs": (table(**STIFF, fitted_at=5.0), "fitted_at: belongs to young"),
    "warm": (table(**STIFF, temperature={"resistance": 1e-6, "limit": 900.0}), "temperature: belongs to friction"),
    "flat": (table(**STIFF, curvature=[float("inf"), float("inf")]), "inf, inf is flat"),
    "hollow": (table(**STIFF, curvature=[1.0, -2.0]), "curvature"),
    "no number": (table(**STIFF, curvature=[1.0, float("nan")]), "curvature"),
    "three": (table(**STIFF, curvature=[1.0, 2.0, 3.0]), "curvature"),
    "hertz bare": (table(**STIFF, fit="exact"), 'fit: "exact" needs curvature and young'),
    "hertz nodal": (table(**PIN, fit="exact", patch="nodal"), 'fit: "exact" needs curvature and young, and a rigid'),
    "points of a mesh": (table(**STIFF, patch="nodal", points=[3, 3]), "has those of the mesh"),
    "jenkins nodal": (table(**STIFF, patch="nodal", law="jenkins"), 'patch: law = "jenkins" belongs to flat'),
    "jenkins curved": (table(**STIFF, curvature=[1.0, 2.0], law="jenkins"), 'curvature: law = "jenkins" belongs'),
    "jenkins overlapping": (table(**STIFF, interference=1e-6, law="jenkins"), "law: "),
    "one way only": (table(**STIFF, law={"kind": "smooth", "slides_along": "t2"}), "law.slides_along: "),
    "statics in six rows": (table(**STIFF, includes="surface", patch="nodal"), "stands in the six rows of right alone"),
    "one of both": (table(**STIFF, isotropic=True), "isotropic belongs to young"),
    "bulk": (table(**PIN, includes="bulk+surface"), "beyond what the face yields"),
    "kind": (table(**STIFF, patch="soft"), "patch"),
    "pressed twice": (table(**STIFF, normal_force=3.0, interference=1e-6), "pressed by one or by the other"),
    "pulls": (table(**STIFF, normal_force=-3.0), "normal_force"),
    "no load": (table(**PIN, interference=1e-6), "a curved contact is fitted to Hertz at a load"),
    "full line": (table(**{**PIN, "curvature": [float("inf"), 1e6]}), "line contact: under 200 N it is"),
    "full face": (table(curvature=[1e6, 1e6], young=2.1e11, fit="exact"), "point contact: under 200 N it is"),
    "coarse": (table(**{**PIN, "curvature": [float("inf"), 2.0]}, points=[2, 40]),
               "2 points in a row are pressed at 200 N; take more points"),
    "apart": (two({"shift": [0.5, 0, 0]}), "do not face each other: they lie 480 mm apart along the normal"),
    "aside": (two({"shift": [0.02, 0.05, 0]}), "their centres lie 50 mm apart in the contact plane"),
    "turned": (two({"turn": 40.0}), "their normals are 40 degrees from opposite"),
    "one face twice": (TWICE, "interface 'right' stands in contacts 1 and 2 (counted from 1), but a face has one"),
    "two neighbours": (BETWEEN, "interface 'a:right' stands in contacts 1 and 2"),
    "whose face": (two(against="left"), "contacts: 'left' says not of which body; write one of a:left, b:left"),
    "whose load": (two() | {"excitation": "shaker"}, "excitations: 'shaker' says not of which body"),
    "whose monitor": (two() | {"monitor": "tip-probe"}, "write one of a:tip-probe, b:tip-probe"),
    "same side": (two(against="b:right"), "their normals are 180 degrees from opposite"),
}  # fmt: skip


@pytest.mark.parametrize("raw, words", WRONG.values(), ids=list(WRONG))
def test_mistakes_are_named_with_the_file(raw: dict[str, Any], words: str) -> None:
    assert refused(words, built, raw).startswith("case.toml: ")


def test_mistakes_at_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 2, one sentence, and what was there before stays as it was."""
    monkeypatch.chdir(tmp_path)
    write_basis(tmp_path / "beam.h5", small.basis())
    case = tmp_path / "case.toml"
    text = """name = "pair"
excitation = "a:shaker"
monitor = "a:tip-probe"
bodies = [{name = "a", file = "beam.h5"}, {name = "b", file = "beam.h5", shift = [0.02, 0.0, 0.0]}]
harmonics = 1
sweep = {start = 400.0, stop = 440.0, points = 2, normal_forces = [200.0]}
[[contacts]]
interface = "a:right"
against = "b:left"
normal_stiffness = 1e9
tangential_stiffness = 8e8
friction = 0.3
"""
    jenkins = 'friction = 0.3\nlaw = "jenkins"'  # soon compiled
    case.write_text(text.replace("friction = 0.3", jenkins))
    assert main(["respond", str(case), "--no-pictures", "--no-stress", "-q"]) == 0
    before = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
    for old, new, words in (
        ("0.02, 0.0", "0.02, 0.9", "do not face each other"),
        ('"b:left"', '"b:right"', "180 degrees"),
        ('"b:left"', '"b:front"', "no interface 'front'"),
        ("friction = 0.3", 'friction = 0.3\npatch = "nodal"\npoints = [2, 2]', "those of the mesh"),
        ("friction = 0.3", "friction = 0.3\ncurvature = [0.0, 1.0]", "curvature"),
        ("friction = 0.3", "friction = 0.3\nnormal_force = -1.0", "normal_force"),
        ("friction = 0.3", "friction = 20.0", "friction"),
    ):
        case.write_text(text.replace(old, new))
        refused_command(["respond", str(case), "-q"], capsys, words)
        now = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file() and p != case}
        assert now == {p: b for p, b in before.items() if p != case}


# memory ----------------------------------------------------------------------------------------------------------


def sample_case(folder: Path, monkeypatch: pytest.MonkeyPatch, **keys: Any) -> list[str]:
    """The vane that travels with the package, 24 x 5 points a contact; what to type after `respond`."""
    import microslip

    monkeypatch.chdir(folder)
    for file in ("case.toml", "basis.h5"):
        shutil.copy(Path(microslip.__file__).parent / "samples" / file, folder)
    more = {"contacts.right.points": [24, 5], "contacts.left.points": [24, 5], "sweep.normal_forces": [20.0]}
    more |= {"sweep.points": 2, "sweep.start": 300, "sweep.stop": 310} | keys
    return ["case.toml", "basis.h5", *(f"--set={key}={value}" for key, value in more.items())]


@pytest.mark.parametrize("keys", [{"contacts.right.points": [1000, 1000]}, {"harmonics": 200, "samples": 100000}])
def test_what_does_not_fit_into_the_memory_is_refused(tmp_path, monkeypatch, capsys, keys) -> None:
    """It ran for minutes at gigabytes. Half a TiB is what the larger machines have."""
    many = {"contacts.right.points": [1000, 1000], "harmonics": 20, "samples": 400} if len(keys) == 1 else keys
    words = sample_case(tmp_path, monkeypatch, **many)
    with monkeypatch.context() as patched:
        patched.setattr("microslip.case.contacts.of_this_machine", lambda: 0.5 * 2.0**40)
        refused_command(["respond", *words], capsys, "contacts.right: points", "memory_limit = ")
    assert not (tmp_path / "build").exists()


def test_the_limit_of_the_memory_is_ones_own(tmp_path, monkeypatch, capsys) -> None:
    words = sample_case(tmp_path, monkeypatch, harmonics=1, samples=8, memory_limit=0.4)
    refused_command(["respond", *words], capsys, "memory_limit is 0.4")
    settings = made(table(**STIFF, law="smooth", points=[6, 5]) | {"harmonics": 4})
    assert 0.5 < memory_of(settings, 30, 6) / 2**30 < 0.6
    monkeypatch.setattr("microslip.case.contacts.of_this_machine", lambda: 0.5 * 2.0**30)
    refused("this machine has 0.5;", build, settings, {"small": small.basis()})
    build(settings.model_copy(update={"memory_limit": 3.0}), {"small": small.basis()})


PEAK = """
import pathlib, re, resource, sys
from microslip.case import headline
from microslip.cli import main
headline.is_estimated = lambda *_, **__: False
code, status = main(sys.argv[1:]), pathlib.Path("/proc/self/status")
own = re.search(r"VmHWM:\\s+(\\d+)", status.read_text()) if status.exists() else None
print(code, own[1] if own else resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""
"""Runs a verb and tells its exit code and its peak: Linux counts that of the process which started it in ru_maxrss.
Harmonics and samples are at once those of the balance that estimates the error of fewer, for which eight programs more
would be compiled."""


@pytest.mark.slow
@pytest.mark.usefixtures("compiled_for_users")
@pytest.mark.parametrize(
    "keys", [{"harmonics": 12, "samples": 192, "contacts.right.points": [60, 60]}, {"harmonics": 48, "samples": 500}]
)
def test_the_estimated_memory_is_that_of_a_response_within_a_factor_of_two(tmp_path, monkeypatch, keys) -> None:
    """Peak of a process of its own: derivatives of many points, tangents of many harmonics and samples; of a contact,
    for which half as much is compiled as for two."""
    words = [w for w in sample_case(tmp_path, monkeypatch, cycles=4, **keys) if ".left." not in w]
    case = Path("case.toml").read_text()
    one, other = (case.rindex(head) for head in ("[[contacts]]", "[sweep]"))
    Path("case.toml").write_text(case[:one] + case[other:])
    done = subprocess.run([sys.executable, "-c", PEAK, "respond", *words, "-q"], capture_output=True, text=True)
    code, peak = done.stdout.split()[-2:]
    assert code == "0", done.stderr
    points = int(np.prod(keys.get("contacts.right.points", [24, 5])))
    unit = 1 if sys.platform == "darwin" else 1024
    assert 0.5 < aft_bytes(points, 6, keys["harmonics"], keys["samples"]) / (unit * int(peak)) < 2


def test_a_sweep_that_takes_long_is_told_from_its_third_point(monkeypatch) -> None:
    """By the time of the third point, since the first ones compile; once."""
    from microslip.harmonic_balance import solver

    clock = {}

    def slow(problem, Omega, starts, slope=None, **_):
        clock["n"] = clock.get("n", 0) + 1
        clock["s"] = clock.get("s", 0.0) + (100.0 if clock["n"] <= 2 else 7.0)
        return solver.Point(Omega, np.zeros(1), "converged", 0.0, 1)

    monkeypatch.setattr(solver, "solve", slow)
    monkeypatch.setattr(solver.time, "perf_counter", lambda: clock.get("s", 0.0))
    told: list[str] = []
    solver.sweep(SimpleNamespace(groups=()), np.arange(1.0, 101.0), told.append)
    assert sum("97 frequencies are left" in text for text in told) == 1
    told.clear()
    clock.clear()
    solver.sweep(SimpleNamespace(groups=()), np.arange(1.0, 51.0), told.append)
    assert not any("are left" in text for text in told)
