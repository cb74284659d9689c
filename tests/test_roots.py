"""Roots of quadratic eigenproblems: closed forms of flutter, counts against dense solutions, one basis over a range."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from closed_forms.beams import beam_element
from refusals import refused, refused_command

import microslip as ms
from microslip.basis import check_basis, read_basis, write_basis
from microslip.cli import main
from microslip.data import MatrixTerm
from microslip.linalg.parametric import Family
from microslip.linalg.quadratic import Factors, Quadratic, Window, every_root, every_value, refined, search
from microslip.linalg.sampled import sampled
from microslip.linalg.winding import missed


def random_pencil(seed: int, n: int = 12) -> Quadratic:
    """Mass positive, damping, gyroscopic and circulatory forces of any size."""
    rng = np.random.default_rng(seed)
    M, K = (A @ A.T + 0.1 * np.eye(n) for A in rng.standard_normal((2, n, n)))
    C, N = 0.2 * rng.standard_normal((2, n, n))
    return Quadratic(M, C, K + N)


def sparse_chain(n: int, seed: int = 3) -> tuple[sp.csr_matrix, ...]:
    """A chain of masses on springs with uneven damping, and a skew coupling of neighbours."""
    rng = np.random.default_rng(seed)
    K = sp.diags([-np.ones(n - 1), 2.05 * np.ones(n), -np.ones(n - 1)], (-1, 0, 1), format="csr")
    N = sp.diags([-np.ones(n - 1), np.ones(n - 1)], (-1, 1), format="csr")
    return sp.diags(rng.uniform(0.5, 1.5, n), format="csr"), sp.diags(rng.uniform(0.0, 0.02, n), format="csr"), K, N


# the count ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("first", range(0, 50, 10))
def test_the_argument_principle_counts_what_dense_eigenvalues_count(first):
    """50 random pencils and windows: without knowing a root, with all but one known, with one invented."""
    for seed in range(first, first + 10):
        Q, rng = random_pencil(seed), np.random.default_rng(1000 + seed)
        s = every_value(Q)
        top = float(np.abs(s).max())
        low = 0.0 if seed % 2 else 0.2 * rng.uniform() * top
        window = Window((float(rng.uniform(-0.3, 0.0)) * top, 0.5 * top), (low, low + 0.6 * top))
        inside = np.flatnonzero(window.holds(s))
        # a window from 0 on is counted with its mirror image: pairs once, and real roots in twos
        pairs = int((s[inside].imag > 0).sum())
        real = len(inside) - pairs
        assert missed(Q, window, np.zeros(0, dtype=complex)).missed == pairs + -(-real // 2)
        assert missed(Q, window, s).missed == 0
        if pairs:
            dropped = next(i for i in inside if s[i].imag > 0)
            assert missed(Q, window, np.delete(s, dropped)).missed == 1
        assert missed(Q, window, np.append(s, window.middle)).missed == -1


def test_roots_on_the_border_of_a_window_do_not_disturb_the_count():
    """A known root on the border, and one within a millionth of the window beside it."""
    Q = random_pencil(7)
    s = every_value(Q)
    root = s[np.argmax(s.imag)]
    for shift in (0.0, 1e-6, -1e-6):
        window = Window((root.real + shift, root.real + 5.0), (0.5 * root.imag, 2 * root.imag))
        found = missed(Q, window, s)
        assert found.missed == 0 and abs(found.turns) < 1e-6


def test_log_determinants_of_sparse_and_dense_factors_agree():
    """Modulus and phase, permutations of rows and columns counted."""
    rng = np.random.default_rng(5)
    for n in (5, 20, 41):
        A = rng.standard_normal((n, n)) + 1j * rng.standard_normal((n, n))
        sign, size = np.linalg.slogdet(A)
        for B in (A, sp.csr_matrix(A)):
            found = Factors(B).log_determinant()
            assert found.real == pytest.approx(size, rel=1e-10)
            assert np.exp(1j * found.imag) == pytest.approx(sign, abs=1e-10)


# the search -----------------------------------------------------------------------------------------------------------


def test_shift_invert_arnoldi_finds_all_roots_of_a_window_that_needs_several_shifts():
    M, C, K, N = sparse_chain(200)
    Q = Quadratic(M, C, sp.csr_matrix(K + 0.05 * N))
    window = Window((-0.1, 0.1), (0.3, 2.5))
    found = search(Q, window)
    exact = every_value(Quadratic(*(A.toarray() for A in (Q.M, Q.C, Q.K))))
    exact = np.sort_complex(exact[window.holds(exact)])
    inside = window.holds(found.s)
    assert found.shifts > 1 and inside.sum() == len(exact)
    roots = refined(Q, found.s[inside], found.x[:, inside])
    assert np.abs(np.sort_complex(roots.s) - exact).max() < 1e-11
    assert roots.backward_error.max() < 1e-15
    for s, y in zip(roots.s, roots.y.T, strict=True):
        assert np.abs(y.conj() @ Q.at(s)).max() < 1e-12  # left vectors


def test_double_roots_are_found_twice():
    """Two equal chains without coupling: every root twice."""
    M, C, K, N = (sp.block_diag([A, A], format="csr") for A in sparse_chain(40))
    window = Window((-0.1, 0.1), (0.3, 1.2))
    Q = Quadratic(M, C, sp.csr_matrix(K + 0.05 * N))
    found = search(Q, window)
    inside = window.holds(found.s)
    roots = refined(Q, found.s[inside], found.x[:, inside])
    assert missed(Q, window, np.concatenate([roots.s, found.s[~inside]])).missed == 0
    assert np.abs(roots.s[::2] - roots.s[1::2]).max() < 1e-10


def test_massless_coordinates_bring_no_roots():
    """A singular mass matrix: the infinite roots are left out."""
    Q = Quadratic(np.diag([1.0, 0.0]), np.zeros((2, 2)), np.array([[3.0, -1.0], [-1.0, 1.0]]))
    assert every_root(Q).s == pytest.approx([1j * np.sqrt(2)])


# closed forms ---------------------------------------------------------------------------------------------------------


def ziegler(P: float, damping: float = 0.0) -> tuple:
    """Ziegler's double pendulum under a follower force: masses 2 and 1, springs, dampers and rods of one."""
    K = np.array([[2 - P, P - 1], [-1.0, 1.0]])
    return np.array([[3.0, 1.0], [1.0, 1.0]]), damping * np.array([[2.0, -1.0], [-1.0, 1.0]]), K


