"""The command line: one verb per stage. Exit codes: 0 done, 1 check failed or not converged, 2 bad input, 130
interrupted, 143 ended by SIGTERM."""

from __future__ import annotations

import codecs
import inspect
import io
import json
import logging
import os
import re
import shlex
import shutil
import signal
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import App, CycloptsError, Parameter

from . import __version__, interrupts
from .errors import NotConverged, UserError
from .files.png import draw_beside
from .progress import announced, progress
from .settings.meant import case_file, meant

if TYPE_CHECKING:
    from .analysis import Verb
    from .basis.checks import Check
    from .data import ModalBasis
    from .results import Response
    from .stages.answer import Written

os.environ.setdefault("NUMPY_MADVISE_HUGEPAGE", "0")  # read by numpy when it is loaded: the system zeroes whole huge
# pages, which costs more than they save (0.7 of 8.6 CPU seconds of the modes of 60,000 degrees of freedom)

app = App(
    name="microslip",
    help="Modal bases of elastic bodies for vibration with friction contacts: from CAD to a file solvers can trust.",
    version=__version__,
    help_format="plaintext",  # importing rich's Markdown costs a tenth of a second
    default_parameter=Parameter(negative=()),
    suppress_keyboard_interrupt=False,
)

app.register_install_completion_command()

Set = Annotated[
    tuple[str, ...],
    Parameter(name="--set", show_default=False, help="override a setting: key.subkey=value (may be repeated)"),
]
Vary = Annotated[
    str | None,
    Parameter(show_default=False, help="key.subkey=a,b,c: all these values, in one table and one picture of each kind"),
]
Quiet = Annotated[bool, Parameter(name=("--quiet", "-q"), show_default=False, help="say nothing but errors")]
Force = Annotated[bool, Parameter(show_default=False, help="do the work even if the products are up to date")]


def _in_a_folder(_: object, path: Path | None) -> None:
    """Refuse a product, or a folder of them, in a folder that is not there: it may be misspelt."""
    if path is not None and not path.parent.is_dir():
        raise UserError(f"--output {path}: there is no folder {path.parent}; make it or correct the path")


Output = Annotated[
    Path | None, Parameter(name=("--output", "-o"), help="where to write the product", validator=_in_a_folder)
]

Stability = Annotated[bool, Parameter(show_default=False, help="Floquet multipliers of every point as well")]
Log = Annotated[bool, Parameter(show_default=False, help="write convergence.csv: Newton's method at every point")]
Book = Annotated[bool, Parameter(show_default=False, help="in the book's mode too, and what that leaves out")]
Short = Annotated[bool, Parameter(show_default=False, help="what fails, at its worst speed, and the verdict alone")]
NoStress = Annotated[bool, Parameter(show_default=False, help="leave out the stresses of the response")]
NoPictures = Annotated[bool, Parameter(show_default=False, help="leave out all pictures")]
Figures = Annotated[
    Literal["svg", "pdf", "300dpi"] | None,
    Parameter(show_default=False, help="curves as vector graphics too, or as PNG of 300 dpi, beside the others"),
]
Everywhere = Annotated[
    bool, Parameter(show_default=False, help="stresses over the whole sweep, not at its resonances alone")
]
Apart = Annotated[bool, Parameter(show_default=False, help="every solid of the CAD file is a part of its own")]
SolidsOnly = Annotated[
    bool, Parameter(show_default=False, help="beams, shells and the like that hang on the solids are left out")
]
Ring = Annotated[bool, Parameter(show_default=False, help="vtu: the ring of a cyclic body, a file a nodal diameter")]

Over = Annotated[
    Literal["frequency", "load", "normal-force", "orders", "speeds", "ranges"] | None, Parameter(show_default=False)
]

PACKAGE = Path(__file__).parent


def _bodies() -> Path:
    """The folder of bodies that travel with the package (a checkout's geometry/ in development)."""
    inside = PACKAGE / "bodies"
    return inside if inside.is_dir() else PACKAGE.parents[1] / "geometry"


def _cases() -> Path:
    inside = PACKAGE / "cases"
    return inside if inside.is_dir() else PACKAGE.parent / "cases"


@app.command
def init(name: str = "", folder: Path | None = None, /) -> None:
    """Copy a runnable body (and its case) to start from.

    Args:
        name: a body (blade, shroud, pin, ...; all are listed if none is given); `own` for a commented body.toml
            around your own CAD file or mesh; `three-masses` for a system by hand; `sample` for a modal file with a
            case; `contact` for contact laws.
        folder: where to; ./NAME if not given.
    """
    known = sorted(p.name for p in _bodies().iterdir() if (p / "body.toml").is_file())
    more = [*_MADE, "own"]
    if not name:
        print(f"What can be had, by microslip init NAME [FOLDER]: {', '.join([*known, *more])}")
        return
    if name not in [*known, *more]:
        raise UserError(f"init {name}: there is no such body; choose one of {', '.join([*known, *more])}")
    target = folder or Path(name)
    files = _to_copy(name)
    there = [p for p in (target / copy for _, copy in files) if os.path.lexists(p)] if target.is_dir() else [target]
    if target.exists() and there:
        raise UserError(f"{there[0]}: is there already; give another folder as second argument (nothing was changed)")
    try:
        target.mkdir(parents=True, exist_ok=True)
        for source, copy in files:
            shutil.copyfile(source, target / copy)
            if copy.endswith(".toml") and name != "contact":  # whose files have names of their own
                keys = ("name",) if name == "sample" else ("name", "body")  # whose body is a modal file's
                _rename(target / copy, name if name in known else "", target.resolve().name, keys)
    except OSError as error:
        raise UserError(f"{target}: cannot be written ({error.strerror}); choose another folder") from error
    file, verb = _MADE.get(name, ("body.toml", "run"))
    print(f"{target}: ready. Look at {target / file}, then: microslip {verb} {shlex.quote(str(target))}")


