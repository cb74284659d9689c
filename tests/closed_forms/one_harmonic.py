"""One harmonic of a body on Jenkins elements, in closed form: the response and its limit of sticking contacts.

Each contact of a body with a rigid neighbour is a linear 6 x 6 spring on the interface's rows plus, along one tangent,
a spring in series with a slider, whose first harmonic is known. The modes are eliminated; unknown are the contacts'
coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from microslip.data import Array, ComplexArray, ModalGroup


@dataclass(frozen=True)
class JenkinsContact:
    """One interface against a rigid neighbour.

    Attributes:
        interface: name. stiffness: (6,) linear springs on u_n, u_t1, u_t2, phi_n, phi_t1, phi_t2 (N/m, N m/rad);
            the entry of the sliding direction is left to the slider. slider: index of the sliding direction (1 or 2).
        tangential: stiffness of the slider's spring, N/m. limit: friction limit mu F_N, N; ``inf`` sticks for ever.
    """

    interface: str
    stiffness: Array
    slider: int
    tangential: float
    limit: float


@dataclass(frozen=True)
class OneHarmonic:
    """Responses at f frequencies, complex 0-peak.

    Attributes:
        monitor: (f,) m. modal: (f, m) coordinates. contact: (f, 6 c) motions of the contacts, m and rad, and force:
            what acts on them, N and N m. dissipated: (f,) J per cycle. converged: (f,) bool.
    """

    monitor: ComplexArray
    modal: ComplexArray
    contact: ComplexArray
    force: ComplexArray
    dissipated: Array
    converged: Array


def jenkins_harmonic(amplitude: Array, stiffness: float, limit: float) -> tuple[Array, Array]:
    """Complex stiffness of a Jenkins element at an amplitude and its derivative with respect to the amplitude.

    With x = stiffness * amplitude / limit > 1 and theta = arccos(1 - 2/x): real part (theta - sin(2 theta)/2)/pi,
    imaginary part 4 (x - 1)/(pi x^2); both times the stiffness. Below the limit it sticks.

    Args:
        amplitude: (c,) m, not negative. stiffness: N/m. limit: N.
    """
    limit = max(limit, _NO_FRICTION)
    x = np.clip(stiffness * np.asarray(amplitude, dtype=float) / limit, 1.0, 1e100)
    theta = np.arccos(1 - 2 / x)
    value = (theta - 0.5 * np.sin(2 * theta)) / np.pi + 4j * (x - 1) / (np.pi * x**2)
    slides = x > 1
    inside = np.where(slides, x - 1, 1.0)
    dtheta = -1 / (x * np.sqrt(inside))
    slope = (1 - np.cos(2 * theta)) / np.pi * dtheta + 4j * (2 - x) / (np.pi * x**3)
    return stiffness * value, np.where(slides, stiffness * slope * stiffness / limit, 0.0)


_NO_FRICTION = 1e-150  # N, for a limit of 0: what it holds, and the cube of what slides over it, are numbers


def frequency_response(
    group: ModalGroup, contacts: list[JenkinsContact], force: Array, monitor: Array, frequency: Array
) -> OneHarmonic:
    """Steady response to a harmonic force (Sextro Eqs. (5.1-4) to (5.1-10) with Jenkins elements).

    Args:
        force: (m,) modal force amplitude, N kg^-1/2. monitor: (m,) row to read. frequency: (f,) Hz, swept in the given
            order; each point starts from its neighbour.
    """
    rows, springs, limits = contact_coordinates(group, contacts)
    found, u = [], np.zeros(len(springs), complex)
    for Omega in 2 * np.pi * np.asarray(frequency):
        N = 0.0 if group.N_r is None else group.N_r
        S = group.K_r + N - Omega**2 * group.M_r + 1j * Omega * (group.C_r + group.G_r)
        answer = np.linalg.solve(S, np.column_stack([force.astype(complex), rows.T]))
        u, converged = _solve_contacts(springs, limits, rows @ answer[:, 0], rows @ answer[:, 1:], u)
        F = _stiffness(springs, limits, np.abs(u))[0] * u
        q = answer[:, 0] - answer[:, 1:] @ F
        found.append((monitor @ q, q, u, F, np.pi * float((F * u.conj()).imag.sum()), converged))
        u = u if converged else np.zeros_like(u)
    return OneHarmonic(*(np.array(part) for part in zip(*found, strict=True)))


def contact_coordinates(group: ModalGroup, contacts: list[JenkinsContact]) -> tuple[Array, Array, Array]:
    """(6c, m) rows, (6c,) springs and (6c,) friction limits (infinite where the spring is linear) of all contacts."""
    rows = [group.interfaces[c.interface].rows for c in contacts]
    springs, limits = np.zeros((len(contacts), 6)), np.full((len(contacts), 6), np.inf)
    for i, c in enumerate(contacts):
        springs[i] = c.stiffness
        springs[i, c.slider], limits[i, c.slider] = c.tangential, c.limit
    return np.array(rows).reshape(-1, group.n_modes), springs.ravel(), limits.ravel()


def _stiffness(springs: Array, limits: Array, amplitude: Array) -> tuple[ComplexArray, ComplexArray]:
    pairs = [jenkins_harmonic(a, k, limit) for a, k, limit in zip(amplitude, springs, limits, strict=True)]
    return np.array([p[0] for p in pairs], dtype=complex), np.array([p[1] for p in pairs], dtype=complex)


def _solve_contacts(
    springs: Array, limits: Array, free: ComplexArray, D: ComplexArray, start: ComplexArray
) -> tuple[ComplexArray, bool]:
    """u + D k(|u|) u = free by Newton in real and imaginary parts, steps halved; from `start`, then from sticking."""

    def missing(u: ComplexArray) -> ComplexArray:
        return np.asarray(u + D @ (_stiffness(springs, limits, np.abs(u))[0] * u) - free)

    scale, u = np.abs(free).max(initial=1e-300), start
    stuck = np.linalg.lstsq(np.eye(len(free)) + D * springs, free, rcond=None)[0]
    for first in (start, stuck, free):
        u = first.astype(complex)
        for _ in range(60):
            left = missing(u)
            if np.abs(left).max(initial=0.0) < 1e-11 * scale:
                return u, True
            step, size = _newton_step(springs, limits, D, u, left), 1.0
            while size > 1e-4 and not np.linalg.norm(missing(u + size * step)) < np.linalg.norm(left):
                size *= 0.5
            u = u + size * step
    return u, False


def _newton_step(
    springs: Array, limits: Array, D: ComplexArray, u: ComplexArray, residual: ComplexArray
) -> ComplexArray:
    size = np.maximum(np.abs(u), 1e-300)
    k, slope = _stiffness(springs, limits, np.abs(u))
    # d(k u) = k du + slope * u * Re(conj(u) du)/|u|
    real = np.diag(k) + np.diag(slope * u * u.real / size)
    imag = 1j * np.diag(k) + np.diag(slope * u * u.imag / size)
    n = len(u)
    A = np.hstack([np.eye(n) + D @ real, 1j * np.eye(n) + D @ imag])
    J = np.vstack([A.real, A.imag])
    right = -np.concatenate([residual.real, residual.imag])
    try:
        step = np.linalg.solve(J, right)
    except np.linalg.LinAlgError:  # all stick, at their resonance
        step = np.linalg.lstsq(J, right, rcond=None)[0]
    return step[:n] + 1j * step[n:]


def stuck_frequencies(group: ModalGroup, contacts: list[JenkinsContact]) -> Array:
    """(m,) eigenfrequencies in Hz with every contact sticking."""
    rows, springs, _ = contact_coordinates(group, contacts)
    K = group.K_r + rows.T @ (springs[:, None] * rows)
    values = scipy.linalg.eigvalsh(0.5 * (K + K.T), group.M_r)
    return np.asarray(np.sqrt(np.maximum(values, 0.0)) / (2 * np.pi))
