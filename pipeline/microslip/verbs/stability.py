"""Does it move by itself: all complex roots of a case about steady sliding in a window of frequencies and growth rates,
a map of where they grow, and the limit cycles that follow, as [stability] asks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from .. import sliding
from ..analysis import Analysis, Answer, Files, Question
from ..case import CaseSettings, headline
from ..case.loaded import placed
from ..case.questions import Pair
from ..case.settings import GROUND
from ..data import Array, ComplexArray, ModalBasis
from ..errors import NotConverged, UserError, of_file
from ..files.tables import csv_files
from ..linalg import quadratic
from ..linalg.quadratic import Quadratic, Window
from ..modal.compute import unreduced
from ..pictures.roots import cycles_picture, map_picture, plane_picture, relief_picture
from ..report.page import fold, say, table
from ..report.roots import root_table, table_lines
from ..results.journal import once
from ..roots.asked import window_of, write_roots
from ..roots.cycles import Born, Cycle, Over, born, sentence_of_relief, sentences_of
from ..roots.full import Compared, compared, full_matrices, growing
from ..roots.map import Axis, Map, over_map
from ..roots.spectrum import Spectrum, spectrum
from ..roots.waves import waves
from ..settings.numbers import Model, NotNegative, Number, _finite_vector, _tuple
from ..sliding import Sliding, Tangent
from ..system.assembly import Assembly


class Keys(Model):
    """Roots of the assembly about its steady sliding, by `microslip stability`: all that grow, and
    those of a window."""

    growth: Annotated[tuple[Number, Number], BeforeValidator(_finite_vector)] = (-1000.0, 10000.0)
    """[1/s] from, to, of the roots that are wanted ([squeal](squeal.md))"""
    frequency: Pair
    """[Hz] from, to"""
    accuracy: Annotated[Number, Field(ge=0, le=0.1)] = 1e-8
    """relative, of the entries of the matrices: decides which growth rates are neutral"""
    neutral: NotNegative = 0.0
    """[1/s] growth rates below it are neither growth nor decay"""
    over: Annotated[tuple[Over, ...], BeforeValidator(_tuple)] = ()
    full: Annotated[int, Field(ge=0, le=1000)] = 0
    """states of the map, evenly spread, at which the unreduced matrices are counted as well"""
    cycle: Cycle | None = None

    @model_validator(mode="after")
    def _has_area(self) -> Keys:
        for key in ("growth", "frequency"):
            low, high = getattr(self, key)
            if low >= high:
                raise ValueError(f"{key}: from {low:g} to {high:g} the window has no area; give the smaller one first")
        if len(self.over) not in (0, 2):
            raise ValueError("over: a map has two parameters; give two [[stability.over]], or none")
        return self


@dataclass(frozen=True)
class State:
    """An assembly that slides: its equations, its equilibrium z, and what is linearised there."""

    assembly: Assembly
    equations: Sliding
    z: Array

    @cached_property
    def contacts(self) -> list[Tangent]:
        return sliding.tangents(self.assembly, self.equations, self.z)

    @property
    def matrices(self) -> Quadratic:
        """M = 1, C and K."""
        C, K = sliding.linearised(self.equations, self.z)
        return Quadratic(np.eye(len(K)), C, K)

    def shapes(self, x: ComplexArray, bases: Mapping[str, ModalBasis]) -> dict[str, ComplexArray]:
        """Body -> (n, 3) complex motion of its n points in a root's vector (m,); sectors of rings are left out."""
        u, found, begin = self._moved @ x, dict[str, ComplexArray](), 0
        for component in self.assembly.unrolled().components:
            phi = next(iter(component.groups.values())).phi
            end = begin + (phi[..., 0].size or phi.shape[-1])
            if phi.size and component.name in bases and bases[component.name].sectors == 1:
                found[component.name] = u[begin:end].reshape(-1, 3)
            begin = end
        return found

    @cached_property
    def _moved(self) -> Array:
        return sliding.points_moved(self.assembly) @ np.asarray(self.equations.shapes)


FASTEST = 4
"""Roots that grow whose shapes are written as motions."""


