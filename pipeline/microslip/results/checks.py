"""What every solution has to satisfy besides the equations that it was solved from, and what a response file claims,
verified from its own content."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..basis.checks import Check
from ..data import Array, ModalBasis
from ..operating.motion import read_out
from ..reduced.compliance import has_residual
from ..units import counted, percent
from .files import Response
from .series import CONVERGED, READ, Series

BALANCE = 1e-4
"""Share of the energy that may be missing between what is supplied, damped and taken by the contacts: they follow from
the same solution, so that no more than what Newton's method leaves is missing."""

COUNTED = 0.05
"""Share of the energy by which the work on the contacts may differ from the loss that their laws count. It falls with
the square of the samples: 64 leave 2e-4 of forty random systems in the median and 5e-3 at most
(`tests/test_random_systems.py`); bodies that hit each other between few samples leave more than this."""

UNCERTAIN = 0.05
"""What an amplitude is likely to be off by for want of harmonics and samples, over it, from which on it
is called uncertain in tables and pictures."""

MOTION = 1e-4
"""Share of the contacts' motion by which the bodies' may differ from it."""

ROUNDING = 1e-9
"""Share of what a motion as large could make a read-out, in which its rounding lies."""

EXCHANGED = 1e-6
"""Of the energy that goes to and fro in loads and contacts without loss, this much counts as supplied: differences of
less cannot be told from rounding."""

RESTING = 1e-20
"""Of the work that the mean forces of the contacts would do on their mean displacements: where nothing vibrates, what
is left of these by rounding, of forces and motions alike, makes energies of less."""


@dataclass(frozen=True)
class Checks:
    """Three numbers that a solution leaves, NaN where nothing can be said.

    Attributes:
        balance: energy supplied less damped less work on the contacts, over the largest of them. counted: work on the
            contacts less what their laws count as lost, over the same. motion: largest difference of the motion at the
            contacts' points as read from the bodies' coordinates and as the laws saw it, over the largest motion.
    """

    balance: float
    counted: float
    motion: float

    @property
    def failure(self) -> str:
        """Why the solution is none; empty if it is one."""
        if abs(self.balance) > BALANCE:
            return f"energy: {percent(abs(self.balance))} of what is supplied is missing in the balance; report it"
        if abs(self.counted) > COUNTED:
            more = "more" if self.counted > 0 else "less"
            return f"energy: contacts take {more} than their laws count, by {percent(abs(self.counted))}; raise samples"
        if self.motion > MOTION:
            return f"read-out: bodies and contacts differ by {percent(self.motion)} of their motion; report it"
        return ""


UNCHECKED = Checks(np.nan, np.nan, np.nan)


def work(force: Array, displacement: Array) -> Array:
    """(...) J that forces (..., k, W) do on motions (..., k, W) in a cycle, harmonics mean, cos, sin, cos 2, ..."""
    (F_c, F_s), (u_c, u_s) = ((a[..., 1::2], a[..., 2::2]) for a in (force, displacement))
    h = np.arange(1, F_c.shape[-1] + 1)
    return np.pi * (h * (F_c * u_s - F_s * u_c)).sum(axis=(-2, -1))


def exchanged(force: Array, displacement: Array) -> Array:
    """(...) J: the same if all forces were in phase with the speed."""
    F, u = (np.hypot(a[..., 1::2], a[..., 2::2]) for a in (force, displacement))
    return np.pi * (np.arange(1, F.shape[-1] + 1) * F * u).sum(axis=(-2, -1))


def resting(force: Array, displacement: Array) -> Array:
    """(...) J: mean forces times mean displacements, regardless of signs."""
    return np.abs(force[..., 0] * displacement[..., 0]).sum(axis=-1)


