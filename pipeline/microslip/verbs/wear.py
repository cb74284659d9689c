"""Wear of the contacts by the vibration of a case, which changes with them: resonance, damping,
amplitude, stress, contact area and worn depth over hours."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import chain, cycle
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from pydantic import Field
from scipy.optimize import brentq

from ..analysis import Analysis, Answer, Drawing, Question
from ..case.assemble import Built
from ..case.problem import balanced, forces_of, pressed_by
from ..case.settings import CaseSettings
from ..contact.curved import apart
from ..contact.heights import Tabulated, as_table, summed
from ..contact.law import Law
from ..contact.normal import Gapped, Rough
from ..contact.patch import pressing
from ..contact.point import OnNormal
from ..contact.portion import Portion
from ..contact.wear import worn_law
from ..data import Array
from ..errors import NotConverged, UserError
from ..harmonic_balance.envelope import motion_of_read
from ..harmonic_balance.peak import highest
from ..harmonic_balance.problem import Problem, moves_by
from ..harmonic_balance.readout import climbed, measured
from ..harmonic_balance.response import judged, operating, traced
from ..harmonic_balance.solver import CONVERGED, Point
from ..harmonic_balance.solver import solve as solved
from ..operating.contact_maps import grid_of, on_grid
from ..operating.stress import stress_peaks
from ..pictures.plots import COLOURS, plain_axes
from ..results.dataset import Dataset, Variable
from ..results.journal import once
from ..settings.numbers import Model, NotNegative, Positive
from ..system.assembly import Assembly, Contact
from ..units import METRES, Quantity, counted, percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HOUR = 3600.0
"""s."""

FAR = 1.0
"""m by which no two faces come nearer."""

SHORTEST = 1e-6
"""Share of a jump that it is not shortened below."""

PANELS, COLUMNS = 6, 3
"""Contacts whose worn depth is drawn, the deepest first, and how many beside each other."""

EVEN = 0.95
"""Share of the largest depth from which on the colours of a patch begin at nothing."""


class Keys(Model):
    """Wear of the contacts by the vibration, by `microslip wear`."""

    coefficient: Positive
    """[m3/J] I_W: volume that both faces of a contact lose together, over their frictional work"""
    hours: Positive
    """[h] of vibration"""
    frequency: Positive | None = None
    """[Hz] of the vibration; the highest resonance in the sweep's band if not given, followed as it moves"""
    normal_force: NotNegative | None = None
    """[N] instead of all those of the sweep"""
    tolerance: Annotated[Positive, Field(le=0.2)] = 0.01
    """of the largest depth, by which a jump in time may differ from one of first order"""
    jumps: Annotated[int, Field(ge=1, le=100000)] = 1000
    """in time, at most"""


def solve(q: Question) -> Answer:
    """A course under every normal force; whole if each reaches the hours.

    A point that slides gets deeper by I_W times its frictional work over its area (Sextro Eqs.
    (3.9-3) to (3.9-6)), the work of a cycle of the vibration times the cycles of a jump: its faces
    begin to touch so much later. Of a rough surface the heights wear, the highest first (3.9-8,
    `contact.wear.worn_law`).

    What presses stays. Under a normal force, of the contact or of the sweep, the faces come nearer
    as they wear: the total remains, and the points that are less worn take it over; they tilt and
    bend as far as the bodies yield. Under steady loads the balance of the bodies says the same.
    Bodies that overlap (interference) stay where they are: what is worn off is lost to the
    preload, but for what they spring back.
    """
    asked: Keys = q.asked
    built: Built = q.built
    courses = dict[float, Course]()
    for force in forces_of(built, asked.normal_force):
        wearing = Wearing(built.pressed(force), built.settings, asked.coefficient)
        pressed = pressed_by(built, wearing.problem(wearing.new)) if force is None else force
        kept = partial(once, q.kept, f"normal force {pressed!r} N")
        courses[pressed] = _course(wearing, asked, kept, q.report)
    of = measured(built.assembly)
    over, depth = _over_hours(courses, of), _depths(courses)
    size, worn = (10.0, 0.6 + 3.2 * _rows(depth)), f"depth worn in {asked.hours:g} h"
    said = [_sentences(force, course, asked, of) for force, course in courses.items()]
    return Answer(
        sentences=list(chain(*said)),
        data={"": over, "depth": depth},
        diagrams={
            "": Drawing(partial(draw, over, of), "wear by its vibration", (10.0, 6.0)),
            "depth": Drawing(partial(draw_depth, depth), worn, size),
        },
        largest=float(over["amplitude"].max()),
        whole=not any(course.lost for course in courses.values()),
    )