_MADE = {
    "three-masses": ("system.toml", "run"),
    "sample": ("case.toml", "respond"),
    "contact": ("contact.toml", "contact"),
}
"""Folders to start from that hold no body.toml: the file to look at and the verb that takes it from there."""


def _to_copy(name: str) -> list[tuple[Path, str]]:
    """Files of a body that travels with the package, and their names in the new folder."""
    if name == "own":
        return [(PACKAGE / "templates" / "own.toml", "body.toml")]
    if name == "contact":
        folders = (PACKAGE / "templates" / "contact", _cases() / "contact")
        return [(f, f.name) for folder in folders for f in sorted(folder.iterdir()) if f.is_file()]
    if name in _MADE:
        folder = PACKAGE / "samples" if name == "sample" else PACKAGE / "templates" / name
        return [(f, f.name) for f in sorted(folder.iterdir()) if f.is_file()]
    files = [(f, f.name) for f in sorted((_bodies() / name).iterdir()) if f.is_file()]
    case = _cases() / f"{name}.toml"
    return files + ([(case, "case.toml")] if case.is_file() else [])


def _rename(path: Path, old: str, name: str, keys: tuple[str, ...]) -> None:
    """Give the body (and its case) the name of its folder, so that its products stand in build/<folder>/; further
    bodies of the folder, called OLD-more, that and more."""
    was = rf"{re.escape(old)}(|-[^\"]*)" if old else '[^"]*()'
    if re.fullmatch(r"[A-Za-z0-9_.-]{1,64}", name):
        text = path.read_text(encoding="utf-8")
        for key in keys:
            text = re.sub(rf'^{key} = "{was}"', rf'{key} = "{name}\1"', text, count=1, flags=re.M)
        path.write_text(text, encoding="utf-8")


@app.command
def mesh(body: Path, /, *, output: Output = None, set_: Set = (), force: Force = False, quiet: Quiet = False) -> None:
    """Draw and mesh a body (gmsh runs in a process of its own).

    Args:
        body: a body.toml or the folder that holds it.
    """
    from .stages.job import open_job
    from .stages.meshing import load_mesh, mesh_stage

    job = open_job(body, list(set_))
    with progress(f"mesh {job.settings.name}", quiet) as report:
        path = mesh_stage(job, output, force, report)
        grid, warnings = load_mesh(job, path)
        for warning in warnings:
            report(f"warning: {warning}")
    _say(f"{path}: {grid.n_points} points, {grid.n_cells} cells, faces {_words(grid.faces)}", quiet)


@app.command
def modes(body: Path, /, *, output: Output = None, set_: Set = (), force: Force = False, quiet: Quiet = False) -> None:
    """Mesh if needed, then compute the modal file of a body.

    Args:
        body: a body.toml or the folder that holds it; a system.toml of masses, rigid bodies or matrices.
    """
    from .basis import read_basis
    from .stages.job import open_job, system_file
    from .stages.modal import modes_stage, system_stage
    from .stages.summary import basis_summary

    if (system := system_file(body)) is not None:
        path = system_stage(system, list(set_), output, force)
        if not quiet:
            print("\n".join(basis_summary(read_basis(path))))
        _say(path, quiet)
        return
    job = open_job(body, list(set_))
    with progress(f"modes of {job.settings.name}", quiet) as report:
        path, warnings = modes_stage(job, output, force, report)
    if not quiet:
        noted = [f"note of {job.path}: {job.settings.note}"] * bool(job.settings.note)
        said = [*noted, *(f"warning: {text}" for text in warnings)]
        print("\n".join([*basis_summary(read_basis(path)), *said]))
    _say(path, quiet)


