"""case.toml: an assembly of bodies and what is asked of it; every key, checked."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, PrivateAttr, create_model, model_validator

from ..analysis import GROUP, Analysis, analyses
from ..contact.friction import OfCoulomb
from ..contact.point import OfPoint
from ..contact.settings import ContactLaw
from ..data import Array
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
    """A body of an assembly, of the modal file that its body.toml or system.toml makes.

    A body that slides in all of its contacts has no place of its own; without weak_springs it
    slides away where mean forces do not balance.
    """

    name: Name
    """in this case"""
    body: BodyName | None = None
    """name of the body whose modal file it is, looked for as said above; the name if not given"""
    file: str | None = None
    """a modal file beside the case instead"""
    speed: Annotated[int, Field(ge=0)] = 0
    """which speed of the modal file, from 0"""
    speed_rpm: NotNegative | None = None
    """[rpm] or a speed of the file or of its range"""
    damping_ratio: Ratio | Ratios | None = None
    """instead of the file's: one, or one a mode, the last one for all that follow"""
    aerodynamics: str | None = None
    """a table (.csv) beside the case of [what the flow adds](excitation.md#damping) to every wave
    of the ring"""
    modes: Annotated[int, Field(ge=1, le=2000)] | None = None
    """how many of those that the modal file stores, all if not given"""
    mass: Positive | None = None
    """[kg] of the same shape and stiffness at rest, made of another density"""
    pressed_at_rpm: Positive | None = None
    """[rpm] whose centrifugal load presses a loose body into its contacts, as normal forces
    without friction; they need no other"""
    turn: Number = 0.0
    """[degrees] about the body's rotation axis, from where its file has it"""
    weak_springs: Positive | None = None
    """[Hz] that hold a body which nothing else does: frequency of its rigid motions"""
    shift: Annotated[Vector, BeforeValidator(_finite_vector)] = (0.0, 0.0, 0.0)
    """[m] from where its file has it, after the turn"""


class RingSettings(Model):
    """All bodies of the case stand blades times in a circle, driven by an engine order."""

    blades: Annotated[int, Field(ge=2, le=1000)]
    """N, as many as the sectors of a cyclic body"""
    engine_order: Order | None = None
    """of the swept frequency; if not given, the greatest common divisor of those that
    excitations name, or 1; negative: [round with the rotor](excitation.md#engine-orders)"""
    rotation: Literal["+", "-"] = "+"
    """`-`: the rotor turns from sector 1 to sector 0"""
    model: Literal["sector", "full"] = "sector"
    """one sector that stands for all, or all of them"""


class ContactSettings(ContactLaw):
    """A contact of an interface with the ground, a rigid neighbour, or with another body's interface.

    What it is say the keys of a contact.toml, of the whole patch in SI, of which every point
    carries its share.
    """

    interface: Address
    """of a body, `body:interface` where there are several; its frame is the contact's"""
    against: Address = GROUND
    """`ground`, or the other interface"""
    against_sector: Annotated[int, Field(ge=-1000, le=1000)] = 0
    """of a ring: how many sectors further the other body stands"""
    normal_force: NotNegative | None = None
    """[N] where the sweep's forces are not this contact's"""
    interference: Number | None = None
    """[m] or how far the faces overlap at rest; negative: a gap"""
    file: str | None = None
    """a [contact.toml](contact_toml.md) instead of stiffnesses, friction, law and roughness"""
    width: Positive | None = None
    """[m] b_0 along t1; the patch's own if not given"""
    height: Positive | None = None
    """[m] h_0 along t2, likewise"""
    includes: Literal["surface", "bulk+surface"] | None = None
    """which [compliance](contact.md) the stiffnesses count (bulk: the book's E A / l0)"""
    points: Annotated[tuple[Count, Count], BeforeValidator(_tuple)] | None = None
    """how many along t1 and t2; four of Jenkins elements if not given"""
    patch: Literal["rigid", "nodal"] = "rigid"
    """six coordinates, or points that move as the shapes of the bodies say"""
    curvature: Annotated[tuple[Radius, Radius], BeforeValidator(_tuple)] | None = None
    """[m] relative radii along t1 and t2, inf where it is flat (a pin of radius r in a hole of
    radius R: r R / (R - r))"""
    young: Positive | None = None
    """[Pa] E of both bodies, for a curved patch, instead of the stiffnesses"""
    poisson: Annotated[Number, Field(gt=-1, le=0.5)] = 0.3
    """nu of both bodies"""
    fit: Literal["approach", "width", "exact"] = "approach"
    """in what the springs of a curved patch agree with Hertz; `exact`: his own law, of a line of
    contact in pieces or of one round contact"""
    fitted_at: Positive | None = None
    """[N] at which load; if not given the force that presses it: its own, or each of the sweep"""
    isotropic: bool = False
    """geometric mean of both tangential stiffnesses of a curved patch, as the book's mode needs
    it"""
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
    """Frequencies, and the normal forces to compare."""

    start: Positive
    """[Hz] first frequency"""
    stop: Positive
    """[Hz] last one"""
    points: Annotated[int, Field(ge=2, le=200000)] = 600
    """equally spaced"""
    normal_forces: Literal["static"] | Numbers | None = None
    """[N] to compare, in every contact that nothing else presses; `static`: of the body's
    closures"""
    patience: NotNegative = 180.0
    """[s] CPU time for each place where the sweep jumps or has no solution, of motions in time
    (seven tenths of it), the curve about it and its stability; what compiles is not counted;
    0: none of these"""

    @property
    def grid(self) -> Array:
        """(points,) Hz."""
        return np.linspace(self.start, self.stop, self.points)

    @model_validator(mode="after")
    def _rising(self) -> Sweep:
        if self.stop <= self.start:
            raise ValueError("stop must be above start")
        if isinstance(self.normal_forces, tuple) and (not self.normal_forces or min(self.normal_forces) < 0):
            raise ValueError('normal_forces must be one or more numbers, none negative, or "static"')
        return self


