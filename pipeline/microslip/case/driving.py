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
    """Exciters that stand around the rotor: their engine orders follow from where they stand."""

    angles: Numbers
    """[degrees] where they stand around the rotor"""
    force: Number | Numbers = 1.0
    """[N] peak of each, or one for all"""
    width: Positive
    """[degrees] over which each is felt"""
    pulse: Literal["cosine", "rectangular"] = "cosine"
    """cos^2, or constant over the width"""
    place: Number = 0.0
    """[degrees] of the loaded spot of the first blade at time 0"""
    highest: Annotated[int, Field(ge=1, le=1000)] = 24
    """engine order that is kept"""

    @model_validator(mode="after")
    def _fits(self) -> MagnetsOfCase:
        if not self.angles or (isinstance(self.force, tuple) and len(self.force) != len(self.angles)):
            raise ValueError("angles and force: give one or more angles, and one force or as many as angles")
        if self.width > 360:
            raise ValueError("width: more than a whole turn; give degrees")
        return self


class SpringOfCase(Model):
    """A spring from a body to the ground, where and as an excitation of the body pushes."""

    row: Address
    """excitation of a body, `body:excitation` where there are several: its point and direction"""
    stiffness: Positive
    """[N/m] of the spring"""
    damping: NotNegative = 0.0
    """[N s/m] of a damper beside it, against the ground"""
    motion: NotNegative = 0.0
    """[m] 0-peak, of its far end: moves as cos of the driving frequency"""


class WaveOfCase(Model):
    """A sine wave of the ground along its direction (Sextro Eq. (4.3-1))."""

    amplitude: NotNegative
    """[m] y_A"""
    length: Positive
    """[m] lambda"""
    phase: Number = 0.0
    """[degrees] where the contact begins, at u_r = 0"""


class SpectrumOfCase(Model):
    """Waves of a ground whose profile has a power spectrum over the wave number that falls with an
    exponent."""

    height: NotNegative
    """[m] root of the mean square"""
    longest: Positive
    """[m] wave length"""
    shortest: Positive
    """[m] wave length"""
    exponent: Number = 2.0
    """with which the power falls; 2 of a random walk"""
    waves: Annotated[int, Field(ge=1, le=200)] = 32
    """how many"""
    seed: Annotated[int, Field(ge=0, le=2**32 - 1)] = 0
    """of their phases and lengths"""

    @model_validator(mode="after")
    def _falling(self) -> SpectrumOfCase:
        if self.shortest >= self.longest:
            raise ValueError("shortest: must be below longest; exchange them")
        return self


class GroundOfCase(Model):
    """Ground that moves under a contact, of a motion in time or of steady sliding (Sextro, sections 4.1 and 4.3).

    With rpm it is material that runs through the other body while its shape stands.
    """

    velocity: Number = 0.0
    """[m/s] V of the other side, of a [motion in time](time_domain.md)"""
    direction: Number = 0.0
    """[degrees] of the velocity, from t1 towards t2"""
    rpm: Number | None = None
    """[rpm] instead of the velocity: material that turns about the axis of the body which the
    contact is against ([squeal](squeal.md))"""
    axis: Direction | None = None
    """along another axis, in the axes of the case"""
    point: Annotated[Vector, BeforeValidator(_finite_vector)] | None = None
    """[m] through this point"""
    waviness: Annotated[tuple[WaveOfCase, ...], BeforeValidator(_tuple)] = ()
    spectrum: SpectrumOfCase | None = None
    pushes: bool = True
    """whether the slope of a wave pushes the body along the ground; the book: false"""
    inertia: bool = True
    """of the [material that runs through](squeal.md#the-material-that-runs-through); false
    leaves it out, as for a body whose shape is not one of revolution"""

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
    """A harmonic force: an amplitude times a row of a body's modal file or a pressure field.

    Beside the case a field is .csv, .npz, .vtu or .vtk with x, y, z and p_real, p_imag in Pa.
    """

    row: Address | None = None
    """excitation of a body, `body:excitation` where there are several"""
    amplitude: Number = 1.0
    """[N or Pa] 0-peak; of a pressure field: a factor"""
    phase: Number = 0.0
    """[degrees] by which it leads"""
    harmonic: Annotated[int, Field(ge=0, le=1000)] = 1
    """of the swept frequency; 0: steady"""
    tone: Literal[1, 2] = 1
    """2, where the harmonic is one of a second frequency, see `[two_tones]`"""
    engine_order: Order | None = None
    """instead of the harmonic"""
    steady: Number | None = None
    """[N or Pa] steady gas load, with stimulus instead of amplitude"""
    stimulus: NotNegative | None = None
    """its share that vibrates"""
    speed_rpm: NotNegative | None = None
    """[rpm] of a centrifugal excitation, instead of amplitude and harmonic"""
    magnets: MagnetsOfCase | None = None
    field: str | None = None
    """file of a [complex pressure field](excitation.md#pressure-fields), instead of a row"""
    face: Address | None = None
    """where the field acts: an interface, or a face that an excitation of the body names"""
    length_unit: Literal["m", "cm", "mm", "um", "in", "ft"] | None = None
    """of the field's x, y, z"""
    time_factor: Literal["+", "-"] = "+"
    """`-`: the field stands for p exp(-i Omega t)"""

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
