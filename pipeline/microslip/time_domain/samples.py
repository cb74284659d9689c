"""What is kept of a motion: its samples, a period at a time, in memory or in a file that is there before they are.

``orbit.h5`` (docs/time_domain.md) holds several motions. While they are computed, ``orbit.h5.part`` beside it has a
place for every sample from the beginning: nothing but numbers is written from then on, so a process killed at any
instant leaves a file that can be read. It takes room on the disk only as it is filled. ``orbit.h5.state``, complete or
absent, says how far it is filled, and where the motion was.
"""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import h5py
import numpy as np

from ..contact.elements import Spring
from ..contact.patch import Patch
from ..data import Array
from ..errors import UserError, in_its_file
from ..files.hdf5 import ANNOUNCED, create, put, seal, seal_state
from ..files.hostile import DAMAGE, inspect, refuse_damaged, short
from ..files.store import complete_or_absent, ordinary, put_in_place, refused
from ..harmonic_balance.readout import measured
from ..harmonic_balance.reduced import READS
from .bodies import Hardest, Now, Seen
from .contacts import gapes
from .equations import Equations
from .stepper import KINDS

FORMAT = "microslip-orbit"
FORMAT_VERSION = "0.1"

ENERGIES = ("mechanical", "given", "damped", "contacts", "lost", "stored", "ground")

UNITS = {
    "time": "s", "angular_frequency": "rad/s", "displacement": "m", "velocity": "m/s", "modal_displacement": "m kg^1/2",
    "modal_velocity": "m kg^1/2 / s", "contact_displacement": "m, rad", "contact_force": "N, N m",
    **{f"energy_{name}": "J" for name in ENERGIES},
}  # fmt: skip
"""Of every array of samples, in the order in which a file has them; the last axis is time. See `units_with`."""

ROWS = {
    "displacement": "read_out", "velocity": "read_out", "modal_displacement": "mode", "modal_velocity": "mode",
    "contact_displacement": "contact_coordinate", "contact_force": "contact_coordinate",
}  # fmt: skip
"""What the first axis of an array is over; others have time alone."""

STRIP = 1 << 16
"""Samples of a long motion that are looked at together."""

PART = 1 << 17
"""Numbers of an array that are together in the file."""

EVENTS_OF_CONTACT = 64
"""Events of a contact in a period that a file has room for, one more for every sample."""

PAUSE = 1.0
"""s between two states that are kept."""

Where = tuple[Now, Hardest]
"""Where a motion is, and the hardest period of it so far."""


def of_period(e: Equations, seen: Seen) -> dict[str, Array]:
    """Name -> (rows, s) or (s,) of samples."""
    seen = Seen._make(map(np.asarray, seen))
    rates = seen.q_dot @ e.output.T + e.rates(seen.time) @ e.output_given.T
    if e.output_residual.any() and len(seen.time) > 1:  # what yields at once has no velocity of its own
        rates = rates - np.gradient(seen.force @ e.output_residual.T, seen.time, axis=0)
    rates = without_rounding(rates, e.output, seen.q_dot)
    found = (seen.time, e.frequency(seen.time), read(e, seen), rates.T, seen.q.T, seen.q_dot.T, seen.d.T, seen.force.T)
    return dict(zip(UNITS, (*found, *energies(e, seen).values()), strict=True))


def read(e: Equations, seen: Seen) -> Array:
    """(w, s) read-outs."""
    q, force, o = np.asarray(seen.q), np.asarray(seen.force), e.oscillators(np.asarray(seen.time))
    found = q @ e.output.T - (force - e.F_0) @ e.output_residual.T + o @ e.output_given.T
    return without_rounding(found, e.output, q).T


def without_rounding(found: Array, output: Array, q: Array) -> Array:
    """Samples (s, w) of read-outs by coordinates (s, m); zero is one that reads rounding alone, as in
    `harmonic_balance.reduced.read`."""
    moved = np.sqrt((q**2 @ (output != 0).T).max(axis=0, initial=0.0))
    least = READS * np.linalg.norm(output, axis=1) * moved
    return np.where(np.abs(found).max(axis=0, initial=0.0) <= least, 0.0, found)


