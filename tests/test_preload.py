"""Free bodies pressed by their own bolts: balance, pressure cone, rigid motions, and the matrix behind the modes."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from drawn import made
from meshes import body, brick
from refusals import refused

from microslip.basis import check_basis, read_basis, write_basis
from microslip.data import Mesh, ModalGroup
from microslip.fem.discretise import discretise, free_upper
from microslip.linalg import eigen
from microslip.linalg.bordered import Bordered
from microslip.modal import rigid
from microslip.modal.boundary import known_materials
from microslip.modal.closures import bolt_forces
from microslip.modal.compute import modal_basis
from microslip.modal.equilibrium import make_model
from microslip.modal.preload import determinate, pressed_modes, pressed_state, without_rigid
from microslip.modal.spectrum import make_pencil
from microslip.settings.body import load_body

GEOMETRY = Path(__file__).resolve().parents[1] / "geometry"
WASHER, THICKNESS, PRELOAD = 8e-3, 8e-3, 15e3
FACES = ("bolt_1", "bolt_2", "seam_right", "seam_left")
needs_gmsh = pytest.mark.skipif(importlib.util.find_spec("gmsh") is None, reason="gmsh is not installed")


# a short half pipe with one bolt a seam ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def pipe(tmp_path_factory: pytest.TempPathFactory) -> Mesh:
    short = {"length": 60.0, "bolts_per_seam": 1, "washer_radius": 8.0}
    return made("half-pipe", tmp_path_factory.mktemp("pipe"), **short)


def settings_of(modes: str, **more: object):
    plane = {"against": "ground", "point": [0.0, 0, 0], "normal": [0.0, 0, 1], "modes": modes}
    joint = {
        "closures": [{"name": f, "face": f, **plane} for f in FACES],
        "bolts": [{"name": f"m{i}", "face": f"head_{i}", "preload": PRELOAD} for i in (1, 2)],
    }
    return body(free=True, modes={"count": 10}, **(joint | more))


@pytest.fixture(scope="module")
def opened(pipe) -> ModalGroup:
    return modal_basis(pipe, settings_of("open")).groups[0, 0]


@needs_gmsh
def test_contacts_carry_the_preloads(opened):
    """The resultant of all contacts is the sum of the preloads, along z alone, in its middle: Newton ends at 1e-9."""
    contacts = opened.contacts.values()
    total = sum(c.force for c in contacts)
    np.testing.assert_allclose(total, [0, 0, 2 * PRELOAD], atol=1e-8 * PRELOAD)
    moment = sum(np.cross(c.centre, c.force) for c in contacts)
    np.testing.assert_allclose(moment, 0, atol=1e-5 * PRELOAD * 0.065)  # lever of a bolt; heads are meshed alone


@needs_gmsh
def test_pressure_stays_in_the_cone_under_the_washer(opened):
    """Within 45 degrees from the washer's edge lies nearly all force, and the flange gapes between the bolts."""
    for number, x in (("1", 0.065), ("2", -0.065)):
        c = opened.contacts[f"bolt_{number}"]
        distance = np.hypot(c.points[:, 0] - x, c.points[:, 1])
        force = c.pressure * c.areas
        inside = force[distance < WASHER + THICKNESS].sum() / force.sum()
        assert inside > 0.95
        assert force[distance < WASHER].sum() > 0.5 * force.sum()
        assert 0.1 < c.closed_share < 0.8
        assert np.abs(distance[c.pressure.argmax()]) < WASHER


@needs_gmsh
@pytest.mark.slow
def test_closed_joint_is_stiffer_and_keeps_three_rigid_motions(pipe, opened):
    """Sliding and turning in the plane stay free; no eigenvalue falls when a stiffness is added (Courant, Weyl)."""
    closed = modal_basis(pipe, settings_of("closed")).groups[0, 0]
    assert [g.kind.count("rigid") for g in (opened, closed)] == [6, 3]
    assert (closed.omega[3:] > 1.05 * opened.omega[3:]).all()
    motion = closed.phi[:, :, :3]
    assert np.abs(motion[:, 2]).max() < 1e-9 * np.abs(motion).max()


