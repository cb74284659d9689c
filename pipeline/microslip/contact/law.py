"""What every contact law is: settings as leaves, an explicit state, one step; and how a path is marched through it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields, is_dataclass
from functools import partial
from typing import Any, ClassVar, NamedTuple, TypeVar, dataclass_transform

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from ..process import prepare
from ..programs import inner, program
from ..settings.mistakes import bounded


@partial(program, static_argnames="what")
def _values(made: Any, what: str, x: Array) -> Array:
    return getattr(made, what)(x)


def values(made: Any, what: str, x: ArrayLike) -> np.ndarray:
    """A method of heights, or of a normal law, that are the same everywhere, at approaches of any shape.

    One program for as many approaches as the next power of two: it is not compiled, operation by operation, for each
    shape.
    """
    x = np.asarray(x, dtype=float)
    padded = np.zeros(1 << max(x.size - 1, 1023).bit_length())
    padded[: x.size] = x.ravel()
    return np.array(_values(made, what, padded))[: x.size].reshape(x.shape)


Array = jax.Array
"""A jax array of doubles; one value or one per point where a setting is meant."""

Scalar = Array | float
"""A number, or an array as above."""

State = Any
"""A pytree of arrays whose last axis counts the points: the tangents of many points are then computed side by side."""

T = TypeVar("T")


def static(**options: Any) -> Any:
    """A field that is part of the program and not a number: changing it compiles anew."""
    return field(metadata={"static": True}, **options)


def value(x: ArrayLike) -> Array:
    """A number of a law."""
    prepare()
    return jnp.asarray(x, dtype=float)


def number(gt: float | None = None, ge: float | None = None, le: float | None = None, **options: Any) -> Any:
    """A field of numbers that are finite and within bounds wherever a person gives them (`mistakes.bounded`)."""
    return field(metadata={"bounds": (gt, ge, le)}, **options)


def table(gt: float | None = None, ge: float | None = None, le: float | None = None, **options: Any) -> Any:
    """A `number` that holds a table: (k,) the same for all points, or (n, k) with one for each, however long k is."""
    return field(metadata={"table": True, "bounds": (gt, ge, le)}, **options)


@dataclass_transform(frozen_default=True, field_specifiers=(static, number, table))
def settings(cls: type[T]) -> type[T]:
    """Class decorator: a frozen dataclass that is a jax pytree. Its numbers are leaves; see `static` for the rest.

    What a person makes is checked against the bounds of its fields, what jax makes of leaves is not: a derivative with
    respect to a law has its form, and any sign.
    """
    if not hasattr(cls, "__post_init__"):
        cls.__post_init__ = _check_bounds  # type: ignore[attr-defined]
    frozen: Any = dataclass(frozen=True)(cls)
    leaves, words = ([f.name for f in fields(frozen) if f.metadata.get("static", False) is s] for s in (False, True))
    keys = [jax.tree_util.GetAttrKey(name) for name in leaves]

    def apart(made: Any) -> tuple[list[Any], tuple[Any, ...]]:
        return [getattr(made, name) for name in leaves], tuple(getattr(made, name) for name in words)

    def keyed(made: Any) -> tuple[list[Any], tuple[Any, ...]]:
        values, rest = apart(made)
        return list(zip(keys, values, strict=True)), rest

    def together(rest: tuple[Any, ...], values: Iterable[Any]) -> Any:
        made = object.__new__(frozen)
        made.__dict__.update(zip(leaves + words, (*values, *rest), strict=True))
        return made

    def pickled(made: Any) -> tuple[Any, ...]:
        plain = {k: np.asarray(v) if isinstance(v, jax.Array) else v for k, v in vars(made).items()}
        return _unpickled, (cls, plain, [k for k, v in vars(made).items() if isinstance(v, jax.Array)])

    jax.tree_util.register_pytree_with_keys(frozen, keyed, together, apart)
    frozen.__reduce__ = pickled
    return frozen


def _unpickled(cls: type[Any], values: dict[str, Any], arrays: list[str]) -> Any:
    """A law in another process, whose jax may not have computed yet: it would take doubles as single numbers."""
    prepare()
    made = object.__new__(cls)
    made.__dict__.update(values | {name: jnp.asarray(values[name]) for name in arrays})
    return made


def _check_bounds(made: Any) -> None:
    """Raise `UserError` for the first number out of its bounds; what is traced has no value yet."""
    for f in fields(made):
        value = getattr(made, f.name)
        if "bounds" in f.metadata and isinstance(value, _KNOWN) and not isinstance(value, jax.core.Tracer):
            bounded(f"{type(made).__name__}.{f.name}", value, *f.metadata["bounds"])


_KNOWN = (int, float, np.number, np.ndarray, jax.Array)


def point_axes(law: Any, n: int) -> list[int | None]:
    """The axis of n points in every leaf of a law, in the order of its leaves; None where there is one for all."""
    if not is_dataclass(law):
        leaves = jax.tree_util.tree_leaves(law)
        return [-1 if jnp.ndim(x) > 0 and jnp.shape(x)[-1] == n else None for x in leaves]
    axes: list[int | None] = []
    for f in fields(law):
        value = getattr(law, f.name)
        if f.metadata.get("table") and value is not None:
            axes.append(0 if jnp.ndim(value) > 1 else None)
        elif not f.metadata.get("static"):
            axes += point_axes(value, n)
    return axes


class Step(NamedTuple):
    """A step of n points as `Law.lost` looks back on it.

    Attributes:
        u: (n, 3) m at its end. moved: (n, 3) m. dt: s. force_before, force: (n, 3) N at its beginning and end. before,
            after: states there.
    """

    u: Array
    moved: Array
    dt: Scalar
    force_before: Array
    force: Array
    before: State
    after: State


class SolvableMemory:
    """Of laws whose next step depends on all steps before by two things alone: the place (u, v) where the last one
    ended, and forces of springs, each behind a slider that knows of no other: the memory, (..., 2, n) N along t1, t2.

    The periodic memory is then solved for (`periodic`); of other laws cycles are marched until they repeat. The steps
    of a cycle are taken apart: what their places decide, `way`, is computed for all samples at once, and what goes from
    sample to sample is `drag`. With both left as they are a law works too, more slowly.
    """

    def memory(self, force: Array, state: State) -> Array:
        """(..., n) forces in N that come back with the cycle once it is periodic, and that the next one depends on.

        All of them, however many parts a contact has; not what grows from cycle to cycle, as the path slid. The
        default, the force (n, 3), will do where nothing else is remembered. With `recalled` it is (..., 2, n), and
        made of the state alone.
        """
        return force.T

    def recalled(self, state: State, memory: Array) -> State | None:
        """The state with another memory, linear in both; None (the default): it cannot be solved for."""
        return None

    def way(self, u: Array, v: Array, dt: Scalar, state: State) -> Any:
        """All that `drag` needs of a step that ends at u, v, beside the memory: a pytree, for instance pressed force,
        stiffness times displacement, and what friction holds at both ends.

        Args:
            state: that in which a single step from rest to the place where the step before ended leaves the points.
                Only what the place decides may be read of it (where it is, the share of the area, what friction holds
                there): neither the memory nor what adds up on the way, as time and path slid.
        """
        return u, v, dt, state

    def drag(self, way: Any, memory: Array) -> tuple[Array, Array]:
        """(3, n) force in N and the memory at the end of a step, from its `way` and the memory at its beginning: the
        same as those of `Law.step` from `recalled`."""
        u, v, dt, state = way
        force, after = self.step(u, v, dt, self.recalled(state, memory))  # type: ignore[attr-defined]
        return force.T, self.memory(force, after)


class DifferentialForm:
    """Of laws that can be written as a differential equation: for integrators that choose their own steps.

    Attributes:
        smooth: whether `rates` has a slope everywhere, so that it can be linearised wherever it is.
    """

    smooth: ClassVar[bool] = False

    @property
    def remembers(self) -> int | None:
        """k numbers of a point in the differential equation, see `rates`; None, the default: the law has none."""
        return None

    def rates(self, u: Array, v: Array, x: Array, time: Scalar, lag: float) -> tuple[Array, Array]:
        """The force, and how what is remembered changes.

        Args:
            u: (n, 3) m. v: (n, 3) m/s. x: (k, n) what it remembers, zero at first. time: s.
            lag: s, of the damper (stiffness times lag) that is put beside springs with a slider and without one, lest
                integrators meet a jump wherever it begins to slide or to stick.

        Returns:
            (n, 3) force in N and (k, n) the time derivative of x.
        """
        raise NotImplementedError

    @property
    def follows(self) -> float:
        """s, in which what the differential equation remembers follows the motion; inf: it remembers nothing; 0, the
        default: at once, with jumps of its rate, or it is known by its steps alone."""
        return 0.0


class Braking:
    """Of laws whose friction changes so fast with the velocity that a motion in time needs `slowed`.

    Attributes:
        brakes: whether it is one.
    """

    brakes: ClassVar[bool] = False

    def slowed(self, u: Array, v: Array, dt: Scalar, state: State, yielding: Array) -> Array:
        """(n, 3) velocities in m/s that are left of v when friction brakes points which yield by (n,) m/s per N:
        v_t = left_t + yielding F_t(left), with the normal velocity as it is. The default leaves v: friction follows the
        displacement."""
        return v


class Law(SolvableMemory, DifferentialForm, Braking):
    """Base of the contact laws. An author writes `init`, `step`, `limit`, `slip`, `stored` and `lost`.

    What solvers can use besides has defaults: the three classes above, and what a patch asks below.

    A setting is one number or has the points along its last axis, in the order of the rows of ``u``; a table is a
    field of its own kind, see `table`, or has a last axis of length one. States have the points along their last axis.

    Frame (n, t1, t2) of the contact. ``u`` (n, 3) is the relative displacement in m, u_n > 0 closing, measured from
    the gap at which the highest asperities just touch; ``v`` (n, 3) its velocity in m/s. The force (n, 3) in N is
    what has to act on the contact to move it so: the normal entry is compressive and not negative, and the work of a
    closed cycle, the integral of force . du, is the energy the contact dissipates.

    Attributes:
        NEEDED: methods without which no law is solved.
    """

    NEEDED: ClassVar[tuple[str, ...]] = ("init", "step", "limit", "slip", "stored")

    def __init_subclass__(cls, **more: Any) -> None:
        """A class with a step of its own alone has not the way of the class that it is made from."""
        super().__init_subclass__(**more)
        if "step" in vars(cls) and "way" not in vars(cls):
            cls.way, cls.drag = Law.way, Law.drag  # type: ignore[method-assign]

    def init(self, n: int) -> State:
        """State of n points that were never loaded, at u = 0."""
        raise NotImplementedError

    def step(self, u: Array, v: Array, dt: Scalar, state: State) -> tuple[Array, State]:
        """Force at the end of a step that ends at ``u`` with velocity ``v``, and the state there.

        Args:
            u: (n, 3) m. v: (n, 3) m/s at its end, in harmonic balance the exact derivative of the harmonics; what
                slides in the step, over dt, is its displacement's: a path slid must be whole. dt: length of the
                step, s. state: at its beginning.
        """
        raise NotImplementedError

    def limit(self, force: Array, state: State) -> Array:
        """(n,) largest tangential force in N that goes with a normal force; ``force`` (n, 3) N."""
        raise NotImplementedError

    def slip(self, state: State) -> Array:
        """(n, 2) path slid so far along t1 and t2, m (the mean over the contact where only a part of it slides)."""
        raise NotImplementedError

    def stored(self, u: Array, state: State) -> Array:
        """(n,) energy in J that an unloading can give back at most."""
        raise NotImplementedError

    def lost(self, step: Step) -> Array:
        """(n,) energy in J that a step takes for good, counted where it goes: friction times the path slid, dampers,
        stretched area that opens.

        Over a closed cycle it is the work done on the contact, but for the second order of the steps: the balance of
        every solution is checked by that. NaN, the default: the law does not count it, and nothing is checked.
        """
        return jnp.full(step.u.shape[0], jnp.nan)

    @property
    def viscous(self) -> bool:
        """Whether `step` reads the velocity: where the memory is solved for, tangents along it are then computed
        too. The default, and of laws that march: it may."""
        return True

    # what a patch asks -----------------------------------------------------------------------------------------------

    def pressed(self, approach: Array) -> Array:
        """(n,) N by which an approach (n,) m presses, come to straight from u = 0 and at rest."""
        path = jnp.stack([approach, jnp.zeros_like(approach), jnp.zeros_like(approach)], axis=1)
        return self.step(path, jnp.zeros_like(path), 1.0, self.init(len(approach)))[0][:, 0]

    def overlap(self, u: Array) -> Array:
        """(n,) m by which points at ``u`` (n, 3) are past their first touch. Below zero they hold no force and remember
        nothing, and no way of that length closes them. NaN, the default: they never open, or it is not known."""
        return jnp.full(u.shape[0], jnp.nan)

    def scaled(self, share: Array) -> Law | None:
        """The law of points that carry shares of the whole contact, in numbers of its own; None, the default: it is
        shared out by `portion.Portion`, as any law can be."""
        return None

    def given(self, step: Step) -> Array:
        """(n,) J that what the contact touches gives it in a step, where that moves; the default: it does not."""
        return jnp.zeros(step.u.shape[0])


@settings
class History:
    """A marched path of s samples and n points.

    Attributes:
        force: (s, n, 3) N. slip: (s, n, 2) m. dissipated: (s, n) J since the beginning: work done on the contact
            less the energy it stores. state: at the end.
    """

    force: Array
    slip: Array
    dissipated: Array
    state: State


@inner
def stepped(law: Law, u: Array, v: Array, dt: Scalar, state: State) -> tuple[Array, State]:
    """`Law.step`, which python reads once for all its uses."""
    return law.step(u, v, dt, state)


def velocities(u: Array, dt: Scalar, before: Array | None = None) -> Array:
    """Backward differences of a path u (s, n, 3) that starts from ``before`` (n, 3), m/s; without it the first one is
    that of the second sample."""
    if before is None:
        before = 2 * u[0] - u[1] if len(u) > 1 else u[0]
    return jnp.diff(jnp.concatenate([before[None], u]), axis=0) / dt


def march(law: Law, u: Array, dt: Scalar, state: State, v: Array | None = None) -> tuple[Array, State]:
    """Forces along a path: ``lax.scan`` over `Law.step`.

    Args:
        u: (s, n, 3) displacements after each step, m. dt: s. state: at the beginning. v: (s, n, 3) m/s; `velocities`
            if not given.

    Returns:
        (s, n, 3) forces in N and the state at the end.
    """

    def sample(carried: State, place: tuple[Array, Array]) -> tuple[State, Array]:
        force, after = stepped(law, *place, dt, carried)
        return after, force

    state, force = jax.lax.scan(sample, state, (u, velocities(u, dt) if v is None else v))
    return force, state


@inner
def history(law: Law, u: Array, dt: Scalar) -> History:
    """Forces, slip path and dissipated energy of a prescribed motion u (s, n, 3) in m, steps of dt seconds.

    The work of a step is that of its mean force, the trapezoidal rule. It is counted from the first sample, to which
    an unloaded contact is taken in one step, straight from u = 0.
    """

    def one(carried: tuple[State, Array, Array, Array], sample: tuple[Array, Array]) -> tuple[Any, tuple[Array, ...]]:
        state, before, force_before, work = carried
        force, state = law.step(*sample, dt, state)
        work = work + 0.5 * jnp.sum((force + force_before) * (sample[0] - before), axis=-1)
        return (state, sample[0], force, work), (force, law.slip(state), work - law.stored(sample[0], state))

    # no way to the first, and no work
    start = (law.init(u.shape[1]), u[0], jnp.zeros_like(u[0]), jnp.zeros(u.shape[1]))
    (after, *_), (force, slip, lost) = jax.lax.scan(one, start, (u, velocities(u, dt)))
    return History(force, slip, lost - lost[0], after)


def bisected(excess: Callable[[Array], Array], low: Array, high: Array, halvings: int) -> Array:
    """(n,) middle of intervals that are halved so often, where a function changes to more than zero."""

    def halve(_: int, ends: tuple[Array, Array]) -> tuple[Array, Array]:
        low, high = ends
        middle = 0.5 * (low + high)
        above = excess(middle) > 0
        return jnp.where(above, low, middle), jnp.where(above, middle, high)

    low, high = jax.lax.fori_loop(0, halvings, halve, (low, high))
    return 0.5 * (low + high)


def root(value: Array) -> Array:
    """Square root whose derivative at zero is zero, not infinite."""
    positive = value > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, value, 1.0)), 0.0)


def norm(vectors: Array) -> Array:
    """Length of vectors along the first axis, differentiable at zero."""
    return root(jnp.sum(vectors**2, axis=0))


def ratio(above: Array, below: Array, otherwise: float = 0.0) -> Array:
    """above / below, and ``otherwise`` where ``below`` is not positive, without a division there."""
    positive = below > 0
    return jnp.where(positive, above / jnp.where(positive, below, 1.0), otherwise)


@dataclass(frozen=True)
class Example:
    """A law with scales for trying it.

    Attributes:
        law: for any number of points. normal, tangential: displacements in m at which it shows what it does.
        period: of a cycle, s. isotropic: whether turning the tangents turns the force. gap: m, beyond u_n = 0, at
            which the contact is open for certain. inertia: share of the largest force by which a mass may carry the
            tangential force beyond what friction holds. jumps: whether friction falls with the speed, so that the force
            jumps in time and depends on rounding where two roots meet.
    """

    law: Law
    normal: float
    tangential: float
    period: float = 0.01
    isotropic: bool = True
    gap: float = 0.0
    inertia: float = 0.0
    jumps: bool = False