def shares(supplied: Any, damped: Any, taken: Any, lost: Any, exchanged: Any, resting: Any) -> tuple[Any, Any]:
    """`Checks.balance` and `Checks.counted` of energies per cycle, J, numbers or (f,).

    Args:
        taken: work done on the contacts. lost: what their laws count of it. exchanged: see `exchanged`, of loads and
            contacts. resting: see `resting`, of contacts.
    """
    least = np.maximum(RESTING * resting, 1e-300) + 0 * exchanged
    size = np.max([abs(supplied), abs(damped), abs(taken), EXCHANGED * exchanged, least], axis=0)
    return (supplied - damped - taken) / size, (taken - lost) / size


# a whole response --------------------------------------------------------------------------------------------------


def sentence(response: Response, estimated: float | None) -> str:
    """The largest errors of a response, and which points are no solutions and why.

    Args:
        estimated: largest estimated error of an amplitude for want of harmonics and samples, over it; None: not known.
    """
    guess = "not estimated" if estimated is None else f"estimated as {percent(estimated)} at most"
    guess = guess if estimated is None or np.isfinite(estimated) else "unknown, no finer solution was found"
    worst = Checks(*(_worst(response.series, name) for name in ("balance", "counted", "motion")))
    return f"{checked(worst)}, error of harmonics and samples: {guess}; {_of_points(response.series)}"


def checked(worst: Checks) -> str:
    """The largest errors of some solutions in words."""
    words = [
        _to("energy in balance", worst.balance),
        _to("contacts take what their laws count", worst.counted),
        _to("bodies move as their contacts", worst.motion),
    ]
    return f"checked: {', '.join(words)}"


def largest(each: Sequence[Checks]) -> Checks:
    """The largest errors of some solutions, NaN where nothing can be said."""
    rows = np.abs([[c.balance, c.counted, c.motion] for c in each]).reshape(-1, 3)
    known = np.where(np.isnan(rows), -1.0, rows).max(axis=0, initial=-1.0)
    return Checks(*(float(v) if v >= 0 else np.nan for v in known))


def _to(what: str, worst: float) -> str:
    return f"{what} to {worst:.1g}" if np.isfinite(worst) else f"{what}: not known"


def _worst(series: tuple[Series, ...], name: str) -> float:
    """Largest entry of a check among the converged points; NaN where nothing is known."""
    found = [np.abs(s.arrays[f"checks/{name}"][s.converged]) for s in series if f"checks/{name}" in s.arrays]
    known = np.concatenate(found) if found else np.zeros(0)
    known = known[~np.isnan(known)]
    return float(known.max()) if len(known) else np.nan


def _of_points(series: tuple[Series, ...]) -> str:
    whole = sum(len(s.status) for s in series)
    added = int(sum(s.arrays["added"].sum() for s in series if "added" in s.arrays))
    more = f"; {added} were added at narrow resonances, folds and failures" if added else ""
    causes = Counter(cause(status) for s in series for status in s.status if status != CONVERGED)
    if not causes:
        return f"all {counted(whole, 'point')} converged{more}"
    why = ", ".join(f"{count} {name}" for name, count in causes.most_common())
    return f"{causes.total()} of {counted(whole, 'point')} did not converge ({why}){more}"


def cause(status: str) -> str:
    """Why a point did not converge, in a word or two: what stands before the first colon of its status."""
    return status.split(":")[0]


def check_response(response: Response, bases: Mapping[str, ModalBasis]) -> list[Check]:
    """A response verified from its own content and the modal files it was computed with.

    Args:
        bases: component -> its modal file, of those that are at hand.
    """
    found: list[Check] = []
    for s in response.series:
        failed = [f"{f:.6g} Hz: {text}" for f, text in zip(s.frequency, s.status, strict=True) if text != CONVERGED]
        found.append(_held(s, "points that did not converge", len(failed), 0, failed[0] if failed else ""))
        told = {n: a[s.converged] for n, a in s.arrays.items() if not n.startswith("checks/")}
        spoilt = [n for n, a in told.items() if not np.isfinite(a).all()]
        found.append(_held(s, "arrays that are not finite", len(spoilt), 0, ", ".join(spoilt)))
        for name, limit in (("balance", BALANCE), ("counted", COUNTED), ("motion", MOTION)):
            if np.isfinite(worst := _worst((s,), name)):
                found.append(_held(s, name, worst, limit))
        found += _energy(s) + _read_again(response, s, bases) + _table(response, s)
    return found