def energies(e: Equations, seen: Seen) -> dict[str, Array]:
    """`ENERGIES`, see `Orbit`: preloads count as loads, and what bodies hold beside their modes as theirs."""
    named = dict(zip(("given", "damped", "contacts", "lost", "stored", "ground"), seen.energy.T, strict=True))
    more, preloads = seen.force - e.F_0, seen.d @ e.F_0
    beside = 0.5 * np.einsum("sc,cd,sd->s", more, e.R, more)
    named["given"] = named["given"] + preloads
    named["contacts"] = named["contacts"] + preloads - beside
    return {"mechanical": seen.mechanical + beside, **named}


def sizes(e: Equations) -> dict[str, int]:
    """Name of an array -> its rows; those of time alone are left out."""
    of = {"read_out": len(e.output), "mode": len(e.omega2), "contact_coordinate": len(e.D)}
    return {name: of[axis] for name, axis in ROWS.items()}


class Touch(NamedTuple):
    """A contact: its name, whether each of its coordinates moves points in their plane against friction, and whether
    its law knows where it opens."""

    name: str
    tangential: tuple[bool, ...]
    opens: bool


def touches(e: Equations) -> tuple[Touch, ...]:
    patches = {id(c.patch): c.patch for c in e.contacts}
    alike = {i: (_rubs(patch), gapes(patch)) for i, patch in patches.items()}
    return tuple(Touch(c.name, *alike[id(c.patch)]) for c in e.contacts)


def _rubs(patch: Patch) -> tuple[bool, ...]:
    plane = np.abs(patch.kinematics[:, 1:]).max(axis=(0, 1)) > 0
    return tuple(map(bool, plane & (not isinstance(patch.law, Spring))))


def touches_of(told: Mapping[str, Any]) -> tuple[Touch, ...]:
    """Those that a motion in a file tells of."""
    return tuple(Touch(name, tuple(tangential), opens) for name, tangential, opens in json.loads(told["contacts"]))


class Kept(Protocol):
    """Where the samples of a motion go."""

    widest: float
    """m, the largest motion of the contacts so far."""
    missed: int
    """Events that there was no room for."""
    met: int
    """Events since the start, those while it settles among them."""

    def begun(self, where: Where) -> tuple[Where, int]:
        """Where to go on, and how many periods are done."""
        ...

    def keep(self, rows: Mapping[str, Array], events: Array, missed: int) -> None:
        """Samples that follow, and (e, 3) events among them."""
        ...

    def mark(self, where: Where, done: int) -> None:
        """All that was kept belongs to so many periods."""
        ...

    def strips(self, *names: str) -> Iterator[list[Array]]:
        """Arrays that were kept, so many samples at a time."""
        ...


@dataclass
class InMemory:
    """`Kept` as arrays."""

    widest: float = 0.0
    missed: int = 0
    met: int = 0
    parts: list[Mapping[str, Array]] = field(default_factory=list)
    events: list[Array] = field(default_factory=list)

    def begun(self, where: Where) -> tuple[Where, int]:
        return where, 0

    def keep(self, rows: Mapping[str, Array], events: Array, missed: int) -> None:
        self.parts.append(rows)
        self.events.append(events)
        self.missed += missed
        self.widest = max(self.widest, float(np.abs(rows["contact_displacement"]).max(initial=0.0)))

    def mark(self, where: Where, done: int) -> None:
        pass

    def strips(self, *names: str) -> Iterator[list[Array]]:
        for part in self.parts:
            yield [part[name] for name in names]

    def arrays(self, e: Equations) -> dict[str, Array]:
        """Name -> (rows, s) or (s,), and ``event`` (e, 3)."""
        rows = sizes(e)
        none = {name: np.zeros((rows[name], 0) if name in rows else 0) for name in UNITS}
        found = {name: np.concatenate([none[name], *(p[name] for p in self.parts)], axis=-1) for name in UNITS}
        return {**found, "event": np.concatenate([np.zeros((0, 3)), *self.events])}


# a file that is filled -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Planned:
    """A motion that a file has room for: its name, equations, samples of a period, and periods kept."""

    name: str
    equations: Equations
    samples: int
    keep: int


