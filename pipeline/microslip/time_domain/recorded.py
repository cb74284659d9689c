"""Motions in a file, which are read when they are asked for, and the file that a run fills as it goes."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..data import Array
from ..errors import UserError
from ..files.hdf5 import refuse_foreign
from ..files.store import fingerprint
from ..harmonic_balance import solved
from ..harmonic_balance.nonlinear_modes import Backbone
from ..results.dataset import Dataset, is_dataset, read_dataset
from ..results.series import Series
from ..results.tones import KIND, TwoTones
from ..settings.arguments import checked
from ..units import UNIT_OF_FREQUENCY
from . import orbit, samples
from .equations import Equations
from .orbit import Orbit, Start
from .starts import Periodic


class Recorded(Orbit):
    """A motion in a file: an `Orbit` whose arrays are read each time that one is asked for.

    What it says of itself reads the file a strip at a time, however long it is.

    Attributes:
        path, number: of the file and of the motion in it, from 1. name.
    """

    path: Path
    number: int
    name: str

    def __init__(self, path: Path, number: int, group: h5py.Group, equations: Equations | None = None) -> None:
        told = dict(group.attrs)
        own: dict[str, Any] = {
            "path": path, "number": number, "name": str(told["name"]), "labels": tuple(json.loads(told["read_outs"])),
            "_units": tuple(json.loads(told.get("read_out_units", "[]"))),
            "samples": int(told["samples_per_period"]), "steps": int(told["steps_per_period"]),
            "missed": int(told["missed_events"]), "error": float(told["error"]), "diverged": float(told["diverged"]),
            "messages": tuple(json.loads(told["messages"])), "exponent": orbit.exponent_of(told),
            "_omega": float(told["Omega"]), "shown": UNIT_OF_FREQUENCY.get(),
            "_omega2": group["omega2"][()], "_touching": samples.touches_of(told), "_equations": equations,
        }  # fmt: skip
        self.__dict__.update(own)

    def array(self, name: str, part: slice = slice(None)) -> Array:
        with h5py.File(self.path, "r") as file:
            return np.asarray(file[f"motion_{self.number}"][name][..., part])

    @property
    def units(self) -> tuple[str, ...]:
        return tuple(self.__dict__["_units"])

    @property
    def Omega(self) -> float:
        return float(self.__dict__["_omega"])

    @property
    def omega2(self) -> Array:
        return np.asarray(self.__dict__["_omega2"])

    @property
    def touching(self) -> tuple[samples.Touch, ...]:
        return tuple(self.__dict__["_touching"])

    @property
    def equations(self) -> Equations:  # type: ignore[override]
        """Those that it was computed with, in the process that did.

        Raises:
            UserError: the motion was read from a file, which does not hold its contacts' laws.
        """
        found: Equations | None = self.__dict__["_equations"]
        if found is None:
            raise UserError(f"{self.path}: holds a motion and not what moved; integrate the assembly again")
        return found

    time = property(lambda self: self.array("time"))  # type: ignore[assignment]
    y = property(lambda self: self.array("displacement"))  # type: ignore[assignment]
    v = property(lambda self: self.array("velocity"))  # type: ignore[assignment]
    q = property(lambda self: self.array("modal_displacement"))  # type: ignore[assignment]
    q_dot = property(lambda self: self.array("modal_velocity"))  # type: ignore[assignment]
    d = property(lambda self: self.array("contact_displacement"))  # type: ignore[assignment]
    force = property(lambda self: self.array("contact_force"))  # type: ignore[assignment]

    @property
    def energy(self) -> Mapping[str, Array]:  # type: ignore[override]
        return {name: self.array(f"energy_{name}") for name in samples.ENERGIES}

    @property
    def events(self) -> Array:  # type: ignore[override]
        with h5py.File(self.path, "r") as file:
            return np.asarray(file[f"motion_{self.number}"]["event"][()])


@dataclass(frozen=True)
class Asked:
    """A motion that is asked for: its name, and the arguments of `orbit.run`."""

    name: str
    equations: Equations
    settle: int
    keep: int
    samples: int = 256
    steps: int | None = None
    start: Start | Periodic = "static"

    @property
    def fingerprint(self) -> str:
        """Of all that the motion depends on."""
        bare = replace(self.equations.assembly, components=())
        e = replace(self.equations, assembly=bare)
        return fingerprint(e, self.name, self.settle, self.keep, self.samples, self.steps, self.start)


def run(
    path: Path | str, asked: Sequence[Asked], inputs: str = "", fresh: bool = False,
    report: Callable[[str], None] = lambda _: None,
) -> list[Recorded]:  # fmt: skip
    """Motions one after the other, in a file that is complete or absent; their samples are written as they come.

    A run that is killed is gone on with by the next one that asks for the same, and ends with the same numbers.

    Args:
        inputs: more that the motions depend on. fresh: begin anew all the same. report: is told what is under way.

    Raises:
        UserError: see `orbit.run`; no permission, no space. NotConverged: no state of rest is found.
    """
    path = Path(path)
    refuse_foreign(path, samples.FORMAT)
    plan = [samples.Planned(a.name, a.equations, a.samples, a.keep) for a in asked]
    depends = fingerprint([a.fingerprint for a in asked], inputs)
    with samples.recording(path, depends, plan, fresh, report) as file:
        for number, a in enumerate(asked):
            if number in file.ended:
                continue
            kept = file.motion(number)

            def tell(text: str, name: str = a.name) -> None:
                report(f"{text}, {name}")

            ended = orbit.march(a.equations, a.settle, a.keep, a.samples, a.steps, a.start, tell, kept)
            kept.end(
                {
                    "steps_per_period": ended.steps, "error": ended.error, "diverged": ended.diverged,
                    "messages": list(ended.messages), **orbit.told_of(ended.exponent),
                }
            )  # fmt: skip
    with h5py.File(path, "r") as whole:
        return [Recorded(path, i, whole[f"motion_{i}"], a.equations) for i, a in enumerate(asked, 1)]


@checked
def read_orbits(path: Path | str) -> tuple[Recorded, ...]:
    """Read ``orbit.h5``, or what `Orbit.save` wrote: its motions, whose arrays are read when they are asked for.

    Raises:
        UserError: missing, damaged, foreign or of another version.
    """
    path = Path(path)
    with samples.opened(path) as file:
        count = sum(name.startswith("motion_") for name in file)
        return tuple(Recorded(path, i, file[f"motion_{i}"]) for i in range(1, count + 1))


@checked
def load(path: Path | str) -> Series | Backbone | Recorded | TwoTones | Dataset:
    """What a result's `save` wrote: the only series of a response file, a nonlinear mode, the only
    motion in time, motions of two frequencies, or a dataset.

    Files of several are read by `read_response` and `read_orbits`.

    Raises:
        UserError: no such file, or one of several series or motions.
    """
    if is_dataset(path):
        data = read_dataset(path)
        return TwoTones.of_data(data) if data.kind == KIND else data
    if not samples.is_of_motions(path):
        return solved.load(path)
    found = read_orbits(path)
    if len(found) != 1:
        names = ", ".join(one.name for one in found)
        raise UserError(f"{path}: holds {len(found)} motions ({names}); take one of read_orbits(path)")
    return found[0]
