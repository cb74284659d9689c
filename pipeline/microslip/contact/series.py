"""Contact stiffnesses from different sources in one noun that says which compliance it counts; springs in series.

See `microslip.reduced.compliance`: `SURFACE` is the roughness alone, `BULK_AND_SURFACE` the elasticity of the bodies
about the contact as well, `BULK` that elasticity without any roughness (a layer, a half-space, finite elements).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..data import ModalGroup
from ..errors import UserError
from ..reduced.compliance import BULK_AND_SURFACE, SURFACE, Share, contact_share, without_bulk
from .hertz import Hertz
from .layer import Layer
from .profiles import RoundContact

BULK = "bulk"
INCLUDES = (SURFACE, BULK, BULK_AND_SURFACE)


@dataclass(frozen=True)
class ContactStiffness:
    """Stiffness of a contact with all of its area touching and sticking.

    Attributes:
        normal: c_N0, N/m. tangential: (2,) c_R0 along t1 and t2, N/m. includes: one of `INCLUDES`. source: where the
            numbers come from, for reports.

    Raises:
        UserError: a stiffness that is not positive (``inf`` counts as rigid), an unknown word.
    """

    normal: float
    tangential: tuple[float, float]
    includes: str
    source: str = "given"

    def __post_init__(self) -> None:
        if self.includes not in INCLUDES:
            raise UserError(f"includes: '{self.includes}' is unknown; choose one of {', '.join(INCLUDES)}")
        for name, value in (("normal", self.normal), *(("tangential", t) for t in self.tangential)):
            if not value > 0:
                raise UserError(f"{name}: {value:g} N/m ({self.source}) is no stiffness; it must be greater than 0")

    @property
    def all(self) -> tuple[float, float, float]:
        """Along n, t1, t2."""
        return (self.normal, *self.tangential)


def of_layer(layer: Layer, area: float) -> ContactStiffness:
    """The elastic layer (Sextro 3.1): the bulk of one body down to its depth."""
    t = float(layer.tangential_stiffness(area))
    return ContactStiffness(float(layer.normal_stiffness(area)), (t, t), BULK, f"layer, {layer.boundary}")


def of_point_contact(contact: Hertz | RoundContact, normal_force: float) -> ContactStiffness:
    """Tangent of Hertz' or any round contact at a normal force (N): the bulk of BOTH bodies, in series already.

    Raises:
        UserError: no normal force: an unloaded point contact has no stiffness.
    """
    if not normal_force > 0:
        raise UserError(f"normal_force: {normal_force:g} N; an unloaded point contact has no stiffness, press it")
    x, y = contact.tangential_stiffness(normal_force)
    source = f"{'Hertz' if isinstance(contact, Hertz) else 'round profile'} at {normal_force:g} N"
    return ContactStiffness(float(contact.normal_stiffness(normal_force)), (float(x), float(y)), BULK, source)


def in_series(first: ContactStiffness, second: ContactStiffness) -> ContactStiffness:
    """Two springs end to end, Sextro Eqs. (3.3-8), (3.3-9): both bodies, or the bulk and the surface.

    Bulk and bulk are the two bodies; bulk and surface make bulk+surface.

    Raises:
        UserError: both count a surface. The roughness of two faces is one surface (3.3-12), not two springs.
    """
    if first.includes != BULK and second.includes != BULK:
        raise UserError(
            f"includes: '{first.source}' counts {first.includes} and '{second.source}' {second.includes}: the surface "
            "would be counted twice; combine the two roughnesses first, sqrt(R_Z1^2 + R_Z2^2)"
        )
    n, t1, t2 = (_series(a, b) for a, b in zip(first.all, second.all, strict=True))
    includes = BULK if first.includes == second.includes == BULK else BULK_AND_SURFACE
    return ContactStiffness(n, (t1, t2), includes, f"{first.source} + {second.source}")


def of_patch(group: ModalGroup, reduction: str, contact: str, facing: str = "", sectors: int = 1) -> ContactStiffness:
    """The static finite-element model: what a patch of a body yields under uniform traction, beyond its eigenmodes.

    The modal file has the static compliance of every patch on the full mesh and the part that its eigenmodes hold.
    The difference is the elasticity about the contact, the book's c_N0 of plain eigenmodes, per contact.

    Args:
        group: of a modal file. reduction: name of its method. contact: interface. facing: the other contact of the
            same body that is closed at the same time, or nothing. sectors: N of a ring.

    Raises:
        UserError: no such interface, or eigenmodes that hold all of the compliance.
    """
    if contact not in group.interfaces:
        raise UserError(f"contact: no interface '{contact}'; the file has {', '.join(group.interfaces) or 'none'}")
    left = []
    for row in ("u_n", "u_t1", "u_t2"):
        share = contact_share(group, reduction, row, contact, facing, sectors)
        plain = replace(share, held=share.plain, supplied=0.0)
        if not plain.left:
            raise UserError(
                f"contact: the eigenmodes hold all of the compliance of {contact} {row}, so its stiffness cannot be "
                "told; take the spring of the surface alone"
            )
        left.append(plain.law_stiffness)
    return ContactStiffness(left[0], (left[1], left[2]), BULK, f"finite elements, {contact}")


def for_basis(
    given: ContactStiffness, group: ModalGroup, reduction: str, contact: str, facing: str = "", sectors: int = 1
) -> ContactStiffness:  # fmt: skip
    """The same contact as a spring beside a basis, so that the compliance of the bodies is counted once.

    Of a surface the bulk that the basis does not hold is added in series; of bulk and surface the part is taken out
    that the basis holds beyond plain eigenmodes.

    Of two elastic bodies call it for the one and, with what it returns, for the other.

    Args:
        given: of the whole contact. Others: see `of_patch`.

    Raises:
        UserError: the stiffness is said to count the bulk, but is stiffer than the bulk alone.
    """
    rows = ("u_n", "u_t1", "u_t2")
    shares = [contact_share(group, reduction, row, contact, facing, sectors) for row in rows]
    n, t1, t2 = (_beside(k, s, given) for k, s in zip(given.all, shares, strict=True))
    return replace(given, normal=n, tangential=(t1, t2), source=f"{given.source}, beside {reduction}")


def _beside(stiffness: float, share: Share, given: ContactStiffness) -> float:
    if given.includes == SURFACE:
        return _series(stiffness, share.law_stiffness)
    kept = without_bulk(stiffness, share)
    if not kept > 0 or (kept == np.inf and given.includes == BULK_AND_SURFACE):
        raise UserError(
            f"includes: {stiffness:g} N/m ({given.source}) is said to count the bulk, but the bulk alone, which the "
            f"basis holds, is as soft as {share.contacts / share.beyond:.3g} N/m ({share.label}); say '{SURFACE}' if "
            "it is the stiffness of the surface, or lower it"
        )
    return kept


def _series(a: float, b: float) -> float:
    compliance = 1 / a + 1 / b
    return float(1 / compliance) if compliance else np.inf
