"""Free bodies and free cyclic sectors that turn: rigid body theory, whirl, closed forms of ring and disc, refusals."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from meshes import body, brick
from refusals import refused
from rings import AXIS, bladed_sector, disc_sector, full_ring

import microslip as ms
from microslip.basis import write_basis
from microslip.basis.checks import check_basis
from microslip.cli import main
from microslip.data import Mesh, ModalBasis, ModalGroup
from microslip.errors import UserError
from microslip.harmonic_balance import problem as balance
from microslip.harmonic_balance import pseudo_transient
from microslip.linalg import eigen
from microslip.linalg.gyroscopic import general_modes
from microslip.linalg.parametric import family_of_group
from microslip.linalg.quadratic import Window
from microslip.modal.compute import modal_basis
from microslip.modal.floating import Balanced
from microslip.reduced.coordinates import in_modes
from microslip.roots.spectrum import Spectrum, spectrum
from microslip.stages.summary import frequency_lines
from microslip.units import from_rpm, to_rpm

Array = np.ndarray
Size = tuple[float, float, float]
RUBBER = {"density": 1000.0, "young": 2e7, "poisson": 0.3}
STIFF = RUBBER | {"young": 2e11}
RPM = 3000.0
SPEED = from_rpm(RPM)
TIP = {"interfaces": [{"name": "tip", "face": "z1", "t2": [1.0, 0.0, 0.0]}]}


def block(a: float, b: float, c: float) -> Mesh:
    """A block about the origin; its axis of rotation is z."""
    return brick("hexahedron20", (1, 1, 2), (a, b, c), (-a / 2, -b / 2, -c / 2))


def about_z(**more: object) -> dict:
    return {"axis": [0.0, 0.0, 1.0], "point": [0.0, 0.0, 0.0], "speeds_rpm": [RPM], **more}


@cache
def turning(size: Size, stiff: bool = True, ratio: float = 0.0, reduction: str = "") -> ModalBasis:
    more = TIP | {"reduction": reduction} if reduction else {}
    settings = body(
        STIFF if stiff else RUBBER, free=True, rotation=about_z(), modes={"count": 12}, damping={"ratio": ratio}, **more
    )
    return modal_basis(block(*size), settings)


def group(size: Size, stiff: bool = True, ratio: float = 0.0, reduction: str = "") -> ModalGroup:
    return turning(size, stiff, ratio, reduction).groups[0, 0]


PENCIL, BRICK, PLATE, MIDDLE = (0.04, 0.05, 0.1), (0.1, 0.08, 0.06), (0.08, 0.1, 0.02), (0.04, 0.05, 0.045)


def roots(g: ModalGroup) -> Spectrum:
    top = 2 * g.omega.max()
    return spectrum(family_of_group("body", g).at({"speed": g.speed}), Window((-top, top), (0.0, top)))


# ---------------------------------------------------------------- rigid body theory


@pytest.mark.parametrize("size", [PENCIL, PLATE])
def test_rigid_motions_meet_what_rigid_body_theory_says(size: Size) -> None:
    """K_r: 0 along and about the axis, exactly; -Omega^2 across it; (J_n - J_2) Omega^2 / J_1 in a tilt (the body grows
    by 1e-7)."""
    basis = turning(size)
    g, (J1, J2, J3) = basis.groups[0, 0], np.diag(basis.inertia)
    assert g.kind[:6] == ("rigid",) * 6 and "rigid" not in g.kind[6:]
    values = np.diag(g.K_r)[:6] / g.speed**2
    expected = np.sort([-1.0, -1.0, 0.0, 0.0, (J3 - J2) / J1, (J3 - J1) / J2])
    np.testing.assert_allclose(values, expected, rtol=0, atol=1e-6)
    exact = np.flatnonzero(values == 0)
    assert len(exact) == 2 and not g.K_r[exact].any()
    across = np.flatnonzero(np.abs(values + 1) < 1e-12)
    assert len(across) == 2 and not g.K_r[across][:, 6:].any()


@pytest.mark.parametrize("size", [PENCIL, PLATE])
def test_whirl_at_omega_and_nutation(size: Size) -> None:
    """A body at rest in space whirls at Omega; Euler's equations give the nutation of a free body with three moments,
    omega^2 = Omega^2 (J_3 - J_1)(J_3 - J_2) / (J_1 J_2) in its own frame; a tilted axis is at rest in space too."""
    basis = turning(size)
    y, (J1, J2, J3) = basis.groups[0, 0].gyroscopic, np.diag(basis.inertia)
    assert y is not None and y.stable
    nutation = np.sqrt((J3 - J1) * (J3 - J2) / (J1 * J2))
    np.testing.assert_allclose(np.sort(y.omega)[:6] / SPEED, np.sort([0, 0, nutation, 1, 1, 1]), rtol=0, atol=1e-6)
    np.testing.assert_allclose(np.sort(y.omega / SPEED)[2 if nutation < 1 else 5], nutation, rtol=1e-6)


def test_a_body_about_its_middle_axis_diverges_by_eulers_equations() -> None:
    """growth^2 = Omega^2 (J_3 - J_2)(J_1 - J_3) / (J_1 J_2), of a flexible body as of a rigid one."""
    basis = turning(MIDDLE)
    g, (J1, J2, J3) = basis.groups[0, 0], np.diag(basis.inertia)
    assert J2 < J3 < J1
    expected = SPEED * np.sqrt((J3 - J2) * (J1 - J3) / (J1 * J2))
    found = roots(g)
    grow = [s for s, v in zip(found.roots.s, found.verdict, strict=True) if v == "unstable"]
    assert len(grow) == 1 and grow[0].imag == 0
    assert grow[0].real == pytest.approx(expected, rel=1e-6)
    assert g.gyroscopic is not None and g.gyroscopic.growth.max() == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("reduction", ["", "macneal", "rubin", "craig-bampton"])
def test_rigid_motions_in_space_are_exact_in_every_basis(reduction: str) -> None:
    """A body of rubber that grows by 0.3 %: shifted, or turned about a tilted axis, it still turns steadily in space,
    so x exp(i Omega t) of that motion satisfies the reduced equation, damped, with whatever coordinates are kept."""
    g = group(BRICK, False, 0.05, reduction)
    assert np.abs(g.u_static).max() > 1.5e-4
    own = in_modes(g)
    assert [k for k, w in zip(own.kind, own.omega, strict=True) if w == 0] == ["rigid"] * 6
    Q = -(SPEED**2) * own.M_r + 1j * SPEED * (own.C_r + own.G_r) + own.K_r
    _, s, vh = np.linalg.svd(Q[:, :6])
    assert (s < 1e-9 * SPEED**2).sum() == 2  # a shift and a tilt; their conjugates stand at -Omega
    assert np.abs(Q @ np.vstack([vh[-2:].conj().T, np.zeros((len(Q) - 6, 2))])).max() < 1e-9 * SPEED**2
    failed = [c for c in check_basis(turning(BRICK, False, 0.05, reduction)) if not c.passed]
    assert not failed


def test_a_free_body_is_neutral_and_inner_damping_moves_its_nutation_alone() -> None:
    """No rigid motion grows, double roots included, but for the known one: a body about its axis of least inertia loses
    energy until it tumbles, one about its axis of largest inertia nutates less and less (R. N. Bracewell and O. K.
    Garriott, Nature 182, 1958)."""
    for size in (PENCIL, PLATE):
        verdict = roots(group(size, False)).verdict
        assert set(verdict) == {"neutral"}
    for size, grows in ((PENCIL, True), (PLATE, False)):
        found = roots(group(size, False, 0.05))
        unstable = [s.imag / SPEED for s, v in zip(found.roots.s, found.verdict, strict=True) if v == "unstable"]
        assert len(unstable) == grows and all(0.1 < w < 0.99 for w in unstable)
        assert found.verdict.count("neutral") >= 7


@cache
def pressed() -> tuple[ModalBasis, Any]:
    """A free plate whose end is pressed by a contact that turns with it, and its assembly at speed."""
    settings = body(
        RUBBER | {"young": 2e9}, free=True, rotation=about_z(speeds_rpm=[0.0, RPM]), modes={"count": 7},
        damping={"ratio": 0.01}, **TIP, monitors=[{"name": "foot", "point": [0.04, 0.05, -0.01]}],
        excitations=[{"name": "push", "point": [0.04, 0.05, 0.01], "direction": [1.0, 0.0, 0.0]}],
    )  # fmt: skip
    basis = modal_basis(block(*PLATE), settings)
    touch = {"interface": "tip", "normal_stiffness": 2e5, "tangential_stiffness": 1e4, "includes": "surface"}
    touch |= {"friction": 0.3, "points": [2, 2], "normal_force": 50.0}
    case = {"body": basis.name, "speed": 1, "excitation": "push", "amplitude": 0.5, "monitor": "foot"}
    return basis, ms.assemble(case | {"contacts": [touch]}, **{basis.name: basis})


def test_a_contact_that_turns_with_a_free_body_holds_it() -> None:
    """Centrifugal forces leave a negative stiffness beside that of the sticking contact, and no motion without any.
    Without the contact nothing holds the body."""
    _, assembly = pressed()
    problem = balance.of(assembly.assembly)
    part, k = problem.parts[0][0], problem.stiffness[0]
    lowest = scipy.linalg.eigvalsh(part.K + part.rows.T @ k @ part.rows)[0]
    assert lowest < -0.1 * SPEED**2 and not pseudo_transient.unheld(problem)
    refused("nothing holds the bodies", pseudo_transient.unconstrained, part, np.zeros_like(k))


@pytest.mark.slow
def test_a_motion_in_time_stays_on_the_balance_of_a_free_body_at_speed() -> None:
    _, assembly = pressed()
    found = ms.harmonic_response(assembly, [70.0], harmonics=3)
    run = ms.integrate(assembly, 70.0, settle=0, keep=2, start="balance")
    assert found.converged.all()
    assert np.ptp(run.y) / 2 == pytest.approx(found.amplitude[0], rel=1e-3)


def test_roots_are_those_of_the_speed_that_is_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file of two speeds: the first if nothing is said, and the terminal says so; whirls at Omega at the other."""
    basis, _ = pressed()
    write_basis(file := tmp_path / "basis.h5", basis)
    ask = ["stability", str(file), "--no-pictures"]
    for given in (file, basis):
        refused("holds 2 speeds; give speed = 0 to 1", ms.stability, given)
        hertz = ms.stability(given, speed=1).frequency
        assert (np.abs(hertz - RPM / 60) < 1e-3).sum() == 3
    for more, text, whirls in (([], "At 0 rpm, one of the 2 speeds", 0), (["--speed", "1"], f"At {RPM:g} rpm", 3)):
        assert main([*ask, *more]) == 0
        out = capsys.readouterr().out
        assert text in out
        hertz = [float(line.split()[0]) for line in out.splitlines() if "neutral " in line]
        assert sum(abs(f - RPM / 60) < 1e-3 for f in hertz) == whirls
    before = (tmp_path / "stability.csv").read_bytes()
    wrong = {("--speed", "2"): "--speed 2: the file has 2", ("--set", "a=1"): "a modal file has no settings"}
    for more, text in wrong.items():
        assert main([*ask, *more]) == 2
        assert text in capsys.readouterr().err
    assert (tmp_path / "stability.csv").read_bytes() == before


