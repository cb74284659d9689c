"""``response.h5``: what a case found, in one HDF5 file. The layout is documented in ``docs/response_file.md``."""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..data import Array, ModalBasis, ModalGroup
from ..errors import UserError, in_its_file
from ..files.hdf5 import IMAGINARY, put, sealed
from ..files.hostile import DAMAGE, reading, refuse_damaged, short
from ..files.store import json_text, ordinary
from ..operating.motion import Motion, motion_of
from ..reduced.coordinates import first_modes, in_modes
from ..settings.arguments import checked
from .journal import answers, is_journal, read_journal
from .series import Series

FORMAT = "microslip-response"
FORMAT_VERSION = "0.2"


@dataclass(frozen=True)
class Body:
    """Whose coordinates a result holds: the group of every harmonic in a modal file.

    Attributes:
        basis: name of the body. sha256: of the modal file. file: where it was, for people. speed: number of the group,
            or -1 where the group was made for `rpm` from a range. rpm: rotation speed. harmonics: nodal diameter of
            the group and whether its rows are read conjugate, for every harmonic, the mean first. modes: whether the
            coordinates are those of `coordinates.in_modes` of the groups.
    """

    basis: str
    sha256: str
    file: str
    speed: int
    rpm: float
    harmonics: tuple[tuple[int, bool], ...]
    modes: bool = False


@dataclass(frozen=True)
class Response:
    """A case's response.

    Attributes:
        case: its name. description. mode: how the contacts were treated (``marched`` or ``book``).
            settings: the case file. inputs: hash of all that a point depends on. bodies: component -> `Body`. labels:
            name of an array -> its rows. series: in the order they were computed. resonances: rows of a table.
            estimated: largest estimated error of an amplitude for want of harmonics and samples, over it; None: not
            estimated. finished: whether every point that was asked for is there. messages: sentences a reader must
            know.
            stuck_modes: rows of the modes with sticking contacts and their damping.
    """

    case: str
    mode: str
    series: tuple[Series, ...]
    bodies: Mapping[str, Body] = field(default_factory=dict)
    labels: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    inputs: str = ""
    description: str = ""
    resonances: tuple[Mapping[str, Any], ...] = ()
    finished: bool = True
    messages: tuple[str, ...] = ()
    stuck_modes: tuple[Mapping[str, float], ...] = ()
    estimated: float | None = None

    def one(self, **parameters: float) -> Series:
        """The series whose parameters have these values.

        Raises:
            UserError: none, or more than one.
        """
        found = [s for s in self.series if all(s.parameters.get(k) == v for k, v in parameters.items())]
        if len(found) != 1:
            asked = ", ".join(f"{k} = {v:g}" for k, v in parameters.items()) or "nothing"
            raise UserError(f"{self.case}: {len(found)} series have {asked}; there are {_names(self.series)}")
        return found[0]

    def motion(self, series: Series, basis: ModalBasis, component: str = "", sha256: str = "") -> Motion:
        """The motion of a component in a series, for `operating`.

        Args:
            basis: its modal file. component: may be left out where there is one. sha256: of the modal file's bytes, to
                be compared with the one that the response was computed with.

        Raises:
            UserError: another body, another file, no such component.
        """
        name = component or (next(iter(self.bodies)) if len(self.bodies) == 1 else component)
        if name not in self.bodies:
            raise UserError(f"{self.case}: component '{name}': the response has {', '.join(self.bodies) or 'none'}")
        body = self.bodies[name]
        if body.basis != basis.name or (sha256 and sha256 != body.sha256):
            what = f"'{basis.name}'" if body.basis != basis.name else "another state of it"
            raise UserError(f"{self.case}: it was computed with the modal file of '{body.basis}', this is {what}")
        q, turned = series.arrays[f"bodies/{name}/q"], [c for _, c in body.harmonics]
        groups = [g if g.n_modes <= q.shape[2] else first_modes(g, q.shape[2]) for g in _groups(body, basis)]
        forces = series.arrays.get(f"bodies/{name}/forces")
        H = q.shape[1]
        return motion_of(2 * np.pi * series.frequency, q, groups[:H], turned[:H], forces)


