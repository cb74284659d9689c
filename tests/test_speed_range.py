"""One basis for a range of speeds: exact where it must be, its error known where it is not, at every speed inside."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import rings
from meshes import STEEL, body, brick, nearest, twisted_blade
from refusals import refused, refused_command

from microslip.basis import check_basis, read_basis, write_basis
from microslip.data import ModalBasis
from microslip.linalg import eigen
from microslip.modal.campbell import track_basis
from microslip.modal.compute import modal_basis
from microslip.modal.equilibrium import equilibrium, stiffness_slope
from microslip.modal.range_basis import (
    Interpolant,
    Settled,
    Solved,
    beyond,
    bordered,
    common_coordinates,
    hermite,
    lagrange,
    projected,
    refined,
    variable,
)
from microslip.modal.speed_range import basis_at, dense_pencil, frequencies_over, group_at
from microslip.settings.body import Rotation

BLADE = twisted_blade(n=(1, 3, 7), thickness=0.003)
TOP = 16000.0
TIP = BLADE.points[nearest(BLADE, BLADE.points[BLADE.face_points("z1")].mean(axis=0))].tolist()
MIDDLE = BLADE.points[BLADE.face_points("x1")].mean(axis=0).tolist()
PARTS = {
    "supports": [{"face": "z0"}],
    "interfaces": [{"name": "tip", "face": "z1", "t2": [1.0, 0.0, 0.0]}],
    "excitations": [{"name": "gas", "face": "x1", "pressure": True}],
    "monitors": [{"name": "end", "point": TIP}],
    "gauges": [{"name": "strain", "point": MIDDLE, "direction": [0.0, 0.0, 1.0]}],
}


@cache
def settings(kind: str = "nonlinear", reduction: str = "eigenmodes", top: float = TOP, **rotation: object):
    rotation = {"speeds_rpm": [0.0], "range_rpm": [0.0, top], "prestress": kind, **rotation}
    return body(**PARTS, rotation=rotation, modes={"count": 6, "solver": "superlu"}, reduction=reduction)


@cache
def ranged(kind: str = "nonlinear", reduction: str = "eigenmodes", **rotation: object) -> ModalBasis:
    return modal_basis(BLADE, settings(kind, reduction, **rotation))


@cache
def solved(rpm: float, kind: str = "nonlinear", reduction: str = "eigenmodes"):
    """The body solved for at one speed: the truth."""
    at = body(
        **PARTS, rotation={"speeds_rpm": [rpm], "prestress": kind}, modes={"count": 6, "solver": "superlu"},
        reduction=reduction,
    )  # fmt: skip
    return modal_basis(BLADE, at).groups[0, 0]


def frequency_error(basis: ModalBasis, rpm: float, kind: str = "nonlinear") -> float:
    return float(np.abs(group_at(basis, rpm).omega[:6] / solved(rpm, kind).omega[:6] - 1).max())


# interpolation -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shift", [None, 2.0e5])
def test_lagrange_reproduces_polynomials_of_its_variable(shift: float | None) -> None:
    samples = np.array([0.0, 310.0, 777.0, 1000.0])
    for speed in (0.0, 55.5, 777.0, 940.0):
        w = lagrange(samples, speed, shift)
        for power in range(4):
            values = variable(samples, shift) ** power
            exact = float(variable(speed, shift)) ** power
            assert w @ values == pytest.approx(exact, rel=0, abs=1e-13 * values.max())


def test_the_root_keeps_definiteness_and_commuting_families_exact() -> None:
    """Diagonal K = B (Omega^2 + a): the roots are straight lines in sqrt(Omega^2 + a)."""
    speeds, a = np.array([0.0, 400.0]), 3e4
    K = np.array([np.diag([1.0, 7.0, 30.0]) * (s**2 + a) for s in speeds])
    found = Interpolant(speeds, K, np.zeros((0, 3, 3)), "root", a).stiffness(123.0)
    np.testing.assert_allclose(found, np.diag([1.0, 7.0, 30.0]) * (123.0**2 + a), rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("shift", [None, 2.0e5])
def test_hermite_reproduces_polynomials_of_twice_the_degree(shift: float | None) -> None:
    samples = np.array([0.0, 400.0, 1000.0])
    for speed in (0.0, 55.5, 400.0, 940.0):
        w, v = hermite(samples, speed, shift)
        for power in range(6):
            t, along = variable(samples, shift), 1.0 if shift is None else 1 / (2 * variable(samples, shift))
            values, slopes = t**power, power * t ** max(power - 1, 0) * along
            assert w @ values + v @ slopes == pytest.approx(
                float(variable(speed, shift)) ** power, abs=1e-12 * values.max()
            )


def test_slopes_of_the_root_are_its_derivative() -> None:
    """Two samples with slopes against a cubic family's own root in between: fourth order in their distance."""
    K0, K1, K2 = (random_hermitian(8, s, 1.0, 50.0) for s in (4, 5, 6))
    errors = []
    for width in (40.0, 20.0):
        s = np.array([100.0 - width, 100.0 + width])
        x = (s / 100) ** 2
        K = K0 + x[:, None, None] * K1 + x[:, None, None] ** 3 * K2
        slopes = (K1 + 3 * x[:, None, None] ** 2 * K2) / 1e4
        found = Interpolant(s, K, slopes, "root", 3e3).stiffness(100.0)
        errors.append(np.abs(found - (K0 + K1 + K2)).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.5)


