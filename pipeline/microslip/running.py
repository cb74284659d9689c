"""Running bodies and cases from beginning to end: the modal files a case needs, its response, the page."""

from __future__ import annotations

import contextlib
import difflib
import importlib.util
import json
import re
import shlex
import stat
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import assessment, store
from .basis import read_basis
from .body import load_toml
from .case import CaseResult, CaseSettings, keeping, load_case, run_case
from .case.assemble import Built, build
from .case.comparison import Pair, comparison_table, paired
from .case.settings import FIRST_HARMONICS
from .contact.kinds import sources_of_others
from .data import Array, ModalBasis, UserError
from .report import response_page
from .results import Journal, Response, open_journal, read_journal, read_response, response_of, write_response
from .results.checks import sentence
from .results.files import unit_of
from .results.names import apart
from .units import Quantity, amplitude_of, counted
from .workflow import Job, Report, code_hash, modes_stage, open_job, report_stage, system_file, system_stage

if TYPE_CHECKING:
    from .case.settings import BodyOfCase
    from .operating.patches import ContactMap

CASE_CODE = (
    "speed_range.py", "harmonic_balance", "contact", "system", "compliance.py", "truncation.py", "case", "continuation",
    "coordinates.py", "frames.py",
)  # fmt: skip
_ASSESSMENT_CODE = (
    "pictures/response.py", "pictures/operating.py", "operating", "assessment.py", "results", "report.py", "running.py",
)  # fmt: skip

# response --------------------------------------------------------------------------------------------------------


def response_stage(
    case_path: Path, files: Mapping[str, Path], folder: Path, assignments: list[str] | None = None,
    force: bool = False, report: Report = lambda _: None, log: bool = False,
) -> tuple[dict[str, Any], bool]:  # fmt: skip
    """Friction frequency response of a case in `folder`: HDF5, CSV, pictures, files for ParaView, a summary (JSON).

    Every finished point is kept in ``response.points``, from which an interrupted run goes on.

    Args:
        files: body of the case -> its modal file. log: write ``convergence.csv``.

    Returns:
        The summary, and whether every point converged.
    """
    with making_response(folder, report):
        return _response_stage(case_path, files, folder, assignments, force, report, log)


def making_response(folder: Path, report: Report) -> AbstractContextManager[None]:
    """A response and what belongs to it are made by one process at a time, see `store.making`."""
    return store.making(folder / "response.json", report)


def _response_stage(
    case_path: Path, files: Mapping[str, Path], folder: Path, assignments: list[str] | None, force: bool,
    report: Report, log: bool,
) -> tuple[dict[str, Any], bool]:  # fmt: skip
    settings, raw = load_case(case_path, assignments)
    summary_file = folder / "response.json"
    hashes = {name: store.hash_file(file) for name, file in files.items()}
    beside = hashes_of(keeping.files_of(settings, case_path))
    case = keeping.without_defaults(raw)
    inputs = {"case": case, "basis": hashes, "files": beside, "code": code_hash(CASE_CODE + _ASSESSMENT_CODE)}
    if store.nothing_to_do(summary_file, inputs, force, report):
        if log:
            _write_log(read_response(folder / "response.h5"), folder)
        summary = json.loads(summary_file.read_text())
        _tell(summary, report)
        return summary, summary["failed_points"] == 0
    bases = {name: read_basis(file) for name, file in files.items()}
    keeper = Keeper(folder, raw, hashes, {n: str(f) for n, f in files.items()}, force)
    try:
        begin = keeper.harmonics(settings, bases, case_path) if settings.looks_for_harmonics else FIRST_HARMONICS
        result = run_case(settings, bases, case_path, report, keeper.journal, begin)
    except KeyboardInterrupt:
        keeper.unfinished()
        raise
    summary = _finished(keeper, result, report)
    if log:
        _write_log(read_response(folder / "response.h5"), folder)
    _tell(summary, report)
    store.write_text(summary_file, json.dumps(summary, indent=1) + "\n")
    pictures = [folder / "pictures" / name for name in summary["pictures"].values()]
    store.note_product(summary_file, inputs, [*pictures, *(folder / name for name in summary["files"])])
    return summary, summary["failed_points"] == 0


def _tell(summary: Mapping[str, Any], report: Report) -> None:
    """The stuck modes and what a reader must know."""
    for i, mode in enumerate(summary.get("stuck_modes", ()), 1):
        f, D, width = (mode[key] for key in ("frequency_Hz", "damping_ratio", "half_power_width_Hz"))
        report(f"stuck mode {i}: {f:.6g} Hz, damping ratio {100 * D:.3g} %, half-power width {width:.3g} Hz")
    report(summary["checked"])
    for remark in summary["remarks"]:
        report(f"warning: {remark}")


