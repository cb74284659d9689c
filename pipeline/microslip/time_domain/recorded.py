"""Motions in a file: read when they are asked for, and written as a run goes.

``orbit.h5`` (docs/time_domain.md) holds several motions. While they are computed, ``orbit.h5.part`` beside it has a
place for every sample from the beginning: nothing but numbers is written from then on, so a process killed at any
instant leaves a file that can be read. It takes room on the disk only as it is filled. ``orbit.h5.state``, complete or
absent, says how far it is filled, and where the motion was.
"""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import jax
import numpy as np

from ..data import Array
from ..errors import UserError, in_its_file
from ..files.hdf5 import ANNOUNCED, create, put, refuse_foreign, seal, seal_state
from ..files.hostile import DAMAGE, inspect, refuse_damaged, short
from ..files.store import complete_or_absent, fingerprint, ordinary, put_in_place, refused
from ..harmonic_balance import solved
from ..harmonic_balance.nonlinear_modes import Backbone
from ..progress import Report
from ..results.dataset import Dataset, is_dataset, read_dataset
from ..results.series import Series
from ..results.tones import KIND, TwoTones
from ..settings.arguments import checked
from . import orbit
from .equations import MotionEquations
from .orbit import FORMAT, FORMAT_VERSION, Orbit, Start, head, read_ended, tell
from .samples import STRIP, UNITS, KeptSamples, Where, announced, read_announced, sizes, units_with
from .starts import PeriodicStart

PART = 1 << 17
"""Numbers of an array that are together in the file."""

EVENTS_OF_CONTACT = 64
"""Events of a contact in a period that a file has room for, one more for every sample."""

PAUSE = 1.0
"""s between two states that are kept."""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class RecordedOrbit(Orbit):
    """A motion in a file: an `Orbit` whose arrays are read each time that one is asked for.

    What it says of itself reads the file a strip at a time, however long it is. Its `equations` are those that it was
    computed with, in the process that did.

    Attributes:
        path, number: of the file and of the motion in it, from 1.
    """

    path: Path
    number: int

    def array(self, name: str, part: slice = slice(None)) -> Array:
        with h5py.File(self.path, "r") as file:
            return np.asarray(file[f"motion_{self.number}"][name][..., part])

    @property
    def equations(self) -> MotionEquations:
        """Those that it was computed with, in the process that did.

        Raises:
            UserError: the motion was read from a file, which does not hold its contacts' laws.
        """
        if self.model is None:
            raise UserError(f"{self.path}: holds a motion and not what moved; integrate the assembly again")
        return self.model


def _recorded(path: Path, number: int, file: h5py.File, equations: MotionEquations | None = None) -> RecordedOrbit:
    group = file[f"motion_{number}"]
    told = dict(group.attrs)
    facts, missed = vars(read_announced(group)) | vars(read_ended(told)), int(told["missed_events"])
    return RecordedOrbit(path=path, number=number, arrays={}, missed=missed, model=equations, **facts)


@dataclass(frozen=True)
class Integration:
    """A motion that is asked for: its name, and the arguments of `orbit.run`."""

    name: str
    equations: MotionEquations
    settle: int
    keep: int
    samples: int = 256
    steps: int | None = None
    start: Start | PeriodicStart = "static"

    @property
    def fingerprint(self) -> str:
        """Of all that the motion depends on."""
        bare = replace(self.equations.assembly, components=())
        return fingerprint(replace(self, equations=replace(self.equations, assembly=bare)))


def run(
    path: Path | str,
    asked: Sequence[Integration],
    inputs: str = "",
    fresh: bool = False,
    report: Report = lambda _: None,
) -> list[RecordedOrbit]:
    """Motions one after the other, in a file that is complete or absent; their samples are written as they come.

    A run that is killed is gone on with by the next one that asks for the same, and ends with the same numbers.

    Args:
        inputs: more that the motions depend on. fresh: begin anew all the same. report: is told what is under way.

    Raises:
        UserError: see `orbit.run`; no permission, no space. NotConverged: no state of rest is found.
    """
    path = Path(path)
    refuse_foreign(path, FORMAT)
    depends = fingerprint([a.fingerprint for a in asked], inputs)
    with recording(path, depends, asked, fresh, report) as file:
        for number, a in enumerate(asked):
            if number in file.ended:
                continue
            kept = InFile(recording=file, group=file.file[f"motion_{number + 1}"], number=number)

            def tell_of(text: str, name: str = a.name) -> None:
                report(f"{text}, {name}")

            ended = orbit.march(a.equations, a.settle, a.keep, a.samples, a.steps, a.start, tell_of, kept)
            file.ended[number] = kept.counts | ended.told
            file.keep({}, [])
    with h5py.File(path, "r") as whole:
        return [_recorded(path, i, whole, a.equations) for i, a in enumerate(asked, 1)]