# the builder on small matrices, complex ones too -------------------------------------------------------------------


def family(stiffness, count: int, tolerance: float = 1e-4, top: float = 100.0):
    """`common_coordinates` of K(Omega^2) given as a function of x in [0, 1], all modes solved for densely."""

    def settle(speed, weights):
        return Settled(speed, dense_pencil(stiffness((speed / top) ** 2)), None)

    def solve(settled):
        values, vectors = np.linalg.eigh(settled.pencil.K(np.eye(settled.pencil.n)))
        return Solved(vectors[:, : count + 4], float(values[0]), None)

    return common_coordinates(settle, solve, 0.0, top, count, tolerance)


def random_hermitian(n: int, seed: int, low: float, high: float) -> np.ndarray:
    rng = np.random.default_rng(seed)
    Q = np.linalg.qr(rng.normal(size=(n, n)) + 1j * rng.normal(size=(n, n)))[0]
    return (Q * np.geomspace(low, high, n)) @ Q.conj().T


def test_complex_hermitian_family_meets_its_tolerance_at_every_speed() -> None:
    """A family with crossings and veerings in its band; nothing in it is real, nothing is matched mode by mode."""
    K0, K1, K2 = (random_hermitian(40, s, lo, hi) for s, lo, hi in ((1, 1.0, 1e4), (2, 0.1, 20.0), (3, 0.01, 2.0)))

    def stiffness(x: float) -> np.ndarray:
        return K0 + x * K1 + 5 * K2 / (1.4 + x)

    found = family(stiffness, 5)
    assert max(h.total for h in found.held_out) <= 1e-4 and len(found.held_out) >= 2
    assert not set(found.interpolant().samples) & {h.speed for h in found.held_out}
    assert np.iscomplexobj(found.V) and found.orthogonality < 1e-12
    for speed in np.linspace(0, 100, 23):
        K = found.interpolant().stiffness(speed)
        true = np.linalg.eigvalsh(stiffness((speed / 100) ** 2))[:5]
        assert np.abs(np.sqrt(np.linalg.eigvalsh(K)[:5] / true) - 1).max() < 3e-4  # between the held-out speeds


def test_a_mode_that_the_samples_do_not_know_is_noticed() -> None:
    """One mode is high at the three speeds solved first and dives into the band beside them: the count tells."""
    rest = np.geomspace(1.0, 1e3, 30)
    start = family(lambda x: np.diag(np.concatenate([rest, [2e3]])), 3)
    dive = (start.held_out[1].speed / 100) ** 2 + 0.02

    def stiffness(x: float) -> np.ndarray:
        return np.diag(np.concatenate([rest, [1.1 + 200 * (x - dive) ** 2]]))

    for speed in start.solved:
        diagonal = np.diag(stiffness((speed / 100) ** 2))
        assert np.sort(diagonal)[6] < diagonal[-1]  # not among the seven modes solved for
    found = family(stiffness, 3)
    assert len(start.solved) == 3 and len(found.solved) > 3
    at = 100 * np.sqrt(dive)
    K = found.interpolant().stiffness(at)
    np.testing.assert_allclose(np.linalg.eigvalsh(K)[:3], np.linalg.eigvalsh(stiffness(dive))[:3], rtol=3e-4)


