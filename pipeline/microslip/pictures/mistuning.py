"""Mistuned rings: histogram of the amplification, envelopes over the frequency, the worst pattern on its ring."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Array
from ..harmonic_balance.readout import measured
from ..mistuning.ensemble import Ensemble
from ..mistuning.samples import Sample
from ..mistuning.sensitivity import Approximation
from ..mistuning.statistics import fits
from .plots import COLOURS, numbers_within, panels, plain_axes

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def amplification_picture(found: Ensemble, figure: Figure, title: str) -> None:
    """Histogram of the highest blade, its 95 % quantile with the interval, and the extreme-value fit."""
    from scipy.stats import genextreme

    (axes,) = panels(figure, (8.0, 4.8))
    a = found.amplification[found.solved]
    counts, edges, _ = axes.hist(a, bins=min(max(10, int(np.sqrt(len(a)))), 80), color="#9ec5e8", edgecolor="white")
    q, top = found.quantile(0.95), 1.05 * float(np.max(counts))
    if np.isfinite(q.high) and q.low > 0:
        axes.fill_betweenx([0, top], q.low, q.high, color=COLOURS[1], alpha=0.15, linewidth=0)
    axes.vlines(q.value, 0, top, color=COLOURS[1], label=f"95 % quantile: {q}")
    axes.vlines(1.0, 0, top, color="0.3", linestyle="--", linewidth=1.0, label="tuned ring")
    for fit in fits(a)[:1]:
        p = fit.parameters
        x = np.linspace(edges[0], edges[-1], 300)
        y = genextreme.pdf(x, p["shape"], p["location"], p["scale"]) * len(a) * (edges[1] - edges[0])
        axes.plot(x, y, label=f"{fit.name}, misfit {fit.distance:.2g}")
    axes.set(xlabel="amplification: highest blade over the tuned ring's highest", ylabel="samples", title=title)
    axes.set_ylim(0, 1.3 * top)
    axes.legend(fontsize=9, loc="upper center", ncols=2)  # above all that is drawn


def envelope_picture(found: Ensemble, near: Approximation | None, figure: Figure, title: str) -> None:
    """Mean, 95 % envelope and the extremes of all blades over the frequency, above; the Weibull exponent, below (Sextro
    Figs. 5.6-3 to 5.6-6). near: the same by first order, dashed."""
    top, bottom = panels(figure, (8.5, 7.0), 2, sharex=True, height_ratios=[2.2, 1.0])
    f, e = found.asked.frequency, found.envelope.columns()
    by, unit = measured(found.asked.tuned.whole).scale(float(found.tuned.top.amplitude))
    low, high = (by * e[f"quantile_{p}_percent"] for p in ("2.5", "97.5"))
    top.fill_between(f, low, high, color="#9ec5e8", alpha=0.6, linewidth=0, label="95 % of all blades")
    top.plot(f, by * e["highest"], color="0.55", linewidth=0.9, label="highest of all")
    top.plot(f, by * e["mean"], color=COLOURS[0], label="mean")
    top.plot(f, by * np.nanmax(found.tuned.grid, axis=1), color=COLOURS[1], linestyle="--", label="tuned ring")
    bottom.plot(f, np.log(e["weibull_exponent"]), label="samples")
    if near is not None:
        dots: dict[str, Any] = {"ls": ":", "color": COLOURS[3], "linewidth": 1.4}
        for share, label in ((0.025, "95 % by first order"), (0.975, None)):
            top.plot(near.frequency, by * near.envelope(share), label=label, **dots)
        bottom.plot(near.frequency, np.log(near.weibull_exponent), label="first order", **dots | {"linewidth": None})
        bottom.legend(fontsize=9)
    top.set(ylabel=f"amplitude in {unit}", yscale="log", title=title)
    numbers_within(top.yaxis)
    top.legend(fontsize=9)
    bottom.axhline(0.0, color="0.5", linewidth=0.8)
    bottom.set(xlabel="excitation frequency in Hz", ylabel="ln k (Weibull)", xlim=(f[0], f[-1]))


def sensitivity_picture(near: Approximation, figure: Figure, title: str) -> None:
    """By how many percent a blade's amplitude changes with one percent more frequency of a blade so many sectors
    further, over the frequency."""
    (axes,) = panels(figure, (8.5, 4.6))
    share = (near.sensitivity.sum(axis=2) / near.mean[:, None]).T
    N = len(share)
    order = (np.arange(N) - N // 2) % N
    most, f = float(np.abs(share).max()), near.frequency
    half = 0.5 * float(np.ptp(f)) / max(len(f) - 1, 1) or 0.5  # a cell is about its frequency
    image = axes.imshow(
        share[order], aspect="auto", origin="lower", cmap="RdBu_r", vmin=-most, vmax=most, interpolation="nearest",
        extent=(f[0] - half, f[-1] + half, -(N // 2) - 0.5, N - N // 2 - 0.5),
    )  # fmt: skip
    axes.grid(False)
    axes.set(xlabel="excitation frequency in Hz", ylabel="sectors further", title=title)
    figure.colorbar(image, label="% of amplitude by % of frequency")


SHOWN = {"added_mass": (1e3, "g"), "gap": (1e6, "µm"), "modal_file": (1.0, "number")}
"""What is no share of something nominal, in which unit it is drawn."""


def worst_picture(found: Ensemble, one: Sample, figure: Figure, title: str) -> None:
    """The sample with the highest blade: amplitudes round the ring at its peak, and what differs."""
    figure.set_size_inches(9.0, 4.8)
    ring: Any = figure.add_subplot(1, 2, 1, projection="polar")
    N = found.asked.tuned.sectors
    place = int(np.abs(one.top.frequencies - one.top.frequency).argmin())
    y = one.top.amplitudes[place] / found.tuned.top.amplitude
    turn = 2 * np.pi * np.arange(N) / N
    ring.bar(turn, y, width=0.85 * turn[1], color=[COLOURS[int(i == one.top.output)] for i in range(N)])
    ring.plot(np.linspace(0, 2 * np.pi, 200), np.ones(200), "--", color="0.4", linewidth=1.0)
    ring.set(xticks=turn, xticklabels=[str(i) for i in range(N)], theta_zero_location="N", theta_direction=-1)
    ring.tick_params(labelsize=8)
    ring.set_title(f"amplification at {one.top.frequency:.6g} Hz", fontsize=10)
    axes = figure.add_subplot(1, 2, 2)
    plain_axes(axes)
    drawn: list[tuple[str, Array]] = []
    for s, v in found.asked.deviations(one.number):
        by, unit = SHOWN.get(s.of, (100.0, "%"))
        name = s.of.replace("_", " ") + (", first mode" if np.ptp(v, axis=1).any() else "")
        drawn.append((f"{name}, {unit}", by * v[:, 0]))
    width = 0.8 / max(len(drawn), 1)
    for i, (name, v) in enumerate(drawn):
        axes.bar(np.arange(N) + (i - 0.5 * (len(drawn) - 1)) * width, v, width, color=COLOURS[i % 10], label=name)
    axes.set(xlabel="blade", ylabel="deviation")
    axes.legend(fontsize=9)
    figure.suptitle(f"{title}: sample {one.number}, blade {one.top.output}")