def _names(series: Sequence[Series]) -> str:
    return "; ".join(s.name for s in series) or "none"


def _groups(body: Body, basis: ModalBasis) -> list[ModalGroup]:
    if body.speed < 0:
        from ..modal.speed_range import basis_at

        basis = basis_at(basis, body.rpm)
    known = {k: basis.groups[max(body.speed, 0), k] for k, _ in body.harmonics}
    if body.modes:
        known = {k: in_modes(g) for k, g in known.items()}
    return [known[k] for k, _ in body.harmonics]


# from the journal --------------------------------------------------------------------------------------------------


def response_of(head: Mapping[str, Any], series: Mapping[str, Mapping[float, Mapping[str, Any]]]) -> Response:
    """A response from a journal's head and series, as far as it goes.

    The head's keys are those of `Response`; ``parameters`` gives each series its own.
    """
    parameters = head.get("parameters", {})
    named = {k: tuple(v) for k, v in head.get("labels", {}).items()}
    over = str(head.get("over", "frequency"))
    return Response(
        case=str(head["case"]),
        mode=str(head.get("mode", "")),
        series=tuple(_series(name, parameters.get(name, {}), points, named, over) for name, points in series.items()),
        bodies={k: _body(b) for k, b in head.get("bodies", {}).items()},
        labels=named,
        settings=head.get("settings", {}),
        inputs=str(head.get("inputs", "")),
        description=str(head.get("description", "")),
        resonances=tuple(head.get("resonances", ())),
        finished=bool(head.get("finished", False)),
        messages=tuple(head.get("messages", ())),
        stuck_modes=tuple(head.get("stuck_modes", ())),
        estimated=head.get("estimated"),
    )


def _body(b: Mapping[str, Any]) -> Body:
    pairs = tuple((int(k), bool(c)) for k, c in b["harmonics"])
    own = bool(b.get("modes", False))
    return Body(str(b["basis"]), str(b["sha256"]), str(b["file"]), int(b["speed"]), float(b["rpm"]), pairs, own)


def _series(
    name: str, parameters: Mapping[str, float], points: Mapping[float, Mapping[str, Any]],
    labels: Mapping[str, tuple[str, ...]], over: str,
) -> Series:  # fmt: skip
    keys = sorted(points)
    rows = [points[k] for k in keys]
    names = [n for n, v in (rows[0] if rows else {}).items() if n != "status" and not isinstance(v, str)]
    arrays = {n: stacked([np.asarray(row[n]) for row in rows]) for n in names}
    own = {k: float(v) for k, v in parameters.items()}
    return Series(name, own, np.array(keys), tuple(str(row.get("status", "")) for row in rows), arrays, labels, over)


def stacked(values: Sequence[Array]) -> Array:
    """(f, ...) of arrays that may have different numbers of harmonics: what an array lacks is zero."""
    shapes = {v.shape for v in values}
    if len(shapes) == 1:
        return np.stack(values)
    out = np.zeros((len(values), *np.max([list(s) for s in shapes], axis=0)), dtype=np.result_type(*values))
    for row, value in zip(out, values, strict=True):
        row[tuple(slice(n) for n in value.shape)] = value
    return out


# HDF5 --------------------------------------------------------------------------------------------------------------


def write_response(path: Path | str, response: Response) -> None:
    """Write ``response.h5``, complete or absent.

    Raises:
        UserError: no permission, no space.
    """
    with sealed(path) as file:
        _write(file, response)


_TEXTS = ("case", "mode", "inputs", "description")


