"""An assembly about sliding: its equations, equilibrium and linearisation against closed forms."""

from __future__ import annotations

from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from closed_forms.oscillators import belt
from refusals import refused

import microslip as ms
from microslip import sliding
from microslip.bifurcation import mechanics
from microslip.case import load_case
from microslip.case.assemble import build
from microslip.system.assembly import Assembly
from microslip.system.settings import load_system

CASES = Path(__file__).parents[1] / "pipeline" / "cases"
KEYS = ("contacts.sole-1.normal_force", "contacts.sole-2.normal_force")


def masses(B: float, *more: str) -> Assembly:
    """The case of the two masses on a belt under a load."""
    path = CASES / "belt.toml"
    settings, _ = load_case(path, [*(f"{key}={B!r}" for key in KEYS), *more])
    basis = load_system(CASES / "masses-on-belt" / "system.toml").basis()
    return build(settings, {"masses-on-belt": basis}).assembly


def test_two_masses_are_the_books_equations() -> None:
    """(4.4-1), corrected, counts displacements from the equilibrium: the same accelerations at any state."""
    s, book = sliding.of(masses(8.0)), belt(1.0, 12.0)
    P = np.asarray(s.output)[[1, 0]]  # first and second mass by the coordinates
    rest = sliding.equilibrium(s)
    assert np.abs(rest[2:]).max() < 1e-12
    random = np.random.default_rng(0)
    for z in rest + random.normal(size=(20, 4)):
        q, v, a = P @ (z - rest)[:2], P @ z[2:], P @ np.asarray(sliding.rate(s, z))[2:]
        own = np.asarray(book.rate(np.array([q[0], v[0], q[1], v[1]]), 8.0, 0.0))
        np.testing.assert_allclose(a, own[[1, 3]], atol=1e-9)


def test_linearised_matrices_are_those_of_differences() -> None:
    """C holds the falling characteristic, and the eigenvalues are those of the book's Jacobian."""
    s, book = sliding.of(masses(8.0)), belt(1.0, 12.0)
    z = sliding.equilibrium(s)
    A = sliding.state_matrix(s, z)
    C, K = sliding.linearised(s, z)
    np.testing.assert_allclose(A[2:], -np.hstack([K, C]), atol=1e-14)
    np.testing.assert_allclose(K, np.asarray(s.K), atol=1e-12)
    values = np.linalg.eigvals(np.asarray(book.still(np.zeros(4), 8.0)[1]))
    np.testing.assert_allclose(np.sort_complex(np.linalg.eigvals(A)), np.sort_complex(values), atol=1e-9)
    h = 1e-6
    for j in range(4):
        ends = [np.asarray(sliding.rate(s, z + way * h * np.eye(4)[j])) for way in (1, -1)]
        np.testing.assert_allclose(A[:, j], (ends[0] - ends[1]) / (2 * h), atol=1e-7)


def test_equations_over_a_parameter_are_interpolated_exactly() -> None:
    """Over the load (linear), and over the friction coefficient with its own keys; derivatives are exact."""
    over = mechanics.over(masses, 1.0, 12.0)
    z = np.array([1.0, -2.0, 0.5, 0.7])
    for B in (1.7, 9.3):
        at = np.asarray(sliding.rate(over.at(jnp.asarray(B)), z))
        np.testing.assert_allclose(at, np.asarray(sliding.rate(sliding.of(masses(B)), z)), rtol=1e-10)


def test_spring_and_cube() -> None:
    """A structure of matrices: coordinates over the root of the mass, x'' = (1 - 2 x' - 3 x - 5 x^3) / 4."""
    made = ms.structure(4.0, 3.0, 2.0, steady={0: 1.0}, elements=[ms.polynomial({3: 5.0})])
    s = sliding.of(made)
    x, v = 0.3, 0.2
    z = np.array([2 * x, 2 * v])
    np.testing.assert_allclose(sliding.rate(s, z), [2 * v, (1 - 2 * v - 3 * x - 5 * x**3) / 2], atol=1e-14)
    rest = sliding.equilibrium(s)[0] / 2
    assert 3 * rest + 5 * rest**3 == pytest.approx(1.0, abs=1e-12)


def test_contacts_that_remember_are_refused() -> None:
    made = ms.structure(1.0, 1.0, 0.02, elements=[ms.jenkins(1.0, 0.5)])
    refused("contacts.jenkins 1", sliding.of, made)
