"""Certified modes of one state, its static answers, and the coordinates that a reduction makes of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from ..data import Array, Indices
from ..errors import UserError
from ..linalg import canonical, eigen
from ..mesh import longest_over_shortest
from ..progress import Whole
from ..reduced.coordinates import held
from ..reduction import METHODS, Reduced, Substructure, stuck
from ..settings.body import BodySettings
from ..units import rpm_text
from .body_rows import BodyRows
from .equilibrium import Expandable, StaticState, what_loads
from .floating import Floating, floated, with_rotation
from .preload import pressed_modes
from .prepared import Prepared
from .spectrum import leading_rows, rigid_shift, static_answers
from .unconstrained import refuse_unconstrained_parts, refuse_unresolved


@dataclass(frozen=True)
class Searched:
    """Modes of one pencil, not yet certified, and its static answers while the factors at the shift are there.

    Attributes:
        R: (m, r) mass-orthonormal rigid motions. shift: of the search. found: the modes. B: (r, m) rows on the
        unknowns, named by `labels`. answers: (m, r) displacement under a unit force on each row. stuck: angular
        frequencies with every interface held (`reduction.stuck`). floating: of a free body at speed.
    """

    pencil: eigen.Pencil
    unknowns: Expandable
    R: Array
    shift: float
    found: eigen.Spectrum
    B: sp.csr_matrix
    labels: tuple[str, ...]
    answers: Array
    stuck: Array
    floating: Floating | None = None


@dataclass(frozen=True)
class Solution:
    """Certified modes of one state and the coordinates that the reduction makes of them.

    Attributes:
        found: every mode solved for; the first `kept` were reduced. reduced: shapes on the `unknowns`.
        answers: (m, r) static answers to the rows named by `labels`. static: (r, r) compliance;
            eigenmodes: (r, r) the part of it that the kept eigenmodes alone hold. indicators: see `reduction.stuck`.
        force_labels: names of the interface and load rows that the reduction knows.
    """

    found: eigen.Spectrum
    kept: int
    reduced: Reduced
    answers: Array
    static: Array
    eigenmodes: Array
    unknowns: Expandable
    labels: tuple[str, ...]
    indicators: Mapping[str, float]
    force_labels: tuple[str, ...] = ()


def searched_state(b: Prepared, state: StaticState) -> dict[int, Searched]:
    """Nodal diameter -> modes and static answers about one state, certified if the settings want it.

    Nodal diameters are searched on one factorisation of the interior (those with rigid motions on one of their own),
    then certified together.

    Raises:
        UserError: instability, more modes than degrees of freedom, a part that nothing holds.
        NotConverged: no certificate.
    """
    pencils, found = b.pencils(state.K, state.contacts), []
    first = next(iter(pencils.values()))
    told = f"solver {first.solver.name}"
    if b.sector is None:
        b.report(f"eigenmodes: {first.n} free degrees of freedom, {told}")
    else:
        sectors = b.sector.unknowns.cut.sectors
        b.report(f"{len(pencils)} nodal diameters of {sectors} sectors: {first.n} unknowns, {told}")
    for k, pencil in pencils.items():
        where = "" if b.sector is None else f"nodal diameter {k}"
        if where:
            b.report(f"eigenmodes: {where}")
        pencil.tell, floating = b.report, None
        if b.pressed:
            pencil, R = pressed_modes(b.model, state, pencil, b.centre)
        else:
            pencil, R, floating = floated(b.model, state, pencil, b.unknowns(k), b.floats(k))
        found.append(_searched(b, state, k, pencil, R, where, floating))
        if where and isinstance(b.report, Whole):
            b.report.done += 1
    if b.settings.modes.certify:
        b.report(
            f"certifying the {'spectrum' if b.sector is None else 'spectra'} by the inertia count"
        )
        found = certified(found)
    return dict(zip(pencils, found, strict=True))


def _searched(
    b: Prepared,
    state: StaticState,
    k: int,
    pencil: eigen.Pencil,
    R: Array,
    where: str,
    floating: Floating | None,
) -> Searched:
    """Modes and static answers of one pencil. where: ``nodal diameter 3``, for messages."""
    shift = (
        rigid_shift(b.model) if b.settings.free else 0.0
    )  # a free sector floats while its cut faces are apart
    wanted = b.settings.modes.count
    if wanted > pencil.n - 2:
        raise UserError(
            f"modes.count: {wanted} modes asked for, but the body has only {pencil.n} degrees of freedom; "
            f"ask for {pencil.n - 2} at most, or refine"
        )
    if b.sector is None:
        refuse_unconstrained_parts(b.model, pencil, R.shape[1])
    try:
        found = eigen.search(pencil, wanted, shift, rigid=R if R.shape[1] else None)
    except eigen.Unstable as error:
        raise _divergence(b, state.speed, error.count, where) from error
    refuse_unresolved(pencil, found, R.shape[1])
    return answered(pencil, b.unknowns(k), R, shift, found, b.rows, bool(shift), floating)


def answered(
    pencil: eigen.Pencil, unknowns: Expandable, R: Array, shift: float, found: eigen.Spectrum,
    rows: BodyRows, floats: bool, floating: Floating | None = None,
) -> Searched:  # fmt: skip
    """Modes found, with the static answers of all rows and what sticking interfaces are judged by.

    Args:
        floats: whether the body has rigid motions that nothing holds.
    """
    B, labels = rows.stacked
    B = unknowns.rows(B) if B.shape[0] else sp.csr_matrix((0, pencil.n))
    answers = static_answers(pencil, found, B, R, shift)
    at = [i for i, label in enumerate(labels) if label.startswith("interface:")]
    held = stuck.reference(pencil, found.values, found.vectors, B[at], answers[:, at], floats)
    return Searched(pencil, unknowns, R, shift, found, B, labels, answers, held, floating)


def certified(searched: Sequence[Searched]) -> list[Searched]:
    """All of them certified complete; pencils that share their factors are counted at as few shifts as possible.

    Raises:
        NotConverged: no certificate.
    """
    shifts = shared_shifts([s.found.gap for s in searched])
    done = dict.fromkeys(range(len(searched)), searched[0])
    for i in np.argsort(shifts, kind="stable"):
        s = searched[i]
        at = replace(s.found, upper_shift=shifts[i])
        done[int(i)] = replace(s, found=eigen.certify(s.pencil, at, s.shift))
    return [done[i] for i in range(len(searched))]


def shared_shifts(gaps: Sequence[tuple[float, float]]) -> list[float]:
    """For each gap (low, high) a value inside it, as few different ones as possible (interval stabbing).

    A certificate needs one shift above the last eigenvalue kept and below the next one; nodal diameters whose gaps
    overlap are counted with one factorisation. A twentieth of a gap is kept clear at each end, so that no shift comes
    close to an eigenvalue.
    """
    inner = [(low + 0.05 * (high - low), high - 0.05 * (high - low)) for low, high in gaps]
    chosen = [0.0] * len(inner)
    order = sorted(range(len(inner)), key=lambda i: inner[i][1])
    while order:
        at = inner[order[0]][1]  # the first end: every gap that has begun by then holds it
        together = [i for i in order if inner[i][0] <= at]
        low = max(inner[i][0] for i in together)
        for i in together:
            chosen[i] = 0.5 * (low + at)
        order = [i for i in order if inner[i][0] > at]
    return chosen


def reduced_solution(b: Prepared, s: Searched) -> Solution:
    """The reduction of certified modes and static answers, in one definite form."""
    points = b.model.d.mesh.points
    return reduced_on(canonical.by_place(points), len(points), b.settings, s, b.rows)


def reduced_on(
    place: Indices, n: int, settings: BodySettings, s: Searched, rows: BodyRows
) -> Solution:
    """The same of a body of n points, whose degrees of freedom take precedence in the order `place`."""
    zero = s.R.shape[1]
    static = np.asarray(s.B @ s.answers)
    static = 0.5 * (static + static.conj().T)
    phi = s.unknowns.expand(s.found.vectors, n)
    lead = leading_rows(rows, phi, place)
    vectors = _turned(s, lead(phi))
    phi = s.unknowns.expand(vectors, n)
    vectors = vectors * canonical.signs(lead(phi)[:6] if settings.interfaces else phi[place])
    keep = _band(s.found.values, settings)
    exact = [i for i, label in enumerate(s.labels) if not label.startswith("monitor:")]
    problem = Substructure(
        s.pencil, s.found.values[:keep], vectors[:, :keep], zero, s.B[np.array(exact, dtype=int)],
        tuple(s.labels[i] for i in exact), s.answers[:, exact], settings.modes.certify, s.shift,
    )  # fmt: skip
    reduced = METHODS[settings.reduction](problem)
    plain = held_compliance(np.asarray(s.B @ problem.vectors), METHODS["eigenmodes"](problem))
    T = np.asarray(s.B @ reduced.vectors)
    held = held_compliance(T, reduced, s.labels)
    quality = stuck.indicators(
        settings.reduction, reduced, T, s.labels, static, held, s.stuck, problem.values, zero
    )
    if s.floating is not None:
        reduced = with_rotation(reduced, s.floating, s.pencil)
    return Solution(
        s.found,
        keep,
        reduced,
        s.answers,
        static,
        plain,
        s.unknowns,
        s.labels,
        quality,
        problem.labels,
    )


def _turned(s: Searched, rows: Array) -> Array:
    """(m, k) modes in one definite form; rigid motions that rotation tells apart stay apart."""
    X, values, zero = s.found.vectors, s.found.values, s.R.shape[1]
    if s.floating is None:
        return canonical.turn_clusters(X, values, rows, zero)
    rigid = canonical.turn_clusters(X[:, :zero], s.floating.values, rows[:, :zero])
    return np.hstack([rigid, canonical.turn_clusters(X[:, zero:], values[zero:], rows[:, zero:])])


def without_spares(s: Searched, count: int) -> Searched:
    """The first `count` modes, and those of a cluster that begins among them: as complete as all of them are."""
    keep, gap = eigen.first_gap(s.found.values, count)
    if not keep:
        return s
    fewer = replace(
        s.found, values=s.found.values[:keep], vectors=s.found.vectors[:, :keep], upper_shift=0.5 * sum(gap), gap=gap,
        backward_error=s.found.backward_error[:keep],
    )  # fmt: skip
    return replace(s, found=fewer)


def held_compliance(T: Array, reduced: Reduced, labels: tuple[str, ...] = ()) -> Array:
    """(r, r) static compliance that the coordinates hold over rows T (r, c), see `coordinates.held`.

    Args:
        labels: of the rows, needed where forces are coordinates.
    """
    return held(T, labels, reduced.kind, reduced.K_r, reduced.omega, reduced.to_diagonal)


def _divergence(b: Prepared, speed: float, count: int, where: str) -> UserError:
    if not speed and not b.model.loaded:
        return UserError(
            f"the stiffness has {count} negative eigenvalues although nothing loads the body: its "
            "cells are too thin to be told from rounding (edges up to "
            f"{longest_over_shortest(b.model.d.mesh):.0f} times as long as the shortest of the "
            "cell), or parts of it hang together by a point or an edge only; refine the mesh, "
            "check length_unit or join the parts",
            "mesh",
        )
    remedy = "lower the speed (a rotor above a critical speed, which Coriolis forces alone keep, has no such modes)"
    if b.settings.rotation.prestress == "none" and speed:
        remedy += ', or use rotation.prestress = "nonlinear": without the stiffening by stress frequencies fall to zero'
    elif not speed:
        remedy = "it buckles under what loads it at rest: reduce that, or check the material"
    return UserError(
        f"at {rpm_text(speed)}{where and ', ' + where + ','} {count} "
        f"eigenvalue{'s are' if count > 1 else ' is'} negative: without Coriolis forces the body diverges; {remedy}",
        what_loads(b.model, speed),
    )


def _band(values: Array, settings: BodySettings) -> int:
    """How many modes are kept; of a free body its rigid motions alone, if the band ends below the first elastic one."""
    if settings.modes.max_frequency is None:
        return len(values)
    keep = int(
        np.searchsorted(values, (2 * np.pi * settings.modes.max_frequency) ** 2, side="right")
    )
    if not keep:
        raise UserError(
            f"modes.max_frequency: no mode lies below {settings.modes.max_frequency:g} Hz "
            f"(the first is at {np.sqrt(values[0]) / 2 / np.pi:.6g} Hz); raise it"
        )
    if keep == len(values):
        raise UserError(
            f"modes.count: {len(values)} modes do not reach modes.max_frequency = {settings.modes.max_frequency:g} Hz; "
            "raise modes.count"
        )
    return keep
