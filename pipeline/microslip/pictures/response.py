"""Two-dimensional pictures of results, by matplotlib, off-screen."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..case import CaseResult


def response_picture(result: CaseResult, path: Path) -> None:
    """Amplitude over frequency for every normal force, with the free body and the sticking eigenfrequencies."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 6), dpi=130, layout="constrained")
    axes = figure.subplots()
    axes.semilogy(result.free.frequency, 1e6 * np.abs(result.free.monitor), color="0.6", lw=1, label="no contact")
    colours = _colours(len(result.responses))
    for colour, (normal, r) in zip(colours, sorted(result.responses.items(), reverse=True), strict=True):
        amplitude = np.where(r.converged, 1e6 * np.abs(r.monitor), np.nan)
        axes.semilogy(r.frequency, amplitude, color=colour, lw=1.6, label=f"$F_N$ = {normal:g} N")
    low, high = result.free.frequency[[0, -1]]
    for f in result.stuck[(result.stuck > low) & (result.stuck < high)]:
        axes.axvline(f, color="0.75", lw=0.8, ls="--", zorder=0)
        axes.annotate(
            f"{f:.0f}", (f, 0.0), xycoords=("data", "axes fraction"), xytext=(2, 3), textcoords="offset points",
            fontsize=8, color="0.45",
        )  # fmt: skip
    s = result.settings
    axes.set_xlabel("excitation frequency in Hz")
    axes.set_ylabel(f"amplitude of {s.monitor}, {s.direction}, in µm (0-peak)")
    axes.set_title(f"{s.name}: friction response to {s.amplitude:g} N at {s.excitation}")
    axes.set_xlim(low, high)
    axes.grid(True, which="both", alpha=0.25)
    figure.legend(loc="outside lower center", ncols=6, fontsize=9, title="dashed: sticking contacts", title_fontsize=8)
    figure.savefig(path, format="png")


def _colours(count: int) -> list[tuple[float, ...]]:
    from matplotlib import colormaps

    return [tuple(colormaps["viridis"](x)) for x in np.linspace(0.05, 0.85, max(count, 1))]