@app.command
def run(
    path: Path, /, *, no_stress: NoStress = False, no_pictures: NoPictures = False, figures: Figures = None,
    set_: Set = (), force: Force = False, quiet: Quiet = False,
) -> None:  # fmt: skip
    """The whole chain of a body or a case: mesh, modal file, friction response, pictures, report.

    Args:
        path: a body.toml, a system.toml, a case.toml, or the folder that holds it; the name of a body or a case; a
            folder or file of products; or the word sample, as respond has it.
    """
    from .analysis import places
    from .basis import read_basis
    from .stages.job import holds_a_case_alone, open_job, system_file
    from .stages.places import is_case, rolls
    from .stages.response import Wanted
    from .stages.running import run_body, run_case_file, run_system, unsolved
    from .stages.summary import frequency_lines

    draw_beside(figures)
    if str(path) == "sample" and not path.exists():
        return respond(path, set_=set_, no_stress=no_stress, no_pictures=no_pictures, force=force, quiet=quiet)
    wanted = Wanted("none" if no_stress else "all", not no_pictures)
    path = meant(path)
    path = path / "case.toml" if holds_a_case_alone(path) else path
    if rolls(path):
        return roll(path, no_pictures=no_pictures, set_=set_, force=force, quiet=quiet)
    if (system := system_file(path)) is not None:
        with progress(f"run {system}", quiet) as report:
            page, converged = run_system(system, list(set_), force, report, wanted)
    elif is_case(path):
        with progress(f"run {path}", quiet) as report:
            page, converged = run_case_file(path, list(set_), force, report, wanted)
    else:
        job = open_job(path, list(set_))
        with progress(f"run {job.settings.name}", quiet) as report:
            page, converged = run_body(job, force, report, wanted)
        if not quiet:
            print("\n".join(frequency_lines(read_basis(job.basis_file))))
    _say(page, quiet)
    if not converged:
        others = page.stem in places()
        some = f"some points of the response did not converge; they are marked in {page.name}"
        raise NotConverged(some if others else unsolved(page.parent) or some)


@app.command
def closure(
    body: Path, name: str | None = None, /, *, low: Annotated[float, Parameter(name="--from")] = 0.0,
    high: Annotated[float, Parameter(name="--to")], points: int = 9, rpm: float = 0.0, output: Output = None,
    set_: Set = (), quiet: Quiet = False,
) -> None:  # fmt: skip
    """Press a closure step by step: its normal force and stiffness over the approach, as a table and a picture.

    Args:
        body: a body.toml with [[closures]], or the folder that holds it.
        name: of the closure; may be left out where there is only one.
        low: first approach of the faces (their interference), in the body's length_unit; negative: a gap.
        high: last one.
        points: number of steps.
        rpm: speed of rotation.
        output: folder for the table and the picture; build/NAME if not given.
    """
    from .stages.closure import closure_stage
    from .stages.job import open_job

    job = open_job(body, list(set_))
    with progress(f"closure of {job.settings.name}", quiet) as report:
        found = closure_stage(job, name, low, high, points, rpm, output, report)
    _tell(found, quiet, "")


@app.command
def contact(
    file: Path, /, *, output: Output = None, vary: Vary = None, figures: Figures = None, set_: Set = (),
    quiet: Quiet = False,
) -> None:  # fmt: skip
    """What a contact law does: force, stiffness, loops, slip orbits, friction, microslip, wear; as PNG and CSV.

    Args:
        file: a contact.toml, or the number of one of the book's figures: 3.5-2, 3.7-7, 3.9-2 (`init contact` has all).
        output: folder for pictures and tables; build/NAME if not given.
    """
    from .stages.contact import contact_stage

    draw_beside(figures)
    file = file if file.exists() else _figure_of_the_book(file)
    file = file / "contact.toml" if file.is_dir() else file
    with progress(f"contact {file}", quiet) as report:

        def one(own: list[str], folder: Path | None) -> Written:
            return contact_stage(file, own, folder, report)

        if vary and output:
            raise UserError("each value has a folder of its own; leave one of the two out", "--output with --vary")
        found = _varied(file, vary, set_, one, report) if vary else one(list(set_), output)
    _tell(found, quiet, "")


def _varied(
    path: Path, vary: str, set_: Sequence[str], one: Callable[[list[str], Path], Written],
    report: Callable[[str], None], root: Path = Path("build"),
) -> Written:  # fmt: skip
    """See `stages.varying.varied`, which is loaded where it is asked for."""
    from .stages.varying import varied

    return varied(path, vary, set_, one, root, report)


def _figure_of_the_book(file: Path) -> Path:
    """The contact file of a figure by its number, 3.7-7 or fig-3.7-7; any other name as it is.

    Raises:
        UserError: a number that no file has.
    """
    known = {p.stem.removeprefix("fig-"): p for p in (_cases() / "contact").glob("fig-*.toml")}
    number = str(file).removeprefix("fig-")
    if re.fullmatch(r"\d\.\d+-\d+[a-z]?", number) and number not in known:
        raise UserError(f"{file}: there is no such figure; choose one of {', '.join(sorted(known))}")
    return known.get(number, file)


