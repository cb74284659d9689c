"""Series of motions that were solved for here: read-outs are worked out, and checked, when they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..data import Array
from ..errors import UserError, in_its_file
from ..results.files import Response, read_response, stacked, write_response
from ..results.series import Series
from ..settings.mistakes import numbered
from ..units import Quantity
from . import accuracy
from .checkpoint import labels, record
from .nonlinear_modes import OVER_AMPLITUDE, Backbone
from .problem import Problem
from .readout import measured
from .response import Operating, operating
from .solver import Point


class Motions(Series):
    """Periodic motions of an assembly in the order in which they were found, see `results.Series`.

    Unknowns and frequencies are there at once. Read-outs, energies and what every contact does are worked out when one
    of them is asked for first, and with them the checks of every point, on which `status` depends.

    Attributes:
        points: the solutions. problem: value of the parameter -> the balance that was solved.
    """

    def __init__(
        self, name: str, points: Sequence[Point], problem: Callable[[float], Problem], *, over: str = "frequency",
        known: Mapping[str, Array] | None = None, ended: str = "",
    ) -> None:  # fmt: skip
        own: dict[str, Any] = {
            "name": name, "parameters": {}, "over": over, "points": tuple(points), "problem": problem, "ended": ended,
            "_known": {"frequency": np.array([p.Omega for p in points]) / (2 * np.pi), **(known or {})},
        }  # fmt: skip
        self.__dict__.update(own)

    def __repr__(self) -> str:
        early = self.ended and not self.ended.startswith("bound")
        return f"{super().__repr__()[:-1]}; ended early: {self.ended}>" if early else super().__repr__()

    def __len__(self) -> int:
        return len(self.points)

    points: tuple[Point, ...]
    problem: Callable[[float], Problem]
    ended: str
    """Why a curve ended; empty of a sweep."""
    _known: dict[str, Array]

    @property
    def frequency(self) -> Array:
        return self._known["frequency"]

    @property
    def parameter(self) -> Array:
        return self._known.get("parameter", self.frequency)

    @property
    def folds(self) -> Array:
        return self.parameter[np.asarray(self._known.get("fold", np.zeros(len(self))), dtype=bool)]

    @property
    def peaks(self) -> Array:
        """(p,) values of the parameter at which the first read-out has a peak along the curve, located."""
        return self.parameter[np.asarray(self._known.get("peak", np.zeros(len(self))), dtype=bool)]

    @property
    def stable(self) -> Array:
        """(f,) whether a disturbance of the motion dies out.

        Raises:
            UserError: a curve that was followed without stability.
        """
        if "stable" not in self._known:
            raise UserError("stable: was not asked for; follow the curve with stability=True")
        return np.asarray(self._known["stable"], dtype=bool)

    @property
    def bifurcations(self) -> dict[str, Array]:
        """Kind -> values of the parameter at which motions gain or lose their stability, located: "fold", "branch
        point", "period doubling", "Neimark-Sacker"; of kinds that are there."""
        kinds = ("fold", "branch point", "period doubling", "Neimark-Sacker")
        flags = {kind: np.asarray(self._known[kind], dtype=bool) for kind in kinds if kind in self._known}
        found = {kind: self.parameter[here] for kind, here in flags.items()}
        return {kind: at for kind, at in found.items() if len(at)}

    @cached_property
    def key(self) -> Array:
        """(f,) places."""
        return np.arange(float(len(self))) if "arclength" in self._known else self.frequency

    @cached_property
    def labels(self) -> Mapping[str, tuple[str, ...]]:
        """Name of an array -> its rows."""
        if not len(self):
            return {}
        assembly = self.problem(float(self.parameter[0])).assembly
        return {name: tuple(rows) for name, rows in labels(assembly).items()}

    @cached_property
    def _rows(self) -> list[dict[str, Any]]:
        problems = [self.problem(v) for v in self.parameter.tolist()]
        return [record(one, p, operating(one, p)) for one, p in zip(problems, self.points, strict=True)]

    @cached_property
    def status(self) -> tuple[str, ...]:
        """`CONVERGED` or what went wrong, of every point; its checks included."""
        return tuple(row["status"] for row in self._rows)

    @cached_property
    def arrays(self) -> Mapping[str, Array]:
        """Name -> (f, ...), see docs/response_file.md."""
        names = [n for n, v in self._rows[0].items() if not isinstance(v, str) and n != "history"] if len(self) else []
        return {n: stacked([np.asarray(row[n]) for row in self._rows]) for n in names} | self._known

    @property
    def quantity(self) -> Quantity:
        return measured(self.problem(float(self.parameter[0])).assembly) if len(self) else Quantity()

    def motion(self, i: int) -> Operating:
        """All that belongs to point number i: coordinates of the bodies, forces and cycles of the contacts."""
        numbered("i", i, len(self), "point")
        return operating(self.problem(float(self.parameter[i])), self.points[i])

    def error_estimate(self, i: int | None = None) -> accuracy.Error:
        """What more harmonics and samples would change of a point, the largest one if none is named: ``readout`` is the
        share of its amplitude.

        Raises:
            UserError: a point that was not found, or none that was.
        """
        i = int(np.argmax(np.where(self.converged, self.amplitude, 0.0))) if i is None else i
        numbered("i", i, len(self), "point")
        if not self.converged[i]:
            raise UserError(f"error_estimate: point {i} was not found ({self.status[i]}); take one that was")
        value, point = float(self.parameter[i]), self.points[i]
        return accuracy.error(self.problem(value), point.x, point.Omega)

    def save(self, path: Path | str) -> Path:
        """Write a response file (``docs/response_file.md``), complete or absent; `load` reads it.

        Raises:
            UserError: no permission, no space; a file that is none of a response stands there.
        """
        plain = Series(self.name, self.parameters, self.key, self.status, {**self.arrays}, dict(self.labels), self.over)
        write_response(path, Response(self.name, "aft", (plain,), labels=dict(self.labels)))
        return Path(path)


@in_its_file
def load(path: Path | str) -> Series | Backbone:
    """The only series of a response file, as `Motions.save` writes it, or a nonlinear mode; `read_response` reads files
    of several.

    Raises:
        UserError: no such file, or one of several series.
    """
    response = read_response(path)
    found = response.series
    if len(found) != 1:
        names = ", ".join(s.name for s in found)
        raise UserError(f"holds {len(found)} series ({names}); take one of read_response(path).series")
    return Backbone.of(response) if found[0].over == OVER_AMPLITUDE else found[0]
