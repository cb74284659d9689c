"""Laws made of a contact file's settings: stiffness, heights, friction, element."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from ..basis import read_basis
from ..data import ModalBasis, UserError
from ..mesh import UNITS
from . import friction as friction_laws
from . import settings as S
from . import topography
from .curves import NormalCurve, read_columns, read_curve
from .friction import Coulomb, Falling, Friction, Heated, StaticSliding, characteristic, scattered
from .heights import Cut, Exponential, Gaussian, Heights, Linear, Polynomial, combined, tabulated
from .hertz import Hertz, half_curvatures
from .law import Array, Law
from .layer import Layer
from .normal import Hyperbolic, Normal, Penalty, Potential, Preload, Rough, measured
from .point import PointContact
from .regularised import MassContact
from .series import BULK, ContactStiffness, of_layer, of_patch
from .sliders import Iwan, mindlin, rough_strips, segalman, uniform
from .solids import Solid

HERTZ_DEPTH = 1e-6
"""m, approach at which the numbers of a Hertzian contact as a power law are taken; the law is the same for any."""


@dataclass(frozen=True)
class Contact:
    """What a contact file describes.

    Attributes:
        settings: in SI. path: of the file. stiffness: of the full area; None without a tangential one. normal_0: c_N0,
            N/m. area: nominal, m2, or None. heights, roughness: distribution and R_Z in m, or None. normal: normal
            law. friction: characteristic, or None. law: the element, or None without friction or tangential stiffness.
        layer, hertz: where the stiffness comes from one.
    """

    settings: S.ContactFile
    path: Path
    normal_0: float
    stiffness: ContactStiffness | None
    area: float | None
    heights: Heights | None
    roughness: float | None
    normal: Normal
    friction: Friction | None
    law: Law | None
    layer: Layer | None = None
    hertz: Hertz | None = None


def compose(settings: S.ContactFile, path: Path) -> Contact:
    """The laws of a contact file.

    Args:
        settings: in SI, of `settings.load_contact`. path: of the file, beside which others are sought.

    Raises:
        UserError: a file that is missing or cannot be read, numbers that make no law; each with its key.
    """
    source = _source(settings, path)
    heights, roughness = _heights(settings, path)
    normal = _normal(settings, source, heights, roughness)
    friction = _friction(settings, source, path)
    found = Contact(
        settings, path, source.normal, source.stiffness, source.area, heights, roughness, normal, friction, None,
        source.layer, source.hertz,
    )  # fmt: skip
    return replace(found, law=_element(found))


# stiffness ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Source:
    normal: float
    stiffness: ContactStiffness | None
    area: float | None
    layer: Layer | None = None
    hertz: Hertz | None = None
    curve: NormalCurve | None = None


def _source(settings: S.ContactFile, path: Path) -> _Source:
    given = settings.stiffness
    try:
        if isinstance(given, S.LayerSource):
            solid = Solid(given.young, given.poisson, given.shear)
            layer = Layer(solid, given.thickness, given.boundary, given.density)
            stiffness = of_layer(layer, given.area)
            return _Source(stiffness.normal, stiffness, given.area, layer)
        if isinstance(given, S.HertzSource):
            return _of_hertz(given)
        if isinstance(given, S.BasisSource):
            return _of_basis(given, read_basis(S.beside(path, given.file, "stiffness.file")))
    except UserError as error:
        own = str(error).startswith((str(path), str(path.parent / getattr(given, "file", path.name))))
        raise UserError(str(error) if own else f"{path}: stiffness.{error}") from error
    curve, normal = None, 0.0
    if isinstance(given, S.CurveSource):
        file = S.beside(path, given.file, "stiffness.file")
        curve = read_curve(
            file, *given.columns, given.displacement_unit, given.force_unit, given.gap, given.noise, given.includes
        )
        normal = float(measured(curve).nominal)
    else:
        normal = given.normal
    if given.tangential is None:
        return _Source(normal, None, given.area, curve=curve)
    pair = given.tangential if isinstance(given.tangential, tuple) else (given.tangential, given.tangential)
    return _Source(normal, ContactStiffness(normal, pair, given.includes), given.area, curve=curve)


def _of_hertz(given: S.HertzSource) -> _Source:
    first = Solid(given.young, given.poisson)
    second = Solid(given.young_2 or given.young, given.poisson if given.poisson_2 is None else given.poisson_2)
    A, B, _ = half_curvatures(given.radii, given.radii_2, given.angle)
    hertz = Hertz(first, second, A, B)
    normal = 1.5 * float(hertz.force(HERTZ_DEPTH)) / HERTZ_DEPTH
    x, y = hertz.tangential_ratio
    t1, t2 = (y, x) if given.axis else (x, y)
    stiffness = ContactStiffness(normal, (t1 * normal, t2 * normal), BULK, f"Hertz at {1e6 * HERTZ_DEPTH:g} um")
    return _Source(normal, stiffness, None, hertz=hertz)


def _of_basis(given: S.BasisSource, basis: ModalBasis) -> _Source:
    group = basis.groups[0, 0]
    for key, name in (("interface", given.interface), ("facing", given.facing)):
        if name is not None and name not in group.interfaces:
            known = ", ".join(group.interfaces) or "none"
            raise UserError(f"{key}: the modal file of '{basis.name}' has no interface '{name}'; it has {known}")
    stiffness = of_patch(group, basis.reduction, given.interface, given.facing or "", basis.sectors)
    return _Source(stiffness.normal, stiffness, float(np.sum(group.interfaces[given.interface].areas)))


# heights and normal law --------------------------------------------------------------------------------------------


def _heights(settings: S.ContactFile, path: Path) -> tuple[Heights | None, float | None]:
    given = settings.roughness
    if given is None:
        return None, None
    heights, roughness = _own_heights(given, path, UNITS[settings.length_unit])
    if given.R_Z_other:
        return combined(heights, roughness, Polynomial(), given.R_Z_other)
    return heights, roughness


def _own_heights(given: S.Roughness, path: Path, unit: float) -> tuple[Heights, float]:
    if isinstance(given, S.Shape):
        return (Polynomial() if given.kind == "polynomial" else Linear()), given.R_Z
    if isinstance(given, S.ExponentialHeights):
        return Cut(Exponential(_number(given.rate))), given.R_Z
    if isinstance(given, S.GaussianHeights):
        return Cut(Gaussian(_number(given.mean), _number(given.deviation))), given.R_Z
    if isinstance(given, S.ProfileHeights):
        file = S.beside(path, given.file, "roughness.file")
        level = None if given.level == "none" else given.level
        profile = topography.read_profile(file, (given.way_unit or given.unit, given.unit), level, given.columns)
        roughness = topography.roughness(profile).Rz
        return topography.heights(profile, roughness), roughness
    return _table(given, path, unit)


def _table(given: S.TableHeights, path: Path, unit: float) -> tuple[Heights, float]:
    depth, share, name = np.array(given.depth), np.array(given.share), f"{path}: roughness"
    if given.file is not None:
        file = S.beside(path, given.file, "roughness.file")
        table, lines = read_columns(file, given.columns)
        if (bad := np.argwhere(~np.isfinite(table))).size:
            what = ("depth", "share")[bad[0, 1]]
            raise UserError(f"{file}: line {lines[bad[0, 0]]}: the {what} is no finite number; correct it")
        depth, share, name = table[:, 0] * unit, table[:, 1], str(file)
    if len(depth) < 2:
        raise UserError(f"{name}: {len(depth)} depths; a height distribution needs two or more")
    if depth[0] < 0:
        raise UserError(f"{name}: the first depth is {depth[0]:g} m; depths are counted from the highest peak, from 0")
    roughness = given.R_Z or float(depth[-1])
    if not roughness > 0:
        raise UserError(f"{name}: the deepest height is {depth[-1]:g} m; give depths that rise from 0")
    return tabulated(depth / roughness, share, name), roughness


def _normal(
    settings: S.ContactFile, source: _Source, heights: Heights | None, roughness: float | None
) -> Normal:  # fmt: skip
    preload, length = getattr(settings.element, "preload", None), getattr(settings.element, "length", None)
    if preload is not None:
        return Preload(_number(preload))
    if source.hertz is not None:
        force = float(source.hertz.force(HERTZ_DEPTH))
        return Potential(_number(force), _number(HERTZ_DEPTH), _number(1.5))
    if source.curve is not None:
        return measured(source.curve)
    if heights is None or roughness is None:
        return Penalty(_number(source.normal))
    if length is not None:
        return Hyperbolic(_number(source.normal), _number(roughness), heights, _number(length))
    return Rough(_number(source.normal), _number(roughness), heights)


# friction ----------------------------------------------------------------------------------------------------------


def _friction(settings: S.ContactFile, source: _Source, path: Path) -> Friction | None:
    given = settings.friction
    if given is None:
        return None
    mean = _mean_friction(given, settings.temperature, source.area, path)
    if given.deviation:
        return scattered(mean, given.deviation, given.memory, given.seed)
    return mean


def _mean_friction(
    given: S.Friction, heat: S.Temperature | None, area: float | None, path: Path
) -> Friction:  # fmt: skip
    if isinstance(given, S.CoulombFriction):
        return Coulomb(_number(given.mu))
    if isinstance(given, S.StaticSlidingFriction):
        return StaticSliding(_number(given.static), _number(given.sliding))
    if isinstance(given, S.FallingFriction):
        return Falling(_number(given.mu_0), _number(given.p_v))
    if isinstance(given, S.ExponentialFriction):
        return friction_laws.Exponential(_number(given.mu_0), _number(given.mu_inf), _number(given.rate))
    if isinstance(given, S.TableFriction):
        file = S.beside(path, given.file, "friction.file")
        table, lines = read_columns(file, given.columns)
        if (bad := np.argwhere(~np.isfinite(table))).size:
            what = ("speed", "coefficient")[bad[0, 1]]
            raise UserError(f"{file}: line {lines[bad[0, 0]]}: the {what} is no finite number; correct it")
        shift = {k: getattr(given, k) for k in ("temperature", "reference", "c_1", "c_2")}
        return characteristic(table[:, 0], table[:, 1], str(file), **shift)
    assert heat is not None and area is not None
    return Heated(*map(_number, (given.mu_0, heat.resistance, heat.limit, area)))


# element -----------------------------------------------------------------------------------------------------------


def _element(c: Contact) -> Law | None:
    if c.friction is None or c.stiffness is None:
        return None
    first, second = c.stiffness.tangential
    own = None if first == second else _number(second)
    given = c.settings.element
    if isinstance(given, S.WithMass):
        return MassContact(
            c.normal, c.friction, _number(first), own, _number(given.mass), _number(given.damping),
            _number(given.slope), given.printed,
        )  # fmt: skip
    if isinstance(given, S.Massless):
        damping = _number(given.damping) if given.damping else None
        return PointContact(c.normal, c.friction, _number(first), own, damping)
    return _microslip(c, given, first, None if own is None else _number(second / first))


def _microslip(c: Contact, given: S.Element, stiffness: float, other: Array | None) -> Law:
    """Sliders in parallel; Coulomb's coefficient is the characteristic's (`settings` sees to that)."""
    assert isinstance(c.settings.friction, S.CoulombFriction)
    mu = c.settings.friction.mu
    if isinstance(given, S.IwanElement):
        shares = uniform(given.count, given.weakest)
        if given.exponent is not None:
            shares = segalman(given.count, given.exponent, given.ratio)
        return Iwan(c.normal, _number(mu), _number(stiffness), *shares, other)
    try:
        if isinstance(given, S.MindlinElement):
            assert c.hertz is not None and isinstance(c.settings.stiffness, S.HertzSource)
            return mindlin(c.hertz, mu, _deepest(c), given.count, c.settings.stiffness.axis)
        assert c.heights is not None and c.roughness is not None and isinstance(given, S.StripsElement)
        strips = rough_strips(c.normal_0, c.roughness, c.heights, stiffness, mu, given.count)
        return replace(strips, stiffness_ratio=other)
    except UserError as error:
        raise UserError(f"{c.path}: element: {error}") from error


def _deepest(c: Contact) -> float:
    """Approach up to which Mindlin's strips are laid, m: a quarter beyond the motion's."""
    assert c.hertz is not None
    motion = c.settings.motion
    if motion is None:
        return 1e-5
    mean = motion.normal[0] if motion.normal_force is None else float(c.hertz.approach(motion.normal_force))
    deepest = 1.25 * (mean + sum(map(abs, motion.normal[1:])))
    if not deepest > 0:
        raise UserError("the motion never closes the contact; press it by motion.normal_force")
    return deepest


def _number(value: float) -> Array:
    return jnp.asarray(value, dtype=float)