def solve(q: Question) -> Answer:
    """Roots about steady sliding; whole if they are proved complete and no limit cycle is lost."""
    with of_file(q.varied.path):
        return _answer(q, q.asked, q.built.settings)


def _answer(q: Question, asked: Keys, settings: CaseSettings) -> Answer:
    varied, window = q.varied, window_of(asked)
    axes = _map_of(varied, asked) if asked.over else None
    _try_ends(varied, asked)
    meshed = {b.name: varied.meshed(b.body or b.name, "stability.full") for b in settings.components if asked.full}
    state = state_of(varied, {})
    found = spectrum(state.matrices, window, accuracy=asked.accuracy, neutral=asked.neutral)
    over, full, cycles = None, list[Compared](), Born((), ())
    if axes is not None:
        over = over_map(*axes, window, asked.neutral, q.report, q.kept)
        full = _in_full(q, asked, over, meshed) if asked.full else []
    if asked.cycle:
        cycles = born(varied.under, asked.cycle, window.omega, q.kept, q.report)
    said = [found.sentence, *shapes(state, found, varied.bases, settings), *pressed(state)]
    said += [*([over.sentence] if over else []), *_told(full)]
    if asked.cycle:
        said += [words for c in cycles.own for words in sentences_of(c, asked.cycle)]
        said += sentence_of_relief(cycles, asked.cycle)
        said += headline.doubted(q.built, cycles.largest)
    drawable = any(basis.mesh.n_cells for basis in varied.bases.values())
    return Answer(
        said,
        tables=[
            *([_in_words(full, over)] if full and over else []),
            *([say(OF_MAP, tone="note")] if over else []),
            *([say(OF_CYCLES, tone="note")] if asked.cycle else []),
            *([say(OF_WAVES, tone="note")] if len(growing_ones(found)) and drawable else []),
            *root_table(found),
        ],
        largest=None,
        whole=found.complete and all(one.complete for one in full) and cycles.whole,
        files=_files(found, over, full) | _of_cycles(cycles, asked.cycle),
        moving=lambda folder: moving(state, found, varied.bases, settings, folder),
        lines=table_lines(found),
    )


def state_of(varied: Any, values: Mapping[str, float], where: str = "stability") -> State:
    """The case about its sliding, with other values of keys.

    Raises:
        UserError: a contact that does not slide, or lifts off; no equilibrium.
    """
    assembly = varied.under(values, where)
    if not assembly.contacts:
        raise UserError("there are none, so nothing slides; add [[contacts]] with friction", "contacts")
    try:
        equations = sliding.of(assembly)
        state = State(assembly, equations, sliding.equilibrium(equations))
    except NotConverged as error:
        raise UserError(str(error)) from error
    for c, at in zip(assembly.unrolled().contacts, state.contacts, strict=True):
        if not np.linalg.norm(at.velocity[:, 1:], axis=1).min() > 0:
            raise UserError(
                "is missing: the contact does not slide, and friction at rest has no direction; add ground = "
                "{ rpm = ... } or { velocity = ... }",
                f"contacts.{c.name}.ground",
            )
        if not (at.force[:, 0] > 0).any():
            raise UserError(
                "lifts off: at the equilibrium no point of it is pressed; raise its normal_force",
                f"contacts.{c.name}",
            )
    return state


def shapes(state: State, found: Spectrum, bases: Mapping[str, ModalBasis], settings: CaseSettings) -> list[str]:
    """A sentence for each root that grows: the waves that run round each body whose material turns."""
    said, u = [], {i: state.shapes(found.roots.x[:, i], bases) for i in growing_ones(found)}
    for name, turning in turned(settings).items():
        basis = bases[name]
        for i in (i for i in u if name in u[i]):
            axis = turning * np.asarray(basis.rotation_axis)
            seen = waves(basis.mesh.points, u[i][name], axis, basis.rotation_point)
            said.append(f"{found.frequency[i]:.6g} Hz at the rim of {name}: {seen.sentence}")
    return said


def growing_ones(found: Spectrum) -> list[int]:
    """Numbers of the roots that grow."""
    return [i for i, verdict in enumerate(found.verdict) if verdict == "unstable"]