# surfaces that wear -----------------------------------------------------------------------------


class Surface(NamedTuple):
    """What is worn: depth (n,) m of all points, contact after contact, and heights (m,), x* of the
    strips of those that are rough."""

    depth: Array
    heights: Array


@dataclass(frozen=True)
class Wearing:
    """An assembly whose contacts wear.

    Attributes:
        assembly: new. settings: of its case. coefficient: I_W, m3/J.

    Raises:
        UserError: no contact, one without area, friction in none, a law that knows no approach, a
            rough surface in the book's mode, which has one for all points.
    """

    assembly: Assembly
    settings: CaseSettings
    coefficient: float

    def __post_init__(self) -> None:
        if not self.assembly.contacts:
            raise UserError("the case has no contacts, so that nothing wears; add [[contacts]]")
        for c in self.assembly.contacts:
            if not (c.patch.areas > 0).all():
                raise UserError(f"contacts.{c.name}: has no area; give its width and height, m")
        if self.settings.mode == "book" and any(self.tables):
            raise UserError('mode: "book" has one rough surface for all points; write mode = "aft"')
        if not any(_slides(c) for c in self.assembly.contacts):
            raise UserError("no contact has friction, so that nothing wears; give one")

    @cached_property
    def areas(self) -> Array:
        """(n,) m2 of all points."""
        return np.concatenate([c.patch.areas for c in self.assembly.contacts])

    @cached_property
    def tables(self) -> list[Tabulated | None]:
        """Heights of each contact where it is rough."""
        rough = [_rough(c.patch.law) for c in self.assembly.contacts]
        return [None if normal is None else as_table(normal.heights) for normal in rough]

    @cached_property
    def new(self) -> Surface:
        pairs = zip(self.assembly.contacts, self.tables, strict=True)
        rows = [np.tile(np.asarray(t.x), len(c.patch.points)) for c, t in pairs if t is not None]
        return Surface(np.zeros(len(self.areas)), np.concatenate([*rows, np.zeros(0)]))

    def problem(self, surface: Surface) -> Problem:
        """The balance with worn contacts.

        Raises:
            NotConverged: they do not carry what presses them.
        """
        pairs = zip(self.assembly.contacts, self._laws(surface), strict=True)
        worn = replace(self.assembly, contacts=tuple(_pressed(c, law) for c, law in pairs))
        return balanced(self.settings, worn, length=moves_by(self.assembly))

    def after(self, surface: Surface, work: Array, force: Array) -> Surface:
        """Worn further by the frictional work (n,) J of every point, at (n,) N."""
        heights = [np.zeros(0)]
        for law, own in zip(self._laws(surface), self.slices, strict=True):
            if (normal := _rough(law)) is not None:
                share = _share(law)
                whole = (work[own] / share, force[own] / share)
                worn = worn_law(normal, *whole, self.coefficient, self.areas[own] / share)
                heights.append(np.asarray(worn.heights.x).ravel())  # type: ignore[attr-defined]
        depth = surface.depth + self.coefficient * work / self.areas
        return Surface(depth, np.concatenate(heights))

    @cached_property
    def slices(self) -> list[slice]:
        """Points of each contact."""
        ends = np.cumsum([0, *(len(c.patch.points) for c in self.assembly.contacts)])
        return [slice(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True)]

    def _laws(self, surface: Surface) -> Iterator[Law]:
        """Of each contact."""
        begin = 0
        for c, table, own in zip(self.assembly.contacts, self.tables, self.slices, strict=True):
            n = own.stop - own.start
            if table is not None:
                share = np.tile(np.asarray(table.area_at), (n, 1))
                x = surface.heights[begin : begin + share.size].reshape(share.shape)
                begin += share.size
                yield _roughened(c.patch.law, summed(x, share))
                continue
            try:
                yield apart(c.patch.law, surface.depth[own])
            except UserError as error:
                raise UserError(f"contacts.{c.name}: {error}") from error


def _slides(c: Contact) -> bool:
    """Whether a contact has friction."""
    n = len(c.patch.points)
    return bool(np.any(np.asarray(c.patch.law.limit(jnp.ones((n, 3)), c.patch.law.init(n))) > 0))