def held_out(seed: int, noise: float) -> tuple[Settled, np.ndarray, np.ndarray]:
    """A complex Hermitian body, its eigenvalues, and coordinates near its seven lowest modes."""
    K = random_hermitian(60, seed, 1.0, 1e4)
    values, Q = np.linalg.eigh(K)
    rng = np.random.default_rng(seed)
    near = Q[:, :7] + noise * (rng.normal(size=(60, 7)) + 1j * rng.normal(size=(60, 7))) / np.sqrt(120)
    return Settled(50.0, dense_pencil(K), None), values, np.linalg.qr(near)[0]


@pytest.mark.parametrize("noise", [1e-6, 1e-3, 3e-2])
def test_refined_modes_are_those_of_the_speed(noise: float) -> None:
    """From good, fair and poor coordinates: frequencies within the tolerance, modes to its root."""
    held, values, V = held_out(11, noise)
    found = refined(held, V, projected(held.pencil.K, V), 3, 1e-5)
    assert found is not None and found.shapes.shape == (60, 7)
    np.testing.assert_allclose(found.frequencies, np.sqrt(values[:3]), rtol=1e-5)
    X = found.shapes[:, :3]
    np.testing.assert_allclose(X.conj().T @ X, np.eye(3), atol=1e-10)
    residual = held.pencil.K(X) - X * found.frequencies**2
    assert np.linalg.norm(residual, axis=0).max() < 0.1 * values[0]


def test_a_mode_outside_the_coordinates_is_counted() -> None:
    """V orthogonal to the second mode, in exact invariance: no residual points to it, the inertia count does."""
    held, values, _ = held_out(12, 0.0)
    Q = np.linalg.eigh(held.pencil.K(np.eye(60)))[1]
    V = np.delete(Q[:, :8], 1, axis=1)
    assert refined(held, V, projected(held.pencil.K, V), 3, 1e-5) is None


def test_widening_borders_what_is_projected() -> None:
    """K_r on [V, W] from K_r on V; W orthonormal, orthogonal to V, and nothing of it lost but what V holds."""
    held, _, V = held_out(13, 0.3)
    rng = np.random.default_rng(5)
    more = np.hstack([rng.normal(size=(60, 3)), V[:, :2] + 1e-9 * rng.normal(size=(60, 2))])
    W = beyond(V, more / np.linalg.norm(more, axis=0), held.pencil.M)
    assert W.shape == (60, 3)
    both = np.hstack([V, W])
    np.testing.assert_allclose(both.conj().T @ both, np.eye(10), atol=1e-12)
    K_r = bordered(projected(held.pencil.K, V), held.pencil.K, V, W)
    np.testing.assert_allclose(K_r, projected(held.pencil.K, both), atol=1e-9)
    assert np.linalg.norm(more - both @ (both.conj().T @ more), axis=0).max() < 1e-7


# bodies ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["none", "linear"])
def test_without_and_with_linear_prestress_the_interpolation_is_exact(kind: str) -> None:
    """K is affine, or quadratic, in Omega^2: three samples hold it. The projection error is all there is."""
    top = 3000.0 if kind == "none" else TOP
    r = ranged(kind, top=top).ranges[0]
    assert r.form == "stiffness" and r.shift is None
    assert r.interpolation_error.max() < 1e-7  # rounding: |K_r| is some 1e8 times the lowest eigenvalue
    for rpm in (0.31 * top, 0.87 * top):
        assert frequency_error(ranged(kind, top=top), rpm, kind) < r.tolerance


@pytest.mark.parametrize("rpm", [0.0, 9000.0])
def test_the_slope_of_the_stiffness_is_that_of_the_equilibria(rpm: float) -> None:
    """dK/dOmega^2 and du/dOmega^2 against differences of equilibria at two neighbouring speeds."""
    from test_rotation import model_of

    model, solver = model_of(BLADE, body(supports=[{"face": "z0"}])), eigen.new_solver("superlu")
    speed, h = rpm * np.pi / 30, 30.0**2
    state = equilibrium(model, speed, "nonlinear", solver)
    du, dK = stiffness_slope(model, state, solver, fresh=True)
    anew = stiffness_slope(model, state, solver)
    np.testing.assert_allclose(anew[1], dK, atol=1e-6 * np.abs(dK).max())
    offsets = (h, 2 * h) if rpm == 0 else (-h, h)  # one-sided at rest
    ends = [equilibrium(model, np.sqrt(speed**2 + o), "nonlinear", solver) for o in offsets]
    if rpm == 0:
        u, K = ((4 * getattr(ends[0], k) - getattr(ends[1], k) - 3 * getattr(state, k)) / (2 * h) for k in "uK")
    else:
        u, K = ((getattr(ends[1], k) - getattr(ends[0], k)) / (2 * h) for k in "uK")
    assert np.abs(u - du).max() < 1e-4 * np.abs(du).max()
    assert np.abs(K - dK).max() < 1e-4 * np.abs(dK).max()


