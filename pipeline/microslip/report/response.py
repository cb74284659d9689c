"""What the pages of a response and of a survey say."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from ..units import METRES, Quantity, amplitude_of, counted, percent
from .page import Album, Piece, fold, number, page, say, table
from .words import ROUNDING

MOST_ROWS = 60
"""Rows of a table that a page shows at once; the others unfold."""

SHOWN = (
    "friction response", "ring at resonance", "stress over frequency", "stress over normal force",
    "stress at resonance", "Haigh diagram", "contacts at resonance",
)  # fmt: skip
"""Pictures of a response in their order."""


def response_html(summary: Mapping[str, Any], pictures: Mapping[str, Path]) -> str:
    """The page of a case alone.

    Args:
        summary: the response of `body.report_html`; its messages are told behind the answer. pictures: name -> file.
    """
    told, album = {k: v for k, v in summary.items() if k not in ("messages", "pictures")}, Album(pictures)
    pieces = [*answer(told, album), warnings(summary.get("messages", [])), *response_pieces(told, album)]
    return page(f"{summary.get('case', 'case')}: friction response", pieces)


def answer(response: Mapping[str, Any], album: Album) -> list[Piece]:
    """What a person came for: sentences, the resonances, the curve."""
    rows = response.get("resonances", [])
    failed = response.get("unsolved")
    return [
        say(*_sentences(response), tone="lead"),
        say(*response.get("beyond", ()), tone="lead"),
        say(f"{failed}." if failed else "", tone="bad"),
        album.take(SHOWN[0]),
        _resonances(rows, _factors(response)) if rows else say(""),
        say(_of_others(response) if rows else ""),
        *album.begun(f"{SHOWN[0]} of "),
    ]


def _of_others(response: Mapping[str, Any]) -> str:
    """Which read-out has the resonances, where there are several."""
    first, *others = response.get("read_outs", [""])
    return f"Resonances are those of {first}; what is told of {', '.join(others)} is at their frequencies." * bool(
        others
    )


def _sentences(response: Mapping[str, Any]) -> list[str]:
    """How it was solved where that matters, the highest and the lowest resonance, the largest stress, what the numbers
    are worth."""
    rows, method = response.get("resonances", []), response.get("method", "")
    return [*([method] if method else []), *_of_resonances(response, rows)]


def _of_resonances(response: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """The same without how it was solved."""
    if not rows:
        folds = [f"{_fold(row, _factors(response))}." for row in response.get("folds", ())]
        if (lost := response.get("unsolved")) or folds:
            why = f": {lost}" if lost else ""
            return [f"No resonance was found, though there may be one{why}.", *folds]
        return ["There is no resonance in the band." if "resonances" in response else ""]
    doubtful = sum(bool(row.get("doubt")) for row in rows)
    lifted, valid = lifted_forces(rows), _valid(rows)
    first, *others = response.get("read_outs", [""])
    of = f" of {first}" if others else ""
    peak = partial(_peak, factors=_factors(response))
    said = [f"The highest resonance{' found' if doubtful else ''}{of} is {peak(highest(rows) or {})}"]
    forces = {r["normal_force_N"] for r in valid}
    tops = [max((r for r in valid if r["normal_force_N"] == n), key=_size) for n in forces]
    ends = {r["normal_force_N"] for r in response.get("rising_at_the_edge", [])}
    if len(tops) > 1 and not ends and not any(JUMPS in row.get("doubt", "") for row in rows):
        said[0] += f"; it is lowest with {peak(min(tops, key=_size))}"
    said[0] += "."
    if lifted:
        named = " and ".join(filter(None, [", ".join(map(number, sorted(lifted)[:-1])), number(max(lifted))]))
        said.append(f"Under F_N = {named} N contacts would lift off: what was found there is not valid.")
    return [*said, *_stress(response, valid), _worth(response, len(rows), doubtful)]


def _stress(response: Mapping[str, Any], valid: Sequence[Mapping[str, Any]]) -> list[str]:
    """The largest stress of the resonances that are valid."""
    if not (stressed := [row for row in valid if "stress_amplitude_Pa" in row]):
        return []
    of_body = f" of {response['stressed_body']}" if "stressed_body" in response else ""
    worst = max(stressed, key=lambda row: row["stress_amplitude_Pa"])
    margin = f", reserve factor {number(worst['reserve_factor'], 3)}" if "reserve_factor" in worst else ""
    return [
        f"The largest stress amplitude{of_body} is {number(1e-6 * worst['stress_amplitude_Pa'])} MPa at "
        f"{number(worst['frequency_of_stress_Hz'], 5)} Hz under F_N = {number(worst['normal_force_N'])} N{margin}."
        f"{_in_zones(worst)}"
    ]


def _in_zones(row: Mapping[str, Any]) -> str:
    """What stands beside supports, edges of contacts and sharp inner edges, and why it is not what counts."""
    if "singular_stress_amplitude_Pa" not in row:
        return ""
    size = number(1e-6 * row["singular_stress_amplitude_Pa"])
    if row["singular_location_mm"] == row["location_mm"]:
        return (
            " The whole body lies in singular zones of supports, edges of contacts and sharp inner edges: it is a "
            "property of the mesh; take finer elements."
        )
    return (
        f" That is outside the singular zones of supports, edges of contacts and sharp inner edges; in them it is "
        f"{size} MPa at ({row['singular_location_mm'].replace(' ', ', ')}) mm, a property of the mesh."
    )


def _worth(response: Mapping[str, Any], count: int, doubtful: int) -> str:
    """What the numbers of so many resonances are worth."""
    error = _uncertain(response["estimated_error_of_harmonics"]) if "estimated_error_of_harmonics" in response else ""
    if not doubtful:
        return f"Every resonance passes its checks{error}."
    are = "is" if doubtful == 1 else "are"
    return f"{doubtful} of {counted(count, 'resonance')} {are} doubtful and marked{error}."


def _uncertain(share: float | None) -> str:
    """How uncertain amplitudes are, by a share of them; None, as JSON has it, or infinite where nobody knows."""
    if share is None or not math.isfinite(share):
        return "; how uncertain amplitudes are is not known at some places"
    size = percent(share) if share > HARDLY else f"less than {percent(HARDLY)}"
    return f"; amplitudes are uncertain by {size}{' at most' * (share > HARDLY)}"


HARDLY = 1e-4
"""Share of an amplitude below which an estimate of its error is told no closer."""
NOT_VALID = "not valid"
"""In what speaks against a resonance of contacts that would lift off."""
JUMPS = "another motion"
"""In what speaks against a resonance beside which there is another motion, higher perhaps."""


def lifted_forces(rows: Sequence[Mapping[str, Any]]) -> frozenset[float]:
    """Normal forces under which contacts would lift off at some resonance."""
    return frozenset(row["normal_force_N"] for row in rows if NOT_VALID in row.get("doubt", ""))


def _valid(rows: Sequence[Mapping[str, Any]]) -> Sequence[Mapping[str, Any]]:
    """Those under the other normal forces; all, where there are none."""
    lifted = lifted_forces(rows)
    return [row for row in rows if row["normal_force_N"] not in lifted] or rows


def highest(rows: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """The resonance that a page begins with: the highest of those that are valid."""
    return max(_valid(rows), key=_size, default=None)


def _size(row: Mapping[str, Any]) -> float:
    return amplitude_of(row)[0]


def _peak(row: Mapping[str, Any], factors: Factors) -> str:
    size, of = amplitude_of(row)
    factor, unit = factors.get(of.column("")) or of.shared([size])
    force = number(row["normal_force_N"])
    return f"{number(factor * size)} {unit} at {number(row['frequency_Hz'], 5)} Hz under F_N = {force} N"


def _fold(row: Mapping[str, Any], factors: Factors) -> str:
    return f"The curve turns back, at a fold, or ends at {_peak(row, factors)}"


def _resonances(rows: Sequence[Mapping[str, Any]], factors: Factors) -> Piece:
    """The table of resonances: what speaks against one stands beside its amplitude, and marks its row."""
    doubts = any(row.get("doubt") for row in rows)
    first = ["normal_force_N", "frequency_Hz", *(k for k in rows[0] if k.startswith("amplitude_"))]
    first += ["doubt"] * doubts + [
        k for k in ("stress_amplitude_Pa", "reserve_factor", "damping_ratio") if k in rows[0]
    ]
    order = [*first, *(k for k in dict.fromkeys(k for row in rows for k in row) if k not in (*first, "doubt"))]
    return _table_of([{k: row.get(k, "") for k in order} for row in rows], factors)


def warnings(messages: Sequence[str]) -> Piece:
    """What a reader must know; of sentences that differ in names and numbers alone the first, the others fold below."""
    alike: dict[str, list[str]] = {}
    for message in messages:
        alike.setdefault(_DIFFERS.sub("#", message), []).append(message)
    pieces = list[Piece]()
    for first, *others in alike.values():
        pieces += [say(first), fold(f"{len(others)} more of the same kind", say(*others))][: 1 + bool(others)]
    return Piece("box", pieces, tone="warn")


_DIFFERS = re.compile(r"'[^']*'|^[\w.@-]+:|\b[\w-]*\d[\w.+-]*")
"""Names and numbers in a message."""


def number_tables(tables: Mapping[str, Mapping[str, Any]]) -> list[Piece]:
    """Tables as a page has them: file name -> column -> values."""
    told = {
        name: [dict(zip(columns, map(_number_or_words, row), strict=True))
               for row in zip(*columns.values(), strict=True)]
        for name, columns in tables.items()
    }  # fmt: skip
    factors, pieces = _factors(told), list[Piece]()
    for name, rows in told.items():
        shown = _table_of(rows, factors) if rows else say("")
        heading = f"Numbers in {name}" if name.endswith(".csv") else name
        pieces += [Piece("h2", heading), shown if len(rows) <= MOST_ROWS else fold(f"{len(rows)} rows", shown)]
    return pieces


def _number_or_words(value: Any) -> float | str:
    try:
        return float(value)
    except ValueError:
        return str(value)


def response_pieces(response: Mapping[str, Any], album: Album) -> list[Piece]:
    """What the case tells besides, its other tables, and every picture that no other section took."""
    told = {k: v for k, v in response.items() if not k.endswith("sha256") and v not in ("", None, [])}
    told = {k: v for k, v in told.items() if not response.get(_TOLD.get(k, ""))}
    words = told.pop("description", "")
    told.pop("beyond", None)
    tables = {k: v for k, v in told.items() if isinstance(v, list) and v and isinstance(v[0], Mapping)}
    factors = _factors(response)
    single = {k: _cell(v).removeprefix(f"{k}: ") for k, v in told.items() if k not in tables}
    facts = [(_HEADINGS.get(k) or _label(k), v) for k, v in single.items()]
    rest = [n for n in album.left if n not in SHOWN and not n.startswith(("mode_", "modes_", "animation_"))]
    return [
        say(f"{words}." if words else ""),
        *map(album.take, SHOWN),
        *(
            piece
            for k, v in tables.items()
            if k != "resonances"
            for piece in (Piece("h3", _HEADINGS.get(k) or _label(k).capitalize()), _table_of(v, factors))
        ),
        *(album.take(name, name) for name in rest),
        table((), facts),
    ]


_TOLD = {"stuck_frequencies_Hz": "stuck_modes", "estimated_error_of_harmonics": "resonances", "unsolved": "unsolved"}
"""What need not be told again where the page has a table of something else, or sentences from it."""

_HEADINGS = {
    "stuck_modes": "Modes with sticking contacts, as far as the harmonics reach",
    "stuck_under_N": "normal force of the modes with sticking contacts in N",
    "folds": "Where the response is highest and its curve ends, which is no resonance",
    "motions_in_time": "Motions in time about jumps and gaps, swept in steps or each from rest",
    "rising_at_the_edge": "Where the response still rises at an end of the band",
}
"""Titles of tables and names of facts that their keys do not tell."""


Factors = Mapping[str, tuple[float, str]]
"""End of the names of numbers that are shown in another unit -> factor and that unit."""


def _factors(told: Mapping[str, Any]) -> Factors:
    """Of all numbers of a page: lengths in µm or mm by the largest valid resonance, or by all where it has none."""
    valid = _valid(told.get("resonances", ()))
    rows = valid or [row for v in told.values() if isinstance(v, list) for row in v if isinstance(row, Mapping)]
    numbers = [(_of_column(k)[0], v) for row in rows for k, v in row.items() if isinstance(v, float)]
    found = {of.column(""): of.shared(v for k, v in numbers if _ends(k, of.column(""))) for of in QUANTITIES}
    return {**found, "_Pa": (1e-6, "MPa")}


QUANTITIES = METRES, Quantity("rad"), Quantity("1")
"""What read-outs measure."""


def _ends(key: str, end: str) -> bool:
    """Whether a name ends so; of angles and strains those of a vibration alone."""
    return key.endswith(end) and (end in ("_m", "_Pa") or "amplitude" in key or key.startswith("mean"))


def _table_of(rows: Sequence[Mapping[str, Any]], factors: Factors) -> Piece:
    """Of rows that have the same names. What is rounding beside the largest number of its unit is a zero."""
    columns = [_column(key, factors) for key in rows[0]]
    units = [name.rpartition(" in ")[2] for _, name in columns]
    values = [[v * f if isinstance(v, float) else v for v, (f, _) in zip(row.values(), columns, strict=True)]
              for row in rows]  # fmt: skip
    largest: dict[str, float] = {}
    for row in values:
        for unit, v in zip(units, row, strict=True):
            known = isinstance(v, float) and math.isfinite(v)
            largest[unit] = max(largest.get(unit, 0.0), abs(v) if known else 0.0)
    named = zip(rows[0], units, zip(*values, strict=True), strict=True)
    cells = [_column_of_cells(key, unit, column, largest[unit]) for key, unit, column in named]
    return table([name for _, name in columns], [list(row) for row in zip(*cells, strict=True)])


def _column_of_cells(key: str, unit: str, values: Sequence[Any], largest: float) -> list[str]:
    """Numbers of a column, those that are rounding zero; of what the rows are over in so many digits that a number
    differs from those above and below."""
    least = (OF_MEANS if "mean" in _of_column(key)[0] else ROUNDING) * largest
    known = ["" if v is None or (isinstance(v, float) and math.isnan(v)) else v for v in values]
    shown = [0.0 if isinstance(v, float) and abs(v) < least else v for v in known]
    first = 5 if unit in _EXACT else 4
    most = SURE if unit in _EXACT or key in _OVER else first
    beside = zip([None, *shown[:-1]], shown, [*shown[1:], None], strict=True)
    return [_apart(v, [w for w in (a, b) if isinstance(w, float)], first, most) for a, v, b in beside]


def _apart(value: Any, others: Sequence[float], first: int, most: int) -> str:
    """A number in the fewest digits that tell it from others."""
    if not isinstance(value, float):
        return _cell(value)
    others = [w for w in others if f"{w:.{most}g}" != f"{value:.{most}g}"]
    enough = (d for d in range(first, most) if number(value, d) not in [number(w, d) for w in others])
    return number(value, next(enough, most if others else first))


OF_MEANS = 1e-5
"""Share of the largest number of a unit in a table below which a mean is what Newton's method leaves."""
SURE = 9
"""Digits to which rows of a table are told apart."""
_OVER = ("normal_force_N", "load")
"""Columns, besides those of `_EXACT`, that a curve runs over."""