def test_the_first_frequencies_on_the_terminal_are_elastic_ones() -> None:
    basis, _ = pressed()
    (line, *_), g = frequency_lines(basis), basis.groups[0, 0]
    shown = [float(f) for f in line.partition("rpm")[2].partition("Hz")[0].split()]
    np.testing.assert_allclose(shown, g.frequency[g.omega > 0][:5], rtol=1e-4)
    assert line.endswith("beside 6 rigid motions")


# ---------------------------------------------------------------- the static state


def test_balanced_solver_against_the_constrained_problem() -> None:
    """K x + M R f = b, R^T M x = 0 written out; the count of negative eigenvalues where R^T M x = 0."""
    rng = np.random.default_rng(3)
    A = rng.standard_normal((30, 30))
    K = A @ A.T - 9.0 * np.outer(A[0], A[0]) / (A[0] @ A[0])
    R = np.linalg.qr(rng.standard_normal((30, 4)))[0]
    P = np.eye(30) - R @ R.T
    K = P @ K @ P + 0.3 * (R @ rng.standard_normal((4, 30)) @ P + P @ rng.standard_normal((30, 4)) @ R.T)
    K = 0.5 * (K + K.T)
    solver = Balanced(eigen.new_solver("superlu"), R, R)
    upper = sp.triu(sp.csr_matrix(K)).tocsr()
    upper.sort_indices()
    solver.factorise(upper)
    whole = np.block([[K, R], [R.T, np.zeros((4, 4))]])
    b = rng.standard_normal((30, 2))
    expected = np.linalg.solve(whole, np.vstack([b, np.zeros((4, 2))]))[:30]
    np.testing.assert_allclose(solver.solve(b), expected, rtol=0, atol=1e-10 * np.abs(expected).max())
    inner = scipy.linalg.null_space(R.T)
    assert solver.negative() == (np.linalg.eigvalsh(inner.T @ K @ inner) < 0).sum()


