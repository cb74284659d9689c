"""Compliance counted once: what a basis holds, what it leaves to a contact law, what the law must not contain.

A contact lies in series with the bodies it joins. The elasticity of a body stands in its basis or in the contact
law, never in both: the book's contact stiffness (Sextro Eq. (3.1-15), c_N0 = E A_0 / l_0) is that of a whole layer of
depth l_0 and belongs to a basis of plain eigenmodes; with all modes only the roughness is left and l_0 becomes R_Z
(after Eq. (3.4-5)). Nothing here asks which method made a basis: the static compliance its coordinates hold stands
in the file beside that of the full model and that of the eigenmodes alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Array, ModalBasis, ModalGroup
from .truncation import closing, describe, ring_pairs

SUPPLIED = ("macneal",)
"""Methods whose residual flexibility (static minus held, in the file) the solver adds to the contact coordinates."""

ROUNDING = 2e-7
"""Share of a static compliance that is taken for rounding: the stiffness of a slender body has a condition of 1e13,
and its static and modal compliance agree to 4e-8 (measured on the blade of section 5.3, Rubin's method)."""

SURFACE, BULK_AND_SURFACE = "surface", "bulk+surface"


@dataclass(frozen=True)
class Share:
    """Who holds the static compliance of one coordinate, or of a squeeze between two contacts.

    Attributes:
        label: ``right u_n`` or ``right + left squeezed``. kind: ``translation``, ``rotation`` or ``squeeze``. unit: of
            the compliances, e.g. ``m/N``.
        static: of the full model. held: by the coordinates of the basis. plain: by its eigenmodes alone.
        supplied: by the residual flexibility in the file, which the solver adds.
        contacts: how many contacts share what is left: 2 for a body squeezed between two neighbours, else 1.
        noise: compliance below which a difference is rounding.
    """

    label: str
    kind: str
    unit: str
    static: float
    held: float
    plain: float
    supplied: float
    contacts: int
    noise: float

    @property
    def left(self) -> float:
        """Bulk that neither the basis nor the solver holds; the law must bring it, spread over the contacts."""
        return self._difference(self.static, self.held + self.supplied)

    @property
    def beyond(self) -> float:
        """Bulk that plain eigenmodes would leave and this basis (or the solver) holds: must not be in the law too."""
        return self._difference(self.held + self.supplied, self.plain)

    @property
    def law_stiffness(self) -> float:
        """Stiffness a law must bring at each contact in series with its surface, N/m or N m/rad; inf: surface only."""
        return self.contacts / self.left if self.left else np.inf

    def _difference(self, a: float, b: float) -> float:
        return a - b if a - b > self.noise else 0.0


def shares(group: ModalGroup, reduction: str, sectors: int = 1) -> tuple[Share, ...]:
    """Every interface row, and every pair of contacts of the body pressed from both sides.

    Args:
        group: real or complex (nodal diameters of a ring). reduction: name of its method. sectors: N of a ring: then
            the pair is the gap between neighbours, see `truncation.closing`.
    """
    labels = group.compliance.labels
    found = []
    for i, label in enumerate(labels):
        if label.startswith("interface:"):
            found.append(_share(group, reduction, *describe(group, label), np.eye(len(labels))[i], 1))
    return (*found, *(_pair(group, reduction, a, b, sectors) for a, b in ring_pairs(group)))


def _pair(group: ModalGroup, reduction: str, a: str, b: str, sectors: int) -> Share:
    pick, words = closing(group, a, b, sectors), "squeezed" if sectors == 1 else "across the gap"
    return _share(group, reduction, f"{a} + {b} {words}", "squeeze", "m/N", pick, 2 if sectors == 1 else 1)


def _share(group: ModalGroup, reduction: str, label: str, kind: str, unit: str, pick: Array, contacts: int) -> Share:
    c = group.compliance

    def along(C: Array) -> float:
        return float((pick @ C @ pick.conj()).real)

    static, held = along(c.static), along(c.modal)
    supplied = static - held if reduction in SUPPLIED else 0.0
    cancelled = float(np.abs(pick) ** 2 @ np.diag(c.static).real)  # a squeeze is the small difference of large ones
    noise = ROUNDING * static + 1e-14 * cancelled
    return Share(label, kind, unit, static, held, along(c.plain), supplied, contacts, noise)


def contact_share(group: ModalGroup, reduction: str, row: str, a: str, b: str = "", sectors: int = 1) -> Share:
    """The share that decides a law at contact `a`: pressed from both sides if `b` faces it, else alone.

    Args:
        row: ``u_n``, ``u_t1`` or ``u_t2``; tangents are taken alone, neighbours do not squeeze along them.
        a: interface. b: the other contact of the same body that is closed at the same time, or nothing.
        sectors: of a ring, where `b` is the neighbour's; 1 for a body between rigid neighbours.
    """
    labels = group.compliance.labels
    if row == "u_n" and b:
        a, b = (a, b) if (a, b) in ring_pairs(group) else (b, a)
        return _pair(group, reduction, a, b, sectors)
    label = f"interface:{a}:{row}"
    pick = np.array([float(name == label) for name in labels])
    return _share(group, reduction, *describe(group, label), pick, 1)


def has_residual(group: ModalGroup, reduction: str) -> bool:
    """Whether static compliance stands beside the modes, so that a solver in modal coordinates must add it.

    True of MacNeal's method and of coordinates that no mode carries (massless ones, interface forces).
    """
    return reduction in SUPPLIED or len(group.omega) < group.n_modes


def without_bulk(stiffness: float, share: Share) -> float:
    """What remains (N/m) of a law's stiffness that counts bulk and surface, once what the basis holds is taken out.

    Springs in series: 1/k' = 1/k - beyond/contacts. Not positive, inf included: the law is stiffer than the bulk alone.
    """
    compliance = 1 / stiffness - share.beyond / share.contacts
    return 1 / compliance if compliance else np.inf


def facing(group: ModalGroup, name: str, among: tuple[str, ...]) -> str:
    """The contact of the same body on its other side, if it is one of `among`; else nothing."""
    for a, b in ring_pairs(group):
        if name in (a, b) and a in among and b in among:
            return b if name == a else a
    return ""


def sentence(basis: ModalBasis, group: ModalGroup) -> str:
    """What a contact law must bring for this basis, in one plain sentence."""
    found = [s for s in shares(group, basis.reduction, basis.sectors) if s.kind in ("translation", "squeeze")]
    if not found:
        return "The body has no contact, so there is no compliance to share with a law."
    found = [s for s in found if s.static > 0]
    if not found:
        return "The contacts cannot move, so there is no compliance to share with a law."
    place = "at each contact" if basis.sectors == 1 else "in each gap"
    left = [s for s in found if s.left]
    if left:
        worst = min(left, key=lambda s: (s.kind != "squeeze", s.held / s.static))
        place = place if worst.kind == "squeeze" else "there"
        return (
            f"The basis leaves {worst.left:.4g} m/N of the body's elasticity to the contact law ({worst.label}): "
            f"besides the surface a law must bring a spring of {worst.law_stiffness:.3g} N/m {place}."
        )
    bulk = max(found, key=lambda s: (s.kind == "squeeze", s.beyond / s.static))
    place = place if bulk.kind == "squeeze" else "there"
    who = "The residual flexibility in the file supplies" if basis.reduction in SUPPLIED else "The basis holds"
    if not bulk.beyond:
        return f"{who} all static compliance at the contacts: a law must bring the surface only."
    return (
        f"{who} all static compliance at the contacts: a law must bring the surface only, and {bulk.beyond:.4g} m/N "
        f"({bulk.label}, a spring of {bulk.contacts / bulk.beyond:.3g} N/m {place}) must not be in it again."
    )