@pytest.mark.parametrize(("damping", "critical"), [(0.0, 3.5 - np.sqrt(2)), (1e-3, 41 / 28 + 0.5e-6)])
def test_zieglers_pendulum_flutters_from_its_critical_force_on(damping, critical):
    """Ziegler 1952: 7/2 - sqrt 2 without damping, 41/28 + b^2/2 with a little of it, his paradox."""
    for share, verdicts in ((1 - 1e-4, {"neutral", "stable"}), (1 + 1e-4, {"unstable", "stable", "neutral"})):
        found = ms.stability(ziegler(share * critical, damping))
        assert set(found.verdict) <= verdicts
        assert ("unstable" in found.verdict) == (share > 1)


def beck(P: float, elements: int = 8) -> tuple:
    """A cantilever with a tangential force at its end, E I, mass and length one, by Hermite's beam elements."""
    h, n = 1 / elements, 2 * elements + 2
    k, m = beam_element(h)
    g = np.array([[36, 3 * h, -36, 3 * h], [3 * h, 4 * h**2, -3 * h, -(h**2)],
                  [-36, -3 * h, 36, -3 * h], [3 * h, -(h**2), -3 * h, 4 * h**2]]) / (30 * h)  # fmt: skip
    K, M = np.zeros((n, n)), np.zeros((n, n))
    for e in range(elements):
        at = np.ix_(range(2 * e, 2 * e + 4), range(2 * e, 2 * e + 4))
        K[at] += k - P * g
        M[at] += m
    K[-2, -1] += P  # the force turns with the end
    return M[2:, 2:], np.zeros((n - 2, n - 2)), K[2:, 2:]


def test_becks_column_flutters_at_20_05():
    """Beck 1952: P = 20.05 E I / l^2, at the circular frequency 11.02 sqrt(E I / mu l^4)."""
    assert "unstable" not in ms.stability(beck(20.03), frequency=(0.0, 10.0)).verdict
    found = ms.stability(beck(20.07), frequency=(0.0, 10.0))
    assert found.verdict.count("unstable") == 1
    at = found.verdict.index("unstable")
    assert 2 * np.pi * found.frequency[at] == pytest.approx(11.02, abs=0.02)