def hashes_of(files: Mapping[str, Path]) -> dict[str, str]:
    """Name -> hash of files; what is missing is told where it is read."""
    return {name: store.hash_file(file) for name, file in files.items() if file.is_file()}


def inputs_of_points(built: Built, hashes: Mapping[str, str]) -> str:
    """Hash of all that the points of an assembly depend on. hashes: body of the case -> SHA-256 of its modal file."""
    others = hashes_of(sources_of_others())
    return store.fingerprint(keeping.of_points(built), hashes, code_hash(CASE_CODE), others)


@dataclass
class Keeper:
    """Where the points of a case are kept while it runs: `journal` opens ``response.points``.

    Before anything of a response is written its sidecar goes, see `store.unfinished`.
    """

    folder: Path
    raw: dict[str, Any]
    hashes: Mapping[str, str]
    files: Mapping[str, str]
    fresh: bool

    @property
    def points(self) -> Path:
        return self.folder / "response.points"

    @contextlib.contextmanager
    def journal(self, built: Built) -> Iterator[Journal]:
        """The journal of an assembly; see `results.open_journal`."""
        head = keeping.head_of(built, self.raw, self.hashes, self.files) | {"finished": False}
        self.begin()
        with open_journal(self.points, self._inputs(built), head, self.fresh) as journal:
            self.fresh = False
            yield journal

    def _inputs(self, built: Built) -> str:
        """Hash of all that the points depend on: where a motion may be one of several, that is the whole sweep."""
        sweep = built.settings.sweep
        return store.fingerprint(inputs_of_points(built, self.hashes), sweep.start, sweep.stop, sweep.points)

    def harmonics(self, settings: CaseSettings, bases: Mapping[str, ModalBasis], path: Path) -> int:
        """With how many to begin where their number is looked for: those of the points that are kept."""
        with contextlib.suppress(UserError, KeyError, ValueError, TypeError):
            head, _ = read_journal(self.points)
            kept = int(head["harmonics"])
            built = build(settings.with_harmonics(kept), bases, path)
            if not self.fresh and head["inputs"] == self._inputs(built):
                return kept
        return FIRST_HARMONICS

    def begin(self) -> None:
        """What stands in the folder counts no more."""
        store.unfinished(self.folder / "response.json")

    def unfinished(self) -> None:
        """``response.h5`` of what there is so far."""
        self.begin()
        if self.points.is_file():
            with contextlib.suppress(UserError):
                write_response(self.folder / "response.h5", read_response(self.points))


def _finished(keeper: Keeper, result: CaseResult, report: Report) -> dict[str, Any]:
    """Tables, pictures and files of a case that has run, and their summary."""
    from .harmonic_balance import response_table
    from .pictures.response import response_picture

    folder, summary = keeper.folder, summarise(result)
    keeper.begin()
    store.write_text(folder / "response.csv", response_table(result.responses))
    picture = folder / "pictures" / "response.png"
    with store.complete_or_absent(picture) as temporary:
        response_picture(result, temporary)
    response = _response(keeper, result, summary)
    write_response(folder / "response.h5", response)
    drawn, files = {"friction response": picture}, [folder / "response.h5", folder / "response.csv"]
    more = _assessed(result, response, folder, report)
    if more is not None:
        summary["resonances"] = more.rows or summary["resonances"]
        drawn, files = drawn | more.drawn, files + more.files
        summary["remarks"] += more.remarks
    summary["checked"] = sentence(response, response.estimated)
    if result.rising:
        summary["checked"] += f"; still rising at {counted(len(result.rising), 'end')} of the band"
    summary["response_sha256"] = store.hash_file(folder / "response.h5")
    summary["pictures"] = {title: path.name for title, path in drawn.items()}
    summary["files"] = [path.name for path in [*files, folder / "response.html"]]
    response_page(summary, drawn, folder / "response.html")
    return summary


def _response(keeper: Keeper, result: CaseResult, summary: Mapping[str, Any]) -> Response:
    """What goes into ``response.h5``: the journal's points of this case's sweep."""
    names = {keeping.series_name(n): n for n in result.responses}
    head, held = read_journal(keeper.points)
    low, high = result.settings.sweep.start, result.settings.sweep.stop
    found = {name: {k: p for k, p in held.get(name, {}).items() if low <= k <= high} for name in names}
    told = {"parameters": {name: {"normal_force": n} for name, n in names.items()}, "finished": True}
    told["estimated"] = result.truncation
    told |= {key: summary[key] for key in ("resonances", "stuck_modes", "remarks")}
    return response_of({**head, **told}, found)