@needs_gmsh
def test_half_pipe_faces_its_file_names(pipe):
    """preloaded.toml names faces that its drawing has: one closure a patch and a ring under each head."""
    settings = load_body(GEOMETRY / "half-pipe" / "preloaded.toml")[0]
    heads = [b.face for b in settings.bolts]
    assert heads == [f"head_{i}" for i in range(1, 13)]
    assert {c.face for c in settings.closures} == {*(f"bolt_{i}" for i in range(1, 13)), "seam_right", "seam_left"}
    assert {"head_1", "head_2"} <= set(pipe.faces)
    assert "head_3" not in pipe.faces


# a free block squeezed by one bolt ---------------------------------------------------------------------------------

BLOCK = brick("hexahedron20", (2, 2, 2), (0.05, 0.06, 0.08))
GROUND = {"name": "g", "face": "z0", "against": "ground"}
SQUEEZE = [{"name": "b", "face": "z1", "against": "z0", "preload": 2e6}]


def squeezed():
    settings = body(free=True, bolts=SQUEEZE, modes={"count": 12})
    d = discretise(BLOCK)
    fixed = np.zeros(0, dtype=np.int64)
    material = known_materials(BLOCK, settings)
    model = make_model(
        d, material, free_upper(d.pattern, fixed), fixed, np.array([0, 1.0, 0]), np.zeros(3), None, 293.15,
        bolt_forces(BLOCK, settings), True,
    )  # fmt: skip
    centre = BLOCK.points.mean(axis=0)
    motions = rigid.free_motions(BLOCK.points, centre, fixed)
    state = pressed_state(model, motions, centre, "nonlinear", settings.modes, lambda _: None)
    return settings, model, state, centre


def test_squeezed_block():
    """Uniform compression N / A, the shortening N h / (E A), no stress from what holds it: St Venant, 1e-3 of strain.

    Dead forces would topple it: stiffness -N h' against small rotations across the bolt, h' the deformed height.
    """
    settings, model, state, centre = squeezed()
    z = state.u[:, 2]
    shortening = 2e6 * 0.08 / (settings.material.young * 0.05 * 0.06)
    height = 0.08 - (z[BLOCK.points[:, 2] < 1e-9].mean() - z[BLOCK.points[:, 2] > 0.08 - 1e-9].mean())
    assert 0.08 - height == pytest.approx(shortening, rel=2e-2)  # of second order in a strain of 3e-3
    for stress in state.stress:
        np.testing.assert_allclose(stress[..., [0, 1, 3, 4, 5]], 0, atol=1e-6 * np.abs(stress).max())
    pencil = make_pencil(model, state.K, eigen.new_solver())
    field = rigid.rigid_fields(BLOCK.points + state.u, centre).reshape(-1, 6)
    np.testing.assert_allclose(np.diag(field.T @ pencil.K(field))[3:5], -2e6 * height, rtol=1e-6)


def test_modes_of_a_squeezed_block_are_those_of_the_projected_stiffness():
    """The dense P^T K P, P = 1 - R R^T M, has six eigenvalues of zero and those found: 1e-9.

    The chain's own state is held at six other degrees of freedom, which turns the block by about its strain of 3e-3
    against the dead forces; their moment N h strain changes the modes in second order: 1e-6.
    """
    settings, model, state, centre = squeezed()
    plain = make_pencil(model, state.K, eigen.new_solver())
    eye = np.eye(plain.n)
    K, M = plain.K(eye), plain.M(eye)
    R = rigid.mass_orthonormal(rigid.free_motions(BLOCK.points + state.u, centre, model.fixed), plain.M)
    P = eye - R @ (R.T @ M)
    dense = scipy.linalg.eigh(P.T @ K @ P, M, eigvals_only=True)
    pencil, motions = pressed_modes(model, state, plain, centre)
    assert np.abs(pencil.K(motions)).max() < 1e-9 * plain.k_norm * np.abs(motions).max()
    shift = -0.01 * dense[6]
    found = eigen.search(pencil, 12, shift, rigid=R)
    np.testing.assert_allclose(found.values[6:], dense[6 : len(found.values)], rtol=1e-9)
    assert eigen.certify(pencil, found, shift).certified
    group = modal_basis(BLOCK, settings).groups[0, 0]
    assert group.kind[:7] == ("rigid",) * 6 + ("normal",)
    assert group.checks["certified"]
    np.testing.assert_allclose(group.omega[6:], np.sqrt(dense[6 : len(group.omega)]), rtol=1e-6)


