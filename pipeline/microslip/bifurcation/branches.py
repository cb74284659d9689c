"""Branches of a diagram as arrays, in memory, in files, and in matplotlib's axes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from ..data import Array, ComplexArray
from ..errors import UserError
from ..files import hdf5, store
from ..units import Quantity, counted
from .dynamics import Dynamics
from .orbits import OrbitPoint, extremes
from .shooting import PeriodicOrbit

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes

EQUILIBRIA = "equilibria"

SPECIAL = ("Hopf", "fold", "period doubling", "torus", "branch point")
"""Kinds of points where something happens."""


LOST = ("stuck", "no start", "points")
"""Begin what is said of branches that could not be followed to their end."""


@dataclass(frozen=True, eq=False)
class DiagramBranch:
    """Equilibria, or periodic orbits, along one curve.

    Attributes:
        name. born: of what. ended: why. turns: k of what drives in a period. outputs: names of the w read-outs. units:
            of each, SI; empty if they are not known.
        parameter: (k,). period: (k,) s, not a number for equilibria. x: (k, m, n) nodes, one of an equilibrium.
        largest, smallest: (k, w) of the read-outs. multipliers: (k, e) Floquet multipliers, of an equilibrium
            eigenvalues in 1/s. stable: (k,). kind: (k,) of `orbits.Kind`, or ``Hopf``.
    """

    name: str
    born: str
    ended: str
    turns: int
    outputs: tuple[str, ...]
    parameter: Array
    period: Array
    x: Array
    largest: Array
    smallest: Array
    multipliers: ComplexArray
    stable: Array
    kind: Array
    units: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.parameter)

    def __repr__(self) -> str:
        special = ", ".join(f"{len(self.of_kind(k))} {k}" for k in SPECIAL if len(self.of_kind(k)))
        points = f"{counted(len(self), 'point')}{special and f' ({special})'}"
        return f"<DiagramBranch {self.name}: {points}, {int(self.stable.sum())} stable; ended: {self.ended}>"

    @property
    def still(self) -> bool:
        """Whether it is one of equilibria."""
        return self.x.shape[1] == 1

    @property
    def swing(self) -> Array:
        """(k, w) half of the way from the smallest to the largest value."""
        return 0.5 * (self.largest - self.smallest)

    @property
    def lost(self) -> bool:
        """Whether it could not be followed to its end."""
        return self.ended.startswith(LOST)

    def of_kind(self, kind: str) -> Array:
        """Numbers of the points of a kind."""
        return np.flatnonzero(self.kind == kind)

    def orbit(self, system: Dynamics, i: int) -> PeriodicOrbit:
        """The i-th orbit."""
        return PeriodicOrbit(system, self.x[i], float(self.period[i]), float(self.parameter[i]), self.turns)

    def stretches(self) -> Iterator[tuple[slice, bool]]:
        """Parts of one stability, each with the first point of the next one, and whether they are stable. Where
        stability changes nothing can be said of the point itself, and its neighbour decides."""
        sure = ~np.isin(self.kind, SPECIAL)
        steady = (self.stable | ~sure)[:-1] & (self.stable | ~sure)[1:]
        edges = [0, *(np.flatnonzero(np.diff(steady.astype(int))) + 1), len(steady)]
        for a, b in zip(edges, edges[1:], strict=False):
            if b > a:
                yield slice(a, b + 1), bool(steady[a])

    def to_dataframe(self) -> pandas.DataFrame:
        """A row a point."""
        import pandas

        return pandas.DataFrame(columns(self))


def of_orbits(name: str, born: str, ended: str, found: list[OrbitPoint], each: int = 8) -> DiagramBranch:
    """A branch of periodic orbits, read at so many times a node."""
    orbits = [point.orbit for point in found]
    ends = [extremes(o.system.seen(o.sampled(each), o.p)) for o in orbits]
    return DiagramBranch(
        name, born, ended, orbits[0].turns, orbits[0].system.named,
        np.array([o.p for o in orbits]), np.array([o.period for o in orbits]), np.array([o.x for o in orbits]),
        np.array([largest for largest, _ in ends]), np.array([smallest for _, smallest in ends]),
        np.array([point.multipliers for point in found]), np.array([point.stable for point in found]),
        np.array([point.kind for point in found]), orbits[0].system.units,
    )  # fmt: skip


def joined(back: DiagramBranch, forth: DiagramBranch) -> DiagramBranch:
    """Two branches that begin at the same point, as one: the first one from its end to its beginning, then the second.
    It ended as both did."""
    both: dict[str, Any] = {key: np.concatenate([getattr(back, key)[:0:-1], getattr(forth, key)]) for key in ARRAYS}
    ends = [branch.ended for branch in (back, forth)]
    ended = next((words for words in ends if words.startswith(LOST)), f"{ends[0]}; {ends[1]}")
    return replace(forth, ended=ended, **both)


class Collected:
    """Branches over one parameter, found or read."""

    branches: tuple[DiagramBranch, ...]

    def __getitem__(self, name: str) -> DiagramBranch:
        by_name = {b.name: b for b in self.branches}
        if name not in by_name:
            raise UserError(f"branch '{name}': there are {', '.join(by_name)}")
        return by_name[name]

    def at(self, kind: str) -> dict[str, Array]:
        """Branch -> values of the parameter at its points of a kind: ``Hopf``, ``fold``, ``period doubling``,
        ``torus``, ``branch point``."""
        if kind not in SPECIAL:
            raise UserError(f"kind: '{kind}' is none of {', '.join(SPECIAL)}")
        values = {b.name: b.parameter[b.of_kind(kind)] for b in self.branches}
        return {name: at for name, at in values.items() if len(at)}

    def to_dataframe(self) -> pandas.DataFrame:
        """A row a point, branch by branch."""
        import pandas

        return pandas.concat([b.to_dataframe() for b in self.branches], ignore_index=True)

    def to_xarray(self) -> xarray.Dataset:
        """The same by points."""
        return self.to_dataframe().rename_axis("point").to_xarray()


def columns(branch: DiagramBranch) -> dict[str, Any]:
    """Column -> values of a table."""
    table: dict[str, Any] = {"branch": np.array([branch.name] * len(branch)), "kind": branch.kind,
                             "parameter": branch.parameter, "stable": branch.stable.astype(int),
                             "period_s": branch.period}  # fmt: skip
    for i, name in enumerate(branch.outputs):
        column = Quantity(branch.units[i]).column if branch.units else str
        for what in ("largest", "smallest"):
            table[column(f"{name.replace(' ', '_')}_{what}")] = getattr(branch, what)[:, i]
    first = np.abs(branch.multipliers).max(axis=1, initial=0.0)
    decisive = branch.multipliers[:, 0] if branch.multipliers.shape[1] else np.zeros(len(branch), complex)
    return table | {"multiplier_real": decisive.real, "multiplier_imaginary": decisive.imag} | (
        {} if branch.still else {"multiplier_size": first}
    )  # fmt: skip


MARKS = {"Hopf": ("o", "Hopf point"), "fold": ("D", "fold"), "period doubling": ("s", "period doubling"),
         "torus": ("^", "torus point"), "branch point": ("X", "branch point")}  # fmt: skip


def draw(
    branches: Sequence[DiagramBranch], dots: Sequence[tuple[float, float]], axes: Axes, axis: str, read_out: int = 0
) -> None:
    """Branches in the axes: lines where stable, dashes where not, marks where something happens."""
    top = max(float(np.abs(b.swing[:, read_out]).max(initial=0.0)) for b in branches)
    name, units = branches[0].outputs[read_out], branches[0].units
    factor, unit = Quantity(units[read_out]).scale(top) if units else (1.0, "")
    for i, branch in enumerate(branches):
        y = factor * branch.swing[:, read_out]
        colour = "#30343c" if branch.still else f"C{(i - 1) % 10}"
        axes.plot([], [], "-", color=colour, lw=2.2, label=branch.name)
        for part, stable in branch.stretches():
            style = "-" if stable else (0, (4, 3))
            axes.plot(branch.parameter[part], y[part], ls=style, color=colour, lw=2.2 if stable else 1.0)
    for kind in SPECIAL:
        places = [(float(b.parameter[i]), factor * float(b.swing[i, read_out])) for b in branches
                  for i in b.of_kind(kind)]  # fmt: skip
        if places:
            mark, words = MARKS[kind]
            axes.plot(*np.array(places).T, mark, color="white", mec="#30343c", ms=6, label=words, zorder=5)
    if dots:
        x, y = np.array(dots).T
        axes.plot(x, factor * y, ".", color="#30343c", ms=9, label="motions come here", zorder=6)
    axes.plot([], [], ls=(0, (4, 3)), color="#30343c", lw=1.0, label="unstable")
    axes.set(xlabel=axis, ylabel=f"{name}: amplitude in {unit}".removesuffix(" in "))
    axes.legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))


TEXTS = ("name", "born", "ended")
LISTS = ("outputs", "units")
ARRAYS = {"parameter": "", "period": "s", "x": "", "largest": "", "smallest": "", "multipliers": "", "stable": "",
          "kind": ""}  # fmt: skip


def put(group: h5py.Group, branch: DiagramBranch) -> None:
    for key in TEXTS:
        group.attrs[key] = getattr(branch, key)
    group.attrs["turns"] = branch.turns
    for key in LISTS:
        group.attrs[key] = "\n".join(getattr(branch, key))
    for key, unit in ARRAYS.items():
        values = getattr(branch, key)
        hdf5.put(group, key, values.astype(np.int8) if values.dtype == bool else values, unit)


def get(group: h5py.Group) -> DiagramBranch:
    texts: dict[str, Any] = {key: str(group.attrs[key]) for key in TEXTS}
    arrays: dict[str, Any] = {key: group[key][()] for key in ARRAYS}
    arrays["multipliers"] = arrays["multipliers"] + 1j * group["multipliers" + hdf5.IMAGINARY][()]
    arrays["stable"], arrays["kind"] = arrays["stable"].astype(bool), np.char.decode(arrays["kind"], "utf-8")
    lists: dict[str, Any] = {key: tuple(str(group.attrs.get(key, "")).splitlines()) for key in LISTS}
    return DiagramBranch(turns=int(group.attrs["turns"]), **lists, **texts, **arrays)


def write(path: Path, branch: DiagramBranch, inputs: str) -> None:
    """A finished branch, with the hash of what it depends on."""
    with hdf5.sealed(path) as file:
        file.attrs["inputs"] = inputs
        put(file, branch)


def kept(path: Path, inputs: str) -> DiagramBranch | None:
    """A finished branch of the same inputs, if it is there and as it was written."""
    if not path.is_file() or hdf5.seal_state(path) != "intact":
        return None
    with h5py.File(store.ordinary(path), "r") as file:
        return get(file) if str(file.attrs.get("inputs")) == inputs else None