def _write(file: h5py.File, r: Response) -> None:
    file.attrs["format"], file.attrs["format_version"] = FORMAT, FORMAT_VERSION
    file.attrs["units"] = "SI: m, kg, s, N, rad, Pa"
    file.attrs["conventions"] = (
        "time factor exp(+i Omega t), amplitudes 0-peak; arrays of harmonics are complex, the mean first; "
        "contact arrays are mean, cos, sin, cos 2, sin 2, ...; "
        "coordinates are those of the modal file, about its static state"
    )
    for name in _TEXTS:
        file.attrs[name] = getattr(r, name)
    file.attrs["finished"] = int(r.finished)
    for name in ("settings", "labels", "resonances", "messages", "stuck_modes", "estimated"):
        if (told := getattr(r, name)) is not None:
            _put_text(file, name, json_text(told))
    bodies = {k: {**vars(b), "harmonics": [[n, int(c)] for n, c in b.harmonics]} for k, b in r.bodies.items()}
    _put_text(file, "bodies", json.dumps(bodies))
    for i, s in enumerate(r.series):
        group = file.create_group(f"series_{i:04d}")
        group.attrs["name"], group.attrs["parameters"] = s.name, json.dumps(dict(s.parameters))
        group.attrs["over"] = s.over
        put(group, "key", s.key)
        put(group, "status", np.array(s.status or ("",)))
        for name, value in s.arrays.items():
            put(group, name, value, s.unit(name))


def _put_text(file: h5py.File, name: str, text: str) -> None:
    put(file, name, np.frombuffer(text.encode(), dtype=np.uint8))


@checked
@in_its_file
def read_response(path: Path | str) -> Response:
    """Read ``response.h5``, or the journal of a response that is still computed or was killed.

    Raises:
        UserError: missing, damaged, foreign or of another version.
    """
    path = Path(path)
    if not ordinary(path).is_file():
        raise UserError("no such response; run the case first or correct the path")
    with contextlib.suppress(OSError):  # told below
        if is_journal(path):
            return _from_journal(path)
    refuse_damaged(path, _TRIAL, "run the case again")
    return _read(path)


_TRIAL = "from microslip.results.files import _read; _read(path)"


def _from_journal(path: Path) -> Response:
    head, series = read_journal(path)
    try:
        return response_of(head, answers(head, series))
    except DAMAGE as error:
        raise UserError(f"is damaged or incomplete ({short(error)}); run the case again") from error


def _read(path: Path) -> Response:
    with reading(path, FORMAT, FORMAT_VERSION, "run the case again") as file:
        return _response(file)


def _response(file: h5py.File) -> Response:
    told = {
        name: json.loads(file[name][()].tobytes())
        for name in ("settings", "labels", "resonances", "messages", "bodies")
    }
    names = sorted(n for n in file if n.startswith("series_"))
    labels = {k: tuple(v) for k, v in told["labels"].items()}
    return Response(
        **{name: str(file.attrs[name]) for name in _TEXTS},
        series=tuple(_read_series(file[n], labels) for n in names),
        bodies={k: _body(b) for k, b in told["bodies"].items()},
        labels=labels,
        settings=told["settings"],
        resonances=tuple(map(_known, told["resonances"])),
        finished=bool(file.attrs["finished"]),
        messages=tuple(told["messages"]),
        stuck_modes=tuple(map(_known, json.loads(file["stuck_modes"][()].tobytes()))) if "stuck_modes" in file else (),
        estimated=_estimated(json.loads(file["estimated"][()].tobytes())) if "estimated" in file else None,
    )


def _known(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row of a table: null stands for no number."""
    return {name: math.nan if value is None else value for name, value in row.items()}


def _estimated(told: float | None) -> float:
    """An error of which null says that it may be of any size."""
    return math.inf if told is None else told


def _read_series(group: h5py.Group, labels: Mapping[str, tuple[str, ...]]) -> Series:
    arrays: dict[str, Array] = {}

    def take(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and name not in ("key", "status") and not name.endswith(IMAGINARY):
            arrays[name] = item[()]
            if name + IMAGINARY in group:
                arrays[name] = arrays[name] + 1j * group[name + IMAGINARY][()]

    group.visititems(take)
    key = group["key"][()]
    status = tuple(s.decode() for s in group["status"][()])[: len(key)]
    if any(len(a) != len(key) for a in arrays.values()) or len(status) != len(key):
        raise ValueError(f"{group.name}: arrays of different lengths")
    parameters = {str(k): float(v) for k, v in json.loads(group.attrs["parameters"]).items()}
    over = str(group.attrs.get("over", "frequency"))
    arrays = {n: arrays[n] for n in labels if n in arrays} | arrays  # read-outs as they were asked for, not by name
    return Series(str(group.attrs["name"]), parameters, key, status, arrays, labels, over)
