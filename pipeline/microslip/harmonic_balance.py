"""Friction frequency response with one harmonic and Jenkins elements: the thin first end of the chain.

Each contact of a body with a rigid neighbour is a linear 6 x 6 spring on the interface's rows plus, along one
tangent, a Jenkins element (a spring in series with a slider) whose first harmonic is known in closed form. The
modal part is eliminated exactly, so the unknowns are the slider displacements only. Rough surfaces, varying
normal load and more harmonics belong to the later contact stages.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from .data import Array, ModalGroup

Report = Callable[[str], None]


@dataclass(frozen=True)
class JenkinsContact:
    """One interface against a rigid neighbour.

    Attributes:
        interface: name. stiffness: (6,) linear springs on u_n, u_t1, u_t2, phi_n, phi_t1, phi_t2 (N/m, N m/rad);
            the entry of the sliding direction is left to the slider. slider: index of the sliding direction (1 or 2).
        tangential: stiffness of the slider's spring, N/m. limit: friction limit mu F_N, N.
    """

    interface: str
    stiffness: Array
    slider: int
    tangential: float
    limit: float


@dataclass(frozen=True)
class FrequencyResponse:
    """Response over frequency.

    Attributes:
        frequency: (f,) Hz. monitor: (f,) complex 0-peak displacement of the monitored row, m.
        slip: (f, c) complex 0-peak displacement of each slider, m. dissipated: (f,) energy per cycle, J.
        converged: (f,) bool. limit: the friction limits, N, for reports.
    """

    frequency: Array
    monitor: Array
    slip: Array
    dissipated: Array
    converged: Array
    limit: Array


def jenkins_harmonic(amplitude: Array, stiffness: float, limit: float) -> tuple[Array, Array]:
    """Complex stiffness of a Jenkins element at an amplitude and its derivative with respect to the amplitude.

    With x = stiffness * amplitude / limit > 1 and theta = arccos(1 - 2/x): real part (theta - sin(2 theta)/2)/pi,
    imaginary part 4 (x - 1)/(pi x^2); both times the stiffness. Below the limit it sticks.

    Args:
        amplitude: (c,) m, not negative. stiffness: N/m. limit: N.
    """
    x = np.maximum(stiffness * np.asarray(amplitude, dtype=float) / max(limit, 1e-300), 1.0)
    theta = np.arccos(1 - 2 / x)
    value = (theta - 0.5 * np.sin(2 * theta)) / np.pi + 4j * (x - 1) / (np.pi * x**2)
    slides = x > 1
    inside = np.where(slides, x - 1, 1.0)
    dtheta = -1 / (x * np.sqrt(inside))
    slope = (1 - np.cos(2 * theta)) / np.pi * dtheta + 4j * (2 - x) / (np.pi * x**3)
    return stiffness * value, np.where(slides, stiffness * slope * stiffness / max(limit, 1e-300), 0.0)


def frequency_response(
    group: ModalGroup, contacts: list[JenkinsContact], force: Array, monitor: Array, frequency: Array,
    report: Report = lambda _: None,
) -> FrequencyResponse:  # fmt: skip
    """Steady response to a harmonic force (Sextro Eqs. (5.1-4) to (5.1-10) with Jenkins elements).

    Args:
        group: the reduced body. force: (m,) modal force amplitude, N kg^-1/2. monitor: (m,) row to watch.
        frequency: (f,) Hz, swept in the given order; each point starts from its neighbour.

    Returns:
        The response; points whose Newton iteration failed have ``converged`` False and the sweep goes on.
    """
    rows = np.array([group.interfaces[c.interface].rows[c.slider] for c in contacts]).reshape(-1, group.n_modes)
    K = group.K_r + sum(_linear_part(group, c) for c in contacts)
    count, points = len(contacts), len(frequency)
    monitored, slips = np.zeros(points, complex), np.zeros((points, count), complex)
    dissipated, converged = np.zeros(points), np.zeros(points, bool)
    u = np.zeros(count, complex)
    for i, f in enumerate(frequency):
        Omega = 2 * np.pi * f
        S = K - Omega**2 * group.M_r + 1j * Omega * (group.C_r + group.G_r)
        answer = np.linalg.solve(S, np.column_stack([force.astype(complex), rows.T]))
        free, flexibility = rows @ answer[:, 0], rows @ answer[:, 1:]
        u, converged[i] = _solve_sliders(contacts, free, flexibility, u)
        k = _slider_stiffness(contacts, np.abs(u))[0]
        q = answer[:, 0] - answer[:, 1:] @ (k * u)
        monitored[i], slips[i] = monitor @ q, u
        dissipated[i] = np.pi * float(np.sum(k.imag * np.abs(u) ** 2))
        if not converged[i]:
            u = np.zeros(count, complex)
        if (i + 1) % max(points // 2, 1) == 0:
            report(f"{i + 1} of {points} frequencies")
    return FrequencyResponse(frequency, monitored, slips, dissipated, converged, np.array([c.limit for c in contacts]))


def _linear_part(group: ModalGroup, contact: JenkinsContact) -> Array:
    rows = group.interfaces[contact.interface].rows
    springs = contact.stiffness.copy()
    springs[contact.slider] = 0.0
    return rows.T @ (springs[:, None] * rows)


def _slider_stiffness(contacts: list[JenkinsContact], amplitude: Array) -> tuple[Array, Array]:
    pairs = [jenkins_harmonic(a, c.tangential, c.limit) for a, c in zip(amplitude, contacts, strict=True)]
    return np.array([p[0] for p in pairs], dtype=complex), np.array([p[1] for p in pairs], dtype=complex)


def _solve_sliders(contacts: list[JenkinsContact], free: Array, D: Array, start: Array) -> tuple[Array, bool]:
    """u + D k(|u|) u = free by Newton in real and imaginary parts with halved steps, from `start` or from sticking."""
    stuck = np.linalg.solve(np.eye(len(free)) + D * [c.tangential for c in contacts], free)
    scale = np.abs(free).max(initial=1e-300)
    for u in (start, stuck, free):
        u = u.astype(complex)
        residual = _residual(contacts, free, D, u)
        for _ in range(60):
            if np.abs(residual).max(initial=0.0) < 1e-11 * scale:
                return u, True
            step = _newton_step(contacts, D, u, residual)
            size = 1.0
            while size > 1e-4:
                trial = _residual(contacts, free, D, u + size * step)
                if np.linalg.norm(trial) < np.linalg.norm(residual):
                    break
                size *= 0.5
            u, residual = u + size * step, _residual(contacts, free, D, u + size * step)
    return u, False


def _residual(contacts: list[JenkinsContact], free: Array, D: Array, u: Array) -> Array:
    return u + D @ (_slider_stiffness(contacts, np.abs(u))[0] * u) - free


def _newton_step(contacts: list[JenkinsContact], D: Array, u: Array, residual: Array) -> Array:
    size = np.maximum(np.abs(u), 1e-300)
    k, slope = _slider_stiffness(contacts, np.abs(u))
    # d(k u) = k du + slope * u * Re(conj(u) du)/|u|
    real = np.diag(k) + np.diag(slope * u * u.real / size)
    imag = 1j * np.diag(k) + np.diag(slope * u * u.imag / size)
    n = len(u)
    A = np.hstack([np.eye(n) + D @ real, 1j * np.eye(n) + D @ imag])
    J = np.vstack([A.real, A.imag])
    step = np.linalg.solve(J, -np.concatenate([residual.real, residual.imag]))
    return step[:n] + 1j * step[n:]


def stuck_frequencies(group: ModalGroup, contacts: list[JenkinsContact]) -> Array:
    """(m,) eigenfrequencies in Hz with every contact sticking."""
    K = group.K_r.copy()
    for c in contacts:
        springs = c.stiffness.copy()
        springs[c.slider] = c.tangential
        rows = group.interfaces[c.interface].rows
        K += rows.T @ (springs[:, None] * rows)
    return np.sqrt(np.maximum(np.linalg.eigvalsh(K), 0.0)) / (2 * np.pi)


def peaks(response: FrequencyResponse) -> list[tuple[float, float]]:
    """(frequency in Hz, amplitude in m) of every local maximum of the monitored amplitude."""
    a = np.abs(response.monitor)
    inside = np.flatnonzero((a[1:-1] > a[:-2]) & (a[1:-1] >= a[2:])) + 1
    return [(float(response.frequency[i]), float(a[i])) for i in inside]


def response_table(responses: Mapping[float, FrequencyResponse]) -> str:
    """CSV text: frequency and, per normal force, amplitude, phase and dissipated energy."""
    head, columns = ["frequency_Hz"], []
    for force, r in responses.items():
        label = f"FN_{force:g}_N"
        head += [f"amplitude_m_{label}", f"phase_rad_{label}", f"dissipated_J_{label}", f"converged_{label}"]
        columns += [np.abs(r.monitor), np.angle(r.monitor), r.dissipated, r.converged.astype(float)]
    first = next(iter(responses.values()))
    table = np.column_stack([first.frequency, *columns])
    lines = [",".join(head)] + [",".join(f"{v:.9g}" for v in row) for row in table]
    return "\n".join(lines) + "\n"
