"""Exports in the programs they are for: Octave, pyHarm and Exudyn build the body and compute with it.

pyHarm and Exudyn, FMPy (`test_exchange_fmu`) and pyNastran (`test_exchange_dmig`) live in environments of their own,
made by ``make peers`` (tests/peers/setup.sh); elsewhere their interpreters may be named by MICROSLIP_PYHARM and so on.
Without them the tests are skipped, or fail with MICROSLIP_PEERS=required, as in CI.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import sector
import small
from closed_forms.one_harmonic import jenkins_harmonic
from scipy.io import loadmat
from test_exchange import blocks

from microslip.data import Array, ModalBasis
from microslip.elasticity import isotropic
from microslip.exchange import formats, writer
from microslip.fem.discretise import discretise
from microslip.fem.operators import mass, stiffness
from microslip.modal.compute import modal_basis
from microslip.settings.body import BodySettings

PEERS = Path(__file__).parent / "peers"


def interpreter(name: str) -> str | None:
    """Python of a peer's environment."""
    place = os.environ.get(f"MICROSLIP_{name.upper()}")
    made = Path(__file__).parents[1] / "build" / "peers" / name / "bin" / "python"
    return place or (str(made) if made.exists() else None)


def needs(name: str) -> pytest.MarkDecorator:
    return pytest.mark.skipif(interpreter(name) is None, reason=f"{name} is not installed: make peers")


def ask(name: str, script: str, *words: str | Path) -> None:
    """Run a script in a peer's environment, in the folder of its last word: pyHarm leaves a folder where it runs."""
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}
    done = subprocess.run(
        [str(interpreter(name)), str(PEERS / script), *map(str, words)],
        capture_output=True, text=True, timeout=600, env=environment, cwd=Path(words[-1]).parent,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]


@cache
def body(reduction: str = "eigenmodes", rpm: float = 0.0) -> ModalBasis:
    rotation = {"speeds_rpm": [rpm], "axis": [1.0, 0.0, 0.0], "point": [0.0, 0.01, -0.2]}
    table = small.table(reduction=reduction, damping={"ratio": 0.01}, rotation=rotation)
    source = {"settings": "small", "mesh_sha256": "0" * 64}
    return modal_basis(small.beam(), BodySettings.model_validate(table), provenance=source)


