"""The answer of a case in all of its products, and by how much two of them differ."""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from microslip.data import Array
from microslip.report.page import number, text
from microslip.results import Response, Series, read_response
from microslip.units import amplitude_of

Raw = dict[str, Any]
Change = Callable[[str, Array], tuple[str, Array]]
"""Name and values (f, ...) of an array of a response -> those that another way of writing the case gives; no name: it
says nothing of them."""

OWN = ("iterations", "history", "error", "x", "peak", "added", "checks/", "exchanged")
"""Arrays of the solver's way, or of rounding."""


@dataclass(frozen=True)
class Answer:
    """All products of a case: response.csv, .h5, .json, the rows of resonances in .html and their unit."""

    text: str
    response: Response
    summary: Raw
    page: list[list[str]]
    unit: str

    @property
    def table(self) -> dict[str, Array]:
        """Column of the table -> values; not a number where a series has no point at the frequency of another one."""
        head, *rows = csv.reader(self.text.splitlines())
        return dict(zip(head, np.array([[c or "nan" for c in row] for row in rows], dtype=float).T, strict=True))

    @property
    def swept(self) -> dict[str, Array]:
        """The same of the frequencies that were asked for."""
        table = self.table
        return {name: values[table["asked"] == 1] for name, values in table.items()}


def answer(folder: Path) -> Answer:
    """The products in a folder, which agree with each other."""
    page = (folder / "response.html").read_text(encoding="utf-8")
    found = re.search(r"<th>amplitude in ([^<]*)</th>.*?<tbody>(.*?)</tbody>", page, re.S)
    cells = [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in (found[2].split("</tr>") if found else [])]
    summary = json.loads((folder / "response.json").read_text())
    made = Answer(
        (folder / "response.csv").read_text(), read_response(folder / "response.h5"), summary, [c for c in cells if c],
        found[1] if found else "",
    )  # fmt: skip
    _agree(made)
    return made


def _agree(a: Answer) -> None:
    """The table, the page and the response file say the same as far as their digits go."""
    rows = a.summary["resonances"]
    shown = a.page if rows else []  # without one, that table tells what rises at the edge of the band
    for row, told, cells in zip(rows, a.response.resonances, shown, strict=True):  # the summary has stresses besides
        np.testing.assert_allclose(*([r[k] for k in told if k != "doubt"] for r in (row, told)), rtol=1e-12)
        amplitude, quantity = amplitude_of(told)
        factor = next(f for f in (1.0, 1e3, 1e6, 1e9) if quantity.scale(1 / f)[1] == a.unit)
        assert {text(number(told["frequency_Hz"], 5)), text(number(factor * amplitude))} <= {*cells}
    size = a.response.series[0].quantity.column("amplitude")
    names = [name for name in a.table if name.startswith(f"{size}_FN_")]
    for name, series in zip(names, a.response.series, strict=True):
        there = ~np.isnan(a.table[name])
        np.testing.assert_allclose(a.table["frequency_Hz"][there], series.frequency, rtol=1e-8)
        np.testing.assert_allclose(a.table[name][there], series.amplitude, rtol=1e-8)


def asked(series: Series) -> Array:
    """(f,) bool: the points of the sweep itself."""
    return (series.arrays["peak"] == 0) & (series.arrays["added"] == 0)


def differences(a: Answer, b: Answer, change: Change = lambda name, values: (name, values)) -> dict[str, float]:
    """Product and name -> largest difference of b from what a says of it, as a share of the largest value of its kind.

    Args:
        change: see `Change`.
    """
    found = _of_tables(a.swept, b.swept) | of_summaries(a.summary, b.summary)
    for one, other in zip(a.response.series, b.response.series, strict=True):
        expected = dict(change(n, v) for n, v in known(one, a).items())
        expected.pop("", None)
        found |= {f"h5 {n}": d for n, d in apart(expected, known(other, b)).items()}
    return found


def known(series: Series, a: Answer, added: bool = True) -> dict[str, Array]:
    """The arrays at points of the sweep, and added ones, that converged; peaks stand in the table of resonances. Every
    row of a read-out by itself, ``monitors/tip/u_x``: their order is that in which they are asked for."""
    at, labels = series.converged & (series.arrays["peak"] == 0 if added else asked(series)), a.response.labels
    rows = {f"{n}/{label}": series.arrays[n][at, i] for n in labels for i, label in enumerate(labels[n])}
    return {n: v[at] for n, v in series.arrays.items() if n not in labels and not n.startswith(OWN)} | rows


def _of_tables(a: dict[str, Array], b: dict[str, Array]) -> dict[str, float]:
    if len(a) != len(b):
        return {"csv columns": math.inf}
    found = {}
    for (name, x), y in zip(a.items(), b.values(), strict=True):  # the force that names a column may be another one's
        kind, _, force = name.partition("_FN_")
        size = max(np.abs(v).max() for n, v in a.items() if _kind(n) == _kind(name))
        if kind == "phase_rad":
            moved = next(v for n, v in a.items() if n.startswith("amplitude") and n.endswith(force))
            x, y, size = moved * np.exp(1j * x), moved * np.exp(1j * y), moved.max()
        if kind != "iterations":
            found[f"csv {name}"] = _apart(kind, x, y) / (size or 1.0)
    return found


