"""What the settings of a contact describe: stiffness, heights, normal law, friction and element."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from ..errors import UserError, at
from . import others
from .friction import Friction, OfCoulomb
from .heights import Heights
from .hertz import Hertz
from .law import Array, Law, value
from .layer import Layer
from .normal import Normal, Preload, Rough
from .series import ContactStiffness
from .settings import ContactFile, ContactLaw


@dataclass(frozen=True)
class ContactModel:
    """What the settings of a contact describe.

    Attributes:
        settings: in SI. path: of their file. normal_0: c_N0, N/m. stiffness: of the full area; None without a
            tangential one. area: nominal, m2, or None. heights, roughness: distribution and R_Z in m, or None. normal:
            normal law; of a rigid contact one that never presses. friction: characteristic, or None. pressed: by which
            force, N, where that is given. layer, hertz: where the stiffness comes from one. law: None without friction,
            or without the tangential stiffness that it needs.
    """

    settings: ContactLaw
    path: Path
    normal_0: float
    stiffness: ContactStiffness | None
    area: float | None
    heights: Heights | None
    roughness: float | None
    normal: Normal
    friction: Friction | None
    pressed: float = 0.0
    layer: Layer | None = None
    hertz: Hertz | None = None
    law: Law | None = None

    @property
    def file(self) -> ContactFile:
        """The settings of a contact that has a file of its own."""
        assert isinstance(self.settings, ContactFile)
        return self.settings

    @property
    def sliding(self) -> Friction:
        """The characteristic of a contact that has one."""
        assert self.friction is not None
        return self.friction

    @property
    def mu(self) -> float:
        """Coulomb's coefficient, of an element that needs one."""
        assert isinstance(self.settings.friction, OfCoulomb)
        return self.settings.coefficient

    @property
    def springs(self) -> tuple[Array, Array | None]:
        """Tangential stiffness along t1, and along t2 where it is another one, N/m."""
        assert self.stiffness is not None
        first, second = self.stiffness.tangential
        return value(first), None if first == second else value(second)

    @property
    def ratio(self) -> Array | None:
        """Tangential stiffness along t2 over that along t1, where it is another one."""
        assert self.stiffness is not None
        first, second = self.stiffness.tangential
        return None if first == second else value(second / first)

    @cached_property
    def deepest(self) -> float:
        """Approach up to which strips of a curved contact are laid, m: a quarter beyond the motion's."""
        assert self.hertz is not None
        motion = getattr(self.settings, "motion", None)
        if motion is None:
            return 1e-5
        pressed = motion.normal_force
        mean = motion.normal[0] if pressed is None else float(self.hertz.approach(pressed))
        deepest = 1.25 * (mean + sum(map(abs, motion.normal[1:])))
        if not deepest > 0:
            raise UserError("the motion never closes the contact; press it by motion.normal_force")
        return deepest


def compose(settings: ContactLaw, path: Path, pressed: float = 0.0) -> ContactModel:
    """The laws of a contact.

    Args:
        settings: in SI. path: of their file, beside which others are sought. pressed: by which force, N, for laws whose
            numbers are that force's.

    Raises:
        UserError: a file that is missing or cannot be read, numbers that make no law; each with its key.
    """
    if settings.what.rigid:
        return _rigid(settings, path)
    with at("stiffness"):
        source = settings.springs.source(path)
    heights = roughness = None
    law = source.law
    if settings.roughness is not None:
        with at("roughness"):
            heights, roughness = settings.roughness.heights(path, settings.unit)
        law = Rough(value(source.normal), value(roughness), heights)
    friction = _friction(settings, path, source.area)
    found = ContactModel(
        settings, path, source.normal, source.stiffness, source.area, heights, roughness, law, friction, pressed,
        source.layer, source.hertz,
    )  # fmt: skip
    found = replace(found, normal=settings.what.normal(found) or law)
    return replace(found, law=_law(found))


def _rigid(settings: ContactLaw, path: Path) -> ContactModel:
    friction = _friction(settings, path, None)
    found = ContactModel(settings, path, 0.0, None, None, None, None, Preload(value(0.0)), friction)
    return replace(found, law=_law(found))


def _friction(settings: ContactLaw, path: Path, area: float | None) -> Friction | None:
    if settings.friction is None:
        return None
    with at("friction"):
        return settings.friction.friction(path, settings.temperature, area)


def _law(c: ContactModel) -> Law | None:
    if c.friction is None or (c.stiffness is None and not c.settings.what.rigid):
        return None
    with at("law"):
        law: Law = others.running(lambda: c.settings.what.law(c), c.settings.what)
        others.tried(law, c.settings.what, c.friction)
    return law