def _pressed(c: Contact, law: Law) -> Contact:
    """A contact with a worn law; where a force presses it, its faces come nearer until they carry
    that again.

    Raises:
        NotConverged: no approach does.
    """
    worn, force = replace(c, patch=replace(c.patch, law=law)), float(c.preload[0])
    if force <= 0:
        return worn

    def missing(nearer: float) -> float:
        return float(pressing(worn.patch, c.offset + nearer * normal)[0]) - force

    normal, most = np.eye(len(c.offset))[0], float(c.offset[0])
    while missing(most) < 0:
        most *= 2
        if not 0 < most < FAR:
            raise NotConverged(f"{c.name} carries its {force:g} N no more")
    nearer = 0.0 if missing(0.0) >= 0 else brentq(missing, 0.0, most, xtol=1e-18, rtol=1e-14)
    return replace(worn, offset=c.offset + nearer * normal)


def _rough(law: Any) -> Rough | None:
    """The rough surface of a law."""
    if isinstance(law, Rough):
        return law
    if isinstance(law, Portion):
        return _rough(law.whole)
    return _rough(law.normal) if isinstance(law, OnNormal | Gapped) else None


def _roughened(law: Any, heights: Tabulated) -> Any:
    """A law with other heights."""
    if isinstance(law, Rough):
        return replace(law, heights=heights)
    key = "whole" if isinstance(law, Portion) else "normal"
    return replace(law, **{key: _roughened(getattr(law, key), heights)})


def _share(law: Any) -> Any:
    """(n,) or 1: share of a whole contact whose numbers the law has."""
    return np.asarray(law.share) * _share(law.whole) if isinstance(law, Portion) else 1.0


# the course --------------------------------------------------------------------------------------


Row = dict[str, Any]
"""A vibration and its surface, see `_vibrating`, as a journal keeps it."""


class Course(NamedTuple):
    """Rows from new to worn, with their time (h). lost: why it ends early."""

    wearing: Wearing
    rows: list[Row]
    lost: str

    @property
    def overlaps(self) -> bool:
        """Whether no contact is pressed by a force."""
        return not any(c.preload[0] > 0 for c in self.wearing.assembly.contacts)


Kept = Callable[[float, Callable[[], Row]], Row]
Vibrates = Callable[[Surface, Row | None], Row]


def _course(w: Wearing, asked: Keys, kept: Kept, report: Callable[[str], None]) -> Course:
    """Jump after jump, each made of the one before and kept."""
    band = 2 * np.pi * w.settings.sweep.grid
    vibrates = partial(_vibrating, w, asked.frequency, band, report)
    rows, lost = [kept(0.0, partial(_begun, w, asked, vibrates))], ""
    while not lost and rows[-1]["time"] < asked.hours * (1 - SHORTEST):
        report(f"{rows[-1]['time']:.6g} of {asked.hours:g} h worn, in {len(rows) - 1} jumps")
        if len(rows) > asked.jumps:
            lost = f"{asked.jumps} jumps are over; give more jumps, or a larger tolerance"
            break
        row = kept(float(len(rows)), partial(_jumped, w, asked, vibrates, rows[-1]))
        lost = row["lost"]
        rows += [] if lost else [row]
    return Course(w, rows, lost)


def _begun(w: Wearing, asked: Keys, vibrates: Vibrates) -> Row:
    """The first row. Where the preload goes with the depth, a jump of twice the tolerance of the
    approach would have that error; half of it is tried first.

    Raises:
        UserError: no vibration.
    """
    new = vibrates(w.new, None)
    if new["lost"]:
        raise UserError(f"nothing to begin with: {new['lost']}; give another one", "frequency")
    rate = HOUR * w.coefficient * float((new["power"] / w.areas).max())
    jump = asked.hours
    if rate > 0 and new["approach"] > 0:
        jump = min(asked.tolerance * new["approach"] / rate, jump)
    return {**new, "time": 0.0, "jump": jump, "error": 0.0}