# a file that is filled -----------------------------------------------------------------------------------------------


@dataclass(kw_only=True)
class InFile(KeptSamples):
    """`KeptSamples` in one group of a file. filled, happened: samples and events that it holds."""

    recording: Recording
    group: h5py.Group
    number: int
    filled: int = 0
    happened: int = 0

    @property
    def counts(self) -> dict[str, Any]:
        return {"widest": self.widest, "missed": self.missed, "filled": self.filled, "happened": self.happened}

    def begun(self, where: Where) -> tuple[Where, int]:
        told, leaves = self.recording.state
        first, tree = jax.tree_util.tree_flatten(where)
        if told.get("motion") != self.number or len(leaves) != len(first):  # or left by another version
            return where, 0
        self.widest, self.missed, self.met = told["widest"], told["missed"], told["met"]
        self.filled, self.happened = told["filled"], told["happened"]
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
        self.counted(rows, missed + len(events) - len(listed))

    def mark(self, where: Where, done: int) -> None:
        self.recording.latest = {"motion": self.number, "done": done, "met": self.met, **self.counts}, where
        if time.monotonic() - self.recording.marked >= PAUSE:
            self.recording.keep_latest()

    def strips(self, *names: str) -> Iterator[list[Array]]:
        for begin in range(0, self.filled, STRIP):
            yield [self.group[name][..., begin : min(begin + STRIP, self.filled)] for name in names]


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
    state: tuple[dict[str, Any], Sequence[Array]]
    ended: dict[int, dict[str, Any]]
    marked: float = 0.0
    latest: tuple[dict[str, Any], Where] | None = None

    def keep_latest(self) -> None:
        """Keep the state of the last whole period, if it is not kept yet."""
        if self.latest is not None:
            told, where = self.latest
            self.keep(told, [np.asarray(x) for x in jax.tree_util.tree_leaves(where)])

    def keep(self, told: dict[str, Any], leaves: Sequence[Array]) -> None:
        """The numbers first, then what counts them."""
        self.file.flush()
        text = json.dumps({"inputs": self.inputs, "ended": self.ended, **told})
        arrays = {"told": np.array(text), **{f"leaf_{i:04d}": x for i, x in enumerate(leaves)}}
        with complete_or_absent(_beside(self.path, "state")) as temporary, open(temporary, "wb") as file:
            np.savez(file, allow_pickle=False, **arrays)
        self.state, self.marked, self.latest = (told, leaves), time.monotonic(), None


def _beside(path: Path, what: str) -> Path:
    return path.with_name(f"{path.name}.{what}")


@contextlib.contextmanager
def recording(path: Path, inputs: str, plan: Sequence[Integration], fresh: bool, report: Report) -> Iterator[Recording]:
    """A file of motions to be filled, from where it was left; at the end, where all motions have, it takes its name.

    Args:
        inputs: hash of all that the motions depend on; what was left of others is begun anew. fresh: forget it.

    Raises:
        UserError: no permission, no space.
    """
    part, state = _beside(path, "part"), _beside(path, "state")
    told, leaves = ({}, []) if fresh else _left(path, inputs)
    if not told:
        state.unlink(missing_ok=True)
        with complete_or_absent(part) as temporary, create(temporary) as file:
            size = _reserve(file, plan)
        if size >= ANNOUNCED:
            report(f"{path.name} will have about {1e-6 * size:.3g} MB: orbit.keep periods of orbit.samples each")
    else:
        report(f"goes on from what {part.name} holds")
    ended = {int(k): v for k, v in told.pop("ended", {}).items()}
    try:
        with create(part, again=True) as file:
            filled = Recording(path, inputs, file, (told, leaves), ended)
            try:
                yield filled
            except KeyboardInterrupt:
                filled.keep_latest()
                raise
            for number, facts in filled.ended.items():
                _finish(file[f"motion_{number + 1}"], facts)
        seal(part)
        put_in_place(part, path)
        state.unlink(missing_ok=True)
    except OSError as error:
        raise refused(path, error) from error
    finally:
        if not state.exists():  # whole, or nothing in it
            part.unlink(missing_ok=True)