@app.command
def respond(
    case: Path, basis: Path | None = None, /, *, over: Over = None, set_: Set = (), log: Log = False,
    compare_book: Book = False, stability: Stability = False, all_stresses: Everywhere = False,
    no_stress: NoStress = False, no_pictures: NoPictures = False, figures: Figures = None, vary: Vary = None,
    force: Force = False, quiet: Quiet = False,
) -> None:  # fmt: skip
    """Friction response of a case on a modal file that is there already; needs neither gmsh nor VTK.

    Every finished point is kept; interrupted, the same command goes on where it was.

    Args:
        case: a case.toml, the folder that holds it, its name, or its products; or the word sample: a blade that travels
            with the package.
        basis: the modal file of the only body; basis.h5 beside the case, or build/<body>/basis.h5, if not given.
        over: instead of one sweep: the response followed through folds over frequency, load or normal force, as [curve]
            in the case asks; the resonance of every engine order, the line f = e n / 60 over speeds, or the envelope
            over ranges of damping, load and friction, as the table of that name asks.
    """
    from .case import load_case
    from .case.comparison import sentence
    from .stages import running
    from .stages.response import Wanted, response_of_case
    from .stages.stage import folder_of_case

    draw_beside(figures)
    case = case_file(case)
    if vary and (compare_book or stability):
        raise UserError("leave --compare-book and --stability out, or --vary", "--vary")
    if over is not None:
        _survey(case, basis, over.replace("-", "_"), set_, force, quiet, vary)
        return
    stresses: Literal["all", "resonances", "none"] = "all" if all_stresses else "resonances"
    wanted = Wanted("none" if no_stress else stresses, not no_pictures)
    if vary:
        with progress(f"respond {case}", quiet) as report:

            def one(own: list[str], folder: Path) -> Written:
                running.respond(case, basis, own, force, report, log=log, wanted=wanted, folder=folder)
                return running.response_of(folder)

            family = _varied(case, vary, set_, one, report)
        return _tell(family, quiet, f"{family.missing}; {{page}} holds what was found")
    with (
        progress(f"respond {case}", quiet) as report,
        response_of_case(folder_of_case(case, load_case(case, list(set_))[0].name), report=report).making(),
    ):
        if compare_book:
            table, pairs, converged = running.compare_book(case, basis, list(set_), force, report, log=log)
        else:
            table, converged = running.respond(case, basis, list(set_), force, report, log=log, wanted=wanted)
        if stability:
            from .stages.answer import case_job
            from .stages.multipliers import stability_of_points

            job = case_job(case, basis, set_, force, report, not no_pictures, make=False)
            found = stability_of_points(job)
    for line in map(sentence, pairs if compare_book else ()):
        _say(line, quiet)
    _say(table, quiet)
    if stability:
        _tell(found, quiet, "")
    if not converged:
        raise NotConverged(running.unsolved(table.parent, compare_book))


@app.command
def identify(
    case: Path, basis: Path | None = None, /, *, set_: Set = (), force: Force = False, quiet: Quiet = False
) -> None:
    """Contact stiffness from one measured frequency of a coupled ring; the other nodal diameters are predicted.

    Args:
        case: a case.toml with [identification], or the folder that holds it.
        basis: the modal file, as for respond.
    """
    _survey(case_file(case), basis, "identification", set_, force, quiet)


def _survey(
    case: Path, basis: Path | None, kind: str, set_: Sequence[str], force: bool, quiet: bool, vary: str | None = None
) -> None:
    from .stages.answer import case_job
    from .stages.surveying import survey_stage

    with progress(f"{kind.replace('_', ' ')} of {case}", quiet) as report:

        def one(own: Sequence[str], folder: Path | None = None) -> Written:
            job = case_job(case, basis, own, force, report, make=False)
            return survey_stage(replace(job, folder=folder or job.folder), kind)

        found = _varied(case, vary, set_, one, report) if vary else one(set_)
    _tell(found, quiet, f"{found.missing}; {{page}} holds what was found")


def _tell(found: Written, quiet: bool, lost: str) -> None:
    """What is said of an answer, and its files; those of a motion's moments are named in its .pvd.

    Raises:
        NotConverged: something is lost: what, with the {page} that says more.
    """
    named = (str(p) for p in found.files if p.suffix != ".vtu" or p.parent.name != "motion")
    _say("\n".join([*found.said, *named]), quiet)
    if not found.whole:
        raise NotConverged(lost.format(page=found.files[0]))


@app.command
def roll(
    case: Path, /, *, no_pictures: NoPictures = False, figures: Figures = None, vary: Vary = None, set_: Set = (),
    force: Force = False, quiet: Quiet = False,
) -> None:  # fmt: skip
    """A wheel on a rail, or any two bodies that roll on each other: patches, creep curve, tractions; with [vehicle] how
    unround wheels wear over their circumference, and which waves grow; a tyre whose slip jumps.

    Args:
        case: a case.toml with [wheel] and [rail], or with [tyre], the folder that holds it, its name, or its products.
    """
    from .stages.rolling import roll_stage

    draw_beside(figures)
    case = case_file(case)
    with progress(f"roll {case}", quiet) as report:

        def one(own: Sequence[str], folder: Path | None = None) -> Written:
            return roll_stage(case, Path("build"), own, force, report, not no_pictures, folder)

        found = _varied(case, vary, set_, one, report) if vary else one(set_)
    _tell(found, quiet, "the run ended early; {page} says why, and holds what was found")


@app.command
def stability(
    path: Path, /, *, speed: int | None = None, no_pictures: NoPictures = False, figures: Figures = None,
    vary: Vary = None, set_: Set = (), force: Force = False, quiet: Quiet = False,
) -> None:  # fmt: skip
    """Does it move by itself: all complex roots in a window of frequencies and growth rates, none missed.

    Args:
        path: a body.toml (of matrices with [stability]), the folder that holds it, its name, or a modal file; or a case
            whose contacts slide, with [stability].
        speed: of a modal file, or a body with a mesh: which of its speeds, counted from 0; the first if not given.
    """
    from .stages.places import is_case
    from .stages.stability import stability_stage

    draw_beside(figures)
    path = path if path.suffix == ".h5" else meant(path)
    if (path / "case.toml").is_file() and not (path / "body.toml").is_file():
        path = path / "case.toml"
    if is_case(path):
        if speed is not None:
            raise UserError(f"{path}: --speed {speed}: is of a modal file; a case has bodies.speed")
        return _analyse("stability", "stability", path, None, no_pictures, set_, force, quiet, vary)
    if vary:
        raise UserError("is of a case whose contacts slide; leave it out", "--vary", path)
    with progress(f"stability {path}", quiet) as report:
        found = stability_stage(path, list(set_), force, report, not no_pictures, speed)
    _tell(found, quiet, "roots in the window are missing; {page} says what")


