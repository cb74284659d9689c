"""What a case may ask beside its sweep: surveys, curves, identification; every key, checked."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from ..settings.numbers import Coefficient, Model, Name, NotNegative, Number, Positive, Ratios, _finite_vector, _tuple
from .keys import Orders, Positives

NotNegatives = Annotated[tuple[NotNegative, ...], BeforeValidator(_finite_vector)]
Pair = Annotated[tuple[NotNegative, NotNegative], BeforeValidator(_finite_vector)]
Ends = Annotated[tuple[Positive, Positive], BeforeValidator(_finite_vector)]


class OrdersOfCase(Model):
    """The largest resonance in the sweep's band for each engine order (Sextro Fig. 5.5-2), by
    `respond --over orders`."""

    engine_orders: Literal["all"] | Orders = "all"
    """`all`: 1 to N/2, half the number of blades"""
    points: Annotated[int, Field(ge=5, le=10000)] | None = None
    """of the sweep that looks for the peaks; the sweep's if not given"""

    @model_validator(mode="after")
    def _some(self) -> OrdersOfCase:
        if self.engine_orders != "all" and (not self.engine_orders or 0 in self.engine_orders):
            raise ValueError('engine_orders: give one or more whole numbers other than 0, or "all"')
        return self


class SpeedsOfCase(Model):
    """Response along an engine-order line, f = e n / 60, by `respond --over speeds`.

    Bodies whose modal files have a speed range take part in the speed, others stay as they are; centrifugal excitations
    (speed_rpm) follow it.
    """

    start_rpm: Positive
    """[rpm] first speed"""
    stop_rpm: Positive
    """[rpm] last one, above or below"""
    points: Annotated[int, Field(ge=2, le=100000)] = 101
    """equally spaced"""
    normal_force: Literal["static"] | NotNegative | Annotated[tuple[Pair, ...], BeforeValidator(_tuple)] | None = None
    """[N] `static`, one, or pairs [rpm, N], straight lines in the square of the speed; the
    sweep's one if not given"""

    @model_validator(mode="after")
    def _rising(self) -> SpeedsOfCase:
        if self.stop_rpm == self.start_rpm:
            raise ValueError("stop_rpm and start_rpm: give two different speeds")
        if isinstance(self.normal_force, tuple):
            rpm = [n for n, _ in self.normal_force]
            if len(rpm) < 2 or rpm != sorted(set(rpm)):
                raise ValueError("normal_force: give two or more pairs [rpm, N], the speeds rising")
        return self


class RangesOfCase(Model):
    """Envelope of the responses over all combinations of these values (Sextro Fig. 5.4-2), by `respond --over ranges`.

    Two values are the ends of a range; give more where the smallest amplitude matters, which may
    lie between them.
    """

    damping_ratio: Ratios = ()
    """of all modes of all bodies, or of the stuck modes with damping = `stuck`"""
    load: NotNegatives = ()
    """factors on the loads that are not steady"""
    friction: Annotated[tuple[Coefficient, ...], BeforeValidator(_finite_vector)] = ()
    """coefficients of all contacts"""
    normal_force: NotNegatives = ()
    """[N] of the contacts that the sweep presses"""

    @model_validator(mode="after")
    def _some(self) -> RangesOfCase:
        if not self.given:
            raise ValueError("give values of damping_ratio, load, friction or normal_force")
        return self

    @property
    def given(self) -> dict[str, tuple[float, ...]]:
        """Name -> values of what varies."""
        return {name: values for name, values in self if values}


class CurveOfCase(Model):
    """Responses followed through folds and lift-off, by `respond --over frequency`, `load` and `normal-force`.

    The first of two values may be the larger one.
    """

    band: Ends | None = None
    """[Hz] first and last frequency; the sweep's start and stop if not given"""
    load: Ends = (0.01, 1.0)
    """first and last factor on the loads that are not steady"""
    normal_force: Pair | None = None
    """[N] first and last, of the contacts that the sweep presses; its smallest and largest if
    not given"""
    frequency: Positive | None = None
    """[Hz] at which load or normal force vary; the highest resonance in the sweep's band if not
    given, at the first normal force where that varies"""
    points: Annotated[int, Field(ge=2, le=1000000)] = 3000
    """of a curve at most"""

    @model_validator(mode="after")
    def _apart(self) -> CurveOfCase:
        for key in ("band", "load", "normal_force"):
            ends = getattr(self, key)
            if ends is not None and ends[0] == ends[1]:
                raise ValueError(f"{key}: give two different values, first and last")
        return self