def _left(path: Path, inputs: str) -> tuple[dict[str, Any], list[Array]]:
    """What a run of the same inputs has left; nothing where it is of others, or damaged."""
    try:
        with np.load(ordinary(_beside(path, "state")), allow_pickle=False) as state:
            told = json.loads(str(state["told"]))
            leaves = [state[name] for name in sorted(state.files) if name != "told"]
        with h5py.File(ordinary(_beside(path, "part")), "r") as file:
            same = told.pop("inputs") == inputs and file.attrs["format_version"] == FORMAT_VERSION
        return (told, leaves) if same else ({}, [])
    except (*DAMAGE, UserError):
        return {}, []


def _reserve(file: h5py.File, plan: Sequence[Integration]) -> int:
    """Places for all samples, whose bytes are returned, and for events; they take room on the disk as they are
    filled."""
    head(file)
    size = 0
    for i, motion in enumerate(plan, 1):
        e, s = motion.equations, motion.samples * motion.keep
        group, known = file.create_group(f"motion_{i}"), announced(motion.name, e, motion.samples)
        known.put(group)
        rows = sizes(e)
        for name, unit in units_with(known.units).items():
            _room(group, name, (rows[name], s) if name in rows else (s,), unit)
            size += group[name].nbytes
        most = motion.keep * (motion.samples + EVENTS_OF_CONTACT * len(e.contacts))
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


def _finish(group: h5py.Group, told: Mapping[str, Any]) -> None:
    """What there is no sample for goes, and what the motion says of itself comes."""
    lengths = dict.fromkeys(UNITS, (int(told["filled"]), -1)) | {"event": (int(told["happened"]), 0)}
    for name, (length, axis) in lengths.items():
        if group[name].shape[axis] != length:
            _shorten(group[name], length, axis)
    facts = {k: v for k, v in told.items() if k not in ("widest", "missed", "filled", "happened")}
    tell(group, {"missed_events": told["missed"], **facts})


def _shorten(dataset: h5py.Dataset, length: int, axis: int) -> None:
    if dataset.chunks:
        dataset.resize(length, axis % dataset.ndim)
        return
    group, name, unit = dataset.parent, dataset.name.rsplit("/", 1)[-1], dataset.attrs.get("unit", "")
    shape = list(dataset.shape)
    shape[axis] = length
    del group[name]
    put(group, name, np.zeros(shape), unit)


# reading -------------------------------------------------------------------------------------------------------------


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


_TRIAL = "from microslip.time_domain.recorded import opened; import h5py; h5py.File(path, 'r').visititems(print)"


@checked
def read_orbits(path: Path | str) -> tuple[RecordedOrbit, ...]:
    """Read ``orbit.h5``, or what `Orbit.save` wrote: its motions, whose arrays are read when they are asked for.

    Raises:
        UserError: missing, damaged, foreign or of another version.
    """
    path = Path(path)
    with opened(path) as file:
        count = sum(name.startswith("motion_") for name in file)
        return tuple(_recorded(path, i, file) for i in range(1, count + 1))


@checked
def load(path: Path | str) -> Series | Backbone | RecordedOrbit | TwoTones | Dataset:
    """What a result's `save` wrote: the only series of a response file, a nonlinear mode, the only
    motion in time, motions of two frequencies, or a dataset.

    Files of several are read by `read_response` and `read_orbits`.

    Raises:
        UserError: no such file, or one of several series or motions.
    """
    if is_dataset(path):
        data = read_dataset(path)
        return TwoTones.of_data(data) if data.kind == KIND else data
    if not _is_of_motions(path):
        return solved.load(path)
    motions = read_orbits(path)
    if len(motions) != 1:
        names = ", ".join(m.name for m in motions)
        raise UserError(f"{path}: holds {len(motions)} motions ({names}); take one of read_orbits(path)")
    return motions[0]


def _is_of_motions(path: Path | str) -> bool:
    """Whether a file is one of motions, as far as its head can be read."""
    with contextlib.suppress(*DAMAGE):
        if seal_state(Path(path)) != "broken" and h5py.is_hdf5(path):
            with h5py.File(path, "r") as file:
                return bool(file.attrs.get("format") == FORMAT)
    return False