def _kind(name: str) -> str:
    kind = name.split("_FN_")[0]
    return "energy" if kind.endswith("_J") else "motion" if kind.startswith(("amplitude", "mean")) else kind


def of_summaries(a: Raw, b: Raw) -> dict[str, float]:
    """Entry -> largest relative difference; of stresses, some of which are zero, as a share of the largest one."""
    found = {}
    for key in ("resonances", "rising_at_the_edge", "stuck_modes", "stuck_frequencies_Hz"):
        x, y = (of_rows(s[key]) for s in (a, b))
        stress = [k.endswith("_Pa") for k in _told(a[key][0])] if x.ndim == 2 else [False]
        size = np.where(stress, np.abs(x[..., stress]).max(initial=0.0) if any(stress) else 0.0, np.abs(x))
        found[f"json {key}"] = float((np.abs(y - x) / size).max(initial=0.0)) if x.shape == y.shape else math.inf
    told = (len(a["messages"]), a["failed_points"]) == (len(b["messages"]), b["failed_points"])
    return found | {"json messages": 0.0 if told else math.inf}


def of_rows(rows: list[Any]) -> Array:
    """Numbers of rows but the normal force, by which they are only named."""
    return np.array([[*_told(r).values()] if isinstance(r, dict) else r for r in rows], dtype=float)


def _told(row: Raw) -> Raw:
    """Without shares of points and samples, which flip as rounding has it, and with them the estimate of error; without
    further read-outs, which other axes and another order name otherwise: the response file has them."""
    other = ("normal_force_N", "slipping", "open", "estimated_error")
    return {k: v for k, v in row.items() if k not in other and " amplitude_" not in k and isinstance(v, float)}


def apart(a: dict[str, Array], b: dict[str, Array]) -> dict[str, float]:
    """Name -> largest difference of arrays, as a share of the largest value of its kind."""
    if a["frequency"].shape != b["frequency"].shape:
        return {"points": math.inf}
    sizes: dict[tuple[str, int], float] = {("unsteady", 0): 1.0}
    for n, v in a.items():
        for i, part in enumerate(_parts(n, v)):
            sizes[_unit(n), i] = max(sizes.get((_unit(n), i), 1e-300), float(np.abs(part).max(initial=0.0)))
    found = {}
    for n, v in a.items():
        pairs = zip(_parts(n, v), _parts(n, b[n]) if n in b else [None, None], strict=False)
        each = [math.inf if y is None else _apart(n, x, y) / sizes[_unit(n), i] for i, (x, y) in enumerate(pairs)]
        found[n] = max(each)
    return found


FLIPS = 0.02
"""Share of points and samples that may slide or stick, be open or closed, as rounding has it: those on the edge."""


def _apart(name: str, x: Array, y: Array) -> float:
    """The largest difference; of what is counted as far as it is beyond `FLIPS`."""
    found = float(np.abs(y - x).max(initial=0.0))
    return max(found - FLIPS, 0.0) if _unit(name.split("_FN_")[0]) in ("slipping", "open") else found


def _parts(name: str, values: Array) -> list[Array]:
    """Forces and displacements of a contact apart from moments and rotations."""
    split = name.startswith("contacts/") and values.ndim == 3
    return [values[:, [0, 1, 2, *range(6, values.shape[1])]], values[:, 3:6]] if split else [values]


ENERGIES = ("supplied", "damped", "dissipated", "by_slip", "lost")


def _unit(name: str) -> str:
    last = name.split("/")[-1]
    return "energy" if last in ENERGIES else last if name.startswith(("contacts/", "bodies/")) else name.split("/")[0]


def changed_bits(a: Answer, b: Answer) -> list[str]:
    """What is not the same to the last bit in table, arrays (but the time they took), numbers and page."""
    found = ["csv"] * (a.text != b.text) + ["html"] * (a.page != b.page)
    told = [{k: v for k, v in x.summary.items() if not k.endswith("sha256")} for x in (a, b)]
    found += [f"json {k}" for k in told[0] | told[1] if told[0].get(k) != told[1].get(k)]
    found += [f"h5 {n}" for n in ("labels", "settings", "inputs") if getattr(a.response, n) != getattr(b.response, n)]
    found += ["h5 series"] * (len(a.response.series) != len(b.response.series))
    for one, other in zip(a.response.series, b.response.series, strict=False):
        names = {*one.arrays, *other.arrays}
        same = {n for n in names & {*one.arrays} & {*other.arrays}
                if one.arrays[n].tobytes() == other.arrays[n].tobytes()}  # fmt: skip
        found += [f"h5 {n}" for n in sorted(names - same)] + ["h5 status"] * (one.status != other.status)
    return found
