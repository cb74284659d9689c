"""Friction frequency response with one harmonic and Jenkins elements: the thin first end of the chain.

Each contact of a body with a rigid neighbour is a linear 6 x 6 spring on the interface's rows plus, along one
tangent, a Jenkins element (a spring in series with a slider) whose first harmonic is known in closed form. The
modal part is eliminated exactly, so the unknowns are the contact coordinates only, and the residual flexibility of
MacNeal's method (what the kept modes leave of the static compliance) adds to theirs without new states. Rough
surfaces, varying normal load and more harmonics are `response`'s.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.optimize

from ..data import Array, ComplexArray, ModalGroup, NotConverged, UserError
from ..mistakes import bounded
from ..results.checks import Checks, shares
from .sweeps import FrequencyResponse, brackets, inside, resonances

Report = Callable[[str], None]


@dataclass(frozen=True)
class JenkinsContact:
    """One interface against a rigid neighbour.

    Attributes:
        interface: name. stiffness: (6,) linear springs on u_n, u_t1, u_t2, phi_n, phi_t1, phi_t2 (N/m, N m/rad);
            the entry of the sliding direction is left to the slider. slider: index of the sliding direction (1 or 2).
        tangential: stiffness of the slider's spring, N/m. limit: friction limit mu F_N, N; ``inf`` sticks for ever.

    Raises:
        UserError: a number that is negative or not finite, a direction in which nothing slides.
    """

    interface: str
    stiffness: Array
    slider: int
    tangential: float
    limit: float

    def __post_init__(self) -> None:
        if self.slider not in (1, 2):
            raise UserError(f"{self.interface}: slider: {self.slider} is no tangent; 1 is along t1, 2 along t2")
        for name in ("stiffness", "tangential", "limit"):
            if name != "limit" or self.limit != np.inf:
                bounded(f"{self.interface}: {name}", getattr(self, name), ge=0)


@dataclass(frozen=True)
class Residual:
    """Static compliance that the kept coordinates leave out, among contacts (6 a contact), force and monitor.

    Attributes:
        contacts: (6c, 6c). force_on_contacts: (6c,) per newton of the excitation. contacts_on_monitor: (6c,).
        force_on_monitor: displacement of the monitor per newton.
    """

    contacts: Array
    force_on_contacts: Array
    contacts_on_monitor: Array
    force_on_monitor: float


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
    group: ModalGroup, contacts: list[JenkinsContact], force: Array, monitor: Array, frequency: Array,
    report: Report = lambda _: None, residual: Residual | None = None, amplitude: float = 1.0,
) -> FrequencyResponse:  # fmt: skip
    """Steady response to a harmonic force (Sextro Eqs. (5.1-4) to (5.1-10) with Jenkins elements).

    Args:
        group: the reduced body. force: (m,) modal force amplitude, N kg^-1/2. monitor: (m,) row to watch.
        frequency: (f,) Hz, swept in the given order; each point starts from its neighbour.
        residual: residual flexibility to add (MacNeal). amplitude: force in N that `force` stands for.

    Returns:
        The response; points whose Newton iteration failed have ``converged`` False and the sweep goes on.

    Raises:
        UserError: a frequency that is not positive, a force that is not finite, an interface that is not there.
    """
    bounded("frequency", frequency, gt=0)
    bounded("force", np.abs(force))
    rows, springs, limits = contact_coordinates(group, contacts)
    count, points = len(springs), len(frequency)
    if residual is None:
        residual = Residual(np.zeros((count, count)), np.zeros(count), np.zeros(count), 0.0)
    slider = [6 * i + c.slider for i, c in enumerate(contacts)]
    monitored, slips = np.zeros(points, complex), np.zeros((points, len(contacts)), complex)
    dissipated, converged = np.zeros(points), np.zeros(points, bool)
    swing = np.zeros((points, len(contacts)))
    modal, forces = np.zeros((points, len(group.M_r)), complex), np.zeros((points, count), complex)
    energies = np.zeros((5, points))
    u = np.zeros(count, complex)
    for i, f in enumerate(frequency):
        Omega = 2 * np.pi * f
        answer = _answer(group, Omega, np.column_stack([force.astype(complex), rows.T]))
        free = np.asarray(rows @ answer[:, 0] + residual.force_on_contacts * amplitude, dtype=complex)
        flexibility = rows @ answer[:, 1:] + residual.contacts
        u, converged[i] = _solve_contacts(springs, limits, free, flexibility, u)
        k = _stiffness(springs, limits, np.abs(u))[0]
        monitored[i] = monitor @ answer[:, 0] + residual.force_on_monitor * amplitude
        monitored[i] -= (monitor @ answer[:, 1:] + residual.contacts_on_monitor) @ (k * u)
        slips[i], swing[i] = u[slider], np.abs(springs[::6] * u[::6])
        modal[i], forces[i] = answer[:, 0] - answer[:, 1:] @ (k * u), k * u
        dissipated[i] = np.pi * float(np.sum(k.imag * np.abs(u) ** 2))
        given = force @ modal[i] - residual.force_on_contacts * amplitude @ forces[i]
        damped = np.pi * Omega * float((modal[i].conj() @ group.C_r @ modal[i]).real)
        lost, moved = _slid(springs, limits, u), np.pi * (abs(given) + float(np.abs(forces[i]) @ np.abs(u)))
        apart = u - rows @ modal[i] - residual.force_on_contacts * amplitude + residual.contacts @ forces[i]
        supplied = -np.pi * float(given.imag)
        energies[:4, i] = supplied, damped, *shares(supplied, damped, dissipated[i], lost, moved)
        energies[4, i] = np.abs(apart).max(initial=0.0) / max(np.abs(u).max(initial=0.0), 1e-300)
        if not converged[i]:
            u = np.zeros(count, complex)
        if (i + 1) % max(points // 2, 1) == 0:
            report(f"{i + 1} of {points} frequencies")
    limit = np.array([c.limit for c in contacts])
    converged &= np.array([not Checks(*row).failure for row in energies[2:].T], dtype=bool)
    return FrequencyResponse(
        frequency, monitored, slips, dissipated, converged, limit, swing, modal=modal, force=forces,
        supplied=energies[0], damped=energies[1], balance=energies[2], counted=energies[3], motion=energies[4],
    )  # fmt: skip


def _slid(springs: Array, limits: Array, u: ComplexArray) -> float:
    """J that the sliders take in a cycle, friction times the path slid: 4 R (|u| - R / k) of each that slides."""
    path = np.abs(u) - np.divide(limits, springs, out=np.full(len(u), np.inf), where=springs > 0)
    return float(4 * (limits[path > 0] @ path[path > 0]))


def _answer(group: ModalGroup, Omega: float, loads: Array) -> ComplexArray:
    """(m, r) coordinates under loads (m, r) at rad/s; where an undamped mode is met exactly, 1e-8 of its frequency
    beside it: what contacts limit is the same there to as much."""
    for w in (Omega, Omega * (1 + 1e-8)):
        S = group.K_r - w**2 * group.M_r + 1j * w * (group.C_r + group.G_r)
        with contextlib.suppress(np.linalg.LinAlgError):
            return np.asarray(np.linalg.solve(S, loads))
    raise NotConverged(f"the body has no answer at {Omega / (2 * np.pi):.6g} Hz: its matrices are singular there")


def contact_coordinates(group: ModalGroup, contacts: list[JenkinsContact]) -> tuple[Array, Array, Array]:
    """(6c, m) rows, (6c,) springs and (6c,) friction limits (infinite where the spring is linear) of all contacts."""
    if missing := [c.interface for c in contacts if c.interface not in group.interfaces]:
        raise UserError(f"there is no interface '{missing[0]}'; the body has {', '.join(group.interfaces) or 'none'}")
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
    try:
        stuck = np.linalg.solve(np.eye(len(free)) + D * springs, free)
    except np.linalg.LinAlgError:  # the resonance of the sticking contacts, without damping
        stuck = np.linalg.solve(np.eye(len(free)) + 0.5 * D * springs, free)
    scale = np.abs(free).max(initial=1e-300)
    u = start
    for first in (start, stuck, free):
        u = first.astype(complex)
        residual = _residual(springs, limits, free, D, u)
        for _ in range(60):
            if np.abs(residual).max(initial=0.0) < 1e-11 * scale:
                return u, True
            step = _newton_step(springs, limits, D, u, residual)
            size = 1.0
            while size > 1e-4:
                trial = _residual(springs, limits, free, D, u + size * step)
                if np.linalg.norm(trial) < np.linalg.norm(residual):
                    break
                size *= 0.5
            u, residual = u + size * step, _residual(springs, limits, free, D, u + size * step)
    return _last_resort(springs, limits, free, D, np.asarray(stuck, dtype=complex))


def _last_resort(
    springs: Array, limits: Array, free: ComplexArray, D: ComplexArray, start: ComplexArray
) -> tuple[ComplexArray, bool]:
    """Powell's hybrid method where Newton found no way."""
    n, scale = len(free), np.abs(free).max(initial=1e-300)

    def real(x: Array) -> Array:
        r = _residual(springs, limits, free, D, scale * (x[:n] + 1j * x[n:])) / scale
        return np.concatenate([r.real, r.imag])

    answer = scipy.optimize.root(real, np.concatenate([start.real, start.imag]) / scale, tol=1e-13)
    u = scale * (answer.x[:n] + 1j * answer.x[n:])
    return u, bool(np.abs(real(answer.x)).max(initial=0.0) < 1e-9)


