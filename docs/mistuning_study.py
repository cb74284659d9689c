"""Mistuned rings: the cases that docs/mistuning.md shows, and its tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from microslip.stages.running import run_case_file

CASES = Path("pipeline/cases")

def answered(case: str) -> Path:
    """The folder of a case, run where it is not up to date."""
    run_case_file(CASES / f"{case}.toml", report=print)
    return Path("build") / case


def columns(file: Path) -> np.ndarray:
    """Numbers of a table by its columns."""
    return np.genfromtxt(file, delimiter=",", names=True)


def pictures() -> dict[str, Path]:
    """Name in docs/pictures -> picture of the case."""
    made = answered("ring-mistuned") / "pictures"
    return {f"mistuning_{name}": made / f"{name}.png" for name in ("amplification", "mistuned", "worst")}


def amplification() -> tuple[list[str], list[list[str]]]:
    """Quantiles of the amplification with their intervals, and the extreme-value fit's."""
    found = columns(answered("ring-mistuned") / "quantiles.csv")
    rows = []
    for i, share in enumerate(found["share"]):
        ends = [found[n][i] for n in ("low", "high")]
        said = [f"{v:.3f}" if 0 < v < np.inf else "too few samples" for v in ends]
        fits = [f"{found[n][i]:.3f}" for n in ("generalised_extreme_value", "Weibull")]
        rows.append([f"{100 * share:g} %", f"{found['value'][i]:.3f}", *said, *fits])
    return ["of the samples below", "amplification", "at least", "at most", "extreme-value fit", "Weibull fit"], rows


def first_order() -> tuple[list[str], list[list[str]]]:
    """The book's approximation beside samples, on the flanks, where sliding begins and on the plateau."""
    made = answered("ring-mistuned")
    samples, near = columns(made / "envelope.csv"), columns(made / "approximation.csv")
    rows = []
    for f in (100.0, 105.0, 109.0, 110.0, 112.0, 116.0, 120.0, 125.0):
        i, j = (int(np.abs(one["frequency_Hz"] - f).argmin()) for one in (samples, near))
        rows.append(
            [f"{f:g}", f"{1e6 * samples['tuned_m'][i]:.3g}", f"{1e6 * samples['mean_m'][i]:.3g}",
             f"{1e6 * samples['deviation_m'][i]:.3g}", f"{1e6 * near['deviation_m'][j]:.3g}",
             f"{samples['weibull_exponent'][i]:.3g}", f"{near['weibull_exponent'][j]:.3g}"]
        )  # fmt: skip
    return ["Hz", "tuned, um", "mean, um", "deviation, um", "by first order, um", "k", "k by first order"], rows