def _jumped(w: Wearing, asked: Keys, vibrates: Vibrates, row: Row) -> Row:
    """The next row, by Heun's method: work and force of a jump are the means of those at its
    beginning and at its end, as far as the beginning alone tells where that is; what the jump
    differs from one by the beginning alone is its error."""
    surface, left = Surface(row["depth"], row["heights"]), asked.hours - row["time"]
    jump, why = min(row["jump"], left) if row["power"].any() else left, ""
    least = SHORTEST * jump
    while jump > least:
        ahead = w.after(surface, HOUR * jump * row["power"], row["force"])
        there = vibrates(ahead, row)
        if not there["lost"]:
            power = 0.5 * (row["power"] + there["power"])
            after = w.after(surface, HOUR * jump * power, _mean_force(row, there))
            largest = float(after.depth.max())
            error = float(np.abs(after.depth - ahead.depth).max()) / largest if largest else 0.0
            factor = 0.9 * np.sqrt(asked.tolerance / max(error, 1e-12))
            if error > asked.tolerance:
                jump *= max(0.2, factor)
                continue
            there = vibrates(after, there)
            if not there["lost"]:
                time = asked.hours if jump == left else row["time"] + jump
                return {**there, "time": time, "jump": jump * min(3.0, factor), "error": error}
        jump, why = 0.3 * jump, there["lost"]
    return {"lost": why or f"no jump keeps to the tolerance of {asked.tolerance:g}"}


def _mean_force(*rows: Row) -> Array:
    """(n,) N: all work over all ways."""
    power = np.array([row["power"] for row in rows])
    force = np.array([row["force"] for row in rows])
    way = np.divide(power, force, out=np.zeros_like(power), where=force > 0).sum(axis=0)
    return np.divide(power.sum(axis=0), way, out=np.zeros_like(way), where=way > 0)


def _vibrating(
    w: Wearing,
    frequency: float | None,
    band: Array,
    report: Callable[[str], None],
    surface: Surface,
    near: Row | None,
) -> Row:
    """The vibration with a worn surface; near: one with another surface.

    power: (n,) W of friction along what slides. taken: W, all that contacts take. force: (n,) N,
    mean while it is closed. open: (n,) share of the cycle. damping: what the loads supply in a
    cycle over 4 pi times the kinetic energy, the ratio of a resonance. approach: m, the largest in
    the mean over the cycle. lost: why there is no vibration.
    """
    state: Row = surface._asdict()
    try:
        problem = w.problem(surface)
        point = _point(problem, frequency, band, near, report)
        motion = operating(problem, point) if point.converged else None
        status = point.status if motion is None else judged(point, motion.checks).status
    except NotConverged as error:
        motion, status = None, str(error)
    if motion is None or status != CONVERGED:
        return {**state, "lost": status}
    contacts, trace = problem.assembly.contacts, traced(problem, motion)
    normal = np.concatenate([np.asarray(trace[c.name].force)[..., 0] for c in contacts], axis=1)
    cycles, f = [motion.cycles[c.name] for c in contacts], motion.Omega / (2 * np.pi)
    mean = [c.patch.kinematics[:, 0] @ motion.relative[c.name][:, 0] for c in contacts]
    read = motion_of_read(problem, [motion])
    return {
        **state,
        "lost": "",
        "x": point.x,
        "Omega": point.Omega,
        "amplitude": abs(motion.outputs[0, 1]),
        "damping": motion.supplied / (4 * np.pi * motion.kinetic),
        "stress": np.nan if read is None else stress_peaks(read, largest=False).amplitude[0],
        "power": f * np.maximum(np.concatenate([c.by_slip for c in cycles]), 0.0),
        "taken": f * sum(float(c.taken.sum()) for c in cycles),
        "open": np.concatenate([c.open for c in cycles]),
        "force": normal.sum(axis=0) / np.maximum((normal > 0).sum(axis=0), 1),
        "pressing": normal.mean(axis=0).sum(),
        "approach": np.concatenate(mean).max(),
    }


def _point(
    problem: Problem,
    frequency: float | None,
    band: Array,
    near: Row | None,
    report: Callable[[str], None],
) -> Point:
    """At a frequency, or at the resonance: uphill from one near by, from any other solution at its
    frequency where none is beside it, and the highest in the band where that leads nowhere."""
    if frequency is not None:
        return solved(problem, 2 * np.pi * frequency, [] if near is None else [near["x"]])
    peak = None
    if near is not None:
        peak = climbed(problem, near["x"], near["Omega"])
        if not peak.converged:
            beside = solved(problem, near["Omega"], [near["x"]])
            if beside.converged:
                peak = climbed(problem, beside.x, beside.Omega)
    if peak is None or not peak.converged:
        peak = highest(problem, band, report).peak
    return Point(peak.lam, peak.x, peak.status, 0.0, 0)


# tables, sentences, diagrams ---------------------------------------------------------------------