def _residual(springs: Array, limits: Array, free: ComplexArray, D: ComplexArray, u: ComplexArray) -> ComplexArray:
    return u + D @ (_stiffness(springs, limits, np.abs(u))[0] * u) - free


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


def stuck_frequencies(group: ModalGroup, contacts: list[JenkinsContact], residual: Residual | None = None) -> Array:
    """(m,) eigenfrequencies in Hz with every contact sticking; residual flexibility in series with the springs."""
    return stuck_resonances(group, contacts, residual)[0]


def stuck_resonances(
    group: ModalGroup, contacts: list[JenkinsContact], residual: Residual | None = None
) -> tuple[Array, Array]:
    """(m,) `stuck_frequencies` and the damping ratios of these modes, see `reduced.stuck_damping`."""
    rows, springs, _ = contact_coordinates(group, contacts)
    flexibility = np.zeros((len(springs),) * 2) if residual is None else residual.contacts
    # springs in series with the residual flexibility, also where a spring is zero: k (1 + R k)^-1
    series = springs[:, None] * np.linalg.inv(np.eye(len(springs)) + flexibility * springs)
    K = group.K_r + rows.T @ series @ rows
    values, shapes = scipy.linalg.eigh(0.5 * (K + K.T), group.M_r)
    omega = np.sqrt(np.maximum(values, 0.0))
    lost = np.einsum("im,ij,jm->m", shapes, group.C_r, shapes)
    return omega / (2 * np.pi), np.divide(lost, 2 * omega, out=np.zeros_like(omega), where=omega > 0)


def refined_peaks(
    response: FrequencyResponse, respond: Callable[[Array], FrequencyResponse]
) -> list[tuple[float, float]]:
    """`peaks`, each searched for between its two neighbours on the grid, so that the step does not cut it off, and
    those of one plateau taken together.

    Args:
        respond: the response at other frequencies (Hz).
    """
    found = []
    for bracket in brackets(response):
        low, high = (float(response.frequency[j]) for j in (bracket[0], bracket[-1]))
        for _ in range(6):  # nine points a round: the bracket shrinks four times
            r = respond(np.linspace(low, high, 9))
            a = np.where(r.converged, np.abs(r.monitor), 0.0)
            top = int(np.clip(a.argmax(), 1, 7))
            low, high = float(r.frequency[top - 1]), float(r.frequency[top + 1])
        if inside(response, bracket, float(a.max()), lambda f: float(abs(respond(np.array([f])).monitor[0]))):
            found.append((float(r.frequency[a.argmax()]), float(a.max())))
    return resonances(response, found)