@dataclass(frozen=True)
class _Assessed:
    rows: list[dict[str, Any]]
    drawn: dict[str, Path]
    files: list[Path]
    remarks: list[str]


def _assessed(result: CaseResult, response: Response, folder: Path, report: Report) -> _Assessed | None:
    """Stresses of the body that is watched, where its modal file holds stress modes, and its contacts; in pictures."""
    first = keeping.drawn_monitor(result.built)
    basis = result.built.bodies[result.built.assembly.outputs[0].member].basis
    if first is None or not assessment.has_stresses(basis, response, first[0]):
        return None
    member, monitor = first
    limits = result.settings.material_limits
    found = assessment.assess(response, basis, monitor, member, limits, report=report)
    maps, remarks = ({}, []) if found.highest is None else _maps(result, found, report)
    report("pictures of stresses")
    scenes = _can_draw() is None
    drawn = assessment.draw(found, basis, result.settings.name, folder / "pictures", scenes, maps)
    return _Assessed(found.table(), drawn, _for_paraview(found, basis, maps, folder), remarks)


def _maps(
    result: CaseResult, found: assessment.Assessment, report: Report
) -> tuple[dict[str, list[ContactMap]], list[str]]:
    """Title -> contacts at the worst resonance; nothing, and why, where they do not agree with the response."""
    top = found.highest
    assert top is not None
    report(f"contacts at {top.stressed_at:.6g} Hz")
    series = found.sweeps[top.normal_force][0]
    at = top.stressed
    row = {name: values[at] for name, values in series.arrays.items()} | {"status": series.status[at]}
    try:
        return {"contacts at resonance": keeping.maps_at(result.built, top.normal_force, row)}, []
    except UserError as error:
        report(f"warning: {error}")
        return {}, [str(error)]


def _for_paraview(
    found: assessment.Assessment, basis: ModalBasis, maps: Mapping[str, list[ContactMap]], folder: Path
) -> list[Path]:  # fmt: skip
    """The operating shape and the contacts at the worst resonance as VTU; nothing without meshio."""
    if not _is_there("meshio"):
        return []
    from .operating.patches import write_contact_vtu

    files = []
    if assessment.write_shape(found, basis, folder / "operating_shape.vtu") is not None:
        files.append(folder / "operating_shape.vtu")
    for patch in [patch for patches in maps.values() for patch in patches]:
        files.append(folder / f"contact_{re.sub(r'[^A-Za-z0-9_.-]', '_', patch.name)}.vtu")
        write_contact_vtu(patch, files[-1])
    return files


def _can_draw() -> str | None:
    """See `pictures.can_draw`."""
    if not _is_there("pyvista"):
        return "PyVista is not there"
    from .pictures import can_draw

    return can_draw()


def _is_there(package: str) -> bool:
    try:
        return importlib.util.find_spec(package) is not None
    except ImportError:  # an environment that hides it
        return False


def _write_log(response: Response, folder: Path) -> None:
    """``convergence.csv``: what Newton's method did at every point."""
    store.write_text(folder / "convergence.csv", convergence_table(response))


def convergence_table(response: Response) -> str:
    """CSV text: a row a point with its status, steps, and the error before every Newton step."""
    rows = ["sweep,frequency_Hz,peak,status,iterations,error,errors before each step"]
    for s in response.series:
        columns = [s.arrays.get(n, np.full(len(s.key), np.nan)) for n in ("peak", "iterations", "error")]
        history = s.arrays.get("history", np.zeros((len(s.key), 0)))
        for f, status, peak, steps, error, errors in zip(s.frequency, s.status, *columns, history, strict=True):
            each = " ".join(f"{e:.1e}" for e in errors if e)
            said = status.replace(",", ";")
            rows.append(f"{s.name},{f:.10g},{peak > 0:d},{said},{steps:.0f},{error:.1e},{each}")
    return "\n".join(rows) + "\n"