class MeasuredOfCase(Model):
    """A measured frequency of a mode of a nodal diameter."""

    nodal_diameter: Annotated[int, Field(ge=0, le=500)]
    """of its mode"""
    mode: Annotated[int, Field(ge=1, le=500)] = 1
    """from 1, in the order of the frequencies"""
    frequency: Positive
    """[Hz] measured; of fit it is met, others are predicted"""


class IdentificationOfCase(Model):
    """Contact stiffness from one measured frequency, others predicted (Sextro Fig. 5.4-1), by
    `microslip identify`."""

    fit: MeasuredOfCase
    measured: Annotated[tuple[MeasuredOfCase, ...], BeforeValidator(_tuple)] = ()
    ratio: Positive = 0.5
    """c_T / c_N, kept"""
    stiffnesses: Positives = ()
    """[N/m] c_N of further curves in the diagram"""
    modes: Annotated[int, Field(ge=1, le=100)] = 3
    """how many are drawn"""


def _several(value: object) -> object:
    return _finite_vector([value] if isinstance(value, int | float) and not isinstance(value, bool) else value)


Several = Annotated[tuple[Positive, ...], BeforeValidator(_several, json_schema_input_type=Positive | list[Positive])]


class RunUpOfCase(Model):
    """An excitation whose frequency goes linearly from one to another, up or down.

    start, stop: Hz, of the first harmonic. time: s, from one to the other. engine_order: of the first harmonic; the
    rotation speed is the frequency over it, and centrifugal excitations (speed_rpm) follow its square. euler: bodies
    that turn with it and feel its change as a load in their frame.
    """

    start: Positive
    stop: Positive
    time: Positive
    engine_order: Annotated[int, Field(ge=1, le=1000)] = 1
    euler: Annotated[tuple[str, ...], BeforeValidator(_tuple)] = ()

    @model_validator(mode="after")
    def _apart(self) -> RunUpOfCase:
        if self.start == self.stop:
            raise ValueError("start and stop: give two different frequencies")
        return self


class ReleaseOfCase(Model):
    """Where the bodies of a motion in time are let go.

    displacement: of the coordinates of all bodies, those of their modes, one body after the other. velocity: of them.
    mode: number of a mode of the bodies without their contacts. amplitude: of the first monitor in it.
    """

    displacement: Annotated[tuple[Number, ...], BeforeValidator(_finite_vector)] | None = None
    velocity: Annotated[tuple[Number, ...], BeforeValidator(_finite_vector)] | None = None
    mode: Annotated[int, Field(ge=1)] | None = None
    amplitude: Number | None = None


class OrbitOfCase(Model):
    """The motion in time from a start, by `microslip orbit`.

    frequency: Hz, or Omega: rad/s, of the first harmonic of the excitations: one, or several to look at one after the
    other; or run_up, all of which is kept, in samples and steps of a period of its highest frequency. settle: periods
    that are left to themselves. keep: periods that are kept. samples: of each. steps: of each, if not given as many as
    the fastest motion with closed contacts needs. start: at rest, ``static`` under the steady
    loads, ``rest`` as preloaded; or ``balance``, on the vibration that harmonic balance finds with the case's
    harmonics. release: where the bodies are let go, instead of start. normal_force: N, of the
    contacts that the sweep presses.
    """

    frequency: Several | None = None
    Omega: Several | None = None
    run_up: RunUpOfCase | None = None
    settle: Annotated[int, Field(ge=0, le=1000000)] = 300
    keep: Annotated[int, Field(ge=1, le=100000)] = 40
    samples: Annotated[int, Field(ge=8, le=8192)] = 256
    steps: Annotated[int, Field(ge=1, le=100000000)] | None = None
    start: Literal["static", "rest", "balance"] = "static"
    release: ReleaseOfCase | None = None
    normal_force: NotNegative | None = None

    @model_validator(mode="after")
    def _one_of_both(self) -> OrbitOfCase:
        if sum(map(bool, (self.frequency, self.Omega, self.run_up))) != 1:
            raise ValueError("frequency: give frequency (Hz) or Omega (rad/s), one or more of them, or run_up")
        if self.run_up and (wrong := sorted(self.model_fields_set & {"settle", "keep"})):
            raise ValueError(f"{wrong[0]}: a run-up is kept from its beginning to its end; leave it out")
        if self.release is not None and "start" in self.model_fields_set:
            raise ValueError("release: gives the start; leave start out, or release")
        if self.run_up and self.start == "balance":
            raise ValueError('start: a run-up begins at rest; write "static" or "rest"')
        return self

    @property
    def hertz(self) -> tuple[float, ...]:
        return self.frequency or tuple(w / (2 * math.pi) for w in self.Omega or ())


