"""The book's mode beside the marched laws: resonances of both, paired."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..units import METRES, Quantity, amplitude_of


@dataclass(frozen=True)
class Pair:
    """A resonance under a normal force (N) in both modes: (Hz, amplitude), or None where none was found in one of them.
    quantity: what the amplitude measures."""

    normal_force: float
    marched: tuple[float, float] | None
    book: tuple[float, float] | None
    quantity: Quantity = METRES

    def differences(self) -> tuple[float, float] | None:
        """The book's frequency and amplitude over the marched ones, less 1."""
        if self.marched is None or self.book is None:
            return None
        return self.book[0] / self.marched[0] - 1, self.book[1] / self.marched[1] - 1


def paired(marched: Sequence[Mapping[str, Any]], book: Sequence[Mapping[str, Any]], reach: float = 0.1) -> list[Pair]:
    """Resonances of two summaries, nearest first.

    Args:
        marched, book: rows with normal_force_N, frequency_Hz and an amplitude. reach: of the frequency, beyond which
            two peaks are not one.
    """
    found = []
    of = next((amplitude_of(row)[1] for row in [*marched, *book]), METRES)
    forces = dict.fromkeys(row["normal_force_N"] for row in [*marched, *book])
    for normal in forces:
        one, two = (_peaks(rows, normal) for rows in (marched, book))
        ways = sorted((abs(b[0] / a[0] - 1), i, j) for i, a in enumerate(one) for j, b in enumerate(two))
        met: dict[int, int] = {}
        for distance, i, j in ways:
            if distance <= reach and i not in met and j not in met.values():
                met[i] = j
        found += [Pair(normal, a, two[met[i]] if i in met else None, of) for i, a in enumerate(one)]
        found += [Pair(normal, None, b, of) for j, b in enumerate(two) if j not in met.values()]
    return found


def _peaks(rows: Sequence[Mapping[str, Any]], normal: float) -> list[tuple[float, float]]:
    return [(r["frequency_Hz"], amplitude_of(r)[0]) for r in rows if r["normal_force_N"] == normal]


def comparison_table(pairs: Sequence[Pair], of: Quantity = METRES) -> str:
    """CSV text; a resonance that was not found in one mode leaves its cells empty. of: what the amplitudes measure."""
    amplitudes_of = [of.column(name) for name in ("aft", "book", "difference")]
    head = ["normal_force_N", "aft_Hz", "book_Hz", "difference_Hz_percent", *amplitudes_of[:2]]
    rows = [",".join([*head, f"{amplitudes_of[2]}_percent"])]
    for p in pairs:
        frequencies, amplitudes = ([one[k] if one else None for one in (p.marched, p.book)] for k in (0, 1))
        apart = p.differences()
        f, a = (None, None) if apart is None else (100 * apart[0], 100 * apart[1])
        cells = [p.normal_force, *frequencies, f, *amplitudes, a]
        rows.append(",".join("" if c is None else f"{c:.6g}" for c in cells))
    return "\n".join(rows) + "\n"


def sentence(p: Pair) -> str:
    """A line for a terminal."""
    none, unit = "no resonance found", p.quantity.said
    one, two = (f"{x[0]:.6g} Hz, {x[1]:.4g} {unit}" if x else none for x in (p.marched, p.book))
    apart = p.differences()
    more = "" if apart is None else f" ({100 * apart[0]:+.2g} % in frequency, {100 * apart[1]:+.2g} % in amplitude)"
    return f"F_N = {p.normal_force:g} N: marched {one}; book {two}{more}"
