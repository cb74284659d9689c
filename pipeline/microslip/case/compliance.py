"""Stiffnesses of a case's contacts without the compliance that the bodies hold already."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..data import INTERFACE_ROWS, Array, ModalGroup
from ..errors import UserError
from ..reduced.compliance import BULK_AND_SURFACE, SURFACE, Share, contact_share, facing, without_bulk
from .settings import ContactSettings

Springs = tuple[float, float, float]
"""Stiffness of a patch along n, t1 and t2, N/m."""


@dataclass(frozen=True)
class Face:
    """One of the faces of a contact: its interface on a group, and the contacts of that body that are closed too.

    sectors: N where the partner of the face is that of the next sector of a cyclic body.
    """

    group: ModalGroup
    reduction: str
    interface: str
    among: tuple[str, ...] = ()
    sectors: int = 1
    partner: str = ""

    def share(self, row: str) -> Share:
        """See `compliance.contact_share`."""
        other = self.partner or facing(self.group, self.interface, self.among)
        return contact_share(self.group, self.reduction, row, self.interface, other, self.sectors)


def counted_once(c: ContactSettings, given: Springs, faces: Sequence[Face]) -> tuple[Springs, str]:
    """The springs of a contact without the bulk that the bodies hold on both of its sides, and a message or nothing.

    Args:
        given: as the contact has them.

    Raises:
        UserError: a stiffness that is said to count the bulk, but is stiffer than the bulk alone.
    """
    shares = [_sum([f.share(row) for f in faces]) for row in ("u_n", "u_t1", "u_t2")]
    kept = _taken_out(given, shares) if c.includes == BULK_AND_SURFACE else given
    reduction = ", ".join(dict.fromkeys(f.reduction for f in faces))
    return kept, _what_is_counted(c, given, kept, shares, reduction)


def _sum(shares: list[Share]) -> Share:
    """Two faces in series."""
    first = shares[0]
    if len(shares) == 1:
        return first
    sums = {key: sum(getattr(s, key) / s.contacts for s in shares) for key in ("static", "held", "plain", "supplied")}
    label = " + ".join(s.label for s in shares)
    return replace(first, label=label, contacts=1, noise=sum(s.noise for s in shares), **sums)


def _taken_out(given: Springs, shares: list[Share]) -> Springs:
    kept = [without_bulk(k, s) for k, s in zip(given, shares, strict=True)]
    for k, new, s, key in zip(given, kept, shares, ("normal", "tangential", "tangential"), strict=True):
        if not 0 < new < np.inf:
            raise UserError(
                f"{k:g} N/m is said to count the bulk of the body, but "
                f"the bulk alone, which the basis holds, is as soft as {s.contacts / s.beyond:.3g} N/m ({s.label}); "
                f'write includes = "{SURFACE}" if it is the stiffness of the surface, or lower it',
                f"{key}_stiffness",
            )
    return (kept[0], kept[1], kept[2])


def _what_is_counted(
    c: ContactSettings, given: Springs, kept: Springs, shares: list[Share], reduction: str
) -> str:  # fmt: skip
    """A sentence where the bulk stands in the basis too, or is added to a law of the surface; else nothing."""
    s = shares[0]
    held = f"the basis ({reduction}) already holds {s.beyond:.4g} m/N of the body's own elasticity there ({s.label})"
    if c.includes == SURFACE and s.left:
        return (
            f"Compliance counted once: the contact stiffness is that of the surface, so {s.left:.4g} m/N of bulk that "
            f"the {reduction} leave out ({s.label}) is added to it from the file."
        )
    most = max(k * s.beyond / s.contacts for k, s in zip(given, shares, strict=True))
    if most < 0.01:  # no reader would see it
        return ""
    if c.includes == BULK_AND_SURFACE:
        new, old = (", ".join(f"{k:.4g}" for k in springs) for springs in (kept, given))
        return f"Compliance counted once: {held}, so the springs along n, t1, t2 become {new} N/m instead of {old} N/m."
    if c.includes is None:
        return (
            f"Compliance may be counted twice: {held}, a spring of {s.contacts / s.beyond:.3g} N/m at each contact. If "
            f"normal_stiffness = {given[0]:.3g} N/m counts it too, as E A / l0 of the book does, write "
            f'includes = "{BULK_AND_SURFACE}"; if it is that of the surface alone, write includes = "{SURFACE}".'
        )
    return ""


FELT = 0.1
"""Part of what a contact yields itself from which on a reader is told what the body does not yield."""


def static_answer(c: ContactSettings, normal: float, faces: Sequence[Face]) -> str:
    """A sentence where nothing holds what the bodies yield at once under an impact; else nothing.

    Neither their modes, nor the residual compliance beside them, nor the contact's stiffness: the impact meets the
    masses of the modes alone.

    Args:
        normal: stiffness of the contact, N/m; inf of a rigid one.
    """
    s = _sum([f.share("u_n") for f in faces])
    if c.is_curved or c.includes is not None or not s.left or normal * s.left / s.contacts < FELT:
        return ""
    reduction = ", ".join(dict.fromkeys(f.reduction for f in faces))
    other = "" if c.what.rigid else f', or includes = "{SURFACE}" where the stiffness counts no bulk'
    return (
        f"Contact {c.interface}: the modes ({reduction}) contain no static answer for an impact, {s.left:.3g} of "
        f"{s.static:.3g} m/N are missing ({s.label}), so that it meets their masses alone; take a basis with static "
        f'modes (reduction = "craig-bampton" or "rubin"){other}.'
    )


def residual_share(
    group: ModalGroup, reduction: str, has_residual: bool, faces: Mapping[str, str | None]
) -> Array | None:
    """Share of each compliance label's residual that is added: beside the modes, or for laws of the surface.

    Args:
        beside: whether statics stand beside the modes (`compliance.has_residual`). faces: interface of a contact ->
            which compliance its law includes.
    """
    names = list(group.compliance.labels)
    bring = np.ones(len(names))
    if not has_residual:
        wanting = [i for i, includes in faces.items() if includes == SURFACE and _leaves(group, i, reduction)]
        if not wanting:
            return None
        counted = tuple(f"interface:{i}:" for i in faces if i not in wanting)
        bring[[name.startswith(counted) for name in names]] = 0.0
    return bring


def _leaves(group: ModalGroup, interface: str, reduction: str) -> bool:
    """Whether a basis leaves static compliance at a contact, beyond rounding."""
    return any(contact_share(group, reduction, row, interface).left for row in INTERFACE_ROWS)