def rotor(external: float, internal: float) -> Family:
    """Jeffcott's rotor of mass and stiffness one: internal damping is circulatory, and grows with the speed."""
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
    return Family(
        (
            MatrixTerm("mass", np.eye(2)),
            MatrixTerm("damping", (external + internal) * np.eye(2)),
            MatrixTerm("stiffness", np.eye(2)),
            MatrixTerm("circulatory", internal * turn, "speed", 1.0),
        )
    )


def test_internal_damping_makes_a_rotor_whirl_above_its_critical_speed():
    """z'' + (d_e + d_i) z' + (1 - i Omega d_i) z = 0 grows from Omega = 1 + d_e / d_i on (Smith 1933)."""
    external, internal = 0.02, 0.05
    onset, speeds = 1 + external / internal, np.linspace(0.5, 3.0, 26)
    found = ms.stability(rotor(external, internal), over="speed", values=speeds)
    assert (found.unstable == (speeds > onset)).all()
    d = external + internal
    for speed, s in zip(speeds, found.s, strict=True):
        z = np.concatenate([np.roots([1, d, 1 - 1j * w * speed * internal]) for w in (1, -1)])
        exact = z[z.imag > 0]
        assert np.sort_complex(s) == pytest.approx(np.sort_complex(exact), rel=1e-12)
    assert found.branches.shape == (2, 26) and "1 from 1.5" in repr(found)


def test_an_undamped_structure_is_neutral_and_not_unstable():
    """Rounding gives the roots of a symmetric pencil real parts of either sign."""
    M, _, K, _ = sparse_chain(12)
    found = ms.stability((M, 0 * K, K))
    assert set(found.verdict) == {"neutral"} and len(found.roots) == 12


def test_a_growth_rate_that_the_data_do_not_decide_is_neutral():
    """The standard deviation of a growth rate under random changes of all entries, first order against sampling."""
    M, C, K = (np.asarray(A.todense()) if sp.issparse(A) else A for A in ziegler(1.6, 0.05))
    Q, rng, size = Quadratic(M, C, K), np.random.default_rng(4), 1e-6
    roots = every_root(Q)
    seen = [
        every_root(Quadratic(*(A * (1 + size * rng.standard_normal(A.shape)) for A in (M, C, K)))).s.real
        for _ in range(400)
    ]
    order = np.argsort(roots.s.imag)
    assert np.std(seen, axis=0) == pytest.approx(size * roots.spread[order], rel=0.15)
    loose = ms.stability((M, C, K), accuracy=0.1)
    assert "neutral" in loose.verdict and "neutral" not in ms.stability((M, C, K)).verdict


# one basis over a range -----------------------------------------------------------------------------------------------


def chain_family(n: int = 320) -> Family:
    """The chain with a skew coupling that grows with the speed, and damping that falls with it."""
    M, C, K, N = sparse_chain(n)
    return Family(
        (
            MatrixTerm("mass", M),
            MatrixTerm("damping", C, "speed", -1.0),
            MatrixTerm("stiffness", K),
            MatrixTerm("circulatory", 1e-3 * N, "speed", 1.0),
        )
    )


def test_one_basis_gives_the_roots_over_a_range():
    """At speeds that it was not made from, against all roots of the full matrices; the estimate is no smaller."""
    family, window = chain_family(), Window((-0.1, 0.1), (0.2, 0.3))
    basis = sampled(family, "speed", 1.0, 4.0, window, tolerance=1e-6)
    assert basis.held_out_error[-1] <= 1e-6 and basis.V.shape[1] < 220
    for speed in (1.1, 1.9, 3.1, 3.9):
        exact = every_value(Quadratic(*(A.toarray() for A in vars(family.at({"speed": speed})).values())))
        exact = exact[window.holds(exact)]
        s, error, _ = basis.at(speed)
        assert len(s) == len(exact)
        away = np.abs(s - exact[np.argsort(exact.imag)])
        assert (away / np.abs(s)).max() < 1e-7 and (away <= error + 1e-13).all()


# through the package's door -------------------------------------------------------------------------------------------