def summarise(result: CaseResult) -> dict[str, Any]:
    """Numbers of a case for the report and the terminal."""
    rows = []
    name = result.quantity.column("amplitude")
    for normal, peaks in result.resonances.items():
        rows += [{"normal_force_N": normal, "frequency_Hz": f, name: a} for f, a in peaks]
    failed = sum(int(np.sum(~r.converged)) for r in result.responses.values())
    truncation = {} if result.truncation is None else {"estimated_error_of_harmonics": result.truncation}
    return {
        "case": result.settings.name,
        "mode": result.settings.mode,
        "harmonics": result.settings.balanced,
        **truncation,
        "description": result.settings.description,
        "rotation_speed_rpm": result.speed * 30 / np.pi,
        "stuck_frequencies_Hz": [float(f) for f in result.stuck[:8]],
        "damping": result.settings.damping_as,
        "stuck_modes": _stuck_modes(result),
        **({"stuck_under_N": max(result.responses)} if result.responses else {}),
        "resonances": rows,
        "rising_at_the_edge": [
            {"normal_force_N": r.normal_force, "frequency_Hz": r.frequency, name: r.amplitude, "add": r.add}
            for r in result.rising
        ],
        "failed_points": failed,
        "remarks": list(result.remarks),
    }


def _stuck_modes(result: CaseResult) -> list[dict[str, float]]:
    """Damping of every mode with sticking contacts that the excited harmonics reach, and of the first one beyond."""
    most = result.settings.sweep.stop * result.settings.balanced
    count = int(np.searchsorted(result.stuck, most)) + 1
    pairs = zip(result.stuck[:count].tolist(), result.stuck_damping[:count].tolist(), strict=True)
    return [{"frequency_Hz": f, "damping_ratio": D, "half_power_width_Hz": 2 * D * f} for f, D in pairs]


# chains ------------------------------------------------------------------------------------------------------------


def run_body(job: Job, force: bool = False, report: Report = lambda _: None) -> tuple[Path, bool]:
    """The whole chain of a body, and of the case of the same name if there is one.

    Returns:
        The report's path, and whether every point of the response converged.
    """
    response, converged = None, True
    if job.case_file is not None:
        case, _ = load_case(job.case_file)
        if job.settings.name not in {b.body or b.name for b in case.members}:
            raise UserError(
                f"{job.case_file}: body: it names '{case.members[0].name}', but the body beside it is "
                f"'{job.settings.name}'; make them agree"
            )
    modes_stage(job, force=force, report=report)
    if job.case_file is not None:
        files = {b.name: job.basis_file for b in case.members if (b.body or b.name) == job.settings.name}
        files |= modal_files(case, job.case_file, job.root, report, known=files)
    with making_response(job.build_folder, report):
        if job.case_file is not None:
            response, converged = response_stage(job.case_file, files, job.build_folder, None, force, report)
        return report_stage(job, response, force, report), converged


def run_case_file(
    path: Path, assignments: list[str] | None = None, force: bool = False, report: Report = lambda _: None
) -> tuple[Path, bool]:
    """The modal files a case needs, and the case; the products of one not named like its body have their own folder.

    Returns:
        The report's path (the table's, for a case that has its own folder), and whether every point converged.
    """
    case, _ = load_case(path, assignments)
    files = modal_files(case, path, Path("."), report)
    if case.body is not None and case.body == case.name:
        job = open_job(find_body(path, case.body, Path(".")))
        with making_response(job.build_folder, report):
            response, converged = response_stage(path, files, job.build_folder, assignments, force, report)
            return report_stage(job, response, force, report), converged
    folder = Path(".") / "build" / case.name
    _, converged = response_stage(path, files, folder, assignments, force, report)
    return folder / "response.csv", converged


def modal_files(
    case: CaseSettings, path: Path, root: Path, report: Report, known: Mapping[str, Path] | None = None
) -> dict[str, Path]:
    """Body of a case -> its modal file, computed where that is not up to date.

    Raises:
        UserError: a body that is nowhere.
    """
    found = dict(known or {})
    for b in case.members:
        if b.name in found:
            continue
        body = b.body or b.name
        if b.file is not None:
            found[b.name] = _named(path, b)
        elif (lumped := _lumped(path, body)) is not None:
            found[b.name] = system_stage(lumped, report=report, root=root)
        else:
            job = open_job(find_body(path, body, root), root=root)
            modes_stage(job, report=report)
            found[b.name] = job.basis_file
    return found


def _lumped(case_path: Path, name: str) -> Path | None:
    """The system.toml of a small system of that name beside a case, in its folder or in one of the system's name."""
    for place in (case_path.parent / "system.toml", case_path.parent / name / "system.toml"):
        file = system_file(place) if place.is_file() else None
        if file is not None and load_toml(file).get("name") == name:
            return file
    return None