def test_estimate_at_held_out_speeds_is_the_true_error() -> None:
    """Total error at held-out speeds against bodies solved for there, and not far below it at speeds between."""
    basis = ranged()
    r = basis.ranges[0]
    assert r.form == "root" and (r.total_error <= r.tolerance).all() and len(r.held_out) >= 2
    for speed, estimate in zip(r.held_out, r.total_error, strict=True):
        true = frequency_error(basis, speed * 30 / np.pi)
        assert true == pytest.approx(estimate, rel=0.05, abs=1e-8)
    between = [frequency_error(basis, rpm) for rpm in np.linspace(0.05, 0.95, 7) * TOP]
    assert max(between) < 3 * r.total_error.max()


def test_projection_estimate_is_the_true_projection_error() -> None:
    """With a tolerance that three solved speeds meet by projection: the residuals tell the error that is left."""
    r = ranged(range_tolerance=1e-2).ranges[0]
    basis = ranged(range_tolerance=1e-2)
    speed, estimate = r.held_out[r.projection_error.argmax()], r.projection_error.max()
    true = frequency_error(basis, speed * 30 / np.pi)
    assert abs(true - r.total_error[r.projection_error.argmax()]) < 0.05 * estimate + 1e-8


def test_modes_veer_inside_the_range() -> None:
    """A thin blade whose second flap mode runs into its first torsion: curves that turn away with exchanged shapes.

    The frequencies hold at the speed of the smallest gap as elsewhere.
    """
    mesh = twisted_blade(n=(1, 3, 7), thickness=0.002)
    what = {"supports": [{"face": "z0"}], "modes": {"count": 5, "solver": "superlu"}}
    basis = modal_basis(mesh, body(**what, rotation={"range_rpm": [0.0, 24000.0]}))
    r = basis.ranges[0]
    omega, modes = frequencies_over(r, np.linspace(0, 24000, 97) * np.pi / 30)
    gap = omega[:, 2] / omega[:, 1] - 1
    at = int(gap.argmin())
    assert 0 < at < 96 and 0 < gap[at] < 0.3 * min(gap[0], gap[-1])
    overlap = np.abs(modes[0].conj().T @ modes[-1])[1:3, 1:3]
    assert overlap[0, 1] > overlap[0, 0] and overlap[1, 0] > overlap[1, 1]
    rpm = 250.0 * at
    true = modal_basis(mesh, body(**what, rotation={"speeds_rpm": [rpm]})).groups[0, 0]
    np.testing.assert_allclose(group_at(basis, rpm).omega, true.omega[:5], rtol=2 * r.tolerance)


def test_the_group_at_an_end_is_that_without_a_range() -> None:
    """An end that is a station too is solved for once, with modes to spare for the range: they are left out again."""
    got, true = ranged(reduction="rubin").groups[0, 0], solved(0.0, reduction="rubin")
    assert got.checks["certified"] == true.checks["certified"] == 1
    assert got.checks["count_below_upper_shift"] == true.checks["count_below_upper_shift"]
    assert got.checks["upper_shift_hz"] == pytest.approx(true.checks["upper_shift_hz"], rel=1e-6)
    np.testing.assert_allclose(got.omega, true.omega, rtol=1e-7)
    tip = [g.interfaces["tip"].rows for g in (got, true)]
    np.testing.assert_allclose(*tip, atol=1e-6 * np.abs(tip[1]).max())