@dataclass
class InFile:
    """`Kept` in one group of a file; `state` is told of all motions before it too."""

    recording: Recording
    group: h5py.Group
    number: int
    widest: float = 0.0
    missed: int = 0
    met: int = 0
    filled: int = 0
    happened: int = 0

    def begun(self, where: Where) -> tuple[Where, int]:
        import jax

        told, leaves = self.recording.state
        first, tree = jax.tree_util.tree_flatten(where)
        if told.get("motion") != self.number or len(leaves) != len(first):  # or left by another version
            return where, 0
        self.widest, self.missed, self.filled, self.happened = (told[k] for k in _COUNTS)
        self.met = int(told.get("met", 0))
        return jax.tree_util.tree_unflatten(tree, leaves), int(told["done"])

    def keep(self, rows: Mapping[str, Array], events: Array, missed: int) -> None:
        until = self.filled + len(rows["time"])
        for name, values in rows.items():
            if values.size:
                self.group[name][..., self.filled : until] = values
        listed = events[: len(self.group["event"]) - self.happened]
        if len(listed):
            self.group["event"][self.happened : self.happened + len(listed)] = listed
        self.filled, self.happened = until, self.happened + len(listed)
        self.missed += missed + len(events) - len(listed)
        self.widest = max(self.widest, float(np.abs(rows["contact_displacement"]).max(initial=0.0)))

    def mark(self, where: Where, done: int) -> None:
        self.recording.mark(self, where, done)

    def strips(self, *names: str) -> Iterator[list[Array]]:
        for begin in range(0, self.filled, STRIP):
            yield [self.group[name][..., begin : min(begin + STRIP, self.filled)] for name in names]

    def end(self, attributes: Mapping[str, Any]) -> None:
        """The motion is whole: what a reader is told of it beside its arrays."""
        counts = {k: getattr(self, k) for k in _COUNTS}
        self.recording.end(self.number, {**counts, **attributes})


_COUNTS = ("widest", "missed", "filled", "happened")


@dataclass
class Recording:
    """A file with room for motions, that is filled.

    Attributes:
        path: of the product. file: open beside it. state: where a motion was when that was kept last, and the arrays of
            `Where`. ended: number of a motion -> what is told of it. marked: s, when the state was kept last. latest:
            a state since then, which is kept when the run is interrupted.
    """

    path: Path
    inputs: str
    file: h5py.File
    state: tuple[dict[str, Any], list[Array]]
    ended: dict[int, dict[str, Any]]
    marked: float = 0.0
    latest: tuple[dict[str, Any], Where] | None = None

    def motion(self, number: int) -> InFile:
        return InFile(self, self.file[f"motion_{number + 1}"], number)

    def mark(self, of: InFile, where: Where, done: int) -> None:
        self.latest = {"motion": of.number, "done": done, "met": of.met, **{k: getattr(of, k) for k in _COUNTS}}, where
        if time.monotonic() - self.marked >= PAUSE:
            self.keep_latest()

    def keep_latest(self) -> None:
        """Keep the state of the last whole period, if it is not kept yet."""
        import jax

        if self.latest is not None:
            told, where = self.latest
            self._keep(told, [np.asarray(x) for x in jax.tree_util.tree_leaves(where)])

    def end(self, number: int, told: dict[str, Any]) -> None:
        self.ended[number] = told
        self._keep({}, [])

    def _keep(self, told: dict[str, Any], leaves: Sequence[Array]) -> None:
        """The numbers first, then what counts them."""
        self.file.flush()
        text = json.dumps({"inputs": self.inputs, "ended": self.ended, **told})
        arrays = {"told": np.array(text), **{f"leaf_{i:04d}": x for i, x in enumerate(leaves)}}
        with complete_or_absent(_state(self.path)) as temporary, open(temporary, "wb") as file:
            np.savez(file, allow_pickle=False, **arrays)
        self.state, self.marked, self.latest = (told, list(leaves)), time.monotonic(), None


def _state(path: Path) -> Path:
    return path.with_name(f"{path.name}.state")


def _part(path: Path) -> Path:
    return path.with_name(f"{path.name}.part")


