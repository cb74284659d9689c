"""Motions with contact that can be written down: a bounce on spring and damper, decay by dry friction, a ball."""

from __future__ import annotations

import numpy as np

from microslip.data import Array


def restitution(ratio: float) -> float:
    """Speed after over speed before of a mass that meets a spring and a damper, which cannot pull.

    It leaves where their force ends, at w t = arctan(2 D r / (2 D^2 - 1)) / r with r = sqrt(1 - D^2), by exp(-D w t).

    Args:
        ratio: damping ratio D = b / (2 sqrt(k m)), below 1.
    """
    root = np.sqrt(1 - ratio**2)
    return float(np.exp(-ratio * np.arctan2(2 * ratio * root, 2 * ratio**2 - 1) / root))


def dry_turns(start: float, lost: float) -> Array:
    """Places (m), from the start on, at which an oscillator with dry friction turns: each lost = 2 R / k nearer to the
    middle than the one before, until friction R (N) holds it on its spring k (N/m)."""
    count = int(np.floor((abs(start) - 0.5 * lost) / lost)) + 1 if abs(start) > 0.5 * lost else 0
    left = abs(start) - lost * np.arange(count + 1)
    return np.sign(start) * left * (-1.0) ** np.arange(count + 1)


def bounces(height: float, restitution: float, gravity: float, count: int) -> Array:
    """(count,) times (s) at which a ball let go at a height (m) meets the ground; after
    t_0 (1 + e) / (1 - e), t_0 the first one, infinitely many times."""
    first = np.sqrt(2 * height / gravity)
    return first * (1 + 2 * np.cumsum(np.append(0.0, restitution ** np.arange(1, count))))


def height_of_ball(time: Array, height: float, restitution: float, gravity: float) -> Array:
    """Heights (m) of that ball at times (s); at rest after the last bounce."""
    at = bounces(height, restitution, gravity, 200)
    n = np.searchsorted(at, time, side="right")
    since = time - at[np.maximum(n - 1, 0)]
    speed = np.sqrt(2 * gravity * height) * restitution**n
    flight = np.where(n == 0, height - 0.5 * gravity * time**2, speed * since - 0.5 * gravity * since**2)
    return np.where(time < at[-1], np.maximum(flight, 0.0), 0.0)