def test_solver_with_the_rigid_part_taken_out():
    """Solutions and inertia of A - Y Z^T - Z Y^T against the dense matrix, indefinite ones too."""
    rng = np.random.default_rng(3)
    n = 40
    A, M = rng.normal(size=(n, n)), np.diag(rng.uniform(1, 2, n))
    A = A + A.T
    R = rng.normal(size=(n, 3))
    R = R @ np.linalg.inv(np.linalg.cholesky(R.T @ M @ R)).T
    P = np.eye(n) - R @ (R.T @ M)
    pencil = eigen.Pencil(
        lambda s: sp.csr_matrix(np.triu(A - s * M)), lambda x: A @ x, lambda x: M @ x, n, 1.0, 1.0,
        eigen.new_solver("superlu"),
    )  # fmt: skip
    relieved = without_rigid(pencil, R)
    assert isinstance(relieved.solver, Bordered)
    np.testing.assert_allclose(relieved.K(np.eye(n)), P.T @ A @ P, atol=1e-12 * np.abs(A).max())
    for s in (-3.0, 0.7, 5.0):
        dense = P.T @ A @ P - s * M
        relieved.solver.factorise(relieved.shifted(s))
        b = rng.normal(size=(n, 2))
        np.testing.assert_allclose(dense @ relieved.solver.solve(b), b, atol=1e-9)
        assert relieved.solver.negative() == (np.linalg.eigvalsh(dense) < 0).sum()


def test_degrees_of_freedom_that_hold_are_independent():
    motions = rigid.free_motions(BLOCK.points, BLOCK.points.mean(axis=0), np.zeros(0, dtype=int))
    held = determinate(motions)
    assert len(held) == 6
    assert np.linalg.cond(motions[held]) < 100


@pytest.mark.parametrize("reduction", ["eigenmodes", "rubin", "craig-bampton"])
@pytest.mark.parametrize("modes", ["open", "closed"])
def test_modal_files_of_a_pressed_free_body(modes, reduction, tmp_path):
    """Every claim of the file holds: six rigid motions, or the three that a closed ground leaves."""
    table = {
        "closures": [{**GROUND, "modes": modes}], "bolts": [{"name": "b", "face": "z1", "preload": 1e5}],
        "interfaces": [{"name": "side", "face": "x1"}], "reduction": reduction, "modes": {"count": 9},
    }  # fmt: skip
    basis = modal_basis(BLOCK, body(free=True, **table))
    group = basis.groups[0, 0]
    assert group.contacts["g"].normal_force == pytest.approx(1e5, rel=1e-8)
    assert (group.omega == 0).sum() == (6 if modes == "open" else 3)
    write_basis(tmp_path / "basis.h5", basis)
    checks = check_basis(read_basis(tmp_path / "basis.h5"))
    assert all(c.passed for c in checks), [c for c in checks if not c.passed]


# mistakes ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("joint", "reason"),
    [
        ({"bolts": [{"name": "b", "face": "z1", "preload": 1e3}]}, "not in balance: 1000 N act on a translation along"),
        ({"bolts": [{"name": "b", "face": "x1", "preload": 1e3}], "closures": [GROUND]}, "translation along x"),
        ({"closures": [GROUND]}, "nothing presses the faces of a free body together"),
    ],
)
def test_free_bodies_that_would_fly_off_are_refused(joint, reason):
    refused(reason, modal_basis, BLOCK, body(free=True, modes={"count": 8}, **joint))


@pytest.mark.parametrize("preload", [-15000.0, 0.0])
def test_preload_must_press(preload):
    with pytest.raises(ValueError, match="greater than 0"):
        body(free=True, bolts=[{"name": "b", "face": "z1", "preload": preload}])
