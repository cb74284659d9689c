"""Mistuned rings: the cases that docs/mistuning.md shows, and its tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from microslip.stages.running import run_case_file

CASES = Path("pipeline/cases")
SCATTERS = {"spin-pit-mistuned": 0.00325, "spin-pit-mistuned-wide": 0.01374}
"""Name of the case -> standard deviation of the blades' frequencies (Sextro Figs. 5.6-3 and 5.6-5)."""


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
    return {f"mistuning_{name}": made / f"{name}.png" for name in ("amplification", "mistuned", "worst", "sensitivity")}


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
    return ["Hz", "tuned, µm", "mean, µm", "deviation, µm", "by first order, µm", "k", "k by first order"], rows


def spin_pit(build: Path = Path("build"), to: Path = Path("tests/validation")) -> None:
    """The figures of 5.6 from the runs of both scatters, as the tables that tests/validation/test_sextro_5_6.py reads:
    a quarter of an hour of CPU time where they are not there yet."""
    lines = {"envelopes": [""], "samples": [""]}
    for name, deviation in SCATTERS.items():
        made = build / name
        if not (made / "samples.csv").is_file():
            given = [f"name={name}", f"mistuning.scatter.0.deviation={deviation}", "mistuning.samples=40"]
            run_case_file(CASES / "spin-pit-mistuned.toml", given, report=print)
        head, *rows = (made / "samples.csv").read_text().split()
        lines["samples"] = [f"scatter,{head}", *lines["samples"][1:], *(f"{deviation},{row}" for row in rows)]
        head, *rows = (made / "envelope.csv").read_text().split()
        near, *others = ([row.split(",")[i] for i in range(1, 6)] for row in
                         (made / "approximation.csv").read_text().split())  # fmt: skip
        lines["envelopes"] = [
            f"scatter,{head},{','.join(f'first_order_{n}' for n in near)}", *lines["envelopes"][1:],
            *(f"{deviation},{row},{','.join(other)}" for row, other in zip(rows, others, strict=True)),
        ]  # fmt: skip
    for name, table in lines.items():
        (to / f"sextro_5_6_{name}.csv").write_text("\n".join(table) + "\n")


if __name__ == "__main__":
    spin_pit()
