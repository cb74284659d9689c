"""Sentences about what a modal file holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..data import Array, ContactState, Interface, ModalGroup, SpeedRange
from ..reduced.coordinates import certified_modes
from ..reduced.truncation import percent
from ..settings.body import GROUND
from ..units import to_rpm

ROUNDING = 1e-9
"""Share of the largest number of a unit in a table or sentence below which another one is rounding."""

RIGID_ENOUGH = 0.05
"""A patch whose fit residual is below this moves as a rigid patch for most purposes."""


def hertz(frequency: Array, j: int, digits: int = 6) -> str:
    """A frequency of mode j (0-based), nothing if there is no such mode."""
    return f"{frequency[j]:#.{digits}g}" if j < len(frequency) else ""


def number_list(numbers: Sequence[int]) -> str:
    """``1 to 4, 7 and 9``."""
    runs: list[list[int]] = []
    for n in sorted(numbers):
        if runs and n == runs[-1][-1] + 1:
            runs[-1].append(n)
        else:
            runs.append([n])
    words = [w for r in runs for w in ([f"{r[0]} to {r[-1]}"] if len(r) > 2 else map(str, r))]
    return ", ".join(words[:-1]) + f" and {words[-1]}" if len(words) > 1 else "".join(words)


def certificate(group: ModalGroup) -> str:
    """What the inertia count proves, in one sentence."""
    if not group.checks.get("certified"):
        return "Nothing proves that no mode is missing: the spectrum was not certified (modes.certify)."
    own = certified_modes(group)
    if own == 0 and "upper_shift_hz" in group.checks:
        count, limit = int(group.checks["count_below_upper_shift"]), group.checks["upper_shift_hz"]
        return (
            f"The inertia count proves that the body has {count} modes below {limit:.6g} Hz; these "
            "frequencies are "
            "those of the reduced body, at or above them."
        )
    if own < len(group.omega) and "upper_shift_hz" in group.checks:
        count, limit = int(group.checks["count_below_upper_shift"]), group.checks["upper_shift_hz"]
        more = f", of which {own} are kept" if count > own else ""
        return (
            f"The inertia count proves that the body has {count} modes below {limit:.6g} Hz{more}; "
            "the "
            f"{len(group.omega) - own} shapes behind them are static answers and no modes of the "
            "body."
        )
    if "upper_shift_hz" not in group.checks:
        return f"These are all {group.n_modes} modes of the system."
    count = int(group.checks.get("count_below_upper_shift", group.n_modes))
    kept = f"; the first {group.n_modes} are kept" if count > group.n_modes else ""
    limit = group.checks["upper_shift_hz"]
    return f"The inertia count proves that these are all {count} modes below {limit:.6g} Hz{kept}."


def counted_modes(group: ModalGroup) -> str:
    """How many modes a group has, and what else its frequencies belong to: static shapes, the
    reduced body."""
    count, own = len(group.omega), certified_modes(group)
    if own == count:
        return f"{count} modes"
    return (
        f"{own} modes and {count - own} static shapes"
        if own
        else f"{count} modes of the reduced body"
    )


def proof(group: ModalGroup) -> str:
    """How many modes a group has and how far they are certified, for the terminal."""
    modes = counted_modes(group)
    if not group.checks.get("certified"):
        return f"{modes}, NOT certified"
    if certified_modes(group) == len(group.omega):
        return f"{modes}, certified complete"
    if certified_modes(group):
        return f"{modes}, the modes certified complete"
    if "upper_shift_hz" not in group.checks:
        return modes
    below, limit = group.checks["count_below_upper_shift"], group.checks["upper_shift_hz"]
    return f"{modes}; of the body itself {below:.0f} are certified below {limit:.6g} Hz"


def range_sentence(harmonic: int, r: SpeedRange) -> str:
    """How a speed range was made and how good it is."""
    low, high = to_rpm(r.speeds[[0, -1]])
    held = " and ".join(f"{v:.0f}" for v in to_rpm(r.held_out))
    which = f"Nodal diameter {harmonic}: between" if harmonic else "Between"
    return (
        f"{which} {low:.6g} and {high:.6g} rpm one basis of {r.samples[0].n_modes} coordinates serves at every speed: "
        f"modes from {int(r.solved.sum())} speeds, stiffness from {int((~r.held).sum())}; at {held} rpm, "
        f"which were held out, its frequencies err by {r.total_error.max():.1e} at most."
    )


def contact_sentence(name: str, c: ContactState) -> str:
    """What a closure does in the static state, in words."""
    other = "the ground" if c.against == GROUND else c.against + (" of the neighbour" if c.sector_shift else "")
    if not c.normal_force:
        return f"contact {name}: {c.face} is open against {other}, the gap {1e6 * c.gap.min():.4g} µm or wider."
    kept = "the modes leave it open" if c.modes == "open" else "the modes keep it closed"
    return (
        f"contact {name}: {c.face} presses {other} with {c.normal_force:.5g} N on {percent(c.closed_share)} of its "
        f"area, at most {1e-6 * c.pressure.max():.4g} MPa{_left(c)}; {kept}."
    )


def _left(c: ContactState) -> str:
    """What a contact penetrates still, where it is more than rounding beside its widest gap."""
    deep = c.penetration > ROUNDING * np.abs(c.gap).max(initial=0.0)
    return f" (penetration left {1e6 * c.penetration:.2g} µm)" if deep else ""


def fit_summary(contacts: Mapping[str, Interface]) -> str:
    """How well six components describe the motion of all patches, in one sentence."""
    worst = {name: float(i.fit_residual.max()) for name, i in contacts.items()}
    loose = [name for name, value in worst.items() if value > RIGID_ENOUGH]
    if not loose:
        return f"All {len(worst)} patches move as rigid ones (to {100 * RIGID_ENOUGH:g} %) in all modes."
    name = max(loose, key=lambda n: worst[n])
    mode = int(contacts[name].fit_residual.argmax()) + 1
    return (
        f"Of {len(worst)} patches {len(loose)} deform in some modes, most of all {name} in mode {mode}: "
        f"{percent(worst[name])} of its motion is not rigid."
    )


def fit_sentence(name: str, interface: Interface, group: ModalGroup) -> str:
    """How well six components describe the motion of a patch, in words."""
    residual = interface.fit_residual[: group.n_modes]
    worst, loose = int(residual.argmax()) + 1, [j + 1 for j, r in enumerate(residual) if r > RIGID_ENOUGH]
    most = percent(float(residual.max()))
    if not loose:
        return f"{name} moves as a rigid patch in all modes (at most {most} of its motion is deformation)."
    firm = [j + 1 for j in range(group.n_modes) if j + 1 not in loose]
    limit = f"{100 * RIGID_ENOUGH:g} %"
    begins = f"{name} moves as a rigid patch (to {limit}) in modes {number_list(firm)}; it" if firm else name
    return (
        f"{begins} deforms in modes {number_list(loose)} (most in mode {worst}: {most} of its motion is not rigid), "
        "which six components do not see."
    )
