"""Motions of two frequencies as a reader asks for them: amplitudes of every pair, spectrum, torus, motion in time."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Array, ComplexArray, Indices
from ..errors import UserError
from ..settings.mistakes import numbered
from ..units import UNIT_OF_FREQUENCY, Quantity, hertz
from .dataset import Dataset, Variable
from .series import CONVERGED, of_solutions

if TYPE_CHECKING:
    from matplotlib.axes import Axes

KIND = "two_tones"

VARIABLES = {
    "first": ("Hz", "of the first tone", ("point",)),
    "second": ("Hz", "of the second tone", ("point",)),
    "amplitude": ("as unit says", "of the read-outs, 0-peak", ("point", "readout", "pair")),
    "supplied": ("W", "by the loads of either tone, in the mean", ("point", "tone")),
    "damped": ("W", "in the bodies", ("point",)),
    "exchanged": ("W", "that goes into contacts, by the harmonics of their forces", ("point",)),
    "lost": ("W", "that contacts count themselves", ("point",)),
    "error": ("1", "of the last step of Newton's method, over the size of the unknowns", ("point",)),
    "status": ("1", "converged, or what went wrong", ("point",)),
    "k1": ("1", "multiple of the first frequency", ("pair",)),
    "k2": ("1", "multiple of the second frequency", ("pair",)),
    "readout": ("1", "what is read", ("readout",)),
    "unit": ("1", "of what is read", ("readout",)),
    "tone": ("1", "number", ("tone",)),
}
"""Array of a file -> its unit, what it holds, and its axes."""

OF_A_MOTION = ("amplitude", "supplied", "damped", "exchanged", "lost")
"""Arrays that tell nothing where a point was not found."""

SHOWN = 6
"""Pairs that a curve shows at most."""


@dataclass(frozen=True, eq=False, repr=False)
class TwoTones:
    """Quasi-periodic motions, a point for each pair of frequencies.

    A read-out is y = Re sum over k of amplitude_k exp(i (k_1 Omega_1 + k_2 Omega_2) t); of k and -k only one is there.

    Attributes:
        first, second: (f,) Hz. pairs: (P, 2) k; the first one is (0, 0), the mean. amplitude: (f, w, P) complex,
            0-peak, in the units of the read-outs. readouts: (w,) names. units: (w,) SI.
        supplied: (f, 2) W by the loads of either tone, in the mean. damped: (f,) W in the bodies. exchanged: (f,) W
            that goes into contacts, by their forces' harmonics; lost: (f,) W that the contacts count themselves, as
            friction times the path slid, less what moving ground brings. All of them nan where a
            point was not found.
        status: of every point. error: (f,) of the last step of Newton's method, over the size of the unknowns.
            messages: what a reader must know. over: what a sweep runs over. shown: unit of frequencies in sentences.
    """

    first: Array
    second: Array
    pairs: Indices
    amplitude: ComplexArray
    readouts: tuple[str, ...]
    units: tuple[str, ...]
    supplied: Array
    damped: Array
    exchanged: Array
    lost: Array
    status: tuple[str, ...]
    error: Array
    messages: tuple[str, ...] = ()
    shown: str = field(default_factory=UNIT_OF_FREQUENCY.get)

    def __post_init__(self) -> None:
        told = {name: np.asarray(getattr(self, name)) for name in OF_A_MOTION}
        for name, values in of_solutions(told, self.converged).items():
            object.__setattr__(self, name, values)

    def __len__(self) -> int:
        return len(self.first)

    @property
    def converged(self) -> Array:
        """(f,) bool."""
        return np.array([s == CONVERGED for s in self.status], dtype=bool)

    @property
    def failures(self) -> list[tuple[float, str]]:
        """Hz of the first tone and cause of every point that was not found."""
        return [(float(f), s) for f, s in zip(self.first, self.status, strict=True) if s != CONVERGED]

    @property
    def order(self) -> int:
        """H, the largest |k_1| + |k_2|."""
        return int(np.abs(self.pairs).sum(axis=1).max())

    def of(self, k_1: int, k_2: int, readout: int = 0) -> ComplexArray:
        """(f,) complex amplitudes of k_1 times the first and k_2 times the second frequency.

        Raises:
            UserError: a pair that is not balanced.
        """
        numbered("readout", readout, len(self.readouts), "read-out")
        for sign in (1, -1):
            found = np.flatnonzero((self.pairs == sign * np.array([k_1, k_2])).all(axis=1))
            if len(found):
                one = self.amplitude[:, readout, found[0]]
                return one if sign > 0 else one.conj()
        raise UserError(f"pair: ({k_1}, {k_2}) is not among those of {self.order} harmonics; ask for more of them")

    def frequencies(self, i: int = 0) -> Array:
        """(P,) Hz of all pairs at a point; negative where the faster part is subtracted."""
        return self.pairs @ np.array([self.first[i], self.second[i]])

    def motion(self, time: Any, i: int = 0, readout: int = 0) -> Array:
        """(t,) a read-out of point i at times (t,) s."""
        turned = 2j * np.pi * np.asarray(time, dtype=float)[..., None] * self.frequencies(i)
        return np.asarray((np.exp(turned) @ self.amplitude[i, readout]).real)

    def torus(self, i: int = 0, readout: int = 0, count: int = 64) -> Array:
        """(n, n) a read-out over both angles, n places of either, theta_1 along the first axis."""
        at = np.exp(2j * np.pi * np.outer(np.arange(count), np.arange(-self.order, self.order + 1)) / count)
        square = np.zeros((2 * self.order + 1, 2 * self.order + 1), dtype=complex)
        square[tuple((self.pairs + self.order).T)] = self.amplitude[i, readout]
        return np.asarray((at @ square @ at.T).real)

    @property
    def balance(self) -> Array:
        """(f,) what the loads supply less what bodies and contacts lose by their own count, over what is supplied."""
        size = np.abs(self.supplied).sum(axis=1) + np.abs(self.damped) + np.abs(self.lost)
        return np.asarray((self.supplied.sum(axis=1) - self.damped - self.lost) / np.where(size > 0, size, 1.0))

    def to_dataframe(self, readout: int = 0) -> Any:
        """A `pandas.DataFrame`: one point by pairs, several by points with a column of each pair's amplitude."""
        import pandas

        return pandas.DataFrame(self.columns(readout))

    def columns(self, readout: int = 0) -> dict[str, Any]:
        """Name with unit -> column of the table, see `to_dataframe`."""
        name = Quantity(self.units[readout]).column("amplitude") if self.units else "amplitude"
        size = np.abs(self.amplitude[:, readout])
        if len(self) == 1:
            phase = np.angle(self.amplitude[0, readout])
            return {
                "k1": self.pairs[:, 0], "k2": self.pairs[:, 1], "frequency_Hz": self.frequencies(), name: size[0],
                "phase_rad": phase,
            }  # fmt: skip
        each = {f"{name}_{a}_{b}": size[:, j] for j, (a, b) in enumerate(self.pairs)}
        own = {"supplied_1_W": self.supplied[:, 0], "supplied_2_W": self.supplied[:, 1], "damped_W": self.damped}
        tones = {"frequency_1_Hz": self.first, "frequency_2_Hz": self.second}
        return {**tones, **each, **own, "lost_W": self.lost, "status": list(self.status)}

    @property
    def data(self) -> Dataset:
        """Everything, as `VARIABLES` say."""
        more = {"status": self.status, "k1": self.pairs[:, 0], "k2": self.pairs[:, 1], "readout": self.readouts}
        values = {**vars(self), **more, "unit": self.units, "tone": np.array([1, 2])}
        variables = {name: Variable(np.asarray(values[name]), *how) for name, how in VARIABLES.items()}
        return Dataset(KIND, variables, {"messages": list(self.messages)})

    @classmethod
    def of_data(cls, data: Dataset) -> TwoTones:
        """What `data` holds."""
        arrays: dict[str, Any] = {name: data[name] for name in ("first", "second", *OF_A_MOTION, "error")}
        words = {"readouts": "readout", "units": "unit", "status": "status"}
        texts: dict[str, Any] = {field: tuple(data[name].tolist()) for field, name in words.items()}
        pairs = np.column_stack([data["k1"], data["k2"]])
        return cls(**arrays, **texts, pairs=pairs, messages=tuple(data.facts["messages"]))

    def to_xarray(self) -> Any:
        """Everything as an `xarray.Dataset` over point, readout, pair and tone; units are attributes."""
        return self.data.to_xarray().set_coords(["first", "second", "status", "k1", "k2"])

    def save(self, path: Path | str) -> Path:
        """Write a file (``docs/two_tones.md``), complete or absent; `microslip.load` reads it.

        Raises:
            UserError: no permission, no space; a file that is none of two tones stands there.
        """
        return self.data.save(path)

    # pictures --------------------------------------------------------------------------------------------------------

    def plot(self, axes: Axes | None = None, readout: int = 0, point: int | None = None) -> Axes:
        """Draw the spectrum of a point, or over all points the amplitudes of the strongest pairs.

        Args:
            axes: of matplotlib, new ones if not given. readout: its number. point: its number; of a single point it
                need not be given.
        """
        numbered("readout", readout, len(self.readouts), "read-out")
        numbered("point", point or 0, len(self), "point")
        if axes is None:
            import matplotlib.pyplot as plt

            axes = plt.subplots(layout="constrained")[1]
        if point is None and len(self) > 1:
            return self._curves(axes, readout)
        return self._spectrum(axes, readout, point or 0)

    def _spectrum(self, axes: Axes, readout: int, i: int) -> Axes:
        f, a = np.abs(self.frequencies(i)[1:]), np.abs(self.amplitude[i, readout, 1:])
        by, unit = Quantity(self.units[readout]).scale(a.max(initial=0.0))
        seen = a > 1e-6 * a.max(initial=0.0)
        low = 10.0 ** np.floor(np.log10(by * a[seen].min(initial=1.0))) if seen.any() else 1e-6
        own = (self.pairs[1:] == 0).any(axis=1)
        for which, color, label in ((own, "#0b4f9c", "one tone"), (~own, "#c8382c", "combinations")):
            chosen = which & seen
            axes.vlines(f[chosen], low, by * a[chosen], color=color, linewidth=1.2)
            axes.plot(f[chosen], by * a[chosen], "o", color=color, markersize=3, label=label)
        axes.set(yscale="log", xlabel="frequency in Hz", ylabel=f"amplitude of {self.readouts[readout]} in {unit}")
        axes.legend(fontsize=8, frameon=False)
        return axes

    def _curves(self, axes: Axes, readout: int) -> Axes:
        size = np.abs(self.amplitude[:, readout])
        by, unit = Quantity(self.units[readout]).scale(float(np.nanmax(size, initial=0.0)))
        strongest = [j for j in np.argsort(-np.nanmax(size, axis=0, initial=0.0)) if self.pairs[j].any()][:SHOWN]
        for j in strongest:
            axes.plot(self.first, by * size[:, j], label="({}, {})".format(*self.pairs[j]))
        axes.set(xlabel="first frequency in Hz", ylabel=f"amplitude of {self.readouts[readout]} in {unit}")
        axes.legend(title="multiples of both", fontsize=8, frameon=False)
        return axes

    def plot_torus(self, axes: Axes | None = None, i: int = 0, readout: int = 0) -> Axes:
        """Draw a read-out over both angles, and the way that the motion takes there."""
        if axes is None:
            import matplotlib.pyplot as plt

            axes = plt.subplots(layout="constrained")[1]
        U = self.torus(i, readout, 96)
        by, unit = Quantity(self.units[readout]).scale(float(np.abs(U).max(initial=0.0)))
        drawn = axes.contourf(np.arange(97) / 96, np.arange(97) / 96, by * np.pad(U.T, (0, 1), mode="wrap"), 24)
        axes.figure.colorbar(drawn, ax=axes, label=f"{self.readouts[readout]} in {unit}")
        t = np.linspace(0.0, 6.0 / max(self.first[i], self.second[i]), 2000)
        x, y = np.mod(self.first[i] * t, 1.0), np.mod(self.second[i] * t, 1.0)
        jumps = np.flatnonzero((np.diff(x) < 0) | (np.diff(y) < 0)) + 1
        axes.plot(np.insert(x, jumps, np.nan), np.insert(y, jumps, np.nan), color="white", linewidth=0.8)
        axes.set(xlabel="turns of the first angle", ylabel="turns of the second angle", xlim=(0, 1), ylim=(0, 1))
        return axes

    def __repr__(self) -> str:
        said = f"{len(self)} point{'s' if len(self) != 1 else ''}, {self.order} harmonics"
        if len(self):
            said += (
                f"; first {hertz(self.first.min(), self.shown)} to {hertz(self.first.max(), self.shown)}"
                if len(self) > 1
                else (f"; {hertz(self.first[0], self.shown)} and {hertz(self.second[0], self.shown)}")
            )
        if self.amplitude.size and self.converged.any():
            one, two = (np.where(self.converged, np.abs(self.of(*k)), 0.0).max() for k in ((1, 0), (0, 1)))
            most = f"amplitudes at most {one:.4g} and {two:.4g} {Quantity(self.units[0]).said}"
            said += f"; {most if one or two else f'{self.readouts[0]} does not move'}"
        bad = self.failures
        return f"<TwoTones: {said}; {f'{len(bad)} not converged: {bad[0][1]}' if bad else 'all converged'}>"