def test_a_thin_ring_grows_as_its_hoop_stress_says() -> None:
    """u = rho Omega^2 R^3 / E to the square of thickness over radius, without mean motion, of sector and ring."""
    R, h, N = 0.2, 0.004, 6
    sector = disc_sector("hexahedron20", N, R - h / 2, R + h / 2, h, (3, 1, 1))
    at = {"axis": AXIS.tolist(), "speeds_rpm": [to_rpm(300.0)]}
    one = modal_basis(sector, body(free=True, cyclic={"sectors": N, "nodal_diameters": [0]}, rotation=at))
    g, E, rho = one.groups[0, 0], 2.1e11, 7850.0
    radial = sector.points * [1, 0, 1] / np.linalg.norm(sector.points * [1, 0, 1], axis=1)[:, None]
    u = np.einsum("na,na->n", radial, g.u_static)
    np.testing.assert_allclose(u, rho * 300.0**2 * R**3 / E, rtol=0.03)
    ring = full_ring(sector, N)
    whole = modal_basis(ring.mesh, body(free=True, rotation=at, modes={"count": 8})).groups[0, 0]
    np.testing.assert_allclose(whole.u_static, ring.expand(g.u_static, 0).real, rtol=0, atol=1e-9 * np.abs(u).max())


def test_a_heated_free_body_grows_about_its_centre() -> None:
    """u = alpha dT (x - centre) without stress or mean motion; frequencies rise with the root of 1 + alpha dT, and
    where the heat is uneven rigid motions stay exact."""
    hot = STIFF | {"expansion": 1e-5}
    mesh = block(*BRICK)
    cold = modal_basis(mesh, body(hot, free=True, modes={"count": 10})).groups[0, 0]
    even = modal_basis(mesh, body(hot, free=True, modes={"count": 10}), np.full(mesh.n_points, 793.15)).groups[0, 0]
    np.testing.assert_allclose(even.u_static, 5e-3 * mesh.points, rtol=0, atol=1e-12)
    np.testing.assert_allclose(even.omega[6:], cold.omega[6:] * np.sqrt(1.005), rtol=1e-9)
    uneven = 793.15 + 1e6 * mesh.points[:, 0] ** 3
    basis = modal_basis(mesh, body(hot, free=True, modes={"count": 10}), uneven)
    assert not [c for c in check_basis(basis) if not c.passed]


