"""Roots of a case about steady sliding, and a map of where they grow: tables, pictures, a page that begins with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from .. import sliding
from ..case import CaseSettings, headline
from ..case.questions import Cycle, Over, StabilityOfCase
from ..case.settings import GROUND
from ..data import Array, ComplexArray, ModalBasis
from ..errors import NotConverged, UserError, in_its_file
from ..files import store
from ..files.tables import columns_csv
from ..linalg import quadratic
from ..linalg.quadratic import Quadratic, Window
from ..modal.unreduced import Unreduced, unreduced
from ..report.squeal import squeal_html
from ..results import Journal, open_journal
from ..roots.full import Compared, compared, full_matrices, growing
from ..roots.map import Axis, Map, over_map
from ..roots.spectrum import Spectrum, spectrum
from ..roots.waves import waves
from ..sliding import Sliding, Tangent
from ..system.assembly import Assembly
from .answer import CaseJob, Written
from .cycles import Born, born, sentence_of_relief, sentences_of
from .job import Job, open_job
from .meshing import load_mesh, mesh_stage
from .moving import moving_shape
from .places import find_body, lumped
from .stability import table_lines, window_of, write_roots
from .stage import Report, Stage
from .varied import Varied


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


@in_its_file
def squeal_stage(case: CaseJob) -> Written:
    """Roots of a case about steady sliding; whole if they are proved complete and no limit cycle is lost.

    Raises:
        UserError: the case asks for none; nothing slides; a contact that lifts off; what `sliding.of` refuses.
    """
    if case.settings.stability is None:
        raise UserError("is missing; add [stability] with frequency = [0.0, HIGHEST] in Hz", "stability")
    return case.answer("stability", "stages.squeal", _work)


def _work(stage: Stage, case: CaseJob) -> Written:
    """What is finished stays in a journal until all that is made of it is there."""
    settings, asked, folder = case.settings, case.settings.stability, case.folder
    assert asked is not None
    varied = Varied(case.path, case.raw, case.bases)
    axes = _map_of(varied, asked) if asked.over else None
    _try_ends(varied, asked)
    jobs = {b.name: _meshed(b.body or b.name, case.path) for b in settings.components if asked.full}
    state = state_of(varied, {})
    found = spectrum(state.matrices, window_of(asked), accuracy=asked.accuracy, neutral=asked.neutral)
    points = folder / "stability.points"
    over, full, cycles = None, list[Compared](), Born((), ())
    with open_journal(points, case.made_by(stage), {"case": settings.name}, case.force) as journal:
        if axes is not None:
            over = over_map(*axes, window_of(asked), asked.neutral, case.report, journal)
            full = _in_full(varied, asked, over, jobs, case.report, journal) if asked.full else []
        if asked.cycle:
            cycles = born(varied, asked.cycle, window_of(asked).omega, journal, case.report)
    stage.begin()
    told = [*shapes(state, found, varied.bases, settings), *pressed(state)]
    said = [found.sentence, *told, *([over.sentence] if over else []), *_told(full)]
    if asked.cycle:
        said += [words for c in cycles.own for words in sentences_of(c, asked.cycle)]
        said += sentence_of_relief(cycles, asked.cycle)
        said += headline.doubted(case.built(), cycles.largest)
    moves = moving(state, found, varied.bases, settings, folder) if case.pictures else []
    names = _written(folder, settings.name, found, over, full, said, case.pictures, (cycles, asked.cycle), moves)
    complete = found.complete and all(one.complete for one in full) and cycles.whole
    return Written([folder / name for name in names], [*table_lines(found), *said], complete)


def state_of(varied: Varied, values: Mapping[str, float], where: str = "stability") -> State:
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
    made = list[Path]()
    for number, i in enumerate(grow[:FASTEST], 1):
        u = {n: v for n, v in state.shapes(found.roots.x[:, i], bases).items() if bases[n].mesh.n_cells}
        title = f"{found.frequency[i]:.6g} Hz, grows by {found.growth[i]:.4g} 1/s; size chosen"
        if u:
            made += moving_shape(u, bases, found.frequency[i], turned(settings) or u, title, number, folder)
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


def _map_of(varied: Varied, asked: StabilityOfCase) -> tuple[Any, Axis, Axis]:
    """What makes the assemblies of the map, and its axes."""
    x, y = (Axis(o.parameter, o.unit, np.linspace(o.start, o.stop, o.points), o.keys) for o in asked.over)

    def make(values: dict[str, float]) -> Assembly:
        return varied.under(values, "stability.over.keys")

    return make, x, y


def _try_ends(varied: Varied, asked: StabilityOfCase) -> None:
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


def _in_full(
    varied: Varied, asked: StabilityOfCase, over: Map, jobs: Mapping[str, Job], report: Report,
    journal: Journal,
) -> list[Compared]:  # fmt: skip
    """States of the map, evenly spread over it, in unreduced matrices."""
    bodies = {name: _unreduced(job) for name, job in jobs.items()}
    for n in range(asked.full):
        if n not in journal.of(FULL):
            report(f"unreduced, state {n + 1} of {asked.full}")
            journal.keep(FULL, n, vars(_one_in_full(n, varied, asked, over, bodies)))
    return [Compared(**known) for known in journal.of(FULL).values()]


def _one_in_full(
    n: int, varied: Varied, asked: StabilityOfCase, over: Map, bodies: Mapping[str, Unreduced]
) -> Compared:  # fmt: skip
    window, (ny, nx) = window_of(asked), over.unstable.shape
    grows = Window((max(asked.neutral, 0.0), window.growth[1]), window.omega)
    share = (n + 0.5) / asked.full
    i, j = int(share * ny), int((7 * n + 3) % asked.full / max(asked.full - 1, 1) * (nx - 1))
    x, y = float(over.x.values[j]), float(over.y.values[i])
    state = state_of(varied, {**over.x.at(x), **over.y.at(y)}, "stability.over.keys")
    own = quadratic.every_value(state.matrices)
    full = growing(full_matrices(bodies, state.assembly, state.contacts), grows, own)
    mine = own[grows.holds(own)]
    return Compared(x, y, len(mine), len(full.roots), compared(mine, full.roots.s), full.complete)


def unreduced_body(name: str, path: Path) -> Unreduced:
    """The unreduced matrices of a body that a case names.

    Raises:
        UserError: it has no mesh; see `modal.unreduced`.
    """
    return _unreduced(_meshed(name, path))


def _unreduced(job: Job) -> Unreduced:
    return unreduced(load_mesh(job, mesh_stage(job))[0], job.settings)


def _meshed(name: str, path: Path) -> Job:
    """A body that a case names, which has a mesh.

    Raises:
        UserError: it has none.
    """
    job = None if lumped(path, name) else open_job(find_body(path, name, Path(".")))
    if job is None or job.settings.geometry.matrices is not None:
        raise UserError(f"'{name}' has no mesh, so there is nothing unreduced; leave full out", "stability.full", path)
    return job


def _told(full: Sequence[Compared]) -> list[str]:
    if not full:
        return []
    same = sum(one.reduced == one.full and one.complete for one in full)
    worst = np.nanmax([one.distance for one in full if np.isfinite(one.distance)], initial=0.0)
    return [
        f"unreduced matrices at {len(full)} states of the map: the same number of roots that grow at {same}, counted "
        f"by the argument principle; roots differ by {worst:.1e} at most"
    ]


def _written(
    folder: Path, name: str, found: Spectrum, over: Map | None, full: Sequence[Compared], said: Sequence[str],
    pictures: bool, cycles: tuple[Born, Cycle | None], moves: Sequence[Path],
) -> list[str]:  # fmt: skip
    """Names of the files, the page first. moves: of `moving`."""
    drawn = _pictures(found, over, full, folder / "pictures", cycles) if pictures else {}
    drawn |= {path.stem: path for path in moves if path.suffix == ".gif"}
    texts = {
        "stability.html": squeal_html(f"{name}: stability of sliding", said, found, over, full, drawn),
        "stability.csv": columns_csv(found.columns, 16),
    }
    if over is not None:
        texts["stability_map.csv"] = columns_csv(over.columns, 12)
    if full:
        columns = {key: np.array([getattr(one, key) for one in full], dtype=float) for key in Compared.__annotations__}
        texts["stability_full.csv"] = columns_csv(columns, 12)
    for number, c in enumerate(cycles[0].own, 1):
        texts[f"stability_cycle_{number}.csv"] = columns_csv(c.columns, 12)
    if cycles[0].relief and cycles[1] and cycles[1].across:
        texts["stability_relief.csv"] = columns_csv(cycles[0].columns(cycles[1].across.parameter), 12)
    for file, text in texts.items():
        store.write_text(folder / file, text)
    write_roots(folder / "stability.h5", found, None, {})
    return [*texts, "stability.h5", *dict.fromkeys(str(p.relative_to(folder)) for p in (*drawn.values(), *moves))]


def _pictures(
    found: Spectrum, over: Map | None, full: Sequence[Compared], folder: Path,
    cycles: tuple[Born, Cycle | None],
) -> dict[str, Path]:  # fmt: skip
    from ..pictures.roots import cycles_picture, map_picture, plane_picture, relief_picture

    drawn = {"plane": plane_picture(found, folder / "roots.png")}
    if over is not None:
        drawn["map"] = map_picture(over, [(one.x, one.y, one.full) for one in full], folder / "roots_map.png")
    seen, asked = cycles
    if asked is not None and seen.own:
        drawn["cycles"] = cycles_picture(seen.own, _axis(asked), folder / "roots_cycles.png")
    if asked is not None and asked.across is not None and seen.relief:
        axes = _axis(asked), _axis(asked.across)
        drawn["relief"] = relief_picture(seen.relief, axes, folder / "roots_relief.png")
    return drawn


def _axis(over: Over) -> str:
    return f"{over.parameter} in {over.unit}" if over.unit else over.parameter