class MonitorOfCase(Model):
    """A read-out: a displacement, or a strain gauge."""

    monitor: Address
    """of a body, `body:monitor` where there are several; all drawn, resonances of the first"""
    direction: Literal["x", "y", "z"] = "x"
    """in body axes"""


def _no_ratio(value: Any) -> Any:
    if isinstance(value, int | float):
        raise ValueError('says what damping is of ("modal", "structural", "stuck"); write a number as damping_ratio')
    return value


class CaseSettings(OfFile):
    """A whole case.toml."""

    _path: Path = PrivateAttr(default=Path("case.toml"))

    name: Name
    """names the folder of the products, `build/NAME/`"""
    description: str = ""
    """one line for the report"""
    body: BodyName | None = None
    """the only body, short for one `[[bodies]]`"""
    bodies: Annotated[tuple[BodyOfCase, ...], BeforeValidator(_tuple)] = ()
    ring: RingSettings | None = None
    speed: Annotated[int, Field(ge=0)] = 0
    """of the only body: which speed of its modal file, from 0"""
    speed_rpm: NotNegative | None = None
    """[rpm] or a speed of the file or of its range"""
    modes: Annotated[int, Field(ge=1, le=2000)] | None = None
    """how many of those that the modal file stores"""
    excitation: Address | None = None
    """short for one `[[excitations]]`"""
    amplitude: Number = 1.0
    """[N or Pa] of that excitation"""
    excitations: Annotated[tuple[ExcitationOfCase, ...], BeforeValidator(_tuple)] = ()
    monitor: Address | None = None
    """short for one `[[monitors]]`"""
    direction: Literal["x", "y", "z"] = "x"
    """of that monitor"""
    monitors: Annotated[tuple[MonitorOfCase, ...], BeforeValidator(_tuple)] = ()
    mode: Literal["aft", "book"] = "aft"
    """laws marched in time, or the [book's contact](book_mode.md)"""
    strips: Annotated[int, Field(ge=0, le=1000)] = 0
    """book's mode: into how many strips a patch's roughness makes microslip (5.2-33); 0: none"""
    damping: Annotated[Literal["modal", "structural", "stuck"] | None, BeforeValidator(_no_ratio)] = None
    """[how the ratios are meant](excitation.md#damping): of each body's own modes (the book's),
    as loss factors of the bodies, or of the modes with sticking contacts; if not given,
    `modal` for one body, `structural` for several"""
    damping_ratio: Ratio | Ratios | None = None
    """of the bodies that give none themselves, or of the stuck modes: one, or one a mode, the
    last one for all that follow"""
    harmonics: Literal["auto"] | Annotated[int, Field(ge=1, le=200)] = 3
    """H, besides the mean; `auto`: [as many as the error asks
    for](harmonic_balance.md#how-many-harmonics-how-many-samples)"""
    harmonics_error: Annotated[Positive, Field(le=0.5)] | None = None
    """of `auto`: estimated error of the resonances that is allowed, a share of the amplitude;
    0.01 if not given"""
    samples: Annotated[int, Field(ge=8, le=100000)] | None = None
    """of a cycle; at least four a harmonic; sixteen a harmonic and 48 at least if not given"""
    cycles: Annotated[int, Field(ge=1, le=1000)] = 100
    """marched at most until the sliders are periodic"""
    periodicity: Annotated[NotNegative, Field(le=1e-2)] = 1e-10
    """share of the largest force within which they count as periodic; 0: all cycles are marched"""
    memory_limit: Positive | None = None
    """[GiB] that the points of contact may take, by [an
    estimate](harmonic_balance.md#what-it-costs) before they begin; that of the machine if not
    given"""
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