PRESSED_BY = "of the contacts that the sweep presses; else of the first one, at rest and new"


def _over_hours(courses: Mapping[float, Course], of: Quantity) -> Dataset:
    columns = [
        ("normal_force", "N", PRESSED_BY),
        ("time", "h", "of vibration"),
        ("frequency", "Hz", "of the vibration: the resonance, or the one asked for"),
        ("amplitude", of.unit, "of the first read-out, 0-peak"),
        ("damping_ratio", "1", "of all that is lost in a cycle; over 4 pi times kinetic energy"),
        ("stress", "Pa", "largest amplitude in the body that is read; nan without stress modes"),
        ("area", "m2", "nominal area of the points that touch, mean over the cycle"),
        ("pressing", "N", "normal forces of all contacts, mean over the cycle"),
        ("largest_depth", "m", "worn off both faces together"),
        ("worn_volume", "m3", "of all contacts"),
        ("frictional_power", "W", "of all contacts"),
        ("error", "1", "of the jump that leads there, against first order, over the largest depth"),
    ]
    each = [(force, c.wearing.areas, row) for force, c in courses.items() for row in c.rows]
    rows = [(force, *_in_table(areas, row)) for force, areas, row in each]
    return _dataset("wear", columns, np.array(rows).T)


def _in_table(areas: Array, row: Row) -> tuple[float, ...]:
    touching, volume = areas @ (1 - row["open"]), areas @ row["depth"]
    frequency, depth, power = row["Omega"] / (2 * np.pi), row["depth"].max(), row["power"].sum()
    moves = row["time"], frequency, row["amplitude"], row["damping"], row["stress"]
    return *moves, touching, row["pressing"], depth, volume, power, row["error"]


def _depths(courses: Mapping[float, Course]) -> Dataset:
    """Every point at the end."""
    parts = []
    for force, course in courses.items():
        contacts, areas = course.wearing.assembly.contacts, course.wearing.areas
        places, last = np.concatenate([c.patch.points for c in contacts]), course.rows[-1]
        names = np.repeat([c.name for c in contacts], [len(c.patch.points) for c in contacts])
        pressures = course.rows[0]["force"] / areas, last["force"] / areas
        where = np.full(len(areas), force), names, *places.T, areas
        parts.append((*where, last["depth"], *pressures))
    columns = [
        ("normal_force", "N", PRESSED_BY),
        ("contact", "1", "name"),
        ("t1", "m", "place on the patch"),
        ("t2", "m", "place on the patch"),
        ("area", "m2", "of the point"),
        ("depth", "m", "worn off both faces together"),
        ("pressure_new", "Pa", "mean while it is closed, at the beginning"),
        ("pressure", "Pa", "mean while it is closed, at the end"),
    ]
    return _dataset("wear_depth", columns, [np.concatenate(c) for c in zip(*parts, strict=True)])


Columns = Sequence[tuple[str, str, str]]
"""Name, unit and meaning of each."""


def _dataset(kind: str, columns: Columns, values: Iterable[Array]) -> Dataset:
    named = zip(columns, values, strict=True)
    return Dataset(kind, {name: Variable(v, unit, holds) for (name, unit, holds), v in named})


def _sentences(force: float, course: Course, asked: Keys, of: Quantity) -> list[str]:
    rows, w = course.rows, course.wearing
    new, last = rows[0], rows[-1]
    begun = f"F_N = {force:.5g} N" + (" when new" if course.overlaps else "")
    both = [(of.sized(r["amplitude"]), r["Omega"] / (2 * np.pi), r["damping"]) for r in (new, last)]
    (size, f, ratio), (worn_size, worn_f, worn_ratio) = both
    at = f"at {f:.6g} Hz" if asked.frequency else f"resonance {f:.6g} to {worn_f:.6g} Hz"
    volume, deepest = 1e9 * (w.areas @ last["depth"]), METRES.sized(last["depth"].max())
    said = [
        f"{begun}, in {last['time']:.6g} h of vibration: amplitude {size} to {worn_size}, "
        f"{at}, damping ratio {percent(ratio)} to {percent(worn_ratio)}; {volume:.4g} mm3 worn, "
        f"{deepest} at the deepest, in {counted(len(rows) - 1, 'jump')}."
    ]
    if not last["depth"].any():
        said = [f"{begun}: nothing slides at {f:.6g} Hz, amplitude {size}, so that nothing wears."]
        if new["taken"] > 0:
            power = Quantity("W").sized(new["taken"])
            said.append(f"{begun}: the contacts take {power} in creep, dampers or as area opens.")
    for c, own in zip(w.assembly.contacts, w.slices, strict=True):
        touches = np.array([bool((row["open"][own] < 1).any()) for row in rows])
        if touches[0] and not touches[-1]:
            since = rows[int(np.flatnonzero(touches)[-1]) + 1]["time"]
            said.append(f"{begun}: contact '{c.name}' touches no more from {since:.6g} h on.")
    if course.lost:
        said.append(f"{begun}: it ends after {last['time']:.6g} h: {course.lost}.")
    return said