_UNITS = (
    "m/s",
    "N",
    "Hz",
    "m",
    "mm",
    "µm",
    "m/m",
    "mm/m",
    "µm/m",
    "rad",
    "mrad",
    "µrad",
    "s",
    "Pa",
    "MPa",
    "rpm",
    "W",
    "J",
    "K",
    "rad/s",
)
_EXACT = ("Hz", "rpm", "rad/s")
"""Units of what is shown to a digit more."""


_NAMED = {
    "damping_ratio": (100.0, "damping in %"),
    "slipping": (100.0, "slip in %"),
    "open": (100.0, "open in %"),
    "estimated_error": (100.0, "error in %"),
    "doubt": (1.0, "validity"),
    "normal_force": (1.0, "normal force in N"),
}
"""Columns that people know by other names."""


def _of_column(key: str) -> tuple[str, str]:
    """Name of a column of which a table has one for every normal force, and the words for that force."""
    under = re.fullmatch(r"(.+)_(?:FN_(.+)_N|as_pressed)", key)
    return (key, "") if under is None else (under[1], f"F_N = {under[2]} N: " if under[2] else "as pressed: ")


def _column(key: str, factors: Factors) -> tuple[float, str]:
    """Factor and name of a column: lengths and stresses in units for people."""
    key, under = _of_column(key)
    if under:
        factor, name = _column(key, factors)
        return factor, f"{under}{name}"
    if key in _NAMED:
        return _NAMED[key]
    for end, (factor, unit) in factors.items():
        if _ends(key, end):
            return factor, _label(f"{key.rpartition('_')[0]}_{unit}")
    return 1.0, _label(key)


def _label(key: str) -> str:
    """``normal_force_N`` -> ``normal force in N``."""
    *words, last = re.sub(r"(rad|_m)_s$", r"\1/s", key).split("_")
    unit = "m/m" if last == "strain" else last
    return " ".join([*words, "in", unit] if words and unit in _UNITS else [*words, last])


def _cell(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(map(_cell, value))
    if isinstance(value, float) and not math.isfinite(value):
        return "not known"
    return number(value, 5) if isinstance(value, float) else str(value)