@app.command
def check(file: Path, /, *, short: Short = False, quiet: Quiet = False) -> None:
    """Verify a modal file: shapes, orthogonality, frames, compliances, the solver's certificate; or a response file:
    energy, read-outs, tables.

    Args:
        file: a basis.h5, a response.h5, or a folder with either or both.
    """
    there = [file / name for name in ("basis.h5", "response.h5") if (file / name).is_file()]
    for one in there or [_modal_file(file)]:
        _check(one, short, quiet)


def _check(file: Path, short: bool, quiet: bool) -> None:
    """One file, which may be either."""
    from .basis import check_basis, read_basis
    from .basis.files import OtherFormat
    from .results.files import FORMAT
    from .ring.expansion import ring_checks

    try:
        basis = read_basis(file)
    except OtherFormat as other:
        if other.form != FORMAT:
            raise
        return _check_response(file, short, quiet)
    _say_seal(file, quiet)
    _verdict(file, [*check_basis(basis), *ring_checks(basis)], short, quiet)


def _check_response(file: Path, short: bool, quiet: bool) -> None:
    """What a response file claims, and what its modal files say of it where they are still there."""
    from .results import read_response
    from .results.checks import check_response, sentence

    found = read_response(file)
    _say_seal(file, quiet)
    bases, missing = _modal_files(found)
    findings = check_response(found, bases)
    if missing and not short:
        _say(f"{file}: read-outs of {', '.join(missing)} are not compared, there is no modal file that fits", quiet)
    if not found.finished:
        _say(f"{file}: points are missing", quiet)
    _say(f"{file}: {sentence(found, found.estimated)}", quiet)
    _verdict(file, findings, short, quiet)


def _modal_files(response: Response) -> tuple[dict[str, ModalBasis], list[str]]:
    """Member -> modal file that a response was computed with, and the components whose files are gone or others."""
    from .basis import read_basis
    from .files.store import hash_file

    there = {name: Path(b.file) for name, b in response.bodies.items() if Path(b.file).is_file()}
    fits = {name: file for name, file in there.items() if hash_file(file) == response.bodies[name].sha256}
    return {name: read_basis(file) for name, file in fits.items()}, [n for n in response.bodies if n not in fits]


def _verdict(file: Path, findings: list[Check], short: bool, quiet: bool) -> None:
    """The findings line by line, what fails alone if short or quiet, and the verdict.

    Raises:
        NotConverged: one failed.
    """
    from .basis.checks import worst_of_each

    failed = [c for c in findings if not c.passed]
    for c in failed if quiet else worst_of_each(failed) if short else findings:
        mark = "ok  " if c.passed else "FAIL"
        print(f"{mark} {c.name}: {c.value:.3g} (limit {c.limit:.3g}){'  ' + c.message if c.message else ''}")
    if failed:
        raise NotConverged(f"{file}: {len(failed)} of {len(findings)} checks failed")
    _say(f"{file}: all {len(findings)} checks passed", quiet)


def _say_seal(file: Path, quiet: bool) -> None:
    """A line, the first, if a file that could be read has no seal."""
    from .files.hdf5 import seal_state

    if seal_state(file) == "absent":
        _say(f"{file}: not sealed: written by another program, or changed since it was written; what follows is "
             "recomputed from its numbers, and those that nothing else tells may be wrong", quiet)  # fmt: skip


@app.command(name="import")
def import_(
    file: Path, /, *more: Path, unit: str | None = None, apart: Apart = False, density: float | None = None,
    young: float | None = None, poisson: float | None = None, modes: bool = False, solids_only: SolidsOnly = False,
) -> None:  # fmt: skip
    """Make a body.toml around a CAD file, a mesh or matrices, or a modal file from measured modes.

    Several CAD files, or several meshes, of parts that touch become an assembly: a body.toml each, with the faces where
    they touch, and a case.toml with the contacts between them.

    Args:
        file: a CAD file (.step, .stp, .brep, .iges), a mesh (.inp, .cdb, .bdf, .med, .unv, .msh), a stiffness matrix
            (.mtx, .mat, .h5, .op4, .pch, .sti), or modes of a test (.uff, .unv with data set 55).
        more: the other parts of an assembly, and the folder of the new files, last; one of their names if not given.
            A part may be a folder with a body.toml that is there already.
        unit: of lengths; if not given what the file tells (/UNITS of Ansys, data set 164), else mm.
        density: kg/m3, whatever the unit of the file, of materials that have none there; steel's 7850 if not given.
        young: Pa, likewise, of materials without elastic constants, and of kinds that are not read; 2.1e11.
        poisson: likewise; 0.3.
        modes: compute them at once; the first frequencies stand on the page.
    """
    from .stages.decks import import_apart, import_deck, with_modes
    from .stages.importing import CAD, substitute
    from .stages.parts import import_parts

    parts = [file, *(p for p in more if p.is_file() or (p / "body.toml").is_file() or p is not more[-1])]
    folder = more[-1] if len(parts) <= len(more) else None
    instead = substitute(density, young, poisson)
    if apart and len(parts) > 1:
        raise UserError(f"import --apart: sets the solids of one file apart, and {len(parts)} parts are given")
    with progress(f"import {file}", quiet=file.suffix.lower() not in CAD) as report:
        if apart:
            made = import_apart(file, folder, unit, report, instead)
        elif len(parts) == 1:
            made = import_deck(file, folder, unit, report, instead, solids_only)
        else:
            made = import_parts(parts, folder, unit, report, instead)
    first = made.told[: -1 if modes else None]  # said even where the modes fail
    for line in first:
        print(line)
    if modes:
        with progress(f"modes of {made.path.parent}") as report:
            made = with_modes(made, report)
        print("\n".join(line for line in made.told if line not in first))


