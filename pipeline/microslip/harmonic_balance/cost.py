"""What marching the points of a contact needs in memory, told before it is allocated."""

from __future__ import annotations

import os
from pathlib import Path

from ..contact.harmonics import CHUNK

GIB = 2.0**30

BASE = 0.5 * GIB
"""Of a process with its packages and compiled programs."""


def aft_bytes(points: int, coordinates: int, harmonics: int, samples: int, contacts: int = 1) -> float:
    """Peak of the memory that a response with the law of a patch takes; measured it is within a factor of 2, and up to
    3 times less with thousands of samples of laws whose memory is solved for.

    At the peak stand either the derivatives, W = 2 H + 1: the tangents of the force along 3 W harmonics in every sample
    of `CHUNK` points, then (3, W, 3, W) of every point, twice, and half contracted (k, W, 3, W); or ten
    histories (3 a sample and point) of one cycle that is looked at in time.

    Args:
        points: of a patch. coordinates: k of it. contacts: equal ones, evaluated together.
    """
    W, n = 2 * harmonics + 1, points * contacts
    derivatives = samples * 3 * W * min(n, CHUNK) * 3 + n * W * W * (2 * 9 + 3 * coordinates)
    return BASE + 8.0 * max(derivatives, 10 * samples * points * 3)


def of_this_machine() -> float:
    """Bytes that a process may have: the machine's, or what a control group leaves of them; infinite if unknown."""
    try:
        found = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return float("inf")
    for name in ("memory.max", "memory/memory.limit_in_bytes"):
        try:
            text = Path("/sys/fs/cgroup", name).read_text(encoding="ascii").strip()
        except (OSError, UnicodeDecodeError):
            continue
        found = min(found, float(text)) if text.isdecimal() else found
    return found
