"""What drives the bodies of a case: the keys of its excitations and damping, and the loads made of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from ..data import Array, Interface, ModalGroup
from ..errors import UserError, at
from ..settings.numbers import Direction, Model, NotNegative, Number, Numbers, Positive, Vector, _finite_vector, _tuple
from ..system.assembly import Load
from ..system.component import Component, Ring
from ..system.damping import structural, unstable
from ..system.excitation import Turning, base_order, harmonic_of, magnets, pattern_loads, unheard
from ..system.ground import Ground, spectrum, turning
from ..system.pairing import Place
from ..system.pressure import field_loads, load_face, on_face, read_field, with_pressure
from ..system.spin import Spin
from ..units import from_rpm
from .keys import Address, Order

ROTATION: dict[str, Turning] = {"+": 1, "-": -1}


class MagnetsOfCase(Model):
    """Exciters that stand around the rotor: their engine orders follow from where they stand.

    angles: degrees. force: peak of each, or one for all, N. width: degrees over which each is felt. pulse: ``cosine``,
    cos^2, or ``rectangular``. place: degrees at which the loaded spot of the first blade stands at time 0. highest:
    engine order.
    """

    angles: Numbers
    force: Number | Numbers = 1.0
    width: Positive
    pulse: Literal["cosine", "rectangular"] = "cosine"
    place: Number = 0.0
    highest: Annotated[int, Field(ge=1, le=1000)] = 24

    @model_validator(mode="after")
    def _fits(self) -> MagnetsOfCase:
        if not self.angles or (isinstance(self.force, tuple) and len(self.force) != len(self.angles)):
            raise ValueError("angles and force: give one or more angles, and one force or as many as angles")
        if self.width > 360:
            raise ValueError("width: more than a whole turn; give degrees")
        return self


class SpringOfCase(Model):
    """A spring from a body to the ground, where and along which an excitation of the body pushes.

    row: ``excitation``, or ``body:excitation``, of one force at a point. stiffness: N/m. damping: N s/m against the
    ground. motion: m, 0-peak, with which the far end of the spring moves, as cos of the driving frequency.
    """

    row: Address
    stiffness: Positive
    damping: NotNegative = 0.0
    motion: NotNegative = 0.0


class WaveOfCase(Model):
    """A sine wave of the ground (Sextro Eq. (4.3-1)): amplitude and length in m; phase: degrees where u_r = 0."""

    amplitude: NotNegative
    length: Positive
    phase: Number = 0.0


class SpectrumOfCase(Model):
    """Waves of a ground whose profile has a power spectrum over the wave number that falls with an exponent.

    height: m, root of the mean square. longest, shortest: wave lengths, m. exponent: 2 of a random walk. waves: how
    many. seed: of their phases and lengths.
    """

    height: NotNegative
    longest: Positive
    shortest: Positive
    exponent: Number = 2.0
    waves: Annotated[int, Field(ge=1, le=200)] = 32
    seed: Annotated[int, Field(ge=0, le=2**32 - 1)] = 0

    @model_validator(mode="after")
    def _falling(self) -> SpectrumOfCase:
        if self.shortest >= self.longest:
            raise ValueError("shortest: must be below longest; exchange them")
        return self


class GroundOfCase(Model):
    """Ground that moves under a contact, of a motion in time or of steady sliding (Sextro, sections 4.1 and 4.3).

    velocity: m/s, steady. direction: degrees of it, from t1 towards t2. waviness: sine waves, along the direction.
    spectrum: more of them. pushes: whether the slope of a wave turns the normal force, so that it pushes the body along
    the ground; false, as the book has it, leaves that out. rpm: instead of the velocity, of material that turns about
    the axis of the body that the contact is against, and runs through that body while its shape stands; axis: direction
    and point: m, in the axes of the case, where it turns about another one. inertia: of the material that runs through
    (see `system.spin`); false leaves that out, as for a body whose shape is not one of revolution.
    """

    velocity: Number = 0.0
    direction: Number = 0.0
    rpm: Number | None = None
    axis: Direction | None = None
    point: Annotated[Vector, BeforeValidator(_finite_vector)] | None = None
    waviness: Annotated[tuple[WaveOfCase, ...], BeforeValidator(_tuple)] = ()
    spectrum: SpectrumOfCase | None = None
    pushes: bool = True
    inertia: bool = True

    @model_validator(mode="after")
    def _moves(self) -> GroundOfCase:
        straight = self.velocity or self.direction or self.waviness or self.spectrum
        if self.rpm is not None and straight:
            raise ValueError("rpm: ground that turns has no velocity, direction or waves; leave these out, or rpm")
        if self.rpm is None and (self.axis or self.point):
            raise ValueError("axis and point belong to ground that turns; add rpm")
        if self.rpm is None and not self.inertia:
            raise ValueError("inertia: is that of material that turns; add rpm, or leave it out")
        if self.rpm == 0:
            raise ValueError("rpm: 0 does not move; give the speed at which it slides")
        if self.rpm is None and not self.velocity and not self.waviness and self.spectrum is None:
            raise ValueError("velocity: is missing; ground that neither moves nor is wavy needs no table")
        return self

    def ground(self, axis: Array, point: Array, face: Interface, place: Place) -> Ground:
        """As the contact sees it.

        Args:
            axis, point: (3,) about which it turns, in the axes of the case, where none are given here. face: of the
                first body, which stands at `place`.
        """
        if self.rpm is not None:
            spin = self.spin(axis, point, place)
            return turning(spin.rate * spin.axis, spin.point, face.origin, face.rotation)
        waves = [(w.amplitude, w.length, float(np.radians(w.phase))) for w in self.waviness]
        if (s := self.spectrum) is not None:
            waves += spectrum(s.height, s.longest, s.shortest, s.exponent, s.waves, s.seed)
        return Ground(self.velocity, float(np.radians(self.direction)), tuple(waves), self.pushes)

    def spin(self, axis: Array, point: Array, place: Place) -> Spin:
        """How it turns, in the axes of a body that stands at `place`; see `ground`."""
        n = np.asarray(axis if self.axis is None else self.axis, dtype=float)
        centre = place.turn.T @ (np.asarray(point if self.point is None else self.point) - place.shift)
        return Spin(float(from_rpm(self.rpm or 0.0)), place.turn.T @ n / float(np.linalg.norm(n)), centre)


class ExcitationOfCase(Model):
    """A harmonic force: a row of a body's modal file times an amplitude (N, or Pa for a unit pressure).

    row: ``excitation``, or ``body:excitation``. phase: degrees. harmonic: of the frequency that is swept; 0: steady.
    tone: 2, where the harmonic is one of a second frequency ([two_tones]). engine_order: instead of the harmonic; the
    swept frequency is that of the greatest common divisor of all engine orders, or of ring.engine_order where that is
    given. stimulus times steady (N or Pa): instead of the amplitude.
    speed_rpm: of a centrifugal excitation, steady. magnets: instead of amplitude and order.

    field: a complex pressure field on a face (an interface, or a face that an excitation of the body names) instead of
    a row: .csv, .npz, .vtu or .vtk beside the case, with x, y, z in length_unit and p_real, p_imag in Pa;
    time_factor ``-`` for programs with exp(-i Omega t). amplitude then multiplies the field.
    """

    row: Address | None = None
    amplitude: Number = 1.0
    phase: Number = 0.0
    harmonic: Annotated[int, Field(ge=0, le=1000)] = 1
    tone: Literal[1, 2] = 1
    engine_order: Order | None = None
    steady: Number | None = None
    stimulus: NotNegative | None = None
    speed_rpm: NotNegative | None = None
    magnets: MagnetsOfCase | None = None
    field: str | None = None
    face: Address | None = None
    length_unit: Literal["m", "cm", "mm", "um", "in", "ft"] | None = None
    time_factor: Literal["+", "-"] = "+"

    @model_validator(mode="after")
    def _one_kind(self) -> ExcitationOfCase:
        given = self.model_fields_set
        if (self.row is None) == (self.field is None):
            raise ValueError("give a row of the body, or a pressure field (field and face), and not both")
        if self.field is not None and (self.face is None or self.length_unit is None):
            raise ValueError("field: a pressure field needs face and length_unit")
        if self.field is None and given & {"face", "length_unit", "time_factor"}:
            raise ValueError("face, length_unit and time_factor belong to a pressure field; add field")
        if (self.steady is None) != (self.stimulus is None) or (self.steady is not None and "amplitude" in given):
            raise ValueError("stimulus and steady come together, instead of amplitude")
        if self.engine_order is not None and "harmonic" in given:
            raise ValueError("engine_order and harmonic: an order is a harmonic of the base order; give one of them")
        if self.tone == 2 and (self.harmonic == 0 or given & {"engine_order", "magnets", "speed_rpm"}):
            raise ValueError("tone: a second frequency belongs to a harmonic from 1 on; leave tone out, or the rest")
        if self.engine_order == 0:
            raise ValueError("engine_order: 0 is steady; write harmonic = 0")
        if self.phase and self.engine_order is None and self.harmonic == 0:
            raise ValueError("phase: a steady load (harmonic = 0) has none; leave it out")
        return self._alone(given)

    def _alone(self, given: set[str]) -> ExcitationOfCase:
        """Magnets and centrifugal loads leave no other way of saying how large and how fast."""
        others = given & {"amplitude", "steady", "stimulus", "engine_order", "phase"}
        for key, more in (("magnets", {"speed_rpm", "field", "harmonic"}), ("speed_rpm", {"magnets", "field"})):
            if getattr(self, key) is not None and (wrong := sorted(others | (given & more))):
                raise ValueError(f"{key} and {wrong[0]}: one says what the other would; give one of them")
        if self.speed_rpm is not None and given & {"harmonic"} and self.harmonic != 0:
            raise ValueError("speed_rpm: a centrifugal load is steady; write harmonic = 0 or leave it out")
        return self

    @property
    def size(self) -> complex:
        """Amplitude with its phase."""
        share = self.stimulus * self.steady if self.stimulus is not None and self.steady is not None else None
        return complex((self.amplitude if share is None else share) * np.exp(1j * np.radians(self.phase)))

    @property
    def is_zero(self) -> bool:
        """Whether it pushes with nothing."""
        force = self.size if self.magnets is None else self.magnets.force
        return self.speed_rpm in (None, 0.0) and not np.any(force)

    @property
    def orders(self) -> tuple[int, ...]:
        """Engine orders that it names."""
        if self.magnets is not None:
            return pattern_of(self.magnets).orders()
        return () if self.engine_order is None else (self.engine_order,)


def pattern_of(m: MagnetsOfCase):  # type: ignore[no-untyped-def]  # noqa: ANN201 - its room needs jax
    """The pattern of magnets around the rotor."""
    return magnets(np.radians(m.angles), np.array(m.force), float(np.radians(m.width)), m.highest, m.pulse)


# --- from settings to loads ------------------------------------------------------------------------------------------


def on_springs(group: ModalGroup, springs: Sequence[tuple[str, SpringOfCase]]) -> ModalGroup:
    """The group with springs and dampers to the ground along rows of its excitations.

    Raises:
        UserError: no excitation of that name.
    """
    K, C = group.K_r, group.C_r
    for row, s in springs:
        if row not in group.excitations:
            known = ", ".join(group.excitations) or "none"
            raise UserError(f"there is no excitation '{row}' to attach it to; the body has {known}")
        w = group.excitations[row].rows[0]
        K, C = K + s.stiffness * np.outer(w.conj(), w), C + s.damping * np.outer(w.conj(), w)
    return replace(group, K_r=K, C_r=C) if springs else group


def base_of(excitations: Sequence[ExcitationOfCase], given: int | None, turning: Turning) -> int:
    """Base engine order, as `Ring.order` has it: the given one, or the greatest common divisor of those named.

    Raises:
        UserError: orders that run both ways.
    """
    named = [e for x in excitations for e in x.orders]
    if given is not None or not named:
        return turning * (given if given is not None else 1)
    signs = {np.sign(e) for e in named}
    return turning * base_order(named) * (-1 if signs == {-1} else 1)


def loads_of(
    x: ExcitationOfCase, component: str, row: str, base: int, blades: int, turning: Turning
) -> tuple[Load, ...]:  # fmt: skip
    """The loads of one excitation on a row of a component.

    Args:
        base: see `base_of`. blades: N of a ring, else 0.

    Raises:
        UserError: an engine order that is no multiple of the base, or runs the other way round.
    """
    wave = Ring(blades, base) if blades else abs(base)
    if x.magnets is not None:
        return pattern_loads(component, row, pattern_of(x.magnets), wave, float(np.radians(x.magnets.place)), turning)
    if x.speed_rpm is not None:
        return (Load(component, row, (x.speed_rpm * np.pi / 30) ** 2, 0),)
    h = x.harmonic if x.engine_order is None else harmonic_of(x.engine_order, wave, turning)
    loads = field_loads(component, row, h, x.size) if x.field is not None else (Load(component, row, x.size, h),)
    return tuple(replace(one, tone=x.tone) for one in loads)


def with_field(
    component: Component, x: ExcitationOfCase, name: str, face: str, path: Path
) -> tuple[Component, str]:  # fmt: skip
    """A component with the rows of a pressure field, and what a reader should know of it.

    Raises:
        UserError: a file, a face or a unit that does not fit.
    """
    with at(f"excitations.{x.face}.field"):
        field = read_field(path.parent / str(x.field), str(x.length_unit), x.time_factor == "-")
        found = on_face(field, load_face(component, face), face)
        return with_pressure(component, name, found), found.sentence()


def as_asked(component: Component, kind: str, viscous: bool) -> Component:
    """A component with its damping as a case asks, see `CaseSettings.damping_as`.

    Args:
        viscous: its damping is that of dampers or Rayleigh's, which make no loss factor.
    """
    if kind == "stuck":
        return replace(component, groups={k: replace(g, C_r=np.zeros_like(g.C_r)) for k, g in component.groups.items()})
    return structural(component) if kind == "structural" and not viscous else component


def messages_of(
    components: Iterable[Component], loads: Sequence[Load], harmonics: int, blades: int, turning: Turning
) -> list[str]:
    """Modes that the flow feeds, and loads beyond the harmonics that are balanced."""
    return [s for m in components if m.aerodynamic for s in unstable(m, blades, turning)] + unheard(loads, harmonics)