@pytest.mark.parametrize("rpm", [4000.0, 16000.0])
def test_factors_kept_lead_newton_to_the_same_equilibrium(rpm: float, monkeypatch) -> None:
    """From a neighbouring state: with a factorisation in every step, and with those that serve more than one."""
    from test_rotation import model_of

    from microslip.modal import equilibrium as newton

    model, solver = model_of(BLADE, body(supports=[{"face": "z0"}])), eigen.new_solver("superlu")
    near = equilibrium(model, 0.99 * rpm * np.pi / 30, "nonlinear", solver)
    counts, states = [], []
    for rule in (newton._factors_serve, lambda steps: False):
        monkeypatch.setattr(newton, "_factors_serve", rule)
        made: list[int] = []
        factorise = solver.factorise
        monkeypatch.setattr(solver, "factorise", lambda K, f=factorise, made=made: (made.append(1), f(K))[1])
        states.append(equilibrium(model, rpm * np.pi / 30, "nonlinear", solver, near))
        monkeypatch.setattr(solver, "factorise", factorise)
        counts.append(len(made))
    assert counts[0] < counts[1]
    assert np.abs(states[0].u - states[1].u).max() < 3e-9 * np.abs(states[1].u).max()
    assert np.abs(states[0].K - states[1].K).max() < 1e-8 * np.abs(states[1].K).max()


@pytest.mark.parametrize(("reduction", "compliance"), [("macneal", 1e-6), ("eigenmodes", 2e-3)])
def test_at_a_solved_speed_the_range_gives_what_was_solved_for(reduction: str, compliance: float) -> None:
    """Frequencies, rows with their signs, static state, gauges, compliance, Coriolis: to rounding of the root.

    For eigenmodes alone the speed between is refined from the ends; what they leave of the compliance is a straight
    line there.
    """
    basis = ranged(reduction=reduction)
    r = basis.ranges[0]
    rpm = float(r.speeds[r.solved][1] * 30 / np.pi)  # between the ends
    got, true = group_at(basis, rpm), solved(rpm)
    np.testing.assert_allclose(got.omega, true.omega[:6], rtol=1e-7)
    np.testing.assert_allclose(got.u_static, true.u_static, atol=1e-8 * np.abs(true.u_static).max())
    read = (("interfaces", "tip"), ("monitors", "end"), ("excitations", "gas"), ("gauges", "strain"))
    for kind, name in read:
        a, b = (getattr(g, kind)[name].rows for g in (got, true))
        np.testing.assert_allclose(a, b[:, :6], atol=1e-5 * np.abs(b).max())
    for kind in ("monitors", "gauges"):
        for name, b in getattr(true, kind).items():
            np.testing.assert_allclose(getattr(got, kind)[name].static, b.static, rtol=1e-6)
    size = np.sqrt(np.diag(true.compliance.static))
    left = (got.compliance.static - true.compliance.static) / np.outer(size, size)
    assert np.abs(left).max() < compliance
    np.testing.assert_allclose(got.G_r, true.G_r[:6, :6], atol=1e-5 * np.abs(true.G_r).max())
    np.testing.assert_allclose(got.phi, true.phi[:, :, :6], atol=1e-5 * np.abs(true.phi).max())


@pytest.mark.slow
def test_rubin_is_statically_exact_at_held_out_speeds() -> None:
    """The static answers of solved speeds span those between; what is left falls with the tolerance of the range."""
    errors = []
    for tolerance in (1e-4, 1e-6):
        basis = ranged(reduction="rubin", range_tolerance=tolerance)
        rpm = float(basis.ranges[0].held_out[0] * 30 / np.pi)
        got, true = group_at(basis, rpm), solved(rpm, reduction="rubin")
        assert got.kind.count("attachment") == true.kind.count("attachment") == 7
        exact = [i for i, label in enumerate(got.compliance.labels) if not label.startswith("monitor")]
        held, static = (c[np.ix_(exact, exact)] for c in (got.compliance.modal, true.compliance.static))
        d = np.sqrt(np.diag(static))
        errors.append(np.abs((held - static) / np.outer(d, d)).max())
        np.testing.assert_allclose(held, got.compliance.static[np.ix_(exact, exact)], atol=1e-9 * held.max())
    assert errors[0] < 20 * 1e-4 and errors[1] < 20 * 1e-6  # a compliance errs twice as much as a frequency, and more


def test_craig_bampton_keeps_interface_coordinates_at_every_speed() -> None:
    basis = ranged(reduction="craig-bampton")
    got = group_at(basis, 0.6 * TOP)
    true = solved(0.6 * TOP, reduction="craig-bampton")
    assert got.kind[:6] == ("interface",) * 6
    np.testing.assert_allclose(got.interfaces["tip"].rows[:, :6], np.eye(6), atol=1e-8)
    np.testing.assert_allclose(got.omega[:4], true.omega[:4], rtol=2e-3)  # different spans, each an upper bound
    np.testing.assert_allclose(np.diag(got.K_r)[:6], np.diag(true.K_r)[:6], rtol=2e-3)