@contextlib.contextmanager
def recording(
    path: Path, inputs: str, plan: Sequence[Planned], fresh: bool = False,
    report: Callable[[str], None] = lambda _: None,
) -> Iterator[Recording]:  # fmt: skip
    """A file of motions to be filled, from where it was left; at the end, where all motions have, it takes its name.

    Args:
        inputs: hash of all that the motions depend on; what was left of others is begun anew. fresh: forget it.

    Raises:
        UserError: no permission, no space.
    """
    told, leaves = ({}, []) if fresh else _left(path, inputs)
    if not told:
        _state(path).unlink(missing_ok=True)
        with complete_or_absent(_part(path)) as temporary, create(temporary) as file:
            size = _reserve(file, plan)
        if size >= ANNOUNCED:
            report(f"{path.name} will have about {1e-6 * size:.3g} MB: orbit.keep periods of orbit.samples each")
    else:
        report(f"goes on from what {_part(path).name} holds")
    ended = {int(k): v for k, v in told.pop("ended", {}).items()}
    try:
        with create(_part(path), again=True) as file:
            found = Recording(path, inputs, file, (told, leaves), ended)
            try:
                yield found
            except KeyboardInterrupt:
                found.keep_latest()
                raise
            for number, one in found.ended.items():
                _finish(file[f"motion_{number + 1}"], one)
        seal(_part(path))
        put_in_place(_part(path), path)
        _state(path).unlink(missing_ok=True)
    except OSError as error:
        raise refused(path, error) from error
    finally:
        if not _state(path).exists():  # whole, or nothing in it
            _part(path).unlink(missing_ok=True)


def _left(path: Path, inputs: str) -> tuple[dict[str, Any], list[Array]]:
    """What a run of the same inputs has left; nothing where it is of others, or damaged."""
    try:
        with np.load(ordinary(_state(path)), allow_pickle=False) as state:
            told = json.loads(str(state["told"]))
            leaves = [state[name] for name in sorted(state.files) if name != "told"]
        with h5py.File(ordinary(_part(path)), "r") as file:
            same = told.pop("inputs") == inputs and file.attrs["format_version"] == FORMAT_VERSION
        return (told, leaves) if same else ({}, [])
    except (*DAMAGE, UserError):
        return {}, []


def _reserve(file: h5py.File, plan: Sequence[Planned]) -> int:
    """Places for all samples, whose bytes are returned, and for events; they take room on the disk as they are
    filled."""
    head(file)
    size = 0
    for i, one in enumerate(plan, 1):
        group, s = file.create_group(f"motion_{i}"), one.samples * one.keep
        e = one.equations
        describe(group, one.name, e.Omega, e.omega2, labels_of(e), units_of(e), touches(e), one.samples)
        rows = sizes(one.equations)
        for name, unit in units_with(units_of(e)).items():
            _room(group, name, (rows[name], s) if name in rows else (s,), unit)
            size += group[name].nbytes
        most = one.keep * (one.samples + EVENTS_OF_CONTACT * len(one.equations.contacts))
        _room(group, "event", (most, 3), "", along=0)
    return size