def _held(s: Series, name: str, value: float, limit: float, message: str = "") -> Check:
    return Check(f"{s.name}: {name}", float(value), limit, bool(value <= limit), message)


def _energy(s: Series) -> list[Check]:
    """The balance once more, and the work done on each contact, from the harmonics of forces and motions."""
    names = sorted(n.removesuffix("/displacement") for n in s.arrays if n.startswith("contacts/") and "/displ" in n)
    if not names or "supplied" not in s.arrays:
        return []
    taken = np.sum([work(s.arrays[f"{n}/force"], s.arrays[f"{n}/displacement"]) for n in names], axis=0)
    told = np.sum([s.arrays[f"{n}/dissipated"] for n in names], axis=0)
    still = np.sum([resting(s.arrays[f"{n}/force"], s.arrays[f"{n}/displacement"]) for n in names], axis=0)
    both = shares(s.arrays["supplied"], s.arrays["damped"], taken, told, s.arrays["exchanged"], still)
    missing, apart = (float(np.abs(off[s.converged]).max(initial=0.0)) for off in both)
    return [
        _held(s, "balance, from the harmonics", missing, BALANCE),
        _held(s, "work on the contacts, from the harmonics", apart, BALANCE),
    ]


def _read_again(response: Response, s: Series, bases: Mapping[str, ModalBasis]) -> list[Check]:
    """Read-outs from the bodies' coordinates, where all of a read-out stands in these."""
    found = []
    for name in (n for n in s.arrays if n.startswith(READ)):
        kind, rows = name.split("/", 1)
        component, monitor = rows.split(":", 1) if ":" in rows else (next(iter(response.bodies), ""), rows)
        basis = bases.get(component)
        if basis is None or has_residual(next(iter(basis.groups.values())), basis.reduction):
            continue
        labels = next(iter(basis.groups.values()))
        of = "gauges" if kind == "gauges" else "monitors"
        held: Any = getattr(labels, of).get(monitor)
        if held is None:
            continue
        read = read_out(response.motion(s, basis, component), monitor, of)[s.converged]
        mine = [list(held.labels).index(label) for label in response.labels.get(name, held.labels)]
        kept = np.moveaxis(s.arrays[name][s.converged], -1, 1)
        off = np.abs(read[:, : kept.shape[1], mine] - kept).max(initial=0.0)
        q = np.linalg.norm(s.arrays[f"bodies/{component}/q"], axis=2).max(initial=0.0)
        most = np.linalg.norm(held.rows) * q  # of which a read-out of nothing but rounding is a small share
        off /= max(float(np.abs(kept).max(initial=0.0)), ROUNDING / MOTION * float(most), 1e-300)
        found.append(_held(s, f"{kind} {rows} against the modal file", off, MOTION))
    return found


def _table(response: Response, s: Series) -> list[Check]:
    """Amplitudes in the table of resonances against the points at their frequencies."""
    first = next((n for n in response.labels if n.startswith(READ)), None)
    rows = [r for r in response.resonances if r.get("normal_force_N") == s.parameters.get("normal_force")]
    if first is None or first not in s.arrays or not rows:
        return []
    amplitude = np.abs(s.arrays[first][:, 0, 1])
    off = 0.0
    for row in rows:
        told = next(float(v) for k, v in row.items() if k.startswith("amplitude"))
        near = int(np.abs(s.frequency - row["frequency_Hz"]).argmin())
        same = np.isclose(s.frequency[near], row["frequency_Hz"], rtol=1e-9, atol=0) and s.converged[near]
        off = max(off, abs(amplitude[near] / told - 1) if same and told else np.inf)
    return [_held(s, "table of resonances against the points", off, 1e-6)]