def body_file(folder, extra: str = "", **changes):
    """A body.toml of a chain of 30 masses: files as NumPy and SciPy write them."""
    M, C, K, N = sparse_chain(30)
    files = {"M": M, "C": C, "K": K, "N": sp.csr_matrix(N + 0.3 * sp.eye(30))} | changes
    parts = {}
    for name, A in files.items():
        A = sp.csr_matrix(A)
        parts |= {f"{name}_data": A.data, f"{name}_indices": A.indices, f"{name}_indptr": A.indptr}
        parts[f"{name}_shape"] = np.array(A.shape)
    np.savez(folder / "chain.npz", **parts)
    text = """
name = "chain"
length_unit = "m"
[geometry.matrices]
stiffness = "chain.npz#K"
mass = "chain.npz#M"
damping = "chain.npz#C"
[[parameters]]
role = "circulatory"
matrix = "chain.npz#N"
factor = 0.01
power = -1
[rotation]
speeds_rpm = [19.098593171027440]
[modes]
count = 30
solver = "superlu"
[stability]
growth = [-1.0, 1.0]
frequency = [0.0, 1.0]
"""
    (folder / "body.toml").write_text(text + extra, encoding="utf-8")
    return folder / "body.toml"


def test_the_modal_file_of_all_modes_has_the_roots_of_the_matrices(tmp_path, monkeypatch, capsys):
    """N_r is written, read and checked; its roots are those of M, C, K and N at 2 rad/s."""
    monkeypatch.chdir(tmp_path)
    path = body_file(tmp_path, "range = [1.0, 3.0]\npoints = 5\n")
    assert main(["stability", str(path), "-q"]) == 0
    assert main(["modes", str(path), "-q"]) == 0
    basis = read_basis("build/chain/basis.h5")
    assert all(c.passed for c in check_basis(basis))
    g = basis.groups[(0, 0)]
    assert g.N_r is not None and np.abs(g.N_r + g.N_r.T).max() > 1e-4  # of any symmetry
    M, C, K, N = sparse_chain(30)
    full = ms.stability((M, C, K + 0.01 / 2 * (N + 0.3 * sp.eye(30))))
    reduced = ms.stability(basis)
    assert reduced.roots.s == pytest.approx(full.roots.s, rel=1e-9)
    assert ms.stability(path).roots.s == pytest.approx(full.roots.s, rel=1e-9)
    write_basis(tmp_path / "again.h5", basis)
    assert np.array_equal(read_basis(tmp_path / "again.h5").groups[(0, 0)].N_r, g.N_r)
    page = (tmp_path / "build/chain/stability.html").read_text(encoding="utf-8")
    assert full.sentence.split(";")[0].capitalize() in page
    with h5py.File("build/chain/stability.h5") as file:
        assert file["roots/s"][:] + 1j * file["roots/s_imag"][:] == pytest.approx(full.roots.s, rel=1e-9)
    assert main(["stability", "build/chain/basis.h5", "--no-pictures"]) == 0
    assert "of 30 roots grow" in capsys.readouterr().out


def test_the_harmonic_balance_takes_circulatory_forces_and_motions_in_time_refuse_them():
    """The response of a linear structure against its matrices; energy is balanced by the circulatory work."""
    from dataclasses import replace

    built = ms.structure(np.eye(2), np.array([[2.0, -1.0], [-1.0, 2.0]]), 0.05 * np.eye(2), force={0: 1.0}, output=1)
    body = built.components[0]
    N = np.array([[0.0, 0.04], [-0.04, 0.01]])
    sliding = replace(built, components=(replace(body, groups={0: replace(body.groups[0], N_r=N)}),))
    hertz = np.array([0.1, 0.2, 0.3])
    found = ms.harmonic_response(sliding, hertz)
    for f, amplitude in zip(found.frequency, found.harmonics()[:, 1], strict=True):
        w = 2 * np.pi * f
        Z = np.array([[2.0, -1.0], [-1.0, 2.0]]) + N + 0.05j * w * np.eye(2) - w**2 * np.eye(2)
        assert amplitude == pytest.approx(np.linalg.solve(Z, [1, 0])[1], rel=1e-8)
    assert found.converged.all()  # each point carries its energy balance
    refused("circulatory", ms.integrate, sliding, 0.2, unit="Hz")


