"""Files that are damaged at random."""

from __future__ import annotations

import random


def flipped(data: bytes, rng: random.Random, cut: bool = True) -> bytes:
    """Bits, bytes and words changed, stretches copied elsewhere, sometimes cut."""
    out = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 4, 16])):
        i, j = rng.randrange(len(out)), rng.randrange(len(out))
        kind = rng.randrange(7)
        if kind == 0:
            out[i] ^= 1 << rng.randrange(8)
        elif kind == 1:
            out[i] = rng.randrange(256)
        elif kind == 2:
            out[i : i + 8] = b"\xff" * 8
        elif kind == 3:
            out[i : i + 4] = bytes(4)
        elif kind == 4:
            out[i : i + 16] = out[j : j + 16]
        elif kind == 5:
            out[i : i + 8] = rng.randrange(2**64).to_bytes(8, "little")
        elif cut and len(out) > 100 and not rng.randrange(4):
            del out[max(i, 50) :]
    return bytes(out)
