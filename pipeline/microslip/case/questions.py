"""What a case may ask beside its sweep: surveys, curves, identification; every key, checked."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from ..settings.numbers import Coefficient, Model, NotNegative, Positive, Ratios, _finite_vector, _tuple
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