# ---------------------------------------------------------------- sector and ring


N = 6
COUNT = 10
SLOW = pytest.mark.slow


@cache
def ring_and_sector(rpm: float) -> tuple[ModalGroup, ModalBasis]:
    sector = bladed_sector("hexahedron20", N)
    at = {"axis": AXIS.tolist(), "speeds_rpm": [rpm]}
    one = modal_basis(sector, body(RUBBER, free=True, cyclic={"sectors": N}, rotation=at, modes={"count": COUNT}))
    whole = modal_basis(full_ring(sector, N).mesh, body(RUBBER, free=True, rotation=at, modes={"count": 44}))
    assert not [c for b in (one, whole) for c in check_basis(b) if not c.passed]
    return whole.groups[0, 0], one


@pytest.mark.parametrize("rpm", [0.0, pytest.param(600.0, marks=pytest.mark.slow)])
def test_a_free_sector_is_its_free_ring_at_every_nodal_diameter(rpm: float) -> None:
    """Rubber at 600 rpm, a third stiffer than at rest: frequencies to 1e-9, rigid motions at 0 and 1 alone, and what
    they meet; with gyroscopic coupling, in one space of modes, to 1e-8."""
    whole, one = ring_and_sector(rpm)
    groups = [one.groups[0, k] for k in range(N // 2 + 1)]
    assert [g.kind.count("rigid") for g in groups] == [2, 2, 0, 0]
    twice = [1, 2, 2, 1]
    mine = np.concatenate([np.repeat(g.omega, n) for g, n in zip(groups, twice, strict=True)])
    mine, theirs = np.sort(mine), whole.omega
    cut = cut_between(theirs, min(g.omega[-1] for g in groups))
    assert (theirs <= cut).sum() > 20
    np.testing.assert_allclose(mine[mine <= cut], theirs[theirs <= cut], rtol=1e-9)
    if not rpm:
        return
    rigid = [np.repeat(np.diag(g.K_r)[g.omega == 0].real, n) for g, n in zip(groups, twice, strict=True)]
    np.testing.assert_allclose(
        np.sort(np.concatenate(rigid)), np.sort(np.diag(whole.K_r)[:6]), rtol=0, atol=1e-9 * whole.speed**2
    )
    waves = [whirling(g, cut)[:: 3 - n] for g, n in zip(groups, twice, strict=True)]  # real ones come in pairs
    single, both = np.sort(np.concatenate(waves)), whirling(whole, cut)[::2]
    moving = both > 1.5 * whole.speed  # double roots of the rigid motions are known to the root of rounding alone
    np.testing.assert_allclose(single[moving], both[moving], rtol=1e-8)
    np.testing.assert_allclose(single[~moving], both[~moving], rtol=0, atol=1e-6 * whole.speed)


@pytest.mark.parametrize("reduction", ["rubin", *(pytest.param(r, marks=SLOW) for r in ("macneal", "craig-bampton"))])
def test_reduced_free_sectors_keep_their_rigid_motions(reduction: str) -> None:
    """Complex coordinates at k = 1: the whirl at Omega for the translation twice and the tilt once, all checks hold."""
    faces = [{"name": n, "face": f"contact_{n}", "t2": [0.0, 1.0, 0.0]} for n in ("left", "right")]
    at = {"axis": AXIS.tolist(), "speeds_rpm": [10000.0]}
    settings = body(
        free=True, cyclic={"sectors": N, "nodal_diameters": [0, 1, 2]}, rotation=at, reduction=reduction,
        interfaces=faces, modes={"count": 8},
    )  # fmt: skip
    basis = modal_basis(bladed_sector("hexahedron20", N), settings)
    assert not [c for c in check_basis(basis) if not c.passed and "ring" not in c.name]
    assert [int((basis.groups[0, k].omega == 0).sum()) for k in (0, 1, 2)] == [2, 2, 0]
    y = basis.groups[0, 1].gyroscopic
    assert y is not None and y.stable and (np.abs(y.omega / basis.groups[0, 1].speed - 1) < 1e-6).sum() == 3


def cut_between(omega: Array, highest: float) -> float:
    """A frequency inside the widest gap below the highest that all spectra reach."""
    known = omega[omega < highest]
    gaps = [(b - a, 0.5 * (a + b)) for a, b in pairwise(known[len(known) // 2 :])]
    return max(gaps)[1]


def whirling(g: ModalGroup, cut: float) -> Array:
    """|omega| of all roots within the modes below a frequency, ascending."""
    m = int((g.omega <= cut).sum())
    return np.sort(np.abs(general_modes(g.M_r[:m, :m], g.G_r[:m, :m], g.K_r[:m, :m])[0].imag))


# ---------------------------------------------------------------- closed forms


def thin_ring(h: float, n: int, elements: int, ratio: float) -> tuple[Array, Array]:
    """(2,) in-plane waves of n lobes, forward and backward, of a free ring, and its closed form.

    Inextensional: w = -v', bending E I ((w'' + w) / R^2)^2 / 2, hoop tension rho A Omega^2 R^2 on ((w' - v) / R)^2 / 2,
    and the kinetic energy in the frame that turns give, with v = cos(n theta + omega t),

        (n^2 + 1) omega^2 - 4 n Omega omega - n^2 (n^2 - 3) Omega^2 = beta n^2 (n^2 - 1)^2,   beta = E I / (rho A R^4)

    (G. H. Bryan 1890 for the split; the tension as in M. Endo and others, J. Sound Vib. 92, 1984).
    """
    E, rho, N = 2e11, 7800.0, 8
    beta = E * h**2 / 12 / rho
    speed = ratio * np.sqrt(36 * beta / 5)
    exact = n / (n**2 + 1) * (2 * speed + np.array([1, -1]) * (n**2 - 1) * np.sqrt(speed**2 + (n**2 + 1) * beta))
    mesh = disc_sector("hexahedron20", N, 1 - h / 2, 1 + h / 2, h, (elements, 1, 1))
    steel = {"density": rho, "young": E, "poisson": 0.0}
    at = {"axis": AXIS.tolist(), "speeds_rpm": [to_rpm(speed)]}
    settings = body(steel, free=True, cyclic={"sectors": N, "nodal_diameters": [n]}, rotation=at, modes={"count": 6})
    g = modal_basis(mesh, settings).groups[0, n]
    found = g.omega[:, None] * [1, -1] if g.gyroscopic is None else g.gyroscopic.omega
    found = found.ravel()
    return np.array([found[np.abs(found - e).argmin()] for e in exact]), exact


@pytest.mark.parametrize("n", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_a_spinning_free_ring_against_its_closed_form(n: int) -> None:
    """Omega equal to the first frequency at rest, which parts the waves by a factor of three: what is left is shear,
    rotary inertia and stretching, a multiple of the square of thickness over radius, four times less at half of it."""
    errors = []
    for h, elements in ((0.08, 12), (0.04, 20)):
        found, exact = thin_ring(h, n, elements, 1.0)
        errors.append(np.abs(found / exact - 1).max())
        assert errors[-1] < 0.1 * n**2 * h**2
    assert 3 < errors[0] / errors[1] < 5


@pytest.mark.parametrize("elements", [6, pytest.param(10, marks=pytest.mark.slow)])
def test_a_spinning_free_disc_against_its_closed_form(elements: int) -> None:
    """A disc without stiffness in bending, s nodal circles and n nodal diameters (H. Lamb and R. V. Southwell, Proc. R.
    Soc. A 99, 1921): W = r^n P_s(r^2) in 1/r (r sigma_r W')' - n^2 sigma_theta W / r^2 + rho omega^2 W = 0 gives

        omega^2 = Omega^2 ((n + 2 s)(n + 2 s + 2)(3 + nu) - n^2 (1 + 3 nu)) / 8,

    Omega itself of the rigid tilt (n = 1, s = 0). 0.3 mm thick on a radius of 1 m, the strain 1e-3."""
    nu, E, rho, N = 0.3, 2e11, 7800.0, 8
    speed = np.sqrt(1e-3 * E / rho)
    mesh = disc_sector("hexahedron20", N, 0.02, 1.0, 3e-4, (3, 1, elements))
    at = {"axis": AXIS.tolist(), "speeds_rpm": [to_rpm(speed)]}
    settings = body(
        {"density": rho, "young": E, "poisson": nu}, free=True, rotation=at, modes={"count": 4},
        cyclic={"sectors": N, "nodal_diameters": [0, 1, 2]},
    )  # fmt: skip
    basis = modal_basis(mesh, settings)
    tolerance = 1e-2 if elements < 10 else 3e-3
    for n, s in ((0, 1), (1, 0), (1, 1), (2, 0)):
        y = basis.groups[0, n].gyroscopic
        exact = np.sqrt(((n + 2 * s) * (n + 2 * s + 2) * (3 + nu) - n**2 * (1 + 3 * nu)) / 8)
        waves = [y.omega[y.omega > 0], -y.omega[y.omega < 0]] if n else [y.omega]
        for omega in waves:
            near = omega[np.abs(omega / speed - exact).argmin()] / speed
            assert near == pytest.approx(exact, rel=tolerance)


# ---------------------------------------------------------------- partly held, out of balance


def test_a_body_on_a_plane_keeps_the_motions_it_has() -> None:
    """Held along the axis it slides across it and turns about it: a whirl at Omega twice, a turn that nothing meets."""
    held = [{"face": "z0", "directions": "z"}]
    g = modal_basis(
        block(*BRICK), body(STIFF, free=True, supports=held, rotation=about_z(), modes={"count": 8})
    ).groups[0, 0]  # fmt: skip
    assert g.kind.count("rigid") == 3
    np.testing.assert_allclose(np.diag(g.K_r)[:3] / SPEED**2, [-1, -1, 0], rtol=0, atol=1e-12)
    assert g.gyroscopic is not None and g.gyroscopic.stable
    np.testing.assert_allclose(g.gyroscopic.omega[:3] / SPEED, [0, 1, 1], rtol=0, atol=1e-6)


def test_a_hinged_blade_flaps_as_a_rigid_one() -> None:
    """A hinge across the axis at a radius e: omega^2 = Omega^2 (1 + m e r / J) with the centre r beyond the hinge and
    the moment of inertia J about it, from the reaction of the hinge alone; the blade grows by 4e-5."""
    e, L, h = 0.1, 0.3, 0.01
    mesh = brick("hexahedron20", (6, 2, 2), (L, h, h), (e, -h / 2, -h / 2))
    line = np.flatnonzero((np.abs(mesh.points[:, 0] - e) < 1e-9) & (np.abs(mesh.points[:, 2]) < 1e-9))
    mesh = Mesh(mesh.points, mesh.cells, mesh.faces, {"hinge": line}, mesh.node_id)
    settings = body(
        STIFF, free=True, supports=[{"face": "hinge"}], rotation=about_z(), modes={"count": 4}
    )  # fmt: skip
    g = modal_basis(mesh, settings).groups[0, 0]
    assert g.kind.count("rigid") == 1
    J = L**2 / 3 + h**2 / 12
    expected = e * L / 2 / J + (L**2 / 3 - h**2 / 12) / J  # the last: the thickness turns out of the plane
    assert g.K_r[0, 0] / SPEED**2 == pytest.approx(expected, rel=4e-5)


def test_a_mesh_that_is_nearly_balanced_turns_about_its_centre_of_mass() -> None:
    """10 um off and 0.01 degrees askew: the axis goes through the centre of mass, inertia relief takes the rest, and
    the whirl stays at Omega, neutral."""
    at = about_z(point=[1e-5, 0.0, 0.0], axis=[1e-4, 1e-4, 1.0])
    basis = modal_basis(block(*BRICK), body(STIFF, free=True, rotation=at, modes={"count": 8}))
    y = basis.groups[0, 0].gyroscopic
    assert y is not None and y.stable
    assert np.linalg.norm(np.cross(basis.rotation_axis, basis.centre - basis.rotation_point)) < 1e-12
    assert (np.abs(y.omega / SPEED - 1) < 1e-5).sum() == 3
    assert not [c for c in check_basis(basis) if not c.passed]


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"rotation": about_z(point=[1e-3, 0.0, 0.0])}, r"rotation\.axis: .* 0\.001 m off"),
        ({"rotation": about_z(axis=[0.0, 0.1, 1.0])}, r"rotation\.axis: .* 5\.71 degrees"),
        ({"rotation": about_z(range_rpm=[0.0, 100.0])}, r"rotation\.range_rpm"),
        ({"rotation": about_z(prestress="linear")}, r"rotation\.prestress"),
        ({"rotation": about_z(spin_softening=False)}, r"rotation\.spin_softening"),
        ({"reduction": "massless-boundary", **TIP}, "reduction"),
        ({"reduction": "dual-craig-bampton", **TIP}, "reduction"),
        ({"loads": [{"kind": "gravity", "vector": [0.0, 0.0, -9.81]}]}, "loads"),
        ({"bolts": [{"name": "b", "face": "z1", "against": "z0", "preload": 10.0}]}, "bolts"),
    ],
)
def test_what_a_free_body_at_speed_cannot_have(change: dict, key: str) -> None:
    with pytest.raises(UserError, match=f"^{key}"):
        modal_basis(block(*BRICK), body(STIFF, **{"free": True, "rotation": about_z(), **change}))


def test_a_free_sector_needs_no_balance_and_a_held_one_is_not_free() -> None:
    """Supports that hold the ring: free = true is refused as for any body."""
    mesh = disc_sector("hexahedron20", 6, 0.05, 0.1, 0.02, (1, 1, 1))
    held = body(free=True, cyclic={"sectors": 6}, supports=[{"face": "bore"}])
    assert refused((), modal_basis, mesh, held).startswith("free: ")