# --- Octave, with the structure NLvib's MechanicalSystem takes --------------------------------------------------------


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="Octave is not installed")
@pytest.mark.parametrize("reduction", ["eigenmodes", "craig-bampton"])
def test_octave_builds_the_system_and_answers_as_we_do(reduction: str, tmp_path: Path) -> None:
    """M, D, K, Fex1 and a spring along a force direction of W; response by Octave against numpy, to rounding."""
    basis, spring = body(reduction), 3e6
    g = basis.groups[0, 0]
    writer("mat")(basis, tmp_path / "b.mat")
    omega = np.linspace(0.7, 1.3, 7) * g.omega[0]
    lines = ",".join(f"{w:.17e}" for w in omega)
    ask_octave(tmp_path, f"nlvib_system('{tmp_path / 'b.mat'}', 'right:u_n', {spring!r}, [{lines}], 'tip_probe')")
    found = loadmat(tmp_path / "out.mat")["u"].T
    T, f = g.interfaces["right"].rows[0], g.excitations["shaker"].rows[0]
    K = g.K_r + spring * np.outer(T, T)
    q = np.array([np.linalg.solve(-(w**2) * g.M_r + 1j * w * g.C_r + K, f) for w in omega])
    expected = q @ g.monitors["tip-probe"].rows.T
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="Octave is not installed")
def test_octave_rubs_the_body_along_a_force_direction(tmp_path: Path) -> None:
    """One elastic dry friction element, sampled in Octave, in the closed form of one Jenkins element here.

    512 samples a period: the kinks of the force are hit within 1 / 512 of a period, so its harmonic is off by the
    square of that times their number, some 1e-5.
    """
    basis, k, limit, force = body("craig-bampton"), 4e6, 6.0, 10.0
    g = basis.groups[0, 0]
    writer("mat")(basis, tmp_path / "b.mat")
    T, f = g.interfaces["left"].rows[0], force * g.excitations["shaker"].rows[0]
    omega = np.array([0.9, 1.03, 1.1]) * g.omega[0]
    lines = ",".join(f"{w:.17e}" for w in omega)
    ask_octave(tmp_path, f"nlvib_friction('{tmp_path / 'b.mat'}', 'left:u_n', {k!r}, {limit!r}, {force!r}, [{lines}])")
    found = loadmat(tmp_path / "out.mat")["u"].ravel()
    slips = np.abs(found) * k > limit
    assert slips.any() and not slips.all(), "it must stick at one frequency and slip at another"
    for w, u in zip(omega, found, strict=True):
        Z = -(w**2) * g.M_r + 1j * w * g.C_r + g.K_r
        closed, _ = jenkins_harmonic(np.abs([u]), k, limit)
        expected = T @ np.linalg.solve(Z, f - closed[0] * u * T)
        assert abs(u - expected) < 3e-5 * abs(u)


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="Octave is not installed")
def test_octave_answers_for_a_complex_nodal_diameter(tmp_path: Path) -> None:
    """Complex arrays: W loads by its columns, T reads, and the answer is the same."""
    basis = sector.basis()
    g = basis.groups[0, 2]
    name = next(iter(g.interfaces))
    assert np.iscomplexobj(g.interfaces[name].rows)
    writer("mat")(basis, tmp_path / "b.mat")
    w = 0.9 * g.omega[0]
    text = f"load('{tmp_path / 'b.mat'}'); b = speed_0_nd_2; w = {w:.17e};"
    text += "u = b.W' * ((-w^2 * b.M + 1i * w * b.D + b.K) \\ b.W);"
    ask_octave(tmp_path, text)
    T = np.concatenate([i.rows for i in g.interfaces.values()])
    expected = T @ np.linalg.solve(-(w**2) * g.M_r + 1j * w * g.C_r + g.K_r, T.conj().T)
    np.testing.assert_allclose(loadmat(tmp_path / "out.mat")["u"], expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def ask_octave(folder: Path, command: str) -> None:
    """Run a command that sets u, kept in out.mat."""
    text = f"addpath('{PEERS}'); {'u = ' if command.startswith('nlvib') else ''}{command};"
    text += f"save('-v7', '{folder / 'out.mat'}', 'u')"
    done = subprocess.run(["octave-cli", "-q", "--eval", text], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr


# --- pyHarm -----------------------------------------------------------------------------------------------------------


@needs("pyharm")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("friction", "limit", "tolerance", "rpm"), [(0.0, 0.0, 1e-8, 0.0), (4e6, 6.0, 2e-3, 0.0), (0.0, 0.0, 1e-8, 3000.0)]
)
def test_pyharm_solves_the_bodys_equations(
    friction: float, limit: float, tolerance: float, rpm: float, tmp_path: Path
) -> None:
    """What pyHarm finds for the exported body satisfies the equations of the modal file.

    Without friction to pyHarm's own tolerance; with a Jenkins element the one-harmonic force is the closed form here
    and 256 samples a period there: 1 / 256 of a period in the instant of sticking is some 1e-3 of the force.
    """
    basis = body("craig-bampton", rpm)
    g, job = basis.groups[0, 0], {"force": 10.0, "stiffness": friction, "limit": limit, "direction": 0, "samples": 256}
    job |= {"low": 0.9 * g.omega[0], "high": 1.2 * g.omega[0]}
    writer("pyharm")(basis, tmp_path / "b.mat")
    (tmp_path / "job.json").write_text(json.dumps(job))
    ask("pyharm", "pyharm_response.py", tmp_path / "b.mat", tmp_path / "job.json", tmp_path / "out.npz")
    found = np.load(tmp_path / "out.npz")
    assert len(found["omega"]) >= 12
    left, right = 6, 0  # u_n of each; in the file the interfaces stand in this order
    slipped, turning = 0, 0.0
    for w, x in zip(found["omega"], found["x"], strict=True):
        rest = (-(w**2) * g.M_r + 1j * w * (g.C_r + g.G_r) + g.K_r) @ x
        turning += np.abs(w * g.G_r @ x).max()
        rest[right] -= job["force"]
        if friction:
            stuck, _ = jenkins_harmonic(np.abs(x[[left]]), friction, limit)
            slipped += bool(np.abs(x[left]) * friction > limit)
            rest[left] += stuck[0] * x[left]
        assert np.abs(rest).max() < tolerance * job["force"]
    assert not rpm or turning > 1e-2 * job["force"], "the gyroscopic matrix must show"
    assert not friction or 0 < slipped < len(found["omega"]), "it must stick at one frequency and slip at another"


# --- Exudyn -----------------------------------------------------------------------------------------------------------


@needs("exudyn")
@pytest.mark.slow
def test_exudyn_takes_the_body_and_swings_it(tmp_path: Path) -> None:
    basis = body()
    g, v = basis.groups[0, 0], basis.groups[0, 0].invariants
    writer("exudyn")(basis, tmp_path / "b.npz")
    np.savez(tmp_path / "nodal.npz", **nodal(basis))
    arm = np.array([v.first_moment[0], 0.0, v.first_moment[2]]) / v.mass
    about = np.trace(v.second_moment) - v.second_moment[1, 1]
    expected = np.sqrt(v.mass * 9.81 * np.linalg.norm(arm) / about) / (2 * np.pi)
    job = {"frequency": g.frequency[0], "time": 2.5 / expected, "steps": 2500, "nodal": str(tmp_path / "nodal.npz")}
    (tmp_path / "job.json").write_text(json.dumps(job))
    ask("exudyn", "exudyn_swing.py", tmp_path / "b.npz", tmp_path / "job.json", tmp_path / "out.npz")
    found = np.load(tmp_path / "out.npz")
    # held: its frequencies are those of the file, by eigenvalues and by a free vibration in time
    elastic = found["frequencies"][found["frequencies"] > 1]
    np.testing.assert_allclose(elastic[: g.n_modes], g.frequency, rtol=1e-11)
    time, q = found["vibration"][:, 0], found["vibration"][:, 1]
    # 200 steps a period of the trapezoidal rule: (omega dt)^2 / 12 = 8e-5 too slow
    assert crossing_frequency(time, q) == pytest.approx(g.frequency[0], rel=2e-4)
    # swinging: the rigid pendulum, whose frequency falls by a sixteenth of the square of its amplitude (9e-5 here)
    time, angle = found["swing"][:, 0], found["swing"][:, 2]
    turned = crossing_frequency(time, angle - (angle.max() + angle.min()) / 2)
    assert turned == pytest.approx(expected * (1 - (np.ptp(angle) / 2) ** 2 / 16), rel=1e-5)
    # Exudyn's integrals, made by itself from M of the finite elements, are those in the file
    table = np.load(tmp_path / "b.npz")
    names = [n for n in found.files if n.startswith("own_") and found[n].size]
    assert len(names) == 14
    for name in names:
        mine, own = table[name.removeprefix("own_")], found[name]
        np.testing.assert_allclose(mine, own, rtol=0, atol=1e-13 * np.abs(own).max(), err_msg=name)


def nodal(basis: ModalBasis) -> dict[str, Array]:
    """The full model for Exudyn: nodes in the body frame, M and K without supports, shapes."""
    g, d = basis.groups[0, 0], discretise(basis.mesh)
    K = d.pattern.full(stiffness(d, isotropic(2.1e11, 0.3)))
    M = d.pattern.full(mass(d, 7850.0)[:, None, None] * np.eye(3))
    nodes = basis.mesh.points - g.invariants.point
    return {"nodes": nodes, "M": M.toarray(), "K": K.toarray(), "shapes": g.phi.reshape(-1, g.n_modes)}


def crossing_frequency(time: Array, signal: Array) -> float:
    """Frequency from the upward zero crossings, interpolated."""
    up = np.flatnonzero((signal[:-1] < 0) & (signal[1:] >= 0))
    at = time[up] - signal[up] * (time[up + 1] - time[up]) / (signal[up + 1] - signal[up])
    return float((len(at) - 1) / (at[-1] - at[0]))


# --- the page's lines -------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("peer", "form", "head"), [("pyharm", "pyharm", "pyHarm"), ("exudyn", "exudyn", "Exudyn"), ("fmpy", "fmu", "FMU")]
)
def test_the_readers_lines_of_the_page_run(peer: str, form: str, head: str, tmp_path: Path) -> None:
    if interpreter(peer) is None:
        pytest.skip(f"{peer} is not installed: make peers")
    writer(form)(body("craig-bampton"), tmp_path / f"basis{formats()[form].ending}")
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}
    done = subprocess.run(
        [str(interpreter(peer)), "-c", blocks()[head]],
        capture_output=True, text=True, timeout=600, cwd=tmp_path, env=environment,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