def test_stress_modes_between_the_samples() -> None:
    """Strain and stress of the modes and of the static state at a speed that is no sample, from the file alone."""
    rpm = 0.45 * TOP
    output = {"gauss": False, "nodal_stress": True}
    base = {**PARTS, "modes": {"count": 3, "solver": "superlu"}, "output": output}
    mesh = twisted_blade(n=(1, 2, 4), thickness=0.003)
    base["interfaces"] = base["excitations"] = base["monitors"] = base["gauges"] = ()
    turning = {"speeds_rpm": [0.0], "range_rpm": [0.0, TOP], "range_stress": True}
    basis = modal_basis(mesh, body(**base, rotation=turning))
    got = group_at(basis, rpm).stresses["nodes"]
    true = modal_basis(mesh, body(**base, rotation={"speeds_rpm": [rpm]})).groups[0, 0].stresses["nodes"]
    assert np.abs(got.stress - true.stress[..., :3]).max() < 2e-3 * np.abs(true.stress).max()
    assert np.abs(got.strain - true.strain[..., :3]).max() < 2e-3 * np.abs(true.strain).max()
    assert np.abs(got.static_stress - true.static_stress).max() < 5e-3 * np.abs(true.static_stress).max()


def test_rayleigh_damping_follows_the_frequency() -> None:
    with_beta = settings().model_copy(update={"damping": body(damping={"alpha": 3.0, "beta": 2e-6}).damping})
    g = group_at(modal_basis(BLADE, with_beta), 0.5 * TOP)
    np.testing.assert_allclose(g.damping_ratio, 0.5 * (3.0 / g.omega + 2e-6 * g.omega), rtol=1e-12)
    np.testing.assert_allclose(np.diag(g.C_r), 3.0 + 2e-6 * g.omega**2, rtol=1e-12)


# file and refusals -------------------------------------------------------------------------------------------------


def test_the_file_holds_the_range(tmp_path) -> None:
    """Written and read, the range gives the same numbers; every check passes; a basis of one speed can be written."""
    basis = ranged(reduction="rubin")
    write_basis(tmp_path / "basis.h5", basis)
    again = read_basis(tmp_path / "basis.h5")
    a, b = (group_at(x, 0.37 * TOP) for x in (basis, again))
    np.testing.assert_array_equal(a.omega, b.omega)
    np.testing.assert_array_equal(a.phi, b.phi)
    np.testing.assert_array_equal(a.interfaces["tip"].shapes, b.interfaces["tip"].shapes)
    assert [c for c in check_basis(again) if not c.passed] == []
    assert any(c.name.startswith("range/nd_0: frequency error") for c in check_basis(again))
    one = basis_at(again, 0.37 * TOP)
    write_basis(tmp_path / "one.h5", one)
    assert [c for c in check_basis(read_basis(tmp_path / "one.h5")) if not c.passed] == []


def test_a_speed_outside_or_a_file_without_range_is_refused() -> None:
    for rpm in (-1.0, 1.001 * TOP):
        refused("outside the speed range of 'test', 0 to 16000 rpm; ask for", group_at, ranged(), rpm)
    group_at(ranged(), TOP)
    plain = modal_basis(BLADE, body(supports=[{"face": "z0"}], modes={"count": 2}))
    refused("no speed range", group_at, plain, 100.0)


def test_the_command_line_reads_any_speed_of_the_range(tmp_path, capsys) -> None:
    from microslip.cli import main

    file = tmp_path / "basis.h5"
    write_basis(file, ranged())
    assert main(["info", str(file)]) == 0
    said = capsys.readouterr().out
    assert "one basis of" in said and "held out" in said and "modes taken from 0, " in said
    assert main(["info", str(file), "--rpm", "9000"]) == 0
    said = capsys.readouterr().out
    assert f"{group_at(ranged(), 9000.0).frequency[0]:.6g} Hz" in said
    assert "from the basis of the speed range" in said and "certified" not in said.lower()
    outside = "outside the speed range of 'test', 0 to 16000 rpm"
    refused_command(["info", str(file), "--rpm", "17000"], capsys, outside)


