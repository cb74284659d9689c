"""case.toml: an assembly of bodies and what is asked of it; every key, checked."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, PrivateAttr, create_model, model_validator

from ..analysis import GROUP, Analysis, analyses
from ..contact.friction import OfCoulomb
from ..contact.point import OfPoint
from ..contact.settings import ContactLaw
from ..errors import UserError
from ..operating.fatigue import MaterialLimits
from ..reduced.compliance import BULK_AND_SURFACE
from ..settings.mistakes import too_few
from ..settings.numbers import (
    Model,
    Name,
    NotNegative,
    Number,
    Numbers,
    OfFile,
    Positive,
    Ratio,
    Ratios,
    Vector,
    _finite_vector,
    _float,
    _tuple,
    named_once,
)
from ..settings.toml import read_settings
from ..system.excitation import Turning
from .driving import ROTATION, ExcitationOfCase, GroundOfCase, SpringOfCase, base_of
from .keys import GROUND as GROUND
from .keys import Address, Count, Order
from .questions import (
    CurveOfCase,
    IdentificationOfCase,
    OrdersOfCase,
    RangesOfCase,
    SpeedsOfCase,
)

FIRST_HARMONICS = 3
"""With which ``harmonics = "auto"`` begins."""

SAMPLES_EACH = 8
"""Samples of a cycle that ``auto`` takes at least for each harmonic, as the estimate of their error does."""

GOOD_SAMPLES_EACH, FEWEST_SAMPLES = 16, 48
"""Samples of a cycle for each harmonic, and at least, where a case names none."""

Radius = Annotated[float, BeforeValidator(_float), Field(gt=0)]


def _no_path(value: Any) -> Any:
    if isinstance(value, str) and ("/" in value or "\\" in value):
        raise ValueError(
            f'"{value}" is a path, and this is the name that a body.toml gives itself, which is looked for beside the '
            "case and in geometry/ of the folders above it; write the name, or the path of a modal file as file of "
            "[[bodies]]"
        )
    return value


BodyName = Annotated[Name, BeforeValidator(_no_path)]


class BodyOfCase(Model):
    """A body of an assembly.

    name: in this case. body: the name of a body.toml (see `places.find_body`) or of a system.toml beside the case, the
    name if not given. file: a modal file instead, beside the case. speed: of the file, counted from 0, or speed_rpm.
    turn: degrees about the body's rotation axis, and shift: m, from where its file has it to where it stands here.
    damping_ratio: instead of the file's, one for all modes or one a mode, the last one for all that follow.
    aerodynamics: a table beside the case (.csv: nodal_diameter, frequency_shift, damping_ratio and, where they differ,
    direction ``forward``, ``backward`` or ``both``) of what the flow adds to the modes in each wave of the ring.
    modes: how many of the stored eigenmodes are used, all if not given.
    mass: kg, of a body at rest made of another density, instead of the file's; its shape and stiffness stay.
    pressed_at_rpm: the speed whose centrifugal load presses a loose body into its contacts, which share it as normal
    forces without friction; they need no other.
    weak_springs: Hz, of a free body on springs so soft that it has this frequency in each of its rigid motions. A body
    that slides in all of its contacts has no place of its own; without them it slides away where mean forces do not
    balance.
    """

    name: Name
    body: BodyName | None = None
    file: str | None = None
    speed: Annotated[int, Field(ge=0)] = 0
    speed_rpm: NotNegative | None = None
    damping_ratio: Ratio | Ratios | None = None
    aerodynamics: str | None = None
    modes: Annotated[int, Field(ge=1, le=2000)] | None = None
    mass: Positive | None = None
    pressed_at_rpm: Positive | None = None
    turn: Number = 0.0
    weak_springs: Positive | None = None
    shift: Annotated[Vector, BeforeValidator(_finite_vector)] = (0.0, 0.0, 0.0)


class RingSettings(Model):
    """All bodies of the case stand blades times in a circle, driven by an engine order.

    engine_order: of the frequency that is swept; if not given, the greatest common divisor of those that excitations
    name, or 1. Negative ones run round with the rotor and faster. rotation: ``-`` for a rotor that turns from sector 1
    to sector 0. model: ``sector``, one that stands for all, or ``full``, all of them.
    """

    blades: Annotated[int, Field(ge=2, le=1000)]
    engine_order: Order | None = None
    rotation: Literal["+", "-"] = "+"
    model: Literal["sector", "full"] = "sector"


class ContactSettings(ContactLaw):
    """A contact of an interface with the ground, a rigid neighbour, or with another body's interface.

    against: ``ground``, or an interface, ``body:interface``; against_sector: of a ring, how many sectors further that
    body stands. normal_force: N, or interference: m, negative a gap, where the sweep's normal forces are not this
    contact's. width (along t1) and height (along t2) in m are the patch's own if not given; points: of it along t1 and
    t2 (four of Jenkins elements if not given).

    What it is: the keys of a contact.toml (`docs/contact_toml.md`), of the whole patch in SI, of which every point
    carries its share; or file: a contact.toml beside the case. includes: which compliance the stiffnesses count, that
    of the surface alone or of bulk and surface (the book's E A / l0); see `compliance`.

    patch: ``rigid``, six coordinates, or ``nodal``, points that move as the shapes of the bodies say. curvature:
    relative radii (m) along t1 and t2, inf where it is flat (a pin of radius r in a hole of radius R: r R / (R - r)).
    young (Pa) and poisson of both bodies take the place of the two stiffnesses there: springs that agree with Hertz in
    their ``approach`` or ``width`` (fit), at the load `fitted_at` (N; if not given the force that presses it: its own,
    or each of the sweep); or fit = ``exact``: a line of contact in pieces, or one round contact, with Hertz' own law.
    isotropic: of both tangential stiffnesses that Hertz' contact has the geometric mean, as mode = ``book`` needs it.
    ground: how the other side moves; of another body, how fast its material runs through.
    """

    interface: Address
    against: Address = GROUND
    against_sector: Annotated[int, Field(ge=-1000, le=1000)] = 0
    normal_force: NotNegative | None = None
    interference: Number | None = None
    file: str | None = None
    width: Positive | None = None
    height: Positive | None = None
    includes: Literal["surface", "bulk+surface"] | None = None
    points: Annotated[tuple[Count, Count], BeforeValidator(_tuple)] | None = None
    patch: Literal["rigid", "nodal"] = "rigid"
    curvature: Annotated[tuple[Radius, Radius], BeforeValidator(_tuple)] | None = None
    young: Positive | None = None
    poisson: Annotated[Number, Field(gt=-1, le=0.5)] = 0.3
    fit: Literal["approach", "width", "exact"] = "approach"
    fitted_at: Positive | None = None
    isotropic: bool = False
    ground: GroundOfCase | None = None

    @property
    def is_pressed(self) -> bool:
        return self.interference is None

    @property
    def can_be_pressed(self) -> bool:
        return self.is_pressed

    @property
    def is_elsewhere(self) -> bool:
        return self.file is not None or self.young is not None

    @property
    def is_curved(self) -> bool:
        """Whether its stiffnesses are those of Hertz' contact."""
        return self.young is not None

    @property
    def files(self) -> list[str]:
        """Files that it names."""
        some = (self, self.stiffness, self.roughness, self.friction)
        return [file for one in some if isinstance(file := getattr(one, "file", None), str)]

    @model_validator(mode="after")
    def _says_what_it_is(self) -> ContactSettings:
        given = [key for key in ContactLaw.model_fields if key in self.model_fields_set]
        if self.file is not None and given:
            raise ValueError(f"{given[0]}: stands in the contact file already; give file or {given[0]}")
        if self.file is None and self.friction is None:
            raise ValueError("friction: is missing; give it, or a contact file (file)")
        if not self.is_elsewhere and not self.what.rigid and getattr(self.springs, "tangential", 1.0) is None:
            key = "stiffness.tangential" if self.stiffness is not None else "tangential_stiffness"
            raise ValueError(f"{key}: is missing; add it")
        if self.normal_force is not None and self.interference is not None:
            raise ValueError("normal_force and interference: a contact is pressed by one or by the other; give one")
        if self.temperature is not None and not self.heated:
            raise ValueError("temperature: belongs to friction that the heat of sliding changes; leave it out")
        if self.ground is not None and self.against != GROUND and (self.ground.waviness or self.ground.spectrum):
            raise ValueError(f"ground: the contact is against {self.against}, which has no waves; leave them out")
        self.fits_here()
        return self._curved()

    def fits_here(self) -> None:
        """Refuse a law that cannot stand on such a patch.

        Raises:
            ValueError: with its key.
        """
        if not self.what.opens and (self.patch == "nodal" or self.curvature is not None):
            key = "curvature" if self.curvature is not None else "patch"
            raise ValueError(f'{key}: law = "{self.what.kind}" belongs to flat, rigid patches; write law = "smooth"')
        if self.what.rigid and (self.interference or 0.0) > 0:
            raise ValueError("interference: rigid bodies cannot overlap; give a gap (negative), or a normal_force")
        if self.what.rigid and self.curvature is not None:
            raise ValueError('curvature: law = "set-valued" belongs to flat patches; leave curvature out')

    def _curved(self) -> ContactSettings:
        springs = self.stiffness or self.normal_stiffness or self.tangential_stiffness
        if self.is_curved and (self.curvature is None or self.file or springs):
            raise ValueError("young stands for both stiffnesses where a curvature is given; give one or the other")
        if self.is_curved:
            self._plain()
        if self.fit == "exact" and (self.young is None or self.patch == "nodal"):
            raise ValueError('fit: "exact" needs curvature and young, and a rigid patch')
        alone = [key for key in ("fit", "fitted_at", "poisson") if key in self.model_fields_set]
        if alone and not self.is_curved:
            raise ValueError(f"{alone[0]}: belongs to young, of a curved contact; leave it out")
        if self.curvature is not None and min(self.curvature) == math.inf:
            raise ValueError("curvature: inf, inf is flat; leave it out, or give the radius of the curved direction")
        if self.patch == "nodal" and self.points is not None:
            raise ValueError('points: a patch = "nodal" has those of the mesh; leave points out')
        if self.isotropic and self.young is None:
            raise ValueError("isotropic belongs to young: two stiffnesses given are the same along t1 and t2 anyway")
        if self.young is not None and self.includes == BULK_AND_SURFACE:
            raise ValueError('includes: Hertz\' contact beyond what the face yields is the "surface"; leave it out')
        return self

    def _plain(self) -> None:
        """Of a contact of two curved bodies: smooth or, of springs, rough points under one coefficient of friction."""
        if not isinstance(self.friction, OfCoulomb) or self.friction.deviation:
            raise ValueError("friction: of a curved contact (young) is one coefficient; write a number")
        if self.roughness is not None and (self.roughness.kind != "polynomial" or self.fit == "exact"):
            raise ValueError("roughness: of a curved contact is R_Z, of springs that agree with Hertz; write a number")
        plain = OfPoint(kind="smooth" if self.roughness is None else "rough")
        if self.what != plain:
            raise ValueError(f'law: of a curved contact (young) is "{plain.kind}"; leave it out')


class Sweep(Model):
    """Frequencies (Hz), linearly spaced, and the normal forces (N) to compare, or ``static``: the modal file's own.

    They press every contact that has neither normal_force nor interference.
    """

    start: Positive
    stop: Positive
    points: Annotated[int, Field(ge=2, le=200000)] = 600
    normal_forces: Literal["static"] | Numbers | None = None
    patience: NotNegative = 180.0

    @model_validator(mode="after")
    def _rising(self) -> Sweep:
        if self.stop <= self.start:
            raise ValueError("stop must be above start")
        if isinstance(self.normal_forces, tuple) and (not self.normal_forces or min(self.normal_forces) < 0):
            raise ValueError('normal_forces must be one or more numbers, none negative, or "static"')
        return self


class MonitorOfCase(Model):
    """A read-out: ``monitor`` or ``body:monitor``, and the direction of a displacement; or a strain gauge."""

    monitor: Address
    direction: Literal["x", "y", "z"] = "x"


def _no_ratio(value: Any) -> Any:
    if isinstance(value, int | float):
        raise ValueError('says what damping is of ("modal", "structural", "stuck"); write a number as damping_ratio')
    return value


class CaseSettings(OfFile):
    """A whole case.toml.

    body (with the speed, speed_rpm and modes of `BodyOfCase`), or [[bodies]]; excitation and amplitude, or
    [[excitations]]; monitor and direction, or [[monitors]], all of which are drawn, and in the first of which
    resonances are looked for. harmonics, ``auto`` for as many as an estimated harmonics_error (a share of the
    amplitude, 0.5 at most) at the resonances asks for; samples (of a cycle, 16 a harmonic and 48 at least if not
    given), cycles (marched at most until the sliders are periodic) and periodicity (within which share of the largest
    force they count as periodic, 0: never): of contacts with a law. memory_limit: GiB that they may take by an estimate
    before they begin, the machine's if not given. mode: ``aft``, their laws in time, or ``book`` (Sextro
    5.2): one harmonic, constant normal force, elliptic orbits, from tables; strips: into which it cuts the
    touching part of a rough surface, for microslip (5.2-33), 0 for none. damping: ``modal``, each body's own modes as
    Sextro Eq. (2.4-13) has it; ``structural``, the bodies' ratios as loss factors, so that elastic deformation damps in
    every motion; or ``stuck``, the modes with sticking contacts. Not given: modal for one body, structural for several.
    damping_ratio: of the bodies that give none themselves, or of the stuck modes. material_limits: of the body whose
    monitor is drawn, for the margins of its stresses.
    """

    _path: Path = PrivateAttr(default=Path("case.toml"))

    name: Name
    description: str = ""
    body: BodyName | None = None
    bodies: Annotated[tuple[BodyOfCase, ...], BeforeValidator(_tuple)] = ()
    ring: RingSettings | None = None
    speed: Annotated[int, Field(ge=0)] = 0
    speed_rpm: NotNegative | None = None
    modes: Annotated[int, Field(ge=1, le=2000)] | None = None
    excitation: Address | None = None
    amplitude: Number = 1.0
    excitations: Annotated[tuple[ExcitationOfCase, ...], BeforeValidator(_tuple)] = ()
    monitor: Address | None = None
    direction: Literal["x", "y", "z"] = "x"
    monitors: Annotated[tuple[MonitorOfCase, ...], BeforeValidator(_tuple)] = ()
    mode: Literal["aft", "book"] = "aft"
    strips: Annotated[int, Field(ge=0, le=1000)] = 0
    damping: Annotated[Literal["modal", "structural", "stuck"] | None, BeforeValidator(_no_ratio)] = None
    damping_ratio: Ratio | Ratios | None = None
    harmonics: Literal["auto"] | Annotated[int, Field(ge=1, le=200)] = 3
    harmonics_error: Annotated[Positive, Field(le=0.5)] | None = None
    samples: Annotated[int, Field(ge=8, le=100000)] | None = None
    cycles: Annotated[int, Field(ge=1, le=1000)] = 100
    periodicity: Annotated[NotNegative, Field(le=1e-2)] = 1e-10
    memory_limit: Positive | None = None
    springs: Annotated[tuple[SpringOfCase, ...], BeforeValidator(_tuple)] = ()
    contacts: Annotated[tuple[ContactSettings, ...], BeforeValidator(_tuple)]
    sweep: Sweep
    material_limits: MaterialLimits | None = None
    orders: OrdersOfCase | None = None
    speeds: SpeedsOfCase | None = None
    ranges: RangesOfCase | None = None
    curve: CurveOfCase | None = None
    identification: IdentificationOfCase | None = None

    @model_validator(mode="before")
    @classmethod
    def _swept(cls, raw: Any) -> Any:
        """A case that asks for what needs no sweep has one that stands for it."""
        if not isinstance(raw, dict) or "sweep" in raw or not any(raw.get(key) for key in _unswept()):
            return raw
        return raw | {"sweep": unasked_sweep(raw)}

    @property
    def asked(self) -> dict[str, Any]:
        """Analysis -> its keys, of those in whose tables the case asks for something."""
        return {name: keys for name in analyses() if (keys := getattr(self, name, None))}

    @property
    def is_only_followed(self) -> bool:
        """Whether it asks for what needs no sweep, and for none."""
        asked = self.model_dump(include=self.asked.keys() & _unswept())
        return bool(asked) and self._stands_for(unasked_sweep(asked))

    @property
    def has_no_response(self) -> bool:
        """Whether all that it asks for is in the tables of its analyses."""
        return self.is_only_followed or any(analyses()[name].alone for name in self.asked)

    @property
    def is_only_built(self) -> bool:
        """Whether it asks for nothing: what is analysed is said in Python."""
        asked = self.asked.keys() & _unswept()
        return not asked and self.sweep.normal_forces == UNPRESSED and self._stands_for(NO_SWEEP)

    def _stands_for(self, band: Mapping[str, float]) -> bool:
        """Whether the sweep is the one of a case that has none."""
        forces = self.sweep.normal_forces
        own = self.sweep.model_copy(update={"normal_forces": None if forces == UNPRESSED else forces})
        return own == Sweep.model_validate(band)

    @model_validator(mode="after")
    def _fits_together(self) -> CaseSettings:
        free = self.is_only_built or any(s.motion for s in self.springs)
        free = free or any(c.ground is not None for c in self.contacts)
        free = free or any(analyses()[name].unloaded(keys) for name, keys in self.asked.items())
        moved = free and not self.excitation and not self.excitations
        for short, many in (("body", "bodies"), ("excitation", "excitations"), ("monitor", "monitors")):
            if bool(getattr(self, short)) == bool(getattr(self, many)) and not (moved and short == "excitation"):
                raise ValueError(f"{short}: give {short}, or one or more [[{many}]], and not both")
        names = [b.name for b in self.components]
        if twice := sorted({n for n in names if names.count(n) > 1}):
            raise ValueError(f"bodies: the name '{twice[0]}' is taken; give every body its own")
        named_once(self, *(name for name in self.asked if analyses()[name].several))
        if said := self._whose():
            raise ValueError(said)
        if self.loads and all(x.is_zero for x in self.loads):
            key = "excitations" if self.excitations else "amplitude"
            raise ValueError(f"{key}: a force of 0 moves nothing; give its size in N (Pa of a pressure)")
        if said := self._met_twice():
            raise ValueError(said)
        count = self.number_of_harmonics
        if self.sampled < 4 * count:
            words = too_few(self.sampled, count, 4 * count, GOOD_SAMPLES_EACH * count)
            raise ValueError(f"samples: {words}")
        return self._automatic()._book()._pressed()._damped()

    def _damped(self) -> CaseSettings:
        if self.damping == "stuck" and self.damping_ratio is None:
            raise ValueError('damping_ratio: damping = "stuck" needs that of the stuck modes; give one, or one a mode')
        if self.damping == "stuck" and any(b.damping_ratio is not None for b in self.bodies):
            raise ValueError('bodies: damping = "stuck" leaves no damping_ratio of a body; give one of the two')
        return self

    @property
    def damping_as(self) -> str:
        """``modal``, ``structural`` or ``stuck``."""
        return self.damping or ("modal" if len(self.components) == 1 else "structural")

    @property
    def stuck_ratios(self) -> tuple[float, ...] | None:
        """Damping ratios of the modes with sticking contacts, if they are asked for."""
        if self.damping_as != "stuck" or self.damping_ratio is None:
            return None
        return self.damping_ratio if isinstance(self.damping_ratio, tuple) else (self.damping_ratio,)

    def _automatic(self) -> CaseSettings:
        if self.harmonics_error is not None and self.harmonics != "auto":
            raise ValueError('harmonics_error: belongs to harmonics = "auto"; a number of them is taken as it is')
        if self.harmonics == "auto" and self.ring is not None and self.ring.model == "full":
            raise ValueError('harmonics: "auto" needs ring.model = "sector"; the whole ring needs as many: give them')
        return self

    def _whose(self) -> str:
        """A sentence where there are several bodies and a name does not say which of them has it; else nothing."""
        named = [("contacts", end) for c in self.contacts for end in (c.interface, c.against) if end != GROUND]
        named += [("excitations", x.row or x.face or "") for x in self.loads]
        named += [("springs", s.row) for s in self.springs]
        named += [("monitors", m.monitor) for m in self.outputs]
        open_ = [(key, name) for key, name in named if ":" not in name]
        if not open_ or len(self.components) == 1:
            return ""
        key, name = open_[0]
        choices = ", ".join(f"{b.name}:{name}" for b in self.components[:3]) + (
            ", ..." if len(self.components) > 3 else ""
        )
        return f"{key}: '{name}' says not of which body; write one of {choices}"

    def _met_twice(self) -> str:
        """A sentence where an interface stands in two contacts, which would count its area twice; else nothing."""
        first: dict[tuple[str, str], int] = {}
        for i, c in enumerate(self.contacts, 1):
            for end in (c.interface, c.against):
                if end != GROUND and first.setdefault(self.address(end), i) != i:
                    return (
                        f"contacts: interface '{end}' stands in contacts {first[self.address(end)]} and {i} (counted "
                        "from 1), but a face has one contact; name another interface in one of them or take it out"
                    )
        return ""

    def _book(self) -> CaseSettings:
        if self.mode == "book" and (not self.contacts or not all(c.what.opens for c in self.contacts)):
            raise ValueError('mode: "book" needs point contacts; write law = "smooth" or "rough" in every contact')
        if self.strips and self.mode != "book":
            raise ValueError('strips: belong to mode = "book"; a marched law brings its own microslip (contacts.file)')
        return self

    def _pressed(self) -> CaseSettings:
        moves = [c.interface for c in self.contacts if c.ground is not None]
        if moves and not (self.is_only_followed or self.is_only_built):
            raise ValueError(
                f"contacts.{moves[0]}.ground: only a motion in time knows ground that moves; give [orbit], "
                "[stability], [[bifurcation]] or [two_tones], and no sweep"
            )
        bare = [c for c in self.contacts if c.normal_force is None and c.interference is None]
        open_ = [c.interface for c in bare if not self.is_thrown(c)]
        if open_ and self.sweep.normal_forces is None:
            raise ValueError(
                f"contacts.{open_[0]}: nothing presses it; give sweep.normal_forces, or its normal_force or "
                "interference"
            )
        if any(b.aerodynamics for b in self.bodies) and self.ring is None:
            raise ValueError("bodies: aerodynamics belong to the waves of a ring; add [ring] with its blades")
        for name, keys in self.asked.items():
            if words := analyses()[name].fits(keys, self):
                raise ValueError(f"{name}: {words}")
        if any(c.against_sector for c in self.contacts) and self.ring is None:
            raise ValueError("contacts: against_sector belongs to a ring; add [ring] with blades and engine_order")
        return self

    @property
    def number_of_harmonics(self) -> int:
        """The number given, or the one from which more are looked for."""
        return FIRST_HARMONICS if self.harmonics == "auto" else self.harmonics

    @property
    def balanced(self) -> int:
        """Harmonics of the balance: one in the book's mode."""
        return 1 if self.mode == "book" else self.number_of_harmonics

    @property
    def looks_for_harmonics(self) -> bool:
        """Whether their number follows from an estimated error."""
        return self.harmonics == "auto" and self.mode == "aft"

    def with_harmonics(self, count: int) -> CaseSettings:
        """The case with a number of harmonics, and of samples that grow with them: both errors fall."""
        if self.samples is None:
            return self.model_copy(update={"harmonics": count})
        grown = -(-self.samples * count // FIRST_HARMONICS)
        return self.model_copy(update={"harmonics": count, "samples": max(grown, SAMPLES_EACH * count)})

    @property
    def sampled(self) -> int:
        """Samples of a cycle: those given, or as many as the harmonics need."""
        return self.samples or max(FEWEST_SAMPLES, GOOD_SAMPLES_EACH * self.number_of_harmonics)

    @property
    def marching(self) -> dict[str, Any]:
        """How finely forces are marched in time, as `harmonic_balance.problem.of` asks."""
        return {"samples": self.sampled, "cycles": self.cycles, "periodicity": self.periodicity}

    @property
    def components(self) -> tuple[BodyOfCase, ...]:
        """The bodies; one that the short form names."""
        return self.bodies or (
            BodyOfCase(name=self.body or "", speed=self.speed, speed_rpm=self.speed_rpm, modes=self.modes),
        )

    @property
    def loads(self) -> tuple[ExcitationOfCase, ...]:
        """The excitations; one that the short form names."""
        short = () if self.excitation is None else (ExcitationOfCase(row=self.excitation, amplitude=self.amplitude),)
        return self.excitations or short

    @property
    def files(self) -> tuple[str, ...]:
        """Files beside the case that it names, modal files left out."""
        named = (
            [f for c in self.contacts for f in c.files]
            + [x.field for x in self.loads]
            + [b.aerodynamics for b in self.components]
            + [f for name, keys in self.asked.items() for f in analyses()[name].files(keys)]
        )
        return tuple(dict.fromkeys(f for f in named if f is not None))

    @property
    def turning(self) -> Turning:
        """1 or -1, see `system.excitation.Turning`."""
        return ROTATION[self.ring.rotation] if self.ring else 1

    @property
    def base_order(self) -> int:
        """Engine order of the swept frequency, as `system.assembly.Ring` has it: negative against the numbers."""
        return base_of(self.loads, self.ring.engine_order if self.ring else None, self.turning)

    @property
    def outputs(self) -> tuple[MonitorOfCase, ...]:
        """The monitors; one that the short form names."""
        return self.monitors or (MonitorOfCase(monitor=self.monitor or "", direction=self.direction),)

    def address(self, text: str) -> tuple[str, str]:
        """Body and row of ``body:row``; the only body of the case where none is named."""
        body, _, row = text.rpartition(":")
        return body or self.components[0].name, row

    def ends(self, c: ContactSettings) -> list[tuple[str, str]]:
        """(body, interface) of the one or two faces of a contact."""
        return [self.address(end) for end in (c.interface, c.against) if end != GROUND]

    def is_thrown(self, c: ContactSettings) -> bool:
        """Whether the centrifugal load of one of its bodies presses a contact."""
        thrown = {b.name for b in self.bodies if b.pressed_at_rpm is not None}
        return any(body in thrown for body, _ in self.ends(c))


NO_SWEEP = {"start": 1.0, "stop": 2.0}
"""Stands for the sweep of a case that asks for what needs none alone, or for nothing."""

UNPRESSED = (0.0,)
"""Normal forces of the sweep of a case whose contacts are pressed in Python."""


def unasked_sweep(asked: Mapping[str, Any]) -> Mapping[str, float]:
    """Start and stop (Hz) of the sweep of a case that has none, by what it asks for."""
    bands = (analyses()[name].band(keys) for name, keys in asked.items() if name in _unswept())
    return next(filter(None, bands), NO_SWEEP)


def load_case(path: Path | str, assignments: Sequence[str] | None = None) -> tuple[CaseSettings, dict[str, Any]]:
    """A case file (SI units); see `read_settings`."""
    return read_settings(case_model(), path, assignments)


@cache
def case_model() -> type[CaseSettings]:
    """`CaseSettings` with the tables of all analyses.

    Raises:
        UserError: the table of one has the name of another key.
    """
    tables: dict[str, Any] = {name: (_table_of(one) | None, None) for name, one in analyses().items()}
    if taken := sorted(set(tables) & set(CaseSettings.model_fields)):
        raise UserError(f"{GROUP}: '{taken[0]}' is a key of every case already; remove its package or rename it there")
    return create_model("CaseSettings", __base__=CaseSettings, __doc__=CaseSettings.__doc__, **tables)


def _table_of(one: Analysis) -> Any:
    """The type of the keys of an analysis."""
    return Annotated[tuple[one.asks, ...], BeforeValidator(_tuple)] if one.several else one.asks  # type: ignore[name-defined]


def _unswept() -> set[str]:
    """Analyses that need no sweep."""
    return {name for name, one in analyses().items() if not one.swept}