class ScatterOfCase(Model):
    """What differs from sector to sector of a ring.

    of: ``frequency`` or ``damping`` of a body's modes, its ``mass``, ``added_mass`` (kg) at a monitor, ``modal_file``;
    ``normal_force``, ``gap`` (m), ``friction`` or ``stiffness`` of a contact. deviation: standard deviation, a share of
    the nominal value or in kg or m. distribution: of it; the median of ``lognormal`` is nominal. values: deviations
    that are known, repeated round the ring; file: a .csv with the column ``deviation``, or ``frequency_Hz`` whose mean
    is nominal; others: sector -> modal file beside the case. arrangement: of them, as ``given``, ``shuffled`` or
    ``drawn`` in every sample. body, contact: whose, its interface. at: monitor of added_mass. together: correlation of
    the modes of a body, 0 each alone. neighbours: correlation from a sector to the next one.
    """

    of: Literal[
        "frequency", "damping", "mass", "added_mass", "modal_file", "normal_force", "gap", "friction", "stiffness"
    ]
    deviation: NotNegative = 0.0
    distribution: Literal["normal", "lognormal", "uniform"] = "normal"
    values: Annotated[tuple[Number, ...], BeforeValidator(_finite_vector)] = ()
    file: str | None = None
    others: dict[str, str] = {}
    arrangement: Literal["given", "shuffled", "drawn"] = "given"
    body: str | None = None
    contact: str | None = None
    at: str | None = None
    together: Annotated[Number, Field(ge=0, le=1)] = 1.0
    neighbours: Annotated[Number, Field(ge=-1, le=1)] = 0.0

    @model_validator(mode="after")
    def _one_of_three(self) -> ScatterOfCase:
        if (self.of == "modal_file") != bool(self.others):
            raise ValueError("others: belong to modal_file, which needs them; give { 3 = 'repaired.h5' }")
        given = sum(map(bool, (self.deviation, self.values, self.file, self.others)))
        if not given:
            raise ValueError("deviation: nothing scatters; give one above zero, or values or a file of known ones")
        if given > 1:
            raise ValueError("deviation: give one of deviation, values, file and others")
        if bad := [key for key in self.others if not key.isdecimal()]:
            raise ValueError(f"others.{bad[0]}: is no sector; count them from 0")
        return self


class MistuningOfCase(Model):
    """Samples of the whole ring with sectors that differ, by `microslip mistune`.

    scatter: what differs. samples: at most. until: a run ends when the interval of the 95 % quantile is as narrow, half
    of it over the quantile. rare: further samples, chosen by a linear ring, for the 99.9 % quantile. seed: of all
    random numbers. stuck: contacts stick, which is linear. normal_force: N, of
    the contacts that the sweep presses; the smallest of the sweep if not given.
    """

    scatter: Annotated[tuple[ScatterOfCase, ...], BeforeValidator(_tuple), Field(min_length=1)]
    samples: Annotated[int, Field(ge=1, le=100000000)] = 100
    until: Annotated[Positive, Field(le=1)] | None = None
    rare: Annotated[int, Field(ge=0, le=1000000)] = 0
    seed: Annotated[int, Field(ge=0)] = 0
    stuck: bool = False
    normal_force: NotNegative | None = None


class Over(Model):
    """A parameter of a map: keys of this case, dotted, which follow it, each with the factor that makes its value.

    parameter: what its axis says, in unit. start, stop: its first and last value. points: of them, evenly spaced.
    """

    parameter: str
    unit: str = ""
    keys: dict[str, Number]
    start: Number
    stop: Number
    points: Annotated[int, Field(ge=2, le=1000)] = 40

    @model_validator(mode="after")
    def _somewhere(self) -> Over:
        if self.start >= self.stop:
            raise ValueError("stop: must be above start; exchange them")
        if not self.keys:
            raise ValueError("keys: name one or more keys of the case that follow the parameter, with a factor each")
        return self