def moving(
    state: State, found: Spectrum, bases: Mapping[str, ModalBasis], settings: CaseSettings, folder: Path
) -> list[Path]:
    """Shapes of the fastest `FASTEST` roots that grow and swing, as motions of their bodies; those whose material turns
    are animated, or all where none does."""
    grow = sorted((i for i in growing_ones(found) if found.frequency[i] > 0), key=lambda i: -found.growth[i])
    from ..pictures import can_draw
    from ..pictures.moving import assembled_picture, moving_shape

    made, every = list[Path](), dict[str, Mapping[str, ComplexArray]]()
    for number, i in enumerate(grow[:FASTEST], 1):
        u = {n: v for n, v in state.shapes(found.roots.x[:, i], bases).items() if bases[n].mesh.n_cells}
        name = f"{found.frequency[i]:.6g} Hz, grows by {found.growth[i]:.4g} 1/s"
        if u:
            of, said = turned(settings) or u, f"{name}; size chosen"
            made += moving_shape(u, bases, found.frequency[i], of, said, number, folder)
            every[name] = u
    if len(next(iter(every.values()), ())) > 1 and can_draw() is None:
        places = {b.name: placed(b, bases[b.name]) for b in settings.components}
        picture = folder / "pictures" / "assembled.png"
        made.insert(0, assembled_picture(every, bases, places, settings.name, picture))
    return made


def turned(settings: CaseSettings) -> dict[str, float]:
    """Body whose material runs through it -> 1, or -1 where it turns against its axis."""
    against = [(c.against, c.ground.rpm) for c in settings.contacts if c.ground and c.ground.rpm and not c.ground.axis]
    return {settings.address(to)[0]: float(np.sign(rpm)) for to, rpm in against if to != GROUND}


def pressed(state: State) -> list[str]:
    """A sentence for each contact of which points are open at the equilibrium."""
    said = []
    for c, at in zip(state.assembly.unrolled().contacts, state.contacts, strict=True):
        open_ = int((at.force[:, 0] <= 0).sum())
        if open_:
            said.append(f"{c.name}: {open_} of {len(at.force)} points are open at the equilibrium")
    return said


def _map_of(varied: Any, asked: Keys) -> tuple[Any, Axis, Axis]:
    """What makes the assemblies of the map, and its axes."""
    x, y = (Axis(o.parameter, o.unit, np.linspace(o.start, o.stop, o.points), o.keys) for o in asked.over)

    def make(values: dict[str, float]) -> Assembly:
        return varied.under(values, "stability.over.keys")

    return make, x, y


def _try_ends(varied: Any, asked: Keys) -> None:
    """The case with all keys that follow a parameter, at the ends of its range: what is wrong with them is said before
    anything is computed.

    Raises:
        UserError: see `Varied.built`.
    """
    cycle = asked.cycle
    ranges = [("stability.over.keys", over) for over in asked.over]
    ranges += [("stability.cycle.keys", cycle)] if cycle else []
    ranges += [("stability.cycle.across.keys", cycle.across)] if cycle and cycle.across else []
    for where, over in ranges:
        for value in (over.start, over.stop):
            varied.under({key: factor * value for key, factor in over.keys.items()}, where)


FULL = "states in unreduced matrices"
"""Series of the journal."""


def _in_full(q: Question, asked: Keys, over: Map, meshed: Mapping[str, Any]) -> list[Compared]:
    """States of the map, evenly spread over it, in unreduced matrices."""
    bodies = {name: unreduced(*of) for name, of in meshed.items()}
    found = []
    for n in range(asked.full):
        q.report(f"unreduced, state {n + 1} of {asked.full}")
        state = partial(_one_in_full, n, q.varied, asked, over, bodies)
        found.append(Compared(**once(q.kept, FULL, n, state)))
    return found


