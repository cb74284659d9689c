"""Bodies and cases from beginning to end."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..basis import read_basis
from ..case import CaseSettings, checkpoint, load_case
from ..case.comparison import Pair, comparison_table, paired
from ..data import Array
from ..errors import UserError
from ..files import store
from ..results import read_response
from ..results.names import apart
from ..results.series import unit_of
from ..units import Quantity, amplitude_of
from .analysing import analysed
from .answer import CaseJob, Written
from .job import Job, open_job
from .modal import modes_stage, system_stage
from .page import report_stage
from .places import existing_files, find_body, modal_files
from .response import ALL, Wanted, response_of_case, response_stage
from .stage import Report, folder_of_case


def run_body(
    job: Job, force: bool = False, report: Report = lambda _: None, wanted: Wanted = ALL
) -> tuple[Path, bool]:  # fmt: skip
    """The whole chain of a body, and of the case of the same name if there is one. wanted: besides tables.

    Returns:
        The report's path, and whether every point of the response converged.
    """
    response, converged = None, True
    if job.case_file is not None:
        case, _ = load_case(job.case_file)
        if job.settings.name not in {b.body or b.name for b in case.components}:
            raise UserError(
                f"{job.case_file}: body: it names '{case.components[0].name}', but the body beside it is "
                f"'{job.settings.name}'; make them agree"
            )
        folder_of_case(job.case_file, job.settings.name, job.root / "build")
    modes_stage(job, force=force, report=report)
    if job.case_file is not None:
        files = {b.name: job.basis_file for b in case.components if (b.body or b.name) == job.settings.name}
        files |= modal_files(case, job.root, report, known=files)
    with response_of_case(job.build_folder, report=report).making():
        if job.case_file is not None:
            response, converged = _answered(case, files, job.build_folder, None, force, report, wanted)
        return report_stage(job, response, force, report, wanted.pictures), converged


def _answered(
    case: CaseSettings, files: Mapping[str, Path], folder: Path, assignments: list[str] | None,
    force: bool, report: Report, wanted: Wanted,
) -> tuple[dict[str, Any] | None, bool]:  # fmt: skip
    """The response of a case, None if it asks for none, and what else it asks for; whether all converged."""
    response, converged = None, True
    if not case.has_no_response:
        response, converged = response_stage(case.path, files, folder, assignments, force, report, wanted=wanted)
        _tell(response, report)
    job = CaseJob(case.path, files, folder, assignments or (), force, report, wanted.pictures)
    for name in case.asked:
        converged = analysed(name, job).whole and converged
    return response, converged


def run_case_file(
    path: Path, assignments: list[str] | None = None, force: bool = False, report: Report = lambda _: None,
    wanted: Wanted = ALL,
) -> tuple[Path, bool]:  # fmt: skip
    """The modal files a case needs, and the case; the products of one not named like its body have their own folder.

    Returns:
        The report's path (the table's, for a case that has its own folder), and whether every point converged.
    """
    case, _ = load_case(path, assignments)
    folder = folder_of_case(path, case.name)
    files = modal_files(case, Path("."), report)
    if case.body is not None and case.body == case.name:
        job = open_job(find_body(path, case.body, Path(".")))
        with response_of_case(job.build_folder, report=report).making():
            response, converged = _answered(case, files, job.build_folder, assignments, force, report, wanted)
            return report_stage(job, response, force, report, wanted.pictures), converged
    _, converged = _answered(case, files, folder, assignments, force, report, wanted)
    page = f"{next(iter(case.asked))}.html" if case.has_no_response else "response.csv"
    return folder / page, converged


def run_system(
    path: Path, assignments: list[str] | None = None, force: bool = False, report: Report = lambda _: None,
    wanted: Wanted = ALL,
) -> tuple[Path, bool]:  # fmt: skip
    """The modal file of a system, and the friction response of the case.toml beside it if there is one.

    Returns:
        The path of the last product, and whether every point of the response converged.
    """
    basis_file = system_stage(path, assignments, None, force, report)
    case = path.parent / "case.toml"
    if not case.is_file():
        return basis_file, True
    return respond(case, basis_file, force=force, report=report, wanted=wanted)


def respond(
    case_path: Path, basis_file: Path | None, assignments: list[str] | None = None, force: bool = False,
    report: Report = lambda _: None, root: Path = Path("."), log: bool = False, wanted: Wanted = ALL,
    folder: Path | None = None,
) -> tuple[Path, bool]:  # fmt: skip
    """Friction response of a case on modal files that are there already: CSV, JSON, picture in a folder, if not given
    build/<case>/.

    Args:
        basis_file: of the only body; None: basis.h5 beside the case, or build/<body>/basis.h5 of every body.
            wanted: besides tables.

    Returns:
        The path of the table, and whether every point converged.

    Raises:
        UserError: the case is about another body, a modal file is missing.
    """
    case, _ = load_case(case_path, assignments)
    files = existing_files(case, basis_file, root)
    for b in case.components:
        name = read_basis(files[b.name]).name
        if (b.body or b.name) != name and b.file is None:
            raise UserError(
                f"{case_path}: body: it names '{b.body or b.name}', but {files[b.name]} holds '{name}'; make them agree"
            )
    folder = folder or folder_of_case(case_path, case.name, root / "build")
    summary, converged = response_stage(case_path, files, folder, assignments, force, report, log, wanted)
    _tell(summary, report)
    return folder / "response.csv", converged


def response_of(folder: Path) -> Written:
    """What a response in a folder has left for a reader."""
    summary = json.loads((folder / "response.json").read_text())
    files = [folder / name for name in summary["files"]]
    pictures = [folder / "pictures" / name for name in summary["pictures"].values()]
    said = [_at(row) for row in summary["resonances"]] or ["no resonance in the band"]
    whole = not summary["failed_points"]
    return Written([folder / "response.html", *files, *pictures], ["; ".join(said)], whole, unsolved(folder))


def unsolved(folder: Path, compared: bool = False) -> str:
    """Which points of the response in a folder did not converge; compared: in the other mode too, where it was."""
    folders = [folder, folder / "aft", folder / "book"] if compared else [folder]
    told = [json.loads(file.read_text()) for f in folders if (file := f / "response.json").is_file()]
    return "; ".join(f"{t['mode']}: " * compared + t["unsolved"] for t in told if t.get("unsolved"))


def _tell(summary: Mapping[str, Any], report: Report) -> None:
    """The resonances of a response, and where it still rises."""
    rows = [*summary["resonances"], *summary["rising_at_the_edge"]]
    for row, normal in zip(rows, apart([row["normal_force_N"] for row in rows]), strict=True):
        note = f" ({row['doubt']})" if row.get("doubt") else f"; add {row['add']}" if "add" in row else ""
        report(f"F_N = {normal} N: {'still rising at ' if 'add' in row else ''}{_at(row)}{note}")
    for words in summary.get("beyond", ()):
        report(words)


def _at(row: Mapping[str, Any]) -> str:
    """Frequency and amplitude of a row of a table."""
    amplitude, of = amplitude_of(row)
    return f"{row['frequency_Hz']:.6g} Hz, {of.sized(amplitude)}"


def compare_book(
    case_path: Path, basis_file: Path | None, assignments: list[str] | None = None, force: bool = False,
    report: Report = lambda _: None, root: Path = Path("."), log: bool = False,
) -> tuple[Path, list[Pair], bool]:  # fmt: skip
    """The response of a case in both modes, and what the book's leaves out: a table and a picture beside the response.

    The response in the case's own mode stands in build/<case>/, that in the other mode in a folder of its name there;
    whichever is there already is not computed again. Arguments: see `respond`.

    Returns:
        The path of the table, the resonances of both, and whether every point of both converged.
    """
    from ..pictures.plots import save
    from ..pictures.response import comparison_picture

    given = list(assignments or [])
    own, _ = load_case(case_path, given)
    case, _ = load_case(case_path, [*given, 'mode="aft"', "strips=0"])
    strips = load_case(case_path, [*given, 'mode="book"'])[0].strips
    files = existing_files(case, basis_file, root)
    folder = folder_of_case(case_path, case.name, root / "build")
    folders = {mode: folder if mode == own.mode else folder / mode for mode in ("aft", "book")}
    ways = {
        "aft": (folders["aft"], [*given, 'mode="aft"', "strips=0"]),
        "book": (folders["book"], [*given, 'mode="book"', f"strips={strips}"]),
    }
    found = {m: response_stage(case_path, files, f, a, force, report, log) for m, (f, a) in ways.items()}
    pairs = paired(*(summary["resonances"] for summary, _ in found.values()))
    case = checkpoint.as_found(case, folder)
    table, picture = folder / "book.csv", folder / "pictures" / "book.png"
    of = Quantity(unit_of(next(iter(read_response(folder / "response.h5").labels))))
    store.write_text(table, comparison_table(pairs, of))
    marched, book = (_curves(f / "response.h5") for f, _ in ways.values())
    save(partial(comparison_picture, case, marched, book, of=of), picture)
    return table, pairs, all(converged for _, converged in found.values())


def _curves(file: Path) -> dict[float, Array]:
    """Normal force (N) -> (2, f) Hz and amplitude of the first read-out, in a response file."""
    found, response = {}, read_response(file)
    first = next(
        iter(response.labels)
    )  # whose first row is the first read-out, see `harmonic_balance.checkpoint.labels`
    for s in response.series:
        whole = np.stack([s.frequency, np.where(s.converged, np.abs(s.arrays[first][:, 0, 1]), np.nan)])
        found[s.parameters["normal_force"]] = whole[:, np.argsort(s.frequency, kind="stable")]
    return found