@pytest.mark.parametrize(
    ("extra", "assignment", "key"),
    [
        ("", "stability.growth=[1.0, -1.0]", "growth"),
        ("", "stability.frequency=[0.5, 0.5]", "frequency"),
        ("", "rotation.speeds_rpm=[0.0]", "speed"),
        ("range = [0.0, 3.0]\n", "name=x", "speed"),
        ('range = [1.0, 3.0]\nover = "load"\n', "name=x", "load"),
        ("", "values={load = 2.0}", "values.load"),
        ("", 'geometry.matrices.circulatory="chain.npz#X"', "X"),
        ("", 'geometry.matrices.stiffness="chain.npz#N"', "circulatory"),
    ],
)
def test_what_cannot_be_meant_is_refused_in_one_sentence(tmp_path, monkeypatch, capsys, extra, assignment, key):
    monkeypatch.chdir(tmp_path)
    asymmetric = sparse_chain(30)[3] + sp.diags(np.ones(29), 1)
    path = body_file(tmp_path, extra, N=asymmetric)
    assert main(["stability", str(path), "-q", "--set", assignment]) == 2
    error = capsys.readouterr().err
    assert key in error and error.count("\n") == 1 and not (tmp_path / "build/chain/stability.json").exists()


@pytest.mark.parametrize("damage", ["size", "nan", "text"])
def test_damaged_matrices_are_refused(tmp_path, monkeypatch, capsys, damage):
    monkeypatch.chdir(tmp_path)
    changes = {"size": {"C": sp.eye(29)}, "nan": {"C": sp.eye(30) * np.nan}, "text": {}}[damage]
    path = body_file(tmp_path, **changes)
    if damage == "text":
        (tmp_path / "chain.npz").write_text("no archive")
    refused_command(["stability", str(path), "-q"], capsys, "chain.npz")


def test_matrices_from_python_are_checked():
    eye = np.eye(2)
    for body, frequency in (
        ((eye, eye, np.eye(3)), None), ((eye, np.full((2, 2), np.nan), eye), None), ((eye, eye), None),
        ((eye, eye, eye), (2.0, 1.0)), ((sp.eye(400), sp.eye(400), sp.eye(400)), None),
    ):  # fmt: skip
        refused((), ms.stability, body, frequency=frequency)
    refused("'load'", ms.stability, rotor(0.1, 0.1), over="load", values=[1.0, 2.0])


def test_results_as_tables():
    found = ms.stability(ziegler(3.0))
    assert found.to_dataframe()["verdict"].tolist() == list(found.verdict)
    assert found.to_xarray()["shape"].dims == ("coordinate", "root")
    over = ms.stability(rotor(0.02, 0.05), over="speed", values=[1.0, 2.0])
    assert len(over.to_dataframe()) == 4 and over.to_xarray().sizes == {"branch": 2, "speed": 2}
    assert len(found.plot().lines) == 4 and len(over.plot(what="frequency").lines) == 2


def test_thousands_of_roots_far_outside_turn_the_phase_and_are_no_roots_inside() -> None:
    """Stiffness-proportional damping of 5,000 high modes turns the phase by whole turns in every step, alike in both of
    its halves: they count nothing, and the two inside are counted."""
    w = np.concatenate([[2e3, 9e3], np.geomspace(4e4, 1e7, 5000)])
    beta = np.full(len(w), 4e-7)
    beta[:2] = -1e-6  # these grow
    Q = Quadratic(sp.identity(len(w), format="csr"), sp.diags(beta * w**2).tocsr(), sp.diags(w**2).tocsr())
    window = Window((0.0, 1e4), (0.0, 2.5e4))
    grow = 0.5e-6 * w[:2] ** 2
    roots = grow + 1j * np.sqrt(w[:2] ** 2 - grow**2)
    assert missed(Q, window, roots[:0]).missed == 2
    assert missed(Q, window, roots).missed == 0


def test_a_root_that_joins_an_equal_one_is_a_branch_of_its_own() -> None:
    from microslip.roots.diagram import Diagram

    s = (np.array([1j]), np.array([1j, 1j]), np.array([1j, 1j]))
    error, window = tuple(np.zeros(len(x)) for x in s), Window((-1.0, 1.0), (0.0, 2.0))
    found = Diagram("speed", np.arange(3.0), s, error, 0.0, window, None)
    assert found.branches.shape == (2, 3) and np.isnan(found.branches).sum() == 1