@pytest.mark.slow
def test_exports_at_any_speed_of_the_range(tmp_path, capsys) -> None:
    """--rpm writes the reduced body of that speed, bit for bit what `group_at` gives; at a station the station's own.

    Multibody formats take a body at rest, so they take 0 rpm and refuse another speed.
    """
    from scipy.io import loadmat, mmread

    from microslip.cli import main

    file, out = tmp_path / "basis.h5", tmp_path / "out"
    write_basis(file, ranged())
    for rpm in (0.0, 5432.1, TOP):
        g = basis_at(ranged(), rpm).groups[0, 0]
        assert g.speed == pytest.approx(rpm * np.pi / 30, rel=1e-12)
        words = ["export", str(file), "--rpm", repr(rpm), "-o"]
        assert main([*words, str(tmp_path / "a.mat"), "--to", "mat"]) == 0
        b = loadmat(tmp_path / "a.mat", struct_as_record=False, squeeze_me=True)
        assert [n for n in b if n.startswith("speed_")] == ["speed_0"] and b["speed_0"].Omega == g.speed
        for name, value in {"K": g.K_r, "G": g.G_r, "D": g.C_r, "phi": g.phi, "u_static": g.u_static}.items():
            np.testing.assert_array_equal(getattr(b["speed_0"], name), value)
        assert main([*words, str(tmp_path / "mtx"), "--to", "mtx"]) == 0
        assert [p.name for p in (tmp_path / "mtx").iterdir() if p.is_dir()] == ["speed_0"]
        np.testing.assert_array_equal(np.asarray(mmread(tmp_path / "mtx" / "speed_0" / "K_r.mtx")), g.K_r)
        for form in ("uff", "vtu", "pvd"):
            assert main([*words, str(tmp_path / f"a.{form}"), "--to", form]) == 0
    capsys.readouterr()
    for form in ("exudyn", "mbdyn", "sid"):
        assert main(["export", str(file), "--to", form, "--rpm", "0", "-o", str(tmp_path / form)]) == 0
        line = ["export", str(file), "--to", form, "--rpm", "5000", "-o", str(out)]
        refused_command(line, capsys, "a group at rest")
    for words, says in (
        (["--rpm", "17000"], "outside the speed range of 'test', 0 to 16000 rpm"),
        (["--rpm", "nan"], "outside the speed range"),
        (["--rpm", "5000", "--speed", "0"], "leave --speed out"),
        (["--rpm", "5000", "--nodal-diameter", "2"], "the file has 0"),
    ):
        assert main(["export", str(file), "--to", "mat", *words, "-o", str(out)]) == 2
        err = capsys.readouterr().err
        assert says in err and len(err.splitlines()) == 1 and not out.exists()


CASE = """
name = "test"
body = "test"
speed_rpm = {rpm}
excitation = "gas"
amplitude = 1e5
monitor = "end"
[[contacts]]
interface = "tip"
law = "jenkins"
normal_stiffness = 2e7
tangential_stiffness = 1e7
friction = 0.2
[sweep]
start = {start}
stop = {stop}
points = 60
normal_forces = [50.0]
"""


@pytest.mark.usefixtures("unjudged")
def test_a_case_responds_at_any_speed_of_the_range(tmp_path) -> None:
    """The free peak stands where the body solved for at that speed has its mode; a stored speed needs no range."""
    from microslip.case import load_case, run_case

    path, group = tmp_path / "case.toml", solved(9000.0)
    text = {"start": 0.9 * group.frequency[0], "stop": 1.1 * group.frequency[0]}
    path.write_text(CASE.format(rpm=9000.0, **text))
    found = run_case(load_case(path)[0], ranged())
    assert found.speed == pytest.approx(9000 * np.pi / 30, rel=1e-12)
    peak = found.free.frequency[np.abs(found.free.monitor).argmax()]
    assert peak == pytest.approx(group.frequency[0], rel=0.2 / 59)  # a step of the sweep
    assert abs(ranged().groups[0, 0].frequency[0] / group.frequency[0] - 1) > 0.02  # at rest it is elsewhere
    stored = run_case(load_case(path)[0], basis_at(ranged(), 9000.0))  # 9000 rpm is a speed of this file
    np.testing.assert_allclose(stored.responses[50.0].monitor, found.responses[50.0].monitor, rtol=1e-12)
    (tmp_path / "case.toml").write_text(CASE.format(rpm=17000.0, **text))
    refused("case.toml: speed_rpm: 17000 rpm", run_case, load_case(path)[0], ranged())


