"""Mistuned rings: the cases that docs/mistuning.md shows, and its tables."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from microslip.stages.running import run_case_file

CASES = Path("pipeline/cases")
SCATTERS = 0.00325, 0.01374
"""Standard deviations of Sextro 5.6."""


def answered(case: str, *assignments: str) -> Path:
    """The folder of a case, run where it is not up to date."""
    run_case_file(CASES / f"{case}.toml", list(assignments), report=print)
    return Path("build") / case


def columns(file: Path) -> dict[str, np.ndarray]:
    """Column -> numbers of a table."""
    rows = list(csv.DictReader(file.open()))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def pictures(folder: Path) -> dict[str, Path]:
    """Name in docs/pictures -> picture of the case."""
    made = answered("ring-mistuned") / "pictures"
    return {f"mistuning_{name}": made / f"{name}.png" for name in ("amplification", "mistuned", "worst")}


def amplification(folder: Path) -> tuple[list[str], list[list[str]]]:
    """Quantiles of the amplification with their intervals, and the extreme-value fit's."""
    found = columns(answered("ring-mistuned") / "quantiles.csv")
    rows = []
    for i, share in enumerate(found["share"]):
        ends = [found[n][i] for n in ("low", "high")]
        said = [f"{v:.3f}" if 0 < v < np.inf else "too few samples" for v in ends]
        fits = [f"{found[n][i]:.3f}" for n in ("generalised_extreme_value", "Weibull")]
        rows.append([f"{100 * share:g} %", f"{found['value'][i]:.3f}", *said, *fits])
    return ["of the samples below", "amplification", "at least", "at most", "extreme-value fit", "Weibull fit"], rows


def first_order(folder: Path) -> tuple[list[str], list[list[str]]]:
    """The book's approximation beside samples, at three frequencies and both scatters."""
    rows = []
    for scatter in SCATTERS:
        made = answered("spin-pit-mistuned", f"mistuning.scatter.0.deviation={scatter}", "mistuning.samples=12")
        samples, near = columns(made / "envelope.csv"), columns(made / "approximation.csv")
        tuned = samples["tuned_m"]
        peak = int(tuned.argmax())
        for i in sorted({max(peak - 6, 0), peak, min(peak + 6, len(tuned) - 1)}):
            j = int(np.abs(near["frequency_Hz"] - samples["frequency_Hz"][i]).argmin())
            rows.append(
                [f"{100 * scatter:g} %", f"{samples['frequency_Hz'][i]:g}", f"{1e6 * tuned[i]:.3g}",
                 f"{1e6 * samples['mean_m'][i]:.3g}", f"{1e6 * samples['deviation_m'][i]:.3g}",
                 f"{1e6 * near['deviation_m'][j]:.3g}", f"{samples['weibull_exponent'][i]:.3g}",
                 f"{near['weibull_exponent'][j]:.3g}"]
            )  # fmt: skip
    head = ["scatter", "Hz", "tuned, um", "mean, um", "deviation, um", "by first order, um", "k", "k by first order"]
    return head, rows