@app.command
def export(
    file: Path, /, *, to: str, output: Output = None, ring: Ring = False, speed: int | None = None,
    nodal_diameter: int | None = None, rpm: float | None = None,
) -> None:  # fmt: skip
    """Write a modal file in another program's format.

    Args:
        file: a basis.h5.
        to: format; one that does not exist lists them all, with the programs that read them.
        speed: this one of the file's speeds only, counted from 0.
        nodal_diameter: of a cyclic body: this one only.
        rpm: of a modal file with a speed range: this speed alone.
    """
    from .basis import read_basis
    from .exchange import formats, writer

    file = _modal_file(file)
    write = writer(to)
    if ring:
        if to != "vtu":
            raise UserError("export --ring: only vtu can hold the ring; leave --ring out for one sector")
        if nodal_diameter is not None or rpm is not None:
            raise UserError("export --ring: every nodal diameter of one speed is written; give --speed alone")
        from .exchange.vtu import write_ring

        print(write_ring(read_basis(file), output or file.with_name(f"{file.stem}_ring.pvd"), speed or 0))
        return
    if rpm is not None and speed is not None:
        raise UserError("export --rpm: it chooses the speed already; leave --speed out")
    target = output or file.with_name(file.stem + formats()[to].ending)
    chosen = _chosen(file, rpm, speed, nodal_diameter)
    write(chosen, target)
    print(target)
    _warn(formats()[to].warnings(chosen))


@app.command
def compare(
    first: Path, second: Path, /, *, output: Output = None, speed: int = 0, nodal_diameter: int = 0,
    distance: float | None = None, least: float = 0.5, unit: str = "mm", quiet: Quiet = False,
) -> None:  # fmt: skip
    """Frequencies, MAC and pairs of modes of two modal files, computed or measured; pictures side by side.

    Measured functions of a Universal File are laid beside those that the modes of the other file give.

    Args:
        first: a basis.h5, or a Universal File (.uff, .unv) with modes (data sets 55, 2414) or functions (58).
        second: another one, in the same frame.
        output: folder for mac.png, pairs.png and pairs.csv; nothing is written if not given.
        speed: which of the files' speeds, counted from 0.
        nodal_diameter: of cyclic bodies.
        distance: m, largest distance between points that count as the same; a hundredth of the body if not given.
        least: MAC below which modes stay unpaired.
        unit: of lengths of a Universal File that does not tell it.
    """
    from .exchange.measured import opened
    from .mesh.unv import UNIVERSAL
    from .modal.sampling import on_common_points
    from .reduced.correlation import compare_groups, pair_table

    if not 0 <= least <= 1:
        raise UserError(f"compare --least {least:g}: a MAC lies between 0 and 1; choose a number there")
    files = [f if f.suffix.lower() in UNIVERSAL else _modal_file(f) for f in (first, second)]
    bodies, told = opened(files, (speed, nodal_diameter), unit)
    for line in told:
        _say(line, quiet)
    if len(bodies) < 2:
        return
    seen = on_common_points(*bodies)
    found = compare_groups(*seen, (speed, nodal_diameter), distance, least)
    _say("\n".join(pair_table(found)), quiet)
    if output is None:
        return
    from . import pictures
    from .files.store import write_text
    from .pictures.comparison import draw_comparison
    from .reduced.correlation import pair_rows

    reason = pictures.can_draw()
    write_text(output / "pairs.csv", pair_rows(found))
    drawn = draw_comparison((bodies[0], bodies[1]), seen, found, (speed, nodal_diameter), output, not reason)
    _warn([f"no pictures of the shapes: {reason}"] if reason else [])
    _say("\n".join(str(f) for f in (*drawn.values(), output / "pairs.csv")), quiet)


@app.command
def report(file: Path, /, *, output: Output = None, quiet: Quiet = False) -> None:
    """Pictures and one self-contained page of a modal file.

    Args:
        file: a basis.h5.
        output: the page; report.html beside the file if not given.
    """
    from . import pictures
    from .basis import read_basis
    from .files.store import making, write_text
    from .modal.campbell import engine_orders
    from .report.body import report_html

    file = _modal_file(file)
    basis = read_basis(file)
    page = output or file.with_name("report.html")
    with progress(f"report of {basis.name}", quiet) as tell, making(page, tell):
        reason = pictures.can_draw()
        orders = engine_orders(basis)
        drawn = {} if reason else pictures.draw_all(basis, page.parent / "pictures", tell, orders)
        write_text(page, report_html(basis, drawn, [f"The pictures are missing: {reason}"] if reason else []))
    _say(page, quiet)


