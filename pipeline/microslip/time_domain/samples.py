"""What is kept of a motion: its samples, a period at a time, and what is known of it before."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import h5py
import numpy as np

from ..contact.elements import Spring
from ..data import Array
from ..files.hdf5 import put
from ..harmonic_balance.readout import measured
from ..harmonic_balance.reduced import READS
from .bodies import Hardest, MotionState, Snapshot
from .contacts import gapes
from .equations import MotionEquations
from .stepper import KINDS

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

Where = tuple[MotionState, Hardest]
"""Where a motion is, and the hardest period of it so far."""


def of_period(e: MotionEquations, seen: Snapshot) -> dict[str, Array]:
    """Name -> (rows, s) or (s,) of samples."""
    seen = Snapshot._make(map(np.asarray, seen))
    rates = seen.q_dot @ e.output.T + e.rates(seen.time) @ e.output_given.T
    if e.output_residual.any() and len(seen.time) > 1:  # what yields at once has no velocity of its own
        rates = rates - np.gradient(seen.force @ e.output_residual.T, seen.time, axis=0)
    rates = without_rounding(rates, e.output, seen.q_dot)
    motion = seen.q.T, seen.q_dot.T, seen.d.T, seen.force.T
    columns = seen.time, e.frequency(seen.time), read(e, seen), rates.T, *motion, *energies(e, seen).values()
    return dict(zip(UNITS, columns, strict=True))


def read(e: MotionEquations, seen: Snapshot) -> Array:
    """(w, s) read-outs."""
    q, force, o = np.asarray(seen.q), np.asarray(seen.force), e.oscillators(np.asarray(seen.time))
    outputs = q @ e.output.T - (force - e.F_0) @ e.output_residual.T + o @ e.output_given.T
    return without_rounding(outputs, e.output, q).T


def without_rounding(found: Array, output: Array, q: Array) -> Array:
    """Samples (s, w) of read-outs by coordinates (s, m); zero is one that reads rounding alone, as in
    `harmonic_balance.reduced.read`."""
    moved = np.sqrt((q**2 @ (output != 0).T).max(axis=0, initial=0.0))
    least = READS * np.linalg.norm(output, axis=1) * moved
    return np.where(np.abs(found).max(axis=0, initial=0.0) <= least, 0.0, found)


def energies(e: MotionEquations, seen: Snapshot) -> dict[str, Array]:
    """`ENERGIES`, see `Orbit`: preloads count as loads, and what bodies hold beside their modes as theirs."""
    named = dict(zip(("given", "damped", "contacts", "lost", "stored", "ground"), seen.energy.T, strict=True))
    more, preloads = seen.force - e.F_0, seen.d @ e.F_0
    yielded = 0.5 * np.einsum("sc,cd,sd->s", more, e.R, more)
    named["given"] = named["given"] + preloads
    named["contacts"] = named["contacts"] + preloads - yielded
    return {"mechanical": seen.mechanical + yielded, **named}


def sizes(e: MotionEquations) -> dict[str, int]:
    """Name of an array -> its rows; those of time alone are left out."""
    of = {"read_out": len(e.output), "mode": len(e.omega2), "contact_coordinate": len(e.D)}
    return {name: of[axis] for name, axis in ROWS.items()}


class ContactFacts(NamedTuple):
    """A contact: its name, whether each of its coordinates moves points in their plane against friction, and whether
    its law knows where it opens."""

    name: str
    tangential: tuple[bool, ...]
    opens: bool


@dataclass(frozen=True, eq=False, kw_only=True)
class Announced:
    """What is known of a motion before it is.

    Attributes:
        name. Omega: rad/s of the excitation. omega2: (m,) (rad/s)^2 of the modal coordinates. labels: of the read-outs,
            ``monitor direction``; units: theirs, as `units.Quantity` has them. touching: contacts, in the order in
            which events count them. samples: of a period.
    """

    name: str
    Omega: float
    omega2: Array
    labels: tuple[str, ...]
    units: tuple[str, ...]
    touching: tuple[ContactFacts, ...]
    samples: int

    def put(self, group: h5py.Group) -> None:
        """Into the group of a motion."""
        told = group.attrs
        told["name"], told["Omega"], told["samples_per_period"] = self.name, self.Omega, self.samples
        told["read_out_units"] = json.dumps(self.units)
        told["read_outs"], told["contacts"] = json.dumps(self.labels), json.dumps(self.touching)
        kinds = ", ".join(f"{k} {kind}" for k, kind in enumerate(KINDS))
        told["events"] = f"rows of time in s, number of the contact, kind: {kinds}"
        put(group, "omega2", self.omega2, "(rad/s)^2")


def announced(name: str, e: MotionEquations, samples: int) -> Announced:
    """Of equations, with so many samples of a period."""
    outputs, patches = e.assembly.outputs, {id(c.patch): c.patch for c in e.contacts}
    alike = dict[int, tuple[tuple[bool, ...], bool]]()
    for key, patch in patches.items():
        rubs = (np.abs(patch.kinematics[:, 1:]).max(axis=(0, 1)) > 0) & (not isinstance(patch.law, Spring))
        alike[key] = tuple(map(bool, rubs)), gapes(patch)
    return Announced(
        name=name,
        Omega=e.Omega,
        omega2=e.omega2,
        labels=tuple(f"{w.monitor} {w.label}" for w in outputs),
        units=tuple(measured(e.assembly, i).unit for i in range(len(outputs))),
        touching=tuple(ContactFacts(c.name, *alike[id(c.patch)]) for c in e.contacts),
        samples=samples,
    )


def read_announced(group: h5py.Group) -> Announced:
    """What `Announced.put` wrote."""
    told, lists = group.attrs, ("read_outs", "read_out_units", "contacts")
    labels, units, contacts = (json.loads(told.get(name, "[]")) for name in lists)
    return Announced(
        name=str(told["name"]),
        Omega=float(told["Omega"]),
        omega2=group["omega2"][()],
        labels=tuple(labels),
        units=tuple(units),
        touching=tuple(ContactFacts(name, tuple(tangential), opens) for name, tangential, opens in contacts),
        samples=int(told["samples_per_period"]),
    )


@dataclass
class KeptSamples:
    """Where the samples of a motion go: in memory.

    Attributes:
        widest: m, the largest motion of the contacts so far. missed: events that there was no room for. met: events
            since the start, those while it settles among them. parts, events: what was kept, period by period.
    """

    widest: float = 0.0
    missed: int = 0
    met: int = 0
    parts: list[Mapping[str, Array]] = field(default_factory=list)
    events: list[Array] = field(default_factory=list)

    def begun(self, where: Where) -> tuple[Where, int]:
        """Where to go on, and how many periods are done."""
        return where, 0

    def keep(self, rows: Mapping[str, Array], events: Array, missed: int) -> None:
        """Samples that follow, and (e, 3) events among them."""
        self.parts.append(rows)
        self.events.append(events)
        self.counted(rows, missed)

    def counted(self, rows: Mapping[str, Array], missed: int) -> None:
        self.missed += missed
        self.widest = max(self.widest, float(np.abs(rows["contact_displacement"]).max(initial=0.0)))

    def mark(self, where: Where, done: int) -> None:
        """All that was kept belongs to so many periods."""

    def strips(self, *names: str) -> Iterator[list[Array]]:
        """Arrays that were kept, so many samples at a time."""
        for part in self.parts:
            yield [part[name] for name in names]

    def arrays(self, e: MotionEquations) -> dict[str, Array]:
        """Name -> (rows, s) or (s,), and ``event`` (e, 3)."""
        rows = sizes(e)
        none = {name: np.zeros((rows[name], 0) if name in rows else 0) for name in UNITS}
        joined = {name: np.concatenate([none[name], *(p[name] for p in self.parts)], axis=-1) for name in UNITS}
        return joined | {"event": np.concatenate([np.zeros((0, 3)), *self.events])}


def units_with(read_outs: Sequence[str]) -> dict[str, str]:
    """`UNITS` with those of the read-outs, each once."""
    units = dict.fromkeys(read_outs or ("m",))
    return {**UNITS, "displacement": ", ".join(units), "velocity": ", ".join(f"{unit}/s" for unit in units)}
