"""Laws from contact stiffnesses: a layer, Hertz, a round profile, a curve or finite elements as a point.

Each law keeps the word for whose compliance it counts.
"""

from __future__ import annotations

from ..errors import UserError
from ..reduced.compliance import BULK_AND_SURFACE, SURFACE
from .curves import NormalCurve, of_contact
from .friction import Friction
from .heights import Heights
from .hertz import Hertz
from .law import value
from .normal import Normal, Penalty, Potential, Rough, measured
from .point import PointContact
from .profiles import RoundContact
from .series import ContactStiffness


def smooth_point(stiffness: ContactStiffness, friction: Friction) -> PointContact:
    """A spring that cannot pull, and its tangential springs (Sextro Eqs. (3.1-25), (3.3-33))."""
    return _point(Penalty(value(stiffness.normal)), friction, stiffness.tangential, stiffness.includes)


def rough_point(
    stiffness: ContactStiffness, roughness: float, heights: Heights, friction: Friction
) -> PointContact:  # fmt: skip
    """The rough layer (Sextro Eqs. (3.3-21), (3.3-40)): bulk that carries as far as its area touches.

    Args:
        stiffness: of the full area; its bulk, to which the heights add the surface. roughness: R_Z, m.

    Raises:
        UserError: a roughness that is not positive.
    """
    if not roughness > 0:
        raise UserError(f"roughness: {roughness:g} m; it must be greater than 0, or take a smooth point")
    includes = SURFACE if stiffness.includes == SURFACE else BULK_AND_SURFACE
    law = Rough(value(stiffness.normal), value(roughness), heights)
    return _point(law, friction, stiffness.tangential, includes)


def hertz_point(contact: Hertz, friction: Friction, normal_force: float = 1.0) -> PointContact:
    """Hertz' contact as one point, exact along the normal: F_N ~ u^(3/2), tangential stiffness ~ u^(1/2) (Mindlin).

    It sticks or slides as a whole. First loading under a constant normal force slips in parts before, see
    `partial_slip.PartialSlip`: the whole then sticks up to 2/3 of the displacement of full slip.

    Args:
        normal_force: N, at which the nominal stiffness is taken; the law does not depend on it.
    """
    depth = float(contact.approach(normal_force))
    law = Potential(value(normal_force), value(depth), value(1.5))
    x, y = contact.tangential_stiffness(normal_force)
    return _point(law, friction, (float(x), float(y)), "bulk")


def round_point(contact: RoundContact, friction: Friction, largest: float, count: int = 81) -> PointContact:
    """Any round contact as one point, up to a normal force (N); a line beyond. See `hertz_point`."""
    return curve_point(of_contact(contact, largest, count), contact.tangential_ratio, friction)


def curve_point(curve: NormalCurve, ratio: tuple[float, float], friction: Friction) -> PointContact:
    """A measured or computed curve as one point, its tangential stiffness in proportion to the normal one (3.3-40).

    Args:
        ratio: (x, y) tangential over normal stiffness: G/E~ of a layer, 2 (1 - nu)/(2 - nu) of half-spaces.

    Raises:
        UserError: a ratio that is not positive.
    """
    if not min(ratio) > 0:
        raise UserError(f"ratio: {ratio[0]:g}, {ratio[1]:g}; tangential over normal stiffness must be greater than 0")
    law = measured(curve)
    nominal = float(law.nominal)
    return _point(law, friction, (ratio[0] * nominal, ratio[1] * nominal), curve.includes)


def _point(
    normal: Normal, friction: Friction, tangential: tuple[float, float], includes: str
) -> PointContact:  # fmt: skip
    first, second = tangential
    return PointContact(normal, friction, value(first), None if second == first else value(second), includes=includes)