@app.command
def info(
    file: Path, /, *, output: Output = None, unit: str | None = None, speed: int | None = None,
    nodal_diameter: int | None = None, rpm: float | None = None,
) -> None:  # fmt: skip
    """What a file holds: a modal file, a mesh, a CAD file (its faces, to choose from), matrices, or a body.toml.

    Args:
        file: basis.h5 or its folder, a mesh, a STEP or BREP file, matrices, or a body.toml.
        output: of a CAD file: a picture (.png) of its surfaces with their numbers.
        unit: unit of length of a mesh or CAD file; if not given what the file tells, else mm.
        speed: of a modal file: this one of its speeds only, counted from 0.
        nodal_diameter: of a cyclic body: this one only.
        rpm: of a modal file with a speed range: what it holds at this speed.
    """
    from .stages.importing import CAD, MATRICES, cad_table, length_unit

    if not file.exists():
        raise UserError(f"{file}: there is no such file; correct the path")
    if file.is_dir() and not (file / "body.toml").is_file() and (file / "basis.h5").is_file():
        file = file / "basis.h5"
    metre = length_unit(unit, file)
    suffix = file.suffix.lower()
    if suffix in (".h5", ".hdf5"):
        from .stages.summary import basis_summary

        print("\n".join(basis_summary(_chosen(file, rpm, speed, nodal_diameter))))
    elif suffix in CAD:
        text, reason = cad_table(file, metre, output)
        print(text)
        _warn([f"no picture of the surfaces: {reason}"] if reason else [])
        if output is not None and not reason:
            print(output)
    elif suffix == ".toml" or file.is_dir():
        from .stages.job import open_job

        job = open_job(file)
        s = job.settings
        print(f"{s.name}{': ' * bool(s.description)}{s.description}\nmesh {job.mesh_file}\nmodal file {job.basis_file}")
        print(f"case {job.case_file or 'none: the chain ends at the report'}")
    elif suffix in MATRICES:
        from .exchange.matrices import matrix_names

        print(f"{file}: matrices {_words(matrix_names(file))}")
    else:
        _tell_mesh(file, metre)


def _tell_mesh(file: Path, unit: str) -> None:
    """What a mesh holds, and what is wrong with it."""
    from .mesh import mesh_problems, read_mesh
    from .stages.meshing import linked_mesh

    grid = linked_mesh(file, read_mesh(file, unit))
    size = (grid.points.max(axis=0) - grid.points.min(axis=0)).tolist()
    kinds = ", ".join(f"{len(c)} {t}" for t, c in grid.cells.items())
    print(f"{file}: {grid.n_points} points, {kinds}, {size[0]:.4g} x {size[1]:.4g} x {size[2]:.4g} m")
    print(f"faces: {_words(grid.faces)}\npoint sets: {_words(grid.point_sets)}")
    if grid.supports:
        print(f"supports: {_words(f'{name} in {directions}' for name, directions in grid.supports.items())}")
    for text in grid.remarks:
        print(f"note: {text}")
    errors, warnings = mesh_problems(grid)
    _warn(warnings)
    if errors:
        raise UserError("\n".join(f"{file}: {e}" for e in errors))


def _modal_file(path: Path) -> Path:
    """The modal file in a folder of products, or the file itself.

    Raises:
        UserError: another folder.
    """
    if not path.is_dir():
        return _not_foreign(path)
    if (path / "basis.h5").is_file():
        return path / "basis.h5"
    if (path / "body.toml").is_file():
        made = f"microslip modes {shlex.quote(str(path))} makes"
        raise UserError(f"{path}: holds a body, not its modal file; give build/NAME/basis.h5, which {made}")
    raise UserError(f"{path}: is a folder without a modal file basis.h5; correct the path")


def _not_foreign(path: Path) -> Path:
    """The path of what may be a modal file.

    Raises:
        UserError: by its name and bytes it is another program's file, or settings.
    """
    import h5py

    from .stages.importing import KINDS

    what = KINDS.get(path.suffix.lower())
    if what is None or not path.is_file() or h5py.is_hdf5(path):
        return path
    way = "run" if path.suffix == ".toml" else "import"
    raise UserError(f"{path}: is {what} and no modal file; type: microslip {way} {shlex.quote(str(path))}")


def _chosen(file: Path, rpm: float | None, speed: int | None, nodal_diameter: int | None) -> ModalBasis:
    """A modal file's groups of one speed and nodal diameter, as far as they are given."""
    from .basis import read_basis
    from .exchange.choice import select

    basis = read_basis(file)
    if rpm is not None:
        from .modal.speed_range import basis_at

        basis = basis_at(basis, rpm)
    return select(basis, speed, nodal_diameter)


def _say(text: object, quiet: bool) -> None:
    if not quiet:
        print(text)


def _words(names: Iterable[str]) -> str:
    return ", ".join(sorted(names)) or "none"


def _warn(warnings: list[str]) -> None:
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)


def _expected(words: Sequence[str]) -> float | None:
    """See `settings.amount`, which is not loaded at once: it loads numpy."""
    from .settings.amount import expected

    return expected(words)