def run_system(
    path: Path, assignments: list[str] | None = None, force: bool = False, report: Report = lambda _: None
) -> tuple[Path, bool]:
    """The modal file of a system, and the friction response of the case.toml beside it if there is one.

    Returns:
        The path of the last product, and whether every point of the response converged.
    """
    basis_file = system_stage(path, assignments, None, force, report)
    case = path.parent / "case.toml"
    return respond(case, basis_file, force=force, report=report) if case.is_file() else (basis_file, True)


def respond(
    case_path: Path, basis_file: Path | None, assignments: list[str] | None = None, force: bool = False,
    report: Report = lambda _: None, root: Path = Path("."), log: bool = False,
) -> tuple[Path, bool]:  # fmt: skip
    """Friction response of a case on modal files that are there already: CSV, JSON, picture in build/<case>/.

    Args:
        basis_file: of the only body; None: basis.h5 beside the case, or build/<body>/basis.h5 of every body.

    Returns:
        The path of the table, and whether every point converged.

    Raises:
        UserError: the case is about another body, a modal file is missing.
    """
    case, _ = load_case(case_path, assignments)
    files = existing_files(case, case_path, basis_file, root)
    for b in case.members:
        name = read_basis(files[b.name]).name
        if (b.body or b.name) != name and b.file is None:
            raise UserError(
                f"{case_path}: body: it names '{b.body or b.name}', but {files[b.name]} holds '{name}'; make them agree"
            )
    folder = root / "build" / case.name
    summary, converged = response_stage(case_path, files, folder, assignments, force, report, log)
    rows = [*summary["resonances"], *summary["rising_at_the_edge"]]
    for row, normal in zip(rows, apart([row["normal_force_N"] for row in rows]), strict=True):
        note = f" ({row['note']})" if row.get("note") else f"; add {row['add']}" if "add" in row else ""
        report(f"F_N = {normal} N: {'still rising at ' if 'add' in row else ''}{_at(row)}{note}")
    return folder / "response.csv", converged


def _at(row: Mapping[str, Any]) -> str:
    """Frequency and amplitude of a row of a table."""
    amplitude, of = amplitude_of(row)
    return f"{row['frequency_Hz']:.6g} Hz, {amplitude:.4g} {of.said}"


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
    from .pictures.response import comparison_picture

    given = list(assignments or [])
    own, _ = load_case(case_path, given)
    case, _ = load_case(case_path, [*given, 'mode="aft"', "strips=0"])
    strips = load_case(case_path, [*given, 'mode="book"'])[0].strips
    files = existing_files(case, case_path, basis_file, root)
    folder = root / "build" / case.name
    folders = {mode: folder if mode == own.mode else folder / mode for mode in ("aft", "book")}
    ways = {
        "aft": (folders["aft"], [*given, 'mode="aft"', "strips=0"]),
        "book": (folders["book"], [*given, 'mode="book"', f"strips={strips}"]),
    }
    found = {m: response_stage(case_path, files, f, a, force, report, log) for m, (f, a) in ways.items()}
    pairs = paired(*(summary["resonances"] for summary, _ in found.values()))
    case = keeping.as_found(case, folder, case_path)
    table, picture = folder / "book.csv", folder / "pictures" / "book.png"
    of = Quantity(unit_of(next(iter(read_response(folder / "response.h5").labels))))
    store.write_text(table, comparison_table(pairs, of))
    marched, book = (_curves(f / "response.h5") for f, _ in ways.values())
    with store.complete_or_absent(picture) as temporary:
        comparison_picture(case, marched, book, temporary, of)
    return table, pairs, all(converged for _, converged in found.values())


def _curves(file: Path) -> dict[float, Array]:
    """Normal force (N) -> (2, f) Hz and amplitude of the first read-out, in a response file."""
    found, response = {}, read_response(file)
    first = next(iter(response.labels))  # whose first row is the first read-out, see `harmonic_balance.kept.labels`
    for s in response.series:
        whole = np.stack([s.frequency, np.where(s.converged, np.abs(s.arrays[first][:, 0, 1]), np.nan)])
        found[s.parameters["normal_force"]] = whole[:, np.argsort(s.frequency, kind="stable")]
    return found


