"""Picture of docs/continuation.md: curves with kinks, and a narrow gap between two branches."""

from __future__ import annotations

from typing import Any

import numpy as np

from microslip.continuation import Branch, Settings, trace

BLUE, RED, GREY = "#0b4f9c", "#c8382c", "#8b93a1"


class Stop:
    """q'' + 0.05 q' + q + 100 max(q - 1, 0) = 0.3 cos(lambda t), seven harmonics from equidistant samples."""

    x_scale, lam_scale = 3.0, 1.0

    def __init__(self, samples: int) -> None:
        t, h = 2 * np.pi * np.arange(samples) / samples, np.arange(1, 8)
        self.wave = np.hstack([np.ones((samples, 1)), np.cos(np.outer(t, h)), np.sin(np.outer(t, h))])
        self.back = self.wave.T / samples * np.r_[1, np.full(14, 2)][:, None]
        self.squares, self.turn, self.load = np.r_[0, h, h].astype(float) ** 2, np.zeros((15, 15)), np.zeros(15)
        self.turn[h, h + 7], self.turn[h + 7, h] = 0.05 * h, -0.05 * h
        self.load[1] = 0.3

    def evaluate(self, x: np.ndarray, lam: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        q = self.wave @ x
        linear = np.diag(1 - lam**2 * self.squares) + lam * self.turn
        force, slope = 100 * np.maximum(q - 1, 0), 100 * (q > 1)[:, None] * self.wave
        by_lam = -2 * lam * self.squares * x + self.turn @ x
        return linear @ x + self.back @ force - self.load, linear + self.back @ slope, by_lam


class Gap:
    """lambda^2 - x^2 = 0.02^2."""

    x_scale, lam_scale = 1.0, 1.0

    def evaluate(self, x: np.ndarray, lam: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return lam**2 - x**2 - 0.02**2, np.array([[-2 * x[0]]]), np.array([2 * lam])


def amplitude(curve: Branch) -> np.ndarray:
    """Of the first harmonic."""
    return np.hypot(curve.x[:, 1], curve.x[:, 8])


def curves(fig: Any, plain: Any) -> Any:
    """Left: a stiff stop with few and many samples. Middle: its kinks near by. Right: branches that nearly touch."""
    left, middle, right = fig.subplots(1, 3)
    for axes in (left, middle, right):
        plain(axes)
        axes.set_xlabel("lambda")
    for samples, colour in ((64, RED), (1024, BLUE)):
        curve = trace(Stop(samples), np.zeros(15), 0.7, Settings(low=0.7, high=2.2, points=5000, step_max=0.05))
        for axes in (left, middle):
            axes.plot(curve.lam, amplitude(curve), color=colour, lw=1.2, label=f"{samples} samples")
        if samples == 64:
            folds = curve.of_kind("fold")
            shown = [p for p in curve.points if p.kind == "regular"]
            middle.plot([p.lam for p in shown], [np.hypot(p.x[1], p.x[8]) for p in shown], ".", color=RED, ms=4)
            middle.plot(
                [p.lam for p in folds], [np.hypot(p.x[1], p.x[8]) for p in folds], "o", color="k", mfc="w", ms=5
            )
    left.set_ylabel("first harmonic")
    left.legend(frameon=False, loc="upper left")
    middle.set_xlim(1.52, 1.68)
    middle.set_ylim(2.2, 2.8)
    middle.set_title("points and folds", fontsize=10)
    curve = trace(Gap(), np.array([-1.0]), -1.0, Settings(low=-1.05, high=1.0))
    x = np.linspace(-0.2, 0.2, 200)
    right.plot(np.hypot(x, 0.02), x, color=GREY, lw=1.2)
    right.plot(curve.lam, curve.x[:, 0], ".-", color=BLUE, lw=1.2, ms=5)
    right.set_xlim(-0.15, 0.15)
    right.set_ylim(-0.15, 0.15)
    right.set_ylabel("x")
    right.set_title("a gap of 0.04", fontsize=10)
    return fig
