"""Motions of a sweep or along a curve, in order: what they say of themselves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data import Array, ComplexArray, Indices
from ..errors import UserError
from ..settings.mistakes import numbered
from ..units import Quantity, counted

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CONVERGED = "converged"

READ = ("monitors/", "angles/", "gauges/")
"""How the names of read-outs begin."""

OF_A_MOTION = ("x", "supplied", "damped", "exchanged", "kinetic")
"""Arrays, beside those of read-outs, bodies and contacts, that tell nothing where a point is no solution."""

UNITS = {
    "frequency": "Hz", "Omega": "rad/s", "supplied": "J", "damped": "J", "dissipated": "J", "kinetic": "J",
    "exchanged": "J", "lost": "J", "by_slip": "J", "monitors": "m", "angles": "rad", "gauges": "1",
    "bodies": "m kg^1/2", "displacement": "m, rad", "force": "N, N m", "forces": "N, N m", "limit": "N",
    "normal_swing": "N", "normal_mean": "N",
}  # fmt: skip
"""Units by the last part of a name, or by its first one, as of read-outs, whose last part is anybody's choice;
everything else is a pure number."""

OVER = {
    "frequency": ("frequency", "Hz"),
    "Omega": ("angular frequency", "rad/s"),
    "load": ("share of the load", ""),
    "normal_force": ("share of the normal force", ""),
    "normal_force_N": ("normal force", "N"),
    "amplitude": ("amplitude", "m"),
}
"""What a series may run over: in words, and its unit."""


def unit_of(name: str) -> str:
    """Unit of an array by its name."""
    first, last = name.split("/")[0], name.split("/")[-1]
    return ("" if name.startswith(READ) else UNITS.get(last, "")) or UNITS.get(first, "1")


ROUNDING = 1e-10
"""Share of the largest harmonic of a point below which another one is rounding and what Newton's method leaves: what a
symmetric motion has none of."""


def without_rounding(harmonics: ComplexArray) -> ComplexArray:
    """(f, H + 1) amplitudes of a read-out, those that are rounding beside the largest of their point zero."""
    size = np.abs(harmonics)
    return np.where(size <= ROUNDING * size.max(axis=1, keepdims=True, initial=0.0), 0.0, harmonics)


def of_solutions(columns: Mapping[str, Array], converged: Array, known: Sequence[str] = ()) -> dict[str, Array]:
    """Columns (f, ...) with nan where a point is no solution, but for those that are known there
    too."""
    return {name: v if name in known else of_solution(v, converged) for name, v in columns.items()}


def of_solution(values: Array, converged: Array) -> Array:
    """(f, ...) values with nan where a point is no solution."""
    return np.where(converged.reshape(-1, *np.ones(np.ndim(values) - 1, dtype=int)), values, np.nan)


@dataclass(frozen=True)
class Series:
    """The f points of one sweep or curve, in order.

    Harmonics are complex 0-peak amplitudes with the time factor exp(+i Omega t), the mean first.
    What is told of a motion is nan where a point is no solution; `arrays` alone keep what the
    search left there.

    Attributes:
        name: like ``normal_force = 100``. parameters: what sets it apart, in SI: name -> number. key: (f,) see
            `journal.Journal`. status: f texts, `CONVERGED` or what went wrong. arrays: name -> (f, ...), see
            docs/response_file.md. labels: name of an array -> its rows. over: what it runs over, of `OVER`.
    """

    name: str
    parameters: Mapping[str, float]
    key: Array
    status: tuple[str, ...]
    arrays: Mapping[str, Array]
    labels: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    over: str = "frequency"

    def __len__(self) -> int:
        return len(self.status)

    @property
    def converged(self) -> Array:
        """(f,) bool, whether each point is a solution that passes its checks."""
        return np.array([s == CONVERGED for s in self.status], dtype=bool)

    @property
    def failures(self) -> list[tuple[float, str]]:
        """(parameter, cause) of the points that are no solutions."""
        return [(float(p), s) for p, s in zip(self.parameter, self.status, strict=True) if s != CONVERGED]

    @property
    def frequency(self) -> Array:
        """(f,) Hz."""
        return np.asarray(self.arrays["frequency"])

    @property
    def Omega(self) -> Array:
        """(f,) rad/s."""
        return 2 * np.pi * self.frequency

    @property
    def parameter(self) -> Array:
        """(f,) what it runs over, see `OVER`."""
        return np.asarray(self.arrays.get("parameter", self.arrays["frequency"]))

    @property
    def folds(self) -> Array:
        """Values of the parameter at which the curve turns back."""
        return self.parameter[np.asarray(self.arrays.get("fold", np.zeros(len(self))), dtype=bool)]

    @property
    def readouts(self) -> tuple[str, ...]:
        """Names of what is read: ``tip`` of a monitor with one row, ``probe u_x`` of one with more."""
        return tuple(self._places)

    @property
    def _places(self) -> dict[str, tuple[str, int]]:
        found: dict[str, tuple[str, int]] = {}
        for name, values in self.arrays.items():
            if name.startswith(READ):
                rows = self.labels.get(name) or tuple(map(str, range(values.shape[1])))
                short = name.split("/", 1)[1]
                found |= {short if len(rows) == 1 else f"{short} {row}": (name, i) for i, row in enumerate(rows)}
        return found

    def harmonics(self, readout: str | int = 0) -> ComplexArray:
        """(f, H + 1) harmonics of a read-out, by its name or its place in `readouts`.

        Raises:
            UserError: none of that name.
        """
        name, row = self._place(readout)
        return self._of_solution(self.arrays[name][:, row].astype(complex))

    def _of_solution(self, values: Array) -> Any:
        return of_solution(values, self.converged)

    def _place(self, readout: str | int) -> tuple[str, int]:
        """Name of the array of a read-out, and its row."""
        places = self._places
        if isinstance(readout, int) and 0 <= readout < len(places):
            readout = list(places)[readout]
        if not isinstance(readout, str) or readout not in places:
            raise UserError(f"read-out {readout!r}: the response has {', '.join(places) or 'none'}")
        return places[str(readout)]

    def monitor(self, name: str) -> ComplexArray:
        """(f, r, H + 1) harmonics of a monitor's rows, m or rad, or of a strain gauge.

        Raises:
            UserError: none of that name.
        """
        known = {n.split("/", 1)[1]: n for n in self.arrays if n.startswith(READ)}
        if name not in known:
            raise UserError(f"monitor '{name}': the response has {', '.join(known) or 'none'}")
        return self._of_solution(self.arrays[known[name]].astype(complex))

    @property
    def amplitude(self) -> Array:
        """(f,) 0-peak amplitude of the first harmonic of the first read-out."""
        return np.abs(self.harmonics()[:, 1])

    @property
    def phase(self) -> Array:
        """(f,) rad of the same, negative where it lags."""
        return np.angle(self.harmonics()[:, 1])

    @property
    def dissipated(self) -> Array:
        """(f,) work done on all contacts, J per cycle."""
        return self._summed("dissipated")

    @property
    def by_slip(self) -> Array:
        """(f,) friction forces times path slid, J per cycle."""
        return self._summed("by_slip")

    @property
    def damping_ratio(self) -> Array:
        """(f,) effective damping ratio: what is lost in a cycle over 4 pi times the kinetic energy of the motion; of
        one coordinate C / (2 M Omega)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return (self.arrays["damped"] + self.dissipated) / (4 * np.pi * self.arrays["kinetic"])

    def _summed(self, what: str) -> Array:
        values = [v for n, v in self.arrays.items() if n.startswith("contacts/") and n.endswith(f"/{what}")]
        return self._of_solution(np.sum(values, axis=0) if values else np.zeros(len(self)))

    @property
    def quantity(self) -> Quantity:
        """What the first read-out measures."""
        first = next(iter(self._places.values()), ("monitors/", 0))[0]
        return Quantity(unit_of(first))

    # tables ----------------------------------------------------------------------------------------------------------

    def columns(self) -> dict[str, Array]:
        """Heading, with its unit -> (f,) numbers; what is told of a motion is nan where a point is no solution."""
        column = self.quantity.column
        found = {} if self.over == "frequency" else {self.over: self.parameter}
        found["frequency_Hz"] = self.frequency
        if self._places:
            a = without_rounding(self.harmonics())
            found |= {
                column("amplitude"): np.abs(a[:, 1]),
                "phase_rad": np.angle(a[:, 1]),
                column("mean"): a[:, 0].real,
            }
            found |= {column(f"amplitude_{h}"): np.abs(a[:, h]) for h in range(2, a.shape[1])}
        found |= {f"{name}_J": np.asarray(self.arrays[name]) for name in ("supplied", "damped") if name in self.arrays}
        found["dissipated_J"] = self.dissipated
        if "kinetic" in self.arrays:
            found["damping_ratio"] = self.damping_ratio
        contacts = max(len([n for n in self.arrays if n.startswith("contacts/") and n.endswith("/slipping")]), 1)
        found |= {name: self._summed(name) / contacts for name in ("slipping", "open")}
        return of_solutions(found, self.converged, (self.over, "frequency_Hz")) | {"converged": self.converged}

    def to_dataframe(self) -> Any:
        """The table of `columns` as a `pandas.DataFrame`, a row a point; ``status`` says what went wrong."""
        import pandas

        return pandas.DataFrame({**self.columns(), "status": list(self.status)})

    def to_xarray(self) -> Any:
        """Everything as an `xarray.Dataset` over the axis ``point``: a slash in a name becomes a dot, units are
        attributes. What is told of a motion is nan where a point is no solution."""
        import xarray

        variables = {name.replace("/", "."): self._variable(name) for name in self.arrays if name != "history"}
        size = max((v.shape[2] for n, v in self.arrays.items() if n.startswith(READ)), default=1)
        words = [f"{part} {h}" if h > 1 else part for h in range(1, size) for part in ("cos", "sin")]
        coords: dict[str, Any] = {
            "frequency": variables.pop("frequency"), "harmonic": np.arange(size), "coefficient": ["mean", *words],
            "status": ("point", list(self.status)),
        }  # fmt: skip
        if "parameter" in variables:
            coords["parameter"] = variables.pop("parameter")
        for name, rows in self.labels.items():
            if name.startswith(READ):
                coords[f"{name.split('/', 1)[1]}.row"] = list(rows)
        used = {axis for entry in variables.values() for axis in entry[0]}
        coords = {name: c for name, c in coords.items() if isinstance(c, tuple) or name in used}
        attrs = {"name": self.name, "over": self.over, **self.parameters}
        return xarray.Dataset(variables, coords=coords, attrs=attrs)

    def _variable(self, name: str) -> tuple[tuple[str, ...], Array, dict[str, str]]:
        values, (*above, last) = self.arrays[name], name.split("/")
        if name in OF_A_MOTION or name.startswith((*READ, "bodies/", "contacts/")):
            values = self._of_solution(values)
        owner = "/".join(above[1:]) or last
        axes = ("point", *(f"{name.replace('/', '.')}_{i}" for i in range(1, values.ndim)))
        if name.startswith(READ):
            axes = ("point", f"{last}.row", "harmonic")
        elif last == "q":
            axes = ("point", "harmonic", f"{owner}.coordinate")
        elif last in ("displacement", "force") and above[:1] == ["contacts"]:
            axes = ("point", f"{owner}.coordinate", "coefficient")
        elif last == "x":
            axes = ("point", "unknown")
        return axes, values, {"units": self.unit(name)}

    def unit(self, name: str) -> str:
        """Unit of one of its arrays."""
        if name != "parameter":
            return unit_of(name)
        (told,) = self.labels.get(name, (OVER.get(self.over, ("", ""))[1],))
        return told or "1"

    # pictures --------------------------------------------------------------------------------------------------------

    def plot(self, axes: Axes | None = None, readout: str | int = 0, harmonic: int = 1, **line: Any) -> Axes:
        """Draw the amplitude of a read-out over what the series runs over.

        Points that are no solutions are left out, folds are circles where there are few.

        Args:
            axes: of matplotlib, new ones if not given. readout: see `harmonics`. harmonic: 0 is the mean. line: for
                `matplotlib.axes.Axes.plot`.

        Returns:
            The axes.
        """
        if axes is None:
            import matplotlib.pyplot as plt

            axes = plt.subplots(layout="constrained")[1]
        from matplotlib.cbook import normalize_kwargs
        from matplotlib.lines import Line2D

        line = normalize_kwargs(line, Line2D)  # c is color, ls is linestyle
        a = self.harmonics(readout)
        numbered("harmonic", harmonic, a.shape[1], "harmonic")
        a = a[:, harmonic]
        size = np.where(self.converged, np.abs(a) if harmonic else a.real, np.nan)
        top = float(np.nanmax(np.abs(size), initial=0.0))
        quantity = Quantity(unit_of(self._place(readout)[0]))
        scale, unit = quantity.scale(10 * top) if top else (1.0, quantity.said)
        x, y, unstable = self._drawn(scale * size)
        (drawn,) = axes.plot(x, np.where(unstable >= 1, np.nan, y), **{"label": self.name, **line})
        if (unstable > 0).any():
            dashed = {**line, "color": drawn.get_color(), "linestyle": "--", "label": "_unstable"}
            axes.plot(x, np.where(unstable <= 0, np.nan, y), **dashed)
        turns = np.isin(self.parameter, self.folds)
        if 0 < turns.sum() <= 12:  # a stop that few samples meet ripples
            axes.plot(self.parameter[turns], scale * size[turns], "o", mfc="none", color=drawn.get_color())
        words, over = OVER.get(self.over, (self.over, ""))
        axes.set_xlabel(f"{words} in {over}" if over else words)
        which = "mean" if not harmonic else "amplitude" if harmonic == 1 else f"amplitude of harmonic {harmonic}"
        axes.set_ylabel(f"{which} in {unit}")
        return axes

    def _drawn(self, y: Array) -> tuple[Array, Array, Array]:
        """What a line is drawn through; of a curve, smooth between its points, and broken where another one begins.
        And whether that is unstable, 0 or 1, between both where that changes."""
        begins = np.flatnonzero(np.diff(self.arrays.get("branch", np.zeros(len(y))))) + 1
        pieces = []
        for part in np.split(np.arange(len(y)), begins):
            line = self._smooth(part, y[part])
            along = np.linspace(0, len(part) - 1, len(line[0]))
            pieces.append(np.vstack([*line, np.interp(along, np.arange(len(part)), self._unstable[part])]))
        broken = [np.hstack([piece, np.full((3, 1), np.nan)]) for piece in pieces]
        x, y, unstable = np.hstack(broken)[:, :-1]
        return x, y, unstable

    @property
    def _unstable(self) -> Array:
        """(f,) 1 of unstable motions, 0 of others, 1/2 where that changes."""
        out = 1.0 - np.asarray(self.arrays.get("stable", np.ones(len(self))))
        for kind in ("fold", "branch point", "period doubling", "Neimark-Sacker"):
            out[np.asarray(self.arrays.get(kind, np.zeros(len(out))), dtype=bool)] = 0.5
        return out if "stable" in self.arrays else np.zeros(len(out))

    def _smooth(self, part: Indices, y: Array) -> tuple[Array, Array]:
        """A line through some points that follow each other, y (part,)."""
        s, x, ok = np.asarray(self.arrays.get("arclength", np.zeros(0))), self.parameter[part], np.isfinite(y)
        s = s[part] if len(s) else s
        if len(s) != len(y) or ok.sum() < 4 or not ok.all() or not (np.diff(s) > 0).all():
            return x, y
        from scipy.interpolate import Akima1DInterpolator, CubicSpline

        fine = np.interp(np.arange(0, len(s) - 1 + 1e-9, 0.125), np.arange(len(s)), s)
        places = np.column_stack([x, y])
        bends = "kink" not in self.arrays or np.any(self.arrays["kink"][part])
        line = Akima1DInterpolator(s, places, method="makima") if bends else CubicSpline(s, places)
        smooth = line(fine)
        return smooth[:, 0], smooth[:, 1]

    @cached_property
    def _said(self) -> str:
        """In a line."""
        words, unit = OVER.get(self.over, (self.over, ""))
        p, count = self.parameter, counted(len(self), "point")
        if not len(p):
            return f"{words}: no points"
        said = f"{count} over the {words}, {p.min():.6g} to {p.max():.6g} {unit}".rstrip()
        if self._places and self.converged.any():
            a = np.where(self.converged, self.amplitude, 0.0)
            i = int(a.argmax())
            most = f"at most {a[i]:.4g} {self.quantity.said} at {p[i]:.6g} {unit}".rstrip()
            most += ", an end" * (len(p) > 1 and i in (0, len(p) - 1))
            said += f"; {most if a[i] else f'{self.readouts[0]} does not move'}"
        if len(self.folds):
            said += f"; folds at {', '.join(f'{f:.6g}' for f in self.folds[:6])} {unit}".rstrip()
        bad = len(self) - int(self.converged.sum())
        return said + (f"; {bad} not converged: {self.failures[0][1]}" if bad else "; all converged")

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.name}: {self._said}>"