def _one_in_full(
    n: int, varied: Any, asked: Keys, over: Map, bodies: Mapping[str, Any]
) -> dict[str, Any]:  # fmt: skip
    window, (ny, nx) = window_of(asked), over.unstable.shape
    grows = Window((max(asked.neutral, 0.0), window.growth[1]), window.omega)
    share = (n + 0.5) / asked.full
    i, j = int(share * ny), int((7 * n + 3) % asked.full / max(asked.full - 1, 1) * (nx - 1))
    x, y = float(over.x.values[j]), float(over.y.values[i])
    state = state_of(varied, {**over.x.at(x), **over.y.at(y)}, "stability.over.keys")
    own = quadratic.every_value(state.matrices)
    full = growing(full_matrices(bodies, state.assembly, state.contacts), grows, own)
    mine = own[grows.holds(own)]
    away = compared(mine, full.roots.s)
    return vars(Compared(x, y, len(mine), len(full.roots), away, full.complete))


def _told(full: Sequence[Compared]) -> list[str]:
    if not full:
        return []
    same = sum(one.reduced == one.full and one.complete for one in full)
    worst = np.nanmax([one.distance for one in full if np.isfinite(one.distance)], initial=0.0)
    return [
        f"unreduced matrices at {len(full)} states of the map: the same number of roots that grow at {same}, counted "
        f"by the argument principle; roots differ by {worst:.1e} at most"
    ]


def _in_words(full: Sequence[Compared], over: Map) -> Any:
    rows = [(f"{c.x:.4g}", f"{c.y:.4g}", c.reduced, c.full, f"{c.distance:.1e}") for c in full]
    head = [over.x.title, over.y.title, "grow, reduced", "grow, unreduced", "relative difference"]
    return fold("States in unreduced matrices", table(head, rows))


OF_MAP = (
    "Map: colours count the roots that grow. Black lines: Hopf lines, where the fastest growth rate "
    "is zero. Grey lines: growth rate in 1/s. Dots: states counted in the unreduced matrices as well."
)

OF_CYCLES = (
    "Limit cycles: half of the way from the smallest to the largest value of the first read-out in "
    "a period, from the Hopf point on. Supercritical: the limit cycle grows out of the equilibrium "
    "softly; subcritical: it is reached by a jump. Dots: the same of a motion in time that began on "
    "the orbit, in its last period. Over a second parameter each wall stands at one of its values."
)

OF_WAVES = (
    "Moving pictures: one period of a root that grows, without its growth. Its size is chosen; motion/ holds it for "
    "ParaView."
)


def _files(found: Spectrum, over: Map | None, full: Sequence[Compared]) -> Files:
    dots, tables = [(one.x, one.y, one.full) for one in full], {"stability_map.csv": over.columns if over else {}}
    if full:
        keys = Compared.__annotations__
        tables["stability_full.csv"] = {key: np.array([getattr(one, key) for one in full], dtype=float) for key in keys}
    files: Files = csv_files({"stability.csv": found.columns}, 16) | csv_files(tables, 12)
    files["stability.h5"] = lambda path: write_roots(path, found, None, {})
    if over:
        files["pictures/roots_map.png"] = partial(map_picture, over, dots)
    return files | {"pictures/roots.png": partial(plane_picture, found)}


def _of_cycles(cycles: Born, asked: Cycle | None) -> Files:
    tables = {f"stability_cycle_{number}.csv": c.columns for number, c in enumerate(cycles.own, 1)}
    drawn: Files = {}
    if asked is not None and cycles.own:
        drawn["pictures/roots_cycles.png"] = partial(cycles_picture, cycles.own, _axis(asked))
    if asked is not None and asked.across is not None and cycles.relief:
        axes = _axis(asked), _axis(asked.across)
        tables["stability_relief.csv"] = cycles.columns(asked.across.parameter)
        drawn["pictures/roots_relief.png"] = partial(relief_picture, cycles.relief, axes)
    return csv_files(tables, 12) | drawn


def _axis(over: Over) -> str:
    return f"{over.parameter} in {over.unit}" if over.unit else over.parameter


ANALYSIS = Analysis(
    "stability",
    Keys,
    solve,
    lost="not all was found, roots in the window or limit cycles",
    needed="frequency = [0.0, HIGHEST] in Hz",
    swept=False,
    unloaded=lambda _: True,
)