def draw(over: Dataset, of: Quantity, figure: Figure) -> None:
    """Of every normal force, over hours."""
    by, unit = of.shared(over["amplitude"])
    deep, micro = METRES.shared(over["largest_depth"])
    panels = [
        ("amplitude", by, f"amplitude in {unit}"),
        ("frequency", 1.0, "frequency in Hz"),
        ("damping_ratio", 100.0, "damping ratio in %"),
        ("stress", 1e-6, "stress amplitude in MPa"),
        ("largest_depth", deep, f"largest depth in {micro}"),
        ("area", 1e6, "area that touches in mm²"),
    ]
    if not np.isfinite(over["stress"]).any():
        panels[3] = ("pressing", 1.0, "normal forces, mean, in N")
    table = figure.subplots(2, 3)
    for axes, (name, scale, label) in zip(table.flat, panels, strict=True):
        plain_axes(axes)
        for force, colour in zip(dict.fromkeys(over["normal_force"]), cycle(COLOURS)):
            own = over["normal_force"] == force
            line: Any = {"color": colour, "label": f"$F_N$ = {force:.5g} N"}
            axes.plot(over["time"][own], scale * over[name][own], ".-", ms=4, lw=1.2, **line)
        axes.set(xlabel="hours", ylabel=label)
        axes.ticklabel_format(useOffset=False)
        if name in ("area", "largest_depth", "damping_ratio", "pressing"):
            axes.set_ylim(bottom=0)
    if np.ptp(over["normal_force"]):
        table[0, 0].legend(fontsize=8, frameon=False)


def _rows(depth: Dataset) -> int:
    """Of panels in `draw_depth`."""
    return -(-min(len(_patches(depth)), PANELS) // COLUMNS)


def _patches(depth: Dataset) -> dict[tuple[float, str], Array]:
    """(normal force, contact) -> which points are its own, the deepest worn first."""
    normal, name = depth["normal_force"], depth["contact"]
    pairs = dict.fromkeys(zip(normal, name, strict=True))
    points = {pair: (normal == pair[0]) & (name == pair[1]) for pair in pairs}
    return dict(sorted(points.items(), key=lambda patch: -depth["depth"][patch[1]].max()))


def draw_depth(depth: Dataset, figure: Figure) -> None:
    """Over the patches that are worn most."""
    patches = list(_patches(depth).items())[:PANELS]
    table = figure.subplots(_rows(depth), min(len(patches), COLUMNS), squeeze=False)
    for axes in table.flat[len(patches) :]:
        axes.set_axis_off()
    for axes, (p, own) in zip(table.flat, patches, strict=False):
        places, values = 1e3 * np.column_stack([depth["t1"], depth["t2"]])[own], depth["depth"][own]
        least, most = float(values.min()), max(float(values.max()), 1e-12)
        least = least if least < EVEN * most else 0.0
        by, unit = METRES.shared(values)
        edges = grid_of(places)
        how: dict[str, Any] = {"vmin": by * least, "vmax": by * most, "cmap": "viridis"}
        if edges is None:
            shown: Any = axes.scatter(*places.T, c=by * values, s=14, **how)
        else:
            shown = axes.pcolormesh(*edges, on_grid(places, by * values), **how)
        axes.set_aspect("equal")
        axes.set(xlabel="t1 in mm", ylabel="t2 in mm")
        axes.locator_params(nbins=5)
        axes.set_title(f"{p[1]}, $F_N$ = {p[0]:.5g} N", fontsize=9)
        figure.colorbar(shown, ax=axes, label=f"depth in {unit}", shrink=0.8)


ANALYSIS = Analysis(
    "wear",
    Keys,
    solve,
    lost="a course of wear ends before its hours",
    needed="coefficient (m3/J) and hours",
)