def _room(group: h5py.Group, name: str, shape: tuple[int, ...], unit: str, along: int = -1) -> None:
    """A dataset that can be made shorter, whose chunks have their places in the file now and are not filled."""
    if not np.prod(shape, dtype=float):
        put(group, name, np.zeros(shape), unit)
        return
    made = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    made.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    made.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    chunk, longest = list(shape), list[int | None](shape)
    chunk[along] = int(max(1, min(shape[along], PART * shape[along] // np.prod(shape, dtype=float))))
    longest[along] = None
    dataset = group.create_dataset(
        name, shape, "f8", dcpl=made, chunks=tuple(chunk), maxshape=tuple(longest), track_times=False
    )
    if unit:
        dataset.attrs["unit"] = unit


def _finish(group: h5py.Group, told: dict[str, Any]) -> None:
    """What there is no sample for goes, and what the motion says of itself comes."""
    told = {k: v for k, v in told.items() if k != "widest"}
    filled, happened = int(told.pop("filled")), int(told.pop("happened"))
    for name in UNITS:
        if group[name].shape[-1] != filled:
            _shorten(group[name], filled, -1)
    if len(group["event"]) != happened:
        _shorten(group["event"], happened, 0)
    tell(group, {"missed_events": told.pop("missed"), **told})


def _shorten(dataset: h5py.Dataset, length: int, axis: int) -> None:
    if dataset.chunks:
        dataset.resize(length, axis % dataset.ndim)
        return
    group, name, unit = dataset.parent, dataset.name.rsplit("/", 1)[-1], dataset.attrs.get("unit", "")
    shape = list(dataset.shape)
    shape[axis] = length
    del group[name]
    put(group, name, np.zeros(shape), unit)


# layout --------------------------------------------------------------------------------------------------------------


def head(file: h5py.File) -> None:
    file.attrs["format"], file.attrs["format_version"] = FORMAT, FORMAT_VERSION
    file.attrs["units"] = "SI: m, kg, s, N, rad"


def describe(
    group: h5py.Group, name: str, Omega: float, omega2: Array, labels: Sequence[str], units: Sequence[str],
    contacts: Sequence[Touch], samples: int,
) -> None:  # fmt: skip
    """What is known of a motion before it is."""
    group.attrs["name"], group.attrs["Omega"], group.attrs["samples_per_period"] = name, Omega, samples
    group.attrs["read_out_units"] = json.dumps(list(units))
    group.attrs["read_outs"], group.attrs["contacts"] = json.dumps(list(labels)), json.dumps(list(contacts))
    group.attrs["events"] = "rows of time in s, number of the contact, kind: " + ", ".join(
        f"{k} {kind}" for k, kind in enumerate(KINDS)
    )
    put(group, "omega2", omega2, "(rad/s)^2")


def tell(group: h5py.Group, told: Mapping[str, Any]) -> None:
    """What a motion says of itself beside its arrays."""
    for key, value in told.items():
        group.attrs[key] = json.dumps(value) if isinstance(value, list | tuple) else value


def labels_of(e: Equations) -> tuple[str, ...]:
    """Read-outs, ``monitor direction``."""
    return tuple(f"{w.monitor} {w.label}" for w in e.assembly.outputs)


def units_of(e: Equations) -> tuple[str, ...]:
    """Of the read-outs, as `units.Quantity` has them."""
    return tuple(measured(e.assembly, i).unit for i in range(len(e.assembly.outputs)))


def units_with(read_outs: Sequence[str]) -> dict[str, str]:
    """`UNITS` with those of the read-outs, each once."""
    own = dict.fromkeys(read_outs or ("m",))
    return {**UNITS, "displacement": ", ".join(own), "velocity": ", ".join(f"{unit}/s" for unit in own)}


def is_of_motions(path: Path | str) -> bool:
    """Whether a file is one of motions, as far as its head can be read."""
    with contextlib.suppress(*DAMAGE):
        if seal_state(Path(path)) != "broken" and h5py.is_hdf5(path):
            with h5py.File(path, "r") as file:
                return bool(file.attrs.get("format") == FORMAT)
    return False


@in_its_file
def opened(path: Path | str) -> h5py.File:
    """A file of motions, open to be read, looked at before.

    Raises:
        UserError: missing, damaged, foreign or of another version.
    """
    path = Path(path)
    if not ordinary(path).is_file():
        raise UserError("no such file of motions; run the case first or correct the path")
    refuse_damaged(path, _TRIAL, "run the case again")
    try:
        file = h5py.File(path, "r")
        form, version = file.attrs.get("format"), str(file.attrs.get("format_version"))
        if form != FORMAT:
            raise UserError(f"holds no motions (its attribute 'format' is {form!r}, not '{FORMAT}')")
        if version != FORMAT_VERSION:
            raise UserError(f"has format version {version}, this program reads {FORMAT_VERSION}; run it again")
        inspect(file)
        for group in file.values():
            if any(group[name].shape[-1] != len(group["time"]) for name in UNITS) or group["event"].shape[1:] != (3,):
                raise ValueError(f"{group.name}: arrays of different lengths")
        return file
    except DAMAGE as error:
        raise UserError(f"is damaged or incomplete ({short(error)}); run the case again") from error


_TRIAL = "from microslip.time_domain.samples import opened; import h5py; h5py.File(path, 'r').visititems(print)"