_ARGUMENTS = """Args:
    case: a case.toml, the folder that holds it, its name, or its products.
    basis: see respond; made where it is not up to date if not given.
"""


def _analyse(
    name: str, verb: str, case: Path, basis: Path | None, no_pictures: bool, set_: Sequence[str], force: bool,
    quiet: bool, vary: str | None,
) -> None:  # fmt: skip
    """The answer of an analysis."""
    from .analysis import analyses
    from .stages.analysing import analysed
    from .stages.answer import case_job

    with progress(f"{verb} {case}", quiet) as report:

        def one(own: Sequence[str], folder: Path | None = None) -> Written:
            job = case_job(case, basis, own, force, report, not no_pictures)
            return analysed(name, replace(job, folder=folder or job.folder))

        found = _varied(case, vary, set_, one, report) if vary else one(set_)
    _tell(found, quiet, f"{found.missing or analyses()[name].lost}; {{page}} says which and why")


def _verb(name: str, said: Verb) -> Callable[..., None]:
    """The command of an analysis."""

    def verb(
        case: Path, basis: Path | None = None, /, *, no_pictures: NoPictures = False, figures: Figures = None,
        vary: Vary = None, set_: Set = (), force: Force = False, quiet: Quiet = False, **keys: tuple[str, ...],
    ) -> None:  # fmt: skip
        draw_beside(figures)
        given = {key: values[0] if len(values) == 1 else json.dumps(values) for key, values in keys.items() if values}
        more = [f"{name}.{key}={value}" for key, value in given.items()]
        _analyse(name, said.name, case_file(case), basis, no_pictures, [*set_, *more], force, quiet, vary)

    of = inspect.signature(verb, eval_str=True)
    kept = [p for p in of.parameters.values() if p.kind is not p.VAR_KEYWORD]
    how = {key: Parameter(help=what, show_default=False) for key, what in said.options.items()}
    options = {key: Annotated[tuple[str, ...], of_key] for key, of_key in how.items()}
    more = [inspect.Parameter(key, inspect.Parameter.KEYWORD_ONLY, default=(), annotation=kind)
            for key, kind in options.items()]  # fmt: skip
    verb.__signature__ = of.replace(parameters=[*kept, *more])  # type: ignore[attr-defined]
    verb.__annotations__ = {p.name: p.annotation for p in (*kept, *more)}
    verb.__doc__ = f"{said.help}\n\n{_ARGUMENTS}"
    return verb


def _add_verbs() -> None:
    """Those of all analyses, whose modules are not loaded."""
    from .analysis import places, verb_of

    for name in places():
        if (said := verb_of(name)).name not in app:
            app.command(_verb(name, said), name=said.name)


_add_verbs()


def main(words: list[str] | None = None) -> int:
    """Run the command line and return the exit code: 0, 1, 2 or 130, see the top of this file."""
    _plain_where_needed()
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it warns of a home without a place for its fonts
    draw_beside(None)
    try:
        with announced(sys.argv[1:] if words is None else words, _expected):
            app(words, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
        return 0
    except CycloptsError as error:
        return _fail(f"{str(error).rstrip('., ')}; see microslip --help", 2)
    except UserError as error:
        return _fail(str(error), 2)
    except NotConverged as error:
        return _fail(str(error), 1)
    except MemoryError:
        return _fail("there is not enough memory; use a coarser mesh, fewer modes, or [output] gauss = false", 1)
    except ModuleNotFoundError as error:
        return _fail(_missing(error), 2)
    except BrokenPipeError:  # the reader of the output, `head` say, has gone
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        return _fail(f"{error.filename or 'a file'}: {error.strerror or error}; correct the path or its permissions", 2)
    except KeyboardInterrupt:
        return _fail("interrupted; what is finished is kept, and the same command goes on from there", 130)


def _plainly(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join({"µ": "u"}.get(c, "?") for c in error.object[error.start : error.end]), error.end


def _plain_where_needed() -> None:
    """A terminal without the letter µ shows um; nothing that cannot be shown ends a run."""
    codecs.register_error("plain", _plainly)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="plain")


def _missing(error: ModuleNotFoundError) -> str:
    extras = {
        "fem": ("skfem", "meshio", "gmsh", "qdldl"),
        "solve": ("jax", "matplotlib"),
        "viz": ("pyvista", "vtk", "vtkmodules", "imageio", "PIL"),
        "exchange": ("pyyeti", "pandas", "pyuff", "xarray"),
    }
    package = (error.name or "").split(".")[0]
    extra = next((e for e, packages in extras.items() if package in packages), None)
    if extra is None:
        raise error
    return f"this needs the package {error.name}, which is not installed; pip install 'microslip[{extra}]'"


def _fail(text: str, code: int) -> int:
    for line in text.splitlines():
        print(f"error: {line}", file=sys.stderr)
    return code


def entry() -> None:
    """Console script. A request to end (SIGTERM) is Ctrl-C but for the exit code: what is finished is kept."""
    interrupts.listen()
    code = main()
    if code == 130 or not code and interrupts.requested():
        interrupts.leave(interrupts.requested() or signal.SIGINT)
    sys.exit(code)


if __name__ == "__main__":
    entry()
