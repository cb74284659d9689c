"""What the settings of a contact describe: stiffness, heights, normal law, friction and element."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp

from ..errors import UserError, at
from .friction import Friction, OfCoulomb
from .heights import Heights
from .hertz import Hertz
from .law import Array, Law, Step, value
from .layer import Layer
from .normal import Normal, Preload, Rough
from .series import ContactStiffness
from .settings import ContactFile, ContactLaw
from .stiffness import Source


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
    def surface(self) -> tuple[Heights, float]:
        """Heights and R_Z (m) of a rough contact."""
        assert self.heights is not None and self.roughness is not None
        return self.heights, self.roughness

    @property
    def tangential(self) -> tuple[float, float]:
        """Tangential stiffness along t1 and t2, N/m, of a contact that has one."""
        assert self.stiffness is not None
        return self.stiffness.tangential

    @property
    def springs(self) -> tuple[Array, Array | None]:
        """Tangential stiffness along t1, and along t2 where it is another one, N/m."""
        first, second = self.tangential
        return value(first), None if first == second else value(second)

    @property
    def ratio(self) -> Array | None:
        """Tangential stiffness along t2 over that along t1, where it is another one."""
        first, second = self.tangential
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
        source = Source(0.0, None, None, Preload(value(0.0)))
    else:
        with at("stiffness"):
            source = settings.springs.source(path)
    heights = roughness = friction = None
    normal = source.law
    if settings.roughness is not None:
        with at("roughness"):
            heights, roughness = settings.roughness.heights(path, settings.unit)
        normal = Rough(value(source.normal), value(roughness), heights)
    if settings.friction is not None:
        with at("friction"):
            friction = settings.friction.friction(path, settings.temperature, source.area)
    found = ContactModel(
        settings, path, source.normal, source.stiffness, source.area, heights, roughness, normal,
        friction, pressed, source.layer, source.hertz,
    )  # fmt: skip
    found = replace(found, normal=settings.what.normal(found) or normal)
    if friction is None or (source.stiffness is None and not settings.what.rigid):
        return found
    with at("law"):
        law: Law = running(lambda: settings.what.law(found), settings.what)
        tried(law, settings.what, friction)
    return replace(found, law=law)


# laws of other packages, tried before they are solved: in a response a mistake in one is told from within JAX ---------


def is_other(thing: object) -> bool:
    """Whether a law, or a part of one, is of another package."""
    return not type(thing).__module__.startswith(f"{__name__.split('.')[0]}.")


def tried(law: Law, *parts: object) -> None:
    """Trace every method of a law for two points, which computes nothing.

    Args:
        parts: of the law, which may be of other packages too.

    Raises:
        UserError: a method that is missing, fails or returns another shape.
    """
    kind = type(law)
    if missing := [name for name in Law.NEEDED if getattr(kind, name) is getattr(Law, name)]:
        raise UserError(
            f"{kind.__name__} of {kind.__module__} has no method {', '.join(missing)}; add "
            "what is missing, docs/own_law.md says what each returns"
        )
    if not any(is_other(x) for x in (law, *parts)):
        return
    shape = running(lambda: jax.eval_shape(lambda: _methods(law)).shape, law, *parts)
    if shape != (2, 3):
        raise UserError(
            f"step of {kind.__name__} gives two points a force of shape {shape}; it has to be "
            "(2, 3), a row for each point along n, t1 and t2"
        )


def _methods(law: Law) -> Any:
    two, rest = jnp.zeros((2, 3)), law.init(2)
    force, state = law.step(two, two, 1.0, rest)
    if force.shape == two.shape:
        law.limit(force, state)
        law.slip(state)
        law.stored(two, state)
        if type(law).lost is not Law.lost:
            law.lost(Step(two, two, 1.0, force, force, rest, state))
    return force


def running(what: Callable[[], Any], *others: object) -> Any:
    """What code of other packages returns.

    Raises:
        UserError: it fails; the sentence has file and line.
    """
    try:
        return what()
    except UserError:
        raise
    except Exception as error:
        files = {getattr(sys.modules.get(type(x).__module__), "__file__", "") for x in others if is_other(x)}
        places = [f for f in traceback.extract_tb(error.__traceback__) if f.filename in files]
        if not places:
            raise
        at, said = places[-1], str(error).splitlines()[0] if str(error) else ""
        raise UserError(
            f"{at.filename}, line {at.lineno}, in {at.name}: {type(error).__name__}: {said}; correct it"
        ) from error
