"""Siconos, in a process of the system's Python: set-valued motions that the package's are compared with."""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from closed_forms.impacts import bounces, height_of_ball

import microslip as ms
from microslip.contact.friction import Coulomb
from microslip.contact.law import value
from microslip.contact.patch import Patch
from microslip.contact.set_valued import SetValued
from microslip.system.assembly import Contact, ContactFace
from microslip.time_domain import equations
from microslip.time_domain.stepper import Stepper

PYTHON = "/usr/bin/python3"


def siconos(job: dict[str, Any], folder: Path) -> dict[str, np.ndarray]:
    """Motion by the script of tests/peers, which says what a job and its answer hold.

    Skips the test where Siconos is missing.
    """
    if (
        not Path(PYTHON).exists()
        or subprocess.run([PYTHON, "-c", "import siconos.kernel"], capture_output=True).returncode
    ):
        pytest.skip("Siconos is not installed (apt-get install python3-siconos)")
    (folder / "job.json").write_text(json.dumps(job))
    script = Path(__file__).parent / "peers" / "siconos_motion.py"
    done = subprocess.run(
        [PYTHON, script, "job.json", "out.json"], cwd=folder, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return {key: np.array(value) for key, value in json.loads((folder / "out.json").read_text()).items()}


def ball(height: float, restitution: float, step: float, end: float) -> dict[str, Any]:
    """A ball of 1 kg let go above the ground; sideways, its second coordinate, nothing happens."""
    none = [[0.0, 0.0], [0.0, 0.0]]
    ground = {"normal": [1, 0], "gap": 0.0, "along": [0, 1], "mu": 0.3, "restitution": restitution}
    return {"M": [[1, 0], [0, 1]], "C": none, "K": none, "weight": [-9.81, 0], "force": [0, 0], "omega": 1.0,
            "q": [height, 0], "v": [0, 0], "contacts": [ground], "step": step, "end": end}  # fmt: skip


def chain(step: float, end: float) -> dict[str, Any]:
    """Two blocks of 1 kg in a chain, each pressed on the ground by 1 N, where it rubs and may lift off; the second one
    hits a stop. Coordinates: x of both, z of both, and one along the stop, which has no friction."""
    one, K, C = np.eye(5).tolist(), np.zeros((5, 5)), np.zeros((5, 5))
    K[:2, :2] = [[2.0, -1.0], [-1.0, 2.0]]
    C[:2, :2] = 0.04 * K[:2, :2]
    grounds = [{"normal": one[2 + i], "gap": 0.0, "along": one[i], "mu": 0.1, "restitution": 0.0} for i in (0, 1)]
    stop = {"normal": [0, -1, 0, 0, 0], "gap": 0.3, "along": one[4], "mu": 0.0, "restitution": 0.5}
    return {"M": one, "C": C.tolist(), "K": K.tolist(), "weight": [0, 0, -1, -1, 0], "force": [0.5, 0, 0, 0, 0],
            "omega": 1.1, "q": [0] * 5, "v": [0] * 5, "contacts": [*grounds, stop], "step": step,
            "end": end}  # fmt: skip


@pytest.mark.slow
def test_siconos_lets_a_ball_bounce_until_it_rests(tmp_path: Path) -> None:
    """Infinitely many bounces within 1.355 s: in first order of the step, which is where impacts are."""
    height, e, errors = 1.0, 0.5, []
    for step in (1e-3, 2.5e-4):
        found = siconos(ball(height, e, step, 1.8), tmp_path)
        exact = height_of_ball(found["time"], height, e, 9.81)
        errors.append(np.abs(found["q"][:, 0] - exact).max())
    assert errors[1] < 0.4 * errors[0] < 4e-3
    rests = found["time"] > 1.02 * bounces(height, e, 9.81, 60)[-1]
    np.testing.assert_allclose(found["normal"][rests, 0], 9.81, rtol=1e-9)


@pytest.mark.slow
def test_siconos_keeps_the_laws_of_contact_in_a_chain(tmp_path: Path) -> None:
    """Friction within its cone and against the way, stops that are not passed, steps in each state."""
    found = siconos(chain(1e-3, 6 * np.pi / 1.1), tmp_path)
    x, rate, friction = found["q"][:, :2], found["v"][:, :2], found["friction"][:, :2]
    np.testing.assert_allclose(found["normal"][1:, :2], 1.0, rtol=1e-9)
    assert np.abs(friction).max() <= 0.1 + 1e-9 and x[:, 1].max() < 0.302 and found["normal"][:, 2].max() > 10
    assert (friction * rate).max() < 1e-9
    slides = np.abs(rate) > 1e-6
    np.testing.assert_allclose(friction[slides], -0.1 * np.sign(rate[slides]), rtol=1e-6)
    assert 0.005 < 1 - slides.mean() < 0.8


def of_package(job: dict[str, Any]) -> Stepper:
    """The stepper of a job whose coordinates all have mass; contacts with friction in two directions."""
    structure = ms.structure(
        np.array(job["M"]), np.array(job["K"]), np.array(job["C"]), force=np.array(job["force"], dtype=float),
        steady=np.array(job["weight"], dtype=float), output=list(range(len(job["M"]))),
    )  # fmt: skip
    contacts = []
    for i, c in enumerate(job["contacts"]):
        law = SetValued(Coulomb(value(c["mu"])), value(c["restitution"]), value(0.0))
        shapes = np.zeros((1, 3, 2))
        shapes[0, 0, 0] = shapes[0, 1, 1] = 1.0
        patch = Patch("ground", np.zeros((1, 2)), np.ones(1), law, shapes)
        rows = np.array([np.negative(c["normal"]), c["along"]], dtype=float)
        face = ContactFace("structure", f"ground {i}", rows={0: rows})
        contacts.append(Contact(f"ground {i}", patch, face, None, np.array([-c["gap"], 0.0]), np.zeros(2)))
    e = equations.of(replace(structure, contacts=tuple(contacts)), job["omega"])
    return Stepper(e, job["step"])


@pytest.mark.slow
def test_the_package_moves_a_chain_as_siconos_does(tmp_path: Path) -> None:
    """Friction, lift-off and impacts coupled: both of first order, their difference falls with the step."""
    differences = []
    for step in (1e-3, 2.5e-4):
        job = chain(step, 6 * np.pi / 1.1)
        found, stepper = siconos(job, tmp_path), of_package(job)
        every = round(0.01 / step)
        start = np.zeros(5), np.zeros(5)
        _, seen, events, _ = stepper.run(stepper.start(*start), np.full(len(found["time"]) // every, every))
        x = seen.q @ stepper.equations.output.T
        theirs = np.array([np.interp(seen.time, found["time"], found["q"][:, i]) for i in (0, 1)]).T
        differences.append(np.abs(x[:, :2] - theirs).max())
        assert (events[:, 1] == 2).any() and set(events[:, 2]) == {0, 1, 2, 3}
    assert differences[1] < 0.5 * differences[0] < 5e-3