class Across(Over):
    """A second parameter, at whose values limit cycles are followed as well, with so many harmonics."""

    points: Annotated[int, Field(ge=2, le=1000)] = 5
    harmonics: Annotated[int, Field(ge=1, le=200)] = 5


class Cycle(Over):
    """A parameter over which the limit cycles born at Hopf points are followed, with so many harmonics.

    points: of a branch at most. accuracy: share of the amplitude to which three of its orbits are refined, that are
    compared with a motion in time. across: a second parameter, at whose values they are followed as well.
    """

    harmonics: Annotated[int, Field(ge=1, le=200)] = 7
    accuracy: Annotated[Positive, Field(le=0.1)] = 1e-4
    across: Across | None = None


class StabilityOfCase(Model):
    """Roots of the assembly about its steady sliding, by `microslip stability`: all that grow, and those of a window.

    frequency: Hz and growth: 1/s, from and to, of the window. accuracy, neutral: as of a body's [stability]. over: two
    parameters of a map of how many roots grow, and how fast the fastest. full: states of the map, evenly spread, at
    which the unreduced matrices are counted as well. cycle: the limit cycles that follow.
    """

    growth: Annotated[tuple[Number, Number], BeforeValidator(_finite_vector)] = (-1000.0, 10000.0)
    frequency: Pair
    accuracy: Annotated[Number, Field(ge=0, le=0.1)] = 1e-8
    neutral: NotNegative = 0.0
    over: Annotated[tuple[Over, ...], BeforeValidator(_tuple)] = ()
    full: Annotated[int, Field(ge=0, le=1000)] = 0
    cycle: Cycle | None = None

    @model_validator(mode="after")
    def _has_area(self) -> StabilityOfCase:
        for key in ("growth", "frequency"):
            low, high = getattr(self, key)
            if low >= high:
                raise ValueError(f"{key}: from {low:g} to {high:g} the window has no area; give the smaller one first")
        if len(self.over) not in (0, 2):
            raise ValueError("over: a map has two parameters; give two [[stability.over]], or none")
        return self


class BifurcationOfCase(Model):
    """A diagram of equilibria and periodic orbits over a parameter, by `microslip bifurcate`.

    name: of its files. parameter: what its axis says, in unit. keys: of this case, dotted, which follow the parameter,
    each with the factor that makes its value of it; those that begin with ``system.`` are keys of the system.toml.
    fixed: other keys and their values, of this diagram alone. start, stop: of the parameter. orbits: whether those born
    at Hopf points are followed, doublings: how often from an orbit to the one of twice its period. attractors: values
    of the parameter at which `starts` motions, drawn from `seed`, are left to themselves, to find what they lead to.
    deflate: values at which orbits are looked for beside what is known. nodes: of an orbit, doubled with its period.
    step: the longest, a share of start to stop. points: of a branch.
    frequency: Hz of the first harmonic of the excitations, where there are any.
    """

    name: Name
    parameter: str
    unit: str = ""
    keys: dict[str, Number]
    fixed: dict[str, Number] = {}
    start: Number
    stop: Number
    orbits: bool = True
    doublings: Annotated[int, Field(ge=0, le=8)] = 1
    attractors: Annotated[tuple[Number, ...], BeforeValidator(_finite_vector)] = ()
    starts: Annotated[int, Field(ge=1, le=10000)] = 64
    seed: Annotated[int, Field(ge=0)] = 0
    deflate: Annotated[tuple[Number, ...], BeforeValidator(_finite_vector)] = ()
    nodes: Annotated[int, Field(ge=4, le=1024)] = 32
    step: Annotated[Positive, Field(le=0.5)] = 0.08
    points: Annotated[int, Field(ge=2, le=100000)] = 400
    frequency: Positive | None = None

    @model_validator(mode="after")
    def _somewhere(self) -> BifurcationOfCase:
        if self.start == self.stop:
            raise ValueError("stop: is the start; give two different values of the parameter")
        if not self.keys:
            raise ValueError("keys: name one or more keys of the case that follow the parameter, with a factor each")
        low, high = sorted((self.start, self.stop))
        for key in ("attractors", "deflate"):
            for value in getattr(self, key):
                if not low <= value <= high:
                    raise ValueError(f"{key}: {value:g} is not between start and stop; take values of the diagram")
        return self
