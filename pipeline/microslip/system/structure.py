"""Small systems: matrices, and nonlinear elements at their coordinates.

    M q'' + C q' + K q + sum of w_e^T g_e(w_e q) = f(t)

`structure` makes an `Assembly` of them, so that every analysis of bodies with contacts serves them too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import jax
import numpy as np
import scipy.linalg
from pydantic import AfterValidator, BeforeValidator, Field

from ..contact.elements import Polynomial, Stop
from ..contact.friction import Coulomb, Friction, StaticSliding
from ..contact.jenkins import Jenkins
from ..contact.law import Law
from ..contact.normal import Preload
from ..contact.patch import Patch
from ..contact.set_valued import SetValued
from ..data import Array, Compliance, ModalGroup, Rows
from ..errors import UserError
from ..settings.arguments import Text, checked, checked_fields, numbers
from ..settings.mistakes import bounded, unfit
from ..settings.numbers import BEYOND, NotNegative, Number, Positive
from .assembly import Assembly, Contact, ContactFace, Load, Output
from .component import Component
from .ground import Ground

ALONG = {"n": 0, "t1": 1, "t2": 2}


def _numbered(at: Any) -> Any:
    """Numbers of coordinates count from 0; what has more of them, or other ones, is refused where
    these are known."""
    if not np.ndim(at) and not (float(at).is_integer() and at >= 0):
        raise ValueError(f"is {at}; give the number of a coordinate, counted from 0")
    return at


At = Annotated[Any, AfterValidator(_numbered), numbers(0, 1)]
"""Number of a coordinate from 0, or (n,) weights of all."""
Matrix = Annotated[Any, numbers(0, 2)]
Share = Annotated[NotNegative, Field(le=1)]


def _or_rigid(stiffness: Any) -> Any:
    """Infinity passes as any number would."""
    return 1.0 if isinstance(stiffness, float) and stiffness == math.inf else stiffness


def _law(law: Any) -> Any:
    if not isinstance(law, Law):
        raise ValueError("is no law; make the element by polynomial, jenkins, stop, ...")
    return law


def _powers(stiffness: Any) -> Any:
    if not isinstance(stiffness, Mapping):
        raise ValueError("is no table; give it by power, as {3: 0.05} of k u^3")
    whole = all(isinstance(p, int | np.integer) and 1 <= p <= HIGHEST for p in stiffness)
    if not stiffness or not whole:
        raise ValueError(f"has the powers {list(stiffness)}; give one or more whole numbers from 1 to {HIGHEST}")
    if said := next((said for k in stiffness.values() if (said := unfit(k) or np.ndim(k) and "is no number")), ""):
        raise ValueError(f"{said}; give one number for each power")
    return stiffness


HIGHEST = 100
"""Power of a spring: of higher ones 1.1 u and u / 1.1 differ by eight orders of magnitude."""


def _forces(force: Any) -> Any:
    """Amplitudes by coordinate, or of all."""
    values = list(force.values()) if isinstance(force, Mapping) else force
    if isinstance(force, Mapping) and (said := unfit(list(force), ge=0)):
        raise ValueError(f"its coordinates: {said}")
    try:
        at = np.asarray(values)
        at = at.astype(float) if at.dtype.kind == "O" else at
    except (TypeError, ValueError):
        raise ValueError("is no table of numbers; give coordinate: N, as {0: 1.0}") from None
    if said := unfit(at.real) or unfit(at.imag):
        raise ValueError(said)
    if at.ndim != 1:
        raise ValueError("must be one number for each coordinate")
    return force


Force = Annotated[Any, BeforeValidator(_forces)]


def _elements(elements: Any) -> Any:
    if not isinstance(elements, Sequence) or not all(isinstance(e, Element) for e in elements):
        raise ValueError("must be a list of elements, as [ms.jenkins(1.0, 0.5)]")
    return elements


@checked_fields
@dataclass(frozen=True, eq=False)
class Element:
    """A law that acts along one coordinate of a structure.

    Attributes:
        law: of one point; its force acts against the displacement. at: number of a coordinate from 0, or (n,) weights
            of all. to: the same of what its other end is fixed to; None: the ground. along: which of the law's
            directions is used. name: of the element; None: of its kind and number. length: m, about what it has to move
            by for its nonlinearity to show; None: not known. velocity: m/s, by which the ground moves along the
            coordinate: a belt.
    """

    law: Annotated[Law, BeforeValidator(_law)]
    at: At
    to: At | None = None
    along: Literal["n", "t1", "t2"] = "t1"
    name: Text | None = None
    length: Positive | None = None
    velocity: Number = 0.0

    def __post_init__(self) -> None:
        if self.velocity and (self.to is not None or self.along == "n"):
            raise UserError("element: velocity: is that of the ground along t1 or t2; leave out to, or velocity")

    def row(self, count: int) -> Array:
        """(n,) its displacement per unit of n coordinates.

        Raises:
            UserError: no such coordinate, or one that both ends have.
        """
        to = 0.0 if self.to is None else _row(self.to, count, "element: to")
        row = _row(self.at, count, "element: at") - to
        if not row.any():
            raise UserError(f"element: to: {self.to!r} is where its other end is; nothing moves it")
        return row


def _row(at: Any, count: int, key: str) -> Array:
    if np.ndim(at):
        if np.shape(at) != (count,):
            raise UserError(f"{key}: weights of shape {np.shape(at)}; the structure has {count} coordinates")
        return np.asarray(at, dtype=float)
    if not float(at).is_integer() or not 0 <= at < count:
        raise UserError(f"{key}: there is no coordinate {at}; the structure has {count}, counted from 0")
    return np.eye(count)[int(at)]


def _numbers(*values: float) -> Any:
    """Numbers of a law as numpy has them: nothing of jax is called before a law is marched."""
    return np.array(values, dtype=float)


@checked
def polynomial(
    stiffness: Annotated[Mapping[int, float], BeforeValidator(_powers)],
    at: At = 0,
    to: At | None = None,
    name: Text | None = None,
) -> Element:
    """A spring with the force sum of k_p u^p.

    Args:
        stiffness: power p -> k_p, N/m^p: ``{3: 0.05}`` is the spring of Duffing's oscillator. at, to, name: see
            `Element`.

    Raises:
        UserError: no powers, or one that is no whole number from 1 on.
    """
    numbers = _numbers(*(stiffness.get(p, 0.0) for p in range(1, max(stiffness) + 1)))
    return Element(Polynomial(numbers), at, to, name=name)


@checked
def jenkins(
    stiffness: Positive, limit: NotNegative, at: At = 0, to: At | None = None, name: Text | None = None
) -> Element:
    """A Jenkins element: a spring in series with a slider that holds a force limit.

    Args:
        stiffness: N/m. limit: N. at, to, name: see `Element`.

    Raises:
        UserError: a stiffness that is not positive, or a negative limit.
    """
    law = Jenkins(*_numbers(0.0, stiffness, 0.0, limit))
    length = limit / stiffness  # nothing, or beyond all bounds: the element is the slider or the spring alone
    return Element(law, at, to, name=name, length=length if 1 / BEYOND <= length <= BEYOND else None)


@checked
def friction(
    limit: NotNegative, at: At = 0, to: At | None = None, name: Text | None = None, *,
    static: Positive | None = None, velocity: Number = 0.0,
) -> Element:  # fmt: skip
    """Dry friction that holds a force limit and does not yield before it slides: only motions in time can take it.

    Args:
        limit: N. at, to, name: see `Element`. static: N that it holds before it slides, the limit if not given.
            velocity: m/s of the ground, see `Element`.

    Raises:
        UserError: a negative limit, or a static one below it.

    Examples:
        A block on a belt sticks until its spring pulls by 0.3 N, and slips from there to 0.1 N:

        >>> import microslip as ms
        >>> belt = ms.structure(1.0, 1.0, output=0, elements=[ms.friction(0.2, static=0.3, velocity=0.01)])
        >>> found = ms.integrate(belt, 0.2, unit="rad/s", settle=2, keep=2)
        >>> print(f"{found.y.min():.2f} to {found.y.max():.2f} m")
        0.10 to 0.30 m
    """
    one, zero, force = _numbers(1.0, 0.0, limit)
    law: Friction = Coulomb(one)
    if static is not None and static != limit:
        bounded("friction: static", static, ge=limit)
        bounded("friction: limit", limit, gt=0)
        law = StaticSliding(_numbers(static / limit)[0], one)
    return Element(SetValued(law, zero, zero, Preload(force)), at, to, name=name, velocity=velocity)


@checked
def stop(
    stiffness: Annotated[Positive, BeforeValidator(_or_rigid)], gap: Number, at: At = 0, to: At | None = None,
    both: bool = False, name: Text | None = None, restitution: Share = 0.0,
) -> Element:  # fmt: skip
    """A spring that is met beyond a gap and cannot pull.

    Args:
        stiffness: N/m; infinity: a rigid stop, for motions in time only. gap: m. both: whether there is one in the
            other direction too. at, to, name: see `Element`. restitution: of a rigid stop, 0 to 1.

    Raises:
        UserError: a stiffness that is not positive; restitution of a stop that is not rigid; a rigid one on both sides.
    """
    if stiffness == math.inf:
        if both:
            raise UserError("stop: both: a rigid stop has one side; give another at the negative weights for the other")
        law = SetValued(Coulomb(_numbers(0.0)[0]), *_numbers(restitution, gap))
        return Element(law, at, to, "n", name=name)
    if both and gap < 0:
        raise UserError(f"stop: gap: must not be less than 0 of a stop on both sides (it is {gap:g}); correct it")
    if restitution:
        raise UserError("stop: restitution: only a rigid stop has one; give stiffness = math.inf, or a damper")
    return Element(Stop(_numbers(stiffness)[0], _numbers(gap)[0], both), at, to, name=name, length=abs(gap) or None)


@checked
def structure(
    M: Matrix, K: Matrix, C: Matrix | None = None, *, force: Force | None = None, second_force: Force | None = None,
    steady: Force | None = None, elements: Annotated[Sequence[Element], BeforeValidator(_elements)] = (),
    base_acceleration: Annotated[Any, numbers(0, 1)] | None = None,
    output: Annotated[Any, numbers(0, 1)] | None = None, damping_ratio: Annotated[Any, numbers(0, 1, ge=0)] = 0.0,
    name: Text = "structure",
) -> Assembly:  # fmt: skip
    """A structure of matrices with nonlinear elements.

    Args:
        M, K, C: (n, n) mass (kg), stiffness (N/m) and damping (N s/m), or numbers where there is one coordinate. M and
            K are symmetric; C may hold gyroscopic forces, its skew part.
        force: coordinate -> 0-peak amplitude (N) of the harmonic force, or (n,) of all.
        second_force: the same of a force with a second frequency, see `microslip.two_tones`.
        steady: coordinate -> force (N) that does not change, or (n,) of all.
        base_acceleration: 0-peak amplitude (m/s2) of the ground's harmonic acceleration along every coordinate, or (n,)
            along each; displacements, those of springs and elements to the ground too, are then relative to it.
        elements: see `polynomial`, `jenkins`, `stop`, `friction` and `Element`.
        output: coordinates that are read; where a force acts, if not given.
        damping_ratio: of the modes without elements, one for all or one a mode from the lowest, beside C.

    Raises:
        UserError: matrices that are none of a structure, a coordinate that there is not.

    Examples:
        Duffing's oscillator, q'' + 0.05 q' + q + 0.05 q^3 = 0.4 cos(Omega t):

        >>> import microslip as ms
        >>> duffing = ms.structure(1.0, 1.0, 0.05, force={0: 0.4}, elements=[ms.polynomial({3: 0.05})])
    """
    M, K = _matrix(M, "M"), _matrix(K, "K")
    n = len(M)
    C = np.zeros((n, n)) if C is None else _matrix(C, "C")
    for key, A in (("K", K), ("C", C)):
        if A.shape != M.shape:
            raise UserError(f"structure: {key} is {len(A)} x {len(A)} and M is {n} x {n}; give them the same size")
    _check_mass(M)
    if not _symmetric(K):
        raise UserError(
            "structure: K is not symmetric: circulatory forces have no modes that resonances are looked for by; give "
            "its symmetric part, and gyroscopic forces in C"
        )
    C = C + _modal_damping(M, K, damping_ratio)
    f, f_2, f_0 = _force(force, n), _force(second_force, n, "second_force"), _force(steady, n, "steady").real
    f_b = _base(base_acceleration, M)
    driven = np.abs(f) + np.abs(f_2) + np.abs(f_0) + np.abs(f_b)
    read = np.flatnonzero(driven) if output is None else np.atleast_1d(output)
    rows = np.array([_row(i, n, "structure: output") for i in read]).reshape(-1, n)
    watched = [int(i) for i in read]
    nowhere = np.zeros(3)
    group = ModalGroup(
        speed=0.0, omega=np.zeros(n), kind=("normal",) * n, damping_ratio=np.zeros(n), M_r=M, K_r=K, C_r=C,
        G_r=np.zeros((n, n)), phi=np.zeros((0, 3, n)), interfaces={},
        excitations={k: Rows(x[None].conj(), (k,), "m", nowhere)
                     for k, x in (("force", f), ("second", f_2), ("steady", f_0), ("base", f_b))
                     if k in ("force", "steady") or x.any()},
        monitors={"q": Rows(rows, tuple(map(str, watched)), "m", nowhere)}, gauges={},
        compliance=Compliance((), np.zeros((0, 0)), np.zeros((0, 0)), False), stresses={}, u_static=np.zeros((0, 3)),
        checks={},
    )  # fmt: skip
    asked = (("force", f, 1, 1), ("base", f_b, 1, 1), ("second", f_2, 1, 2), ("steady", f_0, 0, 1))
    loads = tuple(Load(name, k, 1.0, h, tone) for k, x, h, tone in asked if x.any())
    outputs = tuple(Output(name, "q", str(i)) for i in watched)
    contacts = _contacts(elements, name, K, np.abs(f) + np.abs(f_2) + np.abs(f_b))
    return Assembly((Component(name, {0: group}),), contacts, loads, outputs)


def _matrix(A: Any, key: str) -> Array:
    A = np.atleast_2d(np.asarray(A, dtype=float))
    if len(A) != A.shape[1]:
        raise UserError(f"structure: {key}: has shape {A.shape}; give a square matrix")
    return A


def _symmetric(A: Array) -> bool:
    return bool(np.abs(A - A.T).max() <= 1e-9 * np.abs(A).max())


def _check_mass(M: Array) -> None:
    if not _symmetric(M):
        raise UserError("structure: M is not symmetric; correct it")
    if np.linalg.eigvalsh(M)[0] <= 1e-14 * np.abs(M).max():
        raise UserError("structure: a coordinate has no mass (M is not positive definite); condense it or give it some")


def _modal_damping(M: Array, K: Array, ratio: float | Sequence[float]) -> Array:
    """C of ratios D: M X diag(2 D omega) X^T M."""
    given = np.atleast_1d(np.asarray(ratio, dtype=float))
    if len(given) > len(M):
        raise UserError(f"structure: damping_ratio: has {len(given)} values; the structure has {len(M)} modes")
    if given.max(initial=0.0) >= 1:
        raise UserError(
            f"structure: damping_ratio: {given.max():g} lets nothing vibrate; a share of critical damping is meant, "
            "5 % is 0.05"
        )
    if not given.any():
        return np.zeros_like(M)
    squares, X = scipy.linalg.eigh(K, M)
    D = np.resize(np.append(given, np.full(len(M), given[-1])), len(M))
    return M @ X @ np.diag(2 * D * np.sqrt(np.maximum(squares, 0.0))) @ X.T @ M


def _force(force: Any, n: int, key: str = "force") -> Array:
    if force is None:
        return np.zeros(n, dtype=complex)
    if isinstance(force, Mapping):
        f = sum(
            (v * _row(i, n, f"structure: {key}").astype(complex) for i, v in force.items()), np.zeros(n, dtype=complex)
        )
    else:
        f = np.atleast_1d(np.asarray(force, dtype=complex))
    if f.shape != (n,):
        raise UserError(f"structure: {key}: has shape {f.shape}; the structure has {n} coordinates")
    return f


def _base(acceleration: Any, M: Array) -> Array:
    """(n,) N, the inertia of ground that accelerates by so much: M r."""
    if acceleration is None:
        return np.zeros(len(M), dtype=complex)
    r = np.asarray(acceleration, dtype=float)
    if np.ndim(r) and len(r) != len(M):
        raise UserError(
            f"structure: base_acceleration: has shape {np.shape(r)}; the structure has {len(M)} coordinates"
        )
    return -(M @ np.broadcast_to(r, len(M))).astype(complex)


def _contacts(elements: Sequence[Element], component: str, K: Array, force: Array) -> tuple[Contact, ...]:
    patches: dict[tuple[Any, ...], Patch] = {}  # equal elements are evaluated together
    found: list[Contact] = []
    for i, e in enumerate(elements, 1):
        row = e.row(len(K))
        shape = np.zeros((1, 3, 1))
        shape[0, ALONG[e.along], 0] = 1.0
        leaves, kind = jax.tree_util.tree_flatten(e.law)
        key = kind, e.along, *((np.shape(x), np.asarray(x).tobytes()) for x in leaves)
        patch = patches.setdefault(key, Patch("element", np.zeros((1, 2)), np.ones(1), e.law, shape))
        own = e.name or f"{_kind(e)} {i}"
        if own in [c.name for c in found]:
            raise UserError(f"structure: elements: two have the name '{own}'; rename one")
        face, zero = ContactFace(component, own, rows={0: row[None]}), np.zeros(1)
        length = e.length or _length(e.law, row, K, force)
        ground = Ground(e.velocity, 0.5 * math.pi * (e.along == "t2")) if e.velocity else None
        found.append(Contact(own, patch, face, None, zero, zero, length=length, ground=ground))
    return tuple(found)


def _kind(e: Element) -> str:
    """What makes such an element."""
    if isinstance(e.law, SetValued):
        return "stop" if e.along == "n" else "friction"
    return type(e.law).__name__.lower()


def _length(law: Law, row: Array, K: Array, force: Array) -> float | None:
    """A tenth of the displacement (m) at which the largest nonlinear part of a polynomial is as large as the force of
    the structure's own stiffness there, or as what drives it where it has none."""
    if not isinstance(law, Polynomial) or not len(law.stiffness) > 1:
        return None
    stiffness, driven = abs(float(row @ K @ row)), float(np.abs(force).max(initial=0.0))
    lengths = []
    for p, k in enumerate(map(abs, np.asarray(law.stiffness).tolist()), 1):
        if p > 1 and k:
            lengths.append((stiffness / k) ** (1 / (p - 1)) if stiffness else (driven / k) ** (1 / p))
    return 0.1 * min(lengths) if lengths and min(lengths) > 0 else None