def test_campbell_diagram_of_the_range() -> None:
    """Fifty speeds, dots at the samples, curves that follow the shapes."""
    tracks = track_basis(ranged())
    assert tracks is not None and tracks.solved is not None
    assert len(tracks.speeds) == 50 and tracks.modes.shape == (6, 50) and np.nanmin(tracks.mac) > 0.8
    np.testing.assert_array_equal(tracks.solved, ranged().ranges[0].speeds)
    at = [group_at(ranged(), rpm).frequency[0] for rpm in (0.0, 0.5 * TOP, TOP)]
    np.testing.assert_allclose(tracks.frequency(0, np.array([0.0, 0.5, 1.0]) * TOP * np.pi / 30), at, rtol=1e-4)


def test_free_bodies_and_single_speeds_are_refused() -> None:
    free = body(STEEL, free=True, rotation={"range_rpm": [0.0, 100.0]})
    refused("rotation.range_rpm: ", modal_basis, brick("tetra10", (1, 1, 2)), free)
    for speeds in ([100.0, 100.0], [200.0, 100.0]):
        with pytest.raises(ValueError, match="the second above the first; for one speed use speeds_rpm"):
            Rotation(range_rpm=speeds)


def test_divergence_inside_the_range_names_its_key() -> None:
    """Without prestress the first frequency falls to zero: no basis for such speeds, and the key that asks for it."""
    refused(("rotation.range_rpm: at ", " negative"), modal_basis, BLADE, settings("none", top=60000.0))


# cyclic sectors ----------------------------------------------------------------------------------------------------


def test_every_nodal_diameter_of_a_sector_has_its_range(tmp_path) -> None:
    """Complex coordinates between 0 and N/2: frequencies, rows, Coriolis matrix at a speed that is no sample."""
    mesh = rings.bladed_sector("tetra10", 6)

    def of(**rotation: object):
        return body(
            supports=[{"face": "bore"}], cyclic={"sectors": 6, "nodal_diameters": [0, 1, 3]}, modes={"count": 4},
            interfaces=[{"name": "right", "face": "contact_right"}], rotation=rotation,
        )  # fmt: skip

    basis = modal_basis(mesh, of(speeds_rpm=[0.0], range_rpm=[0.0, 30000.0]))
    rpm = 17000.0
    true = modal_basis(mesh, of(speeds_rpm=[rpm]))
    assert sorted(basis.ranges) == [0, 1, 3]
    write_basis(tmp_path / "basis.h5", basis)
    again = read_basis(tmp_path / "basis.h5")
    assert [c for c in check_basis(again) if not c.passed] == []
    for k in (0, 1, 3):
        assert basis.ranges[k].total_error.max() <= 1e-4
        got, at = group_at(again, rpm, k), true.groups[0, k]
        assert np.iscomplexobj(got.phi) == (k == 1)
        np.testing.assert_allclose(got.omega, at.omega[:4], rtol=2e-4)
        rows, exact = got.interfaces["right"].rows, at.interfaces["right"].rows[:, :4]
        np.testing.assert_allclose(rows, exact, atol=2e-3 * np.abs(exact).max())
        np.testing.assert_allclose(got.G_r, at.G_r[:4, :4], atol=2e-3 * np.abs(at.G_r).max())
        np.testing.assert_allclose(got.u_static, at.u_static, atol=1e-3 * np.abs(at.u_static).max())


def test_a_range_may_end_at_a_speed_that_is_asked_for_besides() -> None:
    """Slopes of the stiffness belong to their own speed: as few samples as without it, and frequencies to 1e-4."""
    mesh = rings.bladed_sector("tetra10", 6)

    def ended(*rpm: float) -> ModalBasis:
        rotation = {"speeds_rpm": [0.0, *rpm], "range_rpm": [0.0, 20000.0]}
        held = {"supports": [{"face": "bore"}], "cyclic": {"sectors": 6, "nodal_diameters": [0, 1]}}
        return modal_basis(mesh, body(**held, modes={"count": 3}, rotation=rotation))

    alone, besides = ended(), ended(20000.0)
    for k in (0, 1):
        one, other = alone.ranges[k], besides.ranges[k]
        assert len(other.speeds) == len(one.speeds) and other.total_error.max() <= 1e-4
        assert group_at(besides, 7000.0, k).omega == pytest.approx(group_at(alone, 7000.0, k).omega, rel=1e-4)
