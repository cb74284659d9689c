"""Bars and bricks whose vibration and stress can be written down: rods, the brick on rollers, the rotating bar."""

from __future__ import annotations

from itertools import product

import numpy as np

from microslip.data import Array


def rod_frequencies(young: float, density: float, length: float, count: int, ends: str = "clamped-free") -> Array:
    """(count,) angular frequencies of axial vibration of a uniform rod, rad/s (elastic ones only).

    Args:
        young: Pa (shear modulus for the torsion of a round bar). density: kg/m3. length: m.
        ends: ``clamped-free``, ``free-free`` or ``clamped-clamped``.

    Raises:
        ValueError: unknown ends.
    """
    k = np.arange(1, count + 1)
    numbers = {"clamped-free": k - 0.5, "free-free": k, "clamped-clamped": k}
    if ends not in numbers:
        raise ValueError(f"ends must be one of {', '.join(numbers)}")
    return numbers[ends] * np.pi * np.sqrt(young / density) / length


def rotating_bar_stress(density: float, speed: float, radius: Array, tip: float) -> Array:
    """Radial stress, Pa, of a bar that rotates across its length, for small displacements.

    sigma = rho Omega^2 (R^2 - r^2) / 2.

    Args:
        speed: rad/s. radius: places, m. tip: outer radius R, m.
    """
    return 0.5 * density * speed**2 * (tip**2 - np.asarray(radius) ** 2)


def rotating_bar_displacement(
    young: float, density: float, speed: float, radius: Array, root: float, tip: float
) -> Array:
    """Radial displacement, m, of the bar of `rotating_bar_stress` held at `root`, small and load fixed at r."""
    r = np.asarray(radius)
    return density * speed**2 / (2 * young) * (tip**2 * (r - root) - (r**3 - root**3) / 3)


def box_frequencies(
    density: float, lame: float, shear: float, size: tuple[float, float, float], count: int,
    stress: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Array:  # fmt: skip
    """(count,) angular frequencies, rad/s, of an isotropic brick whose six faces slide without friction.

    The displacement (a sin cos cos, b cos sin cos, c cos cos sin) of k = pi (l/a, m/b, n/c) meets u_n = 0 and no
    shear on every face, so the spectrum is that of plane waves: one of speed sqrt((lambda + 2 mu)/rho), and as
    many of speed sqrt(mu/rho) as k has further non-zero components. A uniform initial stress along the edges adds
    (sum of S_i k_i^2) / rho to every eigenvalue.

    Args:
        lame, shear: lambda and mu, Pa. size: edges, m. stress: initial stresses S_i, Pa.
    """
    top = 4
    while True:
        values, edge = _box_values(density, lame, shear, size, stress, top)
        values = np.sort(values[values < edge])
        if len(values) >= count:
            return np.sqrt(values[:count])
        top *= 2


def _box_values(
    density: float, lame: float, shear: float, size: tuple[float, float, float], stress: tuple[float, float, float],
    top: int,
) -> tuple[Array, float]:  # fmt: skip
    """Eigenvalues of all waves with indices up to `top` in sum, and the bound below which none is missing."""
    values = []
    for index in product(range(top + 1), repeat=3):
        if not 0 < sum(index) <= top:
            continue
        k = np.pi * np.array(index) / np.array(size)
        extra = np.array(stress) @ k**2
        values.append((lame + 2 * shear) * (k @ k) + extra)
        values += [shear * (k @ k) + extra] * (np.count_nonzero(index) - 1)
    softest = min(shear + s for s in stress)
    # the indices left out have sum > top, hence |k| >= pi (top + 1) / (sqrt(3) max(size))
    edge = softest * (np.pi * (top + 1) / (np.sqrt(3) * max(size))) ** 2
    return np.array(values) / density, edge / density