def existing_files(case: CaseSettings, path: Path, basis_file: Path | None, root: Path) -> dict[str, Path]:
    """Body of a case -> a modal file that exists."""
    beside = path.with_name("basis.h5")
    if len(case.members) == 1 and case.members[0].file is None and (basis_file is not None or beside.is_file()):
        return {case.members[0].name: basis_file or beside}
    if basis_file is not None:
        raise UserError(f"{path}: has {len(case.members)} bodies; name their modal files in it (bodies.<name>.file)")
    found = {}
    for b in case.members:
        found[b.name] = _named(path, b) if b.file else root / "build" / (b.body or b.name) / "basis.h5"
        if not found[b.name].is_file():
            own = [beside] if len(case.members) == 1 else []
            raise UserError(_nowhere(case, path, b, [*own, found[b.name]], root))
    return found


def _named(path: Path, b: BodyOfCase) -> Path:
    """The modal file that a body of a case names.

    Raises:
        UserError: it is not there.
    """
    file = path.parent / (b.file or "")
    if not store.ordinary(file).is_file():
        raise UserError(
            f"{path}: bodies.{b.name}.file: there is no file {file}; paths in a case start in the folder of the case: "
            "correct it"
        )
    return file


def _nowhere(case: CaseSettings, path: Path, b: BodyOfCase, looked: list[Path], root: Path) -> str:
    """A modal file that is not there: where it was looked for, and what to type."""
    name, said = b.body or b.name, " or ".join(map(str, looked))
    begun = f"{path}: there is no modal file of '{name}': no {said} in {root.resolve()}"
    with contextlib.suppress(UserError):
        by_hand = _lumped(path, name)
        if by_hand is None:
            find_body(path, name, root)
        return f"{begun}; microslip run {shlex.quote(str(by_hand.parent if by_hand else path))} makes it"
    give = "give it after the case" if len(case.members) == 1 else f"name one in bodies.{b.name}.file"
    return f"{begun}; {_elsewhere(path, name, root) or f'correct the name, or {give}'}"


def _elsewhere(path: Path, name: str, root: Path) -> str:
    """What to do about a body that is not here: go to the folder where it is, or write the name of one that is."""
    here = root.resolve()
    for folder in dict.fromkeys((*path.resolve().parents, *here.parents)):
        there = (folder / "build" / name / "basis.h5", folder / "geometry" / name / "body.toml")
        if folder != here and any(p.is_file() for p in there):
            case = path.resolve()
            case = case.relative_to(folder) if case.is_relative_to(folder) else case
            return f"it is in {folder}: go there (cd {shlex.quote(str(folder))}) and give the case as {case}"
    known = sorted({p.parent.name for p in (*root.glob("build/*/basis.h5"), *root.glob("geometry/*/body.toml"))})
    close = difflib.get_close_matches(name, known, 1)
    if close:
        return f"is '{close[0]}' meant? Correct the name in the case"
    return f"the bodies here are {', '.join(known)}: correct the name in the case" if known else ""


def is_case(path: Path) -> bool:
    """True for a case file (it has a sweep), False for a body file."""
    return path.is_file() and path.suffix == ".toml" and bool({"body", "sweep"} & set(load_toml(path)))


def find_body(case_path: Path, name: str, root: Path) -> Path:
    """The body file of a name that a case gives.

    It stands beside the case, or in NAME/ or geometry/ of the case's folder, of one above it, or of `root`, the nearest
    first, so that a case means the same body wherever it is run. In geometry/ it is geometry/NAME/body.toml, or any
    file of geometry/*/ that says that name (a body's second arrangement, the other side of a rig).

    Raises:
        UserError: if there is none.
    """
    for number, folder in enumerate((*_above(case_path.parent, root), root)):
        beside = [folder / "body.toml"] if number == 0 else []
        usual = [*beside, folder / "geometry" / name / "body.toml", folder / name / "body.toml"]
        for file in (*filter(Path.is_file, usual), *sorted((folder / "geometry").glob("*/*.toml"))):
            if load_toml(file).get("name") == name:
                return file
    raise UserError(
        f"{case_path}: body: no body.toml of a body '{name}' is beside it, nor in {name}/ or geometry/ of its folder, "
        f"of one above it or of {root.resolve()}; "
        + (_elsewhere(case_path, name, root) or "correct the name, or type this where geometry/ is")
    )


def _above(first: Path, root: Path) -> Iterator[Path]:
    """A folder and those above it, seen from `root`, up to one in which anybody may write: what is found there may be
    anybody's."""
    yield first
    here = root.resolve()
    for folder in first.resolve().parents:
        if folder.stat().st_mode & stat.S_IWOTH:
            return
        yield root / folder.relative_to(here) if folder.is_relative_to(here) else folder
